// SPDX-License-Identifier: Apache-2.0
// Cuts a simple polygon into triangles by clipping ears, in the projection along its normal's largest component.
//
// Invariant: n corners give n - 2 triangles with the polygon's orientation, whatever the input; where no ear is left
// (the polygon crosses itself), the next corner is cut off regardless. Cost: O(n^3) at worst, linear if convex.
// Meisters, "Polygons have ears", 1975.
#ifndef NPSIM_IO_DETAIL_TRIANGULATE_HPP
#define NPSIM_IO_DETAIL_TRIANGULATE_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "npsim/core/span.hpp"
#include "npsim/core/triangle_mesh.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace v1 {
namespace io {
namespace detail {

// Appends the triangles of `corners` (indices of vertices) to faces. Uses up `corners`.
inline void triangulate(const std::vector<Vec3f>& vertices, std::vector<std::uint32_t>& corners,
                        std::vector<Face>& faces) {
  if (corners.size() < 3) return;
  Vec3d normal;  // Newell's: twice the area vector
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vec3d p = vec_cast<double>(vertices[corners[i]] - vertices[corners[0]]);
    const Vec3d q = vec_cast<double>(vertices[corners[(i + 1) % corners.size()]] - vertices[corners[0]]);
    normal += cross(p, q);
  }
  const double ax = std::fabs(normal.x);
  const double ay = std::fabs(normal.y);
  const double az = std::fabs(normal.z);
  const int axis = ax >= ay && ax >= az ? 0 : (ay >= az ? 1 : 2);
  const bool flip = (axis == 0 ? normal.x : (axis == 1 ? normal.y : normal.z)) < 0;
  const auto flat = [&](std::uint32_t i) {
    const Vec3d p = vec_cast<double>(vertices[i]);
    const Vec2d uv = axis == 0 ? Vec2d{p.y, p.z} : (axis == 1 ? Vec2d{p.z, p.x} : Vec2d{p.x, p.y});
    return flip ? Vec2d{uv.y, uv.x} : uv;
  };
  const auto area = [&](std::uint32_t i, std::uint32_t j, std::uint32_t k) {  // twice, positive when convex
    const Vec2d a = flat(i);
    const Vec2d ab = flat(j) - a;
    const Vec2d ac = flat(k) - a;
    return ab.x * ac.y - ab.y * ac.x;
  };
  std::size_t at = 0;
  std::size_t refused = 0;
  while (corners.size() > 3) {
    const std::size_t n = corners.size();
    at %= n;
    const std::uint32_t a = corners[(at + n - 1) % n];
    const std::uint32_t b = corners[at];
    const std::uint32_t c = corners[(at + 1) % n];
    bool ear = area(a, b, c) > 0;
    for (std::size_t k = 2; ear && k + 1 < n; ++k) {
      const std::uint32_t p = corners[(at + k) % n];
      if (p == a || p == b || p == c) continue;
      ear = !(area(a, b, p) >= 0 && area(b, c, p) >= 0 && area(c, a, p) >= 0);
    }
    if (!ear && refused < n) {
      ++refused;
      ++at;
      continue;
    }
    faces.push_back({a, b, c});
    corners.erase(corners.begin() + static_cast<std::ptrdiff_t>(at));
    refused = 0;
  }
  faces.push_back({corners[0], corners[1], corners[2]});
}

}  // namespace detail
}  // namespace io
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_TRIANGULATE_HPP
