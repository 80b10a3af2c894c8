// SPDX-License-Identifier: Apache-2.0
// Cells of one object that lie in one plane become one region.
//
// In each round every region names the neighbour whose union with it costs least, and pairs that name each other are
// united, while the rise in residual stays below a share of the noise: per sample of the smaller region, so that a
// large one cannot swallow small ones which do not fit it. Neighbours are cells of the same object up to three squares
// apart, so that what a pole or a tree parts comes together again.
// Bounded: every round but the last unites at least one pair.
#ifndef NPSIM_DEPTH_DETAIL_PLANES_MERGE_HPP
#define NPSIM_DEPTH_DETAIL_PLANES_MERGE_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/span.hpp"
#include "npsim/depth/detail/planes/cells.hpp"
#include "npsim/depth/detail/planes/moments.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace planes_detail {

inline constexpr int kReach = 3;                                  // squares
inline constexpr std::size_t kLinks = 2 * kReach * (kReach + 1);  // of a cell, each pair counted once

struct Link {
  std::uint32_t a, b;
};

struct Choice {
  double cost = std::numeric_limits<double>::infinity();
  std::uint32_t partner = 0;
  bool upright = false;
};

[[nodiscard]] inline std::size_t link_cells(const Grid& grid, Span<const Cell> cells, Span<Link> links) noexcept {
  std::size_t count = 0;
  const auto try_square = [&](std::size_t a, int column, int row) {
    if (column < 0 || column >= grid.columns || row >= grid.rows) return;
    for (int slot = 0; slot < kSlots; ++slot) {
      const std::size_t b = grid.cell(column, row, slot);
      if (!cells[b].valid || cells[b].label != cells[a].label || cells[b].instance != cells[a].instance) continue;
      links[count++] = {static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b)};
    }
  };
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      for (int slot = 0; slot < kSlots; ++slot) {
        const std::size_t a = grid.cell(column, row, slot);
        if (!cells[a].valid) continue;
        for (int dy = 0; dy <= kReach; ++dy) {
          for (int dx = dy == 0 ? 1 : -kReach; dx <= kReach; ++dx) try_square(a, column + dx, row + dy);
        }
      }
    }
  }
  return count;
}

[[nodiscard]] inline std::uint32_t region_of(Span<Cell> cells, std::uint32_t cell) noexcept {
  std::uint32_t root = cell;
  while (cells[root].parent != root) root = cells[root].parent;
  while (cells[cell].parent != root) {
    const std::uint32_t next = cells[cell].parent;
    cells[cell].parent = root;
    cell = next;
  }
  return root;
}

[[nodiscard]] inline PlaneFit best_plane(const PlaneMoments& moments, bool upright,
                                         const UprightBasis& basis) noexcept {
  return upright ? moments.upright_plane(basis) : moments.free_plane();
}

// Rise of the mean squared residual, in variances, over the smaller of the two. Two upright regions make an upright one
// where that passes; a leaning one costs `tolerance` more, so it is chosen last, and plumb ones make none.
[[nodiscard]] inline Choice union_cost(const Cell& a, const Cell& b, const UprightBasis& basis,
                                       double tolerance) noexcept {
  Choice choice;
  const double smaller = std::min(a.moments.weight, b.moments.weight);
  const PlaneFit own_a = best_plane(a.moments, a.upright, basis);
  const PlaneFit own_b = best_plane(b.moments, b.upright, basis);
  if (!own_a.found || !own_b.found || !(smaller > 0.0)) return choice;
  PlaneMoments both = a.moments;
  both += b.moments;
  const double apart = own_a.cost + own_b.cost;
  if (a.upright && b.upright) {
    const PlaneFit fit = both.upright_plane(basis);
    const double cost = (fit.cost - apart) / smaller;
    if (fit.found && cost <= tolerance) {
      choice.cost = cost;
      choice.upright = true;
      return choice;
    }
  }
  if (a.plumb || b.plumb) return choice;
  const PlaneFit fit = both.free_plane();
  const double cost = (fit.cost - apart) / smaller;
  if (fit.found && cost <= tolerance) choice.cost = cost + tolerance;
  return choice;
}

// tolerance: rise of the mean squared residual in variances. links and choices: memory. Afterwards every valid cell's
// parent leads to the cell that holds its region's sums and area, and the first links, as many as returned, are between
// such cells, of regions that stayed apart.
[[nodiscard]] inline std::size_t merge_cells(Span<Cell> cells, Span<Link> links, Span<Choice> choices,
                                             const UprightBasis& basis, double tolerance) noexcept {
  std::size_t count = links.size();
  for (bool united = true; united && count > 0;) {
    united = false;
    for (std::size_t i = 0; i < count; ++i) choices[links[i].a] = choices[links[i].b] = Choice{};
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint32_t a = region_of(cells, links[i].a);
      const std::uint32_t b = region_of(cells, links[i].b);
      if (a == b) continue;
      links[kept++] = {a, b};
    }
    count = kept;
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint32_t a = links[i].a;
      const std::uint32_t b = links[i].b;
      const Choice choice = union_cost(cells[a], cells[b], basis, tolerance);
      const auto offer = [&](std::uint32_t to, std::uint32_t partner) {
        Choice& best = choices[to];
        if (choice.cost < best.cost || (choice.cost == best.cost && partner < best.partner)) {
          best = choice;
          best.partner = partner;
        }
      };
      offer(a, b);
      offer(b, a);
    }
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint32_t a = std::min(links[i].a, links[i].b);
      const std::uint32_t b = std::max(links[i].a, links[i].b);
      const Choice& choice = choices[a];
      if (!(choice.cost < std::numeric_limits<double>::infinity()) || choice.partner != b || choices[b].partner != a ||
          cells[b].parent != b) {
        continue;
      }
      cells[b].parent = a;
      cells[a].moments += cells[b].moments;
      cells[a].area_px += cells[b].area_px;
      cells[a].upright = choice.upright;
      cells[a].plumb = cells[a].plumb || cells[b].plumb;
      united = true;
    }
  }
  return count;
}

// Mean rise of a cell's squared residual, in variances, where the plane q takes the place of its own.
[[nodiscard]] inline double misfit(const Cell& cell, const UprightBasis& basis, const Vec3d& q) noexcept {
  const PlaneFit own = best_plane(cell.own, cell.upright, basis);
  const double rise = cell.own.cost(q) - own.cost;
  return rise > 0.0 ? rise / cell.own.weight : 0.0;
}

// Where planes lie within the noise of each other, single cells fall to one or the other by chance. Each cell takes the
// plane, of its own and its neighbours', that costs least: its misfit, and `tolerance` for each neighbour of its object
// that lies on another (iterated conditional modes of a Potts field; Besag 1986). No plane costs none_cost.
// plane_of(n): q. next: memory, one for each cell.
template <class PlaneOf>
void smooth_regions(const Grid& grid, const PlaneOf& plane_of, const UprightBasis& basis, double tolerance,
                    double none_cost, Span<Cell> cells, Span<std::uint16_t> next) noexcept {
  constexpr int kRounds = 8;
  for (int round = 0; round < kRounds; ++round) {
    for (int row = 0; row < grid.rows; ++row) {
      for (int column = 0; column < grid.columns; ++column) {
        for (int slot = 0; slot < kSlots; ++slot) {
          const std::size_t index = grid.cell(column, row, slot);
          const Cell& cell = cells[index];
          next[index] = cell.plane;
          if (!cell.valid) continue;
          std::array<std::uint16_t, 9 * kSlots> around{};
          std::size_t count = 0;
          for (int j = std::max(0, row - 1); j <= std::min(grid.rows - 1, row + 1); ++j) {
            for (int i = std::max(0, column - 1); i <= std::min(grid.columns - 1, column + 1); ++i) {
              for (int k = 0; k < kSlots; ++k) {
                const Cell& other = cells[grid.cell(i, j, k)];
                if (&other == &cell || !other.valid || other.label != cell.label || other.instance != cell.instance)
                  continue;
                around[count++] = other.plane;
              }
            }
          }
          double least = std::numeric_limits<double>::infinity();
          const auto offer = [&](std::uint16_t plane) {
            double cost = plane == kNoPlane ? none_cost : misfit(cell, basis, plane_of(plane));
            for (std::size_t i = 0; i < count; ++i) cost += around[i] == plane ? 0.0 : tolerance;
            if (cost < least) {
              least = cost;
              next[index] = plane;
            }
          };
          offer(cell.plane);
          for (std::size_t i = 0; i < count; ++i) {
            if (around[i] != cell.plane) offer(around[i]);
          }
          if (cell.plane != kNoPlane) offer(kNoPlane);
        }
      }
    }
    for (std::size_t i = 0; i < cells.size(); ++i) cells[i].plane = next[i];
  }
}

// Where nothing was measured an object goes on as it is known: upwards and downwards first, for what stands upright
// keeps its plane there (a laser's topmost line, roofs above it), then a few squares sideways. Of the last squares
// before the gap the plane with the largest support counts, since the very last may hold the rim of something else.
// A plane that would be much nearer or farther there ends: it is steep, and how far it goes is not known. Sideways it
// must also agree with what was made up there, which knows what stands below, but for a third; and closely in a gap
// whose far side was measured too, since what was made up there is interpolated.
// unsure: one object need not be one thing, so upwards and downwards a plane must agree as it does sideways.
// support(n): of plane n. w_of(n, column, row): its inverse depth in the middle of a square.
// made_up(column, row, slot): the mean of the inverse depth there.
template <class Support, class InverseDepth, class MadeUp>
void extend_planes(const Grid& grid, bool unsure, const Support& support, const InverseDepth& w_of,
                   const MadeUp& made_up, Span<Cell> cells) noexcept {
  constexpr int kSideways = 4;
  constexpr int kBack = 3;
  constexpr float kAgree = 0.33F;
  constexpr float kAgreeBetween = 0.05F;
  constexpr float kStep = 0.15F;  // of w, from one square to the next
  // Whether the object was measured again on the far side of the gap that a cell lies in.
  const auto ends = [&](const Cell& cell, int column, int row, int dx, int dy) {
    for (int i = column - dx, j = row - dy; i >= 0 && i < grid.columns && j >= 0 && j < grid.rows; i -= dx, j -= dy) {
      bool goes_on = false;
      for (int k = 0; k < kSlots; ++k) {
        const Cell& beyond = cells[grid.cell(i, j, k)];
        if (!(beyond.area_px > 0.0F) || beyond.label != cell.label || beyond.instance != cell.instance) continue;
        if (!beyond.blind) return true;
        goes_on = true;
      }
      if (!goes_on) return false;
    }
    return false;
  };
  const auto take = [&](int column, int row, int dx, int dy) {
    for (int slot = 0; slot < kSlots; ++slot) {
      Cell& cell = cells[grid.cell(column, row, slot)];
      if (!cell.blind || cell.plane != kNoPlane) continue;
      float most = 0.0F;
      bool copied = false;
      const bool between = ends(cell, column, row, dx, dy);
      const float here = dx != 0 || between || unsure ? made_up(column, row, slot) : 0.0F;
      const float agree = between ? kAgreeBetween : kAgree;
      for (int back = 1; back <= kBack && !copied; ++back) {
        const int i = column + dx * back;
        const int j = row + dy * back;
        if (i < 0 || i >= grid.columns || j < 0 || j >= grid.rows) break;
        for (int k = 0; k < kSlots; ++k) {
          const Cell& from = cells[grid.cell(i, j, k)];
          if (from.plane == kNoPlane || from.label != cell.label || from.instance != cell.instance) continue;
          copied = from.blind;  // has chosen already
          if (!copied && !(support(from.plane) > most)) continue;
          const float w = w_of(from.plane, i, j);
          if (here > 0.0F && !(std::fabs(w_of(from.plane, column, row) - here) <= agree * here)) continue;
          if (!(std::fabs(w_of(from.plane, column, row) - w) <= kStep * static_cast<float>(back) * w)) continue;
          most = support(from.plane);
          cell.plane = from.plane;
        }
      }
    }
  };
  const auto vertically = [&] {
    for (int column = 0; column < grid.columns; ++column) {
      for (int row = grid.rows - 1; row >= 0; --row) take(column, row, 0, 1);
      for (int row = 0; row < grid.rows; ++row) take(column, row, 0, -1);
    }
  };
  vertically();
  // A step at a time, so that both sides of a gap get their share.
  for (int step = 0; step < kSideways; ++step) {
    for (int row = 0; row < grid.rows; ++row) {
      for (int column = step % 2; column < grid.columns; column += 2) {
        take(column, row, -1, 0);
        take(column, row, 1, 0);
      }
    }
  }
  vertically();
}

}  // namespace planes_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_PLANES_MERGE_HPP
