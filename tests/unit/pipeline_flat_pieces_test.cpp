// SPDX-License-Identifier: Apache-2.0
#include "npsim/pipeline/detail/flat_pieces.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "fixture.hpp"
#include "known_depth.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/memory.hpp"
#include "npsim/pipeline/night.hpp"
#include "tool/engine.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

constexpr Shape kShape{40, 24};

// A wall 10 m away that faces the camera.
struct Wall {
  SceneMesh mesh;
  Image<Label> labels{kShape, label::building};
  Image<std::uint32_t> object{kShape};
  Image<std::uint32_t> vertex{kShape};
  std::vector<Vec3f> positions = std::vector<Vec3f>(kShape.pixels());
  std::vector<Vec3f> normals = std::vector<Vec3f>(kShape.pixels(), Vec3f{0, 0, -1});
  Image<std::uint16_t> piece{kShape};
  npsim_test::Scratch memory{number_flat_pieces_workspace_bytes(kShape)};

  Wall() {
    std::uint32_t pixel = 0;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        vertex(x, y) = pixel++;
        place(x, y, 10);
      }
    }
  }
  [[nodiscard]] Vec3f& normal(int x, int y) { return normals[static_cast<std::size_t>(y * kShape.width + x)]; }
  void place(int x, int y, float z) {
    positions[static_cast<std::size_t>(y * kShape.width + x)] = {0.02F * z * float(x), 0.02F * z * float(y), z};
  }
  void number(const FlatParams& params = {}, std::uint32_t first = 1) {
    mesh.object = object.cview();
    mesh.visible_vertex = vertex.cview();
    SurfacePoints points;
    points.position = {positions.data(), positions.size()};
    points.normal = {normals.data(), normals.size()};
    REQUIRE(number_flat_pieces(params, labels.cview(), mesh, points, first, memory.workspace(), piece.view()).ok());
    CHECK(memory.workspace().used() == 0);
  }
};

Vec3f turned(float degrees) {
  const float angle = degrees * 0.0174533F;
  return {std::sin(angle), 0, -std::cos(angle)};
}

}  // namespace

TEST_CASE("flat pieces: uneven depth is one wall, its two sides at a corner are two, what bends slowly is one") {
  Wall s;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      s.place(x, y, x % 2 == 0 || x > 20 ? 10.0F : 10.15F);                   // 1.5 %
      s.normal(x, y) = turned(x < 20 ? 0.0F : 10.0F + 0.9F * float(x - 20));  // then a round tower
    }
  }
  s.number({}, 5);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) CHECK(s.piece(x, y) == (x < 20 ? 5 : 6));
  }
}

TEST_CASE(
    "flat pieces: a wall behind another and a sign before it are their own; a tree, a hole and a fleck are none") {
  Wall s;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < 12; ++x) s.place(x, y, 10.25F);  // 2.5 %: the house beside it stands back
    s.labels(30, y) = label::vegetation;
    s.vertex(31, y) = kNoVertex;
  }
  for (int y = 4; y < 10; ++y) {
    for (int x = 15; x < 20; ++x) {
      s.labels(x, y) = label::traffic_sign;
      s.object(x, y) = 3;
      s.place(x, y, 9.9F);
    }
  }
  for (int x = 22; x < 25; ++x) {
    for (int y = 15; y < 20; ++y) s.normal(x, y) = turned(60);  // 15 pixels
  }
  s.number();
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      CAPTURE(x);
      CAPTURE(y);
      const bool sign = x >= 15 && x < 20 && y >= 4 && y < 10;
      const bool none = x == 30 || x == 31 || (x >= 22 && x < 25 && y >= 15 && y < 20);
      CHECK(s.piece(x, y) == (none ? 0 : x < 12 ? 1 : sign ? 4 : x < 30 ? 2 : 3));
    }
  }
}

TEST_CASE("flat pieces: a normal that is not finite joins nothing; numbers end at 65535; parameters out of range") {
  Wall s;
  for (int y = 0; y < kShape.height; ++y) {
    s.normal(5, y) = {std::numeric_limits<float>::quiet_NaN(), 0, -1};
    s.normal(9, y) = {};  // of a pixel that has none
  }
  s.number({}, 65534);
  CHECK(s.piece(0, 0) == 65534);
  CHECK(s.piece(5, 0) == 0);
  CHECK(s.piece(6, 0) == 65535);
  CHECK(s.piece(9, 0) == 0);
  CHECK(s.piece(10, 0) == 0);
  s.labels = Image<Label>();
  s.number();
  CHECK(s.piece(0, 0) == 0);
  FlatParams p;
  for (const float bad : {-0.1F, 1.1F, std::numeric_limits<float>::quiet_NaN()}) {
    p.min_cosine = bad;
    CHECK(validate(p).code() == StatusCode::invalid_argument);
  }
  p = {};
  p.max_step = -0.1F;
  CHECK(validate(p).code() == StatusCode::invalid_argument);
  p = {};
  p.least_px = 0;
  CHECK(validate(p).code() == StatusCode::invalid_argument);
}

namespace {

// A road between a wall 4 m to the right and a house 24 m ahead, with one lamp 40 cm before the wall.
struct Street : npsim_test::KnownDepth {
  static constexpr Shape kSize{128, 72};
  Image<Rgb8> image{kSize, Rgb8{120, 120, 120}};
  SceneView view;

  // uneven: share of the wall's depth.
  explicit Street(float uneven) : KnownDepth(kSize, 0.0F) {
    view.camera = intrinsics_from_fov(kSize, 1.2F);
    for (int y = 0; y < kSize.height; ++y) {
      for (int x = 0; x < kSize.width; ++x) {
        const float right = (float(x) + 0.5F - view.camera.cx) / view.camera.fx;
        const float down = (float(y) + 0.5F - view.camera.cy) / view.camera.fy;
        const float road = down > 0 ? 1.5F / down : 1e9F;
        const float wall = right > 0 ? 4.0F / right : 1e9F;
        const float z = std::fmin(24.0F, std::fmin(road, wall));
        const bool is_wall = z == wall;
        labels(x, y) = z == road ? label::road : label::building;
        normals(x, y) = z == road ? Vec3f{0, -1, 0} : (is_wall ? Vec3f{-1, 0, 0} : Vec3f{0, 0, -1});
        const float wave = std::fabs(float(x % 16) - 7.5F) / 3.75F - 1.0F;
        depth(x, y) = is_wall ? z * (1.0F + uneven * wave) : z;
      }
    }
    view.image = image.cview();
    view.depth = depth.cview();
    view.labels = labels.cview();
  }

  [[nodiscard]] Image<Vec3f> night(LabelSet flat, DepthSource source) {
    NightParams params = default_night_params();
    params.relight.flat.classes = flat;
    params.relight.ego_headlamps = false;
    Emitter lamp;
    lamp.cls = LightClass::street_light_lt;
    lamp.shape = EmitterShape::sphere;
    lamp.profile = EmissionProfile::lambert;
    lamp.centre_m = {3.6F, -0.5F, 9.0F};
    lamp.half_u_m = {0.05F, 0, 0};
    lamp.area_m2 = 0.008F;
    lamp.up = {0, 0, 1};
    lamp.axis = {0, 1, 0};
    params.relight.lamps = {&lamp, 1};
    RefinedDepth known = refined();
    known.source = source;
    io::HostMemory memory(night_workspace_bytes(params, kSize, 0));
    Workspace workspace = memory.workspace();
    NullObserver observer;
    ThreadPool pool(2);
    struct Keep {
      Image<Vec3f> light{kSize};
      Status reconstructed(const RefinedDepth&, const SceneMesh&, const Relighting&) { return {}; }
      Status night(const Night& n) {
        for (int y = 0; y < kSize.height; ++y) {
          for (int x = 0; x < kSize.width; ++x) light(x, y) = n.luminance(x, y);
        }
        return {};
      }
    } keep;
    REQUIRE(engine::make_nights_of_depth(params, view, known, workspace, pool, observer, keep).ok());
    return keep.light;
  }
};

}  // namespace

TEST_CASE(
    "flat pieces: a wall that depth makes uneven is lit along itself as the even one, and is not with exact depth") {
  const Image<Vec3f> even = Street(0).night(kFlatLabels, DepthSource::stereo);
  const Street street(0.05F);
  int wall = 0;
  for (int y = 0; y < Street::kSize.height; ++y) {
    for (int x = 0; x < Street::kSize.width; ++x) wall += street.normals(x, y).x < 0 ? 1 : 0;
  }
  // Share of the wall's pixels with less than half of the light that they should have.
  const auto dark = [&](LabelSet flat, DepthSource source) {
    const Image<Vec3f> light = Street(0.05F).night(flat, source);
    int count = 0;
    for (int y = 0; y < Street::kSize.height; ++y) {
      for (int x = 0; x < Street::kSize.width; ++x) {
        if (street.normals(x, y).x < 0 && luminance(light(x, y)) < 0.5F * luminance(even(x, y))) ++count;
      }
    }
    return double(count) / wall;
  };
  REQUIRE(wall > 1000);
  CHECK(dark(kFlatLabels, DepthSource::stereo) < 0.01);
  CHECK(dark(LabelSet(), DepthSource::stereo) > 0.05);
  CHECK(dark(kFlatLabels, DepthSource::exact) > 0.05);
}
