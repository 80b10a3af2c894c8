// SPDX-License-Identifier: Apache-2.0
// What the sky tells of the day: whether it is the clouds that light the street.
//
// Under closed clouds the sky is the light: it is as blue as grey ground, and ten times as bright as asphalt of .1 and
// more. A clear sky is bluer than ground in the sun, and hardly brighter; over ground in the shade it is as bright as
// clouds, but the shade is bluer still where the picture clips the sky to white. Between them lie white clouds over a
// sunny street, so a dull sky is no proof: under it shadows are believed that are large and deep (ground_light.hpp).
//
// On 33 Cityscapes frames of clouds the sky is .25 less to .3 more blue than the road, log2(blue / red), and 2^2 to 2^5
// as bright; on 60 of the sun -.8 to -.2 or .3 to 1.3, and 2^.8 to 2^3 as bright as a road that the sun reaches.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_SKY_LIGHT_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_SKY_LIGHT_HPP

#include <cmath>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/material/detail/albedo_scene.hpp"
#include "npsim/material/detail/daylight/picture.hpp"
#include "npsim/material/detail/daylight/planes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

struct SkyLightParams {
  float bluer = 0.075F;        // log2(blue / red) of a dull sky less the road's
  float tolerance = 0.275F;    // of that, for a sky that is bright_sky over the road; none at bright_ground
  float bright_ground = 1.0F;  // log2
  float bright_sky = 3.0F;
  float clipped = -0.08F;   // log2 of a channel from which on a pixel has no colour
  float min_share = 2e-4F;  // of the picture, sky that has a colour
};

// True where the sky looks like closed clouds; false where no label, or too little sky, says so.
[[nodiscard]] inline bool is_dull_sky(const SkyLightParams& p, const AlbedoScene& s, const Picture& picture,
                                      Span<std::uint32_t> histogram) noexcept {
  if (s.labels.empty()) return false;
  const Shape shape = picture.shape();
  const auto is_sky = [&](int x, int y) {
    return s.labels(picture.middle_x(x, s.labels.width()), picture.middle_y(y, s.labels.height())) == label::sky;
  };
  const auto has_colour = [&](int x, int y) {
    return is_sky(x, y) && picture.log_rgb[0](x, y) < p.clipped && picture.log_rgb[1](x, y) < p.clipped &&
           picture.log_rgb[2](x, y) < p.clipped;
  };
  const auto is_road = [&](int x, int y) { return picture.region(x, y) == kRoad; };
  float coloured = 0.0F, road = 0.0F;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      coloured += has_colour(x, y) ? 1.0F : 0.0F;
      road += is_road(x, y) ? 1.0F : 0.0F;
    }
  }
  const float fewest = p.min_share * static_cast<float>(shape.pixels());
  if (coloured < fewest || road < fewest) return false;
  const auto middle = [&](const auto& inside, const auto& value) {
    return plane_quantile(shape, inside, value, 0.5F, histogram);
  };
  const float brighter = middle(is_sky, picture.log_y) - middle(is_road, picture.log_y);
  const float bluer = middle(has_colour, picture.colour) - middle(is_road, picture.colour);
  const float sure = (brighter - p.bright_ground) / (p.bright_sky - p.bright_ground);
  return std::fabs(bluer - p.bluer) < p.tolerance * clamp_to(sure, 0.0F, 1.0F);
}

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_SKY_LIGHT_HPP
