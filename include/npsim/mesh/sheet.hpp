// SPDX-License-Identifier: Apache-2.0
// The sheet: one vertex per pixel on the ray of its centre, two triangles per quad of neighbouring pixels.
//
//   V(x, y) = [(u - cx) d / fx, (v - cy) d / fy, d],  u = x + 0.5, v = y + 0.5        equation (3.1), offsets 0
//
// (3.1) after Hu et al., "Worldsheet", ICCV 2021, with general intrinsics in place of a field of view. A quad is cut
// along the diagonal with the smaller depth jump; a tie takes the one from upper left to lower right. With three
// vertices it gets the one triangle they allow. The index buffer is implicit (3 bits a quad) until index.hpp is asked.
//
// Invariants: a missing vertex is exactly {0, 0, 0}; a face exists only where its three vertices do; as every vertex
// lies on its pixel's ray (or, for a sheet completed in position, on its pixel row's plane in the order of the
// columns), every face has its front towards the camera; an edge has at most two faces, by construction.
// Cost: one pass over the pixels, one over the quads. Memory: none besides the output. Error: of unproject(), at most
// 2.5 ulp a component (one subtraction, one product, one quotient).
#ifndef NPSIM_MESH_SHEET_HPP
#define NPSIM_MESH_SHEET_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/triangle_mesh.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/simd/isa.hpp"

namespace npsim {
inline namespace v1 {

// One single-valued layer of surface over the image.
struct SheetLayer {
  ImageView<Vec3f> vertices;      // camera frame, m; {0, 0, 0} where there is no vertex
  ImageView<std::uint8_t> quads;  // quad_shape(vertices.shape()); the quad of pixels (x, y) .. (x + 1, y + 1)
};

// Bits of a quad with corners A upper left, B upper right, C lower left, D lower right.
inline constexpr std::uint8_t kQuadAntiDiagonal = 1;  // cut along B-C; else along A-D
inline constexpr std::uint8_t kQuadUpperFace = 2;     // the triangle with edge A-B is present
inline constexpr std::uint8_t kQuadLowerFace = 4;     // the triangle with edge C-D is present

struct SheetParams {
  // Depth outside this range is treated as missing. The range is what keeps areas and normals representable.
  float min_depth_m = 0.01F;
  float max_depth_m = 1.0e6F;
};

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

[[nodiscard]] inline Status validate(const SheetLayer& layer) noexcept {
  if (layer.vertices.empty()) return {StatusCode::invalid_argument, "a sheet needs at least one pixel"};
  const Shape quads = quad_shape(layer.vertices.shape());
  if (quads.empty()) return {};  // a single row or column has no quad
  if (layer.quads.empty() || layer.quads.shape() != quads) {
    return {StatusCode::shape_mismatch, "the quads of a sheet are one less than its pixels, both ways"};
  }
  return {};
}

inline namespace NPSIM_ISA_NAMESPACE {
namespace mesh_detail {

inline constexpr std::size_t kRowsPerChunk = 16;

template <class Executor, class F>
void for_rows(Executor& executor, int rows, F&& f) {
  executor.for_chunks(rows > 0 ? static_cast<std::size_t>(rows) : 0, kRowsPerChunk,
                      [&f](std::size_t begin, std::size_t end) {
                        for (std::size_t y = begin; y < end; ++y) f(static_cast<int>(y));
                      });
}

// A mask that may be left out.
template <class T>
[[nodiscard]] inline bool mask_fits(const ImageView<T>& mask, Shape shape) noexcept {
  return mask.data() == nullptr || mask.shape() == shape;
}
[[nodiscard]] inline bool mask_at(const ImageView<const std::uint8_t>& mask, int x, int y, bool missing) noexcept {
  return mask.data() == nullptr ? missing : mask(x, y) != 0;
}

// Bits of one quad from the depths of its corners, 0 (or less) where there is no vertex.
[[nodiscard]] inline std::uint8_t connect_quad(float a, float b, float c, float d) noexcept {
  const int count = (a > 0 ? 1 : 0) + (b > 0 ? 1 : 0) + (c > 0 ? 1 : 0) + (d > 0 ? 1 : 0);
  if (count < 3) return 0;
  if (count == 4) {
    const bool anti = std::fabs(b - c) < std::fabs(a - d);
    return static_cast<std::uint8_t>(kQuadUpperFace | kQuadLowerFace | (anti ? kQuadAntiDiagonal : 0));
  }
  if (!(a > 0)) return kQuadAntiDiagonal | kQuadLowerFace;
  if (!(d > 0)) return kQuadAntiDiagonal | kQuadUpperFace;
  return !(b > 0) ? kQuadLowerFace : kQuadUpperFace;
}

// Every face that the vertices of a layer allow.
template <class Executor>
void connect_layer(const SheetLayer& layer, Executor& executor) {
  for_rows(executor, quad_shape(layer.vertices.shape()).height, [&layer](int y) {
    const Vec3f* upper = layer.vertices.row(y);
    const Vec3f* lower = layer.vertices.row(y + 1);
    for (int x = 0; x + 1 < layer.vertices.width(); ++x) {
      layer.quads(x, y) = connect_quad(upper[x].z, upper[x + 1].z, lower[x].z, lower[x + 1].z);
    }
  });
}

}  // namespace mesh_detail

// depth: z-depth in m, any invalid value allowed. surface: 0 where the pixel shows no surface (sky, ego vehicle);
// an empty view means that every pixel does.
template <class Executor>
[[nodiscard]] Status build_sheet(const SheetParams& params, ImageView<const float> depth,
                                 ImageView<const std::uint8_t> surface, const Intrinsics& intrinsics,
                                 const SheetLayer& sheet, Executor& executor) {
  if (!(params.min_depth_m > 0.0F) || !(params.max_depth_m > params.min_depth_m) ||
      !std::isfinite(params.max_depth_m)) {
    return {StatusCode::invalid_argument, "sheet depth range must satisfy 0 < min < max < infinity"};
  }
  NPSIM_RETURN_IF_ERROR(validate(intrinsics));
  NPSIM_RETURN_IF_ERROR(validate(sheet));
  const Shape shape = sheet.vertices.shape();
  if (depth.data() == nullptr || depth.shape() != shape || !mesh_detail::mask_fits(surface, shape)) {
    return {StatusCode::shape_mismatch, "depth, surface mask and sheet must have one shape"};
  }
  mesh_detail::for_rows(executor, shape.height, [&](int y) {
    for (int x = 0; x < shape.width; ++x) {
      const float z = depth(x, y);
      Vec3f vertex;
      // A NaN fails the first comparison.
      if (z >= params.min_depth_m && z <= params.max_depth_m && mesh_detail::mask_at(surface, x, y, true)) {
        vertex = unproject_pixel(intrinsics, x, y, z);
        if (!is_finite(vertex)) vertex = {};  // absurd intrinsics
      }
      sheet.vertices(x, y) = vertex;
    }
  });
  mesh_detail::connect_layer(sheet, executor);
  return {};
}

}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_MESH_SHEET_HPP
