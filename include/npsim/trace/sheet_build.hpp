// SPDX-License-Identifier: Apache-2.0
// Builds the ray structure of a layer (sheet_layout.hpp) from its vertices and quads.
//
// Inverse depths (sheet_inverse_depth.hpp), then tiles (sheet_slab.hpp), then the nodes above them. Left out, hence
// never hit: faces with a vertex that is missing, not finite, beyond kTraceMaxCoordinate or nearer than kSheetMinDepth.
// No sorting, no index buffer; the same layer gives the same bytes for any executor.
// Cost: two passes over the layer, a few ns a pixel. Memory: sheet_workspace_bytes(). Error: inverse depths are rounded
// once; sheet_ray.hpp allows for it.
#ifndef NPSIM_TRACE_SHEET_BUILD_HPP
#define NPSIM_TRACE_SHEET_BUILD_HPP

#include <algorithm>
#include <cstddef>
#include <limits>

#include "npsim/core/camera.hpp"
#include "npsim/core/sheet_layer.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/trace/sheet_inverse_depth.hpp"
#include "npsim/trace/sheet_join.hpp"
#include "npsim/trace/sheet_layout.hpp"
#include "npsim/trace/sheet_slab.hpp"

namespace npsim {
inline namespace v1 {
inline namespace NPSIM_ISA_NAMESPACE {
namespace sheet_detail {

// A child's bounds put into its parent; slots without a child stay empty.
inline void put_bounds(SheetNode* nodes, int across, int x, int y, float low, float high) noexcept {
  SheetNode& node = nodes[(y / 4) * across + x / 4];
  const int k = 4 * (y % 4) + x % 4;
  node.low[k] = low;
  node.high[k] = high;
}

}  // namespace sheet_detail

// `out` points into the workspace and at the layer and stays good as long as both do.
template <class F = simd::F32, class Executor>
[[nodiscard]] Status build_sheet_trace(const SheetLayer& layer, const Intrinsics& intrinsics, Workspace& workspace,
                                       SheetTrace& out, Executor& executor) {
  using namespace sheet_detail;
  using namespace sheet_layout;
  out = SheetTrace{};
  NPSIM_RETURN_IF_ERROR(validate(layer));
  NPSIM_RETURN_IF_ERROR(validate(intrinsics));
  const Shape shape = layer.vertices.shape();
  const Levels levels = levels_of(shape);
  if (levels.count == 0) return {};
  if (shape.pixels() >= (std::size_t{1} << 30U)) {
    return Status(StatusCode::capacity_exceeded, "a ray tracer takes fewer than 2^31 faces");
  }
  const auto rows = static_cast<std::size_t>(levels.down[0]);
  const Shape plane = plane_shape(shape);
  ImageView<float> inverse_depth;
  Span<SheetTiles> tiles;
  Span<SheetNode> nodes;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(plane, inverse_depth));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(levels.across[0]) * rows, tiles));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(levels.nodes, nodes));
  const WorkspaceScope scope(workspace);
  Span<RowBounds> row_bounds;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(rows, row_bounds));

  SheetTrace sheet;
  sheet.vertices = layer.vertices;
  sheet.quads = layer.quads;
  sheet.inverse_depth = inverse_depth;
  sheet.intrinsics = intrinsics;
  const float inf = std::numeric_limits<float>::infinity();
  executor.for_chunks(rows, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t g = begin; g < end; ++g) {
      RowBounds bounds{{inf, inf, inf}, {-inf, -inf, -inf}, 0.0F, 0.0F};
      const int y0 = kSheetGroupQuads * static_cast<int>(g);
      const int y1 = g + 1 == rows ? plane.height : y0 + kSheetGroupQuads;
      for (int y = y0; y < y1; ++y) {
        float* row = inverse_depth.row(y);
        int x = 0;
        if (y < shape.height) {
          invert_row<F>(sheet, y, row, bounds);
          x = shape.width;
        }
        std::fill(row + x, row + plane.width, 0.0F);
      }
      row_bounds[g] = bounds;
    }
  });
  RowBounds bounds = row_bounds[0];
  for (const RowBounds& b : row_bounds) {
    for (int k = 0; k < 3; ++k) {
      bounds.low[k] = std::min(bounds.low[k], b.low[k]);
      bounds.high[k] = std::max(bounds.high[k], b.high[k]);
    }
    bounds.max_inverse_depth = std::max(bounds.max_inverse_depth, b.max_inverse_depth);
    bounds.off_grid_px = std::max(bounds.off_grid_px, b.off_grid_px);
  }
  if (!(bounds.max_inverse_depth > 0.0F)) return {};  // no vertex: nothing to hit

  sheet.bounds = bounds_of(bounds, shape, intrinsics);
  if (!(sheet.bounds.focal_reach < 0x1p30F)) {
    return Status(StatusCode::invalid_argument, "the vertices of a traced sheet must lie near their pixels' rays");
  }
  for (SheetNode& node : nodes) {
    std::fill_n(node.low, 16, inf);
    std::fill_n(node.high, 16, -inf);
  }
  executor.for_chunks(rows, 1, [&](std::size_t begin, std::size_t end) {
    for (auto g = static_cast<int>(begin); g < static_cast<int>(end); ++g) {
      for (int x = 0; x < levels.across[0]; ++x) {
        float low = 0;
        float high = 0;
        build_tiles(sheet, kSheetGroupQuads * x, kSheetGroupQuads * g,
                    tiles[static_cast<std::size_t>(g * levels.across[0] + x)], low, high);
        if (levels.count > 1) put_bounds(nodes.data(), levels.across[1], x, g, low, high);
      }
    }
  });
  for (int level = 1; level + 1 < levels.count; ++level) {
    for (int y = 0; y < levels.down[level]; ++y) {
      for (int x = 0; x < levels.across[level]; ++x) {
        const SheetNode& node = nodes[levels.first[level] + static_cast<std::size_t>(y * levels.across[level] + x)];
        put_bounds(nodes.data() + levels.first[level + 1], levels.across[level + 1], x, y,
                   *std::min_element(node.low, node.low + 16), *std::max_element(node.high, node.high + 16));
      }
    }
  }
  sheet.tiles = tiles;
  sheet.nodes = nodes;
  sheet.levels = levels.count;
  for (int level = 0; level < levels.count; ++level) {
    sheet.first[level] = levels.first[level];
    sheet.across[level] = levels.across[level];
    sheet.down[level] = levels.down[level];
  }
  out = sheet;
  return {};
}
}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_TRACE_SHEET_BUILD_HPP
