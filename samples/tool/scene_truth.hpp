// SPDX-License-Identifier: Apache-2.0
// A scene with the truth that its scene.json names, both at the size that is wanted.
#ifndef NPSIM_SAMPLES_TOOL_SCENE_TRUTH_HPP
#define NPSIM_SAMPLES_TOOL_SCENE_TRUTH_HPP

#include <string>
#include <utility>

#include "evaluation.hpp"
#include "npsim/io/scene.hpp"

namespace npsim::tool {

// at_size: WIDTHxHEIGHT, or empty. output: a file that is going to be written, which must not be one of the scene's; or
// empty.
[[nodiscard]] io::Expected<std::pair<io::Scene, Truth>> load_with_truth(const std::string& folder,
                                                                        const std::string& at_size,
                                                                        const std::string& output);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_SCENE_TRUTH_HPP
