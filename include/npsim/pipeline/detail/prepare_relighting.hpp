// SPDX-License-Identifier: Apache-2.0
// What all nights of one day share: the lamps, which variants light them, what every lamp's light can reach, and where
// light that bounces comes from.
//
// Every ray of the method is traced here, so that a variant (relight.hpp) only adds up. Rays look for light at the
// points that pixels show; lamps are asked about those and the points that their bounces reach.
// Memory (workspace): emitters + 4 rays per pixel bytes and about 120 bytes per surface point; see
// relight_workspace_bytes(), which holds for relight() too.
#ifndef NPSIM_PIPELINE_DETAIL_PREPARE_RELIGHTING_HPP
#define NPSIM_PIPELINE_DETAIL_PREPARE_RELIGHTING_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/observe.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/light/activation.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/light/headlamps.hpp"
#include "npsim/light/placement.hpp"
#include "npsim/light/sky.hpp"
#include "npsim/material/albedo.hpp"
#include "npsim/pipeline/detail/lamp_faces.hpp"
#include "npsim/pipeline/detail/scene_rays.hpp"
#include "npsim/pipeline/detail/source_pixels.hpp"
#include "npsim/pipeline/detail/surface_attributes.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/pipeline/refine_depth.hpp"
#include "npsim/render/denoise.hpp"
#include "npsim/render/gather.hpp"
#include "npsim/render/surface_points.hpp"
#include "npsim/render/visibility.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct RelightParams {
  PlacementParams placement;
  ActivationParams activation;
  VisibilityParams visibility;
  GatherParams gather;
  DenoiseParams denoise;
  SkyParams sky;
  MaterialParams material;
  GroundParams ground;
  int bounces = 2;             // diffuse bounces after the direct light, 1..16
  float f0 = 0.04F;            // normal reflectance of a dielectric of index 1.5
  bool ego_headlamps = true;   // the low beams of the car that carries the camera
  EgoHeadlampParams ego;
};

[[nodiscard]] inline Status validate(const RelightParams& p) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(p.sky));
  NPSIM_RETURN_IF_ERROR(validate(p.activation));
  NPSIM_RETURN_IF_ERROR(validate(p.denoise));
  NPSIM_RETURN_IF_ERROR(validate(p.gather));
  NPSIM_RETURN_IF_ERROR(validate(p.visibility));
  if (p.bounces < 1 || p.bounces > 16) return {StatusCode::invalid_argument, "relight: bounces in 1..16"};
  if (!(p.f0 >= 0.0F && p.f0 <= 1.0F)) return {StatusCode::invalid_argument, "relight: f0 in [0, 1]"};
  return {};
}

// Everything that the variants share; spans into the workspace.
struct Relighting {
  GroundPlane ground;
  SkyParams sky;                                 // with the scene's up direction
  SurfacePoints points;
  ImageView<const std::uint32_t> visible_point;  // per pixel; kNoPoint where the scene has no surface
  Span<const Emitter> emitters;                  // marked ones first, then the ego vehicle's
  Span<const Activation> activations;            // variant-major: variant * emitters + emitter
  Span<const std::uint32_t> emitter_of_mark;     // mark position -> emitter, or kNoPoint
  Span<const float> mean_of_mark;                // mean displayed brightness of each mark's pixels by day
  Span<const std::uint8_t> visibility;
  Span<const std::uint32_t> receivers;           // the points that pixels show
  Span<const std::uint32_t> hits;
  Span<const Vec3f> sky_irradiance;
  int variants = 0;
};

// Upper bound of what prepare_relighting() and relight() take together.
[[nodiscard]] constexpr std::size_t relight_workspace_bytes(const RelightParams& params, const SceneView& scene,
                                                            int variants) noexcept {
  const std::size_t pixels = scene.shape().pixels();
  const std::size_t points = kMaxVerticesPerPixel * pixels;
  const std::size_t emitters = scene.lights.size() + kEgoHeadlampCount;
  return allocation_bytes<Vec3f>(points) * 5 + allocation_bytes<float>(points) +
         allocation_bytes<std::uint16_t>(kMaxTracedFacesPerPixel * pixels) +
         allocation_bytes<std::uint8_t>(points) + mark_faces_workspace_bytes(scene, emitters) +
         allocation_bytes<std::uint8_t>(emitters * points) + allocation_bytes<std::uint32_t>(pixels) * 2 +
         allocation_bytes<std::uint32_t>(pixels * static_cast<std::size_t>(params.gather.rays)) +
         allocation_bytes<Vec3f>(pixels) * 5 + denoise_workspace_bytes(params.denoise, scene.shape()) +
         allocation_bytes<Emitter>(emitters) +
         allocation_bytes<Activation>(emitters * static_cast<std::size_t>(variants)) +
         allocation_bytes<float>(emitters) + allocation_bytes<std::uint32_t>(scene.lights.size()) +
         2 * allocation_bytes<float>(scene.lights.size()) +
         allocation_bytes<Vec3f>(emitters) +
         placement_workspace_bytes(params.placement, scene.shape()) + ground_workspace_bytes(params.ground, scene.shape()) +
         surface_attributes_workspace_bytes(params.material, scene.shape()) +
         kWorkspaceAlignment;
}

// Places the lamps, draws which are lit in every variant, and traces every ray that the variants share.
// `rays`: those of the mesh (scene_rays.hpp).
template <class Rays, class Executor, class Observer>
Status prepare_relighting(const RelightParams& params, std::uint64_t seed, int variants, const SceneView& scene,
                          const RefinedDepth& refined, const SceneMesh& mesh, const Rays& rays, Workspace& workspace,
                          Executor& executor, Observer& observer, Relighting& out) {
  if (variants < 1) return Status(StatusCode::invalid_argument, "at least one variant is needed");
  const std::size_t points = mesh.mesh.vertices.size();

  observer.begin(Stage::lights);
  NPSIM_RETURN_IF_ERROR(estimate_ground(params.ground, refined.depth, refined.labels, scene.camera, workspace, out.ground));
  out.sky = params.sky;
  out.sky.up = out.ground.up;
  Span<Emitter> emitters;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(scene.lights.size() + kEgoHeadlampCount, emitters));
  std::size_t count = 0;
  if (!scene.light_index.empty() && !scene.lights.empty()) {
    NPSIM_RETURN_IF_ERROR(place_lights(params.placement, scene.lights, scene.light_index, refined.depth, refined.labels,
                                       refined.uncertain, refined.normals, scene.camera, out.ground, workspace,
                                       emitters.sub(0, scene.lights.size()), count));
  }
  const std::size_t marked = count;
  if (params.ego_headlamps) {
    count += place_ego_headlamps(params.ego, out.ground, emitters.sub(count, kEgoHeadlampCount));
  }
  emitters = emitters.sub(0, count);

  Span<std::uint32_t> emitter_of_mark;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(scene.lights.size(), emitter_of_mark));
  for (std::uint32_t& e : emitter_of_mark) e = kNoPoint;
  for (std::size_t e = 0; e < marked; ++e) emitter_of_mark[emitters[e].mark - 1U] = static_cast<std::uint32_t>(e);

  Span<Activation> activations;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count * static_cast<std::size_t>(variants), activations));
  Span<float> peak_cd;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, peak_cd));
  Span<Vec3f> day_rgb;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, day_rgb));
  Span<float> mean_of_mark;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(scene.lights.size(), mean_of_mark));
  {
    WorkspaceScope scope(workspace);
    Span<float> pixel_count;
    NPSIM_RETURN_IF_ERROR(workspace.allocate(scene.lights.size(), pixel_count));
    relight_detail::mean_brightness(scene, mean_of_mark, pixel_count);
  }
  relight_detail::daytime_colours(scene, emitter_of_mark, day_rgb, peak_cd);
  for (float& peak : peak_cd) peak = 0;
  for (int v = 0; v < variants; ++v) {
    const Span<Activation> drawn = activations.sub(static_cast<std::size_t>(v) * count, count);
    NPSIM_RETURN_IF_ERROR(
        activate_lights(params.activation, seed, static_cast<std::uint32_t>(v), emitters, day_rgb, drawn));
    // What could be drawn, not what was: so a variant's bits do not depend on how many others there are. An emitter that
    // no variant lights contributes to none and needs no rays.
    for (std::size_t e = 0; e < count; ++e) {
      if (drawn[e].lit) peak_cd[e] = strongest_intensity_cd(params.activation, emitters[e]);
    }
  }
  observer.end(Stage::lights);

  observer.begin(Stage::material);
  Span<Vec3f> normal;
  Span<Vec3f> albedo;
  Span<float> alpha;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(points, normal));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(points, albedo));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(points, alpha));
  out.points = SurfacePoints{mesh.mesh.vertices, normal, albedo, alpha};
  NPSIM_RETURN_IF_ERROR(surface_attributes(params.material, scene, refined, mesh, SurfaceAttributes{normal, albedo, alpha},
                                           workspace, executor));
  Span<std::uint32_t> receivers;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(scene.shape().pixels(), receivers));
  std::size_t receiver_count = 0;
  for (int y = 0; y < scene.shape().height; ++y) {
    for (int x = 0; x < scene.shape().width; ++x) {
      if (mesh.visible_vertex(x, y) != kNoVertex) receivers[receiver_count++] = mesh.visible_vertex(x, y);
    }
  }
  receivers = receivers.sub(0, receiver_count);
  Span<std::uint16_t> face_mark;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(rays.face_count(), face_mark));
  NPSIM_RETURN_IF_ERROR(rays.mark(scene, emitters, face_mark, workspace));
  observer.end(Stage::material);

  observer.begin(Stage::render);
  Span<std::uint32_t> hits;
  Span<Vec3f> sky_irradiance;
  NPSIM_RETURN_IF_ERROR(
      workspace.allocate(receiver_count * static_cast<std::size_t>(params.gather.rays), hits));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(receiver_count, sky_irradiance));
  const auto point_of = [&rays](const Hit& hit) { return rays.point_of(hit); };
  NPSIM_RETURN_IF_ERROR(trace_gather_rays(params.gather, seed, rays.scene, point_of, out.points, receivers, out.sky,
                                          hits, sky_irradiance, executor, observer));
  // Light is asked for at the points that pixels show and those that their bounces reach.
  Span<std::uint8_t> wanted;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(points, wanted));
  for (std::uint8_t& w : wanted) w = 0;
  for (const std::uint32_t point : receivers) wanted[point] = 1;
  for (const std::uint32_t point : hits) {
    if (point != kNoPoint) wanted[point] = 1;
  }
  Span<std::uint8_t> visibility;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count * points, visibility));
  NPSIM_RETURN_IF_ERROR(compute_visibility(params.visibility, seed, rays.scene, out.points, wanted, emitters,
                                           peak_cd, face_mark, visibility, executor, observer));
  observer.end(Stage::render);

  out.visible_point = mesh.visible_vertex;
  out.emitters = emitters;
  out.activations = activations;
  out.emitter_of_mark = emitter_of_mark;
  out.mean_of_mark = mean_of_mark;
  out.visibility = visibility;
  out.receivers = receivers;
  out.hits = hits;
  out.sky_irradiance = sky_irradiance;
  out.variants = variants;
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_PREPARE_RELIGHTING_HPP
