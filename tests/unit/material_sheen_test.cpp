// SPDX-License-Identifier: Apache-2.0
// What surfaces mirror by day is not in their albedo: roads at a grazing angle, cars, in sun, shade and under clouds.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "day_picture.hpp"
#include "npsim/material/albedo.hpp"
#include "npsim/material/bsdf.hpp"

namespace {

using namespace npsim;

using npsim_test::contrast;
using npsim_test::encode;
using npsim_test::Ground;
using npsim_test::level_road;
using npsim_test::Picture;

}  // namespace

TEST_CASE("paint on a road that mirrors a cloudy sky is as much whiter than its asphalt as it is, near and far") {
  const SpecularAlbedo interface(surface_prior(label::road).alpha, 0.04F);
  const auto painted = [](float across, float) { return std::fabs(std::fabs(across) - 1.3F) < 0.25F; };
  const Picture p = level_road([&](float across, float away) {
    const float albedo = painted(across, away) ? 0.5F : 0.1F;
    const float mirrored = interface(1.5F / std::sqrt(across * across + away * away + 1.5F * 1.5F));
    const float seen = 0.8F * (albedo * (1.0F - mirrored) + mirrored);
    return Vec3f{seen, seen, seen};
  });
  CHECK(p.median(label::road) == doctest::Approx(0.1).epsilon(0.05));
  for (const int first_row : {170, 240}) CHECK(contrast(p, painted, first_row) == doctest::Approx(5).epsilon(0.08));
  Picture unlabeled = p;
  REQUIRE(Ground().run(unlabeled, false).ok());
  CHECK(contrast(unlabeled, painted, 240) == doctest::Approx(5).epsilon(0.08));
  // Without a road the scale is that of houses, and pavement stays on it.
  Picture square = p;
  for (Label& l : square.labels) l = l == label::road ? label::sidewalk : l;
  REQUIRE(Ground().run(square, true).ok());
  CHECK(square.median(label::sidewalk) ==
        doctest::Approx(static_cast<double>(surface_prior(label::building).albedo)).epsilon(0.05));
}

TEST_CASE("a car's side that is seen from above mirrors the street, what leans back the sky, cloth nothing") {
  using daylight_detail::mirrored_by;
  const Vec3f up{0, -1, 0};
  const Vec3f upright{0, 0, -1};
  const auto down = [](float degrees) {  // a sight
    const float turn = degrees * 0.01745329F;
    return Vec3f{0, std::sin(turn), std::cos(turn)};
  };
  const auto side = mirrored_by(0.1F, down(10), upright, up);
  CHECK(side.sky == 0.0F);
  CHECK(side.street == doctest::Approx(0.04 * 0.1).epsilon(0.1));
  CHECK(side.through == doctest::Approx(0.96).epsilon(0.01));
  const auto level = mirrored_by(0.1F, down(0), upright, up);  // roofs and crowns hide seven tenths
  CHECK(level.sky == doctest::Approx(0.04 * 0.3 * 3 / 7).epsilon(0.1));
  CHECK(level.street == doctest::Approx(0.04 * 0.7 * 0.1).epsilon(0.1));
  const auto back = mirrored_by(0.1F, down(30), down(30) * -1.0F, up);  // shows what is 30 degrees up
  CHECK(back.sky == doctest::Approx(0.04 * 2 * 3 / 7).epsilon(0.1));
  CHECK(back.street == 0.0F);
  const auto bonnet = mirrored_by(0.1F, down(14.5F), up, up);
  CHECK(bonnet.through == doctest::Approx(0.8).epsilon(0.01));  // a smooth one: .73
  CHECK(mirrored_by(0.1F, down(2), up, up).through == doctest::Approx(bonnet.through).epsilon(0.001));  // at most
  CHECK(mirrored_by(kMatt, down(2), up, up).through == 1.0F);
  CHECK(mirrored_by(kMatt, down(30), down(30) * -1.0F, up).sky == 0.0F);
}

TEST_CASE("a black bonnet under a sky ten thousand times as bright is as black as paint can be") {
  Picture p = level_road([](float, float) { return Vec3f{1, 1, 1}; });
  p.instances.assign(p.shape.pixels(), 0);
  Ground ground;  // whose normals face up
  for (int y = 140; y < 200; ++y) {
    for (int x = 100; x < 300; ++x) {
      p.labels[p.i(x, y)] = label::car;
      p.instances[p.i(x, y)] = 26001;
      p.day[p.i(x, y)] = {};
      ground.depth[p.i(x, y)] = 8.0F;
    }
  }
  REQUIRE(ground.run(p, true).ok());
  CHECK(p.median(label::car) / 0.015 == doctest::Approx(1).epsilon(0.01));
}

TEST_CASE("what paint mirrors of a cloudy day is not in its albedo: black stays black, dark red stays red") {
  // Rears that lean by 20 degrees, 8 m away, and one of cloth. What they mirror: 4 % at right angles (Schlick) of the
  // sky as bright as a cloudy one (CIE) by its elevation, over a street of .1 up to a sine of .35.
  const Vec3f paints[] = {{0.02F, 0.02F, 0.02F}, {0.12F, 0.02F, 0.02F}, {0.6F, 0.6F, 0.6F}, {0.02F, 0.02F, 0.02F}};
  const Vec3f normal{0, -0.342F, -0.94F};
  const Vec3f cast{0.85F, 1.05F, 0.9F};  // of the whole picture; what is mirrored is a little bluer
  Picture p = level_road([&](float, float) { return cast * 0.24F; });
  p.instances.assign(p.shape.pixels(), 0);
  Ground ground;
  for (int k = 0; k < 4; ++k) {
    const bool cloth = k == 3;
    for (int y = 140; y < 200; ++y) {
      for (int x = 40 + 100 * k; x < 120 + 100 * k; ++x) {
        const std::size_t i = p.i(x, y);
        p.labels[i] = cloth ? label::person : label::truck;
        p.instances[i] = static_cast<std::uint16_t>(1 + k);
        ground.depth[i] = 8.0F;
        ground.normals[i] = normal;
        const Vec3d sight = normalized(Vec3d{(x + 0.5 - 240) / 400, (y + 0.5 - 120) / 400, 1});
        const double cosine = -dot(sight, vec_cast<double>(normal));
        const double up = -(sight.y + 2 * cosine * static_cast<double>(normal.y));
        const double fresnel = 0.04 + 0.96 * std::pow(1 - cosine, 5);
        const double over = std::max(0.0, std::min(1.0, (up + 0.15) / 0.5));
        const double shown = cloth ? 0.0 : fresnel * (over * (1 + 2 * std::max(up, 0.0)) * 3 / 7 + (1 - over) * 0.1);
        const auto sheen = static_cast<float>(shown);
        const float through = cloth ? 1.0F : 1.0F - static_cast<float>(fresnel);
        const float light = (0.45F + 0.55F * 0.342F) * through;
        const Vec3f seen =
            cast * (paints[k] * light + Vec3f{0.9F, 1.0F, 1.15F} * sheen) * 2.4F;  // the road of .1 looks like .24
        p.day[i] = {encode(seen.x), encode(seen.y), encode(seen.z)};
      }
    }
  }
  REQUIRE(ground.run(p, true).ok());
  const auto of = [&](int k) { return mean(p, 50 + 100 * k, 110 + 100 * k, 150, 190); };
  CHECK(of(0) < 0.045);  // looks like .11
  const Vec3f black = p.albedo[p.i(80, 170)];
  CHECK(max_of(black.x, black.y, black.z) < 1.5F * std::min(black.x, std::min(black.y, black.z)));
  CHECK(of(2) == doctest::Approx(0.6).epsilon(0.1));
  CHECK(of(3) == doctest::Approx(0.025).epsilon(0.1));
  const Vec3f red = p.albedo[p.i(180, 170)];
  CHECK(red.x > 3.0F * red.y);  // looks like 1.9
  CHECK(red.x == doctest::Approx(0.12F).epsilon(0.25));
}

TEST_CASE(
    "black paint that turns away from the sun mirrors the sunlit road before it, which is brighter than the paint") {
  const float paints[] = {0.02F, 0.3F, 0.2F, 0.3F};
  const Vec3f sky{0.13F, 0.155F, 0.21F};  // light of the shade over that of the sun
  // In the shade left of the first of the trucks the road is as dark as the sky alone lights it.
  Picture p = level_road([&](float across, float) {
    return across < -2.0F ? sky * 0.24F : Vec3f{0.24F, 0.24F, 0.24F};
  });
  p.instances.assign(p.shape.pixels(), 0);
  Ground ground;
  for (int k = 0; k < 4; ++k) {
    for (int y = 140; y < 200; ++y) {
      for (int x = 200 + 68 * k; x < 260 + 68 * k; ++x) {
        const std::size_t i = p.i(x, y);
        p.labels[i] = label::truck;
        p.instances[i] = static_cast<std::uint16_t>(1 + k);
        ground.depth[i] = 8.0F;
        ground.normals[i] = {0, 0, -1};
        constexpr float kMirrored = 0.04F;
        const Vec3f light = (sky * 0.5F + Vec3f{0.1F, 0.1F, 0.1F}) * (1.0F - kMirrored);
        const Vec3f seen = (light * paints[k] + Vec3f{0.1F, 0.1F, 0.1F} * kMirrored) * 2.4F;
        p.day[i] = {encode(seen.x), encode(seen.y), encode(seen.z)};
      }
    }
  }
  REQUIRE(ground.run(p, true).ok());
  REQUIRE(p.report.shadow);
  const auto of = [&](int k) { return mean(p, 210 + 68 * k, 250 + 68 * k, 150, 190); };
  CHECK(of(0) < 0.03);  // looks like .043
  CHECK(of(1) == doctest::Approx(0.3).epsilon(0.2));
}

TEST_CASE("of the cast of a road that mirrors the sky the stated share is left") {
  Picture p = level_road([](float, float) { return Vec3f{0.102F, 0.12F, 0.15F}; });
  REQUIRE(Ground().run(p, true).ok());
  double log_ratio[2] = {};
  int n = 0;
  for (int y = 200; y < 265; ++y) {
    for (int x = 0; x < 480; ++x, ++n) {
      const Vec3d a = vec_cast<double>(p.albedo[p.i(x, y)]);
      log_ratio[0] += std::log2(a.x / a.y);
      log_ratio[1] += std::log2(a.z / a.y);
    }
  }
  const double left = 1.0 - static_cast<double>(AlbedoParams().cast_removal);
  CHECK(log_ratio[0] / n == doctest::Approx(left * std::log2(0.102 / 0.12)).epsilon(0.012));
  CHECK(log_ratio[1] / n == doctest::Approx(left * std::log2(0.15 / 0.12)).epsilon(0.012));
}

TEST_CASE(
    "paint on a road that mirrors sun and sky is as white as it is in the sun and in the shade; a lawn mirrors none") {
  constexpr float kPi = 3.14159265F;
  const float alpha = surface_prior(label::road).alpha;
  const SpecularAlbedo interface(alpha, 0.04F);
  const Vec3f to_sun = normalized(Vec3f{-1, 1.5F, -1});  // x right, y up, z ahead: behind the camera
  const auto light = [&](float across, float away, float albedo) {
    const Vec3f to_camera = normalized(Vec3f{-across, 1.5F, -away});
    const float mirrored = interface(to_camera.y);
    const float f = eval_bsdf({albedo, albedo, albedo}, alpha, 0.04F, {0, 1, 0}, to_camera, to_sun).x;
    const float sun = across < -0.4F ? 0.0F : 5.0F * kPi * f;
    const float sky = albedo * (1.0F - mirrored) + mirrored;
    return Vec3f{0.22F * sky + 0.26F * sun, 0.25F * (sky + sun), 0.32F * sky + 0.2F * sun};
  };
  const auto painted = [](float across, float) { return std::fabs(std::fabs(across) - 1.3F) < 0.25F; };
  Picture p =
      level_road([&](float across, float away) { return light(across, away, painted(across, away) ? 0.5F : 0.1F); });
  REQUIRE(p.report.shadow);
  // Paint over asphalt on one side of the street.
  const auto on_side = [&](float side, int first_row) {
    return contrast(p, painted, first_row, [side](float across, float) { return !(across * side < 0.6F); });
  };
  CHECK(on_side(-1.0F, 190) == doctest::Approx(5).epsilon(0.08));
  CHECK(on_side(1.0F, 190) == doctest::Approx(5).epsilon(0.08));
  // The same picture of grass, which has no interface, is left as it looks.
  for (int y = 135; y < 270; ++y) {
    for (int x = 300; x < 480; ++x) p.labels[p.i(x, y)] = label::terrain;
  }
  REQUIRE(Ground().run(p, true).ok());
  CHECK(on_side(1.0F, 240) < 4.3);
}
