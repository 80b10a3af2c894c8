// SPDX-License-Identifier: Apache-2.0
// Cars: the body, and on it glass, lamps, plates and trim as patches a few millimetres outside.
//
// Lamps and windows of one car form a car_group. Frame as in car_shape.hpp. Cost: 2,000 to 9,000 triangles by level.
#ifndef NPSIM_SAMPLES_STREET_CAR_HPP
#define NPSIM_SAMPLES_STREET_CAR_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "car_shape.hpp"
#include "dice.hpp"
#include "scene.hpp"
#include "vehicle_parts.hpp"

namespace npsim {
namespace street {

struct CarSpec {
  int type = 0;
  Vec3f colour{0.3F, 0.3F, 0.3F};
  bool moving = false;
  bool braking = false;
  int level = 0;  // 0: near, 1: middle, 2: far
};

inline Vec3f car_colour(Dice& dice) {
  // About the shares of European traffic: grey, black and white first, then blue and red, few others.
  const Vec3f colours[16] = {
      {0.60F, 0.60F, 0.59F},   {0.34F, 0.35F, 0.36F},  {0.022F, 0.023F, 0.025F}, {0.10F, 0.104F, 0.11F},
      {0.58F, 0.58F, 0.57F},   {0.17F, 0.175F, 0.18F}, {0.015F, 0.016F, 0.019F}, {0.42F, 0.42F, 0.42F},
      {0.06F, 0.062F, 0.066F}, {0.26F, 0.03F, 0.025F}, {0.025F, 0.05F, 0.14F},   {0.05F, 0.11F, 0.19F},
      {0.035F, 0.07F, 0.05F},  {0.33F, 0.29F, 0.22F},  {0.14F, 0.02F, 0.025F},   {0.38F, 0.15F, 0.03F}};
  return dice.one_of(colours, 0.85F, 1.1F);
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
    scene.grid(
        static_cast<int>(us.size()) - 1, low_rows + high_rows,
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
  scene.box(pose, {-sill.half + 0.24F, 0.17F, sill.rear + 0.12F}, {sill.half - 0.24F, 0.66F, sill.front - 0.12F},
            black);
  scene.box(pose, {-sill.half + 0.02F, 0.18F, c.axle_rear + 0.42F}, {sill.half - 0.02F, 0.3F, c.axle_front - 0.42F},
            black);

  const float w = c.sections[2].half;
  const Vec3f rim = dice.chance(0.25F) ? Vec3f{0.06F, 0.06F, 0.06F} : Vec3f{0.38F, 0.38F, 0.39F};
  const int spokes = 5 + dice.pick(4);
  for (const float side : {-1.0F, 1.0F}) {
    for (const float axle : {c.axle_front, c.axle_rear}) {
      build_wheel(scene, pose, {side * (w - 0.125F), c.wheel_radius, axle}, c.wheel_radius, 0.2F, side, tyre, rim,
                  spokes, base, coarse ? 10 : (close ? 28 : 16));
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
    body_patch(scene, pose, c, 1.5F + (c.glass_rear < 0.5F ? 0.03F : c.glass_rear), 2.48F, side, flat(belt - 0.022F),
               flat(belt - 0.002F), 0.008F, gu * 2, 1, black);
    if (!coarse) {
      const Section s = section_at(c, 0.5F);
      const float z0 = outline(s, 1.5F).z;
      const float z1 = outline(s, 2.5F).z;
      const auto at_z = [&](float z) { return 1.5F + (z - z0) / (z1 - z0); };
      for (const float z : {0.66F, -0.28F, -1.02F}) {
        if (spec.type == 4 && z < -0.3F) continue;
        body_patch(scene, pose, c, at_z(z), at_z(z + 0.012F), side, flat(0.32F), flat(belt - 0.03F), 0.003F, 1, 8,
                   black);
      }
      for (const float z : {-0.2F, -0.95F}) {
        body_patch(scene, pose, c, at_z(z), at_z(z + 0.17F), side, flat(belt - 0.17F), flat(belt - 0.14F), 0.02F, 2, 1,
                   black);
      }
      body_patch(scene, pose, c, at_z(c.axle_rear + 0.45F), at_z(c.axle_front - 0.45F), side, flat(0.2F), flat(0.29F),
                 0.012F, 6, 2, black);
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
    body_patch(scene, pose, c, 2.72F, 4.0F, side, flat(c.sections[7].y + 0.035F), flat(c.roof + 0.01F), lift, wu,
               gv + 3, window);
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
  const std::uint16_t red = material(Kind::lamp, {0.30F, 0.013F, 0.011F}, 0.15F, 0.035F, spec.braking ? 1.7F : 0.0F);
  const int lu = coarse ? 4 : (close ? 12 : 8);
  for (const float side : {-1.0F, 1.0F}) {
    const Brush head = base.lit(lens, scene.aimed(scene.add_light(front_class, group), pose.z, pose.y)).smoothed();
    const float ly = c.lamp_y;
    body_patch(
        scene, pose, c, 2.62F, 3.38F, side, [&](float t) { return ly - 0.075F + 0.03F * (1 - t); },
        [&](float t) { return ly + 0.03F + 0.065F * (1 - t); }, 0.012F, lu, 3, head);
    const Brush tail = base.lit(red, scene.aimed(scene.add_light(rear_class, group), -pose.z, pose.y)).smoothed();
    const float ty = c.tail_y;
    if (c.tall_tail) {
      body_patch(scene, pose, c, spec.type == 4 ? 0.93F : 0.95F, 1.26F, side, flat(ty - 0.13F), flat(ty + 0.15F),
                 0.012F, lu, 4, tail);
    } else {
      body_patch(
          scene, pose, c, 0.74F, 1.40F, side, [&](float t) { return ty - 0.075F + 0.02F * t; },
          [&](float t) { return ty + 0.06F - 0.02F * (1 - t); }, 0.012F, lu, 3, tail);
    }
    // Indicator below the headlamp.
    body_patch(scene, pose, c, 2.86F, 3.3F, side, flat(c.sections[0].y + 0.16F), flat(c.sections[0].y + 0.25F), 0.012F,
               8, 2, black);
    // Grille, bumper grilles, rear bumper.
    const float gy = c.lamp_y;
    const float low = c.sections[0].y;
    body_patch(scene, pose, c, 3.44F, 4.0F, side, flat(gy - 0.075F), flat(gy + 0.035F), 0.009F, 5, 2, black);
    body_patch(scene, pose, c, 3.3F, 4.0F, side, flat(low + 0.07F), flat(low + 0.23F), 0.012F, 8, 3, black);
    body_patch(scene, pose, c, 0.0F, 1.25F, side, flat(low + 0.015F), flat(low + 0.15F), 0.012F, coarse ? 6 : 14, 3,
               black);
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
      const Brush third = base.lit(red, scene.aimed(scene.add_light(rear_class, group), -pose.z, pose.y));
      body_patch(scene, pose, c, 0.0F, 0.3F, 1, flat(y), flat(y + 0.022F), 0.01F, 2, 1, third);
    }
  }
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_CAR_HPP
