// SPDX-License-Identifier: Apache-2.0
// Direct light: what a lamp brings to a point, and what the camera sees of it.
#ifndef NPSIM_RENDER_DIRECT_HPP
#define NPSIM_RENDER_DIRECT_HPP

#include <cmath>
#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/material/bsdf.hpp"
#include "npsim/material/retroreflection.hpp"
#include "npsim/material/roughness.hpp"
#include "npsim/render/detail/area_light.hpp"
#include "npsim/render/surface_points.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Illuminance that a lamp brings to a point with nothing in between: by its shape near it, as a point's farther off.
//
//   E = I_peak * illuminance_per_cd,   in lx for I in cd
// Lit surfaces (windows, signs) within eight of their sides count by Lambert's closed form for their rectangle; beyond,
// a point at the centre stands for them.
// Error: within 1 % of the integral over the shape, .1 % by that form; see is_extended() and detail/area_light.hpp.
// Cost: two square roots and a profile; near a surface that shines, its closed form.

// Closer than so many of its longer sides the extent of a lit surface, a signal's disc or a tube counts. Beyond, the
// centre stands for it within 1 % of what it gives a receiver that faces it, and within 1 % of the square of side over
// distance elsewhere. A signal's disc of radius r is right within .8 (r/d)^2 of what it gives straight ahead; as a
// point it would be within 1.8 (r/d)^2. A sphere counts as one at any distance.
inline constexpr float kPointFromSides = 8.0F;

// Whether an emitter that is no sphere is near enough for its extent to count; `squared`: of its centre's distance.
[[nodiscard]] inline bool is_extended(const Emitter& e, float squared) noexcept {
  const bool disc = e.shape == EmitterShape::disc;
  if (e.profile != EmissionProfile::lambert && !(disc && e.profile == EmissionProfile::signal)) return false;
  const float u2 = dot(e.half_u_m, e.half_u_m);
  const float v2 = dot(e.half_v_m, e.half_v_m);
  if (!(squared < 4.0F * kPointFromSides * kPointFromSides * (u2 > v2 ? u2 : v2))) return false;
  if (e.shape == EmitterShape::tube) return true;
  // Where no wall was found, patch and axis need not agree: such a lamp has a place and no shape.
  const Vec3f across = cross(e.half_u_m, e.half_v_m);
  const float along = dot(across, e.axis);
  return along * along > 0.96F * dot(across, across);
}

// Of a lamp that is a point to the points asked: no sphere, and nowhere extended. F: a batch of simd/batch.hpp.
template <class F>
[[nodiscard]] F illuminance_as_point_per_cd(const Emitter& e, const simd::F32x3<F>& position,
                                            const simd::F32x3<F>& normal, simd::F32x3<F>& to_light) noexcept {
  const simd::F32x3<F> delta{F(e.centre_m.x) - position.x, F(e.centre_m.y) - position.y, F(e.centre_m.z) - position.z};
  const F squared = delta.x * delta.x + delta.y * delta.y + delta.z * delta.z;
  const F along = normal.x * delta.x + normal.y * delta.y + normal.z * delta.z;
  const F distance = sqrt(squared);
  to_light = {delta.x / distance, delta.y / distance, delta.z / distance};
  const F leaving = relative_intensity<F>(e, {-to_light.x, -to_light.y, -to_light.z});
  const F floor_m2(e.area_m2 > 0.0F ? e.area_m2 : 0.0F);
  return select(along > F(0.0F), leaving * (along / distance) / max(squared, floor_m2), F(0.0F));
}

// Unshadowed illuminance (lx) at a point per candela of the emitter's peak intensity; `to_light` is the unit direction.
// By the emitter's shape where that counts: `to_light` is then the mean direction of what lies above the horizon, and
// what a profile does besides a constant luminance, it does in that direction. Of every other lamp as a point: the
// distance is bounded below by the patch size, where that form would diverge.
[[nodiscard]] inline float illuminance_per_cd(const Emitter& e, const Vec3f& position, const Vec3f& normal,
                                              Vec3f& to_light) noexcept {
  constexpr float kPi = 3.14159265F;
  const Vec3f delta = e.centre_m - position;
  const float squared = dot(delta, delta);
  const float along = dot(normal, delta);
  if (e.shape == EmitterShape::sphere) {
    const float radius2 = dot(e.half_u_m, e.half_u_m);
    const float radius = std::sqrt(radius2);
    const float arriving = sphere_irradiance(along, std::sqrt(squared), radius);
    if (!(arriving > 0.0F)) return 0.0F;
    to_light = normalized(along < radius ? delta + normal * (0.5F * (radius - along)) : delta);
    return relative_intensity(e, -normalized(delta)) * arriving / (kPi * radius2);
  }
  if (is_extended(e, squared)) {
    if (e.shape == EmitterShape::tube) {
      const Vec3f arriving = tube_irradiance(delta, e.half_u_m, length(e.half_v_m), normal);
      to_light = normalized(arriving);
      const float received = dot(normal, arriving);
      return received > 0.0F ? received : 0.0F;
    }
    if (!(dot(e.axis, delta) < 0.0F)) return 0.0F;  // behind it
    // Wholly below the horizon, as a facade sees its own windows.
    if (!(along + std::fabs(dot(normal, e.half_u_m)) + std::fabs(dot(normal, e.half_v_m)) > 0.0F)) return 0.0F;
    const bool disc = e.shape == EmitterShape::disc;
    const Vec3f arriving = disc ? disc_irradiance(delta, e.half_u_m, e.half_v_m, normal)
                                : rectangle_irradiance(delta, e.half_u_m, e.half_v_m, normal);
    const float twice = dot(normal, arriving);
    if (!(twice > 0.0F)) return 0.0F;
    to_light = normalized(arriving);
    const float per_cd = twice / ((disc ? 2.0F * kPi : 8.0F) * length(cross(e.half_u_m, e.half_v_m)));
    if (e.profile == EmissionProfile::lambert) return per_cd;
    const float c = -dot(e.axis, to_light);
    return c > 0.0F ? per_cd * (c * c * c) : 0.0F;  // of a signal, whose intensity falls as the fourth power
  }
  if (!(along > 0.0F)) return 0.0F;
  using F = simd::scalar::F32;
  simd::F32x3<F> towards;
  const F arriving = illuminance_as_point_per_cd<F>(e, {F(position.x), F(position.y), F(position.z)},
                                                    {F(normal.x), F(normal.y), F(normal.z)}, towards);
  to_light = {towards.x.value, towards.y.value, towards.z.value};
  return arriving.value;
}

// What the camera sees of the light that a lamp brings to a point (visibility.hpp).
//
//   L(p) = E(p) * bsdf(camera, light)   luminance towards the camera, cd/m2, linear RGB; E: illuminance, lx
//        + E(p) / cos * albedo * strength * retroreflection(camera, light)
// f0: of dry surfaces; under a film of water its own. What is retroreflected reaches the camera alone: no other surface
// lies where the lamp is.
// Gloss takes the mean direction of the light, so a mirrored window is as wide as the lobe.
// Cost: one evaluation.

// Of light that comes from a unit direction and makes the illuminance `received` on the surface.
[[nodiscard]] inline Vec3f retroreflected(const SurfacePoints& points, std::size_t p, const Vec3f& received,
                                          const Vec3f& to_camera, const Vec3f& to_light) noexcept {
  const Retroreflector retro = points.retro[p];
  const float cosine = dot(points.normal[p], to_light);
  const float per_lx = eval_retroreflection(retro.kind, points.normal[p], to_camera, to_light);
  return cosine > 0.0F ? points.albedo[p] * received * (retro.strength * per_lx / cosine) : Vec3f{};
}

// Luminance towards the camera, cd/m2, of white light that makes the illuminance `lx` from the unit direction
// `to_light`.
[[nodiscard]] inline Vec3f direct_light(const SurfacePoints& points, std::size_t p, float lx, const Vec3f& to_light,
                                        float f0) noexcept {
  const Vec3f received{lx, lx, lx};
  const Vec3f to_camera = normalized(-points.position[p]);
  const float interface_f0 = points.film.empty() ? f0 : film_f0(f0, points.film[p]);
  Vec3f seen =
      received * eval_bsdf(points.albedo[p], points.alpha[p], interface_f0, points.normal[p], to_camera, to_light);
  if (!points.retro.empty() && points.retro[p].kind != RetroKind::none) {
    seen += retroreflected(points, p, received, to_camera, to_light);
  }
  return seen;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_DIRECT_HPP
