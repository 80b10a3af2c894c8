// SPDX-License-Identifier: Apache-2.0
// Elementary functions on batches: exp, exp2, log, log2, pow, cbrt (also for positive values only).
//
// Templates on the float batch: the native and the one-lane batch run the same sequence of IEEE operations and return
// the same bits in every lane. Results are denormal where the exact value is; nothing is flushed. A NaN that goes in
// comes out as quiet_nan(), and so does what has no real value.
//
// Largest error in units in the last place, with and without a fused fma:
//   exp 1.1, exp2 1.1, log 1.0, log2 0.6, cbrt 1.0 (over every float);
//   pow 1.5 where the result lies in [2^-16, 2^16], 6 elsewhere (over samples of both arguments).
// The bound of a denormal result counts the spacing of denormals, 2^-149.
// Cost in multiplications and additions, roughly: exp 20, log 25, cbrt 25 and 2 divisions, log2 45 and 2 divisions,
// pow 75 and 2 divisions. No memory, no table.
//
// Polynomials: least-squares fits weighted by the relative error of the function, rounded to floats from the lowest
// coefficient up, the rest being fitted again after each; the remaining error is stated at each.
#ifndef NPSIM_SIMD_MATH_HPP
#define NPSIM_SIMD_MATH_HPP

#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace simd {
namespace math_detail {

inline constexpr float kInfinity = std::numeric_limits<float>::infinity();
inline constexpr float kLog2E = 0x1.715476p+0F;
inline constexpr float kLn2 = 0x1.62E430p-1F;
// ln 2 as a sum whose first part has 16 bits, so that its product with an exponent is exact with and without fma.
inline constexpr float kLn2Short = 0x1.62E4p-1F;
inline constexpr float kLn2Rest = 0x1.7F7D1Cp-20F;

// Coefficients from the constant term up.
template <class F, std::size_t N>
[[nodiscard]] F polynomial(F x, const float (&c)[N]) noexcept {
  F y(c[N - 1]);
  for (std::size_t i = N - 1; i > 0; --i) y = fma(y, x, F(c[i - 1]));
  return y;
}

// 2^k, -126 <= k <= 127.
template <class I>
[[nodiscard]] typename I::Float power_of_two(I k) noexcept {
  return bitcast_float((k + I(127)) << 23);
}

// e^r 2^n for |r| <= ln(2)/2 and -152 <= n <= 130. In two steps, so that only the last multiplication rounds when the
// result is denormal. Polynomial: 2^-28.
template <class F>
[[nodiscard]] F exp_scaled(F r, typename F::Int n) noexcept {
  static constexpr float kC[] = {0x1.FFFFF8p-2F, 0x1.55548Ep-3F, 0x1.555B9Ap-5F, 0x1.123BF0p-7F, 0x1.684FE4p-10F};
  const F y = F(1.0F) + fma(r * r, polynomial(r, kC), r);
  const auto half = n >> 1;
  return y * power_of_two(half) * power_of_two(n - half);
}

// x = 2^exponent (1 + fraction) for positive finite x, with 1 + fraction in [sqrt(1/2), sqrt(2)).
template <class F>
struct Split {
  F exponent;
  F fraction;
};

template <class F>
[[nodiscard]] Split<F> split(F x) noexcept {
  using I = typename F::Int;
  const auto tiny = x < F(std::numeric_limits<float>::min());
  const I bits = bitcast_int(select(tiny, x * F(0x1p23F), x));
  const I e = (bits - I(0x3F3504F3)) >> 23;  // the bits of sqrt(1/2)
  const F mantissa = bitcast_float(bits - (e << 23));
  return {to_float(e) - select(tiny, F(23.0F), F(0.0F)), mantissa - F(1.0F)};
}

// What a logarithm returns where `y`, its value for positive finite x, does not hold.
template <class F>
[[nodiscard]] F log_limits(F x, F y) noexcept {
  const F finite = select(x == F(0.0F), F(-kInfinity), y);
  const F positive = select(x == F(kInfinity), x, finite);
  return select(x >= F(0.0F), positive, quiet_nan<F>());
}

// log2(x) as a sum hi + lo within 2^-28 of its value, relatively, for positive finite x. With s = f / (2 + f) it is
// exponent + 2 / ln(2) (s + s^3 (1/3 + s^2/5 + ...)); s is carried in two floats. Polynomial: 2^-35.
template <class F>
[[nodiscard]] Pair<F> log2_pair(F x) noexcept {
  static constexpr float kC[] = {0x1.555554p-2F, 0x1.999BD4p-3F, 0x1.23F1A0p-3F, 0x1.EC1E44p-4F};
  const F scale(0x1.715476p+1F);  // 2 / ln 2 = scale + 0x1.4AE0Cp-25
  const Split<F> p = split(x);
  const F f = p.fraction;
  const Pair<F> below = two_sum(F(2.0F), f);
  const F s = f / below.hi;
  const Pair<F> back = two_product(s, below.hi);
  const F s_rest = ((f - back.hi) - back.lo - s * below.lo) / below.hi;
  const F u = s * s;
  const F tail = fma(s * u, polynomial(u, kC), s_rest);
  const Pair<F> lead = two_product(s, scale);
  const F rest = fma(tail, scale, fma(s, F(0x1.4AE0C0p-25F), lead.lo));
  const Pair<F> sum = two_sum(p.exponent, lead.hi);
  return two_sum(sum.hi, sum.lo + rest);
}

}  // namespace math_detail

// e^x. Infinity above 88.72284, 0 below -103.97208.
template <class F>
[[nodiscard]] F exp(F x) noexcept {
  const F in_range = clamp(x, -104.0F, 89.0F);
  const F n = round_even(in_range * F(math_detail::kLog2E));
  const F r = fma(n, F(-math_detail::kLn2Rest), fma(n, F(-math_detail::kLn2Short), in_range));
  return select(is_nan(x), quiet_nan<F>(), math_detail::exp_scaled(r, trunc_to_int(n)));
}

// 2^x; exact at whole numbers. Infinity from 128 up, 0 from -150 down.
template <class F>
[[nodiscard]] F exp2(F x) noexcept {
  const F in_range = clamp(x, -151.0F, 129.0F);
  const F n = round_even(in_range);
  const F r = (in_range - n) * F(math_detail::kLn2);
  return select(is_nan(x), quiet_nan<F>(), math_detail::exp_scaled(r, trunc_to_int(n)));
}

// Natural logarithm. -infinity at 0 of either sign, NaN below. Polynomial: 2^-30.
template <class F>
[[nodiscard]] F log(F x) noexcept {
  static constexpr float kC[] = {0x1.555546p-2F,  -0x1.00000Ap-2F, 0x1.99A546p-3F,  -0x1.555AE4p-3F, 0x1.232CFAp-3F,
                                 -0x1.FC4DA0p-4F, 0x1.E7A54Ep-4F,  -0x1.DD6510p-4F, 0x1.11C874p-4F};
  const math_detail::Split<F> p = math_detail::split(x);
  const F f = p.fraction;
  const F square = f * f;
  const F cubic = f * square * math_detail::polynomial(f, kC);
  const F small = fma(p.exponent, F(math_detail::kLn2Rest), fma(square, F(-0.5F), cubic));
  return math_detail::log_limits(x, fma(p.exponent, F(math_detail::kLn2Short), f + small));
}

// Binary logarithm; exact at powers of two.
template <class F>
[[nodiscard]] F log2(F x) noexcept {
  return math_detail::log_limits(x, math_detail::log2_pair(x).hi);
}

// x^(y.hi + y.lo) for x >= 0: an exponent such as 2.4, which is no float, costs no accuracy.
// pow(x, 0) is 1 for every x >= 0; pow(0, y) is 0 for positive and infinity for negative y; NaN for x < 0 (and not for
// -0, which counts as 0) and where x or y is a NaN.
template <class F>
[[nodiscard]] F pow(F x, const Pair<F>& y) noexcept {
  using math_detail::kInfinity;
  // An exponent beyond 2^60 gives 0, 1 or infinity like 2^60 does, and its products stay finite.
  const F exponent = clamp(y.hi, -0x1p60F, 0x1p60F);
  const Pair<F> log = math_detail::log2_pair(x);
  const Pair<F> product = two_product(log.hi, exponent);
  const F rest = fma(log.lo, exponent, fma(log.hi, y.lo, product.lo));
  const F in_range = clamp(product.hi, -151.0F, 129.0F);
  const F n = round_even(in_range);
  const F r = fma(in_range - n, F(math_detail::kLn2), clamp(rest, -1.0F, 1.0F) * F(math_detail::kLn2));
  const F finite = math_detail::exp_scaled(r, trunc_to_int(n));

  const F zero(0.0F);
  const auto vanishes = (x == zero) ^ (exponent < zero);  // for x = 0 and x = infinity: 0, or else infinity
  const F limit = select(exponent == zero, F(1.0F), select(vanishes, zero, F(kInfinity)));
  const F value = select((x == zero) | (x == F(kInfinity)), limit, finite);
  return select((x >= zero) & (y.hi == y.hi), value, quiet_nan<F>());
}

template <class F>
[[nodiscard]] F pow(F x, F y) noexcept {
  return pow(x, Pair<F>{y, F(0.0F)});
}

// Cube root, odd. A guess from a third of the exponent bits (3 % off) and two steps of Halley's method, which cube the
// error; the second is written as a small correction, so that its own rounding hardly counts.
template <class F>
[[nodiscard]] F cbrt(F x) noexcept {
  using I = typename F::Int;
  const F size = abs(x);
  const auto tiny = size < F(std::numeric_limits<float>::min());
  const auto huge = size > F(0x1p120F);  // three times the argument must be finite
  const F a = size * select(tiny, F(0x1p24F), select(huge, F(0x1p-24F), F(1.0F)));
  const F third = to_float(bitcast_int(a)) * F(1.0F / 3.0F);
  const F guess = bitcast_float(trunc_to_int(third) + I(0x2A5137A0));
  const F cube = guess * guess * guess;
  const F better = guess * ((cube + a + a) / (cube + cube + a));
  const F square = better * better;
  const F missing = fma(-square, better, a);
  const F root = fma(better, missing / fma(square + square, better, a), better);
  const F scaled_back = root * select(tiny, F(0x1p-8F), select(huge, F(0x1p8F), F(1.0F)));
  const F value = copysign(select((size > F(0.0F)) & is_finite(size), scaled_back, size), x);
  return select(is_nan(x), quiet_nan<F>(), value);
}

// Cube root of a positive normal x in 15 instructions without a division: within 1.2 units in the last place for x in
// [2^-16, 2^16], within 4 elsewhere. Of a NaN or infinity a NaN, of anything else a number without meaning. An inverse
// cube root guessed from the bits (3.5 % off), made better by a polynomial in its defect (5e-5), and one step of
// Newton's method on the root.
template <class F>
[[nodiscard]] F cbrt_of_positive(F x) noexcept {
  using I = typename F::Int;
  const F guess = bitcast_float(I(0x54A0C000) - (bitcast_int(x) >> 12) * I(1365));
  const F defect = fma(-(x * guess * guess), guess, F(1.0F));
  const F p = fma(fma(F(0x1.CA8706p-3F), defect, F(0x1.56CB9Ep-2F)), defect, F(0x1.FFFFA8p-1F));
  const F r = guess * p;
  const F square = r * r;
  const F root = x * square;
  const F missing = fma(-(root * root), root, x);
  return fma(missing * F(1.0F / 3.0F), square, root);
}

}  // namespace simd

// Of one number, with the same bits everywhere. log2_of(0) is minus infinity.
[[nodiscard]] inline float log2_of(float x) noexcept { return simd::log2(simd::scalar::F32(x)).value; }
[[nodiscard]] inline float exp2_of(float x) noexcept { return simd::exp2(simd::scalar::F32(x)).value; }

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SIMD_MATH_HPP
