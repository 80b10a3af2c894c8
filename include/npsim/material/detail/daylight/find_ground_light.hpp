// SPDX-License-Identifier: Apache-2.0
// Sun and shadow on the ground, from the photograph alone: what casts the shadow is often no part of the picture.
//
// 1. Luminance and colour, smoothed within edges (guided filter), are fitted by a mixture of two lights: road first,
//    then each other kind of ground with the same ratio of lights (light_mixture.hpp). Stripes have no say: markings
//    on a cloudy day are not the sun (stripes.hpp). No shadow found: the ground is left as it is, so that overcast
//    scenes do not change.
// 2. Posterior of each pixel, then mean field: neighbours that no edge of the picture separates share their light.
//    Coloured paint says nothing of it, and lies in that of the ground around it, unless it is the blue rim of a
//    shadow; so does a bright stripe that is as blue as the shadow, in that of the ground beside it: white paint in
//    the shadow is as bright as asphalt in the sun.
//    Where the sun is hardly yellower than the shadow, most of it may be such paint, wider than a stripe: its pieces
//    that are stripes for the most part are none of it, and steps 1 to 3 begin again.
// 3. The ratio of lights, per channel, is measured where it shows best: means on either side of shadows' edges, the
//    median over all edges of the road. Edges that turn blue may fall by less than the lights say. A weak sun that is
//    hardly yellower than its shadow is paint, and under a dull sky (sky_light.hpp) what is shallow, or small and not
//    blue, is no shadow: beneath cars and on kerbs it is dark in any light.
// 4. Penumbra: within a few pixels of an edge the share of the sun is the mean of its posterior over nine levels. So it
//    is in the shade of road and pavement: what leaves, blinds or glass let through is less than the sun but yellower
//    than the shade, as much as the mixture of both lights says; what is as blue as the shade is another asphalt.
// 5. What is left of the light (ground_level.hpp).
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_FIND_GROUND_LIGHT_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_FIND_GROUND_LIGHT_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/material/detail/albedo_scene.hpp"
#include "npsim/material/detail/daylight/ground_level.hpp"
#include "npsim/material/detail/daylight/ground_light.hpp"
#include "npsim/material/detail/daylight/light_mixture.hpp"
#include "npsim/material/detail/daylight/mean_field.hpp"
#include "npsim/material/detail/daylight/picture.hpp"
#include "npsim/material/detail/daylight/planes.hpp"
#include "npsim/material/detail/daylight/sky_light.hpp"
#include "npsim/material/detail/daylight/stripes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

struct GroundLightParams {
  bool enabled = true;
  SkyLightParams sky;
  LightMixtureParams mixture;
  StripeParams stripes;
  float smooth_px = 4.0F;  // lengths are for 960 px width
  float smooth_epsilon = 0.02F;
  MeanFieldParams field;
  float beside_px = 1.5F;  // of stripes: within that lies the ground that tells their light
  float around_px = 8.0F;
  float edge_near_px = 3.0F;
  float edge_far_px = 16.0F;
  float penumbra_px = 6.0F;
  GroundLevelParams level;
  float min_edge_drop = 0.85F;   // of the mixture's drop, measured at edges
  float clear_edge_drop = 2.0F;  // log2: as much is enough; kinds of asphalt differ by less
  float min_edge_bluer = 0.05F;  // log2(blue / red), measured at edges
  float blue_edge = 0.2F;        // so much that less of a drop is enough:
  float min_blue_drop = 0.75F;   // of the mixture's; bounds of that, log2
  float some_blue_drop = 1.2F, clear_blue_drop = 1.75F;
  float white_bluer = 0.1F;           // of the drop, at most: white paint is hardly yellower than asphalt
  float weak_drop = 1.35F;            // log2: what falls by less
  float weak_bluer = 0.4F;            // is told from paint by its colour, log2(blue / red)
  float dull_drop = 1.7F;             // log2: under a dull sky the drop and what it is bluer add up to this,
  float dull_share = 0.1F;            // and so much of the road lies in either light,
  float dull_blue = 0.6F;             // or the shadow is as blue as nothing on a cloudy day; log2(blue / red)
  float min_drop_of_pavement = 1.0F;  // pavements are of several materials: weak light is not told from them
};

// Its result, the smoothed picture, and what the greediest of the steps takes: shadow_field() and measure_ratio().
inline constexpr std::size_t kFindGroundLightPlanes = kGroundLightPlanes + 2 + 2 + kGuidedFilterPlanes;
static_assert(kGuidedFilterPlanes == 6 && kWindowMeanPlanes == 2 && kGroundLevelPlanes <= 2 + kGuidedFilterPlanes);

inline constexpr float kSure = 8.0F;  // log odds, at most

// Log odds of sun against shadow.
[[nodiscard]] inline float sun_odds(const LightMixtureParams& p, const LightMixture& m, float y, float c) noexcept {
  constexpr float kPaintColour = 0.2F;  // log2(blue / red): white paint is yellowish or bluish
  constexpr float kTiny = 1e-6F;
  const Likelihood l = likelihood(p, m, y, c, kPaintColour);
  return clamp_to(kLn2 * (log2_of(l.sun + l.sun_paint + kTiny) - log2_of(l.shadow + l.shadow_paint + kTiny)), -kSure,
                  kSure);
}

// Coloured paint: no light makes asphalt of it, and by its luminance it may lie in either.
[[nodiscard]] inline bool is_coloured(const LightMixture& m, float y, float c) noexcept {
  constexpr float kFar = 4.0F;  // spreads
  const float off = kFar * m.sigma_c;
  return y > m.sun_y - m.drop && (c < m.sun_c - off || c > m.sun_c + m.bluer + off);
}

// Of coloured ground: as blue and dark as the rim of a shadow below a clear sky, where most of that is seen. Few blue
// paints in the sun are so dark.
[[nodiscard]] inline bool is_dark_blue(const LightMixture& m, float y, float c) noexcept {
  constexpr float kDarker = 1.5F;  // octaves below asphalt in the sun
  return c > m.sun_c + m.bluer && y < m.sun_y - kDarker;
}

// The lights of `lead` on another material: only its own level and colour are free. A kind that lies in one light alone
// fits sun and shadow alike, so the level that materials of the ground differ by decides: within a binary order, grey.
[[nodiscard]] inline LightMixture same_lights(const GroundLightParams& p, const LightMixture& lead, float usual_step,
                                              Span<const LightCell> cells, const float (&levels)[3], float colour) {
  constexpr float kStepSigma = 0.7F;    // log2 of albedo
  constexpr float kColourSigma = 0.3F;  // log2(blue / red) of albedo
  constexpr float kWeight = 0.05F;      // bits per pixel: decides between fits that are as good
  LightMixture best;
  float best_rank = -1e30F;
  for (const float level : levels) {
    for (const bool in_shadow : {false, true}) {
      LightMixture m = lead;
      m.sun_y = level + (in_shadow ? lead.drop : 0.0F);
      m.sun_c = colour - (in_shadow ? lead.bluer : 0.0F);
      m.sunlit = 0.5F;
      for (int i = 0; i < 30; ++i) improve(p.mixture, cells, true, m);
      const float a = (m.sun_y - lead.sun_y - usual_step) / kStepSigma;
      const float b = (m.sun_c - lead.sun_c) / kColourSigma;
      const float rank = m.fit - kWeight * (a * a + b * b);
      if (rank <= best_rank) continue;
      best = m;
      best_rank = rank;
    }
  }
  return best;
}

// log2 of a usual albedo of each kind of ground over the road's.
inline constexpr float kUsualStep[kGroundRegions] = {0.0F, 0.6F, 0.8F, 0.4F};

// Step 1. The lights are looked for on the road, and on the pavement where all of the road lies in one of them.
inline void fit_lights(const GroundLightParams& p, const Picture& picture, ImageView<const std::uint8_t> stripe,
                       Plane smooth_y, Plane smooth_c, Span<std::uint32_t> histogram, Span<LightCell> cells,
                       GroundLight& out) {
  constexpr float kFewest = 200.0F;  // pixels
  const auto fit = [&](int kind, int lead) {
    const auto inside = [&](int x, int y) { return picture.region(x, y) == kind; };
    const auto plain = [&](int x, int y) { return inside(x, y) && stripe(x, y) == 0; };
    const Span<LightCell> found = cells.sub(0, light_cells(plain, smooth_y, smooth_c, histogram, cells));
    LightMixture m;
    float n = 0.0F;
    for (const LightCell& c : found) n += c.count;
    if (n < kFewest) return m;
    const auto quantile = [&](Plane plane, float q) {
      return plane_quantile(picture.shape(), inside, plane, q, histogram);
    };
    const float middle = quantile(smooth_y, 0.5F);
    const float colour = quantile(smooth_c, 0.5F);
    if (lead < 0) {
      m = best_mixture(p.mixture, found, quantile(smooth_y, 0.3F), quantile(smooth_y, 0.6F), quantile(smooth_y, 0.9F),
                       quantile(smooth_c, 0.1F), colour);
    } else {
      const float levels[3] = {quantile(smooth_y, 0.2F), middle, quantile(smooth_y, 0.8F)};
      m = same_lights(p, out.mixture[lead], kUsualStep[kind] - kUsualStep[lead], found, levels, colour);
    }
    m.known = true;
    return m;
  };
  out.mixture[kRoad] = fit(kRoad, -1);
  out.mixture[kPavement] = fit(kPavement, -1);
  const bool paved = !out.mixture[kRoad].shadow && out.mixture[kPavement].shadow &&
                     out.mixture[kPavement].drop >= p.min_drop_of_pavement;
  out.lead = paved ? kPavement : kRoad;
  out.shadow = out.mixture[out.lead].shadow;
  for (int kind = 0; kind < kGroundRegions; ++kind) {
    if (kind == out.lead) continue;
    if (out.shadow) {
      out.mixture[kind] = fit(kind, out.lead);
    } else if (kind != kPavement) {
      out.mixture[kind] = fit(kind, -1);
    }
  }
}

// Of coloured ground and stripes, in GroundLight::coloured; 0: plain.
inline constexpr std::uint8_t kWaitsForLight = 1, kStripeWaits = 2, kLightTold = 3, kDarkBlue = 4;

// Whether a pixel's light is known by itself or by its neighbours.
[[nodiscard]] inline bool is_light_known(const Picture& picture, const GroundLight& g, int x, int y) noexcept {
  const std::uint8_t state = g.coloured(x, y);
  return picture.is_ground(x, y) && (state == 0 || state == kLightTold);
}

// Step 2 on dark blue ground: a piece of it that lies on shade about as much as on ground in the sun is the rim of a
// shadow, as a whole; all else waits as paint does. So does a lane that a shadow touches at its end, or a narrow one at
// its side; one between sun and shade cannot be told from a rim. `around` is scratch.
template <class Executor>
Status tell_blue_rims(float around_px, const Picture& picture, Workspace& workspace, Plane around, GroundLight& out,
                      Executor& executor) {
  constexpr float kNone = -1.0F;
  constexpr double kHalfInSun = 0.65;  // mean share of the sun around, at most
  const auto known = [&](int x, int y) { return is_light_known(picture, out, x, y) ? 1.0F : 0.0F; };
  NPSIM_RETURN_IF_ERROR(
      window_mean(known, out.sun, picture.radius(around_px), 0.0F, kNone, workspace, around, executor));
  const Shape shape = picture.shape();
  const WorkspaceScope scope(workspace);
  Span<std::uint32_t> list;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), list));
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (out.coloured(x, y) != kDarkBlue) continue;
      const Span<const std::uint32_t> piece = list.sub(0, take_piece(out.coloured, x, y, list));
      double sum = 0.0;
      double count = 0.0;
      for (const std::uint32_t i : piece) {
        const float sun = around(place_of(i, shape.width));
        if (sun < 0.5F * kNone) continue;
        sum += static_cast<double>(sun);
        count += 1.0;
      }
      const bool rim = count > 0.0 && sum < kHalfInSun * count;
      for (const std::uint32_t i : piece) {
        out.coloured(place_of(i, shape.width)) = rim ? kLightTold : kWaitsForLight;
        if (rim) out.sun(place_of(i, shape.width)) = 0.0F;
      }
    }
  }
  return {};
}

// Step 2 on ground that waits: its light is that of what is plain within around_px, then that of what has waited beside
// it, so that edges of shadows stay as sharp as they are on the ground beside paint. A stripe between sun and shade
// learns nothing from them, and is plain. `around` is scratch.
template <class Executor>
Status light_by_neighbours(std::uint8_t waiting, float around_px, const Picture& picture, Workspace& workspace,
                           Plane around, GroundLight& out, Executor& executor) {
  constexpr int kRounds = 32;
  constexpr float kNone = -1.0F;
  constexpr float kOneLight = 0.04F;  // variance of the sun's share, at most
  const WorkspaceScope scope(workspace);
  Plane squares;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(picture.shape(), squares));
  const int radius = picture.radius(around_px);
  const auto known = [&](int x, int y) { return is_light_known(picture, out, x, y) ? 1.0F : 0.0F; };
  const auto square = [&](int x, int y) { return out.sun(x, y) * out.sun(x, y); };
  bool goes_on = false;
  for (int y = 0; y < picture.shape().height; ++y) {
    for (int x = 0; x < picture.shape().width; ++x) goes_on = goes_on || out.coloured(x, y) == waiting;
  }
  for (int round = 0; round < kRounds && goes_on; ++round) {
    NPSIM_RETURN_IF_ERROR(window_mean(known, out.sun, radius, 0.0F, kNone, workspace, around, executor));
    if (waiting == kStripeWaits) {
      NPSIM_RETURN_IF_ERROR(window_mean(known, square, radius, 0.0F, kNone, workspace, squares, executor));
    }
    goes_on = false;
    for (int y = 0; y < picture.shape().height; ++y) {
      for (int x = 0; x < picture.shape().width; ++x) {
        const float sun = around(x, y);
        if (out.coloured(x, y) != waiting || sun < 0.5F * kNone) continue;
        goes_on = true;
        const bool told = waiting != kStripeWaits || squares(x, y) - sun * sun < kOneLight;
        out.coloured(x, y) = told ? kLightTold : std::uint8_t{0};
        if (told) out.sun(x, y) = clamp_to(sun, 0.0F, 1.0F);
      }
    }
  }
  return {};
}

// Step 2.
template <class Executor>
Status shadow_field(const GroundLightParams& p, const Picture& picture, ImageView<const std::uint8_t> stripe,
                    Plane smooth_y, Plane smooth_c, Workspace& workspace, GroundLight& out, Executor& executor) {
  const WorkspaceScope scope(workspace);
  const Shape shape = picture.shape();
  Plane odds;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, odds));
  const auto ground = [&](int x, int y) { return picture.is_ground(x, y); };
  for_pixels(shape, executor, [&](int x, int y) {
    const std::uint8_t kind = picture.region(x, y);
    float o = 0.0F;
    out.coloured(x, y) = 0;
    if (kind < kGroundRegions) {
      const LightMixture& m = out.mixture[kind];
      o = m.known ? sun_odds(p.mixture, m, smooth_y(x, y), smooth_c(x, y)) : 0.0F;
      if (kind == kRails) o = kSure;  // between stones and sleepers it is dark in any light
      // Paint in the shadow is blue as the shadow is, which long gaps of it are not.
      const bool blue = m.known && smooth_c(x, y) > m.sun_c + 0.5F * m.bluer;
      if (stripe(x, y) == kBrightStripe && blue) out.coloured(x, y) = kStripeWaits;
      if (kind == kRoad && m.known && is_coloured(m, smooth_y(x, y), smooth_c(x, y))) {
        out.coloured(x, y) = is_dark_blue(m, smooth_y(x, y), smooth_c(x, y)) ? kDarkBlue : kWaitsForLight;
      }
    }
    odds(x, y) = o;
    out.sun(x, y) = kind < kGroundRegions ? logistic(o) : 0.0F;
  });
  NPSIM_RETURN_IF_ERROR(mean_field(p.field, ground, smooth_y, odds, picture, workspace, out.sun, executor));
  NPSIM_RETURN_IF_ERROR(light_by_neighbours(kStripeWaits, p.beside_px, picture, workspace, odds, out, executor));
  NPSIM_RETURN_IF_ERROR(tell_blue_rims(p.around_px, picture, workspace, odds, out, executor));
  return light_by_neighbours(kWaitsForLight, p.around_px, picture, workspace, odds, out, executor);
}

// Step 3.
template <class Executor>
Status measure_ratio(const GroundLightParams& p, const Picture& picture, ImageView<const std::uint8_t> stripe,
                     Span<std::uint32_t> histogram, Workspace& workspace, GroundLight& out, Executor& executor) {
  const WorkspaceScope scope(workspace);
  const Shape shape = picture.shape();
  Plane pure, rows, lit_n, shade_n, lit, shade;
  for (Plane* plane : {&pure, &rows, &lit_n, &shade_n, &lit, &shade}) {
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, *plane));
  }
  const LightMixture& lead = out.mixture[out.lead];
  const auto is_lead = [&](int x, int y) { return picture.region(x, y) == out.lead ? 1.0F : 0.0F; };
  // Off the edge: the window of edge_near_px holds one light only.
  NPSIM_RETURN_IF_ERROR(
      window_mean(is_lead, out.sun, picture.radius(p.edge_near_px), 0.0F, 0.5F, workspace, pure, executor));
  // Asphalt, not paint.
  const auto plain = [&](int x, int y, float level) {
    return picture.region(x, y) == out.lead && stripe(x, y) == 0 && std::fabs(picture.log_y(x, y) - level) < 1.0F;
  };
  const auto is_lit = [&](int x, int y) { return pure(x, y) > 0.95F && plain(x, y, lead.sun_y) ? 1.0F : 0.0F; };
  const auto is_shade = [&](int x, int y) {
    return pure(x, y) < 0.05F && plain(x, y, lead.sun_y - lead.drop) ? 1.0F : 0.0F;
  };
  const int reach = picture.radius(p.edge_far_px);
  window_sum(is_lit, reach, rows, lit_n, executor);
  window_sum(is_shade, reach, rows, shade_n, executor);
  const float fewest = 0.1F * static_cast<float>((2 * reach + 1) * (2 * reach + 1));
  const auto both = [&](int x, int y) { return lit_n(x, y) > fewest && shade_n(x, y) > fewest; };
  constexpr std::uint64_t kFewestPairs = 50;
  std::uint64_t pairs = 0;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) pairs += both(x, y) ? 1U : 0U;
  }
  const auto measure = [&](Plane value) {
    window_sum([&](int x, int y) { return is_lit(x, y) * value(x, y); }, reach, rows, lit, executor);
    window_sum([&](int x, int y) { return is_shade(x, y) * value(x, y); }, reach, rows, shade, executor);
    const auto ratio = [&](int x, int y) { return lit(x, y) / lit_n(x, y) - shade(x, y) / shade_n(x, y); };
    return plane_quantile(shape, both, ratio, 0.5F, histogram);
  };
  // Of the mixture, where no edge has both sides: colours by its drop and a blueness that is shared by the channels.
  out.ratio_y = lead.drop;
  out.ratio = {lead.drop + 0.6F * lead.bluer, lead.drop, lead.drop - 0.4F * lead.bluer};
  if (pairs < kFewestPairs) return {};
  out.ratio_y = measure(picture.log_y);
  out.ratio = {measure(picture.log_rgb[0]), measure(picture.log_rgb[1]), measure(picture.log_rgb[2])};
  return {};
}

// Step 3: whether sun and shadow are what they were taken for.
[[nodiscard]] inline bool is_shadow(const GroundLightParams& p, const AlbedoScene& scene, const Picture& picture,
                                    const GroundLight& found, Span<std::uint32_t> histogram) noexcept {
  const float drop = found.ratio_y;
  const float bluer = found.ratio.x - found.ratio.z;
  const float lead_drop = found.mixture[found.lead].drop;
  const bool falls = drop >= std::min(p.min_edge_drop * lead_drop, p.clear_edge_drop);
  const bool turns =
      bluer >= p.blue_edge && drop >= clamp_to(p.min_blue_drop * lead_drop, p.some_blue_drop, p.clear_blue_drop);
  if (!falls && !turns) return false;
  if (bluer < (drop < p.weak_drop ? p.weak_bluer : p.min_edge_bluer)) return false;
  // Pavements are of several materials: the road must show both lights, whatever shows them best.
  const LightMixture& road = found.mixture[kRoad];
  if (!is_dull_sky(p.sky, scene, picture, road.known ? road : found.mixture[found.lead], histogram)) return true;
  if (!road.known || drop + bluer < p.dull_drop) return false;
  const float sun = sunlit_share(picture, found, [&](int x, int y) { return picture.region(x, y) == kRoad; });
  return std::min(sun, 1.0F - sun) >= p.dull_share || bluer >= p.dull_blue;
}

// One light, in which each kind of ground has its median. Two lights without edges between them are one that changes
// slowly, such as the sky's gloss on a distant road.
inline void forget_shadow(const Picture& picture, Plane smooth_y, Span<std::uint32_t> histogram, GroundLight& out) {
  out.shadow = false;
  out.ratio = {};
  out.ratio_y = 0.0F;
  for (int kind = 0; kind < kGroundRegions; ++kind) {
    LightMixture& m = out.mixture[kind];
    m.shadow = false;
    const auto inside = [&](int x, int y) { return picture.region(x, y) == kind; };
    if (m.known) m.sun_y = plane_quantile(picture.shape(), inside, smooth_y, 0.5F, histogram);
  }
  for (int y = 0; y < picture.shape().height; ++y) {
    for (int x = 0; x < picture.shape().width; ++x) out.sun(x, y) = 1.0F;
  }
}

// Shares of the sun in equal steps of the light from none to all, with log2 of the light and of its blue over red,
// relative to those of the sun.
struct SunLevels {
  static constexpr int kCount = 9;
  float share[kCount], light[kCount], colour[kCount];

  explicit SunLevels(const GroundLight& ground) noexcept {
    const float shade = exp2_of(-ground.ratio_y);
    for (int i = 0; i < kCount; ++i) {
      light[i] = ground.ratio_y * (static_cast<float>(i) / static_cast<float>(kCount - 1) - 1.0F);
      share[i] = (exp2_of(light[i]) - shade) / (1.0F - shade);
      colour[i] = log_light_colour(ground, share[i]);
    }
  }
};

// Step 4. Each level of sun is tried with and without paint, against the albedo that pixels of a certain light have in
// the neighbourhood, and against the colour of its light: paint in the shadow is as bright as asphalt in half of the
// sun, but bluer. In the shade off the edges the picture without its grain is asked, another asphalt in no sun stands
// against all levels, and what is hardly brighter than the shade is texture.
template <class Executor>
Status soften_edges(const GroundLightParams& p, const Picture& picture, Plane smooth_y, Plane smooth_c,
                    Workspace& workspace, GroundLight& out, Executor& executor) {
  const WorkspaceScope scope(workspace);
  const Shape shape = picture.shape();
  Plane blurred, mean, base;
  for (Plane* plane : {&blurred, &mean, &base}) NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, *plane));
  const auto is_ground = [&](int x, int y) { return picture.is_ground(x, y) ? 1.0F : 0.0F; };
  NPSIM_RETURN_IF_ERROR(
      window_mean(is_ground, out.sun, picture.radius(0.5F * p.penumbra_px), 0.0F, 0.5F, workspace, blurred, executor));
  const auto certain = [&](int x, int y) {
    const float c = std::fabs(2.0F * blurred(x, y) - 1.0F);
    return picture.is_ground(x, y) && c > 0.95F ? 1.0F : 0.0F;
  };
  const auto own_level = [&](int x, int y) {
    if (!picture.is_ground(x, y)) return 0.0F;
    const LightMixture& m = out.mixture[picture.region(x, y)];
    return picture.log_y(x, y) - log_light(out.sun(x, y), out.ratio_y) - m.sun_y;
  };
  const auto bounded = [&](int x, int y) { return clamp_to(own_level(x, y), -1.0F, 1.0F); };
  constexpr float kSigma = 0.25F;
  NPSIM_RETURN_IF_ERROR(
      window_mean(certain, bounded, picture.radius(p.edge_far_px), 1.0F, 0.0F, workspace, mean, executor));
  // The same without what some sun reaches, which says nothing of the shade.
  const auto sunless = [&](int x, int y) { return own_level(x, y) < mean(x, y) + kSigma ? certain(x, y) : 0.0F; };
  NPSIM_RETURN_IF_ERROR(
      window_mean(sunless, bounded, picture.radius(p.edge_far_px), 1.0F, 0.0F, workspace, base, executor));
  constexpr float kPaintSigma = 0.6F;
  constexpr float kColourSigma = 0.15F;
  constexpr float kColourSigmaInShade = 0.12F;
  constexpr float kOtherSigma = 0.5F;  // log2 of one asphalt over another
  constexpr float kOtherColourSigma = 0.35F;
  constexpr float kOther = 0.5F;  // how likely another is, over the density of the same at its middle
  constexpr float kTexture = 0.15F, kFleck = 0.35F;  // log2 over the shade: none, all of it is sun
  constexpr float kTold = 0.5F;  // log2(blue / red) of shade over sun, at least, to tell some sun from another asphalt
  const SunLevels levels(out);
  for_pixels(shape, executor, [&](int x, int y) {
    const float near = blurred(x, y);
    if (!picture.is_ground(x, y) || out.coloured(x, y) != 0 || near > 0.98F) return;
    const std::uint8_t kind = picture.region(x, y);
    const bool in_shade = near < 0.02F;
    if (in_shade && ((kind != kRoad && kind != kPavement) || out.ratio.x - out.ratio.z < kTold)) return;
    const LightMixture& m = out.mixture[kind];
    const float seen = (in_shade ? smooth_y(x, y) : picture.log_y(x, y)) - m.sun_y - base(x, y);
    const float colour = smooth_c(x, y) - m.sun_c;
    const float prior = out.sun(x, y) * 0.5F + near * 0.5F;
    const float inverse_sigma_c = 1.0F / (in_shade ? kColourSigmaInShade : kColourSigma);
    float another = 0.0F;  // likelihood of another asphalt in no sun
    if (in_shade) {
      const float a = (seen - levels.light[0]) / kOtherSigma;
      const float c = (colour - levels.colour[0]) / kOtherColourSigma;
      another = kOther * exp2_of(-0.72F * (a * a + c * c));
    }
    float weight = 0.0F;
    float sum = 0.0F;
    for (int i = 0; i < SunLevels::kCount; ++i) {
      const float share = levels.share[i];
      const float a = (seen - levels.light[i]) / kSigma;
      const float b = (seen - levels.light[i] - p.mixture.paint_step) / kPaintSigma;
      const float likely = exp2_of(-0.72F * a * a) + m.paint * kSigma / kPaintSigma * exp2_of(-0.72F * b * b) + 1e-4F;
      const float off = share - prior;
      const float c = (colour - levels.colour[i]) * inverse_sigma_c;
      const float w =
          (likely * exp2_of(-0.72F * c * c) + (i == 0 ? another : 0.0F)) * exp2_of(-4.0F * off * off) + 1e-9F;
      weight += w;
      sum += w * share;
    }
    float share = sum / weight;
    if (in_shade) {
      const float gain = log_light(share, out.ratio_y) - levels.light[0];
      share *= clamp_to((gain - kTexture) / (kFleck - kTexture), 0.0F, 1.0F);
    }
    base(x, y) = share;     // each pixel is read before it is written, and by nobody else
    blurred(x, y) = -1.0F;  // marks what changed
  });
  for_pixels(shape, executor, [&](int x, int y) {
    if (blurred(x, y) < 0.0F) out.sun(x, y) = base(x, y);
  });
  return {};
}

template <class Executor>
Status find_ground_light(const GroundLightParams& p, const AlbedoScene& scene, const Picture& picture,
                         Workspace& workspace, GroundLight& out, Executor& executor) {
  const Shape shape = picture.shape();
  for (Plane* plane : {&out.sun, &out.level, &out.tint}) {
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, *plane));
  }
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, out.coloured));
  for_pixels(shape, executor, [&](int x, int y) {
    out.sun(x, y) = 1.0F;
    out.level(x, y) = 0.0F;
    out.tint(x, y) = 0.0F;
  });
  if (!p.enabled) return {};
  const WorkspaceScope scope(workspace);
  Plane smooth_y, smooth_c;
  Span<std::uint32_t> histogram;
  Span<LightCell> cells;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, smooth_y));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, smooth_c));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(kCellsY * kCellsC), histogram));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(kCellsY * kCellsC), cells));
  const auto ground = [&](int x, int y) { return picture.is_ground(x, y); };
  const int radius = picture.radius(p.smooth_px);
  NPSIM_RETURN_IF_ERROR(
      guided_filter(ground, picture.log_y, picture.colour, radius, p.smooth_epsilon, workspace, smooth_c, executor));
  NPSIM_RETURN_IF_ERROR(
      guided_filter(ground, picture.log_y, picture.log_y, radius, p.smooth_epsilon, workspace, smooth_y, executor));
  ImageView<std::uint8_t> stripe;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, stripe));
  NPSIM_RETURN_IF_ERROR(find_stripes(p.stripes, scene, picture, smooth_y, workspace, stripe, executor));
  const auto find_lights = [&]() -> Status {
    fit_lights(p, picture, stripe, smooth_y, smooth_c, histogram, cells, out);
    if (!out.shadow) return {};
    NPSIM_RETURN_IF_ERROR(shadow_field(p, picture, stripe, smooth_y, smooth_c, workspace, out, executor));
    NPSIM_RETURN_IF_ERROR(measure_ratio(p, picture, stripe, histogram, workspace, out, executor));
    out.shadow = is_shadow(p, scene, picture, out, histogram);
    return {};
  };
  NPSIM_RETURN_IF_ERROR(find_lights());
  if (out.shadow && out.ratio.x - out.ratio.z < p.white_bluer * out.ratio_y) {
    bool grown = false;
    const auto sunny_road = [&](int x, int y) { return picture.region(x, y) == kRoad && out.sun(x, y) > 0.5F; };
    NPSIM_RETURN_IF_ERROR(grow_stripes(p.stripes, picture, sunny_road, workspace, stripe, grown, executor));
    if (grown) NPSIM_RETURN_IF_ERROR(find_lights());
  }
  if (out.shadow) {
    NPSIM_RETURN_IF_ERROR(soften_edges(p, picture, smooth_y, smooth_c, workspace, out, executor));
  } else {
    forget_shadow(picture, smooth_y, histogram, out);
  }
  return level_ground(p.level, picture, smooth_y, smooth_c, workspace, out, executor);
}

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_FIND_GROUND_LIGHT_HPP
