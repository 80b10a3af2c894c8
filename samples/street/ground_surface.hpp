// SPDX-License-Identifier: Apache-2.0
// What the ground looks like: asphalt with patches, cracks, wheel tracks and worn markings; slabs, kerbs and grass.
//
// Asphalt albedo lies between 0.07 (new) and 0.15 (aged), fresh marking paint at about 0.6.
#ifndef NPSIM_SAMPLES_STREET_GROUND_SURFACE_HPP
#define NPSIM_SAMPLES_STREET_GROUND_SURFACE_HPP

#include <cmath>
#include <cstdint>

#include "dice.hpp"
#include "layout.hpp"
#include "scene.hpp"

namespace npsim {
namespace street {

struct SurfaceSample {
  Vec3f albedo{};  // linear
  float roughness = 1;
  float mirror = 0;  // clear reflection at normal incidence
  float glow = 0;
};

// 1 inside [low, high], blurred over the footprint.
inline float band(float v, float low, float high, float footprint) {
  const float w = 0.5F * footprint + 1e-4F;
  return clamp01((v - low) / (2 * w) + 0.5F) * clamp01((high - v) / (2 * w) + 0.5F);
}

// Coverage of the road's paint at (d, s), before wear.
inline float marking_coverage(const Layout& l, float d, float s, float fp) {
  float paint = 0;
  const auto add = [&](float v) { paint = v > paint ? v : paint; };
  const bool in_junction = s > l.zebra0 - 1.6F && s < l.junction1 + 1.0F;
  if (!in_junction) {
    const float period = l.dash_variant == 0 ? 6.0F : 9.0F;
    const float length = l.dash_variant == 0 ? 3.0F : 4.5F;
    const float phase = s - period * std::floor(s / period);
    const bool solid = s > l.zebra0 - 14.0F && s < l.zebra0;
    const float along = solid ? 1.0F : band(phase, 0, length, fp);
    add(band(d, -0.07F, 0.07F, fp) * along);
    // Parking bays: a line along the lane and ticks between the cars.
    if (l.bay_left > l.kerb_left + 1) {
      add(0.9F * band(d, l.bay_left - 0.06F, l.bay_left + 0.06F, fp) * band(fract(s / 1.0F), 0, 0.55F, fp));
      const float tick = s - l.bay_phase - 5.6F * std::floor((s - l.bay_phase) / 5.6F);
      add(band(tick, 0, 0.1F, fp) * band(d, l.kerb_left + 0.35F, l.bay_left, fp));
    }
    if (l.bay_right < l.kerb_right - 1) {
      add(band(d, l.bay_right - 0.06F, l.bay_right + 0.06F, fp));
    } else {
      add(band(d, l.kerb_right - 0.5F, l.kerb_right - 0.38F, fp));
    }
    // A straight-ahead arrow in our lane.
    const float a = s - (l.zebra0 - 9.5F);
    const float q = std::fabs(d - 0.5F * kLane_m);
    if (a > 0 && a < 4.2F) {
      add(a < 2.6F ? band(q, -1, 0.08F, fp) : band(q, -1, 0.32F * (4.2F - a) / 1.6F, fp));
    }
  }
  if (d > l.kerb_left + 0.35F && d < l.kerb_right - 0.35F) {
    add(band(s, l.zebra0, l.zebra1, fp) * band(fract(d), 0.0F, 0.5F, fp));
    const float far0 = l.junction1 + 1.3F;
    add(band(s, far0, far0 + 3.2F, fp) * band(fract(d + 0.3F), 0.0F, 0.5F, fp));
  }
  add(band(s, l.zebra0 - 1.3F, l.zebra0 - 0.85F, fp) * band(d, 0.12F, l.bay_right - 0.1F, fp));
  return paint;
}

inline SurfaceSample road_surface(const Layout& l, const Vec3f& p, float fp, std::uint32_t seed) {
  const float s = p.z;
  const float d = p.x - l.bend(s);
  const bool main_road = d > l.kerb_left && d < l.kerb_right;
  float tone = 0.098F;
  float rough = 0.92F;
  Vec3f tint{1.0F, 0.985F, 0.955F};
  tone *= 1 + 0.35F * fractal(s * 0.11F, d * 0.3F, 4, seed, fp * 0.2F);
  // Aggregate: grains of a few millimetres to centimetres.
  tone *= 1 + 0.42F * fractal(p.x * 14.0F, s * 14.0F, 4, seed + 5, fp * 14.0F);
  if (fp < 0.05F) {
    const float sparkle = noise(p.x * 75.0F, s * 75.0F, seed + 9);
    tone *= 1 + (sparkle > 0.78F ? 0.45F : -0.05F) * clamp01(1.6F - fp * 60.0F);
  }
  if (main_road) {
    // Wheel tracks are polished and lighter, the strip between them takes the oil.
    const float lane = std::fabs(std::fabs(d) - 0.5F * kLane_m);
    tone *= 1 + 0.10F * std::exp(-std::pow((lane - 0.75F) / 0.3F, 2.0F));
    tone *= 1 - 0.16F * std::exp(-std::pow(lane / 0.32F, 2.0F)) * (0.6F + noise(s * 0.35F, d, seed + 3));
    rough -= 0.08F * std::exp(-std::pow((lane - 0.75F) / 0.3F, 2.0F));
    if (d < l.bay_left - 0.1F || d > l.bay_right + 0.1F) {
      const float stain = noise(d * 1.1F, s * 0.8F, seed + 21);
      tone *= 0.92F - 0.35F * smoothstep(0.66F, 0.9F, stain);
    }
    for (const RoadPatch& q : l.patches) {
      const float wobble = 0.06F * fractal(s * 1.7F, d * 1.7F, 2, seed + 31, fp);
      const float inside = band(d + wobble, q.d0, q.d1, fp) * band(s + wobble, q.s0, q.s1, fp);
      const float rim =
          inside - band(d + wobble, q.d0 + 0.04F, q.d1 - 0.04F, fp) * band(s + wobble, q.s0 + 0.04F, q.s1 - 0.04F, fp);
      tone *= mix(1.0F, q.tone, inside);
      tone *= 1 - 0.45F * clamp01(rim);
    }
    // Gutter of setts along the kerb, with dirt and leaves in it.
    const float gutter = std::fmin(d - l.kerb_left, l.kerb_right - d);
    if (gutter < 0.32F) {
      const float joint = std::fmin(fract(s / 0.16F), fract(gutter / 0.16F));
      tone = mix(tone, 0.17F + 0.05F * cell_value(static_cast<int>(s / 0.16F), static_cast<int>(gutter / 0.16F), seed),
                 0.85F);
      tone *= 1 - 0.5F * band(joint, -0.1F, 0.1F, fp * 6.0F);
      const float dirt = smoothstep(0.45F, 0.75F, noise(s * 0.9F, d * 5.0F, seed + 40));
      tone *= 1 - 0.45F * dirt;
      tint = mix(tint, Vec3f{1.15F, 0.95F, 0.65F}, 0.5F * dirt);
    }
    for (const Vec2f& m : l.manholes) {
      const float r = std::sqrt((d - m.x) * (d - m.x) + (s - m.y) * (s - m.y));
      if (r < 0.5F) {
        const float lid = band(r, -1, 0.31F, fp);
        const float pattern = (fract((d - m.x) * 11.0F) < 0.5F) != (fract((s - m.y) * 11.0F) < 0.5F) ? 0.8F : 1.1F;
        tone = mix(tone, 0.085F * mix(pattern, 0.95F, clamp01(fp * 20.0F)), lid);
        tone = mix(tone, 0.125F, 0.6F * band(r, 0.33F, 0.40F, fp));
        rough = mix(rough, 0.6F, lid);
      }
    }
  }
  // Cracks: thin level lines of a warped field, some of them sealed with tar.
  const float warp = 1.8F * fractal(d * 0.8F, s * 0.8F, 3, seed + 50, fp * 0.8F);
  const float field = noise(d * 0.33F + warp, s * 0.21F + warp, seed + 51);
  const float where = smoothstep(0.52F, 0.75F, noise(d * 0.23F, s * 0.09F, seed + 52));
  const float width = 0.006F + 0.35F * fp * 0.2F;
  const float crack = clamp01(1 - std::fabs(field - 0.5F) / width) * where * clamp01(1.3F - 4.0F * fp);
  tone *= 1 - 0.6F * crack;

  Vec3f albedo = tint * tone;
  if (main_road) {
    const float paint = marking_coverage(l, d, s, fp);
    if (paint > 0) {
      const float grain = fractal(d * 9.0F, s * 9.0F, 4, seed + 60, fp * 9.0F);
      const float broad = fractal(d * 0.9F, s * 0.7F, 3, seed + 61, fp);
      const float keep = clamp01(1.05F - l.wear * (0.45F + 1.9F * grain + 1.3F * broad) - 0.9F * crack);
      albedo = mix(albedo, Vec3f{0.55F, 0.55F, 0.53F} * (1 + 0.3F * grain), paint * keep);
      rough = mix(rough, 0.7F, paint * keep);
    }
  }
  SurfaceSample out;
  out.albedo = albedo;
  out.roughness = rough;
  out.mirror = 0.02F;
  return out;
}

inline SurfaceSample pavement_surface(const Layout& l, const Material& m, const Vec3f& p, float fp) {
  const float s = p.z;
  const float d = p.x - l.bend(s);
  const float pitch_s = m.variant == 2 ? 0.12F : (m.variant == 1 ? 0.5F : 0.35F);
  const float pitch_d = m.variant == 2 ? 0.2F : (m.variant == 1 ? 0.5F : 0.35F);
  const float row = std::floor(d / pitch_d);
  const float shift = m.variant == 1 ? 0.0F : 0.5F * fract(row * 0.5F) * 2.0F * pitch_s;
  const float u = (s + shift) / pitch_s;
  const float v = d / pitch_d;
  const float jitter = cell_value(static_cast<int>(std::floor(u)), static_cast<int>(row), m.seed) - 0.5F;
  const float detail = clamp01(1.4F - fp / pitch_s * 1.6F);
  float tone = 1 + 0.22F * jitter * detail;
  const float edge_u = std::fmin(fract(u), 1 - fract(u)) * pitch_s;
  const float edge_v = std::fmin(fract(v), 1 - fract(v)) * pitch_d;
  const float joint = 1 - smoothstep(0.004F, 0.012F + 0.5F * fp, std::fmin(edge_u, edge_v));
  tone *= 1 - 0.5F * joint * detail;
  tone *= 1 + 0.45F * fractal(s * 0.35F, d * 0.35F, 5, m.seed + 3, fp * 0.35F);
  tone *= 1 + 0.3F * fractal(s * 12.0F, d * 12.0F, 3, m.seed + 4, fp * 12.0F);
  const float gum = smoothstep(0.8F, 0.84F, noise(s * 5.0F, d * 5.0F, m.seed + 5)) * clamp01(1.2F - fp * 8.0F);
  tone *= 1 - 0.3F * gum;
  SurfaceSample out;
  out.albedo = mix(m.base, m.second, clamp01(0.5F + jitter * detail)) * tone;
  out.roughness = m.roughness;
  out.mirror = 0.02F;
  return out;
}

inline SurfaceSample kerb_surface(const Layout& l, const Material& m, const Vec3f& p, float fp) {
  const float d = p.x - l.bend(p.z);
  const float piece = std::floor(p.z);
  float tone = 1 + 0.2F * (cell_value(static_cast<int>(piece), 0, m.seed) - 0.5F);
  tone *= 1 - 0.55F * (1 - smoothstep(0.006F, 0.015F + fp, std::fmin(fract(p.z), 1 - fract(p.z))));
  tone *= 1 + 0.5F * fractal(p.z * 9.0F, (d + p.y) * 9.0F, 3, m.seed + 1, fp * 9.0F);
  tone *= 0.72F + 0.28F * smoothstep(0.0F, 0.1F, p.y);
  SurfaceSample out;
  out.albedo = m.base * tone;
  out.roughness = m.roughness;
  return out;
}

inline SurfaceSample grass_surface(const Material& m, const Vec3f& p, float fp) {
  const float blades = fractal(p.x * 22.0F, p.z * 22.0F + p.y * 30.0F, 3, m.seed, fp * 22.0F);
  const float broad = fractal(p.x * 0.8F, p.z * 0.8F, 4, m.seed + 2, fp);
  SurfaceSample out;
  out.albedo = mix(m.base, m.second, clamp01(0.4F + 1.4F * broad)) * (1 + 0.9F * blades);
  out.roughness = 0.95F;
  return out;
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_GROUND_SURFACE_HPP
