// SPDX-License-Identifier: Apache-2.0
// npsim judge: generated streets, their true nights, and what each stage of the method is worth on them, as one table.
#ifndef NPSIM_SAMPLES_TOOL_JUDGE_COMMAND_HPP
#define NPSIM_SAMPLES_TOOL_JUDGE_COMMAND_HPP

#include <cstdint>
#include <string>

#include "night_stages.hpp"

namespace npsim::tool {

struct JudgeOptions {
  std::string output;
  int first = 1;  // seeds of the streets, and of their nights
  int last = 8;
  std::string size = "480x270";
  int samples = 1000;
  int threads = 0;
  bool quiet = false;
};

[[nodiscard]] int run_judge(const JudgeOptions& options);  // an exit status

// The true night of a scene as `npsim truth` wrote it, with the true lamps. size: as for --size.
[[nodiscard]] io::Expected<TrueNight> read_true_night(const io::Scene& scene, const std::string& pfm);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_JUDGE_COMMAND_HPP
