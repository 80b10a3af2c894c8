// SPDX-License-Identifier: Apache-2.0
// Which faces of the scene mesh are part of which lamp, so that no lamp is walled in by its own glass or housing.
//
// A face is part of the lamp whose mark the pixel of one of its corners carries: any corner's, so that a lamp of one
// pixel is not walled in by its rim; backs and rims of objects have their fronts' pixels. Where objects are solids and
// a mark lies on one, the faces of that object within the lamp's reach belong to it too: its emitter hangs at the rim
// of the solid (a lantern on its pole) or inside (a lamp behind the curved front of a car). Reach: from the emitter's
// centre to the corner of its patch; of a street lamp also what of that object is kOwnMast_m or less from the line down
// its axis: the mast below a lamp hides but its own foot, though a decimetre before the lamp it would hide half of the
// street. A mast beside a longer arm throws its shadow.
// Marks of pixels go before reach, the first of the emitters before later ones; marks of groups (the body of a car)
// name no lamp and do not count. Cost: the faces, those of objects with lamps times that object's lamps. Memory: 4 bytes
// a pixel and an emitter. Error: none; a rule.
#ifndef NPSIM_PIPELINE_DETAIL_LAMP_FACES_HPP
#define NPSIM_PIPELINE_DETAIL_LAMP_FACES_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "npsim/core/scene_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/pipeline/detail/traced_faces.hpp"
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

inline constexpr float kOwnMast_m = 0.5F;

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
      const std::uint16_t mark = at_pixel(scene_->light_index, pixel);
      if (mark != 0 && !is_group(scene_->lights[mark - 1U].cls)) found = mark;
    }
    if (!solids_ || found != 0 || !of_object) return found;
    std::uint32_t e = lamps_.first[at_pixel(mesh_->object, pixels[0])];
    if (e == kNoPoint) return 0;
    const Vec3f centre = (corners[0] + corners[1] + corners[2]) * (1.0F / 3.0F);
    for (; e != kNoPoint; e = lamps_.next[e]) {
      const Emitter& lamp = emitters_[e];
      const Vec3f away = centre - lamp.centre_m;
      const float reach2 = dot(lamp.half_u_m, lamp.half_u_m) + dot(lamp.half_v_m, lamp.half_v_m);
      if (dot(away, away) <= reach2) return lamp.mark;
      const float down = dot(away, lamp.axis);
      const bool below = is_street_profile(lamp.profile) && down > 0.0F;
      if (below && dot(away, away) - down * down <= kOwnMast_m * kOwnMast_m) return lamp.mark;
    }
    return 0;
  }

 private:
  const SceneView* scene_ = nullptr;
  const SceneMesh* mesh_ = nullptr;
  Span<const Emitter> emitters_;
  bool solids_ = false;
  LampsOfObjects lamps_;
};

}  // namespace lamp_detail

// face_mark: one element for each face that for_each(f) goes through (traced_faces.hpp), 0 where it is part of no lamp.
template <class ForEachFace>
[[nodiscard]] Status mark_lamp_faces(const SceneView& scene, const SceneMesh& mesh, Span<const Emitter> emitters,
                                     const ForEachFace& for_each, Span<std::uint16_t> face_mark, Workspace& workspace) {
  std::fill(face_mark.begin(), face_mark.end(), std::uint16_t{0});
  if (scene.light_index.empty() || scene.lights.empty()) return {};
  const WorkspaceScope scope(workspace);
  lamp_detail::FaceMarker marker;
  NPSIM_RETURN_IF_ERROR(lamp_detail::FaceMarker::make(scene, mesh, emitters, workspace, marker));
  for_each([&](std::size_t face, const Vec3f(&corners)[3], const std::uint32_t(&pixels)[3], bool of_object) {
    face_mark[face] = marker.mark(corners, pixels, of_object);
  });
  return {};
}

// Of the indexed mesh, one element a face.
[[nodiscard]] inline Status mark_faces(const SceneView& scene, const SceneMesh& mesh, Span<const Emitter> emitters,
                                       Span<std::uint16_t> face_mark, Workspace& workspace) {
  return mark_lamp_faces(
      scene, mesh, emitters, [&mesh](const auto& f) { for_mesh_faces(mesh, f); }, face_mark, workspace);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_LAMP_FACES_HPP
