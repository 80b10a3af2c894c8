// SPDX-License-Identifier: Apache-2.0
#include "npsim/mesh/prune.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/exec/thread_pool.hpp"

namespace {

using namespace npsim;
using npsim_test::Image;

constexpr Intrinsics kCamera{150, 150, 60, 20};

// A layer of all the faces that its depth allows.
struct Layer {
  Image<Vec3f> vertices;
  Image<std::uint8_t> quads;

  template <class Depth>
  Layer(Shape shape, const Depth& depth) : vertices(shape), quads(quad_shape(shape)) {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const float z = depth(x, y);
        vertices(x, y) = z > 0.0F ? unproject_pixel(kCamera, x, y, z) : Vec3f{};
      }
    }
    SerialExecutor executor;
    mesh_detail::connect_layer(view(), executor);
  }
  SheetLayer view() { return {vertices.view(), quads.view()}; }
};

template <class F = simd::F32>
Image<std::uint8_t> opened(Layer& layer, float min_step = 0.05F) {
  Image<std::uint8_t> quads(quad_shape(layer.vertices.shape()));
  SerialExecutor executor;
  REQUIRE(open_steps<F>({min_step}, layer.view(), quads.view(), executor).ok());
  return quads;
}

int faces(std::uint8_t quad) { return ((quad & kQuadUpperFace) != 0 ? 1 : 0) + ((quad & kQuadLowerFace) != 0 ? 1 : 0); }

}  // namespace

TEST_CASE("open steps: between a near wall and a far one rays pass, and nowhere else") {
  Layer layer({300, 60}, [](int x, int) { return x < 140 ? 10.0F : 20.0F; });
  const Image<std::uint8_t> quads = opened(layer);
  for (int y = 0; y < 59; ++y) {
    for (int x = 0; x < 299; ++x) CHECK(faces(quads(x, y)) == (x == 139 ? 0 : 2));
  }
}

TEST_CASE("open steps: a road up to its horizon and a wall along the street are steep but whole") {
  Layer road({120, 80}, [](int, int y) { return y > 22 ? 150 * 1.5F / (static_cast<float>(y) + 0.5F - 20.0F) : 0.0F; });
  CHECK(road.vertices(5, 23).z > 1.2F * road.vertices(5, 24).z);
  Layer wall({120, 80}, [](int x, int) { return x > 62 ? 150 * 4.0F / (static_cast<float>(x) + 0.5F - 60.0F) : 0.0F; });
  for (Layer* layer : {&road, &wall}) {
    const Image<std::uint8_t> quads = opened(*layer);
    CHECK(quads == layer->quads);
  }
}

TEST_CASE("open steps: where a wall turns a corner it stays whole; a step smaller than asked for stays closed") {
  Layer corner({120, 40}, [](int x, int) {
    return 1.0F / (0.1F - 0.002F * (x < 60 ? 60.0F - static_cast<float>(x) : 0.3F * (static_cast<float>(x) - 60.0F)));
  });
  Layer step({120, 40}, [](int x, int) { return x < 60 ? 10.0F : 10.4F; });
  for (Layer* layer : {&corner, &step}) {
    const Image<std::uint8_t> quads = opened(*layer);
    CHECK(quads == layer->quads);
  }
  CHECK(faces(opened(step, 0.03F)(59, 10)) == 0);
}

TEST_CASE("open steps: faces are only taken away, alike for any number of lanes and threads") {
  std::uint32_t seed = 7;
  const auto draw = [&seed] { return seed = seed * 1664525U + 1013904223U, static_cast<float>(seed >> 8U) * 0x1p-24F; };
  Layer layer({317, 75},
              [&](int, int) { return draw() < 0.1F ? 0.0F : 5.0F + (draw() < 0.3F ? 5.0F : 0.2F) * draw(); });
  const Image<std::uint8_t> quads = opened(layer);
  const Image<std::uint8_t> by_one = opened<simd::scalar::F32>(layer);
  ThreadPool pool(3);
  Image<std::uint8_t> threads(quads.shape());
  REQUIRE(open_steps({}, layer.view(), threads.view(), pool).ok());
  CHECK(by_one == quads);
  CHECK(threads == quads);
  int taken = 0;
  for (int y = 0; y < quads.shape().height; ++y) {
    for (int x = 0; x < quads.shape().width; ++x) {
      CHECK((quads(x, y) & (kQuadUpperFace | kQuadLowerFace) & ~layer.quads(x, y)) == 0);
      taken += faces(layer.quads(x, y)) - faces(quads(x, y));
    }
  }
  CHECK(taken > 1000);
}

TEST_CASE("open steps: what cannot be is refused") {
  Layer layer({8, 8}, [](int, int) { return 5.0F; });
  Image<std::uint8_t> quads({7, 7});
  Image<std::uint8_t> small({6, 7});
  SerialExecutor executor;
  CHECK(!open_steps({0.0F}, layer.view(), quads.view(), executor).ok());
  CHECK(open_steps({}, layer.view(), small.view(), executor).code() == StatusCode::shape_mismatch);
}
