// SPDX-License-Identifier: Apache-2.0
// Conjugate gradients for H step = rhs, H as in multigrid_levels.hpp, preconditioned with a multigrid cycle.
//
// Each iteration's step length minimises the quadratic model, so its gain is known, and iterations end by that. The
// last one leaves its share of the solution where it is, as alpha and a direction, for the pass that uses it. Sums go
// by row in 16 lanes by x mod 16, rows are added in order in double: the result does not depend on the batch or the
// executor.
//
// Error: within 1e-3 of a dense solution in double. Cost: an iteration is a multigrid cycle and a pass each over H and
// over the vectors. Memory: 5 values per pixel.
#ifndef NPSIM_DEPTH_DETAIL_REFINE_CONJUGATE_GRADIENTS_HPP
#define NPSIM_DEPTH_DETAIL_REFINE_CONJUGATE_GRADIENTS_HPP

#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/depth/detail/refine/loss_problem.hpp"
#include "npsim/depth/detail/refine/multigrid.hpp"
#include "npsim/depth/detail/refine/multigrid_levels.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
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

// Solves H step = rhs, until an iteration lowers the quadratic model by less than `share` of what all did, until all of
// them lowered it by `enough`, or to the cap. rhs becomes the residual before the last iteration.
template <class V, class Executor>
[[nodiscard]] NewtonStep conjugate_gradients(const Multigrid& grid, int cap, double share, double enough,
                                             NewtonVectors& v, Executor& executor) noexcept {
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
    if (!continues || gain < share * decrease || decrease >= enough) return step;
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

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_REFINE_CONJUGATE_GRADIENTS_HPP
