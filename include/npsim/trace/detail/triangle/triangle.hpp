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
// 8 u reach where 6 are needed; directions below 2^-30 of the largest
// component are raised to it, which shifts the ray by less than 2^-30 reach and makes every reciprocal finite, so no
// 0 * inf arises. A slab distance has three roundings; the exit distance is scaled by 1 + 2 gamma(3), gamma(n) =
// n u / (1 - n u). Hence the interval of a box holds every hit inside it.
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
#ifndef NPSIM_TRACE_DETAIL_TRIANGLE_TRIANGLE_HPP
#define NPSIM_TRACE_DETAIL_TRIANGLE_TRIANGLE_HPP

#include <cmath>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr float kTraceMaxCoordinate = 0x1p60F;  // metres; products of two sums of these stay finite
inline constexpr double kTraceSlackPads = 60.0;        // of t, see above

// n roundings to nearest change a value by a factor within 1 +- rounding_gamma(n).
[[nodiscard]] constexpr float rounding_gamma(int n) noexcept {
  return static_cast<float>(n) * 0x1p-24F / (1.0F - static_cast<float>(n) * 0x1p-24F);
}

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

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_TRIANGLE_TRIANGLE_HPP
