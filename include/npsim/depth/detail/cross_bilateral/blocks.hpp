// SPDX-License-Identifier: Apache-2.0
// How the cross-bilateral filter's colour term cuts up the image, and what is known of each block of 16x4 pixels: the
// box of its colours, its depths and sums. Pairs of blocks of which it follows that they cannot matter are left out.
//
// Left out is what adds at most `prune_error` to either sum of the filter, all of it together. Cost: one test per
// pixel at R = 30. Memory: 12 floats per block.
#ifndef NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_BLOCKS_HPP
#define NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_BLOCKS_HPP

#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/image_view.hpp"
#include "npsim/depth/detail/cross_bilateral/pairs.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace cross_bilateral_detail {

constexpr int round_up(int x, int to) noexcept { return (x + to - 1) / to * to; }

inline constexpr int kMaxChunks = 16;  // of offsets in one sweep
inline constexpr int kTileBlocks = kColourTilePx / kChunkPx;
inline constexpr int kScaledColumns = (kMaxChunks + 2) * kChunkPx;  // of q that a block meets in a sweep, and a batch

// How the image is cut up. A function of shape and radius alone.
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

  [[nodiscard]] int block_columns() const noexcept { return width / kChunkPx; }
  [[nodiscard]] int block_rows() const noexcept { return round_up(shape.height, kGroupRows) / kGroupRows; }
  [[nodiscard]] double taps() const noexcept {
    return static_cast<double>(2 * rx + 1) * static_cast<double>(2 * ry + 1);
  }
  [[nodiscard]] std::size_t samples() const noexcept {
    return static_cast<std::size_t>(sample_stride) * static_cast<std::size_t>(shape.height);
  }
  [[nodiscard]] std::size_t sums_rows() const noexcept {
    return static_cast<std::size_t>(shape.height) + static_cast<std::size_t>(strips) * static_cast<std::size_t>(ry);
  }
  [[nodiscard]] std::size_t skew_elements() const noexcept {
    return static_cast<std::size_t>(2 * kChunkPx) * static_cast<std::size_t>(skew_stride);
  }
};

[[nodiscard]] inline ColourGrid colour_grid(Shape shape, int radius) noexcept {
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

[[nodiscard]] inline int block_stride(const ColourGrid& g) noexcept {
  return g.block_columns() + 2 * (g.padding / kChunkPx) + 2 * kMaxChunks;  // whole batches can be read
}
[[nodiscard]] inline std::size_t block_elements(const ColourGrid& g) noexcept {
  return static_cast<std::size_t>(kBlockPlanes) * static_cast<std::size_t>(g.block_rows()) *
         static_cast<std::size_t>(block_stride(g));
}

}  // namespace cross_bilateral_detail

namespace depth_detail {

using namespace cross_bilateral_detail;

[[nodiscard]] inline float log2_of(float x) noexcept {
  return simd::log2(simd::scalar::F32(x)).value;  // minus infinity at 0; the same bits everywhere
}

// A pixel without colour stands where no other colour is, alone.
inline constexpr float kNoColour = 1e10F;
inline constexpr float kMaxColour = 1e9F;

struct ColourSamples {
  ImageView<float> l, a, b;  // data() points at pixel (0, 0)
  ImageView<float> depth;    // 0 where a pixel does not count
};

struct ColourBlocks {
  float* data = nullptr;
  std::ptrdiff_t stride = 0;        // of a row of blocks
  std::ptrdiff_t plane_stride = 0;  // of a plane
  int padding = 0;

  [[nodiscard]] float* at(int plane, int column, int row) const noexcept {
    return data + plane * plane_stride + row * stride + padding + column;
  }
};

struct PruneRule {
  bool on = false;
  float scale = 0;          // of a squared colour distance, in powers of two
  float spatial_scale = 0;  // of a squared distance in pixels
  float log_threshold = 0;  // log2 of mu times the taps of a window over the error that pruning may make
};

// numerator and denominator: what is known of the filter's sums; without pixels: nothing.
template <class F>
void measure_block_row(const ColourGrid& g, const ColourSamples& samples, float mu, ImageView<float> numerator,
                       ImageView<float> denominator, int row, const ColourBlocks& out) noexcept {
  const F zero(0.0F);
  const F most(std::numeric_limits<float>::max());
  const int y_end = (row + 1) * kGroupRows < g.shape.height ? (row + 1) * kGroupRows : g.shape.height;
  for (int plane = 0; plane < kBlockPlanes; ++plane) {
    float* all = out.at(plane, -out.padding, row);
    for (std::ptrdiff_t i = 0; i < out.stride; ++i) all[i] = 0.0F;
  }
  for (int column = 0; column < g.block_columns(); ++column) {
    F low[3] = {most, most, most};
    F high[3] = {-most, -most, -most};
    F sums = most;
    F weight = most;
    F deepest = zero;
    F shallowest = most;
    for (int y = row * kGroupRows; y < y_end; ++y) {
      for (int x = column * kChunkPx; x < (column + 1) * kChunkPx; x += F::lanes) {  // no colour beyond the last column
        const F c[3] = {F::load(samples.l.row(y) + x), F::load(samples.a.row(y) + x), F::load(samples.b.row(y) + x)};
        const auto coloured = c[1] <= F(kMaxColour);
        const F z = F::load(samples.depth.row(y) + x);
        const F self = select(z > zero, F(mu), zero);
        F own = self * z;
        F own_weight = self;
        if (!numerator.empty()) {
          own = own + F::load(numerator.row(y) + x);
          own_weight = own_weight + F::load(denominator.row(y) + x);
        }
        for (int i = 0; i < 3; ++i) {
          low[i] = select(coloured, min(low[i], c[i]), low[i]);
          high[i] = select(coloured, max(high[i], c[i]), high[i]);
        }
        sums = select(coloured, min(sums, own), sums);
        weight = select(coloured, min(weight, own_weight), weight);
        deepest = select(coloured, max(deepest, z), deepest);
        shallowest = select(coloured, min(shallowest, z), shallowest);
      }
    }
    const float least_depth = simd::least_lane(shallowest);
    if (!(least_depth < std::numeric_limits<float>::max())) continue;
    const float most_depth = -simd::least_lane(-deepest);
    for (int i = 0; i < 3; ++i) {
      *out.at(kBlockLow + i, column, row) = simd::least_lane(low[i]);
      *out.at(kBlockHigh + i, column, row) = -simd::least_lane(-high[i]);
    }
    *out.at(kBlockLogDepth, column, row) = log2_of(most_depth);
    *out.at(kBlockLogSums, column, row) = log2_of(simd::least_lane(sums));
    *out.at(kBlockLogWeight, column, row) = log2_of(simd::least_lane(weight));
    *out.at(kBlockAny, column, row) = 1.0F;
    *out.at(kBlockSource, column, row) = most_depth > 0 ? 1.0F : 0.0F;
    *out.at(kBlockHoles, column, row) = least_depth > 0 ? 0.0F : 1.0F;
  }
}

struct BlockWork {
  std::uint32_t work = 0;   // chunks of offsets that matter, a bit each from `sweep`
  std::uint32_t holes = 0;  // those where a pixel has no depth
};

// What the block of p at (column, row) has to meet in the row q_row of blocks, among the chunks sweep..sweep_end - 1 of
// offsets; a chunk meets two blocks. Every tap of a window may lose the same share of prune_error, so that what all
// lose together is bounded.
template <class F>
[[nodiscard]] BlockWork find_work(const ColourBlocks& blocks, const PruneRule& rule, int column, int row, int q_row,
                                  int sweep, int sweep_end) noexcept {
  const F zero(0.0F);
  const auto of_p = [&](int plane) { return F(*blocks.at(plane, column, row)); };
  if (*blocks.at(kBlockAny, column, row) == 0.0F) return {};
  const bool source = *blocks.at(kBlockSource, column, row) != 0.0F;
  const int dy = (q_row - row) * kGroupRows - (kGroupRows - 1);  // at least so many rows apart
  const auto least = [](F by_depth, F log_weight) { return select(by_depth > -log_weight, by_depth, -log_weight); };
  std::uint32_t here = 0;
  std::uint32_t with_holes = 0;
  for (int chunk = sweep; chunk <= sweep_end; chunk += F::lanes) {
    const auto of_q = [&](int plane) { return F::load(blocks.at(plane, column + chunk, q_row)); };
    const auto is_source = of_q(kBlockSource) > zero;
    auto wanted = of_q(kBlockAny) > zero;
    if (!source) wanted = wanted & is_source;
    if (rule.on) {
      F squared = zero;
      for (int i = 0; i < 3; ++i) {
        const F above = of_q(kBlockLow + i) - of_p(kBlockHigh + i);
        const F below = of_p(kBlockLow + i) - of_q(kBlockHigh + i);
        const F gap = max(max(above, below), zero);
        squared = squared + gap * gap;
      }
      const F dx = max(F(static_cast<float>(kChunkPx)) * abs(F(static_cast<float>(chunk)) + F::iota()) -
                           F(static_cast<float>(kChunkPx - 1)),
                       zero);
      const F distance_squared = dx * dx + F(static_cast<float>(dy > 0 ? dy * dy : 0));
      const F exponent = squared * F(rule.scale) + distance_squared * F(rule.spatial_scale);
      const F for_p = least(of_q(kBlockLogDepth) - of_p(kBlockLogSums), of_p(kBlockLogWeight));
      auto matters = is_source & ~(exponent >= F(rule.log_threshold) + for_p);
      if (source) {
        const F for_q = least(of_p(kBlockLogDepth) - of_q(kBlockLogSums), of_q(kBlockLogWeight));
        matters = matters | ~(exponent >= F(rule.log_threshold) + for_q);
      }
      wanted = wanted & matters;
    }
    here |= bits(wanted) << static_cast<unsigned>(chunk - sweep);
    with_holes |= bits(of_q(kBlockHoles) > zero) << static_cast<unsigned>(chunk - sweep);
  }
  const std::uint32_t chunks = (1U << static_cast<unsigned>(sweep_end - sweep)) - 1U;
  BlockWork out;
  out.work = (here | here >> 1U) & chunks;
  out.holes = *blocks.at(kBlockHoles, column, row) != 0.0F ? chunks : (with_holes | with_holes >> 1U) & chunks;
  return out;
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_BLOCKS_HPP
