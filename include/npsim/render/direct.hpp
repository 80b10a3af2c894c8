// SPDX-License-Identifier: Apache-2.0
// What the camera sees of the light that a lamp brings to a point (visibility.hpp).
//
//   L(p) = E(p) * bsdf(camera, light)   luminance towards the camera, cd/m2, linear RGB; E: illuminance, lx
//        + E(p) / cos * albedo * strength * retroreflection(camera, light)
// f0: of dry surfaces; under a film of water its own. What is retroreflected reaches the camera alone: no other surface
// lies where the lamp is.
// Gloss takes the mean direction of the light, so a mirrored window is as wide as the lobe.
// Cost: one evaluation.
#ifndef NPSIM_RENDER_DIRECT_HPP
#define NPSIM_RENDER_DIRECT_HPP

#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/material/bsdf.hpp"
#include "npsim/material/retroreflection.hpp"
#include "npsim/material/wet_film.hpp"
#include "npsim/render/surface_points.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

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
