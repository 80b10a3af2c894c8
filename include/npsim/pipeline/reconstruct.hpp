// SPDX-License-Identifier: Apache-2.0
// Sections 3.3 and 3.5: from refined depth to the layered scene mesh.
//
// sheet (3.1) -> delete spurious faces -> complete the background behind objects -> complete the objects -> one indexed
// mesh: background, objects as they are seen, and the objects' backs where these are wanted (the thesis has none). Each
// pixel then knows the vertex that the camera sees: the object's where there is one, else the background's, never a
// back; a pixel whose vertex got no face borrows the nearest one of its row.
// Memory: see reconstruct_workspace_bytes(); the mesh stays in the workspace.
#ifndef NPSIM_PIPELINE_RECONSTRUCT_HPP
#define NPSIM_PIPELINE_RECONSTRUCT_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/observe.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/mesh/complete_background.hpp"
#include "npsim/mesh/complete_foreground.hpp"
#include "npsim/mesh/index.hpp"
#include "npsim/mesh/prune.hpp"
#include "npsim/mesh/sheet.hpp"
#include "npsim/mesh/solidify.hpp"
#include "npsim/pipeline/detail/simplify_faces.hpp"
#include "npsim/pipeline/refine_depth.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr std::uint32_t kNoVertex = 0xFFFFFFFFU;

// What rays meet. Points of light are one per pixel either way.
enum class TracedFaces {
  layers,  // every face of both layers, and the objects' backs; slow where vertices lie off their pixels' rays
  mesh     // the faces of the indexed mesh, however few
};

// The mesh is what is exported, textured with the photograph.
[[nodiscard]] constexpr SimplifyParams default_simplification() noexcept {
  SimplifyParams params;
  params.max_texture_shift = 0.5F;
  return params;
}

struct ReconstructParams {
  SheetParams sheet;
  PruneParams prune;
  BackgroundParams background;
  ForegroundParams foreground;
  bool backs = true;  // objects are solids, not shells
  SolidifyParams solidify;
  GroundParams ground;         // that solids stand on
  bool simplify_faces = true;  // of the mesh: no more than these bounds need
  SimplifyParams simplify = default_simplification();
  TracedFaces traced = TracedFaces::layers;

  [[nodiscard]] static ReconstructParams thesis() noexcept {
    ReconstructParams params;
    params.background = BackgroundParams::thesis();
    params.foreground = ForegroundParams::thesis();
    params.backs = false;
    params.simplify_faces = false;
    params.simplify.max_pixel_error = kSafePixelError;  // vertices completed in position are off their rays
    params.traced = TracedFaces::mesh;                  // by tens of pixels: most of a layer would be searched
    return params;
  }
};

// The scene as geometry; views over the workspace. Vertices and faces alike: the background's [0, background), the
// objects' visible sides [background, sheet), the rest of the objects [sheet, size).
struct SceneMesh {
  TriangleMeshView mesh;
  Span<const std::uint32_t> vertex_pixel;  // y * width + x of each vertex
  std::size_t background_vertices = 0;
  std::size_t background_faces = 0;
  std::size_t sheet_vertices = 0;
  std::size_t sheet_faces = 0;
  SheetLayer background;  // what the indexed sheets were made from
  SheetLayer foreground;
  ImageView<const std::uint32_t> background_vertex;  // per pixel, the first of its fans, kNoVertex for none
  ImageView<const std::uint32_t> foreground_vertex;
  ImageView<const std::uint32_t> visible_vertex;   // per pixel, kNoVertex where no surface is seen
  ImageView<const std::uint8_t> background_state;  // row_state of each pixel in the background
  ImageView<const std::uint32_t> object;           // 0 = background, else the number of the object
};

// In a completed layer every face exists that the vertices of one object allow, hence a new fan begins at a vertex only
// where its neighbours on two opposite sides are missing: two fans at most, in two layers, and the backs' of one.
inline constexpr std::size_t kMaxVerticesPerPixel = 6;
// A quad has two faces in each layer. The backs': two more, and two for each rim edge, of which a quad with both faces
// has none inside, one with a single face its diagonal, and one without any at most two sides that others end at.
inline constexpr std::size_t kMaxFacesPerPixel = 6;

[[nodiscard]] constexpr std::size_t reconstruct_workspace_bytes(const ReconstructParams& params, Shape shape) noexcept {
  const std::size_t pixels = shape.pixels();
  const std::size_t completion = complete_background_workspace_bytes(params.background, shape) +
                                 complete_foreground_workspace_bytes(params.foreground, shape) +
                                 index_layer_workspace_bytes(shape) + ground_workspace_bytes(params.ground, shape) +
                                 solidify_workspace_bytes(params.solidify, shape, 2 * pixels, 2 * pixels) +
                                 simplify_faces_workspace_bytes(params.simplify, shape);
  return 2 * allocation_bytes<Vec3f>(pixels) + 2 * allocation_bytes<std::uint8_t>(pixels) +
         allocation_bytes<std::uint8_t>(pixels) + 4 * allocation_bytes<std::uint32_t>(pixels) +
         allocation_bytes<Vec3f>(kMaxVerticesPerPixel * pixels) +
         allocation_bytes<std::uint32_t>(kMaxVerticesPerPixel * pixels) +
         allocation_bytes<Face>(kMaxFacesPerPixel * pixels) + completion + kWorkspaceAlignment;
}

namespace reconstruct_detail {

inline void find_visible(const SceneMesh& mesh, ImageView<const Label> labels, LabelSet foreground,
                         ImageView<const std::uint8_t> surface, ImageView<std::uint32_t> visible) {
  const Shape shape = visible.shape();
  const auto width = static_cast<std::uint32_t>(shape.width);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) visible(x, y) = kNoVertex;
  }
  for (std::size_t v = 0; v < mesh.sheet_vertices; ++v) {
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

// pixels: of the vertices of one layer, in raster order; `first` is the number of the first of them.
inline void find_first_vertices(Span<const std::uint32_t> pixels, std::uint32_t first, ImageView<std::uint32_t> out) {
  const auto width = static_cast<std::uint32_t>(out.width());
  for (int y = 0; y < out.height(); ++y) {
    for (int x = 0; x < out.width(); ++x) out(x, y) = kNoVertex;
  }
  for (std::size_t v = pixels.size(); v-- > 0;) {
    out(static_cast<int>(pixels[v] % width), static_cast<int>(pixels[v] / width)) =
        first + static_cast<std::uint32_t>(v);
  }
}

// Both layers' faces make way for fewer, and close up.
template <class Executor>
[[nodiscard]] Status thin_out(const ReconstructParams& params, const SceneView& scene, ImageView<const Label> labels,
                              const SheetLayer& background, const SheetLayer& foreground, const MeshBuffers& mesh,
                              MeshSize& behind, MeshSize& front, Workspace& workspace, Executor& executor) {
  const std::size_t full = behind.faces;
  const MeshBuffers back_part{mesh.vertices.sub(0, behind.vertices), mesh.faces.sub(0, full),
                              mesh.pixels.sub(0, behind.vertices)};
  const MeshBuffers front_part{mesh.vertices.sub(behind.vertices, front.vertices), mesh.faces.sub(full, front.faces),
                               mesh.pixels.sub(behind.vertices, front.vertices)};
  // Points must not lie behind the faces that rays meet.
  const bool move = params.traced == TracedFaces::mesh;
  NPSIM_RETURN_IF_ERROR(simplify_faces(params.simplify, move, background, labels, scene.light_index, scene.camera, 0,
                                       back_part, behind.faces, workspace, executor));
  NPSIM_RETURN_IF_ERROR(simplify_faces(params.simplify, move, foreground, labels, scene.light_index, scene.camera,
                                       static_cast<std::uint32_t>(behind.vertices), front_part, front.faces, workspace,
                                       executor));
  for (std::size_t f = 0; f < front.faces; ++f) mesh.faces[behind.faces + f] = mesh.faces[full + f];
  return {};
}

}  // namespace reconstruct_detail

template <class Executor, class Observer>
Status reconstruct(const ReconstructParams& params, const SceneView& scene, const RefinedDepth& refined,
                   Workspace& workspace, Executor& executor, Observer& observer, SceneMesh& out) {
  const Shape shape = scene.shape();
  const Shape quads = quad_shape(shape);
  ImageView<std::uint32_t> visible;
  ImageView<std::uint32_t> of_background;
  ImageView<std::uint32_t> of_foreground;
  ImageView<std::uint32_t> object;
  ImageView<std::uint8_t> state;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, visible));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, of_background));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, of_foreground));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, object));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, state));
  const auto allocate_layer = [&](SheetLayer& layer) {
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, layer.vertices));
    return workspace.allocate_image(quads, layer.quads);
  };
  SheetLayer background;  // the sheet at first: it is completed in place
  SheetLayer foreground;
  NPSIM_RETURN_IF_ERROR(allocate_layer(background));
  NPSIM_RETURN_IF_ERROR(allocate_layer(foreground));

  observer.begin(Stage::sheet);
  NPSIM_RETURN_IF_ERROR(build_sheet(params.sheet, refined.depth, refined.surface, scene.camera, background, executor));
  observer.end(Stage::sheet);

  observer.begin(Stage::prune);
  NPSIM_RETURN_IF_ERROR(prune(params.prune, refined.uncertain, refined.labels, background, executor));
  observer.end(Stage::prune);

  observer.begin(Stage::complete);
  NPSIM_RETURN_IF_ERROR(complete_background(
      params.background, {background.vertices, refined.labels, refined.uncertain, refined.surface, scene.camera},
      background, state, workspace, executor));
  NPSIM_RETURN_IF_ERROR(complete_foreground(params.foreground,
                                            {params.sheet, refined.depth, refined.surface, refined.labels,
                                             scene.instances, refined.uncertain, state, scene.camera},
                                            foreground, object, workspace, executor));
  const MeshSize behind = mesh_size(background);
  const MeshSize front = mesh_size(foreground);
  MeshSize backs;
  if (params.backs) {
    backs = {front.vertices, back_faces(front.faces, rim_edge_count(foreground))};
  }
  const std::size_t vertices = behind.vertices + front.vertices + backs.vertices;
  MeshBuffers buffers;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(vertices, buffers.vertices));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(vertices, buffers.pixels));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(behind.faces + front.faces + backs.faces, buffers.faces));
  MeshSize background_size;
  MeshSize foreground_size;
  NPSIM_RETURN_IF_ERROR(
      index_layers(background, foreground, buffers, background_size, foreground_size, workspace, executor));
  if (params.simplify_faces) {
    NPSIM_RETURN_IF_ERROR(reconstruct_detail::thin_out(params, scene, refined.labels, background, foreground,
                                                       buffers, background_size, foreground_size, workspace, executor));
  }
  out.background_vertices = background_size.vertices;
  out.background_faces = background_size.faces;
  out.sheet_vertices = background_size.vertices + foreground_size.vertices;
  out.sheet_faces = background_size.faces + foreground_size.faces;
  const MeshSize room = backs;
  backs = {};
  if (params.backs && foreground_size.faces > 0) {
    GroundPlane ground;
    NPSIM_RETURN_IF_ERROR(
        estimate_ground(params.ground, refined.depth, refined.labels, scene.camera, workspace, ground));
    SolidifyScene around;
    around.camera = scene.camera;
    around.object = object;
    around.labels = refined.labels;
    around.foreground = params.foreground.foreground;
    around.background = background.vertices;
    around.up = ground.up;
    around.camera_height_m = ground.inlier_share > 0.0F ? ground.camera_height_m : 0.0F;
    const SolidifyFront seen{{buffers.vertices.sub(background_size.vertices, foreground_size.vertices),
                              buffers.faces.sub(background_size.faces, foreground_size.faces)},
                             buffers.pixels.sub(background_size.vertices, foreground_size.vertices),
                             static_cast<std::uint32_t>(background_size.vertices)};
    const MeshBuffers rest{buffers.vertices.sub(out.sheet_vertices, room.vertices),
                           buffers.faces.sub(out.sheet_faces, room.faces),
                           buffers.pixels.sub(out.sheet_vertices, room.vertices)};
    NPSIM_RETURN_IF_ERROR(solidify(params.solidify, seen, around, rest, backs, workspace, executor));
  }
  out.mesh = {buffers.vertices, buffers.faces.sub(0, out.sheet_faces + backs.faces)};
  out.vertex_pixel = buffers.pixels;
  out.background = background;
  out.foreground = foreground;
  out.object = object;
  out.background_state = state;
  reconstruct_detail::find_first_vertices(out.vertex_pixel.sub(0, out.background_vertices), 0, of_background);
  reconstruct_detail::find_first_vertices(
      out.vertex_pixel.sub(out.background_vertices, out.sheet_vertices - out.background_vertices),
      static_cast<std::uint32_t>(out.background_vertices), of_foreground);
  out.background_vertex = of_background;
  out.foreground_vertex = of_foreground;
  reconstruct_detail::find_visible(out, refined.labels, params.foreground.foreground, refined.surface, visible);
  out.visible_vertex = visible;
  observer.end(Stage::complete);
  return observer.cancelled() ? Status(StatusCode::cancelled, "cancelled after reconstruction") : Status();
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_RECONSTRUCT_HPP
