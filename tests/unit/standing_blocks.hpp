// SPDX-License-Identifier: Apache-2.0
// A level road under the sky, and upright blocks that stand on it, as depth and labels.
#ifndef NPSIM_TESTS_STANDING_BLOCKS_HPP
#define NPSIM_TESTS_STANDING_BLOCKS_HPP

#include "fixture.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim_test {

struct StandingBlocks {
  static constexpr npsim::Shape kShape{240, 160};
  static constexpr npsim::Intrinsics kCamera{200, 200, 120, 60};
  static constexpr npsim::GroundPlane kGround{{0, -1, 0}, 1.5F, 0.9F};
  Image<float> depth{kShape, 0.0F};
  Image<npsim::Label> labels{kShape, npsim::label::sky};

  StandingBlocks() {
    for (int y = 61; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) put(x, y, 300.0F / static_cast<float>(y - 60), npsim::label::road);
    }
  }
  void put(int x, int y, float z, npsim::Label l) {
    depth(x, y) = z;
    labels(x, y) = l;
  }
  // What stands z away in columns [left, right), from the ground to a height or, less, from a height.
  void stand(int left, int right, float z, float height_m, npsim::Label l = npsim::label::building,
             float from_m = 0.0F) {
    for (int y = row(height_m, z); y < row(from_m, z); ++y) {
      if (y < 0 || y >= kShape.height) continue;
      for (int x = left; x < right; ++x) put(x, y, z, l);
    }
  }
  [[nodiscard]] static int row(float height_m, float z) {
    return 60 + static_cast<int>(200.0F * (kGround.camera_height_m - height_m) / z);
  }
};

}  // namespace npsim_test

#endif  // NPSIM_TESTS_STANDING_BLOCKS_HPP
