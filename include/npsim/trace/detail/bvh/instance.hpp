// SPDX-License-Identifier: Apache-2.0
// A tree in another place: an affine transform in front of any structure that rays are traced through.
//
// The ray goes into the object's frame and keeps its t, because its direction is not made a unit vector again; faces
// and barycentric coordinates are the object's. Invariant: what is hit is decided exactly for the ray as it was
// transformed, so an instance is as tight as its tree. Error: with x the ray's origin in the world, M and c the
// inverse, u = 2^-24, gamma(n) = n u / (1 - n u): the transformed origin errs by at most gamma(5) (|M| |x| + |c|) per
// component, the direction by gamma(4) |M| |d|, the rounding of M and c included. surface_point() bounds the error of a
// point in the world with all of that, so that a ray that leaves it does not meet the face it left. Limits: transforms
// with condition |A| |A^-1| up to 1e6 in the norm of row sums.
#ifndef NPSIM_TRACE_DETAIL_BVH_INSTANCE_HPP
#define NPSIM_TRACE_DETAIL_BVH_INSTANCE_HPP

#include <cmath>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/trace/detail/triangle/triangle.hpp"
#include "npsim/trace/ray.hpp"
#include "npsim/trace/spawn.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// x -> (row . x) + offset for each of the rows.
struct AffineTransform {
  Vec3f row[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  Vec3f offset;
};

template <class Tree>
struct Instance {
  Tree tree;
  AffineTransform to_world;
  AffineTransform to_object;
  bool mirrored = false;
};


[[nodiscard]] inline Vec3f linear_part(const AffineTransform& a, const Vec3f& v) noexcept {
  return {dot(a.row[0], v), dot(a.row[1], v), dot(a.row[2], v)};
}
[[nodiscard]] inline Vec3f transform_point(const AffineTransform& a, const Vec3f& p) noexcept {
  return linear_part(a, p) + a.offset;
}

namespace bvh_detail {

[[nodiscard]] inline Vec3f absolute(const Vec3f& v) noexcept {
  return {std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)};
}

// |A| |p| + |offset| per component.
[[nodiscard]] inline Vec3f magnitudes(const AffineTransform& a, const Vec3f& p) noexcept {
  const Vec3f q = absolute(p);
  return Vec3f{dot(absolute(a.row[0]), q), dot(absolute(a.row[1]), q), dot(absolute(a.row[2]), q)} + absolute(a.offset);
}

}  // namespace bvh_detail

// Puts a tree into the world. A transform that is not finite or nearly flattens is a status.
template <class Tree>
[[nodiscard]] Status make_instance(const Tree& tree, const AffineTransform& to_world, Instance<Tree>& out) noexcept {
  const Vec3d a = vec_cast<double>(to_world.row[0]);
  const Vec3d b = vec_cast<double>(to_world.row[1]);
  const Vec3d c = vec_cast<double>(to_world.row[2]);
  const Vec3d offset = vec_cast<double>(to_world.offset);
  const Vec3d column[3] = {cross(b, c), cross(c, a), cross(a, b)};  // of the inverse, times the determinant
  const double determinant = dot(a, column[0]);
  double norm = 0.0;
  double inverse_norm = 0.0;
  const auto row_sum = [](double x, double y, double z) noexcept { return std::fabs(x) + std::fabs(y) + std::fabs(z); };
  for (const Vec3d& r : {a, b, c}) norm = std::fmax(norm, row_sum(r.x, r.y, r.z));
  const Vec3d rows[3] = {Vec3d{column[0].x, column[1].x, column[2].x} / determinant,
                         Vec3d{column[0].y, column[1].y, column[2].y} / determinant,
                         Vec3d{column[0].z, column[1].z, column[2].z} / determinant};
  for (const Vec3d& r : rows) inverse_norm = std::fmax(inverse_norm, row_sum(r.x, r.y, r.z));
  const bool finite = is_finite(to_world.row[0]) && is_finite(to_world.row[1]) && is_finite(to_world.row[2]) &&
                      is_finite(to_world.offset) && is_finite(rows[0]) && is_finite(rows[1]) && is_finite(rows[2]);
  if (!finite || !(norm * inverse_norm <= 1e6)) {
    return Status(StatusCode::invalid_argument, "instance: the transform is not finite or has no good inverse");
  }
  out.tree = tree;
  out.to_world = to_world;
  for (int i = 0; i < 3; ++i) out.to_object.row[i] = vec_cast<float>(rows[i]);
  out.to_object.offset = vec_cast<float>(Vec3d{-dot(rows[0], offset), -dot(rows[1], offset), -dot(rows[2], offset)});
  out.mirrored = determinant < 0.0;
  return {};
}

template <class Tree>
[[nodiscard]] Ray ray_in_object(const Instance<Tree>& instance, const Ray& ray) noexcept {
  return {transform_point(instance.to_object, ray.origin), linear_part(instance.to_object, ray.direction), ray.t_min,
          ray.t_max};
}

template <class Tree>
[[nodiscard]] bool closest_hit(const Instance<Tree>& instance, const Ray& ray, Hit& out) noexcept {
  return closest_hit(instance.tree, ray_in_object(instance, ray), out);
}

template <class Tree, class... More>  // as of the tree: accept, and what is likely
[[nodiscard]] bool occluded(const Instance<Tree>& instance, const Ray& ray, More&&... more) noexcept {
  return occluded(instance.tree, ray_in_object(instance, ray), more...);
}

// The point of a hit, its error and normal in the world; `mesh` is the object's.
template <class Tree>
[[nodiscard]] SurfacePoint surface_point(const Instance<Tree>& instance, const TriangleMeshView& mesh,
                                         const Hit& hit) noexcept {
  const SurfacePoint p = surface_point(mesh, hit);
  const AffineTransform& to_world = instance.to_world;
  const AffineTransform& to_object = instance.to_object;
  SurfacePoint out;
  out.position = transform_point(to_world, p.position);
  // The object's error and that of going back there, both taken to the world, and the rounding of the position.
  const Vec3f back = rounding_gamma(5) * bvh_detail::magnitudes(to_object, out.position);
  const AffineTransform no_offset{{to_world.row[0], to_world.row[1], to_world.row[2]}, {}};
  out.error = bvh_detail::magnitudes(no_offset, p.error + back) * (1.0F + rounding_gamma(8)) +
              rounding_gamma(4) * bvh_detail::magnitudes(to_world, p.position);
  const auto& m = to_object.row;
  const Vec3f n = m[0] * p.normal.x + m[1] * p.normal.y + m[2] * p.normal.z;  // the transposed inverse
  const Vec3d unit = normalized(vec_cast<double>(n));
  out.normal = vec_cast<float>(instance.mirrored ? -unit : unit);
  return out;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_BVH_INSTANCE_HPP
