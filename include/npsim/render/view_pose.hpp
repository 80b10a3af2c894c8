// SPDX-License-Identifier: Apache-2.0
// Where a view of the scene is taken from: a rigid pose of a camera in the frame of the mesh, and the three poses that
// a mesh is judged by: from the photograph's own camera, some metres closer, and turned about a point of the scene.
//
// The mesh's frame is that of the photograph's camera: x right, y down, z forward, metres. Clockwise is as seen from
// above: the camera's heading turns to the right, and the camera itself moves to the left, round the pivot.
// Which pivot shows the scene depends on it: about a far one the camera leaves a narrow street and stands behind the
// house fronts, about a near one it sees little of an open place. pivot_m() tries some on a coarse picture of points.
// Error: a pose made from a unit pose stays orthonormal to 1e-6. Cost: the pivot is at most 160 x 90 points a
// candidate. Memory: 4 KB on the stack.
#ifndef NPSIM_RENDER_VIEW_POSE_HPP
#define NPSIM_RENDER_VIEW_POSE_HPP

#include <algorithm>
#include <cmath>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// The axes of the view's camera and its centre, in the mesh's frame. The default is the photograph's own camera.
struct ViewPose {
  Vec3f right{1, 0, 0};
  Vec3f down{0, 1, 0};
  Vec3f forward{0, 0, 1};
  Vec3f eye_m{0, 0, 0};
};

[[nodiscard]] inline Status validate(const ViewPose& pose) noexcept {
  constexpr float kTolerance = 1e-3F;
  const auto is_unit = [](const Vec3f& v) { return std::fabs(dot(v, v) - 1.0F) < kTolerance; };
  const Vec3f off = cross(pose.right, pose.down) - pose.forward;
  const bool good = is_finite(pose.eye_m) && is_unit(pose.right) && is_unit(pose.down) && is_unit(pose.forward) &&
                    dot(off, off) < kTolerance * kTolerance;
  return good ? Status()
              : Status(StatusCode::invalid_argument, "a view needs a finite place and right-handed unit axes");
}

// Moved along its own axis.
[[nodiscard]] constexpr ViewPose closer(const ViewPose& pose, float by_m) noexcept {
  return {pose.right, pose.down, pose.forward, pose.eye_m + pose.forward * by_m};
}

// Turned about the point pivot_m ahead of it: clockwise about its vertical, then climbing above that point. The point
// keeps its place in the picture and its distance.
[[nodiscard]] inline ViewPose turned(const ViewPose& pose, float clockwise_rad, float climb_rad,
                                     float pivot_m) noexcept {
  const Vec3f pivot = pose.eye_m + pose.forward * pivot_m;
  const float c = std::cos(clockwise_rad);
  const float s = std::sin(clockwise_rad);
  const Vec3f level = pose.forward * c + pose.right * s;
  const float cc = std::cos(climb_rad);
  const float sc = std::sin(climb_rad);
  ViewPose out;
  out.right = pose.right * c - pose.forward * s;
  out.forward = level * cc + pose.down * sc;
  out.down = pose.down * cc - level * sc;
  out.eye_m = pivot - out.forward * pivot_m;
  return out;
}

struct PivotParams {
  float min_m = 6.0F;  // > 0
  float max_m = 30.0F;
  int candidates = 12;  // 2 .. 64, each the same factor farther than the one before
};

namespace view_pose_detail {

// How many of at most 160 x 90 samples of the depth map's upright surfaces a view shows from their front: the ground is
// seen from everywhere. What hides them is found on a coarse picture of all samples.
[[nodiscard]] inline int fronts_seen(ImageView<const float> depth_m, const Intrinsics& k,
                                     const ViewPose& pose) noexcept {
  constexpr int kColumns = 40;
  constexpr int kRows = 24;
  float nearest[kRows][kColumns] = {};  // inverse depth of a cell's nearest sample; negative where its back is seen
  const int step = std::max(1, std::max(depth_m.width() / 160, depth_m.height() / 90));
  const float columns_per_px = static_cast<float>(kColumns) / static_cast<float>(depth_m.width());
  const float rows_per_px = static_cast<float>(kRows) / static_cast<float>(depth_m.height());
  const auto for_samples = [&](auto&& f) {
    for (int y = 0; y + 1 < depth_m.height(); y += step) {
      for (int x = 0; x + 1 < depth_m.width(); x += step) {
        const float z = depth_m(x, y);
        if (!is_valid_depth(z) || !is_valid_depth(depth_m(x + 1, y)) || !is_valid_depth(depth_m(x, y + 1))) continue;
        const Vec3f at = unproject_pixel(k, x, y, z);
        const Vec3f seen = at - pose.eye_m;
        const Vec3f p{dot(pose.right, seen), dot(pose.down, seen), dot(pose.forward, seen)};
        if (!(p.z > 0.1F)) continue;
        const Vec2f uv = project(k, p);
        const float column = uv.x * columns_per_px;
        const float row = uv.y * rows_per_px;
        if (!(column >= 0.0F && row >= 0.0F && column < kColumns && row < kRows)) continue;
        // Towards the photograph's camera, as every face of a sheet.
        const Vec3f normal = cross(unproject_pixel(k, x, y + 1, depth_m(x, y + 1)) - at,
                                   unproject_pixel(k, x + 1, y, depth_m(x + 1, y)) - at);
        const bool level = normal.y * normal.y > 0.5F * dot(normal, normal);
        f(nearest[static_cast<int>(row)][static_cast<int>(column)], dot(normal, seen) < 0.0F ? 1.0F / p.z : -1.0F / p.z,
          level);
      }
    }
  };
  for_samples([](float& cell, float inverse_depth, bool) {
    if (std::fabs(inverse_depth) > std::fabs(cell)) cell = inverse_depth;
  });
  constexpr float kSlack = 0.7F;  // the depth that a cell of a slanting surface spans
  int fronts = 0;
  for_samples([&](const float& cell, float inverse_depth, bool level) {
    fronts += !level && inverse_depth > kSlack * std::fabs(cell) && inverse_depth > 0.0F ? 1 : 0;
  });
  return fronts;
}

}  // namespace view_pose_detail

// How far ahead the point lies that a view turns about. Of the candidates those count from which nearly as much of the
// upright surfaces that the photograph saw is seen again, from its front, as from the best; the middle one of them is
// taken. The lower limit where there is no depth.
[[nodiscard]] inline float pivot_m(const PivotParams& params, ImageView<const float> depth_m, const Intrinsics& camera,
                                   float clockwise_rad, float climb_rad) noexcept {
  constexpr int kMaxCandidates = 64;
  constexpr float kNearly = 0.8F;
  int fronts[kMaxCandidates] = {};
  const int candidates = std::clamp(params.candidates, 2, kMaxCandidates);
  const auto candidate_m = [&](int i) {
    return params.min_m *
           std::pow(params.max_m / params.min_m, static_cast<float>(i) / static_cast<float>(candidates - 1));
  };
  int best = 0;
  for (int i = 0; i < candidates; ++i) {
    const ViewPose pose = turned(ViewPose{}, clockwise_rad, climb_rad, candidate_m(i));
    fronts[i] = view_pose_detail::fronts_seen(depth_m, camera, pose);
    best = std::max(best, fronts[i]);
  }
  int good[kMaxCandidates] = {};
  int count = 0;
  for (int i = 0; i < candidates; ++i) {
    if (static_cast<float>(fronts[i]) >= kNearly * static_cast<float>(best)) good[count++] = i;
  }
  if (best > 0) return candidate_m(good[(count - 1) / 2]);
  return params.min_m;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_VIEW_POSE_HPP
