// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <string>

#include "io_fixture.hpp"
#include "npsim/io/light_set.hpp"

namespace {

using namespace npsim;

io::Expected<io::LightSet> read_light_set_text(const std::string& text, const std::string& name = "set.json") {
  const io_test::TemporaryFolder folder;
  io_test::put(folder / name, text);
  io_test::put(folder / "lamp.ies", "TILT=NONE\n1 1000 1 3 1 1 2 0 0 0 1 1 50\n0 90 180\n0\n100 100 100\n");
  return io::read_light_set(folder / name);
}

}  // namespace

TEST_CASE("light set: xy is taken as it is, linear sRGB ratios of white give D65 and of red its primary") {
  const auto set = read_light_set_text(R"([{"class": "street_light_LT", "strength": 10000, "xy": [0.533, 0.415]},
                            {"class": "inferred object", "strength": 100, "rg_bg": [1, 1]},
                            {"class": "moving_rear", "strength": 10, "rg_bg": [100, 0]}])");
  REQUIRE(set.ok());
  REQUIRE(set.value().entries.size() == 3);
  CHECK(set.value().entries[0].cls == LightClass::street_light_lt);
  CHECK(set.value().entries[0].xy.x == 0.533F);
  CHECK(set.value().entries[1].xy.x == doctest::Approx(0.3127).epsilon(1e-3));
  CHECK(set.value().entries[1].xy.y == doctest::Approx(0.3290).epsilon(1e-3));
  CHECK(set.value().entries[2].xy.x == doctest::Approx(0.64).epsilon(0.01));
}

TEST_CASE("light set: each fault is named by its entry and key") {
  const auto fault = [](const std::string& text) {
    const auto set = read_light_set_text(text);
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
  CHECK(fault(R"([{"class": "clock", "luminaire": "lamp.ies", "xy": [0.3, 0.3]}])") == "[0].luminaire");
  CHECK(fault(R"([{"class": "clock", "strength": 1, "turn_deg": 9, "xy": [0.3, 0.3]}])") == "[0].turn_deg");
  CHECK(fault(R"([{"class": "street_light_HT", "luminaire": "lamp.ies", "turn_deg": 999, "xy": [0.3, 0.3]}])") ==
        "[0].turn_deg");
  CHECK(fault(R"([{"class": "street_light_HT", "luminaire": "lamp.ies", "xy": [0.3, 0.3]},
                  {"class": "street_light_HT", "luminaire": "lamp.ies", "xy": [0.3, 0.3]}])") == "[1].luminaire");
  CHECK(fault(R"([{"class": "street_light_HT", "luminaire": "none.ies", "xy": [0.3, 0.3]}])").empty());
  CHECK(fault(R"([3])") == "[0]");
  CHECK(fault(R"([])").empty());
  CHECK(fault(R"({"class": "clock"})").empty());
}

TEST_CASE("light set: a luminaire beside the file, with its own flux where no strength is given") {
  const auto set = read_light_set_text(R"([{"class": "street_light_HT", "luminaire": "lamp.ies", "xy": [0.4, 0.4]},
                            {"class": "street_light_LT", "luminaire": "lamp.ies", "strength": 700,
                             "xy": [0.5, 0.4]}])");
  REQUIRE(set.ok());
  const auto& entries = set.value().entries;
  REQUIRE(entries.size() == 2);
  CHECK(entries[0].strength == doctest::Approx(400 * 3.14159265).epsilon(1e-4));
  CHECK(entries[1].strength == 700.0F);
  REQUIRE(entries[1].luminaire != nullptr);
  CHECK(validate(*entries[1].luminaire).ok());
  CHECK(set.value().luminaire_files.size() == 2);
}

TEST_CASE("light set: CSV of {s, r/g, b/g}, in linear sRGB and through a sensor's matrix") {
  const auto plain = read_light_set_text(
      "# measured in May\n\nclass, s, r/g, b/g\r\nclock,3,1,1\ninferred object,100,100,0\n", "e.csv");
  REQUIRE(plain.ok());
  REQUIRE(plain.value().entries.size() == 2);
  CHECK(plain.value().entries[0].cls == LightClass::clock);
  CHECK(plain.value().entries[0].strength == 3.0F);
  CHECK(plain.value().entries[0].xy.x == doctest::Approx(0.3127).epsilon(1e-3));
  CHECK(plain.value().entries[1].xy.x == doctest::Approx(0.64).epsilon(0.01));
  // A sensor that sees white as (.5, 1, .25).
  const auto sensor =
      read_light_set_text("sensor_to_srgb,2,0,0,0,1,0,0,0,4\nclass,s,r/g,b/g\nclock,3,.5,.25\n", "e.csv");
  REQUIRE(sensor.ok());
  CHECK(sensor.value().entries[0].xy.x == plain.value().entries[0].xy.x);
  CHECK(sensor.value().entries[0].xy.y == plain.value().entries[0].xy.y);
}

TEST_CASE("light set: each fault of a CSV is named by its line") {
  const auto fault = [](const std::string& text) {
    const auto set = read_light_set_text(text, "e.csv");
    REQUIRE(!set.ok());
    CHECK(set.error().problem.find("expected") != std::string::npos);
    return set.error().field;
  };
  const std::string head = "class,s,r/g,b/g\n";
  CHECK(fault("class,strength,x,y\n") == "line 1");
  CHECK(fault("clock,3,1,1\n") == "line 1");
  CHECK(fault(head).empty());
  CHECK(fault(head + "clock,3,1\n") == "line 2");
  CHECK(fault(head + "clock,3,1,one\n") == "line 2");
  CHECK(fault(head + "clock,3,1,1,1\n") == "line 2");
  CHECK(fault(head + "lamp,3,1,1\n") == "line 2, class");
  CHECK(fault(head + "clock,0,1,1\n") == "line 2, s");
  CHECK(fault(head + "clock,3,1,1\nclock,3,-1,1\n") == "line 3, r/g and b/g");
  CHECK(fault("sensor_to_srgb,1,0,0\n" + head + "clock,3,1,1\n") == "line 1");
  CHECK(fault("sensor_to_srgb,-1,0,0,0,-1,0,0,0,-1\n" + head + "clock,3,1,1\n") == "line 3, r/g and b/g");
}
