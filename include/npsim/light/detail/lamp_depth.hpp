// SPDX-License-Identifier: Apache-2.0
// How far away the lamps of a light-index plane are: regions, and a robust distance for each.
//
// region_depth() is the median of z over the region without outliers (3 sigma by the quartiles, at least 2 %), from the
// first of these sets that has samples: certain surface pixels, all surface pixels, then the same in growing
// surroundings. Pixels labelled sky or ego vehicle, and depths outside 0.05 m to 100 km, never count. The median of at
// most kMaxRegionSamples pixels, taken evenly in raster order, stands for that of larger regions. 0 where nothing was
// found. Breakdown point: one half; fewer than half wrong pixels move the result by less than the spread of the right
// ones.
#ifndef NPSIM_LIGHT_DETAIL_LAMP_DEPTH_HPP
#define NPSIM_LIGHT_DETAIL_LAMP_DEPTH_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr std::size_t kMaxRegionSamples = 4096;
inline constexpr float kMinLightDepth = 0.05F;  // m; depths outside are taken for errors, and keep squares finite
inline constexpr float kMaxLightDepth = 1e5F;

// Pixels that carry one value of the index plane.
struct LightRegion {
  int x0 = 0, y0 = 0, x1 = -1, y1 = -1;  // bounding box, inclusive
  std::uint32_t pixels = 0;
  double sum_x = 0, sum_y = 0;  // of pixel centres

  [[nodiscard]] constexpr double mean_x() const noexcept { return sum_x / pixels; }
  [[nodiscard]] constexpr double mean_y() const noexcept { return sum_y / pixels; }
  // Share of the bounding box that belongs to the region.
  [[nodiscard]] constexpr float fill() const noexcept {
    const double box = static_cast<double>(x1 - x0 + 1) * static_cast<double>(y1 - y0 + 1);
    return static_cast<float>(static_cast<double>(pixels) / box);
  }
};

struct RegionInput {
  ImageView<const std::uint16_t> light_index;
  ImageView<const float> depth;
  ImageView<const Label> labels;            // may be empty
  ImageView<const std::uint8_t> uncertain;  // may be empty
  ImageView<const float> confidence;        // of measured depth: 1 where it was measured; of other depth empty
};

namespace light_detail {

[[nodiscard]] inline Status measure_regions(ImageView<const std::uint16_t> index, Span<LightRegion> regions) noexcept {
  for (LightRegion& r : regions) r = LightRegion{};
  for (int y = 0; y < index.height(); ++y) {
    for (int x = 0; x < index.width(); ++x) {
      const std::uint16_t value = index(x, y);
      if (value == 0) continue;
      if (value >= regions.size()) {
        return Status(StatusCode::invalid_argument, "the light index refers to a mark that does not exist");
      }
      LightRegion& r = regions[value];
      if (r.pixels == 0) r = {x, y, x, y, 0, 0.0, 0.0};
      r.x0 = std::min(r.x0, x);
      r.x1 = std::max(r.x1, x);
      r.y1 = y;
      ++r.pixels;
      r.sum_x += static_cast<double>(x) + 0.5;
      r.sum_y += static_cast<double>(y) + 0.5;
    }
  }
  return {};
}

[[nodiscard]] inline bool is_surface(const RegionInput& in, int x, int y) noexcept {
  const float z = in.depth(x, y);
  const bool credible = z >= kMinLightDepth && z <= kMaxLightDepth;  // false for NaN
  return credible && (in.labels.empty() || !kNoSurfaceLabels.contains(in.labels(x, y)));
}
[[nodiscard]] inline bool is_certain(const RegionInput& in, int x, int y) noexcept {
  return in.uncertain.empty() || in.uncertain(x, y) == 0;
}

// Lower median; reorders the values.
[[nodiscard]] inline float median(Span<float> values) noexcept {
  float* middle = values.data() + (values.size() - 1) / 2;
  select_nth(values.data(), middle, values.data() + values.size());
  return *middle;
}

// Median without outliers; 0 for no values. `values` is reordered.
[[nodiscard]] inline float robust_median(Span<float> values) noexcept {
  if (values.empty()) return 0.0F;
  const float first = median(values);
  // Half the interquartile range estimates the median absolute deviation without memory for the deviations.
  const std::size_t n = values.size();
  float* low = values.data() + n / 4;
  select_nth(values.data(), low, values.data() + n);
  const float q1 = *low;
  float* high = values.data() + (3 * n) / 4;
  select_nth(values.data(), high, values.data() + n);
  const float limit = std::max(0.02F * first, 3.0F * 1.4826F * 0.5F * (*high - q1));
  float* end = std::partition(values.begin(), values.end(), [&](float z) { return std::fabs(z - first) <= limit; });
  const auto kept = static_cast<std::size_t>(end - values.begin());
  return kept == 0 ? first : median(values.sub(0, kept));
}

// Collects the depths of at most scratch.size() accepted pixels of a rectangle, evenly in raster order.
template <class Accept>
[[nodiscard]] inline Span<float> collect_depth(const RegionInput& in, int x0, int y0, int x1, int y1, Accept&& accept,
                                               Span<float> scratch) noexcept {
  x0 = std::max(x0, 0);
  y0 = std::max(y0, 0);
  x1 = std::min(x1, in.depth.width() - 1);
  y1 = std::min(y1, in.depth.height() - 1);
  std::size_t total = 0;
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) total += accept(x, y) ? 1U : 0U;
  }
  const std::size_t step = total / scratch.size() + 1;
  std::size_t seen = 0;
  std::size_t count = 0;
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      if (accept(x, y) && seen++ % step == 0 && count < scratch.size()) scratch[count++] = in.depth(x, y);
    }
  }
  return scratch.sub(0, count);
}

[[nodiscard]] inline float region_depth(const RegionInput& in, const LightRegion& r, std::uint16_t value,
                                        Span<float> scratch) noexcept {
  for (const bool certain : {true, false}) {
    // A handful of certain pixels must not outvote a large region, nor three valid ones be ignored.
    const std::size_t enough =
        std::min<std::size_t>(r.pixels, certain ? std::max<std::size_t>(3, r.pixels / 20) : std::size_t{3});
    const Span<float> z = collect_depth(
        in, r.x0, r.y0, r.x1, r.y1,
        [&](int x, int y) {
          return in.light_index(x, y) == value && is_surface(in, x, y) && (!certain || is_certain(in, x, y));
        },
        scratch);
    if (z.size() >= enough) return robust_median(z);
  }
  const int side = std::max(r.x1 - r.x0, r.y1 - r.y0) + 1;
  for (int margin = std::max(side, 2), round = 0; round < 3; margin *= 2, ++round) {
    margin = std::min(margin, 4096);
    const Span<float> z = collect_depth(
        in, r.x0 - margin, r.y0 - margin, r.x1 + margin, r.y1 + margin,
        [&](int x, int y) { return is_surface(in, x, y) && is_certain(in, x, y); }, scratch);
    if (!z.empty()) return robust_median(z);
  }
  return 0.0F;
}

}  // namespace light_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LIGHT_DETAIL_LAMP_DEPTH_HPP
