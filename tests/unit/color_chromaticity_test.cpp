// SPDX-License-Identifier: Apache-2.0
// Colours of light against tabulated black bodies, published white points, and their own inverse.
#include <doctest/doctest.h>
#include <cmath>
#include <limits>

#include "npsim/color/chromaticity.hpp"
#include "npsim/core/random.hpp"

namespace {

using npsim::Chromaticity;
using npsim::Locus;
using npsim::Vec3f;

double luminance_y(const Vec3f& rgb) { return npsim::linear_srgb_to_xyz(npsim::vec_cast<double>(rgb)).y; }

void check_near(const Chromaticity& got, float x, float y, float tolerance) {
  CHECK(std::fabs(got.x - x) <= tolerance);
  CHECK(std::fabs(got.y - y) <= tolerance);
}

constexpr Chromaticity kLamps[] = {
    npsim::illuminant::kD65,
    npsim::illuminant::kA,
    npsim::illuminant::kLedB1,
    npsim::illuminant::kLedB2,
    npsim::illuminant::kLedB3,
    npsim::illuminant::kLedB4,
    npsim::illuminant::kLedV1,
    npsim::illuminant::kLedV2,
    npsim::illuminant::kHighPressureSodium1,
    npsim::illuminant::kHighPressureSodium2,
    npsim::illuminant::kMetalHalideWarm,
    npsim::illuminant::kMetalHalideNeutral,
    npsim::illuminant::kMercury,
};

}  // namespace

TEST_CASE("every lamp has luminance one and no negative channel") {
  for (const Chromaticity& lamp : kLamps) {
    const npsim::Result<Vec3f> rgb = npsim::xy_to_linear_srgb(lamp);
    REQUIRE(rgb.ok());
    CAPTURE(lamp.x);
    CHECK(luminance_y(rgb.value()) == doctest::Approx(1.0).epsilon(2e-7));
    CHECK(static_cast<double>(npsim::luminance(rgb.value())) == doctest::Approx(1.0).epsilon(2e-3));
    CHECK(rgb.value().x >= 0.0F);
    CHECK(rgb.value().y >= 0.0F);
    CHECK(rgb.value().z >= 0.0F);
  }
  const Vec3f sodium = npsim::xy_to_linear_srgb(npsim::illuminant::kHighPressureSodium1).value();
  CHECK(sodium.x > sodium.y);
  CHECK(sodium.y > sodium.z);
  CHECK(sodium.z == 0.0F);  // outside the gamut, mixed with white to its border
  const Vec3f white = npsim::xy_to_linear_srgb(npsim::illuminant::kD65).value();
  CHECK(white.x == doctest::Approx(1.0).epsilon(1e-3));
  CHECK(white.z == doctest::Approx(1.0).epsilon(1e-3));
}

TEST_CASE("a chromaticity inside the gamut survives the way to linear sRGB and back") {
  int inside = 0;
  npsim::RandomStream random(3, npsim::RandomPurpose::test, 0, 0, 0, 0);
  for (int i = 0; i < 500; ++i) {
    const Chromaticity xy{random.uniform(0.15F, 0.64F), random.uniform(0.06F, 0.6F)};
    if (xy.x + xy.y > 1.0F) continue;
    const npsim::Result<Vec3f> rgb = npsim::xy_to_linear_srgb(xy);
    REQUIRE(rgb.ok());
    CHECK(luminance_y(rgb.value()) == doctest::Approx(1.0).epsilon(1e-6));
    const npsim::Result<Chromaticity> back = npsim::linear_srgb_to_xy(rgb.value());
    REQUIRE(back.ok());
    if (rgb.value().x > 0.0F && rgb.value().y > 0.0F && rgb.value().z > 0.0F) {
      ++inside;
      check_near(back.value(), xy.x, xy.y, 1e-6F);
    } else {
      // Clipped: on the line from the chromaticity to white.
      const npsim::Vec3d w = npsim::kWhiteD65Xyz;
      const double wx = w.x / (w.x + w.y + w.z);
      const double wy = w.y / (w.x + w.y + w.z);
      const auto x = static_cast<double>(back.value().x);
      const auto y = static_cast<double>(back.value().y);
      const double cross = (x - wx) * (static_cast<double>(xy.y) - wy) - (y - wy) * (static_cast<double>(xy.x) - wx);
      CHECK(std::fabs(cross) <= 1e-6);
    }
  }
  CHECK(inside > 100);
}

TEST_CASE("the primaries come back from their published chromaticities") {
  const Vec3f red = npsim::xy_to_linear_srgb({0.64F, 0.33F}).value();
  CHECK(red.x == doctest::Approx(1.0 / npsim::kLinearSrgbToXyz.m[1][0]).epsilon(1e-5));
  CHECK(std::fabs(red.y) <= 1e-5F);
  CHECK(std::fabs(red.z) <= 1e-5F);
  check_near(npsim::linear_srgb_to_xy({0.0F, 3.0F, 0.0F}).value(), 0.30F, 0.60F, 1e-6F);
  check_near(npsim::linear_srgb_to_xy({0.0F, 0.0F, 0.01F}).value(), 0.15F, 0.06F, 1e-6F);
}

TEST_CASE("channel ratios are kept and scaled to luminance one") {
  const Vec3f rgb = npsim::ratios_to_linear_srgb(1.7F, 0.4F).value();
  CHECK(rgb.x / rgb.y == doctest::Approx(1.7).epsilon(1e-6));
  CHECK(rgb.z / rgb.y == doctest::Approx(0.4).epsilon(1e-6));
  CHECK(luminance_y(rgb) == doctest::Approx(1.0).epsilon(2e-7));
  CHECK(npsim::ratios_to_linear_srgb(0.0F, 0.0F).value().z == 0.0F);
}

TEST_CASE("the Planckian locus passes the chromaticities of black bodies") {
  // Tabulated black bodies, and illuminant A.
  const float table[][3] = {{2000, 0.5267F, 0.4133F}, {2856, 0.4476F, 0.4074F}, {3000, 0.4369F, 0.4041F},
                            {4000, 0.3805F, 0.3768F}, {5000, 0.3451F, 0.3516F}, {6500, 0.3135F, 0.3237F},
                            {10000, 0.2807F, 0.2884F}};
  for (const auto& row : table) {
    CAPTURE(row[0]);
    check_near(npsim::cct_to_xy(row[0], Locus::planckian).value(), row[1], row[2], 1e-3F);
  }
}

TEST_CASE("the daylight locus passes D50 and D65") {
  check_near(npsim::cct_to_xy(6504.0F, Locus::daylight).value(), 0.3127F, 0.3290F, 2e-4F);
  check_near(npsim::cct_to_xy(5003.0F, Locus::daylight).value(), 0.3457F, 0.3585F, 2e-4F);
}

TEST_CASE("the pieces of the loci join without a step and x falls with temperature") {
  const auto gap = [](float t, Locus locus) {
    const Chromaticity a = npsim::cct_to_xy(t, locus).value();
    const Chromaticity b = npsim::cct_to_xy(t + 0.01F, locus).value();
    return std::fabs(a.x - b.x) + std::fabs(a.y - b.y);
  };
  CHECK(gap(2222.0F, Locus::planckian) <= 2e-4F);
  CHECK(gap(4000.0F, Locus::planckian) <= 2e-4F);
  CHECK(gap(7000.0F, Locus::daylight) <= 2e-4F);
  for (const Locus locus : {Locus::planckian, Locus::daylight}) {
    float before = 1.0F;
    for (float t = locus == Locus::planckian ? 1667.0F : 4000.0F; t <= 25000.0F; t += 50.0F) {
      const float x = npsim::cct_to_xy(t, locus).value().x;
      CHECK(x < before);
      before = x;
    }
  }
}

TEST_CASE("what is no colour is refused") {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  for (const Chromaticity& xy : {Chromaticity{-0.1F, 0.3F}, Chromaticity{0.3F, 0.0F}, Chromaticity{0.7F, 0.5F},
                                 Chromaticity{kNan, 0.3F}, Chromaticity{0.3F, kNan}, Chromaticity{kInf, 0.3F}}) {
    CHECK(npsim::xy_to_linear_srgb(xy).status().code() == npsim::StatusCode::invalid_argument);
  }
  for (const Vec3f& rgb : {Vec3f{0, 0, 0}, Vec3f{-1, -1, -1}, Vec3f{kNan, 1, 1}, Vec3f{kInf, 1, 1}}) {
    CHECK_FALSE(npsim::linear_srgb_to_xy(rgb).ok());
  }
  CHECK_FALSE(npsim::ratios_to_linear_srgb(-0.1F, 1.0F).ok());
  CHECK_FALSE(npsim::ratios_to_linear_srgb(1.0F, kNan).ok());
  CHECK_FALSE(npsim::ratios_to_linear_srgb(kInf, 1.0F).ok());
  CHECK_FALSE(npsim::cct_to_xy(1600.0F, Locus::planckian).ok());
  CHECK_FALSE(npsim::cct_to_xy(3999.0F, Locus::daylight).ok());
  CHECK_FALSE(npsim::cct_to_xy(25001.0F, Locus::daylight).ok());
  CHECK_FALSE(npsim::cct_to_xy(kNan, Locus::planckian).ok());
}

// Colours of light are constants where their input is one.
static_assert(npsim::xy_to_linear_srgb(npsim::illuminant::kLedB3).value().y > 0.9F);
static_assert(npsim::cct_to_xy(2700.0F, Locus::planckian).ok());
