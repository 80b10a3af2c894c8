// SPDX-License-Identifier: Apache-2.0
// Drops points of a laser on what hangs free before the ground and is thinner than its lines are apart, in scenes
// without labels.
//
// A rope, a tape or a twig is hit by single points, or by those of one line. Nothing says how thin it is: a patch of
// ground as high as lines are apart would become a wall that stands on it, shines and throws a shadow. Without these
// points it lies on the ground behind it. Hanging is a point off the ground, above it by more than ground may be, if
// next to it, above as well as below, there are points of the ground alone, farther by kHangingFarther: the ray below
// passes under it. What stands is none, for the ray below it ends at it, or on the ground in front. And no other point
// that is off the ground is as far away, within that, above or below it: it may be one of a post, whose points lie
// between the lines of the ground. Points are looked for up to twice hidden_reach_px() away in columns where the next
// of a line would be, but for rows that a tape may fill. Where sweeps were put together nothing is dropped.
// Cost: for a point that hangs 4 hidden_reach_px() rows of a 64th of the width, for others fewer. Memory: none.
#ifndef NPSIM_DEPTH_DETAIL_MEASURED_HANGING_POINTS_HPP
#define NPSIM_DEPTH_DETAIL_MEASURED_HANGING_POINTS_HPP

#include <algorithm>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/window_filter.hpp"
#include "npsim/depth/detail/ground_level.hpp"
#include "npsim/depth/detail/measured/hidden_points.hpp"
#include "npsim/geometry/ground.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

inline constexpr float kHangingFarther = 1.03F;

// depth(x, y): measured. reach: that of what hides, in px.
[[nodiscard]] inline bool hangs_free(ImageView<const float> depth, const Intrinsics& camera, const GroundPlane& ground,
                                     int reach, int x, int y) noexcept {
  constexpr float kSlope = 0.01F;   // of its depth, that the ground may be off
  constexpr float kThick_m = 0.1F;  // two sweeps meet somewhere, and their lines do not: both hit a tape
  const auto is_ground = [&](int u, int v) {
    const float z = depth(u, v);
    return height_above_ground(ground, unproject_pixel(camera, u, v, z)) <=
           2.0F * depth_detail::ground_within_m(ground) + kSlope * z;
  };
  if (is_ground(x, y)) return false;
  const float z = depth(x, y);
  const int aside = std::max(1, depth.width() / 128);  // no farther apart are points in a line
  const int thick = static_cast<int>(std::min(kThick_m * camera.fy / z, 0.25F * static_cast<float>(reach)));
  const auto ground_behind = [&](int way) {
    bool found = false;
    for (int off = thick + 1; off <= 2 * reach; ++off) {
      const int v = y + way * off;
      if (v < 0 || v >= depth.height()) break;
      const bool next = !found;
      for (int u = std::max(0, x - aside); u <= std::min(x + aside, depth.width() - 1); ++u) {
        const float other = depth(u, v);
        if (!is_valid_depth(other)) continue;
        const bool behind = other > kHangingFarther * z;
        const bool beside = !behind && other * kHangingFarther > z;
        if ((next && !behind) || ((next || beside) && !is_ground(u, v))) return false;
        found = true;
      }
    }
    return found;
  };
  return ground_behind(1) && ground_behind(-1);
}

// measured: the shape of depth, and other memory; what hangs free becomes 0.
template <class Executor>
void drop_hanging_points(ImageView<const float> depth, const Intrinsics& camera, const GroundPlane& ground,
                         ImageView<float> measured, Executor& executor) noexcept {
  const int reach = hidden_reach_px(depth);
  if (reach == 0 || !(ground.inlier_share > 0.0F)) return;
  for_pixels(depth.shape(), executor, [&](int x, int y) {
    if (is_valid_depth(depth(x, y)) && hangs_free(depth, camera, ground, reach, x, y)) measured(x, y) = 0.0F;
  });
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_MEASURED_HANGING_POINTS_HPP
