// SPDX-License-Identifier: Apache-2.0
// Signs, signals and poles stand before what is seen beside them.
//
// A network's depth often lacks what is thin: a sign then has the depth of the house behind it, lies half within the
// house's wall, and is black at night where that comes first. A thing, a connected piece of such labels, whose outline
// is not nearer by `before` than what lies outside of it is moved towards the camera as a whole, by as much as it
// takes: z is scaled so that it is along three quarters of its outline. How far it really stands before the wall is not
// known, and matters to its shadow alone.
// Invariant: only pixels of things change, they come nearer, by a factor of most_moved at most; else the thing stays.
// Deterministic. Cost: two passes over the image, and the outlines. Memory: stand_before_workspace_bytes().
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
  LabelSet things = kPoleLabels | kSignLabels;
  LabelSet behind = kHouseLabels | LabelSet::of(label::vegetation);
  float before = 0.03F;     // of z [default]
  float most_moved = 1.3F;  // more than that, something else stands before the thing
};

[[nodiscard]] inline Status validate(const StandBeforeParams& p) noexcept {
  const bool good = p.before >= 0.0F && p.before <= 0.5F && p.most_moved >= 1.0F && p.most_moved <= 100.0F;
  return good ? Status() : Status(StatusCode::invalid_argument, "stand before: before in [0, .5], most_moved 1 to 100");
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
  Span<float> ratios;  // of what is outside to the thing, along its outline
  ImageView<std::uint8_t> open;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), list));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(4 * shape.pixels(), ratios));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, open));
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) open(x, y) = p.things.contains(labels(x, y)) ? 1 : 0;
  }
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (open(x, y) == 0) continue;
      const std::size_t count = take_piece(open, x, y, list);
      std::size_t outside = 0;
      for (const std::uint32_t pixel : list.sub(0, count)) {
        const auto [u, v] = place_of(pixel, shape.width);
        if (!is_valid_depth(depth(u, v))) continue;
        constexpr int kX[4] = {1, -1, 0, 0};
        constexpr int kY[4] = {0, 0, 1, -1};
        for (int k = 0; k < 4; ++k) {
          const int i = u + kX[k];
          const int j = v + kY[k];
          if (!labels.contains(i, j) || !p.behind.contains(labels(i, j)) || !is_valid_depth(depth(i, j))) continue;
          ratios[outside++] = depth(i, j) / depth(u, v);
        }
      }
      if (outside == 0) continue;
      float* const quarter = ratios.data() + outside / 4;
      select_nth(ratios.data(), quarter, ratios.data() + outside);
      const float scale = *quarter * (1.0F - p.before);
      if (scale >= 1.0F || scale * p.most_moved < 1.0F) continue;
      for (const std::uint32_t pixel : list.sub(0, count)) depth(place_of(pixel, shape.width)) *= scale;
    }
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_THINGS_STAND_BEFORE_HPP
