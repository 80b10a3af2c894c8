// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/sensor/denoise.hpp"
#include "npsim/sensor/detail/demosaic.hpp"
#include "npsim/sensor/exposure.hpp"
#include "npsim/sensor/raw.hpp"
#include "unit/sensor_fixture.hpp"

namespace {

using npsim::ImageView;
using npsim::kMosaicMargin;
using npsim::Mosaic;
using npsim::NoiseParams;
using npsim::RandomPurpose;
using npsim::RandomStream;
using npsim::SensorParams;
using npsim::Shape;
using npsim::Vec3f;
using sensor_test::Image;
using sensor_test::pixels;
using Plane = npsim_test::Image<float>;

constexpr Mosaic kMosaics[] = {Mosaic::rggb, Mosaic::bggr, Mosaic::grbg, Mosaic::gbrg};

// Sixteen bits, no blur, no vignetting: what is tested is the rest.
SensorParams plain() {
  SensorParams params;
  params.bits = 16;
  params.black = 1024;
  params.vignetting = 0;
  params.blur_px = 0;
  return params;
}

template <class Executor = npsim::SerialExecutor>
Plane captured(const SensorParams& params, const Image& image, const NoiseParams& noise = {}, float gain = 1,
               std::uint64_t seed = 0, std::uint32_t index = 0, Executor executor = {}) {
  Plane plane(npsim::mosaic_shape(image.shape()));
  const npsim::Intrinsics camera{100, 100, 0.5F * static_cast<float>(image.shape().width),
                                 0.5F * static_cast<float>(image.shape().height)};
  REQUIRE(npsim::capture(params, gain, noise, camera, seed, index, image.view(), plane.view(), executor).ok());
  return plane;
}

float at(const Plane& plane, int x, int y) { return plane(x + kMosaicMargin, y); }

npsim::DemosaicedPixels<npsim::simd::scalar::F32> demosaiced(npsim::Demosaic method, Mosaic mosaic, const Plane& plane,
                                                             int x, int y) {
  return npsim::demosaic<npsim::simd::scalar::F32>(method, mosaic, npsim::mosaic_rows(plane.cview(), y), x, y, 1);
}

Image colours(int width, int height) {
  Image image({width, height});
  for (std::size_t i = 0; i < pixels(image).size(); ++i) {
    RandomStream random(4, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(i), 0);
    pixels(image)[i] = {random.uniform(), random.uniform(), random.uniform()};
  }
  return image;
}

}  // namespace

TEST_CASE("sensor: behind each filter of the four mosaics stands that row of the response, odd sizes and 1x1 too") {
  for (const Mosaic mosaic : kMosaics) {
    SensorParams params = plain();
    params.mosaic = mosaic;
    for (const Shape shape : {Shape{37, 5}, Shape{1, 1}, Shape{2, 1}, Shape{1, 7}, Shape{130, 3}}) {
      const Image image = colours(shape.width, shape.height);
      const Plane plane = captured(params, image, {}, 0.5F);
      for (int y = 0; y < shape.height; ++y) {
        for (int x = 0; x < shape.width; ++x) {
          const Vec3f& row = params.response[npsim::filter_at(mosaic, x, y)];
          const auto exact = static_cast<double>(dot(row, image(x, y)) * 0.5F);
          CHECK(std::fabs(static_cast<double>(at(plane, x, y)) - exact) < 1.0 / 64511);
        }
      }
    }
  }
  CHECK(npsim::filter_at(Mosaic::grbg, 0, 0) == 1);
  CHECK(npsim::filter_at(Mosaic::grbg, 1, 0) == 0);
  CHECK(npsim::filter_at(Mosaic::grbg, 0, 1) == 2);
  CHECK(npsim::filter_at(Mosaic::bggr, 0, 0) == 2);
}

TEST_CASE("sensor: 1 cd/m2 at f/2, 1/30 s, 90 % and ISO 3200 reads 24 % of full scale behind a green filter") {
  const float gain = npsim::signal_per_luminance(npsim::CameraExposure{});
  const Plane plane = captured(plain(), Image({4, 4}, {1, 1, 1}), {}, gain);
  CHECK(at(plane, 1, 0) == doctest::Approx(0.2417).epsilon(0.01));
}

TEST_CASE("sensor: the well overflows at full scale, darkness reads 0, NaN and negative light is dark") {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  const Plane full = captured(plain(), Image({9, 6}, {1e6F, inf, 50}));
  const Plane dark = captured(plain(), Image({9, 6}, {nan, -5, 0}));
  const Plane none = captured(plain(), Image({9, 6}, {1, 1, 1}), {}, 0.0F);
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 9; ++x) {
      CHECK(at(full, x, y) == doctest::Approx(1.0));
      CHECK(at(dark, x, y) == 0.0F);
      CHECK(at(none, x, y) == 0.0F);
    }
  }
}

TEST_CASE("sensor: mean and variance of the raw noise follow equation 3.10 at 20 levels of every ISO") {
  SensorParams params = plain();
  params.black = 8192;  // so that no noise is cut off below
  for (const npsim::NoiseAtIso& entry : npsim::kDefaultNoise) {
    for (int i = 0; i < 20; ++i) {
      const float x = 0.04F * static_cast<float>(i);
      const Plane plane =
          captured(params, Image({160, 160}, {x, x, x}), {entry.level, 1.0F}, 1.0F, 31, static_cast<std::uint32_t>(i));
      double sum = 0;
      double squares = 0;
      const double n = 160 * 80;  // green alone
      for (int y = 0; y < 160; ++y) {
        for (int k = 1 - y % 2; k < 160; k += 2) {
          const double d = static_cast<double>(at(plane, k, y)) - static_cast<double>(x);
          sum += d;
          squares += d * d;
        }
      }
      const double level = 1.0 / 57343;  // of the converter
      const double variance = static_cast<double>(entry.level.beta1) * static_cast<double>(x) +
                              static_cast<double>(entry.level.beta2) + level * level / 12;
      CAPTURE(entry.iso);
      CAPTURE(x);
      CHECK(std::fabs(sum / n) < 4 * std::sqrt(variance / n));
      CHECK(std::fabs(squares / n / variance - 1) < 4 * std::sqrt(2 / n));
    }
  }
}

TEST_CASE("sensor: levels of the converter: 10, 12 and 14 bits, none below black nor above full scale") {
  for (const int bits : {10, 12, 14}) {
    SensorParams params = plain();
    params.bits = bits;
    params.black = 64;
    const Plane plane = captured(params, colours(64, 64), {{1e-2F, 1e-3F}, 1.0F});
    const double levels = (1 << bits) - 1 - 64;
    for (int y = 0; y < 64; ++y) {
      for (int x = 0; x < 64; ++x) {
        const double dn = static_cast<double>(at(plane, x, y)) * levels + 64;
        CHECK(std::fabs(dn - std::round(dn)) < 2e-3);
        CHECK(dn > -1e-3);
        CHECK(dn < (1 << bits) - 1 + 1e-2);
      }
    }
  }
}

TEST_CASE("sensor: raw noise has the same bits for any order of the chunks and is no other image's or pixel's") {
  const Image grey({200, 64}, {0.3F, 0.3F, 0.3F});
  const NoiseParams noise{{1e-3F, 1e-5F}, 1.0F};
  const Plane a = captured(plain(), grey, noise);
  const Plane again = captured(plain(), grey, noise, 1, 0, 0, npsim_test::BackwardExecutor{});
  const Plane other = captured(plain(), grey, noise, 1, 0, 1);
  const Plane seeded = captured(plain(), grey, noise, 1, 1, 0);
  CHECK(a == again);
  double power = 0;
  double image = 0;
  double seed = 0;
  double beside = 0;
  double below = 0;
  double run = 0;
  const auto d = [](const Plane& p, int x, int y) { return static_cast<double>(at(p, x, y)) - 0.3; };
  const auto green = [](int x, int y) { return (x + y) % 2 != 0; };
  for (int y = 0; y < 62; ++y) {
    for (int x = 0; x < 160; ++x) {
      if (!green(x, y)) continue;
      power += d(a, x, y) * d(a, x, y);
      image += d(a, x, y) * d(other, x, y);
      seed += d(a, x, y) * d(seeded, x, y);
      beside += d(a, x, y) * d(a, x + 2, y);
      below += d(a, x, y) * d(a, x, y + 2);
      run += d(a, x, y) * d(a, x + 16, y);  // the other number of a pair
    }
  }
  const double bound = 4 / std::sqrt(62 * 80.0);
  for (const double product : {image, seed, beside, below, run}) CHECK(std::fabs(product / power) < bound);
}

TEST_CASE("sensor: the lens' blur keeps the light and has its variance, vignetting is cos^4 of the angle") {
  SensorParams params = plain();
  params.blur_px = 0.7F;
  Image image({33, 33});
  image(16, 16) = {0.8F, 0.8F, 0.8F};
  for (Vec3f& row : params.response) row = {0, 1, 0};
  const Plane plane = captured(params, image);
  double sum = 0;
  double variance = 0;
  for (int y = 0; y < 33; ++y) {
    for (int x = 0; x < 33; ++x) {
      sum += static_cast<double>(at(plane, x, y));
      variance += static_cast<double>(at(plane, x, y)) * (x - 16) * (x - 16);
    }
  }
  CHECK(sum == doctest::Approx(0.8).epsilon(1e-3));
  CHECK(variance / sum == doctest::Approx(0.49).epsilon(2e-3));

  params.blur_px = 0;
  params.vignetting = 0.5F;
  const Plane fading = captured(params, Image({201, 3}, {0.5F, 0.5F, 0.5F}));
  CHECK(at(fading, 100, 1) == doctest::Approx(0.5).epsilon(1e-3));
  CHECK(at(fading, 200, 1) == doctest::Approx(0.5 * (1 - 0.5 * 0.75)).epsilon(1e-3));  // 45 degrees
}

TEST_CASE("sensor: row noise adds one number to a row, of its standard deviation, another in every picture") {
  SensorParams params = plain();
  params.black = 8192;
  params.row_noise = 0.5F;
  const NoiseParams noise{{0.0F, 1e-4F}, 1.0F};
  const int rows = 2000;
  const Image grey({64, rows}, {0.3F, 0.3F, 0.3F});
  const auto means = [&](std::uint32_t index) {
    const Plane plane = captured(params, grey, noise, 1, 0, index);
    std::vector<double> mean(rows);
    for (int y = 0; y < rows; ++y) {
      for (int x = 0; x < 64; ++x) {
        const double expected = 0.3 * (npsim::filter_at(params.mosaic, x, y) == 0   ? 0.52
                                       : npsim::filter_at(params.mosaic, x, y) == 1 ? 1.0
                                                                                    : 0.62);
        mean[static_cast<std::size_t>(y)] += (static_cast<double>(at(plane, x, y)) - expected) / 64;
      }
    }
    return mean;
  };
  const std::vector<double> a = means(0);
  const std::vector<double> b = means(1);
  double power = 0;
  double shared = 0;
  double beside = 0;
  for (std::size_t y = 0; y < rows; ++y) {
    power += a[y] * a[y] / rows;
    shared += a[y] * b[y] / rows;
    if (y > 0) beside += a[y] * a[y - 1] / rows;
  }
  const double variance = 1e-4 * (0.25 + 1.0 / 64);  // what 64 samples' own noise leaves of it
  CHECK(power == doctest::Approx(variance).epsilon(4 * std::sqrt(2.0 / rows)));
  CHECK(std::fabs(shared / power) < 4 / std::sqrt(rows));
  CHECK(std::fabs(beside / power) < 4 / std::sqrt(rows));
}

TEST_CASE(
    "sensor: hot pixels are the sensor's: the same in every picture, others in another camera, as many as stated") {
  SensorParams params = plain();
  params.hot_pixels = 1e-3F;
  const Image black({500, 400});
  const auto taken = [&](const SensorParams& p, std::uint64_t seed, std::uint32_t index) {
    Plane plane(npsim::mosaic_shape(black.shape()));
    const npsim::SerialExecutor executor;
    const float hot = npsim::hot_signal(p, 1.0F / 30.0F, 1600.0F);
    CHECK(hot == doctest::Approx(0.05 * 16 / 30));
    REQUIRE(
        npsim::capture(p, 1, {}, {100, 100, 250, 200}, seed, index, black.view(), plane.view(), executor, hot).ok());
    return plane;
  };
  const Plane a = taken(params, 1, 0);
  CHECK(a == taken(params, 2, 5));
  SensorParams other = params;
  other.serial = 2;
  const Plane b = taken(other, 1, 0);
  int count = 0;
  int shared = 0;
  double sum = 0;
  for (int y = 0; y < 400; ++y) {
    for (int x = 0; x < 500; ++x) {
      count += at(a, x, y) > 0;
      shared += at(a, x, y) > 0 && at(b, x, y) > 0;
      sum += static_cast<double>(at(a, x, y));
    }
  }
  CHECK(std::abs(count - 200) < 4 * std::sqrt(200.0));
  CHECK(sum / count == doctest::Approx(0.05 * 16 / 30).epsilon(4 / std::sqrt(200.0)));
  CHECK(shared <= 2);
}

TEST_CASE("sensor: raw levels are the converter's, in 16 bits; several exposures have none") {
  SensorParams params = plain();
  params.bits = 12;
  params.black = 64;
  const Image image = colours(37, 21);
  const Plane plane = captured(params, image, {{1e-3F, 1e-4F}, 1.0F}, 2.0F);
  npsim_test::Image<std::uint16_t> levels({37, 21});
  const npsim::SerialExecutor executor;
  REQUIRE(npsim::raw_levels(params, plane.view(), levels.view(), executor).ok());
  for (int y = 0; y < 21; ++y) {
    for (int x = 0; x < 37; ++x) {
      CHECK(static_cast<double>(levels(x, y)) == doctest::Approx(static_cast<double>(at(plane, x, y)) * 4031 + 64));
      CHECK(levels(x, y) <= 4095);
    }
  }
  params.exposures = 2;
  CHECK(npsim::raw_levels(params, plane.view(), levels.view(), executor).code() == npsim::StatusCode::invalid_argument);
}

TEST_CASE("sensor: three exposures hold 256 times full scale, each with the noise of its own") {
  SensorParams params = plain();
  params.exposures = 3;
  for (Vec3f& row : params.response) row = {0, 1, 0};
  for (const float x : {0.5F, 5.0F, 60.0F, 200.0F}) {
    const Plane plane = captured(params, Image({96, 96}, {x, x, x}), {{1e-3F, 1e-5F}, 1.0F});
    double sum = 0;
    double squares = 0;
    for (int y = 0; y < 96; ++y) {
      for (int k = 0; k < 96; ++k) {
        const double v = static_cast<double>(at(plane, k, y)) - static_cast<double>(x);
        sum += v;
        squares += v * v;
      }
    }
    const double scale = x < 0.9F ? 1 : (x < 14.4F ? 16 : 256);
    const double variance = scale * scale * (1e-3 * static_cast<double>(x) / scale + 1e-5);
    const double n = 96 * 96;
    CHECK(std::fabs(sum / n) < 4 * std::sqrt(variance / n));
    CHECK(std::fabs(squares / n / variance - 1) < 4 * std::sqrt(2 / n));
  }
  const Plane over = captured(params, Image({4, 4}, {1e9F, 1e9F, 1e9F}));
  CHECK(at(over, 2, 2) == doctest::Approx(256.0));
}

TEST_CASE("sensor: demosaicing keeps a constant and a slope, in four mosaics, to the borders of the constant") {
  for (const Mosaic mosaic : kMosaics) {
    for (const npsim::Demosaic method : {npsim::Demosaic::bilinear, npsim::Demosaic::gradient}) {
      const int n = 21;
      Plane plane({n + 2 * kMosaicMargin, 9});
      const double level[3] = {0.2, 0.5, 0.7};
      for (const double slope : {0.0, 0.005}) {
        for (int y = 0; y < 9; ++y) {
          for (int x = -kMosaicMargin; x < n + kMosaicMargin; ++x) {
            plane(x + kMosaicMargin, y) =
                static_cast<float>(level[npsim::filter_at(mosaic, x + 2, y)] + slope * (x + 2 * y));
          }
        }
        for (int y = 0; y < 9; ++y) {
          for (int x = 0; x < n; ++x) {
            if (slope > 0 && (y < 2 || y > 6)) continue;  // mirrored rows have no slope
            const auto out = demosaiced(method, mosaic, plane, x, y);
            const double rise = slope * (x + 2 * y);
            CHECK(out.rgb.x.value == doctest::Approx(level[0] + rise).epsilon(1e-5));
            CHECK(out.rgb.y.value == doctest::Approx(level[1] + rise).epsilon(1e-5));
            CHECK(out.rgb.z.value == doctest::Approx(level[2] + rise).epsilon(1e-5));
          }
        }
      }
    }
  }
}

TEST_CASE("sensor: white balance adds up whole quads that are not clipped, in any number of lanes") {
  const Image image = colours(67, 2);
  const Plane plane = captured(plain(), image);
  const float* rows[2] = {plane.cview().row(0) + kMosaicMargin, plane.cview().row(1) + kMosaicMargin};
  for (const int width : {0, 1, 2, 3, 16, 33, 67}) {
    CAPTURE(width);
    for (const float clip : {0.3F, 10.0F}) {
      double batches[4] = {};
      double single[4] = {};
      double expected[4] = {};
      npsim::white_balance_detail::sum_quads<npsim::simd::F32>(rows[0], rows[1], width, clip, batches);
      npsim::white_balance_detail::sum_quads<npsim::simd::scalar::F32>(rows[0], rows[1], width, clip, single);
      for (int x = 0; x + 1 < width; x += 2) {
        const float quad[4] = {rows[0][x], rows[0][x + 1], rows[1][x], rows[1][x + 1]};
        if (!(*std::max_element(quad, quad + 4) < clip)) continue;
        for (int i = 0; i < 4; ++i) expected[i] += static_cast<double>(quad[i]);
      }
      for (int i = 0; i < 4; ++i) {
        CHECK(batches[i] == single[i]);
        CHECK(batches[i] == doctest::Approx(expected[i]).epsilon(1e-6));
      }
    }
  }
}

TEST_CASE("sensor: batches demosaic as single pixels do, bit by bit") {
  const Image image = colours(53, 11);
  for (const Mosaic mosaic : kMosaics) {
    SensorParams params = plain();
    params.mosaic = mosaic;
    const Plane plane = captured(params, image);
    using F = npsim::simd::F32;
    for (int y = 0; y < 11; ++y) {
      const npsim::MosaicRows rows = npsim::mosaic_rows(plane.cview(), y);
      for (int x = 0; x < 53; x += F::lanes) {
        const int n = 53 - x < F::lanes ? 53 - x : F::lanes;
        const auto batch = npsim::demosaic<F>(npsim::Demosaic::gradient, mosaic, rows, x, y, n);
        for (int i = 0; i < n; ++i) {
          const auto one = demosaiced(npsim::Demosaic::gradient, mosaic, plane, x + i, y);
          CHECK(batch.rgb.x.lane(i) == one.rgb.x.value);
          CHECK(batch.rgb.y.lane(i) == one.rgb.y.value);
          CHECK(batch.rgb.z.lane(i) == one.rgb.z.value);
          CHECK(batch.peak.lane(i) == one.peak.value);
        }
      }
    }
  }
}

TEST_CASE("sensor: the gradient filters follow a grey edge that the bilinear ones fringe with colour") {
  Plane plane({40 + 2 * kMosaicMargin, 8});
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 40 + 2 * kMosaicMargin; ++x) plane(x, y) = x < 22 ? 0.3F : 0.5F;
  }
  const auto fringe = [&](npsim::Demosaic method) {
    double most = 0;
    for (int x = 0; x < 40; ++x) {
      const auto c = demosaiced(method, Mosaic::rggb, plane, x, 4).rgb;
      most = std::fmax(most, std::fabs(static_cast<double>(c.x.value - c.y.value)));
      most = std::fmax(most, std::fabs(static_cast<double>(c.z.value - c.y.value)));
    }
    return most;
  };
  CHECK(fringe(npsim::Demosaic::gradient) < 0.6 * fringe(npsim::Demosaic::bilinear));
}

TEST_CASE("sensor: demosaicing knows numbers alone, at the end of the range of four exposures and below black") {
  for (const float bright : {1e-3F, 1.0F, 256.0F, 1.7e7F}) {
    Plane plane({24 + 2 * kMosaicMargin, 12});
    for (int y = 0; y < 12; ++y) {
      for (int x = 0; x < 24 + 2 * kMosaicMargin; ++x) plane(x, y) = x < 16 ? bright : (y % 3 == 0 ? -0.01F : 0.0F);
    }
    for (int y = 0; y < 12; ++y) {
      for (int x = 0; x < 24; ++x) {
        const auto c = demosaiced(npsim::Demosaic::gradient, Mosaic::gbrg, plane, x, y).rgb;
        for (const float v : {c.x.value, c.y.value, c.z.value}) {
          CHECK(v >= -0.1F);  // false for NaN
          CHECK(v <= 1.5F * bright);
        }
      }
    }
  }
}

TEST_CASE("sensor: the outline of a clipped lamp has no dots, at its corners neither: what is dark stays dark") {
  const auto worst = [](npsim::Demosaic method, const auto& is_lamp) {
    const int n = 24;
    Plane plane({n + 2 * kMosaicMargin, n});
    const float dark[3] = {0.02F, 0.015F, 0.01F};
    for (int y = 0; y < n; ++y) {
      for (int x = -kMosaicMargin; x < n + kMosaicMargin; ++x) {
        plane(x + kMosaicMargin, y) = is_lamp(x, y) ? 1.0F : dark[npsim::filter_at(Mosaic::rggb, x + 2, y)];
      }
    }
    double most = 0;
    for (int y = 4; y < n - 4; ++y) {
      for (int x = 4; x < n - 4; ++x) {
        if (is_lamp(x, y)) continue;
        const auto c = demosaiced(method, Mosaic::rggb, plane, x, y).rgb;
        most = std::fmax(most, std::fabs(static_cast<double>(c.x.value - dark[0])));
        most = std::fmax(most, std::fabs(static_cast<double>(c.y.value - dark[1])));
        most = std::fmax(most, std::fabs(static_cast<double>(c.z.value - dark[2])));
      }
    }
    return most;
  };
  const auto row = [](int, int y) { return y >= 12; };
  const auto column = [](int x, int) { return x >= 12; };
  CHECK(worst(npsim::Demosaic::bilinear, row) > 0.2);
  CHECK(worst(npsim::Demosaic::gradient, row) < 0.01);
  CHECK(worst(npsim::Demosaic::gradient, column) < 0.01);
  for (int phase = 0; phase < 4; ++phase) {  // the filter at the lamp's corner
    const auto corner = [phase](int x, int y) { return x >= 12 + phase % 2 && y >= 12 + phase / 2; };
    CAPTURE(phase);
    CHECK(worst(npsim::Demosaic::gradient, corner) < 0.01);
  }
}

TEST_CASE("sensor: denoising halves the noise of a flat area, leaves an edge, and is a copy at strength 0") {
  const NoiseParams noise{{1e-3F, 1e-5F}, 1.0F};
  Image step({120, 120}, {0.003F, 0.003F, 0.003F});
  for (int y = 0; y < 120; ++y) {
    for (int x = 60; x < 120; ++x) step(x, y) = {0.5F, 0.5F, 0.5F};
  }
  SensorParams params = plain();
  params.black = 8192;
  for (Vec3f& row : params.response) row = {0, 1, 0};
  const Plane noisy = captured(params, step, noise);
  Plane out(noisy.shape());
  const npsim::SerialExecutor executor;
  const auto deviation = [](const Plane& p) {
    double sum = 0;
    for (int y = 4; y < 116; ++y) {
      for (int x = 4; x < 56; ++x) sum += std::pow(static_cast<double>(at(p, x, y)) - 0.003, 2);
    }
    return std::sqrt(sum / (112 * 52));
  };
  double before = 1;
  for (const float strength : {2.0F, 4.0F, 8.0F}) {
    REQUIRE(npsim::denoise_raw({strength, 1.0F}, params, noise, noisy.view(), out.view(), executor).ok());
    const double left = deviation(out) / deviation(noisy);
    CHECK(left < before);
    CHECK(left == doctest::Approx(strength < 3 ? 0.74 : (strength < 5 ? 0.49 : 0.37)).epsilon(0.05));
    before = left;
    for (int y = 0; y < 120; ++y) CHECK(at(out, 60, y) > 0.4F);
  }
  REQUIRE(npsim::denoise_raw({0.0F, 1.0F}, params, noise, noisy.view(), out.view(), executor).ok());
  CHECK(out == noisy);
}

TEST_CASE("sensor: denoising knows the converter's levels, between which hardly any noise lets samples fall") {
  SensorParams params = plain();
  params.bits = 10;
  params.black = 64;
  for (Vec3f& row : params.response) row = {0, 1, 0};
  const double level = 1.0 / (1023 - 64);
  const auto between = static_cast<float>(20.5 * level);
  const NoiseParams noise{{0.0F, static_cast<float>(0.05 * level * 0.05 * level)}, 1.0F};
  const Plane coarse = captured(params, Image({120, 120}, {between, between, between}), noise);
  Plane out(coarse.shape());
  const npsim::SerialExecutor executor;
  REQUIRE(npsim::denoise_raw({5.0F, 1.0F}, params, noise, coarse.view(), out.view(), executor).ok());
  const auto deviation = [&](const Plane& p) {
    double sum = 0;
    for (int y = 4; y < 116; ++y) {
      for (int x = 4; x < 116; ++x) sum += std::pow(static_cast<double>(at(p, x, y) - between), 2);
    }
    return std::sqrt(sum / (112 * 112));
  };
  REQUIRE(deviation(coarse) == doctest::Approx(0.5 * level).epsilon(0.02));
  CHECK(deviation(out) < 0.7 * deviation(coarse));
}

TEST_CASE("sensor: white balance: LED of 4000 K becomes nearly white, sodium stays orange, limits and fixed hold") {
  const npsim::SerialExecutor executor;
  const auto gains = [&](const npsim::WhiteBalanceParams& params, const Vec3f& light) {
    const Plane plane = captured(plain(), Image({48, 40}, light), {}, 0.3F);
    npsim_test::Scratch scratch(npsim::white_balance_workspace_bytes({48, 40}));
    Vec3f out;
    REQUIRE(npsim::white_balance(params, plain(), plane.cview(), out, scratch.workspace(), executor).ok());
    CHECK(std::fmin(out.x, std::fmin(out.y, out.z)) == doctest::Approx(1.0));
    return out;
  };
  const auto balanced = [&](const Vec3f& gain, const Vec3f& light) {
    const SensorParams s = plain();
    return Vec3f{gain.x * dot(s.response[0], light), gain.y * dot(s.response[1], light),
                 gain.z * dot(s.response[2], light)};
  };
  npsim::WhiteBalanceParams params;
  params.adaptation = 1;
  const Vec3f led = npsim::xy_to_linear_srgb(npsim::cct_to_xy(4000, npsim::Locus::planckian).value()).value();
  const Vec3f white = balanced(gains(params, led), led);
  CHECK(white.x == doctest::Approx(static_cast<double>(white.y)).epsilon(0.02));
  CHECK(white.z == doctest::Approx(static_cast<double>(white.y)).epsilon(0.02));
  const Vec3f sodium = npsim::xy_to_linear_srgb(npsim::illuminant::kHighPressureSodium1).value();
  const Vec3f orange = balanced(gains({}, sodium), sodium);
  CHECK(orange.x > 1.3F * orange.y);
  CHECK(orange.z < 0.5F * orange.y);
  params.fixed_k = 4000;
  const Vec3f fixed = balanced(gains(params, sodium), led);
  CHECK(fixed.x == doctest::Approx(static_cast<double>(fixed.y)).epsilon(1e-3));
  // Nothing to see, or nothing but saturated samples: daylight.
  const Vec3f dark = gains({}, {0, 0, 0});
  CHECK(dark == gains({}, {1e9F, 1e9F, 1e9F}));
  // A halo above white that the sensor still takes does not outweigh the street.
  Image mixed({48, 40}, led * 0.05F);
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 48; ++x) mixed(x, y) = sodium;
  }
  const Plane plane = captured(plain(), mixed, {}, 0.9F);
  const auto with_white = [&](float part) {
    npsim_test::Scratch scratch(npsim::white_balance_workspace_bytes({48, 40}));
    Vec3f out;
    REQUIRE(npsim::white_balance({}, plain(), plane.cview(), out, scratch.workspace(), executor, part).ok());
    return out;
  };
  const Vec3f street = gains({}, led);
  CHECK(with_white(0.2F).z == doctest::Approx(static_cast<double>(street.z)).epsilon(0.02));
  CHECK(with_white(1.0F).z > 1.1F * street.z);
  CHECK(balanced(dark, {1, 1, 1}).x == doctest::Approx(static_cast<double>(balanced(dark, {1, 1, 1}).y)).epsilon(0.03));
}

TEST_CASE("sensor: capture refuses parameters out of range and planes without margins") {
  const Image image({8, 8}, {1, 1, 1});
  const npsim::SerialExecutor executor;
  Plane plane(npsim::mosaic_shape({8, 8}));
  Plane bare({8, 8});
  const npsim::Intrinsics camera{100, 100, 4, 4};
  const auto code = [&](const SensorParams& p, float gain, Plane& to) {
    return npsim::capture(p, gain, {}, camera, 0, 0, image.view(), to.view(), executor).code();
  };
  CHECK(code({}, 1, plane) == npsim::StatusCode::ok);
  CHECK(code({}, 1, bare) == npsim::StatusCode::shape_mismatch);
  CHECK(code({}, -1, plane) == npsim::StatusCode::invalid_argument);
  SensorParams bad;
  bad.bits = 4;
  CHECK(code(bad, 1, plane) == npsim::StatusCode::invalid_argument);
  bad = {};
  bad.response[1] = {0, 0, 0};
  CHECK(code(bad, 1, plane) == npsim::StatusCode::invalid_argument);
  bad = {};
  bad.exposures = 9;
  CHECK(code(bad, 1, plane) == npsim::StatusCode::invalid_argument);
}
