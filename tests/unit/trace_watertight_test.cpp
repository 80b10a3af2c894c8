// SPDX-License-Identifier: Apache-2.0
// Closed surfaces do not leak, and rays that leave a surface do not meet it again.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/random.hpp"
#include "npsim/trace/bvh.hpp"
#include "reference/triangle_scan.hpp"
#include "trace_tree.hpp"

namespace {

using npsim::Face;
using npsim::Hit;
using npsim::RandomPurpose;
using npsim::RandomStream;
using npsim::Ray;
using npsim::Vec3f;
using npsim::reference::in_cube;
using Mesh = npsim::reference::ScanMesh;
using Tree = npsim_test::Tree<>;

// A closed surface of 2 rings sectors - 2 sectors faces round the origin, with radii between 1 and 2, scaled and moved.
Mesh closed_surface(std::uint32_t rings, std::uint32_t sectors, float scale, const Vec3f& centre) {
  Mesh mesh;
  const auto radius = [](std::uint32_t i) {
    RandomStream random(3, RandomPurpose::test, 0, 0, i, 0);
    return random.uniform(1.0F, 2.0F);
  };
  const auto put = [&](double x, double y, double z) {
    const auto r = static_cast<double>(radius(static_cast<std::uint32_t>(mesh.vertices.size())));
    const Vec3f p{static_cast<float>(x * r), static_cast<float>(y * r), static_cast<float>(z * r)};
    mesh.vertices.push_back(p * scale + centre);
  };
  const double pi = std::acos(-1.0);
  put(0, -1, 0);
  for (std::uint32_t i = 1; i < rings; ++i) {
    for (std::uint32_t j = 0; j < sectors; ++j) {
      const double theta = pi * i / rings;
      const double phi = 2 * pi * j / sectors;
      put(std::sin(theta) * std::cos(phi), -std::cos(theta), std::sin(theta) * std::sin(phi));
    }
  }
  put(0, 1, 0);
  const auto last = static_cast<std::uint32_t>(mesh.vertices.size() - 1);
  const auto at = [sectors](std::uint32_t i, std::uint32_t j) { return 1 + (i - 1) * sectors + j % sectors; };
  for (std::uint32_t j = 0; j < sectors; ++j) {
    mesh.faces.push_back({0, at(1, j), at(1, j + 1)});
    mesh.faces.push_back({last, at(rings - 1, j + 1), at(rings - 1, j)});
    for (std::uint32_t i = 1; i + 1 < rings; ++i) {
      mesh.faces.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
      mesh.faces.push_back({at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)});
    }
  }
  return mesh;
}

}  // namespace

TEST_CASE("trace: no leak through vertices and edges of a closed surface, from inside and outside") {
  std::size_t rays = 0;
  std::size_t leaks = 0;
  for (const float scale : {1e-4F, 1e-2F, 1.0F, 1e2F, 1e4F}) {
    for (const float shift : {0.0F, 3.0F}) {
      const Vec3f centre{shift * scale, -2 * shift * scale, 10 * shift * scale};
      const Mesh mesh = closed_surface(20, 40, scale, centre);
      const Tree tree(mesh);
      for (std::uint32_t i = 0; i < 20000; ++i) {
        RandomStream random(4, RandomPurpose::test, 0, 0, i, 0);
        const Face& face = mesh.faces[random.next_u32() % mesh.faces.size()];
        const Vec3f a = mesh.vertices[face.a];
        const Vec3f b = mesh.vertices[face.b];
        // A vertex, the middle of an edge, or another point of it.
        const Vec3f target = i % 3 == 0 ? a : (i % 3 == 1 ? 0.5F * (a + b) : a + random.uniform() * (b - a));
        // The surface is star-shaped about its centre, and .4 scale lies inside.
        const Vec3f inside = centre + (i % 5 == 0 ? Vec3f{} : in_cube(random, 0.2F * scale));
        ++rays;
        if (!npsim::occluded(tree.bvh, Ray{inside, target - inside})) ++leaks;
        // From outside towards a point inside, through the target: beyond it the ray is inside, so it must be hit.
        ++rays;
        const Vec3f outside = inside + (target - inside) * 3.0F;
        Hit hit;
        if (!npsim::closest_hit(tree.bvh, Ray{outside, inside - outside, 0, 1}, hit)) ++leaks;
      }
    }
  }
  CHECK(rays == 400000);
  CHECK(leaks == 0);
}

TEST_CASE("trace: a flat grid seen at a grazing angle does not leak at its inner edges") {
  Mesh mesh;
  const std::uint32_t n = 30;
  for (std::uint32_t y = 0; y <= n; ++y) {
    for (std::uint32_t x = 0; x <= n; ++x) {
      mesh.vertices.push_back({static_cast<float>(x) * 0.1F, 1.5F, static_cast<float>(y) * 0.1F + 20});
    }
  }
  for (std::uint32_t y = 0; y < n; ++y) {
    for (std::uint32_t x = 0; x < n; ++x) {
      const std::uint32_t a = y * (n + 1) + x;
      mesh.faces.push_back({a, a + 1, a + n + 1});
      mesh.faces.push_back({a + 1, a + n + 2, a + n + 1});
    }
  }
  const Tree tree(mesh);
  std::size_t leaks = 0;
  for (std::uint32_t y = 1; y < n; ++y) {
    for (std::uint32_t x = 1; x < n; ++x) {
      const Vec3f target = mesh.vertices[y * (n + 1) + x];
      for (std::uint32_t i = 0; i < 20; ++i) {
        RandomStream random(5, RandomPurpose::test, 0, 0, i, 0);
        const Vec3f origin{random.uniform(0.0F, 3.0F), 1.5F - std::ldexp(1.0F, -static_cast<int>(i)), 0};
        if (!npsim::occluded(tree.bvh, Ray{origin, target - origin})) ++leaks;
      }
    }
  }
  CHECK(leaks == 0);
}

TEST_CASE("trace: rays spawned from a hit do not meet their own face, at any scale and distance from the origin") {
  std::size_t spawned = 0;
  std::size_t own = 0;
  std::size_t inwards = 0;
  std::size_t leaks = 0;
  for (const float scale : {1e-4F, 1.0F, 1e4F}) {
    for (const float shift : {0.0F, 1.0F, 1e3F}) {
      const Vec3f centre{-shift * scale, 0.5F * shift * scale, shift * scale};
      const Mesh mesh = closed_surface(12, 24, scale, centre);
      const Tree tree(mesh);
      for (std::uint32_t i = 0; i < 12000; ++i) {
        RandomStream random(6, RandomPurpose::test, 0, 0, i, 0);
        const Vec3f inside = centre + in_cube(random, 0.2F * scale);
        Hit hit;
        REQUIRE(npsim::closest_hit(tree.bvh, Ray{inside, in_cube(random, 1.0F)}, hit));
        const npsim::SurfacePoint point = npsim::surface_point(mesh.view(), hit);
        CHECK(length(point.normal) == doctest::Approx(1.0).epsilon(1e-6));
        Vec3f direction = in_cube(random, 1.0F);
        if (i % 3 == 0) direction = cross(point.normal, direction) + point.normal * random.uniform(-1e-3F, 1e-3F);
        if (i % 3 == 1) {  // along an edge of the face
          const Face& f = mesh.faces[hit.face];
          direction = (mesh.vertices[f.b] - mesh.vertices[f.a]) * (1.0F / scale);
        }
        const Vec3f origin = npsim::offset_ray_origin(point.position, point.error, point.normal, direction);
        ++spawned;
        if (npsim::occluded(tree.bvh, Ray{origin, direction}, [&hit](auto f) { return f == hit.face; })) ++own;
        // A ray that goes back to the side where it came from stays inside the closed surface.
        if (dot(direction, point.normal) * dot(inside - point.position, point.normal) > 0) {
          ++inwards;
          if (!npsim::occluded(tree.bvh, Ray{origin, direction})) ++leaks;
        }
      }
    }
  }
  CHECK(spawned == 108000);
  CHECK(own == 0);
  CHECK(inwards > 40000);
  CHECK(leaks == 0);
}

TEST_CASE("trace: the offset is proportional to the scale, and small") {
  for (const float scale : {1e-3F, 1.0F, 1e3F}) {
    Mesh mesh;
    mesh.vertices = {{-scale, -scale, 4 * scale}, {3 * scale, -scale, 4 * scale}, {-scale, 3 * scale, 4 * scale}};
    mesh.faces = {{0, 1, 2}};
    const npsim::SurfacePoint point = npsim::surface_point(mesh.view(), Hit{4, 0, 0.25F, 0.25F});
    CHECK(std::fabs(point.normal.z) == 1.0F);
    const Vec3f up = npsim::offset_ray_origin(point.position, point.error, point.normal, {0, 0, 1});
    const Vec3f down = npsim::offset_ray_origin(point.position, point.error, point.normal, {0, 0, -1});
    CHECK(up.z > 4 * scale);
    CHECK(down.z < 4 * scale);
    CHECK(up.z - 4 * scale < 1e-5F * scale);
    CHECK(4 * scale - down.z < 1e-5F * scale);
    CHECK(up.x == point.position.x);
  }
}
