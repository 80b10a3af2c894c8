// SPDX-License-Identifier: Apache-2.0
// Section 3.6: one night of the reconstructed scene, from what all nights share (prepare_relighting.hpp).
//
// A variant adds up its lit emitters, gathers `bounces` times and looks. Light is linear, so nothing is lost by the
// split; forty variants cost little more than one.
// Memory (workspace): see relight_workspace_bytes().
#ifndef NPSIM_PIPELINE_RELIGHT_HPP
#define NPSIM_PIPELINE_RELIGHT_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/observe.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/light/activation.hpp"
#include "npsim/light/sky.hpp"
#include "npsim/pipeline/detail/prepare_relighting.hpp"
#include "npsim/pipeline/detail/source_pixels.hpp"
#include "npsim/render/denoise.hpp"
#include "npsim/render/direct.hpp"
#include "npsim/render/gather.hpp"
#include "npsim/render/surface_points.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr float kInversePi = 0.31830989F;

// One variant's linear image: luminance(rgb) is in cd/m2.
template <class Executor, class Observer>
Status relight(const RelightParams& params, const SceneView& scene, const Relighting& shared, int variant,
               ImageView<Vec3f> out, Workspace& workspace, Executor& executor, Observer& observer) {
  const Shape shape = scene.shape();
  if (variant < 0 || variant >= shared.variants) {
    return Status(StatusCode::invalid_argument, "the variant was not prepared");
  }
  if (out.shape() != shape) return Status(StatusCode::shape_mismatch, "the night image must have the scene's size");
  WorkspaceScope scope(workspace);
  const std::size_t points = shared.points.size();
  const std::size_t count = shared.emitters.size();
  const Span<const Activation> lit = shared.activations.sub(static_cast<std::size_t>(variant) * count, count);

  observer.begin(Stage::render);
  Span<Vec3f> illuminance;
  Span<Vec3f> direct;
  Span<Vec3f> indirect;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(points, illuminance));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(points, direct));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(shared.receivers.size(), indirect));
  NPSIM_RETURN_IF_ERROR(direct_light(shared.points, shared.emitters, lit, shared.visibility, params.f0, illuminance,
                                     direct, executor));
  // Gathering direct light plus what k bounces brought to the points that pixels show gives k + 1 bounces.
  Span<Vec3f> handed_on;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(points, handed_on));
  for (std::size_t p = 0; p < points; ++p) handed_on[p] = illuminance[p];
  for (int bounce = 1;; ++bounce) {
    NPSIM_RETURN_IF_ERROR(
        gather_irradiance(shared.points, handed_on, shared.hits, params.gather.rays, indirect, executor));
    for (std::size_t r = 0; r < indirect.size(); ++r) indirect[r] += shared.sky_irradiance[r];
    if (bounce >= params.bounces) break;
    for (std::size_t r = 0; r < indirect.size(); ++r) {
      handed_on[shared.receivers[r]] = illuminance[shared.receivers[r]] + indirect[r];
    }
  }
  observer.end(Stage::render);

  observer.begin(Stage::denoise);
  ImageView<Vec3f> position;
  ImageView<Vec3f> normal;
  ImageView<Vec3f> irradiance;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, position));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, normal));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, irradiance));
  std::size_t receiver = 0;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const std::uint32_t point = shared.visible_point(x, y);
      position(x, y) = normal(x, y) = irradiance(x, y) = Vec3f{};
      if (point == kNoPoint) continue;
      position(x, y) = shared.points.position[point];
      normal(x, y) = shared.points.normal[point];
      irradiance(x, y) = indirect[receiver++];
    }
  }
  NPSIM_RETURN_IF_ERROR(denoise_irradiance(params.denoise, position, normal, irradiance, workspace, executor));
  observer.end(Stage::denoise);

  executor.for_chunks(static_cast<std::size_t>(shape.height), 8, [&](std::size_t begin, std::size_t end) {
    for (auto y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const std::uint32_t point = shared.visible_point(x, y);
        Vec3f seen;
        if (point != kNoPoint) {
          seen = direct[point] + shared.points.albedo[point] * irradiance(x, y) * kInversePi;
        } else {
          // No surface: the sky above the horizon; what belongs to the camera's own car stays black.
          const bool sky = scene.labels.empty() || scene.labels(x, y) == label::sky;
          const Vec3f direction = normalized(unproject_pixel(scene.camera, x, y, 1.0F));
          if (sky) seen = sky_luminance(shared.sky, raised_to_horizon(shared.sky, direction));
        }
        const std::uint16_t mark = scene.light_index.empty() ? std::uint16_t{0} : scene.light_index(x, y);
        const std::uint32_t emitter = mark == 0 ? kNoPoint : shared.emitter_of_mark[mark - 1U];
        if (emitter != kNoPoint && lit[emitter].lit) {
          seen += lit[emitter].luminance_cd_m2 * relight_detail::texture(scene, shared.mean_of_mark[mark - 1U], x, y);
        }
        out(x, y) = seen;
      }
    }
  });
  relight_detail::continue_over_frame(scene.labels, out);
  return observer.cancelled() ? Status(StatusCode::cancelled, "cancelled while relighting") : Status();
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_RELIGHT_HPP
