// SPDX-License-Identifier: Apache-2.0
// Houses where a laser measured nothing of them: above its rows, and beyond its range.
//
// A laser sees some 100 m far and a few degrees up. What fills its gaps continues the nearest house into all that is
// left, and a tower at the end of the street comes to stand beside its lamps. Two bounds say better, column by column
// of the image:
//   measured: houses stand upright, and what looks out above one stands behind it: above its topmost sample nothing is
//     nearer than kUpright of the lower quartile of what was measured in the column.
//   not measured: something else ends the houses below. It hides their feet, so it is nearer than they are. Columns
//     side by side show one place, and the farthest such bound within 1/16 of the image to either side holds for all of
//     those between two measured columns; it is at most the largest measured depth.
// A column is measured where kFewest samples or more lie on houses: single ones are often of something else, which the
// laser sees past its edge. Of sparse lasers some columns count as one.
//
// Invariant: measured depth and that of other labels is not touched, and none becomes smaller.
// Error: what is nearer above than below, as an arch, a low house before a tall one where more was measured of that,
// and a house all hidden beside something far, become too far. On eight generated streets with a scanner of 64 rows, of
// the unmeasured pixels of buildings depth less than half the true one falls from 9.3 to 1.2 %, and more than twice the
// true one from .53 to .37 %.
// Deterministic. Cost: three passes, and an eighth of its width for each column. Memory: 12 bytes a column, 1 KiB of
// stack.
#ifndef NPSIM_DEPTH_DETAIL_MEASURED_BEYOND_RANGE_HPP
#define NPSIM_DEPTH_DETAIL_MEASURED_BEYOND_RANGE_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct BeyondRangeParams {
  bool enabled = true;
  LabelSet houses = kHouseLabels;
};

namespace beyond_detail {

enum class Houses : std::uint8_t { none, measured, hidden };

struct Column {
  float least_m = 0.0F;  // depth of its houses
  int above = 0;         // in rows less than this
  Houses houses = Houses::none;
};

inline constexpr float kUpright = 0.95F;  // balconies and bays stand out
inline constexpr std::size_t kFewest = 3;
inline constexpr std::size_t kPerStrip = 40;  // measured pixels of any label that a strip of columns holds on average

struct Scene {
  LabelSet houses;
  ImageView<const float> measured;
  ImageView<const Label> labels;
  ImageView<const float> depth;

  [[nodiscard]] bool is_house(int x, int y) const noexcept { return houses.contains(labels(x, y)); }
};

// Lower quartile of what was measured of houses in columns [first, last), from a number of samples spread over them:
// a strip may hold the border of two houses.
[[nodiscard]] inline float depth_of_houses(const Scene& s, int first, int last, std::size_t count) noexcept {
  constexpr std::size_t kMost = 256;
  float samples[kMost];
  const std::size_t step = 1 + (count - 1) / kMost;
  std::size_t seen = 0;
  std::size_t n = 0;
  for (int y = 0; y < s.depth.height(); ++y) {
    for (int x = first; x < last; ++x) {
      if (s.is_house(x, y) && is_valid_depth(s.measured(x, y)) && seen++ % step == 0) samples[n++] = s.measured(x, y);
    }
  }
  select_nth(samples, samples + n / 4, samples + n);
  return samples[n / 4];
}

// Depth of what ends the houses of a column below; 0: nothing does.
[[nodiscard]] inline float depth_before_houses(const Scene& s, int x) noexcept {
  constexpr int kRim_px = 3;  // pixels of an outline may have the depth of what is behind it
  const int height = s.depth.height();
  int lowest = height;
  while (lowest > 0 && !s.is_house(x, lowest - 1)) --lowest;
  float before = 0.0F;
  for (int y = lowest; lowest > 0 && y < std::min(height, lowest + kRim_px); ++y) {
    if (is_valid_depth(s.depth(x, y))) before = max_of(before, s.depth(x, y));
  }
  return before;
}

// Columns [first, last) as one.
[[nodiscard]] inline Column look_at_strip(const Scene& s, int first, int last, float farthest_m) noexcept {
  const int height = s.depth.height();
  std::size_t pixels = 0;
  std::size_t samples = 0;
  int topmost = height;
  for (int y = 0; y < height; ++y) {
    for (int x = first; x < last; ++x) {
      if (!s.is_house(x, y)) continue;
      ++pixels;
      if (!is_valid_depth(s.measured(x, y))) continue;
      ++samples;
      topmost = std::min(topmost, y);
    }
  }
  if (pixels == 0) return {};
  if (samples >= kFewest) return {kUpright * depth_of_houses(s, first, last, samples), topmost, Houses::measured};
  float before = 0.0F;
  for (int x = first; x < last; ++x) before = max_of(before, depth_before_houses(s, x));
  return {before < farthest_m ? before : farthest_m, height, Houses::hidden};
}

}  // namespace beyond_detail

[[nodiscard]] constexpr std::size_t place_beyond_range_workspace_bytes(Shape shape) noexcept {
  return allocation_bytes<beyond_detail::Column>(static_cast<std::size_t>(shape.width)) + kWorkspaceAlignment;
}

// measured: m, 0 where nothing was. depth: filled. labels: empty, and nothing changes.
[[nodiscard]] inline Status place_beyond_range(const BeyondRangeParams& params, ImageView<const float> measured,
                                               ImageView<const Label> labels, ImageView<float> depth,
                                               Workspace& workspace) noexcept {
  using namespace beyond_detail;  // NOLINT(google-build-using-namespace)
  const Shape shape = depth.shape();
  if (measured.shape() != shape || (!labels.empty() && labels.shape() != shape)) {
    return {StatusCode::shape_mismatch, "beyond range: depth, what was measured and labels must have one shape"};
  }
  if (!params.enabled || labels.empty()) return {};
  std::size_t samples = 0;
  float farthest_m = 0.0F;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (!is_valid_depth(measured(x, y))) continue;
      ++samples;
      farthest_m = max_of(farthest_m, measured(x, y));
    }
  }
  if (samples == 0) return {};
  const WorkspaceScope scope(workspace);
  Span<Column> columns;
  const auto width = static_cast<std::size_t>(shape.width);
  NPSIM_RETURN_IF_ERROR(workspace.allocate(width, columns));
  const std::size_t strip = std::min(width, 1 + (kPerStrip * width - 1) / samples);
  const Scene scene{params.houses, measured, labels, depth};
  for (std::size_t first = 0; first < width; first += strip) {
    const std::size_t last = std::min(width, first + strip);
    const Column seen = look_at_strip(scene, static_cast<int>(first), static_cast<int>(last), farthest_m);
    for (std::size_t x = first; x < last; ++x) columns[x] = seen;
  }
  const std::size_t reach = std::max(strip, width / 16);
  for (std::size_t column = 0; column < width; ++column) {
    const Column& here = columns[column];
    if (here.houses == Houses::none) continue;
    float least_m = here.least_m;
    if (here.houses == Houses::hidden) {
      const auto hidden = [&](std::size_t i) { return i < width && columns[i].houses == Houses::hidden; };
      for (std::size_t i = column; i + reach > column && hidden(i - 1); --i) {
        least_m = max_of(least_m, columns[i - 1].least_m);
      }
      for (std::size_t i = column + 1; i <= column + reach && hidden(i); ++i) {
        least_m = max_of(least_m, columns[i].least_m);
      }
    }
    const auto x = static_cast<int>(column);
    for (int y = 0; y < here.above; ++y) {
      const bool filled = scene.is_house(x, y) && is_valid_depth(depth(x, y)) && !is_valid_depth(measured(x, y));
      if (filled && depth(x, y) < least_m) depth(x, y) = least_m;
    }
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_MEASURED_BEYOND_RANGE_HPP
