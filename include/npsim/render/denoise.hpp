// SPDX-License-Identifier: Apache-2.0
// Edge-avoiding a-trous filter (Dammertz et al., HPG 2010) for noisy indirect irradiance on the pixel grid.
//
// Irradiance, not radiance, is filtered, so that texture stays sharp. Iteration i takes 5 x 5 taps 2^i pixels apart
// with B3-spline weights; a tap counts by how well its normal agrees (cosine to a power) and how near it lies to the
// centre's tangent plane, relative to depth. Pixels without a point keep what they have and give nothing. Cost: 25 taps
// per pixel and iteration. Memory: two images. Error: bias only where irradiance changes within one smooth surface over
// less than the footprint (4 * 2^iterations pixels).
#ifndef NPSIM_RENDER_DENOISE_HPP
#define NPSIM_RENDER_DENOISE_HPP

#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct DenoiseParams {
  int iterations = 4;              // footprint 61 px; 0 switches the filter off; at most 8
  int normal_power_doublings = 5;  // the cosine between normals counts to the power 2^5 = 32
  float plane_sigma = 0.01F;       // distance from the tangent plane, as a share of depth
};

[[nodiscard]] inline Status validate(const DenoiseParams& p) noexcept {
  const bool good = p.iterations >= 0 && p.iterations <= 8 && p.normal_power_doublings >= 0 &&
                    p.normal_power_doublings <= 8 && p.plane_sigma > 0.0F;
  return good ? Status()
              : Status(StatusCode::invalid_argument, "denoise: iterations and power in 0..8, plane_sigma positive");
}

[[nodiscard]] constexpr std::size_t denoise_workspace_bytes(const DenoiseParams&, Shape shape) noexcept {
  return kWorkspaceAlignment + allocation_bytes<Vec3f>(shape.pixels());
}

namespace denoise_detail {

inline Vec3f filtered(const DenoiseParams& params, ImageView<const Vec3f> in, ImageView<const Vec3f> position,
                      ImageView<const Vec3f> normal, int x, int y, int step) noexcept {
  constexpr float kSpline[5] = {1.0F / 16, 4.0F / 16, 6.0F / 16, 4.0F / 16, 1.0F / 16};
  const Vec3f p = position(x, y);
  const Vec3f n = normal(x, y);
  if (!(p.z > 0.0F)) return in(x, y);
  const float scale = 1.0F / (params.plane_sigma * p.z);
  Vec3f sum;
  float weight_sum = 0.0F;
  for (int j = -2; j <= 2; ++j) {
    for (int i = -2; i <= 2; ++i) {
      const int qx = x + i * step;
      const int qy = y + j * step;
      if (!in.contains(qx, qy) || !(position(qx, qy).z > 0.0F)) continue;
      const float off_plane = dot(n, position(qx, qy) - p) * scale;
      float cosine = dot(n, normal(qx, qy));
      if (!(cosine > 0.0F)) continue;
      for (int d = 0; d < params.normal_power_doublings; ++d) cosine *= cosine;
      // A rational kernel instead of exp: cheap, and as wide in its core.
      const float weight = kSpline[i + 2] * kSpline[j + 2] * cosine / (1.0F + off_plane * off_plane);
      sum += in(qx, qy) * weight;
      weight_sum += weight;
    }
  }
  return weight_sum > 0.0F ? sum / weight_sum : in(x, y);
}

}  // namespace denoise_detail

// Filters `irradiance` in place. `position` has z <= 0 where a pixel has no point; normals are unit vectors elsewhere.
template <class Executor>
Status denoise_irradiance(const DenoiseParams& params, ImageView<const Vec3f> position, ImageView<const Vec3f> normal,
                          ImageView<Vec3f> irradiance, Workspace& workspace, Executor& executor) {
  const Shape shape = irradiance.shape();
  if (position.shape() != shape || normal.shape() != shape) {
    return Status(StatusCode::shape_mismatch, "denoise: position, normal and irradiance must have one size");
  }
  NPSIM_RETURN_IF_ERROR(validate(params));
  WorkspaceScope scope(workspace);
  ImageView<Vec3f> other;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, other));
  ImageView<Vec3f> from = irradiance;
  ImageView<Vec3f> to = other;
  for (int i = 0; i < params.iterations; ++i) {
    executor.for_chunks(static_cast<std::size_t>(shape.height), 8, [&](std::size_t begin, std::size_t end) {
      for (auto y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
        for (int x = 0; x < shape.width; ++x) {
          to(x, y) = denoise_detail::filtered(params, from, position, normal, x, y, 1 << i);
        }
      }
    });
    const ImageView<Vec3f> swap = from;
    from = to;
    to = swap;
  }
  if (from.data() != irradiance.data()) {
    copy_pixels(from, irradiance);
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_DENOISE_HPP
