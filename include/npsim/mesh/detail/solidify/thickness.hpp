// SPDX-License-Identifier: Apache-2.0
// How far behind each vertex of the objects' front its back lies, as a multiple of the vertex: back = ratio * front, so
// both are on one ray of the camera.
//
// The label's rule gives a thickness along the ray (solidify_params.hpp). The back then stays in front of the
// background of its pixel and above the ground where these are known, so that a car does not stick in the wall behind
// it nor in the road; it always stays min_relative behind the front, which wins where both cannot be had.
//
// Invariant: 1 + min_relative <= ratio < infinity; a function of the input alone, whatever the executor does. Cost:
// linear in the vertices, for round and soft things times their width in pixels. Memory: 4 bytes a pixel and at most
// 40 a vertex. Error: of the rule; arithmetic 1e-6 of the depth.
#ifndef NPSIM_MESH_DETAIL_SOLIDIFY_THICKNESS_HPP
#define NPSIM_MESH_DETAIL_SOLIDIFY_THICKNESS_HPP

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
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/detail/solidify/box.hpp"
#include "npsim/mesh/detail/solidify/params.hpp"
#include "npsim/mesh/sheet.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// The front sides of all objects, indexed: what index_layer() or a simplification of it writes. Faces count vertices
// from first_vertex on: index i is vertices[i - first_vertex].
struct SolidifyFront {
  TriangleMeshView mesh;
  Span<const std::uint32_t> pixel;  // y * width + x of each vertex
  std::uint32_t first_vertex = 0;
};

// What is known about the scene around it.
struct SolidifyScene {
  Intrinsics camera;
  ImageView<const std::uint32_t> object;  // as complete_foreground() writes it; less than the number of pixels
  ImageView<const Label> labels;
  LabelSet foreground = kForegroundLabels;  // a widened object's extra pixels have labels that do not count
  ImageView<const Vec3f> background;        // vertices of the completed background; may be empty
  Vec3f up{0.0F, -1.0F, 0.0F};              // unit, camera frame
  float camera_height_m = 0.0F;             // above the ground plane; 0 where it is not known
};

[[nodiscard]] constexpr std::size_t back_ratios_workspace_bytes(Shape shape, std::size_t vertices) noexcept {
  return allocation_bytes<std::uint32_t>(shape.empty() ? 0 : shape.pixels() + 1) +
         allocation_bytes<std::uint32_t>(vertices + 1) + allocation_bytes<std::uint32_t>(vertices) +
         allocation_bytes<float>(vertices) + allocation_bytes<HeadingVotes>(vertices) +
         allocation_bytes<Label>(vertices) + kWorkspaceAlignment;
}

namespace solidify_detail {

// Pixels of one object around (x, y) along a row (dx = 1) or column (dy = 1): to either side, itself left out, at most
// `limit` each.
struct Run {
  int before = 0;
  int after = 0;
};
[[nodiscard]] inline Run run_at(ImageView<const std::uint32_t> object, int x, int y, int dx, int dy,
                                int limit) noexcept {
  const std::uint32_t own = object(x, y);
  const auto count = [&](int sx, int sy) {
    int n = 0;
    while (n < limit && object.contains(x + (n + 1) * sx, y + (n + 1) * sy) &&
           object(x + (n + 1) * sx, y + (n + 1) * sy) == own) {
      ++n;
    }
    return n;
  };
  return {count(-dx, -dy), count(dx, dy)};
}

// Thickness, m, of a thing that is as thick as wide at this pixel; limit_m bounds it.
[[nodiscard]] inline float own_thickness(const SolidifyScene& scene, bool soft, float limit_m, int x, int y,
                                         float z) noexcept {
  float thickness = limit_m;
  for (const bool row : {true, false}) {
    const float pixel_m = z / (row ? scene.camera.fx : scene.camera.fy);
    const float limit_px = limit_m / pixel_m;
    const int limit = limit_px < 16384.0F ? static_cast<int>(limit_px) + 1 : 16384;
    const Run run = run_at(scene.object, x, y, row ? 1 : 0, row ? 0 : 1, limit);
    // The ellipse over a run from 0 to w has the height 2 sqrt(s (w - s)) at s.
    const float width_px =
        soft ? 2.0F * std::sqrt((static_cast<float>(run.before) + 0.5F) * (static_cast<float>(run.after) + 0.5F))
             : static_cast<float>(run.before + run.after + 1);
    thickness = std::fmin(thickness, width_px * pixel_m);
  }
  return thickness;
}

// Objects that the front has vertices of, as bodies 0 .. count - 1 in the order of their first vertex.
struct Bodies {
  Span<std::uint32_t> of_object;  // object -> body
  Span<std::uint32_t> start;      // of each body's members, and one past the last
  Span<std::uint32_t> members;    // vertices, in order
  Span<Label> label;
  Span<HeadingVotes> votes;
};

inline constexpr std::uint32_t kNoBody = 0xFFFFFFFFU;

[[nodiscard]] inline Status collect_bodies(const SolidifyFront& front, const SolidifyScene& scene, Workspace& workspace,
                                           Bodies& bodies) {
  const std::size_t n = front.mesh.vertices.size();
  const auto width = static_cast<std::uint32_t>(scene.object.width());
  const auto object_of = [&](std::size_t v) {
    return scene.object(static_cast<int>(front.pixel[v] % width), static_cast<int>(front.pixel[v] / width));
  };
  NPSIM_RETURN_IF_ERROR(workspace.allocate(scene.object.shape().pixels() + 1, bodies.of_object));
  std::fill(bodies.of_object.begin(), bodies.of_object.end(), kNoBody);
  std::uint32_t count = 0;
  for (std::size_t v = 0; v < n; ++v) {
    const std::uint32_t object = object_of(v);
    if (object >= bodies.of_object.size()) {
      return {StatusCode::invalid_argument, "solidify: more objects than pixels"};
    }
    if (bodies.of_object[object] == kNoBody) bodies.of_object[object] = count++;
  }
  NPSIM_RETURN_IF_ERROR(workspace.allocate(std::size_t{count} + 1, bodies.start));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(n, bodies.members));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, bodies.label));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, bodies.votes));
  std::fill(bodies.start.begin(), bodies.start.end(), 0U);
  for (std::size_t v = 0; v < n; ++v) ++bodies.start[bodies.of_object[object_of(v)]];
  std::uint32_t end = 0;
  for (std::uint32_t& s : bodies.start) s = end += s;  // the ends of all, then moved down to the starts
  for (std::size_t v = n; v-- > 0;) {
    bodies.members[--bodies.start[bodies.of_object[object_of(v)]]] = static_cast<std::uint32_t>(v);
  }
  for (std::uint32_t b = 0; b < count; ++b) {
    std::array<std::uint32_t, kLabelCount> seen{};
    Label best = label::unlabeled;
    for (std::uint32_t i = bodies.start[b]; i < bodies.start[b + 1]; ++i) {
      const std::uint32_t pixel = front.pixel[bodies.members[i]];
      const Label l = scene.labels(static_cast<int>(pixel % width), static_cast<int>(pixel / width));
      if (l >= kLabelCount || !scene.foreground.contains(l)) continue;
      if (++seen[l] > seen[best]) best = l;
    }
    bodies.label[b] = best;
    bodies.votes[b] = {};
  }
  return {};
}

}  // namespace solidify_detail

// ratio has one element per vertex. The front and the scene must have passed solidify()'s checks.
template <class Executor>
[[nodiscard]] Status back_ratios(const SolidifyParams& params, const SolidifyFront& front, const SolidifyScene& scene,
                                 Span<float> ratio, Workspace& workspace, Executor& executor) {
  const WorkspaceScope scope(workspace);
  solidify_detail::Bodies bodies;
  NPSIM_RETURN_IF_ERROR(solidify_detail::collect_bodies(front, scene, workspace, bodies));
  Span<float> projected;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(ratio.size(), projected));
  const auto width = static_cast<std::uint32_t>(scene.object.width());
  const solidify_detail::Horizon horizon = solidify_detail::horizon_of(scene.up);
  const auto vertex = [&](std::uint32_t i) { return front.mesh.vertices[i - front.first_vertex]; };
  for (const Face& f : front.mesh.faces) {
    const std::uint32_t pixel = front.pixel[f.a - front.first_vertex];
    const std::uint32_t body =
        bodies.of_object[scene.object(static_cast<int>(pixel % width), static_cast<int>(pixel / width))];
    if (params.rules[bodies.label[body]].shape != BackShape::box) continue;
    solidify_detail::vote(horizon, vertex(f.a), vertex(f.b), vertex(f.c), bodies.votes[body]);
  }
  executor.for_chunks(bodies.label.size(), 4, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) {
      const BackRule& rule = params.rules[bodies.label[b]];
      const Span<const std::uint32_t> members(bodies.members.data() + bodies.start[b],
                                              bodies.start[b + 1] - bodies.start[b]);
      UprightBox box;
      if (rule.shape == BackShape::box) {
        solidify_detail::set_heading(horizon, bodies.votes[b], params.street_weight, box);
        solidify_detail::set_extent(params, rule, front.mesh.vertices, members,
                                    Span<float>(projected.data() + bodies.start[b], members.size()), box);
      }
      const float diagonal = std::sqrt(rule.length_m * rule.length_m + rule.width_m * rule.width_m);
      for (const std::uint32_t v : members) {
        const Vec3f p = front.mesh.vertices[v];
        const auto x = static_cast<int>(front.pixel[v] % width);
        const auto y = static_cast<int>(front.pixel[v] / width);
        const float distance = length(p);
        float thickness = rule.length_m;
        if (rule.shape == BackShape::round || rule.shape == BackShape::soft) {
          thickness = solidify_detail::own_thickness(scene, rule.shape == BackShape::soft, rule.length_m, x, y, p.z);
        }
        float r = 1.0F + thickness / distance;
        if (rule.shape == BackShape::box) {
          r = std::fmin(solidify_detail::exit_ratio(box, rule, scene.up, scene.camera_height_m, p),
                        1.0F + diagonal / distance);
        }
        if (!scene.background.empty() && has_vertex(scene.background(x, y))) {
          r = std::fmin(r, scene.background(x, y).z / p.z * (1.0F - params.background_gap));
        }
        const float sinking = -dot(scene.up, p);
        if (scene.camera_height_m > 0.0F && sinking > 0.0F) {
          r = std::fmin(r, (scene.camera_height_m - params.ground_gap_m) / sinking);
        }
        ratio[v] = std::fmax(r, 1.0F + params.min_relative);
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_SOLIDIFY_THICKNESS_HPP
