// SPDX-License-Identifier: Apache-2.0
// The wet pixels of an image: which they are, and how the film on them changes what they show.
//
// Of diffuse light that comes by way of other surfaces the film lets 1 - E(n.wo) out; direct light has it in its
// reflection. What the film mirrors is filtered over 13 pixels only, so that it keeps the outlines of houses.
// Memory: see mirrors_bytes().
#ifndef NPSIM_PIPELINE_DETAIL_MIRRORED_IMAGE_HPP
#define NPSIM_PIPELINE_DETAIL_MIRRORED_IMAGE_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/material/roughness.hpp"
#include "npsim/render/denoise.hpp"
#include "npsim/render/mirror.hpp"
#include "npsim/render/surface_points.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

[[nodiscard]] constexpr bool is_wet(const WetFilmParams& p) noexcept { return p.wetness > 0.0F; }

[[nodiscard]] constexpr std::size_t mirrors_bytes(const MirrorParams& p, std::size_t pixels) noexcept {
  const std::size_t rays = p.rays > 0 ? static_cast<std::size_t>(p.rays) : 0;
  return 2 * allocation_bytes<std::uint32_t>(pixels) + allocation_bytes<std::uint32_t>(pixels * rays) +
         allocation_bytes<float>(pixels) + allocation_bytes<Vec3f>(pixels);
}

namespace relight_detail {

// At most `most` pixels are wet.
[[nodiscard]] inline Status list_mirrors(const MirrorParams& params, const SurfacePoints& points,
                                         ImageView<const std::uint32_t> visible_point, std::size_t most,
                                         Workspace& workspace, Mirrors& out) noexcept {
  NPSIM_RETURN_IF_ERROR(workspace.allocate(most, out.pixel));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(most, out.point));
  std::size_t count = 0;
  for (int y = 0; y < visible_point.height(); ++y) {
    for (int x = 0; x < visible_point.width(); ++x) {
      const std::uint32_t point = visible_point(x, y);
      if (point == kNoPoint || points.film[point] == 0 || count == most) continue;
      out.pixel[count] = static_cast<std::uint32_t>(y) * static_cast<std::uint32_t>(visible_point.width()) +
                         static_cast<std::uint32_t>(x);
      out.point[count++] = point;
    }
  }
  out.rays = params.rays;
  out.pixel = out.pixel.sub(0, count);
  out.point = out.point.sub(0, count);
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count * static_cast<std::size_t>(params.rays), out.hits));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, out.weight));
  return workspace.allocate(count, out.sky);
}

[[nodiscard]] constexpr DenoiseParams mirror_filter(DenoiseParams params) noexcept {
  params.iterations = params.iterations < 2 ? params.iterations : 2;
  return params;
}

// Of diffuse light that comes by way of other surfaces, what the film over a point lets out towards the camera.
[[nodiscard]] inline float share_below_film(float f0, const SurfacePoints& points, std::uint32_t p) noexcept {
  const SpecularAlbedo reflected(points.alpha[p], film_f0(f0, points.film[p]));
  return 1.0F - reflected(dot(points.normal[p], normalized(-points.position[p])));
}

}  // namespace relight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_MIRRORED_IMAGE_HPP
