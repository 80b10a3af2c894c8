// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cstddef>

#include "npsim/simd/batch.hpp"
#include "npsim/simd/block.hpp"
#include "npsim/simd/scalar.hpp"

namespace {

template <class F>
void check_blocks() {
  float image[7 * 9];
  for (std::size_t i = 0; i < 63; ++i) image[i] = static_cast<float>(i * i);
  for (int part = 0; part < npsim::simd::kBlockElements / F::lanes; ++part) {
    const F block = npsim::simd::load_block<F>(image + 11, 9, part);
    for (int lane = 0; lane < F::lanes; ++lane) {
      const int k = part * F::lanes + lane;
      CHECK(block.lane(lane) == image[11 + 9 * (k / 4) + k % 4]);
      CHECK(npsim::simd::block_columns<F>(part).lane(lane) == static_cast<float>(k % 4));
      CHECK(npsim::simd::block_rows<F>(part).lane(lane) == static_cast<float>(k / 4));
    }
  }
}

}  // namespace

TEST_CASE("simd block: the elements of 4x4 pixels in raster order, for any number of lanes") {
  check_blocks<npsim::simd::F32>();
  check_blocks<npsim::simd::scalar::F32>();
}
