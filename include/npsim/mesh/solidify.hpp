// SPDX-License-Identifier: Apache-2.0
// Objects with a back: closes the front sides of objects, all that a photograph shows of them, into solids.
//
// Without a back a car seen from the front is a shell: light of a lamp behind it passes through where its body should
// be. Every vertex of the front gets one behind it on the same ray of the camera (solidify_thickness.hpp says how far),
// every face its mirror image between those, and every edge on the rim two faces that join front and back. The camera
// never sees any of it, as it lies in the shadow of the front; no visible point comes to lie inside a solid.
//
// Invariants: an oriented manifold in gives closed oriented manifolds out, one for each of its components, holes
// through an object included; no face is flat, as the rays of its vertices differ; vertex i's back is number
// first_vertex + count + i; order is that of the front, whatever the executor does.
// A front that is not such a manifold is refused: an edge with a third face or with two in one direction, a vertex
// where two fans meet, an index or pixel out of range, a vertex that is not finite and in front of the camera.
// Cost: linear (edges are matched within the few at one vertex) and serial but for the thickness. Memory: 8 bytes a
// vertex and 13 a face, besides that of the thickness. Error: one rounding a component, on the ray to 2^-23 of the
// depth.
#ifndef NPSIM_MESH_SOLIDIFY_HPP
#define NPSIM_MESH_SOLIDIFY_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/mesh/detail/solidify/params.hpp"
#include "npsim/mesh/detail/solidify/thickness.hpp"
#include "npsim/mesh/index.hpp"
#include "npsim/mesh/sheet.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Faces of the backs of a front with so many faces and rim edges.
[[nodiscard]] constexpr std::size_t back_faces(std::size_t front_faces, std::size_t rim_edges) noexcept {
  return front_faces + 2 * rim_edges;
}

[[nodiscard]] constexpr std::size_t solidify_workspace_bytes(const SolidifyParams&, Shape shape, std::size_t vertices,
                                                             std::size_t faces) noexcept {
  return allocation_bytes<std::uint32_t>(vertices + 1) + allocation_bytes<std::uint32_t>(3 * faces) +
         allocation_bytes<std::uint8_t>(vertices) + allocation_bytes<std::uint8_t>(faces) +
         allocation_bytes<float>(vertices) + back_ratios_workspace_bytes(shape, vertices) + kWorkspaceAlignment;
}

namespace solidify_detail {

[[nodiscard]] inline Status check_front(const SolidifyFront& front, const SolidifyScene& scene) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(scene.camera));
  const Shape shape = scene.object.shape();
  if (scene.object.empty() || scene.labels.data() == nullptr || scene.labels.shape() != shape ||
      !mesh_detail::mask_fits(scene.background, shape)) {
    return {StatusCode::shape_mismatch, "solidify: object, labels and background must have one shape"};
  }
  if (!is_finite(scene.up) || std::fabs(length(scene.up) - 1.0F) > 1e-3F || !std::isfinite(scene.camera_height_m)) {
    return {StatusCode::invalid_argument, "solidify: up must be a unit vector and the camera's height finite"};
  }
  const std::size_t n = front.mesh.vertices.size();
  if (front.pixel.size() != n) return {StatusCode::shape_mismatch, "solidify: one pixel per vertex"};
  if (2 * n + front.first_vertex >= 0xFFFFFFFFU || front.mesh.faces.size() > 0xFFFFFFFFU / 3) {
    return {StatusCode::capacity_exceeded, "solidify handles up to 2^31 vertices and 2^32 / 3 faces"};
  }
  for (std::size_t v = 0; v < n; ++v) {
    const Vec3f p = front.mesh.vertices[v];
    if (!is_finite(p) || !has_vertex(p) || front.pixel[v] >= shape.pixels()) {
      return {StatusCode::invalid_argument, "solidify: a vertex is not finite, behind the camera or of no pixel"};
    }
  }
  for (const Face& f : front.mesh.faces) {
    for (const std::uint32_t i : {f.a, f.b, f.c}) {
      if (i < front.first_vertex || i - front.first_vertex >= n) {
        return {StatusCode::invalid_argument, "solidify: a face names a vertex that does not exist"};
      }
    }
  }
  return {};
}

[[nodiscard]] inline std::uint32_t corner_of(const Face& f, unsigned k) noexcept {
  return k == 0 ? f.a : (k == 1 ? f.b : f.c);
}

// Sets bit k of rim[f] where the edge from corner k of face f to the next has no face on its other side.
[[nodiscard]] inline Status find_rim(const SolidifyFront& front, Span<std::uint8_t> rim, std::size_t& rim_edges,
                                     Workspace& workspace) {
  const WorkspaceScope scope(workspace);
  const std::size_t n = front.mesh.vertices.size();
  const std::uint32_t first = front.first_vertex;
  Span<std::uint32_t> start;      // per vertex: of the edges that leave it
  Span<std::uint32_t> target;     // where they lead
  Span<std::uint8_t> leaves_rim;  // per vertex
  NPSIM_RETURN_IF_ERROR(workspace.allocate(n + 1, start));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(3 * front.mesh.faces.size(), target));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(n, leaves_rim));
  std::fill(start.begin(), start.end(), 0U);
  std::fill(leaves_rim.begin(), leaves_rim.end(), std::uint8_t{0});
  for (const Face& f : front.mesh.faces) {
    for (unsigned k = 0; k < 3; ++k) ++start[corner_of(f, k) - first];
  }
  std::uint32_t end = 0;
  for (std::uint32_t& s : start) s = end += s;
  for (const Face& f : front.mesh.faces) {
    for (unsigned k = 0; k < 3; ++k) target[--start[corner_of(f, k) - first]] = corner_of(f, (k + 1) % 3);
  }
  const auto count = [&](std::uint32_t from, std::uint32_t to) {
    std::size_t edges = 0;
    for (std::uint32_t i = start[from - first]; i < start[from - first + 1]; ++i) edges += target[i] == to ? 1U : 0U;
    return edges;
  };
  rim_edges = 0;
  for (std::size_t f = 0; f < front.mesh.faces.size(); ++f) {
    rim[f] = 0;
    for (unsigned k = 0; k < 3; ++k) {
      const std::uint32_t from = corner_of(front.mesh.faces[f], k);
      const std::uint32_t to = corner_of(front.mesh.faces[f], (k + 1) % 3);
      const std::size_t back = count(to, from);
      if (from == to || back > 1 || count(from, to) != 1) {
        return {StatusCode::invalid_argument, "solidify: an edge has more than two faces or two in one direction"};
      }
      if (back == 1) continue;
      if (leaves_rim[from - first]++ != 0) {
        return {StatusCode::invalid_argument, "solidify: two fans of faces meet in one vertex"};
      }
      rim[f] = static_cast<std::uint8_t>(rim[f] | (1U << k));
      ++rim_edges;
    }
  }
  return {};
}

}  // namespace solidify_detail

// Writes the backs' vertices (out.pixels those of their fronts, where not empty) and faces: mirrored fronts in the
// order of the fronts, then the rims. Indices go on from the front's. size says how much was written, or on
// capacity_exceeded how much is needed. On any error the output is untouched.
template <class Executor>
[[nodiscard]] Status solidify(const SolidifyParams& params, const SolidifyFront& front, const SolidifyScene& scene,
                              const MeshBuffers& out, MeshSize& size, Workspace& workspace, Executor& executor) {
  size = {};
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(solidify_detail::check_front(front, scene));
  const std::size_t n = front.mesh.vertices.size();
  const std::size_t faces = front.mesh.faces.size();
  const WorkspaceScope scope(workspace);
  Span<std::uint8_t> rim;
  Span<float> ratio;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(faces, rim));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(n, ratio));
  std::size_t rim_edges = 0;
  NPSIM_RETURN_IF_ERROR(solidify_detail::find_rim(front, rim, rim_edges, workspace));
  size = {n, back_faces(faces, rim_edges)};
  const bool pixels = out.pixels.data() != nullptr;
  if (size.vertices > out.vertices.size() || size.faces > out.faces.size() ||
      (pixels && size.vertices > out.pixels.size())) {
    return {StatusCode::capacity_exceeded, "solidify: the buffers are too small for the backs"};
  }
  NPSIM_RETURN_IF_ERROR(back_ratios(params, front, scene, ratio, workspace, executor));
  // A back at infinity would follow from a front there: depth times ratio overflows.
  for (std::size_t v = 0; v < n; ++v) {
    if (!is_finite(front.mesh.vertices[v] * ratio[v])) {
      return {StatusCode::invalid_argument, "solidify: a vertex is too far away for a back"};
    }
  }
  for (std::size_t v = 0; v < n; ++v) {
    out.vertices[v] = front.mesh.vertices[v] * ratio[v];
    if (pixels) out.pixels[v] = front.pixel[v];
  }
  const auto shift = static_cast<std::uint32_t>(n);
  std::size_t next = faces;
  for (std::size_t f = 0; f < faces; ++f) {
    const Face face = front.mesh.faces[f];
    out.faces[f] = {face.a + shift, face.c + shift, face.b + shift};
    for (unsigned k = 0; k < 3; ++k) {
      if ((rim[f] & (1U << k)) == 0) continue;
      const std::uint32_t a = solidify_detail::corner_of(face, k);
      const std::uint32_t b = solidify_detail::corner_of(face, (k + 1) % 3);
      out.faces[next++] = {b, a, a + shift};
      out.faces[next++] = {b, a + shift, b + shift};
    }
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_SOLIDIFY_HPP
