// SPDX-License-Identifier: Apache-2.0
// The ray tracer for any mesh: a bounding volume hierarchy over its triangles. Layers over the pixel grid have a faster
// one of their own (sheet.hpp).
//
//   Bvh                                         the tree: views into the workspace; without nodes nothing is ever hit
//   bvh_workspace_bytes(face_count)             what building takes at most
//   build_bvh(mesh, workspace, out)             makes the tree
//   closest_hit(bvh, ray, hit)                  the nearest face
//   occluded(bvh, ray), (bvh, ray, accept)      whether any face, or any face with accept(face), lies on the ray
//   closest_hits(bvh, rays, hits, active)       the same of many rays
//   occluded(bvh, rays, accept, blocked, active)
//   surface_point(mesh, hit), offset_ray_origin(...)    where the next ray starts (ray.hpp)
//
// Invariants: the same mesh gives the same tree on every machine, and an answer is that of testing every usable face in
// turn, bit for bit (detail/triangle.hpp has the test and its error). Of several faces at the same t the lowest is
// reported, so the answer depends neither on the order of traversal nor on the shape of the tree.
//
// Never hit: faces with a vertex that is not finite or beyond 2^60 m, and faces without area (the cross product of two
// edges, in double, is exactly zero).
//
// Cost: building .2 us a face at a million faces; rays: docs/rays.md. Memory: about 55 bytes a face, 7.7 KB of stack
// a ray.
#ifndef NPSIM_TRACE_BVH_HPP
#define NPSIM_TRACE_BVH_HPP

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "npsim/core/bits.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/trace/detail/bvh/build.hpp"
#include "npsim/trace/detail/bvh/traverse.hpp"
#include "npsim/trace/detail/triangle.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Enough for build_bvh(). The workspace keeps only what the tree really takes, about half of it.
[[nodiscard]] constexpr std::size_t bvh_workspace_bytes(std::size_t face_count) noexcept {
  return wide_bvh_workspace_bytes<kBvhWidth, kBvhPack>(face_count);
}

// `out` points into the workspace and stays good as long as those bytes do; the mesh is not needed any more. A mesh
// without a usable face gives a tree that nothing hits. 2^29 faces or more, a workspace that is too small, or a face
// that names a vertex that is not there give a Status.
template <unsigned W, unsigned P>
[[nodiscard]] Status build_bvh(TriangleMeshView mesh, Workspace& workspace, WideBvh<W, P>& out) noexcept {
  out = WideBvh<W, P>{};
  const std::size_t face_count = mesh.faces.size();
  if (face_count >= kBvhMaxFaces) {
    return Status(StatusCode::capacity_exceeded, "a ray tracer takes fewer than 2^29 faces");
  }
  Span<TrianglePack<P>> packs;
  Span<BvhNode<W>> nodes;
  bvh_detail::BvhSet all;
  bvh_detail::BvhCounts used;
  {
    const WorkspaceScope scope(workspace);
    Span<BvhPrimitive> primitives;
    NPSIM_RETURN_IF_ERROR(workspace.allocate(bvh_max_packs<P>(face_count), packs));
    NPSIM_RETURN_IF_ERROR(workspace.allocate(bvh_max_nodes<W, P>(face_count), nodes));
    NPSIM_RETURN_IF_ERROR(workspace.allocate(face_count, primitives));
    NPSIM_RETURN_IF_ERROR(bvh_detail::list_primitives(mesh, primitives, all));
    if (all.count == 0) return {};
    all.budget = static_cast<std::uint32_t>(bvh_max_packs<P>(all.count));
    used = bvh_detail::build_nodes(mesh, primitives.sub(0, all.count), all, nodes, packs);
  }
  // The packs stay where they are, the nodes move up to them.
  const BvhNode<W>* const built = nodes.data();
  NPSIM_RETURN_IF_ERROR(workspace.allocate(used.packs, packs));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(used.nodes, nodes));
  std::memmove(nodes.data(), built, nodes.size() * sizeof(BvhNode<W>));
  out.nodes = nodes;
  out.packs = packs;
  for (int k = 0; k < 3; ++k) {
    out.low[k] = all.box[k];
    out.high[k] = -all.box[k + 4];
  }
  return {};
}

// The nearest face that the ray meets; `out` is written only when there is one.
template <unsigned W, unsigned P>
[[nodiscard]] bool closest_hit(const WideBvh<W, P>& bvh, const Ray& ray, Hit& out) noexcept {
  RayFrame frame;
  if (bvh.nodes.empty() || !make_ray_frame(ray, bvh.low, bvh.high, frame)) return false;
  Hit best;
  best.t = frame.t_max;
  bvh_detail::traverse<true>(bvh, frame, [&frame, &best, &bvh](std::uint32_t index) noexcept {
    const TrianglePack<P>& pack = bvh.packs[index];
    alignas(64) PackHit<P> hit;
    for (std::uint32_t lanes = intersect_pack(frame, pack, best.t, hit); lanes != 0; lanes &= lanes - 1) {
      const int i = lowest_set_bit(lanes);
      // At t == t_max there is no hit yet, and best.face is still kNoFace: the interval is open.
      const bool tie = hit.t[i] == best.t && best.face != kNoFace && pack.face[i] < best.face;
      if (hit.t[i] < best.t || tie) best = Hit{hit.t[i], pack.face[i], hit.u[i], hit.v[i]};
    }
    return best.t;
  });
  if (best.face == kNoFace) return false;
  out = best;
  return true;
}

// Whether some face with accept(face) lies on the ray; the others are transparent. `likely`, a position in bvh.packs
// or kNoFace, is tried first, and becomes the pack with the triangle that was met: what shadows one point mostly
// shadows its neighbour too. It never changes the answer.
template <unsigned W, unsigned P, class Accept>
[[nodiscard]] bool occluded(const WideBvh<W, P>& bvh, const Ray& ray, Accept&& accept, std::uint32_t& likely) noexcept {
  RayFrame frame;
  if (bvh.nodes.empty() || !make_ray_frame(ray, bvh.low, bvh.high, frame)) return false;
  const auto blocks = [&frame, &accept](const TrianglePack<P>& pack) noexcept {
    return pack_blocks(frame, pack, accept);
  };
  if (likely < bvh.packs.size() && blocks(bvh.packs[likely])) return true;
  bool found = false;
  bvh_detail::traverse<false>(bvh, frame, [&](std::uint32_t index) noexcept {
    if (!blocks(bvh.packs[index])) return frame.t_max;
    likely = index;
    found = true;
    return -1.0F;
  });
  return found;
}

template <unsigned W, unsigned P, class Accept>
[[nodiscard]] bool occluded(const WideBvh<W, P>& bvh, const Ray& ray, Accept&& accept) noexcept {
  std::uint32_t none = kNoFace;
  return occluded(bvh, ray, accept, none);
}

template <unsigned W, unsigned P>
[[nodiscard]] bool occluded(const WideBvh<W, P>& bvh, const Ray& ray) noexcept {
  return occluded(bvh, ray, [](std::uint32_t) noexcept { return true; });
}

// hits[i]: the nearest face that ray i meets, a Hit without a face where there is none. `active`: where it is 0 the ray
// is left out and its answer stays as it is; empty: all are traced.
inline void closest_hits(const Bvh& bvh, Span<const Ray> rays, Span<Hit> hits,
                         Span<const std::uint8_t> active = {}) noexcept {
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (!active.empty() && active[i] == 0) continue;
    hits[i] = Hit{};
    static_cast<void>(closest_hit(bvh, rays[i], hits[i]));
  }
}

// blocked[i]: 1 where some face with accept(face) lies on ray i, else 0. What shadowed the last ray is tried first.
template <class Accept>
void occluded(const Bvh& bvh, Span<const Ray> rays, Accept&& accept, Span<std::uint8_t> blocked,
              Span<const std::uint8_t> active = {}) noexcept {
  std::uint32_t likely = kNoFace;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (!active.empty() && active[i] == 0) continue;
    blocked[i] = occluded(bvh, rays[i], accept, likely) ? 1 : 0;
  }
}

[[nodiscard]] inline bool is_empty(const Bvh& bvh) noexcept { return bvh.nodes.empty(); }

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_BVH_HPP
