// SPDX-License-Identifier: Apache-2.0
// Shot and read noise of a sensor, equation (3.10):
//   I_n = I_c + N(0, beta1 I_c + beta2)
// on the linear signal x = (DN - black) / (white - black), 1 = full scale. beta1 x is the photons' variance, beta2 the
// read-out's; both grow with the gain.
//
// Defaults: beta1 = 1.46e-6 ISO, and beta2 of a measured phone sensor between ISO 100 and 3200, interpolated in
// log-log; below 100 the first value holds, above 3200 the last slope goes on (ISO^2, as for gain after read-out).
// A camera removes most of this before it shows a picture. `residual` scales the standard deviation and stands for its
// denoiser: 1 is the raw signal of the equation. The default is set so that at ISO 3200 the displayed standard
// deviation is .55 to 1.25 / 255 at every level up to 128, as in flat areas of real night photographs (.6 to 1.2);
// theirs rises with the level, that of one factor peaks near level 10. The grain size that denoisers leave is not
// modelled either. The result is not clipped: negative noise survives in a raw signal, and clipping belongs to the ISP.
// Randomness: one Philox block per pixel, keyed by (seed, image, pixel index). Cost: about .1 us per pixel.
#ifndef NPSIM_SENSOR_NOISE_HPP
#define NPSIM_SENSOR_NOISE_HPP

#include <cmath>
#include <cstdint>
#include <limits>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/sensor/detail/normal_sample.hpp"
#include "npsim/sensor/detail/signal.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Variance of the signal x: beta1 x + beta2.
struct NoiseLevel {
  float beta1 = 0.0F;
  float beta2 = 0.0F;
};

struct NoiseParams {
  NoiseLevel level;
  float residual = 0.045F;  // share of the standard deviation that the camera's denoiser leaves, in [0, 1]
  std::uint64_t seed = 0;
  std::uint32_t image = 0;  // index of the image in its data set: no two share their noise
};

struct ReadNoise {
  float iso;
  float beta2;
};
inline constexpr ReadNoise kReadNoise[] = {{100.0F, 2.6e-7F}, {200.0F, 2.8e-7F},  {400.0F, 4.6e-7F},
                                           {800.0F, 2.2e-6F}, {1600.0F, 1.1e-5F}, {3200.0F, 4.4e-5F}};
inline constexpr float kShotNoisePerIso = 1.46e-6F;

[[nodiscard]] inline Status validate(const NoiseLevel& level) noexcept {
  const bool good = std::isfinite(level.beta1) && std::isfinite(level.beta2) && level.beta1 >= 0.0F &&
                    level.beta2 >= 0.0F && level.beta1 <= 1.0F && level.beta2 <= 1.0F;
  return good ? Status()
              : Status(StatusCode::invalid_argument,
                       "noise: beta1 and beta2 in [0, 1]; a negative beta2 has the black level folded in, convert it");
}

// The default noise of a sensor at an ISO speed, in (0, 1e7].
[[nodiscard]] inline Result<NoiseLevel> noise_level(float iso) noexcept {
  if (!(iso > 0.0F && iso <= 1e7F)) return Status(StatusCode::invalid_argument, "noise: ISO in (0, 1e7]");
  constexpr int kLast = static_cast<int>(sizeof(kReadNoise) / sizeof(kReadNoise[0])) - 1;
  NoiseLevel level{kShotNoisePerIso * iso, kReadNoise[0].beta2};
  if (iso > kReadNoise[0].iso) {
    int i = 0;
    while (i < kLast - 1 && iso > kReadNoise[i + 1].iso) ++i;
    const float slope =
        std::log(kReadNoise[i + 1].beta2 / kReadNoise[i].beta2) / std::log(kReadNoise[i + 1].iso / kReadNoise[i].iso);
    level.beta2 = kReadNoise[i].beta2 * std::pow(iso / kReadNoise[i].iso, slope);
  }
  // Beyond this a sensor shows nothing but noise; the ranges of validate() hold.
  if (level.beta1 > 1.0F) level.beta1 = 1.0F;
  if (level.beta2 > 1.0F) level.beta2 = 1.0F;
  return level;
}

// From a table that states var(DN) = slope DN + intercept for raw numbers that still contain the black level, as many
// do (their intercept is negative): with DN = black + x (white - black)
//   beta1 = slope / (white - black),   beta2 = (intercept + slope black) / (white - black)^2.
// For tables in units of full scale white is 1. A beta2 that stays negative is refused: the black level is wrong.
[[nodiscard]] inline Result<NoiseLevel> noise_level_from_raw(double slope, double intercept, double black,
                                                             double white) noexcept {
  const bool finite = std::isfinite(slope) && std::isfinite(intercept) && std::isfinite(black) && std::isfinite(white);
  if (!finite || !(white > black)) {
    return Status(StatusCode::invalid_argument, "noise: the white level must lie above the black level");
  }
  const double range = white - black;
  const NoiseLevel level{static_cast<float>(slope / range),
                         static_cast<float>((intercept + slope * black) / (range * range))};
  NPSIM_RETURN_IF_ERROR(validate(level));
  return level;
}


// `out` may be `signal`.
template <class Executor>
[[nodiscard]] Status add_noise(const NoiseParams& params, ImageView<const Vec3f> signal, ImageView<Vec3f> out,
                               Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params.level));
  if (!(params.residual >= 0.0F && params.residual <= 1.0F)) {
    return Status(StatusCode::invalid_argument, "noise: residual in [0, 1]");
  }
  NPSIM_RETURN_IF_ERROR(check_images(signal, out));
  if (signal.shape().pixels() > std::numeric_limits<std::uint32_t>::max()) {
    return Status(StatusCode::capacity_exceeded, "noise: more than 2^32 pixels would share random numbers");
  }
  const auto noisy = [&params](float x, std::uint32_t bits) noexcept {
    const float sigma = params.residual * std::sqrt(params.level.beta1 * x + params.level.beta2);
    return x + sigma * standard_normal(bits);
  };
  const auto width = static_cast<std::uint32_t>(signal.width());
  for_rows(signal.shape(), executor, [&](int y) {
    const Vec3f* from = signal.row(y);
    Vec3f* to = out.row(y);
    for (std::uint32_t x = 0; x < width; ++x) {
      RandomStream random(params.seed, RandomPurpose::noise, params.image, 0, static_cast<std::uint32_t>(y) * width + x,
                          0);
      const Vec3f rgb = sane_sample(from[x]);
      const float r = noisy(rgb.x, random.next_u32());
      const float g = noisy(rgb.y, random.next_u32());
      to[x] = {r, g, noisy(rgb.z, random.next_u32())};
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_NOISE_HPP
