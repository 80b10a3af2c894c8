// SPDX-License-Identifier: Apache-2.0
// Trees behind a transform: the same hits as of the mesh moved, no leak, and no ray that meets the face it left.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "npsim/trace/bvh.hpp"
#include "reference/triangle_scan.hpp"
#include "trace_tree.hpp"

namespace {

using npsim::AffineTransform;
using npsim::Bvh;
using npsim::Hit;
using npsim::Instance;
using npsim::RandomStream;
using npsim::Ray;
using npsim::Vec3d;
using npsim::Vec3f;
using npsim::reference::in_cube;
using npsim::reference::ScanMesh;
using npsim::reference::soup;
using npsim::reference::stream;
using npsim::testing::Tree;

AffineTransform random_transform(std::uint32_t number, float scale, float distance) {
  RandomStream random = stream(7000 + number);
  AffineTransform out;
  for (Vec3f& row : out.row) row = in_cube(random, scale);
  for (int i = 0; i < 3; ++i) {  // not nearly flat
    float& diagonal = i == 0 ? out.row[0].x : (i == 1 ? out.row[1].y : out.row[2].z);
    diagonal += std::copysign(2.0F * scale, diagonal);
  }
  out.offset = in_cube(random, distance);
  return out;
}

Vec3d in_world(const AffineTransform& a, const Vec3f& p) {
  const Vec3d q = npsim::vec_cast<double>(p);
  const auto row = [&](int i) { return dot(npsim::vec_cast<double>(a.row[i]), q); };
  return Vec3d{row(0), row(1), row(2)} + npsim::vec_cast<double>(a.offset);
}

// A closed box.
ScanMesh box() {
  ScanMesh mesh;
  for (int k = 0; k < 3; ++k) {
    for (const float side : {-1.0F, 1.0F}) {
      const auto at = [&](float u, float v) {
        return k == 0 ? Vec3f{side, u, v} : (k == 1 ? Vec3f{v, side, u} : Vec3f{u, v, side});
      };
      mesh.add(at(-1, -1), at(1, -1), at(1, 1));
      mesh.add(at(-1, -1), at(1, 1), at(-1, 1));
    }
  }
  return mesh;
}

}  // namespace

TEST_CASE("trace instance: the identity changes nothing, and a translation by whole numbers moves hits exactly") {
  const ScanMesh mesh = box();
  const Tree<> tree(mesh);
  Instance<Bvh> same;
  REQUIRE(npsim::make_instance(tree.bvh, AffineTransform{}, same).ok());
  Instance<Bvh> moved;
  AffineTransform shift;
  shift.offset = {16, -32, 64};
  REQUIRE(npsim::make_instance(tree.bvh, shift, moved).ok());
  for (std::uint32_t i = 0; i < 500; ++i) {
    RandomStream random = stream(i);
    Ray ray{in_cube(random, 2.0F), in_cube(random, 1.0F)};
    ray.origin = {std::round(ray.origin.x * 1024) / 1024, std::round(ray.origin.y * 1024) / 1024,
                  std::round(ray.origin.z * 1024) / 1024};
    Hit a;
    Hit b;
    Hit c;
    const bool met = npsim::closest_hit(tree.bvh, ray, a);
    CHECK(npsim::closest_hit(same, ray, b) == met);
    CHECK(npsim::reference::same(a, b));
    CHECK(npsim::occluded(same, ray) == met);
    const Ray there{ray.origin + shift.offset, ray.direction};
    CHECK(npsim::closest_hit(moved, there, c) == met);
    CHECK(npsim::reference::same(a, c));
    CHECK(npsim::occluded(moved, there, [](std::uint32_t) { return true; }) == met);
  }
}

TEST_CASE("trace instance: hits agree with the mesh moved into the world, and points lie within their error") {
  const ScanMesh mesh = soup(200, 0.3F, 1.0F, 17);
  const Tree<> tree(mesh);
  std::size_t hits = 0;
  double worst = 0;
  for (std::uint32_t i = 0; i < 60; ++i) {
    const float scale = i % 3 == 0 ? 1e-3F : (i % 3 == 1 ? 1.0F : 300.0F);
    const AffineTransform to_world = random_transform(i, scale, scale * (i % 2 == 0 ? 1.0F : 50.0F));
    Instance<Bvh> instance;
    REQUIRE(npsim::make_instance(tree.bvh, to_world, instance).ok());
    for (std::uint32_t j = 0; j < 100; ++j) {
      RandomStream random = stream(1000 * i + j);
      const Vec3f aim = npsim::transform_point(to_world, in_cube(random, 1.0F));
      const Vec3f from = npsim::transform_point(to_world, in_cube(random, 3.0F));
      const Ray ray{from, aim - from};
      Hit hit;
      if (!npsim::closest_hit(instance, ray, hit)) continue;
      ++hits;
      CHECK(npsim::occluded(instance, ray));
      const npsim::Face& f = mesh.faces[hit.face];
      const Vec3d a = in_world(to_world, mesh.vertices[f.a]);
      const Vec3d b = in_world(to_world, mesh.vertices[f.b]);
      const Vec3d c = in_world(to_world, mesh.vertices[f.c]);
      const Vec3d n = cross(b - a, c - a);
      const Vec3d d = npsim::vec_cast<double>(ray.direction);
      const npsim::SurfacePoint p = npsim::surface_point(instance, mesh.view(), hit);
      const double turn = length(npsim::vec_cast<double>(p.normal) - n / length(n));
      CHECK(turn < 2e-5 * length(b - a) * length(c - a) / length(n));
      // The exact point of the barycentric coordinates that were reported.
      const double u = static_cast<double>(hit.u);
      const double v = static_cast<double>(hit.v);
      const Vec3d at = a * (1 - u - v) + b * u + c * v;
      const Vec3d off = npsim::vec_cast<double>(p.position) - at;
      CHECK(std::fabs(off.x) <= static_cast<double>(p.error.x));
      CHECK(std::fabs(off.y) <= static_cast<double>(p.error.y));
      CHECK(std::fabs(off.z) <= static_cast<double>(p.error.z));
      // t of the plane in the world, where it is not seen edge-on.
      const double cosine = std::fabs(dot(n, d)) / (length(n) * length(d));
      if (cosine < 0.1) continue;
      const double t = dot(n, a - npsim::vec_cast<double>(ray.origin)) / dot(n, d);
      const double reach = static_cast<double>(length(from) + length(ray.direction));
      worst = std::max(worst, std::fabs(t - static_cast<double>(hit.t)) * length(d) / reach);
    }
  }
  CHECK(hits > 2000);
  CHECK(worst < 2e-5);
}

TEST_CASE("trace instance: no leak at vertices and edges, and a spawned ray never meets the face it left") {
  const ScanMesh mesh = box();
  const Tree<> tree(mesh);
  std::size_t leaks = 0;
  std::size_t own = 0;
  std::size_t spawned = 0;
  for (std::uint32_t i = 0; i < 40; ++i) {
    const float scale = std::ldexp(1.0F, static_cast<int>(i % 5) * 6 - 12);
    const AffineTransform to_world = random_transform(100 + i, scale, scale * (i % 2 == 0 ? 2.0F : 1000.0F));
    Instance<Bvh> instance;
    REQUIRE(npsim::make_instance(tree.bvh, to_world, instance).ok());
    for (std::uint32_t j = 0; j < 500; ++j) {
      RandomStream random = stream(1000 * i + j);
      const npsim::Face& face = mesh.faces[random.next_u32() % mesh.faces.size()];
      const Vec3f a = npsim::transform_point(to_world, mesh.vertices[face.a]);
      const Vec3f b = npsim::transform_point(to_world, mesh.vertices[face.b]);
      const Vec3f inside = npsim::transform_point(to_world, in_cube(random, 0.5F));
      const Ray ray{inside, (j % 2 == 0 ? a : 0.5F * (a + b)) - inside};
      Hit hit;
      if (!npsim::closest_hit(instance, ray, hit)) {
        ++leaks;
        continue;
      }
      const npsim::SurfacePoint p = npsim::surface_point(instance, mesh.view(), hit);
      Vec3f direction = in_cube(random, 1.0F);
      if (j % 3 == 0) direction = direction - p.normal * dot(p.normal, direction);  // grazing
      const Vec3f origin = npsim::offset_ray_origin(p.position, p.error, p.normal, direction);
      ++spawned;
      own +=
          npsim::occluded(instance, Ray{origin, direction}, [&](std::uint32_t f) { return f == hit.face; }) ? 1U : 0U;
    }
  }
  CHECK(leaks == 0);
  CHECK(spawned == 20000);
  CHECK(own == 0);
}

TEST_CASE("trace instance: transforms without a good inverse are a status, and the instance stays") {
  const Tree<> tree(box());
  Instance<Bvh> out;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  AffineTransform flat;
  flat.row[2] = {1, 1, 0};
  CHECK(npsim::make_instance(tree.bvh, flat, out).code() == npsim::StatusCode::invalid_argument);
  flat.row[2] = {1, 1, 1e-7F};
  CHECK_FALSE(npsim::make_instance(tree.bvh, flat, out).ok());
  flat = {};
  flat.offset.y = nan;
  CHECK_FALSE(npsim::make_instance(tree.bvh, flat, out).ok());
  flat = {};
  flat.row[1].x = std::numeric_limits<float>::infinity();
  CHECK_FALSE(npsim::make_instance(tree.bvh, flat, out).ok());
  flat = {};
  flat.row[0] = {0, 0, 0};
  CHECK_FALSE(npsim::make_instance(tree.bvh, flat, out).ok());
  CHECK(out.tree.nodes.empty());
}
