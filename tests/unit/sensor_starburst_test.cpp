// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "npsim/core/executor.hpp"
#include "npsim/sensor/starburst.hpp"
#include "unit/sensor_fixture.hpp"

namespace {

using npsim::Shape;
using npsim::StarburstParams;
using npsim::StatusCode;
using npsim::Vec3f;
using sensor_test::Image;
using sensor_test::pixels;
using sensor_test::total;

constexpr float kFocal = 1000.0F;  // px
constexpr int kSize = 401;
constexpr int kMiddle = kSize / 2;

StarburstParams blades(int count, float turn_deg = 0.0F) {
  StarburstParams params;
  params.blades = count;
  params.turn_deg = turn_deg;
  return params;
}

template <class Executor = npsim::SerialExecutor>
Image burst(const StarburstParams& params, Image image, Executor executor = {}) {
  npsim_test::Scratch scratch(npsim::starburst_workspace_bytes(params, image.shape()));
  REQUIRE(npsim::add_starburst(params, kFocal, image.cview(), image.view(), scratch.workspace(), executor).ok());
  return image;
}

Image lamp() {
  Image image({kSize, kSize});
  image(kMiddle, kMiddle) = {1e6F, 1e6F, 1e6F};
  return image;
}

}  // namespace

TEST_CASE("sensor: along a spike of a starburst light falls by the square of the way, as the edges' diffraction does") {
  const StarburstParams params = blades(4);  // along the rows and columns, where a spike is one pixel wide
  const Image out = burst(params, lamp());
  const double pi = std::acos(-1.0);
  // lambda focal / (2 pi^2 apothem n) of each blade, two of which share a spike.
  const double strength = 2 * 540e-6 * static_cast<double>(kFocal) / (2 * pi * pi * 0.65 * 4);
  for (int s = 2; s < 190; ++s) {
    const double exact = 1e6 * strength * (1 / (s - 0.5) - 1 / (s + 0.5));
    CAPTURE(s);
    for (const Vec3f& p :
         {out(kMiddle + s, kMiddle), out(kMiddle - s, kMiddle), out(kMiddle, kMiddle + s), out(kMiddle, kMiddle - s)}) {
      CHECK(static_cast<double>(p.y) == doctest::Approx(exact).epsilon(1e-4));
      CHECK(static_cast<double>(p.x / p.y) == doctest::Approx(610.0 / 540.0).epsilon(1e-4));
    }
    CHECK(out(kMiddle + s, kMiddle + s).y == 0.0F);
  }
}

TEST_CASE("sensor: a starburst has as many spikes as an even number of blades, twice as many as an odd one") {
  for (const int count : {3, 5, 6, 7, 8}) {
    const Image out = burst(blades(count, 7.0F), lamp());
    // Along a circle of radius 100, in the order of the angle: where light begins.
    int spikes = 0;
    bool lit = true;
    for (int i = 0; i <= 3600; ++i) {
      const double angle = (i - 5) * 3.14159265358979 / 1800;
      const auto x = static_cast<int>(std::lround(100 * std::cos(angle)));
      const auto y = static_cast<int>(std::lround(100 * std::sin(angle)));
      const bool here = out(kMiddle + x, kMiddle + y).y > 0.0F;
      if (here && !lit) ++spikes;
      lit = here;
    }
    CAPTURE(count);
    CHECK(spikes == (count % 2 == 0 ? count : 2 * count));
  }
}

TEST_CASE("sensor: a wiped windscreen sends its share of a lamp beyond a degree to each side, along one line, white") {
  StarburstParams params;
  params.streak = 1e-3F;
  const Image out = burst(params, lamp());
  // A degree is 17.45 px; what would go further than the border at 200 px stays in the lamp.
  for (const int side : {-1, 1}) {
    double beyond = 0;
    for (int s = 18; s <= 200; ++s) beyond += static_cast<double>(out(kMiddle + side * s, kMiddle).y);
    CHECK(beyond / 1e6 == doctest::Approx(1e-3 * 17.4533 * (1 / 17.5 - 1 / 200.5)).epsilon(1e-6));
  }
  CHECK(out(kMiddle + 50, kMiddle).x == out(kMiddle + 50, kMiddle).z);
  CHECK(out(kMiddle, kMiddle + 50).y == 0.0F);
  CHECK(std::fabs(total(out) / 3e6 - 1.0) < 1e-5);
  // Clockwise as turn_deg: to the upper right and the lower left at -45, beside the spikes of an iris.
  StarburstParams both = blades(4);
  both.streak = 1e-3F;
  both.streak_deg = -45.0F;
  const Image crossed = burst(both, lamp());
  const Image spikes = burst(blades(4), lamp());
  CHECK(crossed(kMiddle + 40, kMiddle - 40).y > 0.1F);
  CHECK(crossed(kMiddle - 40, kMiddle + 40).y > 0.1F);
  CHECK(crossed(kMiddle + 40, kMiddle + 40).y == 0.0F);
  CHECK(crossed(kMiddle + 40, kMiddle).y == spikes(kMiddle + 40, kMiddle).y);
}

TEST_CASE("sensor: at any angle each column or row of a streak has the equation's light, within a pixel of its line") {
  StarburstParams params;
  params.streak = 1e-3F;
  for (const double degrees : {-80.0, -45.0, -20.0, 1.0, 33.0, 45.0, 58.0, 89.0}) {
    params.streak_deg = static_cast<float>(degrees);
    const Image out = burst(params, lamp());
    const double pi = std::acos(-1.0);
    const double along_x = std::cos(degrees * pi / 180);
    const double along_y = std::sin(degrees * pi / 180);
    const bool steep = std::fabs(along_y) > std::fabs(along_x);
    const double pace = steep ? std::fabs(along_y) : std::fabs(along_x);
    const double slope = steep ? along_x / along_y : along_y / along_x;
    const double c = 1e-3 * 17.4532925 * 1e6;
    for (const int step : {-190, -57, -2, 2, 3, 31, 150}) {
      double sum = 0;
      double moment = 0;
      for (int a = 0; a < kSize; ++a) {
        const auto light = static_cast<double>(steep ? out(a, kMiddle + step).y : out(kMiddle + step, a).y);
        sum += light;
        moment += light * (a - kMiddle);
      }
      CAPTURE(degrees);
      CAPTURE(step);
      // A step is 1 / pace long.
      CHECK(sum == doctest::Approx(c * pace * (1 / (std::abs(step) - 0.5) - 1 / (std::abs(step) + 0.5))).epsilon(1e-4));
      CHECK(std::fabs(moment / sum - slope * step) < 0.5);
    }
  }
}

TEST_CASE("sensor: lamps on one line of a streak add up, wherever the picture ends") {
  StarburstParams params;
  params.streak = 1e-3F;
  for (const float degrees : {-45.0F, 12.0F, 77.0F}) {
    params.streak_deg = degrees;
    for (const Shape shape : {Shape{70, 50}, Shape{3, 90}, Shape{90, 3}}) {
      Image all(shape);
      Image sum(shape);
      for (int i = 0; i < 40; ++i) {
        Image one(shape);
        const int x = i * 7 % shape.width;
        const int y = i * 5 % shape.height;
        one(x, y) = Vec3f{1.0F, 0.7F, 0.3F} * (1e3F + 40.0F * static_cast<float>(i));
        all(x, y) += one(x, y);
        const Image out = burst(params, one);
        for (std::size_t p = 0; p < pixels(out).size(); ++p) pixels(sum)[p] += pixels(out)[p];
      }
      const Image out = burst(params, all);
      for (std::size_t p = 0; p < pixels(out).size(); ++p) {
        CHECK(pixels(out)[p].x == doctest::Approx(static_cast<double>(pixels(sum)[p].x)).epsilon(1e-5));
      }
    }
  }
}

TEST_CASE("sensor: spikes go to the border, and along it") {
  for (const int at : {0, 1, 50, 99, 100}) {
    Image image({101, 101});
    image(at, 50) = image(50, at) = {1e6F, 1e6F, 1e6F};
    const Image out = burst(blades(4), image);
    CAPTURE(at);
    for (const int end : {0, 100}) {
      CHECK(out(at, end).y > 0.0F);
      CHECK(out(end, at).y > 0.0F);
    }
  }
}

TEST_CASE("sensor: a starburst keeps the light, lamps at the border and beside each other included") {
  for (const Shape shape : {Shape{160, 90}, Shape{33, 57}, Shape{1, 64}, Shape{64, 1}, Shape{1, 1}}) {
    Image image = sensor_test::lamps_in_the_dark(shape);
    image(0, 0) = {5e4F, 1, 1};
    image(shape.width - 1, shape.height - 1) = {1, 1, 5e4F};
    const Image out = burst(blades(7), image);
    CAPTURE(shape.width);
    CHECK(std::fabs(total(out) / total(image) - 1.0) < 1e-5);
    for (const Vec3f& p : pixels(out)) CHECK((p.x >= 0.0F && p.y >= 0.0F && p.z >= 0.0F));
    const Image same = burst(blades(7), image, npsim_test::BackwardExecutor{});
    for (std::size_t i = 0; i < pixels(out).size(); ++i) CHECK(pixels(same)[i] == pixels(out)[i]);
  }
}

TEST_CASE(
    "sensor: without blades, and of what is too dim, a starburst changes nothing; NaN and infinity do not spread") {
  Image dim({40, 30}, {0.05F, 0.05F, 0.05F});
  for (const float light : {0.05F, 10.0F}) {
    dim(20, 15) = {light, light, light};
    const Image out = burst(blades(light > 1 ? 6 : 0), dim);
    for (std::size_t i = 0; i < pixels(dim).size(); ++i) CHECK(pixels(out)[i] == pixels(dim)[i]);
  }
  Image broken({41, 41});
  broken(20, 20) = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -1.0F};
  const Image out = burst(blades(6), broken);
  CHECK(out(20, 20).x == 0.0F);
  CHECK(out(20, 20).y > 0.9F * npsim::kMaxSample);  // keeps its own
  CHECK(out(24, 20).x == 0.0F);
  CHECK(out(24, 20).y > 0.0F);
  CHECK(out(24, 20).y < 1e6F);  // but scatters as the cap does
}

TEST_CASE("sensor: a starburst refuses parameters out of range and a small workspace") {
  Image image({8, 8}, {1, 1, 1});
  npsim::SerialExecutor executor;
  const auto code = [&](const StarburstParams& params, float focal) {
    npsim_test::Scratch scratch(npsim::starburst_workspace_bytes(params, image.shape()));
    return npsim::add_starburst(params, focal, image.cview(), image.view(), scratch.workspace(), executor).code();
  };
  CHECK(code(blades(31), kFocal) == StatusCode::ok);
  for (const int count : {-1, 1, 2, 32}) CHECK(code(blades(count), kFocal) == StatusCode::invalid_argument);
  CHECK(code(blades(6), 0.0F) == StatusCode::invalid_argument);
  CHECK(code(blades(6), 1e5F) == StatusCode::invalid_argument);  // would send six times the light
  StarburstParams params = blades(6);
  params.apothem_mm = std::numeric_limits<float>::quiet_NaN();
  CHECK(code(params, kFocal) == StatusCode::invalid_argument);
  params = {};
  params.streak = 0.0021F;
  CHECK(code(params, kFocal) == StatusCode::invalid_argument);
  params.streak = 0.002F;
  CHECK(code(params, 7000.0F) == StatusCode::ok);
  CHECK(code(params, 8000.0F) == StatusCode::invalid_argument);  // would send more than a third
  npsim::Workspace none;
  CHECK(npsim::add_starburst(blades(6), kFocal, image.cview(), image.view(), none, executor).code() ==
        StatusCode::workspace_exhausted);
}
