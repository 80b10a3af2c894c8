// SPDX-License-Identifier: Apache-2.0
// Shadow rays with nearly one end, sixteen from neighbouring pixels at a time, through a sheet.
//
// Rays are made ready together (ray.hpp). Those that run alike share a beam (beam.hpp), which goes down the pyramid to
// 16x16 quads and their tiles for all of them, from their ends on. Then the rays are lanes of a test of each tile; the
// quads of a tile are lanes for each of its rays; the rays are lanes again against the faces of a quad, or, where few
// meet the same one, pairs of a ray and a quad are. A ray that is blocked leaves the packet.
//
// Faces. The edge functions are those of intersect_triangle(), by the same operations: where the three are not 0 they
// have the exact signs. The t of the corners enclose that of the sheared ray, and `slack`, twice what the t that is
// reported may be off, covers the rounding of both. Rays for which a sign or t is not clear are handed on as pairs
// (hits_of_lanes() decides): mostly those that start on the quad.
//
// Invariant: what is left out is only what none of the rays would visit, and a face blocks a ray where
// intersect_triangle() and its limits of t say so: the answers are those of single rays, bit for bit, for any rays and
// lanes. Rays that do not look like a packet are left to stream.hpp. Cost: 0.4 of the time of streams. With 16 rays of
// a row of a picture, a ray takes .5 nodes, 1 test of a tile, 2.3 tests of a tile's quads and 1 quad; a quad's faces
// take about 80 vector instructions an axis for all rays. Memory: 12 KiB of stack beside a stream's.
#ifndef NPSIM_TRACE_DETAIL_SHEET_PACKET_HPP
#define NPSIM_TRACE_DETAIL_SHEET_PACKET_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/fixed.hpp"
#include "npsim/trace/detail/sheet/beam.hpp"
#include "npsim/trace/detail/sheet/layout.hpp"
#include "npsim/trace/detail/sheet/ray.hpp"
#include "npsim/trace/detail/sheet/stream.hpp"
#include "npsim/trace/detail/sheet/walk.hpp"
#include "npsim/trace/detail/triangle.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace sheet_detail {

// Faces of a quad.

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

// The packet.

inline constexpr float kNeighbourPixels = 40.0F;  // between where rays of a packet start

// One ray of a packet, as what test_quads() asks of a SheetRay.
struct RayOfPacket {
  const float &u, &v, &w, &du, &dv, &dw, &iu, &iv, &back_u, &back_v, &ahead_u, &ahead_v, &near_u, &far_u, &near_v,
      &far_v, &pad_px, &pad_w;
  static constexpr float s_max = kPastEnd;
  NPSIM_ALWAYS_INLINE RayOfPacket(const SheetRays& r, int k) noexcept
      : u(r.u[k]),
        v(r.v[k]),
        w(r.w[k]),
        du(r.du[k]),
        dv(r.dv[k]),
        dw(r.dw[k]),
        iu(r.iu[k]),
        iv(r.iv[k]),
        back_u(r.back_u[k]),
        back_v(r.back_v[k]),
        ahead_u(r.ahead_u[k]),
        ahead_v(r.ahead_v[k]),
        near_u(r.near_u[k]),
        far_u(r.far_u[k]),
        near_v(r.near_v[k]),
        far_v(r.far_v[k]),
        pad_px(r.pad_px[k]),
        pad_w(r.pad_w[k]) {}
};

template <class F, class Accept>
class Packet {
 public:
  Packet(Span<const SheetTrace> layers, const SheetBounds& bounds, Accept& accept) noexcept
      : layers_(layers), bounds_(bounds), accept_(accept) {}

  // The rays, of up to kPacketRays, that are blocked.
  [[nodiscard]] std::uint32_t run(const Ray* rays, int count) noexcept {
    input_ = rays;
    make_sheet_rays<F>(bounds_, rays, count, rays_);
    alive_ = rays_.projected | rays_.everything;
    const std::uint32_t met = alive_;
    std::uint32_t rest = rays_.projected;
    std::uint32_t alone = rays_.everything;
    while (rest != 0) {
      Beam beam;
      const std::uint32_t alike = make_beam<F>(rays_, rest, bounds_, beam);
      if ((alike & (alike - 1U)) == 0) {  // one or none
        alone |= rest & (0U - rest);
        rest &= rest - 1;
        continue;
      }
      rest &= ~alike;
      first_face_ = 0;
      for (const SheetTrace& sheet : layers_) {
        if (sheet.levels > 0) walk(sheet, beam, alike);
        if ((alive_ & alike) == 0) break;
        first_face_ += sheet_face_count(sheet.vertices.shape());
      }
    }
    for (; alone != 0; alone &= alone - 1) {
      const int k = lowest_set_bit(alone);
      const AnyQuery<Accept> query{accept_, {}};
      typename AnyQuery<Accept>::Answer answer{false};
      static_cast<void>(trace_one<F>(layers_, bounds_, rays[k], query, answer));
      alive_ &= ~((answer.blocked ? 1U : 0U) << static_cast<unsigned>(k));
    }
    settle();
    return met & ~alive_;
  }

 private:
  struct Met {  // a tile or a quad, and the rays that may meet it
    int x, y;
    std::uint32_t rays;
    std::uint32_t faces;  // of a quad
  };
  static constexpr int kTiles = 32;
  static constexpr int kQuads = 64;
  static constexpr int kFewRays = 2;    // of a quad: they become pairs, lanes together with those of other quads
  static constexpr int kPairsWait = 4;  // no more of them than this, lest rays go on that are blocked

  void walk(const SheetTrace& sheet, const Beam& beam, std::uint32_t alike) noexcept {
    members_ = alike;
    SheetWalk w;
    start_at(sheet, beam.least_u, beam.most_u, beam.least_v, beam.most_v, 0, w);
    // From the end, where the rays are close and a face blocks many: those do not get to their starts, where each is
    // on its own.
    const int one = lowest_set_bit(alike);
    w.flip = (rays_.du[one] > 0 ? 3U : 0U) | (rays_.dv[one] > 0 ? 12U : 0U);
    tile_count_ = 0;
    quad_count_ = 0;
    if (w.level == 0) {
      visit_group(sheet, beam, w.x, w.y);
      visit_tiles(sheet);
      visit_quads(sheet);
      return;
    }
    for (Step step = Step::nodes; step != Step::none && (alive_ & members_) != 0; step = next_step(w)) {
      const int size = 4 << (2 * w.level);
      const SheetNode& node = sheet.nodes[sheet.first[w.level] + node_index(sheet, w.level, w.x, w.y)];
      const std::uint32_t found = test_beam<F>(node, beam, static_cast<float>(4 * w.x * size),
                                               static_cast<float>(4 * w.y * size), static_cast<float>(size));
      if (w.level > 1) {
        add_children<true>(found, w);
        continue;
      }
      for (std::uint32_t rest = found; rest != 0; rest &= rest - 1) {
        const int k = lowest_set_bit(rest);
        prefetch_object(sheet.tiles[node_index(sheet, 0, 4 * w.x + (k & 3), 4 * w.y + (k >> 2))]);
      }
      for (std::uint32_t rest = along(found, w.flip); rest != 0; rest &= rest - 1) {
        const int k = lowest_set_bit(rest) ^ static_cast<int>(w.flip);
        visit_group(sheet, beam, 4 * w.x + (k & 3), 4 * w.y + (k >> 2));
      }
      visit_tiles(sheet);
      visit_quads(sheet);
      if (pairs_.count >= kPairsWait) settle();
    }
  }

  void visit_group(const SheetTrace& sheet, const Beam& beam, int x, int y) noexcept {
    const int first = tile_count_;
    const SheetTiles& tiles = sheet.tiles[node_index(sheet, 0, x, y)];
    std::uint32_t rest = test_beam_tiles<F>(tiles, beam, static_cast<float>(kSheetGroupQuads * x),
                                            static_cast<float>(kSheetGroupQuads * y));
    for (; rest != 0; rest &= rest - 1) {
      const int k = lowest_set_bit(rest);
      Met& t = tiles_[tile_count_];
      t.x = 4 * (4 * x + (k & 3));
      t.y = 4 * (4 * y + (k >> 2));
      t.rays = alive_ & members_ &
               test_rays_tile<F>(rays_, static_cast<float>(t.x), static_cast<float>(t.y), tiles.base[k], tiles.gx[k],
                                 tiles.gy[k], tiles.half[k]);
      tile_count_ += t.rays != 0 ? 1 : 0;
      if (tile_count_ == kTiles) visit_tiles(sheet);
    }
    for (int i = first; i < tile_count_; ++i) {
      prefetch_relief(sheet, place_of_tile(sheet, tiles_[i].x / 4, tiles_[i].y / 4));
    }
  }

  void visit_tiles(const SheetTrace& sheet) noexcept {
    using I = typename F::Int;
    for (int i = 0; i < tile_count_; ++i) {
      const Met& t = tiles_[i];
      const TilePlace place = place_of_tile(sheet, t.x / 4, t.y / 4);
      const SheetRelief& relief = relief_at(sheet, place);
      const std::uint32_t faces = relief.faces;
      const std::uint32_t there = (faces | faces >> 16U) & 0xFFFFU;
      std::uint32_t met = 0;
      alignas(64) std::int32_t quads_of[kPacketRays] = {};
      for (int part = 0; part < simd::kBlockElements / F::lanes; ++part) {
        const QuadSlabs<F> slabs(sheet.tiles[place.group], place.k, relief, part);
        for (std::uint32_t rest = t.rays & alive_; rest != 0; rest &= rest - 1) {
          const int k = lowest_set_bit(rest);
          const std::uint32_t quads =
              slabs.test(RayOfPacket(rays_, k), static_cast<float>(t.x), static_cast<float>(t.y), part) & there;
          met |= quads;
          quads_of[k] |= static_cast<std::int32_t>(quads);
        }
      }
      for (; met != 0; met &= met - 1) {
        const int k = lowest_set_bit(met);
        std::uint32_t rays = 0;
        for (int r = 0; r < kPacketRays; r += F::lanes) {
          rays |= bits((I::load(quads_of + r) & I(static_cast<std::int32_t>(1U << static_cast<unsigned>(k)))) != I(0))
                  << static_cast<unsigned>(r);
        }
        Met& q = quads_[quad_count_];
        q = {t.x + (k & 3), t.y + (k >> 2), rays, faces >> static_cast<unsigned>(k)};
        simd::prefetch(sheet.vertices.row(q.y) + q.x);
        simd::prefetch(sheet.vertices.row(q.y + 1) + q.x);
        if (++quad_count_ == kQuads) visit_quads(sheet);
      }
    }
    tile_count_ = 0;
  }

  void visit_quads(const SheetTrace& sheet) noexcept {
    const auto accepted = [this](std::uint32_t face) noexcept { return accept_(first_face_ + face); };
    for (int i = 0; i < quad_count_; ++i) {
      const Met& q = quads_[i];
      std::uint32_t asked = q.rays & alive_;
      if (asked == 0) continue;
      if (count_bits(asked) > kFewRays) {
        std::uint32_t open = 0;
        alive_ &= ~blocked_by_quad<F>(sheet, rays_, asked, q.x, q.y, q.faces, accepted, open);
        asked = open;
        if (asked == 0) continue;
      }
      const QuadCorners corners(sheet, q.x, q.y);
      const std::uint32_t number = first_face_ + number_of_quad(sheet, q.x, q.y);
      for (; asked != 0; asked &= asked - 1) {
        const int k = lowest_set_bit(asked);
        pairs_.add(input_[k], k, corners, q.faces, number);
        if (pairs_.count == kRayLanes) settle();
      }
    }
    quad_count_ = 0;
  }

  void settle() noexcept {
    if (pairs_.count == 0) return;
    for (std::uint32_t blocked = blocked_of_pairs<F>(bounds_, pairs_, accept_); blocked != 0; blocked &= blocked - 1) {
      alive_ &= ~(1U << pairs_.ray[lowest_set_bit(blocked)]);
    }
  }

  Span<const SheetTrace> layers_;
  const SheetBounds& bounds_;
  Accept& accept_;
  const Ray* input_ = nullptr;
  int tile_count_ = 0;
  int quad_count_ = 0;
  std::uint32_t alive_ = 0;    // nothing known blocks them
  std::uint32_t members_ = 0;  // of the beam
  std::uint32_t first_face_ = 0;
  SheetRays rays_;
  Met tiles_[kTiles];
  Met quads_[kQuads];
  RayQuads pairs_ = {};
};

// Whether two rays look as if they had one end and started at neighbouring pixels, `slope` apart as the camera sees it.
[[nodiscard]] inline bool are_neighbours(const Ray& a, const Ray& b, float slope) noexcept {
  const Vec3f way = b.direction * b.t_max;
  const Vec3f off = (a.origin + a.direction * a.t_max) - (b.origin + way);
  const float apart = slope * std::fabs(a.origin.z * b.origin.z);
  return dot(off, off) <= 0x1p-8F * dot(way, way) && dot(way, way) < 0x1p60F &&
         std::fabs(a.origin.x * b.origin.z - b.origin.x * a.origin.z) <= apart &&
         std::fabs(a.origin.y * b.origin.z - b.origin.y * a.origin.z) <= apart;
}

// A guess that saves time: a packet takes whatever rays there are.
[[nodiscard]] inline bool make_a_packet(const Ray* rays, float slope) noexcept {
  return are_neighbours(rays[0], rays[5], slope) || are_neighbours(rays[10], rays[15], slope);
}

// `active`: 0 where a ray is not asked about; empty: all are.
template <class F, class Accept>
void occluded_by_packets(const SheetScene& scene, Span<const Ray> rays, Accept& accept, Span<std::uint8_t> blocked,
                         Span<const std::uint8_t> active) noexcept {
  const auto stream = [&](std::size_t begin, std::size_t end) {
    if (begin == end) return;
    const AnyQuery<Accept> query{accept, {blocked.data() + begin, end - begin}};
    const Span<const std::uint8_t> asked =
        active.empty() ? active : Span<const std::uint8_t>(active.data() + begin, end - begin);
    trace_stream<F>(scene.layers, scene.bounds, {rays.data() + begin, end - begin}, query, asked);
  };
  Packet<F, Accept> packet(scene.layers, scene.bounds, accept);
  const float slope = kNeighbourPixels / std::max(scene.bounds.camera.fx, scene.bounds.camera.fy);
  Ray together[kPacketRays];
  std::size_t whose[kPacketRays];
  std::size_t waiting = 0;  // from there on rays are left to a stream
  for (std::size_t next = 0; !scene.layers.empty();) {
    const std::size_t begin = next;
    int count = 0;
    for (; count < kPacketRays && next < rays.size(); ++next) {
      if (!active.empty() && active[next] == 0) continue;
      if (!active.empty()) together[count] = rays[next];
      whose[count++] = next;
    }
    if (count < kPacketRays) break;
    const Ray* next_rays = next - begin == kPacketRays ? rays.data() + begin : together;
    if (!make_a_packet(next_rays, slope)) continue;
    stream(waiting, begin);
    const std::uint32_t met = packet.run(next_rays, kPacketRays);
    for (int k = 0; k < kPacketRays; ++k) {
      blocked[whose[k]] = static_cast<std::uint8_t>(met >> static_cast<unsigned>(k) & 1U);
    }
    waiting = next;
  }
  stream(waiting, rays.size());
}

}  // namespace sheet_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_PACKET_HPP
