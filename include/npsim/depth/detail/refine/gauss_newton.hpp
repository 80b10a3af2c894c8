// SPDX-License-Identifier: Apache-2.0
// Gauss-Newton in log depth: the default solver of normal-guided refinement.
//
// Each outer step linearises the losses (gauss_newton_system.hpp), solves H step = -gradient by conjugate gradients
// preconditioned with a multigrid cycle (multigrid.hpp), loosely, and moves each depth to z e^step. A step that does
// not lower the loss, as loss_kernel.hpp evaluates it, is halved; when no fraction of it does, the system is damped and
// solved again, and after some such failures in a row the solver stops with what it had. So the loss never rises, and a
// divergent step costs time alone. Pixels at the end of their range whose gradient points outward are held there by the
// system, else one of them could spoil the step of all.
// The result does not depend on the batch or the executor.
//
// Invariant: no pixel leaves a factor of 4 of its input.
// Error: conjugate gradients reach a dense solution in double within 1e-3; the loss reached is the kernel's own.
// Convergence, on a generated street with lambda (1, 5, 1): one outer step of one or two inner ones goes below the loss
// of Adam's step 1000 with printed continuity, 512 to 1920 px wide. With unit tangents, whose pull fades across depth
// edges, it takes 5 to 11 steps of 5 to 10.
// With lambda (1, 1, 500) at 960x540 it passes Adam's step 1000 (.125, .138 on two streets) in 10 to 12 steps, then
// gains some 1 % a step: .116 and .124 at the cap of 20. Residuals saturate, so the minimum is a local one: on small
// images with noise of 13 degrees in the normals it ended up to 5 % above Adam's.
// Cost per pixel, on one AVX-512 core from memory: 7 ns an outer step (evaluation, linearisation, coarse levels, move)
// and 6 ns an inner one. Memory: 16 floats per pixel, and the problem's.
#ifndef NPSIM_DEPTH_DETAIL_REFINE_GAUSS_NEWTON_HPP
#define NPSIM_DEPTH_DETAIL_REFINE_GAUSS_NEWTON_HPP

#include <cmath>
#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/refine/conjugate_gradients.hpp"
#include "npsim/depth/detail/refine/loss_kernel.hpp"
#include "npsim/depth/detail/refine/loss_params.hpp"
#include "npsim/depth/detail/refine/loss_problem.hpp"
#include "npsim/depth/detail/refine/multigrid_levels.hpp"
#include "npsim/depth/detail/refine/params.hpp"
#include "npsim/depth/detail/refine/system.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

[[nodiscard]] constexpr std::size_t gauss_newton_bytes(Shape shape) noexcept {
  return multigrid_bytes(shape) + 3 * allocation_bytes<float>(loss_plane_elements(shape)) +
         5 * allocation_bytes<float>(grid_plane_elements(shape)) +
         allocation_bytes<double>(static_cast<std::size_t>(shape.height));
}

inline constexpr int kNewtonFailures = 3;  // steps in a row that no halving mends, each damped more than the last

namespace depth_detail {

// to = from e^(share step), within a factor of 4 of the estimate; pixels that have no equation stay.
template <class V, class Executor>
void take_step(const LossProblem<float>& problem, const GridLevel& level, ImageView<const float> from,
               const NewtonStep& step, float share, ImageView<float> to, Executor& executor) noexcept {
  const V by_direction(share * step.alpha);
  const V by_sum(share);
  executor.for_chunks(static_cast<std::size_t>(to.height()), kLossChunkRows, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < level.end(); x += V::lanes) {
        const V old = V::load(from.row(y) + x);
        const V estimate = V::load(problem.estimate.row(y) + x);
        V move = by_direction * V::load(step.direction.row(y) + x);
        if (!step.sum.empty()) move = fma(by_sum, V::load(step.sum.row(y) + x), move);
        move = simd::clamp(move, -8.0F, 8.0F);
        const V moved = min(max(old * simd::exp(move), estimate * V(1 / kDepthRange)), estimate * V(kDepthRange));
        const auto usable = (V::load(level.smoother.row(y) + x) > V(0.0F)) & (move == move);
        select(usable, moved, old).store(to.row(y) + x);
      }
    }
  });
}

// A plane whose padding is 1, for depth.
[[nodiscard]] inline Status allocate_depth_plane(Shape shape, Workspace& workspace, ImageView<float>& plane) noexcept {
  NPSIM_RETURN_IF_ERROR(allocate_loss_plane(shape, workspace, plane));
  for (int y = 0; y <= shape.height; ++y) {
    const std::ptrdiff_t begin = y < shape.height ? plane.stride() - kLossBlock : 0;
    for (std::ptrdiff_t x = begin; x < plane.stride(); ++x) plane.row(y)[x] = 1.0F;
  }
  return {};
}

// depth: gets the result, in the layout of the problem's planes.
template <class V, class Executor>
[[nodiscard]] Status minimise_with_gauss_newton(const GaussNewtonParams& params, LossProblem<float>& problem,
                                                Shape shape, ImageView<float>& depth, Span<float> loss_curve,
                                                RefineResult& done, Workspace& workspace, Executor& executor) noexcept {
  Multigrid grid;
  NewtonVectors v;
  ImageView<float> trial;
  ImageView<float> spare;
  ImageView<float> gradient;
  NPSIM_RETURN_IF_ERROR(allocate_multigrid(shape, workspace, grid));
  NPSIM_RETURN_IF_ERROR(allocate_depth_plane(shape, workspace, trial));
  NPSIM_RETURN_IF_ERROR(allocate_depth_plane(shape, workspace, spare));
  NPSIM_RETURN_IF_ERROR(allocate_loss_plane(shape, workspace, gradient));
  for (ImageView<float>* plane : {&v.rhs, &v.corrected, &v.direction, &v.image, &v.sum}) {
    NPSIM_RETURN_IF_ERROR(allocate_grid_plane(shape, workspace, *plane));
  }
  NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(shape.height), v.row_sums));
  depth = problem.estimate;

  const auto record = [&](int step) {
    done.steps = step;
    const auto index = static_cast<std::size_t>(step);
    if (index < loss_curve.size()) loss_curve[index] = static_cast<float>(done.last.total);
  };
  const auto stop = [&done](StopReason reason) {
    done.reason = reason;
    return Status();
  };
  evaluate_losses<float, V>(problem, depth, gradient, done.last, executor);
  done.evaluations = 1;
  if (!std::isfinite(done.last.total)) return {StatusCode::not_finite, "refine: the loss is not finite"};
  done.first = done.last;
  record(0);
  const GridLevel& level = grid.level[0];
  const SystemPlanes<float> system{level.wxx, level.wxy, level.wyy, level.diagonal, v.rhs};
  float damping = 0;
  int failures = 0;  // in a row
  for (int step = 0;;) {
    if (done.last.total <= static_cast<double>(params.target_loss)) return stop(StopReason::target_reached);
    if (step == params.steps) return stop(StopReason::all_steps);
    linearise<float, V>(problem, ImageView<const float>(depth), ImageView<const float>(gradient), damping, system,
                        executor);
    build_multigrid<V>(grid, params.grid_stiffness, executor);
    const double to_target = done.last.total - static_cast<double>(params.target_loss);
    const NewtonStep found =
        conjugate_gradients<V>(grid, params.inner_steps, static_cast<double>(params.inner_decrease),
                               to_target * static_cast<double>(problem.depth_count), v, executor);
    done.inner_steps += found.iterations;
    if (found.iterations == 0) return stop(StopReason::no_descent);
    LossValues values;
    bool lower = false;
    float share = 1.0F;
    for (int halving = 0; halving <= params.halvings && !lower; ++halving) {
      take_step<V>(problem, level, ImageView<const float>(depth), found, share, trial, executor);
      evaluate_losses<float, V>(problem, trial, gradient, values, executor);
      ++done.evaluations;
      lower = values.total < done.last.total;  // false for NaN
      share *= 0.5F;
    }
    if (!lower) {
      if (++failures > kNewtonFailures) return stop(StopReason::no_descent);
      damping = damping > 0.0F ? 8.0F * damping : 0.1F;
      evaluate_losses<float, V>(problem, depth, gradient, values, executor);  // the gradient, which trials overwrote
      ++done.evaluations;
      continue;
    }
    failures = 0;
    damping = damping > 0.01F ? 0.25F * damping : 0.0F;
    const double before = done.last.total;
    const ImageView<float> old = step == 0 ? spare : depth;  // the estimate stays as it is
    depth = trial;
    trial = old;
    done.last = values;
    record(++step);
    if (before - values.total < static_cast<double>(params.relative_decrease) * before) {
      return stop(StopReason::small_decrease);
    }
  }
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_REFINE_GAUSS_NEWTON_HPP
