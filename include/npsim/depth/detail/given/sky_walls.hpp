// SPDX-License-Identifier: Apache-2.0
// Tells walls that look like the sky from the sky: it is even, begins at an edge, and has colours of its own.
//
// What looks like the sky falls into even pieces, in which the mean colours (3 x 3) of neighbouring pixels differ by
// kEvenMeans at most.
// - A wall goes on, above the sensor's last row, in what was measured below it. Of each piece those columns vote whose
//   own topmost measurement is that of their surroundings: for a seam if that is near the sensor's last row, and from
//   there up to the piece the rows keep their mean colour over a few columns, without a step; else for an edge. On ten
//   real frames of lasers with 32 and 64 lines no sky had a vote for a seam, and walls half of theirs and more. What
//   takes up half of the picture's upper edge is no wall: snow and fog have no edge to the sky.
// - The largest piece that does not go on is the sky. If what does not go on is in crumbs, tiles or leaves, none is.
// - A piece less than half as large, most of which is whiter than that, by its darkest channel, or less blue, beyond
//   quantiles, is a wall in the sun. A white wall that is larger is not told from a blue sky.
// - Of a stereo pair a front goes on in the surface beside it without a step, and its disparity is as smooth as a
//   plane's: of a pale front of a real frame .71 of the pixels lie within two deviations of the mean of those a 256th
//   of the width beside them, of the skies of four .03 to .27. A piece of colours of its own, most of which does, is
//   a wall, unless the largest piece is as smooth, as where the matches of a sky were filled.
// Pieces are found by 16 passes at most: windings fall into several.
// Method: our own. Cost: a few passes. Memory: 29 bytes per pixel.
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_SKY_WALLS_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_SKY_WALLS_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/depth_source.hpp"
#include "npsim/depth/detail/given/sky_map.hpp"
#include "npsim/depth/detail/grow.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

inline constexpr int kEvenSky = 12;        // codes from a pixel to the next, of any channel
inline constexpr float kEvenMeans = 4.0F;  // the same of means

inline constexpr int kLeastSeams = 6;
inline constexpr double kSeamShare = 0.4;        // of the votes
inline constexpr float kSeamDifference = 24.0F;  // of any channel, from the measurement on
inline constexpr float kSeamStep = 16.0F;        // within kSeamRows
inline constexpr int kSeamColumns = 4;           // to either side
inline constexpr int kSeamRows = 3;              // that stand for the measurement, and for the piece
inline constexpr int kSeamNear = 4;              // rows by which a column's surface may begin above its measurement
inline constexpr double kLastRow = 0.3;          // of the way from the topmost measurement to the picture's middle

inline constexpr double kWholeEdge = 0.5;     // of the width
inline constexpr double kLeastPiece = 0.005;  // of the picture: less is a crumb
inline constexpr double kLeastEven = 0.25;    // of what does not go on, in larger pieces
inline constexpr double kSmaller = 0.5;       // than the largest piece
inline constexpr double kExtreme = 0.02;      // quantiles of the largest piece
inline constexpr int kOtherThanSky = 24;      // codes beyond them

struct SkyPiece {
  std::uint32_t seams = 0;  // where it goes on in what was measured
  std::uint32_t edges = 0;  // where it does not
  std::uint32_t pixels = 0;
  std::uint32_t other = 0;    // whiter or less blue than the sky
  std::uint32_t matched = 0;  // of a stereo pair, as on planes
  bool at_whole_edge = false;

  [[nodiscard]] bool goes_on() const noexcept {
    return !at_whole_edge && seams >= kLeastSeams && seams > kSeamShare * (static_cast<double>(seams) + edges);
  }
};

[[nodiscard]] constexpr std::size_t drop_walls_workspace_bytes(Shape shape) noexcept {
  return allocation_bytes<std::uint32_t>(shape.pixels()) + allocation_bytes<SkyPiece>(shape.pixels()) +
         allocation_bytes<std::uint8_t>(shape.pixels()) +
         allocation_bytes<Vec3f>(2 * static_cast<std::size_t>(shape.width));
}

[[nodiscard]] inline std::size_t darkest_channel(const Rgb8& c) noexcept {
  return static_cast<std::size_t>(std::min({c.r, c.g, c.b}));
}

// Mean colour of a rectangle around (x, y), as far as it lies in the picture.
[[nodiscard]] inline Vec3f mean_colour(ImageView<const Rgb8> image, int x, int y, int columns, int rows) noexcept {
  Vec3f sum{};
  float count = 0;
  for (int v = max_of(y - rows, 0); v <= y + rows && v < image.height(); ++v) {
    for (int u = max_of(x - columns, 0); u <= x + columns && u < image.width(); ++u) {
      const Rgb8 c = image(u, v);
      sum = sum + Vec3f{static_cast<float>(c.r), static_cast<float>(c.g), static_cast<float>(c.b)};
      count += 1;
    }
  }
  return count > 0 ? sum * (1.0F / count) : sum;
}

[[nodiscard]] inline float largest_difference(const Vec3f& a, const Vec3f& b) noexcept {
  return max_of(std::fabs(a.x - b.x), std::fabs(a.y - b.y), std::fabs(a.z - b.z));
}

// piece: the index of the first pixel of each pixel's piece. means: two rows. links: scratch.
inline void number_even_pieces(ImageView<const Rgb8> image, ImageView<const std::uint8_t> map, Span<Vec3f> means,
                               ImageView<std::uint8_t> links, ImageView<std::uint32_t> piece) noexcept {
  constexpr std::uint8_t kLeft = 1;
  constexpr std::uint8_t kUp = 2;
  const Shape shape = map.shape();
  const auto mean_at = [&](int x, int y) -> Vec3f& {
    return means[static_cast<std::size_t>(y % 2 * shape.width) + static_cast<std::size_t>(x)];
  };
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      piece(x, y) =
          static_cast<std::uint32_t>(y) * static_cast<std::uint32_t>(shape.width) + static_cast<std::uint32_t>(x);
      links(x, y) = 0;
      if (map(x, y) != kLike) continue;
      const Vec3f mean = mean_colour(image, x, y, 1, 1);
      mean_at(x, y) = mean;
      const bool left = x > 0 && map(x - 1, y) == kLike && largest_difference(mean, mean_at(x - 1, y)) <= kEvenMeans;
      const bool up = y > 0 && map(x, y - 1) == kLike && largest_difference(mean, mean_at(x, y - 1)) <= kEvenMeans;
      links(x, y) = static_cast<std::uint8_t>((left ? kLeft : 0) | (up ? kUp : 0));
    }
  }
  settle(shape, [&](int x, int y, int from_x, int from_y) {
    if (piece(from_x, from_y) >= piece(x, y)) return false;
    const bool linked =
        from_x != x ? (links(max_of(x, from_x), y) & kLeft) != 0 : (links(x, max_of(y, from_y)) & kUp) != 0;
    if (linked) piece(x, y) = piece(from_x, from_y);
    return linked;
  });
}

// Whether from the measurement in row `top` up to the row `above` of a piece the picture goes on.
[[nodiscard]] inline bool is_seam(ImageView<const Rgb8> image, int x, int top, int above) noexcept {
  const Vec3f measured = mean_colour(image, x, top + kSeamRows / 2, kSeamColumns, kSeamRows / 2);
  for (int y = top - 1; y >= above; --y) {
    const Vec3f row = mean_colour(image, x, y, kSeamColumns, 0);
    const Vec3f below = mean_colour(image, x, y + kSeamRows, kSeamColumns, 0);
    if (largest_difference(row, measured) > kSeamDifference || largest_difference(row, below) > kSeamStep) return false;
  }
  return true;
}

// The columns' votes. topmost: the row of each column's topmost measurement, the height where it has none.
// piece_at(x, y): the piece of a pixel that looks like the sky.
template <class PieceAt>
void vote_for_seams(ImageView<const Rgb8> image, Span<const int> topmost, ImageView<const std::uint8_t> map,
                    const PieceAt& piece_at) noexcept {
  const Shape shape = map.shape();
  int last_row = shape.height;  // of the sensor
  for (const int top : topmost) last_row = std::min(last_row, top);
  for (int x = 0; x < shape.width; ++x) {
    const int top = topmost[static_cast<std::size_t>(x)];
    int begin = top;
    while (begin > 0 && map(x, begin - 1) == kSurface) --begin;
    int above = begin - 1;
    while (above >= 0 && map(x, above) != kLike) --above;
    above -= kSeamRows;  // beyond what an edge mixes
    if (top == shape.height || top - begin > kSeamNear || above < 0 || map(x, above) != kLike) continue;
    const bool at_last_row = top - last_row <= kLastRow * std::fabs(0.5 * shape.height - last_row);
    SkyPiece& p = piece_at(x, above);
    ++(at_last_row && is_seam(image, x, top, above) ? p.seams : p.edges);
  }
}

// The pieces of what looks like the sky.
class SkyPieces {
 public:
  [[nodiscard]] Status find(ImageView<const Rgb8> image, ImageView<const std::uint8_t> map,
                            Workspace& workspace) noexcept {
    map_ = map;
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(map.shape(), piece_));
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(map.shape(), pieces_));
    const WorkspaceScope scope(workspace);
    ImageView<std::uint8_t> links;
    Span<Vec3f> means;
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(map.shape(), links));
    NPSIM_RETURN_IF_ERROR(workspace.allocate(2 * static_cast<std::size_t>(map.width()), means));
    number_even_pieces(image, map, means, links, piece_);
    for (SkyPiece& p : pieces_.pixels()) p = {};
    each([&](int, int y, SkyPiece& p) {
      ++p.pixels;
      if (y == 0 && p.pixels >= kWholeEdge * map.width()) p.at_whole_edge = true;
    });
    return {};
  }
  [[nodiscard]] SkyPiece& at(int x, int y) const noexcept { return pieces_.pixels()[piece_(x, y)]; }
  // f(x, y, piece) of each pixel that looks like the sky.
  template <class F>
  void each(const F& f) const {
    for (int y = 0; y < map_.height(); ++y) {
      for (int x = 0; x < map_.width(); ++x) {
        if (map_(x, y) == kLike) f(x, y, at(x, y));
      }
    }
  }
  // Counts in each piece what is whiter or less blue than `sky`.
  void compare(ImageView<const Rgb8> image, const SkyPiece* sky) const noexcept {
    ByteHistogram darkest{};
    ByteHistogram blue{};
    each([&](int x, int y, const SkyPiece& p) {
      if (&p != sky) return;
      darkest[darkest_channel(image(x, y))] += 1;
      blue[image(x, y).b] += 1;
    });
    const int whitest = quantile_of(darkest, 1 - kExtreme) + kOtherThanSky;
    const int least_blue = quantile_of(blue, kExtreme) - kOtherThanSky;
    each([&](int x, int y, SkyPiece& p) {
      const Rgb8 c = image(x, y);
      p.other += static_cast<int>(darkest_channel(c)) > whitest || c.b < least_blue ? 1U : 0U;
    });
  }
  [[nodiscard]] static bool is_other(const SkyPiece& p, const SkyPiece* sky) noexcept {
    return sky != nullptr && 2.0 * p.other > p.pixels && p.pixels < kSmaller * sky->pixels;
  }

 private:
  ImageView<const std::uint8_t> map_;
  ImageView<std::uint32_t> piece_;
  ImageView<SkyPiece> pieces_;  // at their first pixels
};

// Makes those pieces unlike the sky that are walls. topmost: as above.
[[nodiscard]] inline Status drop_walls(ImageView<const Rgb8> image, Span<const int> topmost,
                                       ImageView<std::uint8_t> map, Workspace& workspace) noexcept {
  const WorkspaceScope scope(workspace);
  SkyPieces pieces;
  NPSIM_RETURN_IF_ERROR(pieces.find(image, map, workspace));
  vote_for_seams(image, topmost, map, [&](int x, int y) -> SkyPiece& { return pieces.at(x, y); });
  const SkyPiece* largest = nullptr;
  double open = 0;       // pixels of what does not go on
  double in_pieces = 0;  // of these
  const double crumb = kLeastPiece * static_cast<double>(map.shape().pixels());
  pieces.each([&](int, int, const SkyPiece& p) {
    if (p.goes_on()) return;
    open += 1;
    if (p.pixels >= crumb) in_pieces += 1;
    if (largest == nullptr || p.pixels > largest->pixels) largest = &p;
  });
  const bool crumbs = in_pieces < kLeastEven * open;
  pieces.compare(image, largest);
  pieces.each([&](int x, int y, const SkyPiece& p) {
    if (crumbs || p.goes_on() || SkyPieces::is_other(p, largest)) map(x, y) = kUnlike;
  });
  return {};
}

// Of a stereo pair. map: kSky becomes kSurface where a piece goes on in what is surface, without a step of depth, was
// matched for the most part as it is on planes, which the sky was not, and has not the sky's colours. The sky is the
// largest piece. noise: of the depth; nothing is told where the pair's baseline is unknown.
[[nodiscard]] inline Status drop_matched_walls(ImageView<const Rgb8> image, ImageView<const float> depth,
                                               const DepthNoise& noise, ImageView<std::uint8_t> map,
                                               Workspace& workspace) noexcept {
  constexpr float kOnPlane = 2.0F;    // deviations of 1 / z, as are the next two
  constexpr float kNoStep = 4.0F;     // across kSeamRows, or as many columns
  constexpr float kNear = 10.0F;      // from the sky's
  constexpr double kSmoothSky = 0.4;  // of its pixels as on planes: it was filled or smoothed
  constexpr int kInWidth = 256;       // of the distance between the three pixels that are compared
  if (noise.power != 0) return {};
  const WorkspaceScope scope(workspace);
  const int reach = std::max(1, depth.width() / kInWidth);
  const auto as_on_planes = [&](int x, int y) {
    if (x < reach || x + reach >= depth.width()) return false;
    const float z[3] = {depth(x - reach, y), depth(x, y), depth(x + reach, y)};
    if (!is_valid_depth(z[0]) || !is_valid_depth(z[1]) || !is_valid_depth(z[2])) return false;
    const float w = 1.0F / z[1];
    return w > kNear * noise.amplitude &&
           std::fabs(w - 0.5F * (1.0F / z[0] + 1.0F / z[2])) < kOnPlane * noise.amplitude;
  };
  for (std::uint8_t& m : map.pixels()) m = m == kSky ? kLike : m;
  SkyPieces pieces;
  NPSIM_RETURN_IF_ERROR(pieces.find(image, map, workspace));
  const SkyPiece* sky = nullptr;
  pieces.each([&](int x, int y, SkyPiece& p) {
    p.matched += as_on_planes(x, y) ? 1U : 0U;
    for (const PixelPlace& at :
         {PixelPlace{x - kSeamRows, y}, {x + kSeamRows, y}, {x, y - kSeamRows}, {x, y + kSeamRows}}) {
      if (!map.contains(at.x, at.y) || map(at) != kSurface) continue;
      if (!is_valid_depth(depth(x, y)) || !is_valid_depth(depth(at))) continue;
      const float step = std::fabs(1.0F / depth(x, y) - 1.0F / depth(at));
      ++(step < kNoStep * noise.amplitude ? p.seams : p.edges);
    }
    if (sky == nullptr || p.pixels > sky->pixels) sky = &p;
  });
  pieces.compare(image, sky);
  const bool told = sky != nullptr && sky->matched < kSmoothSky * sky->pixels;
  pieces.each([&](int x, int y, const SkyPiece& p) {
    const bool wall = told && p.goes_on() && 2.0 * p.matched > p.pixels && SkyPieces::is_other(p, sky);
    map(x, y) = wall ? kSurface : kSky;
  });
  return {};
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_SKY_WALLS_HPP
