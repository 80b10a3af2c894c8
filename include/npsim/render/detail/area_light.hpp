// SPDX-License-Identifier: Apache-2.0
// Irradiance from shapes of constant luminance: parallelogram, disc, sphere and tube, cut by the receiver's horizon.
//
//   polygon  E = L / 2 * sum over the edges of  angle(a, b) * dot(n, a x b) / |a x b|   (Lambert, Photometria, 1760)
//            with a, b the directions to the ends of an edge, of the part above the horizon.
//            Exact but for rounding: 1e-5 relative where the nearest corner is within ten of the sides.
//   disc     as the regular polygon of 16 sides and the same area, whose second moment is right to 1.4e-4. Within .1 %
//            from three tenths of the radius off its rim on; nearer, that of a disc whose radius is up to 1.3 % off.
//   sphere   whole above the horizon E = pi L (r/d)^2 cos, exactly a point's; cut by it, the integral over the part of
//            the cone above (Snyder, Area Light Sources for Real-Time Graphics, 1996).
//   tube     thin and straight: the integral of sine^2 / h cosine along its part above the horizon, closed. The radius
//            counts for its area and keeps a receiver out. Exact before an endless tube; from ten radii on within 2 % of
//            what a receiver that faces it gets, worst where the horizon runs along the tube.
// Tested against quadrature in double. Cost: two square roots and four divisions an edge; else a few dozen operations.
#ifndef NPSIM_RENDER_DETAIL_AREA_LIGHT_HPP
#define NPSIM_RENDER_DETAIL_AREA_LIGHT_HPP

#include <cmath>
#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace area_light_detail {

// Twice E / L as a vector, from what lies above the horizon of `normal`: dot(normal, vector) / 2 is E / L, and its
// direction is the mean direction of the light. Corners are relative to the receiver, which is on the side where light
// leaves.
template <std::size_t kCorners>
[[nodiscard]] inline Vec3f polygon_irradiance(const Vec3f (&corner)[kCorners], const Vec3f& normal) noexcept {
  Vec3f above[kCorners + 1];
  std::size_t count = 0;
  for (std::size_t i = 0; i < kCorners; ++i) {
    const Vec3f a = corner[i];
    const Vec3f b = corner[(i + 1) % kCorners];
    const float ha = dot(normal, a);
    const float hb = dot(normal, b);
    if (ha > 0.0F) above[count++] = a;
    if ((ha > 0.0F) != (hb > 0.0F)) above[count++] = a + (b - a) * (ha / (ha - hb));
  }
  if (count < 3) return {};
  Vec3f sum;
  for (std::size_t i = 0; i < count; ++i) above[i] = normalized(above[i]);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f a = above[i];
    const Vec3f b = above[i + 1 < count ? i + 1 : 0];
    const Vec3f upright = cross(a, b);
    const float sine = length(upright);
    // Of a chord that passes the receiver the angle nears pi, and the sine keeps what the cosine has lost.
    if (sine > 0.0F) sum += upright * (angle_of(sine, dot(a, b)) / sine);
  }
  return dot(normal, sum) < 0.0F ? -sum : sum;
}

}  // namespace area_light_detail

// Half sides u, v about `middle`.
[[nodiscard]] inline Vec3f rectangle_irradiance(const Vec3f& middle, const Vec3f& u, const Vec3f& v,
                                                const Vec3f& normal) noexcept {
  const Vec3f corner[4] = {middle - u - v, middle + u - v, middle + u + v, middle - u + v};
  return area_light_detail::polygon_irradiance(corner, normal);
}

// Half axes u, v about `middle`.
[[nodiscard]] inline Vec3f disc_irradiance(const Vec3f& middle, const Vec3f& u, const Vec3f& v,
                                           const Vec3f& normal) noexcept {
  // Cosines of 0, 22.5, 45, 67.5 and 90 degrees, times the radius of the 16-gon of the unit disc's area.
  constexpr float kCosine[5] = {1.0130024F, 0.9358927F, 0.7163009F, 0.3876574F, 0.0F};
  Vec3f corner[16];
  for (int i = 0; i < 4; ++i) {
    const Vec3f a = u * kCosine[i] + v * kCosine[4 - i];
    const Vec3f b = v * kCosine[i] - u * kCosine[4 - i];
    corner[i] = middle + a;
    corner[i + 4] = middle + b;
    corner[i + 8] = middle - a;
    corner[i + 12] = middle - b;
  }
  return area_light_detail::polygon_irradiance(corner, normal);
}

// E / L of a sphere whose centre is at `distance`, `along` up the receiver's normal. Inside it: as on its surface.
[[nodiscard]] inline float sphere_irradiance(float along, float distance, float radius) noexcept {
  constexpr float kPi = 3.14159265F;
  if (!(along > -radius)) return 0.0F;
  const float h = distance > 1.0001F * radius ? distance / radius : 1.0001F;
  const float cosine = distance > 0.0F ? along / distance : 1.0F;
  const float h2 = h * h;
  if (!(h * std::fabs(cosine) < 1.0F)) return cosine > 0.0F ? kPi * cosine / h2 : 0.0F;
  const float sine = std::sqrt(1.0F - cosine * cosine);
  const float tangent = std::sqrt(h2 - 1.0F);  // to the sphere, in radii
  const float cut = -cosine * tangent / sine;  // where the horizon cuts the cone's rim, as a cosine
  const float rest = (1.0F - cut) * (1.0F + cut);
  const float edge = std::sqrt(rest > 0.0F ? rest : 0.0F);
  const float value = (cosine * angle_of(edge, cut) - tangent * sine * edge) / h2 + angle_of(sine * edge, tangent);
  return value > 0.0F ? value : 0.0F;
}

// E per cd of intensity across a tube with half length u about `middle`: I times the sine of the angle to the tube.
[[nodiscard]] inline Vec3f tube_irradiance(const Vec3f& middle, const Vec3f& u, float radius,
                                           const Vec3f& normal) noexcept {
  const float half = length(u);
  if (!(half > 0.0F)) return {};
  const Vec3f along = u / half;
  const float offset = dot(along, middle);  // positions along the tube count from the foot of the receiver
  const Vec3f foot = middle - along * offset;
  const float squared = dot(foot, foot);
  const float h2 = squared > radius * radius ? squared : radius * radius;
  const float h = std::sqrt(h2);
  float begin = offset - half;
  float end = offset + half;
  const float rise = dot(normal, along);
  const float height = dot(normal, foot);
  // What lies above the horizon.
  if (height + rise * begin <= 0.0F && height + rise * end <= 0.0F) return {};
  if (height + rise * begin < 0.0F) begin = -height / rise;
  if (height + rise * end < 0.0F) end = -height / rise;
  const auto of_foot = [&](float t) { return t / (2.0F * (h2 + t * t)) + angle_of(t, h) / (2.0F * h); };
  const auto of_along = [&](float t) { return -0.5F * h2 / (h2 + t * t); };
  return (foot * (of_foot(end) - of_foot(begin)) + along * (of_along(end) - of_along(begin))) / (2.0F * half * h);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_DETAIL_AREA_LIGHT_HPP
