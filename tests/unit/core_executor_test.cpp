// SPDX-License-Identifier: Apache-2.0
#include "npsim/core/executor.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <utility>
#include <vector>

namespace {

using Chunks = std::vector<std::pair<std::size_t, std::size_t>>;

Chunks chunks_of(std::size_t count, std::size_t chunk) {
  Chunks chunks;
  const npsim::SerialExecutor executor;
  executor.for_chunks(count, chunk, [&](std::size_t begin, std::size_t end) { chunks.emplace_back(begin, end); });
  return chunks;
}

}  // namespace

TEST_CASE("chunks cover the range in order, each element once, only the last is shorter") {
  for (std::size_t count = 0; count < 40; ++count) {
    for (std::size_t chunk = 0; chunk < 45; ++chunk) {
      const std::size_t step = chunk == 0 ? 1 : chunk;
      const Chunks chunks = chunks_of(count, chunk);
      REQUIRE(chunks.size() == npsim::chunk_count(count, chunk));
      std::size_t expected = 0;
      for (std::size_t i = 0; i < chunks.size(); ++i) {
        REQUIRE(chunks[i].first == expected);
        REQUIRE(chunks[i].first / step == i);
        REQUIRE((chunks[i].second - chunks[i].first == step || (i + 1 == chunks.size() && chunks[i].second == count)));
        expected = chunks[i].second;
      }
      REQUIRE(expected == count);
    }
  }
}

TEST_CASE("counts near the largest number do not wrap round") {
  constexpr std::size_t kMax = ~std::size_t{0};
  constexpr std::size_t kHalf = kMax / 2 + 1;
  CHECK(chunks_of(kMax, kHalf) == Chunks{{0, kHalf}, {kHalf, kMax}});
  CHECK(chunks_of(kMax, kMax) == Chunks{{0, kMax}});
  CHECK(chunks_of(5, kMax) == Chunks{{0, 5}});
  static_assert(npsim::chunk_count(kMax, kMax) == 1);
  static_assert(npsim::chunk_count(kMax, 2) == kHalf);
  static_assert(npsim::chunk_count(kMax, 1) == kMax);
}
