// SPDX-License-Identifier: Apache-2.0
#include "mesh_textures.hpp"

#include <cstddef>
#include <cstdint>
#include <utility>

#include "npsim/color/srgb.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/io/atomic_file.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/mesh/complete.hpp"

namespace npsim::tool {

Rgb8 encoded(const Vec3f& linear) { return {srgb_encode8(linear.x), srgb_encode8(linear.y), srgb_encode8(linear.z)}; }

io::Image<Rgb8> without_objects(const io::Image<Rgb8>& photograph, const SceneMesh& mesh) {
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

MeshTextures photograph_textures(const io::Image<Rgb8>& photograph, const SceneMesh& mesh) {
  MeshTextures t;
  t.objects = {"photograph", "day.png", photograph, {}};
  t.background = {"background", "background.png", without_objects(photograph, mesh), {}};
  return t;
}

MeshTextures albedo_textures(const SceneMesh& mesh, const SurfacePoints& points) {
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

io::Outcome write_texture(const std::string& folder, MeshTexture& texture) {
  const std::string path = folder + "/" + texture.file;
  auto png = io::encode_png(path, std::as_const(texture.image).view());
  if (!png) return png.error();
  texture.png = std::move(png.value());
  return io::write_file(path, texture.png.data(), texture.png.size());
}

}  // namespace npsim::tool
