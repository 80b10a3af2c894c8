// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/sensor/exposure.hpp"
#include "unit/sensor_fixture.hpp"

namespace {

using npsim::AutoExposureParams;
using npsim::AutoExposureResult;
using npsim::CameraExposure;
using npsim::ImageView;
using npsim::Metering;
using npsim::RandomPurpose;
using npsim::RandomStream;
using npsim::Shape;
using npsim::Vec3f;
using sensor_test::Image;
using sensor_test::pixels;

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

template <class Executor>
AutoExposureResult choose(const AutoExposureParams& params, Image& image, Executor executor) {
  npsim_test::Scratch scratch(npsim::auto_exposure_workspace_bytes(image.shape()));
  AutoExposureResult result;
  REQUIRE(npsim::auto_exposure(params, image.cview(), result, scratch.workspace(), executor).ok());
  CHECK(scratch.workspace().used() == 0);
  return result;
}

// By the definition, sample by sample.
double clipped_mean(const Image& image, const CameraExposure& camera) {
  const auto d = [](float v) { return static_cast<double>(v); };
  const double gain = std::acos(-1.0) / 4 / d(camera.f_number) / d(camera.f_number) * d(camera.transmittance) *
                      d(camera.time_s) * d(camera.iso) / 78;
  double sum = 0;
  for (const Vec3f& p : pixels(image)) {
    const auto sane = [d](float v) { return v > 0 ? d(v) : 0.0; };
    sum += std::fmin(1.0, gain * (0.2126 * sane(p.x) + 0.7152 * sane(p.y) + 0.0722 * sane(p.z)));
  }
  return sum / static_cast<double>(pixels(image).size());
}

AutoExposureParams fully_compensated() {
  AutoExposureParams params;
  params.compensation = 1.0F;
  params.iso_max = 51200;
  return params;
}

Image street() {
  Image image({97, 61});
  for (std::size_t i = 0; i < pixels(image).size(); ++i) {
    RandomStream random(1, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(i), 0);
    const float y = i > pixels(image).size() / 2 ? random.uniform(0.2F, 1.0F) : random.uniform(0.0F, 0.05F);
    pixels(image)[i] = Vec3f{1.4F, 1.0F, 0.5F} * y;
  }
  return image;
}

}  // namespace

TEST_CASE("sensor: 1 cd/m2 at f/2, 1/30 s and ISO 3200 gives 5.9 mlx s, 24 % of full scale") {
  const CameraExposure camera;
  CHECK(npsim::exposure_lx_s(camera, 1.0F) == doctest::Approx(5.9e-3).epsilon(0.005));
  CHECK(npsim::kSaturationExposure / camera.iso == doctest::Approx(24e-3).epsilon(0.02));
  CHECK(npsim::signal_per_luminance(camera) == doctest::Approx(0.2417).epsilon(1e-3));
}

TEST_CASE("sensor: expose keeps what exceeds full scale and drops what is not light") {
  Image image({5, 1}, {{1, 2, 3}, {1e6F, 0, 0}, {-1, kNan, 1}, {kInf, 1, 1}, {0, 0, 0}});
  const CameraExposure camera{2.0F, 1.0F / 30.0F, 3200.0F, 0.9F};
  const npsim::SerialExecutor executor;
  REQUIRE(npsim::expose(camera, image.cview(), image.view(), executor).ok());
  CHECK(pixels(image)[0].z == doctest::Approx(3 * 0.24166));
  CHECK(pixels(image)[1].x == doctest::Approx(241660.0));
  CHECK(pixels(image)[2].x == 0.0F);
  CHECK(pixels(image)[2].y == 0.0F);
  CHECK(std::isfinite(pixels(image)[3].x));
  CHECK(pixels(image)[3].x > 1e9F);
}

TEST_CASE("sensor: automatic exposure meets its target, with and without saturated lamps") {
  const AutoExposureParams params = fully_compensated();
  Image image = street();
  const AutoExposureResult plain = choose(params, image, npsim::SerialExecutor{});
  CHECK_FALSE(plain.limited);
  CHECK(plain.achieved_mean == doctest::Approx(0.045).epsilon(1e-3));
  CHECK(clipped_mean(image, plain.camera) == doctest::Approx(0.045).epsilon(1e-3));

  for (int i = 0; i < 12; ++i) pixels(image)[static_cast<std::size_t>(i) * 7] = {3e4F, 3e4F, 3e4F};  // .2 % of the area
  const AutoExposureResult lamps = choose(params, image, npsim::SerialExecutor{});
  CHECK(clipped_mean(image, lamps.camera) == doctest::Approx(0.045).epsilon(1e-3));
  CHECK(lamps.camera.iso > 0.93F * plain.camera.iso);
}

TEST_CASE("sensor: partial compensation leaves a dark street darker than a bright one, and ev adds stops") {
  AutoExposureParams params;
  params.compensation = 0.5F;
  Image one({8, 8}, {1, 1, 1});
  Image four({8, 8}, {4, 4, 4});
  const AutoExposureResult dark = choose(params, one, npsim::SerialExecutor{});
  const AutoExposureResult bright = choose(params, four, npsim::SerialExecutor{});
  CHECK(dark.camera.iso == doctest::Approx(2 * static_cast<double>(bright.camera.iso)).epsilon(1e-3));
  CHECK(bright.achieved_mean == doctest::Approx(2 * static_cast<double>(dark.achieved_mean)).epsilon(2e-3));
  params.ev = -1.0F;
  CHECK(choose(params, one, npsim::SerialExecutor{}).camera.iso ==
        doctest::Approx(0.5 * static_cast<double>(dark.camera.iso)).epsilon(1e-4));
}

TEST_CASE("sensor: metering: the centre counts more, highlights hold their share, a fixed ISO stays") {
  Image image({90, 90}, {0.1F, 0.1F, 0.1F});
  for (int y = 35; y < 55; ++y) {
    for (int x = 35; x < 55; ++x) image(x, y) = {2, 2, 2};
  }
  AutoExposureParams params = fully_compensated();
  const float mean = choose(params, image, npsim::SerialExecutor{}).camera.iso;
  params.metering = Metering::centre;
  CHECK(choose(params, image, npsim::SerialExecutor{}).camera.iso < 0.8F * mean);

  for (std::size_t i = 0; i < pixels(image).size(); ++i) {
    pixels(image)[i] = Vec3f{1, 1, 1} * (0.01F + 0.001F * static_cast<float>(i));
  }
  params.metering = Metering::highlight;
  params.highlight_share = 0.1F;
  const AutoExposureResult lit = choose(params, image, npsim::SerialExecutor{});
  const float full = 1.0F / npsim::signal_per_luminance(lit.camera);
  CHECK(full == doctest::Approx(0.01 + 8.1 * 0.9).epsilon(0.03));  // a bin is 3 % wide

  params.metering = Metering::fixed;
  params.camera.iso = 777;
  CHECK(choose(params, image, npsim::SerialExecutor{}).camera.iso == 777.0F);
}

TEST_CASE("sensor: automatic exposure gives the same bits for any order of the chunks") {
  Image image({97, 301});
  for (std::size_t i = 0; i < pixels(image).size(); ++i) {
    RandomStream random(1, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(i), 0);
    pixels(image)[i] = Vec3f{1, 1, 1} * random.uniform();
  }
  for (const Metering metering : {Metering::mean, Metering::centre}) {
    AutoExposureParams params;
    params.metering = metering;
    const AutoExposureResult a = choose(params, image, npsim::SerialExecutor{});
    const AutoExposureResult b = choose(params, image, npsim_test::BackwardExecutor{});
    CHECK(a.camera.iso == b.camera.iso);
    CHECK(a.achieved_mean == b.achieved_mean);
  }
}

TEST_CASE("sensor: automatic exposure stops at its limits: black, too bright, all NaN, one pixel") {
  const AutoExposureParams params;
  Image black({1, 40});
  const AutoExposureResult dark = choose(params, black, npsim::SerialExecutor{});
  CHECK(dark.camera.iso == doctest::Approx(6400.0));
  CHECK(dark.achieved_mean == 0.0F);
  CHECK(dark.limited);
  Image day({40, 1}, {3000, 3000, 3000});
  const AutoExposureResult bright = choose(params, day, npsim::SerialExecutor{});
  CHECK(bright.camera.iso == doctest::Approx(100.0));
  CHECK(bright.achieved_mean == doctest::Approx(1.0));
  CHECK(bright.limited);
  Image broken({3, 3}, {kNan, -1, kNan});
  CHECK(choose(params, broken, npsim::SerialExecutor{}).achieved_mean == 0.0F);
  Image one({1, 1}, {1, 1, 1});
  CHECK(choose(fully_compensated(), one, npsim::SerialExecutor{}).achieved_mean ==
        doctest::Approx(0.045).epsilon(1e-3));
}

TEST_CASE("sensor: exposure refuses parameters out of range and empty or unequal images") {
  const npsim::SerialExecutor executor;
  Image image({4, 4});
  Image other({4, 3});
  const ImageView<const Vec3f> in = image.view();
  const CameraExposure bad[] = {{0, 1, 100, 1},
                                {kNan, 1, 100, 1},
                                {2, 0, 100, 1},  // no time at all
                                {2, 1, kInf, 1},
                                {2, 1, 100, 1.5F}};
  for (const CameraExposure& camera : bad) {
    CHECK(npsim::expose(camera, in, image.view(), executor).code() == npsim::StatusCode::invalid_argument);
  }
  CHECK(npsim::expose(CameraExposure{}, in, other.view(), executor).code() == npsim::StatusCode::shape_mismatch);
  CHECK(npsim::expose(CameraExposure{}, ImageView<const Vec3f>(), ImageView<Vec3f>(), executor).code() ==
        npsim::StatusCode::no_valid_input);
  npsim::Workspace none;
  AutoExposureResult result;
  CHECK(npsim::auto_exposure(AutoExposureParams{}, in, result, none, executor).code() ==
        npsim::StatusCode::workspace_exhausted);
  AutoExposureParams params;
  params.iso_min = 200;
  params.iso_max = 100;
  CHECK(npsim::auto_exposure(params, in, result, none, executor).code() == npsim::StatusCode::invalid_argument);
  params = {};
  params.target_mean = kNan;
  CHECK(npsim::auto_exposure(params, in, result, none, executor).code() == npsim::StatusCode::invalid_argument);
}
