// SPDX-License-Identifier: Apache-2.0
#include "npsim/pipeline/detail/leaf_normals.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "fixture.hpp"
#include "known_depth.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/executor.hpp"

using namespace npsim;
using npsim_test::Image;
using npsim_test::KnownDepth;

namespace {

constexpr Shape kShape{160, 120};

// A wall 10 m ahead, the left half of it a hedge.
struct Hedge {
  KnownDepth known{kShape, 10};
  Image<Vec3f> vertices{kShape};
  Image<std::uint32_t> visible{kShape}, object{kShape};
  std::vector<std::uint32_t> pixels;
  std::vector<Vec3f> normals;
  std::vector<float> lifts;
  RefinedDepth refined;
  SceneMesh mesh;

  Hedge() {
    const Intrinsics camera{400, 400, 80, 60};
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        known.labels(x, y) = is_hedge(x) ? label::vegetation : label::building;
        vertices(x, y) = unproject_pixel(camera, x, y, 10.0F);
        visible(x, y) = static_cast<std::uint32_t>(pixels.size());
        pixels.push_back(visible(x, y));
      }
    }
    normals.assign(pixels.size(), Vec3f{0, 0, -1});
    lifts.assign(pixels.size(), -1.0F);
    refined = known.refined();
    mesh.camera = camera;
    mesh.mesh.vertices = {vertices.cview().data(), pixels.size()};
    mesh.vertex_pixel = {pixels.data(), pixels.size()};
    mesh.background_vertices = mesh.sheet_vertices = pixels.size();
    mesh.background.vertices = vertices.view();
    mesh.visible_vertex = visible.cview();
    mesh.object = object.cview();
  }
  [[nodiscard]] static bool is_hedge(int x) { return x < kShape.width / 2; }
  template <class Executor>
  void turn(Executor& executor, std::uint64_t key = 1) {
    relight_detail::turn_leaves(key, refined, mesh, {normals.data(), normals.size()}, {lifts.data(), lifts.size()},
                                executor);
  }
  [[nodiscard]] Vec3f normal(int x, int y) const { return normals[visible(x, y)]; }
};

}  // namespace

TEST_CASE("leaf normals: lit from any side a plant is bright as Lambert's sphere is, seen from where it is seen") {
  Hedge hedge;
  SerialExecutor serial;
  hedge.turn(serial);
  for (const double degrees : {0.0, 40.0, 90.0, 130.0, 180.0}) {
    const double angle = degrees / 57.29577951;
    double got = 0;
    int count = 0;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width / 2; ++x, ++count) {
        const Vec3f v = -normalized(hedge.vertices(x, y));
        const Vec3f aside = normalized(cross(v, Vec3f{0.3F, 1, 0}));
        const Vec3f l = v * static_cast<float>(std::cos(angle)) + aside * static_cast<float>(std::sin(angle));
        got += static_cast<double>(std::max(0.0F, dot(hedge.normal(x, y), l)));
      }
    }
    constexpr double kPi = 3.14159265358979;
    const double sphere = 2 / (3 * kPi) * (std::sin(angle) + (kPi - angle) * std::cos(angle));
    CAPTURE(degrees);
    CHECK(std::fabs(got / count - sphere) < 0.01);  // of 9600 leaves: .25 deviation each
  }
}

TEST_CASE("leaf normals: leaves face the camera and start their rays above their crown; walls stay as they are") {
  Hedge hedge;
  SerialExecutor serial;
  hedge.turn(serial);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const float lift = hedge.lifts[hedge.visible(x, y)];
      if (!Hedge::is_hedge(x)) {
        CHECK(hedge.normal(x, y) == Vec3f{0, 0, -1});
        CHECK(lift == -1.0F);
        continue;
      }
      CHECK(length(hedge.normal(x, y)) == doctest::Approx(1.0));
      CHECK(dot(hedge.normal(x, y), hedge.vertices(x, y)) <= 0.0F);
      CHECK(lift > 0.0F);
    }
  }
}

TEST_CASE(
    "leaf normals: the same bits in any order of work; a pixel that borrows its neighbour's vertex turns nothing") {
  Hedge a;
  Hedge b;
  for (Hedge* h : {&a, &b}) h->visible(11, 20) = h->visible(10, 20);
  const std::size_t without = static_cast<std::size_t>(20 * kShape.width + 11);
  SerialExecutor serial;
  npsim_test::BackwardExecutor backward;
  a.turn(serial);
  b.turn(backward);
  CHECK(a.normals == b.normals);
  CHECK(a.lifts == b.lifts);
  CHECK(a.lifts[without] == -1.0F);
  Hedge other;
  other.turn(serial, 2);
  CHECK(other.normals != a.normals);
}

TEST_CASE(
    "leaf normals: where plants are seen whose normals are guessed, unless depth is exact or light is not spread") {
  Image<Label> labels({4, 3}, label::building);
  Image<Vec3f> normals({4, 3});
  SceneView scene;
  UnsureLightParams params;
  const auto has = [&](DepthSource source) { return relight_detail::has_leaf_normals(params, scene, source); };
  CHECK_FALSE(has(DepthSource::stereo));
  scene.labels = labels.cview();
  CHECK_FALSE(has(DepthSource::stereo));
  labels(3, 2) = label::vegetation;
  CHECK(has(DepthSource::stereo));
  CHECK(has(DepthSource::network));
  CHECK_FALSE(has(DepthSource::exact));
  scene.normals = normals.cview();
  CHECK_FALSE(has(DepthSource::stereo));
  scene.normals = {};
  params.reach = 0;
  CHECK_FALSE(has(DepthSource::stereo));
}
