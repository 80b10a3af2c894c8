// SPDX-License-Identifier: Apache-2.0
// What buildings look like: plaster, brick, stone, tiles, windows with curtains, and shop windows with a room behind.
//
// Rooms behind glass are not geometry: the ray is followed into a virtual box, so that they shift with the view as
// real rooms do. The albedo of a pane is therefore the one seen along this ray.
#ifndef NPSIM_SAMPLES_STREET_FACADE_SURFACE_HPP
#define NPSIM_SAMPLES_STREET_FACADE_SURFACE_HPP

#include <cmath>
#include <cstdint>

#include "dice.hpp"
#include "ground_surface.hpp"
#include "lettering.hpp"
#include "scene.hpp"

namespace npsim {
namespace street {

// q: hit point in the frame of the facade (x along, y up, z out).
inline float weathering(const Vec3f& q, float fp, std::uint32_t seed) {
  float tone = 1 + 0.22F * fractal(q.x * 0.25F, q.y * 0.2F, 4, seed, fp * 0.3F);
  // Streaks run down; dirt gathers near the pavement.
  tone *= 1 + 0.16F * fractal(q.x * 2.2F, q.y * 0.12F, 4, seed + 1, fp * 2.0F);
  tone *= 0.80F + 0.20F * smoothstep(0.0F, 1.4F, q.y + 0.8F * fractal(q.x * 0.9F, q.y, 3, seed + 2, fp));
  return tone;
}

inline SurfaceSample plaster_surface(const Material& m, const Vec3f& q, float fp) {
  float tone = weathering(q, fp, m.seed);
  tone *= 1 + 0.16F * fractal(q.x * 16.0F, q.y * 16.0F, 3, m.seed + 9, fp * 16.0F);
  // Patches where the paint was renewed.
  const float patch = smoothstep(0.66F, 0.68F, noise(q.x * 0.33F, q.y * 0.5F, m.seed + 12));
  SurfaceSample out;
  out.albedo = m.base * (mix(1.0F, tone, m.variation)) * (1 - 0.06F * patch);
  out.roughness = m.roughness;
  return out;
}

inline SurfaceSample brick_surface(const Material& m, const Vec3f& q, float fp) {
  const float course = 0.077F;
  const float length = 0.25F;
  const float v = q.y / course;
  const float row = std::floor(v);
  const float u = q.x / length + 0.5F * fract(row * 0.5F) * 2.0F;
  const float detail = clamp01(1.5F - fp / course);
  const float h = cell_value(static_cast<int>(std::floor(u)), static_cast<int>(row), m.seed) - 0.5F;
  const float ju = std::fmin(fract(u), 1 - fract(u)) * length;
  const float jv = std::fmin(fract(v), 1 - fract(v)) * course;
  const float joint = (1 - smoothstep(0.004F, 0.008F + 0.5F * fp, std::fmin(ju, jv))) * detail;
  Vec3f c = m.base * (1 + 0.6F * h * mix(0.3F, 1.0F, detail));
  c = mix(c, m.base * Vec3f{0.72F, 0.62F, 0.6F}, smoothstep(0.3F, 0.5F, h) * detail);
  c = mix(c, m.second, mix(0.16F, joint * 0.9F, detail));
  SurfaceSample out;
  out.albedo = c * weathering(q, fp, m.seed + 7);
  out.roughness = m.roughness;
  return out;
}

inline SurfaceSample stone_surface(const Material& m, const Vec3f& q, float fp) {
  const float course = 0.45F;
  const float length = 0.9F;
  const float v = q.y / course;
  const float row = std::floor(v);
  const float u = q.x / length + 0.5F * fract(row * 0.5F) * 2.0F;
  const float h = cell_value(static_cast<int>(std::floor(u)), static_cast<int>(row), m.seed) - 0.5F;
  const float edge = std::fmin(std::fmin(fract(u), 1 - fract(u)) * length, std::fmin(fract(v), 1 - fract(v)) * course);
  const float joint = 1 - smoothstep(0.008F, 0.022F + 0.5F * fp, edge);
  float tone = weathering(q, fp, m.seed) * (1 + 0.18F * h);
  tone *= 1 + 0.3F * fractal(q.x * 7.0F, q.y * 7.0F, 4, m.seed + 4, fp * 7.0F);
  SurfaceSample out;
  out.albedo = m.base * tone * (1 - 0.6F * joint);
  out.roughness = m.roughness;
  return out;
}

inline SurfaceSample roof_surface(const Material& m, const Vec3f& q, float fp) {
  // z of the roof frame points out of the tiles, y up the slope.
  const float pitch = m.variant == 1 ? 0.2F : 0.32F;
  const float v = q.y / pitch;
  const float row = std::floor(v);
  const float u = q.x / 0.25F + (m.variant == 1 ? 0.5F * row : 0.0F);
  const float h = cell_value(static_cast<int>(std::floor(u)), static_cast<int>(row), m.seed) - 0.5F;
  const float detail = clamp01(1.5F - fp / pitch * 1.5F);
  float tone = 1 + 0.4F * h * detail;
  tone *= 1 - 0.4F * detail * (1 - smoothstep(0.0F, 0.2F, fract(v)));
  if (m.variant == 0) tone *= 1 + 0.25F * detail * std::sin(2 * kPi * u);
  tone *= 1 + 0.5F * fractal(q.x * 0.4F, q.y * 0.4F, 4, m.seed + 3, fp);
  SurfaceSample out;
  out.albedo = m.base * tone;
  out.roughness = m.roughness;
  return out;
}

// Window of a flat: m.frame has its origin at the pane's lower left corner, m.size is the pane.
inline SurfaceSample pane_surface(const Material& m, const Vec3f& q, const Vec3f& ray, float fp) {
  const float w = m.size.x;
  const float h = m.size.y;
  const std::uint32_t r = hash(m.seed);
  // Where the ray meets the plane of the curtains, 12 cm behind the glass.
  const float inward = ray.z < -0.05F ? -ray.z : 0.05F;
  const float cx = q.x + ray.x / inward * 0.12F;
  const float cy = q.y + ray.y / inward * 0.12F;
  Vec3f seen{0.020F, 0.021F, 0.023F};
  // The room: back wall 3.5 m behind, ceiling lighter than the rest.
  const float bx = q.x + ray.x / inward * 3.5F;
  const float by = q.y + ray.y / inward * 3.5F;
  if (by > h + 0.3F) seen = seen + Vec3f{0.03F, 0.029F, 0.026F} * clamp01((by - h) * 0.5F);
  seen = seen * (0.7F + 0.9F * noise(bx * 0.8F, by * 0.8F, r));
  const int style = static_cast<int>(r % 7U);
  const Vec3f cloth = mix(Vec3f{0.42F, 0.41F, 0.37F}, m.base, 0.15F * to_unit(hash(r + 5)));
  const float folds = 0.8F + 0.35F * std::sin(cx * (34.0F + 12.0F * to_unit(r)) + 2.0F * noise(cx * 3, cy, r)) *
                                 clamp01(1.2F - fp * 12.0F);
  if (style == 0 || style == 1) {  // drawn to the sides
    const float open = 0.18F + 0.2F * to_unit(hash(r + 1));
    if (cx < w * open || cx > w * (1 - open)) seen = cloth * folds;
  } else if (style == 2) {  // net curtain over all of it
    seen = mix(seen, cloth * folds, 0.75F);
  } else if (style == 3 || style == 4) {  // roller shutter, partly down
    const float down = style == 3 ? 0.25F + 0.5F * to_unit(hash(r + 2)) : 0.15F;
    if (cy > h * (1 - down)) {
      const float slat = 0.85F + 0.2F * (fract(cy / 0.05F) > 0.2F ? 1.0F : 0.0F) * clamp01(1.3F - fp * 22.0F);
      seen = Vec3f{0.46F, 0.45F, 0.42F} * slat;
    }
  } else if (style == 5 && cy < h * 0.45F) {  // half-height net
    seen = cloth * folds;
  }
  // Things on the window sill.
  if (cy < 0.28F && (r & 64U) != 0) {
    const float plant = noise(cx * 9.0F, cy * 4.0F, r + 9);
    if (plant > 0.45F + cy * 1.5F)
      seen = mix(Vec3f{0.03F, 0.07F, 0.02F}, Vec3f{0.2F, 0.1F, 0.06F}, cell_value(static_cast<int>(cx * 6), 0, r));
  }
  SurfaceSample out;
  out.albedo = seen;
  out.roughness = 0.05F;
  out.mirror = 0.075F;  // double glazing: two panes
  return out;
}

// Shop window or glazed door: goods in front, a room 4 m deep behind.
inline SurfaceSample shop_surface(const Material& m, const Vec3f& q, const Vec3f& ray) {
  const float w = m.size.x;
  const float h = m.size.y;
  const float inward = ray.z < -0.05F ? -ray.z : 0.05F;
  Vec3f seen{};
  const float dx = q.x + ray.x / inward * 0.5F;
  const float dy = q.y + ray.y / inward * 0.5F;
  const int column = static_cast<int>(std::floor(dx / 0.42F));
  const float shape = cell_value(column, 1, m.seed);
  const float top = 0.35F + 0.9F * shape * cell_value(column, 2, m.seed);
  const float within = fract(dx / 0.42F);
  const bool goods = dx > 0 && dx < w && dy < top && within > 0.12F && within < 0.88F && shape > 0.35F;
  if (goods) {
    const Vec3f hue{cell_value(column, 3, m.seed), cell_value(column, 4, m.seed), cell_value(column, 5, m.seed)};
    seen = (Vec3f{0.04F, 0.04F, 0.04F} + hue * 0.3F) * (0.6F + 0.6F * noise(dx * 12, dy * 12, m.seed));
  } else {
    // Nearest of back wall, sides, floor and ceiling of the room.
    const float depth = 4.0F;
    float t = depth / inward;
    int wall = 0;
    if (ray.x > 1e-4F && (w + 1 - q.x) / ray.x < t) {
      t = (w + 1 - q.x) / ray.x;
      wall = 1;
    }
    if (ray.x < -1e-4F && (-1 - q.x) / ray.x < t) {
      t = (-1 - q.x) / ray.x;
      wall = 1;
    }
    if (ray.y > 1e-4F && (h + 0.2F - q.y) / ray.y < t) {
      t = (h + 0.2F - q.y) / ray.y;
      wall = 2;
    }
    if (ray.y < -1e-4F && (-0.3F - q.y) / ray.y < t) {
      t = (-0.3F - q.y) / ray.y;
      wall = 3;
    }
    const Vec3f p = q + ray * t;
    const float gloom = 1.0F / (1.0F + 0.55F * -p.z);
    if (wall == 0) {  // shelves
      const int row = static_cast<int>(std::floor(p.y / 0.45F));
      const int col = static_cast<int>(std::floor(p.x / 0.3F));
      const float v = cell_value(col, row, m.seed + 7);
      const bool board = fract(p.y / 0.45F) < 0.12F;
      seen = board ? Vec3f{0.12F, 0.09F, 0.06F}
                   : mix(m.base, Vec3f{0.4F * v, 0.3F * cell_value(col, row, m.seed + 8), 0.22F}, 0.6F) * 0.7F;
    } else if (wall == 1) {
      seen = m.base * 0.5F;
    } else if (wall == 2) {
      const bool lamp = fract(p.z * 0.8F) < 0.2F && std::fabs(fract(p.x * 0.55F) - 0.5F) < 0.2F;
      seen = lamp ? Vec3f{2.2F, 2.0F, 1.6F} : Vec3f{0.35F, 0.34F, 0.31F};
    } else {
      seen = Vec3f{0.11F, 0.09F, 0.07F};
    }
    seen = seen * (0.42F * gloom);
  }
  // A printed strip on the glass.
  if (m.variant % 3 == 1 && q.y > 0.5F * h && q.y < 0.5F * h + 0.22F) {
    if (ink_centred(kShopNames[static_cast<std::size_t>(m.variant) % kShopNames.size()], 0.5F * w - q.x,
                    q.y - 0.5F * h - 0.11F, 0.13F)) {
      seen = {0.5F, 0.5F, 0.48F};
    }
  }
  SurfaceSample out;
  out.albedo = seen;
  out.roughness = 0.05F;
  out.mirror = 0.06F;
  return out;
}

// Panelled door; frame origin at the lower left corner.
inline SurfaceSample door_surface(const Material& m, const Vec3f& q, float fp) {
  const float x = q.x / m.size.x;
  const float y = q.y / m.size.y;
  float tone = 1 + 0.2F * fractal(q.x * 25.0F, q.y * 2.0F, 3, m.seed, fp * 25.0F);
  const bool panel = fract(x * 2) > 0.16F && fract(x * 2) < 0.84F && fract(y * 3) > 0.1F && fract(y * 3) < 0.9F;
  if (!panel) tone *= 1.2F;
  SurfaceSample out;
  out.albedo = m.base * tone;
  out.roughness = m.roughness;
  out.mirror = 0.03F;
  if (panel && y > 0.667F) {
    out.albedo = {0.02F, 0.02F, 0.022F};
    out.mirror = 0.05F;
  }
  return out;
}

// Board above a shop, frame origin in its middle.
inline SurfaceSample lettering_surface(const Material& m, const Vec3f& q) {
  SurfaceSample out;
  const char* name = kShopNames[static_cast<std::size_t>(m.variant) % kShopNames.size()];
  const float columns = 6.0F * static_cast<float>(text_length(name));
  const float size = std::fmin(0.62F * m.size.y, 0.85F * m.size.x * 7.0F / columns);
  out.albedo = ink_centred(name, q.x, q.y, size) ? m.second : m.base;
  out.roughness = m.roughness;
  out.mirror = 0.03F;
  return out;
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_FACADE_SURFACE_HPP
