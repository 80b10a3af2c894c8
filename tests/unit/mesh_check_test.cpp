// SPDX-License-Identifier: Apache-2.0
#include "npsim/mesh/check.hpp"

#include "mesh_fixture.hpp"

using namespace mesh_test;

namespace {

MeshReport check(const std::vector<Vec3f>& v, const std::vector<Face>& f) {
  return report({{v.data(), v.size()}, {f.data(), f.size()}});
}

const std::vector<Vec3f> kTetrahedron = {{0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {0, 0, 2}};
const std::vector<Face> kClosed = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};

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
