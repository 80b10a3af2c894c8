// SPDX-License-Identifier: Apache-2.0
// The native batch against the one-lane batch, bit by bit, and both against the rules stated in simd/batch.hpp.
#include <doctest/doctest.h>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "npsim/core/random.hpp"
#include "npsim/simd/batch.hpp"

namespace {

namespace simd = npsim::simd;
using Native = simd::F32;
using NativeInt = simd::I32;
using One = simd::scalar::F32;
using OneInt = simd::scalar::I32;
constexpr int kLanes = Native::lanes;
constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr std::int32_t kMaxInt = std::numeric_limits<std::int32_t>::max();
constexpr std::int32_t kMinInt = std::numeric_limits<std::int32_t>::min();

std::uint32_t bits_of(float x) {
  std::uint32_t u = 0;
  std::memcpy(&u, &x, sizeof(u));
  return u;
}

float float_of(std::uint32_t u) {
  float x = 0;
  std::memcpy(&x, &u, sizeof(x));
  return x;
}

// Equal bits, or both a NaN (whose sign and payload arithmetic leaves open).
bool same(float a, float b) { return bits_of(a) == bits_of(b) || (std::isnan(a) && std::isnan(b)); }

npsim::RandomStream stream(std::uint32_t sample) { return {7, npsim::RandomPurpose::test, 0, 0, 0, sample}; }

// Random bit patterns with the awkward values mixed in: all exponents, signs, NaNs.
std::vector<float> awkward_floats(std::uint32_t sample, std::size_t random_count) {
  std::vector<float> v = {0.0F,
                          -0.0F,
                          1.0F,
                          -1.0F,
                          0.5F,
                          -0.5F,
                          1.5F,
                          -1.5F,
                          2.5F,
                          -2.5F,
                          kInf,
                          -kInf,
                          kNan,
                          1e-45F,
                          -1e-45F,
                          1e-39F,
                          -1e-39F,
                          1.17549435e-38F,
                          3.4028235e38F,
                          -3.4028235e38F,
                          0x1p23F,
                          0x1p23F - 0.5F,
                          -0x1p23F + 0.5F,
                          0x1p22F + 0.5F,
                          0x1p31F,
                          -0x1p31F,
                          0x1p31F - 128.0F,
                          -0x1p31F - 256.0F,
                          4e9F,
                          -4e9F,
                          0.49999997F,
                          -0.49999997F,
                          0.9999999F,
                          8388609.0F,
                          3.0F,
                          0x1p32F};
  npsim::RandomStream random = stream(sample);
  for (std::size_t i = 0; i < random_count && i < 240; ++i) v.push_back(float_of(random.next_u32()));
  for (std::size_t i = 240; i < random_count; ++i) v.push_back(random.uniform(-8.0F, 8.0F));
  while (v.size() % simd::kMaxLanes != 0) v.push_back(0.25F);
  return v;
}

// Applies `f` to batches of both kinds, pairing the values with those shifted by `shift`, and counts differing lanes.
template <class Function>
int differences(const std::vector<float>& v, std::size_t shift, Function f) {
  const auto lanes = static_cast<std::size_t>(kLanes);
  std::vector<float> w(v.size());
  for (std::size_t i = 0; i < v.size(); ++i) w[i] = v[(i + shift) % v.size()];
  int count = 0;
  for (std::size_t i = 0; i + lanes <= v.size(); i += lanes) {
    float out[kLanes];
    f(Native::load(&v[i]), Native::load(&w[i])).store(out);
    for (std::size_t l = 0; l < lanes; ++l) {
      float one = 0;
      f(One(v[i + l]), One(w[i + l])).store(&one);
      if (!same(out[l], one)) {
        ++count;
        if (count <= 3) MESSAGE(v[i + l] << ' ' << w[i + l] << " -> " << out[l] << " not " << one);
      }
    }
  }
  return count;
}

template <class F>
F as_float(typename F::MaskType m) {
  return select(m, F(1.0F), F(0.0F));
}

// clang-format off
struct Add { template <class F> F operator()(F a, F b) const { return a + b; } };
struct Subtract { template <class F> F operator()(F a, F b) const { return a - b; } };
struct Multiply { template <class F> F operator()(F a, F b) const { return a * b; } };
struct Divide { template <class F> F operator()(F a, F b) const { return a / b; } };
struct Negate { template <class F> F operator()(F a, F) const { return -a; } };
struct Min { template <class F> F operator()(F a, F b) const { return min(a, b); } };
struct Max { template <class F> F operator()(F a, F b) const { return max(a, b); } };
struct Fma { template <class F> F operator()(F a, F b) const { return fma(a, b, a - 1.0F); } };
struct Fnma { template <class F> F operator()(F a, F b) const { return fnma(a, b, a - 1.0F); } };
struct Abs { template <class F> F operator()(F a, F) const { return abs(a); } };
struct Sqrt { template <class F> F operator()(F a, F) const { return sqrt(a); } };
struct Floor { template <class F> F operator()(F a, F) const { return floor(a); } };
struct Round { template <class F> F operator()(F a, F) const { return round_even(a); } };
struct ScaleByFloor { template <class F> F operator()(F a, F b) const { return scale_by_floor(simd::copysign(simd::clamp(abs(b), 0.5F, 4.0F), b), select(simd::is_finite(a), a, F(0.5F))); } };
struct CopySign { template <class F> F operator()(F a, F b) const { return simd::copysign(a, b); } };
struct Truncate { template <class F> F operator()(F a, F) const { return bitcast_float(trunc_to_int(a)); } };
struct FromInt { template <class F> F operator()(F a, F) const { return to_float(bitcast_int(a)); } };
struct Equal { template <class F> F operator()(F a, F b) const { return as_float<F>(a == b); } };
struct NotEqual { template <class F> F operator()(F a, F b) const { return as_float<F>(a != b); } };
struct Less { template <class F> F operator()(F a, F b) const { return as_float<F>(a < b); } };
struct Greater { template <class F> F operator()(F a, F b) const { return as_float<F>(a > b); } };
struct LessEqual { template <class F> F operator()(F a, F b) const { return as_float<F>(a <= b); } };
struct GreaterEqual { template <class F> F operator()(F a, F b) const { return as_float<F>(a >= b); } };
struct Finite { template <class F> F operator()(F a, F) const { return as_float<F>(simd::is_finite(a)); } };
struct ProductError { template <class F> F operator()(F a, F b) const { return simd::two_product(simd::clamp(a, -8.0F, 8.0F), simd::clamp(b, -8.0F, 8.0F)).lo; } };
struct SumError { template <class F> F operator()(F a, F b) const { return simd::two_sum(a, b).lo; } };
// Integer operations, on the bit patterns.
template <class F> typename F::Int in(F a) { return bitcast_int(a); }
struct IntAdd { template <class F> F operator()(F a, F b) const { return to_float(in(a) + in(b)); } };
struct IntSubtract { template <class F> F operator()(F a, F b) const { return to_float(in(a) - in(b)); } };
struct IntMultiply { template <class F> F operator()(F a, F b) const { return to_float(in(a) * in(b)); } };
struct IntNegate { template <class F> F operator()(F a, F) const { return to_float(-in(a)); } };
struct IntAnd { template <class F> F operator()(F a, F b) const { return to_float(in(a) & in(b)); } };
struct IntOr { template <class F> F operator()(F a, F b) const { return to_float(in(a) | in(b)); } };
struct IntXor { template <class F> F operator()(F a, F b) const { return to_float(in(a) ^ in(b)); } };
struct IntNot { template <class F> F operator()(F a, F) const { return to_float(~in(a)); } };
struct IntLeft { int n; template <class F> F operator()(F a, F) const { return to_float(in(a) << n); } };
struct IntRight { int n; template <class F> F operator()(F a, F) const { return to_float(in(a) >> n); } };
struct IntMin { template <class F> F operator()(F a, F b) const { return to_float(min(in(a), in(b))); } };
struct IntMax { template <class F> F operator()(F a, F b) const { return to_float(max(in(a), in(b))); } };
struct IntEqual { template <class F> F operator()(F a, F b) const { return as_float<F>(in(a) == in(b)); } };
struct IntNotEqual { template <class F> F operator()(F a, F b) const { return as_float<F>(in(a) != in(b)); } };
struct IntLess { template <class F> F operator()(F a, F b) const { return as_float<F>(in(a) < in(b)); } };
struct IntGreater { template <class F> F operator()(F a, F b) const { return as_float<F>(in(a) > in(b)); } };
struct IntLessEqual { template <class F> F operator()(F a, F b) const { return as_float<F>(in(a) <= in(b)); } };
struct IntGreaterEqual { template <class F> F operator()(F a, F b) const { return as_float<F>(in(a) >= in(b)); } };
// clang-format on

template <class... Functions>
void check_all(const std::vector<float>& v, std::size_t shift, Functions... functions) {
  int index = 0;
  const auto check = [&](auto f) {
    CAPTURE(shift);
    CAPTURE(index);
    CHECK(differences(v, shift, f) == 0);
    ++index;
  };
  (check(functions), ...);
}

}  // namespace

TEST_CASE("every operation has the same bits in the native and the one-lane batch") {
  const std::vector<float> v = awkward_floats(1, 600);
  for (const std::size_t shift : {std::size_t{0}, std::size_t{1}, std::size_t{2}, std::size_t{7}, std::size_t{12},
                                  std::size_t{101}, std::size_t{333}}) {
    check_all(v, shift, Add{}, Subtract{}, Multiply{}, Divide{}, Negate{}, Min{}, Max{}, Fma{}, Fnma{}, Abs{}, Sqrt{},
              Floor{}, Round{}, CopySign{}, ScaleByFloor{}, Truncate{}, FromInt{}, Equal{}, NotEqual{}, Less{},
              Greater{}, LessEqual{}, GreaterEqual{}, Finite{}, ProductError{}, SumError{});
    check_all(v, shift, IntAdd{}, IntSubtract{}, IntMultiply{}, IntNegate{}, IntAnd{}, IntOr{}, IntXor{}, IntNot{},
              IntLeft{1}, IntLeft{31}, IntRight{1}, IntRight{31}, IntMin{}, IntMax{}, IntEqual{}, IntNotEqual{}, IntLess{}, IntGreater{},
              IntLessEqual{}, IntGreaterEqual{});
  }
}

TEST_CASE_TEMPLATE("a NaN follows the stated rule in min, max, clamp and comparisons", F, Native, One) {
  const F nan(kNan);
  const F one(1.0F);
  CHECK(min(nan, one).lane(0) == 1.0F);
  CHECK(max(nan, one).lane(0) == 1.0F);
  CHECK(std::isnan(min(one, nan).lane(F::lanes - 1)));
  CHECK(std::isnan(max(one, nan).lane(F::lanes - 1)));
  CHECK(std::signbit(min(F(0.0F), F(-0.0F)).lane(0)));
  CHECK_FALSE(std::signbit(min(F(-0.0F), F(0.0F)).lane(0)));
  CHECK(simd::clamp(nan, 0.25F, 0.5F).lane(0) == 0.25F);
  CHECK(all(nan != nan));
  CHECK(none(nan == nan));
  CHECK(none((nan < one) | (nan > one) | (nan <= one) | (nan >= one)));
  CHECK(all(simd::is_nan(nan)));
  CHECK(none(simd::is_nan(one)));
  CHECK(none(simd::is_finite(nan) | simd::is_finite(F(kInf)) | simd::is_finite(F(-kInf))));
  CHECK(bits_of(simd::quiet_nan<F>().lane(0)) == 0x7FC00000U);
}

TEST_CASE_TEMPLATE("scale_by_floor rounds once, down to the denormals", F, Native, One) {
  const auto scaled = [](float y, float x) { return scale_by_floor(F(y), F(x)).lane(0); };
  CHECK(scaled(1.5F, 3.99F) == 12.0F);
  CHECK(scaled(-1.5F, -0.01F) == -0.75F);
  CHECK(scaled(1.0F, -149.0F) == 1e-45F);
  CHECK(scaled(1.75F, -149.5F) == 1e-45F);  // 0.875 of the smallest float: rounded once, not cut
  CHECK(scaled(1.0F, -1e30F) == 0.0F);
  CHECK(scaled(1.0F, 128.0F) == kInf);
}

TEST_CASE_TEMPLATE("division and square root are correctly rounded where estimates fail", F, Native, One) {
  CHECK((F(1.0F) / F(1e-39F)).lane(0) == kInf);
  CHECK((F(1.0F) / F(-0.0F)).lane(0) == -kInf);
  CHECK(sqrt(F(kInf)).lane(0) == kInf);
  CHECK(bits_of(sqrt(F(-0.0F)).lane(0)) == 0x80000000U);
  CHECK(std::isnan(sqrt(F(-1.0F)).lane(0)));
  npsim::RandomStream random = stream(2);
  for (int i = 0; i < 20000; ++i) {
    const float a = float_of(random.next_u32() & 0x7F7FFFFFU);
    const float b = float_of(random.next_u32() & 0x7F7FFFFFU);
    // The exact quotient and root, rounded to double and then to float, are the correctly rounded floats: double has
    // more than twice the digits (except for a denormal quotient, which is left out).
    const float quotient = static_cast<float>(static_cast<double>(a) / static_cast<double>(b));
    if (quotient >= std::numeric_limits<float>::min() || quotient == 0.0F) {
      CHECK((F(a) / F(b)).lane(0) == quotient);
    }
    CHECK(sqrt(F(a)).lane(0) == static_cast<float>(std::sqrt(static_cast<double>(a))));
  }
}

TEST_CASE_TEMPLATE("negation flips the sign of zero and keeps denormals", F, Native, One) {
  CHECK(bits_of((-F(0.0F)).lane(0)) == 0x80000000U);
  CHECK(bits_of((-F(-0.0F)).lane(0)) == 0U);
  CHECK((F(1e-45F) + F(1e-45F)).lane(0) > 0.0F);
  CHECK((F(1.17549435e-38F) * F(0.5F)).lane(0) == 0x1p-127F);
}

TEST_CASE_TEMPLATE("fma rounds once where it says so", F, Native, One) {
  // (1 + 2^-12)^2 - (1 + 2^-11) is 2^-24 exactly; two roundings lose it.
  const F x(1.0F + 0x1p-12F);
  CHECK(fma(x, x, F(-1.0F - 0x1p-11F)).lane(0) == (simd::kFusedFma ? 0x1p-24F : 0.0F));
  CHECK(fnma(x, x, F(1.0F + 0x1p-11F)).lane(0) == (simd::kFusedFma ? -0x1p-24F : 0.0F));
  CHECK(simd::two_product(x, x).lo.lane(0) == 0x1p-24F);
  CHECK(simd::two_product(x, x).hi.lane(0) == 1.0F + 0x1p-11F);
}

TEST_CASE_TEMPLATE("conversion to int saturates and rounds half to even", F, Native, One) {
  const auto cut = [](float x) { return trunc_to_int(F(x)).lane(F::lanes - 1); };
  CHECK(cut(2.9F) == 2);
  CHECK(cut(-2.9F) == -2);
  CHECK(cut(0x1p31F) == kMaxInt);
  CHECK(cut(0x1p31F - 128.0F) == kMaxInt - 127);
  CHECK(cut(-0x1p31F) == kMinInt);
  CHECK(cut(kInf) == kMaxInt);
  CHECK(cut(-kInf) == kMinInt);
  CHECK(cut(kNan) == 0);
  CHECK(simd::round_to_int(F(2.5F)).lane(0) == 2);
  CHECK(simd::round_to_int(F(3.5F)).lane(0) == 4);
  CHECK(simd::round_to_int(F(-2.5F)).lane(0) == -2);
  CHECK(bits_of(round_even(F(-0.25F)).lane(0)) == 0x80000000U);
  CHECK(floor(F(-0.25F)).lane(0) == -1.0F);
  CHECK(floor(F(8388607.5F)).lane(0) == 8388607.0F);
  CHECK(to_float(typename F::Int(16777217)).lane(0) == 16777216.0F);
}

TEST_CASE("floor and round agree with the library on every binade") {
  for (std::uint32_t u = 0; u < 0xFF800000U; u += 0x1237U) {
    const float x = float_of(u);
    if (!std::isfinite(x)) continue;
    REQUIRE(bits_of(floor(Native(x)).lane(0)) == bits_of(std::floor(x)));
    REQUIRE(bits_of(round_even(Native(x)).lane(0)) == bits_of(std::nearbyint(x)));
  }
}

TEST_CASE("partial loads and stores stay inside n elements") {
  std::vector<float> all_floats;
  std::vector<std::int32_t> all_ints;
  std::vector<std::uint8_t> all_bytes;
  std::vector<std::uint16_t> all_shorts;
  for (int i = 0; i < kLanes; ++i) {
    all_floats.push_back(static_cast<float>(i) + 1.5F);
    all_ints.push_back(-i - 1);
    all_bytes.push_back(static_cast<std::uint8_t>(255 - i));
    all_shorts.push_back(static_cast<std::uint16_t>(65535 - i));
  }
  for (int n = 0; n <= kLanes; ++n) {
    // Exactly n elements on the heap: the address sanitizer sees a touch of the next one.
    const auto count = static_cast<std::size_t>(n);
    std::vector<float> in_floats(all_floats.begin(), all_floats.begin() + n);
    std::vector<std::int32_t> in_ints(all_ints.begin(), all_ints.begin() + n);
    std::vector<std::uint8_t> in_bytes(all_bytes.begin(), all_bytes.begin() + n);
    std::vector<std::uint16_t> in_shorts(all_shorts.begin(), all_shorts.begin() + n);
    const Native floats = Native::load(in_floats.data(), n);
    const NativeInt ints = NativeInt::load(in_ints.data(), n);
    const NativeInt bytes = NativeInt::load_u8(in_bytes.data(), n);
    const NativeInt shorts = NativeInt::load_u16(in_shorts.data(), n);
    const simd::Mask first = simd::Mask::first(n);
    CHECK(bits(first) == (1U << static_cast<unsigned>(n)) - 1U);
    CHECK(all(first) == (n == kLanes));
    CHECK(none(first) == (n == 0));
    CHECK(any(first) == (n != 0));
    for (int i = 0; i < kLanes; ++i) {
      CHECK(floats.lane(i) == (i < n ? static_cast<float>(i) + 1.5F : 0.0F));
      CHECK(ints.lane(i) == (i < n ? -i - 1 : 0));
      CHECK(bytes.lane(i) == (i < n ? 255 - i : 0));
      CHECK(shorts.lane(i) == (i < n ? 65535 - i : 0));
      CHECK(first.lane(i) == (i < n));
    }
    std::vector<float> out_floats(count);
    std::vector<std::int32_t> out_ints(count);
    floats.store(out_floats.data(), n);
    ints.store(out_ints.data(), n);
    CHECK(out_floats == in_floats);
    CHECK(out_ints == in_ints);
    // Nothing behind the n elements changes.
    float guarded[kLanes + 1];
    for (float& g : guarded) g = -7.0F;
    Native(3.0F).store(guarded, n);
    for (int i = 0; i <= kLanes; ++i) CHECK(guarded[i] == (i < n ? 3.0F : -7.0F));
    std::vector<float> triples(3 * count);
    for (std::size_t i = 0; i < triples.size(); ++i) triples[i] = static_cast<float>(i);
    const simd::F32x3<Native> v = simd::load3<Native>(triples.data(), n);
    for (int i = 0; i < kLanes; ++i) CHECK(v.z.lane(i) == (i < n ? static_cast<float>(3 * i + 2) : 0.0F));
    std::vector<float> back(3 * count);
    simd::store3(back.data(), v, n);
    CHECK(back == triples);
  }
}

TEST_CASE("full loads need no alignment and widen without sign") {
  std::vector<std::uint8_t> bytes(64);
  std::vector<std::uint16_t> shorts(64);
  std::vector<float> floats(64);
  for (std::size_t i = 0; i < 64; ++i) {
    bytes[i] = static_cast<std::uint8_t>(200 + i);
    shorts[i] = static_cast<std::uint16_t>(65000 + i);
    floats[i] = static_cast<float>(i);
  }
  for (std::size_t offset = 0; offset < 4; ++offset) {
    float out[kLanes + 4];
    Native::load(floats.data() + offset).store(out + offset);
    for (int i = 0; i < kLanes; ++i) {
      const auto at = offset + static_cast<std::size_t>(i);
      CHECK(out[at] == floats[at]);
      CHECK(NativeInt::load_u8(bytes.data() + offset).lane(i) == bytes[at]);
      CHECK(NativeInt::load_u16(shorts.data() + offset).lane(i) == shorts[at]);
    }
  }
  for (int i = 0; i < kLanes; ++i) {
    CHECK(Native::iota().lane(i) == static_cast<float>(i));
    CHECK(NativeInt::iota().lane(i) == i);
  }
}

TEST_CASE_TEMPLATE("slide_up gives every lane its left neighbour, across batches too", F, Native, One) {
  std::vector<float> row(3 * static_cast<std::size_t>(F::lanes));
  for (std::size_t i = 0; i < row.size(); ++i) row[i] = static_cast<float>(i) + 0.5F;
  row[1] = -0.0F;
  F previous(-7.0F);
  for (std::size_t x = 0; x < row.size(); x += static_cast<std::size_t>(F::lanes)) {
    const F current = F::load(&row[x]);
    const F left = slide_up(previous, current);
    for (std::size_t i = 0; i < static_cast<std::size_t>(F::lanes); ++i) {
      CHECK(bits_of(left.lane(static_cast<int>(i))) == bits_of(x + i == 0 ? -7.0F : row[x + i - 1]));
    }
    previous = current;
  }
}

TEST_CASE("masks select, combine and gather lane by lane") {
  const std::vector<float> table = {10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25};
  const std::vector<std::int32_t> int_table = {5, 4, 3, 2, 1, 0, -1, -2, -3, -4, -5, -6, -7, -8, -9, -10};
  const NativeInt index = NativeInt(kLanes - 1) - NativeInt::iota();
  const simd::Mask odd = (NativeInt::iota() & NativeInt(1)) == NativeInt(1);
  const Native reversed = Native::gather(table.data(), index);
  const NativeInt reversed_int = NativeInt::gather(int_table.data(), index);
  // Indices of the lanes outside the mask may point anywhere.
  const NativeInt wild = select(odd, index, NativeInt(kMaxInt));
  const Native masked = Native::gather(table.data(), wild, odd, Native(-1.0F));
  const simd::Mask low = NativeInt::iota() < NativeInt(2);
  for (int i = 0; i < kLanes; ++i) {
    const bool is_odd = i % 2 == 1;
    const auto from = static_cast<std::size_t>(kLanes - 1 - i);
    CHECK(reversed.lane(i) == table[from]);
    CHECK(reversed_int.lane(i) == int_table[from]);
    CHECK(masked.lane(i) == (is_odd ? table[from] : -1.0F));
    CHECK((odd & low).lane(i) == (is_odd && i < 2));
    CHECK((odd | low).lane(i) == (is_odd || i < 2));
    CHECK((odd ^ low).lane(i) == (is_odd != (i < 2)));
    CHECK((~odd).lane(i) == !is_odd);
    CHECK(select(odd, NativeInt(kMinInt), NativeInt::iota()).lane(i) == (is_odd ? kMinInt : i));
  }
  CHECK(all(simd::Mask(true)));
  CHECK(none(simd::Mask(false)));
  CHECK(bits(~simd::Mask(false)) == (1U << static_cast<unsigned>(kLanes)) - 1U);
}

TEST_CASE_TEMPLATE("sums and products split exactly", F, Native, One) {
  npsim::RandomStream random = stream(3);
  for (int i = 0; i < 2000; ++i) {
    const float a = random.uniform(-100.0F, 100.0F);
    const float b = random.uniform(-1.0F, 1.0F);
    const auto product = simd::two_product(F(a), F(b));
    CHECK(static_cast<double>(product.hi.lane(0)) + static_cast<double>(product.lo.lane(0)) ==
          static_cast<double>(a) * static_cast<double>(b));
    const auto sum = simd::two_sum(F(a), F(b));
    CHECK(static_cast<double>(sum.hi.lane(0)) + static_cast<double>(sum.lo.lane(0)) ==
          static_cast<double>(a) + static_cast<double>(b));
  }
}
