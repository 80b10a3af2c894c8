// SPDX-License-Identifier: Apache-2.0
// Borders between planes of a thing, drawn straight.
//
// Two walls meet in an edge, where both have one depth: a straight line in the picture. Near it either plane explains a
// pixel, and noise draws the border: ragged, with flecks of the one within the other. So the border is put where the
// planes' inverse depths differ by what they do at the ragged one in the mean: by nothing at an edge, but for what the
// planes are off, and by the step between walls that are seen past each other. Which plane lies on which side is what
// most of their pixels near each other say: at a corner that stands out each is the farther one on its own side, in a
// corner that recedes the nearer one. A pixel on the wrong side goes to the other plane, if that explains it, noise
// allowed for, too. What has no such sides, as a bay before a wall that it is parallel to, stays as it is.
// Deterministic: votes are counted one after the other, pixels change by what was before.
// Cost: 16 looks around a pixel, twice, and 32 around every 16th. Memory: 160 bytes a plane.
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
  float level = 0.0F;  // by how much the plane is nearer at the border, 1/m
  std::uint32_t crossings = 0;
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

// How much nearer a plane is than another, 1/m.
template <class PlaneOf>
[[nodiscard]] float lead_of(const CellInput& in, const PlaneOf& plane_of, std::uint16_t own, std::uint16_t other, int x,
                            int y) noexcept {
  return plane_of_ray(in, plane_of(own) - plane_of(other), x, y);
}

// of: every pixel's plane. edges: kEdges for each plane.
template <class PlaneOf>
void find_edges(const CellInput& in, const PlaneOf& plane_of, ImageView<const std::uint16_t> of,
                Span<Edge> edges) noexcept {
  constexpr int kEvery = 4;
  constexpr std::uint32_t kFewestVotes = 16;
  for (Edge& edge : edges) edge = {};
  // Calls f(edge, lead) for other planes at a distance.
  const auto for_edges = [&](int times, const auto& f) {
    for (int y = 0; y < of.height(); y += kEvery) {
      for (int x = 0; x < of.width(); x += kEvery) {
        const std::uint16_t own = of(x, y);
        if (own == kNoPlane) continue;
        for_planes_around(in, of, times * edge_px(of.shape()), x, y, [&](std::uint16_t other) {
          Edge* edge = other != own && other != kNoPlane ? find_edge(edges, own, other) : nullptr;
          if (edge == nullptr) return;
          edge->other = other;
          f(*edge, lead_of(in, plane_of, own, other, x, y));
        });
      }
    }
  };
  for_edges(1, [](Edge& edge, float lead) {
    edge.level += lead;
    ++edge.crossings;
  });
  const auto back_of = [&](std::size_t i) {
    return edges[i].other == kNoPlane ? nullptr
                                      : find_edge(edges, edges[i].other, static_cast<std::uint16_t>(i / kEdges + 1));
  };
  // Looks from either side are as many, and as far off the border.
  for (std::size_t i = 0; i < edges.size(); ++i) {
    Edge& edge = edges[i];
    Edge* back = back_of(i);
    const bool first = edge.other > i / kEdges + 1;
    if (!first || back == nullptr || edge.crossings == 0 || back->crossings == 0) continue;
    edge.level =
        0.5F * (edge.level / static_cast<float>(edge.crossings) - back->level / static_cast<float>(back->crossings));
    back->level = -edge.level;
  }
  // The border itself says least.
  for (int times = 2; times <= 8; times *= 2) {
    for_edges(times, [](Edge& edge, float lead) {
      ++edge.all;
      if (lead > edge.level) ++edge.ahead;
    });
  }
  const auto recedes = [](const Edge& e) { return e.all >= kFewestVotes && 3 * e.ahead >= 2 * e.all; };
  const auto stands_out = [](const Edge& e) { return e.all >= kFewestVotes && 3 * e.ahead <= e.all; };
  for (std::size_t i = 0; i < edges.size(); ++i) {
    Edge& edge = edges[i];
    const Edge* back = back_of(i);
    if (back == nullptr || edge.crossings == 0 || back->crossings == 0) continue;
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
    if (other == own || other == last || other == kNoPlane) return;
    last = other;
    const Edge* edge = find_edge(edges, own, other);
    if (edge == nullptr || edge->kind == 0) return;
    if ((lead_of(in, plane_of, own, other, x, y) > edge->level) == (edge->kind > 0)) return;
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
