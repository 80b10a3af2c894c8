// SPDX-License-Identifier: Apache-2.0
// Which pixels a triangle on the screen covers, in whole numbers.
//
// Corners lie on a grid of 1/256 pixel. A pixel belongs to a triangle when its centre lies inside, or on a top or left
// edge (top-left rule): triangles that share edges leave no gap and take no pixel twice, whatever their size, as long
// as they do not overlap. Either winding will do. The range of pixels of a row comes from three divisions, so that a
// sliver a thousand pixels long costs its rows, not its box.
// Invariant: all sums are exact for coordinates up to 2^29 subpixels. Cost: O(rows + pixels covered). Memory: none.
// Error: none of coverage; the value interpolated lies between the corners', to 1e-7 relative.
#ifndef NPSIM_RENDER_DETAIL_COVERAGE_HPP
#define NPSIM_RENDER_DETAIL_COVERAGE_HPP

#include <algorithm>
#include <cstdint>
#include <utility>

#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr int kSubpixelBits = 8;
inline constexpr std::int32_t kSubpixels = 1 << kSubpixelBits;  // per pixel
inline constexpr std::int32_t kHalfPixel = kSubpixels / 2;

// A corner on the screen, x right and y down, in subpixels; value is what is interpolated, not negative.
struct ScreenCorner {
  std::int32_t x = 0;
  std::int32_t y = 0;
  float value = 0;
};

// Rows or columns, both ends included; empty where first > last.
struct PixelRange {
  int first = 0;
  int last = -1;
};

namespace coverage_detail {

// Rows or columns whose centres lie between two coordinates, ends included.
[[nodiscard]] inline PixelRange centres_between(std::int32_t low, std::int32_t high, int size) noexcept {
  // Shifts round down.
  const std::int32_t first = (low - kHalfPixel + kSubpixels - 1) >> kSubpixelBits;
  const std::int32_t last = (high - kHalfPixel) >> kSubpixelBits;
  return {std::max(first, 0), std::min(last, size - 1)};
}

[[nodiscard]] constexpr std::int64_t divided_down(std::int64_t a, std::int64_t positive) noexcept {
  return a >= 0 ? a / positive : -((positive - 1 - a) / positive);
}

// The edge from p to q of a triangle that runs clockwise on the screen (y down): positive inside.
struct Edge {
  std::int64_t dx, dy, px, py;
  std::int64_t least;  // a centre on the edge counts if it is a top or left one: 0, else 1

  Edge(const ScreenCorner& p, const ScreenCorner& q) noexcept
      : dx(std::int64_t{q.x} - p.x),
        dy(std::int64_t{q.y} - p.y),
        px(p.x),
        py(p.y),
        least(dy < 0 || (dy == 0 && dx > 0) ? 0 : 1) {}
  // Twice the area of the triangle with the centre of pixel (x, y), in square subpixels.
  [[nodiscard]] std::int64_t at(int x, int y) const noexcept {
    return dx * (std::int64_t{y} * kSubpixels + kHalfPixel - py) -
           dy * (std::int64_t{x} * kSubpixels + kHalfPixel - px);
  }
  // Narrows a range of pixels of row y to those on the inner side.
  void narrow(int y, std::int64_t& first, std::int64_t& last) const noexcept {
    const std::int64_t e = at(0, y) - least;  // at column x: e - x dy kSubpixels
    if (dy < 0) first = std::max(first, -divided_down(e, -dy * kSubpixels));
    if (dy > 0) last = std::min(last, divided_down(e, dy * kSubpixels));
    if (dy == 0 && e < 0) last = first - 1;
  }
};

// The rows of a picture in which a triangle may cover a pixel; empty if it covers none.
[[nodiscard]] inline PixelRange covered_rows(const ScreenCorner& a, const ScreenCorner& b, const ScreenCorner& c,
                                             int width, int height) noexcept {
  const PixelRange x = centres_between(std::min(a.x, std::min(b.x, c.x)), std::max(a.x, std::max(b.x, c.x)), width);
  const PixelRange y = centres_between(std::min(a.y, std::min(b.y, c.y)), std::max(a.y, std::max(b.y, c.y)), height);
  return x.first <= x.last ? y : PixelRange{};
}

}  // namespace coverage_detail

// Calls f(x, y, value) for each pixel of the rows [first_row, end_row) that a triangle covers.
template <class F>
void for_covered(ScreenCorner a, ScreenCorner b, ScreenCorner c, int first_row, int end_row, int width, F&& f) {
  std::int64_t area =
      (std::int64_t{b.x} - a.x) * (std::int64_t{c.y} - a.y) - (std::int64_t{b.y} - a.y) * (std::int64_t{c.x} - a.x);
  if (area == 0) return;
  if (area < 0) {
    std::swap(b, c);
    area = -area;
  }
  const PixelRange columns =
      coverage_detail::centres_between(std::min(a.x, std::min(b.x, c.x)), std::max(a.x, std::max(b.x, c.x)), width);
  const PixelRange rows =
      coverage_detail::centres_between(std::min(a.y, std::min(b.y, c.y)), std::max(a.y, std::max(b.y, c.y)), end_row);
  if (columns.first > columns.last) return;
  const coverage_detail::Edge to_a(b, c);
  const coverage_detail::Edge to_b(c, a);
  const coverage_detail::Edge to_c(a, b);
  const double scale = 1.0 / static_cast<double>(area);
  const double wa = static_cast<double>(a.value) * scale;
  const double wb = static_cast<double>(b.value) * scale;
  const double wc = static_cast<double>(c.value) * scale;
  for (int y = std::max(rows.first, first_row); y <= rows.last; ++y) {
    std::int64_t first = columns.first;
    std::int64_t last = columns.last;
    to_a.narrow(y, first, last);
    to_b.narrow(y, first, last);
    to_c.narrow(y, first, last);
    for (; first <= last; ++first) {
      const auto x = static_cast<int>(first);
      // A sum of positive terms: it stays within the corners'.
      f(x, y,
        static_cast<float>(static_cast<double>(to_a.at(x, y)) * wa + static_cast<double>(to_b.at(x, y)) * wb +
                           static_cast<double>(to_c.at(x, y)) * wc));
    }
  }
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_DETAIL_COVERAGE_HPP
