// SPDX-License-Identifier: Apache-2.0
// Chromaticities (CIE 1931 xy, 2 degrees) of the light sources of a street at night, and of reference whites.
//
// CIE 15:2018 for A, D65 and the LED-B/V and HP series (typical LEDs: B phosphor-converted blue, V phosphor-converted
// violet; high-pressure sodium: HP1 standard, HP2 colour-enhanced). The metal halide and mercury lamps are typical
// values and meant as defaults that a user may replace.
#ifndef NPSIM_COLOR_ILLUMINANTS_HPP
#define NPSIM_COLOR_ILLUMINANTS_HPP

#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct Chromaticity {
  float x = 0.3127F;
  float y = 0.3290F;
};

namespace illuminant {

inline constexpr Chromaticity kD65{0.3127F, 0.3290F};
inline constexpr Chromaticity kA{0.44757F, 0.40745F};  // incandescent, 2856 K

inline constexpr Chromaticity kLedB1{0.4560F, 0.4078F};  // about 2700 K
inline constexpr Chromaticity kLedB2{0.4357F, 0.4012F};  // 3000 K
inline constexpr Chromaticity kLedB3{0.3756F, 0.3723F};  // 4100 K
inline constexpr Chromaticity kLedB4{0.3422F, 0.3502F};  // 5100 K
inline constexpr Chromaticity kLedV1{0.4548F, 0.4044F};  // 2700 K
inline constexpr Chromaticity kLedV2{0.3781F, 0.3775F};  // 4100 K

inline constexpr Chromaticity kHighPressureSodium1{0.5330F, 0.4150F};  // HP1, 2000 K
inline constexpr Chromaticity kHighPressureSodium2{0.4778F, 0.4158F};  // HP2, 2500 K
inline constexpr Chromaticity kMetalHalideWarm{0.4286F, 0.3882F};
inline constexpr Chromaticity kMetalHalideNeutral{0.3731F, 0.3714F};
inline constexpr Chromaticity kMercury{0.3112F, 0.3829F};

}  // namespace illuminant

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_COLOR_ILLUMINANTS_HPP
