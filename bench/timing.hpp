// SPDX-License-Identifier: Apache-2.0
// How long something takes, and the middle of several such times.
#ifndef NPSIM_BENCH_TIMING_HPP
#define NPSIM_BENCH_TIMING_HPP

#include <algorithm>
#include <chrono>
#include <vector>

namespace npsim::bench {

template <class F>
[[nodiscard]] double seconds(F&& f) {
  const auto begin = std::chrono::steady_clock::now();
  f();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

// The upper of the middle two; 0 of none.
[[nodiscard]] inline double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values.empty() ? 0.0 : values[values.size() / 2];
}

}  // namespace npsim::bench

#endif  // NPSIM_BENCH_TIMING_HPP
