// SPDX-License-Identifier: Apache-2.0
// Mesh: an owning indexed triangle mesh for hosts, and the test that every writer puts a mesh through.
//
// Invariant (of a mesh that was read): every index is below vertices.size(), every vertex is finite.
#ifndef NPSIM_IO_MESH_HPP
#define NPSIM_IO_MESH_HPP

#include <cstddef>
#include <string>
#include <vector>

#include "npsim/core/triangle_mesh.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/io/error.hpp"

namespace npsim {
inline namespace v1 {
namespace io {

struct Mesh {
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  std::vector<Vec3f> colours;  // one per vertex, as the file has them, or empty

  [[nodiscard]] TriangleMeshView view() const {
    return {{vertices.data(), vertices.size()}, {faces.data(), faces.size()}};
  }
};

namespace detail {

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
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_IO_MESH_HPP
