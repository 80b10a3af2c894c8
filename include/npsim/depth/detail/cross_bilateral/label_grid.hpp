// SPDX-License-Identifier: Apache-2.0
// How the label term of the cross-bilateral filter cuts up the image, the weights it sums with, its memory and error.
//
// Chunks are 16 columns wide, groups 16 rows high, tiles at most 24 chunks by 8 groups. A sum runs over distances in
// runs of 8, the window so rounded up with weights of 0.
// Error, relative, in roundings of floats: label_sum_roundings() and label_roundings().
// Memory: at R = 30 about 1 MB for each of at most 16 tiles in work, more where R is larger; 32 bytes per distance.
#ifndef NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_LABEL_GRID_HPP
#define NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_LABEL_GRID_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/image_view.hpp"
#include "npsim/core/slot_pool.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace cross_bilateral_detail {

inline constexpr int kLabelChunkPx = 16;
inline constexpr int kLabelGroupRows = 16;
inline constexpr int kLabelBlock = kLabelChunkPx * kLabelGroupRows;
inline constexpr int kLabelGroups = 8;  // of a tile
inline constexpr int kLabelTileRows = kLabelGroups * kLabelGroupRows;
inline constexpr int kLabelTileChunks = 24;
inline constexpr int kLabelSlots = 16;  // tiles in work at a time; more threads wait
inline constexpr int kLabelRun = 8;     // distances that are added up before their sum joins the total

struct LabelGrid {
  Shape shape;
  int rx = 0, ry = 0;          // the window, cut to what the image can hold
  int runs_x = 0, runs_y = 0;  // of distances
  int halo = 0;                // chunks on either side that the window reaches
  int chunks = 0;              // of a row
  int tile_chunks = 0;         // of a tile, both halos included
  int mask_stride = 0;         // the same in whole batches, and what a batch reads beyond; an odd number of lines

  [[nodiscard]] int tiles_across() const noexcept { return (chunks + kLabelTileChunks - 1) / kLabelTileChunks; }
  [[nodiscard]] int tiles() const noexcept {
    return (shape.height + kLabelTileRows - 1) / kLabelTileRows * tiles_across();
  }
  // Rows of samples that a tile reads.
  [[nodiscard]] int padding_rows() const noexcept { return kLabelRun * runs_y; }
  [[nodiscard]] int window_rows() const noexcept { return kLabelTileRows + 2 * padding_rows(); }

  // Scratch of a slot, and how many there are.
  [[nodiscard]] int slots() const noexcept { return tiles() < kLabelSlots ? tiles() : kLabelSlots; }
  [[nodiscard]] std::size_t slot_doubles() const noexcept {
    return static_cast<std::size_t>(kLabelBlock) * kLabelGroups * static_cast<std::size_t>(tile_chunks) +
           static_cast<std::size_t>(kLabelChunkPx) * static_cast<std::size_t>(window_rows());
  }
  [[nodiscard]] std::size_t slot_floats() const noexcept {
    return 2 * static_cast<std::size_t>(kLabelBlock) +
           static_cast<std::size_t>(kLabelChunkPx) * static_cast<std::size_t>(window_rows() + tile_chunks + 1);
  }
  [[nodiscard]] std::size_t slot_masks() const noexcept {
    return (2 * static_cast<std::size_t>(window_rows()) + 3 * kLabelGroups) * static_cast<std::size_t>(mask_stride);
  }
  // The planes of both sums: of the image, or of a tile for each slot.
  [[nodiscard]] Shape plane(bool by_slot) const noexcept {
    if (!by_slot) return {chunks * kLabelChunkPx, shape.height};
    return {((tile_chunks - 2 * halo) | 1) * kLabelChunkPx, slots() * kLabelTileRows};
  }
  [[nodiscard]] std::size_t uniform_elements() const noexcept {
    return static_cast<std::size_t>(chunks) * static_cast<std::size_t>(shape.height);
  }
};

[[nodiscard]] inline LabelGrid label_grid(Shape shape, int radius) noexcept {
  LabelGrid g;
  g.shape = shape;
  g.rx = radius < shape.width ? radius : shape.width - 1;
  g.ry = radius < shape.height ? radius : shape.height - 1;
  g.runs_x = g.rx / kLabelRun + 1;
  g.runs_y = g.ry / kLabelRun + 1;
  g.halo = (kLabelRun * g.runs_x + kLabelChunkPx - 1) / kLabelChunkPx;
  g.chunks = (shape.width + kLabelChunkPx - 1) / kLabelChunkPx;
  g.tile_chunks = (g.chunks < kLabelTileChunks ? g.chunks : kLabelTileChunks) + 2 * g.halo;
  g.mask_stride = ((g.tile_chunks + 2 * kLabelChunkPx - 1) / kLabelChunkPx | 1) * kLabelChunkPx;
  return g;
}

// Of the numerator, in floats along columns: the weight's own rounding, the sum of two mirrored samples, at most
// kLabelRun products in a chain (without fma one addition less and the product), the runs that join. What follows is in
// double, at most (R + 4) 2^-53 an axis, and rounded once. The denominator, in double throughout, rounds once. The
// direct form stays below: 5 and 4 in floats, then in double, and once more each.
[[nodiscard]] constexpr int label_sum_roundings(const LabelGrid& g) noexcept {
  return 2 + kLabelRun + (g.runs_y - 1) + 1;
}
// Of numerator and denominator together.
[[nodiscard]] constexpr int label_roundings(const LabelGrid& g) noexcept { return label_sum_roundings(g) + 1; }

// The Gaussian along an axis by distance; 0 beyond the radius. `halved` is half of it at 0, where a sample is its own
// mirror image.
struct LabelWeights {
  Span<float> halved_f;
  Span<double> halved;
  Span<double> edges;   // see edge()
  int edge_offset = 0;  // of edge(0)
  double total = 0;     // over all distances of both signs

  // The weights of a run of samples [begin, end) seen from x add up to edge(x - end) - edge(x - begin), and the total
  // where x lies in it: minus what lies at -d and beyond for d < 0, what lies beyond d otherwise. So the difference is
  // one of sums of tails, and keeps its digits far out.
  [[nodiscard]] const double* edge(int d) const noexcept { return edges.data() + (edge_offset + d); }
  // What lies at distance d and beyond, on one side; d >= 1.
  [[nodiscard]] double tail(int d) const noexcept { return d <= edge_offset ? -*edge(-d) : 0.0; }
};

[[nodiscard]] inline std::size_t label_distances(const LabelGrid& g) noexcept {
  return static_cast<std::size_t>(kLabelRun) * static_cast<std::size_t>(g.runs_x > g.runs_y ? g.runs_x : g.runs_y);
}
// Distances from a pixel of a chunk to either end of what the window reaches, in whole chunks.
[[nodiscard]] constexpr int label_edge_offset(const LabelGrid& g) noexcept {
  const int r = g.rx > g.ry ? g.rx : g.ry;
  return ((r + kLabelChunkPx - 1) / kLabelChunkPx + 2) * kLabelChunkPx;
}
[[nodiscard]] inline std::size_t label_edges(const LabelGrid& g) noexcept {
  return 2 * static_cast<std::size_t>(label_edge_offset(g));
}

// w's spans have the sizes above.
inline void fill_label_weights(const LabelGrid& g, int radius, double sigma, LabelWeights& w) noexcept {
  const auto value = [&](int d) { return d <= radius ? std::exp(-0.5 * (d / sigma) * (d / sigma)) : 0.0; };
  for (std::size_t i = 0; i < w.halved.size(); ++i) {
    w.halved[i] = i == 0 ? 0.5 : value(static_cast<int>(i));
    w.halved_f[i] = static_cast<float>(w.halved[i]);
  }
  w.edge_offset = label_edge_offset(g);
  double tail = 0;  // from far to near, so that small sums come first
  for (int d = radius; d > 0; --d) {
    tail += value(d);
    // -d and d - 1 see the same tail.
    if (d <= w.edge_offset) w.edges[static_cast<std::size_t>(w.edge_offset - d)] = -tail;
    if (w.edge_offset + d - 1 < static_cast<int>(w.edges.size())) {
      w.edges[static_cast<std::size_t>(w.edge_offset + d - 1)] = tail;
    }
  }
  for (int d = radius + 1; d <= w.edge_offset; ++d) w.edges[static_cast<std::size_t>(w.edge_offset - d)] = 0.0;
  for (int d = radius; w.edge_offset + d < static_cast<int>(w.edges.size()); ++d) {
    w.edges[static_cast<std::size_t>(w.edge_offset + d)] = 0.0;
  }
  w.total = 1 + 2 * tail;
}

[[nodiscard]] inline std::size_t label_workspace_bytes(const LabelGrid& g, bool by_slot) noexcept {
  const auto slots = static_cast<std::size_t>(g.slots());
  return allocation_bytes<std::int32_t>(g.uniform_elements()) + 2 * allocation_bytes<float>(g.plane(by_slot).pixels()) +
         allocation_bytes<double>(slots * g.slot_doubles()) + allocation_bytes<float>(slots * g.slot_floats()) +
         allocation_bytes<std::int32_t>(slots * g.slot_masks()) + allocation_bytes<float>(label_distances(g)) +
         allocation_bytes<double>(label_distances(g)) + allocation_bytes<double>(label_edges(g));
}

}  // namespace cross_bilateral_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_LABEL_GRID_HPP
