// SPDX-License-Identifier: Apache-2.0
#include "mesh_export.hpp"

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "file_tasks.hpp"
#include "npsim/io/glb.hpp"
#include "npsim/io/obj.hpp"
#include "npsim/io/ply.hpp"

namespace npsim::tool {
namespace {

[[nodiscard]] const MeshTexture& texture_of(const MeshTextures& textures, std::size_t number) {
  return number == kBackgroundTexture ? textures.background : textures.objects;
}

// Several parts as one mesh.
struct JoinedParts {
  std::vector<Vec3f> vertices;
  std::vector<Vec3f> normals;
  std::vector<Face> faces;
  std::vector<Vec2f> uv;      // (0, 0) without a texture
  std::vector<Rgb8> colours;  // of the texture at the vertex, or of what the part emits

  [[nodiscard]] TriangleMeshView view() const {
    return {{vertices.data(), vertices.size()}, {faces.data(), faces.size()}};
  }
};

[[nodiscard]] JoinedParts join(Span<const MeshPart> parts, const MeshTextures& textures) {
  JoinedParts all;
  for (const MeshPart& part : parts) {
    const auto offset = static_cast<std::uint32_t>(all.vertices.size());
    all.vertices.insert(all.vertices.end(), part.vertices.begin(), part.vertices.end());
    all.normals.insert(all.normals.end(), part.normals.begin(), part.normals.end());
    for (const Face& f : part.faces) all.faces.push_back({f.a + offset, f.b + offset, f.c + offset});
    if (part.texture == kNoTexture) {
      all.uv.resize(all.vertices.size());
      all.colours.resize(all.vertices.size(), encoded(part.emissive));
      continue;
    }
    const io::Image<Rgb8>& image = texture_of(textures, part.texture).image;
    const std::vector<Vec2f> uv = io::photograph_uv({part.pixels.data(), part.pixels.size()}, image.shape());
    all.uv.insert(all.uv.end(), uv.begin(), uv.end());
    const auto width = static_cast<std::uint32_t>(image.width());
    for (const std::uint32_t p : part.pixels) {
      all.colours.push_back(image(static_cast<int>(p % width), static_cast<int>(p / width)));
    }
  }
  return all;
}

[[nodiscard]] io::Outcome write_parts_glb(const std::string& path, Span<const MeshPart> parts,
                                          const MeshTextures& textures) {
  std::vector<io::GlbTexture> files;
  for (const MeshTexture* t : {&textures.background, &textures.objects}) {
    files.push_back({t->name, {t->png.data(), t->png.size()}});
  }
  std::vector<std::vector<Vec2f>> uv;
  std::vector<io::GlbPrimitive> primitives;
  uv.reserve(parts.size());
  for (const MeshPart& part : parts) {
    uv.emplace_back();
    io::GlbPrimitive p;
    p.name = part.name;
    p.material = part.material;
    p.mesh = {{part.vertices.data(), part.vertices.size()}, {part.faces.data(), part.faces.size()}};
    p.normals = {part.normals.data(), part.normals.size()};
    p.base_colour = part.colour;
    p.emissive = part.emissive;
    if (part.texture != kNoTexture) {
      const Shape shape = texture_of(textures, part.texture).image.shape();
      uv.back() = io::photograph_uv({part.pixels.data(), part.pixels.size()}, shape);
      p.uv = {uv.back().data(), uv.back().size()};
      p.texture = part.texture;
    }
    primitives.push_back(p);
  }
  return io::write_glb(path, {primitives.data(), primitives.size()}, {files.data(), files.size()});
}

[[nodiscard]] io::Outcome write_parts_obj(const std::string& path, Span<const MeshPart> parts, const JoinedParts& all,
                                          const MeshTextures& textures) {
  io::ObjOptions options;
  options.uv = {all.uv.data(), all.uv.size()};
  options.frame = io::MeshFrame::y_up;
  std::size_t first_face = 0;
  for (const MeshPart& part : parts) {
    if (options.materials.empty() || options.materials.back().name != part.material) {
      const bool textured = part.texture != kNoTexture;
      options.materials.push_back({part.material, part.colour, part.emissive,
                                   textured ? texture_of(textures, part.texture).file : std::string()});
    }
    options.groups.push_back({part.name, first_face, options.materials.size() - 1});
    first_face += part.faces.size();
  }
  return io::write_obj(path, all.view(), options);
}

}  // namespace

io::Outcome write_parts(const std::string& stem, Span<const MeshPart> parts, const MeshTextures& textures,
                        ThreadPool& pool) {
  const JoinedParts all = join(parts, textures);
  io::PlyOptions ply;
  ply.normals = {all.normals.data(), all.normals.size()};
  ply.colours = {all.colours.data(), all.colours.size()};
  ply.frame = io::MeshFrame::y_up;
  const std::string glb_path = stem + ".glb";
  const std::string obj_path = stem + ".obj";
  const std::string ply_path = stem + ".ply";
  return write_files({{obj_path, [&] { return write_parts_obj(obj_path, parts, all, textures); }},
                      {glb_path, [&] { return write_parts_glb(glb_path, parts, textures); }},
                      {ply_path, [&] { return io::write_ply(ply_path, all.view(), ply); }}},
                     pool);
}

io::Outcome export_mesh(const std::string& folder, const io::Scene& scene, const SceneMesh& mesh,
                        const Relighting& light, ThreadPool& pool, const MeshExportOptions& options) {
  MeshTextures textures = options.albedo ? albedo_textures(mesh, light.points) : photograph_textures(scene.image, mesh);
  const io::Outcome textured = write_files(
      {{folder + "/" + textures.background.file, [&] { return write_texture(folder, textures.background); }},
       {folder + "/" + textures.objects.file, [&] { return write_texture(folder, textures.objects); }}},
      pool);
  if (!textured) return textured;
  if (mesh.mesh.faces.empty()) return io::Done{};  // a single row or column of pixels

  const LayeredMesh layers{mesh.mesh.vertices, light.points.normal, mesh.vertex_pixel, mesh.mesh.faces,
                           mesh.background_faces};
  std::vector<MeshPart> parts;
  const bool background = mesh.background_faces > 0;  // a picture of nothing but objects has none
  if (background) parts.push_back(background_part(layers, kBackgroundTexture));
  for (std::vector<MeshPart> more : {object_parts(layers, scene.labels.view(), mesh.object, kObjectsTexture),
                                     emitter_parts(light.emitters, {scene.lights.data(), scene.lights.size()})}) {
    parts.insert(parts.end(), std::make_move_iterator(more.begin()), std::make_move_iterator(more.end()));
  }
  if (io::Outcome o = write_parts(folder + "/mesh", {parts.data(), parts.size()}, textures, pool); !o) return o;
  return background ? write_parts(folder + "/background", {parts.data(), 1}, textures, pool) : io::Outcome(io::Done{});
}

}  // namespace npsim::tool
