// SPDX-License-Identifier: Apache-2.0
// Which pixels of a picture say nothing: those that the camera clipped, and those in which noise hides the light.
//
// Of raw samples x without noise, in full scales of the longest exposure, about a pixel: its own and its eight
// neighbours', which its three channels are made of:
//   saturated       one of them, times its gain of white balance, is at the end of the range: the ISP clips it
//                   (sensor/isp.hpp)
//   indiscernible   all of them have a signal-to-noise ratio of least_snr or less:
//                   x / sqrt(residual^2 (beta1 x + beta2) + q^2 / 12) <= least_snr,   q a level of the converter
// The ratio rises with x, so the second is one comparison with the positive root of
//   x^2 = least_snr^2 (residual^2 (beta1 x + beta2) + q^2 / 12).
// Noise is that of a stored sample, before the camera's denoiser. Signal equal to noise, the default, is where the
// dynamic range of a camera ends (ISO 15739).
// Error: rounding of the samples. Cost: one pass, nine samples a pixel. Memory: none.
#ifndef NPSIM_SENSOR_SIGNAL_MASKS_HPP
#define NPSIM_SENSOR_SIGNAL_MASKS_HPP

#include <cmath>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/sensor/detail/signal.hpp"
#include "npsim/sensor/noise.hpp"
#include "npsim/sensor/raw.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct SignalMaskParams {
  float least_snr = 1.0F;
};

// Not 0 where it holds.
struct SignalMasks {
  ImageView<std::uint8_t> saturated;
  ImageView<std::uint8_t> indiscernible;
};

[[nodiscard]] inline Status validate(const SignalMaskParams& p) noexcept {
  if (p.least_snr > 0.0F && p.least_snr <= 1000.0F) return {};
  return {StatusCode::invalid_argument, "signal masks: the least signal-to-noise ratio in (0, 1000]"};
}

// The signal of that ratio. step: a level of the converter, 0 without one.
[[nodiscard]] inline float signal_of_snr(const NoiseParams& noise, float step, float snr) noexcept {
  const double k2 = static_cast<double>(snr) * static_cast<double>(snr);
  const double r2 = static_cast<double>(noise.residual) * static_cast<double>(noise.residual);
  const double q = static_cast<double>(step);
  const double linear = k2 * r2 * static_cast<double>(noise.level.beta1);
  const double constant = k2 * (r2 * static_cast<double>(noise.level.beta2) + q * q / 12.0);
  return static_cast<float>(0.5 * (linear + std::sqrt(linear * linear + 4.0 * constant)));
}

// From here on a sample is full: rounding leaves some a little below.
inline constexpr float kFullSignal = 1.0F - 1.0F / 16384.0F;

// plane: of a picture without noise, as capture() makes it; sensor: the one whose noise and levels count.
template <class Executor>
[[nodiscard]] Status signal_masks(const SignalMaskParams& params, const SensorParams& sensor, const NoiseParams& noise,
                                  const Vec3f& gains, ImageView<const float> plane, const SignalMasks& out,
                                  Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(sensor));
  NPSIM_RETURN_IF_ERROR(validate(noise));
  const Shape shape = out.saturated.shape();
  if (out.saturated.empty() || out.indiscernible.shape() != shape || plane.shape() != mosaic_shape(shape)) {
    return {StatusCode::shape_mismatch, "signal masks: both must have one shape, and the plane its size with margins"};
  }
  const float least = signal_of_snr(noise, 1.0F / level_range(sensor), params.least_snr);
  const float full = kFullSignal * raw_range(sensor);
  const float gain[3] = {gains.x, gains.y, gains.z};
  for_rows(executor, shape.height, [&](int y) {
    const int top = y > 0 ? y - 1 : 0;
    const int bottom = y + 1 < shape.height ? y + 1 : y;
    for (int x = 0; x < shape.width; ++x) {
      const int right = x + 1 < shape.width ? x + 1 : x;
      float brightest = 0.0F;
      float fullest = 0.0F;
      for (int j = top; j <= bottom; ++j) {
        for (int i = x > 0 ? x - 1 : 0; i <= right; ++i) {
          const float sample = plane(i + kMosaicMargin, j);
          const float balanced = sample * gain[filter_at(sensor.mosaic, i, j)];
          if (sample > brightest) brightest = sample;
          if (balanced > fullest) fullest = balanced;
        }
      }
      out.saturated(x, y) = fullest >= full ? 1 : 0;
      out.indiscernible(x, y) = brightest <= least ? 1 : 0;
    }
  });
  return {};
}

// Of a sensor with three channels in every pixel and no converter: those of the pixel alone. signal: 1 = full scale.
template <class Executor>
[[nodiscard]] Status signal_masks(const SignalMaskParams& params, const NoiseParams& noise,
                                  ImageView<const Vec3f> signal, const SignalMasks& out, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(noise));
  NPSIM_RETURN_IF_ERROR(check_images(signal, out.saturated));
  NPSIM_RETURN_IF_ERROR(check_images(signal, out.indiscernible));
  const float least = signal_of_snr(noise, 0.0F, params.least_snr);
  for_rows(executor, signal.height(), [&](int y) {
    for (int x = 0; x < signal.width(); ++x) {
      const Vec3f c = sane_sample(signal(x, y));
      const float brightest = max_of(c.x, c.y, c.z);
      out.saturated(x, y) = brightest >= kFullSignal ? 1 : 0;
      out.indiscernible(x, y) = brightest <= least ? 1 : 0;
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_SIGNAL_MASKS_HPP
