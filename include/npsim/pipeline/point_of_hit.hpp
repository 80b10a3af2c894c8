// SPDX-License-Identifier: Apache-2.0
// Which surface point stands for a hit on the scene mesh: the vertex of the hit layer at the pixel that the hit lies
// on.
//
// Faces may be large (simplify_faces.hpp), points are one per pixel, so the light of a hit is that of a point within
// half a pixel. On the backs of objects, which have no pixels of their own, and where rounding leads off the layer, it
// is the nearest corner of the face.
#ifndef NPSIM_PIPELINE_POINT_OF_HIT_HPP
#define NPSIM_PIPELINE_POINT_OF_HIT_HPP

#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/triangle_mesh.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace v1 {

struct PointOfHit {
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
    return w >= hit.u && w >= hit.v ? face.a : (hit.u >= hit.v ? face.b : face.c);
  }
};

}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_PIPELINE_POINT_OF_HIT_HPP
