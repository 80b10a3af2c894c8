// SPDX-License-Identifier: Apache-2.0
// The memory layout of the bounding volume hierarchy: nodes of up to W boxes side by side, leaves of one pack of up to
// P triangles.
//
// Invariants: node 0 is the root. A node has count in [1, W] children in slots 0 .. count - 1, each an inner node or a
// pack, told apart by kBvhLeaf; only the root may have a single one. Box i holds exactly (no rounding) every vertex
// below child i. Nodes and packs are numbered as a walk from the root meets them that goes to the first child first and
// numbers all children of a node when it enters it; so each is named once, and check_bvh() can tell. No leaf is deeper
// than kBvhMaxDepth, hence a traversal needs a stack of kBvhStack entries and no more. Everything is an index, nothing
// a pointer: the bytes from bvh_bytes() may be stored and mapped again (bvh_check.hpp). The layout does not depend on
// the instruction set. Memory: at most bvh_workspace_bytes(); on ordinary meshes about 55 bytes a face and, while
// building, 32 of scratch and what was set aside for a poor filling.
#ifndef NPSIM_TRACE_DETAIL_BVH_LAYOUT_HPP
#define NPSIM_TRACE_DETAIL_BVH_LAYOUT_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/span.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/trace/detail/triangle/pack.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr int kBvhMaxDepth = 64;                  // edges from the root to the deepest leaf
inline constexpr std::uint32_t kBvhLeaf = 0x80000000U;   // child: a pack
inline constexpr std::size_t kBvhMaxFaces = 0x20000000;  // 2^29

template <unsigned W>
struct alignas(64) BvhNode {
  float bound[6][W];  // low x, y, z, high x, y, z
  std::uint32_t child[W];
  std::uint32_t count;
};

// Spans into the workspace that build_bvh() was given. Without nodes nothing is ever hit.
template <unsigned W, unsigned P>
struct WideBvh {
  Span<BvhNode<W>> nodes;
  Span<TrianglePack<P>> packs;
  float low[3] = {};  // bounds of everything
  float high[3] = {};
};

// Sixteen children and sixteen triangles are the fastest, or within 10 % of it, on 16, 8 and 4 lanes (docs/rays.md).
inline constexpr unsigned kBvhWidth = 16;
inline constexpr unsigned kBvhPack = 16;
using Bvh = WideBvh<kBvhWidth, kBvhPack>;

template <unsigned W>
inline constexpr std::size_t kBvhStack = (W - 1) * std::size_t{kBvhMaxDepth} + 1;

// Scratch of the builder: the box of one triangle as low x, y, z, its number, -high x, y, z, 0.
struct alignas(32) BvhPrimitive {
  float box[8];
};

// At most so many of each; on the way see bvh_build.hpp.
template <unsigned P>
[[nodiscard]] constexpr std::size_t bvh_max_packs(std::size_t face_count) noexcept {
  return 2 * ((face_count + P - 1) / P);
}
// A node that is not full has only leaves below it, and more than P triangles; all others have W children.
template <unsigned W, unsigned P>
[[nodiscard]] constexpr std::size_t bvh_max_nodes(std::size_t face_count) noexcept {
  const std::size_t full = face_count / (W - 1);
  return 1 + full + (P < W - 1 ? face_count / (P + 1) * (W - 1 - P) / (W - 1) + 1 : 0);
}

template <unsigned W, unsigned P>
[[nodiscard]] constexpr std::size_t wide_bvh_workspace_bytes(std::size_t face_count) noexcept {
  return allocation_bytes<BvhNode<W>>(bvh_max_nodes<W, P>(face_count)) +
         allocation_bytes<TrianglePack<P>>(bvh_max_packs<P>(face_count)) + allocation_bytes<BvhPrimitive>(face_count) +
         kWorkspaceAlignment;
}

[[nodiscard]] constexpr std::size_t bvh_workspace_bytes(std::size_t face_count) noexcept {
  return wide_bvh_workspace_bytes<kBvhWidth, kBvhPack>(face_count);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_BVH_LAYOUT_HPP
