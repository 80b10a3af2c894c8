// SPDX-License-Identifier: Apache-2.0
// A ray made ready for a sheet: the part of it that may meet the sheet, projected, and the bounds of every rounding.
//
// What is a hit is decided by intersect_triangle() (triangle.hpp) on the vertices alone; everything here only has to
// leave no face out that it may hit. The point of the triangle that is hit lies within pad = 2^-21 reach of the ray in
// each component (triangle.hpp): the corners' distances from where the ray starts count, however near the hit is, and
// reach is no less than any of them. Where pad is more than 2^-13 of the least depth, some vertex lying thousands of
// times as far, that would make every test as loose; there a hit is taken to lie within 2^-13 t D, D the largest
// component of the direction: all are found but those in faces with a corner 300 times as far as the hit. Hence
//   clip    a side g(p) >= 0 with coefficients of sum `size` is taken as g(o + t d) + size off(t) >= 0, off being one
//   or
//           the other: linear in t;
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
// Cost: about 8 divisions. Memory: none.
#ifndef NPSIM_TRACE_DETAIL_SHEET_RAY_HPP
#define NPSIM_TRACE_DETAIL_SHEET_RAY_HPP

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/trace/detail/sheet/layout.hpp"
#include "npsim/trace/detail/triangle/triangle.hpp"

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

namespace sheet_detail {

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
    t0 = slope[i] > 0 && cut[i] > t0 ? cut[i] : t0;
    t1 = slope[i] < 0 && cut[i] < t1 ? cut[i] : t1;
    outside = outside || (slope[i] == 0 && at[i] < 0);
  }
  if (outside) return false;
  if (!(t0 <= t1)) return false;
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
  const double fx = static_cast<double>(bounds.camera.fx);
  const double fy = static_cast<double>(bounds.camera.fy);
  const double cx = static_cast<double>(bounds.camera.cx) - 0.5;
  const double cy = static_cast<double>(bounds.camera.cy) - 0.5;
  const double u0 = fx * (o[0] + t0 * d[0]) * w0 + cx;
  const double v0 = fy * (o[1] + t0 * d[1]) * w0 + cy;
  const double u1 = fx * (o[0] + t1 * d[0]) * w1 + cx;
  const double v1 = fy * (o[1] + t1 * d[1]) * w1 + cy;
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
  return true;
}

}  // namespace sheet_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_RAY_HPP
