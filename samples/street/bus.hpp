// SPDX-License-Identifier: Apache-2.0
// A city bus, 12 m long: rounded box, band of windows, doors, lamps, destination boards.
#ifndef NPSIM_SAMPLES_STREET_BUS_HPP
#define NPSIM_SAMPLES_STREET_BUS_HPP

#include <cmath>
#include <cstdint>

#include "dice.hpp"
#include "scene.hpp"
#include "vehicle_parts.hpp"

namespace npsim {
namespace street {

inline void build_bus(Scene& scene, const Pose& pose, const Vec3f& colour, Dice& dice) {
  const float length_m = 11.8F;
  const float half = 1.26F;
  const float height = 3.05F;
  const float zr = -0.5F * length_m;
  const float zf = 0.5F * length_m;
  const std::uint32_t seed = dice.bits();
  Brush base;
  base.label = label::bus;
  base.instance = scene.next_instance(label::bus);
  const std::uint16_t group = scene.add_group(LightClass::bus_group);
  base.panel = group;
  const auto material = [&](Kind k, const Vec3f& c, float rough, float mirror, float glow = 0) {
    return add_vehicle_material(scene, k, c, rough, mirror, pose, seed, glow);
  };
  const Brush paint = base.with(material(Kind::car_paint, colour, 0.4F, 0.05F)).smoothed();
  const Brush white = base.with(material(Kind::car_paint, {0.6F, 0.6F, 0.58F}, 0.4F, 0.05F)).smoothed();
  const Brush black = base.with(material(Kind::plain, {0.02F, 0.02F, 0.021F}, 0.7F, 0.02F));
  const std::uint16_t glass = material(Kind::car_glass, {0.014F, 0.016F, 0.017F}, 0.05F, 0.09F);
  const std::uint16_t red = material(Kind::lamp, {0.34F, 0.014F, 0.012F}, 0.15F, 0.06F, 0.5F);
  const std::uint16_t lens = material(Kind::lamp, {0.55F, 0.56F, 0.57F}, 0.1F, 0.08F);
  const std::uint16_t amber = material(Kind::lamp, {0.55F, 0.22F, 0.02F}, 0.15F, 0.06F);

  // Body: the cross-section (x, y) is a rounded rectangle, extruded; ends are slightly bowed in plan.
  const int n = 40;
  const auto section = [&](int i, float inset) {
    const float a = 2 * kPi * static_cast<float>(i % n) / static_cast<float>(n);
    const auto power = [](float v, float e) { return v < 0 ? -std::pow(-v, e) : std::pow(v, e); };
    const float x = (half - inset) * power(std::cos(a), 0.22F);
    const float y = 0.5F * (height + 0.3F) + (0.5F * (height - 0.3F) - inset) * power(std::sin(a), 0.22F);
    return Vec3f{x, y, 0};
  };
  const float zs[6] = {zr, zr + 0.06F, zr + 0.2F, zf - 0.3F, zf - 0.1F, zf};
  const float insets[6] = {0.16F, 0.05F, 0, 0, 0.06F, 0.2F};
  scene.grid(
      n, 5,
      [&](int i, int j) {
        Vec3f p = section(i, insets[j]);
        p.z = zs[j];
        return pose.point(p);
      },
      false, paint);
  for (const float dir : {-1.0F, 1.0F}) {
    const float z = dir < 0 ? zr : zf;
    const float inset = dir < 0 ? insets[0] : insets[5];
    for (int i = 0; i < n; ++i) {
      Vec3f a = section(i, inset);
      Vec3f b = section(i + 1, inset);
      a.z = b.z = z;
      scene.triangle(pose.point(a), pose.point(b), pose.point({0, 1.6F, z}), pose.z * dir, paint);
    }
  }
  // A lighter roof line and a black skirt.
  for (const float side : {-1.0F, 1.0F}) {
    const Pose wall{pose.point({side * (half + 0.004F), 0, 0}), pose.z * -side, pose.y, pose.x * side};
    scene.panel_xy(wall, -0.5F * length_m + 0.35F, 0.5F * length_m - 0.35F, 2.42F, 2.78F, 0, white);
    scene.panel_xy(wall, -0.5F * length_m + 0.3F, 0.5F * length_m - 0.3F, 0.36F, 0.6F, 0, black);
    // Windows: one pane each.
    const int panes = 7;
    const bool doors = side > 0;
    for (int i = 0; i < panes; ++i) {
      const float pitch = (length_m - 1.3F) / static_cast<float>(panes);
      const float x0 = -0.5F * length_m + 0.65F + pitch * static_cast<float>(i);
      const bool door = doors && (i == 1 || i == 3 || i == 6);
      const Brush pane = base.lit(glass, scene.add_light(LightClass::window_transport, group));
      scene.panel_xy(wall, x0 + 0.04F, x0 + pitch - 0.04F, door ? 0.45F : 1.2F, 2.38F, 0.012F, pane);
      if (door) scene.panel_xy(wall, x0 + 0.5F * pitch - 0.03F, x0 + 0.5F * pitch + 0.03F, 0.45F, 2.38F, 0.016F, black);
    }
    for (const float axle : {zf - 2.7F, zr + 3.2F}) {
      scene.disc({pose.point({side * (half + 0.006F), 0.5F, axle}), pose.z * -side, pose.y, pose.x * side}, 0.58F, 24,
                 0, black);
      build_wheel(scene, pose, {side * (half - 0.12F), 0.48F, axle}, 0.48F, 0.28F, side, black.material,
                  {0.3F, 0.3F, 0.3F}, 8, base, 28);
    }
  }
  scene.box(pose, {-half + 0.1F, 0.25F, zr + 0.2F}, {half - 0.1F, 0.6F, zf - 0.2F}, black);
  scene.box(pose, {-0.8F, height - 0.02F, -1.5F}, {0.8F, height + 0.22F, 1.2F}, white);

  const Pose rear{pose.point({0, 0, zr - 0.004F}), -pose.x, pose.y, -pose.z};
  const Pose front{pose.point({0, 0, zf + 0.004F}), pose.x, pose.y, pose.z};
  // Rear: window, engine grille, lamps in columns, board with the line number.
  scene.panel_xy(rear, -0.95F, 0.95F, 1.75F, 2.5F, 0,
                 base.lit(glass, scene.add_light(LightClass::window_transport, group)));
  scene.panel_xy(rear, -0.9F, 0.9F, 0.75F, 1.25F, 0, black);
  for (int i = 0; i < 5; ++i) {
    const float y = 0.82F + 0.085F * static_cast<float>(i);
    scene.box(rear, {-0.86F, y, 0}, {0.86F, y + 0.03F, 0.02F}, paint);
  }
  for (const float side : {-1.0F, 1.0F}) {
    const auto lamp = [&](float y, float r, std::uint16_t m, LightClass cls) {
      const Pose q = rear.moved({side * 1.0F, y, 0.012F});
      scene.disc(q, r, 20, 0, base.lit(m, scene.aimed(scene.add_light(cls, group), rear.z, rear.y)));
      scene.disc(rear.moved({side * 1.0F, y, 0.006F}), r + 0.02F, 20, 0, black);
    };
    lamp(1.15F, 0.085F, red, LightClass::moving_rear);
    lamp(0.93F, 0.085F, red, LightClass::moving_rear);
    scene.disc(rear.moved({side * 1.0F, 1.37F, 0.012F}), 0.075F, 20, 0, base.with(amber));
    // Front lamps.
    const std::uint16_t light = scene.aimed(scene.add_light(LightClass::moving_front, group), front.z, front.y);
    scene.disc(front.moved({side * 0.88F, 0.72F, 0.012F}), 0.12F, 20, 0, base.lit(lens, light));
  }
  scene.panel_xy(front, -1.02F, 1.02F, 1.05F, 2.45F, 0,
                 base.lit(glass, scene.add_light(LightClass::window_transport, group)));
  scene.panel_xy(front, -0.85F, 0.85F, 2.52F, 2.82F, 0, black);
  Material number;
  number.kind = Kind::lettering;
  number.base = {0.02F, 0.02F, 0.02F};
  number.second = {0.7F, 0.42F, 0.03F};
  number.variant = 14;
  number.size = {1.0F, 0.22F};
  number.roughness = 0.3F;
  number.frame = rear.moved({0, 2.66F, 0.004F});
  scene.panel_xy(rear, -0.5F, 0.5F, 2.55F, 2.77F, 0.004F, base.with(scene.add(number)));
  Material plate;
  plate.kind = Kind::plate;
  plate.seed = seed;
  plate.frame = rear.moved({0, 0.55F, 0.01F});
  scene.panel_xy(rear, -0.26F, 0.26F, 0.49F, 0.61F, 0.01F, base.with(scene.add(plate)));
  // Mirrors.
  for (const float side : {-1.0F, 1.0F}) {
    scene.bar(pose.point({side * half, 2.5F, zf - 0.1F}), pose.point({side * (half + 0.25F), 2.3F, zf + 0.15F}), 0.02F,
              0.02F, 6, black);
    scene.box(pose, {side * (half + 0.25F) - 0.1F, 1.9F, zf + 0.1F}, {side * (half + 0.25F) + 0.1F, 2.3F, zf + 0.18F},
              black);
  }
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_BUS_HPP
