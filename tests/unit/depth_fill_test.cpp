// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/fill.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "fixture.hpp"
#include "npsim/core/random.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

struct Scene {
  explicit Scene(Shape s, Label l = label::building)
      : shape(s), depth(s, kNaN), truth(s, 0.0F), labels(s, l), out(s, -3.0F), filled(s, 9) {}
  template <class Executor>
  Status run(Executor& executor, bool with_labels = true, const FillParams& p = {}) {
    npsim_test::Scratch scratch(fill_workspace_bytes(p, shape));
    Workspace& workspace = scratch.workspace();
    const ImageView<const Label> h = with_labels ? labels.cview() : ImageView<const Label>();
    const Status s = fill_depth(p, depth.cview(), ObjectMap{h, {}}, out.view(), filled.view(), workspace, executor);
    CHECK(workspace.used() == 0);
    return s;
  }
  Status run(bool with_labels = true) {
    const SerialExecutor serial;
    return run(serial, with_labels);
  }
  double worst_relative_error(Label only = 255) const {
    double worst = 0;
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        if (only == 255 || labels(x, y) == only) worst = std::max(worst, relative_error(x, y));
      }
    }
    return worst;
  }
  double relative_error(int x, int y) const {
    return std::abs(static_cast<double>(out(x, y)) / static_cast<double>(truth(x, y)) - 1);
  }
  // Truth: inverse depth a + b x + c y.
  void plane(double a, double b, double c, int left, int top, int right, int bottom, Label l) {
    for (int y = top; y < bottom; ++y) {
      for (int x = left; x < right; ++x) {
        truth(x, y) = static_cast<float>(1.0 / (a + b * x + c * y));
        labels(x, y) = l;
        depth(x, y) = truth(x, y);
      }
    }
  }

  Shape shape;
  Image<float> depth, truth;
  Image<Label> labels;
  Image<float> out;
  Image<std::uint8_t> filled;
};

}  // namespace

TEST_CASE("a plane stays a plane with 80 % missing, a 60 px hole, and whole columns missing") {
  Scene s({160, 120});
  s.plane(0.02, 0.0001, 0.001, 0, 0, 160, 120, label::wall);  // not a ground class: the membrane alone does it
  RandomStream random(1, RandomPurpose::test, 0, 0, 0, 0);
  for (float& z : s.depth.view().pixels()) {
    if (random.uniform() < 0.8F) z = kNaN;
  }
  REQUIRE(s.run().ok());
  for (int y = 0; y < 120; ++y) {  // holes at the border lose the slope across it: about 2 px of it
    for (int x = 0; x < 160; ++x) {
      CHECK(std::abs(1 / static_cast<double>(s.out(x, y)) - 1 / static_cast<double>(s.truth(x, y))) < 3 * 0.001);
    }
  }
  double inside = 0;
  for (int y = 12; y < 108; ++y) {
    for (int x = 12; x < 148; ++x) inside = std::max(inside, s.relative_error(x, y));
  }
  CHECK(inside < 5e-4);

  s.plane(0.02, 0.0001, 0.001, 0, 0, 160, 120, label::wall);
  for (int y = 30; y < 90; ++y) {
    for (int x = 50; x < 110; ++x) s.depth(x, y) = x % 2 == 0 ? 0.0F : -1.0F;
  }
  REQUIRE(s.run().ok());
  CHECK(s.worst_relative_error() < 5e-3);  // of 1/z itself; the slope across the hole is 0.6 of it
  for (int y = 0; y < 120; ++y) s.depth(20, y) = s.depth(21, y) = kNaN;
  REQUIRE(s.run().ok());
  for (int y = 8; y < 112; ++y) {  // away from the two ends of the column
    CHECK(s.relative_error(20, y) < 1e-3);
  }
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 160; ++x) {
      const bool valid = is_valid_depth(s.depth(x, y));
      CHECK(s.filled(x, y) == (valid ? 0 : 1));
      if (valid) CHECK(s.out(x, y) == s.depth(x, y));
    }
  }
}

TEST_CASE("the road goes on as a plane beyond the last measurement: left strip, bottom rows, sparse scan lines") {
  Scene s({200, 100});
  s.plane(0.02, 0, 0, 0, 0, 200, 40, label::building);
  s.plane(-0.38, 0.0001, 0.01, 0, 40, 200, 100, label::road);
  RandomStream random(2, RandomPurpose::test, 0, 0, 0, 0);
  for (int y = 0; y < 100; ++y) {
    for (int x = 0; x < 200; ++x) {
      const bool measured = x >= 40 && y < 85 && y % 5 == 0 && random.uniform() < 0.5F;
      if (!measured) s.depth(x, y) = 0;
    }
  }
  REQUIRE(s.run().ok());
  CHECK(s.worst_relative_error(label::road) < 1e-3);
  CHECK(s.worst_relative_error(label::building) < 0.02);  // beside the road, which pulls a little
}

TEST_CASE("grass beside the road, measured only ahead, goes on as ground in the strip that stereo does not see") {
  Scene s({200, 100});
  s.plane(0.02, 0, 0, 0, 0, 200, 40, label::building);
  s.plane(-0.38, 0.0001, 0.01, 80, 40, 200, 100, label::road);
  s.plane(-0.379, 0.0001, 0.01, 0, 40, 80, 100, label::terrain);
  for (int y = 0; y < 100; ++y) {
    for (int x = 0; x < 50; ++x) s.depth(x, y) = 0;
  }
  for (int y = 60; y < 100; ++y) {
    for (int x = 0; x < 80; ++x) s.depth(x, y) = 0;
  }
  REQUIRE(s.run().ok());
  // Its own plane goes on, but meets the road, which lies .2 to .8 % farther, at their border and less beside it.
  CHECK(s.worst_relative_error(label::terrain) < 0.008);
  for (int y = 60; y < 100; ++y) {
    for (int x = 0; x < 50; ++x) CHECK(s.relative_error(x, y) < 1e-3);
  }
}

TEST_CASE("a bank that meets the road in a crease stays exact in a hole across the crease") {
  Scene s({240, 120}, label::road);
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 240; ++x) {
      const bool bank = x >= 120;
      s.truth(x, y) = static_cast<float>(1.0 / (0.05 + 0.002 * y + (bank ? 0.0015 * (x - 119.5) : 0.0)));
      s.labels(x, y) = bank ? label::terrain : label::road;
      if (x < 100 || x >= 140) s.depth(x, y) = s.truth(x, y);
    }
  }
  REQUIRE(s.run().ok());
  CHECK(s.worst_relative_error() < 0.02);
}

TEST_CASE("an echo from far beneath the road is dropped also where a line of a laser passes it") {
  Scene s({480, 240}, label::road);
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 480; ++x) {
      s.truth(x, y) = 600.0F / static_cast<float>(y + 105);
      if (y % 8 == 0 && x % 4 == 0) s.depth(x, y) = s.truth(x, y);
    }
  }
  s.depth(240, 104) = 60.0F;
  FillParams laser;
  laser.laser = true;
  const SerialExecutor serial;
  REQUIRE(s.run(serial, true, laser).ok());
  CHECK(s.relative_error(240, 104) < 0.01);
  CHECK(s.filled(240, 104) == 1);
}

TEST_CASE("a pavement between the lines of a laser does not end at its own height above the road, but meets it") {
  // 1.5 m below the camera the pavement, 12 cm further down the road; the kerb's face belongs to the pavement.
  Scene s({240, 120}, label::road);
  const auto border = [](int y) { return 120 - (y - 20); };
  for (int y = 20; y < 120; ++y) {
    for (int x = 0; x < 240; ++x) {
      const bool road = x >= border(y);
      const double height = road ? 1.62 : 1.5 + 0.12 * std::max(0.0, 1.0 - (border(y) - x) / 8.0);
      s.labels(x, y) = road ? label::road : label::sidewalk;
      s.truth(x, y) = static_cast<float>(height * 200.0 / (y + 0.5));
      if (y % 20 == 0 && x % 5 == 0) s.depth(x, y) = s.truth(x, y);
    }
  }
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 240; ++x) s.labels(x, y) = label::sky;
  }
  FillParams laser;
  laser.laser = true;
  const SerialExecutor serial;
  REQUIRE(s.run(serial, true, laser).ok());
  const auto height = [&](int x, int y) { return static_cast<double>(s.out(x, y)) * (y + 0.5) / 200.0; };
  double step = 0.0;
  for (int y = 45; y < 95; ++y) {
    INFO("row " << y);
    step += (height(border(y), y) - height(border(y) - 1, y)) / 50.0;
    CHECK(height(border(y) - 30, y) < 1.53);  // the pavement keeps its height
    CHECK(height(border(y) + 30, y) > 1.59);
  }
  CHECK(step < 0.04);  // of 12 cm; .1 where each kind of ground goes on by itself
}

TEST_CASE(
    "what a laser meets on one line and the next is one pole, and its lines are lines; of a network they are not") {
  // Lines 8 rows apart with points every 6 px: a wall at 30 m and before it a pole at 8 m, two points wide.
  Scene s({480, 120}, label::unlabeled);
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 480; ++x) {
      s.truth(x, y) = x >= 234 && x < 245 ? 8.0F : 30.0F;
      if (y % 8 == 0 && x % 6 == 0) s.depth(x, y) = s.truth(x, y);
    }
  }
  for (int x = 60; x <= 102; x += 6) s.depth(x, 40) = 20.0F;  // a rail that one line meets
  s.depth(240, 56) = kNaN;                                    // a drop-out
  s.depth(234, 56) = kNaN;
  const SerialExecutor serial;
  FillParams laser;
  laser.laser = true;
  REQUIRE(s.run(serial, false, laser).ok());
  for (int y = 8; y <= 104; ++y) {
    INFO("row " << y);
    CHECK(s.out(240, y) == doctest::Approx(8.0F));
    CHECK(s.out(120, y) == doctest::Approx(30.0F));
  }
  for (int x = 60; x <= 102; ++x) CHECK(s.out(x, 40) == doctest::Approx(20.0F));
  REQUIRE(s.run(false).ok());
  CHECK(s.out(240, 56) > 9.0F);
  CHECK(s.out(81, 40) > 20.3F);
}

TEST_CASE("stereo mismatches far beneath the near road neither stay nor spread; a slope far ahead is kept") {
  Scene s({200, 100});
  s.plane(0.02, 0, 0, 0, 0, 200, 40, label::building);
  s.plane(-0.38, 0.0001, 0.01, 0, 40, 200, 100, label::road);
  for (int y = 40; y < 100; ++y) {
    for (int x = 0; x < 50; ++x) s.depth(x, y) = kNaN;
    if (y > 60 && y % 4 == 0) s.depth(10, y) = s.depth(11, y) = 45.0F;  // specks in the blind strip
  }
  for (int x = 100; x < 120; ++x) s.depth(x, 42) = 2.5F * s.truth(x, 42);
  REQUIRE(s.run().ok());
  for (int y = 55; y < 100; ++y) {
    for (int x = 0; x < 200; ++x) {
      CHECK(std::abs(s.out(x, y) / s.truth(x, y) - 1) < 0.01F);
    }
  }
  CHECK(s.filled(10, 64) == 1);
  CHECK(s.out(110, 42) == s.depth(110, 42));
  FillParams p;
  p.ground_outlier = 0;
  const SerialExecutor serial;
  REQUIRE(s.run(serial, true, p).ok());
  CHECK(s.out(10, 64) == 45.0F);
}

TEST_CASE("a hole across a label edge keeps the depth edge where the labels are") {
  Scene s({60, 40});
  s.plane(0.1, 0, 0, 0, 0, 30, 40, label::car);
  s.plane(0.02, 0, 0, 30, 0, 60, 40, label::building);
  for (int y = 0; y < 40; ++y) {
    for (int x = 22; x < 40; ++x) s.depth(x, y) = kNaN;
  }
  REQUIRE(s.run().ok());
  CHECK(s.worst_relative_error() < 0.01);  // of a step from one to another; the two sides pull a little
  REQUIRE(s.run(false).ok());  // without labels it is bridged, monotonically and within the range of the data
  for (int x = 22; x < 40; ++x) {
    CHECK(s.out(x, 20) >= s.out(x - 1, 20));
    CHECK(s.out(x, 20) <= 50.001F);
  }
}

TEST_CASE("sky stays without depth, is no source, and does not stop a pole before it from getting one") {
  Scene s({50, 40}, label::sky);
  s.plane(0.02, 0, 0, 0, 25, 50, 40, label::building);
  for (int x = 0; x < 50; ++x) s.depth(x, 3) = 700.0F;                 // a network's idea of the sky
  for (int y = 10; y < 25; ++y) s.labels(20, y) = label::pole;         // touches the building
  for (int y = 5; y < 9; ++y) s.labels(40, y) = label::traffic_light;  // touches nothing but sky
  REQUIRE(s.run().ok());
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 50; ++x) {
      if (s.labels(x, y) == label::sky) {
        CHECK(s.out(x, y) == 0.0F);
        CHECK(s.filled(x, y) == 0);
      } else {
        CHECK(std::abs(s.out(x, y) - 50.0F) < 1e-3F);
      }
    }
  }
}

TEST_CASE("one valid pixel fills the image; none is a status and leaves the output alone") {
  Scene s({33, 17}, label::road);
  s.depth(30, 2) = 12.5F;
  for (const bool labels : {true, false}) {
    REQUIRE(s.run(labels).ok());
    for (const float z : s.out.view().pixels()) CHECK(std::abs(z - 12.5F) < 1e-5F);
  }
  s.out = Image<float>(s.shape, -3.0F);
  s.depth(30, 2) = std::numeric_limits<float>::infinity();
  CHECK(s.run().code() == StatusCode::no_valid_input);
  s.depth(30, 2) = 12.5F;
  s.labels(30, 2) = label::sky;
  CHECK(s.run().code() == StatusCode::no_valid_input);
  for (const float z : s.out.view().pixels()) CHECK(z == -3.0F);
}

TEST_CASE("two planes that meet behind a hole go on into it and meet in a crease") {
  Scene s({96, 64});
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 96; ++x) {
      s.truth(x, y) = static_cast<float>(1.0 / (0.1 + 0.002 * std::abs(x - 48)));
      s.depth(x, y) = x >= 36 && x < 60 && y >= 20 && y < 44 ? 0.0F : s.truth(x, y);
    }
  }
  FillParams p;
  p.edge = 1e-4F;
  p.max_sweeps = 200;
  const SerialExecutor serial;
  REQUIRE(s.run(serial, true, p).ok());
  double mean = 0;
  for (int y = 20; y < 44; ++y) {
    for (int x = 36; x < 60; ++x) mean += s.relative_error(x, y) / (24 * 24);
  }
  CHECK(mean < 0.03);
}

TEST_CASE("an object with samples keeps its own depth beside a nearer one; one without takes its surroundings'") {
  Scene s({64, 48});
  s.plane(0.02, 0, 0, 0, 0, 64, 48, label::wall);
  s.plane(0.2, 0, 0, 30, 8, 36, 48, label::pole);
  for (int y = 0; y < 48; ++y) {
    for (int x = 20; x < 46; ++x) {
      if (!(x >= 32 && x < 34 && y % 4 == 0)) s.depth(x, y) = 0;
    }
  }
  REQUIRE(s.run().ok());
  CHECK(s.worst_relative_error(label::pole) < 0.01);
  CHECK(s.worst_relative_error(label::wall) < 0.01);
  for (int y = 0; y < 48; ++y) {
    for (int x = 30; x < 36; ++x) s.depth(x, y) = 0;
  }
  REQUIRE(s.run().ok());
  for (int y = 8; y < 48; ++y) CHECK(s.out(32, y) == doctest::Approx(50).epsilon(0.01));
}

TEST_CASE("a sliver of wall between two poles takes the line of the wall beside them, one without wall its poles'") {
  Scene s({96, 20});
  s.plane(0.02, 2e-4, 0, 0, 0, 96, 20, label::building);
  for (const int at : {40, 46}) s.plane(0.2, 0, 0, at, 0, at + 3, 20, label::pole);
  for (int y = 0; y < 20; ++y) {
    for (int x = 36; x < 56; ++x) {
      if (s.labels(x, y) == label::building) s.depth(x, y) = 0;
    }
  }
  FillParams params;
  params.behind_reach = 0.2F;
  const SerialExecutor serial;
  REQUIRE(s.run(serial, true, params).ok());
  for (int y = 0; y < 20; ++y) {
    for (int x = 43; x < 46; ++x) CHECK(s.relative_error(x, y) < 0.001);
  }
  CHECK(s.worst_relative_error(label::pole) == 0.0);
  CHECK(s.filled(44, 10) == 1);
  params.behind_reach = 0.03F;
  REQUIRE(s.run(serial, true, params).ok());
  CHECK(s.out(44, 10) < 8.0F);
  // Things do not go on behind others.
  params.behind_reach = 0.2F;
  for (Label& l : s.labels.view().pixels()) l = l == label::building ? label::traffic_sign : l;
  REQUIRE(s.run(serial, true, params).ok());
  CHECK(s.out(44, 10) < 8.0F);
  params.behind_reach = -1.0F;
  CHECK(s.run(serial, true, params).code() == StatusCode::invalid_argument);
}

namespace {

// A crown on a trunk before a wall of 50 m, a sign before the trunk; measured: the wall, and the foot of the trunk.
Scene tree_behind_sign(Label trunk) {
  Scene s({80, 80});
  s.plane(0.02, 0, 0, 0, 0, 80, 80, label::building);
  s.plane(0.1, 0, 0, 20, 4, 60, 40, label::vegetation);
  s.plane(0.1, 0, 0, 37, 40, 43, 80, trunk);
  s.plane(0.1, 0, 0, 32, 44, 48, 56, label::traffic_sign);
  for (int y = 4; y < 80; ++y) {
    for (int x = 20; x < 60; ++x) {
      if (s.labels(x, y) != label::building && y < 72) s.depth(x, y) = 0;
    }
  }
  return s;
}

}  // namespace

TEST_CASE("a crown that nothing measured, cut off from its trunk by a sign, is as far away as the trunk") {
  Scene s = tree_behind_sign(label::vegetation);
  s.labels(40, 41) = label::building;  // a hole in the leaves is none
  for (int y = 40; y < 44; ++y) {
    for (int x = 37; x < 43; ++x) s.labels(x, y) = label::vegetation;
  }
  REQUIRE(s.run().ok());
  CHECK(s.worst_relative_error(label::vegetation) < 0.01);
  CHECK(s.worst_relative_error(label::building) < 0.01);
  // Signs hang on poles, not on leaves.
  CHECK(s.out(33, 50) > 15.0F);
  Scene pole = tree_behind_sign(label::pole);
  REQUIRE(pole.run().ok());
  CHECK(pole.worst_relative_error(label::traffic_sign) < 0.01);
  CHECK(pole.worst_relative_error(label::pole) < 0.01);
  CHECK(pole.out(30, 10) > 30.0F);  // leaves do not hang on poles: a near one may stand before them
  // As near as its pole, though all measured signs are far off.
  pole.plane(1.0 / 90, 0, 0, 2, 2, 8, 8, label::traffic_sign);
  REQUIRE(pole.run().ok());
  CHECK(pole.worst_relative_error(label::traffic_sign) < 0.01);
}

TEST_CASE("a crown of which only the trunk was measured does not lean back onto the wall behind it") {
  Scene s = tree_behind_sign(label::vegetation);
  for (Label& l : s.labels.view().pixels()) l = l == label::traffic_sign ? label::vegetation : l;
  REQUIRE(s.run().ok());
  CHECK(s.worst_relative_error(label::vegetation) < 0.01);
  FillParams free;
  free.upright_reach = 1.0F;
  const SerialExecutor serial;
  REQUIRE(s.run(serial, true, free).ok());
  CHECK(s.worst_relative_error(label::vegetation) > 0.5);
}

TEST_CASE("above a laser's last row a crown has no strips of single leaves' depth, the hedge beside it keeps its own") {
  // Of both the lower ten rows are measured: leaves lie metres before or behind those beside them.
  Scene s({320, 100}, label::vegetation);
  RandomStream random(2, RandomPurpose::test, 0, 0, 0, 0);
  const auto base_m = [](int x) { return x < 200 ? 10.0F : 40.0F; };
  for (int x = 0; x < 320; ++x) {
    const float leaf = base_m(x) * (0.85F + 0.3F * random.uniform());
    for (int y = 0; y < 100; ++y) s.truth(x, y) = base_m(x);
    for (int y = 90; y < 100; ++y) s.depth(x, y) = leaf;
  }
  s.depth(100, 90) = 40.0F;  // seen between the leaves
  FillParams laser;
  laser.laser = true;
  const SerialExecutor serial;
  REQUIRE(s.run(serial, true, laser).ok());
  for (int x = 0; x < 320; ++x) {
    CAPTURE(x);
    CHECK(s.relative_error(x, 20) < 0.12);
    if (x > 0 && x != 200) CHECK(std::fabs(s.out(x, 20) / s.out(x - 1, 20) - 1.0F) < 0.05F);
  }
}

TEST_CASE("what hangs over nothing that was measured takes its surroundings' depth, at the picture's border too") {
  Scene s({40, 40});
  s.plane(0.02, 0, 0, 0, 0, 40, 40, label::building);
  s.plane(0.1, 0, 0, 10, 20, 20, 40, label::vegetation);
  s.plane(0.1, 0, 0, 30, 10, 35, 20, label::traffic_sign);
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 40; ++x) {
      if (s.labels(x, y) != label::building) s.depth(x, y) = 0;
    }
  }
  REQUIRE(s.run().ok());
  CHECK(s.out(15, 39) == doctest::Approx(50).epsilon(0.01));
  CHECK(s.out(32, 15) == doctest::Approx(50).epsilon(0.01));
}

TEST_CASE("a rider whom nothing measured stands where the wheels meet the road, which is farther off between them") {
  Scene s({80, 80});
  s.plane(0.02, 0, 0, 0, 0, 80, 30, label::building);
  s.plane(-0.1, 0, 0.005, 0, 30, 80, 80, label::road);  // 20 m at row 30, 3.4 m at the bottom
  const auto put = [&](int left, int top, int right, int bottom, Label l) {
    for (int y = top; y < bottom; ++y) {
      for (int x = left; x < right; ++x) {
        s.labels(x, y) = l;
        s.depth(x, y) = 0;
        s.truth(x, y) = 1.0F / (-0.1F + 0.005F * 66.0F);  // of the road below the wheels
      }
    }
  };
  put(30, 54, 34, 66, label::bicycle);
  put(48, 54, 52, 66, label::bicycle);
  put(34, 52, 48, 56, label::bicycle);
  put(36, 16, 48, 52, label::rider);
  put(60, 20, 70, 40, label::person);
  put(60, 40, 70, 50, label::wall);
  for (int x = 60; x < 70; ++x) s.depth(x, 45) = s.truth(x, 45) = 6.0F;  // before the feet
  REQUIRE(s.run().ok());
  CHECK(s.worst_relative_error(label::bicycle) < 0.01);
  CHECK(s.worst_relative_error(label::rider) < 0.01);
  // Without feet a person is where its surroundings are.
  CHECK(s.out(65, 25) > 15.0F);
  FillParams none;
  none.standing = {};
  const SerialExecutor serial;
  REQUIRE(s.run(serial, true, none).ok());
  CHECK(s.worst_relative_error(label::rider) > 1.0);
}

TEST_CASE("objects of one label do not share depth where there are instances") {
  Scene s({60, 20}, label::car);
  Image<std::uint16_t> instances(s.shape, 1);
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 60; ++x) {
      instances(x, y) = x < 30 ? 1 : 2;
      s.truth(x, y) = x < 30 ? 5.0F : 20.0F;
      s.depth(x, y) = x < 20 || x >= 40 ? s.truth(x, y) : 0.0F;
    }
  }
  npsim_test::Scratch scratch(fill_workspace_bytes({}, s.shape));
  SerialExecutor serial;
  const ObjectMap objects{s.labels.cview(), instances.cview()};
  REQUIRE(fill_depth({}, s.depth.cview(), objects, s.out.view(), {}, scratch.workspace(), serial).ok());
  CHECK(s.worst_relative_error() < 0.01);
}

TEST_CASE("fill does not depend on the order of chunks, works in place and on strided views") {
  Scene s({70, 66});
  RandomStream random(4, RandomPurpose::test, 0, 0, 0, 0);
  for (int y = 0; y < 66; ++y) {
    for (int x = 0; x < 70; ++x) {
      s.labels(x, y) = x * y > 1500 ? label::road : (x > 50 ? label::sky : label::vegetation);
      if (random.uniform() < 0.2F) s.depth(x, y) = random.uniform(2.0F, 60.0F);
    }
  }
  REQUIRE(s.run().ok());
  const Image<float> expected = s.out;
  const npsim_test::BackwardExecutor backward;
  REQUIRE(s.run(backward).ok());
  CHECK(s.out == expected);

  Image<float> strided(s.shape, 0.0F, 20, 5.0F);
  Image<float> wanted(s.shape, 0.0F, 20, 5.0F);
  for (int y = 0; y < 66; ++y) {
    for (int x = 0; x < 70; ++x) {
      strided(x, y) = s.depth(x, y);
      wanted(x, y) = expected(x, y);
    }
  }
  npsim_test::Scratch scratch(fill_workspace_bytes({}, s.shape));
  SerialExecutor serial;
  REQUIRE(
      fill_depth({}, strided.view(), ObjectMap{s.labels.cview(), {}}, strided.view(), {}, scratch.workspace(), serial)
          .ok());
  CHECK(strided == wanted);
}

TEST_CASE("images one pixel wide or high are filled, and bad arguments refused") {
  for (const Shape shape : {Shape{1, 9}, Shape{9, 1}, Shape{1, 1}}) {
    Scene s(shape);
    s.depth(0, 0) = 4.0F;
    REQUIRE(s.run().ok());
    for (const float z : s.out.view().pixels()) CHECK(std::abs(z - 4.0F) < 1e-6F);
  }
  Scene s({8, 8});
  s.depth(0, 0) = 4.0F;
  const SerialExecutor serial;
  FillParams p;
  p.relaxation = 2.0F;
  CHECK(s.run(serial, true, p).code() == StatusCode::invalid_argument);
  p = {};
  p.ground_outlier = 0.5F;
  CHECK(s.run(serial, true, p).code() == StatusCode::invalid_argument);
  p = {};
  p.max_sweeps = -1;
  CHECK(s.run(serial, true, p).code() == StatusCode::invalid_argument);
  Workspace none;
  CHECK(fill_depth({}, s.depth.cview(), {}, s.out.view().sub(0, 0, {4, 4}), {}, none, serial).code() ==
        StatusCode::shape_mismatch);
  CHECK(fill_depth({}, s.depth.cview(), {}, s.out.view(), {}, none, serial).code() == StatusCode::workspace_exhausted);
}
