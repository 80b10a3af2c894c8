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
         2 * allocation_bytes<double>(static_cast<std::size_t>(shape.height));
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
  ImageView<float> step;              // the solution
  Span<double> row_a, row_b;
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

// Solves H step = rhs. Returns the number of iterations; vectors.step is the solution.
template <class V, class Executor>
int conjugate_gradients(const GaussNewtonParams& params, const Multigrid& grid, const NewtonVectors& v,
                        Executor& executor) noexcept {
  const GridLevel& level = grid.level[0];
  const int end_x = level.end();
  const auto rows = static_cast<std::size_t>(level.shape().height);
  const double tolerance = static_cast<double>(params.inner_tolerance) * static_cast<double>(params.inner_tolerance);
  double first = 0;
  double before = 0;
  for (int k = 0;; ++k) {
    v_cycle<V>(grid, ImageView<const float>(v.rhs), StoreAndDot<V>(v.corrected, v.row_a), executor);
    const double now = sum_of_rows(v.row_a);
    if (k == 0) first = now;
    if (!(now > tolerance * first)) return k;  // also where it is not a number
    const float beta = k == 0 ? 0.0F : static_cast<float>(now / before);
    before = now;

    // p = z + beta p, H p = H z + beta H p.
    executor.for_chunks(rows, kGridChunkRows, [&](std::size_t begin, std::size_t end) {
      float* from_above = level.buffer(grid.buffers, begin / kGridChunkRows);
      const int first_row = static_cast<int>(begin);
      if (first_row == 0) {
        for (int x = 0; x < end_x; ++x) from_above[x] = 0.0F;
      } else {
        links_below<V>(level, first_row - 1, v.corrected.row(first_row - 1), v.corrected.row(first_row), from_above);
      }
      for (int y = first_row; y < static_cast<int>(end); ++y) {
        const float* z = v.corrected.row(y);
        const float* z_below = v.corrected.row(y + 1 < v.corrected.height() ? y + 1 : y);
        float* p = v.direction.row(y);
        float* image = v.image.row(y);
        RowSum<V> sum;
        apply_row<V>(level, y, z, z_below, from_above, [&](int x, V product) {
          V direction = V::load(z + x);
          if (k > 0) {
            direction = fma(V(beta), V::load(p + x), direction);
            product = fma(V(beta), V::load(image + x), product);
          }
          direction.store(p + x);
          product.store(image + x);
          sum.add(x, direction, product);
        });
        v.row_b[static_cast<std::size_t>(y)] = sum.total();
      }
    });
    const double curvature = sum_of_rows(v.row_b);
    const double ratio = now / curvature;
    if (!(curvature > 0) || !(ratio < 1e30)) return k;
    const float alpha = static_cast<float>(ratio);
    const bool last = k + 1 == params.inner_steps;
    executor.for_chunks(rows, kGridChunkRows, [&](std::size_t begin, std::size_t end) {
      for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
        for (int x = 0; x < end_x; x += V::lanes) {
          const V direction = V::load(v.direction.row(y) + x);
          V step = V(alpha) * direction;
          if (k > 0) step = step + V::load(v.step.row(y) + x);
          step.store(v.step.row(y) + x);
          if (!last) {
            fma(V(-alpha), V::load(v.image.row(y) + x), V::load(v.rhs.row(y) + x)).store(v.rhs.row(y) + x);
          }
        }
      }
    });
    if (last) return k + 1;
  }
}

// to = from e^(share step), within a factor of 4 of the estimate; pixels that have no equation stay.
template <class V, class Executor>
void take_step(const LossProblem<float>& problem, const GridLevel& level, ImageView<const float> from,
               ImageView<const float> step, float share, ImageView<float> to, Executor& executor) noexcept {
  executor.for_chunks(static_cast<std::size_t>(step.height()), kLossChunkRows, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < level.end(); x += V::lanes) {
        const V old = V::load(from.row(y) + x);
        const V estimate = V::load(problem.estimate.row(y) + x);
        const V move = simd::clamp(V(share) * V::load(step.row(y) + x), -8.0F, 8.0F);
        const V moved = min(max(old * simd::exp(move), estimate * V(0.25F)), estimate * V(4.0F));
        const auto usable = (V::load(level.smoother.row(y) + x) > V(0.0F)) & simd::is_finite(moved);
        select(usable, moved, old).store(to.row(y) + x);
      }
    }
  });
}

// depth: gets the result, in the layout of the problem's planes.
template <class V, class Executor>
[[nodiscard]] Status minimise_with_gauss_newton(const GaussNewtonParams& params, LossProblem<float>& problem,
                                                Shape shape, ImageView<float>& depth, Span<float> loss_curve,
                                                RefineResult& done, Workspace& workspace, Executor& executor) noexcept {
  Multigrid grid;
  NewtonVectors v;
  ImageView<float> trial;
  ImageView<float> gradient;
  NPSIM_RETURN_IF_ERROR(allocate_multigrid(shape, workspace, grid));
  for (ImageView<float>* plane : {&depth, &trial, &gradient}) {
    NPSIM_RETURN_IF_ERROR(allocate_loss_plane(shape, workspace, *plane));
  }
  for (ImageView<float>* plane : {&v.rhs, &v.corrected, &v.direction, &v.image, &v.step}) {
    NPSIM_RETURN_IF_ERROR(allocate_grid_plane(shape, workspace, *plane));
  }
  for (Span<double>* sums : {&v.row_a, &v.row_b}) {
    NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(shape.height), *sums));
  }
  for (std::size_t i = 0; i < loss_plane_elements(shape); ++i) {
    depth.data()[i] = trial.data()[i] = problem.estimate.data()[i];
  }
  const auto record = [&](int step) {
    done.steps = step;
    const auto index = static_cast<std::size_t>(step);
    if (index < loss_curve.size()) loss_curve[index] = static_cast<float>(done.last.total);
  };
  evaluate_losses<float, V>(problem, depth, gradient, done.last, executor);
  done.evaluations = 1;
  if (!std::isfinite(done.last.total)) return {StatusCode::not_finite, "refine: the loss is not finite"};
  done.first = done.last;
  record(0);
  const GridLevel& level = grid.level[0];
  const SystemPlanes<float> system{level.wxx, level.wxy, level.wyy, level.diagonal, v.rhs};
  for (int step = 0;; ++step) {
    if (done.last.total <= static_cast<double>(params.target_loss)) {
      done.reason = StopReason::target_reached;
      return {};
    }
    if (step == params.steps) {
      done.reason = StopReason::all_steps;
      return {};
    }
    linearise<float, V>(problem, ImageView<const float>(depth), ImageView<const float>(gradient), system, executor);
    build_multigrid<V>(grid, params.grid_stiffness, executor);
    const int inner = conjugate_gradients<V>(params, grid, v, executor);
    done.inner_steps += inner;
    if (inner == 0) {
      done.reason = StopReason::no_descent;
      return {};
    }
    float share = 1.0F;
    LossValues values;
    bool lower = false;
    for (int halving = 0; halving <= params.halvings && !lower; ++halving) {
      take_step<V>(problem, level, ImageView<const float>(depth), ImageView<const float>(v.step), share, trial,
                   executor);
      evaluate_losses<float, V>(problem, trial, gradient, values, executor);
      ++done.evaluations;
      lower = values.total < done.last.total;  // false for NaN
      share *= 0.5F;
    }
    if (!lower) {
      done.reason = StopReason::no_descent;
      return {};
    }
    const double before = done.last.total;
    const ImageView<float> other = depth;
    depth = trial;
    trial = other;
    done.last = values;
    record(step + 1);
    if (before - values.total < static_cast<double>(params.relative_decrease) * before) {
      done.reason = StopReason::small_decrease;
      return {};
    }
  }
}

}  // namespace depth_detail
}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_DEPTH_GAUSS_NEWTON_HPP
