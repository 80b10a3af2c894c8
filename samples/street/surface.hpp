// SPDX-License-Identifier: Apache-2.0
// Albedo, roughness and clear reflection of any face of the street at a hit point: the dispatch over material kinds,
// and the small objects (vehicles, signs, trees, clothes).
//
// A pure function of material, point and view; costs a few lattice look-ups.
#ifndef NPSIM_SAMPLES_STREET_SURFACE_HPP
#define NPSIM_SAMPLES_STREET_SURFACE_HPP

#include <cmath>
#include <cstdint>

#include "dice.hpp"
#include "facade_surface.hpp"
#include "ground_surface.hpp"
#include "layout.hpp"
#include "lettering.hpp"
#include "scene.hpp"

namespace npsim {
namespace street {

inline SurfaceSample plain_surface(const Material& m, const Vec3f& p, float fp) {
  SurfaceSample out;
  const float grain = fractal(p.x * 6 + p.z * 4, p.y * 6 + p.z * 3, 3, m.seed, fp * 6);
  const float broad = fractal(p.x * 0.9F + p.z * 0.7F, p.y * 0.9F - p.z * 0.5F, 3, m.seed + 3, fp);
  out.albedo = m.base * (1 + m.variation * (0.25F * grain + 0.3F * broad));
  out.roughness = m.roughness;
  out.mirror = m.mirror;
  out.glow = m.glow;
  return out;
}

// Signs by variant; the frame's origin is the plate's middle, size.x its half-width.
inline SurfaceSample sign_surface(const Material& m, const Vec3f& q) {
  const float x = q.x / m.size.x;
  const float y = q.y / m.size.x;
  const float r = std::sqrt(x * x + y * y);
  const Vec3f white{0.72F, 0.72F, 0.70F};
  const Vec3f red{0.50F, 0.03F, 0.03F};
  const Vec3f blue{0.02F, 0.09F, 0.36F};
  const Vec3f black{0.03F, 0.03F, 0.03F};
  Vec3f c = white;
  switch (m.variant) {
    case 0:  // speed limit
      c = r > 0.74F ? red : white;
      if (r <= 0.74F && ink_centred("30", x, y, 0.75F)) c = black;
      break;
    case 1:  // no entry
      c = r > 0.95F || (std::fabs(y) < 0.2F && std::fabs(x) < 0.72F) ? white : red;
      break;
    case 2:  // pedestrian crossing: blue square, white triangle, a figure
      c = blue;
      if (y > -0.7F && y < 0.75F && std::fabs(x) < 0.5F * (0.75F - y) * 0.95F) c = white;
      if (std::fabs(x - 0.15F * y) < 0.09F && y > -0.5F && y < 0.25F) c = black;
      if (x * x + (y - 0.33F) * (y - 0.33F) < 0.012F) c = black;
      break;
    case 3:  // parking
      c = std::fabs(x) > 0.93F || std::fabs(y) > 0.93F ? white : blue;
      if (ink_centred("P", x, y, 1.3F)) c = white;
      break;
    case 4: {  // give way: triangle on its tip, plate of radius 1
      const float d = std::fmax(y, std::fmax(-0.866F * x - 0.5F * y, 0.866F * x - 0.5F * y));
      c = d > 0.30F ? red : white;
      break;
    }
    case 5: {  // priority road: diamond
      const float d = std::fabs(x) + std::fabs(y);
      c = d > 0.85F ? white : (d > 0.8F ? black : (d > 0.55F ? white : Vec3f{0.75F, 0.45F, 0.02F}));
      break;
    }
    case 6:  // no stopping
      c = r > 0.8F || std::fabs(x + y) < 0.16F || std::fabs(x - y) < 0.16F ? red : blue;
      break;
    default:  // direction board
      c = {0.70F, 0.46F, 0.03F};
      if (std::fabs(y) > 0.3F * m.size.y / m.size.x * 3) c = white;
      if (ink_centred("ZENTRUM", x + 0.1F, y - 0.16F, 0.22F) || ink_centred("BAHNHOF", x + 0.1F, y + 0.16F, 0.22F)) {
        c = black;
      }
      break;
  }
  SurfaceSample out;
  out.albedo = c;
  out.roughness = 0.45F;
  out.mirror = 0.03F;
  return out;
}

inline SurfaceSample poster_surface(const Material& m, const Vec3f& q) {
  const float x = q.x / m.size.x;
  const float y = q.y / m.size.y;
  const Vec3f sky = mix(m.base, Vec3f{0.75F, 0.72F, 0.66F}, clamp01(0.5F - 0.6F * y));
  Vec3f c = sky;
  const float hill = 0.12F * std::sin(x * 5 + to_unit(m.seed) * 6) - 0.1F;
  if (y < hill) c = m.second;
  const float r =
      std::sqrt((x - 0.12F) * (x - 0.12F) + (y - 0.05F) * (y - 0.05F) * m.size.y * m.size.y / (m.size.x * m.size.x));
  if (r < 0.21F) c = mix(Vec3f{0.7F, 0.3F, 0.05F}, Vec3f{0.7F, 0.6F, 0.1F}, y * 2 + 0.5F);
  if (ink_centred(m.variant % 2 == 0 ? "SOMMER" : "KONZERT", x, y - 0.38F, 0.14F)) c = {0.72F, 0.72F, 0.7F};
  if (ink_centred("JETZT", x, y + 0.36F, 0.09F)) c = {0.72F, 0.72F, 0.7F};
  SurfaceSample out;
  out.albedo = c;
  out.roughness = 0.3F;
  out.mirror = 0.05F;
  return out;
}

inline SurfaceSample clock_surface(const Material& m, const Vec3f& q) {
  const float x = q.x / m.size.x;
  const float y = q.y / m.size.x;
  const float r = std::sqrt(x * x + y * y);
  const float angle = std::atan2(x, y);
  Vec3f c{0.72F, 0.72F, 0.68F};
  const float tick = std::fabs(fract(angle * 12 / (2 * kPi) + 0.5F) - 0.5F);
  if (r > 0.74F && r < 0.92F && tick < 0.13F) c = {0.03F, 0.03F, 0.03F};
  const auto hand = [&](float a, float length, float width) {
    const float along = x * std::sin(a) + y * std::cos(a);
    const float across = x * std::cos(a) - y * std::sin(a);
    return along > -0.12F && along < length && std::fabs(across) < width;
  };
  const float hour = to_unit(m.seed) * 2 * kPi;
  if (hand(hour, 0.5F, 0.07F) || hand(fract(hour * 12 / (2 * kPi)) * 2 * kPi, 0.8F, 0.045F)) c = {0.03F, 0.03F, 0.03F};
  SurfaceSample out;
  out.albedo = c;
  out.roughness = 0.35F;
  return out;
}

inline SurfaceSample vehicle_surface(const Material& m, const Vec3f& q, float fp) {
  SurfaceSample out;
  out.albedo = m.base;
  out.roughness = m.roughness;
  out.mirror = m.mirror;
  out.glow = m.glow;
  switch (m.kind) {
    case Kind::car_paint: {
      // Dust towards the sills.
      const float dust = clamp01(0.55F - q.y) * (0.6F + 0.8F * noise(q.x * 3 + q.z * 3, q.y * 5, m.seed));
      out.albedo = mix(m.base, Vec3f{0.17F, 0.155F, 0.135F}, clamp01(dust * 0.8F));
      out.mirror = m.mirror * (1 - clamp01(dust));
      break;
    }
    case Kind::car_glass: {
      // Seats and the far windows, roughly.
      const float hint = noise(q.x * 2.2F, q.z * 2.2F + q.y * 3, m.seed);
      out.albedo = mix(m.base, Vec3f{0.05F, 0.052F, 0.05F}, smoothstep(0.45F, 0.75F, hint));
      break;
    }
    case Kind::rim: {
      const float r = std::sqrt(q.y * q.y + q.z * q.z) / m.size.x;
      const float spokes = std::cos(std::atan2(q.y, q.z) * static_cast<float>(m.variant));
      const bool solid = r < 0.2F || r > 0.82F || spokes > 0.1F + 0.5F * (r - 0.2F);
      out.albedo = solid ? m.base : Vec3f{0.02F, 0.02F, 0.02F};
      out.mirror = solid ? m.mirror : 0.0F;
      break;
    }
    case Kind::tyre: out.albedo = m.base * (1 + 0.4F * noise(q.y * 14, q.z * 14, 7)); break;
    case Kind::lamp: {
      // Reflector cells behind a clear lens.
      const float cells = 0.75F + 0.5F * noise(q.x * 40, q.y * 40 + q.z * 20, m.seed) * clamp01(1.3F - fp * 25);
      out.albedo = m.base * cells;
      break;
    }
    case Kind::plate: {
      const auto text = plate_text(m.seed);
      const float x = q.x;
      const float y = q.y;
      out.albedo = {0.66F, 0.66F, 0.63F};
      if (x < -0.215F) out.albedo = {0.02F, 0.06F, 0.3F};
      if (ink_centred(text.data(), x - 0.024F, y, 0.064F)) out.albedo = {0.02F, 0.02F, 0.02F};
      break;
    }
    default: break;
  }
  return out;
}

inline SurfaceSample leaf_surface(const Material& m, const Vec3f& p) {
  const float broad = noise(p.x * 1.3F + p.y * 0.7F, p.z * 1.3F - p.y, m.seed);
  const float fine = noise(p.x * 9 + p.y * 5, p.z * 9 + p.y * 7, m.seed + 1);
  SurfaceSample out;
  out.albedo = mix(m.base, m.second, clamp01(0.55F * broad + 0.55F * fine - 0.05F)) * (0.75F + 0.5F * fine);
  out.roughness = m.roughness;
  out.mirror = 0.02F;
  return out;
}

// Coordinates on a printed plate as its reader sees them, x to the right, whichever way its frame is handed.
inline Vec3f reader_coordinates(const Pose& frame, const Vec3f& p) {
  Vec3f q = frame.to_local(p);
  if (dot(cross(frame.x, frame.y), frame.z) > 0) q.x = -q.x;
  return q;
}

// `ray` is the unit direction of view in the world, `fp` the width of a pixel at the point, in metres.
inline SurfaceSample surface_at(const Layout& layout, const Material& m, const Vec3f& p, const Vec3f& ray, float fp) {
  SurfaceSample out;
  switch (m.kind) {
    case Kind::road: out = road_surface(layout, p, fp, m.seed); break;
    case Kind::pavement: out = pavement_surface(layout, m, p, fp); break;
    case Kind::kerb: out = kerb_surface(layout, m, p, fp); break;
    case Kind::grass:
    case Kind::hedge: out = grass_surface(m, p, fp); break;
    case Kind::plaster: out = plaster_surface(m, m.frame.to_local(p), fp); break;
    case Kind::brick: out = brick_surface(m, m.frame.to_local(p), fp); break;
    case Kind::stone: out = stone_surface(m, m.frame.to_local(p), fp); break;
    case Kind::roof_tiles: out = roof_surface(m, m.frame.to_local(p), fp); break;
    case Kind::pane: {
      const Vec3f local{dot(ray, m.frame.x), dot(ray, m.frame.y), dot(ray, m.frame.z)};
      out = pane_surface(m, m.frame.to_local(p), local, fp);
      break;
    }
    case Kind::shop_pane: {
      const Vec3f local{dot(ray, m.frame.x), dot(ray, m.frame.y), dot(ray, m.frame.z)};
      out = shop_surface(m, m.frame.to_local(p), local);
      break;
    }
    case Kind::door: out = door_surface(m, m.frame.to_local(p), fp); break;
    case Kind::lettering: out = lettering_surface(m, reader_coordinates(m.frame, p)); break;
    case Kind::sign: out = sign_surface(m, reader_coordinates(m.frame, p)); break;
    case Kind::poster: out = poster_surface(m, reader_coordinates(m.frame, p)); break;
    case Kind::clock_face: out = clock_surface(m, reader_coordinates(m.frame, p)); break;
    case Kind::car_paint:
    case Kind::car_glass:
    case Kind::tyre:
    case Kind::rim:
    case Kind::lamp:
    case Kind::plate:
      out = vehicle_surface(m, m.kind == Kind::plate ? reader_coordinates(m.frame, p) : m.frame.to_local(p), fp);
      break;
    case Kind::leaf: out = leaf_surface(m, p); break;
    case Kind::bark: {
      const float rings = fractal((p.x + p.z) * 9, p.y * 1.6F, 4, m.seed, fp * 9);
      out.albedo = m.base * (1 + 0.9F * rings);
      out.roughness = m.roughness;
      break;
    }
    case Kind::awning: {
      const Vec3f q = m.frame.to_local(p);
      out.albedo = fract(q.x / 0.3F) < 0.5F || m.variant == 0 ? m.base : m.second;
      out.roughness = m.roughness;
      break;
    }
    default: out = plain_surface(m, p, fp); break;
  }
  const auto bound = [](float v) { return v < 0.005F ? 0.005F : (v > 0.9F ? 0.9F : v); };
  out.albedo = {bound(out.albedo.x), bound(out.albedo.y), bound(out.albedo.z)};
  return out;
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_SURFACE_HPP
