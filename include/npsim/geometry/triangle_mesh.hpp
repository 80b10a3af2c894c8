// SPDX-License-Identifier: Apache-2.0
// Views of an indexed triangle mesh, shared by mesh/ (which makes them) and trace/ (which traces them).
//
// Camera frame, metres. A face is counter-clockwise seen from the side it faces: cross(b - a, c - a) points towards
// the viewer of its front.
#ifndef NPSIM_GEOMETRY_TRIANGLE_MESH_HPP
#define NPSIM_GEOMETRY_TRIANGLE_MESH_HPP

#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct Face {
  std::uint32_t a = 0;
  std::uint32_t b = 0;
  std::uint32_t c = 0;
};

struct TriangleMeshView {
  Span<const Vec3f> vertices;
  Span<const Face> faces;
};

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_GEOMETRY_TRIANGLE_MESH_HPP
