// SPDX-License-Identifier: Apache-2.0
// Depth of regions in which nothing was measured, from what they are a part of.
//
// What surrounds such a region in the picture is mostly behind it, or before it: a crown above the rows of a laser
// would lie on the house behind it, and a sliver of house between two poles at the poles. Three kinds are known better:
//   behind   houses go on behind what stands before them: the line between the nearest sources of houses to the left
//            and to the right in the row, or the value of one. Not between leaves: there the label is a guess.
//   hung     a sign is as far away as the pole below it, and a crown as its trunk, also where a sign comes between. The
//            median over the region's columns.
//   standing a person, a bicycle or a pole is as far away as the ground at its feet: laser maps leave out what moves.
//            The nearest quarter of its columns that end on the ground, as between feet and wheels it is farther off; a
//            rider and what is ridden are one.
// All keep what they are given. Error: what is in fact another house, or another tree's trunk, is taken for its own; a
// row of the picture off at the feet is the more of the distance the farther they are.
#ifndef NPSIM_DEPTH_DETAIL_FILL_ORPHANS_HPP
#define NPSIM_DEPTH_DETAIL_FILL_ORPHANS_HPP

#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/fill/second_order.hpp"
#include "npsim/depth/detail/object_borders.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

// Of a pixel that no path leads to.
inline constexpr std::int32_t kUnreached = std::numeric_limits<std::int32_t>::max();

// w: inverse depth; steps: 0 at sources; kind: FillKind. There are labels.
struct OrphanView {
  const ObjectMap& objects;
  ImageView<float> w;
  ImageView<std::int32_t> steps;
  ImageView<std::uint8_t> kind;

  [[nodiscard]] Label label(int x, int y) const noexcept { return objects.labels(x, y); }
  [[nodiscard]] bool is_orphan(LabelSet labels, int x, int y) const noexcept {
    return kind(x, y) == kOrphan && labels.contains(label(x, y));
  }
  [[nodiscard]] bool is_leaf(int x, int y) const noexcept {
    return w.contains(x, y) && label(x, y) == label::vegetation;
  }
  void give(int x, int y, float value) const noexcept {
    w(x, y) = value;
    kind(x, y) = kGiven;
    steps(x, y) = 1;
  }
};

// reach: in pixels.
inline void continue_behind(LabelSet behind, int reach, const OrphanView& view) noexcept {
  const int width = view.w.width();
  for (int y = 0; y < view.w.height(); ++y) {
    int end = 0;
    for (int first = 0; first < width; first = end) {
      end = first + 1;
      if (!view.is_orphan(behind, first, y)) continue;
      const Label own = view.label(first, y);
      while (end < width && view.is_orphan(behind, end, y) && view.label(end, y) == own) ++end;
      if (view.is_leaf(first - 1, y) || view.is_leaf(end, y)) continue;
      const auto find = [&](int from, int step) {
        for (int u = from; u >= 0 && u < width && (u - from) * step <= reach; u += step) {
          if (view.kind(u, y) == kGiven && view.steps(u, y) == 0 && view.label(u, y) == own) return u;
        }
        return -1;
      };
      const int left = find(first, -1);
      const int right = find(end - 1, 1);
      if (left < 0 && right < 0) continue;
      const float before = left < 0 ? view.w(right, y) : view.w(left, y);
      const float after = right < 0 ? before : view.w(right, y);
      const float slope = left < 0 || right < 0 ? 0.0F : (after - before) / static_cast<float>(right - left);
      for (int x = first; x < end; ++x) view.give(x, y, before + slope * static_cast<float>(x - left));
    }
  }
}

// What poles carry is as far away as they are; else a thing is carried by its own kind.
[[nodiscard]] inline bool carries(Label lower, Label upper) noexcept {
  constexpr LabelSet kOnPoles = kPoleLabels | kSignLabels;
  return lower == upper || (kOnPoles.contains(lower) && kOnPoles.contains(upper));
}

// Inverse depth of what carries a pixel, straight below it, past whatever else hangs there; 0 where that is not known.
[[nodiscard]] inline float support_below(LabelSet hung, const OrphanView& view, int x, int y) noexcept {
  for (int v = y + 1; v < view.w.height() && hung.contains(view.label(x, v)); ++v) {
    if (view.kind(x, v) != kOrphan && carries(view.label(x, v), view.label(x, y))) return view.w(x, v);
  }
  return 0.0F;
}

[[nodiscard]] constexpr std::size_t carry_regions_bytes(Shape shape) noexcept {
  return allocation_bytes<std::uint32_t>(shape.pixels()) + kWorkspaceAlignment;
}

// Gives each region of orphans that `joins` connects one inverse depth: of those that support(x, y) finds below its
// columns, 0 where there is none, the one that `nearer` of them exceed. And 2 KiB of stack.
template <class Joins, class Support>
[[nodiscard]] Status carry_regions(LabelSet labels, float nearer, const Joins& joins, const Support& support,
                                   const OrphanView& view, Workspace& workspace) noexcept {
  constexpr std::size_t kMost = 512;
  const WorkspaceScope scope(workspace);
  const Shape shape = view.w.shape();
  Span<std::uint32_t> region;  // its pixels, y * width + x, in the order in which they were reached
  NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), region));
  const auto width = static_cast<std::uint32_t>(shape.width);
  constexpr std::int32_t kSeen = -1;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (!view.is_orphan(labels, x, y) || view.steps(x, y) == kSeen) continue;
      std::size_t count = 0;
      const auto reach = [&](int u, int v) {
        view.steps(u, v) = kSeen;
        region[count++] = static_cast<std::uint32_t>(v) * width + static_cast<std::uint32_t>(u);
      };
      reach(x, y);
      float supports[kMost];  // of the columns that were reached first
      std::size_t found = 0;
      for (std::size_t i = 0; i < count; ++i) {
        const auto [u, v] = place_of(region[i], shape.width);
        const int around[4][2] = {{u - 1, v}, {u + 1, v}, {u, v - 1}, {u, v + 1}};
        for (const auto& at : around) {
          if (!view.w.contains(at[0], at[1]) || view.kind(at[0], at[1]) != kOrphan) continue;
          if (view.steps(at[0], at[1]) != kSeen && joins(u, v, at[0], at[1])) reach(at[0], at[1]);
        }
        if (v + 1 < shape.height && joins(u, v, u, v + 1)) continue;
        const float below = support(u, v);
        if (below > 0.0F && found < kMost) supports[found++] = below;
      }
      if (found == 0) continue;
      const auto chosen = static_cast<std::size_t>((1.0F - nearer) * static_cast<float>(found));
      select_nth(supports, supports + chosen, supports + found);
      for (std::size_t i = 0; i < count; ++i) {
        const auto [u, v] = place_of(region[i], shape.width);
        view.give(u, v, supports[chosen]);
      }
    }
  }
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (view.steps(x, y) == kSeen) view.steps(x, y) = kUnreached;
    }
  }
  return {};
}

[[nodiscard]] inline Status hang_on_supports(LabelSet hung, const OrphanView& view, Workspace& workspace) noexcept {
  const auto joins = [&](int x, int y, int u, int v) { return view.objects.same(x, y, u, v); };
  const auto support = [&](int x, int y) { return support_below(hung, view, x, y); };
  return carry_regions(hung, 0.5F, joins, support, view, workspace);
}

[[nodiscard]] inline Status stand_on_ground(LabelSet standing, LabelSet ground, const OrphanView& view,
                                            Workspace& workspace) noexcept {
  constexpr LabelSet kRidden = LabelSet::of(label::rider, label::bicycle, label::motorcycle);
  const auto ridden = [&](int x, int y, int u, int v) {
    return kRidden.contains(view.label(x, y)) && kRidden.contains(view.label(u, v));
  };
  const auto joins = [&](int x, int y, int u, int v) { return view.objects.same(x, y, u, v) || ridden(x, y, u, v); };
  const auto support = [&](int x, int y) {
    const bool on_ground = view.w.contains(x, y + 1) && ground.contains(view.label(x, y + 1));
    return on_ground && view.kind(x, y + 1) != kOrphan ? view.w(x, y + 1) : 0.0F;
  };
  return carry_regions(standing, 0.25F, joins, support, view, workspace);
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_FILL_ORPHANS_HPP
