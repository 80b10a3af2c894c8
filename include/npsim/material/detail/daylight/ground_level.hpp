// SPDX-License-Identifier: Apache-2.0
// What is left of the ground's light where the share of the sun is known.
//
// 1. A sky half hidden and indirect light change slowly: layers of lit and shadowed ground are each brought to one
//    level over 32 px. Where what is brighter than the mean of wider surroundings is much brighter than the rest of
//    them, it is paint and has no say: the stripes of a crossing are as wide as the window. Shade may be much lighter
//    than the darkest one, and paint in it must be brighter still: crowns let some of the sky through.
// 2. Deep in the shade the sky alone lights the ground, bluer than beside the edges where the ratio of lights is
//    measured. Road and pavement that are nearly grey there have, over 96 px, the colour that they have in the sun, and
//    what is coloured loses as much of its blue; where they are yellower all stays.
// 3. In half shade what is no paint is brought nearer to its neighbourhood.
// 4. Under vehicles nothing lights the ground. What is much darker than its light explains within 30 px of a vehicle is
//    brought to the level of the ground, in overcast scenes too.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_GROUND_LEVEL_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_GROUND_LEVEL_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/window_filter.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/material/detail/daylight/ground_light.hpp"
#include "npsim/material/detail/daylight/light_mixture.hpp"
#include "npsim/material/detail/daylight/picture.hpp"
#include "npsim/material/detail/daylight/planes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

struct GroundLevelParams {
  float layer_px = 32.0F;  // lengths are for 960 px width
  float paint_px = 48.0F;
  float paint_step = 0.6F;           // log2 of paint over what it is painted on, at least
  float paint_step_in_shade = 1.0F;  // where leaves let more or less of the sky through
  float tint_px = 96.0F;
  float max_tint = 0.4F;  // log2(blue / red)
  float coloured = 0.6F;  // log2(blue / red) off the sunlit ground's: as much is no tint of the light
  float contact_px = 30.0F;
};
inline constexpr std::size_t kGroundLevelPlanes = 5 + kWindowMeanPlanes;

// The least weight of a mean over a window.
[[nodiscard]] inline float fewest_in_window(int radius) noexcept {
  constexpr float kShare = 0.02F;
  return kShare * static_cast<float>((2 * radius + 1) * (2 * radius + 1));
}

// Step 2. plain(x, y): in the shade, and as bright as the ground around it is there.
template <class Plain, class Executor>
Status tint_shade(const GroundLevelParams& p, const Picture& picture, const Plain& plain, Plane smooth_c,
                  Workspace& workspace, GroundLight& out, Executor& executor) {
  const auto paved = [&](int x, int y) {
    const std::uint8_t kind = picture.region(x, y);
    return kind == kRoad || kind == kPavement;
  };
  // log2(blue / red) of the ground where `seen` is that of the picture, over what it has in the sun.
  const auto off_grey = [&](int x, int y, float seen) {
    return seen - log_light_colour(out, out.sun(x, y)) - out.mixture[picture.region(x, y)].sun_c;
  };
  const auto grey = [&](int x, int y) {
    const bool bare = paved(x, y) && plain(x, y) && out.coloured(x, y) == 0;
    return bare && std::fabs(off_grey(x, y, smooth_c(x, y))) < p.coloured ? 1.0F : 0.0F;
  };
  const auto bluer = [&](int x, int y) { return off_grey(x, y, picture.log_rgb[2](x, y) - picture.log_rgb[0](x, y)); };
  const float fewest = fewest_in_window(picture.radius(p.layer_px));  // as many tell a level
  NPSIM_RETURN_IF_ERROR(
      window_mean(grey, bluer, picture.radius(p.tint_px), fewest, 0.0F, workspace, out.tint, executor));
  for_pixels(picture.shape(), executor, [&](int x, int y) {
    const float off = paved(x, y) ? clamp_to(out.tint(x, y), 0.0F, p.max_tint) : 0.0F;
    out.tint(x, y) = (1.0F - out.sun(x, y)) * off;
  });
  return {};
}

// Step 1.
template <class Executor>
Status level_layers(const GroundLevelParams& p, const Picture& picture, Plane smooth_c, Workspace& workspace,
                    GroundLight& out, Executor& executor) {
  const WorkspaceScope scope(workspace);
  const Shape shape = picture.shape();
  Plane middle, low, high, lit, shade;
  for (Plane* plane : {&middle, &low, &high, &lit, &shade})
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, *plane));
  const auto residual = [&](int x, int y) {
    const LightMixture& m = out.mixture[picture.region(x, y)];
    return picture.log_y(x, y) - log_light(out.sun(x, y), out.ratio_y) - m.sun_y;
  };
  const auto known = [&](int x, int y) { return picture.is_ground(x, y) && out.mixture[picture.region(x, y)].known; };
  const auto is_lit = [&](int x, int y) { return known(x, y) && out.sun(x, y) > 0.9F; };
  const auto is_shade = [&](int x, int y) { return known(x, y) && out.sun(x, y) < 0.1F; };
  constexpr float kNoneBelow = 16.0F;
  constexpr float kPlain = 1.0F;  // log2: paint is further from the centre, even where a crossing draws that to it
  const int near = picture.radius(p.layer_px);
  // brightest: of the layer's mean about which plain ground is looked for, so that what differs more stays.
  const auto layer = [&](const auto& inside, float brightest, float paint_step, Plane mean) {
    const auto all = [&](int x, int y) { return inside(x, y) ? 1.0F : 0.0F; };
    const auto bounded = [&](int x, int y) { return clamp_to(residual(x, y), -kPlain, kPlain); };
    const auto plain = [&](int x, int y) {
      const float centre = clamp_to(middle(x, y), 0.0F, brightest);
      return inside(x, y) && std::fabs(residual(x, y) - centre) < kPlain;
    };
    const auto above = [&](int x, int y) { return plain(x, y) && residual(x, y) > middle(x, y) ? 1.0F : 0.0F; };
    const auto below = [&](int x, int y) { return plain(x, y) && residual(x, y) <= middle(x, y) ? 1.0F : 0.0F; };
    const auto bare = [&](int x, int y) {
      return plain(x, y) && (residual(x, y) <= middle(x, y) || high(x, y) - low(x, y) < paint_step) ? 1.0F : 0.0F;
    };
    const int wide = picture.radius(p.paint_px);
    NPSIM_RETURN_IF_ERROR(window_mean(all, bounded, wide, fewest_in_window(wide), 0.0F, workspace, middle, executor));
    NPSIM_RETURN_IF_ERROR(window_mean(above, residual, wide, 0.0F, 0.0F, workspace, high, executor));
    // None below: no paint.
    NPSIM_RETURN_IF_ERROR(window_mean(below, residual, wide, 0.0F, kNoneBelow, workspace, low, executor));
    return window_mean(bare, residual, near, fewest_in_window(near), 0.0F, workspace, mean, executor);
  };
  NPSIM_RETURN_IF_ERROR(layer(is_lit, 0.0F, p.paint_step, lit));
  if (out.shadow) {
    NPSIM_RETURN_IF_ERROR(layer(is_shade, kPlain, p.paint_step_in_shade, shade));
    const auto plain_shade = [&](int x, int y) {
      return is_shade(x, y) && std::fabs(residual(x, y) - shade(x, y)) < kPlain;
    };
    NPSIM_RETURN_IF_ERROR(tint_shade(p, picture, plain_shade, smooth_c, workspace, out, executor));
  }
  for_pixels(shape, executor, [&](int x, int y) {
    const float s = out.sun(x, y);
    const float in_shade = out.shadow ? shade(x, y) : 0.0F;
    out.level(x, y) = picture.is_ground(x, y) ? in_shade + (lit(x, y) - in_shade) * s : 0.0F;
  });
  return {};
}

// Step 3: there the share of sun is the least certain, and the neighbourhood knows the albedo better than the pixel.
template <class Executor>
void calm_edges(const Picture& picture, GroundLight& out, Executor& executor) {
  constexpr float kShare = 0.7F;
  constexpr float kPlain = 0.7F, kPaint = 1.2F;  // log2 off: all of it is light, none is
  const int reach = picture.radius(2.0F);
  for_pixels(picture.shape(), executor, [&](int x, int y) {
    const float sun = out.sun(x, y);
    if (!picture.is_ground(x, y)) return;
    bool edge = sun > 0.03F && sun < 0.97F;
    for (int k = 0; k < 9; ++k) {
      const int u = x + (k % 3 - 1) * reach;
      const int v = y + (k / 3 - 1) * reach;
      edge = edge || (out.sun.contains(u, v) && picture.is_ground(u, v) && std::fabs(out.sun(u, v) - sun) > 0.3F);
    }
    if (!edge) return;
    const LightMixture& m = out.mixture[picture.region(x, y)];
    if (!m.known) return;
    const float off = picture.log_y(x, y) - m.sun_y - log_light(sun, out.ratio_y) - out.level(x, y);
    const float plain = clamp_to((kPaint - std::fabs(off)) / (kPaint - kPlain), 0.0F, 1.0F);
    out.level(x, y) += kShare * plain * off;
  });
}

// Step 4.
template <class Executor>
Status lift_contacts(const GroundLevelParams& p, const Picture& picture, Plane smooth_y, Workspace& workspace,
                     GroundLight& out, Executor& executor) {
  constexpr float kFrom = 0.4F, kTo = 0.8F;  // log2 below the level of the ground: none to all of it is occlusion
  const WorkspaceScope scope(workspace);
  const Shape shape = picture.shape();
  Plane rows, near;
  for (Plane* plane : {&rows, &near}) NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, *plane));
  const auto vehicle = [&](int x, int y) { return picture.region(x, y) == kVehicle ? 1.0F : 0.0F; };
  const int radius = picture.radius(p.contact_px);
  const float inverse = 1.0F / fewest_in_window(radius);
  window_sum(vehicle, radius, rows, near, executor);
  for_pixels(shape, executor, [&](int x, int y) {
    if (!picture.is_ground(x, y)) return;
    const LightMixture& m = out.mixture[picture.region(x, y)];
    if (!m.known) return;
    const float off = smooth_y(x, y) - m.sun_y - log_light(out.sun(x, y), out.ratio_y) - out.level(x, y);
    const float lost = clamp_to((-off - kFrom) / (kTo - kFrom), 0.0F, 1.0F);
    out.level(x, y) += off * lost * clamp_to(near(x, y) * inverse, 0.0F, 1.0F);
  });
  return {};
}

// smooth_y, smooth_c: luminance and log2(blue / red) of the picture, smoothed within edges.
template <class Executor>
Status level_ground(const GroundLevelParams& p, const Picture& picture, Plane smooth_y, Plane smooth_c,
                    Workspace& workspace, GroundLight& out, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(level_layers(p, picture, smooth_c, workspace, out, executor));
  if (out.shadow) calm_edges(picture, out, executor);
  return lift_contacts(p, picture, smooth_y, workspace, out, executor);
}

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_GROUND_LEVEL_HPP
