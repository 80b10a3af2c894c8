// SPDX-License-Identifier: Apache-2.0
#include "mesh_views.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "mesh_textures.hpp"
#include "npsim/core/workspace.hpp"

namespace npsim::tool {

ViewPose view_pose(const MeshViewParams& params, ImageView<const float> depth, const Intrinsics& camera) {
  constexpr float kRadians = 3.14159265F / 180.0F;
  const float turn = params.turn_deg * kRadians;
  const float climb = params.climb_deg * kRadians;
  const float pivot = params.pivot_m > 0 ? params.pivot_m : pivot_m(PivotParams{}, depth, camera, turn, climb);
  return closer(turned(ViewPose{}, turn, climb, pivot), params.closer_m);
}

ViewColours::ViewColours(const io::Image<Rgb8>& upper, const io::Image<Rgb8>& lower, Span<const std::uint32_t> texel)
    : texture_({upper.width(), 2 * upper.height()}), texel_(texel.begin(), texel.end()) {
  for (int y = 0; y < upper.height(); ++y) {
    std::copy_n(upper.view().row(y), upper.width(), texture_.view().row(y));
    std::copy_n(lower.view().row(y), upper.width(), texture_.view().row(upper.height() + y));
  }
}

ViewColours::ViewColours(const io::Image<Rgb8>& photograph, const SceneMesh& mesh)
    : ViewColours(photograph, without_objects(photograph, mesh), mesh.vertex_pixel) {
  const auto below = static_cast<std::uint32_t>(photograph.shape().pixels());
  for (std::size_t v = 0; v < mesh.background_vertices; ++v) texel_[v] += below;
}

ViewColours::ViewColours(const io::Image<Rgb8>& photograph, Span<const std::uint32_t> vertex_pixel)
    : ViewColours(photograph, photograph, vertex_pixel) {}

PreviewColours ViewColours::of(std::size_t vertices) const {
  PreviewColours out;
  out.texel = {texel_.data(), vertices};
  out.texture = texture_.view();
  return out;
}

Status draw_mesh(const PreviewParams& params, const TriangleMeshView& mesh, const PreviewColours& colours,
                 const Intrinsics& camera, const ViewPose& pose, Shape shape, AnyExecutor executor,
                 io::Image<Rgb8>& out) {
  const Shape large{2 * shape.width, 2 * shape.height};
  io::Image<Rgb8> picture(large);
  const std::size_t bytes = preview_workspace_bytes(params, large, mesh.vertices.size(), mesh.faces.size());
  const std::unique_ptr<unsigned char[]> memory(new unsigned char[bytes]);
  Workspace workspace(memory.get(), bytes);
  NPSIM_RETURN_IF_ERROR(
      preview(params, mesh, colours, scaled(camera, shape, large), pose, picture.view(), workspace, executor));
  out = shrunk(picture, shape);
  return {};
}

Status mesh_panels(const io::Image<Rgb8>& photograph, const SceneMesh& mesh, ImageView<const float> depth,
                   const Intrinsics& camera, AnyExecutor executor, std::vector<Panel>& panels) {
  const Shape shape = photograph.shape();
  const int width = std::min(shape.width, 640);
  const Shape small{width, std::max(1, shape.height * width / shape.width)};
  const ViewColours colours(photograph, mesh);
  const auto draw = [&](const char* title, const TriangleMeshView& part, const MeshViewParams& view) {
    io::Image<Rgb8> picture;
    NPSIM_RETURN_IF_ERROR(draw_mesh(PreviewParams{}, part, colours.of(part.vertices.size()),
                                    scaled(camera, shape, small), view_pose(view, depth, camera), small, executor,
                                    picture));
    panels.push_back({title, std::move(picture)});
    return Status();
  };
  const TriangleMeshView background{mesh.mesh.vertices.sub(0, mesh.background_vertices),
                                    mesh.mesh.faces.sub(0, mesh.background_faces)};
  NPSIM_RETURN_IF_ERROR(draw("mesh", mesh.mesh, {}));
  NPSIM_RETURN_IF_ERROR(draw("mesh, 3 m closer", mesh.mesh, {3, 0, 0, 0}));
  NPSIM_RETURN_IF_ERROR(draw("mesh, turned 45 degrees", mesh.mesh, {0, 45, 0, 0}));
  return draw("background alone", background, {});
}

}  // namespace npsim::tool
