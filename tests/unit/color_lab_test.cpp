// SPDX-License-Identifier: Apache-2.0
// CIELAB and XYZ against the exact formulas in double and against published values.
#include <doctest/doctest.h>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "npsim/color/srgb.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"

namespace {

double exact_decode(double v) { return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4); }

double lab_f(double t) { return t > 216.0 / 24389.0 ? std::cbrt(t) : (24389.0 / 27.0 * t + 16.0) / 116.0; }

npsim::Vec3d exact_lab_of_linear(const npsim::Vec3d& rgb) {
  const npsim::Vec3d xyz = npsim::linear_srgb_to_xyz(rgb);
  const double fx = lab_f(xyz.x / 0.95047);
  const double fy = lab_f(xyz.y);
  const double fz = lab_f(xyz.z / 1.08883);
  return {116.0 * fy - 16.0, 500.0 * (fx - fy), 200.0 * (fy - fz)};
}

npsim::Vec3d exact_lab(const npsim::Rgb8& c) {
  return exact_lab_of_linear({exact_decode(c.r / 255.0), exact_decode(c.g / 255.0), exact_decode(c.b / 255.0)});
}

double difference(const npsim::Vec3f& a, const npsim::Vec3d& b) {
  return npsim::length(npsim::vec_cast<double>(a) - b);
}

constexpr double kDeltaEBound = 1.2e-4;

}  // namespace

TEST_CASE("8-bit colours reach the stated Delta E over a dense subset of the cube") {
  const npsim::SerialExecutor executor;
  // 52 = 255 / 5 + 1 levels a channel, and every grey.
  std::vector<npsim::Rgb8> colours;
  for (int r = 0; r < 256; r += 5) {
    for (int g = 0; g < 256; g += 5) {
      for (int b = 0; b < 256; b += 5) {
        colours.push_back({static_cast<std::uint8_t>(r), static_cast<std::uint8_t>(g), static_cast<std::uint8_t>(b)});
      }
    }
  }
  for (int v = 0; v < 256; ++v) {
    const auto u = static_cast<std::uint8_t>(v);
    colours.push_back({u, u, u});
  }
  std::vector<npsim::Vec3f> lab(colours.size());
  const npsim::Shape shape{static_cast<int>(colours.size()), 1};
  REQUIRE(npsim::srgb8_to_lab(npsim::ImageView<const npsim::Rgb8>(colours.data(), shape),
                              npsim::ImageView<npsim::Vec3f>(lab.data(), shape), executor)
              .ok());
  double worst = 0;
  int unequal = 0;
  for (std::size_t i = 0; i < colours.size(); ++i) {
    worst = std::fmax(worst, difference(lab[i], exact_lab(colours[i])));
    if (npsim::srgb8_to_lab(colours[i]) != lab[i]) ++unequal;
  }
  MESSAGE("largest Delta E " << worst);
  CHECK(worst <= kDeltaEBound);
  CHECK(unequal == 0);  // the single-colour form has the bits of the image form
}

TEST_CASE("encoded floats reach the stated Delta E, and both parts of the decoding function meet") {
  const npsim::SerialExecutor executor;
  std::vector<npsim::Vec3f> coded;
  npsim::RandomStream random(5, npsim::RandomPurpose::test, 0, 0, 0, 0);
  for (int i = 0; i < 100000; ++i) coded.push_back({random.uniform(), random.uniform(), random.uniform()});
  for (int i = 0; i <= 4000; ++i) {
    const float v = static_cast<float>(i) / 4000.0F;
    coded.push_back({v, v, v});
    coded.push_back({v, 0.0F, 1.0F});
    coded.push_back({0.0F, 1.0F, v});
  }
  for (const float v : {0.04045F, 0.040449996F, 0.040450003F}) coded.push_back({v, v, v});
  std::vector<npsim::Vec3f> lab(coded.size());
  const npsim::Shape shape{static_cast<int>(coded.size()), 1};
  REQUIRE(npsim::srgb_to_lab(npsim::ImageView<const npsim::Vec3f>(coded.data(), shape),
                             npsim::ImageView<npsim::Vec3f>(lab.data(), shape), executor)
              .ok());
  double worst = 0;
  for (std::size_t i = 0; i < coded.size(); ++i) {
    const npsim::Vec3d c = npsim::vec_cast<double>(coded[i]);
    worst = std::fmax(
        worst, difference(lab[i], exact_lab_of_linear({exact_decode(c.x), exact_decode(c.y), exact_decode(c.z)})));
  }
  MESSAGE("largest Delta E " << worst);
  CHECK(worst <= kDeltaEBound);
}

TEST_CASE("published CIELAB values of the sRGB primaries") {
  // Reference values for D65 and the CIE constants, to two decimals.
  const auto check = [](const npsim::Rgb8& c, float l, float a, float b) {
    const npsim::Vec3f lab = npsim::srgb8_to_lab(c);
    CHECK(std::fabs(lab.x - l) <= 0.015F);
    CHECK(std::fabs(lab.y - a) <= 0.015F);
    CHECK(std::fabs(lab.z - b) <= 0.015F);
  };
  check({255, 0, 0}, 53.24F, 80.09F, 67.20F);
  check({0, 255, 0}, 87.73F, -86.18F, 83.18F);
  check({0, 0, 255}, 32.30F, 79.19F, -107.86F);
  check({255, 255, 255}, 100.0F, 0.0F, 0.0F);
  check({0, 0, 0}, 0.0F, 0.0F, 0.0F);
}

TEST_CASE("greys have no colour") {
  for (int v = 0; v < 256; ++v) {
    const auto u = static_cast<std::uint8_t>(v);
    const npsim::Vec3f lab = npsim::srgb8_to_lab({u, u, u});
    CHECK(std::fabs(lab.y) <= 1.2e-4F);
    CHECK(std::fabs(lab.z) <= 1.2e-4F);
  }
}

TEST_CASE("the two parts of the CIELAB function meet at 216/24389") {
  const float edge = static_cast<float>(216.0 / 24389.0);
  const float below = npsim::linear_rgb_to_lab({edge * 0.99999F, edge * 0.99999F, edge * 0.99999F}).x;
  const float above = npsim::linear_rgb_to_lab({edge * 1.00001F, edge * 1.00001F, edge * 1.00001F}).x;
  CHECK(below == doctest::Approx(8.0).epsilon(1e-4));
  CHECK(above - below > 0.0F);
  CHECK(above - below < 5e-4F);
}

TEST_CASE("linear light brighter than white and below black keeps the formula, a NaN goes through") {
  const npsim::Vec3d colours[] = {{40.0, 3.0, 0.5}, {-0.001, 0.02, 0.3}, {1e-6, 2e-6, 1e-7}, {0.0, 0.0, 0.0}};
  for (const npsim::Vec3d& c : colours) {
    const npsim::Vec3f rounded = npsim::vec_cast<float>(c);
    CHECK(difference(npsim::linear_rgb_to_lab(rounded), exact_lab_of_linear(npsim::vec_cast<double>(rounded))) <= 5e-4);
  }
  const npsim::Vec3f lab = npsim::linear_rgb_to_lab({std::numeric_limits<float>::quiet_NaN(), 0.5F, 0.5F});
  CHECK(std::isnan(lab.x));
}

TEST_CASE("image forms agree with the single colour on strided views of any width") {
  const npsim::SerialExecutor executor;
  for (const int width : {1, 15, 16, 33}) {
    const int height = 18;
    const int stride = width + 3;
    const auto size = static_cast<std::size_t>(stride) * static_cast<std::size_t>(height);
    std::vector<npsim::Rgb8> coded(size);
    std::vector<npsim::Vec3f> linear(size);
    std::vector<npsim::Vec3f> lab(size, npsim::Vec3f{-9.0F, -9.0F, -9.0F});
    for (std::size_t i = 0; i < size; ++i) {
      coded[i] = {static_cast<std::uint8_t>(5 * i), static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(11 * i)};
      linear[i] = npsim::srgb_decode8(coded[i]);
    }
    const npsim::Shape shape{width, height};
    const npsim::ImageView<const npsim::Rgb8> coded_view(coded.data(), shape, stride);
    const npsim::ImageView<npsim::Vec3f> linear_view(linear.data(), shape, stride);
    const npsim::ImageView<npsim::Vec3f> lab_view(lab.data(), shape, stride);
    REQUIRE(npsim::srgb8_to_lab(coded_view, lab_view, executor).ok());
    REQUIRE(npsim::linear_to_lab(linear_view, linear_view, executor).ok());  // in place
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        REQUIRE(lab_view(x, y) == npsim::srgb8_to_lab(coded_view(x, y)));
        REQUIRE(lab_view(x, y) == linear_view(x, y));
      }
      REQUIRE((lab_view.row(y) + width)->x == -9.0F);
    }
    CHECK(npsim::srgb8_to_lab(coded_view, lab_view.sub(0, 0, {width, 2}), executor).code() ==
          npsim::StatusCode::shape_mismatch);
    CHECK(npsim::linear_to_lab(linear_view, lab_view.sub(0, 0, {width, 2}), executor).code() ==
          npsim::StatusCode::shape_mismatch);
  }
}

TEST_CASE("the XYZ matrices agree with the standard's digits and are inverse to each other") {
  const double standard[3][3] = {{0.4124, 0.3576, 0.1805}, {0.2126, 0.7152, 0.0722}, {0.0193, 0.1192, 0.9505}};
  const double standard_inverse[3][3] = {
      {3.2406, -1.5372, -0.4986}, {-0.9689, 1.8758, 0.0415}, {0.0557, -0.2040, 1.0570}};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      CHECK(std::fabs(npsim::kLinearSrgbToXyz.m[i][j] - standard[i][j]) <= 3e-4);
      CHECK(std::fabs(npsim::kXyzToLinearSrgb.m[i][j] - standard_inverse[i][j]) <= 4e-4);
    }
  }
  const npsim::Vec3d white = npsim::linear_srgb_to_xyz({1.0, 1.0, 1.0});
  CHECK(npsim::length(white - npsim::kWhiteD65Xyz) <= 1e-14);
  const npsim::Vec3d back = npsim::xyz_to_linear_srgb(npsim::linear_srgb_to_xyz({0.2, -0.3, 7.0}));
  CHECK(npsim::length(back - npsim::Vec3d{0.2, -0.3, 7.0}) <= 1e-13);
}
