// SPDX-License-Identifier: Apache-2.0
// Signs, signals and poles stand before what is seen beside them.
//
// A network's depth often lacks what is thin: a sign then has the depth of the house behind it, lies half within the
// house's wall, and is black at night where that comes first. A thing is a connected piece of signs, or of poles. Where
// along a quarter of its outline what lies outside is a house or plants, and the thing is not nearer than that by
// `before`, nor farther by `hidden`, which would be something else before the thing, it is moved towards the camera as
// a whole, by as much as it takes: z is scaled so that along three quarters of that part it is. How far it really
// stands before the wall is not known, and matters to its shadow alone.
// Invariant: only pixels of things change, and they come nearer, by hidden + before at most. Deterministic.
// Cost: two passes over the image for each kind, and the outlines. Memory: stand_before_workspace_bytes().
#ifndef NPSIM_DEPTH_DETAIL_THINGS_STAND_BEFORE_HPP
#define NPSIM_DEPTH_DETAIL_THINGS_STAND_BEFORE_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct StandBeforeParams {
  bool enabled = true;
  LabelSet signs = kSignLabels;
  LabelSet poles = kPoleLabels;
  LabelSet behind = kHouseLabels | LabelSet::of(label::vegetation);
  float before = 0.03F;  // of z [default]
  float hidden = 0.1F;   // of z [default]
};

[[nodiscard]] inline Status validate(const StandBeforeParams& p) noexcept {
  const auto share = [](float v) { return v >= 0.0F && v <= 0.5F; };
  const bool good = share(p.before) && share(p.hidden);
  return good ? Status() : Status(StatusCode::invalid_argument, "stand before: distances within 0 to .5 of z");
}

[[nodiscard]] constexpr std::size_t stand_before_workspace_bytes(Shape shape) noexcept {
  return allocation_bytes<std::uint32_t>(shape.pixels()) + allocation_bytes<float>(4 * shape.pixels()) +
         allocation_bytes<std::uint8_t>(shape.pixels()) + kWorkspaceAlignment;
}

// depth: in place; 0: none.
[[nodiscard]] inline Status stand_before(const StandBeforeParams& p, ImageView<const Label> labels,
                                         ImageView<float> depth, Workspace& workspace) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(p));
  if (!p.enabled || labels.empty()) return {};
  const Shape shape = depth.shape();
  if (labels.shape() != shape) {
    return {StatusCode::shape_mismatch, "stand before: labels and depth must have one size"};
  }
  const WorkspaceScope scope(workspace);
  Span<std::uint32_t> list;
  Span<float> ratios;  // of what is outside to the thing, where it is in question
  ImageView<std::uint8_t> open;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), list));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(4 * shape.pixels(), ratios));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, open));
  constexpr int kX[4] = {1, -1, 0, 0};
  constexpr int kY[4] = {0, 0, 1, -1};
  const auto bring_before = [&](Span<const std::uint32_t> thing, LabelSet kind) {
    std::size_t outline = 0;
    std::size_t count = 0;
    for (const std::uint32_t pixel : thing) {
      const auto [x, y] = place_of(pixel, shape.width);
      for (int k = 0; k < 4; ++k) {
        const int u = x + kX[k];
        const int v = y + kY[k];
        if (!labels.contains(u, v) || kind.contains(labels(u, v))) continue;
        ++outline;
        if (!p.behind.contains(labels(u, v)) || !is_valid_depth(depth(u, v)) || !is_valid_depth(depth(x, y))) continue;
        const float ratio = depth(u, v) / depth(x, y);
        if (ratio > 1.0F - p.hidden && ratio * (1.0F - p.before) < 1.0F) ratios[count++] = ratio;
      }
    }
    if (count == 0 || 4 * count < outline) return;
    float* const quarter = ratios.data() + count / 4;
    select_nth(ratios.data(), quarter, ratios.data() + count);
    const float scale = *quarter * (1.0F - p.before);
    for (const std::uint32_t pixel : thing) depth(place_of(pixel, shape.width)) *= scale;
  };
  for (const LabelSet kind : {p.signs, p.poles}) {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) open(x, y) = kind.contains(labels(x, y)) ? 1 : 0;
    }
    for_pieces(open, list, [&](Span<const std::uint32_t> piece) { bring_before(piece, kind); });
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_THINGS_STAND_BEFORE_HPP
