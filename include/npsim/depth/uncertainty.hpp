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
// How: labels first, as bytes, in strips of 512 columns and bands of 16 rows; where no window of a band can hold a
// foreground edge, depth is not read at all. Elsewhere variance is merged in single precision, with or without holes,
// and a window whose variance lies too close to mu for that is decided in double (uncertainty_variance.hpp has the
// bounds). With a window other than 8 or the variance asked for, it is double from the start.
// Error: every decision is that of the variance in double, which is within 1e-12 relative at any depth with the default
// window (uncertainty_variance.hpp has wider ones: 2e-9 at 256); variance_m2 is within 5e-7 relative, and never
// negative. Same bytes for every instruction set and every number of threads.
// Cost: with the default window, one to two copies of the depth, with holes or without; about four where every pixel
// is a class of its own, nine with holes as well. Memory: one bit per pixel, and 50 KiB of stack (150 KiB for windows
// above 16).
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
#include "npsim/depth/detail/uncertainty/bits.hpp"
#include "npsim/depth/detail/uncertainty/labels.hpp"
#include "npsim/depth/detail/uncertainty/search.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/simd/bytes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

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
  const auto words = shape.empty() ? std::size_t{0} : (static_cast<std::size_t>(shape.width) + 63) / 64;
  return kWorkspaceAlignment + allocation_bytes<std::uint64_t>(words * static_cast<std::size_t>(shape.height));
}

namespace depth_detail {

template <class F, int kMaxWindow, class Executor>
void find_windows(const UncertaintyParams& params, ImageView<const float> depth, ImageView<const Label> labels,
                  ImageView<std::uint64_t> fires, const UncertaintyOutput& output, Executor& executor) noexcept {
  const int l = params.window_px;
  const WindowSearch<F, kMaxWindow> search{
      depth, labels, LabelCodes(params.foreground), l, params.variance_m2, fires, output.variance_m2};
  executor.for_chunks(static_cast<std::size_t>(depth.height()), kBandRows<kMaxWindow>,
                      [&](std::size_t begin, std::size_t end) {
                        const int first = static_cast<int>(begin);
                        const int last = static_cast<int>(end);
                        const int right = depth.width() - l + 1;
                        const int bottom = depth.height() - l + 1;
                        for (int y = first; y < last; ++y) {
                          for (int w = 0; w < fires.width(); ++w) fires(w, y) = 0;
                          if (output.variance_m2.empty()) continue;
                          const int inside = y < bottom && right > 0 ? right : 0;
                          for (int x = inside; x < depth.width(); ++x) output.variance_m2(x, y) = 0;
                        }
                        if (first < bottom) search.band(first, last < bottom ? last : bottom);
                        for (int y = first; y < last; ++y) {
                          if (!output.windows.empty())
                            write_bits<F>(fires.row(y), output.windows.row(y), depth.width());
                          widen_bits(fires.row(y), fires.width(), l);
                        }
                      });
}

}  // namespace depth_detail

// F: the float batch, simd::scalar::F32 for the one-lane twin.
template <class F = simd::F32, class Executor>
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
  ImageView<std::uint64_t> fires;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(Shape{(shape.width - 1) / 64 + 1, shape.height}, fires));
  if (l <= 16) {
    depth_detail::find_windows<F, 16>(params, depth, labels, fires, output, executor);
  } else {
    depth_detail::find_windows<F, 256>(params, depth, labels, fires, output, executor);
  }
  if (output.mask.empty()) return {};

  // The bits are already as wide as their windows; here the rows of a window are joined.
  executor.for_chunks(static_cast<std::size_t>(shape.height), 16, [&](std::size_t begin, std::size_t end) {
    constexpr int kWords = 32;
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int w = 0; w < fires.width(); w += kWords) {
        const int n = fires.width() - w < kWords ? fires.width() - w : kWords;
        std::uint64_t joined[kWords] = {};
        for (int row = y - l + 1 > 0 ? y - l + 1 : 0; row <= y; ++row) {
          const std::uint64_t* bits = fires.row(row) + w;
          for (int i = 0; i < n; ++i) joined[i] |= bits[i];
        }
        const int left = shape.width - 64 * w;
        depth_detail::write_bits<F>(joined, output.mask.row(y) + 64 * w, left < 64 * kWords ? left : 64 * kWords);
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_UNCERTAINTY_HPP
