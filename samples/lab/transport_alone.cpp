// SPDX-License-Identifier: Apache-2.0
#include "transport_alone.hpp"

#include <vector>

#include "npsim/io/memory.hpp"
#include "reference/path_tracer.hpp"
#include "tool/engine.hpp"

namespace npsim::tool {
namespace {

// Traces the renderer's own scene when it is there, and keeps the renderer's night of it.
class Comparison {
 public:
  Comparison(const NightParams& params, const SceneView& scene, std::uint64_t samples, AnyExecutor executor,
             io::Image<Vec3f>& own, io::Image<Vec3f>& converged)
      : params_(params), scene_(scene), samples_(samples), executor_(executor), own_(own), converged_(converged) {}

  Status reconstructed(const RefinedDepth&, const SceneMesh& mesh, const Relighting& light) {
    std::vector<std::uint16_t> mark(mesh.mesh.faces.size());
    std::vector<unsigned char> memory(
        mark_faces_workspace_bytes(scene_.shape(), scene_.lights.size(), light.emitters.size()));
    Workspace workspace(memory.data(), memory.size());
    NPSIM_RETURN_IF_ERROR(
        mark_faces(scene_, mesh, light.emitters, Span<std::uint16_t>(mark.data(), mark.size()), workspace));
    const reference::NightScene night =
        reference::scene_of_points(mesh.mesh, light.points.normal, light.points.albedo, light.points.alpha,
                                   Span<const std::uint16_t>(mark.data(), mark.size()), light.emitters,
                                   light.of_variant(0), light.sky, params_.relight.f0);
    const reference::TriangleTree tree(night.mesh());
    std::vector<reference::ViewedPoint> seen = reference::viewed_points(night, tree, scene_.camera, scene_.shape());
    std::size_t pixel = 0;
    for (int y = 0; y < scene_.shape().height; ++y) {
      for (int x = 0; x < scene_.shape().width; ++x, ++pixel) {
        const std::uint32_t point = light.visible_point(x, y);
        if (point != kNoPoint) seen[pixel].at.retro = light.points.retro[point];
      }
    }
    reference::PathParams path;
    path.seed = params_.seed;
    path.bounces = params_.relight.bounces;
    const std::vector<reference::PixelSums> sums = reference::trace_night(path, night, tree, seen, samples_, executor_);
    converged_ = io::Image<Vec3f>(scene_.shape());
    std::size_t p = 0;
    for (Vec3f& light_of_pixel : converged_.view().pixels()) {
      light_of_pixel = vec_cast<float>(sums[p++].light / static_cast<double>(samples_));
    }
    return {};
  }
  Status night(const Night& night) {
    own_ = io::Image<Vec3f>(night.luminance.shape());
    copy_pixels(night.luminance, own_.view());
    return {};
  }

 private:
  const NightParams& params_;
  const SceneView& scene_;
  std::uint64_t samples_;
  AnyExecutor executor_;
  io::Image<Vec3f>& own_;
  io::Image<Vec3f>& converged_;
};

}  // namespace

Status transport_alone(const NightParams& params, const SceneView& scene, const RefinedDepth& refined,
                       std::uint64_t samples, AnyExecutor executor, AnyObserver observer, io::Image<Vec3f>& own,
                       io::Image<Vec3f>& converged) {
  io::HostMemory memory(night_workspace_bytes(params, scene.shape(), scene.lights.size()));
  Workspace workspace = memory.workspace();
  Comparison sink(params, scene, samples, executor, own, converged);
  return engine::make_nights_of_depth(params, scene, refined, workspace, executor, observer, sink);
}

}  // namespace npsim::tool
