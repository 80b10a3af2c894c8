// SPDX-License-Identifier: Apache-2.0
// Albedo and the sun's share from the daytime photograph, where no inverse-rendering network supplies them.
//
// 1. Linear: sRGB decoded (IEC 61966-2-1); logarithms at a working size (detail/daylight/picture.hpp).
// 2. Ground: sun and shadow, and the ratio of their lights per channel (detail/daylight/find_ground_light.hpp).
//    Overcast scenes have one light. Where the ratio is more than daylight has, the camera's tones are steeper than
//    sRGB (raw-like recordings are): both steps once more with the power of the codes that makes it about as much, or
//    that gives back linear ones.
// 3. Scale: asphalt in the sun meets the prior of detail/class_priors.hpp. All other ground, vehicles, people and
//    things share this scale, so that a black car stays black; facades and plants, whose light differs by direction,
//    meet their own priors.
// 4. Standing things: detail/daylight/standing_light.hpp, walls by the sun's direction where they show it
//    (detail/daylight/sun.hpp), and which faces of objects the sun reaches (detail/daylight/sunny_faces.hpp). On cars
//    panes (detail/daylight/panes.hpp) and tyres are told from paint by where they are and how they differ. What is
//    brighter than panes_limit times an object's median is half drawn in, because much of it is the sky that paint and
//    panes show.
// 5. Colour: the road's cast is divided out to the share that `cast_removal` states. What is dark, or saturated (a
//    channel at or above saturated_level) and nearly white, has no trustworthy colour and becomes grey, or of the
//    colour of the picture's other plants; no channel leaves the bounds of paint.
// 6. Sheen (detail/daylight/sheen.hpp): what ground mirrors of the sky at the sight's angle (bsdf.hpp), the same of
//    dark and bright, is taken out of its contrast, and what things mirror of sky and street is taken off, grey as it
//    is; where a road gave the scale and camera and ground plane are known, and before doubtful colours become grey.
// 7. Bounds: a pixel brighter than its class's level by more than a factor of `free_ratio` is drawn in, by a slope, not
//    cut, so that what differs stays different; values in [min_albedo, max_albedo].
// Invariant: output is finite and within the bounds; pixels without surface get the neutral prior.
// It is an estimate up to a factor that the road's prior sets, not a measurement.
// Cost: some 200 loops over the working image, 370 where there is a shadow, 100 more where there are cars; steps 1 and
// 2 twice where tones are steep, step 2 where white paint seemed to be the sun; 50 ns a pixel of ground and
// things for step 6. The same bits for any thread count.
// Memory: estimate_albedo_workspace_bytes().
#ifndef NPSIM_MATERIAL_ALBEDO_HPP
#define NPSIM_MATERIAL_ALBEDO_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/material/detail/albedo_scene.hpp"
#include "npsim/material/detail/class_priors.hpp"
#include "npsim/material/detail/daylight/find_ground_light.hpp"
#include "npsim/material/detail/daylight/ground_light.hpp"
#include "npsim/material/detail/daylight/objects.hpp"
#include "npsim/material/detail/daylight/panes.hpp"
#include "npsim/material/detail/daylight/picture.hpp"
#include "npsim/material/detail/daylight/sheen.hpp"
#include "npsim/material/detail/daylight/standing_light.hpp"
#include "npsim/material/detail/daylight/sun.hpp"
#include "npsim/material/detail/daylight/sunny_faces.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct AlbedoParams {
  float cast_removal = 0.7F;  // 0 keeps the colour cast, 1 makes sunlit road grey
  bool remove_light = true;   // steps 2, 4 and 6
  int saturated_level = 250;  // 1..256; 256 switches the treatment off
  float free_ratio = 6.0F;    // > 1: of luminance to the level of the class; white paint has .6 on asphalt of .1
  float panes_limit = 1.2F;   // of an object's luminance to its median
  float min_albedo = 0.015F;
  float max_albedo = 0.9F;
};

[[nodiscard]] inline Status validate(const AlbedoParams& p) noexcept {
  const bool good = p.cast_removal >= 0.0F && p.cast_removal <= 1.0F && p.saturated_level >= 1 &&
                    p.saturated_level <= 256 && p.free_ratio > 1.0F && std::isfinite(p.free_ratio) &&
                    p.panes_limit >= 1.0F && p.min_albedo >= 0.0F && p.max_albedo > p.min_albedo &&
                    p.max_albedo <= 1.0F;
  return good ? Status() : Status(StatusCode::invalid_argument, "albedo: a parameter lies outside its range");
}

// What was found of the day.
struct DaylightReport {
  bool shadow = false;         // sun and shadow on the ground are told apart
  Vec3f ratio{1, 1, 1};        // sunlit over shadowed light, per channel
  float sunlit_share = 1.0F;   // of the ground
  float contrast = 1.0F;       // power of the codes that are decoded as sRGB; less than 1: steeper tones than sRGB's
  float error_log2 = 0.0F;     // estimate: spread of the ground's luminance over its light, before step 6
  bool sun_found = false;      // from walls; only where shadow is true
  float azimuth_rad = 0.0F;    // of the sun, from where the camera looks over the ground, to the right
  float elevation_rad = 0.0F;  // over the ground
};

struct AlbedoEstimate {
  ImageView<Vec3f> albedo;  // linear RGB
  // Share of the direct sun, 0..1; on walls, of what level ground gets; 1 where none is known to be missing. May be
  // empty.
  ImageView<float> sun;
};

namespace albedo_detail {

using namespace daylight_detail;

struct Context {
  AlbedoParams params;
  AlbedoScene scene;
  Picture picture;
  GroundLight ground;
  Objects objects;
  Sun day;
  float scale = 0.0F;    // log2 of the luminance of albedo 1 on sunlit level ground
  float cast[3] = {};    // log2 of the sun's channels over its luminance
  Plane light;           // log2 of luminance over albedo
  Plane sun;             // share of the sun
  Plane pane;            // share of panes in what cars show, 0..1
  Vec3f plants;          // colour of plants that do not show theirs, of luminance 1
  bool by_road = false;  // gave the scale: it is that of level ground
  bool sheen = false;    // step 6: by_road, and camera and ground plane are known

  [[nodiscard]] Label label_at(int x, int y) const noexcept {
    if (scene.labels.empty()) return label::unlabeled;
    const Label l = scene.labels(x, y);
    return l < kLabelCount ? l : label::unlabeled;
  }
  // Unit; zero where none is known.
  [[nodiscard]] Vec3f normal_at(int x, int y) const noexcept {
    if (scene.normals.empty()) return {};
    const Vec3f n = scene.normals(x, y);
    const float square = dot(n, n);
    return square > 0.9F && square < 1.1F ? n : Vec3f{};
  }
  // Of a working pixel.
  [[nodiscard]] Vec3f working_normal(int x, int y) const noexcept {
    return normal_at(picture.middle_x(x, scene.image.width()), picture.middle_y(y, scene.image.height()));
  }
  [[nodiscard]] float working_height(int x, int y) const noexcept {
    return height_m(scene, picture.middle_x(x, scene.image.width()), picture.middle_y(y, scene.image.height()));
  }
};

// Steps 1 and 2.
template <class Executor>
Status read_ground(float contrast, Context& c, Span<std::uint32_t>& histogram, Workspace& workspace,
                   Executor& executor) {
  c.picture.set_contrast(contrast);
  c.ground = {};
  NPSIM_RETURN_IF_ERROR(workspace.allocate(kQuantileBins, histogram));
  NPSIM_RETURN_IF_ERROR(read_picture(c.scene, workspace, c.picture, executor));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(c.picture.shape(), c.light));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(c.picture.shape(), c.sun));
  GroundLightParams ground;
  ground.enabled = c.params.remove_light;
  return find_ground_light(ground, c.scene, c.picture, workspace, c.ground, executor);
}

// Step 3: the level of sunlit ground, or of whatever there is instead.
inline void find_scale(Context& c, Span<std::uint32_t> histogram) {
  const Picture& picture = c.picture;
  const auto median = [&](const auto& inside, const auto& value) {
    return plane_quantile(picture.shape(), inside, value, 0.5F, histogram);
  };
  const auto any = [&](const auto& inside) {
    for (int y = 0; y < picture.shape().height; ++y) {
      for (int x = 0; x < picture.shape().width; ++x) {
        if (inside(x, y)) return true;
      }
    }
    return false;
  };
  const float ratio[3] = {c.ground.ratio.x, c.ground.ratio.y, c.ground.ratio.z};
  const auto cast_of = [&](const auto& inside) {
    for (int i = 0; i < 3; ++i) {
      c.cast[i] = median(inside, [&](int x, int y) {
        const float sun = c.ground.sun(x, y);
        return picture.log_rgb[i](x, y) - picture.log_y(x, y) - log_light(sun, ratio[i]) +
               log_light(sun, c.ground.ratio_y);
      });
    }
  };
  // A road that lies in one light is of that light's level.
  const auto road = [&](int x, int y) {
    const float sun = c.ground.sun(x, y);
    return picture.region(x, y) == kRoad && (sun > 0.9F || sun < 0.1F);
  };
  const auto paved = [&](int x, int y) { return picture.region(x, y) == kPavement || picture.region(x, y) == kFacade; };
  const auto surface = [&](int x, int y) { return picture.region(x, y) != kNone; };
  if (any(road)) {
    const float level = median(road, [&](int x, int y) {
      return picture.log_y(x, y) - c.ground.level(x, y) - log_light(c.ground.sun(x, y), c.ground.ratio_y);
    });
    c.scale = level - log2_of(surface_prior(label::road).albedo);
    c.by_road = true;
    c.sheen = c.params.remove_light && c.scene.ground.inlier_share > 0.0F && validate(c.scene.camera).ok();
    cast_of(road);
  } else if (any(paved)) {
    c.scale = median(paved, picture.log_y) - log2_of(surface_prior(label::building).albedo);
    cast_of(paved);
  } else if (any(surface)) {
    c.scale = median(surface, picture.log_y) - log2_of(surface_prior(label::unlabeled).albedo);
    cast_of(surface);
  }
}

[[nodiscard]] inline auto normals_of(const Context& c) noexcept {
  return [&c](int x, int y) { return c.working_normal(x, y); };
}

// Step 4 for facades and plants: `share` of what is smooth in a class is light, besides that of the sun on walls, which
// `light` of facades holds.
template <class Executor>
Status light_classes(const StandingLightParams& p, Context& c, Span<std::uint32_t> histogram, Workspace& workspace,
                     Executor& executor) {
  const WorkspaceScope scope(workspace);
  const Picture& picture = c.picture;
  Plane level, wide;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(picture.shape(), level));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(picture.shape(), wide));
  const auto normal = normals_of(c);
  for (const Region region : {kFacade, kPlant}) {
    const auto inside = [&](int x, int y) { return picture.region(x, y) == region; };
    const Label named = region == kFacade ? label::building : label::vegetation;
    const bool sunny = region == kFacade && c.day.found;
    const auto sunlight = [&](int x, int y) { return sunny ? c.light(x, y) : 0.0F; };
    const auto seen = [&](int x, int y) { return picture.log_y(x, y) - sunlight(x, y); };
    const float prior = log2_of(surface_prior(named).albedo);
    const float median =
        sunny ? c.scale + c.day.exposure + prior : plane_quantile(picture.shape(), inside, seen, 0.5F, histogram);
    NPSIM_RETURN_IF_ERROR(
        smooth_by_facing(picture, region, p.smooth_px, seen, median, normal, workspace, level, executor));
    NPSIM_RETURN_IF_ERROR(
        smooth_by_facing(picture, region, p.wide_px, seen, median, normal, workspace, wide, executor));
    const float part = !c.params.remove_light ? 0.0F : sunny ? p.sunny_share : 1.0F;
    for_pixels(picture.shape(), executor, [&](int x, int y) {
      if (!inside(x, y)) return;
      const float smooth = p.share * level(x, y) + p.wide_share * wide(x, y);
      c.light(x, y) = sunlight(x, y) + median - prior + part * smooth;
      if (sunny) return;
      const float drop = c.ground.ratio_y;
      c.sun(x, y) = drop > 0.0F ? clamp_to((c.light(x, y) - c.scale) / drop + 1.0F, 0.0F, 1.0F) : 1.0F;
    });
  }
  return {};
}

[[nodiscard]] inline auto walls_of(const Context& c) noexcept {
  return [&c](int x, int y) { return c.picture.region(x, y) == kFacade; };
}

// The sun, where it shows on the ground. What is no wall by its label has albedos of all kinds.
template <class Executor>
Status find_day(const SunParams& p, Context& c, Workspace& workspace, Executor& executor) {
  if (!c.ground.shadow) return {};
  c.day = light_of_day(c.ground.ratio_y, c.scene.ground);
  if (c.scene.labels.empty()) return {};
  return find_sun(p, c.picture, walls_of(c), normals_of(c), c.scale, workspace, c.day, executor);
}

// Step 4 for facades where the sun is known: its light and the sky's, relative to that of sunlit level ground.
template <class Executor>
Status light_walls(const SunParams& p, Context& c, Workspace& workspace, Executor& executor) {
  const auto inside = walls_of(c);
  const auto normal = normals_of(c);
  NPSIM_RETURN_IF_ERROR(sun_on_walls(p, c.day, c.picture, inside, normal, c.scale, workspace, c.sun, executor));
  for_pixels(c.picture.shape(), executor, [&](int x, int y) {
    if (!inside(x, y)) return;
    const float cosine = c.sun(x, y) * c.day.cosine(normal(x, y));
    c.light(x, y) = c.day.log_light(normal(x, y), cosine);
    c.sun(x, y) = std::min(cosine / c.day.sine(), 1.0F);
  });
  return {};
}

// Step 4 for all that is neither ground nor facade nor plant.
template <class Executor>
Status light_objects(const StandingLightParams& p, Context& c, Workspace& workspace, Executor& executor) {
  const Picture& picture = c.picture;
  NPSIM_RETURN_IF_ERROR(list_objects(c.scene, picture, c.sun, workspace, c.objects));
  const auto is_thing = [&](int x, int y) {
    return picture.region(x, y) == kVehicle || picture.region(x, y) == kOther;
  };
  const auto place = [&](int x, int y) {
    const std::size_t slot =
        c.objects.of(c.scene, picture.middle_x(x, c.scene.image.width()), picture.middle_y(y, c.scene.image.height()));
    return slot == 0 ? c.sun(x, y) : c.objects.sun[slot];
  };
  const auto normal = normals_of(c);
  const bool cloudy = c.params.remove_light && !c.ground.shadow;
  const float upright = !c.by_road ? 0.0F : (cloudy ? p.upright_cloudy : p.upright);
  constexpr float kAround = 0.5F;  // of what the street throws back comes from around a thing, in the same light as it
  SunnyFaces faces;
  if (c.ground.shadow) {
    constexpr float kInSun = 0.9F;
    const auto in_sun = [&](int x, int y) { return is_thing(x, y) && place(x, y) > kInSun; };
    NPSIM_RETURN_IF_ERROR(find_sunny_faces(picture, in_sun, normal, c.scale, c.day, workspace, faces, executor));
  }
  for_pixels(picture.shape(), executor, [&](int x, int y) {
    if (!is_thing(x, y)) return;
    float sun = place(x, y);
    if (picture.region(x, y) == kOther)
      sun += (1.0F - sun) * clamp_to((c.working_height(x, y) - p.low_m) / (p.high_m - p.low_m), 0.0F, 1.0F);
    if (!c.ground.shadow) {
      const float upward = clamp_to(dot(normal(x, y), c.scene.ground.up), 0.0F, 1.0F);
      c.light(x, y) = c.scale + (1.0F - upward) * upright;
      c.sun(x, y) = sun;
      return;
    }
    const Vec3f face = seen_face(normal(x, y));
    const float street = place(x, y);
    Sun local = c.day;
    local.thrown *= 1.0F - kAround * (1.0F - local.sky) * (1.0F - street);
    sun *= faces.direct(face);
    c.light(x, y) = c.scale + local.log_light(face, sun * local.sine());
    c.ground.sun(x, y) = street;
    c.sun(x, y) = std::min(sun, 1.0F);
  });
  heights_of_objects(c.scene, picture, c.objects);
  return {};
}

// Of four working pixels around a pixel of the photograph, those of its own region.
struct Light {
  float level, sun;
  float street;  // share of the sun on the ground, of things: where they stand
  float pane = 0.0F, tint = 0.0F;
};

[[nodiscard]] inline Light working_light(const Context& c, int x, int y) noexcept {
  return {c.light(x, y), c.sun(x, y), c.ground.sun(x, y), c.pane(x, y), c.ground.tint(x, y)};
}

[[nodiscard]] inline Light light_at(const Context& c, int x, int y, std::uint8_t region) noexcept {
  const Picture& picture = c.picture;
  if (picture.factor == 1) return working_light(c, x, y);
  const float inverse = 1.0F / static_cast<float>(picture.factor);
  const float fx = (static_cast<float>(x) + 0.5F) * inverse - 0.5F;
  const float fy = (static_cast<float>(y) + 0.5F) * inverse - 0.5F;
  const int x0 = static_cast<int>(std::floor(fx));
  const int y0 = static_cast<int>(std::floor(fy));
  Light sum{};
  float weight = 0.0F;
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < 2; ++i) {
      const int u = clamp_to(x0 + i, 0, picture.shape().width - 1);
      const int v = clamp_to(y0 + j, 0, picture.shape().height - 1);
      const float wx = 1.0F - std::fabs(fx - static_cast<float>(x0 + i));
      const float wy = 1.0F - std::fabs(fy - static_cast<float>(y0 + j));
      const float w = wx * wy * (picture.region(u, v) == region ? 1.0F : 1e-4F);
      const Light own = working_light(c, u, v);
      sum.level += w * own.level;
      sum.sun += w * own.sun;
      sum.street += w * own.street;
      sum.pane += w * own.pane;
      sum.tint += w * own.tint;
      weight += w;
    }
  }
  return {sum.level / weight, sum.sun / weight, sum.street / weight, sum.pane / weight, sum.tint / weight};
}

// Albedo over the photograph's linear light, which has the luminance `level` over albedo (log2), a share of sun, and is
// bluer than that says by `tint`, log2(blue / red).
[[nodiscard]] inline Vec3f gain_of(const Context& c, float level, float sun, float tint = 0.0F) noexcept {
  const float ratio[3] = {c.ground.ratio.x, c.ground.ratio.y, c.ground.ratio.z};
  const float common = level - (c.ground.shadow ? log_light(sun, c.ground.ratio_y) : 0.0F);
  const float tinted[3] = {-0.5F * tint, 0.0F, 0.5F * tint};
  float gain[3];
  for (int i = 0; i < 3; ++i) {
    const float own = c.ground.shadow ? log_light(sun, ratio[i]) : 0.0F;
    gain[i] = exp2_of(-(common + own + tinted[i] + c.params.cast_removal * c.cast[i]));
  }
  return {gain[0], gain[1], gain[2]};
}

// Step 6 for things: what is left of the albedo `a` that gain_of gives a pixel of the photograph, without what it
// mirrors.
[[nodiscard]] inline Vec3f without_mirrored(const Context& c, Label label, int x, int y, const Light& at,
                                            const Vec3f& a) noexcept {
  if (!c.sheen) return a;
  const Vec3f sight = normalized(unproject_pixel(c.scene.camera, x, y, 1.0F));
  const Mirrored m = mirrored_by(surface_prior(label).alpha, sight, seen_face(c.normal_at(x, y)), c.scene.ground.up);
  const float ratio[3] = {c.ground.ratio.x, c.ground.ratio.y, c.ground.ratio.z};
  float light[3];
  for (int i = 0; i < 3; ++i) {
    const float of_sky = c.ground.shadow ? exp2_of(-ratio[i]) : 1.0F;
    const float of_street = c.ground.shadow ? exp2_of(log_light(at.street, ratio[i])) : 1.0F;
    light[i] = exp2_of(c.scale + c.cast[i]) * (m.sky * of_sky + m.street * of_street);
  }
  return taken_off(a, Vec3f{light[0], light[1], light[2]} * gain_of(c, at.level, at.sun)) / m.through;
}

// The paint of objects, and the panes of cars, without what they mirror.
template <class Executor>
Status tell_paint(Context& c, Workspace& workspace, Executor& executor) {
  const AlbedoScene& s = c.scene;
  const WorkspaceScope scope(workspace);
  constexpr float kNothing = 1e-6F;  // where all is mirrored, rounding may leave less than none
  Plane bare;                        // log2 of luminance over albedo, of objects
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(c.picture.shape(), bare));
  for_pixels(c.picture.shape(), executor, [&](int x, int y) {
    const int u = c.picture.middle_x(x, s.image.width());
    const int v = c.picture.middle_y(y, s.image.height());
    bare(x, y) = 0.0F;
    if (c.objects.of(s, u, v) == 0) return;
    const float seen = exp2_of(c.picture.log_y(x, y) - c.light(x, y));
    const Vec3f own =
        without_mirrored(c, s.labels(u, v), u, v, {c.light(x, y), c.sun(x, y), c.ground.sun(x, y)}, {seen, seen, seen});
    bare(x, y) = c.picture.log_y(x, y) - log2_of(std::max(luminance(own), kNothing));
  });
  paint_of_objects(s, c.picture, bare, c.objects);
  return find_panes({}, s, c.picture, c.objects, bare, workspace, c.pane, executor);
}

// Bounds of a channel over luminance.
inline constexpr float kLeastShare = 0.15F, kMostShare = 3.0F;

// The mean colour of the picture's plants, of luminance 1 and within the bounds of shares, as far as they are neither
// dark nor nearly white; with a small weight, and alone where they all are, that of leaves, which reflect half as much
// of red and blue light as of green (.05, .04 and .1; bark and dry ones more of red) [default].
[[nodiscard]] inline Vec3f colour_of_plants(const Context& c) noexcept {
  constexpr Vec3f kLeaves{0.75F, 1.12F, 0.55F};
  constexpr float kUntold = 0.1F;                // weight of kLeaves to that of the picture's plants
  constexpr float kDark = 0.02F, kWhite = 0.6F;  // linear light: colours show between these
  const Picture& picture = c.picture;
  double sum[3] = {};
  double plants = 0.0;
  for (int y = 0; y < picture.shape().height; ++y) {
    for (int x = 0; x < picture.shape().width; ++x) {
      if (picture.region(x, y) != kPlant) continue;
      plants += 1.0;
      const float seen = exp2_of(picture.log_y(x, y));
      if (seen < kDark || seen > kWhite) continue;
      const Vec3f light{exp2_of(picture.log_rgb[0](x, y)), exp2_of(picture.log_rgb[1](x, y)),
                        exp2_of(picture.log_rgb[2](x, y))};
      const Vec3f a = light * gain_of(c, c.light(x, y), c.sun(x, y));
      const float scale = 1.0F / luminance(a);
      sum[0] += static_cast<double>(a.x * scale);
      sum[1] += static_cast<double>(a.y * scale);
      sum[2] += static_cast<double>(a.z * scale);
    }
  }
  const Vec3f all = Vec3f{static_cast<float>(sum[0]), static_cast<float>(sum[1]), static_cast<float>(sum[2])} +
                    kLeaves * (kUntold * static_cast<float>(plants));
  if (!(plants > 0.0)) return kLeaves;
  const float scale = 1.0F / luminance(all);
  const auto bounded = [&](float v) { return clamp_to(v * scale, kLeastShare, kMostShare); };
  return {bounded(all.x), bounded(all.y), bounded(all.z)};
}

// Steps 5 and 7 on one pixel whose luminance is free of light.
[[nodiscard]] inline Vec3f bounded_albedo(const Context& c, Vec3f a, const Rgb8& seen, float trust, Label label,
                                          std::size_t object, float down, float pane) {
  const AlbedoParams& p = c.params;
  // Codes below are noise and compression more than colour: a step of theirs is too large a part of the light. It is
  // as much smaller a part as the power of the codes is.
  const float dark = 40.0F * c.picture.contrast;
  constexpr float kInk = 0.5F, kPale = 0.8F;  // the weakest channel's code over the largest possible
  constexpr float kSlope = 0.35F;
  constexpr float kPaneSlope = 1.2F;  // what is dark on a facade is panes and openings, brightened by what they mirror
  constexpr float kObjectSlope = 0.5F;  // sky in panes and on paint is drawn in; plates, rims and lamps still show
  // Of plants most differences are light: leaves in the sun and sky between them more than gaps, which a smooth skin of
  // foliage would not have at night. As many as are left give crowns the contrast that they have in real nights.
  constexpr float kPlantSlope = 0.55F;
  constexpr float kPlantSlopeBelow = 0.85F;
  const int most = max_of(static_cast<int>(seen.r), static_cast<int>(seen.g), static_cast<int>(seen.b));
  float lum = luminance(a);
  if (!(lum > 0.0F)) return {p.min_albedo, p.min_albedo, p.min_albedo};
  trust = std::min(trust, static_cast<float>(most) / dark);
  if (most >= p.saturated_level) {
    // What is cut off is the excess of the strongest channel. Ink is so strong without it that its hue is known; what
    // is nearly white may have any.
    const auto least = static_cast<float>(std::min(static_cast<int>(seen.r), std::min<int>(seen.g, seen.b)));
    trust = std::min(trust, clamp_to((kPale * 255.0F - least) / ((kPale - kInk) * 255.0F), 0.0F, 1.0F));
  }
  // What the pixel does not tell is grey; of plants, and of the sky between their leaves, it is as the others are.
  constexpr Vec3f kGrey{1.0F, 1.0F, 1.0F};
  const Vec3f usual = label == label::vegetation ? c.plants : kGrey;
  const float usual_share[3] = {usual.x, usual.y, usual.z};
  const float share[3] = {a.x / lum, a.y / lum, a.z / lum};
  for (int i = 0; i < 3; ++i) {
    const float off = usual_share[i] - share[i];
    if (share[i] < kLeastShare) trust = std::min(trust, (usual_share[i] - kLeastShare) / off);
    if (share[i] > kMostShare) trust = std::min(trust, (usual_share[i] - kMostShare) / off);
  }
  a = usual * lum + (a - usual * lum) * trust;

  const float level = log2_of(surface_prior(label).albedo);
  const float bound = log2_of(p.free_ratio);
  float log_albedo = log2_of(lum);
  const float paint = object != 0 ? c.objects.median[object] : Objects::kNoMedian;
  if (p.remove_light && paint < Objects::kNoMedian) {
    if (label == label::car) log_albedo = paint_or_glass(log_albedo, paint, down, pane);
    const float over = log_albedo - paint - log2_of(p.panes_limit);
    if (over > 0.0F) log_albedo -= (1.0F - kObjectSlope) * over;
  }
  float off = log_albedo - level;
  if (label == label::vegetation) off *= off > 0.0F ? kPlantSlope : kPlantSlopeBelow;
  if (region_of(label) == kFacade && off < 0.0F) off *= kPaneSlope;
  if (off > bound) off = bound + kSlope * (off - bound);
  a *= exp2_of(off + level) / lum;
  const float brightest = max_of(a.x, a.y, a.z);
  if (brightest > p.max_albedo) a *= p.max_albedo / brightest;  // all channels, so that the hue stays
  // A soft floor: what is nearly black keeps its differences.
  const auto floored = [&](float v) {
    return clamp_to(std::sqrt(v * v + p.min_albedo * p.min_albedo), p.min_albedo, p.max_albedo);
  };
  return {floored(a.x), floored(a.y), floored(a.z)};
}

// Things whose loose label covers as much ground as thing.
inline constexpr LabelSet kThinLabels = kPoleLabels | LabelSet::of(label::person);

// The photograph's pixel, or the darker one further in where it lies beside the sky, and of thin things before what is
// brighter: labels are loose by some pixels, and what leaks in would be the brightest paint of the street. at_border
// becomes true there.
[[nodiscard]] inline Rgb8 without_border(const Context& c, int x, int y, bool& at_border) noexcept {
  constexpr float kLoose_px = 3.0F;  // at 960 px width
  constexpr int kSteps[8][2] = {{0, -1}, {-1, 0}, {1, 0}, {-1, -1}, {1, -1}, {0, 1}, {-1, 1}, {1, 1}};
  const ImageView<const Label>& labels = c.scene.labels;
  const Rgb8 own = c.scene.image(x, y);
  if (labels.empty()) return own;
  const auto light_at = [&](int u, int v) { return luminance(c.picture.light_of(c.scene.image(u, v))); };
  const auto is_own = [&](int u, int v) { return labels.contains(u, v) && labels(u, v) == labels(x, y); };
  const bool is_thin = kThinLabels.contains(labels(x, y));
  const int reach = c.picture.radius(kLoose_px) * c.picture.factor;
  Rgb8 best = own;
  float least = light_at(x, y);
  for (const auto& step : kSteps) {
    const int dx = step[0] * reach;
    const int dy = step[1] * reach;
    if (!labels.contains(x + dx, y + dy)) continue;
    const Label behind = labels(x + dx, y + dy);
    if (behind != label::sky && !(is_thin && region_of(behind) < kOther)) continue;
    const float leaks = light_at(x + dx, y + dy);
    at_border = at_border || behind == label::sky || leaks > least;
    // Thin things have it on both sides: no farther than to their middle. Of two pixels the other one is as good.
    int most = reach;
    if (is_thin) {
      int inner_px = 0;
      int outer_px = 0;
      while (inner_px < 2 * reach && is_own(x - (inner_px + 1) * step[0], y - (inner_px + 1) * step[1])) ++inner_px;
      while (outer_px < reach && is_own(x + (outer_px + 1) * step[0], y + (outer_px + 1) * step[1])) ++outer_px;
      most = clamp_to((inner_px - outer_px + 1) / 2, 0, reach);
    }
    for (const int inwards : {most, most / 2}) {
      const int u = x - inwards * step[0];
      const int v = y - inwards * step[1];
      if (!is_own(u, v)) continue;
      const float inner = light_at(u, v);
      if (inner >= least || (behind != label::sky && inner >= leaks)) continue;
      least = inner;
      best = c.scene.image(u, v);
      at_border = true;
    }
  }
  return best;
}

// Step 6 for ground. A street that shows no shadow counts as overcast.
[[nodiscard]] inline float contrast_of_ground(const Context& c, Label label, int x, int y, float sun) noexcept {
  if (!c.sheen) return 1.0F;
  const Vec3f sight = normalized(unproject_pixel(c.scene.camera, x, y, 1.0F));
  const float sky = c.ground.shadow ? exp2_of(-c.ground.ratio_y - log_light(sun, c.ground.ratio_y)) : 1.0F;
  return contrast_under_sheen(surface_prior(label).alpha, -dot(sight, c.scene.ground.up), sky,
                              surface_prior(label::road).albedo);
}

template <class Executor>
void write_albedo(const Context& c, const AlbedoEstimate& out, Executor& executor) {
  const AlbedoScene& s = c.scene;
  const auto left_of_cast = [&](int i) {
    return surface_prior(label::road).albedo * exp2_of((1.0F - c.params.cast_removal) * c.cast[i]);
  };
  const Vec3f road{left_of_cast(0), left_of_cast(1), left_of_cast(2)};
  for_pixels(s.image.shape(), executor, [&](int x, int y) {
    const Label label = c.label_at(x, y);
    const int f = c.picture.factor;
    const std::uint8_t region =
        s.labels.empty() ? c.picture.region(x / f, y / f) : static_cast<std::uint8_t>(region_of(label));
    if (region == kNone) {
      const float prior = surface_prior(label).albedo;
      out.albedo(x, y) = {prior, prior, prior};
      if (!out.sun.empty()) out.sun(x, y) = 1.0F;
      return;
    }
    const Light light = light_at(c, x, y, region);
    bool at_border = false;
    const Rgb8 seen = region < kGroundRegions ? s.image(x, y) : without_border(c, x, y, at_border);
    const float tint = region < kGroundRegions ? light.tint : 0.0F;
    Vec3f a = c.picture.light_of(seen) * gain_of(c, light.level, light.sun, tint);
    // In half shade the colour of the light is the least certain; thin things have that of what they stand before. Of
    // what mirrors more than it throws back the rest tells little.
    constexpr float kTrustAtBorder = 0.3F;
    constexpr float kTold = 0.5F;  // share of what is seen whose colour is told
    float trust = region < kGroundRegions ? std::fabs(2.0F * light.sun - 1.0F) : (at_border ? kTrustAtBorder : 1.0F);
    if (region < kGroundRegions) {
      a = without_sheen(road, a, contrast_of_ground(c, s.labels.empty() ? label::road : label, x, y, light.sun));
    } else if (region == kVehicle || region == kOther) {
      const float looks = luminance(a);
      a = without_mirrored(c, label, x, y, light, a);
      if (looks > 0.0F) trust = std::min(trust, std::max(luminance(a), 0.0F) / (kTold * looks));
    }
    const std::size_t object = c.objects.of(s, x, y);
    const float row = (static_cast<float>(y) + 0.5F) / static_cast<float>(f) - 0.5F;
    const float down = label == label::car ? c.objects.down(s, object, x, y, row) : 0.0F;
    out.albedo(x, y) = bounded_albedo(c, a, seen, trust, label, object, down, light.pane);
    if (!out.sun.empty()) out.sun(x, y) = light.sun;
  });
}

[[nodiscard]] inline DaylightReport daylight_report(const Context& c, Span<std::uint32_t> histogram) {
  const Picture& picture = c.picture;
  const auto ground = [&](int x, int y) { return picture.is_ground(x, y); };
  const auto off = [&](int x, int y) {
    return std::fabs(picture.log_y(x, y) - c.light(x, y) - log2_of(surface_prior(label::road).albedo));
  };
  DaylightReport report;
  report.shadow = c.ground.mixture[c.ground.lead].shadow;
  if (c.ground.shadow) {
    report.ratio = {exp2_of(c.ground.ratio.x), exp2_of(c.ground.ratio.y), exp2_of(c.ground.ratio.z)};
  }
  report.sun_found = c.day.found;
  report.azimuth_rad = c.day.azimuth();
  report.elevation_rad = std::asin(clamp_to(dot(c.day.direction, c.day.up), -1.0F, 1.0F));
  report.contrast = picture.contrast;
  report.sunlit_share = sunlit_share(picture, c.ground);
  report.error_log2 = plane_quantile(picture.shape(), ground, off, 0.5F, histogram);
  return report;
}

}  // namespace albedo_detail

[[nodiscard]] constexpr std::size_t estimate_albedo_workspace_bytes(const AlbedoParams&, Shape shape) noexcept {
  using namespace daylight_detail;
  const Shape working = working_shape(shape);
  constexpr std::size_t kPlanes = kPicturePlanes + 2 + kFindGroundLightPlanes;
  // The ground's result, the share of panes and light without sheen; the sun is found before objects are listed.
  static_assert(kGroundLightPlanes + 1 + 1 + kPanePlanes <= kFindGroundLightPlanes &&
                kGroundLightPlanes + 1 + kSunPlanes <= kFindGroundLightPlanes);
  static_assert(kSunBytes <= kObjectsBytes);
  return kPlanes * allocation_bytes<float>(working.pixels()) + 3 * allocation_bytes<std::uint8_t>(working.pixels()) +
         allocation_bytes<std::uint32_t>(static_cast<std::size_t>(kCellsY * kCellsC)) +
         allocation_bytes<LightCell>(static_cast<std::size_t>(kCellsY * kCellsC)) + kObjectsBytes +
         allocation_bytes<FaceSample>(kFaceSamples) + allocation_bytes<std::uint32_t>(kQuantileBins) +
         kWorkspaceAlignment;
}

// All of `scene` but the photograph may be empty.
template <class Executor>
Status estimate_albedo(const AlbedoParams& p, const AlbedoScene& scene, Workspace& workspace, const AlbedoEstimate& out,
                       DaylightReport& report, Executor& executor) {
  using namespace albedo_detail;
  NPSIM_RETURN_IF_ERROR(validate(p));
  const Shape shape = scene.image.shape();
  if (scene.image.empty()) return Status(StatusCode::invalid_argument, "albedo: the photograph is empty");
  const auto fits = [&](const auto& view) { return view.empty() || view.shape() == shape; };
  if (out.albedo.shape() != shape || !fits(out.sun) || !fits(scene.labels) || !fits(scene.instances) ||
      !fits(scene.depth) || !fits(scene.normals)) {
    return Status(StatusCode::shape_mismatch, "albedo: all planes must have the shape of the photograph");
  }
  WorkspaceScope scope(workspace);
  Context c;
  c.params = p;
  c.scene = scene;
  Span<std::uint32_t> histogram;
  NPSIM_RETURN_IF_ERROR(read_ground(1.0F, c, histogram, workspace, executor));
  if (c.ground.ratio_y > kMostRatio) {
    scope.release();
    NPSIM_RETURN_IF_ERROR(read_ground(contrast_of(c.ground), c, histogram, workspace, executor));
    if (!c.ground.shadow) {
      scope.release();
      NPSIM_RETURN_IF_ERROR(read_ground(1.0F, c, histogram, workspace, executor));
    }
  }
  find_scale(c, histogram);

  const StandingLightParams standing;
  const SunParams sun;
  NPSIM_RETURN_IF_ERROR(find_day(sun, c, workspace, executor));
  NPSIM_RETURN_IF_ERROR(place_sun(standing, c.picture, c.ground, workspace, c.sun, executor));
  NPSIM_RETURN_IF_ERROR(light_objects(standing, c, workspace, executor));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(c.picture.shape(), c.pane));
  NPSIM_RETURN_IF_ERROR(tell_paint(c, workspace, executor));
  if (c.day.found) NPSIM_RETURN_IF_ERROR(light_walls(sun, c, workspace, executor));
  NPSIM_RETURN_IF_ERROR(light_classes(standing, c, histogram, workspace, executor));
  for_pixels(c.picture.shape(), executor, [&](int x, int y) {
    if (c.picture.region(x, y) == kNone) c.light(x, y) = c.scale;
    if (!c.picture.is_ground(x, y)) return;
    c.sun(x, y) = c.ground.sun(x, y);
    c.light(x, y) = c.scale + log_light(c.sun(x, y), c.ground.ratio_y) + c.ground.level(x, y);
  });
  c.plants = colour_of_plants(c);
  write_albedo(c, out, executor);
  report = daylight_report(c, histogram);
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_ALBEDO_HPP
