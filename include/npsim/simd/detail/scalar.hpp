// SPDX-License-Identifier: Apache-2.0
// The one-lane batch: F32, I32 and Mask over single values, with the interface of the native batch.
//
// It is the reference that the native batch is tested against, bit by bit, and the whole implementation where there is
// no SIMD. Every operation is IEEE 754 binary32, rounded to nearest even, with denormals; the sign and payload of a NaN
// that arithmetic makes are unspecified (math.hpp returns one fixed NaN). The rules are stated in batch.hpp.
#ifndef NPSIM_SIMD_DETAIL_SCALAR_HPP
#define NPSIM_SIMD_DETAIL_SCALAR_HPP

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "npsim/core/config.hpp"

// One rounding in fma()? AVX2, AVX-512 and NEON64 have the instruction, the forced one-lane build calls the library's
// exact one, and only plain SSE2 rounds twice. Bound to the namespace and not to __FMA__, so that two objects in the
// same namespace agree.
#if defined(__SSE2__) && !(defined(__AVX2__) && defined(__FMA__)) && !defined(NPSIM_SIMD_SCALAR)
#define NPSIM_SIMD_FMA_IS_FUSED 0
#else
#define NPSIM_SIMD_FMA_IS_FUSED 1
#endif

namespace npsim {
inline namespace NPSIM_ABI {
namespace simd {

inline constexpr bool kFusedFma = NPSIM_SIMD_FMA_IS_FUSED != 0;

namespace scalar {

struct F32;
struct I32;

// clang-format off
struct Mask {
  static constexpr int lanes = 1;

  Mask() = default;
  Mask(bool all) noexcept : value(all) {}  // NOLINT(google-explicit-constructor)
  [[nodiscard]] static Mask first(int n) noexcept { return n > 0; }
  [[nodiscard]] static Mask from_bits(std::uint32_t bits) noexcept { return (bits & 1U) != 0; }
  [[nodiscard]] bool lane(int) const noexcept { return value; }

  friend Mask operator&(Mask a, Mask b) noexcept { return a.value && b.value; }
  friend Mask operator|(Mask a, Mask b) noexcept { return a.value || b.value; }
  friend Mask operator^(Mask a, Mask b) noexcept { return a.value != b.value; }
  friend Mask operator~(Mask a) noexcept { return !a.value; }
  [[nodiscard]] friend bool any(Mask a) noexcept { return a.value; }
  [[nodiscard]] friend bool all(Mask a) noexcept { return a.value; }
  [[nodiscard]] friend bool none(Mask a) noexcept { return !a.value; }
  [[nodiscard]] friend std::uint32_t bits(Mask a) noexcept { return a.value ? 1U : 0U; }

  bool value;
};

struct I32 {
  static constexpr int lanes = 1;
  using Float = F32;
  using MaskType = Mask;

  I32() = default;
  I32(std::int32_t x) noexcept : value(x) {}  // NOLINT(google-explicit-constructor)
  [[nodiscard]] static I32 load(const std::int32_t* p) noexcept { return *p; }
  [[nodiscard]] static I32 load(const std::int32_t* p, int n) noexcept { return n > 0 ? *p : 0; }
  [[nodiscard]] static I32 load_u8(const std::uint8_t* p) noexcept { return std::int32_t{*p}; }
  [[nodiscard]] static I32 load_u8(const std::uint8_t* p, int n) noexcept { return n > 0 ? std::int32_t{*p} : 0; }
  [[nodiscard]] static I32 load_u16(const std::uint16_t* p) noexcept { return std::int32_t{*p}; }
  [[nodiscard]] static I32 load_u16(const std::uint16_t* p, int n) noexcept { return n > 0 ? std::int32_t{*p} : 0; }
  [[nodiscard]] static I32 gather(const std::int32_t* base, I32 index) noexcept { return base[index.value]; }
  [[nodiscard]] static I32 iota() noexcept { return 0; }
  void store(std::int32_t* p) const noexcept { *p = value; }
  void store(std::int32_t* p, int n) const noexcept { if (n > 0) *p = value; }
  [[nodiscard]] std::int32_t lane(int) const noexcept { return value; }

  // Through unsigned arithmetic, because the batches wrap.
  friend I32 operator+(I32 a, I32 b) noexcept { return from(to(a) + to(b)); }
  friend I32 operator-(I32 a, I32 b) noexcept { return from(to(a) - to(b)); }
  friend I32 operator*(I32 a, I32 b) noexcept { return from(to(a) * to(b)); }
  friend I32 operator-(I32 a) noexcept { return from(0U - to(a)); }
  friend I32 operator&(I32 a, I32 b) noexcept { return from(to(a) & to(b)); }
  friend I32 operator|(I32 a, I32 b) noexcept { return from(to(a) | to(b)); }
  friend I32 operator^(I32 a, I32 b) noexcept { return from(to(a) ^ to(b)); }
  friend I32 operator~(I32 a) noexcept { return from(~to(a)); }
  friend I32 operator<<(I32 a, int n) noexcept { return from(to(a) << static_cast<unsigned>(n)); }
  friend I32 operator>>(I32 a, int n) noexcept { return a.value >> n; }
  friend Mask operator==(I32 a, I32 b) noexcept { return a.value == b.value; }
  friend Mask operator!=(I32 a, I32 b) noexcept { return a.value != b.value; }
  friend Mask operator<(I32 a, I32 b) noexcept { return a.value < b.value; }
  friend Mask operator>(I32 a, I32 b) noexcept { return a.value > b.value; }
  friend Mask operator<=(I32 a, I32 b) noexcept { return a.value <= b.value; }
  friend Mask operator>=(I32 a, I32 b) noexcept { return a.value >= b.value; }
  [[nodiscard]] friend I32 min(I32 a, I32 b) noexcept { return a.value < b.value ? a : b; }
  [[nodiscard]] friend I32 max(I32 a, I32 b) noexcept { return a.value > b.value ? a : b; }
  [[nodiscard]] friend I32 select(Mask m, I32 a, I32 b) noexcept { return m.value ? a : b; }

  std::int32_t value;

 private:
  static std::uint32_t to(I32 a) noexcept { return static_cast<std::uint32_t>(a.value); }
  static I32 from(std::uint32_t u) noexcept { return static_cast<std::int32_t>(u); }
};

struct F32 {
  static constexpr int lanes = 1;
  using Int = I32;
  using MaskType = Mask;

  F32() = default;
  F32(float x) noexcept : value(x) {}  // NOLINT(google-explicit-constructor)
  [[nodiscard]] static F32 load(const float* p) noexcept { return *p; }
  [[nodiscard]] static F32 load(const float* p, int n) noexcept { return n > 0 ? *p : 0.0F; }
  [[nodiscard]] static F32 gather(const float* base, I32 index) noexcept { return base[index.value]; }
  [[nodiscard]] static F32 gather(const float* base, I32 index, Mask m, F32 otherwise) noexcept {
    return m.value ? F32(base[index.value]) : otherwise;
  }
  [[nodiscard]] static F32 iota() noexcept { return 0.0F; }
  void store(float* p) const noexcept { *p = value; }
  void store(float* p, int n) const noexcept { if (n > 0) *p = value; }
  [[nodiscard]] float lane(int) const noexcept { return value; }

  friend F32 operator+(F32 a, F32 b) noexcept { return a.value + b.value; }
  friend F32 operator-(F32 a, F32 b) noexcept { return a.value - b.value; }
  friend F32 operator*(F32 a, F32 b) noexcept { return a.value * b.value; }
  friend F32 operator/(F32 a, F32 b) noexcept { return a.value / b.value; }
  friend F32 operator-(F32 a) noexcept { return -a.value; }
  friend Mask operator==(F32 a, F32 b) noexcept { return a.value == b.value; }
  friend Mask operator!=(F32 a, F32 b) noexcept { return a.value != b.value; }
  friend Mask operator<(F32 a, F32 b) noexcept { return a.value < b.value; }
  friend Mask operator>(F32 a, F32 b) noexcept { return a.value > b.value; }
  friend Mask operator<=(F32 a, F32 b) noexcept { return a.value <= b.value; }
  friend Mask operator>=(F32 a, F32 b) noexcept { return a.value >= b.value; }
  [[nodiscard]] friend F32 fma(F32 a, F32 b, F32 c) noexcept {
    if constexpr (kFusedFma) { return std::fma(a.value, b.value, c.value); } else { return a * b + c; }
  }
  [[nodiscard]] friend F32 fnma(F32 a, F32 b, F32 c) noexcept { return fma(-a, b, c); }
  [[nodiscard]] friend F32 min(F32 a, F32 b) noexcept { return a.value < b.value ? a : b; }
  [[nodiscard]] friend F32 max(F32 a, F32 b) noexcept { return a.value > b.value ? a : b; }
  [[nodiscard]] friend F32 select(Mask m, F32 a, F32 b) noexcept { return m.value ? a : b; }
  [[nodiscard]] friend F32 abs(F32 a) noexcept { return std::fabs(a.value); }
  [[nodiscard]] friend F32 sqrt(F32 a) noexcept { return std::sqrt(a.value); }
  [[nodiscard]] friend F32 floor(F32 a) noexcept { return std::floor(a.value); }
  [[nodiscard]] friend F32 round_even(F32 a) noexcept { return std::nearbyint(a.value); }
  [[nodiscard]] friend F32 slide_up(F32 previous, F32) noexcept { return previous; }
  [[nodiscard]] friend F32 even_lanes(F32 a, F32) noexcept { return a; }
  [[nodiscard]] friend F32 odd_lanes(F32, F32 b) noexcept { return b; }
  [[nodiscard]] friend F32 interleave_low(F32 a, F32) noexcept { return a; }
  [[nodiscard]] friend F32 interleave_high(F32, F32 b) noexcept { return b; }
  [[nodiscard]] friend F32 scale_by_floor(F32 y, F32 x) noexcept {
    const float n = std::floor(x.value);
    return std::ldexp(y.value, n > 130.0F ? 130 : n > -152.0F ? static_cast<int>(n) : -152);
  }
  [[nodiscard]] friend I32 trunc_to_int(F32 a) noexcept {
    if (!(a.value < 0x1p31F)) return a.value >= 0x1p31F ? std::numeric_limits<std::int32_t>::max() : 0;  // 0: NaN
    return a.value >= -0x1p31F ? static_cast<std::int32_t>(a.value) : std::numeric_limits<std::int32_t>::min();
  }
  [[nodiscard]] friend I32 bitcast_int(F32 a) noexcept {
    std::int32_t i = 0;
    std::memcpy(&i, &a.value, sizeof(i));
    return i;
  }

  float value;
};
// clang-format on

[[nodiscard]] inline F32 to_float(I32 a) noexcept { return static_cast<float>(a.value); }
[[nodiscard]] inline F32 bitcast_float(I32 a) noexcept {
  float f = 0;
  std::memcpy(&f, &a.value, sizeof(f));
  return f;
}

}  // namespace scalar
}  // namespace simd
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SIMD_DETAIL_SCALAR_HPP
