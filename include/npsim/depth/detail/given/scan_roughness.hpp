// SPDX-License-Identifier: Apache-2.0
// How rough the things are that a scanner measured, for scenes without labels: leaves scatter its points, paint and
// walls do not, however dark and grainy they look.
//
// A point is rough where it is off the line in 1/z, which is straight on planes, through the nearest points of its line
// of the scanner at kNear_m to kFar_m on either side, by more than three standard deviations of the noise (6 cm). Of
// the points in a window of 3.2 degrees to each side some share is rough, which is taken for a half where nothing is
// measured. On a KITTI frame, two of nuScenes and one of Argoverse it is .02 to .2 on cars and walls that are seen
// whole, .4 to .9 on hedges and crowns, and as much at the rims of things and behind panes: what is smooth is no plant,
// and what is rough may be anything.
// Cost: for each point that stands up to six times kFar_m of the picture are looked at, three rows on either side, and
// a mean over windows.
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_SCAN_ROUGHNESS_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_SCAN_ROUGHNESS_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/window_filter.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/depth_source.hpp"
#include "npsim/depth/detail/fill/scan_lines.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

enum class Scanned { alone, smooth, rough };

// Of the point at (x, y). stands(x, y): whether the pixel shows a thing that stands.
template <class Stands>
[[nodiscard]] Scanned scanned_surface(ImageView<const float> depth, const Intrinsics& camera, const DepthNoise& noise,
                                      const Stands& stands, int x, int y) noexcept {
  constexpr float kNear_m = 0.12F;
  constexpr float kFar_m = 0.6F;
  constexpr float kDeviations = 3.0F;
  const float w = 1.0F / depth(x, y);
  const int first = static_cast<int>(clamp_to(kNear_m * camera.fx * w, 1.0F, static_cast<float>(depth.width())));
  const int last = static_cast<int>(clamp_to(kFar_m * camera.fx * w, 1.0F, static_cast<float>(depth.width())));
  const auto is_point = [&](int u, int v) {
    return depth.contains(u, v) && is_valid_depth(depth(u, v)) && stands(u, v);
  };
  constexpr int kAside = 1;  // lines slope a little
  const auto next = [&](int sign) {
    return depth_detail::next_point(is_point, x + sign * (first - 1), y, sign, 0, last - first + 1, kAside);
  };
  const depth_detail::ScanPoint left = next(-1);
  const depth_detail::ScanPoint right = next(1);
  if (left.x < 0 || right.x < 0) return Scanned::alone;
  const float t = static_cast<float>(x - left.x) / static_cast<float>(right.x - left.x);
  const float line = (1.0F - t) / depth(left.x, left.y) + t / depth(right.x, right.y);
  return std::fabs(w - line) > kDeviations * noise.deviation(w) ? Scanned::rough : Scanned::smooth;
}

[[nodiscard]] constexpr std::size_t scan_roughness_workspace_bytes(Shape reduced) noexcept {
  return (2 + kWindowMeanPlanes) * allocation_bytes<float>(reduced.pixels()) + kWorkspaceAlignment;
}

// share: of rough points about each pixel of the picture made smaller by `factor`.
template <class Stands, class Executor>
[[nodiscard]] Status scan_roughness(ImageView<const float> depth, const Intrinsics& camera, const DepthNoise& noise,
                                    const Stands& stands, int factor, ImageView<float> share, Workspace& workspace,
                                    Executor& executor) {
  constexpr float kWindow = 28.0F / 500.0F;  // of the focal length, to each side
  constexpr float kFewPoints = 4.0F;         // count as much as not knowing
  const WorkspaceScope scope(workspace);
  ImageView<float> points, rough;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(share.shape(), points));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(share.shape(), rough));
  for_pixels(share.shape(), executor, [&](int x, int y) {
    int count = 0;
    int of_them = 0;
    for (int v = y * factor; v < std::min((y + 1) * factor, depth.height()); ++v) {
      for (int u = x * factor; u < std::min((x + 1) * factor, depth.width()); ++u) {
        if (!is_valid_depth(depth(u, v)) || !stands(u, v)) continue;
        const Scanned surface = scanned_surface(depth, camera, noise, stands, u, v);
        count += surface != Scanned::alone ? 1 : 0;
        of_them += surface == Scanned::rough ? 1 : 0;
      }
    }
    points(x, y) = static_cast<float>(count);
    rough(x, y) = count > 0 ? static_cast<float>(of_them) / static_cast<float>(count) : 0.0F;
  });
  const float window_px = kWindow * camera.fx / static_cast<float>(factor) + 0.5F;
  const int radius = static_cast<int>(clamp_to(window_px, 1.0F, static_cast<float>(share.width())));
  return window_mean(points, rough, radius, kFewPoints, 0.5F, workspace, share, executor);
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_SCAN_ROUGHNESS_HPP
