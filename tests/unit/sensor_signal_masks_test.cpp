// SPDX-License-Identifier: Apache-2.0
// Indiscernible and saturated pixels: the ratio against noise that is measured over many pictures, the clipping against
// what the ISP clips.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/sensor/isp.hpp"
#include "npsim/sensor/signal_masks.hpp"
#include "unit/sensor_fixture.hpp"

namespace {

using npsim::kMosaicMargin;
using npsim::NoiseParams;
using npsim::SensorParams;
using npsim::Shape;
using npsim::Vec3f;
using sensor_test::Image;
using sensor_test::pixels;
using Plane = npsim_test::Image<float>;
using Mask = npsim_test::Image<std::uint8_t>;

constexpr npsim::Intrinsics kCamera{100, 100, 30, 20};

Plane captured(const SensorParams& sensor, const NoiseParams& noise, const Image& light, std::uint32_t index = 0) {
  Plane plane(npsim::mosaic_shape(light.shape()));
  npsim::SerialExecutor serial;
  REQUIRE(npsim::capture(sensor, 1.0F, noise, kCamera, 9, index, light.view(), plane.view(), serial).ok());
  return plane;
}

// As picture_masks() reads it.
Plane without_noise(SensorParams sensor, const Image& light) {
  sensor.bits = 16;
  sensor.black = 0;
  return captured(sensor, {}, light);
}

struct Masks {
  Mask saturated;
  Mask indiscernible;
};

template <class Executor = npsim::SerialExecutor>
Masks masks_of(const SensorParams& sensor, const NoiseParams& noise, const Image& light, float snr = 1.0F,
               const Vec3f& gains = {1, 1, 1}, Executor executor = {}) {
  Masks out{Mask(light.shape(), 7, 3), Mask(light.shape(), 7, 2)};
  const Plane plane = without_noise(sensor, light);
  REQUIRE(npsim::signal_masks({snr}, sensor, noise, gains, plane.view(),
                              {out.saturated.view(), out.indiscernible.view()}, executor)
              .ok());
  return out;
}

// Colours from nothing to `most`, smooth along the rows.
Image ramp(Shape shape, float most) {
  Image light(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const float v = most * static_cast<float>(x) / static_cast<float>(shape.width - 1);
      light(x, y) = y < shape.height / 2 ? Vec3f{v, 0.5F * v, 0.1F * v} : Vec3f{0.1F * v, 0.3F * v, v};
    }
  }
  return light;
}

}  // namespace

TEST_CASE("signal masks: indiscernible where noise measured over 400 pictures is no less than the signal") {
  for (const float iso : {100.0F, 3200.0F}) {
    for (const float snr : {1.0F, 4.0F}) {
      CAPTURE(iso);
      CAPTURE(snr);
      SensorParams sensor;
      sensor.bits = 12;
      sensor.black = 64;
      const NoiseParams noise{npsim::noise_level(iso).value(), 0.5F};
      const float limit = npsim::signal_of_snr(noise, 1.0F / 4031, snr);
      const Image light = ramp({61, 8}, 8 * limit);
      const Masks masks = masks_of(sensor, noise, light, snr);
      const int width = light.shape().width + 2 * kMosaicMargin;
      std::vector<double> sum(static_cast<std::size_t>(width * light.shape().height));
      std::vector<double> squares(sum.size());
      constexpr int kPictures = 400;
      for (std::uint32_t i = 0; i < kPictures; ++i) {
        const Plane plane = captured(sensor, noise, light, i);
        for (std::size_t k = 0; k < sum.size(); ++k) {
          const auto v = static_cast<double>(plane(static_cast<int>(k) % width, static_cast<int>(k) / width));
          sum[k] += v;
          squares[k] += v * v;
        }
      }
      const auto ratio = [&](int x, int y) {
        const auto k = static_cast<std::size_t>(y * width + x + kMosaicMargin);
        const double mean = sum[k] / kPictures;
        return mean / std::sqrt(squares[k] / kPictures - mean * mean);
      };
      int judged[2] = {};
      for (int y = 0; y < light.shape().height; ++y) {
        for (int x = 0; x < light.shape().width; ++x) {
          double best = -1e9;
          for (int j = std::max(0, y - 1); j <= std::min(7, y + 1); ++j) {
            for (int i = std::max(0, x - 1); i <= std::min(60, x + 1); ++i) best = std::max(best, ratio(i, j));
          }
          // A measured ratio scatters by 1 / sqrt(400) and 1 / sqrt(800) of itself, and the best of nine is high.
          const auto k = static_cast<double>(snr);
          if (best < 0.85 * k) CHECK(masks.indiscernible(x, y) == 1);
          if (best > k + 0.2 + 0.15 * k) CHECK(masks.indiscernible(x, y) == 0);
          ++judged[masks.indiscernible(x, y)];
        }
      }
      CHECK(judged[0] > 50);
      CHECK(judged[1] > 30);
    }
  }
}

TEST_CASE("signal masks: the limit is the signal of that ratio, and 0 without noise") {
  const NoiseParams noise{{3e-3F, 2e-5F}, 0.4F};
  for (const float snr : {0.5F, 1.0F, 10.0F}) {
    const auto x = static_cast<double>(npsim::signal_of_snr(noise, 2e-3F, snr));
    const double sigma = std::sqrt(0.16 * (3e-3 * x + 2e-5) + 4e-6 / 12);
    CHECK(x / sigma == doctest::Approx(static_cast<double>(snr)).epsilon(1e-5));
  }
  CHECK(npsim::signal_of_snr({}, 0.0F, 1.0F) == 0.0F);
}

TEST_CASE("signal masks: saturated is what the ISP clips, in each mosaic, odd sizes, one exposure and three") {
  for (const npsim::Mosaic mosaic :
       {npsim::Mosaic::rggb, npsim::Mosaic::bggr, npsim::Mosaic::grbg, npsim::Mosaic::gbrg}) {
    for (const int exposures : {1, 3}) {
      SensorParams sensor;
      sensor.mosaic = mosaic;
      sensor.exposures = exposures;
      sensor.bits = 16;
      sensor.black = 0;
      sensor.vignetting = 0;
      Image light({47, 31});
      for (std::size_t i = 0; i < pixels(light).size(); ++i) {
        npsim::RandomStream random(2, npsim::RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(i), 0);
        const float v = random.uniform() < 0.03F ? 9.0F * npsim::raw_range(sensor) : 0.2F;
        pixels(light)[i] = {v * random.uniform(), v * random.uniform(), v * random.uniform()};
      }
      const Vec3f gains{1.4F, 1.0F, 1.9F};
      const Masks masks = masks_of(sensor, {}, light, 1.0F, gains);
      Plane plane = captured(sensor, {}, light);
      npsim::IspParams isp;
      isp.gains = gains;
      npsim_test::Image<npsim::Rgb8> picture(light.shape());
      npsim::SerialExecutor serial;
      npsim::Workspace none;
      REQUIRE(npsim::develop(isp, sensor, plane.view(), picture.view(), none, serial).ok());
      int saturated = 0;
      for (int y = 0; y < 31; ++y) {
        for (int x = 0; x < 47; ++x) {
          bool clipped = false;
          for (int j = std::max(0, y - 1); j <= std::min(30, y + 1); ++j) {
            for (int i = std::max(0, x - 1); i <= std::min(46, x + 1); ++i) {
              clipped = clipped || plane(i + kMosaicMargin, j) >= npsim::kFullSignal;
            }
          }
          CHECK(masks.saturated(x, y) == (clipped ? 1 : 0));
          saturated += clipped;
        }
      }
      CHECK(saturated > 20);
      CHECK(saturated < 1200);
    }
  }
}

TEST_CASE("signal masks: all black, one lamp of 1e6 cd/m2 in black, NaN and negative light, 1x1, any executor") {
  const SensorParams sensor;
  const NoiseParams noise{npsim::noise_level(1600).value(), 0.25F};
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const Shape shape : {Shape{1, 1}, Shape{5, 1}, Shape{1, 6}, Shape{33, 21}}) {
    for (const Vec3f& dark : {Vec3f{}, Vec3f{nan, -1, 0}}) {
      const Masks masks = masks_of(sensor, noise, Image(shape, dark));
      for (int y = 0; y < shape.height; ++y) {
        for (int x = 0; x < shape.width; ++x) {
          CHECK(masks.indiscernible(x, y) == 1);
          CHECK(masks.saturated(x, y) == 0);
        }
      }
    }
  }
  Image lamp({33, 21});
  lamp(16, 10) = {1e6F, 1e6F, 1e6F};
  const Masks masks = masks_of(sensor, noise, lamp);
  for (int y = 0; y < 21; ++y) {
    for (int x = 0; x < 33; ++x) {
      const int away = std::max(std::abs(x - 16), std::abs(y - 10));  // the lens' blur is a pixel, the colours another
      CHECK(masks.saturated(x, y) == (away <= 2 ? 1 : 0));
      CHECK(masks.indiscernible(x, y) == (away <= 2 ? 0 : 1));
    }
  }
  const Masks backward = masks_of(sensor, noise, lamp, 1.0F, {1, 1, 1}, npsim_test::BackwardExecutor{});
  CHECK(backward.saturated == masks.saturated);
  CHECK(backward.indiscernible == masks.indiscernible);
}

TEST_CASE("signal masks: three channels in every pixel, as the thesis' sensor has them") {
  const NoiseParams noise{{0, 1e-4F}, 1.0F};  // sigma .01
  const Image signal({5, 1}, {{0.009F, 0.009F, 0.009F}, {0, 0, 0.02F}, {0, 1, 0}, {0.99F, 0.5F, 0}, {-1, 0, 0}});
  Masks out{Mask({5, 1}), Mask({5, 1})};
  npsim::SerialExecutor serial;
  REQUIRE(npsim::signal_masks({}, noise, signal.view(), {out.saturated.view(), out.indiscernible.view()}, serial).ok());
  CHECK(out.indiscernible == Mask({5, 1}, {1, 0, 0, 0, 1}));
  CHECK(out.saturated == Mask({5, 1}, {0, 0, 1, 0, 0}));
}

TEST_CASE("signal masks: a ratio of 0 and shapes that differ are refused") {
  const SensorParams sensor;
  npsim::SerialExecutor serial;
  Mask a({4, 4});
  Mask b({4, 3});
  const Plane plane = without_noise(sensor, Image({4, 4}));
  const auto code = [&](float snr, Mask& second) {
    return npsim::signal_masks({snr}, sensor, {}, {1, 1, 1}, plane.view(), {a.view(), second.view()}, serial).code();
  };
  CHECK(code(0, a) == npsim::StatusCode::invalid_argument);
  CHECK(code(std::numeric_limits<float>::quiet_NaN(), a) == npsim::StatusCode::invalid_argument);
  CHECK(code(1, b) == npsim::StatusCode::shape_mismatch);
  CHECK(code(1, a) == npsim::StatusCode::ok);
}
