// SPDX-License-Identifier: Apache-2.0
// Reflection of a dielectric street surface: Lambert under a rough interface, or Lambert alone.
//
//   f(wi, wo) = (1 - E(n.wi)) (1 - E(n.wo)) / (1 - mean E) albedo / pi + D(h) V(wi, wo) F(wi.h)
// D and V are GGX with height-correlated Smith masking (Walter et al., EGSR 2007; Heitz, JCGT 2014), F is Schlick's
// Fresnel term, E the directional albedo of the second part (detail/specular_albedo.hpp). The diffuse part is
// reciprocal and takes exactly what the interface lets through (Kelemen and Szirmay-Kalos, EG 2001). With 1 - F(n.w)
// instead, a dry road 30 m ahead, seen and lit at two degrees, would keep a fiftieth of its light: no facet is grazed
// where the mean is. Invariants, tested: f(wi, wo) = f(wo, wi) to 1e-5 relative; f >= 0 and finite for every input, 0
// below the horizon; a white dielectric (f0 <= 0.1) in a white furnace reflects 1 within 0.005 at every angle and
// roughness. Cost: seven square roots, four divisions, two table look-ups. `alpha` is kept at or above kMinAlpha, where
// float still resolves the lobe.
#ifndef NPSIM_MATERIAL_BSDF_HPP
#define NPSIM_MATERIAL_BSDF_HPP

#include <cmath>

#include "npsim/core/config.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/material/detail/specular_albedo.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr float kMinAlpha = 0.02F;

// As alpha, it and all above 1: no interface, f = albedo / pi. Leaves, blades and fibres lie in all directions and have
// no common normal by which they would shine; a skin over them would, ever more towards grazing angles, and be grey
// there whatever their colour. What single leaves mirror is in the albedo.
inline constexpr float kMatt = 2.0F;

[[nodiscard]] constexpr float fresnel_schlick(float f0, float cosine) noexcept {
  const float t = cosine < 1.0F ? (cosine > 0.0F ? 1.0F - cosine : 1.0F) : 0.0F;
  const float t2 = t * t;
  return f0 + (1.0F - f0) * (t2 * t2 * t);
}

// 1/sr, without the cosine. n, wo, wi are unit; wo leads to the eye and wi to the light, both away from the surface.
[[nodiscard]] inline Vec3f eval_bsdf(const Vec3f& albedo, float alpha, float f0, const Vec3f& n, const Vec3f& wo,
                                     const Vec3f& wi) noexcept {
  constexpr float kInvPi = 0.31830989F;
  const float no = dot(n, wo);
  const float ni = dot(n, wi);
  if (!(no > 0.0F) || !(ni > 0.0F)) return {};
  if (alpha > 1.0F) return albedo * kInvPi;
  const float a = alpha > kMinAlpha ? alpha : kMinAlpha;
  const SpecularAlbedo reflected(a, f0);
  const float mean_through = 1.0F - reflected.mean();
  const float through = (1.0F - reflected(no)) * (1.0F - reflected(ni)) / (mean_through > 1e-3F ? mean_through : 1e-3F);
  const Vec3f diffuse = albedo * ((through > 0.0F ? through : 0.0F) * kInvPi);

  const Vec3f sum = wo + wi;
  // Opposite directions, both grazing, leave nothing to normalise; the microfacet is then the surface.
  const Vec3f h = dot(sum, sum) > 1e-20F ? normalized(sum) : n;
  const float a2 = a * a;
  // 1 - (n.h)^2 as |n x h|^2: no cancellation in the middle of a narrow lobe.
  const Vec3f off = cross(n, h);
  const float nh = dot(n, h);
  const float d = dot(off, off) + a2 * nh * nh;
  const float lobe = a2 * kInvPi / (d * d);
  const float masking = no * std::sqrt(a2 + (1.0F - a2) * ni * ni) + ni * std::sqrt(a2 + (1.0F - a2) * no * no);
  const float specular = lobe * 0.5F / (masking > 1e-7F ? masking : 1e-7F) * fresnel_schlick(f0, dot(wi, h));
  return diffuse + Vec3f{specular, specular, specular};
}

// Two unit vectors that complete n to a right-handed frame (Duff et al., JCGT 2017).
inline void tangent_frame(const Vec3f& n, Vec3f& t, Vec3f& b) noexcept {
  const float sign = std::copysign(1.0F, n.z);
  const float a = -1.0F / (sign + n.z);
  const float c = n.x * n.y * a;
  t = {1.0F + sign * n.x * n.x * a, sign * c, -sign * n.x};
  b = {c, sign + n.y * n.y * a, -n.y};
}

// A unit vector about n with density cosine / pi, from u, v in [0, 1): a point of the disc lifted to the hemisphere.
[[nodiscard]] inline Vec3f sample_cosine(const Vec3f& n, float u, float v) noexcept {
  const auto [x, y] = concentric_disc(u, v);
  const float z2 = 1.0F - x * x - y * y;
  const float z = std::sqrt(z2 > 0.0F ? z2 : 0.0F);
  Vec3f t, bt;
  tangent_frame(n, t, bt);
  return normalized(t * x + bt * y + n * z);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_BSDF_HPP
