// SPDX-License-Identifier: Apache-2.0
// From a sheet to an indexed triangle mesh: compact vertices, faces, and the pixel that each vertex came from.
//
// Only vertices with a face are written. Where several fans of faces meet in one vertex and nowhere else (two quads
// touching at a corner), each fan gets its own copy: hence the mesh is a manifold with boundary, and never pinched.
// Invariants: order is that of the image (vertices and faces in raster order), whatever the executor does; faces have
// their front towards the camera. Exact. Cost: two passes over the quads, 64 at a time: about three times the time of
// copying the output. Memory: 4 bytes a pixel and 8 a row.
#ifndef NPSIM_MESH_INDEX_HPP
#define NPSIM_MESH_INDEX_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <initializer_list>

#include "npsim/core/bits.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/mesh/detail/connect.hpp"
#include "npsim/mesh/detail/index_fans.hpp"
#include "npsim/mesh/detail/layer.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

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

namespace mesh_detail {

inline constexpr std::uint32_t kManyFans = 0x80000000U;  // flag of an index: the pixel has several vertices

template <class F>
[[nodiscard]] MeshSize row_size(const SheetLayer& layer, int y) noexcept {
  MeshSize size;
  if (layer.quads.empty()) return size;
  FanRow row(layer.quads, y);
  for (int w = 0; w < bit_words(layer.vertices.width()); ++w) size.vertices += row.next<F>(w).count();
  for (int x = 0; y < layer.quads.height() && x < layer.quads.width(); x += kWordBits) {
    const QuadBits q = load_quads<F>(layer.quads.row(y) + x, std::min(kWordBits, layer.quads.width() - x));
    size.faces += static_cast<std::size_t>(count_bits(q.upper) + count_bits(q.lower));
  }
  return size;
}

// Writes the vertices of row y from number `next` on, and the number of each pixel's first one.
template <class F>
void write_vertices(const SheetLayer& layer, int y, std::uint32_t next, const MeshBuffers& out,
                    std::uint32_t* index) noexcept {
  const int width = layer.vertices.width();
  const Vec3f* vertices = layer.vertices.row(y);
  const auto pixel = static_cast<std::uint32_t>(y) * static_cast<std::uint32_t>(width);
  const bool pixels = out.pixels.data() != nullptr;
  FanRow row(layer.quads, y);
  for (int w = 0; w < bit_words(width); ++w) {
    const FanBits fans = row.next<F>(w);
    const int x = kWordBits * w;
    const int n = std::min(kWordBits, width - x);
    if (fans.at_least[0] == low_bits(n) && fans.at_least[1] == 0) {
      std::copy(vertices + x, vertices + x + n, out.vertices.data() + next);
      for (int i = 0; i < n; ++i) index[x + i] = next + static_cast<std::uint32_t>(i);
      if (pixels) {
        std::uint32_t* to = out.pixels.data() + next;
        for (int i = 0; i < n; ++i) to[i] = pixel + static_cast<std::uint32_t>(x + i);
      }
      next += static_cast<std::uint32_t>(n);
      continue;
    }
    for_set_bits(fans.at_least[0], [&](int i) {
      const std::uint32_t copies = fans.of(i);
      index[x + i] = copies > 1 ? next | kManyFans : next;
      for (std::uint32_t k = 0; k < copies; ++k, ++next) {
        out.vertices[next] = vertices[x + i];
        if (pixels) out.pixels[next] = pixel + static_cast<std::uint32_t>(x + i);
      }
    });
  }
}

// The number of the vertex that a face of the quad (x, y) has at one of its corners, from that of the pixel's first.
[[nodiscard]] inline std::uint32_t corner_vertex(const SheetLayer& layer, std::uint32_t first, int x, int y,
                                                 unsigned corner, bool upper) noexcept {
  if ((first & kManyFans) == 0) return first;
  const unsigned slots = fan_slots(layer.quads, x + static_cast<int>(corner & 1U), y + static_cast<int>(corner >> 1U));
  return (first & ~kManyFans) + fan_of_slot(slots, corner_slot(layer.quads(x, y), corner, upper));
}

// Writes the faces of the quads of row y. upper, lower: the numbers of the pixels' first vertices.
inline void write_faces(const SheetLayer& layer, int y, const std::uint32_t* upper, const std::uint32_t* lower,
                        std::uint32_t first_vertex, Face* out) noexcept {
  constexpr std::uint8_t kBoth = kQuadUpperFace | kQuadLowerFace;
  const std::uint8_t* quads = layer.quads.row(y);
  for (int x = 0; x < layer.quads.width(); ++x) {
    const std::uint8_t quad = quads[x];
    if ((quad & kBoth) == 0) continue;
    const bool anti = (quad & kQuadAntiDiagonal) != 0;
    if ((quad & kBoth) == kBoth && ((upper[x] | upper[x + 1] | lower[x] | lower[x + 1]) & kManyFans) == 0) {
      const std::uint32_t a = first_vertex + upper[x];
      const std::uint32_t b = first_vertex + upper[x + 1];
      const std::uint32_t c = first_vertex + lower[x];
      const std::uint32_t d = first_vertex + lower[x + 1];
      out[0] = {a, anti ? c : d, b};  // quad_face() without its branches
      out[1] = {anti ? b : a, c, d};
      out += 2;
      continue;
    }
    const std::uint32_t first[4] = {upper[x], upper[x + 1], lower[x], lower[x + 1]};
    for (const bool is_upper : {true, false}) {
      if ((quad & (is_upper ? kQuadUpperFace : kQuadLowerFace)) == 0) continue;
      const Face corners = quad_face(anti, is_upper, 0, 1, 2, 3);
      const auto vertex = [&](std::uint32_t corner) {
        return first_vertex + corner_vertex(layer, first[corner], x, y, corner, is_upper);
      };
      *out++ = {vertex(corners.a), vertex(corners.b), vertex(corners.c)};
    }
  }
}

}  // namespace mesh_detail

// Exact size of the mesh of a layer, from one pass.
template <class F = simd::F32>
[[nodiscard]] MeshSize mesh_size(const SheetLayer& layer) noexcept {
  MeshSize size;
  for (int y = 0; y < layer.vertices.height(); ++y) {
    const MeshSize row = mesh_detail::row_size<F>(layer, y);
    size.vertices += row.vertices;
    size.faces += row.faces;
  }
  return size;
}

// Writes the mesh of one layer to the front of the buffers; its indices start at first_vertex, so that several layers
// can share one vertex array. size says how much was written, or on capacity_exceeded how much is needed.
template <class F = simd::F32, class Executor>
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
    const MeshSize row = mesh_detail::row_size<F>(layer, y);
    vertex_start[static_cast<std::size_t>(y)] = static_cast<std::uint32_t>(row.vertices);
    face_start[static_cast<std::size_t>(y)] = static_cast<std::uint32_t>(row.faces);
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
    mesh_detail::write_vertices<F>(layer, y, vertex_start[static_cast<std::size_t>(y)], out, index.row(y));
  });
  mesh_detail::for_rows(executor, layer.quads.height(), [&](int y) {
    mesh_detail::write_faces(layer, y, index.row(y), index.row(y + 1), first_vertex,
                             out.faces.data() + face_start[static_cast<std::size_t>(y)]);
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

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_INDEX_HPP
