// SPDX-License-Identifier: Apache-2.0
// Photometry: numbers that anybody with a lux meter can check, chromaticity, sky and picking.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "npsim/core/random.hpp"
#include "npsim/light/activation.hpp"
#include "npsim/light/light_set.hpp"
#include "npsim/light/photometry.hpp"

namespace {
using namespace npsim;
constexpr double kPi = 3.14159265358979323846;
}  // namespace

TEST_CASE("a street lamp of 10 klm at 8 m: tens of lux below it, about 1 cd/m2 on asphalt") {
  Emitter lamp;
  lamp.profile = EmissionProfile::street_luminaire;
  lamp.axis = {0, 1, 0};
  lamp.up = {0, 0, 1};
  const float peak = peak_intensity_cd(lamp.profile, 10000.0F, 0.05F);
  const double below_lx = static_cast<double>(peak * relative_intensity(lamp, {0, 1, 0})) / 64;
  CHECK(below_lx > 20);
  CHECK(below_lx < 50);
  const double road = below_lx * 0.1 / kPi;  // Lambert, albedo of aged asphalt
  CHECK(road > 0.5);
  CHECK(road < 2.0);
  // Mean over 30 m of a road 7 m wide: EN 13201 classes M1-M5 ask for 0.5 to 2 cd/m2.
  double sum = 0;
  int n = 0;
  for (double z = -15; z <= 15; z += 0.25) {
    for (double x = 0; x <= 7; x += 0.25, ++n) {
      const double d2 = x * x + z * z + 64;
      const double d = std::sqrt(d2);
      const Vec3f dir{static_cast<float>(x / d), static_cast<float>(8 / d), static_cast<float>(z / d)};
      sum += static_cast<double>(peak * relative_intensity(lamp, dir)) * (8 / d) / d2;
    }
  }
  CHECK(sum / n * 0.1 / kPi > 0.3);
  CHECK(sum / n * 0.1 / kPi < 2.0);
}

TEST_CASE("a Lambert patch shows its strength as luminance, from wherever it is seen, and L times area as intensity") {
  Emitter e;
  e.profile = EmissionProfile::lambert;
  e.centre_m = {3, -2, 12};
  e.axis = normalized(Vec3f{-0.5F, 0, -1});
  e.area_m2 = 1.7F;
  const Activation a = make_activation(e, true, 0.5F, 20.0F, {0.3127F, 0.3290F});
  CHECK(luminance(a.luminance_cd_m2) == doctest::Approx(20.0).epsilon(1e-5));
  CHECK(luminance(a.intensity_cd) == doctest::Approx(34.0).epsilon(1e-5));
}

TEST_CASE("what the pixels of a lamp show adds up to its intensity towards the camera") {
  Emitter e;
  e.profile = EmissionProfile::signal;
  e.centre_m = {4, -3, 10};
  e.axis = normalized(Vec3f{0, 0, -1});
  e.area_m2 = 0.03F;
  const float peak = 100;
  const double distance = static_cast<double>(length(e.centre_m));
  const double projected = static_cast<double>(e.area_m2) * 10 / distance;  // image-parallel area seen along the ray
  const double towards = static_cast<double>(peak * relative_intensity(e, normalized(-e.centre_m)));
  CHECK(static_cast<double>(seen_luminance_cd_m2(e, peak)) * projected == doctest::Approx(towards).epsilon(1e-5));
  e.area_m2 = 1e-9F;
  CHECK(seen_luminance_cd_m2(e, peak) == luminance_cap_cd_m2(EmissionProfile::signal));
  e.area_m2 = 0;
  CHECK(seen_luminance_cd_m2(e, peak) == 0.0F);
}

TEST_CASE("a green signal of 200 cd over a 200 mm disc shows 6400 cd/m2") {
  Emitter e;
  e.profile = EmissionProfile::signal;
  e.centre_m = {0, 0, 30};
  e.axis = {0, 0, -1};
  e.area_m2 = static_cast<float>(kPi * 0.1 * 0.1);
  CHECK(seen_luminance_cd_m2(e, 200) == doctest::Approx(6366).epsilon(1e-3));
}

TEST_CASE("light colours have luminance 1, the right hue, and keep their chromaticity inside the gamut") {
  using namespace chromaticity;
  for (const Vec2f xy : {k2700, k4000, k6500, led_b1, led_b2, led_b3, led_b4, led_v1, led_v2, hp1, hp2, signal_red,
                         signal_amber, signal_green, rear_red}) {
    const Vec3f rgb = light_rgb(xy);
    CHECK(luminance(rgb) == doctest::Approx(1.0).epsilon(1e-5));
    CHECK(rgb.x >= 0.0F);
    CHECK(rgb.y >= 0.0F);
    CHECK(rgb.z >= 0.0F);
    if (rgb.x > 0 && rgb.y > 0 && rgb.z > 0) {
      const Vec2f back = light_xy(rgb);
      CHECK(back.x == doctest::Approx(static_cast<double>(xy.x)).epsilon(1e-3));
      CHECK(back.y == doctest::Approx(static_cast<double>(xy.y)).epsilon(1e-3));
    }
  }
  CHECK(light_rgb(signal_red).x > 10 * light_rgb(signal_red).y);
  CHECK(light_rgb(signal_green).y > 2 * light_rgb(signal_green).x);
  CHECK(light_rgb(rear_red).y == doctest::Approx(0.0));
  const Vec3f white = light_rgb({0.3127F, 0.3290F});
  CHECK(white.x == doctest::Approx(1.0).epsilon(2e-3));
  CHECK(white.z == doctest::Approx(1.0).epsilon(2e-3));
  CHECK(light_rgb({0.3F, 0.0F}) == Vec3f{1, 1, 1});  // no luminance at all
}

TEST_CASE("sky: brightest at the horizon, dark from below, illuminance equals the integral") {
  SkyParams sky;
  sky.up = normalized(Vec3f{0.05F, -1, 0.1F});
  CHECK(luminance(sky_luminance(sky, sky.up)) == doctest::Approx(0.042).epsilon(2e-3));
  const Vec3f horizontal = normalized(cross(sky.up, Vec3f{1, 0, 0}));
  CHECK(luminance(sky_luminance(sky, horizontal + sky.up * 1e-6F)) == doctest::Approx(0.1).epsilon(2e-3));
  CHECK(sky_luminance(sky, -sky.up) == Vec3f{});
  sky.up = {0, -1, 0};
  Vec3d sum;
  const int n = 2000;
  for (int i = 0; i < n; ++i) {
    const double s = (i + 0.5) / n;
    const Vec3f d{static_cast<float>(std::sqrt(1 - s * s)), static_cast<float>(-s), 0};
    sum += vec_cast<double>(sky_luminance(sky, d)) * (2 * kPi * s / n);
  }
  const auto pi = static_cast<float>(kPi);
  const Vec3f level = sky.zenith_cd_m2 * pi + (sky.horizon_cd_m2 - sky.zenith_cd_m2) * (pi / 15.0F);
  CHECK(static_cast<double>(level.x) == doctest::Approx(sum.x).epsilon(1e-4));
  CHECK(static_cast<double>(level.y) == doctest::Approx(sum.y).epsilon(1e-4));
  CHECK(static_cast<double>(level.z) == doctest::Approx(sum.z).epsilon(1e-4));
  CHECK(luminance(level) > 0.03);  // darker than the full moon's 0.25 lx
  CHECK(luminance(level) < 0.25);
}
