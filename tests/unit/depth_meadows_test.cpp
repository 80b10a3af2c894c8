// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/given/meadows.hpp"

#include <doctest/doctest.h>

#include <algorithm>

#include "fixture.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

constexpr Shape kShape{480, 270};
constexpr Intrinsics kCamera{400, 400, 240, 60};
constexpr GroundPlane kGround{{0, -1, 0}, 1.5F, 0.9F};
constexpr int kTop = 100;  // the row where the meadow ends, at 15 m

[[nodiscard]] float fall(int y) { return (static_cast<float>(y) - kCamera.cy) / kCamera.fy; }

// A meadow below a hedge; it rises by `slope` from 5 m off on.
struct Meadow {
  explicit Meadow(float rise = 0.0F) : slope(rise) {
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        labels(x, y) = y < kTop ? label::vegetation : label::terrain;
        depth(x, y) = at(std::max(y, kTop), 0.0F);
      }
    }
  }
  // An upright thing: all of it as far away as the meadow in the row of its foot.
  void stand(Label l, int x0, int x1, float distance_m, float height_m) {
    const float ground_m = kGround.camera_height_m - (distance_m - 5.0F) * slope;
    const auto row = [&](float below_m) { return static_cast<int>(kCamera.cy + kCamera.fy * below_m / distance_m); };
    for (int y = row(ground_m - height_m); y < row(ground_m); ++y) {
      for (int x = x0; x < x1; ++x) {
        labels(x, y) = l;
        depth(x, y) = distance_m;
      }
    }
  }
  // Where the ray of a row is that far above the meadow.
  [[nodiscard]] float at(int y, float above_m) const {
    return (kGround.camera_height_m - above_m + 5.0F * slope) / (fall(y) + slope);
  }
  void put(Label l, float above_m, int x0, int x1, int y0, int y1) {
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) {
        labels(x, y) = l;
        depth(x, y) = at(y, above_m);
      }
    }
  }
  void hide(int x0, int x1, int y0, int y1) {  // from what measures
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) depth(x, y) = 0.0F;
    }
  }
  void tell() {
    npsim_test::Scratch scratch(refine_detail::tell_meadows_workspace_bytes(kShape) + kWorkspaceAlignment);
    REQUIRE(refine_detail::tell_meadows(depth.cview(), kCamera, kGround, labels.view(), scratch.workspace()).ok());
  }
  [[nodiscard]] bool all(Label l, int x0, int x1, int y0, int y1) const {
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) {
        if (labels(x, y) != l) return false;
      }
    }
    return true;
  }

  [[nodiscard]] bool all_of(const Image<Label>& other) const {
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        if (labels(x, y) != other(x, y)) return false;
      }
    }
    return true;
  }

  float slope;
  Image<float> depth{kShape, 0.0F};
  Image<Label> labels{kShape, label::terrain};
};

}  // namespace

TEST_CASE(
    "meadows: tall grass is soil, also where a slope lifts it by a metre; what lies a third of a metre up stays") {
  for (const float slope : {0.0F, 0.1F}) {
    CAPTURE(slope);
    Meadow m(slope);
    m.put(label::vegetation, 0.27F, 60, 100, 140, 150);
    m.put(label::building, 0.27F, 110, 112, 120, 122);
    m.put(label::vegetation, 0.33F, 200, 240, 140, 150);
    m.put(label::building, 0.33F, 260, 264, 130, 170);
    m.tell();
    CHECK(m.all(label::terrain, 60, 100, 140, 150));
    CHECK(m.all(label::terrain, 110, 112, 120, 122));
    CHECK(m.all(label::vegetation, 200, 240, 140, 150));
    CHECK(m.all(label::building, 260, 264, 130, 170));
    CHECK(m.all(label::vegetation, 0, kShape.width, 0, kTop));
  }
}

TEST_CASE("meadows: a dog stands, near and far, on level soil and where it rises behind it; half as high is a tuft") {
  for (const float slope : {0.0F, 0.03F, 0.1F}) {
    for (const float distance_m : {5.5F, 7.0F, 8.5F}) {
      CAPTURE(slope);
      CAPTURE(distance_m);
      Meadow m(slope);
      m.stand(label::building, 200, 216, distance_m, 0.5F);
      const Image<Label> before = m.labels;
      m.stand(label::building, 300, 316, distance_m, 0.25F);
      m.tell();
      CHECK(m.all_of(before));
    }
  }
}

TEST_CASE(
    "meadows: a child on dry grass stays and the grass is soil; a point at its foot does not tell that a thing is "
    "low") {
  Meadow m;
  m.put(label::road, 0.0F, 150, 220, 155, 205);
  m.stand(label::building, 180, 190, 6.0F, 0.8F);
  m.put(label::building, 0.35F, 300, 320, 120, 170);
  m.hide(300, 320, 120, 170);
  m.depth(310, 140) = m.at(140, 0.1F);
  m.put(label::vegetation, 0.1F, 340, 360, 140, 170);
  m.hide(340, 360, 140, 170);
  m.depth(345, 158) = m.at(158, 0.1F);
  m.tell();
  CHECK(m.all(label::terrain, 150, 180, 155, 205));
  CHECK(m.all(label::terrain, 190, 220, 155, 205));
  CHECK(m.all(label::building, 180, 190, 120, 155));
  CHECK(m.all(label::building, 300, 320, 120, 170));
  CHECK(m.all(label::terrain, 340, 360, 140, 170));
}

TEST_CASE("meadows: a path and a lane seen between two meadows are longer than patches and stay, from any border") {
  Meadow m;
  m.put(label::road, 0.0F, 100, 160, 120, kShape.height);
  m.put(label::rail_track, 0.0F, 250, 300, 108, 135);  // 8 to 12.5 m
  m.put(label::road, 0.0F, 350, 400, 150, 180);        // 5 to 6.7 m
  m.put(label::road, 0.0F, 170, 230, 122, 255);        // 3 to 9.7 m: half of it far from its median
  m.tell();
  CHECK(m.all(label::road, 100, 160, 120, kShape.height));
  CHECK(m.all(label::rail_track, 250, 300, 108, 135));
  CHECK(m.all(label::terrain, 350, 400, 150, 180));
  CHECK(m.all(label::road, 170, 230, 122, 255));
}

TEST_CASE("meadows: what becomes soil lifts no soil around what comes later; soil of no height tells nothing") {
  for (const bool below : {false, true}) {
    CAPTURE(below);
    Meadow m;
    const int first = below ? 148 : 132;
    m.put(label::vegetation, 0.28F, 196, 224, first, first + 8);
    m.put(label::building, 0.34F, 200, 220, 141, 147);
    m.tell();
    CHECK(m.all(label::terrain, 196, 224, first, first + 8));
    CHECK(m.all(label::building, 200, 220, 141, 147));
  }
  Meadow m;
  m.stand(label::building, 200, 216, 6.0F, 1.2F);
  for (int y = 120; y < 240; ++y) {
    m.depth(217, y) = 3e38F;
  }
  const Image<Label> before = m.labels;
  m.tell();
  CHECK(m.all_of(before));
}

TEST_CASE("meadows: no wrong point hides a dog, tells that a thing is low or makes a path of dry grass") {
  for (const float wrong_m : {9.0F, 30.0F, 100.0F, 1e4F, 1e10F}) {
    CAPTURE(wrong_m);
    Meadow m;
    m.stand(label::building, 200, 226, 6.0F, 0.5F);
    const Image<Label> before = m.labels;
    m.depth(228, 155) = wrong_m;
    m.tell();
    CHECK(m.all_of(before));
  }
  Meadow m;
  m.put(label::road, 0.0F, 100, 130, 150, 170);
  m.depth(110, 160) = 60.0F;
  m.put(label::building, 0.1F, 300, 315, 110, 150);
  m.hide(300, 315, 110, 148);
  m.depth(307, 130) = 0.5F;
  m.tell();
  CHECK(m.all(label::terrain, 100, 130, 150, 170));
  CHECK(m.all(label::building, 300, 315, 110, 150));
}

TEST_CASE("meadows: the border of the picture cuts none; what touches a road, hedge or both sides of it stays") {
  Meadow m;
  m.put(label::rail_track, 0.0F, 0, 40, 250, 270);
  m.put(label::road, 0.1F, 100, 140, 200, 210);  // dry grass, beside which another kind lies
  m.put(label::rail_track, 0.1F, 140, 150, 200, 210);
  m.put(label::vegetation, 0.2F, 200, 220, kTop, 110);
  m.put(label::road, 0.0F, 250, 330, 150, 154);  // a sixth of the width: a path
  m.put(label::road, 0.0F, 350, 429, 150, 154);  // less
  m.tell();
  CHECK(m.all(label::terrain, 0, 40, 250, 270));
  CHECK(m.all(label::terrain, 100, 150, 200, 210));
  CHECK(m.all(label::vegetation, 200, 220, kTop, 110));
  CHECK(m.all(label::road, 250, 330, 150, 154));
  CHECK(m.all(label::terrain, 350, 429, 150, 154));
}

TEST_CASE("meadows: a fifth of a piece's points may be a stalk's; what was not measured, or beside nothing, stays") {
  Meadow m;
  m.put(label::vegetation, 0.2F, 60, 100, 140, 150);
  m.put(label::vegetation, 1.0F, 70, 78, 140, 150);  // a fifth
  m.put(label::vegetation, 0.2F, 200, 240, 140, 150);
  m.put(label::vegetation, 1.0F, 210, 219, 140, 150);
  m.put(label::building, 0.0F, 300, 310, 140, 150);
  m.put(label::building, 0.0F, 420, 430, 200, 210);
  for (int y = 130; y < 220; ++y) {
    for (int x = 300; x < kShape.width; ++x) {
      if (x < 400 ? m.labels(x, y) == label::building : m.labels(x, y) == label::terrain) m.depth(x, y) = 0.0F;
    }
  }
  m.tell();
  CHECK(m.all(label::terrain, 60, 100, 140, 150));
  CHECK(m.all(label::vegetation, 200, 240, 140, 150));
  CHECK(m.all(label::building, 300, 310, 140, 150));
  CHECK(m.all(label::building, 420, 430, 200, 210));
}
