// SPDX-License-Identifier: Apache-2.0
// Albedo and roughness from the photograph: the road's scale, shadows and what is none, casts, objects, bounds, bits.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "day_picture.hpp"
#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/material/albedo.hpp"
#include "npsim/material/roughness.hpp"

namespace {

using namespace npsim;

using npsim_test::contrast;
using npsim_test::encode;
using npsim_test::Ground;
using npsim_test::level_road;
using npsim_test::Picture;

enum class Dark { nothing, shadow, wet };

// Road below, building above left, sky above right; a car on the road. `cast` multiplies the light. On the left of the
// road a cast shadow, or a patch that is as dark and no bluer; a painted line runs through both.
Picture street(Vec3f cast, Dark dark = Dark::nothing) {
  Picture p(480, 270);
  for (int y = 0; y < 270; ++y) {
    for (int x = 0; x < 480; ++x) {
      RandomStream r(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * 480 + x), 0);
      Label l = y >= 135 ? label::road : (x < 300 ? label::building : label::sky);
      if (y > 150 && y < 190 && x > 380 && x < 450) l = label::car;
      float value = l == label::road ? 0.24F : l == label::building ? 0.6F : l == label::car ? 0.06F : 0.8F;
      if (l == label::road && y > 220 && y < 226) value *= 3.5F;
      value *= 0.85F + 0.3F * r.uniform();
      Vec3f light = cast;
      if (l == label::road && x < 170 + y / 10) {
        if (dark == Dark::shadow) light = light * Vec3f{0.13F, 0.155F, 0.21F};
        if (dark == Dark::wet) light *= 0.155F;
      }
      p.labels[p.i(x, y)] = l;
      p.day[p.i(x, y)] = {encode(value * light.x), encode(value * light.y), encode(value * light.z)};
    }
  }
  return p;
}

}  // namespace

TEST_CASE("road and building meet their priors, a car keeps its ratio to the road, and texture stays") {
  for (const bool remove : {true, false}) {
    Picture p = street({1, 1, 1});
    AlbedoParams params;
    params.remove_light = remove;
    REQUIRE(p.run(params).ok());
    CHECK(!p.report.shadow);
    for (const Label l : {label::road, label::building}) {
      INFO("label " << static_cast<int>(l));
      CHECK(p.median(l) == doctest::Approx(static_cast<double>(surface_prior(l).albedo)).epsilon(0.02));
    }
    // A quarter of the road's light: a dark car, whose prior would make it brighter than the road. Under clouds its
    // sides get .45 of the light of the road; where light is left alone, they count as on a sunny day.
    const double upright = remove ? 0.45 : 0.707;
    CHECK(p.median(label::car) / p.median(label::road) == doctest::Approx(0.25 / upright).epsilon(0.03));
    // Grain of the road: the ratio of two neighbours is that of the photograph.
    const auto linear = [](std::uint8_t v) { return std::pow((v / 255.0 + 0.055) / 1.055, 2.4); };
    const double day = linear(p.day[p.i(300, 200)].g) / linear(p.day[p.i(301, 200)].g);
    const double out = static_cast<double>(luminance(p.albedo[p.i(300, 200)]) / luminance(p.albedo[p.i(301, 200)]));
    CHECK(out == doctest::Approx(day).epsilon(0.02));
    CHECK(p.albedo[p.i(400, 10)] == Vec3f{0.2F, 0.2F, 0.2F});  // sky: the neutral prior
  }
}

TEST_CASE("a colour cast of the light is removed by the stated share") {
  for (const float share : {0.0F, 0.7F, 1.0F}) {
    Picture p = street({1.2F, 1.0F, 0.6F});
    AlbedoParams params;
    params.cast_removal = share;
    REQUIRE(p.run(params).ok());
    Vec3d sum;
    for (int y = 195; y < 215; ++y) {
      for (int x = 0; x < 480; ++x) sum += vec_cast<double>(p.albedo[p.i(x, y)]);
    }
    const double blue_over_red = sum.z / sum.x;
    if (share == 0.0F) CHECK(blue_over_red == doctest::Approx(0.5).epsilon(0.03));
    if (share == 1.0F) CHECK(blue_over_red == doctest::Approx(1.0).epsilon(0.03));
    if (share == 0.7F) CHECK(blue_over_red > 0.75);
  }
}

TEST_CASE("a cast shadow leaves the road, with its colour; its paint stays, and what is dark but no bluer stays dark") {
  Picture p = street({1.1F, 1, 0.9F}, Dark::shadow);
  REQUIRE(p.run().ok());
  REQUIRE(p.report.shadow);
  CHECK(static_cast<double>(p.report.ratio.x) == doctest::Approx(1 / 0.13).epsilon(0.1));
  CHECK(static_cast<double>(p.report.ratio.y) == doctest::Approx(1 / 0.155).epsilon(0.1));
  CHECK(static_cast<double>(p.report.ratio.z) == doctest::Approx(1 / 0.21).epsilon(0.1));
  CHECK(p.report.sunlit_share == doctest::Approx(0.6).epsilon(0.1));
  const double lit = mean(p, 300, 370, 230, 265);
  const double shade = mean(p, 20, 150, 230, 265);
  CHECK(lit / shade == doctest::Approx(1.0).epsilon(0.1));
  CHECK(p.sun[p.i(300, 240)] > 0.95F);
  CHECK(p.sun[p.i(80, 240)] < 0.05F);
  for (const int x : {80, 300}) {
    const Vec3f a = p.albedo[p.i(x, 240)];
    CHECK(static_cast<double>(a.z / a.x) == doctest::Approx(1.0).epsilon(0.15));
  }
  for (const int x : {20, 300}) CHECK(mean(p, x, x + 60, 222, 225) > 2.5 * lit);
  // No seam: nowhere along the edge does the mean of a column leave that of the road far behind.
  for (int x = 180; x < 205; ++x) {
    INFO("column " << x);
    CHECK(mean(p, x, x + 1, 230, 265) == doctest::Approx(lit).epsilon(0.5));
  }
  Picture wet = street({1.1F, 1, 0.9F}, Dark::wet);
  REQUIRE(wet.run().ok());
  CHECK(!wet.report.shadow);
  CHECK(mean(wet, 300, 370, 230, 265) / mean(wet, 20, 150, 230, 265) > 2.0);
}

TEST_CASE(
    "a shadow on a road that shines towards the sun leaves it, though its edges fall by less than the lights differ") {
  // Low sun ahead: the farther the sunlit road, the brighter, by 1.5 octaves; all of the shade lies near.
  Picture p(480, 270);
  for (int y = 0; y < 270; ++y) {
    for (int x = 0; x < 480; ++x) {
      RandomStream r(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * 480 + x), 0);
      const float gloss = std::exp2(1.5F * clamp_to(static_cast<float>(186 - y) / 20.0F, 0.0F, 1.0F));
      const bool shade = x < 240 && y > 190;
      const float value = 0.14F * (0.85F + 0.3F * r.uniform());
      const Vec3f light = shade ? Vec3f{0.13F, 0.155F, 0.21F} : Vec3f{gloss, gloss, gloss};
      p.labels[p.i(x, y)] = y < 135 ? label::sky : label::road;
      p.day[p.i(x, y)] = {encode(value * light.x), encode(value * light.y), encode(value * light.z)};
    }
  }
  REQUIRE(p.run().ok());
  REQUIRE(p.report.shadow);
  CHECK(mean(p, 300, 460, 230, 265) / mean(p, 20, 200, 230, 265) == doctest::Approx(1.0).epsilon(0.15));
}

TEST_CASE("paint and wide lanes of colour go on from the sun into the shadow as bright and as coloured as they were") {
  struct Lane {
    Vec3f albedo;
    int width;
  };
  for (const Lane lane :
       {Lane{{0.6F, 0.38F, 0.1F}, 12}, Lane{{0.307F, 0.35F, 0.4F}, 12}, Lane{{0.3F, 0.1F, 0.07F}, 90}}) {
    INFO("width " << lane.width << ", blue " << lane.albedo.z);
    Picture p(480, 270);
    const int left = 360 - lane.width / 2;
    for (int y = 0; y < 270; ++y) {
      for (int x = 0; x < 480; ++x) {
        RandomStream r(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * 480 + x), 0);
        Vec3f value = x >= left && x < left + lane.width ? lane.albedo : Vec3f{0.1F, 0.1F, 0.1F};
        value *= 1.4F * (0.9F + 0.2F * r.uniform());
        value.z *= std::exp2(r.uniform() - 0.5F);  // grain
        if (y > 200) value = value * Vec3f{0.13F, 0.155F, 0.21F};
        p.labels[p.i(x, y)] = y < 135 ? label::sky : label::road;
        p.day[p.i(x, y)] = {encode(value.x), encode(value.y), encode(value.z)};
      }
    }
    REQUIRE(p.run().ok());
    REQUIRE(p.report.shadow);
    const double lit = mean(p, 356, 364, 145, 180);
    CHECK(std::fabs(std::log2(mean(p, 356, 364, 220, 260) / lit)) < 0.2);
    // As close to the edge as the ground beside is sure of its light.
    CHECK(std::fabs(std::log2(mean(p, 356, 364, 210, 214) / lit)) < 0.35);
    CHECK(std::fabs(std::log2(mean(p, 356, 364, 188, 192) / lit)) < 0.35);
    CHECK(mean(p, 100, 250, 220, 260) == doctest::Approx(0.1).epsilon(0.02));
    Vec3f sum;
    for (int y = 225; y < 255; ++y) sum += p.albedo[p.i(360, y)];
    CHECK((lane.albedo.x > lane.albedo.z ? sum.x > 2.0F * sum.z : sum.x < sum.z));
  }
}

TEST_CASE("the wide stripes of a crossing stay as bright as they are, while light that changes slowly leaves") {
  Picture p(480, 270);
  const auto painted = [](int x, int y) { return y >= 205 && y < 255 && x % 56 < 28; };
  for (int y = 0; y < 270; ++y) {
    for (int x = 0; x < 480; ++x) {
      RandomStream r(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * 480 + x), 0);
      const bool road = y >= 135;
      const float light = std::exp2(static_cast<float>(x) / 480.0F - 0.5F);
      const float value = light * (painted(x, y) ? 0.46F : 0.24F) * (0.9F + 0.2F * r.uniform());
      p.labels[p.i(x, y)] = road ? label::road : label::sky;
      p.day[p.i(x, y)] = {encode(value), encode(value), encode(value)};
    }
  }
  REQUIRE(p.run().ok());
  for (int x = 56; x < 400; x += 56) {
    INFO("column " << x);
    CHECK(mean(p, x + 4, x + 24, 215, 245) > 1.6 * mean(p, x + 32, x + 52, 215, 245));
  }
  CHECK(mean(p, 425, 475, 150, 190) / mean(p, 5, 55, 150, 190) == doctest::Approx(1.0).epsilon(0.15));  // of 1.8 by day
}

TEST_CASE("shade under a crown, much lighter than that of a house and flecked, leaves the road; paint in it stays") {
  Picture p(480, 270);
  enum : int { lit, house, crown };
  const auto light_of = [](int x) { return x < 200 ? house : (x >= 340 && x < 400 ? crown : lit); };
  const auto painted = [](int y) { return y >= 220 && y < 226; };
  for (int y = 0; y < 270; ++y) {
    for (int x = 0; x < 480; ++x) {
      RandomStream r(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * 480 + x), 0);
      RandomStream fleck(3, RandomPurpose::test, 1, 0, static_cast<std::uint32_t>((y / 5) * 480 + x / 5), 0);
      const Vec3f shade{0.055F, 0.075F, 0.12F};
      Vec3f light{1, 1, 1};
      if (light_of(x) == house) light = shade;
      if (light_of(x) == crown) light = shade * (3.2F * std::exp2(0.8F * (fleck.uniform() - 0.5F)));
      const float value = 0.24F * (painted(y) ? 3.5F : 1.0F) * (0.9F + 0.2F * r.uniform());
      p.labels[p.i(x, y)] = y >= 135 ? label::road : label::sky;
      p.day[p.i(x, y)] = {encode(value * light.x), encode(value * light.y), encode(value * light.z)};
    }
  }
  REQUIRE(p.run().ok());
  REQUIRE(p.report.shadow);
  const double road = mean(p, 230, 300, 230, 265);
  CHECK(mean(p, 20, 180, 230, 265) == doctest::Approx(road).epsilon(0.15));
  CHECK(mean(p, 350, 390, 230, 265) < 1.4 * road);
  CHECK(mean(p, 350, 390, 150, 200) < 1.4 * road);
  for (const int x : {40, 240, 350}) CHECK(mean(p, x, x + 40, 222, 225) > 2.2 * road);
}

// Shade on the left of a road; `light` and `albedo` change what lies in it at a pixel, from shade and grey.
template <class Light, class Albedo>
Picture shaded_road(Vec3f shade, const Light& light, const Albedo& albedo) {
  Picture p(480, 270);
  for (int y = 0; y < 270; ++y) {
    for (int x = 0; x < 480; ++x) {
      RandomStream r(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * 480 + x), 0);
      const Vec3f lit = x < 260 ? light(x, y, shade) : Vec3f{1, 1, 1};
      const Vec3f value = albedo(x, y) * (0.9F + 0.2F * r.uniform()) * lit;
      p.labels[p.i(x, y)] = y >= 135 ? label::road : label::sky;
      p.day[p.i(x, y)] = {encode(value.x), encode(value.y), encode(value.z)};
    }
  }
  return p;
}

TEST_CASE("the little sun that leaves or blinds let through leaves the shade") {
  const auto bar = [](int x, int y) { return x < 80 && y > 180 && y / 5 % 2 == 0; };
  Picture p = shaded_road(
      {0.10F, 0.13F, 0.17F},
      [&](int x, int y, Vec3f shade) {
        return bar(x, y) ? shade + (Vec3f{1, 1, 1} - shade) * 0.07F : shade;
      },
      [](int, int) {
        return Vec3f{0.24F, 0.24F, 0.24F};
      });
  REQUIRE(p.run().ok());
  REQUIRE(p.report.shadow);
  double bars = 0, between = 0;
  for (int y = 190; y < 270; ++y) (bar(5, y) ? bars : between) += mean(p, 5, 75, y, y + 1);
  CHECK(bars / between == doctest::Approx(1.0).epsilon(0.1));  // of 1.47 by day
}

// log2(blue / red) of the mean albedo in columns x0 to x1 - 1 of the road.
double blueness(const Picture& p, int x0, int x1) {
  double red = 0, blue = 0;
  for (int y = 180; y < 260; ++y) {
    for (int x = x0; x < x1; ++x) {
      red += static_cast<double>(p.albedo[p.i(x, y)].x);
      blue += static_cast<double>(p.albedo[p.i(x, y)].z);
    }
  }
  return std::log2(blue / red);
}

TEST_CASE("deep shade bluer than at its edge becomes as grey as the road in the sun, within a bound; yellow stays") {
  struct Case {
    float bluer, left;  // log2(blue / red), of the light and of the albedo
  };
  for (const Case c : {Case{0.3F, 0.0F}, Case{-0.3F, -0.3F}, Case{0.5F, 0.1F}}) {
    CAPTURE(c.bluer);
    const auto line = [](int x, int y) { return x >= 50 && x < 56 && y > 160; };
    Picture p = shaded_road(
        {0.13F, 0.155F, 0.2F},
        [&](int x, int, Vec3f shade) {
          const float deep = std::min(1.0F, std::max(0.0F, (120.0F - static_cast<float>(x)) / 40.0F));
          return shade * Vec3f{std::exp2(-0.5F * c.bluer * deep), 1.0F, std::exp2(0.5F * c.bluer * deep)};
        },
        [&](int x, int y) {
          return Vec3f{0.24F, 0.24F, 0.24F} * (line(x, y) ? 4.0F : 1.0F);
        });
    REQUIRE(p.run().ok());
    REQUIRE(p.report.shadow);
    const double sunlit = blueness(p, 300, 440);
    CHECK(std::fabs(blueness(p, 10, 45) - sunlit - static_cast<double>(c.left)) < 0.05);
    if (c.bluer > 0.0F) CHECK(std::fabs(blueness(p, 51, 55) - blueness(p, 10, 45)) < 0.05);
  }
}

TEST_CASE(
    "the rim of a shadow that more of a blue sky lights is no paint that the sun beside it lights, dark blue is") {
  const auto rim = [](int x, int y) { return x >= 245 && x < 260 && y > 160; };
  const auto lane = [](int x, int y) { return x >= 340 && x < 360 && y > 160; };
  for (const float lighter : {1.6F, 4.0F}) {  // by .7 and 2 octaves; the shade lies 4.1 below the sun
    CAPTURE(lighter);
    Picture p = shaded_road(
        {0.055F, 0.06F, 0.065F},
        [&](int x, int y, Vec3f shade) {
          return rim(x, y) ? shade * Vec3f{0.73F, 1.0F, 1.37F} * lighter : shade;
        },
        [&](int x, int y) {
          return Vec3f{0.24F, 0.24F, 0.24F} * (lane(x, y) ? Vec3f{0.3F, 0.4F, 0.6F} : Vec3f{1, 1, 1});
        });
    REQUIRE(p.run().ok());
    REQUIRE(p.report.shadow);
    CHECK(p.sun[p.i(300, 230)] > 0.95F);
    CHECK(p.sun[p.i(350, 230)] > 0.95F);
    for (int x = 245; x < 256; ++x) {
      CAPTURE(x);
      CHECK(p.sun[p.i(x, 230)] < 0.2F);
    }
  }
}

TEST_CASE("a dark blue lane in the sun keeps its light and its hue, however dark its paint is beside pale concrete") {
  struct Case {
    Vec3f shade, paint;
    float concrete;
  };
  const Case cases[] = {{{0.055F, 0.06F, 0.065F}, {0.005F, 0.065F, 0.18F}, 0.24F},
                        {{0.1F, 0.13F, 0.17F}, {0.01F, 0.087F, 0.24F}, 0.24F},
                        {{0.1F, 0.13F, 0.17F}, {0.01F, 0.105F, 0.262F}, 0.35F},
                        {{0.1F, 0.13F, 0.17F}, {0.04F, 0.06F, 0.14F}, 0.24F}};  // by 1.6 to 2 octaves
  for (const Case& c : cases) {
    CAPTURE(c.paint.y);
    const auto lane = [](int x, int y) { return x >= 340 && x < 380 && y > 160; };
    Picture p = shaded_road(
        c.shade, [](int, int, Vec3f shade) { return shade; },
        [&](int x, int y) {
          return lane(x, y) ? c.paint : Vec3f{c.concrete, c.concrete, c.concrete};
        });
    REQUIRE(p.run().ok());
    REQUIRE(p.report.shadow);
    for (int x = 342; x < 378; ++x) {
      CAPTURE(x);
      CHECK(p.sun[p.i(x, 230)] > 0.95F);
    }
    const Vec3f a = p.albedo[p.i(360, 230)];
    CHECK(luminance(a) < 0.5F * luminance(p.albedo[p.i(300, 230)]));
    CHECK(a.z > 2.0F * a.x);
  }
}

TEST_CASE("a narrow shadow along a dark blue lane makes no rim of the lane") {
  const Vec3f shade{0.1F, 0.13F, 0.17F};
  Picture p = shaded_road(
      shade, [](int, int, Vec3f own) { return own; },
      [&](int x, int y) {
        if (y > 160 && x >= 340 && x < 380) return Vec3f{0.005F, 0.065F, 0.18F};
        const Vec3f concrete{0.24F, 0.24F, 0.24F};
        return y > 160 && x >= 380 && x < 382 ? concrete * shade : concrete;
      });
  REQUIRE(p.run().ok());
  REQUIRE(p.report.shadow);
  for (int x = 342; x < 360; ++x) {
    CAPTURE(x);
    CHECK(p.sun[p.i(x, 230)] > 0.95F);
  }
}

TEST_CASE("a blue lane in the shade keeps its hue, and the asphalt beside it") {
  for (const float blue : {0.4F, 1.0F, 1.6F}) {  // log2(blue / red) of the lane
    CAPTURE(blue);
    const auto lane = [](int x, int y) { return x >= 100 && x < 135 && y > 135; };
    Picture p = shaded_road(
        {0.13F, 0.155F, 0.2F}, [](int, int, Vec3f shade) { return shade; },
        [&](int x, int y) {
          const Vec3f paint{std::exp2(-0.5F * blue), 1.0F, std::exp2(0.5F * blue)};
          return Vec3f{0.24F, 0.24F, 0.24F} * (lane(x, y) ? paint * 1.6F : Vec3f{1, 1, 1});
        });
    REQUIRE(p.run().ok());
    REQUIRE(p.report.shadow);
    CHECK(std::fabs(blueness(p, 105, 130) - static_cast<double>(blue)) < 0.12);
    for (const int x : {60, 140}) CHECK(std::fabs(blueness(p, x, x + 35)) < 0.05);
  }
}

TEST_CASE("the grain of asphalt and a paving of two greys stay in the shade as they are in the sun") {
  for (const float step : {0.0F, 0.75F}) {
    const auto block = [](int x, int y) { return (x / 10 + y / 10) % 2 == 0; };
    Picture p = shaded_road(
        {0.10F, 0.13F, 0.17F}, [](int, int, Vec3f shade) { return shade; },
        [&](int x, int y) {
          return Vec3f{0.24F, 0.24F, 0.24F} * std::exp2(block(x, y) ? 0.5F * step : -0.5F * step);
        });
    REQUIRE(p.run().ok());
    REQUIRE(p.report.shadow);
    double light = 0, dark = 0;
    double deviation[2] = {};
    for (int y = 180; y < 260; ++y) {
      for (int x = 20; x < 240; ++x)
        (block(x, y) ? light : dark) += static_cast<double>(luminance(p.albedo[p.i(x, y)]));
      for (int x = 20; x < 220; ++x) {
        for (const int k : {0, 1}) {
          const Vec3f a = p.albedo[p.i(x + 250 * k, y)];
          const Vec3f b = p.albedo[p.i(x + 250 * k + 1, y)];
          deviation[k] += static_cast<double>(std::fabs(std::log2(luminance(a) / luminance(b))));
        }
      }
    }
    CHECK(light / dark > (step > 0.0F ? 1.4 : 0.97));
    CHECK(deviation[0] > 0.85 * deviation[1]);
  }
}

TEST_CASE("soil in the shade is yellower than asphalt, but no brighter: no sun lies on it") {
  const auto soil = [](int x, int y) { return x >= 20 && x < 90 && y >= 145 && y < 165; };
  Picture p = shaded_road(
      {0.055F, 0.075F, 0.12F}, [](int, int, Vec3f shade) { return shade; },
      [&](int x, int y) {
        return Vec3f{0.24F, 0.24F, 0.24F} * (soil(x, y) ? Vec3f{0.9F, 0.8F, 0.55F} : Vec3f{1, 1, 1});
      });
  REQUIRE(p.run().ok());
  REQUIRE(p.report.shadow);
  CHECK(mean(p, 30, 80, 150, 160) > 0.65 * mean(p, 225, 245, 150, 260));
}

TEST_CASE("a wide field of other asphalt or concrete stays as it is, in one light and beside a shadow") {
  for (const Dark dark : {Dark::nothing, Dark::shadow}) {
    for (const float step : {0.35F, 3.0F}) {
      Picture p = street({1, 1, 1}, dark);
      for (int y = 150; y < 270; ++y) {
        for (int x = 290; x < 470; ++x) {
          RandomStream r(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * 480 + x), 0);
          const std::uint8_t v = encode(0.24F * step * (0.85F + 0.3F * r.uniform()));
          p.labels[p.i(x, y)] = label::road;
          p.day[p.i(x, y)] = {v, v, v};
        }
      }
      REQUIRE(p.run().ok());
      CHECK(mean(p, 330, 430, 180, 260) / mean(p, 210, 270, 180, 215) == doctest::Approx(step).epsilon(0.2));
    }
  }
}

TEST_CASE("the yellow stripes of a crossing are no sun on a road in the shadow") {
  Picture p(480, 270);
  const auto painted = [](int x, int y) { return y >= 180 && y < 250 && x % 60 < 25; };
  for (int y = 0; y < 270; ++y) {
    for (int x = 0; x < 480; ++x) {
      RandomStream r(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * 480 + x), 0);
      Vec3f colour = painted(x, y) ? Vec3f{0.2F, 0.14F, 0.05F} : Vec3f{0.07F, 0.07F, 0.07F};
      colour *= 0.7F + 0.6F * r.uniform();
      colour.z *= std::exp2(2.0F * (r.uniform() - 0.5F));
      p.labels[p.i(x, y)] = y >= 135 ? label::road : label::sky;
      p.day[p.i(x, y)] = {encode(colour.x), encode(colour.y), encode(colour.z)};
    }
  }
  REQUIRE(p.run().ok());
  CHECK(!p.report.shadow);
  CHECK(mean(p, 62, 83, 200, 240) > 1.6 * mean(p, 87, 118, 200, 240));
}

TEST_CASE("a strip of road between cars that lies in more light is no paint") {
  Picture p(480, 270);
  for (int y = 0; y < 270; ++y) {
    for (int x = 0; x < 480; ++x) {
      const bool strip = x >= 236 && x < 242 && y >= 150 && y < 250;
      const bool car = !strip && y >= 150 && y < 250 && x > 150 && x < 330;
      const float value = strip ? 0.42F : (car ? 0.1F : 0.24F);  // .8 of a stop up
      p.labels[p.i(x, y)] = y < 135 ? label::sky : (car ? label::car : label::road);
      p.day[p.i(x, y)] = {encode(value), encode(value), encode(value)};
    }
  }
  REQUIRE(p.run().ok());
  CHECK(mean(p, 237, 241, 190, 210) < 1.3 * mean(p, 20, 120, 215, 260));
}

TEST_CASE("two cars of one paint, one in the shadow, come out alike; sky in a pane does not") {
  Picture p = street({1, 1, 1}, Dark::shadow);
  p.instances.assign(p.shape.pixels(), 0);
  // Sides of 60 x 40 px: panes that mirror the sky in the upper part, paint, tyres; the first car in the shadow.
  for (const bool shaded : {true, false}) {
    for (int y = 160; y < 200; ++y) {
      for (int x = shaded ? 40 : 280; x < (shaded ? 100 : 340); ++x) {
        const std::size_t i = p.i(x, y);
        p.labels[i] = label::car;
        p.instances[i] = shaded ? 26001 : 26002;
        const bool pane = y > 164 && y < 176;
        const Vec3f light = shaded ? Vec3f{0.13F, 0.155F, 0.21F} : Vec3f{1, 1, 1};
        const Vec3f seen = pane ? Vec3f{0.8F, 0.85F, 0.9F} : light * 0.3F;
        p.day[i] = {encode(seen.x), encode(seen.y), encode(seen.z)};
      }
    }
  }
  REQUIRE(p.run().ok());
  const double in_shadow = mean(p, 50, 90, 180, 190);
  const double in_sun = mean(p, 290, 330, 180, 190);
  CHECK(in_shadow / in_sun == doctest::Approx(1.0).epsilon(0.35));  // a factor of 6 in the photograph
  CHECK(mean(p, 50, 90, 168, 173) < in_shadow);
  CHECK(mean(p, 290, 330, 168, 173) < in_sun);
}

TEST_CASE("a white roof that faces the sky stays white beside dark panes; on a dark car it would be sky in a pane") {
  // Sides of 80 x 60 px: roof and tailgate brighter than the sides, and among them a dark pane.
  for (const bool white : {true, false}) {
    Picture p = street({1, 1, 1});
    p.instances.assign(p.shape.pixels(), 0);
    const float paint = white ? 0.6F : 0.03F;
    for (int y = 160; y < 220; ++y) {
      for (int x = 280; x < 360; ++x) {
        const std::size_t i = p.i(x, y);
        p.labels[i] = label::car;
        p.instances[i] = 26001;
        const bool upper = y < 185;
        const bool pane = y >= 170 && y < 178 && x > 290 && x < 350;
        const std::uint8_t code = encode(pane ? 0.01F : (upper ? 1.6F * paint : paint));
        p.day[i] = {code, code, code};
      }
    }
    REQUIRE(p.run().ok());
    const double side = mean(p, 290, 350, 190, 203);
    CAPTURE(side);
    if (white) {
      CHECK(mean(p, 290, 350, 180, 184) > side);
      CHECK(mean(p, 290, 350, 167, 169) > side);
    } else {
      CHECK(mean(p, 290, 350, 180, 184) < 1.1 * side);
    }
    CHECK(mean(p, 295, 345, 172, 176) < 0.06);
  }
}

TEST_CASE("a pane's border is that of the picture: bonnet and doors that reach into the band of panes stay paint") {
  // A red car of 100 x 60 px: roof, a pane that mirrors the sky, and a bonnet that is brighter than the doors, as it
  // faces the sky, and reaches above the lower border of the band.
  Picture p = street({1, 1, 1});
  p.instances.assign(p.shape.pixels(), 0);
  for (int y = 160; y < 220; ++y) {
    for (int x = 280; x < 380; ++x) {
      const std::size_t i = p.i(x, y);
      p.labels[i] = label::car;
      p.instances[i] = 26001;
      const bool pane = y >= 163 && y < 177 && x < 330;
      const bool seam = pane && (y == 163 || y == 176 || x == 329);
      const float slope = static_cast<float>(y - 160) / 60.0F;  // from 1.9 of the doors' light to .9
      const Vec3f paint = Vec3f{0.3F, 0.06F, 0.05F} * (y < 200 ? 1.9F - 1.2F * slope : 1.1F);
      const Vec3f seen = seam ? Vec3f{0.01F, 0.01F, 0.01F} : pane ? Vec3f{0.55F, 0.6F, 0.65F} : paint;
      RandomStream r(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * 480 + x), 0);
      const float noise = 0.97F + 0.06F * r.uniform();
      p.day[i] = {encode(noise * seen.x), encode(noise * seen.y), encode(noise * seen.z)};
    }
  }
  REQUIRE(p.run().ok());
  CHECK(mean(p, 285, 325, 166, 174) < 0.06);
  const double doors = mean(p, 290, 370, 195, 205);
  for (int y = 178; y < 195; ++y) {
    INFO("row " << y);
    CHECK(mean(p, 290, 370, y, y + 1) > 0.9 * doors);
    CHECK(mean(p, 290, 370, y, y + 1) == doctest::Approx(mean(p, 290, 370, y + 1, y + 2)).epsilon(0.1));
  }
}

TEST_CASE("a car without panes, as a van's side, is paint from roof to sill, shaded or plain") {
  for (const float upper : {1.0F, 1.23F, 0.78F}) {
    for (const float paint : {0.4F, 0.1F}) {
      Picture p = street({1, 1, 1});
      p.instances.assign(p.shape.pixels(), 0);
      for (int y = 140; y < 260; ++y) {
        for (int x = 200; x < 400; ++x) {
          RandomStream r(5, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * 480 + x), 0);
          p.labels[p.i(x, y)] = label::car;
          p.instances[p.i(x, y)] = 26001;
          const std::uint8_t code = encode(paint * (y < 200 ? upper : 1.0F) * (0.95F + 0.1F * r.uniform()));
          p.day[p.i(x, y)] = {code, code, code};
        }
      }
      REQUIRE(p.run().ok());
      CAPTURE(upper);
      CAPTURE(paint);
      const double sides = mean(p, 220, 380, 205, 230);
      for (int y = 145; y < 195; y += 5) {
        INFO("row " << y);
        CHECK(mean(p, 220, 380, y, y + 5) > 0.9 * static_cast<double>(std::min(1.0F, upper)) * sides);
      }
    }
  }
}

TEST_CASE("a photograph of steeper tones than sRGB has the albedo of one that is sRGB") {
  Picture usual = street({1, 1, 1}, Dark::shadow);
  Picture steep = usual;
  for (Rgb8& c : steep.day) {
    const auto steeper = [](std::uint8_t code) {
      return encode(std::pow(static_cast<float>(srgb_decode8(code)), 1.6F));
    };
    c = {steeper(c.r), steeper(c.g), steeper(c.b)};
  }
  REQUIRE(usual.run().ok());
  REQUIRE(steep.run().ok());
  CHECK(usual.report.contrast == 1.0F);
  CHECK(usual.report.ratio.y < 8.0F);
  CHECK(static_cast<double>(steep.report.contrast) == doctest::Approx(1 / 1.6).epsilon(0.15));
  for (const Label l : {label::road, label::car}) {
    INFO("label " << static_cast<int>(l));
    CHECK(steep.median(l) / usual.median(l) == doctest::Approx(1).epsilon(0.1));
  }
}

TEST_CASE(
    "a sensor's own, linear codes have the light that they say, dark ones too, and no tones are taken for steeper") {
  Picture usual = street({1, 1, 1}, Dark::shadow);
  for (int y = 190; y < 200; ++y) {  // dark red paint
    for (int x = 400; x < 420; ++x) {
      usual.labels[usual.i(x, y)] = label::car;
      usual.day[usual.i(x, y)] = {60, 30, 33};
    }
  }
  Picture linear = usual;
  for (Rgb8& c : linear.day) {
    const auto own = [](std::uint8_t code) {
      return static_cast<std::uint8_t>(std::lround(255.0F * std::min(1.0F, 2.0F * srgb_decode8(code))));
    };
    c = {own(c.r), own(c.g), own(c.b)};
  }
  REQUIRE(usual.run().ok());
  REQUIRE(linear.run().ok());
  CHECK(linear.report.contrast == doctest::Approx(0.5).epsilon(0.03));
  CHECK(linear.report.ratio.y == doctest::Approx(usual.report.ratio.y).epsilon(0.15));
  // The power is not quite that of linear codes: what has a quarter of the road's light becomes darker, and so does the
  // shade in which the car's sides lie, whose light is half of the sky's and half of what the street throws back.
  const double darker = std::pow(0.25, 2.2 * static_cast<double>(linear.report.contrast) - 1.0);
  const auto shade = [](const Picture& p) { return 0.5 / static_cast<double>(p.report.ratio.y) + 0.5 * 0.2; };
  CHECK(linear.median(label::car) / usual.median(label::car) ==
        doctest::Approx(darker * shade(usual) / shade(linear)).epsilon(0.02));
  const auto redness = [](const Picture& p) {
    const Vec3f a = p.albedo[p.i(410, 195)];
    return static_cast<double>(a.x / a.y);
  };
  CHECK(redness(usual) > 2.5);
  CHECK(redness(linear) / redness(usual) == doctest::Approx(1).epsilon(0.05));
  Picture darkened = linear;  // by a black level that is too high
  for (Rgb8& c : darkened.day) {
    for (std::uint8_t* code : {&c.r, &c.g, &c.b}) *code = static_cast<std::uint8_t>(std::max(*code - 14, 0));
  }
  REQUIRE(darkened.run().ok());
  CHECK(darkened.report.ratio.y > 9.0F);
  CHECK(darkened.report.contrast == doctest::Approx(1 / 2.2).epsilon(1e-3));
  daylight_detail::Picture working;
  working.set_contrast(1.0F / 2.2F);
  for (std::size_t code = 5; code < 256; ++code) {
    INFO("code " << code);
    const double light = static_cast<double>(working.light[code]) * 255.0 / static_cast<double>(code);
    CHECK(light > 0.97);
    CHECK(light < 1.25);
  }
}

TEST_CASE("a dark pole whose label is loose takes nothing of the bright ground behind it") {
  Picture p = street({1, 1, 1});
  for (int y = 150; y < 230; ++y) {
    for (int x = 216; x < 228; ++x) {
      p.labels[p.i(x, y)] = label::pole;
      if (x >= 218 && x < 226) p.day[p.i(x, y)] = {encode(0.03F), encode(0.03F), encode(0.03F)};
    }
  }
  REQUIRE(p.run().ok());
  const double core = mean(p, 221, 223, 160, 220);
  CHECK(core < 0.5 * p.median(label::road));
  for (int x = 216; x < 228; ++x) {
    INFO("column " << x);
    CHECK(mean(p, x, x + 1, 160, 220) < 1.2 * core);
  }
}

TEST_CASE("a pole of any width between dark leaves and a bright wall is one grey across but for its rims") {
  for (const int width : {480, 960}) {
    for (const int pole_px : {3, 4, 5, 8}) {
      CAPTURE(width);
      CAPTURE(pole_px);
      Picture p(width, width * 9 / 16);
      for (int y = 0; y < width * 9 / 16; ++y) {
        for (int x = 0; x < width; ++x) {
          const bool is_road = y >= width / 4;
          const int across = x - 150;
          const bool is_pole = !is_road && across >= 0 && across < pole_px;
          // Leaves and wall are half of its outer columns.
          const float pole = across == 0 ? 0.03F : across == pole_px - 1 ? 0.2F : 0.12F;
          const float value = is_road ? 0.24F : is_pole ? pole : x < 150 ? 0.015F : 0.6F;
          p.labels[p.i(x, y)] = is_road   ? label::road
                                : is_pole ? label::pole
                                : x < 150 ? label::vegetation
                                          : label::building;
          p.day[p.i(x, y)] = {encode(value), encode(value), encode(value)};
        }
      }
      REQUIRE(p.run().ok());
      const double core = mean(p, 150 + pole_px / 2, 151 + pole_px / 2, 30, 110);
      CHECK(core > 2.0 * mean(p, 150, 151, 30, 110));  // it is not the dark rim's
      for (int x = 151; x < 150 + pole_px; ++x) {
        INFO("column " << x - 150);
        CHECK(mean(p, x, x + 1, 30, 110) == doctest::Approx(core).epsilon(0.1));
      }
    }
  }
}

TEST_CASE("a car whose doors a railing hides is not taken for glass and rubber") {
  Picture p = street({1, 1, 1});
  p.instances.assign(p.shape.pixels(), 0);
  for (int y = 160; y < 220; ++y) {
    for (int x = 280; x < 360; ++x) {
      const std::size_t i = p.i(x, y);
      const bool railing = y >= 184 && y < 209;
      p.labels[i] = railing ? label::fence : label::car;
      p.instances[i] = railing ? 0 : 26001;
      const std::uint8_t code = encode(0.3F);
      p.day[i] = {code, code, code};
    }
  }
  REQUIRE(p.run().ok());
  CHECK(mean(p, 290, 350, 166, 182) > 0.08);  // its paint is .12
  CHECK(mean(p, 290, 350, 211, 219) > 0.08);
}

TEST_CASE("a line of paint that runs through a shadow is whole but in half shade, and a long gap of sun is no paint") {
  Picture p(480, 270);
  const Vec3f shade{0.13F, 0.155F, 0.21F};
  const auto place = [](int x, int y) {  // on the ground, m
    const float z = 600.0F / (static_cast<float>(y) + 0.5F - 120.0F);
    return Vec2f{(static_cast<float>(x) + 0.5F - 240.0F) / 400.0F * z, z};
  };
  const auto is_paint = [](Vec2f at) { return at.x > 1.0F && at.x < 1.15F; };
  const auto is_gap = [](Vec2f at) { return at.y > 7.3F && at.y < 7.6F && at.x > -3.0F && at.x < -1.0F; };
  for (int y = 0; y < 270; ++y) {
    for (int x = 0; x < 480; ++x) {
      RandomStream r(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * 480 + x), 0);
      const Vec2f at = place(x, y);
      p.labels[p.i(x, y)] = y >= 135 ? label::road : label::sky;
      // Slanted, as the shadow of a house is, and soft over .2 m.
      const float inside = std::min(at.y + 0.5F * at.x - 6.0F, 8.6F - at.y - 0.5F * at.x);
      const float sun = is_gap(at) ? 1.0F : 1.0F - std::max(0.0F, std::min(1.0F, inside / 0.2F));
      const Vec3f light = shade + (Vec3f{1, 1, 1} - shade) * sun;
      const Vec3f seen = light * (0.24F * (is_paint(at) ? 3.5F : 1.0F) * (0.95F + 0.1F * r.uniform()));
      p.day[p.i(x, y)] = {encode(seen.x), encode(seen.y), encode(seen.z)};
    }
  }
  REQUIRE(Ground().run(p, true).ok());
  REQUIRE(p.report.shadow);
  const double road = mean(p, 300, 400, 250, 268);
  int broken = 0;  // rows
  double gap = 0;
  int gap_px = 0;
  for (int y = 165; y < 260; ++y) {
    double best = 0;
    for (int x = 0; x < 480; ++x) {
      const auto value = static_cast<double>(luminance(p.albedo[p.i(x, y)]));
      if (is_paint(place(x - 1, y)) && is_paint(place(x + 1, y))) best = std::max(best, value);
      if (!is_gap(place(x, y))) continue;
      gap += value;
      ++gap_px;
    }
    if (best < 2.0 * road) ++broken;
  }
  REQUIRE(gap_px > 20);
  CHECK(gap / gap_px < 1.6 * road);
  CHECK(broken <= 5);  // of 95; each edge of the shadow is soft over 3 to 4 of them
}

TEST_CASE("panes of a car that the picture cuts off at its foot reach down to its doors, and its bonnet is none") {
  // A dark car whose panes mirror the sky, and whose bonnet, facing it, looks three times as bright as its doors. What
  // is seen of it is .6 of its height, so that by rows the panes would end at half of theirs and the bonnet lie among
  // them. Stereo may have no depth in the panes.
  for (const int what : {0, 1, 2}) {
    const bool bonnet = what == 1;
    const bool measured = what != 2;
    Picture p = street({1, 1, 1});
    p.instances.assign(p.shape.pixels(), 0);
    Ground ground;
    for (int y = 130; y < 270; ++y) {
      const float row = static_cast<float>(y);
      const float height = !bonnet   ? 1.5F - (row - 120.0F) / 200.0F
                           : y < 150 ? 1.45F - (row - 130.0F) * 0.0225F
                           : y < 200 ? 0.95F - (row - 150.0F) * 0.004F
                                     : 0.75F - (row - 200.0F) * 0.01F;
      for (int x = 280; x < 380; ++x) {
        const std::size_t i = p.i(x, y);
        p.labels[i] = label::car;
        p.instances[i] = 26001;
        const bool pane = x > 300 && x < 360 && height < 1.3F && height > 0.98F;
        ground.depth[i] = pane && !measured ? 0.0F : (1.5F - height) * 400.0F / (row + 0.5F - 120.0F);
        const bool flat = bonnet && height > 0.75F && height < 0.95F;
        ground.normals[i] = flat ? Vec3f{0, -0.8F, -0.6F} : Vec3f{0, 0, -1};
        const float seen = pane ? 0.5F : flat ? 0.24F : 0.08F;
        p.day[i] = {encode(seen), encode(seen), encode(seen)};
      }
    }
    REQUIRE(ground.run(p, true).ok());
    CAPTURE(what);
    const double doors = mean(p, 310, 350, bonnet ? 205 : 235, bonnet ? 215 : 245);
    if (bonnet) {
      CHECK(mean(p, 310, 350, 165, 190) > 0.8 * doors);
    } else {
      CHECK(mean(p, 310, 350, measured ? 195 : 162, measured ? 220 : 174) < 1.3 * doors);
    }
  }
}

TEST_CASE("markings and rails on a cloudy day, slightly yellow in a picture with a cast, are no sun on the road") {
  // Four lines along the street .3 m wide, dashes of another, 1.2 m to 4 m beside the camera; a bar across, .5 m deep.
  const auto painted = [](float across, float away) {
    for (const float line : {-1.6F, -1.1F, 1.2F, 1.9F}) {
      if (std::fabs(across - line) < 0.15F) return true;
    }
    return std::fabs(away - 7.0F) < 0.25F || (std::fabs(across) < 0.15F && std::fmod(away, 3.0F) < 1.5F);
  };
  const Picture p = level_road([&](float across, float away) {
    return painted(across, away) ? Vec3f{0.26F, 0.25F, 0.23F} : Vec3f{0.072F, 0.075F, 0.075F};
  });
  CHECK(!p.report.shadow);
  CHECK(contrast(p, painted, 170) > 2.5);  // of 3.4 by day
}

TEST_CASE("without a road the level is that of what stands there, and unknown normals make no unknown albedo") {
  Picture p(480, 270);
  for (std::size_t i = 0; i < p.day.size(); ++i) {
    p.day[i] = {120, 120, 120};
    p.labels[i] = i % 2 == 0 ? label::car : label::building;
  }
  REQUIRE(p.run().ok());
  CHECK(p.median(label::car) == doctest::Approx(p.median(label::building)).epsilon(0.02));
  Picture road = level_road([](float, float) { return Vec3f{0.24F, 0.24F, 0.24F}; });
  Ground ground;
  for (int y = 140; y < 200; ++y) {
    for (int x = 100; x < 300; ++x) {
      road.labels[road.i(x, y)] = label::car;
      const float nan = std::numeric_limits<float>::quiet_NaN();
      ground.normals[road.i(x, y)] = x % 2 == 0 ? Vec3f{nan, nan, nan} : Vec3f{0, 0, 1};  // or turned away
    }
  }
  REQUIRE(ground.run(road, true).ok());
  for (const Vec3f& a : road.albedo) REQUIRE((is_finite(a) && a.x >= 0.015F && a.x <= 0.9F));
}

TEST_CASE("lines that run askew to the camera's axis on a cloudy day are no sun on the road") {
  for (const float angle : {0.0F, 0.1F, 0.2F, 0.3F, 0.4F, 0.5F}) {
    CAPTURE(angle);
    const Picture p = level_road([&](float across, float away) {
      const float at = across * std::cos(angle) + away * std::sin(angle) + 120.0F;
      return std::fmod(at, 1.2F) < 0.15F ? Vec3f{0.26F, 0.25F, 0.23F} : Vec3f{0.072F, 0.075F, 0.075F};
    });
    CHECK(!p.report.shadow);
  }
}

TEST_CASE("white paint on bluish stones is no sun where it is wider than a line: heads of arrows") {
  // A stem .45 m wide and 3 m long, a head 1.6 m wide and 1.2 m long.
  const auto arrow = [](float along, float aside) {
    return (std::fabs(aside) < 0.225F && along > 0.0F && along < 3.0F) ||
           (along >= 3.0F && std::fabs(aside) < 0.667F * (4.2F - along));
  };
  const auto painted = [&](float across, float away) {
    return arrow(3.4F - across, away - 5.4F) || arrow(across + 6.2F, away - 5.6F) ||
           arrow(across + 4.0F, away - 7.8F) || arrow(4.4F - across, away - 7.8F);
  };
  const Picture p = level_road([&](float across, float away) {
    return painted(across, away) ? Vec3f{0.9F, 0.9F, 0.88F} : Vec3f{0.146F, 0.15F, 0.16F};
  });
  CHECK(!p.report.shadow);
  CHECK(contrast(p, painted, 170) > 2.5);  // white is bounded
  Picture backward = p;
  REQUIRE(Ground().run(backward, true, npsim_test::BackwardExecutor{}).ok());
  CHECK(std::memcmp(p.albedo.data(), backward.albedo.data(), p.albedo.size() * sizeof(Vec3f)) == 0);
}

TEST_CASE("strips of sun wider than markings, short flecks, and sun at the picture's lower border are no paint") {
  const auto found = [](const auto& lit) {
    const Picture p = level_road([&](float across, float away) {
      return lit(across, away) ? Vec3f{0.3F, 0.29F, 0.27F} : Vec3f{0.075F, 0.08F, 0.085F};
    });
    CHECK(static_cast<double>(p.report.ratio.y) == doctest::Approx(0.29 / 0.08).epsilon(0.1));
    return p.report.shadow;
  };
  CHECK(found([](float, float z) { return (z > 5 && z < 5.7F) || (z > 8 && z < 8.7F) || (z > 12 && z < 12.7F); }));
  CHECK(found([](float, float z) { return z < 4.5F; }));
  CHECK(found([](float across, float away) {  // .25 m x 1.2 m
    const float x = std::fmod(across + 100.0F, 2.0F) - 1.0F;
    const float y = std::fmod(away + 0.7F * std::floor((across + 100.0F) / 2.0F), 1.8F) - 0.9F;
    return std::fabs(x) < 0.6F && std::fabs(y) < 0.125F;
  }));
  CHECK(found([](float, float z) { return std::fmod(z, 5.0F) > 0.25F; }));  // the shadows of poles
  CHECK(found([](float x, float z) {                                        // wedges .3 to .7 m deep
    const float from = std::fmod(z, 4.0F) - 2.0F;
    return from > 0.0F && from < 0.5F + 0.05F * x;
  }));
  CHECK(found([](float x, float z) {  // between trunks, before which all is in the sun
    return (z > 8.0F && z < 9.0F) || (z > 5.0F && z < 8.0F && std::fmod(x + 100.0F, 1.2F) < 0.5F);
  }));
}

TEST_CASE("the dark joints beside rails are no shadow, though they are bluer than the road") {
  const auto joint = [](float across, float) {
    for (const float line : {-2.0F, -0.6F, 0.9F, 2.3F}) {
      if (std::fabs(across - line) < 0.08F) return true;
    }
    return false;
  };
  const Picture p = level_road([&](float across, float away) {
    return joint(across, away) ? Vec3f{0.028F, 0.031F, 0.037F} : Vec3f{0.11F, 0.11F, 0.11F};
  });
  CHECK(p.report.ratio.y == 1.0F);
  CHECK(contrast(p, joint, 200) < 0.5);  // of .28 by day
}

TEST_CASE("without labels paint is brighter than the road that it is on, with and without a known ground") {
  Picture p = street({1, 1, 1});
  REQUIRE(p.run({}, false).ok());
  CHECK(mean(p, 20, 300, 222, 225) > 2.0 * mean(p, 20, 300, 200, 215));
  const Ground ground;
  for (const Dark dark : {Dark::nothing, Dark::shadow}) {
    Picture q = street({1, 1, 1}, dark);
    REQUIRE(ground.run(q).ok());
    CHECK(q.report.shadow == (dark == Dark::shadow));
    CHECK(mean(q, 20, 150, 230, 260) ==
          doctest::Approx(static_cast<double>(surface_prior(label::road).albedo)).epsilon(0.15));
    CHECK(mean(q, 20, 300, 222, 225) > 2.0 * static_cast<double>(surface_prior(label::road).albedo));
  }
}

TEST_CASE("what is cut off and nearly white, or dark, becomes grey; ink keeps its hue; bounds hold") {
  Picture p = street({1, 1, 1});
  for (int y = 200; y < 204; ++y) {
    for (int x = 20; x < 24; ++x) p.day[p.i(x, y)] = {255, 240, 215};
    for (int x = 40; x < 44; ++x) {
      p.day[p.i(x, y)] = {255, 30, 30};
      p.labels[p.i(x, y)] = label::traffic_sign;
    }
  }
  p.day[p.i(100, 100)] = {4, 0, 12};
  REQUIRE(p.run().ok());
  const Vec3f a = p.albedo[p.i(21, 201)];
  CHECK(a.x == doctest::Approx(static_cast<double>(a.y)));
  CHECK(a.y == doctest::Approx(static_cast<double>(a.z)));
  const Vec3f ink = p.albedo[p.i(41, 201)];
  CHECK(ink.x > 3.0F * ink.y);
  const Vec3f dark = p.albedo[p.i(100, 100)];  // eight times as blue as green in the photograph
  CHECK(dark.z < 2.0F * dark.y);
  const AlbedoParams params;
  for (const int v : {0, 255}) {
    const auto b = static_cast<std::uint8_t>(v);
    for (Rgb8& c : p.day) c = {b, b, b};
    REQUIRE(p.run().ok());
    for (const Vec3f& out : p.albedo) {
      CHECK_UNARY(is_finite(out) && out.x >= params.min_albedo && out.x <= params.max_albedo &&
                  out.y >= params.min_albedo && out.z <= params.max_albedo);
    }
  }
}

TEST_CASE(
    "dark plants, and white sky between them, have the colour of the others; where none shows it is that of leaves") {
  for (const Rgb8 others : {Rgb8{150, 90, 40}, Rgb8{9, 9, 10}}) {
    const bool autumn = others.r > 100;
    CAPTURE(autumn);
    Picture p = street({1, 1, 1});
    for (int y = 20; y < 60; ++y) {
      for (int x = 20; x < 80; ++x) {
        p.labels[p.i(x, y)] = label::vegetation;
        p.day[p.i(x, y)] = x < 50 ? Rgb8{9, 9, 10} : x < 60 ? Rgb8{255, 255, 255} : others;
      }
    }
    REQUIRE(p.run().ok());
    for (const int x : {35, 55}) {
      if (autumn && x == 35) continue;  // as dark as albedo may be
      CAPTURE(x);
      const Vec3f a = p.albedo[p.i(x, 40)];
      CHECK((autumn ? a.x > 1.2F * a.y : a.y > 1.2F * a.x));
      CHECK(a.y > 1.4F * a.z);
    }
  }
}

TEST_CASE("shares of a channel stay within their bounds where the colour of plants is mixed in") {
  Picture p = street({1, 1, 1});
  for (int y = 20; y < 60; ++y) {
    for (int x = 20; x < 80; ++x) {
      p.labels[p.i(x, y)] = label::vegetation;
      p.day[p.i(x, y)] = x < 50 ? Rgb8{90, 150, 0} : Rgb8{60, 0, 0};
    }
  }
  AlbedoParams params;
  params.min_albedo = 0.0F;
  REQUIRE(p.run(params).ok());
  for (const int x : {30, 70}) {
    const Vec3f a = p.albedo[p.i(x, 40)];
    const float lum = luminance(a);
    CHECK(std::min(a.x, std::min(a.y, a.z)) >= 0.149F * lum);
    CHECK(std::max(a.x, std::max(a.y, a.z)) <= 3.01F * lum);
  }
}

TEST_CASE("the order of chunks never changes a bit; one row and one column work; unknown labels are one class") {
  Picture a = street({1.1F, 1, 0.9F}, Dark::shadow);
  Picture b = a;
  REQUIRE(a.run().ok());
  REQUIRE(b.run({}, true, npsim_test::BackwardExecutor{}).ok());
  CHECK(std::memcmp(a.albedo.data(), b.albedo.data(), a.albedo.size() * sizeof(Vec3f)) == 0);
  CHECK(std::memcmp(a.sun.data(), b.sun.data(), a.sun.size() * sizeof(float)) == 0);
  for (const Shape s : {Shape{1, 37}, Shape{53, 1}, Shape{1, 1}, Shape{3000, 7}}) {
    Picture p(s.width, s.height);
    for (std::size_t i = 0; i < p.day.size(); ++i) {
      p.day[i] = {static_cast<std::uint8_t>(i), 100, 90};
      p.labels[i] = static_cast<Label>(i % 2 == 0 ? 200 : 255);
    }
    REQUIRE(p.run().ok());
    for (const Vec3f& out : p.albedo) CHECK_UNARY(is_finite(out) && out.x >= 0.01F);
  }
}

TEST_CASE("albedo: strided views, and refusals") {
  Picture p = street({1, 1, 1});
  REQUIRE(p.run().ok());
  npsim_test::Scratch scratch(estimate_albedo_workspace_bytes({}, p.shape));
  const Shape part{100, 60};
  std::vector<Vec3f> wide(200 * 60, Vec3f{-1, -1, -1});
  std::vector<Vec3f> dense(part.pixels());
  std::vector<Rgb8> day_copy(part.pixels());
  std::vector<Label> label_copy(part.pixels());
  AlbedoScene strided;
  strided.image = p.scene().image.sub(30, 100, part);
  strided.labels = p.scene().labels.sub(30, 100, part);
  for (int y = 0; y < part.height; ++y) {
    for (int x = 0; x < part.width; ++x) {
      day_copy[static_cast<std::size_t>(y * 100 + x)] = strided.image(x, y);
      label_copy[static_cast<std::size_t>(y * 100 + x)] = strided.labels(x, y);
    }
  }
  AlbedoScene copied;
  copied.image = ImageView<const Rgb8>(day_copy.data(), part);
  copied.labels = ImageView<const Label>(label_copy.data(), part);
  SerialExecutor serial;
  DaylightReport report;
  const auto run = [&](const AlbedoParams& params, const AlbedoScene& scene, Workspace& workspace,
                       ImageView<Vec3f> out) {
    return estimate_albedo(params, scene, workspace, {out, {}}, report, serial).code();
  };
  const ImageView<Vec3f> output(dense.data(), part);
  REQUIRE(run({}, strided, scratch.workspace(), ImageView<Vec3f>(wide.data(), part, 200)) == StatusCode::ok);
  REQUIRE(run({}, copied, scratch.workspace(), output) == StatusCode::ok);
  for (int y = 0; y < part.height; ++y) {
    for (int x = 0; x < part.width; ++x) {
      CHECK_UNARY(wide[static_cast<std::size_t>(y * 200 + x)] == dense[static_cast<std::size_t>(y * 100 + x)]);
    }
    CHECK_UNARY(wide[static_cast<std::size_t>(y * 200 + 100)].x == -1.0F);
  }
  AlbedoParams bad;
  bad.free_ratio = 1;
  CHECK(run(bad, copied, scratch.workspace(), output) == StatusCode::invalid_argument);
  CHECK(run({}, copied, scratch.workspace(), ImageView<Vec3f>(dense.data(), {50, 60})) == StatusCode::shape_mismatch);
  npsim_test::Scratch tiny(1000);
  CHECK(run({}, copied, tiny.workspace(), output) == StatusCode::workspace_exhausted);
}

TEST_CASE("roughness follows the label; the priors are usable") {
  std::vector<Label> labels = {label::road, label::building, label::car, 99};
  std::vector<float> alpha(4);
  SerialExecutor serial;
  const Shape shape{2, 2};
  REQUIRE(estimate_roughness(ImageView<const Label>(labels.data(), shape), {}, ImageView<float>(alpha.data(), shape),
                             serial)
              .ok());
  CHECK(alpha[0] == surface_prior(label::road).alpha);
  CHECK(alpha[2] < alpha[1]);
  CHECK(alpha[3] == surface_prior(label::unlabeled).alpha);
  CHECK(alpha[1] == surface_prior(label::building).alpha);
  // A wide gloss makes what is narrow wide, and nothing else.
  labels = {label::road, label::car, label::bicycle, label::building};
  const ImageView<float> out(alpha.data(), shape);
  REQUIRE(estimate_roughness(ImageView<const Label>(labels.data(), shape),
                             {kVehicleLabels | LabelSet::of(label::bicycle), 0.7F}, out, serial)
              .ok());
  CHECK(alpha[0] == surface_prior(label::road).alpha);
  CHECK(alpha[1] == 0.7F);
  CHECK(alpha[2] == kMatt);
  CHECK(alpha[3] == surface_prior(label::building).alpha);
  REQUIRE(estimate_roughness(ImageView<const Label>(labels.data(), shape), {kVehicleLabels}, out, serial).ok());
  CHECK(alpha[1] == 1.0F);  // as wide as GGX goes
  CHECK(estimate_roughness(ImageView<const Label>(labels.data(), shape), {kVehicleLabels, 1.1F}, out, serial).code() ==
        StatusCode::invalid_argument);
  for (const SurfacePrior& s : kSurfacePriors) {
    CHECK_UNARY(s.albedo > 0.02F && s.albedo < 0.9F && s.alpha > 0.0F && (s.alpha <= 1.0F || s.alpha == kMatt));
  }
}
