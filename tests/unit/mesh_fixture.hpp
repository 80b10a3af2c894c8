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
#include "npsim/mesh/complete_background.hpp"
#include "npsim/mesh/complete_foreground.hpp"
#include "npsim/mesh/index.hpp"
#include "npsim/mesh/prune.hpp"
#include "npsim/mesh/sheet.hpp"

namespace mesh_test {

using namespace npsim;  // NOLINT(google-build-using-namespace)

inline constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

struct ReverseExecutor {  // the last chunk first: another order must give the same bits
  template <class F>
  void for_chunks(std::size_t count, std::size_t chunk, F&& f) const {
    const std::size_t step = chunk == 0 ? 1 : chunk;
    for (std::size_t i = chunk_count(count, step); i-- > 0;) {
      f(i * step, (i + 1) * step < count ? (i + 1) * step : count);
    }
  }
};

// Row-major plane with padding at the end of each row, so that strides are exercised everywhere.
template <class T>
struct Plane {
  static constexpr int kPadding = 3;
  Plane() = default;
  Plane(Shape s, T fill, T pad)
      : shape(s), data(static_cast<std::size_t>(s.width + kPadding) * static_cast<std::size_t>(s.height) + 1, pad) {
    for (int y = 0; y < s.height; ++y) {
      for (int x = 0; x < s.width; ++x) (*this)(x, y) = fill;
    }
  }
  T& operator()(int x, int y) { return view()(x, y); }
  const T& operator()(int x, int y) const { return cview()(x, y); }
  ImageView<T> view() { return {data.data(), shape, shape.width + kPadding}; }
  ImageView<const T> cview() const { return {data.data(), shape, shape.width + kPadding}; }
  Shape shape{};
  std::vector<T> data;
};

struct Layer {
  explicit Layer(Shape s) : vertices(s, Vec3f{9, 9, 9}, Vec3f{7, 7, 7}), quads(quad_shape(s), 0xFF, 0xEE) {}
  SheetLayer view() { return {vertices.view(), quads.view()}; }
  Plane<Vec3f> vertices;
  Plane<std::uint8_t> quads;
};

struct Picture {
  explicit Picture(Shape s)
      : shape(s),
        depth(s, 10.0F, -5.0F),
        labels(s, label::building, 99),
        instances(s, 0, 999),
        uncertain(s, 0, 1),
        surface(s, 1, 0),
        state(s, 77, 78),
        object(s, 12345, 54321),
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
    std::vector<unsigned char> bytes(complete_background_workspace_bytes(bp, shape));
    Workspace for_background(bytes.data(), bytes.size());
    REQUIRE(complete_background(bp, sheet.vertices.cview(), labels.cview(), uncertain.cview(), surface.cview(),
                                intrinsics, background.view(), state.view(), for_background, executor)
                .ok());
    bytes.resize(complete_foreground_workspace_bytes(fp, shape));
    Workspace for_foreground(bytes.data(), bytes.size());
    REQUIRE(complete_foreground(fp, SheetParams{}, depth.cview(), surface.cview(), labels.cview(), instances.cview(),
                                uncertain.cview(), state.cview(), intrinsics, foreground.view(), object.view(),
                                for_foreground, executor)
                .ok());
    REQUIRE(prune(PruneParams{}, uncertain.cview(), labels.cview(), sheet.view(), executor).ok());
  }
  void run(const BackgroundParams& bp = {}, const ForegroundParams& fp = {}) {
    SerialExecutor executor;
    run(bp, fp, executor);
  }

  Shape shape;
  Intrinsics intrinsics;
  Plane<float> depth;
  Plane<Label> labels;
  Plane<std::uint16_t> instances;
  Plane<std::uint8_t> uncertain, surface, state;
  Plane<std::uint32_t> object;
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
  std::vector<unsigned char> bytes(index_layer_workspace_bytes(layer.vertices.shape()));
  Workspace workspace(bytes.data(), bytes.size());
  const MeshBuffers out{
      {mesh.vertices.data(), size.vertices}, {mesh.faces.data(), size.faces}, {mesh.pixels.data(), size.vertices}};
  const Status status = index_layer(layer, 0, out, size, workspace, executor);
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
  std::vector<unsigned char> bytes(check_mesh_workspace_bytes(mesh.vertices.size(), mesh.faces.size()));
  Workspace workspace(bytes.data(), bytes.size());
  MeshReport r;
  REQUIRE(check_mesh(mesh, workspace, r).ok());
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
