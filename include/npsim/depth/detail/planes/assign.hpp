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

// Of the same object's planes in the squares around the largest that the pixel lies on but for the noise; else the one
// of its own cell where that fits, else the one that fits best, else none.
template <class PlaneOf, class Support>
[[nodiscard]] std::uint16_t nearest_plane(const CellInput& in, const Grid& grid, Span<const Cell> cells,
                                          ImageView<const std::uint8_t> slots, const PlaneOf& plane_of,
                                          const Support& support, float inlier, int x, int y) noexcept {
  constexpr float kNoise = 1.5F;
  const int column = x / grid.cell_px;
  const int row = y / grid.cell_px;
  const Cell* own = slots(x, y) != 0 ? &cells[grid.cell(column, row, slots(x, y) - 1)] : nullptr;
  if (own != nullptr && own->blind && own->plane != kNoPlane && plane_of_ray(in, plane_of(own->plane), x, y) > 0.0F) {
    return own->plane;
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

}  // namespace planes_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_PLANES_ASSIGN_HPP
