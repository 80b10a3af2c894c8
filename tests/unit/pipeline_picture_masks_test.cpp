// SPDX-License-Identifier: Apache-2.0
// Masks of a whole camera: what they say beside the picture that it takes of the same light.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>

#include "npsim/core/executor.hpp"
#include "npsim/pipeline/photograph.hpp"
#include "unit/fixture.hpp"

namespace {

using namespace npsim;
using Light = npsim_test::Image<Vec3f>;
using Mask = npsim_test::Image<std::uint8_t>;

constexpr Intrinsics kIntrinsics{300, 300, 40, 25};

struct Taken {
  npsim_test::Image<Rgb8> picture;
  Mask saturated;
  Mask indiscernible;
};

template <class Executor = SerialExecutor>
Taken taken(const PhotographParams& camera, const Light& light, Executor executor = {}) {
  const Shape shape = light.shape();
  Taken out{npsim_test::Image<Rgb8>(shape), Mask(shape, 9), Mask(shape, 9)};
  CameraExposure exposure;
  npsim_test::Scratch first(photograph_workspace_bytes(camera, shape));
  REQUIRE(photograph(camera, kIntrinsics, 1, 0, light.view(), out.picture.view(), exposure, first.workspace(), executor)
              .ok());
  npsim_test::Scratch second(picture_masks_workspace_bytes(camera, shape));
  REQUIRE(picture_masks({}, camera, kIntrinsics, 1, 0, exposure, light.view(),
                        {out.saturated.view(), out.indiscernible.view()}, second.workspace(), executor)
              .ok());
  return out;
}

int count(const Mask& mask) {
  int n = 0;
  for (int y = 0; y < mask.shape().height; ++y)
    n += static_cast<int>(std::count(mask.view().row(y), mask.view().row(y) + mask.shape().width, 1));
  return n;
}

int brightest(const Rgb8& c) { return std::max({c.r, c.g, c.b}); }

const PhotographParams kCameras[] = {PhotographParams::action_camera(), PhotographParams::dashcam(),
                                     PhotographParams::automotive_hdr(), PhotographParams::automotive_raw(),
                                     PhotographParams::thesis()};

}  // namespace

TEST_CASE("picture masks: all black is indiscernible to every camera and nowhere saturated, odd sizes too") {
  for (const PhotographParams& camera : kCameras) {
    for (const Shape shape : {Shape{1, 1}, Shape{7, 5}, Shape{33, 1}}) {
      const Taken t = taken(camera, Light(shape));
      CHECK(count(t.indiscernible) == shape.width * shape.height);
      CHECK(count(t.saturated) == 0);
    }
  }
}

TEST_CASE("picture masks: one lamp of 1e6 cd/m2 in black is saturated where the picture is, and lights its halo") {
  Light light({81, 51});
  light(40, 25) = {1e6F, 1e6F, 1e6F};
  for (PhotographParams camera : kCameras) {
    camera.exposure.metering = Metering::fixed;
    camera.exposure.camera.iso = 800;
    camera.sensor.exposures = 1;
    const Taken t = taken(camera, light);
    CHECK(t.saturated(40, 25) == 1);
    CHECK(t.saturated(0, 0) == 0);
    const bool glare = has_glare(camera.glare);
    CHECK(count(t.saturated) >= (camera.ideal_sensor ? 1 : 9));
    CHECK(t.indiscernible(40, 25) == 0);
    CHECK((t.indiscernible(44, 25) == 0) == glare);
    for (int y = 0; y < 51; ++y) {
      for (int x = 0; x < 81; ++x) CHECK(t.saturated(x, y) * t.indiscernible(x, y) == 0);
    }
  }
}

TEST_CASE("picture masks: without noise a pixel is shown white in a channel only where it is saturated") {
  Light light({64, 48});
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      const float v = 0.02F * static_cast<float>(1 << (x / 6)) * (y % 16 < 8 ? 1.0F : 0.3F);
      light(x, y) = {v, 0.7F * v, 0.4F * v};
    }
  }
  for (const bool ideal : {false, true}) {
    PhotographParams camera;
    camera.exposure.metering = Metering::fixed;
    camera.ideal_sensor = ideal;
    camera.residual_noise = 0;
    camera.denoise.strength = 0;
    camera.isp.demosaic = Demosaic::bilinear;  // the other overshoots at edges
    camera.isp.saturation = 1;
    camera.isp.tone.kind = ToneKind::clip;
    const Taken t = taken(camera, light);
    int white = 0;
    for (int y = 0; y < 48; ++y) {
      for (int x = 0; x < 64; ++x) {
        if (brightest(t.picture(x, y)) < 255) continue;
        ++white;
        // Colours are separated after the samples are read, so that a full channel may come of samples just below.
        bool near = false;
        for (int i = std::max(0, x - 3); i <= std::min(63, x + 3); ++i) near = near || t.saturated(i, y) != 0;
        CHECK(near);
      }
    }
    CHECK(white > 20);
    CHECK(count(t.saturated) >= white / 2);
  }
}

TEST_CASE("picture masks: more light, less is indiscernible; the order of work changes nothing") {
  Light light({64, 48});
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      const float v = 1e-4F * static_cast<float>(x * x);
      light(x, y) = {v, v, v};
    }
  }
  int before = 64 * 48 + 1;
  for (const float time_s : {0.002F, 0.008F, 0.032F, 0.128F}) {
    PhotographParams camera;
    camera.exposure.metering = Metering::fixed;
    camera.exposure.camera.time_s = time_s;
    camera.starburst.blades = 6;  // needs more memory than glare
    const Taken t = taken(camera, light);
    CHECK(count(t.indiscernible) < before);
    before = count(t.indiscernible);
    const Taken backward = taken(camera, light, npsim_test::BackwardExecutor{});
    CHECK(t.saturated == backward.saturated);
    CHECK(t.indiscernible == backward.indiscernible);
  }
  CHECK(before > 0);
}

TEST_CASE("labels and masks on a blurred edge: a rolling shutter moves them with the picture while the car turns") {
  const Shape shape{160, 90};
  PhotographParams camera = PhotographParams::thesis();
  camera.motion.rotation_rad_s = {0, 2.0F, 0};
  camera.motion.readout_s = 0.03F;
  camera.motion.lamp_cd_m2 = 1e5F;  // no lamp: a wall
  camera.exposure.ev = 6.0F;
  camera.exposure.camera.time_s = 1e-4F;  // next to no blur, and the edge can be found
  Light light(shape, Vec3f{0.01F, 0.01F, 0.01F});
  npsim_test::Image<Label> labels(shape, 7);
  npsim_test::Image<float> depth(shape, 10.0F);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 80; x < shape.width; ++x) {
      light.view()(x, y) = {1e4F, 1e4F, 1e4F};  // saturated
      labels.view()(x, y) = 11;
    }
  }
  PhotographedStreet street;
  street.depth = depth.view();
  street.labels = labels.view();
  SerialExecutor serial;
  npsim_test::Image<Rgb8> picture(shape);
  Mask saturated(shape, 9), indiscernible(shape, 9);
  CameraExposure exposure;
  npsim_test::Scratch first(photograph_workspace_bytes(camera, shape));
  REQUIRE(
      photograph(camera, kIntrinsics, 1, 0, light.view(), picture.view(), exposure, first.workspace(), serial, street)
          .ok());
  npsim_test::Scratch second(picture_masks_workspace_bytes(camera, shape));
  REQUIRE(picture_masks({}, camera, kIntrinsics, 1, 0, exposure, light.view(), {saturated.view(), indiscernible.view()},
                        second.workspace(), serial, street)
              .ok());
  std::vector<PixelMotion> fields(shape.pixels());
  const ImageView<PixelMotion> motion(fields.data(), shape, shape.width);
  REQUIRE(picture_motion(camera, kIntrinsics, street, motion, serial).ok());
  int least = shape.width;
  int most = 0;
  for (int y = 0; y < shape.height; ++y) {
    int seen = 0;
    int named = 0;
    int masked = 0;
    for (int x = 0; x < shape.width; ++x) {
      const Pixel source = shutter_source(camera.motion.readout_s, motion, x, y);
      seen += brightest(picture.view()(x, y)) < 128 ? 1 : 0;
      named += labels.view()(source.x, source.y) == 7 ? 1 : 0;
      masked += saturated.view()(x, y) == 0 ? 1 : 0;
    }
    CHECK(std::abs(seen - named) <= 1);
    CHECK(std::abs(masked - named) <= 2);  // blur within a pixel
    least = std::min(least, named);
    most = std::max(most, named);
  }
  CHECK(most - least > 4);  // else nothing moved
}
