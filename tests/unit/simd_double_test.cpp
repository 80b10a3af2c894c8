// SPDX-License-Identifier: Apache-2.0
// Batches of doubles against single ones, bit by bit.
#include <doctest/doctest.h>

#include <cmath>
#include <cstring>

#include "npsim/core/random.hpp"
#include "npsim/simd/fixed.hpp"

namespace simd = npsim::simd;

TEST_CASE("simd::Double: arithmetic, loads and stores of doubles and floats give the bits of one lane") {
  using D = simd::Double<simd::F32>;
  using One = simd::Double<simd::scalar::F32>;
  constexpr int kLanes = D::lanes;
  int inexact = 0;
  for (std::uint32_t round = 0; round < 2000; ++round) {
    npsim::RandomStream random(1, npsim::RandomPurpose::test, 0, 0, round, 0);
    double in[3][kLanes];
    float narrow[kLanes];
    for (int i = 0; i < kLanes; ++i) {
      for (auto& row : in) {
        const double low = 1e-9 * static_cast<double>(random.uniform());
        row[i] = std::ldexp(static_cast<double>(random.uniform(-2.0F, 2.0F)) + low, static_cast<int>(round % 61) - 30);
      }
      narrow[i] = random.uniform(-1e6F, 1e6F);
    }
    const D a = D::load(in[0]);
    const D b = D::load(in[1]);
    const D c = D::load(in[2]);
    const D results[] = {a + b, a - b, a * b, fma(a, b, c), D::load(narrow), D(in[0][0])};
    for (int k = 0; k < 6; ++k) {
      double wide[kLanes];
      float stored[kLanes];
      results[k].store(wide);
      results[k].store(stored);
      for (int i = 0; i < kLanes; ++i) {
        const One x = One::load(in[0] + i);
        const One y = One::load(in[1] + i);
        const One z = One::load(in[2] + i);
        const One expected[] = {x + y, x - y, x * y, fma(x, y, z), One::load(narrow + i), One(in[0][0])};
        CHECK(std::memcmp(&wide[i], &expected[k].value, sizeof(double)) == 0);
        float one = 0;
        expected[k].store(&one);
        CHECK(std::memcmp(&stored[i], &one, sizeof(float)) == 0);
        inexact += static_cast<double>(one) != wide[i] ? 1 : 0;
      }
    }
  }
  CHECK(inexact > 1000);
}
