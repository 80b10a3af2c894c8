// SPDX-License-Identifier: Apache-2.0
// Roofs: pitched, mansard or flat, with gables, dormers, gutters and chimneys.
#ifndef NPSIM_SAMPLES_STREET_ROOF_HPP
#define NPSIM_SAMPLES_STREET_ROOF_HPP

#include <cmath>
#include <cstdint>

#include "dice.hpp"
#include "facade.hpp"
#include "scene.hpp"

namespace npsim {
namespace street {

// Roof over [0, width] x [0, -depth] above `top`; ridge along x.
inline void build_roof(Scene& scene, const Pose& p, float width, float depth, const HouseStyle& h, Dice& dice) {
  const float top = h.height();
  const auto at = [&](float x, float y, float z) { return p.point({x, y, z}); };
  const int type = dice.pick(5);  // 0, 1: pitched; 2, 3: mansard; 4: flat
  Brush roof = h.roof;
  const auto tiles = [&](const Vec3f& up_slope, const Vec3f& out, const Vec3f& origin) {
    Material m = scene.materials[h.roof.material];
    m.frame = {origin, p.x, up_slope, out};
    return h.roof.with(scene.add(m));
  };
  float ridge = top;
  if (type == 4) {
    scene.quad(at(0, top - 0.3F, 0), at(width, top - 0.3F, 0), at(width, top - 0.3F, -depth), at(0, top - 0.3F, -depth),
               p.y, h.metal);
    const float rim = dice.uniform(0.4F, 0.9F);
    scene.box(p, {0, top, -0.25F}, {width, top + rim, 0}, h.wall);
    scene.box(p, {0, top - 0.3F, -depth}, {0.25F, top + rim, -0.25F}, h.wall);
    scene.box(p, {width - 0.25F, top - 0.3F, -depth}, {width, top + rim, -0.25F}, h.wall);
    scene.box(p, {-0.03F, top + rim, -0.3F}, {width + 0.03F, top + rim + 0.08F, 0.05F}, h.trim);
    ridge = top + rim;
  } else {
    const bool mansard = type >= 2;
    const float eave = 0.35F;
    const float slope = mansard ? dice.uniform(1.9F, 3.0F) : dice.uniform(0.62F, 1.0F);
    const float run = mansard ? dice.uniform(0.9F, 1.3F) : 0.5F * depth;
    const float rise = mansard ? slope * (run + eave) : slope * (run + eave);
    const Vec3f up = normalized(p.y * rise - p.z * (run + eave));
    const Vec3f out = cross(p.x, up);
    roof = tiles(up, out, at(0, top, eave));
    scene.quad(at(0, top, eave), at(width, top, eave), at(width, top + rise, -run), at(0, top + rise, -run), out, roof);
    scene.quad(at(0, top, eave), at(width, top, eave), at(width, top, 0), at(0, top, 0), -p.y, h.trim);
    const float back = depth - run;
    if (mansard) {
      const float lift = 0.25F * (depth - 2 * run) * 0.5F;
      const Vec3f flat_up = normalized(p.y * lift - p.z * (0.5F * depth - run));
      const Brush upper = tiles(flat_up, cross(p.x, flat_up), at(0, top + rise, -run));
      scene.quad(at(0, top + rise, -run), at(width, top + rise, -run), at(width, top + rise + lift, -0.5F * depth),
                 at(0, top + rise + lift, -0.5F * depth), p.y, upper);
      scene.quad(at(0, top + rise, -back), at(width, top + rise, -back), at(width, top + rise + lift, -0.5F * depth),
                 at(0, top + rise + lift, -0.5F * depth), p.y, upper);
      scene.box(p, {0, top + rise - 0.12F, -run - 0.1F}, {width, top + rise + 0.08F, -run + 0.12F}, h.metal);
      ridge = top + rise + lift;
    } else {
      ridge = top + rise;
    }
    scene.quad(at(0, top, -depth), at(width, top, -depth), at(width, top + rise, -back), at(0, top + rise, -back),
               p.direction({0, 0.3F, -1}), roof);
    // Gable walls.
    for (int side = 0; side < 2; ++side) {
      const float x = side == 0 ? 0.0F : width;
      const Vec3f face = side == 0 ? -p.x : p.x;
      scene.quad(at(x, top, 0), at(x, top, -depth), at(x, top + rise, -back), at(x, top + rise, -run), face, h.wall);
      if (mansard) {
        scene.triangle(at(x, top + rise, -run), at(x, top + rise, -back), at(x, ridge, -0.5F * depth), face, h.wall);
      }
    }
    // Gutter along the eave and dormers above it.
    scene.bar(at(0, top + 0.02F, eave + 0.02F), at(width, top + 0.02F, eave + 0.02F), 0.07F, 0.07F, 6, h.metal);
    if (mansard || dice.chance(0.6F)) {
      const int n = static_cast<int>(width / (h.pitch * 1.25F));
      const std::uint16_t group = scene.add_group(LightClass::windows_group);
      for (int i = 0; i < n; ++i) {
        const float c = width * (static_cast<float>(i) + 0.5F) / static_cast<float>(n);
        const float w = 0.62F;
        const float y0 = top + (mansard ? 0.45F : 0.8F);
        const float y1 = y0 + 1.45F;
        const float front = eave - (y0 - top) / slope + 0.12F;
        const float rear = front - 1.7F / slope - 0.5F;
        const Pose q = p.moved({c - w, 0, front});
        const Opening o{0.14F, 2 * w - 0.14F, y0 + 0.12F, y1 - 0.1F};
        build_wall_row(
            scene, q, 2 * w, y0, y1, 1, [&](int) { return o; }, h.trim);
        HouseStyle small = h;
        small.recess = 0.08F;
        small.surrounds = false;
        small.hoods = false;
        small.shutters = false;
        build_reveal(scene, q, o, small.recess, h.trim);
        build_glazing(scene, q, o, small, scene.add_light(LightClass::window_building, group), dice);
        const float d = rear - front;
        for (int s = 0; s < 2; ++s) {
          const float x = s == 0 ? 0.0F : 2 * w;
          scene.quad(q.point({x, y0, 0}), q.point({x, y1, 0}), q.point({x, y1, d}), q.point({x, y0, d}),
                     s == 0 ? -p.x : p.x, roof);
        }
        scene.box(q, {-0.1F, y1, d}, {2 * w + 0.1F, y1 + 0.1F, 0.14F}, h.metal);
      }
    }
  }
  const int stacks = 1 + dice.pick(3);
  Material brick;
  brick.kind = Kind::brick;
  brick.base = {0.24F, 0.11F, 0.08F};
  brick.second = {0.3F, 0.28F, 0.26F};
  brick.frame = p;
  brick.roughness = 0.9F;
  const Brush b = h.wall.with(scene.add(brick));
  for (int i = 0; i < stacks; ++i) {
    const float x = dice.uniform(0.6F, width - 1.4F);
    const float z = -dice.uniform(0.32F, 0.5F) * depth;
    scene.box(p, {x, top, z - 0.5F}, {x + 0.75F, ridge + dice.uniform(0.4F, 1.1F), z}, b);
    scene.bar(at(x + 0.37F, ridge + 0.4F, z - 0.25F), at(x + 0.37F, ridge + 1.5F, z - 0.25F), 0.11F, 0.09F, 6, h.metal);
  }
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_ROOF_HPP
