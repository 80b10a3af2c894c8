// SPDX-License-Identifier: Apache-2.0
// Trees of every width and pack against every face in turn, bit for bit, and the meshes that break builders.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <limits>

#include "npsim/trace/bvh.hpp"
#include "reference/triangle_scan.hpp"
#include "trace_tree.hpp"

namespace {

using npsim::Hit;
using npsim::RandomStream;
using npsim::Ray;
using npsim::Vec3f;
using npsim::reference::hard_ray;
using npsim::reference::in_cube;
using npsim::reference::same;
using npsim::reference::scan;
using npsim::reference::ScanMesh;
using npsim::reference::soup;
using npsim::reference::stream;
using npsim_test::Tree;

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// Closest hit and occlusion, also of every third face alone; returns the number of hits.
template <unsigned W, unsigned P>
std::size_t compare(const ScanMesh& mesh, std::uint32_t rays, float scale, const Vec3f& centre) {
  CAPTURE(W);
  CAPTURE(P);
  const Tree<W, P> tree(mesh);
  const auto third = [](std::uint32_t face) { return face % 3 == 0; };
  std::size_t hits = 0;
  std::size_t wrong = 0;
  for (std::uint32_t i = 0; i < rays; ++i) {
    const Ray ray = hard_ray(mesh, i, scale, centre);
    Hit expected;
    Hit got;
    const bool met = scan(mesh, tree.bvh.low, tree.bvh.high, ray, expected);
    wrong += npsim::closest_hit(tree.bvh, ray, got) != met || !same(expected, got) ? 1U : 0U;
    wrong += npsim::occluded(tree.bvh, ray) != met ? 1U : 0U;
    Hit some;
    wrong +=
        npsim::occluded(tree.bvh, ray, third) != scan(mesh, tree.bvh.low, tree.bvh.high, ray, third, some) ? 1U : 0U;
    hits += met ? 1U : 0U;
    if (!met) continue;
    // Limits exactly at the surface leave it out, those next to it do not.
    Ray cut = ray;
    cut.t_max = expected.t;
    wrong += npsim::occluded(tree.bvh, cut) ? 1U : 0U;
    cut.t_max = std::nextafter(expected.t, kInf);
    wrong += npsim::closest_hit(tree.bvh, cut, got) && same(expected, got) ? 0U : 1U;
    cut = ray;
    cut.t_min = std::nextafter(expected.t, 0.0F);
    wrong += npsim::closest_hit(tree.bvh, cut, got) && same(expected, got) ? 0U : 1U;
    cut.t_min = expected.t;
    wrong += npsim::closest_hit(tree.bvh, cut, got) && !(got.t > expected.t) ? 1U : 0U;
  }
  CHECK(wrong == 0);
  return hits;
}

std::size_t compare_all(const ScanMesh& mesh, std::uint32_t rays, float scale, const Vec3f& centre = {}) {
  std::size_t hits = compare<8, 8>(mesh, rays, scale, centre);
  CHECK(compare<4, 4>(mesh, rays, scale, centre) == hits);
  CHECK(compare<16, 16>(mesh, rays, scale, centre) == hits);
  CHECK(compare<2, 2>(mesh, rays / 4, scale, centre) <= hits);
  CHECK(compare<8, 4>(mesh, rays / 4, scale, centre) <= hits);
  CHECK(compare<4, 16>(mesh, rays / 4, scale, centre) <= hits);
  return hits;
}

}  // namespace

TEST_CASE("trace wide: every width and pack gives the bits of all faces in turn, at every scale and far away") {
  for (const float scale : {1e-4F, 1.0F, 1e4F}) {
    CAPTURE(scale);
    CHECK(compare_all(soup(300, 0.2F, scale, 11), 800, scale) > 200);
  }
  const Vec3f far{1e5F, -6e4F, 8e4F};
  CHECK(compare_all(soup(300, 0.2F, 1.0F, 12, far), 800, 1.0F, far) > 200);
  CHECK(compare_all(soup(300, 0.2F, 100.0F, 13, far), 800, 100.0F, far) > 200);
}

TEST_CASE("trace wide: needles, ties and sizes that differ by 2^40") {
  ScanMesh mesh = soup(100, 0.2F, 1.0F, 21);
  for (std::uint32_t i = 0; i < 100; ++i) {
    RandomStream random = stream(3000 + i);
    const Vec3f a = in_cube(random, 1.0F);
    const Vec3f b = in_cube(random, 1.0F);
    mesh.add(a, b, b + in_cube(random, 1e-6F));
    mesh.faces.push_back(mesh.faces[i]);
    mesh.faces.push_back({mesh.faces[i].b, mesh.faces[i].c, mesh.faces[i].a});
  }
  for (int i = 0; i < 40; ++i) {
    const float size = std::ldexp(1.0F, i - 35);
    mesh.add({size, 0, size}, {size, size, size}, {size, 0, 2 * size});
  }
  CHECK(compare_all(mesh, 1600, 1.0F) > 300);
}

TEST_CASE("trace wide: a regular grid in a plane of the axes, hit along columns, rows and edges") {
  ScanMesh mesh;
  for (std::uint32_t y = 0; y <= 16; ++y) {
    for (std::uint32_t x = 0; x <= 16; ++x) {
      mesh.vertices.push_back({static_cast<float>(x) / 16 - 0.5F, static_cast<float>(y) / 16 - 0.5F, 0.25F});
    }
  }
  for (std::uint32_t y = 0; y < 16; ++y) {
    for (std::uint32_t x = 0; x < 16; ++x) {
      const std::uint32_t a = y * 17 + x;
      mesh.faces.push_back({a, a + 1, a + 17});
      mesh.faces.push_back({a + 1, a + 18, a + 17});
    }
  }
  CHECK(compare_all(mesh, 1600, 1.0F) > 300);
  const Tree<8, 8> tree(mesh);
  for (int i = -8; i <= 8; ++i) {
    for (int j = -8; j <= 8; ++j) {  // every vertex and the middles of the edges, from straight ahead
      for (const float half : {0.0F, 0.5F}) {
        const float x = (static_cast<float>(i) + (i < 8 ? half : 0.0F)) / 16;
        Hit hit;
        REQUIRE(npsim::closest_hit(tree.bvh, Ray{{x, static_cast<float>(j) / 16, -1}, {0, 0, 1}}, hit));
        CHECK(hit.t == 1.25F);
      }
    }
  }
}

TEST_CASE("trace wide: NaN, infinity and faces without area everywhere") {
  ScanMesh mesh = soup(200, 0.3F, 1.0F, 31);
  ScanMesh good = mesh;
  const float bad[] = {kNan, kInf, -kInf, 3e38F, -0x1.000002p60F};
  for (std::uint32_t i = 0; i < 600; ++i) {
    RandomStream random = stream(9000 + i);
    Vec3f corner[3] = {in_cube(random, 1.0F), in_cube(random, 1.0F), in_cube(random, 1.0F)};
    if (i % 3 == 0) (i % 2 == 0 ? corner[i % 9 / 3].x : corner[i % 9 / 3].z) = bad[i % 5];
    if (i % 3 == 1) corner[2] = corner[i % 2];
    if (i % 3 == 2) corner[2] = corner[0] = corner[1];
    mesh.add(corner[0], corner[1], corner[2]);
  }
  CHECK(compare_all(mesh, 800, 1.0F) > 150);
  ScanMesh nothing = mesh;
  nothing.faces.erase(nothing.faces.begin(), nothing.faces.begin() + 200);
  const Tree<8, 8> empty(nothing);
  CHECK(empty.bvh.packs.empty());
  const Tree<8, 8> with(mesh);
  const Tree<8, 8> without(good);
  CHECK(with.bvh.packs.size() == without.bvh.packs.size());
  const Ray rays[] = {{{kNan, 0, 0}, {0, 0, 1}}, {{0, 0, 0}, {0, 0, 0}},     {{0, 0, 0}, {kInf, 0, 1}},
                      {{0, 0, 0}, {0, kNan, 1}}, {{0, -kInf, 0}, {0, 1, 0}}, {{0, 0, 0}, {1e-40F, 0, 0}}};
  for (const Ray& ray : rays) {
    Hit hit;
    CHECK_FALSE(npsim::closest_hit(with.bvh, ray, hit));
    CHECK_FALSE(npsim::occluded(with.bvh, ray));
  }
}

TEST_CASE("trace wide: a million identical and a million coplanar triangles build in no time, and are hit in order") {
  constexpr std::uint32_t n = 1000000;
  ScanMesh identical;
  identical.vertices = {{-1, -1, 2}, {1, -1, 2}, {0, 1, 2}};
  identical.faces.assign(n, npsim::Face{0, 1, 2});
  const std::clock_t begin = std::clock();  // of the processor: other programs do not count
  const Tree<8, 8> same_place(identical);
  ScanMesh coplanar;
  coplanar.faces.reserve(n);
  coplanar.vertices.reserve(3 * std::size_t{n});
  for (std::uint32_t i = 0; i < n; ++i) {  // about fifty at every place
    RandomStream random = stream(i);
    const float x = random.uniform(-1.0F, 1.0F);
    const float y = random.uniform(-1.0F, 1.0F);
    coplanar.add({x, y, 2}, {x + 0.02F, y, 2}, {x, y + 0.01F, 2});
  }
  const Tree<8, 8> one_plane(coplanar);
  const double took_s = static_cast<double>(std::clock() - begin) / static_cast<double>(CLOCKS_PER_SEC);
  CHECK(took_s < 60.0);  // a builder that finds no split and does not give up takes hours
  CHECK(same_place.bvh.packs.size() == n / 8);
  Hit hit;
  REQUIRE(npsim::closest_hit(same_place.bvh, Ray{{0, 0, 0}, {0, 0, 1}}, hit));
  CHECK(hit.face == 0);
  CHECK(hit.t == 2.0F);
  CHECK(npsim::occluded(same_place.bvh, Ray{{0, 0, 0}, {0, 0, 1}}, [](std::uint32_t f) { return f == 777777; }));
  CHECK_FALSE(npsim::closest_hit(same_place.bvh, Ray{{0, 0, 2}, {0, 1, 0}}, hit));
  CHECK_FALSE(npsim::closest_hit(one_plane.bvh, Ray{{-2, 0.1F, 2}, {1, 0, 0}}, hit));  // in the plane
  for (const Vec3f target : {Vec3f{0.1F, 0.2F, 2}, Vec3f{-0.5F, 0.75F, 2}, coplanar.vertices[300]}) {
    const Ray ray{{0, 0, 0}, target};
    Hit expected;
    const bool met = scan(coplanar, one_plane.bvh.low, one_plane.bvh.high, ray, expected);
    REQUIRE(npsim::closest_hit(one_plane.bvh, ray, hit) == met);
    CHECK(same(hit, expected));
  }
}

TEST_CASE("trace wide: a pack gives the bits of one triangle at a time") {
  std::size_t hits = 0;
  for (std::uint32_t i = 0; i < 4000; ++i) {
    const ScanMesh mesh = soup(8, 1.5F, 1.0F, 100 + 8 * i);
    npsim::TrianglePack<8> pack{};
    for (std::uint32_t lane = 0; lane < 8; ++lane) {
      const npsim::Face& f = mesh.faces[lane];
      Vec3f corners[3] = {mesh.vertices[f.a], mesh.vertices[f.b], mesh.vertices[f.c]};
      if (i % 4 == 3 && lane == 5) corners[1] = corners[2] = corners[0];  // a point
      npsim::bvh_detail::write_lane(corners, lane, lane, pack);
    }
    const Ray ray = hard_ray(mesh, i, 1.0F, {});
    const float low[3] = {-3, -3, -3};
    const float high[3] = {3, 3, 3};
    npsim::RayFrame frame;
    if (!npsim::make_ray_frame(ray, low, high, frame)) continue;
    npsim::PackHit<8> got;
    const std::uint32_t lanes = npsim::intersect_pack(frame, pack, kInf, got);
    for (unsigned lane = 0; lane < 8; ++lane) {
      float vertex[3][3];
      npsim::triangle_of_lane(pack, lane, vertex);
      npsim::TriangleHit expected;
      const bool met = npsim::intersect_triangle(frame, vertex, expected);
      REQUIRE(((lanes >> lane) & 1U) == (met ? 1U : 0U));
      if (!met) continue;
      ++hits;
      CHECK(npsim::reference::bits(got.t[lane]) == npsim::reference::bits(expected.t));
      CHECK(npsim::reference::bits(got.u[lane]) == npsim::reference::bits(expected.u));
      CHECK(npsim::reference::bits(got.v[lane]) == npsim::reference::bits(expected.v));
    }
  }
  CHECK(hits > 2000);
}
