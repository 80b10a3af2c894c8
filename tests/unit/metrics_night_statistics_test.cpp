// SPDX-License-Identifier: Apache-2.0
// Statistics of night pictures against a plain version that sorts, and where the answer is known.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "npsim/metrics/night_statistics.hpp"
#include "unit/fixture.hpp"

using namespace npsim;

namespace {

using Picture = npsim_test::Image<Rgb8>;

NightStatistics measured(const Picture& picture) {
  npsim_test::Scratch scratch(kNightStatisticsBytes);
  NightStatistics s;
  REQUIRE(night_statistics(picture.view(), s, scratch.workspace()).ok());
  return s;
}

// A gradient from black to bright with coloured noise, odd sides and a stride.
Picture noisy(Shape shape, double sigma, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, sigma);
  Picture p(shape, Rgb8{}, 3, Rgb8{255, 255, 255});
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const double base = 180.0 * y / shape.height;
      const auto code = [&](double scale) {
        return static_cast<std::uint8_t>(std::clamp(std::lround(base * scale + normal(random)), 0L, 255L));
      };
      p(x, y) = {code(1.3), code(1), code(0.6)};
    }
  }
  return p;
}

double quantile(std::vector<double> values, double q) {
  std::sort(values.begin(), values.end());
  const double at = q * static_cast<double>(values.size() - 1);
  const auto i = static_cast<std::size_t>(at);
  const double upper = i + 1 < values.size() ? values[i + 1] : values[i];
  return values[i] + (upper - values[i]) * (at - static_cast<double>(i));
}

// Noise by its definition, in thirds of a level so that ties are exact.
std::vector<double> plain_noise(const Picture& p) {
  const auto g = [&](int x, int y) { return double(p(x, y).r) + p(x, y).g + p(x, y).b; };
  const auto gradient = [&](int x, int y) {
    return std::fabs(g(x + 1, y) - g(x - 1, y)) + std::fabs(g(x, y + 1) - g(x, y - 1));
  };
  std::vector<double> gradients;
  for (int y = 1; y + 1 < p.shape().height; ++y) {
    for (int x = 1; x + 1 < p.shape().width; ++x) gradients.push_back(gradient(x, y));
  }
  const double flat = quantile(gradients, 0.6);
  std::vector<double> noise;
  for (int k = 0; k < kNoiseBands; ++k) {
    std::vector<double> sizes;
    for (int y = 1; y + 1 < p.shape().height; ++y) {
      for (int x = 1; x + 1 < p.shape().width; ++x) {
        const double level = g(x, y) / 3;
        if (gradient(x, y) > flat || level < kNoiseLevels[k] || level >= kNoiseLevels[k + 1]) continue;
        sizes.push_back(std::fabs(4 * g(x, y) - g(x - 1, y) - g(x + 1, y) - g(x, y - 1) - g(x, y + 1)) / 3);
      }
    }
    noise.push_back(sizes.size() > 200 ? quantile(sizes, 0.5) / 0.6745 / std::sqrt(20.0)
                                       : std::numeric_limits<double>::quiet_NaN());
  }
  return noise;
}

}  // namespace

TEST_CASE("night statistics: shares and means by their definition, odd sides and a stride") {
  const Picture p = noisy({97, 61}, 9, 1);
  const NightStatistics s = measured(p);
  double sum = 0, road = 0, top = 0, red = 0, green = 0;
  int black = 0, saturated = 0;
  for (int y = 0; y < 61; ++y) {
    for (int x = 0; x < 97; ++x) {
      const auto linear = [](std::uint8_t v) { return std::pow(v / 255.0, 2.2); };
      const Rgb8 c = p(x, y);
      const double l = 0.2126 * linear(c.r) + 0.7152 * linear(c.g) + 0.0722 * linear(c.b);
      sum += l;
      road += y >= 33 ? l : 0;
      top += y < 18 ? l : 0;
      red += linear(c.r);
      green += linear(c.g);
      black += std::max({c.r, c.g, c.b}) <= 8;
      saturated += std::max({c.r, c.g, c.b}) == 255;
    }
  }
  CHECK(s.mean == doctest::Approx(sum / (97 * 61)).epsilon(1e-10));
  CHECK(s.road == doctest::Approx(road / (97 * 28)).epsilon(1e-10));
  CHECK(s.top == doctest::Approx(top / (97 * 18)).epsilon(1e-10));
  CHECK(s.road_to_top == doctest::Approx(s.road / s.top));
  CHECK(s.red_to_green == doctest::Approx(red / green).epsilon(1e-10));
  CHECK(s.black == black / (97.0 * 61));
  CHECK(s.saturated == saturated / (97.0 * 61));
}

TEST_CASE("night statistics: noise by sorting, also where many pixels tie at the percentile") {
  for (const double sigma : {0.3, 1.0, 6.0}) {
    const Picture p = noisy({161, 99}, sigma, 3);
    const NightStatistics s = measured(p);
    const std::vector<double> plain = plain_noise(p);
    for (std::size_t k = 0; k < kNoiseBands; ++k) {
      CAPTURE(k);
      if (std::isnan(plain[k])) {
        CHECK(std::isnan(s.noise[k]));
      } else {
        CHECK(s.noise[k] == doctest::Approx(plain[k]).epsilon(1e-12));
      }
    }
  }
}

TEST_CASE("night statistics: white noise on a flat grey has the sigma that was put in") {
  std::mt19937 random(5);
  std::normal_distribution<double> normal(50, 4);
  Picture p({400, 300});
  for (int y = 0; y < 300; ++y) {
    for (int x = 0; x < 400; ++x) {
      const auto v = static_cast<std::uint8_t>(std::lround(normal(random)));
      p(x, y) = {v, v, v};
    }
  }
  // Pixels that count as flat have neighbours alike in pairs, which takes a little off the Laplacian.
  CHECK(measured(p).noise[4] == doctest::Approx(4).epsilon(0.1));
}

TEST_CASE("night statistics: all black, all white, and pictures too small for rows and neighbours") {
  const NightStatistics black = measured(Picture({40, 40}));
  CHECK(black.mean == 0);
  CHECK(black.road_to_top == 0);
  CHECK(std::isnan(black.red_to_green));
  CHECK(black.black == 1);
  CHECK(black.saturated == 0);
  CHECK(black.noise[0] == 0);
  CHECK(std::isnan(black.noise[1]));
  const NightStatistics white = measured(Picture({40, 40}, Rgb8{255, 255, 255}));
  CHECK(white.mean == doctest::Approx(1));
  CHECK(white.road_to_top == doctest::Approx(1));
  CHECK(white.saturated == 1);
  CHECK(white.black == 0);
  CHECK(std::isnan(white.noise[5]));  // brighter than the last level
  CHECK(measured(Picture({4, 4}, Rgb8{9, 0, 0})).black == 0);
  npsim_test::Scratch scratch(kNightStatisticsBytes);
  NightStatistics s;
  CHECK(night_statistics(Picture({3, 9}).cview(), s, scratch.workspace()).code() == StatusCode::no_valid_input);
  CHECK(night_statistics({}, s, scratch.workspace()).code() == StatusCode::no_valid_input);
}
