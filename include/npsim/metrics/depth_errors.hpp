// SPDX-License-Identifier: Apache-2.0
// How far an estimated depth map is from the true one: the errors of Eigen et al. (NeurIPS 2014) and their medians.
//
// Only pixels count that the mask selects and where both depths are valid. With e the estimate, t the truth and
// d = log(e / t), the means running over those n pixels:
//   AbsRel = mean |e - t| / t      RMSE = sqrt(mean (e - t)^2)      RMSE log = sqrt(mean d^2)
//   SI-log = sqrt(mean d^2 - (mean d)^2), the spread of d: a wrong scale of the whole map does not count
//   delta_k = share of pixels with max(e / t, t / e) < 1.25^k (strictly), k = 1, 2, 3
// Invariant: an exact estimate has errors of 0 and shares of 1. The same bits for any number of threads.
// Error: 1e-10 relative (see pixel_sums.hpp; logarithm and root are the platform's, within an ulp), but 1e-7 absolute
// for SI-log, whose moments are taken about the first pixel's d, and 1e-7 relative for the median, which is kept in
// float. Cost: one pass and one selection. Memory: 4 bytes a pixel and the sums.
#ifndef NPSIM_METRICS_DEPTH_ERRORS_HPP
#define NPSIM_METRICS_DEPTH_ERRORS_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/metrics/detail/pixel_sums.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct DepthErrors {
  std::size_t truth_pixels = 0;  // selected, with a true depth
  std::size_t pixels = 0;        // of those, with an estimate: what the errors are of
  double abs_rel = 0;
  double median_abs_rel = 0;
  double rmse_m = 0;
  double rmse_log = 0;
  double si_log = 0;
  double mean_log = 0;            // mean d: exp of it is the factor by which the estimate is too far
  std::array<double, 3> delta{};  // shares below 1.25, 1.25^2, 1.25^3
};

struct DepthErrorSums {
  std::size_t truth_pixels = 0;
  std::size_t pixels = 0;
  std::array<std::size_t, 3> within{};
  double relative = 0;
  double squared_m2 = 0;
  double log_squared = 0;
  double log_offset = 0;          // sum of d - shift
  double log_offset_squared = 0;  // sum of (d - shift)^2

  constexpr DepthErrorSums& operator+=(const DepthErrorSums& b) noexcept {
    truth_pixels += b.truth_pixels;
    pixels += b.pixels;
    for (std::size_t k = 0; k < within.size(); ++k) within[k] += b.within[k];
    relative += b.relative;
    squared_m2 += b.squared_m2;
    log_squared += b.log_squared;
    log_offset += b.log_offset;
    log_offset_squared += b.log_offset_squared;
    return *this;
  }
};

[[nodiscard]] constexpr std::size_t depth_errors_workspace_bytes(Shape shape) noexcept {
  return kWorkspaceAlignment + allocation_bytes<float>(shape.empty() ? 0 : shape.pixels()) +
         row_sums_workspace_bytes<DepthErrorSums>(shape);
}

namespace metrics_detail {

[[nodiscard]] inline double log_ratio(float estimate, float truth) noexcept {
  return std::log(static_cast<double>(estimate) / static_cast<double>(truth));
}

// log(e / t) of the first pixel that counts; 0 where there is none.
[[nodiscard]] inline double first_log_ratio(ImageView<const float> estimate, ImageView<const float> truth,
                                            ImageView<const std::uint8_t> mask) noexcept {
  for (int y = 0; y < truth.height(); ++y) {
    for (int x = 0; x < truth.width(); ++x) {
      if (selected(mask, x, y) && is_valid_depth(truth(x, y)) && is_valid_depth(estimate(x, y))) {
        return log_ratio(estimate(x, y), truth(x, y));
      }
    }
  }
  return 0;
}

inline void add_depth_error(float estimate, float truth, double shift, DepthErrorSums& sums, float& relative) noexcept {
  const auto e = static_cast<double>(estimate);
  const auto t = static_cast<double>(truth);
  const double off = std::fabs(e - t);
  const double d = log_ratio(estimate, truth);
  ++sums.pixels;
  sums.relative += off / t;
  sums.squared_m2 += off * off;
  sums.log_squared += d * d;
  sums.log_offset += d - shift;
  sums.log_offset_squared += (d - shift) * (d - shift);
  const double ratio = std::max(e / t, t / e);
  double limit = 1.25;
  for (std::size_t& within : sums.within) {
    within += ratio < limit ? 1U : 0U;
    limit *= 1.25;
  }
  relative = static_cast<float>(off / t);
}

}  // namespace metrics_detail

// estimate and truth: z-depth in metres, one shape; mask: that shape, or empty. `out` is written on success only.
template <class Executor>
[[nodiscard]] Status depth_errors(ImageView<const float> estimate, ImageView<const float> truth,
                                  ImageView<const std::uint8_t> mask, DepthErrors& out, Workspace& workspace,
                                  Executor& executor) noexcept {
  const Shape shape = truth.shape();
  if (truth.empty()) return {StatusCode::no_valid_input, "depth_errors: the true depth is empty"};
  if (estimate.shape() != shape || (!mask.empty() && mask.shape() != shape)) {
    return {StatusCode::shape_mismatch, "depth_errors: estimate, truth and mask must have one shape"};
  }
  const WorkspaceScope scope(workspace);
  ImageView<float> relative;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, relative));
  const double shift = metrics_detail::first_log_ratio(estimate, truth, mask);
  DepthErrorSums sums;
  NPSIM_RETURN_IF_ERROR(
      metrics_detail::sum_rows(shape.height, sums, workspace, executor, [&](DepthErrorSums& sum, int y) {
        for (int x = 0; x < shape.width; ++x) {
          relative(x, y) = std::numeric_limits<float>::quiet_NaN();
          if (!metrics_detail::selected(mask, x, y) || !is_valid_depth(truth(x, y))) continue;
          ++sum.truth_pixels;
          if (!is_valid_depth(estimate(x, y))) continue;
          metrics_detail::add_depth_error(estimate(x, y), truth(x, y), shift, sum, relative(x, y));
        }
      }));
  if (sums.pixels == 0) {
    return {StatusCode::no_valid_input, "depth_errors: no selected pixel has both a true depth and an estimate"};
  }
  const auto n = static_cast<double>(sums.pixels);
  DepthErrors errors;
  errors.truth_pixels = sums.truth_pixels;
  errors.pixels = sums.pixels;
  errors.abs_rel = sums.relative / n;
  errors.median_abs_rel = metrics_detail::median(relative.pixels());
  errors.rmse_m = std::sqrt(sums.squared_m2 / n);
  errors.rmse_log = std::sqrt(sums.log_squared / n);
  const double offset = sums.log_offset / n;
  errors.si_log = std::sqrt(std::max(0.0, sums.log_offset_squared / n - offset * offset));
  errors.mean_log = shift + offset;
  for (std::size_t k = 0; k < errors.delta.size(); ++k) errors.delta[k] = static_cast<double>(sums.within[k]) / n;
  out = errors;
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_METRICS_DEPTH_ERRORS_HPP
