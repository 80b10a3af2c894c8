// SPDX-License-Identifier: Apache-2.0
// How far estimated geometry is from the true one: depth, normals, edges.
#ifndef NPSIM_METRICS_GEOMETRY_ERRORS_HPP
#define NPSIM_METRICS_GEOMETRY_ERRORS_HPP

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
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/metrics/detail/pixel_sums.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

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

// Angles between estimated and true normals, as in table D.1 of the NPSim thesis: root mean square, mean, median, and
// the shares below 5, 11.5, 22.5 and 30 degrees (strictly).
//
// Only pixels count that the mask selects and where both vectors are finite and not zero ("no normal"); their lengths
// do not matter. The angle is atan2(|a x b|, a . b), which loses no digits for small or nearly opposite angles, in [0,
// 180]. Invariant: a normal that points the other way is 180 degrees off, not 0. The same bits for any number of
// threads. Error: 1e-10 relative on sums (see pixel_sums.hpp); each angle within 1e-13 degrees of that of the given
// vectors; the median is kept in float, 1e-7 relative. Cost: one pass and one selection. Memory: 4 bytes a pixel and
// the sums.

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

// Where a depth map has occlusion edges, how well they are found, and where their neighbourhood is, for errors of depth
// there. One definition serves true and estimated depth, so that they compare.
//
// depth_edges: let w = 1/z and let a step be the difference of w between neighbours along a row or a column; on a plane
// all steps of a row are equal, however grazing. A step s between two pixels is an edge when
//   |s| and both |s - a| and |s - b| exceed min_step times the larger of the two w, where a and b are the steps
//     reach_px before and after: neither of the two surfaces, continued, explains the step (a crease does not pass, nor
//     does a plane);
//   it is the largest of its neighbours of the same sign along that row or column, the last among equals.
// The edge pixel is the nearer of the two: the rim of what occludes. A step from z to r z is 1 - 1/r of the larger w.
// An edge that is smeared over some pixels is found in its middle while its steepest step passes.
// Pixels that the mask leaves out count as missing. A step to or from a missing pixel is not known and is no edge;
// where a or b is not known, its condition does not apply.
//
// edge_errors compares two edge masks in the manner of the depth boundary errors of iBims-1 (Koch et al., ECCV
// workshops 2018). With D the largest distance that is told apart:
//   accuracy      mean over the estimated edge pixels of min(D, distance to the nearest true one): edges that are off,
//                 or that do not exist
//   completeness  mean over the true edge pixels of min(D, distance to the nearest estimated one): edges that are
//                 missed
// Distances are Euclidean between pixel centres. Unlike there, an estimated edge far from any true one counts with D
// instead of being left out. An estimate without any edge has D for both.
// mark_near marks the square of 2 radius + 1 pixels round every edge pixel: depth_errors with that mask is the error at
// edges. mask_overlap counts what two masks share, for the hit rate of a map of uncertain depth on true edges.
//
// Invariant: equal masks have errors of 0. The same bits for any number of threads.
// Error: edges are exact in double from the given depths; distances 1e-10 relative.
// Cost: four steps a pixel and eight more where one is large; (2 D + 1)^2 reads per edge pixel; (2 radius + 1)^2 per
// pixel. Memory: the sums.

struct DepthEdgeParams {
  float min_step = 0.05F;  // of inverse depth, relative, in (0, 1): 0.05 is 10 m before 10.5 m
  int reach_px = 4;        // 1..64; more than half of the width over which edges are smeared
};

namespace metrics_detail {

struct DepthSteps {
  DepthEdgeParams params;
  ImageView<const float> depth;
  ImageView<const std::uint8_t> mask;

  [[nodiscard]] bool known(int x, int y) const noexcept {
    return depth.contains(x, y) && selected(mask, x, y) && is_valid_depth(depth(x, y));
  }
  [[nodiscard]] double inverse(int x, int y) const noexcept { return 1.0 / static_cast<double>(depth(x, y)); }

  // The step from (x, y) to (x + dx, y + dy); false where it is not known.
  [[nodiscard]] bool step(int x, int y, int dx, int dy, double& s) const noexcept {
    if (!known(x, y) || !known(x + dx, y + dy)) return false;
    s = inverse(x + dx, y + dy) - inverse(x, y);
    return true;
  }

  // Whether the step from (x, y) along (dx, dy), which is (1, 0) or (0, 1), is an edge, and if so which pixel is
  // nearer.
  [[nodiscard]] bool edge(int x, int y, int dx, int dy, bool& first_is_nearer) const noexcept {
    double s = 0;
    if (!step(x, y, dx, dy, s)) return false;
    first_is_nearer = s < 0;
    const double least =
        static_cast<double>(params.min_step) * (first_is_nearer ? inverse(x, y) : inverse(x + dx, y + dy));
    if (!(std::fabs(s) > least)) return false;
    for (int side = -1; side <= 1; side += 2) {
      double next = 0;
      if (step(x + side * dx, y + side * dy, dx, dy, next) && (next < 0) == (s < 0)) {
        if (side < 0 ? std::fabs(next) > std::fabs(s) : std::fabs(next) >= std::fabs(s)) return false;
      }
      double far = 0;
      const int reach = side * params.reach_px;
      if (step(x + reach * dx, y + reach * dy, dx, dy, far) && !(std::fabs(s - far) > least)) return false;
    }
    return true;
  }

  [[nodiscard]] bool edge_pixel(int x, int y) const noexcept {
    if (!known(x, y)) return false;
    bool first = false;
    return (edge(x, y, 1, 0, first) && first) || (edge(x, y, 0, 1, first) && first) ||
           (edge(x - 1, y, 1, 0, first) && !first) || (edge(x, y - 1, 0, 1, first) && !first);
  }
};

}  // namespace metrics_detail

// edges: 1 on edge pixels, else 0; the shape of depth, as is the mask unless it is empty.
template <class Executor>
[[nodiscard]] Status depth_edges(const DepthEdgeParams& params, ImageView<const float> depth,
                                 ImageView<const std::uint8_t> mask, ImageView<std::uint8_t> edges,
                                 Executor& executor) noexcept {
  const Shape shape = depth.shape();
  if (depth.empty()) return {StatusCode::no_valid_input, "depth_edges: the depth image is empty"};
  if (edges.empty() || edges.shape() != shape || (!mask.empty() && mask.shape() != shape)) {
    return {StatusCode::shape_mismatch, "depth_edges: depth, mask and edges must have one shape"};
  }
  if (!(params.min_step > 0.0F && params.min_step < 1.0F) || params.reach_px < 1 || params.reach_px > 64) {
    return {StatusCode::invalid_argument, "depth_edges: min_step between 0 and 1, reach in 1..64"};
  }
  const metrics_detail::DepthSteps steps{params, depth, mask};
  executor.for_chunks(static_cast<std::size_t>(shape.height), kMetricsRows, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) edges(x, y) = steps.edge_pixel(x, y) ? 1 : 0;
    }
  });
  return {};
}

struct EdgeErrorParams {
  int max_distance_px = 10;  // 1..64
};

struct EdgeErrors {
  std::size_t truth_pixels = 0;
  std::size_t pixels = 0;  // estimated
  double accuracy_px = 0;
  double completeness_px = 0;
};

struct MaskOverlap {
  std::size_t first = 0;
  std::size_t second = 0;
  std::size_t both = 0;

  constexpr MaskOverlap& operator+=(const MaskOverlap& b) noexcept {
    first += b.first;
    second += b.second;
    both += b.both;
    return *this;
  }
};

struct EdgeDistanceSums {
  std::size_t truth_pixels = 0;
  std::size_t pixels = 0;
  double to_truth_px = 0;
  double to_estimate_px = 0;

  constexpr EdgeDistanceSums& operator+=(const EdgeDistanceSums& b) noexcept {
    truth_pixels += b.truth_pixels;
    pixels += b.pixels;
    to_truth_px += b.to_truth_px;
    to_estimate_px += b.to_estimate_px;
    return *this;
  }
};

[[nodiscard]] constexpr std::size_t edge_errors_workspace_bytes(const EdgeErrorParams&, Shape shape) noexcept {
  return kWorkspaceAlignment + row_sums_workspace_bytes<EdgeDistanceSums>(shape);
}
[[nodiscard]] constexpr std::size_t mask_overlap_workspace_bytes(Shape shape) noexcept {
  return kWorkspaceAlignment + row_sums_workspace_bytes<MaskOverlap>(shape);
}

namespace metrics_detail {

// From (x, y) to the nearest pixel of the mask, at most `most`.
[[nodiscard]] inline double distance_px(ImageView<const std::uint8_t> mask, int x, int y, int most) noexcept {
  int nearest = most * most;
  for (int j = -most; j <= most; ++j) {
    if (y + j < 0 || y + j >= mask.height() || j * j >= nearest) continue;
    const std::uint8_t* row = mask.row(y + j);
    for (int i = -most; i <= most; ++i) {
      if (x + i < 0 || x + i >= mask.width() || row[x + i] == 0) continue;
      const int squared = i * i + j * j;
      nearest = squared < nearest ? squared : nearest;
    }
  }
  return std::sqrt(static_cast<double>(nearest));
}

}  // namespace metrics_detail

// estimate and truth: masks of edge pixels of one shape. `out` is written on success only.
template <class Executor>
[[nodiscard]] Status edge_errors(const EdgeErrorParams& params, ImageView<const std::uint8_t> estimate,
                                 ImageView<const std::uint8_t> truth, EdgeErrors& out, Workspace& workspace,
                                 Executor& executor) noexcept {
  const Shape shape = truth.shape();
  if (truth.empty()) return {StatusCode::no_valid_input, "edge_errors: the mask of true edges is empty"};
  if (estimate.shape() != shape) return {StatusCode::shape_mismatch, "edge_errors: the masks differ in shape"};
  if (params.max_distance_px < 1 || params.max_distance_px > 64) {
    return {StatusCode::invalid_argument, "edge_errors: the largest distance must lie in 1..64"};
  }
  const int most = params.max_distance_px;
  EdgeDistanceSums sums;
  NPSIM_RETURN_IF_ERROR(
      metrics_detail::sum_rows(shape.height, sums, workspace, executor, [&](EdgeDistanceSums& sum, int y) {
        for (int x = 0; x < shape.width; ++x) {
          if (estimate(x, y) != 0) {
            ++sum.pixels;
            sum.to_truth_px += metrics_detail::distance_px(truth, x, y, most);
          }
          if (truth(x, y) != 0) {
            ++sum.truth_pixels;
            sum.to_estimate_px += metrics_detail::distance_px(estimate, x, y, most);
          }
        }
      }));
  if (sums.truth_pixels == 0) return {StatusCode::no_valid_input, "edge_errors: there is no true edge"};
  out.truth_pixels = sums.truth_pixels;
  out.pixels = sums.pixels;
  out.accuracy_px = sums.pixels > 0 ? sums.to_truth_px / static_cast<double>(sums.pixels) : static_cast<double>(most);
  out.completeness_px = sums.to_estimate_px / static_cast<double>(sums.truth_pixels);
  return {};
}

// near: 1 within radius_px (0..64) of a pixel of the mask along rows and columns, else 0. Not the same memory as mask.
template <class Executor>
[[nodiscard]] Status mark_near(ImageView<const std::uint8_t> mask, int radius_px, ImageView<std::uint8_t> near,
                               Executor& executor) noexcept {
  const Shape shape = mask.shape();
  if (mask.empty()) return {StatusCode::no_valid_input, "mark_near: the mask is empty"};
  if (near.empty() || near.shape() != shape)
    return {StatusCode::shape_mismatch, "mark_near: the masks differ in shape"};
  if (radius_px < 0 || radius_px > 64) return {StatusCode::invalid_argument, "mark_near: radius must lie in 0..64"};
  const auto any = [&](int x, int y) {
    for (int j = y - radius_px; j <= y + radius_px; ++j) {
      for (int i = x - radius_px; i <= x + radius_px; ++i) {
        if (mask.contains(i, j) && mask(i, j) != 0) return true;
      }
    }
    return false;
  };
  executor.for_chunks(static_cast<std::size_t>(shape.height), kMetricsRows, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) near(x, y) = any(x, y) ? 1 : 0;
    }
  });
  return {};
}

// Pixels of the first mask, of the second, and of both.
template <class Executor>
[[nodiscard]] Status mask_overlap(ImageView<const std::uint8_t> first, ImageView<const std::uint8_t> second,
                                  MaskOverlap& out, Workspace& workspace, Executor& executor) noexcept {
  if (first.empty() || first.shape() != second.shape()) {
    return {StatusCode::shape_mismatch, "mask_overlap: the masks must not be empty and must have one shape"};
  }
  return metrics_detail::sum_rows(first.height(), out, workspace, executor, [&](MaskOverlap& sum, int y) {
    for (int x = 0; x < first.width(); ++x) {
      const bool a = first(x, y) != 0;
      const bool b = second(x, y) != 0;
      sum += {a ? std::size_t{1} : 0, b ? std::size_t{1} : 0, a && b ? std::size_t{1} : 0};
    }
  });
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_METRICS_GEOMETRY_ERRORS_HPP
