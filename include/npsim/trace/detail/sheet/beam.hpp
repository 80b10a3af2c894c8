// SPDX-License-Identifier: Apache-2.0
// What holds rays of a packet (ray.hpp) that run alike through a sheet, and tests of all of them at once.
//
// Let m be the axis of the image that the first ray follows and n the other one. All rays are extended to the same
// places on m, the least and the greatest of their ends. In between, the least of their places on n and of their 1 /
// depth is concave and the greatest convex, so the chords from end to end bound them. A child of a node counts when,
// where the two lines of n cross its columns and rows, the two of 1 / depth come into its bounds. At either end the
// rays lie in a parallelogram of n and 1 / depth, whose slanted sides follow the surface on which they start; how far
// it lies above and below the plane of a tile, at its corners, bounds the same of every ray there, and chords again in
// between.
//
// Invariant: nothing that a ray may hit is left out; test_beam() and test_beam_tiles() keep whatever test_node() and
// test_tiles() keep for one of the rays (checked by tests/unit/trace_sheet_packet_test.cpp).
// Error: rays are taken only where their lines go on for no more than their own length at either end and no steeper
// than 4 to the axis. The ends are moved out so far that what a ray visits lies between them. With u = 2^-24, S the
// longer side of the image and W the greatest 1 / depth: a place at an end is off by at most 9 u S or 9 u W (the part
// of the way 6 u, its product, the sum), where a line crosses a cell by 12 u S, a slope raised by 8 u S, and the
// difference of a corner and a tile's plane by 40 u (|gx| + |gy|) S + 20 u W. kBeamPad, 64 u, of S and of W is added to
// the pads of the rays.
// Cost: about 30 vector instructions a node, 55 for sixteen tiles, 30 for the rays at a tile. Memory: 120 bytes.
#ifndef NPSIM_TRACE_DETAIL_SHEET_BEAM_HPP
#define NPSIM_TRACE_DETAIL_SHEET_BEAM_HPP

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/config.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/trace/detail/sheet/layout.hpp"
#include "npsim/trace/detail/sheet/ray.hpp"
#include "npsim/trace/detail/sheet/walk.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace sheet_detail {

inline constexpr float kBeamPad = 0x1p-18F;  // of the image and of the greatest 1 / depth
inline constexpr float kNever = 0x1p60F;

// s = 0 .. 1 along the beam. A line through cells is  s >= i x + c  or  s <= i x + c.
struct Beam {
  bool along_v;                 // m is v, n is u; else the other way round
  float near_i, near_m, far_m;  // of m
  float i[2];                   // of n: where the lower line meets the far side of a cell, where the upper one the near
  float c[2];
  float enter[2];  // + kNever where it is no entry
  float leave[2];
  float low_w, high_w, low_dw, high_dw;
  float least_u, most_u, least_v, most_v;
  // Its section at either end: a parallelogram from n = n_low to n_high, w between two lines over n.
  float end_m[2];
  float end_low_n[2], end_high_n[2];
  float low_w_at_low_n[2], low_w_at_high_n[2];
  float thickness[2];
  float pad_px, pad_w;
};

inline constexpr float kBeamWidth = 48;  // pixels between the ends of rays that share one

template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE float least_of(F x) noexcept {
  alignas(64) float all[F::lanes];
  x.store(all);
  for (int half = F::lanes / 2; half > 0; half /= 2) {
    for (int i = 0; i < half; ++i) all[i] = all[i + half] < all[i] ? all[i + half] : all[i];
  }
  return all[0];
}
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE float greatest_of(F x) noexcept {
  return -least_of(-x);
}

// The fields of rays along the beam: on the axis m that it follows, and on the other one, n.
struct BeamAxes {
  bool along_v;
  const float *m, *dm, *im;
  const float *n, *dn;
  NPSIM_ALWAYS_INLINE BeamAxes(const SheetRays& rays, int leader) noexcept
      : along_v(std::fabs(rays.dv[leader]) >= std::fabs(rays.du[leader])),
        m(along_v ? rays.v : rays.u),
        dm(along_v ? rays.dv : rays.du),
        im(along_v ? rays.iv : rays.iu),
        n(along_v ? rays.u : rays.v),
        dn(along_v ? rays.du : rays.dv) {}
};

// The rays of `rest` whose ends lie near the leader's: from where to where they reach on m, and their greatest pads.
struct RaysAlike {
  std::uint32_t rays;
  float least_m, most_m;
  float pad_px, pad_w;
};
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE RaysAlike rays_alike(const SheetRays& rays, const BeamAxes& a, int leader,
                                                       std::uint32_t rest) noexcept {
  const F width(kBeamWidth);
  const F never(kNever);
  std::uint32_t alike = 0;
  F least = never;
  F most = -never;
  F pad_px(0.0F);
  F pad_w(0.0F);
  for (int k = 0; k < kPacketRays; k += F::lanes) {
    const F from_m = F::load(a.m + k);
    const F from_n = F::load(a.n + k);
    const F to_m = from_m + F::load(a.dm + k);
    const F to_n = from_n + F::load(a.dn + k);
    const auto near = F::MaskType::from_bits(rest >> static_cast<unsigned>(k)) &
                      (abs(from_m - F(a.m[leader])) <= width) & (abs(from_n - F(a.n[leader])) <= width) &
                      (abs(to_m - F(a.m[leader] + a.dm[leader])) <= width) &
                      (abs(to_n - F(a.n[leader] + a.dn[leader])) <= width);
    alike |= bits(near) << static_cast<unsigned>(k);
    least = min(select(near, min(from_m, to_m), never), least);
    most = max(select(near, max(from_m, to_m), -never), most);
    pad_px = max(select(near, F::load(rays.pad_px + k), F(0.0F)), pad_px);
    pad_w = max(select(near, F::load(rays.pad_w + k), F(0.0F)), pad_w);
  }
  return {alike, least_of(least), greatest_of(most), greatest_of(pad_px), greatest_of(pad_w)};
}

// Where the rays are when they are extended to both ends of the beam.
struct BeamEnds {
  alignas(64) float n[2][kPacketRays];
  alignas(64) float w[2][kPacketRays];
  float low_n[2], high_n[2];
  float low_w[2], high_w[2];
};

// Those of the rays that may be extended, which are returned; without the leader `out` is left unfinished.
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t extend_rays(const SheetRays& rays, const BeamAxes& a, int leader,
                                                            const RaysAlike& alike, BeamEnds& out) noexcept {
  const F never(kNever);
  F low_n[2] = {never, never};
  F high_n[2] = {-never, -never};
  F low_w[2] = {never, never};
  F high_w[2] = {-never, -never};
  std::uint32_t kept = 0;
  for (int k = 0; k < kPacketRays; k += F::lanes) {
    const F from_m = F::load(a.m + k);
    const F from_n = F::load(a.n + k);
    const F to_n = F::load(a.dn + k);
    const F inverse = F::load(a.im + k);
    const F first = (F(alike.least_m) - from_m) * inverse;
    const F last = (F(alike.most_m) - from_m) * inverse;
    const auto good = F::MaskType::from_bits(alike.rays >> static_cast<unsigned>(k)) &
                      (abs(to_n) <= F(4.0F) * abs(F::load(a.dm + k))) & (min(first, last) >= F(-1.0F)) &
                      (max(first, last) <= F(2.0F));
    kept |= bits(good) << static_cast<unsigned>(k);
    for (int e = 0; e < 2; ++e) {
      const F s = e == 0 ? first : last;
      const F at = fma(s, to_n, from_n);
      const F w = fma(s, F::load(rays.dw + k), F::load(rays.w + k));
      at.store(out.n[e] + k);
      w.store(out.w[e] + k);
      low_n[e] = min(select(good, at, never), low_n[e]);
      high_n[e] = max(select(good, at, -never), high_n[e]);
      low_w[e] = min(select(good, w, never), low_w[e]);
      high_w[e] = max(select(good, w, -never), high_w[e]);
    }
  }
  if ((kept >> static_cast<unsigned>(leader) & 1U) == 0) return kept;
  for (int e = 0; e < 2; ++e) {
    out.low_n[e] = least_of(low_n[e]) - 2.0F * alike.pad_px;
    out.high_n[e] = greatest_of(high_n[e]) + 2.0F * alike.pad_px;
    out.low_w[e] = least_of(low_w[e]);
    out.high_w[e] = greatest_of(high_w[e]);
  }
  return kept;
}

// The lower (0) or upper (1) line of n, from its place at one end to that at the other. `raise`: the least slope.
NPSIM_ALWAYS_INLINE void set_line(int which, const float (&ends)[2], float raise, Beam& beam) noexcept {
  const float slope = ends[1] - ends[0];
  const float raised = std::fabs(slope) >= raise ? slope : std::copysign(raise, slope);
  beam.i[which] = 1.0F / raised;
  beam.c[which] = -ends[0] * beam.i[which];
  // The lower line is below the far side before it crosses upwards, or after it crosses downwards.
  const bool is_leave = (which == 0) == (raised > 0);
  beam.enter[which] = is_leave ? -kNever : kNever;
  beam.leave[which] = is_leave ? -kNever : kNever;
}

// The parallelogram of n and w at end e, slanted as w changes from the first ray to the last one, unless that is
// steeper than all w together.
template <class F>
NPSIM_ALWAYS_INLINE void set_section(const BeamEnds& ends, int e, std::uint32_t kept, int leader,
                                     float max_inverse_depth, Beam& beam) noexcept {
  const int last_ray = highest_set_bit(kept);
  const float from_n = ends.n[e][leader];
  const float slope = (ends.w[e][last_ray] - ends.w[e][leader]) / (ends.n[e][last_ray] - from_n);
  const bool fits = std::fabs(slope) * (ends.high_n[e] - ends.low_n[e]) <= 2.0F * max_inverse_depth;
  const F fitted(fits ? slope : 0.0F);
  const F never(kNever);
  F low = never;
  F high = -never;
  for (int k = 0; k < kPacketRays; k += F::lanes) {
    const auto good = F::MaskType::from_bits(kept >> static_cast<unsigned>(k));
    const F rest_w = F::load(ends.w[e] + k) - fitted * (F::load(ends.n[e] + k) - F(from_n));
    low = min(select(good, rest_w, never), low);
    high = max(select(good, rest_w, -never), high);
  }
  const float lowest = least_of(low);
  beam.end_low_n[e] = ends.low_n[e];
  beam.end_high_n[e] = ends.high_n[e];
  beam.low_w_at_low_n[e] = lowest + (fits ? slope * (ends.low_n[e] - from_n) : 0.0F);
  beam.low_w_at_high_n[e] = lowest + (fits ? slope * (ends.high_n[e] - from_n) : 0.0F);
  beam.thickness[e] = greatest_of(high) - lowest;
}

// The beam of the first of these rays and of those that run alike, which are returned; 0: it runs alike with none.
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t make_beam(const SheetRays& rays, std::uint32_t rest,
                                                          const SheetBounds& bounds, Beam& beam) noexcept {
  const int leader = lowest_set_bit(rest);
  const BeamAxes axes(rays, leader);
  RaysAlike alike = rays_alike<F>(rays, axes, leader, rest);
  const auto side = static_cast<float>(std::max(bounds.image.width, bounds.image.height));
  alike.pad_px += kBeamPad * side;
  alike.pad_w += kBeamPad * bounds.max_inverse_depth;
  const float ease = alike.pad_px + 0x1p-14F * (alike.most_m - alike.least_m);
  alike.least_m -= ease;
  alike.most_m += ease;
  BeamEnds ends;
  const std::uint32_t kept = extend_rays<F>(rays, axes, leader, alike, ends);
  if ((kept >> static_cast<unsigned>(leader) & 1U) == 0) return 0;
  beam.along_v = axes.along_v;
  beam.near_i = 1.0F / (alike.most_m - alike.least_m);  // of more than 0
  beam.near_m = -(alike.least_m + alike.pad_px) * beam.near_i;
  beam.far_m = -(alike.least_m - alike.pad_px) * beam.near_i;
  set_line(0, ends.low_n, 0x1p-22F * side, beam);
  set_line(1, ends.high_n, 0x1p-22F * side, beam);
  beam.low_w = ends.low_w[0] - alike.pad_w;
  beam.low_dw = ends.low_w[1] - ends.low_w[0];
  beam.high_w = ends.high_w[0] + alike.pad_w;
  beam.high_dw = ends.high_w[1] - ends.high_w[0];
  beam.end_m[0] = alike.least_m;
  beam.end_m[1] = alike.most_m;
  beam.pad_px = alike.pad_px;
  beam.pad_w = alike.pad_w;
  for (int e = 0; e < 2; ++e) set_section<F>(ends, e, kept, leader, bounds.max_inverse_depth, beam);
  const float least_n = std::min(ends.low_n[0], ends.low_n[1]);
  const float most_n = std::max(ends.high_n[0], ends.high_n[1]);
  beam.least_u = axes.along_v ? least_n : alike.least_m;
  beam.most_u = axes.along_v ? most_n : alike.most_m;
  beam.least_v = axes.along_v ? alike.least_m : least_n;
  beam.most_v = axes.along_v ? alike.most_m : most_n;
  return kept;
}

// As Crossing of a ray; m and n are where a cell starts.
template <class F>
struct BeamCrossing {
  F m, n, enter, leave;

  NPSIM_ALWAYS_INLINE BeamCrossing(const Beam& beam, float x, float y, float size, int part) noexcept {
    const F columns = fma(simd::block_columns<F>(part), F(size), F(x));
    const F rows = fma(simd::block_rows<F>(part), F(size), F(y));
    m = beam.along_v ? rows : columns;
    n = beam.along_v ? columns : rows;
    const F lower = fma(n, F(beam.i[0]), F(beam.c[0] + size * beam.i[0]));
    const F upper = fma(n, F(beam.i[1]), F(beam.c[1]));
    enter = max(max(fma(m, F(beam.near_i), F(beam.near_m)), F(kBeforeStart)),
                max(min(lower, F(beam.enter[0])), min(upper, F(beam.enter[1]))));
    leave = min(min(fma(m, F(beam.near_i), F(beam.far_m + size * beam.near_i)), F(kPastEnd)),
                min(max(lower, F(beam.leave[0])), max(upper, F(beam.leave[1]))));
  }
};

// test_node() for a beam.
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t test_beam(const SheetNode& node, const Beam& beam, float x, float y,
                                                          float size) noexcept {
  std::uint32_t mask = 0;
  for (int part = 0; part < simd::kBlockElements / F::lanes; ++part) {
    const int k = part * F::lanes;
    const BeamCrossing<F> c(beam, x, y, size, part);
    const F low = min(fma(c.enter, F(beam.low_dw), F(beam.low_w)), fma(c.leave, F(beam.low_dw), F(beam.low_w)));
    const F high = max(fma(c.enter, F(beam.high_dw), F(beam.high_w)), fma(c.leave, F(beam.high_dw), F(beam.high_w)));
    const auto found = (c.enter <= c.leave) & (low <= F::load(node.high + k)) & (high >= F::load(node.low + k));
    mask |= bits(found) << static_cast<unsigned>(k);
  }
  return mask;
}

// test_tiles() for a beam.
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t test_beam_tiles(const SheetTiles& tiles, const Beam& beam, float x,
                                                                float y) noexcept {
  std::uint32_t mask = 0;
  for (int part = 0; part < simd::kBlockElements / F::lanes; ++part) {
    const int k = part * F::lanes;
    const BeamCrossing<F> c(beam, x, y, 4.0F, part);
    const F gx = F::load(tiles.gx + k);
    const F gy = F::load(tiles.gy + k);
    const F gm = beam.along_v ? gy : gx;
    const F gn = beam.along_v ? gx : gy;
    // How far the corners of both sections lie above the tile's plane.
    F low[2];
    F high[2];
    for (int e = 0; e < 2; ++e) {
      const F from = fma(-gm, F(beam.end_m[e]) - c.m, -F::load(tiles.base + k));
      const F at_low = fma(-gn, F(beam.end_low_n[e]) - c.n, from + F(beam.low_w_at_low_n[e]));
      const F at_high = fma(-gn, F(beam.end_high_n[e]) - c.n, from + F(beam.low_w_at_high_n[e]));
      low[e] = min(at_low, at_high);
      high[e] = max(at_low, at_high) + F(beam.thickness[e]);
    }
    const F low_change = low[1] - low[0];
    const F high_change = high[1] - high[0];
    const F lowest = min(fma(c.enter, low_change, low[0]), fma(c.leave, low_change, low[0]));
    const F highest = max(fma(c.enter, high_change, high[0]), fma(c.leave, high_change, high[0]));
    const F tolerance = fma(abs(gx) + abs(gy), F(beam.pad_px), F::load(tiles.half + k) + F(beam.pad_w));
    const auto found = (c.enter <= c.leave) & (lowest <= tolerance) & (highest >= -tolerance);
    mask |= bits(found) << static_cast<unsigned>(k);
  }
  return mask;
}

// What meets_slab() asks of a ray, of many.
template <class F>
struct RaysAtCell {
  F w, du, dv, dw, pad_px, pad_w;
};

// The rays that meet the slab of the tile at (x, y), as test_tiles() says of each.
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t test_rays_tile(const SheetRays& rays, float x, float y, float base,
                                                               float gx, float gy, float half) noexcept {
  std::uint32_t mask = 0;
  for (int k = 0; k < kPacketRays; k += F::lanes) {
    const F iu = F::load(rays.iu + k);
    const F iv = F::load(rays.iv + k);
    const F four(4.0F);
    const F near_u = fma(F(x), iu, F::load(rays.near_u + k) + four * F::load(rays.back_u + k));
    const F near_v = fma(F(y), iv, F::load(rays.near_v + k) + four * F::load(rays.back_v + k));
    const F far_u = fma(F(x), iu, F::load(rays.far_u + k) + four * F::load(rays.ahead_u + k));
    const F far_v = fma(F(y), iv, F::load(rays.far_v + k) + four * F::load(rays.ahead_v + k));
    const F enter = max(max(near_u, near_v), F(kBeforeStart));
    const F leave = min(min(far_u, far_v), F(kPastEnd));
    const RaysAtCell<F> cell{F::load(rays.w + k),  F::load(rays.du + k),     F::load(rays.dv + k),
                             F::load(rays.dw + k), F::load(rays.pad_px + k), F::load(rays.pad_w + k)};
    const auto m = meets_slab(cell, enter, leave, F::load(rays.u + k) - F(x), F::load(rays.v + k) - F(y), F(base),
                              F(gx), F(gy), F(half));
    mask |= bits(m) << static_cast<unsigned>(k);
  }
  return mask;
}

}  // namespace sheet_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_BEAM_HPP
