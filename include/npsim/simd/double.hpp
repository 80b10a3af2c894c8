// SPDX-License-Identifier: Apache-2.0
// Batches of doubles, for sums that single precision would spoil. simd::Double<F> belongs to the float batch F: one
// register, so half the lanes of the native one; one double beside scalar::F32.
//
//   D(x) broadcast, D::load(p), d.store(p) of doubles, or of floats: loading those is exact, storing rounds to nearest
//   even; no alignment needed. + - *, fma(a, b, c).
// Rules as in batch.hpp: correctly rounded, fma rounds once except with plain SSE2.
#ifndef NPSIM_SIMD_DOUBLE_HPP
#define NPSIM_SIMD_DOUBLE_HPP

#include <cmath>

#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace simd {
namespace scalar {

struct F64 {
  static constexpr int lanes = 1;

  F64() = default;
  F64(double x) noexcept : value(x) {}  // NOLINT(google-explicit-constructor)
  [[nodiscard]] static F64 load(const double* p) noexcept { return *p; }
  [[nodiscard]] static F64 load(const float* p) noexcept { return static_cast<double>(*p); }
  void store(double* p) const noexcept { *p = value; }
  void store(float* p) const noexcept { *p = static_cast<float>(value); }

  friend F64 operator+(F64 a, F64 b) noexcept { return a.value + b.value; }
  friend F64 operator-(F64 a, F64 b) noexcept { return a.value - b.value; }
  friend F64 operator*(F64 a, F64 b) noexcept { return a.value * b.value; }
  [[nodiscard]] friend F64 fma(F64 a, F64 b, F64 c) noexcept {
    if constexpr (kFusedFma) {
      return std::fma(a.value, b.value, c.value);
    } else {
      return a * b + c;
    }
  }

  double value;
};

}  // namespace scalar

#if !defined(NPSIM_SIMD_SCALAR)
namespace native {

using DoubleBatch = xsimd::batch<double, Arch>;

#if defined(NPSIM_SIMD_AVX512)
// With a mask of all lanes for the reason given in detail/native.hpp.
inline DoubleBatch fused(const DoubleBatch& a, const DoubleBatch& b, const DoubleBatch& c) noexcept {
  return _mm512_fmadd_pd(a, b, c);
}
inline DoubleBatch widened(const float* p) noexcept { return _mm512_maskz_cvtps_pd(0xFF, _mm256_loadu_ps(p)); }
inline void store_narrowed(float* p, const DoubleBatch& a) noexcept {
  _mm256_storeu_ps(p, _mm512_maskz_cvtpd_ps(0xFF, a));
}
#elif defined(NPSIM_SIMD_AVX2)
inline DoubleBatch fused(const DoubleBatch& a, const DoubleBatch& b, const DoubleBatch& c) noexcept {
  return _mm256_fmadd_pd(a, b, c);
}
inline DoubleBatch widened(const float* p) noexcept { return _mm256_cvtps_pd(_mm_loadu_ps(p)); }
inline void store_narrowed(float* p, const DoubleBatch& a) noexcept { _mm_storeu_ps(p, _mm256_cvtpd_ps(a)); }
#elif defined(NPSIM_SIMD_SSE2)
inline DoubleBatch fused(const DoubleBatch& a, const DoubleBatch& b, const DoubleBatch& c) noexcept {
  return a * b + c;
}
inline DoubleBatch widened(const float* p) noexcept {
  return _mm_cvtps_pd(_mm_castsi128_ps(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(p))));
}
inline void store_narrowed(float* p, const DoubleBatch& a) noexcept {
  _mm_storel_epi64(reinterpret_cast<__m128i*>(p), _mm_castps_si128(_mm_cvtpd_ps(a)));
}
#else
inline DoubleBatch fused(const DoubleBatch& a, const DoubleBatch& b, const DoubleBatch& c) noexcept {
  return vfmaq_f64(c, a, b);
}
inline DoubleBatch widened(const float* p) noexcept { return vcvt_f64_f32(vld1_f32(p)); }
inline void store_narrowed(float* p, const DoubleBatch& a) noexcept { vst1_f32(p, vcvt_f32_f64(a)); }
#endif

struct F64 {
  static constexpr int lanes = static_cast<int>(DoubleBatch::size);

  F64() = default;
  F64(double x) noexcept : value(x) {}  // NOLINT(google-explicit-constructor)
  explicit F64(const DoubleBatch& b) noexcept : value(b) {}
  [[nodiscard]] static F64 load(const double* p) noexcept { return F64(DoubleBatch::load_unaligned(p)); }
  [[nodiscard]] static F64 load(const float* p) noexcept { return F64(widened(p)); }
  void store(double* p) const noexcept { value.store_unaligned(p); }
  void store(float* p) const noexcept { store_narrowed(p, value); }

  friend F64 operator+(F64 a, F64 b) noexcept { return F64(a.value + b.value); }
  friend F64 operator-(F64 a, F64 b) noexcept { return F64(a.value - b.value); }
  friend F64 operator*(F64 a, F64 b) noexcept { return F64(a.value * b.value); }
  [[nodiscard]] friend F64 fma(F64 a, F64 b, F64 c) noexcept { return F64(fused(a.value, b.value, c.value)); }

  DoubleBatch value;
};

static_assert(2 * F64::lanes == F32::lanes);

}  // namespace native
#endif

template <class F>
struct DoubleOf {
  using type = scalar::F64;
};
#if !defined(NPSIM_SIMD_SCALAR)
template <>
struct DoubleOf<native::F32> {
  using type = native::F64;
};
#endif

template <class F>
using Double = typename DoubleOf<F>::type;

}  // namespace simd
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SIMD_DOUBLE_HPP
