// SPDX-License-Identifier: Apache-2.0
// The normals that guide the refinement and shade the surface: given ones, else those of the depth; smoothed within
// surfaces, and set upright on the ground.
//
// Where a given normal is missing the depth's stands in. Invariant: unit length, or zero where there is no surface.
// Cost: 25 taps per pixel and iteration of smoothing. Memory: see guiding_normals_workspace_bytes().
#ifndef NPSIM_DEPTH_GUIDING_NORMALS_HPP
#define NPSIM_DEPTH_GUIDING_NORMALS_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/smooth_normals.hpp"
#include "npsim/depth/normals.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Predicted normals are worst on roads, which are the plainest surface there is. On these labels they are smoothed far
// more than elsewhere, and what they still lean away from the ground plane's (robustly fitted to depth) is taken back: a
// lean of x < min_rad to x (1 - x / min_rad), larger ones wholly, but none above max_rad, which is a kerb's face. So a
// quarter of min_rad is left at most: by headlamps, whose light comes in at .06 rad ten metres ahead, a lean of .02 rad
// is a third more or less light, and the rim of a patch where the prediction leans shows as a ring.
struct GroundNormalsParams {
  bool enabled = true;
  LabelSet labels = LabelSet::of(label::road, label::sidewalk, label::parking, label::ground);
  LabelSet kerbs = LabelSet::of(label::sidewalk, label::ground);
  SmoothNormalsParams smoothing{5};
  float min_rad = 0.02F;
  float max_rad = 0.90F;
};

struct GuidingNormalsParams {
  NormalsParams form;
  // Of normals that come from depth, which carry its noise many times over: over 125 px. Stereo noise is as wide as its
  // windows.
  SmoothNormalsParams derived_smoothing{5};
  SmoothNormalsParams given_smoothing{2};  // of given ones
  GroundNormalsParams ground;              // of both, after smoothing
};

[[nodiscard]] constexpr std::size_t guiding_normals_workspace_bytes(const GuidingNormalsParams& params,
                                                                    Shape shape) noexcept {
  return kWorkspaceAlignment + allocation_bytes<Vec3f>(shape.pixels()) +
         smooth_normals_workspace_bytes(params.derived_smoothing, shape);
}

namespace refine_detail {

inline void straighten_ground(const GroundNormalsParams& params, const GroundPlane& ground,
                              ImageView<const Label> labels, ImageView<const Vec3f> smooth, ImageView<Vec3f> normals) {
  const float steep = std::cos(params.max_rad);
  const bool known = ground.inlier_share > 0.0F;  // a guess is no evidence against what was predicted
  for (int y = 0; y < normals.height(); ++y) {
    for (int x = 0; x < normals.width(); ++x) {
      if (!params.labels.contains(labels(x, y)) || normals(x, y) == Vec3f{}) continue;
      const float cosine = dot(smooth(x, y), ground.up);
      const float off = std::sqrt(std::max(0.0F, 2.0F - 2.0F * cosine));  // the chord; nearly the angle
      if (off > params.max_rad) continue;
      if (params.kerbs.contains(labels(x, y)) && dot(normals(x, y), ground.up) < steep) continue;
      const float towards = known ? std::clamp(off / params.min_rad, 0.0F, 1.0F) : 0.0F;
      normals(x, y) = normalized(smooth(x, y) * (1.0F - towards) + ground.up * towards);
    }
  }
}

}  // namespace refine_detail

// The normals that guide the refinement and shade the surface: given ones, else those of the filtered depth.
// given: the scene's normals, may be empty. ground: the ground plane of the depth; inlier_share 0: none.
template <class Executor>
[[nodiscard]] Status guiding_normals(const GuidingNormalsParams& params, ImageView<const Vec3f> given,
                                     ImageView<const float> depth, ImageView<const Label> labels,
                                     const Intrinsics& camera, const GroundPlane& ground, ImageView<Vec3f> normals,
                                     Workspace& workspace, Executor& executor) noexcept {
  const Shape shape = depth.shape();
  NPSIM_RETURN_IF_ERROR(normals_from_depth(params.form, depth, camera, normals, workspace, executor));
  for (int y = 0; y < (given.empty() ? 0 : shape.height); ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const Vec3f n = given(x, y);
      if (is_finite(n) && dot(n, n) > 0.25F) normals(x, y) = normalized(n);
    }
  }
  NPSIM_RETURN_IF_ERROR(smooth_normals(given.empty() ? params.derived_smoothing : params.given_smoothing, depth, labels,
                                       normals, workspace, executor));
  if (!params.ground.enabled) return {};
  const WorkspaceScope scope(workspace);
  ImageView<Vec3f> smooth;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, smooth));
  copy_pixels(normals, smooth);
  NPSIM_RETURN_IF_ERROR(smooth_normals(params.ground.smoothing, depth, labels, smooth, workspace, executor));
  refine_detail::straighten_ground(params.ground, ground, labels, smooth, normals);
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_GUIDING_NORMALS_HPP
