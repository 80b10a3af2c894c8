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
#include "npsim/simd/scalar.hpp"
#include "npsim/trace/bvh.hpp"
#include "npsim/trace/sheet_build.hpp"
#include "npsim/trace/sheet_traverse.hpp"

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
using Scalar = npsim::simd::scalar::F32;

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

RandomStream stream(std::uint32_t i) { return {5, RandomPurpose::test, 0, 0, i, 0}; }

struct Sheet {
  Shape shape;
  npsim::Intrinsics k;
  std::vector<Vec3f> vertices;
  std::vector<std::uint8_t> quads;
  std::vector<unsigned char> bytes;
  npsim::SheetTrace trace;

  explicit Sheet(Shape s)
      : shape(s),
        k(npsim::intrinsics_from_fov(s, 1.2F)),
        vertices(s.pixels()),
        quads(std::max<std::size_t>(npsim::quad_shape(s).empty() ? 0 : npsim::quad_shape(s).pixels(), 1)) {}

  [[nodiscard]] npsim::SheetLayer layer() {
    npsim::SheetLayer out;
    out.vertices = {vertices.data(), shape};
    if (!npsim::quad_shape(shape).empty()) out.quads = {quads.data(), npsim::quad_shape(shape)};
    return out;
  }
  template <class Depth>
  void fill(Depth&& depth) {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) at(x, y) = npsim::unproject_pixel(k, x, y, depth(x, y));
    }
  }
  Vec3f& at(int x, int y) { return vertices[static_cast<std::size_t>(y * shape.width + x)]; }
  void connect(bool random) {
    for (std::size_t i = 0; i < quads.size(); ++i) {
      RandomStream r = stream(static_cast<std::uint32_t>(i) + 77);
      quads[i] = static_cast<std::uint8_t>(random ? r.next_u32() % 8U : 6U | (r.next_u32() & 1U));
    }
  }
  void build() {
    bytes.resize(npsim::sheet_workspace_bytes(shape));
    npsim::Workspace workspace(bytes.data(), bytes.size());
    npsim::SerialExecutor executor;
    REQUIRE(npsim::build_sheet_trace(layer(), k, workspace, trace, executor).ok());
  }
  [[nodiscard]] bool has(std::uint32_t face) const {
    return (quads[face / 2] & (face % 2 == 0 ? npsim::kQuadUpperFace : npsim::kQuadLowerFace)) != 0;
  }
  [[nodiscard]] std::array<Vec3f, 3> corners(std::uint32_t face) const {
    const Face f = npsim::sheet_face(trace, face);
    return {vertices[f.a], vertices[f.b], vertices[f.c]};
  }
  [[nodiscard]] std::uint32_t faces() const { return npsim::sheet_face_count(shape); }
};

// Every face in turn, with the same test.
bool linear_scan(const Sheet& sheet, const Ray& ray, Hit& out) {
  npsim::RayFrame frame;
  if (sheet.trace.levels == 0 || !npsim::make_ray_frame(ray, sheet.trace.bounds.low, sheet.trace.bounds.high, frame)) return false;
  bool found = false;
  for (std::uint32_t f = 0; f < sheet.faces(); ++f) {
    if (!sheet.has(f)) continue;
    const auto c = sheet.corners(f);
    if (!(c[0].z > 0 && c[1].z > 0 && c[2].z > 0)) continue;
    const float vertex[3][3] = {{c[0].x, c[0].y, c[0].z}, {c[1].x, c[1].y, c[1].z}, {c[2].x, c[2].y, c[2].z}};
    npsim::TriangleHit hit;
    if (!npsim::intersect_triangle(frame, vertex, hit) || !(hit.t < frame.t_max)) continue;
    if (!found || hit.t < out.t) {
      out = Hit{hit.t, f, hit.u, hit.v};
      found = true;
    }
  }
  return found;
}

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
        const bool found = linear_scan(sheet, ray, expected);
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
