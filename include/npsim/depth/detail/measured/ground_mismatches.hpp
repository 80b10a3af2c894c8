// SPDX-License-Identifier: Apache-2.0
// Wrong matches of stereo on the ground.
//
// Asphalt has little texture, and matching goes wrong there in patches that fill and filters take for shape. But the
// ground is a plane over metres: what was measured further than `mismatch` deviations off the plane in 1/z that fits
// far wider surroundings (detail/normals/fitted_normals.hpp), which outvotes such a patch, and further off the ground
// plane too, is wrong, and the wide plane takes its place.
// Ground: by label; without labels what lies within height_m of the ground plane.
// Invariant: all other depth is not touched.
// Cost: 81 samples per pixel of ground. Memory: a number a pixel.
#ifndef NPSIM_DEPTH_DETAIL_MEASURED_GROUND_MISMATCHES_HPP
#define NPSIM_DEPTH_DETAIL_MEASURED_GROUND_MISMATCHES_HPP

#include <cmath>
#include <cstddef>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/normals/fitted_normals.hpp"
#include "npsim/depth/detail/object_borders.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct GroundMismatchParams {
  bool enabled = true;
  LabelSet labels = kGroundLabels;
  float height_m = 0.15F;
  float mismatch = 6.0F;     // deviations
  FittedNormalsParams wide;  // the surroundings
};

[[nodiscard]] inline Status validate(const GroundMismatchParams& p) noexcept {
  const bool good = p.height_m >= 0.0F && p.mismatch >= 0.0F;  // false for NaN
  if (!good) return {StatusCode::invalid_argument, "ground mismatches: a parameter lies outside its range"};
  return validate(p.wide);
}

[[nodiscard]] constexpr std::size_t ground_mismatches_workspace_bytes(Shape shape) noexcept {
  return allocation_bytes<float>(shape.pixels()) + kWorkspaceAlignment;
}

// Of every pixel of ground that its labels, or without labels its height, make one.
class GroundTest {
 public:
  GroundTest(LabelSet labels, float height_m, const ObjectMap& objects, const Intrinsics& camera,
             const GroundPlane& ground, ImageView<const float> depth) noexcept
      : labels_(labels), height_m_(height_m), objects_(objects), camera_(camera), ground_(ground), depth_(depth) {}

  // Above the ground plane, m.
  [[nodiscard]] float height(int x, int y, float z) const noexcept {
    return height_above_ground(ground_, unproject_pixel(camera_, x, y, z));
  }
  [[nodiscard]] bool operator()(int x, int y) const noexcept {
    if (!objects_.labels.empty()) return labels_.contains(objects_.labels(x, y));
    return ground_.inlier_share > 0.0F && std::fabs(height(x, y, depth_(x, y))) < height_m_;
  }

 private:
  LabelSet labels_;
  float height_m_;
  const ObjectMap& objects_;
  const Intrinsics& camera_;
  const GroundPlane& ground_;
  ImageView<const float> depth_;
};

// depth: in place. filled: the depth as it was measured and filled, which wrong matches leave too.
template <class Executor>
[[nodiscard]] Status replace_ground_mismatches(const GroundMismatchParams& params, const ObjectMap& objects,
                                               const DepthNoise& noise, const Intrinsics& camera,
                                               const GroundPlane& ground, ImageView<float> filled,
                                               ImageView<float> depth, Workspace& workspace,
                                               Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  const Shape shape = depth.shape();
  if (filled.shape() != shape || !objects.fits(shape)) {
    return {StatusCode::shape_mismatch, "ground mismatches: all planes must have one shape"};
  }
  if (!params.enabled) return {};
  const WorkspaceScope scope(workspace);
  ImageView<float> wide;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, wide));
  const GroundTest is_ground(params.labels, params.height_m, objects, camera, ground, depth);
  NPSIM_RETURN_IF_ERROR(
      fitted_depth(params.wide, ImageView<const float>(depth), objects, noise, camera, is_ground, wide, executor));
  executor.for_chunks(static_cast<std::size_t>(shape.height), 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        if (wide(x, y) == depth(x, y)) continue;
        const float w = 1.0F / wide(x, y);
        if (std::fabs(1.0F / depth(x, y) - w) <= params.mismatch * noise.deviation(w)) continue;
        // Where the ground rises and falls it is the wide plane that is wrong.
        if (ground.inlier_share > 0.0F &&
            std::fabs(is_ground.height(x, y, depth(x, y))) < std::fabs(is_ground.height(x, y, wide(x, y)))) {
          continue;
        }
        filled(x, y) = wide(x, y);
        depth(x, y) = wide(x, y);
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_MEASURED_GROUND_MISMATCHES_HPP
