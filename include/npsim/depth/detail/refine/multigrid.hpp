// SPDX-License-Identifier: Apache-2.0
// A multigrid cycle: one approximate solution of H x = b, H as in multigrid_levels.hpp. It is a symmetric positive
// (semi)definite linear map of b, hence a preconditioner for conjugate gradients.
//
// One smoothing on the way down and one on the way up keep it symmetric. Middle levels are solved twice, the second
// time for what the first left, so that iterations hardly grow with the image: 6 at 64 px square, 9 at 1024, for a gain
// of 1e-4. A level's two passes fuse smoothing, residual and transfer, in rows that stay in cache; neighbouring chunks
// compute the row between them twice. Nothing depends on lanes, threads or the executor.
//
// Error: u.Bv = v.Bu within 1e-4 of their norms. Cost: two passes over a level's five planes, half as much again for
// all coarse levels. Memory: that of the levels, and 4 rows for every 32.
#ifndef NPSIM_DEPTH_DETAIL_REFINE_MULTIGRID_HPP
#define NPSIM_DEPTH_DETAIL_REFINE_MULTIGRID_HPP

#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/refine/loss_problem.hpp"
#include "npsim/depth/detail/refine/multigrid_levels.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Levels that are solved twice in a cycle, the second time for what the first left.
inline constexpr int kGridFirstTwice = 2;
inline constexpr int kGridLastTwice = 6;

namespace depth_detail {

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

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_REFINE_MULTIGRID_HPP
