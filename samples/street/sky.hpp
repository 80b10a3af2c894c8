// SPDX-License-Identifier: Apache-2.0
// The daytime sky: pale towards the horizon, blue-grey above, soft clouds, a bright haze round the sun.
//
// Radiance relative to a white wall in full sun (about 1).
#ifndef NPSIM_SAMPLES_STREET_SKY_HPP
#define NPSIM_SAMPLES_STREET_SKY_HPP

#include <cmath>
#include <cstdint>

#include "dice.hpp"
#include "layout.hpp"

namespace npsim {
namespace street {

inline Vec3f horizon_radiance(const Layout& l) {
  return mix(Vec3f{0.62F, 0.72F, 0.84F}, Vec3f{0.80F, 0.82F, 0.84F}, l.cloudiness);
}

// Without clouds; what diffuse surfaces see.
inline Vec3f clear_sky(const Layout& l, const Vec3f& d) {
  const float up = d.y > 0 ? d.y : 0.0F;
  const Vec3f zenith = mix(Vec3f{0.17F, 0.32F, 0.62F}, Vec3f{0.40F, 0.46F, 0.55F}, l.cloudiness);
  Vec3f c = mix(horizon_radiance(l), zenith, std::pow(up, 0.55F));
  const float towards = dot(d, l.sun);
  if (towards > 0) c += Vec3f{1.0F, 0.9F, 0.75F} * (0.35F * std::pow(towards, 9.0F));
  return c;
}

inline Vec3f sky_radiance(const Layout& l, const Vec3f& d) {
  Vec3f c = clear_sky(l, d);
  if (d.y > 0.015F) {
    const std::uint32_t seed = static_cast<std::uint32_t>(l.seed) * 977U + 13U;
    // A flat layer, squeezed towards the horizon less than a true plane would be.
    const float h = 1.0F / (d.y + 0.12F);
    const float u = d.x * h * 1.1F;
    const float v = d.z * h * 1.1F;
    const float warp = fractal(u * 0.7F, v * 0.7F, 3, seed + 4, 0);
    const float field = 0.5F + fractal(u + warp * 1.6F, v - warp, 6, seed, 0.01F);
    const float cover = smoothstep(0.66F - 0.34F * l.cloudiness, 0.98F - 0.34F * l.cloudiness, field + 0.1F);
    const float thick = smoothstep(0.5F, 0.95F, field + 0.12F * fractal(u * 2, v * 2, 4, seed + 8, 0.01F));
    const Vec3f cloud = mix(Vec3f{0.98F, 0.97F, 0.95F}, Vec3f{0.66F, 0.68F, 0.72F}, thick);
    c = mix(c, cloud, 0.85F * cover * smoothstep(0.015F, 0.16F, d.y));
    // A closed cover is a grey ceiling with darker rolls.
    const float closed = smoothstep(0.8F, 0.95F, l.cloudiness);
    c = mix(c, c * (0.80F + 0.55F * fractal(u * 0.8F + 3 * warp, v * 0.55F, 5, seed + 20, 0.01F)),
            closed * smoothstep(0.0F, 0.2F, d.y));
  }
  return c;
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_SKY_HPP
