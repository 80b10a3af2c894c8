// SPDX-License-Identifier: Apache-2.0
// What normal-guided refinement can be told, and what it tells: parameters, presets, result. refine.hpp does it.
#ifndef NPSIM_DEPTH_DETAIL_REFINE_PARAMS_HPP
#define NPSIM_DEPTH_DETAIL_REFINE_PARAMS_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/status.hpp"
#include "npsim/depth/detail/refine/loss_params.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

enum class RefineSolver : std::uint8_t { gauss_newton, adam };

struct AdamParams {
  int steps = 1000;    // section 3.4.3
  float rate = 1e-4F;  // section 3.4.3, per step, in units of depth_scale_m
  float beta1 = 0.9F;  // the paper's defaults, as in the framework that the thesis used
  float beta2 = 0.999F;
  float epsilon = 1e-8F;
};

struct GaussNewtonParams {
  int steps = 20;                   // outer steps at most
  float relative_decrease = 1e-3F;  // stop when a step lowers the loss by less than this share of it; 0: never
  float target_loss = 0;            // stop at or below it; inner iterations end when the model says it is reached
  int inner_steps = 20;             // conjugate gradient iterations per outer step at most
  float inner_decrease = 0.02F;     // end them when one lowers the model by less than this share of what all did
  int halvings = 8;                 // of a step that does not lower the loss, before giving up
  float grid_stiffness = 0.7F;      // of coarse grids, see multigrid.hpp
};

[[nodiscard]] constexpr LossParams default_refine_losses() noexcept {
  LossParams p;
  p.depth_term = DepthTerm::relative;
  p.lambda = kLambdaDefault;
  return p;
}

struct RefineParams {
  LossParams loss = default_refine_losses();  // its depth_unit_m is replaced by depth_scale_m
  AdamParams adam;
  float depth_scale_m = 80;
  // Adam stops when the loss fell, but by less than this share of itself, over the last stop_window steps; 0: never.
  float stop_relative_decrease = 1e-3F;
  int stop_window = 50;
  RefineSolver solver = RefineSolver::gauss_newton;
  GaussNewtonParams gauss_newton;
};

// The text as literally as a reading allows: its solver, its tangents, appendix B's lambda, no early stop.
[[nodiscard]] constexpr RefineParams thesis_refine_params() noexcept {
  RefineParams p;
  p.solver = RefineSolver::adam;
  p.loss = LossParams{};
  p.loss.tangents = TangentForm::thesis;
  p.loss.lambda = kLambdaThesis;
  p.stop_relative_decrease = 0;
  return p;
}

// Steps that the solver takes at most. A loss curve has one value more.
[[nodiscard]] constexpr int refine_max_steps(const RefineParams& params) noexcept {
  const int steps = params.solver == RefineSolver::adam ? params.adam.steps : params.gauss_newton.steps;
  return steps > 0 ? steps : 0;
}

// no_descent: no fraction of the last step lowered the loss, or all of Adam's together did not; what was reached before
// is the output, of Adam the input.
enum class StopReason : std::uint8_t { none, all_steps, small_decrease, target_reached, no_descent };

struct RefineResult {
  int steps = 0;  // taken
  StopReason reason = StopReason::none;
  LossValues first;     // of the input
  LossValues last;      // of the output
  int inner_steps = 0;  // conjugate gradient iterations in all
  int evaluations = 0;  // of the loss
};

[[nodiscard]] inline Status validate_refine(const RefineParams& p) noexcept {
  const auto in_range = [](float v, float low, float high) { return v >= low && v <= high; };  // false for NaN
  const auto bad = [](const char* what) { return Status(StatusCode::invalid_argument, what); };
  if (p.solver != RefineSolver::adam && p.solver != RefineSolver::gauss_newton) return bad("refine: unknown solver");
  if (p.adam.steps < 0 || p.adam.steps > 1000000) return bad("refine: steps must lie in 0..1000000");
  if (!in_range(p.adam.rate, 0.0F, 1.0F) || !in_range(p.adam.beta1, 0.0F, 0.99999F) ||
      !in_range(p.adam.beta2, 0.0F, 0.99999F) || !in_range(p.adam.epsilon, 1e-30F, 1.0F)) {
    return bad("refine: rate in 0..1, betas in 0..0.99999, epsilon in 1e-30..1");
  }
  if (!in_range(p.depth_scale_m, 1e-3F, 1e5F)) return bad("refine: depth_scale_m must lie in 1e-3..1e5");
  if (!in_range(p.stop_relative_decrease, 0.0F, 1.0F) || p.stop_window < 1) {
    return bad("refine: stop_relative_decrease in 0..1, stop_window at least 1");
  }
  const GaussNewtonParams& g = p.gauss_newton;
  if (g.steps < 0 || g.steps > 1000000 || g.inner_steps < 1 || g.inner_steps > 1000000 || g.halvings < 0 ||
      g.halvings > 64) {
    return bad("refine: Gauss-Newton steps in 0..1000000, inner_steps in 1..1000000, halvings in 0..64");
  }
  if (!in_range(g.inner_decrease, 0.0F, 1.0F) || !in_range(g.relative_decrease, 0.0F, 1.0F) ||
      !in_range(g.target_loss, 0.0F, 1e30F) || !in_range(g.grid_stiffness, 0.25F, 1.0F)) {
    return bad(
        "refine: inner_decrease and relative_decrease in 0..1, target_loss not negative, grid_stiffness in 0.25..1");
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_REFINE_PARAMS_HPP
