// SPDX-License-Identifier: Apache-2.0
// Section 3.6.3: the camera that looks at the night. Linear scene luminance in, an 8-bit picture out.
//
// optics (glare) -> exposure by automatic ISO -> shot and read noise (3.10) -> white balance -> tone curve -> sRGB.
// Exposure is metered before glare and noise, so neither changes it.
// Memory: one image besides what the steps take.
#ifndef NPSIM_PIPELINE_PHOTOGRAPH_HPP
#define NPSIM_PIPELINE_PHOTOGRAPH_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/sensor/exposure.hpp"
#include "npsim/sensor/glare.hpp"
#include "npsim/sensor/isp.hpp"
#include "npsim/sensor/noise.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct PhotographParams {
  AutoExposureParams exposure;
  GlareParams glare;
  float residual_noise = NoiseParams{}.residual;
  WhiteBalanceParams white_balance;
  ToneCurve tone;

  // The text knows exposure and noise only: raw noise, no glare, no white balance, no tone curve.
  [[nodiscard]] static constexpr PhotographParams thesis() noexcept {
    PhotographParams params;
    params.glare.strength = 0.0F;
    params.residual_noise = 1.0F;
    params.white_balance.adaptation = 0.0F;
    params.tone.kind = ToneKind::clip;
    return params;
  }
};

[[nodiscard]] inline Status validate(const PhotographParams& params) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params.exposure));
  NPSIM_RETURN_IF_ERROR(validate(params.glare));
  NPSIM_RETURN_IF_ERROR(validate(params.white_balance));
  if (!(params.residual_noise >= 0.0F && params.residual_noise <= 1.0F)) {
    return {StatusCode::invalid_argument, "photograph: residual noise in [0, 1]"};
  }
  IspParams isp;
  isp.tone = params.tone;
  return validate(isp);
}

[[nodiscard]] constexpr std::size_t photograph_workspace_bytes(const PhotographParams& params, Shape shape) noexcept {
  return allocation_bytes<Vec3f>(shape.pixels()) +
         max_of(glare_workspace_bytes(params.glare, shape), auto_exposure_workspace_bytes(shape),
                white_balance_workspace_bytes(shape)) +
         kWorkspaceAlignment;
}

// `image` keeps the noise of two pictures apart.
template <class Executor>
Status photograph(const PhotographParams& params, std::uint64_t seed, std::uint32_t image,
                  ImageView<const Vec3f> luminance_cd_m2, ImageView<Rgb8> picture, CameraExposure& exposure,
                  Workspace& workspace, Executor& executor) {
  WorkspaceScope scope(workspace);
  ImageView<Vec3f> signal;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(luminance_cd_m2.shape(), signal));
  AutoExposureResult metered;
  NPSIM_RETURN_IF_ERROR(auto_exposure(params.exposure, luminance_cd_m2, metered, workspace, executor));
  exposure = metered.camera;
  NPSIM_RETURN_IF_ERROR(add_glare(params.glare, luminance_cd_m2, signal, workspace, executor));
  NPSIM_RETURN_IF_ERROR(expose(exposure, signal, signal, executor));
  NoiseParams noise;
  const Result<NoiseLevel> level = noise_level(exposure.iso);
  NPSIM_RETURN_IF_ERROR(level.status());
  noise.level = level.value();
  noise.residual = params.residual_noise;
  NPSIM_RETURN_IF_ERROR(add_noise(noise, seed, image, signal, signal, executor));
  IspParams isp;
  isp.tone = params.tone;
  NPSIM_RETURN_IF_ERROR(auto_white_balance(params.white_balance, signal, isp.white_balance, workspace, executor));
  return develop(isp, signal, picture, executor);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_PHOTOGRAPH_HPP
