// SPDX-License-Identifier: Apache-2.0
// npsim truth: the true night of a generated street, by the reference path tracer.
#ifndef NPSIM_SAMPLES_LAB_TRUTH_COMMAND_HPP
#define NPSIM_SAMPLES_LAB_TRUTH_COMMAND_HPP

#include <cstdint>
#include <string>

namespace npsim::tool {

struct TruthOptions {
  std::string scene;
  std::string night;   // night_NNN.json
  std::string output;  // a PFM; others stand beside it
  std::string size;
  int samples = 1000;
  int bounces = 2;
  std::uint64_t seed = 0;
  int threads = 0;
  bool keep = false;  // what a run with more samples would go on from
  bool quiet = false;
};

[[nodiscard]] int run_truth(const TruthOptions& options);  // an exit status

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_TRUTH_COMMAND_HPP
