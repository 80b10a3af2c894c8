// SPDX-License-Identifier: Apache-2.0
// The sRGB transfer function against the exact formula in double, at all 256 codes and thresholds.
#include <doctest/doctest.h>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "npsim/color/srgb.hpp"
#include "npsim/core/executor.hpp"

namespace {

namespace simd = npsim::simd;
using Native = simd::F32;
using One = simd::scalar::F32;

long double exact_decode(long double v) { return v <= 0.04045L ? v / 12.92L : std::pow((v + 0.055L) / 1.055L, 2.4L); }

double exact_encode(double x) { return x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1.0 / 2.4) - 0.055; }

float float_of(std::uint32_t u) {
  float x = 0;
  std::memcpy(&x, &u, sizeof(x));
  return x;
}

std::uint32_t bits_of(float x) {
  std::uint32_t u = 0;
  std::memcpy(&u, &x, sizeof(u));
  return u;
}

}  // namespace

TEST_CASE("the 8-bit decode table holds the nearest floats") {
  for (int code = 0; code < 256; ++code) {
    const auto exact = static_cast<float>(exact_decode(static_cast<long double>(code) / 255.0L));
    CHECK(npsim::srgb_decode8(static_cast<std::uint8_t>(code)) == exact);
    CHECK(npsim::srgb_decode8<Native>(simd::I32(code)).lane(Native::lanes - 1) == exact);
  }
  static_assert(npsim::srgb_decode8(std::uint8_t{255}) == 1.0F);
  static_assert(npsim::srgb_decode8(std::uint8_t{0}) == 0.0F);
}

TEST_CASE("8-bit encoding rounds right at the floats on both sides of all 255 thresholds") {
  for (int code = 1; code < 256; ++code) {
    const long double edge = exact_decode((static_cast<long double>(code) - 0.5L) / 255.0L);
    auto above = static_cast<float>(edge);
    if (static_cast<long double>(above) < edge) above = std::nextafter(above, 2.0F);
    const float below = std::nextafter(above, 0.0F);
    CHECK(static_cast<int>(npsim::srgb_encode8(above)) == code);
    CHECK(static_cast<int>(npsim::srgb_encode8(below)) == code - 1);
    CHECK(npsim::srgb_encode8(Native(above)).lane(0) == code);
    CHECK(npsim::srgb_encode8(Native(below)).lane(Native::lanes - 1) == code - 1);
  }
}

TEST_CASE("8-bit codes survive a round trip") {
  for (int code = 0; code < 256; ++code) {
    const auto c = static_cast<std::uint8_t>(code);
    CHECK(npsim::srgb_encode8(npsim::srgb_decode8(c)) == c);
  }
}

TEST_CASE("8-bit encoding agrees with the exact formula over a dense sweep") {
  for (std::uint32_t u = 0; u <= bits_of(1.0F); u += 1009) {
    const float x = float_of(u);
    const auto exact = static_cast<int>(std::floor(exact_encode(static_cast<double>(x)) * 255.0 + 0.5));
    REQUIRE(static_cast<int>(npsim::srgb_encode8(x)) == exact);
  }
}

TEST_CASE("8-bit encoding clamps what is outside and maps a NaN to black") {
  constexpr float kInf = std::numeric_limits<float>::infinity();
  for (const float low : {-0.0F, -1e-9F, -5.0F, -kInf, std::numeric_limits<float>::quiet_NaN()}) {
    CHECK(static_cast<int>(npsim::srgb_encode8(low)) == 0);
    CHECK(npsim::srgb_encode8(Native(low)).lane(0) == 0);
  }
  for (const float high : {1.0F, 1.0000001F, 1e30F, kInf}) {
    CHECK(static_cast<int>(npsim::srgb_encode8(high)) == 255);
    CHECK(npsim::srgb_encode8(Native(high)).lane(0) == 255);
  }
}

TEST_CASE("float decode and encode stay within the stated error, with equal bits in one lane") {
  double decode_absolute = 0;
  double decode_relative = 0;
  double encode_absolute = 0;
  double encode_relative = 0;
  int unequal = 0;
  for (std::uint32_t u = 0x30000000U; u <= bits_of(1.0F); u += 307) {
    const float v = float_of(u);
    const double decoded = static_cast<double>(npsim::srgb_decode(Native(v)).lane(0));
    const double encoded = static_cast<double>(npsim::srgb_encode(Native(v)).lane(0));
    if (decoded != static_cast<double>(npsim::srgb_decode(v)) ||
        encoded != static_cast<double>(npsim::srgb_encode(v))) {
      ++unequal;
    }
    // The segments meet with a step of 1e-8 or so; floats of the limits choose the same segment as the exact ones.
    const auto exact_decoded = static_cast<double>(exact_decode(static_cast<long double>(v)));
    const double exact_encoded = exact_encode(static_cast<double>(v));
    const double decode_error = std::fabs(decoded - exact_decoded);
    const double encode_error = std::fabs(encoded - exact_encoded);
    decode_absolute = std::fmax(decode_absolute, decode_error);
    decode_relative = std::fmax(decode_relative, decode_error / exact_decoded);
    encode_absolute = std::fmax(encode_absolute, encode_error);
    encode_relative = std::fmax(encode_relative, encode_error / exact_encoded);
  }
  MESSAGE(decode_absolute << ' ' << decode_relative << ' ' << encode_absolute << ' ' << encode_relative);
  CHECK(decode_absolute <= 2.5e-7);
  CHECK(encode_absolute <= 2.5e-7);
  CHECK(decode_relative <= 4e-7);
  CHECK(encode_relative <= 4e-7);
  CHECK(unequal == 0);
}

TEST_CASE("the transfer function goes on below 0 and above 1, and keeps a NaN") {
  CHECK(npsim::srgb_encode(-0.01F) == -0.01F * 12.92F);
  CHECK(npsim::srgb_decode(-0.1F) == -0.1F / 12.92F);
  CHECK(npsim::srgb_encode(4.0F) == doctest::Approx(exact_encode(4.0)).epsilon(4e-7));
  CHECK(npsim::srgb_decode(1.5F) == doctest::Approx(static_cast<double>(exact_decode(1.5L))).epsilon(4e-7));
  CHECK(std::isnan(npsim::srgb_encode(std::numeric_limits<float>::quiet_NaN())));
  CHECK(std::isnan(npsim::srgb_decode(std::numeric_limits<float>::quiet_NaN())));
}

TEST_CASE("images convert pixel by pixel on strided views of any width") {
  const npsim::SerialExecutor executor;
  for (const int width : {1, 3, 16, 17, 37}) {
    const int height = 19;  // more than one chunk of rows
    const int stride = width + 5;
    const auto size = static_cast<std::size_t>(stride) * static_cast<std::size_t>(height);
    std::vector<npsim::Rgb8> coded(size);
    std::vector<npsim::Vec3f> linear(size, npsim::Vec3f{-9.0F, -9.0F, -9.0F});
    std::vector<npsim::Rgb8> back(size, npsim::Rgb8{7, 7, 7});
    for (std::size_t i = 0; i < size; ++i) {
      coded[i] = {static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(3 * i), static_cast<std::uint8_t>(255 - i)};
    }
    const npsim::Shape shape{width, height};
    const npsim::ImageView<npsim::Rgb8> coded_view(coded.data(), shape, stride);
    const npsim::ImageView<npsim::Vec3f> linear_view(linear.data(), shape, stride);
    const npsim::ImageView<npsim::Rgb8> back_view(back.data(), shape, stride);
    REQUIRE(npsim::srgb8_to_linear(coded_view, linear_view, executor).ok());
    REQUIRE(npsim::linear_to_srgb8(linear_view, back_view, executor).ok());
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < stride; ++x) {
        const npsim::Rgb8 expected = x < width ? *(coded_view.row(y) + x) : npsim::Rgb8{7, 7, 7};
        const npsim::Rgb8 got = *(back_view.row(y) + x);
        REQUIRE(got.r == expected.r);
        REQUIRE(got.g == expected.g);
        REQUIRE(got.b == expected.b);
        if (x >= width) REQUIRE((linear_view.row(y) + x)->x == -9.0F);
      }
    }
    CHECK(npsim::srgb8_to_linear(coded_view, linear_view.sub(0, 0, {width, height - 1}), executor).code() ==
          npsim::StatusCode::shape_mismatch);
    CHECK(npsim::linear_to_srgb8(linear_view, back_view.sub(0, 0, {width, height - 1}), executor).code() ==
          npsim::StatusCode::shape_mismatch);
  }
  CHECK(npsim::linear_to_srgb8(npsim::ImageView<const npsim::Vec3f>(), npsim::ImageView<npsim::Rgb8>(), executor).ok());
}
