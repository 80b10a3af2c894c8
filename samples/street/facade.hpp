// SPDX-License-Identifier: Apache-2.0
// One wall of a building, with recessed windows, sills, surrounds, doors, shop fronts, balconies and cornices.
//
// Frame of a wall: origin at its lower left corner, x along, y up, z out. Windows of one floor form a windows_group.
#ifndef NPSIM_SAMPLES_STREET_FACADE_HPP
#define NPSIM_SAMPLES_STREET_FACADE_HPP

#include <cmath>
#include <cstdint>

#include "dice.hpp"
#include "layout.hpp"
#include "scene.hpp"

namespace npsim {
namespace street {

enum class Detail : std::uint8_t { near, middle, far };

// What all walls of one building share.
struct HouseStyle {
  Brush wall, ground, trim, frame, roof, metal;
  int floors = 4;  // above the ground floor
  float floor_h = 3.2F;
  float ground_h = 3.9F;
  float window_w = 1.15F;
  float window_h = 1.75F;
  float pitch = 2.4F;
  float sill_h = 0.85F;
  float recess = 0.18F;
  int glazing = 0;  // 0: cross bar, 1: two casements, 2: plain
  bool surrounds = false;
  bool hoods = false;  // small cornice above each window
  bool shutters = false;
  bool courses = false;  // string course between the floors
  bool shops = false;
  bool balconies = false;
  bool quoins = false;
  Vec3f accent{0.3F, 0.1F, 0.08F};
  Detail detail = Detail::near;
  [[nodiscard]] float height() const { return ground_h + floor_h * static_cast<float>(floors); }
};

// A rectangle [x0, x1] x [y0, y1] of the wall plane, left open.
struct Opening {
  float x0, x1, y0, y1;
};

inline void build_reveal(Scene& scene, const Pose& p, const Opening& o, float depth, const Brush& brush) {
  const auto at = [&](float x, float y, float z) { return p.point({x, y, z}); };
  scene.quad(at(o.x0, o.y0, 0), at(o.x0, o.y1, 0), at(o.x0, o.y1, -depth), at(o.x0, o.y0, -depth), p.x, brush);
  scene.quad(at(o.x1, o.y0, 0), at(o.x1, o.y1, 0), at(o.x1, o.y1, -depth), at(o.x1, o.y0, -depth), -p.x, brush);
  scene.quad(at(o.x0, o.y1, 0), at(o.x1, o.y1, 0), at(o.x1, o.y1, -depth), at(o.x0, o.y1, -depth), -p.y, brush);
  scene.quad(at(o.x0, o.y0, 0), at(o.x1, o.y0, 0), at(o.x1, o.y0, -depth), at(o.x0, o.y0, -depth), p.y, brush);
}

inline std::uint16_t add_pane(Scene& scene, Kind kind, const Pose& p, const Opening& o, float depth, Dice& dice,
                              const Vec3f& tint) {
  Material m;
  m.kind = kind;
  m.frame = p.moved({o.x0, o.y0, -depth});
  m.size = {o.x1 - o.x0, o.y1 - o.y0};
  m.seed = dice.bits();
  m.variant = dice.pick(64);
  m.base = tint;
  m.roughness = 0.05F;
  return scene.add(m);
}

// Glass and frame of one window in its opening.
inline void build_glazing(Scene& scene, const Pose& p, const Opening& o, const HouseStyle& h, std::uint16_t light,
                          Dice& dice) {
  const float z = -h.recess;
  const std::uint16_t glass =
      add_pane(scene, Kind::pane, p, o, h.recess, dice, {dice.uniform(), dice.uniform(), dice.uniform()});
  scene.panel_xy(p, o.x0, o.x1, o.y0, o.y1, z, h.wall.lit(glass, light));
  if (h.detail == Detail::far) return;
  const float w = 0.07F;
  const float f = z + 0.04F;
  const Brush& b = h.frame;
  const auto bar = [&](float x0, float x1, float y0, float y1) {
    if (h.detail == Detail::near) {
      scene.box(p, {x0, y0, z + 0.002F}, {x1, y1, f}, b);
    } else {
      scene.panel_xy(p, x0, x1, y0, y1, f, b);
    }
  };
  bar(o.x0, o.x0 + w, o.y0, o.y1);
  bar(o.x1 - w, o.x1, o.y0, o.y1);
  bar(o.x0 + w, o.x1 - w, o.y0, o.y0 + w);
  bar(o.x0 + w, o.x1 - w, o.y1 - w, o.y1);
  const float mx = 0.5F * (o.x0 + o.x1);
  const float my = o.y0 + 0.68F * (o.y1 - o.y0);
  if (h.glazing <= 1) bar(mx - 0.04F, mx + 0.04F, o.y0 + w, h.glazing == 0 ? my : o.y1 - w);
  if (h.glazing == 0) bar(o.x0 + w, o.x1 - w, my - 0.035F, my + 0.035F);
}

inline void build_window(Scene& scene, const Pose& p, const Opening& o, const HouseStyle& h, std::uint16_t light,
                         bool balcony, Dice& dice) {
  build_reveal(scene, p, o, h.recess, h.surrounds ? h.trim : h.wall);
  build_glazing(scene, p, o, h, light, dice);
  if (h.detail == Detail::far) return;
  if (!balcony) scene.box(p, {o.x0 - 0.08F, o.y0 - 0.07F, -h.recess}, {o.x1 + 0.08F, o.y0, 0.09F}, h.trim);
  if (h.surrounds) {
    const float t = 0.14F;
    scene.box(p, {o.x0 - t, o.y0, 0}, {o.x0, o.y1 + t, 0.045F}, h.trim);
    scene.box(p, {o.x1, o.y0, 0}, {o.x1 + t, o.y1 + t, 0.045F}, h.trim);
    scene.box(p, {o.x0, o.y1, 0}, {o.x1, o.y1 + t, 0.045F}, h.trim);
  }
  if (h.hoods) {
    scene.box(p, {o.x0 - 0.22F, o.y1 + 0.2F, 0}, {o.x1 + 0.22F, o.y1 + 0.28F, 0.17F}, h.trim);
    scene.box(p, {o.x0 - 0.16F, o.y1 + 0.13F, 0}, {o.x1 + 0.16F, o.y1 + 0.2F, 0.09F}, h.trim);
  }
  if (h.shutters && !balcony) {
    const float w = 0.5F * (o.x1 - o.x0);
    const float t = h.surrounds ? 0.15F : 0.02F;
    scene.box(p, {o.x0 - t - w, o.y0, 0.005F}, {o.x0 - t, o.y1, 0.05F}, h.metal);
    scene.box(p, {o.x1 + t, o.y0, 0.005F}, {o.x1 + t + w, o.y1, 0.05F}, h.metal);
  }
  if (balcony) {
    const float x0 = o.x0 - 0.45F;
    const float x1 = o.x1 + 0.45F;
    const float d = 0.95F;
    scene.box(p, {x0, o.y0 - 0.2F, 0}, {x1, o.y0 - 0.04F, d}, h.trim);
    const float top = o.y0 + 0.95F;
    scene.box(p, {x0, top - 0.05F, d - 0.05F}, {x1, top, d}, h.metal);
    scene.box(p, {x0, top - 0.05F, 0}, {x0 + 0.05F, top, d}, h.metal);
    scene.box(p, {x1 - 0.05F, top - 0.05F, 0}, {x1, top, d}, h.metal);
    const int bars = h.detail == Detail::near ? 14 : 7;
    for (int i = 0; i <= bars; ++i) {
      const float x = x0 + (x1 - x0 - 0.025F) * static_cast<float>(i) / static_cast<float>(bars);
      scene.box(p, {x, o.y0 - 0.04F, d - 0.04F}, {x + 0.025F, top - 0.05F, d - 0.015F}, h.metal);
    }
  }
}

// Wall between y0 and y1 with `n` equal openings, `opening(i)` giving each.
template <class F>
void build_wall_row(Scene& scene, const Pose& p, float width, float y0, float y1, int n, const F& opening,
                    const Brush& wall) {
  float x = 0;
  for (int i = 0; i < n; ++i) {
    const Opening o = opening(i);
    scene.panel_xy(p, x, o.x0, y0, y1, 0, wall);
    scene.panel_xy(p, o.x0, o.x1, y0, o.y0, 0, wall);
    scene.panel_xy(p, o.x0, o.x1, o.y1, y1, 0, wall);
    x = o.x1;
  }
  scene.panel_xy(p, x, width, y0, y1, 0, wall);
}

inline void build_shop(Scene& scene, const Pose& p, float x0, float x1, const HouseStyle& h, std::uint16_t group,
                       Dice& dice) {
  const float head = h.ground_h - 0.95F;
  const float depth = 0.28F;
  const float y0 = kKerbHeight_m;
  const Vec3f inside{dice.uniform(0.2F, 0.6F), dice.uniform(0.2F, 0.5F), dice.uniform(0.15F, 0.45F)};
  const Opening all{x0, x1, y0, head};
  build_reveal(scene, p, all, depth, h.ground);
  const float door_w = 1.05F;
  const bool door_left = dice.chance(0.5F);
  const float door0 = door_left ? x0 : x1 - door_w;
  const auto glass = [&](float a, float b, float low, std::uint16_t light) {
    const Opening o{a, b, low, head};
    const std::uint16_t m = add_pane(scene, Kind::shop_pane, p, o, depth, dice, inside);
    scene.panel_xy(p, a, b, low, head, -depth, h.ground.lit(m, light));
    if (h.detail == Detail::far) return;
    const float w = 0.06F;
    scene.box(p, {a, low, -depth}, {a + w, head, -depth + 0.07F}, h.metal);
    scene.box(p, {b - w, low, -depth}, {b, head, -depth + 0.07F}, h.metal);
    scene.box(p, {a, head - w, -depth}, {b, head, -depth + 0.07F}, h.metal);
    scene.box(p, {a, low, -depth}, {b, low + w, -depth + 0.07F}, h.metal);
  };
  const float a = door_left ? door0 + door_w : x0;
  const float b = door_left ? x1 : door0;
  const float plinth = y0 + dice.uniform(0.2F, 0.6F);
  scene.panel_xy(p, a, b, y0, plinth, -depth + 0.05F, h.ground);
  scene.quad(p.point({a, plinth, -depth}), p.point({b, plinth, -depth}), p.point({b, plinth, -depth + 0.05F}),
             p.point({a, plinth, -depth + 0.05F}), p.y, h.ground);
  glass(a, b, plinth, scene.add_light(LightClass::window_building, group));
  glass(door0, door0 + door_w, y0, scene.add_light(LightClass::window_building, group));
  // The board with the name, lit at night.
  Material board;
  board.kind = Kind::lettering;
  const Vec3f fields[6] = {{0.5F, 0.04F, 0.03F},  {0.03F, 0.12F, 0.25F}, {0.6F, 0.57F, 0.5F},
                           {0.03F, 0.14F, 0.07F}, {0.05F, 0.05F, 0.05F}, {0.6F, 0.38F, 0.04F}};
  const int f = dice.pick(6);
  board.base = fields[f];
  board.second = f == 2 || f == 5 ? Vec3f{0.06F, 0.04F, 0.04F} : Vec3f{0.68F, 0.66F, 0.6F};
  board.variant = dice.pick(16);
  board.roughness = 0.4F;
  const float s0 = x0 + 0.1F;
  const float s1 = x1 - 0.1F;
  const float b0 = head + 0.12F;
  const float b1 = head + 0.68F;
  board.size = {s1 - s0, b1 - b0};
  board.frame = p.moved({0.5F * (s0 + s1), 0.5F * (b0 + b1), 0.12F});
  const std::uint16_t m = scene.add(board);
  scene.box(p, {s0, b0, 0}, {s1, b1, 0.1F}, h.metal);
  scene.panel_xy(p, s0, s1, b0, b1, 0.12F, h.ground.lit(m, scene.add_light(LightClass::advertisement)));
  if (dice.chance(0.45F)) {
    Material cloth;
    cloth.kind = Kind::awning;
    cloth.base = fields[dice.pick(6)] * 0.9F;
    cloth.second = {0.55F, 0.53F, 0.48F};
    cloth.variant = dice.pick(2);
    cloth.roughness = 0.9F;
    cloth.frame = p;
    const Brush b_cloth = h.ground.with(scene.add(cloth));
    const float out = dice.uniform(0.9F, 1.5F);
    const float low = head - 0.42F;
    scene.quad(p.point({x0, head + 0.08F, 0.02F}), p.point({x1, head + 0.08F, 0.02F}), p.point({x1, low, out}),
               p.point({x0, low, out}), p.direction({0, 1, 0.5F}), b_cloth);
    scene.panel_xy(p, x0, x1, low - 0.2F, low, out, b_cloth);
  }
  // A sign that sticks out over the pavement.
  if (dice.chance(0.5F)) {
    Material side;
    side.kind = Kind::poster;
    side.base = fields[dice.pick(6)];
    side.second = fields[dice.pick(6)];
    side.variant = dice.pick(2);
    side.seed = dice.bits();
    side.roughness = 0.4F;
    side.size = {0.7F, 0.8F};
    const float x = dice.chance(0.5F) ? x0 : x1;
    const float y = h.ground_h + 0.1F;
    // Readable from both ends of the street.
    side.frame = Pose{p.point({x, y, 0.6F}), -p.z, p.y, p.x};
    const std::uint16_t light = scene.add_light(LightClass::advertisement);
    scene.box(p, {x - 0.09F, y - 0.4F, 0.2F}, {x + 0.09F, y + 0.4F, 1.0F}, h.ground.lit(scene.add(side), light));
  }
}

inline void build_ground_floor(Scene& scene, const Pose& p, float width, const HouseStyle& h, bool shops, Dice& dice) {
  const float y0 = 0;
  const float y1 = h.ground_h;
  if (shops && width > 5) {
    const int n = static_cast<int>(width / 4.6F) > 0 ? static_cast<int>(width / 4.6F) : 1;
    const float bay = width / static_cast<float>(n);
    const auto opening = [&](int i) {
      const float left = bay * static_cast<float>(i);
      return Opening{left + 0.35F, left + bay - 0.35F, kKerbHeight_m, h.ground_h - 0.95F};
    };
    build_wall_row(scene, p, width, y0, y1, n, opening, h.ground);
    const std::uint16_t group = scene.add_group(LightClass::windows_group);
    for (int i = 0; i < n; ++i) {
      const Opening o = opening(i);
      build_shop(scene, p, o.x0, o.x1, h, group, dice);
    }
    return;
  }
  const int n = static_cast<int>((width - 0.4F) / h.pitch) > 0 ? static_cast<int>((width - 0.4F) / h.pitch) : 1;
  const float margin = 0.5F * (width - static_cast<float>(n) * h.pitch);
  const int door = dice.pick(n);
  const auto opening = [&](int i) {
    const float c = margin + (static_cast<float>(i) + 0.5F) * h.pitch;
    if (i == door) return Opening{c - 0.6F, c + 0.6F, kKerbHeight_m, kKerbHeight_m + 2.75F};
    return Opening{c - 0.5F * h.window_w, c + 0.5F * h.window_w, 1.35F, 1.35F + h.window_h * 0.95F};
  };
  build_wall_row(scene, p, width, y0, y1, n, opening, h.ground);
  scene.box(p, {0, 0, 0}, {opening(door).x0 - 0.18F, 0.75F, 0.05F}, h.trim);
  scene.box(p, {opening(door).x1 + 0.18F, 0, 0}, {width, 0.75F, 0.05F}, h.trim);
  const std::uint16_t group = scene.add_group(LightClass::windows_group);
  for (int i = 0; i < n; ++i) {
    const Opening o = opening(i);
    if (i != door) {
      build_window(scene, p, o, h, scene.add_light(LightClass::window_building, group), false, dice);
      continue;
    }
    build_reveal(scene, p, o, 0.35F, h.trim);
    Material m;
    m.kind = Kind::door;
    m.base = h.accent;
    m.size = {o.x1 - o.x0, o.y1 - o.y0};
    m.frame = p.moved({o.x0, o.y0, -0.35F});
    m.roughness = 0.5F;
    m.seed = dice.bits();
    scene.panel_xy(p, o.x0, o.x1, o.y0, o.y1, -0.35F, h.ground.with(scene.add(m)));
    scene.box(p, {o.x0 - 0.18F, o.y1, 0}, {o.x1 + 0.18F, o.y1 + 0.16F, 0.16F}, h.trim);
    scene.box(p, {o.x0, kKerbHeight_m, -0.34F}, {o.x1, kKerbHeight_m + 0.14F, 0.22F}, h.trim);
  }
}

// A whole wall. `street_side`: shops, door and cornice; otherwise windows only.
inline void build_facade(Scene& scene, const Pose& p, float width, const HouseStyle& h, bool street_side, Dice& dice) {
  build_ground_floor(scene, p, width, h, street_side && h.shops, dice);
  const int n = static_cast<int>((width - 0.4F) / h.pitch) > 0 ? static_cast<int>((width - 0.4F) / h.pitch) : 1;
  const float margin = 0.5F * (width - static_cast<float>(n) * h.pitch);
  const int balcony_first = dice.pick(n);
  for (int f = 0; f < h.floors; ++f) {
    const float y0 = h.ground_h + h.floor_h * static_cast<float>(f);
    const float y1 = y0 + h.floor_h;
    const auto is_balcony = [&](int i) { return h.balconies && street_side && (i + balcony_first) % 3 == 0; };
    const auto opening = [&](int i) {
      const float c = margin + (static_cast<float>(i) + 0.5F) * h.pitch;
      const float low = is_balcony(i) ? y0 + 0.12F : y0 + h.sill_h;
      const float top = f == h.floors - 1 && h.hoods ? 0.85F : 1.0F;
      return Opening{c - 0.5F * h.window_w, c + 0.5F * h.window_w, low, y0 + h.sill_h + h.window_h * top};
    };
    build_wall_row(scene, p, width, y0, y1, n, opening, h.wall);
    const std::uint16_t group = scene.add_group(LightClass::windows_group);
    for (int i = 0; i < n; ++i) {
      build_window(scene, p, opening(i), h, scene.add_light(LightClass::window_building, group), is_balcony(i), dice);
    }
    if (h.courses) scene.box(p, {0, y0 - 0.12F, 0}, {width, y0 + 0.06F, 0.09F}, h.trim);
  }
  if (!h.courses) scene.box(p, {0, h.ground_h - 0.14F, 0}, {width, h.ground_h, 0.12F}, h.trim);
  const float top = h.height();
  scene.box(p, {0, top - 0.45F, 0}, {width, top - 0.25F, 0.12F}, h.trim);
  scene.box(p, {0, top - 0.25F, 0}, {width, top - 0.1F, 0.26F}, h.trim);
  scene.box(p, {0, top - 0.1F, 0}, {width, top + 0.06F, 0.42F}, h.trim);
  if (h.quoins && h.detail != Detail::far) {
    for (float y = h.ground_h; y < top - 0.9F; y += 0.7F) {
      scene.box(p, {0, y, 0}, {0.55F, y + 0.36F, 0.04F}, h.trim);
      scene.box(p, {width - 0.55F, y, 0}, {width, y + 0.36F, 0.04F}, h.trim);
    }
  }
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_FACADE_HPP
