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
// Randomness: one Philox block per pixel, keyed by (seed, image, pixel index). A normal number comes from 32 random
// bits by inverting the cumulative distribution (Wichura, "Algorithm AS 241: the percentage points of the normal
// distribution", Applied Statistics 37, 1988; its 7-digit version) with +, *, /, sqrt and frexp alone, which IEEE 754
// rounds alike everywhere: noise has the same bits on every machine, which std::log would not promise.
// Cost: about .1 us per pixel.
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

[[nodiscard]] inline Status validate(const NoiseParams& p) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(p.level));
  if (p.residual >= 0.0F && p.residual <= 1.0F) return {};
  return {StatusCode::invalid_argument, "noise: residual in [0, 1]"};
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

namespace noise_detail {

// Natural logarithm of a positive normal number, within 1e-11 relative.
[[nodiscard]] inline double log_of(double x) noexcept {
  int exponent = 0;
  double mantissa = std::frexp(x, &exponent);  // in [1/2, 1)
  if (mantissa < 0.70710678118654752) {
    mantissa *= 2.0;
    --exponent;
  }
  // log m = 2 artanh s with |s| < .1716
  const double s = (mantissa - 1.0) / (mantissa + 1.0);
  const double q = s * s;
  const double series =
      1.0 + q * (1.0 / 3.0 + q * (1.0 / 5.0 + q * (1.0 / 7.0 + q * (1.0 / 9.0 + q * (1.0 / 11.0 + q / 13.0)))));
  return 2.0 * s * series + static_cast<double>(exponent) * 0.69314718055994531;
}

// Monotonic in the bits. The argument is (bits + 1/2) 2^-32, so results lie within +-6.4 and +x and -x come from
// mirrored bits. Error: below 2e-7 max(1, |x|) (measured).
[[nodiscard]] inline float standard_normal(std::uint32_t bits) noexcept {
  const double p = (static_cast<double>(bits) + 0.5) * 0x1p-32;
  const double q = p - 0.5;
  if (std::fabs(q) <= 0.425) {
    const double r = 0.180625 - q * q;
    const double above = ((5.9109374720e1 * r + 1.5929113202e2) * r + 5.0434271938e1) * r + 3.3871327179;
    const double below = ((6.7187563600e1 * r + 7.8757757664e1) * r + 1.7895169469e1) * r + 1.0;
    return static_cast<float>(q * above / below);
  }
  // The smaller tail is at least 2^-33, whose r is 4.8: the method's third range, r > 5, is never reached.
  const double r = std::sqrt(-log_of(q < 0.0 ? p : 1.0 - p)) - 1.6;
  const double above = ((1.7023821103e-1 * r + 1.3067284816) * r + 2.7568153900) * r + 1.4234372777;
  const double below = (1.2021132975e-1 * r + 7.3700164250e-1) * r + 1.0;
  const double x = above / below;
  return static_cast<float>(q < 0.0 ? -x : x);
}

}  // namespace noise_detail

// `image`: index of the image in its data set; no two of one seed share their noise. `out` may be `signal`.
template <class Executor>
[[nodiscard]] Status add_noise(const NoiseParams& params, std::uint64_t seed, std::uint32_t image,
                               ImageView<const Vec3f> signal, ImageView<Vec3f> out, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(check_images(signal, out));
  if (signal.shape().pixels() > std::numeric_limits<std::uint32_t>::max()) {
    return Status(StatusCode::capacity_exceeded, "noise: more than 2^32 pixels would share random numbers");
  }
  const auto noisy = [&params](float x, std::uint32_t bits) noexcept {
    const float sigma = params.residual * std::sqrt(params.level.beta1 * x + params.level.beta2);
    return x + sigma * noise_detail::standard_normal(bits);
  };
  const auto width = static_cast<std::uint32_t>(signal.width());
  for_rows(signal.shape(), executor, [&](int y) {
    const Vec3f* from = signal.row(y);
    Vec3f* to = out.row(y);
    for (std::uint32_t x = 0; x < width; ++x) {
      RandomStream random(seed, RandomPurpose::noise, image, 0, static_cast<std::uint32_t>(y) * width + x, 0);
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
