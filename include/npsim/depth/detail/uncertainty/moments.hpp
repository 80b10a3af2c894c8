// SPDX-License-Identifier: Apache-2.0
// Variance of windows of 8 x 8 pixels by merging, in single precision, with a bound on its error. Part of
// uncertainty.hpp.
//
// Mean and sum of squares of 1, 2, 4 .. 64 pixels come from merging equal halves (Chan, Golub and LeVeque 1979): the
// squares of two halves add up and gain a multiple of the squared difference of the means. Nothing large is ever
// subtracted from anything large, so at any depth the standard deviation is known to within
//     |sigma' - sigma| <= 16 u D + 16 u sigma,  u = 2^-24,
// where D is the difference of the greatest and the least depth read; for what is merged is z - c, where c is one of
// these depths. Derivation: the means after 0 .. 5 merges are off by at most 1, 2.5, 3.5, 5, 6, 7.5 u D; as
// contributions to the sum of squares these are orthogonal directions, whose lengths add as squares, sqrt(136.75)
// = 11.7; the roundings of the sums come to 7 u sigma (10 without a fused fma); the rest is slack. A variance whose
// standard deviation lies further than that from the threshold's is decided; the others are in doubt.
//
// Cost: about 2 instructions of a register's width per register of windows and level of merging, 12 with loads and
// stores. Memory: 30 KiB of stack.
#ifndef NPSIM_DEPTH_DETAIL_UNCERTAINTY_MOMENTS_HPP
#define NPSIM_DEPTH_DETAIL_UNCERTAINTY_MOMENTS_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/image_view.hpp"
#include "npsim/depth/detail/uncertainty/labels.hpp"
#include "npsim/simd/bytes.hpp"
#include "npsim/simd/fixed.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

// What is known about the windows of a row: certainly above the threshold, or certainly below; the others are in doubt.
struct VarianceBits {
  std::uint64_t above[kTileWords] = {};
  std::uint64_t below[kTileWords] = {};
};

// Sums of squares per pixel beyond which a variance is certainly above, or below, a threshold.
struct VarianceLimits {
  float above;
  float below;
};

// `error`: that of the standard deviation, relative both to the range and to itself. `units`: of a spread per variance.
[[nodiscard]] inline VarianceLimits variance_limits(double variance, double range, double error,
                                                    double units) noexcept {
  const double sigma = std::sqrt(variance);
  const double off = error * range;
  const double high = (sigma + off) * (1 + error);
  const double low = (sigma - off) * (1 - error);
  return {static_cast<float>(units * high * high * (1 + 0x1p-22)),
          low > 0 ? static_cast<float>(units * low * low * (1 - 0x1p-22)) : -1.0F};
}

// Can squares of depths up to z_max neither overflow nor lose, by underflow, what matters beside z_max?
[[nodiscard]] inline bool moments_are_safe(float z_max) noexcept { return z_max > 1e-8F && z_max < 1e15F; }

// Mean and sum of squared deviations of some pixels, in the units that the level of merging calls for: after two and
// after four levels the mean has become twice and four times the mean, and the spread is always twice the sum of
// squares. That way no level needs a factor of its own.
template <class F>
struct Moments {
  F mean;
  F spread;
};

template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE Moments<F> merge_to_mean(const Moments<F>& a, const Moments<F>& b) noexcept {
  const F apart = b.mean - a.mean;
  return {fma(apart, F(0.5F), a.mean), fma(apart, apart, a.spread + b.spread)};
}

template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE Moments<F> merge_to_sum(const Moments<F>& a, const Moments<F>& b) noexcept {
  const F apart = b.mean - a.mean;
  return {a.mean + b.mean, fma(apart * F(2.0F), apart, a.spread + b.spread)};
}

template <class F>
class MergedMoments {
 public:
  static constexpr int kWindow = 8;
  static constexpr std::size_t kRows = kBandRows<kWindow> + kWindow + 1;  // read in fours, the last beyond the block

  // Reads the columns of 8 pixels that the windows of `block` are made of, in those columns of windows that `wanted`
  // has a bit for, and asks for those of the next tile to the right if `next_is_wanted`. False if a depth is missing,
  // or so large or so small that squares might over- or underflow; then nothing else may be called.
  [[nodiscard]] bool read(ImageView<const float> depth, const WindowBlock& block,
                          const std::uint64_t (&wanted)[kTileWords], bool next_is_wanted) noexcept {
    ahead_ = next_is_wanted ? kTileWindows : 0;
    batches_ = (block.width + kWindow - 1 + F::lanes - 1) / F::lanes;
    Column column;
    bool begun = false;
    for (int c = 0; c < batches_; ++c) {
      if (!is_wanted(wanted, c)) continue;
      const int x = block.x + c * F::lanes;
      const float* p = depth.row(block.y) + x;
      if (!begun) column.centre = F(*p);
      begun = true;
      const int rows_below = depth.height() - 1 - block.y;
      if (depth.width() - x >= F::lanes) {
        read_down(
            column, [](const float* z) { return F::load(z); }, p, depth.stride(), rows_below, block.height, c);
      } else {
        // Lanes beyond the image repeat the first one: they change neither extreme.
        const int available = depth.width() - x;
        const auto load = [available](const float* z) {
          return select(F::MaskType::first(available), F::load(z, available), F(*z));
        };
        read_down(column, load, p, depth.stride(), rows_below, block.height, c);
      }
      if (!all((column.low > F(0.0F)) & simd::is_finite(column.check))) return false;
    }
    const float high = -simd::least_lane(-column.high);
    range_ = static_cast<double>(high) - static_cast<double>(simd::least_lane(column.low));
    return moments_are_safe(high);
  }

  // No variance exceeds a quarter of the squared range.
  [[nodiscard]] bool all_below(double variance) const noexcept {
    return 0.25 * range_ * range_ * (1 + 1e-9) <= variance;
  }

  // Sets the threshold that decide() compares with.
  void set_threshold(double variance) noexcept {
    limits_ = variance_limits(variance, range_, 16 * 0x1p-24, 2.0 * kWindow * kWindow);
  }

  // The windows first .. last of one row of the block that was read, 0 <= row < block.height.
  void decide(int row, int first, int last, VarianceBits& bits) const noexcept {
    const int begin = first / F::lanes;
    const int end = last / F::lanes + 1;
    const float* mean = mean_[row + kLead];
    const float* spread = spread_[row + kLead];
    const auto put = [&](int batch, F s) {
      const auto at = static_cast<unsigned>(batch * F::lanes);
      bits.above[at >> 6] |= std::uint64_t{simd_bits(s > F(limits_.above))} << (at & 63U);
      bits.below[at >> 6] |= std::uint64_t{simd_bits(s < F(limits_.below))} << (at & 63U);
    };
    if constexpr (F::lanes >= 4) {
      // A batch of results needs the batches of columns to its right; what lies beyond the last column reaches no
      // window that counts.
      const auto column = [&](int batch) {
        if (batch >= batches_) return Moments<F>{F(0.0F), F(0.0F)};
        return Moments<F>{F::load(mean + batch * F::lanes), F::load(spread + batch * F::lanes)};
      };
      const Moments<F> c0 = column(begin);
      const Moments<F> c1 = column(begin + 1);
      Moments<F> c2 = column(begin + 2);
      const Moments<F> first_pair = merge_to_sum(c0, ahead<1>(c0, c1));
      Moments<F> pair = merge_to_sum(c1, ahead<1>(c1, c2));
      Moments<F> quad = merge_to_mean(first_pair, ahead<2>(first_pair, pair));
      for (int i = begin; i < end; ++i) {
        const Moments<F> c3 = column(i + 3);
        const Moments<F> next_pair = merge_to_sum(c2, ahead<1>(c2, c3));
        const Moments<F> next_quad = merge_to_mean(pair, ahead<2>(pair, next_pair));
        put(i, merge_to_sum(quad, ahead<4>(quad, next_quad)).spread);
        c2 = c3;
        pair = next_pair;
        quad = next_quad;
      }
    } else {
      for (int i = begin; i < end; ++i) {
        const auto column = [&](int k) { return Moments<F>{F::load(mean + i + k), F::load(spread + i + k)}; };
        const auto pair = [&](int k) { return merge_to_sum(column(k), column(k + 1)); };
        const auto quad = [&](int k) { return merge_to_mean(pair(k), pair(k + 2)); };
        put(i, merge_to_sum(quad(0), quad(4)).spread);
      }
    }
  }

 private:
  static constexpr int kLead = 6;  // rows in which the first windows are not complete yet
  static constexpr std::size_t kColumns =
      (kTileWindows + kWindow - 1 + simd::kMaxLanes - 1) / simd::kMaxLanes * simd::kMaxLanes;

  // A column of pixels (lanes of columns) on its way down: what the next merges need.
  struct Column {
    F low{std::numeric_limits<float>::infinity()};
    F high{0.0F};
    F check{0.0F};  // not finite once a depth is: low and high pass over a NaN
    F eight{0.0F};
    F centre{0.0F};
    F above{0.0F};
    Moments<F> pairs[2];
    Moments<F> quads[4];

    NPSIM_ALWAYS_INLINE void begin(F z) noexcept {
      low = min(z, low);
      high = max(z, high);
      above = z - centre;
      for (Moments<F>& m : pairs) m = {F(0.0F), F(0.0F)};
      for (Moments<F>& m : quads) m = {F(0.0F), F(0.0F)};
    }
    // Takes the next pixel down and writes the moments of the eight that end there (of garbage before the eighth).
    template <int kPhase>
    NPSIM_ALWAYS_INLINE void step(F z, float* mean, float* spread) noexcept {
      low = min(z, low);
      high = max(z, high);
      const F own = z - centre;
      const F apart = own - above;
      const Moments<F> pair{fma(apart, F(0.5F), above), apart * apart};
      above = own;
      const Moments<F> quad = merge_to_sum(pairs[kPhase % 2], pair);
      pairs[kPhase % 2] = pair;
      const Moments<F> eights = merge_to_mean(quads[kPhase], quad);
      quads[kPhase] = quad;
      eight = eights.mean;
      eights.mean.store(mean);
      eights.spread.store(spread);
    }
  };

  // Does a window with a bit need this batch of columns? The bits of kMaxLanes windows decide together.
  static bool is_wanted(const std::uint64_t (&wanted)[kTileWords], int batch) noexcept {
    const int last = batch * F::lanes + F::lanes - 1;
    const int first = batch * F::lanes - (kWindow - 1);
    for (int i = first < 0 ? 0 : first / simd::kMaxLanes; i <= last / simd::kMaxLanes; ++i) {
      if (i < 4 * kTileWords && (wanted[i / 4] >> static_cast<unsigned>(i % 4 * simd::kMaxLanes) & 0xFFFFU) != 0)
        return true;
    }
    return false;
  }
  // Takes the pixels that the windows of `height` rows are made of, from p down.
  template <class Load>
  NPSIM_ALWAYS_INLINE void read_down(Column& column, const Load& load, const float* p, std::ptrdiff_t stride,
                                     int rows_below, int height, int c) noexcept {
    column.begin(load(p));
    for (int y = 1; y < height + kWindow - 1; y += 4) {
      float* mean = &mean_[y - 1][c * F::lanes];
      float* spread = &spread_[y - 1][c * F::lanes];
      const auto next = [&](int i) {
        if (y + i <= rows_below) p += stride;
        simd::prefetch(p + ahead_);
        return load(p);
      };
      column.template step<0>(next(0), mean, spread);
      column.template step<1>(next(1), mean + kColumns, spread + kColumns);
      column.template step<2>(next(2), mean + 2 * kColumns, spread + 2 * kColumns);
      column.template step<3>(next(3), mean + 3 * kColumns, spread + 3 * kColumns);
      column.check = column.check + column.eight;
    }
  }
  template <int K>
  static NPSIM_ALWAYS_INLINE Moments<F> ahead(const Moments<F>& a, const Moments<F>& b) noexcept {
    return {simd::slide<K>(a.mean, b.mean), simd::slide<K>(a.spread, b.spread)};
  }
  static std::uint32_t simd_bits(typename F::MaskType m) noexcept { return bits(m); }

  int batches_ = 0;
  std::ptrdiff_t ahead_ = 0;  // from the depth that is read to that which the next tile needs
  double range_ = 0;
  VarianceLimits limits_{};
  alignas(64) float mean_[kRows][kColumns];
  alignas(64) float spread_[kRows][kColumns];
};

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_UNCERTAINTY_MOMENTS_HPP
