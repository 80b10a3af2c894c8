// SPDX-License-Identifier: Apache-2.0
// Every mesh that the kernels make is whole, whatever the masks: 10,000 random pictures of 1 to 40 pixels a side.
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "mesh_fixture.hpp"
#include "mesh_masks.hpp"
#include "npsim/mesh/check.hpp"
#include "npsim/mesh/simplify.hpp"
#include "npsim/mesh/solidify.hpp"

using namespace mesh_test;

namespace {

constexpr std::uint32_t kTrials = 10000;

void paint_labels(Picture& p, RandomStream& random) {
  constexpr Label kForeground[] = {label::car, label::person, label::pole, label::bus, label::traffic_sign};
  const bool of_every_pixel = random.next_u32() % 8 == 0;  // labels that change in every pixel
  for (int layers = 1 + static_cast<int>(random.next_u32() % 3); layers > 0; --layers) {
    const std::vector<std::uint8_t> mask = make_mask(p.shape, any_kind(random), random);
    const Label one = kForeground[random.next_u32() % 5];
    for (int y = 0; y < p.shape.height; ++y) {
      for (int x = 0; x < p.shape.width; ++x) {
        if (mask[static_cast<std::size_t>(y * p.shape.width + x)] == 0) continue;
        p.labels(x, y) = of_every_pixel ? kForeground[random.next_u32() % 5] : one;
        p.instances(x, y) = static_cast<std::uint16_t>(random.next_u32() % (layers == 1 ? 3 : 1));
      }
    }
  }
  const std::vector<std::uint8_t> sky =
      make_mask(p.shape, random.next_u32() % 2 == 0 ? mask_empty : any_kind(random), random);
  const std::vector<std::uint8_t> doubt = make_mask(p.shape, any_kind(random), random);
  for (int y = 0; y < p.shape.height; ++y) {
    for (int x = 0; x < p.shape.width; ++x) {
      const auto i = static_cast<std::size_t>(y * p.shape.width + x);
      if (sky[i] != 0) p.labels(x, y) = label::sky;
      p.surface(x, y) = kNoSurfaceLabels.contains(p.labels(x, y)) ? 0 : 1;
      p.uncertain(x, y) = doubt[i];
    }
  }
}

void paint_depth(Picture& p, RandomStream& random) {
  const std::uint32_t kind = random.next_u32() % 5;
  const std::vector<std::uint8_t> step = make_mask(p.shape, any_kind(random), random);
  const std::vector<std::uint8_t> none =
      make_mask(p.shape, random.next_u32() % 3 == 0 ? any_kind(random) : mask_empty, random);
  const float far = random.next_u32() % 8 == 0 ? 1.0e5F : 80.0F;
  const float tilt = random.uniform(0.0F, 0.5F);
  for (int y = 0; y < p.shape.height; ++y) {
    for (int x = 0; x < p.shape.width; ++x) {
      const auto i = static_cast<std::size_t>(y * p.shape.width + x);
      float z = 12.0F;
      if (kind == 1) z = 5.0F + tilt * static_cast<float>(x + y);
      if (kind == 2) z = step[i] != 0 ? 4.0F : far;
      if (kind == 3) z = std::exp(random.uniform(0.0F, std::log(far)));
      if (kind == 4) z = (step[i] != 0 ? 4.0F : far) * random.uniform(0.9F, 1.1F);
      p.depth(x, y) = none[i] == 0 ? z : (x % 3 == 0 ? kNaN : (x % 3 == 1 ? 0.0F : -1.0F));
    }
  }
}

// The layer with the fewest faces that the bound allows.
Indexed simplified(Picture& p, const SheetLayer& layer, ImageView<const std::uint32_t> ids, bool thesis,
                   SimplifyResult& result) {
  SimplifyParams params;
  if (thesis) params.max_pixel_error = kSafePixelError;
  const MeshSize most = mesh_size(layer);
  Indexed mesh{std::vector<Vec3f>(most.vertices), std::vector<Face>(most.faces),
               std::vector<std::uint32_t>(most.vertices)};
  Scratch scratch(simplify_layer_workspace_bytes(params, p.shape));
  SerialExecutor executor;
  const MeshBuffers out{
      {mesh.vertices.data(), most.vertices}, {mesh.faces.data(), most.faces}, {mesh.pixels.data(), most.vertices}};
  const Status status = simplify_layer(params, layer, ids, p.intrinsics, 0, out, result, scratch.workspace(), executor);
  REQUIRE_MESSAGE(status.ok(), status.message());
  mesh.vertices.resize(result.size.vertices);
  mesh.pixels.resize(result.size.vertices);
  mesh.faces.resize(result.size.faces);
  return mesh;
}

// Front and back in one mesh.
Indexed solid(Picture& p, const Indexed& front) {
  const SolidifyParams params;
  SolidifyScene scene;
  scene.camera = p.intrinsics;
  scene.object = p.object.cview();
  scene.labels = p.labels.cview();
  scene.background = p.background.vertices.cview();
  scene.camera_height_m = 1.5F;
  const std::size_t n = front.vertices.size();
  const std::size_t faces = front.faces.size();
  Indexed all = front;
  all.vertices.resize(2 * n);
  all.pixels.resize(2 * n);
  all.faces.resize(2 * faces + 6 * faces);  // if every edge were on the rim
  Scratch scratch(solidify_workspace_bytes(params, p.shape, n, faces));
  SerialExecutor executor;
  MeshSize size;
  const MeshBuffers out{
      {all.vertices.data() + n, n}, {all.faces.data() + faces, 7 * faces}, {all.pixels.data() + n, n}};
  const SolidifyFront visible{front.view(), {front.pixels.data(), n}, 0};
  const Status status = solidify(params, visible, scene, out, size, scratch.workspace(), executor);
  REQUIRE_MESSAGE(status.ok(), status.message());
  CHECK(size.vertices == n);
  all.faces.resize(faces + size.faces);
  return all;
}

std::string faults(const MeshReport& r) {
  std::string why;
  const auto expect_none = [&why](std::size_t n, const char* what) {
    if (n != 0) why += std::to_string(n) + " " + what + "; ";
  };
  expect_none(r.out_of_range_faces, "faces out of range");
  expect_none(r.repeated_index_faces, "faces with a repeated index");
  expect_none(r.not_finite_vertices, "vertices not finite");
  expect_none(r.flat_faces, "flat faces");
  expect_none(r.duplicate_faces, "duplicate faces");
  expect_none(r.nonmanifold_edges, "non-manifold edges");
  expect_none(r.inconsistent_edges, "edges between faces of opposite orientation");
  expect_none(r.pinched_vertices, "pinched vertices");
  expect_none(r.isolated_vertices, "vertices without a face");
  return why;
}

// Why a sheet is not what every sheet has to be; empty if it is.
std::string sheet_fault(const Indexed& mesh) {
  std::string why = faults(report(mesh.view()));
  std::size_t backs = 0;
  for (const Face& f : mesh.faces) {
    const Vec3d a = vec_cast<double>(mesh.vertices[f.a]);
    const Vec3d normal = cross(vec_cast<double>(mesh.vertices[f.b]) - a, vec_cast<double>(mesh.vertices[f.c]) - a);
    backs += dot(normal, a) < 0.0 ? 0U : 1U;
  }
  if (backs != 0) why += std::to_string(backs) + " faces that turn their back to the camera";
  return why;
}

// The simplified sheet covers what the full one covers: it has the same parts and as many rims.
std::string change(const Indexed& full, const Indexed& thin) {
  const MeshReport a = report(full.view());
  const MeshReport b = report(thin.view());
  return a.components == b.components && a.boundary_loops == b.boundary_loops &&
                 a.euler_characteristic == b.euler_characteristic
             ? ""
             : "another topology";
}

std::string solid_fault(const Indexed& mesh) {
  const MeshReport r = report(mesh.view());
  return faults(r) + (r.boundary_edges == 0 ? "" : std::to_string(r.boundary_edges) + " open edges");
}

std::string layer_fault(const LayerReport& r) {
  if (r.whole()) return {};
  return std::to_string(r.uncovered_pixels) + " pixels uncovered, " + std::to_string(r.missing_faces) +
         " faces missing, " + std::to_string(r.stray_faces) + " stray";
}

}  // namespace

TEST_CASE("10,000 random masks: no hole inside a sheet, no fault in any mesh") {
  std::size_t faces = 0;
  std::size_t thin_faces = 0;
  std::size_t on_objects = 0;  // vertices
  std::size_t splits = 0;      // vertices that exist more than once, because fans of faces meet in them
  for (std::uint32_t trial = 0; trial < kTrials; ++trial) {
    CAPTURE(trial);
    RandomStream random(11, RandomPurpose::test, trial, 0, 0, 0);
    // One in eight is a single row or column.
    const auto side = [&random] {
      return random.next_u32() % 16 == 0 ? 1 : 1 + static_cast<int>(random.next_u32() % 40);
    };
    const int width = side();
    Picture p({width, side()});
    CAPTURE(p.shape.width);
    CAPTURE(p.shape.height);
    paint_labels(p, random);
    paint_depth(p, random);
    const bool thesis = trial % 4 == 3;
    if (thesis) {
      p.run(BackgroundParams::thesis(), ForegroundParams::thesis());
    } else {
      p.run();
    }

    const Indexed sheet = index(p.sheet.view());
    const Indexed background = index(p.background.view());
    const Indexed foreground = index(p.foreground.view());
    CHECK(sheet_fault(sheet) == "");
    CHECK(sheet_fault(background) == "");
    CHECK(sheet_fault(foreground) == "");
    LayerReport layer;
    REQUIRE(check_background(p.background.view(), p.state.cview(), layer).ok());
    CHECK(layer_fault(layer) == "");
    Scratch scratch(check_foreground_workspace_bytes(p.shape));
    REQUIRE(check_foreground(p.foreground.view(), p.object.cview(), scratch.workspace(), layer).ok());
    CHECK(layer_fault(layer) == "");

    SimplifyResult result;
    const Indexed thin_background = simplified(p, p.background.view(), {}, thesis, result);
    const Indexed thin_foreground = simplified(p, p.foreground.view(), p.object.cview(), thesis, result);
    // Completed in position, vertices lie off their pixels, and without the safe bound a thin face of such turns over.
    CHECK(sheet_fault(thin_background) == "");
    CHECK(sheet_fault(thin_foreground) == "");
    CHECK(change(background, thin_background) == "");
    CHECK(change(foreground, thin_foreground) == "");
    CHECK(solid_fault(solid(p, foreground)) == "");
    CHECK(solid_fault(solid(p, thin_foreground)) == "");

    faces += sheet.faces.size() + background.faces.size() + foreground.faces.size();
    thin_faces += thin_background.faces.size() + thin_foreground.faces.size();
    for (std::size_t i = 1; i < foreground.pixels.size(); ++i) {
      const bool again = foreground.pixels[i] == foreground.pixels[i - 1];
      ++(again ? splits : on_objects);
    }
  }
  // The masks are worth the name: there were faces, objects and pinches to get wrong.
  CHECK(faces > 5000000);
  CHECK(thin_faces < faces / 2);
  CHECK(on_objects > 500000);
  CHECK(splits > 10000);
}
