// SPDX-License-Identifier: Apache-2.0
// The native batch: F32, I32 and Mask of the register width of the translation unit. The only user of xsimd.
//
// xsimd gives registers, arithmetic, comparisons and selection. What it leaves open between instruction sets or
// versions is settled here with intrinsics, so that every lane returns the bits of scalar.hpp:
// - NEON64 '/' and sqrt are refined estimates in xsimd: the divide and square root instructions are used instead;
// - min and max of a NaN differ between x86 and NEON: both are "a < b ? a : b" here;
// - x != x is false for a NaN with AVX and AVX-512, and -x is 0 - x: built from == and from the sign bit;
// - conversion of what does not fit an int differs: it saturates here;
// - masked loads and the bits of a mask are missing.
// The architecture is chosen here and not by xsimd's default, which depends on more flags.
#ifndef NPSIM_SIMD_DETAIL_NATIVE_HPP
#define NPSIM_SIMD_DETAIL_NATIVE_HPP

#include "npsim/core/config.hpp"

// Nothing where there is no instruction set; batch.hpp then takes the one-lane types.
#if !defined(NPSIM_SIMD_SCALAR)

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <xsimd/xsimd.hpp>

#include "npsim/simd/detail/scalar.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace simd {
namespace native {

#if defined(__AVX512F__) && defined(__AVX512BW__) && defined(__AVX512DQ__) && defined(__FMA__)
#define NPSIM_SIMD_AVX512 1
using Arch = xsimd::avx512bw;
#elif defined(__AVX2__) && defined(__FMA__)
#define NPSIM_SIMD_AVX2 1
using Arch = xsimd::avx2;
#elif defined(__SSE2__)
#define NPSIM_SIMD_SSE2 1
using Arch = xsimd::sse2;
#else
#define NPSIM_SIMD_NEON64 1
using Arch = xsimd::neon64;
#endif

using FloatBatch = xsimd::batch<float, Arch>;
using IntBatch = xsimd::batch<std::int32_t, Arch>;
using FloatBool = xsimd::batch_bool<float, Arch>;
using IntBool = xsimd::batch_bool<std::int32_t, Arch>;
inline constexpr int kLanes = static_cast<int>(FloatBatch::size);

// Reinterpretation of registers.
#if defined(NPSIM_SIMD_AVX512)
inline FloatBatch as_float(const IntBatch& a) noexcept { return _mm512_castsi512_ps(a); }
inline IntBatch as_int(const FloatBatch& a) noexcept { return _mm512_castps_si512(a); }
inline FloatBool as_float_bool(const IntBool& m) noexcept { return FloatBool(static_cast<__mmask16>(m.data)); }
inline std::uint32_t bool_bits(const FloatBool& m) noexcept { return static_cast<std::uint32_t>(m.data); }
#elif defined(NPSIM_SIMD_AVX2)
inline FloatBatch as_float(const IntBatch& a) noexcept { return _mm256_castsi256_ps(a); }
inline IntBatch as_int(const FloatBatch& a) noexcept { return _mm256_castps_si256(a); }
inline FloatBool as_float_bool(const IntBool& m) noexcept { return FloatBool(_mm256_castsi256_ps(m.data)); }
inline std::uint32_t bool_bits(const FloatBool& m) noexcept {
  return static_cast<std::uint32_t>(_mm256_movemask_ps(m.data));
}
#elif defined(NPSIM_SIMD_SSE2)
inline FloatBatch as_float(const IntBatch& a) noexcept { return _mm_castsi128_ps(a); }
inline IntBatch as_int(const FloatBatch& a) noexcept { return _mm_castps_si128(a); }
inline FloatBool as_float_bool(const IntBool& m) noexcept { return FloatBool(_mm_castsi128_ps(m.data)); }
inline std::uint32_t bool_bits(const FloatBool& m) noexcept {
  return static_cast<std::uint32_t>(_mm_movemask_ps(m.data));
}
#else
inline FloatBatch as_float(const IntBatch& a) noexcept { return vreinterpretq_f32_s32(a); }
inline IntBatch as_int(const FloatBatch& a) noexcept { return vreinterpretq_s32_f32(a); }
inline FloatBool as_float_bool(const IntBool& m) noexcept { return FloatBool(uint32x4_t(m.data)); }
inline std::uint32_t bool_bits(const FloatBool& m) noexcept {
  const uint32x4_t weight = {1U, 2U, 4U, 8U};
  return vaddvq_u32(vandq_u32(uint32x4_t(m.data), weight));
}
#endif

struct F32;

// clang-format off
struct Mask {
  static constexpr int lanes = kLanes;

  Mask() = default;
  Mask(bool all) noexcept : value(all) {}  // NOLINT(google-explicit-constructor)
  explicit Mask(const FloatBool& m) noexcept : value(m) {}
  // The first n lanes.
  [[nodiscard]] static Mask first(int n) noexcept;
  [[nodiscard]] static Mask from_bits(std::uint32_t bits) noexcept;
  [[nodiscard]] bool lane(int i) const noexcept { return ((bool_bits(value) >> static_cast<unsigned>(i)) & 1U) != 0; }

  friend Mask operator&(Mask a, Mask b) noexcept { return Mask(a.value & b.value); }
  friend Mask operator|(Mask a, Mask b) noexcept { return Mask(a.value | b.value); }
  friend Mask operator^(Mask a, Mask b) noexcept { return (a & ~b) | (~a & b); }
  friend Mask operator~(Mask a) noexcept { return Mask(~a.value); }
  [[nodiscard]] friend bool any(Mask a) noexcept { return bool_bits(a.value) != 0; }
  [[nodiscard]] friend bool all(Mask a) noexcept { return bool_bits(a.value) == (1U << static_cast<unsigned>(kLanes)) - 1U; }
  [[nodiscard]] friend bool none(Mask a) noexcept { return bool_bits(a.value) == 0; }
  [[nodiscard]] friend std::uint32_t bits(Mask a) noexcept { return bool_bits(a.value); }

  FloatBool value;
};

struct I32 {
  static constexpr int lanes = kLanes;
  using Float = F32;
  using MaskType = Mask;

  I32() = default;
  I32(std::int32_t x) noexcept : value(x) {}  // NOLINT(google-explicit-constructor)
  explicit I32(const IntBatch& b) noexcept : value(b) {}
  [[nodiscard]] static I32 load(const std::int32_t* p) noexcept { return I32(IntBatch::load_unaligned(p)); }
  [[nodiscard]] static I32 load(const std::int32_t* p, int n) noexcept { return widen(p, n); }
  [[nodiscard]] static I32 load_u8(const std::uint8_t* p) noexcept;
  [[nodiscard]] static I32 load_u8(const std::uint8_t* p, int n) noexcept { return widen(p, n); }
  [[nodiscard]] static I32 load_u16(const std::uint16_t* p) noexcept;
  [[nodiscard]] static I32 load_u16(const std::uint16_t* p, int n) noexcept { return widen(p, n); }
  [[nodiscard]] static I32 gather(const std::int32_t* base, I32 index) noexcept {
    alignas(64) std::int32_t at[kLanes];
    index.value.store_aligned(at);
    for (int i = 0; i < kLanes; ++i) at[i] = base[at[i]];
    return I32(IntBatch::load_aligned(at));
  }
  // 0, 1, 2, ...
  [[nodiscard]] static I32 iota() noexcept {
    alignas(64) static constexpr std::int32_t kIota[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    return I32(IntBatch::load_aligned(kIota));
  }
  void store(std::int32_t* p) const noexcept { value.store_unaligned(p); }
  void store(std::int32_t* p, int n) const noexcept {
    alignas(64) std::int32_t all[kLanes];
    value.store_aligned(all);
    for (int i = 0; i < kLanes; ++i) if (i < n) p[i] = all[i];
  }
  [[nodiscard]] std::int32_t lane(int i) const noexcept {
    alignas(64) std::int32_t all[kLanes];
    value.store_aligned(all);
    return all[i];
  }

  friend I32 operator+(I32 a, I32 b) noexcept { return I32(a.value + b.value); }
  friend I32 operator-(I32 a, I32 b) noexcept { return I32(a.value - b.value); }
  friend I32 operator*(I32 a, I32 b) noexcept;
  friend I32 operator-(I32 a) noexcept { return I32(IntBatch(0) - a.value); }
  friend I32 operator&(I32 a, I32 b) noexcept { return I32(a.value & b.value); }
  friend I32 operator|(I32 a, I32 b) noexcept { return I32(a.value | b.value); }
  friend I32 operator^(I32 a, I32 b) noexcept { return I32(a.value ^ b.value); }
  friend I32 operator~(I32 a) noexcept { return I32(~a.value); }
  friend I32 operator<<(I32 a, int n) noexcept;
  friend I32 operator>>(I32 a, int n) noexcept;
  friend Mask operator==(I32 a, I32 b) noexcept { return Mask(as_float_bool(a.value == b.value)); }
  friend Mask operator!=(I32 a, I32 b) noexcept { return ~(a == b); }
  friend Mask operator<(I32 a, I32 b) noexcept { return Mask(as_float_bool(a.value < b.value)); }
  friend Mask operator>(I32 a, I32 b) noexcept { return b < a; }
  friend Mask operator<=(I32 a, I32 b) noexcept { return ~(b < a); }
  friend Mask operator>=(I32 a, I32 b) noexcept { return ~(a < b); }
  [[nodiscard]] friend I32 select(Mask m, I32 a, I32 b) noexcept {
    return I32(as_int(xsimd::select(m.value, as_float(a.value), as_float(b.value))));
  }
  [[nodiscard]] friend I32 min(I32 a, I32 b) noexcept { return select(a < b, a, b); }
  [[nodiscard]] friend I32 max(I32 a, I32 b) noexcept { return select(b < a, a, b); }

  IntBatch value;

 private:
  template <class T>
  static I32 widen(const T* p, int n) noexcept {
    alignas(64) std::int32_t all[kLanes] = {};
    for (int i = 0; i < kLanes; ++i) if (i < n) all[i] = std::int32_t{p[i]};
    return I32(IntBatch::load_aligned(all));
  }
};

struct F32 {
  static constexpr int lanes = kLanes;
  using Int = I32;
  using MaskType = Mask;

  F32() = default;
  F32(float x) noexcept : value(x) {}  // NOLINT(google-explicit-constructor)
  explicit F32(const FloatBatch& b) noexcept : value(b) {}
  [[nodiscard]] static F32 load(const float* p) noexcept { return F32(FloatBatch::load_unaligned(p)); }
  [[nodiscard]] static F32 load(const float* p, int n) noexcept;
  [[nodiscard]] static F32 gather(const float* base, I32 index) noexcept {
    alignas(64) std::int32_t at[kLanes];
    alignas(64) float all[kLanes];
    index.value.store_aligned(at);
    for (int i = 0; i < kLanes; ++i) all[i] = base[at[i]];
    return F32(FloatBatch::load_aligned(all));
  }
  // Lanes outside the mask read nothing and take `otherwise`.
  [[nodiscard]] static F32 gather(const float* base, I32 index, Mask m, F32 otherwise) noexcept {
    alignas(64) std::int32_t at[kLanes];
    alignas(64) float all[kLanes];
    index.value.store_aligned(at);
    otherwise.value.store_aligned(all);
    const std::uint32_t set = bits(m);
    for (int i = 0; i < kLanes; ++i) if (((set >> static_cast<unsigned>(i)) & 1U) != 0) all[i] = base[at[i]];
    return F32(FloatBatch::load_aligned(all));
  }
  [[nodiscard]] static F32 iota() noexcept;
  void store(float* p) const noexcept { value.store_unaligned(p); }
  void store(float* p, int n) const noexcept;
  [[nodiscard]] float lane(int i) const noexcept {
    alignas(64) float all[kLanes];
    value.store_aligned(all);
    return all[i];
  }

  friend F32 operator+(F32 a, F32 b) noexcept { return F32(a.value + b.value); }
  friend F32 operator-(F32 a, F32 b) noexcept { return F32(a.value - b.value); }
  friend F32 operator*(F32 a, F32 b) noexcept { return F32(a.value * b.value); }
  friend F32 operator/(F32 a, F32 b) noexcept;
  friend F32 operator-(F32 a) noexcept { return F32(as_float(as_int(a.value) ^ IntBatch(kSign))); }
  friend Mask operator==(F32 a, F32 b) noexcept { return Mask(a.value == b.value); }
  friend Mask operator!=(F32 a, F32 b) noexcept { return ~(a == b); }
  friend Mask operator<(F32 a, F32 b) noexcept { return Mask(a.value < b.value); }
  friend Mask operator>(F32 a, F32 b) noexcept { return b < a; }
  friend Mask operator<=(F32 a, F32 b) noexcept { return Mask(a.value <= b.value); }
  friend Mask operator>=(F32 a, F32 b) noexcept { return b <= a; }
  friend F32 fma(F32 a, F32 b, F32 c) noexcept;
  friend F32 fnma(F32 a, F32 b, F32 c) noexcept;
  [[nodiscard]] friend F32 select(Mask m, F32 a, F32 b) noexcept { return F32(xsimd::select(m.value, a.value, b.value)); }
  friend F32 min(F32 a, F32 b) noexcept;
  friend F32 max(F32 a, F32 b) noexcept;
  [[nodiscard]] friend F32 abs(F32 a) noexcept { return F32(as_float(as_int(a.value) & IntBatch(~kSign))); }
  friend F32 sqrt(F32 a) noexcept;
  friend F32 floor(F32 a) noexcept;
  friend F32 round_even(F32 a) noexcept;
  friend F32 scale_by_floor(F32 y, F32 x) noexcept;
  friend F32 slide_up(F32 previous, F32 current) noexcept;
  friend F32 even_lanes(F32 a, F32 b) noexcept;
  friend F32 odd_lanes(F32 a, F32 b) noexcept;
  friend F32 interleave_low(F32 a, F32 b) noexcept;
  friend F32 interleave_high(F32 a, F32 b) noexcept;
  friend I32 trunc_to_int(F32 a) noexcept;
  [[nodiscard]] friend I32 bitcast_int(F32 a) noexcept { return I32(as_int(a.value)); }

  FloatBatch value;

 private:
  static constexpr std::int32_t kSign = std::numeric_limits<std::int32_t>::min();
};
// clang-format on

[[nodiscard]] F32 to_float(I32 a) noexcept;
[[nodiscard]] inline F32 bitcast_float(I32 a) noexcept { return F32(as_float(a.value)); }

inline Mask Mask::first(int n) noexcept { return I32::iota() < I32(n); }
inline Mask Mask::from_bits(std::uint32_t bits) noexcept {
#if defined(NPSIM_SIMD_AVX512)
  return Mask(FloatBool(static_cast<__mmask16>(bits)));
#else
  alignas(64) static constexpr std::int32_t kLaneBit[8] = {1, 2, 4, 8, 16, 32, 64, 128};
  return (I32(static_cast<std::int32_t>(bits)) & I32::load(kLaneBit)) != I32(0);
#endif
}
inline F32 F32::iota() noexcept { return to_float(I32::iota()); }

// What each instruction set does in its own way.

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

#endif  // NPSIM_SIMD_DETAIL_NATIVE_HPP
