// SPDX-License-Identifier: Apache-2.0
// Takes noise from measured ground.
//
// The light of headlamps and far street lamps comes in within a few degrees of the ground, where centimetres of noise
// between neighbours throw shadows all over it; and nothing else in a street is known to be smooth. So each measured
// depth of the ground moves to the middle of the plane in 1/z that fits its surroundings (fitted_normals.hpp), by at
// most `deviations` of the sensor's noise and by what its source leaves open (DepthTrust). Before that, what stereo
// measured further than `mismatch` deviations off the plane of far wider surroundings, which outvotes patches of wrong
// matches, and further off the ground plane too, is one, and the wide plane takes its place.
// Ground: by label; without labels what lies within height_m of the ground plane.
// Everything else stays: on held-out points of real frames smoothing within the noise makes facades and plants worse.
// Cost: 2 x 81 samples per pixel of ground, of stereo twice. Memory: a number a pixel.
#ifndef NPSIM_DEPTH_MEASURED_GROUND_HPP
#define NPSIM_DEPTH_MEASURED_GROUND_HPP

#include <cmath>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/depth_source.hpp"
#include "npsim/depth/fitted_normals.hpp"
#include "npsim/depth/object_borders.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct MeasuredGroundParams {
  bool enabled = true;
  LabelSet labels =
      LabelSet::of(label::road, label::sidewalk, label::parking, label::ground, label::rail_track, label::terrain);
  float height_m = 0.15F;
  float angle_rad = 0.4F;  // FittedNormalsParams::angle_rad: surroundings a fifth as wide as those of normals
  float size_m = 3.0F;     // of the surroundings, at most
  float deviations = 2.0F;
  float mismatch = 6.0F;     // deviations
  FittedNormalsParams wide;  // surroundings that find wrong matches
};

[[nodiscard]] inline Status validate(const MeasuredGroundParams& p) noexcept {
  const bool good = p.height_m >= 0.0F && p.angle_rad > 0.0F && p.size_m > 0.0F && p.deviations >= 0.0F &&
                    p.mismatch >= p.deviations;  // false for NaN
  return good ? Status() : Status(StatusCode::invalid_argument, "measured ground: a parameter lies outside its range");
}

[[nodiscard]] constexpr std::size_t measured_ground_workspace_bytes(Shape shape) noexcept {
  return allocation_bytes<float>(shape.pixels()) + kWorkspaceAlignment;
}

// depth: in place. filled: what the depth is held to; wrong matches leave it too. confidence: see DepthTrust::held.
template <class Executor>
[[nodiscard]] Status smooth_measured_ground(const MeasuredGroundParams& params, const ObjectMap& objects,
                                            const DepthNoise& noise, const DepthTrust& trust, DepthSource source,
                                            const Intrinsics& camera, const GroundPlane& ground,
                                            ImageView<const float> confidence, ImageView<float> filled,
                                            ImageView<float> depth, Workspace& workspace, Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  const Shape shape = depth.shape();
  if (filled.shape() != shape || confidence.shape() != shape || !objects.fits(shape)) {
    return {StatusCode::shape_mismatch, "measured ground: all planes must have one shape"};
  }
  if (!params.enabled) return {};
  const WorkspaceScope scope(workspace);
  ImageView<float> smooth;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, smooth));
  FittedNormalsParams fit;
  fit.angle_rad = params.angle_rad;
  fit.max_size_m = params.size_m;
  fit.broad_size_m = params.size_m;
  const bool labelled = !objects.labels.empty();
  const auto height = [&](int x, int y, float z) {  // above the ground plane, m
    return dot(ground.up, unproject_pixel(camera, x, y, z)) + ground.camera_height_m;
  };
  const auto is_ground = [&](int x, int y) {
    if (labelled) return params.labels.contains(objects.labels(x, y));
    return ground.inlier_share > 0.0F && std::fabs(height(x, y, depth(x, y))) < params.height_m;
  };
  const auto each = [&](const auto& f) {
    executor.for_chunks(static_cast<std::size_t>(shape.height), 16, [&](std::size_t begin, std::size_t end) {
      for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
        for (int x = 0; x < shape.width; ++x) {
          if (smooth(x, y) != depth(x, y)) f(x, y);
        }
      }
    });
  };
  if (source == DepthSource::stereo) {
    NPSIM_RETURN_IF_ERROR(
        fitted_depth(params.wide, ImageView<const float>(depth), objects, noise, camera, is_ground, smooth, executor));
    each([&](int x, int y) {
      const float w = 1.0F / smooth(x, y);
      if (std::fabs(1.0F / depth(x, y) - w) <= params.mismatch * noise.deviation(w)) return;
      // Where the ground rises and falls it is the wide plane that is wrong.
      if (ground.inlier_share > 0.0F && std::fabs(height(x, y, depth(x, y))) < std::fabs(height(x, y, smooth(x, y)))) {
        return;
      }
      filled(x, y) = smooth(x, y);
      depth(x, y) = smooth(x, y);
    });
  }
  NPSIM_RETURN_IF_ERROR(
      fitted_depth(fit, ImageView<const float>(depth), objects, noise, camera, is_ground, smooth, executor));
  each([&](int x, int y) {
    const float w = 1.0F / depth(x, y);
    const float reach = params.deviations * noise.deviation(w);
    const float moved = clamp_to(1.0F / smooth(x, y) - w, -reach, reach);
    depth(x, y) = trust.held(filled(x, y), 1.0F / (w + moved), confidence(x, y));
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_MEASURED_GROUND_HPP
