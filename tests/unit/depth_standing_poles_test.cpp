// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/things/standing_poles.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdlib>
#include <limits>

#include "fixture.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

constexpr Shape kShape{160, 200};
constexpr float kHouse_m = 40.0F;
constexpr float kHeight_m = 1.4F;
constexpr float kMast_m = 12.0F;

// A road under a camera 1.4 m above it, level or tilted down, before a house at 40 m. A mast may stand on it.
struct Street {
  Intrinsics k{400, 400, 80, 60};
  GroundPlane ground;
  Image<float> depth{kShape, kHouse_m}, surface{kShape};
  Image<Label> labels{kShape, label::building};

  explicit Street(float pitch_rad = 0.0F) {
    ground = {{0, -std::cos(pitch_rad), -std::sin(pitch_rad)}, kHeight_m, 1.0F};
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        const float fall = depth_detail::fall_of_ray(ground, k, x, y);
        if (!(fall * kHouse_m > kHeight_m)) continue;
        depth(x, y) = kHeight_m / fall;
        labels(x, y) = label::road;
      }
    }
  }
  // Where something z metres away meets the road.
  [[nodiscard]] int row_at(float z) const {
    int y = 0;
    while (y + 1 < kShape.height && depth(0, y + 1) > z) ++y;
    return y;
  }
  void put(int x0, int y0, int x1, int y1, Label label, float z) {
    labels.fill_rectangle(x0, y0, x1, y1, label);
    depth.fill_rectangle(x0, y0, x1, y1, z);
  }
  [[nodiscard]] Status run(const StandingPolesParams& params = {}) {
    surface = depth;
    npsim_test::Scratch memory(stand_poles_workspace_bytes(kShape));
    return stand_poles(params, depth.cview(), labels.cview(), k, ground, surface.view(), memory.workspace());
  }
  // Largest relative distance from `z` on the columns and rows given.
  [[nodiscard]] float error(int x0, int y0, int x1, int y1, float z) const {
    float most = 0.0F;
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) most = std::fmax(most, std::fabs(surface(x, y) / z - 1.0F));
    }
    return most;
  }
};

}  // namespace

TEST_CASE("standing poles: a mast measured as the house behind it but for a piece stands where foot and piece say") {
  Street s;
  const int foot = s.row_at(kMast_m);
  s.put(40, 10, 46, foot + 1, label::pole, 0.97F * kHouse_m);
  s.put(40, 70, 46, 88, label::pole, 1.08F * kMast_m);
  REQUIRE(s.run().ok());
  CHECK(s.error(40, 10, 46, foot + 1, 1.08F * kMast_m) < 0.01F);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (s.labels(x, y) != label::pole) REQUIRE(s.surface(x, y) == s.depth(x, y));
    }
  }
}

TEST_CASE("standing poles: a mast of which nothing was measured stands where its foot meets the road") {
  Street s;
  const int foot = s.row_at(kMast_m);
  s.put(40, 10, 46, foot + 1, label::pole, kHouse_m);
  s.put(40, 50, 46, 53, label::pole, 1.08F * kMast_m);  // by chance
  REQUIRE(s.run().ok());
  CHECK(s.error(40, 10, 46, foot + 1, kMast_m) < 0.02F);
}

TEST_CASE("standing poles: where a label ends too high, what most of the mast measures goes before its foot") {
  Street s;
  const int short_foot = s.row_at(1.5F * kMast_m);
  s.put(40, 10, 46, short_foot + 1, label::pole, kMast_m);
  s.put(40, 10, 46, 20, label::pole, kHouse_m);
  REQUIRE(s.run().ok());
  CHECK(s.error(40, 10, 46, short_foot + 1, kMast_m) < 0.01F);
}

TEST_CASE("standing poles: over a car there is no foot, and only a part that agrees moves the rest") {
  for (const bool agrees : {false, true}) {
    CAPTURE(agrees);
    Street s;
    const int foot = s.row_at(kMast_m);
    for (int y = 10; y <= foot - 20; ++y) {
      s.put(40, y, 46, y + 1, label::pole,
            agrees && y % 2 == 0 ? kMast_m : 8.0F * std::pow(1.012F, static_cast<float>(y)));
    }
    s.put(30, foot - 19, 60, foot + 1, label::car, 9.0F);
    REQUIRE(s.run().ok());
    if (agrees) {
      CHECK(s.error(40, 10, 46, foot - 19, kMast_m) < 0.06F);
    } else {
      for (int y = 10; y <= foot - 20; ++y) REQUIRE(s.surface(42, y) == s.depth(42, y));
    }
  }
}

TEST_CASE(
    "standing poles: a sign on the mast does not part it and keeps its own depth; a slanted end of the label is no "
    "foot") {
  Street s;
  const int foot = s.row_at(kMast_m);
  s.put(40, 10, 46, foot + 1, label::pole, kHouse_m);
  s.put(34, 30, 52, 48, label::traffic_sign, 12.4F);
  for (int i = 0; i < 5; ++i) s.put(40, foot + 1 + i, 45 - i, foot + 2 + i, label::pole, kHouse_m);
  REQUIRE(s.run().ok());
  CHECK(s.error(40, 10, 46, 30, kMast_m) < 0.07F);
  CHECK(s.error(40, 48, 46, foot, kMast_m) < 0.07F);
  CHECK(s.surface(43, 40) == 12.4F);
}

TEST_CASE(
    "standing poles: over a car, what most of a mast measures is not its own where it is what is seen beside it") {
  Street s;
  const int foot = s.row_at(kMast_m);
  s.put(40, 10, 46, foot - 19, label::pole, 0.97F * kHouse_m);
  s.put(40, 50, 46, 75, label::pole, kMast_m);  // of 77 rows
  s.put(30, foot - 19, 60, foot + 1, label::car, 9.0F);
  REQUIRE(s.run().ok());
  CHECK(s.error(40, 10, 46, foot - 19, kMast_m) < 0.01F);
}

TEST_CASE(
    "standing poles: a mast whose foot a wall hides keeps what was measured of it, though there is ground below the "
    "wall") {
  Street s;
  const int edge = s.row_at(6.0F);
  s.put(30, s.row_at(8.0F), 60, edge + 1, label::terrain, 6.0F);  // a mound before it
  s.put(40, 10, 46, s.row_at(8.0F), label::pole, kMast_m);
  REQUIRE(s.run().ok());
  CHECK(s.error(40, 10, 46, s.row_at(8.0F), kMast_m) < 0.01F);
}

TEST_CASE(
    "standing poles: a post before a farther mast ends where that one has its foot, or behind a gap another width") {
  for (const bool on_ground : {true, false}) {
    CAPTURE(on_ground);
    Street s;
    const int top = s.row_at(9.0F) - 40;
    const int x1 = on_ground ? 46 : 41;  // of the farther one
    if (!on_ground) s.put(30, top - 6, 60, top, label::wall, 20.0F);
    s.put(38, 10, x1, top - 6, label::pole, kMast_m);
    s.put(37, top, 46, s.row_at(6.0F) + 1, label::pole, 6.0F);
    REQUIRE(s.run().ok());
    CHECK(s.error(38, 10, x1, top - 6, kMast_m) < 0.01F);
    CHECK(s.error(37, top, 46, s.row_at(6.0F) + 1, 6.0F) < 0.02F);
  }
}

TEST_CASE("standing poles: a beam on a mast stays and does not keep the mast from standing") {
  Street s;
  const int foot = s.row_at(kMast_m);
  s.put(10, 20, 90, 30, label::polegroup, 13.0F);
  s.put(40, 30, 46, foot + 1, label::polegroup, kHouse_m);
  REQUIRE(s.run().ok());
  CHECK(s.error(40, 30, 46, foot + 1, kMast_m) < 0.02F);
  CHECK(s.error(10, 20, 90, 30, 13.0F) < 1e-6F);
}

TEST_CASE("standing poles: a low arm is no mast, however near its ground is") {
  Street s;
  const int row = s.row_at(9.0F);
  s.put(20, row - 2, 32, row + 1, label::pole, 13.0F);
  REQUIRE(s.run().ok());
  CHECK(s.surface(25, row - 1) == 13.0F);
}

TEST_CASE("standing poles: a vertical that leans in the picture is followed behind what hides it") {
  Street s(0.6F);
  const int foot = 190;
  const Vec3f low = unproject_pixel(s.k, 130, foot, s.depth(130, foot));
  int top_x = 130;
  int top_y = foot;
  for (float h = 0.0F; h < 3.0F; h += 0.001F) {
    const Vec2f at = project(s.k, low + s.ground.up * h);
    if (!s.depth.cview().contains(static_cast<int>(at.x) + 2, static_cast<int>(at.y))) break;
    top_x = static_cast<int>(at.x);
    top_y = static_cast<int>(at.y);
    const bool hidden = top_y > foot - 145 && top_y < foot - 120;
    s.put(top_x, top_y, top_x + 2, top_y + 1, hidden ? label::building : label::pole, kHouse_m);
  }
  REQUIRE(top_y < foot - 150);
  REQUIRE(std::abs(top_x - 130) >= 12);
  REQUIRE(s.run().ok());
  for (int y = top_y + 1; y <= foot; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (s.labels(x, y) == label::pole) REQUIRE(s.surface(x, y) < 3.0F);
    }
  }
}

TEST_CASE("standing poles: under a camera that looks down a mast stays upright") {
  Street s(0.15F);
  const int foot = s.row_at(kMast_m);
  s.put(78, 10, 82, foot + 1, label::pole, kHouse_m);
  REQUIRE(s.run().ok());
  const Vec3f low = unproject_pixel(s.k, 80, foot, s.surface(80, foot));
  const Vec3f high = unproject_pixel(s.k, 80, 10, s.surface(80, 10));
  CHECK(s.surface(80, 10) < s.surface(80, foot) - 0.1F);  // it comes nearer along the axis of the camera
  CHECK(dot(normalized(high - low), s.ground.up) > 0.999F);
}

TEST_CASE("standing poles: what lies, what is wide and holes stay") {
  Street s;
  const int foot = s.row_at(kMast_m);
  s.put(10, 40, 70, 44, label::pole, 13.0F);                  // an arm
  s.put(90, 20, 150, foot + 1, label::pole, 13.0F);           // 2 m wide
  s.put(20, foot - 30, 24, foot + 1, label::pole, kHouse_m);  // a post
  s.depth(21, foot - 10) = 0.0F;
  REQUIRE(s.run().ok());
  CHECK(s.surface(30, 41) == 13.0F);
  CHECK(s.surface(120, 60) == 13.0F);
  CHECK(s.surface(21, foot - 10) == 0.0F);
  CHECK(s.error(22, foot - 30, 24, foot + 1, kMast_m) < 0.02F);
}

TEST_CASE("standing poles: no labels or disabled, nothing changes; bad parameters and shapes are refused") {
  Street s;
  s.put(40, 10, 46, s.row_at(kMast_m) + 1, label::pole, kHouse_m);
  StandingPolesParams params;
  params.enabled = false;
  REQUIRE(s.run(params).ok());
  CHECK(s.surface(42, 50) == kHouse_m);
  s.surface = s.depth;
  npsim_test::Scratch memory(stand_poles_workspace_bytes(kShape));
  REQUIRE(stand_poles({}, s.depth.cview(), {}, s.k, s.ground, s.surface.view(), memory.workspace()).ok());
  CHECK(s.surface(42, 50) == kHouse_m);
  params.enabled = true;
  params.tolerance = std::numeric_limits<float>::quiet_NaN();
  CHECK(s.run(params).code() == StatusCode::invalid_argument);
  Image<float> small({8, 8});
  CHECK(stand_poles({}, s.depth.cview(), s.labels.cview(), s.k, s.ground, small.view(), memory.workspace()).code() ==
        StatusCode::shape_mismatch);
}
