// SPDX-License-Identifier: Apache-2.0
#include "npsim/labels/light_classes.hpp"

#include <doctest/doctest.h>

#include <array>
#include <set>
#include <string>

using npsim::LightCategory;
using npsim::LightClass;

TEST_CASE("twelve sources and nine groups, numbered as in the table") {
  CHECK(npsim::kLightClasses.size() == 22);
  std::array<int, 5> count{};
  std::set<std::string> names;
  for (int i = 0; i < npsim::kLightClassCount; ++i) {
    const auto c = static_cast<LightClass>(i);
    ++count[static_cast<std::size_t>(npsim::info(c).category)];
    names.insert(npsim::info(c).name);
    CHECK(npsim::is_group(c) == (i >= 13));
  }
  CHECK(names.size() == 22);
  CHECK(count[static_cast<std::size_t>(LightCategory::none)] == 1);
  CHECK(count[static_cast<std::size_t>(LightCategory::building)] == 1);
  CHECK(count[static_cast<std::size_t>(LightCategory::vehicle)] == 6);
  CHECK(count[static_cast<std::size_t>(LightCategory::object)] == 5);
  CHECK(count[static_cast<std::size_t>(LightCategory::group)] == 9);
}

TEST_CASE("names sit at their classes") {
  const auto name = [](LightClass c) { return std::string(npsim::info(c).name); };
  CHECK(name(LightClass::window_building) == "window_building");
  CHECK(name(LightClass::moving_rear) == "moving_rear");
  CHECK(name(LightClass::street_light_lt) == "street_light_LT");
  CHECK(name(LightClass::inferred_object) == "inferred object");
  CHECK(name(LightClass::windows_group) == "windows_group");
  CHECK(name(LightClass::traffic_sign_group) == "traffic_sign_group");
  CHECK(static_cast<int>(LightClass::traffic_sign_group) == 21);
}
