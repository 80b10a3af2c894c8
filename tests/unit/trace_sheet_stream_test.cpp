// SPDX-License-Identifier: Apache-2.0
// Streams of rays through sheets against the same rays one by one, to the bit.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "npsim/core/random.hpp"
#include "npsim/simd/detail/scalar.hpp"
#include "npsim/trace/sheet.hpp"
#include "reference/sheet_rays.hpp"

namespace {

using npsim::Hit;
using npsim::kNoFace;
using npsim::RandomStream;
using npsim::Ray;
using npsim::Shape;
using npsim::Span;
using npsim::Vec3f;
using npsim::reference::TracedSheet;
using Scalar = npsim::simd::scalar::F32;

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

RandomStream stream(std::uint32_t i) { return {6, npsim::RandomPurpose::test, 0, 0, i, 0}; }

// Layers of one camera: a ground that recedes, with boxes and holes; the second one lies behind.
struct Layers {
  std::vector<TracedSheet> sheets;
  std::vector<npsim::SheetTrace> traces;
  npsim::SheetScene scene;

  Layers(Shape shape, int count) {
    for (int l = 0; l < count; ++l) add(shape, l);
    REQUIRE(npsim::join_layers({traces.data(), traces.size()}, scene).ok());
  }

  void add(Shape shape, int l) {
    TracedSheet& sheet = sheets.emplace_back(shape);
    sheet.fill([&](int x, int y) {
      const float row = static_cast<float>(y) + 0.5F - 0.4F * static_cast<float>(shape.height);
      float z = row > 1 ? std::min(60.0F, 1.5F * static_cast<float>(shape.height) / row) : 60.0F;
      if ((x / 7) % 3 == 1 && y > shape.height / 4) z = std::min(z, 6.0F + 0.5F * static_cast<float>(x % 5));
      RandomStream r = stream(static_cast<std::uint32_t>(x + 1000 * y + 777777 * l));
      return z * (r.uniform(0.99F, 1.01F) + 0.3F * static_cast<float>(l));
    });
    for (std::size_t i = 0; i < sheet.quads.size(); ++i) {
      RandomStream r = stream(static_cast<std::uint32_t>(i) + 99);
      const std::uint32_t bits = r.next_u32();
      sheet.quads[i] = static_cast<std::uint8_t>(bits % 16U == 0 ? bits >> 8U & 7U : 6U | (bits >> 8U & 1U));
    }
    REQUIRE(sheet.build().ok());
    traces.push_back(sheet.trace);
  }
  [[nodiscard]] Vec3f vertex(std::uint32_t i) const { return sheets[0].vertices[i % sheets[0].vertices.size()]; }
};

Vec3f in_cube(RandomStream& r, float scale) {
  const float x = r.uniform(-scale, scale);
  const float y = r.uniform(-scale, scale);
  return {x, y, r.uniform(-scale, scale)};
}

// Camera rays, rays to one lamp, bounces, rays from far away, rays that are no rays, rays with limits.
std::vector<Ray> rays_of(const Layers& layers, std::size_t count) {
  std::vector<Ray> rays;
  const Vec3f lamp{0.3F, -2.0F, 9.0F};
  for (std::size_t i = 0; i < count; ++i) {
    RandomStream r = stream(static_cast<std::uint32_t>(500000 + i));
    const Vec3f v = layers.vertex(r.next_u32());
    const Vec3f w = layers.vertex(r.next_u32());
    Ray ray{{0, 0, 0}, v + in_cube(r, 0.01F * v.z)};
    switch (i % 12) {
      case 1:
      case 2:
      case 3: {
        ray = {v * 0.999F, lamp - v * 0.999F};
        ray.t_max = 1.0F;
        break;
      }
      case 4: ray = {v * 0.9999F, in_cube(r, 1.0F)}; break;
      case 5: ray = {v, w - v}; break;
      case 6:
        ray = {in_cube(r, 1000.0F), {}};
        ray.direction = v - ray.origin;
        break;
      case 7: ray = {in_cube(r, 20.0F), in_cube(r, 1.0F), 0.5F, 3.0F}; break;
      case 8: ray.direction.y = i % 24 < 12 ? kNan : kInf; break;
      case 9: ray.direction = {0, 0, 0}; break;
      case 10: ray.t_max = i % 24 < 12 ? kNan : 1.0F; break;
      case 11:
        ray = {in_cube(r, 1e7F), {}};
        ray.direction = v - ray.origin;
        break;
      default: break;
    }
    rays.push_back(ray);
  }
  return rays;
}

bool same(const Hit& a, const Hit& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

template <class F>
void compare(const npsim::SheetScene& scene, const std::vector<Ray>& rays) {
  const auto odd = [](std::uint32_t face) noexcept { return face % 8 != 3; };
  const std::size_t n = rays.size();
  // One more of each, which must stay as it is.
  std::vector<Hit> hits(n + 1);
  hits[n].t = 7.0F;
  std::vector<std::uint8_t> blocked(n + 1, 9);
  npsim::closest_hits<F>(scene, Span<const Ray>(rays.data(), n), Span<Hit>(hits.data(), n));
  npsim::occluded<F>(scene, Span<const Ray>(rays.data(), n), odd, Span<std::uint8_t>(blocked.data(), n));
  int wrong = 0;
  for (std::size_t i = 0; i < n; ++i) {
    Hit hit;
    static_cast<void>(npsim::closest_hit(scene, rays[i], hit));
    wrong += same(hit, hits[i]) ? 0 : 1;
    wrong += blocked[i] == (npsim::occluded(scene, rays[i], odd) ? 1 : 0) ? 0 : 1;
  }
  CHECK(wrong == 0);
  CHECK(hits[n].t == 7.0F);
  CHECK(blocked[n] == 9);
}

}  // namespace

TEST_CASE("trace stream: rays of all kinds together have the answers that they have alone, for any number of lanes") {
  for (const int count : {1, 2, 3}) {
    const Layers layers({150, 90}, count);
    const std::vector<Ray> rays = rays_of(layers, 6000);
    std::size_t hits = 0;
    std::size_t blocked = 0;
    for (const Ray& ray : rays) {
      Hit hit;
      hits += npsim::closest_hit(layers.scene, ray, hit) ? 1U : 0U;
      blocked += npsim::occluded(layers.scene, ray) ? 1U : 0U;
    }
    CHECK(hits > rays.size() / 4);
    CHECK(hits < rays.size() * 3 / 4);
    CHECK(blocked == hits);
    compare<npsim::simd::F32>(layers.scene, rays);
    compare<Scalar>(layers.scene, rays);
  }
}

TEST_CASE("trace stream: any number of rays, none among them") {
  const Layers layers({60, 40}, 2);
  for (std::size_t n = 0; n < 3 * npsim::kStreamRays; ++n) compare<npsim::simd::F32>(layers.scene, rays_of(layers, n));
}

TEST_CASE("trace stream: rays to one lamp in the order of the image") {
  const Layers layers({240, 136}, 2);
  std::vector<Ray> rays;
  for (const Vec3f lamp : {Vec3f{1.0F, -2.5F, 12.0F}, Vec3f{-2.0F, 0.5F, 7.0F}, Vec3f{0.0F, -1.0F, -3.0F}}) {
    for (const Vec3f& v : layers.sheets[0].vertices) {
      Ray ray{v * 0.999F, lamp - v * 0.999F};
      ray.t_max = 1.0F;
      rays.push_back(ray);
    }
  }
  compare<npsim::simd::F32>(layers.scene, rays);
}

TEST_CASE("trace stream: without layers, and where no layer has a face, nothing is hit") {
  std::vector<Ray> rays(40, Ray{{0, 0, 0}, {0, 0, 1}});
  compare<npsim::simd::F32>(npsim::SheetScene{}, rays);
  npsim::SheetTrace empty[2];
  npsim::SheetScene scene;
  scene.layers = Span<const npsim::SheetTrace>(empty, 2);
  compare<npsim::simd::F32>(scene, rays);
}
