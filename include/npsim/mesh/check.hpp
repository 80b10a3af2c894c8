// SPDX-License-Identifier: Apache-2.0
// What is wrong with a triangle mesh, and what its topology is. Accepts anything, garbage included.
//
// Faces with an index out of range, a repeated index or a vertex that is not finite are counted and then left out of
// the topology, so that the other numbers mean something. An edge is an unordered pair of vertices; two vertices at
// one place are two. A pinched vertex is one whose faces form more than one fan (connected through edges of exactly
// two faces). A component joins faces that share a vertex; a boundary loop is a connected component of boundary edges.
// Euler characteristic = used vertices - edges + faces; a disc has 1, n separate discs n, each hole takes 1 off.
//
// Cost: O(faces log faces), by sorting. Memory: 72 bytes a face, 6 a vertex. Deterministic: counts only.
// A face counts as flat when twice its area, computed in double, is at most 1e-12 of its longest side squared: three
// float points in general position are far above, collinear ones below.
#ifndef NPSIM_MESH_CHECK_HPP
#define NPSIM_MESH_CHECK_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/triangle_mesh.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/mesh/components.hpp"
#include "npsim/simd/isa.hpp"

namespace npsim {
inline namespace v1 {

struct MeshReport {
  std::size_t vertices = 0;
  std::size_t faces = 0;  // all, wrong ones included
  // Wrong in any mesh.
  std::size_t out_of_range_faces = 0;
  std::size_t repeated_index_faces = 0;
  std::size_t not_finite_vertices = 0;
  std::size_t not_finite_faces = 0;
  std::size_t flat_faces = 0;
  std::size_t duplicate_faces = 0;     // same three vertices as an earlier face, in any order
  std::size_t nonmanifold_edges = 0;   // more than two faces
  std::size_t inconsistent_edges = 0;  // two faces that run along it in the same direction
  std::size_t pinched_vertices = 0;
  std::size_t isolated_vertices = 0;  // in no (good) face
  // Topology.
  std::size_t edges = 0;
  std::size_t boundary_edges = 0;
  std::size_t boundary_loops = 0;
  std::size_t components = 0;
  std::int64_t euler_characteristic = 0;

  // Every face is good, and they form oriented manifolds with boundary.
  [[nodiscard]] constexpr bool oriented_manifold() const noexcept {
    return out_of_range_faces == 0 && repeated_index_faces == 0 && not_finite_vertices == 0 && flat_faces == 0 &&
           duplicate_faces == 0 && nonmanifold_edges == 0 && inconsistent_edges == 0 && pinched_vertices == 0;
  }
  [[nodiscard]] constexpr bool watertight() const noexcept {
    return oriented_manifold() && faces > 0 && boundary_edges == 0;
  }
};

namespace check_detail {

struct HalfEdge {
  std::uint32_t low = 0;
  std::uint32_t high = 0;
  std::uint32_t corner = 0;   // 3 face + k; the edge runs from corner k to corner k + 1 of the face
  std::uint32_t forward = 0;  // 1 when it runs from low to high
};

}  // namespace check_detail

[[nodiscard]] constexpr std::size_t check_mesh_workspace_bytes(std::size_t vertices, std::size_t faces) noexcept {
  return allocation_bytes<Face>(faces) + allocation_bytes<check_detail::HalfEdge>(3 * faces) +
         allocation_bytes<std::uint32_t>(3 * faces) + allocation_bytes<std::uint32_t>(vertices) +
         2 * allocation_bytes<std::uint8_t>(vertices) + kWorkspaceAlignment;
}

inline namespace NPSIM_ISA_NAMESPACE {
namespace mesh_detail {

[[nodiscard]] constexpr std::uint32_t next_corner(std::uint32_t corner) noexcept {
  return corner % 3 == 2 ? corner - 2 : corner + 1;
}

[[nodiscard]] inline bool is_flat(const Vec3f& pa, const Vec3f& pb, const Vec3f& pc) noexcept {
  const Vec3d a = vec_cast<double>(pa);
  const Vec3d ab = vec_cast<double>(pb) - a;
  const Vec3d ac = vec_cast<double>(pc) - a;
  const Vec3d bc = ac - ab;
  const double longest = std::max({dot(ab, ab), dot(ac, ac), dot(bc, bc)});
  return !(length(cross(ab, ac)) > 1e-12 * longest);
}

// Copies the good faces to the front of good, counts the others; returns how many are good.
[[nodiscard]] inline std::size_t sort_out_faces(const TriangleMeshView& mesh, Span<Face> good, MeshReport& report) {
  std::size_t n = 0;
  const auto vertices = static_cast<std::uint64_t>(mesh.vertices.size());
  for (const Face& f : mesh.faces) {
    if (f.a >= vertices || f.b >= vertices || f.c >= vertices) {
      ++report.out_of_range_faces;
    } else if (f.a == f.b || f.b == f.c || f.c == f.a) {
      ++report.repeated_index_faces;
    } else if (!is_finite(mesh.vertices[f.a]) || !is_finite(mesh.vertices[f.b]) || !is_finite(mesh.vertices[f.c])) {
      ++report.not_finite_faces;
    } else {
      if (is_flat(mesh.vertices[f.a], mesh.vertices[f.b], mesh.vertices[f.c])) ++report.flat_faces;
      good[n++] = f;
    }
  }
  return n;
}

// Sorts the corners of each face, then the faces: for counting duplicates. Destroys orientation and order.
inline void count_duplicates(Span<Face> faces, MeshReport& report) {
  for (Face& f : faces) {
    if (f.a > f.b) std::swap(f.a, f.b);
    if (f.b > f.c) std::swap(f.b, f.c);
    if (f.a > f.b) std::swap(f.a, f.b);
  }
  const auto less = [](const Face& p, const Face& q) {
    return p.a != q.a ? p.a < q.a : (p.b != q.b ? p.b < q.b : p.c < q.c);
  };
  std::sort(faces.begin(), faces.end(), less);
  for (std::size_t i = 1; i < faces.size(); ++i) {
    if (!less(faces[i - 1], faces[i])) ++report.duplicate_faces;
  }
}

// Number of sets among the marked elements of a union-find forest.
[[nodiscard]] inline std::size_t count_roots(Span<const std::uint32_t> parent, Span<const std::uint8_t> marked) {
  std::size_t n = 0;
  for (std::size_t i = 0; i < parent.size(); ++i) n += marked[i] != 0 && parent[i] == i ? 1U : 0U;
  return n;
}

}  // namespace mesh_detail

[[nodiscard]] inline Status check_mesh(const TriangleMeshView& mesh, Workspace& workspace, MeshReport& report) {
  report = {};
  report.vertices = mesh.vertices.size();
  report.faces = mesh.faces.size();
  if (mesh.faces.size() > 0xFFFFFFFFU / 3 || mesh.vertices.size() > 0xFFFFFFFFU) {
    return {StatusCode::capacity_exceeded, "check_mesh handles up to 2^32 vertices and 2^32 / 3 faces"};
  }
  const WorkspaceScope scope(workspace);
  Span<Face> faces;
  Span<check_detail::HalfEdge> half_edges;
  Span<std::uint32_t> fan;      // union-find over face corners
  Span<std::uint32_t> cluster;  // union-find over vertices
  Span<std::uint8_t> used;
  Span<std::uint8_t> mark;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(mesh.faces.size(), faces));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(3 * mesh.faces.size(), half_edges));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(3 * mesh.faces.size(), fan));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(mesh.vertices.size(), cluster));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(mesh.vertices.size(), used));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(mesh.vertices.size(), mark));

  for (const Vec3f& v : mesh.vertices) report.not_finite_vertices += is_finite(v) ? 0U : 1U;
  const std::size_t good = mesh_detail::sort_out_faces(mesh, faces, report);
  faces = Span<Face>(faces.data(), good);
  half_edges = Span<check_detail::HalfEdge>(half_edges.data(), 3 * good);
  fan = Span<std::uint32_t>(fan.data(), 3 * good);
  for (std::size_t i = 0; i < cluster.size(); ++i) cluster[i] = static_cast<std::uint32_t>(i);
  std::fill(used.begin(), used.end(), std::uint8_t{0});
  std::fill(mark.begin(), mark.end(), std::uint8_t{0});

  const auto vertex_of = [&faces](std::uint32_t corner) {
    const Face& f = faces[corner / 3];
    return corner % 3 == 0 ? f.a : (corner % 3 == 1 ? f.b : f.c);
  };
  for (std::uint32_t corner = 0; corner < fan.size(); ++corner) {
    const std::uint32_t from = vertex_of(corner);
    const std::uint32_t to = vertex_of(mesh_detail::next_corner(corner));
    half_edges[corner] = {std::min(from, to), std::max(from, to), corner, from < to ? 1U : 0U};
    fan[corner] = corner;
    used[from] = 1;
    mesh_detail::unite(cluster, from, to);
  }
  report.components = mesh_detail::count_roots(cluster, used);
  std::size_t used_vertices = 0;
  for (const std::uint8_t u : used) used_vertices += u;
  report.isolated_vertices = mesh.vertices.size() - used_vertices;

  std::sort(half_edges.begin(), half_edges.end(), [](const auto& p, const auto& q) {
    return p.low != q.low ? p.low < q.low : (p.high != q.high ? p.high < q.high : p.corner < q.corner);
  });
  for (std::size_t i = 0; i < cluster.size(); ++i) cluster[i] = static_cast<std::uint32_t>(i);
  for (std::size_t i = 0; i < half_edges.size();) {
    const check_detail::HalfEdge& e = half_edges[i];
    std::size_t end = i + 1;
    while (end < half_edges.size() && half_edges[end].low == e.low && half_edges[end].high == e.high) ++end;
    ++report.edges;
    if (end - i == 1) {
      ++report.boundary_edges;
      mark[e.low] = mark[e.high] = 1;
      mesh_detail::unite(cluster, e.low, e.high);
    } else if (end - i == 2) {
      const check_detail::HalfEdge& o = half_edges[i + 1];
      const std::uint32_t e_next = mesh_detail::next_corner(e.corner);
      const std::uint32_t o_next = mesh_detail::next_corner(o.corner);
      if (e.forward == o.forward) ++report.inconsistent_edges;
      mesh_detail::unite(fan, e.corner, e.forward == o.forward ? o.corner : o_next);
      mesh_detail::unite(fan, e_next, e.forward == o.forward ? o_next : o.corner);
    } else {
      ++report.nonmanifold_edges;
    }
    i = end;
  }
  report.boundary_loops = mesh_detail::count_roots(cluster, mark);
  report.euler_characteristic = static_cast<std::int64_t>(used_vertices) - static_cast<std::int64_t>(report.edges) +
                                static_cast<std::int64_t>(good);

  std::fill(mark.begin(), mark.end(), std::uint8_t{0});  // fans seen at a vertex: 0, 1, 2 = more
  for (std::uint32_t corner = 0; corner < fan.size(); ++corner) {
    std::uint8_t& fans = mark[vertex_of(corner)];
    if (fan[corner] != corner || fans == 2) continue;
    if (++fans == 2) ++report.pinched_vertices;
  }
  mesh_detail::count_duplicates(faces, report);
  return {};
}

}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_MESH_CHECK_HPP
