// SPDX-License-Identifier: Apache-2.0
// What a night picture looks like in numbers: how bright, how dark below and above, of which colour, how much of it is
// black or saturated, and how strong the noise is at each level. And what real nights have.
//
// Of 8-bit values v, linear as (v / 255)^2.2; Y = .2126 r + .7152 g + .0722 b.
//   mean, road, top   mean Y of all, of the lower 45 % of the rows, of the upper 30 %
//   road_to_top       road / max(top, 1e-9)
//   red_to_green      ratio of the means of linear red and green
//   black, saturated  share of pixels with no channel above 8, with a channel at 255
//   noise[k]          of g = (r + g + b) / 3 between displayed levels kNoiseLevels[k] and kNoiseLevels[k + 1]:
//                     median |L| / (.6745 sqrt(20)) over the flat pixels, L = 4 g - its four neighbours: of white
//                     noise of sigma, L has the standard deviation sqrt(20) sigma, and |L| the median .6745 of it.
//                     Flat: where |dg/dx| + |dg/dy| (central, not halved) is at most its 60th percentile over the
//                     picture; of more than 200 such pixels, else NaN. In 1 / 255.
// Error: sums are of doubles, 1e-10 relative; ranks are exact, since g and L are whole thirds. The same bits for any
// executor: none is taken. Cost: three passes, about 6 ns a pixel. Memory: kNightStatisticsBytes.
#ifndef NPSIM_METRICS_NIGHT_STATISTICS_HPP
#define NPSIM_METRICS_NIGHT_STATISTICS_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr int kNoiseBands = 6;
inline constexpr int kNoiseLevels[kNoiseBands + 1] = {0, 4, 8, 16, 32, 64, 128};

struct NightStatistics {
  double mean = 0;
  double road = 0;
  double top = 0;
  double road_to_top = 0;
  double red_to_green = 0;
  double black = 0;
  double saturated = 0;
  double noise[kNoiseBands] = {};
};

// Measured by these definitions on the real nights, 960x540, of five places that an action camera saw by day and at
// night; of the noise the mean alone.
struct StatisticRange {
  double least;
  double mean;
  double most;
};
struct RealNights {
  StatisticRange mean{.023, .047, .091};
  StatisticRange road{.029, .069, .146};
  StatisticRange top{.013, .020, .032};
  StatisticRange road_to_top{1.1, 3.7, 6.5};
  StatisticRange red_to_green{.99, 1.49, 1.9};
  StatisticRange black{.01, .096, .18};
  StatisticRange saturated{.0011, .0017, .0023};
  double noise[kNoiseBands] = {.64, .60, .69, .97, .99, 1.15};
};
inline constexpr RealNights kRealNights;

namespace metrics_detail {

inline constexpr std::size_t kGradients = 2 * 765 + 1;  // in thirds of a level
inline constexpr std::size_t kLaplacians = 4 * 765 + 1;

// Value whose rank is `rank` in the histogram, counted from 0.
[[nodiscard]] inline std::size_t value_of_rank(Span<const std::uint32_t> histogram, std::uint64_t rank) noexcept {
  std::uint64_t below = 0;
  for (std::size_t v = 0; v < histogram.size(); ++v) {
    below += histogram[v];
    if (below > rank) return v;
  }
  return histogram.size() - 1;
}

// Three times the grey level.
[[nodiscard]] inline int grey3(const Rgb8& c) noexcept { return c.r + c.g + c.b; }

[[nodiscard]] inline std::size_t gradient3(const ImageView<const Rgb8>& p, int x, int y) noexcept {
  const int dx = grey3(p(x + 1, y)) - grey3(p(x - 1, y));
  const int dy = grey3(p(x, y + 1)) - grey3(p(x, y - 1));
  return static_cast<std::size_t>((dx < 0 ? -dx : dx) + (dy < 0 ? -dy : dy));
}

inline void measure_noise(const ImageView<const Rgb8>& p, Span<std::uint32_t> gradients, Span<std::uint32_t> laplacians,
                          double (&noise)[kNoiseBands]) noexcept {
  for (std::uint32_t& n : gradients) n = 0;
  for (std::uint32_t& n : laplacians) n = 0;
  for (int y = 1; y + 1 < p.height(); ++y) {
    for (int x = 1; x + 1 < p.width(); ++x) ++gradients[gradient3(p, x, y)];
  }
  // The percentile lies between two ranks: what is at most it is at most the lower one.
  const std::uint64_t inner = static_cast<std::uint64_t>(p.width() - 2) * static_cast<std::uint64_t>(p.height() - 2);
  const std::size_t flattest = value_of_rank(gradients, 3 * (inner - 1) / 5);
  for (int y = 1; y + 1 < p.height(); ++y) {
    for (int x = 1; x + 1 < p.width(); ++x) {
      const int g = grey3(p(x, y));
      if (g >= 3 * kNoiseLevels[kNoiseBands] || gradient3(p, x, y) > flattest) continue;
      std::size_t band = 0;
      while (g >= 3 * kNoiseLevels[band + 1]) ++band;
      const int l = 4 * g - grey3(p(x - 1, y)) - grey3(p(x + 1, y)) - grey3(p(x, y - 1)) - grey3(p(x, y + 1));
      ++laplacians[band * kLaplacians + static_cast<std::size_t>(l < 0 ? -l : l)];
    }
  }
  for (std::size_t k = 0; k < kNoiseBands; ++k) {
    const Span<const std::uint32_t> band = laplacians.sub(k * kLaplacians, kLaplacians);
    std::uint64_t n = 0;
    for (const std::uint32_t count : band) n += count;
    noise[k] = std::numeric_limits<double>::quiet_NaN();
    if (n <= 200) continue;
    const auto middle = static_cast<double>(value_of_rank(band, (n - 1) / 2) + value_of_rank(band, n / 2)) / 6.0;
    noise[k] = middle / (0.6745 * std::sqrt(20.0));
  }
}

}  // namespace metrics_detail

inline constexpr std::size_t kNightStatisticsBytes =
    kWorkspaceAlignment + allocation_bytes<std::uint32_t>(metrics_detail::kGradients) +
    allocation_bytes<std::uint32_t>(kNoiseBands * metrics_detail::kLaplacians);

// picture: sRGB as cameras store it, at least 4x4 pixels. A picture without green has no red_to_green: NaN.
[[nodiscard]] inline Status night_statistics(ImageView<const Rgb8> picture, NightStatistics& out,
                                             Workspace& workspace) noexcept {
  if (picture.empty() || picture.width() < 4 || picture.height() < 4) {
    return {StatusCode::no_valid_input, "night_statistics: a picture of at least 4x4 pixels"};
  }
  const WorkspaceScope scope(workspace);
  Span<std::uint32_t> gradients;
  Span<std::uint32_t> laplacians;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(metrics_detail::kGradients, gradients));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(kNoiseBands * metrics_detail::kLaplacians, laplacians));

  double linear[256];
  for (int v = 0; v < 256; ++v) linear[v] = std::pow(v / 255.0, 2.2);
  const int road_from = static_cast<int>(picture.height() * 0.55);
  const int top_to = static_cast<int>(picture.height() * 0.30);
  double all = 0, road = 0, top = 0, red = 0, green = 0;
  std::uint64_t black = 0;
  std::uint64_t saturated = 0;
  for (int y = 0; y < picture.height(); ++y) {
    double row = 0, row_red = 0, row_green = 0;
    for (int x = 0; x < picture.width(); ++x) {
      const Rgb8 c = picture(x, y);
      row += 0.2126 * linear[c.r] + 0.7152 * linear[c.g] + 0.0722 * linear[c.b];
      row_red += linear[c.r];
      row_green += linear[c.g];
      const std::uint8_t most = max_of(c.r, c.g, c.b);
      black += most <= 8 ? 1U : 0U;
      saturated += most == 255 ? 1U : 0U;
    }
    all += row;
    red += row_red;
    green += row_green;
    if (y >= road_from) road += row;
    if (y < top_to) top += row;
  }
  const auto pixels = static_cast<double>(picture.shape().pixels());
  const double width = picture.width();
  out.mean = all / pixels;
  out.road = road / (width * (picture.height() - road_from));
  out.top = top / (width * top_to);
  out.road_to_top = out.road / (out.top > 1e-9 ? out.top : 1e-9);
  out.red_to_green = green > 0 ? red / green : std::numeric_limits<double>::quiet_NaN();
  out.black = static_cast<double>(black) / pixels;
  out.saturated = static_cast<double>(saturated) / pixels;
  metrics_detail::measure_noise(picture, gradients, laplacians, out.noise);
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_METRICS_NIGHT_STATISTICS_HPP
