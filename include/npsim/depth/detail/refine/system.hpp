// SPDX-License-Identifier: Apache-2.0
// The losses of depth/losses.hpp linearised in log depth: H = J^T J of all residuals, in the form of linear_solver.hpp.
//
// With y = log z, the slopes depend on t = (y_right - y, y_below - y) alone: s = 1 - e^-t for perspective tangents,
// e^t - 1 for the thesis'. With p = fx s_x and q = fy s_y (see losses.hpp here) a pixel's residuals give the block
//   W = T A T,  T = diag(dp/dt_x, dq/dt_y),
//   A = lambda1 w / |m|^4 (|Y|^2, -X.Y; -X.Y, |X|^2)  normal: n moves in the tangent plane of the sphere
//     + lambda2 w (r_x'^2, 0; 0, r_y'^2)              continuity, r = X.N or X.N / |X|
// A is a Gram matrix, so W is positive semidefinite as computed. The depth term adds lambda3 w z^2 to the diagonal.
// All is multiplied by twice the number of pixels, over the number of pixels that have the term, as the gradient is.
//
// Error against the double version: 1e-5 of each block's trace. Cost: one pass, 40 operations and 3 divisions per
// pixel, 15 values of traffic.
#ifndef NPSIM_DEPTH_DETAIL_REFINE_SYSTEM_HPP
#define NPSIM_DEPTH_DETAIL_REFINE_SYSTEM_HPP

#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/depth/detail/refine/losses.hpp"
#include "npsim/depth/losses.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

// No depth leaves this factor of its estimate. Where it has come there and the gradient points outward the diagonal
// becomes so large that the pixel stays, and the right-hand side 0: clamped steps alone would not lower the loss.
inline constexpr float kDepthRange = 4;
inline constexpr float kHeldDiagonal = 0x1p50F;

template <class T>
struct SystemPlanes {
  ImageView<T> wxx, wxy, wyy, diagonal, rhs;  // rhs: minus the gradient by y
};

// The curvature by p of (X.N)^2 / 2, or of (X.N)^2 / |X|^2 / 2, see above.
template <ContinuityForm kContinuity, class V>
[[nodiscard]] NPSIM_ALWAYS_INLINE V continuity_curvature(V p, V n_along, V c, V ray_along, V ray2, V length2) noexcept {
  if constexpr (kContinuity == ContinuityForm::printed) {
    return c * c;
  } else {
    const V inverse = V(1) / length2;
    const V dot = fma(p, c, n_along);
    const V slope = fma(p, ray2, ray_along);
    const V d = fma(-(dot * inverse), slope, c);
    return max(c * d, d * d) * inverse;
  }
}

// Logarithmic mean of a and b, b being kept within a factor of 2^10 of a: 2/3 of the geometric mean and 1/3 of the
// arithmetic one, within 5 % for factors up to 40.
template <class V, class T>
[[nodiscard]] NPSIM_ALWAYS_INLINE V mean_slope(V a, V b) noexcept {
  const V kept = min(max(b, a * V(T(0x1p-10))), a * V(T(0x1p10)));
  return fma(V(T(2.0 / 3)), sqrt(a * kept), (a + kept) * V(T(1.0 / 6)));
}

// What is the same for all pixels of a row. The scales are 2 lambda times the number of pixels over that of the term.
template <class V>
struct SystemRow {
  V fx, fy, inverse_fx, inverse_fy;
  V fx2, fy2, fxy;
  V ray_y;  // b / fy, or 0 for the thesis' tangents
  V normal_scale, continuity_scale;
};

template <class V>
struct LinkBlock {
  V xx, xy, yy;
};

// W of a batch of pixels.
template <TangentForm kTangents, ContinuityForm kContinuity, class V, class T>
[[nodiscard]] NPSIM_ALWAYS_INLINE LinkBlock<V> link_block(const SystemRow<V>& k, V z, V right, V below, V ray_x, V nx,
                                                          V ny, V nz, V normal_weight, V continuity_weight) noexcept {
  constexpr bool kPerspective = kTangents == TangentForm::perspective;
  const V one(1);
  // p, q, and e^-t or e^t, to which dp/dt and dq/dt are proportional.
  V x_ratio, y_ratio, p, q;
  if constexpr (kPerspective) {
    const V inverse_right = one / right;
    const V inverse_below = one / below;
    x_ratio = z * inverse_right;
    y_ratio = z * inverse_below;
    p = k.fx * ((right - z) * inverse_right);
    q = k.fy * ((below - z) * inverse_below);
  } else {
    const V inverse = one / z;
    x_ratio = right * inverse;
    y_ratio = below * inverse;
    p = k.fx * ((right - z) * inverse);
    q = k.fy * ((below - z) * inverse);
  }
  const V ray_y = k.ray_y;
  const V ray2 = fma(ray_x, ray_x, fma(ray_y, ray_y, one));
  const V c = fma(ray_x, nx, fma(ray_y, ny, nz));
  const V tilt = fma(ray_x, p, fma(ray_y, q, one));
  const V x2 = fma(p, fma(p, ray2, ray_x + ray_x), one);
  const V y2 = fma(q, fma(q, ray2, ray_y + ray_y), one);
  const V xy = fma(p * q, ray2, fma(ray_x, q, ray_y * p));
  const V inverse_m2 = one / fma(p, p, fma(q, q, tilt * tilt));
  const V inverse_m = sqrt(inverse_m2);
  const V size_c = max(abs(c), V(T(1e-3)));
  const V normal = k.normal_scale * normal_weight * (size_c * (inverse_m * inverse_m2));
  const V continuity = k.continuity_scale * continuity_weight;
  const V rx2 = continuity_curvature<kContinuity>(p, nx, c, ray_x, ray2, x2);
  const V ry2 = continuity_curvature<kContinuity>(q, ny, c, ray_y, ray2, y2);
  // Where X.N = 0 and Y.N = 0: e^-t = 1 - p/fx with p = -N_x / c.
  const V turn = (kPerspective ? one : -one) / min(c, V(T(-1e-3)));
  const V x_slope = x_ratio * mean_slope<V, T>(x_ratio, fma(nx * turn, k.inverse_fx, one));
  const V y_slope = y_ratio * mean_slope<V, T>(y_ratio, fma(ny * turn, k.inverse_fy, one));
  return {k.fx2 * x_slope * fma(normal, y2, continuity * rx2), -(k.fxy * sqrt(x_slope * y_slope) * normal * xy),
          k.fy2 * y_slope * fma(normal, x2, continuity * ry2)};
}

template <TangentForm kTangents, ContinuityForm kContinuity, class V, class T>
void linearise_row(const LossProblem<T>& problem, ImageView<const T> depth, ImageView<const T> gradient, T damping,
                   int y, const SystemPlanes<T>& out) noexcept {
  constexpr bool kPerspective = kTangents == TangentForm::perspective;
  const double count = static_cast<double>(problem.depth_count);
  const double normal_count = static_cast<double>(problem.normal_count > 0 ? problem.normal_count : 1);
  const auto scale = [count](float lambda, double n) {
    return V(static_cast<T>(2 * static_cast<double>(lambda) * count / n));
  };
  const double ray_y = (y + 0.5 - static_cast<double>(problem.k.cy)) / static_cast<double>(problem.k.fy);
  const V fx(static_cast<T>(problem.k.fx));
  const V fy(static_cast<T>(problem.k.fy));
  const SystemRow<V> row{fx,
                         fy,
                         V(static_cast<T>(1 / static_cast<double>(problem.k.fx))),
                         V(static_cast<T>(1 / static_cast<double>(problem.k.fy))),
                         fx * fx,
                         fy * fy,
                         fx * fy,
                         V(kPerspective ? static_cast<T>(ray_y) : T(0)),
                         scale(problem.params.lambda.normal, normal_count),
                         scale(problem.params.lambda.continuity, normal_count)};
  const V depth_scale = scale(problem.params.lambda.depth, count);
  const V gradient_scale(static_cast<T>(-count));
  const V zero(0);
  const V lowest(T(1.001 / static_cast<double>(kDepthRange)));
  const V highest(T(0.999 * static_cast<double>(kDepthRange)));
  const V held(static_cast<T>(kHeldDiagonal));
  const V pixel_centre = V::iota() + V(T(0.5));
  const int end = static_cast<int>(depth.stride()) - kLossBlock;
  for (int x = 0; x < end; x += V::lanes) {
    const auto at = [x, y](const ImageView<T>& plane) { return V::load(plane.row(y) + x); };
    const V z = V::load(depth.row(y) + x);
    V ray_x(T(0));
    if constexpr (kPerspective) {
      ray_x = (V(static_cast<T>(x)) + pixel_centre - V(static_cast<T>(problem.k.cx))) * row.inverse_fx;
    }
    const LinkBlock<V> w = link_block<kTangents, kContinuity, V, T>(
        row, z, V::load(depth.row(y) + x + 1), V::load(depth.row(y + 1) + x), ray_x, at(problem.nx), at(problem.ny),
        at(problem.nz), at(problem.normal_weight), at(problem.continuity_weight));
    w.xx.store(out.wxx.row(y) + x);
    w.xy.store(out.wxy.row(y) + x);
    w.yy.store(out.wyy.row(y) + x);
    const V diagonal = fma(V(damping), w.xx + w.yy, depth_scale * at(problem.depth_weight) * z * z);
    const V rhs = gradient_scale * V::load(gradient.row(y) + x) * z;
    const V estimate = at(problem.estimate);
    const auto low = (z <= estimate * lowest) & (zero > rhs);
    const auto high = (z >= estimate * highest) & (rhs > zero);
    select(low, held, select(high, held, diagonal)).store(out.diagonal.row(y) + x);
    select(low, zero, select(high, zero, rhs)).store(out.rhs.row(y) + x);
  }
}

template <class T, class V, class Executor>
void linearise(const LossProblem<T>& problem, ImageView<const T> depth, ImageView<const T> gradient, T damping,
               const SystemPlanes<T>& out, Executor& executor) noexcept {
  using Tangents = TangentForm;
  using Continuity = ContinuityForm;
  const bool thesis = problem.params.tangents == Tangents::thesis;
  const bool printed = problem.params.continuity == Continuity::printed;
  executor.for_chunks(
      static_cast<std::size_t>(depth.height()), kLossChunkRows, [&](std::size_t begin, std::size_t end) {
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
          if (thesis && printed) {
            linearise_row<Tangents::thesis, Continuity::printed, V>(problem, depth, gradient, damping, y, out);
          } else if (thesis) {
            linearise_row<Tangents::thesis, Continuity::unit_tangents, V>(problem, depth, gradient, damping, y, out);
          } else if (printed) {
            linearise_row<Tangents::perspective, Continuity::printed, V>(problem, depth, gradient, damping, y, out);
          } else {
            linearise_row<Tangents::perspective, Continuity::unit_tangents, V>(problem, depth, gradient, damping, y,
                                                                               out);
          }
        }
      });
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_REFINE_SYSTEM_HPP
