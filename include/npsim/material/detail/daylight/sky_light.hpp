// SPDX-License-Identifier: Apache-2.0
// What the sky tells of the day: whether it is the clouds that light the street.
//
// Under closed clouds the sky is the light: it is as blue as grey ground, and ten times as bright as asphalt of .1 and
// more. A clear sky is bluer than ground that the sun reaches, and hardly brighter. White clouds over a sunny street
// lie between them, so a dull sky is no proof: under it shadows are believed that are deep, and large or blue
// (find_ground_light.hpp).
//
// The sky's colour is that of what is neither clipped nor at its border, where leaves and wires mix with it; little of
// it is enough, since most of a cloudy sky is clipped. On Cityscapes of clouds a sky is -.2 to .3 bluer than the road,
// log2(blue / red), and 2^2 to 2^5 as bright; of the sun .3 to 1.3 bluer, and 2^.8 to 2^3 as bright.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_SKY_LIGHT_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_SKY_LIGHT_HPP

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/material/detail/albedo_scene.hpp"
#include "npsim/material/detail/daylight/light_mixture.hpp"
#include "npsim/material/detail/daylight/picture.hpp"
#include "npsim/material/detail/daylight/planes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

// Logarithms are of the photograph as it is decoded, before its contrast: over the power of its codes they are within
// .05 of that for the colours of ground whose codes are above .15.
struct SkyLightParams {
  float bluer = 0.075F;        // log2(blue / red) of a dull sky less that of the ground in the sun
  float tolerance = 0.275F;    // of that, for a sky that is bright_sky over the ground; none at bright_ground
  float bright_ground = 1.0F;  // log2
  float bright_sky = 3.0F;
  float clipped = -0.08F;        // log2 of a channel from which on a pixel has no colour
  float min_of_picture = 1e-4F;  // sky that has a colour, at least
  float min_of_sky = 0.01F;
};

// True where the sky over `ground`, as its sun is taken for, looks like closed clouds; false where no label, or too
// little sky, says so.
[[nodiscard]] inline bool is_dull_sky(const SkyLightParams& p, const AlbedoScene& s, const Picture& picture,
                                      const LightMixture& ground, Span<std::uint32_t> histogram) noexcept {
  if (s.labels.empty()) return false;
  const Shape shape = picture.shape();
  const auto is_sky = [&](int x, int y) {
    return s.labels(picture.middle_x(x, s.labels.width()), picture.middle_y(y, s.labels.height())) == label::sky;
  };
  const auto has_colour = [&](int x, int y) {
    if (!is_sky(x, y)) return false;
    for (const Plane& channel : picture.log_rgb) {
      if (channel(x, y) >= p.clipped * picture.contrast) return false;
    }
    for (int v = std::max(y - 1, 0); v <= std::min(y + 1, shape.height - 1); ++v) {
      for (int u = std::max(x - 1, 0); u <= std::min(x + 1, shape.width - 1); ++u) {
        if (!is_sky(u, v)) return false;
      }
    }
    return true;
  };
  std::uint64_t sky = 0, coloured = 0;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      sky += is_sky(x, y) ? 1U : 0U;
      coloured += has_colour(x, y) ? 1U : 0U;
    }
  }
  const auto fewest = static_cast<std::uint64_t>(
      std::max(p.min_of_picture * static_cast<float>(shape.pixels()), p.min_of_sky * static_cast<float>(sky)));
  if (coloured <= fewest) return false;
  const auto middle = [&](const auto& inside, Plane plane) {
    return plane_quantile(shape, inside, plane, 0.5F, histogram);
  };
  const float brighter = (middle(is_sky, picture.log_y) - ground.sun_y) / picture.contrast;
  const float bluer = (middle(has_colour, picture.colour) - ground.sun_c) / picture.contrast;
  const float sure = (brighter - p.bright_ground) / (p.bright_sky - p.bright_ground);
  return std::fabs(bluer - p.bluer) < p.tolerance * clamp_to(sure, 0.0F, 1.0F);
}

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_SKY_LIGHT_HPP
