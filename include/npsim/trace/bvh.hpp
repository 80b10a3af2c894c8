// SPDX-License-Identifier: Apache-2.0
// The ray tracer in one include: a bounding volume hierarchy over triangles.
//
//   std::size_t bvh_workspace_bytes(face_count)                          layout   (bvh_layout.hpp)
//   Status build_bvh(TriangleMeshView, Workspace&, Bvh& out)             build    (bvh_build.hpp)
//   Status refit_bvh(TriangleMeshView, Bvh&)                             refit    (bvh_refit.hpp), double bvh_cost(Bvh)
//   Status store_bvh(Bvh, bytes), map_bvh(bytes, face_count, Bvh& out)   check    (bvh_check.hpp), check_bvh()
//   Status make_instance(const Bvh&, AffineTransform, Instance& out)     instance (bvh_instance.hpp)
//   bool closest_hit(const Bvh&, const Ray&, Hit& out)                   traverse (bvh_traverse.hpp)
//   bool occluded(const Bvh&, const Ray&)
//   bool occluded(const Bvh&, const Ray&, accept)                        accept(face) == false: does not block
//   SurfacePoint surface_point(TriangleMeshView, const Hit&)             spawn    (spawn.hpp)
//   Vec3f offset_ray_origin(position, error, normal, direction)
#ifndef NPSIM_TRACE_BVH_HPP
#define NPSIM_TRACE_BVH_HPP

#include "npsim/trace/detail/bvh/build.hpp"
#include "npsim/trace/detail/bvh/check.hpp"
#include "npsim/trace/detail/bvh/instance.hpp"
#include "npsim/trace/detail/bvh/layout.hpp"
#include "npsim/trace/detail/bvh/refit.hpp"
#include "npsim/trace/detail/bvh/traverse.hpp"
#include "npsim/trace/ray.hpp"
#include "npsim/trace/spawn.hpp"

#endif  // NPSIM_TRACE_BVH_HPP
