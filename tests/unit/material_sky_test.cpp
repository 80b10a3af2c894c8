// SPDX-License-Identifier: Apache-2.0
// What the sky says of shadows on the ground: under clouds what is dark is no shadow of the sun.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "day_picture.hpp"
#include "npsim/core/random.hpp"
#include "npsim/material/albedo.hpp"

namespace {

using namespace npsim;

using npsim_test::encode;
using npsim_test::Picture;

constexpr Vec3f kCloud{0.7F, 0.7F, 0.72F};
constexpr Vec3f kBlue{0.12F, 0.19F, 0.32F};
constexpr int kKerb = 150;  // first column of the road

// Sky above houses above a pavement at the left, a road and a car on it. light(x, y): what multiplies grey ground.
template <class Light>
Picture street(Vec3f sky, const Light& light) {
  Picture p(480, 270);
  for (int y = 0; y < 270; ++y) {
    for (int x = 0; x < 480; ++x) {
      RandomStream r(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * 480 + x), 0);
      Label l = y < 100 ? label::sky : y < 135 ? label::building : x < kKerb ? label::sidewalk : label::road;
      if (x >= 330 && x < 420 && y >= 160 && y < 190) l = label::car;
      Vec3f seen = l == label::sky ? sky : Vec3f{0.1F, 0.1F, 0.1F};
      if (l == label::car) seen *= 0.3F;
      if (l == label::sidewalk || l == label::road) {
        seen = light(x, y) * ((l == label::road ? 0.05F : 0.075F) * (0.85F + 0.3F * r.uniform()));
      }
      p.labels[p.i(x, y)] = l;
      p.day[p.i(x, y)] = {encode(seen.x), encode(seen.y), encode(seen.z)};
    }
  }
  return p;
}

// Level ground in one light.
Vec3f one_light(int, int) { return {1, 1, 1}; }

// Of a cloudy day: the face of the kerb sees half the sky, the ground beneath a car hardly any; both are a bit bluer.
Vec3f of_clouds(int x, int y) {
  if (x >= kKerb - 8 && x < kKerb) return {0.19F, 0.2F, 0.22F};
  if (x >= 325 && x < 425 && y >= 190 && y < 198) return {0.1F, 0.105F, 0.12F};
  return {1, 1, 1};
}

// Of ground in one light, as `street` draws it.
bool dull(const Picture& p, bool with_labels = true, float contrast = 1.0F) {
  npsim_test::Scratch scratch(estimate_albedo_workspace_bytes({}, p.shape));
  SerialExecutor executor;
  daylight_detail::Picture working;
  working.set_contrast(contrast);
  const AlbedoScene scene = p.scene(with_labels);
  REQUIRE(daylight_detail::read_picture(scene, scratch.workspace(), working, executor).ok());
  std::vector<std::uint32_t> bins(kQuantileBins);
  const Span<std::uint32_t> histogram(bins.data(), bins.size());
  const auto road = [&](int x, int y) { return working.region(x, y) == daylight_detail::kRoad; };
  daylight_detail::LightMixture ground;
  ground.sun_y = plane_quantile(working.shape(), road, working.log_y, 0.5F, histogram);
  ground.sun_c = plane_quantile(working.shape(), road, working.colour, 0.5F, histogram);
  return daylight_detail::is_dull_sky({}, scene, working, ground, histogram);
}

// Whether the ground of `light` under `sky` shows sun and shadow.
template <class Light>
bool finds_shadow(Vec3f sky, const Light& light) {
  Picture p = street(sky, light);
  REQUIRE(p.run().ok());
  return p.report.shadow;
}

}  // namespace

TEST_CASE("the face of a kerb stays dark under clouds, where a blue sky makes it and what lies beneath a car shadows") {
  Picture cloudy = street(kCloud, of_clouds);
  REQUIRE(cloudy.run().ok());
  CHECK(!cloudy.report.shadow);
  CHECK(mean(cloudy, kKerb - 7, kKerb - 1, 200, 260) < 0.3 * mean(cloudy, 60, 120, 200, 260));
  CHECK(finds_shadow(kBlue, of_clouds));
}

TEST_CASE("half a pavement of dark stones is no shadow under clouds, however little of a road is seen") {
  const auto paving = [](int x, int y) { return x < kKerb && y > 200 ? Vec3f{0.22F, 0.23F, 0.25F} : Vec3f{1, 1, 1}; };
  for (const int size : {400, 12}) {
    CAPTURE(size);
    for (const bool clouds : {true, false}) {
      CAPTURE(clouds);
      Picture p = street(clouds ? kCloud : kBlue, paving);
      for (int y = 135; y < 270; ++y) {
        for (int x = kKerb; x < 480; ++x) {
          if (x >= kKerb + size || y >= 135 + size) p.labels[p.i(x, y)] = label::building;
        }
      }
      REQUIRE(p.run().ok());
      CHECK(p.report.shadow != clouds);
    }
  }
}

TEST_CASE("under clouds half a road is in the shade by its drop and by how blue it is, together") {
  const auto half = [](Vec3f light) { return [=](int x, int) { return x < 300 ? light : Vec3f{1, 1, 1}; }; };
  const auto darker = half({0.34F, 0.357F, 0.384F});  // 1.49 and .17
  CHECK(finds_shadow(kBlue, darker));
  CHECK(!finds_shadow(kCloud, darker));
  CHECK(finds_shadow(kCloud, half({0.31F, 0.365F, 0.43F})));  // 1.45 and .47
  CHECK(finds_shadow(kCloud, half({0.24F, 0.25F, 0.265F})));  // 2 and .14
}

TEST_CASE("under clouds a twentieth of the road is in the shade where it is as blue as no clouds make it") {
  const auto strip = [](Vec3f light) {
    return [=](int x, int y) { return x >= 240 && x < 264 && y > 150 ? light : Vec3f{1, 1, 1}; };
  };
  CHECK(!finds_shadow(kCloud, strip({0.2F, 0.215F, 0.24F})));
  CHECK(finds_shadow(kBlue, strip({0.2F, 0.215F, 0.24F})));
  CHECK(finds_shadow(kCloud, strip({0.13F, 0.155F, 0.21F})));
}

TEST_CASE("large deep shadows leave a road under white clouds, which say that there is no sun") {
  Picture p = street(kCloud, [](int x, int) { return x < 260 ? Vec3f{0.13F, 0.155F, 0.21F} : Vec3f{1, 1, 1}; });
  REQUIRE(p.run().ok());
  REQUIRE(p.report.shadow);
  CHECK(mean(p, 160, 250, 210, 260) / mean(p, 280, 420, 210, 260) == doctest::Approx(1.0).epsilon(0.1));
}

TEST_CASE("ground twice as bright and hardly yellower is no sun, even where no sky is seen; much yellower it is") {
  for (const float yellow : {1.12F, 1.25F}) {
    CAPTURE(yellow);
    const Vec3f pale{2.3F * yellow, 2.3F, 2.3F / yellow};
    Picture p = street(kBlue, [&](int, int y) { return y > 215 ? pale : Vec3f{1, 1, 1}; });
    for (Label& l : p.labels) l = l == label::sky ? label::building : l;
    REQUIRE(p.run().ok());
    CHECK(p.report.shadow == (yellow > 1.2F));
  }
}

TEST_CASE("the shade is found where edges fall by less than the lights differ but turn blue, as under trees") {
  // Beside its edge the shade is lighter than on the whole.
  const auto shade = [](Vec3f light) {
    return [=](int x, int) {
      const float lift = std::exp2(0.55F * clamp_to(1.0F - static_cast<float>(280 - x) / 40.0F, 0.0F, 1.0F));
      return x < 280 ? light * lift : Vec3f{1, 1, 1};
    };
  };
  CHECK(finds_shadow(kBlue, shade({0.19F, 0.215F, 0.26F})));
  CHECK(!finds_shadow(kBlue, shade({0.203F, 0.215F, 0.232F})));
}

TEST_CASE("a dull sky is as grey as the road and much brighter: not blue, clipped to white, tiny, dim or unlabelled") {
  CHECK(dull(street(kCloud, one_light)));
  CHECK(!dull(street(kCloud, one_light), false));
  CHECK(!dull(street(kBlue, one_light)));
  CHECK(!dull(street({0.5F, 0.6F, 0.75F}, one_light)));
  CHECK(!dull(street({1, 1, 1}, one_light)));
  CHECK(!dull(street({0.12F, 0.12F, 0.12F}, one_light)));
  // In the shade the road itself is blue.
  CHECK(!dull(street(kCloud, [](int, int) { return Vec3f{0.8F, 1.0F, 1.25F}; })));
  Picture roofed = street(kCloud, one_light);
  for (int y = 0; y < 100; ++y) {
    for (int x = 0; x < 480; ++x) roofed.labels[roofed.i(x, y)] = x < 4 && y < 4 ? label::sky : label::building;
  }
  CHECK(!dull(roofed));
}

TEST_CASE("roofs and leaves that mix with a sky clipped to white do not make it dull; a grey rest of it does") {
  Picture p = street({1, 1, 1}, one_light);
  const auto grey = [&](int x, int y) { p.day[p.i(x, y)] = {200, 200, 201}; };
  for (int x = 0; x < 480; ++x) grey(x, 99);
  for (int y = 10; y < 90; y += 20) {
    for (int x = 10; x < 470; x += 10) {
      p.labels[p.i(x, y)] = label::vegetation;
      for (int k = 0; k < 9; ++k) grey(x + k % 3 - 1, y + k / 3 - 1);
    }
  }
  CHECK(!dull(p));
  for (int y = 92; y < 99; ++y) {
    for (int x = 0; x < 480; ++x) grey(x, y);
  }
  CHECK(dull(p));
}

TEST_CASE("the sky is judged alike in a photograph that is reduced, and in one whose contrast was taken back") {
  const Picture small = street(kCloud, one_light);
  Picture large(1920, 1080);
  for (int y = 0; y < 1080; ++y) {
    for (int x = 0; x < 1920; ++x) {
      large.day[large.i(x, y)] = small.day[small.i(x / 4, y / 4)];
      large.labels[large.i(x, y)] = small.labels[small.i(x / 4, y / 4)];
    }
  }
  CHECK(dull(large));
  CHECK(dull(small, true, 0.5F));
  CHECK(!dull(street({0.56F, 0.7F, 0.8F}, one_light), true, 0.5F));
}
