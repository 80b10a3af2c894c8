// SPDX-License-Identifier: Apache-2.0
// Tells walls that look like the sky from the sky: a wall goes on, above the sensor's last row, in what was measured
// below it; the sky begins at an edge.
//
// Of each connected piece of what looks like the sky those columns vote whose own topmost measurement is that of their
// surroundings: for a seam if from there up to the piece the rows keep their mean colour over a few columns, else for
// an edge. On real frames at most .04 of a sky's votes are for seams, and half and more of a wall's (ten frames of
// lasers with 32 and 64 lines). Pieces with few votes stay as they are. And before a blue sky what is whiter than all of
// it is a wall in the sun: a piece that is so for the most part, by its darkest channel, beside the largest one.
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

inline constexpr int kLeastSeams = 6;
inline constexpr double kSeamShare = 0.4;        // of the votes
inline constexpr float kSeamDifference = 24.0F;  // of any channel
inline constexpr int kSeamColumns = 4;           // to either side
inline constexpr int kSeamRows = 3;              // that stand for the measurement, and for the piece
inline constexpr int kSeamNear = 4;              // rows by which a column's surface may begin above its measurement

inline constexpr double kWhitest = 0.98;      // quantile of the largest piece's darkest channel
inline constexpr int kWhiter = 24;            // codes above it
inline constexpr float kLeastWhite = 0.002F;  // of the picture

struct SkyPiece {
  std::uint16_t seams = 0;
  std::uint16_t edges = 0;
  std::uint32_t pixels = 0;
  std::uint32_t whiter = 0;
};

[[nodiscard]] constexpr std::size_t drop_walls_workspace_bytes(Shape shape) noexcept {
  return allocation_bytes<std::uint32_t>(shape.pixels()) + allocation_bytes<SkyPiece>(shape.pixels());
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
      if (map(x, y) != values.like || map(from_x, from_y) != values.like || piece(from_x, from_y) >= piece(x, y))
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
  each([&](int, int, SkyPiece& p) {
    ++p.pixels;
    if (!goes_on(p) && (largest == nullptr || p.pixels > largest->pixels)) largest = &p;
  });
  std::array<std::uint32_t, 256> histogram{};
  each([&](int x, int y, const SkyPiece& p) {
    if (&p == largest) ++histogram[darkest_channel(image(x, y))];
  });
  std::size_t whitest = 0;
  double below = 0;
  while (largest != nullptr && whitest < 255 && below < kWhitest * largest->pixels) below += histogram[whitest++];
  each([&](int x, int y, SkyPiece& p) { p.whiter += darkest_channel(image(x, y)) > whitest + kWhiter ? 1U : 0U; });
  const auto least = static_cast<double>(kLeastWhite) * static_cast<double>(shape.pixels());
  each([&](int x, int y, const SkyPiece& p) {
    const bool white = p.pixels > least && 2.0 * p.whiter > p.pixels;
    if (goes_on(p) || white) map(x, y) = values.unlike;
  });
  return {};
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_SKY_WALLS_HPP
