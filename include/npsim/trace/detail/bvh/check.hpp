// SPDX-License-Identifier: Apache-2.0
// Trees that come from outside: one block of bytes to store and to map again, and the check of everything in it.
//
// Invariant: a tree that passes check_bvh() can be traced without a read out of range, in at most one visit of each
// node and pack, and its boxes hold what is below them, so no hit is lost. The walk that numbers nodes and packs
// (bvh_layout.hpp) is repeated: every child has to be the next number, hence each is named once and there is no cycle.
// Cost: one pass. Memory: a stack of kBvhStack<W> entries.
#ifndef NPSIM_TRACE_DETAIL_BVH_CHECK_HPP
#define NPSIM_TRACE_DETAIL_BVH_CHECK_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/trace/detail/bvh/layout.hpp"
#include "npsim/trace/detail/triangle/triangle.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// In front of the packs and then the nodes, each from a multiple of 64 bytes. A machine with another byte order reads
// another magic number.
struct BvhHeader {
  std::uint32_t magic;
  std::uint32_t width;
  std::uint32_t pack;
  std::uint32_t reserved;
  std::uint64_t nodes;
  std::uint64_t packs;
  float low[3];
  float high[3];
  std::uint64_t unused;
};
static_assert(sizeof(BvhHeader) == 64);
inline constexpr std::uint32_t kBvhMagic = 0x4E504231U;  // "1BPN" in memory

template <unsigned W, unsigned P>
[[nodiscard]] constexpr std::size_t bvh_storage_bytes(std::size_t nodes, std::size_t packs) noexcept {
  return sizeof(BvhHeader) + allocation_bytes<TrianglePack<P>>(packs) + allocation_bytes<BvhNode<W>>(nodes);
}
template <unsigned W, unsigned P>
[[nodiscard]] constexpr std::size_t bvh_storage_bytes(const WideBvh<W, P>& bvh) noexcept {
  return bvh_storage_bytes<W, P>(bvh.nodes.size(), bvh.packs.size());
}

namespace bvh_detail {

// False also for a NaN.
template <unsigned W>
[[nodiscard]] inline bool holds(const BvhNode<W>& node, unsigned slot, const float (&low)[3],
                                const float (&high)[3]) noexcept {
  bool good = true;
  for (unsigned k = 0; k < 3; ++k) good = good && node.bound[k][slot] <= low[k] && high[k] <= node.bound[k + 3][slot];
  return good;
}

template <unsigned W, unsigned P>
[[nodiscard]] inline bool holds_pack(const BvhNode<W>& node, unsigned slot, const TrianglePack<P>& pack,
                                     std::size_t face_count) noexcept {
  bool good = true;
  for (unsigned lane = 0; lane < P; ++lane) {
    good = good && pack.face[lane] < face_count;
    for (unsigned corner = 0; corner < 3; ++corner) {
      float at[3];
      for (unsigned k = 0; k < 3; ++k) at[k] = pack.vertex[corner][k][lane];
      good = good && holds(node, slot, at, at);
    }
  }
  return good;
}

template <unsigned W>
[[nodiscard]] inline bool holds_node(const BvhNode<W>& node, unsigned slot, const BvhNode<W>& below) noexcept {
  bool good = below.count >= 2 && below.count <= W;
  for (unsigned i = 0; good && i < below.count; ++i) {
    float low[3];
    float high[3];
    for (unsigned k = 0; k < 3; ++k) {
      low[k] = below.bound[k][i];
      high[k] = below.bound[k + 3][i];
      good = good && low[k] <= high[k];
    }
    good = good && holds(node, slot, low, high);
  }
  return good;
}

}  // namespace bvh_detail

// Whether a tree of unknown origin may be traced, its faces being numbers below `face_count`.
template <unsigned W, unsigned P>
[[nodiscard]] Status check_bvh(const WideBvh<W, P>& bvh, std::size_t face_count) noexcept {
  using namespace bvh_detail;
  const auto bad = [](const char* what) noexcept { return Status(StatusCode::invalid_argument, what); };
  if (bvh.nodes.empty() && bvh.packs.empty()) return {};
  if (bvh.nodes.empty() || bvh.nodes.size() >= kBvhLeaf || bvh.packs.size() >= kBvhLeaf) {
    return bad("tree: number of nodes or packs");
  }
  for (int k = 0; k < 3; ++k) {
    if (!(std::fabs(bvh.low[k]) <= kTraceMaxCoordinate) || !(std::fabs(bvh.high[k]) <= kTraceMaxCoordinate)) {
      return bad("tree: bounds");
    }
  }
  // What the root's boxes have to lie in, as a node with one child.
  BvhNode<W> bounds{};
  for (unsigned k = 0; k < 3; ++k) {
    bounds.bound[k][0] = bvh.low[k];
    bounds.bound[k + 3][0] = bvh.high[k];
  }
  const BvhNode<W>& root = bvh.nodes[0];
  if (root.count == 1) {
    if (bvh.nodes.size() != 1 || root.child[0] != kBvhLeaf || bvh.packs.size() != 1 ||
        !holds_pack(root, 0, bvh.packs[0], face_count) || !holds_pack(bounds, 0, bvh.packs[0], face_count)) {
      return bad("tree: its only pack");
    }
    return {};
  }
  if (!holds_node(bounds, 0, root)) return bad("tree: bounds of the root");
  struct Entry {
    std::uint32_t node;
    int depth;
  };
  Entry stack[kBvhStack<W>];
  std::size_t stacked = 0;
  std::uint32_t next_node = 1;
  std::uint32_t next_pack = 0;
  stack[stacked++] = {0, 0};
  while (stacked > 0) {
    const Entry entry = stack[--stacked];
    const BvhNode<W>& node = bvh.nodes[entry.node];  // its count was checked with its parent
    if (entry.depth >= kBvhMaxDepth) return bad("tree: too deep");
    for (unsigned slot = 0; slot < node.count; ++slot) {
      if ((node.child[slot] & kBvhLeaf) != 0) {
        if (node.child[slot] != (next_pack | kBvhLeaf) || next_pack >= bvh.packs.size())
          return bad("tree: a leaf's pack");
        if (!holds_pack(node, slot, bvh.packs[next_pack], face_count)) return bad("tree: a pack's box or faces");
        ++next_pack;
      } else {
        if (node.child[slot] != next_node || next_node >= bvh.nodes.size()) return bad("tree: a child's number");
        if (!holds_node(node, slot, bvh.nodes[next_node])) return bad("tree: a child's box or count");
        ++next_node;
      }
    }
    for (unsigned slot = node.count; slot-- > 0;) {
      if ((node.child[slot] & kBvhLeaf) == 0) stack[stacked++] = {node.child[slot], entry.depth + 1};
    }
  }
  if (next_node != bvh.nodes.size() || next_pack != bvh.packs.size()) return bad("tree: nodes or packs left over");
  return {};
}

// Copies the tree into `out`, bvh_storage_bytes(bvh) bytes.
template <unsigned W, unsigned P>
[[nodiscard]] Status store_bvh(const WideBvh<W, P>& bvh, Span<unsigned char> out) noexcept {
  if (out.size() != bvh_storage_bytes(bvh)) {
    return Status(StatusCode::invalid_argument, "store: the bytes are not as many as bvh_storage_bytes() says");
  }
  BvhHeader header{};
  header.magic = kBvhMagic;
  header.width = W;
  header.pack = P;
  header.nodes = bvh.nodes.size();
  header.packs = bvh.packs.size();
  for (int k = 0; k < 3; ++k) {
    header.low[k] = bvh.low[k];
    header.high[k] = bvh.high[k];
  }
  std::memset(out.data(), 0, out.size());
  std::memcpy(out.data(), &header, sizeof header);
  unsigned char* const packs = out.data() + sizeof header;
  if (!bvh.packs.empty()) std::memcpy(packs, bvh.packs.data(), bvh.packs.size() * sizeof(TrianglePack<P>));
  unsigned char* const nodes = packs + allocation_bytes<TrianglePack<P>>(bvh.packs.size());
  if (!bvh.nodes.empty()) std::memcpy(nodes, bvh.nodes.data(), bvh.nodes.size() * sizeof(BvhNode<W>));
  return {};
}

// A tree over bytes that store_bvh() wrote, perhaps elsewhere, perhaps damaged since. They start at a multiple of 64,
// and `out` is good as long as they are there and nobody else writes to them.
template <unsigned W, unsigned P>
[[nodiscard]] Status map_bvh(Span<unsigned char> bytes, std::size_t face_count, WideBvh<W, P>& out) noexcept {
  out = WideBvh<W, P>{};
  BvhHeader header{};
  const bool large_enough = bytes.size() >= sizeof header;
  if (large_enough) std::memcpy(&header, bytes.data(), sizeof header);
  if (!large_enough || header.magic != kBvhMagic || header.width != W || header.pack != P) {
    return Status(StatusCode::invalid_argument, "map: not a tree of this kind");
  }
  if (reinterpret_cast<std::uintptr_t>(bytes.data()) % kWorkspaceAlignment != 0) {
    return Status(StatusCode::invalid_argument, "map: the bytes do not start at a multiple of 64");
  }
  // Compared before they are multiplied.
  if (header.nodes > bytes.size() / sizeof(BvhNode<W>) || header.packs > bytes.size() / sizeof(TrianglePack<P>) ||
      bvh_storage_bytes<W, P>(header.nodes, header.packs) != bytes.size()) {
    return Status(StatusCode::invalid_argument, "map: not as many bytes as the tree has");
  }
  WideBvh<W, P> mapped;
  unsigned char* const packs = bytes.data() + sizeof header;
  mapped.packs = Span<TrianglePack<P>>(reinterpret_cast<TrianglePack<P>*>(packs), header.packs);
  mapped.nodes = Span<BvhNode<W>>(
      reinterpret_cast<BvhNode<W>*>(packs + allocation_bytes<TrianglePack<P>>(mapped.packs.size())), header.nodes);
  for (int k = 0; k < 3; ++k) {
    mapped.low[k] = header.low[k];
    mapped.high[k] = header.high[k];
  }
  NPSIM_RETURN_IF_ERROR(check_bvh(mapped, face_count));
  out = mapped;
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_BVH_CHECK_HPP
