// SPDX-License-Identifier: Apache-2.0
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
#ifndef NPSIM_METRICS_EDGE_ERRORS_HPP
#define NPSIM_METRICS_EDGE_ERRORS_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/metrics/detail/pixel_sums.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

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

#endif  // NPSIM_METRICS_EDGE_ERRORS_HPP
