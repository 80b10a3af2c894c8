// SPDX-License-Identifier: Apache-2.0
// The sheet's structure where its size, its layers or a refit come to their limits.
#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "npsim/core/executor.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/io/image.hpp"
#include "npsim/trace/detail/sheet/build.hpp"
#include "npsim/trace/detail/sheet/packet.hpp"
#include "npsim/trace/detail/sheet/stream.hpp"
#include "npsim/trace/detail/sheet/traverse.hpp"

namespace {

using namespace npsim;

// A plane at 5 m seen by a camera of 60 px focal length.
struct PlaneLayer {
  io::Image<Vec3f> vertices;
  io::Image<std::uint8_t> quads;
  Intrinsics camera;
  std::vector<unsigned char> memory;
  SheetTrace trace;

  explicit PlaneLayer(Shape shape) : vertices(shape), quads(quad_shape(shape), kQuadUpperFace | kQuadLowerFace) {
    camera = {60.0F, 60.0F, 0.5F * static_cast<float>(shape.width), 0.5F * static_cast<float>(shape.height)};
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) vertices(x, y) = unproject_pixel(camera, x, y, 5.0F);
    }
  }
  [[nodiscard]] Status build() {
    memory.resize(sheet_workspace_bytes(vertices.shape()));
    Workspace workspace(memory.data(), memory.size());
    SerialExecutor serial;
    return build_sheet_trace({vertices.view(), quads.view()}, camera, workspace, trace, serial);
  }
};

template <class Scene>
[[nodiscard]] int camera_hits(const Scene& scene, const PlaneLayer& layer) {
  int hits = 0;
  for (int y = 1; y + 1 < layer.vertices.height(); ++y) {
    for (int x = 1; x + 1 < layer.vertices.width(); ++x) {
      Ray ray;
      ray.direction = layer.vertices(x, y);
      Hit hit;
      hits += closest_hit(scene, ray, hit) ? 1 : 0;
    }
  }
  return hits;
}

}  // namespace

TEST_CASE("a layer of 4^9 quads a side is the widest that is taken; a wider one is refused") {
  PlaneLayer widest({(1 << 18) + 1, 2});
  widest.camera.fx = 1e5F;
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x <= 1 << 18; ++x) widest.vertices(x, y) = unproject_pixel(widest.camera, x, y, 5.0F);
  }
  REQUIRE(widest.build().ok());
  Ray ray;
  ray.origin = widest.vertices(0, 0) * 0.5F;
  ray.direction = widest.vertices(1 << 18, 1) * 0.99F - ray.origin;
  Hit hit;
  static_cast<void>(closest_hit(widest.trace, ray, hit));  // through every level
  ray.origin = {0, 0, 0};
  ray.direction = widest.vertices(200000, 0) * 0.5F + widest.vertices(200001, 1) * 0.5F;
  CHECK(closest_hit(widest.trace, ray, hit));
  PlaneLayer wider({(1 << 18) + 2, 2});
  CHECK(wider.build().code() == StatusCode::capacity_exceeded);
}

TEST_CASE("layers joined after one that was never built, or that has no vertex, are hit as alone") {
  PlaneLayer plane({19, 21});
  REQUIRE(plane.build().ok());
  PlaneLayer empty({19, 21});
  for (int i = 0; i < 19 * 21; ++i) empty.vertices(i % 19, i / 19) = {};
  for (int i = 0; i < 18 * 20; ++i) empty.quads(i % 18, i / 18) = 0;
  empty.camera.fx = 7.0F;
  REQUIRE(empty.build().ok());
  const int alone = camera_hits(plane.trace, plane);
  REQUIRE(alone == 17 * 19);
  for (const SheetTrace& first : {SheetTrace{}, empty.trace}) {
    const SheetTrace both[2] = {first, plane.trace};
    SheetScene scene;
    REQUIRE(join_layers(Span<const SheetTrace>(both), scene).ok());
    CHECK(camera_hits(scene, plane) == alone);
    std::vector<Ray> rays;
    for (int x = 1; x < 18; ++x) {
      Ray ray;
      ray.direction = plane.vertices(x, 10);
      rays.push_back(ray);
    }
    std::vector<std::uint8_t> blocked(rays.size(), 9);
    occluded(scene, Span<const Ray>(rays.data(), rays.size()), [](std::uint32_t) noexcept { return true; },
             Span<std::uint8_t>(blocked.data(), blocked.size()));
    for (const std::uint8_t b : blocked) CHECK(b == 1);
  }
}

TEST_CASE("a refit that was refused leaves nothing behind: the next one has all that building anew has") {
  PlaneLayer plane({100, 70});
  REQUIRE(plane.build().ok());
  SerialExecutor serial;
  // A new surface everywhere, with one vertex that no structure takes.
  for (int y = 0; y < 70; ++y) {
    for (int x = 0; x < 100; ++x) plane.vertices(x, y) = unproject_pixel(plane.camera, x, y, x < 50 ? 4.0F : 9.0F);
  }
  const Vec3f good = plane.vertices(30, 40);
  plane.vertices(30, 40) = {1e12F, 0, good.z};
  CHECK_FALSE(refit_sheet_trace({0, 0, {100, 70}}, plane.trace, serial).ok());
  CHECK(camera_hits(plane.trace, plane) == 0);
  plane.vertices(30, 40) = good;
  REQUIRE(refit_sheet_trace({30, 40, {1, 1}}, plane.trace, serial).ok());
  CHECK(camera_hits(plane.trace, plane) == 98 * 68);
}
