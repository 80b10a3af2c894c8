// SPDX-License-Identifier: Apache-2.0
// What the exported mesh wears: the photograph as it is for what stands in front, and for the background a picture of
// the street without its objects, in which what they hide is continued from both sides along the row, as the light
// that the night's simulation reflects there is. Either of the photograph or of the albedo, both as 8-bit sRGB.
#ifndef NPSIM_SAMPLES_TOOL_MESH_TEXTURES_HPP
#define NPSIM_SAMPLES_TOOL_MESH_TEXTURES_HPP

#include <cstdint>
#include <string>
#include <utility>

#include "npsim/color/srgb.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/io/scene.hpp"
#include "npsim/mesh/interpolate_rows.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/pipeline/relight.hpp"

namespace npsim::tool {

struct MeshTexture {
  std::string name;
  std::string file;  // in the output folder
  io::Image<Rgb8> image;
  io::Bytes png;
};

struct MeshTextures {
  MeshTexture background;
  MeshTexture objects;
};

[[nodiscard]] inline Rgb8 encoded(const Vec3f& linear) {
  return {srgb_encode8(linear.x), srgb_encode8(linear.y), srgb_encode8(linear.z)};
}

// The photograph with the pixels that show objects filled from the background beside them.
[[nodiscard]] inline io::Image<Rgb8> without_objects(const io::Image<Rgb8>& photograph, const SceneMesh& mesh) {
  const Shape shape = photograph.shape();
  io::Image<Vec3f> linear(shape);
  io::Image<std::uint8_t> state(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const Rgb8 c = photograph(x, y);
      linear(x, y) = {srgb_decode8(c.r), srgb_decode8(c.g), srgb_decode8(c.b)};
      const bool seen = mesh.visible_vertex(x, y) < mesh.background_vertices;
      const bool blocked = mesh.background_state(x, y) == row_state::blocked;
      state(x, y) = seen ? row_state::known : (blocked ? row_state::blocked : row_state::missing);
    }
  }
  SerialExecutor executor;
  io::Image<Rgb8> out(photograph);
  if (!interpolate_rows(state.view(), linear.view(), executor).ok()) return out;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (state(x, y) == row_state::missing) out(x, y) = encoded(linear(x, y));
    }
  }
  return out;
}

[[nodiscard]] inline MeshTextures photograph_textures(const io::Scene& scene, const SceneMesh& mesh) {
  MeshTextures t;
  t.objects = {"photograph", "day.png", scene.image, {}};
  t.background = {"background", "background.png", without_objects(scene.image, mesh), {}};
  return t;
}

[[nodiscard]] inline MeshTextures albedo_textures(const SceneMesh& mesh, const SurfacePoints& points) {
  const Shape shape = mesh.visible_vertex.shape();
  const auto width = static_cast<std::uint32_t>(shape.width);
  MeshTextures t;
  t.objects = {"albedo", "albedo.png", io::Image<Rgb8>(shape), {}};
  t.background = {"background", "albedo_background.png", io::Image<Rgb8>(shape), {}};
  const auto paint = [&](std::size_t first, std::size_t last, io::Image<Rgb8>& image) {
    for (std::size_t v = first; v < last; ++v) {
      const std::uint32_t pixel = mesh.vertex_pixel[v];
      image(static_cast<int>(pixel % width), static_cast<int>(pixel / width)) = encoded(points.albedo[v]);
    }
  };
  paint(0, mesh.background_vertices, t.background.image);
  paint(mesh.background_vertices, mesh.mesh.vertices.size(), t.objects.image);
  return t;
}

// Writes the files, and keeps their bytes for those that hold everything in one.
[[nodiscard]] inline io::Outcome write_textures(const std::string& folder, MeshTextures& textures) {
  for (MeshTexture* t : {&textures.background, &textures.objects}) {
    const std::string path = folder + "/" + t->file;
    if (io::Outcome o = io::write_png(path, t->image.view()); !o) return o;
    io::Expected<io::Bytes> bytes = io::read_file_bytes(path);
    if (!bytes) return bytes.error();
    t->png = std::move(bytes.value());
  }
  return io::Done{};
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_MESH_TEXTURES_HPP
