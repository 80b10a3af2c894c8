// SPDX-License-Identifier: Apache-2.0
// The inner loop of the cross-bilateral filter's colour term: weights of pairs of pixels, and the sums of both sides.
//
// A few rows of neighbouring p meet one row of q at every offset dx. What a pair gives to p stays in registers for a
// chunk of offsets; what it gives to q is added to one of 16 rows of sums, by dx mod 16, at an aligned place.
// Error of a weight 2^-(s + c), s by distance and c by colour, relative: of the power kExp2Error[degree], and
// (4 s + 7 c) 2^-24 ln 2. Colours are subtracted before anything is scaled, so that it does not grow with their size.
// The scaled form takes colours as root_scale c + minus_centre and saves one multiplication in ten; it adds
// (2 r c + 4 u sqrt(c)) 2^-24 ln 2, where r 2^-24 is how far root_scale is off, and p's scaled colours are at most u
// from 0.
// Cost: 20 instructions per pair and batch, 10 of them fma (degree 4). No memory.
#ifndef NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_PAIRS_HPP
#define NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_PAIRS_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace cross_bilateral_detail {

inline constexpr int kChunkPx = 16;   // columns of a block, offsets of a chunk; no batch is wider
inline constexpr int kGroupRows = 4;  // rows of a block
inline constexpr int kColourTilePx = 64;
inline constexpr int kColourBandRows = 16;  // rows of p that a row of q meets before its sums are added up
inline constexpr int kMinDegree = 2, kMaxDegree = 5;
inline constexpr double kExp2Error[6] = {1, 1, 1.73e-3, 7.5e-5, 2.7e-6, 3e-7};  // by degree

}  // namespace cross_bilateral_detail

namespace depth_detail {

using namespace cross_bilateral_detail;

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

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_PAIRS_HPP
