// SPDX-License-Identifier: Apache-2.0
// Street furniture: lamps of both kinds, traffic lights, signs, bins, bollards, an advertising column, a clock.
//
// Poses stand on the ground, z towards whom the object faces.
#ifndef NPSIM_SAMPLES_STREET_FURNITURE_HPP
#define NPSIM_SAMPLES_STREET_FURNITURE_HPP

#include <cmath>
#include <cstdint>

#include "dice.hpp"
#include "scene.hpp"

namespace npsim {
namespace street {

struct FurniturePaints {
  Brush steel, dark, white, lamp_lens, lantern_glass, box;
};

inline FurniturePaints make_furniture_paints(Scene& scene) {
  FurniturePaints f;
  Brush b;
  b.label = label::pole;
  Material steel;
  steel.base = {0.24F, 0.245F, 0.25F};
  steel.roughness = 0.5F;
  steel.mirror = 0.04F;
  steel.variation = 0.5F;
  f.steel = b.with(scene.add(steel));
  f.dark = b.with(scene.add_plain({0.045F, 0.055F, 0.05F}, 0.55F, 0.5F));
  f.white = b.with(scene.add_plain({0.5F, 0.5F, 0.48F}, 0.6F, 0.6F));
  Material lens;
  lens.base = {0.6F, 0.6F, 0.58F};
  lens.roughness = 0.25F;
  lens.mirror = 0.04F;
  lens.variation = 0.2F;
  f.lamp_lens = b.with(scene.add(lens));
  lens.base = {0.62F, 0.58F, 0.48F};
  f.lantern_glass = b.with(scene.add(lens));
  f.box = b.with(scene.add_plain({0.10F, 0.12F, 0.105F}, 0.6F)).labelled(label::static_object);
  return f;
}

// Tall LED lamp: tapered pole, arm reaching along +z over the road (which runs along x), flat head. street_light_HT.
inline void build_tall_lamp(Scene& scene, const FurniturePaints& f, const Pose& p, float height, float reach) {
  scene.bar(p.point({0, 0, 0}), p.point({0, 1.1F, 0}), 0.11F, 0.10F, 12, f.steel);
  scene.bar(p.point({0, 1.1F, 0}), p.point({0, height - 0.7F, 0}), 0.085F, 0.055F, 12, f.steel);
  Vec3f last = p.point({0, height - 0.7F, 0});
  for (int i = 1; i <= 5; ++i) {  // a bent arm
    const float a = 0.5F * kPi * static_cast<float>(i) / 5.0F;
    const Vec3f next = p.point({0, height - 0.7F + 0.7F * std::sin(a), 0.7F * (1 - std::cos(a))});
    scene.bar(last, next, 0.055F, 0.05F, 10, f.steel);
    last = next;
  }
  scene.bar(last, p.point({0, height + 0.12F, reach}), 0.05F, 0.04F, 10, f.steel);
  const Pose head = p.moved({0, height + 0.12F, reach});
  scene.box(head, {-0.16F, -0.05F, -0.1F}, {0.16F, 0.07F, 0.62F}, f.steel);
  scene.box(
      head, {-0.13F, -0.10F, 0.0F}, {0.13F, -0.051F, 0.58F},
      f.lamp_lens.lit(f.lamp_lens.material, scene.aimed(scene.add_light(LightClass::street_light_ht), -p.y, p.x)));
}

// Older lantern on a low post, the road along z: street_light_LT.
inline void build_lantern(Scene& scene, const FurniturePaints& f, const Pose& p, float height) {
  scene.bar(p.point({0, 0, 0}), p.point({0, 0.7F, 0}), 0.12F, 0.09F, 12, f.dark);
  scene.bar(p.point({0, 0.7F, 0}), p.point({0, height, 0}), 0.065F, 0.045F, 12, f.dark);
  scene.bar(p.point({0, 0.68F, 0}), p.point({0, 0.76F, 0}), 0.11F, 0.11F, 12, f.dark);
  const Brush glow = f.lantern_glass.lit(f.lantern_glass.material,
                                         scene.aimed(scene.add_light(LightClass::street_light_lt), -p.y, p.z));
  scene.bar(p.point({0, height, 0}), p.point({0, height + 0.1F, 0}), 0.1F, 0.16F, 12, f.dark);
  scene.bar(p.point({0, height + 0.1F, 0}), p.point({0, height + 0.62F, 0}), 0.16F, 0.26F, 8, glow);
  scene.bar(p.point({0, height + 0.62F, 0}), p.point({0, height + 0.85F, 0}), 0.31F, 0.06F, 8, f.dark);
  scene.bar(p.point({0, height + 0.85F, 0}), p.point({0, height + 1.0F, 0}), 0.03F, 0.01F, 6, f.dark);
}

// One signal head with three discs, its back plate and hoods; `p` is the middle of the head.
inline void build_signal_head(Scene& scene, const FurniturePaints& f, const Pose& p, SignalState state,
                              std::uint32_t seed) {
  Brush body = f.dark.labelled(label::traffic_light);
  body.instance = 0;
  const std::uint16_t group = scene.add_group(LightClass::traffic_light_group);
  body.panel = group;
  scene.box(p, {-0.15F, -0.46F, -0.12F}, {0.15F, 0.46F, 0.10F}, body);
  const Vec3f burning[3] = {{0.78F, 0.018F, 0.012F}, {0.8F, 0.34F, 0.01F}, {0.015F, 0.62F, 0.30F}};
  const SignalState states[3] = {SignalState::red, SignalState::amber, SignalState::green};
  for (int i = 0; i < 3; ++i) {
    const bool on = states[i] == state;
    Material m;
    m.kind = Kind::lamp;
    m.base = on ? burning[i] : burning[i] * 0.11F + Vec3f{0.012F, 0.012F, 0.012F};
    m.glow = on ? 1.5F : 0.0F;
    m.roughness = 0.3F;
    m.mirror = 0.03F;
    m.seed = seed;
    m.frame = p;
    // Only the burning disc is an inferred object: its colour by night is the one seen by day.
    const std::uint16_t light =
        on ? scene.aimed(scene.add_light(LightClass::inferred_object, group, states[i], true), p.z, p.y)
           : std::uint16_t{0};
    const float y = 0.29F - 0.29F * static_cast<float>(i);
    scene.disc(p.moved({0, y, 0.106F}), 0.105F, 20, 0, body.lit(scene.add(m), light));
    const int n = 9;
    scene.grid(
        n, 1,
        [&](int k, int j) {
          const float a = kPi * (-0.08F + 1.16F * static_cast<float>(k) / static_cast<float>(n));
          return p.point({0.118F * std::cos(a), y + 0.118F * std::sin(a), 0.1F + 0.19F * static_cast<float>(j)});
        },
        false, body.smoothed());
  }
}

// Mast at the kerb: head at eye height and, with `arm` > 0, one more above the road, `arm` metres along local +x.
inline void build_traffic_light(Scene& scene, const FurniturePaints& f, const Pose& p, SignalState state, float arm,
                                std::uint32_t seed) {
  const float top = arm != 0 ? 5.6F : 3.3F;
  scene.bar(p.point({0, 0, 0}), p.point({0, top, 0}), 0.08F, 0.06F, 12, f.steel);
  build_signal_head(scene, f, p.moved({0, 2.75F, 0.22F}), state, seed);
  // The small pedestrian signal on the side of the mast.
  build_signal_head(scene, f, Pose{p.point({0.24F, 2.55F, 0}), -p.z, p.y, p.x},
                    state == SignalState::red ? SignalState::green : SignalState::red, seed + 1);
  scene.box(p, {-0.07F, 1.0F, -0.13F}, {0.07F, 1.22F, -0.06F}, f.dark.with(f.white.material));
  if (arm != 0) {
    scene.bar(p.point({0, 5.25F, 0}), p.point({arm, 5.75F, 0}), 0.06F, 0.04F, 10, f.steel);
    build_signal_head(scene, f, p.moved({arm, 5.45F, 0.14F}), state, seed + 2);
  }
}

// Sign plate on a post; variants as in sign_surface(). Round, square, triangle or diamond by variant.
inline void build_sign(Scene& scene, const FurniturePaints& f, const Pose& p, int variant, float height, bool post) {
  if (post) scene.bar(p.point({0, 0, 0}), p.point({0, height + 0.36F, 0}), 0.035F, 0.035F, 10, f.steel);
  Material m;
  m.kind = Kind::sign;
  m.variant = variant;
  m.frame = p.moved({0, height, 0.06F});
  m.size = {variant >= 7 ? 0.75F : 0.31F, variant >= 7 ? 0.28F : 0.31F};
  Brush b = f.steel.labelled(label::traffic_sign).with(scene.add(m));
  const Brush back = f.steel.labelled(label::traffic_sign);
  const Pose rear{m.frame.o - p.z * 0.012F, -p.x, p.y, -p.z};
  switch (variant) {
    case 0:
    case 1:
    case 6:
      scene.disc(m.frame, 0.31F, 28, 0, b);
      scene.disc(rear, 0.31F, 28, 0, back);
      break;
    case 2:
    case 3:
      scene.box(m.frame, {-0.31F, -0.31F, -0.012F}, {0.31F, 0.31F, -0.001F}, back);
      scene.panel_xy(m.frame, -0.31F, 0.31F, -0.31F, 0.31F, 0, b);
      break;
    case 4:
      scene.disc(m.frame, 0.42F, 3, -0.5F * kPi, b);
      scene.disc(rear, 0.42F, 3, -0.5F * kPi, back);
      break;
    case 5:
      scene.disc(m.frame, 0.40F, 4, 0, b);
      scene.disc(rear, 0.40F, 4, 0, back);
      break;
    default:
      scene.box(m.frame, {-0.75F, -0.28F, -0.03F}, {0.75F, 0.28F, -0.001F}, back);
      scene.panel_xy(m.frame, -0.75F, 0.75F, -0.28F, 0.28F, 0, b);
      break;
  }
}

inline void build_bin(Scene& scene, const FurniturePaints& f, const Pose& p, const Vec3f& colour) {
  const Brush b = f.box.with(scene.add_plain(colour, 0.6F));
  scene.bar(p.point({0, 0, 0}), p.point({0, 0.9F, 0}), 0.2F, 0.23F, 14, b);
  scene.bar(p.point({0, 0.9F, 0}), p.point({0, 0.98F, 0}), 0.25F, 0.16F, 14, f.box);
}

inline void build_bollard(Scene& scene, const FurniturePaints& f, const Pose& p) {
  scene.bar(p.point({0, 0, 0}), p.point({0, 0.85F, 0}), 0.06F, 0.055F, 10, f.dark);
  scene.bar(p.point({0, 0.72F, 0}), p.point({0, 0.8F, 0}), 0.063F, 0.063F, 10, f.white);
  scene.ellipsoid(p.moved({0, 0.86F, 0}), {0.07F, 0.06F, 0.07F}, 10, 6, f.dark);
}

// Backlit poster in a frame on two legs.
inline void build_poster(Scene& scene, const FurniturePaints& f, const Pose& p, Dice& dice) {
  scene.box(p, {-0.66F, 0.45F, -0.1F}, {0.66F, 2.55F, 0.1F}, f.dark.labelled(label::static_object));
  scene.bar(p.point({-0.4F, 0, 0}), p.point({-0.4F, 0.45F, 0}), 0.06F, 0.06F, 8, f.dark);
  scene.bar(p.point({0.4F, 0, 0}), p.point({0.4F, 0.45F, 0}), 0.06F, 0.06F, 8, f.dark);
  for (int side = 0; side < 2; ++side) {
    Material m;
    m.kind = Kind::poster;
    m.base = {dice.uniform(0.03F, 0.6F), dice.uniform(0.05F, 0.4F), dice.uniform(0.1F, 0.6F)};
    m.second = {dice.uniform(0.02F, 0.4F), dice.uniform(0.05F, 0.3F), dice.uniform(0.02F, 0.3F)};
    m.variant = dice.pick(2);
    m.seed = dice.bits();
    m.size = {1.16F, 1.9F};
    m.frame = side == 0 ? p.moved({0, 1.5F, 0.11F}) : Pose{p.point({0, 1.5F, -0.11F}), -p.x, p.y, -p.z};
    const Brush b = f.dark.labelled(label::static_object).lit(scene.add(m), scene.add_light(LightClass::advertisement));
    scene.panel_xy(m.frame, -0.58F, 0.58F, -0.95F, 0.95F, 0, b);
  }
}

inline void build_clock(Scene& scene, const FurniturePaints& f, const Pose& p, std::uint32_t seed) {
  const Brush dark = f.dark;
  scene.bar(p.point({0, 0, 0}), p.point({0, 3.2F, 0}), 0.06F, 0.05F, 10, dark);
  scene.bar(p.point({0, 3.58F, -0.13F}), p.point({0, 3.58F, 0.13F}), 0.42F, 0.42F, 28,
            dark.labelled(label::static_object));
  for (int side = 0; side < 2; ++side) {
    Material m;
    m.kind = Kind::clock_face;
    m.seed = seed;
    m.size = {0.38F, 0.38F};
    m.frame = side == 0 ? p.moved({0, 3.58F, 0.136F}) : Pose{p.point({0, 3.58F, -0.136F}), -p.x, p.y, -p.z};
    scene.disc(m.frame, 0.38F, 28, 0,
               dark.labelled(label::static_object).lit(scene.add(m), scene.add_light(LightClass::clock)));
  }
}

// Shelter of a bus stop: roof, glass back, bench, lit poster.
inline void build_shelter(Scene& scene, const FurniturePaints& f, const Pose& p, Dice& dice) {
  const Brush frame = f.dark.labelled(label::building);
  Material glass;
  glass.base = {0.07F, 0.08F, 0.08F};
  glass.roughness = 0.05F;
  glass.mirror = 0.07F;
  const Brush pane = frame.with(scene.add(glass));
  for (const float x : {-1.9F, 0.0F, 1.9F}) scene.box(p, {x - 0.04F, 0, -0.75F}, {x + 0.04F, 2.4F, -0.67F}, frame);
  scene.box(p, {-2.05F, 2.4F, -0.85F}, {2.05F, 2.52F, 0.85F}, frame);
  scene.box(p, {-1.86F, 0.3F, -0.725F}, {-0.04F, 2.2F, -0.71F}, pane);
  scene.box(p, {0.04F, 0.3F, -0.725F}, {1.86F, 2.2F, -0.71F}, pane);
  scene.box(p, {-1.4F, 0.42F, -0.62F}, {0.9F, 0.48F, -0.25F}, frame.with(f.steel.material));
  build_poster(scene, f, Pose{p.point({-2.0F, 0, 0}), p.z, p.y, -p.x}, dice);
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_FURNITURE_HPP
