// SPDX-License-Identifier: Apache-2.0
// Objects with a back: closed solids from any front, the boxes of vehicles, and what a back must not stick into.
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "fixture.hpp"
#include "mesh_fixture.hpp"
#include "npsim/mesh/solidify.hpp"

namespace {

using namespace mesh_test;

// Front and backs of a picture's objects in one mesh; the front's indices start at `first`.
struct Solid {
  Indexed front;
  Indexed backs;
  Status status;
  [[nodiscard]] Indexed whole(std::uint32_t first) const {
    Indexed all = front;
    all.vertices.insert(all.vertices.end(), backs.vertices.begin(), backs.vertices.end());
    for (const Face& f : backs.faces) all.faces.push_back({f.a - first, f.b - first, f.c - first});
    return all;
  }
};

template <class Executor>
Solid solidify_front(Indexed front, const SolidifyParams& params, const SolidifyScene& scene, Executor& executor,
                     std::uint32_t first = 0) {
  Solid solid;
  std::vector<Face> faces = front.faces;
  for (Face& f : faces) f = {f.a + first, f.b + first, f.c + first};
  const SolidifyFront view{{{front.vertices.data(), front.vertices.size()}, {faces.data(), faces.size()}},
                           {front.pixels.data(), front.pixels.size()},
                           first};
  Scratch scratch(solidify_workspace_bytes(params, scene.object.shape(), front.vertices.size(), faces.size()));
  MeshSize size;
  const Status asked = solidify(params, view, scene, MeshBuffers{}, size, scratch.workspace(), executor);
  solid.status = asked;
  solid.front = std::move(front);
  if (asked.code() != StatusCode::capacity_exceeded) return solid;
  solid.backs = {std::vector<Vec3f>(size.vertices), std::vector<Face>(size.faces),
                 std::vector<std::uint32_t>(size.vertices)};
  Indexed& b = solid.backs;
  const MeshBuffers out{
      {b.vertices.data(), b.vertices.size()}, {b.faces.data(), b.faces.size()}, {b.pixels.data(), b.pixels.size()}};
  solid.status = solidify(params, view, scene, out, size, scratch.workspace(), executor);
  CHECK(scratch.workspace().used() == 0);
  return solid;
}

SolidifyScene scene_of(Picture& p, bool background = true) {
  SolidifyScene scene;
  scene.camera = p.intrinsics;
  scene.object = p.object.cview();
  scene.labels = p.labels.cview();
  if (background) scene.background = p.background.vertices.cview();
  return scene;
}

// Runs the picture through both completions and solidify; what every such solid satisfies is checked.
Solid solid_of(Picture& p, const SolidifyParams& params = {}, bool background = true) {
  p.run();
  SerialExecutor executor;
  Solid solid = solidify_front(index(p.foreground.view()), params, scene_of(p, background), executor);
  if (solid.front.faces.empty()) return solid;
  REQUIRE_MESSAGE(solid.status.ok(), solid.status.message());
  const Indexed whole = solid.whole(0);
  const MeshReport r = report(whole.view());
  const MeshReport front = report(solid.front.view());
  CHECK(r.watertight());
  CHECK(r.isolated_vertices == 0);
  CHECK(r.components == front.components);
  // Doubling a surface along its rim: chi = 2 chi(front), as the rim's own is 0.
  CHECK(r.euler_characteristic == 2 * front.euler_characteristic);
  for (std::size_t v = 0; v < solid.front.vertices.size(); ++v) {
    const Vec3f near = solid.front.vertices[v];
    const Vec3f far = solid.backs.vertices[v];
    REQUIRE(far.z >= near.z * (1.0F + 0.9F * params.min_relative));
    const Vec2f a = project(p.intrinsics, near);
    const Vec2f b = project(p.intrinsics, far);
    REQUIRE(std::fabs(a.x - b.x) + std::fabs(a.y - b.y) < 1e-4F * static_cast<float>(p.shape.width + p.shape.height));
    REQUIRE(solid.backs.pixels[v] == solid.front.pixels[v]);
  }
  return solid;
}

// Depth of the first face, back side or front, that the ray of pixel centre (x, y) meets behind its front vertex.
float back_depth(const Solid& s, const Picture& p, int x, int y) {
  const auto pixel = static_cast<std::uint32_t>(y * p.shape.width + x);
  for (std::size_t v = 0; v < s.front.pixels.size(); ++v) {
    if (s.front.pixels[v] == pixel) return s.backs.vertices[v].z;
  }
  return 0.0F;
}

// Depth at which the ray of a pixel enters an upright box (rotated by `heading` about its middle), 0 where it misses.
struct TestBox {
  double x, z, heading, length, width;  // middle; the length lies along (sin heading, cos heading)
  void slabs(double rx, double& enter, double& leave) const {
    const double c = std::cos(heading);
    const double s = std::sin(heading);
    enter = 0;
    leave = 1e30;
    const double direction[2] = {rx * s + c, rx * c - s};
    const double middle[2] = {x * s + z * c, x * c - z * s};
    const double half[2] = {0.5 * length, 0.5 * width};
    for (int k = 0; k < 2; ++k) {
      double t0 = (middle[k] - half[k]) / direction[k];
      double t1 = (middle[k] + half[k]) / direction[k];
      if (t0 > t1) std::swap(t0, t1);
      enter = std::fmax(enter, t0);
      leave = std::fmin(leave, t1);
    }
  }
  // Distance of a point from the box's outline along the nearer axis, inside or outside.
  [[nodiscard]] double outline_distance(double px, double pz) const {
    const double c = std::cos(heading);
    const double s = std::sin(heading);
    const double a = std::fabs((px - x) * s + (pz - z) * c) - 0.5 * length;
    const double b = std::fabs((px - x) * c - (pz - z) * s) - 0.5 * width;
    return std::fabs(std::fmax(a, b));
  }
};

// Draws the box as a car between 0 and 1.4 m below a camera that stands level.
void draw(Picture& p, const TestBox& box, Label l) {
  for (int x = 0; x < p.shape.width; ++x) {
    const double rx = (x + 0.5 - static_cast<double>(p.intrinsics.cx)) / static_cast<double>(p.intrinsics.fx);
    double enter = 0;
    double leave = 0;
    box.slabs(rx, enter, leave);
    if (!(enter < leave) || !(enter > 0.1)) continue;
    for (int y = 0; y < p.shape.height; ++y) {
      const double ry = (y + 0.5 - static_cast<double>(p.intrinsics.cy)) / static_cast<double>(p.intrinsics.fy);
      if (ry * enter < 0.0 || ry * enter > 1.4) continue;
      p.labels(x, y) = l;
      p.depth(x, y) = static_cast<float>(enter);
    }
  }
}

}  // namespace

TEST_CASE("solidify: a car seen from behind is a box as long as a car, not as its silhouette") {
  Picture p({200, 120});
  p.intrinsics = {300, 300, 100, 40};
  p.rectangle(0, 0, 199, 119, label::building, 60.0F);
  draw(p, {0.3, 17.25, 0.0, 4.5, 1.8}, label::car);
  const Solid s = solid_of(p);
  int judged = 0;
  for (int x = 95; x < 118; x += 3) {
    const float back = back_depth(s, p, x, 50);
    if (back == 0.0F) continue;
    ++judged;
    CHECK(back == doctest::Approx(19.5).epsilon(0.01));
  }
  CHECK(judged > 5);
}

TEST_CASE("solidify: a parked car seen from behind and beside ends where its box ends, at any heading") {
  for (const double heading_deg : {-40.0, -20.0, -3.0, 0.0, 10.0, 30.0, 60.0, 90.0}) {
    Picture p({320, 120});
    p.intrinsics = {300, 300, 160, 40};
    p.rectangle(0, 0, 319, 119, label::building, 80.0F);
    const TestBox box{-2.5, 15.0, heading_deg * 3.14159265358979 / 180, 4.5, 1.8};
    draw(p, box, label::car);
    SolidifyParams params;
    params.rules[label::car].belt_m = 0.0F;
    params.street_weight = 0.0F;
    const Solid s = solid_of(p, params);
    double worst = 0;
    int judged = 0;
    for (std::size_t v = 0; v < s.front.vertices.size(); ++v) {
      const auto x = static_cast<int>(s.front.pixels[v] % 320);
      double enter = 0;
      double leave = 0;
      box.slabs((x + 0.5 - 160.0) / 300.0, enter, leave);
      if (leave - enter < 0.3) continue;  // corners, where the outline's outliers count
      worst = std::fmax(worst, box.outline_distance(static_cast<double>(s.backs.vertices[v].x),
                                                    static_cast<double>(s.backs.vertices[v].z)));
      ++judged;
    }
    CAPTURE(heading_deg);
    CHECK(judged > 200);
    CHECK(worst < 0.65);  // 15 % of the length may be taken for the unseen rest of a shorter car
  }
}

TEST_CASE("solidify: above the belt a car's far end is that of its cabin, where the ground is known") {
  const SolidifyParams params;
  const BackRule& rule = params.rules[label::car];
  solidify_detail::UprightBox box;
  box.along[0] = {1, 0, 0};
  box.along[1] = {0, 0, 1};
  box.low_m[0] = -0.9F;
  box.high_m[0] = 0.9F;
  box.low_m[1] = 10.0F;
  box.high_m[1] = 14.5F;
  const Vec3f up{0, -1, 0};
  const Vec3f high{0, 0.0F, 10.0F};  // at the camera's height of 1.4 m
  const Vec3f low{0, 0.8F, 10.0F};   // 0.6 m above the ground
  CHECK(solidify_detail::exit_ratio(box, rule, up, 1.4F, high) == doctest::Approx(1.36));
  CHECK(solidify_detail::exit_ratio(box, rule, up, 1.4F, low) == doctest::Approx(1.45));
  CHECK(solidify_detail::exit_ratio(box, rule, up, 0.0F, high) == doctest::Approx(1.45));
  // A ray that sinks below the belt before the cabin ends goes on to the end of the box.
  const Vec3f sinking{0, 0.38F, 10.0F};
  CHECK(solidify_detail::exit_ratio(box, rule, up, 1.4F, sinking) == doctest::Approx(1.45));
}

namespace {

// An object at 15 m whose building stands far enough behind it not to matter.
SolidifyScene object_before_building(Picture& p, Label object) {
  p.rectangle(0, 0, 119, 79, label::building, 70.0F);
  p.rectangle(40, 25, 70, 35, object, 15.0F);
  p.run();
  SolidifyScene scene = scene_of(p);
  scene.camera_height_m = 1.6F;  // the lowest row stands 0.05 m above the ground
  return scene;
}

}  // namespace

TEST_CASE("solidify: a back stays before the background of its pixel and above the ground, its front permitting") {
  Picture p({120, 80});
  p.intrinsics = {150, 150, 60, 20};
  p.rectangle(0, 0, 119, 79, label::building, 16.0F);
  p.rectangle(40, 25, 70, 35, label::car, 15.0F);
  Solid s = solid_of(p);
  for (const Vec3f& v : s.backs.vertices) CHECK(v.z <= 16.0F * (1 - 4e-3F));
  SolidifyScene scene = object_before_building(p, label::trailer);
  SerialExecutor executor;
  s = solidify_front(index(p.foreground.view()), {}, scene, executor);
  REQUIRE(s.status.ok());
  bool touched = false;
  for (std::size_t v = 0; v < s.backs.vertices.size(); ++v) {
    const Vec3f back = s.backs.vertices[v];
    CHECK(scene.camera_height_m - back.y > 0.019F);
    touched = touched || scene.camera_height_m - back.y < 0.021F;
  }
  CHECK(touched);
  // A wall in front of the object cannot be had: the front wins.
  p.background.vertices = Image<Vec3f>(p.shape, Vec3f{0, 0, 5});
  scene.background = p.background.vertices.cview();
  s = solidify_front(index(p.foreground.view()), {}, scene, executor);
  for (std::size_t v = 0; v < s.backs.vertices.size(); ++v) {
    CHECK(s.backs.vertices[v].z == doctest::Approx(static_cast<double>(s.front.vertices[v].z) * 1.001).epsilon(1e-5));
  }
}

TEST_CASE("solidify: light passes under a car") {
  Picture p({120, 80});
  p.intrinsics = {150, 150, 60, 20};
  const SolidifyScene scene = object_before_building(p, label::car);
  SerialExecutor executor;
  const float clearance = SolidifyParams{}.rules[label::car].clearance_m;
  const Solid s = solidify_front(index(p.foreground.view()), {}, scene, executor);
  REQUIRE(s.status.ok());
  std::size_t at_the_front = 0;
  bool touched = false;
  for (std::size_t v = 0; v < s.backs.vertices.size(); ++v) {
    const float above = scene.camera_height_m - s.backs.vertices[v].y;
    if (above < clearance - 1e-3F) {  // a wheel or a bumper: as thin as can be
      CHECK(s.backs.vertices[v].z < s.front.vertices[v].z * 1.0011F);
      ++at_the_front;
    }
    touched = touched || std::fabs(above - clearance) < 1e-3F;
  }
  CHECK(at_the_front > 0);
  CHECK(touched);
}

TEST_CASE("solidify: a pole one pixel wide becomes a solid two pixels thick at most") {
  Picture p({40, 60});
  p.rectangle(0, 0, 39, 59, label::building, 50.0F);
  p.rectangle(20, 5, 20, 55, label::pole, 10.0F);
  const Solid s = solid_of(p);
  CHECK(!s.front.faces.empty());
  for (const Vec3f& v : s.backs.vertices) {
    CHECK(v.z > 10.05F);
    CHECK(v.z < 10.0F + 2.1F * 10.0F / 100.0F);
  }
}

TEST_CASE("solidify: a hole inside an object stays a hole of the solid") {
  Picture p({60, 60});
  p.rectangle(0, 0, 59, 59, label::building, 50.0F);
  p.rectangle(10, 10, 50, 50, label::bicycle, 8.0F);
  p.rectangle(20, 20, 40, 40, label::building, 50.0F);  // the wheel's rim
  const Solid s = solid_of(p);
  const MeshReport r = report(s.whole(0).view());
  CHECK(r.euler_characteristic == 0);  // a torus
  p.rectangle(12, 12, 14, 14, label::building, 50.0F);
  CHECK(report(solid_of(p).whole(0).view()).euler_characteristic == -2);
}

TEST_CASE("solidify: objects at every image border, before the sky, one before another, and touching corners") {
  Picture p({64, 48});
  p.rectangle(0, 0, 63, 15, label::sky, 0.0F);
  p.rectangle(0, 10, 9, 47, label::car, 6.0F);
  p.rectangle(54, 0, 63, 30, label::bus, 9.0F);
  p.rectangle(20, 8, 40, 47, label::truck, 20.0F);
  p.rectangle(30, 12, 50, 40, label::person, 7.0F);
  p.rectangle(12, 12, 15, 15, label::pole, 5.0F);
  p.rectangle(16, 16, 19, 19, label::pole, 5.5F);
  const Solid s = solid_of(p);
  CHECK(report(s.front.view()).components >= 6);
  Picture full({32, 24});
  full.rectangle(0, 0, 31, 23, label::car, 4.0F);
  solid_of(full);
}

TEST_CASE("solidify: vertices at 1e5 m, a NaN ring, uncertain pixels only, one row and one column") {
  Picture far({40, 30});
  far.rectangle(0, 0, 39, 29, label::building, 9.9e5F);
  far.rectangle(10, 10, 30, 25, label::car, 1e5F);
  far.rectangle(2, 2, 6, 28, label::pole, 1e5F);
  solid_of(far);
  Picture ring({40, 30});
  ring.rectangle(10, 8, 30, 22, label::person, 5.0F);
  for (int x = 10; x <= 30; ++x) ring.depth(x, 8) = ring.depth(x, 22) = kNaN;
  for (int y = 8; y <= 22; ++y) ring.depth(10, y) = ring.depth(30, y) = kNaN;
  solid_of(ring);
  ring.doubt(0, 0, 39, 29);
  solid_of(ring);
  for (const Shape shape : {Shape{17, 1}, Shape{1, 17}, Shape{1, 1}}) {
    Picture line(shape);
    line.rectangle(0, 0, shape.width - 1, shape.height - 1, label::car, 5.0F);
    CHECK(solid_of(line).front.faces.empty());
  }
}

TEST_CASE("solidify: labels that change in every pixel, and random masks of random depth, are closed") {
  RandomStream random(7, RandomPurpose::generic, 0, 0, 0, 0);
  const Label kinds[] = {label::building,     label::car, label::pole,   label::person,
                         label::traffic_sign, label::sky, label::bicycle};
  for (int round = 0; round < 300; ++round) {
    random = RandomStream(7, RandomPurpose::generic, 0, 0, 0, static_cast<std::uint32_t>(round * 256));
    const Shape shape{3 + static_cast<int>(random.next_u32() % 14), 3 + static_cast<int>(random.next_u32() % 14)};
    Picture p(shape);
    const std::uint32_t mixed = 1 + random.next_u32() % 7;
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        p.rectangle(x, y, x, y, kinds[random.next_u32() % mixed], 1.0F + 40.0F * random.uniform());
        if (random.uniform() < 0.1F) p.uncertain(x, y) = 1;
      }
    }
    SolidifyParams params;
    if (round % 2 == 0) params.rules.fill({BackShape::soft, 2.0F, 0.0F});
    solid_of(p, params, round % 3 != 0);
  }
}

TEST_CASE("solidify: a simplified front is closed just as a full one") {
  // A disc of few large faces, three triangles round one vertex, and a lone triangle.
  Picture p({40, 40});
  p.rectangle(5, 5, 35, 35, label::car, 12.0F);
  p.run();
  const auto at = [&](int x, int y) { return p.foreground.vertices(x, y); };
  const Indexed front{{at(6, 6), at(20, 34), at(34, 6), at(20, 15), at(30, 20), at(30, 30), at(35, 30)},
                      {{0, 1, 3}, {1, 2, 3}, {2, 0, 3}, {4, 5, 6}},
                      {6 * 40 + 6, 34 * 40 + 20, 6 * 40 + 34, 15 * 40 + 20, 20 * 40 + 30, 30 * 40 + 30, 30 * 40 + 35}};
  SerialExecutor executor;
  const Solid s = solidify_front(front, {}, scene_of(p), executor, 1000);
  REQUIRE(s.status.ok());
  const MeshReport r = report(s.whole(1000).view());
  CHECK(r.watertight());
  CHECK(r.components == 2);
  CHECK(r.euler_characteristic == 4);
  CHECK(s.backs.faces.size() == back_faces(4, 6));
}

TEST_CASE("solidify: soft things taper to their rim, plates are thin, persons no thicker than wide") {
  Picture p({80, 80});
  p.rectangle(0, 0, 79, 79, label::building, 60.0F);
  p.rectangle(20, 20, 60, 60, label::person, 10.0F);
  SolidifyParams params;
  params.rules[label::person] = {BackShape::soft, 3.0F, 0.0F};
  Solid s = solid_of(p, params);
  CHECK(back_depth(s, p, 40, 40) == doctest::Approx(13.0).epsilon(0.02));
  // Half a pixel from the rim, a run of 31 pixels of 0.1 m counted to the other side: 2 sqrt(0.5 * 31.5) pixels.
  CHECK(back_depth(s, p, 20, 40) - 10.0F == doctest::Approx(0.794).epsilon(0.03));
  CHECK(back_depth(s, p, 60, 40) - 10.0F == doctest::Approx(0.794).epsilon(0.03));
  params.rules[label::person] = {BackShape::plate, 0.03F, 0.0F};
  s = solid_of(p, params);
  CHECK(back_depth(s, p, 40, 40) == doctest::Approx(10.03).epsilon(1e-4));
  s = solid_of(p);
  CHECK(back_depth(s, p, 40, 40) == doctest::Approx(10.4).epsilon(1e-3));
  p.rectangle(0, 0, 79, 79, label::building, 60.0F);
  p.rectangle(40, 20, 41, 60, label::person, 10.0F);
  s = solid_of(p);
  CHECK(back_depth(s, p, 40, 40) == doctest::Approx(10.2).epsilon(1e-3));
}

TEST_CASE("solidify: the last chunk first gives the same bits") {
  Picture p({64, 48});
  p.rectangle(2, 10, 9, 40, label::car, 6.0F);
  p.rectangle(12, 10, 29, 40, label::bus, 16.0F);
  p.rectangle(32, 10, 33, 40, label::pole, 6.0F);
  p.rectangle(36, 10, 49, 40, label::person, 7.0F);
  p.rectangle(52, 10, 60, 40, label::bicycle, 8.0F);
  p.run();
  SerialExecutor serial;
  npsim_test::BackwardExecutor backward;
  const Solid a = solidify_front(index(p.foreground.view()), {}, scene_of(p), serial);
  const Solid b = solidify_front(index(p.foreground.view()), {}, scene_of(p), backward);
  REQUIRE(a.backs.vertices.size() == b.backs.vertices.size());
  for (std::size_t v = 0; v < a.backs.vertices.size(); ++v) CHECK(a.backs.vertices[v] == b.backs.vertices[v]);
}

TEST_CASE("solidify: fronts that are no manifold, and bad input, are refused and leave the output untouched") {
  Picture p({16, 16});
  p.rectangle(2, 2, 12, 12, label::car, 5.0F);
  p.run();
  SerialExecutor executor;
  const Indexed good = index(p.foreground.view());
  const auto code = [&](const Indexed& front, const SolidifyParams& params, const SolidifyScene& scene) {
    return solidify_front(front, params, scene, executor).status.code();
  };
  CHECK(code(good, {}, scene_of(p)) == StatusCode::ok);
  Indexed bad = good;
  bad.faces.push_back(bad.faces[0]);  // twice
  CHECK(code(bad, {}, scene_of(p)) == StatusCode::invalid_argument);
  bad = good;
  bad.faces[0].a = static_cast<std::uint32_t>(bad.vertices.size());
  CHECK(code(bad, {}, scene_of(p)) == StatusCode::invalid_argument);
  bad = good;
  bad.faces[3].b = bad.faces[3].a;
  CHECK(code(bad, {}, scene_of(p)) == StatusCode::invalid_argument);
  bad = good;
  bad.vertices[2].x = kNaN;
  CHECK(code(bad, {}, scene_of(p)) == StatusCode::invalid_argument);
  bad = good;
  bad.vertices[2] = bad.vertices[2] * 1e38F;
  CHECK(code(bad, {}, scene_of(p)) == StatusCode::invalid_argument);
  bad = good;
  bad.pixels[1] = 16 * 16;
  CHECK(code(bad, {}, scene_of(p)) == StatusCode::invalid_argument);
  bad = good;
  bad.pixels.pop_back();
  CHECK(code(bad, {}, scene_of(p)) == StatusCode::shape_mismatch);
  // Two faces that share one vertex and nothing else.
  const Indexed pinched{
      {{0, 0, 5}, {0, 1, 5}, {1, 0, 5}, {0, -1, 5}, {-1, 0, 5}}, {{0, 1, 2}, {0, 3, 4}}, {100, 101, 102, 103, 104}};
  CHECK(code(pinched, {}, scene_of(p)) == StatusCode::invalid_argument);
  SolidifyParams params;
  params.min_relative = 0.0F;
  CHECK(code(good, params, scene_of(p)) == StatusCode::invalid_argument);
  params = {};
  params.rules[label::car].length_m = kNaN;
  CHECK(code(good, params, scene_of(p)) == StatusCode::invalid_argument);
  SolidifyScene scene = scene_of(p);
  scene.up = {0, -2, 0};
  CHECK(code(good, {}, scene) == StatusCode::invalid_argument);
  scene = scene_of(p);
  scene.camera_height_m = std::numeric_limits<float>::infinity();
  CHECK(code(good, {}, scene) == StatusCode::invalid_argument);
  Picture other({8, 8});
  scene = scene_of(p);
  scene.labels = other.labels.cview();
  CHECK(code(good, {}, scene) == StatusCode::shape_mismatch);
}
