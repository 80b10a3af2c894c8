// SPDX-License-Identifier: Apache-2.0
// Builds the ray structure of a layer (layout.hpp): inverse depths strip by strip, the faces of each tile, its slab and
// relief, the nodes above, and the bounds of all vertices.
//
// Inverse depths. A vertex that is missing, not finite, beyond kTraceMaxCoordinate or nearer than kSheetMinDepth has
// inverse depth 0: its faces are left out. Vertices may lie off their pixels' rays: the largest distance is found, and
// every test of a ray is that much more generous, which costs speed and nothing else.
//
// Faces. One is there where its quad says so and its three vertices are there: all 32 of a tile at once, one bit each.
// Numbers of 16 bits stand for quads, in raster order, numbers of 25 for vertices: bit 5 j + i.
//
// Slabs. The slopes of a tile's plane are the mean differences of neighbouring vertices with weights 2 3 3 2 (the
// least-squares plane where no vertex is missing), its slab is the narrowest about it; roads and facades are planes in
// inverse depth as well, so their slabs are thin. Vertices that no face has count nowhere.
//
// Invariant: the same bytes for any executor, any number of lanes (which are tiles; no fused operation is used) and any
// order of bytes. No sorting, no index buffer.
//
// Error: an inverse depth is 1 / depth rounded once. With e = 2^-20 (w + 4 |gx| + 4 |gy|), w the greatest of the tile,
// a vertex lies in its slab to within e, and where the relief says to within kSheetReliefError steps and e: q is a
// quotient of rounded differences, below 255 (1 + 4 x 2^-24), rounded to the nearest; slabs thinner than 2^-100 have
// the relief 0.
//
// Cost: one pass over the layer, 2 to 4 ns a pixel. Memory: 14 KiB of stack beside the workspace.
#ifndef NPSIM_TRACE_DETAIL_SHEET_BUILD_HPP
#define NPSIM_TRACE_DETAIL_SHEET_BUILD_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/fixed.hpp"
#include "npsim/trace/detail/sheet/layout.hpp"
#include "npsim/trace/detail/triangle.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr float kSheetMinDepth = 0x1p-40F;  // metres

namespace sheet_detail {

// Sizes.

[[nodiscard]] constexpr int groups_of(int quads) noexcept { return (quads + kSheetGroupQuads - 1) / kSheetGroupQuads; }

struct Levels {
  int count = 0;
  int across[kSheetMaxLevels] = {};
  int down[kSheetMaxLevels] = {};
  std::size_t first[kSheetMaxLevels] = {};
  std::size_t nodes = 0;
  [[nodiscard]] constexpr std::size_t groups() const noexcept {
    return static_cast<std::size_t>(across[0]) * static_cast<std::size_t>(down[0]);
  }
};

[[nodiscard]] constexpr Levels levels_of(Shape pixels) noexcept {
  Levels out;
  const Shape q = quad_shape(pixels);
  if (q.empty()) return out;
  int across = groups_of(q.width);
  int down = groups_of(q.height);
  for (int level = 0; level < kSheetMaxLevels; ++level) {
    out.across[level] = across;
    out.down[level] = down;
    out.count = level + 1;
    if (level > 0) {
      out.first[level] = out.nodes;
      out.nodes += static_cast<std::size_t>(across) * static_cast<std::size_t>(down);
    }
    if (across == 1 && down == 1) break;
    across = (across + 3) / 4;
    down = (down + 3) / 4;
  }
  return out;
}

// What cannot be numbered or has no node above all others is refused.
[[nodiscard]] inline Status check_size(Shape pixels, const Levels& levels) noexcept {
  if (pixels.pixels() >= (std::size_t{1} << 30U)) {
    return {StatusCode::capacity_exceeded, "a ray tracer takes fewer than 2^31 faces"};
  }
  if (levels.across[levels.count - 1] > 1 || levels.down[levels.count - 1] > 1) {
    return {StatusCode::capacity_exceeded, "a traced layer has at most 4^9 quads a side"};
  }
  return {};
}

// Inverse depths, and where the vertices are.

// What a row of groups learns about its vertices.
struct RowBounds {
  float low[3];
  float high[3];
  float max_inverse_depth;
  float off_grid_px;
};

inline constexpr int kStripGroups = 8;
inline constexpr int kStripQuads = kStripGroups * kSheetGroupQuads;

// What vertices add to the bounds of a row of groups.
template <class F>
struct FoundBounds {
  F low[3];
  F high[3];
  F greatest = F(0.0F);
  F off = F(0.0F);

  FoundBounds() noexcept {
    for (int i = 0; i < 3; ++i) {
      low[i] = F(std::numeric_limits<float>::infinity());
      high[i] = F(-std::numeric_limits<float>::infinity());
    }
  }
  [[nodiscard]] RowBounds bounds() const noexcept {
    const float inf = std::numeric_limits<float>::infinity();
    RowBounds out{{inf, inf, inf}, {-inf, -inf, -inf}, 0.0F, 0.0F};
    for (int i = 0; i < F::lanes; ++i) {
      for (int c = 0; c < 3; ++c) {
        // + 0: of zeros of both signs the least would depend on the number of lanes.
        out.low[c] = std::min(out.low[c], low[c].lane(i) + 0.0F);
        out.high[c] = std::max(out.high[c], high[c].lane(i) + 0.0F);
      }
      out.max_inverse_depth = std::max(out.max_inverse_depth, greatest.lane(i));
      out.off_grid_px = std::max(out.off_grid_px, off.lane(i));
    }
    return out;
  }
};

// Inverse depths of pixels [x0, x1) of row y.
template <class F>
void invert_row(const SheetTrace& sheet, int y, int x0, int x1, float* out, FoundBounds<F>& found) noexcept {
  using M = typename F::MaskType;
  const Intrinsics& k = sheet.intrinsics;
  const F inf(std::numeric_limits<float>::infinity());
  const Vec3f* p = sheet.vertices.row(y);
  const float v = static_cast<float>(y) + 0.5F - k.cy;
  FoundBounds<F> all = found;
  for (int x = x0; x < x1; x += F::lanes) {
    const int n = std::min(F::lanes, x1 - x);
    // The next strip's pixels: rows of strips are too short for the machine to see them coming.
    for (int i = 0; i < F::lanes; i += 5) simd::prefetch(p + std::min(x + kStripQuads + i, sheet.vertices.width() - 1));
    const simd::F32x3<F> at = simd::load3<F>(&p[x].x, n);
    const M good = (at.z >= F(kSheetMinDepth)) & (at.z <= F(kTraceMaxCoordinate)) &
                   (abs(at.x) <= F(kTraceMaxCoordinate)) & (abs(at.y) <= F(kTraceMaxCoordinate));
    const F w = select(good, F(1.0F) / select(good, at.z, F(1.0F)), F(0.0F));
    if (n == F::lanes) {
      w.store(out + (x - x0));
    } else {
      w.store(out + (x - x0), n);
    }
    const F xyz[3] = {at.x, at.y, at.z};
    for (int i = 0; i < 3; ++i) {
      all.low[i] = min(select(good, xyz[i], inf), all.low[i]);
      all.high[i] = max(select(good, xyz[i], -inf), all.high[i]);
    }
    all.greatest = max(w, all.greatest);
    const F u = to_float(typename F::Int(x) + F::Int::iota()) + F(0.5F - k.cx);
    const F du = abs(at.x * w * F(k.fx) - u);
    const F dv = abs(at.y * w * F(k.fy) - F(v));
    all.off = max(select(good, max(du, dv), F(0.0F)), all.off);
  }
  found = all;
}

// Inverse depths of kStripGroups groups side by side, and of the pixels that close them on the right and below.
struct InverseDepths {
  static constexpr int kRows = kSheetGroupQuads + 1;
  static constexpr int kStride = kStripQuads + 16;
  alignas(64) float w[kRows][kStride];
};

// Those of the groups from `first` on in row `row` of groups, 0 beside the layer. For first > 0 `strip` has to hold
// those before.
template <class F>
void invert_strip(const SheetTrace& sheet, int row, int first, InverseDepths& strip, FoundBounds<F>& found) noexcept {
  const Shape pixels = sheet.vertices.shape();
  const int left = kSheetGroupQuads * first;
  for (int j = 0; j < InverseDepths::kRows; ++j) {
    float* const w = strip.w[j];
    const int y = kSheetGroupQuads * row + j;
    if (first > 0) w[0] = w[kStripQuads];
    const int begin = first > 0 ? 1 : 0;
    const int end = y < pixels.height ? std::min(kStripQuads + 1, pixels.width - left) : begin;
    invert_row<F>(sheet, y, left + begin, left + end, w + begin, found);
    if (y < sheet.quads.height()) {
      for (int i = 0; i < kStripQuads; i += 64) {
        simd::prefetch(sheet.quads.row(y) + std::min(left + kStripQuads + i, sheet.quads.width() - 1));
      }
    }
    std::fill(w + end, w + kStripQuads + 1, 0.0F);
  }
}

// Faces of a tile.

inline constexpr std::uint32_t kAllVertices = (1U << 25U) - 1U;
inline constexpr std::uint32_t kAllFaces = ~0U;

struct TileFaces {
  std::uint32_t faces;  // as in SheetRelief
  std::uint32_t used;   // the vertices that they have
};

// Bit `bit` of four bytes, the lowest byte's first.
[[nodiscard]] constexpr std::uint32_t bit_of_bytes(std::uint32_t bytes, unsigned bit) noexcept {
  return ((bytes >> bit & 0x01010101U) * 0x01020408U) >> 24U & 0xFU;
}

// The quads whose upper left corner is among the vertices, and the other way round.
[[nodiscard]] constexpr std::uint32_t quads_at(std::uint32_t vertices) noexcept {
  return (vertices & 0xFU) | (vertices >> 1U & 0xF0U) | (vertices >> 2U & 0xF00U) | (vertices >> 3U & 0xF000U);
}
[[nodiscard]] constexpr std::uint32_t vertices_at(std::uint32_t quads) noexcept {
  return (quads & 0xFU) | (quads & 0xF0U) << 1U | (quads & 0xF00U) << 2U | (quads & 0xF000U) << 3U;
}

// The tile at quad (x, y), of whose vertices `there` are there.
[[nodiscard]] inline TileFaces tile_faces(const ImageView<const std::uint8_t>& quads, int x, int y,
                                          std::uint32_t there) noexcept {
  constexpr std::uint32_t kBoth = kQuadUpperFace | kQuadLowerFace;
  const int rows = std::min(4, quads.height() - y);
  std::uint32_t row[4] = {};
  if (x + 4 <= quads.width()) {
    for (int j = 0; j < rows; ++j) {
      const std::uint8_t* q = quads.row(y + j) + x;
      row[j] = q[0] | static_cast<std::uint32_t>(q[1]) << 8U | static_cast<std::uint32_t>(q[2]) << 16U |
               static_cast<std::uint32_t>(q[3]) << 24U;
    }
  } else {
    for (int j = 0; j < rows; ++j) {
      for (int i = 0; x + i < quads.width(); ++i) {
        row[j] |= static_cast<std::uint32_t>(quads(x + i, y + j)) << static_cast<unsigned>(8 * i);
      }
    }
  }
  if ((~(row[0] & row[1] & row[2] & row[3]) & 0x01010101U * kBoth) == 0 && there == kAllVertices) {
    return {kAllFaces, kAllVertices};
  }
  std::uint32_t anti = 0;
  std::uint32_t upper = 0;
  std::uint32_t lower = 0;
  for (unsigned j = 0; j < 4; ++j) {
    anti |= bit_of_bytes(row[j], 0) << 4 * j;
    upper |= bit_of_bytes(row[j], 1) << 4 * j;
    lower |= bit_of_bytes(row[j], 2) << 4 * j;
  }
  // Corners A, B above C, D. The diagonal is A-D or, where `anti`, B-C.
  const std::uint32_t a = quads_at(there);
  const std::uint32_t b = quads_at(there >> 1U);
  const std::uint32_t c = quads_at(there >> 5U);
  const std::uint32_t d = quads_at(there >> 6U);
  upper &= a & b & ((anti & c) | (~anti & d));
  lower &= c & d & ((anti & b) | (~anti & a));
  return {upper | lower << 16U, vertices_at(upper | (lower & ~anti)) | vertices_at(upper | (lower & anti)) << 1U |
                                    vertices_at(lower | (upper & anti)) << 5U |
                                    vertices_at(lower | (upper & ~anti)) << 6U};
}

// Slabs and reliefs.

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

// What a structure is made of, while it is made.
struct SheetParts {
  Span<SheetTiles> tiles;
  Span<SheetRelief> relief;
  Span<SheetNode> nodes;
};

struct DepthRange {
  float low, high;  // of w
};

// The tiles and reliefs of group x of row y of groups, from its first inverse depth in a strip; the bounds of w in
// them.
template <class F>
[[nodiscard]] DepthRange build_group(const SheetTrace& sheet, const float* w, int x, int y, SheetTiles& tiles,
                                     SheetRelief* reliefs) noexcept {
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
    const TileFaces tile = tile_faces(sheet.quads, kSheetGroupQuads * x + 4 * (k % 4),
                                      kSheetGroupQuads * y + 4 * (k / 4), static_cast<std::uint32_t>(there[k]));
    reliefs[k].faces = tile.faces;
    used[k] = static_cast<std::int32_t>(tile.used);
    whole = whole && tile.used == kAllVertices;
  }
  std::int32_t bytes[10][16];
  F low(std::numeric_limits<float>::infinity());
  F high = -low;
  for (int part = 0; part < kParts; ++part) {
    vertices[part].used = I::load(used + part * F::lanes);
    if (whole) {
      make_tiles<true>(vertices[part], part, tiles, bytes, low, high);
    } else {
      make_tiles<false>(vertices[part], part, tiles, bytes, low, high);
    }
  }
  for (int k = 0; k < 16; ++k) {
    SheetRelief& relief = reliefs[k];
    for (int j = 0; j < 5; ++j) {
      std::memcpy(relief.left + 4 * j, &bytes[j][k], 4);
      std::memcpy(relief.right + 4 * j, &bytes[5 + j][k], 4);
    }
    relief.unused = 0;
  }
  const float inf = std::numeric_limits<float>::infinity();
  DepthRange out{inf, -inf};
  for (int i = 0; i < F::lanes; ++i) {
    out.low = std::min(out.low, low.lane(i));
    out.high = std::max(out.high, high.lane(i));
  }
  return out;
}

// A child's bounds put into its parent; slots without a child stay empty.
inline void put_bounds(SheetNode* nodes, int across, int x, int y, DepthRange range) noexcept {
  SheetNode& node =
      nodes[static_cast<std::size_t>(y / 4) * static_cast<std::size_t>(across) + static_cast<std::size_t>(x / 4)];
  const int k = 4 * (y % 4) + x % 4;
  node.low[k] = range.low;
  node.high[k] = range.high;
}

// Row `row` of groups, and what its vertices add to the bounds.
template <class F>
[[nodiscard]] RowBounds build_row(const SheetTrace& sheet, int row, const SheetParts& out) noexcept {
  FoundBounds<F> found;
  InverseDepths strip;
  const std::size_t first_group = static_cast<std::size_t>(row) * static_cast<std::size_t>(sheet.across[0]);
  for (int first = 0; first < sheet.across[0]; first += kStripGroups) {
    invert_strip<F>(sheet, row, first, strip, found);
    for (int x = first; x < std::min(first + kStripGroups, sheet.across[0]); ++x) {
      const std::size_t at = first_group + static_cast<std::size_t>(x);
      const DepthRange range = build_group<F>(sheet, &strip.w[0][kSheetGroupQuads * (x - first)], x, row, out.tiles[at],
                                              &out.relief[16 * at]);
      if (!out.nodes.empty()) put_bounds(out.nodes.data(), sheet.across[1], x, row, range);
    }
  }
  return found.bounds();
}

// Bounds of the layer, and the whole.

[[nodiscard]] inline RowBounds union_of(Span<const RowBounds> all) noexcept {
  const float inf = std::numeric_limits<float>::infinity();
  RowBounds out{{inf, inf, inf}, {-inf, -inf, -inf}, 0.0F, 0.0F};
  for (const RowBounds& b : all) {
    for (int k = 0; k < 3; ++k) {
      out.low[k] = std::min(out.low[k], b.low[k]);
      out.high[k] = std::max(out.high[k], b.high[k]);
    }
    out.max_inverse_depth = std::max(out.max_inverse_depth, b.max_inverse_depth);
    out.off_grid_px = std::max(out.off_grid_px, b.off_grid_px);
  }
  return out;
}

// The bounds from what was found: the frustum of the vertices' pixels, half a pixel and their errors wider, and their
// range of depth.
[[nodiscard]] inline SheetBounds bounds_of(const RowBounds& b, Shape shape, const Intrinsics& k) noexcept {
  SheetBounds out;
  out.camera = k;
  out.image = shape;
  const auto width = static_cast<float>(shape.width);
  const auto height = static_cast<float>(shape.height);
  const float reach_x = std::max(std::fabs(k.cx), std::fabs(width - k.cx));
  const float reach_y = std::max(std::fabs(k.cy), std::fabs(height - k.cy));
  out.max_inverse_depth = b.max_inverse_depth;
  out.pad_px = b.off_grid_px + 0x1p-19F * (std::max(width, height) + std::max(reach_x, reach_y));
  out.focal_reach = std::max(k.fx + reach_x, k.fy + reach_y) + 2.0F * (1.0F + out.pad_px);
  for (int i = 0; i < 3; ++i) {
    out.low[i] = b.low[i];
    out.high[i] = b.high[i];
  }
  const double margin = static_cast<double>(out.pad_px) + 0.5;
  const double sides[4] = {
      static_cast<double>(k.cx) - 0.5 + margin, shape.width - 0.5 + margin - static_cast<double>(k.cx),
      static_cast<double>(k.cy) - 0.5 + margin, shape.height - 0.5 + margin - static_cast<double>(k.cy)};
  for (int i = 0; i < 8; ++i) {
    const double sign = i % 2 == 0 ? 1.0 : -1.0;
    out.x[i] = i < 2 ? sign * static_cast<double>(k.fx) : 0.0;
    out.y[i] = i == 2 || i == 3 ? sign * static_cast<double>(k.fy) : 0.0;
    out.z[i] = i < 4 ? sides[i] : sign;
    out.d[i] = i < 4 ? 0.0
                     : (i % 2 == 0 ? -(1 - 0x1p-20) * static_cast<double>(b.low[2])
                                   : (1 + 0x1p-20) * static_cast<double>(b.high[2]));
    out.size[i] = std::fabs(out.x[i]) + std::fabs(out.y[i]) + std::fabs(out.z[i]);
  }
  return out;
}

// Grows bounds by those of another layer of the same camera: x and y are alike, and the greater z or d of a side takes
// in more.
inline void join_bounds(const SheetBounds& from, SheetBounds& to) noexcept {
  for (int k = 0; k < 3; ++k) {
    to.low[k] = std::min(to.low[k], from.low[k]);
    to.high[k] = std::max(to.high[k], from.high[k]);
  }
  to.max_inverse_depth = std::max(to.max_inverse_depth, from.max_inverse_depth);
  to.pad_px = std::max(to.pad_px, from.pad_px);
  to.focal_reach = std::max(to.focal_reach, from.focal_reach);
  for (int i = 0; i < 8; ++i) {
    to.z[i] = std::max(to.z[i], from.z[i]);
    to.d[i] = std::max(to.d[i], from.d[i]);
    to.size[i] = std::max(to.size[i], from.size[i]);
  }
}

// The nodes above those that rows of groups filled.
inline void build_nodes(const Levels& levels, Span<SheetNode> nodes) noexcept {
  for (int level = 1; level + 1 < levels.count; ++level) {
    const SheetNode* node = nodes.data() + levels.first[level];
    for (int y = 0; y < levels.down[level]; ++y) {
      for (int x = 0; x < levels.across[level]; ++x, ++node) {
        DepthRange range{node->low[0], node->high[0]};
        for (int k = 1; k < 16; ++k) {
          range.low = std::min(range.low, node->low[k]);
          range.high = std::max(range.high, node->high[k]);
        }
        put_bounds(nodes.data() + levels.first[level + 1], levels.across[level + 1], x, y, range);
      }
    }
  }
}

// A sheet that has its views and nothing in them.
[[nodiscard]] inline SheetTrace views_of(const SheetLayer& layer, const Intrinsics& intrinsics, const Levels& levels,
                                         const SheetParts& parts) noexcept {
  SheetTrace out;
  out.vertices = layer.vertices;
  out.quads = layer.quads;
  out.tiles = parts.tiles;
  out.relief = parts.relief;
  out.nodes = parts.nodes;
  for (int level = 0; level < levels.count; ++level) {
    out.first[level] = levels.first[level];
    out.across[level] = levels.across[level];
    out.down[level] = levels.down[level];
  }
  out.intrinsics = intrinsics;
  return out;
}

// Fills the parts of a sheet whose views are set, `rows` being scratch. Refused where vertices are too far from their
// pixels' rays.
template <class F, class Executor>
[[nodiscard]] Status fill_sheet(const Levels& levels, const SheetParts& parts, Span<RowBounds> rows, SheetTrace& sheet,
                                Executor& executor) {
  const float inf = std::numeric_limits<float>::infinity();
  for (SheetNode& node : parts.nodes) {
    for (int k = 0; k < 16; ++k) {
      node.low[k] = inf;
      node.high[k] = -inf;
    }
  }
  executor.for_chunks(rows.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y) rows[y] = build_row<F>(sheet, static_cast<int>(y), parts);
  });
  build_nodes(levels, parts.nodes);
  const RowBounds all = union_of(rows);
  if (!(all.max_inverse_depth > 0.0F)) return {};  // there is no vertex: levels stay 0
  sheet.bounds = bounds_of(all, sheet.vertices.shape(), sheet.intrinsics);
  if (!(sheet.bounds.focal_reach < 0x1p30F)) {
    return {StatusCode::invalid_argument, "the vertices of a traced sheet must lie near their pixels' rays"};
  }
  sheet.levels = levels.count;
  return {};
}

}  // namespace sheet_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_BUILD_HPP
