// SPDX-License-Identifier: Apache-2.0
// Rays made ready for a sheet, one (SheetRay) or sixteen (SheetRays): the part of a ray that may meet the sheet,
// projected, and the bounds of every rounding.
//
// What is a hit is decided by intersect_triangle() (detail/triangle.hpp) on the vertices alone; everything here only
// has to leave no face out that it may hit. The point of the triangle that is hit lies within pad = 2^-21 reach of the
// ray in each component (detail/triangle.hpp): the corners' distances from where the ray starts count, however near the
// hit is, and reach is no less than any of them. Where pad is more than 2^-13 of the least depth, some vertex lying
// thousands of times as far, that would make every test as loose; there a hit is taken to lie within 2^-13 t D, D the
// largest component of the direction: all are found but those in faces with a corner 300 times as far as the hit. Hence
//   clip    a side g(p) >= 0 with coefficients of sum `size` is taken as g(o + t d) + size off(t) >= 0, off being one
//           or the other: linear in t;
//   rho     the greatest off / z on the clipped ray, found at one of its ends: the point is off the ray by at most rho
//           of its depth, hence by rho / (1 - rho) focal_reach pixels and, in 1 / z, by that part of it. Where rho
//           exceeds 1/8 nothing is left out at all: all faces are tested (a ray that comes from thousands of times the
//           depth of what it might hit);
//   pad_px  of that, the vertices' distance from the grid, and 2^-19 of the image for the floats of the projection (u
//           and v at an end: 2^-24, a slope of 0 raised to 2^-22, s and u(s): 2^-22 of the image);
//   pad_w   of that, and 2^-19 of the greatest 1 / z for a slab and what is computed from it;
//   pad_t   t' and the t that is reported differ by at most 60 x 2^-21 reach / D and a rounding, so limits of t are
//           moved by 64 times that.
// Projection, clipping and the change between t and s = 0 .. 1 on the projected ray are done in double.
//
// Invariant: every field of one of sixteen rays that may hit something has the bits that it has alone, because the
// operations are the same. What only a hit needs (inverse, direction, t) is not kept there. Loops over the sixteen have
// no branches, so that compilers turn them into vectors, of floats and of doubles.
// Cost: about 8 divisions a ray alone, 10 ns a ray among sixteen. Memory: 2.2 KiB for sixteen.
#ifndef NPSIM_TRACE_DETAIL_SHEET_RAY_HPP
#define NPSIM_TRACE_DETAIL_SHEET_RAY_HPP

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "npsim/core/config.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/trace/detail/sheet/layout.hpp"
#include "npsim/trace/detail/triangle.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
struct SheetRay {
  RayFrame frame;
  float u, v, w;           // at s = 0, in pixels from the first one's centre, and 1 / m
  float du, dv, dw;        // to s = 1; du and dv are not 0
  float iu, iv;            // 1 / du, 1 / dv
  float back_u, back_v;    // the same where it is negative, else 0
  float ahead_u, ahead_v;  // where it is positive
  float near_u, far_u;     // s where the ray enters and leaves column x, pads included: x iu + near_u, x iu + far_u
  float near_v, far_v;     // the same of rows
  float pad_px, pad_w;
  float s_max;      // nothing beyond it matters
  bool everything;  // the projection says nothing
  double z, dz;     // of the ray, unprojected
  double t_first, t_last;
  double s_scale;
  double pad_t;
};

inline constexpr int kPacketRays = kRayLanes;

// See SheetRay and RayFrame for what is called alike.
struct alignas(64) SheetRays {
  RayLanes u, v, w;
  RayLanes du, dv, dw;
  RayLanes iu, iv;
  RayLanes back_u, back_v;
  RayLanes ahead_u, ahead_v;
  RayLanes near_u, far_u;
  RayLanes near_v, far_v;
  RayLanes pad_px, pad_w;
  RayLanes x, y, z;  // where it starts, along its permuted axes
  RayLanes shear_x, shear_y;
  RayLanes scale;  // 1 / d_z
  RayLanes slack;  // twice the greatest difference of t that is reported and t of the sheared ray
  RayLanes t_min, t_max;
  std::uint32_t projected;   // bit k: ray k may hit something, and has the fields above
  std::uint32_t everything;  // bit k: it may hit something, but its projection says nothing
  std::uint32_t along[3];    // the rays whose permuted z is this axis
};

namespace sheet_detail {

// One ray.

inline constexpr float kPastEnd = 1.0F + 0x1p-16F;

// Lets no face matter that lies beyond t.
inline void shorten(SheetRay& ray, float t) noexcept {
  const double end = static_cast<double>(t) + ray.pad_t;
  if (!(end < ray.t_last)) return;
  const double past = end - ray.t_first;
  const double z = ray.z + end * ray.dz;
  const double s = past > 0 ? past * ray.s_scale / z : 0.0;
  ray.s_max = static_cast<float>(s) * kPastEnd + 0x1p-40F;
}

// How far off the ray at t a point that is hit may be: constant + slope t.
struct HitError {
  double constant, slope;
};
[[nodiscard]] NPSIM_ALWAYS_INLINE HitError hit_error(const SheetBounds& bounds, double pad, double size) noexcept {
  const bool ordinary = pad * static_cast<double>(bounds.max_inverse_depth) <= 0x1p-13;
  return {ordinary ? pad : 0.0, ordinary ? 0.0 : 0x1p-13 * size};
}

// The part of a ray within the bounds, t from first to last; false when it is empty.
[[nodiscard]] NPSIM_ALWAYS_INLINE bool clip_ray(const SheetBounds& bounds, const double (&o)[3], const double (&d)[3],
                                                const HitError& error, double& first, double& last) noexcept {
  double at[8];
  double slope[8];
  double cut[8];
  for (int i = 0; i < 8; ++i) {
    at[i] =
        bounds.x[i] * o[0] + bounds.y[i] * o[1] + bounds.z[i] * o[2] + (bounds.d[i] + bounds.size[i] * error.constant);
    slope[i] = bounds.x[i] * d[0] + bounds.y[i] * d[1] + bounds.z[i] * d[2] + bounds.size[i] * error.slope;
    cut[i] = -at[i] / slope[i];
  }
  bool outside = false;
  for (int i = 0; i < 6; ++i) {
    first = slope[i] > 0 && cut[i] > first ? cut[i] : first;
    last = slope[i] < 0 && cut[i] < last ? cut[i] : last;
    outside = outside || (slope[i] == 0 && at[i] < 0);
  }
  return !outside && first <= last;
}

// What a ray has of its projection, from the ends of its clipped part in the image. rho: see above.
NPSIM_ALWAYS_INLINE void finish_ray(const SheetBounds& bounds, double u0, double v0, double w0, double u1, double v1,
                                    double w1, double rho, SheetRay& out) noexcept {
  const float least = 0x1p-22F * static_cast<float>(std::max(bounds.image.width, bounds.image.height));
  const auto raised = [least](double x) {
    const auto f = static_cast<float>(x);
    return std::fabs(f) >= least ? f : std::copysign(least, f);
  };
  out.u = static_cast<float>(u0);
  out.v = static_cast<float>(v0);
  out.w = static_cast<float>(w0);
  out.du = raised(u1 - u0);
  out.dv = raised(v1 - v0);
  out.dw = static_cast<float>(w1 - w0);
  out.iu = 1.0F / out.du;
  out.iv = 1.0F / out.dv;
  out.back_u = std::min(out.iu, 0.0F);
  out.back_v = std::min(out.iv, 0.0F);
  out.ahead_u = std::max(out.iu, 0.0F);
  out.ahead_v = std::max(out.iv, 0.0F);
  const auto off = static_cast<float>(rho) * 1.25F;  // rho / (1 - rho) and its rounding
  out.pad_px = off * bounds.focal_reach + bounds.pad_px;
  const float pad_u = out.pad_px * std::fabs(out.iu);
  const float pad_v = out.pad_px * std::fabs(out.iv);
  out.near_u = -out.u * out.iu - pad_u;
  out.far_u = -out.u * out.iu + pad_u;
  out.near_v = -out.v * out.iv - pad_v;
  out.far_v = -out.v * out.iv + pad_v;
  out.pad_w = 1.25F * (off * static_cast<float>(std::max(w0, w1)) + 0x1p-19F * bounds.max_inverse_depth);
}

// False when the ray cannot hit anything within the bounds.
[[nodiscard]] inline bool make_sheet_ray(const SheetBounds& bounds, const Ray& ray, SheetRay& out) noexcept {
  if (!(bounds.max_inverse_depth > 0) || !make_ray_frame(ray, bounds.low, bounds.high, out.frame)) return false;
  const double o[3] = {static_cast<double>(ray.origin.x), static_cast<double>(ray.origin.y),
                       static_cast<double>(ray.origin.z)};
  const double d[3] = {static_cast<double>(ray.direction.x), static_cast<double>(ray.direction.y),
                       static_cast<double>(ray.direction.z)};
  const double size = std::max(std::fabs(d[0]), std::max(std::fabs(d[1]), std::fabs(d[2])));
  const auto pad = static_cast<double>(out.frame.pad);
  const HitError error = hit_error(bounds, pad, size);
  out.pad_t = 64.0 * pad / size;
  double t0 = std::max(static_cast<double>(out.frame.t_min) - out.pad_t, 0.0);
  double t1 = static_cast<double>(out.frame.t_max) + out.pad_t;
  if (!clip_ray(bounds, o, d, error, t0, t1)) return false;
  out.z = o[2];
  out.dz = d[2];
  out.t_first = t0;
  out.t_last = t1;
  out.s_max = kPastEnd;
  const double z0 = o[2] + t0 * d[2];
  const double z1 = o[2] + t1 * d[2];
  const double w0 = 1.0 / z0;
  const double w1 = 1.0 / z1;
  const double rho =
      std::max((error.constant + error.slope * t0) * w0, (error.constant + error.slope * t1) * w1) * (1 + 0x1p-40);
  out.everything = !(z0 > 0 && z1 > 0 && rho < 0.125 && t1 < static_cast<double>(kTraceMaxCoordinate) * 0x1p100);
  if (out.everything) return true;
  out.s_scale = t1 > t0 ? z1 / (t1 - t0) : 0.0;
  const auto fx = static_cast<double>(bounds.camera.fx);
  const auto fy = static_cast<double>(bounds.camera.fy);
  const double cx = static_cast<double>(bounds.camera.cx) - 0.5;
  const double cy = static_cast<double>(bounds.camera.cy) - 0.5;
  finish_ray(bounds, fx * (o[0] + t0 * d[0]) * w0 + cx, fy * (o[1] + t0 * d[1]) * w0 + cy, w0,
             fx * (o[0] + t1 * d[0]) * w1 + cx, fy * (o[1] + t1 * d[1]) * w1 + cy, w1, rho, out);
  return true;
}

// Sixteen rays.

// The part of a packet that lies within the bounds, by their six sides: t from first to last.
struct ClippedRays {
  using Doubles = double[kPacketRays];
  alignas(64) Doubles first;
  alignas(64) Doubles last;
  alignas(64) Doubles off;  // how far a point that is hit may be off the ray: off + off_per_t t
  alignas(64) Doubles off_per_t;
  alignas(64) Doubles outside;  // < 0: all of it is
  alignas(64) Doubles rho;      // not below 1/8 where the projection says nothing
};

// make_ray_frame() for part of a packet; the rays that may hit something.
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t make_frames(const SheetBounds& bounds, const RayLanes (&origin)[3],
                                                            const RayLanes (&direction)[3], const RayLanes& t_min,
                                                            int k, RayLanes& largest, RayLanes& pad,
                                                            SheetRays& out) noexcept {
  const F o[3] = {F::load(origin[0] + k), F::load(origin[1] + k), F::load(origin[2] + k)};
  const F d[3] = {F::load(direction[0] + k), F::load(direction[1] + k), F::load(direction[2] + k)};
  const RayFrameLanes<F> frame(bounds.low, bounds.high, o, d, F::load(t_min + k), F::load(out.t_max + k));
  frame.largest.store(largest + k);
  frame.pad.store(pad + k);
  frame.t_min.store(out.t_min + k);
  frame.along_x(o).store(out.x + k);
  frame.along_y(o).store(out.y + k);
  frame.along_z(o).store(out.z + k);
  frame.shear_x.store(out.shear_x + k);
  frame.shear_y.store(out.shear_y + k);
  const F scale = F(1.0F) / frame.z;
  scale.store(out.scale + k);
  (F(2.0F * static_cast<float>(kTraceSlackPads)) * frame.pad * abs(scale)).store(out.slack + k);
  out.along[0] |= bits(frame.along_0) << static_cast<unsigned>(k);
  out.along[2] |= bits(frame.along_2) << static_cast<unsigned>(k);
  return bits(frame.good) << static_cast<unsigned>(k);
}

// Loops whose comparisons depend on nothing: compilers make vectors of them.
inline void clip_rays(const SheetBounds& bounds, const RayLanes (&o)[3], const RayLanes (&d)[3],
                      const RayLanes& largest, const RayLanes& pad, const SheetRays& rays, ClippedRays& out) noexcept {
  constexpr int n = kPacketRays;
  constexpr double never = std::numeric_limits<double>::infinity();
  for (int k = 0; k < n; ++k) {
    const auto size = static_cast<double>(largest[k]);
    const HitError error = hit_error(bounds, static_cast<double>(pad[k]), size);
    out.off[k] = error.constant;
    out.off_per_t[k] = error.slope;
    const double pad_t = 64.0 * static_cast<double>(pad[k]) / size;
    const double first = static_cast<double>(rays.t_min[k]) - pad_t;
    out.first[k] = first < 0.0 ? 0.0 : first;
    out.last[k] = static_cast<double>(rays.t_max[k]) + pad_t;
    out.outside[k] = 0.0;
  }
  for (int i = 0; i < 6; ++i) {
    const double x = bounds.x[i];
    const double y = bounds.y[i];
    const double z = bounds.z[i];
    const double constant = bounds.d[i];
    const double size = bounds.size[i];
    for (int k = 0; k < n; ++k) {
      const double at = x * static_cast<double>(o[0][k]) + y * static_cast<double>(o[1][k]) +
                        z * static_cast<double>(o[2][k]) + (constant + size * out.off[k]);
      const double slope = x * static_cast<double>(d[0][k]) + y * static_cast<double>(d[1][k]) +
                           z * static_cast<double>(d[2][k]) + size * out.off_per_t[k];
      const double cut = -at / slope;
      const double enter = slope > 0.0 ? cut : -never;
      const double leave = slope < 0.0 ? cut : never;
      const double beyond = slope == 0.0 ? at : 0.0;
      out.first[k] = enter > out.first[k] ? enter : out.first[k];
      out.last[k] = leave < out.last[k] ? leave : out.last[k];
      out.outside[k] = beyond < out.outside[k] ? beyond : out.outside[k];
    }
  }
}

// Ends of the clipped rays in the image, and how far off they may be: rho, not below 1/8 where that says nothing.
inline void project_rays(const SheetBounds& bounds, const RayLanes (&o)[3], const RayLanes (&d)[3],
                         ClippedRays& clipped, RayLanes& rho, RayLanes& most_w, SheetRays& out) noexcept {
  constexpr int n = kPacketRays;
  const auto fx = static_cast<double>(bounds.camera.fx);
  const auto fy = static_cast<double>(bounds.camera.fy);
  const double cx = static_cast<double>(bounds.camera.cx) - 0.5;
  const double cy = static_cast<double>(bounds.camera.cy) - 0.5;
  const double t_limit = static_cast<double>(kTraceMaxCoordinate) * 0x1p100;
  for (int k = 0; k < n; ++k) {
    const auto ox = static_cast<double>(o[0][k]);
    const auto oy = static_cast<double>(o[1][k]);
    const auto oz = static_cast<double>(o[2][k]);
    const auto dx = static_cast<double>(d[0][k]);
    const auto dy = static_cast<double>(d[1][k]);
    const auto dz = static_cast<double>(d[2][k]);
    const double t0 = clipped.first[k];
    const double t1 = clipped.last[k];
    const double z0 = oz + t0 * dz;
    const double z1 = oz + t1 * dz;
    const double w0 = 1.0 / z0;
    const double w1 = 1.0 / z1;
    const double a = (clipped.off[k] + clipped.off_per_t[k] * t0) * w0;
    const double b = (clipped.off[k] + clipped.off_per_t[k] * t1) * w1;
    const double off = (a < b ? b : a) * (1 + 0x1p-40);
    const double nearest = z0 < z1 ? z0 : z1;
    const double near_side = nearest > 0.0 ? off : 1.0;
    const double far_side = t1 < t_limit ? off : 1.0;
    rho[k] = static_cast<float>(off);
    clipped.rho[k] = near_side < far_side ? far_side : near_side;
    most_w[k] = static_cast<float>(w0 < w1 ? w1 : w0);
    const double u0 = fx * (ox + t0 * dx) * w0 + cx;
    const double v0 = fy * (oy + t0 * dy) * w0 + cy;
    out.u[k] = static_cast<float>(u0);
    out.v[k] = static_cast<float>(v0);
    out.w[k] = static_cast<float>(w0);
    out.du[k] = static_cast<float>(fx * (ox + t1 * dx) * w1 + cx - u0);
    out.dv[k] = static_cast<float>(fy * (oy + t1 * dy) * w1 + cy - v0);
    out.dw[k] = static_cast<float>(w1 - w0);
  }
}

// What a SheetRay holds of the projection, for part of a packet.
template <class F>
NPSIM_ALWAYS_INLINE void finish_rays(const SheetBounds& bounds, const RayLanes& rho, const RayLanes& most_w, int k,
                                     SheetRays& out) noexcept {
  const F zero(0.0F);
  const F least(0x1p-22F * static_cast<float>(std::max(bounds.image.width, bounds.image.height)));
  const auto raised = [least](F x) noexcept { return select(abs(x) >= least, x, simd::copysign(least, x)); };
  const F du = raised(F::load(out.du + k));
  const F dv = raised(F::load(out.dv + k));
  const F iu = F(1.0F) / du;
  const F iv = F(1.0F) / dv;
  const F off = F::load(rho + k) * F(1.25F);
  const F pad_px = off * F(bounds.focal_reach) + F(bounds.pad_px);
  const F at_u = -F::load(out.u + k) * iu;
  const F at_v = -F::load(out.v + k) * iv;
  const F pad_u = pad_px * abs(iu);
  const F pad_v = pad_px * abs(iv);
  du.store(out.du + k);
  dv.store(out.dv + k);
  iu.store(out.iu + k);
  iv.store(out.iv + k);
  min(iu, zero).store(out.back_u + k);
  min(iv, zero).store(out.back_v + k);
  max(iu, zero).store(out.ahead_u + k);
  max(iv, zero).store(out.ahead_v + k);
  (at_u - pad_u).store(out.near_u + k);
  (at_u + pad_u).store(out.far_u + k);
  (at_v - pad_v).store(out.near_v + k);
  (at_v + pad_v).store(out.far_v + k);
  pad_px.store(out.pad_px + k);
  (F(1.25F) * (off * F::load(most_w + k) + F(0x1p-19F * bounds.max_inverse_depth))).store(out.pad_w + k);
}

// `count` rays, 1 to kPacketRays; the lanes beyond hold the last one, but no bit.
template <class F>
void make_sheet_rays(const SheetBounds& bounds, const Ray* rays, int count, SheetRays& out) noexcept {
  constexpr int n = kPacketRays;
  alignas(64) RayLanes o[3];
  alignas(64) RayLanes d[3];
  alignas(64) RayLanes t_min;
  for (int k = 0; k < n; ++k) {
    const Ray& ray = rays[std::min(k, count - 1)];
    o[0][k] = ray.origin.x;
    o[1][k] = ray.origin.y;
    o[2][k] = ray.origin.z;
    d[0][k] = ray.direction.x;
    d[1][k] = ray.direction.y;
    d[2][k] = ray.direction.z;
    t_min[k] = ray.t_min;
    out.t_max[k] = ray.t_max;
  }
  alignas(64) RayLanes largest;
  alignas(64) RayLanes pad;
  out.along[0] = 0;
  out.along[2] = 0;
  std::uint32_t good = 0;
  for (int k = 0; k < n; k += F::lanes) {
    good |= make_frames<F>(bounds, o, d, t_min, k, largest, pad, out);
  }
  out.along[1] = ~(out.along[0] | out.along[2]);
  ClippedRays clipped;
  clip_rays(bounds, o, d, largest, pad, out, clipped);
  alignas(64) RayLanes rho;
  alignas(64) RayLanes most_w;
  project_rays(bounds, o, d, clipped, rho, most_w, out);
  std::uint32_t all = bounds.max_inverse_depth > 0 ? (2U << static_cast<unsigned>(count - 1)) - 1U : 0U;
  std::uint32_t projected = 0;
  for (int k = 0; k < n; ++k) {
    const auto met = static_cast<std::uint32_t>(clipped.first[k] <= clipped.last[k]) &
                     static_cast<std::uint32_t>(!(clipped.outside[k] < 0.0));
    good &= ~((met ^ 1U) << static_cast<unsigned>(k));
    projected |= static_cast<std::uint32_t>(clipped.rho[k] < 0.125) << static_cast<unsigned>(k);
  }
  out.projected = all & good & projected;
  out.everything = all & good & ~projected;
  for (int k = 0; k < n; k += F::lanes) finish_rays<F>(bounds, rho, most_w, k, out);
}

}  // namespace sheet_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_RAY_HPP
