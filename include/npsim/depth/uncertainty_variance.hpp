// SPDX-License-Identifier: Apache-2.0
// The depth half of the dual-reference variance filter: four ways to the population variance of a window, from fast
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
// Cost per window: 2. about 6 ns; 3. about 30 ns. Memory: 10 KiB of stack up to l = 16, 30 KiB above.
#ifndef NPSIM_DEPTH_UNCERTAINTY_VARIANCE_HPP
#define NPSIM_DEPTH_UNCERTAINTY_VARIANCE_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/depth/uncertainty_labels.hpp"
#include "npsim/simd/isa.hpp"

namespace npsim {
inline namespace v1 {
inline namespace NPSIM_ISA_NAMESPACE {
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

// Sums of z - c and of its square over the windows of a block, row by row. Any window up to kMaxWindow, holes.
template <int kMaxWindow>
class WindowSums {
 public:
  WindowSums(ImageView<const float> depth, const WindowBlock& block, int l) noexcept
      : depth_(depth), block_(block), l_(l), columns_(block.width + l - 1) {
    float low = std::numeric_limits<float>::infinity();
    float high = 0;
    for (int y = block.y; y < block.y + block.height + l - 1; ++y) {
      const float* z = depth.row(y) + block.x;
      for (int i = 0; i < columns_; ++i) {
        const bool valid = is_valid_depth(z[i]);
        low = valid && z[i] < low ? z[i] : low;
        high = valid && z[i] > high ? z[i] : high;
        holes_ = holes_ || !valid;
      }
    }
    shift_ = high > 0 ? static_cast<double>(low) : 0;
    const double widest = high > 0 ? static_cast<double>(high) - shift_ : 0;
    error_ = 4.0 * (l + 2 * block.height + 24) * 0x1p-53 * (l * l) * widest * widest;
    for (int i = 0; i < columns_; ++i) sum_[i] = squares_[i] = count_[i] = 0;
    for (int y = 0; y < l; ++y) add_row<true>(block.y + y);
  }

  [[nodiscard]] bool has_holes() const noexcept { return holes_; }
  [[nodiscard]] double error() const noexcept { return error_; }  // of count * variance

  // Numbers of pixels, and numbers times variance, of the windows of the row. Rows come in order, from 0.
  void row(int y, double (&count)[kTileWindows], double (&spread)[kTileWindows]) noexcept {
    if (y > 0) {
      add_row<false>(block_.y + y - 1);
      add_row<true>(block_.y + y + l_ - 1);
    }
    double sum[kTileWindows];
    box(sum_, sum);
    box(squares_, spread);
    box(count_, count);
    for (int i = 0; i < block_.width; ++i) {
      const double n = count[i] > 0 ? count[i] : 1;
      const double value = spread[i] - sum[i] * sum[i] / n;
      spread[i] = value > 0 ? value : 0;
    }
  }

 private:
  static constexpr std::size_t kColumns = kTileWindows + kMaxWindow;

  template <bool kEnter>
  void add_row(int y) noexcept {
    constexpr double kSign = kEnter ? 1 : -1;
    const float* z = depth_.row(y) + block_.x;
    for (int i = 0; i < columns_; ++i) {
      const bool valid = z[i] > 0 && z[i] <= std::numeric_limits<float>::max();
      const double offset = valid ? static_cast<double>(z[i]) - shift_ : 0.0;
      sum_[i] += kSign * offset;
      squares_[i] += kSign * (offset * offset);
      count_[i] += valid ? kSign : 0.0;
    }
  }

  // out[i] = column[i] + ... + column[i + l - 1], from sums of 1, 2, 4 ... columns where l has that bit.
  void box(const double* column, double* out) const noexcept {
    double power[kColumns];
    for (int i = 0; i < columns_; ++i) power[i] = column[i];
    for (int i = 0; i < block_.width; ++i) out[i] = 0;
    int done = 0;
    for (int length = 1; length <= l_; length *= 2) {
      if ((l_ & length) != 0) {
        for (int i = 0; i < block_.width; ++i) out[i] += power[i + done];
        done += length;
      }
      for (int i = 0; i + 2 * length <= columns_; ++i) power[i] += power[i + length];
    }
  }

  ImageView<const float> depth_;
  WindowBlock block_;
  int l_;
  int columns_;
  bool holes_ = false;
  double shift_ = 0;
  double error_ = 0;
  alignas(64) double sum_[kColumns];
  alignas(64) double squares_[kColumns];
  alignas(64) double count_[kColumns];
};

}  // namespace depth_detail
}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_DEPTH_UNCERTAINTY_VARIANCE_HPP
