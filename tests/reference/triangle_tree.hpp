// SPDX-License-Identifier: Apache-2.0
// Rays through triangles in double precision: the reference's own tree.
//
// A tree of boxes with four children each, cut by the surface area heuristic over 16 bins (Wald 2007). Boxes are floats
// and hold their triangles exactly, because corners are floats. A ray's passage through a box is computed in double and
// widened by a part in 10^12, more than its rounding; triangles are tested in double after Moeller and Trumbore
// (1997). Faces have two sides. What could be missed is a ray that passes an edge within 1e-15 of the scene's size.
#ifndef NPSIM_TESTS_REFERENCE_TRIANGLE_TREE_HPP
#define NPSIM_TESTS_REFERENCE_TRIANGLE_TREE_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "npsim/core/vec.hpp"
#include "npsim/geometry/triangle_mesh.hpp"

namespace npsim::reference {

struct RayD {
  Vec3d origin;
  Vec3d direction;                                         // unit
  double t_max = std::numeric_limits<double>::infinity();  // hits lie in 0 < t < t_max
};

inline constexpr std::uint32_t kNothing = 0xFFFFFFFFU;

// The point is (1 - u - v) a + u b + v c of the face.
struct HitD {
  double t = std::numeric_limits<double>::infinity();
  std::uint32_t face = kNothing;
  double u = 0;
  double v = 0;
};

class TriangleTree {
 public:
  TriangleTree() = default;
  explicit TriangleTree(const TriangleMeshView& mesh) {
    std::vector<Item> items;
    items.reserve(mesh.faces.size());
    for (std::uint32_t f = 0; f < mesh.faces.size(); ++f) {
      const Face& face = mesh.faces[f];
      Item item;
      item.face = f;
      for (const std::uint32_t v : {face.a, face.b, face.c}) item.box.add(mesh.vertices[v]);
      items.push_back(item);
    }
    if (items.empty()) return;
    nodes_.emplace_back();
    build(mesh, items, 0, items.size(), 0);
  }

  [[nodiscard]] bool closest(const RayD& ray, HitD& hit) const {
    hit = HitD{};
    hit.t = ray.t_max;
    visit(ray, hit.t, [&](const Triangle& triangle) {
      intersect(ray, triangle, hit);
      return false;
    });
    return hit.face != kNothing;
  }

  // Whether a face for which blocks(face) holds lies on the ray.
  template <class Blocks>
  [[nodiscard]] bool occluded(const RayD& ray, Blocks&& blocks) const {
    double t_max = ray.t_max;
    return visit(ray, t_max, [&](const Triangle& triangle) {
      HitD hit;
      hit.t = ray.t_max;
      return intersect(ray, triangle, hit) && blocks(triangle.face);
    });
  }

 private:
  static constexpr int kWidth = 4;
  static constexpr std::size_t kLeaf = 4;  // most triangles of a leaf, unless they cannot be parted
  static constexpr int kBins = 16;
  static constexpr std::uint32_t kLeafBit = 0x80000000U;
  static constexpr std::uint32_t kNoChild = 0xFFFFFFFFU;

  struct Box {
    Vec3f low{kFar, kFar, kFar};
    Vec3f high{-kFar, -kFar, -kFar};
    static constexpr float kFar = std::numeric_limits<float>::infinity();

    void add(const Vec3f& p) {
      low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    }
    void add(const Box& b) {
      add(b.low);
      add(b.high);
    }
    [[nodiscard]] Vec3f middle() const { return (low + high) * 0.5F; }
    [[nodiscard]] double half_area() const {
      const Vec3d d = vec_cast<double>(high) - vec_cast<double>(low);
      return d.x < 0 ? 0 : d.x * d.y + d.y * d.z + d.z * d.x;
    }
  };
  struct Item {
    Box box;
    std::uint32_t face = 0;
  };
  struct Triangle {
    Vec3f a, b, c;
    std::uint32_t face = 0;
  };
  // Boxes of the children, side by side; `child` is a node, or a leaf's first triangle with the top bit set.
  struct alignas(64) Node {
    float low[3][kWidth];
    float high[3][kWidth];
    std::uint32_t child[kWidth];
    std::uint32_t count[kWidth];  // triangles of a leaf
  };

  [[nodiscard]] static float along(const Vec3f& v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

  // Orders items[first, last) so that it falls into two parts; where the second begins, or `last` if one is better.
  static std::size_t split(std::vector<Item>& items, std::size_t first, std::size_t last) {
    if (last - first <= kLeaf) return last;
    Box middles;
    for (std::size_t i = first; i < last; ++i) middles.add(items[i].box.middle());
    double best_cost = std::numeric_limits<double>::infinity();
    int best_axis = -1;
    int best_bin = 0;
    const auto bin_of = [&](const Item& item, int axis) {
      const float low = along(middles.low, axis);
      const float extent = along(middles.high, axis) - low;
      return std::min(kBins - 1, static_cast<int>((along(item.box.middle(), axis) - low) / extent * kBins));
    };
    for (int axis = 0; axis < 3; ++axis) {
      if (!(along(middles.high, axis) > along(middles.low, axis))) continue;
      std::array<Box, kBins> box;
      std::array<std::size_t, kBins> count{};
      for (std::size_t i = first; i < last; ++i) {
        const auto bin = static_cast<std::size_t>(bin_of(items[i], axis));
        box[bin].add(items[i].box);
        ++count[bin];
      }
      std::array<double, kBins> right{};  // cost of the bins from one on
      Box sweep;
      std::size_t n = 0;
      for (int b = kBins - 1; b > 0; --b) {
        const auto bin = static_cast<std::size_t>(b);
        if (count[bin] > 0) sweep.add(box[bin]);
        n += count[bin];
        right[bin] = sweep.half_area() * static_cast<double>(n);
      }
      sweep = Box{};
      n = 0;
      for (int b = 0; b + 1 < kBins; ++b) {
        const auto bin = static_cast<std::size_t>(b);
        if (count[bin] > 0) sweep.add(box[bin]);
        n += count[bin];
        if (n == 0 || n == last - first) continue;
        const double cost = sweep.half_area() * static_cast<double>(n) + right[bin + 1];
        if (cost < best_cost) {
          best_cost = cost;
          best_axis = axis;
          best_bin = b;
        }
      }
    }
    if (best_axis < 0) return first + (last - first) / 2;  // all in one place: any halves do
    const auto at = std::partition(items.begin() + static_cast<std::ptrdiff_t>(first),
                                   items.begin() + static_cast<std::ptrdiff_t>(last),
                                   [&](const Item& item) { return bin_of(item, best_axis) <= best_bin; });
    return static_cast<std::size_t>(at - items.begin());
  }

  void build(const TriangleMeshView& mesh, std::vector<Item>& items, std::size_t first, std::size_t last,
             std::size_t node) {
    // Twice in two makes four; a part that is small enough stays whole.
    std::array<std::size_t, 5> at{};
    at[0] = first;
    at[4] = last;
    at[2] = split(items, first, last);
    at[1] = split(items, first, at[2]);
    at[3] = split(items, at[2], last);
    for (int k = 0; k < kWidth; ++k) {
      const std::size_t begin = at[static_cast<std::size_t>(k)];
      const std::size_t end = at[static_cast<std::size_t>(k) + 1];
      Box box;
      for (std::size_t i = begin; i < end; ++i) box.add(items[i].box);
      for (int axis = 0; axis < 3; ++axis) {
        nodes_[node].low[axis][k] = along(box.low, axis);
        nodes_[node].high[axis][k] = along(box.high, axis);
      }
      nodes_[node].count[k] = static_cast<std::uint32_t>(end - begin);
      if (begin == end) {
        nodes_[node].child[k] = kNoChild;
      } else if (end - begin <= kLeaf) {
        nodes_[node].child[k] = kLeafBit | static_cast<std::uint32_t>(triangles_.size());
        for (std::size_t i = begin; i < end; ++i) {
          const Face& f = mesh.faces[items[i].face];
          triangles_.push_back({mesh.vertices[f.a], mesh.vertices[f.b], mesh.vertices[f.c], items[i].face});
        }
      } else {
        const std::size_t next = nodes_.size();
        nodes_[node].child[k] = static_cast<std::uint32_t>(next);
        nodes_.emplace_back();
        build(mesh, items, begin, end, next);
      }
    }
  }

  // Shortens `hit` where the triangle is hit before it. Equal distances go to the lower face, whatever the order.
  static bool intersect(const RayD& ray, const Triangle& triangle, HitD& hit) {
    const Vec3d a = vec_cast<double>(triangle.a);
    const Vec3d ab = vec_cast<double>(triangle.b) - a;
    const Vec3d ac = vec_cast<double>(triangle.c) - a;
    const Vec3d p = cross(ray.direction, ac);
    const double det = dot(ab, p);
    if (det == 0) return false;
    const double inverse = 1 / det;
    const Vec3d s = ray.origin - a;
    const double u = dot(s, p) * inverse;
    if (!(u >= 0 && u <= 1)) return false;
    const Vec3d q = cross(s, ab);
    const double v = dot(ray.direction, q) * inverse;
    if (!(v >= 0 && u + v <= 1)) return false;
    const double t = dot(ac, q) * inverse;
    if (!(t > 0 && (t < hit.t || (t == hit.t && triangle.face < hit.face && hit.face != kNothing)))) return false;
    hit = HitD{t, triangle.face, u, v};
    return true;
  }

  // Calls f(triangle) for the triangles of the boxes that the ray passes before t_max, nearer boxes first, until it
  // returns true.
  template <class F>
  bool visit(const RayD& ray, const double& t_max, F&& f) const {
    constexpr double kWiden = 1 + 1e-12;
    if (nodes_.empty()) return false;
    const double inverse[3] = {1 / ray.direction.x, 1 / ray.direction.y, 1 / ray.direction.z};
    const double origin[3] = {ray.origin.x, ray.origin.y, ray.origin.z};
    const bool backwards[3] = {inverse[0] < 0, inverse[1] < 0, inverse[2] < 0};
    struct Entry {
      double t;
      std::uint32_t child;
      std::uint32_t count;
    };
    std::array<Entry, 192> stack;  // at most three a level wait; a tree of 2^32 halvings has 32
    std::size_t size = 0;
    stack[size++] = {0, 0, 0};
    while (size > 0) {
      const Entry entry = stack[--size];
      if (entry.t > t_max) continue;
      if ((entry.child & kLeafBit) != 0) {
        const Triangle* triangle = triangles_.data() + (entry.child & ~kLeafBit);
        for (std::uint32_t i = 0; i < entry.count; ++i) {
          if (f(triangle[i])) return true;
        }
        continue;
      }
      const Node& node = nodes_[entry.child];
      double enter[kWidth] = {0, 0, 0, 0};
      double leave[kWidth] = {t_max, t_max, t_max, t_max};
      for (int axis = 0; axis < 3; ++axis) {
        const float* near_side = backwards[axis] ? node.high[axis] : node.low[axis];
        const float* far_side = backwards[axis] ? node.low[axis] : node.high[axis];
        for (int k = 0; k < kWidth; ++k) {
          // 0 times infinity, on the face of a box along the ray, is NaN and bounds nothing.
          const double a = (static_cast<double>(near_side[k]) - origin[axis]) * inverse[axis];
          const double b = (static_cast<double>(far_side[k]) - origin[axis]) * inverse[axis] * kWiden;
          enter[k] = a > enter[k] ? a : enter[k];
          leave[k] = b < leave[k] ? b : leave[k];
        }
      }
      const std::size_t before = size;
      for (int k = 0; k < kWidth; ++k) {
        if (enter[k] > leave[k] || node.child[k] == kNoChild) continue;
        // The nearest on top.
        std::size_t at = size++;
        for (; at > before && stack[at - 1].t < enter[k]; --at) stack[at] = stack[at - 1];
        stack[at] = {enter[k], node.child[k], node.count[k]};
      }
    }
    return false;
  }

  std::vector<Node> nodes_;
  std::vector<Triangle> triangles_;
};

}  // namespace npsim::reference

#endif  // NPSIM_TESTS_REFERENCE_TRIANGLE_TREE_HPP
