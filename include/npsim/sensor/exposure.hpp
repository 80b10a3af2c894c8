// SPDX-License-Identifier: Apache-2.0
// What a camera decides for each picture: exposure and white balance.
#ifndef NPSIM_SENSOR_EXPOSURE_HPP
#define NPSIM_SENSOR_EXPOSURE_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <initializer_list>

#include "npsim/color/chromaticity.hpp"
#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/sensor/detail/signal.hpp"
#include "npsim/sensor/raw.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// From scene luminance to the linear signal of a sensor, and the automatic choice of its sensitivity.
//
// A lens at f-number N in front of a surface of luminance L gives the sensor, in t seconds, the exposure
//   H = pi / (4 N^2) * transmittance * L t                 lx s  (axial image, far object)
// and H_sat = 78 / ISO lx s saturates it (saturation-based speed, ISO 12232). The signal is H / H_sat per
// channel of linear sRGB: 1 is full scale, values above stay until the ISP clips them. Where the picture's tone curve
// has a shoulder, 1 is white by its straight part, and the sensor takes more (headroom() in sensor/isp.hpp).
// Check: 1 cd/m2 at f/2, 1/30 s, transmittance .9, ISO 3200 gives H = 5.9e-3 lx s, 24 % of full scale.
//
// Automatic exposure looks for the ISO speed at which the metered mean of the clipped luminance meets a target, or,
// metering highlights, at which a stated share of the area saturates. Clipping bounds what a lamp can add to its share
// of the area, so a few saturated lamps do not darken the street. A camera follows only part of the way from the
// exposure of a usual night: dark streets stay darker than bright ones.
//   log2 ISO = log2 ISO_usual + compensation (log2 ISO_target - log2 ISO_usual), then + ev, then the limits.
// Metering reads a histogram of luminance with 32 bins an octave, which is bisected; of pictures above 100,000 pixels
// every other pixel of every other row.
// Error: ISO within 1e-3 where the target is a mean. Cost: a pass over a quarter of the image. Memory: 32 KiB for 64
// rows.

struct CameraExposure {
  float f_number = 2.0F;
  float time_s = 1.0F / 30.0F;  // a video camera cannot expose longer than a frame
  float iso = 3200.0F;
  float transmittance = 0.9F;  // of the lens
};

enum class Metering : std::uint8_t {
  mean,       // of the whole picture
  centre,     // weighted by a Gaussian about the middle, of a quarter of width and height
  highlight,  // the brightest `highlight_share` of the area reaches a signal of 1
  fixed       // CameraExposure::iso as it is
};

struct AutoExposureParams {
  CameraExposure camera;  // its iso is used by Metering::fixed alone
  Metering metering = Metering::mean;
  float iso_min = 100.0F;
  float iso_max = 6400.0F;
  // Metered mean of the clipped signal. Photographs of real streets at night have .047 (range .023-.091).
  float target_mean = 0.045F;
  float highlight_share = 0.005F;
  // Of a lit street whose luminance has a mean of .5 cd/m2, at f/2 and 1/30 s.
  float usual_iso = 1200.0F;
  float compensation = 0.7F;  // share of the stops between usual and target that are followed; 1: all
  float ev = 0.0F;            // exposure compensation set by hand, in stops
};

struct AutoExposureResult {
  CameraExposure camera;    // with the ISO that was chosen
  float achieved_mean = 0;  // mean luminance of the clipped signal at that ISO, metered likewise
  bool limited = false;     // by iso_min or iso_max
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
  NPSIM_RETURN_IF_ERROR(validate(camera));
  for (const float iso : {p.iso_min, p.iso_max, p.usual_iso}) {
    camera.iso = iso;
    NPSIM_RETURN_IF_ERROR(validate(camera));
  }
  const auto share = [](float x) noexcept { return x > 0.0F && x < 1.0F; };
  if (p.iso_min <= p.iso_max && share(p.target_mean) && share(p.highlight_share) && p.compensation >= 0.0F &&
      p.compensation <= 1.0F && p.ev >= -16.0F && p.ev <= 16.0F) {
    return {};
  }
  return {
      StatusCode::invalid_argument,
      "automatic exposure: iso_min <= iso_max, target mean and highlight share in (0, 1), compensation in [0, 1], ev "
      "in [-16, 16]"};
}

// Exposure of the sensor in lx s for a scene luminance in cd/m2.
[[nodiscard]] constexpr float exposure_lx_s(const CameraExposure& e, float luminance_cd_m2) noexcept {
  return 0.785398163F / (e.f_number * e.f_number) * e.transmittance * e.time_s * luminance_cd_m2;
}

// Signal (1 = full scale) per cd/m2.
[[nodiscard]] constexpr float signal_per_luminance(const CameraExposure& e) noexcept {
  return exposure_lx_s(e, 1.0F) * e.iso / kSaturationExposure;
}

// signal = luminance * signal_per_luminance(camera), not clipped. `out` may be `in`.
template <class Executor>
[[nodiscard]] Status expose(const CameraExposure& camera, ImageView<const Vec3f> luminance_cd_m2,
                            ImageView<Vec3f> signal, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(camera));
  NPSIM_RETURN_IF_ERROR(check_images(luminance_cd_m2, signal));
  const float gain = signal_per_luminance(camera);
  for_rows(executor, signal.height(), [&](int y) {
    for (int x = 0; x < signal.width(); ++x) signal(x, y) = sane_sample(luminance_cd_m2(x, y)) * gain;
  });
  return {};
}

namespace exposure_detail {

inline constexpr std::size_t kMeterRows = 64;     // per task
inline constexpr std::size_t kMeterAll = 100000;  // larger pictures are metered by every other pixel of every other row
inline constexpr std::uint32_t kBinShift = 18;    // 5 bits of the mantissa: 32 bins an octave
inline constexpr std::uint32_t kFirstBin = (127U - 24U) << 5U;  // 2^-24 cd/m2
inline constexpr std::size_t kBins = 64U << 5U;                 // up to 2^40

struct Bin {
  double weight = 0.0;
  double light = 0.0;  // weight times luminance
};

// Of the luminance of a sane sample.
[[nodiscard]] inline std::size_t bin_of(float luminance) noexcept {
  const auto bits = static_cast<std::uint32_t>(bitcast_int(simd::scalar::F32(luminance)).value) >> kBinShift;
  return bits <= kFirstBin ? 0 : (bits - kFirstBin < kBins ? bits - kFirstBin : kBins - 1);
}

// Weighted mean of min(1, gain luminance).
[[nodiscard]] inline double clipped_mean(Span<const Bin> bins, double gain) noexcept {
  double sum = 0.0;
  double weight = 0.0;
  for (const Bin& bin : bins) {
    const double signal = gain * bin.light;
    sum += signal < bin.weight ? signal : bin.weight;
    weight += bin.weight;
  }
  return weight > 0.0 ? sum / weight : 0.0;
}

// Share of the weight that saturates.
[[nodiscard]] inline double saturated_share(Span<const Bin> bins, double gain) noexcept {
  double sum = 0.0;
  double weight = 0.0;
  for (const Bin& bin : bins) {
    if (gain * bin.light >= bin.weight) sum += bin.weight;
    weight += bin.weight;
  }
  return weight > 0.0 ? sum / weight : 0.0;
}

}  // namespace exposure_detail

[[nodiscard]] constexpr std::size_t auto_exposure_workspace_bytes(Shape shape) noexcept {
  const std::size_t rows = shape.empty() ? 0 : static_cast<std::size_t>(shape.height);
  return allocation_bytes<exposure_detail::Bin>(exposure_detail::kBins *
                                                chunk_count(rows, exposure_detail::kMeterRows)) +
         kWorkspaceAlignment;
}

template <class Executor>
[[nodiscard]] Status auto_exposure(const AutoExposureParams& params, ImageView<const Vec3f> luminance_cd_m2,
                                   AutoExposureResult& out, Workspace& workspace, Executor& executor) {
  using namespace exposure_detail;
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(check_image(luminance_cd_m2));
  const WorkspaceScope scope(workspace);
  const Shape shape = luminance_cd_m2.shape();
  const auto rows = static_cast<std::size_t>(shape.height);
  const std::size_t step = shape.pixels() > kMeterAll ? 2 : 1;
  Span<Bin> partial;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(kBins * chunk_count(rows, kMeterRows), partial));
  executor.for_chunks(rows, kMeterRows, [&](std::size_t begin, std::size_t end) {
    const Span<Bin> bins = partial.sub(begin / kMeterRows * kBins, kBins);
    for (Bin& bin : bins) bin = {};
    // exp(-d^2 / (2 (1/4)^2)) in either axis, d in widths and heights from the middle
    const auto falloff = [](std::size_t i, int n) {
      const double d = (static_cast<double>(i) + 0.5) / n - 0.5;
      return static_cast<double>(simd::exp(simd::scalar::F32(static_cast<float>(-8.0 * d * d))).value);
    };
    for (std::size_t y = begin; y < end; y += step) {
      const Vec3f* row = luminance_cd_m2.row(static_cast<int>(y));
      const double row_weight = params.metering == Metering::centre ? falloff(y, shape.height) : 1.0;
      for (std::size_t x = 0; x < static_cast<std::size_t>(shape.width); x += step) {
        const float light = luminance(sane_sample(row[x]));
        Bin& bin = bins[bin_of(light)];
        const double weight = params.metering == Metering::centre ? row_weight * falloff(x, shape.width) : 1.0;
        bin.weight += weight;
        bin.light += weight * static_cast<double>(light);
      }
    }
  });
  const Span<Bin> bins = partial.sub(0, kBins);
  for (std::size_t i = kBins; i < partial.size(); ++i) {
    bins[i % kBins].weight += partial[i].weight;
    bins[i % kBins].light += partial[i].light;
  }

  out = {};
  out.camera = params.camera;
  const auto log2_of = [](float x) { return simd::log2(simd::scalar::F32(x)).value; };
  const auto gain_at = [&out](float log2_iso) {
    out.camera.iso = simd::exp2(simd::scalar::F32(log2_iso)).value;
    return static_cast<double>(signal_per_luminance(out.camera));
  };
  if (params.metering == Metering::fixed) {
    out.achieved_mean = static_cast<float>(clipped_mean(bins, static_cast<double>(signal_per_luminance(out.camera))));
    return {};
  }
  const bool by_mean = params.metering != Metering::highlight;
  const auto too_bright = [&](float log2_iso) {
    const double gain = gain_at(log2_iso);
    return by_mean ? clipped_mean(bins, gain) > static_cast<double>(params.target_mean)
                   : saturated_share(bins, gain) > static_cast<double>(params.highlight_share);
  };
  float low = -23.0F;
  float high = 23.0F;
  for (int halving = 0; halving < 24; ++halving) {
    const float middle = 0.5F * (low + high);
    (too_bright(middle) ? high : low) = middle;
  }
  const float chosen = (1.0F - params.compensation) * log2_of(params.usual_iso) + params.compensation * low + params.ev;
  const float limits[2] = {log2_of(params.iso_min), log2_of(params.iso_max)};
  out.limited = chosen < limits[0] || chosen > limits[1];
  out.achieved_mean = static_cast<float>(clipped_mean(bins, gain_at(clamp_to(chosen, limits[0], limits[1]))));
  return {};
}

// White balance of a raw picture: which light the camera takes for white.
//
//   automatic  the mean of the 2x2 quads of which no sample is white or above (grey world) is taken for a grey under a
//              glowing body, the nearest of the Planckian locus within the limits; the camera adapts to a share of it,
//              in reciprocal temperature from daylight at 6500 K
//   fixed      to a stated temperature
// Cameras limit the range: makers' manuals give 3500 to 8000 K or 3000 to 7000 K for automatic white balance. So LED of
// 4000 K comes out nearly white and sodium, 2000 K, stays orange.
// Gains are such that the least is 1: what saturates every filter is white.
// Cost: a pass over the plane. Error of the search: 2 per mega-kelvin (mired).

struct WhiteBalanceParams {
  float coolest_k = 8000.0F;
  float warmest_k = 3500.0F;
  float adaptation = 0.9F;  // 0: to daylight; 1: the found light becomes white
  float fixed_k = 0.0F;     // 0: automatic
};

[[nodiscard]] inline Status validate(const WhiteBalanceParams& p) noexcept {
  const auto temperature = [](float k) noexcept { return k >= 1700.0F && k <= 25000.0F; };
  const bool good = temperature(p.coolest_k) && temperature(p.warmest_k) && p.warmest_k <= p.coolest_k &&
                    p.adaptation >= 0.0F && p.adaptation <= 1.0F && (p.fixed_k == 0.0F || temperature(p.fixed_k));
  return good ? Status()
              : Status(
                    StatusCode::invalid_argument,
                    "white balance: temperatures in [1700, 25000] K, the warmest not above the coolest, adaptation in "
                    "[0, 1]");
}

namespace white_balance_detail {

// Raw signal of a glowing body, with green 1. mired: 1e6 / K.
[[nodiscard]] inline Vec3d raw_of_body(const SensorParams& sensor, double mired) noexcept {
  const Chromaticity xy = cct_to_xy(static_cast<float>(1e6 / mired), Locus::planckian).value();
  const auto x = static_cast<double>(xy.x);
  const auto y = static_cast<double>(xy.y);
  const Vec3d rgb = xyz_to_linear_srgb({x / y, 1.0, (1.0 - x - y) / y});
  const auto channel = [&](int c) {
    const double v = dot(vec_cast<double>(sensor.response[c]), rgb);
    return v > 1e-3 ? v : 1e-3;
  };
  const double green = channel(1);
  return {channel(0) / green, 1.0, channel(2) / green};
}

// Adds up the samples of two rows' quads of which all are below `clip`, by place in the quad: which filter stands there
// is the same for all. By column modulo kMaxLanes first, so that the sums are the same for any number of lanes.
template <class F>
void sum_quads(const float* upper, const float* lower, int width, float clip, double (&sum)[4]) noexcept {
  using I = typename F::Int;
  const int whole = width / 2 * 2;
  alignas(64) float of_row[4][simd::kMaxLanes] = {};
  for (int x = 0; x < whole; x += F::lanes) {
    const int n = whole - x < F::lanes ? whole - x : F::lanes;
    const F quad[4] = {load_first<F>(upper + x, n), load_first<F>(upper + x + 1, n), load_first<F>(lower + x, n),
                       load_first<F>(lower + x + 1, n)};
    auto counts = ((I::iota() + I(x)) & I(1)) == I(0);
    for (const F& sample : quad) counts = counts & (sample < F(clip));
    for (int i = 0; i < 4; ++i) {
      float* to = of_row[i] + x % simd::kMaxLanes;
      (F::load(to) + select(counts, quad[i], F(0.0F))).store(to);
    }
  }
  for (int i = 0; i < 4; ++i) {
    for (const float part : of_row[i]) sum[i] += static_cast<double>(part);
  }
}

[[nodiscard]] inline Vec3f gains_for(const Vec3d& raw) noexcept {
  const double most = raw.x > raw.y ? (raw.x > raw.z ? raw.x : raw.z) : (raw.y > raw.z ? raw.y : raw.z);
  return vec_cast<float>(Vec3d{most / raw.x, most / raw.y, most / raw.z});
}

}  // namespace white_balance_detail

[[nodiscard]] constexpr std::size_t white_balance_workspace_bytes(Shape shape) noexcept {
  const std::size_t rows = shape.empty() ? 0 : static_cast<std::size_t>(shape.height);
  return allocation_bytes<Vec3d>(chunk_count(rows, kSensorRowChunk)) + kWorkspaceAlignment;
}

// plane: as capture() makes it. white: of the picture, in full scales, so that the halos of lamps do not outweigh the
// street. Gains of a black picture are those of daylight.
template <class Executor>
[[nodiscard]] Status white_balance(const WhiteBalanceParams& params, const SensorParams& sensor,
                                   ImageView<const float> plane, Vec3f& gains, Workspace& workspace, Executor& executor,
                                   float white = 1.0F) {
  using namespace white_balance_detail;
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(sensor));
  constexpr double kDaylight = 1e6 / 6500.0;
  if (params.fixed_k != 0.0F) {
    gains = gains_for(raw_of_body(sensor, 1e6 / static_cast<double>(params.fixed_k)));
    return {};
  }
  if (plane.empty() || plane.width() <= 2 * kMosaicMargin) {
    return {StatusCode::no_valid_input, "white balance: needs a raw picture with its margins"};
  }
  const WorkspaceScope scope(workspace);
  const auto rows = static_cast<std::size_t>(plane.height());
  Span<Vec3d> partial;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(chunk_count(rows, kSensorRowChunk), partial));
  const int width = plane.width() - 2 * kMosaicMargin;
  const float clip = 0.95F * white * raw_range(sensor);
  executor.for_chunks(rows, kSensorRowChunk, [&](std::size_t begin, std::size_t end) {
    double sum[4] = {};
    for (std::size_t y = begin; y + 1 < end; y += 2) {  // chunks begin at even rows
      sum_quads<simd::F32>(plane.row(static_cast<int>(y)) + kMosaicMargin,
                           plane.row(static_cast<int>(y) + 1) + kMosaicMargin, width, clip, sum);
    }
    double channel[3] = {};
    for (int i = 0; i < 4; ++i) channel[filter_at(sensor.mosaic, i % 2, i / 2)] += sum[i];
    partial[begin / kSensorRowChunk] = {channel[0], 0.5 * channel[1], channel[2]};
  });
  Vec3d mean{};
  for (const Vec3d& part : partial) mean += part;
  double best_mired = kDaylight;
  if (mean.x > 0.0 && mean.y > 0.0 && mean.z > 0.0) {
    const double coolest = 1e6 / static_cast<double>(params.coolest_k);
    const double warmest = 1e6 / static_cast<double>(params.warmest_k);
    const int steps = 1 + static_cast<int>((warmest - coolest) / 2.0);
    double least = 1e300;
    for (int i = 0; i <= steps; ++i) {
      const double mired = coolest + (warmest - coolest) * i / steps;
      const Vec3d body = raw_of_body(sensor, mired);
      const double dr = std::log(mean.x / mean.y / body.x);
      const double db = std::log(mean.z / mean.y / body.z);
      if (dr * dr + db * db < least) {
        least = dr * dr + db * db;
        best_mired = mired;
      }
    }
  }
  const double mired = kDaylight + static_cast<double>(params.adaptation) * (best_mired - kDaylight);
  gains = gains_for(raw_of_body(sensor, mired));
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_EXPOSURE_HPP
