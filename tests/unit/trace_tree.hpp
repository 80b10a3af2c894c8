// SPDX-License-Identifier: Apache-2.0
// A tree with its memory, and the check of all that a traversal relies on.
#ifndef NPSIM_TESTS_UNIT_TRACE_TREE_HPP
#define NPSIM_TESTS_UNIT_TRACE_TREE_HPP

#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "fixture.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/trace/bvh.hpp"
#include "reference/triangle_scan.hpp"

namespace npsim_test {

// Whether a box lies in that of a slot; false also for a NaN.
template <unsigned W>
[[nodiscard]] bool holds(const npsim::BvhNode<W>& node, unsigned slot, const float (&low)[3], const float (&high)[3]) {
  bool good = true;
  for (unsigned k = 0; k < 3; ++k) good = good && node.bound[k][slot] <= low[k] && high[k] <= node.bound[k + 3][slot];
  return good;
}

template <unsigned W, unsigned P>
[[nodiscard]] bool holds_pack(const npsim::BvhNode<W>& node, unsigned slot, const npsim::TrianglePack<P>& pack,
                              std::size_t face_count) {
  bool good = true;
  for (unsigned lane = 0; lane < P; ++lane) {
    good = good && pack.face[lane] < face_count;
    for (const auto& corner : pack.vertex) {
      const float at[3] = {corner[0][lane], corner[1][lane], corner[2][lane]};
      good = good && holds(node, slot, at, at);
    }
  }
  return good;
}

template <unsigned W>
[[nodiscard]] bool holds_node(const npsim::BvhNode<W>& node, unsigned slot, const npsim::BvhNode<W>& below) {
  bool good = below.count >= 2 && below.count <= W;
  for (unsigned i = 0; good && i < below.count; ++i) {
    const float low[3] = {below.bound[0][i], below.bound[1][i], below.bound[2][i]};
    const float high[3] = {below.bound[3][i], below.bound[4][i], below.bound[5][i]};
    for (unsigned k = 0; k < 3; ++k) good = good && low[k] <= high[k];
    good = good && holds(node, slot, low, high);
  }
  return good;
}

// Whether every node and pack is named once, in the order of the walk that numbers them (detail/bvh/build.hpp), no leaf
// is deeper than kBvhMaxDepth, every box holds what is below it, and every face exists.
template <unsigned W, unsigned P>
[[nodiscard]] bool is_sound(const npsim::WideBvh<W, P>& bvh, std::size_t face_count) {
  if (bvh.nodes.empty() || bvh.packs.empty()) return bvh.nodes.empty() && bvh.packs.empty();
  npsim::BvhNode<W> bounds{};  // of everything, as a node with one child
  for (unsigned k = 0; k < 3; ++k) {
    bounds.bound[k][0] = bvh.low[k];
    bounds.bound[k + 3][0] = bvh.high[k];
  }
  const npsim::BvhNode<W>& root = bvh.nodes[0];
  if (root.count == 1) {
    return bvh.nodes.size() == 1 && root.child[0] == npsim::kBvhLeaf && bvh.packs.size() == 1 &&
           holds_pack(root, 0, bvh.packs[0], face_count) && holds_pack(bounds, 0, bvh.packs[0], face_count);
  }
  if (!holds_node(bounds, 0, root)) return false;
  std::vector<std::pair<std::uint32_t, int>> stack{{0U, 0}};  // node, depth
  std::uint32_t next_node = 1;
  std::uint32_t next_pack = 0;
  while (!stack.empty()) {
    const auto [number, depth] = stack.back();
    stack.pop_back();
    const npsim::BvhNode<W>& node = bvh.nodes[number];  // its count was checked with its parent
    if (depth >= npsim::kBvhMaxDepth) return false;
    for (unsigned slot = 0; slot < node.count; ++slot) {
      if ((node.child[slot] & npsim::kBvhLeaf) != 0) {
        if (node.child[slot] != (next_pack | npsim::kBvhLeaf) || next_pack >= bvh.packs.size()) return false;
        if (!holds_pack(node, slot, bvh.packs[next_pack++], face_count)) return false;
      } else {
        if (node.child[slot] != next_node || next_node >= bvh.nodes.size()) return false;
        if (!holds_node(node, slot, bvh.nodes[next_node++])) return false;
      }
    }
    for (unsigned slot = node.count; slot-- > 0;) {
      if ((node.child[slot] & npsim::kBvhLeaf) == 0) stack.push_back({node.child[slot], depth + 1});
    }
  }
  return next_node == bvh.nodes.size() && next_pack == bvh.packs.size();
}

template <unsigned W = npsim::kBvhWidth, unsigned P = npsim::kBvhPack>
struct Tree {
  Scratch memory;
  npsim::WideBvh<W, P> bvh;

  explicit Tree(const npsim::TriangleMeshView& mesh)
      : memory(npsim::wide_bvh_workspace_bytes<W, P>(mesh.faces.size())) {
    REQUIRE(npsim::build_bvh(mesh, memory.workspace(), bvh).ok());
    REQUIRE(is_sound(bvh, mesh.faces.size()));
  }
  explicit Tree(const npsim::reference::ScanMesh& mesh) : Tree(mesh.view()) {}
};

}  // namespace npsim_test

#endif  // NPSIM_TESTS_UNIT_TRACE_TREE_HPP
