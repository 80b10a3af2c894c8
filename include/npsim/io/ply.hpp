// SPDX-License-Identifier: Apache-2.0
// PLY, binary little-endian: vertices with optional normals and 8-bit colours, triangles.
//
// Metres, in the camera frame or with y up, as the comment in the header says.
// Cost: linear. Memory: the file's bytes.
#ifndef NPSIM_IO_PLY_HPP
#define NPSIM_IO_PLY_HPP

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

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

struct PlyOptions {
  Span<const Vec3f> normals;  // one per vertex or none
  Span<const Rgb8> colours;   // one per vertex or none, sRGB
  MeshFrame frame = MeshFrame::camera;
};

namespace detail {

inline void append_u32(std::string& bytes, std::uint32_t value) {
  const char word[4] = {static_cast<char>(value & 0xFFU), static_cast<char>(value >> 8U & 0xFFU),
                        static_cast<char>(value >> 16U & 0xFFU), static_cast<char>(value >> 24U)};
  bytes.append(word, sizeof word);
}
inline void append_f32(std::string& bytes, float value) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  append_u32(bytes, bits);
}
inline void append_vec3(std::string& bytes, const Vec3f& v) {
  append_f32(bytes, v.x);
  append_f32(bytes, v.y);
  append_f32(bytes, v.z);
}

}  // namespace detail

inline Outcome write_ply(const std::string& path, const TriangleMeshView& mesh, const PlyOptions& options = {}) {
  return guarded(path, [&]() -> Outcome {
    const std::size_t vertices = mesh.vertices.size();
    for (const Outcome& outcome :
         {detail::expect_mesh(path, mesh), detail::expect_per_vertex(path, "normals", options.normals.size(), vertices),
          detail::expect_per_vertex(path, "colours", options.colours.size(), vertices)}) {
      if (!outcome) return outcome;
    }
    std::string bytes = "ply\nformat binary_little_endian 1.0\ncomment NPSim, ";
    bytes += std::string(detail::frame_name(options.frame)) + "\n";
    bytes += "element vertex " + std::to_string(vertices) + "\nproperty float x\nproperty float y\nproperty float z\n";
    if (!options.normals.empty()) bytes += "property float nx\nproperty float ny\nproperty float nz\n";
    if (!options.colours.empty()) bytes += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    bytes += "element face " + std::to_string(mesh.faces.size()) + "\nproperty list uchar uint vertex_indices\n";
    bytes += "end_header\n";
    bytes.reserve(bytes.size() + vertices * 27 + mesh.faces.size() * 13);
    for (std::size_t i = 0; i < vertices; ++i) {
      detail::append_vec3(bytes, detail::in_frame(mesh.vertices[i], options.frame));
      if (!options.normals.empty()) detail::append_vec3(bytes, detail::in_frame(options.normals[i], options.frame));
      if (options.colours.empty()) continue;
      const Rgb8 c = options.colours[i];
      for (const std::uint8_t channel : {c.r, c.g, c.b}) bytes += static_cast<char>(channel);
    }
    for (const Face& f : mesh.faces) {
      bytes += '\3';
      for (const std::uint32_t v : {f.a, f.b, f.c}) detail::append_u32(bytes, v);
    }
    return write_file(path, bytes);
  });
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_PLY_HPP
