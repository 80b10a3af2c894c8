// SPDX-License-Identifier: Apache-2.0
// Section 3.6: light in the reconstructed scene, in two steps.
//
// prepare_relighting() does what all nights of one day share: it places the lamps, draws which variant lights which of
// them, and traces every ray of the method: which lamp reaches which point, and where light that bounces comes from.
// relight() then makes the linear image of one night by adding up: the lit lamps, `bounces` gathers, a denoiser, and
// what is seen of the lamps themselves. Light is linear, so nothing is lost by the split; forty nights cost little more
// than one.
// Rays look for light at the points that pixels show; lamps are asked about those and the points that their bounces
// reach. A variant's bits do not depend on how many others there are.
// Memory (workspace): relight_workspace_bytes(), from the sizes of the mesh; a byte a lamp and point, 4 bytes a gather
// ray and receiver, 8 a receiver, 28 a point.
#ifndef NPSIM_PIPELINE_RELIGHT_HPP
#define NPSIM_PIPELINE_RELIGHT_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/observe.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/light/activation.hpp"
#include "npsim/light/continued_rows.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/light/headlamps.hpp"
#include "npsim/light/placement.hpp"
#include "npsim/light/sky.hpp"
#include "npsim/pipeline/detail/lamp_faces.hpp"
#include "npsim/pipeline/detail/mirrored_image.hpp"
#include "npsim/pipeline/detail/own_car.hpp"
#include "npsim/pipeline/detail/ray_starts.hpp"
#include "npsim/pipeline/detail/scene_rays.hpp"
#include "npsim/pipeline/detail/source_pixels.hpp"
#include "npsim/pipeline/detail/surface_attributes.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/pipeline/refine_depth.hpp"
#include "npsim/render/denoise.hpp"
#include "npsim/render/direct.hpp"
#include "npsim/render/gather.hpp"
#include "npsim/render/mirror.hpp"
#include "npsim/render/surface_points.hpp"
#include "npsim/render/unseen_street.hpp"
#include "npsim/render/visibility.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct RelightParams {
  PlacementParams placement;
  ContinuedRowParams rows;    // street lamps that the picture does not show
  Span<const Emitter> lamps;  // where the lamps are known: these, in place of marked ones that are placed
  ActivationParams activation;
  VisibilityParams visibility;
  GatherParams gather;
  MirrorParams mirror;        // where the ground is wet (material.film)
  UnseenStreetParams unseen;  // what rays see that leave the picture's street
  DenoiseParams denoise;
  SkyParams sky;
  MaterialParams material;
  int bounces = 2;            // diffuse bounces after the direct light, 1..16
  float f0 = 0.04F;           // normal reflectance of a dielectric of index 1.5
  bool ego_headlamps = true;  // the low beams of the car that carries the camera
  EgoHeadlampParams ego;
};

[[nodiscard]] inline Status validate(const RelightParams& p) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(p.placement));
  NPSIM_RETURN_IF_ERROR(validate(p.rows));
  NPSIM_RETURN_IF_ERROR(validate(p.activation));
  NPSIM_RETURN_IF_ERROR(validate(p.visibility));
  NPSIM_RETURN_IF_ERROR(validate(p.gather));
  NPSIM_RETURN_IF_ERROR(validate(p.mirror));
  NPSIM_RETURN_IF_ERROR(validate(p.unseen));
  NPSIM_RETURN_IF_ERROR(validate(p.denoise));
  NPSIM_RETURN_IF_ERROR(validate(p.sky));
  NPSIM_RETURN_IF_ERROR(validate(p.material.albedo));
  NPSIM_RETURN_IF_ERROR(validate(p.material.film));
  NPSIM_RETURN_IF_ERROR(validate(p.material.retroreflection));
  NPSIM_RETURN_IF_ERROR(validate(p.ego));
  if (p.bounces < 1 || p.bounces > 16) return {StatusCode::invalid_argument, "relight: bounces in 1..16"};
  if (!(p.f0 >= 0.0F && p.f0 <= 1.0F)) return {StatusCode::invalid_argument, "relight: f0 in [0, 1]"};
  return {};
}

// Everything that the variants share; spans into the workspace.
struct Relighting {
  SkyParams sky;  // with the scene's up direction
  SurfacePoints points;
  ImageView<const std::uint32_t> visible_point;  // per pixel; kNoPoint where the scene has no surface
  Span<const Emitter> emitters;                  // marked ones first, then unseen ones, then the ego vehicle's
  Span<const Activation> activations;            // variant-major: variant * emitters + emitter
  Span<const std::uint32_t> emitter_of_mark;     // mark position -> emitter, or kNoPoint
  Span<const relight_detail::SourceBrightness> brightness_of_mark;  // of each mark's pixels by day
  Span<const std::uint8_t> visibility;
  Span<const std::uint32_t> receivers;  // the points that pixels show, in the order of the pixels
  Span<const std::uint32_t> hits;
  Span<const Vec3f> sky_irradiance;
  Mirrors mirrors;           // of wet pixels; none where all is dry
  Span<const Vec2f> unseen;  // how much of the unseen street each receiver sees
  int variants = 0;

  [[nodiscard]] Span<const Activation> of_variant(int variant) const noexcept {
    return activations.sub(static_cast<std::size_t>(variant) * emitters.size(), emitters.size());
  }
};

// What relight_workspace_bytes() goes by.
struct RelightSize {
  std::size_t marks = 0;  // lamps that are marked
  int variants = 1;
  std::size_t points = 0;     // vertices of the mesh
  std::size_t receivers = 0;  // pixels that show a point
  std::size_t faces = 0;      // of the mesh
  std::size_t backs = 0;      // of these, the objects' backs
  bool albedo_guessed = true;
  std::size_t groups = 0;  // of the marks, those that shine no light of their own
  std::size_t wet = 0;     // of the receivers, those that a film of water may cover
  std::size_t unseen = 0;  // street lamps that continue a row
};

[[nodiscard]] inline RelightSize relight_size(const SceneView& scene, const SceneMesh& mesh, int variants) noexcept {
  RelightSize size{scene.lights.size(),
                   variants,
                   mesh.mesh.vertices.size(),
                   0,
                   mesh.mesh.faces.size(),
                   mesh.mesh.faces.size() - mesh.sheet_faces,
                   scene.albedo.empty(),
                   0,
                   0,
                   0};
  for (const LightMark& mark : scene.lights) size.groups += is_group(mark.cls) ? 1U : 0U;
  for (int y = 0; y < scene.shape().height; ++y) {
    for (int x = 0; x < scene.shape().width; ++x) {
      if (mesh.visible_vertex(x, y) == kNoVertex) continue;
      ++size.receivers;
      if (!scene.labels.empty() && kWettedLabels.contains(scene.labels(x, y))) ++size.wet;
    }
  }
  return size;
}

// What relight() takes for a variant.
[[nodiscard]] constexpr std::size_t variant_workspace_bytes(const RelightParams& params, Shape shape,
                                                            std::size_t points, std::size_t receivers) noexcept {
  return allocation_bytes<Vec3f>(shape.pixels()) * (is_wet(params.material.film) ? 2 : 1) +
         max_of(allocation_bytes<Vec3f>(points) +
                    std::max(allocation_bytes<Vec3f>(points), allocation_bytes<Vec3f>(receivers)),
                denoise_workspace_bytes(params.denoise, shape), show_own_car_workspace_bytes(shape));
}

// What prepare_relighting() and then relight() take.
[[nodiscard]] constexpr std::size_t relight_workspace_bytes(const RelightParams& params, TracedFaces traced,
                                                            Shape shape, const RelightSize& size) noexcept {
  const std::size_t known = std::max(size.marks, params.lamps.size()) + kEgoHeadlampCount;
  const std::size_t emitters = known + most_unseen_lamps(params.rows, size.marks);
  const std::size_t traced_lamps = known - (params.lamps.empty() ? size.groups : 0) + size.unseen;
  const std::size_t rays = params.gather.rays > 0 ? static_cast<std::size_t>(params.gather.rays) : 0;
  const std::size_t drawn = emitters * (size.variants > 0 ? static_cast<std::size_t>(size.variants) : 0);
  const std::size_t shared =
      allocation_bytes<Emitter>(emitters) + allocation_bytes<Activation>(drawn) +
      2 * allocation_bytes<float>(emitters) + allocation_bytes<Vec3f>(emitters) +
      allocation_bytes<std::uint32_t>(size.marks) + allocation_bytes<float>(size.marks) +
      allocation_bytes<relight_detail::SourceBrightness>(size.marks) + 2 * allocation_bytes<Vec3f>(size.points) +
      2 * allocation_bytes<float>(size.points) + allocation_bytes<Retroreflector>(size.points) +
      allocation_bytes<std::uint32_t>(size.receivers) + allocation_bytes<std::uint32_t>(size.receivers * rays) +
      allocation_bytes<Vec3f>(size.receivers) + allocation_bytes<Vec2f>(size.receivers) +
      allocation_bytes<std::uint8_t>(traced_lamps * size.points) +
      (is_wet(params.material.film)
           ? mirrors_bytes(params.mirror, size.wet) + allocation_bytes<std::uint8_t>(size.points)
           : 0);
  const std::size_t trace = scene_rays_workspace_bytes(traced, shape, size.faces, size.backs) +
                            allocation_bytes<std::uint16_t>(traced_face_count(traced, shape, size.faces, size.backs)) +
                            mark_faces_workspace_bytes(shape, size.marks, emitters) +
                            allocation_bytes<std::uint8_t>(size.points);
  return shared +
         max_of(size.marks > 0 ? placement_workspace_bytes(params.placement, shape) : std::size_t{0},
                surface_attributes_workspace_bytes(params.material, shape, size.albedo_guessed), trace,
                variant_workspace_bytes(params, shape, size.points, size.receivers)) +
         kWorkspaceAlignment;
}

namespace relight_detail {

inline constexpr float kPi = 3.14159265F;
inline constexpr float kInversePi = 0.31830989F;

// The lamps that are marked, or known, then those that continue their rows, then the own car's.
[[nodiscard]] inline Status place_emitters(const RelightParams& params, const SceneView& scene,
                                           const RefinedDepth& refined, Workspace& workspace, Span<Emitter>& emitters,
                                           Span<std::uint32_t>& emitter_of_mark) {
  const std::size_t most = (params.lamps.empty() ? scene.lights.size() : params.lamps.size()) +
                           most_unseen_lamps(params.rows, scene.lights.size());
  NPSIM_RETURN_IF_ERROR(workspace.allocate(most + kEgoHeadlampCount, emitters));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(scene.lights.size(), emitter_of_mark));
  std::size_t count = 0;
  if (!params.lamps.empty()) {
    for (const Emitter& lamp : params.lamps) {
      if (lamp.mark > scene.lights.size()) {
        return {StatusCode::invalid_argument, "relight: a known lamp has a mark that the scene lacks"};
      }
      emitters[count++] = lamp;
    }
  } else {
    const PlacementScene known{scene.camera,      refined.ground,          scene.lights,
                               scene.light_index, refined.surface_depth(), refined.labels,
                               scene.instances,   refined.uncertain,       refined.normals};
    if (!scene.light_index.empty() && !scene.lights.empty()) {
      NPSIM_RETURN_IF_ERROR(
          place_lights(params.placement, known, workspace, emitters.sub(0, scene.lights.size()), count));
    }
    NPSIM_RETURN_IF_ERROR(continue_rows(params.rows, known, emitters.sub(0, most), count));
  }
  assign_luminaires(params.activation.light_set, emitters.sub(0, count));
  for (std::uint32_t& e : emitter_of_mark) e = kNoPoint;
  for (std::size_t e = 0; e < count; ++e) {
    if (emitters[e].mark != 0) emitter_of_mark[emitters[e].mark - 1U] = static_cast<std::uint32_t>(e);
  }
  if (params.ego_headlamps)
    count += place_ego_headlamps(params.ego, refined.ground, emitters.sub(count, kEgoHeadlampCount));
  emitters = emitters.sub(0, count);
  return {};
}

// Which lamp is lit in which variant. peak_cd: the strongest intensity that each could have been drawn with, not that it
// was, so that a variant's bits do not depend on the others; 0 for a lamp that no variant lights: it needs no rays.
[[nodiscard]] inline Status draw_activations(const ActivationParams& params, std::uint64_t key, int variants,
                                             const SceneView& scene, Span<const Emitter> emitters,
                                             Span<const std::uint32_t> emitter_of_mark, Workspace& workspace,
                                             Span<Activation>& activations, Span<float>& peak_cd) {
  const std::size_t count = emitters.size();
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count * static_cast<std::size_t>(variants), activations));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, peak_cd));
  const WorkspaceScope scope(workspace);
  Span<Vec3f> day_rgb;
  Span<float> weight;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, day_rgb));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, weight));
  daytime_colours(scene, emitter_of_mark, day_rgb, weight);
  for (float& peak : peak_cd) peak = 0;
  for (int v = 0; v < variants; ++v) {
    const Span<Activation> drawn = activations.sub(static_cast<std::size_t>(v) * count, count);
    NPSIM_RETURN_IF_ERROR(activate_lights(params, key, static_cast<std::uint32_t>(v), emitters, day_rgb, drawn));
    for (std::size_t e = 0; e < count; ++e) {
      if (drawn[e].lit) peak_cd[e] = strongest_intensity_cd(params, emitters[e]);
    }
  }
  return {};
}

[[nodiscard]] inline Status list_receivers(ImageView<const std::uint32_t> visible, std::size_t count,
                                           Workspace& workspace, Span<std::uint32_t>& receivers) {
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, receivers));
  std::size_t r = 0;
  for (int y = 0; y < visible.height(); ++y) {
    for (int x = 0; x < visible.width(); ++x) {
      if (visible(x, y) != kNoVertex) receivers[r++] = visible(x, y);
    }
  }
  return {};
}

// Every ray: of the bounces, and of the shadows. The structure that they are traced through is built here and gone
// afterwards. Rays: LayerRays or MeshRays (scene_rays.hpp).
template <class Rays, class Executor, class Observer>
[[nodiscard]] Status trace_light(const RelightParams& params, std::uint64_t key, const SceneView& scene,
                                 const SceneMesh& mesh, const Relighting& light, Span<const float> peak_cd,
                                 Span<std::uint32_t> hits, Span<Vec3f> sky_irradiance, Span<Vec2f> unseen,
                                 Span<std::uint8_t> visibility, Workspace& workspace, Executor& executor,
                                 Observer& observer) {
  const WorkspaceScope scope(workspace);
  observer.begin(Stage::build_trace);
  Rays rays;
  NPSIM_RETURN_IF_ERROR(Rays::make(scene, mesh, workspace, executor, rays));
  Span<std::uint16_t> face_mark;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(rays.face_count(), face_mark));
  NPSIM_RETURN_IF_ERROR(rays.mark(scene, light.emitters, face_mark, workspace));
  observer.end(Stage::build_trace);

  observer.begin(Stage::render);
  const auto point_of = [&rays](const Hit& hit) { return rays.point_of(hit); };
  NPSIM_RETURN_IF_ERROR(trace_gather_rays(params.gather, key, rays.scene, point_of, light.points, light.receivers,
                                          light.sky, params.unseen, hits, sky_irradiance, unseen, executor, observer));
  if (!light.mirrors.pixel.empty()) {
    NPSIM_RETURN_IF_ERROR(trace_mirror_rays(params.mirror, key, params.f0, rays.scene, point_of, light.points,
                                            light.sky, light.mirrors, executor, observer));
  }
  // Light is asked for at the points that pixels show and those that their bounces reach.
  Span<std::uint8_t> wanted;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(light.points.size(), wanted));
  for (std::uint8_t& w : wanted) w = 0;
  for (const std::uint32_t point : light.receivers) wanted[point] = 1;
  for (const std::uint32_t point : hits) {
    if (point != kNoPoint) wanted[point] = 1;
  }
  for (const std::uint32_t point : light.mirrors.hits) {
    if (point != kNoPoint) wanted[point] = 1;
  }
  NPSIM_RETURN_IF_ERROR(compute_visibility(params.visibility, key, rays.scene, light.points, wanted, light.emitters,
                                           peak_cd, face_mark, visibility, executor, observer));
  observer.end(Stage::render);
  return {};
}

}  // namespace relight_detail

// key: of all that is drawn (random_key() in night.hpp).
template <class Executor, class Observer>
Status prepare_relighting(const RelightParams& params, TracedFaces traced, std::uint64_t key, int variants,
                          const SceneView& scene, const RefinedDepth& refined, const SceneMesh& mesh,
                          Workspace& workspace, Executor& executor, Observer& observer, Relighting& out) {
  if (variants < 1) return Status(StatusCode::invalid_argument, "at least one variant is needed");
  const std::size_t before = workspace.used();
  RelightSize size = relight_size(scene, mesh, variants);
  NPSIM_RETURN_IF_ERROR(workspace.ensure(relight_workspace_bytes(params, traced, scene.shape(), size)));

  observer.begin(Stage::lights);
  out.sky = params.sky;
  out.sky.up = refined.ground.up;
  Span<Emitter> emitters;
  Span<std::uint32_t> emitter_of_mark;
  NPSIM_RETURN_IF_ERROR(relight_detail::place_emitters(params, scene, refined, workspace, emitters, emitter_of_mark));
  // How many lamps continue rows is known only now.
  for (const Emitter& e : emitters) size.unseen += e.unseen != 0 && params.lamps.empty() ? 1U : 0U;
  const std::size_t taken = workspace.used() - before;
  NPSIM_RETURN_IF_ERROR(workspace.ensure(relight_workspace_bytes(params, traced, scene.shape(), size) - taken));
  Span<Activation> activations;
  Span<float> peak_cd;
  NPSIM_RETURN_IF_ERROR(relight_detail::draw_activations(params.activation, key, variants, scene, emitters,
                                                         emitter_of_mark, workspace, activations, peak_cd));
  Span<relight_detail::SourceBrightness> brightness_of_mark;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(scene.lights.size(), brightness_of_mark));
  {
    const WorkspaceScope scope(workspace);
    Span<float> pixel_count;
    NPSIM_RETURN_IF_ERROR(workspace.allocate(scene.lights.size(), pixel_count));
    relight_detail::source_brightness(scene, emitters, emitter_of_mark, brightness_of_mark, pixel_count);
  }
  observer.end(Stage::lights);

  observer.begin(Stage::material);
  SurfaceAttributes surface;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(size.points, surface.normal));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(size.points, surface.albedo));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(size.points, surface.alpha));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(size.points, surface.retro));
  if (is_wet(params.material.film)) {
    NPSIM_RETURN_IF_ERROR(workspace.allocate(size.points, surface.film));
  }
  NPSIM_RETURN_IF_ERROR(surface_attributes(params.material, scene, refined, mesh, surface, workspace, executor));
  Span<float> lift_m;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(size.points, lift_m));
  ray_lifts(mesh, refined.trust.bounded ? refined.noise : DepthNoise{}, surface.normal, lift_m, executor);
  observer.end(Stage::material);

  out.points = SurfacePoints{mesh.mesh.vertices, surface.normal, surface.albedo, surface.alpha, lift_m,
                             surface.retro,      surface.film};
  out.visible_point = mesh.visible_vertex;
  out.emitters = emitters;
  out.activations = activations;
  out.emitter_of_mark = emitter_of_mark;
  out.brightness_of_mark = brightness_of_mark;
  out.variants = variants;
  Span<std::uint32_t> receivers;
  Span<std::uint32_t> hits;
  Span<Vec3f> sky_irradiance;
  Span<std::uint8_t> visibility;
  NPSIM_RETURN_IF_ERROR(relight_detail::list_receivers(mesh.visible_vertex, size.receivers, workspace, receivers));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(size.receivers * static_cast<std::size_t>(params.gather.rays), hits));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(size.receivers, sky_irradiance));
  Span<Vec2f> unseen;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(size.receivers, unseen));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(emitters.size() * size.points, visibility));
  out.receivers = receivers;
  out.hits = hits;
  out.sky_irradiance = sky_irradiance;
  out.unseen = unseen;
  out.visibility = visibility;
  if (is_wet(params.material.film)) {
    NPSIM_RETURN_IF_ERROR(
        relight_detail::list_mirrors(params.mirror, out.points, out.visible_point, size.wet, workspace, out.mirrors));
  }
  const auto trace = [&](auto kind) {
    return relight_detail::trace_light<decltype(kind)>(params, key, scene, mesh, out, peak_cd, hits, sky_irradiance,
                                                       unseen, visibility, workspace, executor, observer);
  };
  return traced == TracedFaces::mesh ? trace(MeshRays{}) : trace(LayerRays{});
}

// Position and normal of what each pixel shows, (0, 0, 0) for nothing: what the denoiser goes by in every variant.
struct DenoiseGuides {
  ImageView<Vec3f> position;
  ImageView<Vec3f> normal;
};

inline void fill_guides(const Relighting& light, const DenoiseGuides& guides) noexcept {
  for (int y = 0; y < light.visible_point.height(); ++y) {
    for (int x = 0; x < light.visible_point.width(); ++x) {
      const std::uint32_t point = light.visible_point(x, y);
      guides.position(x, y) = point == kNoPoint ? Vec3f{} : light.points.position[point];
      guides.normal(x, y) = point == kNoPoint ? Vec3f{} : light.points.normal[point];
    }
  }
}

namespace relight_detail {

// Light that comes straight from the lamps: illuminance at every point, and luminance of what each pixel shows.
template <class Executor>
[[nodiscard]] Status direct_image(const RelightParams& params, const Relighting& light, Span<const Activation> lit,
                                  Span<Vec3f> illuminance, ImageView<Vec3f> out, Workspace& workspace,
                                  Executor& executor) {
  const WorkspaceScope scope(workspace);
  Span<Vec3f> luminance;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(light.points.size(), luminance));
  NPSIM_RETURN_IF_ERROR(
      direct_light(light.points, light.emitters, lit, light.visibility, params.f0, illuminance, luminance, executor));
  for (int y = 0; y < out.height(); ++y) {
    for (int x = 0; x < out.width(); ++x) {
      const std::uint32_t point = light.visible_point(x, y);
      out(x, y) = point == kNoPoint ? Vec3f{} : luminance[point];
    }
  }
  return {};
}

// Irradiance that comes by way of other surfaces, from the sky and from the street that is not seen. illuminance:
// direct in, with that of all bounces but the last one out. Gathering direct light and what k bounces brought to the
// points that pixels show gives k + 1.
template <class Executor>
[[nodiscard]] Status indirect_image(const RelightParams& params, const Relighting& light, Span<const Activation> lit,
                                    Span<Vec3f> illuminance, ImageView<Vec3f> irradiance, Workspace& workspace,
                                    Executor& executor) {
  const WorkspaceScope scope(workspace);
  Span<Vec3f> indirect;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(light.receivers.size(), indirect));
  const auto for_receivers = [&](auto&& f) {
    std::size_t r = 0;
    for (int y = 0; y < irradiance.height(); ++y) {
      for (int x = 0; x < irradiance.width(); ++x) {
        if (light.visible_point(x, y) != kNoPoint) f(r++, irradiance(x, y));
      }
    }
  };
  // Until the end the image keeps the direct light of its pixels' points.
  for (Vec3f& v : irradiance.pixels()) v = Vec3f{};
  for_receivers([&](std::size_t r, Vec3f& direct) { direct = illuminance[light.receivers[r]]; });
  const UnseenStreetLight street =
      unseen_street_light(light.points, light.receivers, light.sky.up, light.emitters, lit, light.visibility);
  for (int bounce = 1;; ++bounce) {
    NPSIM_RETURN_IF_ERROR(
        gather_irradiance(light.points, illuminance, light.hits, params.gather.rays, indirect, executor));
    for (std::size_t r = 0; r < indirect.size(); ++r) {
      indirect[r] += light.sky_irradiance[r] + street.luminance(light.unseen[r]) * kPi;
    }
    if (bounce >= params.bounces) break;
    for_receivers([&](std::size_t r, const Vec3f& direct) { illuminance[light.receivers[r]] = direct + indirect[r]; });
  }
  for_receivers([&](std::size_t r, Vec3f& v) { v = indirect[r]; });
  return {};
}

// Adds what a pixel shows besides direct light: irradiance reflected, the sky, and the lamp that it is part of.
inline void add_rest(const SceneView& scene, const Relighting& light, Span<const Activation> lit,
                     ImageView<const Vec3f> irradiance, int y, ImageView<Vec3f> out) noexcept {
  for (int x = 0; x < out.width(); ++x) {
    const std::uint32_t point = light.visible_point(x, y);
    Vec3f seen = out(x, y);
    if (point != kNoPoint) {
      seen = seen + light.points.albedo[point] * irradiance(x, y) * kInversePi;
    } else if (scene.labels.empty() || scene.labels(x, y) == label::sky) {
      // No surface: the sky above the horizon. The camera's own car mirrors what all this makes.
      const Vec3f direction = normalized(unproject_pixel(scene.camera, x, y, 1.0F));
      seen = sky_luminance(light.sky, raised_to_horizon(light.sky, direction));
    }
    const std::uint16_t mark = scene.light_index.empty() ? std::uint16_t{0} : scene.light_index(x, y);
    const std::uint32_t emitter = mark == 0 ? kNoPoint : light.emitter_of_mark[mark - 1U];
    if (emitter != kNoPoint && lit[emitter].lit) {
      const Emitter& e = light.emitters[emitter];
      seen += lit[emitter].luminance_cd_m2 *
              source_pattern_at(scene, source_pattern(e.cls, e.profile), light.brightness_of_mark[mark - 1U], x, y);
    }
    out(x, y) = seen;
  }
}

}  // namespace relight_detail

// One variant's linear image: luminance(rgb) is in cd/m2. guides: from fill_guides().
template <class Executor, class Observer>
Status relight(const RelightParams& params, const SceneView& scene, const Relighting& light,
               const DenoiseGuides& guides, int variant, ImageView<Vec3f> out, Workspace& workspace, Executor& executor,
               Observer& observer) {
  const Shape shape = scene.shape();
  if (variant < 0 || variant >= light.variants) {
    return Status(StatusCode::invalid_argument, "the variant was not prepared");
  }
  if (out.shape() != shape || guides.position.shape() != shape || guides.normal.shape() != shape) {
    return Status(StatusCode::shape_mismatch, "the night image and its guides must have the scene's size");
  }
  const WorkspaceScope scope(workspace);
  const Span<const Activation> lit = light.of_variant(variant);
  ImageView<Vec3f> irradiance;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, irradiance));
  ImageView<Vec3f> mirrored;
  if (!light.mirrors.pixel.empty()) {
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, mirrored));
  }

  observer.begin(Stage::render);
  {
    const WorkspaceScope render(workspace);
    Span<Vec3f> illuminance;
    NPSIM_RETURN_IF_ERROR(workspace.allocate(light.points.size(), illuminance));
    NPSIM_RETURN_IF_ERROR(relight_detail::direct_image(params, light, lit, illuminance, out, workspace, executor));
    NPSIM_RETURN_IF_ERROR(
        relight_detail::indirect_image(params, light, lit, illuminance, irradiance, workspace, executor));
    if (!mirrored.empty()) {
      NPSIM_RETURN_IF_ERROR(mirrored_luminance(light.points, illuminance, light.mirrors, mirrored, executor));
    }
  }
  observer.end(Stage::render);

  observer.begin(Stage::denoise);
  NPSIM_RETURN_IF_ERROR(
      denoise_irradiance(params.denoise, guides.position, guides.normal, irradiance, workspace, executor));
  if (!mirrored.empty()) {
    NPSIM_RETURN_IF_ERROR(denoise_irradiance(relight_detail::mirror_filter(params.denoise), guides.position,
                                             guides.normal, mirrored, workspace, executor));
  }
  observer.end(Stage::denoise);

  executor.for_chunks(static_cast<std::size_t>(shape.height), 8, [&](std::size_t begin, std::size_t end) {
    for (auto y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      relight_detail::add_rest(scene, light, lit, irradiance, y, out);
    }
  });
  if (!mirrored.empty()) relight_detail::show_film(params.f0, light.points, light.mirrors, irradiance, mirrored, out);
  relight_detail::continue_over_frame(scene.labels, out);
  NPSIM_RETURN_IF_ERROR(show_own_car(scene, params.f0, out, workspace));
  return observer.cancelled() ? Status(StatusCode::cancelled, "cancelled while relighting") : Status();
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_RELIGHT_HPP
