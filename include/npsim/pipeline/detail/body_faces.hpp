// SPDX-License-Identifier: Apache-2.0
// Which faces and points of the scene mesh belong to which body: a thing that bulges, and does not shade itself.
//
// The outside of a car turns away from every lamp that it hides from itself: its normals say where its own shadow is.
// Its mesh says it worse. Measured depth is uneven by more than a car's relief, and each dent would lie in the shadow
// of its rim. A body is what has one number among the instances, else an object, of the class and the number of most of
// its pixels: thin ones lie on their neighbours' too. The lamps of such a body are shaded by it as by anything: a
// bonnet hides headlamps from the windscreen.
// Cost: five passes over the pixels and one over the faces. Memory: 2 bytes a face, a point and a lamp where there are
// any, else none; 8 bytes a pixel and 128 KiB for the search. Error: what a body does shade of itself, under a wheel
// arch or behind a mirror, is lit.
#ifndef NPSIM_PIPELINE_DETAIL_BODY_FACES_HPP
#define NPSIM_PIPELINE_DETAIL_BODY_FACES_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/pipeline/detail/traced_faces.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/render/visibility.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr LabelSet kBodyLabels =
    LabelSet::of(label::car, label::truck, label::bus, label::caravan, label::trailer, label::train);

// On top of what is kept: 2 bytes a face, a point and a lamp.
[[nodiscard]] constexpr std::size_t find_bodies_workspace_bytes(Shape shape) noexcept {
  return 2 * allocation_bytes<std::uint16_t>(shape.pixels() + 1) + allocation_bytes<std::int32_t>(shape.pixels() + 1) +
         allocation_bytes<std::uint16_t>(65536) + kWorkspaceAlignment;
}

namespace body_detail {

template <class F>
void for_pixels(Shape shape, const F& f) {
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) f(x, y);
  }
}

// of_object: the body of each object, 0 for none.
[[nodiscard]] inline Status number_bodies(LabelSet classes, const SceneView& scene,
                                          ImageView<const std::uint32_t> object, Workspace& workspace,
                                          Span<std::uint16_t> of_object) {
  const WorkspaceScope scope(workspace);
  const Shape shape = scene.shape();
  const auto is_body = [&](int x, int y) { return classes.contains(scene.labels(x, y)); };
  Span<std::int32_t> votes;
  Span<std::uint16_t> instance, of_instance;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(of_object.size(), votes));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(of_object.size(), instance));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(65536, of_instance));
  std::fill(votes.begin(), votes.end(), 0);
  std::fill(of_instance.begin(), of_instance.end(), std::uint16_t{0});
  std::fill(of_object.begin(), of_object.end(), std::uint16_t{0});
  for_pixels(shape, [&](int x, int y) { votes[object(x, y)] += is_body(x, y) ? 1 : -1; });
  std::uint16_t count = 0;
  for (std::size_t o = 1; o < votes.size() && count < 65535; ++o) {
    if (votes[o] > 0) of_object[o] = ++count;
  }
  if (scene.instances.empty()) return {};
  // The number that most of an object's pixels have, where more than half of them agree (Boyer and Moore 1981).
  std::fill(votes.begin(), votes.end(), 0);
  for_pixels(shape, [&](int x, int y) {
    const std::uint32_t o = object(x, y);
    if (of_object[o] == 0 || !is_body(x, y)) return;
    if (votes[o] == 0) instance[o] = scene.instances(x, y);
    votes[o] += instance[o] == scene.instances(x, y) ? 1 : -1;
  });
  for (std::size_t o = 1; o < votes.size(); ++o) {
    if (of_object[o] == 0 || votes[o] <= 0 || instance[o] == 0) continue;
    std::uint16_t& body = of_instance[instance[o]];
    if (body == 0) body = of_object[o];
    of_object[o] = body;
  }
  return {};
}

}  // namespace body_detail

// for_each: see traced_faces.hpp, over `faces` faces. The workspace holds what `out` points at. Without labels, or
// anything of these classes, there are none.
template <class ForEachFace>
[[nodiscard]] Status find_bodies(LabelSet classes, const SceneView& scene, const SceneMesh& mesh,
                                 Span<const Emitter> emitters, std::size_t faces, const ForEachFace& for_each,
                                 Workspace& workspace, Bodies& out) {
  out = Bodies{};
  const ImageView<const std::uint32_t> object = mesh.object;
  bool any = false;
  if (!scene.labels.empty()) {
    body_detail::for_pixels(
        scene.shape(), [&](int x, int y) { any = any || (object(x, y) != 0 && classes.contains(scene.labels(x, y))); });
  }
  if (!any) return {};
  Span<std::uint16_t> of_face, of_point, of_lamp;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(faces, of_face));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(mesh.mesh.vertices.size(), of_point));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(emitters.size(), of_lamp));
  for (const Span<std::uint16_t> bodies : {of_face, of_point, of_lamp}) {
    std::fill(bodies.begin(), bodies.end(), std::uint16_t{0});
  }
  const WorkspaceScope scope(workspace);
  Span<std::uint16_t> of_object;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(scene.shape().pixels() + 1, of_object));
  NPSIM_RETURN_IF_ERROR(body_detail::number_bodies(classes, scene, object, workspace, of_object));
  body_detail::for_pixels(scene.shape(), [&](int x, int y) {
    const std::uint16_t body = of_object[object(x, y)];
    if (body == 0) return;
    const std::uint32_t vertex = mesh.visible_vertex(x, y);
    if (vertex != kNoVertex && vertex >= mesh.background_vertices) of_point[vertex] = body;
    const std::uint16_t mark = scene.light_index.empty() ? std::uint16_t{0} : scene.light_index(x, y);
    for (std::size_t e = 0; mark != 0 && e < emitters.size(); ++e) {
      if (emitters[e].mark == mark && of_lamp[e] == 0) of_lamp[e] = body;
    }
  });
  for_each([&](std::size_t face, const Vec3f(&)[3], const std::uint32_t(&pixels)[3], bool is_object) {
    if (is_object) of_face[face] = of_object[at_pixel(object, pixels[0])];
  });
  out = {of_face, of_point, of_lamp};
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_BODY_FACES_HPP
