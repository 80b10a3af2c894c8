// SPDX-License-Identifier: Apache-2.0
// Which pixels lie on which plane, and what becomes of them.
#ifndef NPSIM_DEPTH_DETAIL_PLANES_ASSIGN_HPP
#define NPSIM_DEPTH_DETAIL_PLANES_ASSIGN_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

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

// The plane of the pixel's own cell where it fits, else the one that fits best of the same object's in the squares
// around, else none.
template <class PlaneOf>
[[nodiscard]] std::uint16_t nearest_plane(const CellInput& in, const Grid& grid, Span<const Cell> cells,
                                          ImageView<const std::uint8_t> slots, PlaneOf&& plane_of, float inlier, int x,
                                          int y) noexcept {
  const int column = x / grid.cell_px;
  const int row = y / grid.cell_px;
  if (slots(x, y) != 0) {
    const Cell& cell = cells[grid.cell(column, row, slots(x, y) - 1)];
    const std::uint16_t own = cell.plane;
    if (own != kNoPlane && cell.blind && plane_of_ray(in, plane_of(own), x, y) > 0.0F) return own;
    if (own != kNoPlane && std::fabs(residual_at(in, plane_of(own), x, y)) <= inlier) return own;
  }
  std::uint16_t best = kNoPlane;
  float least = inlier;
  for (int j = std::max(0, row - 1); j <= std::min(grid.rows - 1, row + 1); ++j) {
    for (int i = std::max(0, column - 1); i <= std::min(grid.columns - 1, column + 1); ++i) {
      for (int slot = 0; slot < kSlots; ++slot) {
        const Cell& cell = cells[grid.cell(i, j, slot)];
        if (cell.plane == kNoPlane || cell.plane == best || cell.label != in.label(x, y) ||
            cell.instance != in.instance(x, y)) {
          continue;
        }
        const float off = std::fabs(residual_at(in, plane_of(cell.plane), x, y));
        if (off > least || (off == least && best != kNoPlane)) continue;
        least = off;
        best = cell.plane;
      }
    }
  }
  return best;
}

}  // namespace planes_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_PLANES_ASSIGN_HPP
