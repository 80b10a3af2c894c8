// SPDX-License-Identifier: Apache-2.0
// What cars and buses share: patches that follow a body, materials in the frame of the vehicle, wheels.
#ifndef NPSIM_SAMPLES_STREET_VEHICLE_PARTS_HPP
#define NPSIM_SAMPLES_STREET_VEHICLE_PARTS_HPP

#include <cmath>
#include <cstdint>

#include "car_shape.hpp"
#include "dice.hpp"
#include "scene.hpp"

namespace npsim {
namespace street {

// A patch that follows the body `lift` metres outside it: u from u0 to u1, heights from lo(t) to hi(t), t in [0, 1].
template <class Lo, class Hi>
void body_patch(Scene& scene, const Pose& pose, const CarShape& c, float u0, float u1, float side, const Lo& lo,
                const Hi& hi, float lift, int nu, int nv, const Brush& brush) {
  scene.grid(
      nu, nv,
      [&](int i, int j) {
        const float t = static_cast<float>(i) / static_cast<float>(nu);
        const float u = mix(u0, u1, t);
        const float y = mix(lo(t), hi(t), static_cast<float>(j) / static_cast<float>(nv));
        const float e = 0.004F;
        const Vec3f p = body_point(c, u, y, side);
        const Vec3f du = body_point(c, u + e, y, side) - body_point(c, u - e, y, side);
        const Vec3f dv = body_point(c, u, y + e, side) - body_point(c, u, y - e, side);
        Vec3f n = normalized(cross(dv, du));
        if (n.x * p.x + n.y * (p.y - 0.6F) + n.z * p.z < 0) n = -n;
        return pose.point(p + n * lift);
      },
      (side > 0) == (u1 > u0), brush);
}

inline std::uint16_t add_vehicle_material(Scene& scene, Kind kind, const Vec3f& base, float roughness, float mirror,
                                          const Pose& frame, std::uint32_t seed, float glow = 0) {
  Material m;
  m.kind = kind;
  m.base = base;
  m.roughness = roughness;
  m.mirror = mirror;
  m.frame = frame;
  m.seed = seed;
  m.glow = glow;
  return scene.add(m);
}

inline void build_wheel(Scene& scene, const Pose& pose, const Vec3f& centre, float radius, float width, float side,
                        std::uint16_t tyre, const Vec3f& rim_colour, int spokes, const Brush& brush, int n) {
  const Brush rubber = brush.with(tyre).smoothed();
  struct Ring {
    float x, r;
  };
  const float h = 0.5F * width;
  const Ring rings[7] = {{-h, radius * 0.62F}, {-h, radius * 0.9F}, {-h * 0.75F, radius},       {h * 0.75F, radius},
                         {h, radius * 0.9F},   {h, radius * 0.64F}, {h - 0.03F, radius * 0.62F}};
  scene.grid(
      n, 6,
      [&](int i, int j) {
        const float a = 2 * kPi * static_cast<float>(i) / static_cast<float>(n);
        const Ring& ring = rings[j];
        return pose.point(centre + Vec3f{side * ring.x, ring.r * std::sin(a), ring.r * std::cos(a)});
      },
      side > 0, rubber);
  Material m;
  m.kind = Kind::rim;
  m.base = rim_colour;
  m.roughness = 0.3F;
  m.mirror = 0.15F;
  m.variant = spokes;
  m.size = {radius * 0.63F, 0};
  const Pose disc{pose.point(centre + Vec3f{side * (h - 0.035F), 0, 0}), pose.z * -side, pose.y, pose.x * side};
  m.frame = {disc.o, pose.x, pose.y, pose.z};
  scene.disc(disc, radius * 0.63F, n, 0, brush.with(scene.add(m)));
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_VEHICLE_PARTS_HPP
