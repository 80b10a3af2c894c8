// SPDX-License-Identifier: Apache-2.0
// How the ray structure of a layer (geometry/triangle_mesh.hpp) lies in memory: a pyramid over its inverse depths.
//
// In (column, row, 1 / depth), columns and rows counted from the centre of the first pixel, a pinhole camera maps lines
// to lines and planes to planes, and the layer is a heightfield w(u, v) over a regular grid. The pyramid has 4x4
// children a node:
//   tile   4x4 quads: a sheared slab |w - (base + gx (u - x) + gy (v - y))| <= half round them, (x, y) being the tile's
//          first pixel; 16 tiles side by side make a SheetTiles. Its SheetRelief says which faces there are, and where
//          in the slab its vertices lie, in 255ths of it;
//   node   16 SheetTiles or 16 nodes: the least and the greatest w of each.
// Faces keep their implicit numbers: 2 (y (width - 1) + x) for the upper triangle of quad (x, y), one more for the
// lower.
//
// Invariants: every face that can be hit has its bit set and lies in the slab and the bounds of everything above it
// (to within the rounding that detail/sheet/ray.hpp allows for); a tile without a face has half = -infinity. Vertices
// and quads are not copied: the caller keeps them. Memory: 2.02 bytes a triangle of a full layer: 64 bytes a tile, 8.5
// bytes a SheetTiles and the nodes above.
#ifndef NPSIM_TRACE_DETAIL_SHEET_LAYOUT_HPP
#define NPSIM_TRACE_DETAIL_SHEET_LAYOUT_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"

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
};

// Layers of one camera that are traced as one. The faces of layer i follow those of layer i - 1.
struct SheetScene {
  Span<const SheetTrace> layers;
  SheetBounds bounds;
};

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_LAYOUT_HPP
