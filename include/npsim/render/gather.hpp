// SPDX-License-Identifier: Apache-2.0
// Where indirect light comes from: surfaces in the picture, the street outside it, and the sky.
#ifndef NPSIM_RENDER_GATHER_HPP
#define NPSIM_RENDER_GATHER_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/light/light_set.hpp"
#include "npsim/material/bsdf.hpp"
#include "npsim/render/light_images.hpp"
#include "npsim/render/surface_points.hpp"
#include "npsim/trace/scene.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// The light of the street that the camera does not see. A street goes on behind and beside the camera, and behind what
// stands in the picture; rays that leave the modelled scene there, or meet the back of a surface, find neither lamp nor
// sky, but surfaces a share as bright as those in the picture.
//
// With s the sine of its elevation a ray that leaves sees
//   s < 0           the share of the mean luminance of what the picture shows below the camera's height,
//   0 <= s < top    that of what it shows above, times w = (1 - s / top)^2: it falls off like the light of lamps that
//                   shine down; the rest, 1 - w, is sky;
// and one that meets the back of a surface, which stands, that of what the picture shows above.
// The share is less than 1 because the picture shows a lit road from near by, and much of what it does not show is
// yards and backs: against the true nights of generated streets houses come out .5 stops too bright with the whole
// mean, .13 with half of it, .03 with the default (bias, seeds 1 to 8); at two places whose real night is known they
// are too bright with either.
// Means are over the pixels that show a surface, of direct light alone, and without the own headlamps, which light the
// picture and nothing else; so this light is linear in the lamps, and nights remain sums of their lamps. No mean
// exceeds what surfaces send out, so no light is created. Error: the difference between the street that is seen and
// that which is not; of the mean itself, taken over every 17th pixel, about 1 %.
// Cost: one sum over every 17th pixel. Memory: none.

struct UnseenStreetParams {
  float share = 0.35F;  // of the means that the unseen street has, 0..1; 0: it is dark
  float top = 0.7F;     // sine of the elevation at which its houses end, 0..1: as high as the street is wide [default]
};

[[nodiscard]] inline Status validate(const UnseenStreetParams& p) noexcept {
  const bool good = p.share >= 0.0F && p.share <= 1.0F && p.top > 0.0F && p.top <= 1.0F;
  return good ? Status() : Status(StatusCode::invalid_argument, "unseen street: share in [0, 1], top in (0, 1]");
}

// How much of each of the two means a ray sees that is left without a surface: x below the horizon, y above it.
[[nodiscard]] inline Vec2f unseen_weights(const UnseenStreetParams& p, float sine) noexcept {
  if (!(p.share > 0.0F)) return {};
  if (sine < 0.0F) return {p.share, 0.0F};
  const float t = sine < p.top ? 1.0F - sine / p.top : 0.0F;
  return {0.0F, p.share * (t * t)};
}

// Mean luminance of the surfaces in the picture, cd/m2, linear RGB.
struct UnseenStreetLight {
  Vec3f below, above;  // the camera's height

  [[nodiscard]] Vec3f luminance(const Vec2f& weights) const noexcept { return below * weights.x + above * weights.y; }
};

// Of kLightsAtOnce lights: `exitance` of direct light, kLightLanes a point. receivers: the points that pixels show; up:
// unit.
inline void unseen_street_light(const SurfacePoints& points, Span<const std::uint32_t> receivers, const Vec3f& up,
                                Span<const float> exitance, UnseenStreetLight (&out)[kLightsAtOnce]) noexcept {
  constexpr std::size_t kEvery = 17;  // no divisor of an image's width, so that the pixels are no columns
  constexpr float kInversePi = 0.31830989F;
  float below = 0.0F;
  float above = 0.0F;
  for (UnseenStreetLight& light : out) light = {};
  for (std::size_t r = 0; r < receivers.size(); r += kEvery) {
    const std::uint32_t p = receivers[r];
    const bool low = dot(up, points.position[p]) < 0.0F;
    (low ? below : above) += 1.0F;
    const float* const from = exitance.data() + std::size_t{p} * kLightLanes;
    for (std::size_t i = 0; i < kLightsAtOnce; ++i) {
      (low ? out[i].below : out[i].above) += Vec3f{from[3 * i], from[3 * i + 1], from[3 * i + 2]};
    }
  }
  for (UnseenStreetLight& light : out) {
    if (below > 0.0F) light.below = light.below * (kInversePi / below);
    if (above > 0.0F) light.above = light.above * (kInversePi / above);
  }
}

// Where indirect light comes from: for each receiving point, the surface points that n cosine-distributed rays reach.
//
// With directions drawn in proportion to the cosine, the irradiance from surfaces of radiosity B is the plain mean of B
// over the rays, and that from a sky of luminance L is pi times the mean of L over the rays that escape. Neither the
// hit points nor the sky's share depend on the lamps, so all variants share them, and each further bounce is one more
// gather: a Monte Carlo form of radiosity (Goral et al. 1984) on the vertices. The radiosity of a point near the hit
// stands for that of the hit; the error is the variation of B between the two, about one pixel.
// Rays that leave the modelled scene sideways or downwards, and those that meet the back of a surface, see the street
// that the picture does not show (UnseenStreetParams); how much of it a receiver sees does not depend on the lamps
// either.
// Cost: n closest-hit rays per receiver. Memory: 4 n bytes per receiver; 13 KiB of stack.

struct GatherParams {
  int rays = 4;  // per receiver, 1..4096; the denoiser takes care of the rest
};

[[nodiscard]] inline Status validate(const GatherParams& p) noexcept {
  const bool good = p.rays >= 1 && p.rays <= 4096;
  return good ? Status() : Status(StatusCode::invalid_argument, "gather: rays in 1..4096");
}

// Traces the rays of `receivers` (indices into points) through `scene` (trace/scene.hpp). point_of(hit) is the point
// that stands for a hit.
// hits[r * rays + s] becomes the point that ray s of receiver r reaches, or kNoPoint; sky_irradiance[r] (lx, linear
// RGB) what the sky brings to the escaping rays; unseen[r] the mean over the rays of their weights (unseen_weights()).
template <class Scene, class PointOf, class Executor, class Observer>
Status trace_gather_rays(const GatherParams& params, std::uint64_t seed, const Scene& scene, const PointOf& point_of,
                         const SurfacePoints& points, Span<const std::uint32_t> receivers, const SkyParams& sky,
                         const UnseenStreetParams& unseen_street, Span<std::uint32_t> hits, Span<Vec3f> sky_irradiance,
                         Span<Vec2f> unseen, Executor& executor, Observer& observer) {
  NPSIM_RETURN_IF_ERROR(validate(points));
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(unseen_street));
  const auto rays = static_cast<std::size_t>(params.rays);
  if (hits.size() != receivers.size() * rays || sky_irradiance.size() != receivers.size() ||
      unseen.size() != receivers.size()) {
    return Status(StatusCode::shape_mismatch, "gather needs one hit per ray, and sky and unseen street per receiver");
  }
  constexpr std::size_t kChunk = 1024;
  constexpr std::size_t kBatch = 256;  // rays traced together
  constexpr float kPi = 3.14159265F;
  executor.for_chunks(receivers.size(), kChunk, [&](std::size_t begin, std::size_t end) {
    Ray batch[kBatch];
    Hit met[kBatch];
    Vec3f origin;
    float shift_u = 0.0F;
    float shift_v = 0.0F;
    Vec3f sky_sum;
    Vec2f unseen_sum;
    for (std::size_t first = begin * rays; first < end * rays && !observer.cancelled(); first += kBatch) {
      const std::size_t count = std::min(kBatch, end * rays - first);
      for (std::size_t i = 0; i < count; ++i) {
        const std::uint32_t point = receivers[(first + i) / rays];
        const std::size_t s = (first + i) % rays;
        if (s == 0) {
          RandomStream random(seed, RandomPurpose::bounce, 0, 0, point, 0);
          // A rotated rank-1 lattice: stratified for any number of rays and decorrelated between neighbouring points.
          shift_u = random.uniform();
          shift_v = random.uniform();
          origin = ray_start(points, point);
        }
        const float u0 = (static_cast<float>(s) + 0.5F) / static_cast<float>(rays) + shift_u;
        const float v0 = static_cast<float>(s) * 0.61803399F + shift_v;
        batch[i] = Ray{};
        batch[i].origin = origin;
        batch[i].direction = sample_cosine(points.normal[point], u0 - std::floor(u0), v0 - std::floor(v0));
      }
      closest_hits(scene, Span<const Ray>(batch, count), Span<Hit>(met, count));
      for (std::size_t i = 0; i < count; ++i) {
        std::uint32_t& reached = hits[first + i];
        reached = kNoPoint;
        const std::size_t s = (first + i) % rays;
        if (s == 0) {
          sky_sum = Vec3f{};
          unseen_sum = Vec2f{};
        }
        const bool escaped = met[i].face == kNoFace;
        if (!escaped) {
          reached = point_of(met[i]);
          // The back of a sheet is unknown; it hands on what stands in the unseen street does.
          if (dot(points.normal[reached], batch[i].direction) >= 0.0F) reached = kNoPoint;
        }
        if (reached == kNoPoint) {
          const Vec2f weights = escaped ? unseen_weights(unseen_street, dot(sky.up, batch[i].direction))
                                        : Vec2f{0.0F, unseen_street.share};
          unseen_sum = {unseen_sum.x + weights.x, unseen_sum.y + weights.y};
          if (escaped) sky_sum += sky_luminance(sky, batch[i].direction) * (1.0F - weights.y);
        }
        if (s + 1 == rays) {
          const float n = 1.0F / static_cast<float>(rays);
          sky_irradiance[(first + i) / rays] = sky_sum * (kPi * n);
          unseen[(first + i) / rays] = {unseen_sum.x * n, unseen_sum.y * n};
        }
      }
    }
    observer.progress(end, receivers.size());
  });
  return observer.cancelled() ? Status(StatusCode::cancelled, "cancelled while tracing bounces") : Status();
}

// Sums of the exitance, lm/m2, of kLightLanes lights and channels side by side at the points that a receiver's rays
// reach; `even` and `odd` rays apart, since two halves that should agree tell how far off their mean is.
inline void gather_exitance(Span<const float> exitance, const std::uint32_t* hits, int rays, float (&even)[kLightLanes],
                            float (&odd)[kLightLanes]) noexcept {
  for (std::size_t lane = 0; lane < kLightLanes; ++lane) even[lane] = odd[lane] = 0.0F;
  for (int s = 0; s < rays; ++s) {
    if (hits[s] == kNoPoint) continue;
    const float* const from = exitance.data() + std::size_t{hits[s]} * kLightLanes;
    float(&to)[kLightLanes] = s % 2 == 0 ? even : odd;
    for (std::size_t lane = 0; lane < kLightLanes; ++lane) to[lane] += from[lane];
  }
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_GATHER_HPP
