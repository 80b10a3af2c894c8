// SPDX-License-Identifier: Apache-2.0
// The faces that rays meet, one after the other, in the order of their numbers (scene_rays.hpp).
//
// f(number, corners, pixels, of_object): pixels as y * width + x, of the corners; of_object: not of the background.
#ifndef NPSIM_PIPELINE_DETAIL_TRACED_FACES_HPP
#define NPSIM_PIPELINE_DETAIL_TRACED_FACES_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/pipeline/reconstruct.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Of the pixel y * width + x.
template <class T>
[[nodiscard]] T at_pixel(const ImageView<const T>& plane, std::uint32_t pixel) noexcept {
  const auto width = static_cast<std::uint32_t>(plane.width());
  return plane(static_cast<int>(pixel % width), static_cast<int>(pixel / width));
}

namespace traced_detail {

// Of the indexed mesh, faces [first, last); the first of them has the number `number`.
template <class F>
void for_indexed(const SceneMesh& mesh, std::size_t first, std::size_t last, std::size_t number, const F& f) {
  for (std::size_t i = first; i < last; ++i) {
    const Face face = mesh.mesh.faces[i];
    const Vec3f corners[3] = {mesh.mesh.vertices[face.a], mesh.mesh.vertices[face.b], mesh.mesh.vertices[face.c]};
    const std::uint32_t pixels[3] = {mesh.vertex_pixel[face.a], mesh.vertex_pixel[face.b], mesh.vertex_pixel[face.c]};
    f(number + (i - first), corners, pixels, i >= mesh.background_faces);
  }
}

// Of a layer's implicit faces, two a quad, those that are there.
template <class F>
void for_layer(const SheetLayer& layer, bool of_object, std::size_t number, const F& f) {
  const ImageView<const Vec3f> vertices = layer.vertices;
  const auto width = static_cast<std::uint32_t>(vertices.width());
  for (int y = 0; y < layer.quads.height(); ++y) {
    for (int x = 0; x < layer.quads.width(); ++x, number += 2) {
      const std::uint8_t quad = layer.quads(x, y);
      const std::uint32_t a = static_cast<std::uint32_t>(y) * width + static_cast<std::uint32_t>(x);
      for (const bool upper : {true, false}) {
        if ((quad & (upper ? kQuadUpperFace : kQuadLowerFace)) == 0) continue;
        const Face face = quad_face((quad & kQuadAntiDiagonal) != 0, upper, a, a + 1, a + width, a + width + 1);
        const std::uint32_t pixels[3] = {face.a, face.b, face.c};
        const Vec3f corners[3] = {at_pixel(vertices, face.a), at_pixel(vertices, face.b), at_pixel(vertices, face.c)};
        f(number + (upper ? 0 : 1), corners, pixels, of_object);
      }
    }
  }
}

}  // namespace traced_detail

// MeshRays: the whole mesh.
template <class F>
void for_mesh_faces(const SceneMesh& mesh, const F& f) {
  traced_detail::for_indexed(mesh, 0, mesh.mesh.faces.size(), 0, f);
}

// LayerRays: the faces of both layers, background first, then those of the objects' backs that rays meet.
template <class F>
void for_layer_faces(const SceneMesh& mesh, const F& f) {
  const std::size_t layer = sheet_face_count(mesh.object.shape());
  traced_detail::for_layer(mesh.background, false, 0, f);
  traced_detail::for_layer(mesh.foreground, true, layer, f);
  traced_detail::for_indexed(mesh, mesh.sheet_faces, mesh.solid_faces, 2 * layer, f);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_TRACED_FACES_HPP
