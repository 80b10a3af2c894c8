// SPDX-License-Identifier: Apache-2.0
// Meshes: indexed triangles, and layers over the pixel grid.
#ifndef NPSIM_GEOMETRY_TRIANGLE_MESH_HPP
#define NPSIM_GEOMETRY_TRIANGLE_MESH_HPP

#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Views of an indexed triangle mesh, shared by mesh/ (which makes them) and trace/ (which traces them).
//
// Camera frame, metres. A face is counter-clockwise seen from the side it faces: cross(b - a, c - a) points towards
// the viewer of its front.

struct Face {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  std::uint32_t c = 0;
};

struct TriangleMeshView {
  Span<const Vec3f> vertices;
  Span<const Face> faces;
};

// A layer of the scene: one vertex per pixel at most, and for each quad of neighbouring pixels which of its two
// triangles there are and along which diagonal it is cut. The index buffer is implicit (3 bits a quad) until
// mesh/index.hpp is asked. Shared by mesh/ (which makes layers) and trace/ (which traces them).
//
// Invariants: a missing vertex is exactly {0, 0, 0}; a face exists only where its three vertices do; as every vertex
// lies on its pixel's ray (or, for a layer completed in position, on its pixel row's plane in the order of the
// columns), every face has its front towards the camera; an edge has at most two faces, by construction.

// One single-valued layer of surface over the image.
struct SheetLayer {
  ImageView<Vec3f> vertices;      // camera frame, m; {0, 0, 0} where there is no vertex
  ImageView<std::uint8_t> quads;  // quad_shape(vertices.shape()); the quad of pixels (x, y) .. (x + 1, y + 1)
};

// Bits of a quad with corners A upper left, B upper right, C lower left, D lower right.
inline constexpr std::uint8_t kQuadAntiDiagonal = 1;  // cut along B-C; else along A-D
inline constexpr std::uint8_t kQuadUpperFace = 2;     // the triangle with edge A-B is present
inline constexpr std::uint8_t kQuadLowerFace = 4;     // the triangle with edge C-D is present

[[nodiscard]] constexpr bool has_vertex(const Vec3f& v) noexcept { return v.z > 0.0F; }

[[nodiscard]] constexpr Shape quad_shape(Shape pixels) noexcept {
  return {pixels.width > 1 ? pixels.width - 1 : 0, pixels.height > 1 ? pixels.height - 1 : 0};
}

// The upper or lower triangle of a quad, with its front towards the camera.
[[nodiscard]] constexpr Face quad_face(bool anti, bool upper, std::uint32_t a, std::uint32_t b, std::uint32_t c,
                                       std::uint32_t d) noexcept {
  if (upper) return anti ? Face{a, c, b} : Face{a, d, b};
  return anti ? Face{b, c, d} : Face{a, c, d};
}

// Implicit faces: 2 (y quads.width() + x) is the upper, one more the lower triangle of quad (x, y). Their corners as
// pixels, y * width + x.
[[nodiscard]] constexpr std::uint32_t sheet_face_count(Shape pixels) noexcept {
  return quad_shape(pixels).empty() ? 0U : 2U * static_cast<std::uint32_t>(quad_shape(pixels).pixels());
}
template <class Quad>  // std::uint8_t, const or not
[[nodiscard]] Face sheet_face(const ImageView<Quad>& quads, std::uint32_t face) noexcept {
  const auto width = static_cast<std::uint32_t>(quads.width());
  const std::uint32_t x = face / 2 % width;
  const std::uint32_t y = face / 2 / width;
  const bool anti = (quads(static_cast<int>(x), static_cast<int>(y)) & kQuadAntiDiagonal) != 0;
  const std::uint32_t a = y * (width + 1) + x;
  return quad_face(anti, face % 2 == 0, a, a + 1, a + width + 1, a + width + 2);
}

[[nodiscard]] inline Status validate(const SheetLayer& layer) noexcept {
  if (layer.vertices.empty()) return {StatusCode::invalid_argument, "a sheet needs at least one pixel"};
  const Shape quads = quad_shape(layer.vertices.shape());
  if (quads.empty()) return {};  // a single row or column has no quad
  if (layer.quads.empty() || layer.quads.shape() != quads) {
    return {StatusCode::shape_mismatch, "the quads of a sheet are one less than its pixels, both ways"};
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_GEOMETRY_TRIANGLE_MESH_HPP
