// SPDX-License-Identifier: Apache-2.0
// How far away is a street lamp? Its head hangs before the sky, where neither stereo nor networks know the depth.
//
// Candidates in order; the first that puts the lamp at a credible height above the ground (2 to 16 m) wins:
//   1. the head's own pixels that are labelled as an object (pole, sign, static), certain ones first;
//   2. the pole below: the nearest run of pole pixels under the head, in a band that leaves room for the arm;
//   3. the foot of that pole: where its lowest pixel's ray meets the ground plane;
//   4. any surface pixel of the head (a facade behind it, or no labels), the nearer quarter of them;
//   5. none: the distance at which the head hangs default_height_m above the ground (lamps on wires), if it lies above
//      the horizon.
// The sky's depth is never used. 0 where even the last fails.
#ifndef NPSIM_LIGHT_DETAIL_STREET_LAMP_HPP
#define NPSIM_LIGHT_DETAIL_STREET_LAMP_HPP

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/light/detail/region_depth.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct StreetLampParams {
  float min_height_m = 2.0F;  // credible mounting heights above the ground
  float max_height_m = 16.0F;
  float default_height_m = 8.0F;
  float max_distance_m = 300.0F;
  float arm_m = 3.0F;  // reach of an arm, which bounds the search for the pole to either side
};

namespace light_detail {

inline constexpr LabelSet kPoleLabels = LabelSet::of(label::pole, label::polegroup);
inline constexpr LabelSet kLampHeadLabels =
    LabelSet::of(label::pole, label::polegroup, label::traffic_light, label::traffic_sign, label::static_object,
                 label::dynamic_object, label::unlabeled);

[[nodiscard]] inline bool credible_lamp(const StreetLampParams& p, const Intrinsics& k, const GroundPlane& ground,
                                        float u, float v, float z) noexcept {
  if (!is_valid_depth(z) || z > p.max_distance_m) return false;
  const float height = height_above_ground(ground, unproject(k, u, v, z));
  return height >= p.min_height_m && height <= p.max_height_m;
}

// The first row under the head that shows a pole within reach, and the pole's column there; false where there is none.
[[nodiscard]] inline bool find_pole(const RegionInput& in, const LightRegion& r, int reach, int& pole_x,
                                    int& pole_y) noexcept {
  const int middle = (r.x0 + r.x1) / 2;
  for (int y = r.y1; y < in.labels.height(); ++y) {
    // The arm bends down, so the pole may stand further off the lower one looks, at least the head's own width.
    const int band = std::max(r.x1 - r.x0 + 1, std::min(reach, (r.x1 - r.x0 + 1) + (y - r.y1)));
    for (int d = 0; d <= band; ++d) {
      for (const int x : {middle - d, middle + d}) {
        if (x < 0 || x >= in.labels.width() || !kPoleLabels.contains(in.labels(x, y))) continue;
        pole_x = x;
        pole_y = y;
        return true;
      }
    }
  }
  return false;
}

[[nodiscard]] inline float street_lamp_depth(const StreetLampParams& p, const RegionInput& in, const LightRegion& r,
                                             std::uint16_t value, const Intrinsics& k, const GroundPlane& ground,
                                             Span<float> scratch) noexcept {
  const float u = static_cast<float>(r.mean_x());
  const float v = static_cast<float>(r.mean_y());
  const auto credible = [&](float z) { return credible_lamp(p, k, ground, u, v, z); };
  if (!in.labels.empty()) {
    const std::size_t enough = std::max<std::size_t>(2, r.pixels / 10);
    for (const bool certain : {true, false}) {
      const Span<float> own = collect_depth(
          in, r.x0, r.y0, r.x1, r.y1,
          [&](int x, int y) {
            return in.light_index(x, y) == value && kLampHeadLabels.contains(in.labels(x, y)) && is_surface(in, x, y) &&
                   (!certain || is_certain(in, x, y));
          },
          scratch);
      if (own.size() < enough) continue;
      const float z = robust_median(own);
      if (credible(z)) return z;
    }
    // An arm of arm_m spans this many pixels if the head is at the height of a default lamp.
    const Vec3f ray = unproject(k, u, v, 1.0F);
    const float rise = dot(ground.up, ray);
    const float guess_m = rise > 1e-3F ? (p.default_height_m - ground.camera_height_m) / rise : p.max_distance_m;
    const float reach_px = p.arm_m * k.fx / std::min(std::max(guess_m, 2.0F), p.max_distance_m);
    const int reach = static_cast<int>(std::min(reach_px, 0.25F * static_cast<float>(in.labels.width())));
    int pole_x = 0;
    int pole_y = 0;
    if (find_pole(in, r, reach, pole_x, pole_y)) {
      // Follow the pole down, allowing it to lean by a pixel per row and to be interrupted for two.
      int foot_x = pole_x;
      int foot_y = pole_y;
      for (int y = pole_y + 1; y < in.labels.height() && y <= foot_y + 3; ++y) {
        for (const int dx : {0, -1, 1, -2, 2}) {
          const int x = foot_x + dx;
          if (x < 0 || x >= in.labels.width() || !kPoleLabels.contains(in.labels(x, y))) continue;
          foot_x = x;
          foot_y = y;
          break;
        }
      }
      const int half = std::max(3, r.x1 - r.x0 + 1);
      for (const bool certain : {true, false}) {
        const Span<float> pole = collect_depth(
            in, std::min(pole_x, foot_x) - half, pole_y, std::max(pole_x, foot_x) + half, foot_y,
            [&](int x, int y) {
              return kPoleLabels.contains(in.labels(x, y)) && is_surface(in, x, y) &&
                     (!certain || is_certain(in, x, y));
            },
            scratch);
        if (pole.size() < 3) continue;
        const float z = robust_median(pole);
        if (credible(z)) return z;
      }
      const Vec3f foot = unproject(k, static_cast<float>(foot_x) + 0.5F, static_cast<float>(foot_y + 1), 1.0F);
      const float fall = -dot(ground.up, foot);
      if (fall > 1e-3F && foot_y + 1 < in.labels.height()) {
        const float z = ground.camera_height_m / fall;
        if (credible(z)) return z;
      }
    }
  }
  Span<float> any = collect_depth(
      in, r.x0, r.y0, r.x1, r.y1, [&](int x, int y) { return in.light_index(x, y) == value && is_surface(in, x, y); },
      scratch);
  if (!any.empty()) {
    float* quarter = any.data() + (any.size() - 1) / 4;
    std::nth_element(any.data(), quarter, any.data() + any.size());
    if (credible(*quarter)) return *quarter;
  }
  const float rise = dot(ground.up, unproject(k, u, v, 1.0F));
  if (!(rise > 1e-3F)) return 0.0F;
  const float z = (p.default_height_m - ground.camera_height_m) / rise;
  return is_valid_depth(z) ? std::min(z, p.max_distance_m) : 0.0F;
}

}  // namespace light_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LIGHT_DETAIL_STREET_LAMP_HPP
