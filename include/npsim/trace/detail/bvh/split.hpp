// SPDX-License-Identifier: Apache-2.0
// Divides a set of triangles in two by the surface area heuristic over binned centroids (Wald, "On fast construction of
// SAH-based bounding volume hierarchies", 2007), counted in packs.
//
// Boxes are eight floats, low x, y, z, -, -high x, y, z, -, so that one min grows both ends; centroids c are kept as
// low + high, twice the middle, in boxes of (c, -c). No operation here rounds differently between instruction sets, so
// the same mesh gives the same tree everywhere.
// Cost: two passes over the set, one that bins all three axes and one that moves the left side to the front in place.
#ifndef NPSIM_TRACE_DETAIL_BVH_SPLIT_HPP
#define NPSIM_TRACE_DETAIL_BVH_SPLIT_HPP

#include <cstdint>
#include <limits>

#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/simd/fixed.hpp"
#include "npsim/trace/detail/bvh/layout.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr int kBvhBins = 16;

namespace bvh_detail {

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

}  // namespace bvh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_BVH_SPLIT_HPP
