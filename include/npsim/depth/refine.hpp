// SPDX-License-Identifier: Apache-2.0
// Normal-guided depth refinement, section 3.4.3: minimises the losses of loss_params.hpp over the depth of every pixel,
// by Gauss-Newton in log depth (gauss_newton.hpp, the default) or Adam (adam.hpp, the reference).
//
// Invariant: pixels without a usable depth (1e-3..1e5 m) come out as they went in; no other leaves a factor of 4 of its
// input. On a Status other than ok the output is untouched; the loss of the output is not above that of the input.
//
// Presets. thesis_refine_params(): its tangents, metric depth term in (d/80)^2, lambda (1, 5, 1). Those tangents are
// biased, so depth gets worse the better the loss is minimised: on a road with boxes between two walls, relative error
// .0185 -> .0332. The default takes perspective tangents and a relative depth term strong enough to hold what normals
// cannot know: .0185 -> .0162, normal error 61 -> 6 degrees. Where depth is far better than the normals (.0033, noise
// of 13 degrees in N) it still loses, .0052, against .0196 with the metric term and (1, 5, 1).
//
// Cost and memory: see the solvers, and 8 values per pixel for the problem.
#ifndef NPSIM_DEPTH_REFINE_HPP
#define NPSIM_DEPTH_REFINE_HPP

#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/refine/adam.hpp"
#include "npsim/depth/detail/refine/gauss_newton.hpp"
#include "npsim/depth/detail/refine/loss_params.hpp"
#include "npsim/depth/detail/refine/loss_problem.hpp"
#include "npsim/depth/detail/refine/params.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

[[nodiscard]] constexpr std::size_t refine_workspace_bytes(const RefineParams& params, Shape shape) noexcept {
  return kWorkspaceAlignment + loss_problem_bytes<float>(shape) +
         (params.solver == RefineSolver::adam ? adam_bytes(params.adam, shape) : gauss_newton_bytes(shape));
}


// output: the shape of the depth, may be the same memory. loss_curve: gets the total loss before each step and at the
// end, as far as it reaches; unused elements are left alone. Status not_finite if a loss is not finite.
// V: the batch; the result is the same for all.
template <class V = simd::F32, class Executor>
[[nodiscard]] Status refine_with_normals(const RefineParams& params, const LossInput<float>& input,
                                         ImageView<float> output, Span<float> loss_curve, RefineResult& result,
                                         Workspace& workspace, Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate_refine(params));
  LossParams loss = params.loss;
  loss.depth_unit_m = params.depth_scale_m;
  NPSIM_RETURN_IF_ERROR(depth_detail::validate_losses(loss, input));
  const Shape shape = input.depth_est.shape();
  if (output.empty() || output.shape() != shape) {
    return {StatusCode::shape_mismatch, "refine: output must have the shape of the depth"};
  }

  const WorkspaceScope scope(workspace);
  depth_detail::LossProblem<float> problem;
  ImageView<float> depth;
  RefineResult done;
  NPSIM_RETURN_IF_ERROR((depth_detail::prepare_losses<float, V>(loss, input, workspace, executor, problem)));
  if (params.solver == RefineSolver::adam) {
    NPSIM_RETURN_IF_ERROR(
        depth_detail::minimise_with_adam(params, problem, shape, depth, loss_curve, done, workspace, executor));
  } else {
    NPSIM_RETURN_IF_ERROR(depth_detail::minimise_with_gauss_newton<V>(params.gauss_newton, problem, shape, depth,
                                                                      loss_curve, done, workspace, executor));
  }
  const int width = shape.width;
  executor.for_chunks(
      static_cast<std::size_t>(shape.height), kLossChunkRows, [&, width](std::size_t begin, std::size_t end) {
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
          const float* before = input.depth_est.row(y);
          const float* refined = depth.row(y);
          float* out = output.row(y);
          for (int x = 0; x < width; x += V::lanes) {
            const int n = width - x < V::lanes ? width - x : V::lanes;
            const V given = V::load(before + x, n);
            select(depth_detail::usable_depth<float>(given), V::load(refined + x), given).store(out + x, n);
          }
        }
      });
  result = done;
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_REFINE_HPP
