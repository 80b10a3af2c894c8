// SPDX-License-Identifier: Apache-2.0
// Elementary functions: the stated ulp bounds against double over all exponents, equal bits of the native and the
// one-lane batch, and the special values.
#include <doctest/doctest.h>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "npsim/core/random.hpp"
#include "npsim/simd/math.hpp"

namespace {

namespace simd = npsim::simd;
using Native = simd::F32;
using One = simd::scalar::F32;
constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kTiniest = std::numeric_limits<float>::denorm_min();
constexpr float kMin = std::numeric_limits<float>::min();
constexpr float kMax = std::numeric_limits<float>::max();

float float_of(std::uint32_t u) {
  float x = 0;
  std::memcpy(&x, &u, sizeof(x));
  return x;
}

std::uint32_t bits_of(float x) {
  std::uint32_t u = 0;
  std::memcpy(&u, &x, sizeof(u));
  return u;
}

// Distance of a float from the exact value, in the spacing of floats at the exact value. Overflow to infinity is exact
// when the value rounds there, and half a unit off when it lies within one unit of the largest float.
double ulp_error(float got, double exact) {
  constexpr double kWrong = 1e9;
  if (std::isnan(exact)) return bits_of(got) == 0x7FC00000U ? 0.0 : kWrong;
  if (std::isinf(exact) || std::fabs(exact) >= 0x1.FFFFFFp127) {
    if (std::isinf(got) && std::signbit(got) == std::signbit(exact)) return 0.0;
    return std::fabs(exact) < 0x1p128 + 0x1p104 && std::fabs(got) == kMax ? 0.5 : kWrong;
  }
  if (std::isinf(got)) return std::fabs(exact) > 0x1.FFFFFEp127 ? 0.5 : kWrong;
  if (exact == 0.0) return got == 0.0F ? 0.0 : kWrong;
  int exponent = 0;
  static_cast<void>(std::frexp(exact, &exponent));
  const double unit = std::ldexp(1.0, exponent - 24 < -149 ? -149 : exponent - 24);
  return std::fabs(static_cast<double>(got) - exact) / unit;
}

struct Worst {
  double ulp = 0;
  float at = 0;
  int unequal_bits = 0;
};

// Every stride-th bit pattern from the given one: all exponents, both signs, denormals, infinities and NaNs.
template <class Function, class Exact>
Worst sweep(std::uint32_t first, std::uint32_t stride, Function f, Exact exact) {
  Worst worst;
  std::uint64_t u = first;
  while (u <= 0xFFFFFFFFU) {
    float in[Native::lanes];
    float out[Native::lanes];
    for (float& x : in) {
      x = float_of(static_cast<std::uint32_t>(u));
      u += stride;
    }
    f(Native::load(in)).store(out);
    for (int i = 0; i < Native::lanes; ++i) {
      float one = 0;
      f(One(in[i])).store(&one);
      if (bits_of(one) != bits_of(out[i])) ++worst.unequal_bits;
      const double error = ulp_error(out[i], exact(static_cast<double>(in[i])));
      if (error > worst.ulp) worst = {error, in[i], worst.unequal_bits};
    }
  }
  return worst;
}

template <class Function, class Exact>
void check_bound(const char* name, double bound, std::uint32_t stride, Function f, Exact exact) {
  const Worst worst = sweep(0, stride, f, exact);
  CAPTURE(name);
  CAPTURE(worst.at);
  CHECK(worst.ulp <= bound);
  CHECK(worst.unequal_bits == 0);
}

double exact_pow(double x, double y) {
  if (std::isnan(x) || std::isnan(y) || x < 0.0) return std::numeric_limits<double>::quiet_NaN();
  return std::pow(std::fabs(x), y);
}

// The bound of pow at a given exact result.
double pow_bound(double exact) { return exact >= 0x1p-16 && exact <= 0x1p16 ? 1.5 : 6.0; }

constexpr std::uint32_t kStride = 2003;  // a prime: about two million values

}  // namespace

TEST_CASE("every function stays within its stated bound over all exponents, with equal bits in one lane") {
  check_bound(
      "exp", 1.1, kStride, [](auto x) { return simd::exp(x); }, [](double x) { return std::exp(x); });
  check_bound(
      "exp2", 1.1, kStride, [](auto x) { return simd::exp2(x); }, [](double x) { return std::exp2(x); });
  check_bound(
      "log", 1.0, kStride, [](auto x) { return simd::log(x); }, [](double x) { return std::log(x); });
  check_bound(
      "log2", 0.6, kStride, [](auto x) { return simd::log2(x); }, [](double x) { return std::log2(x); });
  check_bound(
      "cbrt", 1.0, kStride, [](auto x) { return simd::cbrt(x); }, [](double x) { return std::cbrt(x); });
}

TEST_CASE(
    "the cube root of positive values stays within its bounds for every normal float, with equal bits in one lane") {
  double worst = 0;
  double worst_near_one = 0;
  int unequal = 0;
  for (std::uint32_t u = 0x00800000U; u < 0x7F800000U - 997U * Native::lanes; u += 997U * Native::lanes) {
    float x[Native::lanes];
    float y[Native::lanes];
    for (std::uint32_t i = 0; i < Native::lanes; ++i) x[i] = float_of(u + 997U * i);
    simd::cbrt_of_positive(Native::load(x)).store(y);
    for (int i = 0; i < Native::lanes; ++i) {
      const double error = ulp_error(y[i], std::cbrt(static_cast<double>(x[i])));
      worst = std::fmax(worst, error);
      if (x[i] >= 0x1p-16F && x[i] <= 0x1p16F) worst_near_one = std::fmax(worst_near_one, error);
      if (bits_of(simd::cbrt_of_positive(One(x[i])).value) != bits_of(y[i])) ++unequal;
    }
  }
  MESSAGE("cbrt_of_positive " << worst << ", near one " << worst_near_one);
  CHECK(worst <= 4.0);
  CHECK(worst_near_one <= 1.2);
  CHECK(unequal == 0);
  CHECK(std::isnan(simd::cbrt_of_positive(One(kNan)).value));
}

TEST_CASE("exp and log keep their bound where they are used most") {
  // Densely, where the strided sweep has few values: exponents of a Gaussian and arguments round one.
  for (std::uint32_t u = bits_of(-90.0F); u > bits_of(-0x1p-10F); u -= 211) {
    const float x = float_of(u);
    REQUIRE(ulp_error(simd::exp(Native(x)).lane(0), std::exp(static_cast<double>(x))) <= 1.1);
  }
  for (std::uint32_t u = bits_of(0.5F); u < bits_of(2.0F); u += 101) {
    const float x = float_of(u);
    REQUIRE(ulp_error(simd::log(Native(x)).lane(0), std::log(static_cast<double>(x))) <= 1.0);
    REQUIRE(ulp_error(simd::log2(Native(x)).lane(0), std::log2(static_cast<double>(x))) <= 0.6);
  }
}

TEST_CASE("pow stays within its bound for fixed exponents over all bases and for fixed bases over all exponents") {
  for (const float y : {2.4F, -2.4F, 1.0F / 2.4F, 0.5F, 1.0F, -1.0F, 3.0F, 37.5F, -0.01F, 1e-5F, 1000.0F, 1e6F, kInf}) {
    CAPTURE(y);
    check_bound(
        "pow", 6.0, kStride * 7, [y](auto x) { return simd::pow(x, decltype(x)(y)); },
        [y](double x) { return exact_pow(x, static_cast<double>(y)); });
  }
  for (const float x : {2.0F, 1.0000001F, 0.99999994F, 0.5F, 3.3F, 1e-40F, 1e38F, 0.7F, 0.0F, 1.0F, kInf, -1.0F}) {
    CAPTURE(x);
    check_bound(
        "pow", 6.0, kStride * 7, [x](auto y) { return simd::pow(decltype(y)(x), y); },
        [x](double y) { return exact_pow(static_cast<double>(x), y); });
  }
}

TEST_CASE("pow of random pairs stays within its bound") {
  npsim::RandomStream random(5, npsim::RandomPurpose::test, 0, 0, 0, 0);
  npsim::RandomStream other(5, npsim::RandomPurpose::test, 0, 0, 1, 0);
  double worst = 0;  // as a part of the bound
  for (int i = 0; i < 400000; ++i) {
    if (i % 1000 == 0) {  // a stream holds 1024 numbers
      random = {5, npsim::RandomPurpose::test, 0, 0, 0, static_cast<std::uint32_t>(i)};
      other = {5, npsim::RandomPurpose::test, 0, 0, 1, static_cast<std::uint32_t>(i)};
    }
    const float x = float_of(random.next_u32() & 0x7FFFFFFFU);
    if (!std::isfinite(x) || x == 0.0F) continue;
    // An exponent that spreads the results over the range of floats and a little beyond, or over the tighter range.
    const double log_x = std::log2(static_cast<double>(x));
    const float log_result = i % 2 == 0 ? other.uniform(-155.0F, 135.0F) : other.uniform(-16.0F, 16.0F);
    const float y = static_cast<float>(static_cast<double>(log_result) / log_x);
    const double exact = exact_pow(static_cast<double>(x), static_cast<double>(y));
    const float got = simd::pow(Native(x), Native(y)).lane(0);
    worst = std::fmax(worst, ulp_error(got, exact) / pow_bound(exact));
  }
  CHECK(worst <= 1.0);
}

TEST_CASE_TEMPLATE("pow with an exponent that is no float rounds as if it were exact", F, Native, One) {
  // 2.4 = hi + lo. The single float 2.4F is off by 4e-8, which is 25 ulp at 1e-37.
  const float hi = 2.4F;
  const float lo = static_cast<float>(2.4 - static_cast<double>(hi));
  double worst = 0;
  for (float x = 1e-15F; x < 1e15F; x *= 1.01F) {
    const float got = simd::pow(F(x), simd::Pair<F>{F(hi), F(lo)}).lane(0);
    worst = std::fmax(worst, ulp_error(got, std::pow(static_cast<double>(x), 2.4)));
  }
  CHECK(worst <= 1.5);
}

TEST_CASE_TEMPLATE("special values", F, Native, One) {
  const auto exp = [](float x) { return simd::exp(F(x)).lane(0); };
  const auto exp2 = [](float x) { return simd::exp2(F(x)).lane(0); };
  const auto log = [](float x) { return simd::log(F(x)).lane(0); };
  const auto log2 = [](float x) { return simd::log2(F(x)).lane(0); };
  const auto cbrt = [](float x) { return simd::cbrt(F(x)).lane(0); };
  const auto pow = [](float x, float y) { return simd::pow(F(x), F(y)).lane(0); };
  const auto is_quiet_nan = [](float x) { return bits_of(x) == 0x7FC00000U; };

  CHECK(exp(0.0F) == 1.0F);
  CHECK(exp(-0.0F) == 1.0F);
  CHECK(exp(kInf) == kInf);
  CHECK(exp(-kInf) == 0.0F);
  CHECK(exp(88.72284F) == kInf);
  CHECK(exp(88.72283F) < kInf);
  CHECK(exp(-103.0F) == kTiniest);  // a denormal result is not flushed
  CHECK(exp(-90.0F) > 0.0F);
  CHECK(exp(-90.0F) < kMin);
  CHECK(exp(-1000.0F) == 0.0F);
  CHECK(is_quiet_nan(exp(kNan)));
  CHECK(is_quiet_nan(exp(-kNan)));

  for (int k = -149; k <= 127; ++k) {
    CHECK(exp2(static_cast<float>(k)) == static_cast<float>(std::ldexp(1.0, k)));
    CHECK(log2(static_cast<float>(std::ldexp(1.0, k))) == static_cast<float>(k));
  }
  CHECK(exp2(128.0F) == kInf);
  CHECK(exp2(-150.0F) == 0.0F);
  CHECK(exp2(kInf) == kInf);
  CHECK(exp2(-kInf) == 0.0F);
  CHECK(is_quiet_nan(exp2(kNan)));

  CHECK(bits_of(log(1.0F)) == 0U);
  CHECK(log(0.0F) == -kInf);
  CHECK(log(-0.0F) == -kInf);
  CHECK(log(kInf) == kInf);
  CHECK(is_quiet_nan(log(-kTiniest)));
  CHECK(is_quiet_nan(log(-kInf)));
  CHECK(is_quiet_nan(log(kNan)));
  CHECK(log2(0.0F) == -kInf);
  CHECK(is_quiet_nan(log2(-1.0F)));
  CHECK(log2(kInf) == kInf);

  CHECK(bits_of(cbrt(0.0F)) == 0U);
  CHECK(bits_of(cbrt(-0.0F)) == 0x80000000U);
  CHECK(cbrt(kInf) == kInf);
  CHECK(cbrt(-kInf) == -kInf);
  CHECK(is_quiet_nan(cbrt(-kNan)));
  for (int k = 1; k <= 100; ++k) CHECK(cbrt(static_cast<float>(-k * k * k)) == static_cast<float>(-k));

  CHECK(pow(0.0F, 0.0F) == 1.0F);
  CHECK(pow(kInf, 0.0F) == 1.0F);
  CHECK(pow(0.0F, 2.4F) == 0.0F);
  CHECK(pow(-0.0F, 2.4F) == 0.0F);
  CHECK(pow(0.0F, -1.0F) == kInf);
  CHECK(pow(kInf, -1.0F) == 0.0F);
  CHECK(pow(kInf, 0.5F) == kInf);
  CHECK(pow(1.0F, kInf) == 1.0F);
  CHECK(pow(1.0F, kMax) == 1.0F);
  CHECK(pow(0.5F, kInf) == 0.0F);
  CHECK(pow(0.5F, -kInf) == kInf);
  CHECK(pow(3.0F, kMax) == kInf);
  CHECK(pow(3.0F, -kMax) == 0.0F);
  CHECK(is_quiet_nan(pow(-1.0F, 2.0F)));
  CHECK(is_quiet_nan(pow(kNan, 0.0F)));
  CHECK(is_quiet_nan(pow(0.0F, kNan)));
  CHECK(is_quiet_nan(pow(2.0F, -kNan)));
}

TEST_CASE("the bits of every function are those of every other instruction set with a fused fma") {
  // FNV-1a over the results for a fixed set of arguments. One number for AVX2, AVX-512, NEON64 and the forced one-lane
  // build with any compiler, another for plain SSE2, whose fma rounds twice.
  std::uint64_t hash = 0xCBF29CE484222325U;
  const auto add = [&hash](Native v) {
    for (int i = 0; i < Native::lanes; ++i) {
      for (unsigned shift = 0; shift < 32; shift += 8) {
        hash = (hash ^ ((bits_of(v.lane(i)) >> shift) & 0xFFU)) * 0x100000001B3U;
      }
    }
  };
  constexpr std::uint32_t kCount = 4096;  // a multiple of every number of lanes
  const auto add_all = [&add](auto f) {
    for (std::uint32_t i = 0; i < kCount; i += static_cast<std::uint32_t>(Native::lanes)) {
      float in[Native::lanes];
      for (std::uint32_t l = 0; l < static_cast<std::uint32_t>(Native::lanes); ++l) {
        in[l] = float_of((i + l) * (0xFFFFFFFFU / kCount) + 12345U);
      }
      add(f(Native::load(in)));
    }
  };
  add_all([](Native x) { return simd::exp(x); });
  add_all([](Native x) { return simd::exp2(x); });
  add_all([](Native x) { return simd::log(x); });
  add_all([](Native x) { return simd::log2(x); });
  add_all([](Native x) { return simd::cbrt(x); });
  add_all([](Native x) { return simd::pow(x, Native(2.4F)); });
  add_all([](Native x) { return simd::pow(Native(1.7F), x); });
  CHECK(hash == (simd::kFusedFma ? 0xE2B1E42C8343768EU : 0x9E91D07A26E85532U));
}
