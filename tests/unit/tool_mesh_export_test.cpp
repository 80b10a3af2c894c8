// SPDX-License-Identifier: Apache-2.0
#include "tool/mesh_export.hpp"

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "io_fixture.hpp"
#include "npsim/io/obj.hpp"

using namespace io_test;
using namespace npsim;
using namespace npsim::tool;

namespace {

constexpr Shape kShape{4, 2};

// Two background faces on the left, an object of two faces on the right, another of one below it, and a vertex of each
// layer that no face has.
struct TwoObjects {
  std::vector<Vec3f> vertices = {{0, 0, 9}, {1, 0, 9}, {0, 1, 9}, {1, 1, 9}, {7, 7, 9},
                                 {2, 0, 5}, {3, 0, 5}, {2, 1, 5}, {3, 1, 5}, {8, 8, 5}};
  std::vector<Vec3f> normals = std::vector<Vec3f>(10, Vec3f{0, 0, -1});
  std::vector<std::uint32_t> pixels = {0, 1, 4, 5, 2, 2, 3, 6, 7, 0};
  std::vector<Face> faces = {{0, 3, 1}, {0, 2, 3}, {5, 8, 6}, {5, 7, 8}};
  io::Image<Label> labels{kShape, label::road};
  io::Image<std::uint32_t> object{kShape, 0};
  TwoObjects() {
    for (int y = 0; y < 2; ++y) {
      for (int x = 2; x < 4; ++x) object(x, y) = 3;
    }
    labels(3, 1) = label::traffic_sign;  // the other pixels only lend themselves to the sign
  }
  [[nodiscard]] LayeredMesh mesh() const {
    return {{vertices.data(), 10}, {normals.data(), 10}, {pixels.data(), 10}, {faces.data(), 4}, 2};
  }
};

Emitter lamp(LightClass cls, std::uint16_t mark, SignalState state = SignalState::unknown) {
  Emitter e;
  e.centre_m = {0, 0, 5};
  e.half_u_m = {1, 0, 0};
  e.half_v_m = {0, 1, 0};
  e.cls = cls;
  e.mark = mark;
  e.state = state;
  return e;
}

}  // namespace

TEST_CASE("a layered mesh in parts: background and objects by name, without vertices that no face has") {
  const TwoObjects scene;
  const MeshPart background = background_part(scene.mesh(), 0);
  CHECK(background.vertices.size() == 4);
  CHECK(background.faces.size() == 2);
  const std::vector<MeshPart> objects = object_parts(scene.mesh(), scene.labels.view(), scene.object.view(), 1);
  REQUIRE(objects.size() == 1);
  CHECK(objects[0].name == "traffic_sign_3");
  CHECK(objects[0].vertices.size() == 4);
  CHECK(objects[0].pixels == std::vector<std::uint32_t>{2, 3, 6, 7});
  CHECK(objects[0].faces[1].b == 2);
  CHECK(objects[0].vertices[objects[0].faces[1].b] == Vec3f{2, 1, 5});
  CHECK(object_parts(scene.mesh(), {}, scene.object.view(), 1)[0].name == "object_3");
}

TEST_CASE("emitters are parts by class and mark, those of one class and state share a material, and face the camera") {
  LightMark marks[3];
  marks[0].id = 40;
  marks[1].id = 7;
  marks[2].id = 9;
  const Emitter emitters[] = {lamp(LightClass::inferred_object, 1), lamp(LightClass::moving_rear, 2),
                              lamp(LightClass::none, 0), lamp(LightClass::moving_rear, 3)};
  const std::vector<MeshPart> parts = emitter_parts({emitters, 4}, {marks, 3});
  REQUIRE(parts.size() == 4);
  CHECK(parts[0].name == "inferred_object_40");
  CHECK(parts[1].name == "moving_rear_7");
  CHECK(parts[2].name == "moving_rear_9");
  CHECK(parts[3].name == "own_headlamp_1");
  CHECK(parts[1].material == parts[2].material);
  CHECK(parts[0].material == "emitter_inferred_object");
  CHECK(parts[1].emissive.x > parts[1].emissive.z);
  for (const MeshPart& part : parts) {
    CHECK(part.texture == kNoTexture);
    CHECK(part.normals[0] == Vec3f{0, 0, -1});
    for (const Face& f : part.faces) {
      CHECK(cross(part.vertices[f.b] - part.vertices[f.a], part.vertices[f.c] - part.vertices[f.a]).z < 0);
    }
  }
  const Emitter green = lamp(LightClass::traffic_light_group, 1, SignalState::green);
  CHECK(emitter_parts({&green, 1}, {marks, 3})[0].material == "emitter_traffic_light_group_green");
}

TEST_CASE("GLB, OBJ and PLY of one list of parts hold the same parts, textures and triangles") {
  const TemporaryFolder folder;
  const TwoObjects scene;
  std::vector<MeshPart> parts = {background_part(scene.mesh(), kBackgroundTexture)};
  parts.push_back(object_parts(scene.mesh(), scene.labels.view(), scene.object.view(), kObjectsTexture)[0]);
  const Emitter e = lamp(LightClass::street_light_ht, 0);
  parts.push_back(emitter_parts({&e, 1}, {})[0]);
  MeshTextures textures;
  textures.background = {"background", "background.png", io::Image<Rgb8>(kShape, Rgb8{10, 20, 30}), {}};
  textures.objects = {"photograph", "day.png", io::Image<Rgb8>(kShape, Rgb8{200, 100, 50}), {}};
  ThreadPool pool(2);
  require_ok(write_texture(folder.path(), textures.background));
  require_ok(write_texture(folder.path(), textures.objects));
  require_ok(write_parts(folder / "mesh", {parts.data(), 3}, textures, pool));
  CHECK(folder.files() == 6);

  const io::Expected<io::Mesh> obj = io::read_obj(folder / "mesh.obj");
  require_ok(obj);
  CHECK(obj.value().faces.size() == 6);
  CHECK(obj.value().vertices.size() == 12);
  CHECK(obj.value().vertices[2] == Vec3f{0, -1, -9});
  const std::string text = contents(folder / "mesh.obj");
  CHECK(text.find("o background\nusemtl background\n") != std::string::npos);
  CHECK(text.find("o traffic_sign_3\nusemtl objects\n") != std::string::npos);
  CHECK(text.find("o own_headlamp_1\nusemtl emitter_own_headlamp\n") != std::string::npos);
  const std::string materials = contents(folder / "mesh.mtl");
  CHECK(materials.find("newmtl objects\nKd 1 1 1\nillum 1\nmap_Kd day.png\n") != std::string::npos);
  CHECK(materials.find("Ke 1") != std::string::npos);

  const std::string glb = contents(folder / "mesh.glb");
  const std::size_t begin = glb.find('{');
  const std::size_t end = glb.find(std::string("BIN\0", 4)) - 4;
  const nlohmann::json document = nlohmann::json::parse(glb.substr(begin, end - begin));
  REQUIRE(document["nodes"].size() == 3);
  CHECK(document["nodes"][1]["name"] == "traffic_sign_3");
  CHECK(document["images"].size() == 2);
  CHECK(document["materials"][2]["emissiveFactor"][0] == 1.0);

  const std::string ply = contents(folder / "mesh.ply");
  CHECK(ply.find("element vertex 12\n") != std::string::npos);
  CHECK(ply.find("element face 6\n") != std::string::npos);
  const std::size_t colour = ply.find("end_header\n") + 11 + 4 * 27 + 24;  // of the fifth vertex, the object's first
  CHECK(static_cast<unsigned char>(ply[colour]) == 200);

  require_ok(write_parts(folder / "background", {parts.data(), 1}, textures, pool));  // one texture is enough
  CHECK(contents(folder / "background.glb").find("photograph") == std::string::npos);
}

TEST_CASE("where objects hide the background its texture is that beside them, in linear light") {
  io::Image<Rgb8> photograph({3, 1}, Rgb8{0, 0, 0});
  photograph(0, 0) = {255, 0, 0};
  photograph(1, 0) = {1, 2, 3};
  io::Image<std::uint32_t> visible({3, 1}, 0);
  visible(1, 0) = 5;  // of an object
  io::Image<std::uint8_t> state({3, 1}, row_state::known);
  state(1, 0) = row_state::missing;
  SceneMesh mesh;
  mesh.background_vertices = 3;
  mesh.visible_vertex = visible.view();
  mesh.background_state = state.view();
  const io::Image<Rgb8> bare = without_objects(photograph, mesh);
  CHECK(bare(0, 0).r == 255);
  CHECK(bare(1, 0).r == 188);  // the code of half the light
  CHECK(bare(1, 0).g == 0);
}
