// SPDX-License-Identifier: Apache-2.0
#include "npsim/pipeline/detail/ray_starts.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"

namespace {

using namespace npsim;
using npsim_test::Image;

constexpr Shape kShape{160, 96};
constexpr Vec3f kUp{0, -1, 0};

// A sheet of one layer, a vertex for each pixel, and the lifts of its points.
struct Sheet {
  Image<Vec3f> vertices{kShape};
  Image<std::uint32_t> visible{kShape};
  Image<std::uint8_t> quads{quad_shape(kShape)};
  std::vector<Vec3f> mesh_vertices, normals;
  std::vector<std::uint32_t> pixels;
  std::vector<float> lifts;

  template <class Depth, class Normal>
  Sheet(const Depth& depth, const Normal& normal) {
    const Intrinsics camera{725.0F, 725.0F, 80.0F, -180.0F};  // the lower end of a picture 960 pixels wide
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        const float z = depth(x, y, camera);
        vertices(x, y) = z > 0.0F ? unproject_pixel(camera, x, y, z) : Vec3f{};
        mesh_vertices.push_back(vertices(x, y));
        normals.push_back(normal(x, y));
        pixels.push_back(static_cast<std::uint32_t>(y * kShape.width + x));
      }
    }
    lifts.assign(pixels.size(), -1.0F);
    SceneMesh mesh;
    mesh.camera = camera;
    mesh.mesh.vertices = {mesh_vertices.data(), mesh_vertices.size()};
    mesh.vertex_pixel = {pixels.data(), pixels.size()};
    mesh.background_vertices = mesh.sheet_vertices = pixels.size();
    mesh.background = {vertices.view(), quads.view()};
    mesh.visible_vertex = visible.cview();
    SerialExecutor serial;
    ray_lifts(mesh, DepthNoise{}, kUp, {normals.data(), normals.size()}, {lifts.data(), lifts.size()}, serial);
  }
  [[nodiscard]] float lift(int x, int y) const { return lifts[static_cast<std::size_t>(y * kShape.width + x)]; }
};

// Depth of a level floor below the camera.
float floor_depth(int y, const Intrinsics& camera, float height_m) {
  const float fall = (static_cast<float>(y) + 0.5F - camera.cy) / camera.fy;
  return fall > 0.02F ? height_m / fall : 0.0F;
}

Vec3f up(int, int) { return kUp; }

}  // namespace

TEST_CASE("rays start at a smooth floor itself, but for rounding") {
  const Sheet floor([](int, int y, const Intrinsics& k) { return floor_depth(y, k, 1.5F); }, up);
  for (int y = 60; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      CHECK(floor.lift(x, y) > 0.0F);
      CHECK(floor.lift(x, y) < 1e-5F * std::max(1.5F, floor.vertices(x, y).z));
    }
  }
}

TEST_CASE("rays start above the bumps around their point where depth is noisy") {
  RandomStream random(7, RandomPurpose::test, 0, 0, 0, 0);
  std::vector<float> noise;
  for (std::size_t i = 0; i < kShape.pixels(); ++i) noise.push_back(1.0F + 2e-3F * (random.uniform() - 0.5F));
  const Sheet floor(
      [&](int x, int y, const Intrinsics& k) {
        return floor_depth(y, k, 1.5F) * noise[static_cast<std::size_t>(y * kShape.width + x)];
      },
      up);
  for (int y = 72; y < kShape.height - 2; ++y) {
    for (int x = 2; x < kShape.width - 2; ++x) {
      const float start = floor.vertices(x, y).y - floor.lift(x, y);
      for (const int dy : {-1, 0, 1}) {
        for (const int dx : {-1, 0, 1}) CHECK(start <= floor.vertices(x + dx, y + dy).y + 1e-6F);
      }
    }
  }
}

TEST_CASE("a kerb beside the point does not lift the ray, so that it keeps its shadow") {
  // A floor 1.5 m below the camera as far as 5 m, the upright face of the kerb there, and what lies 12 cm higher behind.
  const Sheet kerb(
      [](int, int y, const Intrinsics& k) {
        const float near = floor_depth(y, k, 1.5F);
        const float far = floor_depth(y, k, 1.38F);
        return near < 5.0F ? near : (far < 5.0F ? 5.0F : far);
      },
      up);
  int foot = 0;  // the first row of the floor
  while (kerb.vertices(80, foot).z >= 5.0F) ++foot;
  REQUIRE(foot > 10);
  REQUIRE(kerb.vertices(80, foot - 12).y < 1.45F);
  for (int y = foot; y < foot + 4; ++y) CHECK(kerb.lift(80, y) < 0.02F);
  CHECK(kerb.lift(80, foot + 5) < 1e-4F);
}

TEST_CASE("missing neighbours and the image's corners do not lift") {
  const Sheet holes([](int x, int y, const Intrinsics& k) { return x % 3 == 0 ? floor_depth(y, k, 1.5F) : 0.0F; }, up);
  CHECK(holes.lift(0, kShape.height - 1) < 1e-4F);
  CHECK(holes.lift(159, kShape.height - 1) < 1e-4F);
}

namespace {

// Rows of a face that stands on a level floor 1.5 m below the camera, the floor behind it complete, every eighth column
// nearer than the others; a wall before it, where wall_m is not 0, hides what is as low as its top.
struct Standing {
  std::vector<Vec3f> vertices, normals;
  std::vector<float> lifts;
  std::size_t of_floor = 0;

  Standing(Shape shape, const Intrinsics& camera, float face_m, float step_m, const Vec3f& normal,
           float wall_m = 0.0F) {
    Image<Vec3f> floor(shape);
    Image<Vec3f> face(shape);
    Image<std::uint32_t> visible(shape);
    Image<std::uint8_t> quads(quad_shape(shape));
    std::vector<std::uint32_t> pixels;
    const auto add = [&](Image<Vec3f>& layer, int x, int y, float z, const Vec3f& n) {
      if (z > 0.0F) layer(x, y) = unproject_pixel(camera, x, y, z);
      vertices.push_back(layer(x, y));
      normals.push_back(n);
      pixels.push_back(static_cast<std::uint32_t>(y * shape.width + x));
    };
    const auto hidden = [&](int y) { return wall_m > 0.0F && floor_depth(y, camera, 1.0F) < wall_m; };
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) add(floor, x, y, hidden(y) ? wall_m : floor_depth(y, camera, 1.5F), kUp);
    }
    of_floor = vertices.size();
    for (int y = 0; y < shape.height; ++y) {
      if (hidden(y) || (wall_m == 0.0F && floor(0, y).z < face_m)) continue;
      for (int x = 0; x < shape.width; ++x) add(face, x, y, x % 8 == 0 ? face_m - step_m : face_m, normal);
    }
    SceneMesh mesh;
    mesh.camera = camera;
    mesh.mesh.vertices = {vertices.data(), vertices.size()};
    mesh.vertex_pixel = {pixels.data(), pixels.size()};
    mesh.background_vertices = of_floor;
    mesh.sheet_vertices = vertices.size();
    mesh.background = {floor.view(), quads.view()};
    mesh.foreground = {face.view(), quads.view()};
    mesh.visible_vertex = visible.cview();
    lifts.resize(vertices.size());
    const DepthNoise noise{step_m / (5.0F * face_m * face_m), 0};
    SerialExecutor serial;
    ray_lifts(mesh, noise, kUp, {normals.data(), normals.size()}, {lifts.data(), lifts.size()}, serial);
  }
};

}  // namespace

TEST_CASE("what stands on the ground starts no ray under it, though its normal points down and its depth is noisy") {
  const Standing bumper(kShape, {725.0F, 725.0F, 80.0F, -180.0F}, 5.0F, 0.2F, normalized(Vec3f{0, 1, -1}));
  float highest = 0.0F;
  for (std::size_t v = bumper.of_floor; v < bumper.vertices.size(); ++v) {
    CHECK(bumper.lifts[v] > 0.0F);
    CHECK(bumper.vertices[v].y + bumper.normals[v].y * bumper.lifts[v] < 1.5F + 1e-5F);
    highest = std::max(highest, bumper.lifts[v]);
  }
  CHECK(highest > 0.1F);  // what stands higher keeps its lift
}

TEST_CASE("far away, where a row of the road is metres deep, a start just above the ground keeps its lift") {
  // A row at 40 m is 2.2 m of road: the nearer of two rows would stop every start before the lowest pixels.
  const Standing car({96, 48}, {480.0F, 480.0F, 48.0F, 0.0F}, 40.0F, 1.0F, Vec3f{0, 0, -1});
  for (std::size_t v = car.of_floor; v < car.vertices.size(); ++v) {
    CAPTURE(car.vertices[v].y);
    const bool rests = car.vertices[v].z < 39.5F;  // the columns that stick out
    const float above_m = 1.5F - car.vertices[v].y;
    if (!rests && above_m > 0.03F) CHECK(car.lifts[v] > 0.9F);
  }
}

TEST_CASE("a low wall before a car takes no lift from the car") {
  for (const float wall_m : {8.0F, 10.0F, 11.5F}) {
    CAPTURE(wall_m);
    const Standing car({96, 100}, {480.0F, 480.0F, 48.0F, -20.0F}, 12.0F, 0.4F, normalized(Vec3f{0, 1, -1}), wall_m);
    std::size_t recessed = 0;
    for (std::size_t v = car.of_floor; v < car.vertices.size(); ++v) {
      if (car.vertices[v].z < 11.9F) continue;  // the columns that stick out
      ++recessed;
      CHECK(car.lifts[v] > 0.2F);
    }
    CHECK(recessed > 1000);
  }
}

TEST_CASE("a sign before a crown lifts no ray of the crown, wherever the crown's normal points") {
  // A crown 60 m away, a sign 30 m away before its middle; depth is known to a metre there.
  const Shape shape{64, 32};
  const Intrinsics camera{1000.0F, 1000.0F, 32.0F, 200.0F};
  const Vec3f across = normalized(Vec3f{1, 0, -0.3F});
  Image<Vec3f> none(shape);
  Image<Vec3f> standing(shape);
  Image<std::uint32_t> object(shape);
  Image<std::uint32_t> visible(shape);
  Image<std::uint8_t> quads(quad_shape(shape));
  std::vector<Vec3f> vertices, normals;
  std::vector<std::uint32_t> pixels;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const bool sign = x >= 28 && x < 36;
      standing(x, y) = unproject_pixel(camera, x, y, sign ? 30.0F : 60.0F);
      object(x, y) = sign ? 2U : 1U;
      vertices.push_back(standing(x, y));
      normals.push_back(across);
      pixels.push_back(static_cast<std::uint32_t>(y * shape.width + x));
    }
  }
  SceneMesh mesh;
  mesh.camera = camera;
  mesh.mesh.vertices = {vertices.data(), vertices.size()};
  mesh.vertex_pixel = {pixels.data(), pixels.size()};
  mesh.sheet_vertices = vertices.size();
  mesh.background = {none.view(), quads.view()};
  mesh.foreground = {standing.view(), quads.view()};
  mesh.visible_vertex = visible.cview();
  mesh.object = object.cview();
  std::vector<float> lifts(vertices.size());
  SerialExecutor serial;
  ray_lifts(mesh, DepthNoise{1.0F / 3600.0F, 0}, kUp, {normals.data(), normals.size()}, {lifts.data(), lifts.size()},
            serial);
  // Of its own neighbours, 10 px of .06 m away along the crown, all rise by less than this.
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    if (vertices[v].z > 50.0F) CHECK(lifts[v] < 0.7F);
  }
}
