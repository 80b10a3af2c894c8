// SPDX-License-Identifier: Apache-2.0
// Whose shape is unsure: where depth is measured, with noise, everything's but of ground that lies on the ground plane;
// where a network estimates it and no normals, that of plants, whose leaves are drawn (leaf_normals.hpp).
//
// Cost: three logarithms per pixel. Memory: UnsureLightGuides.
#ifndef NPSIM_PIPELINE_DETAIL_UNSURE_SURFACES_HPP
#define NPSIM_PIPELINE_DETAIL_UNSURE_SURFACES_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/refine_depth_params.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/render/surface_points.hpp"
#include "npsim/render/unsure_light.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace relight_detail {

// leaves: whether plants have leaves' normals. Exact depth has no noise, that of networks is smooth.
[[nodiscard]] constexpr bool has_unsure_surfaces(const UnsureLightParams& params, DepthSource source,
                                                 bool leaves) noexcept {
  return params.reach > 0.0F && (is_noisy(source) || leaves);
}

[[nodiscard]] inline Status find_unsure_surfaces(const UnsureLightParams& params, const RefinedDepth& refined,
                                                 const SurfacePoints& points,
                                                 ImageView<const std::uint32_t> visible_point, Workspace& workspace,
                                                 UnsureLightGuides& out) noexcept {
  constexpr float kOnGround_m = 0.3F;  // kerbs and the camber of a road
  constexpr float kUpright = 0.9F;     // cosine
  out.shape = visible_point.shape();
  const bool noisy = is_noisy(refined.source);
  // Leaves that are drawn pixel by pixel are smooth after as far as stereo's noise would be.
  constexpr float kLeaves = 1.0F / 512.0F;  // of the picture's width
  const float width_px = noisy ? refined.noise.width_px : max_of(1.0F, kLeaves * static_cast<float>(out.shape.width));
  out.iterations = unsure_light_iterations(params.reach * width_px);
  NPSIM_RETURN_IF_ERROR(workspace.allocate(UnsureLightGuides::floats(out.shape), out.planes));
  std::size_t pixel = 0;
  for (int y = 0; y < out.shape.height; ++y) {
    for (int x = 0; x < out.shape.width; ++x, ++pixel) {
      const std::uint32_t p = visible_point(x, y);
      const auto is_sure = [&] {
        if (!noisy) return refined.labels(x, y) != label::vegetation;
        return kGroundLabels.contains(refined.labels(x, y)) && dot(points.normal[p], refined.ground.up) > kUpright &&
               std::fabs(height_above_ground(refined.ground, points.position[p])) < kOnGround_m;
      };
      if (p == kNoPoint || is_sure()) {
        out.leave_out(pixel);
      } else {
        out.set(pixel, points.albedo[p], refined.labels(x, y));
      }
    }
  }
  return {};
}

}  // namespace relight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_UNSURE_SURFACES_HPP
