// SPDX-License-Identifier: Apache-2.0
// Where an estimated depth jumps within what its labels call one object: from house to house, from person to person.
// Estimators draw such jumps out to ramps, steep ones; what rises gently is their drift.
#ifndef NPSIM_DEPTH_DETAIL_ESTIMATED_SURFACE_JUMPS_HPP
#define NPSIM_DEPTH_DETAIL_ESTIMATED_SURFACE_JUMPS_HPP

#include <cmath>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/depth/detail/object_borders.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// mask: set to 1 also where from a pixel to its right or lower neighbour of the same object the depth departs by more
// than the share `jump` from the plane that the pixel's normal stands for; else left as it is, and where there is no
// normal. mark_depth_borders() has the jumps between objects.
// Cost: one pass. Memory: none.
template <class Executor>
[[nodiscard]] Status mark_surface_jumps(float jump, ImageView<const float> depth, ImageView<const Vec3f> normals,
                                        const ObjectMap& objects, const Intrinsics& camera,
                                        ImageView<std::uint8_t> mask, Executor& executor) noexcept {
  const Shape shape = depth.shape();
  if (normals.shape() != shape || mask.shape() != shape || !objects.fits(shape)) {
    return {StatusCode::shape_mismatch, "surface jumps: depth, normals, objects and mask must have one shape"};
  }
  if (!(jump >= 0.0F)) return {StatusCode::invalid_argument, "surface jumps: jump must not be negative"};
  for_rows(executor, shape.height, [&](int y) {
    for (int x = 0; x < shape.width; ++x) {
      const Vec3f n = normals(x, y);
      if (!is_valid_depth(depth(x, y)) || n == Vec3f{}) continue;
      const float here = dot(n, unproject_pixel(camera, x, y, depth(x, y)));
      const auto leaves = [&](int i, int j) {
        if (!depth.contains(i, j) || !is_valid_depth(depth(i, j)) || !objects.same(x, y, i, j)) return false;
        const float there = dot(n, unproject_pixel(camera, i, j, depth(i, j)));
        return !(std::fabs(there - here) <= jump * std::fabs(here));
      };
      if (leaves(x + 1, y) || leaves(x, y + 1)) mask(x, y) = 1;
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_ESTIMATED_SURFACE_JUMPS_HPP
