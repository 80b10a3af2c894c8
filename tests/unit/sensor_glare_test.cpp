// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/sensor/glare.hpp"
#include "unit/sensor_fixture.hpp"

namespace {

using npsim::GlareParams;
using npsim::ImageView;
using npsim::RandomPurpose;
using npsim::RandomStream;
using npsim::Shape;
using npsim::Vec3f;
using sensor_test::Image;
using sensor_test::pixels;

template <class Executor>
Image glared(const GlareParams& params, Image image, Executor executor) {
  npsim_test::Scratch scratch(npsim::glare_workspace_bytes(params, image.shape()));
  REQUIRE(npsim::add_glare(params, image.cview(), image.view(), scratch.workspace(), executor).ok());
  return image;
}

double total(const Image& image) {
  double sum = 0;
  for (const Vec3f& p : pixels(image)) {
    sum += static_cast<double>(p.x) + static_cast<double>(p.y) + static_cast<double>(p.z);
  }
  return sum;
}

Image street(int width, int height) {
  Image image({width, height});
  for (std::size_t i = 0; i < pixels(image).size(); ++i) {
    RandomStream random(2, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(i), 0);
    pixels(image)[i] = {random.uniform(), random.uniform(), random.uniform()};
    if (random.uniform() < 0.01F) pixels(image)[i] *= 2e4F;
  }
  return image;
}

}  // namespace

TEST_CASE("sensor: glare keeps the energy, lamps at the very border included") {
  const Shape shapes[] = {{160, 90}, {33, 57}, {1, 64}, {64, 1}, {2, 3}, {1, 1}};
  for (const Shape shape : shapes) {
    Image image = street(shape.width, shape.height);
    image(0, 0) = {5e4F, 1, 1};
    image(shape.width - 1, shape.height - 1) = {1, 1, 5e4F};
    const Image out = glared(GlareParams{}, image, npsim::SerialExecutor{});
    CAPTURE(shape.width);
    CHECK(std::fabs(total(out) / total(image) - 1.0) < 1e-5);
  }
}

TEST_CASE("sensor: glare leaves a constant image and, at strength 0, every image as it is") {
  const Image constant = glared(GlareParams{}, Image({70, 50}, {0.25F, 1.0F, 3.0F}), npsim::SerialExecutor{});
  for (const Vec3f& p : pixels(constant)) {
    CHECK(p.x == doctest::Approx(0.25).epsilon(1e-6));
    CHECK(p.z == doctest::Approx(3.0).epsilon(1e-6));
  }
  GlareParams off;
  off.strength = 0;
  const Image image = street(40, 30);
  const Image same = glared(off, image, npsim::SerialExecutor{});
  for (std::size_t i = 0; i < pixels(image).size(); ++i) CHECK(pixels(same)[i] == pixels(image)[i]);
}

TEST_CASE("sensor: the halo of one lamp is the Gaussian of each lobe") {
  const double pi = std::acos(-1.0);
  const double sigmas[] = {0.8, 2.16, 10.8, 43.2};
  for (const double sigma : sigmas) {
    Image image({401, 401});
    image(200, 200) = {1e4F, 0, 0};
    GlareParams params;
    for (npsim::GlareLobe& lobe : params.lobes) lobe = {static_cast<float>(sigma / 401), 0.0F};
    params.lobes[1].weight = 1.0F;
    const Image out = glared(params, image, npsim::SerialExecutor{});
    const double peak = 1e4 / (2 * pi * sigma * sigma);
    double worst = 0;
    double second_moment = 0;
    for (int y = 0; y < 401; ++y) {
      for (int x = 0; x < 401; ++x) {
        const double dx = x - 200;
        const double dy = y - 200;
        const auto value = static_cast<double>(out(x, y).x);
        second_moment += value * dx * dx / 1e4;
        worst = std::fmax(worst, std::fabs(value - peak * std::exp(-(dx * dx + dy * dy) / (2 * sigma * sigma))) / peak);
      }
    }
    CAPTURE(sigma);
    CAPTURE(worst);
    CHECK(worst < (sigma < 2 ? 0.2 : 0.13));
    // 200 px is 4.6 sigma of the widest: nothing is mirrored that would count.
    CHECK(second_moment == doctest::Approx(sigma * sigma).epsilon(1e-4));
  }
}

TEST_CASE("sensor: three lobes add up, each with its own width") {
  GlareParams params;
  Image image({301, 301});
  image(150, 150) = {1e5F, 1e5F, 1e5F};
  const Image all = glared(params, image, npsim::SerialExecutor{});
  std::vector<double> sum(pixels(image).size(), 0.0);
  for (int k = 0; k < npsim::kGlareLobes; ++k) {
    GlareParams single = params;
    for (npsim::GlareLobe& lobe : single.lobes) lobe = {params.lobes[k].sigma, 0.0F};
    single.lobes[0].weight = params.lobes[k].weight;
    Image out = glared(single, image, npsim::SerialExecutor{});
    out(150, 150) = {};
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += static_cast<double>(pixels(out)[i].y);
  }
  // A lobe built from the one before it has a few more boxes, and is by so much nearer to the Gaussian.
  for (const int distance : {3, 10, 25, 50}) {
    const std::size_t i = 150 * 301 + 150 + static_cast<std::size_t>(distance);
    CAPTURE(distance);
    CHECK(static_cast<double>(pixels(all)[i].y) == doctest::Approx(sum[i]).epsilon(0.03));
  }
  CHECK(all(150, 150).y < 1e5F);
}

TEST_CASE("sensor: nothing of a lamp stays behind in the running sums") {
  Image image({600, 40});
  for (int y = 0; y < 40; ++y) image(2, y) = {1e5F, 1e5F, 1e5F};
  const Image out = glared(GlareParams{}, image, npsim::SerialExecutor{});
  for (int y = 0; y < 40; ++y) {
    for (int x = 120; x < 600; ++x) CHECK(out(x, y).y < 1e-12F);
  }
}

TEST_CASE("sensor: glare gives the same bits for any order of the chunks, in place or not, strided or not") {
  const Image image = street(150, 77);
  const Image a = glared(GlareParams{}, image, npsim::SerialExecutor{});
  const Image b = glared(GlareParams{}, image, npsim_test::BackwardExecutor{});
  Image wide({170, 80}, {9, 9, 9});
  Image source = image;
  npsim_test::Scratch scratch(npsim::glare_workspace_bytes(GlareParams{}, image.shape()));
  const npsim::SerialExecutor executor;
  const ImageView<Vec3f> part = wide.view().sub(11, 2, image.shape());
  REQUIRE(npsim::add_glare(GlareParams{}, source.cview(), part, scratch.workspace(), executor).ok());
  for (int y = 0; y < 77; ++y) {
    for (int x = 0; x < 150; ++x) {
      const std::size_t i = static_cast<std::size_t>(y) * 150 + static_cast<std::size_t>(x);
      CHECK(pixels(a)[i] == pixels(b)[i]);
      CHECK(pixels(a)[i] == part(x, y));
    }
  }
  CHECK(wide(10, 2).x == 9.0F);
  CHECK(wide(161, 2).x == 9.0F);
}

TEST_CASE("sensor: the cap bounds the halo, not the lamp; NaN and infinity do not spread") {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  Image image({101, 101});
  image(50, 50) = {1e9F, 5e8F, 0};
  GlareParams params;
  params.cap = 1000;
  const Image out = glared(params, image, npsim::SerialExecutor{});
  CHECK(total(out) == doctest::Approx(1.5e9));
  Image capped({101, 101});
  capped(50, 50) = {1000, 500, 0};
  const Image reference = glared(params, capped, npsim::SerialExecutor{});
  CHECK(pixels(out)[50 * 101 + 53] == pixels(reference)[50 * 101 + 53]);

  Image broken({60, 60}, {1, 1, 1});
  broken(20, 20) = {nan, 1, -5};
  broken(40, 40) = {inf, inf, inf};
  const Image sane = glared(GlareParams{}, broken, npsim::SerialExecutor{});
  for (const Vec3f& p : pixels(sane)) {
    CHECK(npsim::is_finite(p));
    CHECK(p.x >= 0.0F);
    CHECK(p.z >= 0.0F);
  }
}

TEST_CASE("sensor: halos fall off as those of a near and a far street lamp in photographs of real nights") {
  // Radial means of the green channel less the background, 1 = full scale, 540 rows; the light of both lamps as
  // estimated in glare.hpp.
  struct Sample {
    int radius;
    float level;
  };
  const auto check = [](float light, auto... samples) {
    Image image({640, 540});
    image(320, 270) = {light, light, light};
    GlareParams params;
    params.cap = 1e7F;
    const Image out = glared(params, image, npsim::SerialExecutor{});
    for (const Sample& sample : {samples...}) {
      CAPTURE(sample.radius);
      CHECK(out(320 + sample.radius, 270).y > 0.5F * sample.level);
      CHECK(out(320 + sample.radius, 270).y < 2.0F * sample.level);
    }
  };
  check(9e3F, Sample{7, 0.056F}, Sample{10, 0.018F}, Sample{15, 0.006F});
  check(1.35e6F, Sample{25, 0.25F}, Sample{35, 0.1F}, Sample{45, 0.035F}, Sample{65, 0.008F});
}

TEST_CASE("sensor: glare refuses parameters out of range and a small workspace") {
  Image image({8, 8});
  const ImageView<const Vec3f> in = image.view();
  const npsim::SerialExecutor executor;
  npsim::Workspace none;
  GlareParams params;
  params.strength = 100;  // more than all the light
  CHECK(npsim::add_glare(params, in, image.view(), none, executor).code() == npsim::StatusCode::invalid_argument);
  params = {};
  params.lobes[0].sigma = 0.5F;
  CHECK(npsim::add_glare(params, in, image.view(), none, executor).code() == npsim::StatusCode::invalid_argument);
  params = {};
  params.cap = std::numeric_limits<float>::quiet_NaN();
  CHECK(npsim::add_glare(params, in, image.view(), none, executor).code() == npsim::StatusCode::invalid_argument);
  CHECK(npsim::add_glare(GlareParams{}, in, image.view(), none, executor).code() ==
        npsim::StatusCode::workspace_exhausted);
  CHECK(npsim::add_glare(GlareParams{}, in, ImageView<Vec3f>(), none, executor).code() ==
        npsim::StatusCode::shape_mismatch);
}
