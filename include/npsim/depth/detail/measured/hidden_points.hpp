// SPDX-License-Identifier: Apache-2.0
// Drops points of a laser that the camera cannot see, in scenes without labels.
//
// A scanner stands higher than the camera or beside it and looks past what hides a wall or a road from the camera. Such
// points project into the picture of the near thing: its roof and its sides are torn by the depth of what lies behind.
// Hidden is a point with nearer ones, by kHiddenFarther of its depth, to its left and right and above and below it,
// within a 120th of the width, of which the nearest each way are of one surface: within kHiddenSurface of one another.
// At the outline of a thing, and beside a pole, one way is free. What is seen through a fence whose bars are closer
// than that is dropped as well. Where a quarter of the picture or more is measured sweeps were put together, from which
// whoever did that has taken such points. Labels know borders better (measured/border_spill.hpp).
// Cost: a window of a 60th of the width for each measured pixel. Memory: none.
#ifndef NPSIM_DEPTH_DETAIL_MEASURED_HIDDEN_POINTS_HPP
#define NPSIM_DEPTH_DETAIL_MEASURED_HIDDEN_POINTS_HPP

#include <algorithm>
#include <array>
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

// measured: the shape of depth, and other memory; what is hidden becomes 0.
template <class Executor>
void drop_hidden_points(ImageView<const float> depth, ImageView<float> measured, Executor& executor) noexcept {
  std::size_t count = 0;
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) count += is_valid_depth(depth(x, y)) ? 1U : 0U;
  }
  if (kOneSweep * count >= depth.shape().pixels()) return;
  const int reach = std::max(2, depth.width() / 120);
  for_pixels(depth.shape(), executor, [&](int x, int y) {
    if (is_valid_depth(depth(x, y)) && is_hidden(depth, reach, x, y)) measured(x, y) = 0.0F;
  });
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_MEASURED_HIDDEN_POINTS_HPP
