// SPDX-License-Identifier: Apache-2.0
// What the reference traces: triangles with material, lamps of their true shape, and the sky. Double precision.
//
// Lamps follow light/emitter.hpp and light/photometry.hpp, written again in double. A lamp whose profile is lambert has
// a luminance L: an element dA of its shape sends L cos dA, on its front side only. Any other lamp has an intensity
//   I(direction) = peak * relative intensity,
// which leaves its shape evenly: an element dA sends I dA / A, on both sides, with no cosine but the profile's own.
// A lamp's own faces neither block its light nor receive it: they are its glass.
// Sky: light/light_set.hpp.
#ifndef NPSIM_TESTS_REFERENCE_NIGHT_SCENE_HPP
#define NPSIM_TESTS_REFERENCE_NIGHT_SCENE_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/light/activation.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/light/light_set.hpp"
#include "npsim/light/photometry.hpp"
#include "npsim/material/retroreflection.hpp"
#include "rough_dielectric.hpp"
#include "triangle_tree.hpp"

namespace npsim::reference {

// Of the peak, for a unit direction that leaves the lamp.
[[nodiscard]] inline double relative_intensity_of(EmissionProfile profile, const Vec3d& axis, const Vec3d& up,
                                                  const Vec3d& direction) {
  const double c = dot(axis, direction);
  double value = 0;
  switch (profile) {
    case EmissionProfile::lambert: value = c; break;
    case EmissionProfile::measured: break;  // true lamps are never measured ones
    case EmissionProfile::signal: value = c > 0 ? c * c * c * c : 0.0; break;
    case EmissionProfile::street_luminaire:
    case EmissionProfile::hung_luminaire: {
      constexpr double kGlow = 0.002;
      const double r = dot(up, direction);
      const double s = dot(cross(up, axis), direction);
      const double away = profile == EmissionProfile::hung_luminaire ? std::abs(s) : std::max(-s, 0.0);
      const double cut = c > 0 ? 1 / (1 + std::pow(0.27 / c, 6)) : 0.0;
      value = kGlow + (1 - kGlow) * (1 + 0.8 * r * r * r * r) * (1 - 0.9 * away) * cut / 1.44336;
      break;
    }
    case EmissionProfile::lantern: {
      constexpr double kGlow = 0.01;
      const double r = dot(up, direction);
      value = kGlow + (c > 0 ? (1 - kGlow) * c * (0.5 + 8.0 / 3.0 * r * r * r * r) : 0.0);
      break;
    }
    case EmissionProfile::low_beam:
    case EmissionProfile::low_beam_left:
    case EmissionProfile::high_beam: {
      if (!(c > 0)) break;
      constexpr double kDegree = kPi / 180;
      const double side = profile == EmissionProfile::low_beam_left ? -1.0 : 1.0;
      const double h = side * dot(cross(axis, up), direction) / c;
      const double v = dot(up, direction) / c - 0.01;  // the axis points 1 % below the horizontal
      const double cutoff = std::min(h > 0 ? -0.01 + 0.26794919 * h : -0.01, 0.026);
      const double below = cutoff - v;
      const double x = below / (0.145 * kDegree);
      const double fade = 0.5 + 0.5 * x / std::sqrt(1 + x * x);
      const double depth = std::max(below, 0.0);
      const auto squared = [](double a) { return a * a; };
      const double hot = 1 + squared((h - kDegree) / (4.5 * kDegree)) + squared(depth / (1.9 * kDegree));
      const double wide = 1 + squared(h / (20 * kDegree)) + squared(depth / (6 * kDegree));
      const double cd = (16500 / squared(hot) + 5500 / squared(wide)) * fade + 90 * squared(squared(c));
      value = cd / 20196.7;
      if (profile == EmissionProfile::high_beam) {
        value = (cd + 48000 / squared(1 + squared(h / (7 * kDegree)) + squared(v / (2.5 * kDegree)))) / 62261;
      }
      break;
    }
  }
  return std::clamp(value, 0.0, 1.0);
}

enum class LampShape { triangles, disc, sphere, point };

struct LampTriangle {
  Vec3d a, ab, ac;
  Vec3d normal;           // unit; the front side of a glowing surface
  double area_up_to = 0;  // of this one and those before it
};

struct Lamp {
  EmissionProfile profile = EmissionProfile::lambert;
  Vec3d axis{0, 0, 1};  // unit; also a disc's normal
  Vec3d up{0, -1, 0};
  Vec3d colour{1, 1, 1};       // linear RGB of luminance 1
  double peak_cd = 0;          // of any profile but lambert; of a lambert point
  double luminance_cd_m2 = 0;  // of a lambert shape
  LampShape shape = LampShape::point;
  std::vector<LampTriangle> triangles;
  Vec3d centre;
  double radius = 0;  // of disc and sphere; of triangles: no corner is farther from the centre
  double area_m2 = 0;
  std::uint32_t faces = 0;  // the faces of the scene with this number are its own; 0: none

  void add_triangle(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    const Vec3d n = cross(b - a, c - a);
    const double area = 0.5 * length(n);
    if (!(area > 0)) return;
    shape = LampShape::triangles;
    centre = (centre * area_m2 + (a + b + c) * (area / 3)) / (area_m2 + area);
    area_m2 += area;
    triangles.push_back({a, b - a, c - a, normalized(n), area_m2});
    radius = 0;
    for (const LampTriangle& t : triangles) {
      for (const Vec3d& corner : {t.a, t.a + t.ab, t.a + t.ac}) radius = std::max(radius, length(corner - centre));
    }
  }
  // Front side along cross(half_u, half_v).
  void set_parallelogram(const Vec3d& middle, const Vec3d& half_u, const Vec3d& half_v) {
    const Vec3d low = middle - half_u - half_v;
    const Vec3d high = middle + half_u + half_v;
    add_triangle(low, middle + half_u - half_v, high);
    add_triangle(low, high, middle - half_u + half_v);
  }
  void set_disc(const Vec3d& middle, const Vec3d& normal, double r) {
    shape = LampShape::disc;
    centre = middle;
    axis = normal;
    radius = r;
    area_m2 = kPi * r * r;
  }
  void set_sphere(const Vec3d& middle, double r) {
    shape = LampShape::sphere;
    centre = middle;
    radius = r;
    area_m2 = 4 * kPi * r * r;
  }

  // Uniform over the shape; pick, u, v in [0, 1).
  struct Point {
    Vec3d position;
    Vec3d normal;
  };
  [[nodiscard]] Point sample(double pick, double u, double v) const {
    switch (shape) {
      case LampShape::triangles: {
        const double wanted = pick * area_m2;
        const auto t = std::lower_bound(triangles.begin(), triangles.end() - 1, wanted,
                                        [](const LampTriangle& a, double area) { return a.area_up_to <= area; });
        const double root = std::sqrt(u);
        return {t->a + t->ab * (1 - root) + t->ac * (root * v), t->normal};
      }
      case LampShape::disc: {
        Vec3d s, b;
        complete_frame(axis, s, b);
        const double r = radius * std::sqrt(u);
        return {centre + s * (r * std::cos(2 * kPi * v)) + b * (r * std::sin(2 * kPi * v)), axis};
      }
      case LampShape::sphere: {
        const double z = 1 - 2 * u;
        const double r = std::sqrt(std::max(1 - z * z, 0.0));
        const Vec3d n{r * std::cos(2 * kPi * v), r * std::sin(2 * kPi * v), z};
        return {centre + n * radius, n};
      }
      case LampShape::point: break;
    }
    return {centre, axis};
  }

  // The intensity in cd that the whole lamp would have if all of it were like this point.
  [[nodiscard]] double intensity_cd(const Point& from, const Vec3d& direction) const {
    if (profile == EmissionProfile::lambert && shape != LampShape::point) {
      return luminance_cd_m2 * area_m2 * std::max(dot(from.normal, direction), 0.0);
    }
    return peak_cd * relative_intensity_of(profile, axis, up, direction);
  }
  // No direction has more.
  [[nodiscard]] double strongest_cd() const {
    return profile == EmissionProfile::lambert && shape != LampShape::point ? luminance_cd_m2 * area_m2 : peak_cd;
  }
};

// A lamp of the renderer with a night's peak intensity: its patch is the shape, for a disc one of its area.
[[nodiscard]] inline Lamp lamp_of(const Emitter& e, const Vec3f& intensity_cd) {
  Lamp lamp;
  lamp.profile = e.profile;
  lamp.axis = normalized(vec_cast<double>(e.axis));
  lamp.up = normalized(vec_cast<double>(e.up));
  const double peak = luminance_of(vec_cast<double>(intensity_cd));
  if (peak > 0) lamp.colour = vec_cast<double>(intensity_cd) / peak;
  const double side = e.shape == EmitterShape::disc ? std::sqrt(kPi) / 2 : 1.0;
  const Vec3d u = vec_cast<double>(e.half_u_m) * side;
  Vec3d v = vec_cast<double>(e.half_v_m) * side;
  if (dot(cross(u, v), lamp.axis) < 0) v = -v;
  lamp.set_parallelogram(vec_cast<double>(e.centre_m), u, v);
  if (lamp.shape == LampShape::point) lamp.centre = vec_cast<double>(e.centre_m);
  lamp.peak_cd = peak;
  if (lamp.area_m2 > 0) lamp.luminance_cd_m2 = peak / lamp.area_m2;
  lamp.faces = e.mark;
  return lamp;
}

struct Sky {
  Vec3d zenith_cd_m2;
  Vec3d horizon_cd_m2;
  Vec3d below_cd_m2;  // under the horizon, where a city has none
  Vec3d up{0, -1, 0};

  Sky() = default;
  explicit Sky(const SkyParams& p)
      : zenith_cd_m2(vec_cast<double>(p.zenith_cd_m2)),
        horizon_cd_m2(vec_cast<double>(p.horizon_cd_m2)),
        up(normalized(vec_cast<double>(p.up))) {}
  [[nodiscard]] Vec3d luminance(const Vec3d& direction) const {
    const double s = dot(up, direction);
    if (!(s >= 0)) return below_cd_m2;
    const double t = std::max(1 - s, 0.0);
    return zenith_cd_m2 + (horizon_cd_m2 - zenith_cd_m2) * (t * t * t * t);
  }
};

struct SurfaceMaterial {
  Vec3f albedo;     // linear, 0..1
  float alpha = 1;  // GGX width
};

// A point of the scene, ready to be lit.
struct SurfaceSample {
  Vec3d position;
  Vec3d geometric;  // unit, on the side from which it is looked at
  Vec3d normal;     // unit, for the reflection
  Vec3d albedo;
  double alpha = 1;
  std::uint32_t lamp = 0;     // whose glass it is, 0: nobody's
  Retroreflector retro = {};  // of a point that a pixel shows; what paths reach has none

  // What it retroreflects of light from wi, per illuminance across the beam.
  [[nodiscard]] Vec3d retroreflected(const Vec3d& wo, const Vec3d& wi) const {
    const auto share = static_cast<double>(
        eval_retroreflection(retro.kind, vec_cast<float>(normal), vec_cast<float>(wo), vec_cast<float>(wi)));
    return albedo * (static_cast<double>(retro.strength) * share);
  }
};

// Triangles; each has a material, or each vertex has one and a normal, and both are interpolated.
struct NightScene {
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  std::vector<std::uint32_t> face_material;  // per face, into materials; empty: materials are per vertex
  std::vector<SurfaceMaterial> materials;
  std::vector<Vec3f> vertex_normals;     // per vertex or none. What is met from behind is black, as the back of a
                                         // sheet; without them both sides of a face are alike
  std::vector<std::uint32_t> face_lamp;  // Lamp::faces that each face belongs to; empty: none to any
  std::vector<Lamp> lamps;
  Sky sky;
  double f0 = 0.04;
  bool matt = false;          // every surface reflects albedo / pi and no more
  double clearance_m = 1e-4;  // rays start and end this far from surfaces

  [[nodiscard]] TriangleMeshView mesh() const {
    return {Span<const Vec3f>(vertices.data(), vertices.size()), Span<const Face>(faces.data(), faces.size())};
  }
  [[nodiscard]] std::uint32_t lamp_of_face(std::uint32_t face) const { return face_lamp.empty() ? 0 : face_lamp[face]; }
  [[nodiscard]] RoughDielectric material(const SurfaceSample& at) const {
    return matt || at.alpha > 1 ? RoughDielectric::matt(at.albedo) : RoughDielectric(at.albedo, at.alpha, f0);
  }
  // Unit, along cross(b - a, c - a).
  [[nodiscard]] Vec3d face_normal(std::uint32_t face) const {
    const Face& f = faces[face];
    const Vec3d a = vec_cast<double>(vertices[f.a]);
    return normalized(cross(vec_cast<double>(vertices[f.b]) - a, vec_cast<double>(vertices[f.c]) - a));
  }
};

// The renderer's own scene, to judge its transport alone: a mesh with a material and a normal at each vertex, its lamps
// as patches, and of each face the mark of the lamp that it is part of (render/visibility.hpp). Lamps that are not lit
// are left out. `alpha`, `normal`, `albedo`: one per vertex; `face_mark`: one per face or none.
[[nodiscard]] inline NightScene scene_of_points(const TriangleMeshView& mesh, Span<const Vec3f> normal,
                                                Span<const Vec3f> albedo, Span<const float> alpha,
                                                Span<const std::uint16_t> face_mark, Span<const Emitter> emitters,
                                                Span<const Activation> activations, const SkyParams& sky, float f0) {
  NightScene scene;
  scene.vertices.assign(mesh.vertices.begin(), mesh.vertices.end());
  scene.faces.assign(mesh.faces.begin(), mesh.faces.end());
  scene.vertex_normals.assign(normal.begin(), normal.end());
  scene.face_lamp.assign(face_mark.begin(), face_mark.end());
  for (std::size_t v = 0; v < albedo.size(); ++v) scene.materials.push_back({albedo[v], alpha[v]});
  for (std::size_t e = 0; e < emitters.size(); ++e) {
    if (activations[e].lit) scene.lamps.push_back(lamp_of(emitters[e], activations[e].intensity_cd));
  }
  scene.sky = Sky(sky);
  scene.f0 = static_cast<double>(f0);
  return scene;
}

// What a ray sees at a hit; false where it meets the black back of a sheet.
[[nodiscard]] inline bool surface_at(const NightScene& scene, const RayD& ray, const HitD& hit, SurfaceSample& out) {
  const Face& f = scene.faces[hit.face];
  out.position = ray.origin + ray.direction * hit.t;
  out.geometric = scene.face_normal(hit.face);
  if (dot(out.geometric, ray.direction) > 0) out.geometric = -out.geometric;
  out.normal = out.geometric;
  out.lamp = scene.lamp_of_face(hit.face);
  const double w = 1 - hit.u - hit.v;
  if (!scene.vertex_normals.empty()) {
    const auto of = [&](std::uint32_t v) { return vec_cast<double>(scene.vertex_normals[v]); };
    out.normal = normalized(of(f.a) * w + of(f.b) * hit.u + of(f.c) * hit.v);
    if (!(dot(out.normal, ray.direction) < 0)) return false;
  }
  if (!scene.face_material.empty()) {
    const SurfaceMaterial& m = scene.materials[scene.face_material[hit.face]];
    out.albedo = vec_cast<double>(m.albedo);
    out.alpha = static_cast<double>(m.alpha);
    return true;
  }
  const auto of = [&](std::uint32_t v) -> const SurfaceMaterial& { return scene.materials[v]; };
  out.albedo = vec_cast<double>(of(f.a).albedo) * w + vec_cast<double>(of(f.b).albedo) * hit.u +
               vec_cast<double>(of(f.c).albedo) * hit.v;
  const double alpha[3] = {static_cast<double>(of(f.a).alpha), static_cast<double>(of(f.b).alpha),
                           static_cast<double>(of(f.c).alpha)};
  if (std::max({alpha[0], alpha[1], alpha[2]}) > 1) {  // between a matt surface and another there is none in between
    out.alpha = alpha[w >= hit.u && w >= hit.v ? 0 : (hit.u >= hit.v ? 1 : 2)];
  } else {
    out.alpha = alpha[0] * w + alpha[1] * hit.u + alpha[2] * hit.v;
  }
  return true;
}

}  // namespace npsim::reference

#endif  // NPSIM_TESTS_REFERENCE_NIGHT_SCENE_HPP
