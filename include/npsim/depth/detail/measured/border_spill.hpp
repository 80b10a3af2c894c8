// SPDX-License-Identifier: Apache-2.0
// Finds the depth of near objects that sensors spill over their borders, onto what is behind them.
//
// A window that straddles the border of a pole finds the pole's disparity, so for half a window beyond the border the
// wall stands where the pole does. And beside the border that the other camera looks past, on the left for the left
// image, there is a band that it does not see, as wide as the two disparities differ: what matching found in it is a
// guess. As a measurement nothing can be said against such depth but by the labels; a surface made of it is a board
// beside each pole, which is lit as the pole is and throws a shadow that is too wide. A laser's beam that meets a
// border answers from the near object, and sweeps that were put together smear a pole over half its width and more.
//
// Along a row or a column, beside a border between two objects: the near one is as near as the median of its own
// inverse depths within `reach` of the border; the far one goes on along the line through two medians of its inverse
// depths, over the first `reach` samples beyond the reach and over as many behind those. In the hidden band these begin
// beyond the widest band that the near object can have, and where the far object has none there, which a sliver of wall
// between two poles has not, a median beyond the near object stands in; what is as short as the top of a mast behind
// a car is known by what it has beyond half the reach. Of the ground it is the ground plane that goes on, or beside a
// house, and of a laser always, where the first of these medians lies higher, as a pavement does, its parallel through
// that.
// Where the near one is more than `contrast` times the far one, samples of the far object within the reach, or in the
// band, that lie nearer to the near object than to their own are spilled. Objects of which six reaches hold less than
// half of these samples are left. Of a laser the medians are taken over `lines` on either side as well, for a row has
// few samples, or none of a pole; and its ground is told along rows alone, for where a thing ends below, it is as far
// away as the ground there.
// Down a column, below what stands on it, the ground is dark, and matching carries the depth of a bumper or a foot
// further down: there the ground goes on in parallel to the ground plane, through the median of one reach of samples
// farther down, and what is nearer than that by more than `under_px` within `under_reaches` is spilled. (On
// three photographs by a stereo camera of .17 px of noise the excess is 1.5 to 3.4 px at the upper quartile and is gone
// after 20 to 30 rows.) But a house stands on its ground: below one it is at least as near as the line to the house's
// foot, the median of a reach above the border, for pavements rise to it. Of a laser what is as near there as the thing
// above is the thing's where ground below is farther off: labels end where the dark below a car begins.
// Cost: about 15 ns per pixel, of a laser 40; where near things stand side by side before a house, the widest band for
// each. Memory: 1 KiB of stack.
#ifndef NPSIM_DEPTH_DETAIL_MEASURED_BORDER_SPILL_HPP
#define NPSIM_DEPTH_DETAIL_MEASURED_BORDER_SPILL_HPP

#include <algorithm>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/depth/detail/object_borders.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct BorderSpillParams {
  int reach_px = 7;  // half a window of the matching; 0 switches the step off; at most 128
  int lines = 0;     // of a sparse sensor: medians are taken over so many rows or columns on either side too; at most 8
  float contrast = 1.2F;
  int under_reaches = 3;   // below what stands on the ground; 0 switches that off
  float under_px = 0.7F;   // of disparity, nearer than the ground farther down
  float farther = 1.025F;  // of a laser: ground further down the picture, times its depth
  LabelSet ground = kGroundLabels;
  LabelSet paved = LabelSet::of(label::road, label::sidewalk, label::parking, label::ground);  // lies in the plane
  LabelSet behind = kHouseLabels;  // go on behind what stands before them

  // Of a laser's noise: what lies nearer than the ground farther off by a twentieth is not of it.
  [[nodiscard]] static constexpr BorderSpillParams laser() noexcept {
    BorderSpillParams p;
    p.reach_px = 10;
    p.lines = 3;
    p.contrast = 1.05F;
    return p;
  }
};

[[nodiscard]] inline Status validate(const BorderSpillParams& p) noexcept {
  const bool good = p.reach_px >= 0 && p.reach_px <= 128 && p.lines >= 0 && p.lines <= 8 && p.contrast >= 1.0F &&
                    p.under_reaches >= 0 && p.under_reaches <= 16 && p.under_px >= 0.0F &&
                    p.farther >= 1.0F;  // false for NaN
  if (good) return {};
  return {StatusCode::invalid_argument,
          "border spill: reach in 0..128, lines in 0..8, contrast and farther at least 1, reaches under things in "
          "0..16, their px not negative"};
}

// How the scene was seen.
struct SpillView {
  Intrinsics camera;
  GroundPlane ground;                // without inliers: not known, and the ground is left
  float focal_baseline_px_m = 0.0F;  // of the stereo pair, disparity times depth; 0: not known
};

namespace depth_detail {

// A row or a column.
struct SpillLine {
  const BorderSpillParams& params;
  ImageView<const float> depth_m;
  const ObjectMap& objects;
  const SpillView& view;
  ImageView<float> kept;
  bool column;
  int at;

  [[nodiscard]] int size() const noexcept { return column ? depth_m.height() : depth_m.width(); }
  [[nodiscard]] int x(int i) const noexcept { return column ? at : i; }
  [[nodiscard]] int y(int i) const noexcept { return column ? i : at; }
  [[nodiscard]] bool inside(int i) const noexcept { return i >= 0 && i < size(); }
  [[nodiscard]] bool same(int i, int j) const noexcept { return inside(i) && objects.same(x(i), y(i), x(j), y(j)); }
  [[nodiscard]] bool is_ground(int i) const noexcept { return params.ground.contains(objects.labels(x(i), y(i))); }
  [[nodiscard]] bool is_paved(int i) const noexcept { return params.paved.contains(objects.labels(x(i), y(i))); }
  [[nodiscard]] bool goes_on_behind(int i) const noexcept { return params.behind.contains(objects.labels(x(i), y(i))); }
  [[nodiscard]] bool matched() const noexcept { return view.focal_baseline_px_m > 0.0F; }
  [[nodiscard]] float depth(int i) const noexcept { return depth_m(x(i), y(i)); }
  // How far down below a thing its depth is looked for.
  [[nodiscard]] int under_reach() const noexcept { return std::min(params.under_reaches * params.reach_px, 128); }

  // Depth at `here` of the row or column that is `line` further, where it is known and of the object at i; else 0.
  [[nodiscard]] float beside(ImageView<const float> of, int here, int line, int i) const noexcept {
    const int px = x(here) + (column ? line : 0);
    const int py = y(here) + (column ? 0 : line);
    const bool known = of.contains(px, py) && objects.same(px, py, x(i), y(i)) && is_valid_depth(of(px, py));
    return known ? of(px, py) : 0.0F;
  }

  // Median inverse depth of the object at i over at most `most` samples of it, from the pixel i + k step on and up to
  // `end`; k is left behind them. 0 for fewer than half of them. mean_k: where they lie.
  [[nodiscard]] float median(ImageView<const float> of, int i, int step, int& k, int end, int most,
                             float& mean_k) const noexcept {
    float some[128];
    int count = 0;
    mean_k = 0.0F;
    for (; k < end && count < most && inside(i + k * step); ++k) {
      const int here = i + k * step;
      if (!same(here, i)) {
        if (goes_on_behind(i)) continue;
        break;
      }
      for (int line = -params.lines; line <= params.lines && count < most; ++line) {
        const float z = beside(of, here, line, i);
        if (!(z > 0.0F)) continue;
        some[count++] = 1.0F / z;
        mean_k += static_cast<float>(k);
      }
    }
    if (2 * count < most || count == 0) return 0.0F;
    mean_k /= static_cast<float>(count);
    select_nth(some, some + count / 2, some + count);
    return some[count / 2];
  }

  // Of the object before the border at i, over samples within `end` of it.
  [[nodiscard]] float before(int i, int step, int end, int most) const noexcept {
    int from = 0;
    float unused = 0.0F;
    return median(depth_m, i - step, -step, from, end, most, unused);
  }

  // The same close to the border, from as few samples as there are.
  [[nodiscard]] float near_object(int i, int step) const noexcept {
    float near = 0.0F;
    for (int most = params.reach_px; most >= 1 && !(near > 0.0F); most /= 2) {
      near = before(i, step, params.reach_px, most);
    }
    return near;
  }

  // Inverse depth of an object along the line: at + slope (k - k0).
  struct Continued {
    float at = 0.0F;  // 0: not known
    float slope = 0.0F;
    float k0 = 0.0F;
    float least = 0.0F;  // at a corner the line does not go on
    [[nodiscard]] float operator()(int k) const noexcept {
      return max_of(at + slope * (static_cast<float>(k) - k0), least);
    }
  };

  // What is kept of a line as its samples go; other lines may be under work.
  [[nodiscard]] ImageView<const float> so_far() const noexcept {
    return params.lines == 0 ? ImageView<const float>(kept) : depth_m;
  }

  // Of the far object at i, from `from` steps on.
  [[nodiscard]] Continued far_object(int i, int step, int from) const noexcept {
    const int reach = params.reach_px;
    const ImageView<const float> of = goes_on_behind(i) ? so_far() : depth_m;
    Continued far;
    int k = from;
    far.at = median(of, i, step, k, from + 5 * reach, reach, far.k0);
    if (!(far.at > 0.0F)) return far;
    float farther_k = 0.0F;
    const float farther = median(of, i, step, k, from + 5 * reach, reach, farther_k);
    if (farther > 0.0F) far.slope = (farther - far.at) / (farther_k - far.k0);
    far.least = 0.5F * (farther > 0.0F && farther < far.at ? farther : far.at);
    return far;
  }

  // The same from beyond the near object, where that is narrow.
  [[nodiscard]] Continued across(int i, int step) const noexcept {
    const int reach = params.reach_px;
    int k = 1;
    while (k <= 6 * reach && !same(i - k * step, i)) ++k;
    Continued far;
    if (k > 6 * reach) return far;
    k += reach;
    far.at = median(so_far(), i, -step, k, k + 5 * reach, reach, far.k0);
    return far;
  }

  // Of the ground plane, at i.
  [[nodiscard]] Continued ground(int i, int step) const noexcept {
    const auto w = [&](int at_i) {
      const Vec3f ray = unproject_pixel(view.camera, x(at_i), y(at_i), 1.0F);
      return -dot(view.ground.up, ray) / view.ground.camera_height_m;
    };
    return {w(i), w(i + step) - w(i), 0.0F, 0.0F};
  }

  // Of ground at i that may lie higher than the plane: measured from `from` steps on.
  [[nodiscard]] Continued raised_ground(int i, int step, int from) const noexcept {
    Continued far = ground(i, step);
    float k = 0.0F;
    const float there = median(depth_m, i, step, from, from + 5 * params.reach_px, params.reach_px, k);
    const float plane = far.at + far.slope * k;
    if (!(there > plane && plane > 0.0F)) return far;
    far.at *= there / plane;
    far.slope *= there / plane;
    return far;
  }

  // The far object begins at i and goes on by `step`.
  void drop(int i, int step) const noexcept {
    const int reach = params.reach_px;
    const float near = near_object(i, step);
    if (!(near > 0.0F)) return;
    const bool hidden = !column && step < 0 && matched() && (is_paved(i) || goes_on_behind(i));
    const int widest = hidden ? static_cast<int>(clamp_to(view.focal_baseline_px_m * near, 0.0F, 2048.0F)) : 0;
    Continued far;
    if (is_paved(i)) {
      // Of stereo, beside other things than houses, these samples may be spilled as well.
      const bool known = goes_on_behind(i - step) || !matched();
      far = known ? raised_ground(i, step, max_of(reach, widest)) : ground(i, step);
    } else {
      far = far_object(i, step, max_of(reach, widest));
      if (!(far.at > 0.0F) && goes_on_behind(i)) far = across(i, step);
      if (!(far.at > 0.0F)) far = far_object(i, step, reach / 2);
    }
    if (!(far.at > 0.0F)) return;
    const float band = hidden ? view.focal_baseline_px_m * (near - far(0)) : 0.0F;
    const int last = max_of(reach, static_cast<int>(clamp_to(band, 0.0F, static_cast<float>(widest))));
    for (int j = 0; j < last && inside(i + j * step); ++j) {
      const int here = i + j * step;
      const float own = far(j);
      if (!same(here, i) && !goes_on_behind(i)) break;
      if (!same(here, i) || !is_valid_depth(depth(here)) || !(near > params.contrast * own)) continue;
      if (1.0F / depth(here) > 0.5F * (near + own)) kept(x(here), y(here)) = 0.0F;
    }
  }

  // Ground begins at i, below what stands on it. Of a laser: ground further down the picture is nearer.
  void drop_before_ground(int i) const noexcept {
    const int reach = under_reach();
    const float near = near_object(i, 1);
    float farthest_m = 0.0F;  // of the ground below
    float known_m = 0.0F;     // the second: one sample may be an echo
    for (int k = near > 0.0F ? 2 * reach : 0; k > 0; --k) {
      const int here = i + k - 1;
      if (!same(here, i)) continue;
      const float z = depth(here);
      const bool of_it = near * z < params.contrast && near * z * params.contrast > 1.0F;
      if (k <= reach && is_valid_depth(z) && of_it && known_m > params.farther * z) kept(x(here), y(here)) = 0.0F;
      for (int line = -params.lines; line <= params.lines; ++line) {
        const float there = beside(depth_m, here, line, i);
        known_m = max_of(known_m, std::min(farthest_m, there));
        farthest_m = max_of(farthest_m, there);
      }
    }
  }

  // The same of stereo, by the ground farther down.
  void drop_under(int i) const noexcept {
    const int reach = under_reach();
    const Continued plane = ground(i, 1);
    int k0 = reach;
    float farther_k = 0.0F;
    const float farther = median(depth_m, i, 1, k0, 3 * reach, reach, farther_k);
    const float there = plane.at + plane.slope * farther_k;
    if (!(farther > 0.0F && there > 0.0F)) return;
    const float ratio = farther / there;  // of the plane's height below the camera to the ground's
    const float foot = goes_on_behind(i - 1) ? before(i, 1, reach, params.reach_px) : 0.0F;  // of a house
    const float least = params.under_px / view.focal_baseline_px_m;
    for (int k = 0; k < reach && same(i + k, i); ++k) {
      const float z = depth(i + k);
      float own = ratio * plane(k);
      if (foot > 0.0F) own = max_of(own, foot + (farther - foot) * static_cast<float>(k) / farther_k);
      if (is_valid_depth(z) && 1.0F / z - own > least) kept(x(i + k), y(i + k)) = 0.0F;
    }
  }

  void drop_all() const noexcept {
    const bool knows_ground = view.ground.inlier_share > 0.0F && view.ground.camera_height_m > 1e-3F;
    for (int i = 1; i < size(); ++i) {
      if (same(i - 1, i)) continue;
      const bool ground_before = is_ground(i - 1);
      const bool ground_after = is_ground(i);
      const bool stands_on_it = column && !matched();  // where it ends it is as far away as its ground
      if (!ground_before && (!ground_after || (knows_ground && is_paved(i) && !stands_on_it))) drop(i, 1);
      if (!ground_after && (!ground_before || (knows_ground && is_paved(i - 1)))) drop(i - 1, -1);
      if (!(column && knows_ground && !ground_before && is_paved(i))) continue;
      if (matched()) {
        drop_under(i);
      } else {
        drop_before_ground(i);
      }
    }
  }
};

}  // namespace depth_detail

// depth: as the sensor gave it, 0 where it did not. kept: another image of the same, becomes 0 at what is spilled.
// Without labels nothing happens.
template <class Executor>
[[nodiscard]] Status drop_border_spill(const BorderSpillParams& params, ImageView<const float> depth,
                                       const ObjectMap& objects, const SpillView& view, ImageView<float> kept,
                                       Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  const Shape shape = depth.shape();
  if (kept.shape() != shape || !objects.fits(shape)) {
    return {StatusCode::shape_mismatch, "border spill: depth, labels, instances and result must have one shape"};
  }
  if (objects.labels.empty() || params.reach_px == 0) return {};
  for (const bool column : {true, false}) {
    const int lines = column ? shape.width : shape.height;
    executor.for_chunks(static_cast<std::size_t>(lines), 16, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        depth_detail::SpillLine{params, depth, objects, view, kept, column, static_cast<int>(i)}.drop_all();
      }
    });
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_MEASURED_BORDER_SPILL_HPP
