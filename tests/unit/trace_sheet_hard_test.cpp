// SPDX-License-Identifier: Apache-2.0
// Hard rays through hard sheets: each must have the hit, to the bit, that a test of all faces in turn finds, alone and
// in a stream, and nothing may hang, crash or leak.
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
#include "npsim/trace/sheet.hpp"
#include "reference/sheet_rays.hpp"
#include "reference/triangle_scan.hpp"

namespace {

using npsim::Hit;
using npsim::kNoFace;
using npsim::RandomPurpose;
using npsim::RandomStream;
using npsim::Ray;
using npsim::Shape;
using npsim::Vec3f;
using npsim::reference::in_cube;
using npsim::reference::TracedSheet;
using Scalar = npsim::simd::scalar::F32;

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kDenormal = 1e-40F;

RandomStream stream(std::uint32_t i) { return {15, RandomPurpose::test, 0, 0, i, 0}; }

bool same_bits(const Hit& a, const Hit& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

// Checks all rays; the number of hits.
std::size_t check(const TracedSheet& sheet, const std::vector<Ray>& rays) {
  npsim::SheetScene scene;
  REQUIRE(npsim::join_layers({&sheet.trace, 1}, scene).ok());
  std::vector<Hit> hits(rays.size());
  std::vector<std::uint8_t> blocked(rays.size(), 7);
  npsim::closest_hits(scene, {rays.data(), rays.size()}, {hits.data(), hits.size()});
  npsim::occluded(scene, {rays.data(), rays.size()}, [](std::uint32_t) { return true; },
                  {blocked.data(), blocked.size()});
  std::size_t count = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    Hit expected;
    Hit got;
    Hit one_lane;
    const bool found = npsim::reference::hit_by_all_faces(sheet, rays[i], expected);
    count += found ? 1 : 0;
    CAPTURE(i);
    CAPTURE(rays[i].origin.x);
    CAPTURE(rays[i].origin.y);
    CAPTURE(rays[i].origin.z);
    CAPTURE(rays[i].direction.x);
    CAPTURE(rays[i].direction.y);
    CAPTURE(rays[i].direction.z);
    REQUIRE(npsim::closest_hit(sheet.trace, rays[i], got) == found);
    REQUIRE(npsim::closest_hit<Scalar>(sheet.trace, rays[i], one_lane) == found);
    REQUIRE(npsim::occluded(sheet.trace, rays[i]) == found);
    REQUIRE((hits[i].face != kNoFace) == found);
    REQUIRE(blocked[i] == (found ? 1 : 0));
    if (!found) continue;
    REQUIRE(same_bits(got, expected));
    REQUIRE(same_bits(one_lane, expected));
    REQUIRE(same_bits(hits[i], expected));
    REQUIRE(got.t > std::fmax(rays[i].t_min, 0.0F));
    REQUIRE(got.t < rays[i].t_max);
  }
  return count;
}

TracedSheet sheet_of(Shape shape, float step, std::uint32_t seed, bool all = true) {
  TracedSheet sheet(shape);
  sheet.fill([&](int x, int y) {
    RandomStream r = stream(seed * 100003U + static_cast<std::uint32_t>(x + 1000 * y));
    return 2.0F + r.uniform(0.0F, 0.05F) + ((x / 3 + y / 4) % 2 == 0 ? step : 0.0F);
  });
  sheet.connect(all, seed);
  REQUIRE(sheet.build().ok());
  return sheet;
}

}  // namespace

TEST_CASE("trace sheet: rays in the plane of a face, along its edges and through its vertices, both ways") {
  std::size_t hits = 0;
  for (const float step : {0.0F, 1.0F, 100.0F}) {
    TracedSheet sheet = sheet_of({25, 19}, step, 1);
    std::vector<Ray> rays;
    for (std::uint32_t i = 0; i < 500; ++i) {
      RandomStream r = stream(i);
      const npsim::Face f = npsim::sheet_face(sheet.trace.quads, r.next_u32() % npsim::sheet_face_count(sheet.shape));
      const Vec3f a = sheet.vertices[f.a];
      const Vec3f b = sheet.vertices[f.b];
      const Vec3f c = sheet.vertices[f.c];
      const float s = r.uniform(-1.0F, 2.0F);
      const Vec3f in_plane = (b - a) * s + (c - a) * r.uniform(-1.0F, 2.0F);
      rays.push_back({a - in_plane, in_plane});
      rays.push_back({a + in_plane, b - c});
      rays.push_back({a - (b - a) * 3.0F, b - a});  // along an edge, from before it
      rays.push_back({b + (b - a) * 3.0F, a - b});  // and back
      rays.push_back({a, b - a});                   // from its start
      rays.push_back({(a + b) * 0.5F, b - a});      // from within
      rays.push_back({a, a});                       // from a vertex on, through the camera's centre if turned
      rays.push_back({a, -a});
      rays.push_back({c * 2.0F, c - c * 2.0F});
    }
    hits += check(sheet, rays);
  }
  CHECK(hits > 1000);
}

TEST_CASE("trace sheet: rays along pixel columns and rows, and through the camera's centre") {
  std::size_t hits = 0;
  for (const float step : {0.0F, 5.0F}) {
    TracedSheet sheet = sheet_of({33, 35}, step, 2);
    std::vector<Ray> rays;
    for (std::uint32_t i = 0; i < 400; ++i) {
      RandomStream r = stream(5000 + i);
      const auto x = static_cast<int>(r.next_u32() % 33U);
      const auto y = static_cast<int>(r.next_u32() % 35U);
      const auto other_x = static_cast<int>(r.next_u32() % 33U);
      const auto other_y = static_cast<int>(r.next_u32() % 35U);
      const Vec3f p = npsim::unproject_pixel(sheet.k, x, y, r.uniform(0.5F, 3.0F));
      const Vec3f below = npsim::unproject_pixel(sheet.k, x, other_y, r.uniform(0.5F, 9.0F));
      const Vec3f beside = npsim::unproject_pixel(sheet.k, other_x, y, r.uniform(0.5F, 9.0F));
      rays.push_back({p, below - p});  // in the plane of camera and column
      rays.push_back({p, beside - p});
      rays.push_back({-p, p});  // from behind the camera through its centre
      rays.push_back({below, -below});
      rays.push_back({p * -4.0F, beside + p * 4.0F});
      rays.push_back({{0, 0, 0}, sheet.at(x, y) * 1e-10F});
      rays.push_back({{0, 0, 0}, -sheet.at(x, y)});
      rays.push_back({{0, 0, -1e-30F}, sheet.at(x, y)});
      rays.push_back({{0, 0, kDenormal}, sheet.at(other_x, y)});
      rays.push_back({{0, 0, 0}, sheet.at(x, y), 1.0F, 1.0F});  // an empty interval
    }
    hits += check(sheet, rays);
  }
  CHECK(hits > 1000);
}

TEST_CASE("trace sheet: rays parallel to the image and along axes, with zeros of both signs and denormals") {
  std::size_t hits = 0;
  for (const float step : {0.0F, 1.0F, 1000.0F}) {
    TracedSheet sheet = sheet_of({21, 27}, step, 3);
    std::vector<Ray> rays;
    const float tiny[] = {0.0F, -0.0F, kDenormal, -kDenormal, 1e-38F, -1e-30F, 1e-20F};
    for (std::uint32_t i = 0; i < 600; ++i) {
      RandomStream r = stream(9000 + i);
      const Vec3f v = sheet.vertices[r.next_u32() % sheet.vertices.size()];
      float d[3] = {tiny[r.next_u32() % 7U], tiny[r.next_u32() % 7U], tiny[r.next_u32() % 7U]};
      d[i % 3] = i % 2 == 0 ? 1.0F : -1.0F;
      const Vec3f direction{d[0], d[1], d[2]};
      rays.push_back({v, direction});
      rays.push_back({v - direction * 10.0F, direction});
      rays.push_back({v - direction + in_cube(r, 0.02F), direction});
      rays.push_back({{d[1], d[2], d[0] * 1e-20F}, direction});
      rays.push_back({{v.x, v.y, v.z}, {r.uniform(-1.0F, 1.0F), r.uniform(-1.0F, 1.0F), tiny[i % 7U]}});
      rays.push_back({{v.x - 5.0F, v.y, 2.02F}, {1, 0, tiny[i % 7U]}});  // in the wall
      rays.push_back({{0, 0, 0}, {1, 1, 0}});                            // in the plane of the camera
      rays.push_back({{0, 0, kDenormal}, {-1, kDenormal, 0}});
      rays.push_back({v, v * 1e-36F});  // too short to be told from none, or just not
      rays.push_back({v * 0.5F, v * 0x1p-94F});
      rays.push_back({v * 0.5F, v * 0x1p90F});
    }
    hits += check(sheet, rays);
  }
  CHECK(hits > 1500);
}

TEST_CASE("trace sheet: 1 x 1 to 3 x 2 pixels, with every choice of faces and diagonals") {
  std::size_t hits = 0;
  for (const Shape shape : {Shape{1, 1}, Shape{1, 2}, Shape{2, 1}, Shape{2, 2}, Shape{3, 2}, Shape{2, 3}}) {
    for (unsigned quad = 0; quad < 64; ++quad) {
      TracedSheet sheet(shape);
      sheet.fill([](int x, int y) { return 2.0F + 0.3F * static_cast<float>(x) + 0.1F * static_cast<float>(y); });
      for (std::size_t i = 0; i < sheet.quads.size(); ++i) {
        sheet.quads[i] = static_cast<std::uint8_t>(quad >> (3 * i) & 7U);
      }
      REQUIRE(sheet.build().ok());
      std::vector<Ray> rays;
      for (std::uint32_t i = 0; i < 40; ++i) {
        RandomStream r = stream(i);
        const Vec3f v = sheet.vertices[r.next_u32() % sheet.vertices.size()];
        rays.push_back({{0, 0, 0}, v});
        rays.push_back({{0, 0, 0}, {r.uniform(-0.6F, 0.6F), r.uniform(-0.6F, 0.6F), 1}});
        rays.push_back({v + in_cube(r, 1.0F), in_cube(r, 1.0F)});
        rays.push_back({v, -v});
      }
      const std::size_t n = check(sheet, rays);
      if (npsim::quad_shape(shape).empty()) CHECK(n == 0);
      if (shape == Shape{2, 2} && (quad & 6U) == 0) CHECK(n == 0);
      hits += n;
    }
  }
  CHECK(hits > 3000);
}

TEST_CASE("trace sheet: all faces deleted, in one tile, but for one face, and everywhere") {
  TracedSheet sheet = sheet_of({50, 40}, 1.0F, 4);
  std::vector<Ray> rays;
  for (std::uint32_t i = 0; i < 1000; ++i) {
    RandomStream r = stream(i);
    rays.push_back({{0, 0, 0}, sheet.vertices[r.next_u32() % sheet.vertices.size()]});
    rays.push_back({in_cube(r, 3.0F), in_cube(r, 1.0F)});
  }
  const std::size_t all = check(sheet, rays);
  for (int y = 16; y < 20; ++y) {
    for (int x = 16; x < 20; ++x) sheet.quads[static_cast<std::size_t>(y * 49 + x)] = 0;
  }
  REQUIRE(sheet.build().ok());
  CHECK(check(sheet, rays) < all);
  for (std::uint8_t& q : sheet.quads) q &= 1U;
  sheet.quads[static_cast<std::size_t>(17 * 49 + 18)] = npsim::kQuadLowerFace;
  REQUIRE(sheet.build().ok());
  rays.push_back({{0, 0, 0}, (sheet.at(18, 17) + sheet.at(18, 18) + sheet.at(19, 18)) * 0.333F});
  const std::size_t one = check(sheet, rays);
  CHECK(one > 0);
  CHECK(one < 100);
  for (std::uint8_t& q : sheet.quads) q &= 1U;
  REQUIRE(sheet.build().ok());
  CHECK(check(sheet, rays) == 0);
}

TEST_CASE("trace sheet: steps of 1 to 1000 m between neighbours, and of twelve orders of magnitude") {
  std::size_t hits = 0;
  for (const float step : {1.0F, 10.0F, 100.0F, 1000.0F, 1e12F}) {
    for (const bool all : {true, false}) {
      TracedSheet sheet(Shape{26, 22});
      sheet.fill([step](int x, int y) {
        RandomStream r = stream(static_cast<std::uint32_t>(x + 1000 * y));
        return r.next_u32() % 2U == 0 ? 1.0F : 1.0F + step * r.uniform();  // from pixel to pixel
      });
      sheet.connect(all, 5);
      REQUIRE(sheet.build().ok());
      std::vector<Ray> rays;
      for (std::uint32_t i = 0; i < 500; ++i) {
        RandomStream r = stream(20000 + i);
        const Vec3f v = sheet.vertices[r.next_u32() % sheet.vertices.size()];
        const Vec3f w = sheet.vertices[r.next_u32() % sheet.vertices.size()];
        rays.push_back({{0, 0, 0}, v});
        rays.push_back({{0, 0, 0}, v + w * 0.01F});
        rays.push_back({v * 0.99F, w - v});
        rays.push_back({v, w - v, 1e-4F, 1.0F});
        rays.push_back({in_cube(r, 1.0F), w});
        rays.push_back({v + in_cube(r, step), in_cube(r, 1.0F)});
      }
      hits += check(sheet, rays);
    }
  }
  CHECK(hits > 8000);
}

TEST_CASE("trace sheet: hits beside faces up to 10^8 times as long as the way to them, and through a long lens") {
  // The corners of a face, not the hit, decide how far its rounded place is off the ray.
  std::size_t hits = 0;
  for (std::uint32_t scene = 0; scene < 60; ++scene) {
    RandomStream choice = stream(900000 + scene);
    TracedSheet sheet(scene % 2 == 0 ? Shape{17, 17} : Shape{34, 9});
    if (scene % 3 != 0) sheet.k.fx = sheet.k.fy = std::exp2(choice.uniform(7.0F, 24.0F));
    const float step = std::exp2(choice.uniform(3.0F, 7.0F));
    sheet.fill([&](int x, int y) {
      RandomStream r = stream(scene * 5003U + static_cast<std::uint32_t>(x + 100 * y));
      return r.next_u32() % 2U == 0 ? 1.0F : 1.0F + step * r.uniform();
    });
    sheet.connect(true, scene);
    REQUIRE(sheet.build().ok());
    const auto vertex = [&](int x, int y) {
      return sheet.at(std::min(x, sheet.shape.width - 1), std::min(y, sheet.shape.height - 1));
    };
    std::vector<Ray> rays;
    for (std::uint32_t i = 0; i < 250; ++i) {
      RandomStream r = stream(1000000 + 1000 * scene + i);
      const auto x = static_cast<int>(r.next_u32() % 16U);
      const auto y = static_cast<int>(r.next_u32() % 9U);
      const Vec3f v = vertex(x, y);
      const Vec3f to = v + (vertex(x + 1, y + 1) - v) * r.uniform();
      Vec3f beside = in_cube(r, std::exp2(r.uniform(-24.0F, 0.0F)));
      rays.push_back({to - beside, beside});
      beside.z *= 1e-4F;
      rays.push_back({to - beside, beside});
      rays.push_back({in_cube(r, 1.0F), {}});
      rays.back().direction = to - rays.back().origin;
      rays.push_back({{r.uniform(-1.0F, 1.0F), r.uniform(-1.0F, 1.0F), 0.0F}, to});
      rays.push_back({to + (to - v) * 3.0F, v - to});
    }
    hits += check(sheet, rays);
  }
  CHECK(hits > 10000);
}

TEST_CASE("trace sheet: a vertex a thousand kilometres away does not loosen the tests of what is near") {
  TracedSheet sheet(Shape{33, 33});
  sheet.fill([](int x, int y) { return x == 7 && y == 9 ? 1e6F : 4.0F; });
  sheet.connect(true);
  REQUIRE(sheet.build().ok());
  const Vec3f lamp{0.5F, -1.0F, 2.0F};
  for (const Vec3f& v : sheet.vertices) {
    if (v.z > 5.0F) continue;
    for (const Ray& ray : {Ray{{0, 0, 0}, v}, Ray{v * 0.999F, lamp - v * 0.999F, 0.0F, 1.0F}}) {
      npsim::SheetRay made;
      if (!npsim::sheet_detail::make_sheet_ray(sheet.trace.bounds, ray, made)) continue;
      REQUIRE_FALSE(made.everything);
      REQUIRE(made.pad_px < 0.5F);
    }
  }
}

TEST_CASE("trace sheet: NaN and infinity anywhere in a ray miss; in vertices they take their faces away") {
  const float bad[] = {kNan, kInf, -kInf, std::numeric_limits<float>::max(), -std::numeric_limits<float>::max()};
  TracedSheet sheet = sheet_of({30, 24}, 1.0F, 6);
  std::vector<Ray> rays;
  for (std::uint32_t i = 0; i < 400; ++i) {
    RandomStream r = stream(i);
    const Vec3f v = sheet.vertices[r.next_u32() % sheet.vertices.size()];
    Ray ray{i % 2 == 0 ? Vec3f{} : in_cube(r, 1.0F), v};
    float* const part[8] = {&ray.origin.x,    &ray.origin.y,    &ray.origin.z, &ray.direction.x,
                            &ray.direction.y, &ray.direction.z, &ray.t_min,    &ray.t_max};
    const std::uint32_t which = r.next_u32() % 8U;
    *part[which] = bad[r.next_u32() % 5U];
    if (i % 3 == 0) *part[r.next_u32() % 8U] = bad[r.next_u32() % 5U];
    rays.push_back(ray);
    Hit hit;
    const bool finite = npsim::is_finite(ray.origin) && npsim::is_finite(ray.direction);
    if (!finite || ray.t_min != ray.t_min || ray.t_max != ray.t_max || ray.t_min >= ray.t_max) {
      CHECK_FALSE(npsim::closest_hit(sheet.trace, ray, hit));
      CHECK_FALSE(npsim::occluded(sheet.trace, ray));
    }
  }
  rays.push_back({{0, 0, 0}, {0, 0, 0}});
  rays.push_back({{0, 0, 0}, {-0.0F, kDenormal, 0}});
  rays.push_back({sheet.at(3, 3), {0, 0, 0}});
  check(sheet, rays);

  for (std::uint32_t round = 0; round < 4; ++round) {
    TracedSheet holes = sheet_of({30, 24}, 1.0F, 7);
    for (std::size_t i = 0; i < holes.vertices.size(); ++i) {
      RandomStream r = stream(30000 + round * 1000 + static_cast<std::uint32_t>(i));
      if (r.uniform() > 0.05F) continue;
      Vec3f& v = holes.vertices[i];
      (r.next_u32() % 3U == 0 ? v.x : r.next_u32() % 2U == 0 ? v.y : v.z) = bad[r.next_u32() % 5U];
    }
    REQUIRE(holes.build().ok());
    std::vector<Ray> through;
    for (std::uint32_t i = 0; i < 500; ++i) {
      RandomStream r = stream(i);
      through.push_back({{0, 0, 0}, {r.uniform(-0.5F, 0.5F), r.uniform(-0.4F, 0.4F), 1}});
      through.push_back({in_cube(r, 1.0F), {r.uniform(-0.5F, 0.5F), r.uniform(-0.4F, 0.4F), 1}});
    }
    const std::size_t n = check(holes, through);
    CHECK(n > 300);
    CHECK(n < 1000);
  }
  for (const float value : bad) {
    TracedSheet none(Shape{20, 20});
    for (Vec3f& v : none.vertices) v = {value, value, value};
    REQUIRE(none.build().ok());
    CHECK(check(none, {{{0, 0, 0}, {0, 0, 1}}}) == 0);
  }
}

TEST_CASE("trace sheet: limits of t that cut exactly at the surface are open at both ends") {
  TracedSheet sheet = sheet_of({30, 24}, 2.0F, 8);
  std::size_t cut = 0;
  for (std::uint32_t i = 0; i < 2000; ++i) {
    RandomStream r = stream(40000 + i);
    const Vec3f to = sheet.vertices[r.next_u32() % sheet.vertices.size()] + (i % 2 == 0 ? Vec3f{} : in_cube(r, 0.05F));
    Ray ray{i % 3 == 0 ? Vec3f{} : in_cube(r, 1.5F), {}};
    ray.direction = (to - ray.origin) * (i % 5 == 0 ? 1e-3F : 1.0F);
    Hit hit;
    if (!npsim::closest_hit(sheet.trace, ray, hit)) continue;
    ++cut;
    const auto with = [&ray](float t_min, float t_max) {
      Ray limited = ray;
      limited.t_min = t_min;
      limited.t_max = t_max;
      return limited;
    };
    const float before = std::nextafter(hit.t, 0.0F);
    const float after = std::nextafter(hit.t, kInf);
    Hit again;
    CHECK_FALSE(npsim::closest_hit(sheet.trace, with(0, hit.t), again));
    CHECK_FALSE(npsim::occluded(sheet.trace, with(0, hit.t)));
    CHECK_FALSE(npsim::occluded(sheet.trace, with(0, before)));
    CHECK(npsim::occluded(sheet.trace, with(0, after)));
    REQUIRE(npsim::closest_hit(sheet.trace, with(0, after), again));
    CHECK(same_bits(again, hit));
    REQUIRE(npsim::closest_hit(sheet.trace, with(before, after), again));
    CHECK(same_bits(again, hit));
    if (npsim::closest_hit(sheet.trace, with(hit.t, kInf), again)) CHECK(again.t > hit.t);
    check(sheet, {with(hit.t, kInf), with(before, kInf), with(0, hit.t), with(hit.t, after), with(-1.0F, after)});
  }
  CHECK(cut > 1000);
}

TEST_CASE("trace sheet: a lamp on a vertex, on an edge, on a face, behind the camera and at its centre") {
  TracedSheet sheet = sheet_of({30, 24}, 1.0F, 9);
  std::vector<Ray> rays;
  for (std::uint32_t i = 0; i < 1200; ++i) {
    RandomStream r = stream(50000 + i);
    const npsim::Face f = npsim::sheet_face(sheet.trace.quads, r.next_u32() % npsim::sheet_face_count(sheet.shape));
    const Vec3f a = sheet.vertices[f.a];
    const Vec3f b = sheet.vertices[f.b];
    const Vec3f c = sheet.vertices[f.c];
    const Vec3f lamps[] = {a, (a + b) * 0.5F, (a + b + c) * (1.0F / 3.0F), {0, 0, 0}, a * -1.0F, {1, 2, -3}, b * 1.5F};
    const Vec3f lamp = lamps[i % 7];
    const Vec3f from = sheet.vertices[r.next_u32() % sheet.vertices.size()];
    rays.push_back({from, lamp - from, 0.0F, 1.0F});  // from a vertex itself, without an offset
    rays.push_back({from * 0.999F, lamp - from * 0.999F, 0.0F, 1.0F});
    rays.push_back({lamp, from - lamp, 0.0F, 1.0F});
    rays.push_back({lamp, from - lamp});
    rays.push_back({from, lamp - from, 1e-4F, 0.9999F});
  }
  CHECK(check(sheet, rays) > 1500);
}

TEST_CASE("trace sheet: origins from the surface to 10^15 m away, on all sides") {
  std::size_t hits = 0;
  for (const float scale : {1e-4F, 1.0F, 1e4F}) {
    TracedSheet sheet(Shape{20, 18});
    sheet.fill(
        [scale](int x, int y) { return scale * (3.0F + stream(static_cast<std::uint32_t>(x + 100 * y)).uniform()); });
    sheet.connect(true, 10);
    REQUIRE(sheet.build().ok());
    std::vector<Ray> rays;
    for (std::uint32_t i = 0; i < 1500; ++i) {
      RandomStream r = stream(60000 + i);
      const Vec3f v = sheet.vertices[r.next_u32() % sheet.vertices.size()];
      const float far_off = scale * std::pow(10.0F, r.uniform(-6.0F, 15.0F));
      const Vec3f from = v + in_cube(r, far_off);
      rays.push_back({from, v - from});
      rays.push_back({from, from - v});
    }
    hits += check(sheet, rays);
  }
  CHECK(hits > 2000);
}
