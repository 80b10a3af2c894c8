// SPDX-License-Identifier: Apache-2.0
// Which faces of the scene mesh are part of which lamp, so that no lamp is walled in by its own glass or housing.
//
// A face is part of the lamp whose mark the pixel of one of its corners carries: any corner's, so that a lamp of one
// pixel is not walled in by its rim; backs and rims of objects have their fronts' pixels. Where objects are solids and
// a mark lies on one, the faces of that object within the lamp's reach belong to it too: its emitter hangs at the rim
// of the solid (a lantern on its pole) or inside (a lamp behind the curved front of a car). Reach: from the emitter's
// centre to the corner of its patch. Marks of pixels go before reach, the first of the emitters before later ones;
// marks of groups (the body of a car) name no lamp and do not count. Cost: the faces, those of objects with lamps times
// that object's lamps. Memory: 4 bytes a pixel and an emitter. Error: none; a rule.
#ifndef NPSIM_PIPELINE_LAMP_FACES_HPP
#define NPSIM_PIPELINE_LAMP_FACES_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/pipeline/scene_view.hpp"
#include "npsim/render/surface_points.hpp"

namespace npsim {
inline namespace v1 {

[[nodiscard]] constexpr std::size_t mark_faces_workspace_bytes(const SceneView& scene, std::size_t emitters) noexcept {
  return allocation_bytes<std::uint32_t>(scene.shape().pixels() + 1) + allocation_bytes<std::uint32_t>(emitters) +
         allocation_bytes<std::uint32_t>(scene.lights.size() + 1) + kWorkspaceAlignment;
}

namespace lamp_detail {

// Chains of the emitters of each object: first[object], then next[emitter], kNoPoint at the end.
struct LampsOfObjects {
  Span<std::uint32_t> first;
  Span<std::uint32_t> next;
};

[[nodiscard]] inline Status chain_lamps(const SceneView& scene, const SceneMesh& mesh, Span<const Emitter> emitters,
                                        Workspace& workspace, LampsOfObjects& lamps) {
  const Shape shape = scene.shape();
  NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels() + 1, lamps.first));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(emitters.size(), lamps.next));
  Span<std::uint32_t> object_of_mark;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(scene.lights.size() + 1, object_of_mark));
  std::fill(lamps.first.begin(), lamps.first.end(), kNoPoint);
  std::fill(object_of_mark.begin(), object_of_mark.end(), 0U);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const std::uint16_t mark = scene.light_index(x, y);
      if (mark != 0 && object_of_mark[mark] == 0) object_of_mark[mark] = mesh.object(x, y);
    }
  }
  for (std::size_t e = emitters.size(); e-- > 0;) {
    const std::uint32_t object = emitters[e].mark == 0 ? 0 : object_of_mark[emitters[e].mark];
    lamps.next[e] = kNoPoint;
    if (object == 0) continue;
    lamps.next[e] = lamps.first[object];
    lamps.first[object] = static_cast<std::uint32_t>(e);
  }
  return {};
}

}  // namespace lamp_detail

// face_mark: one element per face of the mesh, 0 where it is part of no lamp.
[[nodiscard]] inline Status mark_faces(const SceneView& scene, const SceneMesh& mesh, Span<const Emitter> emitters,
                                       Span<std::uint16_t> face_mark, Workspace& workspace) {
  std::fill(face_mark.begin(), face_mark.end(), std::uint16_t{0});
  if (scene.light_index.empty() || scene.lights.empty()) return {};
  const WorkspaceScope scope(workspace);
  lamp_detail::LampsOfObjects lamps;
  NPSIM_RETURN_IF_ERROR(lamp_detail::chain_lamps(scene, mesh, emitters, workspace, lamps));
  const bool solids = mesh.sheet_faces < mesh.mesh.faces.size();
  const auto width = static_cast<std::uint32_t>(scene.shape().width);
  const auto at = [&](const auto& plane, std::uint32_t vertex) {
    return plane(static_cast<int>(mesh.vertex_pixel[vertex] % width),
                 static_cast<int>(mesh.vertex_pixel[vertex] / width));
  };
  for (std::size_t f = 0; f < face_mark.size(); ++f) {
    const Face face = mesh.mesh.faces[f];
    for (const std::uint32_t vertex : {face.a, face.b, face.c}) {
      const std::uint16_t mark = at(scene.light_index, vertex);
      if (mark != 0 && !is_group(scene.lights[mark - 1U].cls)) face_mark[f] = mark;
    }
    if (!solids || face_mark[f] != 0 || f < mesh.background_faces) continue;
    std::uint32_t e = lamps.first[at(mesh.object, face.a)];
    if (e == kNoPoint) continue;
    const Vec3f centre =
        (mesh.mesh.vertices[face.a] + mesh.mesh.vertices[face.b] + mesh.mesh.vertices[face.c]) * (1.0F / 3.0F);
    for (; e != kNoPoint && face_mark[f] == 0; e = lamps.next[e]) {
      const Emitter& lamp = emitters[e];
      const Vec3f away = centre - lamp.centre_m;
      const float reach2 = dot(lamp.half_u_m, lamp.half_u_m) + dot(lamp.half_v_m, lamp.half_v_m);
      if (dot(away, away) <= reach2) face_mark[f] = lamp.mark;
    }
  }
  return {};
}

}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_PIPELINE_LAMP_FACES_HPP
