// SPDX-License-Identifier: Apache-2.0
// Files of what was estimated of materials and of the day's light, where the scene gives no albedo.
//
// albedo.png: sRGB, 255 is albedo 1. shadow.png: share of the direct sun, 255 in full sun. The estimate is made once
// more for them: the pipeline keeps materials of its mesh's vertices alone. As a texture of the mesh albedo.png is the
// same picture.
#ifndef NPSIM_SAMPLES_TOOL_DAYLIGHT_HPP
#define NPSIM_SAMPLES_TOOL_DAYLIGHT_HPP

#include <string>

#include "figures.hpp"
#include "npsim/depth/refine_depth_params.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/scene.hpp"
#include "npsim/material/albedo.hpp"

namespace npsim::tool {

inline constexpr const char* kDaylightFiles[] = {"albedo.png", "shadow.png"};

// Writes nothing and leaves `report` null where the scene gives albedo.
[[nodiscard]] io::Outcome write_daylight(const std::string& folder, const io::Scene& scene, const RefinedDepth& refined,
                                         ThreadPool& pool, OrderedJson& report);

[[nodiscard]] OrderedJson to_json(const DaylightReport& report);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_DAYLIGHT_HPP
