// SPDX-License-Identifier: Apache-2.0
// Where a car may have panes: pieces of its picture, bounded by edges, that lie where panes do.
//
// Below the panes paint goes on, over doors, bonnet and boot; above them lies the roof. So a piece of even brightness
// that leaves the band of panes downwards, or lies above it for the most part, is paint as a whole, and what stays in
// the band is a pane, or a part of what a pane mirrors, if it differs from the paint. The borders of pieces are those
// of the picture: no straight line parts a door from its window.
// Cost: two passes over the picture and a union-find. Serial. The same bits always.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_PANES_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_PANES_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/disjoint_sets.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/material/albedo_scene.hpp"
#include "npsim/material/detail/daylight/picture.hpp"
#include "npsim/material/detail/daylight/planes.hpp"
#include "npsim/material/detail/daylight/standing_light.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

struct PaneParams {
  float even = 0.12F;         // log2 of luminance and of blue over red from pixel to pixel, within a piece
  float leaves_band = 0.15F;  // of what lies in the band: as much as a pane may reach down
};

inline constexpr std::size_t kPanePlanes = 4;

// pane(x, y): 1 where a car may have a pane, else 0.
inline Status find_panes(const PaneParams& p, const AlbedoScene& s, const Picture& picture, const Objects& objects,
                         Workspace& workspace, Plane pane) {
  const WorkspaceScope scope(workspace);
  const Shape shape = picture.shape();
  Span<std::uint32_t> piece, roof, band, below;
  for (Span<std::uint32_t>* v : {&piece, &roof, &band, &below})
    NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), *v));
  const auto width = static_cast<std::size_t>(shape.width);
  const auto index = [&](int x, int y) { return static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x); };
  // 0: no car, or none of those that are told apart.
  const auto car = [&](int x, int y) {
    const int u = picture.middle_x(x, s.image.width());
    const int v = picture.middle_y(y, s.image.height());
    if (s.labels.empty() || s.labels(u, v) != label::car) return std::size_t{0};
    return objects.of(s, u, v);
  };
  const auto even = [&](int x, int y, int u, int v) {
    return std::fabs(picture.log_y(x, y) - picture.log_y(u, v)) < p.even &&
           std::fabs(picture.colour(x, y) - picture.colour(u, v)) < p.even;
  };
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const auto own = static_cast<std::uint32_t>(index(x, y));
      piece[own] = own;
      roof[own] = band[own] = below[own] = 0;
      const std::size_t object = car(x, y);
      if (object == 0) continue;
      if (x > 0 && car(x - 1, y) == object && even(x, y, x - 1, y)) unite(piece, own - 1, own);
      if (y > 0 && car(x, y - 1) == object && even(x, y, x, y - 1)) {
        unite(piece, static_cast<std::uint32_t>(index(x, y - 1)), own);
      }
    }
  }
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const std::size_t object = car(x, y);
      if (object == 0) continue;
      const std::uint32_t root = find_root(piece, static_cast<std::uint32_t>(index(x, y)));
      const float down = objects.down(object, static_cast<float>(y));
      ++(down < kPanesFrom ? roof : down < kPanesTo ? band : below)[root];
    }
  }
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const std::uint32_t root = find_root(piece, static_cast<std::uint32_t>(index(x, y)));
      const auto inside = static_cast<float>(band[root]);
      const bool stays = static_cast<float>(below[root]) < p.leaves_band * inside;
      pane(x, y) = stays && band[root] > roof[root] ? 1.0F : 0.0F;
    }
  }
  return {};
}

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_PANES_HPP
