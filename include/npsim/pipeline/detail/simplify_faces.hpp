// SPDX-License-Identifier: Apache-2.0
// Fewer faces for a layer of the mesh, with all its vertices left as the points that light is computed at.
//
// The faces of the layer give way to those of simplify_layer() (mesh/simplify.hpp), between the same vertices. Where
// rays are to meet the new faces, the vertices in between move along their rays of view onto them, so that no point
// lies behind the surface that it belongs to. Borders between labels and the outlines of lamps stay exactly where they are.
// Invariants: vertices keep their order and pixels; those of the new faces keep their bits. Error: that of
// simplify_layer(), depth by SimplifyParams::max_relative_depth_error at most, and one rounding of unproject().
// Cost: simplify_layer() and two passes. Memory: simplify_faces_workspace_bytes().
#ifndef NPSIM_PIPELINE_DETAIL_SIMPLIFY_FACES_HPP
#define NPSIM_PIPELINE_DETAIL_SIMPLIFY_FACES_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/index.hpp"
#include "npsim/mesh/simplify.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// For a layer of that size.
[[nodiscard]] constexpr std::size_t simplify_faces_workspace_bytes(const SimplifyParams& params, Shape shape,
                                                                   const MeshSize& size) noexcept {
  return 2 * allocation_bytes<std::uint32_t>(shape.pixels()) + allocation_bytes<Vec3f>(size.vertices) +
         2 * allocation_bytes<std::uint32_t>(size.vertices) + allocation_bytes<Face>(size.faces) +
         simplify_layer_workspace_bytes(params, shape) + kWorkspaceAlignment;
}

// What a border of faces must keep apart: the label and the lamp of each pixel. labels, and light_index (position of a
// lamp's mark + 1 at each pixel, 0 for none): may be empty.
inline void label_and_lamp(ImageView<const Label> labels, ImageView<const std::uint16_t> light_index,
                           ImageView<std::uint32_t> ids) noexcept {
  for (int y = 0; y < ids.height(); ++y) {
    for (int x = 0; x < ids.width(); ++x) {
      const std::uint32_t light = light_index.empty() ? 0U : light_index(x, y);
      ids(x, y) = (light << 8U) | (labels.empty() ? 0U : labels(x, y));
    }
  }
}

// part: what index_layer() wrote for the layer, with indices that start at first_vertex; its first face_count faces are
// replaced, fewer are left. labels and light_index: see label_and_lamp().
template <class Executor>
[[nodiscard]] Status simplify_faces(const SimplifyParams& params, bool move_vertices, const SheetLayer& layer,
                                    ImageView<const Label> labels, ImageView<const std::uint16_t> light_index,
                                    const Intrinsics& intrinsics, std::uint32_t first_vertex, const MeshBuffers& part,
                                    std::size_t& face_count, Workspace& workspace, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(layer));
  const Shape shape = layer.vertices.shape();
  if ((!labels.empty() && labels.shape() != shape) || (!light_index.empty() && light_index.shape() != shape) ||
      part.pixels.size() != part.vertices.size() || face_count > part.faces.size()) {
    return {StatusCode::shape_mismatch, "fewer faces: labels, lamps and layer must have one shape, vertices one pixel"};
  }
  const WorkspaceScope scope(workspace);
  ImageView<std::uint32_t> ids;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, ids));
  label_and_lamp(labels, light_index, ids);
  MeshBuffers thin;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(part.vertices.size(), thin.vertices));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(part.vertices.size(), thin.pixels));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(face_count, thin.faces));
  SimplifyResult result;
  NPSIM_RETURN_IF_ERROR(simplify_layer(params, layer, ImageView<const std::uint32_t>(ids), intrinsics, 0, thin, result,
                                       workspace, executor));
  thin.vertices = thin.vertices.sub(0, result.size.vertices);
  thin.pixels = thin.pixels.sub(0, result.size.vertices);
  thin.faces = thin.faces.sub(0, result.size.faces);

  // Both meshes have their vertices in the order of the pixels, several of one pixel in that of its fans.
  Span<std::uint32_t> original;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(thin.vertices.size(), original));
  std::size_t full = 0;
  for (std::size_t v = 0; v < thin.vertices.size(); ++v, ++full) {
    while (full < part.pixels.size() && part.pixels[full] != thin.pixels[v]) ++full;
    if (full == part.pixels.size())
      return {StatusCode::invalid_argument, "fewer faces: the vertices are not the layer's"};
    original[v] = static_cast<std::uint32_t>(full);
  }
  if (move_vertices) {
    ImageView<float> depth;
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, depth));
    NPSIM_RETURN_IF_ERROR(simplified_depth({thin.vertices, thin.faces}, thin.pixels, depth));
    const auto width = static_cast<std::uint32_t>(shape.width);
    std::size_t next = 0;  // vertex of the thin mesh
    for (std::size_t v = 0; v < part.vertices.size(); ++v) {
      if (next < original.size() && original[next] == v) {
        ++next;
        continue;
      }
      const auto x = static_cast<int>(part.pixels[v] % width);
      const auto y = static_cast<int>(part.pixels[v] / width);
      if (depth(x, y) > 0.0F) part.vertices[v] = unproject_pixel(intrinsics, x, y, depth(x, y));
    }
  }
  for (std::size_t f = 0; f < thin.faces.size(); ++f) {
    const Face& face = thin.faces[f];
    part.faces[f] = {first_vertex + original[face.a], first_vertex + original[face.b], first_vertex + original[face.c]};
  }
  face_count = thin.faces.size();
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_SIMPLIFY_FACES_HPP
