// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/things/stand_before.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "fixture.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

constexpr Shape kShape{80, 60};

// A house at 40 m under the sky.
struct Front {
  Image<Label> labels{kShape, label::building};
  Image<float> depth{kShape, 40.0F};

  Front() { put(0, 0, kShape.width, 10, label::sky, 0.0F); }
  void put(int x0, int y0, int x1, int y1, Label label, float z) {
    labels.fill_rectangle(x0, y0, x1, y1, label);
    depth.fill_rectangle(x0, y0, x1, y1, z);
  }
  [[nodiscard]] Status run(const StandBeforeParams& params = {}) {
    npsim_test::Scratch scratch(stand_before_workspace_bytes(kShape));
    return stand_before(params, labels.cview(), depth.view(), scratch.workspace());
  }
};

}  // namespace

TEST_CASE("stand before: signs and poles that have the depth of the house, or lie behind it, come before it whole") {
  Front f;
  f.put(10, 20, 20, 30, label::traffic_sign, 40.0F);
  f.put(14, 30, 16, 60, label::pole, 42.0F);
  f.put(50, 20, 60, 30, label::traffic_sign, 39.6F);  // nearer, but by less than a wall's noise
  f.put(70, 5, 72, 60, label::pole, 41.0F);           // a tenth of it before the sky
  REQUIRE(f.run().ok());
  CHECK(f.depth(12, 25) == doctest::Approx(38.8));
  CHECK(f.depth(14, 50) == doctest::Approx(38.8));
  CHECK(f.depth(55, 25) == doctest::Approx(38.8));
  CHECK(f.depth(70, 8) == doctest::Approx(38.8));
  CHECK(f.depth(30, 25) == 40.0F);
  f.put(22, 32, 46, 58, label::vegetation, 30.0F);
  f.put(30, 40, 36, 46, label::traffic_sign, 30.0F);
  REQUIRE(f.run().ok());
  CHECK(f.depth(32, 42) == doctest::Approx(29.1));
  // Of a wall that is nearer at one side, three quarters of the outline decide.
  Front slanted;
  for (int y = 10; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) slanted.depth(x, y) = x < 30 ? 39.0F : 40.0F;
  }
  slanted.put(30, 20, 40, 30, label::traffic_sign, 40.0F);  // 10 of 40 px of the outline are before the nearer part
  REQUIRE(slanted.run().ok());
  CHECK(slanted.depth(35, 25) == doctest::Approx(38.8));
  slanted.put(30, 20, 40, 32, label::traffic_sign, 40.0F);
  slanted.put(28, 20, 30, 32, label::traffic_sign, 40.0F);  // now 16 of 48
  REQUIRE(slanted.run().ok());
  CHECK(slanted.depth(35, 25) == doctest::Approx(0.97 * 39.0));
}

TEST_CASE("stand before: what stands in front of a thing, and another thing beside it in the picture, move nothing") {
  Front f;
  f.put(10, 5, 14, 60, label::pole, 40.0F);
  f.put(0, 0, 80, 10, label::sky, 0.0F);
  f.put(10, 2, 14, 60, label::pole, 40.0F);
  for (int y = 10; y < 60; ++y) {  // the house is far behind the pole, a hedge before it to the left
    for (int x = 0; x < 80; ++x) {
      if (f.labels(x, y) == label::building) f.depth(x, y) = 60.0F;
    }
  }
  f.put(4, 12, 10, 60, label::vegetation, 32.0F);
  f.put(14, 20, 24, 30, label::traffic_sign, 59.5F);  // far behind the pole, on the house
  f.put(40, 10, 44, 60, label::pole, 40.0F);          // one pixel of a hedge at its foot
  f.put(44, 59, 45, 60, label::vegetation, 39.0F);
  REQUIRE(f.run().ok());
  CHECK(f.depth(12, 30) == 40.0F);
  CHECK(f.depth(12, 50) == 40.0F);
  CHECK(f.depth(42, 50) == 40.0F);
  CHECK(f.depth(20, 25) == doctest::Approx(0.97 * 60.0));
}

TEST_CASE(
    "stand before: what stands before the house, before the sky alone, or behind something near stays to the bit") {
  Front f;
  f.put(10, 20, 20, 30, label::traffic_sign, 20.0F);
  f.put(30, 1, 34, 8, label::traffic_light, 40.0F);
  f.put(44, 14, 72, 60, label::vegetation, 8.0F);  // a hedge before the sign
  f.put(50, 20, 60, 30, label::traffic_sign, 41.0F);
  f.put(2, 40, 6, 50, label::pole, 0.0F);  // without depth
  f.depth(12, 22) = 0.0F;
  f.depth(13, 22) = std::numeric_limits<float>::quiet_NaN();
  f.depth(21, 25) = std::numeric_limits<float>::infinity();
  const Image<float> before = f.depth;
  REQUIRE(f.run().ok());
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (std::isnan(before.cview()(x, y))) continue;
      CHECK(f.depth(x, y) == before.cview()(x, y));
    }
  }
  CHECK(std::isnan(f.depth(13, 22)));
}

TEST_CASE("stand before: switched off or without labels nothing changes; bad input and a small workspace are refused") {
  Front f;
  f.put(10, 20, 20, 30, label::traffic_sign, 40.0F);
  StandBeforeParams off;
  off.enabled = false;
  REQUIRE(f.run(off).ok());
  CHECK(f.depth(12, 25) == 40.0F);
  npsim_test::Scratch scratch(stand_before_workspace_bytes(kShape));
  REQUIRE(stand_before({}, ImageView<const Label>(), f.depth.view(), scratch.workspace()).ok());
  CHECK(f.depth(12, 25) == 40.0F);
  for (const float share : {-0.1F, 0.6F, std::numeric_limits<float>::quiet_NaN()}) {
    StandBeforeParams bad;
    bad.before = share;
    CHECK(f.run(bad).code() == StatusCode::invalid_argument);
    bad = {};
    bad.hidden = share;
    CHECK(f.run(bad).code() == StatusCode::invalid_argument);
  }
  Image<Label> narrow({79, 60}, label::pole);
  CHECK(stand_before({}, narrow.cview(), f.depth.view(), scratch.workspace()).code() == StatusCode::shape_mismatch);
  npsim_test::Scratch small(stand_before_workspace_bytes(kShape) / 2);
  CHECK(!stand_before({}, f.labels.cview(), f.depth.view(), small.workspace()).ok());
}
