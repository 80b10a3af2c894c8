// SPDX-License-Identifier: Apache-2.0
// From what a data sheet says of a source (lumens, candelas, cd/m2) to intensity and luminance, in SI units.
//
// Flux of a profile per candela of its peak, integral of relative_intensity over the sphere (exact but for low_beam):
//   lambert pi;  signal 2 pi / 5;  lantern (1 - g) 5 pi / 6 + 4 pi g;  low_beam 0.02188 and high_beam 0.01945
//   (quadrature, 0.1 %); street_luminaire 2.8150, hung_luminaire 2.1366 (quadrature, 1e-5); measured: of its table
// Example: 10 klm of street_luminaire have their peak at 3550 cd and 2450 cd straight down, so 38 lx at 8 m.
// Luminance that the camera sees: intensity towards it / luminous area seen, so that what a pixel shows and what glare
// spreads agree with the intensity; for lambert this is the luminance itself. It is bounded by the luminance of the
// bare light source, because annotated regions of two or three pixels have no reliable area.
#ifndef NPSIM_LIGHT_PHOTOMETRY_HPP
#define NPSIM_LIGHT_PHOTOMETRY_HPP

#include <cmath>
#include <cstdint>

#include "npsim/color/chromaticity.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/light/emitter.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// The unit in which the strength of a class is given.
enum class StrengthUnit : std::uint8_t { lumen, candela, candela_per_m2 };

[[nodiscard]] constexpr StrengthUnit strength_unit(EmissionProfile profile) noexcept {
  switch (profile) {
    case EmissionProfile::street_luminaire:
    case EmissionProfile::hung_luminaire:
    case EmissionProfile::lantern:
    case EmissionProfile::measured: return StrengthUnit::lumen;
    case EmissionProfile::low_beam:
    case EmissionProfile::low_beam_left:
    case EmissionProfile::high_beam:
    case EmissionProfile::signal: return StrengthUnit::candela;  // at the peak
    case EmissionProfile::lambert: break;
  }
  return StrengthUnit::candela_per_m2;
}

// lm per cd of peak intensity, so sr; of any profile but measured.
[[nodiscard]] constexpr float profile_flux_sr(EmissionProfile profile) noexcept {
  constexpr float kPi = 3.14159265F;
  switch (profile) {
    case EmissionProfile::street_luminaire: return road_luminaire_flux_sr(false);
    case EmissionProfile::hung_luminaire: return road_luminaire_flux_sr(true);
    case EmissionProfile::lantern: return (1.0F - kLanternGlow) * 5.0F * kPi / 6.0F + 4.0F * kPi * kLanternGlow;
    case EmissionProfile::low_beam:
    case EmissionProfile::low_beam_left: return 0.02188F;
    case EmissionProfile::high_beam: return 0.01945F;
    case EmissionProfile::signal: return 2.0F * kPi / 5.0F;
    case EmissionProfile::lambert:
    case EmissionProfile::measured: break;
  }
  return kPi;
}

// The same of an emitter, whose luminaire may be measured; 0 where its table is missing.
[[nodiscard]] inline float flux_sr(const Emitter& e) noexcept {
  if (e.profile != EmissionProfile::measured) return profile_flux_sr(e.profile);
  return e.luminaire != nullptr ? e.luminaire->flux_sr : 0.0F;
}

// Greatest luminance that an emitter of a profile may show, cd/m2: a lit LED or a tungsten filament behind its optics,
// a signal of 200 cd over a 200 mm disc, whatever a mark that is too small or too near says, a billboard by night times
// ten. [default]
[[nodiscard]] constexpr float luminance_cap_cd_m2(EmissionProfile profile) noexcept {
  switch (profile) {
    case EmissionProfile::street_luminaire:
    case EmissionProfile::hung_luminaire:
    case EmissionProfile::lantern:
    case EmissionProfile::measured: return 3e5F;
    case EmissionProfile::low_beam:
    case EmissionProfile::low_beam_left:
    case EmissionProfile::high_beam: return 1e6F;
    case EmissionProfile::signal: return 6400.0F;
    case EmissionProfile::lambert: break;
  }
  return 1e3F;
}

// Peak intensity in cd of a source of a strength in its profile's unit; a lambert surface needs its area.
[[nodiscard]] constexpr float peak_intensity_cd(EmissionProfile profile, float strength, float area_m2) noexcept {
  switch (strength_unit(profile)) {
    case StrengthUnit::lumen: return strength / profile_flux_sr(profile);
    case StrengthUnit::candela: return strength;
    case StrengthUnit::candela_per_m2: break;
  }
  return strength * area_m2;
}

// The same of an emitter.
[[nodiscard]] inline float peak_intensity_cd(const Emitter& e, float strength) noexcept {
  if (e.profile != EmissionProfile::measured) return peak_intensity_cd(e.profile, strength, e.area_m2);
  const float sr = flux_sr(e);
  return sr > 0.0F ? strength / sr : 0.0F;
}

// Linear RGB of luminance 1 with chromaticity (x, y). Outside the gamut of sRGB negative channels are dropped, not
// mixed away with white: a red lamp is overexposed a hundredfold, where white's share of blue would turn it magenta.
// White where (x, y) is no colour. Luminance is exactly that of core/vec.hpp, so that photometric values survive.
[[nodiscard]] constexpr Vec3f light_rgb(const Vec2f& xy) noexcept {
  const auto x = static_cast<double>(xy.x);
  const auto y = static_cast<double>(xy.y);
  if (!(x >= 0.0 && y >= 1e-3 && x + y <= 1.0 + 1e-6)) return {1.0F, 1.0F, 1.0F};
  const Vec3f raw = vec_cast<float>(xyz_to_linear_srgb({x / y, 1.0, (1.0 - x - y) / y}));
  const Vec3f rgb{raw.x > 0.0F ? raw.x : 0.0F, raw.y > 0.0F ? raw.y : 0.0F, raw.z > 0.0F ? raw.z : 0.0F};
  return rgb / luminance(rgb);
}

// Chromaticity of linear RGB; that of D65 for black and for what is no colour.
[[nodiscard]] constexpr Vec2f light_xy(const Vec3f& rgb) noexcept {
  const Chromaticity xy = linear_srgb_to_xy(rgb).value_or(illuminant::kD65);
  return {xy.x, xy.y};
}

// Luminance in cd/m2 of the emitter's pixels for a camera at the origin.
[[nodiscard]] inline float seen_luminance_cd_m2(const Emitter& e, float peak_cd) noexcept {
  const float cap = luminance_cap_cd_m2(e.profile);
  const float distance = length(e.centre_m);
  if (!(e.area_m2 > 0.0F) || !(distance > 0.0F) || !(peak_cd > 0.0F)) return 0.0F;
  float value = peak_cd / e.area_m2;  // lambert: intensity and projected area both carry the same cosine
  if (e.profile != EmissionProfile::lambert) {
    // area_m2 is parallel to the image; seen along the ray it shrinks by the cosine to the optical axis.
    const float cosine = std::fabs(e.centre_m.z) / distance;
    value *= relative_intensity(e, -e.centre_m / distance) / (cosine > 0.05F ? cosine : 0.05F);
  }
  return value < cap ? value : cap;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LIGHT_PHOTOMETRY_HPP
