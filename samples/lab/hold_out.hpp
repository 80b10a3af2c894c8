// SPDX-License-Identifier: Apache-2.0
// Depth judged without any truth: measured pixels are left out, and what each step says there is compared with them.
//
// Left out are single pixels at random, or squares of 16 pixels of the working image that hold at least one measured
// pixel. Only pixels whose label has a surface count. Mismatches of stereo are no truth: those in the strip at the left
// border that one of its cameras alone sees (depth/detail/given/outliers.hpp), and the depth of near objects behind
// their borders (depth/detail/measured/border_spill.hpp) and, of plants and signs, within their outlines. Nearest
// neighbour and linear interpolation of 1/z (simple_fill.hpp) stand beside the steps.
// Of the measured pixels that were not left out it says how far each step moves them. The result depends on seed and
// size alone, not on threads.
#ifndef NPSIM_SAMPLES_LAB_HOLD_OUT_HPP
#define NPSIM_SAMPLES_LAB_HOLD_OUT_HPP

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "depth_shift.hpp"
#include "label_groups.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/depth/refine_depth_params.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/error.hpp"
#include "tool/console.hpp"

namespace npsim::tool {

struct HoldOut {
  double share = 0.2;   // of the measured pixels, or of the squares
  bool blocks = false;  // squares of kHoldOutBlock_px
  std::uint64_t seed = 1;
};
inline constexpr int kHoldOutBlock_px = 16;

// "0.2" or "0.2,blocks".
[[nodiscard]] io::Expected<HoldOut> parse_hold_out(const std::string& text);

struct HoldOutRow {
  std::string name;                                    // in the table
  std::string key;                                     // in JSON
  std::array<DepthShift, kLabelGroups.size()> errors;  // at the pixels that were left out
  DepthShift kept;                                     // of measured pixels that were not
};

struct HoldOutResult {
  DepthSource source = DepthSource::unknown;  // given, or found from all measured pixels
  std::size_t measured = 0;                   // pixels of surfaces
  std::size_t false_strip = 0;
  std::size_t spilled = 0;
  std::size_t left_out = 0;
  bool labelled = false;         // else the groups are all one
  std::vector<HoldOutRow> rows;  // nearest, linear, then each step
};

[[nodiscard]] Status hold_out(const HoldOut& params, const SceneView& scene, const RefineDepthParams& steps,
                              ThreadPool& pool, Console& console, HoldOutResult& out);

void print_table(const HoldOutResult& result);
[[nodiscard]] OrderedJson to_json(const HoldOutResult& result);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_HOLD_OUT_HPP
