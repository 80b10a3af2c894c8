// SPDX-License-Identifier: Apache-2.0
// Wavefront OBJ: triangles and polygons in; meshes in named groups out, with materials in a file of their own beside
// it.
//
// Coordinates are read as they are, materials and textures are left alone. tinyobjloader reads; its version 2.0rc10 is
// too lenient to be handed a file as it is: it turns a NaN or a missing coordinate into 0, wraps an index of 2^32 + 1
// to 1, lets indices out of range through and drops polygons without a word. So a first pass checks every line it is
// given: each number has to be finite, each index (vertex, texture, normal; negative ones count back from the last) has
// to name something that stands above it in the file. Only v, vt, vn and f are passed on, so that nothing else in the
// file can name a material file or make the parser allocate. Polygons are cut by tinyobjloader: convex ones exactly,
// concave ones perhaps with triangles that overlap; a file of which it leaves out triangles is refused. Of a number
// written with the fewest digits that name a float reading gives that float, or the next one where rounding in double
// on the way tips the balance: 4 of 3 million floats of random bits, none of 3 million below 256 in steps of 2^-16.
//
// Cost: linear in the file, cubic in a polygon's corners at worst. Memory while reading: 5 times the file, up to 50
// times if it holds little more than faces.
//
// Written are metres, in the camera frame or with y up, as the first line says. Texture coordinates are taken in the
// image's convention (origin upper left) and written in OBJ's (lower left). Numbers have the fewest digits that name
// the float. Cost: linear. Memory: the file's bytes, reserved somewhat too large.
#ifndef NPSIM_IO_OBJ_HPP
#define NPSIM_IO_OBJ_HPP

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include <tiny_obj_loader.h>

#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/io/atomic_file.hpp"
#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/mesh.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

namespace detail {

inline constexpr std::size_t kMaxPolygonCorners = 1024;
inline constexpr std::size_t kMaxObjVertices = std::numeric_limits<std::int32_t>::max();  // tinyobjloader's int

// Cuts the next word off the front of a line.
inline std::string_view next_word(std::string_view& line) {
  constexpr std::string_view kSpace = " \t";
  line.remove_prefix(std::min(line.find_first_not_of(kSpace), line.size()));
  const std::string_view word = line.substr(0, line.find_first_of(kSpace));
  line.remove_prefix(word.size());
  return word;
}

// Whether the word is a number that fits into a float, in a form in which tinyobjloader reads all of it. Words that are
// longer than any float needs could leave its range on the way: 1e400 with 400 zeros before it is 1.
inline bool is_number(std::string_view word) {
  constexpr double kTooLarge = 0x1.ffffffp127;  // the least that rounds to infinity
  if (word.size() > 64) return false;
  if (word.substr(0, 1) == "+" && word.substr(0, 2) != "+-") word.remove_prefix(1);
  double value = 0;
  const std::from_chars_result r = std::from_chars(word.data(), word.data() + word.size(), value);
  return r.ec == std::errc() && r.ptr == word.data() + word.size() && std::fabs(value) < kTooLarge;
}

// Cuts the index off the front of a face's corner; whether there is one that names one of the first `count` elements.
inline bool take_index(std::string_view& corner, std::size_t count) {
  std::int32_t value = 0;
  const std::from_chars_result r = std::from_chars(corner.data(), corner.data() + corner.size(), value);
  if (r.ec != std::errc()) return false;
  corner.remove_prefix(static_cast<std::size_t>(r.ptr - corner.data()));
  const std::int64_t distance = value < 0 ? -std::int64_t{value} : value;
  return distance > 0 && static_cast<std::size_t>(distance) <= count;
}
inline bool take_slash(std::string_view& corner) {
  if (corner.empty() || corner.front() != '/') return false;
  corner.remove_prefix(1);
  return true;
}

// What stands above a line, and how many triangles the faces make.
struct ObjCounts {
  std::size_t vertices = 0;
  std::size_t texture = 0;
  std::size_t normals = 0;
  std::size_t triangles = 0;
};

// One corner of a face: v, v/vt, v//vn or v/vt/vn.
inline bool is_corner(std::string_view corner, const ObjCounts& above) {
  if (!take_index(corner, above.vertices)) return false;
  if (corner.empty()) return true;
  if (!take_slash(corner)) return false;
  if (take_slash(corner)) return take_index(corner, above.normals) && corner.empty();
  if (!take_index(corner, above.texture)) return false;
  if (corner.empty()) return true;
  return take_slash(corner) && take_index(corner, above.normals) && corner.empty();
}

// What is wrong with the words after a v, vt, vn or f; empty if nothing is.
inline std::string check_obj_line(std::string_view keyword, std::string_view line, ObjCounts& counts) {
  const bool is_face = keyword == "f";
  std::size_t words = 0;
  for (std::string_view word = next_word(line); !word.empty(); word = next_word(line), ++words) {
    if (is_face ? is_corner(word, counts) : is_number(word)) continue;
    return "'" + std::string(word.substr(0, 40)) + "', expected " +
           (is_face ? "a face's corner v, v/vt, v//vn or v/vt/vn that names what stands above it, with v in 1.." +
                          std::to_string(counts.vertices) + " or counted back"
                    : "a finite number");
  }
  if (is_face) {
    if (words < 3 || words > kMaxPolygonCorners) return std::to_string(words) + " corners, expected 3 to 1024 a face";
    counts.triangles += words - 2;
  } else if (keyword == "v") {
    if (words != 3 && words != 4 && words != 6) return "expected 3 coordinates, then a weight, a colour or nothing";
    if (++counts.vertices > kMaxObjVertices) return "expected less than 2^31 vertices";
  } else if (keyword == "vt") {
    if (words < 1 || words > 3) return "expected 1 to 3 texture coordinates";
    ++counts.texture;
  } else {
    if (words != 3) return "expected 3 components of a normal";
    ++counts.normals;
  }
  return {};
}

// The file's v, vt, vn and f lines without comments, each checked.
inline Expected<std::string> checked_obj_text(const std::string& path, std::string_view file, ObjCounts& counts) {
  std::string text;
  text.reserve(file.size() + 1);
  if (file.substr(0, 3) == "\xEF\xBB\xBF") file.remove_prefix(3);  // byte order mark
  for (std::size_t number = 1; !file.empty(); ++number) {
    const std::string_view whole = file.substr(0, file.find('\n'));
    file.remove_prefix(std::min(whole.size() + 1, file.size()));
    std::string_view line = whole.substr(0, whole.find('#'));
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    std::string_view words = line;
    const std::string_view keyword = next_word(words);
    if (keyword != "v" && keyword != "vt" && keyword != "vn" && keyword != "f") continue;
    const std::string problem = check_obj_line(keyword, words, counts);
    if (!problem.empty()) return Error{path, "line " + std::to_string(number), problem};
    text.append(line) += '\n';
  }
  return text;
}

}  // namespace detail

inline Expected<Mesh> read_obj(const std::string& path, const ReadLimits& limits = {}) {
  return guarded(path, [&]() -> Expected<Mesh> {
    Expected<Bytes> file = read_file_bytes(path, limits);
    if (!file) return file.error();
    const std::string_view bytes(reinterpret_cast<const char*>(file.value().data()), file.value().size());
    detail::ObjCounts counts;
    const Expected<std::string> text = detail::checked_obj_text(path, bytes, counts);
    if (!text) return text.error();
    if (counts.vertices == 0) return Error{path, "", "has no vertex: expected lines like 'v 0 0 1'"};
    file.value() = Bytes();  // the parser needs the memory

    tinyobj::ObjReaderConfig config;
    config.vertex_color = false;  // no colours unless each vertex has one
    tinyobj::ObjReader reader;
    if (!reader.ParseFromString(text.value(), "", config)) {
      return Error{path, "", "expected OBJ, tinyobjloader says: " + reader.Error()};
    }
    const auto triples = [](const std::vector<float>& numbers) {
      std::vector<Vec3f> vectors;
      vectors.reserve(numbers.size() / 3);
      for (std::size_t i = 0; i + 2 < numbers.size(); i += 3) {
        vectors.push_back({numbers[i], numbers[i + 1], numbers[i + 2]});
      }
      return vectors;
    };
    Mesh mesh;
    mesh.vertices = triples(reader.GetAttrib().vertices);
    mesh.colours = triples(reader.GetAttrib().colors);
    mesh.faces.reserve(counts.triangles);
    for (const tinyobj::shape_t& shape : reader.GetShapes()) {
      const std::vector<tinyobj::index_t>& corners = shape.mesh.indices;
      const auto vertex = [&](std::size_t i) { return static_cast<std::uint32_t>(corners[i].vertex_index); };
      for (std::size_t i = 0; i + 2 < corners.size(); i += 3) {
        mesh.faces.push_back({vertex(i), vertex(i + 1), vertex(i + 2)});
      }
    }
    if (mesh.vertices.size() != counts.vertices || mesh.faces.size() != counts.triangles) {
      return Error{path, "faces",
                   std::to_string(mesh.faces.size()) + " triangles, expected " + std::to_string(counts.triangles) +
                       ": a concave polygon could not be cut, expected convex ones"};
    }
    const Outcome sound = detail::expect_mesh(path, mesh.view());
    if (!sound) return sound.error();
    return mesh;
  });
}

namespace detail {

// The files that lines with one of the keywords name, next to `path`. A line may name one file with spaces, several
// files, or options and a file: every reading of it is in the list.
template <class Keyword>
std::vector<std::string> files_named_in(const std::string& path, Keyword&& is_keyword) {
  std::vector<std::string> files;
  std::error_code code;
  if (!std::filesystem::is_regular_file(path, code)) return files;
  std::ifstream file(path, std::ios::binary);
  for (std::string text; std::getline(file, text);) {
    while (!text.empty() && (text.back() == '\r' || text.back() == ' ' || text.back() == '\t')) text.pop_back();
    std::string_view line = text;
    if (!is_keyword(next_word(line)) || line.empty()) continue;
    const std::filesystem::path folder = std::filesystem::path(path).parent_path();
    while (!line.empty()) {
      line.remove_prefix(line.find_first_not_of(" \t"));
      files.push_back((folder / std::string(line)).string());
      files.push_back((folder / std::string(next_word(line))).string());
    }
  }
  return files;
}

}  // namespace detail

// The material files that an OBJ names and the textures that these name, whether or not they exist; other names among
// them do no harm. For programs that must not write over what they read.
inline std::vector<std::string> files_beside_obj(const std::string& path) {
  std::vector<std::string> files =
      detail::files_named_in(path, [](std::string_view keyword) { return keyword == "mtllib"; });
  constexpr std::string_view kTextures[] = {"bump", "decal", "disp", "norm", "refl"};
  for (std::size_t i = 0, libraries = files.size(); i < libraries; ++i) {
    const std::vector<std::string> textures = detail::files_named_in(files[i], [&](std::string_view keyword) {
      return keyword.substr(0, 4) == "map_" ||
             std::find(std::begin(kTextures), std::end(kTextures), keyword) != std::end(kTextures);
    });
    files.insert(files.end(), textures.begin(), textures.end());
  }
  return files;
}

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

#endif  // NPSIM_IO_OBJ_HPP
