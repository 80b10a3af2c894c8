// SPDX-License-Identifier: Apache-2.0
// Which pixels lie on which plane, and what becomes of them.
#ifndef NPSIM_DEPTH_DETAIL_PLANES_ASSIGN_HPP
#define NPSIM_DEPTH_DETAIL_PLANES_ASSIGN_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/depth/detail/planes/cells.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace planes_detail {

[[nodiscard]] inline float plane_of_ray(const CellInput& in, const Vec3f& q, int x, int y) noexcept {
  return dot(q, vec_cast<float>(in.ray(x, y)));
}

// Residual of a pixel in deviations; positive where it lies nearer than the plane.
[[nodiscard]] inline float residual_at(const CellInput& in, const Vec3f& q, int x, int y) noexcept {
  const float w = 1.0F / in.depth(x, y);
  return (w - plane_of_ray(in, q, x, y)) / in.deviation(w);
}

// Of the same object's planes in the squares around the largest that the pixel lies on but for the noise; else the one
// of its own cell where that fits, else the one that fits best, else none. Where nothing was measured it is the cell's,
// unless that lies half as far again as what was made up there, and further than the noise: seen at a grazing angle it
// runs off to its horizon, and the cell holds something nearer as well. Above a laser's topmost line planes know more
// than what is made up.
template <class PlaneOf, class Support>
[[nodiscard]] std::uint16_t nearest_plane(const CellInput& in, const Grid& grid, Span<const Cell> cells,
                                          ImageView<const std::uint8_t> slots, const PlaneOf& plane_of,
                                          const Support& support, float inlier, int x, int y) noexcept {
  constexpr float kNoise = 1.5F;
  constexpr float kRunsOff = 1.5F;
  const int column = x / grid.cell_px;
  const int row = y / grid.cell_px;
  const Cell* own = slots(x, y) != 0 ? &cells[grid.cell(column, row, slots(x, y) - 1)] : nullptr;
  if (own != nullptr && own->blind && own->plane != kNoPlane) {
    const bool laser = in.noise.power == 2;
    const float times_w = plane_of_ray(in, plane_of(own->plane), x, y) * in.depth(x, y);
    if (times_w > (laser ? 0.0F : 1.0F / kRunsOff)) return own->plane;
  }
  std::uint16_t nearest = kNoPlane;
  std::uint16_t largest = kNoPlane;
  float least = inlier;
  for (int j = std::max(0, row - 1); j <= std::min(grid.rows - 1, row + 1); ++j) {
    for (int i = std::max(0, column - 1); i <= std::min(grid.columns - 1, column + 1); ++i) {
      for (int slot = 0; slot < kSlots; ++slot) {
        const Cell& cell = cells[grid.cell(i, j, slot)];
        if (cell.plane == kNoPlane || cell.plane == nearest || cell.plane == largest || cell.label != in.label(x, y) ||
            cell.instance != in.instance(x, y)) {
          continue;
        }
        float off = std::fabs(residual_at(in, plane_of(cell.plane), x, y));
        if (off <= kNoise && (largest == kNoPlane || support(cell.plane) > support(largest))) largest = cell.plane;
        if (own != nullptr && cell.plane == own->plane && off <= inlier) off = 0.0F;
        if (off > least || (off == least && nearest != kNoPlane)) continue;
        least = off;
        nearest = cell.plane;
      }
    }
  }
  return largest != kNoPlane ? largest : nearest;
}

// Eight directions.
inline constexpr int kAround = 8;
inline constexpr int kAroundX[kAround] = {1, -1, 0, 0, 1, -1, 1, -1};
inline constexpr int kAroundY[kAround] = {0, 0, 1, -1, 1, -1, -1, 1};

// Calls f(plane), also with none, for those of the same object's pixels in eight directions at a distance.
template <class F>
void for_planes_around(const CellInput& in, ImageView<const std::uint16_t> of, int apart_px, int x, int y,
                       const F& f) noexcept {
  for (int k = 0; k < kAround; ++k) {
    const int i = x + kAroundX[k] * apart_px;
    const int j = y + kAroundY[k] * apart_px;
    if (of.contains(i, j) && in.objects.same(x, y, i, j)) f(of(i, j));
  }
}

// One step towards the least sum of squared residuals and of differences between neighbours (iterated conditional
// modes; Besag 1986): the best of the planes that the pixel and its neighbours `apart_px` away have. Between planes that
// differ by less than the noise each pixel by itself chooses as its noise has it, and a facade becomes a mosaic.
// of: every pixel's plane before the step.
template <class PlaneOf>
[[nodiscard]] std::uint16_t agreed_plane(const CellInput& in, const PlaneOf& plane_of,
                                         ImageView<const std::uint16_t> of, float inlier, int apart_px, int x,
                                         int y) noexcept {
  constexpr float kDiffers = 3.0F;  // squared deviations that a neighbour on another plane costs
  std::uint16_t found[kAround + 1] = {of(x, y)};
  int count[kAround + 1] = {0};
  int kinds = 1;
  int neighbours = 0;
  for_planes_around(in, of, apart_px, x, y, [&](std::uint16_t plane) {
    ++neighbours;
    int kind = 0;
    while (kind < kinds && found[kind] != plane) ++kind;
    if (kind == kinds) {
      found[kinds] = plane;
      count[kinds++] = 0;
    }
    ++count[kind];
  });
  std::uint16_t best = found[0];
  float least = std::numeric_limits<float>::infinity();
  for (int kind = 0; kind < kinds && kinds > 1; ++kind) {
    float cost = inlier * inlier - 4.0F * kDiffers;  // of none
    if (found[kind] != kNoPlane) {
      const float off = residual_at(in, plane_of(found[kind]), x, y);
      if (!(std::fabs(off) <= inlier)) continue;  // no number of neighbours puts a pixel on what does not explain it
      cost = off * off;
    }
    cost += kDiffers * static_cast<float>(neighbours - count[kind]);
    if (cost >= least) continue;
    least = cost;
    best = found[kind];
  }
  return best;
}

}  // namespace planes_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_PLANES_ASSIGN_HPP
