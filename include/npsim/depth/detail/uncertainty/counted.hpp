// SPDX-License-Identifier: Apache-2.0
// Variance of windows of 8 x 8 pixels with holes, by merging in single precision, with a bound on its error. Part of
// uncertainty.hpp.
//
// As in uncertainty_moments.hpp, but each part has its own number of valid pixels, so that a merge weighs the squared
// difference of two means by a b / (a + b) (Chan, Golub and LeVeque 1979). The standard deviation is known to within
//     |sigma' - sigma| <= 24 u D + 24 u sigma,  u = 2^-24,
// where D is the difference of the greatest and the least depth read. Derivation: the means after 0 .. 5 merges are off
// by at most 1, 2.5, 5.5, 8.5, 11.5, 14.5 u D (a merge adds one rounding of the mean, of the difference and of the
// share, each of at most D). The weights of the merges of one level add up to at most a quarter of the number of
// pixels, so these are sqrt(sum of squares) = 21.3 u D of the standard deviation. Spreads are sums of positive terms,
// off by at most 17 roundings in all, which is 8.5 u sigma; the shares' roundings come to less than that again.
//
// Cost: about three times that without holes. Memory: 30 KiB of stack.
#ifndef NPSIM_DEPTH_DETAIL_UNCERTAINTY_COUNTED_HPP
#define NPSIM_DEPTH_DETAIL_UNCERTAINTY_COUNTED_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/depth/detail/uncertainty/labels.hpp"
#include "npsim/depth/detail/uncertainty/moments.hpp"
#include "npsim/depth/detail/valid_depths.hpp"
#include "npsim/simd/bytes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

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
    float lows[F::lanes];
    float highs[F::lanes];
    low.store(lows);
    high.store(highs);
    for (int i = 1; i < F::lanes; ++i) {
      lows[0] = lows[i] < lows[0] ? lows[i] : lows[0];
      highs[0] = highs[i] > highs[0] ? highs[i] : highs[0];
    }
    range_ = static_cast<double>(highs[0]) - static_cast<double>(lows[0]);
    return centre == 0 || moments_are_safe(highs[0]);
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

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_UNCERTAINTY_COUNTED_HPP
