// SPDX-License-Identifier: Apache-2.0
// Views of the scene mesh from any side, with the photograph on it.
#ifndef NPSIM_SAMPLES_NPSIM_MESH_VIEWS_HPP
#define NPSIM_SAMPLES_NPSIM_MESH_VIEWS_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "npsim/core/camera.hpp"
#include "npsim/core/triangle_mesh.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/io/image.hpp"
#include "npsim/mesh/interpolate_rows.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/render/preview.hpp"
#include "npsim/render/view_pose.hpp"
#include "pictures.hpp"

namespace npsim::tool {

// Where the mesh is seen from, in words of the thesis' figures.
struct MeshViewParams {
  float closer_m = 0;
  float turn_deg = 0;   // clockwise, seen from above
  float climb_deg = 0;  // looking down
  float pivot_m = 0;    // ahead of the photograph's camera; 0: axis_pivot_m()
};

[[nodiscard]] inline ViewPose view_pose(const MeshViewParams& params, float pivot_m) {
  constexpr float kRadians = 3.14159265F / 180.0F;
  return closer(turned(ViewPose{}, params.turn_deg * kRadians, params.climb_deg * kRadians, pivot_m), params.closer_m);
}

// The photograph twice, one above the other: with what the camera sees, and with the background's colours continued
// behind objects in the way its surface is, so that no object is painted on the wall behind it.
class MeshTexture {
 public:
  // Of the whole mesh.
  template <class Executor>
  MeshTexture(ImageView<const Rgb8> photograph, const SceneMesh& mesh, Executor& executor)
      : MeshTexture(photograph, mesh.vertex_pixel) {
    const Shape shape = photograph.shape();
    const auto below = static_cast<std::uint32_t>(shape.pixels());
    for (std::size_t v = 0; v < mesh.background_vertices; ++v) texel_[v] += below;
    io::Image<std::uint8_t> state(shape);
    io::Image<Vec3f> colour(shape);
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const bool blocked = mesh.background_state(x, y) == row_state::blocked;
        const bool seen = mesh.visible_vertex(x, y) < mesh.background_vertices;
        state(x, y) = seen ? row_state::known : (blocked ? row_state::blocked : row_state::missing);
        const Rgb8 c = photograph(x, y);
        colour(x, y) = {static_cast<float>(c.r), static_cast<float>(c.g), static_cast<float>(c.b)};
      }
    }
    // Shapes agree; without a status there is nothing to report.
    if (!interpolate_rows(state.view(), colour.view(), executor).ok()) return;
    const auto byte = [](float v) { return static_cast<std::uint8_t>(v + 0.5F); };
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const Vec3f c = colour(x, y);
        texture_(x, shape.height + y) = {byte(c.x), byte(c.y), byte(c.z)};
      }
    }
  }

  // Of a sheet that has nothing hidden.
  MeshTexture(ImageView<const Rgb8> photograph, Span<const std::uint32_t> vertex_pixel)
      : texture_({photograph.width(), 2 * photograph.height()}), texel_(vertex_pixel.begin(), vertex_pixel.end()) {
    for (int y = 0; y < photograph.height(); ++y) {
      std::copy_n(photograph.row(y), photograph.width(), texture_.view().row(y));
      std::copy_n(photograph.row(y), photograph.width(), texture_.view().row(photograph.height() + y));
    }
  }

  // The colours of the first `vertices` vertices.
  [[nodiscard]] PreviewColours colours(std::size_t vertices) const {
    PreviewColours out;
    out.texel = {texel_.data(), vertices};
    out.texture = texture_.view();
    return out;
  }

 private:
  io::Image<Rgb8> texture_;
  std::vector<std::uint32_t> texel_;
};

// Drawn at twice the size and shrunk, which takes the jags off.
template <class Executor>
[[nodiscard]] Status draw_mesh(const PreviewParams& params, const TriangleMeshView& mesh, const PreviewColours& colours,
                               const Intrinsics& camera, const ViewPose& pose, Shape shape, Executor& executor,
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

// The mesh as the thesis shows it: from the photograph's camera, 3 m closer, turned by 45 degrees; and the background
// alone.
template <class Executor>
[[nodiscard]] Status mesh_panels(ImageView<const Rgb8> photograph, const SceneMesh& mesh, ImageView<const float> depth,
                                 const Intrinsics& camera, Executor& executor, std::vector<Panel>& panels) {
  const Shape shape = photograph.shape();
  const int width = std::min(shape.width, 640);
  const Shape small{width, std::max(1, shape.height * width / shape.width)};
  const MeshTexture texture(photograph, mesh, executor);
  const float pivot_m = axis_pivot_m(PivotParams{}, depth);
  const auto draw = [&](const char* title, const TriangleMeshView& part, const MeshViewParams& view) {
    io::Image<Rgb8> picture;
    NPSIM_RETURN_IF_ERROR(draw_mesh(PreviewParams{}, part, texture.colours(part.vertices.size()),
                                    scaled(camera, shape, small), view_pose(view, pivot_m), small, executor, picture));
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

#endif  // NPSIM_SAMPLES_NPSIM_MESH_VIEWS_HPP
