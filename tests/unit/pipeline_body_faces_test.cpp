// SPDX-License-Identifier: Apache-2.0
#include "npsim/pipeline/detail/body_faces.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <vector>

#include "fixture.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

constexpr Shape kShape{12, 4};

// A vertex and a face for each pixel; vertices of objects come behind those of the background.
struct Street {
  SceneView scene;
  SceneMesh mesh;
  Image<Rgb8> image{kShape};
  Image<Label> labels{kShape, label::road};
  Image<std::uint16_t> instances{kShape};
  Image<std::uint16_t> marks{kShape};
  Image<std::uint32_t> object{kShape};
  Image<std::uint32_t> vertex{kShape};
  std::vector<Vec3f> vertices = std::vector<Vec3f>(2 * kShape.pixels(), Vec3f{0, 0, 10});
  std::vector<Emitter> emitters;
  bool vertex_behind = false;  // (5, 1) shows the background's
  npsim_test::Scratch memory{300000};
  Bodies bodies;

  void thing(int x0, int x1, Label l, std::uint16_t instance, std::uint32_t number) {
    for (int y = 1; y < 3; ++y) {
      for (int x = x0; x < x1; ++x) {
        labels(x, y) = l;
        instances(x, y) = instance;
        object(x, y) = number;
      }
    }
  }
  void find(LabelSet classes = kBodyLabels) {
    scene.image = image.cview();
    scene.labels = labels.cview();
    scene.instances = instances.cview();
    scene.light_index = marks.cview();
    mesh.object = object.cview();
    const auto pixels = static_cast<std::uint32_t>(kShape.pixels());
    std::uint32_t pixel = 0;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x, ++pixel) vertex(x, y) = pixel + (object(x, y) != 0 ? pixels : 0);
    }
    if (vertex_behind) vertex(5, 1) = kShape.width + 5;
    mesh.visible_vertex = vertex.cview();
    mesh.background_vertices = pixels;
    mesh.mesh.vertices = {vertices.data(), vertices.size()};
    const auto each = [&](const auto& f) {
      const Vec3f corners[3] = {};
      for (std::uint32_t p = 0; p < 2 * pixels; ++p) {
        const std::uint32_t of[3] = {p % pixels, p % pixels, p % pixels};
        f(p, corners, of, p >= pixels);
      }
    };
    REQUIRE(find_bodies(classes, scene, mesh, {emitters.data(), emitters.size()}, 2 * pixels, each, memory.workspace(),
                        bodies)
                .ok());
  }
  [[nodiscard]] std::uint16_t of_pixel(int x, int y) const { return bodies.of_point[vertex(x, y)]; }
  // Of the background and of the object.
  [[nodiscard]] std::uint16_t of_face(int x, int y, bool of_object) const {
    const auto p = static_cast<std::size_t>(y * kShape.width + x);
    return bodies.of_face[p + (of_object ? kShape.pixels() : 0)];
  }
};

}  // namespace

TEST_CASE("bodies: a car that a pole divides is one, two cars are two, and what is behind them belongs to none") {
  Street s;
  s.thing(0, 3, label::car, 7, 1);
  s.thing(3, 4, label::pole, 0, 2);
  s.thing(4, 6, label::car, 7, 3);
  s.thing(8, 11, label::car, 9, 4);
  s.find();
  const std::uint16_t car = s.of_pixel(0, 1);
  const std::uint16_t other = s.of_pixel(8, 1);
  CHECK(car != 0);
  CHECK(other != 0);
  CHECK(car != other);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      CAPTURE(x);
      CAPTURE(y);
      const bool rows = y == 1 || y == 2;
      const std::uint16_t expected = !rows ? 0 : (x < 3 || x == 4 || x == 5 ? car : (x >= 8 && x < 11 ? other : 0));
      CHECK(s.of_pixel(x, y) == expected);
      CHECK(s.of_face(x, y, true) == expected);
      CHECK(s.of_face(x, y, false) == 0);
    }
  }
}

TEST_CASE("bodies: without numbers of instances each object is its own, of the class of most of its pixels") {
  Street s;
  s.thing(0, 3, label::car, 0, 1);
  s.thing(4, 6, label::car, 0, 3);
  s.object(3, 1) = 1;  // the car's, widened over the road's
  s.labels(8, 1) = label::car;
  s.object(8, 1) = s.object(9, 1) = s.object(10, 1) = 5;  // a post's, with one pixel of a car
  s.find();
  CHECK(s.of_pixel(0, 1) != 0);
  CHECK(s.of_pixel(3, 1) == s.of_pixel(0, 1));
  CHECK(s.of_pixel(4, 1) != s.of_pixel(0, 1));
  CHECK(s.of_pixel(8, 1) == 0);
}

TEST_CASE("bodies: two cars stay two where one is widened over a pixel of the other") {
  Street s;
  s.thing(0, 4, label::car, 5, 1);
  s.thing(4, 8, label::car, 9, 2);
  s.object(4, 1) = 1;
  s.find();
  CHECK(s.of_pixel(0, 1) != 0);
  CHECK(s.of_pixel(6, 1) != 0);
  CHECK(s.of_pixel(0, 1) != s.of_pixel(6, 1));
  CHECK(s.of_pixel(4, 1) == s.of_pixel(0, 1));
}

TEST_CASE("bodies: a point of the background that a car's pixel shows is not the car's") {
  Street s;
  s.thing(4, 7, label::car, 7, 1);
  s.vertex_behind = true;
  s.find();
  CHECK(s.bodies.of_point[s.vertex(5, 1)] == 0);
  CHECK(s.of_pixel(4, 1) != 0);
}

TEST_CASE("bodies: a lamp is part of the body that its mark lies on") {
  Street s;
  s.thing(0, 3, label::car, 7, 1);
  s.marks(1, 1) = 2;
  s.marks(6, 0) = 1;
  s.emitters.resize(3);
  s.emitters[0].mark = 1;  // a street lamp's
  s.emitters[1].mark = 2;
  s.emitters[2].mark = 0;  // the own headlamps'
  s.find();
  CHECK(s.bodies.of_lamp[0] == 0);
  CHECK(s.bodies.of_lamp[1] == s.of_pixel(0, 1));
  CHECK(s.bodies.of_lamp[2] == 0);
}

TEST_CASE("bodies: none and no memory for them without labels, without such things, or where no class is asked for") {
  Street plain;
  plain.find();
  CHECK(plain.bodies.of_face.empty());
  Street car;
  car.thing(0, 3, label::car, 7, 1);
  car.find(LabelSet());
  CHECK(car.bodies.of_face.empty());
  car.labels = Image<Label>();
  car.find();
  CHECK(car.bodies.of_face.empty());
  CHECK(car.memory.workspace().used() == 0);
}
