// SPDX-License-Identifier: Apache-2.0
// Edges between planes: two walls of a thing meet where both have one depth, which is seen as a straight line.
//
// Near the line either plane explains a pixel, and noise draws the border: ragged, with flecks of the one within the
// other. Which plane lies on which side is what most of their pixels near each other say: at a corner that stands
// out each is the farther one on its own side, in a corner that recedes the nearer one. A pixel on the wrong side goes to the
// other plane, if that explains it too. Walls that are seen past each other have their line elsewhere, and oriels have
// another plane than the wall that they stand parallel to: for neither does this change anything.
// Deterministic: votes are counted one after the other, pixels change by what was before.
// Cost: 16 looks around a pixel. Memory: 64 bytes a plane.
#ifndef NPSIM_DEPTH_DETAIL_PLANES_EDGES_HPP
#define NPSIM_DEPTH_DETAIL_PLANES_EDGES_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/depth/detail/planes/assign.hpp"
#include "npsim/depth/detail/planes/cells.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace planes_detail {

inline constexpr std::size_t kEdges = 8;  // of a plane

// What a plane's pixels near another one say.
struct Edge {
  std::uint16_t other = kNoPlane;
  std::int16_t kind = 0;  // 1: recedes, -1: stands out, 0: not known, or no edge
  std::uint32_t ahead = 0;
  std::uint32_t all = 0;
};

// How far round a pixel other planes are looked for.
[[nodiscard]] constexpr int edge_px(Shape shape) noexcept {
  const int px = shape.width / 64;
  return px < 3 ? 3 : px;
}

[[nodiscard]] inline Edge* find_edge(Span<Edge> edges, std::uint16_t own, std::uint16_t other) noexcept {
  const std::size_t first = (own - std::size_t{1}) * kEdges;
  for (std::size_t i = first; i < first + kEdges; ++i) {
    if (edges[i].other == other || edges[i].other == kNoPlane) return &edges[i];
  }
  return nullptr;
}

// Calls f(plane) for those of the same object's pixels in eight directions at a distance.
template <class F>
void for_planes_around(const CellInput& in, ImageView<const std::uint16_t> of, int apart_px, int x, int y,
                       const F& f) noexcept {
  constexpr int kX[8] = {1, -1, 0, 0, 1, -1, 1, -1};
  constexpr int kY[8] = {0, 0, 1, -1, 1, -1, -1, 1};
  for (int k = 0; k < 8; ++k) {
    const int i = x + kX[k] * apart_px;
    const int j = y + kY[k] * apart_px;
    if (of.contains(i, j) && of(i, j) != kNoPlane && in.objects.same(x, y, i, j)) f(of(i, j));
  }
}

template <class PlaneOf>
[[nodiscard]] bool is_ahead(const CellInput& in, const PlaneOf& plane_of, std::uint16_t own, std::uint16_t other, int x,
                            int y) noexcept {
  return plane_of_ray(in, plane_of(own) - plane_of(other), x, y) > 0.0F;
}

// of: every pixel's plane. edges: kEdges for each plane.
template <class PlaneOf>
void find_edges(const CellInput& in, const PlaneOf& plane_of, ImageView<const std::uint16_t> of,
                Span<Edge> edges) noexcept {
  constexpr int kEvery = 4;
  constexpr std::uint32_t kFewestVotes = 16;
  for (Edge& edge : edges) edge = {};
  for (int y = 0; y < of.height(); y += kEvery) {
    for (int x = 0; x < of.width(); x += kEvery) {
      const std::uint16_t own = of(x, y);
      if (own == kNoPlane) continue;
      const auto vote = [&](std::uint16_t other) {
        if (other == own) return;
        Edge* edge = find_edge(edges, own, other);
        if (edge == nullptr) return;
        edge->other = other;
        ++edge->all;
        if (is_ahead(in, plane_of, own, other, x, y)) ++edge->ahead;
      };
      // The border itself says least.
      for (int times = 2; times <= 8; times *= 2) for_planes_around(in, of, times * edge_px(of.shape()), x, y, vote);
    }
  }
  const auto recedes = [](const Edge& e) { return e.all >= kFewestVotes && 3 * e.ahead >= 2 * e.all; };
  const auto stands_out = [](const Edge& e) { return e.all >= kFewestVotes && 3 * e.ahead <= e.all; };
  for (std::size_t i = 0; i < edges.size(); ++i) {
    Edge& edge = edges[i];
    if (edge.other == kNoPlane) continue;
    const Edge* back = find_edge(edges, edge.other, static_cast<std::uint16_t>(i / kEdges + 1));
    if (back == nullptr) continue;
    if (recedes(edge) && recedes(*back)) edge.kind = 1;
    if (stands_out(edge) && stands_out(*back)) edge.kind = -1;
  }
}

// The plane that a pixel is on, by the side of the edges near it; of several that explain it the one that fits best.
// edges: of find_edges().
template <class PlaneOf>
[[nodiscard]] std::uint16_t plane_of_side(const CellInput& in, const PlaneOf& plane_of, Span<Edge> edges,
                                          ImageView<const std::uint16_t> of, float inlier, int x, int y) noexcept {
  const std::uint16_t own = of(x, y);
  if (own == kNoPlane) return own;
  std::uint16_t best = own;
  float least = inlier;
  std::uint16_t last = own;
  const auto offer = [&](std::uint16_t other) {
    if (other == own || other == last) return;
    last = other;
    const Edge* edge = find_edge(edges, own, other);
    if (edge == nullptr || edge->kind == 0) return;
    if (is_ahead(in, plane_of, own, other, x, y) == (edge->kind > 0)) return;
    const float off = std::fabs(residual_at(in, plane_of(other), x, y));
    if (!(off <= least)) return;
    least = off;
    best = other;
  };
  for_planes_around(in, of, edge_px(of.shape()), x, y, offer);
  for_planes_around(in, of, edge_px(of.shape()) / 3, x, y, offer);
  return best;
}

}  // namespace planes_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_PLANES_EDGES_HPP
