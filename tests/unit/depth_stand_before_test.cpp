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

  Front() {
    for (int y = 0; y < 10; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        labels(x, y) = label::sky;
        depth(x, y) = 0.0F;
      }
    }
  }
  void put(int x0, int y0, int x1, int y1, Label label, float z) {
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) {
        labels(x, y) = label;
        depth(x, y) = z;
      }
    }
  }
  [[nodiscard]] Status run(const StandBeforeParams& params = {}) {
    npsim_test::Scratch scratch(stand_before_workspace_bytes(kShape));
    return stand_before(params, labels.cview(), depth.view(), scratch.workspace());
  }
};

}  // namespace

TEST_CASE(
    "stand before: a sign on its pole that has the depth of the house, or lies behind it, comes before it whole") {
  Front f;
  f.put(10, 20, 20, 30, label::traffic_sign, 40.0F);
  f.put(14, 30, 16, 60, label::pole, 42.0F);
  f.put(50, 20, 60, 30, label::traffic_sign, 39.6F);  // nearer, but by less than a wall's noise
  REQUIRE(f.run().ok());
  // Three quarters of the outline: 40 px of the sign have a ratio of 1, 60 of the pole .952.
  const float scale = 0.97F * 40.0F / 42.0F;
  CHECK(f.depth(12, 25) == doctest::Approx(40.0F * scale));
  CHECK(f.depth(14, 50) == doctest::Approx(42.0F * scale));
  CHECK(f.depth(14, 50) == doctest::Approx(38.8));
  CHECK(f.depth(55, 25) == doctest::Approx(38.8));
  CHECK(f.depth(30, 25) == 40.0F);
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
  for (const float before : {-0.1F, 0.6F, std::numeric_limits<float>::quiet_NaN()}) {
    StandBeforeParams bad;
    bad.before = before;
    CHECK(f.run(bad).code() == StatusCode::invalid_argument);
  }
  Image<Label> narrow({79, 60}, label::pole);
  CHECK(stand_before({}, narrow.cview(), f.depth.view(), scratch.workspace()).code() == StatusCode::shape_mismatch);
  npsim_test::Scratch small(stand_before_workspace_bytes(kShape) / 2);
  CHECK(!stand_before({}, f.labels.cview(), f.depth.view(), small.workspace()).ok());
}
