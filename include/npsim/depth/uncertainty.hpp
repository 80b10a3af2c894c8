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
// and a window whose variance lies too close to mu for that is decided in double. With a window other than 8 or the
// variance asked for, it is double from the start.
// Error: every decision is that of the variance in double, which is within 1e-12 relative at any depth with the default
// window, 2e-9 at 256 (the bounds are derived in detail/uncertainty/variance.hpp); variance_m2 is within 5e-7 relative,
// and never negative. Same bytes for every instruction set and every number of threads.
// Cost: with the default window, one to two copies of the depth, with holes or without; about four where every pixel is
// a class of its own, nine with holes as well. Memory: one bit per pixel, and 50 KiB of stack (150 KiB for windows
// above 16).
#ifndef NPSIM_DEPTH_UNCERTAINTY_HPP
#define NPSIM_DEPTH_UNCERTAINTY_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/uncertainty/labels.hpp"
#include "npsim/depth/detail/uncertainty/search.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/simd/batch.hpp"

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

[[nodiscard]] inline Status validate(const UncertaintyParams& params) noexcept {
  if (params.window_px < 1 || params.window_px > 256) {
    return {StatusCode::invalid_argument, "uncertainty: window_px must lie in 1..256"};
  }
  if (!(params.variance_m2 >= 0) || !std::isfinite(params.variance_m2)) {
    return {StatusCode::invalid_argument, "uncertainty: variance_m2 must be finite and not negative"};
  }
  return {};
}

// F: the float batch, simd::scalar::F32 for the one-lane twin.
template <class F = simd::F32, class Executor>
[[nodiscard]] Status uncertainty(const UncertaintyParams& params, ImageView<const float> depth,
                                 ImageView<const Label> labels, const UncertaintyOutput& output, Workspace& workspace,
                                 Executor& executor) noexcept {
  using namespace depth_detail;
  NPSIM_RETURN_IF_ERROR(validate(params));
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
  const int l = params.window_px;
  const LabelCodes codes(params.foreground);
  if (l <= 16) {
    find_windows(WindowSearch<F, 16>{depth, labels, codes, l, params.variance_m2, fires, output.variance_m2},
                 output.windows, executor);
  } else {
    find_windows(WindowSearch<F, 256>{depth, labels, codes, l, params.variance_m2, fires, output.variance_m2},
                 output.windows, executor);
  }
  if (!output.mask.empty()) mark_windows<F>(ImageView<const std::uint64_t>(fires), l, output.mask, executor);
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_UNCERTAINTY_HPP
