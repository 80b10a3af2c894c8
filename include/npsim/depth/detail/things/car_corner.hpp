// SPDX-License-Identifier: Apache-2.0
// The corner that a car turns to the camera: two upright planes at right angles, found in inverse depth.
//
// Of all rectangles on the ground, turned by kTurn_rad at a time, then by a half and a quarter of that, the one whose near
// corner explains the samples best. A ray meets a box where the plane with the smaller 1/z is, and each plane is
// n . p = -distance, so 1/z = -(n . ray) / distance: given the angle, distances are medians of the samples that are
// theirs, and the search is over angles alone. After L-shape fitting (Zhang et al., IV 2017), which has laser points
// and squared distances.
// Error: on exact samples of a box 1.6 degrees, and in the distances that angle times the distance of the car.
#ifndef NPSIM_DEPTH_DETAIL_THINGS_CAR_CORNER_HPP
#define NPSIM_DEPTH_DETAIL_THINGS_CAR_CORNER_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/depth/depth_source.hpp"
#include "npsim/geometry/ground.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

namespace car_detail {

inline constexpr float kTurn_rad = 0.105F;

struct Sample {
  Vec3f ray;
  float w;
};

// The corner of a box that looks at the camera: upright planes n . p = -distance.
struct Corner {
  Vec3f normal[2];
  float distance_m[2] = {0.0F, 0.0F};
  float loss = 1e30F;
};

// 1/z at which a ray meets the plane; far where it looks away.
inline constexpr float kAway = 1e9F;
[[nodiscard]] inline float plane_w(const Vec3f& normal, float distance_m, const Vec3f& ray) noexcept {
  const float a = -dot(normal, ray);
  return a > 1e-3F && distance_m > 1e-3F ? a / distance_m : kAway;
}

[[nodiscard]] inline float median(Span<float> values) noexcept {
  const std::size_t middle = values.size() / 2;
  select_nth(values.data(), values.data() + middle, values.data() + values.size());
  return values[middle];
}

// `scratch` has room for as many floats as there are samples. about: a point of the car.
[[nodiscard]] inline Corner corner_at(const DepthNoise& noise, float relief_m, const Vec3f& along, const Vec3f& across,
                                      const Vec3f& about, Span<const Sample> samples, Span<float> scratch) noexcept {
  constexpr int kRounds = 5;
  constexpr float kMost = 6.0F;
  Corner corner;
  for (int k = 0; k < 2; ++k) {
    const Vec3f n = k == 0 ? along : across;
    corner.normal[k] = dot(n, about) > 0.0F ? -n : n;
    std::size_t count = 0;
    for (const Sample& s : samples) scratch[count++] = -dot(corner.normal[k], s.ray) / s.w;
    select_nth(scratch.data(), scratch.data() + count / 10, scratch.data() + count);  // nearer ones may be wrong
    corner.distance_m[k] = std::max(scratch[count / 10], 0.3F);
  }
  for (int round = 0; round < kRounds; ++round) {
    float distance[2];
    for (int k = 0; k < 2; ++k) {
      std::size_t count = 0;
      for (const Sample& s : samples) {
        const float own = plane_w(corner.normal[k], corner.distance_m[k], s.ray);
        const float other = plane_w(corner.normal[1 - k], corner.distance_m[1 - k], s.ray);
        if (own < kAway && own <= other) scratch[count++] = -dot(corner.normal[k], s.ray) / s.w;
      }
      distance[k] = count > 20 ? median(scratch.sub(0, count)) : corner.distance_m[k];
    }
    corner.distance_m[0] = distance[0];
    corner.distance_m[1] = distance[1];
  }
  float sum = 0.0F;
  for (const Sample& s : samples) {
    const float w = std::min(plane_w(corner.normal[0], corner.distance_m[0], s.ray),
                             plane_w(corner.normal[1], corner.distance_m[1], s.ray));
    sum += std::min(std::fabs(s.w - w) / (noise.deviation(s.w) + relief_m * s.w * s.w), kMost);
  }
  corner.loss = sum / static_cast<float>(samples.size());
  return corner;
}

[[nodiscard]] inline Corner fit_corner(const DepthNoise& noise, float relief_m, const GroundPlane& ground,
                                       const Vec3f& about, Span<const Sample> samples, Span<float> scratch) noexcept {
  const Vec3f forward = forward_on_ground(ground);
  const Vec3f right = cross(forward, ground.up);
  Corner best;
  float best_score = 1e30F;
  float best_angle = 0.0F;
  const auto attempt = [&](float angle) {
    const float c = std::cos(angle);
    const float s = std::sin(angle);
    const Corner corner =
        corner_at(noise, relief_m, right * c + forward * s, forward * c - right * s, about, samples, scratch);
    const float score = corner.loss + 0.1F * std::fabs(angle);  // cars mostly stand along the street
    if (score >= best_score) return;
    best = corner;
    best_score = score;
    best_angle = angle;
  };
  constexpr int kEither = 7;  // 7 x 6 degrees: a quarter turn is the other side
  for (int i = -kEither; i <= kEither; ++i) attempt(kTurn_rad * static_cast<float>(i));
  for (const float step : {0.5F * kTurn_rad, 0.25F * kTurn_rad}) {
    const float middle = best_angle;
    attempt(middle - step);
    attempt(middle + step);
  }
  return best;
}

}  // namespace car_detail

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_THINGS_CAR_CORNER_HPP
