// SPDX-License-Identifier: Apache-2.0
// Sixteen rays made ready for a sheet at once: what make_sheet_ray() (sheet_ray.hpp) makes of each, a field side by
// side.
//
// Invariant: every field of a ray that may hit something has the bits that make_sheet_ray() gives it, because the
// operations are the same; so are its bounds of rounding. What only a hit needs (inverse, direction, t) is not kept: a
// face that floats cannot decide takes the ray made ready by itself. The loops have 16 turns without branches, which
// compilers turn into vectors, of floats and of doubles.
// Cost: about 10 ns a ray. Memory: 2.2 KiB.
#ifndef NPSIM_TRACE_SHEET_RAY_LANES_HPP
#define NPSIM_TRACE_SHEET_RAY_LANES_HPP

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "npsim/simd/batch.hpp"
#include "npsim/simd/isa.hpp"
#include "npsim/trace/ray.hpp"
#include "npsim/trace/sheet_layout.hpp"
#include "npsim/trace/sheet_ray.hpp"
#include "npsim/trace/triangle.hpp"

namespace npsim {
inline namespace v1 {

inline constexpr int kPacketRays = 16;

// See SheetRay and RayFrame for what is called alike.
struct alignas(64) SheetRays {
  using Lanes = float[kPacketRays];
  Lanes u, v, w;
  Lanes du, dv, dw;
  Lanes iu, iv;
  Lanes back_u, back_v;
  Lanes ahead_u, ahead_v;
  Lanes near_u, far_u;
  Lanes near_v, far_v;
  Lanes pad_px, pad_w;
  Lanes x, y, z;  // where it starts, along its permuted axes
  Lanes shear_x, shear_y;
  Lanes scale;  // 1 / d_z
  Lanes slack;  // twice the greatest difference of t that is reported and t of the sheared ray
  Lanes t_min, t_max;
  std::uint32_t projected;   // bit k: ray k may hit something, and has the fields above
  std::uint32_t everything;  // bit k: it may hit something, but its projection says nothing
  std::uint32_t along[3];    // the rays whose permuted z is this axis
};

inline namespace NPSIM_ISA_NAMESPACE {
namespace sheet_detail {

// The part of a packet that lies within the bounds, by their six sides: t from first to last.
struct ClippedRays {
  using Doubles = double[kPacketRays];
  alignas(64) Doubles first;
  alignas(64) Doubles last;
  alignas(64) Doubles e;        // error of a point for t = 1
  alignas(64) Doubles outside;  // < 0: all of it is
  alignas(64) Doubles rho;      // see sheet_ray.hpp; not below 1/8 where the projection says nothing
};

// make_ray_frame() for part of a packet; the rays that may hit something.
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE typename F::MaskType make_frames(const SheetBounds& bounds, const float* o,
                                                                   const float* d, const float* t_limits, int k,
                                                                   float* largest, float* pad,
                                                                   SheetRays& out) noexcept {
  using M = typename F::MaskType;
  constexpr int n = kPacketRays;
  const F o0 = F::load(o + k);
  const F o1 = F::load(o + n + k);
  const F o2 = F::load(o + 2 * n + k);
  const F d0 = F::load(d + k);
  const F d1 = F::load(d + n + k);
  const F d2 = F::load(d + 2 * n + k);
  const F a0 = abs(d0);
  const F a1 = abs(d1);
  const F a2 = abs(d2);
  const M zero_wins = a0 >= a1;
  const F most_01 = select(zero_wins, a0, a1);
  const M along_2 = a2 > most_01;
  const M along_0 = zero_wins & ~along_2;
  const F most = select(along_2, a2, most_01);
  const F reach_0 = max(abs(F(bounds.low[0]) - o0), abs(F(bounds.high[0]) - o0));
  const F reach_1 = max(abs(F(bounds.low[1]) - o1), abs(F(bounds.high[1]) - o1));
  const F reach_2 = max(abs(F(bounds.low[2]) - o2), abs(F(bounds.high[2]) - o2));
  const F reach = max(reach_2, max(reach_1, max(reach_0, F(0.0F))));
  const F limit(kTraceMaxCoordinate);
  const F from = F::load(t_limits + k);
  const F to = F::load(t_limits + n + k);
  const F t_min = max(from, F(0.0F));
  const F box = F(0x1p-21F) * reach + F(0x1p-126F);
  most.store(largest + k);
  box.store(pad + k);
  t_min.store(out.t_min + k);
  to.store(out.t_max + k);
  const auto permuted = [&](F if_0, F if_1, F if_2) noexcept {
    return select(along_0, if_0, select(along_2, if_2, if_1));
  };
  const F z = permuted(d0, d1, d2);
  permuted(o1, o2, o0).store(out.x + k);
  permuted(o2, o0, o1).store(out.y + k);
  permuted(o0, o1, o2).store(out.z + k);
  (permuted(d1, d2, d0) / z).store(out.shear_x + k);
  (permuted(d2, d0, d1) / z).store(out.shear_y + k);
  const F scale = F(1.0F) / z;
  scale.store(out.scale + k);
  (F(2.0F * static_cast<float>(kTraceSlackPads)) * box * abs(scale)).store(out.slack + k);
  out.along[0] |= bits(along_0) << static_cast<unsigned>(k);
  out.along[2] |= bits(along_2) << static_cast<unsigned>(k);
  return (most >= F(0x1p-96F)) & (most <= F(0x1p96F)) & (a0 <= most) & (a1 <= most) & (a2 <= most) &
         (abs(o0) <= limit) & (abs(o1) <= limit) & (abs(o2) <= limit) & (from == from) & (t_min < to);
}

// Loops whose comparisons depend on nothing: compilers make vectors of them.
inline void clip_rays(const SheetBounds& bounds, const float* o, const float* d, const float* largest, const float* pad,
                      const SheetRays& rays, ClippedRays& out) noexcept {
  constexpr int n = kPacketRays;
  constexpr double never = std::numeric_limits<double>::infinity();
  for (int k = 0; k < n; ++k) {
    const auto size = static_cast<double>(largest[k]);
    const double pad_t = 64.0 * static_cast<double>(pad[k]) / size;
    const double first = static_cast<double>(rays.t_min[k]) - pad_t;
    out.e[k] = 0x1p-21 * size;
    out.first[k] = first < 0.0 ? 0.0 : first;
    out.last[k] = static_cast<double>(rays.t_max[k]) + pad_t;
    out.outside[k] = 0.0;
  }
  for (int i = 0; i < 6; ++i) {
    const double x = bounds.x[i];
    const double y = bounds.y[i];
    const double z = bounds.z[i];
    for (int k = 0; k < n; ++k) {
      const double at = x * static_cast<double>(o[k]) + y * static_cast<double>(o[n + k]) +
                        z * static_cast<double>(o[2 * n + k]) + bounds.d[i];
      const double slope = x * static_cast<double>(d[k]) + y * static_cast<double>(d[n + k]) +
                           z * static_cast<double>(d[2 * n + k]) + bounds.size[i] * out.e[k];
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
inline void project_rays(const SheetBounds& bounds, const float* o, const float* d, ClippedRays& clipped, float* rho,
                         float* most_w, SheetRays& out) noexcept {
  constexpr int n = kPacketRays;
  const auto fx = static_cast<double>(bounds.camera.fx);
  const auto fy = static_cast<double>(bounds.camera.fy);
  const double cx = static_cast<double>(bounds.camera.cx) - 0.5;
  const double cy = static_cast<double>(bounds.camera.cy) - 0.5;
  const double t_limit = static_cast<double>(kTraceMaxCoordinate) * 0x1p100;
  for (int k = 0; k < n; ++k) {
    const auto ox = static_cast<double>(o[k]);
    const auto oy = static_cast<double>(o[n + k]);
    const auto oz = static_cast<double>(o[2 * n + k]);
    const auto dx = static_cast<double>(d[k]);
    const auto dy = static_cast<double>(d[n + k]);
    const auto dz = static_cast<double>(d[2 * n + k]);
    const double t0 = clipped.first[k];
    const double t1 = clipped.last[k];
    const double z0 = oz + t0 * dz;
    const double z1 = oz + t1 * dz;
    const double w0 = 1.0 / z0;
    const double w1 = 1.0 / z1;
    const double a = t0 * w0;
    const double b = t1 * w1;
    const double off = clipped.e[k] * (a < b ? b : a) * (1 + 0x1p-40);
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
NPSIM_ALWAYS_INLINE void finish_rays(const SheetBounds& bounds, const float* rho, const float* most_w, int k,
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
  alignas(64) float o[3 * n];
  alignas(64) float d[3 * n];
  alignas(64) float t_limits[2 * n];
  for (int k = 0; k < n; ++k) {
    const Ray& ray = rays[std::min(k, count - 1)];
    o[k] = ray.origin.x;
    o[n + k] = ray.origin.y;
    o[2 * n + k] = ray.origin.z;
    d[k] = ray.direction.x;
    d[n + k] = ray.direction.y;
    d[2 * n + k] = ray.direction.z;
    t_limits[k] = ray.t_min;
    t_limits[n + k] = ray.t_max;
  }
  alignas(64) float largest[n];
  alignas(64) float pad[n];
  out.along[0] = 0;
  out.along[2] = 0;
  std::uint32_t good = 0;
  for (int k = 0; k < n; k += F::lanes) {
    good |= bits(make_frames<F>(bounds, o, d, t_limits, k, largest, pad, out)) << static_cast<unsigned>(k);
  }
  out.along[1] = ~(out.along[0] | out.along[2]);
  ClippedRays clipped;
  clip_rays(bounds, o, d, largest, pad, out, clipped);
  alignas(64) float rho[n];
  alignas(64) float most_w[n];
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
}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_TRACE_SHEET_RAY_LANES_HPP
