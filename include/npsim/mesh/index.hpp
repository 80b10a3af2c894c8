// SPDX-License-Identifier: Apache-2.0
// From a sheet to an indexed triangle mesh: compact vertices, faces, and the pixel that each vertex came from.
//
// Only vertices with a face are written. Where several fans of faces meet in one vertex and nowhere else (two quads
// touching at a corner), each fan gets its own copy: hence the mesh is a manifold with boundary, and never pinched.
//
// Fans: around a vertex lie four quads, each with two of its edges at the vertex. Going round, these are 8 edge slots;
// a slot is set when the face at that edge of that quad is present. Slots that follow one another belong to faces that
// share an edge, or to one face, so a fan is a cyclic run of set slots. The slots of 64 vertices are eight words of
// bits.
//
// Invariants: order is that of the image (vertices and faces in raster order), whatever the executor does; faces have
// their front towards the camera. Exact. Cost: two passes over the quads, 64 at a time: about three times the time of
// copying the output; tens of instructions for each vertex with several fans. Memory: 4 bytes a pixel and 8 a row.
#ifndef NPSIM_MESH_INDEX_HPP
#define NPSIM_MESH_INDEX_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <initializer_list>

#include "npsim/core/bits.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
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

[[nodiscard]] inline bool have_room(const MeshBuffers& buffers, const MeshSize& size) noexcept {
  return size.vertices <= buffers.vertices.size() && size.faces <= buffers.faces.size() &&
         (buffers.pixels.data() == nullptr || size.vertices <= buffers.pixels.size());
}

[[nodiscard]] constexpr std::size_t index_layer_workspace_bytes(Shape shape) noexcept {
  if (shape.empty()) return kWorkspaceAlignment;
  return allocation_bytes<std::uint32_t>(shape.pixels()) +
         2 * allocation_bytes<std::uint32_t>(static_cast<std::size_t>(shape.height)) + kWorkspaceAlignment;
}

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
  return static_cast<std::uint32_t>(count_bits(bits));
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

// Per quad, whether the face at each of its edges is present: 64 quads.
struct EdgeBits {
  std::uint64_t top = 0;
  std::uint64_t bottom = 0;
  std::uint64_t left = 0;
  std::uint64_t right = 0;
};

// Per vertex, whether it has at least one fan, two, three, four: 64 vertices.
struct FanBits {
  std::uint64_t at_least[4] = {0, 0, 0, 0};

  [[nodiscard]] std::uint32_t count() const noexcept {
    int n = 0;
    for (const std::uint64_t fans : at_least) n += count_bits(fans);
    return static_cast<std::uint32_t>(n);
  }
  [[nodiscard]] std::uint32_t of(int i) const noexcept {
    std::uint32_t n = 0;
    for (const std::uint64_t fans : at_least) n += bit_at(fans, i) ? 1U : 0U;
    return n;
  }
};

// The fans at the vertices of one row, word by word from the left.
class FanRow {
 public:
  FanRow(const ImageView<std::uint8_t>& quads, int y) noexcept
      : above_(row_or_none(quads, y - 1)), below_(row_or_none(quads, y)), width_(quads.width()) {}

  // Of the vertices of word w, which comes after word w - 1.
  template <class F>
  [[nodiscard]] FanBits next(int w) noexcept {
    const EdgeBits c = edges<F>(above_, w);  // the quads whose corner C these vertices are, and so on
    const EdgeBits a = edges<F>(below_, w);
    const EdgeBits d = shifted(last_above_, c);
    const EdgeBits b = shifted(last_below_, a);
    last_above_ = c;
    last_below_ = a;
    const std::uint64_t slot[8] = {c.left, c.bottom, a.top, a.left, b.right, b.top, d.bottom, d.right};
    FanBits fans;
    std::uint64_t all = ~std::uint64_t{0};
    for (int k = 0; k < 8; ++k) {
      all &= slot[k];
      const std::uint64_t start = slot[k] & ~slot[(k + 7) % 8];
      for (int i = 3; i > 0; --i) fans.at_least[i] |= fans.at_least[i - 1] & start;
      fans.at_least[0] |= start;
    }
    fans.at_least[0] |= all;
    return fans;
  }

 private:
  static const std::uint8_t* row_or_none(const ImageView<std::uint8_t>& quads, int y) noexcept {
    return y >= 0 && y < quads.height() && quads.data() != nullptr ? quads.row(y) : nullptr;
  }
  template <class F>
  [[nodiscard]] EdgeBits edges(const std::uint8_t* row, int w) const noexcept {
    const int n = std::min(kWordBits, width_ - kWordBits * w);
    if (row == nullptr || n <= 0) return {};
    const QuadBits q = load_quads<F>(row + kWordBits * w, n);
    return {q.upper, q.lower, (q.anti & q.upper) | (~q.anti & q.lower), (q.anti & q.lower) | (~q.anti & q.upper)};
  }
  [[nodiscard]] static EdgeBits shifted(const EdgeBits& last, const EdgeBits& e) noexcept {
    return {left_bits(last.top, e.top), left_bits(last.bottom, e.bottom), left_bits(last.left, e.left),
            left_bits(last.right, e.right)};
  }
  const std::uint8_t* above_;
  const std::uint8_t* below_;
  int width_;
  EdgeBits last_above_;
  EdgeBits last_below_;
};

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
  for_rows(executor, shape.height, [&](int y) {
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
  if (!have_room(out, size) || size.vertices + first_vertex > 0xFFFFFFFFU) {
    return {StatusCode::capacity_exceeded, "mesh buffers are smaller than mesh_size() says"};
  }
  if (layer.quads.empty()) return {};
  for_rows(executor, shape.height, [&](int y) {
    mesh_detail::write_vertices<F>(layer, y, vertex_start[static_cast<std::size_t>(y)], out, index.row(y));
  });
  for_rows(executor, layer.quads.height(), [&](int y) {
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
