// SPDX-License-Identifier: Apache-2.0
// Normal-guided depth refinement, section 3.4.3: minimises the losses of loss_params.hpp over the depth of every pixel
// with Adam (Kingma and Ba, ICLR 2015). This is the reference solver.
//
// The variable is x = d / depth_scale_m, and L_depth is measured in the same unit. With metres (scale 1) a rate of 1e-4
// moves no depth by more than about 0.1 m in 1000 steps; with 80 it moves up to 8 m and converges.
// Invariant: pixels without a usable depth (1e-3..1e5 m) come out as they went in; no other leaves a factor of 4 of its
// input. On a Status other than ok the output is untouched.
//
// Presets. thesis_refine_params(): its tangents, metric depth term in (d/80)^2, lambda (1, 5, 1). Those tangents are
// biased, so depth gets worse the better the loss is minimised: on a road with boxes between two walls, relative error
// .0185 -> .0332. The default takes perspective tangents and a relative depth term strong enough to hold what normals
// cannot know: .0185 -> .0162, normal error 61 -> 6 degrees. Where depth is far better than the normals (.0033, noise
// of 13 degrees in N) it still loses, .0052, against .0196 with the metric term and (1, 5, 1).
//
// Cost: one evaluation of the losses and 15 operations per pixel and step. Memory: 12 floats per pixel.
#ifndef NPSIM_DEPTH_REFINE_HPP
#define NPSIM_DEPTH_REFINE_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/loss_kernel.hpp"
#include "npsim/depth/loss_params.hpp"
#include "npsim/depth/loss_problem.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/isa.hpp"

namespace npsim {
inline namespace v1 {

struct AdamParams {
  int steps = 1000;    // section 3.4.3
  float rate = 1e-4F;  // section 3.4.3, per step, in units of depth_scale_m
  float beta1 = 0.9F;  // the paper's defaults, as in the framework that the thesis used
  float beta2 = 0.999F;
  float epsilon = 1e-8F;
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
  // Stop when the loss fell by less than this share of itself over the last stop_window steps; 0: never.
  float stop_relative_decrease = 1e-3F;
  int stop_window = 50;
};

// The text as literally as a reading allows: its tangents, appendix B's lambda, no early stop.
[[nodiscard]] constexpr RefineParams thesis_refine_params() noexcept {
  RefineParams p;
  p.loss = LossParams{};
  p.loss.tangents = TangentForm::thesis;
  p.loss.lambda = kLambdaThesis;
  p.stop_relative_decrease = 0;
  return p;
}

enum class StopReason : std::uint8_t { none, all_steps, small_decrease };

struct RefineResult {
  int steps = 0;  // taken
  StopReason reason = StopReason::none;
  LossValues first;  // of the input
  LossValues last;   // of the output
};

[[nodiscard]] constexpr std::size_t refine_workspace_bytes(const RefineParams& params, Shape shape) noexcept {
  return kWorkspaceAlignment + loss_problem_bytes<float>(shape) +
         4 * allocation_bytes<float>(loss_plane_elements(shape)) +
         allocation_bytes<double>(static_cast<std::size_t>(params.adam.steps > 0 ? params.adam.steps : 0) + 1);
}

inline namespace NPSIM_ISA_NAMESPACE {
namespace depth_detail {

[[nodiscard]] inline Status validate_refine(const RefineParams& p) noexcept {
  const auto in_range = [](float v, float low, float high) { return v >= low && v <= high; };  // false for NaN
  if (p.adam.steps < 0 || p.adam.steps > 1000000) {
    return {StatusCode::invalid_argument, "refine: steps must lie in 0..1000000"};
  }
  if (!in_range(p.adam.rate, 0.0F, 1.0F) || !in_range(p.adam.beta1, 0.0F, 0.99999F) ||
      !in_range(p.adam.beta2, 0.0F, 0.99999F) || !in_range(p.adam.epsilon, 1e-30F, 1.0F)) {
    return {StatusCode::invalid_argument, "refine: rate in 0..1, betas in 0..0.99999, epsilon in 1e-30..1"};
  }
  if (!in_range(p.depth_scale_m, 1e-3F, 1e5F)) {
    return {StatusCode::invalid_argument, "refine: depth_scale_m must lie in 1e-3..1e5"};
  }
  if (!in_range(p.stop_relative_decrease, 0.0F, 1.0F) || p.stop_window < 1) {
    return {StatusCode::invalid_argument, "refine: stop_relative_decrease in 0..1, stop_window at least 1"};
  }
  return {};
}

struct AdamState {
  ImageView<float> depth, gradient, first_moment, second_moment;
};

// One step for the rows [begin, end); `step` counts from 1. The padding moves by 0 like every pixel without a gradient.
inline void adam_rows(const RefineParams& params, const LossProblem<float>& problem, const AdamState& s, int step,
                      int begin, int end) noexcept {
  using F = simd::F32;
  const double bias1 = 1.0 - std::pow(static_cast<double>(params.adam.beta1), step);
  const double bias2 = 1.0 - std::pow(static_cast<double>(params.adam.beta2), step);
  const F scale(params.depth_scale_m);
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

}  // namespace depth_detail

// output: the shape of the depth, may be the same memory. loss_curve: gets the total loss before each step and at the
// end, as far as it reaches; unused elements are left alone. Status not_finite if a loss is not finite.
template <class Executor>
[[nodiscard]] Status refine_with_normals(const RefineParams& params, const LossInput<float>& input,
                                         ImageView<float> output, Span<float> loss_curve, RefineResult& result,
                                         Workspace& workspace, Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(depth_detail::validate_refine(params));
  LossParams loss = params.loss;
  loss.depth_unit_m = params.depth_scale_m;
  NPSIM_RETURN_IF_ERROR(depth_detail::validate_losses(loss, input));
  const Shape shape = input.depth_est.shape();
  if (output.empty() || output.shape() != shape) {
    return {StatusCode::shape_mismatch, "refine: output must have the shape of the depth"};
  }

  const WorkspaceScope scope(workspace);
  depth_detail::LossProblem<float> problem;
  depth_detail::AdamState s;
  Span<double> history;
  NPSIM_RETURN_IF_ERROR(depth_detail::prepare_losses(loss, input, workspace, executor, problem));
  for (ImageView<float>* plane : {&s.depth, &s.gradient, &s.first_moment, &s.second_moment}) {
    NPSIM_RETURN_IF_ERROR(depth_detail::allocate_loss_plane(shape, workspace, *plane));
  }
  NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(params.adam.steps) + 1, history));
  for (std::size_t i = 0; i < loss_plane_elements(shape); ++i) {
    s.depth.data()[i] = problem.estimate.data()[i];
    s.gradient.data()[i] = s.first_moment.data()[i] = s.second_moment.data()[i] = 0;
  }

  RefineResult done;
  const auto rows = static_cast<std::size_t>(shape.height);
  for (int step = 0;; ++step) {
    const auto index = static_cast<std::size_t>(step);
    depth_detail::evaluate_losses<float>(problem, s.depth, s.gradient, done.last, executor);
    if (!std::isfinite(done.last.total)) return {StatusCode::not_finite, "refine: the loss is not finite"};
    if (step == 0) done.first = done.last;
    history[index] = done.last.total;
    if (index < loss_curve.size()) loss_curve[index] = static_cast<float>(done.last.total);
    done.steps = step;
    if (step == params.adam.steps) {
      done.reason = StopReason::all_steps;
      break;
    }
    if (params.stop_relative_decrease > 0 && step >= params.stop_window) {
      const double before = history[index - static_cast<std::size_t>(params.stop_window)];
      if (before - done.last.total < static_cast<double>(params.stop_relative_decrease) * before) {
        done.reason = StopReason::small_decrease;
        break;
      }
    }
    executor.for_chunks(rows, kLossChunkRows, [&](std::size_t begin, std::size_t end) {
      depth_detail::adam_rows(params, problem, s, step + 1, static_cast<int>(begin), static_cast<int>(end));
    });
  }

  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const float before = input.depth_est(x, y);
      output(x, y) = depth_detail::has_depth(before) ? s.depth(x, y) : before;
    }
  }
  result = done;
  return {};
}

}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_DEPTH_REFINE_HPP
