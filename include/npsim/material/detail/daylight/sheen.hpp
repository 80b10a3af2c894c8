// SPDX-License-Identifier: Apache-2.0
// What surfaces mirror by day, besides the light that their albedo throws back (bsdf.hpp).
//
// Ground shows the sky at a grazing angle, the same on dark and bright. Things show what lies where the ray of sight
// goes on: upright faces of a car the street and the lower sky, its bonnet the sky over the roofs. On white paint that
// is little; of black paint on a cloudy day it is three times what the paint throws back.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_SHEEN_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_SHEEN_HPP

#include <algorithm>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/material/detail/specular_albedo.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

inline constexpr float kDryF0 = 0.04F;

// How much more contrast the albedo of ground has than ground shows: where the road's median looks like its `albedo`,
// what looks like `a` has road + (a - road) * contrast. cosine: of the sight to the ground's normal; sky: light of the
// sky over all light there is.
[[nodiscard]] inline float contrast_under_sheen(float alpha, float cosine, float sky, float albedo) noexcept {
  constexpr float kOfSun = 0.5F;  // of what is mirrored on average lies away from the sun's mirror image
  if (alpha > 1.0F) return 1.0F;
  const float mirrored = SpecularAlbedo(alpha, kDryF0)(cosine) * (kOfSun + (1.0F - kOfSun) * sky);
  return 1.0F + mirrored / ((1.0F - mirrored) * albedo);
}

// Albedo of ground that looks like `a` where the road's median looks like `road`. Below that, where noise and dirt
// would become negative, by the power that has the same slope there.
[[nodiscard]] inline Vec3f without_sheen(const Vec3f& road, const Vec3f& a, float contrast) noexcept {
  const auto channel = [contrast](float v, float own) {
    if (!(v > 0.0F)) return v;
    return v > own ? own + (v - own) * contrast : own * exp2_of(contrast * log2_of(v / own));
  };
  return {channel(a.x, road.x), channel(a.y, road.y), channel(a.z, road.z)};
}

// Albedo that would look like what a face mirrors, had it the light of level ground: of the sky alone, and of the
// street in the same light as it. through: share of the light that the gloss lets through to the albedo below.
struct Mirrored {
  float sky = 0.0F, street = 0.0F, through = 1.0F;
};

// sight, normal, up: unit. The sky is as bright as a cloudy one by its elevation (CIE overcast), over roofs and crowns.
[[nodiscard]] inline Mirrored mirrored_by(float alpha, const Vec3f& sight, const Vec3f& normal,
                                          const Vec3f& up) noexcept {
  // Sines of elevations between which the street gives way to the sky: bodies are curved, and normals unsure [default].
  constexpr float kStreetTo = -0.15F, kSkyFrom = 0.35F;
  constexpr float kGrazing = 0.25F;  // least cosine: at outlines normals are the least sure, and mirroring grows fast
  constexpr float kStreet = 0.1F;    // asphalt, and walls in half of the light
  if (alpha > 1.0F) return {};
  const float cosine = -dot(sight, normal);
  const float elevation = clamp_to(dot(sight, up) + 2.0F * cosine * dot(normal, up), -1.0F, 1.0F);
  const float over = clamp_to((elevation - kStreetTo) / (kSkyFrom - kStreetTo), 0.0F, 1.0F);
  const float reflected = SpecularAlbedo(alpha, kDryF0)(std::max(kGrazing, cosine));
  const float sky = (1.0F + 2.0F * std::max(elevation, 0.0F)) * (3.0F / 7.0F);
  return {reflected * over * sky, reflected * (1.0F - over) * kStreet, 1.0F - reflected};
}

// What is left without what is mirrored, which is known to a factor: of the luminance 1 - x + O(x^3) where that is x of
// it, and never less than nothing.
[[nodiscard]] inline Vec3f taken_off(const Vec3f& seen, const Vec3f& mirrored) noexcept {
  const float own = luminance(seen);
  const float off = luminance(mirrored);
  if (!(own > 0.0F) || !(off > 0.0F)) return seen;
  const float x = off / own;
  const float share = 1.0F / (1.0F + x + x * x);
  return seen - mirrored * ((1.0F - share) / x);
}

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_SHEEN_HPP
