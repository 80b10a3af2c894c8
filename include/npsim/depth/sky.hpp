// SPDX-License-Identifier: Apache-2.0
// Where there is sky, from the picture and the depth, for scenes without labels.
//
// What lies beneath the topmost measurement of its surroundings (8 columns to either side) is surface. Above it a range
// sensor sees nothing, be it sky or a tree that is taller than its field of view; there the picture decides. By day the
// sky is the brightest thing in it: the luma of the pixels above falls into two classes (Otsu, "A threshold selection
// method from gray-level histograms", 1979), and sky is what is bright and connected to the picture's upper edge. What
// is not, and is connected to the surface below, is surface too, so that trees and houses keep their outlines instead
// of ending at the sensor's last row. If the bright class is not at least 1.5 times as bright as the dark one, if one
// of them holds less than 2 % of the pixels, or if the measured surfaces are brighter than the bright class, all above
// is sky.
// A dense depth map has nothing above and is all surface. Cost: a few passes. Memory: none.
#ifndef NPSIM_DEPTH_SKY_HPP
#define NPSIM_DEPTH_SKY_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

inline constexpr std::uint8_t kSky = 0;
inline constexpr std::uint8_t kSurface = 1;
inline constexpr std::uint8_t kBright = 2;
inline constexpr std::uint8_t kDark = 3;

[[nodiscard]] inline int luma(const Rgb8& c) noexcept { return (c.r + 2 * c.g + c.b) / 4; }

// The luma from which on a pixel above all measurements is sky; 256: none is told apart.
[[nodiscard]] inline int sky_luma(ImageView<const Rgb8> image, ImageView<const std::uint8_t> surface) noexcept {
  double above[256] = {};
  double sum = 0;
  double count = 0;
  double below_sum = 0;
  double below_count = 0;
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      const int l = luma(image(x, y));
      if (surface(x, y) == kSurface) {
        below_sum += l;
        below_count += 1;
      } else {
        above[l] += 1;
        sum += l;
        count += 1;
      }
    }
  }
  int best = 256;
  double best_spread = 0;
  double best_dark = 0;
  double best_bright = 0;
  double dark = 0;
  double dark_sum = 0;
  for (int l = 1; l < 256; ++l) {
    dark += above[l - 1];
    dark_sum += above[l - 1] * (l - 1);
    const double bright = count - dark;
    if (dark < 0.02 * count || bright < 0.02 * count || !(dark > 0) || !(bright > 0)) continue;
    const double dark_mean = dark_sum / dark;
    const double bright_mean = (sum - dark_sum) / bright;
    const double spread = dark * bright * (bright_mean - dark_mean) * (bright_mean - dark_mean);
    if (!(spread > best_spread)) continue;
    best_spread = spread;
    best_dark = dark_mean;
    best_bright = bright_mean;
    best = l;
  }
  const bool apart = best_bright >= 1.5 * best_dark && best_bright * below_count > below_sum;
  return apart ? best : 256;
}

// Turns what may become `to` and touches it into it, by raster passes to and fro; at most 16, which leaves only
// windings.
template <class May>
void grow(ImageView<std::uint8_t> map, std::uint8_t to, May&& may) noexcept {
  const auto touch = [&](int x, int y, int i, int j) {
    if (!may(map(x, y)) || !map.contains(i, j) || map(i, j) != to) return false;
    map(x, y) = to;
    return true;
  };
  bool changed = true;
  for (int pass = 0; pass < 16 && changed; ++pass) {
    changed = false;
    for (int y = 0; y < map.height(); ++y) {
      for (int x = 0; x < map.width(); ++x) {
        if (touch(x, y, x - 1, y) || touch(x, y, x, y - 1)) changed = true;
      }
    }
    for (int y = map.height() - 1; y >= 0; --y) {
      for (int x = map.width() - 1; x >= 0; --x) {
        if (touch(x, y, x + 1, y) || touch(x, y, x, y + 1)) changed = true;
      }
    }
  }
}

}  // namespace depth_detail

// surface: 1 where there is one, 0 for the sky. All of one shape.
inline void find_sky(ImageView<const Rgb8> image, ImageView<const float> depth,
                     ImageView<std::uint8_t> surface) noexcept {
  using namespace depth_detail;
  constexpr int kReach = 8;
  const Shape shape = surface.shape();
  bool any = false;
  for (int x = 0; x < shape.width; ++x) {
    int top = shape.height;
    for (int i = max_of(0, x - kReach); i < shape.width && i <= x + kReach; ++i) {
      int y = 0;
      while (y < top && !is_valid_depth(depth(i, y))) ++y;
      top = y;
    }
    for (int y = 0; y < shape.height; ++y) surface(x, y) = y >= top ? kSurface : kSky;
    any = any || top > 0;
  }
  if (!any) return;
  const int threshold = sky_luma(image, surface);
  if (threshold > 255) return;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (surface(x, y) == kSurface) continue;
      const bool bright = luma(image(x, y)) >= threshold;
      surface(x, y) = !bright ? kDark : (y == 0 ? kSky : kBright);
    }
  }
  grow(surface, kSky, [](std::uint8_t c) { return c == kBright; });
  grow(surface, kSurface, [](std::uint8_t c) { return c == kBright || c == kDark; });
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) surface(x, y) = surface(x, y) == kSurface ? 1 : 0;
  }
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_SKY_HPP
