// SPDX-License-Identifier: Apache-2.0
// Edge-avoiding a-trous filter (Dammertz et al., HPG 2010) over planes that share its weights.
//
// In iteration i, 3 x 3 taps 2^i pixels apart, with (1 2 1) / 4 along rows and columns times what `Weights` says of two
// pixels:
//   at<F>(pixel)             what it knows of the pixels from `pixel` on
//   weight<F>(p, q, spline)  how much the taps q count for the pixels p, 0 or more, times spline
// A pixel for which nothing counts keeps what it has. Same bits with any number of lanes and any executor.
#ifndef NPSIM_RENDER_DETAIL_ATROUS_HPP
#define NPSIM_RENDER_DETAIL_ATROUS_HPP

#include <algorithm>
#include <cstddef>
#include <utility>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace atrous_detail {

// Pixels x .. x + lanes - 1 of row y, of all planes; more than one only where no tap leaves the row.
template <class F, class Weights>
void filter_pixels(const Weights& weights, Shape shape, const float* in, float* out, std::size_t planes, int x, int y,
                   int step) noexcept {
  constexpr float kSpline[3] = {0.25F, 0.5F, 0.25F};
  const std::size_t plane = shape.pixels();
  const auto at = [&](int column, int row) { return std::ptrdiff_t{row} * shape.width + column; };
  const auto centre = weights.template at<F>(at(x, y));
  F weight[9];
  std::ptrdiff_t offset[9];
  int taps = 0;
  F sum(0.0F);
  for (int j = -1; j <= 1; ++j) {
    const int row = y + j * step;
    if (row < 0 || row >= shape.height) continue;
    for (int i = -1; i <= 1; ++i) {
      const int column = x + i * step;
      if (column < 0 || column + F::lanes > shape.width) continue;
      offset[taps] = at(column, row);
      weight[taps] =
          weights.template weight<F>(centre, weights.template at<F>(offset[taps]), kSpline[i + 1] * kSpline[j + 1]);
      sum = sum + weight[taps++];
    }
  }
  const auto any = sum > F(0.0F);
  const F share = F(1.0F) / select(any, sum, F(1.0F));
  for (std::size_t c = 0; c < planes; ++c) {
    const float* const from = in + c * plane;
    F value(0.0F);
    for (int t = 0; t < taps; ++t) value = fma(weight[t], F::load(from + offset[t]), value);
    select(any, value * share, F::load(from + at(x, y))).store(out + c * plane + static_cast<std::size_t>(at(x, y)));
  }
}

// Rows [first, last) of all planes, once.
template <class F, class Weights, class Executor>
void filter_rows(const Weights& weights, Shape shape, int first, int last, int step, std::size_t planes,
                 const float* in, float* out, Executor& executor) {
  using One = simd::scalar::F32;
  executor.for_chunks(static_cast<std::size_t>(last - first), 8, [&](std::size_t begin, std::size_t end) {
    for (int y = first + static_cast<int>(begin); y < first + static_cast<int>(end); ++y) {
      int x = 0;
      for (; x < std::min(step, shape.width); ++x) filter_pixels<One>(weights, shape, in, out, planes, x, y, step);
      for (; x + F::lanes + step <= shape.width; x += F::lanes) {
        filter_pixels<F>(weights, shape, in, out, planes, x, y, step);
      }
      for (; x < shape.width; ++x) filter_pixels<One>(weights, shape, in, out, planes, x, y, step);
    }
  });
}

// Rows [first, last) of `count` planes that lie one behind the other. `other` has room for as many, and either may hold
// the result: `planes` is where it is.
template <class F, class Weights, class Executor>
void filter(const Weights& weights, Shape shape, int first, int last, int iterations, std::size_t count,
            Span<float>& planes, Span<float>& other, Executor& executor) {
  for (int i = 0; i < iterations; ++i) {
    filter_rows<F>(weights, shape, first, last, 1 << i, count, planes.data(), other.data(), executor);
    std::swap(planes, other);
  }
}

}  // namespace atrous_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_DETAIL_ATROUS_HPP
