// SPDX-License-Identifier: Apache-2.0
// One surface in two lights: how luminance and colour of a kind of ground fall into sun and shadow.
//
// Of a surface of one material and one normal, what the sun reaches and what only the sky lights differ by one factor
// per channel: log2 of luminance by `drop`, log2(blue / red) by `bluer`, since the sky is bluer than the sun. So the
// pixels are a mixture of tied Gaussians: sunlit, shadow, and paint kPaintStep above each, with common spreads, fitted
// by expectation and maximisation to their histogram from a grid of starts. What is dark without being bluer (a wet
// patch, new asphalt) is no shadow, nor is what is bluer than a low sun and a clear sky make it (asphalt beside yellow
// paint).
// Cost: starts x rounds x cells that are not empty. Serial, so the same bits always.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_LIGHT_MIXTURE_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_LIGHT_MIXTURE_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/material/detail/daylight/planes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

struct LightMixtureParams {
  float paint_step = 2.0F;   // log2 of white paint over asphalt
  float max_paint = 0.06F;   // of the pixels
  float min_drop = 0.7F;     // log2: the sun gives at least 1.6 times what the sky does
  float min_bluer = 0.08F;   // log2(blue / red)
  float max_bluer = 1.4F;    // of the drop: a sun of 3000 K under a sky of 15000 K. What is yellower is paint
  float min_shade = 0.005F;  // of the pixels
  float min_sunlit = 0.02F;  // of the pixels. Less is told from what is left of paint by nothing
  float min_gain = 1.0F;     // bits that two lights save over one, for each pixel of the rarer light
  float min_sigma_y = 0.2F, max_sigma_y = 0.6F;
  float min_sigma_c = 0.05F, max_sigma_c = 0.25F;
};

struct LightMixture {
  float sun_y = 0.0F, sun_c = 0.0F;  // log2
  float drop = 0.0F, bluer = 0.0F;
  float sigma_y = 0.4F, sigma_c = 0.15F;
  float sunlit = 1.0F;  // share of the pixels
  float paint = 0.02F;
  float fit = -1e30F;   // mean log likelihood, bits
  bool shadow = false;  // the gates are passed
  bool known = false;   // there are enough pixels of this kind
};

// Cells of the histogram: 1/16 of a binary order.
inline constexpr int kCellsPerOctave = 16;
inline constexpr int kCellsY = 14 * kCellsPerOctave;  // from 2^-13
inline constexpr int kCellsC = 6 * kCellsPerOctave;   // from 2^-3
inline constexpr float kFirstY = -13.0F;
inline constexpr float kFirstC = -3.0F;

struct LightCell {
  float y, c, count;
};

// The histogram of pixels for which `inside` holds, as a list of the cells that are not empty.
template <class Inside>
std::size_t light_cells(const Inside& inside, ImageView<const float> log_y, ImageView<const float> colour,
                        Span<std::uint32_t> histogram, Span<LightCell> cells) {
  for (std::uint32_t& h : histogram) h = 0;
  const auto cell = [](float v, float first, int cells_of) {
    return static_cast<std::size_t>(
        clamp_to((v - first) * static_cast<float>(kCellsPerOctave), 0.0F, static_cast<float>(cells_of - 1)));
  };
  for (int y = 0; y < log_y.height(); ++y) {
    for (int x = 0; x < log_y.width(); ++x) {
      if (!inside(x, y)) continue;
      ++histogram[cell(log_y(x, y), kFirstY, kCellsY) * static_cast<std::size_t>(kCellsC) +
                  cell(colour(x, y), kFirstC, kCellsC)];
    }
  }
  std::size_t n = 0;
  for (std::size_t i = 0; i < histogram.size(); ++i) {
    if (histogram[i] == 0) continue;
    const auto row = static_cast<float>(i / static_cast<std::size_t>(kCellsC));
    const auto column = static_cast<float>(i % static_cast<std::size_t>(kCellsC));
    cells[n++] = {kFirstY + (row + 0.5F) / static_cast<float>(kCellsPerOctave),
                  kFirstC + (column + 0.5F) / static_cast<float>(kCellsPerOctave), static_cast<float>(histogram[i])};
  }
  return n;
}

// Densities of the four components at one cell, times their weights.
struct Likelihood {
  float sun, shadow, sun_paint, shadow_paint;
  float outlier;
};

// paint_c: how much the colours of paint differ besides.
[[nodiscard]] inline Likelihood likelihood(const LightMixtureParams& p, const LightMixture& m, float y, float c,
                                           float paint_c = 0.0F) noexcept {
  const auto density_of = [&](float dy, float dc, float sigma_c) {
    const float a = dy / m.sigma_y;
    const float b = dc / sigma_c;
    return exp2_of(-0.5F * kLog2E * (a * a + b * b)) / (6.2831853F * m.sigma_y * sigma_c);
  };
  const auto density = [&](float dy, float dc) { return density_of(dy, dc, m.sigma_c); };
  const auto density_of_paint = [&](float dy, float dc) { return density_of(dy, dc, m.sigma_c + paint_c); };
  const float dy = y - m.sun_y;
  const float dc = c - m.sun_c;
  const float shade = 1.0F - m.sunlit;
  constexpr float kOutliers = 0.01F;
  constexpr float kOutlierDensity = kOutliers / 40.0F;  // even over 10 x 4
  const float plain = (1.0F - kOutliers) * (1.0F - m.paint);
  const float painted = (1.0F - kOutliers) * m.paint;
  return {plain * m.sunlit * density(dy, dc), plain * shade * density(dy + m.drop, dc - m.bluer),
          painted * m.sunlit * density_of_paint(dy - p.paint_step, dc),
          painted * shade * density_of_paint(dy + m.drop - p.paint_step, dc - m.bluer), kOutlierDensity};
}

// One round of expectation and maximisation. hold_light: drop and bluer stay.
inline void improve(const LightMixtureParams& p, Span<const LightCell> cells, bool hold_light, LightMixture& m) {
  double n = 0, fit = 0;
  double w[4] = {}, sum_y[4] = {}, sum_c[4] = {};
  double square_y = 0, square_c = 0;
  for (const LightCell& cell : cells) {
    const Likelihood l = likelihood(p, m, cell.y, cell.c);
    const float parts[4] = {l.sun, l.shadow, l.sun_paint, l.shadow_paint};
    const float all = l.sun + l.shadow + l.sun_paint + l.shadow_paint + l.outlier;
    n += static_cast<double>(cell.count);
    fit += static_cast<double>(cell.count * log2_of(all));
    for (int k = 0; k < 4; ++k) {
      const double r = static_cast<double>(cell.count * parts[k] / all);
      const double dy =
          static_cast<double>(cell.y - m.sun_y + (k % 2 == 1 ? m.drop : 0.0F) - (k >= 2 ? p.paint_step : 0.0F));
      const double dc = static_cast<double>(cell.c - m.sun_c - (k % 2 == 1 ? m.bluer : 0.0F));
      w[k] += r;
      sum_y[k] += r * dy;
      sum_c[k] += r * dc;
      square_y += r * dy * dy;
      square_c += r * dc * dc;
    }
  }
  const double sun = w[0] + w[2];
  const double shade = w[1] + w[3];
  const double all = sun + shade;
  m.fit = static_cast<float>(fit / std::max(n, 1.0));
  if (!(all > 1.0)) return;
  double move_sun_y = sun > 1e-3 ? (sum_y[0] + sum_y[2]) / sun : 0.0;
  double move_sun_c = sun > 1e-3 ? (sum_c[0] + sum_c[2]) / sun : 0.0;
  double move_shade_y = shade > 1e-3 ? (sum_y[1] + sum_y[3]) / shade : 0.0;
  double move_shade_c = shade > 1e-3 ? (sum_c[1] + sum_c[3]) / shade : 0.0;
  if (hold_light) {
    move_sun_y = move_shade_y = (sum_y[0] + sum_y[1] + sum_y[2] + sum_y[3]) / all;
    move_sun_c = move_shade_c = (sum_c[0] + sum_c[1] + sum_c[2] + sum_c[3]) / all;
  }
  // Spreads about the moved means.
  const double var_y = (square_y - sun * move_sun_y * move_sun_y - shade * move_shade_y * move_shade_y) / all;
  const double var_c = (square_c - sun * move_sun_c * move_sun_c - shade * move_shade_c * move_shade_c) / all;
  m.sun_y += static_cast<float>(move_sun_y);
  m.sun_c += static_cast<float>(move_sun_c);
  m.drop -= static_cast<float>(move_shade_y - move_sun_y);
  m.bluer += static_cast<float>(move_shade_c - move_sun_c);
  m.sigma_y = clamp_to(std::sqrt(static_cast<float>(std::max(var_y, 0.0))), p.min_sigma_y, p.max_sigma_y);
  m.sigma_c = clamp_to(std::sqrt(static_cast<float>(std::max(var_c, 0.0))), p.min_sigma_c, p.max_sigma_c);
  m.sunlit = clamp_to(static_cast<float>(sun / all), 1e-3F, 1.0F - 1e-3F);
  m.paint = clamp_to(static_cast<float>((w[2] + w[3]) / all), 1e-4F, p.max_paint);
}

// All in one light: the same model with nothing in shadow.
[[nodiscard]] inline LightMixture single_light(const LightMixtureParams& p, Span<const LightCell> cells, float middle_y,
                                               float middle_c) {
  LightMixture m;
  m.sun_y = middle_y;
  m.sun_c = middle_c;
  m.drop = 30.0F;
  m.sunlit = 1.0F - 1e-3F;
  for (int i = 0; i < 30; ++i) {
    improve(p, cells, false, m);
    m.drop = 30.0F;
  }
  return m;
}

[[nodiscard]] inline LightMixture best_mixture(const LightMixtureParams& p, Span<const LightCell> cells, float low_y,
                                               float middle_y, float high_y, float low_c, float middle_c) {
  constexpr int kRounds = 30;
  struct Colours {
    float sun, bluer;
  };
  // Where most of the ground lies in the shadow, the sun's colour is among the least blue.
  const Colours colours[] = {{middle_c - 0.05F, 0.1F}, {middle_c - 0.2F, 0.4F}, {low_c, 1.0F}};
  LightMixture best;
  for (const float sun_y : {low_y, middle_y, high_y}) {
    for (const float drop : {1.0F, 1.8F, 2.8F, 4.0F}) {
      for (const Colours& c : colours) {
        LightMixture m;
        m.sun_y = sun_y;
        m.sun_c = c.sun;
        m.drop = drop;
        m.bluer = c.bluer;
        m.sunlit = 0.5F;
        for (int i = 0; i < kRounds; ++i) improve(p, cells, false, m);
        m.shadow = m.drop >= p.min_drop && m.bluer >= p.min_bluer && m.bluer <= p.max_bluer * m.drop &&
                   m.sunlit >= p.min_sunlit && 1.0F - m.sunlit >= p.min_shade;
        if (m.shadow != best.shadow ? m.shadow : m.fit > best.fit) best = m;
      }
    }
  }
  const float gain = best.fit - single_light(p, cells, middle_y, middle_c).fit;
  if (gain < p.min_gain * std::min(best.sunlit, 1.0F - best.sunlit)) best.shadow = false;
  return best;
}

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_LIGHT_MIXTURE_HPP
