// SPDX-License-Identifier: Apache-2.0
// Which faces are whose lamp: by the marks of their corners' pixels, and by reach on solid objects.
#include "npsim/pipeline/detail/lamp_faces.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "fixture.hpp"
#include "npsim/io/image.hpp"

namespace {

using namespace npsim;

// 8 x 4 pixels on a plane 5 m ahead, 1 m apart; by default all background.
struct Scene {
  Shape shape{8, 4};
  io::Image<std::uint16_t> light_index{shape};
  io::Image<std::uint32_t> object{shape};
  std::vector<LightMark> lights;
  std::vector<Vec3f> vertices;
  std::vector<std::uint32_t> pixels;
  std::vector<Face> faces;
  std::vector<Emitter> emitters;
  std::size_t background_faces = 0;
  std::size_t sheet_faces = 0;

  Scene() {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        vertices.push_back({static_cast<float>(x), static_cast<float>(y), 5.0F});
        pixels.push_back(static_cast<std::uint32_t>(vertices.size() - 1));
      }
    }
  }
  [[nodiscard]] std::uint32_t at(int x, int y) const { return static_cast<std::uint32_t>(y * shape.width + x); }
  void face(int x, int y) { faces.push_back({at(x, y), at(x + 1, y), at(x, y + 1)}); }
  void lamp(LightClass cls, Vec3f centre, float half_m) {
    lights.push_back({static_cast<std::uint32_t>(70 + lights.size()), cls, SignalState::unknown, 0});
    Emitter e;
    e.centre_m = centre;
    e.half_u_m = {half_m, 0, 0};
    e.half_v_m = {0, half_m, 0};
    e.mark = static_cast<std::uint16_t>(lights.size());
    e.cls = cls;
    emitters.push_back(e);
  }
  [[nodiscard]] SceneView view() const {
    SceneView v;
    v.light_index = light_index.view();
    v.lights = {lights.data(), lights.size()};
    return v;
  }
  [[nodiscard]] SceneMesh mesh() const {
    SceneMesh m;
    m.mesh = {{vertices.data(), vertices.size()}, {faces.data(), faces.size()}};
    m.vertex_pixel = {pixels.data(), pixels.size()};
    m.background_faces = background_faces;
    m.sheet_faces = sheet_faces;
    m.object = object.view();
    return m;
  }
  [[nodiscard]] std::vector<std::uint16_t> marks() {
    // mark_faces() asks for the shape of the picture.
    io::Image<float> depth(shape, 5.0F);
    io::Image<Rgb8> image(shape);
    SceneView v = view();
    v.depth = depth.view();
    v.image = image.view();
    std::vector<std::uint16_t> out(faces.size(), 99);
    npsim_test::Scratch memory(mark_faces_workspace_bytes(v.shape(), v.lights.size(), emitters.size()));
    Workspace& workspace = memory.workspace();
    REQUIRE(mark_faces(v, mesh(), {emitters.data(), emitters.size()}, {out.data(), out.size()}, workspace).ok());
    CHECK(workspace.used() == 0);
    return out;
  }
};

}  // namespace

TEST_CASE("lamp faces: the mark of any corner's pixel counts, so a lamp of one pixel is not walled in") {
  Scene s;
  s.lamp(LightClass::street_light_ht, {3, 1, 5}, 0.2F);
  s.light_index(3, 1) = 1;
  s.face(3, 1);  // first corner
  s.face(2, 1);  // second
  s.face(3, 0);  // third
  s.face(4, 1);  // none
  s.background_faces = s.sheet_faces = s.faces.size();
  CHECK(s.marks() == std::vector<std::uint16_t>{1, 1, 1, 0});
  s.light_index(3, 1) = 0;
  CHECK(s.marks() == std::vector<std::uint16_t>(4, 0));
}

TEST_CASE("lamp faces: the mark of a group names no lamp") {
  Scene s;
  s.lamp(LightClass::car_group, {3, 1, 5}, 0.2F);
  REQUIRE(is_group(LightClass::car_group));
  s.light_index(3, 1) = 1;
  s.face(3, 1);
  s.background_faces = s.sheet_faces = s.faces.size();
  CHECK(s.marks() == std::vector<std::uint16_t>{0});
}

TEST_CASE("lamp faces: without marks or lamps no face is part of any") {
  Scene s;
  s.face(3, 1);
  s.background_faces = s.sheet_faces = s.faces.size();
  CHECK(s.marks() == std::vector<std::uint16_t>{0});
}

TEST_CASE(
    "lamp faces: on a solid object the housing within the lamp's reach, not that of another object, nor a shell's") {
  Scene s;
  s.lamp(LightClass::street_light_ht, {2.3F, 1.3F, 5}, 1.0F);  // reach: sqrt(2) m
  s.light_index(2, 1) = 1;
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 8; ++x) s.object(x, y) = x < 7 ? 1 : 2;
  }
  s.background_faces = 1;
  s.face(3, 1);      // background, however near
  s.face(3, 1);      // centre 1 m from the lamp
  s.face(4, 1);      // 2 m
  s.face(7 - 8, 2);  // corners (7, 1), (0, 2), (7, 2): the first is of the other object
  s.sheet_faces = s.faces.size() - 1;
  CHECK(s.marks() == std::vector<std::uint16_t>{0, 1, 0, 0});
  s.sheet_faces = s.faces.size();  // no backs: a shell
  CHECK(s.marks() == std::vector<std::uint16_t>{0, 0, 0, 0});
}

TEST_CASE("lamp faces: of two lamps in reach the first, and marks go before reach") {
  Scene s;
  s.lamp(LightClass::street_light_ht, {3, 1, 5}, 2.0F);
  s.lamp(LightClass::street_light_ht, {4, 1, 5}, 2.0F);
  s.light_index(1, 1) = 1;
  s.light_index(5, 1) = 2;
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 8; ++x) s.object(x, y) = 1;
  }
  s.face(3, 1);  // within reach of both
  s.face(5, 1);  // a corner on the second's pixel
  s.sheet_faces = 1;
  CHECK(s.marks() == std::vector<std::uint16_t>{1, 2});
}

TEST_CASE("lamp faces: of implicit faces and of the same faces indexed alike") {
  Scene s;
  s.lamp(LightClass::street_light_ht, {3, 1, 5}, 0.2F);
  s.light_index(3, 1) = 1;
  io::Image<Vec3f> vertices(s.shape);
  io::Image<std::uint8_t> quads(quad_shape(s.shape));
  io::Image<Vec3f> no_vertices(s.shape);
  io::Image<std::uint8_t> no_quads(quad_shape(s.shape));
  for (int y = 0; y < s.shape.height; ++y) {
    for (int x = 0; x < s.shape.width; ++x) vertices(x, y) = s.vertices[s.at(x, y)];
  }
  for (int y = 0; y < s.shape.height - 1; ++y) {
    for (int x = 0; x < s.shape.width - 1; ++x) {
      const bool anti = (x + y) % 2 == 0;
      quads(x, y) = static_cast<std::uint8_t>(kQuadUpperFace | kQuadLowerFace | (anti ? kQuadAntiDiagonal : 0));
      for (const bool upper : {true, false}) {
        s.faces.push_back(quad_face(anti, upper, s.at(x, y), s.at(x + 1, y), s.at(x, y + 1), s.at(x + 1, y + 1)));
      }
    }
  }
  s.background_faces = s.sheet_faces = s.faces.size();
  SceneMesh mesh = s.mesh();
  mesh.background = {vertices.view(), quads.view()};
  mesh.foreground = {no_vertices.view(), no_quads.view()};
  io::Image<float> depth(s.shape, 5.0F);
  io::Image<Rgb8> image(s.shape);
  SceneView view = s.view();
  view.depth = depth.view();
  view.image = image.view();
  const std::size_t layer = 2 * quad_shape(s.shape).pixels();
  std::vector<std::uint16_t> marks(2 * layer, 99);
  npsim_test::Scratch memory(mark_faces_workspace_bytes(view.shape(), view.lights.size(), s.emitters.size()));
  Workspace& workspace = memory.workspace();
  REQUIRE(mark_lamp_faces(
              view, mesh, {s.emitters.data(), 1}, [&mesh](const auto& f) { for_layer_faces(mesh, f); },
              {marks.data(), marks.size()}, workspace)
              .ok());
  const std::vector<std::uint16_t> indexed = s.marks();
  CHECK(std::vector<std::uint16_t>(marks.begin(), marks.begin() + static_cast<std::ptrdiff_t>(layer)) == indexed);
  CHECK(std::count(indexed.begin(), indexed.end(), 1) == 4);
  CHECK(std::count(marks.begin() + static_cast<std::ptrdiff_t>(layer), marks.end(), 0) ==
        static_cast<std::ptrdiff_t>(layer));
}

TEST_CASE(
    "lamp faces: the mast below a street lamp is its own, what stands beside it or above and masts of signals are "
    "not") {
  Scene s;
  s.lamp(LightClass::street_light_ht, {2.75F, 0.3F, 5}, 0.1F);  // .42 and .58 m beside the faces' middles
  s.emitters[0].axis = {0, 1, 0};                               // down
  s.emitters[0].profile = EmissionProfile::lantern;
  s.light_index(0, 0) = 1;
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 8; ++x) s.object(x, y) = 1;
  }
  s.face(2, 2);  // 2 m straight down
  s.face(3, 2);  // as deep, a metre beside it
  s.sheet_faces = s.faces.size();
  s.vertices.push_back({0, 0, 0});  // a back: the mesh has solids
  s.pixels.push_back(0);
  s.faces.push_back({s.at(7, 3), s.at(7, 3), s.at(7, 3)});
  CHECK(s.marks() == std::vector<std::uint16_t>{1, 0, 0});
  s.emitters[0].axis = {0, -1, 0};
  CHECK(s.marks() == std::vector<std::uint16_t>{0, 0, 0});
  s.emitters[0].axis = {0, 1, 0};
  s.emitters[0].profile = EmissionProfile::signal;
  CHECK(s.marks() == std::vector<std::uint16_t>{0, 0, 0});
}
