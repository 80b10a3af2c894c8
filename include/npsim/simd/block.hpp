// SPDX-License-Identifier: Apache-2.0
// Blocks of 4x4 values of an image in batches: lane l of part p is element k = p lanes + l, in raster order.
//
// A kernel over a block runs for p = 0 .. 16 / lanes - 1: once with 16 lanes, sixteen times with one.
//   load_block<F>(p, stride, part): the elements p[(k / 4) stride + k % 4].
//   block_columns<F>(part), block_rows<F>(part): k % 4 and k / 4 as floats.
// Moves only: exact. Cost: with 16 lanes four loads and three insertions.
#ifndef NPSIM_SIMD_BLOCK_HPP
#define NPSIM_SIMD_BLOCK_HPP

#include <cstddef>
#include <type_traits>

#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace v1 {
inline namespace NPSIM_ISA_NAMESPACE {
namespace simd {

inline constexpr int kBlockElements = 16;

template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE F load_block(const float* p, std::ptrdiff_t stride, int part) noexcept {
#if defined(NPSIM_SIMD_AVX512)
  if constexpr (std::is_same_v<F, native::F32>) {
    const __m128 last = _mm_loadu_ps(p + 3 * stride);
    const __m256 upper = _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(p)), _mm_loadu_ps(p + stride), 1);
    const __m256 lower = _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(p + 2 * stride)), last, 1);
    return F(native::FloatBatch(_mm512_insertf32x8(_mm512_castps256_ps512(upper), lower, 1)));
  }
#elif defined(NPSIM_SIMD_AVX2)
  if constexpr (std::is_same_v<F, native::F32>) {
    const float* q = p + 2 * part * stride;
    return F(
        native::FloatBatch(_mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(q)), _mm_loadu_ps(q + stride), 1)));
  }
#endif
  const int first = part * F::lanes;
  static_assert(F::lanes <= 4 || F::lanes == 8 || F::lanes == 16);
  const float* q = p + (first / 4) * stride + first % 4;
  if constexpr (F::lanes <= 4) {
    return F::load(q);
  } else {
    float all[F::lanes];
    for (int i = 0; i < F::lanes; ++i) all[i] = q[(i / 4) * stride + i % 4];
    return F::load(all);
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
}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_SIMD_BLOCK_HPP
