// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "npsim/core/executor.hpp"
#include "npsim/sensor/isp.hpp"
#include "npsim/sensor/noise.hpp"
#include "unit/sensor_fixture.hpp"

namespace {

using npsim::ImageView;
using npsim::NoiseParams;
using npsim::Shape;
using npsim::Vec3f;
using sensor_test::Image;
using sensor_test::pixels;

template <class Executor>
Image noisy(const NoiseParams& params, Image image, Executor executor, std::uint64_t seed = 0,
            std::uint32_t index = 0) {
  REQUIRE(npsim::add_noise(params, seed, index, image.cview(), image.view(), executor).ok());
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
    const auto x = static_cast<double>(npsim::noise_detail::standard_normal(bits));
    const double p = (static_cast<double>(bits) + 0.5) * 0x1p-32;
    // One Newton step from x towards the exact quantile.
    const double cumulative = p < 0.5 ? 0.5 * std::erfc(-x / std::sqrt(2.0)) : 1 - 0.5 * std::erfc(x / std::sqrt(2.0));
    const double density = std::exp(-x * x / 2) / std::sqrt(2 * std::acos(-1.0));
    worst = std::fmax(worst, std::fabs(cumulative - p) / density / std::fmax(1.0, std::fabs(x)));
  }
  CAPTURE(worst);
  CHECK(worst < 2e-7);
  CHECK(npsim::noise_detail::standard_normal(0) == -npsim::noise_detail::standard_normal(0xFFFFFFFFU));
  CHECK(npsim::noise_detail::standard_normal(0) == doctest::Approx(-6.337).epsilon(1e-3));
  CHECK(npsim::noise_detail::standard_normal(0x7FFFFFFFU) == -npsim::noise_detail::standard_normal(0x80000000U));
}

TEST_CASE("sensor: mean and variance of the noise follow equation 3.10 at every level and ISO") {
  for (const float iso : {100.0F, 800.0F, 3200.0F}) {
    const npsim::NoiseLevel level = npsim::noise_level(iso).value();
    for (const float x : {0.0F, 0.001F, 0.02F, 0.2F, 0.9F, 50.0F}) {
      NoiseParams params;
      params.level = level;
      params.residual = 1.0F;
      const Image out = noisy(params, Image({300, 200}, {x, x, x}), npsim::SerialExecutor{}, 11);
      const Moments m = moments(180000, [&out](std::size_t i) {
        const Vec3f& p = pixels(out)[i / 3];
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
  const Image grey({128, 128}, {0.2F, 0.2F, 0.2F});
  const Image a = noisy(params, grey, npsim::SerialExecutor{});
  const Image again = noisy(params, grey, npsim_test::BackwardExecutor{});
  const Image b = noisy(params, grey, npsim::SerialExecutor{}, 0, 1);
  double channel = 0;
  double neighbour = 0;
  double image = 0;
  double power = 0;
  const std::size_t n = pixels(a).size() - 1;
  for (std::size_t i = 0; i < n; ++i) {
    CHECK(pixels(a)[i] == pixels(again)[i]);
    const auto d = [](float v) { return static_cast<double>(v) - 0.2; };
    power += d(pixels(a)[i].x) * d(pixels(a)[i].x);
    channel += d(pixels(a)[i].x) * d(pixels(a)[i].y);
    neighbour += d(pixels(a)[i].x) * d(pixels(a)[i + 1].x);
    image += d(pixels(a)[i].x) * d(pixels(b)[i].x);
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

TEST_CASE("sensor: a negative variance and a residual above one are refused") {
  NoiseParams params;
  params.level = {1e-3F, -1e-5F};
  Image image({2, 2});
  const npsim::SerialExecutor executor;
  CHECK(npsim::add_noise(params, 0, 0, image.cview(), image.view(), executor).code() ==
        npsim::StatusCode::invalid_argument);
  params.level = {};
  params.residual = 1.5F;
  CHECK(npsim::add_noise(params, 0, 0, image.cview(), image.view(), executor).code() ==
        npsim::StatusCode::invalid_argument);
}

TEST_CASE("sensor: residual noise scales the standard deviation; zero leaves the signal; NaN reads as black") {
  NoiseParams params;
  params.level = {4e-3F, 4e-5F};
  params.residual = 0.0F;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const Image still = noisy(params, Image({9, 1}, {0.3F, nan, -1.0F}), npsim::SerialExecutor{});
  CHECK(pixels(still)[4] == Vec3f{0.3F, 0.0F, 0.0F});
  params.residual = 1.0F;
  const Image full = noisy(params, Image({50, 50}, {0.3F, 0.3F, 0.3F}), npsim::SerialExecutor{});
  params.residual = 0.25F;
  const Image quarter = noisy(params, Image({50, 50}, {0.3F, 0.3F, 0.3F}), npsim::SerialExecutor{});
  for (std::size_t i = 0; i < pixels(full).size(); ++i) {
    CHECK(static_cast<double>(pixels(quarter)[i].y) - 0.3 ==
          doctest::Approx(0.25 * (static_cast<double>(pixels(full)[i].y) - 0.3)).epsilon(1e-3).scale(1e-3));
  }
}

TEST_CASE("sensor: the default preset at ISO 3200 shows the noise of flat areas in real night photographs") {
  // Real: .64 .60 .69 .97 .99 1.15 of 255 at displayed levels 0-4, 4-8, 8-16, 16-32, 32-64, 64-128.
  NoiseParams params;
  params.level = npsim::noise_level(3200.0F).value();
  const npsim::SerialExecutor executor;
  for (const float x : {0.0008F, 0.0025F, 0.004F, 0.009F, 0.03F, 0.11F}) {
    Image image = noisy(params, Image({200, 200}, {x, x, x}), npsim::SerialExecutor{});
    std::vector<npsim::Rgb8> shown(pixels(image).size());
    REQUIRE(
        npsim::develop(npsim::IspParams{}, image.cview(), ImageView<npsim::Rgb8>(shown.data(), image.shape()), executor)
            .ok());
    const Moments m = moments(shown.size(), [&shown](std::size_t i) { return static_cast<double>(shown[i].g); });
    CAPTURE(m.mean);
    CHECK(std::sqrt(m.variance) > 0.55);
    CHECK(std::sqrt(m.variance) < 1.25);
  }
}
