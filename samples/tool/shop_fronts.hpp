// SPDX-License-Identifier: Apache-2.0
// Which marked windows are those of shops.
//
// That is told by their size and place, which hang on depth, and depth on the size of the picture. So that the same
// lamps burn at any --size and --work-size it is told once, of the scene as it was read, at a size of its own.
#ifndef NPSIM_SAMPLES_TOOL_SHOP_FRONTS_HPP
#define NPSIM_SAMPLES_TOOL_SHOP_FRONTS_HPP

#include <cstdint>
#include <vector>

#include "npsim/core/scene_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/scene.hpp"
#include "npsim/pipeline/night.hpp"

namespace npsim::tool {

// For RelightParams::shop_fronts: 1 of every mark that is placed as one by `refined`; empty without marks.
[[nodiscard]] Status shop_fronts_of(const NightParams& params, const SceneView& scene, const RefinedDepth& refined,
                                    std::vector<std::uint8_t>& by_mark);

// The same by the depth of the scene at kShopFrontWidth, or at its own width where it has less.
inline constexpr int kShopFrontWidth = 480;
[[nodiscard]] io::Expected<std::vector<std::uint8_t>> shop_fronts(const NightParams& params, const io::Scene& scene,
                                                                  int threads);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_SHOP_FRONTS_HPP
