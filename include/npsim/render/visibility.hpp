// SPDX-License-Identifier: Apache-2.0
// Visibility between emitters and surface points: the costly part of direct light, computed once for all variants.
//
// V(e, p) is the share of emitter e's patch that point p sees, stored in 1/255 steps: one shadow ray for an emitter
// that looks small from p, else four, one per quarter of the patch, and where these disagree (a penumbra) k x k more.
// Rays that leave below the receiver's horizon do not count: what lies there is no part of the illuminance.
// An occluder that hides part of a patch but none of the four rays is missed. It does not depend on which lamps are
// lit, nor on their strength or colour, so every night of one day shares it.
// Effort follows what is at stake, the unshadowed illuminance E at the emitter's peak intensity over all variants, times
// kShine where a surface mirrors or retroreflects, against c, the greater of cutoff_lx and cutoff_share times the light
// that is certain: what the point gets from lamps that every night lights.
//   E < c         V = 0, as for points behind the emitter or turned away from it
//   E < 10 c      every 16th point is traced; those between take the value of the last one, their neighbour in a row of
//                 the image, unless depth or normal say that it is another surface
//   E < 50 c      every 4th point, the same
//   else          every point
// So a shadow edge of a weak source may lie up to 15 pixels off in a row. The error of the direct illuminance at a
// point is at most  n_emitters * c + E / 510  away from shadow edges, plus there  50 c  per emitter at worst, plus the
// penumbra's sampling noise. Faces that carry an emitter's own mark do not block it: a lamp is not
// hidden by its own glass. Cost: one shadow ray per pair and sample, traced in batches of neighbouring points and one
// lamp. Memory: 18 KiB of stack.
#ifndef NPSIM_RENDER_VISIBILITY_HPP
#define NPSIM_RENDER_VISIBILITY_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/render/detail/area_light.hpp"
#include "npsim/render/surface_points.hpp"
#include "npsim/trace/scene.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct VisibilityParams {
  int samples_per_side = 4;    // k of the penumbra, 1..16
  float small_angle = 0.02F;   // patch side / distance below which one ray is enough
  float cutoff_lx = 5e-3F;     // full moon: 0.25 lx; city sky: 0.07 lx
  float cutoff_share = 2e-3F;  // of the illuminance that is certain
};

[[nodiscard]] inline Status validate(const VisibilityParams& p) noexcept {
  const bool good = p.samples_per_side >= 1 && p.samples_per_side <= 16 && p.cutoff_lx >= 0.0F &&
                    p.cutoff_share >= 0.0F && p.small_angle >= 0.0F;
  return good ? Status()
              : Status(StatusCode::invalid_argument,
                       "visibility: samples_per_side in 1..16, cutoff and angle not negative");
}

// Closer than so many of its longer sides the extent of a lit surface, a signal's disc or a tube counts. Beyond, the
// centre stands for it within 1 % of what it gives a receiver that faces it, and within 1 % of the square of side over
// distance elsewhere. A signal's disc of radius r is right within .8 (r/d)^2 of what it gives straight ahead; as a point
// it would be within 1.8 (r/d)^2. A sphere counts as one at any distance.
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
  const float distance = std::sqrt(squared);
  to_light = delta / distance;
  const float cosine = along / distance;
  const float floor_m2 = e.area_m2 > 0.0F ? e.area_m2 : 0.0F;
  return relative_intensity(e, -to_light) * cosine / (squared > floor_m2 ? squared : floor_m2);
}

namespace visibility_detail {

// How much brighter than a matt surface a wet road or a sign may look: GGX of alpha .12 has f = 5/sr where asphalt has
// .02, sheeting .3 to 250 where white has .13. [default] for both.
inline constexpr float kShine = 100.0F;

[[nodiscard]] inline float shine(const SurfacePoints& points, std::size_t p) noexcept {
  const bool wet = !points.film.empty() && points.film[p] != 0;
  const bool sign = !points.retro.empty() && points.retro[p].kind == RetroKind::sheeting;
  return wet || sign ? kShine : 1.0F;
}

inline constexpr std::size_t kPointsPerChunk = 2048;
inline constexpr std::size_t kRaysPerBatch = 256;  // room for the rays of one point

inline constexpr std::uint16_t kDark = 0xFFFF;

// What becomes of the points of a chunk under one emitter: `count` of them are traced, `traced` says which; point i
// takes the value of point like[i], kDark is 0. All counted from the chunk's first.
struct ChunkPlan {
  std::uint16_t traced[kPointsPerChunk];
  std::uint16_t like[kPointsPerChunk];
  std::size_t count = 0;
};

inline void plan_chunk(const VisibilityParams& params, const SurfacePoints& points, Span<const std::uint8_t> wanted,
                       Span<const float> certain_lx, const Emitter& emitter, float peak_cd, std::size_t begin,
                       std::size_t end, Span<float> untraced_lx, ChunkPlan& plan) noexcept {
  plan.count = 0;
  for (std::size_t p = begin; p < end; ++p) {
    std::uint16_t& like = plan.like[p - begin];
    like = kDark;
    if (!wanted.empty() && wanted[p] == 0) continue;
    Vec3f to_light;
    const float illuminance = peak_cd * illuminance_per_cd(emitter, points.position[p], points.normal[p], to_light);
    const float unshadowed = shine(points, p) * illuminance;
    const float cutoff = std::fmax(params.cutoff_lx, params.cutoff_share * certain_lx[p]);
    if (!(unshadowed > cutoff)) {
      untraced_lx[p] += illuminance;
      continue;
    }
    if (plan.count > 0) {
      const std::size_t stride = unshadowed < 10.0F * cutoff ? 16 : (unshadowed < 50.0F * cutoff ? 4 : 1);
      const std::size_t traced = begin + plan.traced[plan.count - 1];
      const bool same_surface =
          std::fabs(points.position[p].z - points.position[traced].z) < 0.03F * points.position[p].z &&
          dot(points.normal[p], points.normal[traced]) > 0.9F;
      if (p - traced < stride && same_surface) {
        like = plan.traced[plan.count - 1];
        continue;
      }
    }
    like = static_cast<std::uint16_t>(p - begin);
    plan.traced[plan.count++] = like;
  }
}

// A point of a chunk whose rays, side x side of them, wait in a batch.
struct Waiting {
  std::uint16_t point;
  std::uint16_t side;
};

// Rays of one emitter's chunk that wait to be traced together.
struct Batch {
  Ray rays[kRaysPerBatch];
  std::uint8_t above[kRaysPerBatch];  // the receiver's horizon
  std::uint8_t blocked[kRaysPerBatch];
  std::size_t count = 0;
};

// Adds the rays from a point to a patch of k x k strata; to the middle of the patch where k is 1.
inline void add_rays(const Emitter& emitter, const Vec3f& origin, const Vec3f& normal, int k, RandomStream& random,
                     Batch& batch) noexcept {
  for (int s = 0; s < k * k; ++s) {
    const float jitter_u = k == 1 ? 0.5F : random.uniform();
    const float jitter_v = k == 1 ? 0.5F : random.uniform();
    Ray& ray = batch.rays[batch.count++];
    ray = Ray{};
    ray.origin = origin;
    ray.direction = sample_point(emitter, origin, (static_cast<float>(s % k) + jitter_u) / static_cast<float>(k),
                                 (static_cast<float>(s / k) + jitter_v) / static_cast<float>(k)) -
                    origin;
    ray.t_max = 0.999F;
    batch.above[batch.count - 1] = k == 1 || dot(normal, ray.direction) > 0.0F ? 1 : 0;
  }
}

}  // namespace visibility_detail

// Of one emitter; `number`: which of the scene's it is, for the draws, one stream per pair. `scene`: see
// trace/scene.hpp. `peak_cd`: the greatest luminous intensity that it has in any variant. `face_mark[f]`: mark of the
// face's lamp, 0 for none. `wanted[p]`: 0 where nobody will ask; such points get 0; empty: all are wanted.
// `certain_lx[p]`: illuminance that every night brings. `visibility`: one element per point. What the emitter at its
// peak would bring where it is below the cut-off is added to `untraced_lx[p]`: a bound of what leaving it out costs.
template <class Scene, class Executor, class Observer>
Status compute_visibility(const VisibilityParams& params, std::uint64_t seed, const Scene& scene,
                          const SurfacePoints& points, Span<const std::uint8_t> wanted, Span<const float> certain_lx,
                          const Emitter& emitter, std::uint32_t number, float peak_cd,
                          Span<const std::uint16_t> face_mark, Span<std::uint8_t> visibility, Span<float> untraced_lx,
                          Executor& executor, Observer& observer) {
  using namespace visibility_detail;
  NPSIM_RETURN_IF_ERROR(validate(points));
  if (visibility.size() != points.size() || certain_lx.size() != points.size() || untraced_lx.size() != points.size() ||
      (!wanted.empty() && wanted.size() != points.size())) {
    return Status(StatusCode::shape_mismatch, "visibility: one byte and one illuminance per point");
  }
  NPSIM_RETURN_IF_ERROR(validate(params));
  const auto passes = [&](std::uint32_t face) noexcept {
    return emitter.mark == 0 || face >= face_mark.size() || face_mark[face] != emitter.mark;
  };
  const float extent = 2.0F * std::fmax(length(emitter.half_u_m), length(emitter.half_v_m));
  executor.for_chunks(points.size(), kPointsPerChunk, [&](std::size_t begin, std::size_t end) {
    if (observer.cancelled()) return;
    ChunkPlan plan;
    Batch batch;
    Waiting waiting[kRaysPerBatch];
    std::uint8_t* row = visibility.data() + begin;
    plan_chunk(params, points, wanted, certain_lx, emitter, peak_cd, begin, end, untraced_lx, plan);
    // First one ray or four of every point, then more of those that lie in a penumbra.
    std::size_t remaining = plan.count;
    for (const bool more : {false, true}) {
      std::size_t penumbra = 0;
      std::size_t waiting_count = 0;
      const auto trace = [&] {
        occluded(scene, Span<const Ray>(batch.rays, batch.count), passes,
                 Span<std::uint8_t>(batch.blocked, batch.count), Span<const std::uint8_t>(batch.above, batch.count));
        std::size_t ray = 0;
        for (std::size_t w = 0; w < waiting_count; ++w) {
          const int strata = waiting[w].side * waiting[w].side;
          int seen = 0;
          int above = 0;
          for (int s = 0; s < strata; ++s, ++ray) {
            above += batch.above[ray];
            seen += batch.above[ray] != 0 && batch.blocked[ray] == 0 ? 1 : 0;
          }
          const int counted = above > 0 ? above : 1;
          row[waiting[w].point] = static_cast<std::uint8_t>((255 * seen + counted / 2) / counted);
          if (!more && seen != 0 && seen != above) plan.traced[penumbra++] = waiting[w].point;
        }
        batch.count = 0;
        waiting_count = 0;
      };
      for (std::size_t t = 0; t < remaining; ++t) {
        const std::uint16_t i = plan.traced[t];
        const Vec3f origin = ray_start(points, begin + i);
        const bool small = extent < params.small_angle * length(emitter.centre_m - origin);
        const int k = more ? params.samples_per_side : (small ? 1 : 2);
        if (batch.count + static_cast<std::size_t>(k * k) > kRaysPerBatch) trace();
        RandomStream random(seed, RandomPurpose::direct, 0, number, static_cast<std::uint32_t>(begin + i), 0);
        if (more) {
          for (int drawn = 0; drawn < 8; ++drawn) static_cast<void>(random.uniform());  // by the first four rays
        }
        add_rays(emitter, origin, points.normal[begin + i], k, random, batch);
        waiting[waiting_count++] = {i, static_cast<std::uint16_t>(k)};
      }
      trace();
      remaining = penumbra;
    }
    for (std::size_t i = 0; i < end - begin; ++i) {
      row[i] = plan.like[i] == kDark ? std::uint8_t{0} : row[plan.like[i]];
    }
  });
  return observer.cancelled() ? Status(StatusCode::cancelled, "cancelled while tracing shadow rays") : Status();
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_VISIBILITY_HPP
