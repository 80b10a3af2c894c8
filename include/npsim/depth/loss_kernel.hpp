// SPDX-License-Identifier: Apache-2.0
// The pass over the image that evaluates the losses of loss_params.hpp and their gradient; see there for the equations.
//
// A row is evaluated 16 pixels at a time, in batches of whatever width; losses are summed in 16 lanes by x mod 16, so
// the bits do not depend on the width. A pixel's gradient is its own part, then the part of its left and of its upper
// neighbour. A chunk evaluates the row above its first one again, so no chunk writes into another's rows.
// Cost: about 90 operations per pixel.
#ifndef NPSIM_DEPTH_LOSS_KERNEL_HPP
#define NPSIM_DEPTH_LOSS_KERNEL_HPP

#include <cmath>
#include <cstddef>
#include <type_traits>

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/depth/loss_params.hpp"
#include "npsim/depth/loss_problem.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/isa.hpp"

namespace npsim {
inline namespace v1 {
inline namespace NPSIM_ISA_NAMESPACE {
namespace depth_detail {

// One double with the part of the batch interface that the kernel uses.
struct F64 {
  static constexpr int lanes = 1;
  double value = 0;
  F64() = default;
  F64(double x) noexcept : value(x) {}  // NOLINT(google-explicit-constructor)
  [[nodiscard]] static F64 load(const double* p) noexcept { return *p; }
  void store(double* p) const noexcept { *p = value; }
  friend F64 operator+(F64 a, F64 b) noexcept { return a.value + b.value; }
  friend F64 operator-(F64 a, F64 b) noexcept { return a.value - b.value; }
  friend F64 operator*(F64 a, F64 b) noexcept { return a.value * b.value; }
  friend F64 operator/(F64 a, F64 b) noexcept { return a.value / b.value; }
  friend F64 sqrt(F64 a) noexcept { return std::sqrt(a.value); }
};

template <class T>
using LossBatch = std::conditional_t<std::is_same_v<T, double>, F64, simd::F32>;

// What one batch of pixels adds to the losses (weights of pixels included, lambda not) and to the gradient.
template <class V>
struct LossPart {
  V normal, continuity, depth;
  V self, right, down;
};

// Squared cosine between a tangent and the normal, r^2 or r^2 / |t|^2, and its derivative by the slope s, given that
// the tangent is (t1, t2, t3) with derivatives (d1, d2, d3) and r has derivative dr.
template <class V>
struct TangentTerm {
  V value, derivative;
};
template <class V>
[[nodiscard]] TangentTerm<V> tangent_term(ContinuityForm form, V r, V dr, V t1, V d1, V t2, V d2, V t3, V d3) noexcept {
  if (form == ContinuityForm::printed) return {r * r, V(2) * r * dr};
  const V share = r / (t1 * t1 + t2 * t2 + t3 * t3);
  return {r * share, V(2) * share * (dr - share * (t1 * d1 + t2 * d2 + t3 * d3))};
}

// z, z_right, z_below: depth; a, b: image coordinates relative to the principal point (0 for the thesis' tangents).
// The scales are 2 lambda / count for the gradient.
template <TangentForm kForm, class T, class V = LossBatch<T>>
[[nodiscard]] LossPart<V> loss_part(const LossProblem<T>& p, const T* z_row, const T* below_row, int x, int y, V a, V b,
                                    V normal_scale, V continuity_scale, V depth_scale) noexcept {
  const V fx(static_cast<T>(p.k.fx));
  const V fy(static_cast<T>(p.k.fy));
  const V one(T(1));
  const V z = V::load(z_row + x);
  const V right = V::load(z_row + x + 1);
  const V below = V::load(below_row + x);
  // Slopes, and their derivatives by the depth here and by the neighbour's.
  V sx, sx_here, sx_there, sy, sy_here, sy_there;
  if constexpr (kForm == TangentForm::thesis) {
    const V inverse = one / z;
    sx = (right - z) * inverse;
    sy = (below - z) * inverse;
    sx_there = inverse;
    sy_there = inverse;
    sx_here = V(T(0)) - right * inverse * inverse;
    sy_here = V(T(0)) - below * inverse * inverse;
  } else {
    const V inverse_right = one / right;
    const V inverse_below = one / below;
    sx = (right - z) * inverse_right;
    sy = (below - z) * inverse_below;
    sx_there = z * inverse_right * inverse_right;
    sy_there = z * inverse_below * inverse_below;
    sx_here = V(T(0)) - inverse_right;
    sy_here = V(T(0)) - inverse_below;
  }

  const V nx = V::load(p.nx.row(y) + x);
  const V ny = V::load(p.ny.row(y) + x);
  const V nz = V::load(p.nz.row(y) + x);
  const V normal_weight = V::load(p.normal_weight.row(y) + x);
  const V continuity_weight = V::load(p.continuity_weight.row(y) + x);

  // |n - N|^2 with n = m / |m|; its gradient by m is -2 (N - (N . n) n) / |m|.
  const V mx = fx * sx;
  const V my = fy * sy;
  const V mz = V(T(0)) - (one + a * sx + b * sy);
  const V inverse_length = one / sqrt(mx * mx + my * my + mz * mz);
  const V ux = mx * inverse_length;
  const V uy = my * inverse_length;
  const V uz = mz * inverse_length;
  const V cosine = ux * nx + uy * ny + uz * nz;
  const V gz = (uz * cosine - nz) * inverse_length;
  const V normal_sx = (ux * cosine - nx) * inverse_length * fx - gz * a;  // half the derivative by s_x
  const V normal_sy = (uy * cosine - ny) * inverse_length * fy - gz * b;

  // X . N and Y . N; c = N . ray.
  const V bfx = b * (fx / fy);
  const V afy = a * (fy / fx);
  const V c = a / fx * nx + b / fy * ny + nz;
  const ContinuityForm form = p.params.continuity;
  const TangentTerm<V> tx = tangent_term(form, nx + fx * c * sx, fx * c, one + a * sx, a, bfx * sx, bfx, fx * sx, fx);
  const TangentTerm<V> ty = tangent_term(form, ny + fy * c * sy, fy * c, afy * sy, afy, one + b * sy, b, fy * sy, fy);

  const V half(T(0.5));
  const V by_sx =
      normal_scale * normal_weight * normal_sx + continuity_scale * continuity_weight * half * tx.derivative;
  const V by_sy =
      normal_scale * normal_weight * normal_sy + continuity_scale * continuity_weight * half * ty.derivative;

  const V offset = z - V::load(p.estimate.row(y) + x);
  const V weighted_offset = V::load(p.depth_weight.row(y) + x) * offset;

  LossPart<V> part;
  const V ex = ux - nx;
  const V ey = uy - ny;
  const V ez = uz - nz;
  part.normal = normal_weight * (ex * ex + ey * ey + ez * ez);
  part.continuity = continuity_weight * (tx.value + ty.value);
  part.depth = weighted_offset * offset;
  part.self = depth_scale * weighted_offset + by_sx * sx_here + by_sy * sy_here;
  part.right = by_sx * sx_there;
  part.down = by_sy * sy_there;
  return part;
}

// Evaluates row y: `self` and `right` and `down` get the gradient parts, each a row of the padded width. The losses of
// the row go to its place in row_normal and so on, unless only_down.
template <TangentForm kForm, class T>
void evaluate_row(LossProblem<T>& p, ImageView<const T> depth, int y, T* self, T* right, T* down,
                  bool only_down) noexcept {
  using V = LossBatch<T>;
  constexpr std::size_t kBatches = static_cast<std::size_t>(kLossBlock / V::lanes);
  const auto scale = [](float lambda, std::size_t count) {
    return V(count == 0 ? T(0) : static_cast<T>(2 * static_cast<double>(lambda) / static_cast<double>(count)));
  };
  const V normal_scale = scale(p.params.lambda.normal, p.normal_count);
  const V continuity_scale = scale(p.params.lambda.continuity, p.normal_count);
  const V depth_scale = scale(p.params.lambda.depth, p.depth_count);
  const T zero(0);
  V normal[kBatches], continuity[kBatches], deviation[kBatches];
  for (std::size_t i = 0; i < kBatches; ++i) normal[i] = continuity[i] = deviation[i] = V(zero);
  T a_of_lane[kLossBlock];

  const T* here = depth.row(y);
  const T* below = depth.row(y + 1);  // the plane has one more row than the image
  const V b(kForm == TangentForm::thesis ? zero : static_cast<T>(y) + T(0.5) - static_cast<T>(p.k.cy));
  const int end = static_cast<int>(depth.stride()) - kLossBlock;
  for (int block = 0; block < end; block += kLossBlock) {
    for (int i = 0; i < kLossBlock; ++i) {
      a_of_lane[i] = kForm == TangentForm::thesis ? zero : static_cast<T>(block + i) + T(0.5) - static_cast<T>(p.k.cx);
    }
    for (std::size_t i = 0; i < kBatches; ++i) {
      const int lane = static_cast<int>(i) * V::lanes;
      const int x = block + lane;
      const V a = V::load(a_of_lane + lane);
      const LossPart<V> part =
          loss_part<kForm, T>(p, here, below, x, y, a, b, normal_scale, continuity_scale, depth_scale);
      part.down.store(down + x);
      if (only_down) continue;
      part.self.store(self + x);
      part.right.store(right + x);
      normal[i] = normal[i] + part.normal;
      continuity[i] = continuity[i] + part.continuity;
      deviation[i] = deviation[i] + part.depth;
    }
  }
  if (only_down) return;
  const auto row_sum = [](const V* batches) {
    T lane[kLossBlock];
    for (std::size_t i = 0; i < kBatches; ++i) batches[i].store(lane + static_cast<int>(i) * V::lanes);
    double sum = 0;
    for (const T v : lane) sum += static_cast<double>(v);
    return sum;
  };
  const auto row = static_cast<std::size_t>(y);
  p.row_normal[row] = row_sum(normal);
  p.row_continuity[row] = row_sum(continuity);
  p.row_depth[row] = row_sum(deviation);
}

template <TangentForm kForm, class T, class Executor>
void evaluate_all(LossProblem<T>& p, ImageView<const T> depth, ImageView<T> gradient, Executor& executor) noexcept {
  const std::ptrdiff_t stride = depth.stride();
  const std::ptrdiff_t end_x = stride - kLossBlock;
  const auto rows = static_cast<std::size_t>(depth.height());
  executor.for_chunks(rows, kLossChunkRows, [&, stride, end_x](std::size_t begin, std::size_t end) {
    T* right = p.row_buffers.data() + static_cast<std::ptrdiff_t>(begin / kLossChunkRows) *
                                          static_cast<std::ptrdiff_t>(kLossRowBuffers) * stride;
    T* from_above = right + stride;
    T* down = from_above + stride;
    for (std::ptrdiff_t x = 0; x < end_x; ++x) from_above[x] = T(0);
    if (begin > 0) evaluate_row<kForm, T>(p, depth, static_cast<int>(begin) - 1, nullptr, nullptr, from_above, true);
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      T* self = gradient.row(y);
      evaluate_row<kForm, T>(p, depth, y, self, right, down, false);
      self[0] = self[0] + from_above[0];
      for (std::ptrdiff_t x = 1; x < end_x; ++x) self[x] = (self[x] + right[x - 1]) + from_above[x];
      T* const next = from_above;
      from_above = down;
      down = next;
    }
  });
}

// depth, gradient: planes of allocate_loss_plane(); depth must be filled to its padding, with 1 where there is none.
template <class T, class Executor>
void evaluate_losses(LossProblem<T>& p, ImageView<const T> depth, ImageView<T> gradient, LossValues& values,
                     Executor& executor) noexcept {
  if (p.params.tangents == TangentForm::thesis) {
    evaluate_all<TangentForm::thesis>(p, depth, gradient, executor);
  } else {
    evaluate_all<TangentForm::perspective>(p, depth, gradient, executor);
  }
  values = {};
  for (std::size_t y = 0; y < p.row_normal.size(); ++y) {
    values.normal += p.row_normal[y];
    values.continuity += p.row_continuity[y];
    values.depth += p.row_depth[y];
  }
  values.normal_count = p.normal_count;
  values.depth_count = p.depth_count;
  if (p.normal_count > 0) {
    values.normal /= static_cast<double>(p.normal_count);
    values.continuity /= static_cast<double>(p.normal_count);
  }
  values.depth /= static_cast<double>(p.depth_count);
  values.total = static_cast<double>(p.params.lambda.normal) * values.normal +
                 static_cast<double>(p.params.lambda.continuity) * values.continuity +
                 static_cast<double>(p.params.lambda.depth) * values.depth;
}

}  // namespace depth_detail
}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_DEPTH_LOSS_KERNEL_HPP
