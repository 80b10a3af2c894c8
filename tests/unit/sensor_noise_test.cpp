// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "npsim/core/executor.hpp"
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

TEST_CASE("sensor: a pair of normal numbers is Box and Muller's to 1e-6, whatever the word") {
  using F = npsim::simd::scalar::F32;
  const double pi = std::acos(-1.0);
  double worst = 0;
  for (std::uint64_t i = 0; i <= 200000; ++i) {
    const auto bits = static_cast<std::uint32_t>(i < 100000 ? i * 42949 : (i - 100000) * 13);
    const auto pair = npsim::noise_detail::normal_pair<F>(F::Int(static_cast<std::int32_t>(bits)));
    const double radius = std::sqrt(-2 * std::log(((bits >> 11U) + 0.5) / 2097152.0));
    const double angle = ((bits & 511U) + 0.5) / 512.0 * pi / 2;
    const double x = (bits & 512U) != 0 ? -1 : 1;
    const double y = (bits & 1024U) != 0 ? -1 : 1;
    worst = std::fmax(worst, std::fabs(static_cast<double>(pair.x.value) - x * radius * std::cos(angle)));
    worst = std::fmax(worst, std::fabs(static_cast<double>(pair.y.value) - y * radius * std::sin(angle)));
  }
  CHECK(worst < 5e-6);
}

TEST_CASE("sensor: normal numbers are distributed as they should, by Kolmogorov and Smirnov's test of a million") {
  std::vector<float> all;
  for (std::uint32_t segment = 0; segment < 8192; ++segment) {
    float numbers[npsim::noise_detail::kSegment];
    npsim::noise_detail::normal_segment({7, 3, 0}, segment, numbers);
    all.insert(all.end(), numbers, numbers + npsim::noise_detail::kSegment);
  }
  std::sort(all.begin(), all.end());
  const auto n = static_cast<double>(all.size());
  double distance = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const double expected = 0.5 * std::erfc(-static_cast<double>(all[i]) / std::sqrt(2.0));
    distance = std::fmax(distance, std::fabs(expected - (static_cast<double>(i) + 0.5) / n));
  }
  CHECK(distance * std::sqrt(n) < 1.63);  // exceeded once in a hundred seeds
}

TEST_CASE("sensor: mean and variance of the noise follow equation 3.10 at every level and ISO") {
  for (const float iso : {100.0F, 200.0F, 400.0F, 800.0F, 1600.0F, 3200.0F, 6400.0F}) {
    const npsim::NoiseLevel level = npsim::noise_level(iso).value();
    for (int i = 0; i < 20; ++i) {
      const float x = 1e-4F * static_cast<float>(i * i * i);  // 0 to .69
      NoiseParams params;
      params.level = level;
      params.residual = 1.0F;
      const Image out = noisy(params, Image({150, 100}, {x, x, x}), npsim::SerialExecutor{}, 12);
      const Moments m = moments(45000, [&out](std::size_t k) {
        const Vec3f& p = pixels(out)[k / 3];
        return static_cast<double>(k % 3 == 0 ? p.x : (k % 3 == 1 ? p.y : p.z));
      });
      const double variance =
          static_cast<double>(level.beta1) * static_cast<double>(x) + static_cast<double>(level.beta2);
      // Four standard errors of 45000 samples.
      CHECK(std::fabs(m.mean - static_cast<double>(x)) < 4 * std::sqrt(variance / 45000));
      CHECK(m.variance == doctest::Approx(variance).epsilon(4 * std::sqrt(2.0 / 45000)));
      CHECK(std::fabs(m.skewness) < 4 * std::sqrt(6.0 / 45000));
      CHECK(std::fabs(m.kurtosis - 3) < 4 * std::sqrt(24.0 / 45000));
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

TEST_CASE("sensor: noise meets its table, lies between its rows and goes on beyond them") {
  for (const npsim::NoiseAtIso& entry : npsim::kDefaultNoise) {
    const npsim::NoiseLevel level = npsim::noise_level(entry.iso).value();
    CHECK(level.beta2 == doctest::Approx(static_cast<double>(entry.level.beta2)).epsilon(1e-5));
    CHECK(level.beta1 == doctest::Approx(1.46e-6 * static_cast<double>(entry.iso)).epsilon(1e-5));
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

TEST_CASE("sensor: a noise table of one row serves every ISO; none, or one out of order, is refused") {
  const npsim::NoiseAtIso one[] = {{400.0F, {6e-4F, 0.0F}}};
  const npsim::Span<const npsim::NoiseAtIso> table(one);
  CHECK(npsim::noise_level(100.0F, table).value().beta1 == doctest::Approx(1.5e-4));
  CHECK(npsim::noise_level(400.0F, table).value().beta1 == doctest::Approx(6e-4));
  CHECK(npsim::noise_level(1600.0F, table).value().beta1 == doctest::Approx(2.4e-3));
  CHECK(npsim::noise_level(1600.0F, table).value().beta2 == 0.0F);
  CHECK_FALSE(npsim::noise_level(100.0F, {}).ok());
  const npsim::NoiseAtIso falling[] = {{400.0F, {}}, {200.0F, {}}};
  CHECK_FALSE(npsim::noise_level(100.0F, npsim::Span<const npsim::NoiseAtIso>(falling)).ok());
}

TEST_CASE("sensor: a table that has the black level folded in, and so a negative variance, is converted") {
  // A 10-bit phone sensor at ISO 100, black 64: var = .141923 DN - 8.890307.
  const npsim::NoiseLevel level = npsim::without_black_level(0.141923, -8.890307, 64, 1023);
  CHECK(level.beta1 == doctest::Approx(1.47991e-4).epsilon(1e-4));
  CHECK(level.beta2 == doctest::Approx(2.096e-7).epsilon(1e-3));
  CHECK(npsim::validate(level).ok());
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
