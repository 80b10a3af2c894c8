// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/given/ground_markings.hpp"

#include <doctest/doctest.h>

#include <cstdint>

#include "fixture.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

constexpr Shape kShape{160, 120};

// A road 1.5 m below the camera, with a pavement on the right.
struct Road {
  Intrinsics camera{150, 150, 80, 40};
  GroundPlane ground{{0, -1, 0}, 1.5F, 1.0F};
  Image<float> depth{kShape};
  Image<Label> labels{kShape, label::sky};
  Image<std::uint16_t> marks{kShape};

  Road() {
    for (int y = 50; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        labels(x, y) = x < 110 ? label::road : label::sidewalk;
        depth(x, y) = on_ground(y, 0.0F);
      }
    }
  }
  [[nodiscard]] float on_ground(int y, float higher_m) const {
    return (1.5F - higher_m) * camera.fy / (static_cast<float>(y) + 0.5F - camera.cy);
  }
  void name(int x0, int y0, int x1, int y1, Label l) {
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) labels(x, y) = l;
    }
  }
  // Upright at its foot, y1.
  void stand(int x0, int y0, int x1, int y1, Label l) {
    name(x0, y0, x1, y1, l);
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) depth(x, y) = on_ground(y1, 0.0F);
    }
  }
  void lay() {
    npsim_test::Scratch scratch(ground_markings_workspace_bytes(kShape));
    REQUIRE(lay_markings(depth.cview(), camera, ground, marks.cview(), labels.view(), scratch.workspace()).ok());
  }
  [[nodiscard]] bool all(int x0, int y0, int x1, int y1, Label l) const {
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) {
        if (labels(x, y) != l) return false;
      }
    }
    return true;
  }
};

}  // namespace

TEST_CASE("ground markings: stripes and arrows that were taken for things are road, beside the pavement pavement") {
  for (const Label l : {label::traffic_sign, label::person, label::pole, label::static_object}) {
    Road s;
    s.name(20, 60, 40, 100, l);
    s.name(108, 60, 130, 100, l);
    s.lay();
    CHECK(s.all(20, 60, 40, 100, label::road));
    CHECK(s.all(108, 60, 130, 100, label::sidewalk));
  }
}

TEST_CASE("ground markings: within what has no class a stripe is of the ground without one") {
  Road s;
  s.name(10, 55, 60, 110, label::unlabeled);
  s.name(20, 60, 40, 100, label::traffic_sign);
  s.lay();
  CHECK(s.all(20, 60, 40, 100, label::ground));
  CHECK(s.all(10, 55, 20, 110, label::unlabeled));
}

TEST_CASE("ground markings: with some centimetres of noise, holes, or a few points of something else they still lie") {
  Road s;
  s.name(20, 60, 40, 100, label::traffic_sign);
  for (int y = 60; y < 100; ++y) {
    for (int x = 20; x < 40; ++x) {
      if ((x + y) % 3 != 0) s.depth(x, y) = 0.0F;
      if ((x + y) % 9 == 0) s.depth(x, y) = s.on_ground(y, x % 2 == 0 ? 0.1F : -0.1F);
    }
  }
  for (int y = 60; y < 64; ++y) s.depth(30, y) = 30.0F;
  s.lay();
  CHECK(s.all(20, 60, 40, 100, label::road));
}

TEST_CASE("ground markings: what stands, a car, what bears a lamp or has no depth keeps its label") {
  Road s;
  s.stand(10, 50, 14, 90, label::pole);
  s.stand(20, 70, 30, 80, label::traffic_sign);  // .4 m high
  s.name(40, 60, 60, 100, label::car);
  s.depth(50, 80) = 3.0F;
  for (int y = 60; y < 100; ++y) {
    for (int x = 40; x < 60; ++x) s.depth(x, y) = s.on_ground(y, x % 4 == 0 ? 0.3F : 0.0F);
  }
  s.name(70, 60, 80, 100, label::traffic_light);
  s.marks(75, 80) = 3;
  s.name(120, 60, 130, 100, label::traffic_sign);
  for (int y = 60; y < 100; ++y) {
    for (int x = 120; x < 130; ++x) s.depth(x, y) = 0.0F;
  }
  const Image<Label> before = s.labels;
  s.lay();
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) CHECK(s.labels(x, y) == before(x, y));
  }
}

TEST_CASE("ground markings: a stripe below a post is told from it, and without a ground plane nothing is told") {
  Road s;
  s.stand(25, 52, 28, 60, label::pole);
  s.name(20, 60, 40, 100, label::traffic_sign);
  Road lost = s;
  s.lay();
  CHECK(s.all(25, 52, 28, 60, label::pole));
  CHECK(s.all(20, 60, 40, 100, label::road));
  lost.ground.inlier_share = 0.0F;
  lost.lay();
  CHECK(lost.all(20, 60, 40, 100, label::traffic_sign));
}
