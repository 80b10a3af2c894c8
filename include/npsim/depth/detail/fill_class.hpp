// SPDX-License-Identifier: Apache-2.0
// What the depth fill knows of each label before it starts: whether it is a surface, its range of inverse depth, and
// for the ground classes the plane through its valid pixels, by least squares in inverse depth (linear in the image,
// and where stereo noise is uniform).
//
// Cost: up to three passes over the image per planar label. Memory: a table of 256 entries inside the state.
#ifndef NPSIM_DEPTH_DETAIL_FILL_CLASS_HPP
#define NPSIM_DEPTH_DETAIL_FILL_CLASS_HPP

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <limits>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

inline constexpr std::int32_t kUnreached = std::numeric_limits<std::int32_t>::max();

// What is known of one label: range of inverse depth, and for planar labels the plane w = w0 + slope_u x + slope_v y.
struct FillClass {
  bool surface = true;
  bool plane = false;
  float low = 0;
  float high = 0;
  double w0 = 0;
  float slope_u = 0;
  float slope_v = 0;
};

struct FillState {
  ImageView<const Label> labels;  // empty: one class
  ImageView<float> w;             // inverse depth
  ImageView<std::int32_t> steps;  // length of the path to the valid pixel that a pixel started from; 0: valid itself
  ImageView<std::uint8_t> flags;  // which neighbours a filled pixel is the mean of
  std::array<FillClass, 256> classes;

  [[nodiscard]] Label label_at(int x, int y) const noexcept { return labels.empty() ? Label{0} : labels(x, y); }
  [[nodiscard]] const FillClass& class_at(int x, int y) const noexcept { return classes[label_at(x, y)]; }
};

[[nodiscard]] inline bool is_fill_source(float z_m) noexcept { return z_m >= 1e-4F && z_m <= 1e6F; }

// Sums for the least-squares plane of one label, relative to the image centre.
struct PlaneSums {
  double n = 0, u = 0, v = 0, uu = 0, uv = 0, vv = 0, w = 0, uw = 0, vw = 0;
  int left = std::numeric_limits<int>::max(), right = -1, top = std::numeric_limits<int>::max(), bottom = -1;  // valid
  int label_left = std::numeric_limits<int>::max(), label_right = -1;
  int label_top = std::numeric_limits<int>::max(), label_bottom = -1;
};

// Fits the plane if the valid pixels determine it: at least 16, spread over a quarter of the label's extent each way.
inline void fit_plane(const PlaneSums& s, double u0, double v0, FillClass& c) noexcept {
  if (s.n < 16 || 4 * (s.right - s.left) < s.label_right - s.label_left ||
      4 * (s.bottom - s.top) < s.label_bottom - s.label_top) {
    return;
  }
  const double uu = s.uu - s.u * s.u / s.n;
  const double uv = s.uv - s.u * s.v / s.n;
  const double vv = s.vv - s.v * s.v / s.n;
  const double uw = s.uw - s.u * s.w / s.n;
  const double vw = s.vw - s.v * s.w / s.n;
  const double determinant = uu * vv - uv * uv;
  if (!(determinant > 1e-3 * uu * vv) || !(uu > 0) || !(vv > 0)) return;
  const double slope_u = (vv * uw - uv * vw) / determinant;
  const double slope_v = (uu * vw - uv * uw) / determinant;
  c.plane = true;
  c.slope_u = static_cast<float>(slope_u);
  c.slope_v = static_cast<float>(slope_v);
  c.w0 = (s.w - slope_u * s.u - slope_v * s.v) / s.n - slope_u * u0 - slope_v * v0;
}

// The sums of one label, over its sources.
[[nodiscard]] inline PlaneSums sum_plane(const FillState& state, std::size_t l, double u0, double v0) noexcept {
  PlaneSums s;
  for (int y = 0; y < state.w.height(); ++y) {
    for (int x = 0; x < state.w.width(); ++x) {
      if (state.label_at(x, y) != l) continue;
      s.label_left = x < s.label_left ? x : s.label_left;
      s.label_right = x > s.label_right ? x : s.label_right;
      s.label_top = y < s.label_top ? y : s.label_top;
      s.label_bottom = y > s.label_bottom ? y : s.label_bottom;
      if (state.steps(x, y) != 0) continue;
      s.left = x < s.left ? x : s.left;
      s.right = x > s.right ? x : s.right;
      s.top = y < s.top ? y : s.top;
      s.bottom = y > s.bottom ? y : s.bottom;
      const double u = x - u0;
      const double v = y - v0;
      const double w = static_cast<double>(state.w(x, y));
      s.n += 1;
      s.u += u;
      s.v += v;
      s.w += w;
      s.uu += u * u;
      s.uv += u * v;
      s.vv += v * v;
      s.uw += u * w;
      s.vw += v * w;
    }
  }
  return s;
}

[[nodiscard]] inline double plane_at(const FillClass& c, int x, int y) noexcept {
  return c.w0 + static_cast<double>(c.slope_u) * x + static_cast<double>(c.slope_v) * y;
}

// What is seen at more than `factor` times the distance of the ground plane lies far beneath the ground, whatever its
// label. That is a stereo mismatch where the plane is near, within four times its nearest distance; farther off it may
// be a slope. Such pixels stop being sources. Returns how many.
inline std::size_t drop_below_ground(FillState& state, const FillClass& plane, double nearest, double factor) noexcept {
  std::size_t dropped = 0;
  for (int y = 0; y < state.w.height(); ++y) {
    for (int x = 0; x < state.w.width(); ++x) {
      if (state.steps(x, y) != 0) continue;
      const double w = plane_at(plane, x, y);
      if (!(w > 0.25 * nearest) || !(factor * static_cast<double>(state.w(x, y)) < w)) continue;
      state.steps(x, y) = kUnreached;
      ++dropped;
    }
  }
  return dropped;
}

// Fits a plane to every planar label. The one with the most sources is the ground: it tells which measurements lie
// beneath it, and stands in for labels that determine no plane themselves. Returns the sources dropped.
inline std::size_t describe_ground(LabelSet planar, float ground_outlier, FillState& state) noexcept {
  const double u0 = 0.5 * state.w.width();
  const double v0 = 0.5 * state.w.height();
  const auto is_planar = [&](std::size_t l) {
    return state.classes[l].surface && planar.contains(static_cast<Label>(l));
  };
  FillClass ground;
  double most = 0;
  double nearest = 0;
  for (std::size_t l = 0; l < state.classes.size(); ++l) {
    if (!is_planar(l)) continue;
    FillClass& c = state.classes[l];
    const PlaneSums s = sum_plane(state, l, u0, v0);
    fit_plane(s, u0, v0, c);
    if (!c.plane || s.n <= most) continue;
    most = s.n;
    ground = c;
    // The plane is linear, so it is nearest at a corner of the label's extent.
    for (const int x : {s.label_left, s.label_right}) {
      for (const int y : {s.label_top, s.label_bottom}) {
        nearest = plane_at(c, x, y) > nearest ? plane_at(c, x, y) : nearest;
      }
    }
  }
  if (!ground.plane) return 0;
  const std::size_t dropped =
      ground_outlier > 0 ? drop_below_ground(state, ground, nearest, static_cast<double>(ground_outlier)) : 0;
  for (std::size_t l = 0; l < state.classes.size(); ++l) {
    if (!is_planar(l)) continue;
    FillClass& c = state.classes[l];
    if (dropped > 0) {
      c.plane = false;
      fit_plane(sum_plane(state, l, u0, v0), u0, v0, c);
    }
    if (c.plane) continue;
    c.plane = true;
    c.w0 = ground.w0;
    c.slope_u = ground.slope_u;
    c.slope_v = ground.slope_v;
    c.low = ground.low < c.low ? ground.low : c.low;
    c.high = ground.high > c.high ? ground.high : c.high;
  }
  return dropped;
}

// Copies valid depths as inverse depth and describes each label. Returns the number of sources.
[[nodiscard]] inline std::size_t describe_classes(LabelSet no_surface, LabelSet planar, float ground_outlier,
                                                  ImageView<const float> depth, FillState& state) noexcept {
  float low = std::numeric_limits<float>::max();
  float high = 0;
  for (std::size_t l = 0; l < state.classes.size(); ++l) {
    state.classes[l] = {};
    state.classes[l].surface = state.labels.empty() || !no_surface.contains(static_cast<Label>(l));
    state.classes[l].low = low;
  }
  std::size_t sources = 0;
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      FillClass& c = state.classes[state.label_at(x, y)];
      const bool source = c.surface && is_fill_source(depth(x, y));
      const float w = source ? 1.0F / depth(x, y) : 0.0F;
      state.steps(x, y) = source ? 0 : kUnreached;
      state.w(x, y) = w;
      if (!source) continue;
      ++sources;
      c.low = w < c.low ? w : c.low;
      c.high = w > c.high ? w : c.high;
      low = w < low ? w : low;
      high = w > high ? w : high;
    }
  }
  for (FillClass& c : state.classes) {
    if (c.high == 0) {
      c.low = low;
      c.high = high;
    }
    c.low *= 0.25F;
    c.high *= 4.0F;
  }
  if (!state.labels.empty()) sources -= describe_ground(planar, ground_outlier, state);
  return sources;
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_FILL_CLASS_HPP
