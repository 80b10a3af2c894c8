// SPDX-License-Identifier: Apache-2.0
// The points of surfaces that light transport works on, and their order.
#ifndef NPSIM_RENDER_SURFACE_POINTS_HPP
#define NPSIM_RENDER_SURFACE_POINTS_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/material/retroreflection.hpp"
#include "npsim/render/light_images.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// The surface points of a scene: one per mesh vertex, with everything that light transport needs to know there.
//
// Structure of arrays, all of one length; index i is vertex i of the traced mesh. Visible and hidden points (background
// completed behind objects) are alike: both receive light, block it and hand it on. Nothing is owned.

inline constexpr std::uint32_t kNoPoint = 0xFFFFFFFFU;

struct SurfacePoints {
  Span<const Vec3f> position;             // m, camera frame
  Span<const Vec3f> normal;               // unit, facing the camera
  Span<const Vec3f> albedo;               // diffuse reflectance, linear RGB in [0, 1]
  Span<const float> alpha;                // GGX width in (0, 1], or kMatt
  Span<const float> lift_m;               // how far along the normal a ray starts that leaves the point, >= 0
  Span<const Retroreflector> retro = {};  // what returns light to its lamp; empty: nothing does
  Span<const std::uint8_t> film = {};  // share of a film of water in 255ths (material/roughness.hpp); empty: all is dry

  [[nodiscard]] constexpr std::size_t size() const noexcept { return position.size(); }
};

[[nodiscard]] inline Status validate(const SurfacePoints& p) noexcept {
  const bool same = p.normal.size() == p.size() && p.albedo.size() == p.size() && p.alpha.size() == p.size() &&
                    p.lift_m.size() == p.size() && (p.retro.empty() || p.retro.size() == p.size()) &&
                    (p.film.empty() || p.film.size() == p.size());
  if (!same) return Status(StatusCode::shape_mismatch, "surface point arrays must have one length");
  if (p.size() >= kNoPoint) return Status(StatusCode::capacity_exceeded, "more than 2^32 - 2 surface points");
  return {};
}

// Where a ray starts that leaves point p.
[[nodiscard]] inline Vec3f ray_start(const SurfacePoints& points, std::size_t p) noexcept {
  return points.position[p] + points.normal[p] * points.lift_m[p];
}

// Points in blocks of 32 x 32 slots, as light asks about them: first the tiles of the picture, then what no pixel
// shows.
//
// A slot of a tile holds the point that its pixel shows; neighbours in a block are neighbours in the picture. Points
// that no pixel shows follow one another as they do in the list of points, row by row of a block.
// Cells of 8 x 8 slots have bounds of where their points lie and which way they face.
// Memory: 4 bytes a slot, 36 a cell.

inline constexpr int kBlockSide = kLightTile;
inline constexpr std::size_t kBlockPoints = kLightTilePixels;
inline constexpr int kCellSide = 8;
inline constexpr int kBlockCells = kBlockSide / kCellSide;  // in a row of a block
inline constexpr std::size_t kCellPoints = kCellSide * kCellSide;
inline constexpr std::size_t kCellsOfBlock = kBlockCells * kBlockCells;

// How much brighter than a matt surface a wet road or a sign may look: GGX of alpha .12 has f = 5/sr where asphalt has
// .02, sheeting .3 to 250 where white has .13. [default] for both.
inline constexpr float kShine = 100.0F;

[[nodiscard]] inline float shine(const SurfacePoints& points, std::size_t p) noexcept {
  const bool wet = !points.film.empty() && points.film[p] != 0;
  const bool sign = !points.retro.empty() && points.retro[p].kind == RetroKind::sheeting;
  return wet || sign ? kShine : 1.0F;
}

// A sphere around the points of a cell, and a cone around their normals.
struct CellBounds {
  Vec3f centre_m;
  float radius_m = 0;
  Vec3f normal;            // the cone's axis
  float cone_cosine = -1;  // of half its angle; -1: they face anywhere
  std::uint16_t points = 0;
  bool shines = false;  // whether one of them does
};

struct PointBlocks {
  Span<const std::uint32_t> point;  // kBlockPoints slots a block; kNoPoint: empty
  Span<const CellBounds> cells;     // kCellsOfBlock a block, row by row
  std::size_t tiles = 0;            // as many of the blocks are those of the picture, in the order of light_tiles()

  [[nodiscard]] std::size_t count() const noexcept { return cells.size() / kCellsOfBlock; }
  [[nodiscard]] Span<const std::uint32_t> of_block(std::size_t block) const noexcept {
    return point.sub(block * kBlockPoints, kBlockPoints);
  }
};

[[nodiscard]] constexpr std::size_t point_blocks_bytes(Shape shape, std::size_t points) noexcept {
  const std::size_t blocks = light_tiles(shape).pixels() + points / kBlockPoints + 1;
  return allocation_bytes<std::uint32_t>(blocks * kBlockPoints) + allocation_bytes<CellBounds>(blocks * kCellsOfBlock);
}

// Calls f(slot) for the slots of a block's cell.
template <class F>
void for_cell(std::size_t cell, const F& f) noexcept {
  const std::size_t first = cell / kBlockCells * kCellSide * kBlockSide + cell % kBlockCells * kCellSide;
  for (std::size_t y = 0; y < kCellSide; ++y) {
    for (std::size_t x = 0; x < kCellSide; ++x) f(first + y * kBlockSide + x);
  }
}

[[nodiscard]] inline CellBounds bounds_of(const SurfacePoints& points, Span<const std::uint32_t> block,
                                          std::size_t cell) noexcept {
  CellBounds bounds;
  Vec3f low, high, sum;
  for_cell(cell, [&](std::size_t slot) {
    const std::uint32_t p = block[slot];
    if (p == kNoPoint) return;
    const Vec3f& at = points.position[p];
    low = bounds.points > 0 ? Vec3f{std::fmin(low.x, at.x), std::fmin(low.y, at.y), std::fmin(low.z, at.z)} : at;
    high = bounds.points > 0 ? Vec3f{std::fmax(high.x, at.x), std::fmax(high.y, at.y), std::fmax(high.z, at.z)} : at;
    bounds.shines = bounds.shines || shine(points, p) > 1.0F;
    sum += points.normal[p];
    ++bounds.points;
  });
  bounds.centre_m = (low + high) * 0.5F;
  bounds.radius_m = 0.501F * length(high - low);
  bounds.normal = normalized(sum);
  float least = 1.0F;
  for_cell(cell, [&](std::size_t slot) {
    if (block[slot] != kNoPoint) least = std::fmin(least, dot(bounds.normal, points.normal[block[slot]]));
  });
  bounds.cone_cosine = least > 0.0F ? least - 1e-4F : -1.0F;
  return bounds;
}

// What `visible_point` shows (an empty image: nothing), and the points p that it does not with hidden[p] != 0.
template <class Executor>
Status make_point_blocks(const SurfacePoints& points, ImageView<const std::uint32_t> visible_point,
                         Span<const std::uint8_t> hidden, Workspace& workspace, Executor& executor, PointBlocks& out) {
  if (hidden.size() != points.size()) return {StatusCode::shape_mismatch, "point blocks: one byte per point"};
  const Shape shape = visible_point.shape();
  out.tiles = light_tiles(shape).pixels();
  std::size_t more = 0;
  for (const std::uint8_t h : hidden) more += h != 0 ? 1U : 0U;
  const std::size_t blocks = out.tiles + (more + kBlockPoints - 1) / kBlockPoints;
  Span<std::uint32_t> slots;
  Span<CellBounds> cells;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(blocks * kBlockPoints, slots));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(blocks * kCellsOfBlock, cells));
  for (std::uint32_t& slot : slots) slot = kNoPoint;
  for_light_tiles(shape, executor, [&](std::size_t tile, int left, int top, int right, int bottom) {
    std::uint32_t* const block = slots.data() + tile * kBlockPoints;
    for (int y = top; y < bottom; ++y) {
      for (int x = left; x < right; ++x) block[(y - top) * kBlockSide + x - left] = visible_point(x, y);
    }
  });
  std::size_t next = out.tiles * kBlockPoints;
  for (std::size_t p = 0; p < points.size(); ++p) {
    if (hidden[p] != 0) slots[next++] = static_cast<std::uint32_t>(p);
  }
  out.point = slots;
  executor.for_chunks(blocks, 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t c = begin * kCellsOfBlock; c < end * kCellsOfBlock; ++c) {
      cells[c] = bounds_of(points, out.of_block(c / kCellsOfBlock), c % kCellsOfBlock);
    }
  });
  out.cells = cells;
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_SURFACE_POINTS_HPP
