// SPDX-License-Identifier: Apache-2.0
// Albedo from the daytime photograph and its labels, where no inverse-rendering network supplies them.
//
// 1. Linear: sRGB decoded (IEC 61966-2-1).
// 2. Illuminant: grey world over road, pavement, building and wall, which are nearly neutral; its cast is divided out
//    to the share that `cast_removal` states, at constant luminance.
// 3. Shading: the ratio Y / (class median) of ground, buildings and plants is averaged over tiles; classes differ in
//    albedo but share the light that falls on a place, so the smooth part of this ratio is light, not paint. It is
//    divided out by half (square root), which halves the contrast of large cast shadows in log terms; their edges
//    stay. Vehicles, people and signs vary too much to tell light from paint, and so does everything without labels:
//    no step 3 there.
// 4. Scale: per class, so that the median luminance meets the prior of class_priors.hpp; texture in a class stays.
// 5. Bounds: luminance ratio to the prior at most max_ratio, values in [min_albedo, max_albedo]. Saturated pixels (a
//    channel at or above saturated_level: sky in panes, lit lamps, sun glints) have no trustworthy colour: grey.
// Invariant: output is finite and within the bounds; pixels without surface get the neutral prior. Without labels all
// is one class. The median of a class meets its prior to 1 % where the bounds do not bite (histogram of 1024 bins).
// It is an estimate up to an unknown factor per class, not a measurement: a white and a black car share one prior.
// Cost: four passes. Memory: histograms (2.4 MB) and tile sums. Same bits for any thread count.
#ifndef NPSIM_MATERIAL_ALBEDO_HPP
#define NPSIM_MATERIAL_ALBEDO_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/material/detail/class_priors.hpp"
#include "npsim/material/detail/daylight.hpp"
#include "npsim/material/roughness.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

[[nodiscard]] constexpr std::size_t estimate_albedo_workspace_bytes(const AlbedoParams& p, Shape shape) noexcept {
  const std::size_t tiles = albedo_tiles(shape.width, p.tile_px) * albedo_tiles(shape.height, p.tile_px);
  constexpr auto kClasses = static_cast<std::size_t>(kLabelCount);
  return allocation_bytes<AlbedoPartial>(kAlbedoChunks) +
         allocation_bytes<std::uint32_t>(kAlbedoChunks * kClasses * kAlbedoHistogramBins) +
         allocation_bytes<float>(kClasses) * 2 + 2 * allocation_bytes<float>(tiles) + kWorkspaceAlignment;
}


// `labels` may be empty. `albedo` is linear RGB.
template <class Executor>
Status estimate_albedo(const AlbedoParams& p, ImageView<const Rgb8> day, ImageView<const Label> labels,
                       Workspace& workspace, ImageView<Vec3f> albedo, Executor& executor) {
  using namespace albedo_detail;
  NPSIM_RETURN_IF_ERROR(validate(p));
  const Shape shape = day.shape();
  if (day.empty()) return Status(StatusCode::invalid_argument, "albedo: the photograph is empty");
  if (albedo.shape() != shape || (!labels.empty() && labels.shape() != shape)) {
    return Status(StatusCode::shape_mismatch, "albedo: labels and output must have the shape of the photograph");
  }
  const WorkspaceScope scope(workspace);
  Context c;
  c.params = p;
  c.day = day;
  c.labels = labels;
  c.tiles_x = static_cast<int>(albedo_tiles(shape.width, p.tile_px));
  c.tiles_y = static_cast<int>(albedo_tiles(shape.height, p.tile_px));
  const std::size_t tiles = static_cast<std::size_t>(c.tiles_x) * static_cast<std::size_t>(c.tiles_y);
  Span<float> medians, scale, raw, smooth;
  Span<AlbedoPartial> partials;
  Span<std::uint32_t> histograms;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(kAlbedoChunks, partials));
  NPSIM_RETURN_IF_ERROR(
      workspace.allocate(kAlbedoChunks * static_cast<std::size_t>(kLabelCount) * kAlbedoHistogramBins, histograms));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(kLabelCount), medians));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(kLabelCount), scale));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(tiles, raw));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(tiles, smooth));

  c.gain = cast_gain(c, partials, executor);
  class_medians(c, histograms, medians, executor);
  if (p.soften_shading && !labels.empty()) {
    measure_shading(c, medians, raw, smooth, executor);
    c.tiles = smooth;
    class_medians(c, histograms, medians, executor);
  }
  for (std::size_t l = 0; l < scale.size(); ++l) {
    scale[l] = medians[l] > 0.0F ? kSurfacePriors[l].albedo / medians[l] : kSurfacePriors[l].albedo;
  }

  constexpr std::size_t kRows = 16;
  executor.for_chunks(static_cast<std::size_t>(shape.height), kRows, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      const int y = static_cast<int>(row);
      for (int x = 0; x < shape.width; ++x) {
        const Label l = c.at(x, y);
        const float prior = surface_prior(l).albedo;
        Vec3f a{prior, prior, prior};
        if (!kNoSurfaceLabels.contains(l)) {
          a = c.linear(x, y) * (scale[l] / c.shading(x, y));
          float lum = luminance(a);
          if (c.saturated(day(x, y))) a = {lum, lum, lum};
          const float limit = p.max_ratio * prior;
          if (lum > limit) a *= limit / lum;
          const float high = std::max({a.x, a.y, a.z});
          if (high > p.max_albedo) a *= p.max_albedo / high;  // all channels, so that the hue stays
        }
        albedo(x, y) = {std::clamp(a.x, p.min_albedo, p.max_albedo), std::clamp(a.y, p.min_albedo, p.max_albedo),
                        std::clamp(a.z, p.min_albedo, p.max_albedo)};
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_ALBEDO_HPP
