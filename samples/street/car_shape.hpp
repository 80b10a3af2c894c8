// SPDX-License-Identifier: Apache-2.0
// Bodies of cars as surfaces: horizontal sections that are rounded rectangles, stacked from the sill to the roof, with
// round wheel arches cut into the lower edge.
//
// Frame of a vehicle: origin on the road under its middle, x to its right seen from behind, y up, z forward.
#ifndef NPSIM_SAMPLES_STREET_CAR_SHAPE_HPP
#define NPSIM_SAMPLES_STREET_CAR_SHAPE_HPP

#include <array>
#include <cmath>
#include <cstddef>

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
  float belt = 0.95F;  // where the side windows begin
  float roof = 1.40F;  // where they end
  float wheel_radius = 0.32F;
  float axle_front = 1.3F;
  float axle_rear = -1.3F;
  float lamp_y = 0.66F;  // middle of the headlamps
  float tail_y = 0.82F;
  float pillar_b = 0.52F;  // share of the side, from the rear
  float glass_rear = 0.10F;
  float glass_front = 0.95F;
  bool tall_tail = false;  // lamps stand upright beside the rear window
};

// 0 hatchback, 1 saloon, 2 estate, 3 sport utility, 4 delivery van, 5 small car
inline CarShape car_shape(int type) {
  CarShape c;
  switch (type) {
    case 1:
      c.sections = {{{0.19F, 2.10F, -2.15F, 0.80F, 0.30F, 0.25F},
                     {0.32F, 2.24F, -2.27F, 0.865F, 0.42F, 0.30F},
                     {0.50F, 2.28F, -2.31F, 0.90F, 0.46F, 0.32F},
                     {0.64F, 2.25F, -2.31F, 0.905F, 0.48F, 0.34F},
                     {0.74F, 2.12F, -2.30F, 0.895F, 0.48F, 0.35F},
                     {0.82F, 1.80F, -2.28F, 0.885F, 0.42F, 0.36F},
                     {0.90F, 1.30F, -2.24F, 0.875F, 0.34F, 0.36F},
                     {0.955F, 0.96F, -2.10F, 0.86F, 0.30F, 0.34F},
                     {1.00F, 0.84F, -1.72F, 0.83F, 0.28F, 0.28F},
                     {1.12F, 0.62F, -1.46F, 0.775F, 0.27F, 0.28F},
                     {1.28F, 0.30F, -1.14F, 0.70F, 0.26F, 0.28F},
                     {1.38F, 0.05F, -0.85F, 0.62F, 0.26F, 0.28F},
                     {1.425F, -0.18F, -0.62F, 0.46F, 0.18F, 0.2F},
                     {1.435F, -0.32F, -0.48F, 0.15F, 0.06F, 0.06F}}};
      c.belt = 0.97F;
      c.roof = 1.36F;
      c.axle_front = 1.38F;
      c.axle_rear = -1.36F;
      c.tail_y = 0.84F;
      c.glass_rear = 0.08F;
      break;
    case 2:
      c.sections = {{{0.19F, 2.10F, -2.12F, 0.80F, 0.30F, 0.22F},
                     {0.32F, 2.24F, -2.24F, 0.865F, 0.42F, 0.26F},
                     {0.50F, 2.28F, -2.28F, 0.90F, 0.46F, 0.28F},
                     {0.64F, 2.25F, -2.28F, 0.905F, 0.48F, 0.28F},
                     {0.74F, 2.12F, -2.26F, 0.895F, 0.48F, 0.28F},
                     {0.82F, 1.80F, -2.25F, 0.885F, 0.42F, 0.28F},
                     {0.90F, 1.32F, -2.24F, 0.875F, 0.34F, 0.28F},
                     {0.97F, 0.98F, -2.21F, 0.86F, 0.30F, 0.26F},
                     {1.02F, 0.86F, -2.17F, 0.83F, 0.28F, 0.24F},
                     {1.16F, 0.60F, -2.06F, 0.775F, 0.27F, 0.24F},
                     {1.32F, 0.28F, -1.92F, 0.71F, 0.26F, 0.24F},
                     {1.42F, 0.05F, -1.78F, 0.64F, 0.26F, 0.24F},
                     {1.465F, -0.20F, -1.55F, 0.48F, 0.18F, 0.2F},
                     {1.475F, -0.45F, -1.25F, 0.15F, 0.06F, 0.06F}}};
      c.belt = 0.98F;
      c.roof = 1.40F;
      c.axle_front = 1.38F;
      c.axle_rear = -1.34F;
      c.tail_y = 0.86F;
      break;
    case 3:
      c.sections = {{{0.24F, 2.08F, -2.08F, 0.84F, 0.28F, 0.24F},
                     {0.40F, 2.20F, -2.20F, 0.90F, 0.38F, 0.28F},
                     {0.60F, 2.24F, -2.24F, 0.935F, 0.42F, 0.30F},
                     {0.78F, 2.22F, -2.24F, 0.94F, 0.42F, 0.30F},
                     {0.90F, 2.10F, -2.22F, 0.93F, 0.42F, 0.30F},
                     {0.98F, 1.80F, -2.21F, 0.92F, 0.38F, 0.30F},
                     {1.05F, 1.36F, -2.20F, 0.91F, 0.32F, 0.30F},
                     {1.12F, 1.02F, -2.17F, 0.89F, 0.30F, 0.28F},
                     {1.17F, 0.90F, -2.14F, 0.86F, 0.28F, 0.26F},
                     {1.32F, 0.66F, -2.02F, 0.81F, 0.27F, 0.25F},
                     {1.48F, 0.38F, -1.88F, 0.74F, 0.26F, 0.25F},
                     {1.60F, 0.12F, -1.72F, 0.67F, 0.26F, 0.25F},
                     {1.655F, -0.16F, -1.45F, 0.50F, 0.18F, 0.2F},
                     {1.67F, -0.45F, -1.15F, 0.15F, 0.06F, 0.06F}}};
      c.belt = 1.14F;
      c.roof = 1.57F;
      c.wheel_radius = 0.36F;
      c.axle_front = 1.36F;
      c.axle_rear = -1.32F;
      c.lamp_y = 0.84F;
      c.tail_y = 1.0F;
      break;
    case 4:
      c.sections = {{{0.24F, 2.20F, -2.40F, 0.86F, 0.25F, 0.12F},
                     {0.40F, 2.34F, -2.48F, 0.93F, 0.34F, 0.14F},
                     {0.62F, 2.38F, -2.50F, 0.965F, 0.38F, 0.14F},
                     {0.84F, 2.34F, -2.50F, 0.97F, 0.38F, 0.14F},
                     {0.98F, 2.22F, -2.50F, 0.965F, 0.38F, 0.14F},
                     {1.08F, 2.02F, -2.50F, 0.96F, 0.34F, 0.14F},
                     {1.16F, 1.78F, -2.49F, 0.955F, 0.30F, 0.14F},
                     {1.22F, 1.62F, -2.49F, 0.95F, 0.28F, 0.14F},
                     {1.28F, 1.52F, -2.48F, 0.94F, 0.26F, 0.14F},
                     {1.50F, 1.20F, -2.46F, 0.905F, 0.25F, 0.14F},
                     {1.72F, 0.88F, -2.43F, 0.87F, 0.24F, 0.14F},
                     {1.88F, 0.60F, -2.38F, 0.82F, 0.24F, 0.14F},
                     {1.955F, 0.30F, -2.25F, 0.66F, 0.18F, 0.12F},
                     {1.97F, 0.0F, -2.0F, 0.2F, 0.06F, 0.06F}}};
      c.belt = 1.24F;
      c.roof = 1.78F;
      c.wheel_radius = 0.35F;
      c.axle_front = 1.55F;
      c.axle_rear = -1.5F;
      c.lamp_y = 0.88F;
      c.tail_y = 1.05F;
      c.pillar_b = 0.66F;
      c.glass_rear = 0.70F;
      c.tall_tail = true;
      break;
    case 5:
      c.sections = {{{0.19F, 1.68F, -1.62F, 0.75F, 0.28F, 0.22F},
                     {0.32F, 1.80F, -1.72F, 0.80F, 0.40F, 0.28F},
                     {0.50F, 1.83F, -1.76F, 0.825F, 0.42F, 0.30F},
                     {0.66F, 1.80F, -1.76F, 0.83F, 0.42F, 0.32F},
                     {0.78F, 1.68F, -1.74F, 0.82F, 0.42F, 0.32F},
                     {0.87F, 1.42F, -1.72F, 0.81F, 0.38F, 0.32F},
                     {0.94F, 1.16F, -1.70F, 0.80F, 0.32F, 0.30F},
                     {1.00F, 0.96F, -1.67F, 0.785F, 0.28F, 0.28F},
                     {1.05F, 0.86F, -1.64F, 0.76F, 0.26F, 0.26F},
                     {1.20F, 0.64F, -1.56F, 0.71F, 0.25F, 0.25F},
                     {1.36F, 0.38F, -1.44F, 0.65F, 0.25F, 0.25F},
                     {1.46F, 0.14F, -1.30F, 0.58F, 0.24F, 0.24F},
                     {1.505F, -0.10F, -1.10F, 0.42F, 0.18F, 0.18F},
                     {1.515F, -0.35F, -0.85F, 0.12F, 0.05F, 0.05F}}};
      c.belt = 1.02F;
      c.roof = 1.43F;
      c.wheel_radius = 0.29F;
      c.axle_front = 1.15F;
      c.axle_rear = -1.15F;
      c.lamp_y = 0.70F;
      c.tail_y = 0.88F;
      c.pillar_b = 0.46F;
      c.tall_tail = true;
      break;
    default:
      c.sections = {{{0.19F, 1.92F, -1.90F, 0.80F, 0.30F, 0.22F},
                     {0.32F, 2.06F, -2.02F, 0.855F, 0.42F, 0.28F},
                     {0.50F, 2.10F, -2.07F, 0.885F, 0.46F, 0.30F},
                     {0.64F, 2.07F, -2.08F, 0.895F, 0.46F, 0.32F},
                     {0.74F, 1.95F, -2.06F, 0.885F, 0.46F, 0.32F},
                     {0.83F, 1.66F, -2.04F, 0.875F, 0.42F, 0.32F},
                     {0.91F, 1.24F, -2.02F, 0.865F, 0.34F, 0.32F},
                     {0.97F, 0.96F, -1.99F, 0.85F, 0.30F, 0.30F},
                     {1.02F, 0.84F, -1.95F, 0.82F, 0.28F, 0.28F},
                     {1.16F, 0.60F, -1.82F, 0.765F, 0.27F, 0.27F},
                     {1.31F, 0.30F, -1.65F, 0.70F, 0.26F, 0.26F},
                     {1.41F, 0.06F, -1.48F, 0.63F, 0.26F, 0.26F},
                     {1.455F, -0.18F, -1.25F, 0.46F, 0.18F, 0.2F},
                     {1.465F, -0.42F, -1.0F, 0.15F, 0.06F, 0.06F}}};
      c.belt = 0.985F;
      c.roof = 1.39F;
      c.axle_front = 1.30F;
      c.axle_rear = -1.30F;
      c.tail_y = 0.86F;
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
  const auto bow = [&](float x) {
    const float q = x / s.half;
    return 0.07F * s.half * q * q;
  };
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

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_CAR_SHAPE_HPP
