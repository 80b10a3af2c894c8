// SPDX-License-Identifier: Apache-2.0
// Where there is sky, from the picture and the depth, for scenes without labels.
//
// What lies beneath the topmost measurement of its surroundings (8 columns to either side) is surface, but for the gaps
// of a laser, below. Above it a range sensor sees nothing, be it sky or a tree that is taller than its field of view;
// there the picture decides. By day the sky is the brightest thing in it: the luma of the pixels above falls into two
// classes (Otsu, "A threshold selection method from gray-level histograms", 1979), and sky is what is bright and
// connected to the picture's upper edge. What is not, and is connected to the surface below, is surface too, so that
// trees and houses keep their outlines instead of ending at the sensor's last row. The classes are told apart if the
// bright one is at least 1.5 times as bright as the dark one, neither holds less than 2 % of the pixels, and the
// measured surfaces are not brighter than the bright one. Walls that look so are told from it by given/sky_walls.hpp.
// Beside what was measured the sky comes up to it, as far as it is even and nothing was measured above in the column or
// to one side. Below what was not measured and is thinner than 1/160 of the width, such as wires, it goes on in the
// same colour.
// A deep blue sky, or a dark one of clouds, is not the brightest. What the sensor looked at without an answer, below
// its topmost rows nearby, tells: where less than a tenth of that is in the bright class, or there is none, the classes
// are of how much pixels differ from its median colour, and sky is what is alike, if that is the smoother one, and
// blue, or at least half as bright as the mean of the measured surfaces (not asked of dense maps and of stereo) and .3
// times as bright as the bright class: far trees do not answer either. Panes leave a sensor without an answer too,
// so a deep blue is asked for as well: the median of the pixels that are blue, where these cover 5 % of the picture.
// What is alike to it is the sky where it is told from the rest in the same way, is smoother than the bright class,
// which is rough, and holds more than ten times as much of the upper edge: clouds, and gaps between blue fronts,
// are even, and white fronts in the sun are not. Where no way tells them apart, all above is sky.
// A dense depth map, such as a network's, has nothing above: its sky is far. Of what lies beyond kFarSky_m the picture
// decides in the same way, with all of it where even its darker class is much brighter than what is near; where nine
// tenths of it are blue, of what is near not half, and nothing else tells it apart, that is how the sky looks. Sky is
// what looks so and is connected to the upper edge, what looks so elsewhere and is as far, and in dense maps what goes
// on from these without a step of depth or colour, nearly as far, and is as bright, or blue: clouds, and what is
// between them. Where nothing is told apart all is surface.
// A stereo pair matches clouds with each other: on real frames .4 to .55 of the sky has a depth, from 27 m on. Where
// the picture tells the sky from the rest of what is missing or beyond kMismatchedSky_m, it decides of all that as it
// does of what is far in a dense map; where it does not, or what it calls sky was matched while the even part that is
// missing at the top is not of it (bright houses below a dark sky), what was matched is surface, as for other sensors.
// Of a pair of known baseline, even pieces of other colours than the sky's that were matched as planes are stay surface
// (given/sky_walls.hpp).
// A laser measures wires, poles and crowns high above the rest, and what hangs or stands before the sky has sky below
// and beside it. A gap is what it leaves out between two answers to one side of a pixel, one above the other. Where a
// gap is three times as high as three of four are, the laser has looked without an answer, if its rows lie equally far
// apart; there sky is what goes on evenly from that above, across what is no thicker than wires too, looks like it or
// is of its brightness, and is seen by rays that do not fall to the ground.
// Exact maps, and those of networks, whose sky is left out have no gaps between samples: of them all that is missing is
// asked like what is above a sensor's last row, below lamps and measured wires too. Where the picture tells nothing
// apart, what is missing in either from the upper edge on is sky, down to the horizon and what a street climbs.
// Exact maps miss hardly anything but the sky: over a known ground what looks like it is sky in them also where nothing
// leads there from the edge, as between branches, but for walls.
// Where the ground is known, what lies farther below its horizon than a street climbs is surface in all of this, but
// for sky that reaches down there from the upper edge.
// Cost: a few passes. Memory: 29 bytes per pixel, for a dense map none.
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_SKY_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_SKY_HPP

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/depth_source.hpp"
#include "npsim/depth/detail/given/sky_map.hpp"
#include "npsim/depth/detail/given/sky_walls.hpp"
#include "npsim/depth/detail/ground_level.hpp"
#include "npsim/depth/detail/grow.hpp"
#include "npsim/geometry/ground.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

// The rows where the sensor's field of view begins: the topmost measurement in a sixteenth of the width and in the one
// to either side.
class FieldOfView {
 public:
  // surface: kSurface below the topmost measurement of each column.
  explicit FieldOfView(ImageView<const std::uint8_t> surface) noexcept : width_(surface.width()) {
    top_.fill(surface.height());
    for (int x = 0; x < surface.width(); ++x) {
      int y = 0;
      while (y < surface.height() && surface(x, y) != kSurface) ++y;
      int& top = top_[block_of(x)];
      top = y < top ? y : top;
    }
  }
  [[nodiscard]] bool contains(int x, int y) const noexcept {
    const std::size_t b = block_of(x);
    int top = top_[b];
    if (b > 0) top = std::min(top, top_[b - 1]);
    if (b + 1 < kBlocks) top = std::min(top, top_[b + 1]);
    return y > top;
  }

 private:
  static constexpr std::size_t kBlocks = 16;
  [[nodiscard]] std::size_t block_of(int x) const noexcept {
    return static_cast<std::size_t>(x) * kBlocks / static_cast<std::size_t>(width_);
  }
  int width_;
  std::array<int, kBlocks> top_{};
};

// Whether a pixel above all measurements looks like the sky.
struct SkyLook {
  bool known = false;
  bool all = false;        // even the darker class is much brighter than the measured surfaces
  bool blue = false;       // nearly all is, and not half of the measured surfaces
  bool by_colour = false;  // else by luma
  int level = 256;
  Rgb8 colour{};
  double step = 255;  // mean_step() of what looks so

  [[nodiscard]] bool of(const Rgb8& c) const noexcept {
    return by_colour ? difference(c, colour) < level : luma(c) >= level;
  }
};

// Mean step of luma to the next pixel, among those above all measurements that both look alike, or both not: a narrow
// gap between fronts is as smooth as a wide one.
[[nodiscard]] inline double mean_step(const SkyLook& look, bool like, ImageView<const Rgb8> image,
                                      ImageView<const std::uint8_t> surface) noexcept {
  double sum = 0;
  double count = 0;
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x + 1 < image.width(); ++x) {
      if (surface(x, y) == kSurface || look.of(image(x, y)) != like) continue;
      if (surface(x + 1, y) == kSurface || look.of(image(x + 1, y)) != like) continue;
      const int step = luma(image(x + 1, y)) - luma(image(x, y));
      sum += step < 0 ? -step : step;
      count += 1;
    }
  }
  return count > 0 ? sum / count : 255.0;
}

// Bytes of each channel, and how many there are.
struct ColourHistogram {
  ByteHistogram red{}, green{}, blue{};
  double count = 0;

  void add(const Rgb8& c) noexcept {
    red[c.r] += 1;
    green[c.g] += 1;
    blue[c.b] += 1;
    count += 1;
  }
  [[nodiscard]] Rgb8 median() const noexcept {
    return {static_cast<std::uint8_t>(quantile_of(red, 0.5)), static_cast<std::uint8_t>(quantile_of(green, 0.5)),
            static_cast<std::uint8_t>(quantile_of(blue, 0.5))};
  }
};

inline constexpr int kBlue = 24;  // codes of blue above red
[[nodiscard]] inline int blue_over_red(const Rgb8& c) noexcept { return c.b - c.r; }
[[nodiscard]] inline bool is_blue(const Rgb8& c) noexcept { return blue_over_red(c) >= kBlue; }

// The pixels of the picture's upper edge, above all measurements, that look so.
[[nodiscard]] inline int count_at_edge(const SkyLook& look, ImageView<const Rgb8> image,
                                       ImageView<const std::uint8_t> surface) noexcept {
  int count = 0;
  for (int x = 0; x < image.width(); ++x) count += surface(x, 0) != kSurface && look.of(image(x, 0)) ? 1 : 0;
  return count;
}

// What is alike to a colour: known where that is told from the rest, smoother than it, and at the upper edge. Far trees
// and houses leave the sensor without an answer too.
[[nodiscard]] inline SkyLook look_alike(const Rgb8& colour, ImageView<const Rgb8> image,
                                        ImageView<const std::uint8_t> surface) noexcept {
  SkyLook alike;
  alike.by_colour = true;
  alike.colour = colour;
  ByteHistogram differences{};
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      if (surface(x, y) != kSurface) differences[static_cast<std::size_t>(difference(image(x, y), colour))] += 1;
    }
  }
  const TwoClasses classes = two_classes(differences);
  alike.level = classes.level;
  alike.step = mean_step(alike, true, image, surface);
  alike.known = classes.level < 256 && classes.high_mean >= 2.0 * classes.low_mean + 16.0 &&
                alike.step < mean_step(alike, false, image, surface) && count_at_edge(alike, image, surface) > 0;
  return alike;
}

// least_luma: of the mean luma of the measured surfaces, what the sky has at least if it is not blue.
[[nodiscard]] inline SkyLook sky_look(ImageView<const Rgb8> image, ImageView<const std::uint8_t> surface,
                                      double least_luma) noexcept {
  constexpr double kLeastUnanswered = 0.002;  // of the picture
  constexpr double kUnansweredShare = 0.9;    // of these: the rest may be surfaces out of reach
  constexpr double kMuchBrighter = 1.5;
  constexpr double kLeastBlue = 0.05;  // of the picture
  constexpr int kMuchMore = 10;        // of the upper edge
  constexpr double kRough = 6.0;       // codes from pixel to pixel: skies have 1 to 3
  constexpr double kDarkest = 0.3;     // codes of clouds to those of the bright class
  constexpr double kNearlyAll = 0.9;
  const FieldOfView field(surface);
  ByteHistogram above{}, unanswered{};
  ColourHistogram unanswered_colour, blue;
  double below_sum = 0;
  double below_count = 0;
  double below_blue = 0;
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      const Rgb8 c = image(x, y);
      if (surface(x, y) == kSurface) {
        below_sum += luma(c);
        below_count += 1;
        below_blue += is_blue(c) ? 1.0 : 0.0;
        continue;
      }
      above[static_cast<std::size_t>(luma(c))] += 1;
      if (is_blue(c)) blue.add(c);
      if (!field.contains(x, y)) continue;
      unanswered[static_cast<std::size_t>(luma(c))] += 1;
      unanswered_colour.add(c);
    }
  }
  const TwoClasses by_luma = two_classes(above);
  SkyLook bright;
  bright.level = by_luma.level;
  bright.step = mean_step(bright, true, image, surface);
  bright.known = by_luma.level < 256 && by_luma.high_mean >= kMuchBrighter * by_luma.low_mean &&
                 by_luma.high_mean * below_count > below_sum;
  const double darkest = by_luma.level < 256 ? by_luma.low_mean : quantile_of(above, 0.02);
  bright.all = below_count > 0 && darkest * below_count >= kMuchBrighter * below_sum;
  const double pixels = static_cast<double>(image.shape().pixels());
  const double above_count = pixels - below_count;
  bright.blue = above_count > 0 && blue.count >= kNearlyAll * above_count && below_blue < 0.5 * below_count;
  if (blue.count >= kLeastBlue * pixels) {
    SkyLook deep = look_alike(blue.median(), image, surface);
    deep.all = bright.all;
    const bool most = kMuchMore * count_at_edge(bright, image, surface) < count_at_edge(deep, image, surface);
    const bool smooth = !bright.known || (bright.step > kRough && deep.step < bright.step);
    if (deep.known && most && smooth) return deep;
  }
  const bool looked = unanswered_colour.count >= kLeastUnanswered * pixels;
  if (!looked || (bright.known && quantile_of(unanswered, kUnansweredShare) >= bright.level)) return bright;
  SkyLook alike = look_alike(unanswered_colour.median(), image, surface);
  alike.all = bright.all;
  alike.known = alike.known &&
                (is_blue(alike.colour) || (luma(alike.colour) * below_count > least_luma * below_sum &&
                                           !(bright.known && luma(alike.colour) < kDarkest * by_luma.high_mean))) &&
                !(bright.known && alike.step >= bright.step);
  return alike.known ? alike : bright;
}

// The row of a column's topmost measurement; the height where there is none.
[[nodiscard]] inline int topmost_measured(ImageView<const float> depth, int x) noexcept {
  int top = 0;
  while (top < depth.height() && !is_valid_depth(depth(x, top))) ++top;
  return top;
}

inline constexpr float kFarSky_m = 60.0F;         // networks end at 80 m or more
inline constexpr float kMismatchedSky_m = 25.0F;  // of stereo
inline constexpr int kWiresInWidth = 160;         // side by side
inline constexpr double kDense = 0.95;            // share of valid depth, of the picture and of its upper edge

[[nodiscard]] inline bool is_dense(ImageView<const float> depth) noexcept {
  const auto valid_in = [&](int rows) {
    double valid = 0;
    for (int y = 0; y < rows; ++y) {
      for (int x = 0; x < depth.width(); ++x) valid += is_valid_depth(depth(x, y)) ? 1.0 : 0.0;
    }
    return valid >= kDense * static_cast<double>(depth.width()) * static_cast<double>(rows);
  };
  return valid_in(1) && valid_in(depth.height());
}

// far: of the depth's values, whether the sky may have it. clouds: whether depth tells them from houses. False where
// nothing is told apart: `surface` says nothing.
template <class Far>
[[nodiscard]] bool find_sky_among_far(ImageView<const Rgb8> image, ImageView<const float> depth, const Far& far,
                                      bool clouds, ImageView<std::uint8_t> surface) noexcept {
  constexpr double kAsFar = 0.9;
  constexpr float kEvenDepth = 0.97F;      // of clouds, of the pixel beside it
  constexpr double kCloudAsFar = 0.8;      // of the sky's mean in 1 / z, which a few far pixels do not move
  constexpr double kCloudAsBright = 0.95;  // of the mean luma of what was found
  const Shape shape = surface.shape();
  const auto each = [&](const auto& f) {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) f(x, y);
    }
  };
  const auto is_far = [&](int x, int y) { return far(depth(x, y)); };
  each([&](int x, int y) { surface(x, y) = is_far(x, y) ? kSky : kSurface; });
  const SkyLook look = sky_look(image, surface, 0.0);
  const bool told = look.known || look.all;
  if (!told && !look.blue) return false;
  each([&](int x, int y) {
    const Rgb8 c = image(x, y);
    const bool like = is_far(x, y) && (told ? look.all || look.of(c) : is_blue(c));
    surface(x, y) = !like ? kSurface : (y == 0 ? kSky : kLike);
  });
  grow(surface, kSky, [](std::uint8_t c) { return c == kLike; });
  double sum = 0;
  double inverse_sum = 0;
  double luma_sum = 0;
  double count = 0;
  each([&](int x, int y) {
    if (surface(x, y) != kSky || !is_valid_depth(depth(x, y))) return;
    const auto z = static_cast<double>(depth(x, y));
    sum += z;
    inverse_sum += 1.0 / z;
    luma_sum += luma(image(x, y));
    count += 1;
  });
  each([&](int x, int y) {
    const bool as_far = count > 0 && static_cast<double>(depth(x, y)) * count >= kAsFar * sum;
    if (surface(x, y) == kLike) surface(x, y) = as_far ? kSky : kSurface;
  });
  if (clouds && count > 0) {
    grow_from(surface, kSky, [&](int x, int y, int from_x, int from_y) {
      const Rgb8 c = image(x, y);
      return surface(x, y) == kSurface && (is_blue(c) || luma(c) * count >= kCloudAsBright * luma_sum) &&
             difference(c, image(from_x, from_y)) <= kEvenSky &&
             static_cast<double>(depth(x, y)) * inverse_sum >= kCloudAsFar * count &&
             depth(x, y) >= kEvenDepth * depth(from_x, from_y);
    });
  }
  return true;
}

// Sky that thin things, such as wires, part from the sky above it, where it is of one colour with that; across what was
// measured only if `measured`. False: none.
[[nodiscard]] inline bool cross_wires(ImageView<const Rgb8> image, bool measured,
                                      ImageView<std::uint8_t> map) noexcept {
  constexpr int kOneColour = kEvenSky / 2;  // a front in the sun is seldom nearer to an overcast sky
  const int widest = std::max(1, map.width() / kWiresInWidth);
  bool any = false;
  for (int x = 0; x < map.width(); ++x) {
    int sky = -1;  // the lowest above
    for (int y = 0; y < map.height() && (measured || map(x, y) != kSurface); ++y) {
      if ((map(x, y) == kLike || map(x, y) == kGap) && sky >= 0 && y - sky <= widest + 1 &&
          difference(image(x, y), image(x, sky)) <= kOneColour) {
        map(x, y) = kSky;
        any = true;
      }
      if (map(x, y) == kSky) sky = y;
    }
  }
  return any;
}

// Rows that a laser leaves out between two answers to one side of a pixel: those of the `reach` columns beside it to
// the left, or to the right, and of its own. f(x, first row, end) is called of each such gap, in no order that matters.
template <class F>
void for_gaps(ImageView<const float> depth, int reach, bool to_the_left, Span<int> answered, const F& f) noexcept {
  for (int& row : answered) row = -1;  // the last that was, of each column's side
  const int last = depth.width() - 1;
  for (int y = 0; y < depth.height(); ++y) {
    int since = reach + 1;  // columns
    for (int i = 0; i <= last; ++i) {
      const int x = to_the_left ? i : last - i;
      since = is_valid_depth(depth(x, y)) ? 0 : since + 1;
      if (since > reach) continue;
      int& row = answered[static_cast<std::size_t>(x)];
      if (row >= 0) f(x, row + 1, y);
      row = y;
    }
  }
}

// What may be sky where a laser looked without an answer becomes kGap. rows: scratch, one per column.
inline void ask_gaps(const SkyLook& look, const GroundPlane& ground, const Intrinsics& camera,
                     ImageView<const Rgb8> image, ImageView<const float> depth, int reach, Span<int> rows,
                     ImageView<std::uint8_t> surface) noexcept {
  constexpr double kUsual = 0.75;        // of all gaps
  constexpr double kInSteepLines = 0.9;  // which answer in several rows of the columns
  constexpr int kLong = 3;               // times the usual one
  constexpr double kTail = 0.02;         // of the luma of what is sky for sure
  ByteHistogram gaps{}, sky{};
  const auto both = [&](const auto& f) {
    for (const bool left : {true, false}) for_gaps(depth, reach, left, rows, f);
  };
  both([&](int, int first, int end) { gaps[static_cast<std::size_t>(std::min(end - first, 255))] += 1; });
  int usual = quantile_of(gaps, kUsual);
  if (usual == 0) usual = quantile_of(gaps, kInSteepLines);
  const int most = kLong * max_of(usual, 1);
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      if (surface(x, y) == kSky) sky[static_cast<std::size_t>(luma(image(x, y)))] += 1;
    }
  }
  const int darkest = quantile_of(sky, kTail) - kEvenSky;
  const int brightest = quantile_of(sky, 1 - kTail) + kEvenSky;
  const auto may_be_sky = [&](int x, int y) {
    if (ground.inlier_share > 0.0F && fall_of_ray(ground, camera, x, y) > 0.0F) return false;
    const Rgb8 c = image(x, y);
    return look.known ? look.of(c) : luma(c) >= darkest && luma(c) <= brightest;
  };
  both([&](int x, int first, int end) {
    if (end - first <= most) return;
    for (int y = first; y < end; ++y) {
      if (surface(x, y) == kSurface && may_be_sky(x, y)) surface(x, y) = kGap;
    }
  });
}

// Whether hardly anything was called sky of what is missing at the top of columns, where that is a part of the picture
// and even, and hardly anything is missing of what was called sky: bright houses below a dark sky, say. Of a real sky
// nearly half is missing, and crowns that were not matched are rough.
[[nodiscard]] inline bool misses_what_is_missing(ImageView<const Rgb8> image, ImageView<const float> depth,
                                                 ImageView<const std::uint8_t> surface) noexcept {
  constexpr double kPart = 0.02;
  constexpr double kHardlyAny = 0.1;
  constexpr double kEvenStep = 4.0;  // codes from row to row
  double at_top = 0;
  double sky_at_top = 0;
  double steps = 0;
  double sky = 0;
  double missing_sky = 0;
  for (int x = 0; x < depth.width(); ++x) {
    const int top = topmost_measured(depth, x);
    if (top == depth.height()) continue;  // beside the other picture of a pair
    at_top += top;
    for (int y = 0; y < depth.height(); ++y) {
      const double is_sky = surface(x, y) == kSurface ? 0.0 : 1.0;
      sky += is_sky;
      missing_sky += is_valid_depth(depth(x, y)) ? 0.0 : is_sky;
      if (y >= top) continue;
      sky_at_top += is_sky;
      const int step = luma(image(x, y)) - luma(image(x, y > 0 ? y - 1 : 0));
      steps += step < 0 ? -step : step;
    }
  }
  return at_top > kPart * static_cast<double>(depth.shape().pixels()) && sky_at_top < kHardlyAny * at_top &&
         steps < kEvenStep * at_top && missing_sky < kHardlyAny * sky;
}

// Whether the ray of a pixel falls by more than a street climbs.
[[nodiscard]] inline bool falls_below_street(const GroundPlane& ground, const Intrinsics& camera, int x,
                                             int y) noexcept {
  constexpr float kClimb = 0.1F;
  return ground.inlier_share > 0.0F && fall_of_ray(ground, camera, x, y) > kClimb;
}

// What hangs together with no sky at the upper edge becomes surface, and what is seen by rays that fall below the
// street: strips that are missing at the sides of a rectified picture reach down to its lower edge.
inline void keep_sky_from_above(const GroundPlane& ground, const Intrinsics& camera,
                                ImageView<std::uint8_t> surface) noexcept {
  for (int y = 0; y < surface.height(); ++y) {
    for (int x = 0; x < surface.width(); ++x) {
      if (surface(x, y) == kSurface) continue;
      surface(x, y) = falls_below_street(ground, camera, x, y) ? kSurface : (y == 0 ? kSky : kLike);
    }
  }
  grow(surface, kSky, [](std::uint8_t c) { return c == kLike; });
  for (std::uint8_t& s : surface.pixels()) s = s == kSky ? kSky : kSurface;
}

// find_sky() wherever it looks so.
[[nodiscard]] inline Status find_what_looks_like_sky(const GroundPlane& ground, const Intrinsics& camera,
                                                     ImageView<const Rgb8> image, ImageView<const float> depth,
                                                     DepthSource source, const DepthNoise& noise,
                                                     ImageView<std::uint8_t> surface, Workspace& workspace) noexcept {
  if (is_dense(depth)) {
    if (find_sky_among_far(
            image, depth, [](float z) { return !(z < kFarSky_m); }, true, surface))
      return {};
    for (int y = 0; y < surface.height(); ++y) {
      for (int x = 0; x < surface.width(); ++x) surface(x, y) = kSurface;
    }
    return {};
  }
  const auto mismatched = [](float z) { return !is_valid_depth(z) || z > kMismatchedSky_m; };
  if (source == DepthSource::stereo && find_sky_among_far(image, depth, mismatched, false, surface) &&
      !misses_what_is_missing(image, depth, surface)) {
    return drop_matched_walls(image, depth, noise, surface, workspace);
  }
  const bool whole_areas = source == DepthSource::exact || source == DepthSource::network;
  constexpr int kReach = 8;
  constexpr double kDarkestSky = 0.5;
  const Shape shape = surface.shape();
  const WorkspaceScope scope(workspace);
  Span<int> topmost;  // measurement of each column
  NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(shape.width), topmost));
  for (int x = 0; x < shape.width; ++x) topmost[static_cast<std::size_t>(x)] = topmost_measured(depth, x);
  const auto topmost_in = [&](int from, int to) {
    int top = shape.height;
    for (int i = max_of(0, from); i < shape.width && i <= to; ++i) {
      top = std::min(top, topmost[static_cast<std::size_t>(i)]);
    }
    return top;
  };
  for (int x = 0; x < shape.width; ++x) {
    const int top = topmost_in(x - kReach, x + kReach);
    for (int y = 0; y < shape.height; ++y) {
      surface(x, y) = (whole_areas ? is_valid_depth(depth(x, y)) : y >= top) ? kSurface : kSky;
    }
  }
  const SkyLook look = sky_look(image, surface, kDarkestSky);
  const bool gaps = source == DepthSource::lidar;
  if (look.known) {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        if (surface(x, y) != kSurface) surface(x, y) = look.of(image(x, y)) ? kLike : kUnlike;
      }
    }
    NPSIM_RETURN_IF_ERROR(drop_walls(image, topmost, surface, workspace));
    for (int x = 0; x < shape.width; ++x) {
      const int open = max_of(topmost_in(x - kReach, x), topmost_in(x, x + kReach));  // to one side at least
      for (int y = 0; y < open; ++y) {
        if (surface(x, y) == kSurface && look.of(image(x, y))) surface(x, y) = kBeside;
      }
      if (surface(x, 0) == kLike) surface(x, 0) = kSky;
    }
  } else if (!gaps) {
    if (whole_areas) keep_sky_from_above(ground, camera, surface);
    return {};
  }
  const auto grow_evenly = [&](std::uint8_t into) {
    grow_from(surface, kSky, [&](int x, int y, int from_x, int from_y) {
      return surface(x, y) == into && difference(image(x, y), image(from_x, from_y)) <= kEvenSky;
    });
  };
  if (gaps) ask_gaps(look, ground, camera, image, depth, kReach, topmost, surface);
  do {
    grow(surface, kSky, [](std::uint8_t c) { return c == kLike; });
    if (gaps) grow_evenly(kGap);
  } while (cross_wires(image, whole_areas || gaps, surface));
  grow_evenly(kBeside);
  const std::uint8_t enclosed = source == DepthSource::exact && ground.inlier_share > 0.0F ? kSky : kLike;
  for (std::uint8_t& s : surface.pixels()) s = s == kBeside || s == kGap ? kSurface : (s == kLike ? enclosed : s);
  grow(surface, kSurface, [](std::uint8_t c) { return c == kLike || c == kUnlike; });
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) surface(x, y) = surface(x, y) == kSurface ? 1 : 0;
  }
  return {};
}

// What lies below the horizon by more than a street climbs, and hangs together with no sky at the upper edge, is none:
// the sun that a road mirrors is as bright, and what a pair of pictures matches there may lie as far. Beyond an edge,
// or where a bank was taken for the ground, the sky reaches down there from above.
inline void clear_sky_below_horizon(const GroundPlane& ground, const Intrinsics& camera,
                                    ImageView<std::uint8_t> surface) noexcept {
  if (!(ground.inlier_share > 0.0F)) return;
  for (int x = 0; x < surface.width(); ++x) {
    if (surface(x, 0) == kSky) surface(x, 0) = kLike;
  }
  grow(surface, kLike, [](std::uint8_t c) { return c == kSky; });
  for (int y = 0; y < surface.height(); ++y) {
    for (int x = 0; x < surface.width(); ++x) {
      const bool below = surface(x, y) == kSky && falls_below_street(ground, camera, x, y);
      surface(x, y) = below || surface(x, y) == kSurface ? kSurface : kSky;
    }
  }
}

}  // namespace depth_detail

[[nodiscard]] constexpr std::size_t find_sky_workspace_bytes(Shape shape) noexcept {
  return depth_detail::drop_walls_workspace_bytes(shape) +
         allocation_bytes<int>(static_cast<std::size_t>(shape.width)) + kWorkspaceAlignment;
}

// noise: of the depth. surface: 1 where there is one, 0 for the sky. All of one shape.
[[nodiscard]] inline Status find_sky(const GroundPlane& ground, const Intrinsics& camera, ImageView<const Rgb8> image,
                                     ImageView<const float> depth, DepthSource source, const DepthNoise& noise,
                                     ImageView<std::uint8_t> surface, Workspace& workspace) noexcept {
  NPSIM_RETURN_IF_ERROR(
      depth_detail::find_what_looks_like_sky(ground, camera, image, depth, source, noise, surface, workspace));
  depth_detail::clear_sky_below_horizon(ground, camera, surface);
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_SKY_HPP
