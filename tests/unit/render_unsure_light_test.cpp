// SPDX-License-Identifier: Apache-2.0
#include "npsim/render/unsure_light.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace {

using namespace npsim;
using npsim_test::BackwardExecutor;
using npsim_test::Image;

constexpr Shape kShape{60, 44};
constexpr Label kOut = 250;  // stands for what takes no part

// A facade of one albedo in even light.
struct Facade {
  Image<Vec3f> albedo{kShape, Vec3f{0.3F, 0.25F, 0.2F}};
  Image<Label> label{kShape, label::building};
  Image<Vec3f> light{kShape, Vec3f{3, 2, 1}};  // radiance over albedo
  int iterations = 4;

  template <class F = simd::F32, class Executor = BackwardExecutor>
  void spread(int first = 0, int last = kShape.height, Executor executor = {}) {
    const std::size_t pixels = kShape.pixels();
    std::vector<float> guide(UnsureLightGuides::floats(kShape)), planes(3 * pixels), room(3 * pixels);
    const UnsureLightGuides guides{kShape, {guide.data(), guide.size()}, iterations};
    std::size_t i = 0;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x, ++i) {
        if (label(x, y) == kOut) {
          guides.leave_out(i);
        } else {
          guides.set(i, albedo(x, y), label(x, y));
        }
        planes[i] = light(x, y).x;
        planes[pixels + i] = light(x, y).y;
        planes[2 * pixels + i] = light(x, y).z;
      }
    }
    Span<float> in(planes.data(), planes.size());
    Span<float> out(room.data(), room.size());
    const Status status = first == 0 && last == kShape.height
                              ? spread_unsure_light<F>({}, guides, 3, in, out, executor)
                              : spread_unsure_light_in_rows<F>({}, guides, first, last, 3, in, out, executor);
    REQUIRE(status.ok());
    for (i = 0; i < pixels; ++i) light.view().data()[i] = {in[i], in[pixels + i], in[2 * pixels + i]};
  }
  [[nodiscard]] bool same_bits(const Facade& other) const {
    return std::memcmp(light.view().data(), other.light.view().data(), sizeof(Vec3f) * kShape.pixels()) == 0;
  }
};

// Labels in pieces, albedo that changes from pixel to pixel, holes, and light with no pattern at all.
Facade torn_facade() {
  Facade out;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      RandomStream pixel(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y));
      const float grey = 0.1F * std::exp(0.8F * pixel.uniform());
      out.albedo(x, y) = {grey, grey * (1.0F + 0.3F * pixel.uniform()), x > 40 ? 0.0F : grey};
      out.label(x, y) = pixel.uniform() < 0.1F ? kOut : (x + y > 50 ? label::building : label::car);
      out.light(x, y) = {pixel.uniform(), 9 * pixel.uniform(), pixel.uniform() < 0.5F ? 0.0F : 1.0F};
    }
  }
  return out;
}

// As the header says it, in double.
std::vector<Vec3d> by_definition(const Facade& f, const std::vector<Vec3d>& in, int step) {
  const double ratio = static_cast<double>(UnsureLightParams{}.ratio);
  const auto log_of = [](float a) { return std::log(std::max(static_cast<double>(a), 1e-3)); };
  std::vector<Vec3d> out = in;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (f.label(x, y) == kOut) continue;
      Vec3d sum;
      double weights = 0;
      for (int v = y - step; v <= y + step; v += step) {
        for (int u = x - step; u <= x + step; u += step) {
          if (!f.label.cview().contains(u, v) || f.label(u, v) != f.label(x, y)) continue;
          const Vec3f a = f.albedo(x, y), b = f.albedo(u, v);
          const Vec3d off{log_of(a.x) - log_of(b.x), log_of(a.y) - log_of(b.y), log_of(a.z) - log_of(b.z)};
          const double alike = std::max(0.0, 1 - dot(off, off) / (ratio * ratio));
          const double w = (u == x ? 0.5 : 0.25) * (v == y ? 0.5 : 0.25) * alike * alike;
          sum += in[static_cast<std::size_t>(v * kShape.width + u)] * w;
          weights += w;
        }
      }
      out[static_cast<std::size_t>(y * kShape.width + x)] = sum / weights;
    }
  }
  return out;
}

}  // namespace

TEST_CASE("unsure light: black and glaring scraps on a facade get the light that is around them") {
  Facade f;
  for (int y = 18; y < 22; ++y) {
    for (int x = 20; x < 24; ++x) f.light(x, y) = {};
    for (int x = 36; x < 38; ++x) f.light(x, y) = {9, 6, 3};
  }
  f.spread();
  for (int y = 10; y < 30; ++y) {
    for (int x = 10; x < 50; ++x) {
      CHECK(f.light(x, y).x > 2.7F);
      CHECK(f.light(x, y).x < 3.3F);
      CHECK(f.light(x, y).z == doctest::Approx(f.light(x, y).x / 3).epsilon(1e-5));
    }
  }
}

TEST_CASE("unsure light: nothing crosses into another label, twice the albedo, or what takes no part") {
  Facade f;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 20; x < kShape.width; ++x) f.light(x, y) = {};
    for (int x = 20; x < 30; ++x) f.label(x, y) = label::car;
    for (int x = 30; x < 40; ++x) f.label(x, y) = kOut;
    for (int x = 50; x < kShape.width; ++x) {
      f.albedo(x, y) = f.albedo(x, y) * 2.0F;
      f.light(x, y) = {1, 1, 1};
    }
    for (int x = 40; x < 50; ++x) f.light(x, y) = {7, 7, 7};
  }
  f.light(35, 20) = {1e6F, 0, 0};
  f.spread();
  const float expected[6] = {3, 0, 0, 0, 7, 1};
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (x == 35 && y == 20) continue;
      CAPTURE(x);
      CHECK(f.light(x, y).x == doctest::Approx(static_cast<double>(expected[x < 20 ? 0 : x / 10])).epsilon(1e-5));
    }
  }
  CHECK(f.light(35, 20) == Vec3f{1e6F, 0, 0});
}

TEST_CASE(
    "unsure light: the double-precision definition within 1e-5 of the greatest light, with holes, black albedo, at "
    "every border, and where light comes by way of nearly nothing") {
  for (const bool dark : {false, true}) {
    Facade f = torn_facade();
    for (int y = 0; y < (dark ? kShape.height : 0); ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        if (y < 20 || y > 21) f.light(x, y) = {};
      }
    }
    std::vector<Vec3d> expected;
    for (std::size_t i = 0; i < kShape.pixels(); ++i) expected.push_back(vec_cast<double>(f.light.view().data()[i]));
    for (int i = 0; i < f.iterations; ++i) expected = by_definition(f, expected, 1 << i);
    f.spread();
    const Vec3d greatest{1, 9, 1};
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const Vec3d off = vec_cast<double>(f.light.view().data()[i]) - expected[i];
      CHECK(std::fabs(off.x) <= 1e-5 * greatest.x);
      CHECK(std::fabs(off.y) <= 1e-5 * greatest.y);
      CHECK(std::fabs(off.z) <= 1e-5 * greatest.z);
      if (!dark) CHECK(length(off) <= 1e-5 * length(expected[i]));
    }
  }
}

TEST_CASE("unsure light: one lane and all lanes, any order, and a band alone give the same bits") {
  Facade all = torn_facade();
  all.iterations = 3;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (y < 18 || y >= 25) all.light(x, y) = {};
    }
  }
  Facade one = all;
  Facade forward = all;
  Facade band = all;
  all.spread();
  one.spread<simd::scalar::F32>();
  forward.spread(0, kShape.height, SerialExecutor());
  const int reach = unsure_light_reach_px(3);
  band.spread(18 - reach, 25 + reach);
  CHECK(all.same_bits(one));
  CHECK(all.same_bits(forward));
  CHECK(all.same_bits(band));
  CHECK(length(all.light(10, 18 - reach)) > 0);  // as far as that, and no further
  CHECK(length(all.light(10, 17 - reach)) == 0);
}

TEST_CASE("unsure light: the answer to a point has the variance that its iterations are chosen by") {
  Facade f;
  for (Vec3f& l : Span<Vec3f>(f.light.view().data(), kShape.pixels())) l = {};
  f.light(30, 22) = {1, 0, 0};
  f.iterations = 3;  // at 4, taps of pixels that it reaches leave the picture
  f.spread();
  double sum = 0, moment = 0;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      sum += static_cast<double>(f.light(x, y).x);
      moment += static_cast<double>(f.light(x, y).x) * (x - 30) * (x - 30);
    }
  }
  CHECK(sum == doctest::Approx(1).epsilon(1e-5));
  CHECK(moment / sum == doctest::Approx((64 - 1) / 6.0).epsilon(1e-4));
}

TEST_CASE("unsure light: a tent as wide as asked for, never more than 7 iterations; parameters out of range") {
  CHECK(unsure_light_iterations(0) == 0);
  for (const float sigma : {0.3F, 1.0F, 2.2F, 8.0F, 21.8F, 40.0F}) {
    CAPTURE(sigma);
    const int n = unsure_light_iterations(sigma);
    const auto deviation = [](int iterations) { return std::sqrt((std::pow(4.0, iterations) - 1) / 6); };
    CHECK(deviation(n) >= static_cast<double>(sigma));
    CHECK(deviation(n - 1) < static_cast<double>(sigma));
  }
  CHECK(unsure_light_iterations(1e9F) == 7);
  UnsureLightParams p;
  for (const float bad : {-1.0F, std::numeric_limits<float>::quiet_NaN()}) {
    p = {};
    p.reach = bad;
    CHECK(validate(p).code() == StatusCode::invalid_argument);
    p = {};
    p.ratio = bad;
    CHECK(validate(p).code() == StatusCode::invalid_argument);
  }
  p.ratio = 0;
  CHECK(validate(p).code() == StatusCode::invalid_argument);
}
