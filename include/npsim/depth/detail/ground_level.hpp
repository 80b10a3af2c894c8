// SPDX-License-Identifier: Apache-2.0
// How high the ground is where a thing stands on it, from noisy depth, and where rays meet it.
//
// At a pixel of the ground: the median of how far below the camera its row lies within kGroundLevelReach_m, 4 to 64 px
// of it, where it has the same label, so that a kerb stays a step. One pixel's noise would be a step between
// neighbours, and the nearest of many pixels a bias.
// Cost: at most kGroundLevelSamples look-ups and a selection.
#ifndef NPSIM_DEPTH_DETAIL_GROUND_LEVEL_HPP
#define NPSIM_DEPTH_DETAIL_GROUND_LEVEL_HPP

#include <algorithm>
#include <array>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

// How far a pixel's ray falls below the camera per metre of depth.
[[nodiscard]] inline float fall_of_ray(const GroundPlane& ground, const Intrinsics& camera, int x, int y) noexcept {
  return -dot(ground.up, unproject_pixel(camera, x, y, 1.0F));
}

// Within this of the ground plane lies the ground, of a low camera's within a tenth of its height: depth may be of
// another scale.
inline constexpr float kGroundHeight_m = 0.15F;
[[nodiscard]] inline float ground_within_m(const GroundPlane& ground) noexcept {
  return std::min(kGroundHeight_m, 0.1F * ground.camera_height_m);
}

inline constexpr float kGroundLevelReach_m = 0.2F;
inline constexpr float kGroundLevelLeast_px = 4.0F;
inline constexpr float kGroundLevelMost_px = 64.0F;
inline constexpr int kGroundLevelSamples = 33;

// depth(x, y): valid.
[[nodiscard]] inline float below_camera_m(ImageView<const float> depth, ImageView<const Label> labels,
                                          const Intrinsics& camera, const Vec3f& up, int x, int y) noexcept {
  constexpr int kHalf = kGroundLevelSamples / 2;
  const float reach_px = kGroundLevelReach_m * camera.fx / depth(x, y);
  const auto reach = static_cast<int>(clamp_to(reach_px, kGroundLevelLeast_px, kGroundLevelMost_px));
  const int step = std::max(1, (reach + kHalf - 1) / kHalf);
  std::array<float, kGroundLevelSamples> some;
  std::size_t count = 0;
  for (int off = -(reach / step) * step; off <= reach; off += step) {
    const int u = x + off;
    if (u < 0 || u >= depth.width() || labels(u, y) != labels(x, y) || !is_valid_depth(depth(u, y))) continue;
    some[count++] = -dot(up, unproject_pixel(camera, u, y, depth(u, y)));
  }
  select_nth(some.data(), some.data() + count / 2, some.data() + count);
  return some[count / 2];
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GROUND_LEVEL_HPP
