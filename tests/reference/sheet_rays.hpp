// SPDX-License-Identifier: Apache-2.0
// A layer with the memory of its ray structure, for tests, and the hit of a ray by a test of every face in turn.
#ifndef NPSIM_TESTS_REFERENCE_SHEET_RAYS_HPP
#define NPSIM_TESTS_REFERENCE_SHEET_RAYS_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "npsim/core/camera.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/trace/detail/triangle.hpp"
#include "npsim/trace/ray.hpp"
#include "npsim/trace/sheet.hpp"
#include "unit/fixture.hpp"

namespace npsim::reference {

struct TracedSheet {
  Shape shape;
  Intrinsics k;
  std::vector<Vec3f> vertices;
  std::vector<std::uint8_t> quads;
  std::unique_ptr<npsim_test::Scratch> memory;
  SheetTrace trace;

  explicit TracedSheet(Shape s)
      : shape(s),
        k(intrinsics_from_fov(s, 1.2F)),
        vertices(s.pixels()),
        quads(std::max<std::size_t>(quad_shape(s).empty() ? 0 : quad_shape(s).pixels(), 1), 6) {}

  [[nodiscard]] SheetLayer layer() {
    SheetLayer out;
    out.vertices = {vertices.data(), shape};
    if (!quad_shape(shape).empty()) out.quads = {quads.data(), quad_shape(shape)};
    return out;
  }
  template <class Depth>
  void fill(Depth&& depth) {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) at(x, y) = unproject_pixel(k, x, y, depth(x, y));
    }
  }
  // All faces, or some; diagonals at random.
  void connect(bool all, std::uint32_t seed = 77) {
    for (std::size_t i = 0; i < quads.size(); ++i) {
      RandomStream r(seed, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(i), 0);
      quads[i] = static_cast<std::uint8_t>(all ? 6U | (r.next_u32() & 1U) : r.next_u32() % 8U);
    }
  }
  [[nodiscard]] Vec3f& at(int x, int y) { return vertices[static_cast<std::size_t>(y * shape.width + x)]; }
  template <class F = simd::F32>
  [[nodiscard]] Status build() {
    memory = std::make_unique<npsim_test::Scratch>(sheet_workspace_bytes(shape));
    SerialExecutor executor;
    return build_sheet_trace<F>(layer(), k, memory->workspace(), trace, executor);
  }
};

inline bool hit_by_all_faces(const TracedSheet& sheet, const Ray& ray, Hit& out) {
  RayFrame frame;
  if (sheet.trace.levels == 0 || !make_ray_frame(ray, sheet.trace.bounds.low, sheet.trace.bounds.high, frame)) {
    return false;
  }
  bool found = false;
  for (std::uint32_t f = 0; f < sheet_face_count(sheet.shape); ++f) {
    if ((sheet.quads[f / 2] & (f % 2 == 0 ? kQuadUpperFace : kQuadLowerFace)) == 0) continue;
    const Face face = sheet_face(sheet.trace.quads, f);
    const std::array<Vec3f, 3> c{sheet.vertices[face.a], sheet.vertices[face.b], sheet.vertices[face.c]};
    const auto good = [](const Vec3f& v) {
      return v.z >= kSheetMinDepth && v.z <= kTraceMaxCoordinate && std::fabs(v.x) <= kTraceMaxCoordinate &&
             std::fabs(v.y) <= kTraceMaxCoordinate;
    };
    if (!good(c[0]) || !good(c[1]) || !good(c[2])) continue;
    const float vertex[3][3] = {{c[0].x, c[0].y, c[0].z}, {c[1].x, c[1].y, c[1].z}, {c[2].x, c[2].y, c[2].z}};
    TriangleHit hit;
    if (!intersect_triangle(frame, vertex, hit) || !(hit.t < frame.t_max)) continue;
    if (!found || hit.t < out.t) {
      out = Hit{hit.t, f, hit.u, hit.v};
      found = true;
    }
  }
  return found;
}

}  // namespace npsim::reference

#endif  // NPSIM_TESTS_REFERENCE_SHEET_RAYS_HPP
