// SPDX-License-Identifier: Apache-2.0
// The mesh that simplify.hpp thins out: half-edges over the quads of a sheet, and the collapse of an edge onto one end.
//
// A vertex is named by its pixel, (y << 16) + x, for good: a collapse takes the vertex away and hands its faces to one
// of its neighbours, so the vertices that stay keep their place. Half-edge 3 f + k runs from corner k of face f to the
// next one; opposite[] is its other half, or a value with kRim set. Faces and vertices are never moved or renumbered.
// Invariant: on the image all faces turn the same way and none has zero area: the mesh is a plane straight-line one, so
// that no edge can come about twice. A pixel with several fans of faces (index.hpp) has no outgoing[] and never goes.
// Memory: 12 bytes for the corners and 12 for the opposites of a face, 4 + 4 + 1 a pixel.
#ifndef NPSIM_MESH_DETAIL_SIMPLIFY_MESH_HPP
#define NPSIM_MESH_DETAIL_SIMPLIFY_MESH_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/mesh/index.hpp"
#include "npsim/mesh/sheet.hpp"

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

}  // namespace mesh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_SIMPLIFY_MESH_HPP
