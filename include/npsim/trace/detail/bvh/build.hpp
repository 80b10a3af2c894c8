// SPDX-License-Identifier: Apache-2.0
// The bounding volume hierarchy: how it lies in memory, how a set of triangles is divided, and how the tree is built.
//
// Layout. Nodes of up to W boxes side by side, leaves of one pack of up to P triangles. Node 0 is the root. A node has
// count in [1, W] children in slots 0 .. count - 1, each an inner node or a pack, told apart by kBvhLeaf; only the root
// may have a single one. Box i holds exactly (no rounding) every vertex below child i. Nodes and packs are numbered as
// a walk from the root meets them that goes to the first child first and numbers all children of a node when it enters
// it, so each is named once. No leaf is deeper than kBvhMaxDepth, hence a traversal needs a stack of kBvhStack entries
// and no more. Everything is an index, nothing a pointer; the layout does not depend on the instruction set.
//
// Building. From the top down, wide at once: a node starts with its set of triangles, and the child of the largest
// surface is divided until the node is full or every child fits a pack. A set is divided by the surface area heuristic
// over binned centroids (Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007), counted in
// packs. Packs are at least half full on average: sets carry a budget of packs, 2 ceil(n / P) for all, and divide it in
// proportion. Boxes are eight floats, low x, y, z, -, -high x, y, z, -, so that one min grows both ends; centroids c
// are kept as low + high, twice the middle, in boxes of (c, -c). No operation rounds differently between instruction
// sets, so the same mesh gives the same tree on every machine.
//
// Cost: O(n log n), about .2 us per face at a million; a set takes two passes, one that bins all three axes and one
// that moves the left side to the front in place. Memory: at most wide_bvh_workspace_bytes(); on ordinary meshes about
// 55 bytes a face and, while building, 32 of scratch and what was set aside for a poor filling.
#ifndef NPSIM_TRACE_DETAIL_BVH_BUILD_HPP
#define NPSIM_TRACE_DETAIL_BVH_BUILD_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <utility>

#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/simd/fixed.hpp"
#include "npsim/trace/detail/triangle.hpp"

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

// At most so many of each.
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

namespace bvh_detail {

// Dividing a set in two.

inline constexpr int kBvhBins = 16;

using Box = simd::Fixed<8>;

[[nodiscard]] NPSIM_ALWAYS_INLINE Box empty_box() noexcept { return Box(std::numeric_limits<float>::infinity()); }
[[nodiscard]] NPSIM_ALWAYS_INLINE Box load_box(const BvhPrimitive& p) noexcept { return Box::load(p.box); }
[[nodiscard]] NPSIM_ALWAYS_INLINE Box centroid_of(const Box& box) noexcept { return box - halves_swapped(box); }

// Triangles that are contiguous in the array of primitives.
struct BvhSet {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
  std::uint32_t budget = 0;  // packs that may be used
  int depth = 0;
  float box[8];
  float centroids[8];
};

// A plane between two bins of one axis: primitives with bin < `bin` go left.
struct Split {
  float cost = std::numeric_limits<float>::infinity();
  int axis = -1;  // -1: no plane separates the centroids
  int bin = 0;
  std::uint32_t left_count = 0;
};

[[nodiscard]] constexpr int ceil_log2(std::uint32_t n) noexcept {
  int bits = 0;
  while ((std::uint64_t{1} << bits) < n) ++bits;
  return bits;
}

// Half the surface of a box with all extents multiplied by `scale`.
[[nodiscard]] inline float half_area(const float (&box)[8], float scale) noexcept {
  const float x = -(box[0] + box[4]) * scale;
  const float y = -(box[1] + box[5]) * scale;
  const float z = -(box[2] + box[6]) * scale;
  return x * y + y * z + z * x;
}
[[nodiscard]] inline float half_area(const Box& box, float scale) noexcept {
  float all[8];
  box.store(all);
  return half_area(all, scale);
}
// One over the largest extent, so that areas neither overflow nor all vanish.
[[nodiscard]] inline float area_scale(const float (&box)[8]) noexcept {
  float largest = 0x1p-120F;
  for (int k = 0; k < 3; ++k) largest = -(box[k] + box[k + 4]) > largest ? -(box[k] + box[k + 4]) : largest;
  return 1.0F / largest;
}

// Maps centroids to bins; an axis without extent has scale 0.
struct BinMap {
  float start[4] = {};
  float scale[4] = {};
  int bins = 0;

  explicit BinMap(const BvhSet& set) noexcept {
    bins = set.count < 96 ? 4 + static_cast<int>(set.count / 8) : kBvhBins;
    for (int k = 0; k < 3; ++k) {
      const float extent = -(set.centroids[k] + set.centroids[k + 4]);
      // Smaller than the number of bins by more than the roundings, so that the last bin needs no test.
      const float to_bins = 0.999F * static_cast<float>(bins) / extent;
      start[k] = set.centroids[k];
      scale[k] = extent > 0.0F && to_bins <= std::numeric_limits<float>::max() ? to_bins : 0.0F;
    }
  }
};

template <unsigned P>
[[nodiscard]] constexpr std::uint32_t packs_of(std::uint32_t triangles) noexcept {
  return (triangles + P - 1) / P;
}

struct Bins {
  Box box[3][kBvhBins];
  std::uint32_t count[3][kBvhBins];
};

inline void fill_bins(Span<const BvhPrimitive> primitives, const BinMap& map, Bins& out) noexcept {
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < map.bins; ++i) {
      out.box[k][i] = empty_box();
      out.count[k][i] = 0;
    }
  }
  using Four = simd::Fixed<4>;
  const Four start = Four::load(map.start);
  const Four scale = Four::load(map.scale);
  for (const BvhPrimitive& p : primitives) {
    alignas(16) std::int32_t at[4];
    (((Four::load(p.box) - Four::load(p.box + 4)) - start) * scale).store_truncated(at);
    const Box box = load_box(p);
    for (int k = 0; k < 3; ++k) {
      out.box[k][at[k]] = min(out.box[k][at[k]], box);
      ++out.count[k][at[k]];
    }
  }
}

template <unsigned P>
[[nodiscard]] inline Split best_split(const BvhSet& set, const BinMap& map, const Bins& bins) noexcept {
  const float scale = area_scale(set.box);
  Split best;
  for (int k = 0; k < 3; ++k) {
    if (map.scale[k] == 0.0F) continue;
    float cost_right[kBvhBins];  // of everything from this bin on
    Box right = empty_box();
    std::uint32_t right_count = 0;
    for (int i = map.bins - 1; i > 0; --i) {
      right = min(right, bins.box[k][i]);
      right_count += bins.count[k][i];
      cost_right[i] = right_count == 0 ? 0.0F : half_area(right, scale) * static_cast<float>(packs_of<P>(right_count));
    }
    Box left = empty_box();
    std::uint32_t left_count = 0;
    for (int i = 1; i < map.bins; ++i) {
      left = min(left, bins.box[k][i - 1]);
      left_count += bins.count[k][i - 1];
      if (left_count == 0 || left_count == set.count) continue;
      const float cost = half_area(left, scale) * static_cast<float>(packs_of<P>(left_count)) + cost_right[i];
      if (cost < best.cost) best = Split{cost, k, i, left_count};
    }
  }
  return best;
}

// Moves the primitives of the left side to the front and finds both sides' centroids.
inline void partition(Span<BvhPrimitive> primitives, const BinMap& map, const Split& split, BvhSet& left,
                      BvhSet& right) noexcept {
  const float inf = std::numeric_limits<float>::infinity();
  const Box open[2] = {Box(-inf), Box(inf)};  // max with the second leaves a centroid out
  const int k = split.axis;
  const float start = map.start[k];
  const float scale = map.scale[k];
  const auto bin = static_cast<float>(split.bin);
  Box left_centroids = empty_box();
  Box right_centroids = empty_box();
  std::size_t next = 0;
  for (std::size_t i = 0; i < primitives.size(); ++i) {
    const Box box = load_box(primitives[i]);
    const bool is_left = ((primitives[i].box[k] - primitives[i].box[k + 4]) - start) * scale < bin;
    const Box centroid = centroid_of(box);
    left_centroids = min(left_centroids, max(centroid, open[is_left ? 0 : 1]));
    right_centroids = min(right_centroids, max(centroid, open[is_left ? 1 : 0]));
    const Box other = load_box(primitives[next]);
    other.store(primitives[i].box);
    box.store(primitives[next].box);
    next += is_left ? 1U : 0U;
  }
  left_centroids.store(left.centroids);
  right_centroids.store(right.centroids);
}

inline void measure(Span<const BvhPrimitive> primitives, BvhSet& set) noexcept {
  Box box = empty_box();
  Box centroids = empty_box();
  for (const BvhPrimitive& p : primitives) {
    box = min(box, load_box(p));
    centroids = min(centroids, centroid_of(load_box(p)));
  }
  box.store(set.box);
  centroids.store(set.centroids);
}

// Divides a set of more than P triangles. Packs stay within the budget and leaves within the depth: a set at depth d
// with n triangles always satisfies d + ceil(log2(packs_of(n))) <= kBvhMaxDepth and packs_of(n) <= budget, because a
// split that would break this is replaced by one into halves of whole packs, which keeps both.
template <unsigned P>
inline void divide(Span<BvhPrimitive> primitives, const BvhSet& set, BvhSet& left, BvhSet& right) noexcept {
  const Span<BvhPrimitive> mine = primitives.sub(set.first, set.count);
  const BinMap map(set);
  Split split;
  Bins bins;
  if (map.scale[0] != 0.0F || map.scale[1] != 0.0F || map.scale[2] != 0.0F) {
    fill_bins(mine, map, bins);
    split = best_split<P>(set, map, bins);
  }
  std::uint32_t packs = 0;
  if (split.axis >= 0) {
    const std::uint32_t a = packs_of<P>(split.left_count);
    const std::uint32_t b = packs_of<P>(set.count - split.left_count);
    packs = a + b;
    if (set.depth + 1 + ceil_log2(a > b ? a : b) > kBvhMaxDepth || packs > set.budget) split.axis = -1;
  }
  if (split.axis >= 0) {
    left.count = split.left_count;
    partition(mine, map, split, left, right);
    Box left_box = empty_box();
    Box right_box = empty_box();
    for (int i = 0; i < map.bins; ++i) {
      if (i < split.bin) left_box = min(left_box, bins.box[split.axis][i]);
      if (i >= split.bin) right_box = min(right_box, bins.box[split.axis][i]);
    }
    left_box.store(left.box);
    right_box.store(right.box);
  } else {
    packs = packs_of<P>(set.count);
    left.count = packs / 2 * P;
    measure(mine.sub(0, left.count), left);
    measure(mine.sub(left.count, set.count - left.count), right);
  }
  left.first = set.first;
  right.first = set.first + left.count;
  right.count = set.count - left.count;
  left.depth = set.depth + 1;
  right.depth = set.depth + 1;
  const std::uint64_t spare = set.budget - packs;
  left.budget = packs_of<P>(left.count) + static_cast<std::uint32_t>(spare * left.count / set.count);
  right.budget = set.budget - left.budget;
}

// Building.

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
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_BVH_BUILD_HPP
