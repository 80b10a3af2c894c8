// SPDX-License-Identifier: Apache-2.0
// The colour term of the dual-reference cross-bilateral filter (3.2): for every pixel p the sums
//   sum_q w z(q)  and  sum_q w,   w = Gs(|q - p|) Gc(|J(q) - J(p)|),  over all q != p of the window.
//
// w is symmetric, so a pair of pixels is weighed once and counts for both: for q in the rows at and below p. Lanes are
// neighbouring p, four rows of p share the loads of q. What a pair gives to q goes to one of 16 rows of sums, by
// dx mod 16, so that it is stored where it was loaded from, aligned; those are added up once per row of q. Sums go from
// one level to the next in at most kChunkPx additions, the last level is compensated, and rows below a strip have their
// own sums, so that strips run in parallel and the bits depend on neither threads nor lanes.
//
// Error: of a weight, see cross_bilateral_pairs.hpp; of the sums 2^-24 per term of the longest chain, see
// colour_chain(). Pruned: blocks of 16x4 pixels whose colours are so far apart that what all of
// them leave out is at most `prune_error` of either sum of the filter.
// Cost: that of the pairs, (2R + 1)^2 / 2 per pixel. Memory: 32 bytes per pixel, 16 for each of the rows below
// a strip, and the scratch of a strip.
#ifndef NPSIM_DEPTH_CROSS_BILATERAL_COLOUR_HPP
#define NPSIM_DEPTH_CROSS_BILATERAL_COLOUR_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/cross_bilateral_pairs.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace v1 {
namespace cross_bilateral_detail {

inline constexpr int kMaxChunks = 16;  // of offsets in one sweep

constexpr int round_up(int x, int to) noexcept { return (x + to - 1) / to * to; }

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
  g.skew_stride = kChunkPx + kColourTilePx + kChunkPx * g.sweep_chunks + kChunkPx;
  return g;
}

// The longest chain of additions that leads from a weight to its sum.
[[nodiscard]] inline int colour_chain(const ColourGrid& g) noexcept {
  const int of_p = kChunkPx + g.sweep_chunks;
  const int of_q = kGroupRows + g.band_rows / kGroupRows * g.sweep_chunks + 4;
  return (of_p > of_q ? of_p : of_q) + 6;  // compensated additions, strip and strip, the pixel itself
}

// What a block of 16x4 pixels holds: the box of its colours; how much its depths can add to others; how little of its
// own sums may be lost.
struct ColourBlock {
  float low[3], high[3];
  float log_depth = 0;  // log2 of the largest depth
  float log_sums = 0;   // min over its pixels and both sums of log2(sum), the depth's share being subtracted later
  float log_weight = 0;
  bool any = false;     // of its pixels has a colour and wants a result
  bool source = false;  // of its pixels counts for others
  bool holes = false;   // a pixel wants a result but counts for none
};

inline constexpr std::size_t kOwnSums = 4 * kColourBandRows * kColourTilePx;  // of p in a tile

}  // namespace cross_bilateral_detail

inline namespace NPSIM_ISA_NAMESPACE {
namespace depth_detail {

using namespace cross_bilateral_detail;

// A pixel without colour stands where no other colour is, alone.
inline constexpr float kNoColour = 1e10F;
inline constexpr float kMaxColour = 1e9F;

struct ColourSamples {
  ImageView<float> l, a, b;  // data() points at pixel (0, 0)
  ImageView<float> depth;    // 0 where a pixel does not count
};

struct ColourTerm {
  ColourGrid grid;
  ColourSamples samples;
  Span<ColourBlock> blocks;
  Span<float> spatial;      // log2 Gs by dy and dx; what belongs to the other pixel of the pair is -1e30
  Span<float> sums;         // rows of 4 x grid.width: sum w z and its rest, sum w and its rest; strips' tails follow
  Span<float> scratch;      // by strip
  float scale = 0;          // of a squared colour distance, in powers of two
  float spatial_scale = 0;  // of a squared distance in pixels
  float log_threshold = 0;  // log2 of mu times the taps of a window over the error that pruning may make
  bool prune = true;

  [[nodiscard]] float* sums_row(int strip, int y) const noexcept {
    const int end = (strip + 1) * grid.strip_rows;
    const int row = y < end ? y : grid.shape.height + strip * grid.ry + (y - end);
    return sums.data() + static_cast<std::size_t>(row) * 4 * static_cast<std::size_t>(grid.width);
  }
  [[nodiscard]] const ColourBlock& block(int column, int row) const noexcept {
    return blocks[static_cast<std::size_t>(row) * static_cast<std::size_t>(grid.block_columns()) +
                  static_cast<std::size_t>(column)];
  }
};

// May the pairs of these two blocks be left out? They are at least `distance_squared` pixels apart. Every tap of a
// window may lose the same share of prune_error, so what all lose together is bounded.
[[nodiscard]] inline bool negligible(const ColourTerm& term, const ColourBlock& p, const ColourBlock& q,
                                     float distance_squared) noexcept {
  if (!p.any || !q.any || !(p.source || q.source)) return true;
  if (!term.prune) return false;
  float squared = 0;
  for (int i = 0; i < 3; ++i) {
    const float above = q.low[i] - p.high[i];
    const float below = p.low[i] - q.high[i];
    const float gap = above > below ? above : below;
    if (gap > 0) squared = squared + gap * gap;
  }
  const auto needed = [](const ColourBlock& to, const ColourBlock& from) {
    const float by_depth = from.log_depth - to.log_sums;
    return by_depth > -to.log_weight ? by_depth : -to.log_weight;
  };
  const float exponent = squared * term.scale + distance_squared * term.spatial_scale;
  return (!q.source || exponent >= term.log_threshold + needed(p, q)) &&
         (!p.source || exponent >= term.log_threshold + needed(q, p));
}

// Sums that one row of q has received, from the 16 rows they were collected in to the image's.
template <class F>
void collect_skewed(const ColourGrid& g, const float* skew, int first_column, float* row) noexcept {
  const auto total = [&](const float* from) {
    F sum[4];
    for (int i = 0; i < 4; ++i) {
      const auto at = [&](int k) { return F::load(from + (2 * k) * static_cast<std::ptrdiff_t>(g.skew_stride) - k); };
      sum[i] = (at(4 * i) + at(4 * i + 1)) + (at(4 * i + 2) + at(4 * i + 3));
    }
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
  };
  for (int j = 0; j + kChunkPx < g.skew_stride; j += F::lanes) {
    const int x = first_column + j;
    if (x < 0 || x >= g.width) continue;
    add_compensated(row + x, row + g.width + x, total(skew + kChunkPx + j));
    add_compensated(row + 2 * g.width + x, row + 3 * g.width + x, total(skew + kChunkPx + j + g.skew_stride));
  }
}

// All pairs whose upper (or left) pixel p lies in this tile of a band.
template <class F, int kDegree>
void weigh_tile(const ColourTerm& term, int strip, int x0, int y0, int rows, float* own, float* skew) noexcept {
  const ColourGrid& g = term.grid;
  const auto stride = static_cast<std::ptrdiff_t>(g.sample_stride);
  constexpr int kBlocks = kColourTilePx / kChunkPx;
  const int groups = round_up(rows, kGroupRows) / kGroupRows;
  const int q_end = y0 + rows + g.ry < g.shape.height ? y0 + rows + g.ry : g.shape.height;
  std::memset(own, 0, kOwnSums * sizeof(float));
  for (int sweep = g.first_chunk; sweep < g.end_chunk; sweep += g.sweep_chunks) {
    const int sweep_end = sweep + g.sweep_chunks < g.end_chunk ? sweep + g.sweep_chunks : g.end_chunk;
    std::uint32_t work[kColourBandRows / kGroupRows][kBlocks] = {};
    std::uint32_t holes[kColourBandRows / kGroupRows][kBlocks] = {};
    for (int qy = y0; qy < q_end; ++qy) {
      if (qy % kGroupRows == 0) {  // y0 is a multiple too
        for (int group = 0; group < groups; ++group) {
          for (int i = 0; i < kBlocks; ++i) {
            work[group][i] = holes[group][i] = 0;
            const int column = x0 / kChunkPx + i;
            const ColourBlock& p = term.block(column, y0 / kGroupRows + group);
            bool before = false;  // the segment of q left of the chunk's second one
            bool before_holes = false;
            for (int chunk = sweep; chunk <= sweep_end; ++chunk) {
              const int at = column + chunk;
              bool here = false;
              bool here_holes = false;
              if (at >= 0 && at < g.block_columns()) {
                const ColourBlock& q = term.block(at, qy / kGroupRows);
                const int dx = kChunkPx * (chunk < 0 ? -chunk : chunk) - (kChunkPx - 1);
                const int dy = qy - (y0 + group * kGroupRows) - (kGroupRows - 1);
                here = !negligible(term, p, q, static_cast<float>((dx > 0 ? dx * dx : 0) + (dy > 0 ? dy * dy : 0)));
                here_holes = q.holes;
              }
              if (chunk > sweep) {
                const std::uint32_t bit = 1U << static_cast<unsigned>(chunk - 1 - sweep);
                if (before || here) work[group][i] |= bit;
                if (p.holes || before_holes || here_holes) holes[group][i] |= bit;
              }
              before = here;
              before_holes = here_holes;
            }
          }
        }
      }
      bool touched = false;
      for (int group = 0; group < groups; ++group) {
        const int p0 = y0 + group * kGroupRows;
        const int end = (group + 1) * kGroupRows < rows ? kGroupRows : rows - group * kGroupRows;
        const int first_row = qy - g.ry > p0 ? qy - g.ry - p0 : 0;
        const int n = (qy - p0 + 1 < end ? qy - p0 + 1 : end) - first_row;
        if (n <= 0) continue;
        for (int x = x0; x < x0 + kColourTilePx; x += F::lanes) {
          const int i = (x - x0) / kChunkPx;
          if (work[group][i] == 0) continue;
          if (!touched) std::memset(skew, 0, g.skew_elements() * sizeof(float));
          touched = true;
          const std::ptrdiff_t p_at = (p0 + first_row) * stride + x;
          const std::ptrdiff_t q_at = qy * stride + x;
          const auto spatial_stride = static_cast<std::ptrdiff_t>(2 * g.rx + 1);
          PairRows s;
          s.pl = term.samples.l.data() + p_at;
          s.pa = term.samples.a.data() + p_at;
          s.pb = term.samples.b.data() + p_at;
          s.pz = term.samples.depth.data() + p_at;
          s.ql = term.samples.l.data() + q_at;
          s.qa = term.samples.a.data() + q_at;
          s.qb = term.samples.b.data() + q_at;
          s.qz = term.samples.depth.data() + q_at;
          s.spatial = term.spatial.data() + (qy - p0 - first_row) * spatial_stride + g.rx;
          s.skew = skew + kChunkPx + (x - x0) - sweep * kChunkPx;
          s.own = own + (group * kGroupRows + first_row) * kColourTilePx + (x - x0);
          s.stride = stride;
          s.spatial_stride = spatial_stride;
          s.skew_stride = g.skew_stride;
          s.minus_scale = -term.scale;
          s.rx = g.rx;
          s.first_chunk = sweep;
          s.end_chunk = sweep_end;
          s.work = work[group][i];
          s.holes = holes[group][i];
          if (n == 4) weigh_rows<F, 4, kDegree>(s);
          if (n == 3) weigh_rows<F, 3, kDegree>(s);
          if (n == 2) weigh_rows<F, 2, kDegree>(s);
          if (n == 1) weigh_rows<F, 1, kDegree>(s);
        }
      }
      if (touched) collect_skewed<F>(g, skew, x0 + sweep * kChunkPx, term.sums_row(strip, qy));
    }
  }
  for (int row = 0; row < rows; ++row) {
    float* sums = term.sums_row(strip, y0 + row) + x0;
    const float* from = own + row * kColourTilePx;
    constexpr std::ptrdiff_t kPlane = kColourBandRows * kColourTilePx;
    for (int x = 0; x < kColourTilePx; x += F::lanes) {
      for (int i = 0; i < 2; ++i) {
        float* hi = sums + 2 * i * g.width + x;
        add_compensated(hi, hi + g.width, F::load(from + 2 * i * kPlane + x));
        (F::load(hi + g.width) + F::load(from + (2 * i + 1) * kPlane + x)).store(hi + g.width);
      }
    }
  }
}

template <class F, int kDegree>
void weigh_strip(const ColourTerm& term, int strip) noexcept {
  const ColourGrid& g = term.grid;
  const std::size_t row_bytes = 4 * static_cast<std::size_t>(g.width) * sizeof(float);
  const int begin = strip * g.strip_rows;
  const int end = begin + g.strip_rows < g.shape.height ? begin + g.strip_rows : g.shape.height;
  for (int y = begin; y < end; ++y) std::memset(term.sums_row(strip, y), 0, row_bytes);
  for (int i = 0; i < g.ry; ++i) std::memset(term.sums_row(strip, (strip + 1) * g.strip_rows + i), 0, row_bytes);
  float* own = term.scratch.data() + static_cast<std::size_t>(strip) * (kOwnSums + g.skew_elements());
  float* skew = own + kOwnSums;
  for (int y = begin; y < end; y += g.band_rows) {
    const int rows = y + g.band_rows < end ? g.band_rows : end - y;
    for (int x = 0; x < g.width; x += kColourTilePx) weigh_tile<F, kDegree>(term, strip, x, y, rows, own, skew);
  }
}

}  // namespace depth_detail
}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_DEPTH_CROSS_BILATERAL_COLOUR_HPP
