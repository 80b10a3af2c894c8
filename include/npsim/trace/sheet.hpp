// SPDX-License-Identifier: Apache-2.0
// The ray tracer for layers over the pixel grid (geometry/triangle_mesh.hpp): a heightfield in inverse depth with a
// pyramid of 4x4 children over it, instead of a tree over triangles. docs/rays.md has a drawing.
//
//   SheetTrace                                      the structure of one layer: views into the workspace and the layer
//   SheetScene                                      layers of one camera as one; face numbers go on from layer to layer
//   sheet_workspace_bytes(pixels)                   what building takes
//   build_sheet_trace(layer, camera, workspace, out, executor)
//   join_layers(layers, scene)
//   closest_hit(scene, ray, hit)                    one ray: the nearest face
//   occluded(scene, ray), (scene, ray, accept)      one ray: whether any face, or any with accept(face), lies on it
//   closest_hits(scene, rays, hits, active)         many rays in one call, up to three times as fast
//   occluded(scene, rays, accept, blocked, active)
//   face_count(scene), is_empty(scene)
//   surface_point(mesh, hit), offset_ray_origin(...)    where the next ray starts (ray.hpp)
//
// Invariants: a hit is decided by the watertight test of detail/triangle.hpp on the vertices as they are, whose edges
// neighbours share: no ray slips between two faces, and a hit has the bits that the general tree (bvh.hpp) gives for
// the same face where both have the same bounds. Of equal t the lowest face is reported. Answers do not depend on the
// order or the number of rays in a call, on threads or on the number of lanes.
//
// Errors: those of the triangle test. Everything before it only leaves faces out, with the rounding of every step
// allowed for (detail/sheet/ray.hpp). One exception: where a vertex lies thousands of times as far as others, a face
// with a corner 300 times as far as the hit may be missed.
//
// Never hit: faces with a vertex that is missing (depth 0), not finite, beyond 2^60 m or nearer than 2^-40 m. Vertices
// may lie off their pixels' rays; the farthest of them makes every test that much more generous, which costs speed and
// nothing else.
//
// Cost: building 2 to 4 ns a pixel in one pass; a ray .1 to 1 us (docs/rays.md). Memory: 2.02 bytes a triangle of a
// full layer; 10 to 22 KiB of stack.
#ifndef NPSIM_TRACE_SHEET_HPP
#define NPSIM_TRACE_SHEET_HPP

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/trace/detail/sheet/build.hpp"
#include "npsim/trace/detail/sheet/layout.hpp"
#include "npsim/trace/detail/sheet/packet.hpp"
#include "npsim/trace/detail/sheet/stream.hpp"
#include "npsim/trace/detail/sheet/walk.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

[[nodiscard]] constexpr std::size_t sheet_workspace_bytes(Shape pixels) noexcept {
  const sheet_detail::Levels levels = sheet_detail::levels_of(pixels);
  return allocation_bytes<SheetTiles>(levels.groups()) + allocation_bytes<SheetRelief>(16 * levels.groups()) +
         allocation_bytes<SheetNode>(levels.nodes) +
         allocation_bytes<sheet_detail::RowBounds>(static_cast<std::size_t>(levels.down[0])) + kWorkspaceAlignment;
}

// `out` points into the workspace and at the layer and stays good as long as both do. The camera is the one that sees
// the layer's pixel grid. A layer with less than two rows or columns, or without a vertex, gives a structure that
// nothing hits; 2^31 faces, more than 4^9 quads a side and vertices nowhere near their pixels' rays give a Status.
template <class F = simd::F32, class Executor>
[[nodiscard]] Status build_sheet_trace(const SheetLayer& layer, const Intrinsics& intrinsics, Workspace& workspace,
                                       SheetTrace& out, Executor& executor) {
  out = SheetTrace{};
  NPSIM_RETURN_IF_ERROR(validate(layer));
  NPSIM_RETURN_IF_ERROR(validate(intrinsics));
  const Shape shape = layer.vertices.shape();
  const sheet_detail::Levels levels = sheet_detail::levels_of(shape);
  if (levels.count == 0) return {};
  NPSIM_RETURN_IF_ERROR(sheet_detail::check_size(shape, levels));
  sheet_detail::SheetParts parts;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(levels.groups(), parts.tiles));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(16 * levels.groups(), parts.relief));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(levels.nodes, parts.nodes));
  const WorkspaceScope scope(workspace);
  Span<sheet_detail::RowBounds> rows;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(levels.down[0]), rows));
  SheetTrace sheet = sheet_detail::views_of(layer, intrinsics, levels, parts);
  NPSIM_RETURN_IF_ERROR(sheet_detail::fill_sheet<F>(levels, parts, rows, sheet, executor));
  out = sheet;
  return {};
}

// `layers` stays with the caller. They need one shape and one camera; those that nothing hits may have any.
[[nodiscard]] inline Status join_layers(Span<const SheetTrace> layers, SheetScene& out) noexcept {
  SheetScene scene;
  scene.layers = layers;
  const SheetTrace* first = nullptr;
  for (const SheetTrace& layer : layers) {
    if (layer.levels == 0) continue;
    if (first == nullptr) {
      first = &layer;
      scene.bounds = layer.bounds;
      continue;
    }
    const Intrinsics& a = first->intrinsics;
    const Intrinsics& b = layer.intrinsics;
    if (layer.vertices.shape() != first->vertices.shape() || a.fx != b.fx || a.fy != b.fy || a.cx != b.cx ||
        a.cy != b.cy) {
      return Status(StatusCode::shape_mismatch, "layers that are traced as one must have one shape and one camera");
    }
    sheet_detail::join_bounds(layer.bounds, scene.bounds);
  }
  out = scene;
  return {};
}

// Numbers that the faces take, those that are not there included: two a quad.
[[nodiscard]] inline std::uint32_t face_count(const SheetScene& scene) noexcept {
  std::uint32_t n = 0;
  for (const SheetTrace& sheet : scene.layers) n += sheet_face_count(sheet.vertices.shape());
  return n;
}

[[nodiscard]] inline bool is_empty(const SheetScene& scene) noexcept { return scene.layers.empty(); }

// One ray. F: a batch of floats, as wide as the machine's unless told otherwise; it never changes an answer.

// The nearest face that the ray meets; `out` is written only when there is one.
template <class F = simd::F32>
[[nodiscard]] bool closest_hit(const SheetScene& scene, const Ray& ray, Hit& out) noexcept {
  return sheet_detail::closest_of<F>(scene.layers, scene.bounds, ray, out);
}

template <class F = simd::F32>
[[nodiscard]] bool closest_hit(const SheetTrace& sheet, const Ray& ray, Hit& out) noexcept {
  return sheet_detail::closest_of<F>({&sheet, 1}, sheet.bounds, ray, out);
}

// Whether some face with accept(face) lies on the ray; the others are transparent.
template <class F = simd::F32, class Accept>
[[nodiscard]] bool occluded(const SheetScene& scene, const Ray& ray, Accept&& accept) noexcept {
  return sheet_detail::any_of<F>(scene.layers, scene.bounds, ray, accept);
}

template <class F = simd::F32, class Accept>
[[nodiscard]] bool occluded(const SheetTrace& sheet, const Ray& ray, Accept&& accept) noexcept {
  return sheet_detail::any_of<F>({&sheet, 1}, sheet.bounds, ray, accept);
}

template <class F = simd::F32>
[[nodiscard]] bool occluded(const SheetScene& scene, const Ray& ray) noexcept {
  return occluded<F>(scene, ray, [](std::uint32_t) noexcept { return true; });
}

template <class F = simd::F32>
[[nodiscard]] bool occluded(const SheetTrace& sheet, const Ray& ray) noexcept {
  return occluded<F>(sheet, ray, [](std::uint32_t) noexcept { return true; });
}

// Many rays, one answer for each. `active`: where it is 0 the ray is left out and its answer stays as it is; empty: all
// are traced.

// hits[i]: the nearest face that ray i meets, a Hit without a face where there is none.
template <class F = simd::F32>
void closest_hits(const SheetScene& scene, Span<const Ray> rays, Span<Hit> hits,
                  Span<const std::uint8_t> active = {}) noexcept {
  sheet_detail::trace_stream<F>(scene.layers, scene.bounds, rays, sheet_detail::ClosestQuery{hits}, active);
}

// blocked[i]: 1 where some face with accept(face) lies on ray i, else 0. Fastest where rays of one lamp from points
// side by side follow each other. `accept` may be asked about the faces of the rays in any order, and about a face once
// for several rays.
template <class F = simd::F32, class Accept>
void occluded(const SheetScene& scene, Span<const Ray> rays, Accept&& accept, Span<std::uint8_t> blocked,
              Span<const std::uint8_t> active = {}) noexcept {
  sheet_detail::occluded_by_packets<F, std::remove_reference_t<Accept>>(scene, rays, accept, blocked, active);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_SHEET_HPP
