// SPDX-License-Identifier: Apache-2.0
// Where a depth map has occlusion edges: one definition for true and for estimated depth, so that they compare.
//
// Let w = 1/z and let a step be the difference of w between neighbours along a row or a column; on a plane all steps of
// a row are equal, however grazing. A step s between two pixels is an edge when
//   |s| and both |s - a| and |s - b| exceed min_step times the larger of the two w, where a and b are the steps
//   reach_px
//     before and after: neither of the two surfaces, continued, explains the step (a crease does not pass, nor a
//     plane);
//   it is the largest of its neighbours of the same sign along that row or column, the last among equals.
// The edge pixel is the nearer of the two: the rim of what occludes. A step from z to r z is 1 - 1/r of the larger w.
// An edge that is smeared over some pixels is found in its middle while its steepest step passes.
// Pixels that the mask leaves out count as missing; a step to or from a missing pixel is not known, is no edge, and
// where a or b is not known that condition falls away.
// Cost: four steps a pixel and eight more where one is large. Memory: none. Error: exact in double from the given
// depths.
#ifndef NPSIM_METRICS_DEPTH_EDGES_HPP
#define NPSIM_METRICS_DEPTH_EDGES_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
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
    for (const int side : {-1, 1}) {
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

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_METRICS_DEPTH_EDGES_HPP
