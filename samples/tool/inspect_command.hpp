// SPDX-License-Identifier: Apache-2.0
// npsim inspect: what a scene holds, what is missing, ranges and shares.
#ifndef NPSIM_SAMPLES_TOOL_INSPECT_COMMAND_HPP
#define NPSIM_SAMPLES_TOOL_INSPECT_COMMAND_HPP

#include <string>

namespace npsim::tool {

struct InspectOptions {
  std::string scene;
  std::string output;  // PNG of overlay_picture(); empty: none
};

[[nodiscard]] int run_inspect(const InspectOptions& options);  // an exit status

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_INSPECT_COMMAND_HPP
