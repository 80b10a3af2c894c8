// SPDX-License-Identifier: Apache-2.0
#include "lab/flatness.hpp"

#include <doctest/doctest.h>

#include <cmath>

#include "fixture.hpp"

using namespace npsim;

TEST_CASE("flatness: pairs of one class a fixed share of the width apart, within the angle") {
  constexpr Shape kShape{256, 4};  // 16 px of 2048 are 2 here
  npsim_test::Image<Vec3f> normals(kShape, Vec3f{0, 0, -1});
  npsim_test::Image<Label> labels(kShape, label::building);
  const tool::Flatness flat = tool::flatness({}, normals.cview(), labels.cview());
  CHECK(flat.pairs == 254 * 4 + 256 * 2);
  CHECK(flat.share() == 1.0);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const float turn = 0.03F * static_cast<float>(x);  // 1.7 degrees a pixel: no pair along a row agrees
      normals(x, y) = {std::sin(turn), 0, -std::cos(turn)};
    }
  }
  CHECK(tool::flatness({}, normals.cview(), labels.cview()).agreeing == 256 * 2);
  for (int y = 0; y < kShape.height; ++y) labels(100, y) = label::pole;
  normals(50, 0) = {};
  CHECK(tool::flatness({}, normals.cview(), labels.cview()).pairs == 254 * 4 + 256 * 2 - 4 * 2 - 2 - 3);
}
