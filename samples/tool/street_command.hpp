// SPDX-License-Identifier: Apache-2.0
// npsim street: generates a street and writes it as a scene with full ground truth.
#ifndef NPSIM_SAMPLES_TOOL_STREET_COMMAND_HPP
#define NPSIM_SAMPLES_TOOL_STREET_COMMAND_HPP

#include <cstdint>
#include <string>

namespace npsim::tool {

struct StreetOptions {
  std::string output;
  std::uint64_t seed = 1;
  std::string size = "960x540";
  std::string depth = "network";  // or stereo, lidar, exact
  std::string albedo = "given";   // or none
  int threads = 0;
  bool quiet = false;
};

[[nodiscard]] int run_street(const StreetOptions& options);  // an exit status

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_STREET_COMMAND_HPP
