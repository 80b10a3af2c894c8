// SPDX-License-Identifier: Apache-2.0
#include "npsim/mesh/check.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "mesh_fixture.hpp"

using namespace mesh_test;

namespace {

MeshReport check(const std::vector<Vec3f>& v, const std::vector<Face>& f) {
  return report({{v.data(), v.size()}, {f.data(), f.size()}});
}

const std::vector<Vec3f> kTetrahedron = {{0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {0, 0, 2}};
const std::vector<Face> kClosed = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};

// Interior angle at p, the other way round: by the arc cosine, in long double.
long double angle_at(const Vec3f& p, const Vec3f& q, const Vec3f& r) {
  const auto side = [](const Vec3f& from, const Vec3f& to) {
    return Vec3<long double>{static_cast<long double>(to.x) - static_cast<long double>(from.x),
                             static_cast<long double>(to.y) - static_cast<long double>(from.y),
                             static_cast<long double>(to.z) - static_cast<long double>(from.z)};
  };
  const Vec3<long double> u = side(p, q);
  const Vec3<long double> v = side(p, r);
  return std::acos(std::clamp(dot(u, v) / (std::sqrt(dot(u, u)) * std::sqrt(dot(v, v))), -1.0L, 1.0L));
}

}  // namespace

TEST_CASE("a tetrahedron is watertight; without a face it has a boundary") {
  MeshReport r = check(kTetrahedron, kClosed);
  CHECK(r.watertight());
  CHECK(r.edges == 6);
  CHECK(r.euler_characteristic == 2);
  CHECK(r.components == 1);
  r = check(kTetrahedron, {kClosed.begin(), kClosed.end() - 1});
  CHECK(r.oriented_manifold());
  CHECK(!r.watertight());
  CHECK(r.boundary_edges == 3);
  CHECK(r.boundary_loops == 1);
  CHECK(r.euler_characteristic == 1);
}

TEST_CASE("a face that is turned over, one that is there twice, and one too many at an edge are found") {
  std::vector<Face> faces = kClosed;
  faces[1] = {1, 0, 3};
  CHECK(check(kTetrahedron, faces).inconsistent_edges == 3);
  faces = kClosed;
  faces.push_back({3, 0, 1});
  MeshReport r = check(kTetrahedron, faces);
  CHECK(r.duplicate_faces == 1);
  CHECK(r.nonmanifold_edges == 3);
  std::vector<Vec3f> vertices = kTetrahedron;
  vertices.push_back({5, 5, 5});
  faces = kClosed;
  faces.push_back({0, 1, 4});
  r = check(vertices, faces);
  CHECK(r.duplicate_faces == 0);
  CHECK(r.nonmanifold_edges == 1);
  CHECK(!r.oriented_manifold());
}

TEST_CASE("bad indices, repeated indices, NaN vertices and flat faces are counted and survived") {
  std::vector<Vec3f> vertices = kTetrahedron;
  vertices.push_back({kNaN, 0, 1});
  vertices.push_back({2, 0, 1});
  const MeshReport r = check(vertices, {{0, 1, 99}, {0xFFFFFFFF, 0, 1}, {1, 1, 2}, {0, 1, 4}, {0, 1, 5}, {0, 1, 2}});
  CHECK(r.out_of_range_faces == 2);
  CHECK(r.repeated_index_faces == 1);
  CHECK(r.not_finite_vertices == 1);
  CHECK(r.not_finite_faces == 1);
  CHECK(r.flat_faces == 1);
  CHECK(r.isolated_vertices == 2);
  CHECK(!r.oriented_manifold());
}

TEST_CASE("two fans that meet in one vertex pinch it") {
  const std::vector<Vec3f> v = {{0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {-1, 0, 1}, {-1, -1, 1}};
  const MeshReport r = check(v, {{0, 2, 1}, {0, 4, 3}});
  CHECK(r.pinched_vertices == 1);
  CHECK(r.components == 1);
  CHECK(!r.oriented_manifold());
}

TEST_CASE("nothing at all is no fault, but not watertight either") {
  const MeshReport r = check({}, {});
  CHECK(r.oriented_manifold());
  CHECK(!r.watertight());
  CHECK(check(kTetrahedron, {}).isolated_vertices == 4);
}

TEST_CASE("a mesh check asks for the workspace it said") {
  Workspace none;
  MeshReport r;
  const TriangleMeshView mesh{{kTetrahedron.data(), 4}, {kClosed.data(), 4}};
  CHECK(check_mesh(mesh, none, r).code() == StatusCode::workspace_exhausted);
  std::vector<unsigned char> bytes(check_mesh_workspace_bytes(4, 4) + 64);
  Workspace exact(bytes.data(), check_mesh_workspace_bytes(4, 4));
  CHECK(check_mesh(mesh, exact, r).ok());
  CHECK(exact.used() == 0);
}

TEST_CASE("random garbage faces never crash the check") {
  for (std::uint32_t trial = 0; trial < 300; ++trial) {
    RandomStream random(7, RandomPurpose::test, trial, 0, 0, 0);
    std::vector<Vec3f> v(1 + random.next_u32() % 12);
    for (Vec3f& p : v) p = {random.uniform(), random.uniform(), random.uniform() < 0.1F ? kNaN : random.uniform()};
    std::vector<Face> f(random.next_u32() % 40);
    for (Face& t : f) t = {random.next_u32() % 13, random.next_u32() % 13, random.next_u32() % 13};
    const MeshReport r = check(v, f);
    CHECK(r.boundary_edges + r.nonmanifold_edges <= r.edges);
    CHECK(r.components <= v.size());
  }
}

TEST_CASE("the smallest angle is the least of all corners of all faces") {
  const double kPi = 3.14159265358979323846;
  CHECK(check({{0, 0, 1}, {1, 0, 1}, {0, 1, 1}}, {{0, 2, 1}}).smallest_angle_rad == doctest::Approx(kPi / 4));
  CHECK(check({{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1, 2}}).smallest_angle_rad == doctest::Approx(kPi / 3));
  CHECK(check(kTetrahedron, {}).smallest_angle_rad == 0.0);
  CHECK(check({{0, 0, 1}, {1, 0, 1}, {2, 0, 1}}, {{0, 1, 2}}).smallest_angle_rad == 0.0);
  // A needle of a thousandth, at each corner in turn, a metre and 1e5 m away.
  for (const float far : {1.0F, 1e5F}) {
    const std::vector<Vec3f> needle = {{0, 0, far}, {0.001F * far, 0, far}, {0, far, far}};
    for (const Face& f : {Face{0, 1, 2}, Face{1, 2, 0}, Face{2, 0, 1}}) {
      CHECK(check(needle, {f}).smallest_angle_rad == doctest::Approx(std::atan(1e-3)).epsilon(1e-6));
    }
  }
  // A face with a bad index takes no part.
  CHECK(check(kTetrahedron, {{0, 1, 99}}).smallest_angle_rad == 0.0);
  for (std::uint32_t trial = 0; trial < 500; ++trial) {
    RandomStream random(8, RandomPurpose::test, trial, 0, 0, 0);
    std::vector<Vec3f> v(8);
    for (Vec3f& p : v) p = {random.uniform() - 0.5F, random.uniform() - 0.5F, 0.1F * random.uniform() + 1.0F};
    std::vector<Face> faces;
    long double least = 10.0L;
    for (std::uint32_t i = 0; i < 6; ++i) {
      faces.push_back({i, i + 1, i + 2});
      for (std::uint32_t k = 0; k < 3; ++k) {
        least = std::min(least, angle_at(v[i + k], v[i + (k + 1) % 3], v[i + (k + 2) % 3]));
      }
    }
    // The reference's arc cosine loses half its digits at small angles: 1e-19 / angle.
    CHECK(std::fabs(check(v, faces).smallest_angle_rad - static_cast<double>(least)) <= 1e-15);
  }
}

TEST_CASE("duplicates are counted once each beyond the first, whichever way they are turned and rotated") {
  std::vector<Face> faces = {{0, 1, 2}, {2, 0, 1}, {0, 2, 1}, {1, 3, 2}};
  CHECK(check(kTetrahedron, faces).duplicate_faces == 2);
  faces.push_back({3, 1, 2});
  CHECK(check(kTetrahedron, faces).duplicate_faces == 3);
  CHECK(check(kTetrahedron, kClosed).duplicate_faces == 0);
}

TEST_CASE("a fan of a thousand faces around one vertex, in any order") {
  std::vector<Vec3f> v = {{0, 0, 1}};
  std::vector<Face> faces;
  for (std::uint32_t i = 0; i < 1000; ++i) {
    const float angle = 6.2831853F * static_cast<float>(i) / 1000.0F;
    v.push_back({std::cos(angle), std::sin(angle), 1});
    faces.push_back({0, 1 + i, 1 + (i + 1) % 1000});
  }
  std::reverse(faces.begin() + 200, faces.end());
  MeshReport r = check(v, faces);
  CHECK(r.oriented_manifold());
  CHECK(r.edges == 2000);
  CHECK(r.boundary_loops == 1);
  CHECK(r.euler_characteristic == 1);
  faces.erase(faces.begin() + 300);
  faces.erase(faces.begin() + 700);
  r = check(v, faces);
  CHECK(r.pinched_vertices == 1);
}

TEST_CASE("a background is whole: every pixel but sky, every face that its vertices allow") {
  Picture p({12, 8});
  p.rectangle(3, 2, 6, 5, label::car, 4.0F);
  p.rectangle(0, 0, 11, 0, label::sky, 900.0F);
  p.run();
  LayerReport r;
  REQUIRE(check_background(p.background.view(), p.state.cview(), r).ok());
  CHECK(r.whole());
  CHECK(r.covered_pixels == 12 * 7);
  CHECK(r.faces == 2 * 11 * 6);
  const std::uint8_t quad = p.background.quads(4, 3);
  p.background.quads(4, 3) = static_cast<std::uint8_t>(quad & ~kQuadUpperFace);
  REQUIRE(check_background(p.background.view(), p.state.cview(), r).ok());
  CHECK(r.missing_faces == 1);
  p.background.quads(4, 3) = quad;
  p.background.vertices(4, 3) = {};  // its quads claim faces on it
  REQUIRE(check_background(p.background.view(), p.state.cview(), r).ok());
  CHECK(r.uncovered_pixels == 1);
  CHECK(r.stray_faces == 6);    // flat: all cuts run from upper left, and six of the eight faces around it use it
  CHECK(r.missing_faces == 2);  // the two quads that are cut through it could have one without it
  CHECK(!r.whole());
}

TEST_CASE("an object is whole: all its pixels, and no face to another") {
  Picture p({12, 8});
  p.rectangle(2, 2, 5, 5, label::car, 4.0F);
  p.rectangle(6, 2, 9, 5, label::truck, 6.0F);
  p.run();
  std::vector<unsigned char> bytes(check_foreground_workspace_bytes(p.shape));
  const auto check_objects = [&] {
    Workspace workspace(bytes.data(), bytes.size());
    LayerReport r;
    REQUIRE(check_foreground(p.foreground.view(), p.object.cview(), workspace, r).ok());
    return r;
  };
  CHECK(check_objects().whole());
  CHECK(check_objects().covered_pixels == 32);
  CHECK(check_objects().faces == 2 * 2 * 9);
  p.foreground.quads(5, 3) = kQuadUpperFace | kQuadLowerFace;  // joins car and truck
  CHECK(check_objects().stray_faces == 2);
  p.foreground.quads(5, 3) = 0;
  p.foreground.quads(3, 3) = 0;
  CHECK(check_objects().missing_faces == 2);
  for (int y = 2; y <= 5; ++y) {
    for (int x = 2; x <= 5; ++x) p.foreground.vertices(x, y) = {};
  }
  for (int y = 0; y < 7; ++y) {
    for (int x = 0; x < 6; ++x) p.foreground.quads(x, y) = 0;
  }
  CHECK(check_objects().whole());  // an object without any depth leaves nothing to go by
  CHECK(check_objects().unanchored_pixels == 16);
  Workspace none;
  LayerReport r;
  CHECK(check_foreground(p.foreground.view(), p.object.cview(), none, r).code() == StatusCode::workspace_exhausted);
  CHECK(check_background(p.background.view(), {}, r).code() == StatusCode::shape_mismatch);
}
