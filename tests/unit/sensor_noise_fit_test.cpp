// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "npsim/core/executor.hpp"
#include "npsim/sensor/noise.hpp"
#include "npsim/sensor/raw.hpp"
#include "unit/sensor_fixture.hpp"

namespace {

using npsim::NoiseFit;
using npsim::NoiseLevel;
using npsim::NoiseSample;
using npsim::RawScale;
using npsim::Shape;
using npsim::Span;
using sensor_test::Image;
using Levels = npsim_test::Image<std::uint16_t>;

constexpr RawScale kScale{512, 16383};

// Patches of 64 x 64, each brighter than the one before, as a sensor of 14 bits reads them.
Levels chart(const NoiseLevel& noise, std::uint64_t seed, std::uint32_t index) {
  const Shape shape{512, 64};
  Image light(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const int patch = x / 64;
      light(x, y) = npsim::Vec3f{1, 1, 1} * (0.01F * static_cast<float>(patch * patch) + 0.002F);
    }
  }
  npsim::SensorParams sensor;
  sensor.bits = 14;
  sensor.black = 512;
  sensor.blur_px = sensor.vignetting = 0;
  const npsim::SerialExecutor executor;
  npsim_test::Image<float> plane(npsim::mosaic_shape(shape));
  REQUIRE(npsim::capture(sensor, 1, {noise, 1}, {100, 100, 256, 32}, seed, index, light.view(), plane.view(), executor)
              .ok());
  Levels out(shape);
  REQUIRE(npsim::raw_levels(sensor, plane.view(), out.view(), executor).ok());
  return out;
}

std::vector<NoiseSample> samples(const Levels& a, const Levels* b) {
  std::vector<NoiseSample> out;
  for (int patch = 0; patch < 8; ++patch) {
    for (int phase = 0; phase < 4; ++phase) {
      const auto area = [&](const Levels& l) { return l.cview().sub(64 * patch, 0, {64, 64}); };
      out.push_back(b == nullptr ? npsim::noise_of_area(kScale, area(a), phase % 2, phase / 2)
                                 : npsim::noise_of_pair(kScale, area(a), area(*b), phase % 2, phase / 2));
    }
  }
  return out;
}

NoiseFit fitted(const std::vector<NoiseSample>& all) {
  NoiseFit fit;
  REQUIRE(npsim::fit_noise(Span<const NoiseSample>(all.data(), all.size()), fit).ok());
  return fit;
}

}  // namespace

TEST_CASE("sensor: a noise fit recovers what a chart was read with, within its own bounds, of one picture and of two") {
  for (const bool two : {false, true}) {
    int inside1 = 0;
    int inside2 = 0;
    const int charts = 40;
    double bias1 = 0;
    double bias2 = 0;
    const NoiseLevel noise{1e-3F, 2e-6F};
    for (std::uint32_t i = 0; i < charts; ++i) {
      const Levels a = chart(noise, 5, 2 * i);
      const Levels b = chart(noise, 5, 2 * i + 1);
      const NoiseFit fit = fitted(samples(a, two ? &b : nullptr));
      const double level = 1.0 / 15871;
      const double d1 = fit.beta1 - static_cast<double>(noise.beta1);
      const double d2 = fit.beta2 - static_cast<double>(noise.beta2) - level * level / 12;
      CHECK(std::fabs(d1) < 4.5 * fit.error1);
      CHECK(std::fabs(d2) < 4.5 * fit.error2);
      CHECK(fit.error1 < 0.03 * 1e-3);
      inside1 += std::fabs(d1) < 1.96 * fit.error1;
      inside2 += std::fabs(d2) < 1.96 * fit.error2;
      bias1 += d1 / fit.error1 / charts;
      bias2 += d2 / fit.error2 / charts;
      CHECK(fit.chi2 < 2.5);
    }
    CAPTURE(two);
    CHECK(inside1 >= 34);  // of 38 that are expected
    CHECK(inside2 >= 34);
    CHECK(std::fabs(bias1) < 4 / std::sqrt(charts));
    CHECK(std::fabs(bias2) < 4 / std::sqrt(charts));
  }
}

TEST_CASE("sensor: two frames need no flat area, one picture bears a slow gradient") {
  const NoiseLevel noise{2e-3F, 1e-6F};
  Levels a = chart(noise, 9, 0);
  Levels b = chart(noise, 9, 1);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 512; ++x) {  // a texture that both frames show
      const auto texture = static_cast<std::uint16_t>((x * 7 + y * 13) % 97);
      a(x, y) = static_cast<std::uint16_t>(a(x, y) + texture);
      b(x, y) = static_cast<std::uint16_t>(b(x, y) + texture);
    }
  }
  const NoiseFit fit = fitted(samples(a, &b));
  CHECK(std::fabs(fit.beta1 - 2e-3) < 4 * fit.error1 + 2e-5);
  Levels slope = chart(noise, 9, 2);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 512; ++x) slope(x, y) = static_cast<std::uint16_t>(slope(x, y) + x % 64);
  }
  CHECK(fitted(samples(slope, nullptr)).beta1 == doctest::Approx(2e-3).epsilon(0.06));
}

TEST_CASE("sensor: a noise fit refuses areas that are dark, full, too few, too small, or all as bright") {
  NoiseFit fit;
  const auto code = [&](const std::vector<NoiseSample>& all) {
    return npsim::fit_noise(Span<const NoiseSample>(all.data(), all.size()), fit).code();
  };
  CHECK(code({}) == npsim::StatusCode::no_valid_input);
  CHECK(code({{0.1, 1e-4, 100}, {0.2, 2e-4, 100}}) == npsim::StatusCode::no_valid_input);
  CHECK(code({{0.1, 1e-4, 100}, {0.1, 2e-4, 100}, {0.1, 1e-4, 100}}) == npsim::StatusCode::no_valid_input);
  CHECK(code({{0.1, 1e-4, 100}, {0.2, 2e-4, 100}, {0.3, 3e-4, 0}}) == npsim::StatusCode::no_valid_input);
  CHECK(code({{0.1, 1e-4, 100}, {0.2, 2e-4, 100}, {0.3, 3e-4, 10}}) == npsim::StatusCode::ok);
  const Levels full({32, 32}, 16383);
  const Levels dark({32, 32}, 0);
  const Levels small({4, 4}, 600);
  for (const Levels* l : {&full, &dark, &small}) {
    CHECK(npsim::noise_of_area(kScale, l->view(), 0, 0).freedom == 0);
    CHECK(npsim::noise_of_pair(kScale, l->view(), l->view(), 0, 0).freedom == 0);
  }
}
