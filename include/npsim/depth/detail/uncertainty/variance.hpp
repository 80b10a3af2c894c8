// SPDX-License-Identifier: Apache-2.0
// The depth half of the dual-reference variance filter: three ways to the population variance of a window, from fast
// to exact, each with a bound on its error that says when the next one has to be asked. Part of uncertainty.hpp.
//
// 1. MergedMoments (uncertainty_moments.hpp): windows of 8 x 8 without holes, in single precision. CountedMoments
//    (uncertainty_counted.hpp): the same with holes.
// 2. WindowSums: any window, holes, in double. Sums of z - c and of its square for one sample c of the block, sliding
//    down the columns. With D the greatest |z - c| the variance times the number of pixels is off by at most
//        4 (l + 2 rows + 24) 2^-53 l^2 D^2.
// 3. window_variance: one window in double, about its first valid sample. Relative error at any depth, worst where that
//    sample is an outlier, measured: 2e-14 at l = 8, 2e-11 at 64, 2e-9 at 256.
// Whatever is decided by 1 or 2 is decided as the exact variance decides; the result does not depend on the way.
//
// Cost per window: 2. about 3 ns; 3. about 30 ns. Memory: 10 KiB of stack up to l = 16, 35 KiB above.
#ifndef NPSIM_DEPTH_DETAIL_UNCERTAINTY_VARIANCE_HPP
#define NPSIM_DEPTH_DETAIL_UNCERTAINTY_VARIANCE_HPP

#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/depth/detail/uncertainty/labels.hpp"
#include "npsim/depth/detail/valid_depths.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

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
    float lows[F::lanes];
    float highs[F::lanes];
    low.store(lows);
    high.store(highs);
    for (int i = 1; i < F::lanes; ++i) {
      lows[0] = lows[i] < lows[0] ? lows[i] : lows[0];
      highs[0] = highs[i] > highs[0] ? highs[i] : highs[0];
    }
    holes_ = holes;
    shift_ = highs[0] > 0 ? lows[0] : 0;
    const double widest = static_cast<double>(highs[0]) - static_cast<double>(shift_);
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
