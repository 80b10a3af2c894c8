// SPDX-License-Identifier: Apache-2.0
#include "mesh_steps.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/depth/refine_depth_params.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/memory.hpp"
#include "npsim/mesh/check.hpp"
#include "npsim/mesh/complete.hpp"
#include "npsim/mesh/index.hpp"
#include "npsim/mesh/prune.hpp"
#include "npsim/mesh/sheet.hpp"
#include "npsim/mesh/simplify.hpp"
#include "npsim/pipeline/reconstruct.hpp"

namespace npsim::tool {
namespace {

// Where a layer is simplified to; the buffers hold the layer as it is.
struct ThinLayer {
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  std::vector<std::uint32_t> pixels;
  SimplifyResult result;

  explicit ThinLayer(MeshSize size) : vertices(size.vertices), faces(size.faces), pixels(size.vertices) {}
  [[nodiscard]] MeshBuffers buffers() {
    return {{vertices.data(), vertices.size()}, {faces.data(), faces.size()}, {pixels.data(), pixels.size()}};
  }
  [[nodiscard]] std::size_t bytes() const {
    return vertices.size() * sizeof(Vec3f) + faces.size() * sizeof(Face) + pixels.size() * sizeof(std::uint32_t);
  }

  [[nodiscard]] SimplificationErrors errors(const Intrinsics& camera, int width) const {
    SimplificationErrors e;
    e.faces_before = result.full.faces;
    e.faces_after = result.size.faces;
    e.max_relative_depth = static_cast<double>(result.depth.max_relative);
    e.rms_relative_depth = static_cast<double>(result.depth.rms_relative);
    double sum = 0;
    for (std::size_t v = 0; v < result.size.vertices; ++v) {
      const Vec2f at = project(camera, vertices[v]);
      const auto pixel = static_cast<int>(pixels[v]);
      const double dx = static_cast<double>(at.x) - (pixel % width + 0.5);
      const double dy = static_cast<double>(at.y) - (pixel / width + 0.5);
      const double off = std::hypot(dx, dy);
      e.max_px = std::max(e.max_px, off);
      sum += off * off;
    }
    if (result.size.vertices > 0) e.rms_px = std::sqrt(sum / static_cast<double>(result.size.vertices));
    return e;
  }
};

}  // namespace

Status measure_mesh_steps(const ReconstructParams& params, const SceneView& scene, const RefinedDepth& refined,
                          ThreadPool& pool, MeshSteps& out) {
  const Shape shape = scene.shape();
  io::Image<Vec3f> vertices(shape);
  io::Image<std::uint8_t> quads(quad_shape(shape));
  io::Image<Vec3f> front_vertices(shape);
  io::Image<std::uint8_t> front_quads(quad_shape(shape));
  io::Image<std::uint8_t> open_quads(quad_shape(shape));
  io::Image<std::uint8_t> state(shape);
  io::Image<std::uint32_t> object(shape);
  const SheetLayer background{vertices.view(), quads.view()};  // the sheet at first: it is completed in place
  const SheetLayer foreground{front_vertices.view(), front_quads.view()};
  const std::size_t layer_bytes = shape.pixels() * sizeof(Vec3f) + quad_shape(shape).pixels();
  const std::size_t bytes =
      std::max({complete_background_workspace_bytes(params.background, shape),
                complete_foreground_workspace_bytes(params.foreground, shape), index_layer_workspace_bytes(shape),
                simplify_layer_workspace_bytes(params.simplify, shape), check_foreground_workspace_bytes(shape)});
  io::HostMemory memory(bytes);
  const auto timed = [&](const char* name, std::size_t output_bytes, const auto& step) -> Status {
    using Clock = std::chrono::steady_clock;
    Workspace workspace = memory.workspace(bytes);
    const Clock::time_point begin = Clock::now();
    NPSIM_RETURN_IF_ERROR(step(workspace));
    const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
    out.costs.push_back({name, seconds, output_bytes, workspace.peak()});
    return {};
  };

  io::HostMemory doubt_memory(doubt_workspace_bytes(params, shape));
  Workspace doubt_workspace = doubt_memory.workspace(doubt_workspace_bytes(params, shape));
  ImageView<const std::uint8_t> doubt;
  NPSIM_RETURN_IF_ERROR(timed("outlines", params.outline_px == 0 ? 0 : shape.pixels(),
                              [&](Workspace&) { return find_doubt(params, refined, doubt_workspace, pool, doubt); }));
  NPSIM_RETURN_IF_ERROR(timed("sheet", layer_bytes, [&](Workspace&) {
    return build_sheet(params.sheet, refined.surface_depth(), refined.surface, scene.camera, background, pool);
  }));
  NPSIM_RETURN_IF_ERROR(timed("prune", quad_shape(shape).pixels(), [&](Workspace&) {
    return prune(params.prune, doubt, refined.labels, background, pool);
  }));
  NPSIM_RETURN_IF_ERROR(timed("complete_background", layer_bytes + shape.pixels(), [&](Workspace& workspace) {
    return complete_background(params.background,
                               {background.vertices, refined.labels, doubt, refined.surface, scene.camera}, background,
                               state.view(), workspace, pool);
  }));
  NPSIM_RETURN_IF_ERROR(
      timed("complete_objects", layer_bytes + shape.pixels() * sizeof(std::uint32_t), [&](Workspace& workspace) {
        return complete_foreground(params.foreground,
                                   {params.sheet, refined.surface_depth(), refined.surface, refined.labels,
                                    scene.instances, doubt, state.view(), scene.camera},
                                   foreground, object.view(), workspace, pool);
      }));
  NPSIM_RETURN_IF_ERROR(timed("open_steps", quad_shape(shape).pixels(), [&](Workspace&) {
    return open_steps(params.open_steps, background, open_quads.view(), pool);
  }));
  {
    Workspace workspace = memory.workspace(bytes);
    NPSIM_RETURN_IF_ERROR(check_background(background, state.view(), out.background));
    NPSIM_RETURN_IF_ERROR(check_foreground(foreground, object.view(), workspace, out.foreground));
  }

  ThinLayer behind(mesh_size(background));
  ThinLayer front(mesh_size(foreground));
  const Status indexed = timed("index", behind.bytes() + front.bytes(), [&](Workspace& workspace) -> Status {
    MeshSize size;
    NPSIM_RETURN_IF_ERROR(index_layer(background, 0, behind.buffers(), size, workspace, pool));
    return index_layer(foreground, 0, front.buffers(), size, workspace, pool);
  });
  NPSIM_RETURN_IF_ERROR(indexed);
  io::Image<std::uint32_t> ids(shape);
  label_and_lamp(refined.labels, scene.light_index, ids.view());
  const auto simplify = [&](const SheetLayer& layer, ThinLayer& thin) {
    return [&](Workspace& workspace) {
      return simplify_layer(params.simplify, layer, ids.view(), scene.camera, 0, thin.buffers(), thin.result, workspace,
                            pool);
    };
  };
  NPSIM_RETURN_IF_ERROR(timed("simplify_background", behind.bytes(), simplify(background, behind)));
  NPSIM_RETURN_IF_ERROR(timed("simplify_objects", front.bytes(), simplify(foreground, front)));
  out.simplified_background = behind.errors(scene.camera, shape.width);
  out.simplified_objects = front.errors(scene.camera, shape.width);
  return {};
}

}  // namespace npsim::tool
