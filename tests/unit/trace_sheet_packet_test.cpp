// SPDX-License-Identifier: Apache-2.0
// Packets of shadow rays through sheets: their parts against those of a single ray, and the answers against a test of
// every face in turn.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "npsim/core/random.hpp"
#include "npsim/simd/detail/scalar.hpp"
#include "npsim/trace/detail/sheet/packet.hpp"
#include "npsim/trace/sheet.hpp"
#include "reference/sheet_rays.hpp"

namespace {

using npsim::Hit;
using npsim::kPacketRays;
using npsim::RandomStream;
using npsim::Ray;
using npsim::Shape;
using npsim::SheetRay;
using npsim::SheetRays;
using npsim::Span;
using npsim::Vec3f;
using npsim::reference::TracedSheet;
using Scalar = npsim::simd::scalar::F32;
using Native = npsim::simd::F32;

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

RandomStream stream(std::uint32_t i) { return {61, npsim::RandomPurpose::test, 0, 0, i, 0}; }

Vec3f in_cube(RandomStream& r, float scale) {
  const float x = r.uniform(-scale, scale);
  const float y = r.uniform(-scale, scale);
  return {x, y, r.uniform(-scale, scale)};
}

// A ground that recedes, with upright boxes, holes and noise.
void make_street(TracedSheet& sheet, bool all_faces, std::uint32_t seed, float farther = 1.0F) {
  const Shape s = sheet.shape;
  sheet.fill([&](int x, int y) {
    const float row = static_cast<float>(y) + 0.5F - 0.4F * static_cast<float>(s.height);
    float z = row > 1 ? std::min(60.0F, 1.5F * static_cast<float>(s.height) / row) : 60.0F;
    if ((x / 7) % 3 == 1 && y > s.height / 4) z = std::min(z, 6.0F + 0.5F * static_cast<float>(x % 5));
    RandomStream r = stream(static_cast<std::uint32_t>(x + 1000 * y) + 7777777U * seed);
    return farther * z * r.uniform(0.99F, 1.01F);
  });
  sheet.connect(all_faces, seed);
  REQUIRE(sheet.build().ok());
}

struct Lamp {
  const char* name;
  Vec3f at;
};

std::vector<Lamp> lamps_of(const TracedSheet& sheet) {
  const Vec3f vertex = sheet.vertices[sheet.vertices.size() * 5 / 8];
  return {{"in the street", {1.0F, -2.5F, 12.0F}},
          {"on a vertex", vertex},
          {"in the sheet", (vertex + sheet.vertices[sheet.vertices.size() * 5 / 8 + 1]) * 0.5F},
          {"at the camera", {}},
          {"beside the camera, on the image plane", {0.7F, -0.2F, 0.0F}},
          {"nearly on the image plane", {0.7F, -0.2F, 1e-6F}},
          {"behind the camera", {0.0F, -1.0F, -3.0F}},
          {"seen in a line with the pixels of a column", {0.0F, -3.0F, 8.0F}},
          {"beside the image", {30.0F, -1.0F, 8.0F}},
          {"above", {0.1F, -60.0F, 20.0F}},
          {"very near", {0.01F, 0.005F, 0.05F}},
          {"far away", {3e5F, -2e6F, 1e6F}},
          {"too far", {3e30F, -2e30F, 1e30F}}};
}

// From every vertex a little towards the camera.
std::vector<Ray> rays_to(const TracedSheet& sheet, const Vec3f& lamp) {
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < sheet.vertices.size(); ++i) {
    const Vec3f v = sheet.vertices[i] * (i % 11 == 0 ? 1.0F : 0.999F);
    Ray ray{v, lamp - v};
    ray.t_max = i % 5 == 0 ? 0.999F : 1.0F;
    rays.push_back(ray);
  }
  return rays;
}

// Some of them as no caller should have them.
void spoil(std::vector<Ray>& rays, std::uint32_t seed) {
  for (std::size_t i = 0; i < rays.size(); ++i) {
    RandomStream r = stream(static_cast<std::uint32_t>(900000 + i) + 1000003U * seed);
    Ray& ray = rays[i];
    const std::uint32_t bits = r.next_u32();
    if ((bits >> 8U) % 512U == 0) {  // from so far that its projection says nothing
      const Vec3f way = in_cube(r, 1.0F);
      ray = {ray.origin - way * 1e8F, way};
    }
    switch (bits % 64U) {
      case 0: ray.direction.x = kNan; break;
      case 1: ray.direction = {0, 0, 0}; break;
      case 2: ray.t_max = kInf; break;
      case 3: ray.t_max = 0.01F; break;
      case 4: ray.direction = in_cube(r, 20.0F); break;
      case 5: ray.origin = in_cube(r, 1e7F); break;
      case 6: ray.origin = {}; break;
      case 7: ray.direction = -ray.direction; break;
      case 8: ray.origin.z = kNan; break;
      case 9: ray.t_min = kNan; break;
      case 10: ray.t_min = 0.5F; break;
      case 11: ray.t_max = kNan; break;
      case 12: ray.t_min = -kInf; break;
      case 13: ray.direction.y = kInf; break;
      case 14: ray.direction = {0, 0, 1}; break;
      case 15: ray.direction = {1e-42F, 0, -1}; break;
      case 16: ray.direction = ray.direction * 1e30F; break;
      case 17: ray.direction = ray.direction * 1e-35F; break;
      case 18: ray.origin = ray.origin * 1e20F; break;
      default: break;
    }
  }
}

// Of one type for all tests, which keeps their build short.
struct Accept {
  std::uint32_t without = 3;  // of every eight faces; 8: none
  bool operator()(std::uint32_t face) const noexcept { return face % 8 != without; }
};

template <class F>
std::vector<std::uint8_t> packets(const npsim::SheetScene& scene, const std::vector<Ray>& rays) {
  std::vector<std::uint8_t> blocked(rays.size(), 9);
  std::uint8_t* out = blocked.data();
  // Everything through packets, whatever the batch would have made of it.
  Accept odd;
  npsim::sheet_detail::Packet<F, Accept> packet(scene.layers, scene.bounds, odd);
  for (std::size_t i = 0; i < rays.size(); i += kPacketRays) {
    const int count = static_cast<int>(std::min<std::size_t>(kPacketRays, rays.size() - i));
    const std::uint32_t met = packet.run(rays.data() + i, count);
    for (int k = 0; k < count; ++k) *out++ = static_cast<std::uint8_t>(met >> static_cast<unsigned>(k) & 1U);
  }
  return blocked;
}

std::vector<std::uint8_t> one_by_one(const npsim::SheetScene& scene, const std::vector<Ray>& rays) {
  std::vector<std::uint8_t> blocked;
  Accept odd;
  for (const Ray& ray : rays) {
    blocked.push_back(npsim::occluded(scene, ray, odd) ? 1 : 0);
  }
  return blocked;
}

npsim::SheetScene scene_of(const npsim::SheetTrace* traces, std::size_t n) {
  npsim::SheetScene scene;
  REQUIRE(npsim::join_layers({traces, n}, scene).ok());
  return scene;
}

template <class T>
bool same_bits(const T& a, const T& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

}  // namespace

TEST_CASE("trace packet: a test of every face in turn says the same, lamps where they are awkward among them") {
  // All faces count here, so that the reference needs no list of those that do not.
  Accept all{8};
  int blocked = 0;
  int lit = 0;
  for (std::uint32_t round = 0; round < 6; ++round) {
    TracedSheet sheet({26, 19});
    make_street(sheet, round % 2 == 0, round, round < 4 ? 1.0F : 1000.0F);
    const npsim::SheetScene scene = scene_of(&sheet.trace, 1);
    for (const Lamp& lamp : lamps_of(sheet)) {
      std::vector<Ray> rays = rays_to(sheet, lamp.at);
      if (round % 3 == 2) spoil(rays, round);
      const std::size_t n = rays.size();
      std::vector<std::uint8_t> native(n + 1, 9);
      std::vector<std::uint8_t> scalar(n + 1, 9);
      npsim::occluded(scene, {rays.data(), n}, all, Span<std::uint8_t>(native.data(), n));
      npsim::occluded<Scalar>(scene, {rays.data(), n}, all, Span<std::uint8_t>(scalar.data(), n));
      int wrong = 0;
      for (std::size_t i = 0; i < n; ++i) {
        Hit hit;
        const bool met = npsim::reference::hit_by_all_faces(sheet, rays[i], hit);
        ++(met ? blocked : lit);
        wrong += native[i] == (met ? 1 : 0) && scalar[i] == native[i] ? 0 : 1;
      }
      INFO(lamp.name);
      CHECK(wrong == 0);
      CHECK(native[n] == 9);
      CHECK(scalar[n] == 9);
    }
  }
  CHECK(blocked > 5000);
  CHECK(lit > 5000);
}

TEST_CASE("trace packet: whatever rays make a packet, of one layer or two, for any number of lanes") {
  TracedSheet sheets[2] = {TracedSheet({240, 136}), TracedSheet({240, 136})};
  make_street(sheets[0], false, 3);
  make_street(sheets[1], true, 4, 1.3F);
  const npsim::SheetTrace traces[2] = {sheets[0].trace, sheets[1].trace};
  std::size_t differ = 0;
  for (const std::size_t layers : {1U, 2U}) {
    const npsim::SheetScene scene = scene_of(traces, layers);
    std::uint32_t seed = 0;
    for (const Lamp& lamp : lamps_of(sheets[0])) {
      std::vector<Ray> rays = rays_to(sheets[0], lamp.at);
      if (++seed % 2 == layers % 2) spoil(rays, seed);
      const std::vector<std::uint8_t> expected = one_by_one(scene, rays);
      INFO(lamp.name);
      CHECK(packets<Native>(scene, rays) == expected);
      if (seed % 4 == 1) CHECK(packets<Scalar>(scene, rays) == expected);
      for (std::size_t i = 1; i < rays.size(); ++i) differ += expected[i] != expected[i - 1] ? 1U : 0U;
    }
  }
  CHECK(differ > 10000);  // edges of shadows
}

TEST_CASE("trace packet: rays that have nothing to do with each other, and a lamp that is a patch") {
  TracedSheet sheet({120, 80});
  make_street(sheet, false, 5);
  const npsim::SheetScene scene = scene_of(&sheet.trace, 1);
  std::vector<Ray> rays;
  for (std::uint32_t i = 0; i < 16000; ++i) {
    RandomStream r = stream(300000 + i);
    const Vec3f v = sheet.vertices[r.next_u32() % sheet.vertices.size()];
    const Vec3f w = sheet.vertices[(i + i / 16 * 100) % sheet.vertices.size()];
    Ray ray{w * 0.999F, Vec3f{1, -2.5F, 12} + in_cube(r, 0.5F) - w * 0.999F, 0.0F, 1.0F};
    if (i % 64 < 16) ray = {v * 0.999F, in_cube(r, 3.0F)};
    if (i % 64 == 33) ray = {v, w - v};
    rays.push_back(ray);
  }
  const std::vector<std::uint8_t> expected = one_by_one(scene, rays);
  CHECK(packets<Native>(scene, rays) == expected);
  CHECK(packets<Scalar>(scene, rays) == expected);
}

TEST_CASE("trace packet: any number of rays; layers without a face; none at all") {
  TracedSheet sheet({60, 40});
  make_street(sheet, true, 6);
  TracedSheet empty({60, 40});
  empty.fill([](int, int) { return kNan; });
  REQUIRE(empty.build().ok());
  const npsim::SheetTrace traces[3] = {empty.trace, sheet.trace, npsim::SheetTrace{}};
  const std::vector<Ray> all = rays_to(sheet, {0.5F, -1.5F, 9.0F});
  for (std::size_t n = 0; n < 50; ++n) {
    const std::vector<Ray> rays(all.begin() + 60 * 20, all.begin() + 60 * 20 + static_cast<std::ptrdiff_t>(n));
    const npsim::SheetScene scene = scene_of(traces, 3);
    CHECK(packets<Native>(scene, rays) == one_by_one(scene, rays));
    CHECK(packets<Native>(scene_of(traces, 1), rays) == std::vector<std::uint8_t>(n, 0));
    CHECK(packets<Native>(npsim::SheetScene{}, rays) == std::vector<std::uint8_t>(n, 0));
  }
}

TEST_CASE("trace packet: rays that a mask leaves out keep their answers and do not change others") {
  TracedSheet sheet({120, 80});
  make_street(sheet, false, 7);
  const npsim::SheetScene scene = scene_of(&sheet.trace, 1);
  std::vector<Ray> rays = rays_to(sheet, {1.0F, -2.5F, 12.0F});
  spoil(rays, 8);
  Accept odd;
  const std::size_t n = rays.size();
  const std::vector<std::uint8_t> expected = one_by_one(scene, rays);
  for (const unsigned one_in : {1U, 2U, 7U, 1000U, 0U}) {
    std::vector<std::uint8_t> active(n);
    for (std::size_t i = 0; i < n; ++i) {
      RandomStream r = stream(static_cast<std::uint32_t>(i) + 5555555U * one_in);
      active[i] = one_in > 0 && r.next_u32() % one_in == 0 ? static_cast<std::uint8_t>(1 + i % 255) : 0;
    }
    std::vector<std::uint8_t> blocked(n, 9);
    std::vector<Hit> hits(n);
    for (Hit& h : hits) h.t = 7.0F;
    const Span<const std::uint8_t> mask(active.data(), n);
    npsim::occluded(scene, {rays.data(), n}, odd, Span<std::uint8_t>(blocked.data(), n), mask);
    npsim::closest_hits(scene, {rays.data(), n}, Span<Hit>(hits.data(), n), mask);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < n; ++i) {
      Hit hit;
      hit.t = 7.0F;
      if (active[i] != 0 && !npsim::closest_hit(scene, rays[i], hit)) hit = Hit{};
      wrong += same_bits(hit, hits[i]) ? 0U : 1U;
      wrong += blocked[i] == (active[i] != 0 ? expected[i] : 9) ? 0U : 1U;
    }
    INFO(one_in);
    CHECK(wrong == 0);
    // Without layers as well.
    std::vector<std::uint8_t> none(n, 9);
    npsim::occluded(npsim::SheetScene{}, {rays.data(), n}, odd, Span<std::uint8_t>(none.data(), n), mask);
    for (std::size_t i = 0; i < n; ++i) wrong += none[i] == (active[i] != 0 ? 0 : 9) ? 0U : 1U;
    CHECK(wrong == 0);
  }
}

TEST_CASE("trace packet: rays made ready together are those made ready alone, to the bit") {
  TracedSheet sheet({240, 136});
  make_street(sheet, false, 9);
  const npsim::SheetBounds& bounds = sheet.trace.bounds;
  int seen[3] = {};
  int wrong = 0;
  for (const Lamp& lamp : lamps_of(sheet)) {
    std::vector<Ray> rays = rays_to(sheet, lamp.at);
    spoil(rays, 10);
    for (std::size_t i = 0; i < rays.size(); i += kPacketRays) {
      const int count = static_cast<int>(std::min<std::size_t>(kPacketRays, rays.size() - i)) - static_cast<int>(i % 3);
      SheetRays lanes;
      SheetRays single;
      npsim::sheet_detail::make_sheet_rays<Native>(bounds, rays.data() + i, count, lanes);
      npsim::sheet_detail::make_sheet_rays<Scalar>(bounds, rays.data() + i, count, single);
      wrong += lanes.projected == single.projected && lanes.everything == single.everything ? 0 : 1;
      wrong += (lanes.projected | lanes.everything) >> static_cast<unsigned>(count) == 0 ? 0 : 1;
      for (int k = 0; k < count; ++k) {
        SheetRay ray;
        const bool met = npsim::sheet_detail::make_sheet_ray(bounds, rays[i + static_cast<std::size_t>(k)], ray);
        const bool projected = (lanes.projected >> static_cast<unsigned>(k) & 1U) != 0;
        const bool everything = (lanes.everything >> static_cast<unsigned>(k) & 1U) != 0;
        wrong += projected == (met && !ray.everything) && everything == (met && ray.everything) ? 0 : 1;
        ++seen[projected ? 0 : (everything ? 1 : 2)];
        if (!projected) continue;
        const std::uint32_t* axis = ray.frame.axis;
        const float expected[] = {ray.u,
                                  ray.v,
                                  ray.w,
                                  ray.du,
                                  ray.dv,
                                  ray.dw,
                                  ray.iu,
                                  ray.iv,
                                  ray.back_u,
                                  ray.back_v,
                                  ray.ahead_u,
                                  ray.ahead_v,
                                  ray.near_u,
                                  ray.far_u,
                                  ray.near_v,
                                  ray.far_v,
                                  ray.pad_px,
                                  ray.pad_w,
                                  ray.frame.shear[0],
                                  ray.frame.shear[1],
                                  ray.frame.t_min,
                                  ray.frame.t_max,
                                  ray.frame.origin[axis[0]],
                                  ray.frame.origin[axis[1]],
                                  ray.frame.origin[axis[2]]};
        for (const SheetRays* r : {&lanes, &single}) {
          const float made[] = {r->u[k],       r->v[k],       r->w[k],      r->du[k],      r->dv[k],
                                r->dw[k],      r->iu[k],      r->iv[k],     r->back_u[k],  r->back_v[k],
                                r->ahead_u[k], r->ahead_v[k], r->near_u[k], r->far_u[k],   r->near_v[k],
                                r->far_v[k],   r->pad_px[k],  r->pad_w[k],  r->shear_x[k], r->shear_y[k],
                                r->t_min[k],   r->t_max[k],   r->x[k],      r->y[k],       r->z[k]};
          static_assert(sizeof made == sizeof expected);
          wrong += same_bits(made, expected) && (r->along[axis[2]] >> static_cast<unsigned>(k) & 1U) != 0 ? 0 : 1;
        }
      }
    }
  }
  CHECK(wrong == 0);
  for (const int n : seen) CHECK(n > 200);
}

TEST_CASE("trace packet: a beam keeps every node and tile that one of its rays needs") {
  TracedSheet sheet({960, 540});
  make_street(sheet, true, 11);
  const npsim::SheetBounds& bounds = sheet.trace.bounds;
  int beams = 0;
  int missing = 0;
  int kept_rays = 0;
  int differ = 0;
  for (std::uint32_t round = 0; round < 4000; ++round) {
    RandomStream r = stream(2000000 + round);
    const std::uint32_t first = r.next_u32() % static_cast<std::uint32_t>(sheet.vertices.size() - 64);
    const std::uint32_t apart = round % 5 == 0 ? 3U : 1U;
    const float scale = round % 7 == 0 ? 0.01F : 10.0F;
    Vec3f lamp = in_cube(r, scale) + Vec3f{0, -3, 12};
    if (round % 11 == 0) lamp = {sheet.vertices[first].x, -3, sheet.vertices[first].z};  // nearly along a column
    if (round % 13 == 0) lamp.y = 0.0F;
    Ray rays[kPacketRays];
    SheetRay single[kPacketRays];
    for (std::uint32_t i = 0; i < kPacketRays; ++i) {
      const Vec3f v = sheet.vertices[first + apart * i] * r.uniform(0.98F, 0.999F);
      rays[i] = {v, lamp - v, 0.0F, 1.0F};
      static_cast<void>(npsim::sheet_detail::make_sheet_ray(bounds, rays[i], single[i]));
    }
    SheetRays lanes;
    npsim::sheet_detail::make_sheet_rays<Native>(bounds, rays, kPacketRays, lanes);
    if (lanes.projected == 0) continue;
    npsim::sheet_detail::Beam beam{};
    npsim::sheet_detail::Beam beam_of_one{};
    const std::uint32_t alike = npsim::sheet_detail::make_beam<Native>(lanes, lanes.projected, bounds, beam);
    differ += npsim::sheet_detail::make_beam<Scalar>(lanes, lanes.projected, bounds, beam_of_one) == alike ? 0 : 1;
    if (alike == 0) continue;
    ++beams;
    for (int k = 0; k < kPacketRays; ++k) {
      if ((alike >> static_cast<unsigned>(k) & 1U) == 0) continue;
      ++kept_rays;
      // A place on the ray, and what it just touches there.
      const float s = r.uniform() < 0.2F ? (r.uniform() < 0.5F ? 0.0F : 1.0F) : r.uniform();
      const float u = lanes.u[k] + s * lanes.du[k];
      const float v = lanes.v[k] + s * lanes.dv[k];
      const float w = lanes.w[k] + s * lanes.dw[k];
      for (const float size : {4.0F, 16.0F, 64.0F, 256.0F}) {
        const float x = 4 * size * std::floor(std::max(u, 0.0F) / (4 * size));
        const float y = 4 * size * std::floor(std::max(v, 0.0F) / (4 * size));
        npsim::SheetNode node;
        npsim::SheetTiles tiles;
        for (int c = 0; c < 16; ++c) {
          const float side = r.uniform() < 0.5F ? -1.0F : 1.0F;
          const float near = side * r.uniform(0.0F, 2.0F) * lanes.pad_w[k];
          const float thick = bounds.max_inverse_depth * 0.02F * r.uniform();
          node.low[c] = side > 0 ? w + near : w + near - thick;
          node.high[c] = node.low[c] + thick;
          const float steep = bounds.max_inverse_depth * (c % 4 == 0 ? 0.1F : 0.001F);
          tiles.gx[c] = r.uniform(-steep, steep);
          tiles.gy[c] = r.uniform(-steep, steep);
          tiles.half[c] = thick * 0.1F;
          const float off = side * tiles.half[c] + near;
          tiles.base[c] = w - tiles.gx[c] * (u - x - 4.0F * static_cast<float>(c % 4)) -
                          tiles.gy[c] * (v - y - 4.0F * static_cast<float>(c / 4)) + off;
        }
        std::uint32_t kept = 0;
        std::uint32_t needed = 0;
        if (size == 4.0F) {
          kept = npsim::sheet_detail::test_beam_tiles<Native>(tiles, beam, x, y);
          differ += kept == npsim::sheet_detail::test_beam_tiles<Scalar>(tiles, beam_of_one, x, y) ? 0 : 1;
          needed = npsim::sheet_detail::test_tiles<Native>(tiles, single[k], x, y);
        } else {
          kept = npsim::sheet_detail::test_beam<Native>(node, beam, x, y, size);
          differ += kept == npsim::sheet_detail::test_beam<Scalar>(node, beam_of_one, x, y, size) ? 0 : 1;
          needed = npsim::sheet_detail::test_node<Native>(node, single[k], x, y, size);
        }
        missing += (needed & ~kept) != 0 ? 1 : 0;
      }
    }
  }
  CHECK(missing == 0);
  CHECK(differ == 0);
  CHECK(beams > 2000);
  CHECK(kept_rays > 10 * beams);
}

TEST_CASE("trace packet: sixteen triangles are hit as they are one by one") {
  const float low[3] = {-100, -100, 0};
  const float high[3] = {100, 100, 200};
  int hits = 0;
  int misses = 0;
  int wrong = 0;
  for (std::uint32_t round = 0; round < 6000; ++round) {
    npsim::RayTriangles in;
    std::uint32_t expected = 0;
    for (int k = 0; k < npsim::kRayLanes; ++k) {
      RandomStream r = stream(5000000 + 16 * round + static_cast<std::uint32_t>(k));
      Vec3f corner[3];
      for (Vec3f& c : corner) c = in_cube(r, 5.0F) + Vec3f{0, 0, 10};
      if (r.next_u32() % 8U == 0) corner[2] = corner[0];
      const Vec3f origin = r.next_u32() % 4U == 0 ? (corner[0] + corner[1]) * 0.5F : in_cube(r, 5.0F);
      const float a = r.next_u32() % 4U == 0 ? 0.0F : r.uniform(-0.2F, 1.0F);
      const float b = r.next_u32() % 4U == 0 ? 0.0F : r.uniform(-0.2F, 1.0F);
      Ray ray{origin, corner[0] + (corner[1] - corner[0]) * a + (corner[2] - corner[0]) * b - origin};
      ray.t_min = r.next_u32() % 4U == 0 ? r.uniform() : 0.0F;
      ray.t_max = r.next_u32() % 2U == 0 ? 1.0F : r.uniform(0.5F, 2.0F);
      std::vector<Ray> rays = {ray};
      spoil(rays, round * 16 + static_cast<std::uint32_t>(k));
      ray = rays[0];
      const float o[3] = {ray.origin.x, ray.origin.y, ray.origin.z};
      const float d[3] = {ray.direction.x, ray.direction.y, ray.direction.z};
      float vertex[3][3];
      for (int i = 0; i < 3; ++i) {
        vertex[i][0] = corner[i].x;
        vertex[i][1] = corner[i].y;
        vertex[i][2] = corner[i].z;
        in.origin[i][k] = o[i];
        in.direction[i][k] = d[i];
      }
      for (int i = 0; i < 9; ++i) in.vertex[i / 3][i % 3][k] = vertex[i / 3][i % 3];
      in.t_min[k] = ray.t_min;
      in.t_max[k] = ray.t_max;
      npsim::RayFrame frame;
      npsim::TriangleHit hit;
      const bool met = npsim::make_ray_frame(ray, low, high, frame) && npsim::intersect_triangle(frame, vertex, hit) &&
                       hit.t < frame.t_max;
      expected |= (met ? 1U : 0U) << static_cast<unsigned>(k);
      ++(met ? hits : misses);
    }
    wrong += npsim::hits_of_lanes<Native>(low, high, in) == expected ? 0 : 1;
    wrong += npsim::hits_of_lanes<Scalar>(low, high, in) == expected ? 0 : 1;
  }
  CHECK(wrong == 0);
  CHECK(hits > 10000);
  CHECK(misses > 10000);
}
