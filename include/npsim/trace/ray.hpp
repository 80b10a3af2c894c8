// SPDX-License-Identifier: Apache-2.0
// Ray and Hit: what is asked of a ray tracer, and what it answers; the point of a hit, and where to start the next ray.
//
// A ray is the open interval of points origin + t direction with t_min < t < t_max: a surface exactly at either limit
// is not hit. The direction need not be a unit vector; t is in units of its length. A ray with a component that is
// not finite, with a NaN limit or without a direction hits nothing; a negative t_min counts as 0.
//
// A ray that leaves a surface must not meet it again. surface_point() gives the point of a hit with a bound of its
// error, offset_ray_origin() moves it by that, so that no constant has to be chosen and any scale will do (the method
// of Pharr, Jakob and Humphreys, "Physically based rendering", 6.8.6). Per component
//   error = gamma(8) (|wa a| + |u b| + |v c|) + 2^-21 extent:
// the first term covers the barycentric sum, weights included; the second is the error of the next ray's own
// translation and shear at the vertices, whose distance is at most `extent`, the largest component of an edge.
// The origin moves along the unit normal by sum |n_k| error_k, to the side of the new direction, and then by one more
// representable number per axis against rounding of that sum.
#ifndef NPSIM_TRACE_RAY_HPP
#define NPSIM_TRACE_RAY_HPP

#include <cmath>
#include <cstdint>
#include <limits>

#include "npsim/core/config.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/triangle_mesh.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// What Hit::face holds when nothing was hit.
inline constexpr std::uint32_t kNoFace = 0xFFFFFFFFU;

struct Ray {
  Vec3f origin;
  Vec3f direction;
  float t_min = 0.0F;
  float t_max = std::numeric_limits<float>::infinity();
};

// The point is (1 - u - v) a + u b + v c of face `face` (index into the mesh that the tree was built from).
struct Hit {
  float t = std::numeric_limits<float>::infinity();
  std::uint32_t face = kNoFace;
  float u = 0.0F;  // barycentric coordinate of vertex b
  float v = 0.0F;  // barycentric coordinate of vertex c
};

struct SurfacePoint {
  Vec3f position;
  Vec3f error;   // bound of the absolute error of each component of the position
  Vec3f normal;  // unit geometric normal, along cross(b - a, c - a)
};

// n roundings to nearest change a value by a factor within 1 +- rounding_gamma(n).
[[nodiscard]] constexpr float rounding_gamma(int n) noexcept {
  return static_cast<float>(n) * 0x1p-24F / (1.0F - static_cast<float>(n) * 0x1p-24F);
}

[[nodiscard]] inline SurfacePoint surface_point(const TriangleMeshView& mesh, const Hit& hit) noexcept {
  const Face& face = mesh.faces[hit.face];
  const Vec3f a = mesh.vertices[face.a];
  const Vec3f b = mesh.vertices[face.b];
  const Vec3f c = mesh.vertices[face.c];
  const Vec3f wa = a * (1.0F - hit.u - hit.v);
  const Vec3f wb = b * hit.u;
  const Vec3f wc = c * hit.v;
  const auto extent = [](float x, float y, float z) noexcept {
    return std::fmax(x, std::fmax(y, z)) - std::fmin(x, std::fmin(y, z));
  };
  const float edge = std::fmax(extent(a.x, b.x, c.x), std::fmax(extent(a.y, b.y, c.y), extent(a.z, b.z, c.z)));
  const auto error = [edge](float x, float y, float z) noexcept {
    return rounding_gamma(8) * (std::fabs(x) + std::fabs(y) + std::fabs(z)) + 0x1p-21F * edge;
  };
  SurfacePoint out;
  out.position = wa + wb + wc;
  out.error = {error(wa.x, wb.x, wc.x), error(wa.y, wb.y, wc.y), error(wa.z, wb.z, wc.z)};
  // In double: the edges of a needle are nearly parallel, and tiny ones would underflow.
  const Vec3d ad = vec_cast<double>(a);
  out.normal = vec_cast<float>(normalized(cross(vec_cast<double>(b) - ad, vec_cast<double>(c) - ad)));
  return out;
}

// Where to start a ray from `position` (known to within `error` per component) with unit normal `normal` towards
// `direction`.
[[nodiscard]] inline Vec3f offset_ray_origin(const Vec3f& position, const Vec3f& error, const Vec3f& normal,
                                             const Vec3f& direction) noexcept {
  const float distance = std::fabs(normal.x) * error.x + std::fabs(normal.y) * error.y + std::fabs(normal.z) * error.z;
  const float signed_distance = dot(normal, direction) < 0.0F ? -distance : distance;
  const auto moved = [](float from, float by) noexcept {
    const float to = from + by;
    if (by > 0.0F) return std::nextafter(to, std::numeric_limits<float>::infinity());
    if (by < 0.0F) return std::nextafter(to, -std::numeric_limits<float>::infinity());
    return to;
  };
  return {moved(position.x, signed_distance * normal.x), moved(position.y, signed_distance * normal.y),
          moved(position.z, signed_distance * normal.z)};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_RAY_HPP
