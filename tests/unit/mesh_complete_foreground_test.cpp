// SPDX-License-Identifier: Apache-2.0
#include "npsim/mesh/complete.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "mesh_fixture.hpp"

using namespace mesh_test;

namespace {

constexpr ForegroundParams kNoWidening = ForegroundParams::thesis();

// No face joins two objects, and none that three vertices of one object allow is missing.
void check_objects(Picture& p) {
  const SheetLayer layer = p.foreground.view();
  const Indexed mesh = index(layer);
  const auto object_of = [&](std::uint32_t v) {
    return p.object(static_cast<int>(mesh.pixels[v]) % p.shape.width, static_cast<int>(mesh.pixels[v]) / p.shape.width);
  };
  for (const Face& f : mesh.faces) {
    REQUIRE(object_of(f.a) != 0);
    REQUIRE(object_of(f.a) == object_of(f.b));
    REQUIRE(object_of(f.a) == object_of(f.c));
  }
  std::size_t expected = 0;
  for (int y = 0; y + 1 < p.shape.height; ++y) {
    for (int x = 0; x + 1 < p.shape.width; ++x) {
      std::map<std::uint32_t, std::size_t> corners;
      for (int k = 0; k < 4; ++k) {
        const int i = x + (k & 1);
        const int j = y + (k >> 1);
        if (has_vertex(layer.vertices(i, j))) ++corners[p.object(i, j)];
      }
      for (const auto& [object, n] : corners) expected += n > 2 ? n - 2 : 0;
    }
  }
  CHECK(mesh.faces.size() == expected);
}

}  // namespace

TEST_CASE("an object grows from its kept core by the mean of what is already known") {
  Picture p({9, 7});
  p.rectangle(1, 1, 7, 5, label::car, 50.0F);
  p.doubt(1, 1, 7, 5);
  for (int x = 3; x <= 5; ++x) {
    p.depth(x, 3) = static_cast<float>(x);
    p.uncertain(x, 3) = 0;
  }
  p.run();
  const auto z = [&p](int x, int y) { return p.foreground.vertices(x, y).z; };
  CHECK(z(4, 3) == 4.0F);
  CHECK(z(2, 3) == 3.0F);
  CHECK(z(4, 2) == 4.0F);
  CHECK(z(2, 2) == 3.0F);  // second level: from (3, 2) and (2, 3), both 3
  CHECK(z(1, 3) == 3.0F);
  CHECK(p.foreground.vertices(2, 2) == unproject_pixel(p.intrinsics, 2, 2, 3.0F));
  const MeshReport r = check_layer(p.foreground.view());
  CHECK(r.faces == 2 * 6 * 4);
  CHECK(r.euler_characteristic == 1);
  check_objects(p);
}

TEST_CASE("an object without a kept vertex stands at the median depth of its pixels") {
  Picture p({9, 8});
  p.rectangle(4, 0, 5, 6, label::pole, 6.0F);
  p.doubt(0, 0, 8, 7);
  for (int y = 0; y < 3; ++y) p.depth(4, y) = p.depth(5, y) = 40.0F;  // smeared into the background
  p.depth(4, 4) = kNaN;
  p.run();
  for (int y = 0; y <= 6; ++y) {
    CHECK(p.foreground.vertices(4, y).z == 6.0F);
    CHECK(p.foreground.vertices(5, y).z == 6.0F);
  }
  CHECK(check_layer(p.foreground.view()).faces == 12);
}

TEST_CASE("an object without any valid depth stays empty") {
  Picture p({6, 6});
  p.rectangle(1, 1, 4, 4, label::person, kNaN);
  p.run();
  CHECK(p.object(2, 2) == 1);
  CHECK(check_layer(p.foreground.view()).faces == 0);
}

TEST_CASE("a pole one pixel wide does not vanish, unless the thesis is followed") {
  for (const int x : {0, 4, 8}) {
    Picture p({9, 8});
    p.rectangle(x, 1, x, 7, label::pole, 6.0F);
    p.doubt(0, 0, 8, 7);
    p.run();
    const MeshReport r = check_layer(p.foreground.view());
    CHECK(r.faces == 2 * 6);
    CHECK(r.components == 1);
    CHECK(p.object(x < 8 ? x + 1 : x - 1, 3) == 1);
    p.run({}, kNoWidening);
    CHECK(check_layer(p.foreground.view()).faces == 0);
    CHECK(p.object(x < 8 ? x + 1 : x - 1, 3) == 0);
  }
  Picture bar({9, 5});
  bar.rectangle(2, 4, 8, 4, label::pole, 6.0F);  // a mast arm at the lower border: widened upwards
  bar.run();
  CHECK(check_layer(bar.foreground.view()).faces == 2 * 6);
  CHECK(bar.foreground.vertices(5, 3).z == 6.0F);
}

TEST_CASE("a one-pixel pole in a crowd takes no pixel of a neighbour") {
  Picture p({5, 4});
  p.rectangle(0, 0, 1, 3, label::car, 5.0F);
  p.rectangle(2, 0, 2, 3, label::pole, 4.0F);
  p.rectangle(3, 0, 4, 3, label::person, 6.0F);
  p.run();
  CHECK(p.foreground.vertices(1, 2).z == 5.0F);
  CHECK(p.foreground.vertices(3, 2).z == 6.0F);
  check_layer(p.foreground.view());
  check_objects(p);
}

TEST_CASE("a hole inside an object stays open") {
  Picture p({15, 11});
  p.rectangle(2, 2, 12, 8, label::bicycle, 4.0F);
  p.rectangle(5, 4, 9, 6, label::building, 30.0F);
  p.doubt(3, 3, 11, 7);
  p.run();
  const MeshReport r = check_layer(p.foreground.view());
  CHECK(r.components == 1);
  CHECK(r.boundary_loops == 2);
  CHECK(r.euler_characteristic == 0);
  CHECK(!has_vertex(p.foreground.vertices(7, 5)));
}

TEST_CASE("two objects of one label that touch are told apart by their instances, and one without") {
  Picture p({12, 6});
  p.rectangle(1, 1, 10, 4, label::car, 8.0F);
  for (int y = 1; y <= 4; ++y) {
    for (int x = 1; x <= 10; ++x) p.instances(x, y) = x <= 5 ? 26001 : 26002;
    for (int x = 6; x <= 10; ++x) p.depth(x, y) = 20.0F;
  }
  p.doubt(4, 1, 7, 4);
  p.run();
  MeshReport r = check_layer(p.foreground.view());
  CHECK(r.components == 2);
  CHECK(p.foreground.vertices(5, 2).z == 8.0F);
  CHECK(p.foreground.vertices(6, 2).z == 20.0F);
  CHECK(p.object(5, 2) == 1);
  CHECK(p.object(6, 2) == 2);
  check_objects(p);
  p.instances = Image<std::uint16_t>(p.shape, 0, kPadding, 0);
  p.run();
  CHECK(check_layer(p.foreground.view()).components == 1);
}

TEST_CASE("an object at the image border and one touching the sky are whole") {
  Picture p({12, 8});
  p.rectangle(0, 0, 11, 3, label::sky, 700.0F);
  p.rectangle(0, 1, 4, 7, label::bus, 5.0F);
  p.doubt(3, 0, 5, 7);
  p.run();
  CHECK(check_layer(p.foreground.view()).faces == 2 * 4 * 6);
  CHECK(p.foreground.vertices(4, 2).z == 5.0F);
}

TEST_CASE("one object in front of another: both are whole, neither takes the other's depth") {
  Picture p({30, 14});
  p.rectangle(3, 4, 26, 11, label::car, 12.0F);
  p.rectangle(12, 1, 15, 12, label::person, 4.0F);  // cuts the car in two
  p.doubt(10, 0, 17, 13);
  for (int y = 3; y <= 10; ++y) p.uncertain(13, y) = p.uncertain(14, y) = 0;
  p.run();
  const MeshReport r = check_layer(p.foreground.view());
  check_objects(p);
  CHECK(r.components == 3);
  CHECK(r.boundary_loops == 3);
  CHECK(r.faces == 2 * 3 * 11 + 2 * 8 * 7 + 2 * 10 * 7);
  for (int y = 4; y <= 11; ++y) {
    CHECK(p.foreground.vertices(11, y).z == 12.0F);
    CHECK(p.foreground.vertices(12, y).z == 4.0F);
    CHECK(p.foreground.vertices(15, y).z == 4.0F);
    CHECK(p.foreground.vertices(16, y).z == 12.0F);
  }
  CHECK(p.object(12, 1) == 1);
  CHECK(p.object(3, 4) == 2);
  CHECK(p.object(16, 4) == 3);
}

TEST_CASE("no face of any layer touches the sky, whatever touches it") {
  Picture p({40, 24});
  p.rectangle(0, 0, 39, 11, label::sky, 900.0F);
  p.rectangle(0, 3, 6, 11, label::building, 30.0F);
  p.rectangle(9, 2, 15, 20, label::bus, 7.0F);
  p.rectangle(20, 0, 20, 22, label::pole, 6.0F);  // from the upper border, through the sky
  p.rectangle(26, 5, 31, 15, label::vegetation, 15.0F);
  p.rectangle(28, 9, 29, 18, label::person, 5.0F);  // half before the leaves, with sky through a gap
  p.rectangle(30, 8, 31, 9, label::sky, 900.0F);
  p.doubt(8, 1, 16, 12);
  p.doubt(19, 0, 21, 23);
  p.depth(12, 2) = 700.0F;  // smeared into the sky
  for (const bool thesis : {false, true}) {
    p.run(thesis ? BackgroundParams::thesis() : BackgroundParams{}, kNoWidening);
    for (const SheetLayer& layer : {p.sheet.view(), p.background.view(), p.foreground.view()}) {
      CHECK(check_layer(layer).faces > 0);
      for (const std::uint32_t pixel : index(layer).pixels) {
        REQUIRE(p.labels(static_cast<int>(pixel) % 40, static_cast<int>(pixel) / 40) != label::sky);
      }
    }
  }
  // Widened, the pole has its second column in front of the sky: that is the pole, not the sky.
  p.run();
  const Indexed mesh = index(p.foreground.view());
  check_layer(p.foreground.view());
  bool beside_pole = false;
  for (const std::uint32_t pixel : mesh.pixels) {
    const int x = static_cast<int>(pixel) % 40;
    const int y = static_cast<int>(pixel) / 40;
    if (p.labels(x, y) != label::sky) continue;
    REQUIRE(x == 21);
    REQUIRE(p.foreground.vertices(x, y).z == 6.0F);
    beside_pole = true;
  }
  CHECK(beside_pole);
}

TEST_CASE("uncertain pixels only: the sheet keeps no face, every object still stands") {
  Picture p({20, 12});
  p.rectangle(2, 2, 8, 9, label::car, 8.0F);
  p.rectangle(12, 1, 17, 10, label::rider, 5.0F);
  p.doubt(0, 0, 19, 11);
  p.run();
  CHECK(check_layer(p.sheet.view()).faces == 0);
  CHECK(check_layer(p.background.view()).faces == 0);  // nothing is left to continue from
  const MeshReport r = check_layer(p.foreground.view());
  CHECK(r.faces == 2 * 6 * 7 + 2 * 5 * 9);
  CHECK(r.components == 2);
  check_objects(p);
}

TEST_CASE("objects with vertices at 1e5 m next to vertices at half a metre make faces that are not flat") {
  Picture p({16, 16});
  p.intrinsics = {1000.0F, 1000.0F, 8.0F, 8.0F};
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) p.rectangle(x, y, x, y, label::car, (x + y) % 3 == 0 ? 1.0e5F : 0.5F);
  }
  p.doubt(5, 5, 9, 9);
  p.run();
  CHECK(check_layer(p.foreground.view()).faces == 2 * 15 * 15);
  check_objects(p);
}

TEST_CASE("a ring of NaN inside an object is filled from its certain pixels") {
  Picture p({9, 9});
  p.rectangle(0, 0, 8, 8, label::truck, 7.0F);
  for (int i = 2; i <= 6; ++i) p.depth(i, 2) = p.depth(i, 6) = p.depth(2, i) = p.depth(6, i) = kNaN;
  p.run();
  CHECK(p.foreground.vertices(2, 4).z == 7.0F);
  CHECK(check_layer(p.foreground.view()).faces == 2 * 8 * 8);
}

TEST_CASE("labels that change in every pixel make no face that joins them, in doubt or not") {
  Picture p({8, 8});
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 8; ++x) p.labels(x, y) = (x + y) % 2 == 0 ? label::car : label::person;
  }
  for (const bool doubt : {false, true}) {
    if (doubt) p.doubt(0, 0, 7, 7);
    p.run();
    CHECK(p.object(7, 7) == 64);
    CHECK(p.foreground.vertices(3, 4).z == 10.0F);
    CHECK(check_layer(p.foreground.view()).faces == 0);
    check_objects(p);
  }
}

TEST_CASE("an empty foreground, one row and one column") {
  Picture p({5, 5});
  p.run();
  CHECK(check_layer(p.foreground.view()).faces == 0);
  for (const Shape s : {Shape{7, 1}, Shape{1, 7}, Shape{1, 1}}) {
    Picture q(s);
    q.rectangle(0, 0, s.width - 1, s.height - 1, label::car, 4.0F);
    q.doubt(0, 0, 0, 0);
    q.run();
    CHECK(q.foreground.vertices(0, 0).z == 4.0F);
    check_layer(q.foreground.view());
    CHECK(index(q.foreground.view()).faces.empty());
    CHECK(q.foreground.vertices(s.width - 1, s.height - 1).z == 4.0F);
  }
}

TEST_CASE("300 random pictures against a naive search, level by level") {
  const Label choice[] = {label::road, label::car, label::pole, label::sky, label::person};
  for (std::uint32_t trial = 0; trial < 300; ++trial) {
    CAPTURE(trial);
    RandomStream random(5, RandomPurpose::test, trial, 0, 0, 0);
    const auto size = [&random] { return 1 + static_cast<int>(random.uniform(0.0F, 13.0F)); };
    Picture p({size(), size()});
    const float change = trial % 3 == 0 ? 1.0F : 0.15F;
    const float doubt = trial % 2 == 0 ? 0.3F : 0.8F;
    Label current = label::car;
    for (int y = 0; y < p.shape.height; ++y) {
      for (int x = 0; x < p.shape.width; ++x) {
        if (random.uniform() < change) current = choice[static_cast<int>(random.uniform(0.0F, 5.0F))];
        p.rectangle(x, y, x, y, current, random.uniform() < 0.05F ? kNaN : random.uniform(1.0F, 60.0F));
        p.uncertain(x, y) = random.uniform() < doubt ? 1 : 0;
        p.instances(x, y) = random.uniform() < 0.1F ? 1 : 0;
      }
    }
    const BackgroundParams background = trial % 5 == 0 ? BackgroundParams::thesis() : BackgroundParams{};
    p.run(background, kNoWidening);
    check_layer(p.foreground.view());
    check_objects(p);
    const int width = p.shape.width;
    const int height = p.shape.height;
    // Sweeps until nothing changes, each from the state before it.
    std::map<std::uint32_t, std::vector<float>> kept;
    std::map<std::uint32_t, std::vector<float>> all;
    std::vector<float> z(p.shape.pixels(), 0.0F);
    const auto at = [&](int x, int y) { return static_cast<std::size_t>(y * width + x); };
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const bool foreground = kForegroundLabels.contains(p.labels(x, y)) && p.state(x, y) != row_state::known;
        REQUIRE((p.object(x, y) != 0) == foreground);
        if (!foreground || !has_vertex(p.sheet.vertices(x, y))) continue;
        all[p.object(x, y)].push_back(p.depth(x, y));
        if (p.uncertain(x, y) == 0) {
          kept[p.object(x, y)].push_back(p.depth(x, y));
          z[at(x, y)] = p.depth(x, y);
        }
      }
    }
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const std::uint32_t o = p.object(x, y);
        if (o == 0 || kept.count(o) != 0 || all.count(o) == 0) continue;
        std::vector<float> sorted = all[o];
        std::sort(sorted.begin(), sorted.end());
        z[at(x, y)] = sorted[(sorted.size() - 1) / 2];
      }
    }
    for (bool changed = true; changed;) {
      changed = false;
      const std::vector<float> before = z;
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
          if (p.object(x, y) == 0 || before[at(x, y)] > 0) continue;
          double sum = 0;
          int n = 0;
          const int steps[4][2] = {{0, 1}, {1, 0}, {0, -1}, {-1, 0}};
          for (const auto& s : steps) {
            const int i = x + s[0];
            const int j = y + s[1];
            if (i < 0 || j < 0 || i >= width || j >= height || p.object(i, j) != p.object(x, y)) continue;
            if (!(before[at(i, j)] > 0)) continue;
            sum += static_cast<double>(before[at(i, j)]);
            ++n;
          }
          if (n == 0) continue;
          z[at(x, y)] = static_cast<float>(sum / n);
          changed = true;
        }
      }
    }
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) REQUIRE(p.foreground.vertices(x, y).z == z[at(x, y)]);
    }
    const Layer plain = p.foreground;
    const Image<std::uint32_t> plain_object = p.object;
    p.run(background, {});
    check_layer(p.foreground.view());
    check_objects(p);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {  // widening adds, and changes nothing
        if (plain_object(x, y) == 0) continue;
        REQUIRE(p.foreground.vertices(x, y) == plain.vertices(x, y));
        REQUIRE(p.object(x, y) == plain_object(x, y));
      }
    }
  }
}

TEST_CASE("components are numbered in raster order, along a spiral and a comb") {
  const char* rows[] = {"#.#.#.#", "#.#.#.#", "#######", ".......", "##.#.##", "#..#..#", "####.##"};
  Picture p({7, 7});
  for (int y = 0; y < 7; ++y) {
    for (int x = 0; x < 7; ++x) p.labels(x, y) = rows[y][x] == '#' ? label::car : label::building;
  }
  p.run({}, ForegroundParams::thesis());
  CHECK(p.object(6, 0) == 1);
  CHECK(p.object(3, 4) == 2);
  CHECK(p.object(0, 4) == 2);
  CHECK(p.object(5, 6) == 3);
  CHECK(p.object(1, 0) == 0);
  std::uint32_t count = 0;
  for (int y = 0; y < 7; ++y)
    count = std::max(count, *std::max_element(p.object.view().row(y), p.object.view().row(y) + 7));
  CHECK(count == 3);
}

TEST_CASE("wrong arguments and a small workspace of the foreground completion are refused") {
  Picture p({16, 15});
  p.rectangle(2, 2, 9, 9, label::car, 4.0F);
  p.run();
  SerialExecutor executor;
  const auto run = [&](std::size_t bytes, ImageView<const Label> labels) {
    Scratch scratch(bytes);
    ForegroundInput in = p.foreground_input();
    in.labels = labels;
    in.instances = {};
    in.uncertain = {};
    in.background_state = {};
    return complete_foreground({}, in, p.foreground.view(), p.object.view(), scratch.workspace(), executor).code();
  };
  const std::size_t enough = complete_foreground_workspace_bytes({}, p.shape);
  CHECK(run(enough, p.labels.cview()) == StatusCode::ok);
  for (std::size_t bytes = 0; bytes < 4 * pixel_bits_bytes(p.shape); bytes += 60) {
    CHECK(run(bytes, p.labels.cview()) == StatusCode::workspace_exhausted);
  }
  CHECK(run(enough, {}) == StatusCode::shape_mismatch);
  CHECK(run(enough, p.labels.cview().sub(0, 0, {16, 14})) == StatusCode::shape_mismatch);
}
