// SPDX-License-Identifier: Apache-2.0
// The scene mesh made ready for rays: what they meet, which lamp a face is part of, and which point stands for a hit.
//
// LayerRays: both layers, the background without its open steps, in the structure for layers (trace/sheet.hpp), and the
// backs of objects, but for those of leaves, in a tree. Faces: two a quad of the background, two a quad of the
// foreground, then the backs. MeshRays: the indexed mesh, however few its faces, in a tree. Faces: the mesh's. Both
// offer  scene  (trace/scene.hpp),  face_count(),  for_each_face(f)  (traced_faces.hpp) and  point_of(hit). Exact,
// given the faces. Cost: a few passes over the layers, or the building of a tree. Memory: the workspace, which they
// point into.
#ifndef NPSIM_PIPELINE_DETAIL_SCENE_RAYS_HPP
#define NPSIM_PIPELINE_DETAIL_SCENE_RAYS_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/scene_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/pipeline/detail/point_of_hit.hpp"
#include "npsim/pipeline/detail/traced_faces.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/trace/bvh.hpp"
#include "npsim/trace/scene.hpp"
#include "npsim/trace/sheet.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct LayerRays {
  JoinedScene<SheetScene, Bvh> scene;
  const SceneMesh* mesh = nullptr;
  FirstVertices first;

  template <class Executor>
  [[nodiscard]] static Status make(const SceneView& view, const SceneMesh& mesh, Workspace& workspace,
                                   Executor& executor, LayerRays& out) {
    Span<SheetTrace> layers;
    NPSIM_RETURN_IF_ERROR(workspace.allocate(2, layers));
    NPSIM_RETURN_IF_ERROR(build_sheet_trace(mesh.open_background, view.camera, workspace, layers[0], executor));
    NPSIM_RETURN_IF_ERROR(build_sheet_trace(mesh.foreground, view.camera, workspace, layers[1], executor));
    NPSIM_RETURN_IF_ERROR(join_layers(layers, out.scene.first));
    out.mesh = &mesh;
    NPSIM_RETURN_IF_ERROR(find_first_vertices(mesh, workspace, out.first));
    const std::size_t backs = mesh.solid_faces - mesh.sheet_faces;
    out.scene.second = Bvh{};
    if (backs == 0) return {};
    return build_bvh({mesh.mesh.vertices, mesh.mesh.faces.sub(mesh.sheet_faces, backs)}, workspace, out.scene.second);
  }

  [[nodiscard]] std::size_t face_count() const noexcept {
    return npsim::face_count(scene.first) + mesh->solid_faces - mesh->sheet_faces;
  }
  template <class F>
  void for_each_face(const F& f) const {
    for_layer_faces(*mesh, f);
  }
  [[nodiscard]] std::uint32_t point_of(const Hit& hit) const noexcept { return PointOfLayerHit{mesh, first}(hit); }
};

struct MeshRays {
  Bvh scene;
  const SceneMesh* mesh = nullptr;
  FirstVertices first;
  Intrinsics camera;

  template <class Executor>
  [[nodiscard]] static Status make(const SceneView& view, const SceneMesh& mesh, Workspace& workspace, Executor&,
                                   MeshRays& out) {
    out.mesh = &mesh;
    out.camera = view.camera;
    NPSIM_RETURN_IF_ERROR(find_first_vertices(mesh, workspace, out.first));
    return build_bvh(mesh.mesh, workspace, out.scene);
  }

  [[nodiscard]] std::size_t face_count() const noexcept { return mesh->mesh.faces.size(); }
  template <class F>
  void for_each_face(const F& f) const {
    for_mesh_faces(*mesh, f);
  }
  [[nodiscard]] std::uint32_t point_of(const Hit& hit) const noexcept {
    return PointOfMeshHit{mesh, first, camera}(hit);
  }
};

// faces: of the mesh, `backs` of them of the objects' backs.
[[nodiscard]] constexpr std::size_t scene_rays_workspace_bytes(TracedFaces traced, Shape shape, std::size_t faces,
                                                               std::size_t backs) noexcept {
  const std::size_t planes = 2 * allocation_bytes<std::uint32_t>(shape.pixels()) + kWorkspaceAlignment;
  if (traced == TracedFaces::mesh) return planes + bvh_workspace_bytes(faces);
  return planes + 2 * sheet_workspace_bytes(shape) + allocation_bytes<SheetTrace>(2) + bvh_workspace_bytes(backs);
}

[[nodiscard]] constexpr std::size_t traced_face_count(TracedFaces traced, Shape shape, std::size_t faces,
                                                      std::size_t backs) noexcept {
  return traced == TracedFaces::mesh ? faces : 2 * std::size_t{sheet_face_count(shape)} + backs;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_SCENE_RAYS_HPP
