// SPDX-License-Identifier: Apache-2.0
// What a wet street mirrors: lit surfaces and the sky, by glossy rays from the points that pixels show under water.
//
// Rays are drawn in proportion to the visible normals of GGX (Heitz, JCGT 2018). Over them
//   L = E(n.wo) * mean of the luminance that the rays meet,
// with E the interface's directional albedo (material/detail/specular_albedo.hpp), by which the body below has lost its
// light already: under a uniform sky film and body together return what they should (within .5 %), and never more.
// Taking E out of the mean leaves out how Fresnel's term and the masking vary within the lobe. What lamps, windows and
// signs send out themselves is not met here: direct light knows their gloss (direct.hpp).
// A surface that is met hands on albedo times illuminance over pi, as in gather.hpp; which, depends on no lamp, so all
// nights share the rays.
// Cost: `rays` closest hits per wet pixel. Memory: 4 bytes a ray, 24 a wet pixel. Error: noise, which the caller
// filters.
#ifndef NPSIM_RENDER_MIRROR_HPP
#define NPSIM_RENDER_MIRROR_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/light/light_set.hpp"
#include "npsim/material/bsdf.hpp"
#include "npsim/material/roughness.hpp"
#include "npsim/render/light_images.hpp"
#include "npsim/render/surface_points.hpp"
#include "npsim/trace/scene.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct MirrorParams {
  int rays = 8;  // per wet pixel, 1..1024
};

[[nodiscard]] inline Status validate(const MirrorParams& p) noexcept {
  return p.rays >= 1 && p.rays <= 1024 ? Status() : Status(StatusCode::invalid_argument, "mirror: rays in 1..1024");
}

// Where the mirrored light of wet pixels comes from; spans of one length, hits of `rays` times it.
struct Mirrors {
  int rays = 0;
  Span<std::uint32_t> pixel;  // y * width + x
  Span<std::uint32_t> point;  // what the pixel shows
  Span<std::uint32_t> hits;   // point that each ray meets, or kNoPoint
  Span<float> weight;         // of each ray
  Span<Vec3f> sky;            // cd/m2 that the rays bring which escape
};

// A microfacet's normal in the frame of the surface (z up), in proportion to what `view` sees of it; u, v in [0, 1).
[[nodiscard]] inline Vec3f sample_visible_normal(const Vec3f& view, float alpha, float u, float v) noexcept {
  const Vec3f stretched = normalized(Vec3f{alpha * view.x, alpha * view.y, view.z});
  const float flat = stretched.x * stretched.x + stretched.y * stretched.y;
  const Vec3f t1 = flat > 1e-12F ? Vec3f{-stretched.y, stretched.x, 0.0F} / std::sqrt(flat) : Vec3f{1, 0, 0};
  const Vec3f t2 = cross(stretched, t1);
  const Vec2f disc = concentric_disc(u, v);
  const float a = disc.x;
  const float edge = 1.0F - a * a;
  const float s = 0.5F * (1.0F + stretched.z);
  const float b = (1.0F - s) * std::sqrt(edge > 0.0F ? edge : 0.0F) + s * disc.y;
  const float c2 = 1.0F - a * a - b * b;
  const Vec3f h = t1 * a + t2 * b + stretched * std::sqrt(c2 > 0.0F ? c2 : 0.0F);
  return normalized(Vec3f{alpha * h.x, alpha * h.y, h.z > 1e-6F ? h.z : 1e-6F});
}

// `f0`: of dry surfaces. pixel and point are given; the rest of `mirrors` is filled. scene: as for trace_gather_rays();
// point_of(hit) likewise, or kNoPoint where nothing of what is met is mirrored.
template <class Scene, class PointOf, class Executor, class Observer>
Status trace_mirror_rays(const MirrorParams& params, std::uint64_t seed, float f0, const Scene& scene,
                         const PointOf& point_of, const SurfacePoints& points, const SkyParams& sky,
                         const Mirrors& mirrors, Executor& executor, Observer& observer) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(points));
  const std::size_t count = mirrors.pixel.size();
  const auto rays = static_cast<std::size_t>(params.rays);
  if (mirrors.rays != params.rays || mirrors.point.size() != count || mirrors.hits.size() != count * rays ||
      mirrors.weight.size() != count || mirrors.sky.size() != count || (count > 0 && points.film.empty())) {
    return Status(StatusCode::shape_mismatch, "mirror: one point, weight and sky per pixel, `rays` hits");
  }
  constexpr std::size_t kBatch = 64;
  executor.for_chunks(count, 512, [&](std::size_t begin, std::size_t end) {
    Ray batch[kBatch];
    Hit met[kBatch];
    for (std::size_t r = begin; r < end && !observer.cancelled(); ++r) {
      const std::uint32_t p = mirrors.point[r];
      const Vec3f n = points.normal[p];
      const Vec3f wo = normalized(-points.position[p]);
      const float alpha = clamp_to(points.alpha[p], kMinAlpha, 1.0F);
      Vec3f t, b;
      tangent_frame(n, t, b);
      const float no = dot(n, wo);
      const Vec3f view{dot(t, wo), dot(b, wo), no > 1e-4F ? no : 1e-4F};
      RandomStream random(seed, RandomPurpose::bounce, 0, 1, mirrors.pixel[r], 0);
      const float shift_u = random.uniform();
      const float shift_v = random.uniform();
      std::size_t valid = 0;
      Vec3f escaped;
      std::uint32_t* const hits = mirrors.hits.data() + r * rays;
      for (std::size_t first = 0; first < rays; first += kBatch) {
        std::size_t traced = 0;
        for (std::size_t s = first; s < std::min(rays, first + kBatch); ++s) {
          hits[s] = kNoPoint;
          const float u = (static_cast<float>(s) + 0.5F) / static_cast<float>(rays) + shift_u;
          const float v = static_cast<float>(s) * 0.61803399F + shift_v;
          const Vec3f h = sample_visible_normal(view, alpha, u - std::floor(u), v - std::floor(v));
          const Vec3f in = h * (2.0F * dot(view, h)) - view;
          if (!(in.z > 0.0F)) continue;  // masked
          batch[traced] = Ray{};
          batch[traced].origin = ray_start(points, p);
          batch[traced++].direction = t * in.x + b * in.y + n * in.z;
        }
        closest_hits(scene, Span<const Ray>(batch, traced), Span<Hit>(met, traced));
        for (std::size_t i = 0; i < traced; ++i) {
          if (met[i].face == kNoFace) {
            escaped += sky_luminance(sky, batch[i].direction);
            continue;
          }
          const std::uint32_t reached = point_of(met[i]);
          // The back of a sheet is unknown; it hands on nothing.
          if (reached != kNoPoint && dot(points.normal[reached], batch[i].direction) < 0.0F) hits[first + i] = reached;
        }
        valid += traced;
      }
      const float share = SpecularAlbedo(alpha, film_f0(f0, points.film[p]))(view.z);
      mirrors.weight[r] = valid > 0 ? share / static_cast<float>(valid) : 0.0F;
      mirrors.sky[r] = escaped * mirrors.weight[r];
    }
    observer.progress(end, count);
  });
  return observer.cancelled() ? Status(StatusCode::cancelled, "cancelled while tracing mirrored light") : Status();
}

// Luminance (cd/m2) that wet pixel r mirrors of surfaces, of kLightLanes lights and channels side by side; what the sky
// adds is mirrors.sky[r].
inline void mirrored_luminance(const Mirrors& mirrors, std::size_t r, Span<const float> exitance,
                               float (&out)[kLightLanes]) noexcept {
  constexpr float kInversePi = 0.31830989F;
  const auto rays = static_cast<std::size_t>(mirrors.rays);
  for (float& lane : out) lane = 0.0F;
  for (std::size_t s = 0; s < rays; ++s) {
    const std::uint32_t reached = mirrors.hits[r * rays + s];
    if (reached == kNoPoint) continue;
    const float* const from = exitance.data() + std::size_t{reached} * kLightLanes;
    for (std::size_t lane = 0; lane < kLightLanes; ++lane) out[lane] += from[lane];
  }
  for (float& lane : out) lane *= mirrors.weight[r] * kInversePi;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_MIRROR_HPP
