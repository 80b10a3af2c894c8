// SPDX-License-Identifier: Apache-2.0
// A refitted tree answers like every face in turn, faces that come and go included.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

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
using npsim::testing::Tree;

template <unsigned W, unsigned P>
void compare(const npsim::WideBvh<W, P>& bvh, const ScanMesh& mesh, const ScanMesh& aim) {
  REQUIRE(npsim::check_bvh(bvh, mesh.faces.size()).ok());
  std::size_t wrong = 0;
  std::size_t hits = 0;
  for (std::uint32_t i = 0; i < 600; ++i) {
    const Ray ray = hard_ray(aim, i, 1.0F, {});
    Hit expected;
    Hit got;
    const bool met = scan(mesh, bvh.low, bvh.high, ray, expected);
    wrong += npsim::closest_hit(bvh, ray, got) != met || !same(expected, got) ? 1U : 0U;
    wrong += npsim::occluded(bvh, ray) != met ? 1U : 0U;
    hits += met ? 1U : 0U;
  }
  CHECK(wrong == 0);
  CHECK(hits > 100);
}

template <unsigned W, unsigned P>
void move_and_compare() {
  const ScanMesh before = soup(500, 0.2F, 1.0F, 41);
  Tree<W, P> tree(before);
  ScanMesh mesh = before;
  for (Vec3f& v : mesh.vertices) v = {v.x + 0.3F * v.y * v.y, 0.8F * v.y + 0.1F, v.z * v.z - 0.2F};
  REQUIRE(npsim::refit_bvh(mesh.view(), tree.bvh).ok());
  compare(tree.bvh, mesh, mesh);
  // Some faces become unusable, a stretch of them together, so that whole packs do.
  ScanMesh broken = mesh;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (std::size_t i = 0; i < broken.faces.size(); ++i) {
    if (i % 7 == 0) broken.vertices[broken.faces[i].b].y = nan;
    if (i % 7 == 1) broken.vertices[broken.faces[i].c] = broken.vertices[broken.faces[i].a];
  }
  for (std::size_t pack = 0; pack < tree.bvh.packs.size(); pack += 5) {
    for (const std::uint32_t face : tree.bvh.packs[pack].face) broken.vertices[broken.faces[face].a].x = 1e30F;
  }
  REQUIRE(npsim::refit_bvh(broken.view(), tree.bvh).ok());
  compare(tree.bvh, broken, mesh);
  // And come back.
  REQUIRE(npsim::refit_bvh(before.view(), tree.bvh).ok());
  compare(tree.bvh, before, before);
  const Tree<W, P> anew(before);
  CHECK(npsim::bvh_cost(tree.bvh) == doctest::Approx(npsim::bvh_cost(anew.bvh)).epsilon(1e-12));
}

}  // namespace

TEST_CASE("trace refit: moved vertices, faces that become unusable and come back") {
  move_and_compare<8, 8>();
  move_and_compare<4, 4>();
  move_and_compare<16, 16>();
}

TEST_CASE("trace refit: all faces unusable, then none") {
  const ScanMesh mesh = soup(40, 0.3F, 1.0F, 51);
  Tree<8, 8> tree(mesh);
  ScanMesh broken = mesh;
  for (Vec3f& v : broken.vertices) v.x = std::numeric_limits<float>::infinity();
  REQUIRE(npsim::refit_bvh(broken.view(), tree.bvh).ok());
  CHECK(npsim::check_bvh(tree.bvh, 40).ok());
  for (std::uint32_t i = 0; i < 200; ++i) CHECK_FALSE(npsim::occluded(tree.bvh, hard_ray(mesh, i, 1.0F, {})));
  REQUIRE(npsim::refit_bvh(mesh.view(), tree.bvh).ok());
  compare(tree.bvh, mesh, mesh);
}

TEST_CASE("trace refit: the cost tells that a tree fits worse") {
  ScanMesh mesh = soup(4000, 0.05F, 1.0F, 61);
  Tree<8, 8> tree(mesh);
  const double before = npsim::bvh_cost(tree.bvh);
  for (std::uint32_t i = 0; i < 4000; ++i) {  // every face jumps elsewhere
    RandomStream random = stream(80000 + i);
    const Vec3f by = in_cube(random, 1.0F);
    for (std::uint32_t k = 0; k < 3; ++k) mesh.vertices[3 * i + k] += by;
  }
  REQUIRE(npsim::refit_bvh(mesh.view(), tree.bvh).ok());
  CHECK(npsim::bvh_cost(tree.bvh) > 5.0 * before);
}

TEST_CASE("trace refit: a mesh without the faces or vertices of the tree is a status, and the tree stays") {
  const ScanMesh mesh = soup(100, 0.3F, 1.0F, 71);
  Tree<8, 8> tree(mesh);
  const std::vector<unsigned char> bytes = tree.bytes;
  ScanMesh fewer = mesh;
  fewer.faces.resize(99);
  CHECK(npsim::refit_bvh(fewer.view(), tree.bvh).code() == npsim::StatusCode::invalid_argument);
  fewer = mesh;
  fewer.vertices.resize(299);
  CHECK(npsim::refit_bvh(fewer.view(), tree.bvh).code() == npsim::StatusCode::invalid_argument);
  CHECK(bytes == tree.bytes);
  npsim::Bvh empty;
  CHECK(npsim::refit_bvh(mesh.view(), empty).ok());
}
