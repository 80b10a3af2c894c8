// SPDX-License-Identifier: Apache-2.0
// The tiles of a sheet's ray structure, sixteen at once: the slabs that hold their faces, and their reliefs.
//
// The slopes of a tile's plane are the mean differences of neighbouring vertices with weights 2 3 3 2 (the
// least-squares plane where no vertex is missing), its slab is the narrowest about it; roads and facades are planes in
// inverse depth as well, so their slabs are thin. Vertices that no face has count nowhere. Lanes are tiles; no fused
// operation is used, so that all machines build the same bytes. Error: with e = 2^-20 (w + 4 |gx| + 4 |gy|), w the
// greatest of the tile, a vertex lies in its slab to within e, and where the relief says to within kSheetReliefError
// steps and e. q is a quotient of rounded differences, below 255 (1 + 4 x 2^-24), rounded to the nearest; slabs thinner
// than 2^-100 have the relief 0. Cost: about 2 ns a pixel, inverse depths included. Memory: 14 KiB of stack.
#ifndef NPSIM_TRACE_DETAIL_SHEET_SLAB_HPP
#define NPSIM_TRACE_DETAIL_SHEET_SLAB_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

#include "npsim/simd/batch.hpp"
#include "npsim/simd/block.hpp"
#include "npsim/trace/detail/sheet/faces.hpp"
#include "npsim/trace/detail/sheet/inverse_depth.hpp"
#include "npsim/trace/detail/sheet/layout.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

namespace sheet_detail {

// 16 tiles and the bounds of w in them.
struct SheetGroup {
  SheetTiles tiles;
  SheetRelief relief[16];
  float low, high;
};

// Of the tiles of a part: their vertices, and which of them faces have.
template <class F>
struct TileVertices {
  F w[25];
  typename F::Int used;

  [[nodiscard]] NPSIM_ALWAYS_INLINE typename F::MaskType has(int i, int j) const noexcept {
    return (used & typename F::Int(1 << (5 * j + i))) != typename F::Int(0);
  }
};

template <class F>
NPSIM_ALWAYS_INLINE void load_vertices(const float* w, int part, F (&out)[25]) noexcept {
  constexpr std::ptrdiff_t kStride = InverseDepths::kStride;
  for (int j = 0; j < 5; ++j) {
    F columns[4];
    simd::load_columns<F>(w + j * kStride + 1, 4 * kStride, part, columns);
    out[5 * j + 4] = columns[3];
    simd::load_columns<F>(w + j * kStride, 4 * kStride, part, columns);
    for (int i = 0; i < 4; ++i) out[5 * j + i] = columns[i];
  }
}

// Numbers below 256 as bytes in the order of memory.
template <class I>
[[nodiscard]] NPSIM_ALWAYS_INLINE I four_bytes(I a, I b, I c, I d) noexcept {
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
  return (a << 24 | b << 16) | (c << 8 | d);
#else
  return (a | b << 8) | (c << 16 | d << 24);
#endif
}

// Slabs and reliefs of the tiles of a part. whole: all their vertices are used.
template <bool whole, class F>
NPSIM_ALWAYS_INLINE void make_tiles(const TileVertices<F>& v, int part, SheetTiles& tiles,
                                    std::int32_t (&bytes)[10][16], F& low, F& high) noexcept {
  using I = typename F::Int;
  const auto or_else = [&](int i, int j, F value, F otherwise) noexcept {
    if constexpr (whole) {
      return value;
    } else {
      return select(v.has(i, j), value, otherwise);
    }
  };
  const F inf(std::numeric_limits<float>::infinity());
  // Differences of neighbours with the weights that they have in the least-squares plane of all 25.
  constexpr float kWeights[4] = {2.0F, 3.0F, 3.0F, 2.0F};
  F slope[2] = {F(0.0F), F(0.0F)};
  F weight[2] = {F(0.0F), F(0.0F)};
  for (int axis = 0; axis < 2; ++axis) {
    const int di = axis == 0 ? 1 : 0;
    const int dj = 1 - di;
    for (int j = 0; j + dj < 5; ++j) {
      for (int i = 0; i + di < 5; ++i) {
        const F one(kWeights[axis == 0 ? i : j]);
        const F step = one * (v.w[5 * (j + dj) + i + di] - v.w[5 * j + i]);
        slope[axis] = slope[axis] + or_else(i, j, or_else(i + di, j + dj, step, F(0.0F)), F(0.0F));
        weight[axis] = weight[axis] + or_else(i, j, or_else(i + di, j + dj, one, F(0.0F)), F(0.0F));
      }
    }
    slope[axis] = slope[axis] / max(weight[axis], F(1.0F));
  }
  F rest[25];
  F least = inf;
  F greatest = -inf;
  for (int j = 0; j < 5; ++j) {
    for (int i = 0; i < 5; ++i) {
      const F w = v.w[5 * j + i];
      const F r = w - slope[0] * F(static_cast<float>(i)) - slope[1] * F(static_cast<float>(j));
      rest[5 * j + i] = r;
      least = min(or_else(i, j, r, inf), least);
      greatest = max(or_else(i, j, r, -inf), greatest);
      low = min(or_else(i, j, w, inf), low);
      high = max(or_else(i, j, w, -inf), high);
    }
  }
  const int k = part * F::lanes;
  const typename F::MaskType some = least <= greatest;
  select(some, F(0.5F) * (least + greatest), F(0.0F)).store(tiles.base + k);
  slope[0].store(tiles.gx + k);
  slope[1].store(tiles.gy + k);
  const F range = greatest - least;
  (F(0.5F) * range).store(tiles.half + k);
  // What is so thin is lost in every tolerance of a ray.
  const F scale = select(range > F(0x1p-100F), F(255.0F) / range, F(0.0F));
  for (int j = 0; j < 5; ++j) {
    I q[5];
    for (int i = 0; i < 5; ++i) {
      const F r = or_else(i, j, rest[5 * j + i] - least, F(0.0F)) * scale;
      q[i] = bitcast_int(r + F(0x1p23F)) & I(255);  // to the nearest
    }
    four_bytes(q[0], q[1], q[2], q[3]).store(&bytes[j][k]);
    four_bytes(q[1], q[2], q[3], q[4]).store(&bytes[5 + j][k]);
  }
}

// Group x of row y of groups, from its first inverse depth in a strip.
template <class F>
void build_group(const SheetTrace& sheet, const float* w, int x, int y, SheetGroup& out) noexcept {
  using I = typename F::Int;
  constexpr int kParts = simd::kBlockElements / F::lanes;
  TileVertices<F> vertices[static_cast<std::size_t>(kParts)];
  std::int32_t there[16];
  for (int part = 0; part < kParts; ++part) {
    load_vertices<F>(w, part, vertices[part].w);
    I seen(0);
    for (int b = 0; b < 25; ++b) seen = seen | select(vertices[part].w[b] > F(0.0F), I(1 << b), I(0));
    seen.store(there + part * F::lanes);
  }
  std::int32_t used[16];
  bool whole = true;
  for (int k = 0; k < 16; ++k) {
    const sheet_layout::TileFaces tile =
        sheet_layout::tile_faces(sheet.quads, kSheetGroupQuads * x + 4 * (k % 4), kSheetGroupQuads * y + 4 * (k / 4),
                                 static_cast<std::uint32_t>(there[k]));
    out.relief[k].faces = tile.faces;
    used[k] = static_cast<std::int32_t>(tile.used);
    whole = whole && tile.used == sheet_layout::kAllVertices;
  }
  std::int32_t bytes[10][16];
  F low(std::numeric_limits<float>::infinity());
  F high = -low;
  for (int part = 0; part < kParts; ++part) {
    vertices[part].used = I::load(used + part * F::lanes);
    if (whole) {
      make_tiles<true>(vertices[part], part, out.tiles, bytes, low, high);
    } else {
      make_tiles<false>(vertices[part], part, out.tiles, bytes, low, high);
    }
  }
  out.low = std::numeric_limits<float>::infinity();
  out.high = -out.low;
  for (int i = 0; i < F::lanes; ++i) {
    out.low = std::min(out.low, low.lane(i));
    out.high = std::max(out.high, high.lane(i));
  }
  for (int k = 0; k < 16; ++k) {
    SheetRelief& relief = out.relief[k];
    for (int j = 0; j < 5; ++j) {
      std::memcpy(relief.left + 4 * j, &bytes[j][k], 4);
      std::memcpy(relief.right + 4 * j, &bytes[5 + j][k], 4);
    }
    relief.unused = 0;
  }
}

// Groups [x0, x1) of row `row` of groups, given to put(x, group), and what all vertices of the row add to the bounds.
template <class F, class Put>
[[nodiscard]] RowBounds build_row(const SheetTrace& sheet, int row, int x0, int x1, Put&& put) noexcept {
  FoundBounds<F> found;
  InverseDepths strip;
  SheetGroup group;
  for (int first = 0; first < sheet.across[0]; first += kStripGroups) {
    invert_strip<F>(sheet, row, first, strip, found);
    for (int x = std::max(first, x0); x < std::min(first + kStripGroups, x1); ++x) {
      build_group<F>(sheet, &strip.w[0][kSheetGroupQuads * (x - first)], x, row, group);
      put(x, group);
    }
  }
  return found.bounds();
}

}  // namespace sheet_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_SLAB_HPP
