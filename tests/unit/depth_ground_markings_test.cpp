// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/given/ground_markings.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/depth/refine_depth.hpp"

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
  Image<std::uint16_t> instances{kShape};
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
    REQUIRE(lay_markings(depth.cview(), camera, ground, instances.cview(), marks.cview(), labels.view(),
                         scratch.workspace())
                .ok());
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

TEST_CASE("ground markings: stripes and patches that were taken for things are road, beside the pavement pavement") {
  for (const Label l : {label::traffic_sign, label::traffic_light, label::pole, label::static_object}) {
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

TEST_CASE(
    "ground markings: what stands, low or high, bears a lamp or a number, is no object, or was not measured, stays") {
  Road s;
  s.stand(10, 50, 14, 90, label::pole);
  s.stand(20, 70, 30, 80, label::traffic_sign);    // .4 m high
  s.stand(20, 90, 30, 95, label::dynamic_object);  // .15 m
  s.name(40, 60, 60, 100, label::car);             // and persons, whom a network's depth may have missed
  s.name(62, 60, 66, 100, label::person);
  s.name(70, 60, 80, 100, label::traffic_light);
  s.marks(75, 80) = 3;
  s.name(84, 60, 94, 100, label::traffic_sign);
  s.instances(90, 80) = 20001;
  s.name(120, 60, 130, 100, label::traffic_sign);
  s.name(96, 30, 106, 100, label::static_object);  // above the horizon, too
  s.name(140, 60, 150, 100, label::static_object);
  for (int y = 60; y < 100; ++y) {
    for (int x = 120; x < 130; ++x) s.depth(x, y) = 0.0F;
    for (int x = 140; x < 150 && y < 96; ++x) s.depth(x, y) = 0.0F;  // but for its lower rim
  }
  s.name(152, 60, 158, 100, label::static_object);  // three pixels in ten not on the ground
  for (int y = 60; y < 100; ++y) {
    for (int x = 152; x < 158; ++x) s.depth(x, y) = s.on_ground(y, (7 * x + 3 * y) % 10 < 3 ? 0.3F : 0.0F);
  }
  s.name(112, 60, 118, 100, label::pole);  // three measurements in either half
  for (int y = 60; y < 100; ++y) {
    for (int x = 112; x < 118; ++x) s.depth(x, y) = x == 114 && (y - 60) % 20 < 3 ? s.depth(x, y) : 0.0F;
  }
  const Image<Label> before = s.labels;
  s.lay();
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) CHECK(s.labels(x, y) == before(x, y));
  }
}

TEST_CASE("ground markings: part of a wider plane of labels, labels of no table, depth that is no number, one pixel") {
  Road s;
  s.name(20, 60, 40, 100, label::traffic_sign);
  s.labels(5, 60) = 255;
  s.depth(25, 70) = std::numeric_limits<float>::quiet_NaN();
  s.depth(26, 70) = std::numeric_limits<float>::infinity();
  Image<Label> wide({kShape.width + 32, kShape.height + 1}, label::traffic_sign);
  const ImageView<Label> part(wide.view().row(0), kShape, wide.view().stride());
  copy_pixels(s.labels.cview(), part);
  npsim_test::Scratch scratch(ground_markings_workspace_bytes(kShape));
  REQUIRE(lay_markings(s.depth.cview(), s.camera, s.ground, {}, {}, part, scratch.workspace()).ok());
  s.lay();
  CHECK(s.all(20, 60, 40, 100, label::road));
  for (int y = 0; y < wide.view().height(); ++y) {
    for (int x = 0; x < wide.view().width(); ++x) {
      CHECK(wide(x, y) == (kShape.width > x && kShape.height > y ? s.labels(x, y) : label::traffic_sign));
    }
  }
  Image<Label> one({1, 1}, label::traffic_sign);
  const Image<float> z({1, 1}, 10.0F);
  REQUIRE(lay_markings(z.cview(), s.camera, s.ground, {}, {}, one.view(), scratch.workspace()).ok());
  CHECK(one(0, 0) == label::traffic_sign);
  CHECK(lay_markings(z.cview(), s.camera, s.ground, {}, {}, s.labels.view(), scratch.workspace()).code() ==
        StatusCode::shape_mismatch);
}

TEST_CASE("ground markings: what the chain makes of one is what it makes of road") {
  Road s;
  s.name(0, 0, kShape.width, 50, label::building);
  for (int y = 0; y < 50; ++y) {
    for (int x = 0; x < kShape.width; ++x) s.depth(x, y) = s.on_ground(50, 0.0F);
  }
  for (int y = 70; y < 90; ++y) {
    for (int x = 20; x < 100; ++x) s.depth(x, y) = s.on_ground(y, 0.05F);  // a hump
  }
  Road named = s;
  named.name(20, 60, 100, 100, label::static_object);
  const Image<Rgb8> image(kShape, Rgb8{90, 90, 90});
  const RefineDepthParams params;
  SerialExecutor serial;
  NullObserver observer;
  for (const DepthSource source : {DepthSource::exact, DepthSource::lidar}) {
    npsim_test::Scratch first(refine_depth_workspace_bytes(params, kShape));
    npsim_test::Scratch second(refine_depth_workspace_bytes(params, kShape));
    RefinedDepth out[2];
    for (int i = 0; i < 2; ++i) {
      SceneView scene;
      scene.camera = s.camera;
      scene.image = image.cview();
      scene.depth = s.depth.cview();
      scene.labels = i == 0 ? s.labels.cview() : named.labels.cview();
      scene.depth_source = source;
      REQUIRE(refine_depth(params, scene, (i == 0 ? first : second).workspace(), serial, observer, out[i]).ok());
    }
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        CHECK(out[1].labels(x, y) == out[0].labels(x, y));
        CHECK(std::fabs(out[1].depth(x, y) - out[0].depth(x, y)) <= 1e-4F * out[0].depth(x, y));
      }
    }
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
