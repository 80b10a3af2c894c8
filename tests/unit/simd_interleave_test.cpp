// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cstddef>
#include <vector>

#include "npsim/simd/batch.hpp"

using namespace npsim;

TEST_CASE_TEMPLATE("even and odd lanes take a row of two batches apart, interleaving puts it together", F, simd::F32,
                   simd::scalar::F32) {
  constexpr int kLanes = F::lanes;
  std::vector<float> row(2 * static_cast<std::size_t>(kLanes));
  for (std::size_t i = 0; i < row.size(); ++i) row[i] = static_cast<float>(i) - 3.5F;
  const F a = F::load(row.data());
  const F b = F::load(row.data() + kLanes);
  const F even = even_lanes(a, b);
  const F odd = odd_lanes(a, b);
  for (int i = 0; i < kLanes; ++i) {
    CHECK(even.lane(i) == row[static_cast<std::size_t>(2 * i)]);
    CHECK(odd.lane(i) == row[static_cast<std::size_t>(2 * i + 1)]);
  }
  const F low = interleave_low(even, odd);
  const F high = interleave_high(even, odd);
  for (int i = 0; i < kLanes; ++i) {
    CHECK(low.lane(i) == a.lane(i));
    CHECK(high.lane(i) == b.lane(i));
  }
}
