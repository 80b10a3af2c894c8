// SPDX-License-Identifier: Apache-2.0
// A ray structure of a sheet that was stored: attached to its layer again after a check of every byte of it.
//
// SheetTrace::block is what to store. attach_sheet_trace() takes those bytes, read or mapped at any address of whole
// kWorkspaceAlignment, and the layer and camera that the structure was built from. Invariant: it succeeds only where
// the bytes are, bit for bit, those that build_sheet_trace() would make now, so that a structure which passed can
// neither lead a ray out of its arrays nor lose a hit. Whatever else the bytes hold gives a Status. In particular a
// structure from a build that rounds in another way (fused multiply-adds, say) is refused.
// Cost: one pass over layer and structure that writes nothing, on the calling thread; a little less than building.
// Memory: a tile's group on the stack. Error: none.
#ifndef NPSIM_TRACE_DETAIL_SHEET_STORE_HPP
#define NPSIM_TRACE_DETAIL_SHEET_STORE_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

#include "npsim/core/camera.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/sheet_layer.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/trace/detail/sheet/inverse_depth.hpp"
#include "npsim/trace/detail/sheet/layout.hpp"
#include "npsim/trace/detail/sheet/slab.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace sheet_detail {

[[nodiscard]] inline bool is_zero(const unsigned char* begin, const unsigned char* end) noexcept {
  return std::all_of(begin, end, [](unsigned char b) noexcept { return b == 0; });
}

template <class T>
[[nodiscard]] bool same_bits(const T& a, const T& b) noexcept {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

// Whether the header is that of a structure of this layer in so many bytes.
[[nodiscard]] inline Status check_header(const SheetHeader& header, Shape shape, const Intrinsics& intrinsics,
                                         std::size_t expected, std::size_t given) noexcept {
  if (header.magic != kSheetMagic) {
    return {StatusCode::invalid_argument, "not a stored structure of a sheet in this machine's byte order"};
  }
  if (header.version != kSheetVersion) {
    return {StatusCode::invalid_argument, "a stored structure of another version"};
  }
  if (header.width != shape.width || header.height != shape.height) {
    return {StatusCode::shape_mismatch, "the stored structure is of a layer of another size"};
  }
  if (header.bytes != expected || given != expected) {
    return {StatusCode::shape_mismatch, "the stored structure does not have the bytes that its size takes"};
  }
  const SheetHeader clean;
  if (!same_bits(header.intrinsics, intrinsics) || !same_bits(header.unused, clean.unused)) {
    return {StatusCode::invalid_argument, "the stored structure is of another camera"};
  }
  return {};
}

// Whether the slot of a parent holds a child's bounds.
[[nodiscard]] inline bool has_bounds(const SheetNode* nodes, int across, int x, int y, float low, float high) noexcept {
  const SheetNode& node =
      nodes[static_cast<std::size_t>(y / 4) * static_cast<std::size_t>(across) + static_cast<std::size_t>(x / 4)];
  const int k = 4 * (y % 4) + x % 4;
  return same_bits(node.low[k], low) && same_bits(node.high[k], high);
}

// Whether tiles, their reliefs, and bounds of rows are those of the vertices and quads.
template <class F>
[[nodiscard]] bool check_groups(const SheetTrace& sheet, const sheet_layout::Levels& levels,
                                Span<const RowBounds> rows) noexcept {
  bool good = true;
  for (int y = 0; y < levels.down[0] && good; ++y) {
    const std::size_t first = static_cast<std::size_t>(y) * static_cast<std::size_t>(levels.across[0]);
    const RowBounds bounds = build_row<F>(sheet, y, 0, levels.across[0], [&](int x, const SheetGroup& group) noexcept {
      const std::size_t at = first + static_cast<std::size_t>(x);
      good = good && same_bits(group.tiles, sheet.tiles[at]) &&
             std::memcmp(group.relief, &sheet.relief[16 * at], sizeof group.relief) == 0 &&
             (levels.count == 1 || has_bounds(sheet.nodes.data(), levels.across[1], x, y, group.low, group.high));
    });
    good = good && same_bits(bounds, rows[static_cast<std::size_t>(y)]);
  }
  return good;
}

// Whether nodes are those of their children, and slots without a child are empty.
[[nodiscard]] inline bool check_nodes(const SheetTrace& sheet, const sheet_layout::Levels& levels) noexcept {
  const float inf = std::numeric_limits<float>::infinity();
  for (int level = 0; level + 1 < levels.count; ++level) {
    const SheetNode* const own = sheet.nodes.data() + levels.first[level];
    const SheetNode* const parents = sheet.nodes.data() + levels.first[level + 1];
    // Whole parents: what lies beyond the level's own nodes is empty.
    for (int y = 0; y < 4 * levels.down[level + 1]; ++y) {
      for (int x = 0; x < 4 * levels.across[level + 1]; ++x) {
        float low = inf;
        float high = -inf;
        if (x < levels.across[level] && y < levels.down[level]) {
          if (level == 0) continue;  // check_groups()
          const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(levels.across[level]) +
                                 static_cast<std::size_t>(x);
          low = *std::min_element(own[at].low, own[at].low + 16);
          high = *std::max_element(own[at].high, own[at].high + 16);
        }
        if (!has_bounds(parents, levels.across[level + 1], x, y, low, high)) return false;
      }
    }
  }
  return true;
}

}  // namespace sheet_detail

// `out` points at the bytes and at the layer and stays good as long as both do.
template <class F = simd::F32>
[[nodiscard]] Status attach_sheet_trace(const SheetLayer& layer, const Intrinsics& intrinsics,
                                        Span<const unsigned char> stored, SheetTrace& out) noexcept {
  using namespace sheet_layout;
  out = SheetTrace{};
  NPSIM_RETURN_IF_ERROR(validate(layer));
  NPSIM_RETURN_IF_ERROR(validate(intrinsics));
  const Shape shape = layer.vertices.shape();
  const Levels levels = levels_of(shape);
  if (levels.count == 0) {
    return stored.empty() ? Status() : Status(StatusCode::shape_mismatch, "a layer without quads has no structure");
  }
  NPSIM_RETURN_IF_ERROR(check_size(shape, levels));
  if (stored.size() < sizeof(SheetHeader)) {
    return {StatusCode::shape_mismatch, "the stored structure ends within its header"};
  }
  if (reinterpret_cast<std::uintptr_t>(stored.data()) % kWorkspaceAlignment != 0) {
    return {StatusCode::invalid_argument, "a stored structure has to lie at an address of whole 64 bytes"};
  }
  SheetHeader header;
  std::memcpy(&header, stored.data(), sizeof header);
  const Block block = block_of(levels);
  NPSIM_RETURN_IF_ERROR(sheet_detail::check_header(header, shape, intrinsics, block.bytes, stored.size()));

  SheetTrace sheet = views_of(layer, levels, stored);
  sheet.intrinsics = intrinsics;
  const Span<const RowBounds> rows(reinterpret_cast<const RowBounds*>(stored.data() + block.rows),
                                   static_cast<std::size_t>(levels.down[0]));
  const unsigned char* const bytes = stored.data();
  const bool good = sheet_detail::check_groups<F>(sheet, levels, rows) && sheet_detail::check_nodes(sheet, levels) &&
                    sheet_detail::is_zero(bytes + block.rows + rows.size() * sizeof(RowBounds), bytes + block.bytes);
  if (!good) return {StatusCode::invalid_argument, "the stored structure is not that of this layer"};
  NPSIM_RETURN_IF_ERROR(sheet_detail::put_bounds_of(rows, sheet));
  if (sheet.bounds.max_inverse_depth > 0.0F) sheet.levels = levels.count;
  out = sheet;
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_STORE_HPP
