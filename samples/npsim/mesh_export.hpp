// SPDX-License-Identifier: Apache-2.0
// The scene mesh as files: mesh.obj with its material and mesh.glb, both textured with the daytime photograph, in
// parts: background, foreground objects, emitters. background.glb is the street with all objects taken away.
#ifndef NPSIM_SAMPLES_NPSIM_MESH_EXPORT_HPP
#define NPSIM_SAMPLES_NPSIM_MESH_EXPORT_HPP

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "npsim/io/file_bytes.hpp"
#include "npsim/io/glb.hpp"
#include "npsim/io/obj.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/io/scene.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/pipeline/relight.hpp"

namespace npsim::tool {

// A part of the scene mesh with vertices of its own.
struct MeshPart {
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  std::vector<Vec3f> normals;
  std::vector<Vec2f> uv;

  [[nodiscard]] io::GlbPrimitive primitive(std::string name) const {
    io::GlbPrimitive p;
    p.name = std::move(name);
    p.mesh = {{vertices.data(), vertices.size()}, {faces.data(), faces.size()}};
    p.normals = {normals.data(), normals.size()};
    p.uv = {uv.data(), uv.size()};
    return p;
  }
};

// The vertices [first, last) and the faces between them, which a layer keeps to itself.
[[nodiscard]] inline MeshPart layer_part(const SceneMesh& mesh, const SurfacePoints& points, Span<const Vec2f> uv,
                                         std::size_t first_vertex, std::size_t last_vertex, std::size_t first_face,
                                         std::size_t last_face) {
  MeshPart part;
  part.vertices.assign(mesh.mesh.vertices.begin() + first_vertex, mesh.mesh.vertices.begin() + last_vertex);
  part.normals.assign(points.normal.begin() + first_vertex, points.normal.begin() + last_vertex);
  part.uv.assign(uv.begin() + first_vertex, uv.begin() + last_vertex);
  const auto offset = static_cast<std::uint32_t>(first_vertex);
  for (std::size_t f = first_face; f < last_face; ++f) {
    const Face face = mesh.mesh.faces[f];
    part.faces.push_back({face.a - offset, face.b - offset, face.c - offset});
  }
  return part;
}

// Every emitter's luminous patch.
[[nodiscard]] inline MeshPart emitter_part(Span<const Emitter> emitters) {
  MeshPart part;
  for (const Emitter& e : emitters) {
    const auto first = static_cast<std::uint32_t>(part.vertices.size());
    for (const auto& [u, v] : {std::pair{-1.0F, -1.0F}, {1.0F, -1.0F}, {1.0F, 1.0F}, {-1.0F, 1.0F}}) {
      part.vertices.push_back(e.centre_m + e.half_u_m * u + e.half_v_m * v);
    }
    part.faces.push_back({first, first + 1, first + 2});
    part.faces.push_back({first, first + 2, first + 3});
  }
  return part;
}

[[nodiscard]] inline io::Outcome export_mesh(const std::string& folder, const io::Scene& scene, const SceneMesh& mesh,
                                             const Relighting& light) {
  if (mesh.mesh.faces.empty()) return io::Done{};  // a single row or column of pixels
  if (const io::Outcome o = io::write_png(folder + "/day.png", scene.image.view()); !o) return o;
  const io::Expected<io::Bytes> photograph = io::read_file_bytes(folder + "/day.png");
  if (!photograph) return photograph.error();
  const Span<const unsigned char> png(photograph.value().data(), photograph.value().size());

  const std::vector<Vec2f> uv = io::photograph_uv(mesh.vertex_pixel, scene.image.shape());
  const Span<const Vec2f> uv_view(uv.data(), uv.size());
  const std::size_t back_vertices = mesh.background_vertices;
  const std::size_t back_faces = mesh.background_faces;
  const MeshPart background = layer_part(mesh, light.points, uv_view, 0, back_vertices, 0, back_faces);
  const MeshPart foreground = layer_part(mesh, light.points, uv_view, back_vertices, mesh.mesh.vertices.size(),
                                         back_faces, mesh.mesh.faces.size());
  const MeshPart emitters = emitter_part(light.emitters);
  std::vector<io::GlbPrimitive> parts = {background.primitive("background"), foreground.primitive("foreground"),
                                         emitters.primitive("emitters")};
  parts[2].base_colour = {0, 0, 0};
  parts[2].emissive = {1, 0.9F, 0.7F};
  if (const io::Outcome o = io::write_glb(folder + "/mesh.glb", {parts.data(), parts.size()}, png); !o) return o;
  // A picture of nothing but objects has no background.
  if (!background.faces.empty()) {
    if (const io::Outcome o = io::write_glb(folder + "/background.glb", {parts.data(), 1}, png); !o) return o;
  }

  io::ObjOptions options;
  options.uv = uv_view;
  options.texture = "day.png";
  options.groups = {{"background", 0}, {"foreground", back_faces}};
  return io::write_obj(folder + "/mesh.obj", mesh.mesh, options);
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_NPSIM_MESH_EXPORT_HPP
