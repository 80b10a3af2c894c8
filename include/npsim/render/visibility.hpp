// SPDX-License-Identifier: Apache-2.0
// Visibility between emitters and surface points: the costly part of direct light, computed once for all variants.
//
// V(e, p) is the share of emitter e's patch that point p sees, stored in 1/255 steps: one shadow ray for an emitter that
// looks small from p, else four, one per quarter of the patch, and where these disagree (a penumbra) k x k more. An
// occluder that hides part of a patch but none of the four rays is missed. It does not depend on which lamps are
// lit, nor on their strength or colour, so every night of one day shares it.
// Effort follows what is at stake, the unshadowed illuminance E at the emitter's peak intensity over all variants:
//   E < cutoff_lx         V = 0, as for points behind the emitter or turned away from it
//   E < 50 cutoff_lx      every 16th point is traced; those between take the value of the last one, their neighbour in a
//   E < 500 cutoff_lx     every 4th point    row of the image, unless depth or normal say that it is another surface
//   else                  every point
// So a shadow edge of a weak source may lie up to 15 pixels off in a row. The error of the direct illuminance at a point
// is at most  n_emitters * cutoff_lx + E / 510  away from shadow edges, plus there  500 cutoff_lx  per emitter at worst,
// plus the penumbra's sampling noise.
// Faces that carry an emitter's own mark do not block it: a lamp is not hidden by its own glass.
// Cost: one shadow ray per pair and sample; memory: one byte per pair, emitter-major.
#ifndef NPSIM_RENDER_VISIBILITY_HPP
#define NPSIM_RENDER_VISIBILITY_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/random.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/render/surface_points.hpp"
#include "npsim/simd/isa.hpp"
#include "npsim/trace/bvh.hpp"

namespace npsim {
inline namespace v1 {

struct VisibilityParams {
  int samples_per_side = 4;         // k of the penumbra, 1..16
  float small_angle = 0.02F;        // patch side / distance below which one ray is enough
  float cutoff_lx = 5e-4F;          // full moon: 0.25 lx; city sky: 0.07 lx
  float relative_bias = 3e-3F;      // see pulled_out()
  std::uint64_t seed = 0;
};

[[nodiscard]] inline Status validate(const VisibilityParams& p) noexcept {
  const bool good = p.samples_per_side >= 1 && p.samples_per_side <= 16 && p.cutoff_lx >= 0.0F &&
                    p.small_angle >= 0.0F && p.relative_bias >= 0.0F && p.relative_bias < 1.0F;
  return good ? Status()
              : Status(StatusCode::invalid_argument,
                       "visibility: samples_per_side in 1..16, cutoff and angle not negative, bias in [0, 1)");
}

inline namespace NPSIM_ISA_NAMESPACE {

// Unshadowed illuminance (lx) at a point per candela of the emitter's peak intensity; `to_light` is the unit direction.
// The distance is bounded below by the patch size, where the point-source form would diverge.
[[nodiscard]] inline float illuminance_per_cd(const Emitter& e, const Vec3f& position, const Vec3f& normal,
                                              Vec3f& to_light) noexcept {
  const Vec3f delta = e.centre_m - position;
  const float along = dot(normal, delta);
  if (!(along > 0.0F)) return 0.0F;
  const float squared = dot(delta, delta);
  const float distance = std::sqrt(squared);
  to_light = delta / distance;
  const float cosine = along / distance;
  const float floor_m2 = e.area_m2 > 0.0F ? e.area_m2 : 0.0F;
  return relative_intensity(e, -to_light) * cosine / (squared > floor_m2 ? squared : floor_m2);
}

// `peak_cd[e]`: greatest luminous intensity that emitter e has in any variant; 0 skips it. `face_mark[f]`: mark of the
// face's pixel, 0 for none. `visibility` has emitters * points elements.
template <class Executor, class Observer>
Status compute_visibility(const VisibilityParams& params, const Bvh& bvh, const SurfacePoints& points,
                          Span<const Emitter> emitters, Span<const float> peak_cd, Span<const std::uint16_t> face_mark,
                          Span<std::uint8_t> visibility, Executor& executor, Observer& observer) {
  NPSIM_RETURN_IF_ERROR(validate(points));
  if (peak_cd.size() != emitters.size() || visibility.size() != emitters.size() * points.size()) {
    return Status(StatusCode::shape_mismatch, "visibility needs one peak per emitter and one byte per pair");
  }
  NPSIM_RETURN_IF_ERROR(validate(params));
  constexpr std::size_t kChunk = 2048;
  executor.for_chunks(points.size(), kChunk, [&](std::size_t begin, std::size_t end) {
    if (observer.cancelled()) return;
    for (std::size_t e = 0; e < emitters.size(); ++e) {
      const Emitter& emitter = emitters[e];
      std::uint8_t* row = visibility.data() + e * points.size();
      if (!(peak_cd[e] > 0.0F)) {
        for (std::size_t p = begin; p < end; ++p) row[p] = 0;
        continue;
      }
      const auto passes = [&](std::uint32_t face) {
        return emitter.mark == 0 || face >= face_mark.size() || face_mark[face] != emitter.mark;
      };
      std::size_t traced = begin;  // the last point for which rays were traced, if traced_any
      bool traced_any = false;
      std::uint32_t blocker = kNoFace;  // of the last ray that met one
      const float extent = 2.0F * std::fmax(length(emitter.half_u_m), length(emitter.half_v_m));
      for (std::size_t p = begin; p < end; ++p) {
        row[p] = 0;
        Vec3f to_light;
        const Vec3f position = points.position[p];
        const float unshadowed =
            peak_cd[e] * illuminance_per_cd(emitter, position, points.normal[p], to_light);
        if (!(unshadowed > params.cutoff_lx)) continue;
        const std::size_t stride =
            unshadowed < 50.0F * params.cutoff_lx ? 16 : (unshadowed < 500.0F * params.cutoff_lx ? 4 : 1);
        const bool same_surface =
            std::fabs(points.position[p].z - points.position[traced].z) < 0.03F * points.position[p].z &&
            dot(points.normal[p], points.normal[traced]) > 0.9F;
        if (traced_any && p - traced < stride && same_surface) {
          row[p] = row[traced];
          continue;
        }
        traced = p;
        traced_any = true;
        const Vec3f origin = pulled_out(position, points.normal[p], params.relative_bias);
        const float distance = length(emitter.centre_m - origin);
        RandomStream random(params.seed, RandomPurpose::direct, 0, static_cast<std::uint32_t>(e),
                            static_cast<std::uint32_t>(p), 0);
        // Rays that see a patch of k x k strata; the middle of the patch where k is 1.
        const auto rays_that_see = [&](int k) {
          int seen = 0;
          for (int s = 0; s < k * k; ++s) {
            const float jitter_u = k == 1 ? 0.5F : random.uniform();
            const float jitter_v = k == 1 ? 0.5F : random.uniform();
            Ray ray;
            ray.origin = origin;
            ray.direction = sample_point(emitter, (static_cast<float>(s % k) + jitter_u) / static_cast<float>(k),
                                         (static_cast<float>(s / k) + jitter_v) / static_cast<float>(k)) -
                            origin;
            ray.t_max = 0.999F;
            if (!occluded(bvh, ray, passes, blocker)) ++seen;
          }
          return seen;
        };
        int k = extent < params.small_angle * distance ? 1 : 2;
        int seen = rays_that_see(k);
        if (seen != 0 && seen != k * k) {
          k = params.samples_per_side;
          seen = rays_that_see(k);
        }
        row[p] = static_cast<std::uint8_t>((255 * seen + k * k / 2) / (k * k));
      }
    }
    observer.progress(end, points.size());
  });
  return observer.cancelled() ? Status(StatusCode::cancelled, "cancelled while tracing shadow rays") : Status();
}

}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_RENDER_VISIBILITY_HPP
