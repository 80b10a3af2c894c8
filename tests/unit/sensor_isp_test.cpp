// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "npsim/color/chromaticity.hpp"
#include "npsim/color/srgb.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/pipeline/photograph.hpp"
#include "unit/sensor_fixture.hpp"

namespace {

using npsim::CameraExposure;
using npsim::ImageView;
using npsim::PhotographParams;
using npsim::Rgb8;
using npsim::Shape;
using npsim::ToneCurve;
using npsim::ToneKind;
using npsim::Vec3f;
using sensor_test::Image;
using sensor_test::pixels;
using Picture = npsim_test::Image<Rgb8>;

template <class Executor = npsim::SerialExecutor>
Picture photographed(const PhotographParams& params, const Image& image, std::uint64_t seed = 0,
                     std::uint32_t index = 0, Executor executor = {}) {
  Picture out(image.shape());
  npsim_test::Scratch scratch(npsim::photograph_workspace_bytes(params, image.shape()));
  CameraExposure exposure;
  const npsim::Intrinsics camera{500, 500, 0.5F * static_cast<float>(image.shape().width),
                                 0.5F * static_cast<float>(image.shape().height)};
  REQUIRE(
      npsim::photograph(params, camera, seed, index, image.view(), out.view(), exposure, scratch.workspace(), executor)
          .ok());
  return out;
}

// Rgb8 has no equality of its own.
bool same(const Rgb8& a, const Rgb8& b) { return a.r == b.r && a.g == b.g && a.b == b.b; }
bool same(const Picture& a, const Picture& b) {
  bool all = a.shape() == b.shape();
  for (int y = 0; all && y < a.shape().height; ++y) {
    for (int x = 0; x < a.shape().width; ++x) all = all && same(a(x, y), b(x, y));
  }
  return all;
}

struct Named {
  const char* name;
  PhotographParams params;
};
PhotographParams with_iris() {
  PhotographParams params;
  params.starburst.blades = 7;
  return params;
}
std::vector<Named> cameras() {
  return {{"action-camera", PhotographParams::action_camera()},
          {"dashcam", PhotographParams::dashcam()},
          {"automotive-hdr", PhotographParams::automotive_hdr()},
          {"automotive-raw", PhotographParams::automotive_raw()},
          {"thesis", PhotographParams::thesis()},
          {"with an iris", with_iris()}};
}

// A colour without noise, glare and metering at `times` full scale of green under daylight.
Rgb8 shown(PhotographParams params, const Vec3f& colour, float times) {
  params.glare.halo = params.glare.veil = 0;
  params.residual_noise = 0;
  params.sensor.vignetting = 0;
  params.exposure.metering = npsim::Metering::fixed;
  params.white_balance.fixed_k = 6500;
  const float full = 1.0F / npsim::signal_per_luminance(params.exposure.camera);
  return photographed(params, Image({9, 9}, colour * (full * times)))(4, 4);
}

struct Lch {
  double l, chroma, hue;
};
Lch lch(const Vec3f& linear) {
  const Vec3f lab = npsim::linear_rgb_to_lab(linear);
  return {static_cast<double>(lab.x), std::hypot(static_cast<double>(lab.y), static_cast<double>(lab.z)),
          std::atan2(static_cast<double>(lab.z), static_cast<double>(lab.y)) * 57.29577951};
}

}  // namespace

TEST_CASE("sensor: the tone curves are monotonic and continuous, 0 to 0 and 1 to 1, the filmic one straight between") {
  for (const ToneKind kind : {ToneKind::clip, ToneKind::filmic, ToneKind::log}) {
    for (const float knee : {0.2F, 0.25F, 0.8F, 1.0F}) {
      for (const float toe : {0.0F, 0.003F, 0.1F}) {
        const ToneCurve curve{kind, toe, knee, 100.0F};
        CHECK(npsim::tone_map(curve, 0.0F) == 0.0F);
        CHECK(npsim::tone_map(curve, 1.0F) == doctest::Approx(1.0).epsilon(1e-6));
        const float steepest = kind == ToneKind::log ? 25.0F : npsim::headroom(curve) * (1.0F + toe) + 0.001F;
        float before = 0;
        for (int i = 1; i <= 5000; ++i) {
          const float y = npsim::tone_map(curve, static_cast<float>(i) / 5000.0F);
          CHECK(y >= before - 0x1p-22F);  // rounding
          CHECK(y - before < steepest / 5000.0F);
          CHECK(y <= 1.000001F);
          before = y;
        }
      }
    }
  }
  for (int i = 0; i < 4000; ++i) {
    const ToneCurve near{ToneKind::filmic, 0.0F, 1.0F - 1e-7F * static_cast<float>(i), 1.0F};
    CHECK(npsim::headroom(near) >= 1.0F);
  }
  const ToneCurve toe{ToneKind::filmic, 0.003F, 0.5F, 1.0F};
  const double white = 0.5 * std::exp(1.0);  // 1 / .5 - 1
  CHECK(npsim::headroom(toe) == doctest::Approx(white).epsilon(1e-6));
  CHECK(npsim::tone_map(toe, 0.3F) == doctest::Approx(0.3 * white + 0.3 * 0.003 - 0.003).epsilon(1e-3));
}

TEST_CASE(
    "sensor: above the knee of the filmic curve each factor of light adds the same, and its slope is continuous") {
  for (const float knee : {0.2F, 0.25F, 0.5F}) {
    const ToneCurve curve{ToneKind::filmic, 0.0F, knee, 1.0F};
    const float white = npsim::headroom(curve);
    const auto shown_at = [&](float light) { return static_cast<double>(npsim::tone_map(curve, light / white)); };
    for (float light = 1.001F * knee; 2 * light < white; light *= 1.3F) {
      CHECK(shown_at(2 * light) - shown_at(light) ==
            doctest::Approx(static_cast<double>(knee) * std::log(2.0)).epsilon(1e-4));
    }
    const double step = 0.01 * static_cast<double>(knee);
    CHECK(shown_at(knee) == doctest::Approx(static_cast<double>(knee)).epsilon(1e-5));
    CHECK(shown_at(1.01F * knee) - shown_at(knee) == doctest::Approx(step).epsilon(0.01));
    CHECK(shown_at(knee) - shown_at(0.99F * knee) == doctest::Approx(step).epsilon(0.01));
  }
}

TEST_CASE("sensor: a lit sign four times as bright as white keeps its picture, and what is darker is shown as it is") {
  PhotographParams params;
  const Vec3f grey{1, 1, 1};
  const auto code = [&](float times) { return static_cast<int>(shown(params, grey, times).g); };
  CHECK(code(4.0F) > code(2.0F) + 10);
  CHECK(code(2.0F) > code(1.0F) + 10);
  CHECK(code(6.0F) == 255);
  CHECK(code(0.1F) == doctest::Approx(255 * (1.055 * std::pow(0.1, 1 / 2.4) - 0.055)).epsilon(0.02));
}

TEST_CASE("sensor: codes by the square root of a value are sRGB's within .04, do not fall, and reach 0 and 255") {
  float before = 0.0F;
  for (int i = 0; i <= 100000; ++i) {
    const float root = static_cast<float>(i) / 100000.0F;
    const float code = npsim::isp_detail::srgb_code_of_root(npsim::simd::scalar::F32(root)).value;
    const double x = static_cast<double>(root) * static_cast<double>(root);
    const double exact = 255.0 * (x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1.0 / 2.4) - 0.055);
    CHECK(std::fabs(static_cast<double>(code) - exact) < 0.04);
    CHECK(code > before - 1e-4F);
    before = code;
  }
  CHECK(npsim::isp_detail::srgb_code_of_root(npsim::simd::scalar::F32(0.0F)).value == 0.0F);
  CHECK(before > 254.5F);
}

TEST_CASE("sensor: every lamp colour from .1 to 1000 times saturation keeps its hue or is pale, with every camera") {
  using namespace npsim::illuminant;
  const npsim::Chromaticity lamps[] = {kLedB1,
                                       kLedB2,
                                       kLedB3,
                                       kLedB4,
                                       kLedV1,
                                       kLedV2,
                                       kA,
                                       kD65,
                                       kMetalHalideWarm,
                                       kMercury,
                                       {0.633F, 0.321F},
                                       {0.536F, 0.413F},
                                       {0.289F, 0.429F},
                                       {0.68F, 0.31F},
                                       kHighPressureSodium1,
                                       kHighPressureSodium2,
                                       kMetalHalideNeutral};
  for (const Named& camera : cameras()) {
    if (camera.params.ideal_sensor) continue;  // clips every channel by itself, as the text has it
    for (const npsim::Chromaticity& xy : lamps) {
      const Vec3f colour = npsim::xy_to_linear_srgb(xy).value();
      const Lch scene = lch(colour * 0.3F);
      for (float times = 0.1F; times <= 1000.0F; times *= 1.25F) {
        const Rgb8 out = shown(camera.params, colour, times);
        const Lch picture = lch(npsim::srgb_decode8(out));
        double turn = std::fabs(picture.hue - scene.hue);
        turn = turn > 180 ? 360 - turn : turn;
        CAPTURE(camera.name);
        CAPTURE(xy.x);
        CAPTURE(xy.y);
        CAPTURE(times);
        CAPTURE(turn);
        CAPTURE(picture.chroma);
        CHECK((turn < 12 || picture.chroma < 20));
        CHECK(picture.l > 10);
      }
    }
  }
}

TEST_CASE("sensor: a red signal shows a red ring round a pale core, green a green and amber an amber one") {
  const npsim::Chromaticity signals[] = {{0.633F, 0.321F}, {0.536F, 0.413F}, {0.289F, 0.429F}};
  for (const npsim::Chromaticity& xy : signals) {
    const Vec3f colour = npsim::xy_to_linear_srgb(xy).value();
    Image image({321, 161}, {0.02F, 0.02F, 0.02F});
    for (int y = 0; y < 161; ++y) {
      for (int x = 0; x < 321; ++x) {
        if (std::hypot(x - 60, y - 60) < 6) image(x, y) = colour * 3000.0F;
        if (y > 90) image(x, y) = {0.6F, 0.6F, 0.6F};
      }
    }
    PhotographParams params;
    params.residual_noise = 0;
    const Picture out = photographed(params, image);
    const Lch core = lch(npsim::srgb_decode8(out(60, 60)));
    CHECK(core.l > 85);
    CHECK(core.chroma < 20);
    // The most colourful pixel of a ring two to eight pixels beyond the lamp's edge.
    Lch ring{};
    for (int x = 68; x < 75; ++x) {
      const Lch here = lch(npsim::srgb_decode8(out(x, 60)));
      if (here.chroma > ring.chroma) ring = here;
    }
    const double turn = std::fabs(ring.hue - lch(colour * 0.3F).hue);
    CAPTURE(xy.x);
    CHECK(ring.chroma > 25);
    CHECK((turn < 25 || turn > 335));  // white balance has its part in it
  }
}

TEST_CASE("sensor: 20 pixels from a street lamp the veil is between a tenth and a third of display white") {
  // 1000 cd at 15 m over .1 m2 of lens, and a road of 1.5 cd/m2.
  Image image({960, 540}, {0.03F, 0.03F, 0.03F});
  for (int y = 0; y < 540; ++y) {
    for (int x = 0; x < 960; ++x) {
      if (y > 300) image(x, y) = {1.5F, 1.5F, 1.5F};
      if (std::hypot(x - 480, y - 100) < 6) image(x, y) = {1e4F, 1e4F, 1e4F};
    }
  }
  PhotographParams params;
  const Picture out = photographed(params, image);
  const float level = npsim::srgb_decode8(out(500, 100).g);
  CHECK(level > 0.05F);
  CHECK(level < 0.4F);
}

TEST_CASE("sensor: the thesis' camera is equation 3.10, clipping and sRGB, and nothing else") {
  const PhotographParams params = PhotographParams::thesis();
  Image image({64, 40}, {0.2F, 0.5F, 0.1F});
  image(10, 10) = {1e5F, 0, 0};
  const Picture out = photographed(params, image, 5, 2);
  npsim_test::Scratch scratch(npsim::auto_exposure_workspace_bytes(image.shape()));
  npsim::AutoExposureResult metered;
  const npsim::SerialExecutor executor;
  REQUIRE(npsim::auto_exposure(params.exposure, image.view(), metered, scratch.workspace(), executor).ok());
  CHECK(metered.achieved_mean == doctest::Approx(0.045).epsilon(1e-3));
  const npsim::NoiseParams noise{npsim::noise_level(metered.camera.iso).value(), 1.0F};
  REQUIRE(npsim::expose(metered.camera, image.view(), image.view(), executor).ok());
  REQUIRE(npsim::add_noise(noise, 5, 2, image.view(), image.view(), executor).ok());
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 64; ++x) CHECK(same(out(x, y), npsim::srgb_encode8(image(x, y))));
  }
}

TEST_CASE("sensor: every camera takes: all black, saturated everywhere, NaN and negative light, one pixel, odd sizes") {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  for (const Named& camera : cameras()) {
    CAPTURE(camera.name);
    const Picture black = photographed(camera.params, Image({65, 33}));
    double mean = 0;
    for (int y = 0; y < 33; ++y) {
      for (int x = 0; x < 65; ++x) mean += black(x, y).g / (65.0 * 33.0);
    }
    CHECK(mean < 40);  // noise at the highest ISO
    const Picture white = photographed(camera.params, Image({31, 17}, {1e7F, 1e7F, 1e7F}));
    CHECK(white(15, 8).r > 235);
    CHECK(white(15, 8).g > 235);
    CHECK(white(15, 8).b > 235);
    Image broken({20, 20}, {0.5F, 0.5F, 0.5F});
    broken(3, 3) = {nan, -1, inf};
    broken(9, 9) = {-inf, nan, -3};
    Image mended = broken;
    mended(3, 3) = {0, 0, npsim::kMaxSample};
    mended(9, 9) = {0, 0, 0};
    CHECK(same(photographed(camera.params, broken), photographed(camera.params, mended)));
    CHECK(photographed(camera.params, Image({1, 1}, {1, 1, 1})).shape() == Shape{1, 1});
    photographed(camera.params, Image({2, 7}, {1, 1, 1}));
  }
}

TEST_CASE("sensor: a photograph has the same bits for any order of the chunks; its number changes the noise alone") {
  Image image({150, 70});
  for (std::size_t i = 0; i < pixels(image).size(); ++i) {
    npsim::RandomStream random(8, npsim::RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(i), 0);
    pixels(image)[i] = Vec3f{1.2F, 1, 0.6F} * random.uniform();
    if (random.uniform() < 0.002F) pixels(image)[i] *= 1e4F;
  }
  for (const Named& camera : cameras()) {
    CAPTURE(camera.name);
    const Picture a = photographed(camera.params, image);
    CHECK(same(a, photographed(camera.params, image, 0, 0, npsim_test::BackwardExecutor{})));
    CHECK_FALSE(same(a, photographed(camera.params, image, 0, 1)));
    CHECK_FALSE(same(a, photographed(camera.params, image, 1, 0)));
  }
}

TEST_CASE(
    "sensor: a photograph of a moving car: the street is blurred, its bonnet is not, signals flicker by variant") {
  const Shape shape{160, 90};
  Image image(shape, {0.02F, 0.02F, 0.02F});
  npsim_test::Image<float> depth(shape, 10.0F);
  npsim_test::Image<npsim::Label> labels(shape, npsim::label::road);
  npsim_test::Image<std::uint16_t> index(shape);
  for (int y = 0; y < 90; ++y) {
    for (int x = 0; x < 160; ++x) {
      if (x % 16 < 2 && y > 20) image(x, y) = {1, 1, 1};
      if (y >= 75) labels(x, y) = npsim::label::ego_vehicle;
    }
  }
  image(80, 10) = {300, 20, 10};
  index(80, 10) = 1;
  npsim::LightMark mark;
  mark.cls = npsim::LightClass::inferred_object;
  PhotographParams params;
  params.residual_noise = 0;
  params.glare.halo = params.glare.veil = 0;
  params.exposure.metering = npsim::Metering::fixed;
  params.motion.velocity_m_s = {6, 0, 0};  // 10 px
  const npsim::PhotographedStreet street{
      depth.view(), labels.view(), {}, index.view(), npsim::Span<const npsim::LightMark>(&mark, 1)};
  const auto taken = [&](const PhotographParams& p, std::uint32_t number, const Image& light) {
    Picture out(shape);
    npsim_test::Scratch scratch(npsim::photograph_workspace_bytes(p, shape, 1));
    const npsim::SerialExecutor executor;
    CameraExposure exposure;
    REQUIRE(npsim::photograph(p, {500, 500, 80, 45}, 3, number, light.view(), out.view(), exposure, scratch.workspace(),
                              executor, street)
                .ok());
    return out;
  };
  const Picture out = taken(params, 0, image);
  const auto contrast = [](const Picture& p, int y) {
    int low = 255;
    int high = 0;
    for (int x = 48; x < 112; ++x) {
      low = std::min<int>(low, p(x, y).g);
      high = std::max<int>(high, p(x, y).g);
    }
    return high - low;
  };
  PhotographParams at_rest = params;
  at_rest.motion = {};
  const int sharp = contrast(photographed(at_rest, image), 50);
  CHECK(contrast(out, 85) > sharp / 2);
  CHECK(contrast(out, 50) < sharp / 2);
  // Without depth there is nothing to move.
  CameraExposure exposure;
  const npsim::SerialExecutor executor;
  Picture refused(shape);
  npsim_test::Scratch scratch(npsim::photograph_workspace_bytes(params, shape));
  CHECK(npsim::photograph(params, {500, 500, 80, 45}, 0, 0, image.view(), refused.view(), exposure, scratch.workspace(),
                          executor)
            .code() == npsim::StatusCode::shape_mismatch);

  // A signal in exposures of .5 ms: on or off, by variant.
  params.motion.velocity_m_s = {};
  params.flicker.on = true;
  params.exposure.camera.time_s = 0.0005F;
  params.exposure.camera.iso = 50000;
  int lit = 0;
  for (std::uint32_t v = 0; v < 24; ++v) lit += taken(params, v, image)(80, 10).r > 100;
  CHECK(lit > 4);
  CHECK(lit < 20);
}

TEST_CASE("sensor: sharpening leaves flat areas, raises sinusoids by its strength, clips, and takes one pixel") {
  const npsim::SerialExecutor executor;
  for (const float strength : {0.0F, 0.5F, 1.0F}) {
    for (const int period : {2, 4}) {
      Picture picture({64, 5});
      for (int y = 0; y < 5; ++y) {
        for (int x = 0; x < 64; ++x) {
          const int wave = period == 2 ? (x % 2 == 0 ? 20 : -20) : (x % 4 < 2 ? 20 : -20);
          const auto code = static_cast<std::uint8_t>(x < 32 ? 100 : 100 + wave);
          picture(x, y) = {code, code, static_cast<std::uint8_t>(code / 2)};
        }
      }
      npsim_test::Image<float> luma({68, 5});
      REQUIRE(npsim::sharpen(strength, picture.view(), luma.view(), executor).ok());
      CHECK(picture(10, 2).g == 100);
      const double grown = (picture(48, 2).r - 100) / 20.0;
      // Of blue at half its amplitude the luma has a 27th less.
      CHECK(grown == doctest::Approx(1 + static_cast<double>(strength) * (period == 2 ? 0.963 : 0.48)).epsilon(0.03));
    }
  }
  Picture edge({4, 1}, Rgb8{20, 20, 20});
  edge(2, 0) = edge(3, 0) = {180, 250, 10};  // its luma is 217: half the strength
  npsim_test::Image<float> luma({4, 1});
  REQUIRE(npsim::sharpen(4.0F, edge.view(), luma.view(), executor).ok());
  CHECK(edge(1, 0).g == 0);
  CHECK(edge(2, 0).g == 255);
  CHECK(edge(0, 0).g == 20);
  Picture lamp({4, 1}, Rgb8{30, 30, 30});
  lamp(2, 0) = lamp(3, 0) = {255, 255, 255};
  REQUIRE(npsim::sharpen(4.0F, lamp.view(), luma.view(), executor).ok());
  CHECK(lamp(1, 0).g == 30);  // no dark ring
  CHECK(npsim::sharpen(5.0F, edge.view(), luma.view(), executor).code() == npsim::StatusCode::invalid_argument);
  Picture other({5, 1});
  CHECK(npsim::sharpen(1.0F, other.view(), luma.view(), executor).code() == npsim::StatusCode::shape_mismatch);
  for (const Named& camera : cameras()) {
    CAPTURE(camera.name);
    const std::string name = camera.name;
    CHECK((camera.params.sharpening > 0) == (name == "action-camera" || name == "dashcam" || name == "with an iris"));
  }
  PhotographParams params;
  params.sharpening = 1;
  photographed(params, Image({1, 1}, {1, 1, 1}));
}

TEST_CASE("sensor: raw levels of a photograph are what the sensor read, before anything is developed") {
  PhotographParams params = PhotographParams::automotive_raw();
  const Shape shape{40, 24};
  const Image image(shape, {0.5F, 0.4F, 0.2F});
  npsim_test::Image<std::uint16_t> levels(shape);
  npsim::RawPicture raw;
  raw.levels = levels.view();
  Picture out(shape);
  npsim_test::Scratch scratch(npsim::photograph_workspace_bytes(params, shape));
  CameraExposure exposure;
  const npsim::SerialExecutor executor;
  const npsim::Intrinsics camera{500, 500, 20, 12};
  const auto take = [&] {
    return npsim::photograph(params, camera, 1, 0, image.view(), out.view(), exposure, scratch.workspace(), executor,
                             {}, &raw)
        .code();
  };
  REQUIRE(take() == npsim::StatusCode::ok);
  double green = 0;
  for (int y = 0; y < 24; ++y) {
    for (int x = 1 - y % 2; x < 40; x += 2) green += levels(x, y) / 480.0;
  }
  const Vec3f response = params.sensor.response[1];
  const double signal =
      static_cast<double>(dot(response, Vec3f{0.5F, 0.4F, 0.2F}) * npsim::signal_per_luminance(exposure));
  CHECK((green - 64) / (4095 - 64) == doctest::Approx(signal).epsilon(0.02));
  CHECK(raw.gains.x >= 1);
  CHECK(raw.noise.beta1 == doctest::Approx(static_cast<double>(npsim::noise_level(exposure.iso).value().beta1)));
  CHECK(raw.headroom == 1);
  // What a shoulder shows the sensor has to take: its wells are so much deeper, the electrons and their noise the same.
  params.isp.tone = {npsim::ToneKind::filmic, 0.0F, 0.5F, 100.0F};
  REQUIRE(take() == npsim::StatusCode::ok);
  const double room = 0.5 * std::exp(1.0);
  CHECK(static_cast<double>(raw.headroom) == doctest::Approx(room).epsilon(1e-6));
  double less = 0;
  for (int y = 0; y < 24; ++y) {
    for (int x = 1 - y % 2; x < 40; x += 2) less += levels(x, y) / 480.0;
  }
  CHECK((less - 64) / (4095 - 64) == doctest::Approx(signal / room).epsilon(0.02));
  const npsim::NoiseLevel level = npsim::noise_level(exposure.iso).value();
  CHECK(raw.noise.beta1 == doctest::Approx(static_cast<double>(level.beta1) / room));
  CHECK(raw.noise.beta2 == doctest::Approx(static_cast<double>(level.beta2) / (room * room)));
  params.sensor.exposures = 3;
  CHECK(take() == npsim::StatusCode::invalid_argument);
  params = PhotographParams::thesis();
  CHECK(take() == npsim::StatusCode::invalid_argument);
}

TEST_CASE("sensor: displayed noise of the video cameras lies within half and twice that of real nights") {
  // Real: .64 .60 .69 .97 .99 1.15 of 255 at displayed levels 0-4, 4-8, 8-16, 16-32, 32-64, 64-128.
  const double real[] = {0.64, 0.60, 0.69, 0.97, 0.99, 1.15};
  struct Case {
    PhotographParams params;
    float iso, level;
  };
  std::vector<Case> cases;
  for (const float level : {6.0F, 12.0F, 23.0F, 45.0F, 90.0F}) {
    cases.push_back({PhotographParams::action_camera(), 1200, level});
    cases.push_back({PhotographParams::dashcam(), 500, level});
  }
  for (auto& [params, iso, level] : cases) {
    params.exposure.metering = npsim::Metering::fixed;
    params.exposure.camera.iso = iso;
    params.sensor.vignetting = 0;
    const float linear = npsim::srgb_decode8(static_cast<std::uint8_t>(level));
    const float y = linear / npsim::signal_per_luminance(params.exposure.camera);
    const Picture out = photographed(params, Image({200, 200}, {y, y, y}));
    // As tools measure it: the median of |4 c - neighbours| of the grey level, over .6745 sqrt(20).
    std::vector<double> steps;
    const auto grey = [&](int px, int py) { return (out(px, py).r + out(px, py).g + out(px, py).b) / 3.0; };
    for (int py = 1; py < 199; ++py) {
      for (int px = 1; px < 199; ++px) {
        steps.push_back(
            std::fabs(4 * grey(px, py) - grey(px - 1, py) - grey(px + 1, py) - grey(px, py - 1) - grey(px, py + 1)));
      }
    }
    std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2), steps.end());
    const double noise = steps[steps.size() / 2] / 0.6745 / std::sqrt(20.0);
    const double expected = real[level < 8 ? 1 : (level < 16 ? 2 : (level < 32 ? 3 : (level < 64 ? 4 : 5)))];
    CAPTURE(iso);
    CAPTURE(level);
    CHECK(noise > 0.5 * expected);
    CHECK(noise < 2 * expected);
  }
}

TEST_CASE(
    "sensor: black of an action camera is purple, by the same light in the dark as in what is lit; white is white") {
  PhotographParams purple = PhotographParams::action_camera();
  purple.exposure.metering = npsim::Metering::fixed;
  purple.exposure.camera.iso = 1200;
  purple.sensor.vignetting = 0;
  purple.white_balance.fixed_k = 6504;
  PhotographParams neutral = purple;
  neutral.isp.black_cast = {};
  const auto mean = [](const Picture& p) {
    npsim::Vec3d sum;
    for (const npsim::Rgb8& c : p.view().pixels()) {
      sum += npsim::vec_cast<double>(
          npsim::Vec3f{npsim::srgb_decode8(c.r), npsim::srgb_decode8(c.g), npsim::srgb_decode8(c.b)});
    }
    return sum / static_cast<double>(p.view().pixels().size());
  };
  for (const float linear : {0.0F, 0.003F, 0.03F}) {
    CAPTURE(linear);
    const float y = linear / npsim::signal_per_luminance(purple.exposure.camera);
    const Image flat({200, 200}, {y, y, y});
    const npsim::Vec3d added = mean(photographed(purple, flat)) - mean(photographed(neutral, flat));
    CHECK(added.x == doctest::Approx(0.0010).epsilon(0.0002));
    CHECK(added.y == doctest::Approx(0.0).epsilon(0.0002));
    CHECK(added.z == doctest::Approx(0.0013).epsilon(0.0002));
  }
  const Rgb8 white = photographed(purple, Image({9, 9}, {1e4F, 1e4F, 1e4F}))(4, 4);
  for (const int code : {white.r, white.g, white.b}) CHECK(code == 255);
}

TEST_CASE("sensor: by 4:2:0 the pixels of a quad have one colour and their own luma, at odd sizes too") {
  for (const Shape shape : {Shape{7, 5}, Shape{301, 4}, Shape{1, 1}}) {
    npsim_test::Image<float> plane(npsim::mosaic_shape(shape), 0.0F);
    npsim::RandomStream random(9, npsim::RandomPurpose::test, 0, 0, 0, 0);
    for (int y = 0; y < plane.shape().height; ++y) {
      for (int x = 0; x < plane.shape().width; ++x) plane(x, y) = random.uniform(0.02F, 0.06F);
    }
    const npsim::SerialExecutor executor;
    npsim::Workspace none;
    npsim::IspParams params;
    params.saturation = 1;
    const auto developed = [&](npsim::ChromaSampling chroma) {
      npsim_test::Image<float> copy = plane;
      Picture out(shape);
      params.chroma = chroma;
      REQUIRE(npsim::develop(params, {}, copy.view(), out.view(), none, executor).ok());
      return out;
    };
    const Picture each = developed(npsim::ChromaSampling::yuv444);
    const Picture quads = developed(npsim::ChromaSampling::yuv420);
    const auto roots = [](const Rgb8& c) {
      const Vec3f v = npsim::srgb_decode8(c);
      return Vec3f{std::sqrt(v.x), std::sqrt(v.y), std::sqrt(v.z)};
    };
    const auto luma = [](const Vec3f& v) { return 0.2126F * v.x + 0.7152F * v.y + 0.0722F * v.z; };
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const Vec3f here = roots(quads(x, y));
        Vec3f mean{};
        for (int i = 0; i < 4; ++i) {
          const Vec3f v =
              roots(each(std::min(x / 2 * 2 + i % 2, shape.width - 1), std::min(y / 2 * 2 + i / 2, shape.height - 1)));
          mean += (v - Vec3f{1, 1, 1} * luma(v)) * 0.25F;
        }
        CAPTURE(x);
        CAPTURE(y);
        CHECK(luma(here) == doctest::Approx(luma(roots(each(x, y)))).epsilon(0.01));
        CHECK(std::fabs(here.x - luma(here) - mean.x) < 0.008F);  // two levels
        CHECK(std::fabs(here.z - luma(here) - mean.z) < 0.008F);
      }
    }
  }
}

TEST_CASE("sensor: the ISP refuses parameters out of range, planes of another size and a small workspace") {
  const npsim::SerialExecutor executor;
  npsim_test::Image<float> plane(npsim::mosaic_shape({4, 3}), 1.0F);
  std::vector<Rgb8> out(40);
  const ImageView<Rgb8> wide(out.data(), {8, 5});
  npsim::Workspace none;
  npsim::IspParams params;
  REQUIRE(npsim::develop(params, {}, plane.view(), wide.sub(2, 1, {4, 3}), none, executor).ok());
  CHECK(wide(1, 1).g == 0);
  CHECK(wide(2, 1).g == 255);
  CHECK(wide(6, 3).g == 0);
  CHECK(npsim::develop(params, {}, plane.view(), wide, none, executor).code() == npsim::StatusCode::shape_mismatch);
  params.tone.toe = -1;
  CHECK(npsim::develop(params, {}, plane.view(), wide.sub(0, 0, {4, 3}), none, executor).code() ==
        npsim::StatusCode::invalid_argument);
  params = {};
  params.gains.y = std::numeric_limits<float>::quiet_NaN();
  CHECK(npsim::develop(params, {}, plane.view(), wide.sub(0, 0, {4, 3}), none, executor).code() ==
        npsim::StatusCode::invalid_argument);
  params = {};
  params.black_cast.z = 0.2F;
  CHECK(npsim::develop(params, {}, plane.view(), wide.sub(0, 0, {4, 3}), none, executor).code() ==
        npsim::StatusCode::invalid_argument);
  CameraExposure exposure;
  const Image image({4, 3}, {1, 1, 1});
  CHECK(npsim::photograph({}, {100, 100, 2, 2}, 0, 0, image.view(), wide.sub(0, 0, {4, 3}), exposure, none, executor)
            .code() == npsim::StatusCode::workspace_exhausted);
}
