// SPDX-License-Identifier: Apache-2.0
// Whether the faces of one quad block rays of a packet (sheet_ray_lanes.hpp), all rays at once.
//
// Invariant: a ray is blocked where intersect_triangle() and its limits of t say so. The edge functions are those of
// intersect_triangle(), by the same operations: where the three are not 0 they have the exact signs. The t of the
// corners enclose that of the sheared ray, and `slack`, twice what the t that is reported may be off, covers the
// rounding of both. Rays for which a sign or t is not clear are made ready by themselves and asked one by one.
// Cost: about 80 vector instructions a quad and axis for all rays of a packet. Memory: none.
#ifndef NPSIM_TRACE_SHEET_FACE_LANES_HPP
#define NPSIM_TRACE_SHEET_FACE_LANES_HPP

#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/trace/ray.hpp"
#include "npsim/trace/sheet_layout.hpp"
#include "npsim/trace/sheet_ray_lanes.hpp"
#include "npsim/trace/triangle.hpp"

namespace npsim {
inline namespace v1 {
inline namespace NPSIM_ISA_NAMESPACE {
namespace sheet_detail {

// Rays that may be blocked by a face, and those of them that are.
struct RaysMet {
  std::uint32_t open = 0;
  std::uint32_t sure = 0;
};

// A quad's corners seen from rays with one permuted z.
template <class F>
struct ShearedQuad {
  F x[4], y[4], t[4];

  NPSIM_ALWAYS_INLINE ShearedQuad(const float (&corners)[4][3], int axis, const SheetRays& rays, int k) noexcept {
    const int kx = axis == 2 ? 0 : axis + 1;
    const int ky = kx == 2 ? 0 : kx + 1;
    const F ox = F::load(rays.x + k);
    const F oy = F::load(rays.y + k);
    const F oz = F::load(rays.z + k);
    const F shear_x = F::load(rays.shear_x + k);
    const F shear_y = F::load(rays.shear_y + k);
    const F scale = F::load(rays.scale + k);
    for (int i = 0; i < 4; ++i) {
      const F z = F(corners[i][axis]) - oz;
      x[i] = (F(corners[i][kx]) - ox) - shear_x * z;
      y[i] = (F(corners[i][ky]) - oy) - shear_y * z;
      t[i] = z * scale;
    }
  }
  [[nodiscard]] NPSIM_ALWAYS_INLINE F edge(int i, int j) const noexcept { return x[i] * y[j] - y[i] * x[j]; }
};

// Of the face with these edge functions and t of its corners.
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE RaysMet rays_met(F a, F b, F c, F t0, F t1, F t2, const SheetRays& rays,
                                                   int k) noexcept {
  const F zero(0.0F);
  const F least = min(min(a, b), c);
  const F greatest = max(max(a, b), c);
  const auto inside = (zero <= least) | (greatest <= zero);
  const auto strictly = (zero < least) | (greatest < zero);
  const F slack = F::load(rays.slack + k);
  const F t_low = min(min(t0, t1), t2) - slack;
  const F t_high = max(max(t0, t1), t2) + slack;
  const F t_min = F::load(rays.t_min + k);
  const F t_max = F::load(rays.t_max + k);
  const auto within = (t_low <= t_max) & (t_min <= t_high);
  const auto clearly = (t_min < t_low) & (t_high < t_max);
  return {bits(inside & within) << static_cast<unsigned>(k), bits(strictly & clearly) << static_cast<unsigned>(k)};
}

// The rays among `asked` that a face of quad (x, y) with accept(face) blocks. `upper`, `lower`: which faces there are.
template <class F, class Accept>
[[nodiscard]] NPSIM_ALWAYS_INLINE std::uint32_t blocked_by_quad(const SheetTrace& sheet, const SheetBounds& bounds,
                                                                const Ray* input, const SheetRays& rays,
                                                                std::uint32_t asked, int x, int y, bool upper,
                                                                bool lower, Accept&& accept) noexcept {
  const Vec3f* p = sheet.vertices.row(y) + x;
  const Vec3f* q = sheet.vertices.row(y + 1) + x;
  const float corners[4][3] = {
      {p[0].x, p[0].y, p[0].z}, {p[1].x, p[1].y, p[1].z}, {q[0].x, q[0].y, q[0].z}, {q[1].x, q[1].y, q[1].z}};
  const bool anti = (sheet.quads(x, y) & kQuadAntiDiagonal) != 0;
  RaysMet met[2];
  constexpr std::uint32_t all_lanes = F::lanes == 16 ? 0xFFFFU : (1U << static_cast<unsigned>(F::lanes % 16)) - 1U;
  for (int axis = 0; axis < 3; ++axis) {
    const std::uint32_t alike = asked & rays.along[axis];
    if (alike == 0) continue;
    for (int k = 0; k < kPacketRays; k += F::lanes) {
      const std::uint32_t lanes = alike & (all_lanes << static_cast<unsigned>(k));
      if (lanes == 0) continue;
      const ShearedQuad<F> c(corners, axis, rays, k);
      const F across = anti ? c.edge(2, 1) : c.edge(3, 0);  // the diagonal, seen from the upper face
      // Corners 0 1 3 and 0 3 2, or 0 1 2 and 1 3 2.
      const RaysMet up = rays_met<F>(across, anti ? c.edge(1, 0) : c.edge(0, 1), anti ? c.edge(0, 2) : c.edge(1, 3),
                                     c.t[0], c.t[1], anti ? c.t[2] : c.t[3], rays, k);
      const RaysMet down = rays_met<F>(-across, anti ? c.edge(2, 3) : c.edge(3, 2), anti ? c.edge(3, 1) : c.edge(2, 0),
                                       c.t[3], c.t[2], anti ? c.t[1] : c.t[0], rays, k);
      met[0].open |= up.open & lanes;
      met[0].sure |= up.sure & lanes;
      met[1].open |= down.open & lanes;
      met[1].sure |= down.sure & lanes;
    }
  }
  std::uint32_t blocked = 0;
  const std::uint32_t number = 2U * (static_cast<std::uint32_t>(y) * static_cast<std::uint32_t>(sheet.quads.width()) +
                                     static_cast<std::uint32_t>(x));
  for (const bool is_upper : {true, false}) {
    const RaysMet& m = met[is_upper ? 0 : 1];
    std::uint32_t rest = (m.open | m.sure) & ~blocked;
    if (!(is_upper ? upper : lower) || rest == 0 || !accept(is_upper ? number : number + 1)) continue;
    blocked |= m.sure;
    for (rest &= ~m.sure; rest != 0; rest &= rest - 1) {
      const int k = lowest_set_bit(rest);
      const Face face = quad_face(anti, is_upper, 0, 1, 2, 3);
      float vertex[3][3];
      for (int i = 0; i < 3; ++i) {
        vertex[0][i] = corners[face.a][i];
        vertex[1][i] = corners[face.b][i];
        vertex[2][i] = corners[face.c][i];
      }
      RayFrame frame;
      TriangleHit hit;
      if (make_ray_frame(input[k], bounds.low, bounds.high, frame) && intersect_triangle(frame, vertex, hit) &&
          hit.t < frame.t_max) {
        blocked |= 1U << static_cast<unsigned>(k);
      }
    }
  }
  return blocked;
}

}  // namespace sheet_detail
}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_TRACE_SHEET_FACE_LANES_HPP
