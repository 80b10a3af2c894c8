// SPDX-License-Identifier: Apache-2.0
// Of depth that has holes: the points of a row beside a pixel, and how steep the way to a point is.
#ifndef NPSIM_DEPTH_DETAIL_NEIGHBOURING_POINTS_HPP
#define NPSIM_DEPTH_DETAIL_NEIGHBOURING_POINTS_HPP

#include <algorithm>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/ground.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

// Whether f(u) says true of one of the points in row y, up to `aside` columns beside x. It is asked from the left.
template <class F>
[[nodiscard]] bool any_point_in_row(ImageView<const float> depth, int x, int y, int aside, const F& f) {
  for (int u = std::max(0, x - aside); u <= std::min(x + aside, depth.width() - 1); ++u) {
    if (is_valid_depth(depth(u, y)) && f(u)) return true;
  }
  return false;
}

// Whether anything is measured in row y or below it, up to `aside` columns beside x.
[[nodiscard]] inline bool any_point_from_row(ImageView<const float> depth, int x, int y, int aside) noexcept {
  for (int v = y; v < depth.height(); ++v) {
    if (any_point_in_row(depth, x, v, aside, [](int) { return true; })) return true;
  }
  return false;
}

// From a place to the point at (x, y).
struct Slope {
  float rise_m, along_m;
};
[[nodiscard]] inline Slope slope_to(ImageView<const float> depth, const Intrinsics& camera, const GroundPlane& ground,
                                    const Vec3f& from, int x, int y) noexcept {
  const Vec3f way = unproject_pixel(camera, x, y, depth(x, y)) - from;
  const float rise = dot(way, ground.up);
  return {rise, length(way - ground.up * rise)};
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_NEIGHBOURING_POINTS_HPP
