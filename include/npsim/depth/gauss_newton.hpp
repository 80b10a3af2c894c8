// SPDX-License-Identifier: Apache-2.0
// Gauss-Newton in log depth: the default solver of normal-guided refinement.
//
// Each outer step linearises the losses (gauss_newton_system.hpp), solves H step = -gradient by conjugate gradients
// preconditioned with a multigrid V-cycle (multigrid.hpp), loosely, and moves each depth to z e^step. A step that does
// not lower the loss, as loss_kernel.hpp evaluates it, is halved; when no fraction of it does, the solver stops with
// what it had. So the loss never rises, and a divergent step costs time alone.
// Sums go by row in 16 lanes by x mod 16, rows are added in order in double: the result does not depend on the batch or
// the executor.
//
// Invariant: no pixel leaves a factor of 4 of its input.
// Cost: see docs of the parts; an outer step takes one evaluation, one linearisation, and per inner step 3 passes over
// the operator's planes and 2 over vectors. Memory: 15 floats per pixel, and the problem's.
#ifndef NPSIM_DEPTH_GAUSS_NEWTON_HPP
#define NPSIM_DEPTH_GAUSS_NEWTON_HPP

#include <cmath>
#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/gauss_newton_system.hpp"
#include "npsim/depth/loss_kernel.hpp"
#include "npsim/depth/loss_params.hpp"
#include "npsim/depth/loss_problem.hpp"
#include "npsim/depth/multigrid.hpp"
#include "npsim/depth/refine_params.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/isa.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace v1 {

[[nodiscard]] constexpr std::size_t gauss_newton_bytes(Shape shape) noexcept {
  return multigrid_bytes(shape) + 3 * allocation_bytes<float>(loss_plane_elements(shape)) +
         5 * allocation_bytes<float>(grid_plane_elements(shape)) +
         allocation_bytes<double>(static_cast<std::size_t>(shape.height));
}

inline namespace NPSIM_ISA_NAMESPACE {
namespace depth_detail {

// The sum of a row in 16 lanes by x mod 16.
template <class V>
struct RowSum {
  static constexpr int kBatches = kLossBlock / V::lanes;
  V sum[static_cast<std::size_t>(kBatches)];
  RowSum() noexcept {
    for (V& s : sum) s = V(0.0F);
  }
  void add(int x, V a, V b) noexcept {
    V& s = sum[x / V::lanes % kBatches];
    s = fma(a, b, s);
  }
  [[nodiscard]] double total() const noexcept {
    float lane[kLossBlock];
    for (int i = 0; i < kBatches; ++i) sum[i].store(lane + i * V::lanes);
    double result = 0;
    for (const float v : lane) result += static_cast<double>(v);
    return result;
  }
};

[[nodiscard]] inline double sum_of_rows(Span<const double> rows) noexcept {
  double sum = 0;
  for (const double v : rows) sum += v;
  return sum;
}

struct NewtonVectors {
  ImageView<float> rhs;               // b, then the residual
  ImageView<float> corrected;         // the preconditioner's z
  ImageView<float> direction, image;  // p and H p
  ImageView<float> sum;               // of alpha p over all iterations but the last
  Span<double> row_sums;
};

// Receives the V-cycle's result on the finest level.
template <class V>
struct StoreAndDot {
  ImageView<float> out;
  Span<double> rows;
  float* row = nullptr;
  std::size_t index = 0;
  RowSum<V> sum{};
  StoreAndDot(ImageView<float> plane, Span<double> sums) noexcept : out(plane), rows(sums) {}
  void begin_row(int y) noexcept {
    row = out.row(y);
    index = static_cast<std::size_t>(y);
    sum = RowSum<V>();
  }
  void put(int x, V rhs, V value) noexcept {
    value.store(row + x);
    sum.add(x, rhs, value);
  }
  void end_row(int) noexcept { rows[index] = sum.total(); }
};

// Row y of sum += alpha p and rhs -= alpha H p.
template <class V>
void advance_row(const GridLevel& level, const NewtonVectors& v, float alpha, bool first, int y) noexcept {
  const float* direction = v.direction.row(y);
  const float* image = v.image.row(y);
  float* sum = v.sum.row(y);
  float* rhs = v.rhs.row(y);
  for (int x = 0; x < level.end(); x += V::lanes) {
    const V along = V(alpha) * V::load(direction + x);
    (first ? along : V::load(sum + x) + along).store(sum + x);
    fma(V(-alpha), V::load(image + x), V::load(rhs + x)).store(rhs + x);
  }
}

// What conjugate gradients found: sum + alpha direction, without the sum after one iteration.
struct NewtonStep {
  ImageView<const float> sum, direction;
  float alpha = 0;
  int iterations = 0;  // 0: no step, because the gradient is 0 or a number overflowed
};

// H z, then p = z + beta p and H p = H z + beta H p; returns p . H p. Without `continues`, H p is not kept.
template <class V, class Executor>
double update_direction(const Multigrid& grid, const NewtonVectors& v, float beta, bool first, bool continues,
                        Executor& executor) noexcept {
  const GridLevel& level = grid.level[0];
  const int height = level.shape().height;
  const ImageView<float> z_plane = first ? v.direction : v.corrected;
  executor.for_chunks(static_cast<std::size_t>(height), kGridChunkRows, [&](std::size_t begin, std::size_t end) {
    float* from_above = level.buffer(grid.buffers, begin / kGridChunkRows);
    const int first_row = static_cast<int>(begin);
    if (first_row == 0) {
      for (int x = 0; x < level.end(); ++x) from_above[x] = 0.0F;
    } else {
      links_below<V>(level, first_row - 1, z_plane.row(first_row - 1), z_plane.row(first_row), from_above);
    }
    for (int y = first_row; y < static_cast<int>(end); ++y) {
      const float* z = z_plane.row(y);
      float* p = v.direction.row(y);
      float* image = v.image.row(y);
      RowSum<V> sum;
      apply_row<V>(level, y, z, z_plane.row(y + 1 < height ? y + 1 : y), from_above, [&](int x, V product) {
        V direction = V::load(z + x);
        if (!first) {
          direction = fma(V(beta), V::load(p + x), direction);
          product = fma(V(beta), V::load(image + x), product);
          direction.store(p + x);
        }
        if (continues) product.store(image + x);
        sum.add(x, direction, product);
      });
      v.row_sums[static_cast<std::size_t>(y)] = sum.total();
    }
  });
  return sum_of_rows(v.row_sums);
}

// Solves H step = rhs, until an iteration lowers the quadratic model by less than `share` of what all did, or to the
// cap. rhs becomes the residual before the last iteration.
template <class V, class Executor>
[[nodiscard]] NewtonStep conjugate_gradients(const Multigrid& grid, int cap, double share, NewtonVectors& v,
                                             Executor& executor) noexcept {
  const GridLevel& level = grid.level[0];
  NewtonStep step;
  double before = 0;
  double decrease = 0;
  for (int k = 0; k < cap; ++k) {
    const bool first = k == 0;
    const bool continues = k + 1 < cap;
    multigrid_cycle<V>(grid, ImageView<const float>(v.rhs),
                       StoreAndDot<V>(first ? v.direction : v.corrected, v.row_sums), executor);
    const double now = sum_of_rows(v.row_sums);
    if (!(now > 0)) return step;  // the residual is 0, or not a number
    const float beta = first ? 0.0F : static_cast<float>(now / before);
    before = now;
    const double curvature = update_direction<V>(grid, v, beta, first, continues, executor);
    const double alpha = now / curvature;
    if (!(alpha > 0 && alpha < 1e30)) return step;
    step.iterations = k + 1;
    step.alpha = static_cast<float>(alpha);
    step.direction = v.direction;
    const double gain = 0.5 * alpha * now;
    decrease += gain;
    if (!continues || gain < share * decrease) return step;
    executor.for_chunks(static_cast<std::size_t>(level.shape().height), kGridChunkRows,
                        [&](std::size_t begin, std::size_t end) {
                          for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
                            advance_row<V>(level, v, step.alpha, first, y);
                          }
                        });
    step.sum = v.sum;
    step.alpha = 0;
  }
  return step;
}

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
        const V moved = min(max(old * simd::exp(move), estimate * V(0.25F)), estimate * V(4.0F));
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
  for (int step = 0;; ++step) {
    if (done.last.total <= static_cast<double>(params.target_loss)) return stop(StopReason::target_reached);
    if (step == params.steps) return stop(StopReason::all_steps);
    linearise<float, V>(problem, ImageView<const float>(depth), ImageView<const float>(gradient), system, executor);
    build_multigrid<V>(grid, params.grid_stiffness, executor);
    const NewtonStep found =
        conjugate_gradients<V>(grid, params.inner_steps, static_cast<double>(params.inner_decrease), v, executor);
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
    if (!lower) return stop(StopReason::no_descent);
    const double before = done.last.total;
    const ImageView<float> old = step == 0 ? spare : depth;  // the estimate stays as it is
    depth = trial;
    trial = old;
    done.last = values;
    record(step + 1);
    if (before - values.total < static_cast<double>(params.relative_decrease) * before) {
      return stop(StopReason::small_decrease);
    }
  }
}

}  // namespace depth_detail
}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_DEPTH_GAUSS_NEWTON_HPP
