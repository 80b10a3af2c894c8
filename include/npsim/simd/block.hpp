// SPDX-License-Identifier: Apache-2.0
// Blocks of 4x4 values of an image in batches: lane l of part p is element k = p lanes + l, in raster order.
//
// A kernel over a block runs for p = 0 .. 16 / lanes - 1: once with 16 lanes, sixteen times with one.
//   load_columns<F>(p, stride, part, out): column i of 4x4 blocks side by side, out[i] = p[(k / 4) stride + 4 (k % 4) +
//   i] for i = 0 .. 3, k being the block.
//   block_columns<F>(part), block_rows<F>(part): k % 4 and k / 4 as floats.
// Moves only: exact. Cost: four loads and eight permutations for four columns.
#ifndef NPSIM_SIMD_BLOCK_HPP
#define NPSIM_SIMD_BLOCK_HPP

#include <cstddef>

#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace simd {

inline constexpr int kBlockElements = 16;

template <class F>
NPSIM_ALWAYS_INLINE void load_columns(const float* p, std::ptrdiff_t stride, int part, F (&out)[4]) noexcept {
  static_assert(F::lanes == 1 || F::lanes == 4 || F::lanes == 8 || F::lanes == 16);
  if constexpr (F::lanes == 1) {
    for (int i = 0; i < 4; ++i) out[i] = F::load(p + (part / 4) * stride + 4 * (part % 4) + i);
  } else {
    const auto quarter = [=](int m) noexcept {
      return F::load(p + (part * F::lanes / 4 + m * F::lanes / 16) * stride + m * F::lanes % 16);
    };
    const F even[2] = {even_lanes(quarter(0), quarter(1)), even_lanes(quarter(2), quarter(3))};
    const F odd[2] = {odd_lanes(quarter(0), quarter(1)), odd_lanes(quarter(2), quarter(3))};
    out[0] = even_lanes(even[0], even[1]);
    out[1] = even_lanes(odd[0], odd[1]);
    out[2] = odd_lanes(even[0], even[1]);
    out[3] = odd_lanes(odd[0], odd[1]);
  }
}

template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE F block_columns(int part) noexcept {
  alignas(64) static constexpr float kColumns[kBlockElements] = {0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3};
  return F::load(kColumns + part * F::lanes);
}

template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE F block_rows(int part) noexcept {
  alignas(64) static constexpr float kRows[kBlockElements] = {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3};
  return F::load(kRows + part * F::lanes);
}

}  // namespace simd
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SIMD_BLOCK_HPP
