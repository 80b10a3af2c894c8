// SPDX-License-Identifier: Apache-2.0
// Whether the faces of one quad block rays of a packet (sheet_ray_lanes.hpp), all rays at once.
//
// Invariant: a ray is blocked where intersect_triangle() and its limits of t say so. The edge functions are those of
// intersect_triangle(), by the same operations: where the three are not 0 they have the exact signs. The t of the
// corners enclose that of the sheared ray, and `slack`, twice what the t that is reported may be off, covers the
// rounding of both. Rays for which a sign or t is not clear are handed on (triangle_lanes.hpp decides): mostly those
// that start on the quad. Cost: about 80 vector instructions a quad and axis for all rays of a packet. Memory: none.
#ifndef NPSIM_TRACE_DETAIL_SHEET_FACE_LANES_HPP
#define NPSIM_TRACE_DETAIL_SHEET_FACE_LANES_HPP

#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/trace/detail/sheet/layout.hpp"
#include "npsim/trace/detail/sheet/ray_lanes.hpp"
#include "npsim/trace/detail/sheet/test.hpp"
#include "npsim/trace/detail/triangle/triangle.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace sheet_detail {

template <class F>
[[nodiscard]] constexpr std::uint32_t lanes_of() noexcept {
  return (2U << static_cast<unsigned>(F::lanes - 1)) - 1U;
}

// A quad's corners in the order of its faces: the ends of its diagonal, the third corner of the upper face, that of
// the lower one.
struct QuadCorners {
  const Vec3f* at[4];
  bool anti;

  NPSIM_ALWAYS_INLINE QuadCorners(const SheetTrace& sheet, int x, int y) noexcept {
    const Vec3f* p = sheet.vertices.row(y) + x;
    const Vec3f* q = sheet.vertices.row(y + 1) + x;
    anti = (sheet.quads(x, y) & kQuadAntiDiagonal) != 0;
    const int to_anti = anti ? 1 : 0;  // no branch comes of these: diagonals are hard to guess
    at[0] = p + to_anti;
    at[1] = q + (1 - to_anti);
    at[2] = p + (1 - to_anti);
    at[3] = q + to_anti;
  }
};

// Rays that meet faces of a quad, for as many rays as F has lanes.
template <class F>
struct QuadMet {
  using M = typename F::MaskType;
  M open[2];  // upper and lower face: may be hit
  M sure[2];  // is hit

  // Of sheared corners; t of the corners on the ray.
  NPSIM_ALWAYS_INLINE QuadMet(const F (&x)[4], const F (&y)[4], const F (&t)[4], F slack, F t_min, F t_max) noexcept {
    const auto edge = [&x, &y](int i, int j) noexcept { return x[i] * y[j] - y[i] * x[j]; };
    const F zero(0.0F);
    const F across = edge(0, 1);
    const F t_low = min(t[0], t[1]);
    const F t_high = max(t[0], t[1]);
    for (int face = 0; face < 2; ++face) {
      const int third = 2 + face;
      const F b = edge(1, third);
      const F c = edge(third, 0);
      const F least = min(min(across, b), c);
      const F greatest = max(max(across, b), c);
      const F low = min(t_low, t[third]) - slack;
      const F high = max(t_high, t[third]) + slack;
      open[face] = ((zero <= least) | (greatest <= zero)) & (low <= t_max) & (t_min <= high);
      sure[face] = ((zero < least) | (greatest < zero)) & (t_min < low) & (high < t_max);
    }
  }
};

// The rays among `asked` that a face of quad (x, y) with accept(face) blocks for sure, and in `open` those that one may
// block. Bits 0 and 16 of `faces`: which there are.
template <class F, class Accept>
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t blocked_by_quad(const SheetTrace& sheet, const SheetRays& rays,
                                                                std::uint32_t asked, int x, int y, std::uint32_t faces,
                                                                Accept&& accept, std::uint32_t& open) noexcept {
  const QuadCorners corners(sheet, x, y);
  std::uint32_t met[2] = {};
  std::uint32_t sure[2] = {};
  for (int axis = 0; axis < 3; ++axis) {
    const std::uint32_t alike = asked & rays.along[axis];
    if (alike == 0) continue;
    const int kx = axis == 2 ? 0 : axis + 1;
    const int ky = kx == 2 ? 0 : kx + 1;
    for (int k = 0; k < kPacketRays; k += F::lanes) {
      const std::uint32_t lanes = alike >> static_cast<unsigned>(k) & lanes_of<F>();
      if (lanes == 0) continue;
      const F ox = F::load(rays.x + k);
      const F oy = F::load(rays.y + k);
      const F oz = F::load(rays.z + k);
      const F shear_x = F::load(rays.shear_x + k);
      const F shear_y = F::load(rays.shear_y + k);
      const F scale = F::load(rays.scale + k);
      F cx[4];
      F cy[4];
      F t[4];
      for (int i = 0; i < 4; ++i) {
        const float* at = &corners.at[i]->x;
        const F z = F(at[axis]) - oz;
        cx[i] = (F(at[kx]) - ox) - shear_x * z;
        cy[i] = (F(at[ky]) - oy) - shear_y * z;
        t[i] = z * scale;
      }
      const QuadMet<F> quad(cx, cy, t, F::load(rays.slack + k), F::load(rays.t_min + k), F::load(rays.t_max + k));
      for (int face = 0; face < 2; ++face) {
        met[face] |= (bits(quad.open[face]) & lanes) << static_cast<unsigned>(k);
        sure[face] |= (bits(quad.sure[face]) & lanes) << static_cast<unsigned>(k);
      }
    }
  }
  std::uint32_t blocked = 0;
  open = 0;
  const std::uint32_t number = number_of_quad(sheet, x, y);
  for (unsigned face = 0; face < 2; ++face) {
    const std::uint32_t there = 0U - (faces >> 16U * face & 1U);
    open |= met[face] & there;
    const std::uint32_t hit = sure[face] & there & ~blocked;
    if (hit != 0 && accept(number + face)) blocked |= hit;
  }
  open &= ~blocked;
  return blocked;
}

// Pairs of a ray and a quad that wait until all lanes have one.
struct alignas(64) RayQuads {
  RayTriangles pairs;  // the rays; the triangles are chosen when they are decided
  RayLanes corner[4][3];
  std::uint32_t anti = 0;       // bit k: of pair k
  std::uint32_t faces[2] = {};  // bit k: the upper and the lower face of pair k is there
  std::uint32_t number[kRayLanes];
  std::uint8_t ray[kRayLanes];
  int count = 0;

  NPSIM_ALWAYS_INLINE void add(const Ray& r, int which, const QuadCorners& quad, std::uint32_t quad_faces,
                               std::uint32_t quad_number) noexcept {
    const int k = count++;
    const auto bit = static_cast<unsigned>(k);
    ray[k] = static_cast<std::uint8_t>(which);
    number[k] = quad_number;
    anti |= (quad.anti ? 1U : 0U) << bit;
    faces[0] |= (quad_faces & 1U) << bit;
    faces[1] |= (quad_faces >> 16U & 1U) << bit;
    pairs.origin[0][k] = r.origin.x;
    pairs.origin[1][k] = r.origin.y;
    pairs.origin[2][k] = r.origin.z;
    pairs.direction[0][k] = r.direction.x;
    pairs.direction[1][k] = r.direction.y;
    pairs.direction[2][k] = r.direction.z;
    pairs.t_min[k] = r.t_min;
    pairs.t_max[k] = r.t_max;
    for (int i = 0; i < 4; ++i) {
      corner[i][0][k] = quad.at[i]->x;
      corner[i][1][k] = quad.at[i]->y;
      corner[i][2][k] = quad.at[i]->z;
    }
  }
};

// Pairs of which a face with accept(face) is hit.
template <class F, class Accept>
[[nodiscard]] std::uint32_t blocked_of_pairs(const SheetBounds& bounds, RayQuads& quads, Accept&& accept) noexcept {
  std::uint32_t open[2] = {};
  for (int k = 0; k < kRayLanes; k += F::lanes) {
    const RayTriangles& in = quads.pairs;
    const F o[3] = {F::load(in.origin[0] + k), F::load(in.origin[1] + k), F::load(in.origin[2] + k)};
    const F d[3] = {F::load(in.direction[0] + k), F::load(in.direction[1] + k), F::load(in.direction[2] + k)};
    const F t_max = F::load(in.t_max + k);
    const RayFrameLanes<F> frame(bounds.low, bounds.high, o, d, F::load(in.t_min + k), t_max);
    const F ox = frame.along_x(o);
    const F oy = frame.along_y(o);
    const F oz = frame.along_z(o);
    const F scale = F(1.0F) / frame.z;
    F x[4];
    F y[4];
    F t[4];
    for (int i = 0; i < 4; ++i) {
      const F v[3] = {F::load(quads.corner[i][0] + k), F::load(quads.corner[i][1] + k),
                      F::load(quads.corner[i][2] + k)};
      const F z = frame.along_z(v) - oz;
      x[i] = (frame.along_x(v) - ox) - frame.shear_x * z;
      y[i] = (frame.along_y(v) - oy) - frame.shear_y * z;
      t[i] = z * scale;
    }
    const F slack = F(2.0F * static_cast<float>(kTraceSlackPads)) * frame.pad * abs(scale);
    const QuadMet<F> quad(x, y, t, slack, frame.t_min, t_max);
    for (int face = 0; face < 2; ++face) open[face] |= bits(quad.open[face]) << static_cast<unsigned>(k);
  }
  const std::uint32_t used = (1U << static_cast<unsigned>(quads.count)) - 1U;
  open[0] &= quads.faces[0] & used;
  open[1] &= quads.faces[1] & used;
  std::uint32_t blocked = 0;
  // A line meets one face of a quad, hardly ever both.
  while ((open[0] | open[1]) != 0) {
    const std::uint32_t upper = open[0];
    const std::uint32_t asked = open[0] | open[1];
    for (int k = 0; k < kRayLanes; k += F::lanes) {
      const auto is_upper = F::MaskType::from_bits(upper >> static_cast<unsigned>(k));
      const auto is_anti = F::MaskType::from_bits(quads.anti >> static_cast<unsigned>(k));
      for (int i = 0; i < 3; ++i) {
        const F p = F::load(quads.corner[0][i] + k);
        const F q = F::load(quads.corner[1][i] + k);
        const F up = F::load(quads.corner[2][i] + k);
        const F down = F::load(quads.corner[3][i] + k);
        // As quad_face() orders them.
        select(is_upper & is_anti, up, p).store(quads.pairs.vertex[0][i] + k);
        select(is_upper | is_anti, q, down).store(quads.pairs.vertex[1][i] + k);
        select(is_upper, select(is_anti, p, up), select(is_anti, down, q)).store(quads.pairs.vertex[2][i] + k);
      }
    }
    std::uint32_t hits = hits_of_lanes<F>(bounds.low, bounds.high, quads.pairs) & asked;
    for (; hits != 0; hits &= hits - 1) {
      const int k = lowest_set_bit(hits);
      const bool is_upper = (upper >> static_cast<unsigned>(k) & 1U) != 0;
      if (accept(quads.number[k] + (is_upper ? 0U : 1U))) blocked |= 1U << static_cast<unsigned>(k);
    }
    open[1] &= upper & ~blocked;
    open[0] = 0;
  }
  quads.count = 0;
  quads.anti = 0;
  quads.faces[0] = 0;
  quads.faces[1] = 0;
  return blocked;
}

}  // namespace sheet_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_FACE_LANES_HPP
