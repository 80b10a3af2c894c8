// SPDX-License-Identifier: Apache-2.0
// npsim evaluate: the depth steps, the scene mesh and the nights on a scene with ground truth, as tables and as JSON; or
// the depth steps alone on a scene without, by measured pixels that are left out.
#ifndef NPSIM_SAMPLES_LAB_EVALUATE_COMMAND_HPP
#define NPSIM_SAMPLES_LAB_EVALUATE_COMMAND_HPP

#include <cstdint>
#include <string>

namespace npsim::tool {

struct EvaluateOptions {
  std::string scene;
  std::string output;  // empty: none
  std::string preset = "default";
  int threads = 0;
  std::string size;
  std::string true_night;        // as `npsim truth` wrote it; empty: nights are not judged
  std::uint64_t night_seed = 0;  // of the night that it shows
  int transport_samples = 0;     // paths a pixel by which transport is judged alone
  std::string hold_out;          // SHARE or SHARE,blocks: judge the depth by measured pixels left out, without truth
  std::uint64_t hold_out_seed = 1;
  std::string losses;       // folder for the losses of the refinement, for which no truth is needed
  std::string weights;      // "grid": with those of other lambdas
  bool depth_only = false;  // neither mesh, lamps nor albedo
  bool flatness = false;    // only how flat facades are, for which no truth is needed
  bool simplified = false;  // render with all faces and with fewer
  bool quiet = false;
};

[[nodiscard]] int run_evaluate(const EvaluateOptions& options);  // an exit status

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_EVALUATE_COMMAND_HPP
