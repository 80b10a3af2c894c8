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

// Slot k of a vertex is that of an edge of one of the quads around it, clockwise on the image from the edge above. Each
// quad has two of them at its corner: A sees the quad from upper left, and has slots 2 and 3, and so on.
inline constexpr QuadEdge kSlotEdge[8] = {QuadEdge::left,  QuadEdge::bottom, QuadEdge::top,    QuadEdge::left,
                                          QuadEdge::right, QuadEdge::top,    QuadEdge::bottom, QuadEdge::right};
inline constexpr unsigned kFirstSlot[4] = {2, 4, 0, 6};  // of corners A, B, C, D
inline constexpr unsigned kAllSlots = 0xFF;

[[nodiscard]] constexpr unsigned corner_slots(std::uint8_t quad, unsigned corner) noexcept {
  const unsigned first = kFirstSlot[corner];
  return (edge_has_face(quad, kSlotEdge[first]) ? 1U << first : 0U) |
         (edge_has_face(quad, kSlotEdge[first + 1]) ? 2U << first : 0U);
}

[[nodiscard]] inline unsigned fan_slots(const ImageView<std::uint8_t>& quads, int x, int y) noexcept {
  const bool left = x > 0;
  const bool right = x < quads.width();
  const std::uint8_t* above = y > 0 ? quads.row(y - 1) + x : nullptr;
  const std::uint8_t* below = y < quads.height() ? quads.row(y) + x : nullptr;
  const std::uint8_t a = below != nullptr && right ? below[0] : std::uint8_t{0};  // the quad whose corner A this is
  const std::uint8_t b = below != nullptr && left ? below[-1] : std::uint8_t{0};
  const std::uint8_t c = above != nullptr && right ? above[0] : std::uint8_t{0};
  const std::uint8_t d = above != nullptr && left ? above[-1] : std::uint8_t{0};
  constexpr unsigned kBoth = kQuadUpperFace | kQuadLowerFace;
  if ((static_cast<unsigned>(a & b) & static_cast<unsigned>(c & d) & kBoth) == kBoth) return kAllSlots;
  if ((static_cast<unsigned>(a | b) | static_cast<unsigned>(c | d)) == 0) return 0;
  return corner_slots(a, 0) | corner_slots(b, 1) | corner_slots(c, 2) | corner_slots(d, 3);
}

// Slots that begin a run.
[[nodiscard]] constexpr unsigned fan_starts(unsigned slots) noexcept {
  if (slots == kAllSlots) return 1U;
  return slots & ~(((slots << 1U) | (slots >> 7U)) & kAllSlots);
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

// The slot of a corner of a quad that lies in the quad's upper or lower face.
[[nodiscard]] constexpr unsigned corner_slot(std::uint8_t quad, unsigned corner, bool upper) noexcept {
  const unsigned first = kFirstSlot[corner];
  return edge_is_upper(quad, kSlotEdge[first]) == upper ? first : first + 1;
}

inline constexpr std::uint32_t kManyFans = 0x80000000U;  // flag of an index: the pixel has several vertices

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
  if (shape.pixels() > 0x1FFFFFFFU) return {StatusCode::capacity_exceeded, "the image has 2^29 pixels or more"};
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
      const std::uint32_t fans =
          mesh_detail::bit_count(mesh_detail::fan_starts(mesh_detail::fan_slots(layer.quads, x, y)));
      index(x, y) = fans > 1 ? next | mesh_detail::kManyFans : next;
      for (std::uint32_t fan = 0; fan < fans; ++fan, ++next) {
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
          vertex[corner] = first_vertex + (index(px, py) & ~mesh_detail::kManyFans);
          if ((index(px, py) & mesh_detail::kManyFans) == 0) continue;
          vertex[corner] += mesh_detail::fan_of_slot(mesh_detail::fan_slots(layer.quads, px, py),
                                                     mesh_detail::corner_slot(quad, corner, upper));
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
