// SPDX-License-Identifier: Apache-2.0
// Section 3.6: light in the reconstructed scene, in two steps.
//
// prepare_relighting() does what all nights of one day share: it places the lamps, draws which variant lights which of
// them, traces every ray of the method, and makes the linear image of every light (detail/light_transport.hpp).
// relight() then makes the linear image of one night: the sum of the lights, each by its strength and colour
// (render/light_images.hpp), and what is seen of the lamps themselves. Light is linear, so nothing is lost by the
// split; forty nights cost little more than one.
// Rays look for light at the points that pixels show; lamps are asked about those and the points that their bounces
// reach. A variant's bits do not depend on how many others there are.
// Effort or error: either `gather.rays` are traced from each receiver, or, with max_error, as many as the noise of the
// expected night asks for; what was reached is in Relighting either way.
// Memory (workspace): relight_workspace_bytes(), from the sizes of the mesh: 36 bytes a point that are kept, and while
// lights are made 4 a gather ray and receiver, what rays are traced through, what detail/light_transport.hpp takes, and
// 16 a pixel where light is spread for an unsure shape, 16 a point where plants have leaves' normals;
// then the images of the lights (LightImages::bytes()), for which the workspace is asked image by image.
#ifndef NPSIM_PIPELINE_RELIGHT_HPP
#define NPSIM_PIPELINE_RELIGHT_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/observe.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/refine_depth_params.hpp"
#include "npsim/light/activation.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/light/light_set.hpp"
#include "npsim/light/placement.hpp"
#include "npsim/light/unmarked.hpp"
#include "npsim/pipeline/detail/body_faces.hpp"
#include "npsim/pipeline/detail/lamp_faces.hpp"
#include "npsim/pipeline/detail/leaf_normals.hpp"
#include "npsim/pipeline/detail/light_groups.hpp"
#include "npsim/pipeline/detail/light_transport.hpp"
#include "npsim/pipeline/detail/mirrored_image.hpp"
#include "npsim/pipeline/detail/own_car.hpp"
#include "npsim/pipeline/detail/ray_starts.hpp"
#include "npsim/pipeline/detail/rays_for_error.hpp"
#include "npsim/pipeline/detail/scene_rays.hpp"
#include "npsim/pipeline/detail/shining_sources.hpp"
#include "npsim/pipeline/detail/source_pixels.hpp"
#include "npsim/pipeline/detail/surface_attributes.hpp"
#include "npsim/pipeline/detail/unsure_surfaces.hpp"
#include "npsim/pipeline/detail/veil_faces.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/render/denoise.hpp"
#include "npsim/render/gather.hpp"
#include "npsim/render/light_images.hpp"
#include "npsim/render/mirror.hpp"
#include "npsim/render/surface_points.hpp"
#include "npsim/render/unsure_light.hpp"
#include "npsim/render/visibility.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct RelightParams {
  PlacementParams placement;
  ContinuedRowParams rows;               // street lamps that the picture does not show
  Span<const Emitter> lamps;             // where the lamps are known: these, in place of marked ones that are placed
  Span<const std::uint8_t> shop_fronts;  // by mark, 1: is one, where that is known; else size and place of windows tell
  ActivationParams activation;
  VisibilityParams visibility;
  GatherParams gather;
  MirrorParams mirror;        // where the ground is wet (material.film)
  UnseenStreetParams unseen;  // what rays see that leave the picture's street
  DenoiseParams denoise;
  UnsureLightParams unsure_light;  // of stereo and lasers, and of guessed leaves
  SkyParams sky;
  MaterialParams material;
  VeilParams veils;
  LabelSet bodies = kBodyLabels;  // of things that do not shade themselves
  int bounces = 2;                // diffuse bounces after the direct light, 1..16
  // Tiles of a light's image stay out that it nowhere brings to this luminance, at its strongest.
  float least_cd_m2 = 2e-4F;  // the darkest sky over a city makes a grey surface 20 times as bright
  // Of the expected night, see Relighting::error. 0: gather.rays decide; else these are where the search begins.
  float max_error = 0;
  int max_rays = 256;         // at most so many, whatever the error
  float f0 = 0.04F;           // normal reflectance of a dielectric of index 1.5
  bool ego_headlamps = true;  // the low beams of the car that carries the camera
  EgoHeadlampParams ego;
  float following_car_m = 0;  // a car with its low beams on follows so far behind the camera; 0: none does
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
  NPSIM_RETURN_IF_ERROR(validate(p.unsure_light));
  NPSIM_RETURN_IF_ERROR(validate(p.sky));
  NPSIM_RETURN_IF_ERROR(validate(p.material.albedo));
  NPSIM_RETURN_IF_ERROR(validate(p.material.wide_if_guessed));
  NPSIM_RETURN_IF_ERROR(validate(p.material.film));
  NPSIM_RETURN_IF_ERROR(validate(p.material.retroreflection));
  NPSIM_RETURN_IF_ERROR(validate(p.veils));
  NPSIM_RETURN_IF_ERROR(validate(p.ego));
  if (!(p.following_car_m == 0.0F ||
        (p.following_car_m >= kNearestFollower_m && p.following_car_m <= kFarthestFollower_m))) {
    return {StatusCode::invalid_argument, "relight: a car follows 6 to 200 m behind the camera; 0: none does"};
  }
  if (p.bounces < 1 || p.bounces > 16) return {StatusCode::invalid_argument, "relight: bounces in 1..16"};
  if (!(p.f0 >= 0.0F && p.f0 <= 1.0F)) return {StatusCode::invalid_argument, "relight: f0 in [0, 1]"};
  if (!(p.least_cd_m2 >= 0.0F) || !(p.max_error >= 0.0F) || p.max_rays < p.gather.rays || p.max_rays > 4096) {
    return {StatusCode::invalid_argument, "relight: least luminance and error not negative, rays <= max_rays <= 4096"};
  }
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
  LightGroups groups;
  LightImages images;  // of the groups, the sky first, then of the emitters
  int rays = 0;        // that were traced from each receiver
  // Root mean square over the picture, without the largest .1 %, of the noise relative to the luminance, of a night in
  // which every lamp has its mean intensity. The denoiser's bias is not in it.
  double error = 0;
  // Mean over the picture of the illuminance that lamps below the cut-off (VisibilityParams) could bring at most.
  double mean_untraced_lx = 0;
  int variants = 0;

  [[nodiscard]] Span<const Activation> of_variant(int variant) const noexcept {
    return activations.sub(static_cast<std::size_t>(variant) * emitters.size(), emitters.size());
  }
};

namespace relight_detail {

inline constexpr std::size_t kMostHeadlamps = 2 * kEgoHeadlampCount;  // the own ones, and a following car's

}  // namespace relight_detail

// What relight_workspace_bytes() goes by; `unsure` and `leaves`, which depend on the depth's source, are of
// prepare_relighting().
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
  bool unsure = false;     // whether light is spread where the shape is unsure
  bool leaves = false;     // whether plants have leaves' normals
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
                   0,
                   false};
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
[[nodiscard]] constexpr std::size_t variant_workspace_bytes(Shape shape, std::size_t emitters) noexcept {
  return allocation_bytes<Vec3f>(2 * emitters + 1) + show_own_car_workspace_bytes(shape);
}

// What prepare_relighting() and then relight() take; of the images of lights, none.
[[nodiscard]] constexpr std::size_t relight_workspace_bytes(const RelightParams& params, TracedFaces traced,
                                                            Shape shape, const RelightSize& size) noexcept {
  const std::size_t known = std::max(size.marks, params.lamps.size()) + relight_detail::kMostHeadlamps;
  const std::size_t emitters = known + most_unseen_lamps(params.rows, size.marks);
  const int most_rays = params.max_error > 0.0F ? params.max_rays : params.gather.rays;
  const std::size_t rays = most_rays > 0 ? static_cast<std::size_t>(most_rays) : 0;
  const std::size_t drawn = emitters * (size.variants > 0 ? static_cast<std::size_t>(size.variants) : 0);
  const bool wet = is_wet(params.material.film);
  const std::size_t shared =
      allocation_bytes<Emitter>(emitters) + allocation_bytes<Activation>(drawn) + light_groups_bytes(emitters) +
      allocation_bytes<std::uint32_t>(size.marks) + allocation_bytes<float>(size.marks) +
      allocation_bytes<relight_detail::SourceBrightness>(size.marks) + 2 * allocation_bytes<Vec3f>(size.points) +
      2 * allocation_bytes<float>(size.points) + allocation_bytes<Retroreflector>(size.points) +
      LightImageBuilder::index_bytes(shape, 2 * emitters + 1) + (wet ? allocation_bytes<std::uint8_t>(size.points) : 0);
  const std::size_t rows = shape.height > 0 ? static_cast<std::size_t>(shape.height) : 0;
  const std::size_t faces = traced_face_count(traced, shape, size.faces, size.backs);
  const std::size_t light =
      scene_rays_workspace_bytes(traced, shape, size.faces, size.backs) + 2 * allocation_bytes<std::uint16_t>(faces) +
      allocation_bytes<std::uint8_t>(faces) + allocation_bytes<std::uint16_t>(size.points) +
      allocation_bytes<std::uint16_t>(emitters) +
      max_of(mark_faces_workspace_bytes(shape, size.marks, emitters), find_veils_workspace_bytes(shape),
             find_bodies_workspace_bytes(shape)) +
      allocation_bytes<std::uint8_t>(size.points) + allocation_bytes<std::uint32_t>(size.receivers) +
      allocation_bytes<std::uint32_t>(rows + 1) + allocation_bytes<std::uint32_t>(size.receivers * rays) +
      allocation_bytes<Vec3f>(size.receivers) + allocation_bytes<Vec2f>(size.receivers) +
      (wet ? mirrors_bytes(params.mirror, size.wet) : 0) + allocation_bytes<Vec3f>(2 * emitters + 1) +
      allocation_bytes<float>(emitters) +
      (size.unsure ? allocation_bytes<float>(UnsureLightGuides::floats(shape)) : 0) +
      (size.leaves ? allocation_bytes<Vec3f>(size.points) + allocation_bytes<float>(size.points) : 0) +
      relight_detail::light_transport_workspace_bytes(shape, size.points, params.bounces, wet);
  return shared +
         max_of(size.marks > 0 ? placement_workspace_bytes(params.placement, shape) : std::size_t{0},
                allocation_bytes<relight_detail::DaySource>(emitters),
                allocation_bytes<Vec3f>(emitters) + allocation_bytes<float>(emitters),
                surface_attributes_workspace_bytes(params.material, shape, size.albedo_guessed), light,
                variant_workspace_bytes(shape, emitters)) +
         kWorkspaceAlignment;
}

// The most that the images of lights can take: every tile of all of them.
[[nodiscard]] constexpr std::size_t light_images_bytes(const RelightParams& params, Shape shape,
                                                       std::size_t marks) noexcept {
  const std::size_t emitters =
      std::max(marks, params.lamps.size()) + relight_detail::kMostHeadlamps + most_unseen_lamps(params.rows, marks);
  return (2 * emitters + 1) * allocation_bytes<std::uint16_t>(light_tiles(shape).pixels() * kLightBlock);
}

// What lamps are placed by.
[[nodiscard]] inline PlacementScene placement_scene(const SceneView& scene, const RefinedDepth& refined) noexcept {
  PlacementScene out;
  out.camera = scene.camera;
  out.ground = refined.ground;
  out.marks = scene.lights;
  out.light_index = scene.light_index;
  out.depth = refined.surface_depth();
  out.labels = refined.labels;
  out.instances = scene.instances;
  out.uncertain = refined.uncertain;
  out.normals = refined.normals;
  out.confidence = refined.confidence;
  return out;
}

namespace relight_detail {

inline constexpr float kPi = 3.14159265F;
inline constexpr float kInversePi = 0.31830989F;

// The lamps that are marked, or known, then those that continue their rows, a following car's, and the own car's.
[[nodiscard]] inline Status place_emitters(const RelightParams& params, const SceneView& scene,
                                           const RefinedDepth& refined, Workspace& workspace, Span<Emitter>& emitters,
                                           Span<std::uint32_t>& emitter_of_mark) {
  if (!params.shop_fronts.empty() && params.shop_fronts.size() != scene.lights.size()) {
    return {StatusCode::shape_mismatch, "relight: shop fronts are told for every mark or for none"};
  }
  const std::size_t most = (params.lamps.empty() ? scene.lights.size() : params.lamps.size()) +
                           most_unseen_lamps(params.rows, scene.lights.size());
  NPSIM_RETURN_IF_ERROR(workspace.allocate(most + kMostHeadlamps, emitters));
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
    const PlacementScene known = placement_scene(scene, refined);
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
    emitters[e].shines_by_day = false;
    const bool told = !params.shop_fronts.empty() && emitters[e].mark != 0;
    emitters[e].shop_front =
        told ? params.shop_fronts[emitters[e].mark - 1U] != 0 : is_shop_front(refined.ground, emitters[e]);
  }
  if (!params.activation.by_text_alone) {
    const WorkspaceScope scope(workspace);
    Span<DaySource> sources;
    NPSIM_RETURN_IF_ERROR(workspace.allocate(count, sources));
    find_shining(scene, emitter_of_mark, sources, emitters.sub(0, count));
  }
  count +=
      place_following_car(params.ego, params.following_car_m, refined.ground, emitters.sub(count, kEgoHeadlampCount));
  if (params.ego_headlamps)
    count += place_ego_headlamps(params.ego, refined.ground, emitters.sub(count, kEgoHeadlampCount));
  emitters = emitters.sub(0, count);
  return {};
}

// Which lamp is lit in which variant.
[[nodiscard]] inline Status draw_activations(const ActivationParams& params, std::uint64_t key, int variants,
                                             const SceneView& scene, Span<const Emitter> emitters,
                                             Span<const std::uint32_t> emitter_of_mark, Workspace& workspace,
                                             Span<Activation>& activations) {
  const std::size_t count = emitters.size();
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count * static_cast<std::size_t>(variants), activations));
  const WorkspaceScope scope(workspace);
  Span<Vec3f> day_rgb;
  Span<float> weight;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, day_rgb));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, weight));
  daytime_colours(scene, emitter_of_mark, day_rgb, weight);
  for (int v = 0; v < variants; ++v) {
    const Span<Activation> drawn = activations.sub(static_cast<std::size_t>(v) * count, count);
    NPSIM_RETURN_IF_ERROR(activate_lights(params, key, static_cast<std::uint32_t>(v), emitters, day_rgb, drawn));
  }
  return {};
}

[[nodiscard]] inline Status list_receivers(ImageView<const std::uint32_t> visible, std::size_t count,
                                           Workspace& workspace, Span<std::uint32_t>& receivers,
                                           Span<std::uint32_t>& first_of_row) {
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, receivers));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(visible.height()) + 1, first_of_row));
  std::size_t r = 0;
  for (int y = 0; y < visible.height(); ++y) {
    first_of_row[static_cast<std::size_t>(y)] = static_cast<std::uint32_t>(r);
    for (int x = 0; x < visible.width(); ++x) {
      if (visible(x, y) != kNoVertex) receivers[r++] = visible(x, y);
    }
  }
  first_of_row[static_cast<std::size_t>(visible.height())] = static_cast<std::uint32_t>(r);
  return {};
}

// What they are is known by what the pixels of the faces show.
template <class Rays>
[[nodiscard]] Status find_occluders(const RelightParams& params, const SceneView& scene, const SceneMesh& mesh,
                                    DepthSource source, const Rays& rays, Span<const Emitter> emitters,
                                    Workspace& workspace, Occluders& out) {
  const auto for_each_face = [&rays](const auto& f) { rays.for_each_face(f); };
  Span<std::uint16_t> lamp_mark;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(rays.face_count(), lamp_mark));
  NPSIM_RETURN_IF_ERROR(mark_lamp_faces(scene, mesh, emitters, for_each_face, lamp_mark, workspace));
  out.lamp_mark = lamp_mark;
  NPSIM_RETURN_IF_ERROR(
      find_veils(params.veils, scene.labels, mesh.object, rays.face_count(), for_each_face, workspace, out.veils));
  if (source == DepthSource::exact) return {};  // has no dents, and shows what a body does shade of itself
  return find_bodies(params.bodies, scene, mesh, emitters, rays.face_count(), for_each_face, workspace, out.bodies);
}

// Every ray, and the images of all lights. The structure that rays are traced through is built here and gone
// afterwards. `out` holds all but groups' images and what was reached. Rays: LayerRays or MeshRays (scene_rays.hpp).
template <class Rays, class Executor, class Observer>
[[nodiscard]] Status trace_light(const RelightParams& params, std::uint64_t key, const SceneView& scene,
                                 const SceneMesh& mesh, const RefinedDepth& refined, const RelightSize& size,
                                 Span<std::uint32_t> block, Workspace& workspace, Executor& executor,
                                 Observer& observer, Relighting& out) {
  const Shape shape = scene.shape();
  observer.begin(Stage::build_trace);
  Rays rays;
  NPSIM_RETURN_IF_ERROR(Rays::make(scene, mesh, workspace, executor, rays));
  Occluders occluders;
  NPSIM_RETURN_IF_ERROR(find_occluders(params, scene, mesh, refined.source, rays, out.emitters, workspace, occluders));
  observer.end(Stage::build_trace);

  observer.begin(Stage::render);
  LitScene lit;
  lit.points = lit.lit_points = out.points;
  if (size.leaves) {
    Span<Vec3f> normal;
    Span<float> lift_m;
    NPSIM_RETURN_IF_ERROR(workspace.allocate(size.points, normal));
    NPSIM_RETURN_IF_ERROR(workspace.allocate(size.points, lift_m));
    std::copy(out.points.normal.begin(), out.points.normal.end(), normal.begin());
    std::copy(out.points.lift_m.begin(), out.points.lift_m.end(), lift_m.begin());
    turn_leaves(key, refined, mesh, normal, lift_m, executor);
    lit.lit_points.normal = normal;
    lit.lit_points.lift_m = lift_m;
  }
  lit.visible_point = out.visible_point;
  lit.emitters = out.emitters;
  lit.groups = out.groups;
  Span<float> certain_cd;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(out.emitters.size(), certain_cd));
  for (std::size_t e = 0; e < out.emitters.size(); ++e) {
    certain_cd[e] = certain_intensity_cd(params.activation, out.emitters[e]);
  }
  lit.certain_cd = certain_cd;
  lit.up = out.sky.up;
  lit.f0 = params.f0;
  Span<std::uint32_t> receivers, first_receiver;
  NPSIM_RETURN_IF_ERROR(list_receivers(mesh.visible_vertex, size.receivers, workspace, receivers, first_receiver));
  lit.receivers = receivers;
  lit.first_receiver = first_receiver;
  if (size.unsure) {
    NPSIM_RETURN_IF_ERROR(
        find_unsure_surfaces(params.unsure_light, refined, out.points, out.visible_point, workspace, lit.unsure));
  }
  const auto point_of = [&rays](const Hit& hit) { return rays.point_of(hit); };
  if (is_wet(params.material.film)) {
    // A street lamp lights its own head and mast from hardly any distance: specks around its streak.
    const auto mirrored_point_of = [&](const Hit& hit) {
      const std::uint16_t mark = occluders.lamp_mark[hit.face];
      return mark != 0 && is_street_lamp(scene.lights[mark - 1].cls) ? kNoPoint : rays.point_of(hit);
    };
    NPSIM_RETURN_IF_ERROR(list_mirrors(params.mirror, lit.points, lit.visible_point, size.wet, workspace, lit.mirrors));
    NPSIM_RETURN_IF_ERROR(trace_mirror_rays(params.mirror, key, params.f0, rays.scene, mirrored_point_of, lit.points,
                                            out.sky, lit.mirrors, executor, observer));
  }
  Span<Vec3f> sky_irradiance;
  Span<Vec2f> unseen;
  Span<std::uint8_t> hidden;
  Span<Vec3f> expected;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(size.receivers, sky_irradiance));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(size.receivers, unseen));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(lit.points.size(), hidden));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(lit.groups.image_count(), expected));
  lit.sky_irradiance = sky_irradiance;
  lit.unseen = unseen;
  light_weights(
      lit.groups,
      [&](std::size_t e) {
        return Vec3f{1, 1, 1} * mean_intensity_cd(params.activation, lit.emitters[e]);
      },
      expected);

  GatherParams gather = params.gather;
  RaysForError search;
  for (;;) {
    const WorkspaceScope attempt(workspace);
    Span<std::uint32_t> hits;
    NPSIM_RETURN_IF_ERROR(workspace.allocate(size.receivers * static_cast<std::size_t>(gather.rays), hits));
    NPSIM_RETURN_IF_ERROR(trace_gather_rays(gather, key, rays.scene, point_of, lit.points, lit.receivers, out.sky,
                                            params.unseen, hits, sky_irradiance, unseen, executor, observer));
    lit.hits = hits;
    // Light is asked for at the points that pixels show and those that their bounces reach.
    for (std::uint8_t& h : hidden) h = 0;
    for (const Span<const std::uint32_t> reached : {lit.hits, Span<const std::uint32_t>(lit.mirrors.hits)}) {
      for (const std::uint32_t point : reached) {
        if (point != kNoPoint) hidden[point] = 1;
      }
    }
    for (const std::uint32_t point : lit.receivers) hidden[point] = 0;
    NPSIM_RETURN_IF_ERROR(
        make_point_blocks(lit.lit_points, lit.visible_point, hidden, workspace, executor, lit.blocks));
    const auto light_of = [&](std::size_t e, Span<float> certain_lx, Span<float> untraced_lx, const auto& each_block) {
      return light_blocks(params.visibility, key, rays.scene, lit.lit_points, lit.blocks, certain_lx, lit.emitters[e],
                          static_cast<std::uint32_t>(e), lit.groups.peak_cd[e], occluders, untraced_lx, executor,
                          observer, each_block);
    };
    LightTransport transport(lit, gather.rays, params.bounces, params.denoise, params.unsure_light);
    NPSIM_RETURN_IF_ERROR(transport.allocate(workspace));
    LightImageBuilder images;
    NPSIM_RETURN_IF_ERROR(images.start(shape, params.least_cd_m2, block, workspace));
    NPSIM_RETURN_IF_ERROR(transport.make(expected, light_of, images, workspace, executor, observer));
    out.images = {shape, block, images.values(), lit.groups.image_count(), images.left_out_cd_m2()};
    out.rays = gather.rays;
    out.mean_untraced_lx = transport.mean_untraced_lx();
    const ImageView<Vec3f> night = transport.night_room();
    NPSIM_RETURN_IF_ERROR(sum_light_images(out.images, expected, night, executor));
    NPSIM_RETURN_IF_ERROR(transport.error(night, out.error, executor));
    const double more = params.max_error > 0.0F ? out.error / static_cast<double>(params.max_error) : 0.0;
    if (!(more > 1.0) || gather.rays >= params.max_rays) break;
    gather.rays = search.next(gather.rays, out.error, more, params.max_rays);
  }
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
  size.leaves = relight_detail::has_leaf_normals(params.unsure_light, scene, refined.source);
  size.unsure = relight_detail::has_unsure_surfaces(params.unsure_light, refined.source, size.leaves);
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
  NPSIM_RETURN_IF_ERROR(relight_detail::draw_activations(params.activation, key, variants, scene, emitters,
                                                         emitter_of_mark, workspace, activations));
  NPSIM_RETURN_IF_ERROR(
      relight_detail::group_lights(params.activation, emitters, variants, activations, workspace, out.groups));
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
  NPSIM_RETURN_IF_ERROR(
      surface_attributes(params.material, scene, refined, mesh, surface, workspace, executor, observer));
  Span<float> lift_m;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(size.points, lift_m));
  ray_lifts(mesh, noise_of_mesh(refined), refined.ground.up, surface.normal, lift_m, executor);
  observer.end(Stage::material);

  out.points = SurfacePoints{mesh.mesh.vertices, surface.normal, surface.albedo, surface.alpha, lift_m,
                             surface.retro,      surface.film};
  out.visible_point = mesh.visible_vertex;
  out.emitters = emitters;
  out.activations = activations;
  out.emitter_of_mark = emitter_of_mark;
  out.brightness_of_mark = brightness_of_mark;
  out.variants = variants;
  Span<std::uint32_t> block;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(out.groups.image_count() * light_tiles(scene.shape()).pixels(), block));
  {
    const WorkspaceScope scope(workspace);
    const auto trace = [&](auto kind) {
      return relight_detail::trace_light<decltype(kind)>(params, key, scene, mesh, refined, size, block, workspace,
                                                         executor, observer, out);
    };
    NPSIM_RETURN_IF_ERROR(traced == TracedFaces::mesh ? trace(MeshRays{}) : trace(LayerRays{}));
  }
  // The images were made above what making them took; they move down to where that began.
  Span<std::uint16_t> values;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(out.images.values.size(), values));
  std::memmove(values.data(), out.images.values.data(), out.images.bytes());
  out.images.values = values;
  return {};
}

namespace relight_detail {

// Adds what is seen that no lamp lights: the sky, and the lamps themselves.
inline void add_sources(const SceneView& scene, const Relighting& light, Span<const Activation> lit, int y,
                        ImageView<Vec3f> out) noexcept {
  for (int x = 0; x < out.width(); ++x) {
    Vec3f seen = out(x, y);
    if (light.visible_point(x, y) == kNoPoint && (scene.labels.empty() || scene.labels(x, y) == label::sky)) {
      // No surface: the sky above the horizon. The camera's own car mirrors what all this makes.
      const Vec3f direction = normalized(unproject_pixel(scene.camera, x, y, 1.0F));
      seen = sky_luminance(light.sky, raised_to_horizon(light.sky, direction));
    }
    const std::uint16_t mark = scene.light_index.empty() ? std::uint16_t{0} : scene.light_index(x, y);
    const std::uint32_t emitter = mark == 0 ? kNoPoint : light.emitter_of_mark[mark - 1U];
    if (emitter != kNoPoint && lit[emitter].lit) {
      const Emitter& e = light.emitters[emitter];
      seen += lit[emitter].luminance_cd_m2 *
              source_pattern_at(scene, source_pattern(e), light.brightness_of_mark[mark - 1U], x, y);
    }
    out(x, y) = seen;
  }
}

}  // namespace relight_detail

// One variant's linear image: luminance(rgb) is in cd/m2.
template <class Executor, class Observer>
Status relight(const RelightParams& params, const SceneView& scene, const Relighting& light, int variant,
               ImageView<Vec3f> out, Workspace& workspace, Executor& executor, Observer& observer) {
  const Shape shape = scene.shape();
  if (variant < 0 || variant >= light.variants) {
    return Status(StatusCode::invalid_argument, "the variant was not prepared");
  }
  if (out.shape() != shape) return Status(StatusCode::shape_mismatch, "the night image must have the scene's size");
  const WorkspaceScope scope(workspace);
  const Span<const Activation> lit = light.of_variant(variant);
  observer.begin(Stage::add_lights);
  Span<Vec3f> weights;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(light.images.count, weights));
  relight_detail::light_weights(
      light.groups, [lit](std::size_t e) { return lit[e].intensity_cd; }, weights);
  NPSIM_RETURN_IF_ERROR(sum_light_images(light.images, weights, out, executor));
  executor.for_chunks(static_cast<std::size_t>(shape.height), 8, [&](std::size_t begin, std::size_t end) {
    for (auto y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      relight_detail::add_sources(scene, light, lit, y, out);
    }
  });
  relight_detail::continue_over_frame(scene.labels, out);
  NPSIM_RETURN_IF_ERROR(show_own_car(scene, params.f0, out, workspace));
  observer.end(Stage::add_lights);
  return observer.cancelled() ? Status(StatusCode::cancelled, "cancelled while relighting") : Status();
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_RELIGHT_HPP
