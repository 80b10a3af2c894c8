// SPDX-License-Identifier: Apache-2.0
// Where a view of the scene is taken from: a rigid pose of a camera in the frame of the mesh, and the three poses that
// a mesh is judged by: from the photograph's own camera, some metres closer, and turned about a point of the scene.
//
// The mesh's frame is that of the photograph's camera: x right, y down, z forward, metres. Clockwise is as seen from
// above: the camera's heading turns to the right, and the camera itself moves to the left, round the pivot.
// A camera that turns about a far pivot leaves the street and stands in a house; one that turns about a near pivot sees
// little else than the road. axis_pivot_m() takes the median depth of the middle of the picture, which is where its
// objects are, within limits that keep the camera in a street of two lanes and pavements.
// Error: a pose made from a unit pose stays orthonormal to 1e-6. Cost: the pivot is one pass over the middle ninth.
// Memory: a histogram of 256 bins on the stack.
#ifndef NPSIM_RENDER_VIEW_POSE_HPP
#define NPSIM_RENDER_VIEW_POSE_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace v1 {

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
  float min_m = 6.0F;
  float max_m = 14.0F;
};

// How far ahead the point lies that a view turns about: the median of the valid depths in the middle ninth of the
// picture, within the limits; the upper limit where there is no depth. Error: half a bin, 1/512 of the limits' range.
[[nodiscard]] inline float axis_pivot_m(const PivotParams& params, ImageView<const float> depth_m) noexcept {
  constexpr std::size_t kBins = 256;
  std::size_t count[kBins] = {};
  std::size_t total = 0;
  const float scale = static_cast<float>(kBins) / (params.max_m - params.min_m);
  for (int y = depth_m.height() / 3; y < depth_m.height() - depth_m.height() / 3; ++y) {
    for (int x = depth_m.width() / 3; x < depth_m.width() - depth_m.width() / 3; ++x) {
      const float z = depth_m(x, y);
      if (!is_valid_depth(z)) continue;
      const float bin = std::clamp((z - params.min_m) * scale, 0.0F, static_cast<float>(kBins - 1));
      ++count[static_cast<std::size_t>(bin)];
      ++total;
    }
  }
  if (total == 0) return params.max_m;
  std::size_t below = 0;
  for (std::size_t i = 0; i < kBins; ++i) {
    below += count[i];
    if (2 * below >= total) return params.min_m + (static_cast<float>(i) + 0.5F) / scale;
  }
  return params.max_m;
}

}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_RENDER_VIEW_POSE_HPP
