// SPDX-License-Identifier: Apache-2.0
// One ray through a sheet: the tests of a ray against nodes, tiles, quads and faces, its way through the pyramid, and
// what is asked of it.
//
// A part counts when, on the ray's way through its columns and rows, 1 / depth comes into its bounds: at a node between
// least and greatest, at a tile and a quad within a slab about a plane, where the difference of ray and plane is linear
// and two values decide. Sixteen children at once.
//
// The ray, a straight line in (column, row, 1 / depth), starts at the smallest node that holds its projection and
// visits children in the order of its octant (`ordered`), so no distances are sorted, or in that of the image. What is
// still to be visited is one word of children for every level: the parents of a place are its numbers shifted. A walk
// can rest between any two steps: single rays take them all at once, streams (stream.hpp) take turns. The steps of a
// ray are the same either way, so are its hits.
//
// Invariant: only what intersect_triangle() would miss is left out (ray.hpp has the error of every step), and that test
// decides edges by the signs of values that neighbours share: nothing slips between two faces. Of equal t the lowest
// face is reported. Same hits for any number of lanes.
// Cost: about 35 vector instructions a node or a tile, 55 for the quads of a tile; about ten nodes and two tiles a ray,
// one after the other, so that a single ray waits for each. Memory: 400 bytes of stack.
#ifndef NPSIM_TRACE_DETAIL_SHEET_WALK_HPP
#define NPSIM_TRACE_DETAIL_SHEET_WALK_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/fixed.hpp"
#include "npsim/trace/detail/sheet/layout.hpp"
#include "npsim/trace/detail/sheet/ray.hpp"
#include "npsim/trace/detail/triangle.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace sheet_detail {

// Tests.

inline constexpr float kBeforeStart = -0x1p-20F;

// Swaps the columns of a block of 4x4 bits for rays to the left, and its rows for rays upwards, so that the lowest bit
// is the first on the way.
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t along(std::uint32_t m, std::uint32_t flip) noexcept {
  // Without branches: the octants of rays that follow each other have nothing to do with each other.
  const std::uint32_t pairs = (m & 0x5555U) << 1U | (m & 0xAAAAU) >> 1U;
  const std::uint32_t columns = (pairs & 0x3333U) << 2U | (pairs & 0xCCCCU) >> 2U;
  m ^= (m ^ columns) & (0U - (flip & 1U));
  const std::uint32_t bytes = (m & 0x0F0FU) << 4U | (m & 0xF0F0U) >> 4U;
  const std::uint32_t rows = (bytes & 0x00FFU) << 8U | (bytes & 0xFF00U) >> 8U;
  return m ^ ((m ^ rows) & (0U - (flip >> 2U & 1U)));
}

[[nodiscard]] inline std::uint32_t flip_of(const SheetRay& ray) noexcept {
  return (ray.du < 0 ? 3U : 0U) | (ray.dv < 0 ? 12U : 0U);
}

// Where the ray is in 16 cells of `size` quads from (x, y) on: s from `enter` to `leave`, empty if enter > leave.
template <class F>
struct Crossing {
  F enter, leave;

  template <class R>
  NPSIM_ALWAYS_INLINE Crossing(const R& ray, float x, float y, float size, int part) noexcept {
    const F columns = fma(simd::block_columns<F>(part), F(size), F(x));
    const F rows = fma(simd::block_rows<F>(part), F(size), F(y));
    // Times a power of two: exact.
    const F near_u = fma(columns, F(ray.iu), F(ray.near_u + size * ray.back_u));
    const F far_u = fma(columns, F(ray.iu), F(ray.far_u + size * ray.ahead_u));
    const F near_v = fma(rows, F(ray.iv), F(ray.near_v + size * ray.back_v));
    const F far_v = fma(rows, F(ray.iv), F(ray.far_v + size * ray.ahead_v));
    enter = max(max(near_u, near_v), F(kBeforeStart));
    leave = min(min(far_u, far_v), F(ray.s_max));
  }
};

// Lanes that come within `half` (and the pads) of the plane w = base + gx (u - x) + gy (v - y) between s = enter and
// leave. Lanes are cells, or rays where R has lanes.
template <class F, class R>
[[nodiscard]] NPSIM_ALWAYS_INLINE typename F::MaskType meets_slab(const R& ray, F enter, F leave, F from_x, F from_y,
                                                                  F base, F gx, F gy, F half) noexcept {
  // The difference at s = 0, and its change to s = 1.
  const F at = fma(-gx, from_x, fma(-gy, from_y, F(ray.w) - base));
  const F change = fma(-gx, F(ray.du), fma(-gy, F(ray.dv), F(ray.dw)));
  const F first = fma(enter, change, at);
  const F last = fma(leave, change, at);
  const F tolerance = fma(abs(gx) + abs(gy), F(ray.pad_px), half + F(ray.pad_w));
  return (enter <= leave) & (min(first, last) <= tolerance) & (max(first, last) >= -tolerance);
}

// Children of a node of nodes that matter; they are `size` quads wide, the first one's first quad is (x, y).
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t test_node(const SheetNode& node, const SheetRay& ray, float x, float y,
                                                          float size) noexcept {
  std::uint32_t mask = 0;
  for (int part = 0; part < simd::kBlockElements / F::lanes; ++part) {
    const int k = part * F::lanes;
    const Crossing<F> c(ray, x, y, size, part);
    const F first = fma(c.enter, F(ray.dw), F(ray.w));
    const F last = fma(c.leave, F(ray.dw), F(ray.w));
    const auto m = (c.enter <= c.leave) & (min(first, last) - F(ray.pad_w) <= F::load(node.high + k)) &
                   (max(first, last) + F(ray.pad_w) >= F::load(node.low + k));
    mask |= bits(m) << static_cast<unsigned>(k);
  }
  return mask;
}

// Tiles that matter.
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t test_tiles(const SheetTiles& tiles, const SheetRay& ray, float x,
                                                           float y) noexcept {
  std::uint32_t mask = 0;
  for (int part = 0; part < simd::kBlockElements / F::lanes; ++part) {
    const int k = part * F::lanes;
    const Crossing<F> c(ray, x, y, 4.0F, part);
    const F from_x = fma(simd::block_columns<F>(part), F(-4.0F), F(ray.u - x));
    const F from_y = fma(simd::block_rows<F>(part), F(-4.0F), F(ray.v - y));
    const auto m = meets_slab<F>(ray, c.enter, c.leave, from_x, from_y, F::load(tiles.base + k), F::load(tiles.gx + k),
                                 F::load(tiles.gy + k), F::load(tiles.half + k));
    mask |= bits(m) << static_cast<unsigned>(k);
  }
  return mask;
}

// The slabs of the quads of a tile, or of those of a part, about their own mean planes, which are moved to the tile's
// first pixel. The four corners of a quad lie at the same distance of its plane, on alternate sides, and between them
// what faces it has, whatever stands for a corner that they do not use. With corners a, b above c, d in steps of the
// relief the plane has the value (3 a + b + c - d) / 4 at a and changes by (d - a) / 2 and (b - c) / 2 along the
// diagonals.
template <class F>
struct QuadSlabs {
  F base, gx, gy, half;

  NPSIM_ALWAYS_INLINE QuadSlabs(const SheetTiles& tiles, unsigned k, const SheetRelief& relief, int part) noexcept {
    using I = typename F::Int;
    const int quad = part * F::lanes;
    const float step = tiles.half[k] * kSheetReliefStep;
    const I a = I::load_u8(relief.left + quad);
    const I b = I::load_u8(relief.right + quad);
    const I c = I::load_u8(relief.left + 4 + quad);
    const I d = I::load_u8(relief.right + 4 + quad);
    const I diagonal = d - a;
    const I sum = b + c;
    const F other = to_float(b - c);
    const F at_a = to_float(sum + a + a - diagonal);
    const F off = to_float(a + d - sum);
    gx = fma(to_float(diagonal) + other, F(0.5F * step), F(tiles.gx[k]));
    gy = fma(to_float(diagonal) - other, F(0.5F * step), F(tiles.gy[k]));
    const F bottom = fma(simd::block_columns<F>(part), F(tiles.gx[k]), F(tiles.base[k] - tiles.half[k]));
    base = fma(at_a, F(0.25F * step), fma(simd::block_rows<F>(part), F(tiles.gy[k]), bottom));
    half = fma(abs(off), F(0.25F * step), F(kSheetReliefError * step));
  }

  // Quads that matter to a ray, the tile being that at (x, y).
  template <class R>
  [[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t test(const R& ray, float x, float y, int part) const noexcept {
    const Crossing<F> cell(ray, x, y, 1.0F, part);
    const F from_x = F(ray.u - x) - simd::block_columns<F>(part);
    const F from_y = F(ray.v - y) - simd::block_rows<F>(part);
    return bits(meets_slab<F>(ray, cell.enter, cell.leave, from_x, from_y, base, gx, gy, half))
           << static_cast<unsigned>(part * F::lanes);
  }
};

// Quads with faces of tile k of 16, the one at (x, y), that matter.
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t test_quads(const SheetTiles& tiles, unsigned k,
                                                           const SheetRelief& relief, const SheetRay& ray, float x,
                                                           float y) noexcept {
  std::uint32_t mask = 0;
  for (int part = 0; part < simd::kBlockElements / F::lanes; ++part) {
    mask |= QuadSlabs<F>(tiles, k, relief, part).test(ray, x, y, part);
  }
  return mask & (relief.faces | relief.faces >> 16U);
}

// Of its upper face; the lower one has one more.
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t number_of_quad(const SheetTrace& sheet, int x, int y) noexcept {
  return 2U * (static_cast<std::uint32_t>(y) * static_cast<std::uint32_t>(sheet.quads.width()) +
               static_cast<std::uint32_t>(x));
}

// Calls hit(face, triangle hit) for what intersect_triangle() says is hit in one quad; true: stop.
template <class OnHit>
[[nodiscard]] NPSIM_ALWAYS_INLINE bool test_faces(const SheetTrace& sheet, const SheetRay& ray, int x, int y,
                                                  bool upper, bool lower, OnHit& on_hit) noexcept {
  const Vec3f* p = sheet.vertices.row(y) + x;
  const Vec3f* q = sheet.vertices.row(y + 1) + x;
  const Vec3f corners[4] = {p[0], p[1], q[0], q[1]};
  const bool anti = (sheet.quads(x, y) & kQuadAntiDiagonal) != 0;
  // The edge functions of intersect_triangle(), by the same operations: where two are not 0 and differ in sign it
  // misses.
  const RayFrame& f = ray.frame;
  float sx[4];
  float sy[4];
  for (int i = 0; i < 4; ++i) {
    const float at[3] = {corners[i].x, corners[i].y, corners[i].z};
    const float z = at[f.axis[2]] - f.origin[f.axis[2]];
    sx[i] = (at[f.axis[0]] - f.origin[f.axis[0]]) - f.shear[0] * z;
    sy[i] = (at[f.axis[1]] - f.origin[f.axis[1]]) - f.shear[1] * z;
  }
  const auto edge = [&sx, &sy](int i, int j) noexcept { return sx[i] * sy[j] - sy[i] * sx[j]; };
  const float across = anti ? edge(2, 1) : edge(3, 0);  // the diagonal, seen from the upper face
  const auto misses = [](float a, float b, float c) noexcept {
    return (a < 0 || b < 0 || c < 0) && (a > 0 || b > 0 || c > 0);
  };
  upper = upper && !misses(across, anti ? edge(1, 0) : edge(0, 1), anti ? edge(0, 2) : edge(1, 3));
  lower = lower && !misses(-across, anti ? edge(2, 3) : edge(3, 2), anti ? edge(3, 1) : edge(2, 0));
  if (!upper && !lower) return false;
  const std::uint32_t number = number_of_quad(sheet, x, y);
  for (const bool is_upper : {true, false}) {
    if (!(is_upper ? upper : lower)) continue;
    const Face face = quad_face(anti, is_upper, 0, 1, 2, 3);
    const Vec3f& a = corners[face.a];
    const Vec3f& b = corners[face.b];
    const Vec3f& c = corners[face.c];
    const float vertex[3][3] = {{a.x, a.y, a.z}, {b.x, b.y, b.z}, {c.x, c.y, c.z}};
    TriangleHit hit;
    if (intersect_triangle(ray.frame, vertex, hit) && on_hit(is_upper ? number : number + 1, hit)) return true;
  }
  return false;
}

[[nodiscard]] NPSIM_ALWAYS_INLINE std::size_t node_index(const SheetTrace& sheet, int level, int x, int y) noexcept {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(sheet.across[level]) + static_cast<std::size_t>(x);
}

// Where a tile is found.
struct TilePlace {
  std::size_t group;
  unsigned k;
};
[[nodiscard]] NPSIM_ALWAYS_INLINE TilePlace place_of_tile(const SheetTrace& sheet, int x, int y) noexcept {
  return {node_index(sheet, 0, x / 4, y / 4), static_cast<unsigned>(4 * (y % 4) + x % 4)};
}
[[nodiscard]] NPSIM_ALWAYS_INLINE const SheetRelief& relief_at(const SheetTrace& sheet, TilePlace tile) noexcept {
  return sheet.relief[16 * tile.group + tile.k];
}

// Every face in turn; true: stop.
template <class OnHit>
[[nodiscard]] bool test_everything(const SheetTrace& sheet, const SheetRay& ray, OnHit& on_hit) noexcept {
  for (int y = 0; y < sheet.quads.height(); ++y) {
    for (int x = 0; x < sheet.quads.width(); ++x) {
      const std::uint32_t faces =
          relief_at(sheet, place_of_tile(sheet, x / 4, y / 4)).faces >> static_cast<unsigned>(4 * (y % 4) + x % 4);
      if (test_faces(sheet, ray, x, y, (faces & 1U) != 0, (faces & 0x10000U) != 0, on_hit)) return true;
    }
  }
  return false;
}

// The way.

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

// What is asked: the nearest face, or whether there is one.
//
// A query has an Answer for each ray under way, begin(answer, ray), meet(answer, ray, face, hit), which says whether
// the ray is done, and the shortest way to its result. Of equal t the lowest face wins, whatever the order.

struct ClosestQuery {
  static constexpr bool kOrdered = true;  // what is near shortens the ray
  struct Answer {
    Hit best;
  };
  Span<Hit> hits;  // one a ray; face is kNoFace where there is none

  static void begin(Answer& answer, const SheetRay& ray) noexcept {
    answer.best = Hit{};
    answer.best.t = ray.frame.t_max;
  }
  [[nodiscard]] NPSIM_ALWAYS_INLINE static bool meet(Answer& answer, SheetRay& ray, std::uint32_t face,
                                                     const TriangleHit& hit) noexcept {
    // Without a hit yet best.t is t_max and the interval is open.
    Hit& best = answer.best;
    if (hit.t < best.t || (hit.t == best.t && best.face != kNoFace && face < best.face)) {
      best = Hit{hit.t, face, hit.u, hit.v};
      if (!ray.everything) shorten(ray, hit.t);
    }
    return false;
  }
  void end(const Answer& answer, std::size_t i) const noexcept {
    hits[i] = answer.best.face == kNoFace ? Hit{} : answer.best;
  }
  void miss(std::size_t i) const noexcept { hits[i] = Hit{}; }
};

template <class Accept>
struct AnyQuery {
  static constexpr bool kOrdered = false;  // one is as good as another, and order costs a sixth of a step
  struct Answer {
    bool blocked;
  };
  Accept& accept;
  Span<std::uint8_t> blocked;

  static void begin(Answer& answer, const SheetRay&) noexcept { answer.blocked = false; }
  [[nodiscard]] NPSIM_ALWAYS_INLINE bool meet(Answer& answer, SheetRay& ray, std::uint32_t face,
                                              const TriangleHit& hit) const noexcept {
    answer.blocked = hit.t < ray.frame.t_max && accept(face);
    return answer.blocked;
  }
  void end(const Answer& answer, std::size_t i) const noexcept { blocked[i] = answer.blocked ? 1 : 0; }
  void miss(std::size_t i) const noexcept { blocked[i] = 0; }
};

// From begin to end.

// One layer from begin to end; true: the ray is done.
template <class F, class Query>
NPSIM_ALWAYS_INLINE bool walk_sheet(const SheetTrace& sheet, std::uint32_t first_face, SheetRay& ray,
                                    const Query& query, typename Query::Answer& answer) noexcept {
  const auto on_hit = [&](std::uint32_t face, const TriangleHit& hit) noexcept {
    return query.meet(answer, ray, first_face + face, hit);
  };
  if (ray.everything) return test_everything(sheet, ray, on_hit);
  SheetWalk walk;
  for (Step step = begin_walk<Query::kOrdered>(sheet, ray, walk); step != Step::none; step = next_step(walk)) {
    if (step == Step::tile) {
      std::uint32_t faces = 0;
      const std::uint32_t quads = visit_tile<F, Query::kOrdered>(sheet, ray, walk, faces);
      const float end = ray.s_max;
      if (visit_quads(sheet, ray, walk, quads, faces, on_hit)) return true;
      if (ray.s_max < end) forget_beyond<F>(sheet, ray, walk);
    } else {
      add_children<Query::kOrdered>(test_at<F>(sheet, ray, walk.level, walk.x, walk.y), walk);
    }
  }
  return false;
}

// False when the ray can hit nothing.
template <class F, class Query>
[[nodiscard]] NPSIM_ALWAYS_INLINE bool trace_one(Span<const SheetTrace> layers, const SheetBounds& bounds,
                                                 const Ray& ray, const Query& query,
                                                 typename Query::Answer& answer) noexcept {
  SheetRay r;
  if (layers.empty() || !make_sheet_ray(bounds, ray, r)) return false;
  query.begin(answer, r);
  std::uint32_t first_face = 0;
  for (const SheetTrace& sheet : layers) {
    if (sheet.levels > 0 && walk_sheet<F>(sheet, first_face, r, query, answer)) break;
    first_face += sheet_face_count(sheet.vertices.shape());
  }
  return true;
}

template <class F>
[[nodiscard]] bool closest_of(Span<const SheetTrace> layers, const SheetBounds& bounds, const Ray& ray,
                              Hit& out) noexcept {
  ClosestQuery::Answer answer;
  if (!trace_one<F>(layers, bounds, ray, ClosestQuery{}, answer) || answer.best.face == kNoFace) return false;
  out = answer.best;
  return true;
}

template <class F, class Accept>
[[nodiscard]] bool any_of(Span<const SheetTrace> layers, const SheetBounds& bounds, const Ray& ray,
                          Accept& accept) noexcept {
  typename AnyQuery<Accept>::Answer answer;
  return trace_one<F>(layers, bounds, ray, AnyQuery<Accept>{accept, {}}, answer) && answer.blocked;
}

}  // namespace sheet_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_WALK_HPP
