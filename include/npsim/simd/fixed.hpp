// SPDX-License-Identifier: Apache-2.0
// Batches besides the native ones of floats: of a fixed width, and of doubles.
#ifndef NPSIM_SIMD_FIXED_HPP
#define NPSIM_SIMD_FIXED_HPP

#include <cmath>
#include <cstdint>
#include <limits>

#include "npsim/core/config.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/detail/scalar.hpp"
#if !defined(NPSIM_SIMD_SCALAR)
#include "npsim/simd/detail/native.hpp"
#endif

namespace npsim {
inline namespace NPSIM_ABI {

// Fixed<N>: N floats side by side, the same N on every machine, for structures whose width is part of their layout.
//
// Where the instruction set has registers of N floats one register, else two halves, down to single floats. The rules
// of batch.hpp hold, so a program gives the same bits wherever fma() is fused. Comparisons return bits, lane i in bit
// i.
//   Fixed<N>(x) broadcast, load(p) and store(p), no alignment needed, lane(i); + - * / unary -, fma, min, max;
//   less(a, b), less_equal(a, b), equal(a, b) -> bits; store_truncated(p): towards 0, of what fits an int;
//   halves_swapped(a): the upper half first, N >= 2.

namespace simd {

// Starts reading the cache line of p.
NPSIM_ALWAYS_INLINE void prefetch(const void* p) noexcept {
#if defined(__GNUC__) || defined(__clang__)
  __builtin_prefetch(p);
#else
  static_cast<void>(p);
#endif
}

// clang-format off
template <unsigned N>
struct Fixed {
  static_assert(N >= 2 && (N & (N - 1)) == 0);
  using Half = Fixed<N / 2>;
  static constexpr int lanes = N;

  Fixed() = default;
  NPSIM_ALWAYS_INLINE explicit Fixed(float x) noexcept : low(x), high(x) {}
  NPSIM_ALWAYS_INLINE Fixed(const Half& l, const Half& h) noexcept : low(l), high(h) {}
  [[nodiscard]] NPSIM_ALWAYS_INLINE static Fixed load(const float* p) noexcept { return {Half::load(p), Half::load(p + N / 2)}; }
  NPSIM_ALWAYS_INLINE void store(float* p) const noexcept { low.store(p); high.store(p + N / 2); }
  NPSIM_ALWAYS_INLINE void store_truncated(std::int32_t* p) const noexcept { low.store_truncated(p); high.store_truncated(p + N / 2); }
  [[nodiscard]] float lane(int i) const noexcept { const int half = static_cast<int>(N / 2); return i < half ? low.lane(i) : high.lane(i - half); }

  friend NPSIM_ALWAYS_INLINE Fixed operator+(const Fixed& a, const Fixed& b) noexcept { return {a.low + b.low, a.high + b.high}; }
  friend NPSIM_ALWAYS_INLINE Fixed operator-(const Fixed& a, const Fixed& b) noexcept { return {a.low - b.low, a.high - b.high}; }
  friend NPSIM_ALWAYS_INLINE Fixed operator*(const Fixed& a, const Fixed& b) noexcept { return {a.low * b.low, a.high * b.high}; }
  friend NPSIM_ALWAYS_INLINE Fixed operator/(const Fixed& a, const Fixed& b) noexcept { return {a.low / b.low, a.high / b.high}; }
  friend NPSIM_ALWAYS_INLINE Fixed operator-(const Fixed& a) noexcept { return {-a.low, -a.high}; }
  friend NPSIM_ALWAYS_INLINE Fixed fma(const Fixed& a, const Fixed& b, const Fixed& c) noexcept { return {fma(a.low, b.low, c.low), fma(a.high, b.high, c.high)}; }
  friend NPSIM_ALWAYS_INLINE Fixed min(const Fixed& a, const Fixed& b) noexcept { return {min(a.low, b.low), min(a.high, b.high)}; }
  friend NPSIM_ALWAYS_INLINE Fixed max(const Fixed& a, const Fixed& b) noexcept { return {max(a.low, b.low), max(a.high, b.high)}; }
  friend NPSIM_ALWAYS_INLINE std::uint32_t less(const Fixed& a, const Fixed& b) noexcept { return less(a.low, b.low) | (less(a.high, b.high) << (N / 2)); }
  friend NPSIM_ALWAYS_INLINE std::uint32_t less_equal(const Fixed& a, const Fixed& b) noexcept { return less_equal(a.low, b.low) | (less_equal(a.high, b.high) << (N / 2)); }
  friend NPSIM_ALWAYS_INLINE std::uint32_t equal(const Fixed& a, const Fixed& b) noexcept { return equal(a.low, b.low) | (equal(a.high, b.high) << (N / 2)); }
  friend NPSIM_ALWAYS_INLINE Fixed halves_swapped(const Fixed& a) noexcept { return {a.high, a.low}; }

  Half low;
  Half high;
};

template <>
struct Fixed<1> {
  static constexpr int lanes = 1;

  Fixed() = default;
  NPSIM_ALWAYS_INLINE explicit Fixed(float x) noexcept : value(x) {}
  [[nodiscard]] NPSIM_ALWAYS_INLINE static Fixed load(const float* p) noexcept { return Fixed(*p); }
  NPSIM_ALWAYS_INLINE void store(float* p) const noexcept { *p = value; }
  NPSIM_ALWAYS_INLINE void store_truncated(std::int32_t* p) const noexcept { *p = static_cast<std::int32_t>(value); }
  [[nodiscard]] float lane(int /*i*/) const noexcept { return value; }

  friend NPSIM_ALWAYS_INLINE Fixed operator+(const Fixed& a, const Fixed& b) noexcept { return Fixed(a.value + b.value); }
  friend NPSIM_ALWAYS_INLINE Fixed operator-(const Fixed& a, const Fixed& b) noexcept { return Fixed(a.value - b.value); }
  friend NPSIM_ALWAYS_INLINE Fixed operator*(const Fixed& a, const Fixed& b) noexcept { return Fixed(a.value * b.value); }
  friend NPSIM_ALWAYS_INLINE Fixed operator/(const Fixed& a, const Fixed& b) noexcept { return Fixed(a.value / b.value); }
  friend NPSIM_ALWAYS_INLINE Fixed operator-(const Fixed& a) noexcept { return Fixed(-a.value); }
  friend NPSIM_ALWAYS_INLINE Fixed fma(const Fixed& a, const Fixed& b, const Fixed& c) noexcept { return Fixed(fma(scalar::F32(a.value), scalar::F32(b.value), scalar::F32(c.value)).value); }
  friend NPSIM_ALWAYS_INLINE Fixed min(const Fixed& a, const Fixed& b) noexcept { return Fixed(a.value < b.value ? a.value : b.value); }
  friend NPSIM_ALWAYS_INLINE Fixed max(const Fixed& a, const Fixed& b) noexcept { return Fixed(a.value > b.value ? a.value : b.value); }
  friend NPSIM_ALWAYS_INLINE std::uint32_t less(const Fixed& a, const Fixed& b) noexcept { return a.value < b.value ? 1U : 0U; }
  friend NPSIM_ALWAYS_INLINE std::uint32_t less_equal(const Fixed& a, const Fixed& b) noexcept { return a.value <= b.value ? 1U : 0U; }
  friend NPSIM_ALWAYS_INLINE std::uint32_t equal(const Fixed& a, const Fixed& b) noexcept { return a.value == b.value ? 1U : 0U; }

  float value;
};

#if !defined(NPSIM_SIMD_SCALAR)
#if defined(NPSIM_SIMD_NEON64)

template <>
struct Fixed<4> {
  static constexpr int lanes = 4;

  Fixed() = default;
  NPSIM_ALWAYS_INLINE explicit Fixed(float x) noexcept : value(vdupq_n_f32(x)) {}
  NPSIM_ALWAYS_INLINE explicit Fixed(float32x4_t v) noexcept : value(v) {}
  [[nodiscard]] NPSIM_ALWAYS_INLINE static Fixed load(const float* p) noexcept { return Fixed(vld1q_f32(p)); }
  NPSIM_ALWAYS_INLINE void store(float* p) const noexcept { vst1q_f32(p, value); }
  NPSIM_ALWAYS_INLINE void store_truncated(std::int32_t* p) const noexcept { vst1q_s32(p, vcvtq_s32_f32(value)); }
  [[nodiscard]] float lane(int i) const noexcept { float all[4]; store(all); return all[i]; }

  friend NPSIM_ALWAYS_INLINE Fixed operator+(const Fixed& a, const Fixed& b) noexcept { return Fixed(vaddq_f32(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed operator-(const Fixed& a, const Fixed& b) noexcept { return Fixed(vsubq_f32(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed operator*(const Fixed& a, const Fixed& b) noexcept { return Fixed(vmulq_f32(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed operator/(const Fixed& a, const Fixed& b) noexcept { return Fixed(vdivq_f32(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed operator-(const Fixed& a) noexcept { return Fixed(vnegq_f32(a.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed fma(const Fixed& a, const Fixed& b, const Fixed& c) noexcept { return Fixed(vfmaq_f32(c.value, a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed min(const Fixed& a, const Fixed& b) noexcept { return Fixed(vbslq_f32(vcltq_f32(a.value, b.value), a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed max(const Fixed& a, const Fixed& b) noexcept { return Fixed(vbslq_f32(vcgtq_f32(a.value, b.value), a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE std::uint32_t less(const Fixed& a, const Fixed& b) noexcept { return mask_bits(vcltq_f32(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE std::uint32_t less_equal(const Fixed& a, const Fixed& b) noexcept { return mask_bits(vcleq_f32(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE std::uint32_t equal(const Fixed& a, const Fixed& b) noexcept { return mask_bits(vceqq_f32(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed halves_swapped(const Fixed& a) noexcept { return Fixed(vextq_f32(a.value, a.value, 2)); }

  float32x4_t value;

 private:
  NPSIM_ALWAYS_INLINE static std::uint32_t mask_bits(uint32x4_t m) noexcept {
    const uint32x4_t weight = {1U, 2U, 4U, 8U};
    return vaddvq_u32(vandq_u32(m, weight));
  }
};

#else

template <>
struct Fixed<4> {
  static constexpr int lanes = 4;

  Fixed() = default;
  NPSIM_ALWAYS_INLINE explicit Fixed(float x) noexcept : value(_mm_set1_ps(x)) {}
  NPSIM_ALWAYS_INLINE explicit Fixed(__m128 v) noexcept : value(v) {}
  [[nodiscard]] NPSIM_ALWAYS_INLINE static Fixed load(const float* p) noexcept { return Fixed(_mm_loadu_ps(p)); }
  NPSIM_ALWAYS_INLINE void store(float* p) const noexcept { _mm_storeu_ps(p, value); }
  NPSIM_ALWAYS_INLINE void store_truncated(std::int32_t* p) const noexcept { _mm_storeu_si128(reinterpret_cast<__m128i*>(p), _mm_cvttps_epi32(value)); }
  [[nodiscard]] float lane(int i) const noexcept { float all[4]; store(all); return all[i]; }

  friend NPSIM_ALWAYS_INLINE Fixed operator+(const Fixed& a, const Fixed& b) noexcept { return Fixed(_mm_add_ps(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed operator-(const Fixed& a, const Fixed& b) noexcept { return Fixed(_mm_sub_ps(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed operator*(const Fixed& a, const Fixed& b) noexcept { return Fixed(_mm_mul_ps(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed operator/(const Fixed& a, const Fixed& b) noexcept { return Fixed(_mm_div_ps(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed operator-(const Fixed& a) noexcept { return Fixed(_mm_xor_ps(a.value, _mm_set1_ps(-0.0F))); }
  friend NPSIM_ALWAYS_INLINE Fixed fma(const Fixed& a, const Fixed& b, const Fixed& c) noexcept {
#if defined(NPSIM_SIMD_AVX512) || defined(NPSIM_SIMD_AVX2)
    return Fixed(_mm_fmadd_ps(a.value, b.value, c.value));
#else
    return a * b + c;
#endif
  }
  friend NPSIM_ALWAYS_INLINE Fixed min(const Fixed& a, const Fixed& b) noexcept { return Fixed(_mm_min_ps(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed max(const Fixed& a, const Fixed& b) noexcept { return Fixed(_mm_max_ps(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE std::uint32_t less(const Fixed& a, const Fixed& b) noexcept { return static_cast<std::uint32_t>(_mm_movemask_ps(_mm_cmplt_ps(a.value, b.value))); }
  friend NPSIM_ALWAYS_INLINE std::uint32_t less_equal(const Fixed& a, const Fixed& b) noexcept { return static_cast<std::uint32_t>(_mm_movemask_ps(_mm_cmple_ps(a.value, b.value))); }
  friend NPSIM_ALWAYS_INLINE std::uint32_t equal(const Fixed& a, const Fixed& b) noexcept { return static_cast<std::uint32_t>(_mm_movemask_ps(_mm_cmpeq_ps(a.value, b.value))); }
  friend NPSIM_ALWAYS_INLINE Fixed halves_swapped(const Fixed& a) noexcept { return Fixed(_mm_shuffle_ps(a.value, a.value, 0x4E)); }

  __m128 value;
};

#if defined(NPSIM_SIMD_AVX512) || defined(NPSIM_SIMD_AVX2)

template <>
struct Fixed<8> {
  using Half = Fixed<4>;
  static constexpr int lanes = 8;

  Fixed() = default;
  NPSIM_ALWAYS_INLINE explicit Fixed(float x) noexcept : value(_mm256_set1_ps(x)) {}
  NPSIM_ALWAYS_INLINE explicit Fixed(__m256 v) noexcept : value(v) {}
  NPSIM_ALWAYS_INLINE Fixed(const Half& l, const Half& h) noexcept : value(_mm256_insertf128_ps(_mm256_castps128_ps256(l.value), h.value, 1)) {}
  [[nodiscard]] NPSIM_ALWAYS_INLINE static Fixed load(const float* p) noexcept { return Fixed(_mm256_loadu_ps(p)); }
  NPSIM_ALWAYS_INLINE void store(float* p) const noexcept { _mm256_storeu_ps(p, value); }
  NPSIM_ALWAYS_INLINE void store_truncated(std::int32_t* p) const noexcept { _mm256_storeu_si256(reinterpret_cast<__m256i*>(p), _mm256_cvttps_epi32(value)); }
  [[nodiscard]] float lane(int i) const noexcept { float all[8]; store(all); return all[i]; }

  friend NPSIM_ALWAYS_INLINE Fixed operator+(const Fixed& a, const Fixed& b) noexcept { return Fixed(_mm256_add_ps(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed operator-(const Fixed& a, const Fixed& b) noexcept { return Fixed(_mm256_sub_ps(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed operator*(const Fixed& a, const Fixed& b) noexcept { return Fixed(_mm256_mul_ps(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed operator/(const Fixed& a, const Fixed& b) noexcept { return Fixed(_mm256_div_ps(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed operator-(const Fixed& a) noexcept { return Fixed(_mm256_xor_ps(a.value, _mm256_set1_ps(-0.0F))); }
  friend NPSIM_ALWAYS_INLINE Fixed fma(const Fixed& a, const Fixed& b, const Fixed& c) noexcept { return Fixed(_mm256_fmadd_ps(a.value, b.value, c.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed min(const Fixed& a, const Fixed& b) noexcept { return Fixed(_mm256_min_ps(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed max(const Fixed& a, const Fixed& b) noexcept { return Fixed(_mm256_max_ps(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE std::uint32_t less(const Fixed& a, const Fixed& b) noexcept { return static_cast<std::uint32_t>(_mm256_movemask_ps(_mm256_cmp_ps(a.value, b.value, _CMP_LT_OQ))); }
  friend NPSIM_ALWAYS_INLINE std::uint32_t less_equal(const Fixed& a, const Fixed& b) noexcept { return static_cast<std::uint32_t>(_mm256_movemask_ps(_mm256_cmp_ps(a.value, b.value, _CMP_LE_OQ))); }
  friend NPSIM_ALWAYS_INLINE std::uint32_t equal(const Fixed& a, const Fixed& b) noexcept { return static_cast<std::uint32_t>(_mm256_movemask_ps(_mm256_cmp_ps(a.value, b.value, _CMP_EQ_OQ))); }
  friend NPSIM_ALWAYS_INLINE Fixed halves_swapped(const Fixed& a) noexcept { return Fixed(_mm256_permute2f128_ps(a.value, a.value, 0x01)); }

  __m256 value;
};

#if defined(NPSIM_SIMD_AVX512)

// The masked forms for the reason in detail/native.hpp.
template <>
struct Fixed<16> {
  using Half = Fixed<8>;
  static constexpr int lanes = 16;

  Fixed() = default;
  NPSIM_ALWAYS_INLINE explicit Fixed(float x) noexcept : value(_mm512_set1_ps(x)) {}
  NPSIM_ALWAYS_INLINE explicit Fixed(__m512 v) noexcept : value(v) {}
  [[nodiscard]] NPSIM_ALWAYS_INLINE static Fixed load(const float* p) noexcept { return Fixed(_mm512_loadu_ps(p)); }
  NPSIM_ALWAYS_INLINE void store(float* p) const noexcept { _mm512_storeu_ps(p, value); }
  NPSIM_ALWAYS_INLINE void store_truncated(std::int32_t* p) const noexcept { _mm512_storeu_si512(p, _mm512_maskz_cvttps_epi32(native::kAllLanes, value)); }
  [[nodiscard]] float lane(int i) const noexcept { float all[16]; store(all); return all[i]; }

  friend NPSIM_ALWAYS_INLINE Fixed operator+(const Fixed& a, const Fixed& b) noexcept { return Fixed(_mm512_add_ps(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed operator-(const Fixed& a, const Fixed& b) noexcept { return Fixed(_mm512_sub_ps(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed operator*(const Fixed& a, const Fixed& b) noexcept { return Fixed(_mm512_mul_ps(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed operator/(const Fixed& a, const Fixed& b) noexcept { return Fixed(_mm512_div_ps(a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed operator-(const Fixed& a) noexcept { return Fixed(_mm512_castsi512_ps(_mm512_xor_si512(_mm512_castps_si512(a.value), _mm512_set1_epi32(std::numeric_limits<std::int32_t>::min())))); }
  friend NPSIM_ALWAYS_INLINE Fixed fma(const Fixed& a, const Fixed& b, const Fixed& c) noexcept { return Fixed(_mm512_fmadd_ps(a.value, b.value, c.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed min(const Fixed& a, const Fixed& b) noexcept { return Fixed(_mm512_maskz_min_ps(native::kAllLanes, a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE Fixed max(const Fixed& a, const Fixed& b) noexcept { return Fixed(_mm512_maskz_max_ps(native::kAllLanes, a.value, b.value)); }
  friend NPSIM_ALWAYS_INLINE std::uint32_t less(const Fixed& a, const Fixed& b) noexcept { return _mm512_cmp_ps_mask(a.value, b.value, _CMP_LT_OQ); }
  friend NPSIM_ALWAYS_INLINE std::uint32_t less_equal(const Fixed& a, const Fixed& b) noexcept { return _mm512_cmp_ps_mask(a.value, b.value, _CMP_LE_OQ); }
  friend NPSIM_ALWAYS_INLINE std::uint32_t equal(const Fixed& a, const Fixed& b) noexcept { return _mm512_cmp_ps_mask(a.value, b.value, _CMP_EQ_OQ); }
  friend NPSIM_ALWAYS_INLINE Fixed halves_swapped(const Fixed& a) noexcept { return Fixed(_mm512_maskz_shuffle_f32x4(native::kAllLanes, a.value, a.value, 0x4E)); }

  __m512 value;
};

#endif

#endif
#endif
#endif
// clang-format on

}  // namespace simd

// Batches of doubles, for sums that single precision would spoil. simd::Double<F> belongs to the float batch F: one
// register, so half the lanes of the native one; one double beside scalar::F32.
//
//   D(x) broadcast, D::load(p), d.store(p) of doubles, or of floats: loading those is exact, storing rounds to nearest
//   even; no alignment needed. + - *, fma(a, b, c).
// Rules as in batch.hpp: correctly rounded, fma rounds once except with plain SSE2.

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

#endif  // NPSIM_SIMD_FIXED_HPP
