// SPDX-License-Identifier: Apache-2.0
// Drops points of a laser on what hangs free before the ground and is thinner than its lines are apart, in scenes
// without labels.
//
// A rope, a tape or a twig is hit by single points, or by those of one line. Nothing says how thin it is: a patch of
// ground as high as lines are apart would become a wall that stands on it, shines and throws a shadow. Without these
// points it lies on the ground behind it. Hanging is a point above the ground
//   - next to which, above as well as below, there are points of the ground alone, kHangingThick_m apart at most: what
//     is as thick, a guard rail, is hit by two lines;
//   - of whose depth, within kHangingFarther, nothing else off the ground is above it, and nothing of that depth or
//     nearer below it as far as its foot would be, if something is measured so far down: a post is hit there, however
//     low, unless no line comes there.
// A scanner that stands higher than the camera sees ground past a post, which the picture shows below the post's point:
// that alone says nothing. Points are looked for up to twice `reach` away in columns where the next of a line would be,
// but for rows that a tape may fill. Arms of barriers, chains, handrails and tubes of bicycles are as thin: they lose
// points too, their posts do not.
// Cost: for a point that hangs 4 `reach` rows of a 64th of the width, for others fewer. Memory: none.
#ifndef NPSIM_DEPTH_DETAIL_MEASURED_HANGING_POINTS_HPP
#define NPSIM_DEPTH_DETAIL_MEASURED_HANGING_POINTS_HPP

#include <algorithm>
#include <cmath>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/window_filter.hpp"
#include "npsim/depth/detail/ground_level.hpp"
#include "npsim/depth/detail/neighbouring_points.hpp"
#include "npsim/geometry/ground.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

inline constexpr float kHangingFarther = 1.03F;
inline constexpr float kHangingThick_m = 0.3F;

// depth(x, y): measured. reach: hidden_reach_px().
[[nodiscard]] inline bool hangs_free(ImageView<const float> depth, const Intrinsics& camera, const GroundPlane& ground,
                                     int reach, int x, int y) noexcept {
  constexpr float kSlope = 0.01F;  // of its depth, that the ground may be off
  constexpr float kTape_m = 0.1F;  // two sweeps meet somewhere, and their lines do not: both hit a tape
  const auto above_m = [&](int u, int v) {
    return height_above_ground(ground, unproject_pixel(camera, u, v, depth(u, v)));
  };
  const auto is_ground = [&](int u, int v) {
    return above_m(u, v) <= 2.0F * depth_detail::ground_within_m(ground) + kSlope * depth(u, v);
  };
  if (is_ground(x, y)) return false;
  const float z = depth(x, y);
  const float pixels_per_m = camera.fy / z;
  const int aside = std::max(1, depth.width() / 128);  // no farther apart are points in a line
  const int tape = static_cast<int>(std::min(kTape_m * pixels_per_m, 0.25F * static_cast<float>(reach)));
  const float foot = above_m(x, y) * pixels_per_m;
  // Rows to the next ground behind; 0: none, or there is something else.
  const auto to_ground = [&](int way) {
    int rows = 0;
    for (int off = tape + 1; off <= 2 * reach; ++off) {
      const int v = y + way * off;
      if (v < 0 || v >= depth.height()) break;
      const bool next = rows == 0;  // no ground yet
      const bool stands_here = way > 0 && static_cast<float>(off) < foot;
      const auto is_other = [&](int u) {
        const bool behind = depth(u, v) > kHangingFarther * z;
        const bool beside = !behind && depth(u, v) * kHangingFarther > z;
        if (!behind && stands_here) return true;
        if ((next || beside) && !is_ground(u, v)) return true;
        rows = next ? off : rows;
        return false;
      };
      if (any_point_in_row(depth, x, v, aside, is_other)) return 0;
    }
    return rows;
  };
  const int below = to_ground(1);
  const int above = below > 0 ? to_ground(-1) : 0;
  if (above == 0 || static_cast<float>(above + below) > kHangingThick_m * pixels_per_m) return false;
  const int lowest = std::max(0, depth.height() - 1 - reach);  // lines end there
  const float foot_row = std::min(static_cast<float>(lowest), static_cast<float>(y) + std::ceil(foot));
  return any_point_from_row(depth, x, static_cast<int>(foot_row), aside);
}

// measured: the shape of depth, and other memory; what hangs free becomes 0. reach: hidden_reach_px(); 0: nothing does.
template <class Executor>
void drop_hanging_points(ImageView<const float> depth, const Intrinsics& camera, const GroundPlane& ground, int reach,
                         ImageView<float> measured, Executor& executor) noexcept {
  if (reach == 0 || !(ground.inlier_share > 0.0F)) return;
  for_pixels(depth.shape(), executor, [&](int x, int y) {
    if (is_valid_depth(depth(x, y)) && hangs_free(depth, camera, ground, reach, x, y)) measured(x, y) = 0.0F;
  });
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_MEASURED_HANGING_POINTS_HPP
