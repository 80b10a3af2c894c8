// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "npsim/core/executor.hpp"
#include "npsim/sensor/isp.hpp"
#include "npsim/sensor/noise.hpp"
#include "fixture.hpp"

namespace {

using npsim::ImageView;
using npsim::NoiseParams;
using npsim::Shape;
using npsim::Vec3f;

struct Image {
  std::vector<Vec3f> pixels;
  Shape shape;
  Image(int width, int height, Vec3f value = {}) : pixels(Shape{width, height}.pixels(), value), shape{width, height} {}
  ImageView<Vec3f> view() { return {pixels.data(), shape}; }
};

template <class Executor>
Image noisy(const NoiseParams& params, Image image, Executor executor) {
  REQUIRE(npsim::add_noise(params, ImageView<const Vec3f>(image.view()), image.view(), executor).ok());
  return image;
}

struct Moments {
  double mean = 0;
  double variance = 0;
  double skewness = 0;
  double kurtosis = 0;
};

template <class Get>
Moments moments(std::size_t n, const Get& get) {
  Moments m;
  for (std::size_t i = 0; i < n; ++i) m.mean += get(i);
  m.mean /= static_cast<double>(n);
  double third = 0;
  double fourth = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double d = get(i) - m.mean;
    m.variance += d * d;
    third += d * d * d;
    fourth += d * d * d * d;
  }
  m.variance /= static_cast<double>(n);
  m.skewness = third / static_cast<double>(n) / std::pow(m.variance, 1.5);
  m.kurtosis = fourth / static_cast<double>(n) / (m.variance * m.variance);
  return m;
}

}  // namespace

TEST_CASE("sensor: the normal number inverts the normal distribution to 2e-7, tails included") {
  double worst = 0;
  for (std::uint64_t i = 0; i <= 100000; ++i) {
    const auto bits = static_cast<std::uint32_t>(i < 50000 ? i * 85899 : (i - 50000) * (i - 50000) / 50);
    const auto x = static_cast<double>(npsim::standard_normal(bits));
    const double p = (static_cast<double>(bits) + 0.5) * 0x1p-32;
    // One Newton step from x towards the exact quantile.
    const double cumulative = p < 0.5 ? 0.5 * std::erfc(-x / std::sqrt(2.0)) : 1 - 0.5 * std::erfc(x / std::sqrt(2.0));
    const double density = std::exp(-x * x / 2) / std::sqrt(2 * std::acos(-1.0));
    worst = std::fmax(worst, std::fabs(cumulative - p) / density / std::fmax(1.0, std::fabs(x)));
  }
  CAPTURE(worst);
  CHECK(worst < 2e-7);
  CHECK(npsim::standard_normal(0) == -npsim::standard_normal(0xFFFFFFFFU));
  CHECK(npsim::standard_normal(0) == doctest::Approx(-6.337).epsilon(1e-3));
  CHECK(npsim::standard_normal(0x7FFFFFFFU) == -npsim::standard_normal(0x80000000U));
}

TEST_CASE("sensor: mean and variance of the noise follow equation 3.10 at every level and ISO") {
  for (const float iso : {100.0F, 800.0F, 3200.0F}) {
    const npsim::NoiseLevel level = npsim::noise_level(iso).value();
    for (const float x : {0.0F, 0.001F, 0.02F, 0.2F, 0.9F, 50.0F}) {
      NoiseParams params;
      params.level = level;
      params.residual = 1.0F;
      params.seed = 11;
      const Image out = noisy(params, Image(300, 200, {x, x, x}), npsim::SerialExecutor{});
      const Moments m = moments(180000, [&out](std::size_t i) {
        const Vec3f& p = out.pixels[i / 3];
        return static_cast<double>(i % 3 == 0 ? p.x : (i % 3 == 1 ? p.y : p.z));
      });
      const double variance =
          static_cast<double>(level.beta1) * static_cast<double>(x) + static_cast<double>(level.beta2);
      // Four standard errors of 180000 samples.
      CHECK(std::fabs(m.mean - static_cast<double>(x)) < 4 * std::sqrt(variance / 180000));
      CHECK(m.variance == doctest::Approx(variance).epsilon(4 * std::sqrt(2.0 / 180000)));
      CHECK(std::fabs(m.skewness) < 4 * std::sqrt(6.0 / 180000));
      CHECK(std::fabs(m.kurtosis - 3) < 4 * std::sqrt(24.0 / 180000));
    }
  }
}

TEST_CASE("sensor: channels, pixels and images do not share noise; the same key repeats it") {
  NoiseParams params;
  params.level = {1e-3F, 1e-4F};
  params.residual = 1.0F;
  const Image grey(128, 128, {0.2F, 0.2F, 0.2F});
  const Image a = noisy(params, grey, npsim::SerialExecutor{});
  const Image again = noisy(params, grey, npsim_test::BackwardExecutor{});
  params.image = 1;
  const Image b = noisy(params, grey, npsim::SerialExecutor{});
  double channel = 0;
  double neighbour = 0;
  double image = 0;
  double power = 0;
  const std::size_t n = a.pixels.size() - 1;
  for (std::size_t i = 0; i < n; ++i) {
    CHECK(a.pixels[i] == again.pixels[i]);
    const auto d = [](float v) { return static_cast<double>(v) - 0.2; };
    power += d(a.pixels[i].x) * d(a.pixels[i].x);
    channel += d(a.pixels[i].x) * d(a.pixels[i].y);
    neighbour += d(a.pixels[i].x) * d(a.pixels[i + 1].x);
    image += d(a.pixels[i].x) * d(b.pixels[i].x);
  }
  const double bound = 4 * std::sqrt(static_cast<double>(n)) / static_cast<double>(n);
  CHECK(std::fabs(channel / power) < bound);
  CHECK(std::fabs(neighbour / power) < bound);
  CHECK(std::fabs(image / power) < bound);
}

TEST_CASE("sensor: read noise meets its table, lies between its entries and grows beyond them") {
  for (const npsim::ReadNoise& entry : npsim::kReadNoise) {
    const npsim::NoiseLevel level = npsim::noise_level(entry.iso).value();
    CHECK(level.beta2 == doctest::Approx(static_cast<double>(entry.beta2)).epsilon(1e-5));
    CHECK(level.beta1 == doctest::Approx(1.46e-6 * static_cast<double>(entry.iso)));
  }
  CHECK(npsim::noise_level(1131.37F).value().beta2 == doctest::Approx(std::sqrt(2.2e-6 * 1.1e-5)).epsilon(1e-3));
  CHECK(npsim::noise_level(6400.0F).value().beta2 == doctest::Approx(1.76e-4).epsilon(1e-3));
  CHECK(npsim::noise_level(50.0F).value().beta2 == doctest::Approx(2.6e-7));
  float before = 0;
  for (float iso = 25.0F; iso < 1e7F; iso *= 1.1F) {
    const npsim::Result<npsim::NoiseLevel> level = npsim::noise_level(iso);
    REQUIRE(level.ok());
    CHECK(npsim::validate(level.value()).ok());
    CHECK(level.value().beta2 >= before);
    before = level.value().beta2;
  }
  CHECK_FALSE(npsim::noise_level(0.0F).ok());
  CHECK_FALSE(npsim::noise_level(std::numeric_limits<float>::quiet_NaN()).ok());
}

TEST_CASE("sensor: a table with the black level folded into a negative beta2 converts") {
  // A 10-bit sensor, black 64, white 1023, whose true values are known.
  const double beta1 = 4.43e-3;
  const double beta2 = 4.4e-5;
  const double range = 1023 - 64;
  const double slope = beta1 * range;
  const double intercept = beta2 * range * range - slope * 64;
  CHECK(intercept < 0);
  const npsim::Result<npsim::NoiseLevel> level = npsim::noise_level_from_raw(slope, intercept, 64, 1023);
  REQUIRE(level.ok());
  CHECK(level.value().beta1 == doctest::Approx(beta1));
  CHECK(level.value().beta2 == doctest::Approx(beta2));
  CHECK_FALSE(npsim::noise_level_from_raw(slope, intercept, 0, 1023).ok());  // the black level was forgotten
  CHECK_FALSE(npsim::noise_level_from_raw(slope, intercept, 64, 64).ok());
  NoiseParams params;
  params.level = {1e-3F, -1e-5F};
  Image image(2, 2);
  const npsim::SerialExecutor executor;
  CHECK(npsim::add_noise(params, ImageView<const Vec3f>(image.view()), image.view(), executor).code() ==
        npsim::StatusCode::invalid_argument);
  params.level = {};
  params.residual = 1.5F;
  CHECK(npsim::add_noise(params, ImageView<const Vec3f>(image.view()), image.view(), executor).code() ==
        npsim::StatusCode::invalid_argument);
}

TEST_CASE("sensor: residual noise scales the standard deviation; zero leaves the signal; NaN reads as black") {
  NoiseParams params;
  params.level = {4e-3F, 4e-5F};
  params.residual = 0.0F;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const Image still = noisy(params, Image(9, 1, {0.3F, nan, -1.0F}), npsim::SerialExecutor{});
  CHECK(still.pixels[4] == Vec3f{0.3F, 0.0F, 0.0F});
  params.residual = 1.0F;
  const Image full = noisy(params, Image(50, 50, {0.3F, 0.3F, 0.3F}), npsim::SerialExecutor{});
  params.residual = 0.25F;
  const Image quarter = noisy(params, Image(50, 50, {0.3F, 0.3F, 0.3F}), npsim::SerialExecutor{});
  for (std::size_t i = 0; i < full.pixels.size(); ++i) {
    CHECK(static_cast<double>(quarter.pixels[i].y) - 0.3 ==
          doctest::Approx(0.25 * (static_cast<double>(full.pixels[i].y) - 0.3)).epsilon(1e-3).scale(1e-3));
  }
}

TEST_CASE("sensor: the default preset at ISO 3200 shows the noise of flat areas in real night photographs") {
  // Real: .64 .60 .69 .97 .99 1.15 of 255 at displayed levels 0-4, 4-8, 8-16, 16-32, 32-64, 64-128.
  NoiseParams params;
  params.level = npsim::noise_level(3200.0F).value();
  const npsim::SerialExecutor executor;
  for (const float x : {0.0008F, 0.0025F, 0.004F, 0.009F, 0.03F, 0.11F}) {
    Image image = noisy(params, Image(200, 200, {x, x, x}), npsim::SerialExecutor{});
    std::vector<npsim::Rgb8> shown(image.pixels.size());
    REQUIRE(npsim::develop(npsim::IspParams{}, ImageView<const Vec3f>(image.view()),
                           ImageView<npsim::Rgb8>(shown.data(), image.shape), executor)
                .ok());
    const Moments m = moments(shown.size(), [&shown](std::size_t i) { return static_cast<double>(shown[i].g); });
    CAPTURE(m.mean);
    CHECK(std::sqrt(m.variance) > 0.55);
    CHECK(std::sqrt(m.variance) < 1.25);
  }
}
