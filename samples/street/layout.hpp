// SPDX-License-Identifier: Apache-2.0
// The plan of the street: where kerbs, lanes, the junction and the crossings lie, and how the street bends.
//
// Street coordinates: s along the street, d to the right of the road's centre line. The bend is a shear in the world,
//   x = d + bend(s), z = s,   bend(s) = curvature * max(0, s - bend_start)^2,
// which inverts exactly; slopes stay below 0.3, so lengths across are true within a few per cent.
#ifndef NPSIM_SAMPLES_STREET_LAYOUT_HPP
#define NPSIM_SAMPLES_STREET_LAYOUT_HPP

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "dice.hpp"
#include "scene.hpp"

namespace npsim {
namespace street {

inline constexpr float kKerbHeight_m = 0.12F;
inline constexpr float kLane_m = 3.1F;

struct RoadPatch {
  float d0, d1, s0, s1, tone;
};

struct Layout {
  std::uint64_t seed = 0;
  float curvature = 0;
  float bend_start = 20;
  float kerb_left = -5.3F;  // d
  float kerb_right = 5.3F;
  float bay_left = -3.2F;  // inner edge of the parking strip; equal to the kerb where there is none
  float bay_right = 3.2F;
  float pavement_left = 3.0F;  // width, m
  float pavement_right = 3.0F;
  float junction0 = 26;  // s of the side street's kerbs
  float junction1 = 34;
  bool side_left = true;
  bool side_right = false;
  float zebra0 = 18;  // crossing in front of the junction
  float zebra1 = 21.5F;
  float end = 170;  // a building closes the street here
  float camera_d = 1.55F;
  float camera_height = 1.4F;
  float camera_yaw = 0;    // towards +x
  float camera_pitch = 0;  // down
  Vec3f sun{};             // unit, towards the sun, world
  float sun_strength = 1;
  float sun_radius = 0.0047F;  // rad; wider behind cloud
  float cloudiness = 0.5F;
  float haze = 0.5F;
  float wear = 0.5F;  // of the markings
  bool trees_left = true;
  bool trees_right = true;
  int dash_variant = 0;
  int park_side = 0;    // -1, 1: a small park instead of houses behind the junction, for 30 m
  float bay_phase = 0;  // where the painted parking bays begin
  std::array<RoadPatch, 9> patches{};
  std::array<Vec2f, 10> manholes{};

  [[nodiscard]] float bend(float s) const {
    const float t = s > bend_start ? s - bend_start : 0.0F;
    return curvature * t * t;
  }
  [[nodiscard]] float heading(float s) const {
    const float t = s > bend_start ? s - bend_start : 0.0F;
    return std::atan(2 * curvature * t);
  }
  [[nodiscard]] Vec3f at(float s, float d, float height) const { return {d + bend(s), height, s}; }
  // Upright at (s, d) with z along the street (turned by `turn`).
  [[nodiscard]] Pose pose(float s, float d, float height, float turn = 0) const {
    return upright(at(s, d, height), heading(s) + turn);
  }
  [[nodiscard]] float facade_left() const { return kerb_left - pavement_left; }
  [[nodiscard]] float facade_right() const { return kerb_right + pavement_right; }
};

inline Layout make_layout(std::uint64_t seed) {
  Dice dice(seed, Topic::layout, 0);
  Layout l;
  l.seed = seed;
  l.curvature = dice.sign();
  l.curvature *= dice.uniform(0.0007F, 0.0015F);
  l.bend_start = dice.uniform(8, 30);
  const bool bays_left = true;
  const bool bays_right = dice.chance(0.8F);
  l.bay_left = -kLane_m;
  l.bay_right = kLane_m;
  l.kerb_left = bays_left ? -kLane_m - 2.15F : -kLane_m - 0.3F;
  l.kerb_right = bays_right ? kLane_m + 2.15F : kLane_m + 0.3F;
  if (!bays_right) l.bay_right = l.kerb_right;
  l.pavement_left = dice.uniform(2.6F, 4.6F);
  l.pavement_right = dice.uniform(2.6F, 4.2F);
  l.junction0 = dice.uniform(17, 44);
  l.junction1 = l.junction0 + dice.uniform(7, 10);
  l.side_left = dice.chance(0.7F);
  l.side_right = !l.side_left || dice.chance(0.4F);
  l.zebra1 = l.junction0 - dice.uniform(1.2F, 2.4F);
  l.zebra0 = l.zebra1 - 3.4F;
  l.end = dice.uniform(130, 175);
  l.camera_d = dice.uniform(1.35F, 1.75F);
  l.camera_height = dice.uniform(1.3F, 1.5F);
  l.camera_yaw = dice.uniform(-0.045F, 0.035F);
  l.camera_pitch = dice.uniform(-0.012F, 0.03F);
  // The sun stands behind the camera or beside it, high enough to reach one side's facades and part of the road.
  const float sun_side = dice.sign();
  const float azimuth = sun_side * dice.uniform(0.35F, 1.15F);
  const float elevation = dice.uniform(0.62F, 0.95F);
  l.sun = normalized(
      Vec3f{std::sin(azimuth) * std::cos(elevation), std::sin(elevation), -std::cos(azimuth) * std::cos(elevation)});
  l.cloudiness = dice.uniform(0.2F, 0.75F);
  l.sun_strength = mix(1.1F, 0.75F, l.cloudiness);
  if (dice.chance(0.3F)) {  // overcast: hardly a shadow
    l.cloudiness = dice.uniform(0.88F, 1.0F);
    l.sun_strength = dice.uniform(0.05F, 0.2F);
    l.sun_radius = 0.06F;
  }
  l.haze = dice.uniform(0.3F, 1.0F);
  l.wear = dice.uniform(0.35F, 0.75F);
  l.trees_left = dice.chance(0.65F);
  l.trees_right = !l.trees_left || dice.chance(0.45F);
  l.dash_variant = dice.pick(2);
  if (dice.chance(0.45F)) l.park_side = dice.chance(0.5F) ? -1 : 1;
  l.bay_phase = dice.uniform(0, 5.6F);
  Dice road(seed, Topic::road, 0);
  for (std::size_t i = 0; i < l.patches.size(); ++i) {
    RoadPatch& p = l.patches[i];
    const bool trench = i < 2;
    p.s0 = road.uniform(-4, trench ? 25.0F : 60.0F);
    p.s1 = p.s0 + (trench ? road.uniform(14, 45) : road.uniform(0.8F, 4.5F));
    p.d0 = road.uniform(l.kerb_left, l.kerb_right - 1);
    p.d1 = p.d0 + (trench ? road.uniform(0.7F, 1.3F) : road.uniform(0.7F, 2.6F));
    p.tone = road.uniform(0.62F, 1.25F);
  }
  for (std::size_t i = 0; i < l.manholes.size(); ++i) {
    l.manholes[i] = {road.uniform(-2.8F, 2.8F), road.uniform(3, 20) + 9.0F * static_cast<float>(i)};
  }
  return l;
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_LAYOUT_HPP
