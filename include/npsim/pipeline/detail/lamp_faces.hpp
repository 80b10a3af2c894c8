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
#ifndef NPSIM_PIPELINE_DETAIL_LAMP_FACES_HPP
#define NPSIM_PIPELINE_DETAIL_LAMP_FACES_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "npsim/core/scene_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/sheet_layer.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/render/surface_points.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

[[nodiscard]] constexpr std::size_t mark_faces_workspace_bytes(Shape shape, std::size_t marks,
                                                               std::size_t emitters) noexcept {
  return allocation_bytes<std::uint32_t>(shape.pixels() + 1) + allocation_bytes<std::uint32_t>(emitters) +
         allocation_bytes<std::uint32_t>(marks + 1) + kWorkspaceAlignment;
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

// Tells the lamp of one face after the other.
class FaceMarker {
 public:
  [[nodiscard]] static Status make(const SceneView& scene, const SceneMesh& mesh, Span<const Emitter> emitters,
                                   Workspace& workspace, FaceMarker& out) {
    out.scene_ = &scene;
    out.mesh_ = &mesh;
    out.emitters_ = emitters;
    out.solids_ = mesh.sheet_faces < mesh.mesh.faces.size();
    return chain_lamps(scene, mesh, emitters, workspace, out.lamps_);
  }

  // pixels: of the corners.
  [[nodiscard]] std::uint16_t mark(const Vec3f (&corners)[3], const std::uint32_t (&pixels)[3],
                                   bool of_object) const noexcept {
    std::uint16_t found = 0;
    for (const std::uint32_t pixel : pixels) {
      const std::uint16_t mark = at(scene_->light_index, pixel);
      if (mark != 0 && !is_group(scene_->lights[mark - 1U].cls)) found = mark;
    }
    if (!solids_ || found != 0 || !of_object) return found;
    std::uint32_t e = lamps_.first[at(mesh_->object, pixels[0])];
    if (e == kNoPoint) return 0;
    const Vec3f centre = (corners[0] + corners[1] + corners[2]) * (1.0F / 3.0F);
    for (; e != kNoPoint; e = lamps_.next[e]) {
      const Emitter& lamp = emitters_[e];
      const Vec3f away = centre - lamp.centre_m;
      const float reach2 = dot(lamp.half_u_m, lamp.half_u_m) + dot(lamp.half_v_m, lamp.half_v_m);
      if (dot(away, away) <= reach2) return lamp.mark;
    }
    return 0;
  }

 private:
  template <class T>
  [[nodiscard]] T at(const ImageView<const T>& plane, std::uint32_t pixel) const noexcept {
    const auto width = static_cast<std::uint32_t>(scene_->shape().width);
    return plane(static_cast<int>(pixel % width), static_cast<int>(pixel / width));
  }

  const SceneView* scene_ = nullptr;
  const SceneMesh* mesh_ = nullptr;
  Span<const Emitter> emitters_;
  bool solids_ = false;
  LampsOfObjects lamps_;
};

inline void mark_indexed(const FaceMarker& marker, const SceneMesh& mesh, std::size_t first,
                         Span<std::uint16_t> face_mark) {
  for (std::size_t f = 0; f < face_mark.size(); ++f) {
    const Face face = mesh.mesh.faces[first + f];
    const Vec3f corners[3] = {mesh.mesh.vertices[face.a], mesh.mesh.vertices[face.b], mesh.mesh.vertices[face.c]};
    const std::uint32_t pixels[3] = {mesh.vertex_pixel[face.a], mesh.vertex_pixel[face.b], mesh.vertex_pixel[face.c]};
    face_mark[f] = marker.mark(corners, pixels, first + f >= mesh.background_faces);
  }
}

// face_mark: of a layer's implicit faces, two a quad.
inline void mark_layer(const FaceMarker& marker, const SheetLayer& layer, bool of_object,
                       Span<std::uint16_t> face_mark) {
  const auto width = static_cast<std::uint32_t>(layer.vertices.width());
  std::size_t f = 0;
  for (int y = 0; y < layer.quads.height(); ++y) {
    for (int x = 0; x < layer.quads.width(); ++x) {
      const std::uint8_t quad = layer.quads(x, y);
      const std::uint32_t a = static_cast<std::uint32_t>(y) * width + static_cast<std::uint32_t>(x);
      for (const bool upper : {true, false}) {
        std::uint16_t& mark = face_mark[f++];
        mark = 0;
        if ((quad & (upper ? kQuadUpperFace : kQuadLowerFace)) == 0) continue;
        const Face face = quad_face((quad & kQuadAntiDiagonal) != 0, upper, a, a + 1, a + width, a + width + 1);
        const std::uint32_t pixels[3] = {face.a, face.b, face.c};
        Vec3f corners[3];
        for (int k = 0; k < 3; ++k) {
          corners[k] = layer.vertices(static_cast<int>(pixels[k] % width), static_cast<int>(pixels[k] / width));
        }
        mark = marker.mark(corners, pixels, of_object);
      }
    }
  }
}

}  // namespace lamp_detail

// face_mark: one element per face of the mesh, 0 where it is part of no lamp.
[[nodiscard]] inline Status mark_faces(const SceneView& scene, const SceneMesh& mesh, Span<const Emitter> emitters,
                                       Span<std::uint16_t> face_mark, Workspace& workspace) {
  std::fill(face_mark.begin(), face_mark.end(), std::uint16_t{0});
  if (scene.light_index.empty() || scene.lights.empty()) return {};
  const WorkspaceScope scope(workspace);
  lamp_detail::FaceMarker marker;
  NPSIM_RETURN_IF_ERROR(lamp_detail::FaceMarker::make(scene, mesh, emitters, workspace, marker));
  lamp_detail::mark_indexed(marker, mesh, 0, face_mark);
  return {};
}

// face_mark: of the implicit faces of both layers, background first, then those of the objects' backs.
[[nodiscard]] inline Status mark_layer_faces(const SceneView& scene, const SceneMesh& mesh,
                                             Span<const Emitter> emitters, Span<std::uint16_t> face_mark,
                                             Workspace& workspace) {
  std::fill(face_mark.begin(), face_mark.end(), std::uint16_t{0});
  if (scene.light_index.empty() || scene.lights.empty()) return {};
  const WorkspaceScope scope(workspace);
  lamp_detail::FaceMarker marker;
  NPSIM_RETURN_IF_ERROR(lamp_detail::FaceMarker::make(scene, mesh, emitters, workspace, marker));
  const std::size_t layer = sheet_face_count(scene.shape());
  lamp_detail::mark_layer(marker, mesh.background, false, face_mark.sub(0, layer));
  lamp_detail::mark_layer(marker, mesh.foreground, true, face_mark.sub(layer, layer));
  lamp_detail::mark_indexed(marker, mesh, mesh.sheet_faces, face_mark.sub(2 * layer, face_mark.size() - 2 * layer));
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_LAMP_FACES_HPP
