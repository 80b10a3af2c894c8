// SPDX-License-Identifier: Apache-2.0
// The pass over the image that evaluates the losses of loss_params.hpp and their gradient; see there for the equations.
//
// With the pixel's ray r = (a / fx, b / fy, 1), p = fx s_x and q = fy s_y the equations become short:
//   m = (p, q, -(1 + p r_x + q r_y)),  n = m / |m|,  X = (1, 0, 0) + p r,  Y = (0, 1, 0) + q r,
// so that X . N = N_x + p c with c = N . r, and |X|^2 = 1 + p (2 r_x + p |r|^2). The thesis' form has r = (0, 0, 1).
//
// A row is evaluated 16 pixels at a time, in batches of whatever width; losses are summed in 16 lanes by x mod 16, so
// the bits do not depend on the width. A pixel's gradient is its own part, then the part of its left and of its upper
// neighbour; the former stays in a register and the latter in a buffer of one row. A chunk leaves its last row's part
// in its buffer, for a short second pass over the rows where chunks begin.
// Cost: about 55 multiplications, 3 divisions and a square root per pixel, with unit tangents 2 divisions more; and 36
// bytes: 8 planes read, 1 written. It takes 1.2 to 1.5 times as long as merely reading and writing them.
#ifndef NPSIM_DEPTH_DETAIL_REFINE_LOSS_KERNEL_HPP
#define NPSIM_DEPTH_DETAIL_REFINE_LOSS_KERNEL_HPP

#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/depth/detail/refine/loss_batch.hpp"
#include "npsim/depth/detail/refine/loss_params.hpp"
#include "npsim/depth/detail/refine/loss_problem.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

// What is the same for all pixels of a row. The scales are 2 lambda / count, for the gradient.
template <class V>
struct LossRow {
  V fx, fy;
  V ratio_x, ratio_y;  // -1 / fx, or 1 / fx for the thesis' tangents
  V ray_y;             // b / fy
  V one_ray_y2;        // 1 + (b / fy)^2
  V normal_scale, continuity_scale, depth_scale;
};

// A batch of pixels.
template <class V>
struct LossPixels {
  V z, right, below;  // depth here, of the right and of the lower neighbour
  V ray_x;            // a / fx
  V estimate, nx, ny, nz, normal_weight, continuity_weight, depth_weight;
};

// What a batch of pixels adds to the losses (weights of pixels included, lambda not) and to the gradient of itself, of
// its right and of its lower neighbours.
template <class V>
struct LossPart {
  V normal, continuity, depth;
  V self, right, down;
};

// Squared cosine between a tangent and the normal, along[X] = r^2 or r^2 / |X|^2, and half its derivative by p.
template <class V>
struct TangentTerm {
  V value, half_derivative;
};
template <TangentForm kTangents, ContinuityForm kContinuity, class V>
[[nodiscard]] NPSIM_ALWAYS_INLINE TangentTerm<V> tangent_term(V p, V n_along, V c, V ray_along, V ray2) noexcept {
  const V dot = fma(p, c, n_along);
  if constexpr (kContinuity == ContinuityForm::printed) {
    return {dot * dot, dot * c};
  } else if constexpr (kTangents == TangentForm::thesis) {
    const V share = dot / fma(p, p, V(1));
    return {dot * share, share * fma(-share, p, c)};
  } else {
    const V half_slope = fma(p, ray2, ray_along);  // X . r, half the derivative of |X|^2
    const V share = dot / fma(p, half_slope + ray_along, V(1));
    return {dot * share, share * fma(-share, half_slope, c)};
  }
}

template <TangentForm kTangents, ContinuityForm kContinuity, class V>
[[nodiscard]] NPSIM_ALWAYS_INLINE LossPart<V> loss_part(const LossRow<V>& k, const LossPixels<V>& at) noexcept {
  constexpr bool kPerspective = kTangents == TangentForm::perspective;
  const V one(1);
  // p = slope (z' - z) with slope = fx / z' or, for the thesis, fx / z. The derivative by the depth that does not
  // divide is the slope, by the one that does it is as much times z / z' = 1 - p / fx, or z' / z = 1 + p / fx.
  const V p_slope = k.fx / (kPerspective ? at.right : at.z);
  const V q_slope = k.fy / (kPerspective ? at.below : at.z);
  const V p = (at.right - at.z) * p_slope;
  const V q = (at.below - at.z) * q_slope;

  // n - N = -(m s + N) with s = -1 / |m|.
  V tilt = one;  // -m_z
  if constexpr (kPerspective) tilt = fma(at.ray_x, p, fma(k.ray_y, q, one));
  const V s = V(-1) / sqrt(fma(p, p, fma(q, q, tilt * tilt)));
  const V ex = fma(p, s, at.nx);
  const V ey = fma(q, s, at.ny);
  const V ez = fma(-tilt, s, at.nz);
  const V e2 = fma(ex, ex, fma(ey, ey, ez * ez));
  // Half the gradient of |e|^2 by m is s (e - (e . n) n), and e . n = -|e|^2 / 2 between unit vectors. m_z falls with p
  // by r_x.
  const V along = s * e2 * V(-0.5);
  V normal_p = fma(p, along, ex);
  V normal_q = fma(q, along, ey);
  if constexpr (kPerspective) {
    const V z_part = fma(tilt, along, -ez);
    normal_p = fma(at.ray_x, z_part, normal_p);
    normal_q = fma(k.ray_y, z_part, normal_q);
  }

  V c = at.nz;
  V ray2 = one;
  if constexpr (kPerspective) {
    c = fma(at.ray_x, at.nx, fma(k.ray_y, at.ny, at.nz));
    ray2 = fma(at.ray_x, at.ray_x, k.one_ray_y2);
  }
  const TangentTerm<V> tx = tangent_term<kTangents, kContinuity>(p, at.nx, c, at.ray_x, ray2);
  const TangentTerm<V> ty = tangent_term<kTangents, kContinuity>(q, at.ny, c, k.ray_y, ray2);

  const V normal_factor = k.normal_scale * at.normal_weight * s;
  const V continuity_factor = k.continuity_scale * at.continuity_weight;
  const V by_p = fma(normal_factor, normal_p, continuity_factor * tx.half_derivative);
  const V by_q = fma(normal_factor, normal_q, continuity_factor * ty.half_derivative);

  const V offset = at.z - at.estimate;
  const V weighted_offset = at.depth_weight * offset;
  LossPart<V> part;
  part.normal = at.normal_weight * e2;
  part.continuity = at.continuity_weight * (tx.value + ty.value);
  part.depth = weighted_offset * offset;
  const V by_x = by_p * p_slope;
  const V by_y = by_q * q_slope;
  const V by_x_divisor = by_x * fma(p, k.ratio_x, one);
  const V by_y_divisor = by_y * fma(q, k.ratio_y, one);
  if constexpr (kPerspective) {
    part.self = fma(k.depth_scale, weighted_offset, -(by_x + by_y));
    part.right = by_x_divisor;
    part.down = by_y_divisor;
  } else {
    part.self = fma(k.depth_scale, weighted_offset, -(by_x_divisor + by_y_divisor));
    part.right = by_x;
    part.down = by_y;
  }
  return part;
}

// Evaluates row y. from_above: the upper row's part of the gradient; becomes this row's for the next.
template <TangentForm kTangents, ContinuityForm kContinuity, class V, class T>
void evaluate_row(LossProblem<T>& p, ImageView<const T> depth, int y, T* gradient, T* from_above) noexcept {
  constexpr std::size_t kBatches = static_cast<std::size_t>(kLossBlock / V::lanes);
  const auto scale = [](float lambda, std::size_t count) {
    return V(count == 0 ? T(0) : static_cast<T>(2 * static_cast<double>(lambda) / static_cast<double>(count)));
  };
  const double fx = static_cast<double>(p.k.fx);
  const double sign = kTangents == TangentForm::perspective ? -1 : 1;
  const double ray_y = (y + 0.5 - static_cast<double>(p.k.cy)) / static_cast<double>(p.k.fy);
  const LossRow<V> row{V(static_cast<T>(p.k.fx)),
                       V(static_cast<T>(p.k.fy)),
                       V(static_cast<T>(sign / fx)),
                       V(static_cast<T>(sign / static_cast<double>(p.k.fy))),
                       V(static_cast<T>(ray_y)),
                       V(static_cast<T>(1 + ray_y * ray_y)),
                       scale(p.params.lambda.normal, p.normal_count),
                       scale(p.params.lambda.continuity, p.normal_count),
                       scale(p.params.lambda.depth, p.depth_count)};
  const T inverse_fx = static_cast<T>(1 / fx);
  const T* z_row = depth.row(y);
  const T* below_row = depth.row(y + 1);  // the plane has one more row than the image
  const T* estimate = p.estimate.row(y);
  const T* nx = p.nx.row(y);
  const T* ny = p.ny.row(y);
  const T* nz = p.nz.row(y);
  const T* normal_weight = p.normal_weight.row(y);
  const T* continuity_weight = p.continuity_weight.row(y);
  const T* depth_weight = p.depth_weight.row(y);
  V normal[kBatches], continuity[kBatches], deviation[kBatches];
  for (std::size_t i = 0; i < kBatches; ++i) normal[i] = continuity[i] = deviation[i] = V(T(0));
  V left(T(0));
  const V pixel_centre = V::iota() + V(T(0.5));
  const int end = static_cast<int>(depth.stride()) - kLossBlock;
  for (int block = 0; block < end; block += kLossBlock) {
    for (std::size_t i = 0; i < kBatches; ++i) {
      const int x = block + static_cast<int>(i) * V::lanes;
      LossPixels<V> at;
      at.z = V::load(z_row + x);
      at.right = V::load(z_row + x + 1);
      at.below = V::load(below_row + x);
      if constexpr (kTangents == TangentForm::perspective) {
        const V a = V(static_cast<T>(x)) + pixel_centre - V(static_cast<T>(p.k.cx));
        at.ray_x = a * V(inverse_fx);
      } else {
        at.ray_x = V(T(0));
      }
      at.estimate = V::load(estimate + x);
      at.nx = V::load(nx + x);
      at.ny = V::load(ny + x);
      at.nz = V::load(nz + x);
      at.normal_weight = V::load(normal_weight + x);
      at.continuity_weight = V::load(continuity_weight + x);
      at.depth_weight = V::load(depth_weight + x);
      const LossPart<V> part = loss_part<kTangents, kContinuity>(row, at);
      ((part.self + slide_up(left, part.right)) + V::load(from_above + x)).store(gradient + x);
      part.down.store(from_above + x);
      left = part.right;
      normal[i] = normal[i] + part.normal;
      continuity[i] = continuity[i] + part.continuity;
      deviation[i] = deviation[i] + part.depth;
    }
  }
  const auto row_sum = [](const V* batches) {
    T lane[kLossBlock];
    for (std::size_t i = 0; i < kBatches; ++i) batches[i].store(lane + static_cast<int>(i) * V::lanes);
    double sum = 0;
    for (const T v : lane) sum += static_cast<double>(v);
    return sum;
  };
  const auto index = static_cast<std::size_t>(y);
  p.row_normal[index] = row_sum(normal);
  p.row_continuity[index] = row_sum(continuity);
  p.row_depth[index] = row_sum(deviation);
}

template <TangentForm kTangents, ContinuityForm kContinuity, class V, class T, class Executor>
void evaluate_rows(LossProblem<T>& p, ImageView<const T> depth, ImageView<T> gradient, Executor& executor) noexcept {
  const auto rows = static_cast<std::size_t>(depth.height());
  const auto width = static_cast<std::size_t>(depth.stride() - kLossBlock);
  const auto buffer = [&p, width](std::size_t chunk) { return p.row_buffers.data() + chunk * width; };
  executor.for_chunks(rows, kLossChunkRows, [&](std::size_t begin, std::size_t end) {
    T* from_above = buffer(begin / kLossChunkRows);
    for (std::size_t x = 0; x < width; ++x) from_above[x] = T(0);
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      evaluate_row<kTangents, kContinuity, V, T>(p, depth, y, gradient.row(y), from_above);
    }
  });
  for (std::size_t y = kLossChunkRows; y < rows; y += kLossChunkRows) {
    const T* from_above = buffer(y / kLossChunkRows - 1);
    T* row = gradient.row(static_cast<int>(y));
    for (std::size_t x = 0; x < width; ++x) row[x] = row[x] + from_above[x];
  }
}

// depth, gradient: planes of allocate_loss_plane(); depth must be filled to its padding, with 1 where there is none.
// V: the batch; the result is the same for all.
template <class T, class V = LossBatch<T>, class Executor>
void evaluate_losses(LossProblem<T>& p, ImageView<const T> depth, ImageView<T> gradient, LossValues& values,
                     Executor& executor) noexcept {
  using Tangents = TangentForm;
  using Continuity = ContinuityForm;
  const bool printed = p.params.continuity == Continuity::printed;
  if (p.params.tangents == Tangents::thesis) {
    if (printed) {
      evaluate_rows<Tangents::thesis, Continuity::printed, V>(p, depth, gradient, executor);
    } else {
      evaluate_rows<Tangents::thesis, Continuity::unit_tangents, V>(p, depth, gradient, executor);
    }
  } else if (printed) {
    evaluate_rows<Tangents::perspective, Continuity::printed, V>(p, depth, gradient, executor);
  } else {
    evaluate_rows<Tangents::perspective, Continuity::unit_tangents, V>(p, depth, gradient, executor);
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
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_REFINE_LOSS_KERNEL_HPP
