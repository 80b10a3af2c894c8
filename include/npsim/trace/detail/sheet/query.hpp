// SPDX-License-Identifier: Apache-2.0
// What is asked of rays through a sheet: the nearest face, or whether there is one. How a hit changes the answer.
//
// A query has an Answer for each ray under way, begin(answer, ray), meet(answer, ray, face, hit), which says whether
// the ray is done, and the shortest way to its result. Of equal t the lowest face wins, whatever the order.
// Memory: 20 bytes a ray.
#ifndef NPSIM_TRACE_DETAIL_SHEET_QUERY_HPP
#define NPSIM_TRACE_DETAIL_SHEET_QUERY_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/span.hpp"
#include "npsim/trace/detail/sheet/ray.hpp"
#include "npsim/trace/detail/triangle/triangle.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace sheet_detail {

struct ClosestQuery {
  static constexpr bool kOrdered = true;  // what is near shortens the ray
  struct Answer {
    Hit best;
  };
  Span<Hit> hits;  // one a ray; face is kNoFace where there is none

  static void begin(Answer& answer, const SheetRay& ray) noexcept {
    answer.best = Hit{};
    answer.best.t = ray.frame.t_max;
  }
  [[nodiscard]] NPSIM_ALWAYS_INLINE static bool meet(Answer& answer, SheetRay& ray, std::uint32_t face,
                                                     const TriangleHit& hit) noexcept {
    // Without a hit yet best.t is t_max and the interval is open.
    Hit& best = answer.best;
    if (hit.t < best.t || (hit.t == best.t && best.face != kNoFace && face < best.face)) {
      best = Hit{hit.t, face, hit.u, hit.v};
      if (!ray.everything) shorten(ray, hit.t);
    }
    return false;
  }
  void end(const Answer& answer, std::size_t i) const noexcept {
    hits[i] = answer.best.face == kNoFace ? Hit{} : answer.best;
  }
  void miss(std::size_t i) const noexcept { hits[i] = Hit{}; }
};

template <class Accept>
struct AnyQuery {
  static constexpr bool kOrdered = false;  // one is as good as another, and order costs a sixth of a step
  struct Answer {
    bool blocked;
  };
  Accept& accept;
  Span<std::uint8_t> blocked;

  static void begin(Answer& answer, const SheetRay&) noexcept { answer.blocked = false; }
  [[nodiscard]] NPSIM_ALWAYS_INLINE bool meet(Answer& answer, SheetRay& ray, std::uint32_t face,
                                              const TriangleHit& hit) const noexcept {
    answer.blocked = hit.t < ray.frame.t_max && accept(face);
    return answer.blocked;
  }
  void end(const Answer& answer, std::size_t i) const noexcept { blocked[i] = answer.blocked ? 1 : 0; }
  void miss(std::size_t i) const noexcept { blocked[i] = 0; }
};

}  // namespace sheet_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_QUERY_HPP
