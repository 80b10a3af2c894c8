// SPDX-License-Identifier: Apache-2.0
// What the steps of de-lighting share: planes, logarithms of the same bits everywhere, a loop over pixels, quantiles.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_PLANES_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_PLANES_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/window_filter.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

using Plane = ImageView<float>;

inline constexpr float kLog2E = 1.44269504F;
inline constexpr float kLn2 = 0.69314718F;

// The same bits everywhere.
[[nodiscard]] inline float log2_of(float x) noexcept { return simd::log2(simd::scalar::F32(x)).value; }
[[nodiscard]] inline float exp2_of(float x) noexcept { return simd::exp2(simd::scalar::F32(x)).value; }

// f(x, y) of every pixel.
template <class F, class Executor>
void for_pixels(Shape shape, Executor& executor, F&& f) {
  for_rows(executor, shape.height, [&](int y) {
    for (int x = 0; x < shape.width; ++x) f(x, y);
  });
}

// Quantile of a plane's values where inside(x, y); histogram over [-16, 16).
template <class Inside, class Value>
[[nodiscard]] float plane_quantile(Shape shape, const Inside& inside, const Value& value, float quantile,
                                   Span<std::uint32_t> histogram) {
  for (std::uint32_t& h : histogram) h = 0;
  const auto bins = static_cast<float>(histogram.size());
  std::uint64_t n = 0;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (!inside(x, y)) continue;
      ++histogram[static_cast<std::size_t>(clamp_to((value(x, y) + 16.0F) * bins / 32.0F, 0.0F, bins - 1.0F))];
      ++n;
    }
  }
  const auto wanted = static_cast<std::uint64_t>(quantile * static_cast<float>(n));
  std::uint64_t below = 0;
  for (std::size_t i = 0; i < histogram.size(); ++i) {
    below += histogram[i];
    if (below > wanted) return (static_cast<float>(i) + 0.5F) * 32.0F / bins - 16.0F;
  }
  return 0.0F;
}

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_PLANES_HPP
