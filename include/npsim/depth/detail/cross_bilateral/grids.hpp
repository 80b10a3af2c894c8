// SPDX-License-Identifier: Apache-2.0
// How the cross-bilateral filter cuts up the image for either term, and the memory that this takes: functions of shape
// and radius alone, known when the program is compiled.
//
// Colour term: blocks of 16x4 pixels, tiles of 64 columns in bands of 16 rows, strips of at least 64 rows; offsets dx
// in chunks of 16, swept in at most 16 chunks at a time. Memory: 32 bytes per pixel, 16 for each of the rows below a
// strip, the scratch of a strip, and 12 floats per block.
// Label term: chunks of 16 columns, groups of 16 rows, tiles of at most 24 chunks by 8 groups. A sum runs over
// distances in runs of 8, the window so rounded up with weights of 0. Memory: a quarter of a byte per pixel, 8 bytes
// more beside colour; at R = 30 about 1 MB for each of at most 16 tiles in work, more where R is larger; 32 bytes per
// distance.
// Error, relative, in roundings of floats: colour_chain(), label_sum_roundings() and label_roundings().
#ifndef NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_GRIDS_HPP
#define NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_GRIDS_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/workspace.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace cross_bilateral_detail {

// The colour term.
inline constexpr int kChunkPx = 16;   // columns of a block, offsets of a chunk; no batch is wider
inline constexpr int kGroupRows = 4;  // rows of a block
inline constexpr int kColourTilePx = 64;
inline constexpr int kColourBandRows = 16;  // rows of p that a row of q meets before its sums are added up

[[nodiscard]] constexpr int round_up(int x, int to) noexcept { return (x + to - 1) / to * to; }

inline constexpr int kMaxChunks = 16;  // of offsets in one sweep
inline constexpr int kTileBlocks = kColourTilePx / kChunkPx;
inline constexpr int kScaledColumns = (kMaxChunks + 2) * kChunkPx;  // of q that a block meets in a sweep, and a batch

struct ColourGrid {
  Shape shape;
  int rx = 0, ry = 0;  // the window, cut to what the image can hold
  int padding = 0;     // columns left of the image in every plane of samples
  int width = 0;       // columns of sums: whole tiles
  int sample_stride = 0;
  int strip_rows = 0;
  int strips = 0;
  int band_rows = 0;
  int first_chunk = 0, end_chunk = 0;  // of offsets dx
  int sweep_chunks = 0;                // at most kMaxChunks
  int skew_stride = 0;                 // of one of the 16 rows of sums for q

  [[nodiscard]] constexpr int block_columns() const noexcept { return width / kChunkPx; }
  [[nodiscard]] constexpr int block_rows() const noexcept { return round_up(shape.height, kGroupRows) / kGroupRows; }
  [[nodiscard]] constexpr double taps() const noexcept {
    return static_cast<double>(2 * rx + 1) * static_cast<double>(2 * ry + 1);
  }
  [[nodiscard]] constexpr std::size_t samples() const noexcept {
    return static_cast<std::size_t>(sample_stride) * static_cast<std::size_t>(shape.height);
  }
  [[nodiscard]] constexpr std::size_t sums_rows() const noexcept {
    return static_cast<std::size_t>(shape.height) + static_cast<std::size_t>(strips) * static_cast<std::size_t>(ry);
  }
  [[nodiscard]] constexpr std::size_t skew_elements() const noexcept {
    return static_cast<std::size_t>(2 * kChunkPx) * static_cast<std::size_t>(skew_stride);
  }
};

[[nodiscard]] constexpr ColourGrid colour_grid(Shape shape, int radius) noexcept {
  ColourGrid g;
  g.shape = shape;
  g.rx = radius < shape.width ? radius : shape.width - 1;
  g.ry = radius < shape.height ? radius : shape.height - 1;
  g.padding = round_up(g.rx, kChunkPx);
  g.width = round_up(shape.width, kColourTilePx);
  g.sample_stride = g.padding + g.width + g.padding + kChunkPx;
  if (g.sample_stride % 1024 == 0) g.sample_stride += kChunkPx;  // rows that are not all in one set of the cache
  g.strip_rows = round_up(g.ry > 64 ? g.ry : 64, kColourBandRows);
  g.strips = (shape.height + g.strip_rows - 1) / g.strip_rows;
  g.first_chunk = -g.padding / kChunkPx;
  g.end_chunk = g.rx / kChunkPx + 1;
  const int chunks = g.end_chunk - g.first_chunk;
  g.sweep_chunks = chunks < kMaxChunks ? chunks : kMaxChunks;
  g.band_rows = chunks <= 4 ? kColourBandRows : kGroupRows;
  g.skew_stride = kChunkPx + kColourTilePx + kChunkPx * (g.sweep_chunks - 1) + kChunkPx;
  return g;
}

// Planes of numbers, one per block, with empty blocks left and right of the image.
enum ColourBlockPlane {
  kBlockLow = 0,        // of the colours, three planes
  kBlockHigh = 3,       // likewise
  kBlockLogDepth = 6,   // log2 of the largest depth
  kBlockLogSums = 7,    // least log2 over its pixels of their sum of weighted depths, as far as it is known before
  kBlockLogWeight = 8,  // likewise of weights
  kBlockAny = 9,        // 1: a pixel has a colour and wants a result; else 0
  kBlockSource = 10,    // a pixel counts for others
  kBlockHoles = 11,     // a pixel wants a result but counts for none
  kBlockPlanes = 12,
};

[[nodiscard]] constexpr int block_stride(const ColourGrid& g) noexcept {
  return g.block_columns() + 2 * (g.padding / kChunkPx) + 2 * kMaxChunks;  // whole batches can be read
}
[[nodiscard]] constexpr std::size_t block_elements(const ColourGrid& g) noexcept {
  return static_cast<std::size_t>(kBlockPlanes) * static_cast<std::size_t>(g.block_rows()) *
         static_cast<std::size_t>(block_stride(g));
}

// The longest chain of additions that leads from a weight to its sum.
[[nodiscard]] constexpr int colour_chain(const ColourGrid& g) noexcept {
  const int of_p = kChunkPx + g.sweep_chunks;
  const int of_q = kGroupRows + g.band_rows / kGroupRows * g.sweep_chunks + 4;
  return (of_p > of_q ? of_p : of_q) + 6;  // compensated additions, strip and strip, the pixel itself
}

inline constexpr std::size_t kOwnSums = 4 * kColourBandRows * kColourTilePx;  // of p in a tile

[[nodiscard]] constexpr std::size_t spatial_elements(const ColourGrid& g) noexcept {
  return static_cast<std::size_t>(2 * g.rx + 1) * static_cast<std::size_t>(g.ry + 1) + 2;  // two are read beyond
}
[[nodiscard]] constexpr std::size_t colour_sums_elements(const ColourGrid& g) noexcept {
  return g.sums_rows() * 4 * static_cast<std::size_t>(g.width);
}
[[nodiscard]] constexpr std::size_t colour_scratch_elements(const ColourGrid& g) noexcept {
  return static_cast<std::size_t>(g.strips) * (kOwnSums + g.skew_elements());
}

[[nodiscard]] constexpr std::size_t colour_workspace_bytes(const ColourGrid& g) noexcept {
  return 3 * allocation_bytes<float>(g.samples()) + allocation_bytes<float>(block_elements(g)) +
         allocation_bytes<float>(spatial_elements(g)) + allocation_bytes<float>(colour_sums_elements(g)) +
         allocation_bytes<float>(colour_scratch_elements(g)) +
         allocation_bytes<float>(2 * static_cast<std::size_t>(g.shape.height));
}

// The label term.
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

  [[nodiscard]] constexpr int tiles_across() const noexcept {
    return (chunks + kLabelTileChunks - 1) / kLabelTileChunks;
  }
  [[nodiscard]] constexpr int tiles() const noexcept {
    return (shape.height + kLabelTileRows - 1) / kLabelTileRows * tiles_across();
  }
  // Rows of samples that a tile reads.
  [[nodiscard]] constexpr int padding_rows() const noexcept { return kLabelRun * runs_y; }
  [[nodiscard]] constexpr int window_rows() const noexcept { return kLabelTileRows + 2 * padding_rows(); }

  // Scratch of a slot, and how many there are.
  [[nodiscard]] constexpr int slots() const noexcept { return tiles() < kLabelSlots ? tiles() : kLabelSlots; }
  [[nodiscard]] constexpr std::size_t slot_doubles() const noexcept {
    return static_cast<std::size_t>(kLabelBlock) * kLabelGroups * static_cast<std::size_t>(tile_chunks) +
           static_cast<std::size_t>(kLabelChunkPx) * static_cast<std::size_t>(window_rows());
  }
  [[nodiscard]] constexpr std::size_t slot_floats() const noexcept {
    return 2 * static_cast<std::size_t>(kLabelBlock) +
           static_cast<std::size_t>(kLabelChunkPx) * static_cast<std::size_t>(window_rows() + tile_chunks + 1);
  }
  [[nodiscard]] constexpr std::size_t slot_masks() const noexcept {
    return (2 * static_cast<std::size_t>(window_rows()) + 3 * kLabelGroups) * static_cast<std::size_t>(mask_stride);
  }
  // The planes of both sums: of the image, or of a tile for each slot.
  [[nodiscard]] constexpr Shape plane(bool by_slot) const noexcept {
    if (!by_slot) return {chunks * kLabelChunkPx, shape.height};
    return {((tile_chunks - 2 * halo) | 1) * kLabelChunkPx, slots() * kLabelTileRows};
  }
  [[nodiscard]] constexpr std::size_t uniform_elements() const noexcept {
    return static_cast<std::size_t>(chunks) * static_cast<std::size_t>(shape.height);
  }
};

[[nodiscard]] constexpr LabelGrid label_grid(Shape shape, int radius) noexcept {
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

[[nodiscard]] constexpr std::size_t label_distances(const LabelGrid& g) noexcept {
  return static_cast<std::size_t>(kLabelRun) * static_cast<std::size_t>(g.runs_x > g.runs_y ? g.runs_x : g.runs_y);
}
// Distances from a pixel of a chunk to either end of what the window reaches, in whole chunks.
[[nodiscard]] constexpr int label_edge_offset(const LabelGrid& g) noexcept {
  const int r = g.rx > g.ry ? g.rx : g.ry;
  return ((r + kLabelChunkPx - 1) / kLabelChunkPx + 2) * kLabelChunkPx;
}
[[nodiscard]] constexpr std::size_t label_edges(const LabelGrid& g) noexcept {
  return 2 * static_cast<std::size_t>(label_edge_offset(g));
}

[[nodiscard]] constexpr std::size_t label_workspace_bytes(const LabelGrid& g, bool by_slot) noexcept {
  const auto slots = static_cast<std::size_t>(g.slots());
  return allocation_bytes<std::int32_t>(g.uniform_elements()) + 2 * allocation_bytes<float>(g.plane(by_slot).pixels()) +
         allocation_bytes<double>(slots * g.slot_doubles()) + allocation_bytes<float>(slots * g.slot_floats()) +
         allocation_bytes<std::int32_t>(slots * g.slot_masks()) + allocation_bytes<float>(label_distances(g)) +
         allocation_bytes<double>(label_distances(g)) + allocation_bytes<double>(label_edges(g));
}

}  // namespace cross_bilateral_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_GRIDS_HPP
