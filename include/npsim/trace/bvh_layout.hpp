// SPDX-License-Identifier: Apache-2.0
// The memory layout of the bounding volume hierarchy: a binary tree of axis-aligned boxes over triangles.
//
// Invariants: node 0 is the root, node 1 is unused, siblings are nodes (2 i, 2 i + 1), so that a pair fills one
// 64-byte cache line. A box holds exactly (no rounding) every vertex below it. A leaf has count > 0 and owns
// triangles[first .. first + count); an inner node has count == 0 and its children at first and first + 1. No leaf is
// deeper than kBvhMaxDepth, hence a traversal needs a stack of kBvhMaxDepth entries and no more.
// Memory: 64 bytes of nodes, 40 bytes of triangles and, while building, 32 bytes of scratch per face.
#ifndef NPSIM_TRACE_BVH_LAYOUT_HPP
#define NPSIM_TRACE_BVH_LAYOUT_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/span.hpp"
#include "npsim/core/workspace.hpp"

namespace npsim {
inline namespace v1 {

inline constexpr int kBvhMaxDepth = 64;  // edges from the root to the deepest leaf

struct BvhNode {
  float low[3];
  std::uint32_t first;
  float high[3];
  std::uint32_t count;
};
static_assert(sizeof(BvhNode) == 32);

// A triangle with its vertices copied out of the mesh: one access instead of four that depend on each other.
struct BvhTriangle {
  float vertex[3][3];
  std::uint32_t face;
};
static_assert(sizeof(BvhTriangle) == 40);

// Spans into the workspace that build_bvh() was given. Without nodes nothing is ever hit.
struct Bvh {
  Span<const BvhNode> nodes;
  Span<const BvhTriangle> triangles;
};

// Scratch of the builder: the box of one triangle.
struct BvhPrimitive {
  float low[3];
  std::uint32_t face;
  float high[3];
  std::uint32_t unused;
};
static_assert(sizeof(BvhPrimitive) == 32);

[[nodiscard]] constexpr std::size_t bvh_workspace_bytes(std::size_t face_count) noexcept {
  return allocation_bytes<BvhNode>(2 * face_count) + allocation_bytes<BvhTriangle>(face_count) +
         allocation_bytes<BvhPrimitive>(face_count) + kWorkspaceAlignment;
}

}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_TRACE_BVH_LAYOUT_HPP
