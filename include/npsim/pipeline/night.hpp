// SPDX-License-Identifier: Apache-2.0
// The whole method: one day in, `variants` nights out.
//
//   refine_depth (3.2 - 3.9) -> reconstruct (3.1, 3.5) -> prepare_relighting (3.6) -> per variant: relight -> photograph
// The sink receives what is made while it is still in the workspace:
//   Status sink.reconstructed(const RefinedDepth&, const SceneMesh&, const Relighting&)   once
//   Status sink.night(const Night&)                                                     per variant
// A status other than ok from the sink stops the run and is returned.
// Invariant: the bytes depend on the scene, the parameters and the seed, never on the executor.
#ifndef NPSIM_PIPELINE_NIGHT_HPP
#define NPSIM_PIPELINE_NIGHT_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/observe.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/pipeline/detail/prepare_relighting.hpp"
#include "npsim/pipeline/detail/scene_rays.hpp"
#include "npsim/pipeline/photograph.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/pipeline/refine_depth.hpp"
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
};

// One key of seed and photograph; different pairs give different keys with overwhelming probability.
[[nodiscard]] constexpr std::uint64_t random_key(const NightParams& params) noexcept {
  const auto low = [](std::uint64_t v) { return static_cast<std::uint32_t>(v); };
  const auto high = [](std::uint64_t v) { return static_cast<std::uint32_t>(v >> 32U); };
  const auto block = philox4x32({low(params.seed), high(params.seed), low(params.photograph), high(params.photograph)},
                                {0x4E505369U, 0x6D000001U});
  return (std::uint64_t{block[0]} << 32U) | block[1];
}

// What measured better than the text, see docs/guide.md.
[[nodiscard]] inline NightParams default_night_params() noexcept { return {}; }

// The thesis' settings, as literally as a reading allows.
[[nodiscard]] inline NightParams thesis_night_params() noexcept {
  NightParams params;
  params.depth = RefineDepthParams::thesis();
  params.mesh = ReconstructParams::thesis();
  params.camera = PhotographParams::thesis();
  return params;
}

struct Night {
  int variant = 0;
  ImageView<const Vec3f> luminance;  // linear sRGB, luminance(rgb) in cd/m2, before the camera
  ImageView<const Rgb8> picture;
  CameraExposure exposure;
  Span<const Emitter> emitters;
  Span<const Activation> activations;
};

[[nodiscard]] inline std::size_t night_workspace_bytes(const NightParams& params, const SceneView& scene) noexcept {
  const Shape shape = scene.shape();
  return refine_depth_workspace_bytes(params.depth, shape) + reconstruct_workspace_bytes(params.mesh, shape) +
         scene_rays_workspace_bytes(params.mesh.traced, shape) + relight_workspace_bytes(params.relight, scene, params.variants) +
         photograph_workspace_bytes(params.camera, shape) + allocation_bytes<Vec3f>(shape.pixels()) +
         allocation_bytes<Rgb8>(shape.pixels()) + kWorkspaceAlignment;
}

template <class Executor, class Observer, class Sink>
Status make_nights(const NightParams& params, const SceneView& scene, Workspace& workspace, Executor& executor,
                   Observer& observer, Sink& sink) {
  NPSIM_RETURN_IF_ERROR(validate(scene));
  NPSIM_RETURN_IF_ERROR(validate(params.relight));
  const std::uint64_t key = random_key(params);
  RefinedDepth refined;
  NPSIM_RETURN_IF_ERROR(refine_depth(params.depth, scene, workspace, executor, observer, refined));
  SceneMesh mesh;
  NPSIM_RETURN_IF_ERROR(reconstruct(params.mesh, scene, refined, workspace, executor, observer, mesh));

  Relighting light;
  const auto prepare = [&](auto rays) {
    observer.begin(Stage::build_trace);
    NPSIM_RETURN_IF_ERROR(rays.make(scene, mesh, workspace, executor, rays));
    observer.end(Stage::build_trace);
    return prepare_relighting(params.relight, key, params.variants, scene, refined, mesh, rays, workspace, executor,
                              observer, light);
  };
  NPSIM_RETURN_IF_ERROR(params.mesh.traced == TracedFaces::mesh ? prepare(MeshRays{}) : prepare(LayerRays{}));
  NPSIM_RETURN_IF_ERROR(sink.reconstructed(refined, mesh, light));

  Night night;
  ImageView<Vec3f> linear;
  ImageView<Rgb8> picture;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(scene.shape(), linear));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(scene.shape(), picture));
  for (int variant = 0; variant < params.variants; ++variant) {
    NPSIM_RETURN_IF_ERROR(relight(params.relight, scene, light, variant, linear, workspace, executor, observer));
    observer.begin(Stage::camera);
    NPSIM_RETURN_IF_ERROR(photograph(params.camera, key, static_cast<std::uint32_t>(variant), linear, picture,
                                     night.exposure, workspace, executor));
    observer.end(Stage::camera);
    night.variant = variant;
    night.luminance = linear;
    night.picture = picture;
    night.emitters = light.emitters;
    night.activations = light.activations.sub(static_cast<std::size_t>(variant) * light.emitters.size(),
                                              light.emitters.size());
    NPSIM_RETURN_IF_ERROR(sink.night(night));
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_NIGHT_HPP
