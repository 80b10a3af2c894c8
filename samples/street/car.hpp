// SPDX-License-Identifier: Apache-2.0
// Cars: a body whose horizontal sections are rounded rectangles, stacked from the sill to the roof, with round wheel
// arches cut into its lower edge; glass, lamps and trim are patches that follow the body a few millimetres outside.
//
// Frame of a vehicle: origin on the road under its middle, x to its right seen from behind, y up, z forward.
#ifndef NPSIM_SAMPLES_STREET_CAR_HPP
#define NPSIM_SAMPLES_STREET_CAR_HPP

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "dice.hpp"
#include "scene.hpp"

namespace npsim {
namespace street {

// One horizontal section: from z = rear to z = front, half as wide as `half`, corners rounded.
struct Section {
  float y, front, rear, half, front_radius, rear_radius;
};

struct CarShape {
  std::array<Section, 14> sections{};
  float belt = 0.95F;        // where the side windows begin
  float roof = 1.40F;        // where they end
  float wheel_radius = 0.32F;
  float axle_front = 1.3F;
  float axle_rear = -1.3F;
  float lamp_y = 0.66F;      // middle of the headlamps
  float tail_y = 0.82F;
  float pillar_b = 0.52F;    // share of the side, from the rear
  float glass_rear = 0.10F;
  float glass_front = 0.95F;
  bool tall_tail = false;    // lamps stand upright beside the rear window
};

// 0 hatchback, 1 saloon, 2 estate, 3 sport utility, 4 delivery van, 5 small car
inline CarShape car_shape(int type) {
  CarShape c;
  switch (type) {
    case 1:
      c.sections = {{{0.19F, 2.10F, -2.15F, 0.80F, 0.30F, 0.25F}, {0.32F, 2.24F, -2.27F, 0.865F, 0.42F, 0.30F},
                     {0.50F, 2.28F, -2.31F, 0.90F, 0.46F, 0.32F}, {0.64F, 2.25F, -2.31F, 0.905F, 0.48F, 0.34F},
                     {0.74F, 2.12F, -2.30F, 0.895F, 0.48F, 0.35F}, {0.82F, 1.80F, -2.28F, 0.885F, 0.42F, 0.36F},
                     {0.90F, 1.30F, -2.24F, 0.875F, 0.34F, 0.36F}, {0.955F, 0.96F, -2.10F, 0.86F, 0.30F, 0.34F},
                     {1.00F, 0.84F, -1.72F, 0.83F, 0.28F, 0.28F}, {1.12F, 0.62F, -1.46F, 0.775F, 0.27F, 0.28F},
                     {1.28F, 0.30F, -1.14F, 0.70F, 0.26F, 0.28F}, {1.38F, 0.05F, -0.85F, 0.62F, 0.26F, 0.28F},
                     {1.425F, -0.18F, -0.62F, 0.46F, 0.18F, 0.2F}, {1.435F, -0.32F, -0.48F, 0.15F, 0.06F, 0.06F}}};
      c.belt = 0.97F; c.roof = 1.36F; c.axle_front = 1.38F; c.axle_rear = -1.36F; c.tail_y = 0.84F;
      c.glass_rear = 0.08F;
      break;
    case 2:
      c.sections = {{{0.19F, 2.10F, -2.12F, 0.80F, 0.30F, 0.22F}, {0.32F, 2.24F, -2.24F, 0.865F, 0.42F, 0.26F},
                     {0.50F, 2.28F, -2.28F, 0.90F, 0.46F, 0.28F}, {0.64F, 2.25F, -2.28F, 0.905F, 0.48F, 0.28F},
                     {0.74F, 2.12F, -2.26F, 0.895F, 0.48F, 0.28F}, {0.82F, 1.80F, -2.25F, 0.885F, 0.42F, 0.28F},
                     {0.90F, 1.32F, -2.24F, 0.875F, 0.34F, 0.28F}, {0.97F, 0.98F, -2.21F, 0.86F, 0.30F, 0.26F},
                     {1.02F, 0.86F, -2.17F, 0.83F, 0.28F, 0.24F}, {1.16F, 0.60F, -2.06F, 0.775F, 0.27F, 0.24F},
                     {1.32F, 0.28F, -1.92F, 0.71F, 0.26F, 0.24F}, {1.42F, 0.05F, -1.78F, 0.64F, 0.26F, 0.24F},
                     {1.465F, -0.20F, -1.55F, 0.48F, 0.18F, 0.2F}, {1.475F, -0.45F, -1.25F, 0.15F, 0.06F, 0.06F}}};
      c.belt = 0.98F; c.roof = 1.40F; c.axle_front = 1.38F; c.axle_rear = -1.34F; c.tail_y = 0.86F;
      break;
    case 3:
      c.sections = {{{0.24F, 2.08F, -2.08F, 0.84F, 0.28F, 0.24F}, {0.40F, 2.20F, -2.20F, 0.90F, 0.38F, 0.28F},
                     {0.60F, 2.24F, -2.24F, 0.935F, 0.42F, 0.30F}, {0.78F, 2.22F, -2.24F, 0.94F, 0.42F, 0.30F},
                     {0.90F, 2.10F, -2.22F, 0.93F, 0.42F, 0.30F}, {0.98F, 1.80F, -2.21F, 0.92F, 0.38F, 0.30F},
                     {1.05F, 1.36F, -2.20F, 0.91F, 0.32F, 0.30F}, {1.12F, 1.02F, -2.17F, 0.89F, 0.30F, 0.28F},
                     {1.17F, 0.90F, -2.14F, 0.86F, 0.28F, 0.26F}, {1.32F, 0.66F, -2.02F, 0.81F, 0.27F, 0.25F},
                     {1.48F, 0.38F, -1.88F, 0.74F, 0.26F, 0.25F}, {1.60F, 0.12F, -1.72F, 0.67F, 0.26F, 0.25F},
                     {1.655F, -0.16F, -1.45F, 0.50F, 0.18F, 0.2F}, {1.67F, -0.45F, -1.15F, 0.15F, 0.06F, 0.06F}}};
      c.belt = 1.14F; c.roof = 1.57F; c.wheel_radius = 0.36F; c.axle_front = 1.36F; c.axle_rear = -1.32F;
      c.lamp_y = 0.84F; c.tail_y = 1.0F;
      break;
    case 4:
      c.sections = {{{0.24F, 2.20F, -2.40F, 0.86F, 0.25F, 0.12F}, {0.40F, 2.34F, -2.48F, 0.93F, 0.34F, 0.14F},
                     {0.62F, 2.38F, -2.50F, 0.965F, 0.38F, 0.14F}, {0.84F, 2.34F, -2.50F, 0.97F, 0.38F, 0.14F},
                     {0.98F, 2.22F, -2.50F, 0.965F, 0.38F, 0.14F}, {1.08F, 2.02F, -2.50F, 0.96F, 0.34F, 0.14F},
                     {1.16F, 1.78F, -2.49F, 0.955F, 0.30F, 0.14F}, {1.22F, 1.62F, -2.49F, 0.95F, 0.28F, 0.14F},
                     {1.28F, 1.52F, -2.48F, 0.94F, 0.26F, 0.14F}, {1.50F, 1.20F, -2.46F, 0.905F, 0.25F, 0.14F},
                     {1.72F, 0.88F, -2.43F, 0.87F, 0.24F, 0.14F}, {1.88F, 0.60F, -2.38F, 0.82F, 0.24F, 0.14F},
                     {1.955F, 0.30F, -2.25F, 0.66F, 0.18F, 0.12F}, {1.97F, 0.0F, -2.0F, 0.2F, 0.06F, 0.06F}}};
      c.belt = 1.24F; c.roof = 1.78F; c.wheel_radius = 0.35F; c.axle_front = 1.55F; c.axle_rear = -1.5F;
      c.lamp_y = 0.88F; c.tail_y = 1.05F; c.pillar_b = 0.66F; c.glass_rear = 0.70F; c.tall_tail = true;
      break;
    case 5:
      c.sections = {{{0.19F, 1.68F, -1.62F, 0.75F, 0.28F, 0.22F}, {0.32F, 1.80F, -1.72F, 0.80F, 0.40F, 0.28F},
                     {0.50F, 1.83F, -1.76F, 0.825F, 0.42F, 0.30F}, {0.66F, 1.80F, -1.76F, 0.83F, 0.42F, 0.32F},
                     {0.78F, 1.68F, -1.74F, 0.82F, 0.42F, 0.32F}, {0.87F, 1.42F, -1.72F, 0.81F, 0.38F, 0.32F},
                     {0.94F, 1.16F, -1.70F, 0.80F, 0.32F, 0.30F}, {1.00F, 0.96F, -1.67F, 0.785F, 0.28F, 0.28F},
                     {1.05F, 0.86F, -1.64F, 0.76F, 0.26F, 0.26F}, {1.20F, 0.64F, -1.56F, 0.71F, 0.25F, 0.25F},
                     {1.36F, 0.38F, -1.44F, 0.65F, 0.25F, 0.25F}, {1.46F, 0.14F, -1.30F, 0.58F, 0.24F, 0.24F},
                     {1.505F, -0.10F, -1.10F, 0.42F, 0.18F, 0.18F}, {1.515F, -0.35F, -0.85F, 0.12F, 0.05F, 0.05F}}};
      c.belt = 1.02F; c.roof = 1.43F; c.wheel_radius = 0.29F; c.axle_front = 1.15F; c.axle_rear = -1.15F;
      c.lamp_y = 0.70F; c.tail_y = 0.88F; c.pillar_b = 0.46F; c.tall_tail = true;
      break;
    default:
      c.sections = {{{0.19F, 1.92F, -1.90F, 0.80F, 0.30F, 0.22F}, {0.32F, 2.06F, -2.02F, 0.855F, 0.42F, 0.28F},
                     {0.50F, 2.10F, -2.07F, 0.885F, 0.46F, 0.30F}, {0.64F, 2.07F, -2.08F, 0.895F, 0.46F, 0.32F},
                     {0.74F, 1.95F, -2.06F, 0.885F, 0.46F, 0.32F}, {0.83F, 1.66F, -2.04F, 0.875F, 0.42F, 0.32F},
                     {0.91F, 1.24F, -2.02F, 0.865F, 0.34F, 0.32F}, {0.97F, 0.96F, -1.99F, 0.85F, 0.30F, 0.30F},
                     {1.02F, 0.84F, -1.95F, 0.82F, 0.28F, 0.28F}, {1.16F, 0.60F, -1.82F, 0.765F, 0.27F, 0.27F},
                     {1.31F, 0.30F, -1.65F, 0.70F, 0.26F, 0.26F}, {1.41F, 0.06F, -1.48F, 0.63F, 0.26F, 0.26F},
                     {1.455F, -0.18F, -1.25F, 0.46F, 0.18F, 0.2F}, {1.465F, -0.42F, -1.0F, 0.15F, 0.06F, 0.06F}}};
      c.belt = 0.985F; c.roof = 1.39F; c.axle_front = 1.30F; c.axle_rear = -1.30F; c.tail_y = 0.86F;
      break;
  }
  return c;
}

// Smooth section at height y: Catmull-Rom through the table.
inline Section section_at(const CarShape& c, float y) {
  const std::size_t n = c.sections.size();
  std::size_t i = 0;
  while (i + 2 < n && y > c.sections[i + 1].y) ++i;
  const Section& b = c.sections[i];
  const Section& d = c.sections[i + 1];
  const Section& a = c.sections[i > 0 ? i - 1 : 0];
  const Section& e = c.sections[i + 2 < n ? i + 2 : n - 1];
  const float t = clamp01((y - b.y) / (d.y - b.y));
  // Cubic Hermite with slopes per metre, limited so that no bulge appears between unequal steps.
  const auto cubic = [&](float va, float vb, float vd, float ve) {
    const float h = d.y - b.y;
    const float slope = (vd - vb) / h;
    const float left = i > 0 ? (vb - va) / (b.y - a.y) : slope;
    const float right = i + 2 < n ? (ve - vd) / (e.y - d.y) : slope;
    const float m0 = left * slope > 0 ? 2 * left * slope / (left + slope) : 0.0F;
    const float m1 = right * slope > 0 ? 2 * right * slope / (right + slope) : 0.0F;
    const float t2 = t * t;
    const float t3 = t2 * t;
    return (2 * t3 - 3 * t2 + 1) * vb + (t3 - 2 * t2 + t) * h * m0 + (3 * t2 - 2 * t3) * vd + (t3 - t2) * h * m1;
  };
  return {y,
          cubic(a.front, b.front, d.front, e.front),
          cubic(a.rear, b.rear, d.rear, e.rear),
          cubic(a.half, b.half, d.half, e.half),
          cubic(a.front_radius, b.front_radius, d.front_radius, e.front_radius),
          cubic(a.rear_radius, b.rear_radius, d.rear_radius, e.rear_radius)};
}

// Half of the outline of a section, from the middle of the rear (u = 0) along the right side to the middle of the
// front (u = 4): rear face [0, 1], rear corner [1, 1.5], side [1.5, 2.5] ... front corner [2.5, 3], front face [3, 4].
inline Vec3f outline(const Section& s, float u) {
  const float rr = s.rear_radius;
  const float fr = s.front_radius;
  // Plan curvature of nose and tail: the middle stands out a little.
  const auto bow = [&](float x) { const float q = x / s.half; return 0.07F * s.half * q * q; };
  if (u <= 1) {
    const float x = (s.half - rr) * u;
    return {x, s.y, s.rear + bow(x)};
  }
  if (u <= 1.5F) {
    const float a = (u - 1) * kPi;
    const float x0 = s.half - rr;
    const float zc = s.rear + bow(x0) + rr;
    return {x0 + rr * std::sin(a), s.y, zc - rr * std::cos(a)};
  }
  if (u <= 2.5F) {
    const float x0 = s.half - rr;
    const float x1 = s.half - fr;
    const float z0 = s.rear + bow(x0) + rr;
    const float z1 = s.front - bow(x1) - fr;
    return {s.half, s.y, mix(z0, z1, u - 1.5F)};
  }
  if (u <= 3) {
    const float a = (u - 2.5F) * kPi;
    const float x1 = s.half - fr;
    const float zc = s.front - bow(x1) - fr;
    return {x1 + fr * std::cos(a), s.y, zc + fr * std::sin(a)};
  }
  const float x = (s.half - fr) * (4 - u);
  return {x, s.y, s.front - bow(x)};
}

// Point of the body; u as in outline(), mirrored to the left for side < 0.
inline Vec3f body_point(const CarShape& c, float u, float y, float side) {
  Vec3f p = outline(section_at(c, y), u);
  p.x *= side;
  return p;
}

// Lower edge of the body above the road, at z along it: the sill, or the wheel arch.
inline float lower_edge(const CarShape& c, float z) {
  const float sill = c.sections[0].y;
  const float r = c.wheel_radius + 0.055F;
  float y = sill;
  for (const float axle : {c.axle_front, c.axle_rear}) {
    const float d = z - axle;
    if (std::fabs(d) < r) y = std::fmax(y, c.wheel_radius + std::sqrt(r * r - d * d));
  }
  return y;
}

// A patch that follows the body `lift` metres outside it: u from u0 to u1, heights from lo(t) to hi(t), t in [0, 1].
template <class Lo, class Hi>
void body_patch(Scene& scene, const Pose& pose, const CarShape& c, float u0, float u1, float side, const Lo& lo,
                const Hi& hi, float lift, int nu, int nv, const Brush& brush) {
  scene.grid(nu, nv,
             [&](int i, int j) {
               const float t = static_cast<float>(i) / static_cast<float>(nu);
               const float u = mix(u0, u1, t);
               const float y = mix(lo(t), hi(t), static_cast<float>(j) / static_cast<float>(nv));
               const float e = 0.004F;
               const Vec3f p = body_point(c, u, y, side);
               const Vec3f du = body_point(c, u + e, y, side) - body_point(c, u - e, y, side);
               const Vec3f dv = body_point(c, u, y + e, side) - body_point(c, u, y - e, side);
               Vec3f n = normalized(cross(dv, du));
               if (n.x * p.x + n.y * (p.y - 0.6F) + n.z * p.z < 0) n = -n;
               return pose.point(p + n * lift);
             },
             (side > 0) == (u1 > u0), brush);
}

struct CarPaints {
  std::uint16_t body, glass, black, tyre, rim, chrome, head, tail, amber;
};

inline std::uint16_t add_vehicle_material(Scene& scene, Kind kind, const Vec3f& base, float roughness, float mirror,
                                          const Pose& frame, std::uint32_t seed, float glow = 0) {
  Material m;
  m.kind = kind;
  m.base = base;
  m.roughness = roughness;
  m.mirror = mirror;
  m.frame = frame;
  m.seed = seed;
  m.glow = glow;
  return scene.add(m);
}

inline void build_wheel(Scene& scene, const Pose& pose, const Vec3f& centre, float radius, float width, float side,
                        std::uint16_t tyre, const Vec3f& rim_colour, int spokes, const Brush& brush, int n) {
  const Brush rubber = brush.with(tyre).smoothed();
  struct Ring {
    float x, r;
  };
  const float h = 0.5F * width;
  const Ring rings[7] = {{-h, radius * 0.62F}, {-h, radius * 0.9F}, {-h * 0.75F, radius}, {h * 0.75F, radius},
                         {h, radius * 0.9F},   {h, radius * 0.64F}, {h - 0.03F, radius * 0.62F}};
  scene.grid(n, 6,
             [&](int i, int j) {
               const float a = 2 * kPi * static_cast<float>(i) / static_cast<float>(n);
               const Ring& ring = rings[j];
               return pose.point(centre + Vec3f{side * ring.x, ring.r * std::sin(a), ring.r * std::cos(a)});
             },
             side > 0, rubber);
  Material m;
  m.kind = Kind::rim;
  m.base = rim_colour;
  m.roughness = 0.3F;
  m.mirror = 0.15F;
  m.variant = spokes;
  m.size = {radius * 0.63F, 0};
  const Pose disc{pose.point(centre + Vec3f{side * (h - 0.035F), 0, 0}), pose.z * -side, pose.y, pose.x * side};
  m.frame = {disc.o, pose.x, pose.y, pose.z};
  scene.disc(disc, radius * 0.63F, n, 0, brush.with(scene.add(m)));
}

struct CarSpec {
  int type = 0;
  Vec3f colour{0.3F, 0.3F, 0.3F};
  bool moving = false;
  bool braking = false;
  int level = 0;  // 0: near, 1: middle, 2: far
};

inline Vec3f car_colour(Dice& dice) {
  // About the shares of European traffic: grey, black and white first, then blue and red, few others.
  const Vec3f colours[16] = {{0.60F, 0.60F, 0.59F}, {0.34F, 0.35F, 0.36F}, {0.022F, 0.023F, 0.025F}, {0.10F, 0.104F, 0.11F},
                             {0.58F, 0.58F, 0.57F}, {0.17F, 0.175F, 0.18F}, {0.015F, 0.016F, 0.019F}, {0.42F, 0.42F, 0.42F},
                             {0.06F, 0.062F, 0.066F}, {0.26F, 0.03F, 0.025F}, {0.025F, 0.05F, 0.14F}, {0.05F, 0.11F, 0.19F},
                             {0.035F, 0.07F, 0.05F}, {0.33F, 0.29F, 0.22F}, {0.14F, 0.02F, 0.025F}, {0.38F, 0.15F, 0.03F}};
  return colours[dice.pick(16)] * dice.uniform(0.85F, 1.1F);
}

inline void build_car(Scene& scene, const Pose& pose, const CarSpec& spec, Dice& dice) {
  const CarShape c = car_shape(spec.type);
  const std::uint32_t seed = dice.bits();
  Brush base;
  base.label = label::car;
  base.instance = scene.next_instance(label::car);
  const std::uint16_t group = scene.add_group(LightClass::car_group);
  base.panel = group;
  const auto material = [&](Kind k, const Vec3f& colour, float rough, float mirror, float glow = 0) {
    return add_vehicle_material(scene, k, colour, rough, mirror, pose, seed, glow);
  };
  const Brush paint = base.with(material(Kind::car_paint, spec.colour, 0.35F, 0.05F)).smoothed();
  const Brush black = base.with(material(Kind::plain, {0.02F, 0.02F, 0.021F}, 0.7F, 0.02F));
  const Brush glass = base.with(material(Kind::car_glass, {0.012F, 0.014F, 0.014F}, 0.05F, 0.09F)).smoothed();
  const Brush chrome = base.with(material(Kind::car_paint, {0.4F, 0.4F, 0.4F}, 0.2F, 0.3F));
  const std::uint16_t tyre = material(Kind::tyre, {0.022F, 0.022F, 0.023F}, 0.95F, 0);

  // Columns of the outline, dense at the wheel arches.
  std::vector<float> us;
  const bool coarse = spec.level > 1;
  const bool close = spec.level == 0;
  const int face = coarse ? 3 : (close ? 6 : 4);
  const int corner = coarse ? 3 : (close ? 6 : 5);
  for (int i = 0; i < face; ++i) us.push_back(static_cast<float>(i) / static_cast<float>(face));
  for (int i = 0; i < corner; ++i) us.push_back(1 + 0.5F * static_cast<float>(i) / static_cast<float>(corner));
  {
    const Section s = section_at(c, 0.45F);
    const float z0 = outline(s, 1.5F).z;
    const float z1 = outline(s, 2.5F).z;
    std::vector<float> zs;
    const float r = c.wheel_radius + 0.055F;
    const float drop = c.wheel_radius - c.sections[0].y;
    const float reach = std::sqrt(r * r - drop * drop);
    const int steps = coarse ? 5 : (close ? 14 : 8);
    for (const float axle : {c.axle_rear, c.axle_front}) {
      for (int i = 0; i <= steps; ++i) {
        const float a = kPi * static_cast<float>(i) / static_cast<float>(steps);
        zs.push_back(axle - reach * std::cos(a));
      }
    }
    const int mid = coarse ? 2 : (close ? 7 : 4);
    for (int i = 1; i < mid; ++i) {
      zs.push_back(mix(c.axle_rear + reach, c.axle_front - reach, static_cast<float>(i) / static_cast<float>(mid)));
    }
    zs.push_back(z0);
    zs.push_back(z1);
    for (std::size_t i = 0; i < zs.size(); ++i) {
      for (std::size_t j = i + 1; j < zs.size(); ++j) {
        if (zs[j] < zs[i]) std::swap(zs[i], zs[j]);
      }
    }
    for (const float z : zs) {
      if (z >= z0 && z < z1 - 1e-4F) us.push_back(1.5F + (z - z0) / (z1 - z0));
    }
  }
  for (int i = 0; i < corner; ++i) us.push_back(2.5F + 0.5F * static_cast<float>(i) / static_cast<float>(corner));
  for (int i = 0; i <= face; ++i) us.push_back(3 + static_cast<float>(i) / static_cast<float>(face));

  const float shoulder = c.sections[4].y;
  const int low_rows = coarse ? 2 : (close ? 6 : 4);
  const int high_rows = coarse ? 9 : (close ? 22 : 15);
  const float top = c.sections[13].y;
  for (const float side : {-1.0F, 1.0F}) {
    scene.grid(static_cast<int>(us.size()) - 1, low_rows + high_rows,
               [&](int i, int j) {
                 const float u = us[static_cast<std::size_t>(i)];
                 float y = 0;
                 if (j <= low_rows) {
                   const float z = body_point(c, u, 0.45F, 1).z;
                   y = mix(lower_edge(c, z), shoulder, static_cast<float>(j) / static_cast<float>(low_rows));
                 } else {
                   const float t = static_cast<float>(j - low_rows) / static_cast<float>(high_rows);
                   y = mix(shoulder, top, 1 - (1 - t) * (1 - 0.35F * t));
                 }
                 return pose.point(body_point(c, u, y, side));
               },
               side > 0, paint);
  }
  const Section last = c.sections[13];
  scene.quad(pose.point({-last.half, top, last.rear}), pose.point({last.half, top, last.rear}),
             pose.point({last.half, top, last.front}), pose.point({-last.half, top, last.front}), pose.y, paint);
  // What is seen below: floor, wheel housings.
  const Section sill = c.sections[0];
  scene.box(pose, {-sill.half + 0.24F, 0.17F, sill.rear + 0.12F}, {sill.half - 0.24F, 0.66F, sill.front - 0.12F}, black);
  scene.box(pose, {-sill.half + 0.02F, 0.18F, c.axle_rear + 0.42F}, {sill.half - 0.02F, 0.3F, c.axle_front - 0.42F}, black);

  const float w = c.sections[2].half;
  const Vec3f rim = dice.chance(0.25F) ? Vec3f{0.06F, 0.06F, 0.06F} : Vec3f{0.38F, 0.38F, 0.39F};
  const int spokes = 5 + dice.pick(4);
  for (const float side : {-1.0F, 1.0F}) {
    for (const float axle : {c.axle_front, c.axle_rear}) {
      build_wheel(scene, pose, {side * (w - 0.125F), c.wheel_radius, axle}, c.wheel_radius, 0.2F, side, tyre, rim, spokes,
                  base, coarse ? 10 : (close ? 28 : 16));
    }
  }

  // Glass. Side windows first, split by the middle pillar.
  const std::uint16_t inside = spec.moving ? 0 : scene.add_light(LightClass::window_parked, group);
  Brush window = glass;
  window.light = inside;
  const float belt = c.belt + 0.02F;
  const float roof = c.roof - 0.01F;
  const int gu = coarse ? 2 : (close ? 8 : 4);
  const int gv = coarse ? 2 : (close ? 6 : 4);
  const auto flat = [](float v) { return [v](float) { return v; }; };
  for (const float side : {-1.0F, 1.0F}) {
    const auto side_window = [&](float from, float to) {
      body_patch(scene, pose, c, 1.5F + from, 1.5F + to, side, flat(belt), flat(roof), 0.008F, gu, gv, window);
    };
    side_window(c.pillar_b + 0.025F, c.glass_front);
    if (c.glass_rear < c.pillar_b - 0.05F) {
      side_window(c.glass_rear + 0.16F, c.pillar_b - 0.025F);
      side_window(c.glass_rear - 0.03F, c.glass_rear + 0.135F);
    }
    // Black line under the windows, sill trim, door gaps and handles.
    body_patch(scene, pose, c, 1.5F + (c.glass_rear < 0.5F ? 0.03F : c.glass_rear), 2.48F, side, flat(belt - 0.022F), flat(belt - 0.002F),
               0.008F, gu * 2, 1, black);
    if (!coarse) {
      const Section s = section_at(c, 0.5F);
      const float z0 = outline(s, 1.5F).z;
      const float z1 = outline(s, 2.5F).z;
      const auto at_z = [&](float z) { return 1.5F + (z - z0) / (z1 - z0); };
      for (const float z : {0.66F, -0.28F, -1.02F}) {
        if (spec.type == 4 && z < -0.3F) continue;
        body_patch(scene, pose, c, at_z(z), at_z(z + 0.012F), side, flat(0.32F), flat(belt - 0.03F), 0.003F, 1, 8, black);
      }
      for (const float z : {-0.2F, -0.95F}) {
        body_patch(scene, pose, c, at_z(z), at_z(z + 0.17F), side, flat(belt - 0.17F), flat(belt - 0.14F), 0.02F, 2, 1, black);
      }
      body_patch(scene, pose, c, at_z(c.axle_rear + 0.45F), at_z(c.axle_front - 0.45F), side, flat(0.2F), flat(0.29F), 0.012F,
                 6, 2, black);
    }
    // Mirrors.
    const float my = belt + 0.06F;
    const Vec3f root = body_point(c, 1.5F + c.glass_front - 0.05F, my, side);
    scene.ellipsoid(pose.moved({root.x + side * 0.13F, my + 0.02F, root.z}), {0.11F, 0.075F, 0.06F}, 10, 6, paint);
  }
  // Windscreen and rear window, leaving the pillars; not lights of their own.
  const int wu = coarse ? 5 : (close ? 18 : 10);
  const float lift = close ? 0.009F : 0.014F;
  const float rear_low = spec.type == 1 ? c.sections[8].y + 0.01F : belt + 0.03F;
  for (const float side : {-1.0F, 1.0F}) {
    body_patch(scene, pose, c, 2.72F, 4.0F, side, flat(c.sections[7].y + 0.035F), flat(c.roof + 0.01F), lift, wu, gv + 3, window);
    if (spec.type != 4) {
      body_patch(scene, pose, c, 0.0F, 1.16F, side, flat(rear_low), flat(c.roof - 0.01F), lift, wu, gv + 3, window);
    } else {
      body_patch(scene, pose, c, 0.06F, 0.88F, side, flat(belt + 0.04F), flat(c.roof - 0.02F), lift, wu, gv, window);
    }
  }

  // Lamps: one light each, marked by whether the car is parked.
  const LightClass front_class = spec.moving ? LightClass::moving_front : LightClass::parked_front;
  const LightClass rear_class = spec.moving ? LightClass::moving_rear : LightClass::parked_rear;
  const std::uint16_t lens = material(Kind::lamp, {0.55F, 0.56F, 0.57F}, 0.1F, 0.08F);
  const std::uint16_t red = material(Kind::lamp, {0.30F, 0.013F, 0.011F}, 0.15F, 0.035F, spec.braking ? 2.2F : 0.0F);
  const int lu = coarse ? 4 : (close ? 12 : 8);
  for (const float side : {-1.0F, 1.0F}) {
    const Brush head = base.lit(lens, scene.add_light(front_class, group)).smoothed();
    const float ly = c.lamp_y;
    body_patch(scene, pose, c, 2.62F, 3.38F, side, [&](float t) { return ly - 0.075F + 0.03F * (1 - t); },
               [&](float t) { return ly + 0.03F + 0.065F * (1 - t); }, 0.012F, lu, 3, head);
    const Brush tail = base.lit(red, scene.add_light(rear_class, group)).smoothed();
    const float ty = c.tail_y;
    if (c.tall_tail) {
      body_patch(scene, pose, c, 0.9F, 1.34F, side, flat(ty - 0.2F), flat(ty + 0.22F), 0.012F, lu, 4, tail);
    } else {
      body_patch(scene, pose, c, 0.74F, 1.40F, side, [&](float t) { return ty - 0.075F + 0.02F * t; },
                 [&](float t) { return ty + 0.06F - 0.02F * (1 - t); }, 0.012F, lu, 3, tail);
    }
    // Indicator below the headlamp.
    body_patch(scene, pose, c, 2.86F, 3.3F, side, flat(0.37F), flat(0.46F), 0.01F, 4, 2, black);
    // Grille, bumper grilles, rear bumper.
    const float gy = c.lamp_y;
    body_patch(scene, pose, c, 3.44F, 4.0F, side, flat(gy - 0.075F), flat(gy + 0.035F), 0.009F, 5, 2, black);
    body_patch(scene, pose, c, 3.3F, 4.0F, side, flat(0.27F), flat(0.43F), 0.009F, 5, 2, black);
    body_patch(scene, pose, c, 0.0F, 1.25F, side, flat(0.21F), flat(0.34F), 0.009F, 6, 2, black);
    if (!coarse) {
      body_patch(scene, pose, c, 3.5F, 4.0F, side, flat(gy - 0.03F), flat(gy - 0.018F), 0.016F, 4, 1, chrome);
      if (spec.type != 1 && spec.type != 4) {  // gaps of the tailgate
        body_patch(scene, pose, c, 0.93F, 0.945F, side, flat(0.55F), flat(belt), 0.004F, 1, 6, black);
      }
      body_patch(scene, pose, c, 0.0F, 0.95F, side, flat(0.535F), flat(0.547F), 0.004F, 6, 1, black);
    }
  }
  // Plates and badge.
  const bool plate_high = spec.type == 1 || spec.type == 2;
  for (const float dir : {-1.0F, 1.0F}) {
    const float y = dir > 0 ? 0.40F : (plate_high ? 0.66F : 0.62F);
    const Vec3f p = body_point(c, dir > 0 ? 4.0F : 0.0F, y, 1);
    Material m;
    m.kind = Kind::plate;
    m.seed = seed;
    m.roughness = 0.5F;
    m.frame = Pose{pose.point({0, y, p.z + dir * 0.016F}), pose.x * -dir, pose.y, pose.z * dir};
    const float h = 0.056F;
    scene.box(m.frame, {-0.262F, -h - 0.008F, -0.05F}, {0.262F, h + 0.008F, -0.001F}, black);
    scene.panel_xy(m.frame, -0.256F, 0.256F, -h, h, 0, base.with(scene.add(m)));
  }
  if (spec.type != 4) {  // third brake lamp and aerial
    const float y = c.roof + 0.015F;
    if (spec.type != 1) {
      const Brush third = base.lit(red, scene.add_light(rear_class, group));
      body_patch(scene, pose, c, 0.0F, 0.3F, 1, flat(y), flat(y + 0.022F), 0.01F, 2, 1, third);
    }
  }
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_CAR_HPP
