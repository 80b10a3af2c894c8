// SPDX-License-Identifier: Apache-2.0
// Angles between estimated and true normals, as in table D.1 of the NPSim thesis: root mean square, mean, median, and
// the shares below 5, 11.5, 22.5 and 30 degrees (strictly).
//
// Only pixels count that the mask selects and where both vectors are finite and not zero ("no normal"); their lengths
// do not matter. The angle is atan2(|a x b|, a . b), which loses no digits for small or nearly opposite angles, in [0,
// 180]. Invariant: a normal that points the other way is 180 degrees off, not 0. The same bits for any number of
// threads. Error: 1e-10 relative on sums (see pixel_sums.hpp); each angle within 1e-13 degrees of that of the given
// vectors; the median is kept in float, 1e-7 relative. Cost: one pass and one selection. Memory: 4 bytes a pixel and
// the sums.
#ifndef NPSIM_METRICS_NORMAL_ERRORS_HPP
#define NPSIM_METRICS_NORMAL_ERRORS_HPP

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/metrics/detail/pixel_sums.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr std::array<double, 4> kNormalErrorLimits_deg = {5.0, 11.5, 22.5, 30.0};

struct NormalErrors {
  std::size_t truth_pixels = 0;  // selected, with a true normal
  std::size_t pixels = 0;        // of those, with an estimate: what the errors are of
  double rms_deg = 0;
  double mean_deg = 0;
  double median_deg = 0;
  std::array<double, 4> share_below{};  // of kNormalErrorLimits_deg
};

struct NormalErrorSums {
  std::size_t truth_pixels = 0;
  std::size_t pixels = 0;
  std::array<std::size_t, 4> below{};
  double angle_deg = 0;
  double squared_deg2 = 0;

  constexpr NormalErrorSums& operator+=(const NormalErrorSums& b) noexcept {
    truth_pixels += b.truth_pixels;
    pixels += b.pixels;
    for (std::size_t k = 0; k < below.size(); ++k) below[k] += b.below[k];
    angle_deg += b.angle_deg;
    squared_deg2 += b.squared_deg2;
    return *this;
  }
};

[[nodiscard]] constexpr std::size_t normal_errors_workspace_bytes(Shape shape) noexcept {
  return kWorkspaceAlignment + allocation_bytes<float>(shape.empty() ? 0 : shape.pixels()) +
         row_sums_workspace_bytes<NormalErrorSums>(shape);
}

namespace metrics_detail {

[[nodiscard]] inline bool is_direction(const Vec3f& n) noexcept { return is_finite(n) && n != Vec3f{}; }

[[nodiscard]] inline double angle_deg(const Vec3f& a, const Vec3f& b) noexcept {
  constexpr double kDegrees = 57.295779513082320877;
  const Vec3d p = vec_cast<double>(a);
  const Vec3d q = vec_cast<double>(b);
  return kDegrees * std::atan2(length(cross(p, q)), dot(p, q));
}

}  // namespace metrics_detail

// estimate and truth: one shape; mask: that shape, or empty. `out` is written on success only.
template <class Executor>
[[nodiscard]] Status normal_errors(ImageView<const Vec3f> estimate, ImageView<const Vec3f> truth,
                                   ImageView<const std::uint8_t> mask, NormalErrors& out, Workspace& workspace,
                                   Executor& executor) noexcept {
  const Shape shape = truth.shape();
  if (truth.empty()) return {StatusCode::no_valid_input, "normal_errors: the true normals are empty"};
  if (estimate.shape() != shape || (!mask.empty() && mask.shape() != shape)) {
    return {StatusCode::shape_mismatch, "normal_errors: estimate, truth and mask must have one shape"};
  }
  const WorkspaceScope scope(workspace);
  ImageView<float> angles;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, angles));
  NormalErrorSums sums;
  NPSIM_RETURN_IF_ERROR(
      metrics_detail::sum_rows(shape.height, sums, workspace, executor, [&](NormalErrorSums& sum, int y) {
        for (int x = 0; x < shape.width; ++x) {
          angles(x, y) = std::numeric_limits<float>::quiet_NaN();
          if (!metrics_detail::selected(mask, x, y) || !metrics_detail::is_direction(truth(x, y))) continue;
          ++sum.truth_pixels;
          if (!metrics_detail::is_direction(estimate(x, y))) continue;
          const double angle = metrics_detail::angle_deg(estimate(x, y), truth(x, y));
          ++sum.pixels;
          sum.angle_deg += angle;
          sum.squared_deg2 += angle * angle;
          for (std::size_t k = 0; k < sum.below.size(); ++k) {
            sum.below[k] += angle < kNormalErrorLimits_deg[k] ? 1U : 0U;
          }
          angles(x, y) = static_cast<float>(angle);
        }
      }));
  if (sums.pixels == 0) {
    return {StatusCode::no_valid_input, "normal_errors: no selected pixel has both a true normal and an estimate"};
  }
  const auto n = static_cast<double>(sums.pixels);
  NormalErrors errors;
  errors.truth_pixels = sums.truth_pixels;
  errors.pixels = sums.pixels;
  errors.rms_deg = std::sqrt(sums.squared_deg2 / n);
  errors.mean_deg = sums.angle_deg / n;
  errors.median_deg = metrics_detail::median(angles.pixels());
  for (std::size_t k = 0; k < errors.share_below.size(); ++k) {
    errors.share_below[k] = static_cast<double>(sums.below[k]) / n;
  }
  out = errors;
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_METRICS_NORMAL_ERRORS_HPP
