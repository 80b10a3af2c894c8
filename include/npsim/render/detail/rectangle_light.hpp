// SPDX-License-Identifier: Apache-2.0
// Irradiance of a parallelogram of constant luminance, by Lambert's closed form (Photometria, 1760).
//
//   E = L / 2 * sum over the edges of  angle(a, b) * dot(n, a x b) / |a x b|
// with a, b the directions to the ends of an edge, of the part above the receiver's horizon. Exact but for rounding:
// 1e-5 relative where the nearest corner is within ten of its sides, tested against quadrature to .1 %.
// angle / sine comes from a polynomial (Abramowitz and Stegun 4.4.46, 2e-8), so its bits do not depend on the C library.
// Cost: at most five edges, each a square root and two divisions.
#ifndef NPSIM_RENDER_DETAIL_RECTANGLE_LIGHT_HPP
#define NPSIM_RENDER_DETAIL_RECTANGLE_LIGHT_HPP

#include <cmath>

#include "npsim/core/config.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace rectangle_detail {

// Of the angle whose cosine is x, over its sine.
[[nodiscard]] inline float angle_over_sine(float x) noexcept {
  const float y = std::fabs(x) < 1.0F ? std::fabs(x) : 1.0F;
  const float p =
      1.5707963050F +
      y * (-0.2145988016F +
           y * (0.0889789874F +
                y * (-0.0501743046F +
                     y * (0.0308918810F + y * (-0.0170881256F + y * (0.0066700901F - y * 0.0012624911F))))));
  const float root = p / std::sqrt(1.0F + y);  // acos(y) / sqrt(1 - y^2)
  if (x >= 0.0F) return root;
  const float sine = std::sqrt((1.0F - y) * (1.0F + y));
  return 3.14159265F / (sine > 1e-6F ? sine : 1e-6F) - root;
}

}  // namespace rectangle_detail

// Twice E / L as a vector, from what lies above the horizon of `normal`: dot(normal, vector) / 2 is E / L, and its
// direction is the mean direction of the light. Half sides u, v about `middle`, which is relative to the receiver;
// the receiver is on the side where light leaves.
[[nodiscard]] inline Vec3f rectangle_irradiance(const Vec3f& middle, const Vec3f& u, const Vec3f& v,
                                                const Vec3f& normal) noexcept {
  const Vec3f corner[4] = {middle - u - v, middle + u - v, middle + u + v, middle - u + v};
  Vec3f above[5];
  int count = 0;
  for (int i = 0; i < 4; ++i) {
    const Vec3f a = corner[i];
    const Vec3f b = corner[(i + 1) % 4];
    const float ha = dot(normal, a);
    const float hb = dot(normal, b);
    if (ha > 0.0F) above[count++] = a;
    if ((ha > 0.0F) != (hb > 0.0F)) above[count++] = a + (b - a) * (ha / (ha - hb));
  }
  if (count < 3) return {};
  Vec3f sum;
  for (int i = 0; i < count; ++i) above[i] = normalized(above[i]);
  for (int i = 0; i < count; ++i) {
    const Vec3f a = above[i];
    const Vec3f b = above[i + 1 < count ? i + 1 : 0];
    sum += cross(a, b) * rectangle_detail::angle_over_sine(dot(a, b));
  }
  return dot(normal, sum) < 0.0F ? -sum : sum;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_DETAIL_RECTANGLE_LIGHT_HPP
