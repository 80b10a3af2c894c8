// SPDX-License-Identifier: Apache-2.0
// Solves H step = rhs for one outer step of the refinement: conjugate gradients, preconditioned with a multigrid cycle.
//
// H = sum over pixels of e^T W e + d x^2, e = (x_right - x, x_below - x), W a symmetric 2x2 block that is positive
// semidefinite. Four planes hold it on every level, in the layout of losses.hpp, padding and holes being 0.
// Coarsening: 2x2 pixels become one that is constant on them; their energies then add up to the same form with
//   W_xx = s (both rows' right links), W_yy = s (both columns' lower links), W_xy = s (the last pixel's), d = the sum.
// s = 1 is the Galerkin operator, which is twice too stiff for what is smooth; s near 1/2 mends that. Smoother
// interpolation serves worse: coefficients differ by ten orders of magnitude across depth edges.
// Smoother: Jacobi, the diagonal enlarged by half the sum of the others' magnitudes, which converges for any such H.
// Cycle: one smoothing on the way down and one on the way up, which makes it a symmetric positive (semi)definite linear
// map of rhs, hence a preconditioner. Middle levels are solved twice, the second time for what the first left, so that
// iterations hardly grow with the image: 6 at 64 px square, 9 at 1024, for a gain of 1e-4. A level's two passes fuse
// smoothing, residual and transfer, in rows that stay in cache; neighbouring chunks compute the row between them twice.
// Conjugate gradients: each iteration's step length minimises the quadratic model, so its gain is known, and iterations
// end by that. The last one leaves its share of the solution where it is, as alpha and a direction, for the pass that
// uses it. Sums go by row in 16 lanes by x mod 16, rows are added in order in double.
//
// Invariant: W stays positive semidefinite on every level; nothing depends on lanes, threads or the executor.
// Error: H x within float rounding of its terms; the cycle B is symmetric, u.Bv = v.Bu, within 1e-4 of their norms. The
// solution, iterated to the end, is within 1e-3 of a dense one in double on random systems; on a small street within
// 1e-5 of the largest move of a sparse direct one (measured: 4e-7).
// Cost: an iteration is a cycle and a pass each over H and over the vectors; a cycle is two passes over a level's five
// planes, half as much again for all coarse levels. Memory: 12.7 values per pixel: 5 for H and its smoother, 2.7 for
// the coarse levels with their vectors, 5 for those of the finest; and 4 rows for every 32.
#ifndef NPSIM_DEPTH_DETAIL_REFINE_LINEAR_SOLVER_HPP
#define NPSIM_DEPTH_DETAIL_REFINE_LINEAR_SOLVER_HPP

#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/refine/losses.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

inline constexpr std::size_t kGridChunkRows = 32;  // even: a coarse row belongs to one chunk
inline constexpr int kGridMaxLevels = 32;
inline constexpr std::size_t kGridRowBuffers = 4;  // per chunk

[[nodiscard]] constexpr std::size_t grid_plane_elements(Shape shape) noexcept {
  return static_cast<std::size_t>(loss_plane_stride(shape.width)) * static_cast<std::size_t>(shape.height);
}
[[nodiscard]] constexpr Shape coarse_shape(Shape shape) noexcept {
  return {(shape.width + 1) / 2, (shape.height + 1) / 2};
}
// Everything but the finest vectors, which belong to the caller.
[[nodiscard]] constexpr std::size_t multigrid_bytes(Shape shape) noexcept {
  const auto row = static_cast<std::size_t>(loss_plane_stride(shape.width));
  const std::size_t chunks = chunk_count(static_cast<std::size_t>(shape.height), kGridChunkRows);
  std::size_t bytes =
      allocation_bytes<float>(chunks * kGridRowBuffers * row) + 5 * allocation_bytes<float>(grid_plane_elements(shape));
  while (shape.width > 1 || shape.height > 1) {
    shape = coarse_shape(shape);
    bytes += 8 * allocation_bytes<float>(grid_plane_elements(shape));
  }
  return bytes;
}

struct GridLevel {
  ImageView<float> wxx, wxy, wyy, diagonal;
  ImageView<float> smoother;             // the reciprocal of the enlarged diagonal; 0 where H has none
  ImageView<float> rhs, solution, kept;  // of coarse levels
  [[nodiscard]] Shape shape() const noexcept { return wxx.shape(); }
  [[nodiscard]] int end() const noexcept { return static_cast<int>(wxx.stride()) - kLossBlock; }
  // The row buffers of a chunk, their padding 0.
  [[nodiscard]] float* buffer(Span<float> buffers, std::size_t chunk) const noexcept {
    const auto stride = static_cast<std::size_t>(wxx.stride());
    float* rows = buffers.data() + chunk * kGridRowBuffers * stride;
    for (std::size_t i = 1; i <= kGridRowBuffers; ++i) {
      for (std::size_t x = i * stride - kLossBlock; x < i * stride; ++x) rows[x] = 0.0F;
    }
    return rows;
  }
};

struct Multigrid {
  GridLevel level[kGridMaxLevels];
  int levels = 0;
  Span<float> buffers;
};

[[nodiscard]] inline Status allocate_grid_plane(Shape shape, Workspace& workspace, ImageView<float>& plane) noexcept {
  Span<float> elements;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(grid_plane_elements(shape), elements));
  plane = ImageView<float>(elements.data(), shape, loss_plane_stride(shape.width));
  for (int y = 0; y < shape.height; ++y) {  // the block that is read and never written
    for (std::ptrdiff_t x = plane.stride() - kLossBlock; x < plane.stride(); ++x) plane.row(y)[x] = 0.0F;
  }
  return {};
}

[[nodiscard]] inline Status allocate_multigrid(Shape shape, Workspace& workspace, Multigrid& grid) noexcept {
  const auto row = static_cast<std::size_t>(loss_plane_stride(shape.width));
  const std::size_t chunks = chunk_count(static_cast<std::size_t>(shape.height), kGridChunkRows);
  NPSIM_RETURN_IF_ERROR(workspace.allocate(chunks * kGridRowBuffers * row, grid.buffers));
  for (grid.levels = 0; grid.levels < kGridMaxLevels; shape = coarse_shape(shape)) {
    GridLevel& level = grid.level[grid.levels];
    for (ImageView<float>* plane : {&level.wxx, &level.wxy, &level.wyy, &level.diagonal, &level.smoother}) {
      NPSIM_RETURN_IF_ERROR(allocate_grid_plane(shape, workspace, *plane));
    }
    if (grid.levels > 0) {
      for (ImageView<float>* plane : {&level.rhs, &level.solution, &level.kept}) {
        NPSIM_RETURN_IF_ERROR(allocate_grid_plane(shape, workspace, *plane));
      }
    }
    ++grid.levels;
    if (shape.width == 1 && shape.height == 1) return {};
  }
  return {StatusCode::invalid_argument, "multigrid: the image is too large"};
}

// emit(x, (H v)(x)) along row y. v and v_below: rows of values, readable to one block beyond the end. from_above: what
// the links of the row above add; becomes this row's for the next.
template <class V, class Emit>
NPSIM_ALWAYS_INLINE void apply_row(const GridLevel& level, int y, const float* v, const float* v_below,
                                   float* from_above, Emit emit) noexcept {
  const float* wxx = level.wxx.row(y);
  const float* wxy = level.wxy.row(y);
  const float* wyy = level.wyy.row(y);
  const float* diagonal = level.diagonal.row(y);
  const int end = level.end();
  V left(0.0F);
  for (int x = 0; x < end; x += V::lanes) {
    const V here = V::load(v + x);
    const V to_right = V::load(v + x + 1) - here;
    const V to_below = V::load(v_below + x) - here;
    const V cross = V::load(wxy + x);
    const V along_x = fma(V::load(wxx + x), to_right, cross * to_below);
    const V along_y = fma(V::load(wyy + x), to_below, cross * to_right);
    const V gathered = (slide_up(left, along_x) - along_x) + (V::load(from_above + x) - along_y);
    along_y.store(from_above + x);
    left = along_x;
    emit(x, fma(V::load(diagonal + x), here, gathered));
  }
}
// What the links of row y add to the row below, alone.
template <class V>
void links_below(const GridLevel& level, int y, const float* v, const float* v_below, float* from_above) noexcept {
  for (int x = 0; x < level.end(); x += V::lanes) {
    const V here = V::load(v + x);
    const V to_below = V::load(v_below + x) - here;
    const V to_right = V::load(v + x + 1) - here;
    fma(V::load(level.wyy.row(y) + x), to_below, V::load(level.wxy.row(y) + x) * to_right).store(from_above + x);
  }
}

template <class V>
void smoother_row(const GridLevel& level, int y) noexcept {
  const float* wxx = level.wxx.row(y);
  const float* wxy = level.wxy.row(y);
  const float* wyy = level.wyy.row(y);
  const float* wxy_above = level.wxy.row(y > 0 ? y - 1 : 0);
  const float* wyy_above = level.wyy.row(y > 0 ? y - 1 : 0);
  const V above(y > 0 ? 1.0F : 0.0F);
  V left_xx(0.0F);
  V left_xy(0.0F);
  for (int x = 0; x < level.end(); x += V::lanes) {
    const V xx = V::load(wxx + x);
    const V xy = V::load(wxy + x);
    const V yy = V::load(wyy + x);
    const V from_left_xx = slide_up(left_xx, xx);
    const V from_left_xy = slide_up(left_xy, xy);
    const V up_xy = above * V::load(wxy_above + x);
    const V up_yy = above * V::load(wyy_above + x);
    const V diagonal = V::load(level.diagonal.row(y) + x) + (xx + yy + V(2.0F) * xy) + from_left_xx + up_yy;
    const V others = abs(xx + xy) + abs(yy + xy) + abs(from_left_xx + from_left_xy) + abs(from_left_xy) +
                     abs(up_yy + up_xy) + abs(up_xy);
    const V enlarged = fma(V(0.5F), others, diagonal);
    select(enlarged > V(1e-30F), V(1.0F) / enlarged, V(0.0F)).store(level.smoother.row(y) + x);
    left_xx = xx;
    left_xy = xy;
  }
}

template <class V>
void coarsen_row(const GridLevel& fine, const GridLevel& coarse, float stiffness, int y) noexcept {
  const int upper = 2 * y;
  const bool has_lower = upper + 1 < fine.shape().height;
  const int lower = has_lower ? upper + 1 : upper;
  const V present(has_lower ? 1.0F : 0.0F);
  const V scale(stiffness);
  for (int x = 0; x < coarse.end(); x += V::lanes) {
    const int a = 2 * x;  // at most the fine stride minus two batches
    const int b = a + V::lanes;
    const auto odd = [&](const ImageView<float>& plane, int row) {
      return odd_lanes(V::load(plane.row(row) + a), V::load(plane.row(row) + b));
    };
    const auto even = [&](const ImageView<float>& plane, int row) {
      return even_lanes(V::load(plane.row(row) + a), V::load(plane.row(row) + b));
    };
    (scale * fma(present, odd(fine.wxx, lower), odd(fine.wxx, upper))).store(coarse.wxx.row(y) + x);
    (scale * (present * odd(fine.wxy, lower))).store(coarse.wxy.row(y) + x);
    (scale * (present * (even(fine.wyy, lower) + odd(fine.wyy, lower)))).store(coarse.wyy.row(y) + x);
    const V d_upper = even(fine.diagonal, upper) + odd(fine.diagonal, upper);
    const V d_lower = even(fine.diagonal, lower) + odd(fine.diagonal, lower);
    fma(present, d_lower, d_upper).store(coarse.diagonal.row(y) + x);
  }
}

// The planes of the coarse levels and all smoothers, from the finest level's planes.
template <class V, class Executor>
void build_multigrid(const Multigrid& grid, float stiffness, Executor& executor) noexcept {
  for (int l = 0; l < grid.levels; ++l) {
    const GridLevel& level = grid.level[l];
    const GridLevel* coarse = l + 1 < grid.levels ? &grid.level[l + 1] : nullptr;
    executor.for_chunks(static_cast<std::size_t>(level.shape().height), kGridChunkRows,
                        [&](std::size_t begin, std::size_t end) {
                          for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
                            smoother_row<V>(level, y);
                            const bool pair_done = y % 2 != 0 || y + 1 == level.shape().height;
                            if (coarse != nullptr && pair_done) coarsen_row<V>(level, *coarse, stiffness, y / 2);
                          }
                        });
  }
}

// Levels that are solved twice in a cycle, the second time for what the first left.
inline constexpr int kGridFirstTwice = 2;
inline constexpr int kGridLastTwice = 6;

// The values that one smoothing makes of 0, plus, on the way up, what the coarse level found.
template <class V>
void first_values(const GridLevel& level, const ImageView<const float>& rhs, const GridLevel* coarse, int y,
                  float* out) noexcept {
  const float* b = rhs.row(y);
  const float* smoother = level.smoother.row(y);
  if (coarse == nullptr) {
    for (int x = 0; x < level.end(); x += V::lanes) (V::load(smoother + x) * V::load(b + x)).store(out + x);
    return;
  }
  const float* from = coarse->solution.row(y / 2);
  for (int x = 0; x < level.end(); x += 2 * V::lanes) {
    const V values = V::load(from + x / 2);
    fma(V::load(smoother + x), V::load(b + x), interleave_low(values, values)).store(out + x);
    if (x + V::lanes < level.end()) {
      fma(V::load(smoother + x + V::lanes), V::load(b + x + V::lanes), interleave_high(values, values))
          .store(out + x + V::lanes);
    }
  }
}

inline void swap_rows(float*& a, float*& b) noexcept {
  float* const t = a;
  a = b;
  b = t;
}

// The row buffers of one chunk.
struct ChunkRows {
  float *here, *below;
  float* from_above;  // what the row above gives to the current one
  float* residual;
};

// Buffers with the values of the chunk's first row, and what the row above it gives to that.
template <class V>
[[nodiscard]] ChunkRows start_chunk(const Multigrid& grid, const GridLevel& level, const ImageView<const float>& rhs,
                                    const GridLevel* coarse, std::size_t begin) noexcept {
  const std::ptrdiff_t stride = level.wxx.stride();
  float* const buffer = level.buffer(grid.buffers, begin / kGridChunkRows);
  const ChunkRows rows{buffer, buffer + stride, buffer + 2 * stride, buffer + 3 * stride};
  const int first = static_cast<int>(begin);
  first_values<V>(level, rhs, coarse, first, rows.here);
  if (first == 0) {
    for (int x = 0; x < level.end(); ++x) rows.from_above[x] = 0.0F;
  } else {
    first_values<V>(level, rhs, coarse, first - 1, rows.below);
    links_below<V>(level, first - 1, rows.below, rows.here, rows.from_above);
  }
  return rows;
}

// Smooths once from 0 and hands the residual down.
template <class V, class Executor>
void restrict_level(const Multigrid& grid, int l, const ImageView<const float>& rhs, Executor& executor) noexcept {
  const GridLevel& level = grid.level[l];
  const GridLevel& coarse = grid.level[l + 1];
  const int height = level.shape().height;
  executor.for_chunks(static_cast<std::size_t>(height), kGridChunkRows, [&](std::size_t begin, std::size_t end) {
    const ChunkRows rows = start_chunk<V>(grid, level, rhs, nullptr, begin);
    float* here = rows.here;
    float* below = rows.below;
    float* const residual = rows.residual;
    const int first = static_cast<int>(begin);
    const int last = static_cast<int>(end);
    for (int y = first; y < last; ++y) {
      const bool has_below = y + 1 < height;
      if (has_below) first_values<V>(level, rhs, nullptr, y + 1, below);
      const float* b = rhs.row(y);
      const bool add = (y - first) % 2 != 0;
      apply_row<V>(level, y, here, has_below ? below : here, rows.from_above, [&](int x, V product) {
        V r = V::load(b + x) - product;
        if (add) r = V::load(residual + x) + r;
        r.store(residual + x);
      });
      if (add || !has_below) {
        float* out = coarse.rhs.row(y / 2);
        for (int x = 0; x < coarse.end(); x += V::lanes) {
          const V p = V::load(residual + 2 * x);
          const V q = V::load(residual + 2 * x + V::lanes);
          (even_lanes(p, q) + odd_lanes(p, q)).store(out + x);
        }
      }
      swap_rows(here, below);
    }
  });
}

// Adds the coarse level's solution and smooths once more; `done` gets the result row by row.
template <class V, class Done, class Executor>
void prolong_level(const Multigrid& grid, int l, const ImageView<const float>& rhs, const Done& done,
                   Executor& executor) noexcept {
  const GridLevel& level = grid.level[l];
  const GridLevel* coarse = l + 1 < grid.levels ? &grid.level[l + 1] : nullptr;
  const int height = level.shape().height;
  executor.for_chunks(static_cast<std::size_t>(height), kGridChunkRows, [&](std::size_t begin, std::size_t end) {
    const ChunkRows rows = start_chunk<V>(grid, level, rhs, coarse, begin);
    float* here = rows.here;
    float* below = rows.below;
    const int first = static_cast<int>(begin);
    Done row = done;  // each chunk has its own
    for (int y = first; y < static_cast<int>(end); ++y) {
      const bool has_below = y + 1 < height;
      if (has_below) first_values<V>(level, rhs, coarse, y + 1, below);
      const float* b = rhs.row(y);
      const float* smoother = level.smoother.row(y);
      row.begin_row(y);
      apply_row<V>(level, y, here, has_below ? below : here, rows.from_above, [&](int x, V product) {
        const V r = V::load(b + x);
        row.put(x, r, fma(V::load(smoother + x), r - product, V::load(here + x)));
      });
      row.end_row(y);
      swap_rows(here, below);
    }
  });
}

template <class V>
struct StoreRow {
  ImageView<float> out;
  float* row = nullptr;
  void begin_row(int y) noexcept { row = out.row(y); }
  void put(int x, V, V value) noexcept { value.store(row + x); }
  void end_row(int) noexcept {}
};

// Keeps the level's solution and makes its right-hand side what is left of it.
template <class V, class Executor>
void keep_solution(const Multigrid& grid, int l, Executor& executor) noexcept {
  const GridLevel& level = grid.level[l];
  const int height = level.shape().height;
  executor.for_chunks(static_cast<std::size_t>(height), kGridChunkRows, [&](std::size_t begin, std::size_t end) {
    float* from_above = level.buffer(grid.buffers, begin / kGridChunkRows);
    const int first = static_cast<int>(begin);
    if (first == 0) {
      for (int x = 0; x < level.end(); ++x) from_above[x] = 0.0F;
    } else {
      links_below<V>(level, first - 1, level.solution.row(first - 1), level.solution.row(first), from_above);
    }
    for (int y = first; y < static_cast<int>(end); ++y) {
      const float* solution = level.solution.row(y);
      float* rhs = level.rhs.row(y);
      float* kept = level.kept.row(y);
      apply_row<V>(level, y, solution, level.solution.row(y + 1 < height ? y + 1 : y), from_above,
                   [&](int x, V product) {
                     (V::load(rhs + x) - product).store(rhs + x);
                     V::load(solution + x).store(kept + x);
                   });
    }
  });
}
template <class V, class Executor>
void add_kept(const GridLevel& level, Executor& executor) noexcept {
  executor.for_chunks(static_cast<std::size_t>(level.shape().height), kGridChunkRows,
                      [&](std::size_t begin, std::size_t end) {
                        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
                          float* solution = level.solution.row(y);
                          for (int x = 0; x < level.end(); x += V::lanes) {
                            (V::load(solution + x) + V::load(level.kept.row(y) + x)).store(solution + x);
                          }
                        }
                      });
}

// `done` gets the cycle's approximate solution of H x = rhs on the finest level.
template <class V, class Done, class Executor>
void multigrid_cycle(const Multigrid& grid, const ImageView<const float>& rhs, const Done& done,
                     Executor& executor) noexcept {
  bool second[kGridMaxLevels] = {};
  int l = 0;
  while (true) {
    for (; l + 1 < grid.levels; ++l) {
      restrict_level<V>(grid, l, l == 0 ? rhs : ImageView<const float>(grid.level[l].rhs), executor);
    }
    bool again = false;
    for (; l > 0 && !again; l -= again ? 0 : 1) {
      const GridLevel& level = grid.level[l];
      prolong_level<V>(grid, l, ImageView<const float>(level.rhs), StoreRow<V>{level.solution, nullptr}, executor);
      if (l < kGridFirstTwice || l > kGridLastTwice || l + 1 == grid.levels) continue;
      if (second[l]) add_kept<V>(level, executor);
      second[l] = !second[l];
      again = second[l];
      if (again) keep_solution<V>(grid, l, executor);
    }
    if (!again) break;
  }
  prolong_level<V>(grid, 0, rhs, done, executor);
}

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

#endif  // NPSIM_DEPTH_DETAIL_REFINE_LINEAR_SOLVER_HPP
