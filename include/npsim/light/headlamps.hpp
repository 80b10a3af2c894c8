// SPDX-License-Identifier: Apache-2.0
// The headlamps of the vehicle that carries the camera, as two emitters with mark 0: low beams, or both beams.
//
// Placed by the ground plane: 0.65 m above it (UN R48 allows 0.5 to 1.2 m), 0.6 m to either side of the camera, 1.7 m
// ahead of a windscreen camera (where Cityscapes mounts it), axes 1 % down. The vehicle is taken to point where the
// camera looks. activate_lights() draws their technology and strength once for both.
#ifndef NPSIM_LIGHT_HEADLAMPS_HPP
#define NPSIM_LIGHT_HEADLAMPS_HPP

#include <cmath>
#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/light/emitter.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr std::size_t kEgoHeadlampCount = 2;

struct EgoHeadlampParams {
  float height_m = 0.65F;      // above the ground
  float lateral_m = 0.6F;      // from the camera to either side
  float ahead_m = 1.7F;        // of the camera
  float half_width_m = 0.08F;  // of the luminous area
  float half_height_m = 0.05F;
  float aim = kLowBeamAim;         // slope by which the cut-off falls, UN R48: 0.01 to 0.015 at this height
  bool high_beam = false;          // on top of the low beam
  bool left_hand_traffic = false;  // the low beam rises to the left
};

[[nodiscard]] inline Status validate(const EgoHeadlampParams& p) noexcept {
  const bool good = std::isfinite(p.height_m) && std::isfinite(p.lateral_m) && std::isfinite(p.ahead_m) &&
                    p.half_width_m > 0.0F && p.half_height_m > 0.0F && p.aim >= 0.0F && p.aim <= 0.1F;
  return good ? Status()
              : Status(StatusCode::invalid_argument, "headlamps: a finite place and a luminous area are needed");
}

// Writes the left and the right lamp and returns their number, or 0 where `out` has less room, a parameter is not
// valid or the place is not finite.
[[nodiscard]] inline std::size_t place_ego_headlamps(const EgoHeadlampParams& p, const GroundPlane& ground,
                                                     Span<Emitter> out) noexcept {
  const Vec3f forward = forward_on_ground(ground);
  const Vec3f right = cross(forward, ground.up);  // z forward x (-y) up = x right
  const Vec3f middle = forward * p.ahead_m + ground.up * (p.height_m - ground.camera_height_m);
  if (out.size() < kEgoHeadlampCount || !validate(p).ok() || !is_finite(middle) || !is_finite(right * p.lateral_m)) {
    return 0;
  }
  for (std::size_t i = 0; i < kEgoHeadlampCount; ++i) {
    Emitter e;
    e.centre_m = middle + right * (i == 0 ? -p.lateral_m : p.lateral_m);
    e.half_u_m = right * p.half_width_m;
    e.half_v_m = ground.up * p.half_height_m;
    e.axis = normalized(forward - ground.up * p.aim);
    e.up = normalized(ground.up + forward * p.aim);
    e.area_m2 = 4.0F * p.half_width_m * p.half_height_m;
    e.profile = p.high_beam           ? EmissionProfile::high_beam
                : p.left_hand_traffic ? EmissionProfile::low_beam_left
                                      : EmissionProfile::low_beam;
    e.cls = LightClass::moving_front;
    out[i] = e;
  }
  return kEgoHeadlampCount;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LIGHT_HEADLAMPS_HPP
