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
constexpr int kTop = 100;  // the row where the meadow ends, at 20 m

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

  float slope;
  Image<float> depth{kShape, 0.0F};
  Image<Label> labels{kShape, label::terrain};
};

}  // namespace

TEST_CASE("meadows: tall grass is soil, also where a slope lifts it by a metre; what stands half a metre stays") {
  for (const float slope : {0.0F, 0.1F}) {
    CAPTURE(slope);
    Meadow m(slope);
    m.put(label::vegetation, 0.35F, 60, 100, 140, 150);
    m.put(label::building, 0.35F, 110, 112, 120, 122);
    m.put(label::vegetation, slope > 0.0F ? 0.7F : 0.45F, 200, 240, 140, 150);  // before soil that lies higher
    m.put(label::building, slope > 0.0F ? 0.7F : 0.45F, 260, 264, 130, 170);
    m.tell();
    CHECK(m.all(label::terrain, 60, 100, 140, 150));
    CHECK(m.all(label::terrain, 110, 112, 120, 122));
    CHECK(m.all(label::vegetation, 200, 240, 140, 150));
    CHECK(m.all(label::building, 260, 264, 130, 170));
    CHECK(m.all(label::vegetation, 0, kShape.width, 0, kTop));
  }
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
