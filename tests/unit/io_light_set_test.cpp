// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "npsim/io/light_set.hpp"

namespace {

using namespace npsim;

io::Expected<std::vector<LightSetEntry>> read(const std::string& text) {
  const std::string path = (std::filesystem::temp_directory_path() / "npsim_light_set_test.json").string();
  std::ofstream(path) << text;
  auto result = io::read_light_set(path);
  std::filesystem::remove(path);
  return result;
}

}  // namespace

TEST_CASE("light set: xy is taken as it is, linear sRGB ratios of white give D65 and of red its primary") {
  const auto set = read(R"([{"class": "street_light_LT", "strength": 10000, "xy": [0.533, 0.415]},
                            {"class": "inferred object", "strength": 100, "rg_bg": [1, 1]},
                            {"class": "moving_rear", "strength": 10, "rg_bg": [100, 0]}])");
  REQUIRE(set.ok());
  REQUIRE(set.value().size() == 3);
  CHECK(set.value()[0].cls == LightClass::street_light_lt);
  CHECK(set.value()[0].xy.x == 0.533F);
  CHECK(set.value()[1].xy.x == doctest::Approx(0.3127).epsilon(1e-3));
  CHECK(set.value()[1].xy.y == doctest::Approx(0.3290).epsilon(1e-3));
  CHECK(set.value()[2].xy.x == doctest::Approx(0.64).epsilon(0.01));
}

TEST_CASE("light set: each fault is named by its entry and key") {
  const auto fault = [](const std::string& text) {
    const auto set = read(text);
    REQUIRE(!set.ok());
    CHECK(set.error().line().find('\n') == std::string::npos);
    return set.error().field;
  };
  CHECK(fault(R"([{"class": "street_light", "strength": 1, "xy": [0.3, 0.3]}])") == "[0].class");
  CHECK(fault(R"([{"class": "car_group", "strength": 1, "xy": [0.3, 0.3]}])") == "[0].class");
  CHECK(fault(R"([{"class": "clock", "strength": -1, "xy": [0.3, 0.3]}])") == "[0].strength");
  CHECK(fault(R"([{"class": "clock", "strength": 1}])") == "[0].xy");
  CHECK(fault(R"([{"class": "clock", "strength": 1, "xy": [0.3, 0.3], "rg_bg": [1, 1]}])") == "[0].xy");
  CHECK(fault(R"([{"class": "clock", "strength": 1, "xy": [0.9, 0.3]}])") == "[0].xy");
  CHECK(fault(R"([{"class": "clock", "strength": 1, "xy": [0.3]}])") == "[0].xy");
  CHECK(fault(R"([{"class": "clock", "strength": 1, "rg_bg": [-1, 1]}])") == "[0].rg_bg");
  CHECK(fault(R"([{"class": "clock", "power": 1, "xy": [0.3, 0.3]}])") == "[0].power");
  CHECK(fault(R"([3])") == "[0]");
  CHECK(fault(R"([])").empty());
  CHECK(fault(R"({"class": "clock"})").empty());
}
