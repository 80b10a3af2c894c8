// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/things/street_furniture.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

constexpr Shape kShape{160, 120};
constexpr float kPole_m = 12.0F;

// Before a wall at 40 m stand, 12 m away, a mast 8 px wide with an arm 4 px high, a sign, a column 1.4 m wide and a sign
// that lies on a plane of its own.
struct Street {
  Intrinsics k{400, 400, 80, 60};
  Image<float> depth{kShape, 40.0F}, surface{kShape};
  Image<Vec3f> normals{kShape, Vec3f{0, 0, -1}};
  Image<Label> labels{kShape, label::building};
  Image<std::uint16_t> plane_of{kShape};
  PlanarSegment plane;

  Street() {
    put(20, 10, 28, 118, label::pole);
    put(28, 10, 80, 14, label::pole);
    put(90, 30, 106, 46, label::traffic_sign);
    put(110, 60, 157, 118, label::pole);
    put(120, 20, 136, 36, label::traffic_sign);
    for (int y = 20; y < 36; ++y) {
      for (int x = 120; x < 136; ++x) plane_of(x, y) = 1;
    }
    plane.q = {0, 0, 1.0F / kPole_m};
    plane.normal = {0, 0, -1};
    plane.support_px = 3000.0F;  // 2.7 m2
  }
  void put(int x0, int y0, int x1, int y1, Label label) {
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) {
        RandomStream random(9, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y / 3),
                            static_cast<std::uint32_t>(x / 3));
        depth(x, y) = kPole_m + 3.0F * (random.uniform() - 0.5F);
        normals(x, y) = normalized(Vec3f{random.uniform() - 0.5F, random.uniform() - 0.5F, -0.3F});
        labels(x, y) = label;
      }
    }
  }
  template <class Executor>
  [[nodiscard]] Status run(Executor& executor, const StreetFurnitureParams& params = {}) {
    surface = depth;
    PlanarMap planes;
    planes.segments = Span<PlanarSegment>(&plane, 1);
    planes.of = plane_of.view();
    return shape_furniture(params, depth.cview(), ObjectMap{labels.cview(), {}}, planes, k, Vec3f{0, -1, 0},
                           normals.view(), surface.view(), executor);
  }
};

}  // namespace

TEST_CASE(
    "street furniture: a mast and its arm lose their noise and are round, from left to right and from top to bottom") {
  Street s;
  s.depth(23, 60) = 0.0F;  // a hole stays one
  SerialExecutor serial;
  REQUIRE(s.run(serial).ok());
  CHECK(s.surface(23, 60) == 0.0F);
  for (int y = 20; y < 110; ++y) {
    for (int x = 20; x < 28; ++x) {
      if (x == 23 && y == 60) continue;
      REQUIRE(std::fabs(s.surface(x, y) - kPole_m) < 0.6F);
      REQUIRE(length(s.normals(x, y)) == doctest::Approx(1.0).epsilon(1e-5));
      REQUIRE(std::fabs(s.normals(x, y).y) < 1e-5F);
    }
    CHECK(s.normals(20, y).x < -0.6F);
    CHECK(s.normals(27, y).x > 0.6F);
    CHECK(s.normals(24, y).z < -0.9F);
  }
  for (int x = 40; x < 76; ++x) {
    CHECK(s.normals(x, 10).y < -0.6F);
    CHECK(s.normals(x, 13).y > 0.6F);
  }
}

TEST_CASE("street furniture: a sign is level and faces the camera; a wide column, a plane's sign and the wall stay") {
  Street s;
  const Image<Vec3f> before = s.normals;
  SerialExecutor serial;
  REQUIRE(s.run(serial).ok());
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (s.labels(x, y) == label::traffic_sign && s.plane_of(x, y) == 0) {
        const Vec3f ray = unproject_pixel(s.k, x, y, 1.0F);
        REQUIRE(s.normals(x, y).y == 0.0F);
        REQUIRE(dot(s.normals(x, y), normalized(ray)) < -0.99F);
        REQUIRE(std::fabs(s.surface(x, y) - kPole_m) < 0.6F);
      } else if (s.labels(x, y) != label::pole || x >= 110) {
        REQUIRE(s.normals(x, y) == before(x, y));
        REQUIRE(s.surface(x, y) == s.depth(x, y));
      }
    }
  }
}

TEST_CASE("street furniture: a small sign is one plate, also where parts of it lie on planes of noise") {
  Street s;
  s.plane.support_px = 1900.0F;                                    // 1.7 m2
  for (int y = 20; y < 36; ++y) s.depth(120, y) = 1.2F * kPole_m;  // matching bends its rim
  SerialExecutor serial;
  REQUIRE(s.run(serial).ok());
  for (int y = 20; y < 36; ++y) {
    for (int x = 120; x < 136; ++x) {
      REQUIRE(std::fabs(s.surface(x, y) - kPole_m) < 0.6F);
      REQUIRE(s.normals(x, y).y == 0.0F);
    }
  }
}

TEST_CASE(
    "street furniture: a hoarding that hangs is level and faces the camera; a wide one and a bin stay as measured") {
  Street s;
  s.put(40, 50, 65, 90, label::static_object);   // .75 m
  s.put(68, 50, 108, 90, label::static_object);  // 1.2 m
  s.put(1, 50, 17, 90, label::static_object);    // .5 m
  for (int x = 1; x < 17; ++x) {
    for (int y = 90; y < kShape.height; ++y) s.labels(x, y) = label::sidewalk;
  }
  const Street before = s;
  SerialExecutor serial;
  REQUIRE(s.run(serial).ok());
  const auto stays = [&](int x, int y) {
    return s.surface(x, y) == before.depth(x, y) && s.normals(x, y) == before.normals(x, y);
  };
  for (int y = 50; y < 90; ++y) {
    CAPTURE(y);
    for (int x = 40; x < 65; ++x) {
      REQUIRE(std::fabs(s.surface(x, y) - kPole_m) < 0.6F);
      REQUIRE(std::fabs(s.normals(x, y).y) < 1e-5F);
      REQUIRE(s.normals(x, y).z < -0.98F);
    }
    for (int x = 68; x < 108; ++x) REQUIRE(stays(x, y));
    for (int x = 1; x < 17; ++x) REQUIRE(stays(x, y));
  }
}

TEST_CASE(
    "street furniture: the top of a far mast takes nothing of the longer post before the car that hides the rest") {
  Street s;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 40; x < 60; ++x) {
      s.labels(x, y) = y >= 34 && y < 40 ? label::car : label::building;
      s.depth(x, y) = y >= 34 && y < 40 ? 16.0F : 40.0F;
    }
  }
  s.put(46, 40, 54, 110, label::pole);  // the post, 12 m away
  for (int y = 24; y < 34; ++y) {
    for (int x = 46; x < 54; ++x) {
      s.labels(x, y) = label::pole;
      s.depth(x, y) = 30.0F;
    }
  }
  SerialExecutor serial;
  REQUIRE(s.run(serial).ok());
  for (int y = 24; y < 34; ++y) {
    for (int x = 46; x < 54; ++x) CHECK(s.surface(x, y) == doctest::Approx(30).epsilon(1e-5));
  }
  for (int y = 50; y < 100; ++y) CHECK(s.surface(50, y) == doctest::Approx(kPole_m).epsilon(0.03));
}

TEST_CASE("street furniture: a large sign half of which has another depth is one plate, without stripes of both") {
  for (const int rows : {33, 34, 35, 36, 37}) {
    Street s;
    for (int y = 20; y < 90; ++y) {
      for (int x = 30; x < 126; ++x) {
        s.labels(x, y) = label::traffic_sign;
        s.plane_of(x, y) = 0;
        s.depth(x, y) = y < 20 + rows ? 29.0F : 34.0F;
      }
    }
    SerialExecutor serial;
    StreetFurnitureParams params;
    params.reach_m = 6.0F;  // all of it from every row
    REQUIRE(s.run(serial, params).ok());
    CAPTURE(rows);
    for (int y = 20; y < 90; ++y) CHECK(s.surface(60, y) == s.surface(60, 20));
  }
}

TEST_CASE("street furniture: a beam one pixel high and as wide as the picture loses its noise, in any row") {
  for (const int row : {50, 51, 52, 53}) {
    Street s;
    s.put(2, row, 158, row + 1, label::pole);
    SerialExecutor serial;
    StreetFurnitureParams params;
    params.reach_m = 30.0F;  // so far that every second column counts
    REQUIRE(s.run(serial, params).ok());
    CAPTURE(row);
    for (int x = 30; x < 80; ++x) CHECK(std::fabs(s.surface(x, row) - s.surface(30, row)) < 0.1F);
  }
}

TEST_CASE("street furniture: a large sign that is turned away keeps its plane") {
  Street s;
  s.plane.normal = normalized(Vec3f{-0.866F, 0, -0.5F});
  s.plane.q = s.plane.normal * (-1.0F / (kPole_m * 0.5F));
  s.plane.support_px = 2100.0F;  // at 12 m it would be 1.9 m2
  const Image<Vec3f> before = s.normals;
  SerialExecutor serial;
  REQUIRE(s.run(serial).ok());
  for (int y = 20; y < 36; ++y) REQUIRE(s.normals(121, y) == before(121, y));
}

TEST_CASE("street furniture: no pixel leaves what its thing measured, in any order of work; bad input is refused") {
  Street a;
  Street b;
  SerialExecutor serial;
  npsim_test::BackwardExecutor backward;
  REQUIRE(a.run(serial).ok());
  REQUIRE(b.run(backward).ok());
  CHECK(a.normals == b.normals);
  CHECK(a.surface == b.surface);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (a.labels(x, y) != label::building) REQUIRE(std::fabs(a.surface(x, y) - kPole_m) < 1.501F);
    }
  }
  CHECK(!(a.surface == a.depth));
  StreetFurnitureParams params;
  params.reach_m = 0.0F;
  CHECK(a.run(serial, params).code() == StatusCode::invalid_argument);
  params = StreetFurnitureParams{};
  params.enabled = false;
  REQUIRE(a.run(serial, params).ok());
  CHECK(a.surface == a.depth);
  a.labels = Image<Label>(Shape{4, 4});
  CHECK(a.run(serial).code() == StatusCode::shape_mismatch);
}
