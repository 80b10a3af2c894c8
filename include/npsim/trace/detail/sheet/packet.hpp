// SPDX-License-Identifier: Apache-2.0
// Shadow rays with nearly one end, sixteen from neighbouring pixels at a time, through a sheet (sheet_layout.hpp).
//
// Rays are made ready together (sheet_ray_lanes.hpp). Those that run alike share a beam (sheet_beam.hpp), which goes
// down the pyramid to 16x16 quads and their tiles for all of them, from their ends on. Then the rays are lanes of a
// test of each tile; the quads of a tile are lanes for each of its rays; the rays are lanes again against the faces of
// a quad (sheet_face_lanes.hpp), or, where few meet the same one, pairs of a ray and a quad are. A ray that is blocked
// leaves the packet.
//
// Invariant: what is left out is only what none of the rays would visit, and a face blocks a ray where
// intersect_triangle() says so: the answers are those of sheet_traverse.hpp, bit for bit, for any rays and lanes. Rays
// that do not look like a packet are left to sheet_stream.hpp. Cost: 0.4 of the time of streams. With 16 rays of a row
// of a picture, a ray takes .5 nodes, 1 test of a tile, 2.3 tests of a tile's quads and 1 quad.
// Memory: 12 KiB of stack beside a stream's.
#ifndef NPSIM_TRACE_DETAIL_SHEET_PACKET_HPP
#define NPSIM_TRACE_DETAIL_SHEET_PACKET_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "npsim/core/bits.hpp"
#include "npsim/core/span.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/trace/detail/sheet/beam.hpp"
#include "npsim/trace/detail/sheet/face_lanes.hpp"
#include "npsim/trace/detail/sheet/layout.hpp"
#include "npsim/trace/detail/sheet/query.hpp"
#include "npsim/trace/detail/sheet/ray.hpp"
#include "npsim/trace/detail/sheet/ray_lanes.hpp"
#include "npsim/trace/detail/sheet/stream.hpp"
#include "npsim/trace/detail/sheet/test.hpp"
#include "npsim/trace/detail/sheet/traverse.hpp"
#include "npsim/trace/detail/sheet/walk.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace sheet_detail {

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

// blocked[i]: 1 where some face with accept(face) lies on ray i, else 0; one for every ray. `accept` may be asked about
// the faces of the rays in any order, and about a face once for several rays. `active`: where it is 0 the ray is left
// out and blocked[i] stays as it is; empty: all are traced.
template <class F = simd::F32, class Accept>
void occluded(const SheetScene& scene, Span<const Ray> rays, Accept&& accept, Span<std::uint8_t> blocked,
              Span<const std::uint8_t> active = {}) noexcept {
  sheet_detail::occluded_by_packets<F, std::remove_reference_t<Accept>>(scene, rays, accept, blocked, active);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_PACKET_HPP
