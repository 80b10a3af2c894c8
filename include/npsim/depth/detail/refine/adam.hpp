// SPDX-License-Identifier: Apache-2.0
// Adam (Kingma and Ba, ICLR 2015) over the depth of every pixel: the reference solver of normal-guided refinement.
//
// The variable is x = d / depth_scale_m, and L_depth is measured in the same unit. With metres (scale 1) a rate of 1e-4
// moves no depth by more than about 0.1 m in 1000 steps; with 80 it moves up to 8 m.
// Invariant: no pixel leaves a factor of 4 of its input, and no loss is above the input's: a run that ends higher has
// the input as its output. Its rate, which every pixel moves by at first, was too large for what was to be gained.
//
// Error: after 60 steps within a tenth of one step of the textbook in double. Cost: one evaluation of the losses and 15
// operations per pixel and step. Memory: 4 floats per pixel, and the problem's.
#ifndef NPSIM_DEPTH_DETAIL_REFINE_ADAM_HPP
#define NPSIM_DEPTH_DETAIL_REFINE_ADAM_HPP

#include <cmath>
#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/refine/loss_kernel.hpp"
#include "npsim/depth/detail/refine/loss_params.hpp"
#include "npsim/depth/detail/refine/loss_problem.hpp"
#include "npsim/depth/detail/refine/params.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

[[nodiscard]] constexpr std::size_t adam_bytes(const AdamParams& params, Shape shape) noexcept {
  return 4 * allocation_bytes<float>(loss_plane_elements(shape)) +
         allocation_bytes<double>(static_cast<std::size_t>(params.steps > 0 ? params.steps : 0) + 1);
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

// depth: gets the result, in the layout of the problem's planes.
template <class Executor>
[[nodiscard]] Status minimise_with_adam(const RefineParams& params, LossProblem<float>& problem, Shape shape,
                                        ImageView<float>& depth, Span<float> loss_curve, RefineResult& done,
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
    if (index < loss_curve.size()) loss_curve[index] = static_cast<float>(done.last.total);
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

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_REFINE_ADAM_HPP
