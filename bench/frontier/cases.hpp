// SPDX-License-Identifier: Apache-2.0
// One function per kernel: it builds the contenders and their errors, has them timed, and returns the comparison.
#ifndef NPSIM_BENCH_FRONTIER_CASES_HPP
#define NPSIM_BENCH_FRONTIER_CASES_HPP

#include "comparison.hpp"

namespace npsim::bench {

[[nodiscard]] Comparison bilateral_case(const Options& options);
[[nodiscard]] Comparison label_term_case(const Options& options);
[[nodiscard]] Comparison variance_case(const Options& options);
[[nodiscard]] Comparison lab_case(const Options& options);
[[nodiscard]] Comparison normals_case(const Options& options);
[[nodiscard]] Comparison losses_case(const Options& options);
[[nodiscard]] Comparison refine_case(const Options& options);
[[nodiscard]] Comparison light_case(const Options& options);

}  // namespace npsim::bench

#endif  // NPSIM_BENCH_FRONTIER_CASES_HPP
