// SPDX-License-Identifier: Apache-2.0
// The whole method: one day in, `variants` nights out.
//
//   refine_depth (3.2 - 3.9) -> build_layers, build_mesh (3.1, 3.5) -> prepare_relighting (3.6)
//     -> per variant: relight -> photograph
// make_night() is all of it in one call. make_nights() tells an observer (core/observe.hpp) how far it is, and hands a
// sink what is made while it is still in the workspace:
//   Status sink.reconstructed(const RefinedDepth&, const SceneMesh&, const Relighting&)   once
//   Status sink.night(const Night&)                                                     per variant
// What a sink is shown holds for the length of the call: nights are made in the memory of normals, each in that of the
// one before.
// A status other than ok from the sink stops the run and is returned. All parameters are checked before the first step.
// Invariant: the bytes depend on the scene, the parameters and the seed, never on the executor.
// Memory: peak 325 to 345 bytes a pixel on real streets, and 1 to 4 for each lamp's and group's image, for which the
// workspace is asked step by step; night_workspace_bytes() bounds it for every scene.
#ifndef NPSIM_PIPELINE_NIGHT_HPP
#define NPSIM_PIPELINE_NIGHT_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "npsim/core/observe.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/refine_depth.hpp"
#include "npsim/pipeline/photograph.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/pipeline/relight.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct NightParams {
  RefineDepthParams depth;
  ReconstructParams mesh;
  RelightParams relight;
  PhotographParams camera;
  std::uint64_t seed = 0;
  std::uint64_t photograph = 0;  // another number for every photograph of a data set: no two share a random draw
  int variants = 1;
  bool raw = false;  // also show the sink what the sensor read
};

// One key of seed and photograph; different pairs give different keys with overwhelming probability.
[[nodiscard]] constexpr std::uint64_t random_key(const NightParams& params) noexcept {
  const auto low = [](std::uint64_t v) { return static_cast<std::uint32_t>(v); };
  const auto high = [](std::uint64_t v) { return static_cast<std::uint32_t>(v >> 32U); };
  const auto block = philox4x32({low(params.seed), high(params.seed), low(params.photograph), high(params.photograph)},
                                {0x4E505369U, 0x6D000001U});
  return (std::uint64_t{block[0]} << 32U) | block[1];
}

// What measured better than the text, see docs/evaluation.md.
[[nodiscard]] inline NightParams default_night_params() noexcept { return {}; }

// The thesis' settings, as literally as a reading allows.
[[nodiscard]] inline NightParams thesis_night_params() noexcept {
  NightParams params;
  params.depth = RefineDepthParams::thesis();
  params.mesh = ReconstructParams::thesis();
  params.camera = PhotographParams::thesis();
  // Light comes from what the picture shows, and from the sky.
  params.relight.unseen.share = 0.0F;
  params.relight.rows.behind_m = 0.0F;
  params.relight.ego_headlamps = false;
  params.relight.activation.by_text_alone = true;
  params.relight.activation.stop_probability = 0.0F;
  params.relight.denoise.iterations = 0;
  params.relight.unsure_light.reach = 0;
  params.relight.material.wide_if_guessed = {};
  params.relight.veils = VeilParams::none();
  params.relight.bodies = LabelSet();
  return params;
}

struct Night {
  int variant = 0;
  ImageView<const Vec3f> luminance;  // linear sRGB, luminance(rgb) in cd/m2, before the camera
  ImageView<const Rgb8> picture;
  RawPicture raw;  // empty unless NightParams asks for it
  CameraExposure exposure;
  std::uint64_t key = 0;      // of the camera's draws, with the variant
  PhotographedStreet street;  // what the camera saw move
  Span<const Emitter> emitters;
  Span<const Activation> activations;
};

// Enough for every scene of that shape with at most so many marked lamps, so that static memory can be sized. Far more
// than most scenes take: make_nights() asks the workspace for what it needs once it knows the mesh
// (Workspace::ensure()).
[[nodiscard]] constexpr std::size_t night_workspace_bytes(const NightParams& params, Shape shape,
                                                          std::size_t marks) noexcept {
  const std::size_t pixels = shape.pixels();
  const SceneMeshSize most = SceneMeshSize::most(shape);
  // The backs of objects that fill the image; see SceneMeshSize::most().
  const RelightSize light{marks,
                          params.variants,
                          most.vertices(),
                          pixels,
                          most.faces(),
                          2 * most.backs.faces,
                          true,
                          0,
                          pixels,
                          most_unseen_lamps(params.relight.rows, marks),
                          params.relight.unsure_light.reach > 0.0F,
                          params.relight.unsure_light.reach > 0.0F};
  const std::size_t mesh = mesh_workspace_bytes(params.mesh, shape, most);
  const std::size_t nights = allocation_bytes<Rgb8>(pixels) + allocation_bytes<std::uint16_t>(params.raw ? pixels : 0) +
                             light_images_bytes(params.relight, shape, marks) +
                             std::max(relight_workspace_bytes(params.relight, params.mesh.traced, shape, light),
                                      photograph_workspace_bytes(params.camera, shape, marks));
  return refine_depth_workspace_bytes(params.depth, shape) + layers_workspace_bytes(params.mesh, shape) + mesh + nights;
}

[[nodiscard]] inline Status validate(const NightParams& params) noexcept {
  if (params.variants < 1) return {StatusCode::invalid_argument, "at least one variant is needed"};
  NPSIM_RETURN_IF_ERROR(validate(params.depth));
  NPSIM_RETURN_IF_ERROR(validate(params.mesh));
  NPSIM_RETURN_IF_ERROR(validate(params.relight));
  if (params.raw && (params.camera.ideal_sensor || params.camera.sensor.exposures != 1)) {
    return {StatusCode::invalid_argument, "raw pictures need a camera with filters and one exposure"};
  }
  return validate(params.camera);
}

// A sink that wants nothing; others derive from it or have functions of the same names.
struct NullSink {
  Status reconstructed(const RefinedDepth&, const SceneMesh&, const Relighting&) const noexcept { return {}; }
  Status night(const Night&) const noexcept { return {}; }
};

// Nights of a depth that is known well enough, or refined by others. refined: whole, with planes of the scene's shape;
// its normals serve as memory for the nights and are lost.
template <class Executor, class Observer, class Sink>
Status make_nights_of_depth(const NightParams& params, const SceneView& given, const RefinedDepth& refined,
                            Workspace& workspace, Executor& executor, Observer& observer, Sink& sink) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(given));
  const Shape shape = given.shape();
  if (refined.depth.shape() != shape || refined.labels.shape() != shape || refined.surface.shape() != shape ||
      refined.uncertain.shape() != shape || refined.normals.shape() != shape) {
    return {StatusCode::shape_mismatch, "refined depth: every plane must have the scene's shape"};
  }
  SceneView scene = given;
  scene.labels = refined.labels;
  const WorkspaceScope scope(workspace);
  const std::uint64_t key = random_key(params);
  SceneLayers layers;
  NPSIM_RETURN_IF_ERROR(build_layers(params.mesh, scene, refined, workspace, executor, observer, layers));
  SceneMesh mesh;
  NPSIM_RETURN_IF_ERROR(build_mesh(params.mesh, scene, refined, layers, workspace, executor, observer, mesh));
  Relighting light;
  NPSIM_RETURN_IF_ERROR(prepare_relighting(params.relight, params.mesh.traced, key, params.variants, scene, refined,
                                           mesh, workspace, executor, observer, light));
  NPSIM_RETURN_IF_ERROR(sink.reconstructed(refined, mesh, light));

  const ImageView<Vec3f> linear = refined.normals;  // they have served; nights are made in their memory
  NPSIM_RETURN_IF_ERROR(
      workspace.ensure(kWorkspaceAlignment + allocation_bytes<Rgb8>(shape.pixels()) +
                       std::max(variant_workspace_bytes(shape, light.emitters.size()),
                                photograph_workspace_bytes(params.camera, shape, scene.lights.size()))));
  ImageView<Rgb8> picture;
  RawPicture raw;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, picture));
  if (params.raw) NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, raw.levels));
  const PhotographedStreet street{refined.depth, refined.labels, scene.instances, scene.light_index, scene.lights};
  for (int variant = 0; variant < params.variants; ++variant) {
    NPSIM_RETURN_IF_ERROR(relight(params.relight, scene, light, variant, linear, workspace, executor, observer));
    Night night;
    observer.begin(Stage::camera);
    NPSIM_RETURN_IF_ERROR(photograph(params.camera, scene.camera, key, static_cast<std::uint32_t>(variant), linear,
                                     picture, night.exposure, workspace, executor, street, &raw));
    observer.end(Stage::camera);
    night.variant = variant;
    night.luminance = linear;
    night.picture = picture;
    night.raw = raw;
    night.key = key;
    night.street = street;
    night.emitters = light.emitters;
    night.activations = light.of_variant(variant);
    NPSIM_RETURN_IF_ERROR(sink.night(night));
  }
  return {};
}

template <class Executor, class Observer, class Sink>
Status make_nights(const NightParams& params, const SceneView& scene, Workspace& workspace, Executor& executor,
                   Observer& observer, Sink& sink) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(scene));
  NPSIM_RETURN_IF_ERROR(validate(params.depth, scene));
  const WorkspaceScope scope(workspace);
  RefinedDepth refined;
  NPSIM_RETURN_IF_ERROR(refine_depth(params.depth, scene, workspace, executor, observer, refined));
  return make_nights_of_depth(params, scene, refined, workspace, executor, observer, sink);
}

// One night, as a picture of the scene's size: the first of those that make_nights() makes with these parameters.
template <class Executor>
Status make_night(const NightParams& params, const SceneView& scene, Workspace& workspace, Executor& executor,
                  ImageView<Rgb8> picture) {
  struct Copy : NullSink {
    ImageView<Rgb8> picture;
    Status night(const Night& night) const noexcept {
      copy_pixels(night.picture, picture);
      return {};
    }
  };
  if (picture.shape() != scene.shape()) {
    return {StatusCode::shape_mismatch, "the picture of a night must have the scene's size"};
  }
  NightParams one = params;
  one.variants = 1;
  Copy sink;
  sink.picture = picture;
  NullObserver observer;
  return make_nights(one, scene, workspace, executor, observer, sink);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_NIGHT_HPP
