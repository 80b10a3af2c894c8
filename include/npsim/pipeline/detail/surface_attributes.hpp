// SPDX-License-Identifier: Apache-2.0
// Normal, albedo and roughness at every vertex of the scene mesh, hidden ones included.
//
// A visible vertex takes what its pixel shows. Behind objects the same row-wise interpolation as for the geometry
// (Algorithm 1) continues normals and albedo from the background on both sides; roughness there is that of
// `hidden_alpha`. The back of an object has the paint of its front, and the normal of its own faces.
// Cost: two passes over the image. Memory: two images, four planes, and what the estimate of albedo takes.
#ifndef NPSIM_PIPELINE_DETAIL_SURFACE_ATTRIBUTES_HPP
#define NPSIM_PIPELINE_DETAIL_SURFACE_ATTRIBUTES_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/scene_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/window_filter.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/refine_depth_params.hpp"
#include "npsim/depth/things.hpp"
#include "npsim/material/albedo.hpp"
#include "npsim/material/retroreflection.hpp"
#include "npsim/material/roughness.hpp"
#include "npsim/mesh/complete.hpp"
#include "npsim/pipeline/reconstruct.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// What the estimate of albedo is made from. Where labels are a guess, cars and people are told from buildings; their
// labels and numbers lie in the workspace.
[[nodiscard]] inline Status albedo_scene(const SceneView& scene, const RefinedDepth& refined, Workspace& workspace,
                                         AlbedoScene& out) {
  out.image = scene.image;
  out.labels = refined.labels;
  out.instances = scene.instances;
  out.depth = refined.depth;
  out.normals = refined.normals;
  out.camera = scene.camera;
  out.ground = refined.ground;
  if (!refined.labels_guessed) return {};
  ImageView<Label> labels;
  ImageView<std::uint16_t> things;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(scene.shape(), labels));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(scene.shape(), things));
  copy_pixels(ImageView<const Label>(refined.labels), labels);
  NPSIM_RETURN_IF_ERROR(tell_things(refined.depth, scene.camera, refined.ground, labels, things, workspace));
  out.labels = labels;
  out.instances = things;
  return {};
}

// For albedo_scene() and estimate_albedo() with the sun's share.
[[nodiscard]] constexpr std::size_t guessed_albedo_workspace_bytes(const AlbedoParams& params, Shape shape) noexcept {
  const std::size_t estimate = allocation_bytes<float>(shape.pixels()) + estimate_albedo_workspace_bytes(params, shape);
  return allocation_bytes<Label>(shape.pixels()) + allocation_bytes<std::uint16_t>(shape.pixels()) +
         max_of(tell_things_workspace_bytes(shape), estimate);
}

// How material is guessed where the scene does not give it, and what no scene gives.
struct MaterialParams {
  AlbedoParams albedo;
  WetFilmParams film;
  RetroreflectionParams retroreflection;
  // A wide gloss where neither roughness nor normals are given and depth is not exact. Clear coat mirrors a lamp within
  // some degrees, which normals of a sensor's or a network's depth do not resolve, and a car's back or flank would
  // glare like chrome in the headlamps. Vehicles have it and what is labelled dynamic (prams, bins); of a scene without
  // labels, where albedo is guessed as well, the things that albedo_scene() tells from buildings.
  WideGloss wide_if_guessed{kVehicleLabels | LabelSet::of(label::dynamic_object)};
};

struct SurfaceAttributes {
  Span<Vec3f> normal;  // unit, facing the camera; of an object's back, away from the object
  Span<Vec3f> albedo;
  Span<float> alpha;
  Span<Retroreflector> retro;  // of what pixels show; nothing that is hidden has any
  Span<std::uint8_t> film;     // the same; empty: all is dry
};

inline constexpr float kHiddenAlpha = 0.8F;

// guessed: the scene gives no albedo.
[[nodiscard]] constexpr std::size_t surface_attributes_workspace_bytes(const MaterialParams& params, Shape shape,
                                                                       bool guessed) noexcept {
  const std::size_t estimate = guessed ? guessed_albedo_workspace_bytes(params.albedo, shape) : 0;
  return 2 * allocation_bytes<Vec3f>(shape.pixels()) + allocation_bytes<float>(shape.pixels()) +
         2 * allocation_bytes<std::uint8_t>(shape.pixels()) + allocation_bytes<Retroreflector>(shape.pixels()) +
         max_of(find_retroreflectors_workspace_bytes(shape), estimate) + kWorkspaceAlignment;
}

namespace attributes_detail {

// Mean normals, by area, of the faces around the vertices of the objects' backs.
inline void back_normals(const SceneMesh& mesh, Span<Vec3f> normal) {
  for (std::size_t v = mesh.sheet_vertices; v < mesh.mesh.vertices.size(); ++v) normal[v] = {};
  for (std::size_t f = mesh.sheet_faces; f < mesh.mesh.faces.size(); ++f) {
    const Face face = mesh.mesh.faces[f];
    const Vec3f a = mesh.mesh.vertices[face.a];
    const Vec3f n = cross(mesh.mesh.vertices[face.b] - a, mesh.mesh.vertices[face.c] - a);
    for (const std::uint32_t v : {face.a, face.b, face.c}) {
      if (v >= mesh.sheet_vertices) normal[v] += n;
    }
  }
  for (std::size_t v = mesh.sheet_vertices; v < mesh.mesh.vertices.size(); ++v) {
    const Vec3f n = normalized(normal[v]);
    normal[v] = n == Vec3f{} || !is_finite(n) ? normalized(mesh.mesh.vertices[v]) : n;
  }
}

// Of each pixel, as given or guessed.
template <class Executor, class Observer>
[[nodiscard]] Status albedo_and_gloss(const MaterialParams& params, const SceneView& scene, const RefinedDepth& refined,
                                      ImageView<Vec3f> albedo, ImageView<float> alpha, Workspace& workspace,
                                      Executor& executor, Observer& observer) {
  const auto share = [](float v) { return v > 0.0F ? (v < 1.0F ? v : 1.0F) : 0.0F; };  // a NaN becomes 0
  const bool normals_guessed = scene.normals.empty() && refined.source != DepthSource::exact;
  const WideGloss wide = normals_guessed ? params.wide_if_guessed : WideGloss{};
  const WorkspaceScope estimate(workspace);
  ImageView<const Label> labels = refined.labels;  // or those of things, which lie in that scope
  if (scene.albedo.empty()) {
    ImageView<float> sun;
    DaylightReport report;
    AlbedoScene day;
    NPSIM_RETURN_IF_ERROR(albedo_scene(scene, refined, workspace, day));
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(scene.shape(), sun));
    NPSIM_RETURN_IF_ERROR(
        estimate_albedo(params.albedo, day, workspace, AlbedoEstimate{albedo, sun}, report, executor));
    observer.daylight(albedo, sun, report);
    if (wide.labels.contains(label::dynamic_object)) labels = day.labels;  // else things glare less as buildings
  } else {
    for_pixels(scene.shape(), executor, [&](int x, int y) {
      const Vec3f a = scene.albedo(x, y);
      albedo(x, y) = {share(a.x), share(a.y), share(a.z)};
    });
  }
  if (scene.roughness.empty()) return estimate_roughness(labels, wide, alpha, executor);
  for_pixels(scene.shape(), executor,
             [&](int x, int y) { alpha(x, y) = alpha_of_roughness(share(scene.roughness(x, y))); });
  return {};
}

}  // namespace attributes_detail

template <class Executor, class Observer>
Status surface_attributes(const MaterialParams& params, const SceneView& scene, const RefinedDepth& refined,
                          const SceneMesh& mesh, const SurfaceAttributes& out, Workspace& workspace, Executor& executor,
                          Observer& observer) {
  const Shape shape = scene.shape();
  WorkspaceScope scope(workspace);
  ImageView<Vec3f> albedo;
  ImageView<Vec3f> normal;
  ImageView<float> alpha;
  ImageView<std::uint8_t> known;
  ImageView<Retroreflector> retro;
  ImageView<std::uint8_t> film;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, albedo));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, normal));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, alpha));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, known));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, retro));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, film));
  NPSIM_RETURN_IF_ERROR(
      attributes_detail::albedo_and_gloss(params, scene, refined, albedo, alpha, workspace, executor, observer));
  const ReflectorScene reflecting{scene.labels,  scene.reflectors, albedo,
                                  refined.depth, scene.camera,     refined.ground.camera_height_m};
  NPSIM_RETURN_IF_ERROR(
      find_retroreflectors(params.retroreflection, params.film.wetness, reflecting, retro, workspace, executor));
  NPSIM_RETURN_IF_ERROR(apply_wet_film(params.film, scene.labels, albedo, alpha, film, executor));
  copy_pixels(refined.normals, normal);

  const auto width = static_cast<std::uint32_t>(shape.width);
  const auto copy = [&](std::size_t first, std::size_t last, bool hidden_too) {
    for (std::size_t v = first; v < last; ++v) {
      const auto x = static_cast<int>(mesh.vertex_pixel[v] % width);
      const auto y = static_cast<int>(mesh.vertex_pixel[v] / width);
      const Vec3f n = normalized(normal(x, y));
      const Vec3f view = normalized(mesh.mesh.vertices[v]);
      // A normal that does not face the camera (noise, a grazing plane) would make a lit surface black.
      const float facing = dot(n, view);
      out.normal[v] = n == Vec3f{} ? -view : (facing < 0.0F ? n : normalized(n - view * (facing + 0.01F)));
      out.albedo[v] = albedo(x, y);
      const bool hidden = hidden_too && known(x, y) == row_state::missing;
      out.alpha[v] = hidden ? kHiddenAlpha : alpha(x, y);
      if (!out.film.empty()) out.film[v] = hidden ? std::uint8_t{0} : film(x, y);
      out.retro[v] = mesh.visible_vertex(x, y) == v ? retro(x, y) : Retroreflector{};
    }
  };
  copy(mesh.background_vertices, mesh.mesh.vertices.size(), false);
  attributes_detail::back_normals(mesh, out.normal);
  // Known is what the camera sees of the background, the completed uncertain pixels beside objects included.
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const bool seen = mesh.visible_vertex(x, y) < mesh.background_vertices;
      known(x, y) = seen
                        ? row_state::known
                        : (mesh.background_state(x, y) == row_state::blocked ? row_state::blocked : row_state::missing);
    }
  }
  NPSIM_RETURN_IF_ERROR(interpolate_rows(known, albedo, executor));
  NPSIM_RETURN_IF_ERROR(interpolate_rows(known, normal, executor));
  copy(0, mesh.background_vertices, true);
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_SURFACE_ATTRIBUTES_HPP
