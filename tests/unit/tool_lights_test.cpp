// SPDX-License-Identifier: Apache-2.0
// npsim night with lamps of one's own: measured luminaires, CSV, a moon, and the thesis' preset without own headlamps.
#include <doctest/doctest.h>

#ifdef NPSIM_TOOL

#include <fstream>
#include <string>

#include "tool_fixture.hpp"

using namespace tool_test;

namespace {

nlohmann::json night_json(const std::string& name, const std::string& options) {
  const std::string out = fixture().out(name);
  const Run run = run_tool("night '" + fixture().street + "' -o '" + out + "' --quiet " + options);
  REQUIRE_MESSAGE(run.status == 0, run.output);
  return json_of(out + "/night_000.json");
}

}  // namespace

TEST_CASE("tool: street lamps shine as the luminaire that the light set names, seen and unseen ones") {
  const std::string folder = fixture().out("luminaires");
  fs::create_directories(folder);
  std::ofstream(folder + "/even.ies") << "IESNA:LM-63-2002\nTILT=NONE\n1 -1 10 3 1 1 2 0 0 0 1 1 50\n"
                                         "0 90 180\n0\n50 50 50\n";
  std::ofstream(folder + "/set.json") << R"([{"class": "street_light_HT", "luminaire": "even.ies", "xy": [0.4, 0.4]},
                                            {"class": "street_light_LT", "luminaire": "even.ies", "xy": [0.5, 0.4]}])";
  const nlohmann::json night = night_json("measured_luminaire", "--lights '" + folder + "/set.json'");
  int lamps = 0;
  for (const nlohmann::json& source : night["sources"]) {
    const std::string cls = source["class"];
    if (cls.rfind("street_light", 0) != 0) continue;
    ++lamps;
    CHECK(source["profile"] == "measured");
    CHECK(source["unit"] == "lm");
    const double strength = source["strength"];
    CHECK(strength == doctest::Approx(500 * 4 * 3.14159265).epsilon(0.11));  // lamps differ by a tenth
    CHECK(source["peak_intensity_cd"].get<double>() == doctest::Approx(strength / (4 * 3.14159265)).epsilon(1e-3));
  }
  CHECK(lamps >= 2);
  std::ofstream(folder + "/even.ies") << "IESNA:LM-63-2002\nTILT=NONE\n1 -1 10 3 1 2\n";
  check_refused(run_tool("night '" + fixture().street + "' -o '" + fixture().out("none") + "' --quiet --lights '" +
                         folder + "/set.json'"),
                "even.ies: line 3, photometric type: is 2 (B), expected 1 (C)", fixture().out("none"));
}

TEST_CASE("tool: a light set as CSV and a moon are in the night that they make") {
  const std::string csv = fixture().out("e.csv");
  std::ofstream(csv) << "class,s,r/g,b/g\nstreet_light_HT,5000,1,1\n";
  const nlohmann::json night =
      night_json("csv", "--lights '" + csv + "' --moon=-30,50 --headlamps high --following-car 20");
  CHECK(night["moon"] == "-30,50");
  CHECK(night["headlamps"] == "high");
  CHECK(night["following_car_m"] == 20.0);
  int moons = 0;
  int followers = 0;
  for (const nlohmann::json& source : night["sources"]) {
    if (source.value("source", "") == "moon") {
      ++moons;
      CHECK(source["position_m"][0].get<double>() < 0);  // to the left
      CHECK(source["lit"] == true);
    } else if (source.value("source", "") == "following car") {
      ++followers;
    } else if (source["class"] == "street_light_HT") {
      CHECK(source["strength"].get<double>() == doctest::Approx(5000).epsilon(0.101));
      CHECK(source["xy"][0].get<double>() == doctest::Approx(0.3127).epsilon(0.02));
    }
  }
  CHECK(moons == 1);
  CHECK(followers == 2);
  for (const char* distance : {"3", "201", "near"}) {
    check_refused(run_tool("night '" + fixture().street + "' -o '" + fixture().out("none") +
                           "' --quiet --following-car " + distance),
                  "--following-car", fixture().out("none"));
  }
  for (const char* moon : {"5", "0,0", "0,91", "a,5", "0,5x"}) {
    check_refused(
        run_tool("night '" + fixture().street + "' -o '" + fixture().out("none") + "' --quiet --moon=" + moon),
        "--moon", fixture().out("none"));
  }
}

TEST_CASE("tool: the thesis has no own headlamps and no lamps outside the picture, unless they are asked for") {
  const auto others = [](const nlohmann::json& night) {
    int count = 0;
    for (const nlohmann::json& source : night["sources"]) count += source.contains("source") ? 1 : 0;
    return count;
  };
  CHECK(others(night_json("text", "--preset thesis")) == 0);
  const nlohmann::json asked = night_json("text_asked", "--preset thesis --headlamps low");
  CHECK(others(asked) == 2);
  CHECK(asked["headlamps"] == "low");
}

#endif
