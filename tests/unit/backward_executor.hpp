// SPDX-License-Identifier: Apache-2.0
// An executor that takes its chunks last to first: a result that depends on their order differs from the serial one's.
#ifndef NPSIM_TESTS_UNIT_BACKWARD_EXECUTOR_HPP
#define NPSIM_TESTS_UNIT_BACKWARD_EXECUTOR_HPP

#include <algorithm>
#include <cstddef>

#include "npsim/core/executor.hpp"

struct BackwardExecutor {
  template <class F>
  void for_chunks(std::size_t count, std::size_t chunk, F&& f) const {
    for (std::size_t i = npsim::chunk_count(count, chunk); i-- > 0;) f(i * chunk, std::min(count, (i + 1) * chunk));
  }
};

#endif  // NPSIM_TESTS_UNIT_BACKWARD_EXECUTOR_HPP
