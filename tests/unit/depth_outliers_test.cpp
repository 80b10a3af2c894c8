// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/depth/outliers.hpp"

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
    REQUIRE(drop_outliers(params, depth.view(), labels.view(), {0, -1, 0}, height_m, camera, out.view(), serial).ok());
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

TEST_CASE("drop_outliers: nothing measured, one pixel, parameters out of range") {
  Road road;
  for (float& z : road.depth.view().pixels()) z = 0;
  CHECK(road.cleaned() == road.depth);
  OutlierParams params;
  params.speck_radius_px = 33;
  SerialExecutor serial;
  float one = 3;
  float out = 0;
  CHECK(drop_outliers(params, {&one, {1, 1}}, {}, {0, -1, 0}, 1, {1, 1, 0, 0}, {&out, {1, 1}}, serial).code() ==
        StatusCode::invalid_argument);
  REQUIRE(drop_outliers({}, {&one, {1, 1}}, {}, {0, -1, 0}, 1, {1, 1, 0, 0}, {&out, {1, 1}}, serial).ok());
  CHECK(out == 3);
}
