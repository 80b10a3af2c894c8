// SPDX-License-Identifier: Apache-2.0
// Which surface point stands for a hit: the vertex of the hit layer that is nearest to it on the image.
//
// On a layer (PointOfLayerHit) that is the face's nearest corner, and so it is on a face of the mesh (PointOfMeshHit)
// between neighbouring pixels. Others may be large (simplify_faces.hpp) while points are one per pixel: there it is the
// vertex at the pixel that the hit lies on, within half a pixel. On the backs of objects, which have no pixels of their
// own, and where rounding leads off the layer, it is the nearest corner of the face.
#ifndef NPSIM_PIPELINE_DETAIL_POINT_OF_HIT_HPP
#define NPSIM_PIPELINE_DETAIL_POINT_OF_HIT_HPP

#include <algorithm>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

[[nodiscard]] constexpr std::uint32_t nearest_corner(const Face& face, const Hit& hit) noexcept {
  const float w = 1.0F - hit.u - hit.v;
  return w >= hit.u && w >= hit.v ? face.a : (hit.u >= hit.v ? face.b : face.c);
}

// Per pixel and layer, the number of the first of the vertices there; kNoVertex for none.
struct FirstVertices {
  ImageView<const std::uint32_t> background;
  ImageView<const std::uint32_t> foreground;
};

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

[[nodiscard]] inline Status find_first_vertices(const SceneMesh& mesh, Workspace& workspace, FirstVertices& out) {
  ImageView<std::uint32_t> background;
  ImageView<std::uint32_t> foreground;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(mesh.visible_vertex.shape(), background));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(mesh.visible_vertex.shape(), foreground));
  find_first_vertices(mesh.vertex_pixel.sub(0, mesh.background_vertices), 0, background);
  find_first_vertices(mesh.vertex_pixel.sub(mesh.background_vertices, mesh.sheet_vertices - mesh.background_vertices),
                      static_cast<std::uint32_t>(mesh.background_vertices), foreground);
  out = {background, foreground};
  return {};
}

struct PointOfMeshHit {
  const SceneMesh* mesh = nullptr;
  FirstVertices first;
  Intrinsics camera;

  [[nodiscard]] std::uint32_t operator()(const Hit& hit) const noexcept {
    const Face face = mesh->mesh.faces[hit.face];
    const std::uint32_t nearest = nearest_corner(face, hit);
    if (hit.face >= mesh->sheet_faces) return nearest;
    const ImageView<const std::uint32_t> layer =
        hit.face < mesh->background_faces ? first.background : first.foreground;
    const auto width = static_cast<std::uint32_t>(layer.width());
    if (!between_neighbours(face, width)) {
      const float w = 1.0F - hit.u - hit.v;
      const Vec3f p =
          mesh->mesh.vertices[face.a] * w + mesh->mesh.vertices[face.b] * hit.u + mesh->mesh.vertices[face.c] * hit.v;
      const Vec2f at = project(camera, p);
      // Written so that a NaN fails; the vertices of a face lie within the image.
      if (at.x >= 0.0F && at.y >= 0.0F && at.x < static_cast<float>(layer.width()) &&
          at.y < static_cast<float>(layer.height())) {
        const std::uint32_t vertex = layer(static_cast<int>(at.x), static_cast<int>(at.y));
        if (vertex != kNoVertex) return vertex;
      }
    }
    const std::uint32_t pixel = mesh->vertex_pixel[nearest];
    return layer(static_cast<int>(pixel % width), static_cast<int>(pixel / width));
  }

 private:
  [[nodiscard]] bool between_neighbours(const Face& face, std::uint32_t width) const noexcept {
    const std::uint32_t pixels[3] = {mesh->vertex_pixel[face.a], mesh->vertex_pixel[face.b],
                                     mesh->vertex_pixel[face.c]};
    std::uint32_t least[2] = {pixels[0] % width, pixels[0] / width};
    std::uint32_t most[2] = {least[0], least[1]};
    for (const std::uint32_t pixel : {pixels[1], pixels[2]}) {
      const std::uint32_t at[2] = {pixel % width, pixel / width};
      for (int k = 0; k < 2; ++k) {
        least[k] = std::min(least[k], at[k]);
        most[k] = std::max(most[k], at[k]);
      }
    }
    return most[0] - least[0] <= 1 && most[1] - least[1] <= 1;
  }
};

// Hits on the implicit faces of both layers, background first, then on the mesh's faces that are no layer's.
struct PointOfLayerHit {
  const SceneMesh* mesh = nullptr;
  FirstVertices first;

  [[nodiscard]] std::uint32_t operator()(const Hit& hit) const noexcept {
    const ImageView<const std::uint32_t> planes[2] = {first.background, first.foreground};
    const SheetLayer* layers[2] = {&mesh->background, &mesh->foreground};
    const auto width = static_cast<std::uint32_t>(planes[0].width());
    const std::uint32_t faces = sheet_face_count(planes[0].shape());
    if (hit.face >= 2 * faces) return nearest_corner(mesh->mesh.faces[mesh->sheet_faces + (hit.face - 2 * faces)], hit);
    const std::uint32_t layer = hit.face < faces ? 0 : 1;
    const std::uint32_t pixel = nearest_corner(sheet_face(layers[layer]->quads, hit.face - layer * faces), hit);
    return planes[layer](static_cast<int>(pixel % width), static_cast<int>(pixel / width));
  }
};

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_POINT_OF_HIT_HPP
