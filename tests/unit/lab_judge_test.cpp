// SPDX-License-Identifier: Apache-2.0
// `npsim judge` and `npsim evaluate --night`: nights against the true night.
#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "lab/night_stages.hpp"
#include "tool_fixture.hpp"

using namespace tool_test;

TEST_CASE("judge: a label that one street shows in a few pixels counts as they do, and not where a street lacks it") {
  using namespace npsim::tool;
  std::vector<std::vector<NightErrors>> streets(3, std::vector<NightErrors>(1));
  streets[0][0].by_label[1] = npsim::LuminanceErrors{300, 0.25, 2.0, -0.5, 1.0};
  streets[1][0].by_label[1] = npsim::LuminanceErrors{100, 2.25, 6.0, 1.5, 5.0};
  const std::vector<NightErrors> mean = mean_of(streets);
  REQUIRE(mean.size() == 1);
  REQUIRE(mean[0].by_label[1].has_value());
  CHECK_FALSE(mean[0].by_label[0].has_value());
  CHECK(mean[0].by_label[1]->pixels == 400);
  CHECK(mean[0].by_label[1]->median == doctest::Approx(0.75));
  CHECK(mean[0].by_label[1]->p95 == doctest::Approx(3.0));
  CHECK(mean[0].by_label[1]->bias == doctest::Approx(0.0));
  CHECK(mean[0].by_label[1]->trimmed_relative_squared == doctest::Approx(2.0));
}

TEST_CASE("lab: judge makes streets, true nights, pictures and a table; evaluate finds the same figures") {
  const std::string folder = fixture().out("judge");
  const std::string command =
      "judge '" + folder + "' --first 3 --last 3 --size 96x54 --samples 8 --transport 4 --quiet";
  const Run run = run_tool(command);
  REQUIRE_MESSAGE(run.status == 0, run.output);
  CHECK(run.output.find("mesh of the true depth") != std::string::npos);
  CHECK(fs::exists(folder + "/night_3.png"));
  const nlohmann::json judged = json_of(folder + "/judge.json");
  REQUIRE(judged.at("3").size() >= 8);
  for (const nlohmann::json& row : judged.at("3")) {
    CHECK(row.at("log2_luminance").at("median").get<double>() > 0);
    CHECK(row.at("flip").get<double>() > 0);
    CHECK(row.at("flip").get<double>() < 1);
    CHECK(row.at("ssim").get<double>() < 1);
  }
  CHECK(judged.at("mean") == judged.at("3"));  // of one street

  const std::string figures = fixture().out("stages.json");
  const Run evaluated = run_tool("evaluate '" + folder + "/street_3' --night '" + folder +
                                 "/truth_3.pfm' --seed 3 --transport 4 --quiet -o '" + figures + "'");
  REQUIRE_MESSAGE(evaluated.status == 0, evaluated.output);
  CHECK(json_of(figures).at("nights") == judged.at("3"));

  // The same street measured by a laser: the same rows, and three more with their ratios.
  REQUIRE(run_tool(command + " --depth lidar").status == 0);
  const nlohmann::json both = json_of(folder + "/judge.json");
  REQUIRE(both.at("3").size() == judged.at("3").size() + 3);
  for (std::size_t i = 0; i < judged.at("3").size(); ++i) CHECK(both.at("3").at(i) == judged.at("3").at(i));
  const auto median = [&](const std::string& name) {
    for (const nlohmann::json& row : both.at("3")) {
      if (row.at("night") == name) return row.at("log2_luminance").at("median").get<double>();
    }
    return 0.0;
  };
  const nlohmann::json& ratios = both.at("ratios");
  CHECK(ratios.at("network").at("given_materials") == 1.0);
  CHECK(ratios.at("lidar").at("given_materials").get<double>() * median("+ refined depth") ==
        doctest::Approx(median("lidar depth")));
  CHECK(ratios.at("lidar").at("estimated_materials").get<double>() * median("+ estimated materials") ==
        doctest::Approx(median("lidar, estimated materials")));
  CHECK(median("lidar depth") > 0.0);
  CHECK(median("lidar depth, true lamps") > 0.0);

  // What is there is kept: the true night is not computed again.
  const std::string truth = bytes_of(folder + "/truth_3.pfm");
  REQUIRE(run_tool(command).status == 0);
  CHECK(bytes_of(folder + "/truth_3.pfm") == truth);
}

TEST_CASE("lab: a true night of another size, or none, is refused in one line") {
  check_refused(run_tool("evaluate '" + fixture().street + "' --size 64x36 --night '" + fixture().street +
                         "/truth/normals.pfm' --quiet"),
                "normals.pfm");
  check_refused(run_tool("evaluate '" + fixture().street + "' --size 64x36 --night nowhere.pfm --quiet"),
                "nowhere.pfm");
  check_refused(run_tool("judge '" + fixture().out("none") + "' --first 4 --last 2"), "--last");
}
