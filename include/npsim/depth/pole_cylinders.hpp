// SPDX-License-Identifier: Apache-2.0
// Poles as cylinders: of measured depth, what its noise made of them is drawn to what poles are.
//
// A mast is as wide as the window that matching compares, or as the gap between two points of a laser: its depth jumps
// by metres from row to row, and in the light of one lamp it comes out in bright and dark pieces. Pole pixels lie on a
// pole that stands (their run along the column is the longer one) or on an arm that lies.
//   Depth: the median of 1/z of the pole's pixels within reach_m along it, so as far as a straight pole keeps its depth.
//   Normal: that of a cylinder across the shorter run, square to it: over the run it turns from one side to the other.
// Invariant: pixels of other labels and what is thicker than max_width_m are not touched. No pixel's new depth is
// outside of those around it on its pole. Deterministic. Cost: the pixels within reach, at most kMaxSamples of them, per
// run of a pole; poles are some per cent of a picture.
#ifndef NPSIM_DEPTH_POLE_CYLINDERS_HPP
#define NPSIM_DEPTH_POLE_CYLINDERS_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/depth/object_borders.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct PoleCylinderParams {
  bool enabled = true;
  LabelSet poles = LabelSet::of(label::pole, label::polegroup);
  float reach_m = 1.5F;      // along the pole, to either side
  float max_width_m = 1.0F;  // advertising columns and bollards are no noise
};

[[nodiscard]] inline Status validate(const PoleCylinderParams& p) noexcept {
  const bool good = p.reach_m > 0.0F && std::isfinite(p.reach_m) && p.max_width_m > 0.0F;
  return good ? Status() : Status(StatusCode::invalid_argument, "pole cylinders: a parameter lies outside its range");
}

namespace pole_detail {

inline constexpr std::size_t kMaxSamples = 512;
inline constexpr int kLongest_px = 4096;  // of a run

// Pixels of the object around (x, y) along a direction: to either side, itself left out.
struct Run {
  int before = 0;
  int after = 0;
  [[nodiscard]] int length() const noexcept { return before + after + 1; }
};
[[nodiscard]] inline Run run_along(const ObjectMap& objects, int x, int y, int dx, int dy) noexcept {
  const auto count = [&](int sign) {
    int n = 0;
    while (n < kLongest_px && objects.labels.contains(x + (n + 1) * sign * dx, y + (n + 1) * sign * dy) &&
           objects.same(x, y, x + (n + 1) * sign * dx, y + (n + 1) * sign * dy)) {
      ++n;
    }
    return n;
  };
  return {count(-1), count(1)};
}

// Median inverse depth of the pole's pixels on the lines across it within `reach` of (x, y); 0 where there is none.
[[nodiscard]] inline float typical_w(ImageView<const float> depth, const ObjectMap& objects, int x, int y, bool stands,
                                     const Run& across, int reach) noexcept {
  std::array<float, kMaxSamples> w;
  std::size_t n = 0;
  const auto pixels = static_cast<std::size_t>(across.length()) * static_cast<std::size_t>(2 * reach + 1);
  const int step = 1 + static_cast<int>(pixels / kMaxSamples);
  for (int along = -reach; along <= reach; along += step) {
    for (int side = -across.before; side <= across.after; ++side) {
      const int u = stands ? x + side : x + along;
      const int v = stands ? y + along : y + side;
      if (n == kMaxSamples || !depth.contains(u, v) || !objects.same(x, y, u, v) || !is_valid_depth(depth(u, v))) {
        continue;
      }
      w[n++] = 1.0F / depth(u, v);
    }
  }
  if (n == 0) return 0.0F;
  select_nth(w.data(), w.data() + n / 2, w.data() + n);
  return w[n / 2];
}

}  // namespace pole_detail

// depth: as measured and filled. up: of the ground, unit. normals, surface: changed in place; surface is the depth that a
// mesh is made of, and not the memory of `depth`. Without labels nothing changes.
template <class Executor>
[[nodiscard]] Status round_poles(const PoleCylinderParams& params, ImageView<const float> depth,
                                 const ObjectMap& objects, const Intrinsics& camera, const Vec3f& up,
                                 ImageView<Vec3f> normals, ImageView<float> surface, Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  const Shape shape = depth.shape();
  if (normals.shape() != shape || surface.shape() != shape || !objects.fits(shape)) {
    return {StatusCode::shape_mismatch, "pole cylinders: all planes must have one shape"};
  }
  if (!params.enabled || objects.labels.empty()) return {};
  executor.for_chunks(static_cast<std::size_t>(shape.height), 8, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        if (!params.poles.contains(objects.labels(x, y)) || !is_valid_depth(depth(x, y))) continue;
        const pole_detail::Run row = pole_detail::run_along(objects, x, y, 1, 0);
        const pole_detail::Run column = pole_detail::run_along(objects, x, y, 0, 1);
        const bool stands = column.length() >= row.length();
        const pole_detail::Run& across = stands ? row : column;
        const float focal = stands ? camera.fx : camera.fy;
        if (static_cast<float>(across.length()) * depth(x, y) > params.max_width_m * focal) continue;
        const float reach_px = params.reach_m * (stands ? camera.fy : camera.fx) / depth(x, y);
        const int reach = static_cast<int>(clamp_to(reach_px, 1.0F, static_cast<float>(shape.height)));
        const float w = pole_detail::typical_w(depth, objects, x, y, stands, across, reach);
        if (!(w > 0.0F)) continue;
        surface(x, y) = 1.0F / w;
        // Square to the pole, towards the camera; and from there to its side.
        const Vec3f ray = unproject_pixel(camera, x, y, 1.0F);
        const Vec3f side = stands ? normalized(cross(up, ray)) : -up;
        const Vec3f axis = stands ? up : normalized(cross(ray, up));
        const Vec3f facing = normalized(axis * dot(axis, ray) - ray);
        const float middle = 0.5F * static_cast<float>(across.after - across.before);
        const float t = clamp_to(-middle / (0.5F * static_cast<float>(across.length())), -0.95F, 0.95F);
        const float towards_right = stands ? (dot(side, Vec3f{1.0F, 0.0F, 0.0F}) > 0.0F ? t : -t)
                                           : (dot(side, Vec3f{0.0F, 1.0F, 0.0F}) > 0.0F ? t : -t);
        normals(x, y) = normalized(facing * std::sqrt(1.0F - t * t) + side * towards_right);
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_POLE_CYLINDERS_HPP
