// SPDX-License-Identifier: Apache-2.0
// Light of a point of the street towards the camera: sun with a traced shadow, sky and one bounce by a few hemisphere
// rays, mirror reflections of paint and glass, the sheen of the ground, haze. Relative to a white wall facing the sun
// (1).
//
// The sky part is returned apart from the albedo, so that it can be smoothed across neighbours. About five rays.
#ifndef NPSIM_SAMPLES_STREET_SHADING_HPP
#define NPSIM_SAMPLES_STREET_SHADING_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "dice.hpp"
#include "layout.hpp"
#include "npsim/material/bsdf.hpp"
#include "npsim/material/roughness.hpp"
#include "scene.hpp"
#include "sky.hpp"
#include "stage.hpp"
#include "surface.hpp"

namespace npsim {
namespace street {

inline constexpr float kSkyScale = 0.42F;    // the sky's light against the sun's, on surfaces
inline constexpr float kSkyDisplay = 0.80F;  // and as the camera sees it between the roofs

inline Vec3f sun_colour(const Layout& l) { return Vec3f{1.0F, 0.93F, 0.80F} * l.sun_strength; }

// Light leaving a face that a bounce ray meets: no further rays, sun assumed to reach half of what faces it.
inline Vec3f bounce_radiance(const Stage& stage, const ShadePoint& p) {
  const Material& m = stage.scene->materials[stage.scene->info[p.face].material];
  const float cosine = dot(p.geometric, stage.layout->sun);
  const Vec3f sky = horizon_radiance(*stage.layout) * (kSkyScale * (0.34F + 0.2F * p.geometric.y));
  return m.base * (sky + sun_colour(*stage.layout) * (cosine > 0 ? 0.5F * cosine : 0.0F));
}

// Orthonormal frame round n (Frisvad's construction with the sign fix of Duff et al., 2017).
inline void tangents(const Vec3f& n, Vec3f& t, Vec3f& b) {
  const float sign = n.z < 0 ? -1.0F : 1.0F;
  const float a = -1.0F / (sign + n.z);
  const float c = n.x * n.y * a;
  t = {1 + sign * n.x * n.x * a, sign * c, -sign * n.x};
  b = {c, sign + n.y * n.y * a, -n.y};
}

struct SampleLight {
  Vec3f direct{};  // finished radiance, haze included
  Vec3f albedo{};  // what the gathered sky light is still to be multiplied by
  Vec3f sky{};     // mean radiance from the hemisphere
};

// Where sample `index` of a pixel lies in its random domains: one lattice for all samples of the pixel (the R2
// sequence, Roberts 2018), shifted per pixel, so that a few samples cover the sun's disc and the hemisphere evenly.
struct Lattice {
  Vec2f sun{};
  Vec2f sky{};
  int index = 0;
  [[nodiscard]] static Vec2f at(const Vec2f& shift, int i) {
    const float n = static_cast<float>(i);
    return {fract(shift.x + n * 0.7548777F), fract(shift.y + n * 0.5698403F)};
  }
};

inline Vec3f gather(const Stage& stage, const ShadePoint& p, int rays, const Lattice& lattice) {
  Vec3f t, b;
  tangents(p.normal, t, b);
  const Vec3f origin = p.position + p.geometric * 3e-3F;
  Vec3f sum{};
  for (int i = 0; i < rays; ++i) {
    const Vec2f uv = Lattice::at(lattice.sky, lattice.index * rays + i);
    const float r = std::sqrt(uv.y);
    const float a = 2 * kPi * uv.x;
    const Vec3f d = normalized(t * (r * std::cos(a)) + b * (r * std::sin(a)) + p.normal * std::sqrt(1 - uv.y));
    Hit hit;
    if (dot(d, p.geometric) <= 0) continue;
    if (trace_world(stage, origin, d, 60, hit)) {
      sum += bounce_radiance(stage, shade_point(stage, origin, d, hit));
    } else {
      sum += clear_sky(*stage.layout, d) * kSkyScale;
    }
  }
  return rays > 0 ? sum / static_cast<float>(rays) : horizon_radiance(*stage.layout) * (0.4F * kSkyScale);
}

inline float schlick(float f0, float cosine) {
  const float k = 1 - cosine;
  const float k2 = k * k;
  return f0 + (1 - f0) * k2 * k2 * k;
}

inline bool is_ground(Kind k) { return k == Kind::road || k == Kind::pavement || k == Kind::kerb; }

inline SampleLight shade(const Stage& stage, const Vec3f& eye, const Vec3f& ray, const ShadePoint& p, float pixel_rad,
                         int sky_rays, const Lattice& lattice, Dice& dice) {
  const Layout& l = *stage.layout;
  const Material& m = stage.scene->materials[stage.scene->info[p.face].material];
  const float view = std::fmax(0.02F, -dot(p.normal, ray));
  const float fp = p.t * pixel_rad * 0.65F / std::sqrt(view);
  const SurfaceSample s = surface_at(l, m, p.position, ray, fp);
  const Vec3f origin = p.position + p.geometric * 3e-3F;
  SampleLight out;
  out.albedo = s.albedo;
  // The ground is seen at a grazing angle, where even a rough interface shows the sky: as much of it as of the rest of
  // the hemisphere.
  constexpr float kGroundF0 = 0.04F;
  const bool ground = is_ground(m.kind);
  const float alpha = alpha_of_roughness(s.roughness);
  if (ground) {
    const float mirrored = SpecularAlbedo(alpha, kGroundF0)(view);
    out.albedo = s.albedo * (1 - mirrored) + Vec3f{mirrored, mirrored, mirrored};
  }
  out.sky = gather(stage, p, sky_rays, lattice);
  // A point of the sun's disc, half an angle of 0.0047 rad.
  Vec3f st, sb;
  tangents(l.sun, st, sb);
  const Vec2f su = Lattice::at(lattice.sun, lattice.index);
  const float disc = l.sun_radius * std::sqrt(su.x);
  const Vec3f sun_direction =
      normalized(l.sun + st * (disc * std::cos(2 * kPi * su.y)) + sb * (disc * std::sin(2 * kPi * su.y)));
  const float facing = dot(p.normal, sun_direction);
  const bool leaf = m.kind == Kind::leaf;
  float lit = 0;
  if ((leaf || (facing > 0 && dot(p.geometric, sun_direction) > 0))) {
    const Vec3f from = facing > 0 ? origin : p.position - p.geometric * 3e-3F;
    if (!in_shadow(stage, from, sun_direction)) lit = 1;
  }
  const Vec3f sun = sun_colour(l);
  if (lit > 0) {
    const float cosine = facing > 0 ? facing : -facing * 0.6F;  // leaves let light through
    out.direct +=
        (ground ? eval_bsdf(s.albedo, alpha, kGroundF0, p.normal, ray * -1.0F, sun_direction) * kPi : s.albedo) * sun *
        cosine;
    if (s.mirror >= 0.03F && facing > 0) {
      const Vec3f half = normalized(sun_direction - ray);
      const float nh = dot(p.normal, half);
      const float a = std::fmax(0.06F, s.roughness * s.roughness);
      const float q = nh * nh * (a * a - 1) + 1;
      const float spec =
          schlick(s.mirror, std::fmax(0.0F, dot(half, sun_direction))) * a * a / (4 * q * q * view + 1e-4F);
      out.direct += sun * std::fmin(spec, 3.0F);
    }
  }
  if (s.mirror >= 0.04F) {
    const Vec3f n = p.normal;
    Vec3f d = ray - n * (2 * dot(ray, n));
    const float blur = 0.05F * s.roughness;
    d = normalized(d + Vec3f{dice.uniform(-1, 1), dice.uniform(-1, 1), dice.uniform(-1, 1)} * blur);
    if (dot(d, p.geometric) < 0.01F) d = normalized(d + p.geometric * (0.02F - dot(d, p.geometric)));
    const float fresnel = schlick(s.mirror, view);
    Hit hit;
    Vec3f seen{};
    if (trace_world(stage, origin, d, 200, hit)) {
      const ShadePoint q = shade_point(stage, origin, d, hit);
      const Material& qm = stage.scene->materials[stage.scene->info[q.face].material];
      // Paint is too rough to show texture; glass shows it.
      const bool sharp = s.roughness < 0.15F;
      const Vec3f colour = sharp ? surface_at(l, qm, q.position, d, fp + hit.t * 0.004F).albedo : qm.base;
      seen = colour * (horizon_radiance(l) * (kSkyScale * 0.45F));
      const float c = dot(q.geometric, l.sun);
      // A shadow ray where glass shows the edge of a shadow; half the sun on average where paint would blur it.
      const float reached = !sharp ? 0.5F : (in_shadow(stage, q.position + q.geometric * 3e-3F, l.sun) ? 0.0F : 1.0F);
      if (c > 0) seen += colour * sun * (c * reached);
    } else {
      seen = sky_radiance(l, d) * kSkyDisplay;
    }
    out.direct += seen * fresnel;
  }
  if (s.glow > 0) out.direct += s.albedo * s.glow;
  // Aerial perspective.
  const float clear = std::exp(-p.t * 0.0007F * (0.4F + l.haze));
  const Vec3f air = horizon_radiance(l) * (kSkyDisplay * 0.9F);
  out.direct = out.direct * clear + air * (1 - clear);
  out.albedo *= clear;
  (void)eye;
  return out;
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_SHADING_HPP
