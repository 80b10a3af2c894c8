// SPDX-License-Identifier: Apache-2.0
// Points on a surface, and where to start a ray so that it does not meet the surface that it leaves.
//
// The offset comes from a bound of the position's error, not from a constant, so that it works at every scale (the
// method of Pharr, Jakob and Humphreys, "Physically based rendering", 6.8.6). Per component
//   error = gamma(8) (|wa a| + |u b| + |v c|) + 2^-21 extent:
// the first term covers the barycentric sum, weights included; the second is the error of the next ray's own
// translation and shear at the vertices, whose distance is at most `extent`, the largest component of an edge.
// The origin moves along the unit normal by sum |n_k| error_k, to the side of the new direction, and then by one more
// representable number per axis against rounding of that sum.
#ifndef NPSIM_TRACE_SPAWN_HPP
#define NPSIM_TRACE_SPAWN_HPP

#include <cmath>
#include <cstdint>
#include <limits>

#include "npsim/core/config.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/trace/detail/triangle/triangle.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct SurfacePoint {
  Vec3f position;
  Vec3f error;   // bound of the absolute error of each component of the position
  Vec3f normal;  // unit geometric normal, along cross(b - a, c - a)
};


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

#endif  // NPSIM_TRACE_SPAWN_HPP
