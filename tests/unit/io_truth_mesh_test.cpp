// SPDX-License-Identifier: Apache-2.0
// The true mesh with its materials and emitters, and what is refused.
#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "io_fixture.hpp"
#include "npsim/io/truth_mesh.hpp"

using namespace io_test;
namespace io = npsim::io;

namespace {

const char* const kObj =
    "mtllib street.mtl\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\ng none\nusemtl m0\nf 1 2 3\ng e12\nf 2 3 4\nusemtl m1\n"
    "f 1 2 4\ng else\nf 1 3 4\n";
const char* const kMtl = "newmtl m0\nKd 0.1 0.2 0.3\nPr 0.5\n\nnewmtl m1\nKs 1 1 1\nPr 0.25\nKd 1 0 0\n";

io::Expected<io::TrueMesh> read_true_mesh_text(const TemporaryFolder& folder, const std::string& obj,
                                               const std::string& mtl) {
  put(folder / "street.obj", obj);
  put(folder / "street.mtl", mtl);
  io::Scene scene;
  scene.truth.mesh = folder / "street.obj";
  return io::read_truth_mesh(scene);
}

}  // namespace

TEST_CASE("truth mesh: faces have the material and the emitter that stand above them") {
  const TemporaryFolder folder;
  const auto mesh = read_true_mesh_text(folder, kObj, kMtl);
  require_ok(mesh);
  REQUIRE(mesh.value().mesh.faces.size() == 4);
  CHECK(mesh.value().face_emitter == std::vector<std::uint32_t>{0, 12, 12, 0});
  CHECK(mesh.value().face_material == std::vector<std::uint32_t>{0, 0, 1, 1});
  REQUIRE(mesh.value().materials.size() == 2);
  CHECK(mesh.value().materials[0].albedo == npsim::Vec3f{0.1F, 0.2F, 0.3F});
  CHECK(mesh.value().materials[0].roughness == 0.5F);
  CHECK(mesh.value().materials[1].albedo == npsim::Vec3f{1, 0, 0});
  CHECK(mesh.value().materials[1].roughness == 0.25F);
}

TEST_CASE("truth mesh: what is missing or wrong is named with its line") {
  const TemporaryFolder folder;
  check_error(read_true_mesh_text(folder, replaced(kObj, "usemtl m1", "usemtl m2"), kMtl), "street.obj", "line 11");
  check_error(read_true_mesh_text(folder, replaced(kObj, "usemtl m1", "usemtl"), kMtl), "street.obj", "line 11");
  check_error(read_true_mesh_text(folder, replaced(kObj, "mtllib street.mtl", ""), kMtl), "street.obj", "line 7");
  check_error(read_true_mesh_text(folder, replaced(kObj, "street.mtl", "absent.mtl"), kMtl), "absent.mtl", "");
  check_error(read_true_mesh_text(folder, replaced(kObj, "f 2 3 4", "f 1 2 4 3"), kMtl), "street.obj", "faces");
  check_error(read_true_mesh_text(folder, kObj, replaced(kMtl, "0.2 0.3", "0.2")), "street.mtl", "line 2");
  check_error(read_true_mesh_text(folder, kObj, replaced(kMtl, "Pr 0.5", "Pr 1.5")), "street.mtl", "line 3");
  check_error(read_true_mesh_text(folder, kObj, replaced(kMtl, "newmtl m0", "")), "street.mtl", "line 2");
  const io::Scene none;
  check_error(io::read_truth_mesh(none), "", "truth.mesh");
}
