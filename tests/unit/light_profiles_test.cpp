// SPDX-License-Identifier: Apache-2.0
// Emission profiles: range, flux by quadrature against the stated constants, and the test points of UN R112.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "npsim/core/random.hpp"
#include "npsim/light/detail/low_beam.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/light/photometry.hpp"

namespace {

using namespace npsim;

constexpr double kPi = 3.14159265358979323846;
constexpr EmissionProfile kProfiles[] = {EmissionProfile::lambert,   EmissionProfile::street_luminaire,
                                         EmissionProfile::low_beam,  EmissionProfile::signal,
                                         EmissionProfile::lantern,   EmissionProfile::hung_luminaire,
                                         EmissionProfile::high_beam, EmissionProfile::low_beam_left};

Emitter emitter_with(EmissionProfile profile) {
  Emitter e;
  e.axis = {0, 0, 1};
  e.up = {0, -1, 0};
  e.profile = profile;
  return e;
}

// Luminous intensity of the nominal low beam at angles in degrees, left and down negative.
double low_beam_at(double h_deg, double v_deg) {
  using F = simd::scalar::F32;
  const double d = kPi / 180;
  return static_cast<double>(
      low_beam_cd<F>(static_cast<float>(std::tan(h_deg * d)), static_cast<float>(std::tan(v_deg * d)), 1.0F).value);
}

Vec3f random_direction(RandomStream& r) {
  for (int i = 0; i < 100; ++i) {
    const Vec3f v{r.uniform(-1, 1), r.uniform(-1, 1), r.uniform(-1, 1)};
    const float l = length(v);
    if (l > 0.1F && l < 1) return v / l;
  }
  return {0, 0, 1};
}

}  // namespace

TEST_CASE("profiles stay in [0, 1] in every direction and reach 1 at their peak") {
  RandomStream random(7, RandomPurpose::test, 0, 0, 0, 0);
  for (const EmissionProfile profile : kProfiles) {
    const Emitter e = emitter_with(profile);
    float peak = 0;
    for (std::uint32_t i = 0; i < 300; ++i) {
      random = RandomStream(7, RandomPurpose::test, 0, 0, i, 0);
      const float value = relative_intensity(e, random_direction(random));
      CHECK(value >= 0.0F);
      CHECK(value <= 1.0F);
    }
    for (int i = -600; i <= 600; ++i) {
      for (int j = -600; j <= 600; ++j) {
        const float scale = is_headlamp_profile(profile) ? 1e-4F : 5e-3F;
        const Vec3f d = normalized(Vec3f{static_cast<float>(i) * scale, static_cast<float>(j) * scale, 1.0F});
        peak = std::max(peak, relative_intensity(e, d));
      }
    }
    CHECK(peak <= 1.0F);
    CHECK(peak > 0.9995F);
  }
}

TEST_CASE("a direction of NaN gives no light") {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const EmissionProfile profile : kProfiles) {
    CHECK(relative_intensity(emitter_with(profile), {nan, nan, nan}) == 0.0F);
  }
}

TEST_CASE("road luminaires: cut off as the classes of EN 13201-2 ask, over the road more than at the houses") {
  // Intensity in cd per klm at an angle from straight down; across: 1 over the road, -1 towards the houses.
  const auto cd_per_klm = [](EmissionProfile profile, double degrees, double across) {
    Emitter e = emitter_with(profile);
    e.axis = {0, 1, 0};
    e.up = {0, 0, 1};  // the road is to the left
    const double g = degrees * kPi / 180;
    const double along = std::sqrt(1 - across * across);
    const Vec3f d{static_cast<float>(-std::sin(g) * across), static_cast<float>(std::cos(g)),
                  static_cast<float>(std::sin(g) * along)};
    return static_cast<double>(relative_intensity(e, d) * peak_intensity_cd(profile, 1000.0F, 1.0F));
  };
  struct Limit {
    EmissionProfile profile;
    double at_70;
  };
  for (const auto& [profile, at_70] :
       {Limit{EmissionProfile::street_luminaire, 350}, Limit{EmissionProfile::hung_luminaire, 500}}) {
    for (double across = -1; across <= 1; across += 0.1) {
      CHECK(cd_per_klm(profile, 70, across) <= at_70);
      CHECK(cd_per_klm(profile, 80, across) <= 100);
      for (double degrees = 90; degrees <= 180; degrees += 5) CHECK(cd_per_klm(profile, degrees, across) <= 1);
    }
    CHECK(cd_per_klm(profile, 120, 0) > 0.5);  // but is seen from everywhere
    CHECK(cd_per_klm(profile, 64, 0) > 1.4 * cd_per_klm(profile, 0, 0));
    CHECK(cd_per_klm(profile, 60, -1) < 0.25 * cd_per_klm(profile, 60, 0));
  }
  CHECK(cd_per_klm(EmissionProfile::street_luminaire, 60, 1) >
        3 * cd_per_klm(EmissionProfile::street_luminaire, 60, -1));
  CHECK(cd_per_klm(EmissionProfile::hung_luminaire, 60, 1) ==
        doctest::Approx(cd_per_klm(EmissionProfile::hung_luminaire, 60, -1)).epsilon(1e-5));
}

TEST_CASE("lantern: batwing along the road, half of the peak straight down, a glow upwards") {
  Emitter e = emitter_with(EmissionProfile::lantern);
  e.axis = {0, 1, 0};
  e.up = {0, 0, 1};  // the road
  const float c60 = 0.5F;
  const float s60 = std::sqrt(0.75F);
  CHECK(relative_intensity(e, {0, c60, s60}) == doctest::Approx(1.0).epsilon(1e-5));
  CHECK(relative_intensity(e, {0, c60, -s60}) == doctest::Approx(1.0).epsilon(1e-5));
  CHECK(relative_intensity(e, {0, 1, 0}) == doctest::Approx(0.505).epsilon(1e-5));
  CHECK(relative_intensity(e, {s60, c60, 0}) == doctest::Approx(0.01 + 0.99 * 0.25).epsilon(1e-5));
  CHECK(relative_intensity(e, {0, -1, 0}) == doctest::Approx(0.01).epsilon(1e-5));
}

TEST_CASE("flux of each profile: midpoint quadrature over the sphere agrees with the stated constant") {
  for (const EmissionProfile profile : kProfiles) {
    const Emitter e = emitter_with(profile);
    double flux = 0;
    if (is_headlamp_profile(profile)) {
      // The cut-off needs a fine grid: integrate over angles a, b with slopes tan a, tan b.
      const int n = 1200;
      for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) {
          // u^3 puts most samples near the axis.
          const double u = (i + 0.5) / n * 2 - 1;
          const double w = (j + 0.5) / n * 2 - 1;
          const double a = u * u * u * kPi / 2;
          const double b = w * w * w * kPi / 2;
          const double h = std::tan(a);
          const double v = std::tan(b);
          const double q = 1 + h * h + v * v;
          const double solid = (1 + h * h) * (1 + v * v) / (q * std::sqrt(q)) * (3 * u * u * kPi / 2) *
                               (3 * w * w * kPi / 2) * (2.0 / n) * (2.0 / n);
          const double c = 1 / std::sqrt(q);
          const Vec3f d{static_cast<float>(h * c), static_cast<float>(-v * c), static_cast<float>(c)};
          flux += static_cast<double>(relative_intensity(e, d)) * solid;
        }
      }
    } else {
      const int n = 500;
      for (int i = 0; i < n; ++i) {
        const double z = -1 + (i + 0.5) * 2 / n;
        const double s = std::sqrt(1 - z * z);
        for (int j = 0; j < n; ++j) {
          const double phi = (j + 0.5) * 2 * kPi / n;
          const Vec3f d{static_cast<float>(s * std::cos(phi)), static_cast<float>(s * std::sin(phi)),
                        static_cast<float>(z)};
          flux += static_cast<double>(relative_intensity(e, d)) * (2.0 / n) * (2 * kPi / n);
        }
      }
    }
    INFO("profile " << static_cast<int>(profile));
    // This grid resolves the kink of a luminaire's shield to 3e-5.
    const bool shielded = profile == EmissionProfile::street_luminaire || profile == EmissionProfile::hung_luminaire;
    const double tolerance = is_headlamp_profile(profile) ? 1e-3 : shielded ? 5e-5 : 1e-5;
    CHECK(flux == doctest::Approx(static_cast<double>(profile_flux_sr(profile))).epsilon(tolerance));
  }
}

TEST_CASE("left-hand traffic mirrors the low beam; a high beam reaches the horizon, and never less than the low beam") {
  Emitter right = emitter_with(EmissionProfile::low_beam);
  Emitter left = emitter_with(EmissionProfile::low_beam_left);
  Emitter high = emitter_with(EmissionProfile::high_beam);
  for (float h = -0.2F; h <= 0.2F; h += 0.01F) {
    for (float v = -0.1F; v <= 0.05F; v += 0.005F) {
      const Vec3f d = normalized(Vec3f{h, -v, 1});
      CHECK(relative_intensity(left, {-d.x, d.y, d.z}) == doctest::Approx(relative_intensity(right, d)).epsilon(1e-4));
      CHECK(relative_intensity(high, d) * kHighBeamPeakCd >= relative_intensity(right, d) * kLowBeamPeakCd * 0.999F);
    }
  }
  // The axis points 1 % down.
  CHECK(relative_intensity(high, normalized(Vec3f{0, -kLowBeamAim, 1})) * kHighBeamPeakCd > 40500.0F);  // H-V
}

TEST_CASE("low beam meets UN R112 class B for right-hand traffic over the stated range of strengths") {
  for (const double scale : {0.65, 1.0, 1.4}) {
    INFO("scale " << scale);
    CHECK(scale * low_beam_at(-3.43, 0.57) <= 350);     // B50L
    CHECK(scale * low_beam_at(2.5, 1.0) <= 1750);       // BR
    CHECK(scale * low_beam_at(1.15, -0.57) >= 10100);   // 75R
    CHECK(scale * low_beam_at(-3.43, -0.57) <= 10600);  // 75L
    CHECK(scale * low_beam_at(-3.43, -0.86) <= 13200);  // 50L
    CHECK(scale * low_beam_at(1.72, -0.86) >= 10100);   // 50R
    CHECK(scale * low_beam_at(0.0, -0.86) >= 5100);     // 50V
    CHECK(scale * low_beam_at(-9.0, -1.72) >= 1700);    // 25L
    CHECK(scale * low_beam_at(9.0, -1.72) >= 1700);     // 25R
    double zone3 = 0;
    for (double h = -8; h <= 8; h += 0.05) {
      const double lowest = h < -4 ? -(h + 4) / 4 : h < 0 ? 0.0 : h < 1.5 ? h : h < 6 ? 1.5 : 1.5 + (h - 6) / 4;
      for (double v = lowest; v <= 4; v += 0.05) zone3 = std::max(zone3, scale * low_beam_at(h, v));
    }
    CHECK(zone3 <= 625);
    double zone4 = 1e9;
    for (double h = -5.15; h <= 5.15; h += 0.05) {
      for (double v = -1.72; v <= -0.86; v += 0.02) zone4 = std::min(zone4, scale * low_beam_at(h, v));
    }
    CHECK(zone4 >= 2500);
  }
}

TEST_CASE("low beam: the cut-off is as sharp as R112 asks and lies where it asks") {
  double sharpest = 0;
  double where = 0;
  for (double v = -1.5; v < 0.5; v += 0.005) {
    const double g = std::log10(low_beam_at(-2.5, v) / low_beam_at(-2.5, v + 0.1));
    if (g > sharpest) {
      sharpest = g;
      where = v;
    }
  }
  CHECK(sharpest > 0.13);
  CHECK(sharpest < 0.40);
  CHECK(where == doctest::Approx(-0.573).epsilon(0.15));
}

TEST_CASE("low beam of an emitter: tilted axis and table agree, the kerb side is on its right") {
  Emitter e = emitter_with(EmissionProfile::low_beam);
  e.axis = normalized(Vec3f{0, kLowBeamAim, 1});
  e.up = normalized(Vec3f{0, -1, kLowBeamAim});
  const auto at = [&](double h_deg, double v_deg) {
    const double d = kPi / 180;
    return static_cast<double>(relative_intensity(e, normalized(Vec3f{static_cast<float>(std::tan(h_deg * d)),
                                                                      static_cast<float>(-std::tan(v_deg * d)), 1}))) *
           static_cast<double>(kLowBeamPeakCd);
  };
  CHECK(at(1.15, -0.57) == doctest::Approx(low_beam_at(1.15, -0.57)).epsilon(2e-3));
  CHECK(at(-3.43, 0.57) == doctest::Approx(low_beam_at(-3.43, 0.57)).epsilon(2e-2));
  CHECK(at(3, 0) > 10 * at(-3, 0));
  CHECK(relative_intensity(e, {0, 0, -1}) == 0.0F);
}

TEST_CASE("sample_point covers the parallelogram and nothing else") {
  Emitter e;
  e.centre_m = {1, 2, 3};
  e.half_u_m = {0.5F, 0, 0};
  e.half_v_m = {0, 0.25F, 0};
  CHECK(sample_point(e, {}, 0.5F, 0.5F) == e.centre_m);
  CHECK(sample_point(e, {}, 0, 0) == Vec3f{0.5F, 1.75F, 3});
  CHECK(sample_point(e, {}, 1, 1) == Vec3f{1.5F, 2.25F, 3});
}
