// SPDX-License-Identifier: Apache-2.0
// Which pixels of a night's picture are saturated, and in which noise hides what there is (sensor/signal_masks.hpp).
//
// The picture is taken once more without noise, with the exposure that it had: motion, glare and all that the sensor
// does, read in 16 bits. What is found therefore depends on the light and on how strong the noise is, not on how it
// fell out.
// White balance is that of the picture without noise.
// Invariant: the same bits for any executor. Cost: a picture without denoising, demosaic and tone.
// Memory: an image where there is motion, starburst or glare, and a float per pixel, besides what the steps take.
#ifndef NPSIM_PIPELINE_PICTURE_MASKS_HPP
#define NPSIM_PIPELINE_PICTURE_MASKS_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/pipeline/photograph.hpp"
#include "npsim/sensor/signal_masks.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

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
  const Result<NoiseLevel> level = noise_level(exposure.iso, camera.noise_table);
  NPSIM_RETURN_IF_ERROR(level.status());
  const NoiseParams noise{level.value(), camera.residual_noise};
  if (camera.ideal_sensor) {
    NPSIM_RETURN_IF_ERROR(expose(exposure, light, own, executor));
    return signal_masks(params, noise, own, out, executor);
  }
  SensorParams fine = camera.sensor;
  fine.bits = 16;
  fine.black = 0.0F;
  ImageView<float> plane;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(mosaic_shape(shape), plane));
  NPSIM_RETURN_IF_ERROR(
      capture(fine, signal_per_luminance(exposure), {noise.level, 0.0F}, intrinsics, 0, 0, light, plane, executor));
  Vec3f gains;
  NPSIM_RETURN_IF_ERROR(white_balance(camera.white_balance, camera.sensor, plane, gains, workspace, executor));
  return signal_masks(params, camera.sensor, noise, gains, plane, out, executor);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_PICTURE_MASKS_HPP
