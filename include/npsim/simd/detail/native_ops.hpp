// SPDX-License-Identifier: Apache-2.0
// Operations of the native batch that each instruction set does in its own way. Part of native.hpp, which says why.
#ifndef NPSIM_SIMD_DETAIL_NATIVE_OPS_HPP
#define NPSIM_SIMD_DETAIL_NATIVE_OPS_HPP

#include "npsim/simd/detail/native.hpp"

#if !defined(NPSIM_SIMD_SCALAR)

namespace npsim {
inline namespace NPSIM_ABI {
namespace simd {
namespace native {

#if defined(NPSIM_SIMD_AVX512)

// The masked forms with all lanes set are the plain instructions. They are here because the plain forms of g++ 12 start
// from a register that it then calls uninitialised (-Wmaybe-uninitialized).
inline constexpr __mmask16 kAllLanes = 0xFFFF;
inline __mmask16 first_lanes(int n) noexcept { return static_cast<__mmask16>((1U << static_cast<unsigned>(n)) - 1U); }
inline F32 F32::load(const float* p, int n) noexcept {
  return F32(FloatBatch(_mm512_maskz_loadu_ps(first_lanes(n), p)));
}
inline void F32::store(float* p, int n) const noexcept { _mm512_mask_storeu_ps(p, first_lanes(n), value); }
inline I32 I32::load_u8(const std::uint8_t* p) noexcept {
  return I32(IntBatch(_mm512_maskz_cvtepu8_epi32(kAllLanes, _mm_loadu_si128(reinterpret_cast<const __m128i*>(p)))));
}
inline I32 I32::load_u16(const std::uint16_t* p) noexcept {
  return I32(IntBatch(_mm512_maskz_cvtepu16_epi32(kAllLanes, _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p)))));
}
inline I32 operator*(I32 a, I32 b) noexcept { return I32(IntBatch(_mm512_mullo_epi32(a.value, b.value))); }
inline I32 operator<<(I32 a, int n) noexcept {
  return I32(IntBatch(_mm512_maskz_sll_epi32(kAllLanes, a.value, _mm_cvtsi32_si128(n))));
}
inline I32 operator>>(I32 a, int n) noexcept {
  return I32(IntBatch(_mm512_maskz_sra_epi32(kAllLanes, a.value, _mm_cvtsi32_si128(n))));
}
inline F32 operator/(F32 a, F32 b) noexcept { return F32(FloatBatch(_mm512_div_ps(a.value, b.value))); }
inline F32 fma(F32 a, F32 b, F32 c) noexcept { return F32(FloatBatch(_mm512_fmadd_ps(a.value, b.value, c.value))); }
inline F32 fnma(F32 a, F32 b, F32 c) noexcept { return F32(FloatBatch(_mm512_fnmadd_ps(a.value, b.value, c.value))); }
inline F32 min(F32 a, F32 b) noexcept { return F32(FloatBatch(_mm512_maskz_min_ps(kAllLanes, a.value, b.value))); }
inline F32 max(F32 a, F32 b) noexcept { return F32(FloatBatch(_mm512_maskz_max_ps(kAllLanes, a.value, b.value))); }
inline F32 sqrt(F32 a) noexcept { return F32(FloatBatch(_mm512_maskz_sqrt_ps(kAllLanes, a.value))); }
#if defined(__GNUC__)
// Without optimisation these two are macros in g++, which convert the mask to a signed short on the way.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wsign-conversion"
#endif
inline F32 floor(F32 a) noexcept { return F32(FloatBatch(_mm512_maskz_roundscale_ps(kAllLanes, a.value, 0x09))); }
inline F32 round_even(F32 a) noexcept { return F32(FloatBatch(_mm512_maskz_roundscale_ps(kAllLanes, a.value, 0x08))); }
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif
inline F32 scale_by_floor(F32 y, F32 x) noexcept {
  return F32(FloatBatch(_mm512_maskz_scalef_ps(kAllLanes, y.value, x.value)));
}
inline F32 to_float(I32 a) noexcept { return F32(FloatBatch(_mm512_maskz_cvtepi32_ps(kAllLanes, a.value))); }
inline IntBatch truncate(const FloatBatch& a) noexcept { return _mm512_maskz_cvttps_epi32(kAllLanes, a); }
inline F32 slide_up(F32 previous, F32 current) noexcept {
  return F32(as_float(_mm512_maskz_alignr_epi32(kAllLanes, as_int(current.value), as_int(previous.value), 15)));
}
inline F32 pick_lanes(F32 a, F32 b, __m512i index) noexcept {
  return F32(FloatBatch(_mm512_maskz_permutex2var_ps(kAllLanes, a.value, index, b.value)));
}
inline F32 even_lanes(F32 a, F32 b) noexcept {
  return pick_lanes(a, b, _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30));
}
inline F32 odd_lanes(F32 a, F32 b) noexcept {
  return pick_lanes(a, b, _mm512_setr_epi32(1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31));
}
inline F32 interleave_low(F32 a, F32 b) noexcept {
  return pick_lanes(a, b, _mm512_setr_epi32(0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23));
}
inline F32 interleave_high(F32 a, F32 b) noexcept {
  return pick_lanes(a, b, _mm512_setr_epi32(8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31));
}

#elif defined(NPSIM_SIMD_AVX2)

inline F32 F32::load(const float* p, int n) noexcept {
  return F32(FloatBatch(_mm256_maskload_ps(p, as_int(Mask::first(n).value.data))));
}
inline void F32::store(float* p, int n) const noexcept {
  _mm256_maskstore_ps(p, as_int(Mask::first(n).value.data), value);
}
inline I32 I32::load_u8(const std::uint8_t* p) noexcept {
  return I32(IntBatch(_mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(p)))));
}
inline I32 I32::load_u16(const std::uint16_t* p) noexcept {
  return I32(IntBatch(_mm256_cvtepu16_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i*>(p)))));
}
inline I32 operator*(I32 a, I32 b) noexcept { return I32(IntBatch(_mm256_mullo_epi32(a.value, b.value))); }
inline F32 operator/(F32 a, F32 b) noexcept { return F32(FloatBatch(_mm256_div_ps(a.value, b.value))); }
inline F32 fma(F32 a, F32 b, F32 c) noexcept { return F32(FloatBatch(_mm256_fmadd_ps(a.value, b.value, c.value))); }
inline F32 fnma(F32 a, F32 b, F32 c) noexcept { return F32(FloatBatch(_mm256_fnmadd_ps(a.value, b.value, c.value))); }
inline F32 min(F32 a, F32 b) noexcept { return F32(FloatBatch(_mm256_min_ps(a.value, b.value))); }
inline F32 max(F32 a, F32 b) noexcept { return F32(FloatBatch(_mm256_max_ps(a.value, b.value))); }
inline F32 sqrt(F32 a) noexcept { return F32(FloatBatch(_mm256_sqrt_ps(a.value))); }
inline F32 floor(F32 a) noexcept { return F32(FloatBatch(_mm256_round_ps(a.value, 0x09))); }
inline F32 round_even(F32 a) noexcept { return F32(FloatBatch(_mm256_round_ps(a.value, 0x08))); }
inline IntBatch truncate(const FloatBatch& a) noexcept { return _mm256_cvttps_epi32(a); }
inline I32 operator<<(I32 a, int n) noexcept { return I32(IntBatch(_mm256_sll_epi32(a.value, _mm_cvtsi32_si128(n)))); }
inline I32 operator>>(I32 a, int n) noexcept { return I32(IntBatch(_mm256_sra_epi32(a.value, _mm_cvtsi32_si128(n)))); }
inline F32 to_float(I32 a) noexcept { return F32(FloatBatch(_mm256_cvtepi32_ps(a.value))); }
inline F32 slide_up(F32 previous, F32 current) noexcept {
  const __m256i low = as_int(current.value);
  const __m256i seam = _mm256_permute2x128_si256(as_int(previous.value), low, 0x21);
  return F32(as_float(_mm256_alignr_epi8(low, seam, 12)));
}
inline F32 join_halves(const FloatBatch& mixed) noexcept {  // 0 2 1 3 in pairs of lanes
  return F32(FloatBatch(_mm256_castpd_ps(_mm256_permute4x64_pd(_mm256_castps_pd(mixed), 0xD8))));
}
inline F32 even_lanes(F32 a, F32 b) noexcept {
  return join_halves(FloatBatch(_mm256_shuffle_ps(a.value, b.value, 0x88)));
}
inline F32 odd_lanes(F32 a, F32 b) noexcept {
  return join_halves(FloatBatch(_mm256_shuffle_ps(a.value, b.value, 0xDD)));
}
inline F32 interleave_low(F32 a, F32 b) noexcept {
  return F32(FloatBatch(_mm256_permute2f128_ps(_mm256_unpacklo_ps(a.value, b.value),
                                               _mm256_unpackhi_ps(a.value, b.value), 0x20)));
}
inline F32 interleave_high(F32 a, F32 b) noexcept {
  return F32(FloatBatch(_mm256_permute2f128_ps(_mm256_unpacklo_ps(a.value, b.value),
                                               _mm256_unpackhi_ps(a.value, b.value), 0x31)));
}

#else  // four lanes: SSE2 and NEON64

inline F32 F32::load(const float* p, int n) noexcept {
  alignas(16) float all[kLanes] = {};
  for (int i = 0; i < kLanes; ++i) {
    if (i < n) all[i] = p[i];
  }
  return F32(FloatBatch::load_aligned(all));
}
inline void F32::store(float* p, int n) const noexcept {
  alignas(16) float all[kLanes];
  value.store_aligned(all);
  for (int i = 0; i < kLanes; ++i) {
    if (i < n) p[i] = all[i];
  }
}

#if defined(NPSIM_SIMD_SSE2)

inline I32 I32::load_u8(const std::uint8_t* p) noexcept {
  std::int32_t four = 0;
  std::memcpy(&four, p, sizeof(four));
  const __m128i zero = _mm_setzero_si128();
  return I32(IntBatch(_mm_unpacklo_epi16(_mm_unpacklo_epi8(_mm_cvtsi32_si128(four), zero), zero)));
}
inline I32 I32::load_u16(const std::uint16_t* p) noexcept {
  const __m128i four = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(p));
  return I32(IntBatch(_mm_unpacklo_epi16(four, _mm_setzero_si128())));
}
// The low halves of the products of the even and of the odd lanes: there is no 32-bit multiply before SSE4.1.
inline I32 operator*(I32 a, I32 b) noexcept {
  const __m128i even = _mm_mul_epu32(a.value, b.value);
  const __m128i odd = _mm_mul_epu32(_mm_srli_epi64(a.value, 32), _mm_srli_epi64(b.value, 32));
  return I32(IntBatch(_mm_unpacklo_epi32(_mm_shuffle_epi32(even, 0x08), _mm_shuffle_epi32(odd, 0x08))));
}
inline F32 operator/(F32 a, F32 b) noexcept { return F32(FloatBatch(_mm_div_ps(a.value, b.value))); }
inline F32 fma(F32 a, F32 b, F32 c) noexcept { return a * b + c; }
inline F32 fnma(F32 a, F32 b, F32 c) noexcept { return c - a * b; }
inline F32 min(F32 a, F32 b) noexcept { return F32(FloatBatch(_mm_min_ps(a.value, b.value))); }
inline F32 max(F32 a, F32 b) noexcept { return F32(FloatBatch(_mm_max_ps(a.value, b.value))); }
inline F32 sqrt(F32 a) noexcept { return F32(FloatBatch(_mm_sqrt_ps(a.value))); }
// Adding 2^23 leaves no fraction bits; what is larger, or not a number, has none to lose.
inline F32 round_even(F32 a) noexcept {
  const F32 size = abs(a);
  const F32 rounded = (size + F32(0x1p23F)) - F32(0x1p23F);
  const IntBatch sign = as_int(a.value) & IntBatch(std::numeric_limits<std::int32_t>::min());
  return select(size < F32(0x1p23F), F32(as_float(as_int(rounded.value) | sign)), a);
}
inline F32 floor(F32 a) noexcept {
  const F32 nearest = round_even(a);
  return select(nearest > a, nearest - F32(1.0F), nearest);
}
inline IntBatch truncate(const FloatBatch& a) noexcept { return _mm_cvttps_epi32(a); }
inline I32 operator<<(I32 a, int n) noexcept { return I32(IntBatch(_mm_sll_epi32(a.value, _mm_cvtsi32_si128(n)))); }
inline I32 operator>>(I32 a, int n) noexcept { return I32(IntBatch(_mm_sra_epi32(a.value, _mm_cvtsi32_si128(n)))); }
inline F32 to_float(I32 a) noexcept { return F32(FloatBatch(_mm_cvtepi32_ps(a.value))); }
inline F32 slide_up(F32 previous, F32 current) noexcept {
  const __m128i rest = _mm_slli_si128(as_int(current.value), 4);
  return F32(as_float(_mm_or_si128(rest, _mm_srli_si128(as_int(previous.value), 12))));
}
inline F32 even_lanes(F32 a, F32 b) noexcept { return F32(FloatBatch(_mm_shuffle_ps(a.value, b.value, 0x88))); }
inline F32 odd_lanes(F32 a, F32 b) noexcept { return F32(FloatBatch(_mm_shuffle_ps(a.value, b.value, 0xDD))); }
inline F32 interleave_low(F32 a, F32 b) noexcept { return F32(FloatBatch(_mm_unpacklo_ps(a.value, b.value))); }
inline F32 interleave_high(F32 a, F32 b) noexcept { return F32(FloatBatch(_mm_unpackhi_ps(a.value, b.value))); }

#else  // NEON64

inline I32 I32::load_u8(const std::uint8_t* p) noexcept {
  std::uint32_t four = 0;
  std::memcpy(&four, p, sizeof(four));
  const uint16x8_t wide = vmovl_u8(vreinterpret_u8_u32(vdup_n_u32(four)));
  return I32(IntBatch(vreinterpretq_s32_u32(vmovl_u16(vget_low_u16(wide)))));
}
inline I32 I32::load_u16(const std::uint16_t* p) noexcept {
  return I32(IntBatch(vreinterpretq_s32_u32(vmovl_u16(vld1_u16(p)))));
}
inline I32 operator*(I32 a, I32 b) noexcept { return I32(IntBatch(vmulq_s32(a.value, b.value))); }
inline F32 operator/(F32 a, F32 b) noexcept { return F32(FloatBatch(vdivq_f32(a.value, b.value))); }
inline F32 fma(F32 a, F32 b, F32 c) noexcept { return F32(FloatBatch(vfmaq_f32(c.value, a.value, b.value))); }
inline F32 fnma(F32 a, F32 b, F32 c) noexcept { return F32(FloatBatch(vfmsq_f32(c.value, a.value, b.value))); }
inline F32 min(F32 a, F32 b) noexcept { return select(a < b, a, b); }
inline F32 max(F32 a, F32 b) noexcept { return select(b < a, a, b); }
inline F32 sqrt(F32 a) noexcept { return F32(FloatBatch(vsqrtq_f32(a.value))); }
inline F32 floor(F32 a) noexcept { return F32(FloatBatch(vrndmq_f32(a.value))); }
inline F32 round_even(F32 a) noexcept { return F32(FloatBatch(vrndnq_f32(a.value))); }
inline F32 to_float(I32 a) noexcept { return F32(FloatBatch(vcvtq_f32_s32(a.value))); }
inline I32 operator<<(I32 a, int n) noexcept { return I32(IntBatch(vshlq_s32(a.value, vdupq_n_s32(n)))); }
inline I32 operator>>(I32 a, int n) noexcept { return I32(IntBatch(vshlq_s32(a.value, vdupq_n_s32(-n)))); }
inline F32 slide_up(F32 previous, F32 current) noexcept {
  return F32(FloatBatch(vextq_f32(previous.value, current.value, 3)));
}
inline F32 even_lanes(F32 a, F32 b) noexcept { return F32(FloatBatch(vuzp1q_f32(a.value, b.value))); }
inline F32 odd_lanes(F32 a, F32 b) noexcept { return F32(FloatBatch(vuzp2q_f32(a.value, b.value))); }
inline F32 interleave_low(F32 a, F32 b) noexcept { return F32(FloatBatch(vzip1q_f32(a.value, b.value))); }
inline F32 interleave_high(F32 a, F32 b) noexcept { return F32(FloatBatch(vzip2q_f32(a.value, b.value))); }

#endif
#endif

#if defined(NPSIM_SIMD_NEON64)
inline I32 trunc_to_int(F32 a) noexcept { return I32(IntBatch(vcvtq_s32_f32(a.value))); }
#else
// The instruction returns the smallest int for everything that does not fit, but g++ 12 folds a constant that is too
// large to the largest int and then mixes the two: only what fits, or is too small, reaches it.
inline I32 trunc_to_int(F32 a) noexcept {
  const I32 fits(truncate(min(a, F32(0x1.FFFFFEp30F)).value));
  const I32 saturated = select(a >= F32(0x1p31F), I32(std::numeric_limits<std::int32_t>::max()), fits);
  return select(a == a, saturated, I32(0));
}
#endif

#if !defined(NPSIM_SIMD_AVX512)
// In two steps, so that only the last multiplication rounds when the result is denormal.
inline F32 scale_by_floor(F32 y, F32 x) noexcept {
  const I32 n = trunc_to_int(max(min(floor(x), F32(130.0F)), F32(-152.0F)));
  const I32 half = n >> 1;
  return y * bitcast_float((half + I32(127)) << 23) * bitcast_float((n - half + I32(127)) << 23);
}
#endif

}  // namespace native
}  // namespace simd
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SIMD_SCALAR

#endif  // NPSIM_SIMD_DETAIL_NATIVE_OPS_HPP
