// SPDX-License-Identifier: Apache-2.0
// Gives back to walls and to the sky what the outlines of plants have taken of them.
//
// Labels of plants are drawn as polygons around twigs, and take in the wall and the sky between and beside these. At
// night that is a smooth blob with an edge: wall that is lit as leaves are, and leaves as bright as the day's sky. By
// the picture the two are told apart: within reach_px of a class that lies behind plants, a plant's pixel is of that
// class where its look is more likely there than among leaves.
//
// The look is four numbers: Y = (R + 2 G + B) / 4, R - G and (R + G) / 2 - B of the 8-bit picture, in percent, and
// 8 log2(1 + s), s the standard deviation of Y, in percent, over 5 x 5 samples about the pixel (walls are smooth,
// leaves are not). Each side is a Gaussian with a diagonal covariance, of its pixels nearby: tiles of half the reach
// are summed over 5 x 5 of them, which are interpolated linearly at a pixel. Leaves within a third of the reach of the
// other class hardly count: they are what is in doubt. A pixel changes sides where
//   log p(look | behind) - log p(look | leaves) > margin;
// what joins a wall must hang together with it, and what joins the sky must be at least bright_share as bright. Where
// the outline of a wall is so long that it was not drawn but follows every leaf (most_outline), nothing joins it.
// Invariant: labels of other classes, pixels of marked lamps, and plants beyond the reach stay. The same bits for any
// thread count.
// Cost: 25 samples per pixel of plants and of what lies behind them, and about 100 operations per pixel in doubt and
// class. Memory: plant_outlines_workspace_bytes().
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_PLANT_OUTLINES_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_PLANT_OUTLINES_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/grow.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct PlantOutlinesParams {
  float reach_px = 28.0F;  // at 960 px width; 0 switches the step off
  float margin = 0.5F;     // natural logarithm
  float bright_share = 0.75F;
  float most_outline = 2.5F;  // length of a drawn outline, in widths of the surroundings; longer: it follows the leaves
};

[[nodiscard]] inline Status validate(const PlantOutlinesParams& p) noexcept {
  const bool good =
      p.reach_px >= 0.0F && p.reach_px <= 48.0F && p.margin >= 0.0F && p.bright_share >= 0.0F && p.most_outline >= 0.0F;
  return good ? Status()
              : Status(StatusCode::invalid_argument,
                       "plant outlines: reach in 0..48 px; margin, share of brightness and outline not negative");
}

namespace depth_detail {

// What lies behind plants.
inline constexpr std::array<Label, 3> kBehindPlants = {label::building, label::wall, label::sky};
inline constexpr LabelSet kPlantsAndBehind = LabelSet::of(label::vegetation, label::building, label::wall, label::sky);

// Sizes for an image of this width.
struct PlantScale {
  int reach = 1;    // px
  int tile = 1;     // px
  int spacing = 1;  // of the 5 x 5 samples
  int smooth = 0;   // radius over which odds are averaged: leaves are wider in a larger picture

  constexpr PlantScale(const PlantOutlinesParams& p, int width) noexcept {
    const float scale = static_cast<float>(width) / 960.0F;
    reach = static_cast<int>(clamp_to(p.reach_px * scale, 1.0F, 250.0F));
    tile = max_of(reach / 2, 1);
    spacing = max_of(1, static_cast<int>(scale + 0.5F));
    smooth = spacing - 1;
  }
  [[nodiscard]] constexpr int tiles(int px) const noexcept { return (px + tile - 1) / tile; }
};

inline constexpr int kLooks = 4;
using Look = std::array<float, kLooks>;

struct LookMoments {
  float count = 0;
  Look sum{};
  Look squares{};

  void add(const Look& look, float weight) noexcept {
    count += weight;
    for (std::size_t i = 0; i < kLooks; ++i) {
      sum[i] += weight * look[i];
      squares[i] += weight * look[i] * look[i];
    }
  }
  void add(const LookMoments& m, float weight) noexcept {
    count += weight * m.count;
    for (std::size_t i = 0; i < kLooks; ++i) {
      sum[i] += weight * m.sum[i];
      squares[i] += weight * m.squares[i];
    }
  }
  // But for a constant.
  [[nodiscard]] float log_likelihood(const Look& look) const noexcept {
    constexpr float kLeastVariance = 4.0F;  // of 8 bits, compression and blur
    float log_p = 0;
    for (std::size_t i = 0; i < kLooks; ++i) {
      const float mean = sum[i] / count;
      const float variance = max_of(squares[i] / count - mean * mean, kLeastVariance);
      const float off = look[i] - mean;
      log_p -= 0.5F * (off * off / variance + std::log(variance));
    }
    return log_p;
  }
};

struct TwoLooks {
  LookMoments leaves;
  LookMoments behind;
  float outline_px = 0;  // leaves that touch what is behind

  void add(const TwoLooks& more, float weight) noexcept {
    leaves.add(more.leaves, weight);
    behind.add(more.behind, weight);
    outline_px += weight * more.outline_px;
  }
};

// Steps along rows and columns to the nearest pixel of a class, at most 255.
inline void steps_to(ImageView<const Label> labels, Label of, ImageView<std::uint8_t> steps) noexcept {
  for (int y = 0; y < steps.height(); ++y) {
    for (int x = 0; x < steps.width(); ++x) steps(x, y) = labels(x, y) == of ? 0 : 255;
  }
  sweep_to_and_fro(steps.shape(), [&](int x, int y, int from_x, int from_y) {
    const int over = steps(from_x, from_y) + 1;
    if (over < steps(x, y)) steps(x, y) = static_cast<std::uint8_t>(over);
  });
}

class PlantMatter {
 public:
  PlantMatter(const PlantOutlinesParams& params, ImageView<const Rgb8> image, ImageView<const Label> labels,
              ImageView<const std::uint16_t> marks) noexcept
      : params_(params), scale_(params, image.width()), image_(image), labels_(labels), marks_(marks) {}

  [[nodiscard]] Status allocate(Workspace& workspace) noexcept {
    const Shape shape = image_.shape();
    across_ = scale_.tiles(shape.width);
    down_ = scale_.tiles(shape.height);
    const std::size_t tiles = static_cast<std::size_t>(across_) * static_cast<std::size_t>(down_);
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, contrast_));
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, steps_));
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, odds_));
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, best_));
    NPSIM_RETURN_IF_ERROR(workspace.allocate(tiles, tile_looks_));
    return workspace.allocate(tiles, looks_);
  }

  template <class Executor>
  void run(ImageView<Label> out, Executor& executor) noexcept {
    copy_pixels(labels_, out);
    for (std::uint8_t& b : best_.pixels()) b = 0;
    for_rows(executor, image_.height(), [&](int y) {
      for (int x = 0; x < image_.width(); ++x) {
        contrast_(x, y) = kPlantsAndBehind.contains(labels_(x, y)) ? contrast(x, y) : std::uint8_t{0};
      }
    });
    for (const Label behind : kBehindPlants) {
      steps_to(labels_, behind, steps_);
      gather(behind, executor);
      weigh(behind, executor);
      choose(behind, out, executor);
      give(behind, out);
    }
  }

 private:
  // In steps_, once the steps have served: pixels of what lies behind, and those that may be given to it.
  static constexpr std::uint8_t kOther = 0;
  static constexpr std::uint8_t kBehind = 1;
  static constexpr std::uint8_t kChosen = 2;
  static constexpr float kOddsUnit = 0.0625F;  // of one step of the log likelihoods that are kept
  static constexpr float kDoubtful = 0.05F;    // weight of leaves near the other class

  [[nodiscard]] float brightness(int x, int y) const noexcept {
    const Rgb8 c = image_(x, y);
    return static_cast<float>(c.r + 2 * c.g + c.b) * (100.0F / 1020.0F);
  }
  // 8 log2(1 + s) in quarters.
  [[nodiscard]] std::uint8_t contrast(int x, int y) const noexcept {
    float sum = 0;
    float squares = 0;
    for (int j = -2; j <= 2; ++j) {
      const int v = clamp_to(y + j * scale_.spacing, 0, image_.height() - 1);
      for (int i = -2; i <= 2; ++i) {
        const float b = brightness(clamp_to(x + i * scale_.spacing, 0, image_.width() - 1), v);
        sum += b;
        squares += b * b;
      }
    }
    const float mean = sum / 25.0F;
    const float deviation = std::sqrt(max_of(squares / 25.0F - mean * mean, 0.0F));
    return static_cast<std::uint8_t>(32.0F * std::log2(1.0F + deviation) + 0.5F);
  }
  [[nodiscard]] Look look(int x, int y) const noexcept {
    const Rgb8 c = image_(x, y);
    return {brightness(x, y), static_cast<float>(c.r - c.g) * (100.0F / 255.0F),
            static_cast<float>(c.r + c.g - 2 * c.b) * (50.0F / 255.0F), 0.25F * static_cast<float>(contrast_(x, y))};
  }

  [[nodiscard]] std::size_t tile_index(int i, int j) const noexcept {
    return static_cast<std::size_t>(j) * static_cast<std::size_t>(across_) + static_cast<std::size_t>(i);
  }

  // Both sides' looks, tile by tile, then of each tile's surroundings.
  template <class Executor>
  void gather(Label behind, Executor& executor) noexcept {
    for_rows(executor, down_, [&](int j) {
      for (int i = 0; i < across_; ++i) tile_looks_[tile_index(i, j)] = {};
      const int end = std::min((j + 1) * scale_.tile, image_.height());
      for (int y = j * scale_.tile; y < end; ++y) {
        for (int x = 0; x < image_.width(); ++x) {
          const Label l = labels_(x, y);
          TwoLooks& tile = tile_looks_[tile_index(x / scale_.tile, j)];
          if (l == behind) tile.behind.add(look(x, y), 1.0F);
          if (l != label::vegetation) continue;
          tile.leaves.add(look(x, y), 3 * steps_(x, y) > scale_.reach ? 1.0F : kDoubtful);
          if (steps_(x, y) == 1) tile.outline_px += 1.0F;
        }
      }
    });
    for_rows(executor, down_, [&](int j) {
      for (int i = 0; i < across_; ++i) {
        TwoLooks sum;
        for (int v = max_of(j - 2, 0); v <= std::min(j + 2, down_ - 1); ++v) {
          for (int u = max_of(i - 2, 0); u <= std::min(i + 2, across_ - 1); ++u) {
            sum.add(tile_looks_[tile_index(u, v)], 1.0F);
          }
        }
        looks_[tile_index(i, j)] = sum;
      }
    });
  }

  [[nodiscard]] TwoLooks looks_about(int x, int y) const noexcept {
    const auto place = [&](int at, int tiles, int& first) {
      const float f = (static_cast<float>(at) + 0.5F) / static_cast<float>(scale_.tile) - 0.5F;
      first = static_cast<int>(std::floor(f));
      const float part = f - static_cast<float>(first);
      return first < 0 ? 1.0F : (first + 1 >= tiles ? 0.0F : part);
    };
    int i = 0;
    int j = 0;
    const float u = place(x, across_, i);
    const float v = place(y, down_, j);
    TwoLooks sum;
    for (int dj = 0; dj < 2; ++dj) {
      for (int di = 0; di < 2; ++di) {
        const float weight = (di == 0 ? 1.0F - u : u) * (dj == 0 ? 1.0F - v : v);
        if (!(weight > 0.0F)) continue;
        sum.add(looks_[tile_index(i + di, j + dj)], weight);
      }
    }
    return sum;
  }

  // As bright as the sky there, and that is much brighter than the darker leaves: before dark clouds, and where a stray
  // label says sky, nothing can be told.
  [[nodiscard]] bool could_be_sky(const Look& here, const TwoLooks& about) const noexcept {
    constexpr float kBrighter = 1.5F;
    const float sky = about.behind.sum[0] / about.behind.count;
    const float leaves = about.leaves.sum[0] / about.leaves.count;
    const float variance = about.leaves.squares[0] / about.leaves.count - leaves * leaves;
    return sky > kBrighter * (leaves - std::sqrt(max_of(variance, 0.0F))) && here[0] >= params_.bright_share * sky;
  }

  // By how much more a pixel looks like what is behind, in units of kOddsUnit, about 128; 0: not in doubt.
  template <class Executor>
  void weigh(Label behind, Executor& executor) noexcept {
    const float least = 0.25F * static_cast<float>(scale_.tile * scale_.tile);  // pixels of either side: 1 % of 5 x 5
    for_rows(executor, image_.height(), [&](int y) {
      for (int x = 0; x < image_.width(); ++x) {
        odds_(x, y) = 0;
        const bool doubtful = labels_(x, y) == label::vegetation && steps_(x, y) <= scale_.reach;
        if (!doubtful || (!marks_.empty() && marks_(x, y) != 0)) continue;
        const TwoLooks about = looks_about(x, y);
        if (!(about.leaves.count > least * kDoubtful) || !(about.behind.count > least)) continue;
        const bool follows_leaves = about.outline_px > params_.most_outline * static_cast<float>(5 * scale_.tile);
        if (behind != label::sky && follows_leaves) continue;
        const Look here = look(x, y);
        float odds = about.behind.log_likelihood(here) - about.leaves.log_likelihood(here);
        if (behind == label::sky && !could_be_sky(here, about)) odds = -8.0F;
        odds_(x, y) = static_cast<std::uint8_t>(128.5F + clamp_to(odds, -7.9F, 7.9F) / kOddsUnit);
      }
    });
  }

  // Pixels whose odds, averaged over those in doubt around, exceed the margin: for a wall if no other has them, for the
  // sky if the odds of the wall that has them are no greater.
  template <class Executor>
  void choose(Label behind, ImageView<const Label> out, Executor& executor) noexcept {
    for_rows(executor, image_.height(), [&](int y) {
      for (int x = 0; x < image_.width(); ++x) {
        steps_(x, y) = labels_(x, y) == behind ? kBehind : kOther;
        if (odds_(x, y) == 0) continue;
        int sum = 0;
        int count = 0;
        for (int v = max_of(y - scale_.smooth, 0); v <= std::min(y + scale_.smooth, image_.height() - 1); ++v) {
          for (int u = max_of(x - scale_.smooth, 0); u <= std::min(x + scale_.smooth, image_.width() - 1); ++u) {
            if (odds_(u, v) == 0) continue;
            sum += odds_(u, v) - 128;
            ++count;
          }
        }
        const float odds = kOddsUnit * static_cast<float>(sum) / static_cast<float>(count);
        if (!(odds > params_.margin)) continue;
        const auto kept = static_cast<std::uint8_t>(odds / kOddsUnit);
        if (behind == label::sky ? kept < best_(x, y) : out(x, y) != label::vegetation) continue;
        best_(x, y) = kept;
        steps_(x, y) = kChosen;
      }
    });
  }

  // Those chosen for the sky, and those that hang together with the wall that they were chosen for.
  void give(Label behind, ImageView<Label> out) noexcept {
    if (behind != label::sky) grow(steps_, kBehind, [](std::uint8_t at) { return at == kChosen; });
    const std::uint8_t given = behind == label::sky ? kChosen : kBehind;
    for (int y = 0; y < out.height(); ++y) {
      for (int x = 0; x < out.width(); ++x) {
        if (steps_(x, y) == given) {
          out(x, y) = behind;
        } else if (steps_(x, y) == kChosen) {
          best_(x, y) = 0;
        }
      }
    }
  }

  const PlantOutlinesParams& params_;
  PlantScale scale_;
  ImageView<const Rgb8> image_;
  ImageView<const Label> labels_;
  ImageView<const std::uint16_t> marks_;
  int across_ = 0;
  int down_ = 0;
  ImageView<std::uint8_t> contrast_;
  ImageView<std::uint8_t> steps_;
  ImageView<std::uint8_t> odds_;
  ImageView<std::uint8_t> best_;  // odds of the class that a pixel was given to
  Span<TwoLooks> tile_looks_;
  Span<TwoLooks> looks_;
};

}  // namespace depth_detail

[[nodiscard]] constexpr std::size_t plant_outlines_workspace_bytes(const PlantOutlinesParams& p, Shape shape) noexcept {
  if (!(p.reach_px > 0.0F)) return 0;
  const depth_detail::PlantScale scale(p, shape.width);
  const auto tiles =
      static_cast<std::size_t>(scale.tiles(shape.width)) * static_cast<std::size_t>(scale.tiles(shape.height));
  return 4 * allocation_bytes<std::uint8_t>(shape.pixels()) + 2 * allocation_bytes<depth_detail::TwoLooks>(tiles) +
         kWorkspaceAlignment;
}

// marks: not 0 where a lamp is marked; may be empty. out: labels, all of one shape; not the same memory as labels.
template <class Executor>
[[nodiscard]] Status clear_plant_outlines(const PlantOutlinesParams& params, ImageView<const Rgb8> image,
                                          ImageView<const Label> labels, ImageView<const std::uint16_t> marks,
                                          ImageView<Label> out, Workspace& workspace, Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  const Shape shape = image.shape();
  if (labels.shape() != shape || out.shape() != shape || !(marks.empty() || marks.shape() == shape)) {
    return {StatusCode::shape_mismatch, "plant outlines: all planes must have one shape"};
  }
  if (!(params.reach_px > 0.0F)) {
    copy_pixels(labels, out);
    return {};
  }
  const WorkspaceScope scope(workspace);
  NPSIM_RETURN_IF_ERROR(workspace.ensure(plant_outlines_workspace_bytes(params, shape)));
  depth_detail::PlantMatter matter(params, image, labels, marks);
  NPSIM_RETURN_IF_ERROR(matter.allocate(workspace));
  matter.run(out, executor);
  return {};
}

namespace depth_detail {

// What was measured of pixels that were given to what lies behind a plant or a sign.
struct OutlineDepth {
  ImageView<const Label> drawn;   // the labels before
  ImageView<const Label> labels;  // and after
  ImageView<const float> depth;
  int reach;  // twice that of the outlines, and at least a 64th of the width, for signs

  OutlineDepth(const PlantOutlinesParams& params, ImageView<const Label> before, ImageView<const Label> after,
               ImageView<const float> measured) noexcept
      : drawn(before),
        labels(after),
        depth(measured),
        reach(max_of(2 * PlantScale(params, depth.width()).reach, depth.width() / 64)) {}

  // Mean 1/z of the first pixels to the left, right, above and below that have kept a label; 0: there are none.
  [[nodiscard]] float of(Label label, int x, int y) const noexcept {
    constexpr int kSides[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
    float sum = 0;
    float count = 0;
    for (const auto& side : kSides) {
      for (int k = 1; k <= reach; ++k) {
        const int u = x + k * side[0];
        const int v = y + k * side[1];
        if (!drawn.contains(u, v)) break;
        if (drawn(u, v) != label || labels(u, v) != label || !is_valid_depth(depth(u, v))) continue;
        sum += 1.0F / depth(u, v);
        count += 1.0F;
        break;
      }
    }
    return count > 0.0F ? sum / count : 0.0F;
  }

  enum class Place { unknown, in_front, behind, no_wall };
  [[nodiscard]] Place at(int x, int y) const noexcept {
    if (drawn(x, y) == labels(x, y) || !is_valid_depth(depth(x, y))) return Place::unknown;
    const float w = 1.0F / depth(x, y);
    const float front = of(drawn(x, y), x, y);
    const float wall = of(labels(x, y), x, y);
    if (!(wall > 0.0F)) return Place::no_wall;
    return front > 0.0F && std::fabs(w - front) < std::fabs(w - wall) ? Place::in_front : Place::behind;
  }
};

}  // namespace depth_detail

// A laser tells a trunk from the wall behind it, as dark as it may be, and leaves from the sky: where what was measured
// is nearer to the plant than to the wall that it was given to, or was given to the sky, the plant has it again, and its
// own pixels within 4 px of a width of 960, as beams lie apart. drawn: the labels before. labels: after, changed in
// place.
template <class Executor>
[[nodiscard]] Status keep_measured_plants(const PlantOutlinesParams& params, ImageView<const Label> drawn,
                                          ImageView<const float> depth, ImageView<Label> labels, Workspace& workspace,
                                          Executor& executor) noexcept {
  using Place = depth_detail::OutlineDepth::Place;
  constexpr float kAround_px = 4.0F;
  const Shape shape = depth.shape();
  const WorkspaceScope scope(workspace);
  ImageView<std::uint8_t> measured;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, measured));
  const depth_detail::OutlineDepth outline(params, drawn, labels, depth);
  for_rows(executor, shape.height, [&](int y) {
    for (int x = 0; x < shape.width; ++x) {
      const Place place = drawn(x, y) == label::vegetation ? outline.at(x, y) : Place::unknown;
      const bool before_sky = place == Place::no_wall && labels(x, y) == label::sky;
      measured(x, y) = place == Place::in_front || before_sky ? 1 : 0;
    }
  });
  const int around = static_cast<int>(kAround_px * static_cast<float>(shape.width) / 960.0F + 0.5F);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (measured(x, y) == 0) continue;
      for (int v = y - around; v <= y + around; ++v) {
        for (int u = x - around; u <= x + around; ++u) {
          if (labels.contains(u, v) && drawn(u, v) == label::vegetation) labels(u, v) = label::vegetation;
        }
      }
    }
  }
  return {};
}

// Drops the depth of what was given to a wall where it is that of the leaves or the sign before it: nearer to theirs
// than to that of the wall; without a wall in any case. drawn: the labels before. kept: depth, changed in place.
template <class Executor>
void drop_depth_of_outlines(const PlantOutlinesParams& params, ImageView<const Label> drawn,
                            ImageView<const Label> labels, ImageView<const float> depth, ImageView<float> kept,
                            Executor& executor) noexcept {
  using Place = depth_detail::OutlineDepth::Place;
  const depth_detail::OutlineDepth outline(params, drawn, labels, depth);
  for_rows(executor, depth.height(), [&](int y) {
    for (int x = 0; x < depth.width(); ++x) {
      const Place place = outline.at(x, y);
      if (place == Place::in_front || place == Place::no_wall) kept(x, y) = 0.0F;
    }
  });
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_PLANT_OUTLINES_HPP
