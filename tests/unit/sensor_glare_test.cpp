// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "npsim/core/executor.hpp"
#include "npsim/sensor/glare.hpp"
#include "unit/sensor_fixture.hpp"

namespace {

using npsim::GlareParams;
using npsim::ImageView;
using npsim::Shape;
using npsim::Vec3f;
using sensor_test::Image;
using sensor_test::lamps_in_the_dark;
using sensor_test::pixels;
using sensor_test::total;

constexpr float kFocal = 500.0F;  // px

template <class Executor>
Image glared(const GlareParams& params, Image image, Executor executor) {
  npsim_test::Scratch scratch(npsim::glare_workspace_bytes(params, image.shape()));
  REQUIRE(npsim::add_glare(params, kFocal, image.cview(), image.view(), scratch.workspace(), executor).ok());
  return image;
}

}  // namespace

TEST_CASE("sensor: glare keeps the energy, lamps at the very border included") {
  const Shape shapes[] = {{160, 90}, {33, 57}, {127, 65}, {65, 129}, {1, 64}, {64, 1}, {2, 3}, {1, 1}};
  for (const Shape shape : shapes) {
    Image image = lamps_in_the_dark(shape);
    image(0, 0) = {5e4F, 1, 1};
    image(shape.width - 1, shape.height - 1) = {1, 1, 5e4F};
    const Image out = glared(GlareParams{}, image, npsim::SerialExecutor{});
    CAPTURE(shape.width);
    CHECK(std::fabs(total(out) / total(image) - 1.0) < 1e-5);
  }
}

TEST_CASE("sensor: glare leaves a constant image of any size and, with no share at all, every image as it is") {
  for (const Shape shape : {Shape{70, 50}, Shape{37, 23}, Shape{1, 9}, Shape{65, 3}}) {
    const Image constant = glared(GlareParams{}, Image(shape, {0.25F, 1.0F, 3.0F}), npsim::SerialExecutor{});
    for (const Vec3f& p : pixels(constant)) {
      CHECK(p.x == doctest::Approx(0.25).epsilon(1e-6));
      CHECK(p.z == doctest::Approx(3.0).epsilon(1e-6));
    }
  }
  GlareParams off;
  off.halo = off.veil = 0;
  const Image image = lamps_in_the_dark({40, 30});
  const Image same = glared(off, image, npsim::SerialExecutor{});
  for (std::size_t i = 0; i < pixels(image).size(); ++i) CHECK(pixels(same)[i] == pixels(image)[i]);
}

TEST_CASE("sensor: the halo of one lamp of 1e6 cd/m2 in black is the equation's, in every direction") {
  const int size = 1001;
  for (const bool halo_alone : {false, true}) {
    GlareParams params;
    params.veil = halo_alone ? 0.0F : 0.15F;
    Image image({size, size});
    image(size / 2, size / 2) = {1e6F, 1e6F, 1e6F};
    const Image out = glared(params, image, npsim::SerialExecutor{});
    const auto focal = static_cast<double>(kFocal);
    double worst = 0;
    for (double radius = 3; radius < 250; radius *= 1.15) {
      double sum = 0;
      const int directions = 64;
      for (int i = 0; i < directions; ++i) {
        const double angle = 6.283185307 * i / directions;
        const auto x = static_cast<int>(std::lround(radius * std::cos(angle)));
        const auto y = static_cast<int>(std::lround(radius * std::sin(angle)));
        const double degrees = std::hypot(x, y) / focal * 180 / std::acos(-1.0);
        const double expected = 1e6 / (focal * focal) * npsim::glare_function(params, degrees);
        const double ratio = static_cast<double>(out(size / 2 + x, size / 2 + y).y) / expected;
        CHECK(std::fabs(ratio - 1.0) < (radius < 8 ? 0.6 : 0.35));
        sum += ratio / directions;
      }
      worst = std::fmax(worst, std::fabs(sum - 1.0));
    }
    CAPTURE(halo_alone);
    CHECK(worst < 0.2);
  }
}

TEST_CASE("sensor: 2 % of a lamp's light goes further than .8 degrees") {
  const int size = 1201;
  Image image({size, size});
  image(size / 2, size / 2) = {1e6F, 1e6F, 1e6F};
  const Image out = glared(GlareParams{}, image, npsim::SerialExecutor{});
  double far = 0;
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      if (std::hypot(x - size / 2, y - size / 2) > 0.8 / 57.29578 * static_cast<double>(kFocal)) {
        far += static_cast<double>(out(x, y).y) / 1e6;
      }
    }
  }
  CHECK(far > 0.015);
  CHECK(far < 0.025);
}

TEST_CASE("sensor: glare gives the same bits for any order of the chunks, in place or not, strided or not") {
  const Image image = lamps_in_the_dark({150, 77});
  const Image a = glared(GlareParams{}, image, npsim::SerialExecutor{});
  const Image b = glared(GlareParams{}, image, npsim_test::BackwardExecutor{});
  Image wide({170, 80}, {9, 9, 9});
  Image source = image;
  npsim_test::Scratch scratch(npsim::glare_workspace_bytes(GlareParams{}, image.shape()));
  const npsim::SerialExecutor executor;
  const ImageView<Vec3f> part = wide.view().sub(11, 2, image.shape());
  REQUIRE(npsim::add_glare(GlareParams{}, kFocal, source.cview(), part, scratch.workspace(), executor).ok());
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

TEST_CASE("sensor: glare refuses parameters out of range and a small workspace") {
  Image image({8, 8});
  const ImageView<const Vec3f> in = image.view();
  const npsim::SerialExecutor executor;
  npsim::Workspace none;
  GlareParams params;
  params.core_deg = 0.02F;
  params.halo = 4;  // more than all the light
  CHECK(npsim::add_glare(params, 2e4F, in, image.view(), none, executor).code() != npsim::StatusCode::ok);
  params = {};
  params.veil = -1;
  CHECK(npsim::add_glare(params, kFocal, in, image.view(), none, executor).code() ==
        npsim::StatusCode::invalid_argument);
  params = {};
  params.cap = std::numeric_limits<float>::quiet_NaN();
  CHECK(npsim::add_glare(params, kFocal, in, image.view(), none, executor).code() ==
        npsim::StatusCode::invalid_argument);
  CHECK(npsim::add_glare(GlareParams{}, 0.0F, in, image.view(), none, executor).code() ==
        npsim::StatusCode::invalid_argument);
  CHECK(npsim::add_glare(GlareParams{}, kFocal, in, image.view(), none, executor).code() ==
        npsim::StatusCode::workspace_exhausted);
  CHECK(npsim::add_glare(GlareParams{}, kFocal, in, ImageView<Vec3f>(), none, executor).code() ==
        npsim::StatusCode::shape_mismatch);
}
