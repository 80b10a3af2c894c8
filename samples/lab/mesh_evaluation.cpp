// SPDX-License-Identifier: Apache-2.0
#include "mesh_evaluation.hpp"

#include <algorithm>
#include <cmath>

#include "lamp_evaluation.hpp"
#include "npsim/depth/uncertainty.hpp"
#include "npsim/io/memory.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/index.hpp"
#include "tool/engine.hpp"

namespace npsim::tool {
namespace {

// A mesh with its memory, indexed from one layer.
struct LayerMesh {
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  std::vector<std::uint32_t> pixels;

  [[nodiscard]] TriangleMeshView view() const {
    return {{vertices.data(), vertices.size()}, {faces.data(), faces.size()}};
  }
  [[nodiscard]] Status take(const SheetLayer& layer, ThreadPool& pool) {
    MeshSize size = mesh_size(layer);
    vertices.resize(size.vertices);
    faces.resize(size.faces);
    pixels.resize(size.vertices);
    std::vector<unsigned char> memory(index_layer_workspace_bytes(layer.vertices.shape()));
    Workspace workspace(memory.data(), memory.size());
    MeshBuffers buffers;
    buffers.vertices = {vertices.data(), vertices.size()};
    buffers.faces = {faces.data(), faces.size()};
    buffers.pixels = {pixels.data(), pixels.size()};
    return index_layer(layer, 0, buffers, size, workspace, pool);
  }
};

[[nodiscard]] Status checked(const TriangleMeshView& mesh, MeshReport& report) {
  std::vector<unsigned char> memory(check_mesh_workspace_bytes(mesh.vertices.size(), mesh.faces.size()));
  Workspace workspace(memory.data(), memory.size());
  return check_mesh(mesh, workspace, report);
}

// The faces of a mesh, not simplified, that rays meet; background: how many of them are the background's.
[[nodiscard]] std::vector<Face> traced_faces(const SceneMesh& mesh, std::size_t& background) {
  std::vector<Face> faces;
  faces.reserve(mesh.mesh.faces.size());
  const auto width = static_cast<std::uint32_t>(mesh.visible_vertex.width());
  for (std::size_t f = 0; f < mesh.background_faces; ++f) {
    const Face face = mesh.mesh.faces[f];
    const std::uint32_t pixels[3] = {mesh.vertex_pixel[face.a], mesh.vertex_pixel[face.b], mesh.vertex_pixel[face.c]};
    std::uint32_t x = width;
    std::uint32_t y = pixels[0] / width;
    for (const std::uint32_t p : pixels) {
      x = std::min(x, p % width);
      y = std::min(y, p / width);
    }
    int corners_above = 0;
    for (const std::uint32_t p : pixels) corners_above += p / width == y ? 1 : 0;
    const std::uint8_t bit = corners_above == 2 ? kQuadUpperFace : kQuadLowerFace;
    if ((mesh.open_background.quads(static_cast<int>(x), static_cast<int>(y)) & bit) != 0) faces.push_back(face);
  }
  background = faces.size();
  for (std::size_t f = mesh.background_faces; f < mesh.solid_faces; ++f) faces.push_back(mesh.mesh.faces[f]);
  return faces;
}

[[nodiscard]] BackgroundErrors background_errors(ImageView<const Vec3f> vertices, ImageView<const Label> labels,
                                                 LabelSet foreground, ImageView<const float> truth) {
  BackgroundErrors errors;
  for (int y = 0; y < truth.height(); ++y) {
    for (int x = 0; x < truth.width(); ++x) {
      if (!foreground.contains(labels(x, y)) || !is_valid_depth(truth(x, y))) continue;
      ++errors.pixels;
      const float z = vertices(x, y).z;
      if (!(z > 0.0F)) {
        ++errors.missing;
        continue;
      }
      const double off = std::fabs(static_cast<double>(z) / static_cast<double>(truth(x, y)) - 1.0);
      errors.abs_rel += off;
      errors.within_3_percent += off <= 0.03 ? 1U : 0U;
    }
  }
  if (errors.pixels > errors.missing) errors.abs_rel /= static_cast<double>(errors.pixels - errors.missing);
  return errors;
}

// The depth plane of a stage: where it has the point that a pixel shows.
[[nodiscard]] io::Image<float> shown_depth(const SceneMesh& mesh, Shape shape) {
  io::Image<float> depth(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const std::uint32_t v = mesh.visible_vertex(x, y);
      const bool own = v != kNoVertex && mesh.vertex_pixel[v] == static_cast<std::uint32_t>(y * shape.width + x);
      depth(x, y) = own ? mesh.mesh.vertices[v].z : 0.0F;
    }
  }
  return depth;
}

// Ids of the lamps that faces are part of, by the renderer's rule. `mesh` has the stage's faces.
[[nodiscard]] Status lamps_of_faces(const SceneView& scene, const SceneMesh& mesh, const std::vector<Emitter>& lamps,
                                    std::vector<std::uint32_t>& out) {
  std::vector<std::uint16_t> mark(mesh.mesh.faces.size());
  std::vector<unsigned char> memory(mark_faces_workspace_bytes(scene.shape(), scene.lights.size(), lamps.size()));
  Workspace workspace(memory.data(), memory.size());
  NPSIM_RETURN_IF_ERROR(mark_faces(scene, mesh, Span<const Emitter>(lamps.data(), lamps.size()),
                                   Span<std::uint16_t>(mark.data(), mark.size()), workspace));
  out.resize(mark.size());
  for (std::size_t f = 0; f < mark.size(); ++f) out[f] = mark[f] == 0 ? 0 : scene.lights[mark[f] - 1U].id;
  return {};
}

}  // namespace

Status evaluate_mesh(const ReconstructParams& params, const SceneView& scene, const RefinedDepth& refined,
                     const MeshJudges& judges, ThreadPool& pool, Console& console, MeshErrors& out) {
  const Shape shape = scene.shape();
  io::Image<Vec3f> vertices(shape);
  io::Image<std::uint8_t> quads(quad_shape(shape));
  const SheetLayer sheet{vertices.view(), quads.view()};
  std::array<LayerMesh, 2> sheets;
  NPSIM_RETURN_IF_ERROR(build_sheet(params.sheet, refined.surface_depth(),
                                    ImageView<const std::uint8_t>(refined.surface), scene.camera, sheet, pool));
  NPSIM_RETURN_IF_ERROR(sheets[0].take(sheet, pool));
  {
    const std::size_t bytes = doubt_workspace_bytes(params, shape);
    io::HostMemory memory(bytes);
    Workspace workspace = memory.workspace(bytes);
    ImageView<const std::uint8_t> doubt;
    NPSIM_RETURN_IF_ERROR(find_doubt(params, refined, workspace, pool, doubt));
    NPSIM_RETURN_IF_ERROR(prune(params.prune, doubt, refined.labels, sheet, pool));
  }
  NPSIM_RETURN_IF_ERROR(sheets[1].take(sheet, pool));

  const std::size_t most = reconstruct_workspace_bytes(params, shape);
  std::array<io::HostMemory, 2> memory = {io::HostMemory(most), io::HostMemory(most)};
  std::array<SceneMesh, 2> meshes;  // with all faces, simplified
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    ReconstructParams own = params;
    own.simplify_faces = i == 1;
    Workspace workspace = memory[i].workspace();
    NPSIM_RETURN_IF_ERROR(engine::reconstruct(own, scene, refined, workspace, pool, console, meshes[i]));
  }
  const SceneMesh& mesh = meshes[0];
  const std::array<TriangleMeshView, kMeshStages> stages = {
      sheets[0].view(), sheets[1].view(),
      TriangleMeshView{mesh.mesh.vertices.sub(0, mesh.sheet_vertices), mesh.mesh.faces.sub(0, mesh.sheet_faces)},
      mesh.mesh, meshes[1].mesh};
  for (std::size_t i = 0; i < stages.size(); ++i) {
    NPSIM_RETURN_IF_ERROR(checked(stages[i], out.report[i]));
  }
  const SceneMesh& thin = meshes[1];
  NPSIM_RETURN_IF_ERROR(
      checked({thin.mesh.vertices.sub(0, thin.background_vertices), thin.mesh.faces.sub(0, thin.background_faces)},
              out.simplified_background));
  NPSIM_RETURN_IF_ERROR(checked(
      {thin.mesh.vertices, thin.mesh.faces.sub(thin.background_faces, thin.mesh.faces.size() - thin.background_faces)},
      out.simplified_objects));
  NPSIM_RETURN_IF_ERROR(measure_mesh_steps(params, scene, refined, pool, out.steps));
  if (!judges.background_depth.empty() && !refined.labels.empty()) {
    out.background =
        background_errors(mesh.background.vertices, refined.labels, kForegroundLabels, judges.background_depth);
  }
  if (judges.mesh == nullptr || !judges.mesh->known() || judges.true_normals.empty()) return {};
  const std::array<io::Image<float>, 2> shown = {shown_depth(meshes[0], shape), shown_depth(meshes[1], shape)};
  std::vector<Emitter> lamps;
  NPSIM_RETURN_IF_ERROR(placed_lamps(judges.placement, scene, refined, lamps));
  std::vector<ShadowCaster> casters(kMeshStages + 1);
  const auto cast = [&](const SceneMesh& stage, ImageView<const float> depth, ShadowCaster& caster) -> Status {
    NPSIM_RETURN_IF_ERROR(caster.traced.build(stage.mesh));
    caster.depth = depth;
    return lamps_of_faces(scene, stage, lamps, caster.lamp_of_face);
  };
  for (std::size_t i = 0; i < stages.size(); ++i) {
    const std::size_t which = i + 1 < kMeshStages ? 0 : 1;
    SceneMesh stage = meshes[which];
    stage.mesh = stages[i];
    if (i < 2) {  // one sheet, all background
      stage.vertex_pixel = Span<const std::uint32_t>(sheets[i].pixels.data(), sheets[i].pixels.size());
      stage.background_faces = stage.sheet_faces = stage.mesh.faces.size();
    }
    NPSIM_RETURN_IF_ERROR(
        cast(stage, i < 2 ? refined.surface_depth() : ImageView<const float>(shown[which].view()), casters[i]));
  }
  SceneMesh traced = mesh;
  const std::vector<Face> faces = traced_faces(mesh, traced.background_faces);
  traced.mesh.faces = {faces.data(), faces.size()};
  traced.sheet_faces -= mesh.background_faces - traced.background_faces;
  NPSIM_RETURN_IF_ERROR(cast(traced, ImageView<const float>(shown[0].view()), casters.back()));
  out.shadows =
      shadow_errors(judges.shadows, *judges.mesh, judges.true_depth, judges.true_normals, scene.camera, casters, pool);
  return {};
}

Status TrueDepthAsRefined::take(const SceneView& scene, const RefinedDepth& like, ImageView<const float> truth,
                                const UncertaintyParams& params, ThreadPool& pool) {
  const Shape shape = scene.shape();
  depth = io::Image<float>(shape);
  surface = io::Image<std::uint8_t>(shape);
  uncertain = io::Image<std::uint8_t>(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const bool good = is_valid_depth(truth(x, y)) && !kNoSurfaceLabels.contains(like.labels(x, y));
      surface(x, y) = good ? 1 : 0;
      depth(x, y) = good ? truth(x, y) : 0.0F;
    }
  }
  std::vector<unsigned char> memory(
      std::max(uncertainty_workspace_bytes(params, shape), ground_workspace_bytes(GroundParams{}, shape)));
  Workspace workspace(memory.data(), memory.size());
  UncertaintyOutput out;
  out.mask = uncertain.view();
  NPSIM_RETURN_IF_ERROR(uncertainty(params, ImageView<const float>(depth.view()), like.labels, out, workspace, pool));
  refined = like;
  NPSIM_RETURN_IF_ERROR(estimate_ground(GroundParams{}, ImageView<const float>(depth.view()), like.labels, scene.camera,
                                        workspace, refined.ground));
  refined.depth = depth.view();
  refined.mesh_depth = {};
  refined.confidence = {};
  refined.surface = surface.view();
  refined.uncertain = uncertain.view();
  return {};
}

}  // namespace npsim::tool
