// SPDX-License-Identifier: Apache-2.0
// Closest hit and occlusion through a sheet (sheet_layout.hpp), with the rays, hits and tests of the general tree.
//
// Invariant: bounds only leave out what intersect_triangle() would miss (sheet_test.hpp), and that test decides
// edges by the signs of values that neighbours share: nothing slips between two faces, and the hit is that of the same
// face in the general tree, bit for bit where both have the same bounds. Of equal t the lowest face is reported.
// Same hits for any number of lanes. Cost: about ten nodes and two tiles a ray, one after the other: a single ray waits
// for each; see sheet_stream.hpp for many. Memory: 400 bytes of stack.
#ifndef NPSIM_TRACE_DETAIL_SHEET_TRAVERSE_HPP
#define NPSIM_TRACE_DETAIL_SHEET_TRAVERSE_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/simd/batch.hpp"
#include "npsim/trace/detail/sheet/layout.hpp"
#include "npsim/trace/detail/sheet/query.hpp"
#include "npsim/trace/detail/sheet/ray.hpp"
#include "npsim/trace/detail/sheet/test.hpp"
#include "npsim/trace/detail/sheet/walk.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace sheet_detail {

// One layer from begin to end; true: the ray is done.
template <class F, class Query>
NPSIM_ALWAYS_INLINE bool walk_sheet(const SheetTrace& sheet, std::uint32_t first_face, SheetRay& ray,
                                    const Query& query, typename Query::Answer& answer) noexcept {
  const auto on_hit = [&](std::uint32_t face, const TriangleHit& hit) noexcept {
    return query.meet(answer, ray, first_face + face, hit);
  };
  if (ray.everything) return test_everything(sheet, ray, on_hit);
  SheetWalk walk;
  for (Step step = begin_walk<Query::kOrdered>(sheet, ray, walk); step != Step::none; step = next_step(walk)) {
    if (step == Step::tile) {
      std::uint32_t faces = 0;
      const std::uint32_t quads = visit_tile<F, Query::kOrdered>(sheet, ray, walk, faces);
      const float end = ray.s_max;
      if (visit_quads(sheet, ray, walk, quads, faces, on_hit)) return true;
      if (ray.s_max < end) forget_beyond<F>(sheet, ray, walk);
    } else {
      add_children<Query::kOrdered>(test_at<F>(sheet, ray, walk.level, walk.x, walk.y), walk);
    }
  }
  return false;
}

// False when the ray can hit nothing.
template <class F, class Query>
[[nodiscard]] NPSIM_ALWAYS_INLINE bool trace_one(Span<const SheetTrace> layers, const SheetBounds& bounds,
                                                 const Ray& ray, const Query& query,
                                                 typename Query::Answer& answer) noexcept {
  SheetRay r;
  if (layers.empty() || !make_sheet_ray(bounds, ray, r)) return false;
  query.begin(answer, r);
  std::uint32_t first_face = 0;
  for (const SheetTrace& sheet : layers) {
    if (sheet.levels > 0 && walk_sheet<F>(sheet, first_face, r, query, answer)) break;
    first_face += sheet_face_count(sheet.vertices.shape());
  }
  return true;
}

template <class F>
[[nodiscard]] bool closest_of(Span<const SheetTrace> layers, const SheetBounds& bounds, const Ray& ray,
                              Hit& out) noexcept {
  ClosestQuery::Answer answer;
  if (!trace_one<F>(layers, bounds, ray, ClosestQuery{}, answer) || answer.best.face == kNoFace) return false;
  out = answer.best;
  return true;
}

template <class F, class Accept>
[[nodiscard]] bool any_of(Span<const SheetTrace> layers, const SheetBounds& bounds, const Ray& ray,
                          Accept& accept) noexcept {
  typename AnyQuery<Accept>::Answer answer;
  return trace_one<F>(layers, bounds, ray, AnyQuery<Accept>{accept, {}}, answer) && answer.blocked;
}

}  // namespace sheet_detail

// The nearest face that the ray meets; `out` is written only when there is one.
template <class F = simd::F32>
[[nodiscard]] bool closest_hit(const SheetScene& scene, const Ray& ray, Hit& out) noexcept {
  return sheet_detail::closest_of<F>(scene.layers, scene.bounds, ray, out);
}

template <class F = simd::F32>
[[nodiscard]] bool closest_hit(const SheetTrace& sheet, const Ray& ray, Hit& out) noexcept {
  return sheet_detail::closest_of<F>({&sheet, 1}, sheet.bounds, ray, out);
}

// Whether some face with accept(face) lies on the ray; the others are transparent.
template <class F = simd::F32, class Accept>
[[nodiscard]] bool occluded(const SheetScene& scene, const Ray& ray, Accept&& accept) noexcept {
  return sheet_detail::any_of<F>(scene.layers, scene.bounds, ray, accept);
}

template <class F = simd::F32, class Accept>
[[nodiscard]] bool occluded(const SheetTrace& sheet, const Ray& ray, Accept&& accept) noexcept {
  return sheet_detail::any_of<F>({&sheet, 1}, sheet.bounds, ray, accept);
}

template <class F = simd::F32>
[[nodiscard]] bool occluded(const SheetScene& scene, const Ray& ray) noexcept {
  return occluded<F>(scene, ray, [](std::uint32_t) noexcept { return true; });
}

template <class F = simd::F32>
[[nodiscard]] bool occluded(const SheetTrace& sheet, const Ray& ray) noexcept {
  return occluded<F>(sheet, ray, [](std::uint32_t) noexcept { return true; });
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_TRAVERSE_HPP
