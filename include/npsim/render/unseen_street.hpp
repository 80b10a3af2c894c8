// SPDX-License-Identifier: Apache-2.0
// The light of the street that the camera does not see. A street goes on behind and beside the camera, and behind what
// stands in the picture; rays that leave the modelled scene there, or meet the back of a surface, find neither lamp nor
// sky, but surfaces a share as bright as those in the picture.
//
// With s the sine of its elevation a ray that leaves sees
//   s < 0           the share of the mean luminance of what the picture shows below the camera's height,
//   0 <= s < top    that of what it shows above, times w = (1 - s / top)^2: it falls off like the light of lamps that
//                   shine down; the rest, 1 - w, is sky;
// and one that meets the back of a surface, which stands, that of what the picture shows above.
// The share is less than 1 because the picture shows a lit road from near by, and much of what it does not show is
// yards and backs: against the true nights of generated streets houses came out .5 stops too bright with the whole
// mean, .15 with the default (bias, mean of seeds 1 to 5).
// Means are over the pixels that show a surface, of direct light alone, and without the own headlamps, which light the
// picture and nothing else; so this light is linear in the lamps, and nights remain sums of their lamps. No mean
// exceeds what surfaces send out, so no light is created. Error: the difference between the street that is seen and
// that which is not; of the mean itself, taken over every 17th pixel, about 1 %.
// Cost: one sum over every 17th pixel. Memory: none.
#ifndef NPSIM_RENDER_UNSEEN_STREET_HPP
#define NPSIM_RENDER_UNSEEN_STREET_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/render/light_images.hpp"
#include "npsim/render/surface_points.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct UnseenStreetParams {
  float share = 0.5F;  // of the means that the unseen street has, 0..1; 0: it is dark
  float top = 0.7F;    // sine of the elevation at which its houses end, 0..1: as high as the street is wide [default]
};

[[nodiscard]] inline Status validate(const UnseenStreetParams& p) noexcept {
  const bool good = p.share >= 0.0F && p.share <= 1.0F && p.top > 0.0F && p.top <= 1.0F;
  return good ? Status() : Status(StatusCode::invalid_argument, "unseen street: share in [0, 1], top in (0, 1]");
}

// How much of each of the two means a ray sees that is left without a surface: x below the horizon, y above it.
[[nodiscard]] inline Vec2f unseen_weights(const UnseenStreetParams& p, float sine) noexcept {
  if (!(p.share > 0.0F)) return {};
  if (sine < 0.0F) return {p.share, 0.0F};
  const float t = sine < p.top ? 1.0F - sine / p.top : 0.0F;
  return {0.0F, p.share * (t * t)};
}

// Mean luminance of the surfaces in the picture, cd/m2, linear RGB.
struct UnseenStreetLight {
  Vec3f below, above;  // the camera's height

  [[nodiscard]] Vec3f luminance(const Vec2f& weights) const noexcept { return below * weights.x + above * weights.y; }
};

// Of kLightsAtOnce lights: `exitance` of direct light, kLightLanes a point. receivers: the points that pixels show; up:
// unit.
inline void unseen_street_light(const SurfacePoints& points, Span<const std::uint32_t> receivers, const Vec3f& up,
                                Span<const float> exitance, UnseenStreetLight (&out)[kLightsAtOnce]) noexcept {
  constexpr std::size_t kEvery = 17;  // no divisor of an image's width, so that the pixels are no columns
  constexpr float kInversePi = 0.31830989F;
  float below = 0.0F;
  float above = 0.0F;
  for (UnseenStreetLight& light : out) light = {};
  for (std::size_t r = 0; r < receivers.size(); r += kEvery) {
    const std::uint32_t p = receivers[r];
    const bool low = dot(up, points.position[p]) < 0.0F;
    (low ? below : above) += 1.0F;
    const float* const from = exitance.data() + std::size_t{p} * kLightLanes;
    for (std::size_t i = 0; i < kLightsAtOnce; ++i) {
      (low ? out[i].below : out[i].above) += Vec3f{from[3 * i], from[3 * i + 1], from[3 * i + 2]};
    }
  }
  for (UnseenStreetLight& light : out) {
    if (below > 0.0F) light.below = light.below * (kInversePi / below);
    if (above > 0.0F) light.above = light.above * (kInversePi / above);
  }
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_UNSEEN_STREET_HPP
