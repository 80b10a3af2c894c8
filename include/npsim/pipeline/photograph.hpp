// SPDX-License-Identifier: Apache-2.0
// Section 3.6.3: the camera that looks at the night. Linear scene luminance in, an 8-bit picture out.
//
// glare -> exposure -> filters of the sensor, full well, shot and read noise (3.10), converter -> white balance ->
// denoise -> demosaic -> highlights, colour matrix, tone curve, sRGB. docs/camera.md draws the chain and shows the cameras.
// Exposure is metered on what the sensor sees, glare included.
// Memory: an image and two floats per pixel besides what the steps take; an image for the thesis' sensor.
#ifndef NPSIM_PIPELINE_PHOTOGRAPH_HPP
#define NPSIM_PIPELINE_PHOTOGRAPH_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/color/srgb.hpp"
#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/sensor/denoise.hpp"
#include "npsim/sensor/exposure.hpp"
#include "npsim/sensor/glare.hpp"
#include "npsim/sensor/isp.hpp"
#include "npsim/sensor/noise.hpp"
#include "npsim/sensor/raw.hpp"
#include "npsim/sensor/white_balance.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Defaults are those of an action camera: a wide lens behind a cover, 12 megapixels binned to video and frames averaged
// (16 read-outs a sample), colours stronger than life.
struct PhotographParams {
  AutoExposureParams exposure;
  GlareParams glare;
  // Three linear sRGB channels in every pixel, neither filters nor full well nor converter: equation (3.10) and
  // clipping alone. sensor, white_balance and isp are not used then.
  bool ideal_sensor = false;
  SensorParams sensor;
  Span<const NoiseAtIso> noise_table = kDefaultNoise;
  float residual_noise = 0.25F;  // see NoiseParams
  WhiteBalanceParams white_balance;
  RawDenoiseParams denoise;
  IspParams isp;              // but its gains and where it withdraws colour
  float colour_noise = 3.0F;  // standard deviations of the read noise below which colour is withdrawn

  // The text knows exposure and noise only: raw noise, no glare, no white balance, no tone curve.
  [[nodiscard]] static constexpr PhotographParams thesis() noexcept {
    PhotographParams params;
    params.exposure.compensation = 1.0F;
    params.glare.halo = params.glare.veil = 0.0F;
    params.ideal_sensor = true;
    params.residual_noise = 1.0F;
    return params;
  }
  [[nodiscard]] static constexpr PhotographParams action_camera() noexcept { return {}; }
  // Behind a windscreen; a small sensor, few pixels binned, its noise half removed.
  [[nodiscard]] static constexpr PhotographParams dashcam() noexcept {
    PhotographParams params;
    params.exposure.camera.f_number = 1.8F;
    params.exposure.iso_max = 12800.0F;
    params.glare.halo = 0.8F;
    params.glare.veil = 0.4F;
    params.sensor.bits = 12;
    params.sensor.black = 64.0F;
    params.residual_noise = 0.35F;
    params.white_balance.warmest_k = 3000.0F;
    params.white_balance.coolest_k = 7000.0F;
    params.isp.saturation = 1.1F;
    params.isp.tone.toe = 0.001F;
    return params;
  }
  // Three exposures, 120 dB, and a curve that shows them all; little colour preference.
  [[nodiscard]] static constexpr PhotographParams automotive_hdr() noexcept {
    PhotographParams params;
    params.exposure.camera.f_number = 1.6F;
    params.exposure.camera.time_s = 1.0F / 60.0F;
    params.glare.halo = 0.3F;
    params.glare.veil = 0.1F;
    params.sensor.exposures = 3;
    params.sensor.bits = 12;
    params.sensor.black = 64.0F;
    params.sensor.vignetting = 0.2F;
    params.residual_noise = 0.35F;
    params.isp.saturation = 1.0F;
    params.isp.tone.kind = ToneKind::log;
    params.isp.tone.lift = 1000.0F;
    return params;
  }
  // One exposure, noise as it is read, colours and levels as they are: what a network on raw pictures would see.
  [[nodiscard]] static constexpr PhotographParams automotive_raw() noexcept {
    PhotographParams params;
    params.exposure.camera.f_number = 1.6F;
    params.glare.halo = 0.3F;
    params.glare.veil = 0.1F;
    params.sensor.bits = 12;
    params.sensor.black = 64.0F;
    params.sensor.vignetting = 0.2F;
    params.residual_noise = 1.0F;
    params.white_balance.fixed_k = 5000.0F;
    params.denoise.strength = 0.0F;
    params.colour_noise = 0.0F;
    params.isp.demosaic = Demosaic::bilinear;
    params.isp.saturation = 1.0F;
    params.isp.tone.kind = ToneKind::clip;
    return params;
  }
};

[[nodiscard]] inline Status validate(const PhotographParams& params) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params.exposure));
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
  return validate(params.isp);
}

[[nodiscard]] constexpr std::size_t photograph_workspace_bytes(const PhotographParams& params, Shape shape) noexcept {
  const bool image = params.ideal_sensor || has_glare(params.glare);
  return (image ? allocation_bytes<Vec3f>(shape.pixels()) : 0) +
         (params.ideal_sensor ? 0 : 2 * allocation_bytes<float>(mosaic_shape(shape).pixels())) +
         max_of(glare_workspace_bytes(params.glare, shape), auto_exposure_workspace_bytes(shape),
                white_balance_workspace_bytes(shape)) +
         kWorkspaceAlignment;
}

// `image` keeps the noise of two pictures apart.
template <class Executor>
Status photograph(const PhotographParams& params, const Intrinsics& intrinsics, std::uint64_t seed, std::uint32_t image,
                  ImageView<const Vec3f> luminance_cd_m2, ImageView<Rgb8> picture, CameraExposure& exposure,
                  Workspace& workspace, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(check_images(luminance_cd_m2, picture));
  const Shape shape = luminance_cd_m2.shape();
  const WorkspaceScope scope(workspace);
  ImageView<const Vec3f> light = luminance_cd_m2;
  ImageView<Vec3f> own;
  if (params.ideal_sensor || has_glare(params.glare)) {
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, own));
  }
  if (has_glare(params.glare)) {
    NPSIM_RETURN_IF_ERROR(add_glare(params.glare, intrinsics.fx, light, own, workspace, executor));
    light = own;
  }
  AutoExposureResult metered;
  NPSIM_RETURN_IF_ERROR(auto_exposure(params.exposure, light, metered, workspace, executor));
  exposure = metered.camera;
  const Result<NoiseLevel> level = noise_level(exposure.iso, params.noise_table);
  NPSIM_RETURN_IF_ERROR(level.status());
  const NoiseParams noise{level.value(), params.residual_noise};

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
      capture(params.sensor, signal_per_luminance(exposure), noise, intrinsics, seed, image, light, plane, executor));
  IspParams isp = params.isp;
  isp.colourless = clamp_to(
      params.colour_noise * noise.residual * std::sqrt(noise.level.beta2) / raw_range(params.sensor), 0.0F, 1.0F);
  NPSIM_RETURN_IF_ERROR(white_balance(params.white_balance, params.sensor, plane, isp.gains, workspace, executor));
  NPSIM_RETURN_IF_ERROR(denoise_raw(params.denoise, params.sensor, noise, plane, clean, executor));
  return develop(isp, params.sensor, clean, picture, executor);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_PHOTOGRAPH_HPP
