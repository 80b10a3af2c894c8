// SPDX-License-Identifier: Apache-2.0
// Which vertices simplify.hpp takes away, tile by tile.
//
// A vertex goes when one of its neighbours can take over its faces (a half-edge collapse) so that depth stays within
// the bound, labels stay as they are (simplify_bound.hpp) and no face turns over or grows thinner than kThinnest. On
// the rim it goes only along a straight piece of it. Neighbours are tried in the order of the memoryless quadric cost:
// area times squared distance of the neighbour from the planes of the faces as they are; the longest new edge decides
// ties, which are the rule where the surface is plane. A pass takes away vertices of which no two are neighbours, so
// that faces grow evenly; passes go on until nothing changes. See Lindstrom and Turk, "Evaluation of memoryless
// simplification", 1999; Cohen et al., "Simplification envelopes", 1996.
#ifndef NPSIM_MESH_SIMPLIFY_THIN_HPP
#define NPSIM_MESH_SIMPLIFY_THIN_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/image_view.hpp"
#include "npsim/mesh/simplify_bound.hpp"
#include "npsim/mesh/simplify_mesh.hpp"
#include "npsim/simd/isa.hpp"

namespace npsim {
inline namespace v1 {
inline namespace NPSIM_ISA_NAMESPACE {
namespace mesh_detail {

inline constexpr int kTries = 3;           // neighbours that are tried
inline constexpr double kShape = 1e-4;     // weight of the squared length of an edge, in allowed errors squared
inline constexpr int kMaxThinPasses = 64;  // far more than ever happen

// A rectangle of pixels whose inner vertices one thread may take away.
struct Tile {
  int x0, y0, x1, y1;
  [[nodiscard]] bool inside(std::uint32_t v) const noexcept {
    const int x = packed_x(v);
    const int y = packed_y(v);
    return x > x0 && x < x1 && y > y0 && y < y1;
  }
  [[nodiscard]] bool holds(std::uint32_t v) const noexcept {
    const int x = packed_x(v);
    const int y = packed_y(v);
    return x >= x0 && x <= x1 && y >= y0 && y <= y1;
  }
};

struct Thinner {
  ThinMesh mesh;
  SheetPlanes sheet;
  double bound = 0;  // of the relative error of depth

  // Takes v away if some neighbour may have its faces.
  [[nodiscard]] bool thin(std::uint32_t v, const Tile& tile) const noexcept {
    Ring ring;
    if (!mesh.ring_of(v, ring)) return false;
    const Corner middle = sheet.corner(packed_x(v), packed_y(v));
    Corner around[kMaxRing];
    bool pure = true;
    for (int i = 0; i < ring.count; ++i) {
      if (!tile.holds(ring.vertex[i])) return false;
      around[i] = sheet.corner(packed_x(ring.vertex[i]), packed_y(ring.vertex[i]));
      pure = pure && around[i].id == middle.id;
    }
    const int faces = ring.faces();
    if (!ring.closed && (faces < 2 || turn(middle, around[0], around[ring.count - 1]) != 0)) return false;
    const auto after = [&](int i) -> const Corner& { return around[i + 1 == ring.count ? 0 : i + 1]; };
    // Planes of the faces as they are.
    double gx[kMaxRing], gy[kMaxRing], area[kMaxRing];
    for (int i = 0; i < faces; ++i) {
      const Corner& p = around[i];
      const Corner& q = after(i);
      const double x1 = p.x - middle.x, y1 = p.y - middle.y, w1 = p.w - middle.w;
      const double x2 = q.x - middle.x, y2 = q.y - middle.y, w2 = q.w - middle.w;
      area[i] = x2 * y1 - x1 * y2;
      const double scale = 1.0 / (x1 * y2 - x2 * y1);
      gx[i] = (w1 * y2 - w2 * y1) * scale;
      gy[i] = (w2 * x1 - w1 * x2) * scale;
    }
    double cost[kMaxRing];
    int order[kMaxRing];
    int candidates = 0;
    for (int j = 0; j < ring.count; ++j) {
      const Corner& u = around[j];
      if (u.id != middle.id || !tile.inside(ring.vertex[j])) continue;
      if (!ring.closed && j != 0 && j != ring.count - 1) continue;
      bool good = true;
      double longest = 0;
      for (int i = 0; i < faces && good; ++i) {
        const int n = i + 1 == ring.count ? 0 : i + 1;
        if (i == j || n == j) continue;
        const std::int64_t twice = turn(u, around[i], around[n]);
        const auto square = [](const Corner& p, const Corner& q) {
          return static_cast<double>(p.x - q.x) * (p.x - q.x) + static_cast<double>(p.y - q.y) * (p.y - q.y);
        };
        const double l = std::max({square(u, around[i]), square(u, around[n]), square(around[i], around[n])});
        good = twice > 0 && 4096.0 * static_cast<double>(twice) * static_cast<double>(twice) >= l;
        longest = std::max(longest, square(u, around[n]));
      }
      if (!good) continue;
      double sum = 0;
      for (int i = 0; i < faces; ++i) {
        const double d = u.w - middle.w - gx[i] * (u.x - middle.x) - gy[i] * (u.y - middle.y);
        sum += area[i] * d * d;
      }
      const double allowed = bound * middle.w;
      cost[j] = sum + kShape * allowed * allowed * longest;
      int k = candidates++;
      for (; k > 0 && cost[order[k - 1]] > cost[j]; --k) order[k] = order[k - 1];
      order[k] = j;
    }
    for (int k = 0; k < candidates && k < kTries; ++k) {
      if (!fits(ring, around, order[k], pure)) continue;
      mesh.collapse(v, ring, order[k], [&](std::uint32_t w) { return tile.inside(w); });
      for (int i = 0; i < ring.count; ++i) {
        std::uint8_t& state = mesh.state[mesh.at(ring.vertex[i])];
        if (tile.inside(ring.vertex[i])) {
          state = static_cast<std::uint8_t>((state & ~unsigned{kVertexSettled}) | kVertexTouched);
        }
      }
      return true;
    }
    return false;
  }

  [[nodiscard]] bool fits(const Ring& ring, const Corner* around, int j, bool pure) const noexcept {
    const Corner& u = around[j];
    const int faces = ring.faces();
    const auto close = [this](double w, double thinned) { return std::fabs(w - thinned) <= bound * thinned; };
    for (int i = 0; i < faces; ++i) {
      const int n = i + 1 == ring.count ? 0 : i + 1;
      if (i == j || n == j) continue;
      const Corner& p = around[i];
      const Corner& q = around[n];
      if (turn(u, p, q) > 1 && !at_centres(sheet, u, p, q, close)) return false;
    }
    if (!pure) {
      for (int i = 0; i < ring.count; ++i) {
        if (i != j && !edge_is_pure(sheet, u, around[i])) return false;
      }
      for (int i = 0; i < faces; ++i) {
        const int n = i + 1 == ring.count ? 0 : i + 1;
        if (i == j || n == j) continue;
        const bool one = u.id == around[i].id && u.id == around[n].id;
        if (one ? !triangle_is_pure(sheet, u, around[i], around[n]) : !triangle_is_bare(u, around[i], around[n])) {
          return false;
        }
      }
    }
    for (int i = 0; i < ring.count; ++i) {
      const bool neighbour = i == j || (ring.closed ? (i + 1) % ring.count == j || (j + 1) % ring.count == i
                                                    : i == j - 1 || i == j + 1 || i == 0 || i == ring.count - 1);
      if (!neighbour && !at_crossings(sheet, u, around[i], close)) return false;
    }
    return true;
  }

  void thin_tile(const Tile& tile) const noexcept {
    const int x0 = std::max(tile.x0, 0), x1 = std::min(tile.x1, mesh.shape.width - 1);
    const int y0 = std::max(tile.y0, 0), y1 = std::min(tile.y1, mesh.shape.height - 1);
    for (int pass = 0; pass < 64; ++pass) {
      std::size_t taken = 0;
      for (int y = y0; y <= y1; ++y) {
        for (int x = x0; x <= x1; ++x) {
          const std::uint32_t v = pack_pixel(x, y);
          if (!tile.inside(v)) continue;
          std::uint8_t& state = mesh.state[mesh.at(v)];
          if ((state & kVertexTouched) != 0) {
            state = static_cast<std::uint8_t>(state & ~unsigned{kVertexTouched});
            continue;
          }
          if (state != kVertexUsed) continue;
          if (thin(v, tile)) {
            ++taken;
          } else {
            state = kVertexUsed | kVertexSettled;
          }
        }
      }
      if (taken == 0) break;
    }
  }
};

}  // namespace mesh_detail
}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_MESH_SIMPLIFY_THIN_HPP
