// SPDX-License-Identifier: Apache-2.0
// What the ray tracers have in common, and two of them as one scene.
//
// A scene of rays is any type S for which these exist (found by argument):
//   bool is_empty(const S&)                                   whether no ray can hit anything
//   bool closest_hit(const S&, const Ray&, Hit&)              the nearest face; of equal t the lowest
//   bool occluded(const S&, const Ray&, accept)               whether a face with accept(face) lies on the ray
//   void occluded(const S&, Span<const Ray>, accept, Span<std::uint8_t> blocked)
//                                                             the same of many rays: 1 where one does, else 0
//   void closest_hits(const S&, Span<const Ray>, Span<Hit>)   the nearest face of many rays; kNoFace: none
// The last two take Span<const std::uint8_t> active besides: rays where it is 0 are left out, their answers stay as
// they are; empty: all are traced.
// SheetScene (sheet.hpp: layers over the pixel grid) and Bvh (bvh.hpp: any mesh) are such types, and so is JoinedScene
// of two such types, in which the faces of the second follow the first's face_count(). Code that takes a scene as a
// template parameter pays only for what its type holds; in a JoinedScene an empty part costs one comparison a ray.
// Invariant: answers are the nearest, or any, of those of the parts, ties at the lowest face included; each part's are
// its own, to the bit, also when many rays are handed over together.
// Memory: none; rays of a joined scene are handed on in portions of kJoinedBatch, on the stack.
#ifndef NPSIM_TRACE_SCENE_HPP
#define NPSIM_TRACE_SCENE_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/trace/bvh.hpp"
#include "npsim/trace/ray.hpp"
#include "npsim/trace/sheet.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

template <class First, class Second>
struct JoinedScene {
  First first;
  Second second;
};

template <class First, class Second>
[[nodiscard]] bool is_empty(const JoinedScene<First, Second>& scene) noexcept {
  return is_empty(scene.first) && is_empty(scene.second);
}

template <class First, class Second>
[[nodiscard]] bool closest_hit(const JoinedScene<First, Second>& scene, const Ray& ray, Hit& out) noexcept {
  const bool hit = closest_hit(scene.first, ray, out);
  if (is_empty(scene.second)) return hit;
  Ray rest = ray;
  if (hit) rest.t_max = out.t;  // open: at the same t the first part's lower face stays
  Hit nearer;
  if (!closest_hit(scene.second, rest, nearer)) return hit;
  nearer.face += face_count(scene.first);
  out = nearer;
  return true;
}

template <class First, class Second, class Accept>
[[nodiscard]] bool occluded(const JoinedScene<First, Second>& scene, const Ray& ray, Accept&& accept) noexcept {
  if (occluded(scene.first, ray, accept)) return true;
  if (is_empty(scene.second)) return false;
  const std::uint32_t first_face = face_count(scene.first);
  return occluded(scene.second, ray, [&](std::uint32_t face) noexcept { return accept(first_face + face); });
}

template <class First, class Second>
void closest_hits(const JoinedScene<First, Second>& scene, Span<const Ray> rays, Span<Hit> hits,
                  Span<const std::uint8_t> active = {}) noexcept {
  closest_hits(scene.first, rays, hits, active);
  if (is_empty(scene.second)) return;
  const std::uint32_t first_face = face_count(scene.first);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (!active.empty() && active[i] == 0) continue;
    Ray rest = rays[i];
    if (hits[i].face != kNoFace) rest.t_max = hits[i].t;
    Hit nearer;
    if (!closest_hit(scene.second, rest, nearer)) continue;
    nearer.face += first_face;
    hits[i] = nearer;
  }
}

inline constexpr std::size_t kJoinedBatch = 128;

template <class First, class Second, class Accept>
void occluded(const JoinedScene<First, Second>& scene, Span<const Ray> rays, Accept&& accept,
              Span<std::uint8_t> blocked, Span<const std::uint8_t> active = {}) noexcept {
  occluded(scene.first, rays, accept, blocked, active);
  if (is_empty(scene.second)) return;
  const std::uint32_t first_face = face_count(scene.first);
  const auto accept_second = [&](std::uint32_t face) noexcept { return accept(first_face + face); };
  Ray rest[kJoinedBatch];
  std::uint8_t rest_blocked[kJoinedBatch];
  std::size_t whose[kJoinedBatch];
  std::size_t count = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (blocked[i] == 0 && (active.empty() || active[i] != 0)) {
      rest[count] = rays[i];
      whose[count++] = i;
    }
    if (count < kJoinedBatch && i + 1 < rays.size()) continue;
    occluded(scene.second, Span<const Ray>(rest, count), accept_second, Span<std::uint8_t>(rest_blocked, count));
    for (std::size_t k = 0; k < count; ++k) blocked[whose[k]] = rest_blocked[k];
    count = 0;
  }
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_SCENE_HPP
