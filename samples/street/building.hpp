// SPDX-License-Identifier: Apache-2.0
// Houses along both sides of the street and across its end: style, walls, roof with dormers and chimneys.
#ifndef NPSIM_SAMPLES_STREET_BUILDING_HPP
#define NPSIM_SAMPLES_STREET_BUILDING_HPP

#include <cmath>
#include <cstdint>

#include "dice.hpp"
#include "facade.hpp"
#include "layout.hpp"
#include "roof.hpp"
#include "scene.hpp"

namespace npsim {
namespace street {

inline HouseStyle make_style(Scene& scene, const Pose& frame, Dice& dice, Detail detail) {
  HouseStyle h;
  h.detail = detail;
  const Vec3f plasters[12] = {{0.62F, 0.57F, 0.45F}, {0.66F, 0.63F, 0.57F}, {0.58F, 0.45F, 0.26F},
                              {0.50F, 0.36F, 0.28F}, {0.45F, 0.48F, 0.47F}, {0.60F, 0.50F, 0.40F},
                              {0.34F, 0.38F, 0.42F}, {0.64F, 0.55F, 0.32F}, {0.52F, 0.27F, 0.19F},
                              {0.42F, 0.45F, 0.36F}, {0.36F, 0.33F, 0.30F}, {0.60F, 0.48F, 0.44F}};
  const Vec3f bricks[4] = {
      {0.30F, 0.11F, 0.07F}, {0.25F, 0.13F, 0.09F}, {0.42F, 0.32F, 0.20F}, {0.17F, 0.095F, 0.075F}};
  const int type = dice.pick(10);  // 0-5 plaster, 6-8 brick, 9 natural stone
  Material wall;
  wall.seed = dice.bits();
  wall.frame = frame;
  wall.roughness = 0.9F;
  if (type <= 5) {
    wall.kind = Kind::plaster;
    wall.base = dice.one_of(plasters, 0.78F, 1.0F);
  } else if (type <= 8) {
    wall.kind = Kind::brick;
    wall.base = dice.one_of(bricks, 0.9F, 1.2F);
    wall.second = {0.36F, 0.34F, 0.31F};
  } else {
    wall.kind = Kind::stone;
    wall.base = {0.42F, 0.38F, 0.31F};
  }
  Material ground = wall;
  const int ground_type = dice.pick(3);
  if (ground_type == 0) {
    ground.kind = Kind::stone;
    ground.base = mix(Vec3f{0.36F, 0.34F, 0.31F}, wall.base, 0.35F);
  } else if (ground_type == 1) {
    ground.kind = Kind::plaster;
    ground.base = wall.kind == Kind::brick ? Vec3f{0.4F, 0.38F, 0.35F} : wall.base * 0.62F;
  }
  Brush base;
  base.label = label::building;
  h.wall = base.with(scene.add(wall));
  h.ground = base.with(scene.add(ground));
  Material trim;
  trim.kind = Kind::plaster;
  trim.frame = frame;
  trim.seed = dice.bits();
  trim.variation = 0.7F;
  trim.roughness = 0.85F;
  trim.base = wall.kind == Kind::plaster && luminance(wall.base) > 0.52F && dice.chance(0.5F)
                  ? wall.base * 0.72F
                  : Vec3f{0.62F, 0.60F, 0.55F} * dice.uniform(0.75F, 1.0F);
  h.trim = base.with(scene.add(trim));
  const Vec3f frames[4] = {{0.66F, 0.66F, 0.64F}, {0.66F, 0.66F, 0.64F}, {0.22F, 0.13F, 0.07F}, {0.12F, 0.13F, 0.14F}};
  h.frame = base.with(scene.add_plain(frames[dice.pick(4)], 0.5F, 0.2F));
  const Vec3f metals[4] = {{0.06F, 0.06F, 0.065F}, {0.10F, 0.16F, 0.12F}, {0.16F, 0.07F, 0.05F}, {0.3F, 0.3F, 0.3F}};
  h.metal = base.with(scene.add_plain(metals[dice.pick(4)], 0.5F, 0.4F));
  Material roof;
  roof.kind = Kind::roof_tiles;
  const Vec3f roofs[4] = {
      {0.24F, 0.09F, 0.055F}, {0.17F, 0.08F, 0.06F}, {0.075F, 0.078F, 0.085F}, {0.11F, 0.10F, 0.095F}};
  const int r = dice.pick(4);
  roof.base = roofs[r];
  roof.variant = r >= 2 ? 1 : 0;
  roof.roughness = 0.75F;
  roof.seed = dice.bits();
  roof.frame = frame;
  h.roof = base.with(scene.add(roof));
  const Vec3f doors[5] = {{0.16F, 0.07F, 0.035F},
                          {0.05F, 0.11F, 0.07F},
                          {0.08F, 0.09F, 0.16F},
                          {0.25F, 0.05F, 0.04F},
                          {0.3F, 0.28F, 0.25F}};
  h.accent = doors[dice.pick(5)];
  h.floors = 2 + dice.pick(4);
  h.floor_h = dice.uniform(2.9F, 3.6F);
  h.ground_h = dice.uniform(3.6F, 4.4F);
  h.window_w = dice.uniform(0.95F, 1.4F);
  h.window_h = h.floor_h * dice.uniform(0.48F, 0.62F);
  h.pitch = h.window_w + dice.uniform(0.85F, 1.6F);
  h.sill_h = (h.floor_h - h.window_h) * dice.uniform(0.45F, 0.6F);
  h.recess = dice.uniform(0.12F, 0.24F);
  h.glazing = dice.pick(3);
  h.surrounds = dice.chance(0.55F);
  h.hoods = h.surrounds && dice.chance(0.45F);
  h.shutters = !h.hoods && dice.chance(0.15F) && h.pitch > 2 * h.window_w + 0.3F;
  h.courses = dice.chance(0.4F);
  h.shops = dice.chance(0.55F);
  h.balconies = dice.chance(0.28F);
  h.quoins = dice.chance(0.25F);
  return h;
}

// A house whose street wall starts at the pose's origin. `left_open`, `right_open`: a street runs along that side.
inline void build_house(Scene& scene, const Pose& p, float width, float depth, const HouseStyle& h, bool left_open,
                        bool right_open, Dice& dice) {
  build_facade(scene, p, width, h, true, dice);
  HouseStyle side = h;
  side.balconies = false;
  side.detail = h.detail == Detail::near ? Detail::middle : h.detail;
  const float top = h.height();
  // Side walls: seen along the side street, or above a lower neighbour.
  const Pose left{p.point({0, 0, -depth}), p.z, p.y, -p.x};
  const Pose right{p.point({width, 0, 0}), -p.z, p.y, p.x};
  const auto wall_of = [&](const Pose& q) {
    HouseStyle s = side;
    for (Brush* b : {&s.wall, &s.ground, &s.trim}) {
      Material m = scene.materials[b->material];
      m.frame = q;
      *b = b->with(scene.add(m));
    }
    return s;
  };
  if (left_open) {
    build_facade(scene, left, depth, wall_of(left), true, dice);
  } else {
    scene.panel_xy(left, 0, depth, 0, top, 0, wall_of(left).wall);
  }
  if (right_open) {
    build_facade(scene, right, depth, wall_of(right), true, dice);
  } else {
    scene.panel_xy(right, 0, depth, 0, top, 0, wall_of(right).wall);
  }
  const Pose back{p.point({width, 0, -depth}), -p.x, p.y, -p.z};
  scene.panel_xy(back, 0, width, 0, top, 0, side.wall);
  build_roof(scene, p, width, depth, h, dice);
  // Downpipe.
  scene.bar(p.point({0.12F, 0.2F, 0.1F}), p.point({0.12F, top, 0.1F}), 0.05F, 0.05F, 6, h.metal);
}

inline Detail detail_at(float s) { return s < 45 ? Detail::near : (s < 85 ? Detail::middle : Detail::far); }

// Row of houses along one side, from behind the camera to the end, leaving the side street free.
inline void build_row(Scene& scene, const Layout& l, int side) {
  const bool left = side < 0;
  const float facade_d = left ? l.facade_left() : l.facade_right();
  const bool gap = left ? l.side_left : l.side_right;
  const float gap0 = l.junction0 - 2.6F;
  const float gap1 = l.junction1 + 2.6F;
  const float last = l.end - 14;
  float s = -30;
  for (std::uint32_t i = 0; i < 40 && s < last; ++i) {
    Dice dice(l.seed, left ? Topic::building_left : Topic::building_right, i);
    float width = dice.uniform(9.5F, 18.5F);
    bool near_gap = false;
    bool after_gap = false;
    if (gap) {
      if (s < gap0 && s + width > gap0 - 6) {
        width = gap0 - s;
        near_gap = true;
      }
      if (std::fabs(s - gap1) < 0.01F) after_gap = true;
    }
    if (s + width > last - 6) width = last - s;
    const bool park = l.park_side == side && s > l.junction1 && s < l.junction1 + 30;
    if (park) {
      s = s + width > l.junction1 + 30 ? s + width : l.junction1 + 32;
      continue;
    }
    const float depth = dice.uniform(11, 14);
    const float setback = dice.chance(0.25F) ? dice.uniform(0.2F, 0.9F) : dice.uniform(0.0F, 0.08F);
    const float middle = s + 0.5F * width;
    const float d = facade_d + (left ? -setback : setback);
    const float turn = left ? 0.5F * kPi : -0.5F * kPi;
    // Facades run along a chord of the bend.
    const float start = left ? s + width : s;
    const float stop = left ? s : s + width;
    Pose p = upright(l.at(start, d, 0), turn);
    const Vec3f chord = normalized(l.at(stop, d, 0) - l.at(start, d, 0));
    p.x = chord;
    p.z = cross(p.x, p.y);
    const float length_m = length(l.at(stop, d, 0) - l.at(start, d, 0));
    HouseStyle h = make_style(scene, p, dice, detail_at(middle));
    // Seen from its front, a house on the left runs towards the camera.
    const bool open_far = near_gap;
    const bool open_near = after_gap;
    build_house(scene, p, length_m, depth, h, left ? open_far : open_near, left ? open_near : open_far, dice);
    s += width;
    if (near_gap) s = gap1;
  }
  // Houses along the side street, so that the gap does not end in nothing.
  if (gap) {
    const float turn = left ? 0.5F * kPi : -0.5F * kPi;
    const float sign = left ? -1.0F : 1.0F;
    for (std::uint32_t i = 0; i < 4; ++i) {
      for (int bank = 0; bank < 2; ++bank) {
        Dice dice(l.seed, left ? Topic::building_left : Topic::building_right,
                  60 + 2 * i + static_cast<std::uint32_t>(bank));
        const float width = 14;
        const float from = std::fabs(facade_d) + 15 + width * static_cast<float>(i);
        const bool far_bank = bank == 1;
        const float z = far_bank ? gap1 : gap0;
        // Far bank looks towards the camera (-z), the near one away from it.
        Pose p = upright({0, 0, z}, far_bank ? kPi : 0.0F);
        p.o.x = l.bend(l.junction0) + sign * from;
        // x of the pose must run along the wall with the house behind it.
        const float step = dot(p.x, Vec3f{sign, 0, 0});
        if (step < 0) p.o.x += sign * width;
        HouseStyle h = make_style(scene, p, dice, Detail::middle);
        build_house(scene, p, width, 11, h, false, false, dice);
      }
    }
    Dice dice(l.seed, left ? Topic::building_left : Topic::building_right, 90);
    Pose p = upright({l.bend(l.junction0) + sign * (std::fabs(facade_d) + 74), 0, l.junction0 - 12}, turn);
    if (left) p.o.z = l.junction1 + 12;
    HouseStyle h = make_style(scene, p, dice, Detail::middle);
    build_house(scene, p, l.junction1 - l.junction0 + 24, 11, h, false, false, dice);
  }
}

// What closes the street: three houses across it, the middle one taller and with a turret.
inline void build_end(Scene& scene, const Layout& l) {
  const Vec3f c = l.at(l.end, 0, 0);
  for (std::uint32_t i = 0; i < 5; ++i) {
    Dice dice(l.seed, Topic::building_left, 100 + i);
    const float width = 16;
    Pose p = upright({c.x + 16.0F * (static_cast<float>(i) - 1.5F), 0, c.z}, kPi);
    HouseStyle h = make_style(scene, p, dice, Detail::far);
    h.floors = 3 + dice.pick(3);
    build_house(scene, p, width, 14, h, false, false, dice);
  }
  Dice dice(l.seed, Topic::building_left, 120);
  const float x = c.x + dice.uniform(-14, 14);
  const float z = c.z + 26;
  Material stone;
  stone.kind = Kind::stone;
  stone.base = {0.33F, 0.29F, 0.24F};
  stone.frame = upright({x, 0, z}, kPi);
  Brush b;
  b.label = label::building;
  const Brush wall = b.with(scene.add(stone));
  const Brush copper = b.with(scene.add_plain({0.16F, 0.24F, 0.21F}, 0.7F));
  const float h = dice.uniform(30, 38);
  const Pose tower = upright({x, 0, z}, 0.3F);
  scene.box(tower, {-3.2F, 0, -3.2F}, {3.2F, h, 3.2F}, wall);
  scene.box(tower, {-3.5F, h, -3.5F}, {3.5F, h + 0.6F, 3.5F}, wall);
  const Vec3f tip = tower.point({0, h + 15, 0});
  for (int i = 0; i < 8; ++i) {
    const float a0 = 2 * kPi * static_cast<float>(i) / 8;
    const float a1 = 2 * kPi * static_cast<float>(i + 1) / 8;
    const Vec3f p0 = tower.point({3.1F * std::cos(a0), h + 0.6F, 3.1F * std::sin(a0)});
    const Vec3f p1 = tower.point({3.1F * std::cos(a1), h + 0.6F, 3.1F * std::sin(a1)});
    scene.triangle(p0, p1, tip, tower.direction({std::cos(0.5F * (a0 + a1)), 0.2F, std::sin(0.5F * (a0 + a1))}),
                   copper);
  }
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_BUILDING_HPP
