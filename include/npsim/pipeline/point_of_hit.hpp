// SPDX-License-Identifier: Apache-2.0
// Which surface point stands for a hit: the vertex of the hit layer that is nearest to it on the image.
//
// On a layer (PointOfLayerHit) that is the face's nearest corner. Faces of the mesh (PointOfMeshHit) may be large
// (simplify_faces.hpp) while points are one per pixel: there it is the vertex at the pixel that the hit lies on, within
// half a pixel. On the backs of objects, which have no pixels of their own, and where rounding leads off the layer, it
// is the nearest corner of the face.
#ifndef NPSIM_PIPELINE_POINT_OF_HIT_HPP
#define NPSIM_PIPELINE_POINT_OF_HIT_HPP

#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/sheet_layer.hpp"
#include "npsim/core/triangle_mesh.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace v1 {

[[nodiscard]] constexpr std::uint32_t nearest_corner(const Face& face, const Hit& hit) noexcept {
  const float w = 1.0F - hit.u - hit.v;
  return w >= hit.u && w >= hit.v ? face.a : (hit.u >= hit.v ? face.b : face.c);
}

struct PointOfMeshHit {
  const SceneMesh* mesh = nullptr;
  Intrinsics camera;

  [[nodiscard]] std::uint32_t operator()(const Hit& hit) const noexcept {
    const Face face = mesh->mesh.faces[hit.face];
    const float w = 1.0F - hit.u - hit.v;
    if (hit.face < mesh->sheet_faces) {
      const Vec3f p =
          mesh->mesh.vertices[face.a] * w + mesh->mesh.vertices[face.b] * hit.u + mesh->mesh.vertices[face.c] * hit.v;
      const ImageView<const std::uint32_t> layer =
          hit.face < mesh->background_faces ? mesh->background_vertex : mesh->foreground_vertex;
      const Vec2f at = project(camera, p);
      // Written so that a NaN fails; the vertices of a face lie within the image.
      if (at.x >= 0.0F && at.y >= 0.0F && at.x < static_cast<float>(layer.width()) &&
          at.y < static_cast<float>(layer.height())) {
        const std::uint32_t vertex = layer(static_cast<int>(at.x), static_cast<int>(at.y));
        if (vertex != kNoVertex) return vertex;
      }
    }
    return nearest_corner(face, hit);
  }
};

// Hits on the implicit faces of both layers, background first, then on the mesh's faces that are no layer's.
struct PointOfLayerHit {
  const SceneMesh* mesh = nullptr;

  [[nodiscard]] std::uint32_t operator()(const Hit& hit) const noexcept {
    const ImageView<const std::uint32_t> planes[2] = {mesh->background_vertex, mesh->foreground_vertex};
    const SheetLayer* layers[2] = {&mesh->background, &mesh->foreground};
    const auto width = static_cast<std::uint32_t>(planes[0].width());
    const std::uint32_t faces = sheet_face_count(planes[0].shape());
    if (hit.face >= 2 * faces) return nearest_corner(mesh->mesh.faces[mesh->sheet_faces + (hit.face - 2 * faces)], hit);
    const std::uint32_t layer = hit.face < faces ? 0 : 1;
    const std::uint32_t pixel = nearest_corner(sheet_face(layers[layer]->quads, hit.face - layer * faces), hit);
    return planes[layer](static_cast<int>(pixel % width), static_cast<int>(pixel / width));
  }
};

}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_PIPELINE_POINT_OF_HIT_HPP
