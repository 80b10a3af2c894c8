// SPDX-License-Identifier: Apache-2.0
// How bright the sources of light are: lamps by class, and the night sky.
#ifndef NPSIM_LIGHT_LIGHT_SET_HPP
#define NPSIM_LIGHT_LIGHT_SET_HPP

#include "npsim/color/chromaticity.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/light_classes.hpp"
#include "npsim/light/emitter.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// What the light sources of each class are like: how often they are on, how strong, and of which colour.
//
// Activation ranges are those of the published successor of the method (SOLO, WACV 2025): p ~ U(p_low, p_high).
// Strengths are in the unit of the profile (photometry.hpp): lm of the luminaire, cd at the peak, cd/m2.
// Sources: UN R7 (rear position 4-17 cd, stop 60-185 cd, front position 4-140 cd), R112 (low beam), EN 12368 (signals,
// dimmed by night); street lamps: LED 60-100 W at 140-200 lm/W, sodium 70-150 W (6-17 klm), both times 0.8 for the
// optics. Windows: a room of 30 to 150 lx (EN 12464-1 asks 100 to 500 lx of places of work) on walls of albedo 0.5 has
// 5 to 25 cd/m2, of which curtains, blinds and the angle leave a tenth to all: two thirds lie at 1 to 8 cd/m2, one in
// fifty above 13. Shop windows: 300 lx (EN 12464-1, sales areas) on goods of albedo 0.5 have 48 cd/m2, what spots are
// turned to several times that [default]; most stay lit in the evening [default]. Signs: bright enough to be read
// beside a lit road of 1 cd/m2, far below the 400 cd/m2 that CIE 150
// allows in towns, because most are dimmed by night [default]. CIE illuminants LED-B1..V2, HP1, HP2 (CIE 015:2018);
// black-body points for windows. Entries marked [default] are plausible, not measured.

// One measured light source, from a user's data set E (section 3.6.2). Entries of a class replace its default strengths
// and colours; where there are several, one is drawn.
struct LightSetEntry {
  LightClass cls = LightClass::none;
  float strength = 0;  // in the unit of the class's profile
  Vec2f xy;
  const LuminaireTable* luminaire = nullptr;  // of a class of street lamps: how all of them shine; else as placed
};

// Street lamps of classes that the set has a luminaire for shine as that one: the first of their class, since a lamp's
// optics stay when its strength and colour are drawn anew.
inline void assign_luminaires(Span<const LightSetEntry> set, Span<Emitter> emitters) noexcept {
  for (Emitter& e : emitters) {
    for (const LightSetEntry& entry : set) {
      if (entry.cls != e.cls || entry.luminaire == nullptr || !is_street_profile(e.profile)) continue;
      e.profile = EmissionProfile::measured;
      e.luminaire = entry.luminaire;
      break;
    }
  }
}

inline constexpr int kMaxChromaticities = 8;

struct LightClassModel {
  float p_low = 0, p_high = 0;
  float strength_low = 0, strength_high = 0;  // drawn with uniform square root: many dim ones, few bright ones
  Vec2f xy[kMaxChromaticities] = {};
  int xy_count = 0;
};

namespace chromaticity {
inline constexpr Vec2f k2700{0.4599F, 0.4106F}, k3000{0.4369F, 0.4041F}, k3200{0.4234F, 0.3990F},
    k3500{0.4053F, 0.3907F}, k4000{0.3805F, 0.3768F}, k5000{0.3451F, 0.3516F}, k5500{0.3325F, 0.3411F},
    k6500{0.3135F, 0.3237F};  // black body, K
[[nodiscard]] constexpr Vec2f of(const Chromaticity& c) noexcept { return {c.x, c.y}; }
inline constexpr Vec2f led_b1 = of(illuminant::kLedB1), led_b2 = of(illuminant::kLedB2),
                       led_b3 = of(illuminant::kLedB3), led_b4 = of(illuminant::kLedB4),
                       led_v1 = of(illuminant::kLedV1), led_v2 = of(illuminant::kLedV2);
inline constexpr Vec2f hp1 = of(illuminant::kHighPressureSodium1), hp2 = of(illuminant::kHighPressureSodium2);
inline constexpr Vec2f signal_red{0.633F, 0.321F}, signal_amber{0.536F, 0.413F}, signal_green{0.289F, 0.429F};
inline constexpr Vec2f rear_red{0.68F, 0.31F};
inline constexpr Vec2f moon{0.379F, 0.376F};  // sunlight off grey rock: 4100 K [default]
}  // namespace chromaticity

inline constexpr float kStopLampCd[2] = {60.0F, 185.0F};
inline constexpr float kIndicatorCd[2] = {50.0F,
                                          200.0F};  // UN R6, category 2a: 50 to 500 cd; most are made at its foot

[[nodiscard]] constexpr LightClassModel light_class_model(LightClass cls, EmissionProfile profile) noexcept {
  using namespace chromaticity;
  const bool signal = profile == EmissionProfile::signal;
  switch (cls) {
    case LightClass::window_building: return {0.3F, 0.6F, 0.5F, 15.0F, {k2700, k2700, k3000, k3500, k4000}, 5};
    case LightClass::window_parked: return {0.1F, 0.4F, 0.5F, 5.0F, {k3000, k4000}, 2};  // cabin lamp [default]
    case LightClass::parked_front: return {0.1F, 0.3F, 4.0F, 60.0F, {k3200, k5500}, 2};
    case LightClass::parked_rear: return {0.1F, 0.3F, 4.0F, 17.0F, {rear_red}, 1};
    case LightClass::moving_front:
      if (signal) return {0.95F, 1.0F, 20.0F, 140.0F, {k3200, k5500}, 2};  // bicycles [default]
      // Both beams: as many times that as the nominal lamps' peaks are apart (detail/low_beam.hpp).
      if (profile == EmissionProfile::high_beam) return {0.95F, 1.0F, 43000.0F, 86000.0F, {k3200, k3200, k5500}, 3};
      return {0.95F, 1.0F, 14000.0F, 28000.0F, {k3200, k3200, k5500}, 3};
    case LightClass::moving_rear: return {0.95F, 1.0F, 4.0F, 17.0F, {rear_red}, 1};
    case LightClass::window_transport: return {0.9F, 1.0F, 5.0F, 30.0F, {k4000, k5000}, 2};  // [default]
    case LightClass::street_light_ht:
      return {1.0F, 1.0F, 7000.0F, 16000.0F, {led_b1, led_v1, led_b2, led_b3, led_b3, led_v2, led_v2, led_b4}, 8};
    case LightClass::street_light_lt: return {1.0F, 1.0F, 5000.0F, 14000.0F, {hp1, hp2}, 2};
    case LightClass::advertisement: return {0.6F, 0.8F, 8.0F, 60.0F, {k4000, k5000, k6500}, 3};
    case LightClass::clock: return {0.8F, 1.0F, 5.0F, 30.0F, {k4000, k5000}, 2};  // [default]
    case LightClass::inferred_object:
      if (signal) return {1.0F, 1.0F, 50.0F, 200.0F, {signal_red, signal_amber, signal_green}, 3};
      return {1.0F, 1.0F, 20.0F, 100.0F, {k4000}, 1};
    default: break;
  }
  return {};
}

// Of windows of buildings that are shop fronts, or outshine the day.
inline constexpr LightClassModel kShopFront{
    0.7F, 0.95F, 15.0F, 120.0F, {chromaticity::k3000, chromaticity::k3500, chromaticity::k4000, chromaticity::k5000},
    4};

// The night sky over a city: scattered street light, brightest at the horizon.
//
//   L(direction) = zenith + (horizon - zenith) (1 - s)^4,   s = sine of the elevation; nothing from below the horizon.
// Illuminance on a level surface: integral of L s over the upper hemisphere = pi zenith + pi/15 (horizon - zenith).
// City skies measure 0.018 to 0.1 cd/m2 (a natural dark sky has 0.0002). Defaults: the geometric mean of the range in the
// zenith, its top at the horizon: 0.144 lx.
// Colour: horizon glow like a mix of sodium and white lamps, zenith nearly neutral. [default]

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

#endif  // NPSIM_LIGHT_LIGHT_SET_HPP
