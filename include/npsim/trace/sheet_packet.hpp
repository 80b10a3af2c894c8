// SPDX-License-Identifier: Apache-2.0
// Shadow rays with nearly one end, sixteen from neighbouring pixels at a time, through a sheet (sheet_layout.hpp).
//
// Rays are made ready together (sheet_ray_lanes.hpp). Those that run alike share a beam (sheet_beam.hpp), which goes
// down the pyramid to 16x16 quads and their tiles for all of them; then the rays are lanes: of a test of each tile, and
// of each quad's faces (sheet_face_lanes.hpp). In between, the quads of a tile are lanes for each of its rays. A ray
// that is blocked leaves the packet.
//
// Invariant: what is left out is only what none of the rays would visit, and a face blocks a ray where
// intersect_triangle() says so: the answers are those of sheet_traverse.hpp, bit for bit, for any rays and lanes. Rays
// that do not make a packet are left to sheet_stream.hpp.
// Memory: 12 KiB of stack beside a stream's.
#ifndef NPSIM_TRACE_SHEET_PACKET_HPP
#define NPSIM_TRACE_SHEET_PACKET_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "npsim/core/bits.hpp"
#include "npsim/core/span.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/trace/ray.hpp"
#include "npsim/trace/sheet_beam.hpp"
#include "npsim/trace/sheet_face_lanes.hpp"
#include "npsim/trace/sheet_layout.hpp"
#include "npsim/trace/sheet_query.hpp"
#include "npsim/trace/sheet_ray.hpp"
#include "npsim/trace/sheet_ray_lanes.hpp"
#include "npsim/trace/sheet_stream.hpp"
#include "npsim/trace/sheet_test.hpp"
#include "npsim/trace/sheet_traverse.hpp"
#include "npsim/trace/sheet_walk.hpp"

namespace npsim {
inline namespace v1 {
inline namespace NPSIM_ISA_NAMESPACE {
namespace sheet_detail {

inline constexpr float kNeighbourSlope = 0x1p-4F;  // between directions to where rays of a packet start

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
    blocked_ = 0;
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
      alive_ = alike;
      first_face_ = 0;
      for (const SheetTrace& sheet : layers_) {
        if (sheet.levels > 0) walk(sheet, beam);
        if (alive_ == 0) break;
        first_face_ += sheet_face_count(sheet.vertices.shape());
      }
      blocked_ |= alike & ~alive_;
    }
    for (; alone != 0; alone &= alone - 1) {
      const int k = lowest_set_bit(alone);
      const AnyQuery<Accept> query{accept_, {}};
      typename AnyQuery<Accept>::Answer answer{false};
      static_cast<void>(trace_one<F>(layers_, bounds_, rays[k], query, answer));
      blocked_ |= (answer.blocked ? 1U : 0U) << static_cast<unsigned>(k);
    }
    return blocked_;
  }

 private:
  struct Met {  // a tile or a quad, and the rays that may meet it
    int x, y;
    std::uint32_t rays;
    std::uint32_t faces;  // of a quad
  };
  static constexpr int kTiles = 32;
  static constexpr int kQuads = 64;

  void walk(const SheetTrace& sheet, const Beam& beam) noexcept {
    const auto tile = [](float at, int quads) {
      const float last = static_cast<float>((quads - 1) / 4);
      return static_cast<int>(std::min(std::max(at * 0.25F, 0.0F), last));
    };
    const int x0 = tile(beam.least_u, sheet.quads.width());
    const int x1 = tile(beam.most_u, sheet.quads.width());
    const int y0 = tile(beam.least_v, sheet.quads.height());
    const int y1 = tile(beam.most_v, sheet.quads.height());
    const auto differ = static_cast<std::uint32_t>((x0 ^ x1) | (y0 ^ y1));
    SheetWalk w;
    w.level = std::max(highest_set_bit(differ * 4U + 2U) / 2 - 1, 0);
    w.x = x0 >> (2 * w.level + 2);
    w.y = y0 >> (2 * w.level + 2);
    w.pending = 0;
    w.flip = 0;
    tile_count_ = 0;
    quad_count_ = 0;
    if (w.level == 0) {
      visit_group(sheet, beam, w.x, w.y);
      visit_tiles(sheet);
      visit_quads(sheet);
      return;
    }
    for (Step step = Step::nodes; step != Step::none && alive_ != 0; step = next_step(w)) {
      const int size = 4 << (2 * w.level);
      const SheetNode& node = sheet.nodes[sheet.first[w.level] + node_index(sheet, w.level, w.x, w.y)];
      const std::uint32_t found = test_beam<F>(node, beam, static_cast<float>(4 * w.x * size),
                                               static_cast<float>(4 * w.y * size), static_cast<float>(size));
      if (w.level > 1) {
        add_children<false>(found, w);
        continue;
      }
      for (std::uint32_t rest = found; rest != 0; rest &= rest - 1) {
        const int k = lowest_set_bit(rest);
        prefetch_object(sheet.tiles[node_index(sheet, 0, 4 * w.x + (k & 3), 4 * w.y + (k >> 2))]);
      }
      for (std::uint32_t rest = found; rest != 0; rest &= rest - 1) {
        const int k = lowest_set_bit(rest);
        visit_group(sheet, beam, 4 * w.x + (k & 3), 4 * w.y + (k >> 2));
      }
      visit_tiles(sheet);
      visit_quads(sheet);
    }
  }

  void visit_group(const SheetTrace& sheet, const Beam& beam, int x, int y) noexcept {
    const SheetTiles& tiles = sheet.tiles[node_index(sheet, 0, x, y)];
    std::uint32_t rest = test_beam_tiles<F>(tiles, beam, static_cast<float>(kSheetGroupQuads * x),
                                            static_cast<float>(kSheetGroupQuads * y));
    for (; rest != 0; rest &= rest - 1) {
      const int k = lowest_set_bit(rest);
      Met& t = tiles_[tile_count_];
      t.x = 4 * (4 * x + (k & 3));
      t.y = 4 * (4 * y + (k >> 2));
      t.rays = alive_ & test_rays_tile<F>(rays_, static_cast<float>(t.x), static_cast<float>(t.y), tiles.base[k],
                                          tiles.gx[k], tiles.gy[k], tiles.half[k]);
      if (t.rays == 0) continue;
      prefetch_relief(sheet, place_of_tile(sheet, t.x / 4, t.y / 4));
      if (++tile_count_ == kTiles) visit_tiles(sheet);
    }
  }

  void visit_tiles(const SheetTrace& sheet) noexcept {
    for (int i = 0; i < tile_count_; ++i) {
      const Met& t = tiles_[i];
      const TilePlace place = place_of_tile(sheet, t.x / 4, t.y / 4);
      const SheetRelief& relief = relief_at(sheet, place);
      const std::uint32_t faces = relief.faces;
      const std::uint32_t there = (faces | faces >> 16U) & 0xFFFFU;
      std::uint32_t met = 0;
      std::uint32_t rays_of[16] = {};
      for (int part = 0; part < simd::kBlockElements / F::lanes; ++part) {
        const QuadSlabs<F> slabs(sheet.tiles[place.group], place.k, relief, part);
        for (std::uint32_t rest = t.rays & alive_; rest != 0; rest &= rest - 1) {
          const int k = lowest_set_bit(rest);
          std::uint32_t quads =
              slabs.test(RayOfPacket(rays_, k), static_cast<float>(t.x), static_cast<float>(t.y), part) & there;
          met |= quads;
          for (; quads != 0; quads &= quads - 1) {
            rays_of[lowest_set_bit(quads)] |= 1U << static_cast<unsigned>(k);
          }
        }
      }
      for (; met != 0; met &= met - 1) {
        const int k = lowest_set_bit(met);
        Met& q = quads_[quad_count_];
        q = {t.x + (k & 3), t.y + (k >> 2), rays_of[k], faces >> static_cast<unsigned>(k)};
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
      const std::uint32_t asked = q.rays & alive_;
      if (asked == 0) continue;
      alive_ &= ~blocked_by_quad<F>(sheet, bounds_, input_, rays_, asked, q.x, q.y, (q.faces & 1U) != 0,
                                    (q.faces & 0x10000U) != 0, accepted);
    }
    quad_count_ = 0;
  }

  Span<const SheetTrace> layers_;
  const SheetBounds& bounds_;
  Accept& accept_;
  const Ray* input_ = nullptr;
  int tile_count_ = 0;
  int quad_count_ = 0;
  std::uint32_t alive_ = 0;  // of the beam's rays those that nothing blocks yet
  std::uint32_t blocked_ = 0;
  std::uint32_t first_face_ = 0;
  SheetRays rays_;
  Met tiles_[kTiles];
  Met quads_[kQuads];
};

// Whether two rays look as if they had one end and started at neighbouring pixels.
[[nodiscard]] inline bool are_neighbours(const Ray& a, const Ray& b) noexcept {
  const Vec3f way = b.direction * b.t_max;
  const Vec3f off = (a.origin + a.direction * a.t_max) - (b.origin + way);
  const float apart = kNeighbourSlope * std::fabs(a.origin.z * b.origin.z);
  return dot(off, off) <= 0x1p-8F * dot(way, way) && dot(way, way) < 0x1p60F &&
         std::fabs(a.origin.x * b.origin.z - b.origin.x * a.origin.z) <= apart &&
         std::fabs(a.origin.y * b.origin.z - b.origin.y * a.origin.z) <= apart;
}

// A guess that saves time: a packet takes whatever rays there are.
[[nodiscard]] inline bool make_a_packet(const Ray* rays) noexcept {
  return are_neighbours(rays[0], rays[5]) || are_neighbours(rays[10], rays[15]);
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
  Ray together[kPacketRays];
  std::size_t whose[kPacketRays];
  std::size_t waiting = 0;  // from there on rays are left to a stream
  for (std::size_t next = 0; !scene.layers.empty();) {
    const std::size_t begin = next;
    int count = 0;
    for (; count < kPacketRays && next < rays.size(); ++next) {
      if (!active.empty() && active[next] == 0) continue;
      together[count] = rays[next];
      whose[count++] = next;
    }
    if (count < kPacketRays) break;
    if (!make_a_packet(together)) continue;
    stream(waiting, begin);
    const std::uint32_t met = packet.run(together, kPacketRays);
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

}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_TRACE_SHEET_PACKET_HPP
