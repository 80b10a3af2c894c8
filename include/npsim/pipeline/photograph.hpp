// SPDX-License-Identifier: Apache-2.0
// The camera at the end of the chain, and which pixels of its picture tell nothing.
#ifndef NPSIM_PIPELINE_PHOTOGRAPH_HPP
#define NPSIM_PIPELINE_PHOTOGRAPH_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/color/srgb.hpp"
#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/sensor/denoise.hpp"
#include "npsim/sensor/exposure.hpp"
#include "npsim/sensor/glare.hpp"
#include "npsim/sensor/isp.hpp"
#include "npsim/sensor/motion.hpp"
#include "npsim/sensor/noise.hpp"
#include "npsim/sensor/raw.hpp"
#include "npsim/sensor/signal_masks.hpp"
#include "npsim/sensor/starburst.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Section 3.6.3: the camera that looks at the night. Linear scene luminance in, an 8-bit picture out.
//
// motion -> starburst, glare -> exposure -> filters of the sensor, full well, shot and read noise (3.10), converter ->
// white balance -> denoise -> demosaic -> highlights, colour matrix, tone curve, sRGB -> sharpening. docs/camera.md
// draws the chain and shows the cameras.
// Exposure is metered on what the sensor sees, glare included. Its signal is 1 where the straight part of the tone
// curve shows white: cameras are rated by the picture that they give (ISO 12232, standard output sensitivity). The
// sensor takes the highlights of the curve too, in wells that are headroom() (sensor/isp.hpp) times as deep, with the
// noise in electrons that the table has for the speed.
// Motion needs depth, and instances and lamps where they are to move and to flicker: what the street is made of.
// Memory: an image and two floats per pixel besides what the steps take; an image for the thesis' sensor.

// How LED lamps are driven. Lamps of vehicles are dimmed by switching them, some hundred times a second so that no eye
// sees it; signals on the mains shine twice a period of it. Which share is so, and how deep signals go, is assumed.
struct FlickerParams {
  bool on = false;
  float vehicle_hz[2] = {90.0F, 400.0F};  // drawn for each vehicle
  float vehicle_duty[2] = {0.1F, 0.5F};
  float signal_hz = 100.0F;
  float signal_duty = 0.5F;
};

[[nodiscard]] inline Status validate(const FlickerParams& p) noexcept {
  const auto range = [](float low, float high, float most) noexcept {
    return low > 0.0F && low <= high && high <= most;
  };
  if (range(p.vehicle_hz[0], p.vehicle_hz[1], 1e5F) && range(p.vehicle_duty[0], p.vehicle_duty[1], 1.0F) &&
      range(p.signal_hz, p.signal_hz, 1e5F) && range(p.signal_duty, p.signal_duty, 1.0F)) {
    return {};
  }
  return {StatusCode::invalid_argument, "flicker: frequencies in (0, 1e5] Hz, duties in (0, 1], ranges ascending"};
}

// What the picture shows, as far as motion needs it; empty planes where it is not known.
struct PhotographedStreet {
  ImageView<const float> depth;   // m
  ImageView<const Label> labels;  // guessed where the scene has none
  ImageView<const std::uint16_t> instances;
  ImageView<const std::uint16_t> light_index;  // position + 1 in lights
  Span<const LightMark> lights;
};

// The picture before it is developed.
struct RawPicture {
  ImageView<std::uint16_t> levels;  // the caller's; left alone where it is empty
  float headroom = 1.0F;            // full scale over the white of the picture
  Vec3f gains;                      // of white balance
  NoiseLevel noise;                 // of the samples, residual included
};

// Defaults are those of an action camera: a wide lens behind a cover, 12 megapixels binned to video and frames averaged
// (16 read-outs a sample), colours stronger than life.
struct PhotographParams {
  AutoExposureParams exposure = for_video();
  MotionParams motion = rolling(0.016F);  // at rest, until its speed is given
  FlickerParams flicker;
  StarburstParams starburst = wiped_windscreen();  // no spikes: small lenses of fixed f-number have a round opening
  GlareParams glare;
  // Three linear sRGB channels in every pixel, neither filters nor full well nor converter: equation (3.10) and
  // clipping alone. sensor, white_balance and isp are not used then.
  bool ideal_sensor = false;
  SensorParams sensor;
  Span<const NoiseAtIso> noise_table = kDefaultNoise;
  float residual_noise = 0.25F;  // see NoiseParams
  WhiteBalanceParams white_balance;
  RawDenoiseParams denoise;        // but that its shadows are in whites
  IspParams isp = purple_black();  // but its gains and where it withdraws colour
  float sharpening = 0.7F;    // strength of sharpen(): real nights are as sharp (docs/camera.md); noise grows with it
  float colour_noise = 3.0F;  // standard deviations of the read noise below which colour is withdrawn

  // As bright as real nights are (docs/camera.md).
  [[nodiscard]] static constexpr AutoExposureParams for_video() noexcept {
    AutoExposureParams exposure;
    exposure.target_mean = 0.054F;
    exposure.usual_iso = 1440.0F;
    return exposure;
  }
  // Real nights have streaks from lower left to upper right (docs/camera.md).
  [[nodiscard]] static constexpr StarburstParams wiped_windscreen() noexcept {
    StarburstParams starburst;
    starburst.streak = 0.0004F;
    starburst.streak_deg = -45.0F;
    return starburst;
  }
  // What is darkest in four nights of such a camera is 5.5, .7, 5.6 of 255; the excess of red and blue over the light's
  // own is the same from there up to 30 (docs/camera.md). The toe keeps as much black as they have.
  [[nodiscard]] static constexpr IspParams purple_black() noexcept {
    IspParams isp;
    isp.tone.toe = 0.001F;
    isp.black_cast = {0.0010F, 0.0F, 0.0013F};
    return isp;
  }
  // What cameras without a shoulder begin with.
  [[nodiscard]] static constexpr PhotographParams plain() noexcept {
    PhotographParams params;
    params.exposure = {};
    params.starburst = {};
    params.isp = {};
    params.isp.pale_from = 0.6F;
    return params;
  }
  // Sensors of video read a frame in half to all of its time. Assumed, not measured.
  [[nodiscard]] static constexpr MotionParams rolling(float readout_s) noexcept {
    MotionParams motion;
    motion.readout_s = readout_s;
    return motion;
  }

  // The text knows exposure and noise only: raw noise, no glare, no white balance, no tone curve.
  [[nodiscard]] static constexpr PhotographParams thesis() noexcept {
    PhotographParams params = plain();
    params.exposure.compensation = 1.0F;
    params.motion.readout_s = 0.0F;
    params.glare.halo = params.glare.veil = 0.0F;
    params.ideal_sensor = true;
    params.residual_noise = 1.0F;
    params.sharpening = 0.0F;
    return params;
  }
  [[nodiscard]] static constexpr PhotographParams action_camera() noexcept { return {}; }
  // Behind a windscreen; a small sensor, few pixels binned, its noise half removed.
  [[nodiscard]] static constexpr PhotographParams dashcam() noexcept {
    PhotographParams params;
    params.exposure.camera.f_number = 1.8F;
    params.exposure.iso_max = 12800.0F;
    params.motion.readout_s = 0.025F;
    params.glare.halo = 1.2F;
    params.glare.veil = 0.1F;
    params.residual_noise = 0.35F;
    params.white_balance.warmest_k = 3000.0F;
    params.white_balance.coolest_k = 7000.0F;
    params.isp = {};
    params.isp.saturation = 1.1F;
    params.isp.tone.toe = 0.001F;
    return params;
  }
  // Three exposures, 120 dB, and a curve that shows them all place by place; little colour preference.
  [[nodiscard]] static constexpr PhotographParams automotive_hdr() noexcept {
    PhotographParams params = plain();
    params.exposure.camera.f_number = 1.6F;
    params.exposure.camera.time_s = 1.0F / 60.0F;
    params.glare.halo = 0.4F;
    params.sensor.exposures = 3;
    params.sensor.bits = 12;
    params.sensor.black = 64.0F;
    params.sensor.vignetting = 0.2F;
    params.sensor.blur_px = 0.7F;
    params.residual_noise = 0.35F;
    params.sharpening = 0.0F;
    params.isp.saturation = 1.0F;
    params.isp.tone.kind = ToneKind::log;
    params.isp.tone.lift = 4000.0F;
    params.isp.local.share = 0.8F;
    return params;
  }
  // One exposure, noise as it is read, colours and levels as they are: what a network on raw pictures would see.
  [[nodiscard]] static constexpr PhotographParams automotive_raw() noexcept {
    PhotographParams params = plain();
    params.exposure.camera.f_number = 1.6F;
    params.glare.halo = 0.4F;
    params.sensor.bits = 12;
    params.sensor.black = 64.0F;
    params.sensor.vignetting = 0.2F;
    params.sensor.blur_px = 0.7F;
    params.sensor.row_noise = 0.1F;  // these two: assumed; the other cameras are taken to have corrected theirs
    params.sensor.hot_pixels = 1e-5F;
    params.residual_noise = 1.0F;
    params.white_balance.fixed_k = 5000.0F;
    params.denoise.strength = 0.0F;
    params.sharpening = 0.0F;
    params.colour_noise = 0.0F;
    params.isp.demosaic = Demosaic::bilinear;
    params.isp.chroma = ChromaSampling::yuv444;
    params.isp.saturation = 1.0F;
    params.isp.tone.kind = ToneKind::clip;
    return params;
  }
};

[[nodiscard]] inline Status validate(const PhotographParams& params) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params.exposure));
  NPSIM_RETURN_IF_ERROR(validate(params.motion));
  NPSIM_RETURN_IF_ERROR(validate(params.flicker));
  NPSIM_RETURN_IF_ERROR(validate(params.starburst));
  NPSIM_RETURN_IF_ERROR(validate(params.glare));
  NPSIM_RETURN_IF_ERROR(validate(params.sensor));
  NPSIM_RETURN_IF_ERROR(validate(params.noise_table));
  NPSIM_RETURN_IF_ERROR(validate(params.white_balance));
  NPSIM_RETURN_IF_ERROR(validate(params.denoise));
  if (!(params.residual_noise >= 0.0F && params.residual_noise <= 1.0F)) {
    return {StatusCode::invalid_argument, "photograph: residual noise in [0, 1]"};
  }
  if (!(params.colour_noise >= 0.0F && params.colour_noise <= 1000.0F)) {
    return {StatusCode::invalid_argument, "photograph: colour noise in [0, 1000]"};
  }
  if (!(params.sharpening >= 0.0F && params.sharpening <= 4.0F)) {
    return {StatusCode::invalid_argument, "photograph: sharpening in [0, 4]"};
  }
  return validate(params.isp);
}

// Full scale of the sensor over the white of the picture.
[[nodiscard]] inline float headroom(const PhotographParams& params) noexcept {
  return params.ideal_sensor ? 1.0F : headroom(params.isp.tone);
}

namespace photograph_detail {

// The sensor's part of an exposure, in its full scales.
struct SensorExposure {
  float white = 1.0F;  // of the picture
  float gain = 0.0F;   // signal per cd/m2
  float hot = 0.0F;    // mean of hot pixels
  NoiseLevel noise;    // before averaging
};

[[nodiscard]] inline Status expose_sensor(const PhotographParams& params, const CameraExposure& exposure,
                                          SensorExposure& out) noexcept {
  const Result<NoiseLevel> level = noise_level(exposure.iso, params.noise_table);
  NPSIM_RETURN_IF_ERROR(level.status());
  const float room = headroom(params);
  out.white = 1.0F / room;
  out.gain = signal_per_luminance(exposure) / room;
  out.hot = hot_signal(params.sensor, exposure.time_s, exposure.iso) / room;
  out.noise = {level.value().beta1 / room, level.value().beta2 / (room * room)};
  return {};
}

[[nodiscard]] constexpr bool moves(const PhotographParams& params) noexcept {
  return has_motion(params.motion) || params.flicker.on;
}

// Whether light is changed between the scene and the converter, which takes an image.
[[nodiscard]] constexpr bool changes_light(const PhotographParams& params) noexcept {
  return params.ideal_sensor || has_starburst(params.starburst) || has_glare(params.glare) || moves(params);
}

// What the steps of light_at_sensor() take one after the other.
[[nodiscard]] constexpr std::size_t optics_workspace_bytes(const PhotographParams& params, Shape shape) noexcept {
  return max_of(starburst_workspace_bytes(params.starburst, shape), glare_workspace_bytes(params.glare, shape));
}

[[nodiscard]] constexpr std::size_t own_light_bytes(const PhotographParams& params, Shape shape) noexcept {
  return changes_light(params) ? allocation_bytes<Vec3f>(shape.pixels()) : 0;
}

// The waves of marked lamps: one for each vehicle, in step where lamps belong together.
inline void draw_flicker(const FlickerParams& params, std::uint64_t seed, std::uint32_t image,
                         Span<const LightMark> lights, Span<LampFlicker> out) noexcept {
  for (std::size_t i = 0; i < lights.size(); ++i) {
    const LightMark& mark = lights[i];
    const auto wave = static_cast<std::uint32_t>(mark.group != 0 ? mark.group : i + 1);
    RandomStream random(seed, RandomPurpose::sensor, image, wave, 0, 0);
    LampFlicker lamp;
    lamp.phase = random.uniform();
    if (mark.cls == LightClass::moving_rear || mark.cls == LightClass::parked_rear) {
      lamp.frequency_hz = random.uniform(params.vehicle_hz[0], params.vehicle_hz[1]);
      lamp.duty = random.uniform(params.vehicle_duty[0], params.vehicle_duty[1]);
    } else if (mark.cls == LightClass::inferred_object) {
      lamp.frequency_hz = params.signal_hz;
      lamp.duty = params.signal_duty;
    }
    out[i] = lamp;
  }
}

[[nodiscard]] constexpr std::size_t motion_bytes(const PhotographParams& params, Shape shape,
                                                 std::size_t lights) noexcept {
  if (!moves(params)) return 0;
  return allocation_bytes<PixelMotion>(shape.pixels()) + allocation_bytes<LampFlicker>(lights) +
         motion_workspace_bytes(shape);
}

}  // namespace photograph_detail

// How each pixel moves in the picture; its labels move by shutter_source() (sensor/motion.hpp) of it, as the picture
// does.
template <class Executor>
[[nodiscard]] Status picture_motion(const PhotographParams& params, const Intrinsics& intrinsics,
                                    const PhotographedStreet& street, ImageView<PixelMotion> motion,
                                    Executor& executor) {
  NPSIM_RETURN_IF_ERROR(motion_field(params.motion, intrinsics, street.depth, street.instances, motion, executor));
  // The own car stands still in its picture, in front of everything.
  for_rows(executor, street.labels.height(), [&](int y) {
    for (int x = 0; x < street.labels.width(); ++x) {
      if (street.labels(x, y) == label::ego_vehicle) motion(x, y) = {0.0F, 0.0F, 10.0F};
    }
  });
  return {};
}

namespace photograph_detail {

template <class Executor>
[[nodiscard]] Status move(const PhotographParams& params, const Intrinsics& intrinsics, std::uint64_t seed,
                          std::uint32_t image, const PhotographedStreet& street, ImageView<const Vec3f> in,
                          ImageView<Vec3f> out, Workspace& workspace, Executor& executor) {
  const WorkspaceScope scope(workspace);
  ImageView<PixelMotion> motion;
  Span<LampFlicker> flicker;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(in.shape(), motion));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(street.lights.size(), flicker));
  NPSIM_RETURN_IF_ERROR(picture_motion(params, intrinsics, street, motion, executor));
  if (params.flicker.on) {
    draw_flicker(params.flicker, seed, image, street.lights, flicker);
  } else {
    flicker = {};
  }
  return add_motion(params.motion, params.exposure.camera.time_s, motion, street.light_index, flicker, in, out,
                    workspace, executor);
}

// `light` becomes what reaches the sensor: moved, with starbursts and glare. own: the image that is taken where light
// is changed.
template <class Executor>
[[nodiscard]] Status light_at_sensor(const PhotographParams& params, const Intrinsics& intrinsics, std::uint64_t seed,
                                     std::uint32_t image, const PhotographedStreet& street,
                                     ImageView<const Vec3f>& light, ImageView<Vec3f>& own, Workspace& workspace,
                                     Executor& executor) {
  if (changes_light(params)) NPSIM_RETURN_IF_ERROR(workspace.allocate_image(light.shape(), own));
  if (moves(params)) {
    NPSIM_RETURN_IF_ERROR(move(params, intrinsics, seed, image, street, light, own, workspace, executor));
    light = own;
  }
  if (has_starburst(params.starburst)) {
    NPSIM_RETURN_IF_ERROR(add_starburst(params.starburst, intrinsics.fx, light, own, workspace, executor));
    light = own;
  }
  if (has_glare(params.glare)) {
    NPSIM_RETURN_IF_ERROR(add_glare(params.glare, intrinsics.fx, light, own, workspace, executor));
    light = own;
  }
  return {};
}

}  // namespace photograph_detail

// lights: marks of the street that is photographed, if it moves or flickers.
[[nodiscard]] constexpr std::size_t photograph_workspace_bytes(const PhotographParams& params, Shape shape,
                                                               std::size_t lights = 0) noexcept {
  return photograph_detail::own_light_bytes(params, shape) +
         max_of(
             (params.ideal_sensor ? 0 : 2 * allocation_bytes<float>(mosaic_shape(shape).pixels())) +
                 max_of(photograph_detail::optics_workspace_bytes(params, shape), auto_exposure_workspace_bytes(shape),
                        white_balance_workspace_bytes(shape), develop_workspace_bytes(params.isp, shape)),
             photograph_detail::motion_bytes(params, shape, lights)) +
         kWorkspaceAlignment;
}

// `image` keeps the noise of two pictures apart. street: where there is motion, with depth. raw: of one exposure, not
// of an ideal sensor.
template <class Executor>
Status photograph(const PhotographParams& params, const Intrinsics& intrinsics, std::uint64_t seed, std::uint32_t image,
                  ImageView<const Vec3f> luminance_cd_m2, ImageView<Rgb8> picture, CameraExposure& exposure,
                  Workspace& workspace, Executor& executor, const PhotographedStreet& street = {},
                  RawPicture* raw = nullptr) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(check_images(luminance_cd_m2, picture));
  const Shape shape = luminance_cd_m2.shape();
  if (raw != nullptr && !raw->levels.empty() && (params.ideal_sensor || params.sensor.exposures != 1)) {
    return {StatusCode::invalid_argument, "photograph: raw levels are those of a sensor with filters and one exposure"};
  }
  const WorkspaceScope scope(workspace);
  ImageView<const Vec3f> light = luminance_cd_m2;
  ImageView<Vec3f> own;
  NPSIM_RETURN_IF_ERROR(
      photograph_detail::light_at_sensor(params, intrinsics, seed, image, street, light, own, workspace, executor));
  AutoExposureResult metered;
  NPSIM_RETURN_IF_ERROR(auto_exposure(params.exposure, light, metered, workspace, executor));
  exposure = metered.camera;
  photograph_detail::SensorExposure sensor;
  NPSIM_RETURN_IF_ERROR(photograph_detail::expose_sensor(params, exposure, sensor));
  const NoiseParams noise{sensor.noise, params.residual_noise};

  if (params.ideal_sensor) {
    NPSIM_RETURN_IF_ERROR(expose(exposure, light, own, executor));
    NPSIM_RETURN_IF_ERROR(add_noise(noise, seed, image, own, own, executor));
    return linear_to_srgb8(own, picture, executor);
  }
  ImageView<float> plane;
  ImageView<float> clean;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(mosaic_shape(shape), plane));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(mosaic_shape(shape), clean));
  NPSIM_RETURN_IF_ERROR(
      capture(params.sensor, sensor.gain, noise, intrinsics, seed, image, light, plane, executor, sensor.hot));
  IspParams isp = params.isp;
  isp.colourless = clamp_to(
      params.colour_noise * noise.residual * std::sqrt(noise.level.beta2) / raw_range(params.sensor), 0.0F, 1.0F);
  NPSIM_RETURN_IF_ERROR(
      white_balance(params.white_balance, params.sensor, plane, isp.gains, workspace, executor, sensor.white));
  if (raw != nullptr && !raw->levels.empty()) {
    NPSIM_RETURN_IF_ERROR(raw_levels(params.sensor, plane, raw->levels, executor));
    const float r2 = noise.residual * noise.residual;
    raw->headroom = headroom(params);
    raw->gains = isp.gains;
    raw->noise = {noise.level.beta1 * r2, noise.level.beta2 * r2};
  }
  const RawDenoiseParams denoise{params.denoise.strength, params.denoise.shadows * sensor.white};
  NPSIM_RETURN_IF_ERROR(denoise_raw(denoise, params.sensor, noise, plane, clean, executor));
  NPSIM_RETURN_IF_ERROR(develop(isp, params.sensor, clean, picture, workspace, executor));
  return sharpen(params.sharpening, picture, plane, executor);
}

// Which pixels of a night's picture are saturated, and in which noise hides what there is (sensor/signal_masks.hpp).
//
// The picture is taken once more without noise, with the exposure that it had: motion, glare and all that the sensor
// does, read in 16 bits. What is found therefore depends on the light and on how strong the noise is, not on how it
// fell out.
// White balance is that of the picture without noise.
// Invariant: the same bits for any executor. Cost: a picture without denoising, demosaic and tone.
// Memory: an image where there is motion, starburst or glare, and a float per pixel, besides what the steps take.

[[nodiscard]] constexpr std::size_t picture_masks_workspace_bytes(const PhotographParams& camera, Shape shape,
                                                                  std::size_t lights = 0) noexcept {
  return photograph_detail::own_light_bytes(camera, shape) +
         max_of(photograph_detail::optics_workspace_bytes(camera, shape),
                photograph_detail::motion_bytes(camera, shape, lights),
                allocation_bytes<float>(mosaic_shape(shape).pixels()) + white_balance_workspace_bytes(shape)) +
         kWorkspaceAlignment;
}

// seed, image, street: those of photograph() of the same light, exposure: what it returned.
template <class Executor>
Status picture_masks(const SignalMaskParams& params, const PhotographParams& camera, const Intrinsics& intrinsics,
                     std::uint64_t seed, std::uint32_t image, const CameraExposure& exposure,
                     ImageView<const Vec3f> luminance_cd_m2, const SignalMasks& out, Workspace& workspace,
                     Executor& executor, const PhotographedStreet& street = {}) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(camera));
  NPSIM_RETURN_IF_ERROR(validate(exposure));
  NPSIM_RETURN_IF_ERROR(check_image(luminance_cd_m2));
  const Shape shape = luminance_cd_m2.shape();
  const WorkspaceScope scope(workspace);
  ImageView<const Vec3f> light = luminance_cd_m2;
  ImageView<Vec3f> own;
  NPSIM_RETURN_IF_ERROR(
      photograph_detail::light_at_sensor(camera, intrinsics, seed, image, street, light, own, workspace, executor));
  photograph_detail::SensorExposure sensor;
  NPSIM_RETURN_IF_ERROR(photograph_detail::expose_sensor(camera, exposure, sensor));
  const NoiseParams noise{sensor.noise, camera.residual_noise};
  if (camera.ideal_sensor) {
    NPSIM_RETURN_IF_ERROR(expose(exposure, light, own, executor));
    return signal_masks(params, noise, own, out, executor);
  }
  SensorParams fine = camera.sensor;
  fine.bits = 16;
  fine.black = 0.0F;
  ImageView<float> plane;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(mosaic_shape(shape), plane));
  NPSIM_RETURN_IF_ERROR(capture(fine, sensor.gain, {noise.level, 0.0F}, intrinsics, 0, 0, light, plane, executor));
  Vec3f gains;
  NPSIM_RETURN_IF_ERROR(
      white_balance(camera.white_balance, camera.sensor, plane, gains, workspace, executor, sensor.white));
  return signal_masks(params, camera.sensor, noise, gains, plane, out, executor);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_PHOTOGRAPH_HPP
