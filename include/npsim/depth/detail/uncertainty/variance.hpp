// SPDX-License-Identifier: Apache-2.0
// The depth half of the dual-reference variance filter: three ways to the population variance of a window, from fast to
// exact, each with a bound on its error that says when the next one has to be asked. Part of uncertainty.hpp.
//
// 1. Windows of 8 x 8 in single precision, with u = 2^-24 and D the difference of the greatest and the least depth
//    read. MergedMoments, without holes: the standard deviation is known within 16 u D + 16 u sigma. CountedMoments,
//    with holes: within 24 u D + 24 u sigma. A variance whose standard deviation lies further than that from the
//    threshold's is decided.
// 2. WindowSums: any window, holes, in double. Sums of z - c and of its square for one sample c of the block, sliding
//    down the columns. With D the greatest |z - c| the variance times the number of pixels is off by at most
//        4 (l + 2 rows + 24) 2^-53 l^2 D^2.
// 3. window_variance: one window in double, about its first valid sample. Relative error at any depth, worst where that
//    sample is an outlier, measured: 2e-14 at l = 8, 2e-11 at 64, 2e-9 at 256.
// Whatever is decided by 1 or 2 is decided as the exact variance decides; the result does not depend on the way.
//
// The first way merges halves (Chan, Golub and LeVeque 1979): mean and sum of squares of 1, 2, 4 .. 64 pixels, where
// the squares of two halves add up and gain a multiple of the squared difference of the means, a b / (a + b) of it
// where the parts have a and b valid pixels. Nothing large is ever subtracted from anything large; what is merged is z
// - c, where c is one of the depths.
// Derivation without holes: the means after 0 .. 5 merges are off by at most 1, 2.5, 3.5, 5, 6, 7.5 u D; as
// contributions to the sum of squares these are orthogonal directions, whose lengths add as squares, sqrt(136.75) =
// 11.7; the roundings of the sums come to 7 u sigma (10 without a fused fma); the rest is slack.
// With holes: 1, 2.5, 5.5, 8.5, 11.5, 14.5 u D (a merge adds one rounding of the mean, of the difference and of the
// share, each of at most D). The weights of the merges of one level add up to at most a quarter of the number of
// pixels, so these are sqrt(sum of squares) = 21.3 u D of the standard deviation. Spreads are sums of positive terms,
// off by at most 17 roundings in all, which is 8.5 u sigma; the shares' roundings come to less than that again.
//
// Cost of the first way: about 2 instructions of a register's width per register of windows and level of merging, 12
// with loads and stores, three times that with holes. Of the second about 3 ns per window, of the third about 30 ns.
// Memory, on the stack: 30 KiB for the first; for the second 10 KiB up to l = 16, 35 KiB above.
#ifndef NPSIM_DEPTH_DETAIL_UNCERTAINTY_VARIANCE_HPP
#define NPSIM_DEPTH_DETAIL_UNCERTAINTY_VARIANCE_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/depth/detail/uncertainty/labels.hpp"
#include "npsim/depth/detail/valid_depths.hpp"
#include "npsim/simd/batch.hpp"
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

// Number, mean (about some depth of the block) and sum of squared deviations of the valid ones among some pixels.
// Without any the mean is some finite number.
template <class F>
struct CountedPixels {
  F count;
  F mean;
  F spread;
};

template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE CountedPixels<F> merge(const CountedPixels<F>& a,
                                                         const CountedPixels<F>& b) noexcept {
  const F count = a.count + b.count;
  const F share = b.count / max(count, F(1.0F));
  const F apart = b.mean - a.mean;
  return {count, fma(apart, share, a.mean), fma(apart * apart, a.count * share, a.spread + b.spread)};
}

// Of blocks of at most 64 columns of windows.
template <class F>
class CountedMoments {
 public:
  static constexpr int kWindow = 8;
  static constexpr int kLead = kWindow - 1;
  static constexpr std::size_t kRows = kBandRows<kWindow> + kWindow + 1;  // read in fours, the last beyond the block

  // Reads what the windows first .. last of every row of `block` are made of. False if a depth is so large or so small
  // that squares might over- or underflow; then nothing else may be called.
  [[nodiscard]] bool read(ImageView<const float> depth, const WindowBlock& block, int first, int last) noexcept {
    batches_ = (last + kLead) / F::lanes + 1;
    for (auto& row : valid_) row[0] = row[1] = 0;
    const int begin = first / F::lanes;
    const int left = depth.width() - block.x;
    const float centre =
        some_depth(depth, block, begin * F::lanes, batches_ * F::lanes < left ? batches_ * F::lanes : left);
    centre_ = F(centre);
    F low = centre_;
    F high = centre_;
    for (int c = begin; c < batches_; ++c) {
      const int x = block.x + c * F::lanes;
      const int available = depth.width() - x < F::lanes ? depth.width() - x : F::lanes;
      if (available <= 0) {
        batches_ = c;
        break;
      }
      const int last_row = depth.height() - 1;
      const auto at = static_cast<unsigned>(c * F::lanes);
      Pixel above = pixel(depth, x, block.y, available);
      valid_[0][at >> 6] |= std::uint64_t{bits(above.valid)} << (at & 63U);
      low = min(low, above.z);
      high = max(high, above.z);
      CountedPixels<F> pairs[2];
      CountedPixels<F> quads[4];
      for (auto& m : pairs) m = {F(0.0F), F(0.0F), F(0.0F)};
      for (auto& m : quads) m = {F(0.0F), F(0.0F), F(0.0F)};
      const auto step = [&](int y, CountedPixels<F>& two, CountedPixels<F>& four) {
        const int row = block.y + y;
        const Pixel own = pixel(depth, x, row < last_row ? row : last_row, available);
        valid_[y][at >> 6] |= std::uint64_t{bits(own.valid)} << (at & 63U);
        low = min(low, own.z);
        high = max(high, own.z);
        const CountedPixels<F> new_two = pair(above, own);
        above = own;
        const CountedPixels<F> new_four = merge(two, new_two);
        two = new_two;
        const CountedPixels<F> eight = merge(four, new_four);
        four = new_four;
        eight.count.store(&count_[y][at]);
        eight.mean.store(&mean_[y][at]);
        eight.spread.store(&spread_[y][at]);
      };
      for (int y = 1; y < block.height + kLead; y += 4) {
        step(y, pairs[0], quads[0]);
        step(y + 1, pairs[1], quads[1]);
        step(y + 2, pairs[0], quads[2]);
        step(y + 3, pairs[1], quads[3]);
      }
    }
    const float least = simd::least_lane(low);
    const float greatest = -simd::least_lane(-high);
    range_ = static_cast<double>(greatest) - static_cast<double>(least);
    return centre == 0 || moments_are_safe(greatest);
  }

  // Which pixels of a row are valid: bit i stands for column block.x + i, 0 <= i < 64 + 7, those read.
  [[nodiscard]] const std::uint64_t (&valid(int row) const noexcept)[2] { return valid_[row]; }

  // No variance exceeds a quarter of the squared range.
  [[nodiscard]] bool all_below(double variance) const noexcept {
    return 0.25 * range_ * range_ * (1 + 1e-9) <= variance;
  }

  // Sets the threshold that decide() compares with.
  void set_threshold(double variance) noexcept { limits_ = variance_limits(variance, range_, 24 * 0x1p-24, 1.0); }

  // The windows first .. last of one row of the block that was read, 0 <= row < block.height. One without valid pixels
  // is in doubt.
  void decide(int row, int first, int last, std::uint64_t& above, std::uint64_t& doubtful) const noexcept {
    const int begin = first / F::lanes;
    const int end = last / F::lanes + 1;
    const auto column = [&](int at) {
      return CountedPixels<F>{F::load(count_[row + kLead] + at), F::load(mean_[row + kLead] + at),
                              F::load(spread_[row + kLead] + at)};
    };
    const auto put = [&](int batch, const CountedPixels<F>& m) {
      const auto at = static_cast<unsigned>(batch * F::lanes);
      const auto over = m.spread > m.count * F(limits_.above);
      const auto unsure = ~(over | (m.spread < m.count * F(limits_.below)));
      above |= std::uint64_t{bits(over)} << at;
      doubtful |= std::uint64_t{bits(unsure)} << at;
    };
    if constexpr (F::lanes >= 4) {
      const auto batch = [&](int i) {
        return i < batches_ ? column(i * F::lanes) : CountedPixels<F>{F(0.0F), F(0.0F), F(0.0F)};
      };
      const CountedPixels<F> c0 = batch(begin);
      const CountedPixels<F> c1 = batch(begin + 1);
      CountedPixels<F> c2 = batch(begin + 2);
      const CountedPixels<F> first_pair = merge(c0, ahead<1>(c0, c1));
      CountedPixels<F> pair = merge(c1, ahead<1>(c1, c2));
      CountedPixels<F> quad = merge(first_pair, ahead<2>(first_pair, pair));
      for (int i = begin; i < end; ++i) {
        const CountedPixels<F> c3 = batch(i + 3);
        const CountedPixels<F> next_pair = merge(c2, ahead<1>(c2, c3));
        const CountedPixels<F> next_quad = merge(pair, ahead<2>(pair, next_pair));
        put(i, merge(quad, ahead<4>(quad, next_quad)));
        c2 = c3;
        pair = next_pair;
        quad = next_quad;
      }
    } else {
      for (int i = begin; i < end; ++i) {
        const auto pair = [&](int k) { return merge(column(i + k), column(i + k + 1)); };
        const auto quad = [&](int k) { return merge(pair(k), pair(k + 2)); };
        put(i, merge(quad(0), quad(4)));
      }
    }
  }

 private:
  static constexpr std::size_t kColumns = 64 + simd::kMaxLanes;

  struct Pixel {
    F z;  // centre_ where it is not valid
    typename F::MaskType valid;
  };
  // The first valid depth in the columns begin .. end - 1 of the block, or 0.
  [[nodiscard]] static float some_depth(ImageView<const float> depth, const WindowBlock& block, int begin,
                                        int end) noexcept {
    for (int y = block.y; y < block.y + block.height + kLead; ++y) {
      const float* z = depth.row(y) + block.x;
      for (int x = begin; x < end; ++x) {
        if (is_valid_depth(z[x])) return z[x];
      }
    }
    return 0;
  }
  NPSIM_ALWAYS_INLINE Pixel pixel(ImageView<const float> depth, int x, int y, int available) const noexcept {
    const float* p = depth.row(y) + x;
    const F z = available == F::lanes ? F::load(p) : F::load(p, available);
    const auto valid = are_valid_depths(z);
    return {select(valid, z, centre_), valid};
  }
  // About the centre.
  NPSIM_ALWAYS_INLINE CountedPixels<F> pair(const Pixel& a, const Pixel& b) const noexcept {
    const F one(1.0F);
    const F none(0.0F);
    const F from = select(a.valid, a.z, b.z) - centre_;
    const F apart = (select(b.valid, b.z, a.z) - centre_) - from;
    const F half = apart * 0.5F;
    return {select(a.valid, one, none) + select(b.valid, one, none), from + half, half * apart};
  }
  template <int K>
  static NPSIM_ALWAYS_INLINE CountedPixels<F> ahead(const CountedPixels<F>& a, const CountedPixels<F>& b) noexcept {
    return {simd::slide<K>(a.count, b.count), simd::slide<K>(a.mean, b.mean), simd::slide<K>(a.spread, b.spread)};
  }

  int batches_ = 0;
  double range_ = 0;
  F centre_{0.0F};
  VarianceLimits limits_{};
  std::uint64_t valid_[kRows][2];
  alignas(64) float count_[kRows][kColumns];
  alignas(64) float mean_[kRows][kColumns];
  alignas(64) float spread_[kRows][kColumns];
};

// Population variance of the valid depths in the window, about its first valid depth; 0 with fewer than two.
[[nodiscard]] inline double window_variance(ImageView<const float> window) noexcept {
  constexpr int kParts = 8;  // independent sums, so that they need not wait for each other
  double shift = 0;
  double sum[kParts] = {};
  double sum_squared[kParts] = {};
  int count = 0;
  for (int y = 0; y < window.height(); ++y) {
    const float* row = window.row(y);
    for (int x = 0; x < window.width() && count == 0; ++x) {
      if (!is_valid_depth(row[x])) continue;
      shift = static_cast<double>(row[x]);
      count = 1;
    }
    if (count != 0) break;
  }
  count = 0;
  for (int y = 0; y < window.height(); ++y) {
    const float* row = window.row(y);
    for (int x = 0; x < window.width(); x += kParts) {
      const int n = window.width() - x < kParts ? window.width() - x : kParts;
      for (int i = 0; i < n; ++i) {
        const bool valid = is_valid_depth(row[x + i]);
        const double offset = valid ? static_cast<double>(row[x + i]) - shift : 0.0;
        sum[i] += offset;
        sum_squared[i] += offset * offset;
        count += valid ? 1 : 0;
      }
    }
  }
  if (count < 2) return 0;
  double total = 0;
  double total_squared = 0;
  for (int i = 0; i < kParts; ++i) {
    total += sum[i];
    total_squared += sum_squared[i];
  }
  const double variance = (total_squared - total * total / count) / count;
  return variance > 0 ? variance : 0;
}

// Sums of z - c and of its square over the windows of a block, row by row. Any window up to kMaxWindow, holes. The
// loops are plain ones over doubles without branches, which compilers turn into vector code.
template <class F, int kMaxWindow>
class WindowSums {
 public:
  // What is known of the windows of a row: numbers of pixels, and numbers times variance.
  struct Row {
    alignas(64) double count[kTileWindows];
    alignas(64) double spread[kTileWindows];
  };

  WindowSums(ImageView<const float> depth, const WindowBlock& block, int l) noexcept
      : depth_(depth), block_(block), l_(l), columns_(block.width + l - 1) {
    const F none(std::numeric_limits<float>::infinity());
    F low = none;
    F high(0.0F);
    bool holes = false;
    for (int y = block.y; y < block.y + block.height + l - 1; ++y) {
      const float* z = depth.row(y) + block.x;
      for (int i = 0; i < columns_; i += F::lanes) {
        const int n = columns_ - i < F::lanes ? columns_ - i : F::lanes;
        const F own = n == F::lanes ? F::load(z + i) : F::load(z + i, n);
        const auto valid = are_valid_depths(own);
        low = min(select(valid, own, none), low);
        high = max(select(valid, own, F(0.0F)), high);
        holes = holes || any(F::MaskType::first(n) & ~valid);
      }
    }
    const float least = simd::least_lane(low);
    const float greatest = -simd::least_lane(-high);
    holes_ = holes;
    shift_ = greatest > 0 ? least : 0;
    const double widest = static_cast<double>(greatest) - static_cast<double>(shift_);
    error_ = 4.0 * (l + 2 * block.height + 24) * 0x1p-53 * (l * l) * widest * widest;
    for (int i = 0; i < columns_; ++i) sum_[i] = squares_[i] = count_[i] = 0;
    for (int y = 0; y < l; ++y) move<false>(nullptr, depth_.row(block.y + y) + block.x);
  }

  [[nodiscard]] bool has_holes() const noexcept { return holes_; }
  [[nodiscard]] double error() const noexcept { return error_; }  // of count * variance

  // Rows come in order, from 0.
  void row(int y, Row& out) noexcept {
    if (y > 0) {
      move<true>(depth_.row(block_.y + y - 1) + block_.x, depth_.row(block_.y + y + l_ - 1) + block_.x);
    }
    alignas(64) double sum[kTileWindows];
    box(sum_, sum);
    box(squares_, out.spread);
    if (holes_) box(count_, out.count);
    const double all = l_ * l_;
    for (int i = 0; i < block_.width; ++i) {
      if (!holes_) out.count[i] = all;
      const double n = out.count[i] > 1 ? out.count[i] : 1;
      const double value = out.spread[i] - sum[i] * sum[i] / n;
      out.spread[i] = value > 0 ? value : 0;
    }
  }

 private:
  static constexpr std::size_t kColumns = kTileWindows + kMaxWindow + simd::kMaxLanes;

  // z as it counts: the shift where it is not valid.
  const float* cleaned(const float* z, float* clean, float* valid) const noexcept {
    if (!holes_) return z;
    for (int i = 0; i < columns_; i += F::lanes) {
      const F own = columns_ - i < F::lanes ? F::load(z + i, columns_ - i) : F::load(z + i);
      const auto is_valid = are_valid_depths(own);
      select(is_valid, own, F(shift_)).store(clean + i);
      select(is_valid, F(1.0F), F(0.0F)).store(valid + i);
    }
    return clean;
  }

  // The sums of the columns lose one row, if kLeave, and gain another.
  template <bool kLeave>
  void move(const float* leaving, const float* entering) noexcept {
    alignas(64) float clean[2][kColumns];
    alignas(64) float valid[2][kColumns];
    const double shift = static_cast<double>(shift_);
    const float* in = cleaned(entering, clean[0], valid[0]);
    const float* out = kLeave ? cleaned(leaving, clean[1], valid[1]) : in;
    const int columns = columns_;
    for (int i = 0; i < columns; ++i) {
      const double a = static_cast<double>(in[i]) - shift;
      const double b = kLeave ? static_cast<double>(out[i]) - shift : 0.0;
      sum_[i] += a - b;
      squares_[i] += a * a - b * b;
    }
    if (!holes_) return;
    for (int i = 0; i < columns; ++i) {
      count_[i] += static_cast<double>(kLeave ? valid[0][i] - valid[1][i] : valid[0][i]);
    }
  }

  // out[i] = column[i] + ... + column[i + l - 1], from sums of 1, 2, 4 ... columns where l has that bit.
  void box(const double* column, double* out) const noexcept {
    alignas(64) double buffer[2][kColumns];
    const int width = block_.width;
    const double* power = column;
    int done = 0;
    for (int length = 1;; length *= 2) {
      if ((l_ & length) != 0) {
        const double* next = power + done;
        if (done == 0) {
          for (int i = 0; i < width; ++i) out[i] = next[i];
        } else {
          for (int i = 0; i < width; ++i) out[i] += next[i];
        }
        done += length;
      }
      if (2 * length > l_) return;
      double* next = power == buffer[0] ? buffer[1] : buffer[0];
      const int count = columns_ - 2 * length + 1;
      for (int i = 0; i < count; ++i) next[i] = power[i] + power[i + length];
      power = next;
    }
  }

  ImageView<const float> depth_;
  WindowBlock block_;
  int l_;
  int columns_;
  bool holes_ = false;
  float shift_ = 0;
  double error_ = 0;
  alignas(64) double sum_[kColumns];
  alignas(64) double squares_[kColumns];
  alignas(64) double count_[kColumns];
};

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_UNCERTAINTY_VARIANCE_HPP
