// SPDX-License-Identifier: Apache-2.0
// The scene mesh of generated streets, and of real scenes where there are any, is whole.
#include <doctest/doctest.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "fixture.hpp"
#include "io_fixture.hpp"
#include "made_street.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/observe.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/scene.hpp"
#include "npsim/io/scene_resize.hpp"
#include "npsim/mesh/check.hpp"
#include "npsim/pipeline/night.hpp"
#include "real_scenes.hpp"
#include "street/scene_view.hpp"
#include "street/street.hpp"
#include "tool/engine.hpp"

namespace {

using namespace npsim;
using namespace io_test;

MeshReport report_of(const TriangleMeshView& mesh) {
  npsim_test::Scratch bytes(check_mesh_workspace_bytes(mesh.vertices.size(), mesh.faces.size()));
  Workspace& workspace = bytes.workspace();
  MeshReport report;
  REQUIRE(check_mesh(mesh, workspace, report).ok());
  return report;
}

// With a preset: both layers, the whole mesh, and the objects on their own.
void check_whole(const NightParams& params, const SceneView& scene) {
  const std::size_t bytes = refine_depth_workspace_bytes(params.depth, scene.shape()) +
                            reconstruct_workspace_bytes(params.mesh, scene.shape());
  const std::unique_ptr<unsigned char[]> memory(new unsigned char[bytes]);
  Workspace workspace(memory.get(), bytes);
  ThreadPool pool(2);
  NullObserver observer;
  RefinedDepth refined;
  SceneMesh mesh;
  REQUIRE(engine::refine_depth(params.depth, scene, workspace, pool, observer, refined).ok());
  REQUIRE(engine::reconstruct(params.mesh, scene, refined, workspace, pool, observer, mesh).ok());

  LayerReport layer;
  REQUIRE(check_background(mesh.background, mesh.background_state, layer).ok());
  CHECK(layer.whole());
  CHECK(layer.covered_pixels > 0);
  npsim_test::Scratch small(check_foreground_workspace_bytes(scene.shape()));
  Workspace& for_objects = small.workspace();
  REQUIRE(check_foreground(mesh.foreground, mesh.object, for_objects, layer).ok());
  CHECK(layer.whole());

  const MeshReport all = report_of(mesh.mesh);
  CHECK(all.oriented_manifold());
  CHECK(all.smallest_angle_rad > 0.0);
  // The background keeps its faces and vertices to itself; so the objects are the rest.
  const std::vector<Face> objects(mesh.mesh.faces.begin() + mesh.background_faces, mesh.mesh.faces.end());
  if (objects.empty()) return;
  const MeshReport solids = report_of({mesh.mesh.vertices, {objects.data(), objects.size()}});
  CHECK(solids.oriented_manifold());
  CHECK(solids.watertight() == params.mesh.backs);
}

void check_whole(const SceneView& scene) {
  check_whole(default_night_params(), scene);
  NightParams thesis = default_night_params();  // by another depth: the thesis' own takes long
  thesis.mesh = thesis_night_params().mesh;
  check_whole(thesis, scene);
}

}  // namespace

TEST_CASE("every generated street: layers without a hole, a mesh without a fault, closed objects") {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    CAPTURE(seed);
    const street::Street made = testing::made_street(seed, {160, 90});
    check_whole(view_of(made));
    SceneView bare = view_of(made);  // the same with its true depth, and without instances
    bare.depth = made.depth.view();
    bare.instances = {};
    check_whole(bare);
  }
}

TEST_CASE("real scenes, where the environment names them: whole as well") {
  for (const auto& [name, text] : npsim_test::real_scenes()) {
    CAPTURE(name);
    const TemporaryFolder folder;
    put(folder / "scene.json", text);
    io::Expected<io::Scene> scene = io::read_scene(folder / "scene.json");
    require_ok(scene);
    const Shape full = scene.value().shape();
    require_ok(io::resize_scene(scene.value(), {full.width / 4, full.height / 4}));
    check_whole(scene.value().view());
  }
}
