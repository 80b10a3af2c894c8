// SPDX-License-Identifier: Apache-2.0
#include "view_command.hpp"

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "console.hpp"
#include "engine.hpp"
#include "loading.hpp"
#include "mesh_views.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/memory.hpp"
#include "npsim/io/obj.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/mesh/check.hpp"
#include "npsim/pipeline/night.hpp"
#include "options.hpp"
#include "outputs.hpp"

namespace npsim::tool {
namespace {

// One line of figures. Of the boundary loops of open sheets one each is the outline; the others are holes.
void print_mesh(const char* name, const TriangleMeshView& mesh) {
  const std::size_t bytes = check_mesh_workspace_bytes(mesh.vertices.size(), mesh.faces.size());
  io::HostMemory memory(bytes);
  Workspace workspace = memory.workspace(bytes);
  MeshReport report;
  const Status checked = check_mesh(mesh, workspace, report);
  if (!checked.ok()) {
    std::printf("%-12s %s\n", name, checked.message());
    return;
  }
  std::printf("%-12s %zu vertices, %zu faces, %zu components, %zu boundary loops, %s\n", name,
              report.vertices - report.isolated_vertices, report.faces, report.components, report.boundary_loops,
              report.watertight() ? "closed" : (report.oriented_manifold() ? "manifold" : "not a manifold"));
}

[[nodiscard]] io::Expected<Shape> picture_shape(const ViewOptions& options, Shape otherwise) {
  return options.picture.empty() ? io::Expected<Shape>(otherwise) : parse_size(options.picture, "--picture");
}

// What one run draws; views over memory of the run.
struct DrawnMesh {
  TriangleMeshView mesh;
  PreviewColours colours;
  Intrinsics camera;  // of a picture of `shape`
  Shape shape;
  ViewPose pose;
};

int write_view(const ViewOptions& options, const DrawnMesh& drawn, AnyExecutor executor) {
  const io::Expected<Shape> shape = picture_shape(options, drawn.shape);
  if (!shape) return fail(shape.error());
  PreviewParams params;
  params.shading = options.plain && !(options.shading > 0) ? 0.65F : options.shading;
  params.wire_px = 2 * options.wire_px;  // it is drawn at twice the size
  io::Image<Rgb8> picture;
  const InterruptibleExecutor until_interrupted{executor};
  Status status = draw_mesh(params, drawn.mesh, options.plain ? PreviewColours{} : drawn.colours,
                            scaled(drawn.camera, drawn.shape, shape.value()), drawn.pose, shape.value(),
                            until_interrupted, picture);
  if (interrupted.load(std::memory_order_relaxed)) status = {StatusCode::cancelled, "cancelled while drawing"};
  if (!status.ok()) return fail(options.scene, status);
  if (const io::Outcome o = io::write_png(options.output, picture.view()); !o) return fail(o.error());
  std::printf("%s\n", options.output.c_str());
  return kExitDone;
}

// A mesh from a file has no photograph and no camera: it is seen plain, with a field of view of 60 degrees.
int view_file(const ViewOptions& options) {
  io::Expected<io::Mesh> mesh = io::read_obj(options.scene);
  if (!mesh) return fail(mesh.error());
  if (mesh.value().faces.empty()) return fail(io::Error{options.scene, "", "has no faces, expected some to draw"});
  InputFiles inputs;
  inputs.add(options.scene, "the mesh");
  inputs.add_files_of_obj(options.scene);
  if (const io::Outcome apart = inputs.expect_none_of({options.output}); !apart) return fail(apart.error());
  if (const io::Outcome made = make_folder_of(options.output); !made) return fail(made.error());
  if (!options.y_down) {
    for (Vec3f& v : mesh.value().vertices) v = {v.x, -v.y, -v.z};
  }
  DrawnMesh drawn;
  drawn.mesh = mesh.value().view();
  drawn.shape = {960, 540};
  drawn.camera = intrinsics_from_fov(drawn.shape, 1.0471976F);
  MeshViewParams from = options.from;
  if (!(from.pivot_m > 0)) from.pivot_m = 14;  // there is no depth to choose one by
  drawn.pose = view_pose(from, {}, drawn.camera);
  ViewOptions plain = options;
  plain.plain = true;
  print_mesh("mesh", drawn.mesh);
  ThreadPool pool(thread_count(options.threads));
  return write_view(plain, drawn, pool);
}

// The sheet before anything is completed: as (3.1) makes it, or without its spurious faces.
[[nodiscard]] Status open_sheet(const ReconstructParams& params, const SceneView& scene, const RefinedDepth& refined,
                                bool pruned, Workspace& workspace, AnyExecutor executor, TriangleMeshView& mesh,
                                Span<const std::uint32_t>& pixels) {
  NPSIM_RETURN_IF_ERROR(workspace.ensure(reconstruct_workspace_bytes(params, scene.shape())));
  SheetLayer sheet;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(scene.shape(), sheet.vertices));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(quad_shape(scene.shape()), sheet.quads));
  NPSIM_RETURN_IF_ERROR(
      build_sheet(params.sheet, refined.surface_depth(), refined.surface, scene.camera, sheet, executor));
  if (pruned) NPSIM_RETURN_IF_ERROR(prune(params.prune, refined.uncertain, refined.labels, sheet, executor));
  MeshSize size = mesh_size(sheet);
  MeshBuffers buffers;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(size.vertices, buffers.vertices));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(size.vertices, buffers.pixels));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(size.faces, buffers.faces));
  NPSIM_RETURN_IF_ERROR(index_layer(sheet, 0, buffers, size, workspace, executor));
  mesh = {buffers.vertices, buffers.faces};
  pixels = buffers.pixels;
  return {};
}

}  // namespace

int run_view(const ViewOptions& options) {
  if (const io::Expected<Shape> shape = picture_shape(options, Shape{1, 1}); !shape) return fail(shape.error());
  std::error_code ignored;
  const std::filesystem::path path(options.scene);
  const bool obj = path.extension() == ".obj" && !std::filesystem::is_directory(path, ignored);
  if (const io::Outcome good = obj ? io::Done{} : expect_scene(options.scene, ", or an .obj"); !good) {
    return fail(good.error());
  }
  if (obj) return view_file(options);
  Console console(options.quiet);
  const io::Expected<io::Scene> loaded =
      console.timed("read scene", [&] { return load_scene(options.scene, options.size); });
  if (!loaded) return fail(loaded.error());
  if (const io::Outcome apart = InputFiles(loaded.value()).expect_none_of({options.output}); !apart) {
    return fail(apart.error());
  }
  if (const io::Outcome made = make_folder_of(options.output); !made) return fail(made.error());
  const NightParams params = options.preset == "thesis" ? thesis_night_params() : default_night_params();
  const SceneView scene = loaded.value().view();
  if (const Status valid = validate(scene); !valid.ok()) return fail(options.scene, valid);
  io::HostMemory memory(refine_depth_workspace_bytes(params.depth, scene.shape()) +
                        reconstruct_workspace_bytes(params.mesh, scene.shape()));
  Workspace workspace = memory.workspace();
  ThreadPool pool(thread_count(options.threads));

  RefinedDepth refined;
  Status status = engine::refine_depth(params.depth, scene, workspace, pool, console, refined);
  if (!status.ok()) return fail(options.scene, status);
  DrawnMesh drawn;
  std::unique_ptr<ViewColours> colours;
  if (options.mesh == "raw" || options.mesh == "pruned") {
    Span<const std::uint32_t> pixels;
    status = open_sheet(params.mesh, scene, refined, options.mesh == "pruned", workspace, pool, drawn.mesh, pixels);
    if (!status.ok()) return fail(options.scene, status);
    colours = std::make_unique<ViewColours>(loaded.value().image, pixels);
    print_mesh(options.mesh.c_str(), drawn.mesh);
  } else {
    SceneMesh mesh;
    status = engine::reconstruct(params.mesh, scene, refined, workspace, pool, console, mesh);
    if (!status.ok()) return fail(options.scene, status);
    colours = std::make_unique<ViewColours>(loaded.value().image, mesh);
    const std::size_t all_faces = mesh.mesh.faces.size();
    const TriangleMeshView background{mesh.mesh.vertices.sub(0, mesh.background_vertices),
                                      mesh.mesh.faces.sub(0, mesh.background_faces)};
    const TriangleMeshView objects{mesh.mesh.vertices,
                                   mesh.mesh.faces.sub(mesh.background_faces, all_faces - mesh.background_faces)};
    drawn.mesh = options.mesh == "background" ? background : (options.mesh == "objects" ? objects : mesh.mesh);
    if (options.mesh != "objects") print_mesh("background", background);
    if (options.mesh != "background") print_mesh("objects", objects);
  }
  drawn.colours = colours->of(drawn.mesh.vertices.size());
  drawn.camera = scene.camera;
  drawn.shape = scene.shape();
  drawn.pose = view_pose(options.from, refined.depth, scene.camera);
  return write_view(options, drawn, pool);
}

}  // namespace npsim::tool
