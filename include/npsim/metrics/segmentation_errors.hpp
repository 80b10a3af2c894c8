// SPDX-License-Identifier: Apache-2.0
// How well a semantic segmentation agrees with the truth: intersection over union, and its form that knows of pixels
// whose content nobody can tell (Sakaridis et al., ICCV 2019 and ACDC, ICCV 2021).
//
// Over all pixels that have a true class, each either valid or invalid (indiscernible in the picture), and each
// predicted as a class or as invalid, for class c:
//   TP  true c, predicted c                       FP  true other, predicted c
//   FN  true c, predicted other                   TI  true c, invalid, predicted invalid
//   FI  true c, valid, predicted invalid
//   IoU(c)  =  TP / (TP + FP + FN + TI + FI)               what is predicted invalid is missed
//   UIoU(c) = (TP + TI) / (TP + FP + FN + TI + FI)         giving up is right where nothing can be told
// An invalid pixel that is predicted as its true class counts as TP, so without invalid predictions both are equal. A
// model gives up where its confidence is below a threshold, or predicts none of the classes. Means are over the
// classes that occur in the truth or in the prediction. Counts are of all images together, as both benchmarks have it:
// add() one after the other.
// Error: none, counts are integers; one rounding of the quotient. Cost: one pass. Memory: none besides the counts.
#ifndef NPSIM_METRICS_SEGMENTATION_ERRORS_HPP
#define NPSIM_METRICS_SEGMENTATION_ERRORS_HPP

#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr std::size_t kMaxSegmentationClasses = 32;

class SegmentationCounts {
 public:
  // classes: at most kMaxSegmentationClasses.
  explicit constexpr SegmentationCounts(std::size_t classes) noexcept
      : classes_(classes < kMaxSegmentationClasses ? classes : kMaxSegmentationClasses) {}

  // Classes from 0; any number beyond them is none: a pixel that does not count, in the truth, or is predicted invalid.
  // invalid: not 0 where a pixel's content cannot be told; confidence: of the prediction, which below `threshold` (or
  // NaN) is invalid. Both of the truth's shape, or empty.
  [[nodiscard]] Status add(ImageView<const std::uint8_t> prediction, ImageView<const std::uint8_t> truth,
                           ImageView<const std::uint8_t> invalid = {}, ImageView<const float> confidence = {},
                           float threshold = 0.0F) noexcept {
    if (truth.empty()) return {StatusCode::no_valid_input, "segmentation_errors: the truth is empty"};
    const Shape shape = truth.shape();
    if (prediction.shape() != shape || (!invalid.empty() && invalid.shape() != shape) ||
        (!confidence.empty() && confidence.shape() != shape)) {
      return {StatusCode::shape_mismatch,
              "segmentation_errors: prediction, truth, invalid pixels and confidence must have one shape"};
    }
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const std::size_t t = truth(x, y);
        if (t >= classes_) continue;
        const std::size_t p = prediction(x, y);
        if (p < classes_ && (confidence.empty() || confidence(x, y) >= threshold)) {
          ++count_[t][p];
        } else if (!invalid.empty() && invalid(x, y) != 0) {
          ++true_invalid_[t];
        } else {
          ++false_invalid_[t];
        }
      }
    }
    return {};
  }

  [[nodiscard]] constexpr std::size_t classes() const noexcept { return classes_; }
  [[nodiscard]] constexpr std::uint64_t predicted_as(std::size_t truth, std::size_t prediction) const noexcept {
    return count_[truth][prediction];
  }
  [[nodiscard]] constexpr std::uint64_t true_invalid(std::size_t c) const noexcept { return true_invalid_[c]; }
  [[nodiscard]] constexpr std::uint64_t false_invalid(std::size_t c) const noexcept { return false_invalid_[c]; }

  // TP + FP + FN + TI + FI.
  [[nodiscard]] constexpr std::uint64_t either(std::size_t c) const noexcept {
    std::uint64_t sum = true_invalid_[c] + false_invalid_[c] + count_[c][c];
    for (std::size_t o = 0; o < classes_; ++o) sum += o == c ? 0 : count_[c][o] + count_[o][c];
    return sum;
  }
  // NaN for a class that occurs nowhere.
  [[nodiscard]] constexpr double iou(std::size_t c) const noexcept { return quotient(count_[c][c], either(c)); }
  [[nodiscard]] constexpr double uiou(std::size_t c) const noexcept {
    return quotient(count_[c][c] + true_invalid_[c], either(c));
  }
  // Over the classes that occur; NaN where none does.
  [[nodiscard]] constexpr double mean_iou() const noexcept { return mean(&SegmentationCounts::iou); }
  [[nodiscard]] constexpr double mean_uiou() const noexcept { return mean(&SegmentationCounts::uiou); }

 private:
  [[nodiscard]] static constexpr double quotient(std::uint64_t part, std::uint64_t whole) noexcept {
    return whole == 0 ? std::numeric_limits<double>::quiet_NaN()
                      : static_cast<double>(part) / static_cast<double>(whole);
  }
  [[nodiscard]] constexpr double mean(double (SegmentationCounts::*of)(std::size_t) const noexcept) const noexcept {
    double sum = 0;
    int n = 0;
    for (std::size_t c = 0; c < classes_; ++c) {
      if (either(c) == 0) continue;
      sum += (this->*of)(c);
      ++n;
    }
    return n > 0 ? sum / n : std::numeric_limits<double>::quiet_NaN();
  }

  std::size_t classes_;
  std::uint64_t count_[kMaxSegmentationClasses][kMaxSegmentationClasses] = {};  // [truth][prediction]
  std::uint64_t true_invalid_[kMaxSegmentationClasses] = {};
  std::uint64_t false_invalid_[kMaxSegmentationClasses] = {};
};

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_METRICS_SEGMENTATION_ERRORS_HPP
