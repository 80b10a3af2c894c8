// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cstddef>

#include "npsim/simd/batch.hpp"
#include "npsim/simd/detail/scalar.hpp"

namespace {

template <class F>
void check_blocks() {
  float image[5 * 23];
  for (std::size_t i = 0; i < 115; ++i) image[i] = static_cast<float>(i * i);
  for (int part = 0; part < npsim::simd::kBlockElements / F::lanes; ++part) {
    F columns[4];
    npsim::simd::load_columns<F>(image + 7, 23, part, columns);
    for (int lane = 0; lane < F::lanes; ++lane) {
      const int k = part * F::lanes + lane;
      for (int i = 0; i < 4; ++i) CHECK(columns[i].lane(lane) == image[7 + 23 * (k / 4) + 4 * (k % 4) + i]);
      CHECK(npsim::simd::block_columns<F>(part).lane(lane) == static_cast<float>(k % 4));
      CHECK(npsim::simd::block_rows<F>(part).lane(lane) == static_cast<float>(k / 4));
    }
  }
}

}  // namespace

TEST_CASE("simd block: columns of 4x4 blocks, and the places of 16 elements in raster order, for any number of lanes") {
  check_blocks<npsim::simd::F32>();
  check_blocks<npsim::simd::scalar::F32>();
}
