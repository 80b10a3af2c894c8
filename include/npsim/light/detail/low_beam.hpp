// SPDX-License-Identifier: Apache-2.0
// The low beam of a headlamp: a smooth distribution that meets the test points of UN Regulation 112, class B, for
// right-hand traffic.
//
// Coordinates are slopes seen from the lamp: h to its right, v upwards from the horizontal H-H through it (so one
// degree is 0.01746). The cut-off lies 1 % below H-H on the left and rises by 15 degrees on the right (the kerb side),
// up to 1.5 degrees above H-H. Below it stand a hot spot and a wide foreground, both squared Lorentz curves, which fall
// off like a Gaussian near the middle but need no exp; across it the light fades over about 0.3 degrees; above it
// remains a glow of about 90 cd for overhead signs.
// Gradient of the cut-off, G = log10 E(v) - log10 E(v + 0.1 degree): between 0.13 and 0.40, as the regulation asks.
// Templates on a batch of simd/batch.hpp.
// What was fitted: the constants below, by hand, to the points that the test lists. Left-hand traffic mirrors h.
#ifndef NPSIM_LIGHT_DETAIL_LOW_BEAM_HPP
#define NPSIM_LIGHT_DETAIL_LOW_BEAM_HPP

#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr float kLowBeamAim = 0.01F;        // slope by which the axis of an emitter points below the horizontal
inline constexpr float kLowBeamPeakCd = 20196.7F;  // nominal; R112 holds from 0.65 to 1.4 times this

// Height of the cut-off above H-H at slope h.
template <class F>
[[nodiscard]] F low_beam_cutoff(F h) noexcept {
  constexpr float kTan15 = 0.26794919F;
  constexpr float kTop = 0.026F;  // 1.5 degrees
  const F v = select(h > F(0.0F), F(-kLowBeamAim) + F(kTan15) * h, F(-kLowBeamAim));
  return min(v, F(kTop));
}

// Luminous intensity in cd of the nominal lamp; `cosine` to the beam's axis, positive.
template <class F>
[[nodiscard]] F low_beam_cd(F h, F v, F cosine) noexcept {
  constexpr float kDegree = 0.017453293F;
  const F below = low_beam_cutoff(h) - v;  // positive under the cut-off
  const F x = below / F(0.145F * kDegree);
  const F fade = F(0.5F) + F(0.5F) * x / sqrt(F(1.0F) + x * x);
  const F depth = max(below, F(0.0F));

  const F hot_h = (h - F(1.0F * kDegree)) / F(4.5F * kDegree);
  const F hot_v = depth / F(1.9F * kDegree);
  const F hot = F(1.0F) + hot_h * hot_h + hot_v * hot_v;
  const F wide_h = h / F(20.0F * kDegree);
  const F wide_v = depth / F(6.0F * kDegree);
  const F wide = F(1.0F) + wide_h * wide_h + wide_v * wide_v;
  constexpr float kHotCd = 16500.0F;
  constexpr float kWideCd = 5500.0F;
  constexpr float kGlowCd = 90.0F;
  const F c2 = cosine * cosine;
  return (F(kHotCd) / (hot * hot) + F(kWideCd) / (wide * wide)) * fade + F(kGlowCd) * (c2 * c2);
}

// High beam: UN R112 class B asks of the driving beam a greatest intensity of at least 40,500 cd near H-V (and at most
// 215,000), a good part of it 5 degrees to either side. A spot that is wider than high stands on top of the low beam,
// which most cars leave on.
inline constexpr float kHighBeamSpotCd = 48000.0F;
inline constexpr float kHighBeamPeakCd = 62261.0F;  // nominal, with a nominal low beam; 1 degree right, 0.5 below H-H

template <class F>
[[nodiscard]] F high_beam_relative(F h, F v, F cosine) noexcept {
  constexpr float kDegree = 0.017453293F;
  const F x = h / F(7.0F * kDegree);
  const F y = v / F(2.5F * kDegree);
  const F spot = F(1.0F) + x * x + y * y;
  return (low_beam_cd(h, v, cosine) + F(kHighBeamSpotCd) / (spot * spot)) * F(1.0F / kHighBeamPeakCd);
}

// Relative to the peak, which lies 1 degree right and 0.63 below.
template <class F>
[[nodiscard]] F low_beam_relative(F h, F v, F cosine) noexcept {
  return low_beam_cd(h, v, cosine) * F(1.0F / kLowBeamPeakCd);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LIGHT_DETAIL_LOW_BEAM_HPP
