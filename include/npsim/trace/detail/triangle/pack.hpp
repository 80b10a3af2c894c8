// SPDX-License-Identifier: Apache-2.0
// A ray against P triangles side by side.
//
// Invariant: lane i gets the bits that intersect_triangle() gives for triangle i, to which it is handed unless two of
// its edge functions, computed by the same operations in the same order, have opposite signs, which are exact, or its
// vertices lie beyond the limits.
// Cost: about 35 vector operations, 15 more and intersect_triangle() for the one or two lanes that the ray's line
// passes through; whether something is hit at all mostly needs no more than the vectors. Memory: 40 P bytes a pack.
#ifndef NPSIM_TRACE_DETAIL_TRIANGLE_PACK_HPP
#define NPSIM_TRACE_DETAIL_TRIANGLE_PACK_HPP

#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/config.hpp"
#include "npsim/simd/fixed.hpp"
#include "npsim/trace/detail/triangle/triangle.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Lanes without a triangle of their own repeat one, or are a point, which nothing hits.
template <unsigned P>
struct TrianglePack {
  float vertex[3][3][P];  // corner, axis, lane
  std::uint32_t face[P];
};

template <unsigned P>
struct PackHit {
  float t[P];
  float u[P];
  float v[P];
};


template <unsigned P>
inline void triangle_of_lane(const TrianglePack<P>& pack, unsigned lane, float (&out)[3][3]) noexcept {
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) out[i][k] = pack.vertex[i][k][lane];
  }
}

// What floats alone tell of a pack.
struct PackLanes {
  std::uint32_t open;  // may be hit with t_min < t <= limit: intersect_triangle() decides
  std::uint32_t sure;  // those of them that are hit with t_min < t < limit
};

// The vertices' own t enclose that of the sheared ray, and t_slack is far from being used up by rounding: so with twice
// as much they enclose the t that is reported.
template <unsigned P>
[[nodiscard]] NPSIM_ALWAYS_INLINE PackLanes lanes_met(const RayFrame& ray, const TrianglePack<P>& pack,
                                                      float limit) noexcept {
  using F = simd::Fixed<P>;
  const std::uint32_t kx = ray.axis[0];
  const std::uint32_t ky = ray.axis[1];
  const std::uint32_t kz = ray.axis[2];
  const F minus_x(-ray.origin[kx]);  // a - b and a + (-b) are the same, and an addition takes its operand from memory
  const F minus_y(-ray.origin[ky]);
  const F minus_z(-ray.origin[kz]);
  const F shear_x(ray.shear[0]);
  const F shear_y(ray.shear[1]);
  F x[3];
  F y[3];
  F z[3];
  for (int i = 0; i < 3; ++i) {
    z[i] = F::load(pack.vertex[i][kz]) + minus_z;
    x[i] = (F::load(pack.vertex[i][kx]) + minus_x) - shear_x * z[i];
    y[i] = (F::load(pack.vertex[i][ky]) + minus_y) - shear_y * z[i];
  }
  const F a = x[2] * y[1] - y[2] * x[1];
  const F b = x[0] * y[2] - y[0] * x[2];
  const F c = x[1] * y[0] - y[1] * x[0];
  const F least = min(min(a, b), c);
  const F greatest = max(max(a, b), c);
  const F zero(0.0F);
  const std::uint32_t inside = less_equal(zero, least) | less_equal(greatest, zero);
  if (inside == 0) return {0, 0};
  const std::uint32_t strictly = less(zero, least) | less(greatest, zero);
  const F scale(static_cast<float>(ray.scale));
  const F slack(2.0F * static_cast<float>(ray.t_slack));
  const F t0 = z[0] * scale;
  const F t1 = z[1] * scale;
  const F t2 = z[2] * scale;
  const F t_low = min(min(t0, t1), t2) - slack;
  const F t_high = max(max(t0, t1), t2) + slack;
  const F t_min(ray.t_min);
  const F t_limit(limit);
  const std::uint32_t outside = less(t_limit, t_low) | less(t_high, t_min);
  return {inside & ~outside, strictly & less(t_min, t_low) & less(t_high, t_limit)};
}

// Bits of the lanes that are hit with t_min < t <= limit; the other lanes of `out` hold nothing.
template <unsigned P>
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t intersect_pack(const RayFrame& ray, const TrianglePack<P>& pack,
                                                               float limit, PackHit<P>& out) noexcept {
  std::uint32_t hits = 0;
  for (std::uint32_t rest = lanes_met(ray, pack, limit).open; rest != 0; rest &= rest - 1) {
    const auto lane = static_cast<unsigned>(lowest_set_bit(rest));
    float vertex[3][3];
    triangle_of_lane(pack, lane, vertex);
    TriangleHit hit;
    if (!intersect_triangle(ray, vertex, hit) || !(hit.t <= limit)) continue;
    out.t[lane] = hit.t;
    out.u[lane] = hit.u;
    out.v[lane] = hit.v;
    hits |= 1U << lane;
  }
  return hits;
}

// Whether a face with accept(face) is hit with t_min < t < t_max.
template <unsigned P, class Accept>
[[nodiscard]] NPSIM_ALWAYS_INLINE bool pack_blocks(const RayFrame& ray, const TrianglePack<P>& pack,
                                                   Accept&& accept) noexcept {
  const PackLanes lanes = lanes_met(ray, pack, ray.t_max);
  for (std::uint32_t rest = lanes.sure; rest != 0; rest &= rest - 1) {
    if (accept(pack.face[lowest_set_bit(rest)])) return true;
  }
  for (std::uint32_t rest = lanes.open & ~lanes.sure; rest != 0; rest &= rest - 1) {
    const auto lane = static_cast<unsigned>(lowest_set_bit(rest));
    float vertex[3][3];
    triangle_of_lane(pack, lane, vertex);
    TriangleHit hit;
    if (intersect_triangle(ray, vertex, hit) && hit.t < ray.t_max && accept(pack.face[lane])) return true;
  }
  return false;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_TRIANGLE_PACK_HPP
