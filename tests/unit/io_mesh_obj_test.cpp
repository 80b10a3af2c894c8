// SPDX-License-Identifier: Apache-2.0
#include "npsim/io/obj.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>

#include "io_fixture.hpp"
#include "npsim/core/random.hpp"

// An independent reader, where it is installed. Local to this file, whoever else compiles it.
#if defined(__has_include)
#if __has_include(<tiny_obj_loader.h>)
#include <cassert>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>
namespace oracle {
namespace {
#define TINYOBJLOADER_IMPLEMENTATION
#include <tiny_obj_loader.h>
}  // namespace
}  // namespace oracle
#define NPSIM_TEST_HAS_TINYOBJ 1
#endif
#endif

using namespace io_test;
using namespace npsim;

namespace {

struct Sheet {
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  std::vector<Vec2f> uv;
  std::vector<Vec3f> colours;
  [[nodiscard]] TriangleMeshView view() const {
    return {{vertices.data(), vertices.size()}, {faces.data(), faces.size()}};
  }
};

Sheet random_sheet(std::uint32_t seed, float scale) {
  RandomStream random(11, RandomPurpose::test, seed, 0, 0, 0);
  Sheet s;
  for (int i = 0; i < 60; ++i) {
    s.vertices.push_back({random.uniform(-scale, scale), random.uniform(-scale, scale), scale * random.uniform()});
    s.uv.push_back({random.uniform(), random.uniform()});
    s.colours.push_back({random.uniform(), random.uniform(), random.uniform()});
  }
  for (int i = 0; i < 90; ++i)
    s.faces.push_back({random.next_u32() % 60, random.next_u32() % 60, random.next_u32() % 60});
  return s;
}

bool same(const std::vector<Face>& a, const std::vector<Face>& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), [](const Face& p, const Face& q) {
           return p.a == q.a && p.b == q.b && p.c == q.c;
         });
}

io::Expected<io::Mesh> read_text(const TemporaryFolder& folder, const std::string& text) {
  put(folder / "a.obj", text);
  return io::read_obj(folder / "a.obj");
}

const std::string kTriangle = "v 0 0 1\nv 1 0 1\nv 0 1 1\n";

}  // namespace

TEST_CASE("what is written as OBJ comes back bit by bit, at 1e-30 and at 1e5 m") {
  const TemporaryFolder folder;
  for (const float scale : {1e-30F, 1.0F, 1.0e5F, 1.0e38F}) {
    const Sheet s = random_sheet(1, scale);
    io::ObjOptions options;
    options.colours = {s.colours.data(), s.colours.size()};
    require_ok(io::write_obj(folder / "a.obj", s.view(), options));
    const io::Expected<io::Mesh> mesh = io::read_obj(folder / "a.obj");
    require_ok(mesh);
    CHECK(mesh.value().vertices == s.vertices);
    CHECK(mesh.value().colours == s.colours);
    CHECK(same(mesh.value().faces, s.faces));
  }
}

TEST_CASE("an OBJ with a photograph has its material file, upright texture and groups") {
  const TemporaryFolder folder;
  const Sheet s = random_sheet(2, 10.0F);
  io::ObjOptions options;
  options.uv = {s.uv.data(), s.uv.size()};
  options.texture = "day photo.png";
  options.groups = {{"background", 0}, {"foreground", 50}};
  require_ok(io::write_obj(folder / "mesh.obj", s.view(), options));
  CHECK(contents(folder / "mesh.mtl").find("map_Kd day photo.png\n") != std::string::npos);
  const std::string text = contents(folder / "mesh.obj");
  CHECK(text.find("mtllib mesh.mtl\n") != std::string::npos);
  const std::size_t second = text.find("o foreground\n");
  REQUIRE(second != std::string::npos);
  CHECK(std::count(text.begin() + static_cast<std::ptrdiff_t>(second), text.end(), 'f') == 40 + 1);
  CHECK(folder.files() == 2);
  require_ok(io::read_obj(folder / "mesh.obj"));
#ifdef NPSIM_TEST_HAS_TINYOBJ
  oracle::tinyobj::attrib_t attributes;
  std::vector<oracle::tinyobj::shape_t> shapes;
  std::vector<oracle::tinyobj::material_t> materials;
  std::string warning;
  std::string error;
  REQUIRE(oracle::tinyobj::LoadObj(&attributes, &shapes, &materials, &warning, &error, (folder / "mesh.obj").c_str(),
                                   (folder.path() + "/").c_str()));
  CHECK(error.empty());
  REQUIRE(materials.size() == 1);
  CHECK(materials[0].diffuse_texname == "day photo.png");
  REQUIRE(shapes.size() == 2);
  CHECK(shapes[1].name == "foreground");
  CHECK(shapes[1].mesh.indices.size() == 120);
  for (std::size_t i = 0; i < s.uv.size(); ++i) {
    CHECK(attributes.texcoords[2 * i] == s.uv[i].x);
    CHECK(attributes.texcoords[2 * i + 1] == 1.0F - s.uv[i].y);
  }
#endif
}

#ifdef NPSIM_TEST_HAS_TINYOBJ
TEST_CASE("random triangles and numbers read as tinyobjloader reads them") {
  const TemporaryFolder folder;
  for (std::uint32_t trial = 0; trial < 100; ++trial) {
    RandomStream random(12, RandomPurpose::test, trial, 0, 0, 0);
    std::string text;
    for (int i = 0; i < 20; ++i) {
      text += i % 3 == 0 ? "v  " : "v\t";
      for (int k = 0; k < 3; ++k) {
        char number[64];
        const char* const formats[] = {"%.3f ", "%+.7f ", "%.9g ", "%.2e ", "%.0f "};
        std::snprintf(number, sizeof number, formats[random.next_u32() % 5],
                      static_cast<double>(random.uniform(-1000.0F, 1000.0F)));
        text += number;
      }
      text += i % 2 == 0 ? "\r\n" : "\n";
    }
    text += "vt 0 0\nvn 0 0 1\ng x\ns off\n# f 1 2\n";
    for (int i = 0; i < 20; ++i) {
      const auto corner = [&random] {
        const auto v = static_cast<int>(random.next_u32() % 20);
        const std::string number = std::to_string(random.uniform() < 0.5F ? v + 1 : v - 20);
        const char* const endings[] = {"", "/1", "//1", "/1/1", "/-1/-1"};
        return " " + number + endings[random.next_u32() % 5];
      };
      text += "f" + corner() + corner() + corner() + (i % 4 == 0 ? "  \n" : "\n");
    }
    const io::Expected<io::Mesh> mesh = read_text(folder, text);
    require_ok(mesh);
    std::istringstream stream(text);
    oracle::tinyobj::attrib_t attributes;
    std::vector<oracle::tinyobj::shape_t> shapes;
    std::string warning;
    std::string error;
    REQUIRE(oracle::tinyobj::LoadObj(&attributes, &shapes, nullptr, &warning, &error, &stream, nullptr, false));
    REQUIRE(attributes.vertices.size() == 60);
    for (std::size_t i = 0; i < 20; ++i) {
      const Vec3f v = mesh.value().vertices[i];
      for (const auto& [ours, theirs] :
           {std::pair{v.x, attributes.vertices[3 * i]}, std::pair{v.y, attributes.vertices[3 * i + 1]},
            std::pair{v.z, attributes.vertices[3 * i + 2]}}) {
        CHECK(std::fabs(ours - theirs) <= 0x1p-23F * std::fabs(ours));  // theirs may be the next float
      }
    }
    std::vector<Face> faces;
    for (const auto& shape : shapes) {
      for (std::size_t i = 0; i + 2 < shape.mesh.indices.size(); i += 3) {
        faces.push_back({static_cast<std::uint32_t>(shape.mesh.indices[i].vertex_index),
                         static_cast<std::uint32_t>(shape.mesh.indices[i + 1].vertex_index),
                         static_cast<std::uint32_t>(shape.mesh.indices[i + 2].vertex_index)});
      }
    }
    CHECK(same(mesh.value().faces, faces));
  }
}
#endif

TEST_CASE("polygons are cut into triangles that cover them, concave ones too") {
  const TemporaryFolder folder;
  const std::string arrow = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 1 1 0\nv 0 4 0\nf ";
  for (const std::string order : {"1 2 3 4 5", "3 4 5 1 2", "5 4 3 2 1", "4 5 1 2 3"}) {
    const io::Expected<io::Mesh> mesh = read_text(folder, arrow + order + "\n");
    require_ok(mesh);
    REQUIRE(mesh.value().faces.size() == 3);
    float area = 0;
    const float sign = order[0] == '5' ? -1.0F : 1.0F;
    for (const Face& f : mesh.value().faces) {
      const std::vector<Vec3f>& v = mesh.value().vertices;
      const float z = cross(v[f.b] - v[f.a], v[f.c] - v[f.a]).z;
      CHECK(z * sign > 0);
      area += z * sign;
    }
    CHECK(area == 20.0F);  // twice the polygon's, by the shoelace formula
  }
  std::string circle;
  std::string face = "f";
  for (int i = 0; i < 200; ++i) {
    circle += "v 3 " + std::to_string(std::cos(0.0314159 * i)) + " " + std::to_string(std::sin(0.0314159 * i)) + "\n";
    face += " " + std::to_string(i + 1);
  }
  const io::Expected<io::Mesh> mesh = read_text(folder, circle + face);
  require_ok(mesh);
  CHECK(mesh.value().faces.size() == 198);
  require_ok(read_text(folder, kTriangle + "f 1 1 1 1 1\n"));  // no area at all
  require_ok(read_text(folder, arrow + "1 3 2 4\n"));          // crosses itself
}

TEST_CASE("an OBJ that lies about an index or a number is refused with its line") {
  const TemporaryFolder folder;
  struct Bad {
    const char* text;
    const char* line;
  };
  const Bad bad[] = {
      {"f 0 1 2\n", "line 4"},           // index 0
      {"f 1 2 4\n", "line 4"},           // out of range
      {"f -1 -2 -4\n", "line 4"},        // negative out of range
      {"f 1 2 4294967297\n", "line 4"},  // wraps to 1 in 32 bits
      {"f 1 2 99999999999999999999999\n", "line 4"},
      {"f 1 2 -9223372036854775808\n", "line 4"},
      {"f 1 2 3x\n", "line 4"},
      {"f 1 2 3.0\n", "line 4"},
      {"f 1/1 2/1 3/1\n", "line 4"},     // no vt above
      {"f 1//1 2//1 3//1\n", "line 4"},  // no vn above
      {"f 1/ 2/ 3//\n", "line 4"},
      {"f 1 2\n", "line 4"},  // truncated face
      {"f\n", "line 4"},
      {"f 1 2 4\nv 0 0 0\n", "line 4"},  // names what comes later
      {"v nan 0 1\n", "line 4"},
      {"v 0 inf 1\n", "line 4"},
      {"v 0 -infinity 1\n", "line 4"},
      {"v 1e39 0 1\n", "line 4"},  // no float
      {"v 0 0\n", "line 4"},       // truncated vertex
      {"v 0 0 1e", "line 4"},
      {"v 0 0 0x10\n", "line 4"},
      {"v 1,5 0 0\n", "line 4"},
      {"v 1 2 3 4 5\n", "line 4"},
      {"v 1 2 3 4 5 6 7 8\n", "line 4"},
      {"v\n", "line 4"},
      {"vn 0 nan 1\n", "line 4"},
      {"vt nan\n", "line 4"},
      {"vt\n", "line 4"},
  };
  for (const Bad& b : bad) {
    INFO(b.text);
    check_error(read_text(folder, kTriangle + b.text), "a.obj", b.line);
  }
  check_error(read_text(folder, ""), "a.obj");
  check_error(read_text(folder, "f 1 2 3\n"), "a.obj");
  check_error(read_text(folder, "o nothing\n"), "a.obj", "no vertex");
  check_error(io::read_obj(folder / "absent.obj"), "absent.obj");
  check_error(io::read_obj(folder.path()), folder.path());
  std::string polygon = kTriangle + "f";
  for (int i = 0; i < 1025; ++i) polygon += " 1";
  check_error(read_text(folder, polygon), "a.obj", "1024");
}

TEST_CASE("an OBJ larger than the limit is refused before it is read") {
  const TemporaryFolder folder;
  put(folder / "a.obj", kTriangle);
  io::ReadLimits limits;
  limits.max_bytes = kTriangle.size();
  require_ok(io::read_obj(folder / "a.obj", limits));
  limits.max_bytes -= 1;
  check_error(io::read_obj(folder / "a.obj", limits), "a.obj");
}

TEST_CASE("valid but unusual OBJ is read: weights, colours, comments, other elements, no end of line") {
  const TemporaryFolder folder;
  const io::Expected<io::Mesh> mesh = read_text(
      folder,
      "\xEF\xBB\xBF# byte order mark\n  v +1 2. .5 1.0\nv 1 0 0 # note\nv 0 1e-50 0\nvp 1\nl 1 2\nf -3 -2 -1 #");
  require_ok(mesh);
  REQUIRE(mesh.value().vertices.size() == 3);
  CHECK(mesh.value().vertices[0] == Vec3f{1, 2, 0.5F});
  CHECK(mesh.value().faces.size() == 1);
  CHECK(mesh.value().colours.empty());
  const io::Expected<io::Mesh> coloured = read_text(folder, "v 1 2 3 .1 .2 .3\nv 1 2 3 1 .4 .5 .6\n");
  require_ok(coloured);
  REQUIRE(coloured.value().colours.size() == 2);
  CHECK(coloured.value().colours[1] == Vec3f{0.4F, 0.5F, 0.6F});
  CHECK(read_text(folder, "v 1 2 3 .1 .2 .3\nv 1 2 3\n").value().colours.empty());
}

TEST_CASE("random bytes and cut files never crash the OBJ reader, and give only valid indices") {
  const TemporaryFolder folder;
  const Sheet s = random_sheet(3, 5.0F);
  io::ObjOptions options;
  options.uv = {s.uv.data(), s.uv.size()};
  require_ok(io::write_obj(folder / "whole.obj", s.view(), options));
  const std::string whole = contents(folder / "whole.obj");
  for (std::uint32_t trial = 0; trial < 300; ++trial) {
    RandomStream random(13, RandomPurpose::test, trial, 0, 0, 0);
    std::string text = whole.substr(0, random.next_u32() % whole.size());
    for (int i = 0; i < 5 && !text.empty(); ++i) {
      const char alphabet[] = "0123456789 -/.\nvft#e\0";
      text[random.next_u32() % text.size()] = alphabet[random.next_u32() % (sizeof alphabet - 1)];
    }
    const io::Expected<io::Mesh> mesh = read_text(folder, text);
    if (!mesh) {
      CHECK(mesh.error().line().find("a.obj") != std::string::npos);
      continue;
    }
    for (const Face& f : mesh.value().faces) CHECK(std::max({f.a, f.b, f.c}) < mesh.value().vertices.size());
    for (const Vec3f& v : mesh.value().vertices) CHECK(is_finite(v));
  }
}

TEST_CASE("meshes that make no sense are not written") {
  const TemporaryFolder folder;
  Sheet s = random_sheet(4, 1.0F);
  io::ObjOptions options;
  options.uv = {s.uv.data(), 10};
  check_error(io::write_obj(folder / "a.obj", s.view(), options), "a.obj", "uv");
  options.uv = {};
  options.texture = "day.png";
  check_error(io::write_obj(folder / "a.obj", s.view(), options), "a.obj", "texture");
  options.texture.clear();
  options.groups = {{"two\nlines", 0}};
  check_error(io::write_obj(folder / "a.obj", s.view(), options), "a.obj", "names");
  s.faces[7].b = 60;
  check_error(io::write_obj(folder / "a.obj", s.view()), "a.obj", "face 7");
  s.faces[7].b = 0;
  s.vertices[3].y = std::numeric_limits<float>::quiet_NaN();
  check_error(io::write_obj(folder / "a.obj", s.view()), "a.obj", "vertex 3");
  CHECK(folder.files() == 0);
  check_error(io::write_obj(folder / "no/such/folder/a.obj", random_sheet(4, 1.0F).view()), "a.obj");
}
