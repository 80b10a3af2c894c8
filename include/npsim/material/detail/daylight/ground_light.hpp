// SPDX-License-Identifier: Apache-2.0
// The light that lies on the ground by day, as find_ground_light.hpp finds it.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_GROUND_LIGHT_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_GROUND_LIGHT_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/color/srgb.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/material/detail/daylight/light_mixture.hpp"
#include "npsim/material/detail/daylight/picture.hpp"
#include "npsim/material/detail/daylight/planes.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

struct GroundLight {
  bool shadow = false;
  int lead = kRoad;                      // kind of ground whose lights the others share
  LightMixture mixture[kGroundRegions];  // of the kinds that the picture has enough of
  Vec3f ratio;                           // log2 of sunlit over shadowed light, per channel
  float ratio_y = 0.0F;                  // of luminance
  Plane sun;    // share of the sun, 0..1, on the ground; of things, once they are lit: where they stand
  Plane level;  // log2: what is left of the light, relative to the road's level
  Plane tint;   // log2(blue / red): how much bluer than by `ratio` it is, 0 or more
  ImageView<std::uint8_t> coloured;  // not 0 on paint that its neighbours light; read where there is a shadow
};

inline constexpr std::size_t kGroundLightPlanes = 3;

// log2 of the light at a share of sun over full sun, for a ratio of lights given as log2.
[[nodiscard]] inline float log_light(float sun, float ratio) noexcept {
  return log2_of(sun + (1.0F - sun) * exp2_of(-ratio));
}

// log2(blue / red) of the light at a share of sun over that of full sun.
[[nodiscard]] inline float log_light_colour(const GroundLight& ground, float sun) noexcept {
  return log_light(sun, ground.ratio.z) - log_light(sun, ground.ratio.x);
}

// Mean share of the sun where `inside`; 1 where nothing is.
template <class Inside>
[[nodiscard]] float sunlit_share(const Picture& picture, const GroundLight& ground, const Inside& inside) noexcept {
  double sum = 0.0, n = 0.0;
  for (int y = 0; y < picture.shape().height; ++y) {
    for (int x = 0; x < picture.shape().width; ++x) {
      if (!inside(x, y)) continue;
      sum += static_cast<double>(ground.sun(x, y));
      n += 1.0;
    }
  }
  return n > 0.0 ? static_cast<float>(sum / n) : 1.0F;
}
[[nodiscard]] inline float sunlit_share(const Picture& picture, const GroundLight& ground) noexcept {
  return sunlit_share(picture, ground, [&](int x, int y) { return picture.is_ground(x, y); });
}

// log2 of the most that a high sun gives over a clear sky. A photograph that shows more has steeper tones than sRGB.
inline constexpr float kMostRatio = 3.0F;

// The power of the codes with which the lights that were found at a power of 1, at the level of sunlit road, are
// kMostRatio apart, or as far as a sensor's own, linear codes set them: no camera's tones are steeper.
[[nodiscard]] inline float contrast_of(const GroundLight& ground) noexcept {
  const float sunlit = srgb_encode(exp2_of(ground.mixture[ground.lead].sun_y));
  const float shadowed = srgb_encode(exp2_of(ground.mixture[ground.lead].sun_y - ground.ratio_y));
  constexpr float kLinear = 1.0F / 2.2F;
  float least = kLinear, most = 1.0F;
  for (int i = 0; i < 12; ++i) {
    const float power = 0.5F * (least + most);
    const float ratio = log2_of(Picture::decoded(sunlit, power) / Picture::decoded(shadowed, power));
    (ratio < kMostRatio ? least : most) = power;
  }
  return least;
}

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_GROUND_LIGHT_HPP
