// SPDX-License-Identifier: Apache-2.0
// A camera's image signal processor: from a raw picture to one that is shown.
//
//   gains -> demosaic -> highlights -> colour matrix -> gamut -> tone curve -> chroma sampling -> sRGB in 8 bits
// Highlights: what is clipped in one filter has lost its hue: a red lamp three times over full scale has the raw
// colours of an amber one. Between `pale_from` and .9 of full scale the brightest channel m draws the others to itself:
// c <- c + pale t^2 (3 - 2 t) (m - c), so lamps keep a ring of their colour about a pale core, and no lamp shows
// another's hue. Neighbours of a clipped sample count as partly clipped: their channels come from either side of an
// edge.
// Colour matrix: the inverse of the sensor's response for daylight, with chroma about luminance times `saturation`
// (cameras show colours stronger than they are). Gamut: a colour with a negative channel moves towards the grey of
// its luminance until that channel is 0. Shadows: cameras withdraw colour where it is noise, here by
// n / (n + colourless).
// Tone curve, on the largest channel n of the three, which all are scaled by, so hue and chroma stay:
//   clip    y = n
//   filmic  z = W n, then the toe  z <- z^2 (1 + toe / W) / (z + toe), then above the knee y = knee (1 + ln(z / knee)),
//           which leaves the straight part with its slope and arrives at 1 at n = 1, W = knee exp(1 / knee - 1). Below,
//           y = W n (1 + toe / W) - toe + O(toe^2 / n). So lamps and lit signs up to W times as bright as what the
//           straight part would show as white are told apart (headroom()).
//   log     y = ln(1 + a n) / ln(1 + a), n = 1 at the end of the range: for several exposures
// By `local` the curve follows the light of each place (sensor/detail/local_tone.hpp).
// Black: what the curve shows of no light at all is `black_cast`, added to everything: cameras take a little less than
// their black level away, which white balance multiplies in red and blue.
// Chroma sampling: video keeps luma for every pixel and chroma for 2x2 of them (4:2:0), by which the coloured fringes
// that a mosaic leaves at edges go. On the square roots of the linear values: red - Y and blue - Y become the means of
// their quad, Y = .2126 red + .7152 green + .0722 blue stays.
// Then sRGB and rounding to one of 256 levels, within .54 of a level.
// Cost: 6 to 8 ns per pixel, demosaic included (AVX-512, AVX2). Memory: 6 KiB of stack, and what `local` takes.
#ifndef NPSIM_SENSOR_ISP_HPP
#define NPSIM_SENSOR_ISP_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/color/chromaticity.hpp"
#include "npsim/color/srgb.hpp"
#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/sensor/detail/demosaic.hpp"
#include "npsim/sensor/detail/local_tone.hpp"
#include "npsim/sensor/detail/signal.hpp"
#include "npsim/sensor/raw.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

enum class ToneKind : std::uint8_t { clip, filmic, log };

// How often the picture's colour is kept: for every pixel, or for 2x2 of them.
enum class ChromaSampling : std::uint8_t { yuv444, yuv420 };

struct ToneCurve {
  ToneKind kind = ToneKind::filmic;
  float toe = 0.0F;     // how much the straight part is lowered; [0, .1]
  float knee = 0.25F;   // displayed level where the shoulder begins; [.2, 1]: 11 times to once white
  float lift = 100.0F;  // a of the log curve; (0, 1e6]
};

struct IspParams {
  Vec3f gains{1.0F, 1.0F, 1.0F};  // of white balance
  Demosaic demosaic = Demosaic::gradient;
  float pale_from = 0.4F;   // of full scale
  float pale = 0.92F;       // share of its chroma that a clipped pixel loses
  float saturation = 1.2F;  // 1: as the scene is
  ChromaSampling chroma = ChromaSampling::yuv420;
  float colourless = 0.0F;  // share of full scale at which half of the colour is withdrawn: that of the noise in black
  ToneCurve tone;
  LocalToneParams local;
  Vec3f black_cast;  // displayed linear light of black; [0, .1]
};

[[nodiscard]] inline Status validate(const ToneCurve& c) noexcept {
  const bool good =
      c.toe >= 0.0F && c.toe <= 0.1F && c.knee >= 0.2F && c.knee <= 1.0F && c.lift > 0.0F && c.lift <= 1e6F;
  return good ? Status()
              : Status(StatusCode::invalid_argument, "tone curve: toe in [0, .1], knee in [.2, 1], lift in (0, 1e6]");
}

[[nodiscard]] inline Status validate(const IspParams& p) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(p.tone));
  NPSIM_RETURN_IF_ERROR(validate(p.local));
  const auto within = [](float v, float high) noexcept { return v >= 0.0F && v <= high; };
  if (within(p.gains.x, 64.0F) && within(p.gains.y, 64.0F) && within(p.gains.z, 64.0F) && within(p.pale_from, 0.89F) &&
      within(p.pale, 1.0F) && within(p.saturation, 4.0F) && within(p.colourless, 1.0F) &&
      within(p.black_cast.x, 0.1F) && within(p.black_cast.y, 0.1F) && within(p.black_cast.z, 0.1F)) {
    return {};
  }
  return {StatusCode::invalid_argument,
          "ISP: gains in [0, 64], pale_from in [0, .89], pale in [0, 1], saturation in [0, 4], colourless in [0, 1], "
          "black_cast in [0, .1]"};
}

// How many times brighter than white by the straight part of the curve, which shows light as it is, full scale is.
[[nodiscard]] inline float headroom(const ToneCurve& curve) noexcept {
  if (curve.kind != ToneKind::filmic) return 1.0F;
  return max_of(1.0F, curve.knee * simd::exp(simd::scalar::F32(1.0F / curve.knee - 1.0F)).value);
}

// Displayed linear value of the largest channel; 0 to 0, 1 to 1 and monotonic, within a rounding of 2^-23.
// room: headroom(curve).
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE F tone_map(const ToneCurve& curve, float room, F x) noexcept {
  const F c = simd::clamp(x, 0.0F, 1.0F);
  if (curve.kind == ToneKind::clip) return c;
  if (curve.kind == ToneKind::log) {
    return simd::log(fma(c, F(curve.lift), F(1.0F))) * (F(1.0F) / simd::log(F(1.0F + curve.lift)));
  }
  F z = c * F(room);
  if (curve.toe > 0.0F) z = z * z * F(1.0F + curve.toe / room) / (z + F(curve.toe));
  if (none(z > F(curve.knee))) return z;  // most of a night
  const F shoulder = fma(simd::log(max(z, F(curve.knee)) * F(1.0F / curve.knee)), F(curve.knee), F(curve.knee));
  return select(z > F(curve.knee), min(shoulder, F(1.0F)), z);
}

[[nodiscard]] inline float tone_map(const ToneCurve& curve, float x) noexcept {
  return tone_map(curve, headroom(curve), simd::scalar::F32(x)).value;
}

namespace isp_detail {

// Rows of: linear sRGB from raw channels of which daylight's are equal, chroma times `saturation`.
struct ColourMatrix {
  Vec3f row[3];
};

[[nodiscard]] inline ColourMatrix colour_matrix(const SensorParams& sensor, float saturation) noexcept {
  Matrix3d response;
  for (int i = 0; i < 3; ++i) {
    const Vec3d row = vec_cast<double>(sensor.response[i]);
    const double daylight = row.x + row.y + row.z;
    response.m[i][0] = row.x / daylight;
    response.m[i][1] = row.y / daylight;
    response.m[i][2] = row.z / daylight;
  }
  const Matrix3d to_srgb = color_detail::inverse(response);
  const double weight[3] = {0.2126, 0.7152, 0.0722};
  const auto s = static_cast<double>(saturation);
  ColourMatrix out;
  for (int i = 0; i < 3; ++i) {
    double row[3] = {};
    for (int j = 0; j < 3; ++j) {
      const double grey = weight[0] * to_srgb.m[0][j] + weight[1] * to_srgb.m[1][j] + weight[2] * to_srgb.m[2][j];
      row[j] = s * to_srgb.m[i][j] + (1.0 - s) * grey;
    }
    out.row[i] = vec_cast<float>(Vec3d{row[0], row[1], row[2]});
  }
  return out;
}

template <class F>
using Rgb = simd::F32x3<F>;

inline constexpr float kPale = 0.9F;  // of full scale; noise leaves some clipped samples below 1

// Linear sRGB of white-balanced raw channels, 1 = full scale; brightest: the largest channel. peak: largest sample
// thereabouts.
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE Rgb<F> coloured(const IspParams& params, const ColourMatrix& matrix,
                                                  const Rgb<F>& raw, F peak, F& brightest) noexcept {
  const F r = simd::clamp(raw.x, 0.0F, 1.0F);
  const F g = simd::clamp(raw.y, 0.0F, 1.0F);
  const F b = simd::clamp(raw.z, 0.0F, 1.0F);
  brightest = max(r, max(g, b));
  const F t =
      simd::clamp((max(brightest, peak) - F(params.pale_from)) * F(1.0F / (kPale - params.pale_from)), 0.0F, 1.0F);
  const F paleness = F(params.pale) * t * t * (F(3.0F) - t - t);
  const auto channel = [&](const Vec3f& row) {
    const F c = fma(r, F(row.x), fma(g, F(row.y), b * F(row.z)));
    return fma(paleness, brightest - c, c);
  };
  return {channel(matrix.row[0]), channel(matrix.row[1]), channel(matrix.row[2])};
}

// Displayed linear sRGB of what coloured() returns. displayed: the tone curve, of the largest channel.
template <class F, class Tone>
[[nodiscard]] NPSIM_ALWAYS_INLINE Rgb<F> rendered(const IspParams& params, const Rgb<F>& c, F brightest,
                                                  const Tone& displayed) noexcept {
  // Into the gamut, along the line to the grey of the same luminance.
  const F least = min(c.x, min(c.y, c.z));
  const F grey = max(fma(c.x, F(0.2126F), fma(c.y, F(0.7152F), c.z * F(0.0722F))), F(0.0F));
  const F in_gamut = select(least < F(0.0F), grey / (grey - least), F(1.0F));
  const F kept = in_gamut * (brightest / (brightest + F(params.colourless + 1e-9F)));
  const F largest = max(c.x, max(c.y, c.z));
  const F safe = max(fma(largest - grey, kept, grey), F(1e-9F));
  const F scale = displayed(safe) / safe;
  const auto shown = [&](F v) { return max(fma(v - grey, kept, grey), F(0.0F)) * scale; };
  return {shown(c.x), shown(c.y), shown(c.z)};
}

// The sRGB code, not rounded, of a linear value whose square root is v in [0, 1]: within .04. The polynomial is the
// minimax one of degree 6 of 255 (1.055 v^(5/6) - .055).
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE F srgb_code_of_root(F v) noexcept {
  static constexpr float kCode[] = {-10.769152F, 401.69412F, -484.36647F, 994.1013F,
                                    -1275.8043F, 871.76115F, -241.65468F};
  return select(v < F(0.055953F), v * v * F(255.0F * 12.92F), simd::math_detail::polynomial(v, kCode));
}

// Pixels that pass through the steps together: each step is a loop of its own, whose numbers fit the registers.
inline constexpr int kIspSegment = 128;
struct IspSegment {
  alignas(64) float x[kIspSegment];
  alignas(64) float y[kIspSegment];
  alignas(64) float z[kIspSegment];
  alignas(64) float peak[kIspSegment];
};
static_assert(kIspSegment % simd::kMaxLanes == 0 && kIspSegment <= kMostLines);

// Luma of BT.709.
inline constexpr float kLumaRed = 0.2126F;
inline constexpr float kLumaGreen = 0.7152F;
inline constexpr float kLumaBlue = 0.0722F;

// Codes of n pixels as develop_segment() leaves them.
template <class F>
void write_codes(const IspSegment& s, int n, Rgb8* to) noexcept {
  using I = typename F::Int;
  alignas(64) std::int32_t codes[kIspSegment];  // red in the lowest byte
  for (int i = 0; i < n; i += F::lanes) {
    const F luma = F::load(s.y + i);
    const F red = F::load(s.x + i);
    const F blue = F::load(s.z + i);
    const F green = fma(red, F(-kLumaRed / kLumaGreen), blue * F(-kLumaBlue / kLumaGreen));
    // Added to 2^23 a float is rounded to a whole number, which its lowest bits hold; the exponent is shifted out.
    const auto code = [luma](F chroma) {
      return bitcast_int(srgb_code_of_root(simd::clamp(luma + chroma, 0.0F, 1.0F)) + F(0x1p23F));
    };
    ((code(red) & I(0xFF)) | (code(green) << 8) | (code(blue) << 16)).store(codes + i);
  }
  for (int i = 0; i < n; ++i) {
    const auto rgb = static_cast<std::uint32_t>(codes[i]);
    to[i] = {static_cast<std::uint8_t>(rgb), static_cast<std::uint8_t>(rgb >> 8U),
             static_cast<std::uint8_t>(rgb >> 16U)};
  }
}

// One chroma of the n pixels of two rows becomes the mean of each quad, which begin at even pixels; n >= 1.
inline void share_chroma(float* upper, float* lower, int n) noexcept {
  if (n % 2 != 0) {  // an odd column stands for its neighbour
    upper[n] = upper[n - 1];
    lower[n] = lower[n - 1];
  }
  for (int i = 0; i < n; i += 2) {
    const float mean = ((upper[i] + lower[i]) + (upper[i + 1] + lower[i + 1])) * 0.25F;
    upper[i] = upper[i + 1] = lower[i] = lower[i + 1] = mean;
  }
}

// Of the square roots v of displayed linear values: luma Y in s.y, red - Y in s.x and blue - Y in s.z. The pixels begin
// .. begin + count - 1 of row y.
template <class F>
void develop_segment(const IspParams& params, const ColourMatrix& matrix, Mosaic mosaic, ImageView<const float> plane,
                     const ToneLines& lines, int begin, int y, int count, IspSegment& s) noexcept {
  const auto keep = [&s](int i, const Rgb<F>& c, F peak) {
    c.x.store(s.x + i);
    c.y.store(s.y + i);
    c.z.store(s.z + i);
    peak.store(s.peak + i);
  };
  const MosaicRows rows = mosaic_rows(plane, y);
  for (int i = 0; i < count; i += F::lanes) {
    const int n = count - i < F::lanes ? count - i : F::lanes;
    const DemosaicedPixels<F> raw = demosaic<F>(params.demosaic, mosaic, rows, begin + i, y, n);
    keep(i, raw.rgb, raw.peak);
  }
  const auto channels = [&s](int i) { return Rgb<F>{F::load(s.x + i), F::load(s.y + i), F::load(s.z + i)}; };
  for (int i = 0; i < count; i += F::lanes) {
    F brightest;
    const Rgb<F> c = coloured<F>(params, matrix, channels(i), F::load(s.peak + i), brightest);
    keep(i, c, brightest);
  }
  const auto shown = [&](int i, const auto& tone) {
    const Rgb<F> c = rendered<F>(params, channels(i), F::load(s.peak + i), tone);
    const F red = sqrt(min(c.x + F(params.black_cast.x), F(1.0F)));
    const F green = sqrt(min(c.y + F(params.black_cast.y), F(1.0F)));
    const F blue = sqrt(min(c.z + F(params.black_cast.z), F(1.0F)));
    const F luma = fma(red, F(kLumaRed), fma(green, F(kLumaGreen), blue * F(kLumaBlue)));
    (red - luma).store(s.x + i);
    luma.store(s.y + i);
    (blue - luma).store(s.z + i);
  };
  const float room = headroom(params.tone);
  if (lines.slope.empty()) {
    for (int i = 0; i < count; i += F::lanes) shown(i, [&](F n) { return tone_map(params.tone, room, n); });
    return;
  }
  alignas(64) float slope[kIspSegment] = {};
  alignas(64) float offset[kIspSegment] = {};
  lines_of_pixels(lines, begin, y, count, slope, offset);
  for (int i = 0; i < count; i += F::lanes) {
    shown(i, [&](F n) {
      const F c = max(local_light(params.local, n, F::load(slope + i), F::load(offset + i)), F(1e-9F));
      return below_white(n * tone_map(params.tone, room, c) / c, tone_map(params.tone, room, n));
    });
  }
}

}  // namespace isp_detail

[[nodiscard]] constexpr std::size_t develop_workspace_bytes(const IspParams& params, Shape shape) noexcept {
  return tone_lines_bytes(params.local, shape) + tone_lines_workspace_bytes(params.local, shape);
}

// Of a raw picture as capture() makes it; the plane is multiplied by the gains and clipped.
template <class Executor>
[[nodiscard]] Status develop(const IspParams& params, const SensorParams& sensor, ImageView<float> plane,
                             ImageView<Rgb8> out, Workspace& workspace, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(sensor));
  if (out.empty()) return {StatusCode::no_valid_input, "ISP: needs a picture of at least one pixel"};
  if (plane.empty() || plane.shape() != mosaic_shape(out.shape())) {
    return {StatusCode::shape_mismatch, "ISP: the plane must have the picture's size and its margins"};
  }
  using F = simd::F32;
  const float full = 1.0F / raw_range(sensor);
  const float gains[3] = {params.gains.x * full, params.gains.y * full, params.gains.z * full};
  for_rows(executor, plane.height(), [&](int y) {
    float gain[simd::kMaxLanes + 1];
    for (int i = 0; i <= simd::kMaxLanes; ++i) gain[i] = gains[filter_at(sensor.mosaic, i + kMosaicMargin, y)];
    float* row = plane.row(y);
    for (int x = 0; x < plane.width(); x += F::lanes) {
      const int n = plane.width() - x < F::lanes ? plane.width() - x : F::lanes;
      store_first(min(load_first<F>(row + x, n) * F::load(gain + (x & 1)), F(1.0F)), row + x, n);
    }
  });
  const WorkspaceScope scope(workspace);
  ToneLines lines;
  if (is_local(params.local)) {
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(tone_cells(out.shape()), lines.slope));
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(tone_cells(out.shape()), lines.offset));
    NPSIM_RETURN_IF_ERROR(tone_lines(params.local, sensor.mosaic, out.shape(), plane, lines, workspace, executor));
  }
  const isp_detail::ColourMatrix matrix = isp_detail::colour_matrix(sensor, params.saturation);
  for_rows(executor, (out.height() + 1) / 2, [&](int pair) {
    isp_detail::IspSegment rows[2] = {};
    const int count = 2 * pair + 1 < out.height() ? 2 : 1;
    for (int begin = 0; begin < out.width(); begin += isp_detail::kIspSegment) {
      const int n = out.width() - begin < isp_detail::kIspSegment ? out.width() - begin : isp_detail::kIspSegment;
      for (int i = 0; i < count; ++i) {
        isp_detail::develop_segment<F>(params, matrix, sensor.mosaic, plane, lines, begin, 2 * pair + i, n, rows[i]);
      }
      if (count == 1) rows[1] = rows[0];
      if (params.chroma == ChromaSampling::yuv420) {
        isp_detail::share_chroma(rows[0].x, rows[1].x, n);
        isp_detail::share_chroma(rows[0].z, rows[1].z, n);
      }
      for (int i = 0; i < count; ++i) isp_detail::write_codes<F>(rows[i], n, out.row(2 * pair + i) + begin);
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_ISP_HPP
