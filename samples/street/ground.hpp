// SPDX-License-Identifier: Apache-2.0
// The ground as geometry: one road plane at height 0, and on it the pavements, 12 cm higher, with rounded kerbs.
//
// Invariant: every face labelled road lies in the plane y = 0 of the world, so that road depth has a closed form.
#ifndef NPSIM_SAMPLES_STREET_GROUND_HPP
#define NPSIM_SAMPLES_STREET_GROUND_HPP

#include <cmath>
#include <cstddef>
#include <vector>

#include "dice.hpp"
#include "layout.hpp"
#include "scene.hpp"

namespace npsim {
namespace street {

inline void build_road(Scene& scene, const Layout& l) {
  Material m;
  m.kind = Kind::road;
  m.roughness = 0.9F;
  m.base = {0.115F, 0.113F, 0.11F};
  m.seed = static_cast<std::uint32_t>(l.seed) * 31U + 5U;
  Brush brush;
  brush.material = scene.add(m);
  brush.label = label::road;
  const int nx = 12;
  const int nz = 24;
  scene.grid(
      nx, nz,
      [&](int i, int j) {
        return Vec3f{-120.0F + 20.0F * static_cast<float>(i), 0, -40.0F + 10.0F * static_cast<float>(j)};
      },
      true, brush);
}

// One block of pavement: from s0 to s1, outwards from the kerb on one side, corners rounded where a street turns off.
inline void build_pavement(Scene& scene, const Layout& l, float sign, float s0, float s1, bool round0, bool round1,
                           const Brush& slabs, const Brush& kerb) {
  struct Point {
    float e, s;    // kerb edge: distance outwards, along
    float ie, is;  // inner edge of the kerb stone
  };
  const float radius = 4.0F;
  const float stone = 0.15F;
  const float far_e = 70.0F;
  const float kerb_d = sign < 0 ? l.kerb_left : l.kerb_right;
  const auto world = [&](float e, float s, float h) { return l.at(s, kerb_d + sign * e, h); };
  std::vector<Point> line;
  const int arc = 8;
  if (round0) {
    line.push_back({far_e, s0, far_e, s0 + stone});
    for (int i = 0; i <= arc; ++i) {
      const float a = 0.5F * kPi * static_cast<float>(i) / static_cast<float>(arc);
      const float c = std::sin(a);
      const float n = std::cos(a);
      line.push_back({radius - radius * c, s0 + radius - radius * n, radius - (radius - stone) * c,
                      s0 + radius - (radius - stone) * n});
    }
  }
  const float from = round0 ? s0 + radius : s0;
  const float to = round1 ? s1 - radius : s1;
  const int pieces = static_cast<int>(std::ceil((to - from) / 2.5F));
  for (int i = round0 ? 1 : 0; i <= pieces; ++i) {
    const float s = from + (to - from) * static_cast<float>(i) / static_cast<float>(pieces);
    line.push_back({0, s, stone, s});
  }
  if (round1) {
    for (int i = 1; i <= arc; ++i) {
      const float a = 0.5F * kPi * static_cast<float>(i) / static_cast<float>(arc);
      const float c = std::cos(a);
      const float n = std::sin(a);
      line.push_back({radius - radius * c, s1 - radius + radius * n, radius - (radius - stone) * c,
                      s1 - radius + (radius - stone) * n});
    }
    line.push_back({far_e, s1, far_e, s1 - stone});
  }
  const float h = kKerbHeight_m;
  const Vec3f up{0, 1, 0};
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const Point& p = line[i];
    const Point& q = line[i + 1];
    const Vec3f middle = world(0.5F * (p.e + q.e), 0.5F * (p.s + q.s), 0);
    const Vec3f inner = world(0.5F * (p.ie + q.ie), 0.5F * (p.is + q.is), 0);
    scene.quad(world(p.e, p.s, 0), world(q.e, q.s, 0), world(q.e, q.s, h), world(p.e, p.s, h), middle - inner, kerb);
    scene.quad(world(p.e, p.s, h), world(q.e, q.s, h), world(q.ie, q.is, h), world(p.ie, p.is, h), up, kerb);
    const bool in_corner0 = round0 && 0.5F * (p.s + q.s) < from && p.e < radius + 1;
    const bool in_corner1 = round1 && 0.5F * (p.s + q.s) > to && q.e < radius + 1;
    if (in_corner0 || in_corner1) {
      scene.triangle(world(p.ie, p.is, h), world(q.ie, q.is, h), world(radius, in_corner0 ? from : to, h), up, slabs);
    } else if (p.e < 1 && q.e < 1) {
      scene.quad(world(p.ie, p.is, h), world(q.ie, q.is, h), world(radius, q.is, h), world(radius, p.is, h), up, slabs);
    }
  }
  const float a = round0 ? s0 + stone : s0;
  const float b = round1 ? s1 - stone : s1;
  const int rows = static_cast<int>(std::ceil((b - a) / 5.0F));
  for (int i = 0; i < rows; ++i) {
    const float p = a + (b - a) * static_cast<float>(i) / static_cast<float>(rows);
    const float q = a + (b - a) * static_cast<float>(i + 1) / static_cast<float>(rows);
    scene.quad(world(radius, p, h), world(radius, q, h), world(far_e, q, h), world(far_e, p, h), up, slabs);
  }
}

inline void build_pavements(Scene& scene, const Layout& l) {
  Dice dice(l.seed, Topic::road, 1);
  const auto slabs = [&](int variant) {
    Material m;
    m.kind = Kind::pavement;
    m.variant = variant;
    m.roughness = 0.88F;
    const Vec3f tones[3] = {{0.25F, 0.245F, 0.235F}, {0.29F, 0.27F, 0.25F}, {0.24F, 0.20F, 0.18F}};
    m.base = dice.one_of(tones, 0.85F, 1.1F);
    m.second = m.base * Vec3f{0.86F, 0.85F, 0.84F};
    m.seed = dice.bits();
    Brush b;
    b.material = scene.add(m);
    b.label = label::sidewalk;
    return b;
  };
  Material k;
  k.kind = Kind::kerb;
  k.base = {0.30F, 0.295F, 0.285F};
  k.roughness = 0.85F;
  k.seed = dice.bits();
  Brush kerb;
  kerb.material = scene.add(k);
  kerb.label = label::sidewalk;
  const float stop = l.end - 11;
  for (int side = -1; side <= 1; side += 2) {
    const float sign = static_cast<float>(side);
    const Brush b = slabs(dice.pick(3));
    if (side < 0 ? l.side_left : l.side_right) {
      build_pavement(scene, l, sign, -38, l.junction0, false, true, b, kerb);
      build_pavement(scene, l, sign, l.junction1, stop, true, true, b, kerb);
    } else {
      build_pavement(scene, l, sign, -38, stop, false, true, b, kerb);
    }
  }
  // The far side of the street that closes the view.
  const Brush b = slabs(1);
  const Vec3f p = l.at(l.end - 3, 0, 0);
  const float h = kKerbHeight_m;
  const Vec3f up{0, 1, 0};
  scene.quad({p.x - 80, h, p.z}, {p.x + 80, h, p.z}, {p.x + 80, h, p.z + 20}, {p.x - 80, h, p.z + 20}, up, b);
  scene.quad({p.x - 80, 0, p.z}, {p.x + 80, 0, p.z}, {p.x + 80, h, p.z}, {p.x - 80, h, p.z}, {0, 0, -1}, kerb);
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_GROUND_HPP
