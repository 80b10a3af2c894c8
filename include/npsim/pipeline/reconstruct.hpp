// SPDX-License-Identifier: Apache-2.0
// Sections 3.3 and 3.5: from refined depth to the layered scene mesh.
//
// outlines of objects -> sheet (3.1) -> delete spurious faces -> complete the background behind objects -> complete the
// objects -> open the background's steps for rays -> one indexed mesh: background, objects as they are seen, and the
// objects' backs where these are wanted (the thesis has none). Each pixel then knows the vertex that the camera sees:
// the object's where there is one, else the background's, never a back; a pixel whose vertex got no face borrows the
// nearest one of its row. Objects are all that stands before something: trees and posts as well as the thesis'
// foreground. Two steps, because the mesh's size is known only when its layers are there: build_layers() and
// build_mesh(); reconstruct() is both. Memory: see the functions beside each; layers and mesh stay in the workspace.
#ifndef NPSIM_PIPELINE_RECONSTRUCT_HPP
#define NPSIM_PIPELINE_RECONSTRUCT_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/observe.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/refine_depth_params.hpp"
#include "npsim/depth/uncertainty.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/mesh/complete.hpp"
#include "npsim/mesh/index.hpp"
#include "npsim/mesh/prune.hpp"
#include "npsim/mesh/sheet.hpp"
#include "npsim/mesh/solidify.hpp"
#include "npsim/pipeline/detail/simplify_faces.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr std::uint32_t kNoVertex = 0xFFFFFFFFU;

// What rays meet. Points of light are one per pixel either way.
enum class TracedFaces {
  layers,  // those of both layers but the background's open steps, and the backs of objects but of leaves; slow where
           // vertices lie off their pixels' rays
  mesh     // the faces of the indexed mesh, however few
};

// The mesh is what is exported, textured with the photograph.
[[nodiscard]] constexpr SimplifyParams default_simplification() noexcept {
  SimplifyParams params;
  params.max_texture_shift = 0.5F;
  return params;
}

// Behind trees and posts the houses go on, as they do behind cars.
[[nodiscard]] constexpr BackgroundParams default_background() noexcept {
  BackgroundParams params;
  params.foreground = kStandingLabels;
  return params;
}
[[nodiscard]] constexpr ForegroundParams default_foreground() noexcept { return {kStandingLabels, true}; }

struct ReconstructParams {
  SheetParams sheet;
  // Offsets of (3.1), see with_offsets(); the thesis predicts none. They move the mesh against photograph and lamps.
  Vec2f offset{0.0F, 0.0F};
  PruneParams prune;
  // At the outlines of objects depth is not trusted: where windows so many pixels wide fire in (3.3). Refined depth has
  // its edges where the labels have theirs, so that few pixels do. 0: the depth's own uncertain map, as in the thesis.
  int outline_px = 2;
  BackgroundParams background = default_background();
  ForegroundParams foreground = default_foreground();
  OpenStepsParams open_steps;  // of the background, where rays meet the layers
  bool backs = true;           // objects are solids, not shells
  SolidifyParams solidify;
  bool simplify_faces = true;  // of the mesh: no more than these bounds need
  SimplifyParams simplify = default_simplification();
  TracedFaces traced = TracedFaces::layers;

  [[nodiscard]] static ReconstructParams thesis() noexcept {
    ReconstructParams params;
    params.outline_px = 0;
    params.background = BackgroundParams::thesis();
    params.foreground = ForegroundParams::thesis();
    params.backs = false;
    params.simplify_faces = false;
    params.simplify.max_pixel_error = kSafePixelError;  // vertices completed in position are off their rays
    params.traced = TracedFaces::mesh;                  // by tens of pixels: most of a layer would be searched
    return params;
  }
};

[[nodiscard]] inline Status validate(const ReconstructParams& params) noexcept {
  if (params.traced != TracedFaces::layers && params.traced != TracedFaces::mesh) {
    return {StatusCode::invalid_argument, "reconstruct: rays meet the layers or the mesh"};
  }
  if (params.outline_px < 0 || params.outline_px > 256) {
    return {StatusCode::invalid_argument, "reconstruct: outlines are up to 256 pixels wide"};
  }
  if (!(std::fabs(params.offset.x) <= 1.0F && std::fabs(params.offset.y) <= 1.0F)) {
    return {StatusCode::invalid_argument, "reconstruct: offsets of the sheet are at most half a picture"};
  }
  NPSIM_RETURN_IF_ERROR(validate(params.sheet));
  NPSIM_RETURN_IF_ERROR(validate(params.prune));
  NPSIM_RETURN_IF_ERROR(validate(params.background));
  NPSIM_RETURN_IF_ERROR(validate(params.foreground));
  NPSIM_RETURN_IF_ERROR(validate(params.open_steps));
  NPSIM_RETURN_IF_ERROR(validate(params.solidify));
  return validate(params.simplify);
}

// What the mesh is made from, views over the workspace: the sheet of everything that stands still, completed behind
// objects, and the sheet of the objects.
struct SceneLayers {
  SheetLayer background;
  SheetLayer foreground;
  ImageView<std::uint8_t> open_background;   // quads of the background without its open steps; those that rays meet
  ImageView<std::uint8_t> background_state;  // row_state of each pixel in the background
  ImageView<std::uint32_t> object;           // 0 = background, else the number of the object
};

// The scene as geometry; views over the workspace. Vertices and faces alike: the background's [0, background), the
// objects' visible sides [background, sheet), the rest of the objects [sheet, size). Of that rest, the faces from
// `solid` on are the backs of leaves, which rays pass: the leaves in front have stopped their share of the light.
struct SceneMesh {
  TriangleMeshView mesh;
  Intrinsics camera;                       // of the layers: the photograph's, with its offsets
  Span<const std::uint32_t> vertex_pixel;  // y * width + x of each vertex
  std::size_t background_vertices = 0;
  std::size_t background_faces = 0;
  std::size_t sheet_vertices = 0;
  std::size_t sheet_faces = 0;
  std::size_t solid_faces = 0;  // from here on, the backs of what light passes: crowns
  SheetLayer background;        // what the indexed sheets were made from
  SheetLayer foreground;
  SheetLayer open_background;                      // the background without its open steps
  ImageView<const std::uint32_t> visible_vertex;   // per pixel, kNoVertex where no surface is seen
  ImageView<const std::uint8_t> background_state;  // row_state of each pixel in the background
  ImageView<const std::uint32_t> object;           // 0 = background, else the number of the object
};

[[nodiscard]] constexpr std::size_t doubt_workspace_bytes(const ReconstructParams& params, Shape shape) noexcept {
  if (params.outline_px == 0) return kWorkspaceAlignment;
  return allocation_bytes<std::uint8_t>(shape.pixels()) + uncertainty_workspace_bytes(UncertaintyParams{}, shape);
}

// Where the layers do not take over the depth; `out` lies in the workspace or in `refined`.
template <class Executor>
[[nodiscard]] Status find_doubt(const ReconstructParams& params, const RefinedDepth& refined, Workspace& workspace,
                                Executor& executor, ImageView<const std::uint8_t>& out) {
  out = refined.uncertain;
  if (params.outline_px == 0) return {};
  UncertaintyParams outlines;
  outlines.window_px = params.outline_px;
  outlines.foreground = params.foreground.foreground;
  UncertaintyOutput at;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(refined.depth.shape(), at.mask));
  out = at.mask;
  return uncertainty(outlines, refined.surface_depth(), refined.labels, at, workspace, executor);
}

// Layers and planes of an image, and on top of them what completing them takes.
[[nodiscard]] constexpr std::size_t layers_workspace_bytes(const ReconstructParams& params, Shape shape) noexcept {
  const std::size_t pixels = shape.pixels();
  return 2 * allocation_bytes<Vec3f>(pixels) + 4 * allocation_bytes<std::uint8_t>(pixels) +
         allocation_bytes<std::uint32_t>(pixels) + doubt_workspace_bytes(params, shape) +
         std::max(complete_background_workspace_bytes(params.background, shape),
                  complete_foreground_workspace_bytes(params.foreground, shape)) +
         kWorkspaceAlignment;
}

// How much a mesh has of everything, before it is simplified; `backs`: most that the objects' backs can have.
struct SceneMeshSize {
  MeshSize background;
  MeshSize foreground;
  MeshSize backs;

  [[nodiscard]] constexpr std::size_t vertices() const noexcept {
    return background.vertices + foreground.vertices + backs.vertices;
  }
  [[nodiscard]] constexpr std::size_t faces() const noexcept {
    return background.faces + foreground.faces + backs.faces;
  }
  // No mesh of an image of this shape has more. In a completed layer every face exists that the vertices of one object
  // allow, hence a new fan begins at a vertex only where its neighbours on two opposite sides are missing: two fans at
  // most in either layer, and the backs have those of one. A quad has two faces in each layer. Backs add the objects'
  // faces once more, and two for each rim edge: a quad with both faces has no rim inside, one with a single face its
  // diagonal, and one without any at most two sides at which others end, so that objects and backs have four together.
  [[nodiscard]] static constexpr SceneMeshSize most(Shape shape) noexcept {
    const std::size_t twice = 2 * shape.pixels();
    return {{twice, twice}, {twice, twice}, {twice, twice}};
  }
};

// What a mesh of that size takes besides its layers.
[[nodiscard]] constexpr std::size_t mesh_workspace_bytes(const ReconstructParams& params, Shape shape,
                                                         const SceneMeshSize& size) noexcept {
  std::size_t step = index_layer_workspace_bytes(shape);
  if (params.simplify_faces) {
    step = max_of(step, simplify_faces_workspace_bytes(params.simplify, shape, size.background),
                  simplify_faces_workspace_bytes(params.simplify, shape, size.foreground));
  }
  if (params.backs) {
    step = std::max(step,
                    solidify_workspace_bytes(params.solidify, shape, size.foreground.vertices, size.foreground.faces));
  }
  return allocation_bytes<std::uint32_t>(shape.pixels()) + allocation_bytes<Vec3f>(size.vertices()) +
         allocation_bytes<std::uint32_t>(size.vertices()) + allocation_bytes<Face>(size.faces()) + step +
         kWorkspaceAlignment;
}

// Enough for reconstruct(), whatever the scene. Far more than most scenes take: build_mesh() asks for what it needs.
[[nodiscard]] constexpr std::size_t reconstruct_workspace_bytes(const ReconstructParams& params, Shape shape) noexcept {
  return layers_workspace_bytes(params, shape) + mesh_workspace_bytes(params, shape, SceneMeshSize::most(shape));
}

namespace reconstruct_detail {

// The scene with the camera on whose rays the vertices lie.
[[nodiscard]] inline SceneView seen_by_sheet(const ReconstructParams& params, const SceneView& scene) noexcept {
  SceneView out = scene;
  out.camera = with_offsets(scene.camera, scene.shape(), params.offset);
  return out;
}

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

// Closes the objects: what follows the sheets in the buffers. `room`: what there is at most.
template <class Executor>
[[nodiscard]] Status add_backs(const ReconstructParams& params, const SceneView& scene, const RefinedDepth& refined,
                               const SceneLayers& layers, const MeshSize& room, const MeshBuffers& buffers,
                               const MeshSize& behind, const MeshSize& front, Workspace& workspace, Executor& executor,
                               MeshSize& backs) {
  SolidifyScene around;
  around.camera = scene.camera;
  around.object = layers.object;
  around.labels = refined.labels;
  around.foreground = params.foreground.foreground;
  around.background = layers.background.vertices;
  around.up = refined.ground.up;
  around.camera_height_m = refined.ground.inlier_share > 0.0F ? refined.ground.camera_height_m : 0.0F;
  const SolidifyFront seen{
      {buffers.vertices.sub(behind.vertices, front.vertices), buffers.faces.sub(behind.faces, front.faces)},
      buffers.pixels.sub(behind.vertices, front.vertices),
      static_cast<std::uint32_t>(behind.vertices)};
  const std::size_t vertices = behind.vertices + front.vertices;
  const MeshBuffers rest{buffers.vertices.sub(vertices, room.vertices),
                         buffers.faces.sub(behind.faces + front.faces, room.faces),
                         buffers.pixels.sub(vertices, room.vertices)};
  return solidify(params.solidify, seen, around, rest, backs, workspace, executor);
}

// Faces of the objects' backs from `first` on: those of leaves come last. Returns where they begin.
[[nodiscard]] inline std::size_t leaves_last(const SolidifyParams& params, ImageView<const Label> labels,
                                             Span<const std::uint32_t> pixel, std::size_t first, Span<Face> faces) {
  const auto width = static_cast<std::uint32_t>(labels.width());
  const auto of_leaves = [&](std::uint32_t vertex) {
    const Label l = labels(static_cast<int>(pixel[vertex] % width), static_cast<int>(pixel[vertex] / width));
    return l < kLabelCount && params.rules[l].shape == BackShape::soft;
  };
  for (std::size_t f = first; f < faces.size(); ++f) {
    const Face face = faces[f];
    if (of_leaves(face.a) || of_leaves(face.b) || of_leaves(face.c)) continue;
    faces[f] = faces[first];
    faces[first++] = face;
  }
  return first;
}

}  // namespace reconstruct_detail

template <class Executor, class Observer>
Status build_layers(const ReconstructParams& params, const SceneView& given, const RefinedDepth& refined,
                    Workspace& workspace, Executor& executor, Observer& observer, SceneLayers& out) {
  const SceneView scene = reconstruct_detail::seen_by_sheet(params, given);
  const Shape shape = scene.shape();
  NPSIM_RETURN_IF_ERROR(workspace.ensure(layers_workspace_bytes(params, shape)));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, out.object));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, out.background_state));
  for (SheetLayer* layer : {&out.background, &out.foreground}) {
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, layer->vertices));
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(quad_shape(shape), layer->quads));
  }
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(quad_shape(shape), out.open_background));
  const SheetLayer& sheet = out.background;  // it is completed in place
  const WorkspaceScope scope(workspace);
  ImageView<const std::uint8_t> doubt;
  NPSIM_RETURN_IF_ERROR(find_doubt(params, refined, workspace, executor, doubt));

  observer.begin(Stage::sheet);
  NPSIM_RETURN_IF_ERROR(
      build_sheet(params.sheet, refined.surface_depth(), refined.surface, scene.camera, sheet, executor));
  observer.end(Stage::sheet);

  observer.begin(Stage::prune);
  NPSIM_RETURN_IF_ERROR(prune(params.prune, doubt, refined.labels, sheet, executor));
  observer.end(Stage::prune);

  observer.begin(Stage::complete);
  NPSIM_RETURN_IF_ERROR(complete_background(params.background,
                                            {sheet.vertices, refined.labels, doubt, refined.surface, scene.camera},
                                            sheet, out.background_state, workspace, executor));
  NPSIM_RETURN_IF_ERROR(complete_foreground(params.foreground,
                                            {params.sheet, refined.surface_depth(), refined.surface, refined.labels,
                                             scene.instances, doubt, out.background_state, scene.camera},
                                            out.foreground, out.object, workspace, executor));
  NPSIM_RETURN_IF_ERROR(open_steps(params.open_steps, out.background, out.open_background, executor));
  observer.end(Stage::complete);
  return observer.cancelled() ? Status(StatusCode::cancelled, "cancelled while completing the layers") : Status();
}

[[nodiscard]] inline SceneMeshSize mesh_size(const ReconstructParams& params, const SceneLayers& layers) noexcept {
  SceneMeshSize size;
  size.background = mesh_size(layers.background);
  size.foreground = mesh_size(layers.foreground);
  if (params.backs) {
    size.backs = {size.foreground.vertices, back_faces(size.foreground.faces, rim_edge_count(layers.foreground))};
  }
  return size;
}

// `refined` and `layers` are what the mesh's views go on to show: they stay as long as it.
template <class Executor, class Observer>
Status build_mesh(const ReconstructParams& params, const SceneView& given, const RefinedDepth& refined,
                  const SceneLayers& layers, Workspace& workspace, Executor& executor, Observer& observer,
                  SceneMesh& out) {
  const SceneView scene = reconstruct_detail::seen_by_sheet(params, given);
  const Shape shape = scene.shape();
  observer.begin(Stage::mesh);
  const SceneMeshSize room = mesh_size(params, layers);
  NPSIM_RETURN_IF_ERROR(workspace.ensure(mesh_workspace_bytes(params, shape, room)));
  ImageView<std::uint32_t> visible;
  MeshBuffers buffers;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, visible));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(room.vertices(), buffers.vertices));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(room.vertices(), buffers.pixels));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(room.faces(), buffers.faces));
  MeshSize behind;
  MeshSize front;
  NPSIM_RETURN_IF_ERROR(
      index_layers(layers.background, layers.foreground, buffers, behind, front, workspace, executor));
  if (params.simplify_faces) {
    NPSIM_RETURN_IF_ERROR(reconstruct_detail::thin_out(params, scene, refined.labels, layers.background,
                                                       layers.foreground, buffers, behind, front, workspace, executor));
  }
  out.background_vertices = behind.vertices;
  out.background_faces = behind.faces;
  out.sheet_vertices = behind.vertices + front.vertices;
  out.sheet_faces = behind.faces + front.faces;
  MeshSize backs;
  if (params.backs && front.faces > 0) {
    NPSIM_RETURN_IF_ERROR(reconstruct_detail::add_backs(params, scene, refined, layers, room.backs, buffers, behind,
                                                        front, workspace, executor, backs));
  }
  workspace.shorten(buffers.faces, out.sheet_faces + backs.faces);
  out.solid_faces =
      reconstruct_detail::leaves_last(params.solidify, refined.labels, buffers.pixels, out.sheet_faces, buffers.faces);
  out.mesh = {buffers.vertices, buffers.faces};
  out.camera = scene.camera;
  out.vertex_pixel = buffers.pixels;
  out.background = layers.background;
  out.foreground = layers.foreground;
  out.open_background = {layers.background.vertices, layers.open_background};
  out.object = layers.object;
  out.background_state = layers.background_state;
  reconstruct_detail::find_visible(out, refined.labels, params.foreground.foreground, refined.surface, visible);
  out.visible_vertex = visible;
  observer.end(Stage::mesh);
  return observer.cancelled() ? Status(StatusCode::cancelled, "cancelled after reconstruction") : Status();
}

template <class Executor, class Observer>
Status reconstruct(const ReconstructParams& params, const SceneView& scene, const RefinedDepth& refined,
                   Workspace& workspace, Executor& executor, Observer& observer, SceneMesh& out) {
  SceneLayers layers;
  NPSIM_RETURN_IF_ERROR(build_layers(params, scene, refined, workspace, executor, observer, layers));
  return build_mesh(params, scene, refined, layers, workspace, executor, observer, out);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_RECONSTRUCT_HPP
