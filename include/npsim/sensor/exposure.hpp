// SPDX-License-Identifier: Apache-2.0
// From scene luminance to the linear signal of a sensor, and the automatic choice of its sensitivity.
//
// A lens at f-number N in front of a surface of luminance L gives the sensor, in t seconds, the exposure
//   H = pi / (4 N^2) * transmittance * L t                 lx s  (axial image, far object)
// and the sensor saturates at H_sat = 78 / ISO lx s (saturation-based speed, ISO 12232). The signal is H / H_sat per
// channel of linear sRGB: 1 is full scale, values above stay until the ISP clips them.
// Check: 1 cd/m2 at f/2, 1/30 s, transmittance .9, ISO 3200 gives H = 5.9e-3 lx s, 24 % of full scale.
//
// Automatic exposure bisects log2 ISO until the mean luminance of the clipped signal meets a target. Clipping bounds
// what a lamp can add to its share of the area, so a few saturated lamps do not darken the street.
// The mean grows with ISO, hence the bisection is sound; rows are summed in double and in a fixed order.
// Error: ISO within a factor of 2^(log2(max / min) / 2^steps), below 1e-6. Cost: one pass over the image per step.
#ifndef NPSIM_SENSOR_EXPOSURE_HPP
#define NPSIM_SENSOR_EXPOSURE_HPP

#include <cmath>
#include <cstddef>
#include <initializer_list>

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/sensor/detail/signal.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct CameraExposure {
  float f_number = 2.0F;
  float time_s = 1.0F / 30.0F;  // a video camera cannot expose longer than a frame
  float iso = 3200.0F;
  float transmittance = 0.9F;  // of the lens
};

struct AutoExposureParams {
  CameraExposure camera;  // its iso is not used
  float iso_min = 100.0F;
  float iso_max = 6400.0F;
  // Mean luminance of the clipped signal. Photographs of real streets at night have .047 (range .023-.091).
  float target_mean = 0.045F;
  int steps = 24;
};

struct AutoExposureResult {
  CameraExposure camera;    // with the ISO that was chosen
  float achieved_mean = 0;  // mean luminance of the clipped signal at that ISO
  bool reached = false;     // false when even iso_min is too bright or iso_max too dark
};

inline constexpr float kSaturationExposure = 78.0F;  // lx s at ISO 1

[[nodiscard]] inline Status validate(const CameraExposure& e) noexcept {
  const auto positive = [](float x) noexcept { return std::isfinite(x) && x > 0.0F; };
  const bool good = positive(e.f_number) && positive(e.time_s) && positive(e.iso) && positive(e.transmittance) &&
                    e.f_number >= 0.5F && e.f_number <= 128.0F && e.time_s <= 3600.0F && e.iso <= 1e7F &&
                    e.transmittance <= 1.0F;
  if (good) return {};
  return {StatusCode::invalid_argument,
          "exposure: f-number in [.5, 128], time in (0, 3600] s, ISO in (0, 1e7], transmittance in (0, 1]"};
}

[[nodiscard]] inline Status validate(const AutoExposureParams& p) noexcept {
  CameraExposure camera = p.camera;
  for (const float iso : {p.iso_min, p.iso_max}) {
    camera.iso = iso;
    NPSIM_RETURN_IF_ERROR(validate(camera));
  }
  if (p.iso_min <= p.iso_max && p.target_mean > 0.0F && p.target_mean < 1.0F && p.steps >= 1 && p.steps <= 64)
    return {};
  return {StatusCode::invalid_argument,
          "automatic exposure: iso_min <= iso_max, target mean in (0, 1), steps in 1..64"};
}

// Exposure of the sensor in lx s for a scene luminance in cd/m2.
[[nodiscard]] constexpr float exposure_lx_s(const CameraExposure& e, float luminance_cd_m2) noexcept {
  return 0.785398163F / (e.f_number * e.f_number) * e.transmittance * e.time_s * luminance_cd_m2;
}

// Signal (1 = full scale) per cd/m2.
[[nodiscard]] constexpr float signal_per_luminance(const CameraExposure& e) noexcept {
  return exposure_lx_s(e, 1.0F) * e.iso / kSaturationExposure;
}

[[nodiscard]] constexpr std::size_t auto_exposure_workspace_bytes(Shape shape) noexcept {
  const std::size_t rows = shape.empty() ? 0 : static_cast<std::size_t>(shape.height);
  return allocation_bytes<double>(chunk_count(rows, kSensorRowChunk)) + kWorkspaceAlignment;
}

// signal = luminance * signal_per_luminance(camera), not clipped. `out` may be `in`.
template <class Executor>
[[nodiscard]] Status expose(const CameraExposure& camera, ImageView<const Vec3f> luminance_cd_m2,
                            ImageView<Vec3f> signal, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(camera));
  NPSIM_RETURN_IF_ERROR(check_images(luminance_cd_m2, signal));
  const float gain = signal_per_luminance(camera);
  for_rows(signal.shape(), executor, [&](int y) {
    for (int x = 0; x < signal.width(); ++x) signal(x, y) = sane_sample(luminance_cd_m2(x, y)) * gain;
  });
  return {};
}

namespace exposure_detail {

// Mean luminance of the clipped signal.
template <class Executor>
[[nodiscard]] double mean_signal(ImageView<const Vec3f> image, float gain, Span<double> partial, Executor& executor) {
  const double sum = sum_pixels(image, partial, executor, [gain](const Vec3f& c) noexcept {
    return static_cast<double>(luminance(saturated(sane_sample(c) * gain)));
  });
  return sum / static_cast<double>(image.shape().pixels());
}

}  // namespace exposure_detail

// `luminance_cd_m2` is the image without glare: the veil of a lamp should not make the camera close down.
template <class Executor>
[[nodiscard]] Status auto_exposure(const AutoExposureParams& params, ImageView<const Vec3f> luminance_cd_m2,
                                   AutoExposureResult& out, Workspace& workspace, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(check_image(luminance_cd_m2));
  const WorkspaceScope scope(workspace);
  Span<double> partial;
  NPSIM_RETURN_IF_ERROR(
      workspace.allocate(chunk_count(static_cast<std::size_t>(luminance_cd_m2.height()), kSensorRowChunk), partial));

  CameraExposure camera = params.camera;
  const auto mean_at = [&](float iso) {
    camera.iso = iso;
    return exposure_detail::mean_signal(luminance_cd_m2, signal_per_luminance(camera), partial, executor);
  };
  const auto target = static_cast<double>(params.target_mean);
  float low = params.iso_min;   // too dark or just right
  float high = params.iso_max;  // too bright or just right
  bool reached = false;
  float iso = low;
  if (mean_at(low) >= target) {
    reached = mean_at(low) <= target * 1.0001;
  } else if (mean_at(high) <= target) {
    iso = high;
    reached = mean_at(high) >= target * 0.9999;
  } else {
    reached = true;
    for (int step = 0; step < params.steps; ++step) {
      iso = std::sqrt(low * high);
      (mean_at(iso) < target ? low : high) = iso;
    }
  }
  out.achieved_mean = static_cast<float>(mean_at(iso));
  out.camera = camera;  // mean_at left `iso` in it
  out.reached = reached;
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_EXPOSURE_HPP
