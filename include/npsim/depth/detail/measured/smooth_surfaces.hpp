// SPDX-License-Identifier: Apache-2.0
// Surfaces without the noise of the sensor that measured them: the depth that a mesh is made of.
//
// As a measurement the depth with its noise is the best there is: on held-out points of real frames every smoothing
// makes it worse. As a surface it is not. Light of headlamps and street lamps comes in within a few degrees of roads
// and walls, where noise between neighbours throws shadows that are not there. So each depth is drawn, by at most some
// deviations of its noise, to
//   the plane of its facade (detail/planes/planar_segments.hpp), by at most plane_deviations: relief beyond that stays,
//   less high, but for bulges of bulge_m, which no facade has: they are the plane's;
//   else the middle of the plane in 1/z that fits its surroundings (detail/normals/fitted_normals.hpp), by at most
//   `deviations`, on the ground ground_deviations. A kerb is another plane to such a fit, and stays, and so do the gaps
//   of a crown that is near enough to have been measured with them. Ground is fitted once more, over as little as a fit
//   may take in: where the samples of the first fit stand further apart than noise is wide, as on far ground,
//   neighbours have not seen the same ones, and what is left would change from pixel to pixel.
// Error: |1/smooth - 1/depth| is at most that many deviations, but for bulges.
// Cost: 81 samples per pixel that lies on no plane, on the ground twice that. Memory: a number a pixel.
#ifndef NPSIM_DEPTH_DETAIL_MEASURED_SMOOTH_SURFACES_HPP
#define NPSIM_DEPTH_DETAIL_MEASURED_SMOOTH_SURFACES_HPP

#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/depth_source.hpp"
#include "npsim/depth/detail/measured/ground_mismatches.hpp"
#include "npsim/depth/detail/normals/fitted_normals.hpp"
#include "npsim/depth/detail/object_borders.hpp"
#include "npsim/depth/detail/planes/planar_segments.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct SmoothSurfacesParams {
  bool enabled = true;
  LabelSet ground = kGroundLabels;
  float ground_height_m = 0.15F;  // without labels: from the ground plane
  FittedNormalsParams fit;
  float ground_deviations = 12.0F;  // 3 cm of height for stereo at 5 m
  float plane_deviations = 6.0F;    // PlanarSegmentsParams::on_plane
  float deviations = 3.0F;          // of all else
  float bulge_m = 3.0F;             // what is on a plane and so far before it was matched wrongly
};

[[nodiscard]] inline Status validate(const SmoothSurfacesParams& p) noexcept {
  const bool good = p.ground_height_m >= 0.0F && p.ground_deviations >= 0.0F && p.deviations >= 0.0F &&
                    p.plane_deviations >= 0.0F && p.bulge_m > 0.0F;  // false for NaN
  if (!good) return {StatusCode::invalid_argument, "smooth surfaces: a parameter lies outside its range"};
  return validate(p.fit);
}

[[nodiscard]] constexpr std::size_t smooth_surfaces_workspace_bytes(Shape shape) noexcept {
  return allocation_bytes<float>(shape.pixels()) + kWorkspaceAlignment;
}

// planes: of this depth, or empty. smooth: not the memory of the depth.
template <class Executor>
[[nodiscard]] Status smooth_surfaces(const SmoothSurfacesParams& params, ImageView<const float> depth,
                                     const ObjectMap& objects, const PlanarMap& planes, const DepthNoise& noise,
                                     const Intrinsics& camera, const GroundPlane& ground, ImageView<float> smooth,
                                     Workspace& workspace, Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  const Shape shape = depth.shape();
  if (smooth.shape() != shape || !objects.fits(shape) || !(planes.of.empty() || planes.of.shape() == shape)) {
    return {StatusCode::shape_mismatch, "smooth surfaces: all planes must have one shape"};
  }
  copy_pixels(depth, smooth);
  if (!params.enabled) return {};
  const WorkspaceScope scope(workspace);
  ImageView<float> coarse;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, coarse));
  copy_pixels(depth, coarse);
  const GroundTest is_ground(params.ground, params.ground_height_m, objects, camera, ground, depth);
  const auto draw = [&](int x, int y, float w, float deviations) {
    const float here = 1.0F / depth(x, y);
    const float most = deviations * noise.deviation(here);
    return 1.0F / (here + clamp_to(w - here, -most, most));
  };
  const auto fitted = [&](int x, int y) { return planes.at(x, y) == nullptr; };
  NPSIM_RETURN_IF_ERROR(depth_detail::for_fitted_planes(
      params.fit, depth, objects, noise, camera, shape, fitted,
      [&](int x, int y, const depth_detail::FittedPlane& plane) {
        const bool on_ground = is_ground(x, y);
        smooth(x, y) = draw(x, y, plane.c, on_ground ? params.ground_deviations : params.deviations);
        if (on_ground) coarse(x, y) = 1.0F / plane.c;
      },
      executor));
  FittedNormalsParams narrow = params.fit;
  narrow.max_size_m = narrow.broad_size_m = 1e-3F;  // min_px remains
  NPSIM_RETURN_IF_ERROR(depth_detail::for_fitted_planes(
      narrow, ImageView<const float>(coarse), objects, noise, camera, shape,
      [&](int x, int y) { return fitted(x, y) && is_ground(x, y); },
      [&](int x, int y, const depth_detail::FittedPlane& plane) {
        smooth(x, y) = draw(x, y, plane.c, params.ground_deviations);
      },
      executor));
  executor.for_chunks(static_cast<std::size_t>(shape.height), 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const PlanarSegment* const plane = planes.at(x, y);
        if (plane == nullptr || !is_valid_depth(depth(x, y))) continue;
        const float w = dot(plane->q, unproject_pixel(camera, x, y, 1.0F));
        if (!(w > 0.0F)) continue;
        if (1.0F / w - depth(x, y) > params.bulge_m) {
          smooth(x, y) = 1.0F / w;
        } else {
          smooth(x, y) = draw(x, y, w, params.plane_deviations);
        }
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_MEASURED_SMOOTH_SURFACES_HPP
