// SPDX-License-Identifier: Apache-2.0
#include "npsim/io/obj.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <string>
#include <vector>

#include "fixture.hpp"
#include "io_fixture.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/mesh/check.hpp"

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

io::Expected<io::Mesh> read_obj_text(const TemporaryFolder& folder, const std::string& text) {
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
  options.materials = {{"photograph", {1, 1, 1}, {}, "day photo.png"}, {"lamp", {0, 0, 0}, {1, 0.5F, 0}, ""}};
  options.groups = {{"background", 0, 0}, {"foreground", 50, 1}};
  require_ok(io::write_obj(folder / "mesh.obj", s.view(), options));
  CHECK(contents(folder / "mesh.mtl").find("map_Kd day photo.png\n") != std::string::npos);
  const std::string text = contents(folder / "mesh.obj");
  CHECK(text.find("mtllib mesh.mtl\n") != std::string::npos);
  const std::size_t second = text.find("o foreground\n");
  REQUIRE(second != std::string::npos);
  CHECK(std::count(text.begin() + static_cast<std::ptrdiff_t>(second), text.end(), 'f') == 40 + 1);
  CHECK(folder.files() == 2);
  require_ok(io::read_obj(folder / "mesh.obj"));
  tinyobj::ObjReader reader;  // with the material file
  REQUIRE(reader.ParseFromFile(folder / "mesh.obj"));
  CHECK(reader.Error().empty());
  CHECK(reader.Warning().empty());
  REQUIRE(reader.GetMaterials().size() == 2);
  CHECK(reader.GetMaterials()[0].diffuse_texname == "day photo.png");
  CHECK(reader.GetMaterials()[1].diffuse_texname == "");
  CHECK(reader.GetMaterials()[1].emission[1] == 0.5F);
  CHECK(reader.GetMaterials()[1].diffuse[1] == 0.0F);
  REQUIRE(reader.GetShapes().size() == 2);
  CHECK(reader.GetShapes()[1].name == "foreground");
  CHECK(reader.GetShapes()[1].mesh.indices.size() == 120);
  CHECK(reader.GetShapes()[0].mesh.material_ids[49] == 0);
  CHECK(reader.GetShapes()[1].mesh.material_ids[0] == 1);
  for (std::size_t i = 0; i < s.uv.size(); ++i) {
    CHECK(reader.GetAttrib().texcoords[2 * i] == s.uv[i].x);
    CHECK(reader.GetAttrib().texcoords[2 * i + 1] == 1.0F - s.uv[i].y);
  }
}

TEST_CASE("an OBJ with y up is turned about x by half a turn, faces as they were") {
  const TemporaryFolder folder;
  const Sheet s = random_sheet(5, 10.0F);
  io::ObjOptions options;
  options.frame = io::MeshFrame::y_up;
  require_ok(io::write_obj(folder / "a.obj", s.view(), options));
  CHECK(contents(folder / "a.obj").find("x right, y up, z backward") != std::string::npos);
  const io::Expected<io::Mesh> mesh = io::read_obj(folder / "a.obj");
  require_ok(mesh);
  REQUIRE(mesh.value().vertices.size() == s.vertices.size());
  for (std::size_t i = 0; i < s.vertices.size(); ++i) {
    CHECK(mesh.value().vertices[i] == Vec3f{s.vertices[i].x, -s.vertices[i].y, -s.vertices[i].z});
  }
  CHECK(same(mesh.value().faces, s.faces));
}

TEST_CASE("random numbers and corners, in every notation, are read as they were meant") {
  const TemporaryFolder folder;
  for (std::uint32_t trial = 0; trial < 100; ++trial) {
    RandomStream random(12, RandomPurpose::test, trial, 0, 0, 0);
    std::string text;
    std::vector<float> numbers;
    for (int i = 0; i < 20; ++i) {
      text += i % 3 == 0 ? "v  " : "v\t";
      for (int k = 0; k < 3; ++k) {
        char number[64];
        const char* const formats[] = {"%.3f ", "%+.7f ", "%.9g ", "%.2e ", "%.0f ", "%.30f ", "%+.20E "};
        std::snprintf(number, sizeof number, formats[random.next_u32() % 7],
                      static_cast<double>(random.uniform(-1000.0F, 1000.0F)));
        numbers.push_back(std::strtof(number, nullptr));
        text += number;
      }
      text += i % 2 == 0 ? "\r\n" : "\n";
    }
    text += "vt 0 0\nvn 0 0 1\ng x\ns off\n# f 1 2\n";
    std::vector<std::uint32_t> corners;
    for (int i = 0; i < 60; ++i) {
      const auto v = static_cast<int>(random.next_u32() % 20);
      corners.push_back(static_cast<std::uint32_t>(v));
      const char* const endings[] = {"", "/1", "//1", "/1/1", "/-1/-1"};
      if (i % 3 == 0) text += "f";
      text += " " + std::to_string(random.uniform() < 0.5F ? v + 1 : v - 20) + endings[random.next_u32() % 5];
      if (i % 3 == 2) text += i % 4 == 0 ? "  \n" : "\n";
      if (i % 9 == 8) text += "usemtl none\no part\n";
    }
    const io::Expected<io::Mesh> mesh = read_obj_text(folder, text);
    require_ok(mesh);
    REQUIRE(mesh.value().vertices.size() == 20);
    for (std::size_t i = 0; i < 20; ++i) {
      const Vec3f v = mesh.value().vertices[i];
      CHECK(v == Vec3f{numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]});
    }
    std::vector<Face> faces;
    for (std::size_t i = 0; i < 60; i += 3) faces.push_back({corners[i], corners[i + 1], corners[i + 2]});
    CHECK(same(mesh.value().faces, faces));
  }
}

TEST_CASE("convex polygons are cut into triangles that cover them, wherever they are") {
  const TemporaryFolder folder;
  for (const int corners : {4, 5, 6, 17, 200}) {
    for (const double offset : {0.0, 5.0, -1000.0}) {
      for (const bool clockwise : {false, true}) {
        INFO(corners);
        INFO(offset);
        std::string text;
        std::string face = "f";
        for (int i = 0; i < corners; ++i) {
          const double turn = 6.283185307179586 * i / corners;
          text += "v 3 " + std::to_string(offset + 10 * std::cos(turn)) + " " +
                  std::to_string(offset + 10 * std::sin(turn)) + "\n";
          face += " " + std::to_string(clockwise ? corners - i : i + 1);
        }
        const io::Expected<io::Mesh> mesh = read_obj_text(folder, text + face);
        require_ok(mesh);
        REQUIRE(mesh.value().faces.size() == static_cast<std::size_t>(corners - 2));
        double area = 0;
        for (const Face& f : mesh.value().faces) {
          const std::vector<Vec3f>& v = mesh.value().vertices;
          const Vec3d ab = vec_cast<double>(v[f.b] - v[f.a]);
          const Vec3d ac = vec_cast<double>(v[f.c] - v[f.a]);
          const double twice = cross(ab, ac).x;
          CHECK((clockwise ? -twice : twice) > 0);
          area += std::fabs(twice) / 2;
        }
        // Coordinates are off by at most 2^-15 m and 1e-6 m, the area by that times the perimeter.
        CHECK(std::fabs(area - 50 * corners * std::sin(6.283185307179586 / corners)) < 63 * 0x1p-14);
      }
    }
  }
}

TEST_CASE("polygons that cannot be cut are refused, never silently incomplete: stars, crossed, without area") {
  const TemporaryFolder folder;
  std::string star;
  std::string face = "f";
  for (int i = 0; i < 64; ++i) {
    const double turn = 6.283185307179586 * i / 64;
    const double radius = i % 2 == 0 ? 1.0 : 0.3;
    star += "v " + std::to_string(10 + radius * std::cos(turn)) + " " + std::to_string(10 + radius * std::sin(turn)) +
            " 1\n";
    face += " " + std::to_string(i + 1);
  }
  struct Odd {
    std::string text;
    std::size_t triangles;
  };
  for (const Odd& odd : {Odd{star + face, 62}, Odd{kTriangle + "v 1 1 1\nf 1 2 3 4\n", 2},
                         Odd{kTriangle + "f 1 1 1 1 1\n", 3}, Odd{kTriangle + "f 1 2 3 1 2 3 1\n", 5}}) {
    const io::Expected<io::Mesh> mesh =
        read_obj_text(folder, odd.text);  // which it is differs by tinyobjloader's version
    if (mesh) {
      CHECK(mesh.value().faces.size() == odd.triangles);
    } else {
      check_error(mesh, "a.obj", "expected " + std::to_string(odd.triangles));
    }
  }
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
      {"f 1/ 2/ 3/\n", "line 4"},
      {"vn 0 0 1\nf 1//2 2//1 3//1\n", "line 5"},
      {"vt 0 0\nf 1/1 2/1 3/-2\n", "line 5"},
      {"f 1 2 3\rf 1 2 3\n", "line 4"},  // two lines for the parser
      {"f 1 2 3 \\\n1\n", "line 4"},
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
      {"v 1 2 3 1 .4 .5 .6\n", "line 4"},  // weight and colour: the parser would shift the colour
      {"v 1 2 3 4 5 6 7 8\n", "line 4"},
      {"v 1 2 +-3\n", "line 4"},
      {"v 1 2 .\n", "line 4"},
      {"v 1 2 -\n", "line 4"},
      {"v 3.4028236e38 0 1\n", "line 4"},  // rounds to infinity
      {"v\n", "line 4"},
      {"vn 0 nan 1\n", "line 4"},
      {"vt nan\n", "line 4"},
      {"vt\n", "line 4"},
  };
  for (const Bad& b : bad) {
    INFO(b.text);
    check_error(read_obj_text(folder, kTriangle + b.text), "a.obj", b.line);
  }
  check_error(read_obj_text(folder, ""), "a.obj");
  check_error(read_obj_text(folder, "f 1 2 3\n"), "a.obj");
  check_error(read_obj_text(folder, "o nothing\n"), "a.obj", "no vertex");
  check_error(read_obj_text(folder, std::string("v 0 0 1\0 2\n", 11)), "a.obj", "line 1");
  check_error(read_obj_text(folder, "v 0 0 " + std::string(400, '0') + "1\n"), "a.obj", "line 1");
  check_error(io::read_obj(folder / "absent.obj"), "absent.obj");
  check_error(io::read_obj(folder.path()), folder.path());
  std::string polygon = kTriangle + "f";
  for (int i = 0; i < 1025; ++i) polygon += " 1";
  check_error(read_obj_text(folder, polygon), "a.obj", "1024");
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
  const io::Expected<io::Mesh> mesh =
      read_obj_text(folder,
                    "\xEF\xBB\xBFv +1 2. .5 1.0\n  v 1 0 0 # note\nv 3.4028235e38 1e-50 "
                    "0#\nvp 1\nl 0 9\nvw 1 -1\nt x 9/9/9\nmtllib /\n"
                    "f -3 -2 -1 #");
  require_ok(mesh);
  REQUIRE(mesh.value().vertices.size() == 3);
  CHECK(mesh.value().vertices[0] == Vec3f{1, 2, 0.5F});
  CHECK(mesh.value().vertices[2] == Vec3f{std::numeric_limits<float>::max(), 0, 0});
  CHECK(mesh.value().faces.size() == 1);
  CHECK(mesh.value().colours.empty());
  const io::Expected<io::Mesh> coloured = read_obj_text(folder, "v 1 2 3 .1 .2 .3\nv 1 2 3 .4 .5 .6\n");
  require_ok(coloured);
  REQUIRE(coloured.value().colours.size() == 2);
  CHECK(coloured.value().colours[1] == Vec3f{0.4F, 0.5F, 0.6F});
  CHECK(read_obj_text(folder, "v 1 2 3 .1 .2 .3\nv 1 2 3\n").value().colours.empty());
}

TEST_CASE("published meshes are read whole: triangles, quads with indices counted back") {
  const char* const data = std::getenv("NPSIM_TEST_DATA");
  if (data == nullptr) {
    MESSAGE("skipped: NPSIM_TEST_DATA is not set");
    return;
  }
  struct Published {
    const char* file;
    std::size_t vertices;
    std::size_t faces;
  };
  for (const Published& p : {Published{"spot.obj", 11533, 23062}, Published{"boat.obj", 16210, 32416},
                             Published{"cornell_box.obj", 76, 36}}) {
    const std::string path = std::string(data) + "/meshes/" + p.file;
    INFO(path);
    const io::Expected<io::Mesh> mesh = io::read_obj(path);
    require_ok(mesh);
    CHECK(mesh.value().vertices.size() == p.vertices);
    CHECK(mesh.value().faces.size() == p.faces);
    CHECK(mesh.value().colours.empty());
    npsim_test::Scratch scratch(check_mesh_workspace_bytes(p.vertices, p.faces));
    MeshReport report;
    REQUIRE(check_mesh(mesh.value().view(), scratch.workspace(), report).ok());
    CHECK(report.out_of_range_faces == 0);
    CHECK(report.repeated_index_faces == 0);
    CHECK(report.not_finite_vertices == 0);
    CHECK(report.watertight() == (p.faces > 100));  // the animal and the boat are closed, the box stands open
    if (p.faces > 100) CHECK(report.euler_characteristic == 2);
  }
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
    const io::Expected<io::Mesh> mesh = read_obj_text(folder, text);
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
  options.materials = {{"photograph", {1, 1, 1}, {}, "day.png"}};
  check_error(io::write_obj(folder / "a.obj", s.view(), options), "a.obj", "texture");
  options.materials = {{"a lamp", {1, 1, 1}, {}, ""}};
  check_error(io::write_obj(folder / "a.obj", s.view(), options), "a.obj", "names");
  options.materials = {};
  options.groups = {{"two\nlines", 0, 0}};
  check_error(io::write_obj(folder / "a.obj", s.view(), options), "a.obj", "names");
  options.groups = {{"lamp", 0, 1}};
  check_error(io::write_obj(folder / "a.obj", s.view(), options), "a.obj", "lamp");
  s.faces[7].b = 60;
  check_error(io::write_obj(folder / "a.obj", s.view()), "a.obj", "face 7");
  s.faces[7].b = 0;
  s.vertices[3].y = std::numeric_limits<float>::quiet_NaN();
  check_error(io::write_obj(folder / "a.obj", s.view()), "a.obj", "vertex 3");
  CHECK(folder.files() == 0);
  check_error(io::write_obj(folder / "no/such/folder/a.obj", random_sheet(4, 1.0F).view()), "a.obj");
}
