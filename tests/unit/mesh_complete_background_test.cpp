// SPDX-License-Identifier: Apache-2.0
#include "npsim/mesh/complete.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "mesh_fixture.hpp"

using namespace mesh_test;

namespace {

constexpr BackgroundParams kThesis = BackgroundParams::thesis();

BackgroundParams by_inverse_depth_anywhere() {
  BackgroundParams params;
  params.interpolation = BackgroundInterpolation::linear_inverse_depth;
  params.max_join_ratio = 0.0F;
  return params;
}

// Every face that the vertices allow: no hole but where a vertex is missing.
void check_no_hole(const SheetLayer& layer) {
  for (int y = 0; y < layer.quads.height(); ++y) {
    for (int x = 0; x < layer.quads.width(); ++x) {
      int corners = 0;
      for (int k = 0; k < 4; ++k) corners += has_vertex(layer.vertices(x + (k & 1), y + (k >> 1))) ? 1 : 0;
      const unsigned quad = layer.quads(x, y);
      const int faces = ((quad & kQuadUpperFace) != 0 ? 1 : 0) + ((quad & kQuadLowerFace) != 0 ? 1 : 0);
      REQUIRE(faces == std::max(0, corners - 2));
    }
  }
}

// An upright wall seen obliquely, and one that leans too: inverse depth is linear in the image.
float oblique(int x, int) { return 1.0F / (0.04F + 0.001F * static_cast<float>(x)); }
float leaning(int x, int y) {
  return 1.0F / (0.04F + 0.001F * static_cast<float>(x) + 0.0005F * static_cast<float>(y));
}

Picture oblique_wall(Shape s) {
  Picture p(s);
  for (int y = 0; y < s.height; ++y) {
    for (int x = 0; x < s.width; ++x) p.depth(x, y) = oblique(x, y);
  }
  return p;
}

// A street in closed form: carriageway 1.5 m below the camera, house fronts 8 m to the left and right and one across at
// 60 m; with `pavements`, floor 0.1 m higher beyond 4 m to the side.
Picture street_of_planes(bool pavements) {
  Picture p({240, 120});
  p.intrinsics = {200.0F, 200.0F, 121.0F, 41.0F};
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 240; ++x) {
      const double u = (x + 0.5 - 121.0) / 200.0;
      const double v = (y + 0.5 - 41.0) / 200.0;
      double z = 60.0;
      Label l = label::building;
      if (std::fabs(u) * z > 8.0) z = 8.0 / std::fabs(u);
      if (pavements && v * z > 1.4 && std::fabs(u) * 1.4 / v > 4.0) {
        z = 1.4 / v;
        l = label::sidewalk;
      } else if (pavements && v * z > 1.4 && std::fabs(u) * 1.5 / v > 4.0) {
        z = 4.0 / std::fabs(u);  // the kerb stone
        l = label::sidewalk;
      } else if (v * z > 1.5) {
        z = 1.5 / v;
        l = label::road;
      }
      p.rectangle(x, y, x, y, l, static_cast<float>(z));
    }
  }
  return p;
}

double worst_error(const Picture& p, const Picture& truth) {
  double worst = 0;
  for (int y = 0; y < p.shape.height; ++y) {
    for (int x = 0; x < p.shape.width; ++x) {
      const double z = static_cast<double>(truth.depth(x, y));
      worst = std::max(worst, std::fabs(static_cast<double>(p.background.vertices(x, y).z) - z) / z);
    }
  }
  return worst;
}

}  // namespace

TEST_CASE("behind a car on a street, floor and wall meet where they did") {
  for (const bool pavements : {false, true}) {
    CAPTURE(pavements);
    Picture p = street_of_planes(pavements);
    const Picture truth = p;
    p.rectangle(55, 35, 88, 80, label::car, 6.0F);       // left: wall, pavement, kerb, road
    p.rectangle(112, 36, 130, 52, label::bus, 20.0F);    // the house across, road
    p.rectangle(170, 30, 239, 119, label::truck, 3.0F);  // to the border and the bottom
    p.doubt(53, 33, 90, 82);
    BackgroundParams params;
    if (!pavements) params.floor.kerb_height_m = 0.0F;  // else one is expected behind the vehicles
    p.run(params);
    // Off are the corner of two houses and, by the height of the kerb at most, what is within two pixels of a kerb.
    CHECK(worst_error(p, truth) < 0.08);
    int missing = 0;
    int off = 0;
    int floor_off = 0;
    for (int y = 0; y < 120; ++y) {
      for (int x = 0; x < 240; ++x) {
        if (p.state(x, y) != row_state::missing) continue;
        const float error = std::fabs(p.background.vertices(x, y).z / truth.depth(x, y) - 1.0F);
        ++missing;
        off += error > (pavements ? 0.03F : 0.01F) ? 1 : 0;
        floor_off += truth.labels(x, y) == label::road && error > 1e-4F ? 1 : 0;  // a foot of a wall
      }
    }
    CHECK(missing > 5000);
    CHECK(off < missing / (pavements ? 20 : 100));
    if (!pavements) CHECK(floor_off <= 2);
    for (int y = 0; y < 120; ++y) {
      for (int x = 0; x < 240; ++x) {
        const Vec3f v = p.background.vertices(x, y);
        REQUIRE(v == unproject_pixel(p.intrinsics, x, y, v.z));
      }
    }
    CHECK(check_layer(p.background.view()).boundary_loops == 1);
    p.run(by_inverse_depth_anywhere());
    CHECK(worst_error(p, truth) > 0.2);
  }
}

TEST_CASE("a pole in front of a car does not hide what is above the car") {
  Picture p = street_of_planes(false);
  const Picture truth = p;
  p.rectangle(105, 0, 135, 5, label::vegetation, 10.0F);  // all that is above the pole
  p.rectangle(118, 6, 120, 29, label::pole, 9.0F);
  p.rectangle(60, 30, 180, 60, label::car, 6.0F);
  BackgroundParams params;
  params.floor.kerb_height_m = 0.0F;
  p.run(params);
  for (int y = 30; y < 42; ++y) {
    for (int x = 117; x <= 121; ++x)
      CHECK(p.background.vertices(x, y).z == doctest::Approx(static_cast<double>(truth.depth(x, y))));
  }
}

TEST_CASE("a trunk goes on down behind a car, a crown does not") {
  BackgroundParams params;
  params.floor.kerb_height_m = 0.0F;
  for (const bool crown : {false, true}) {
    CAPTURE(crown);
    Picture p = street_of_planes(false);
    p.rectangle(crown ? 105 : 118, 24, crown ? 135 : 120, 33, label::vegetation, 15.0F);
    p.rectangle(90, 34, 150, 60, label::car, 6.0F);
    p.run(params);
    CHECK(p.background.vertices(119, 40).z == doctest::Approx(crown ? 60.0 : 15.0));
    params.street.trunk_width_m = crown ? 0.35F : 0.1F;  // three pixels at 15 m are 0.22 m
    p.run(params);
    CHECK(p.background.vertices(119, 40).z == doctest::Approx(60.0));
    params.street.trunk_width_m = 0.35F;
  }
}

TEST_CASE("between two ends of one floor there is floor") {
  Picture p = street_of_planes(false);
  const Picture truth = p;
  p.rectangle(100, 20, 130, 60, label::building, 9.0F);  // a board on a foot that the car hides
  p.rectangle(90, 61, 140, 70, label::car, 6.0F);
  BackgroundParams params;
  params.floor.kerb_height_m = 0.0F;
  p.run(params);
  for (int y = 61; y <= 70; ++y)
    CHECK(p.background.vertices(115, y).z == doctest::Approx(static_cast<double>(truth.depth(115, y))));
}

TEST_CASE("the kerbs and the vanishing point of a street are found to a pixel") {
  Picture p = street_of_planes(true);
  p.rectangle(60, 35, 110, 80, label::car, 6.0F);
  p.run();
  Scratch scratch(complete_background_workspace_bytes({}, p.shape));
  SerialExecutor executor;
  StreetFloor floor;
  REQUIRE(mesh_detail::find_floor<simd::F32>({}, p.sheet.vertices.cview(), p.labels.cview(), {}, p.state.cview(),
                                             p.intrinsics, scratch.workspace(), executor, floor)
              .ok());
  REQUIRE(floor.valid);
  CHECK(floor.camera_height_m == doctest::Approx(1.5).epsilon(1e-5));
  CHECK(floor.raise == doctest::Approx(1.5 / 1.4).epsilon(2e-3));
  CHECK(std::fabs(floor.vanishing_x - 120.5) < 1.0);
  CHECK(std::fabs(floor.vanishing_y - 40.5) < 0.01);
  for (const std::size_t side : {0U, 1U}) CHECK(std::fabs(std::fabs(floor.kerb_slope[side]) - 4.0 / 1.5) < 0.03);
}

TEST_CASE("where parked cars hide a whole side, its pavement begins behind them") {
  Picture p = street_of_planes(true);
  for (int y = 0; y < 120; ++y) {
    for (int x = 121; x < 240; ++x) {
      if (p.labels(x, y) == label::sidewalk) p.rectangle(x, y, x, y, label::car, p.depth(x, y) * 0.9F);
    }
  }
  p.run();
  // The outermost car is 0.9 * 8 m to the side; beyond the kerb behind it there is room for one at the lower right.
  const double pavement = 1.4 * 200.0 / (119.5 - 41.0);
  CHECK(static_cast<double>(p.background.vertices(239, 119).z) < 1.08 * pavement);
}

TEST_CASE("a leaning wall behind an object is off by its lean, by rows it is exact") {
  Picture p({40, 20});
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 40; ++x) p.depth(x, y) = leaning(x, y);
  }
  const Picture truth = p;
  p.rectangle(12, 4, 25, 15, label::car, 4.0F);
  p.doubt(9, 2, 28, 17);
  p.run();
  CHECK(worst_error(p, truth) < 16 * 0.0005 / 0.04);
  p.run(by_inverse_depth_anywhere());
  CHECK(worst_error(p, truth) < 1e-6);
}

TEST_CASE("300 random pictures: what the street completion promises") {
  const Label choice[] = {label::road, label::building, label::car,        label::pole,
                          label::sky,  label::sidewalk, label::vegetation, label::road};
  for (std::uint32_t trial = 0; trial < 300; ++trial) {
    CAPTURE(trial);
    RandomStream random(8, RandomPurpose::test, trial, 0, 0, 0);
    const auto size = [&random] { return 1 + static_cast<int>(random.uniform(0.0F, 30.0F)); };
    Picture p({size(), size()});
    const float change = trial % 3 == 0 ? 1.0F : 0.1F;
    Label current = label::road;
    for (int y = 0; y < p.shape.height; ++y) {
      for (int x = 0; x < p.shape.width; ++x) {
        if (random.uniform() < change) current = choice[static_cast<int>(random.uniform(0.0F, 8.0F))];
        // Every other picture has a floor that can be fitted.
        const float floor_m = 150.0F / static_cast<float>(y + 5);
        const bool fits = trial % 2 == 0 && current != label::building;
        const float z = random.uniform() < 0.05F ? kNaN : fits ? floor_m : std::exp(random.uniform(0.0F, 5.0F));
        p.rectangle(x, y, x, y, current, z);
        p.uncertain(x, y) = random.uniform() < 0.2F ? 1 : 0;
      }
    }
    p.run();
    check_layer(p.background.view());
    check_no_hole(p.background.view());
    for (int y = 0; y < p.shape.height; ++y) {
      for (int x = 0; x < p.shape.width; ++x) {
        const Vec3f v = p.background.vertices(x, y);
        if (p.state(x, y) == row_state::known) REQUIRE(v == p.sheet.vertices(x, y));
        if (p.state(x, y) == row_state::blocked) REQUIRE(v == Vec3f{});
        if (p.state(x, y) != row_state::missing) continue;
        int l = x;
        int right = x;
        while (l >= 0 && p.state(l, y) == row_state::missing) --l;
        while (right < p.shape.width && p.state(right, y) == row_state::missing) ++right;
        const auto is = [&](int at, std::uint8_t s) { return at >= 0 && at < p.shape.width && p.state(at, y) == s; };
        const bool anchored = is(l, row_state::known) || is(right, row_state::known);
        const bool sky = is(l, row_state::blocked) || is(right, row_state::blocked);
        if (anchored) REQUIRE(has_vertex(v));
        if (!anchored && sky) REQUIRE(v == Vec3f{});
        REQUIRE(v == (has_vertex(v) ? unproject_pixel(p.intrinsics, x, y, v.z) : Vec3f{}));
        REQUIRE(is_finite(v));
      }
    }
  }
}

TEST_CASE("Algorithm 1: vertices behind an object are spaced evenly between the kept ones") {
  Picture p({12, 5});
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 12; ++x) p.depth(x, y) = 10.0F + static_cast<float>(x);
  }
  p.rectangle(5, 1, 6, 3, label::person, 3.0F);
  p.doubt(4, 1, 7, 3);
  p.run(kThesis);
  const Vec3f left = p.sheet.vertices(3, 2);
  const Vec3f right = p.sheet.vertices(8, 2);
  for (int j = 4; j <= 7; ++j) {
    const double t = (j - 3) / 5.0;
    const Vec3d expected = vec_cast<double>(left) * (1.0 - t) + vec_cast<double>(right) * t;
    const Vec3d error = vec_cast<double>(p.background.vertices(j, 2)) - expected;
    CHECK(std::fabs(error.x) <= 3 * 0x1p-24 * std::fabs(static_cast<double>(left.x)));
    CHECK(std::fabs(error.z) <= 3 * 0x1p-24 * static_cast<double>(right.z));
  }
  const MeshReport r = check_layer(p.background.view());
  CHECK(r.faces == 2 * 11 * 4);
  CHECK(r.euler_characteristic == 1);
  check_no_hole(p.background.view());
}

TEST_CASE("the default completes a plane behind an object exactly, on the rays of its pixels") {
  Picture p = oblique_wall({40, 20});
  p.rectangle(12, 4, 25, 15, label::car, 4.0F);
  p.doubt(9, 2, 28, 17);
  p.run();
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 40; ++x) {
      const Vec3f v = p.background.vertices(x, y);
      CHECK(v.z == doctest::Approx(static_cast<double>(oblique(x, y))).epsilon(1e-6));
      CHECK(v == unproject_pixel(p.intrinsics, x, y, v.z));
    }
  }
  CHECK(check_layer(p.background.view()).boundary_loops == 1);
}

TEST_CASE("an object at the image border: the background goes on along its plane") {
  for (const bool at_left : {true, false}) {
    Picture p = oblique_wall({40, 20});
    const int x0 = at_left ? 0 : 28;
    p.rectangle(x0, 0, x0 + 11, 19, label::bus, 3.0F);
    p.doubt(at_left ? 0 : 26, 0, at_left ? 13 : 39, 19);
    p.run();
    for (int y = 0; y < 20; ++y) {
      for (int x = 0; x < 40; ++x) {
        CHECK(p.background.vertices(x, y).z == doctest::Approx(static_cast<double>(oblique(x, y))).epsilon(1e-4));
      }
    }
    CHECK(check_layer(p.background.view()).faces == 2 * 39 * 19);
  }
}

TEST_CASE("a steep plane at the border neither passes through the camera nor runs to infinity") {
  for (const float slope : {0.02F, -0.0028F, 0.5F}) {
    Picture p({60, 12});
    for (int y = 0; y < 12; ++y) {
      for (int x = 0; x < 60; ++x) p.depth(x, y) = 1.0F / std::max(0.001F, 0.02F + slope * static_cast<float>(x - 5));
    }
    p.rectangle(10, 0, 59, 11, label::car, 2.0F);
    p.run();
    for (int y = 0; y < 12; ++y) {
      const float anchor = p.background.vertices(9, y).z;
      for (int x = 10; x < 60; ++x) {
        const float z = p.background.vertices(x, y).z;
        REQUIRE(z >= anchor * 0.4999F);
        REQUIRE(z <= anchor * 2.0001F);
      }
    }
    check_layer(p.background.view());
  }
}

TEST_CASE("one anchor with too few neighbours for a plane is extended at its depth") {
  Picture p({9, 3});
  p.rectangle(0, 0, 8, 2, label::car, 4.0F);
  p.rectangle(0, 1, 0, 1, label::building, 20.0F);
  p.run();
  for (int x = 0; x < 9; ++x) CHECK(p.background.vertices(x, 1).z == doctest::Approx(20.0));
  CHECK(!has_vertex(p.background.vertices(0, 0)));
}

TEST_CASE("an object touching the sky: the background is never spanned across the sky") {
  Picture p({24, 12});
  p.rectangle(0, 0, 23, 5, label::sky, 900.0F);
  p.rectangle(0, 3, 5, 5, label::building, 15.0F);
  p.rectangle(18, 3, 23, 5, label::building, 18.0F);
  p.rectangle(4, 2, 9, 11, label::pole, 5.0F);    // left of it building, right of it sky
  p.rectangle(14, 0, 15, 11, label::pole, 5.0F);  // sky on both sides down to row 5
  p.doubt(13, 0, 16, 11);                         // uncertain sky is sky
  p.run();
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 24; ++x) CHECK(!has_vertex(p.background.vertices(x, y)));
  }
  for (int y = 3; y <= 5; ++y) {
    for (int x = 4; x <= 9; ++x) CHECK(p.background.vertices(x, y).z == doctest::Approx(15.0));  // one anchor
    for (int x = 10; x <= 17; ++x) CHECK(!has_vertex(p.background.vertices(x, y)));
    CHECK(p.state(13, y) == row_state::blocked);
    CHECK(p.state(14, y) == row_state::missing);
  }
  for (int x = 0; x < 24; ++x) CHECK(has_vertex(p.background.vertices(x, 8)));
  check_no_hole(p.background.view());
  check_layer(p.background.view());
}

TEST_CASE("a row without any anchor is filled from above and below, by rows alone it stays empty") {
  Picture p({10, 6});
  p.rectangle(0, 2, 9, 3, label::bus, 4.0F);
  p.run();
  CHECK(check_layer(p.background.view()).faces == 2 * 9 * 5);
  for (int x = 0; x < 10; ++x) CHECK(p.background.vertices(x, 3).z == doctest::Approx(10.0));
  Picture street = street_of_planes(false);
  const Picture truth = street;
  street.rectangle(0, 60, 239, 100, label::bus, 2.0F);
  BackgroundParams flat;
  flat.floor.kerb_height_m = 0.0F;
  street.run(flat);
  CHECK(worst_error(street, truth) < 2e-5);
  street.rectangle(0, 0, 239, 119, label::bus, 2.0F);
  street.run();
  CHECK(check_layer(street.background.view()).faces == 0);
  p.run(by_inverse_depth_anywhere());
  for (int x = 0; x < 10; ++x) {
    CHECK(!has_vertex(p.background.vertices(x, 2)));
    CHECK(!has_vertex(p.background.vertices(x, 3)));
  }
  const MeshReport r = check_layer(p.background.view());
  CHECK(r.components == 2);
  CHECK(r.faces == 4 * 9);
}

TEST_CASE("surfaces far apart in depth are not joined by a ramp in the default preset, but are in the thesis") {
  Picture p({30, 6});
  p.rectangle(15, 0, 29, 5, label::building, 100.0F);
  p.rectangle(12, 0, 17, 5, label::pole, 4.0F);
  p.doubt(10, 0, 19, 5);
  p.run();
  for (int x = 0; x < 30; ++x) {  // one steep quad, on the side of the nearer
    CHECK(p.background.vertices(x, 3).z == doctest::Approx(x <= 10 ? 10.0 : 100.0));
  }
  check_layer(p.background.view());
  p.run(kThesis);
  for (int x = 10; x <= 19; ++x) {
    CHECK(p.background.vertices(x, 3).z > p.background.vertices(x - 1, 3).z);
    CHECK(p.background.vertices(x, 3).z < 100.0F);
  }
  check_layer(p.background.view());
}

TEST_CASE("a hole inside an object shows background, which anchors the rows through it") {
  Picture p({21, 11});
  p.rectangle(5, 2, 15, 8, label::bicycle, 4.0F);
  p.rectangle(8, 4, 12, 6, label::building, 30.0F);
  p.run(by_inverse_depth_anywhere());
  CHECK(p.background.vertices(10, 5).z == 30.0F);
  CHECK(p.background.vertices(6, 5).z > 10.0F);
  CHECK(p.background.vertices(6, 5).z < 30.0F);
  CHECK(p.background.vertices(6, 3).z == doctest::Approx(10.0));
  CHECK(check_layer(p.background.view()).boundary_loops == 1);
}

TEST_CASE("the thesis removes only foreground segments next to uncertain pixels") {
  Picture p({30, 10});
  p.rectangle(2, 2, 6, 7, label::car, 5.0F);      // far from any uncertain pixel
  p.rectangle(12, 2, 16, 7, label::car, 5.0F);    // beside one
  p.rectangle(17, 2, 20, 7, label::truck, 5.0F);  // beside that one, of another label, but not beside the pixel
  p.doubt(11, 4, 11, 4);
  p.run(kThesis);
  CHECK(p.background.vertices(4, 4).z == 5.0F);
  CHECK(p.state(4, 4) == row_state::known);
  CHECK(p.state(14, 6) == row_state::missing);
  CHECK(p.background.vertices(18, 4).z == 5.0F);
  CHECK(p.foreground.vertices(14, 4).z == 5.0F);
  CHECK(!has_vertex(p.foreground.vertices(4, 4)));  // each surface once
  p.run();
  CHECK(p.background.vertices(4, 4).z == doctest::Approx(10.0));
  CHECK(p.foreground.vertices(4, 4).z == 5.0F);
}

TEST_CASE("the thesis follows a segment through every turn of a spiral, and not into another") {
  Picture p({33, 33});
  std::vector<std::pair<int, int>> path;  // from the border inwards, one pixel wide, a pixel apart
  int left = 0, top = 0, right = 32, bottom = 32;
  while (left < right && top < bottom) {
    for (int x = left; x <= right; ++x) path.emplace_back(x, top);
    for (int y = top + 1; y <= bottom; ++y) path.emplace_back(right, y);
    for (int x = right - 1; x >= left; --x) path.emplace_back(x, bottom);
    for (int y = bottom - 1; y >= top + 2; --y) path.emplace_back(left, y);
    for (int x = left + 1; x <= left + 2 && x < right; ++x) path.emplace_back(x, top + 2);
    left += 2, top += 2, right -= 2, bottom -= 2;
  }
  for (const auto& [x, y] : path) p.labels(x, y) = label::car;
  p.labels(path.back().first, path.back().second) = label::person;
  p.uncertain(0, 0) = 1;
  p.run(kThesis);
  for (const auto& [x, y] : path) {
    const bool other = p.labels(x, y) == label::person;
    CHECK(p.state(x, y) == (other ? row_state::known : row_state::missing));
  }
}

TEST_CASE("only uncertain pixels: nothing is kept, nothing is invented") {
  Picture p({8, 8});
  p.doubt(0, 0, 7, 7);
  p.rectangle(2, 2, 4, 4, label::car, 4.0F);
  p.run();
  CHECK(check_layer(p.background.view()).faces == 0);
}

TEST_CASE("a ring of NaN in the background is completed, in the sky it is not") {
  Picture p({12, 12});
  p.rectangle(0, 0, 11, 2, label::sky, 500.0F);
  for (int i = 1; i <= 8; ++i) p.depth(i, 1) = p.depth(i, 8) = p.depth(1, i) = p.depth(8, i) = kNaN;
  p.run();
  CHECK(!has_vertex(p.background.vertices(4, 1)));
  CHECK(p.background.vertices(4, 8).z == doctest::Approx(10.0));
  CHECK(check_layer(p.background.view()).faces == 2 * 11 * 8);
}

TEST_CASE("one row and one column can be completed") {
  for (const Shape s : {Shape{9, 1}, Shape{1, 9}, Shape{1, 1}}) {
    Picture p(s);
    p.rectangle(s.width / 2, s.height / 2, s.width / 2, s.height / 2, label::car, 4.0F);
    p.doubt(s.width / 2, s.height / 2, s.width / 2, s.height / 2);
    for (const auto& params : {BackgroundParams{}, kThesis}) {
      p.run(params);
      CHECK(has_vertex(p.background.vertices(s.width / 2, s.height / 2)) ==
            (s.width > 1 || (s.height > 1 && params.interpolation == BackgroundInterpolation::street)));
      check_layer(p.background.view());
    }
  }
}

TEST_CASE("vertices at 1e5 m and at 2 m, or 2 cm, are joined without leaving float range") {
  for (const auto interpolation :
       {BackgroundInterpolation::linear_position, BackgroundInterpolation::linear_inverse_depth}) {
    Picture p({40, 8});
    p.intrinsics = {20.0F, 20.0F, 20.0F, 4.0F};
    p.rectangle(0, 0, 39, 7, label::building, 1.0e5F);
    // In position the order of columns survives rounding up to a ratio of 2^20 / fx = 52429.
    p.rectangle(0, 0, 9, 7, label::building, interpolation == BackgroundInterpolation::linear_position ? 2.0F : 0.02F);
    p.rectangle(10, 0, 29, 7, label::car, 1.0F);
    BackgroundParams params = by_inverse_depth_anywhere();
    params.interpolation = interpolation;
    p.run(params);
    check_layer(p.background.view());
    check_no_hole(p.background.view());
  }
}

TEST_CASE("300 random pictures against a naive double-precision completion") {
  const Label choice[] = {label::road, label::building, label::car, label::pole, label::sky, label::person};
  for (std::uint32_t trial = 0; trial < 300; ++trial) {
    CAPTURE(trial);
    RandomStream random(3, RandomPurpose::test, trial, 0, 0, 0);
    const auto size = [&random] { return 1 + static_cast<int>(random.uniform(0.0F, 13.0F)); };
    Picture p({size(), size()});
    const float change = trial % 3 == 0 ? 1.0F : 0.3F;  // in every third picture the label changes in every pixel
    Label current = label::road;
    for (int y = 0; y < p.shape.height; ++y) {
      for (int x = 0; x < p.shape.width; ++x) {
        if (random.uniform() < change) current = choice[static_cast<int>(random.uniform(0.0F, 6.0F))];
        const float z = random.uniform() < 0.05F ? kNaN : std::exp(random.uniform(0.0F, 5.0F));
        p.rectangle(x, y, x, y, current, z);
        p.uncertain(x, y) = random.uniform() < 0.2F ? 1 : 0;
      }
    }
    BackgroundParams params = trial % 2 == 0 ? BackgroundParams{} : kThesis;
    if (trial % 2 == 0) params.interpolation = BackgroundInterpolation::linear_inverse_depth;
    if (trial % 4 == 0) params.max_join_ratio = 0.0F;
    p.run(params);
    check_layer(p.sheet.view());
    const MeshReport r = check_layer(p.background.view());
    CHECK(r.nonmanifold_edges == 0);
    check_no_hole(p.background.view());
    const auto z_of = [&](int x, int y) { return static_cast<double>(p.sheet.vertices(x, y).z); };
    for (int y = 0; y < p.shape.height; ++y) {
      for (int x = 0; x < p.shape.width; ++x) {
        const Vec3f v = p.background.vertices(x, y);
        if (p.state(x, y) == row_state::known) {
          REQUIRE(v == p.sheet.vertices(x, y));
          REQUIRE(p.uncertain(x, y) == 0);
          continue;
        }
        if (p.state(x, y) == row_state::blocked) {
          REQUIRE(p.labels(x, y) == label::sky);
          REQUIRE(!has_vertex(v));
          continue;
        }
        int l = x;
        int right = x;
        while (l >= 0 && p.state(l, y) == row_state::missing) --l;
        while (right < p.shape.width && p.state(right, y) == row_state::missing) ++right;
        const bool has_l = l >= 0 && p.state(l, y) == row_state::known;
        const bool has_r = right < p.shape.width && p.state(right, y) == row_state::known;
        REQUIRE(has_vertex(v) == (has_l || has_r));
        if (!has_l || !has_r) continue;
        const double ratio = std::max(z_of(l, y), z_of(right, y)) / std::min(z_of(l, y), z_of(right, y));
        if (params.max_join_ratio > 0 && ratio > static_cast<double>(params.max_join_ratio)) continue;
        const double t = static_cast<double>(x - l) / static_cast<double>(right - l);
        const bool position = params.interpolation == BackgroundInterpolation::linear_position;
        const double expected =
            position ? (1 - t) * z_of(l, y) + t * z_of(right, y) : 1.0 / ((1 - t) / z_of(l, y) + t / z_of(right, y));
        const double bound = position ? 3 * 0x1p-24 * std::max(z_of(l, y), z_of(right, y)) : 0x1.001p-24 * expected;
        REQUIRE(std::fabs(static_cast<double>(v.z) - expected) <= bound);
      }
    }
  }
}

TEST_CASE("the order of the rows, and writing over the sheet, do not change a bit") {
  Picture a({33, 70});
  RandomStream random(4, RandomPurpose::test, 0, 0, 0, 0);
  for (int y = 0; y < 70; ++y) {
    for (int x = 0; x < 33; ++x) {
      a.rectangle(x, y, x, y, random.uniform() < 0.6F ? label::car : label::road, random.uniform(1.0F, 50.0F));
      a.uncertain(x, y) = random.uniform() < 0.1F ? 1 : 0;
    }
  }
  Picture b = a;
  const BackwardExecutor reverse;
  SerialExecutor serial;
  a.run({}, {}, serial);
  b.run({}, {}, reverse);
  CHECK(a.background.vertices == b.background.vertices);
  CHECK(a.background.quads == b.background.quads);
  CHECK(a.foreground.vertices == b.foreground.vertices);
  CHECK(a.foreground.quads == b.foreground.quads);
  CHECK(a.object == b.object);
  CHECK(index(a.background.view(), reverse).vertices == index(b.background.view(), serial).vertices);
  Scratch scratch(complete_background_workspace_bytes({}, b.shape));
  REQUIRE(
      complete_background({}, b.background_input(), b.sheet.view(), b.state.view(), scratch.workspace(), serial).ok());
  CHECK(a.background.vertices == b.sheet.vertices);
}

TEST_CASE("the albedo behind an object is interpolated along its rows, and not from the sky") {
  SerialExecutor executor;
  Image<std::uint8_t> state({8, 2}, row_state::missing, kPadding, row_state::known);
  Image<Vec3f> albedo({8, 2}, Vec3f{9, 9, 9}, kPadding, Vec3f{-1, -1, -1});
  state(0, 0) = state(5, 0) = row_state::known;
  state(7, 0) = row_state::blocked;
  albedo(0, 0) = {1, 0, 0};
  albedo(5, 0) = {0, 1, 0};
  REQUIRE(interpolate_rows(state.cview(), albedo.view(), executor).ok());
  for (int j = 0; j <= 5; ++j) {
    CHECK(std::fabs(albedo(j, 0).x - (1.0F - 0.2F * static_cast<float>(j))) <= 0x1p-22F);
    CHECK(std::fabs(albedo(j, 0).y - 0.2F * static_cast<float>(j)) <= 0x1p-22F);
  }
  CHECK(albedo(6, 0) == Vec3f{0, 1, 0});
  CHECK(albedo(7, 0) == Vec3f{9, 9, 9});
  for (int j = 0; j < 8; ++j) CHECK(albedo(j, 1) == Vec3f{9, 9, 9});
  CHECK(interpolate_rows(state.cview().sub(0, 0, {4, 2}), albedo.view(), executor).code() ==
        StatusCode::shape_mismatch);
}

TEST_CASE("wrong arguments and a small workspace of the background completion are refused") {
  Picture p({6, 5});
  p.run();
  SerialExecutor executor;
  const auto run = [&](const BackgroundParams& params, std::size_t bytes, ImageView<const Label> labels) {
    Scratch scratch(bytes);
    const BackgroundInput in{p.sheet.vertices.view(), labels, {}, {}, p.intrinsics};
    return complete_background(params, in, p.background.view(), p.state.view(), scratch.workspace(), executor).code();
  };
  const std::size_t enough = complete_background_workspace_bytes(kThesis, p.shape);
  CHECK(run(kThesis, enough, p.labels.cview()) == StatusCode::ok);
  CHECK(run(kThesis, 0, p.labels.cview()) == StatusCode::ok);  // needs none
  CHECK(run(by_inverse_depth_anywhere(), 0, p.labels.cview()) == StatusCode::ok);
  CHECK(run({}, complete_background_workspace_bytes({}, p.shape), p.labels.cview()) == StatusCode::ok);
  CHECK(run({}, 0, p.labels.cview()) == StatusCode::workspace_exhausted);
  CHECK(run({}, 0, p.labels.cview().sub(0, 0, {5, 5})) == StatusCode::shape_mismatch);
  CHECK(run({}, 0, {}) == StatusCode::shape_mismatch);
  for (int k = 0; k < 13; ++k) {
    BackgroundParams params;
    if (k == 0) params.max_join_ratio = 0.5F;
    if (k == 1) params.max_extension_ratio = kNaN;
    if (k == 2) params.fit_radius_px = 0;
    if (k == 3) params.fit_radius_px = 1000;
    if (k == 4) params.fit_tolerance = 0.0F;
    if (k == 5) params.street.join_ratio = 0.9F;
    if (k == 6) params.street.above_weight = 0.0F;
    if (k == 7) params.street.floor_tolerance = kNaN;
    if (k == 8) params.street.farthest_floor = 0.0F;
    if (k == 9) params.floor.kerb_height_m = -0.1F;
    if (k == 10) params.floor.kerb_clearance_m = kNaN;
    if (k == 11) params.street.same_ratio = 0.9F;
    if (k == 12) params.street.trunk_width_m = kNaN;
    CHECK(run(params, 0, p.labels.cview()) == StatusCode::invalid_argument);
  }
}
