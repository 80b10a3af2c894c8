// SPDX-License-Identifier: Apache-2.0
// The way of a ray through the pyramid of a sheet (sheet_layout.hpp), one step at a time.
//
// The ray, a straight line in (column, row, 1 / depth), starts at the smallest node that holds its projection and
// visits children in the order of its octant (`ordered`), so no distances are sorted, or in that of the image. What is
// still to be visited is one word of children for every level: the parents of a place are its numbers shifted. A walk
// can rest between any two steps: single rays (sheet_traverse.hpp) take them all at once, streams (sheet_stream.hpp)
// take turns. The steps of a ray are the same either way, so are its hits. Memory: 32 bytes a walk.
#ifndef NPSIM_TRACE_DETAIL_SHEET_WALK_HPP
#define NPSIM_TRACE_DETAIL_SHEET_WALK_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/simd/fixed.hpp"
#include "npsim/trace/detail/sheet/layout.hpp"
#include "npsim/trace/detail/sheet/ray.hpp"
#include "npsim/trace/detail/sheet/test.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace sheet_detail {

// What a walk has before it.
enum class Step { tile, tiles, nodes, none };

// 1 for what is not 0; no branch comes of it.
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t some(std::uint32_t children) noexcept { return (0U - children) >> 31U; }

struct SheetWalk {
  int x, y;                                 // of the node, in nodes of its level
  int level;                                // -1: a tile, 0: a SheetTiles
  std::uint32_t pending;                    // bit l: a child of the node visited last on level l
  std::uint32_t flip;                       // 0: in the order of the image
  std::uint16_t children[kSheetMaxLevels];  // to be visited, in order
};

[[nodiscard]] NPSIM_ALWAYS_INLINE Step step_at(int level) noexcept { return static_cast<Step>(std::min(level, 1) + 1); }

// The smallest node of level `lowest` or above that holds these columns and rows, as far as they lie in the layer.
NPSIM_ALWAYS_INLINE void start_at(const SheetTrace& sheet, float least_u, float most_u, float least_v, float most_v,
                                  int lowest, SheetWalk& walk) noexcept {
  const auto tile = [](float at, int quads) {
    const float last = static_cast<float>((quads - 1) / 4);
    return static_cast<int>(std::min(std::max(at * 0.25F, 0.0F), last));
  };
  const int x0 = tile(least_u, sheet.quads.width());
  const int x1 = tile(most_u, sheet.quads.width());
  const int y0 = tile(least_v, sheet.quads.height());
  const int y1 = tile(most_v, sheet.quads.height());
  const auto differ = static_cast<std::uint32_t>((x0 ^ x1) | (y0 ^ y1));
  walk.level = std::max(highest_set_bit(differ * 4U + 2U) / 2 - 1, lowest);
  walk.x = x0 >> (2 * walk.level + 2);
  walk.y = y0 >> (2 * walk.level + 2);
  walk.pending = 0;
}

// The smallest node that holds what the projection may touch.
template <bool ordered>
[[nodiscard]] NPSIM_ALWAYS_INLINE Step begin_walk(const SheetTrace& sheet, const SheetRay& ray,
                                                  SheetWalk& walk) noexcept {
  const float end_u = ray.u + ray.du;
  const float end_v = ray.v + ray.dv;
  start_at(sheet, std::min(ray.u, end_u) - ray.pad_px, std::max(ray.u, end_u) + ray.pad_px,
           std::min(ray.v, end_v) - ray.pad_px, std::max(ray.v, end_v) + ray.pad_px, -1, walk);
  walk.flip = ordered ? flip_of(ray) : 0;
  return step_at(walk.level);
}

// The next child on the way.
[[nodiscard]] NPSIM_ALWAYS_INLINE Step next_step(SheetWalk& walk) noexcept {
  if (walk.pending == 0) return Step::none;
  const int level = lowest_set_bit(walk.pending);
  const int up = 2 * (level - walk.level);
  std::uint32_t left = walk.children[level];
  const auto k = static_cast<unsigned>(lowest_set_bit(left)) ^ walk.flip;
  left &= left - 1;
  walk.children[level] = static_cast<std::uint16_t>(left);
  walk.pending &= ~((some(left) ^ 1U) << static_cast<unsigned>(level));
  walk.x = 4 * (walk.x >> up) + static_cast<int>(k & 3U);
  walk.y = 4 * (walk.y >> up) + static_cast<int>(k >> 2U);
  walk.level = level - 1;
  return step_at(walk.level);
}

// The children of node (x, y) of level 0 that matter.
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t test_tiles_at(const SheetTrace& sheet, const SheetRay& ray, int x,
                                                              int y) noexcept {
  return test_tiles<F>(sheet.tiles[node_index(sheet, 0, x, y)], ray, static_cast<float>(kSheetGroupQuads * x),
                       static_cast<float>(kSheetGroupQuads * y));
}

// The same of a level above.
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t test_node_at(const SheetTrace& sheet, const SheetRay& ray, int level,
                                                             int x, int y) noexcept {
  const int size = 4 << (2 * level);
  return test_node<F>(sheet.nodes[sheet.first[level] + node_index(sheet, level, x, y)], ray,
                      static_cast<float>(4 * x * size), static_cast<float>(4 * y * size), static_cast<float>(size));
}

template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t test_at(const SheetTrace& sheet, const SheetRay& ray, int level, int x,
                                                        int y) noexcept {
  return level == 0 ? test_tiles_at<F>(sheet, ray, x, y) : test_node_at<F>(sheet, ray, level, x, y);
}

template <bool ordered>
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t in_order(std::uint32_t m, const SheetWalk& walk) noexcept {
  return ordered ? along(m, walk.flip) : m;
}

// What a test of the node before the walk found.
template <bool ordered>
NPSIM_ALWAYS_INLINE void add_children(std::uint32_t found, SheetWalk& walk) noexcept {
  const std::uint32_t m = in_order<ordered>(found, walk);
  walk.children[walk.level] = static_cast<std::uint16_t>(m);
  walk.pending |= some(m) << static_cast<unsigned>(walk.level);
}

// After an ordered walk's ray was shortened: forgets what lies beyond its end.
template <class F>
void forget_beyond(const SheetTrace& sheet, const SheetRay& ray, SheetWalk& walk) noexcept {
  for (std::uint32_t rest = walk.pending; rest != 0; rest &= rest - 1) {
    const int level = lowest_set_bit(rest);
    const int up = 2 * (level - walk.level);
    const std::uint32_t m =
        along(test_at<F>(sheet, ray, level, walk.x >> up, walk.y >> up), walk.flip) & walk.children[level];
    walk.children[level] = static_cast<std::uint16_t>(m);
    walk.pending &= ~((some(m) ^ 1U) << static_cast<unsigned>(level));
  }
}

NPSIM_ALWAYS_INLINE void prefetch_relief(const SheetTrace& sheet, TilePlace tile) noexcept {
  const SheetRelief& relief = relief_at(sheet, tile);
  simd::prefetch(relief.left);  // every other one lies across two lines
  simd::prefetch(&relief.unused);
}

// The faces of a tile, and those of its quads that matter, in order.
template <class F, bool ordered>
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t visit_tile(const SheetTrace& sheet, const SheetRay& ray,
                                                           const SheetWalk& walk, std::uint32_t& faces) noexcept {
  const TilePlace tile = place_of_tile(sheet, walk.x, walk.y);
  const SheetRelief& relief = relief_at(sheet, tile);
  faces = relief.faces;
  return in_order<ordered>(test_quads<F>(sheet.tiles[tile.group], tile.k, relief, ray, static_cast<float>(4 * walk.x),
                                         static_cast<float>(4 * walk.y)),
                           walk);
}

// Calls on_hit(face, hit) for what the ray hits in quads that visit_tile() found; true: stop.
template <class OnHit>
[[nodiscard]] NPSIM_ALWAYS_INLINE bool visit_quads(const SheetTrace& sheet, const SheetRay& ray, const SheetWalk& walk,
                                                   std::uint32_t quads, std::uint32_t faces, OnHit& on_hit) noexcept {
  for (; quads != 0; quads &= quads - 1) {
    const auto k = static_cast<unsigned>(lowest_set_bit(quads)) ^ walk.flip;
    if (test_faces(sheet, ray, 4 * walk.x + static_cast<int>(k & 3U), 4 * walk.y + static_cast<int>(k >> 2U),
                   (faces >> k & 1U) != 0, (faces >> (16U + k) & 1U) != 0, on_hit)) {
      return true;
    }
  }
  return false;
}

}  // namespace sheet_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_WALK_HPP
