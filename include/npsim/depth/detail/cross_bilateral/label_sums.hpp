// SPDX-License-Identifier: Apache-2.0
// The sums of the label term over one axis: of mirrored samples, of runs of members, and the transposition between the
// axes.
//
// Samples lie in rows of 16; a sum goes across rows, lanes are columns.
// mirrored_sums: one addition and one product per two samples and a load per four, from a window that slides through
// registers. Error: see label_sum_roundings(). The bits do not depend on lanes.
#ifndef NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_LABEL_SUMS_HPP
#define NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_LABEL_SUMS_HPP

#include <cstdint>
#include <utility>

#include "npsim/core/bits.hpp"
#include "npsim/depth/detail/cross_bilateral/label_grid.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/double.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

using namespace cross_bilateral_detail;

inline constexpr std::size_t kRunLength = kLabelRun;
inline constexpr std::size_t kRowLength = kLabelChunkPx;

// Rows that are summed at a time: what registers hold.
template <class V>
inline constexpr std::size_t kSumRows = simd::F32::lanes == 16 ? 8 : 4;

// Distance kStep of a run for rows 0..N-1. Row i has its lower mirror image in lower[(i - kStep) % N], its upper one in
// upper[(i + kStep) % N]; the two that are done make room for those of the next distance.
template <std::size_t kStep, class V, std::size_t N, class T, std::size_t... kRow>
NPSIM_ALWAYS_INLINE void add_distance(const T* above, const T* below, V weight, V (&lower)[N], V (&upper)[N],
                                      V (&sum)[N], std::index_sequence<kRow...>) noexcept {
  static_assert(kRunLength % N == 0);
  ((sum[kRow] = fma(weight, lower[(kRow + kRunLength - kStep) % N] + upper[(kRow + kStep) % N], sum[kRow])), ...);
  upper[kStep % N] = V::load(above + kStep * kRowLength);
  lower[(kRunLength - 1 - kStep) % N] = V::load(below - kStep * kRowLength);
}

template <class V, std::size_t N, class T, class W, std::size_t... kStep>
NPSIM_ALWAYS_INLINE void add_run(const T* above, const T* below, const W* weights, V (&lower)[N], V (&upper)[N],
                                 V (&sum)[N], std::index_sequence<kStep...>) noexcept {
  (add_distance<kStep>(above, below, V(weights[kStep]), lower, upper, sum, std::make_index_sequence<N>()), ...);
}

// N rows from `first` on. Rows first - 8 runs .. first + N - 1 + 8 runs are read. Floats are added up run by run.
// kLast: distances of the last run.
template <std::size_t kLast, class V, std::size_t N, class T, class W>
NPSIM_ALWAYS_INLINE void mirrored_sums(const T* first, const W* halved, int runs, V (&sum)[N]) noexcept {
  V lower[N];
  V upper[N];
  for (std::size_t i = 0; i < N; ++i) {
    lower[i] = upper[i] = V::load(first + i * kRowLength);
    sum[i] = V(W(0));
  }
  const auto add = [&](int run, auto steps) {
    const T* above = first + static_cast<int>(N) * kLabelChunkPx + run * (kLabelRun * kLabelChunkPx);
    const T* below = first - kLabelChunkPx - run * (kLabelRun * kLabelChunkPx);
    const W* weights = halved + kLabelRun * run;
    if constexpr (sizeof(W) == sizeof(double)) {
      add_run(above, below, weights, lower, upper, sum, steps);
    } else {
      V part[N];
      for (std::size_t i = 0; i < N; ++i) part[i] = V(W(0));
      add_run(above, below, weights, lower, upper, part, steps);
      for (std::size_t i = 0; i < N; ++i) sum[i] = sum[i] + part[i];
    }
  };
  for (int run = 0; run + 1 < runs; ++run) add(run, std::make_index_sequence<kRunLength>());
  add(runs - 1, std::make_index_sequence<kLast>());
}

// Sixteen rows from `first` on to a block, 16x16. Where the last distance has no weight it is left out.
template <class V, class T, class W, class Out>
void sum_block(const T* first, const W* halved, int runs, Out* out) noexcept {
  const bool whole = halved[kLabelRun * runs - 1] > W(0);
  constexpr std::size_t kRows = kSumRows<V>;
  for (std::size_t row = 0; row < kLabelGroupRows; row += kRows) {
    for (int x = 0; x < kLabelChunkPx; x += V::lanes) {
      V sum[kRows];
      const T* at = first + row * kRowLength + x;
      if (whole) {
        mirrored_sums<kRunLength>(at, halved, runs, sum);
      } else {
        mirrored_sums<kRunLength - 1>(at, halved, runs, sum);
      }
      for (std::size_t i = 0; i < kRows; ++i) sum[i].store(out + (row + i) * kRowLength + x);
    }
  }
}

// A block by columns. As many registers as lanes, interleaved log2 of that number times, are transposed: each time the
// bits of row and column together turn by one.
template <class F>
void transpose_block(const float* in, float* out) noexcept {
  constexpr int kLanes = F::lanes;
  constexpr auto kRegisters = static_cast<std::size_t>(kLanes);
  for (int y = 0; y < kLabelChunkPx; y += kLanes) {
    for (int x = 0; x < kLabelChunkPx; x += kLanes) {
      F v[kRegisters];
      for (int i = 0; i < kLanes; ++i) v[i] = F::load(in + (y + i) * kLabelChunkPx + x);
      for (int done = 1; done < kLanes; done *= 2) {
        F w[kRegisters];
        for (int i = 0; i < kLanes / 2; ++i) {
          w[2 * i] = interleave_low(v[i], v[i + kLanes / 2]);
          w[2 * i + 1] = interleave_high(v[i], v[i + kLanes / 2]);
        }
        for (int i = 0; i < kLanes; ++i) v[i] = w[i];
      }
      for (int i = 0; i < kLanes; ++i) v[i].store(out + (x + i) * kLabelChunkPx + y);
    }
  }
}

// Weights along a row, seen from the 16 pixels of a chunk. members: one word per chunk, a bit for each member; read
// from `halo` chunks before to `halo` after.
template <class F>
void sum_members(const LabelWeights& w, int halo, const std::int32_t* members, double* out) noexcept {
  using D = simd::Double<F>;
  constexpr int kParts = kLabelChunkPx / D::lanes;
  D sum[static_cast<std::size_t>(kParts)];
  for (D& part : sum) part = D(0.0);
  std::uint64_t open = 0;  // 1: a run goes on; then the sum has the other sign
  for (int first = -halo; first <= halo; first += 4) {
    std::uint64_t word = 0;
    for (int i = 0; i < 4 && first + i <= halo; ++i) {
      word |= static_cast<std::uint64_t>(static_cast<std::uint32_t>(members[first + i]))
              << static_cast<unsigned>(16 * i);
    }
    for (std::uint64_t ends = word ^ (word << 1U | open); ends != 0; ends &= ends - 1) {
      const double* edge = w.edge(-first * kLabelChunkPx - lowest_set_bit(ends));
      for (int p = 0; p < kParts; ++p) {
        D& part = sum[static_cast<std::size_t>(p)];
        part = D::load(edge + p * D::lanes) - part;
      }
      open ^= 1U;
    }
  }
  const D sign(open != 0 ? -1.0 : 1.0);
  const auto own = static_cast<std::uint32_t>(members[0]);
  alignas(64) float centre[kRowLength];
  for (int i = 0; i < kLabelChunkPx; i += F::lanes) {
    select(F::MaskType::from_bits(own >> static_cast<unsigned>(i)), F(1.0F), F(0.0F)).store(centre + i);
  }
  for (int p = 0; p < kParts; ++p) {
    const D total = D(w.total) * D::load(centre + p * D::lanes);
    fma(sign, sum[static_cast<std::size_t>(p)], total).store(out + p * D::lanes);
  }
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_LABEL_SUMS_HPP
