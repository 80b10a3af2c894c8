// SPDX-License-Identifier: Apache-2.0
// Which vertices simplify.hpp takes away, tile by tile.
//
// A vertex goes when one of its neighbours can take over its faces (a half-edge collapse) so that depth stays within
// the bound, labels stay as they are (simplify_bound.hpp) and no face turns over or grows thinner than kThinnest. On
// the rim it goes only along a straight piece of it. Neighbours are tried in the order of the memoryless quadric cost:
// area times squared distance of the neighbour from the planes of the faces as they are; their distance decides
// ties, which are the rule where the surface is plane. A pass takes away vertices of which no two are neighbours, so
// that faces grow evenly; passes go on until nothing changes. See Lindstrom and Turk, "Evaluation of memoryless
// simplification", 1999; Cohen et al., "Simplification envelopes", 1996.
#ifndef NPSIM_MESH_DETAIL_SIMPLIFY_THIN_HPP
#define NPSIM_MESH_DETAIL_SIMPLIFY_THIN_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/mesh/detail/simplify/bound.hpp"
#include "npsim/mesh/detail/simplify/mesh.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace mesh_detail {

inline constexpr int kTries = 6;                 // neighbours that are tried
inline constexpr std::int64_t kThinnest = 4096;  // a face is higher than 1 / 64 px
inline constexpr double kShape = 1e-3;           // weight of the squared length of an edge, in allowed errors squared
inline constexpr double kNever = 1e300;
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

enum class Thinned { taken, settled, blocked };

// The vertices around one, with their places.
struct Surroundings {
  Ring ring;
  Corner middle;
  Corner around[kMaxRing];
  bool pure = true;  // one label

  [[nodiscard]] constexpr int after(int i) const noexcept { return i + 1 == ring.count ? 0 : i + 1; }
  // Whether face i does without neighbour j, and stays when that takes over.
  [[nodiscard]] constexpr bool stays(int i, int j) const noexcept { return i != j && after(i) != j; }
};

// Sum over the faces of area times squared distance of a point from their planes, as a form in its place relative to
// the vertex in the middle.
class QuadricCost {
 public:
  explicit QuadricCost(const Surroundings& s) noexcept {
    for (int i = 0; i < s.ring.faces(); ++i) {
      const Corner& p = s.around[i];
      const Corner& q = s.around[s.after(i)];
      const double x1 = p.x - s.middle.x;
      const double y1 = p.y - s.middle.y;
      const double w1 = p.w - s.middle.w;
      const double x2 = q.x - s.middle.x;
      const double y2 = q.y - s.middle.y;
      const double w2 = q.w - s.middle.w;
      const double area = x2 * y1 - x1 * y2;  // twice
      const double a = w2 * y1 - w1 * y2;
      const double b = w1 * x2 - w2 * x1;
      const double share = 1.0 / area;
      xx_ += a * a * share;
      xy_ += a * b * share;
      yy_ += b * b * share;
      x_ += a;
      y_ += b;
      area_ += area;
    }
  }
  [[nodiscard]] double at(double x, double y, double w) const noexcept {
    return x * (xx_ * x + 2.0 * xy_ * y) + yy_ * y * y + w * (area_ * w - 2.0 * (x_ * x + y_ * y));
  }

 private:
  double xx_ = 0, xy_ = 0, yy_ = 0, x_ = 0, y_ = 0, area_ = 0;
};

template <class F>
struct Thinner {
  ThinMesh mesh;
  SheetPlanes sheet;
  double bound = 0;                 // of the relative error of depth
  double max_texture_shift_px = 0;  // 0: any

  // Takes v away if some neighbour may have its faces. next: the bit of vertices due in the next pass, of which those
  // around v become some, and due the bit of this pass, of which they cease to be some.
  [[nodiscard]] Thinned thin(std::uint32_t v, const Tile& tile, unsigned due, unsigned next) const noexcept {
    Surroundings s;
    Ring& ring = s.ring;
    if (!mesh.ring_of(v, ring)) return Thinned::settled;
    s.middle = sheet.corner(packed_x(v), packed_y(v));
    bool inside = true;
    for (int i = 0; i < ring.count; ++i) {
      if (!tile.holds(ring.vertex[i])) return Thinned::blocked;
      inside = inside && tile.inside(ring.vertex[i]);
      s.around[i] = sheet.corner(packed_x(ring.vertex[i]), packed_y(ring.vertex[i]));
      s.pure = s.pure && s.around[i].id == s.middle.id;
    }
    const Thinned failed = inside ? Thinned::settled : Thinned::blocked;
    if (!ring.closed && (ring.faces() < 2 || turn(s.middle, s.around[0], s.around[ring.count - 1]) != 0)) return failed;
    double cost[kMaxRing];
    rank(s, tile, cost);
    for (int k = 0; k < kTries; ++k) {
      int j = 0;
      for (int i = 1; i < ring.count; ++i) j = cost[i] < cost[j] ? i : j;
      if (!(cost[j] < kNever)) break;
      cost[j] = kNever;
      if (!fits(s, j)) continue;
      mesh.collapse(v, ring, j, [&](std::uint32_t w) { return tile.inside(w); });
      for (int i = 0; i < ring.count; ++i) {
        if (!tile.inside(ring.vertex[i])) continue;
        std::uint8_t& state = mesh.state[mesh.at(ring.vertex[i])];
        if ((state & kVertexFixed) == 0) {
          state = static_cast<std::uint8_t>((state & ~(kVertexSettled | due)) | next);
        }
      }
      return Thinned::taken;
    }
    return failed;
  }

  // What it costs to hand over to each neighbour, kNever where it may not take over.
  void rank(const Surroundings& s, const Tile& tile, double* cost) const noexcept {
    const QuadricCost quadric(s);
    const double allowed = bound * s.middle.w;
    const double stretch = kShape * allowed * allowed;
    for (int j = 0; j < s.ring.count; ++j) {
      const Corner& u = s.around[j];
      const bool may =
          u.id == s.middle.id && tile.inside(s.ring.vertex[j]) && (s.ring.closed || j == 0 || j == s.ring.count - 1);
      const double x = u.x - s.middle.x;
      const double y = u.y - s.middle.y;
      const double c = quadric.at(x, y, u.w - s.middle.w) + stretch * (x * x + y * y);
      cost[j] = may ? c : kNever;
    }
  }

  [[nodiscard]] bool fits(const Surroundings& s, int j) const noexcept {
    const Corner& u = s.around[j];
    const int faces = s.ring.faces();
    for (int i = 0; i < faces; ++i) {
      if (s.stays(i, j) && !broad(u, s.around[i], s.around[s.after(i)])) return false;
    }
    for (int i = 0; max_texture_shift_px > 0 && i < faces; ++i) {
      if (s.stays(i, j) && !texture_stays(u, s.around[i], s.around[s.after(i)], max_texture_shift_px)) return false;
    }
    for (int i = 0; i < faces; ++i) {
      if (s.stays(i, j) && !centres_are_close<F>(sheet, u, s.around[i], s.around[s.after(i)], bound)) return false;
    }
    if (!s.pure && !labels_stay(s, j)) return false;
    const auto close = [this](double w, double thinned) { return std::fabs(w - thinned) <= bound * thinned; };
    for (int i = 0; i < faces; ++i) {  // the edges between two faces that stay
      const int n = s.after(i);
      if (!s.stays(i, j) || (s.ring.closed ? !s.stays(n, j) : n == s.ring.count - 1)) continue;
      if (!at_crossings(sheet, u, s.around[n], close)) return false;
    }
    return true;
  }

  // Not turned over, and not too thin.
  [[nodiscard]] static bool broad(const Corner& a, const Corner& b, const Corner& c) noexcept {
    const std::int64_t twice = turn(a, b, c);
    return twice > 0 && kThinnest * twice * twice >=
                            std::max(squared_length(a, b), std::max(squared_length(b, c), squared_length(c, a)));
  }

  [[nodiscard]] bool labels_stay(const Surroundings& s, int j) const noexcept {
    const Corner& u = s.around[j];
    for (int i = 0; i < s.ring.count; ++i) {
      if (i != j && !edge_is_pure(sheet, u, s.around[i])) return false;
    }
    for (int i = 0; i < s.ring.faces(); ++i) {
      if (!s.stays(i, j)) continue;
      const Corner& p = s.around[i];
      const Corner& q = s.around[s.after(i)];
      if (u.id == p.id && u.id == q.id ? !triangle_is_pure(sheet, u, p, q) : !triangle_is_bare(u, p, q)) return false;
    }
    return true;
  }

  void thin_tile(const Tile& tile) const noexcept {
    const int x0 = std::max(tile.x0 + 1, 0);
    const int x1 = std::min(tile.x1, mesh.shape.width);
    const int y0 = std::max(tile.y0 + 1, 0);
    const int y1 = std::min(tile.y1, mesh.shape.height);
    bool taken = true;
    for (int pass = 0; taken && pass < kMaxThinPasses; ++pass) {
      const unsigned due = pass % 2 == 0 ? kVertexDue : 2 * kVertexDue;
      taken = false;
      for (int y = y0; y < y1; ++y) {
        for (int x = x0; x < x1; x += 8) taken = thin_some(tile, x, y, std::min(8, x1 - x), due) || taken;
      }
    }
  }

  // Those of n <= 8 neighbouring vertices that are due.
  [[nodiscard]] bool thin_some(const Tile& tile, int x, int y, int n, unsigned due) const noexcept {
    std::uint8_t* state = mesh.state.data() + mesh.at(pack_pixel(x, y));
    std::uint64_t word = 0;
    std::memcpy(&word, state, static_cast<std::size_t>(n));
    if ((word & (0x0101010101010101U * due)) == 0) return false;
    bool taken = false;
    for (int i = 0; i < n; ++i) {
      if ((state[i] & due) == 0) continue;
      state[i] = static_cast<std::uint8_t>(state[i] & ~due);
      const Thinned result = thin(pack_pixel(x + i, y), tile, due, due ^ (3 * kVertexDue));
      if (result == Thinned::settled) state[i] = static_cast<std::uint8_t>(state[i] | kVertexSettled);
      taken = taken || result == Thinned::taken;
    }
    return taken;
  }
};

}  // namespace mesh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_SIMPLIFY_THIN_HPP
