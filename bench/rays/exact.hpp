// SPDX-License-Identifier: Apache-2.0
// Rays and triangles in double precision, face by face: what decides between two tracers that disagree.
//
// A tracer in floats may move a vertex by `slack` = 2^-21 of the ray's reach across the ray (triangle.hpp), no more. So
//   surely hit    the ray passes farther than `slack` inside the face's outline;
//   wrong         a face reported that the ray passes farther than `slack` outside of, a t farther from the plane's
//   than
//                 slack / cosine, or any face surely hit that is nearer by more than both bounds of t together.
// What is neither surely hit nor surely missed may be reported either way. Products of differences of floats have a
// relative error of about 1e-15 here, far below the slack of 5e-7.
#ifndef NPSIM_BENCH_RAYS_EXACT_HPP
#define NPSIM_BENCH_RAYS_EXACT_HPP

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim::bench {

struct ExactRay {
  Vec3d origin;
  Vec3d unit;
  double size;  // of the direction
  double slack;
  double t_min, t_max;
};

struct ExactFace {
  double t;       // where the ray meets the plane
  double inside;  // distance from the nearest edge as seen along the ray, m; negative outside
  double bound;   // of t
};

enum class Verdict { right, leak, ghost, not_nearest, other_face, distance };

[[nodiscard]] inline Vec3d corner(const TriangleMeshView& mesh, std::uint32_t v) {
  return vec_cast<double>(mesh.vertices[v]);
}

// `reach`: the greatest component of anything that the ray may hit, seen from its origin.
[[nodiscard]] inline ExactRay exact_ray(const Ray& ray, double reach) {
  const Vec3d d = vec_cast<double>(ray.direction);
  const double size = length(d);
  return {vec_cast<double>(ray.origin),  d / size, size, 0x1p-21 * reach, static_cast<double>(ray.t_min),
          static_cast<double>(ray.t_max)};
}

[[nodiscard]] inline ExactFace exact_face(const TriangleMeshView& mesh, const Face& face, const ExactRay& ray) {
  const Vec3d p[3] = {corner(mesh, face.a) - ray.origin, corner(mesh, face.b) - ray.origin,
                      corner(mesh, face.c) - ray.origin};
  Vec3d q[3];  // across the ray
  for (int i = 0; i < 3; ++i) q[i] = p[i] - ray.unit * dot(p[i], ray.unit);
  double distance[3];
  double extent = 0;
  for (int i = 0; i < 3; ++i) {
    const Vec3d& a = q[(i + 1) % 3];
    const Vec3d& b = q[(i + 2) % 3];
    distance[i] = dot(ray.unit, cross(a, b)) / std::max(length(b - a), 1e-300);
    extent = std::max(extent, length(p[(i + 1) % 3] - p[i]));
  }
  const double least = std::min({distance[0], distance[1], distance[2]});
  const double greatest = std::max({distance[0], distance[1], distance[2]});
  const Vec3d n = cross(p[1] - p[0], p[2] - p[0]);
  const double along = dot(n, ray.unit);
  ExactFace out;
  out.t = dot(n, p[0]) / along / ray.size;
  out.inside = std::max(least, -greatest);
  const double cosine = std::fabs(along) / std::max(length(n), 1e-300);
  // The reported point lies in the face's box, so its t is no farther off than the face is long.
  out.bound = std::min(ray.slack / cosine, extent + ray.slack) / ray.size + 0x1p-23 * std::fabs(out.t);
  if (!(std::fabs(along) > 0)) {  // in its plane
    out.t = dot(p[0], ray.unit) / ray.size;
    out.bound = (extent + ray.slack) / ray.size;
  }
  return out;
}

// What a test of all faces says of a reported hit (hit.face an index into the mesh, or kNoFace).
[[nodiscard]] inline Verdict judge(const TriangleMeshView& mesh, const ExactRay& ray, const Hit& hit) {
  double t = std::numeric_limits<double>::infinity();
  double bound = 0;
  if (hit.face != kNoFace) {
    const ExactFace f = exact_face(mesh, mesh.faces[hit.face], ray);
    if (f.inside < -ray.slack) return Verdict::ghost;
    t = static_cast<double>(hit.t);
    bound = f.bound;
    if (std::fabs(t - f.t) > bound) return Verdict::distance;
  }
  for (const Face& face : mesh.faces) {
    const ExactFace f = exact_face(mesh, face, ray);
    if (!(f.inside > ray.slack) || !(f.t - f.bound > ray.t_min) || !(f.t + f.bound < ray.t_max)) continue;
    if (hit.face == kNoFace) return Verdict::leak;
    if (f.t + f.bound < t - bound) return Verdict::not_nearest;
  }
  return Verdict::right;
}

// How often the closed surface winds round the point: the sum of the solid angles of its faces (van Oosterom and
// Strackee), which for a point off the surface is a whole number.
[[nodiscard]] inline double winding(const TriangleMeshView& mesh, const Vec3d& at) {
  double sum = 0;
  for (const Face& f : mesh.faces) {
    const Vec3d a = corner(mesh, f.a) - at;
    const Vec3d b = corner(mesh, f.b) - at;
    const Vec3d c = corner(mesh, f.c) - at;
    const double la = length(a);
    const double lb = length(b);
    const double lc = length(c);
    sum += std::atan2(dot(a, cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
  }
  return sum / (2 * std::acos(-1.0));
}

// The distance from the nearest vertex or plane point of a face, from below: good enough to keep points off a surface.
[[nodiscard]] inline double clearance(const TriangleMeshView& mesh, const Vec3d& at) {
  double least = std::numeric_limits<double>::infinity();
  for (const Face& f : mesh.faces) {
    const Vec3d p[3] = {corner(mesh, f.a) - at, corner(mesh, f.b) - at, corner(mesh, f.c) - at};
    const double edge = std::max({length(p[1] - p[0]), length(p[2] - p[1]), length(p[0] - p[2])});
    least = std::min(least, std::min({length(p[0]), length(p[1]), length(p[2])}) - edge);
  }
  return std::max(least, 0.0);
}

}  // namespace npsim::bench

#endif  // NPSIM_BENCH_RAYS_EXACT_HPP
