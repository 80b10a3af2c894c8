// SPDX-License-Identifier: Apache-2.0
#include "npsim/metrics/picture_errors.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/metrics/luminance_errors.hpp"
#include "reference/flip.hpp"

namespace {

using npsim::ImageView;
using npsim::Rgb8;
using npsim::Shape;
using npsim::StatusCode;
using npsim::Vec3f;
using npsim_test::Image;

constexpr Shape kShape{37, 23};

Image<Rgb8> noise(Shape shape, std::uint32_t seed) {
  std::mt19937 random(seed);
  Image<Rgb8> out(shape, {}, 3);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const auto byte = [&] { return static_cast<std::uint8_t>(random() >> 24U); };
      out(x, y) = {byte(), byte(), byte()};
    }
  }
  return out;
}

// A gradient with bright squares and coloured lamps: edges, points, dark and saturated places.
Image<Rgb8> scene(int shift) {
  Image<Rgb8> out(kShape);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const auto ramp = static_cast<std::uint8_t>(3 * x + y);
      out(x, y) = {ramp, ramp, static_cast<std::uint8_t>(2 * y)};
      if (x / 5 == 2 && y > 9 + shift) out(x, y) = {250, 240, 200};
    }
  }
  out(25 + shift, 6) = {255, 0, 10};
  out(30, 12 + shift) = {0, 255, 40};
  return out;
}

template <class Executor>
double flip_of(const Image<Rgb8>& a, const Image<Rgb8>& b, Image<float>& error, Executor& executor,
               float pixels_per_degree = npsim::FlipParams{}.pixels_per_degree) {
  npsim::FlipParams params;
  params.pixels_per_degree = pixels_per_degree;
  npsim_test::Scratch scratch(npsim::flip_workspace_bytes(params, a.shape()));
  error = Image<float>(a.shape());
  double mean = -1;
  REQUIRE(npsim::flip(params, a.view(), b.view(), error.view(), mean, scratch.workspace(), executor).ok());
  return mean;
}

template <class Executor>
npsim::PictureErrors errors_of(const Image<Rgb8>& a, const Image<Rgb8>& b, Executor& executor) {
  npsim_test::Scratch scratch(npsim::picture_errors_workspace_bytes(a.shape()));
  npsim::PictureErrors out;
  REQUIRE(npsim::picture_errors(a.view(), b.view(), out, scratch.workspace(), executor).ok());
  return out;
}

// SSIM as the paper writes it: central moments of every window, one window after the other.
double ssim_by_windows(const Image<Rgb8>& a, const Image<Rgb8>& b) {
  double total = 0;
  int windows = 0;
  for (int y = 5; y + 5 < a.shape().height; ++y) {
    for (int x = 5; x + 5 < a.shape().width; ++x) {
      const auto mean = [&](const auto& value) {
        double sum = 0;
        double weights = 0;
        for (int j = -5; j <= 5; ++j) {
          for (int i = -5; i <= 5; ++i) {
            const double w = std::exp(-(i * i + j * j) / 4.5);
            sum += w * value(a(x + i, y + j), b(x + i, y + j));
            weights += w;
          }
        }
        return sum / weights;
      };
      const auto luma = [](const Rgb8& c) { return 0.299 * c.r + 0.587 * c.g + 0.114 * c.b; };
      const double p = mean([&](const Rgb8& c, const Rgb8&) { return luma(c); });
      const double q = mean([&](const Rgb8&, const Rgb8& c) { return luma(c); });
      const double pp = mean([&](const Rgb8& c, const Rgb8&) { return (luma(c) - p) * (luma(c) - p); });
      const double qq = mean([&](const Rgb8&, const Rgb8& c) { return (luma(c) - q) * (luma(c) - q); });
      const double pq = mean([&](const Rgb8& c, const Rgb8& d) { return (luma(c) - p) * (luma(d) - q); });
      total += (2 * p * q + 6.5025) * (2 * pq + 58.5225) / ((p * p + q * q + 6.5025) * (pp + qq + 58.5225));
      ++windows;
    }
  }
  return total / windows;
}

TEST_CASE("flip: every pixel within 1e-4 of the two-dimensional filters in double") {
  npsim::SerialExecutor executor;
  for (const float ppd : {67.0206F, 20.0F}) {
    for (const bool rough : {false, true}) {
      const Image<Rgb8> a = rough ? noise(kShape, 1) : scene(0);
      const Image<Rgb8> b = rough ? noise(kShape, 2) : scene(3);
      Image<float> error;
      const double mean = flip_of(a, b, error, executor, ppd);
      const npsim_test::ReferenceFlip reference(a.view(), b.view(), static_cast<double>(ppd));
      double worst = 0;
      double sum = 0;
      for (int y = 0; y < kShape.height; ++y) {
        for (int x = 0; x < kShape.width; ++x) {
          const double exact = reference.error(x, y);
          worst = std::max(worst, std::fabs(static_cast<double>(error(x, y)) - exact));
          sum += exact;
        }
      }
      CHECK(worst < 1e-4);
      CHECK(mean == doctest::Approx(sum / static_cast<double>(kShape.pixels())).epsilon(1e-4));
      CHECK(mean > 0.02);
    }
  }
}

TEST_CASE("flip: 0 between equal pictures, 1 between plain green and plain blue, the same bits in any order of rows") {
  npsim::SerialExecutor executor;
  npsim_test::BackwardExecutor backward;
  Image<float> error;
  CHECK(flip_of(noise(kShape, 3), noise(kShape, 3), error, executor) == 0.0);
  CHECK(flip_of(Image<Rgb8>(kShape, {0, 255, 0}), Image<Rgb8>(kShape, {0, 0, 255}), error, executor) ==
        doctest::Approx(1.0).epsilon(1e-4));
  Image<float> again;
  const double mean = flip_of(scene(0), scene(2), error, executor);
  CHECK(flip_of(scene(0), scene(2), again, backward) == mean);
  CHECK(error == again);
  Image<float> single;
  CHECK(flip_of(Image<Rgb8>({1, 1}), Image<Rgb8>({1, 1}, {255, 255, 255}), single, executor) > 0.5);
}

TEST_CASE("picture errors: one code off in every channel is 48.13 dB, SSIM is that of the windows one by one") {
  npsim::SerialExecutor executor;
  npsim_test::BackwardExecutor backward;
  const Image<Rgb8> grey(kShape, {100, 100, 100});
  const npsim::PictureErrors off = errors_of(grey, Image<Rgb8>(kShape, {101, 99, 101}), executor);
  CHECK(off.psnr_db == doctest::Approx(48.1308).epsilon(1e-6));
  CHECK(errors_of(grey, grey, executor).ssim == doctest::Approx(1.0));
  CHECK(std::isinf(errors_of(grey, grey, executor).psnr_db));
  for (const int shift : {1, 4}) {
    const npsim::PictureErrors e = errors_of(scene(0), scene(shift), executor);
    CHECK(e.ssim == doctest::Approx(ssim_by_windows(scene(0), scene(shift))).epsilon(1e-9));
    CHECK(errors_of(scene(0), scene(shift), backward).ssim == e.ssim);
  }
  npsim_test::Scratch scratch(npsim::picture_errors_workspace_bytes({10, 30}));
  npsim::PictureErrors out;
  const Image<Rgb8> narrow({10, 30});
  CHECK(npsim::picture_errors(narrow.cview(), narrow.cview(), out, scratch.workspace(), executor).code() ==
        StatusCode::no_valid_input);
}

TEST_CASE("luminance errors: half and double are one stop, black and NaN are bounded, dark truth does not count") {
  const Shape shape{100, 10};
  Image<Vec3f> truth(shape, {1.0F, 1.0F, 1.0F});
  Image<Vec3f> estimate(shape, {0.5F, 0.5F, 0.5F});
  for (int x = 0; x < 100; ++x) {
    truth(x, 0) = {0.004F, 0.004F, 0.004F};  // below the floor
    estimate(x, 1) = {4.0F, 4.0F, 4.0F};     // a ninth of the rest: beyond the 95th percentile's rank
  }
  estimate(0, 2) = {std::numeric_limits<float>::quiet_NaN(), 0.0F, 0.0F};
  estimate(1, 2) = {};
  npsim_test::Scratch scratch(npsim::luminance_errors_workspace_bytes(shape));
  npsim::LuminanceErrors out;
  const auto measure = [&](ImageView<const std::uint8_t> mask) {
    return npsim::luminance_errors({}, estimate.cview(), truth.cview(), mask, out, scratch.workspace());
  };
  REQUIRE(measure({}).ok());
  CHECK(out.pixels == 900);
  CHECK(out.median == doctest::Approx(1.0));
  CHECK(out.bias == doctest::Approx(-1.0));
  CHECK(out.p95 == doctest::Approx(2.0));
  // 100 pixels are off by 3, the rest by 1/2, two by 1; none of 900 is trimmed.
  CHECK(out.trimmed_relative_squared == doctest::Approx((100 * 9.0 + 798 * 0.25 + 2 * 1.0) / 900).epsilon(1e-4));
  Image<std::uint8_t> mask(shape);
  for (int x = 0; x < 100; ++x) mask(x, 2) = 1;
  REQUIRE(measure(mask.cview()).ok());
  CHECK(out.pixels == 100);
  CHECK(out.bias == doctest::Approx(-1.0));
  for (int x = 0; x < 100; ++x) mask(x, 2) = 0;
  CHECK(measure(mask.cview()).code() == StatusCode::no_valid_input);
}

}  // namespace
