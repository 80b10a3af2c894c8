// SPDX-License-Identifier: Apache-2.0
// The colour term of the dual-reference cross-bilateral filter (3.2): for every pixel p the sums
//   sum_q w z(q)  and  sum_q w,   w = Gs(|q - p|) Gc(|J(q) - J(p)|),  over all q != p of the window.
//
// Pairs. w is symmetric, so a pair of pixels is weighed once and counts for both: for q in the rows at and below p.
// Lanes are neighbouring p; four rows of p meet one row of q at every offset dx and share its loads. What a pair gives
// to p stays in registers for a chunk of offsets; what it gives to q goes to one of 16 rows of sums, by dx mod 16, so
// that it is stored where it was loaded from, aligned; those are added up once per row of q. Sums go from one level to
// the next in at most kChunkPx additions, the last level is compensated, and rows below a strip have their own sums, so
// that strips run in parallel and the bits depend on neither threads nor lanes.
// Blocks of 16x4 pixels: the box of their colours, their depths and sums are known. Pairs of blocks of which it follows
// that they cannot matter are left out: together they add at most `prune_error` to either sum of the filter.
//
// Error of a weight 2^-(s + c), s by distance and c by colour, relative: of the power kExp2Error[degree], and (4 s + 7
// c) 2^-24 ln 2. Colours are subtracted before anything is scaled, so that it does not grow with their size. The scaled
// form takes colours as root_scale c + minus_centre and saves one multiplication in ten; it adds (2 r c + 4 u sqrt(c))
// 2^-24 ln 2, where r 2^-24 is how far root_scale is off, and p's scaled colours are at most u from 0. It is taken
// where the colours of a block are near each other and the plan has error left for it.
// Error of the sums: 2^-24 per term of the longest chain, see colour_chain().
// Cost: (2R + 1)^2 / 2 pairs per pixel, each 20 instructions per batch, 10 of them fma (degree 4); one test of blocks
// per pixel at R = 30. Memory: see grids.hpp.
#ifndef NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_COLOUR_HPP
#define NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_COLOUR_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/depth/detail/cross_bilateral/grids.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/fixed.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace cross_bilateral_detail {

// hi + lo += x, nearly exactly.
template <class F>
void add_compensated(float* hi, float* lo, F x) noexcept {
  const simd::Pair<F> sum = simd::two_sum(F::load(hi), x);
  sum.hi.store(hi);
  (F::load(lo) + sum.lo).store(lo);
}

// 2^x within kExp2Error: relative minimax polynomials on [0, 1].
template <int kDegree, class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE F fast_exp2(F x) noexcept {
  const F r = x - floor(x);
  if constexpr (kDegree == 2) {
    return scale_by_floor(fma(fma(F(0x1.594830p-2F), r, F(0x1.50b5b4p-1F)), r, F(0x1.007108p+0F)), x);
  } else if constexpr (kDegree == 3) {
    const F p = fma(F(0x1.3f96a4p-4F), r, F(0x1.cefc4cp-3F));
    return scale_by_floor(fma(fma(p, r, F(0x1.64444cp-1F)), r, F(0x1.fff632p-1F)), x);
  } else if constexpr (kDegree == 4) {
    const F p = fma(fma(F(0x1.bb7cd4p-7F), r, F(0x1.aa13f0p-5F)), r, F(0x1.ee798ap-3F));
    return scale_by_floor(fma(fma(p, r, F(0x1.62d166p-1F)), r, F(0x1.00002cp+0F)), x);
  } else {
    const F p = fma(fma(F(0x1.ec320ap-10F), r, F(0x1.26900cp-7F)), r, F(0x1.c95446p-5F));
    return scale_by_floor(fma(fma(fma(p, r, F(0x1.ebd5a8p-3F)), r, F(0x1.62e4f6p-1F)), r, F(0x1.fffffep-1F)), x);
  }
}

template <std::size_t N, class Function>
NPSIM_ALWAYS_INLINE void unrolled(Function&& f) noexcept {
  if constexpr (N > 0) f(std::size_t{0});
  if constexpr (N > 1) f(std::size_t{1});
  if constexpr (N > 2) f(std::size_t{2});
  if constexpr (N > 3) f(std::size_t{3});
  static_assert(N <= std::size_t{kGroupRows});
}

// One batch of columns of N rows of p against one row of q. Pointers are to the first column of p: in the row of q, in
// the first row of p, in the first row's sums.
struct PairRows {
  const float *pl, *pa, *pb, *pz;
  const float *ql, *qa, *qb, *qz;
  const float* spatial;  // of the first row of p at dx = 0; the next row's lies spatial_stride before
  float* skew;           // at dx = 0 and k = 0: sum w z; sum w lies skew_stride behind
  float* own;
  std::ptrdiff_t stride, spatial_stride, skew_stride;
  float minus_scale;
  float root_scale, minus_centre[3];  // for scaled colours; those of q are scaled already
  int rx, first_chunk, end_chunk;
  std::uint32_t work, holes;  // by chunk, from first_chunk
};

// All offsets of the chunks first_chunk .. end_chunk - 1. Three offsets are under way at a time: the exponents of one,
// the weights of the one before, the sums of the one before that. So nothing waits for what has just begun, and the few
// instructions that a core looks ahead suffice. What runs ahead at the end is not used.
template <class F, std::size_t N, int kDegree, bool kScaled, bool kHoles>
NPSIM_ALWAYS_INLINE void weigh_chunks(const PairRows& s, int first_chunk, int end_chunk, const F (&lp)[N],
                                      const F (&ap)[N], const F (&bp)[N], const F (&zp)[N], F (&num)[N],
                                      F (&den)[N]) noexcept {
  const F zero(0.0F);
  const F one(1.0F);
  const F minus_scale(s.minus_scale);
  const float* spatial[N];
  unrolled<N>([&](std::size_t i) { spatial[i] = s.spatial - static_cast<std::ptrdiff_t>(i) * s.spatial_stride; });
  const auto exponent = [&](std::size_t i, F lq, F aq, F bq, int dx) {
    const F dl = lq - lp[i];
    const F da = aq - ap[i];
    const F db = bq - bp[i];
    if constexpr (kScaled) {
      return fnma(db, db, fnma(da, da, fnma(dl, dl, F(spatial[i][dx]))));
    } else {
      return fma(fma(db, db, fma(da, da, dl * dl)), minus_scale, F(spatial[i][dx]));
    }
  };
  const auto exponents = [&](F(&x)[N], int dx) {
    const F lq = F::load(s.ql + dx);
    const F aq = F::load(s.qa + dx);
    const F bq = F::load(s.qb + dx);
    unrolled<N>([&](std::size_t i) { x[i] = exponent(i, lq, aq, bq, dx); });
  };
  int dx = first_chunk * kChunkPx > -s.rx ? first_chunk * kChunkPx : -s.rx;
  const int end = end_chunk * kChunkPx - 1 < s.rx ? end_chunk * kChunkPx : s.rx + 1;
  F x[N], w[N];  // of dx + 1, of dx
  exponents(x, dx);
  unrolled<N>([&](std::size_t i) { w[i] = fast_exp2<kDegree>(x[i]); });
  exponents(x, dx + 1);
  for (int chunk = first_chunk; chunk < end_chunk; ++chunk) {
    const int stop = (chunk + 1) * kChunkPx < end ? (chunk + 1) * kChunkPx : end;
    F n[N], d[N];
    unrolled<N>([&](std::size_t i) { n[i] = d[i] = zero; });
    float* skew = s.skew + 2 * (dx - chunk * kChunkPx) * s.skew_stride + chunk * kChunkPx;
    for (; dx < stop; ++dx, skew += 2 * s.skew_stride) {
      const F zq = F::load(s.qz + dx);
      const F lq = F::load(s.ql + dx + 2);
      const F aq = F::load(s.qa + dx + 2);
      const F bq = F::load(s.qb + dx + 2);
      F to_n, to_d, keep[N];
      unrolled<N>([&](std::size_t i) {
        const F next = fast_exp2<kDegree>(x[i]);
        x[i] = exponent(i, lq, aq, bq, dx + 2);
        n[i] = fma(w[i], zq, n[i]);
        if constexpr (kHoles) {
          d[i] = fma(w[i], select(zq > zero, one, zero), d[i]);
          keep[i] = select(zp[i] > zero, w[i], zero);
        } else {
          d[i] = d[i] + w[i];
          keep[i] = w[i];
        }
        to_n = i == 0 ? w[i] * zp[i] : fma(w[i], zp[i], to_n);
        to_d = i == 0 ? keep[i] : to_d + keep[i];
        w[i] = next;
      });
      (F::load(skew) + to_n).store(skew);
      (F::load(skew + s.skew_stride) + to_d).store(skew + s.skew_stride);
    }
    unrolled<N>([&](std::size_t i) {
      num[i] = num[i] + n[i];
      den[i] = den[i] + d[i];
    });
  }
}

template <class F, std::size_t N, int kDegree, bool kScaled>
void weigh_rows(const PairRows& s) noexcept {
  F lp[N], ap[N], bp[N], zp[N], num[N], den[N];
  unrolled<N>([&](std::size_t i) {
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(i) * s.stride;
    lp[i] = F::load(s.pl + at);
    ap[i] = F::load(s.pa + at);
    bp[i] = F::load(s.pb + at);
    zp[i] = F::load(s.pz + at);
    num[i] = den[i] = F(0.0F);
    if constexpr (kScaled) {
      lp[i] = fma(lp[i], F(s.root_scale), F(s.minus_centre[0]));
      ap[i] = fma(ap[i], F(s.root_scale), F(s.minus_centre[1]));
      bp[i] = fma(bp[i], F(s.root_scale), F(s.minus_centre[2]));
    }
  });
  const auto at = [&](std::uint32_t bits, int chunk) {
    return chunk < s.end_chunk && (bits >> static_cast<unsigned>(chunk - s.first_chunk) & 1U) != 0;
  };
  for (int chunk = s.first_chunk; chunk < s.end_chunk;) {
    int end = chunk + 1;
    if (at(s.work, chunk)) {
      const bool holes = !kScaled && at(s.holes, chunk);
      while (at(s.work, end) && (kScaled || at(s.holes, end) == holes)) ++end;
      if (holes) {
        weigh_chunks<F, N, kDegree, false, !kScaled>(s, chunk, end, lp, ap, bp, zp, num, den);
      } else {
        weigh_chunks<F, N, kDegree, kScaled, false>(s, chunk, end, lp, ap, bp, zp, num, den);
      }
    }
    chunk = end;
  }
  constexpr std::ptrdiff_t kPlane = kColourBandRows * kColourTilePx;
  unrolled<N>([&](std::size_t i) {
    float* own = s.own + i * std::size_t{kColourTilePx};
    add_compensated(own, own + kPlane, num[i]);
    add_compensated(own + 2 * kPlane, own + 3 * kPlane, den[i]);
  });
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

// The colours of row qy that a block of p at column x0 meets in a sweep, scaled about the middle of p's block column.
template <class F>
NPSIM_ALWAYS_INLINE void scale_row(const ColourTerm& term, const ScaledColours& scaled, int x0, int qy, int chunks,
                                   float (&out)[3][kScaledColumns]) noexcept {
  const ImageView<float>* const colours[3] = {&term.samples.l, &term.samples.a, &term.samples.b};
  const int count = (chunks + 1) * kChunkPx + F::lanes;
  for (int c = 0; c < 3; ++c) {
    const float* from = colours[c]->data() + qy * static_cast<std::ptrdiff_t>(term.grid.sample_stride) + x0;
    for (int x = 0; x < count; x += F::lanes) {
      fma(F::load(from + x), F(term.root_scale), F(scaled.minus_centre[c])).store(out[c] + x);
    }
  }
}

// The columns from x on of the row p_row against those of q_row; sums and chunks are the caller's.
NPSIM_ALWAYS_INLINE PairRows pair_rows(const ColourTerm& term, const ScaledColours& scaled, int x, int p_row,
                                       int q_row) noexcept {
  const auto stride = static_cast<std::ptrdiff_t>(term.grid.sample_stride);
  const auto spatial_stride = static_cast<std::ptrdiff_t>(2 * term.grid.rx + 1);
  const std::ptrdiff_t p_at = p_row * stride + x;
  const std::ptrdiff_t q_at = q_row * stride + x;
  PairRows s;
  s.pl = term.samples.l.data() + p_at;
  s.pa = term.samples.a.data() + p_at;
  s.pb = term.samples.b.data() + p_at;
  s.pz = term.samples.depth.data() + p_at;
  s.ql = term.samples.l.data() + q_at;
  s.qa = term.samples.a.data() + q_at;
  s.qb = term.samples.b.data() + q_at;
  s.qz = term.samples.depth.data() + q_at;
  s.spatial = term.spatial.data() + (q_row - p_row) * spatial_stride + term.grid.rx;
  s.stride = stride;
  s.spatial_stride = spatial_stride;
  s.skew_stride = term.grid.skew_stride;
  s.minus_scale = -term.scale;
  s.root_scale = term.root_scale;
  for (int c = 0; c < 3; ++c) s.minus_centre[c] = scaled.minus_centre[c];
  s.rx = term.grid.rx;
  return s;
}

// What the pixels of a tile have received from pairs with themselves as p, to the image's sums.
template <class F>
void collect_own(const ColourTerm& term, int strip, int x0, int y0, int rows, const float* own) noexcept {
  constexpr std::ptrdiff_t kPlane = kColourBandRows * kColourTilePx;
  const int width = term.grid.width;
  for (int row = 0; row < rows; ++row) {
    float* sums = term.sums_row(strip, y0 + row) + x0;
    const float* from = own + row * kColourTilePx;
    for (int x = 0; x < kColourTilePx; x += F::lanes) {
      for (int i = 0; i < 2; ++i) {
        float* hi = sums + 2 * i * width + x;
        add_compensated(hi, hi + width, F::load(from + 2 * i * kPlane + x));
        (F::load(hi + width) + F::load(from + (2 * i + 1) * kPlane + x)).store(hi + width);
      }
    }
  }
}

// All pairs whose upper (or left) pixel p lies in this tile of a band.
template <class F, int kDegree>
void weigh_tile(const ColourTerm& term, int strip, int x0, int y0, int rows, float* own, float* skew) noexcept {
  const ColourGrid& g = term.grid;
  const int groups = round_up(rows, kGroupRows) / kGroupRows;
  const int q_end = y0 + rows + g.ry < g.shape.height ? y0 + rows + g.ry : g.shape.height;
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
            scale_row<F>(term, scaled[i], block_x + sweep * kChunkPx, qy, sweep_end - sweep, scaled_q);
            q_is_scaled = true;
          }
          // In their own row p meets only what lies to its right.
          const int chunks_left = sweep < 0 && qy - p0 < end ? -sweep : 0;
          const std::uint32_t left =
              (1U << static_cast<unsigned>(chunks_left < kMaxChunks ? chunks_left : kMaxChunks)) - 1U;
          for (int x = block_x; x < block_x + kChunkPx; x += F::lanes) {
            PairRows s = pair_rows(term, scaled[i], x, p0 + first_row, qy);
            s.skew = skew + kChunkPx + (x - x0) - sweep * kChunkPx;
            s.own = own + (group * kGroupRows + first_row) * kColourTilePx + (x - x0);
            s.first_chunk = sweep;
            s.end_chunk = sweep_end;
            s.holes = todo[group][i].holes;
            weigh_some_rows<F, kDegree, false>(s, work & left & ~scaled_work, n - 1);
            weigh_some_rows<F, kDegree, false>(s, work & ~left & ~scaled_work, n);
            if (scaled_work == 0) continue;
            const int in_block = x - block_x - sweep * kChunkPx;
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
  collect_own<F>(term, strip, x0, y0, rows, own);
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

}  // namespace cross_bilateral_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_COLOUR_HPP
