// SPDX-License-Identifier: Apache-2.0
// What the sky says of shadows on the ground: under clouds what is dark is no shadow of the sun.
#include <doctest/doctest.h>

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

// Of a cloudy day: the face of the kerb sees half the sky, the ground beneath a car hardly any; both are a bit bluer.
Vec3f of_clouds(int x, int y) {
  if (x >= kKerb - 8 && x < kKerb) return {0.19F, 0.2F, 0.22F};
  if (x >= 325 && x < 425 && y >= 190 && y < 198) return {0.1F, 0.105F, 0.12F};
  return {1, 1, 1};
}

double mean(const Picture& p, int x0, int x1, int y0, int y1) {
  double sum = 0;
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) sum += static_cast<double>(luminance(p.albedo[p.i(x, y)]));
  }
  return sum / ((x1 - x0) * (y1 - y0));
}

bool dull(const Picture& p, bool with_labels = true) {
  npsim_test::Scratch scratch(estimate_albedo_workspace_bytes({}, p.shape));
  SerialExecutor executor;
  daylight_detail::Picture working;
  working.set_contrast(1.0F);
  const AlbedoScene scene = p.scene(with_labels);
  REQUIRE(daylight_detail::read_picture(scene, scratch.workspace(), working, executor).ok());
  std::vector<std::uint32_t> histogram(kQuantileBins);
  return daylight_detail::is_dull_sky({}, scene, working, {histogram.data(), histogram.size()});
}

}  // namespace

TEST_CASE(
    "the face of a kerb and the ground beneath a car stay dark under clouds, where a blue sky makes them shadows") {
  Picture cloudy = street(kCloud, of_clouds);
  REQUIRE(cloudy.run().ok());
  CHECK(!cloudy.report.shadow);
  CHECK(mean(cloudy, kKerb - 7, kKerb - 1, 200, 260) < 0.3 * mean(cloudy, 60, 120, 200, 260));
  Picture sunny = street(kBlue, of_clouds);
  REQUIRE(sunny.run().ok());
  CHECK(sunny.report.shadow);
}

TEST_CASE("half a pavement of dark stones and half a road of darker asphalt are no shadows under clouds") {
  const auto paving = [](int x, int y) { return x < kKerb && y > 200 ? Vec3f{0.22F, 0.23F, 0.25F} : Vec3f{1, 1, 1}; };
  const auto asphalt = [](int x, int) { return x < 300 ? Vec3f{0.35F, 0.365F, 0.39F} : Vec3f{1, 1, 1}; };
  for (const bool clouds : {true, false}) {
    CAPTURE(clouds);
    Picture paved = street(clouds ? kCloud : kBlue, paving);
    REQUIRE(paved.run().ok());
    CHECK(paved.report.shadow != clouds);
    Picture two = street(clouds ? kCloud : kBlue, asphalt);
    REQUIRE(two.run().ok());
    CHECK(two.report.shadow != clouds);
  }
}

TEST_CASE("large deep shadows leave a road under white clouds, which say that there is no sun") {
  Picture p = street(kCloud, [](int x, int) { return x < 260 ? Vec3f{0.13F, 0.155F, 0.21F} : Vec3f{1, 1, 1}; });
  CHECK(dull(p));
  REQUIRE(p.run().ok());
  REQUIRE(p.report.shadow);
  CHECK(mean(p, 160, 250, 210, 260) / mean(p, 280, 420, 210, 260) == doctest::Approx(1.0).epsilon(0.1));
}

TEST_CASE("ground twice as bright and hardly yellower is no sun, even where no sky is seen; much yellower it is") {
  for (const float yellow : {1.06F, 1.25F}) {
    CAPTURE(yellow);
    const Vec3f pale{2.1F * yellow, 2.1F, 2.1F / yellow};
    Picture p = street(kBlue, [&](int, int y) { return y > 215 ? pale : Vec3f{1, 1, 1}; });
    for (Label& l : p.labels) l = l == label::sky ? label::building : l;
    REQUIRE(p.run().ok());
    CHECK(p.report.shadow == (yellow > 1.2F));
  }
}

TEST_CASE("a dull sky is as grey as the road and much brighter: not blue, clipped to white, tiny, dim or unlabelled") {
  const auto open = [](int, int) { return Vec3f{1, 1, 1}; };
  CHECK(dull(street(kCloud, open)));
  CHECK(!dull(street(kCloud, open), false));
  CHECK(!dull(street(kBlue, open)));
  CHECK(!dull(street({0.5F, 0.6F, 0.75F}, open)));
  CHECK(!dull(street({1, 1, 1}, open)));
  CHECK(!dull(street({0.12F, 0.12F, 0.12F}, open)));
  // In the shade the road itself is blue.
  CHECK(!dull(street(kCloud, [](int, int) { return Vec3f{0.8F, 1.0F, 1.25F}; })));
  Picture roofed = street(kCloud, open);
  for (std::size_t i = 0; i < roofed.labels.size(); ++i) {
    if (roofed.labels[i] == label::sky && i > 20) roofed.labels[i] = label::building;
  }
  CHECK(!dull(roofed));
}
