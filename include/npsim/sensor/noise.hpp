// SPDX-License-Identifier: Apache-2.0
// Noise of a sensor, equation (3.10): added, and measured.
#ifndef NPSIM_SENSOR_NOISE_HPP
#define NPSIM_SENSOR_NOISE_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/sensor/detail/normal.hpp"
#include "npsim/sensor/detail/signal.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Shot and read noise of a sensor, equation (3.10):
//   I_n = I_c + N(0, beta1 I_c + beta2)
// on the linear signal x = (DN - black) / (white - black), 1 = full scale. beta1 x is the photons' variance, beta2 the
// read-out's; both grow with the gain.
//
// Defaults: beta1 = 1.46e-6 ISO, and beta2 of a measured phone sensor between ISO 100 and 3200. A table is interpolated
// in log-log; outside of it beta1 goes on in proportion to ISO, beta2 stays below and goes on as ISO^2 above, as for
// gain after read-out.
// `residual` scales the standard deviation: a stored sample that is the mean of n read-outs (pixels binned, frames
// averaged) has a residual of 1 / sqrt(n); 1 is the raw signal of the equation. The result is not clipped: negative
// noise survives in a raw signal.
// Randomness: normal numbers of detail/normal.hpp, keyed by (seed, image, stage, sample).
// Cost: about 3 ns per sample.

// Variance of the signal x: beta1 x + beta2.
struct NoiseLevel {
  float beta1 = 0.0F;
  float beta2 = 0.0F;
};

struct NoiseParams {
  NoiseLevel level;
  float residual = 1.0F;  // of the standard deviation, in [0, 1]
};

// At a speed by which cameras are rated; 1 is then white of the picture (headroom() in sensor/isp.hpp).
struct NoiseAtIso {
  float iso = 0.0F;
  NoiseLevel level;
};
inline constexpr NoiseAtIso kNoiseTable[] = {{100.0F, {1.46e-4F, 2.6e-7F}},   {200.0F, {2.92e-4F, 2.8e-7F}},
                                             {400.0F, {5.84e-4F, 4.6e-7F}},   {800.0F, {1.168e-3F, 2.2e-6F}},
                                             {1600.0F, {2.336e-3F, 1.1e-5F}}, {3200.0F, {4.672e-3F, 4.4e-5F}}};
inline constexpr Span<const NoiseAtIso> kDefaultNoise{kNoiseTable};

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

[[nodiscard]] inline Status validate(Span<const NoiseAtIso> table) noexcept {
  bool good = !table.empty();
  float before = 0.0F;
  for (const NoiseAtIso& entry : table) {
    good = good && entry.iso > before && entry.iso <= 1e7F;
    before = entry.iso;
    NPSIM_RETURN_IF_ERROR(validate(entry.level));
  }
  return good ? Status()
              : Status(StatusCode::invalid_argument, "noise: a table of one row or more, ISO ascending in (0, 1e7]");
}

// Of a fit var(DN) = slope DN + intercept over digital numbers that include the black level, as tables in the wild
// have it: their intercept is negative.
[[nodiscard]] constexpr NoiseLevel without_black_level(double slope, double intercept, double black,
                                                       double white) noexcept {
  const double range = white - black;
  return {static_cast<float>(slope / range), static_cast<float>((intercept + slope * black) / (range * range))};
}

// Noise at an ISO speed in (0, 1e7] by a valid table.
[[nodiscard]] inline Result<NoiseLevel> noise_level(float iso, Span<const NoiseAtIso> table = kDefaultNoise) noexcept {
  if (!(iso > 0.0F && iso <= 1e7F)) return Status(StatusCode::invalid_argument, "noise: ISO in (0, 1e7]");
  NPSIM_RETURN_IF_ERROR(validate(table));
  const NoiseAtIso& first = table[0];
  const NoiseAtIso& last = table[table.size() - 1];
  NoiseLevel level;
  if (iso <= first.iso) {
    level = {first.level.beta1 * (iso / first.iso), first.level.beta2};
  } else if (iso >= last.iso) {
    const float gain = iso / last.iso;
    level = {last.level.beta1 * gain, last.level.beta2 * gain * gain};
  } else {
    std::size_t i = 0;
    while (iso > table[i + 1].iso) ++i;
    const float t = std::log(iso / table[i].iso) / std::log(table[i + 1].iso / table[i].iso);
    const auto between = [t](float a, float b) {
      return a > 0.0F && b > 0.0F ? a * std::pow(b / a, t) : a + (b - a) * t;
    };
    level = {between(table[i].level.beta1, table[i + 1].level.beta1),
             between(table[i].level.beta2, table[i + 1].level.beta2)};
  }
  // Beyond this a sensor shows nothing but noise; the ranges of validate() hold.
  if (level.beta1 > 1.0F) level.beta1 = 1.0F;
  if (level.beta2 > 1.0F) level.beta2 = 1.0F;
  return level;
}

namespace noise_detail {

// Segments of all rows must have numbers of their own.
[[nodiscard]] inline Status check_streams(int samples_per_row, int rows) noexcept {
  const std::uint64_t blocks =
      std::uint64_t{segments(samples_per_row)} * kSegmentBlocks * static_cast<std::uint64_t>(rows);
  if (blocks <= std::numeric_limits<std::uint32_t>::max()) return {};
  return {StatusCode::capacity_exceeded, "noise: more than 2^32 blocks of samples would share random numbers"};
}

}  // namespace noise_detail

// `image`: index of the image in its data set; no two of one seed share their noise. `out` may be `signal`.
template <class Executor>
[[nodiscard]] Status add_noise(const NoiseParams& params, std::uint64_t seed, std::uint32_t image,
                               ImageView<const Vec3f> signal, ImageView<Vec3f> out, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(check_images(signal, out));
  const int samples = 3 * signal.width();
  NPSIM_RETURN_IF_ERROR(noise_detail::check_streams(samples, signal.height()));
  using F = simd::F32;
  const F beta1(params.level.beta1);
  const F beta2(params.level.beta2);
  const F residual(params.residual);
  for_rows(executor, signal.height(), [&](int y) {
    const float* from = &signal.row(y)->x;
    float* to = &out.row(y)->x;
    for (int begin = 0; begin < samples; begin += noise_detail::kSegment) {
      alignas(64) float normal[noise_detail::kSegment];
      const std::uint32_t segment = static_cast<std::uint32_t>(y) * noise_detail::segments(samples) +
                                    static_cast<std::uint32_t>(begin / noise_detail::kSegment);
      noise_detail::normal_segment({seed, image, 0}, segment, normal);
      const int end = samples - begin < noise_detail::kSegment ? samples - begin : noise_detail::kSegment;
      for (int i = 0; i < end; i += F::lanes) {
        const int n = end - i < F::lanes ? end - i : F::lanes;
        const F x = min(max(load_first<F>(from + begin + i, n), F(0.0F)), F(kMaxSample));
        store_first(fma(residual * sqrt(fma(beta1, x, beta2)), F::load(normal + i), x), to + begin + i, n);
      }
    }
  });
  return {};
}

// beta1 and beta2 of equation (3.10) from raw pictures: of flat areas, or of two frames of one unmoving scene.
//
// An area gives, behind each of the four filters of the mosaic, a mean and a variance of the signal
// (DN - black) / (white - black). In one picture the variance is half the mean square of the differences between next
// neighbours behind one filter, each sample used once, so that a slow gradient hardly counts; in two frames it is half
// the variance of their differences, and any scene will do. A line is fitted to them by weighted least squares: the
// variance of a variance of n degrees of freedom is 2 v^2 / n, with v of the line itself, so the fit is repeated.
// Standard errors are those of the fit, widened where the variances scatter by more than chance (chi2 above 1).
// beta2 includes the converter's rounding, 1/12 of a level squared. Areas that touch 0 or full scale are no good.
// Error: unbiased; the true values lie within 1.96 standard errors in 95 of 100 pictures. Cost: a pass over the areas.

struct NoiseSample {
  double mean = 0.0;
  double variance = 0.0;
  double freedom = 0.0;  // degrees of it; 0: the area is no good
};

struct NoiseFit {
  double beta1 = 0.0;
  double beta2 = 0.0;
  double error1 = 0.0;  // standard errors
  double error2 = 0.0;
  double chi2 = 0.0;  // per degree of freedom
};

struct RawScale {
  double black = 0.0;
  double white = 65535.0;
};

namespace noise_fit_detail {

[[nodiscard]] constexpr bool usable(std::uint16_t level, const RawScale& scale) noexcept {
  return level > 0 && static_cast<double>(level) < scale.white;
}

}  // namespace noise_fit_detail

// Of the pixels of `area` at columns of parity px and rows of parity py.
[[nodiscard]] inline NoiseSample noise_of_area(const RawScale& scale, ImageView<const std::uint16_t> area, int px,
                                               int py) noexcept {
  double sum = 0.0;
  double squares = 0.0;
  double pairs = 0.0;
  for (int y = py; y < area.height(); y += 2) {
    for (int x = px; x + 2 < area.width(); x += 4) {
      const std::uint16_t a = area(x, y);
      const std::uint16_t b = area(x + 2, y);
      if (!noise_fit_detail::usable(a, scale) || !noise_fit_detail::usable(b, scale)) return {};
      const double d = static_cast<double>(a) - static_cast<double>(b);
      sum += static_cast<double>(a) + static_cast<double>(b);
      squares += d * d;
      pairs += 1.0;
    }
  }
  if (pairs < 8.0) return {};
  const double range = scale.white - scale.black;
  return {(0.5 * sum / pairs - scale.black) / range, 0.5 * squares / pairs / (range * range), pairs};
}

// The same of two frames' views of one area.
[[nodiscard]] inline NoiseSample noise_of_pair(const RawScale& scale, ImageView<const std::uint16_t> first,
                                               ImageView<const std::uint16_t> second, int px, int py) noexcept {
  double sum = 0.0;
  double difference = 0.0;
  double squares = 0.0;
  double count = 0.0;
  for (int y = py; y < first.height(); y += 2) {
    for (int x = px; x < first.width(); x += 2) {
      const std::uint16_t a = first(x, y);
      const std::uint16_t b = second(x, y);
      if (!noise_fit_detail::usable(a, scale) || !noise_fit_detail::usable(b, scale)) return {};
      const double d = static_cast<double>(a) - static_cast<double>(b);
      sum += static_cast<double>(a) + static_cast<double>(b);
      difference += d;
      squares += d * d;
      count += 1.0;
    }
  }
  if (count < 8.0) return {};
  const double range = scale.white - scale.black;
  const double variance = (squares - difference * difference / count) / (count - 1.0);
  return {(0.5 * sum / count - scale.black) / range, 0.5 * variance / (range * range), count - 1.0};
}

// Samples without a degree of freedom are left out.
[[nodiscard]] inline Status fit_noise(Span<const NoiseSample> samples, NoiseFit& out) noexcept {
  NoiseFit fit;
  double used = 0.0;
  for (int round = 0; round < 20; ++round) {
    double w = 0.0;
    double wx = 0.0;
    double wv = 0.0;
    double wxx = 0.0;
    double wxv = 0.0;
    used = 0.0;
    const auto weight = [&](const NoiseSample& s) {
      // At first all alike; a line that is not positive yet is no guide.
      const double v = fit.beta1 * s.mean + fit.beta2;
      return round == 0 || !(v > 0.0) ? s.freedom / (s.variance * s.variance + 1e-24) : s.freedom / (2.0 * v * v);
    };
    for (const NoiseSample& s : samples) {
      if (!(s.freedom > 0.0)) continue;
      const double k = weight(s);
      used += 1.0;
      w += k;
      wx += k * s.mean;
      wv += k * s.variance;
      wxx += k * s.mean * s.mean;
      wxv += k * s.mean * s.variance;
    }
    if (used < 3.0) return {StatusCode::no_valid_input, "noise: three areas or more that are neither dark nor full"};
    const double determinant = w * wxx - wx * wx;
    if (!(determinant > 1e-9 * w * wxx)) {
      return {StatusCode::no_valid_input, "noise: areas of different brightness are needed to tell beta1 from beta2"};
    }
    fit.beta1 = (w * wxv - wx * wv) / determinant;
    fit.beta2 = (wxx * wv - wx * wxv) / determinant;
    fit.error1 = std::sqrt(w / determinant);
    fit.error2 = std::sqrt(wxx / determinant);
    fit.chi2 = 0.0;
    for (const NoiseSample& s : samples) {
      if (!(s.freedom > 0.0)) continue;
      const double d = s.variance - fit.beta1 * s.mean - fit.beta2;
      fit.chi2 += weight(s) * d * d;
    }
    fit.chi2 /= used - 2.0;
  }
  const double wider = fit.chi2 > 1.0 ? std::sqrt(fit.chi2) : 1.0;
  fit.error1 *= wider;
  fit.error2 *= wider;
  out = fit;
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_NOISE_HPP
