// SPDX-License-Identifier: Apache-2.0
// The simple ray tracer that trees are compared with: every face of a mesh in turn. And the meshes to do that on.
#ifndef NPSIM_TESTS_REFERENCE_TRIANGLE_SCAN_HPP
#define NPSIM_TESTS_REFERENCE_TRIANGLE_SCAN_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "npsim/core/random.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/trace/detail/triangle.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim::reference {

struct ScanMesh {
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;

  [[nodiscard]] TriangleMeshView view() const {
    return {{vertices.data(), vertices.size()}, {faces.data(), faces.size()}};
  }
  void add(const Vec3f& a, const Vec3f& b, const Vec3f& c) {
    const auto n = static_cast<std::uint32_t>(vertices.size());
    vertices.insert(vertices.end(), {a, b, c});
    faces.push_back({n, n + 1, n + 2});
  }
};

inline RandomStream stream(std::uint32_t number) { return {7, RandomPurpose::test, 0, 0, number, 0}; }

inline Vec3f in_cube(RandomStream& random, float scale) {
  const float x = random.uniform(-scale, scale);
  const float y = random.uniform(-scale, scale);
  return {x, y, random.uniform(-scale, scale)};
}

// Triangles of `size` in a cube of half side `scale` round `centre`.
inline ScanMesh soup(std::uint32_t faces, float size, float scale, std::uint32_t seed, const Vec3f& centre = {}) {
  ScanMesh mesh;
  for (std::uint32_t i = 0; i < faces; ++i) {
    RandomStream random = stream(seed + i);
    const Vec3f at = centre + in_cube(random, scale);
    const Vec3f a = at + in_cube(random, size * scale);
    const Vec3f b = at + in_cube(random, size * scale);
    mesh.add(a, b, at + in_cube(random, size * scale));
  }
  return mesh;
}

// Coordinates within the limits and an area, in doubles.
inline bool usable(const ScanMesh& mesh, const Face& face) {
  for (const std::uint32_t i : {face.a, face.b, face.c}) {
    const Vec3f& v = mesh.vertices[i];
    if (!(std::fabs(v.x) <= kTraceMaxCoordinate && std::fabs(v.y) <= kTraceMaxCoordinate &&
          std::fabs(v.z) <= kTraceMaxCoordinate)) {
      return false;
    }
  }
  const Vec3d a = vec_cast<double>(mesh.vertices[face.a]);
  return cross(vec_cast<double>(mesh.vertices[face.b]) - a, vec_cast<double>(mesh.vertices[face.c]) - a) != Vec3d{};
}

// `low` and `high` as the tree has them, because the pad of the boxes depends on them.
template <class Accept>
bool scan(const ScanMesh& mesh, const float (&low)[3], const float (&high)[3], const Ray& ray, Accept&& accept,
          Hit& out) {
  RayFrame frame;
  if (!make_ray_frame(ray, low, high, frame)) return false;
  bool found = false;
  for (std::uint32_t i = 0; i < mesh.faces.size(); ++i) {
    const Face& f = mesh.faces[i];
    if (!accept(i) || !usable(mesh, f)) continue;
    float vertex[3][3];
    int corner = 0;
    for (const std::uint32_t v : {f.a, f.b, f.c}) {
      vertex[corner][0] = mesh.vertices[v].x;
      vertex[corner][1] = mesh.vertices[v].y;
      vertex[corner++][2] = mesh.vertices[v].z;
    }
    TriangleHit hit;
    if (!intersect_triangle(frame, vertex, hit) || !(hit.t < frame.t_max)) continue;
    if (found && !(hit.t < out.t)) continue;  // the lowest face of equals comes first
    out = Hit{hit.t, i, hit.u, hit.v};
    found = true;
  }
  return found;
}

inline bool scan(const ScanMesh& mesh, const float (&low)[3], const float (&high)[3], const Ray& ray, Hit& out) {
  return scan(
      mesh, low, high, ray, [](std::uint32_t) { return true; }, out);
}

inline std::uint32_t bits(float x) {
  std::uint32_t out = 0;
  std::memcpy(&out, &x, sizeof out);
  return out;
}

inline bool same(const Hit& a, const Hit& b) {
  return a.face == b.face && bits(a.t) == bits(b.t) && bits(a.u) == bits(b.u) && bits(a.v) == bits(b.v);
}

// Rays of all kinds at a mesh round `centre`: at random, at vertices, from one to another, along axes with zeros and
// denormals, in the plane of a face, along an edge, and with limits exactly at a surface, one number before or behind.
inline Ray hard_ray(const ScanMesh& mesh, std::uint32_t number, float scale, const Vec3f& centre) {
  RandomStream random = stream(500000 + number);
  Ray ray{centre + in_cube(random, 1.5F * scale), in_cube(random, 1.0F)};
  const Face& face = mesh.faces[random.next_u32() % mesh.faces.size()];
  const Vec3f a = mesh.vertices[face.a];
  const Vec3f b = mesh.vertices[face.b];
  const Vec3f c = mesh.vertices[face.c];
  const float tiny[] = {0.0F, -0.0F, 1e-40F, -1e-44F, 1e-30F};
  switch (number % 8) {
    case 1: ray.direction = a - ray.origin; break;
    case 2: ray = {a, b - a}; break;
    case 3: ray.direction = {tiny[number % 5], tiny[number / 8 % 5], number % 16 == 3 ? 1.0F : -1.0F}; break;
    case 4: ray = {a + 3.0F * (a - c), (b - a) + (c - a)}; break;  // about in the plane
    case 5:
      ray.origin = {a.x, a.y, ray.origin.z};
      ray.direction = {0, 0, a.z - ray.origin.z};
      break;  // through a vertex
    case 6: ray.direction = 0.5F * (a + b) - ray.origin; break;
    case 7:
      ray.direction = (1.0F / 3.0F) * (a + b + c) - ray.origin;
      if (number % 3 == 0) ray.t_max = 1.0F;
      if (number % 3 == 1) ray.t_min = 1.0F;
      break;
    default: break;
  }
  return ray;
}

}  // namespace npsim::reference

#endif  // NPSIM_TESTS_REFERENCE_TRIANGLE_SCAN_HPP
