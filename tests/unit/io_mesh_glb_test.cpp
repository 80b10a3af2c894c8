// SPDX-License-Identifier: Apache-2.0
#include "npsim/io/glb.hpp"

#include <algorithm>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "io_fixture.hpp"

using namespace io_test;
using namespace npsim;

namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// A GLB taken apart again, each chunk checked on the way.
struct Glb {
  explicit Glb(const std::string& bytes) {
    REQUIRE(bytes.size() > 28);
    REQUIRE(bytes.substr(0, 4) == "glTF");
    CHECK(word(bytes, 4) == 2);
    CHECK(word(bytes, 8) == bytes.size());
    const std::size_t length = word(bytes, 12);
    CHECK(length % 4 == 0);
    CHECK(bytes.substr(16, 4) == "JSON");
    document = nlohmann::json::parse(bytes.substr(20, length));
    const std::size_t at = 20 + length;
    CHECK(bytes.substr(at + 4, 4) == std::string("BIN\0", 4));
    CHECK(word(bytes, at) % 4 == 0);
    REQUIRE(bytes.size() == at + 8 + word(bytes, at));
    binary = bytes.substr(at + 8);
  }
  static std::uint32_t word(const std::string& bytes, std::size_t at) {
    std::uint32_t value = 0;
    REQUIRE(at + 4 <= bytes.size());
    std::memcpy(&value, bytes.data() + at, 4);
    return value;
  }
  template <class T>
  std::vector<T> data(std::size_t accessor) const {
    const nlohmann::json& a = document["accessors"][accessor];
    const nlohmann::json& view = document["bufferViews"][a["bufferView"].get<std::size_t>()];
    const std::size_t offset = view["byteOffset"].get<std::size_t>();
    const std::size_t components = a["type"] == "VEC3" ? 3 : (a["type"] == "VEC2" ? 2 : 1);
    CHECK(offset % 4 == 0);
    CHECK(view["byteLength"].get<std::size_t>() == a["count"].get<std::size_t>() * components * 4);
    std::vector<T> values(view["byteLength"].get<std::size_t>() / sizeof(T));
    std::memcpy(values.data(), binary.data() + offset, values.size() * sizeof(T));
    return values;
  }
  [[nodiscard]] const nlohmann::json& primitive(std::size_t mesh) const { return document["meshes"][mesh]["primitives"][0]; }
  nlohmann::json document;
  std::string binary;
};

const std::vector<Vec3f> kVertices = {{0, -1.5F, 10.1F}, {1, 0, 2}, {0, 1, 3}, {0.1F, 1, 3.7F}};
const std::vector<Face> kFaces = {{0, 2, 1}, {1, 2, 3}};
const TriangleMeshView kMesh{{kVertices.data(), 4}, {kFaces.data(), 2}};
const unsigned char kPng[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n', 1, 2, 3};

}  // namespace

TEST_CASE("a GLB holds every primitive with y up, its front where it was, and exact bounds") {
  const TemporaryFolder folder;
  const std::vector<std::uint32_t> pixels = {0, 1, 6, 7};
  const std::vector<Vec2f> uv = io::photograph_uv({pixels.data(), 4}, {6, 4});
  CHECK(uv[3].x == 1.5F / 6.0F);
  CHECK(uv[3].y == 1.5F / 4.0F);
  const std::vector<Vec3f> normals(4, Vec3f{0, 3, -4});
  std::vector<io::GlbPrimitive> primitives(3);
  primitives[0].name = "background \"\xFF\"";  // a name that is no UTF-8
  primitives[0].mesh = kMesh;
  primitives[0].uv = {uv.data(), 4};
  primitives[1].name = "nothing in front";  // no face: left out
  primitives[2].name = "lamp";
  primitives[2].mesh = kMesh;
  primitives[2].normals = {normals.data(), 4};
  primitives[2].emissive = {1.0F, 0.5F, 0.25F};
  primitives[2].double_sided = false;
  const io::GlbTexture photograph{"photograph", {kPng, sizeof kPng}};
  require_ok(io::write_glb(folder / "a.glb", {primitives.data(), 3}, {&photograph, 1}));
  const Glb glb(contents(folder / "a.glb"));
  REQUIRE(glb.document["meshes"].size() == 2);
  CHECK(glb.document["nodes"].size() == 2);
  CHECK(glb.document["scenes"][0]["nodes"] == nlohmann::json({0, 1}));
  CHECK(glb.document["asset"]["version"] == "2.0");
  CHECK(glb.document.count("extensionsUsed") == 0);

  const nlohmann::json& attributes = glb.primitive(0)["attributes"];
  const std::size_t position = attributes["POSITION"].get<std::size_t>();
  const std::vector<float> positions = glb.data<float>(position);
  REQUIRE(positions.size() == 12);
  for (std::size_t i = 0; i < 4; ++i) {
    CHECK(positions[3 * i] == kVertices[i].x);
    CHECK(positions[3 * i + 1] == -kVertices[i].y);
    CHECK(positions[3 * i + 2] == -kVertices[i].z);
  }
  const nlohmann::json& accessor = glb.document["accessors"][position];
  CHECK(accessor["min"] == nlohmann::json({0.0, -1.0, static_cast<double>(-10.1F)}));
  CHECK(accessor["max"] == nlohmann::json({1.0, 1.5, -2.0}));
  CHECK(glb.data<float>(attributes["TEXCOORD_0"].get<std::size_t>())[7] == uv[3].y);
  CHECK(glb.data<std::uint32_t>(glb.primitive(0)["indices"].get<std::size_t>()) ==
        std::vector<std::uint32_t>{0, 2, 1, 1, 2, 3});
  CHECK(glb.document["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"] == 0);
  CHECK(glb.document["materials"][0]["doubleSided"] == true);
  CHECK(glb.document["images"][0]["mimeType"] == "image/png");
  const nlohmann::json& image = glb.document["bufferViews"][glb.document["images"][0]["bufferView"].get<std::size_t>()];
  CHECK(glb.binary.substr(image["byteOffset"].get<std::size_t>(), sizeof kPng) ==
        std::string(reinterpret_cast<const char*>(kPng), sizeof kPng));

  const std::vector<float> n = glb.data<float>(glb.primitive(1)["attributes"]["NORMAL"].get<std::size_t>());
  CHECK(n[1] == -0.6F);
  CHECK(n[2] == 0.8F);
  CHECK(glb.primitive(1)["attributes"].count("TEXCOORD_0") == 0);
  CHECK(glb.document["materials"][1]["emissiveFactor"] == nlohmann::json({1.0, 0.5, 0.25}));
  CHECK(glb.document["materials"][1].count("doubleSided") == 0);
}

TEST_CASE("without a photograph there is no texture, image or texture coordinate") {
  const TemporaryFolder folder;
  const std::vector<Vec2f> uv(4, Vec2f{0.5F, 0.5F});
  io::GlbPrimitive primitive;
  primitive.mesh = kMesh;
  primitive.uv = {uv.data(), 4};
  require_ok(io::write_glb(folder / "a.glb", {&primitive, 1}));
  const Glb glb(contents(folder / "a.glb"));
  for (const char* key : {"images", "textures", "samplers"}) CHECK(glb.document.count(key) == 0);
  CHECK(glb.primitive(0)["attributes"].size() == 1);
}

TEST_CASE("what no viewer could show is refused, and nothing is left behind") {
  const TemporaryFolder folder;
  const std::string path = folder / "a.glb";
  const std::vector<Face> bad = {{0, 1, 4}};
  const std::vector<Vec3f> zero_normal(4, Vec3f{});
  const std::vector<Vec2f> nan_uv(4, Vec2f{kNaN, 0});
  const std::vector<Vec3f> nan_vertex = {{0, 0, 1}, {0, kNaN, 1}, {1, 1, 1}, {2, 2, 2}};
  const unsigned char gif[] = {'G', 'I', 'F'};
  const auto write = [&](auto change, Span<const io::GlbTexture> textures = {}) {
    io::GlbPrimitive p;
    p.name = "thing";
    p.mesh = kMesh;
    change(p);
    return io::write_glb(path, {&p, 1}, textures);
  };
  check_error(write([](io::GlbPrimitive& p) { p.mesh = {}; }), "a.glb", "no face");
  check_error(write([&](io::GlbPrimitive& p) { p.mesh.faces = {bad.data(), 1}; }), "a.glb", "face 0");
  check_error(write([&](io::GlbPrimitive& p) { p.mesh.vertices = {nan_vertex.data(), 4}; }), "a.glb", "vertex 1");
  check_error(write([&](io::GlbPrimitive& p) { p.normals = {zero_normal.data(), 4}; }), "a.glb", "thing");
  check_error(write([&](io::GlbPrimitive& p) { p.normals = {zero_normal.data(), 3}; }), "a.glb", "normals");
  check_error(write([&](io::GlbPrimitive& p) { p.uv = {nan_uv.data(), 4}; }), "a.glb", "thing");
  check_error(write([&](io::GlbPrimitive& p) { p.emissive = {0, 2, 0}; }), "a.glb", "0..1");
  check_error(write([&](io::GlbPrimitive& p) { p.base_colour = {kNaN, 0, 0}; }), "a.glb", "0..1");
  check_error(write([&](io::GlbPrimitive& p) { p.roughness = -1; }), "a.glb", "0..1");
  const io::GlbTexture no_texture{"photograph", {gif, sizeof gif}};
  check_error(write([](io::GlbPrimitive&) {}, {&no_texture, 1}), "a.glb", "PNG");
  const io::GlbTexture only{"photograph", {kPng, sizeof kPng}};
  const std::vector<Vec2f> uv(4, Vec2f{0.5F, 0.5F});
  const auto with_second = [&](io::GlbPrimitive& p) {
    p.uv = {uv.data(), 4};
    p.texture = 1;
  };
  check_error(write(with_second, {&only, 1}), "a.glb", "texture that exists");
  CHECK(folder.files() == 0);
}

TEST_CASE("parts that agree in their material share it, each texture that is worn is there once") {
  const TemporaryFolder folder;
  const std::vector<Vec2f> uv(4, Vec2f{0.5F, 0.5F});
  const io::GlbTexture textures[3] = {{"photograph", {kPng, sizeof kPng}},
                                      {"nobody's", {kPng, sizeof kPng - 2}},
                                      {"background", {kPng, sizeof kPng - 1}}};
  std::vector<io::GlbPrimitive> parts(5);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    parts[i].name = "part " + std::to_string(i);
    parts[i].mesh = kMesh;
    parts[i].material = i < 3 ? "lamp" : "";
    if (i < 3) parts[i].emissive = {1, 1, 0};
  }
  parts[3].uv = parts[4].uv = {uv.data(), 4};
  parts[3].texture = 2;
  require_ok(io::write_glb(folder / "a.glb", {parts.data(), 5}, {textures, 3}));
  const Glb glb(contents(folder / "a.glb"));
  CHECK(glb.document["nodes"].size() == 5);
  REQUIRE(glb.document["materials"].size() == 3);
  for (std::size_t i = 0; i < 3; ++i) CHECK(glb.primitive(i)["material"] == 0);
  CHECK(glb.document["materials"][0]["name"] == "lamp");
  CHECK(glb.document["materials"][1]["name"] == "part 3");
  CHECK(glb.document["materials"][1]["pbrMetallicRoughness"]["baseColorTexture"]["index"] == 0);
  CHECK(glb.document["materials"][2]["pbrMetallicRoughness"]["baseColorTexture"]["index"] == 1);
  REQUIRE(glb.document["images"].size() == 2);
  CHECK(glb.document["images"][0]["name"] == "background");
  CHECK(glb.document["images"][1]["name"] == "photograph");
  CHECK(glb.document["textures"][1]["source"] == 1);
}
