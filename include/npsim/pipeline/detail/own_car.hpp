// SPDX-License-Identifier: Apache-2.0
// The bonnet of the car that carries the camera: a dark surface that mirrors what is in front of it.
//
// It is no surface of the scene, but it is seen. Its upper edge is the outline of a convex mirror: there the view
// grazes it, everything is reflected (Fresnel) and the reflection joins what stands above the edge. Below, the surface
// turns away from the view. Of curvature c at the distance D, it drops by c s^2 / 2 at s from the outline, so that a
// row t below the edge has turned by sqrt(2 D c t / fy) and shows the row 2 sqrt(2 D c fy t) above it: the street is
// pressed together under the edge, and what stands above the horizon fills the rest. kTurn = 2 sqrt(2 D c) is 1.2 to
// 1.9 on photographs of four bonnets, by markings and the horizon in them (a radius of 8 m, 1.6 m ahead, makes 1.3).
// Reflectance by Schlick's approximation; the paint itself is taken for black. What stands on the bonnet (a star, an
// aerial) is narrow: outside the edge's running median. It is seen through: the night beside it, times how much brighter
// or darker the photograph is there than beside it.
// Cost: each pixel above the car is read about once. Memory: three numbers a column.
#ifndef NPSIM_PIPELINE_DETAIL_OWN_CAR_HPP
#define NPSIM_PIPELINE_DETAIL_OWN_CAR_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "npsim/color/srgb.hpp"
#include "npsim/core/algorithm.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

[[nodiscard]] constexpr std::size_t show_own_car_workspace_bytes(Shape shape) noexcept {
  return 3 * allocation_bytes<int>(static_cast<std::size_t>(shape.width)) + kWorkspaceAlignment;
}

namespace relight_detail {

inline constexpr LabelSet kOwnCar = LabelSet::of(label::ego_vehicle, label::rectification_border, label::out_of_roi);

// How far above the bonnet's edge lies what a point `below` it shows, both in rows.
[[nodiscard]] inline float rows_above(float below, float fy) noexcept {
  constexpr float kTurn = 1.5F;
  return kTurn * std::sqrt(below * fy);
}

// The row at which each column's part of the car begins that reaches the lower border; the height where there is none.
// Borders that rectification leaves, and masks drawn by hand, end up to a 64th of the height above it.
inline void bonnet_edge(ImageView<const Label> labels, Span<int> edge) noexcept {
  const int lowest = labels.height() - labels.height() / 64;
  for (int x = 0; x < labels.width(); ++x) {
    int y = labels.height();
    while (y > lowest && !kOwnCar.contains(labels(x, y - 1))) --y;
    bool car = false;
    while (y > 0 && kOwnCar.contains(labels(x, y - 1))) {
      --y;
      car = car || labels(x, y) == label::ego_vehicle;
    }
    edge[static_cast<std::size_t>(x)] = car ? y : labels.height();
  }
}

// Running median over a sixth of the width: a bonnet is wide and smooth, what stands on it is neither.
inline void smooth_edge(Span<const int> edge, Span<int> window, Span<int> out) noexcept {
  const auto width = static_cast<std::ptrdiff_t>(edge.size());
  const std::ptrdiff_t reach = std::max<std::ptrdiff_t>(1, width / 12);
  for (std::ptrdiff_t x = 0; x < width; ++x) {
    const std::ptrdiff_t first = std::max<std::ptrdiff_t>(0, x - reach);
    const std::ptrdiff_t last = std::min(width, x + reach + 1);
    std::copy(edge.data() + first, edge.data() + last, window.data());
    int* const middle = window.data() + (last - first) / 2;
    select_nth(window.data(), middle, window.data() + (last - first));
    out[static_cast<std::size_t>(x)] = std::max(*middle, edge[static_cast<std::size_t>(x)]);
  }
}

// The pixels from `left` to `right` of row y, which show what stands before the street, from those on either side.
inline void see_through(const SceneView& scene, int y, int left, int right, ImageView<Vec3f> night) noexcept {
  const int before = left - 1;
  const int after = right + 1;
  const bool has_left = before >= 0;
  const bool has_right = after < night.width();
  if (!has_left && !has_right) return;
  const auto mixed = [&](int x, const Vec3f& a, const Vec3f& b) {
    if (!has_left || !has_right) return has_left ? a : b;
    const float t = static_cast<float>(x - before) / static_cast<float>(after - before);
    return a + (b - a) * t;
  };
  const auto day = [&](int x) { return luminance(srgb_decode8(scene.image(x, y))); };
  const int from = has_left ? before : after;
  const int to = has_right ? after : before;
  for (int x = left; x <= right; ++x) {
    const float around = mixed(x, {day(from), 0, 0}, {day(to), 0, 0}).x;
    const float contrast = around > 0.0F ? clamp_to(day(x) / around, 0.2F, 3.0F) : 1.0F;
    night(x, y) = mixed(x, night(from, y), night(to, y)) * contrast;
  }
}

}  // namespace relight_detail

// In place, after everything else is in the image. f0: reflectance at normal incidence.
inline Status show_own_car(const SceneView& scene, float f0, ImageView<Vec3f> night, Workspace& workspace) noexcept {
  using namespace relight_detail;
  if (scene.labels.empty()) return {};
  const WorkspaceScope scope(workspace);
  const Shape shape = night.shape();
  const auto columns = static_cast<std::size_t>(shape.width);
  Span<int> edge, window, bonnet;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(columns, edge));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(columns, window));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(columns, bonnet));
  bonnet_edge(scene.labels, edge);
  smooth_edge(edge, window, bonnet);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const auto stands = [&](int i) {
        return y < bonnet[static_cast<std::size_t>(i)] && scene.labels(i, y) == label::ego_vehicle;
      };
      if (!stands(x)) continue;
      int right = x;
      while (right + 1 < shape.width && stands(right + 1)) ++right;
      see_through(scene, y, x, right, night);
      x = right;
    }
  }
  for (int x = 0; x < shape.width; ++x) {
    const int first = bonnet[static_cast<std::size_t>(x)];
    for (int y = std::max(first, 1); y < shape.height; ++y) {
      const auto below = static_cast<float>(y - first);
      const auto rows = static_cast<float>(shape.height);
      const float from = std::min(rows_above(below, scene.camera.fy), rows);
      const float to = std::min(rows_above(below + 1.0F, scene.camera.fy), rows);
      const float away = 1.0F - std::min(0.25F * (from + to) / scene.camera.fy, 1.0F);
      const float reflectance = f0 + (1.0F - f0) * away * away * away * away * away;
      // The rows that are pressed together in this one.
      const int last = std::max(0, first - 1 - static_cast<int>(from));
      const int furthest = clamp_to(first - static_cast<int>(std::ceil(to)), 0, last);
      Vec3f seen;
      for (int k = furthest; k <= last; ++k) seen += night(x, k);
      night(x, y) = seen * (reflectance / static_cast<float>(last - furthest + 1));
    }
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_OWN_CAR_HPP
