// SPDX-License-Identifier: Apache-2.0
// Drops points of a laser that the camera cannot see, in scenes without labels.
//
// A scanner stands higher than the camera or beside it and looks past what hides a wall or a road from the camera. Such
// points project into the picture of the near thing: its roof and its sides are torn by the depth of what lies behind.
// Hidden is a point with nearer ones, by kHiddenFarther of its depth, to its left and right and above and below it,
// within hidden_reach_px(), of which the nearest each way are of one surface: within kHiddenSurface of one another. At
// the outline of a thing, and beside a pole, one way is free. What is seen through a fence whose bars are closer than
// that is dropped as well. Where a quarter of the picture or more is measured sweeps were put together, from which
// whoever did that has taken such points. Labels know borders better (measured/border_spill.hpp).
// Cost: a window of twice hidden_reach_px() for each measured pixel. Memory: none.
#ifndef NPSIM_DEPTH_DETAIL_MEASURED_HIDDEN_POINTS_HPP
#define NPSIM_DEPTH_DETAIL_MEASURED_HIDDEN_POINTS_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/window_filter.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

inline constexpr float kHiddenFarther = 1.08F;  // of a hidden point's depth, over that of what hides it
inline constexpr float kHiddenSurface = 1.06F;  // of the farthest of what hides it, over the nearest
inline constexpr std::size_t kOneSweep = 4;

// depth(x, y): measured.
[[nodiscard]] inline bool is_hidden(ImageView<const float> depth, int reach, int x, int y) noexcept {
  constexpr int kNone = std::numeric_limits<int>::max();
  const float near_m = depth(x, y) / kHiddenFarther;
  std::array<int, 4> closest{kNone, kNone, kNone, kNone};  // squared, in px: left, right, above, below
  std::array<float, 4> z{};
  for (int v = std::max(0, y - reach); v <= std::min(depth.height() - 1, y + reach); ++v) {
    for (int u = std::max(0, x - reach); u <= std::min(depth.width() - 1, x + reach); ++u) {
      const float other = depth(u, v);
      if (!is_valid_depth(other) || !(other < near_m)) continue;
      const int dx = u - x;
      const int dy = v - y;
      const std::size_t way = dx * dx >= dy * dy ? (dx < 0 ? 0U : 1U) : (dy < 0 ? 2U : 3U);
      const int apart = dx * dx + dy * dy;
      if (apart > reach * reach || apart >= closest[way]) continue;
      closest[way] = apart;
      z[way] = other;
    }
  }
  const auto [least, most] = std::minmax_element(z.begin(), z.end());
  return *least > 0.0F && *most <= kHiddenSurface * *least;
}

// A 120th of the width, or farther where points are: of a scanner of 32 lines these lie 20 to 30 px apart, and the next
// line has to be within reach. It is where lines lie up to six times as far apart as the points in them; where they lie
// farther less is found. The mean is that of the rows from the first to the last with a point, so a stray point far
// above the others makes the window somewhat larger. 0: sweeps were put together, or nothing is measured.
[[nodiscard]] inline int hidden_reach_px(ImageView<const float> depth) noexcept {
  constexpr float kApart = 2.4F;  // mean distances of points: that of a scanner of 64 lines is a 300th of the width
  constexpr int kMost = 30;       // of the width
  std::size_t count = 0;
  int first = depth.height();
  int last = 0;
  for (int y = 0; y < depth.height(); ++y) {
    const std::size_t before = count;
    for (int x = 0; x < depth.width(); ++x) count += is_valid_depth(depth(x, y)) ? 1U : 0U;
    if (count == before) continue;
    first = std::min(first, y);
    last = y;
  }
  if (count == 0 || kOneSweep * count >= depth.shape().pixels()) return 0;
  const float area = static_cast<float>(depth.width()) * static_cast<float>(last - first + 1);
  const int by_points = static_cast<int>(kApart * std::sqrt(area / static_cast<float>(count)) + 0.5F);
  return std::max(2, std::max(depth.width() / 120, std::min(by_points, depth.width() / kMost)));
}

// measured: the shape of depth, and other memory; what is hidden becomes 0. reach: hidden_reach_px().
template <class Executor>
void drop_hidden_points(ImageView<const float> depth, int reach, ImageView<float> measured,
                        Executor& executor) noexcept {
  if (reach == 0) return;
  for_pixels(depth.shape(), executor, [&](int x, int y) {
    if (is_valid_depth(depth(x, y)) && is_hidden(depth, reach, x, y)) measured(x, y) = 0.0F;
  });
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_MEASURED_HIDDEN_POINTS_HPP
