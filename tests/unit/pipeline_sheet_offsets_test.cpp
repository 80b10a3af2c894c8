// SPDX-License-Identifier: Apache-2.0
// The offsets of equation (3.1) through the reconstruction: every layer moves by them, completed parts too.
#include <doctest/doctest.h>

#include <cstdint>
#include <limits>

#include "fixture.hpp"
#include "known_depth.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/pipeline/reconstruct.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

// A car 8 m away before a wall at 20 m; layers of it with one pair of offsets.
struct Layers : npsim_test::KnownDepth {
  Shape shape{64, 48};
  Intrinsics camera{60, 55, 32, 24};
  Image<Rgb8> image{shape, Rgb8{90, 90, 90}};
  SceneLayers layers;
  npsim_test::Scratch scratch;
  Status status;

  explicit Layers(Vec2f offset)
      : KnownDepth({64, 48}, 20.0F), scratch(layers_workspace_bytes(ReconstructParams{}, Shape{64, 48})) {
    for (int y = 18; y < 34; ++y) {
      for (int x = 20; x < 40; ++x) {
        depth(x, y) = 8.0F;
        labels(x, y) = label::car;
      }
    }
    SceneView scene;
    scene.camera = camera;
    scene.image = image.cview();
    scene.depth = depth.cview();
    scene.labels = labels.cview();
    const RefinedDepth known = refined();
    ReconstructParams params;
    params.offset = offset;
    SerialExecutor executor;
    NullObserver observer;
    status = build_layers(params, scene, known, scratch.workspace(), executor, observer, layers);
  }
};

}  // namespace

TEST_CASE("offsets of the sheet move the background, what is completed of it, and the objects alike") {
  const Vec2f offset{0.25F, -0.5F};
  const Layers still({0, 0});
  const Layers moved(offset);
  REQUIRE(still.status.ok());
  REQUIRE(moved.status.ok());
  int objects = 0;
  int behind = 0;
  for (int y = 0; y < still.shape.height; ++y) {
    for (int x = 0; x < still.shape.width; ++x) {
      for (SheetLayer SceneLayers::*layer : {&SceneLayers::background, &SceneLayers::foreground}) {
        const Vec3f a = (still.layers.*layer).vertices(x, y);
        const Vec3f b = (moved.layers.*layer).vertices(x, y);
        REQUIRE(has_vertex(a) == has_vertex(b));
        if (!has_vertex(a)) continue;
        CHECK(b.z == doctest::Approx(a.z).epsilon(1e-4));
        CHECK(b.x - a.x == doctest::Approx(a.z * offset.x * 32 / 60).epsilon(1e-3));
        CHECK(b.y - a.y == doctest::Approx(a.z * offset.y * 24 / 55).epsilon(1e-3));
      }
      objects += has_vertex(moved.layers.foreground.vertices(x, y)) ? 1 : 0;
      const bool covered = moved.labels(x, y) == label::car;
      behind += covered && has_vertex(moved.layers.background.vertices(x, y)) ? 1 : 0;
    }
  }
  CHECK(objects >= 20 * 16);
  CHECK(behind == 20 * 16);
}

TEST_CASE("offsets of more than half a picture, or that are no numbers, are refused") {
  ReconstructParams params;
  params.offset = {1.5F, 0};
  CHECK(validate(params).code() == StatusCode::invalid_argument);
  params.offset = {0, std::numeric_limits<float>::quiet_NaN()};
  CHECK(validate(params).code() == StatusCode::invalid_argument);
  params.offset = {0.1F, -0.1F};
  CHECK(validate(params).ok());
}
