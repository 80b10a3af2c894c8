// SPDX-License-Identifier: Apache-2.0
// Mesh: an owning indexed triangle mesh for hosts, and the test that every writer puts a mesh through.
//
// Invariant (of a mesh that was read): every index is below vertices.size(), every vertex is finite.
#ifndef NPSIM_IO_MESH_HPP
#define NPSIM_IO_MESH_HPP

#include <cstddef>
#include <string>
#include <vector>

#include "npsim/core/vec.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/io/error.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

// What the axes of a written mesh mean. The camera's, as everywhere here: x right, y down, z forward. y_up, which glTF
// prescribes and viewers expect: x right, y up, z backward; a rotation by half a turn, so that faces keep their front.
enum class MeshFrame { camera, y_up };

struct Mesh {
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  std::vector<Vec3f> colours;  // one per vertex, as the file has them, or empty

  [[nodiscard]] TriangleMeshView view() const {
    return {{vertices.data(), vertices.size()}, {faces.data(), faces.size()}};
  }
};

namespace detail {

// + 0 turns the -0 that a coordinate plane gives into 0.
[[nodiscard]] inline Vec3f in_frame(const Vec3f& v, MeshFrame frame) {
  return frame == MeshFrame::camera ? v : Vec3f{v.x + 0.0F, -v.y + 0.0F, -v.z + 0.0F};
}
[[nodiscard]] inline const char* frame_name(MeshFrame frame) {
  return frame == MeshFrame::camera ? "x right, y down, z forward, metres" : "x right, y up, z backward, metres";
}

inline Outcome expect_mesh(const std::string& path, const TriangleMeshView& mesh) {
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    if (!is_finite(mesh.vertices[i]))
      return Error{path, "vertex " + std::to_string(i), "is not finite: expected numbers"};
  }
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    const Face& f = mesh.faces[i];
    if (f.a < mesh.vertices.size() && f.b < mesh.vertices.size() && f.c < mesh.vertices.size()) continue;
    return Error{path, "face " + std::to_string(i),
                 "names a vertex that does not exist: expected indices below " + std::to_string(mesh.vertices.size())};
  }
  return Done{};
}

// Whether an optional attribute is absent or there once per vertex.
inline Outcome expect_per_vertex(const std::string& path, const char* what, std::size_t count, std::size_t vertices) {
  if (count == 0 || count == vertices) return Done{};
  return Error{path, what,
               std::to_string(count) + " values, expected none or one per vertex, " + std::to_string(vertices)};
}

}  // namespace detail
}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_MESH_HPP
