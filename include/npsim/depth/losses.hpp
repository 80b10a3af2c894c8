// SPDX-License-Identifier: Apache-2.0
// The losses of normal-guided refinement with their gradient with respect to depth. loss_params.hpp has the equations.
//
// Invariant: each pixel gathers its gradient in a fixed order and sums go by row, so the result does not depend on the
// executor. Error of float against double, measured on noisy scenes: losses 1e-7 relative, gradients 5e-7 of the
// largest; a residual below 1e-6 is rounding. Cost: one pass, about 90 operations per pixel (loss_kernel.hpp). Memory:
// 10 values per pixel.
#ifndef NPSIM_DEPTH_LOSSES_HPP
#define NPSIM_DEPTH_LOSSES_HPP

#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/loss_kernel.hpp"
#include "npsim/depth/loss_params.hpp"
#include "npsim/depth/loss_problem.hpp"
#include "npsim/simd/isa.hpp"

namespace npsim {
inline namespace v1 {

template <class T>
[[nodiscard]] constexpr std::size_t depth_losses_workspace_bytes(const LossParams&, Shape shape) noexcept {
  return kWorkspaceAlignment + loss_problem_bytes<T>(shape) + 2 * allocation_bytes<T>(loss_plane_elements(shape));
}

inline namespace NPSIM_ISA_NAMESPACE {

// depth: where to evaluate; pixels without a usable depth_est are ignored, others must be in 1e-3..1e5 m.
// gradient: dL/d(depth in metres), 0 where there is no depth; may be empty.
template <class T, class Executor>
[[nodiscard]] Status depth_losses(const LossParams& params, const LossInput<T>& input, ImageView<const T> depth,
                                  ImageView<T> gradient, LossValues& values, Workspace& workspace,
                                  Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(depth_detail::validate_losses(params, input));
  const Shape shape = input.depth_est.shape();
  if (depth.empty() || depth.shape() != shape || (!gradient.empty() && gradient.shape() != shape)) {
    return {StatusCode::shape_mismatch, "depth_losses: depth and gradient must have the shape of depth_est"};
  }
  const WorkspaceScope scope(workspace);
  depth_detail::LossProblem<T> problem;
  ImageView<T> plane;
  ImageView<T> slope;
  NPSIM_RETURN_IF_ERROR(depth_detail::prepare_losses(params, input, workspace, executor, problem));
  NPSIM_RETURN_IF_ERROR(depth_detail::allocate_loss_plane(shape, workspace, plane));
  NPSIM_RETURN_IF_ERROR(depth_detail::allocate_loss_plane(shape, workspace, slope));
  for (int y = 0; y <= shape.height; ++y) {
    for (int x = 0; x < plane.stride(); ++x) {
      const bool inside = x < shape.width && y < shape.height && depth_detail::has_depth(input.depth_est(x, y));
      plane.row(y)[x] = inside ? depth(x, y) : T(1);
      if (inside && !depth_detail::has_depth(depth(x, y))) {
        return {StatusCode::not_finite, "depth_losses: depth is missing or out of range where depth_est is not"};
      }
    }
  }
  depth_detail::evaluate_losses<T>(problem, plane, slope, values, executor);
  for (int y = 0; y < gradient.height(); ++y) {
    for (int x = 0; x < gradient.width(); ++x) gradient(x, y) = slope(x, y);
  }
  return {};
}

}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_DEPTH_LOSSES_HPP
