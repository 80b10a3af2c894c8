// SPDX-License-Identifier: Apache-2.0
// A small picture with every plane that the mesh kernels read and write, and what every mesh of it must satisfy.
#ifndef NPSIM_TESTS_UNIT_MESH_FIXTURE_HPP
#define NPSIM_TESTS_UNIT_MESH_FIXTURE_HPP

#include <doctest/doctest.h>

#include <cstdint>
#include <limits>
#include <vector>

#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/mesh/check.hpp"
#include "npsim/mesh/complete.hpp"
#include "npsim/mesh/index.hpp"
#include "npsim/mesh/prune.hpp"
#include "npsim/mesh/sheet.hpp"
#include "unit/fixture.hpp"

namespace mesh_test {

using namespace npsim;  // NOLINT(google-build-using-namespace)
using npsim_test::BackwardExecutor;
using npsim_test::Image;
using npsim_test::Scratch;

inline constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// Columns at the end of each row that belong to nobody, so that strides are exercised everywhere.
inline constexpr int kPadding = 3;

struct Layer {
  explicit Layer(Shape s)
      : vertices(s, Vec3f{9, 9, 9}, kPadding, Vec3f{7, 7, 7}), quads(quad_shape(s), 0xFF, kPadding, 0xEE) {}
  SheetLayer view() { return {vertices.view(), quads.view()}; }
  Image<Vec3f> vertices;
  Image<std::uint8_t> quads;
};

struct Picture {
  explicit Picture(Shape s)
      : shape(s),
        depth(s, 10.0F, kPadding, -5.0F),
        labels(s, label::building, kPadding, 99),
        instances(s, 0, kPadding, 999),
        uncertain(s, 0, kPadding, 1),
        surface(s, 1, kPadding, 0),
        state(s, 77, kPadding, 78),
        object(s, 12345, kPadding, 54321),
        sheet(s),
        background(s),
        foreground(s) {
    intrinsics = {100.0F, 100.0F, 0.5F * static_cast<float>(s.width), 0.5F * static_cast<float>(s.height)};
  }
  void rectangle(int x0, int y0, int x1, int y1, Label l, float z) {  // x1, y1 included
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        labels(x, y) = l;
        depth(x, y) = z;
        surface(x, y) = kNoSurfaceLabels.contains(l) ? 0 : 1;
      }
    }
  }
  void doubt(int x0, int y0, int x1, int y1) {
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) uncertain(x, y) = 1;
    }
  }
  template <class Executor>
  void run(const BackgroundParams& bp, const ForegroundParams& fp, Executor& executor) {
    REQUIRE(build_sheet(SheetParams{}, depth.cview(), surface.cview(), intrinsics, sheet.view(), executor).ok());
    Scratch for_background(complete_background_workspace_bytes(bp, shape));
    REQUIRE(complete_background(bp, background_input(), background.view(), state.view(), for_background.workspace(),
                                executor)
                .ok());
    Scratch for_foreground(complete_foreground_workspace_bytes(fp, shape));
    REQUIRE(complete_foreground(fp, foreground_input(), foreground.view(), object.view(), for_foreground.workspace(),
                                executor)
                .ok());
    REQUIRE(prune(PruneParams{}, uncertain.cview(), labels.cview(), sheet.view(), executor).ok());
  }
  [[nodiscard]] BackgroundInput background_input() const {
    return {sheet.vertices.view(), labels.view(), uncertain.view(), surface.view(), intrinsics};
  }
  [[nodiscard]] ForegroundInput foreground_input() const {
    return {{},           depth.view(), surface.view(), labels.view(), instances.view(), uncertain.view(),
            state.view(), intrinsics};
  }
  void run(const BackgroundParams& bp = {}, const ForegroundParams& fp = {}) {
    SerialExecutor executor;
    run(bp, fp, executor);
  }

  Shape shape;
  Intrinsics intrinsics;
  Image<float> depth;
  Image<Label> labels;
  Image<std::uint16_t> instances;
  Image<std::uint8_t> uncertain, surface, state;
  Image<std::uint32_t> object;
  Layer sheet, background, foreground;
};

struct Indexed {
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  std::vector<std::uint32_t> pixels;
  [[nodiscard]] TriangleMeshView view() const {
    return {{vertices.data(), vertices.size()}, {faces.data(), faces.size()}};
  }
};

template <class Executor>
Indexed index(const SheetLayer& layer, Executor& executor) {
  MeshSize size = mesh_size(layer);
  Indexed mesh{std::vector<Vec3f>(size.vertices), std::vector<Face>(size.faces),
               std::vector<std::uint32_t>(size.vertices)};
  Scratch scratch(index_layer_workspace_bytes(layer.vertices.shape()));
  const MeshBuffers out{
      {mesh.vertices.data(), size.vertices}, {mesh.faces.data(), size.faces}, {mesh.pixels.data(), size.vertices}};
  const Status status = index_layer(layer, 0, out, size, scratch.workspace(), executor);
  REQUIRE_MESSAGE(status.ok(), status.message());
  CHECK(size.vertices == mesh.vertices.size());
  CHECK(size.faces == mesh.faces.size());
  return mesh;
}
inline Indexed index(const SheetLayer& layer) {
  SerialExecutor executor;
  return index(layer, executor);
}

inline MeshReport report(const TriangleMeshView& mesh) {
  Scratch scratch(check_mesh_workspace_bytes(mesh.vertices.size(), mesh.faces.size()));
  MeshReport r;
  REQUIRE(check_mesh(mesh, scratch.workspace(), r).ok());
  return r;
}

// What every indexed layer satisfies. Returns its report.
inline MeshReport check_layer(const SheetLayer& layer) {
  const Indexed mesh = index(layer);
  const MeshReport r = report(mesh.view());
  CHECK(r.oriented_manifold());
  CHECK(r.isolated_vertices == 0);
  for (const Face& f : mesh.faces) {
    const Vec3d a = vec_cast<double>(mesh.vertices[f.a]);
    const Vec3d normal = cross(vec_cast<double>(mesh.vertices[f.b]) - a, vec_cast<double>(mesh.vertices[f.c]) - a);
    REQUIRE(dot(normal, a) < 0.0);
  }
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const int width = layer.vertices.width();
    const auto p = static_cast<int>(mesh.pixels[i]);
    REQUIRE(layer.vertices(p % width, p / width) == mesh.vertices[i]);
  }
  return r;
}

}  // namespace mesh_test

#endif  // NPSIM_TESTS_UNIT_MESH_FIXTURE_HPP
