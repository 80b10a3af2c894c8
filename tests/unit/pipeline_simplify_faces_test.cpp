// SPDX-License-Identifier: Apache-2.0
// The scene mesh with few faces: whole, its points on its faces, and the same night.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "fixture.hpp"
#include "lab/kept_night.hpp"
#include "made_street.hpp"
#include "night_of_street.hpp"
#include "npsim/depth/uncertainty.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/mesh/check.hpp"
#include "npsim/pipeline/detail/point_of_hit.hpp"
#include "npsim/pipeline/night.hpp"
#include "street/scene_view.hpp"
#include "street/street.hpp"
#include "tool/engine.hpp"

namespace {

using namespace npsim;

const street::Street& street_of_test() {
  static const street::Street shared = testing::made_street(3, {192, 108});
  return shared;
}

struct Sink {
  std::array<double, 3> mean{};
  std::size_t faces = 0;
  MeshReport report;
  // Of the points that pixels of the layers have: the largest distance in depth from the faces there, relatively.
  double worst_off = 0;
  std::size_t points = 0;
  std::size_t elsewhere = 0;  // hits whose point is of another pixel

  Status reconstructed(const RefinedDepth&, const SceneMesh& scene, const Relighting&) {
    faces = scene.mesh.faces.size();
    npsim_test::Scratch memory(check_mesh_workspace_bytes(scene.mesh.vertices.size(), scene.mesh.faces.size()));
    Workspace& workspace = memory.workspace();
    if (const Status checked = check_mesh(scene.mesh, workspace, report); !checked.ok()) return checked;
    const TriangleMeshView layer{scene.mesh.vertices, scene.mesh.faces.sub(0, scene.background_faces)};
    const std::size_t bytes = bvh_workspace_bytes(layer.faces.size());
    std::vector<unsigned char> tree(bytes);
    Workspace tree_workspace(tree.data(), bytes);
    Bvh bvh;
    if (const Status built = build_bvh(layer, tree_workspace, bvh); !built.ok()) return built;
    npsim_test::Scratch planes(2 * allocation_bytes<std::uint32_t>(scene.visible_vertex.shape().pixels()) +
                               kWorkspaceAlignment);
    FirstVertices first;
    if (const Status found = find_first_vertices(scene, planes.workspace(), first); !found.ok()) return found;
    const PointOfMeshHit point_of{&scene, first, street_of_test().intrinsics};
    const auto width = static_cast<std::uint32_t>(street_of_test().intrinsics.cx * 2);
    for (std::uint32_t v = 0; v < scene.background_vertices; ++v) {
      const Vec3f p = scene.mesh.vertices[v];
      Ray ray;
      ray.direction = p;
      Hit hit;
      if (!closest_hit(bvh, ray, hit)) continue;  // at the rim rounding may miss
      ++points;
      worst_off = std::max(worst_off, std::fabs(static_cast<double>(hit.t) - 1.0));
      const std::uint32_t found = scene.vertex_pixel[point_of(hit)];
      const auto apart = [&](std::uint32_t a, std::uint32_t b) { return a > b ? a - b : b - a; };
      const std::uint32_t own = scene.vertex_pixel[v];
      if (apart(found % width, own % width) > 1 || apart(found / width, own / width) > 1) ++elsewhere;
    }
    return {};
  }
  Status night(const Night& night) {
    mean = tool::colour_sums(night.luminance);
    return {};
  }
};

}  // namespace

TEST_CASE("simplified faces: whole, far fewer, every point on its face, and a night of the same mean colour") {
  NightParams params = default_night_params();
  REQUIRE(params.mesh.simplify_faces);
  params.mesh.traced = TracedFaces::mesh;
  const Sink thin = npsim::testing::night_of<Sink>(street_of_test(), params);
  params.mesh.simplify_faces = false;
  const Sink full = npsim::testing::night_of<Sink>(street_of_test(), params);
  CHECK(thin.report.oriented_manifold());
  CHECK(thin.report.components == full.report.components);
  CHECK(thin.report.boundary_loops == full.report.boundary_loops);
  CHECK(thin.faces < full.faces / 2);  // small pictures are full of borders
  REQUIRE(thin.points > 10000);
  CHECK(thin.worst_off < 1e-4);  // rounding of the ray tracer at grazing faces; the bound on depth is 50 times that
  CHECK(thin.elsewhere == 0);
  for (std::size_t c = 0; c < 3; ++c) CHECK(std::fabs(thin.mean[c] / full.mean[c] - 1) < 0.01);
}

TEST_CASE("simplified faces: a quarter of a pixel and half a percent leave a tenth of a street's faces at most") {
  street::Street made = testing::plain_street(1, {960, 540}, 1);
  ThreadPool pool(2);
  SceneView scene = view_of(made);
  scene.depth = made.depth.view();  // the true one
  RefinedDepth refined;             // what the depth steps leave where there is nothing to mend
  io::Image<std::uint8_t> surface(scene.shape());
  io::Image<std::uint8_t> uncertain(scene.shape());
  for (int y = 0; y < scene.shape().height; ++y) {
    for (int x = 0; x < scene.shape().width; ++x) surface(x, y) = kNoSurfaceLabels.contains(made.labels(x, y)) ? 0 : 1;
  }
  ReconstructParams params;
  npsim_test::Scratch memory(uncertainty_workspace_bytes({}, scene.shape()) +
                             reconstruct_workspace_bytes(params, scene.shape()));
  Workspace& workspace = memory.workspace();
  UncertaintyOutput marked;
  marked.mask = uncertain.view();
  REQUIRE(uncertainty({}, made.depth.view(), made.labels.view(), marked, workspace, pool).ok());
  refined.depth = made.depth.view();
  refined.labels = made.labels.view();
  refined.surface = surface.view();
  refined.uncertain = uncertain.view();
  REQUIRE(params.simplify.max_relative_depth_error == 0.005F);
  REQUIRE(params.simplify.max_pixel_error == 0.25F);
  params.backs = false;
  NullObserver observer;
  std::size_t faces[2] = {};
  for (const bool simplify : {false, true}) {
    const WorkspaceScope scope(workspace);
    params.simplify_faces = simplify;
    SceneMesh mesh;
    REQUIRE(engine::reconstruct(params, scene, refined, workspace, pool, observer, mesh).ok());
    faces[simplify ? 1 : 0] = mesh.mesh.faces.size();
  }
  CHECK(faces[0] > 1000000);
  CHECK(faces[1] <= faces[0] / 10);
}

TEST_CASE("simplified faces: labels of another shape and vertices of another layer are refused") {
  const Shape shape{8, 6};
  io::Image<Vec3f> vertices(shape);
  io::Image<std::uint8_t> quads(quad_shape(shape));
  io::Image<float> depth(shape, 5.0F);
  const Intrinsics camera = intrinsics_from_fov(shape, 1.0F);
  const SheetLayer layer{vertices.view(), quads.view()};
  SerialExecutor serial;
  REQUIRE(build_sheet(SheetParams{}, ImageView<const float>(depth.view()), {}, camera, layer, serial).ok());
  npsim_test::Scratch memory(simplify_faces_workspace_bytes({}, shape, {2 * shape.pixels(), 2 * shape.pixels()}) +
                             index_layer_workspace_bytes(shape));
  Workspace& workspace = memory.workspace();
  std::vector<Vec3f> points(shape.pixels());
  std::vector<std::uint32_t> pixels(shape.pixels());
  std::vector<Face> faces(2 * shape.pixels());
  const MeshBuffers part{{points.data(), points.size()}, {faces.data(), faces.size()}, {pixels.data(), pixels.size()}};
  MeshSize size;
  REQUIRE(index_layer(layer, 0, part, size, workspace, serial).ok());
  const io::Image<Label> small({7, 6});
  std::size_t count = size.faces;
  CHECK(simplify_faces({}, true, layer, small.view(), {}, camera, 0, part, count, workspace, serial).code() ==
        StatusCode::shape_mismatch);
  CHECK(count == size.faces);
  for (std::uint32_t& p : pixels) p = 0;
  CHECK(simplify_faces({}, true, layer, {}, {}, camera, 0, part, count, workspace, serial).code() ==
        StatusCode::invalid_argument);
}
