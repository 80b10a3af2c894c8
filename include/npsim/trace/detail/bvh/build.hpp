// SPDX-License-Identifier: Apache-2.0
// Builds the bounding volume hierarchy from the top down, wide at once: a node starts with its set of triangles, and
// the child of the largest surface is divided (bvh_split.hpp) until the node is full or every child fits a pack.
//
// Invariants: as in bvh_layout.hpp; the same mesh gives the same tree on every machine. Packs are at least half full on
// average: sets carry a budget of packs, 2 ceil(n / P) for all, and divide it in proportion.
// Left out of the tree, hence never hit: faces with a vertex that is not finite or beyond kTraceMaxCoordinate, and
// faces without area (the cross product of two edges, in double, is exactly zero).
// Cost: O(n log n), about .2 us per face at a million. Memory: bvh_layout.hpp.
#ifndef NPSIM_TRACE_DETAIL_BVH_BUILD_HPP
#define NPSIM_TRACE_DETAIL_BVH_BUILD_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>

#include "npsim/core/config.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/trace/detail/bvh/layout.hpp"
#include "npsim/trace/detail/bvh/split.hpp"
#include "npsim/trace/detail/triangle/triangle.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace bvh_detail {

// False when the face must never be hit.
[[nodiscard]] inline bool corners_of(const TriangleMeshView& mesh, std::uint32_t face, Vec3f (&out)[3]) noexcept {
  const Face& f = mesh.faces[face];
  out[0] = mesh.vertices[f.a];
  out[1] = mesh.vertices[f.b];
  out[2] = mesh.vertices[f.c];
  bool good = true;
  for (const Vec3f& v : out) {
    good = good && std::fabs(v.x) <= kTraceMaxCoordinate && std::fabs(v.y) <= kTraceMaxCoordinate &&
           std::fabs(v.z) <= kTraceMaxCoordinate;  // false for NaN
  }
  if (!good) return false;
  // A cross product in floats errs by less than 2^-20 of its larger product: mostly that is enough to tell.
  const Vec3f e = out[1] - out[0];
  const Vec3f g = out[2] - out[0];
  const float p = e.x * g.y;
  const float q = e.y * g.x;
  const float r = e.y * g.z;
  const float s = e.z * g.y;
  if (std::fabs(p - q) > 0x1p-20F * (std::fabs(p) + std::fabs(q)) + 0x1p-100F) return true;
  if (std::fabs(r - s) > 0x1p-20F * (std::fabs(r) + std::fabs(s)) + 0x1p-100F) return true;
  const Vec3d a = vec_cast<double>(out[0]);
  return cross(vec_cast<double>(out[1]) - a, vec_cast<double>(out[2]) - a) != Vec3d{};
}

// The number of a face as the bits of a finite float, so that arithmetic on its lane does no harm.
inline constexpr std::uint32_t kFaceTag = 0x40000000U;

inline void write_primitive(const Vec3f (&v)[3], std::uint32_t face, BvhPrimitive& out) noexcept {
  const auto least = [](float a, float b, float c) noexcept {
    const float d = a < b ? a : b;
    return d < c ? d : c;
  };
  const std::uint32_t tagged = face | kFaceTag;
  out.box[0] = least(v[0].x, v[1].x, v[2].x);
  out.box[1] = least(v[0].y, v[1].y, v[2].y);
  out.box[2] = least(v[0].z, v[1].z, v[2].z);
  std::memcpy(&out.box[3], &tagged, sizeof tagged);
  out.box[4] = least(-v[0].x, -v[1].x, -v[2].x);
  out.box[5] = least(-v[0].y, -v[1].y, -v[2].y);
  out.box[6] = least(-v[0].z, -v[1].z, -v[2].z);
  out.box[7] = 0.0F;
}

[[nodiscard]] inline std::uint32_t face_of(const BvhPrimitive& p) noexcept {
  std::uint32_t tagged = 0;
  std::memcpy(&tagged, &p.box[3], sizeof tagged);
  return tagged & ~kFaceTag;
}

template <unsigned P>
inline void write_lane(const Vec3f (&v)[3], std::uint32_t face, unsigned lane, TrianglePack<P>& out) noexcept {
  for (int i = 0; i < 3; ++i) {
    out.vertex[i][0][lane] = v[i].x;
    out.vertex[i][1][lane] = v[i].y;
    out.vertex[i][2][lane] = v[i].z;
  }
  out.face[lane] = face;
}

template <unsigned P>
inline void write_pack(const TriangleMeshView& mesh, Span<const BvhPrimitive> primitives,
                       TrianglePack<P>& out) noexcept {
  for (unsigned lane = 0; lane < P; ++lane) {
    const std::uint32_t face = face_of(primitives[lane < primitives.size() ? lane : 0]);
    const Face& f = mesh.faces[face];
    const Vec3f v[3] = {mesh.vertices[f.a], mesh.vertices[f.b], mesh.vertices[f.c]};
    write_lane(v, face, lane, out);
  }
}

// Children of a node; at first the only one is the set itself.
template <unsigned W, unsigned P>
[[nodiscard]] inline unsigned divide_among_children(Span<BvhPrimitive> primitives, BvhSet (&child)[W]) noexcept {
  float area[W];  // 0: fits a pack
  const float scale = area_scale(child[0].box);
  const auto worth = [scale](const BvhSet& set) noexcept {
    return set.count <= P ? 0.0F : half_area(set.box, scale) + 0x1p-60F;
  };
  area[0] = worth(child[0]);
  unsigned count = 1;
  while (count < W) {
    unsigned largest = 0;
    for (unsigned i = 1; i < count; ++i) {
      const bool tie = area[i] == area[largest] && child[i].count > child[largest].count;
      largest = area[i] > area[largest] || tie ? i : largest;
    }
    if (!(area[largest] > 0.0F)) break;
    BvhSet left;
    BvhSet right;
    divide<P>(primitives, child[largest], left, right);
    child[largest] = left;
    child[count] = right;
    area[largest] = worth(left);
    area[count++] = worth(right);
  }
  // Rays that look for any hit go to the last slot first: the largest surface.
  for (unsigned i = 0; i < count; ++i) area[i] = half_area(child[i].box, scale);
  for (unsigned i = 1; i < count; ++i) {
    for (unsigned j = i; j > 0 && area[j] < area[j - 1]; --j) {
      std::swap(child[j], child[j - 1]);
      std::swap(area[j], area[j - 1]);
    }
  }
  return count;
}

struct BvhCounts {
  std::uint32_t nodes = 0;
  std::uint32_t packs = 0;
};

template <unsigned W, unsigned P>
[[nodiscard]] inline BvhCounts build_nodes(const TriangleMeshView& mesh, Span<BvhPrimitive> primitives,
                                           const BvhSet& all, Span<BvhNode<W>> nodes,
                                           Span<TrianglePack<P>> packs) noexcept {
  struct Task {
    std::uint32_t node;
    BvhSet set;
  };
  Task stack[kBvhStack<W>];
  std::size_t stacked = 0;
  BvhCounts used{1, 0};
  stack[stacked++] = Task{0, all};
  while (stacked > 0) {
    --stacked;
    BvhNode<W>& node = nodes[stack[stacked].node];
    BvhSet child[W];
    child[0] = stack[stacked].set;
    const unsigned count = divide_among_children<W, P>(primitives, child);
    node.count = count;
    for (unsigned i = 0; i < W; ++i) {
      const BvhSet& set = child[i < count ? i : 0];
      for (int k = 0; k < 3; ++k) {
        node.bound[k][i] = set.box[k];
        node.bound[k + 3][i] = -set.box[k + 4];
      }
      node.child[i] = 0;
      if (i >= count) continue;
      if (set.count <= P) {
        node.child[i] = used.packs | kBvhLeaf;
        write_pack(mesh, primitives.sub(set.first, set.count), packs[used.packs++]);
      } else {
        node.child[i] = used.nodes++;
      }
    }
    for (unsigned i = count; i-- > 0;) {
      if (child[i].count > P) stack[stacked++] = Task{node.child[i], child[i]};
    }
  }
  return used;
}

// A face that names a vertex that is not there is a status. `all` is the set of those kept.
[[nodiscard]] inline Status list_primitives(const TriangleMeshView& mesh, Span<BvhPrimitive> out,
                                            BvhSet& all) noexcept {
  const std::size_t n = mesh.vertices.size();
  Box box = empty_box();
  Box centroids = empty_box();
  std::uint32_t count = 0;
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    const Face& face = mesh.faces[i];
    if (face.a >= n || face.b >= n || face.c >= n) {
      return Status(StatusCode::invalid_argument, "a face names a vertex that does not exist");
    }
    Vec3f corners[3];
    if (!corners_of(mesh, static_cast<std::uint32_t>(i), corners)) continue;
    BvhPrimitive& primitive = out[count++];
    write_primitive(corners, static_cast<std::uint32_t>(i), primitive);
    box = min(box, load_box(primitive));
    centroids = min(centroids, centroid_of(load_box(primitive)));
  }
  all.count = count;
  box.store(all.box);
  centroids.store(all.centroids);
  return {};
}

}  // namespace bvh_detail

// `out` points into the workspace and stays good as long as those bytes do; the mesh is not needed any more. A mesh
// without a usable face gives a tree that nothing hits. The workspace keeps only what the tree really takes.
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

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_BVH_BUILD_HPP
