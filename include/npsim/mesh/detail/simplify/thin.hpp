// SPDX-License-Identifier: Apache-2.0
// The mesh that simplify.hpp thins out: half-edges over the quads of a sheet, the collapse of an edge onto one end, and
// which vertices are taken away, tile by tile.
//
// A vertex is named by its pixel, (y << 16) + x, for good: a collapse takes the vertex away and hands its faces to one
// of its neighbours, so the vertices that stay keep their place. Half-edge 3 f + k runs from corner k of face f to the
// next one; opposite[] is its other half, or a value with kRim set. Faces and vertices are never moved or renumbered.
// Invariant: on the image all faces turn the same way and none has zero area: the mesh is a plane straight-line one, so
// that no edge can come about twice. A pixel with several fans of faces (index.hpp) has no outgoing[] and never goes.
//
// A vertex goes when one of its neighbours can take over its faces (a half-edge collapse) so that depth stays within
// the bound, labels stay as they are (bound.hpp) and no face turns over or grows thinner than kThinnest. On the rim it
// goes only along a straight piece of it. Neighbours are tried in the order of the memoryless quadric cost: area times
// squared distance of the neighbour from the planes of the faces as they are; their distance decides ties, which are
// the rule where the surface is plane. A pass takes away vertices of which no two are neighbours, so that faces grow
// evenly; passes go on until nothing changes. See Lindstrom and Turk, "Evaluation of memoryless simplification", 1999;
// Cohen et al., "Simplification envelopes", 1996. Memory: 12 bytes for the corners and 12 for the opposites of a face,
// 4 + 4 + 1 a pixel.
#ifndef NPSIM_MESH_DETAIL_SIMPLIFY_THIN_HPP
#define NPSIM_MESH_DETAIL_SIMPLIFY_THIN_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/mesh/detail/simplify/bound.hpp"
#include "npsim/mesh/index.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace mesh_detail {

inline constexpr std::uint32_t kRim = 0x80000000U;   // opposite: there is none
inline constexpr std::uint32_t kGone = 0xFFFFFFFFU;  // first corner of a face that is gone
inline constexpr int kMaxSimplifySide = 0x4000;      // px, of the image
inline constexpr int kMaxRing = 32;                  // neighbours of a vertex that may be taken away

// Bits of the state of a vertex.
inline constexpr unsigned kVertexUsed = 1;      // has faces
inline constexpr unsigned kVertexFixed = 2;     // stays
inline constexpr unsigned kVertexAway = 4;      // away from the centre of its pixel
inline constexpr unsigned kVertexPinched = 8;   // of several fans
inline constexpr unsigned kVertexSettled = 16;  // was tried, and nothing around it has changed since
inline constexpr unsigned kVertexDue = 32;      // to be tried in this pass; twice as much: in the next, and in turns

[[nodiscard]] constexpr std::uint32_t pack_pixel(int x, int y) noexcept {
  return (static_cast<std::uint32_t>(y) << 16U) | static_cast<std::uint32_t>(x);
}
[[nodiscard]] constexpr int packed_x(std::uint32_t v) noexcept { return static_cast<int>(v & 0xFFFFU); }
[[nodiscard]] constexpr int packed_y(std::uint32_t v) noexcept { return static_cast<int>(v >> 16U); }

[[nodiscard]] constexpr std::uint32_t next_half(std::uint32_t h) noexcept { return h % 3 == 2 ? h - 2 : h + 1; }
[[nodiscard]] constexpr std::uint32_t previous_half(std::uint32_t h) noexcept { return h % 3 == 0 ? h + 2 : h - 1; }

// The vertices around one, in the order of its faces. Where the faces are not a closed ring the first and the last
// vertex are its neighbours on the rim, and there is one face less.
struct Ring {
  int count = 0;  // of vertices
  bool closed = false;
  std::uint32_t half[kMaxRing];  // of face i, from the middle to vertex i
  std::uint32_t vertex[kMaxRing];

  [[nodiscard]] constexpr int faces() const noexcept { return closed ? count : count - 1; }
};

struct ThinMesh {
  Shape shape;
  Span<std::uint32_t> corner;
  Span<std::uint32_t> opposite;
  Span<std::uint32_t> outgoing;  // of each pixel, a half-edge that leaves it
  Span<std::uint8_t> state;      // of each pixel

  [[nodiscard]] std::size_t at(std::uint32_t v) const noexcept {
    return static_cast<std::size_t>(packed_y(v)) * static_cast<std::size_t>(shape.width) +
           static_cast<std::size_t>(packed_x(v));
  }
  [[nodiscard]] std::uint32_t end(std::uint32_t h) const noexcept { return corner[next_half(h)]; }
  [[nodiscard]] static bool is_rim(std::uint32_t opposite_half) noexcept { return (opposite_half & kRim) != 0; }

  // False when the vertex has too many neighbours.
  [[nodiscard]] bool ring_of(std::uint32_t v, Ring& ring) const noexcept {
    const std::uint32_t first = outgoing[at(v)];
    if (!follow_ring(first, ring)) return false;
    if (ring.closed) return true;
    std::uint32_t h = first;  // back to where the fan begins
    for (int step = 0; step < kMaxRing && !is_rim(opposite[h]); ++step) h = next_half(opposite[h]);
    return follow_ring(h, ring) && is_rim(opposite[h]);
  }

  void join(std::uint32_t h, std::uint32_t outer) const noexcept {
    opposite[h] = outer;
    if (!is_rim(outer)) opposite[outer] = h;
  }

  // The ring as far as it goes from a half-edge on.
  [[nodiscard]] bool follow_ring(std::uint32_t start, Ring& ring) const noexcept {
    std::uint32_t h = start;
    for (ring.count = 0; ring.count < kMaxRing;) {
      ring.half[ring.count] = h;
      ring.vertex[ring.count++] = end(h);
      const std::uint32_t last = previous_half(h);
      h = opposite[last];
      if (h == start) return ring.closed = true;
      if (is_rim(h)) {
        ring.closed = false;
        if (ring.count == kMaxRing) return false;
        ring.vertex[ring.count++] = corner[last];
        return true;
      }
    }
    return false;
  }

  // Moves v onto its neighbour j. `owned(vertex)` says whether outgoing[] of a vertex may be written.
  template <class Owned>
  void collapse(std::uint32_t v, const Ring& ring, int j, const Owned& owned) const noexcept {
    const int faces = ring.faces();
    const std::uint32_t u = ring.vertex[j];
    for (int i = 0; i < faces; ++i) corner[ring.half[i]] = u;
    const auto leaves = [&](std::uint32_t h) {
      if (owned(corner[h])) outgoing[at(corner[h])] = h;
    };
    if (ring.closed || j < faces) {  // the face behind the edge goes, the next one takes its outer edge
      const std::uint32_t gone = ring.half[j];
      const std::uint32_t keeps = ring.half[j + 1 == faces ? 0 : j + 1];
      join(keeps, opposite[next_half(gone)]);
      corner[gone / 3 * 3] = kGone;
      leaves(keeps);
      leaves(next_half(keeps));
    }
    if (ring.closed || j == faces) {  // the face before it, the one before that
      const int before = j == 0 ? faces - 1 : j - 1;
      const std::uint32_t gone = ring.half[before];
      const std::uint32_t keeps = previous_half(ring.half[before == 0 ? faces - 1 : before - 1]);
      join(keeps, opposite[next_half(gone)]);
      corner[gone / 3 * 3] = kGone;
      leaves(keeps);
      leaves(next_half(keeps));
    }
    state[at(v)] = 0;
  }
};

// Corner of a quad's face from which its half-edge along an edge of the quad starts; the diagonal is what is left.
[[nodiscard]] constexpr std::uint32_t quad_half(std::uint8_t quad, QuadEdge edge) noexcept {
  const bool anti = (quad & kQuadAntiDiagonal) != 0;
  switch (edge) {
    case QuadEdge::top: return 2;
    case QuadEdge::bottom: return 1;
    case QuadEdge::left: return 0;
    default: return anti ? 2 : 1;
  }
}

// The half-edge of the quad (x, y) along one of its edges, or kRim.
[[nodiscard]] inline std::uint32_t half_of_quad(const ImageView<std::uint8_t>& quads, int x, int y,
                                                QuadEdge edge) noexcept {
  if (!quads.contains(x, y)) return kRim;
  const std::uint8_t quad = quads(x, y);
  if (!edge_has_face(quad, edge)) return kRim;
  const std::uint32_t face =
      2 * (static_cast<std::uint32_t>(y) * static_cast<std::uint32_t>(quads.width()) + static_cast<std::uint32_t>(x)) +
      (edge_is_upper(quad, edge) ? 0U : 1U);
  return 3 * face + quad_half(quad, edge);
}

// Faces 2 q and 2 q + 1 of quad q, upper and lower.
inline void connect_thin_row(const SheetLayer& layer, int y, const ThinMesh& mesh) noexcept {
  const ImageView<std::uint8_t>& quads = layer.quads;
  const std::uint32_t row = 2 * static_cast<std::uint32_t>(y) * static_cast<std::uint32_t>(quads.width());
  for (int x = 0; x < quads.width(); ++x) {
    const std::uint8_t quad = quads(x, y);
    const bool anti = (quad & kQuadAntiDiagonal) != 0;
    const std::uint32_t a = pack_pixel(x, y);
    const std::uint32_t both = kQuadUpperFace | kQuadLowerFace;
    for (const bool upper : {true, false}) {
      const std::uint32_t face = row + 2 * static_cast<std::uint32_t>(x) + (upper ? 0U : 1U);
      const std::uint32_t h = 3 * face;
      if ((quad & (upper ? kQuadUpperFace : kQuadLowerFace)) == 0) {
        mesh.corner[h] = kGone;
        continue;
      }
      const Face f = quad_face(anti, upper, a, a + 1, a + 0x10000U, a + 0x10001U);
      mesh.corner[h] = f.a;
      mesh.corner[h + 1] = f.b;
      mesh.corner[h + 2] = f.c;
      // Along A-D the diagonal is the first half-edge of the upper face and the last of the lower, along B-C the second
      // and the first.
      const std::uint32_t diagonal = anti ? (upper ? 1U : 0U) : (upper ? 0U : 2U);
      const std::uint32_t twin = anti ? (upper ? 0U : 1U) : (upper ? 2U : 0U);
      mesh.opposite[h + diagonal] = (quad & both) == both ? 3 * (face ^ 1U) + twin : kRim;
      if (upper) {
        mesh.opposite[h + 2] = half_of_quad(quads, x, y - 1, QuadEdge::bottom);
      } else {
        mesh.opposite[h + 1] = half_of_quad(quads, x, y + 1, QuadEdge::top);
      }
      const bool left = upper == anti;
      mesh.opposite[h + quad_half(quad, left ? QuadEdge::left : QuadEdge::right)] =
          left ? half_of_quad(quads, x - 1, y, QuadEdge::right) : half_of_quad(quads, x + 1, y, QuadEdge::left);
    }
  }
}

// One half-edge of every vertex that has some, from scratch. The faces of row y touch the vertices of rows y, y + 1 at
// first, of any row later: hence serial.
inline void find_outgoing(const ThinMesh& mesh) noexcept {
  for (std::size_t h = 0; h < mesh.corner.size(); h += 3) {
    if (mesh.corner[h] == kGone) continue;
    for (std::size_t k = h; k < h + 3; ++k) mesh.outgoing[mesh.at(mesh.corner[k])] = static_cast<std::uint32_t>(k);
  }
}

inline constexpr int kSimplifyTile = 96;  // px: its half-edges, 440 kB, stay in a second-level cache

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

// Whether a row or column is a seam between tiles; the sides of the image are none.
[[nodiscard]] constexpr bool is_seam(int at, int offset, int size) noexcept {
  return (at + offset) % kSimplifyTile == 0 && at > 0 && at < size;
}

// Makes every vertex due that may go and has not been tried with all its neighbours; on seams of the tiles to come all.
inline void make_due(const ThinMesh& mesh, int offset) noexcept {
  std::uint8_t* state = mesh.state.data();
  for (int y = 0; y < mesh.shape.height; ++y) {
    const bool row = is_seam(y, offset, mesh.shape.height);
    for (int x = 0; x < mesh.shape.width; ++x, ++state) {
      unsigned s = *state & ~(3 * kVertexDue);
      if (row || is_seam(x, offset, mesh.shape.width)) s &= ~kVertexSettled;
      *state = static_cast<std::uint8_t>(
          (s & (kVertexUsed | kVertexFixed | kVertexSettled)) == kVertexUsed ? s | kVertexDue : s);
    }
  }
}

// Vertices that are away from their pixels, and their neighbours, stay.
inline void fix_away(const ThinMesh& mesh) noexcept {
  const std::ptrdiff_t width = mesh.shape.width;
  for (int y = 0; y < mesh.shape.height; ++y) {
    for (int x = 0; x < mesh.shape.width; ++x) {
      std::uint8_t* state = mesh.state.data() + y * width + x;
      if ((*state & kVertexAway) == 0) continue;
      for (int dy = y > 0 ? -1 : 0; dy <= (y + 1 < mesh.shape.height ? 1 : 0); ++dy) {
        for (int dx = x > 0 ? -1 : 0; dx <= (x + 1 < mesh.shape.width ? 1 : 0); ++dx) {
          std::uint8_t& s = state[dy * width + dx];
          s = static_cast<std::uint8_t>(s | kVertexFixed);
        }
      }
    }
  }
}

template <class F, class Executor>
void thin_tiles(const Thinner<F>& thinner, int offset, Executor& executor) {
  const Shape shape = thinner.mesh.shape;
  const auto columns = static_cast<std::size_t>((shape.width + offset) / kSimplifyTile + 1);
  const auto rows = static_cast<std::size_t>((shape.height + offset) / kSimplifyTile + 1);
  executor.for_chunks(columns * rows, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const int x = static_cast<int>(i % columns) * kSimplifyTile - offset;
      const int y = static_cast<int>(i / columns) * kSimplifyTile - offset;
      // The sides of the image are no seams.
      thinner.thin_tile({x <= 0 ? -1 : x, y <= 0 ? -1 : y,
                         x + kSimplifyTile >= shape.width ? shape.width : x + kSimplifyTile,
                         y + kSimplifyTile >= shape.height ? shape.height : y + kSimplifyTile});
    }
  });
}

}  // namespace mesh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_SIMPLIFY_THIN_HPP
