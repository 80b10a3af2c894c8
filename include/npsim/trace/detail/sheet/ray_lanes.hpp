// SPDX-License-Identifier: Apache-2.0
// Sixteen rays made ready for a sheet at once: what make_sheet_ray() (sheet_ray.hpp) makes of each, a field side by
// side.
//
// Invariant: every field of a ray that may hit something has the bits that make_sheet_ray() gives it, because the
// operations are the same; so are its bounds of rounding. What only a hit needs (inverse, direction, t) is not kept:
// triangle_lanes.hpp makes it anew. The loops have 16 turns without branches, which
// compilers turn into vectors, of floats and of doubles.
// Cost: about 10 ns a ray. Memory: 2.2 KiB.
#ifndef NPSIM_TRACE_DETAIL_SHEET_RAY_LANES_HPP
#define NPSIM_TRACE_DETAIL_SHEET_RAY_LANES_HPP

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "npsim/core/config.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/trace/detail/sheet/layout.hpp"
#include "npsim/trace/detail/sheet/ray.hpp"
#include "npsim/trace/detail/triangle/lanes.hpp"
#include "npsim/trace/detail/triangle/triangle.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

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

// The part of a packet that lies within the bounds, by their six sides: t from first to last.
struct ClippedRays {
  using Doubles = double[kPacketRays];
  alignas(64) Doubles first;
  alignas(64) Doubles last;
  alignas(64) Doubles off;  // how far a point that is hit may be off the ray: off + off_per_t t
  alignas(64) Doubles off_per_t;
  alignas(64) Doubles outside;  // < 0: all of it is
  alignas(64) Doubles rho;      // see sheet_ray.hpp; not below 1/8 where the projection says nothing
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

#endif  // NPSIM_TRACE_DETAIL_SHEET_RAY_LANES_HPP
