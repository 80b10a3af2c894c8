// SPDX-License-Identifier: Apache-2.0
// Fixed<N> against single floats: the same bits in every lane, whatever registers there are.
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "npsim/core/bits.hpp"
#include "npsim/core/random.hpp"
#include "npsim/simd/fixed.hpp"

namespace {

namespace simd = npsim::simd;
using One = simd::Fixed<1>;

bool same(float a, float b) { return (std::isnan(a) && std::isnan(b)) || std::memcmp(&a, &b, sizeof a) == 0; }

template <unsigned N>
void compare_lanes() {
  CAPTURE(N);
  const float inf = std::numeric_limits<float>::infinity();
  const float odd[] = {0.0F, -0.0F, 1.0F, -1.0F, inf, -inf, std::numeric_limits<float>::quiet_NaN(), 1e-40F, 0x1p60F};
  for (std::uint32_t round = 0; round < 2000; ++round) {
    float a[N];
    float b[N];
    float c[N];
    for (std::uint32_t i = 0; i < N; ++i) {
      npsim::RandomStream random(1, npsim::RandomPurpose::test, 0, 0, round * 16 + i, 0);
      const auto draw = [&] {
        const std::uint32_t kind = random.next_u32();
        return kind % 4 == 0 ? odd[kind / 4 % 9] : random.uniform(-8.0F, 8.0F);
      };
      a[i] = draw();
      b[i] = draw();
      c[i] = draw();
    }
    using F = simd::Fixed<N>;
    const F fa = F::load(a);
    const F fb = F::load(b);
    const F fc = F::load(c);
    const F results[] = {fa + fb,         fa - fb,     fa * fb,     fa / fb,    -fa,
                         fma(fa, fb, fc), min(fa, fb), max(fa, fb), F(a[N - 1])};
    const std::uint32_t bits[] = {less(fa, fb), less_equal(fa, fb), equal(fa, fb)};
    std::int32_t truncated[N];
    float bounded[N];
    for (std::uint32_t i = 0; i < N; ++i) bounded[i] = std::fabs(a[i]) < 100.0F ? 10.0F * a[i] : 0.0F;
    F::load(bounded).store_truncated(truncated);
    for (std::uint32_t i = 0; i < N; ++i) {
      const One x(a[i]);
      const One y(b[i]);
      const One z(c[i]);
      const One expected[] = {x + y, x - y, x * y, x / y, -x, fma(x, y, z), min(x, y), max(x, y), One(a[N - 1])};
      for (int k = 0; k < 9; ++k) {
        float all[N];
        results[k].store(all);
        CAPTURE(k);
        CHECK(same(all[i], expected[k].value));
        CHECK(same(results[k].lane(static_cast<int>(i)), expected[k].value));
      }
      CHECK(((bits[0] >> i) & 1U) == (a[i] < b[i] ? 1U : 0U));
      CHECK(((bits[1] >> i) & 1U) == (a[i] <= b[i] ? 1U : 0U));
      CHECK(((bits[2] >> i) & 1U) == (a[i] == b[i] ? 1U : 0U));
      CHECK(truncated[i] == static_cast<std::int32_t>(bounded[i]));
    }
    for (const std::uint32_t m : bits) CHECK((std::uint64_t{m} >> N) == 0);
    if constexpr (N > 1) {
      float swapped[N];
      halves_swapped(fa).store(swapped);
      for (std::uint32_t i = 0; i < N; ++i) CHECK(same(swapped[i], a[(i + N / 2) % N]));
    }
  }
}

}  // namespace

TEST_CASE("simd fixed: every width gives the bits of single floats") {
  compare_lanes<1>();
  compare_lanes<2>();
  compare_lanes<4>();
  compare_lanes<8>();
  compare_lanes<16>();
}

TEST_CASE("simd fixed: min and max keep their second operand with a NaN") {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  using F = simd::Fixed<8>;
  CHECK(min(F(nan), F(1.0F)).lane(3) == 1.0F);
  CHECK(max(F(nan), F(1.0F)).lane(3) == 1.0F);
  CHECK(std::isnan(min(F(1.0F), F(nan)).lane(7)));
  CHECK(std::signbit(max(F(0.0F), F(-0.0F)).lane(0)));
}

TEST_CASE("simd fixed: the lowest bit of a comparison") {
  for (int i = 0; i < 32; ++i) {
    CHECK(npsim::lowest_set_bit(1U << static_cast<unsigned>(i)) == i);
    CHECK(npsim::lowest_set_bit(~0U << static_cast<unsigned>(i)) == i);
  }
}
