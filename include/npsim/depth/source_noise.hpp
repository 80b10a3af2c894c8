// SPDX-License-Identifier: Apache-2.0
// How uncertain a measured depth is, by how it came about: the standard deviation of inverse depth w = 1 / z, in which
// planes are linear in the image.
//
//   stereo   disparity is measured, so the deviation of w is the same everywhere: .17 px of an image 2048 wide, over
//            focal length and baseline. On facades of real frames .15 to .17 px, .13 to .21 on cars; correlated over
//            some 4 px, the width over which matching smooths.
//   lidar    2 cm in z, hence .02 w^2; each point by itself.
//   network  a share of the depth, hence proportional to w, and smooth: neighbours share it. That deviation is what
//            normals see, over some pixels; over a whole facade errors drift by twice as much.
//   exact    rounding.
//   unknown  a share of the depth, measured: estimate_relative_noise().
#ifndef NPSIM_DEPTH_SOURCE_NOISE_HPP
#define NPSIM_DEPTH_SOURCE_NOISE_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/depth/detail/object_borders.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Deviation of w: amplitude w^power.
struct DepthNoise {
  float amplitude = 0.0F;
  int power = 1;
  float width_px = 1.0F;  // over which it is correlated
  float drift = 1.0F;     // deviation over a whole surface, in deviations; planes alone are that large

  [[nodiscard]] float deviation(float w) const noexcept {
    return power == 0 ? amplitude : (power == 1 ? amplitude * w : amplitude * w * w);
  }
};

// Median of |w - (w- + w+) / 2| / w over samples `reach_px` to the left and right within one object, which is 0 on
// planes, as a standard deviation. At most some 30,000 places are looked at. 0 where there are none.
[[nodiscard]] inline float estimate_relative_noise(ImageView<const float> depth, const ObjectMap& objects,
                                                   int reach_px) noexcept {
  constexpr int kBins = 256;  // of log2, 16 to the octave from 2^-16 up
  std::array<int, kBins> bins{};
  const int step = std::max(1, depth.width() / 200);
  int count = 0;
  for (int y = step / 2; y < depth.height(); y += step) {
    for (int x = reach_px + step / 2; x + reach_px < depth.width(); x += step) {
      const float before = depth(x - reach_px, y);
      const float here = depth(x, y);
      const float after = depth(x + reach_px, y);
      if (!is_valid_depth(before) || !is_valid_depth(here) || !is_valid_depth(after)) continue;
      if (!objects.same(x, y, x - reach_px, y) || !objects.same(x, y, x + reach_px, y)) continue;
      const float off = std::fabs(1.0F - 0.5F * here * (1.0F / before + 1.0F / after));
      const float bin = off > 0.0F ? 16.0F * (std::log2(off) + 16.0F) : 0.0F;
      ++bins[static_cast<std::size_t>(clamp_to(bin, 0.0F, static_cast<float>(kBins - 1)))];
      ++count;
    }
  }
  if (count == 0) return 0.0F;
  int below = 0;
  std::size_t at = 0;
  while (2 * (below + bins[at]) < count) below += bins[at++];
  const float median = std::exp2((static_cast<float>(at) + 0.5F) / 16.0F - 16.0F);
  return median / (0.6745F * 1.2247449F);  // of a Gaussian; of one sample less the mean of two
}

// source: unknown is measured. baseline_m: 0 where it is not known, which makes stereo unknown too.
[[nodiscard]] inline DepthNoise depth_noise(DepthSource source, float baseline_m, ImageView<const float> depth,
                                            const ObjectMap& objects, const Intrinsics& camera) noexcept {
  const float scale = static_cast<float>(depth.width()) / 2048.0F;
  const float correlated = std::max(1.0F, 4.0F * scale);
  if (source == DepthSource::stereo && baseline_m > 0.0F) {
    return {0.17F * scale / (camera.fx * baseline_m), 0, correlated};
  }
  if (source == DepthSource::lidar) return {0.02F, 2, 1.0F};
  if (source == DepthSource::exact) return {1e-3F, 1, 1.0F};
  if (source == DepthSource::network) return {0.01F, 1, 8.0F * correlated, 2.0F};
  const int reach = std::max(1, static_cast<int>(16.0F * scale));
  return {clamp_to(estimate_relative_noise(depth, objects, reach), 1e-4F, 0.05F), 1, correlated};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_SOURCE_NOISE_HPP
