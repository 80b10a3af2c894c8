// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/sensor/isp.hpp"
#include "unit/sensor_fixture.hpp"

namespace {

using npsim::ImageView;
using npsim::IspParams;
using npsim::RandomPurpose;
using npsim::RandomStream;
using npsim::Rgb8;
using npsim::Shape;
using npsim::ToneCurve;
using npsim::ToneKind;
using npsim::Vec3f;
using sensor_test::Image;
using sensor_test::pixels;

Rgb8 shown(const IspParams& params, const Vec3f& pixel) {
  Image image({1, 1}, pixel);
  Rgb8 out;
  const npsim::SerialExecutor executor;
  REQUIRE(npsim::develop(params, image.cview(), ImageView<Rgb8>(&out, {1, 1}), executor).ok());
  return out;
}

template <class Executor>
Vec3f balance(float adaptation, Image image, Executor executor) {
  npsim::WhiteBalanceParams params;
  params.adaptation = adaptation;
  npsim_test::Scratch scratch(npsim::white_balance_workspace_bytes(image.shape()));
  Vec3f gains;
  REQUIRE(npsim::auto_white_balance(params, image.cview(), gains, scratch.workspace(), executor).ok());
  return gains;
}

}  // namespace

TEST_CASE("sensor: with the clip curve every sRGB level survives decoding and developing") {
  IspParams params;
  params.tone.kind = ToneKind::clip;
  for (int level = 0; level < 256; ++level) {
    const double e = level / 255.0;
    const auto x = static_cast<float>(e <= 0.04045 ? e / 12.92 : std::pow((e + 0.055) / 1.055, 2.4));
    const Rgb8 out = shown(params, {x, x, x});
    CHECK(out.r == level);
    CHECK(out.b == level);
  }
  // Rounding to the nearest: half a level below and above a boundary.
  CHECK(shown(params, {10.49F / 255 / 12.92F, 10.51F / 255 / 12.92F, 0}).r == 10);
  CHECK(shown(params, {10.49F / 255 / 12.92F, 10.51F / 255 / 12.92F, 0}).g == 11);
}

TEST_CASE("sensor: samples that are not a signal are shown black or white") {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  for (const ToneKind kind : {ToneKind::clip, ToneKind::filmic}) {
    IspParams params;
    params.tone.kind = kind;
    const Rgb8 out = shown(params, {nan, -3.0F, inf});
    CHECK(out.r == 0);
    CHECK(out.g == 0);
    CHECK(out.b == 255);
    CHECK(shown(params, {1.0F, 7.0F, 1e30F}).r == 255);
    CHECK(shown(params, {1e-45F, 1e-30F, 0}).r == 0);
  }
}

TEST_CASE("sensor: the filmic curve is monotonic and continuous, 0 to 0 and 1 to 1, straight in between") {
  for (const float knee : {0.0F, 0.5F, 0.8F, 1.0F}) {
    for (const float toe : {0.0F, 0.003F, 0.1F}) {
      const ToneCurve curve{ToneKind::filmic, toe, knee};
      CHECK(npsim::tone_map(curve, 0.0F) == 0.0F);
      CHECK(npsim::tone_map(curve, 1.0F) == doctest::Approx(1.0).epsilon(1e-6));
      float before = 0;
      for (int i = 1; i <= 20000; ++i) {
        const float y = npsim::tone_map(curve, static_cast<float>(i) / 20000.0F);
        CHECK(y >= before - 0x1p-23F);  // rounding
        CHECK(y - before < 2.5F / 20000.0F);
        CHECK(y <= 1.000001F);
        before = y;
      }
    }
  }
  // The straight part: slope W = 1.2 (times 1 + toe / W), lowered by the toe.
  const ToneCurve curve;
  CHECK(npsim::tone_map(curve, 0.3F) == doctest::Approx(0.36 * 1.0025 - 0.003).epsilon(1e-3));
  CHECK(npsim::tone_map(curve, 0.045F) == doctest::Approx(0.0513).epsilon(1e-2));
}

TEST_CASE("sensor: grey world: full adaptation makes the mean grey, none leaves it, half goes half the way") {
  Image warm({64, 48});
  for (std::size_t i = 0; i < pixels(warm).size(); ++i) {
    RandomStream random(9, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(i), 0);
    pixels(warm)[i] = Vec3f{0.30F, 0.10F, 0.05F} * random.uniform();
  }
  for (int i = 0; i < 40; ++i) pixels(warm)[static_cast<std::size_t>(i) * 50] = {5, 5, 40};  // lamps do not vote
  const Vec3f none = balance(0.0F, warm, npsim::SerialExecutor{});
  CHECK(none.x == doctest::Approx(1.0));
  CHECK(none.z == doctest::Approx(1.0));
  const Vec3f full = balance(1.0F, warm, npsim::SerialExecutor{});
  CHECK(full.x * 0.30F == doctest::Approx(static_cast<double>(full.y * 0.10F)).epsilon(1e-4));
  CHECK(full.z * 0.05F == doctest::Approx(static_cast<double>(full.y * 0.10F)).epsilon(1e-4));
  const Vec3f half = balance(0.5F, warm, npsim::SerialExecutor{});
  CHECK(half.x * 0.30F / (half.y * 0.10F) == doctest::Approx(std::sqrt(3.0)).epsilon(1e-4));
  const Vec3f mean{0.30F, 0.10F, 0.05F};
  const auto before = static_cast<double>(npsim::luminance(mean));
  CHECK(npsim::luminance(mean * half) == doctest::Approx(before).epsilon(1e-4));
  CHECK(npsim::luminance(mean * full) == doctest::Approx(before).epsilon(1e-4));
  CHECK(balance(0.5F, warm, npsim_test::BackwardExecutor{}) == half);
}

TEST_CASE("sensor: white balance of black, burnt or single-coloured pictures stays bounded") {
  CHECK(balance(1.0F, Image({5, 5}), npsim::SerialExecutor{}) == Vec3f{1, 1, 1});
  CHECK(balance(1.0F, Image({5, 5}, {2, 2, 2}), npsim::SerialExecutor{}) == Vec3f{1, 1, 1});
  const Vec3f red = balance(1.0F, Image({5, 1}, {0.5F, 0, 0}), npsim::SerialExecutor{});
  CHECK(npsim::is_finite(red));
  CHECK(red.x == doctest::Approx(1.0));
  CHECK(red.z <= 16.0F);
}

TEST_CASE("sensor: burnt pixels are white whatever the white balance, and gains of one change nothing") {
  IspParams params;
  params.tone.kind = ToneKind::clip;
  params.white_balance = {0.6F, 1.2F, 2.0F};
  CHECK(shown(params, {3, 3, 3}).r == 255);
  CHECK(shown(params, {3, 3, 3}).g == 255);
  CHECK(shown(params, {0.2F, 0.2F, 0.2F}).r < shown(params, {0.2F, 0.2F, 0.2F}).b);
  // A red signal, of which only one channel is burnt, keeps its colour.
  CHECK(shown(params, {3, 0.1F, 0.1F}).r < 210);
  int before = 0;
  for (int i = 0; i <= 1000; ++i) {  // monotonic through the fade
    const float x = 0.8F + 0.0002F * static_cast<float>(i);
    const int level = shown(params, {x, x, x}).r;
    CHECK(level >= before);
    before = level;
  }
}

TEST_CASE("sensor: the ISP refuses parameters out of range and unequal images; strided views keep their margins") {
  const npsim::SerialExecutor executor;
  Image image({4, 3}, {1, 1, 1});
  std::vector<Rgb8> out(40);
  const ImageView<Rgb8> wide(out.data(), {8, 5});
  const ImageView<const Vec3f> in = image.view();
  IspParams params;
  REQUIRE(npsim::develop(params, in, wide.sub(2, 1, {4, 3}), executor).ok());
  int white = 0;
  for (const Rgb8& p : out) white += p.g == 255 ? 1 : 0;
  CHECK(white == 12);
  CHECK(wide(1, 1).g == 0);
  CHECK(wide(6, 3).g == 0);
  CHECK(npsim::develop(params, in, wide, executor).code() == npsim::StatusCode::shape_mismatch);
  params.tone.toe = -1;
  CHECK(npsim::develop(params, in, wide.sub(0, 0, {4, 3}), executor).code() == npsim::StatusCode::invalid_argument);
  params = {};
  params.white_balance.y = std::numeric_limits<float>::quiet_NaN();
  CHECK(npsim::develop(params, in, wide.sub(0, 0, {4, 3}), executor).code() == npsim::StatusCode::invalid_argument);
}
