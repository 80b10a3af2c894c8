// SPDX-License-Identifier: Apache-2.0
// The ray structure of one layer of the scene (geometry/sheet_layer.hpp): a pyramid over its inverse depths.
//
// In (column, row, 1 / depth), columns and rows counted from the centre of the first pixel, a pinhole camera maps lines
// to lines and planes to planes, and the layer is a heightfield w(u, v) over a regular grid. The pyramid has 4x4
// children a node:
//   tile   4x4 quads: a sheared slab |w - (base + gx (u - x) + gy (v - y))| <= half round them, (x, y) being the tile's
//          first pixel; 16 tiles side by side make a SheetTiles. Its SheetRelief says which faces there are, and where
//          in the slab its vertices lie, in 255ths of it;
//   node   16 SheetTiles or 16 nodes: the least and the greatest w of each.
// Faces keep their implicit numbers: 2 (y (width - 1) + x) for the upper, one more for the lower triangle of quad (x,
// y).
//
// Invariants: every face that can be hit has its bit set and lies in the slab and the bounds of everything above it
// (to within the rounding that sheet_ray.hpp allows for); a tile without a face has half = -infinity. Vertices and
// quads are not copied: the caller keeps them. Memory: 2.02 bytes a triangle of a full layer: 64 bytes a tile, 8.5
// bytes a SheetTiles and the nodes above.
//
// All of it is one block of bytes without an address in it: SheetHeader, tiles, reliefs, nodes, bounds of rows, each
// padded with zeros to whole 64 bytes. It can be stored and attached again (sheet_store.hpp).
#ifndef NPSIM_TRACE_DETAIL_SHEET_LAYOUT_HPP
#define NPSIM_TRACE_DETAIL_SHEET_LAYOUT_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/sheet_layer.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr int kSheetMaxLevels = 8;    // SheetTiles and the nodes above them; 4^9 quads a side
inline constexpr int kSheetGroupQuads = 16;  // side of a SheetTiles

struct alignas(64) SheetTiles {
  float base[16];
  float gx[16];
  float gy[16];
  float half[16];
};
static_assert(sizeof(SheetTiles) == 256);

// Of one tile: vertex (i, j) of its 5x5 lies at base - half + gx i + gy j + q step with step = half kSheetReliefStep,
// to within kSheetReliefError steps; q is 0 where no face has the vertex.
struct alignas(16) SheetRelief {
  std::uint8_t left[20];   // q of i = 0 .. 3, row after row
  std::uint8_t right[20];  // of i = 1 .. 4: with those above the corners of 16 quads in four loads
  std::uint32_t faces;     // bit k: the upper triangle of quad k, in raster order; bit 16 + k: the lower
  std::uint32_t unused;    // 0
};
static_assert(sizeof(SheetRelief) == 48);

inline constexpr float kSheetReliefStep = 2.0F / 255.0F;
inline constexpr float kSheetReliefError = 0.5F + 0x1p-8F;  // half a step, and what rounding adds

struct alignas(64) SheetNode {
  float low[16];
  float high[16];
};
static_assert(sizeof(SheetNode) == 128);

// Where the vertices of layers can be, and how far they may be off.
struct SheetBounds {
  // x X + y Y + z Z + d >= 0 for every vertex (X, Y, Z): left, right, top, bottom, nearest, farthest; the last two are
  // copies that make the number whole for vectors.
  double x[8] = {};
  double y[8] = {};
  double z[8] = {};
  double d[8] = {};
  double size[8] = {};  // |x| + |y| + |z|
  float low[3] = {};
  float high[3] = {};
  float max_inverse_depth = 0;
  float pad_px = 0;       // how far from its place in the grid a vertex may be found, rounding included
  float focal_reach = 0;  // pixels that a point moves at most when it moves by its depth
  Intrinsics camera;      // and image that all this is about
  Shape image;
};

// What a stored structure starts with. A number is in the byte order of the machine that wrote it.
struct alignas(64) SheetHeader {
  std::uint32_t magic = 0;
  std::uint32_t version = 0;
  std::int32_t width = 0;  // px, of the layer
  std::int32_t height = 0;
  Intrinsics intrinsics;
  std::uint64_t bytes = 0;  // of the block, this header included
  std::uint32_t unused[6] = {};
};
static_assert(sizeof(SheetHeader) == 64);

inline constexpr std::uint32_t kSheetMagic = 0x5453504EU;  // "NPST"
inline constexpr std::uint32_t kSheetVersion = 2;          // another one for every change of what a block holds

// Views of the layer and of the workspace that build_sheet_trace() was given. Without levels nothing is ever hit.
struct SheetTrace {
  ImageView<const Vec3f> vertices;
  ImageView<const std::uint8_t> quads;
  Span<const SheetTiles> tiles;
  Span<const SheetRelief> relief;  // 16 for each SheetTiles
  Span<const SheetNode> nodes;
  int levels = 0;                           // level 0 is the tiles'
  std::size_t first[kSheetMaxLevels] = {};  // of the nodes of a level in `nodes`; first[0] is not used
  int across[kSheetMaxLevels] = {};         // nodes in a row
  int down[kSheetMaxLevels] = {};
  Intrinsics intrinsics;
  SheetBounds bounds;
  Span<const unsigned char> block;  // what to store
  Span<unsigned char> writable;     // the same, for refit_sheet_trace(); empty where it was attached to stored bytes
};

// Pixels [x, x + width) x [y, y + height) of a layer.
struct SheetRegion {
  int x = 0;
  int y = 0;
  Shape shape;
};

// Layers of one camera that are traced as one (join_layers() in sheet_join.hpp). The faces of layer i follow those of
// layer i - 1.
struct SheetScene {
  Span<const SheetTrace> layers;
  SheetBounds bounds;
};

namespace sheet_layout {

[[nodiscard]] constexpr int groups_of(int quads) noexcept { return (quads + kSheetGroupQuads - 1) / kSheetGroupQuads; }

struct Levels {
  int count = 0;
  int across[kSheetMaxLevels] = {};
  int down[kSheetMaxLevels] = {};
  std::size_t first[kSheetMaxLevels] = {};
  std::size_t nodes = 0;
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

// What a row of groups learns about its vertices.
struct RowBounds {
  float low[3];
  float high[3];
  float max_inverse_depth;
  float off_grid_px;
};

// Where the parts of a block start, in bytes.
struct Block {
  std::size_t tiles = 0;
  std::size_t relief = 0;
  std::size_t nodes = 0;
  std::size_t rows = 0;
  std::size_t bytes = 0;
};

[[nodiscard]] constexpr Block block_of(const Levels& levels) noexcept {
  const auto rows = static_cast<std::size_t>(levels.down[0]);
  Block out;
  const std::size_t groups = static_cast<std::size_t>(levels.across[0]) * rows;
  out.tiles = sizeof(SheetHeader);
  out.relief = out.tiles + allocation_bytes<SheetTiles>(groups);
  out.nodes = out.relief + allocation_bytes<SheetRelief>(16 * groups);
  out.rows = out.nodes + allocation_bytes<SheetNode>(levels.nodes);
  out.bytes = out.rows + allocation_bytes<RowBounds>(rows);
  return out;
}

// The views of a layer's structure in the bytes of a block; nothing in them is read.
[[nodiscard]] inline SheetTrace views_of(const SheetLayer& layer, const Levels& levels,
                                         Span<const unsigned char> bytes) noexcept {
  const Block block = block_of(levels);
  SheetTrace out;
  out.vertices = layer.vertices;
  out.quads = layer.quads;
  const std::size_t groups = static_cast<std::size_t>(levels.across[0]) * static_cast<std::size_t>(levels.down[0]);
  out.tiles = {reinterpret_cast<const SheetTiles*>(bytes.data() + block.tiles), groups};
  out.relief = {reinterpret_cast<const SheetRelief*>(bytes.data() + block.relief), 16 * groups};
  out.nodes = {reinterpret_cast<const SheetNode*>(bytes.data() + block.nodes), levels.nodes};
  for (int level = 0; level < levels.count; ++level) {
    out.first[level] = levels.first[level];
    out.across[level] = levels.across[level];
    out.down[level] = levels.down[level];
  }
  out.block = bytes;
  return out;
}

}  // namespace sheet_layout

[[nodiscard]] constexpr std::size_t sheet_workspace_bytes(Shape pixels) noexcept {
  const sheet_layout::Levels levels = sheet_layout::levels_of(pixels);
  if (levels.count == 0) return kWorkspaceAlignment;
  return sheet_layout::block_of(levels).bytes + kWorkspaceAlignment;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_LAYOUT_HPP
