// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/measured/beyond_range.hpp"

#include <doctest/doctest.h>

#include "fixture.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

constexpr Shape kShape{64, 60};

// Houses in rows 0 to 3 that filling has put at 20 m, and the road below them, measured at 8 m.
struct Street {
  Image<Label> labels{kShape, label::road};
  Image<float> measured{kShape};
  Image<float> depth{kShape};

  Street() {
    for (int x = 0; x < kShape.width; ++x) {
      for (int y = 0; y < kShape.height; ++y) {
        const bool house = y < 4;
        if (house) labels(x, y) = label::building;
        depth(x, y) = house ? 20.0F : 8.0F;
        if (!house) measured(x, y) = 8.0F;
      }
    }
  }
  void before(int x, Label l, float z) {
    labels(x, 4) = l;
    depth(x, 4) = measured(x, 4) = z;
  }
  void run(const BeyondRangeParams& params = {}) {
    npsim_test::Scratch memory(place_beyond_range_workspace_bytes(kShape));
    REQUIRE(place_beyond_range(params, measured.cview(), labels.cview(), depth.view(), memory.workspace()).ok());
  }
};

}  // namespace

TEST_CASE(
    "beyond range: houses that were not measured stand behind the farthest thing before them, up to 4 columns off") {
  Street s;
  s.before(3, label::vegetation, 70.0F);
  s.before(4, label::car, 31.0F);
  s.run();
  for (int x = 0; x < kShape.width; ++x) {
    for (int y = 0; y < kShape.height; ++y) {
      CAPTURE(x);
      const float was = y >= 4 ? s.measured(x, y) : (x <= 7 ? 70.0F : (x == 8 ? 31.0F : 20.0F));
      CHECK(s.depth(x, y) == was);
    }
  }
}

TEST_CASE(
    "beyond range: above what was measured of a house nothing is nearer, and the run of hidden columns ends there") {
  Street s;
  s.before(3, label::vegetation, 70.0F);
  for (int y = 1; y < 4; ++y) s.measured(6, y) = s.depth(6, y) = 40.0F;
  s.labels(6, 4) = label::wall;  // low, before the house, and between two rows of the laser
  s.depth(6, 4) = 6.0F;
  s.measured(6, 4) = 0.0F;
  s.run();
  CHECK(s.depth(5, 0) == 70.0F);
  CHECK(s.depth(6, 0) == 0.95F * 40.0F);
  CHECK(s.depth(6, 2) == 40.0F);
  CHECK(s.depth(6, 4) == 6.0F);
  CHECK(s.depth(7, 0) == 20.0F);  // what is before it is nearer than it is
}

TEST_CASE("beyond range: two samples of what a laser saw past an edge do not make a column measured") {
  Street s;
  s.before(3, label::vegetation, 70.0F);
  for (int y = 2; y < 4; ++y) s.measured(4, y) = s.depth(4, y) = 12.0F;
  s.run();
  CHECK(s.depth(4, 0) == 70.0F);
  CHECK(s.depth(4, 3) == 12.0F);
}

TEST_CASE(
    "beyond range: a bound holds as far as a sixteenth of the image, and strips of columns where samples are few") {
  constexpr Shape kWide{320, 10};
  const auto far_columns = [&](int every) {
    Image<Label> labels(kWide, label::road);
    Image<float> measured(kWide), depth(kWide, 20.0F);
    for (int x = 0; x < kWide.width; ++x) {
      for (int y = 0; y < 4; ++y) labels(x, y) = label::building;
      for (int y = 4; y < kWide.height; ++y) {
        depth(x, y) = 8.0F;
        if (x % every == 0) measured(x, y) = 8.0F;
      }
    }
    depth(160, 4) = measured(160, 4) = 60.0F;
    npsim_test::Scratch memory(place_beyond_range_workspace_bytes(kWide));
    REQUIRE(place_beyond_range({}, measured.cview(), labels.cview(), depth.view(), memory.workspace()).ok());
    int n = 0;
    for (int x = 0; x < kWide.width; ++x) n += depth(x, 0) == 60.0F ? 1 : 0;
    return n;
  };
  // Six samples a column make strips of 7, a tenth of that strips of 67, and a bound reaches 20 columns or a strip.
  CHECK(far_columns(1) == 20 + 7 + 20);
  CHECK(far_columns(10) == 3 * 67);
}

TEST_CASE("beyond range: filled depth below is no farther than anything that was measured, and nothing comes nearer") {
  Street s;
  s.depth(3, 5) = 900.0F;  // the ground's plane, near the horizon
  s.measured(3, 5) = 0.0F;
  s.measured(9, 7) = 50.0F;
  s.depth(8, 1) = 55.0F;
  s.run();
  CHECK(s.depth(0, 0) == 50.0F);
  CHECK(s.depth(8, 1) == 55.0F);
}

TEST_CASE("beyond range: what ends at the picture's border, has no surface or no labels stays") {
  Street s;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (x == 0) continue;
      s.labels(x, y) = label::building;
      s.measured(x, y) = 0.0F;
    }
  }
  s.depth(2, 2) = 0.0F;
  const Image<float> before = s.depth;
  s.run();
  CHECK(s.depth == before);

  Street off;
  off.before(3, label::vegetation, 70.0F);
  const Image<float> was = off.depth;
  BeyondRangeParams params;
  params.enabled = false;
  off.run(params);
  CHECK(off.depth == was);
  off.labels = Image<Label>();
  off.run();
  CHECK(off.depth == was);
  off.labels = Image<Label>(Shape{3, 3});
  npsim_test::Scratch memory(place_beyond_range_workspace_bytes(kShape));
  CHECK(place_beyond_range({}, off.measured.cview(), off.labels.cview(), off.depth.view(), memory.workspace()).code() ==
        StatusCode::shape_mismatch);
}
