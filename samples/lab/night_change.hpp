// SPDX-License-Identifier: Apache-2.0
// What a night loses when its rays meet the simplified mesh: one variant, rendered with all faces and with fewer.
#ifndef NPSIM_SAMPLES_LAB_NIGHT_CHANGE_HPP
#define NPSIM_SAMPLES_LAB_NIGHT_CHANGE_HPP

#include <array>
#include <cstddef>

#include "any.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/pipeline/night.hpp"

namespace npsim::tool {

struct NightChange {
  std::array<std::size_t, 2> faces{};  // all, simplified
  double mean_colour = 0;              // of the linear picture: relative change of the channel that changes most
  double rms_codes = 0;                // root mean square over the picture as shown, in codes of 255
};

[[nodiscard]] Status night_change(NightParams params, const SceneView& scene, AnyExecutor executor,
                                  AnyObserver observer, NightChange& out);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_NIGHT_CHANGE_HPP
