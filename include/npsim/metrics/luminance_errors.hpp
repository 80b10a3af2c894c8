// SPDX-License-Identifier: Apache-2.0
// How far the luminance of a night is from the true one.
//
// Only pixels count that the mask selects and where the truth is above `floor_cd_m2`; with d = log2(L / L_true), where
// an estimate below the floor / 1000 counts as that:
//   median and 95th percentile of |d|;  bias = median of d (negative: too dark)
//   trimmed relative squared error = mean of (L - L_true)^2 / (L_true^2 + floor^2) without the largest .1 % of its terms
// Logarithms, because light spans five decades in one night; the trimmed error is that of unbiased estimators, where a
// few fireflies would decide the mean. The same bits for any executor: none is taken.
// Error: kept in float, 1e-6 of d. Cost: one pass and four selections. Memory: 8 bytes a pixel.
#ifndef NPSIM_METRICS_LUMINANCE_ERRORS_HPP
#define NPSIM_METRICS_LUMINANCE_ERRORS_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/metrics/detail/pixel_sums.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct LuminanceErrorParams {
  float floor_cd_m2 = 0.005F;  // of the truth, > 0; below, a camera sees noise
};

struct LuminanceErrors {
  std::size_t pixels = 0;
  double median = 0;  // of |log2|
  double p95 = 0;
  double bias = 0;    // median of log2
  double trimmed_relative_squared = 0;
};

[[nodiscard]] constexpr std::size_t luminance_errors_workspace_bytes(Shape shape) noexcept {
  return kWorkspaceAlignment + 2 * allocation_bytes<float>(shape.empty() ? 0 : shape.pixels());
}

// estimate and truth: linear RGB whose luminance() is in cd/m2, one shape; mask: that shape, or empty.
[[nodiscard]] inline Status luminance_errors(const LuminanceErrorParams& params, ImageView<const Vec3f> estimate,
                                             ImageView<const Vec3f> truth, ImageView<const std::uint8_t> mask,
                                             LuminanceErrors& out, Workspace& workspace) noexcept {
  if (!(params.floor_cd_m2 > 0.0F)) return {StatusCode::invalid_argument, "luminance_errors: the floor must be > 0"};
  if (estimate.shape() != truth.shape() || (!mask.empty() && mask.shape() != truth.shape())) {
    return {StatusCode::shape_mismatch, "luminance_errors: estimate, truth and mask must have one shape"};
  }
  const WorkspaceScope scope(workspace);
  Span<float> logs;
  Span<float> squares;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(truth.shape().pixels(), logs));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(truth.shape().pixels(), squares));
  std::size_t n = 0;
  const float floor = params.floor_cd_m2;
  for (int y = 0; y < truth.height(); ++y) {
    for (int x = 0; x < truth.width(); ++x) {
      const float t = luminance(truth(x, y));
      if (!metrics_detail::selected(mask, x, y) || !(t > floor)) continue;
      const float seen = luminance(estimate(x, y));
      const float e = seen > 1e-3F * floor ? seen : 1e-3F * floor;  // a NaN too
      logs[n] = std::log2(e / t);
      squares[n++] = (e - t) * (e - t) / (t * t + floor * floor);
    }
  }
  if (n == 0) return {StatusCode::no_valid_input, "luminance_errors: no selected pixel is brighter than the floor"};
  LuminanceErrors errors;
  errors.pixels = n;
  errors.bias = metrics_detail::median(logs.sub(0, n));
  for (float& d : logs.sub(0, n)) d = std::fabs(d);
  errors.median = metrics_detail::median(logs.sub(0, n));
  float* const rank = logs.data() + (n - 1) * 95 / 100;
  select_nth(logs.data(), rank, logs.data() + n);
  errors.p95 = static_cast<double>(*rank);
  const std::size_t kept = n - n / 1000;
  std::sort(squares.data(), squares.data() + n, Less{});
  double sum = 0;
  for (const float s : squares.sub(0, kept)) sum += static_cast<double>(s);
  errors.trimmed_relative_squared = sum / static_cast<double>(kept);
  out = errors;
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_METRICS_LUMINANCE_ERRORS_HPP
