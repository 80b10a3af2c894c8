// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/depth/detail/given/outliers.hpp"

namespace {

using namespace npsim;
using npsim_test::Image;

struct Road {
  Shape shape{64, 48};
  Intrinsics camera{50, 50, 32, 10};
  Image<float> depth{shape};
  Image<Label> labels{shape, label::road};

  // A level road 1.5 m below the camera under row 14, a wall at 40 m above it.
  Road() {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        depth(x, y) = y < 14 ? 40.0F : 1.5F * 50 / (static_cast<float>(y) + 0.5F - 10);
        if (y < 14) labels(x, y) = label::building;
      }
    }
  }
  [[nodiscard]] Image<float> cleaned(float height_m = 1.5F, const OutlierParams& params = {}) const {
    Image<float> out(shape);
    SerialExecutor serial;
    const ObjectMap objects{labels.cview(), {}};
    REQUIRE(drop_outliers(params, depth.view(), objects, {0, -1, 0}, height_m, camera, 0.0F, out.view(), serial).ok());
    return out;
  }
};

}  // namespace

TEST_CASE("drop_outliers keeps a clean road and wall to the bit, and takes a patch that floats over the road") {
  Road road;
  CHECK(road.cleaned() == road.depth);
  for (int y = 30; y < 40; ++y) {
    for (int x = 20; x < 40; ++x) road.depth(x, y) *= 2;
  }
  const Image<float> out = road.cleaned();
  for (int y = 30; y < 40; ++y) {
    for (int x = 20; x < 40; ++x) CHECK(out(x, y) == 0.0F);
  }
  CHECK(out(19, 35) == road.depth(19, 35));
  CHECK(road.cleaned(0.0F) == road.depth);  // no ground plane known
}

TEST_CASE("drop_outliers takes a speck on a dense wall, but none from a map that is sparse everywhere") {
  Road road;
  road.depth(30, 6) = 7;
  road.depth(31, 6) = 7;
  CHECK(road.cleaned()(30, 6) == 0.0F);
  CHECK(road.cleaned()(29, 6) == 40.0F);
  Road sparse;
  int i = 0;
  for (float& z : sparse.depth.view().pixels()) {
    if (i++ % 5 != 0) z = 0;
  }
  sparse.depth(30, 6) = 7;
  CHECK(sparse.cleaned() == sparse.depth);
}

TEST_CASE("a lamp's small head before a sky without depth is no speck") {
  Road road;
  for (int y = 0; y < 14; ++y) {
    for (int x = 0; x < 40; ++x) road.depth(x, y) = x >= 20 && x < 22 && y >= 4 && y < 7 ? 12.0F : 0.0F;
  }
  CHECK(road.cleaned() == road.depth);
}

TEST_CASE("stereo: what lies farther off in the strip that the right camera does not see is dropped, nothing else") {
  const Shape shape{256, 4};
  const float focal_baseline = 400.0F;
  Image<float> depth(shape, focal_baseline / 40.0F);  // a wall of 40 px of disparity
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 30; ++x) depth(x, y) = focal_baseline / 2.0F;  // mismatched
    for (int x = 30; x < 40; ++x) depth(x, y) = 0.0F;
    for (int x = 120; x < 180; ++x) depth(x, y) = focal_baseline / 4.0F;  // seen by both: a gap in the wall
    for (int x = 46; x < 50; ++x) depth(x, y) = focal_baseline / 80.0F;   // nearer
  }
  SerialExecutor serial;
  Image<float> out(shape);
  const auto run = [&](float px_m) {
    return drop_outliers({}, depth.cview(), {}, {0, -1, 0}, 0, {400, 400, 128, 2}, px_m, out.view(), serial);
  };
  REQUIRE(run(focal_baseline).ok());
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 256; ++x) CHECK(out(x, y) == (x < 30 ? 0.0F : depth(x, y)));
  }
  REQUIRE(run(0.0F).ok());  // no stereo
  CHECK(out == depth);
}

TEST_CASE("stereo: mirror images on the bonnet, a hand below the road in front of it, are dropped; a hill is not") {
  // A road that rises with the square of the distance, 25 cm at 20 m, under a plane that knows nothing of it.
  Road road;
  const auto on_hill = [&](int y) {
    const float down = (static_cast<float>(y) + 0.5F - 10) / 50;
    float z = 1.5F / down;
    for (int i = 0; i < 50; ++i) z = (1.5F - 0.000625F * z * z) / down;
    return z;
  };
  for (int y = 14; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) road.depth(x, y) = on_hill(y);
  }
  const Image<float> clean = road.depth;
  for (int x = 10; x < 20; ++x) {
    for (int y = 45; y < 48; ++y) road.depth(x, y) *= 1.07F;  // 10 cm
  }
  const auto dropped = [&](float focal_baseline) {
    Image<float> out(road.shape);
    SerialExecutor serial;
    const ObjectMap objects{road.labels.cview(), {}};
    REQUIRE(
        drop_outliers({}, road.depth.view(), objects, {0, -1, 0}, 1.5F, road.camera, focal_baseline, out.view(), serial)
            .ok());
    return out;
  };
  const Image<float> out = dropped(10.0F);
  for (int y = 20; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      const bool mirrored = x >= 10 && x < 20 && y >= 45;
      CHECK(out(x, y) == (mirrored ? 0.0F : clean(x, y)));
    }
  }
  CHECK(dropped(0.0F)(15, 46) == road.depth(15, 46));  // of no other source is that known
}

TEST_CASE(
    "stereo without labels: a match deep below the near road is dropped; a quay, a far valley and a laser's are not") {
  Road road;
  const Image<float> clean = road.depth;
  road.depth(20, 46) = 1e6F;  // a disparity of next to nothing on the bonnet
  road.depth(30, 45) = 20.0F;
  road.depth(45, 46) = 1.5F * 50 / 36.5F * 3.0F;  // water, 3 m below the road
  road.depth(30, 24) = 90.0F;                     // a valley beside the road, seen above the near rows
  road.depth(40, 46) = 1.0F;                      // something near
  const auto dropped = [&](float focal_baseline) {
    Image<float> out(road.shape);
    SerialExecutor serial;
    REQUIRE(drop_outliers({}, road.depth.view(), ObjectMap{}, {0, -1, 0}, 1.5F, road.camera, focal_baseline, out.view(),
                          serial)
                .ok());
    return out;
  };
  const Image<float> out = dropped(10.0F);
  CHECK(out(20, 46) == 0.0F);
  CHECK(out(30, 45) == 0.0F);
  CHECK(out(45, 46) == road.depth(45, 46));
  CHECK(out(30, 24) == 90.0F);
  CHECK(out(40, 46) == 1.0F);
  CHECK(out(50, 46) == clean(50, 46));
  CHECK(dropped(0.0F) == road.depth);
}

TEST_CASE("stereo: depth of the object behind, smeared over the border of a thin one, is dropped") {
  Road road;
  for (int y = 0; y < 14; ++y) {
    for (int x = 28; x < 36; ++x) {
      road.labels(x, y) = label::pole;
      road.depth(x, y) = x < 29 ? 40.0F : 8.0F;
    }
  }
  OutlierParams params;
  CHECK(road.cleaned(1.5F, params)(28, 6) == 40.0F);
  params.by_object = true;
  const Image<float> out = road.cleaned(1.5F, params);
  CHECK(out(28, 6) == 0.0F);
  CHECK(out(32, 6) == 8.0F);
  CHECK(out(20, 6) == 40.0F);
}

TEST_CASE("drop_outliers: nothing measured, one pixel, parameters out of range") {
  Road road;
  for (float& z : road.depth.view().pixels()) z = 0;
  CHECK(road.cleaned() == road.depth);
  OutlierParams params;
  params.speck_radius_px = 33;
  SerialExecutor serial;
  float one = 3;
  float out = 0;
  CHECK(drop_outliers(params, {&one, {1, 1}}, {}, {0, -1, 0}, 1, {1, 1, 0, 0}, 0, {&out, {1, 1}}, serial).code() ==
        StatusCode::invalid_argument);
  REQUIRE(drop_outliers({}, {&one, {1, 1}}, {}, {0, -1, 0}, 1, {1, 1, 0, 0}, 0, {&out, {1, 1}}, serial).ok());
  CHECK(out == 3);
}
