// SPDX-License-Identifier: Apache-2.0
// From a sheet to an indexed triangle mesh: compact vertices, faces, and the pixel that each vertex came from.
//
// Only vertices with a face are written. Where several fans of faces meet in one vertex and nowhere else (two quads
// touching at a corner), each fan gets its own copy: hence the mesh is a manifold with boundary, and never pinched.
// Invariants: order is that of the image (vertices and faces in raster order), whatever the executor does; faces have
// their front towards the camera. Cost: two passes over the quads. Memory: 4 bytes a pixel and 8 a row.
//
// How fans are told apart: around a vertex lie four quads, each with two of its edges at the vertex. Going round, these
// are 8 edge slots; a slot is set when the face at that edge of that quad is present. Slots that follow one another
// belong to faces that share an edge, or to one face, so a fan is a cyclic run of set slots.
#ifndef NPSIM_MESH_INDEX_HPP
#define NPSIM_MESH_INDEX_HPP

#include <cstddef>
#include <cstdint>
#include <initializer_list>

#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/triangle_mesh.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/mesh/sheet.hpp"
#include "npsim/simd/isa.hpp"

namespace npsim {
inline namespace v1 {

struct MeshSize {
  std::size_t vertices = 0;
  std::size_t faces = 0;
};

// The caller's memory. pixels may be left empty.
struct MeshBuffers {
  Span<Vec3f> vertices;
  Span<Face> faces;
  Span<std::uint32_t> pixels;  // y * width + x of each vertex
};

[[nodiscard]] constexpr std::size_t index_layer_workspace_bytes(Shape shape) noexcept {
  if (shape.empty()) return kWorkspaceAlignment;
  return allocation_bytes<std::uint32_t>(shape.pixels()) +
         2 * allocation_bytes<std::uint32_t>(static_cast<std::size_t>(shape.height)) + kWorkspaceAlignment;
}

inline namespace NPSIM_ISA_NAMESPACE {
namespace mesh_detail {

enum class QuadEdge { top, bottom, left, right };

// Whether the face at an edge of a quad is its upper one.
[[nodiscard]] constexpr bool edge_is_upper(std::uint8_t quad, QuadEdge edge) noexcept {
  const bool anti = (quad & kQuadAntiDiagonal) != 0;
  return edge == QuadEdge::top || (edge == QuadEdge::left && anti) || (edge == QuadEdge::right && !anti);
}
[[nodiscard]] constexpr bool edge_has_face(std::uint8_t quad, QuadEdge edge) noexcept {
  return (quad & (edge_is_upper(quad, edge) ? kQuadUpperFace : kQuadLowerFace)) != 0;
}

// The 8 slots of a vertex, clockwise on the image from the edge above it; each quad around it has two.
struct FanSlot {
  int quad_dx;
  int quad_dy;
  QuadEdge edge;
};
inline constexpr FanSlot kFanSlots[8] = {{0, -1, QuadEdge::left},    {0, -1, QuadEdge::bottom}, {0, 0, QuadEdge::top},
                                         {0, 0, QuadEdge::left},     {-1, 0, QuadEdge::right},  {-1, 0, QuadEdge::top},
                                         {-1, -1, QuadEdge::bottom}, {-1, -1, QuadEdge::right}};

[[nodiscard]] inline unsigned fan_slots(const ImageView<std::uint8_t>& quads, int x, int y) noexcept {
  unsigned slots = 0;
  for (unsigned k = 0; k < 8; ++k) {
    const int qx = x + kFanSlots[k].quad_dx;
    const int qy = y + kFanSlots[k].quad_dy;
    if (quads.contains(qx, qy) && edge_has_face(quads(qx, qy), kFanSlots[k].edge)) slots |= 1U << k;
  }
  return slots;
}

// Slots that begin a run.
[[nodiscard]] constexpr unsigned fan_starts(unsigned slots) noexcept {
  if (slots == 0xFFU) return 1U;
  return slots & ~(((slots << 1U) | (slots >> 7U)) & 0xFFU);
}
[[nodiscard]] constexpr std::uint32_t bit_count(unsigned bits) noexcept {
  std::uint32_t n = 0;
  for (; bits != 0; bits &= bits - 1) ++n;
  return n;
}
// Number, among the fans of a vertex, of the one that holds a slot.
[[nodiscard]] constexpr std::uint32_t fan_of_slot(unsigned slots, unsigned slot) noexcept {
  const unsigned starts = fan_starts(slots);
  for (int step = 0; step < 8 && ((starts >> slot) & 1U) == 0; ++step) slot = (slot + 7U) % 8U;
  return bit_count(starts & ((1U << slot) - 1U));
}

// A slot of corner A, B, C, D (0..3) of a quad that lies in the quad's upper or lower face, if that face has it.
[[nodiscard]] constexpr unsigned corner_slot(std::uint8_t quad, unsigned corner, bool upper) noexcept {
  // First slot of the two that a quad has at its corner: A sees it as lower-right, B as lower-left, and so on.
  constexpr unsigned kFirst[4] = {2, 4, 0, 6};
  const unsigned first = kFirst[corner];
  return edge_is_upper(quad, kFanSlots[first].edge) == upper ? first : first + 1;
}

[[nodiscard]] inline std::uint32_t row_faces(const SheetLayer& layer, int y) noexcept {
  std::uint32_t n = 0;
  if (y >= layer.quads.height() || layer.quads.empty()) return 0;
  for (int x = 0; x < layer.quads.width(); ++x) {
    const unsigned quad = layer.quads(x, y);
    n += bit_count(quad & (kQuadUpperFace | kQuadLowerFace));
  }
  return n;
}

[[nodiscard]] inline std::uint32_t row_vertices(const SheetLayer& layer, int y) noexcept {
  std::uint32_t n = 0;
  if (layer.quads.empty()) return 0;
  for (int x = 0; x < layer.vertices.width(); ++x) n += bit_count(fan_starts(fan_slots(layer.quads, x, y)));
  return n;
}

}  // namespace mesh_detail

// Exact size of the mesh of a layer, from one pass.
[[nodiscard]] inline MeshSize mesh_size(const SheetLayer& layer) noexcept {
  MeshSize size;
  for (int y = 0; y < layer.vertices.height(); ++y) {
    size.vertices += mesh_detail::row_vertices(layer, y);
    size.faces += mesh_detail::row_faces(layer, y);
  }
  return size;
}

// Writes the mesh of one layer to the front of the buffers; its indices start at first_vertex, so that several layers
// can share one vertex array. size says how much was written, or on capacity_exceeded how much is needed.
template <class Executor>
[[nodiscard]] Status index_layer(const SheetLayer& layer, std::uint32_t first_vertex, const MeshBuffers& out,
                                 MeshSize& size, Workspace& workspace, Executor& executor) {
  size = {};
  NPSIM_RETURN_IF_ERROR(validate(layer));
  const Shape shape = layer.vertices.shape();
  if (shape.pixels() > 0x3FFFFFFFU) return {StatusCode::capacity_exceeded, "the image has more than 2^30 pixels"};
  const WorkspaceScope scope(workspace);
  ImageView<std::uint32_t> index;  // of the first fan of each pixel
  Span<std::uint32_t> vertex_start;
  Span<std::uint32_t> face_start;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, index));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(shape.height), vertex_start));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(shape.height), face_start));
  mesh_detail::for_rows(executor, shape.height, [&](int y) {
    vertex_start[static_cast<std::size_t>(y)] = mesh_detail::row_vertices(layer, y);
    face_start[static_cast<std::size_t>(y)] = mesh_detail::row_faces(layer, y);
  });
  for (std::size_t y = 0; y < vertex_start.size(); ++y) {
    const std::uint32_t vertices = vertex_start[y];
    const std::uint32_t faces = face_start[y];
    vertex_start[y] = static_cast<std::uint32_t>(size.vertices);
    face_start[y] = static_cast<std::uint32_t>(size.faces);
    size.vertices += vertices;
    size.faces += faces;
  }
  const bool pixels = out.pixels.data() != nullptr;
  if (size.vertices > out.vertices.size() || size.faces > out.faces.size() ||
      (pixels && size.vertices > out.pixels.size()) || size.vertices + first_vertex > 0xFFFFFFFFU) {
    return {StatusCode::capacity_exceeded, "mesh buffers are smaller than mesh_size() says"};
  }
  if (layer.quads.empty()) return {};
  mesh_detail::for_rows(executor, shape.height, [&](int y) {
    std::uint32_t next = vertex_start[static_cast<std::size_t>(y)];
    for (int x = 0; x < shape.width; ++x) {
      index(x, y) = next;
      const unsigned slots = mesh_detail::fan_slots(layer.quads, x, y);
      for (std::uint32_t fan = mesh_detail::bit_count(mesh_detail::fan_starts(slots)); fan > 0; --fan, ++next) {
        out.vertices[next] = layer.vertices(x, y);
        if (pixels) {
          out.pixels[next] =
              static_cast<std::uint32_t>(y) * static_cast<std::uint32_t>(shape.width) + static_cast<std::uint32_t>(x);
        }
      }
    }
  });
  mesh_detail::for_rows(executor, layer.quads.height(), [&](int y) {
    std::uint32_t next = face_start[static_cast<std::size_t>(y)];
    for (int x = 0; x < layer.quads.width(); ++x) {
      const std::uint8_t quad = layer.quads(x, y);
      for (const bool upper : {true, false}) {
        if ((quad & (upper ? kQuadUpperFace : kQuadLowerFace)) == 0) continue;
        std::uint32_t vertex[4];
        for (unsigned corner = 0; corner < 4; ++corner) {
          const int px = x + static_cast<int>(corner & 1U);
          const int py = y + static_cast<int>(corner >> 1U);
          const unsigned slots = mesh_detail::fan_slots(layer.quads, px, py);
          vertex[corner] = first_vertex + index(px, py) +
                           mesh_detail::fan_of_slot(slots, mesh_detail::corner_slot(quad, corner, upper));
        }
        out.faces[next++] =
            quad_face((quad & kQuadAntiDiagonal) != 0, upper, vertex[0], vertex[1], vertex[2], vertex[3]);
      }
    }
  });
  return {};
}

// Both layers of a scene in one mesh: the background's vertices and faces first, then the foreground's.
template <class Executor>
[[nodiscard]] Status index_layers(const SheetLayer& background, const SheetLayer& foreground, const MeshBuffers& out,
                                  MeshSize& background_size, MeshSize& foreground_size, Workspace& workspace,
                                  Executor& executor) {
  foreground_size = {};
  NPSIM_RETURN_IF_ERROR(index_layer(background, 0, out, background_size, workspace, executor));
  const MeshBuffers rest{
      Span<Vec3f>(out.vertices.data() + background_size.vertices, out.vertices.size() - background_size.vertices),
      Span<Face>(out.faces.data() + background_size.faces, out.faces.size() - background_size.faces),
      out.pixels.data() == nullptr ? Span<std::uint32_t>()
                                   : Span<std::uint32_t>(out.pixels.data() + background_size.vertices,
                                                         out.pixels.size() - background_size.vertices)};
  return index_layer(foreground, static_cast<std::uint32_t>(background_size.vertices), rest, foreground_size, workspace,
                     executor);
}

}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_MESH_INDEX_HPP
