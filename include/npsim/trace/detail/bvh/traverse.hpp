// SPDX-License-Identifier: Apache-2.0
// The way of a ray through a bounding volume hierarchy.
//
// Invariant: no pack is left out of which intersect_triangle() would hit a triangle (detail/triangle.hpp).
// Node boxes are tested with one rounding less than box_interval(), t = fl(fl(b - o) / d -+ 3 pad / |d|). With
// u = 2^-24 and pad = 8 u reach, the entry so computed is at most (b - o - 24 u reach + 4.1 u reach) / |d|, and that of
// box_interval() for a box inside is at least (b - o - 8 u reach - 3.1 u reach) / |d|; for the exits 19.9 stands
// against 17.2. So the interval of a node holds those of its triangles as computed, and what was said of them in
// triangle.hpp. Cost: all children of a node are tested together and entered from near to far; every node is visited at
// most once. Memory: a stack of kBvhStack<W> entries, 7.7 KB for sixteen children.
#ifndef NPSIM_TRACE_DETAIL_BVH_TRAVERSE_HPP
#define NPSIM_TRACE_DETAIL_BVH_TRAVERSE_HPP

#include <cmath>
#include <cstdint>
#include <cstring>

#include "npsim/core/bits.hpp"
#include "npsim/core/config.hpp"
#include "npsim/simd/fixed.hpp"
#include "npsim/trace/detail/bvh/build.hpp"
#include "npsim/trace/detail/triangle.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace bvh_detail {

// A ray made ready for the boxes of nodes.
struct NodeRay {
  float minus_origin[3];
  float inverse[3];
  float pad[3];      // 3 pad / |direction|
  unsigned near[3];  // which bound of a node is met first
  unsigned far[3];
};

[[nodiscard]] inline NodeRay node_ray(const RayFrame& ray) noexcept {
  NodeRay out;
  for (unsigned k = 0; k < 3; ++k) {
    out.minus_origin[k] = -ray.origin[k];
    out.inverse[k] = ray.inverse[k];
    out.pad[k] = 3.0F * ray.pad * std::fabs(ray.inverse[k]);
    out.near[k] = ray.inverse[k] < 0.0F ? k + 3 : k;
    out.far[k] = ray.inverse[k] < 0.0F ? k : k + 3;
  }
  return out;
}

// Bits of the children whose interval meets [t_min, limit]; `enter` has where.
template <unsigned W>
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t children_met(const NodeRay& ray, const BvhNode<W>& node, float t_min,
                                                             float limit, float (&enter)[W]) noexcept {
  using F = simd::Fixed<W>;
  // A pad may be infinite and the other summand too, which is NaN without a fused fma; min and max then keep their
  // second operand, so the axis is left out.
  F nearest(t_min);
  F farthest(limit);
  for (unsigned k = 0; k < 3; ++k) {
    const F minus_origin(ray.minus_origin[k]);
    const F inverse(ray.inverse[k]);
    const F pad(ray.pad[k]);
    nearest = max(fma(F::load(node.bound[ray.near[k]]) + minus_origin, inverse, -pad), nearest);
    farthest = min(fma(F::load(node.bound[ray.far[k]]) + minus_origin, inverse, pad), farthest);
  }
  nearest.store(enter);
  return less_equal(nearest, farthest) & ((2U << (node.count - 1)) - 1U);
}

// What waits on the stack: bits of the entry distance, which is not negative, so that they are in order; and the child.
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint64_t stack_entry(float t_enter, std::uint32_t child) noexcept {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &t_enter, sizeof bits);
  return (std::uint64_t{bits} << 32U) | child;
}
[[nodiscard]] NPSIM_ALWAYS_INLINE float entry_distance(std::uint64_t entry) noexcept {
  const auto bits = static_cast<std::uint32_t>(entry >> 32U);
  float t_enter = 0.0F;
  std::memcpy(&t_enter, &bits, sizeof t_enter);
  return t_enter;
}

// Calls leaf(pack index) on the packs that the ray may cross, roughly from near to far if `in_order`; leaf returns the
// distance beyond which nothing matters any more, or a negative number to stop.
template <bool in_order, unsigned W, unsigned P, class Leaf>
inline void traverse(const WideBvh<W, P>& bvh, const RayFrame& ray, Leaf&& leaf) noexcept {
  std::uint64_t stack[kBvhStack<W>];
  std::uint64_t* top = stack;
  float limit = ray.t_max;
  const NodeRay node_ray_ = node_ray(ray);
  const BvhNode<W>* const nodes = bvh.nodes.data();
  std::uint32_t at = 0;
  for (;;) {
    while ((at & kBvhLeaf) == 0) {
      const BvhNode<W>& node = nodes[at];
      alignas(64) float enter[W];
      std::uint32_t met = children_met(node_ray_, node, ray.t_min, limit, enter);
      if (met == 0) break;
      const int first = lowest_set_bit(met);
      met &= met - 1;
      if (met == 0) {
        at = node.child[first];
        continue;
      }
      if constexpr (!in_order) {
        at = node.child[first];
        do {
          *top++ = at;
          at = node.child[lowest_set_bit(met)];
          met &= met - 1;
        } while (met != 0);
        continue;
      }
      std::uint64_t nearest = stack_entry(enter[first], node.child[first]);
      std::uint64_t* const bottom = top;
      do {
        const int slot = lowest_set_bit(met);
        met &= met - 1;
        const std::uint64_t entry = stack_entry(enter[slot], node.child[slot]);
        // The nearest stays in a register, the others are sorted in, the nearest of them on top.
        const std::uint64_t farther = entry < nearest ? nearest : entry;
        nearest = entry < nearest ? entry : nearest;
        std::uint64_t* place = top++;
        for (; place != bottom && place[-1] < farther; --place) *place = place[-1];
        *place = farther;
      } while (met != 0);
      at = static_cast<std::uint32_t>(nearest);
    }
    if ((at & kBvhLeaf) != 0) {
      limit = leaf(at & ~kBvhLeaf);
      if (limit < 0.0F) return;
    }
    do {
      if (top == stack) return;
      --top;
    } while (entry_distance(*top) > limit);
    at = static_cast<std::uint32_t>(*top);
  }
}

}  // namespace bvh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_BVH_TRAVERSE_HPP
