// SPDX-License-Identifier: Apache-2.0
// Nothing that stands on the ground reaches below it: the feet of what depth places behind the ground before them are
// drawn up to the ground.
//
// Noise, loose labels and the shapes that poles and cars are given put the lowest rows of a thing farther away than the
// ground in the rows below goes on, which is under it. In the mesh these rows lie beneath the ground: no lamp reaches
// them, and masts, walls and bicycles end in black rims.
// In each column the ground of the nearest ground pixel below goes on in parallel to the ground plane: as far below the
// camera, h (detail/ground_level.hpp), so that a ray r meets it at z = -h / dot(up, r). With the noise of single pixels
// feet would have steps from column to column, and shade themselves.
// A surface that lies less than unsure_m above that, or below it, takes the depth of clear_m above, if it does not come
// nearer by more than most_share: the mesh has the ground itself there too, completed behind the thing. One that was
// more than bare_m below shows ground that a loose label gave to the thing, and takes the ground's normal.
// A thing whose lowest pixels are deeper than deepest_m below is seen over an edge and stays.
// Invariant: ground pixels, pixels without ground below them in their column, and what lies farther behind are not
// touched; no depth grows, none falls to 0 or below. The same bits for any thread count. Cost: one pass over the image.
#ifndef NPSIM_DEPTH_DETAIL_GROUND_CONTACT_HPP
#define NPSIM_DEPTH_DETAIL_GROUND_CONTACT_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/depth/detail/ground_level.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct GroundContactParams {
  float bare_m = 0.05F;
  float clear_m = 0.05F;
  // What lies lower than this above the ground may be below it; negative: only what is that far below is. At most
  // clear_m, either way.
  float unsure_m = 0.05F;
  float deepest_m = 0.0F;  // below the ground at which a surface is still a foot; 0: any
  // Of its depth that a pixel may come nearer; what would more is no foot, but seen over a raised edge, or a slope
  // beyond. 0 switches the step off.
  float most_share = 0.1F;
  LabelSet ground = kGroundLabels;
};

[[nodiscard]] inline Status validate(const GroundContactParams& p) noexcept {
  const bool good = p.bare_m >= 0.0F && std::isfinite(p.bare_m) && p.clear_m >= 0.0F && p.most_share >= 0.0F &&
                    p.most_share <= 1.0F && std::isfinite(p.clear_m) && std::fabs(p.unsure_m) <= p.clear_m &&
                    p.deepest_m >= 0.0F;
  return good ? Status()
              : Status(StatusCode::invalid_argument,
                       "ground contact: heights not negative, unsure_m at most clear_m, share in [0, 1]");
}

// surface: z-depth, m, and normals: changed in place. Without labels nothing changes.
template <class Executor>
[[nodiscard]] Status keep_above_ground(const GroundContactParams& params, ImageView<const Label> labels,
                                       const Intrinsics& camera, const GroundPlane& ground, ImageView<Vec3f> normals,
                                       ImageView<float> surface, Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(camera));
  const Shape shape = surface.shape();
  if (normals.shape() != shape || !(labels.empty() || labels.shape() == shape)) {
    return {StatusCode::shape_mismatch, "ground contact: all planes must have one shape"};
  }
  if (labels.empty() || !(params.most_share > 0.0F)) return {};
  constexpr std::size_t kColumns = 64;
  // Ground pixels do not change, so that any column may be asked.
  const auto is_ground = [&](int x, int y) {
    return params.ground.contains(labels(x, y)) && is_valid_depth(surface(x, y));
  };
  executor.for_chunks(static_cast<std::size_t>(shape.width), kColumns, [&](std::size_t begin, std::size_t end) {
    float under_m[kColumns] = {};  // how far the ground met last lies below the camera; 0: none yet
    Vec3f normal[kColumns];
    for (int y = shape.height - 1; y >= 0; --y) {
      for (std::size_t column = begin; column < end; ++column) {
        const auto x = static_cast<int>(column);
        const float z = surface(x, y);
        const float fall = depth_detail::fall_of_ray(ground, camera, x, y);
        if (!is_valid_depth(z) || !(fall > 0.0F)) continue;
        if (is_ground(x, y)) {
          const bool open = y > 0 && is_ground(x, y - 1);  // nothing stands here
          under_m[column - begin] =
              open ? z * fall : depth_detail::below_camera_m(surface, labels, camera, ground.up, x, y);
          normal[column - begin] = normals(x, y);
          continue;
        }
        const float below_m = z * fall - under_m[column - begin];
        const float clear_m = under_m[column - begin] - params.clear_m;  // below the camera
        if (params.deepest_m > 0.0F && below_m > params.deepest_m) {
          under_m[column - begin] = 0.0F;  // what stands there is seen over an edge, all the way up
          continue;
        }
        if (!(below_m > -params.unsure_m) || !(clear_m > 0.0F)) continue;
        if (z * fall - clear_m > params.most_share * z * fall) continue;
        surface(x, y) = std::min(z, clear_m / fall);
        if (below_m > params.bare_m) normals(x, y) = normal[column - begin];
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GROUND_CONTACT_HPP
