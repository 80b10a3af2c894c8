// SPDX-License-Identifier: Apache-2.0
#include "npsim/io/ply.hpp"

#include <cstring>
#include <limits>
#include <vector>

#include "io_fixture.hpp"

using namespace io_test;
using namespace npsim;

namespace {

const std::vector<Vec3f> kPlyVertices = {{0, -1.5F, 1.0e5F}, {1, 0, 2}, {0, 1, 3}};
const std::vector<Face> kPlyFaces = {{0, 2, 1}, {2, 1, 0}};
const TriangleMeshView kPlyMesh{{kPlyVertices.data(), 3}, {kPlyFaces.data(), 2}};

template <class T>
T at(const std::string& bytes, std::size_t offset) {
  T value;
  REQUIRE(offset + sizeof value <= bytes.size());
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

}  // namespace

TEST_CASE("a PLY has exactly the bytes that its header announces") {
  const TemporaryFolder folder;
  const std::vector<Vec3f> normals(3, Vec3f{0, 0, -1});
  const std::vector<Rgb8> colours = {{1, 2, 3}, {4, 5, 6}, {7, 8, 255}};
  require_ok(io::write_ply(folder / "a.ply", kPlyMesh, {{normals.data(), 3}, {colours.data(), 3}}));
  const std::string bytes = contents(folder / "a.ply");
  const std::size_t data = bytes.find("end_header\n") + 11;
  CHECK(bytes.rfind("ply\nformat binary_little_endian 1.0\n", 0) == 0);
  CHECK(bytes.find("element vertex 3\n") != std::string::npos);
  CHECK(bytes.find("element face 2\n") != std::string::npos);
  REQUIRE(bytes.size() == data + 3 * 27 + 2 * 13);
  CHECK(at<float>(bytes, data + 4) == -1.5F);
  CHECK(at<float>(bytes, data + 8) == 1.0e5F);
  CHECK(at<float>(bytes, data + 20) == -1.0F);
  CHECK(at<std::uint8_t>(bytes, data + 2 * 27 + 26) == 255);
  CHECK(at<std::uint8_t>(bytes, data + 81) == 3);
  CHECK(at<std::uint32_t>(bytes, data + 81 + 5) == 2);
}

TEST_CASE("a PLY with y up is turned about x by half a turn, normals too") {
  const TemporaryFolder folder;
  const std::vector<Vec3f> normals(3, Vec3f{0.5F, 0.25F, -1});
  io::PlyOptions options;
  options.normals = {normals.data(), 3};
  options.frame = io::MeshFrame::y_up;
  require_ok(io::write_ply(folder / "a.ply", kPlyMesh, options));
  const std::string bytes = contents(folder / "a.ply");
  const std::size_t data = bytes.find("end_header\n") + 11;
  CHECK(bytes.find("x right, y up, z backward") != std::string::npos);
  CHECK(at<float>(bytes, data + 4) == 1.5F);
  CHECK(at<float>(bytes, data + 8) == -1.0e5F);
  CHECK(at<float>(bytes, data + 12) == 0.5F);
  CHECK(at<float>(bytes, data + 16) == -0.25F);
  CHECK(at<float>(bytes, data + 20) == 1.0F);
}

TEST_CASE("a PLY without normals, colours, faces or vertices is still whole") {
  const TemporaryFolder folder;
  require_ok(io::write_ply(folder / "a.ply", kPlyMesh));
  std::string bytes = contents(folder / "a.ply");
  CHECK(bytes.size() == bytes.find("end_header\n") + 11 + 3 * 12 + 2 * 13);
  CHECK(bytes.find("nx") == std::string::npos);
  require_ok(io::write_ply(folder / "b.ply", {}));
  bytes = contents(folder / "b.ply");
  CHECK(bytes.size() == bytes.find("end_header\n") + 11);
}

TEST_CASE("a PLY with a bad index, a NaN or too few colours is not written") {
  const TemporaryFolder folder;
  const std::vector<Face> bad = {{0, 1, 3}};
  check_error(io::write_ply(folder / "a.ply", {kPlyMesh.vertices, {bad.data(), 1}}), "a.ply", "face 0");
  const std::vector<Vec3f> nan = {{0, 0, std::numeric_limits<float>::quiet_NaN()}};
  check_error(io::write_ply(folder / "a.ply", {{nan.data(), 1}, {}}), "a.ply", "vertex 0");
  const std::vector<Rgb8> colours(2);
  check_error(io::write_ply(folder / "a.ply", kPlyMesh, {{}, {colours.data(), 2}}), "a.ply", "colours");
  CHECK(folder.files() == 0);
}
