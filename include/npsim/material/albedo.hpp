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
// 4. Scale: per class, so that the median luminance meets the prior of detail/class_priors.hpp; texture in a class
// stays.
// 5. Bounds: luminance ratio to the prior at most max_ratio, values in [min_albedo, max_albedo]. Saturated pixels (a
//    channel at or above saturated_level: sky in panes, lit lamps, sun glints) have no trustworthy colour: grey.
// Invariant: output is finite and within the bounds; pixels without surface get the neutral prior. Without labels all
// is one class. The median of a class meets its prior to 1 % where the bounds do not bite (histogram of 1024 bins).
// It is an estimate up to an unknown factor per class, not a measurement: a white and a black car share one prior.
// Cost: four passes. Memory: histograms (2.4 MB) and tile sums. Partial results are kept per chunk of
// rows, with a number of chunks that is fixed, and combined in chunk order: the same bits for any thread count.
#ifndef NPSIM_MATERIAL_ALBEDO_HPP
#define NPSIM_MATERIAL_ALBEDO_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/color/srgb.hpp"
#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/material/detail/class_priors.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct AlbedoParams {
  float cast_removal = 0.7F;   // 0 keeps the colour cast, 1 makes the reference classes grey on average
  bool soften_shading = true;  // step 3
  int tile_px = 32;            // 4..1024; of step 3, at any image size
  int saturated_level = 250;   // 1..256; 256 switches the treatment off
  float max_ratio = 4.0F;      // > 1: of luminance to the prior
  float min_albedo = 0.02F;
  float max_albedo = 0.9F;
};

[[nodiscard]] inline Status validate(const AlbedoParams& p) noexcept {
  const bool good = p.cast_removal >= 0.0F && p.cast_removal <= 1.0F && p.tile_px >= 4 && p.tile_px <= 1024 &&
                    p.saturated_level >= 1 && p.saturated_level <= 256 && p.max_ratio > 1.0F &&
                    std::isfinite(p.max_ratio) && p.min_albedo >= 0.0F && p.max_albedo > p.min_albedo &&
                    p.max_albedo <= 1.0F;
  return good ? Status() : Status(StatusCode::invalid_argument, "albedo: a parameter lies outside its range");
}

inline constexpr std::size_t kAlbedoHistogramBins = 1024;
inline constexpr std::size_t kAlbedoChunks = 16;  // partial histograms and sums; fixed, so never the thread count

// Partial sums of one chunk of rows.
struct AlbedoPartial {
  double red = 0, green = 0, blue = 0;
  std::uint64_t count = 0;
};

[[nodiscard]] constexpr std::size_t albedo_tiles(int pixels, int tile) noexcept {
  return pixels > 0 && tile > 0 ? static_cast<std::size_t>((pixels + tile - 1) / tile) : 0;
}

[[nodiscard]] constexpr std::size_t estimate_albedo_workspace_bytes(const AlbedoParams& p, Shape shape) noexcept {
  const std::size_t tiles = albedo_tiles(shape.width, p.tile_px) * albedo_tiles(shape.height, p.tile_px);
  constexpr auto kClasses = static_cast<std::size_t>(kLabelCount);
  return allocation_bytes<AlbedoPartial>(kAlbedoChunks) +
         allocation_bytes<std::uint32_t>(kAlbedoChunks * kClasses * kAlbedoHistogramBins) +
         allocation_bytes<float>(kClasses) * 2 + 2 * allocation_bytes<float>(tiles) + kWorkspaceAlignment;
}

namespace albedo_detail {

inline constexpr LabelSet kReferenceLabels =
    LabelSet::of(label::road, label::sidewalk, label::parking, label::building, label::wall, label::ground);

// Of step 3.
inline constexpr LabelSet kShadingLabels = LabelSet::of(label::road, label::sidewalk, label::parking, label::building,
                                                        label::wall, label::ground, label::vegetation, label::terrain);

struct Context {
  AlbedoParams params;
  ImageView<const Rgb8> day;
  ImageView<const Label> labels;
  Vec3f gain{1.0F, 1.0F, 1.0F};
  Span<const float> tiles;  // smoothed shading ratio; empty: none
  int tiles_x = 0, tiles_y = 0;

  [[nodiscard]] Label at(int x, int y) const noexcept {
    if (labels.empty()) return label::unlabeled;
    const Label l = labels(x, y);
    return l < kLabelCount ? l : label::unlabeled;
  }
  [[nodiscard]] bool saturated(const Rgb8& c) const noexcept {
    return max_of(static_cast<int>(c.r), static_cast<int>(c.g), static_cast<int>(c.b)) >= params.saturated_level;
  }
  [[nodiscard]] Vec3f linear(int x, int y) const noexcept { return srgb_decode8(day(x, y)) * gain; }
  // Bilinear between tile centres; the ends extend flat.
  [[nodiscard]] float shading(int x, int y) const noexcept {
    if (tiles.empty()) return 1.0F;
    const float inverse = 1.0F / static_cast<float>(params.tile_px);
    const float fx = clamp_to((static_cast<float>(x) + 0.5F) * inverse - 0.5F, 0.0F, static_cast<float>(tiles_x - 1));
    const float fy = clamp_to((static_cast<float>(y) + 0.5F) * inverse - 0.5F, 0.0F, static_cast<float>(tiles_y - 1));
    const int x0 = static_cast<int>(fx);
    const int y0 = static_cast<int>(fy);
    const int x1 = std::min(x0 + 1, tiles_x - 1);
    const int y1 = std::min(y0 + 1, tiles_y - 1);
    const float ax = fx - static_cast<float>(x0);
    const float ay = fy - static_cast<float>(y0);
    const auto t = [&](int i, int j) {
      return tiles[static_cast<std::size_t>(j) * static_cast<std::size_t>(tiles_x) + static_cast<std::size_t>(i)];
    };
    const float top = t(x0, y0) + (t(x1, y0) - t(x0, y0)) * ax;
    const float bottom = t(x0, y1) + (t(x1, y1) - t(x0, y1)) * ax;
    return std::sqrt(top + (bottom - top) * ay);
  }
};

// Median luminance of each class after division by the shading; 0 for a class without pixels.
template <class Executor>
void class_medians(const Context& c, Span<std::uint32_t> histograms, Span<float> medians, Executor& executor) {
  constexpr std::size_t kBins = kAlbedoHistogramBins;
  constexpr auto kClasses = static_cast<std::size_t>(kLabelCount);
  constexpr float kScale = 0.5F * static_cast<float>(kBins);  // bins are even in sqrt(Y), from 0 to 2
  for (std::uint32_t& h : histograms) h = 0;
  const auto height = static_cast<std::size_t>(c.day.height());
  const std::size_t rows = chunk_count(height, kAlbedoChunks);  // rows of a chunk
  executor.for_chunks(height, rows, [&](std::size_t begin, std::size_t end) {
    std::uint32_t* own = histograms.data() + begin / rows * kClasses * kBins;
    for (std::size_t row = begin; row < end; ++row) {
      const int y = static_cast<int>(row);
      for (int x = 0; x < c.day.width(); ++x) {
        const Label l = c.at(x, y);
        if (kNoSurfaceLabels.contains(l) || c.saturated(c.day(x, y))) continue;
        const float root = std::sqrt(luminance(c.linear(x, y)) / c.shading(x, y));
        const float bin = root * kScale;
        ++own[l * kBins + (bin < static_cast<float>(kBins - 1) ? static_cast<std::size_t>(bin) : kBins - 1)];
      }
    }
  });
  for (std::size_t l = 0; l < kClasses; ++l) {
    std::uint64_t total = 0;
    for (std::size_t b = 0; b < kBins; ++b) {
      for (std::size_t k = 1; k < kAlbedoChunks; ++k) {
        histograms[l * kBins + b] += histograms[(k * kClasses + l) * kBins + b];
      }
      total += histograms[l * kBins + b];
    }
    medians[l] = 0.0F;
    std::uint64_t below = 0;
    for (std::size_t b = 0; b < kBins && total > 0; ++b) {
      const std::uint64_t here = histograms[l * kBins + b];
      if (2 * (below + here) >= total) {
        const float inside =
            here > 0 ? (0.5F * static_cast<float>(total) - static_cast<float>(below)) / static_cast<float>(here) : 0.5F;
        const float root = (static_cast<float>(b) + clamp_to(inside, 0.0F, 1.0F)) / kScale;
        medians[l] = std::max(root * root, 1e-5F);
        break;
      }
      below += here;
    }
  }
}

// Grey-world gain of step 2.
template <class Executor>
[[nodiscard]] Vec3f cast_gain(const Context& c, Span<AlbedoPartial> partials, Executor& executor) {
  for (AlbedoPartial& s : partials) s = AlbedoPartial{};
  const auto height = static_cast<std::size_t>(c.day.height());
  const std::size_t rows = chunk_count(height, kAlbedoChunks);
  executor.for_chunks(height, rows, [&](std::size_t begin, std::size_t end) {
    AlbedoPartial& own = partials[begin / rows];
    for (std::size_t row = begin; row < end; ++row) {
      const int y = static_cast<int>(row);
      for (int x = 0; x < c.day.width(); ++x) {
        if (!c.labels.empty() && !kReferenceLabels.contains(c.at(x, y))) continue;
        if (c.saturated(c.day(x, y))) continue;
        const Vec3f v = c.linear(x, y);
        own.red += static_cast<double>(v.x);
        own.green += static_cast<double>(v.y);
        own.blue += static_cast<double>(v.z);
        ++own.count;
      }
    }
  });
  AlbedoPartial all;
  for (const AlbedoPartial& s : partials) {
    all.red += s.red;
    all.green += s.green;
    all.blue += s.blue;
    all.count += s.count;
  }
  if (all.count == 0) return {1.0F, 1.0F, 1.0F};
  const double n = static_cast<double>(all.count);
  const double mean[3] = {all.red / n, all.green / n, all.blue / n};
  const double y = 0.2126 * mean[0] + 0.7152 * mean[1] + 0.0722 * mean[2];
  const double share = static_cast<double>(c.params.cast_removal);
  double gain[3];
  // A channel may be changed by a factor of three at most: a street is not that blue.
  for (int i = 0; i < 3; ++i) {
    gain[i] = mean[i] > 0.0 && y > 0.0 ? 1.0 + share * (clamp_to(y / mean[i], 1.0 / 3.0, 3.0) - 1.0) : 1.0;
  }
  const double after = 0.2126 * gain[0] * mean[0] + 0.7152 * gain[1] * mean[1] + 0.0722 * gain[2] * mean[2];
  const double keep = after > 0.0 ? y / after : 1.0;
  return {static_cast<float>(gain[0] * keep), static_cast<float>(gain[1] * keep), static_cast<float>(gain[2] * keep)};
}

// Mean over each tile of sqrt(Y / class median), squared; then a 3 x 3 box over tiles.
template <class Executor>
void measure_shading(const Context& c, Span<const float> medians, Span<float> raw, Span<float> smooth,
                     Executor& executor) {
  const int tile = c.params.tile_px;
  const int nx = c.tiles_x;
  const int ny = c.tiles_y;
  executor.for_chunks(static_cast<std::size_t>(ny), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t j = begin; j < end; ++j) {
      for (int i = 0; i < nx; ++i) {
        double sum = 0.0;
        int n = 0;
        const int y_end = std::min((static_cast<int>(j) + 1) * tile, c.day.height());
        const int x_end = std::min((i + 1) * tile, c.day.width());
        for (int y = static_cast<int>(j) * tile; y < y_end; ++y) {
          for (int x = i * tile; x < x_end; ++x) {
            const Label l = c.at(x, y);
            if (!kShadingLabels.contains(l) || !(medians[l] > 0.0F)) continue;
            const float ratio = luminance(c.linear(x, y)) / medians[l];
            sum += static_cast<double>(std::sqrt(clamp_to(ratio, 0.02F, 8.0F)));
            ++n;
          }
        }
        const double mean = n > 0 ? sum / n : 0.0;
        raw[j * static_cast<std::size_t>(nx) + static_cast<std::size_t>(i)] = static_cast<float>(mean * mean);
      }
    }
  });
  for (int j = 0; j < ny; ++j) {
    for (int i = 0; i < nx; ++i) {
      float sum = 0.0F;
      int n = 0;
      for (int y = std::max(j - 1, 0); y <= std::min(j + 1, ny - 1); ++y) {
        for (int x = std::max(i - 1, 0); x <= std::min(i + 1, nx - 1); ++x) {
          const float v = raw[static_cast<std::size_t>(y) * static_cast<std::size_t>(nx) + static_cast<std::size_t>(x)];
          if (!(v > 0.0F)) continue;
          sum += v;
          ++n;
        }
      }
      smooth[static_cast<std::size_t>(j) * static_cast<std::size_t>(nx) + static_cast<std::size_t>(i)] =
          n > 0 ? clamp_to(sum / static_cast<float>(n), 0.05F, 8.0F) : 1.0F;
    }
  }
}

}  // namespace albedo_detail

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
          const float high = max_of(a.x, a.y, a.z);
          if (high > p.max_albedo) a *= p.max_albedo / high;  // all channels, so that the hue stays
        }
        albedo(x, y) = {clamp_to(a.x, p.min_albedo, p.max_albedo), clamp_to(a.y, p.min_albedo, p.max_albedo),
                        clamp_to(a.z, p.min_albedo, p.max_albedo)};
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_ALBEDO_HPP
