// SPDX-License-Identifier: Apache-2.0
// Normal-guided refinement, section 3.4.3: its losses with their gradient, and how they are minimised.
#ifndef NPSIM_DEPTH_REFINE_HPP
#define NPSIM_DEPTH_REFINE_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/refine/linear_solver.hpp"
#include "npsim/depth/detail/refine/losses.hpp"
#include "npsim/depth/detail/refine/system.hpp"
#include "npsim/depth/losses.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

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

// Normal-guided depth refinement, section 3.4.3: minimises the losses of losses.hpp over the depth of every pixel, by
// Gauss-Newton in log depth (the default) or Adam (the reference).
//
// Invariant: pixels without a usable depth (1e-3..1e5 m) come out as they went in; no other leaves a factor of 4 of its
// input. On a Status other than ok the output is untouched; the loss of the output is not above that of the input. The
// result depends on neither the batch nor the executor.
//
// Presets. thesis_refine_params(): its tangents, metric depth term in (d/80)^2, lambda (1, 5, 1). Those tangents are
// biased, so depth gets worse the better the loss is minimised: on a road with boxes between two walls, relative error
// .0185 -> .0332. The default takes perspective tangents and a relative depth term strong enough to hold what normals
// cannot know: .0185 -> .0162, normal error 61 -> 6 degrees. Where depth is far better than the normals (.0033, noise
// of 13 degrees in N) it still loses, .0052, against .0196 with the metric term and (1, 5, 1).
//
// Gauss-Newton. Each outer step linearises the losses (detail/refine/system.hpp), solves H step = -gradient loosely
// (detail/refine/linear_solver.hpp) and moves each depth to z e^step. A step that does not lower the loss is halved;
// when no fraction of it does, the system is damped and solved again, and after some such failures in a row the solver
// stops with what it had. So the loss never rises, and a divergent step costs time alone. Pixels at the end of their
// range whose gradient points outward are held there by the system, else one of them could spoil the step of all.
// Convergence, on a generated street with lambda (1, 5, 1): one outer step of one or two inner ones goes below the loss
// of Adam's step 1000 with printed continuity, 512 to 1920 px wide. With unit tangents, whose pull fades across depth
// edges, it takes 5 to 11 steps of 5 to 10. With lambda (1, 1, 500) at 960x540 it passes Adam's step 1000 (.125, .138
// on two streets) in 10 to 12 steps, then gains some 1 % a step: .116 and .124 at the cap of 20. Residuals saturate, so
// the minimum is a local one: on small images with noise of 13 degrees in the normals it ended up to 5 % above Adam's.
// Cost per pixel, on one AVX-512 core from memory: 7 ns an outer step (evaluation, linearisation, coarse levels, move)
// and 6 ns an inner one. Memory: 23 floats per pixel.
//
// Adam (Kingma and Ba, ICLR 2015). The variable is x = d / depth_unit_m, and L_depth is measured in the same unit. With
// metres a rate of 1e-4 moves no depth by more than about 0.1 m in 1000 steps; with 80 it moves up to 8 m. A run that
// ends above the input's loss has the input as its output: its rate, which every pixel moves by at first, was too large
// for what was to be gained. Error: after 60 steps within a tenth of one step of the textbook in double.
// Cost: one evaluation of the losses and 15 operations per pixel and step. Memory: 11 floats per pixel.

enum class RefineSolver : std::uint8_t { gauss_newton, adam };

struct AdamParams {
  int steps = 1000;    // section 3.4.3
  float rate = 1e-4F;  // section 3.4.3, per step, in units of loss.depth_unit_m
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
  float grid_stiffness = 0.7F;      // of coarse grids, see detail/refine/linear_solver.hpp
};

[[nodiscard]] constexpr LossParams default_refine_losses() noexcept {
  LossParams p;
  p.depth_term = DepthTerm::relative;
  p.lambda = kLambdaDefault;
  return p;
}

struct RefineParams {
  LossParams loss = default_refine_losses();
  AdamParams adam;
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

[[nodiscard]] inline Status validate(const RefineParams& p) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(p.loss));
  const auto in_range = [](float v, float low, float high) { return v >= low && v <= high; };  // false for NaN
  const auto bad = [](const char* what) { return Status(StatusCode::invalid_argument, what); };
  if (p.solver != RefineSolver::adam && p.solver != RefineSolver::gauss_newton) return bad("refine: unknown solver");
  if (p.adam.steps < 0 || p.adam.steps > 1000000) return bad("refine: steps must lie in 0..1000000");
  if (!in_range(p.adam.rate, 0.0F, 1.0F) || !in_range(p.adam.beta1, 0.0F, 0.99999F) ||
      !in_range(p.adam.beta2, 0.0F, 0.99999F) || !in_range(p.adam.epsilon, 1e-30F, 1.0F)) {
    return bad("refine: rate in 0..1, betas in 0..0.99999, epsilon in 1e-30..1");
  }
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

namespace depth_detail {

[[nodiscard]] constexpr std::size_t adam_bytes(const AdamParams& params, Shape shape) noexcept {
  return 4 * allocation_bytes<float>(loss_plane_elements(shape)) +
         allocation_bytes<double>(static_cast<std::size_t>(params.steps > 0 ? params.steps : 0) + 1);
}
[[nodiscard]] constexpr std::size_t gauss_newton_bytes(Shape shape) noexcept {
  return multigrid_bytes(shape) + 3 * allocation_bytes<float>(loss_plane_elements(shape)) +
         5 * allocation_bytes<float>(grid_plane_elements(shape)) +
         allocation_bytes<double>(static_cast<std::size_t>(shape.height));
}

}  // namespace depth_detail

[[nodiscard]] constexpr std::size_t refine_workspace_bytes(const RefineParams& params, Shape shape) noexcept {
  return kWorkspaceAlignment + depth_detail::loss_problem_bytes<float>(shape) +
         (params.solver == RefineSolver::adam ? depth_detail::adam_bytes(params.adam, shape)
                                              : depth_detail::gauss_newton_bytes(shape));
}

namespace depth_detail {

struct AdamState {
  ImageView<float> depth, gradient, first_moment, second_moment;
};

// One step for the rows [begin, end); `step` counts from 1. The padding moves by 0 like every pixel without a gradient.
inline void adam_rows(const RefineParams& params, const LossProblem<float>& problem, const AdamState& s, int step,
                      int begin, int end) noexcept {
  using F = simd::F32;
  const double bias1 = 1.0 - std::pow(static_cast<double>(params.adam.beta1), step);
  const double bias2 = 1.0 - std::pow(static_cast<double>(params.adam.beta2), step);
  const F scale(params.loss.depth_unit_m);
  const F beta1(params.adam.beta1);
  const F beta2(params.adam.beta2);
  const F rest1(1.0F - params.adam.beta1);
  const F rest2(1.0F - params.adam.beta2);
  const F rate(static_cast<float>(static_cast<double>(params.adam.rate) / bias1));
  const F unbias2(static_cast<float>(1.0 / std::sqrt(bias2)));
  const F epsilon(params.adam.epsilon);
  for (int y = begin; y < end; ++y) {
    float* depth = s.depth.row(y);
    float* m = s.first_moment.row(y);
    float* v = s.second_moment.row(y);
    const float* gradient = s.gradient.row(y);
    const float* estimate = problem.estimate.row(y);
    const int padded = static_cast<int>(s.depth.stride()) - kLossBlock;
    for (int x = 0; x < padded; x += F::lanes) {
      const F g = F::load(gradient + x) * scale;
      const F m_new = beta1 * F::load(m + x) + rest1 * g;
      const F v_new = beta2 * F::load(v + x) + rest2 * (g * g);
      const F move = rate * m_new / (sqrt(v_new) * unbias2 + epsilon);
      const F before = F::load(estimate + x);
      const F old = F::load(depth + x);
      F d = min(max(old - move * scale, before * 0.25F), before * 4.0F);
      d = select(simd::is_nan(move), old, d);  // a gradient that overflows moves nothing
      m_new.store(m + x);
      v_new.store(v + x);
      d.store(depth + x);
    }
  }
}

// depth: gets the result, in the layout of the problem's planes.
template <class Executor>
[[nodiscard]] Status minimise_with_adam(const RefineParams& params, LossProblem<float>& problem, Shape shape,
                                        ImageView<float>& depth, Span<LossValues> loss_curve, RefineResult& done,
                                        Workspace& workspace, Executor& executor) noexcept {
  AdamState s;
  Span<double> history;
  for (ImageView<float>* plane : {&s.depth, &s.gradient, &s.first_moment, &s.second_moment}) {
    NPSIM_RETURN_IF_ERROR(allocate_loss_plane(shape, workspace, *plane));
  }
  NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(params.adam.steps) + 1, history));
  for (std::size_t i = 0; i < loss_plane_elements(shape); ++i) {
    s.depth.data()[i] = problem.estimate.data()[i];
    s.gradient.data()[i] = s.first_moment.data()[i] = s.second_moment.data()[i] = 0;
  }
  depth = s.depth;

  const auto rows = static_cast<std::size_t>(shape.height);
  for (int step = 0;; ++step) {
    const auto index = static_cast<std::size_t>(step);
    evaluate_losses<float>(problem, s.depth, s.gradient, done.last, executor);
    ++done.evaluations;
    if (!std::isfinite(done.last.total)) return {StatusCode::not_finite, "refine: the loss is not finite"};
    if (step == 0) done.first = done.last;
    history[index] = done.last.total;
    if (index < loss_curve.size()) loss_curve[index] = done.last;
    done.steps = step;
    if (step == params.adam.steps) {
      done.reason = StopReason::all_steps;
    } else if (params.stop_relative_decrease > 0 && step >= params.stop_window) {
      const double before = history[index - static_cast<std::size_t>(params.stop_window)];
      const double decrease = before - done.last.total;
      if (decrease >= 0 && decrease < static_cast<double>(params.stop_relative_decrease) * before) {
        done.reason = StopReason::small_decrease;
      }
    }
    if (done.reason != StopReason::none) {
      if (done.last.total > done.first.total) {
        done.reason = StopReason::no_descent;
        done.last = done.first;
        depth = problem.estimate;
      }
      return {};
    }
    executor.for_chunks(rows, kLossChunkRows, [&](std::size_t begin, std::size_t end) {
      adam_rows(params, problem, s, step + 1, static_cast<int>(begin), static_cast<int>(end));
    });
  }
}

inline constexpr int kNewtonFailures = 3;  // steps in a row that no halving mends, each damped more than the last

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
                                                Shape shape, ImageView<float>& depth, Span<LossValues> loss_curve,
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
    if (index < loss_curve.size()) loss_curve[index] = done.last;
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

// output: the shape of the depth, may be the same memory. loss_curve: gets the losses before each step and at the end,
// as far as it reaches; unused elements are left alone. Status not_finite if a loss is not finite.
// V: the batch; the result is the same for all.
template <class V = simd::F32, class Executor>
[[nodiscard]] Status refine_with_normals(const RefineParams& params, const LossInput<float>& input,
                                         ImageView<float> output, Span<LossValues> loss_curve, RefineResult& result,
                                         Workspace& workspace, Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(depth_detail::check_loss_input(input));
  const Shape shape = input.depth_est.shape();
  if (output.empty() || output.shape() != shape) {
    return {StatusCode::shape_mismatch, "refine: output must have the shape of the depth"};
  }

  const WorkspaceScope scope(workspace);
  depth_detail::LossProblem<float> problem;
  ImageView<float> depth;
  RefineResult done;
  NPSIM_RETURN_IF_ERROR((depth_detail::prepare_losses<float, V>(params.loss, input, workspace, executor, problem)));
  if (params.solver == RefineSolver::adam) {
    NPSIM_RETURN_IF_ERROR(
        depth_detail::minimise_with_adam(params, problem, shape, depth, loss_curve, done, workspace, executor));
  } else {
    NPSIM_RETURN_IF_ERROR(depth_detail::minimise_with_gauss_newton<V>(params.gauss_newton, problem, shape, depth,
                                                                      loss_curve, done, workspace, executor));
  }
  const int width = shape.width;
  executor.for_chunks(
      static_cast<std::size_t>(shape.height), depth_detail::kLossChunkRows,
      [&, width](std::size_t begin, std::size_t end) {
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
