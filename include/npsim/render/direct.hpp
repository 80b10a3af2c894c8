// SPDX-License-Identifier: Apache-2.0
// Direct light of one variant: the lit emitters, weighted by their visibility.
//
//   E(p) = sum_e V(e, p) I_e f_e(direction) cos / d^2                       illuminance, lx, linear RGB
//   L(p) = sum_e V(e, p) I_e f_e(direction) cos / d^2 * bsdf(camera, light)   luminance towards the camera, cd/m2
//        + sum_e V(e, p) I_e f_e(direction) / d^2 * albedo * strength * retroreflection(camera, light)
// f0: of dry surfaces; under a film of water its own. What is retroreflected reaches the camera alone: no other surface
// lies where the lamp is.
// Lit surfaces (windows, signs) within eight of their sides count by Lambert's closed form for their rectangle, exact to
// .1 % where nothing stands in the way; what hides a part of them counts by V as if it hid its share everywhere. Beyond,
// and for every other lamp, a point at the centre stands for them, within 1 %; gloss takes the mean direction of the
// light, so a mirrored window is as wide as the lobe.
// Cost: one evaluation per pair with V > 0. Every point sums in emitter order, so the bits never depend on threads.
#ifndef NPSIM_RENDER_DIRECT_HPP
#define NPSIM_RENDER_DIRECT_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/light/activation.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/material/bsdf.hpp"
#include "npsim/material/retroreflection.hpp"
#include "npsim/material/wet_film.hpp"
#include "npsim/render/surface_points.hpp"
#include "npsim/render/visibility.hpp"

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

// `activations` and `emitters` agree in length; `visibility` is that of compute_visibility().
template <class Executor>
Status direct_light(const SurfacePoints& points, Span<const Emitter> emitters, Span<const Activation> activations,
                    Span<const std::uint8_t> visibility, float f0, Span<Vec3f> illuminance, Span<Vec3f> luminance_out,
                    Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(points));
  if (activations.size() != emitters.size() || visibility.size() != emitters.size() * points.size() ||
      illuminance.size() != points.size() || luminance_out.size() != points.size()) {
    return Status(StatusCode::shape_mismatch, "direct light: array lengths disagree");
  }
  executor.for_chunks(points.size(), 2048, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) illuminance[p] = luminance_out[p] = Vec3f{};
    for (std::size_t e = 0; e < emitters.size(); ++e) {
      if (!activations[e].lit) continue;
      const std::uint8_t* seen = visibility.data() + e * points.size();
      const Vec3f intensity = activations[e].intensity_cd;
      for (std::size_t p = begin; p < end; ++p) {
        if (seen[p] == 0) continue;
        Vec3f to_light;
        const float per_cd = illuminance_per_cd(emitters[e], points.position[p], points.normal[p], to_light);
        const Vec3f received = intensity * (per_cd * static_cast<float>(seen[p]) * (1.0F / 255.0F));
        illuminance[p] += received;
        const Vec3f to_camera = normalized(-points.position[p]);
        const float interface_f0 = points.film.empty() ? f0 : film_f0(f0, points.film[p]);
        luminance_out[p] += received * eval_bsdf(points.albedo[p], points.alpha[p], interface_f0, points.normal[p],
                                                 to_camera, to_light);
        if (!points.retro.empty() && points.retro[p].kind != RetroKind::none) {
          luminance_out[p] += retroreflected(points, p, received, to_camera, to_light);
        }
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_DIRECT_HPP
