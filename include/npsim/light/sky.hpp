// SPDX-License-Identifier: Apache-2.0
// The night sky over a city: scattered street light, brightest at the horizon.
//
//   L(direction) = zenith + (horizon - zenith) (1 - s)^4,   s = sine of the elevation; nothing from below the horizon.
// Illuminance on a level surface: integral of L s over the upper hemisphere = pi zenith + pi/15 (horizon - zenith).
// City skies measure 0.018 to 0.1 cd/m2 (a natural dark sky has 0.0002). Defaults: the geometric mean of the range in the
// zenith, its top at the horizon: 0.144 lx.
// Colour: horizon glow like a mix of sodium and white lamps, zenith nearly neutral. [default]
#ifndef NPSIM_LIGHT_SKY_HPP
#define NPSIM_LIGHT_SKY_HPP

#include "npsim/core/config.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct SkyParams {
  Vec3f zenith_cd_m2{0.0455F, 0.0413F, 0.0392F};  // linear sRGB; luminance 0.042
  Vec3f horizon_cd_m2{0.145F, 0.0913F, 0.0540F};  // luminance 0.1
  Vec3f up{0.0F, -1.0F, 0.0F};                    // unit; GroundPlane::up of the scene
};

[[nodiscard]] inline Status validate(const SkyParams& p) noexcept {
  const bool good = is_finite(p.zenith_cd_m2) && is_finite(p.horizon_cd_m2) && is_finite(p.up) &&
                    p.zenith_cd_m2.x >= 0 && p.zenith_cd_m2.y >= 0 && p.zenith_cd_m2.z >= 0 && p.horizon_cd_m2.x >= 0 &&
                    p.horizon_cd_m2.y >= 0 && p.horizon_cd_m2.z >= 0;
  return good ? Status() : Status(StatusCode::invalid_argument, "sky luminances must be finite and not negative");
}

// cd/m2, linear RGB; `direction` is a unit vector away from the observer.
[[nodiscard]] inline Vec3f sky_luminance(const SkyParams& p, const Vec3f& direction) noexcept {
  const float s = dot(p.up, direction);
  if (!(s >= 0.0F)) return {};
  const float t = s < 1.0F ? 1.0F - s : 0.0F;
  const float t2 = t * t;
  return p.zenith_cd_m2 + (p.horizon_cd_m2 - p.zenith_cd_m2) * (t2 * t2);
}

// A view direction that shows sky, turned up to the horizon where it lies below: a camera on a crest, or one whose
// ground plane was misjudged, sees sky there, and the glow does not end at an estimate.
[[nodiscard]] inline Vec3f raised_to_horizon(const SkyParams& p, const Vec3f& direction) noexcept {
  const float s = dot(p.up, direction);
  return s >= 0.0F ? direction : normalized(direction - p.up * (s * 1.0001F));
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LIGHT_SKY_HPP
