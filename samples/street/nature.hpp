// SPDX-License-Identifier: Apache-2.0
// Trees of branching limbs with leaf cards in clusters, hedges, and people with limbs, clothes and bicycles.
#ifndef NPSIM_SAMPLES_STREET_NATURE_HPP
#define NPSIM_SAMPLES_STREET_NATURE_HPP

#include <cmath>
#include <cstdint>

#include "dice.hpp"
#include "scene.hpp"

namespace npsim {
namespace street {

inline Vec3f random_direction(Dice& dice) {
  const float y = dice.uniform(-1, 1);
  const float a = dice.uniform(0, 2 * kPi);
  const float r = std::sqrt(std::fmax(0.0F, 1 - y * y));
  return {r * std::cos(a), y, r * std::sin(a)};
}

// `leaves` cards per cluster, about 40 clusters.
inline void build_tree(Scene& scene, const Pose& p, float height, float spread, int leaves, std::uint64_t seed,
                       std::uint32_t index) {
  Dice dice(seed, Topic::tree, index);
  Brush wood;
  wood.label = label::vegetation;
  Material bark;
  bark.kind = Kind::bark;
  bark.base = Vec3f{0.13F, 0.105F, 0.08F} * dice.uniform(0.7F, 1.3F);
  bark.roughness = 0.95F;
  bark.seed = dice.bits();
  wood.material = scene.add(bark);
  Material leaf;
  leaf.kind = Kind::leaf;
  const float autumn = dice.chance(0.3F) ? dice.uniform(0.3F, 0.9F) : 0.0F;
  leaf.base = mix(Vec3f{0.035F, 0.085F, 0.015F}, Vec3f{0.16F, 0.10F, 0.012F}, autumn);
  leaf.second = mix(Vec3f{0.11F, 0.19F, 0.035F}, Vec3f{0.30F, 0.19F, 0.03F}, autumn);
  leaf.roughness = 0.6F;
  leaf.seed = dice.bits();
  Brush foliage = wood.with(scene.add(leaf));

  const float trunk = height * dice.uniform(0.30F, 0.38F);
  const float r0 = 0.035F * height * 0.55F;
  const Vec3f lean{dice.uniform(-0.12F, 0.12F), 0, dice.uniform(-0.12F, 0.12F)};
  const Vec3f fork = p.point(Vec3f{0, trunk, 0} + lean);
  scene.bar(p.point({0, -0.05F, 0}), p.point(Vec3f{0, 0.35F, 0} + lean * 0.1F), r0 * 1.5F, r0 * 1.05F, 10, wood);
  scene.bar(p.point(Vec3f{0, 0.35F, 0} + lean * 0.1F), fork, r0 * 1.05F, r0 * 0.8F, 10, wood);
  const int limbs = 6 + dice.pick(3);
  std::uint32_t cluster = 0;
  const auto leaves_at = [&](const Vec3f& centre, float radius) {
    for (int i = 0; i < leaves; ++i) {
      // One stream a card: a stream has 1024 draws only.
      Dice d(seed, Topic::leaf, index, cluster++);
      const Vec3f out = random_direction(d);
      const float r = radius * std::cbrt(d.uniform(0.15F, 1.0F));
      const Vec3f c = centre + Vec3f{out.x * r, out.y * r * 0.75F, out.z * r};
      // Cards lie roughly along the surface of their cluster, hanging a little.
      const Vec3f n = normalized(out + random_direction(d) * 0.7F + Vec3f{0, 0.35F, 0});
      const Vec3f u = normalized(cross(n, Vec3f{0.31F, 0.9F, 0.29F}));
      const Vec3f v = cross(n, u);
      const float s = d.uniform(0.09F, 0.18F) * std::sqrt(130.0F / static_cast<float>(leaves));
      const float t = d.uniform(0, 2 * kPi);
      const Vec3f a = u * (s * std::cos(t)) + v * (s * std::sin(t));
      const Vec3f b = u * (-s * std::sin(t)) + v * (s * std::cos(t));
      scene.triangle(c + a, c - a * 0.6F + b * 0.8F, c - a * 0.5F - b * 0.8F, n, foliage);
    }
  };
  const float crown = height - trunk;
  for (int i = 0; i < limbs; ++i) {
    const float a = 2 * kPi * (static_cast<float>(i) + dice.uniform(0.0F, 0.7F)) / static_cast<float>(limbs);
    const float rise = i == 0 ? 0.85F : dice.uniform(0.25F, 0.8F);
    const float reach = i == 0 ? 0.15F : dice.uniform(0.55F, 0.95F) * std::sqrt(1 - 0.75F * rise * rise);
    const Vec3f tip = fork + p.direction({std::cos(a) * reach * spread, rise * crown, std::sin(a) * reach * spread});
    const Vec3f knee = mix(fork, tip, 0.5F) + Vec3f{0, 0.08F * crown, 0};
    scene.bar(fork, knee, r0 * 0.55F, r0 * 0.33F, 7, wood);
    scene.bar(knee, tip, r0 * 0.33F, r0 * 0.1F, 6, wood);
    const int twigs = 4 + dice.pick(3);
    for (int k = 0; k < twigs; ++k) {
      const Vec3f from = mix(knee, tip, dice.uniform(0.0F, 0.9F));
      const Vec3f d = random_direction(dice);
      const float far_out = spread * dice.uniform(0.2F, 0.48F);
      const Vec3f to = from + Vec3f{d.x * far_out, (d.y * 0.5F + 0.22F) * far_out, d.z * far_out};
      scene.bar(from, to, r0 * 0.16F, r0 * 0.05F, 4, wood);
      leaves_at(to, spread * dice.uniform(0.2F, 0.36F));
    }
    leaves_at(tip, spread * dice.uniform(0.26F, 0.4F));
  }
}

inline void build_hedge(Scene& scene, const Pose& p, float length_m, float height, std::uint64_t seed,
                        std::uint32_t index) {
  Dice dice(seed, Topic::tree, index);
  Brush b;
  b.label = label::vegetation;
  Material m;
  m.kind = Kind::leaf;
  m.base = {0.03F, 0.07F, 0.015F};
  m.second = {0.09F, 0.15F, 0.03F};
  m.roughness = 0.6F;
  m.seed = dice.bits();
  b.material = scene.add(m);
  scene.box(p, {-0.26F, 0, 0}, {0.26F, height - 0.06F, length_m}, b);
  const int n = static_cast<int>(length_m * 110);
  for (int part = 0; part * 120 < n; ++part) {
    Dice d(seed, Topic::leaf, index, static_cast<std::uint32_t>(part));
    for (int i = 0; i < 120; ++i) {
      const int face = d.pick(3);
      Vec3f c{d.uniform(-0.3F, 0.3F), d.uniform(0.02F, height), d.uniform(0, length_m)};
      if (face == 0) c.x = -0.29F;
      if (face == 1) c.x = 0.29F;
      if (face == 2) c.y = height;
      const Vec3f q = p.point(c);
      const Vec3f n2 = random_direction(d);
      const Vec3f u = normalized(cross(n2, Vec3f{0.3F, 0.8F, 0.5F}));
      const Vec3f v = cross(n2, u);
      const float s = d.uniform(0.05F, 0.11F);
      scene.triangle(q + u * s, q - u * (0.5F * s) + v * s, q - u * (0.5F * s) - v * s, n2, b);
    }
  }
}

struct PersonLook {
  Brush skin, hair, top, legs, shoes;
};

inline PersonLook make_look(Scene& scene, Label l, Dice& dice) {
  const Vec3f skins[4] = {{0.42F, 0.26F, 0.18F}, {0.36F, 0.22F, 0.15F}, {0.16F, 0.09F, 0.06F}, {0.26F, 0.15F, 0.1F}};
  const Vec3f clothes[10] = {{0.03F, 0.035F, 0.05F}, {0.05F, 0.09F, 0.2F}, {0.28F, 0.04F, 0.04F},  {0.4F, 0.38F, 0.33F},
                             {0.10F, 0.13F, 0.08F},  {0.45F, 0.3F, 0.06F}, {0.12F, 0.12F, 0.125F}, {0.5F, 0.5F, 0.5F},
                             {0.2F, 0.1F, 0.16F},    {0.16F, 0.11F, 0.07F}};
  const Vec3f trousers[5] = {{0.04F, 0.055F, 0.11F},
                             {0.02F, 0.02F, 0.024F},
                             {0.09F, 0.085F, 0.08F},
                             {0.22F, 0.18F, 0.13F},
                             {0.06F, 0.08F, 0.13F}};
  const Vec3f hairs[5] = {{0.02F, 0.015F, 0.01F},
                          {0.07F, 0.04F, 0.02F},
                          {0.2F, 0.13F, 0.06F},
                          {0.25F, 0.25F, 0.25F},
                          {0.03F, 0.02F, 0.02F}};
  PersonLook look;
  Brush b;
  b.label = l;
  b.instance = scene.next_instance(l);
  look.skin = b.with(scene.add_plain(skins[dice.pick(4)], 0.6F, 0.3F));
  look.hair = b.with(scene.add_plain(hairs[dice.pick(5)], 0.7F, 0.8F));
  look.top = b.with(scene.add_plain(clothes[dice.pick(10)], 0.95F, 1.0F));
  look.legs = b.with(scene.add_plain(trousers[dice.pick(5)], 0.95F, 1.0F));
  look.shoes = b.with(scene.add_plain({0.03F, 0.028F, 0.025F}, 0.7F));
  return look;
}

inline void limb(Scene& scene, const Vec3f& a, const Vec3f& b, float r0, float r1, const Brush& brush, bool fine) {
  scene.bar(a, b, r0, r1, fine ? 9 : 5, brush);
  if (fine) scene.ellipsoid({b, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {r1, r1, r1}, 8, 5, brush);
}

inline void build_head(Scene& scene, const Pose& p, const PersonLook& look, bool fine) {
  const int nu = fine ? 14 : 8;
  const int nv = fine ? 10 : 6;
  scene.ellipsoid(p, {0.078F, 0.115F, 0.095F}, nu, nv, look.skin);
  scene.ellipsoid(p.moved({0, 0.032F, -0.022F}), {0.088F, 0.104F, 0.092F}, nu, nv, look.hair);
  scene.bar(p.point({0, -0.2F, -0.01F}), p.point({0, -0.06F, 0}), 0.05F, 0.048F, 8, look.skin);
}

// Walking along +z, one leg ahead by the given phase; 1.6-1.9 m tall.
inline void build_walker(Scene& scene, const Pose& p, float height, float stride, bool fine, Dice& dice) {
  const PersonLook look = make_look(scene, label::person, dice);
  const float k = height / 1.75F;
  const int nu = fine ? 14 : 8;
  const int nv = fine ? 8 : 5;
  const auto at = [&](float x, float y, float z) { return p.point({k * x, k * y, k * z}); };
  const float hip = 0.92F;
  for (const float side : {-1.0F, 1.0F}) {
    const float swing = side * stride;
    const float knee_z = 0.24F * swing + 0.04F;
    const float foot_z = 0.42F * swing - 0.03F;
    const float lift = swing < 0 ? 0.07F * -swing : 0.0F;
    limb(scene, at(side * 0.085F, hip, 0), at(side * 0.09F, 0.5F, knee_z), 0.088F * k, 0.062F * k, look.legs, fine);
    limb(scene, at(side * 0.09F, 0.5F, knee_z), at(side * 0.09F, 0.1F + lift, foot_z), 0.062F * k, 0.048F * k,
         look.legs, fine);
    scene.ellipsoid(p.moved({side * 0.09F * k, (0.05F + lift) * k, (foot_z + 0.06F) * k}),
                    {0.048F * k, 0.048F * k, 0.13F * k}, fine ? 10 : 6, fine ? 6 : 4, look.shoes);
    // Arms swing against the legs.
    const float a = -swing * 0.5F;
    limb(scene, at(side * 0.205F, 1.4F, 0), at(side * 0.25F, 1.13F, 0.16F * a - 0.03F), 0.058F * k, 0.045F * k,
         look.top, fine);
    limb(scene, at(side * 0.25F, 1.13F, 0.16F * a - 0.03F), at(side * 0.235F, 0.89F, 0.33F * a + 0.08F), 0.045F * k,
         0.036F * k, look.top, fine);
    scene.ellipsoid(p.moved({side * 0.235F * k, 0.84F * k, (0.35F * a + 0.1F) * k}), {0.032F, 0.055F, 0.035F}, 8, 5,
                    look.skin);
  }
  // Trunk: waist, chest, shoulders.
  const bool coat = dice.chance(0.4F);
  scene.ellipsoid(p.moved({0, 0.98F * k, 0}), {0.155F * k, 0.16F * k, 0.115F * k}, nu, nv, coat ? look.top : look.legs);
  scene.ellipsoid(p.moved({0, 1.22F * k, 0}), {0.175F * k, 0.27F * k, 0.118F * k}, nu, nv, look.top);
  scene.ellipsoid(p.moved({0, 1.385F * k, -0.005F}), {0.215F * k, 0.10F * k, 0.10F * k}, nu, nv, look.top);
  if (coat) scene.bar(at(0, 0.66F, 0), at(0, 1.0F, 0), 0.185F * k, 0.155F * k, nu, look.top);
  if (dice.chance(0.35F)) {  // rucksack or bag
    const Brush bag = look.shoes.with(
        scene.add_plain({dice.uniform(0.02F, 0.3F), dice.uniform(0.02F, 0.15F), dice.uniform(0.02F, 0.25F)}, 0.85F));
    scene.ellipsoid(p.moved({0, 1.22F * k, -0.17F * k}), {0.14F * k, 0.21F * k, 0.09F * k}, nu, nv, bag);
  }
  build_head(scene, p.moved({0, 1.645F * k, 0.015F}), look, fine);
}

// Bicycle, with its rider when `ridden`; length along z.
inline void build_bicycle(Scene& scene, const Pose& p, bool ridden, Dice& dice) {
  Brush b;
  b.label = label::bicycle;
  b.instance = scene.next_instance(label::bicycle);
  const Brush frame =
      b.with(scene.add_plain({dice.uniform(0.02F, 0.4F), dice.uniform(0.02F, 0.15F), dice.uniform(0.02F, 0.2F)}, 0.4F));
  const Brush black = b.with(scene.add_plain({0.02F, 0.02F, 0.02F}, 0.8F));
  const float r = 0.34F;
  for (const float z : {-0.53F, 0.53F}) {
    const int n = 28;
    scene.grid(
        n, 6,
        [&](int i, int j) {
          const float a = 2 * kPi * static_cast<float>(i) / static_cast<float>(n);
          const float c = 2 * kPi * static_cast<float>(j) / 6.0F;
          const float q = r + 0.02F * std::cos(c);
          return p.point({0.02F * std::sin(c), r + q * std::sin(a), z + q * std::cos(a)});
        },
        true, black.smoothed());
    for (int i = 0; i < 10; ++i) {
      const float a = 2 * kPi * static_cast<float>(i) / 10.0F;
      scene.bar(p.point({0, r, z}), p.point({0, r + r * std::sin(a), z + r * std::cos(a)}), 0.003F, 0.003F, 3, black);
    }
    scene.box(p, {-0.025F, 2 * r + 0.02F, z - 0.16F}, {0.025F, 2 * r + 0.03F, z + 0.12F}, black);
  }
  const auto at = [&](float y, float z) { return p.point({0, y, z}); };
  const Vec3f crank = at(0.29F, -0.05F);
  const Vec3f seat = at(0.86F, -0.24F);
  const Vec3f head = at(0.82F, 0.38F);
  scene.bar(crank, seat, 0.016F, 0.016F, 8, frame);
  scene.bar(crank, at(0.66F, 0.42F), 0.018F, 0.018F, 8, frame);
  scene.bar(at(0.74F, -0.2F), head, 0.016F, 0.016F, 8, frame);
  scene.bar(at(r, -0.53F), at(0.74F, -0.2F), 0.011F, 0.011F, 6, frame);
  scene.bar(at(r, -0.53F), crank, 0.011F, 0.011F, 6, frame);
  scene.bar(at(r, 0.53F), at(1.0F, 0.33F), 0.016F, 0.016F, 8, frame);
  scene.bar(p.point({-0.27F, 1.04F, 0.3F}), p.point({0.27F, 1.04F, 0.3F}), 0.013F, 0.013F, 8, black);
  scene.ellipsoid(p.moved({0, 0.92F, -0.25F}), {0.07F, 0.04F, 0.13F}, 10, 6, black);
  const std::uint16_t group = scene.add_group(LightClass::bicycle_group);
  Material lamp;
  lamp.kind = Kind::lamp;
  lamp.base = {0.36F, 0.015F, 0.012F};
  lamp.frame = p;
  const std::uint16_t tail = scene.add_light(ridden ? LightClass::moving_rear : LightClass::parked_rear, group);
  scene.box(p, {-0.035F, 0.66F, -0.62F}, {0.035F, 0.72F, -0.59F},
            b.lit(scene.add(lamp), scene.aimed(tail, -p.z, p.y)));
  lamp.base = {0.55F, 0.55F, 0.55F};
  const std::uint16_t head_lamp = scene.add_light(ridden ? LightClass::moving_front : LightClass::parked_front, group);
  scene.box(p, {-0.035F, 0.9F, 0.4F}, {0.035F, 0.96F, 0.44F},
            b.lit(scene.add(lamp), scene.aimed(head_lamp, p.z, p.y)));
  if (!ridden) return;
  const PersonLook look = make_look(scene, label::rider, dice);
  for (const float side : {-1.0F, 1.0F}) {
    const float phase = side > 0 ? 1.0F : -1.0F;
    const Vec3f pedal = p.point({side * 0.1F, 0.29F + 0.15F * phase, -0.05F + 0.06F * phase});
    const Vec3f hip = p.point({side * 0.085F, 0.98F, -0.22F});
    const Vec3f knee = p.point({side * 0.1F, phase > 0 ? 0.83F : 0.62F, phase > 0 ? 0.2F : 0.06F});
    limb(scene, hip, knee, 0.085F, 0.062F, look.legs, true);
    limb(scene, knee, pedal + Vec3f{0, 0.05F, 0}, 0.062F, 0.045F, look.legs, true);
    scene.ellipsoid(Pose{pedal + Vec3f{0, 0.02F, 0}, p.x, p.y, p.z}, {0.045F, 0.045F, 0.12F}, 10, 6, look.shoes);
    const Vec3f shoulder = p.point({side * 0.19F, 1.45F, 0.0F});
    const Vec3f elbow = p.point({side * 0.26F, 1.2F, 0.13F});
    limb(scene, shoulder, elbow, 0.055F, 0.045F, look.top, true);
    limb(scene, elbow, p.point({side * 0.25F, 1.06F, 0.3F}), 0.042F, 0.036F, look.top, true);
  }
  scene.bar(p.point({0, 0.95F, -0.25F}), p.point({0, 1.5F, 0.0F}), 0.14F, 0.17F, 12, look.top);
  scene.ellipsoid(p.moved({0, 0.97F, -0.25F}), {0.17F, 0.13F, 0.15F}, 12, 8, look.legs);
  scene.ellipsoid(p.moved({0, 1.47F, -0.01F}), {0.21F, 0.10F, 0.12F}, 12, 8, look.top);
  build_head(scene, p.moved({0, 1.72F, 0.06F}), look, true);
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_NATURE_HPP
