// SPDX-License-Identifier: Apache-2.0
// A sheet with as few faces as a bound on its depth allows, indexed.
//
// The vertices that stay are some of the sheet's, each on the ray of its pixel; the faces cover the same part of the
// image. So the surface is moved along the rays alone: at every pixel the reprojected error is that of the sheet's own
// vertices, and depth differs by no more than max_relative_depth_error anywhere, between pixel centres too
// (detail/simplify/bound.hpp). What stays exactly:
// - the rim of the layer, holes included: the same line on the image; straight pieces of it lose vertices;
// - the id of every pixel (labels, emitters, objects: whatever the caller puts into one number): every pixel centre
//   lies in a face, on an edge or at a vertex whose corners all have its id. The line between two ids runs between the
//   same pixel centres as before; faces with corners of several ids hold no pixel centre;
// - topology: components, holes, fans at pinched pixels (index.hpp) and orientation.
// A vertex that is farther than max_pixel_error from the centre of its pixel (completion in position, no default) is
// kept with its neighbours, and the faces around them. Places are compared as if vertices were on the centres: where
// they are not, a face a fraction of a pixel wide may turn over; with max_pixel_error = kSafePixelError none can.
//
// Order: tiles of kSimplifyTile pixels, then tiles shifted by half, then the whole, which leaves no seams; the same
// mesh for any executor. Vertices and faces are written in raster order of their pixels.
// Cost: O(pixels log(reduction)), about 0.35 us for each face of the layer with one thread. Memory: 57 bytes a pixel.
#ifndef NPSIM_MESH_SIMPLIFY_HPP
#define NPSIM_MESH_SIMPLIFY_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/mesh/detail/simplify/bound.hpp"
#include "npsim/mesh/detail/simplify/thin.hpp"
#include "npsim/mesh/index.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// px. A face with corners at pixel centres is at least 1 / length wide; corners that move by this much do not turn it
// over where it is no longer than 500 px. Vertices on their rays are closer, rounding included, up to 4096 columns.
inline constexpr float kSafePixelError = 0x1p-10F;

struct SimplifyParams {
  float max_relative_depth_error = 0.005F;  // of |z' / z - 1|, anywhere on the surface
  float max_pixel_error = 0.25F;            // px, of a vertex from the centre of its pixel
  // px, of the photograph where it is put linearly on a face, as viewers do, and not projected from the camera; 0: any.
  // Not held on faces at most 1.5 px wide that bridge depths of more than 1 to 1.25.
  float max_texture_shift = 0.0F;
};

struct DepthDifference {
  float max_relative = 0;  // |z' / z - 1| anywhere: at pixel centres and where edges cross
  float rms_relative = 0;  // at pixel centres
  std::size_t pixels = 0;  // centres that were compared; one on an edge counts for each of its faces
};

struct SimplifyResult {
  MeshSize full;  // of the layer as index_layer() gives it
  MeshSize size;
  DepthDifference depth;     // achieved, measured on the mesh that was written
  float pixel_error = 0.0F;  // px, achieved: largest distance of a vertex from the centre of the pixel it stands for,
                             // of those that are within the bound
};

[[nodiscard]] inline Status validate(const SimplifyParams& p) noexcept {
  if (!(p.max_relative_depth_error >= 0.0F && p.max_relative_depth_error <= 1.0F)) {
    return {StatusCode::invalid_argument, "simplify: the relative error of depth lies in [0, 1]"};
  }
  if (!(p.max_texture_shift >= 0.0F && p.max_texture_shift <= 1e4F)) {
    return {StatusCode::invalid_argument, "simplify: the shift of the texture lies in [0, 1e4] px"};
  }
  if (!(p.max_pixel_error >= 0.0F && p.max_pixel_error <= 0.5F)) {
    return {StatusCode::invalid_argument, "simplify: the error in pixels lies in [0, 0.5]"};
  }
  return {};
}

[[nodiscard]] constexpr std::size_t simplify_layer_workspace_bytes(const SimplifyParams& /*params*/,
                                                                   Shape shape) noexcept {
  if (shape.empty()) return kWorkspaceAlignment;
  const std::size_t pixels = shape.pixels();
  const std::size_t halves = 6 * quad_shape(shape).pixels();
  return allocation_bytes<float>(pixels + 16) + allocation_bytes<float>(static_cast<std::size_t>(shape.height)) +
         2 * allocation_bytes<std::uint32_t>(halves) + allocation_bytes<std::uint32_t>(pixels) +
         allocation_bytes<std::uint8_t>(pixels) + kWorkspaceAlignment;
}

namespace mesh_detail {

// Distance of a vertex from the centre of its pixel on the image, px.
[[nodiscard]] inline float pixel_distance(const Intrinsics& intrinsics, const Vec3f& v, int x, int y) noexcept {
  const Vec2f at = project(intrinsics, v);
  const float dx = std::fabs(at.x - (static_cast<float>(x) + 0.5F));
  const float dy = std::fabs(at.y - (static_cast<float>(y) + 0.5F));
  return dx > dy ? dx : dy;
}

// Reciprocal depth and the state of the vertices of a row. Returns the largest distance within the bound.
[[nodiscard]] inline float prepare_row(const SimplifyParams& params, const SheetLayer& layer,
                                       const Intrinsics& intrinsics, int y, const ImageView<float>& inverse_depth,
                                       std::uint8_t* state) noexcept {
  float farthest = 0;
  for (int x = 0; x < layer.vertices.width(); ++x) {
    const Vec3f v = layer.vertices(x, y);
    inverse_depth(x, y) = has_vertex(v) ? 1.0F / v.z : 0.0F;
    const unsigned starts = fan_starts(fan_slots(layer.quads, x, y));
    state[x] = 0;
    if (starts == 0) continue;
    const bool pinched = (starts & (starts - 1)) != 0;
    const float distance = pixel_distance(intrinsics, v, x, y);
    const bool away = !(distance <= params.max_pixel_error) || !(inverse_depth(x, y) > 0.0F);
    state[x] = static_cast<std::uint8_t>(kVertexUsed | (pinched ? kVertexFixed : 0U) | (away ? kVertexAway : 0U));
    if (!away && distance > farthest) farthest = distance;
  }
  return farthest;
}

// Follows every face that is left, and every edge once.
[[nodiscard]] inline DepthDifference compare_depth(const ThinMesh& mesh, const SheetPlanes& sheet) noexcept {
  DepthDifference difference;
  double sum = 0;
  double largest = 0;
  const auto centre = [&](double w, double thin) {
    const double relative = std::fabs(w / thin - 1.0);
    largest = relative > largest ? relative : largest;
    sum += relative * relative;
    ++difference.pixels;
    return true;
  };
  const auto crossing = [&](double w, double thin) {
    const double relative = std::fabs(w / thin - 1.0);
    largest = relative > largest ? relative : largest;
    return true;
  };
  for (std::size_t h = 0; h < mesh.corner.size(); h += 3) {
    if (mesh.corner[h] == kGone) continue;
    Corner corner[3];
    for (std::size_t k = 0; k < 3; ++k) {
      corner[k] = sheet.corner(packed_x(mesh.corner[h + k]), packed_y(mesh.corner[h + k]));
    }
    static_cast<void>(at_centres(sheet, corner[0], corner[1], corner[2], centre));
    for (std::size_t k = 0; k < 3; ++k) {
      if (mesh.opposite[h + k] < h + k) continue;  // a rim is the largest number of all
      static_cast<void>(at_crossings(sheet, corner[k], corner[(k + 1) % 3], crossing));
    }
  }
  difference.max_relative = static_cast<float>(largest);
  if (difference.pixels > 0) {
    difference.rms_relative = static_cast<float>(std::sqrt(sum / static_cast<double>(difference.pixels)));
  }
  return difference;
}

// The copy of a pinched vertex that the fan of half-edge h uses: noted down at the rim where the fan begins.
[[nodiscard]] inline std::uint32_t fan_vertex(const ThinMesh& mesh, std::uint32_t h, std::uint32_t& next) noexcept {
  for (std::size_t step = 0; step < mesh.corner.size() && !ThinMesh::is_rim(mesh.opposite[h]); ++step) {
    h = next_half(mesh.opposite[h]);
  }
  if (mesh.opposite[h] == kRim) mesh.opposite[h] = kRim | ++next;  // one more than the index, so that 0 is none
  return (mesh.opposite[h] & ~kRim) - 1;
}

inline void write_thin_mesh(const ThinMesh& mesh, const SheetLayer& layer, std::uint32_t first_vertex,
                            const MeshBuffers& out) noexcept {
  const Span<std::uint32_t> index = mesh.outgoing;  // which has served its turn
  std::uint32_t next = 0;
  std::size_t pixel = 0;
  for (int y = 0; y < mesh.shape.height; ++y) {
    for (int x = 0; x < mesh.shape.width; ++x, ++pixel) {
      if (mesh.state[pixel] == 0) continue;
      const std::uint32_t fans = bit_count(fan_starts(fan_slots(layer.quads, x, y)));
      index[pixel] = next;
      for (std::uint32_t i = 0; i < fans; ++i, ++next) {
        out.vertices[next] = layer.vertices(x, y);
        if (out.pixels.data() != nullptr) out.pixels[next] = static_cast<std::uint32_t>(pixel);
      }
      if (fans > 1) mesh.state[pixel] = kVertexPinched;
    }
  }
  std::size_t faces = 0;
  for (std::uint32_t h = 0; h < mesh.corner.size(); h += 3) {
    if (mesh.corner[h] == kGone) continue;
    std::uint32_t corner[3];
    for (std::uint32_t k = 0; k < 3; ++k) {
      const std::size_t p = mesh.at(mesh.corner[h + k]);
      corner[k] = first_vertex + (mesh.state[p] == kVertexPinched ? fan_vertex(mesh, h + k, index[p]) : index[p]);
    }
    out.faces[faces++] = {corner[0], corner[1], corner[2]};
  }
}

}  // namespace mesh_detail

// Writes the simplified mesh of one layer to the front of the buffers; its indices start at first_vertex. ids: one
// number per pixel that must stay where it is; an empty view protects none. result.size says how much was written, or
// on capacity_exceeded how much is needed; it never exceeds mesh_size().
template <class Executor>
[[nodiscard]] Status simplify_layer(const SimplifyParams& params, const SheetLayer& layer,
                                    ImageView<const std::uint32_t> ids, const Intrinsics& intrinsics,
                                    std::uint32_t first_vertex, const MeshBuffers& out, SimplifyResult& result,
                                    Workspace& workspace, Executor& executor) {
  result = {};
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(layer));
  NPSIM_RETURN_IF_ERROR(validate(intrinsics));
  const Shape shape = layer.vertices.shape();
  if (!mesh_detail::mask_fits(ids, shape)) return {StatusCode::shape_mismatch, "simplify: one id for every pixel"};
  if (shape.width > mesh_detail::kMaxSimplifySide || shape.height > mesh_detail::kMaxSimplifySide ||
      shape.pixels() > 0x10000000U) {
    return {StatusCode::capacity_exceeded, "simplify: an image of at most 32768 pixels a side and 2^28 in all"};
  }
  if (layer.quads.empty()) return {};
  const WorkspaceScope scope(workspace);
  ImageView<float> inverse_depth;
  Span<float> farthest;
  mesh_detail::Thinner<simd::F32> thinner;
  mesh_detail::ThinMesh& mesh = thinner.mesh;
  mesh.shape = shape;
  const std::size_t halves = 6 * layer.quads.shape().pixels();
  Span<float> plane;  // and what a batch reads beyond its end
  NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels() + simd::kMaxLanes, plane));
  inverse_depth = ImageView<float>(plane.data(), shape);
  for (std::size_t i = shape.pixels(); i < plane.size(); ++i) plane[i] = 0.0F;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(shape.height), farthest));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(halves, mesh.corner));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(halves, mesh.opposite));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), mesh.outgoing));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), mesh.state));
  thinner.sheet = {inverse_depth, layer.quads, ids};
  thinner.max_texture_shift_px = static_cast<double>(params.max_texture_shift);
  thinner.bound = std::max(static_cast<double>(params.max_relative_depth_error), mesh_detail::kRoundingOfDepth);

  for_rows(executor, shape.height, [&](int y) {
    const auto row = static_cast<std::size_t>(y);
    farthest[row] = mesh_detail::prepare_row(params, layer, intrinsics, y, inverse_depth,
                                             mesh.state.data() + row * static_cast<std::size_t>(shape.width));
    if (y < layer.quads.height()) mesh_detail::connect_thin_row(layer, y, mesh);
  });
  for (const float f : farthest) result.pixel_error = f > result.pixel_error ? f : result.pixel_error;
  mesh_detail::fix_away(mesh);
  for (const int offset : {0, mesh_detail::kSimplifyTile / 2}) {
    mesh_detail::find_outgoing(mesh);
    mesh_detail::make_due(mesh, offset);
    mesh_detail::thin_tiles(thinner, offset, executor);
  }
  mesh_detail::find_outgoing(mesh);
  mesh_detail::make_due(mesh, 0);
  thinner.thin_tile({-1, -1, shape.width, shape.height});

  result.full = mesh_size(layer);
  result.size = result.full;
  // Every collapse took one vertex; what is gone by face is counted.
  result.size.faces = 0;
  for (std::size_t h = 0; h < halves; h += 3) result.size.faces += mesh.corner[h] != mesh_detail::kGone ? 1U : 0U;
  result.size.vertices = 0;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (mesh.state[mesh.at(mesh_detail::pack_pixel(x, y))] == 0) continue;
      result.size.vertices +=
          mesh_detail::bit_count(mesh_detail::fan_starts(mesh_detail::fan_slots(layer.quads, x, y)));
    }
  }
  if (!have_room(out, result.size) || result.size.vertices + first_vertex > 0xFFFFFFFFU) {
    return {StatusCode::capacity_exceeded, "mesh buffers are smaller than the simplified mesh"};
  }
  result.depth = mesh_detail::compare_depth(mesh, thinner.sheet);
  mesh_detail::write_thin_mesh(mesh, layer, first_vertex, out);
  return {};
}

// Writes the depth of the faces of one layer, in m, to the pixels that they cover; all others get 0. pixels says the
// pixel (y * width + x) of every vertex.
[[nodiscard]] inline Status simplified_depth(const TriangleMeshView& layer, Span<const std::uint32_t> pixels,
                                             ImageView<float> depth) noexcept {
  if (depth.empty()) return {StatusCode::invalid_argument, "depth of a layer needs at least one pixel"};
  const Shape shape = depth.shape();
  if (shape.width > mesh_detail::kMaxSimplifySide || shape.height > mesh_detail::kMaxSimplifySide) {
    return {StatusCode::capacity_exceeded, "depth of a layer: at most 32768 pixels a side"};
  }
  for (const Face& f : layer.faces) {
    for (const std::uint32_t v : {f.a, f.b, f.c}) {
      if (v >= layer.vertices.size() || v >= pixels.size() || pixels[v] >= shape.pixels()) {
        return {StatusCode::invalid_argument, "a face refers to a vertex or a pixel that does not exist"};
      }
    }
  }
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) depth(x, y) = 0.0F;
  }
  const auto corner_of = [&](std::uint32_t v) {
    const auto [x, y] = place_of(pixels[v], shape.width);
    return mesh_detail::Corner{x, y, 1.0 / static_cast<double>(layer.vertices[v].z), 0};
  };
  for (const Face& f : layer.faces) {
    const mesh_detail::Corner a = corner_of(f.a);
    const mesh_detail::Corner b = corner_of(f.b);
    const mesh_detail::Corner c = corner_of(f.c);
    if (mesh_detail::turn(a, b, c) == 0) continue;
    const mesh_detail::InversePlane plane(a, b, c);
    static_cast<void>(mesh_detail::for_triangle_rows(a, b, c, [&](int y, int first, int last) {
      for (int x = first; x <= last; ++x) depth(x, y) = static_cast<float>(1.0 / plane.at(x, y));
      return true;
    }));
    // Corners keep their depth to the last bit.
    for (const std::uint32_t v : {f.a, f.b, f.c}) depth(place_of(pixels[v], shape.width)) = layer.vertices[v].z;
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_SIMPLIFY_HPP
