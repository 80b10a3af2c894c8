// SPDX-License-Identifier: Apache-2.0
// npsim stats: what night pictures look like in numbers, beside what real nights have (metrics/night_statistics.hpp).
#ifndef NPSIM_SAMPLES_LAB_STATS_COMMAND_HPP
#define NPSIM_SAMPLES_LAB_STATS_COMMAND_HPP

#include <string>
#include <vector>

namespace npsim::tool {

struct StatsOptions {
  std::vector<std::string> pictures;
  std::string json;  // empty: none
  std::string svg;   // empty: none
};

[[nodiscard]] int run_stats(const StatsOptions& options);  // an exit status

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_STATS_COMMAND_HPP
