// SPDX-License-Identifier: Apache-2.0
// Builds the ray structure of a layer (sheet_layout.hpp) from its vertices and quads, or a region of it again.
//
// For each strip of a row of groups inverse depths (sheet_inverse_depth.hpp) and tiles (sheet_slab.hpp), then the nodes
// above them. Left out, hence never hit: faces with a vertex that is missing, not finite, beyond kTraceMaxCoordinate or
// nearer than kSheetMinDepth. No sorting, no index buffer; the same layer gives the same bytes for any executor.
// Cost: one pass over the layer, 2 to 4 ns a pixel. Memory: sheet_workspace_bytes() and 14 KiB of stack. Error: inverse
// depths are rounded once; sheet_ray.hpp allows for it.
#ifndef NPSIM_TRACE_DETAIL_SHEET_BUILD_HPP
#define NPSIM_TRACE_DETAIL_SHEET_BUILD_HPP

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <limits>

#include "npsim/core/camera.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/sheet_layer.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/trace/detail/sheet/inverse_depth.hpp"
#include "npsim/trace/detail/sheet/join.hpp"
#include "npsim/trace/detail/sheet/layout.hpp"
#include "npsim/trace/detail/sheet/slab.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace sheet_detail {

// A child's bounds put into its parent; slots without a child stay empty.
inline void put_bounds(SheetNode* nodes, int across, int x, int y, float low, float high) noexcept {
  SheetNode& node =
      nodes[static_cast<std::size_t>(y / 4) * static_cast<std::size_t>(across) + static_cast<std::size_t>(x / 4)];
  const int k = 4 * (y % 4) + x % 4;
  node.low[k] = low;
  node.high[k] = high;
}

// Nodes [x0, x1) x [y0, y1) of a level.
struct NodeRange {
  int x0, y0, x1, y1;
};

// Fills what depends on the given groups, and the bounds of their rows.
template <class F, class Executor>
[[nodiscard]] Status fill_sheet(const sheet_layout::Levels& levels, NodeRange range, SheetTrace& sheet,
                                Executor& executor) {
  const sheet_layout::Block block = sheet_layout::block_of(levels);
  unsigned char* const bytes = sheet.writable.data();
  auto* const tiles = reinterpret_cast<SheetTiles*>(bytes + block.tiles);
  auto* const relief = reinterpret_cast<SheetRelief*>(bytes + block.relief);
  auto* const nodes = reinterpret_cast<SheetNode*>(bytes + block.nodes);
  const Span<RowBounds> rows(reinterpret_cast<RowBounds*>(bytes + block.rows),
                             static_cast<std::size_t>(levels.down[0]));
  sheet.levels = 0;
  executor.for_chunks(static_cast<std::size_t>(range.y1 - range.y0), 1, [&](std::size_t begin, std::size_t end) {
    for (int y = range.y0 + static_cast<int>(begin); y < range.y0 + static_cast<int>(end); ++y) {
      const std::size_t first = static_cast<std::size_t>(y) * static_cast<std::size_t>(levels.across[0]);
      rows[static_cast<std::size_t>(y)] =
          build_row<F>(sheet, y, range.x0, range.x1, [&](int x, const SheetGroup& group) noexcept {
            const std::size_t at = first + static_cast<std::size_t>(x);
            tiles[at] = group.tiles;
            std::copy(group.relief, group.relief + 16, relief + 16 * at);
            if (levels.count > 1) put_bounds(nodes, levels.across[1], x, y, group.low, group.high);
          });
    }
  });
  // After an error the rest is made all the same: what a later refit does not touch has to be right.
  const Status bounded = put_bounds_of(rows, sheet);
  for (int level = 1; level + 1 < levels.count; ++level) {
    range = {range.x0 / 4, range.y0 / 4, (range.x1 + 3) / 4, (range.y1 + 3) / 4};
    for (int y = range.y0; y < range.y1; ++y) {
      for (int x = range.x0; x < range.x1; ++x) {
        const SheetNode& node =
            nodes[levels.first[level] + static_cast<std::size_t>(y) * static_cast<std::size_t>(levels.across[level]) +
                  static_cast<std::size_t>(x)];
        put_bounds(nodes + levels.first[level + 1], levels.across[level + 1], x, y,
                   *std::min_element(node.low, node.low + 16), *std::max_element(node.high, node.high + 16));
      }
    }
  }
  if (sheet.bounds.max_inverse_depth > 0.0F) sheet.levels = levels.count;  // else there is no vertex
  return bounded;
}

}  // namespace sheet_detail

// `out` points into the workspace and at the layer and stays good as long as both do.
template <class F = simd::F32, class Executor>
[[nodiscard]] Status build_sheet_trace(const SheetLayer& layer, const Intrinsics& intrinsics, Workspace& workspace,
                                       SheetTrace& out, Executor& executor) {
  out = SheetTrace{};
  NPSIM_RETURN_IF_ERROR(validate(layer));
  NPSIM_RETURN_IF_ERROR(validate(intrinsics));
  const Shape shape = layer.vertices.shape();
  const sheet_layout::Levels levels = sheet_layout::levels_of(shape);
  if (levels.count == 0) return {};
  NPSIM_RETURN_IF_ERROR(sheet_layout::check_size(shape, levels));
  const sheet_layout::Block block = sheet_layout::block_of(levels);
  Span<unsigned char> bytes;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(block.bytes, bytes));
  SheetHeader header;
  header.magic = kSheetMagic;
  header.version = kSheetVersion;
  header.width = shape.width;
  header.height = shape.height;
  header.intrinsics = intrinsics;
  header.bytes = block.bytes;
  std::memcpy(bytes.data(), &header, sizeof header);
  // The padding after the bounds of rows; nothing that is stored was never written.
  std::memset(bytes.data() + block.bytes - kWorkspaceAlignment, 0, kWorkspaceAlignment);
  auto* const nodes = reinterpret_cast<SheetNode*>(bytes.data() + block.nodes);
  const float inf = std::numeric_limits<float>::infinity();
  for (std::size_t i = 0; i < levels.nodes; ++i) {
    std::fill_n(nodes[i].low, 16, inf);
    std::fill_n(nodes[i].high, 16, -inf);
  }
  SheetTrace sheet = sheet_layout::views_of(layer, levels, bytes);
  sheet.intrinsics = intrinsics;
  sheet.writable = bytes;
  NPSIM_RETURN_IF_ERROR(sheet_detail::fill_sheet<F>(levels, {0, 0, levels.across[0], levels.down[0]}, sheet, executor));
  out = sheet;
  return {};
}

// Brings the structure up to date with its layer, of which vertices (and quads with such a corner) have changed within
// `region`, in pixels. The result is that of building anew, bit for bit; after an error it hits nothing. Scenes that
// hold the layer have to be joined again. Cost: that of building the rows of 16 pixels that the region touches, and
// of the tiles and nodes of its quads.
template <class F = simd::F32, class Executor>
[[nodiscard]] Status refit_sheet_trace(const SheetRegion& region, SheetTrace& sheet, Executor& executor) {
  const Shape shape = sheet.vertices.shape();
  const bool inside = region.x >= 0 && region.y >= 0 && region.shape.width >= 0 && region.shape.height >= 0 &&
                      region.shape.width <= shape.width - region.x && region.shape.height <= shape.height - region.y;
  if (!inside) return {StatusCode::invalid_argument, "the region of a refit must lie within the layer"};
  const sheet_layout::Levels levels = sheet_layout::levels_of(shape);
  if (levels.count == 0 || region.shape.empty()) return {};
  if (sheet.writable.empty()) return {StatusCode::invalid_argument, "a structure in stored bytes cannot be refitted"};
  const int x1 = region.x + region.shape.width;
  const int y1 = region.y + region.shape.height;
  const auto group = [](int quad, int groups) { return std::min(std::max(quad, 0) / kSheetGroupQuads, groups - 1); };
  const int across = levels.across[0];
  const int down = levels.down[0];
  const sheet_detail::NodeRange range{group(region.x - 1, across), group(region.y - 1, down), group(x1 - 1, across) + 1,
                                      group(y1 - 1, down) + 1};
  return sheet_detail::fill_sheet<F>(levels, range, sheet, executor);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_BUILD_HPP
