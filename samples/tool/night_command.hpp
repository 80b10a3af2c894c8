// SPDX-License-Identifier: Apache-2.0
// npsim night: runs the whole method on a scene and writes everything it made.
#ifndef NPSIM_SAMPLES_TOOL_NIGHT_COMMAND_HPP
#define NPSIM_SAMPLES_TOOL_NIGHT_COMMAND_HPP

#include <cstdint>
#include <string>

namespace npsim::tool {

struct NightOptions {
  std::string scene;
  std::string output;
  int variants = 1;
  std::uint64_t seed = 0;
  std::string preset = "default";
  int threads = 0;
  std::string size;
  std::string light_set;
  float wet = 0.0F;          // share of the ground under a film of water
  std::string texture = "photograph";
  float mesh_error = -1.0F;  // relative, of depth; 0: not simplified; negative: as the preset has it
  bool quiet = false;
};

[[nodiscard]] int run_night(const NightOptions& options);  // an exit status

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_NIGHT_COMMAND_HPP
