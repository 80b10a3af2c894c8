// SPDX-License-Identifier: Apache-2.0
// GLB (glTF 2.0, binary): the night's scene in one file that any viewer opens, photograph included.
//
// Every primitive becomes a node with its own mesh; those that follow one another and agree in their material share it.
// glTF has y up, right-handed, and looks along -z: MeshFrame::y_up. Texture coordinates have their origin at the
// image's upper left corner, as here. Normals are brought to unit length. The file is without errors, warnings and
// remarks in the Khronos validator, but for one on textures whose sides are no powers of two: they are clamped and have
// no mip levels, so that glTF 2.0 viewers need not scale them. Plain glTF without extensions: an emitter shows its
// colour, not its power (emissiveFactor is at most 1). Cost: linear. Memory: the file's bytes twice.
#ifndef NPSIM_IO_GLB_HPP
#define NPSIM_IO_GLB_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/io/atomic_file.hpp"
#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/mesh.hpp"
#include "npsim/io/ply.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

struct GlbTexture {
  std::string name;
  Span<const unsigned char> file;  // bytes of a PNG or JPEG file
};

struct GlbPrimitive {
  std::string name;
  std::string material;        // its name; empty: that of the primitive
  TriangleMeshView mesh;       // camera frame, m; without faces it is left out
  Span<const Vec3f> normals;   // one per vertex or none
  Span<const Vec2f> uv;        // one per vertex or none; with it the texture, if there is one, is the base colour
  std::size_t texture = 0;     // number of a texture
  Vec3f base_colour{1, 1, 1};  // linear, 0..1; multiplies the texture
  Vec3f emissive;              // linear, 0..1
  float roughness = 1.0F;      // 0..1
  bool double_sided = true;    // a sheet has no back, but is looked at from there
};

// Texture coordinates of the centres of pixels y * width + x.
[[nodiscard]] inline std::vector<Vec2f> photograph_uv(Span<const std::uint32_t> pixels, Shape shape) {
  std::vector<Vec2f> uv(pixels.size());
  const auto width = static_cast<std::uint32_t>(shape.width);
  for (std::size_t i = 0; i < uv.size() && width > 0; ++i) {
    uv[i] = {(static_cast<float>(pixels[i] % width) + 0.5F) / static_cast<float>(shape.width),
             (static_cast<float>(pixels[i] / width) + 0.5F) / static_cast<float>(shape.height)};
  }
  return uv;
}

namespace detail {

// The glTF document and its binary chunk while they grow.
struct GlbBuilder {
  nlohmann::json root;
  std::string binary;

  // Everything written since `begin` becomes a view; returns its number.
  std::size_t add_view(std::size_t begin, int target) {
    nlohmann::json view = {{"buffer", 0}, {"byteOffset", begin}, {"byteLength", binary.size() - begin}};
    if (target != 0) view["target"] = target;
    binary.resize((binary.size() + 3) / 4 * 4, '\0');
    root["bufferViews"].push_back(view);
    return root["bufferViews"].size() - 1;
  }
  std::size_t add_accessor(std::size_t view, int component, std::size_t count, const char* type) {
    root["accessors"].push_back({{"bufferView", view}, {"componentType", component}, {"count", count}, {"type", type}});
    return root["accessors"].size() - 1;
  }
};

inline constexpr int kGlArrayBuffer = 34962, kGlElementArrayBuffer = 34963, kGlFloat = 5126, kGlUnsignedInt = 5125;

[[nodiscard]] inline Vec3f to_gltf(const Vec3f& v) { return in_frame(v, MeshFrame::y_up); }

// Floats are exact as doubles, so the bounds in the document are the bounds of the data.
[[nodiscard]] inline nlohmann::json json_of(const Vec3f& v) {
  return {static_cast<double>(v.x), static_cast<double>(v.y), static_cast<double>(v.z)};
}

inline std::size_t add_positions(GlbBuilder& glb, Span<const Vec3f> vertices) {
  const std::size_t begin = glb.binary.size();
  Vec3f low = to_gltf(vertices[0]);
  Vec3f high = low;
  for (const Vec3f& v : vertices) {
    const Vec3f p = to_gltf(v);
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    append_vec3(glb.binary, p);
  }
  const std::size_t accessor = glb.add_accessor(glb.add_view(begin, kGlArrayBuffer), kGlFloat, vertices.size(), "VEC3");
  glb.root["accessors"][accessor]["min"] = json_of(low);
  glb.root["accessors"][accessor]["max"] = json_of(high);
  return accessor;
}

inline constexpr std::size_t kNoGlbTexture = ~std::size_t{0};

// Number of the material of a primitive: the last one where it is the same.
inline std::size_t add_material(GlbBuilder& glb, const GlbPrimitive& p, std::size_t texture) {
  nlohmann::json surface = {{"metallicFactor", 0}, {"roughnessFactor", static_cast<double>(p.roughness)}};
  surface["baseColorFactor"] = json_of(p.base_colour);
  surface["baseColorFactor"].push_back(1.0);
  if (texture != kNoGlbTexture) surface["baseColorTexture"] = {{"index", texture}};
  nlohmann::json material = {{"name", p.material.empty() ? p.name : p.material}, {"pbrMetallicRoughness", surface}};
  if (p.emissive != Vec3f{}) material["emissiveFactor"] = json_of(p.emissive);
  if (p.double_sided) material["doubleSided"] = true;
  nlohmann::json& materials = glb.root["materials"];
  if (materials.empty() || materials.back() != material) materials.push_back(std::move(material));
  return materials.size() - 1;
}

inline void add_primitive(GlbBuilder& glb, const GlbPrimitive& p, std::size_t texture) {
  nlohmann::json attributes = {{"POSITION", add_positions(glb, p.mesh.vertices)}};
  const std::size_t vertices = p.mesh.vertices.size();
  if (!p.normals.empty()) {
    const std::size_t begin = glb.binary.size();
    for (const Vec3f& n : p.normals) {
      append_vec3(glb.binary, vec_cast<float>(normalized(vec_cast<double>(to_gltf(n)))));
    }
    attributes["NORMAL"] = glb.add_accessor(glb.add_view(begin, kGlArrayBuffer), kGlFloat, vertices, "VEC3");
  }
  if (texture != kNoGlbTexture) {
    const std::size_t begin = glb.binary.size();
    for (const Vec2f& uv : p.uv) {
      append_f32(glb.binary, uv.x);
      append_f32(glb.binary, uv.y);
    }
    attributes["TEXCOORD_0"] = glb.add_accessor(glb.add_view(begin, kGlArrayBuffer), kGlFloat, vertices, "VEC2");
  }
  const std::size_t begin = glb.binary.size();
  for (const Face& f : p.mesh.faces) {
    for (const std::uint32_t v : {f.a, f.b, f.c}) append_u32(glb.binary, v);
  }
  const std::size_t indices =
      glb.add_accessor(glb.add_view(begin, kGlElementArrayBuffer), kGlUnsignedInt, 3 * p.mesh.faces.size(), "SCALAR");
  const std::size_t number = glb.root["nodes"].size();
  glb.root["meshes"].push_back({{"name", p.name},
                                {"primitives",
                                 {{{"attributes", attributes},
                                   {"indices", indices},
                                   {"material", add_material(glb, p, texture)},
                                   {"mode", 4}}}}});
  glb.root["nodes"].push_back({{"name", p.name}, {"mesh", number}});
  glb.root["scenes"][0]["nodes"].push_back(number);
}

inline Outcome expect_primitive(const std::string& path, const GlbPrimitive& p, std::size_t textures) {
  const auto in_range = [](const Vec3f& c) {
    return c.x >= 0 && c.x <= 1 && c.y >= 0 && c.y <= 1 && c.z >= 0 && c.z <= 1;
  };
  const std::size_t vertices = p.mesh.vertices.size();
  for (const Outcome& outcome :
       {expect_mesh(path, p.mesh), expect_per_vertex(path, "normals", p.normals.size(), vertices),
        expect_per_vertex(path, "uv", p.uv.size(), vertices)}) {
    if (!outcome) return outcome;
  }
  if (textures > 0 && !p.uv.empty() && p.texture >= textures)
    return Error{path, p.name, "expected a texture that exists"};
  for (const Vec3f& n : p.normals) {
    if (!is_finite(n) || n == Vec3f{})
      return Error{path, p.name, "has a normal without a direction: expected finite, non-zero vectors"};
  }
  for (const Vec2f& uv : p.uv) {
    if (!std::isfinite(uv.x) || !std::isfinite(uv.y)) {
      return Error{path, p.name, "has a texture coordinate that is not finite: expected numbers"};
    }
  }
  if (!in_range(p.base_colour) || !in_range(p.emissive) || !(p.roughness >= 0 && p.roughness <= 1)) {
    return Error{path, p.name, "has a colour, emission or roughness out of range: expected 0..1"};
  }
  return Done{};
}

// Media type by the first bytes; empty when it is neither PNG nor JPEG, the two that glTF has.
[[nodiscard]] inline std::string texture_type(Span<const unsigned char> bytes) {
  const auto starts = [&bytes](std::initializer_list<unsigned char> magic) {
    return bytes.size() >= magic.size() && std::equal(magic.begin(), magic.end(), bytes.begin());
  };
  if (starts({0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'})) return "image/png";
  return starts({0xFF, 0xD8, 0xFF}) ? "image/jpeg" : "";
}

}  // namespace detail

// Textures that no primitive wears are left out; without textures no texture coordinates are written either.
inline Outcome write_glb(const std::string& path, Span<const GlbPrimitive> primitives,
                         Span<const GlbTexture> textures = {}) {
  return guarded(path, [&]() -> Outcome {
    for (const GlbTexture& t : textures) {
      if (!detail::texture_type(t.file).empty()) continue;
      return Error{path, t.name, "has unknown content: expected the bytes of a PNG or JPEG file"};
    }
    detail::GlbBuilder glb;
    glb.root["asset"] = {{"version", "2.0"}, {"generator", "NPSim " NPSIM_VERSION_STRING}};
    glb.root["scene"] = 0;
    glb.root["scenes"] = nlohmann::json::array({nlohmann::json::object()});
    std::vector<std::size_t> worn;  // textures, in the order in which they are needed
    for (const GlbPrimitive& p : primitives) {
      const Outcome outcome = detail::expect_primitive(path, p, textures.size());
      if (!outcome) return outcome;
      if (p.mesh.faces.empty()) continue;
      std::size_t texture = detail::kNoGlbTexture;
      if (!textures.empty() && !p.uv.empty()) {
        texture = static_cast<std::size_t>(std::find(worn.begin(), worn.end(), p.texture) - worn.begin());
        if (texture == worn.size()) worn.push_back(p.texture);
      }
      detail::add_primitive(glb, p, texture);
    }
    if (glb.root.count("nodes") == 0) return Error{path, "", "would have no face: expected at least one"};
    for (std::size_t number = 0; number < worn.size(); ++number) {
      const GlbTexture& t = textures[worn[number]];
      const std::size_t begin = glb.binary.size();
      glb.binary.append(reinterpret_cast<const char*>(t.file.data()), t.file.size());
      glb.root["images"].push_back(
          {{"name", t.name}, {"mimeType", detail::texture_type(t.file)}, {"bufferView", glb.add_view(begin, 0)}});
      glb.root["textures"].push_back({{"source", number}, {"sampler", 0}});
    }
    if (!worn.empty()) {
      // Clamped and without mip levels: the sheet has one vertex a pixel.
      glb.root["samplers"].push_back({{"magFilter", 9729}, {"minFilter", 9729}, {"wrapS", 33071}, {"wrapT", 33071}});
    }
    glb.root["buffers"].push_back({{"byteLength", glb.binary.size()}});
    std::string document = glb.root.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    document.resize((document.size() + 3) / 4 * 4, ' ');
    const std::size_t total = 12 + 8 + document.size() + 8 + glb.binary.size();
    if (total > 0xFFFFFFFFU) return Error{path, "", "would exceed the format: expected less than 4 GiB"};
    std::string bytes;
    bytes.reserve(total);
    for (const std::size_t word : {std::size_t{0x46546C67}, std::size_t{2}, total, document.size(),
                                   std::size_t{0x4E4F534A}}) {  // "glTF", version, length; length, "JSON"
      detail::append_u32(bytes, static_cast<std::uint32_t>(word));
    }
    bytes += document;
    detail::append_u32(bytes, static_cast<std::uint32_t>(glb.binary.size()));
    detail::append_u32(bytes, 0x004E4942);  // "BIN"
    bytes += glb.binary;
    return write_file(path, bytes);
  });
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_GLB_HPP
