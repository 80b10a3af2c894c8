// SPDX-License-Identifier: Apache-2.0
// Where a row of pixels leaves a car past its own outline, the body turns away from the eye there.
//
// Bodies have round corners, and at an outline that is the thing's own the line of sight grazes it. The corner is a
// quarter of a cylinder: at t from the outline, measured across the line of sight, the normal has the share 1 - t / r
// along the outline's outward direction, or more where the side itself has. Exact for an upright cylinder far away.
#ifndef NPSIM_DEPTH_DETAIL_THINGS_CAR_RIM_HPP
#define NPSIM_DEPTH_DETAIL_THINGS_CAR_RIM_HPP

#include <cmath>

#include "npsim/core/config.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

namespace car_detail {

// The pixels of a car in one row lie in [first, last]; `own`: whether the outline at that end is the car's, not that of
// something before it or the picture's border.
struct RowEnds {
  int first = 0;
  int last = -1;
  bool own[2] = {false, false};
};

// `right`: of the two ends. t_m: distance from it; radius_m: of the corner.
[[nodiscard]] inline Vec3f round_at_rim(const Vec3f& normal, const Vec3f& ray, const Vec3f& up, bool right, float t_m,
                                        float radius_m) noexcept {
  if (!(t_m < radius_m)) return normal;
  const Vec3f aside = normalized(cross(ray, up));
  const Vec3f outward = (aside.x > 0.0F) == right ? aside : -aside;
  const float sine = 1.0F - t_m / radius_m;
  const float along = dot(normal, outward);
  if (!(along < sine)) return normal;
  return normalized(normal - outward * along) * std::sqrt(1.0F - sine * sine) + outward * sine;
}

}  // namespace car_detail

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_THINGS_CAR_RIM_HPP
