// SPDX-License-Identifier: Apache-2.0
// The tests of one ray against the parts of a sheet (sheet_layout.hpp): nodes, tiles, quads, faces.
//
// A part counts when, on the ray's way through its columns and rows, 1 / depth comes into its bounds: at a node between
// least and greatest, at a tile and a quad within a slab about a plane, where the difference of ray and plane is linear
// and two values decide. Sixteen children at once.
//
// Invariant: only what intersect_triangle() would miss is left out (sheet_ray.hpp has the error of every step). Same
// bits for any number of lanes. Cost: about 35 vector instructions a node or a tile, 55 for the quads of a tile.
// Memory: none.
#ifndef NPSIM_TRACE_DETAIL_SHEET_TEST_HPP
#define NPSIM_TRACE_DETAIL_SHEET_TEST_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/block.hpp"
#include "npsim/trace/detail/sheet/layout.hpp"
#include "npsim/trace/detail/sheet/ray.hpp"
#include "npsim/trace/detail/triangle/triangle.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace sheet_detail {

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

}  // namespace sheet_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_TEST_HPP
