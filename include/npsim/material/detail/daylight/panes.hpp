// SPDX-License-Identifier: Apache-2.0
// Where a car may have panes: pieces of its picture, bounded by edges, that lie where panes do.
//
// Below the panes paint goes on, over doors, bonnet and boot; above them lies the roof. So a piece without edges in it
// that leaves the band of panes downwards, or lies above it for the most part, is paint as a whole, and what stays in
// the band is a pane, or a part of what a pane mirrors, if it differs from the paint. The borders of pieces are those
// of the picture: no straight line parts a door from its window.
// Cost: two passes over the picture and a union-find. Serial. The same bits always.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_PANES_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_PANES_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/material/detail/albedo_scene.hpp"
#include "npsim/material/detail/daylight/picture.hpp"
#include "npsim/material/detail/daylight/planes.hpp"
#include "npsim/material/detail/daylight/standing_light.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

struct PaneParams {
  float edge = 0.3F;  // log2 of luminance or of blue over red, at least, over edge_height of the car
  float edge_height = 0.04F;
  float leaves_band = 0.15F;  // of what lies in the band: as much as a pane may reach down
};

inline constexpr std::size_t kPanePlanes = 5;  // the last one as two of bytes

// pane(x, y): 1 where a car may have a pane, else 0.
inline Status find_panes(const PaneParams& p, const AlbedoScene& s, const Picture& picture, const Objects& objects,
                         Workspace& workspace, Plane pane) {
  const WorkspaceScope scope(workspace);
  const Shape shape = picture.shape();
  Span<std::uint32_t> piece, roof, band, below;
  for (Span<std::uint32_t>* v : {&piece, &roof, &band, &below})
    NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), *v));
  ImageView<std::uint8_t> car, edge;  // car: its object; 0: no car, or none of those that are told apart
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, car));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, edge));
  const auto width = static_cast<std::size_t>(shape.width);
  const auto index = [&](int x, int y) { return static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x); };
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const int u = picture.middle_x(x, s.image.width());
      const int v = picture.middle_y(y, s.image.height());
      const bool is_car = !s.labels.empty() && s.labels(u, v) == label::car;
      car(x, y) = is_car ? static_cast<std::uint8_t>(objects.of(s, u, v)) : std::uint8_t{0};
    }
  }
  const auto is_edge = [&](int x, int y) {
    const std::uint8_t object = car(x, y);
    const auto rows = static_cast<float>(objects.bottom[object] - objects.top[object] + 1);
    const int reach = 1 + static_cast<int>(0.5F * p.edge_height * rows);
    const auto differs = [&](int dx, int dy) {
      const int x0 = x - dx, y0 = y - dy, x1 = x + dx, y1 = y + dy;
      if (!pane.contains(x0, y0) || !pane.contains(x1, y1) || car(x0, y0) != object || car(x1, y1) != object) {
        return false;
      }
      return std::fabs(picture.log_y(x1, y1) - picture.log_y(x0, y0)) > p.edge ||
             std::fabs(picture.colour(x1, y1) - picture.colour(x0, y0)) > p.edge;
    };
    return differs(reach, 0) || differs(0, reach);
  };
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const auto own = static_cast<std::uint32_t>(index(x, y));
      piece[own] = own;
      roof[own] = band[own] = below[own] = 0;
      const std::uint8_t object = car(x, y);
      edge(x, y) = object != 0 && is_edge(x, y) ? 1 : 0;
      if (object == 0 || edge(x, y) != 0) continue;
      if (x > 0 && car(x - 1, y) == object && edge(x - 1, y) == 0) unite(piece, own - 1, own);
      if (y > 0 && car(x, y - 1) == object && edge(x, y - 1) == 0) {
        unite(piece, static_cast<std::uint32_t>(index(x, y - 1)), own);
      }
    }
  }
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const std::uint8_t object = car(x, y);
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
