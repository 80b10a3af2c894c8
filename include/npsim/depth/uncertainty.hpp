// SPDX-License-Identifier: Apache-2.0
// Dual-reference variance filter, equation (3.3): which pixels lie at an occlusion edge, where a one-layer sheet joins
// surfaces that do not touch.
//
// A window is l x l pixels, named by its upper-left pixel, and lies inside the image. It fires when the population
// variance of its depth is greater than mu (strictly) and it holds two different labels of which at least one belongs
// to the foreground set. The mask marks all pixels of every window that fires. Labels are compared for equality only:
// the printed "variance of h" would depend on how classes are numbered. Invalid depths do not count, neither for
// variance nor for labels; a window with fewer than two valid pixels does not fire.
//
// Variance is taken about one of the window's own samples, in double: the samples' distances to it cannot exceed
// n times the spread, so cancellation costs at most a factor n = l^2.
// Error: variance within 1e-12 relative at any depth, never negative. Cost: O(pixels l^2) for labels, and for variance
// in the windows whose labels pass (everywhere if the variance is asked for). Memory: 9 bytes per pixel.
#ifndef NPSIM_DEPTH_UNCERTAINTY_HPP
#define NPSIM_DEPTH_UNCERTAINTY_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/simd/isa.hpp"

namespace npsim {
inline namespace v1 {

struct UncertaintyParams {
  int window_px = 8;                        // l of section 3.4.2, 1..256
  double variance_m2 = 0.001;               // mu of section 3.4.2, not the mu of the cross-bilateral filter
  LabelSet foreground = kForegroundLabels;  // section 3.4.2
};

// Views that are left empty are not written. Each has the shape of the depth.
struct UncertaintyOutput {
  ImageView<std::uint8_t> mask;     // U: 1 where the pixel belongs to a window that fires, else 0
  ImageView<std::uint8_t> windows;  // 1 at the upper-left pixel of every window that fires, else 0
  ImageView<float> variance_m2;     // population variance of the window at its upper-left pixel; 0 without a window
};

[[nodiscard]] constexpr std::size_t uncertainty_workspace_bytes(const UncertaintyParams&, Shape shape) noexcept {
  return kWorkspaceAlignment + allocation_bytes<std::uint64_t>(shape.pixels()) +
         allocation_bytes<std::uint8_t>(shape.pixels());
}

inline namespace NPSIM_ISA_NAMESPACE {
namespace depth_detail {

// Population variance of the valid depths in the window, about its first valid depth; 0 with fewer than two.
[[nodiscard]] inline double window_variance(ImageView<const float> window) noexcept {
  double shift = 0;
  double sum = 0;
  double sum_squared = 0;
  int count = 0;
  for (int y = 0; y < window.height(); ++y) {
    const float* row = window.row(y);
    for (int x = 0; x < window.width(); ++x) {
      if (!is_valid_depth(row[x])) continue;
      if (count == 0) shift = static_cast<double>(row[x]);
      const double offset = static_cast<double>(row[x]) - shift;
      sum += offset;
      sum_squared += offset * offset;
      ++count;
    }
  }
  if (count < 2) return 0;
  const double variance = (sum_squared - sum * sum / count) / count;
  return variance > 0 ? variance : 0;
}

// True if the set holds two labels, one of them in the foreground.
[[nodiscard]] constexpr bool holds_foreground_edge(std::uint64_t labels, LabelSet foreground) noexcept {
  return (labels & (labels - 1)) != 0 && (labels & foreground.bits()) != 0;
}

}  // namespace depth_detail

template <class Executor>
[[nodiscard]] Status uncertainty(const UncertaintyParams& params, ImageView<const float> depth,
                                 ImageView<const Label> labels, const UncertaintyOutput& output, Workspace& workspace,
                                 Executor& executor) noexcept {
  const int l = params.window_px;
  if (l < 1 || l > 256) return {StatusCode::invalid_argument, "uncertainty: window_px must lie in 1..256"};
  if (!(params.variance_m2 >= 0) || !std::isfinite(params.variance_m2)) {
    return {StatusCode::invalid_argument, "uncertainty: variance_m2 must be finite and not negative"};
  }
  if (depth.empty()) return {StatusCode::no_valid_input, "uncertainty: the depth image is empty"};
  const Shape shape = depth.shape();
  const auto fits = [shape](const auto& view) { return view.empty() || view.shape() == shape; };
  if (labels.empty() || labels.shape() != shape || !fits(output.mask) || !fits(output.windows) ||
      !fits(output.variance_m2)) {
    return {StatusCode::shape_mismatch, "uncertainty: labels and outputs must have the shape of the depth"};
  }

  const WorkspaceScope scope(workspace);
  ImageView<std::uint64_t> label_bits;
  ImageView<std::uint8_t> fires;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, label_bits));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, fires));
  const auto rows = static_cast<std::size_t>(shape.height);

  executor.for_chunks(rows, 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const Label known = labels(x, y) < kLabelCount ? labels(x, y) : label::unlabeled;
        label_bits(x, y) = is_valid_depth(depth(x, y)) ? std::uint64_t{1} << known : 0;
      }
    }
  });

  executor.for_chunks(rows, 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        fires(x, y) = 0;
        double variance = 0;
        if (x + l <= shape.width && y + l <= shape.height) {
          std::uint64_t held = 0;
          for (int j = 0; j < l; ++j) {
            const std::uint64_t* bits = label_bits.row(y + j) + x;
            for (int i = 0; i < l; ++i) held |= bits[i];
          }
          const bool edge = depth_detail::holds_foreground_edge(held, params.foreground);
          if (edge || !output.variance_m2.empty()) variance = depth_detail::window_variance(depth.sub(x, y, {l, l}));
          fires(x, y) = edge && variance > params.variance_m2 ? 1 : 0;
        }
        if (!output.windows.empty()) output.windows(x, y) = fires(x, y);
        if (!output.variance_m2.empty()) output.variance_m2(x, y) = static_cast<float>(variance);
      }
    }
  });

  if (output.mask.empty()) return {};
  // Each chunk paints into its own rows the windows that reach them, so no two chunks write the same pixel.
  executor.for_chunks(rows, 16, [&](std::size_t begin, std::size_t end) {
    const int first = static_cast<int>(begin);
    const int last = static_cast<int>(end);
    for (int y = first; y < last; ++y) {
      for (int x = 0; x < shape.width; ++x) output.mask(x, y) = 0;
    }
    for (int wy = first - l + 1 > 0 ? first - l + 1 : 0; wy < last; ++wy) {
      const int top = wy > first ? wy : first;
      const int bottom = wy + l < last ? wy + l : last;
      for (int wx = 0; wx < shape.width; ++wx) {
        if (fires(wx, wy) == 0) continue;
        for (int y = top; y < bottom; ++y) {
          for (int x = wx; x < wx + l; ++x) output.mask(x, y) = 1;
        }
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_DEPTH_UNCERTAINTY_HPP
