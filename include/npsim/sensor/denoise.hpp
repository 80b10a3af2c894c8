// SPDX-License-Identifier: Apache-2.0
// What a camera does to its picture's grain and edges: noise removed from raw, the shown picture sharpened.
#ifndef NPSIM_SENSOR_DENOISE_HPP
#define NPSIM_SENSOR_DENOISE_HPP

#include <algorithm>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/sensor/detail/signal.hpp"
#include "npsim/sensor/noise.hpp"
#include "npsim/sensor/raw.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// What a camera removes of its noise, on the raw picture: each sample is averaged with those of the eight nearest
// samples of the same filter whose difference from it is likely to be noise.
//
//   out = sum w_i x_i / sum w_i,   w_i = max(0, 1 - (x_i - x)^2 / (strength sigma)^2)^2,   w of the sample itself 1
// with sigma^2 = residual^2 (beta1 min(x, shadows) + beta2) + q^2 / 12 of the sample, q a level of the converter:
// cameras remove more in the shadows and leave brighter areas their grain. It is the sigma filter (Lee, "Digital image
// smoothing and the sigma filter", 1983) with smooth weights. What differs by more than strength sigma is left alone.
// In a flat area of normal noise the standard deviation falls to .74 at a strength of 2, to .49 at 4, to .37 at 8.
// strength 0 is a copy. Cost: about 1.5 ns per pixel (AVX2). Memory: the caller's second plane.

struct RawDenoiseParams {
  float strength = 5.0F;    // in standard deviations of the noise; 0: none
  float shadows = 0.0005F;  // of full scale: from here on the strength no longer grows with the signal's noise
};

[[nodiscard]] inline Status validate(const RawDenoiseParams& p) noexcept {
  if (p.strength >= 0.0F && p.strength <= 64.0F && p.shadows >= 0.0F) return {};
  return {StatusCode::invalid_argument, "denoise: strength in [0, 64], shadows >= 0"};
}

// in, out: planes as capture() makes them, not the same.
template <class Executor>
[[nodiscard]] Status denoise_raw(const RawDenoiseParams& params, const SensorParams& sensor, const NoiseParams& noise,
                                 ImageView<const float> in, ImageView<float> out, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(noise));
  if (in.empty() || in.shape() != out.shape() || in.width() <= 2 * kMosaicMargin) {
    return {StatusCode::shape_mismatch, "denoise: two raw planes of the same size are needed, with their margins"};
  }
  using F = simd::F32;
  const int width = in.width() - 2 * kMosaicMargin;
  const float strength2 = params.strength * params.strength;
  const float reach2 = strength2 * noise.residual * noise.residual;
  const float level = 1.0F / level_range(sensor);
  const F beta1(noise.level.beta1 * reach2);
  // Not 0, so that no noise needs no case of its own.
  const F beta2(noise.level.beta2 * reach2 + strength2 * level * level / 12.0F + 1e-20F);
  const float range = raw_range(sensor);
  for_rows(executor, in.height(), [&](int y) {
    const float* rows[3];
    for (int i = 0; i < 3; ++i) rows[i] = in.row(raw_detail::mirrored(y + 2 * i - 2, in.height())) + kMosaicMargin;
    float* to = out.row(y) + kMosaicMargin;
    for (int x = 0; x < width; x += F::lanes) {
      const int n = width - x < F::lanes ? width - x : F::lanes;
      const F own = load_first<F>(rows[1] + x, n);
      F scale(1.0F);  // of the exposure that the sample comes from
      for (float longer = 1.0F; longer < range; longer *= sensor.ratio) {
        scale = select(own > F(0.9F * longer), F(longer * sensor.ratio), scale);
      }
      const F nearer = F(1.0F) / (scale * fma(beta1, simd::clamp(own, 0.0F, params.shadows), scale * beta2));
      F sum = own;
      F weights(1.0F);
      for (const float* row : rows) {
        for (int dx = -2; dx <= 2; dx += 2) {
          if (row == rows[1] && dx == 0) continue;
          const F other = load_first<F>(row + x + dx, n);
          const F d = other - own;
          const F t = max(fma(d * d, -nearer, F(1.0F)), F(0.0F));
          const F w = t * t;
          sum = fma(w, other, sum);
          weights = weights + w;
        }
      }
      store_first(sum / weights, to + x, n);
    }
    raw_detail::fill_margins(to, width);
  });
  return {};
}

// Sharpening of the shown picture, as cameras do it last: an unsharp mask on its luma.
//
//   c <- c + strength (Y - B * Y) for the three codes alike, Y = (54 r + 183 g + 19 b) / 256, B = (1 2 1) / 4 in either
//   axis, clipped to 0..255. Columns and rows of the border repeat.
// Beside luma of 192 to 240, the most of the 3 x 3, strength falls to 0: round what is clipped it would draw dark
// rings, and make more of the dots that the mosaic leaves there.
// A sinusoid of the highest frequency along a row or a column grows by 1 + strength, one of period 4 by
// 1 + strength / 2; flat areas stay. Noise grows with the edges: white noise of variance 1 to 1 + 1.5 s + .64 s^2.
// Error: rounding to a code. Cost: about 1.5 ns a pixel (AVX2). Memory: the caller's plane.

inline constexpr int kSharpenBelow = 240 * 256;
inline constexpr int kSharpenFade = 48 * 256;

// luma: of the picture's width at least, and its height; what it holds is lost. strength in [0, 4]; 0 changes nothing.
template <class Executor>
[[nodiscard]] Status sharpen(float strength, ImageView<Rgb8> picture, ImageView<float> luma, Executor& executor) {
  if (!(strength >= 0.0F && strength <= 4.0F)) return {StatusCode::invalid_argument, "sharpen: strength in [0, 4]"};
  if (picture.empty() || luma.width() < picture.width() || luma.height() != picture.height()) {
    return {StatusCode::shape_mismatch, "sharpen: a plane of the picture's size is needed"};
  }
  if (strength == 0.0F) return {};
  const Shape shape = picture.shape();
  const auto code = [](int c) { return static_cast<std::uint8_t>(std::min(std::max(c, 0), 255)); };
  for_rows(executor, shape.height, [&](int y) {
    const Rgb8* from = picture.row(y);
    float* to = luma.row(y);
    for (int x = 0; x < shape.width; ++x) {
      to[x] = (54.0F / 256.0F) * static_cast<float>(from[x].r) + (183.0F / 256.0F) * static_cast<float>(from[x].g) +
              (19.0F / 256.0F) * static_cast<float>(from[x].b);
    }
  });
  for_rows(executor, shape.height, [&](int y) {
    const float* rows[3] = {luma.row(y > 0 ? y - 1 : 0), luma.row(y), luma.row(y + 1 < shape.height ? y + 1 : y)};
    Rgb8* to = picture.row(y);
    const auto column = [&](int x) { return rows[0][x] + 2.0F * rows[1][x] + rows[2][x]; };
    // In 256ths and as whole numbers, whose minima and maxima compilers vectorise where those of floats may trap.
    const auto whole = [&](int row, int x) { return static_cast<int>(256.0F * rows[row][x]); };
    const auto brightest = [&](int x) { return std::max(std::max(whole(0, x), whole(1, x)), whole(2, x)); };
    // What the codes of a pixel grow by: whole codes, for all of a stretch first, in loops that compilers vectorise.
    constexpr int kStretch = 128;
    int more[kStretch];
    const auto grow = [&](int x, int left, int right) {
      const float blurred = (column(left) + 2.0F * column(x) + column(right)) * (1.0F / 16.0F);
      const int most = std::max(std::max(brightest(left), brightest(x)), brightest(right));
      const int below = std::min(std::max(kSharpenBelow - most, 0), kSharpenFade);
      const float share = static_cast<float>(below) * (1.0F / static_cast<float>(kSharpenFade));
      return static_cast<int>(share * strength * (rows[1][x] - blurred) + 1024.5F) - 1024;  // rounded, also below 0
    };
    for (int first = 0; first < shape.width; first += kStretch) {
      const int count = std::min(kStretch, shape.width - first);
      const bool begins = first == 0;
      const bool ends = first + count == shape.width;
      for (int i = begins ? 1 : 0; i < count - (ends ? 1 : 0); ++i) {
        more[i] = grow(first + i, first + i - 1, first + i + 1);
      }
      if (begins) more[0] = grow(0, 0, std::min(1, shape.width - 1));
      if (ends) more[count - 1] = grow(shape.width - 1, std::max(shape.width - 2, 0), shape.width - 1);
      for (int i = 0; i < count; ++i) {
        Rgb8& c = to[first + i];
        c = {code(c.r + more[i]), code(c.g + more[i]), code(c.b + more[i])};
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_DENOISE_HPP
