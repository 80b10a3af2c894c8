// SPDX-License-Identifier: Apache-2.0
// Scenes from disk, as commands take them.
#ifndef NPSIM_SAMPLES_TOOL_LOADING_HPP
#define NPSIM_SAMPLES_TOOL_LOADING_HPP

#include <string>

#include "npsim/io/error.hpp"
#include "npsim/io/scene.hpp"

namespace npsim::tool {

// A file that by its name is something else than a scene.json, and would be called broken JSON.
[[nodiscard]] io::Outcome expect_scene(const std::string& path, const char* or_else = "");

// Resamples the scene where `size`, WIDTHxHEIGHT, is not empty.
[[nodiscard]] io::Outcome resize_to(io::Scene& scene, const std::string& size);

// Reads the scene and, where `size` is not empty, resamples it.
[[nodiscard]] io::Expected<io::Scene> load_scene(const std::string& path, const std::string& size);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_LOADING_HPP
