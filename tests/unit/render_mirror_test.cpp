// SPDX-License-Identifier: Apache-2.0
// What a wet street mirrors, against its own invariants: energy, geometry, the same bits for any order.
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/observe.hpp"
#include "npsim/material/roughness.hpp"
#include "npsim/render/mirror.hpp"
#include "npsim/trace/bvh.hpp"

namespace {

using namespace npsim;

constexpr float kF0 = 0.04F;

// Points of a level wet road, 1.4 m below the camera, and perhaps a wall across it 30 m ahead, lit from somewhere.
struct Street {
  std::vector<Vec3f> position, normal, albedo;
  std::vector<float> alpha, lift;
  std::vector<std::uint8_t> film;
  std::vector<Face> faces;
  std::vector<unsigned char> memory;
  Bvh bvh;
  std::vector<std::uint32_t> pixel, point, hits;
  std::vector<float> weight;
  std::vector<Vec3f> sky;

  void add(Vec3f p, Vec3f n, float a, std::uint8_t water) {
    position.push_back(p);
    normal.push_back(n);
    albedo.push_back({a, a, a});
    alpha.push_back(0.12F);
    lift.push_back(0.001F);
    film.push_back(water);
  }
  explicit Street(bool wall) {
    for (int i = 0; i < 40; ++i) add({0, 1.4F, 4.0F + 0.5F * static_cast<float>(i)}, {0, -1, 0}, 0.06F, 255);
    for (std::uint32_t i = 0; i < 40; ++i) {
      pixel.push_back(i);
      point.push_back(i);
    }
    const float top = wall ? -200.0F : 100.0F;  // below the road, where no ray leads
    const float foot = wall ? 1.4F : 101.0F;
    add({-200, top, 30}, {0, 0, -1}, 0.5F, 0);
    add({200, top, 30}, {0, 0, -1}, 0.5F, 0);
    add({200, foot, 30}, {0, 0, -1}, 0.5F, 0);
    add({-200, foot, 30}, {0, 0, -1}, 0.5F, 0);
    faces = {{40, 41, 42}, {40, 42, 43}};
    memory.resize(bvh_workspace_bytes(faces.size()));
    Workspace workspace(memory.data(), memory.size());
    REQUIRE(build_bvh({{position.data(), position.size()}, {faces.data(), faces.size()}}, workspace, bvh).ok());
  }
  [[nodiscard]] SurfacePoints points() const {
    SurfacePoints p{{position.data(), position.size()}, {normal.data(), normal.size()}, {albedo.data(), albedo.size()},
                    {alpha.data(), alpha.size()},       {lift.data(), lift.size()},     {},
                    {film.data(), film.size()}};
    return p;
  }
  template <class Executor>
  Mirrors trace(int rays, const SkyParams& of_sky, Executor executor) {
    hits.assign(pixel.size() * static_cast<std::size_t>(rays), 7);
    weight.assign(pixel.size(), 9);
    sky.assign(pixel.size(), {});
    const Mirrors mirrors{rays,
                          {pixel.data(), pixel.size()},
                          {point.data(), point.size()},
                          {hits.data(), hits.size()},
                          {weight.data(), weight.size()},
                          {sky.data(), sky.size()}};
    NullObserver observer;
    MirrorParams params;
    params.rays = rays;
    REQUIRE(trace_mirror_rays(
                params, 3, kF0, bvh, [](const Hit&) { return 40U; }, points(), of_sky, mirrors, executor, observer)
                .ok());
    return mirrors;
  }
  [[nodiscard]] float share(std::size_t i) const {
    const Vec3f wo = normalized(-position[i]);
    return SpecularAlbedo(alpha[i], film_f0(kF0, film[i]))(dot(normal[i], wo));
  }
};

[[nodiscard]] SkyParams uniform_sky(float cd_m2) {
  SkyParams sky;
  sky.zenith_cd_m2 = sky.horizon_cd_m2 = {cd_m2, cd_m2, cd_m2};
  return sky;
}

}  // namespace

TEST_CASE("mirror: under a uniform sky a wet road returns the interface's share of it and never more") {
  Street street(false);
  const Mirrors mirrors = street.trace(64, uniform_sky(2.0F), SerialExecutor{});
  for (std::size_t i = 0; i < 40; ++i) {
    const float got = mirrors.sky[i].x;
    CHECK(got == doctest::Approx(2.0F * street.share(i)).epsilon(1e-4));
    // With the white body below it: what the film lets out, 1 - E of it, and what it mirrors.
    CHECK(got + 2.0F * (1.0F - street.share(i)) <= 2.0F * 1.005F);
  }
  CHECK(street.share(39) > 2 * street.share(0));  // far away, where the view grazes
}

TEST_CASE("mirror: a lit wall stands upside down in the road, and as bright as it is") {
  Street street(true);
  const Mirrors mirrors = street.trace(256, uniform_sky(0.0F), SerialExecutor{});
  std::vector<float> exitance(street.position.size() * kLightLanes, 0.0F);
  for (std::size_t p = 0; p < street.position.size(); ++p) {
    exitance[p * kLightLanes] = 0.5F * 10.0F;
    exitance[p * kLightLanes + 1] = 0.5F * 20.0F;
  }
  for (std::size_t i = 0; i < 40; ++i) {
    float lanes[kLightLanes];
    mirrored_luminance(mirrors, i, {exitance.data(), exitance.size()}, lanes);
    const Vec2f got{lanes[0], lanes[1]};
    const float wall = 0.5F * 10.0F / 3.14159265F * street.share(i);
    // The wall fills the view of all rays but those that leave backwards or sideways.
    CHECK(got.x <= wall * 1.0001F);
    CHECK(got.x > 0.8F * wall);
    CHECK(got.y == doctest::Approx(2.0F * got.x).epsilon(1e-4));
  }
}

TEST_CASE("mirror: rays lie about the mirrored direction, closer the smoother the film") {
  RandomStream random(5, RandomPurpose::test, 0, 0, 0, 0);
  const Vec3f view = normalized(Vec3f{0.9F, 0, 0.3F});
  float last = 1.0F;
  for (const float alpha : {0.4F, 0.12F, 0.02F}) {
    float mean_cosine = 0;
    constexpr int kDraws = 4000;
    for (int i = 0; i < kDraws; ++i) {
      const Vec3f h = sample_visible_normal(view, alpha, random.uniform(), random.uniform());
      CHECK(length(h) == doctest::Approx(1).epsilon(1e-4));
      CHECK(h.z > 0);
      CHECK(dot(h, view) > -1e-4F);
      mean_cosine += dot(h * (2 * dot(view, h)) - view, Vec3f{-view.x, 0, view.z}) / kDraws;
    }
    CHECK(1.0F - mean_cosine < last);
    last = 1.0F - mean_cosine;
  }
  CHECK(last < 0.01F);
}

TEST_CASE("mirror: the same bits whatever the order of work") {
  Street one(true), other(true);
  one.trace(8, SkyParams{}, SerialExecutor{});
  other.trace(8, SkyParams{}, npsim_test::BackwardExecutor{});
  CHECK(one.hits == other.hits);
  CHECK(one.weight == other.weight);
  for (std::size_t i = 0; i < one.sky.size(); ++i) CHECK(one.sky[i] == other.sky[i]);
}

TEST_CASE("wet film: asphalt becomes darker and smooth, white stays white, houses and dry streets stay as they are") {
  const Shape shape{4, 1};
  npsim_test::Image<Label> labels(shape, {label::road, label::sidewalk, label::building, label::road});
  npsim_test::Image<Vec3f> albedo(shape, {Vec3f{0.1F, 0.1F, 0.1F}, Vec3f{1, 1, 1}, Vec3f{0.3F, 0.3F, 0.3F}, Vec3f{}});
  npsim_test::Image<float> alpha(shape, 0.85F);
  npsim_test::Image<std::uint8_t> film(shape, 9);
  SerialExecutor serial;
  WetFilmParams wet;
  REQUIRE(apply_wet_film(wet, labels.cview(), albedo.view(), alpha.view(), film.view(), serial).ok());
  CHECK(albedo(0, 0).x == 0.1F);
  CHECK(film(0, 0) == 0);
  wet.wetness = 1;
  REQUIRE(apply_wet_film(wet, labels.cview(), albedo.view(), alpha.view(), film.view(), serial).ok());
  CHECK(albedo(0, 0).x == doctest::Approx(0.1 / (1.33 * 1.33 * 0.9 + 0.1)));
  CHECK(albedo(1, 0).x == doctest::Approx(1));
  CHECK(albedo(2, 0).x == 0.3F);
  CHECK(albedo(3, 0).x == 0.0F);
  CHECK(alpha(0, 0) == doctest::Approx(0.12));
  CHECK(alpha(2, 0) == 0.85F);
  CHECK(film(0, 0) == 255);
  CHECK(film(2, 0) == 0);
  CHECK(film_f0(0.04F, 255) == doctest::Approx(0.0201).epsilon(0.01));
  wet.wetness = 2;
  CHECK_FALSE(apply_wet_film(wet, labels.cview(), albedo.view(), alpha.view(), film.view(), serial).ok());
}
