// SPDX-License-Identifier: Apache-2.0
// Mean field of two states, such as sun and shadow: neighbours that no edge of the picture separates share theirs.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_MEAN_FIELD_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_MEAN_FIELD_HPP

#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/window_filter.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/material/detail/daylight/picture.hpp"
#include "npsim/material/detail/daylight/planes.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

struct MeanFieldParams {
  float reach_px = 6.0F;  // lengths are for 960 px width
  float epsilon = 0.02F;  // of the guided filter
  int rounds = 6;
  float weight = 3.0F;  // of unanimous neighbours, in log odds
};

[[nodiscard]] inline float logistic(float odds) noexcept { return 1.0F / (1.0F + exp2_of(-kLog2E * odds)); }

// Shares of light from their log odds: neighbours that no edge of the picture separates share their light. In: the
// shares of the pixels on their own; out: with their neighbours'.
template <class Inside, class Guide, class Executor>
Status mean_field(const MeanFieldParams& p, const Inside& inside, const Guide& guide, Plane odds,
                  const Picture& picture, Workspace& workspace, Plane share, Executor& executor) {
  const WorkspaceScope scope(workspace);
  Plane mean;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(picture.shape(), mean));
  for (int round = 0; round < p.rounds; ++round) {
    NPSIM_RETURN_IF_ERROR(
        guided_filter(inside, guide, share, picture.radius(p.reach_px), p.epsilon, workspace, mean, executor));
    for_pixels(picture.shape(), executor, [&](int x, int y) {
      if (!inside(x, y)) return;
      share(x, y) = logistic(0.5F * odds(x, y) + p.weight * (2.0F * clamp_to(mean(x, y), 0.0F, 1.0F) - 1.0F));
    });
  }
  return {};
}
inline constexpr std::size_t kMeanFieldPlanes = 1 + kGuidedFilterPlanes;

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_MEAN_FIELD_HPP
