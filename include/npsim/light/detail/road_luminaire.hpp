// SPDX-License-Identifier: Apache-2.0
// How luminaires of roads shine: along the road and on it, hardly at the houses, and not at all at the sky.
//
// With c the cosine to straight down, r the component of the direction along the road and s that across it (positive
// over the road), the intensity relative to that straight down is
//   I = (1 + 0.8 r^4) h(s) K(c),   K = t / (1 + t),  t = (c / 0.27)^6,
//   on a mast beside the road   h = 1 over the road, 1 - 0.9 |s| towards the houses behind it;
//   hung over its middle        h = 1 - 0.9 |s| to both sides, since houses stand on both.
// Fitted by hand to the mean of three measured LED road luminaires (public IES files of AEC Italo 1 S05, Maxwell-8-T4
// and one of 60 W), in cd per klm, mean and (fit): down 229 (247); along the road at 50, 60, 65, 70, 75, 80 degrees
// 290 327 349 294 134 32 (312 349 355 322 183 29); over the road at 40, 60, 70, 80: 256 262 161 22 (247 241 200 16);
// to the houses 114 59 33 8 (104 53 31 2); single luminaires differ from their mean by a factor of two.
// On a mast it keeps the limits of class G*6, hung those of G*4 of EN 13201-2 (350 and 500 cd/klm at 70 degrees, 100
// at 80, 10 at 90).
// The glass itself glows with 0.002 of the peak in every direction (0.7 cd/klm; measured 0 to 1 at 90 degrees), so
// that a lamp is seen from everywhere.
#ifndef NPSIM_LIGHT_DETAIL_ROAD_LUMINAIRE_HPP
#define NPSIM_LIGHT_DETAIL_ROAD_LUMINAIRE_HPP

#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr float kRoadLuminaireGlow = 0.002F;    // of the peak
inline constexpr float kRoadLuminairePeak = 1.44336F;  // of I; at 64 degrees along the road
// Integral of I over the sphere (quadrature, 1e-5).
inline constexpr float kMastLuminaireFlux = 4.034808F;
inline constexpr float kHungLuminaireFlux = 3.053712F;

// Relative to the peak; in [0, 1].
template <class F>
[[nodiscard]] F road_luminaire_relative(F c, F r, F s, bool hung) noexcept {
  const F q = c * F(1.0F / 0.27F);
  const F q2 = q * q;
  const F t = q2 * q2 * q2;
  const F r2 = r * r;
  const F away = hung ? abs(s) : max(-s, F(0.0F));
  const F shielded = F(1.0F) - F(0.9F) * min(away, F(1.0F));
  const F value = (F(1.0F) + F(0.8F) * (r2 * r2)) * shielded * (t / (F(1.0F) + t));
  return F(kRoadLuminaireGlow) +
         F((1.0F - kRoadLuminaireGlow) * (1.0F / kRoadLuminairePeak)) * select(c > F(0.0F), value, F(0.0F));
}

[[nodiscard]] constexpr float road_luminaire_flux_sr(bool hung) noexcept {
  return (1.0F - kRoadLuminaireGlow) * (hung ? kHungLuminaireFlux : kMastLuminaireFlux) / kRoadLuminairePeak +
         kRoadLuminaireGlow * 12.5663706F;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LIGHT_DETAIL_ROAD_LUMINAIRE_HPP
