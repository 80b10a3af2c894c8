// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/measured/ground_under_vehicles.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"

namespace {

using namespace npsim;
using npsim_test::Image;

constexpr Shape kShape{48, 400};
constexpr int kSill = 140;      // the car's lowest row
constexpr int kWrongRows = 20;  // below it that stereo gave the car's depth
constexpr float kCar_m = 12.0F;

// A level road 1.5 m below the camera, and a car over columns 10 to 37 whose depth goes on below its sill.
struct Street {
  Intrinsics camera{1000.0F, 1000.0F, 24.0F, 40.0F};
  GroundPlane ground;
  DepthNoise noise{0.0002F, 0};
  Image<Label> labels{kShape, label::road};
  Image<float> truth{kShape};
  Image<float> depth{kShape};

  Street() {
    ground.camera_height_m = 1.5F;
    ground.inlier_share = 0.9F;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        const bool car = x >= 10 && x < 38 && y <= kSill;
        if (y < 60) labels(x, y) = label::sky;
        if (car && y >= 60) labels(x, y) = label::car;
        truth(x, y) = y < 60 ? 0.0F : (car ? kCar_m : 1500.0F / (static_cast<float>(y) + 0.5F - 40.0F));
        depth(x, y) = truth(x, y);
        if (x >= 10 && x < 38 && y > kSill && y <= kSill + kWrongRows) depth(x, y) = kCar_m;
      }
    }
  }
  template <class Executor>
  Status run(Executor& executor) {
    GroundUnderVehiclesParams params;
    params.reach_px = 24;
    return run(executor, params);
  }
  template <class Executor>
  Status run(Executor& executor, const GroundUnderVehiclesParams& params) {
    Image<float> filled = depth;
    const Status done = lower_ground_under_vehicles(params, labels.cview(), noise, camera, ground, filled.view(),
                                                    depth.view(), executor);
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) REQUIRE(filled(x, y) == depth(x, y));
    }
    return done;
  }
  [[nodiscard]] bool as_before(const Image<float>& before) const {
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        if (depth(x, y) != before(x, y)) return false;
      }
    }
    return true;
  }
};

}  // namespace

TEST_CASE("ground under vehicles: a ramp from road to bumper becomes road again, the car and all other road stay") {
  Street street;
  REQUIRE(street.depth(20, kSill + 1) < 0.85F * street.truth(20, kSill + 1));
  const Image<float> before = street.depth;
  npsim_test::BackwardExecutor backward;
  REQUIRE(street.run(backward).ok());
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const bool wrong = x >= 10 && x < 38 && y > kSill && y <= kSill + kWrongRows;
      if (wrong) {
        CHECK(street.depth(x, y) == doctest::Approx(static_cast<double>(street.truth(x, y))).epsilon(0.005));
      } else {
        REQUIRE(street.depth(x, y) == before(x, y));
      }
    }
  }
  Street same;
  SerialExecutor serial;
  REQUIRE(same.run(serial).ok());
  CHECK(same.as_before(street.depth));
}

TEST_CASE("ground under vehicles: a strip of another label, a car at the picture's end and an unknown ground stay") {
  SerialExecutor serial;
  // A pavement of 10 rows before the road: nothing of its own label says how low it lies.
  Street island;
  for (int y = kSill + 1; y <= kSill + 10; ++y) {
    for (int x = 0; x < kShape.width; ++x) island.labels(x, y) = label::sidewalk;
  }
  Image<float> before = island.depth;
  REQUIRE(island.run(serial).ok());
  CHECK(island.as_before(before));

  Street low;
  for (int y = kSill + 1; y < kShape.height - 20; ++y) {
    for (int x = 10; x < 38; ++x) low.labels(x, y) = label::car;
  }
  before = low.depth;
  REQUIRE(low.run(serial).ok());
  CHECK(low.as_before(before));

  Street unknown;
  unknown.ground.inlier_share = 0.0F;
  before = unknown.depth;
  REQUIRE(unknown.run(serial).ok());
  CHECK(unknown.as_before(before));
}

TEST_CASE("ground under vehicles: missing depth is left, bad parameters are refused") {
  SerialExecutor serial;
  Street street;
  for (int x = 10; x < 38; ++x) street.depth(x, kSill + 3) = 0.0F;
  REQUIRE(street.run(serial).ok());
  CHECK(street.depth(20, kSill + 3) == 0.0F);
  CHECK(street.depth(20, kSill + 4) > 1.05F * kCar_m);
  GroundUnderVehiclesParams params;
  params.rise_m = std::numeric_limits<float>::quiet_NaN();
  CHECK(street.run(serial, params).code() == StatusCode::invalid_argument);
  params = {};
  params.reach_px = 129;
  CHECK(street.run(serial, params).code() == StatusCode::invalid_argument);
}
