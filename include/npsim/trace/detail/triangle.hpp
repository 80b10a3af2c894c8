// SPDX-License-Identifier: Apache-2.0
// Watertight intersection of a ray with a triangle and with a box (Woop, Benthin and Wald, "Watertight ray/triangle
// intersection", JCGT 2(1), 2013), and the argument why no hit is lost between the two.
//
// Triangle. Vertices are moved so that the ray starts at 0, and sheared so that it runs along its largest axis z:
//   x' = fl(fl(x - o_x) - fl(S_x fl(z - o_z))),  S_x = d_x / d_z,  |S_x| <= 1.
// Vertices that two faces share get the same x', y'. The ray hits when the three edge functions, such as
// C_x B_y - C_y B_x, have no two opposite signs. Rounding is monotonic, so a difference of two rounded products that
// is not 0 has the exact sign; one that is 0 is computed again in double, where products of floats are exact. Edge
// signs are therefore exact for the points (x', y'), the two faces at an edge see opposite values, and a ray cannot
// slip between them. A ray in the plane of the triangle misses it (its neighbours are hit).
//
// Box. With w the exact weights of the hit in (x', y') the point P = sum w_i (a_i - o) lies in the moved box and
// |P_x - (d_x / d_z) P_z| <= u max (2 |a_x - o_x| + 4 |a_z - o_z|) over the corners a, with u = 2^-24: the error of the
// shear. The slabs are moved out by pad = 2^-21 reach, reach >= every |a_i - o| component, which is more than that:
// 8 u reach where 6 are needed; directions below 2^-30 of the largest component are raised to it, which shifts the ray
// by less than 2^-30 reach and makes every reciprocal finite, so no 0 * inf arises. A slab distance has three
// roundings; the exit distance is scaled by 1 + 2 gamma(3), gamma(n) = n u / (1 - n u). Hence the interval of a box
// holds every hit inside it.
//
// Distance. t' = sum w_i z_i / d_z, in double, is where the sheared ray meets the triangle; it differs from where the
// ray itself meets the plane by the shear's error over the cosine between ray and normal. The t of the plane is
// reported, in double until it is rounded, unless it lies more than t_slack = 60 pad / |d_z| from t', where t' is: so
// whatever leaves out faces by their t' need only be that much more generous. t is clamped to the interval of the
// triangle's own box, in which t' lies. Slab distances are monotonic in the box, so a hit can never be nearer than the
// entry of a box round it: the closest hit does not depend on the order of traversal.
//
// Error: |t - t of the plane| <= 2^-21 reach / (cosine |d|) + 2^-23 t, and no more than the triangle is long
// (checked by tests/unit/trace_bvh_test.cpp and bench/rays/leaks.cpp).
//
// Limits: coordinates up to 2^60, largest component of a direction between 2^-96 and 2^96; otherwise a miss. What lies
// within 2^-100 of the origin of a ray, as far as all of the scene does, may be missed.
//
// Three forms, all with the same operations in the same order, hence with the same bits:
//   intersect_triangle()            one ray, one triangle: this decides
//   intersect_pack(), pack_blocks() one ray, P triangles side by side: floats rule most out, or tell that they block
//   hits_of_lanes()                 sixteen rays, each with a triangle of its own
// Cost: a pack about 35 vector operations, and 15 more and intersect_triangle() for the one or two lanes that the ray's
// line passes through; sixteen pairs a quarter of the time of one by one with 16 lanes. Memory: 40 P bytes a pack; 1.1
// KiB of pairs, 1.7 KiB of stack.
#ifndef NPSIM_TRACE_DETAIL_TRIANGLE_HPP
#define NPSIM_TRACE_DETAIL_TRIANGLE_HPP

#include <cmath>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/config.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/fixed.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr float kTraceMaxCoordinate = 0x1p60F;  // metres; products of two sums of these stay finite
inline constexpr double kTraceSlackPads = 60.0;        // of t, see above

// A ray made ready for many tests.
struct RayFrame {
  float origin[3];
  float inverse[3];  // 1 / direction, finite
  float shear[2];    // d_x / d_z and d_y / d_z in the permuted axes
  float pad;         // how far boxes are moved out
  float t_min;
  float t_max;
  std::uint32_t axis[3];  // permuted x, y, z
  double direction[3];
  double scale;    // 1 / d_z
  double t_slack;  // how far the t that is reported may be from that of the sheared ray
};

struct TriangleHit {
  float t;
  float u;
  float v;
};

// False when the ray can hit nothing. `low` and `high` are the bounds of everything that will be tested.
[[nodiscard]] inline bool make_ray_frame(const Ray& ray, const float (&low)[3], const float (&high)[3],
                                         RayFrame& out) noexcept {
  const float direction[3] = {ray.direction.x, ray.direction.y, ray.direction.z};
  const float origin[3] = {ray.origin.x, ray.origin.y, ray.origin.z};
  std::uint32_t z = std::fabs(direction[0]) >= std::fabs(direction[1]) ? 0U : 1U;
  if (std::fabs(direction[2]) > std::fabs(direction[z])) z = 2U;
  const float largest = std::fabs(direction[z]);
  // A NaN component of the direction may hide from the choice of z, so each one is compared.
  bool good = largest >= 0x1p-96F && largest <= 0x1p96F;
  float reach = 0.0F;
  for (std::uint32_t k = 0; k < 3; ++k) {
    good = good && std::fabs(direction[k]) <= largest && std::fabs(origin[k]) <= kTraceMaxCoordinate;
    const float to_low = std::fabs(low[k] - origin[k]);
    const float to_high = std::fabs(high[k] - origin[k]);
    const float farther = to_low > to_high ? to_low : to_high;
    reach = farther > reach ? farther : reach;
  }
  out.t_min = ray.t_min > 0.0F ? ray.t_min : 0.0F;
  out.t_max = ray.t_max;
  good = good && ray.t_min == ray.t_min && out.t_min < out.t_max;
  if (!good) return false;
  for (std::uint32_t k = 0; k < 3; ++k) {
    const float size = std::fabs(direction[k]);
    const float magnitude = size > 0x1p-30F * largest ? size : 0x1p-30F * largest;
    out.origin[k] = origin[k];
    out.inverse[k] = 1.0F / std::copysign(magnitude, direction[k]);
  }
  const std::uint32_t x = z == 2U ? 0U : z + 1U;
  const std::uint32_t y = x == 2U ? 0U : x + 1U;
  out.axis[0] = x;
  out.axis[1] = y;
  out.axis[2] = z;
  out.shear[0] = direction[x] / direction[z];
  out.shear[1] = direction[y] / direction[z];
  out.pad = 0x1p-21F * reach + 0x1p-126F;  // which only a scene of such a size can feel
  for (std::uint32_t k = 0; k < 3; ++k) out.direction[k] = static_cast<double>(direction[k]);
  out.scale = 1.0 / out.direction[z];
  out.t_slack = kTraceSlackPads * static_cast<double>(out.pad) * std::fabs(out.scale);
  return true;
}

// Interval of t in which the ray may be inside the box; empty when false.
[[nodiscard]] NPSIM_ALWAYS_INLINE bool box_interval(const RayFrame& ray, const float (&low)[3], const float (&high)[3],
                                                    float& t_enter, float& t_leave) noexcept {
  float enter[3];
  float leave[3];
  for (int k = 0; k < 3; ++k) {
    const float p = ((low[k] - ray.origin[k]) - ray.pad) * ray.inverse[k];
    const float q = ((high[k] - ray.origin[k]) + ray.pad) * ray.inverse[k];
    enter[k] = p < q ? p : q;
    leave[k] = p < q ? q : p;
  }
  const float near_xy = enter[0] > enter[1] ? enter[0] : enter[1];
  const float far_xy = leave[0] < leave[1] ? leave[0] : leave[1];
  t_enter = near_xy > enter[2] ? near_xy : enter[2];
  t_leave = (far_xy < leave[2] ? far_xy : leave[2]) * (1.0F + 2.0F * rounding_gamma(3));
  return t_enter <= t_leave;
}

// Where the ray meets the plane of the triangle, in double; not finite where it runs along it.
[[nodiscard]] NPSIM_ALWAYS_INLINE double plane_distance(const RayFrame& ray, const float (&vertex)[3][3]) noexcept {
  double from[3];
  double p[3];
  double q[3];
  for (int k = 0; k < 3; ++k) {
    const auto a = static_cast<double>(vertex[0][k]);
    from[k] = a - static_cast<double>(ray.origin[k]);
    p[k] = static_cast<double>(vertex[1][k]) - a;
    q[k] = static_cast<double>(vertex[2][k]) - a;
  }
  const double n[3] = {p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]};
  return (n[0] * from[0] + n[1] * from[1] + n[2] * from[2]) /
         (n[0] * ray.direction[0] + n[1] * ray.direction[1] + n[2] * ray.direction[2]);
}

// Hits from both sides. Does not look at t_max, so that the caller can break ties.
[[nodiscard]] inline bool intersect_triangle(const RayFrame& ray, const float (&vertex)[3][3],
                                             TriangleHit& out) noexcept {
  const std::uint32_t kx = ray.axis[0];
  const std::uint32_t ky = ray.axis[1];
  const std::uint32_t kz = ray.axis[2];
  float x[3];
  float y[3];
  float z[3];
  for (int i = 0; i < 3; ++i) {
    z[i] = vertex[i][kz] - ray.origin[kz];
    x[i] = (vertex[i][kx] - ray.origin[kx]) - ray.shear[0] * z[i];
    y[i] = (vertex[i][ky] - ray.origin[ky]) - ray.shear[1] * z[i];
  }
  const float a = x[2] * y[1] - y[2] * x[1];
  const float b = x[0] * y[2] - y[0] * x[2];
  const float c = x[1] * y[0] - y[1] * x[0];
  if ((a < 0 || b < 0 || c < 0) && (a > 0 || b > 0 || c > 0)) return false;
  const auto edge = [&x, &y](int i, int j) noexcept {
    return static_cast<double>(x[i]) * static_cast<double>(y[j]) -
           static_cast<double>(y[i]) * static_cast<double>(x[j]);
  };
  const double wa = edge(2, 1);
  const double wb = edge(0, 2);
  const double wc = edge(1, 0);
  if ((wa < 0 || wb < 0 || wc < 0) && (wa > 0 || wb > 0 || wc > 0)) return false;
  const double sum = wa + wb + wc;
  if (!(std::fabs(sum) > 0)) return false;
  float low[3];
  float high[3];
  for (int k = 0; k < 3; ++k) {
    // Not fmin and fmax, which are calls.
    const float least = vertex[1][k] < vertex[2][k] ? vertex[1][k] : vertex[2][k];
    const float greatest = vertex[1][k] > vertex[2][k] ? vertex[1][k] : vertex[2][k];
    low[k] = vertex[0][k] < least ? vertex[0][k] : least;
    high[k] = vertex[0][k] > greatest ? vertex[0][k] : greatest;
  }
  float t_enter = 0.0F;
  float t_leave = 0.0F;
  if (!box_interval(ray, low, high, t_enter, t_leave)) return false;
  const double inverse_sum = 1.0 / sum;
  const double t_sheared =
      (wa * static_cast<double>(z[0]) + wb * static_cast<double>(z[1]) + wc * static_cast<double>(z[2])) *
      (inverse_sum * ray.scale);
  const double t_plane = plane_distance(ray, vertex);
  const auto t = static_cast<float>(std::fabs(t_plane - t_sheared) <= ray.t_slack ? t_plane : t_sheared);
  out.t = t < t_enter ? t_enter : (t > t_leave ? t_leave : t);
  out.u = static_cast<float>(wb * inverse_sum);
  out.v = static_cast<float>(wc * inverse_sum);
  return out.t > ray.t_min;  // false for NaN
}

// One ray against P triangles side by side. Two edge functions with opposite signs are exact, so floats alone rule out
// the lanes that have them, and those whose vertices lie beyond the limits; intersect_triangle() decides the others.

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

// Sixteen rays, each against a triangle of its own: a lane is hit where make_ray_frame() and intersect_triangle() say
// so and t < t_max. Doubles are in loops without branches, of which compilers make vectors.

inline constexpr int kRayLanes = 16;

// A field of many rays side by side.
using RayLanes = float[kRayLanes];

struct alignas(64) RayTriangles {
  RayLanes origin[3];
  RayLanes direction[3];
  RayLanes t_min;
  RayLanes t_max;
  RayLanes vertex[3][3];  // corner, axis
};

// make_ray_frame() for as many rays as F has lanes, except for what only a box asks.
template <class F>
struct RayFrameLanes {
  using M = typename F::MaskType;
  M along_0, along_2;  // where the permuted z is axis 0 or 2
  M good;              // may hit something
  F largest;           // component of the direction
  F pad, t_min;
  F z;  // direction along the permuted z
  F shear_x, shear_y;

  NPSIM_ALWAYS_INLINE RayFrameLanes(const float (&low)[3], const float (&high)[3], const F (&o)[3], const F (&d)[3],
                                    F from, F to) noexcept {
    const F a[3] = {abs(d[0]), abs(d[1]), abs(d[2])};
    const M zero_wins = a[0] >= a[1];
    const F most_01 = select(zero_wins, a[0], a[1]);
    along_2 = a[2] > most_01;
    along_0 = zero_wins & ~along_2;
    largest = select(along_2, a[2], most_01);
    t_min = max(from, F(0.0F));
    good = (largest >= F(0x1p-96F)) & (largest <= F(0x1p96F)) & (from == from) & (t_min < to);
    F reach(0.0F);
    for (int k = 0; k < 3; ++k) {
      reach = max(max(abs(F(low[k]) - o[k]), abs(F(high[k]) - o[k])), reach);
      good = good & (a[k] <= largest) & (abs(o[k]) <= F(kTraceMaxCoordinate));
    }
    pad = F(0x1p-21F) * reach + F(0x1p-126F);
    z = along_z(d);
    shear_x = along_x(d) / z;
    shear_y = along_y(d) / z;
  }
  // Components along the permuted axes.
  [[nodiscard]] NPSIM_ALWAYS_INLINE F along_x(const F (&a)[3]) const noexcept {
    return select(along_0, a[1], select(along_2, a[0], a[2]));
  }
  [[nodiscard]] NPSIM_ALWAYS_INLINE F along_y(const F (&a)[3]) const noexcept {
    return select(along_0, a[2], select(along_2, a[1], a[0]));
  }
  [[nodiscard]] NPSIM_ALWAYS_INLINE F along_z(const F (&a)[3]) const noexcept {
    return select(along_0, a[0], select(along_2, a[2], a[1]));
  }
};

namespace triangle_detail {

// What the edge functions and distances start from.
struct ShearedTriangles {
  alignas(64) RayLanes x[3];
  alignas(64) RayLanes y[3];
  alignas(64) RayLanes z[3];
  alignas(64) RayLanes along_z;  // component of the direction
  alignas(64) RayLanes pad;
};

inline void distances(const RayTriangles& in, const ShearedTriangles& s, double (&weight)[kRayLanes],
                      RayLanes& t) noexcept {
  for (int k = 0; k < kRayLanes; ++k) {
    const auto x0 = static_cast<double>(s.x[0][k]);
    const auto x1 = static_cast<double>(s.x[1][k]);
    const auto x2 = static_cast<double>(s.x[2][k]);
    const auto y0 = static_cast<double>(s.y[0][k]);
    const auto y1 = static_cast<double>(s.y[1][k]);
    const auto y2 = static_cast<double>(s.y[2][k]);
    const double wa = x2 * y1 - y2 * x1;
    const double wb = x0 * y2 - y0 * x2;
    const double wc = x1 * y0 - y1 * x0;
    const double sum = wa + wb + wc;
    const double least_ab = wa < wb ? wa : wb;
    const double least = least_ab < wc ? least_ab : wc;
    const double most_ab = wa > wb ? wa : wb;
    const double most = most_ab > wc ? most_ab : wc;
    const double opposite = most > 0.0 ? least : 0.0;  // < 0 where two signs are
    const double size = std::fabs(sum);
    weight[k] = opposite < 0.0 ? 0.0 : size;
    const double scale = 1.0 / static_cast<double>(s.along_z[k]);
    const double inverse_sum = 1.0 / sum;
    const double t_sheared = (wa * static_cast<double>(s.z[0][k]) + wb * static_cast<double>(s.z[1][k]) +
                              wc * static_cast<double>(s.z[2][k])) *
                             (inverse_sum * scale);
    const auto ax = static_cast<double>(in.vertex[0][0][k]);
    const auto ay = static_cast<double>(in.vertex[0][1][k]);
    const auto az = static_cast<double>(in.vertex[0][2][k]);
    const double px = static_cast<double>(in.vertex[1][0][k]) - ax;
    const double py = static_cast<double>(in.vertex[1][1][k]) - ay;
    const double pz = static_cast<double>(in.vertex[1][2][k]) - az;
    const double qx = static_cast<double>(in.vertex[2][0][k]) - ax;
    const double qy = static_cast<double>(in.vertex[2][1][k]) - ay;
    const double qz = static_cast<double>(in.vertex[2][2][k]) - az;
    const double nx = py * qz - pz * qy;
    const double ny = pz * qx - px * qz;
    const double nz = px * qy - py * qx;
    const double t_plane =
        (nx * (ax - static_cast<double>(in.origin[0][k])) + ny * (ay - static_cast<double>(in.origin[1][k])) +
         nz * (az - static_cast<double>(in.origin[2][k]))) /
        (nx * static_cast<double>(in.direction[0][k]) + ny * static_cast<double>(in.direction[1][k]) +
         nz * static_cast<double>(in.direction[2][k]));
    const double slack = kTraceSlackPads * static_cast<double>(s.pad[k]) * std::fabs(scale);
    const double apart = std::fabs(t_plane - t_sheared);
    t[k] = static_cast<float>(apart <= slack ? t_plane : t_sheared);
  }
}

}  // namespace triangle_detail

// Bit k: ray k hits triangle k with t < t_max. `low` and `high`: as for make_ray_frame().
template <class F>
[[nodiscard]] inline std::uint32_t hits_of_lanes(const float (&low)[3], const float (&high)[3],
                                                 const RayTriangles& in) noexcept {
  using M = typename F::MaskType;
  triangle_detail::ShearedTriangles s;
  const auto load3 = [](const RayLanes(&from)[3], int k, F(&to)[3]) noexcept {
    for (int i = 0; i < 3; ++i) to[i] = F::load(from[i] + k);
  };
  std::uint32_t hit = 0;
  for (int k = 0; k < kRayLanes; k += F::lanes) {
    F o[3];
    F d[3];
    load3(in.origin, k, o);
    load3(in.direction, k, d);
    const RayFrameLanes<F> frame(low, high, o, d, F::load(in.t_min + k), F::load(in.t_max + k));
    hit |= bits(frame.good) << static_cast<unsigned>(k);
    frame.z.store(s.along_z + k);
    frame.pad.store(s.pad + k);
    const F ox = frame.along_x(o);
    const F oy = frame.along_y(o);
    const F oz = frame.along_z(o);
    for (int i = 0; i < 3; ++i) {
      F v[3];
      load3(in.vertex[i], k, v);
      const F z = frame.along_z(v) - oz;
      z.store(s.z[i] + k);
      ((frame.along_x(v) - ox) - frame.shear_x * z).store(s.x[i] + k);
      ((frame.along_y(v) - oy) - frame.shear_y * z).store(s.y[i] + k);
    }
  }
  alignas(64) double weight[kRayLanes];
  alignas(64) RayLanes distance;
  triangle_detail::distances(in, s, weight, distance);
  for (int k = 0; k < kRayLanes; k += F::lanes) {
    F d[3];
    load3(in.direction, k, d);
    const F floor = F(0x1p-30F) * max(max(abs(d[0]), abs(d[1])), abs(d[2]));
    const F pad = F::load(s.pad + k);
    F enter[3];
    F leave[3];
    for (int i = 0; i < 3; ++i) {
      const F inverse = F(1.0F) / simd::copysign(max(abs(d[i]), floor), d[i]);
      const F o = F::load(in.origin[i] + k);
      const F a = F::load(in.vertex[0][i] + k);
      const F b = F::load(in.vertex[1][i] + k);
      const F c = F::load(in.vertex[2][i] + k);
      const F p = ((min(a, min(b, c)) - o) - pad) * inverse;
      const F q = ((max(a, max(b, c)) - o) + pad) * inverse;
      enter[i] = min(p, q);
      leave[i] = max(p, q);
    }
    const F t_enter = max(max(enter[0], enter[1]), enter[2]);
    const F t_leave = min(min(leave[0], leave[1]), leave[2]) * F(1.0F + 2.0F * rounding_gamma(3));
    const F t = F::load(distance + k);
    const F clamped = select(t < t_enter, t_enter, select(t > t_leave, t_leave, t));
    const M met =
        (t_enter <= t_leave) & (clamped > max(F::load(in.t_min + k), F(0.0F))) & (clamped < F::load(in.t_max + k));
    hit &= bits(met) << static_cast<unsigned>(k) |
           ~(((2U << static_cast<unsigned>(F::lanes - 1)) - 1U) << static_cast<unsigned>(k));
  }
  for (int k = 0; k < kRayLanes; ++k)
    hit &= ~(static_cast<std::uint32_t>(!(weight[k] > 0.0)) << static_cast<unsigned>(k));
  return hit;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_TRIANGLE_HPP
