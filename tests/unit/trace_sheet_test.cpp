// SPDX-License-Identifier: Apache-2.0
// The ray structure of a sheet against a test of every face in turn, the general tree and double precision.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/simd/detail/scalar.hpp"
#include "npsim/trace/bvh.hpp"
#include "npsim/trace/sheet.hpp"
#include "reference/sheet_rays.hpp"
#include "trace_tree.hpp"

namespace {

using npsim::Face;
using npsim::Hit;
using npsim::kNoFace;
using npsim::RandomPurpose;
using npsim::RandomStream;
using npsim::Ray;
using npsim::Shape;
using npsim::Vec3d;
using npsim::Vec3f;
using npsim::reference::hit_by_all_faces;
using Scalar = npsim::simd::scalar::F32;

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

RandomStream stream(std::uint32_t i) { return {5, RandomPurpose::test, 0, 0, i, 0}; }

struct Sheet : npsim::reference::TracedSheet {
  explicit Sheet(Shape s) : TracedSheet(s) {}

  void connect(bool random) {
    for (std::size_t i = 0; i < quads.size(); ++i) {
      RandomStream r = stream(static_cast<std::uint32_t>(i) + 77);
      quads[i] = static_cast<std::uint8_t>(random ? r.next_u32() % 8U : 6U | (r.next_u32() & 1U));
    }
  }
  void build() { REQUIRE(TracedSheet::build().ok()); }
  [[nodiscard]] bool has(std::uint32_t face) const {
    return (quads[face / 2] & (face % 2 == 0 ? npsim::kQuadUpperFace : npsim::kQuadLowerFace)) != 0;
  }
  [[nodiscard]] std::array<Vec3f, 3> corners(std::uint32_t face) const {
    const Face f = npsim::sheet_face(trace.quads, face);
    return {vertices[f.a], vertices[f.b], vertices[f.c]};
  }
  [[nodiscard]] std::uint32_t faces() const { return npsim::sheet_face_count(shape); }
};

Vec3f in_cube(RandomStream& random, float scale) {
  const float x = random.uniform(-scale, scale);
  const float y = random.uniform(-scale, scale);
  return {x, y, random.uniform(-scale, scale)};
}

// A slanted ground, a wall, steps and waves.
float street_depth(int x, int y, int height) {
  const float row = static_cast<float>(y) + 0.5F - 0.4F * static_cast<float>(height);
  float z = row > 1 ? std::min(60.0F, 1.5F * static_cast<float>(height) / row) : 60.0F;
  if ((x / 7) % 3 == 1 && y > height / 4) z = std::min(z, 6.0F + 0.5F * static_cast<float>(x % 5));
  RandomStream r = stream(static_cast<std::uint32_t>(x + 1000 * y));
  return z * r.uniform(0.99F, 1.01F);
}

// Rays of all kinds: from the camera, from points before, on, behind and beside the sheet, along axes, limited.
Ray ray_of(const Sheet& sheet, std::uint32_t i) {
  RandomStream r = stream(400000 + i);
  const Vec3f v = sheet.vertices[r.next_u32() % sheet.vertices.size()];
  const Vec3f w = sheet.vertices[r.next_u32() % sheet.vertices.size()];
  Ray ray{{0, 0, 0}, v + in_cube(r, 0.01F * v.z)};
  switch (i % 10) {
    case 1: ray = {in_cube(r, 20.0F), in_cube(r, 1.0F)}; break;
    case 2: ray = {v * 0.999F, w - v}; break;
    case 3:
      ray = {in_cube(r, 5.0F), v};
      ray.direction = v - ray.origin;
      break;
    case 4:
      ray = {in_cube(r, 1000.0F), {}};
      ray.direction = v - ray.origin;
      break;
    case 5:
      ray = {v + in_cube(r, 1.0F), {0, 0, 0}};
      (i % 3 == 0 ? ray.direction.x : i % 3 == 1 ? ray.direction.y : ray.direction.z) = i % 4 < 2 ? 1.0F : -1.0F;
      break;
    case 6: ray = {v, v * -1.0F}; break;
    case 7: ray = {w * 2.0F, w * -1.0F}; break;
    case 8:
      ray = {v + in_cube(r, 0.5F), in_cube(r, 1.0F)};
      ray.direction.z = 0;
      break;
    case 9: ray.direction = v; break;
    default: break;
  }
  if (i % 7 == 0) ray.t_max = r.uniform(0.1F, 2.0F);
  if (i % 11 == 0) ray.t_min = r.uniform(0.0F, 1.0F);
  return ray;
}

bool same_bits(const Hit& a, const Hit& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

}  // namespace

TEST_CASE("trace sheet: every ray has the hit that a test of all faces in turn finds, for any number of lanes") {
  std::size_t hits = 0;
  std::size_t differ = 0;
  for (const Shape shape : {Shape{47, 39}, Shape{2, 2}, Shape{5, 70}, Shape{130, 4}}) {
    for (const bool random : {false, true}) {
      Sheet sheet(shape);
      sheet.fill([&](int x, int y) { return street_depth(x, y, shape.height); });
      sheet.connect(random);
      if (random) {
        for (std::size_t i = 0; i < sheet.vertices.size(); i += 9) sheet.vertices[i] = {};
      }
      sheet.build();
      for (std::uint32_t i = 0; i < 8000; ++i) {
        const Ray ray = ray_of(sheet, i);
        Hit expected;
        Hit got;
        Hit one_lane;
        const bool found = hit_by_all_faces(sheet, ray, expected);
        CAPTURE(i);
        CAPTURE(shape.width);
        CAPTURE(random);
        REQUIRE(npsim::closest_hit(sheet.trace, ray, got) == found);
        REQUIRE(npsim::occluded(sheet.trace, ray) == found);
        REQUIRE(npsim::closest_hit<Scalar>(sheet.trace, ray, one_lane) == found);
        if (!found) continue;
        ++hits;
        CHECK(same_bits(got, one_lane));
        if (!same_bits(got, expected)) {
          ++differ;
          CHECK(got.t <= expected.t * 1.0001F);
        }
        npsim::Ray shorter = ray;
        shorter.t_max = got.t;  // exactly at the surface: open
        Hit none;
        CHECK_FALSE(npsim::closest_hit(sheet.trace, shorter, none));
      }
    }
  }
  CHECK(hits > 10000);
  CHECK(differ == 0);
}

namespace {

struct ExactHit {
  double t = 0;
  double margin = 0;  // smallest barycentric coordinate; negative outside
  double cosine = 0;
};

ExactHit exact_hit(const std::array<Vec3f, 3>& corner, const Ray& ray) {
  const Vec3d o = npsim::vec_cast<double>(ray.origin);
  const Vec3d d = npsim::vec_cast<double>(ray.direction);
  const Vec3d a = npsim::vec_cast<double>(corner[0]);
  const Vec3d e1 = npsim::vec_cast<double>(corner[1]) - a;
  const Vec3d e2 = npsim::vec_cast<double>(corner[2]) - a;
  const Vec3d n = cross(e1, e2);
  const double det = dot(n, d);
  const Vec3d q = cross(d, o - a);
  const double u = dot(e2, q) / det;
  const double v = -dot(e1, q) / det;
  return {dot(n, a - o) / det, std::min({u, v, 1 - u - v}), std::fabs(det) / (length(n) * length(d))};
}

// A sheet without steps, which every ray from before it through its inside must hit.
Sheet waves(Shape shape) {
  Sheet sheet(shape);
  sheet.fill([&](int x, int y) {
    RandomStream r = stream(static_cast<std::uint32_t>(x + 1000 * y));
    return (8.0F + std::sin(0.2F * static_cast<float>(x)) + std::cos(0.3F * static_cast<float>(y))) *
           r.uniform(0.998F, 1.002F);
  });
  sheet.connect(false);
  sheet.build();
  return sheet;
}

}  // namespace

TEST_CASE("trace sheet: hits agree with double precision, but for edges and faces seen edge-on") {
  Sheet sheet(Shape{33, 27});
  sheet.fill([](int x, int y) { return street_depth(x, y, 27); });
  sheet.connect(true);
  sheet.build();
  std::size_t hits = 0;
  std::size_t misses = 0;
  for (std::uint32_t i = 0; i < 10000; ++i) {
    const Ray ray = ray_of(sheet, i);
    double nearest = std::numeric_limits<double>::infinity();
    double ambiguous = nearest;
    std::uint32_t face = kNoFace;
    for (std::uint32_t f = 0; f < sheet.faces(); ++f) {
      if (!sheet.has(f)) continue;
      const ExactHit exact = exact_hit(sheet.corners(f), ray);
      if (!(exact.t > static_cast<double>(ray.t_min) - 1e-3) || !(exact.t < static_cast<double>(ray.t_max) + 1e-3)) {
        continue;
      }
      const bool near_limit = std::fabs(exact.t - static_cast<double>(ray.t_min)) < 1e-3 ||
                              std::fabs(exact.t - static_cast<double>(ray.t_max)) < 1e-3;
      if (std::fabs(exact.margin) < 1e-2 || exact.cosine < 1e-2 || (near_limit && exact.margin > 0)) {
        ambiguous = std::min(ambiguous, exact.t);
      } else if (exact.margin > 0 && exact.t < nearest) {
        nearest = exact.t;
        face = f;
      }
    }
    if (ambiguous < nearest * (1 + 1e-3)) continue;
    Hit hit;
    CAPTURE(i);
    REQUIRE(npsim::closest_hit(sheet.trace, ray, hit) == (face != kNoFace));
    if (face == kNoFace) {
      ++misses;
      continue;
    }
    ++hits;
    CHECK(hit.face == face);
    const double size = length(npsim::vec_cast<double>(ray.direction));
    const double z = static_cast<double>(ray.origin.z) + nearest * static_cast<double>(ray.direction.z);
    const double reach = length(npsim::vec_cast<double>(ray.origin));
    CHECK(std::fabs(static_cast<double>(hit.t) - nearest) * size <= 1e-5 * std::max({nearest * size, z, reach}));
  }
  CHECK(hits > 800);
  CHECK(misses > 500);
}

TEST_CASE(
    "trace sheet: nothing leaks between faces, at vertices, edges and anywhere, from the camera and from beside") {
  const Shape shape{61, 49};
  const Sheet sheet = waves(shape);
  std::size_t leaks = 0;
  std::size_t rays = 0;
  for (std::uint32_t i = 0; i < 300000; ++i) {
    RandomStream r = stream(i);
    const auto x = static_cast<int>(5 + r.next_u32() % 50U);
    const auto y = static_cast<int>(5 + r.next_u32() % 38U);
    const Vec3f a = sheet.vertices[static_cast<std::size_t>(y * shape.width + x)];
    const Vec3f b = sheet.vertices[static_cast<std::size_t>((y + static_cast<int>(i & 1U)) * shape.width + x + 1)];
    Vec3f to = a;
    if (i % 3 == 1) to = a + (b - a) * r.uniform();
    if (i % 3 == 2) to = a + in_cube(r, 0.1F);
    Ray ray{{0, 0, 0}, to};
    if (i % 2 == 1) {
      ray.origin = in_cube(r, 0.3F);
      ray.direction = to - ray.origin;
    }
    if (i % 5 == 4) {  // from behind the sheet
      ray.origin = to * 3.0F + in_cube(r, 0.3F);
      ray.direction = to - ray.origin;
    }
    ++rays;
    Hit hit;
    if (!npsim::closest_hit(sheet.trace, ray, hit)) ++leaks;
    if (i % 8 == 0 && !npsim::occluded(sheet.trace, ray)) ++leaks;
  }
  CAPTURE(rays);
  CHECK(leaks == 0);
}

TEST_CASE("trace sheet: the general tree over the exported faces finds the same") {
  Sheet sheet(Shape{50, 40});
  sheet.fill([](int x, int y) { return street_depth(x, y, 40); });
  sheet.connect(true);
  sheet.build();
  std::vector<Face> faces;
  std::vector<std::uint32_t> number;
  for (std::uint32_t f = 0; f < sheet.faces(); ++f) {
    if (!sheet.has(f)) continue;
    faces.push_back(npsim::sheet_face(sheet.trace.quads, f));
    number.push_back(f);
  }
  const npsim_test::Tree<> tree({{sheet.vertices.data(), sheet.vertices.size()}, {faces.data(), faces.size()}});
  std::size_t hits = 0;
  for (std::uint32_t i = 0; i < 20000; ++i) {
    const Ray ray = ray_of(sheet, i);
    Hit a;
    Hit b;
    const bool found = npsim::closest_hit(tree.bvh, ray, b);
    CAPTURE(i);
    REQUIRE(npsim::closest_hit(sheet.trace, ray, a) == found);
    if (!found) continue;
    ++hits;
    CHECK(a.face == number[b.face]);
    CHECK(a.t == b.t);
    CHECK(npsim::occluded(sheet.trace, ray, [&](std::uint32_t f) { return f == a.face; }));
    CHECK_FALSE(npsim::occluded(sheet.trace, ray, [](std::uint32_t) { return false; }));
  }
  CHECK(hits > 3000);
}

TEST_CASE(
    "trace sheet: rays in the plane of faces, along columns and rows, through the camera and parallel to the image") {
  const Shape shape{40, 30};
  Sheet flat(shape);  // a wall that faces the camera: whole rows of faces in the plane of a ray
  flat.fill([](int, int) { return 5.0F; });
  flat.connect(false);
  flat.build();
  Sheet street(shape);
  street.fill([](int x, int y) { return street_depth(x, y, 30); });
  street.connect(false);
  street.build();
  for (Sheet* sheet : {&flat, &street}) {
    std::size_t hits = 0;
    for (std::uint32_t i = 0; i < 4000; ++i) {
      RandomStream r = stream(70000 + i);
      const auto x = static_cast<int>(r.next_u32() % 40U);
      const auto y = static_cast<int>(r.next_u32() % 30U);
      const Vec3f v = sheet->at(x, y);
      const Vec3f along_column = sheet->at(x, (y + 7) % 30) - v;
      const Vec3f along_row = sheet->at((x + 7) % 40, y) - v;
      const float z = r.uniform(0.0F, 10.0F);
      const Vec3f axis = i % 3 == 0 ? Vec3f{1, -0.0F, 1e-40F} : i % 3 == 1 ? Vec3f{1e-42F, 1, 0} : Vec3f{0, -1e-40F, 1};
      const Ray rays[] = {
          {v, along_column},                        // in the column's plane, along its vertices
          {v, along_row},                           //
          {v - along_row, along_row},               //
          {{v.x, v.y, z}, {0.3F, 0.7F, 0}},         // parallel to the image
          {{-100, v.y, v.z}, {1, 0, 0}},            // in the wall
          {v * 3.0F, v * -1.0F},                    // through the camera and out behind it
          {v * -1.0F, v},                           // from behind the camera
          {v * 0.5F, v * -1.0F},                    // away, backwards
          {v * 2.0F, v},                            // away, forwards
          {{0, 0, 0}, axis},                        // an axis with zeros and denormals
          {{v.x, v.y, z}, axis},                    //
          {{v.x * 1e-38F, 1e-40F, 0}, v * 1e-20F},  //
          {v, v * 1e-37F},                          // a direction too short to be told from none
          {{1e6F, 0, 0}, v - Vec3f{1e6F, 0, 0}},    // from far away
          {{0, 0, -1e9F}, {0, 0, 1e9F + v.z}},      // all faces are tested
      };
      for (const Ray& ray : rays) {
        Hit expected;
        Hit got;
        const bool found = hit_by_all_faces(*sheet, ray, expected);
        if (i >= 300 && &ray - rays > 12) continue;
        CAPTURE(i);
        CAPTURE(&ray - rays);
        REQUIRE(npsim::closest_hit(sheet->trace, ray, got) == found);
        REQUIRE(npsim::occluded(sheet->trace, ray) == found);
        if (found) {
          ++hits;
          CHECK(same_bits(got, expected));
        }
      }
      if (i > 400) break;
    }
    CHECK(hits > 100);
  }
}

TEST_CASE("trace sheet: one pixel, one row, one quad, no face, no vertex") {
  Hit hit;
  const Ray ahead{{0, 0, 0}, {0, 0, 1}};
  for (const Shape shape : {Shape{1, 1}, Shape{7, 1}, Shape{1, 7}}) {
    Sheet sheet(shape);
    sheet.fill([](int, int) { return 3.0F; });
    sheet.build();
    CHECK_FALSE(npsim::closest_hit(sheet.trace, ahead, hit));
    CHECK_FALSE(npsim::occluded(sheet.trace, ahead));
  }
  Sheet one(Shape{2, 2});
  one.fill([](int, int) { return 3.0F; });
  one.quads[0] = npsim::kQuadUpperFace | npsim::kQuadLowerFace;
  one.build();
  REQUIRE(npsim::closest_hit(one.trace, ahead, hit));  // on the diagonal: a tie
  CHECK(hit.face == 0);
  CHECK(hit.t == 3.0F);
  one.quads[0] = npsim::kQuadLowerFace;
  one.build();
  REQUIRE(npsim::closest_hit(one.trace, ahead, hit));
  CHECK(hit.face == 1);
  one.quads[0] = npsim::kQuadAntiDiagonal;  // all faces deleted
  one.build();
  CHECK_FALSE(npsim::closest_hit(one.trace, ahead, hit));
  one.quads[0] = 7;
  for (Vec3f& v : one.vertices) v = {};
  one.build();
  CHECK_FALSE(npsim::closest_hit(one.trace, ahead, hit));
  CHECK_FALSE(npsim::closest_hit(npsim::SheetTrace{}, ahead, hit));
  CHECK_FALSE(npsim::occluded(npsim::SheetScene{}, ahead));
}

TEST_CASE("trace sheet: steps in depth of 1 to 1000 m between neighbours") {
  for (const float step : {1.0F, 10.0F, 100.0F, 1000.0F}) {
    Sheet sheet(Shape{30, 24});
    sheet.fill([step](int x, int y) { return 1.0F + ((x / 3 + y / 4) % 2 == 0 ? step : 0.0F); });
    sheet.connect(false);
    sheet.build();
    std::size_t hits = 0;
    for (std::uint32_t i = 0; i < 3000; ++i) {
      const Ray ray = ray_of(sheet, i);
      Hit expected;
      Hit got;
      const bool found = hit_by_all_faces(sheet, ray, expected);
      CAPTURE(i);
      CAPTURE(step);
      REQUIRE(npsim::closest_hit(sheet.trace, ray, got) == found);
      if (!found) continue;
      ++hits;
      CHECK(same_bits(got, expected));
    }
    CHECK(hits > 500);
  }
}

TEST_CASE("trace sheet: NaN and infinity in rays miss, in vertices take their faces away") {
  Sheet sheet = waves(Shape{20, 20});
  Hit hit;
  const Ray good{{0, 0, 0}, {0, 0, 1}};
  REQUIRE(npsim::closest_hit(sheet.trace, good, hit));
  for (const float bad : {kNan, kInf, -kInf}) {
    for (int k = 0; k < 6; ++k) {
      Ray ray = good;
      float* const part[6] = {&ray.origin.x,    &ray.origin.y,    &ray.origin.z,
                              &ray.direction.x, &ray.direction.y, &ray.direction.z};
      *part[k] = bad;
      CHECK_FALSE(npsim::closest_hit(sheet.trace, ray, hit));
      CHECK_FALSE(npsim::occluded(sheet.trace, ray));
    }
  }
  CHECK_FALSE(npsim::closest_hit(sheet.trace, Ray{{0, 0, 0}, {0, 0, 0}}, hit));
  CHECK_FALSE(npsim::closest_hit(sheet.trace, Ray{{0, 0, 0}, {0, 0, 1}, kNan, kInf}, hit));
  CHECK_FALSE(npsim::closest_hit(sheet.trace, Ray{{0, 0, 0}, {0, 0, 1}, 0, kNan}, hit));
  CHECK_FALSE(npsim::closest_hit(sheet.trace, Ray{{0, 0, 0}, {0, 0, 1}, kInf, kInf}, hit));
  std::uint32_t i = 0;
  for (Vec3f& v : sheet.vertices) {
    if (++i % 3 == 0) (i % 2 == 0 ? v.z : i % 5 < 2 ? v.x : v.y) = i % 4 == 0 ? kNan : i % 4 == 1 ? kInf : -kInf;
  }
  sheet.build();
  std::size_t hits = 0;
  for (std::uint32_t k = 0; k < 2000; ++k) {
    RandomStream r = stream(k);
    const Ray ray{{0, 0, 0}, {r.uniform(-0.5F, 0.5F), r.uniform(-0.5F, 0.5F), 1}};
    if (!npsim::closest_hit(sheet.trace, ray, hit)) continue;
    ++hits;
    for (const Vec3f& c : sheet.corners(hit.face)) CHECK(npsim::is_finite(c));
  }
  CHECK(hits > 100);
  CHECK(hits < 1900);
  for (Vec3f& v : sheet.vertices) v = {kNan, kInf, kNan};
  sheet.build();
  CHECK_FALSE(npsim::closest_hit(sheet.trace, good, hit));
}

TEST_CASE("trace sheet: two layers traced as one give the nearer hit, ties to the first layer") {
  const Shape shape{40, 30};
  Sheet back(shape);
  back.fill([](int x, int y) { return 1.3F * street_depth(x, y, 30); });
  back.connect(false);
  back.build();
  Sheet front(shape);
  front.fill([](int x, int y) { return x % 10 < 6 ? street_depth(x, y, 30) : 0.0F; });
  front.connect(true);
  front.build();
  const npsim::SheetTrace layers[3] = {back.trace, front.trace, back.trace};
  npsim::SheetScene scene;
  REQUIRE(npsim::join_layers({layers, 3}, scene).ok());
  std::size_t of_front = 0;
  for (std::uint32_t i = 0; i < 8000; ++i) {
    const Ray ray = ray_of(back, i);
    Hit a;
    Hit b;
    Hit got;
    const bool in_back = npsim::closest_hit(back.trace, ray, a);
    const bool in_front = npsim::closest_hit(front.trace, ray, b);
    CAPTURE(i);
    REQUIRE(npsim::closest_hit(scene, ray, got) == (in_back || in_front));
    CHECK(npsim::occluded(scene, ray) == (in_back || in_front));
    if (!in_back && !in_front) continue;
    const bool front_wins = in_front && (!in_back || b.t < a.t);
    of_front += front_wins ? 1 : 0;
    CHECK(got.face == (front_wins ? b.face + back.faces() : a.face));
    const float nearer = front_wins ? b.t : a.t;
    CHECK(std::fabs(got.t - nearer) <= 1e-5F * nearer);
  }
  CHECK(of_front > 500);

  Sheet other(Shape{20, 30});
  other.fill([](int, int) { return 3.0F; });
  other.connect(false);
  other.build();
  const npsim::SheetTrace wrong[2] = {back.trace, other.trace};
  CHECK(npsim::join_layers({wrong, 2}, scene).code() == npsim::StatusCode::shape_mismatch);
}

TEST_CASE("trace sheet: vertices off their pixels' rays are still hit where they are") {
  Sheet sheet(Shape{40, 30});
  sheet.fill([](int x, int y) { return street_depth(x, y, 30); });
  for (std::size_t i = 0; i < sheet.vertices.size(); ++i) {
    RandomStream r = stream(static_cast<std::uint32_t>(i));
    sheet.vertices[i] = sheet.vertices[i] + in_cube(r, 0.02F * sheet.vertices[i].z);
  }
  sheet.connect(false);
  sheet.build();
  CHECK(sheet.trace.bounds.pad_px > 0.3F);
  std::size_t hits = 0;
  for (std::uint32_t i = 0; i < 6000; ++i) {
    const Ray ray = ray_of(sheet, i);
    Hit expected;
    Hit got;
    const bool found = hit_by_all_faces(sheet, ray, expected);
    CAPTURE(i);
    REQUIRE(npsim::closest_hit(sheet.trace, ray, got) == found);
    if (!found) continue;
    ++hits;
    CHECK(same_bits(got, expected));
  }
  CHECK(hits > 1000);
}

TEST_CASE("trace sheet: a workspace too small and quads of another shape are refused") {
  Sheet sheet = waves(Shape{20, 20});
  npsim_test::Scratch half(npsim::sheet_workspace_bytes(sheet.shape) / 2);
  npsim::SerialExecutor executor;
  npsim::SheetTrace trace;
  CHECK(npsim::build_sheet_trace(sheet.layer(), sheet.k, half.workspace(), trace, executor).code() ==
        npsim::StatusCode::workspace_exhausted);
  CHECK(trace.levels == 0);
  npsim::SheetLayer layer = sheet.layer();
  layer.quads = {sheet.quads.data(), Shape{10, 10}};
  CHECK_FALSE(npsim::build_sheet_trace(layer, sheet.k, half.workspace(), trace, executor).ok());
  CHECK(static_cast<double>(npsim::sheet_workspace_bytes({960, 540})) < 2.1 * 2 * 959 * 539);
}
