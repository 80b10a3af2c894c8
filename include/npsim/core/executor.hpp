// SPDX-License-Identifier: Apache-2.0
// The executor concept, the serial executor, and the common way to go over the rows of an image.
//
// An executor E offers  e.for_chunks(count, chunk, f)  which calls f(begin, end) for [0, chunk), [chunk, 2 chunk), ...
// up to count, each exactly once, in any order and on any thread, and returns when all calls have returned.
// Contract: the chunk size never depends on the number of threads, f does not throw, and a reduction writes one
// partial result per chunk (index begin / chunk) and combines them in chunk order. Hence the same bits for any
// thread count. A thread pool stands in exec/; the core has none.
#ifndef NPSIM_CORE_EXECUTOR_HPP
#define NPSIM_CORE_EXECUTOR_HPP

#include <cstddef>

#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct SerialExecutor {
  template <class F>
  void for_chunks(std::size_t count, std::size_t chunk, F&& f) const {
    const std::size_t step = chunk == 0 ? 1 : chunk;
    for (std::size_t begin = 0; begin < count;) {
      const std::size_t end = count - begin < step ? count : begin + step;  // begin + step could wrap past the last
      f(begin, end);
      begin = end;
    }
  }
};

// Calls f(y) for each of so many rows, 16 to a chunk.
template <class Executor, class F>
void for_rows(Executor& executor, int rows, F&& f) {
  executor.for_chunks(rows > 0 ? static_cast<std::size_t>(rows) : 0, 16, [&f](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y) f(static_cast<int>(y));
  });
}

// Number of chunks that for_chunks(count, chunk, ...) makes.
[[nodiscard]] constexpr std::size_t chunk_count(std::size_t count, std::size_t chunk) noexcept {
  return chunk == 0 ? count : count / chunk + (count % chunk != 0 ? 1 : 0);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_CORE_EXECUTOR_HPP
