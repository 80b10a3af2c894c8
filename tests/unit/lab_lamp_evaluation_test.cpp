// SPDX-License-Identifier: Apache-2.0
// Placed lamps against the true ones: `npsim evaluate`, section "lamps".
#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "lab/lamp_evaluation.hpp"

using namespace npsim;

TEST_CASE("errors of placed lamps: by class, only of those that are marked and placed") {
  std::vector<LightMark> marks(4);
  const std::uint32_t ids[] = {10, 20, 30, 40};
  for (std::size_t i = 0; i < 4; ++i) {
    marks[i].id = ids[i];
    marks[i].cls = i < 3 ? LightClass::window_building : LightClass::street_light_ht;
  }
  std::vector<io::TrueEmitter> truth(4);
  std::vector<Emitter> placed(2);
  for (std::size_t i = 0; i < 4; ++i) {
    truth[i].centre_m = {0, -2, 10};
    truth[i].axis = {0, 0, -1};
    truth[i].area_m2 = 2;
    truth[i].mark = ids[i];
  }
  truth[3].mark = 0;  // seen by nobody
  placed[0].mark = 1;
  placed[0].centre_m = {0, -2, 10};
  placed[0].axis = {0, 0, -1};
  placed[0].area_m2 = 2;
  placed[1].mark = 2;
  placed[1].centre_m = {0, -3, 10};
  placed[1].axis = {1, 0, 0};
  placed[1].area_m2 = 4;
  const std::vector<tool::LampClassErrors> all = tool::lamp_errors(
      {marks.data(), marks.size()}, {placed.data(), placed.size()}, {truth.data(), truth.size()}, Vec3f{0, -1, 0});
  REQUIRE(all.size() == 1);
  const tool::LampClassErrors& e = all[0];
  CHECK(e.cls == LightClass::window_building);
  CHECK(e.marked == 3);
  CHECK(e.placed == 2);
  CHECK(e.distance_m.low == doctest::Approx(0));
  CHECK(e.distance_m.high == doctest::Approx(1));
  CHECK(e.height_m.high == doctest::Approx(1));
  CHECK(e.range.low == doctest::Approx(1));
  CHECK(e.axis_deg.high == doctest::Approx(90));
  CHECK(e.area.low == doctest::Approx(1));
  CHECK(e.area.high == doctest::Approx(2));
}
