// SPDX-License-Identifier: Apache-2.0
// npsim judge: generated streets, their true nights, and what each stage of the method is worth on them, as one table.
#ifndef NPSIM_SAMPLES_LAB_JUDGE_COMMAND_HPP
#define NPSIM_SAMPLES_LAB_JUDGE_COMMAND_HPP

#include <cstdint>
#include <string>
#include <vector>

namespace npsim::tool {

struct JudgeOptions {
  std::string output;
  int first = 1;  // seeds of the streets, and of their nights
  int last = 8;
  std::string size = "480x270";
  int samples = 1000;
  int transport_samples = 1000;      // of the reference on the renderer's own mesh; 0: transport is not judged alone
  std::vector<std::string> sources;  // nights of depth that these measured stand beside those of a network's
  int threads = 0;
  bool quiet = false;
};

[[nodiscard]] int run_judge(const JudgeOptions& options);  // an exit status

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_JUDGE_COMMAND_HPP
