// SPDX-License-Identifier: Apache-2.0
// The true mesh of a generated scene with what its faces are made of and which of them glow.
//
// The OBJ that truth.mesh names: triangles; a line "g e<id>" before the faces of emitter <id>, any other group for
// faces of none; a line "usemtl" before those of a material. The material file beside it: "newmtl", "Kd" (diffuse
// albedo, linear) and "Pr" (roughness, the root of GGX alpha); other lines are left alone.
// Invariant: face_emitter and face_material have an element per face; every material exists; albedo and roughness are
// 0..1.
// Cost: that of read_obj, and one pass more over the file.
#ifndef NPSIM_IO_TRUTH_MESH_HPP
#define NPSIM_IO_TRUTH_MESH_HPP

#include <charconv>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "npsim/core/vec.hpp"
#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/mesh.hpp"
#include "npsim/io/obj.hpp"
#include "npsim/io/scene.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

struct TrueMaterial {
  Vec3f albedo;
  float roughness = 1;
};

struct TrueMesh {
  Mesh mesh;
  std::vector<std::uint32_t> face_material;  // into materials
  std::vector<std::uint32_t> face_emitter;   // TrueEmitter::id, 0: none
  std::vector<TrueMaterial> materials;
};

namespace detail {

// Calls f(number, keyword, rest) for each line that is not empty, until it returns an error.
template <class F>
Outcome for_each_line(const std::string& path, const ReadLimits& limits, F&& f) {
  const Expected<Bytes> file = read_file_bytes(path, limits);
  if (!file) return file.error();
  std::string_view text(reinterpret_cast<const char*>(file.value().data()), file.value().size());
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    const std::string_view keyword = next_word(line);
    if (keyword.empty()) continue;
    if (const Outcome done = f("line " + std::to_string(number), keyword, line); !done) return done;
  }
  return Done{};
}

// A number in 0..1 cut off the front of the line, or -1.
inline float take_share(std::string_view& line) {
  const std::string_view word = next_word(line);
  float value = -1;
  const std::from_chars_result r = std::from_chars(word.data(), word.data() + word.size(), value);
  return r.ec == std::errc() && r.ptr == word.data() + word.size() && value >= 0 && value <= 1 ? value : -1.0F;
}

inline Outcome read_true_materials(const std::string& path, const ReadLimits& limits,
                                   std::map<std::string, std::uint32_t, std::less<>>& names,
                                   std::vector<TrueMaterial>& out) {
  return for_each_line(path, limits,
                       [&](const std::string& at, std::string_view keyword, std::string_view line) -> Outcome {
                         if (keyword == "newmtl") {
                           names[std::string(next_word(line))] = static_cast<std::uint32_t>(out.size());
                           out.emplace_back();
                           return Done{};
                         }
                         if (keyword != "Kd" && keyword != "Pr") return Done{};
                         if (out.empty())
                           return Error{path, at, "stands before any newmtl, expected it within a material"};
                         const int count = keyword == "Kd" ? 3 : 1;
                         float values[3] = {};
                         for (int i = 0; i < count; ++i) {
                           values[i] = take_share(line);
                           if (values[i] < 0)
                             return Error{path, at, "expected " + std::to_string(count) + " numbers from 0 to 1"};
                         }
                         if (count == 3) {
                           out.back().albedo = {values[0], values[1], values[2]};
                         } else {
                           out.back().roughness = values[0];
                         }
                         return Done{};
                       });
}

// The emitter that a group's name stands for; 0 where it is not of the form e<id>.
inline std::uint32_t emitter_of_group(std::string_view name) {
  std::uint32_t id = 0;
  if (name.size() < 2 || name.front() != 'e') return 0;
  const std::from_chars_result r = std::from_chars(name.data() + 1, name.data() + name.size(), id);
  return r.ec == std::errc() && r.ptr == name.data() + name.size() ? id : 0;
}

}  // namespace detail

[[nodiscard]] inline Expected<TrueMesh> read_truth_mesh(const Scene& scene, const ReadLimits& limits = {}) {
  const std::string& path = scene.truth.mesh;
  if (path.empty()) return Error{scene.file, "truth.mesh", "is missing, expected the name of a file"};
  return guarded(path, [&]() -> Expected<TrueMesh> {
    TrueMesh out;
    Expected<Mesh> mesh = read_obj(path, limits);
    if (!mesh) return mesh.error();
    out.mesh = std::move(mesh.value());
    std::map<std::string, std::uint32_t, std::less<>> names;
    std::uint32_t emitter = 0;
    std::uint32_t material = 0;
    const auto line = [&](const std::string& at, std::string_view keyword, std::string_view rest) -> Outcome {
      if (keyword == "mtllib") {
        const std::filesystem::path file =
            std::filesystem::path(path).parent_path() / std::string(detail::next_word(rest));
        return detail::read_true_materials(file.string(), limits, names, out.materials);
      }
      if (keyword == "g") emitter = detail::emitter_of_group(detail::next_word(rest));
      if (keyword == "usemtl") {
        const auto named = names.find(detail::next_word(rest));
        if (named == names.end())
          return Error{path, at, "names a material that does not exist, expected one of its file"};
        material = named->second;
      }
      if (keyword == "f") {
        if (out.materials.empty())
          return Error{path, at, "a face without a material, expected mtllib and usemtl above"};
        out.face_emitter.push_back(emitter);
        out.face_material.push_back(material);
      }
      return Done{};
    };
    if (const Outcome read = detail::for_each_line(path, limits, line); !read) return read.error();
    if (out.face_material.size() != out.mesh.faces.size()) {
      return Error{path, "faces", "hold polygons, expected triangles"};
    }
    return out;
  });
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_TRUTH_MESH_HPP
