// SPDX-License-Identifier: Apache-2.0
// The sensor: from light on its surface to the raw picture behind its colour filters.
//
// raw(x, y) = dequantise(round(clip(v g m . (B * rgb)) + noise)), with B the lens' blur, m the row of `response` of the
// pixel's filter, g the exposure's signal per cd/m2, v the vignetting 1 - s (1 - cos^4) at the pixel's angle off the
// axis.
// - Colour: a camera's filters overlap. The response to linear sRGB is of the kind that the colour matrices of raw
//   converters show (rows of sum 1 there, times the channel's sensitivity to daylight): a red lamp reaches a quarter of
//   its red signal in green. Clipping therefore happens per filter, before any white balance.
// - Blur: the filter (a, 1 - 2 a, a) in either axis, of variance 2 a = blur_px^2, for the lens, its low-pass filter and
//   the pixel's area. Pictures that are rendered have edges sharper than any lens makes, which a mosaic turns into
//   coloured fringes.
// - Full well: 1 is full scale, of green under daylight; nothing above it is kept.
// - Noise: equation (3.10) in this domain, on what the well holds (sensor/noise.hpp), then the converter's levels from
//   -black to full scale, so that negative noise survives.
// - Rows: a row's amplifier adds one number to all its samples, `row_noise` of the read noise's standard deviation.
// - Hot pixels: a share of the pixels lets charge leak, exponentially distributed; which and how much is the sensor's,
//   by its `serial` number, and the same in every picture. hot_signal: its mean in this exposure, of full scale.
// - Several exposures: each `ratio` times shorter than the one before; a pixel is read from the longest in which it
//   stays below .9 of full scale, and the result is in full scales of the longest. Three at 12 bits and a ratio of 16
//   span 20 log10(2^12 16^2) = 120 dB.
// Samples are stored as float in a plane with a margin of kMosaicMargin mirrored columns on either side.
// Cost: one pass over the image, about 7 ns per pixel (AVX2). Memory: one float per pixel, the caller's.
#ifndef NPSIM_SENSOR_RAW_HPP
#define NPSIM_SENSOR_RAW_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/sensor/detail/signal.hpp"
#include "npsim/sensor/noise.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Filters of the upper left 2x2 pixels, row by row.
enum class Mosaic : std::uint8_t { rggb, bggr, grbg, gbrg };

// 0 red, 1 green, 2 blue.
[[nodiscard]] constexpr int filter_at(Mosaic mosaic, int x, int y) noexcept {
  const bool red_row = mosaic == Mosaic::rggb || mosaic == Mosaic::grbg ? y % 2 == 0 : y % 2 != 0;
  const bool green_first = mosaic == Mosaic::grbg || mosaic == Mosaic::gbrg;
  const bool green = (x % 2 == 0) == (green_first == (y % 2 == 0));
  return green ? 1 : (red_row ? 0 : 2);
}

struct SensorParams {
  Mosaic mosaic = Mosaic::rggb;
  // Raw red, green and blue of linear sRGB.
  Vec3f response[3] = {{0.312F, 0.182F, 0.026F}, {0.13F, 0.75F, 0.12F}, {0.013F, 0.124F, 0.483F}};
  int bits = 14;            // of the mean, where many read-outs are averaged
  float black = 256.0F;     // level of the converter for no light
  float vignetting = 0.4F;  // share of the cos^4 law that the lens leaves; 0: none
  float blur_px = 0.6F;     // standard deviation, at most .8; at .71 nothing of the mosaic's own frequency passes
  int exposures = 1;        // 1 to 4
  float ratio = 16.0F;      // of exposure times, from one to the next
  float row_noise = 0.0F;   // of the read noise; [0, 10]. Visible from a tenth on
  float hot_pixels = 0.0F;  // share; [0, .1]
  float hot_rate = 0.05F;   // mean of their signals: whites a second at ISO 100 [assumed]
  int serial = 1;           // which camera this is
};

// Mean signal of hot pixels in an exposure.
[[nodiscard]] constexpr float hot_signal(const SensorParams& p, float time_s, float iso) noexcept {
  return p.hot_rate * time_s * iso / 100.0F;
}

inline constexpr int kMosaicMargin = 2;

[[nodiscard]] inline Status validate(const SensorParams& p) noexcept {
  bool good = p.bits >= 8 && p.bits <= 16 && p.black >= 0.0F && p.vignetting >= 0.0F && p.vignetting <= 1.0F &&
              p.blur_px >= 0.0F && p.blur_px <= 0.8F && p.exposures >= 1 && p.exposures <= 4 && p.ratio > 1.0F &&
              p.ratio <= 256.0F && p.row_noise >= 0.0F && p.row_noise <= 10.0F && p.hot_pixels >= 0.0F &&
              p.hot_pixels <= 0.1F && p.hot_rate >= 0.0F && p.hot_rate <= 1e6F && p.serial >= 0;
  good = good && p.black < 0.5F * static_cast<float>(1 << p.bits);
  for (const Vec3f& row : p.response) {
    good = good && is_finite(row) && row.x + row.y + row.z > 0.01F && row.x + row.y + row.z <= 16.0F;
  }
  return good ? Status()
              : Status(StatusCode::invalid_argument,
                       "sensor: bits in 8..16, black level below half of them, vignetting in [0, 1], blur in [0, .8] "
                       "px, exposures in 1..4, "
                       "ratio in (1, 256], response rows of positive sum, row noise in [0, 10], hot pixels in [0, .1]");
}

// Largest raw value, in full scales of the longest exposure.
[[nodiscard]] constexpr float raw_range(const SensorParams& p) noexcept {
  float range = 1.0F;
  for (int i = 1; i < p.exposures; ++i) range *= p.ratio;
  return range;
}

// Levels of the converter: its greatest, and how many lie between no light and full scale.
[[nodiscard]] constexpr int white_level(const SensorParams& p) noexcept { return (1 << p.bits) - 1; }
[[nodiscard]] constexpr float level_range(const SensorParams& p) noexcept {
  return static_cast<float>(white_level(p)) - p.black;
}

// Elements of a row of the plane.
[[nodiscard]] constexpr Shape mosaic_shape(Shape shape) noexcept {
  return {shape.width + 2 * kMosaicMargin, shape.height};
}

namespace raw_detail {

// Index into [0, n) of the signal mirrored about the centres of its end samples, which keeps the filters' order.
[[nodiscard]] constexpr int mirrored(int i, int n) noexcept {
  if (n < 3) return ((i % n) + n) % n;
  if (i < 0) return -i;
  return i < n ? i : 2 * n - 2 - i;
}

inline void fill_margins(float* row, int n) noexcept {
  for (int i = 1; i <= kMosaicMargin; ++i) {
    row[-i] = row[mirrored(-i, n)];
    row[n - 1 + i] = row[mirrored(n - 1 + i, n)];
  }
}

// Calls f(x, charge) for the hot pixels of a row; charges have a mean of 1.
template <class F>
void for_hot_pixels(const SensorParams& p, int width, int y, const F& f) noexcept {
  RandomStream random(static_cast<std::uint64_t>(p.serial), RandomPurpose::sensor, 0, 0xFFFFFFU,
                      static_cast<std::uint32_t>(y), 0);
  const int count = static_cast<int>(p.hot_pixels * static_cast<float>(width) + random.uniform());
  for (int i = 0; i < count; ++i) {
    const int x = static_cast<int>(random.uniform() * static_cast<float>(width));
    f(x, -simd::log(simd::scalar::F32(1.0F - random.uniform())).value);
  }
}

}  // namespace raw_detail

// gain: signal_per_luminance() of the exposure, over the headroom. plane: of mosaic_shape(). `image` keeps the noise of
// two pictures apart. hot: hot_signal() of the exposure, over the headroom.
template <class Executor>
[[nodiscard]] Status capture(const SensorParams& params, float gain, const NoiseParams& noise,
                             const Intrinsics& intrinsics, std::uint64_t seed, std::uint32_t image,
                             ImageView<const Vec3f> luminance_cd_m2, ImageView<float> plane, Executor& executor,
                             float hot = 0.0F) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(noise));
  NPSIM_RETURN_IF_ERROR(validate(intrinsics));
  NPSIM_RETURN_IF_ERROR(check_image(luminance_cd_m2));
  const Shape shape = luminance_cd_m2.shape();
  if (plane.empty() || plane.shape() != mosaic_shape(shape)) {
    return {StatusCode::shape_mismatch, "capture: the plane must have the image's size and its margins"};
  }
  if (!(gain >= 0.0F && gain <= 1e12F)) return {StatusCode::invalid_argument, "capture: gain in [0, 1e12]"};
  if (!(hot >= 0.0F && hot <= 1e12F)) return {StatusCode::invalid_argument, "capture: hot signal in [0, 1e12]"};
  NPSIM_RETURN_IF_ERROR(noise_detail::check_streams(shape.width, shape.height));

  using F = simd::F32;
  const F beta1(noise.level.beta1);
  const F beta2(noise.level.beta2);
  const F residual(noise.residual);
  const float levels = level_range(params);
  const float range = raw_range(params);
  const float outer = 0.5F * params.blur_px * params.blur_px;
  const float inner = 1.0F - 2.0F * outer;
  for_rows(executor, shape.height, [&](int y) {
    // The filters of this row, alternating; a batch starts at an even or an odd column.
    float weight[3][simd::kMaxLanes + 1];
    for (int i = 0; i <= simd::kMaxLanes; ++i) {
      const Vec3f& row = params.response[filter_at(params.mosaic, i, y)];
      weight[0][i] = row.x * gain;
      weight[1][i] = row.y * gain;
      weight[2][i] = row.z * gain;
    }
    const float tangent_y = (static_cast<float>(y) + 0.5F - intrinsics.cy) / intrinsics.fy;
    const F beside(1.0F + tangent_y * tangent_y);
    const Vec3f* rows[3] = {luminance_cd_m2.row(y > 0 ? y - 1 : 0), luminance_cd_m2.row(y),
                            luminance_cd_m2.row(y + 1 < shape.height ? y + 1 : y)};
    float* to = plane.row(y) + kMosaicMargin;
    F row_offset(0.0F);
    if (params.row_noise > 0.0F) {
      alignas(64) float numbers[noise_detail::kSegment];
      noise_detail::normal_segment({seed, image, 2}, static_cast<std::uint32_t>(y), numbers);
      row_offset = F(params.row_noise * numbers[0]) * residual * sqrt(beta2);
    }
    for (int begin = 0; begin < shape.width; begin += noise_detail::kSegment) {
      const int end = begin + noise_detail::kSegment < shape.width ? begin + noise_detail::kSegment : shape.width;
      alignas(64) float normal[noise_detail::kSegment];
      noise_detail::normal_segment({seed, image, 1},
                                   static_cast<std::uint32_t>(y) * noise_detail::segments(shape.width) +
                                       static_cast<std::uint32_t>(begin / noise_detail::kSegment),
                                   normal);
      // Blurred along the columns, with a column more on either side, where there is one; then along the row.
      alignas(64) float column[3 * (noise_detail::kSegment + 2) + simd::kMaxLanes];
      const int from = begin > 0 ? begin - 1 : 0;
      const int to_column = end < shape.width ? end + 1 : end;
      float* first = column + 3 * (from - (begin - 1));
      const int samples = 3 * (to_column - from);
      for (int i = 0; i < samples; i += F::lanes) {
        const int n = samples - i < F::lanes ? samples - i : F::lanes;
        const auto sane = [&](int r) { return load_sane<F>(&rows[r][from].x + i, n); };
        store_first(fma(sane(1), F(inner), (sane(0) + sane(2)) * F(outer)), first + i, n);
      }
      for (int c = 0; c < 3; ++c) {
        if (begin == 0) column[c] = column[3 + c];
        if (end == shape.width) column[3 * (end - begin + 1) + c] = column[3 * (end - begin) + c];
      }
      alignas(64) float dark_signal[noise_detail::kSegment] = {};
      if (params.hot_pixels > 0.0F) {
        raw_detail::for_hot_pixels(params, shape.width, y, [&](int x, float charge) {
          if (x >= begin && x < end) dark_signal[x - begin] += charge * hot;
        });
      }
      alignas(64) float blurred[3 * noise_detail::kSegment + simd::kMaxLanes];
      for (int i = 0; i < 3 * (end - begin); i += F::lanes) {
        const float* c = column + i;
        fma(F::load(c + 3), F(inner), (F::load(c) + F::load(c + 6)) * F(outer)).store(blurred + i);
      }
      for (int x = begin; x < end; x += F::lanes) {
        const int n = end - x < F::lanes ? end - x : F::lanes;
        const simd::F32x3<F> light = simd::load3<F>(blurred + 3 * (x - begin), n);
        F signal = light.x * F::load(weight[0] + (x & 1));
        signal = fma(light.y, F::load(weight[1] + (x & 1)), signal);
        signal = fma(light.z, F::load(weight[2] + (x & 1)), signal);
        const F tangent_x = (F::iota() + F(static_cast<float>(x) + 0.5F - intrinsics.cx)) * F(1.0F / intrinsics.fx);
        const F secant2 = fma(tangent_x, tangent_x, beside);
        signal = fma(signal, fma(F(params.vignetting), F(1.0F) / (secant2 * secant2) - F(1.0F), F(1.0F)),
                     F::load(dark_signal + (x - begin)));

        F scale(1.0F);  // of the exposure that a pixel is read from
        for (float longer = 1.0F; longer < range; longer *= params.ratio) {
          scale = select(signal > F(0.9F * longer), F(longer * params.ratio), scale);
        }
        const F well = min(range > 1.0F ? signal / scale : signal, F(1.0F));
        const F noisy = fma(residual * sqrt(fma(beta1, well, beta2)), F::load(normal + (x - begin)), well + row_offset);
        const F read = simd::clamp(round_even(fma(noisy, F(levels), F(params.black))), 0.0F, levels + params.black);
        store_first((read - F(params.black)) * F(1.0F / levels) * scale, to + x, n);
      }
    }
    raw_detail::fill_margins(to, shape.width);
  });
  return {};
}

// The converter's levels, 0 to 2^bits - 1, of a plane of one exposure as capture() makes it.
template <class Executor>
[[nodiscard]] Status raw_levels(const SensorParams& params, ImageView<const float> plane,
                                ImageView<std::uint16_t> levels, Executor& executor) {
  if (params.exposures != 1) return {StatusCode::invalid_argument, "raw: several exposures have no levels in common"};
  if (levels.empty() || plane.shape() != mosaic_shape(levels.shape())) {
    return {StatusCode::shape_mismatch, "raw: the plane must have the picture's size and its margins"};
  }
  const float range = level_range(params);
  for_rows(executor, levels.height(), [&](int y) {
    const float* from = plane.row(y) + kMosaicMargin;
    for (int x = 0; x < levels.width(); ++x) {
      levels(x, y) = static_cast<std::uint16_t>(from[x] * range + params.black + 0.5F);
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_RAW_HPP
