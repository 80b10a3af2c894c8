// SPDX-License-Identifier: Apache-2.0
// What the steps of de-lighting share: planes, logarithms of the same bits everywhere, and a loop over pixels.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_PLANES_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_PLANES_HPP

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/window_filter.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

using Plane = ImageView<float>;

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

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_PLANES_HPP
