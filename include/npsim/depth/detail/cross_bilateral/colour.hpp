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
// colour_chain(); pairs of blocks that cannot matter are left out, see cross_bilateral_blocks.hpp. Where the colours of
// a block are near each other, and a bound on the error says that it may, pairs take the scaled form.
// Cost: that of the pairs, (2R + 1)^2 / 2 per pixel. Memory: 32 bytes per pixel, 16 for each of the rows below
// a strip, and the scratch of a strip.
#ifndef NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_COLOUR_HPP
#define NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_COLOUR_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/cross_bilateral/blocks.hpp"
#include "npsim/depth/detail/cross_bilateral/pairs.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/fixed.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace cross_bilateral_detail {

// The longest chain of additions that leads from a weight to its sum.
[[nodiscard]] inline int colour_chain(const ColourGrid& g) noexcept {
  const int of_p = kChunkPx + g.sweep_chunks;
  const int of_q = kGroupRows + g.band_rows / kGroupRows * g.sweep_chunks + 4;
  return (of_p > of_q ? of_p : of_q) + 6;  // compensated additions, strip and strip, the pixel itself
}

inline constexpr std::size_t kOwnSums = 4 * kColourBandRows * kColourTilePx;  // of p in a tile

}  // namespace cross_bilateral_detail

namespace depth_detail {

using namespace cross_bilateral_detail;

struct ColourTerm {
  ColourGrid grid;
  ColourSamples samples;
  ColourBlocks blocks;
  Span<float> spatial;   // log2 Gs by dy and dx; what belongs to the other pixel of the pair is -1e30
  Span<float> sums;      // rows of 4 x grid.width: sum w z and its rest, sum w and its rest; strips' tails follow
  Span<float> scratch;   // by strip
  float scale = 0;       // of a squared colour distance, in powers of two
  float root_scale = 0;  // of a colour
  float near = -1;       // blocks whose scaled colours are that near to the middle of their column take that form
  PruneRule prune;

  [[nodiscard]] float* sums_row(int strip, int y) const noexcept {
    const int end = (strip + 1) * grid.strip_rows;
    const int row = y < end ? y : grid.shape.height + strip * grid.ry + (y - end);
    return sums.data() + static_cast<std::size_t>(row) * 4 * static_cast<std::size_t>(grid.width);
  }
};

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

// The middle of the colours of a block column of a band, scaled, and which of its blocks lie near enough to it.
struct ScaledColours {
  float minus_centre[3];
  bool near[kColourBandRows / kGroupRows];
};

[[nodiscard]] inline ScaledColours scaled_colours(const ColourTerm& term, int column, int first_row,
                                                  int groups) noexcept {
  ScaledColours out{};
  double squared[kColourBandRows / kGroupRows] = {};  // exact enough where colours are large beside sigma_c
  for (int i = 0; i < 3; ++i) {
    float low = 0;
    float high = 0;
    bool any = false;
    for (int group = 0; group < groups; ++group) {
      if (*term.blocks.at(kBlockAny, column, first_row + group) == 0.0F) continue;
      const float block_low = *term.blocks.at(kBlockLow + i, column, first_row + group);
      const float block_high = *term.blocks.at(kBlockHigh + i, column, first_row + group);
      low = any && low < block_low ? low : block_low;
      high = any && high > block_high ? high : block_high;
      any = true;
    }
    const float centre = (0.5F * low + 0.5F * high) * term.root_scale;
    out.minus_centre[i] = -centre;
    for (int group = 0; group < groups; ++group) {
      const auto from_centre = [&](int plane) {
        const float colour = *term.blocks.at(plane + i, column, first_row + group);
        return static_cast<double>(colour) * static_cast<double>(term.root_scale) - static_cast<double>(centre);
      };
      const double above = from_centre(kBlockHigh);
      const double below = -from_centre(kBlockLow);
      const double farthest = above > below ? above : below;
      squared[group] += farthest * farthest;
    }
  }
  for (int group = 0; group < groups; ++group) {
    const double near = static_cast<double>(term.near);
    out.near[group] = near > 0 && squared[group] <= near * near;
  }
  return out;
}

// What a tile reads of the next row of q, and adds to of this one.
inline void prefetch_rows(const ColourTerm& term, int strip, int first_column, int columns, int qy) noexcept {
  constexpr int kLineFloats = 16;
  const ColourSamples& s = term.samples;
  const int next = qy + 1 < term.grid.shape.height ? qy + 1 : qy;
  const int last = first_column + columns;
  for (int x = first_column; x < last; x += kLineFloats) {
    simd::prefetch(s.l.row(next) + x);
    simd::prefetch(s.a.row(next) + x);
    simd::prefetch(s.b.row(next) + x);
    simd::prefetch(s.depth.row(next) + x);
  }
  const float* sums = term.sums_row(strip, qy);
  for (int x = first_column > 0 ? first_column : 0; x < last && x < term.grid.width; x += kLineFloats) {
    for (int i = 0; i < 4; ++i) simd::prefetch(sums + i * term.grid.width + x);
  }
}

template <class F, int kDegree, bool kScaled>
void weigh_some_rows(PairRows& s, std::uint32_t work, int n) noexcept {
  if (work == 0) return;
  s.work = work;
  if (n == 4) weigh_rows<F, 4, kDegree, kScaled>(s);
  if (n == 3) weigh_rows<F, 3, kDegree, kScaled>(s);
  if (n == 2) weigh_rows<F, 2, kDegree, kScaled>(s);
  if (n == 1) weigh_rows<F, 1, kDegree, kScaled>(s);
}

// All pairs whose upper (or left) pixel p lies in this tile of a band.
template <class F, int kDegree>
void weigh_tile(const ColourTerm& term, int strip, int x0, int y0, int rows, float* own, float* skew) noexcept {
  const ColourGrid& g = term.grid;
  const auto stride = static_cast<std::ptrdiff_t>(g.sample_stride);
  const auto spatial_stride = static_cast<std::ptrdiff_t>(2 * g.rx + 1);
  const int groups = round_up(rows, kGroupRows) / kGroupRows;
  const int q_end = y0 + rows + g.ry < g.shape.height ? y0 + rows + g.ry : g.shape.height;
  const ImageView<float>* const colours[3] = {&term.samples.l, &term.samples.a, &term.samples.b};
  ScaledColours scaled[kTileBlocks];
  for (int i = 0; i < kTileBlocks; ++i) {
    scaled[i] = scaled_colours(term, x0 / kChunkPx + i, y0 / kGroupRows, groups);
  }
  alignas(64) float scaled_q[3][kScaledColumns];
  std::memset(own, 0, kOwnSums * sizeof(float));
  for (int sweep = g.first_chunk; sweep < g.end_chunk; sweep += g.sweep_chunks) {
    const int sweep_end = sweep + g.sweep_chunks < g.end_chunk ? sweep + g.sweep_chunks : g.end_chunk;
    BlockWork todo[kColourBandRows / kGroupRows][kTileBlocks] = {};
    for (int qy = y0; qy < q_end; ++qy) {
      for (int group = 0; qy % kGroupRows == 0 && group < groups; ++group) {  // y0 is a multiple too
        for (int i = 0; i < kTileBlocks; ++i) {
          todo[group][i] = find_work<F>(term.blocks, term.prune, x0 / kChunkPx + i, y0 / kGroupRows + group,
                                        qy / kGroupRows, sweep, sweep_end);
        }
      }
      prefetch_rows(term, strip, x0 + sweep * kChunkPx, (sweep_end - sweep + kTileBlocks) * kChunkPx, qy);
      bool touched = false;
      for (int i = 0; i < kTileBlocks; ++i) {
        const int block_x = x0 + i * kChunkPx;
        bool q_is_scaled = false;
        for (int group = 0; group < groups; ++group) {
          const int p0 = y0 + group * kGroupRows;
          const int end = (group + 1) * kGroupRows < rows ? kGroupRows : rows - group * kGroupRows;
          const int first_row = qy - g.ry > p0 ? qy - g.ry - p0 : 0;
          const int n = (qy - p0 + 1 < end ? qy - p0 + 1 : end) - first_row;
          const std::uint32_t work = todo[group][i].work;
          if (n <= 0 || work == 0) continue;
          if (!touched) std::memset(skew, 0, g.skew_elements() * sizeof(float));
          touched = true;
          // A pixel without depth may have little weight, and with it no error to spare.
          const std::uint32_t scaled_work = scaled[i].near[group] ? work & ~todo[group][i].holes : 0U;
          if (scaled_work != 0 && !q_is_scaled) {
            const int count = (sweep_end - sweep + 1) * kChunkPx + F::lanes;
            for (int c = 0; c < 3; ++c) {
              const float* from = colours[c]->data() + qy * stride + block_x + sweep * kChunkPx;
              for (int x = 0; x < count; x += F::lanes) {
                fma(F::load(from + x), F(term.root_scale), F(scaled[i].minus_centre[c])).store(scaled_q[c] + x);
              }
            }
            q_is_scaled = true;
          }
          // In their own row p meets only what lies to its right.
          const int chunks_left = sweep < 0 && qy - p0 < end ? -sweep : 0;
          const std::uint32_t left =
              (1U << static_cast<unsigned>(chunks_left < kMaxChunks ? chunks_left : kMaxChunks)) - 1U;
          for (int x = block_x; x < block_x + kChunkPx; x += F::lanes) {
            const std::ptrdiff_t p_at = (p0 + first_row) * stride + x;
            const std::ptrdiff_t q_at = qy * stride + x;
            const int in_block = x - block_x - sweep * kChunkPx;
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
            s.root_scale = term.root_scale;
            for (int c = 0; c < 3; ++c) s.minus_centre[c] = scaled[i].minus_centre[c];
            s.rx = g.rx;
            s.first_chunk = sweep;
            s.end_chunk = sweep_end;
            s.holes = todo[group][i].holes;
            weigh_some_rows<F, kDegree, false>(s, work & left & ~scaled_work, n - 1);
            weigh_some_rows<F, kDegree, false>(s, work & ~left & ~scaled_work, n);
            if (scaled_work == 0) continue;
            s.ql = scaled_q[0] + in_block;
            s.qa = scaled_q[1] + in_block;
            s.qb = scaled_q[2] + in_block;
            weigh_some_rows<F, kDegree, true>(s, scaled_work & left, n - 1);
            weigh_some_rows<F, kDegree, true>(s, scaled_work & ~left, n);
          }
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
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_COLOUR_HPP
