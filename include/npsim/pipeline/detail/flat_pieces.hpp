// SPDX-License-Identifier: Apache-2.0
// Which pixels show one flat piece of a surface: a wall, the side of a box, a sign. Nothing flat shades itself.
//
// Neighbours are of one piece where both have a class that is flat, belong to one object or to none, have normals that
// differ by little, and lie in each other's plane. Pieces are what hangs together so: walls that bend slowly are one.
// Normals tell better than the mesh what is flat: measured depth is uneven by more than a wall's relief.
// Cost: three passes over the pixels. Memory: 8 bytes a pixel for the search. Error: what a piece does shade of itself,
// beside a balcony or under a ledge that the normals do not show, is lit.
#ifndef NPSIM_PIPELINE_DETAIL_FLAT_PIECES_HPP
#define NPSIM_PIPELINE_DETAIL_FLAT_PIECES_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/render/surface_points.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr LabelSet kFlatLabels =
    kHouseLabels | LabelSet::of(label::bridge, label::tunnel, label::static_object, label::traffic_sign);

struct FlatParams {
  LabelSet classes = kFlatLabels;
  float min_cosine = 0.9998F;  // between normals of neighbours: 1.1 degrees
  float max_step = 0.02F;      // how far a neighbour is off the plane, a share of the depth
  int least_px = 16;           // of a piece; what is smaller shades as anything, since numbers are few
};

[[nodiscard]] inline Status validate(const FlatParams& p) noexcept {
  const bool good = p.min_cosine >= 0.0F && p.min_cosine <= 1.0F && p.max_step >= 0.0F && p.least_px >= 1;
  return good ? Status()
              : Status(StatusCode::invalid_argument, "flat pieces: cosine in [0, 1], step not negative, pixels from 1");
}

[[nodiscard]] constexpr std::size_t number_flat_pieces_workspace_bytes(Shape shape) noexcept {
  return 2 * allocation_bytes<std::uint32_t>(shape.pixels()) + kWorkspaceAlignment;
}

// of_pixel: first, first + 1, ... in the order of the pieces' first pixels, 0 for none; with 65535 numbers end. Labels
// as in the scene; empty: nothing is flat.
[[nodiscard]] inline Status number_flat_pieces(const FlatParams& params, ImageView<const Label> labels,
                                               const SceneMesh& mesh, const SurfacePoints& points, std::uint32_t first,
                                               Workspace& workspace, ImageView<std::uint16_t> of_pixel) {
  const Shape shape = of_pixel.shape();
  for (int y = 0; y < shape.height; ++y) std::fill(of_pixel.row(y), of_pixel.row(y) + shape.width, std::uint16_t{0});
  if (labels.empty()) return {};
  const WorkspaceScope scope(workspace);
  Span<std::uint32_t> parent, size;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), parent));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), size));
  const auto at = [&](int x, int y) { return static_cast<std::uint32_t>(y * shape.width + x); };
  const auto joined = [&](int x, int y, int u, int v) {
    const std::uint32_t a = mesh.visible_vertex(x, y);
    const std::uint32_t b = mesh.visible_vertex(u, v);
    if (a == kNoVertex || b == kNoVertex || mesh.object(x, y) != mesh.object(u, v)) return false;
    if (!params.classes.contains(labels(x, y)) || !params.classes.contains(labels(u, v))) return false;
    const Vec3f way = points.position[b] - points.position[a];
    return dot(points.normal[a], points.normal[b]) >= params.min_cosine &&
           std::fabs(dot(points.normal[a], way)) <= params.max_step * points.position[a].z;
  };
  for (std::uint32_t p = 0; p < parent.size(); ++p) parent[p] = p;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (x > 0 && joined(x, y, x - 1, y)) unite(parent, at(x, y), at(x - 1, y));
      if (y > 0 && joined(x, y, x, y - 1)) unite(parent, at(x, y), at(x, y - 1));
    }
  }
  std::fill(size.begin(), size.end(), 0U);
  for (std::uint32_t p = 0; p < parent.size(); ++p) ++size[find_root(parent, p)];
  std::uint32_t next = first;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const std::uint32_t root = find_root(parent, at(x, y));  // no later pixel
      if (size[root] < static_cast<std::uint32_t>(params.least_px)) continue;
      std::uint16_t& number = of_pixel(x, y);
      if (root != at(x, y)) {
        number = of_pixel(static_cast<int>(root) % shape.width, static_cast<int>(root) / shape.width);
      } else if (next <= 65535 && params.classes.contains(labels(x, y)) && mesh.visible_vertex(x, y) != kNoVertex) {
        number = static_cast<std::uint16_t>(next++);
      }
    }
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_FLAT_PIECES_HPP
