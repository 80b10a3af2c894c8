// SPDX-License-Identifier: Apache-2.0
// A small park where a few houses are left out: lawn, trees, hedge or railing, and the backs of houses beyond.
#ifndef NPSIM_SAMPLES_STREET_PARK_HPP
#define NPSIM_SAMPLES_STREET_PARK_HPP

#include <cmath>
#include <cstdint>

#include "building.hpp"
#include "dice.hpp"
#include "layout.hpp"
#include "nature.hpp"
#include "scene.hpp"

namespace npsim {
namespace street {

// Lawn, trees and a railing where a few houses are left out, with the backs of other houses beyond.
inline void build_park(Scene& scene, const Layout& l) {
  if (l.park_side == 0) return;
  const bool left = l.park_side < 0;
  const float sg = static_cast<float>(l.park_side);
  const float edge = left ? l.facade_left() : l.facade_right();
  const bool gap = left ? l.side_left : l.side_right;
  const float s0 = l.junction1 + (gap ? 2.8F : 0.0F);
  const float s1 = l.junction1 + 31;
  Dice dice(l.seed, Topic::tree, 950);
  Material grass;
  grass.kind = Kind::grass;
  grass.base = {0.045F, 0.085F, 0.022F};
  grass.second = {0.085F, 0.115F, 0.04F};
  grass.seed = dice.bits();
  Brush lawn;
  lawn.label = label::terrain;
  lawn.material = scene.add(grass);
  const float h = kKerbHeight_m + 0.05F;
  for (int i = 0; i < 6; ++i) {
    const float a = mix(s0, s1, static_cast<float>(i) / 6);
    const float b = mix(s0, s1, static_cast<float>(i + 1) / 6);
    scene.quad(l.at(a, edge, h), l.at(b, edge, h), l.at(b, edge + sg * 30, h), l.at(a, edge + sg * 30, h), {0, 1, 0},
               lawn);
    scene.quad(l.at(a, edge, kKerbHeight_m), l.at(b, edge, kKerbHeight_m), l.at(b, edge, h), l.at(a, edge, h),
               {-sg, 0, 0}, lawn);
  }
  Brush rail;
  rail.label = label::fence;
  rail.material = scene.add_plain({0.04F, 0.05F, 0.045F}, 0.55F, 0.4F);
  const bool hedge = dice.chance(0.5F);
  if (hedge) {
    for (std::uint32_t i = 0; i < 4; ++i) {
      const float a = mix(s0 + 0.5F, s1, static_cast<float>(i) / 4);
      build_hedge(scene, l.pose(a, edge + sg * 0.5F, kKerbHeight_m), (s1 - s0) / 4 - (i == 1 ? 1.6F : 0.0F),
                  dice.uniform(0.9F, 1.2F), l.seed, 260 + i);
    }
  } else {
    for (float s = s0; s < s1; s += 2.0F) {
      const Vec3f p = l.at(s, edge + sg * 0.2F, kKerbHeight_m);
      const Vec3f q = l.at(std::fmin(s + 2, s1), edge + sg * 0.2F, kKerbHeight_m);
      scene.bar(p, p + Vec3f{0, 1.15F, 0}, 0.03F, 0.03F, 6, rail);
      for (const float y : {0.15F, 1.05F}) scene.bar(p + Vec3f{0, y, 0}, q + Vec3f{0, y, 0}, 0.018F, 0.018F, 5, rail);
      for (int k = 1; k < 14; ++k) {
        const Vec3f r = mix(p, q, static_cast<float>(k) / 14);
        scene.bar(r + Vec3f{0, 0.15F, 0}, r + Vec3f{0, 1.05F, 0}, 0.009F, 0.009F, 3, rail);
      }
    }
  }
  for (std::uint32_t i = 0; i < 6; ++i) {
    const float s = dice.uniform(s0 + 3, s1 - 2);
    const float d = edge + sg * dice.uniform(3.5F, 14);
    const float height = dice.uniform(7, 12);
    const float spread = dice.uniform(2.8F, 4.2F);
    build_tree(scene, l.pose(s, d, h), height, spread, s < 50 ? 110 : 70, l.seed, 270 + i);
  }
  for (std::uint32_t i = 0; i < 7; ++i) {
    Dice house(l.seed, left ? Topic::building_left : Topic::building_right, 130 + i);
    const float turn = left ? 0.5F * kPi : -0.5F * kPi;
    const float width = 15;
    const float from = l.junction1 + width * static_cast<float>(i);
    Pose p = upright(l.at(left ? from + width : from, edge + sg * 31, 0), turn);
    HouseStyle style = make_style(scene, p, house, i < 3 ? Detail::middle : Detail::far);
    build_house(scene, p, width, 10, style, false, false, house);
  }
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_PARK_HPP
