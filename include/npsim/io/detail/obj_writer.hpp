// SPDX-License-Identifier: Apache-2.0
// Wavefront OBJ, the writing half: meshes in named groups, with materials in a file of their own beside it.
//
// Metres, in the camera frame or with y up, as the first line says. Texture coordinates are taken in the image's
// convention (origin upper left) and written in OBJ's (lower left). Numbers have the fewest digits that name the float.
// Cost: linear. Memory: the file's bytes, reserved somewhat too large.
#ifndef NPSIM_IO_DETAIL_OBJ_WRITER_HPP
#define NPSIM_IO_DETAIL_OBJ_WRITER_HPP

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/io/atomic_file.hpp"
#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/mesh.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

struct ObjMaterial {
  std::string name;
  Vec3f colour{1, 1, 1};  // 0..1; multiplies the texture
  Vec3f emissive;         // 0..1
  std::string texture;    // file name as the material file shall give it, or none; needs uv
};

struct ObjGroup {
  std::string name;
  std::size_t first_face = 0;
  std::size_t material = 0;  // number of an ObjMaterial, where there are any
};

struct ObjOptions {
  Span<const Vec2f> uv;                // one per vertex or none; (0, 0) is the image's upper left corner
  Span<const Vec3f> colours;           // one per vertex or none, 0..1
  std::vector<ObjMaterial> materials;  // without groups the first is that of all faces
  std::vector<ObjGroup> groups;        // by rising first_face; each lasts to the next
  MeshFrame frame = MeshFrame::camera;
};

namespace detail {

inline void append_float(std::string& text, float value) {
  char digits[32];
  const std::to_chars_result end = std::to_chars(digits, digits + sizeof digits, value);
  text += ' ';
  text.append(digits, end.ptr);
}
inline void append_index(std::string& text, std::uint32_t zero_based, bool with_uv) {
  char digits[16];
  const std::to_chars_result end = std::to_chars(digits, digits + sizeof digits, std::uint64_t{zero_based} + 1);
  text += ' ';
  text.append(digits, end.ptr);
  if (!with_uv) return;
  text += '/';
  text.append(digits, end.ptr);
}

inline Outcome expect_materials(const std::string& path, const ObjOptions& options) {
  std::string names;
  for (const ObjMaterial& m : options.materials) {
    if (!m.texture.empty() && options.uv.empty()) return Error{path, "texture", "expected texture coordinates with it"};
    if (m.name.empty() || m.name.find_first_of(" \t") != std::string::npos) {
      return Error{path, "names", "expected a name without spaces for each material"};
    }
    names += m.name + m.texture;
  }
  for (const ObjGroup& group : options.groups) {
    names += group.name;
    if (group.material >= std::max<std::size_t>(1, options.materials.size())) {
      return Error{path, group.name, "expected a material that exists"};
    }
  }
  if (names.find_first_of("\n\r") != std::string::npos) {
    return Error{path, "names", "expected texture, material and group names without line breaks"};
  }
  return Done{};
}

inline std::string material_text(const std::vector<ObjMaterial>& materials) {
  std::string text;
  const auto append = [&text](const char* key, const Vec3f& c) {
    text += key;
    for (const float value : {c.x, c.y, c.z}) append_float(text, value);
    text += '\n';
  };
  for (const ObjMaterial& m : materials) {
    text += "newmtl " + m.name + "\n";
    append("Kd", m.colour);
    if (m.emissive != Vec3f{}) append("Ke", m.emissive);
    text += "illum 1\n";
    if (!m.texture.empty()) text += "map_Kd " + m.texture + "\n";
  }
  return text;
}

}  // namespace detail

// Writes path and, with materials, the material file beside it: the same name with extension mtl.
inline Outcome write_obj(const std::string& path, const TriangleMeshView& mesh, const ObjOptions& options = {}) {
  return guarded(path, [&]() -> Outcome {
    const std::size_t vertices = mesh.vertices.size();
    for (const Outcome& outcome :
         {detail::expect_mesh(path, mesh), detail::expect_per_vertex(path, "uv", options.uv.size(), vertices),
          detail::expect_per_vertex(path, "colours", options.colours.size(), vertices),
          detail::expect_materials(path, options)}) {
      if (!outcome) return outcome;
    }
    const bool with_uv = !options.uv.empty();
    const std::filesystem::path material = std::filesystem::path(path).replace_extension(".mtl");
    std::string text = std::string("# NPSim. ") + detail::frame_name(options.frame) + "\n";
    text.reserve(vertices * 48 + mesh.faces.size() * (with_uv ? 50 : 28) + 256);
    if (!options.materials.empty()) text += "mtllib " + material.filename().string() + "\n";
    for (std::size_t i = 0; i < vertices; ++i) {
      const Vec3f v = detail::in_frame(mesh.vertices[i], options.frame);
      text += 'v';
      for (const float c : {v.x, v.y, v.z}) detail::append_float(text, c);
      if (!options.colours.empty()) {
        for (const float c : {options.colours[i].x, options.colours[i].y, options.colours[i].z}) {
          detail::append_float(text, c);
        }
      }
      text += '\n';
    }
    for (const Vec2f& uv : options.uv) {
      text += "vt";
      detail::append_float(text, uv.x);
      detail::append_float(text, 1.0F - uv.y);
      text += '\n';
    }
    const auto use = [&](std::size_t number) {
      if (!options.materials.empty()) text += "usemtl " + options.materials[number].name + "\n";
    };
    if (options.groups.empty() || options.groups[0].first_face > 0) use(0);
    std::size_t group = 0;
    for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
      for (; group < options.groups.size() && options.groups[group].first_face <= i; ++group) {
        text += "o " + options.groups[group].name + "\n";
        use(options.groups[group].material);
      }
      text += 'f';
      for (const std::uint32_t v : {mesh.faces[i].a, mesh.faces[i].b, mesh.faces[i].c}) {
        detail::append_index(text, v, with_uv);
      }
      text += '\n';
    }
    if (!options.materials.empty()) {
      const Outcome written = write_file(material.string(), detail::material_text(options.materials));
      if (!written) return written;
    }
    return write_file(path, text);
  });
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_OBJ_WRITER_HPP
