// SPDX-License-Identifier: Apache-2.0
// Builds the bounding volume hierarchy from the top down, with the surface area heuristic over binned centroids
// (Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007).
//
// Invariants: as in bvh_layout.hpp; the same mesh gives the same tree. Depth: a node at depth d with n triangles
// always satisfies d + ceil(log2 n) <= kBvhMaxDepth, because a split that would break this is replaced by one into
// halves, which keeps it; the explicit stack is bounded by the same number.
// Left out of the tree, hence never hit: faces with a vertex that is not finite or beyond kTraceMaxCoordinate, and
// faces without area (the cross product of two edges, in double, is exactly zero).
// Cost: O(n log n), about .8 us per face at two million. Memory: bvh_layout.hpp.
#ifndef NPSIM_TRACE_BUILD_HPP
#define NPSIM_TRACE_BUILD_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/status.hpp"
#include "npsim/core/triangle_mesh.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/simd/isa.hpp"
#include "npsim/trace/bvh_layout.hpp"
#include "npsim/trace/triangle.hpp"

namespace npsim {
inline namespace v1 {

inline constexpr int kBvhBins = 16;
inline constexpr std::uint32_t kBvhMaxLeaf = 8;  // larger sets are always split
// The cost of visiting an inner node, in triangle tests.
inline constexpr double kBvhVisitCost = 1.0;

inline namespace NPSIM_ISA_NAMESPACE {
namespace bvh_detail {

struct Box {
  float low[3] = {std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity(),
                  std::numeric_limits<float>::infinity()};
  float high[3] = {-std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity(),
                   -std::numeric_limits<float>::infinity()};

  void grow(const float (&other_low)[3], const float (&other_high)[3]) noexcept {
    for (int k = 0; k < 3; ++k) {
      low[k] = other_low[k] < low[k] ? other_low[k] : low[k];
      high[k] = other_high[k] > high[k] ? other_high[k] : high[k];
    }
  }
  // Half the surface, in double: neither the largest nor the smallest extents overflow or underflow.
  [[nodiscard]] double half_area() const noexcept {
    const double x = static_cast<double>(high[0]) - static_cast<double>(low[0]);
    const double y = static_cast<double>(high[1]) - static_cast<double>(low[1]);
    const double z = static_cast<double>(high[2]) - static_cast<double>(low[2]);
    return x * y + y * z + z * x;
  }
};

struct Bin {
  Box box;
  std::uint32_t count = 0;
};

// A plane between two bins of one axis: primitives with bin_of() < bin go left.
struct Split {
  double cost = std::numeric_limits<double>::infinity();  // in units of half area times triangle tests
  int axis = -1;                                          // -1: no plane separates the centroids
  int bin = 0;
  std::uint32_t left_count = 0;
};

// Maps centroids to bins. The extent may be 0 or tiny: then the axis is not usable.
struct BinMap {
  float start[3];
  float scale[3];
  bool usable[3];

  [[nodiscard]] int bin_of(const BvhPrimitive& primitive, int k) const noexcept {
    const float centroid = 0.5F * primitive.low[k] + 0.5F * primitive.high[k];
    const int bin = static_cast<int>((centroid - start[k]) * scale[k]);
    return bin < kBvhBins - 1 ? bin : kBvhBins - 1;
  }
};

[[nodiscard]] inline int ceil_log2(std::uint32_t n) noexcept {
  int bits = 0;
  while ((std::uint64_t{1} << bits) < n) ++bits;
  return bits;
}

// False when the face must not enter the tree.
[[nodiscard]] inline bool triangle_of(const TriangleMeshView& mesh, std::uint32_t face, BvhTriangle& out) noexcept {
  const Face& f = mesh.faces[face];
  const Vec3f corners[3] = {mesh.vertices[f.a], mesh.vertices[f.b], mesh.vertices[f.c]};
  bool good = true;
  for (int i = 0; i < 3; ++i) {
    const float xyz[3] = {corners[i].x, corners[i].y, corners[i].z};
    for (int k = 0; k < 3; ++k) {
      good = good && std::fabs(xyz[k]) <= kTraceMaxCoordinate;  // false for NaN
      out.vertex[i][k] = xyz[k];
    }
  }
  out.face = face;
  if (!good) return false;
  const Vec3d a = vec_cast<double>(corners[0]);
  return cross(vec_cast<double>(corners[1]) - a, vec_cast<double>(corners[2]) - a) != Vec3d{};
}

[[nodiscard]] inline BinMap bin_map(Span<const BvhPrimitive> primitives) noexcept {
  Box centroids;
  for (const BvhPrimitive& primitive : primitives) {
    float centroid[3];
    for (int k = 0; k < 3; ++k) centroid[k] = 0.5F * primitive.low[k] + 0.5F * primitive.high[k];
    centroids.grow(centroid, centroid);
  }
  BinMap map{};
  for (int k = 0; k < 3; ++k) {
    map.start[k] = centroids.low[k];
    map.scale[k] = static_cast<float>(kBvhBins) / (centroids.high[k] - centroids.low[k]);
    map.usable[k] = centroids.high[k] > centroids.low[k] && map.scale[k] <= std::numeric_limits<float>::max();
  }
  return map;
}

[[nodiscard]] inline Split best_split(Span<const BvhPrimitive> primitives, const BinMap& map) noexcept {
  Bin bins[3][kBvhBins];
  for (const BvhPrimitive& primitive : primitives) {
    for (int k = 0; k < 3; ++k) {
      if (!map.usable[k]) continue;
      Bin& bin = bins[k][map.bin_of(primitive, k)];
      bin.box.grow(primitive.low, primitive.high);
      ++bin.count;
    }
  }
  Split best;
  for (int k = 0; k < 3; ++k) {
    if (!map.usable[k]) continue;
    double cost_right[kBvhBins];  // of everything from this bin on
    Bin right;
    for (int i = kBvhBins - 1; i > 0; --i) {
      right.box.grow(bins[k][i].box.low, bins[k][i].box.high);
      right.count += bins[k][i].count;
      cost_right[i] = right.count == 0 ? 0.0 : right.box.half_area() * right.count;
    }
    Bin left;
    for (int i = 1; i < kBvhBins; ++i) {
      left.box.grow(bins[k][i - 1].box.low, bins[k][i - 1].box.high);
      left.count += bins[k][i - 1].count;
      if (left.count == 0 || left.count == primitives.size()) continue;
      const double cost = left.box.half_area() * left.count + cost_right[i];
      if (cost < best.cost) best = Split{cost, k, i, left.count};
    }
  }
  return best;
}

// Moves the primitives of the left side to the front.
inline void partition(Span<BvhPrimitive> primitives, const BinMap& map, const Split& split) noexcept {
  std::size_t i = 0;
  std::size_t j = primitives.size();
  while (i < j) {
    if (map.bin_of(primitives[i], split.axis) < split.bin) {
      ++i;
    } else {
      --j;
      const BvhPrimitive swapped = primitives[i];
      primitives[i] = primitives[j];
      primitives[j] = swapped;
    }
  }
}

// Decides how to divide the primitives and reorders them: the number that goes left, or 0 for a leaf.
[[nodiscard]] inline std::uint32_t divide(Span<BvhPrimitive> primitives, double half_area, int depth) noexcept {
  const auto count = static_cast<std::uint32_t>(primitives.size());
  if (count == 1) return 0;
  const BinMap map = bin_map(primitives);
  const Split split = best_split(primitives, map);
  const bool leaf_is_cheaper = split.axis < 0 || split.cost + kBvhVisitCost * half_area >= half_area * count;
  if (count <= kBvhMaxLeaf && leaf_is_cheaper) return 0;
  if (split.axis >= 0) {
    const std::uint32_t larger =
        split.left_count > count - split.left_count ? split.left_count : count - split.left_count;
    if (depth + 1 + ceil_log2(larger) <= kBvhMaxDepth) {
      partition(primitives, map, split);
      return split.left_count;
    }
  }
  return count / 2;
}

[[nodiscard]] inline Box box_of(Span<const BvhPrimitive> primitives) noexcept {
  Box box;
  for (const BvhPrimitive& primitive : primitives) box.grow(primitive.low, primitive.high);
  return box;
}

inline void write_box(const Box& box, BvhNode& out) noexcept {
  for (int k = 0; k < 3; ++k) {
    out.low[k] = box.low[k];
    out.high[k] = box.high[k];
  }
}

// Returns the number of nodes, counting the unused node 1.
[[nodiscard]] inline std::uint32_t build_nodes(Span<BvhPrimitive> primitives, Span<BvhNode> nodes) noexcept {
  struct Task {
    std::uint32_t node;
    std::uint32_t first;
    std::uint32_t count;
    int depth;
  };
  Task stack[kBvhMaxDepth];
  int stacked = 0;
  std::uint32_t node_count = 2;
  Task task{0, 0, static_cast<std::uint32_t>(primitives.size()), 0};
  for (;;) {
    const Span<BvhPrimitive> mine = primitives.sub(task.first, task.count);
    const Box box = box_of(mine);
    BvhNode& node = nodes[task.node];
    write_box(box, node);
    const std::uint32_t left_count = divide(mine, box.half_area(), task.depth);
    if (left_count == 0) {
      node.first = task.first;
      node.count = task.count;
      if (stacked == 0) return node_count;
      task = stack[--stacked];
      continue;
    }
    node.first = node_count;
    node.count = 0;
    stack[stacked++] = Task{node_count + 1, task.first + left_count, task.count - left_count, task.depth + 1};
    task = Task{node_count, task.first, left_count, task.depth + 1};
    node_count += 2;
  }
}

}  // namespace bvh_detail

// `out` points into the workspace and stays good as long as those bytes do; the mesh is not needed any more. A mesh
// without a usable face gives a tree that nothing hits.
[[nodiscard]] inline Status build_bvh(TriangleMeshView mesh, Workspace& workspace, Bvh& out) noexcept {
  out = Bvh{};
  const std::size_t face_count = mesh.faces.size();
  if (face_count >= (std::size_t{1} << 31U)) {
    return Status(StatusCode::capacity_exceeded, "a ray tracer takes fewer than 2^31 faces");
  }
  for (const Face& face : mesh.faces) {
    const std::size_t n = mesh.vertices.size();
    if (face.a >= n || face.b >= n || face.c >= n) {
      return Status(StatusCode::invalid_argument, "a face names a vertex that does not exist");
    }
  }
  Span<BvhNode> nodes;
  Span<BvhTriangle> triangles;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(2 * face_count, nodes));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(face_count, triangles));
  const WorkspaceScope scope(workspace);
  Span<BvhPrimitive> primitives;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(face_count, primitives));

  std::size_t count = 0;
  for (std::size_t i = 0; i < face_count; ++i) {
    BvhTriangle triangle;
    if (!bvh_detail::triangle_of(mesh, static_cast<std::uint32_t>(i), triangle)) continue;
    bvh_detail::Box box;
    for (int corner = 0; corner < 3; ++corner) box.grow(triangle.vertex[corner], triangle.vertex[corner]);
    BvhPrimitive& primitive = primitives[count++];
    for (int k = 0; k < 3; ++k) {
      primitive.low[k] = box.low[k];
      primitive.high[k] = box.high[k];
    }
    primitive.face = triangle.face;
    primitive.unused = 0;
  }
  if (count == 0) return {};
  const std::uint32_t node_count = bvh_detail::build_nodes(primitives.sub(0, count), nodes);
  nodes[1] = BvhNode{};
  for (std::size_t i = 0; i < count; ++i) {
    // Always true: only faces for which it was true became primitives.
    (void)bvh_detail::triangle_of(mesh, primitives[i].face, triangles[i]);
  }
  out.nodes = nodes.sub(0, node_count);
  out.triangles = triangles.sub(0, count);
  return {};
}

}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_TRACE_BUILD_HPP
