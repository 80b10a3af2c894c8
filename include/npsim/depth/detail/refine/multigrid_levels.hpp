// SPDX-License-Identifier: Apache-2.0
// The grids of multigrid.hpp: the operator H on each level, its smoother, and how a level is made from the finer one.
//
// H = sum over pixels of e^T W e + d x^2, e = (x_right - x, x_below - x), W a symmetric 2x2 block that is positive
// semidefinite. Four planes hold it on every level, in the layout of loss_problem.hpp, padding and holes being 0.
// Coarsening: 2x2 pixels become one that is constant on them; their energies then add up to the same form with
//   W_xx = s (both rows' right links), W_yy = s (both columns' lower links), W_xy = s (the last pixel's), d = the sum.
// s = 1 is the Galerkin operator, which is twice too stiff for what is smooth; s near 1/2 mends that. Smoother
// interpolation was tried and is worse here: coefficients differ by ten orders of magnitude across depth edges.
// Smoother: Jacobi, the diagonal enlarged by half the sum of the others' magnitudes, which converges for any such H.
// Invariant: W stays positive semidefinite on every level. Error: H x within float rounding of its terms.
// Cost: one pass over the operator. Memory: 5 values per pixel, and 2.7 for the coarse levels with their vectors.
#ifndef NPSIM_DEPTH_DETAIL_REFINE_MULTIGRID_LEVELS_HPP
#define NPSIM_DEPTH_DETAIL_REFINE_MULTIGRID_LEVELS_HPP

#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/refine/loss_problem.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

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

namespace depth_detail {

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

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_REFINE_MULTIGRID_LEVELS_HPP
