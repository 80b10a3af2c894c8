// SPDX-License-Identifier: Apache-2.0
// Batches: simd::F32, simd::I32 and simd::Mask, `lanes` values side by side. The facade of simd/.
//
// A kernel is a template on the float batch, `template <class F>`, with F::lanes, F::Int and F::MaskType. It runs with
// simd::F32 (16, 8 or 4 lanes: AVX-512, AVX2, SSE2 or NEON64) and with simd::scalar::F32 (one lane, the reference). A
// lane is a pixel, a ray or a sample; nothing sums across lanes, so both give the same bits. Define NPSIM_SIMD_SCALAR
// to make simd::F32 the one-lane type.
//
// Rules, the same for every instruction set and number of lanes:
// - + - * / and sqrt are correctly rounded; floor, round_even (half to even) and conversions are exact where they can
// be.
// - fma(a, b, c) rounds once, except with plain SSE2, where it is a * b + c with two roundings (kFusedFma is false).
// - min(a, b) is a < b ? a : b and max(a, b) is a > b ? a : b: with a NaN in either operand, and for a zero of the
//   other sign, the result is b. So clamp(x, low, high) sends a NaN to low.
// - comparisons with a NaN are false, != is true; -x and abs touch the sign bit alone.
// - trunc_to_int saturates: the largest int from 2^31 up, the smallest below -2^31, 0 for a NaN.
// - int arithmetic wraps; >> keeps the sign; a shift count lies in [0, 31].
// - load and store need no alignment; load(p, n) and store(p, n), 0 <= n <= lanes, touch n elements and no more, and
//   the other lanes are 0.
// - The sign and payload of a NaN made by arithmetic are unspecified; math.hpp returns quiet_nan().
//
// Interface of the float batch F, with its I = F::Int and M = F::MaskType:
//   F(x) broadcast, F::load(p), F::load(p, n), F::gather(base, index), F::gather(base, index, mask, otherwise),
//   F::iota() (0, 1, 2, ...), f.store(p), f.store(p, n), f.lane(i); + - * / unary -, == != < > <= >=; fma, min, max,
//   fnma(a, b, c) = fma(-a, b, c), select(mask, a, b), abs, sqrt, floor, round_even, trunc_to_int, bitcast_int;
//   to_float(I) and bitcast_float(I);
//   slide_up(previous, current): each lane's left neighbour, lane i - 1 of current and for lane 0 the last of previous.
//   even_lanes(a, b), odd_lanes(a, b) of a followed by b; interleave_low(a, b), interleave_high(a, b): the first and
//   the second half of a0 b0 a1 b1 ...
//   scale_by_floor(y, x) = y 2^floor(x), rounded once, for 0.5 <= |y| <= 4 and finite x (one instruction with AVX-512).
//   I: load, store, gather, iota and lane alike, I::load_u8(p), I::load_u16(p) (also with n); + - * & | ^ ~ << >>,
//   comparisons, min, max, select.
//   M(bool), M::first(n), M::from_bits(bits), m.lane(i), & | ^ ~, any, all, none, bits (lane i in bit i).
// Besides: interleaved triples (load3, store3), blocks of 4x4 values (load_columns, block_columns, block_rows), exact
// sums and products as pairs.
// Mixed calls take a float for a batch where one argument is a batch: x * 2.0F, max(x, 0.0F).
#ifndef NPSIM_SIMD_BATCH_HPP
#define NPSIM_SIMD_BATCH_HPP

#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "npsim/core/config.hpp"
#include "npsim/simd/detail/scalar.hpp"
#if !defined(NPSIM_SIMD_SCALAR)
#include "npsim/simd/detail/interleave.hpp"
#include "npsim/simd/detail/native.hpp"
#endif

namespace npsim {
inline namespace NPSIM_ABI {
namespace simd {

#if defined(NPSIM_SIMD_SCALAR)
using F32 = scalar::F32;
using I32 = scalar::I32;
using Mask = scalar::Mask;
#else
using F32 = native::F32;
using I32 = native::I32;
using Mask = native::Mask;
#endif

// The widest batch of any instruction set: the size of a local array that holds one.
inline constexpr int kMaxLanes = 16;

template <class F>
[[nodiscard]] F clamp(F x, F low, F high) noexcept {
  return min(max(x, low), high);
}

template <class F>
[[nodiscard]] F clamp(F x, float low, float high) noexcept {
  return clamp(x, F(low), F(high));
}

// Of lanes without a NaN.
template <class F>
[[nodiscard]] float least_lane(F x) noexcept {
  float lanes[F::lanes];
  x.store(lanes);
  for (int i = 1; i < F::lanes; ++i) lanes[0] = lanes[0] < lanes[i] ? lanes[0] : lanes[i];
  return lanes[0];
}

template <class F>
[[nodiscard]] float greatest_lane(F x) noexcept {
  return -least_lane(-x);
}

template <class F>
[[nodiscard]] typename F::MaskType is_nan(F x) noexcept {
  return x != x;
}

template <class F>
[[nodiscard]] typename F::MaskType is_finite(F x) noexcept {
  return abs(x) < F(std::numeric_limits<float>::infinity());
}

// Saturating like trunc_to_int; half to even.
template <class F>
[[nodiscard]] typename F::Int round_to_int(F x) noexcept {
  return trunc_to_int(round_even(x));
}

// The magnitude of x with the sign bit of s.
template <class F>
[[nodiscard]] F copysign(F x, F s) noexcept {
  using I = typename F::Int;
  const I sign(std::numeric_limits<std::int32_t>::min());
  return bitcast_float((bitcast_int(x) & ~sign) | (bitcast_int(s) & sign));
}

// Positive and quiet, without payload.
template <class F>
[[nodiscard]] F quiet_nan() noexcept {
  using I = typename F::Int;
  return bitcast_float(I(0x7FC00000));
}

template <class F>
struct F32x3 {
  F x;
  F y;
  F z;
};

// n interleaved triples (Vec3f pixels, as floats) to three batches; the other lanes are 0.
template <class F>
[[nodiscard]] F32x3<F> load3(const float* p, int n = F::lanes) noexcept {
#if !defined(NPSIM_SIMD_SCALAR)
  if constexpr (std::is_same_v<F, native::F32>) {
    if (n == F::lanes) {
      F32x3<F> v;
      native::load_triples(p, v.x, v.y, v.z);
      return v;
    }
  }
#endif
  float x[F::lanes] = {};
  float y[F::lanes] = {};
  float z[F::lanes] = {};
  for (int i = 0; i < F::lanes; ++i) {
    if (i < n) {
      x[i] = p[3 * i];
      y[i] = p[3 * i + 1];
      z[i] = p[3 * i + 2];
    }
  }
  return {F::load(x), F::load(y), F::load(z)};
}

template <class F>
void store3(float* p, const F32x3<F>& v, int n = F::lanes) noexcept {
#if !defined(NPSIM_SIMD_SCALAR)
  if constexpr (std::is_same_v<F, native::F32>) {
    if (n == F::lanes) return native::store_triples(p, v.x, v.y, v.z);
  }
#endif
  float x[F::lanes];
  float y[F::lanes];
  float z[F::lanes];
  v.x.store(x);
  v.y.store(y);
  v.z.store(z);
  for (int i = 0; i < F::lanes; ++i) {
    if (i < n) {
      p[3 * i] = x[i];
      p[3 * i + 1] = y[i];
      p[3 * i + 2] = z[i];
    }
  }
}

// Blocks of 4x4 values: lane l of part p is element k = p lanes + l, in raster order. A kernel over a block runs for
// p = 0 .. 16 / lanes - 1: once with 16 lanes, sixteen times with one.
inline constexpr int kBlockElements = 16;

// Column i of 4x4 blocks side by side: out[i] = p[(k / 4) stride + 4 (k % 4) + i] for i = 0 .. 3, k being the block.
// Four loads and eight permutations for four columns.
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

// k % 4 and k / 4 as floats.
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

// a * b as an unevaluated sum hi + lo, exact unless it over- or underflows (|a| and |b| below 2^115 where fma is not
// fused). With fma the error term is one instruction; without, by Dekker's splitting (Numer. Math. 18, 1971).
template <class F>
struct Pair {
  F hi;
  F lo;
};

template <class F>
[[nodiscard]] Pair<F> two_product(F a, F b) noexcept {
  const F hi = a * b;
  if constexpr (kFusedFma) {
    return {hi, fma(a, b, -hi)};
  } else {
    const F split(4097.0F);  // 2^12 + 1
    const F a_big = a * split;
    const F a_hi = a_big - (a_big - a);
    const F a_lo = a - a_hi;
    const F b_big = b * split;
    const F b_hi = b_big - (b_big - b);
    const F b_lo = b - b_hi;
    return {hi, ((a_hi * b_hi - hi) + a_hi * b_lo + a_lo * b_hi) + a_lo * b_lo};
  }
}

// a + b as an exact unevaluated sum (Knuth).
template <class F>
[[nodiscard]] Pair<F> two_sum(F a, F b) noexcept {
  const F hi = a + b;
  const F part = hi - a;
  return {hi, (a - (hi - part)) + (b - part)};
}

}  // namespace simd
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SIMD_BATCH_HPP
