// SPDX-License-Identifier: Apache-2.0
#include "npsim/mesh/index.hpp"

#include <string>
#include <vector>

#include "mesh_fixture.hpp"

using namespace mesh_test;

namespace {

Layer from_mask(const std::vector<const char*>& rows) {
  const Shape shape{static_cast<int>(std::char_traits<char>::length(rows[0])), static_cast<int>(rows.size())};
  Picture p(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) p.surface(x, y) = rows[static_cast<std::size_t>(y)][x] == '#' ? 1 : 0;
  }
  SerialExecutor executor;
  REQUIRE(build_sheet({}, p.depth.cview(), p.surface.cview(), p.intrinsics, p.sheet.view(), executor).ok());
  return p.sheet;
}

}  // namespace

TEST_CASE("vertices without a face are left out of the index") {
  Layer layer = from_mask({"#..##", "...##", "#...."});
  const Indexed mesh = index(layer.view());
  CHECK(mesh.vertices.size() == 4);
  CHECK(mesh.pixels == std::vector<std::uint32_t>{3, 4, 8, 9});
  CHECK(mesh.faces.size() == 2);
  check_layer(layer.view());
}

TEST_CASE("two quads that touch in one corner do not share its vertex") {
  Layer layer = from_mask({"##..", "###.", ".###", "..##"});
  // The 2 x 2 block in the middle joins them; without its faces they only touch.
  layer.quads(1, 1) = layer.quads(1, 0) = layer.quads(0, 1) = layer.quads(2, 1) = layer.quads(1, 2) = 0;
  layer.quads(0, 0) = layer.quads(2, 2) = 0;
  layer.quads(0, 0) = kQuadUpperFace | kQuadLowerFace;
  layer.quads(1, 1) = kQuadUpperFace | kQuadLowerFace;
  const Indexed mesh = index(layer.view());
  CHECK(mesh.faces.size() == 4);
  CHECK(mesh.vertices.size() == 8);
  const MeshReport r = check_layer(layer.view());
  CHECK(r.pinched_vertices == 0);
  CHECK(r.components == 2);
  CHECK(r.boundary_loops == 2);
}

TEST_CASE("random faces, present or not: always a manifold, never a lost face") {
  for (std::uint32_t trial = 0; trial < 300; ++trial) {
    CAPTURE(trial);
    RandomStream random(6, RandomPurpose::test, trial, 0, 0, 0);
    const Shape shape{2 + static_cast<int>(random.uniform(0.0F, 8.0F)),
                      2 + static_cast<int>(random.uniform(0.0F, 8.0F))};
    Picture p(shape);
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) p.depth(x, y) = random.uniform(1.0F, 9.0F);
    }
    SerialExecutor executor;
    REQUIRE(build_sheet({}, p.depth.cview(), {}, p.intrinsics, p.sheet.view(), executor).ok());
    const float density = random.uniform();
    std::size_t faces = 0;
    for (int y = 0; y + 1 < shape.height; ++y) {
      for (int x = 0; x + 1 < shape.width; ++x) {
        unsigned quad = random.uniform() < 0.5F ? 0U : kQuadAntiDiagonal;
        for (const unsigned bit : {unsigned{kQuadUpperFace}, unsigned{kQuadLowerFace}}) {
          if (random.uniform() < density) {
            quad |= bit;
            ++faces;
          }
        }
        p.sheet.quads(x, y) = static_cast<std::uint8_t>(quad);
      }
    }
    const Indexed mesh = index(p.sheet.view());
    CHECK(mesh.faces.size() == faces);
    const MeshReport r = check_layer(p.sheet.view());
    // Splitting is minimal: joined by pixel instead, the mesh has the same edges.
    std::vector<Face> by_pixel = mesh.faces;
    std::vector<Vec3f> pixels(shape.pixels());
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i) pixels[mesh.pixels[i]] = mesh.vertices[i];
    for (Face& f : by_pixel) f = {mesh.pixels[f.a], mesh.pixels[f.b], mesh.pixels[f.c]};
    const MeshReport joined = report({{pixels.data(), pixels.size()}, {by_pixel.data(), by_pixel.size()}});
    CHECK(joined.edges == r.edges);
    CHECK(joined.boundary_edges == r.boundary_edges);
    CHECK((joined.pinched_vertices == 0) == (mesh.vertices.size() == joined.vertices - joined.isolated_vertices));
  }
}

TEST_CASE("two layers in one mesh: the second's indices follow the first's vertices") {
  Picture p({12, 9});
  p.rectangle(4, 2, 7, 6, label::car, 4.0F);
  p.run();
  const MeshSize background = mesh_size(p.background.view());
  const MeshSize foreground = mesh_size(p.foreground.view());
  std::vector<Vec3f> vertices(background.vertices + foreground.vertices);
  std::vector<Face> faces(background.faces + foreground.faces);
  std::vector<std::uint32_t> pixels(vertices.size());
  Scratch scratch(index_layer_workspace_bytes(p.shape));
  SerialExecutor executor;
  MeshSize first;
  MeshSize second;
  const MeshBuffers out{
      {vertices.data(), vertices.size()}, {faces.data(), faces.size()}, {pixels.data(), pixels.size()}};
  REQUIRE(
      index_layers(p.background.view(), p.foreground.view(), out, first, second, scratch.workspace(), executor).ok());
  CHECK(first.faces == background.faces);
  CHECK(second.vertices == foreground.vertices);
  const MeshReport r = report({{vertices.data(), vertices.size()}, {faces.data(), faces.size()}});
  CHECK(r.oriented_manifold());
  CHECK(r.components == 2);
  CHECK(r.euler_characteristic == 2);
  CHECK(r.isolated_vertices == 0);
  CHECK(pixels[first.vertices] == 2 * 12 + 4);
  for (std::size_t i = first.faces; i < faces.size(); ++i) CHECK(faces[i].a >= first.vertices);

  const MeshBuffers small{out.vertices, {faces.data(), faces.size() - 1}, {}};
  CHECK(index_layers(p.background.view(), p.foreground.view(), small, first, second, scratch.workspace(), executor)
            .code() == StatusCode::capacity_exceeded);
  CHECK(second.faces == foreground.faces);
  const MeshBuffers few_pixels{out.vertices, out.faces, {pixels.data(), background.vertices}};
  CHECK(index_layers(p.background.view(), p.foreground.view(), few_pixels, first, second, scratch.workspace(), executor)
            .code() == StatusCode::capacity_exceeded);
  CHECK(index_layer(p.background.view(), 0xFFFFFFFFU, out, first, scratch.workspace(), executor).code() ==
        StatusCode::capacity_exceeded);
  Workspace none;
  CHECK(index_layer(p.background.view(), 0, out, first, none, executor).code() == StatusCode::workspace_exhausted);
}
