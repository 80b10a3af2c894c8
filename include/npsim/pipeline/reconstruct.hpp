// SPDX-License-Identifier: Apache-2.0
// Sections 3.3 and 3.5: from refined depth to the layered scene mesh.
//
// sheet (3.1) -> delete spurious faces -> complete the background behind objects -> complete the objects -> one indexed
// mesh, background first. Each pixel then knows the vertex that the camera sees: the object's where there is one, else
// the background's; a pixel whose vertex got no face borrows the nearest one of its row.
// Memory: see reconstruct_workspace_bytes(); the mesh stays in the workspace.
#ifndef NPSIM_PIPELINE_RECONSTRUCT_HPP
#define NPSIM_PIPELINE_RECONSTRUCT_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/observe.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/triangle_mesh.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/mesh/complete_background.hpp"
#include "npsim/mesh/complete_foreground.hpp"
#include "npsim/mesh/index.hpp"
#include "npsim/mesh/prune.hpp"
#include "npsim/mesh/sheet.hpp"
#include "npsim/pipeline/refine_depth.hpp"
#include "npsim/pipeline/scene_view.hpp"

namespace npsim {
inline namespace v1 {

inline constexpr std::uint32_t kNoVertex = 0xFFFFFFFFU;

struct ReconstructParams {
  SheetParams sheet;
  PruneParams prune;
  BackgroundParams background;
  ForegroundParams foreground;
};

// The scene as geometry; views over the workspace.
struct SceneMesh {
  TriangleMeshView mesh;                 // background's vertices and faces first
  Span<const std::uint32_t> vertex_pixel;  // y * width + x of each vertex
  std::size_t background_vertices = 0;
  std::size_t background_faces = 0;
  ImageView<const std::uint32_t> visible_vertex;  // per pixel, kNoVertex where no surface is seen
  ImageView<const std::uint8_t> background_state;  // row_state of each pixel in the background
  ImageView<const std::uint32_t> object;           // 0 = background, else the number of the object
};

// A vertex belongs to at most three fans of faces per quad, hence three copies of a pixel and layer at the very worst.
inline constexpr std::size_t kMaxVerticesPerPixel = 6;

[[nodiscard]] constexpr std::size_t reconstruct_workspace_bytes(const ReconstructParams& params, Shape shape) noexcept {
  const std::size_t pixels = shape.pixels();
  const std::size_t completion = complete_background_workspace_bytes(params.background, shape) +
                                 complete_foreground_workspace_bytes(params.foreground, shape) +
                                 index_layer_workspace_bytes(shape);
  return 3 * allocation_bytes<Vec3f>(pixels) + 3 * allocation_bytes<std::uint8_t>(pixels) +
         allocation_bytes<std::uint8_t>(pixels) + 2 * allocation_bytes<std::uint32_t>(pixels) +
         allocation_bytes<Vec3f>(kMaxVerticesPerPixel * pixels) +
         allocation_bytes<std::uint32_t>(kMaxVerticesPerPixel * pixels) + allocation_bytes<Face>(4 * pixels) +
         completion + kWorkspaceAlignment;
}

namespace reconstruct_detail {

inline void find_visible(const SceneMesh& mesh, ImageView<const Label> labels, LabelSet foreground,
                         ImageView<const std::uint8_t> surface, ImageView<std::uint32_t> visible) {
  const Shape shape = visible.shape();
  const auto width = static_cast<std::uint32_t>(shape.width);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) visible(x, y) = kNoVertex;
  }
  for (std::size_t v = 0; v < mesh.vertex_pixel.size(); ++v) {
    const auto x = static_cast<int>(mesh.vertex_pixel[v] % width);
    const auto y = static_cast<int>(mesh.vertex_pixel[v] / width);
    // A thin object is widened by vertices on its neighbours' pixels; those still show what is behind.
    const bool seen = v < mesh.background_vertices || foreground.contains(labels(x, y));
    if (seen && surface(x, y) != 0) visible(x, y) = static_cast<std::uint32_t>(v);
  }
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 1; x < shape.width; ++x) {
      if (visible(x, y) == kNoVertex && surface(x, y) != 0) visible(x, y) = visible(x - 1, y);
    }
    for (int x = shape.width - 2; x >= 0; --x) {
      if (visible(x, y) == kNoVertex && surface(x, y) != 0) visible(x, y) = visible(x + 1, y);
    }
  }
}

}  // namespace reconstruct_detail

template <class Executor, class Observer>
Status reconstruct(const ReconstructParams& params, const SceneView& scene, const RefinedDepth& refined,
                   Workspace& workspace, Executor& executor, Observer& observer, SceneMesh& out) {
  const Shape shape = scene.shape();
  const Shape quads = quad_shape(shape);
  ImageView<std::uint32_t> visible;
  ImageView<std::uint32_t> object;
  ImageView<std::uint8_t> state;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, visible));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, object));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, state));
  const auto allocate_layer = [&](SheetLayer& layer) {
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, layer.vertices));
    return workspace.allocate_image(quads, layer.quads);
  };
  SheetLayer sheet;
  SheetLayer background;
  SheetLayer foreground;
  NPSIM_RETURN_IF_ERROR(allocate_layer(sheet));
  NPSIM_RETURN_IF_ERROR(allocate_layer(background));
  NPSIM_RETURN_IF_ERROR(allocate_layer(foreground));

  observer.begin(Stage::sheet);
  NPSIM_RETURN_IF_ERROR(build_sheet(params.sheet, refined.depth, refined.surface, scene.camera, sheet, executor));
  observer.end(Stage::sheet);

  observer.begin(Stage::prune);
  NPSIM_RETURN_IF_ERROR(prune(params.prune, refined.uncertain, refined.labels, sheet, executor));
  observer.end(Stage::prune);

  observer.begin(Stage::complete);
  NPSIM_RETURN_IF_ERROR(complete_background(params.background, sheet.vertices, refined.labels, refined.uncertain,
                                            refined.surface, scene.camera, background, state, workspace, executor));
  NPSIM_RETURN_IF_ERROR(complete_foreground(params.foreground, sheet.vertices, refined.labels, scene.instances,
                                            refined.uncertain, state, scene.camera, foreground, object, workspace,
                                            executor));
  const MeshSize back = mesh_size(background);
  const MeshSize front = mesh_size(foreground);
  MeshBuffers buffers;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(back.vertices + front.vertices, buffers.vertices));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(back.vertices + front.vertices, buffers.pixels));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(back.faces + front.faces, buffers.faces));
  MeshSize background_size;
  MeshSize foreground_size;
  NPSIM_RETURN_IF_ERROR(
      index_layers(background, foreground, buffers, background_size, foreground_size, workspace, executor));
  out.mesh = {buffers.vertices, buffers.faces};
  out.vertex_pixel = buffers.pixels;
  out.background_vertices = background_size.vertices;
  out.background_faces = background_size.faces;
  out.object = object;
  out.background_state = state;
  reconstruct_detail::find_visible(out, refined.labels, params.foreground.foreground, refined.surface, visible);
  out.visible_vertex = visible;
  observer.end(Stage::complete);
  return observer.cancelled() ? Status(StatusCode::cancelled, "cancelled after reconstruction") : Status();
}

}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_PIPELINE_RECONSTRUCT_HPP
