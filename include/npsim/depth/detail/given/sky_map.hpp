// SPDX-License-Identifier: Apache-2.0
// What finding the sky and telling walls from it share: the values of their map, and 8-bit codes of colours.
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_SKY_MAP_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_SKY_MAP_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

inline constexpr std::uint8_t kSky = 0;
inline constexpr std::uint8_t kSurface = 1;
inline constexpr std::uint8_t kLike = 2;    // looks like the sky
inline constexpr std::uint8_t kUnlike = 3;  // does not
inline constexpr std::uint8_t kBeside = 4;  // does, above all of its column, though beside what was measured
inline constexpr std::uint8_t kGap = 5;     // may be sky: a laser had no answer

[[nodiscard]] inline int luma(const Rgb8& c) noexcept { return (c.r + 2 * c.g + c.b) / 4; }

[[nodiscard]] inline int difference(const Rgb8& a, const Rgb8& b) noexcept {
  const auto off = [](int u, int v) { return u > v ? u - v : v - u; };
  return max_of(off(a.r, b.r), off(a.g, b.g), off(a.b, b.b));
}

using ByteHistogram = std::array<double, 256>;

// Two classes of bytes: below `level`, and from there on. level 256: one would hold less than 2 %.
struct TwoClasses {
  int level = 256;
  double low_mean = 0;
  double high_mean = 0;
};
[[nodiscard]] inline TwoClasses two_classes(const ByteHistogram& histogram) noexcept {
  double sum = 0;
  double count = 0;
  for (int l = 0; l < 256; ++l) {
    sum += histogram[static_cast<std::size_t>(l)] * l;
    count += histogram[static_cast<std::size_t>(l)];
  }
  TwoClasses best;
  double best_spread = 0;
  double low = 0;
  double low_sum = 0;
  for (int l = 1; l < 256; ++l) {
    low += histogram[static_cast<std::size_t>(l - 1)];
    low_sum += histogram[static_cast<std::size_t>(l - 1)] * (l - 1);
    const double high = count - low;
    if (low < 0.02 * count || high < 0.02 * count || !(low > 0) || !(high > 0)) continue;
    const double low_mean = low_sum / low;
    const double high_mean = (sum - low_sum) / high;
    const double spread = low * high * (high_mean - low_mean) * (high_mean - low_mean);
    if (!(spread > best_spread)) continue;
    best_spread = spread;
    best = {l, low_mean, high_mean};
  }
  return best;
}

[[nodiscard]] inline int quantile_of(const ByteHistogram& histogram, double share) noexcept {
  double count = 0;
  for (const double n : histogram) count += n;
  double below = 0;
  for (int l = 0; l < 256; ++l) {
    below += histogram[static_cast<std::size_t>(l)];
    if (below >= share * count) return l;
  }
  return 255;
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_SKY_MAP_HPP
