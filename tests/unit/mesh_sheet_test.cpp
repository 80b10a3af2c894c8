// SPDX-License-Identifier: Apache-2.0
#include "npsim/mesh/sheet.hpp"

#include <cmath>

#include "mesh_fixture.hpp"

using namespace mesh_test;

namespace {

Status build(Picture& p, const SheetParams& params = {}) {
  SerialExecutor executor;
  return build_sheet(params, p.depth.cview(), p.surface.cview(), p.intrinsics, p.sheet.view(), executor);
}

}  // namespace

TEST_CASE("a sheet puts every vertex on its pixel's ray at its depth") {
  Picture p({31, 17});
  p.intrinsics = {1310.5F, 1290.25F, 12.75F, 9.5F};
  RandomStream random(1, RandomPurpose::test, 0, 0, 0, 0);
  for (int y = 0; y < 17; ++y) {
    for (int x = 0; x < 31; ++x) p.depth(x, y) = std::exp(random.uniform(0.0F, 11.0F));
  }
  REQUIRE(build(p).ok());
  for (int y = 0; y < 17; ++y) {
    for (int x = 0; x < 31; ++x) {
      const double z = static_cast<double>(p.depth(x, y));
      const double vx = (x + 0.5 - 12.75) * z / 1310.5;
      const double vy = (y + 0.5 - 9.5) * z / 1290.25;
      const Vec3f v = p.sheet.vertices(x, y);
      CHECK(v.z == p.depth(x, y));
      CHECK(std::fabs(static_cast<double>(v.x) - vx) <= 2.5 * 0x1p-23 * std::fabs(vx));
      CHECK(std::fabs(static_cast<double>(v.y) - vy) <= 2.5 * 0x1p-23 * std::fabs(vy));
    }
  }
  const MeshReport r = check_layer(p.sheet.view());
  CHECK(r.faces == 2 * 30 * 16);
  CHECK(r.vertices == 31 * 17);
  CHECK(r.euler_characteristic == 1);
  CHECK(r.boundary_loops == 1);
  CHECK(r.boundary_edges == 2 * (30 + 16));
}

TEST_CASE("offsets move every vertex as equation (3.1) says") {
  Picture p({40, 30});
  const double half_width = std::tan(0.4);  // of the field of view, both ways
  const double half_height = std::tan(0.25);
  const Intrinsics camera{static_cast<float>(20 / half_width), static_cast<float>(15 / half_height), 20, 15};
  const Vec2f offset{0.125F, -0.3F};
  p.intrinsics = with_offsets(camera, p.depth.shape(), offset);
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 40; ++x) p.depth(x, y) = 3.0F + 0.5F * static_cast<float>(x) + static_cast<float>(y);
  }
  REQUIRE(build(p).ok());
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 40; ++x) {
      const double d = static_cast<double>(p.depth(x, y));
      const Vec3f v = p.sheet.vertices(x, y);
      CHECK(static_cast<double>(v.x) == doctest::Approx(d * ((x + 0.5) / 20 - 1 + 0.125) * half_width).epsilon(1e-5));
      CHECK(static_cast<double>(v.y) == doctest::Approx(d * ((y + 0.5) / 15 - 1 - 0.3) * half_height).epsilon(1e-5));
      CHECK(v.z == p.depth(x, y));
    }
  }
  const Intrinsics none = with_offsets(camera, p.depth.shape(), {0, 0});
  CHECK(none.cx == camera.cx);
  CHECK(none.cy == camera.cy);
}

TEST_CASE("the diagonal has the smaller depth jump, a tie goes from upper left to lower right") {
  Picture p({2, 2});
  p.depth(0, 0) = 5;  // A, against D = 10: jump 5 on A-D, 0 on B-C
  REQUIRE(build(p).ok());
  CHECK(p.sheet.quads(0, 0) == (kQuadAntiDiagonal | kQuadUpperFace | kQuadLowerFace));
  p.depth(1, 0) = 5;  // now 5 on both
  REQUIRE(build(p).ok());
  CHECK(p.sheet.quads(0, 0) == (kQuadUpperFace | kQuadLowerFace));
}

TEST_CASE("a quad with three vertices has the one face that they allow") {
  for (int missing = 0; missing < 4; ++missing) {
    Picture p({2, 2});
    p.depth(missing & 1, missing >> 1) = kNaN;
    REQUIRE(build(p).ok());
    const Indexed mesh = index(p.sheet.view());
    REQUIRE(mesh.faces.size() == 1);
    CHECK(mesh.vertices.size() == 3);
    for (const std::uint32_t pixel : mesh.pixels) CHECK(pixel != static_cast<std::uint32_t>(missing));
    check_layer(p.sheet.view());
  }
}

TEST_CASE("depth with a ring of NaN, infinities, zeros and negatives has no vertex there") {
  Picture p({7, 7});
  const float bad[] = {kNaN, std::numeric_limits<float>::infinity(), 0.0F, -3.0F, -0.0F, 1e30F, 1e-30F};
  int n = 0;
  for (int y = 1; y <= 5; ++y) {
    for (int x = 1; x <= 5; ++x) {
      if (x == 1 || x == 5 || y == 1 || y == 5) p.depth(x, y) = bad[n++ % 7];
    }
  }
  REQUIRE(build(p).ok());
  CHECK(p.sheet.vertices(1, 1) == Vec3f{});
  const MeshReport r = check_layer(p.sheet.view());
  CHECK(r.faces == 8 + 4);  // the middle 3 x 3, and the four corners of the outer ring, which is one pixel wide
  CHECK(r.components == 5);
}

TEST_CASE("one row, one column and one pixel have vertices but no face") {
  for (const Shape s : {Shape{9, 1}, Shape{1, 9}, Shape{1, 1}}) {
    Picture p(s);
    REQUIRE(build(p).ok());
    CHECK(has_vertex(p.sheet.vertices(s.width - 1, s.height - 1)));
    CHECK(check_layer(p.sheet.view()).faces == 0);
    SheetLayer no_quads = p.sheet.view();
    no_quads.quads = {};
    CHECK(validate(no_quads).ok());
    CHECK(index(no_quads).faces.empty());
  }
}

TEST_CASE("vertices at 1e5 m next to vertices at half a metre make faces that are not flat") {
  Picture p({16, 16});
  p.intrinsics = {1000.0F, 1000.0F, 8.0F, 8.0F};
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) p.depth(x, y) = (x + y) % 3 == 0 ? 1.0e5F : 0.5F;
  }
  REQUIRE(build(p).ok());
  CHECK(check_layer(p.sheet.view()).faces == 2 * 15 * 15);
}

TEST_CASE("the sky is no surface, and does not keep a stale vertex") {
  Picture p({4, 4});
  p.rectangle(0, 0, 3, 1, label::sky, 1000.0F);
  REQUIRE(build(p).ok());
  CHECK(p.sheet.vertices(0, 0) == Vec3f{});
  CHECK(check_layer(p.sheet.view()).faces == 6);
}

TEST_CASE("wrong arguments of a sheet are refused") {
  Picture p({4, 4});
  SerialExecutor executor;
  CHECK(build(p, {0.0F, 10.0F}).code() == StatusCode::invalid_argument);
  CHECK(build(p, {2.0F, 1.0F}).code() == StatusCode::invalid_argument);
  CHECK(build(p, {kNaN, 1.0F}).code() == StatusCode::invalid_argument);
  CHECK(build(p, {1.0F, std::numeric_limits<float>::infinity()}).code() == StatusCode::invalid_argument);
  SheetLayer wrong = p.sheet.view();
  wrong.quads = wrong.quads.sub(0, 0, {2, 3});
  CHECK(validate(wrong).code() == StatusCode::shape_mismatch);
  CHECK(build_sheet({}, p.depth.cview().sub(0, 0, {3, 4}), p.surface.cview(), p.intrinsics, p.sheet.view(), executor)
            .code() == StatusCode::shape_mismatch);
  CHECK(build_sheet({}, p.depth.cview(), {}, Intrinsics{}, p.sheet.view(), executor).code() ==
        StatusCode::invalid_argument);
  CHECK(build_sheet({}, {}, {}, p.intrinsics, SheetLayer{}, executor).code() == StatusCode::invalid_argument);
}

TEST_CASE("pruning deletes exactly the faces with an uncertain vertex") {
  RandomStream random(2, RandomPurpose::test, 0, 0, 0, 0);
  SerialExecutor executor;
  for (int trial = 0; trial < 50; ++trial) {
    Picture p({9, 7});
    for (int y = 0; y < 7; ++y) {
      for (int x = 0; x < 9; ++x) {
        p.depth(x, y) = random.uniform(1.0F, 20.0F);
        p.uncertain(x, y) = random.uniform() < 0.15F ? 255 : 0;
      }
    }
    REQUIRE(build(p).ok());
    const Indexed before = index(p.sheet.view());
    std::size_t expected = 0;
    for (const Face& f : before.faces) {
      bool sure = true;
      for (const std::uint32_t v : {f.a, f.b, f.c}) {
        sure = sure && p.uncertain(static_cast<int>(before.pixels[v] % 9), static_cast<int>(before.pixels[v] / 9)) == 0;
      }
      expected += sure ? 1U : 0U;
    }
    REQUIRE(prune({}, p.uncertain.cview(), {}, p.sheet.view(), executor).ok());
    CHECK(index(p.sheet.view()).faces.size() == expected);
    CHECK(check_layer(p.sheet.view()).faces == expected);
  }
}

TEST_CASE("pruning may keep faces inside one object, but not across 3 m nor across labels") {
  Picture p({4, 2});
  SerialExecutor executor;
  p.rectangle(0, 0, 1, 1, label::car, 5.0F);
  p.rectangle(2, 0, 3, 1, label::truck, 5.0F);
  p.doubt(0, 0, 3, 1);
  PruneParams params;
  params.policy = PrunePolicy::keep_within_foreground;
  REQUIRE(build(p).ok());
  REQUIRE(prune(params, p.uncertain.cview(), p.labels.cview(), p.sheet.view(), executor).ok());
  CHECK(p.sheet.quads(0, 0) != 0);
  CHECK(p.sheet.quads(1, 0) == 0);
  CHECK(p.sheet.quads(2, 0) != 0);
  p.depth(0, 0) = 8.0F;  // 3 m from the others is not less than 3 m; the anti-diagonal spares the lower face
  REQUIRE(build(p).ok());
  REQUIRE(prune(params, p.uncertain.cview(), p.labels.cview(), p.sheet.view(), executor).ok());
  CHECK(p.sheet.quads(0, 0) == (kQuadAntiDiagonal | kQuadLowerFace));
  CHECK(prune(params, p.uncertain.cview(), {}, p.sheet.view(), executor).code() == StatusCode::shape_mismatch);
  params.max_spread_m = kNaN;
  CHECK(prune(params, p.uncertain.cview(), p.labels.cview(), p.sheet.view(), executor).code() ==
        StatusCode::invalid_argument);
}
