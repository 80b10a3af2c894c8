// SPDX-License-Identifier: Apache-2.0
// Points in blocks of 32 x 32 slots, as light asks about them: first the tiles of the picture, then what no pixel shows.
//
// A slot of a tile holds the point that its pixel shows; neighbours in a block are neighbours in the picture. Points
// that no pixel shows follow one another as they do in the list of points, row by row of a block.
// Memory: 4 bytes a slot, 20 a block.
#ifndef NPSIM_RENDER_POINT_BLOCKS_HPP
#define NPSIM_RENDER_POINT_BLOCKS_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/render/light_images.hpp"
#include "npsim/render/surface_points.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr int kBlockSide = kLightTile;
inline constexpr std::size_t kBlockPoints = kLightTilePixels;

// How much brighter than a matt surface a wet road or a sign may look: GGX of alpha .12 has f = 5/sr where asphalt has
// .02, sheeting .3 to 250 where white has .13. [default] for both.
inline constexpr float kShine = 100.0F;

[[nodiscard]] inline float shine(const SurfacePoints& points, std::size_t p) noexcept {
  const bool wet = !points.film.empty() && points.film[p] != 0;
  const bool sign = !points.retro.empty() && points.retro[p].kind == RetroKind::sheeting;
  return wet || sign ? kShine : 1.0F;
}

// A sphere around the points of a block.
struct BlockBounds {
  Vec3f centre_m;
  float radius_m = 0;
  std::uint16_t points = 0;
  bool shines = false;  // whether one of them does
};

struct PointBlocks {
  Span<const std::uint32_t> point;  // kBlockPoints slots a block; kNoPoint: empty
  Span<const BlockBounds> bounds;
  std::size_t tiles = 0;  // as many of the blocks are those of the picture, in the order of light_tiles()

  [[nodiscard]] std::size_t count() const noexcept { return bounds.size(); }
  [[nodiscard]] Span<const std::uint32_t> of_block(std::size_t block) const noexcept {
    return point.sub(block * kBlockPoints, kBlockPoints);
  }
};

[[nodiscard]] constexpr std::size_t point_blocks_bytes(Shape shape, std::size_t points) noexcept {
  const std::size_t blocks = light_tiles(shape).pixels() + points / kBlockPoints + 1;
  return allocation_bytes<std::uint32_t>(blocks * kBlockPoints) + allocation_bytes<BlockBounds>(blocks);
}

[[nodiscard]] inline BlockBounds bounds_of(const SurfacePoints& points, Span<const std::uint32_t> block) noexcept {
  BlockBounds bounds;
  Vec3f low, high;
  for (const std::uint32_t p : block) {
    if (p == kNoPoint) continue;
    const Vec3f& at = points.position[p];
    low = bounds.points > 0 ? Vec3f{std::fmin(low.x, at.x), std::fmin(low.y, at.y), std::fmin(low.z, at.z)} : at;
    high = bounds.points > 0 ? Vec3f{std::fmax(high.x, at.x), std::fmax(high.y, at.y), std::fmax(high.z, at.z)} : at;
    bounds.shines = bounds.shines || shine(points, p) > 1.0F;
    ++bounds.points;
  }
  bounds.centre_m = (low + high) * 0.5F;
  bounds.radius_m = 0.501F * length(high - low);
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
  Span<BlockBounds> bounds;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(blocks * kBlockPoints, slots));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(blocks, bounds));
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
  for (std::size_t b = 0; b < blocks; ++b) bounds[b] = bounds_of(points, slots.sub(b * kBlockPoints, kBlockPoints));
  out.bounds = bounds;
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_POINT_BLOCKS_HPP
