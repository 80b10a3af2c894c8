// SPDX-License-Identifier: Apache-2.0
// Puts a whole street together from its layout: ground, houses, vehicles, furniture, trees, people.
#ifndef NPSIM_SAMPLES_STREET_PLAN_HPP
#define NPSIM_SAMPLES_STREET_PLAN_HPP

#include <cmath>
#include <cstdint>

#include "building.hpp"
#include "bus.hpp"
#include "car.hpp"
#include "dice.hpp"
#include "furniture.hpp"
#include "ground.hpp"
#include "layout.hpp"
#include "nature.hpp"
#include "park.hpp"
#include "scene.hpp"

namespace npsim {
namespace street {

// Free of the junction and the crossings, for things that stand along the kerb.
inline bool clear_of_junction(const Layout& l, float s0, float s1) {
  return s1 < l.zebra0 - 1.5F || s0 > l.junction1 + 6.5F;
}

struct BusStop {
  bool ahead = true;  // in our direction, at the right kerb; otherwise coming towards us
  float s = 0;        // middle of the bus
};

inline BusStop bus_stop(const Layout& l) {
  Dice dice(l.seed, Topic::bus, 0);
  BusStop b;
  b.ahead = l.bay_right < l.kerb_right - 1 && dice.chance(0.6F);
  b.s = l.junction1 + (b.ahead ? dice.uniform(14, 20) : dice.uniform(10, 22));
  return b;
}

inline void build_parked_cars(Scene& scene, const Layout& l) {
  const BusStop stop = bus_stop(l);
  for (int side = -1; side <= 1; side += 2) {
    const bool left = side < 0;
    const float kerb = left ? l.kerb_left : l.kerb_right;
    const float bay = left ? l.bay_left : l.bay_right;
    if (std::fabs(kerb - bay) < 1.5F) continue;
    // 5.6 m bays, as painted; some are empty.
    for (int i = -4; i < 21; ++i) {
      Dice dice(l.seed, Topic::car, static_cast<std::uint32_t>(1000 * (side + 1) + i + 10));
      const float s = l.bay_phase + 5.6F * (static_cast<float>(i) + 0.5F) + dice.uniform(-0.35F, 0.35F);
      if (!clear_of_junction(l, s - 2.6F, s + 2.6F) || dice.chance(!left && s < 9 ? 0.6F : 0.2F)) continue;
      if (!left && stop.ahead && std::fabs(s - stop.s) < 14) continue;
      CarSpec spec;
      const int types[8] = {0, 0, 1, 2, 3, 5, 2, 4};
      spec.type = types[dice.pick(8)];
      if (!left && i <= 1 && spec.type == 4) spec.type = 0;  // a van this near would hide the whole side
      spec.colour = spec.type == 4 && dice.chance(0.6F) ? Vec3f{0.62F, 0.62F, 0.6F} : car_colour(dice);
      spec.level = s > 44 ? 2 : (s > 21 ? 1 : 0);
      const float half = 0.92F;
      const float d = kerb - static_cast<float>(side) * (half + dice.uniform(0.16F, 0.32F));
      // In a one-sided mood: most cars point with the traffic of their side.
      const bool against = dice.chance(left ? 0.12F : 0.05F);
      const float turn = (left != against ? kPi : 0.0F) + dice.uniform(-0.02F, 0.02F);
      build_car(scene, l.pose(s, d, 0, turn), spec, dice);
    }
  }
}

inline void build_traffic(Scene& scene, const Layout& l) {
  Dice dice(l.seed, Topic::car, 5000);
  const int types[6] = {0, 1, 2, 3, 0, 5};
  const auto moving = [&](float s0, float s1, float d, bool towards, float brakes) {
    const float s = dice.uniform(s0, s1);
    CarSpec spec;
    spec.type = types[dice.pick(6)];
    spec.colour = car_colour(dice);
    spec.moving = true;
    spec.braking = dice.chance(brakes);
    spec.level = s > 46 ? 2 : (s > 22 ? 1 : 0);
    const float off = dice.uniform(-0.2F, 0.25F);
    const float turn = (towards ? kPi : 0.0F) + dice.uniform(-0.015F, 0.015F);
    build_car(scene, l.pose(s, d + off, 0, turn), spec, dice);
  };
  const float lane = 0.5F * kLane_m;
  moving(10.5F, 22, lane, false, 0.5F);
  moving(12, 28, -lane, true, 0);
  const BusStop stop = bus_stop(l);
  if (stop.ahead) moving(40, 52, -lane, true, 0);
  moving(62, 72, -lane, true, 0);
  moving(48, 58, lane, false, 0);
  moving(75, 90, lane, false, 0);

  const Vec3f liveries[5] = {{0.42F, 0.035F, 0.03F},
                             {0.55F, 0.42F, 0.05F},
                             {0.05F, 0.12F, 0.30F},
                             {0.55F, 0.55F, 0.53F},
                             {0.08F, 0.25F, 0.12F}};
  Dice bus(l.seed, Topic::bus, 1);
  const float d = stop.ahead ? l.kerb_right - 1.6F : -lane - 0.15F;
  build_bus(scene, l.pose(stop.s, d, 0, stop.ahead ? -0.01F : kPi), liveries[bus.pick(5)], bus);
}

// The rows of lamps go on behind the camera, where a photograph does not show them. Their dice are their own.
struct LampRow {
  float first_s = 0;  // of the row ahead
  float gap0 = 0, gap1 = 0;
};

template <class Build>
inline void build_row_behind(const LampRow& row, Dice& dice, const Build& build) {
  for (float s = row.first_s - dice.uniform(row.gap0, row.gap1); s > -45; s -= dice.uniform(row.gap0, row.gap1)) {
    build(s, dice);
  }
}

inline void build_furniture(Scene& scene, const Layout& l) {
  const FurniturePaints f = make_furniture_paints(scene);
  Dice dice(l.seed, Topic::furniture, 0);
  const float h = kKerbHeight_m;
  const auto facing_us = kPi;
  // Lamps: tall ones over the road on one side, lanterns on the other.
  const int tall_side = dice.chance(0.5F) ? 1 : -1;
  const float tall_kerb = tall_side > 0 ? l.kerb_right : l.kerb_left;
  const float low_kerb = tall_side > 0 ? l.kerb_left : l.kerb_right;
  const float tall_height = dice.uniform(7.2F, 8.6F);
  const auto tall_lamp = [&](float s, Dice& of) {
    build_tall_lamp(
        scene, f,
        l.pose(s, tall_kerb + 0.45F * static_cast<float>(tall_side), h, -0.5F * kPi * static_cast<float>(tall_side)),
        tall_height, of.uniform(1.6F, 2.4F));
  };
  const auto lantern = [&](float s, Dice& of) {
    build_lantern(scene, f, l.pose(s, low_kerb - 0.6F * static_cast<float>(tall_side), h), of.uniform(3.7F, 4.0F));
  };
  float s = dice.uniform(6, 13);
  const LampRow tall_row{s, 21, 27};
  for (; s < l.end - 20; s += dice.uniform(21, 27)) {
    if (s > l.junction0 - 1 && s < l.junction1 + 1) continue;
    tall_lamp(s, dice);
  }
  s = dice.uniform(9, 15);
  const LampRow low_row{s, 15, 21};
  for (; s < l.end - 30; s += dice.uniform(15, 21)) {
    if (s > l.junction0 - 3 && s < l.junction1 + 3) continue;
    lantern(s, dice);
  }
  Dice behind(l.seed, Topic::furniture, 1);
  build_row_behind(tall_row, behind, tall_lamp);
  build_row_behind(low_row, behind, lantern);
  // Traffic lights before the junction: ours, theirs, and those of the side street.
  const SignalState mine = dice.chance(0.5F) ? SignalState::red : SignalState::green;
  const float stop_line = l.zebra0 - 0.6F;
  build_traffic_light(scene, f, l.pose(stop_line, l.kerb_right + 0.45F, h, facing_us), mine,
                      dice.chance(0.6F) ? 3.4F : 0.0F, 11);
  build_traffic_light(scene, f, l.pose(l.junction1 + 1.0F, l.kerb_left - 0.5F, h, facing_us), mine, 0, 12);
  build_traffic_light(scene, f, l.pose(l.junction1 + 5.2F, l.kerb_left - 0.45F, h, 0), mine, 0, 13);
  const SignalState cross_state = mine == SignalState::red ? SignalState::green : SignalState::red;
  if (l.side_left) {
    build_traffic_light(scene, f, l.pose(l.junction0 + 0.2F, l.kerb_left - 4.6F, h, -0.5F * kPi), cross_state, 0, 14);
  }
  if (l.side_right) {
    build_traffic_light(scene, f, l.pose(l.junction1 - 0.2F, l.kerb_right + 4.6F, h, 0.5F * kPi), cross_state, 0, 15);
  }
  // Signs.
  build_sign(scene, f, l.pose(l.zebra0 - 0.4F, l.kerb_left - 0.4F, h, facing_us), 2, 2.45F, true);
  const int near_signs[5] = {0, 3, 5, 6, 4};
  const bool sign_right = dice.chance(0.6F);
  const float sign_s = dice.uniform(8.0F, 14.0F);
  build_sign(scene, f, l.pose(sign_s, sign_right ? l.kerb_right + 0.4F : l.kerb_left - 0.4F, h, facing_us),
             near_signs[dice.pick(5)], 2.5F, true);
  const Pose pair = l.pose(l.junction1 + dice.uniform(3, 5), l.kerb_right + 0.4F, h, facing_us);
  build_sign(scene, f, pair, 0, 2.75F, true);
  build_sign(scene, f, pair, 3, 2.08F, false);
  if (l.side_left) build_sign(scene, f, l.pose(l.junction1 + 0.7F, l.kerb_left - 3.9F, h, facing_us), 1, 2.3F, true);
  const Pose board = l.pose(l.junction0 - 0.9F, l.kerb_right + 1.0F, h, facing_us);
  build_sign(scene, f, board, 7, 2.9F, true);
  for (int i = 0; i < 5; ++i) {
    const float s_far = dice.uniform(50, 110);
    build_sign(scene, f, l.pose(s_far, i % 2 == 0 ? l.kerb_right + 0.4F : l.kerb_left - 0.4F, h, facing_us),
               near_signs[dice.pick(5)], 2.4F, true);
  }
  // Bollards round the corners, bins, posters, clock, boxes.
  for (int side = -1; side <= 1; side += 2) {
    if (side < 0 ? !l.side_left : !l.side_right) continue;
    const float kerb = side < 0 ? l.kerb_left : l.kerb_right;
    const float sg = static_cast<float>(side);
    for (int i = 0; i < 4; ++i) {
      const float a = 0.5F * kPi * (static_cast<float>(i) + 0.5F) / 4;
      const float r = 3.6F;
      build_bollard(scene, f, l.pose(l.junction0 - 4 + r * std::sin(a), kerb + sg * (4 - r * std::cos(a)), h));
      build_bollard(scene, f, l.pose(l.junction1 + 4 - r * std::sin(a), kerb + sg * (4 - r * std::cos(a)), h));
    }
  }
  for (int i = 0; i < 6; ++i) {
    const bool left = dice.chance(0.5F);
    float at = dice.uniform(8, 60);
    if (at > l.junction0 - 3 && at < l.junction1 + 3) at = l.junction1 + 5;
    build_bin(scene, f, l.pose(at, left ? l.kerb_left - 0.7F : l.kerb_right + 0.7F, h),
              dice.chance(0.5F) ? Vec3f{0.5F, 0.2F, 0.02F} : Vec3f{0.12F, 0.14F, 0.13F});
  }
  const bool left_poster = dice.chance(0.5F);
  build_poster(scene, f,
               l.pose(dice.uniform(9.5F, 16.5F), left_poster ? l.kerb_left - 0.95F : l.kerb_right + 0.95F, h,
                      facing_us + (left_poster ? -0.12F : 0.12F)),
               dice);
  build_poster(
      scene, f,
      l.pose(l.junction1 + dice.uniform(9, 14), left_poster ? l.kerb_right + 0.9F : l.kerb_left - 0.9F, h, facing_us),
      dice);
  const float clock_s = l.junction1 + dice.uniform(2.2F, 4);
  build_clock(scene, f, l.pose(clock_s, left_poster ? l.kerb_right + 1.3F : l.kerb_left - 1.4F, h, facing_us),
              dice.bits());
  const BusStop stop = bus_stop(l);
  if (stop.ahead) {
    build_shelter(scene, f, l.pose(stop.s - 1.0F, l.kerb_right + 1.6F, h, -0.5F * kPi), dice);
  } else {
    build_shelter(scene, f, l.pose(stop.s + 1.0F, l.kerb_left - 1.6F, h, 0.5F * kPi), dice);
  }
  for (int i = 0; i < 2; ++i) {  // grey service boxes against the wall
    const float at = dice.uniform(7, 18) + 40.0F * static_cast<float>(i);
    const bool left = dice.chance(0.5F);
    const Pose p =
        l.pose(at, left ? l.facade_left() + 0.3F : l.facade_right() - 0.3F, h, left ? 0.5F * kPi : -0.5F * kPi);
    scene.box(p, {-0.55F, 0, -0.2F}, {0.55F, 1.25F, 0.22F}, f.box);
    scene.box(p, {-0.58F, 1.25F, -0.23F}, {0.58F, 1.3F, 0.26F}, f.box);
  }
}

inline void build_greenery(Scene& scene, const Layout& l) {
  Dice dice(l.seed, Topic::tree, 900);
  const float h = kKerbHeight_m;
  Material soil;
  soil.kind = Kind::grass;
  soil.base = {0.075F, 0.06F, 0.04F};
  soil.second = {0.09F, 0.11F, 0.04F};
  soil.seed = dice.bits();
  Brush pit;
  pit.label = label::terrain;
  pit.material = scene.add(soil);
  std::uint32_t index = 0;
  for (int side = -1; side <= 1; side += 2) {
    const bool row = side < 0 ? l.trees_left : l.trees_right;
    const float kerb = side < 0 ? l.kerb_left : l.kerb_right;
    const float sg = static_cast<float>(side);
    float s = dice.uniform(8, 16);
    for (; s < l.end - 18; s += row ? dice.uniform(9, 14) : dice.uniform(34, 60)) {
      ++index;
      const float height = dice.uniform(6.2F, 9.8F);
      const float spread = height * dice.uniform(0.28F, 0.38F);
      if (s > l.zebra0 - 4 && s < l.junction1 + 6) continue;
      const float d = kerb + sg * 0.95F;
      const Pose p = l.pose(s, d, h, dice.uniform(0, 6));
      build_tree(scene, p, height, spread, s < 24 ? 300 : (s < 50 ? 120 : (s < 90 ? 70 : 40)), l.seed, index);
      const Pose q = l.pose(s, d, h + 0.006F);
      scene.quad(q.point({-0.6F, 0, -0.7F}), q.point({0.6F, 0, -0.7F}), q.point({0.6F, 0, 0.7F}),
                 q.point({-0.6F, 0, 0.7F}), {0, 1, 0}, pit);
    }
  }
  // Trees behind the end of the street and down the side street, so that the view does not end in walls only.
  for (int i = 0; i < 4; ++i) {
    const float d = -24.0F + 15.0F * static_cast<float>(i) + dice.uniform(-3, 3);
    build_tree(scene, l.pose(l.end - 2, d, h), dice.uniform(8, 12), 4, 45, l.seed, 200 + static_cast<std::uint32_t>(i));
  }
  for (int i = 0; i < 3; ++i) {
    const float sg = l.side_left ? -1.0F : 1.0F;
    build_tree(scene, Pose{{l.bend(l.junction0) + sg * (22 + 11.0F * static_cast<float>(i)), h, l.junction1 + 1.2F}},
               dice.uniform(6, 8), 2.4F, 80, l.seed, 220 + static_cast<std::uint32_t>(i));
  }
  if (dice.chance(0.6F)) {
    const bool left = dice.chance(0.5F);
    build_hedge(scene, l.pose(l.junction1 + 8, left ? l.facade_left() + 0.35F : l.facade_right() - 0.35F, h),
                dice.uniform(5, 8), 1.0F, l.seed, 240);
  }
}

inline void build_people(Scene& scene, const Layout& l) {
  const auto walker = [&](const Pose& pose, bool fine, Dice& dice) {
    const float height = dice.uniform(1.56F, 1.9F);
    const float stride = dice.uniform(-1, 1);
    build_walker(scene, pose, height, stride, fine, dice);
  };
  const float h = kKerbHeight_m;
  for (std::uint32_t i = 0; i < 15; ++i) {
    Dice dice(l.seed, Topic::person, i);
    const bool left = dice.chance(0.5F);
    const float width = left ? l.pavement_left : l.pavement_right;
    const float out = dice.uniform(1.3F, width - 0.6F);
    const float d = left ? l.kerb_left - out : l.kerb_right + out;
    float s = 9.0F + 4.2F * static_cast<float>(i) + dice.uniform(-2, 2);
    if (s > l.junction0 - 2 && s < l.junction1 + 2) s += 14;
    const bool away = dice.chance(0.5F);
    const float turn = (away ? 0.0F : kPi) + dice.uniform(-0.3F, 0.3F);
    walker(l.pose(s, d, h, turn), s < 26, dice);
    if (dice.chance(0.3F)) walker(l.pose(s + 0.25F, d + (left ? -0.62F : 0.62F), h, turn), s < 26, dice);
  }
  // Somebody waits at the crossing, somebody crosses behind it.
  Dice dice(l.seed, Topic::person, 100);
  const float side = dice.chance(0.5F) ? 1.0F : -1.0F;
  build_walker(scene,
               l.pose(l.zebra0 + 1.2F, side > 0 ? l.kerb_right + 0.5F : l.kerb_left - 0.5F, h, -side * 0.5F * kPi),
               1.74F, 0.1F, true, dice);
  const Pose crossing = l.pose(l.junction1 + 2.8F, dice.uniform(-4.4F, -2.8F), 0, 0.5F * kPi);
  build_walker(scene, crossing, 1.7F, 0.9F, true, dice);
  Dice cyclist(l.seed, Topic::person, 200);
  if (cyclist.chance(0.65F)) {
    const bool towards = cyclist.chance(0.35F);
    const float d = towards ? l.bay_left + cyclist.uniform(0.1F, 0.4F) : l.bay_right - cyclist.uniform(0.1F, 0.4F);
    const float s = cyclist.uniform(8.5F, 24.0F);
    const float turn = (towards ? kPi : 0.0F) + cyclist.uniform(-0.05F, 0.05F);
    build_bicycle(scene, l.pose(s, d, 0, turn), true, cyclist);
  }
  for (int i = 0; i < 4; ++i) {
    const bool left = cyclist.chance(0.5F);
    float s = 7 + 12.0F * static_cast<float>(i) + cyclist.uniform(0, 5);
    if (s > l.junction0 - 3 && s < l.junction1 + 3) s = l.junction1 + 9;
    build_bicycle(scene,
                  l.pose(s, left ? l.facade_left() + 0.5F : l.facade_right() - 0.5F, h, cyclist.uniform(-0.2F, 0.2F)),
                  false, cyclist);
  }
}

inline Scene build_scene(const Layout& l) {
  Scene scene;
  build_road(scene, l);
  build_pavements(scene, l);
  build_row(scene, l, -1);
  build_row(scene, l, 1);
  build_end(scene, l);
  build_parked_cars(scene, l);
  build_traffic(scene, l);
  build_furniture(scene, l);
  build_greenery(scene, l);
  build_park(scene, l);
  build_people(scene, l);
  return scene;
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_PLAN_HPP
