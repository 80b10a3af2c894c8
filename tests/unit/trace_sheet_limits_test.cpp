// SPDX-License-Identifier: Apache-2.0
// The sheet's structure where its size, its layers or its vertices come to their limits.
#include <doctest/doctest.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/trace/sheet.hpp"

namespace {

using namespace npsim;

// A plane at 5 m seen by a camera of 60 px focal length.
struct PlaneLayer {
  npsim_test::Image<Vec3f> vertices;
  npsim_test::Image<std::uint8_t> quads;
  Intrinsics camera;
  std::unique_ptr<npsim_test::Scratch> memory;
  SheetTrace trace;

  explicit PlaneLayer(Shape shape)
      : vertices(shape), quads(quad_shape(shape), std::uint8_t{kQuadUpperFace | kQuadLowerFace}) {
    camera = {60.0F, 60.0F, 0.5F * static_cast<float>(shape.width), 0.5F * static_cast<float>(shape.height)};
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) vertices(x, y) = unproject_pixel(camera, x, y, 5.0F);
    }
  }
  [[nodiscard]] Status build() {
    memory = std::make_unique<npsim_test::Scratch>(sheet_workspace_bytes(vertices.shape()));
    SerialExecutor serial;
    return build_sheet_trace({vertices.view(), quads.view()}, camera, memory->workspace(), trace, serial);
  }
};

template <class Scene>
[[nodiscard]] int camera_hits(const Scene& scene, const PlaneLayer& layer) {
  int hits = 0;
  for (int y = 1; y + 1 < layer.vertices.shape().height; ++y) {
    for (int x = 1; x + 1 < layer.vertices.shape().width; ++x) {
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
    occluded(
        scene, Span<const Ray>(rays.data(), rays.size()), [](std::uint32_t) noexcept { return true; },
        Span<std::uint8_t>(blocked.data(), blocked.size()));
    for (const std::uint8_t b : blocked) CHECK(b == 1);
  }
}

TEST_CASE("a layer with one vertex that is nowhere near its pixel's ray is refused, and taken once it is back") {
  PlaneLayer plane({100, 70});
  const Vec3f good = plane.vertices(30, 40);
  plane.vertices(30, 40) = {1e12F, 0, good.z};
  CHECK(plane.build().code() == StatusCode::invalid_argument);
  CHECK(camera_hits(plane.trace, plane) == 0);
  plane.vertices(30, 40) = good;
  REQUIRE(plane.build().ok());
  CHECK(camera_hits(plane.trace, plane) == 98 * 68);
}
