// SPDX-License-Identifier: Apache-2.0
// A camera's image signal processor, reduced to what changes a picture's look: white balance, tone curve, sRGB, 8 bits.
//
// White balance: gains g_c proportional to (Y / m_c)^adaptation, with m the mean of the pixels that are not saturated
// (grey world) and Y its luminance, scaled so that the luminance of m stays. Adaptation 1 makes the mean grey, 0 leaves
// the light's colour. Photographs of real nights keep r/g of means 1.49 (.99 to 1.9): under sodium light, r/g 4, an
// adaptation of .5 leaves 2; under LED of 4000 K, r/g 1.5, it leaves 1.2.
// A pixel whose three channels are all saturated has lost its colour and is shown white whatever the gains.
//
// Tone curve, per channel on x clipped to [0, 1]:
//   clip    y = x                                                   (the preset of the thesis)
//   filmic  W = 2 - knee, z = W x, then the toe  z <- z^2 (1 + toe / W) / (z + toe), then above the knee
//           y = knee + (1 - knee) s (2 - s) with s = (z - knee) / (W - knee): a parabola that leaves the straight part
//           with its slope and arrives at 1 with slope 0. In between, y = W x (1 + toe / W) - toe + O(toe^2 / x).
// With the defaults W = 1.2: a mean signal of .045 is displayed at about .05.
// Then sRGB and rounding to the nearest of 256 levels, exact (color/srgb.hpp).
#ifndef NPSIM_SENSOR_ISP_HPP
#define NPSIM_SENSOR_ISP_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/color/srgb.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/sensor/detail/signal.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

enum class ToneKind : std::uint8_t { clip, filmic };

struct ToneCurve {
  ToneKind kind = ToneKind::filmic;
  float toe = 0.003F;  // how much the straight part is lowered; [0, .1]
  float knee = 0.8F;   // displayed level where the shoulder begins; [0, 1]
};

struct IspParams {
  Vec3f white_balance{1.0F, 1.0F, 1.0F};
  ToneCurve tone;
};

struct WhiteBalanceParams {
  float adaptation = 0.5F;  // 0: none, 1: the mean becomes grey
  float max_gain = 4.0F;    // of one channel, against the luminance
};

[[nodiscard]] inline Status validate(const WhiteBalanceParams& p) noexcept {
  const bool good = p.adaptation >= 0.0F && p.adaptation <= 1.0F && p.max_gain >= 1.0F && p.max_gain <= 32.0F;
  return good ? Status()
              : Status(StatusCode::invalid_argument, "white balance: adaptation in [0, 1], max_gain in [1, 32]");
}

[[nodiscard]] inline Status validate(const ToneCurve& c) noexcept {
  const bool good = c.toe >= 0.0F && c.toe <= 0.1F && c.knee >= 0.0F && c.knee <= 1.0F &&
                    (c.kind == ToneKind::clip || c.kind == ToneKind::filmic);
  return good ? Status() : Status(StatusCode::invalid_argument, "ISP: toe in [0, .1], knee in [0, 1]");
}

[[nodiscard]] inline Status validate(const IspParams& p) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(p.tone));
  const auto gain = [](float g) noexcept { return g >= 0.0F && g <= 64.0F; };
  if (gain(p.white_balance.x) && gain(p.white_balance.y) && gain(p.white_balance.z)) return {};
  return {StatusCode::invalid_argument, "ISP: white balance in [0, 64]"};
}

// Displayed linear value of a linear signal; 0 to 0, 1 to 1 and monotonic, within a rounding of 2^-23.
[[nodiscard]] constexpr float tone_map(const ToneCurve& curve, float x) noexcept {
  const float c = saturated(x);
  if (curve.kind == ToneKind::clip || !(c > 0.0F)) return c;
  const float white = 2.0F - curve.knee;
  float z = white * c;
  z = z * z * (1.0F + curve.toe / white) / (z + curve.toe);
  if (!(z > curve.knee)) return z;
  const float s = saturated((z - curve.knee) / (white - curve.knee));
  return curve.knee + (1.0F - curve.knee) * s * (2.0F - s);
}

[[nodiscard]] constexpr std::size_t white_balance_workspace_bytes(Shape shape) noexcept {
  const std::size_t rows = shape.empty() ? 0 : static_cast<std::size_t>(shape.height);
  return allocation_bytes<Vec3d>(chunk_count(rows, kSensorRowChunk)) + kWorkspaceAlignment;
}

// Gains for IspParams::white_balance; 1 each when every pixel is black or saturated.
template <class Executor>
[[nodiscard]] Status auto_white_balance(const WhiteBalanceParams& params, ImageView<const Vec3f> signal, Vec3f& gains,
                                        Workspace& workspace, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(check_image(signal));
  const WorkspaceScope scope(workspace);
  Span<Vec3d> partial;
  NPSIM_RETURN_IF_ERROR(
      workspace.allocate(chunk_count(static_cast<std::size_t>(signal.height()), kSensorRowChunk), partial));
  const Vec3d mean = sum_pixels(signal, partial, executor, [](const Vec3f& pixel) noexcept {
    const Vec3f c = saturated(pixel);
    return c.x < 1.0F && c.y < 1.0F && c.z < 1.0F ? vec_cast<double>(c) : Vec3d{};
  });
  gains = {1.0F, 1.0F, 1.0F};
  const auto weighted = [](const Vec3d& rgb) noexcept { return 0.2126 * rgb.x + 0.7152 * rgb.y + 0.0722 * rgb.z; };
  const double grey = weighted(mean);
  if (!(grey > 0.0)) return {};
  const auto limit = static_cast<double>(params.max_gain);
  const auto gain = [&](double channel) {
    const double full = channel * limit > grey ? (channel < grey * limit ? grey / channel : 1.0 / limit) : limit;
    return std::pow(full, static_cast<double>(params.adaptation));
  };
  const Vec3d raw{gain(mean.x), gain(mean.y), gain(mean.z)};
  gains = vec_cast<float>(raw * (grey / weighted(mean * raw)));
  return {};
}

// The displayed picture of a linear signal with 1 = full scale.
template <class Executor>
[[nodiscard]] Status develop(const IspParams& params, ImageView<const Vec3f> signal, ImageView<Rgb8> out,
                             Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(check_images(signal, out));
  const auto level = [&params](float x, float gain, float white) noexcept {
    return srgb_encode8(tone_map(params.tone, x * (gain + (1.0F - gain) * white)));
  };
  for_rows(signal.shape(), executor, [&](int y) {
    for (int x = 0; x < signal.width(); ++x) {
      const Vec3f c = saturated(signal(x, y));
      const float lowest = c.x < c.y ? (c.x < c.z ? c.x : c.z) : (c.y < c.z ? c.y : c.z);
      // Between .9 of full scale and saturation the gains fade to 1, so that a burnt lamp has no tinted edge.
      const float white = saturated((lowest - 0.9F) * 10.0F);
      out(x, y) = {level(c.x, params.white_balance.x, white), level(c.y, params.white_balance.y, white),
                   level(c.z, params.white_balance.z, white)};
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_ISP_HPP
