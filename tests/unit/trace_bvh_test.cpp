// SPDX-License-Identifier: Apache-2.0
// The tree against a double-precision brute force and against its own triangle test in a linear scan.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/random.hpp"
#include "npsim/trace/bvh.hpp"
#include "reference/triangle_scan.hpp"
#include "trace_tree.hpp"

namespace {

using npsim::Bvh;
using npsim::Face;
using npsim::Hit;
using npsim::RandomStream;
using npsim::Ray;
using npsim::Vec3d;
using npsim::Vec3f;
using npsim::reference::bits;
using npsim::reference::in_cube;
using npsim::reference::soup;
using npsim::reference::stream;
using Mesh = npsim::reference::ScanMesh;
using Tree = npsim_test::Tree<>;

using Pack = npsim::TrianglePack<npsim::kBvhPack>;
using Node = npsim::BvhNode<npsim::kBvhWidth>;

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// Every triangle of the tree in turn, in the order of the tree.
bool linear_scan(const Bvh& bvh, const Ray& ray, Hit& out) {
  npsim::RayFrame frame;
  if (bvh.nodes.empty() || !npsim::make_ray_frame(ray, bvh.low, bvh.high, frame)) return false;
  bool found = false;
  for (const Pack& pack : bvh.packs) {
    for (unsigned lane = 0; lane < npsim::kBvhPack; ++lane) {
      float vertex[3][3];
      npsim::triangle_of_lane(pack, lane, vertex);
      npsim::TriangleHit hit;
      if (!npsim::intersect_triangle(frame, vertex, hit) || !(hit.t < frame.t_max)) continue;
      if (!found || hit.t < out.t || (hit.t == out.t && pack.face[lane] < out.face)) {
        out = Hit{hit.t, pack.face[lane], hit.u, hit.v};
        found = true;
      }
    }
  }
  return found;
}

struct ExactHit {
  double t = 0;
  double margin = 0;  // smallest barycentric coordinate; negative outside
  double cosine = 0;
};

ExactHit exact_hit(const Mesh& mesh, std::size_t face, const Ray& ray) {
  const Vec3d o = npsim::vec_cast<double>(ray.origin);
  const Vec3d d = npsim::vec_cast<double>(ray.direction);
  const Vec3d a = npsim::vec_cast<double>(mesh.vertices[mesh.faces[face].a]);
  const Vec3d e1 = npsim::vec_cast<double>(mesh.vertices[mesh.faces[face].b]) - a;
  const Vec3d e2 = npsim::vec_cast<double>(mesh.vertices[mesh.faces[face].c]) - a;
  const Vec3d n = cross(e1, e2);
  const double det = dot(n, d);
  const Vec3d q = cross(d, o - a);
  const double u = dot(e2, q) / det;
  const double v = -dot(e1, q) / det;
  return {dot(n, a - o) / det, std::min({u, v, 1 - u - v}), std::fabs(det) / (length(n) * length(d))};
}

int depth_of(const Bvh& bvh) {
  std::vector<std::pair<std::uint32_t, int>> stack{{0U, 0}};
  int deepest = 0;
  while (!stack.empty()) {
    const auto [node, depth] = stack.back();
    stack.pop_back();
    deepest = std::max(deepest, depth);
    if ((node & npsim::kBvhLeaf) != 0) continue;
    for (unsigned i = 0; i < bvh.nodes[node].count; ++i) stack.push_back({bvh.nodes[node].child[i], depth + 1});
  }
  return deepest;
}

// How often each face is in the tree; lanes that repeat another do not count.
std::vector<int> times_in_tree(const Bvh& bvh, std::size_t faces) {
  std::vector<int> times(faces, 0);
  for (const Pack& pack : bvh.packs) {
    for (unsigned lane = 0; lane < npsim::kBvhPack; ++lane) {
      if (lane == 0 || pack.face[lane] != pack.face[0]) ++times[pack.face[lane]];
    }
  }
  return times;
}

int faces_in_tree(const Bvh& bvh, std::size_t faces) {
  const std::vector<int> times = times_in_tree(bvh, faces);
  CHECK(*std::max_element(times.begin(), times.end()) <= 1);
  return static_cast<int>(std::count(times.begin(), times.end(), 1));
}

}  // namespace

TEST_CASE("trace: random soups agree with a double-precision brute force at every scale") {
  std::size_t hits = 0;
  double worst = 0;
  for (const float scale : {1e-4F, 1.0F, 1e4F}) {
    for (const float size : {0.02F, 0.3F}) {
      const Mesh mesh = soup(400, size, scale, 1000);
      const Tree tree(mesh);
      for (std::uint32_t i = 0; i < 1500; ++i) {
        RandomStream random = stream(900000 + i);
        const Ray ray{in_cube(random, 2 * scale), in_cube(random, 1.0F)};
        double nearest = std::numeric_limits<double>::infinity();
        double cosine = 1;
        std::size_t face = npsim::kNoFace;
        double ambiguous = std::numeric_limits<double>::infinity();
        for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
          const ExactHit exact = exact_hit(mesh, f, ray);
          if (!(exact.t > 0)) continue;
          // Within rounding of an edge, or seen edge-on, either answer is right.
          if (std::fabs(exact.margin) < 1e-4 || exact.cosine < 1e-3) {
            ambiguous = std::min(ambiguous, exact.t);
          } else if (exact.margin > 0 && exact.t < nearest) {
            nearest = exact.t;
            cosine = exact.cosine;
            face = f;
          }
        }
        if (ambiguous < nearest * (1 + 1e-3)) continue;
        Hit hit;
        const bool found = npsim::closest_hit(tree.bvh, ray, hit);
        REQUIRE(found == (face != npsim::kNoFace));
        CHECK(npsim::occluded(tree.bvh, ray) == found);
        if (!found) continue;
        ++hits;
        CHECK(hit.face == face);
        const double length_d = length(npsim::vec_cast<double>(ray.direction));
        const double error = std::fabs(static_cast<double>(hit.t) - nearest) * length_d * cosine;
        const double reach = 3.3 * static_cast<double>(scale);  // of an origin in +-2 to a vertex in +-1.3
        worst = std::max(worst, error / (reach * 0x1p-24));
      }
    }
  }
  CHECK(hits > 500);
  CAPTURE(worst);
  CHECK(worst < 2.0);  // the bound in triangle.hpp
}

TEST_CASE("trace: the tree gives the bits of a linear scan, needles and grazing rays included") {
  Mesh mesh = soup(300, 0.2F, 1.0F, 5000);
  for (std::uint32_t i = 0; i < 200; ++i) {  // needles of aspect 1e5
    RandomStream random = stream(70000 + i);
    const Vec3f a = in_cube(random, 1.0F);
    const Vec3f b = in_cube(random, 1.0F);
    mesh.add(a, b, b + in_cube(random, 1e-5F));
  }
  for (std::uint32_t i = 0; i < 40; ++i) {  // stacked copies: ties
    mesh.faces.push_back(mesh.faces[i * 7]);
    mesh.faces.push_back({mesh.faces[i * 3].b, mesh.faces[i * 3].c, mesh.faces[i * 3].a});
  }
  const Tree tree(mesh);
  std::size_t hits = 0;
  for (std::uint32_t i = 0; i < 4000; ++i) {
    RandomStream random = stream(200000 + i);
    Ray ray{in_cube(random, 1.5F), in_cube(random, 1.0F)};
    const Vec3f vertex = mesh.vertices[random.next_u32() % mesh.vertices.size()];
    if (i % 4 == 1) ray.direction = vertex - ray.origin;                                // at a vertex
    if (i % 4 == 2) ray = {vertex, mesh.vertices[i % mesh.vertices.size()] - vertex};   // from one to another
    if (i % 4 == 3) ray.direction = {0, i % 8 == 3 ? 1e-40F : -0.0F, ray.direction.z};  // along an axis
    if (i % 16 == 3) ray.origin = vertex;
    if (i % 5 == 0) ray.t_max = random.uniform(0.1F, 2.0F);
    if (i % 7 == 0) ray.t_min = random.uniform(0.0F, 1.0F);
    Hit expected;
    Hit got;
    const bool expected_found = linear_scan(tree.bvh, ray, expected);
    REQUIRE(npsim::closest_hit(tree.bvh, ray, got) == expected_found);
    CHECK(npsim::occluded(tree.bvh, ray) == expected_found);
    if (!expected_found) continue;
    ++hits;
    CHECK(got.face == expected.face);
    CHECK(bits(got.t) == bits(expected.t));
    CHECK(bits(got.u) == bits(expected.u));
    CHECK(bits(got.v) == bits(expected.v));
    CHECK(got.t > ray.t_min);
    CHECK(got.t < ray.t_max);
  }
  CHECK(hits > 1000);
}

TEST_CASE("trace: permuted faces give the same hits, ties included, after renaming") {
  Mesh mesh = soup(500, 0.3F, 1.0F, 31);
  Mesh reversed = mesh;
  std::reverse(reversed.faces.begin(), reversed.faces.end());
  const Tree tree(mesh);
  const Tree other(reversed);
  for (std::uint32_t i = 0; i < 1000; ++i) {
    RandomStream random = stream(i);
    const Ray ray{in_cube(random, 1.5F), in_cube(random, 1.0F)};
    Hit a;
    Hit b;
    const bool found = npsim::closest_hit(tree.bvh, ray, a);
    REQUIRE(npsim::closest_hit(other.bvh, ray, b) == found);
    if (!found) continue;
    CHECK(a.face == 499 - b.face);
    CHECK(bits(a.t) == bits(b.t));
  }
}

TEST_CASE("trace: twenty thousand identical triangles: bounded depth, lowest face wins") {
  Mesh mesh;
  mesh.vertices = {{-1, -1, 2}, {1, -1, 2}, {0, 1, 2}};
  mesh.faces.assign(20000, Face{0, 1, 2});
  const Tree tree(mesh);
  CHECK(faces_in_tree(tree.bvh, 20000) == 20000);
  CHECK(depth_of(tree.bvh) <= 5);  // 8^4 packs and more
  Hit hit;
  REQUIRE(npsim::closest_hit(tree.bvh, Ray{{0, 0, 0}, {0, 0, 1}}, hit));
  CHECK(hit.face == 0);
  CHECK(hit.t == 2.0F);
  CHECK_FALSE(npsim::occluded(tree.bvh, Ray{{0, 0, 0}, {0, 0, 1}}, [](std::uint32_t) { return false; }));
  CHECK(npsim::occluded(tree.bvh, Ray{{0, 0, 0}, {0, 0, 1}}, [](std::uint32_t f) { return f == 12345; }));
}

TEST_CASE("trace: sizes in geometric progression keep the depth below the bound") {
  Mesh mesh;
  float size = 0x1p59F;
  for (int i = 0; i < 200; ++i, size *= 0.5F) {
    for (int k = 0; k < 4; ++k) mesh.add({size, 0, size}, {size, size, size}, {size, 0, 2 * size});
  }
  const Tree tree(mesh);
  CHECK(faces_in_tree(tree.bvh, 800) == 800);
  CHECK(depth_of(tree.bvh) <= npsim::kBvhMaxDepth);
}

TEST_CASE("trace: near the depth bound a lopsided split is replaced by halves, and so it is without packs to spare") {
  std::vector<npsim::BvhPrimitive> primitives;  // 127 close together and one far away
  for (std::uint32_t i = 0; i < 128; ++i) {
    const float x = i == 5 ? 1000.0F : 0.01F * static_cast<float>(i);
    primitives.push_back({});
    npsim::bvh_detail::write_primitive({{x, 0, 0}, {x + 0.01F, 0, 0}, {x, 0.01F, 0}}, i, primitives.back());
  }
  const npsim::Span<npsim::BvhPrimitive> all(primitives.data(), primitives.size());
  npsim::bvh_detail::BvhSet set;
  set.count = 128;
  npsim::bvh_detail::measure(all, set);
  npsim::bvh_detail::BvhSet left;
  npsim::bvh_detail::BvhSet right;
  set.budget = 17;
  set.depth = 59;
  npsim::bvh_detail::divide<8>(all, set, left, right);
  CHECK(left.count == 127);  // 60 + ceil(log2 16) == 64
  CHECK(left.budget + right.budget == 17);
  set.depth = 60;
  npsim::bvh_detail::divide<8>(all, set, left, right);
  CHECK(left.count == 64);
  set.depth = 0;
  set.budget = 16;
  npsim::bvh_detail::divide<8>(all, set, left, right);
  CHECK(left.count == 64);
  CHECK(left.budget == 8);
  CHECK(right.budget == 8);
}

TEST_CASE("trace: every box holds its triangles and every usable face is in exactly one leaf") {
  const Mesh mesh = soup(3000, 0.1F, 5.0F, 77);
  const Tree tree(mesh);
  CHECK(faces_in_tree(tree.bvh, 3000) == 3000);
  CHECK(tree.bvh.packs.size() <= npsim::bvh_max_packs<npsim::kBvhPack>(3000));
  CHECK((tree.bvh.nodes.size() <= npsim::bvh_max_nodes<npsim::kBvhWidth, npsim::kBvhPack>(3000)));
  for (const Node& node : tree.bvh.nodes) {
    REQUIRE(node.count >= 2);
    REQUIRE(node.count <= npsim::kBvhWidth);
    for (unsigned i = 0; i < node.count; ++i) {
      const std::uint32_t child = node.child[i] & ~npsim::kBvhLeaf;
      for (unsigned k = 0; k < 3; ++k) {
        float low = kInf;
        float high = -kInf;
        if (child == node.child[i]) {
          const Node& below = tree.bvh.nodes[child];
          for (unsigned j = 0; j < below.count; ++j) {
            low = std::min(low, below.bound[k][j]);
            high = std::max(high, below.bound[k + 3][j]);
          }
        } else {
          for (unsigned lane = 0; lane < npsim::kBvhPack; ++lane) {
            for (unsigned corner = 0; corner < 3; ++corner) {
              low = std::min(low, tree.bvh.packs[child].vertex[corner][k][lane]);
              high = std::max(high, tree.bvh.packs[child].vertex[corner][k][lane]);
            }
          }
        }
        CHECK(node.bound[k][i] == low);
        CHECK(node.bound[k + 3][i] == high);
      }
    }
  }
}

TEST_CASE("trace: empty mesh, one face, and a mesh of unusable faces") {
  Hit hit;
  const Ray ray{{0, 0, 0}, {0, 0, 1}};
  const Tree empty{Mesh{}};
  CHECK_FALSE(npsim::closest_hit(empty.bvh, ray, hit));
  CHECK_FALSE(npsim::occluded(empty.bvh, ray));
  CHECK_FALSE(npsim::occluded(Bvh{}, ray));

  Mesh one;
  one.add({-1, -1, 4}, {3, -1, 4}, {-1, 3, 4});
  const Tree single(one);
  REQUIRE(npsim::closest_hit(single.bvh, ray, hit));
  CHECK(hit.face == 0);
  CHECK(hit.t == 4.0F);
  CHECK(hit.u == doctest::Approx(0.25));
  CHECK(hit.v == doctest::Approx(0.25));
  CHECK_FALSE(npsim::closest_hit(single.bvh, Ray{{0, 0, 0}, {0, 0, -1}}, hit));

  Mesh bad;
  bad.add({-1, -1, 4}, {kNan, -1, 4}, {-1, 3, 4});
  bad.add({-1, -1, 4}, {kInf, -1, 4}, {-1, 3, 4});
  bad.add({-1, -1, 4}, {3e38F, -1, 4}, {-1, 3, 4});
  bad.add({-1, -1, 4}, {-1, -1, 4}, {-1, 3, 4});
  bad.add({-1, -1, 4}, {0, 0, 4}, {1, 1, 4});
  const Tree unusable(bad);
  CHECK(unusable.bvh.packs.empty());
  CHECK_FALSE(npsim::closest_hit(unusable.bvh, ray, hit));
  bad.add({-1, -1, 4}, {3, -1, 4}, {-1, 3, 4});
  const Tree mixed(bad);
  CHECK(faces_in_tree(mixed.bvh, 6) == 1);
  REQUIRE(npsim::closest_hit(mixed.bvh, ray, hit));
  CHECK(hit.face == 5);
}

TEST_CASE("trace: a face that names a missing vertex, and a workspace one byte short, are a status") {
  Mesh mesh;
  mesh.add({-1, -1, 4}, {3, -1, 4}, {-1, 3, 4});
  Bvh bvh;
  npsim_test::Scratch small(npsim::bvh_workspace_bytes(1) - npsim::kWorkspaceAlignment - 1);
  CHECK(npsim::build_bvh(mesh.view(), small.workspace(), bvh).code() == npsim::StatusCode::workspace_exhausted);
  CHECK(bvh.nodes.empty());
  mesh.faces[0].c = 3;
  npsim_test::Scratch memory(npsim::bvh_workspace_bytes(1));
  CHECK(npsim::build_bvh(mesh.view(), memory.workspace(), bvh).code() == npsim::StatusCode::invalid_argument);
}

TEST_CASE("trace: rays without a direction or with NaN hit nothing") {
  Mesh mesh;
  mesh.add({-1, -1, 4}, {3, -1, 4}, {-1, 3, 4});
  const Tree tree(mesh);
  const Vec3f o{0, 0, 0};
  const Vec3f d{0, 0, 1};
  const Ray bad[] = {{o, {0, 0, 0}},           {o, {kNan, 0, 1}},  {o, {0, kNan, 1}},  {o, {0, 0, kNan}},
                     {o, {0, 0, kInf}},        {o, {-kInf, 0, 1}}, {{kNan, 0, 0}, d},  {{0, kNan, 0}, d},
                     {{0, 0, kNan}, d},        {{0, 0, -kInf}, d}, {o, d, kNan, kInf}, {o, d, 0, kNan},
                     {o, {1e-40F, 0, 1e-40F}}, {o, d, 5, 3},       {o, d, kInf, kInf}, {o, d, 0, -1}};
  for (const Ray& ray : bad) {
    Hit hit;
    CHECK_FALSE(npsim::closest_hit(tree.bvh, ray, hit));
    CHECK_FALSE(npsim::occluded(tree.bvh, ray));
    CHECK(hit.face == npsim::kNoFace);
  }
}

TEST_CASE("trace: axis-aligned directions with both zeros and denormals") {
  Mesh mesh;  // a closed box
  const float l[2] = {-1, 1};
  for (int k = 0; k < 3; ++k) {
    for (const float side : l) {
      const auto at = [&](float u, float v) {
        return k == 0 ? Vec3f{side, u, v} : (k == 1 ? Vec3f{v, side, u} : Vec3f{u, v, side});
      };
      mesh.add(at(-1, -1), at(1, -1), at(1, 1));
      mesh.add(at(-1, -1), at(1, 1), at(-1, 1));
    }
  }
  const Tree tree(mesh);
  const float tiny[] = {0.0F, -0.0F, 1e-40F, -1e-40F, 1e-44F, 1e-30F, -1e-20F};
  for (const float p : tiny) {
    for (const float q : tiny) {
      for (const float main : {1.0F, -1.0F, 0x1p-90F, -0x1p90F}) {
        for (const Vec3f d : {Vec3f{main, p, q}, Vec3f{q, main, p}, Vec3f{p, q, main}}) {
          for (const Vec3f o : {Vec3f{0, 0, 0}, Vec3f{0.5F, -0.25F, 0.125F}, Vec3f{-1e-38F, 1e-44F, 0}}) {
            Hit hit;
            REQUIRE(npsim::closest_hit(tree.bvh, Ray{o, d}, hit));
            const Vec3f at = o + d * hit.t;
            CHECK(std::fmax(std::fabs(at.x), std::fmax(std::fabs(at.y), std::fabs(at.z))) ==
                  doctest::Approx(1.0).epsilon(1e-6));
          }
        }
      }
    }
  }
}

TEST_CASE("trace: a ray in the plane of a triangle misses it") {
  Mesh mesh;
  mesh.add({0, 0, 1}, {2, 0, 1}, {0, 2, 1});
  const Tree tree(mesh);
  Hit hit;
  CHECK_FALSE(npsim::closest_hit(tree.bvh, Ray{{-1, 0.5F, 1}, {1, 0, 0}}, hit));
  CHECK_FALSE(npsim::closest_hit(tree.bvh, Ray{{-1, 0, 1}, {1, 0, 0}}, hit));       // along its edge
  CHECK_FALSE(npsim::closest_hit(tree.bvh, Ray{{0.5F, 0.5F, 1}, {1, 1, 0}}, hit));  // from inside
  CHECK_FALSE(npsim::occluded(tree.bvh, Ray{{-1, 0.5F, 1}, {1, 0.25F, 0}}));
}

TEST_CASE("trace: the interval is open at both ends") {
  Mesh mesh;
  mesh.add({-1, -1, 4}, {3, -1, 4}, {-1, 3, 4});
  const Tree tree(mesh);
  const Vec3f o{0.25F, 0.5F, 1};
  const Vec3f d{0, 0, 2};
  const float t = 1.5F;
  const float below = std::nextafter(t, 0.0F);
  const float above = std::nextafter(t, 2.0F);
  CHECK(npsim::occluded(tree.bvh, Ray{o, d, 0, above}));
  CHECK_FALSE(npsim::occluded(tree.bvh, Ray{o, d, 0, t}));
  CHECK_FALSE(npsim::occluded(tree.bvh, Ray{o, d, 0, below}));
  CHECK(npsim::occluded(tree.bvh, Ray{o, d, below, kInf}));
  CHECK_FALSE(npsim::occluded(tree.bvh, Ray{o, d, t, kInf}));
  Hit hit;
  CHECK_FALSE(npsim::closest_hit(tree.bvh, Ray{o, d, 0, t}, hit));
  CHECK_FALSE(npsim::closest_hit(tree.bvh, Ray{o, d, t, kInf}, hit));
  CHECK(npsim::closest_hit(tree.bvh, Ray{o, d, -3, above}, hit));
  // From the surface itself nothing is met at t == 0.
  CHECK_FALSE(npsim::occluded(tree.bvh, Ray{{0.25F, 0.5F, 4}, {0.1F, 0.2F, 1}}));
}

TEST_CASE("trace: the triangle that is tried first never changes whether a ray is blocked") {
  RandomStream random = stream(77);
  Mesh mesh;
  for (int i = 0; i < 400; ++i) {
    const Vec3f a = in_cube(random, 1.0F);
    mesh.add(a, a + in_cube(random, 0.2F), a + in_cube(random, 0.2F));
  }
  const Tree tree(mesh);
  const auto even = [](std::uint32_t face) { return face % 2 == 0; };
  std::uint32_t likely = npsim::kNoFace;
  int blocked = 0;
  int kept = 0;
  Ray ray;
  for (int i = 0; i < 4000; ++i) {
    if (i % 2 == 0) ray = {in_cube(random, 1.5F), in_cube(random, 1.0F), 0.0F, 1.5F};
    if (i % 2 == 1) ray.direction = ray.direction + in_cube(random, 1e-3F);                   // a neighbour
    const std::uint32_t before = i % 7 == 0 ? static_cast<std::uint32_t>(i) * 977U : likely;  // also beyond the end
    likely = before;
    const bool found = npsim::occluded(tree.bvh, ray, even, likely);
    CHECK(found == npsim::occluded(tree.bvh, ray, even));
    blocked += found ? 1 : 0;
    kept += found && likely == before ? 1 : 0;
    if (!found) continue;
    const Pack& pack = tree.bvh.packs[likely];
    CHECK(std::any_of(pack.face, pack.face + npsim::kBvhPack, even));
  }
  CHECK(blocked > 200);
  CHECK(blocked < 3600);
  CHECK(kept > 100);
}

TEST_CASE("trace: an emitter's own faces can be made transparent") {
  Mesh mesh;
  mesh.add({-1, -1, 4}, {3, -1, 4}, {-1, 3, 4});
  mesh.add({-1, -1, 6}, {3, -1, 6}, {-1, 3, 6});
  const Tree tree(mesh);
  const Ray ray{{0, 0, 0}, {0, 0, 1}};
  CHECK_FALSE(npsim::occluded(tree.bvh, Ray{ray.origin, ray.direction, 0, 5}, [](auto f) { return f != 0; }));
  CHECK(npsim::occluded(tree.bvh, Ray{ray.origin, ray.direction, 0, 7}, [](auto f) { return f != 0; }));
  CHECK_FALSE(npsim::occluded(tree.bvh, ray, [](auto) { return false; }));
}
