// SPDX-License-Identifier: Apache-2.0
// Angles, and points of the unit disc, by short polynomials: the bits do not depend on the C library.
//
// angle_of(): Abramowitz and Stegun 4.4.49, 2e-8 before rounding, 4e-7 with it. concentric_disc(): the map of the
// square to the disc that keeps areas and neighbours (Shirley and Chiu 1997); its angles stay within pi/4, where sine
// and cosine are right to 4e-7.
#ifndef NPSIM_CORE_CIRCLE_HPP
#define NPSIM_CORE_CIRCLE_HPP

#include <cmath>

#include "npsim/core/config.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Of the vector (x, y) from the x axis, -pi to pi; 0 for the zero vector.
[[nodiscard]] inline float angle_of(float y, float x) noexcept {
  constexpr float kHalfPi = 1.57079633F;
  const float ax = std::fabs(x);
  const float ay = std::fabs(y);
  const bool steep = ay > ax;
  const float longer = steep ? ay : ax;
  if (!(longer > 0.0F)) return 0.0F;
  const float t = (steep ? ax : ay) / longer;
  const float q = t * t;
  const float series =
      1.0F +
      q * (-0.3333314528F +
           q * (0.1999355085F +
                q * (-0.1420889944F +
                     q * (0.1065626393F +
                          q * (-0.0752896400F + q * (0.0429096138F + q * (-0.0161657367F + q * 0.0028662257F)))))));
  float angle = t * series;
  if (steep) angle = kHalfPi - angle;
  if (x < 0.0F) angle = 2.0F * kHalfPi - angle;
  return y < 0.0F ? -angle : angle;
}

// A point of the unit disc from u, v in [0, 1), uniform where they are.
[[nodiscard]] inline Vec2f concentric_disc(float u, float v) noexcept {
  const float a = 2.0F * u - 1.0F;
  const float b = 2.0F * v - 1.0F;
  if (a == 0.0F && b == 0.0F) return {};
  const bool wide = std::fabs(a) > std::fabs(b);
  const float radius = wide ? a : b;
  const float angle = 0.78539816F * (wide ? b / a : a / b);
  const float q = angle * angle;
  const float sine = angle * (1.0F + q * (-1.0F / 6.0F + q * (1.0F / 120.0F - q * (1.0F / 5040.0F))));
  const float cosine = 1.0F + q * (-0.5F + q * (1.0F / 24.0F + q * (-1.0F / 720.0F + q * (1.0F / 40320.0F))));
  return {radius * (wide ? cosine : sine), radius * (wide ? sine : cosine)};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_CORE_CIRCLE_HPP
