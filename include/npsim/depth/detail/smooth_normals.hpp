// SPDX-License-Identifier: Apache-2.0
// Smooths normals within surfaces, for normals that were derived from measured depth and carry its noise.
//
// Edge-avoiding a-trous filter (Dammertz et al., HPG 2010): iteration i takes 5 x 5 taps 2^i pixels apart with B3-spline
// weights. A tap counts when it has the centre's label, and the less the more its depth differs, relative to the depth;
// its normal does not matter, because noise in normals is what is to be removed. The sum is normalised.
// Invariant: equal normals stay equal; nothing crosses a label border; a pixel without a normal gets none and gives none.
// Cost: 25 taps per pixel and iteration. Memory: one image.
#ifndef NPSIM_DEPTH_DETAIL_SMOOTH_NORMALS_HPP
#define NPSIM_DEPTH_DETAIL_SMOOTH_NORMALS_HPP

#include <cstddef>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct SmoothNormalsParams {
  int iterations = 3;         // footprint 29 px; 0 switches it off; at most 8
  float depth_sigma = 0.05F;  // relative depth difference at which a tap counts half
};

[[nodiscard]] constexpr std::size_t smooth_normals_workspace_bytes(const SmoothNormalsParams&, Shape shape) noexcept {
  return kWorkspaceAlignment + allocation_bytes<Vec3f>(shape.pixels());
}

namespace depth_detail {

[[nodiscard]] inline Vec3f smoothed_normal(const SmoothNormalsParams& params, ImageView<const float> depth,
                                           ImageView<const Label> labels, ImageView<const Vec3f> normals, int x, int y,
                                           int step) noexcept {
  constexpr float kSpline[5] = {1.0F / 16, 4.0F / 16, 6.0F / 16, 4.0F / 16, 1.0F / 16};
  const float z = depth(x, y);
  if (!is_valid_depth(z) || normals(x, y) == Vec3f{}) return normals(x, y);
  const float scale = 1.0F / (params.depth_sigma * z);
  Vec3f sum;
  for (int j = -2; j <= 2; ++j) {
    for (int i = -2; i <= 2; ++i) {
      const int qx = x + i * step;
      const int qy = y + j * step;
      if (!normals.contains(qx, qy) || !is_valid_depth(depth(qx, qy))) continue;
      if (!labels.empty() && labels(qx, qy) != labels(x, y)) continue;
      const float off = (depth(qx, qy) - z) * scale;
      sum += normals(qx, qy) * (kSpline[i + 2] * kSpline[j + 2] / (1.0F + off * off));
    }
  }
  const Vec3f unit = normalized(sum);
  return unit == Vec3f{} ? normals(x, y) : unit;
}

}  // namespace depth_detail

// Filters `normals` (unit, or zero for none) in place. labels may be empty.
template <class Executor>
[[nodiscard]] Status smooth_normals(const SmoothNormalsParams& params, ImageView<const float> depth,
                                    ImageView<const Label> labels, ImageView<Vec3f> normals, Workspace& workspace,
                                    Executor& executor) noexcept {
  const Shape shape = normals.shape();
  if (depth.shape() != shape || (!labels.empty() && labels.shape() != shape)) {
    return {StatusCode::shape_mismatch, "smooth_normals: depth, labels and normals must have one shape"};
  }
  if (params.iterations < 0 || params.iterations > 8 || !(params.depth_sigma > 0.0F)) {
    return {StatusCode::invalid_argument, "smooth_normals: iterations in 0..8, depth_sigma positive"};
  }
  const WorkspaceScope scope(workspace);
  ImageView<Vec3f> other;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, other));
  for (int i = 0; i < params.iterations; ++i) {
    const auto rows = static_cast<std::size_t>(shape.height);
    executor.for_chunks(rows, 8, [&](std::size_t begin, std::size_t end) {
      for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
        for (int x = 0; x < shape.width; ++x) {
          other(x, y) = depth_detail::smoothed_normal(params, depth, labels, normals, x, y, 1 << i);
        }
      }
    });
    executor.for_chunks(rows, 64, [&](std::size_t begin, std::size_t end) {
      for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
        for (int x = 0; x < shape.width; ++x) normals(x, y) = other(x, y);
      }
    });
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_SMOOTH_NORMALS_HPP
