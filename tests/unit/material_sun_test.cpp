// SPDX-License-Identifier: Apache-2.0
// The sun from walls and on things: its direction, shadows on facades, panes, days on which walls do not show it, and
// things that are seen against it.
#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "day_picture.hpp"
#include "fixture.hpp"
#include "npsim/core/random.hpp"

namespace {

using namespace npsim;
using npsim_test::encode;
using npsim_test::Picture;

struct Day {
  Vec3f sun{0.5F, -0.75F, -0.43F};  // behind the camera, to the right
  bool on_ground = true;            // shadow and sun on the road
  bool on_walls = true;
  float walls_seen = 1.0F;    // what a tone curve makes of walls
  bool sides = true;          // walls along the street, beside that across
  float shadow_below = 0.5F;  // of the height of the left wall
};

constexpr int kWidth = 480, kHeight = 270, kHorizon = 135;
constexpr Vec3f kSky{0.11F, 0.13F, 0.17F};  // light of the sky over that of sky and sun, on the ground

// A street between two rows of three houses, and a house across its end, with panes; the sun as given.
Picture canyon(const Day& day) {
  Picture p(kWidth, kHeight);
  p.normals.assign(p.shape.pixels(), Vec3f{0, -1, 0});
  const Vec3f sun = normalized(day.sun);
  constexpr float kPaint[3] = {0.55F, 0.25F, 0.4F};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      RandomStream r(5, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * kWidth + x), 0);
      const std::size_t i = p.i(x, y);
      Vec3f normal{0, -1, 0};
      float albedo = 0.1F;
      bool lit = x > 190;
      p.labels[i] = label::road;
      if (y < kHorizon) {
        p.labels[i] = y < 20 ? label::sky : label::building;
        normal = !day.sides || (x >= 150 && x < 330) ? Vec3f{0, 0, -1} : x < 150 ? Vec3f{1, 0, 0} : Vec3f{-1, 0, 0};
        const bool pane = x % 24 >= 8 && x % 24 < 16 && y % 26 >= 6 && y % 26 < 18;
        albedo = pane ? 0.03F : kPaint[(x / 50) % 3];
        lit = x >= 150 || static_cast<float>(kHorizon - y) > day.shadow_below * static_cast<float>(kHorizon);
      }
      const float cosine = std::fmax(0.0F, dot(normal, sun));
      const float upward = 0.5F - 0.5F * normal.y;
      const bool reached = lit && (y < kHorizon ? day.on_walls : true);
      const float direct = reached ? cosine / -sun.y : 0.0F;
      const auto light = [&](float sky) { return (1.0F - sky) * direct + sky * upward + 0.2F * (1.0F - upward); };
      Vec3f seen{light(kSky.x), light(kSky.y), light(kSky.z)};
      if (y >= kHorizon && !day.on_ground) seen = {1, 1, 1};
      seen *= albedo * 1.5F * (0.9F + 0.2F * r.uniform()) * (y < kHorizon ? day.walls_seen : 1.0F);
      if (p.labels[i] == label::sky) seen = {0.5F, 0.6F, 0.8F};
      p.normals[i] = normal;
      p.day[i] = {encode(seen.x), encode(seen.y), encode(seen.z)};
    }
  }
  return p;
}

// Mean log2 albedo of the painted wall in a rectangle.
double paint(const Picture& p, int x0, int x1, int y0, int y1) {
  double sum = 0.0, n = 0.0;
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) {
      if ((x % 24 >= 6 && x % 24 < 18) || (y % 26 >= 4 && y % 26 < 20)) continue;
      sum += std::log2(static_cast<double>(luminance(p.albedo[p.i(x, y)])));
      n += 1.0;
    }
  }
  return sum / n;
}

// Between the sun that was found and that of a day, over level ground.
double degrees_off(const Picture& p, const Day& day) {
  const float flat = std::cos(p.report.elevation_rad);
  const Vec3f found{flat * std::sin(p.report.azimuth_rad), -std::sin(p.report.elevation_rad),
                    flat * std::cos(p.report.azimuth_rad)};
  return 57.29578 * static_cast<double>(std::acos(std::fmin(1.0F, dot(found, normalized(day.sun)))));
}

}  // namespace

TEST_CASE(
    "the sun is found from walls on all sides, and neither its shadow on a facade nor a side away from it stays") {
  for (const float walls_seen : {1.0F, 0.5F, 2.0F}) {
    INFO("walls seen " << walls_seen);
    Day day;
    day.walls_seen = walls_seen;
    for (const float side : {1.0F, -1.0F}) {
      day.sun.x = 0.5F * side;
      Picture p = canyon(day);
      REQUIRE(p.run().ok());
      REQUIRE(p.report.shadow);
      REQUIRE(p.report.sun_found);
      CHECK(degrees_off(p, day) < 15.0);
      // One house of the left row, above and below the edge of the shadow; by day four times as bright above.
      CHECK(std::fabs(paint(p, 55, 95, 25, 55) - paint(p, 55, 95, 85, 130)) < 0.6);
      // Houses of one paint on either side of the street, one of them away from the sun.
      CHECK(std::fabs(paint(p, 55, 95, 25, 55) - paint(p, 355, 395, 25, 55)) < 0.5);
      // Dark paint stays dark: .25 beside .55.
      CHECK(std::fabs(paint(p, 5, 45, 25, 55) - paint(p, 55, 95, 25, 55) - 1.14) < 0.45);
      CHECK(p.sun[p.i(60, 120)] < 0.1F);
    }
  }
}

TEST_CASE("no sun is looked for without a shadow on the ground, and none is found where walls show none") {
  Day cloudy;
  cloudy.on_ground = false;
  Day in_the_shade;
  in_the_shade.on_walls = false;
  Day one_side;
  one_side.sides = false;
  for (const Day& day : {cloudy, in_the_shade, one_side}) {
    Picture p = canyon(day);
    REQUIRE(p.run().ok());
    CHECK(!p.report.sun_found);
    CHECK(p.report.shadow == day.on_ground);
    CHECK(p.median(label::building) == doctest::Approx(0.27).epsilon(0.3));
  }
}

TEST_CASE("walls in the sun: the order of chunks never changes a bit") {
  Picture a = canyon({});
  Picture b = a;
  REQUIRE(a.run().ok());
  REQUIRE(b.run({}, true, npsim_test::BackwardExecutor{}).ok());
  REQUIRE(a.report.sun_found);
  CHECK(a.report.azimuth_rad == b.report.azimuth_rad);
  CHECK(a.report.elevation_rad == b.report.elevation_rad);
  CHECK(std::memcmp(a.albedo.data(), b.albedo.data(), a.albedo.size() * sizeof(Vec3f)) == 0);
}

TEST_CASE("a camera that looks down by 15 degrees finds the same sun over the ground") {
  const Day day;
  Picture p = canyon(day);
  const float c = std::cos(0.26F), s = std::sin(0.26F);
  const auto tilted = [&](const Vec3f& v) { return Vec3f{v.x, c * v.y - s * v.z, s * v.y + c * v.z}; };
  for (Vec3f& n : p.normals) n = tilted(n);
  p.ground.up = tilted({0, -1, 0});
  REQUIRE(p.run().ok());
  REQUIRE(p.report.sun_found);
  CHECK(degrees_off(p, day) < 15.0);
}

TEST_CASE("walls whose normal is not known or no number have no say, and get an albedo within bounds") {
  const Day day;
  Picture p = canyon(day);
  const float nan = std::nanf("");
  for (int y = 0; y < kHorizon; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const int kind = (x / 20) % 6;
      if (kind == 1) p.normals[p.i(x, y)] = {};
      if (kind == 3) p.normals[p.i(x, y)] = {nan, 0, 1};
      if (kind == 5 && y % 2 == 0) p.normals[p.i(x, y)] = {0, 1e30F, 0};
    }
  }
  REQUIRE(p.run().ok());
  REQUIRE(p.report.sun_found);
  CHECK(degrees_off(p, day) < 15.0);
  for (std::size_t i = 0; i < p.albedo.size(); ++i) {
    CHECK_UNARY(is_finite(p.albedo[i]) && p.albedo[i].x >= 0.01F && p.albedo[i].x <= 0.9F);
    CHECK_UNARY(p.sun[i] >= 0.0F && p.sun[i] <= 1.0F);
  }
}

namespace {

// Nine signs and persons on a road in the sun, the first in the shadow that lies over its left. face(k, y): the normal of
// thing k in row y; light(normal): what a thing in the sun receives.
template <class Face, class Light>
Picture row_of_things(const float (&albedo)[9], const Face& face, const Light& light) {
  Picture p(kWidth, kHeight);
  p.normals.assign(p.shape.pixels(), Vec3f{0, -1, 0});
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      RandomStream r(6, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * kWidth + x), 0);
      const std::size_t i = p.i(x, y);
      const bool sky = y < 60;
      const int k = (x - 20) / 50;
      const bool thing = y >= 80 && y < 170 && x >= 20 && x < 470 && (x - 20) % 50 < 30;
      p.labels[i] = sky ? label::sky : thing ? (k % 2 == 0 ? label::traffic_sign : label::person) : label::road;
      const bool in_sun = x > 65;
      if (thing) p.normals[i] = face(k, y);
      const Vec3f on_ground = in_sun ? Vec3f{1, 1, 1} : kSky;
      const Vec3f on_thing = in_sun ? light(p.normals[i]) : kSky * 0.6F;
      const Vec3f seen = (thing ? on_thing * albedo[k] : on_ground * 0.1F) * (1.5F * (0.9F + 0.2F * r.uniform()));
      p.day[i] = sky ? Rgb8{200, 210, 230} : Rgb8{encode(seen.x), encode(seen.y), encode(seen.z)};
    }
  }
  return p;
}

// Seen from the side that the sun reaches or against it, in albedos from .05 to .6.
Picture things(bool against_the_sun, bool with_normals) {
  const Vec3f turned_away = kSky * 0.5F + Vec3f{0.1F, 0.1F, 0.1F};
  const Vec3f light = against_the_sun ? turned_away : Vec3f{0.75F, 0.75F, 0.75F};
  Picture p = row_of_things(
      {0.3F, 0.3F, 0.05F, 0.6F, 0.2F, 0.1F, 0.4F, 0.05F, 0.3F},
      [](int, int) {
        return Vec3f{0, 0, -1};
      },
      [&](const Vec3f&) { return light; });
  if (!with_normals) p.normals.clear();
  return p;
}

double mean_of_thing(const Picture& p, int k) {
  double sum = 0.0;
  for (int y = 105; y < 160; ++y) {
    for (int x = 0; x < 20; ++x) sum += static_cast<double>(luminance(p.albedo[p.i(25 + 50 * k + x, y)]));
  }
  return sum / (55.0 * 20.0);
}

}  // namespace

TEST_CASE("what is seen against the sun is as bright as from its sunny side, and black paint stays black in both") {
  for (const bool with_normals : {true, false}) {
    INFO("normals " << with_normals);
    Picture sunny = things(false, with_normals);
    Picture against = things(true, with_normals);
    REQUIRE(sunny.run().ok());
    REQUIRE(against.run().ok());
    REQUIRE(sunny.report.shadow);
    REQUIRE(against.report.shadow);
    for (int k = 1; k < 9; ++k) {
      INFO("thing " << k);
      // Four times as dark by day against the sun.
      CHECK(std::fabs(std::log2(mean_of_thing(against, k) / mean_of_thing(sunny, k))) < 0.7);
    }
    for (const Picture* p : {&sunny, &against}) {
      CHECK(mean_of_thing(*p, 3) > 0.35);
      CHECK(mean_of_thing(*p, 7) < 0.1);
    }
    CHECK(sunny.sun[sunny.i(240, 120)] > 0.8F);
    CHECK(against.sun[against.i(240, 120)] < 0.2F);
    // What stands in the shadow is not asked; half of what the street throws back to it comes from the shadow.
    CHECK(std::fabs(std::log2(mean_of_thing(against, 0) / mean_of_thing(sunny, 0))) < 0.1);
    const double shade = 0.6 * 0.13 / (0.5 * 0.13 + 0.1 * (1.0 - 0.5 * 0.87));  // of its light over what it counts as
    CHECK(mean_of_thing(sunny, 0) == doctest::Approx(0.3 * shade).epsilon(0.05));
  }
}

TEST_CASE("things that face a sun at the side come out like those that face away from it, and roofs like both") {
  for (const float side : {1.0F, -1.0F}) {  // of the sun: right, left
    INFO("side " << side);
    constexpr float kPaint = 0.25F;
    Picture p = row_of_things(
        {kPaint, kPaint, kPaint, kPaint, kPaint, kPaint, kPaint, kPaint, kPaint},
        [](int k, int y) {
          return y < 100 ? Vec3f{0, -1, 0} : Vec3f{k % 2 == 0 ? 1.0F : -1.0F, 0, 0};
        },
        [&](const Vec3f& normal) {
          return normal.y < 0.0F ? Vec3f{1, 1, 1} : normal.x == side ? Vec3f{0.8F, 0.8F, 0.8F} : kSky * 0.8F;
        });
    REQUIRE(p.run().ok());
    REQUIRE(p.report.shadow);
    for (int k = 2; k < 8; ++k) {
      INFO("thing " << k);
      CHECK(std::fabs(std::log2(mean_of_thing(p, k) / mean_of_thing(p, k + 1))) < 0.7);
      const double roof = static_cast<double>(luminance(p.albedo[p.i(40 + 50 * k, 88)]));
      CHECK(std::fabs(std::log2(roof / static_cast<double>(kPaint))) < 0.7);
    }
    CHECK(p.sun[p.i(35 + 50 * 4, 130)] == doctest::Approx(side > 0.0F ? 1.0 : 0.0).epsilon(0.1));
  }
}

TEST_CASE(
    "a face that looks into a low sun has more light than the ground, one that looks away the street's; both keep "
    "their paint") {
  struct Case {
    Vec3f sun;
    double octaves;  // off by less; in the lee of a sun that walls do not tell other directions are likely too
  };
  for (const Case& c :
       {Case{{0.35F, -0.6F, -0.72F}, 0.65}, Case{{0.5F, -0.75F, -0.43F}, 0.65}, Case{{-0.5F, -0.6F, 0.6F}, 1.0}}) {
    CAPTURE(c.sun.x);
    Day day;
    day.sun = c.sun;
    Picture p = canyon(day);
    const Vec3f towards = normalized(c.sun);
    constexpr float kPaint[] = {0.06F, 0.3F, 0.6F};
    for (int k = 0; k < 3; ++k) {
      for (int y = 145; y < 185; ++y) {
        for (int x = 250 + 60 * k; x < 280 + 60 * k; ++x) {
          const std::size_t i = p.i(x, y);
          RandomStream r(7, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * kWidth + x), 0);
          const float direct = std::fmax(-towards.z, 0.0F) / -towards.y;
          const auto light = [&](float sky) { return (1.0F - sky) * direct + 0.5F * sky + 0.1F; };
          const Vec3f seen =
              Vec3f{light(kSky.x), light(kSky.y), light(kSky.z)} * (kPaint[k] * 1.5F * (0.9F + 0.2F * r.uniform()));
          p.labels[i] = label::person;
          p.normals[i] = {0, 0, -1};
          p.day[i] = {encode(seen.x), encode(seen.y), encode(seen.z)};
        }
      }
    }
    REQUIRE(p.run().ok());
    for (int k = 0; k < 3; ++k) {
      CAPTURE(k);
      double sum = 0.0;
      for (int y = 150; y < 180; ++y) {
        for (int x = 255 + 60 * k; x < 275 + 60 * k; ++x) sum += static_cast<double>(luminance(p.albedo[p.i(x, y)]));
      }
      const double told = sum / 600.0 / static_cast<double>(kPaint[k]);
      CHECK(std::fabs(std::log2(told)) < c.octaves);
    }
  }
}
