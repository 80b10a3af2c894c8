// SPDX-License-Identifier: Apache-2.0
// The losses of normal-guided refinement with their gradient with respect to depth; losses.hpp has the equations.
//
// Invariant: each pixel gathers its gradient in a fixed order and sums go by row, so the result depends neither on the
// executor nor on the batch. Error of float against double, measured: losses 1e-7 relative, and 5e-7 where roundings do
// not average out because a few pixels, or equal ones, make up the loss; a residual below 1e-6 is rounding. Gradients
// 5e-7 of the largest; on grazing planes 6e-7, and 1e-6 where depth jumps between 1e-3 and 1e5 m. Where a handful of
// pixels make up the gradient, or a single normal, slopes may cancel with no larger one beside them: of 28,000 such
// images, in eight forms, 99 % were within 5e-6; the worst, all but stationary, 5.8e-4.
// Cost: one pass to prepare, one to evaluate (detail/refine/losses.hpp), and one each to copy depth and gradient.
// Memory: 9 values per pixel, and a row for every 16.
#ifndef NPSIM_DEPTH_LOSS_GRADIENT_HPP
#define NPSIM_DEPTH_LOSS_GRADIENT_HPP

#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/refine/losses.hpp"
#include "npsim/depth/losses.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

template <class T>
[[nodiscard]] constexpr std::size_t depth_losses_workspace_bytes(const LossParams&, Shape shape) noexcept {
  return kWorkspaceAlignment + depth_detail::loss_problem_bytes<T>(shape) +
         2 * allocation_bytes<T>(depth_detail::loss_plane_elements(shape));
}

namespace depth_detail {

// Row y of the plane to evaluate at: the depth where depth_est is usable, else 1. False if one of those is not usable.
template <class V, class T>
[[nodiscard]] bool fill_depth_row(ImageView<const T> depth_est, ImageView<const T> depth, ImageView<T> plane,
                                  int y) noexcept {
  using M = typename V::MaskType;
  const int width = y < depth.height() ? depth.width() : 0;
  const T* from = depth.row(width > 0 ? y : 0);
  const T* estimate = depth_est.row(width > 0 ? y : 0);
  M bad(false);
  for (int x = 0; x < static_cast<int>(plane.stride()); x += V::lanes) {
    const int at = x < width ? x : 0;
    const int n = width - x;
    const V z = load_at_most<V>(from + at, n);
    const M inside = usable_depth<T>(load_at_most<V>(estimate + at, n));
    bad = bad | (inside & ~usable_depth<T>(z));
    select(inside, z, V(T(1))).store(plane.row(y) + x);
  }
  return none(bad);
}

}  // namespace depth_detail

// depth: where to evaluate; pixels without a usable depth_est are ignored, others must be in 1e-3..1e5 m.
// gradient: dL/d(depth in metres), 0 where there is no depth; may be empty.
// V: the batch; the result is the same for all.
template <class T, class V = depth_detail::LossBatch<T>, class Executor>
[[nodiscard]] Status depth_losses(const LossParams& params, const LossInput<T>& input, ImageView<const T> depth,
                                  ImageView<T> gradient, LossValues& values, Workspace& workspace,
                                  Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(depth_detail::check_loss_input(input));
  const Shape shape = input.depth_est.shape();
  if (depth.empty() || depth.shape() != shape || (!gradient.empty() && gradient.shape() != shape)) {
    return {StatusCode::shape_mismatch, "depth_losses: depth and gradient must have the shape of depth_est"};
  }
  const WorkspaceScope scope(workspace);
  depth_detail::LossProblem<T> problem;
  ImageView<T> plane;
  ImageView<T> slope;
  NPSIM_RETURN_IF_ERROR((depth_detail::prepare_losses<T, V>(params, input, workspace, executor, problem)));
  NPSIM_RETURN_IF_ERROR(depth_detail::allocate_loss_plane(shape, workspace, plane));
  NPSIM_RETURN_IF_ERROR(depth_detail::allocate_loss_plane(shape, workspace, slope));
  const auto rows = static_cast<std::size_t>(shape.height);
  executor.for_chunks(rows + 1, depth_detail::kLossChunkRows, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y) {
      const bool good = depth_detail::fill_depth_row<V>(input.depth_est, depth, plane, static_cast<int>(y));
      if (y < rows) problem.row_depth[y] = good ? 0 : 1;
    }
  });
  for (const double bad : problem.row_depth) {
    if (bad != 0)
      return {StatusCode::not_finite, "depth_losses: depth is missing or out of range where depth_est is not"};
  }
  depth_detail::evaluate_losses<T, V>(problem, plane, slope, values, executor);
  executor.for_chunks(static_cast<std::size_t>(gradient.height()), depth_detail::kLossChunkRows,
                      [&](std::size_t begin, std::size_t end) {
                        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
                          for (int x = 0; x < gradient.width(); ++x) gradient(x, y) = slope(x, y);
                        }
                      });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_LOSS_GRADIENT_HPP
