// SPDX-License-Identifier: Apache-2.0
// Two structures as one scene, against all their faces in one tree.
#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "npsim/core/random.hpp"
#include "npsim/trace/scene.hpp"
#include "trace_tree.hpp"

namespace {

using namespace npsim;
using Tree = npsim_test::Tree<>;

// Faces of a tree of which the first `count` are one scene and the others another. A Bvh does not know how many numbers
// its faces take.
struct Counted {
  Bvh bvh;
  std::uint32_t count = 0;
};
[[nodiscard]] bool is_empty(const Counted& c) { return npsim::is_empty(c.bvh); }
[[nodiscard]] std::uint32_t face_count(const Counted& c) { return c.count; }
[[nodiscard]] bool closest_hit(const Counted& c, const Ray& ray, Hit& hit) {
  return npsim::closest_hit(c.bvh, ray, hit);
}
template <class Accept>
[[nodiscard]] bool occluded(const Counted& c, const Ray& ray, Accept&& accept) {
  return npsim::occluded(c.bvh, ray, accept);
}
void closest_hits(const Counted& c, Span<const Ray> rays, Span<Hit> hits, Span<const std::uint8_t> active = {}) {
  npsim::closest_hits(c.bvh, rays, hits, active);
}
template <class Accept>
void occluded(const Counted& c, Span<const Ray> rays, Accept&& accept, Span<std::uint8_t> blocked,
              Span<const std::uint8_t> active = {}) {
  npsim::occluded(c.bvh, rays, accept, blocked, active);
}

struct Soup {
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  [[nodiscard]] TriangleMeshView view(std::size_t first, std::size_t count) const {
    return {{vertices.data(), vertices.size()}, Span<const Face>(faces.data(), faces.size()).sub(first, count)};
  }
};

Soup random_soup(std::uint32_t n) {
  Soup soup;
  RandomStream r(1, RandomPurpose::test, 0, 0, 0, 0);
  for (std::uint32_t i = 0; i < n; ++i) {
    const Vec3f at{r.uniform(-4, 4), r.uniform(-4, 4), r.uniform(2, 10)};
    for (int k = 0; k < 3; ++k) {
      soup.vertices.push_back(at + Vec3f{r.uniform(-1, 1), r.uniform(-1, 1), r.uniform(-1, 1)});
    }
    soup.faces.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  // The same triangles again: of equal t the first part's lower face must win.
  for (std::uint32_t i = 0; i < n; i += 3) soup.faces.push_back(soup.faces[i]);
  return soup;
}

std::vector<Ray> random_rays(std::uint32_t n) {
  std::vector<Ray> rays;
  RandomStream r(2, RandomPurpose::test, 0, 0, 0, 0);
  for (std::uint32_t i = 0; i < n; ++i) {
    Ray ray;
    ray.origin = {r.uniform(-5, 5), r.uniform(-5, 5), r.uniform(0, 12)};
    ray.direction = Vec3f{r.uniform(-4, 4), r.uniform(-4, 4), r.uniform(2, 10)} - ray.origin;
    if (i % 3 == 0) ray.t_max = r.uniform(0.1F, 1.0F);
    rays.push_back(ray);
  }
  return rays;
}

}  // namespace

TEST_CASE("joined scene: hits, ties and shadows are those of all faces in one tree, also with an empty part") {
  const Soup soup = random_soup(90);
  const std::size_t all = soup.faces.size();
  const std::vector<Ray> rays = random_rays(3000);
  const Tree whole(soup.view(0, all));
  for (const std::size_t first : {std::size_t{90}, std::size_t{40}, std::size_t{0}, all}) {
    const Tree a(soup.view(0, first));
    const Tree b(soup.view(first, all - first));
    const JoinedScene<Counted, Bvh> scene{{a.bvh, static_cast<std::uint32_t>(first)}, b.bvh};
    CHECK_FALSE(is_empty(scene));
    const auto odd = [](std::uint32_t face) noexcept { return face % 2 == 1; };
    std::vector<std::uint8_t> blocked(rays.size(), 7);
    occluded(scene, Span<const Ray>(rays.data(), rays.size()), odd, Span<std::uint8_t>(blocked.data(), blocked.size()));
    std::vector<Hit> together(rays.size());
    closest_hits(scene, Span<const Ray>(rays.data(), rays.size()), Span<Hit>(together.data(), together.size()));
    std::size_t hits = 0;
    std::size_t shadows = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      Hit expected;
      Hit hit;
      const bool any = closest_hit(whole.bvh, rays[i], expected);
      REQUIRE(closest_hit(scene, rays[i], hit) == any);
      REQUIRE((together[i].face != kNoFace) == any);
      if (any) {
        ++hits;
        CHECK(hit.face == expected.face);
        CHECK(hit.t == expected.t);
        CHECK(hit.u == expected.u);
        CHECK(hit.v == expected.v);
        CHECK(together[i].face == expected.face);
        CHECK(together[i].t == expected.t);
      }
      const bool shadow = occluded(whole.bvh, rays[i], odd);
      shadows += shadow ? 1U : 0U;
      CHECK(occluded(scene, rays[i], odd) == shadow);
      CHECK(blocked[i] == (shadow ? 1 : 0));
    }
    CHECK(hits > 500);
    CHECK(shadows > 250);
  }
}

TEST_CASE("joined scene: rays that a mask leaves out keep their answers and do not change the others'") {
  const Soup soup = random_soup(90);
  const std::size_t all = soup.faces.size();
  const std::vector<Ray> rays = random_rays(700);
  const Span<const Ray> asked(rays.data(), rays.size());
  const auto odd = [](std::uint32_t face) noexcept { return face % 2 == 1; };
  std::vector<std::uint8_t> active(rays.size());
  RandomStream r(3, RandomPurpose::test, 0, 0, 0, 0);
  for (std::uint8_t& a : active) a = static_cast<std::uint8_t>(r.next_u32() % 3U);
  for (const std::size_t first : {std::size_t{40}, std::size_t{0}, all}) {
    const Tree a(soup.view(0, first));
    const Tree b(soup.view(first, all - first));
    const JoinedScene<Counted, Bvh> scene{{a.bvh, static_cast<std::uint32_t>(first)}, b.bvh};
    Hit untouched;
    untouched.t = -7.0F;
    untouched.face = 12345;
    std::vector<Hit> hits(rays.size(), untouched);
    std::vector<std::uint8_t> blocked(rays.size(), 9);
    const Span<const std::uint8_t> mask(active.data(), active.size());
    closest_hits(scene, asked, Span<Hit>(hits.data(), hits.size()), mask);
    occluded(scene, asked, odd, Span<std::uint8_t>(blocked.data(), blocked.size()), mask);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      CAPTURE(i);
      Hit expected = untouched;
      if (active[i] != 0) {
        expected = Hit{};
        static_cast<void>(closest_hit(scene, rays[i], expected));
      }
      REQUIRE(hits[i].face == expected.face);
      if (expected.face != kNoFace) REQUIRE(hits[i].t == expected.t);
      REQUIRE(blocked[i] == (active[i] == 0 ? 9 : occluded(scene, rays[i], odd) ? 1 : 0));
    }
  }
}

TEST_CASE("joined scene: two empty parts are never hit") {
  const JoinedScene<SheetScene, Bvh> scene{};
  CHECK(is_empty(scene));
  Ray ray;
  ray.direction = {0, 0, 1};
  Hit hit;
  CHECK_FALSE(closest_hit(scene, ray, hit));
  const auto all = [](std::uint32_t) noexcept { return true; };
  CHECK_FALSE(occluded(scene, ray, all));
  std::uint8_t blocked[1] = {9};
  occluded(scene, Span<const Ray>(&ray, 1), all, Span<std::uint8_t>(blocked));
  CHECK(blocked[0] == 0);
}
