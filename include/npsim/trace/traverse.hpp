// SPDX-License-Identifier: Apache-2.0
// Closest hit and occlusion through a bounding volume hierarchy.
//
// Invariant: the answer is that of testing every triangle of the tree in turn, bit for bit (see triangle.hpp). Of
// several faces at the same t the one with the lowest index is reported, so that the answer depends neither on the
// order of traversal nor on the shape of the tree.
// Cost: both children of a node are tested together and the nearer one is entered first; every node is visited at
// most once. Memory: a stack of kBvhMaxDepth entries, 512 bytes.
#ifndef NPSIM_TRACE_TRAVERSE_HPP
#define NPSIM_TRACE_TRAVERSE_HPP

#include <cstdint>

#include "npsim/simd/isa.hpp"
#include "npsim/trace/bvh_layout.hpp"
#include "npsim/trace/ray.hpp"
#include "npsim/trace/triangle.hpp"

namespace npsim {
inline namespace v1 {
inline namespace NPSIM_ISA_NAMESPACE {

// Calls leaf(triangles) on the leaves that the ray may cross, roughly from near to far; leaf returns the distance
// beyond which nothing matters any more, or a negative number to stop.
template <class Leaf>
inline void traverse(const Bvh& bvh, const RayFrame& ray, Leaf&& leaf) noexcept {
  struct Entry {
    std::uint32_t node;
    float t_enter;
  };
  Entry stack[kBvhMaxDepth];
  int stacked = 0;
  float limit = ray.t_max;
  float t_enter = 0.0F;
  float t_leave = 0.0F;
  const BvhNode* node = bvh.nodes.data();
  if (!box_interval(ray, node->low, node->high, t_enter, t_leave) || t_leave < ray.t_min || t_enter > limit) return;
  for (;;) {
    if (node->count == 0) {
      const BvhNode* left = &bvh.nodes[node->first];
      const BvhNode* right = left + 1;
      float enter_left = 0.0F;
      float enter_right = 0.0F;
      bool go_left = box_interval(ray, left->low, left->high, enter_left, t_leave);
      go_left = go_left && t_leave >= ray.t_min && enter_left <= limit;
      bool go_right = box_interval(ray, right->low, right->high, enter_right, t_leave);
      go_right = go_right && t_leave >= ray.t_min && enter_right <= limit;
      if (go_left && go_right) {
        const bool left_first = enter_left <= enter_right;
        stack[stacked++] = left_first ? Entry{node->first + 1, enter_right} : Entry{node->first, enter_left};
        node = left_first ? left : right;
        continue;
      }
      if (go_left || go_right) {
        node = go_left ? left : right;
        continue;
      }
    } else {
      limit = leaf(bvh.triangles.sub(node->first, node->count));
      if (limit < 0.0F) return;
    }
    do {
      if (stacked == 0) return;
      --stacked;
    } while (stack[stacked].t_enter > limit);
    node = &bvh.nodes[stack[stacked].node];
  }
}

// The nearest face that the ray meets; `out` is written only when there is one.
[[nodiscard]] inline bool closest_hit(const Bvh& bvh, const Ray& ray, Hit& out) noexcept {
  RayFrame frame;
  if (bvh.nodes.empty() || !make_ray_frame(ray, bvh.nodes[0].low, bvh.nodes[0].high, frame)) return false;
  Hit best;
  best.t = frame.t_max;
  traverse(bvh, frame, [&frame, &best](Span<const BvhTriangle> triangles) noexcept {
    for (const BvhTriangle& triangle : triangles) {
      TriangleHit hit;
      if (!intersect_triangle(frame, triangle.vertex, hit)) continue;
      // At t == t_max there is no hit yet, and best.face is still kNoFace: the interval is open.
      const bool tie = hit.t == best.t && best.face != kNoFace && triangle.face < best.face;
      if (hit.t < best.t || tie) best = Hit{hit.t, triangle.face, hit.u, hit.v};
    }
    return best.t;
  });
  if (best.face == kNoFace) return false;
  out = best;
  return true;
}

// Whether some face with accept(face) lies on the ray; the others are transparent. `likely`, a position in
// bvh.triangles or kNoFace, is tried first, and becomes the triangle that was met: what shadows one point mostly
// shadows its neighbour too. It never changes the answer.
template <class Accept>
[[nodiscard]] inline bool occluded(const Bvh& bvh, const Ray& ray, Accept&& accept, std::uint32_t& likely) noexcept {
  RayFrame frame;
  if (bvh.nodes.empty() || !make_ray_frame(ray, bvh.nodes[0].low, bvh.nodes[0].high, frame)) return false;
  const auto blocks = [&frame, &accept](const BvhTriangle& triangle) noexcept {
    TriangleHit hit;
    return intersect_triangle(frame, triangle.vertex, hit) && hit.t < frame.t_max && accept(triangle.face);
  };
  if (likely < bvh.triangles.size() && blocks(bvh.triangles[likely])) return true;
  bool found = false;
  traverse(bvh, frame, [&](Span<const BvhTriangle> triangles) noexcept {
    for (const BvhTriangle& triangle : triangles) {
      if (!blocks(triangle)) continue;
      likely = static_cast<std::uint32_t>(&triangle - bvh.triangles.data());
      found = true;
      return -1.0F;
    }
    return frame.t_max;
  });
  return found;
}

template <class Accept>
[[nodiscard]] inline bool occluded(const Bvh& bvh, const Ray& ray, Accept&& accept) noexcept {
  std::uint32_t none = kNoFace;
  return occluded(bvh, ray, accept, none);
}

[[nodiscard]] inline bool occluded(const Bvh& bvh, const Ray& ray) noexcept {
  return occluded(bvh, ray, [](std::uint32_t) noexcept { return true; });
}

}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_TRACE_TRAVERSE_HPP
