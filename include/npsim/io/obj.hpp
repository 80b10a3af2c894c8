// SPDX-License-Identifier: Apache-2.0
// Wavefront OBJ: writes meshes with a photograph as texture, reads triangles and polygons.
//
// Coordinates are written and read as they are: the camera frame, x right, y down, z forward, metres. Texture
// coordinates are taken in the image's convention (origin upper left) and written in OBJ's (lower left).
// The reader is strict, and our own: tinyobjloader 2.0rc10 turns a NaN or a missing coordinate into 0, wraps an index
// of 2^32 + 1 to 1, drops polygons with a bad index without a word and lets other indices out of range through. Here
// every number has to be finite, every index (vertex, texture, normal; negative ones count back from the last) has to
// name something that stands above it in the file. Polygons are triangulated. Elements other than v, vt, vn and f are
// passed over. Numbers are written with the fewest digits that give the same float back, so that writing and reading is
// exact. Cost: linear in the file. Memory: the file's text, and the mesh.
#ifndef NPSIM_IO_OBJ_HPP
#define NPSIM_IO_OBJ_HPP

#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "npsim/core/span.hpp"
#include "npsim/core/triangle_mesh.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/io/atomic_file.hpp"
#include "npsim/io/detail/triangulate.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/file_bytes.hpp"
#include "npsim/io/limits.hpp"
#include "npsim/io/mesh.hpp"

namespace npsim {
inline namespace v1 {
namespace io {

struct ObjGroup {
  std::string name;
  std::size_t first_face = 0;
};

struct ObjOptions {
  Span<const Vec2f> uv;          // one per vertex or none; (0, 0) is the image's upper left corner
  std::string texture;           // file name of the photograph as the material file shall give it; needs uv
  Span<const Vec3f> colours;     // one per vertex or none, 0..1
  std::vector<ObjGroup> groups;  // by rising first_face; each lasts to the next
};

namespace detail {

inline constexpr std::size_t kMaxPolygonCorners = 1024;

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

// Cuts the next word off the front of a line.
inline std::string_view next_word(std::string_view& line) {
  constexpr std::string_view kSpace = " \t\r";
  const std::size_t begin = line.find_first_not_of(kSpace);
  if (begin == std::string_view::npos) {
    line = {};
    return {};
  }
  line.remove_prefix(begin);
  const std::string_view word = line.substr(0, line.find_first_of(kSpace));
  line.remove_prefix(word.size());
  return word;
}

inline bool parse_float(std::string_view word, float& value) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  const char* const end = word.data() + word.size();
  const std::from_chars_result r = std::from_chars(word.data(), end, value);
  if (r.ptr != end) return false;
  if (r.ec == std::errc()) return std::isfinite(value);
  double wide = 0;  // too large for a float, or so small that it is 0
  value = 0.0F;
  return std::from_chars(word.data(), end, wide).ec == std::errc() && std::fabs(wide) < 1.0;
}

// The index at the front of a face's corner; cuts it off. Resolves what counts back from the last element.
inline bool parse_index(std::string_view& corner, std::size_t count, std::uint32_t& index) {
  std::int64_t value = 0;
  const std::from_chars_result r = std::from_chars(corner.data(), corner.data() + corner.size(), value);
  if (r.ec != std::errc()) return false;
  corner.remove_prefix(static_cast<std::size_t>(r.ptr - corner.data()));
  const auto n = static_cast<std::int64_t>(count);
  if (value == 0 || value > n || value < -n) return false;
  index = static_cast<std::uint32_t>(value > 0 ? value - 1 : n + value);
  return true;
}

struct ObjCounts {
  std::size_t texture = 0;
  std::size_t normal = 0;
};

// One corner of a face: v, v/vt, v//vn or v/vt/vn.
inline bool parse_corner(std::string_view corner, const Mesh& mesh, const ObjCounts& counts, std::uint32_t& vertex) {
  std::uint32_t ignored = 0;
  if (!parse_index(corner, mesh.vertices.size(), vertex)) return false;
  if (corner.empty()) return true;
  if (corner.front() != '/') return false;
  corner.remove_prefix(1);
  if (!corner.empty() && corner.front() != '/' && !parse_index(corner, counts.texture, ignored)) return false;
  if (corner.empty()) return true;
  if (corner.front() != '/') return false;
  corner.remove_prefix(1);
  return parse_index(corner, counts.normal, ignored) && corner.empty();
}

// Numbers of a v, vt or vn line; returns how many there are, or 0 where one is wrong or there are more than 7.
inline std::size_t parse_numbers(std::string_view line, float (&numbers)[7]) {
  std::size_t n = 0;
  for (std::string_view word = next_word(line); !word.empty(); word = next_word(line)) {
    if (word.front() == '#') break;
    if (n == 7 || !parse_float(word, numbers[n++])) return 0;
  }
  return n;
}

// Empty when the line is good, otherwise what is wrong with it.
inline std::string parse_obj_line(std::string_view line, Mesh& mesh, ObjCounts& counts,
                                  std::vector<std::uint32_t>& corners) {
  const std::string_view keyword = next_word(line);
  float numbers[7];
  if (keyword == "v") {
    const std::size_t n = parse_numbers(line, numbers);
    if (n != 3 && n != 4 && n != 6 && n != 7) return "expected 3 finite coordinates, then a weight or a colour or none";
    if (mesh.vertices.size() == 0xFFFFFFFFU) return "expected less than 2^32 vertices";
    if (n >= 6 && mesh.colours.size() == mesh.vertices.size()) {
      mesh.colours.push_back({numbers[n - 3], numbers[n - 2], numbers[n - 1]});
    }
    mesh.vertices.push_back({numbers[0], numbers[1], numbers[2]});
  } else if (keyword == "vt") {
    const std::size_t n = parse_numbers(line, numbers);
    if (n < 1 || n > 3) return "expected 1 to 3 finite texture coordinates";
    ++counts.texture;
  } else if (keyword == "vn") {
    if (parse_numbers(line, numbers) != 3) return "expected 3 finite components of a normal";
    ++counts.normal;
  } else if (keyword == "f") {
    corners.clear();
    for (std::string_view word = next_word(line); !word.empty() && word.front() != '#'; word = next_word(line)) {
      std::uint32_t vertex = 0;
      if (!parse_corner(word, mesh, counts, vertex)) {
        return "face corner '" + std::string(word.substr(0, 40)) +
               "' names nothing above it: expected v, v/vt, v//vn or " + "v/vt/vn, with v in 1.." +
               std::to_string(mesh.vertices.size()) + " or counted back";
      }
      if (corners.size() == kMaxPolygonCorners) return "expected at most 1024 corners a face";
      corners.push_back(vertex);
    }
    if (corners.size() < 3) return "expected at least 3 corners of a face";
    triangulate(mesh.vertices, corners, mesh.faces);
  }
  return {};
}

}  // namespace detail

// Writes path and, with a texture, the material file beside it: the same name with extension mtl.
inline Outcome write_obj(const std::string& path, const TriangleMeshView& mesh, const ObjOptions& options = {}) {
  return guarded(path, [&]() -> Outcome {
    const std::size_t vertices = mesh.vertices.size();
    for (const Outcome& outcome :
         {detail::expect_mesh(path, mesh), detail::expect_per_vertex(path, "uv", options.uv.size(), vertices),
          detail::expect_per_vertex(path, "colours", options.colours.size(), vertices)}) {
      if (!outcome) return outcome;
    }
    const bool with_uv = !options.uv.empty();
    const bool with_texture = !options.texture.empty();
    if (with_texture && !with_uv) return Error{path, "texture", "expected texture coordinates with it"};
    std::string names = options.texture;
    for (const ObjGroup& group : options.groups) names += group.name;
    if (names.find_first_of("\n\r") != std::string::npos) {
      return Error{path, "names", "expected texture and group names without line breaks"};
    }
    const std::filesystem::path material = std::filesystem::path(path).replace_extension(".mtl");
    std::string text = "# NPSim. Camera frame: x right, y down, z forward, metres\n";
    text.reserve(vertices * 48 + mesh.faces.size() * (with_uv ? 50 : 28) + 256);
    if (with_texture) text += "mtllib " + material.filename().string() + "\n";
    for (std::size_t i = 0; i < vertices; ++i) {
      const Vec3f& v = mesh.vertices[i];
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
    if (with_texture) text += "usemtl photograph\n";
    std::size_t group = 0;
    for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
      for (; group < options.groups.size() && options.groups[group].first_face <= i; ++group) {
        text += "o " + options.groups[group].name + "\n";
      }
      text += 'f';
      for (const std::uint32_t v : {mesh.faces[i].a, mesh.faces[i].b, mesh.faces[i].c}) {
        detail::append_index(text, v, with_uv);
      }
      text += '\n';
    }
    if (with_texture) {
      const Outcome written =
          write_file(material.string(), "newmtl photograph\nKd 1 1 1\nillum 1\nmap_Kd " + options.texture + "\n");
      if (!written) return written;
    }
    return write_file(path, text);
  });
}

inline Expected<Mesh> read_obj(const std::string& path, const ReadLimits& limits = {}) {
  return guarded(path, [&]() -> Expected<Mesh> {
    const Expected<Bytes> file = read_file_bytes(path, limits);
    if (!file) return file.error();
    std::string_view text(reinterpret_cast<const char*>(file.value().data()), file.value().size());
    Mesh mesh;
    detail::ObjCounts counts;
    std::vector<std::uint32_t> corners;
    for (std::size_t number = 1; !text.empty(); ++number) {
      const std::size_t end = text.find('\n');
      const std::string_view line = text.substr(0, end);
      const std::string problem = detail::parse_obj_line(line, mesh, counts, corners);
      if (!problem.empty()) return Error{path, "line " + std::to_string(number), problem};
      text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    }
    if (mesh.vertices.empty()) return Error{path, "", "has no vertex: expected lines like 'v 0 0 1'"};
    if (mesh.colours.size() != mesh.vertices.size()) mesh.colours.clear();
    return mesh;
  });
}

}  // namespace io
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_IO_OBJ_HPP
