// SPDX-License-Identifier: Apache-2.0
// Tells walls that look like the sky from the sky: it is even, begins at an edge, and has colours of its own.
//
// What looks like the sky falls into even pieces, in which neighbouring pixels differ by kEvenSky at most.
// - A wall goes on, above the sensor's last row, in what was measured below it. Of each piece those columns vote whose
//   own topmost measurement is that of their surroundings: for a seam if from there up to the piece the rows keep their
//   mean colour over a few columns, else for an edge. On real frames at most .04 of a sky's votes were for seams, and
//   half and more of a wall's (eleven frames of lasers with 32 and 64 lines).
// - The largest piece that does not go on is the sky. If it is but a small part of them, tiles or leaves, none is.
// - A piece most of which is whiter than all of that, by its darkest channel, or less blue, is a wall in the sun.
// Method: our own. Cost: a few passes. Memory: 16 bytes per pixel.
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_SKY_WALLS_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_SKY_WALLS_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

inline constexpr int kEvenSky = 12;  // codes from a pixel to the next, of any channel

inline constexpr int kLeastSeams = 6;
inline constexpr double kSeamShare = 0.4;        // of the votes
inline constexpr float kSeamDifference = 24.0F;  // of any channel
inline constexpr int kSeamColumns = 4;           // to either side
inline constexpr int kSeamRows = 3;              // that stand for the measurement, and for the piece
inline constexpr int kSeamNear = 4;              // rows by which a column's surface may begin above its measurement

inline constexpr double kLeastEven = 0.1;  // of what looks like the sky and does not go on below
inline constexpr double kExtreme = 0.02;   // of the largest piece
inline constexpr int kOtherThanSky = 24;   // codes beyond its extremes

struct SkyPiece {
  std::uint16_t seams = 0;
  std::uint16_t edges = 0;
  std::uint32_t pixels = 0;
  std::uint32_t other = 0;
};

[[nodiscard]] constexpr std::size_t drop_walls_workspace_bytes(Shape shape) noexcept {
  return allocation_bytes<std::uint32_t>(shape.pixels()) + allocation_bytes<SkyPiece>(shape.pixels());
}

[[nodiscard]] inline int luma(const Rgb8& c) noexcept { return (c.r + 2 * c.g + c.b) / 4; }

[[nodiscard]] inline int difference(const Rgb8& a, const Rgb8& b) noexcept {
  const auto off = [](int u, int v) { return u > v ? u - v : v - u; };
  return max_of(off(a.r, b.r), off(a.g, b.g), off(a.b, b.b));
}

[[nodiscard]] inline std::size_t darkest_channel(const Rgb8& c) noexcept {
  return static_cast<std::size_t>(std::min({c.r, c.g, c.b}));
}

// Mean colour of rows [y, y + rows) around column x.
[[nodiscard]] inline Vec3f mean_colour(ImageView<const Rgb8> image, int x, int y, int rows) noexcept {
  Vec3f sum{};
  float count = 0;
  for (int v = max_of(y, 0); v < y + rows && v < image.height(); ++v) {
    for (int u = max_of(x - kSeamColumns, 0); u <= x + kSeamColumns && u < image.width(); ++u) {
      const Rgb8 c = image(u, v);
      sum = sum + Vec3f{static_cast<float>(c.r), static_cast<float>(c.g), static_cast<float>(c.b)};
      count += 1;
    }
  }
  return count > 0 ? sum * (1.0F / count) : sum;
}

// Values of a map of what is sky: below the topmost measurements; looks like the sky; does not.
struct SkyValues {
  std::uint8_t surface;
  std::uint8_t like;
  std::uint8_t unlike;
};

// Makes those pieces unlike the sky that are walls.
[[nodiscard]] inline Status drop_walls(ImageView<const Rgb8> image, ImageView<const float> depth,
                                       const SkyValues& values, ImageView<std::uint8_t> map,
                                       Workspace& workspace) noexcept {
  const Shape shape = map.shape();
  const WorkspaceScope scope(workspace);
  ImageView<std::uint32_t> piece;  // the index of its first pixel
  ImageView<SkyPiece> pieces;      // at that pixel
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, piece));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, pieces));
  const auto width = static_cast<std::uint32_t>(shape.width);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      piece(x, y) = static_cast<std::uint32_t>(y) * width + static_cast<std::uint32_t>(x);
      pieces(x, y) = {};
    }
  }
  bool changed = true;
  for (int pass = 0; pass < 16 && changed; ++pass) {
    changed = false;
    sweep_to_and_fro(shape, [&](int x, int y, int from_x, int from_y) {
      if (map(x, y) != values.like || map(from_x, from_y) != values.like || piece(from_x, from_y) >= piece(x, y) ||
          difference(image(x, y), image(from_x, from_y)) > kEvenSky)
        return;
      piece(x, y) = piece(from_x, from_y);
      changed = true;
    });
  }
  const auto first = [&](int x, int y) -> SkyPiece& {
    return pieces(static_cast<int>(piece(x, y) % width), static_cast<int>(piece(x, y) / width));
  };
  for (int x = 0; x < shape.width; ++x) {
    int top = 0;
    while (top < shape.height && !is_valid_depth(depth(x, top))) ++top;
    int begin = top;
    while (begin > 0 && map(x, begin - 1) == values.surface) --begin;
    int above = begin - 1;
    while (above >= 0 && map(x, above) != values.like) --above;
    if (top == shape.height || top - begin > kSeamNear || above < 0) continue;
    const Vec3f below = mean_colour(image, x, top, kSeamRows);
    bool seam = true;
    for (int y = top - 1; seam && y > above - kSeamRows && y >= 0; --y) {
      const Vec3f off = mean_colour(image, x, y, 1) - below;
      seam = max_of(std::fabs(off.x), std::fabs(off.y), std::fabs(off.z)) <= kSeamDifference;
    }
    SkyPiece& v = first(x, above);
    ++(seam ? v.seams : v.edges);
  }
  const auto each = [&](const auto& f) {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        if (map(x, y) == values.like) f(x, y, first(x, y));
      }
    }
  };
  const auto goes_on = [](const SkyPiece& p) {
    return p.seams >= kLeastSeams && p.seams > kSeamShare * (static_cast<double>(p.seams) + p.edges);
  };
  const SkyPiece* largest = nullptr;
  double open = 0;  // pixels of what does not go on
  each([&](int, int, SkyPiece& p) {
    ++p.pixels;
    if (goes_on(p)) return;
    open += 1;
    if (largest == nullptr || p.pixels > largest->pixels) largest = &p;
  });
  const bool even = largest != nullptr && largest->pixels >= kLeastEven * open;
  std::array<std::uint32_t, 256> darkest{};
  std::array<std::uint32_t, 256> blue{};
  each([&](int x, int y, const SkyPiece& p) {
    if (&p != largest) return;
    ++darkest[darkest_channel(image(x, y))];
    ++blue[image(x, y).b];
  });
  const auto quantile = [&](const std::array<std::uint32_t, 256>& histogram, double share) {
    int code = 0;
    double below = histogram[0];
    while (largest != nullptr && code < 255 && below < share * largest->pixels) {
      below += histogram[static_cast<std::size_t>(++code)];
    }
    return code;
  };
  const int whitest = quantile(darkest, 1 - kExtreme) + kOtherThanSky;
  const int least_blue = quantile(blue, kExtreme) - kOtherThanSky;
  each([&](int x, int y, SkyPiece& p) {
    const Rgb8 c = image(x, y);
    p.other += static_cast<int>(darkest_channel(c)) > whitest || c.b < least_blue ? 1U : 0U;
  });
  each([&](int x, int y, const SkyPiece& p) {
    if (!even || goes_on(p) || 2.0 * p.other > p.pixels) map(x, y) = values.unlike;
  });
  return {};
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_SKY_WALLS_HPP
