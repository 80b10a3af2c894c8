// SPDX-License-Identifier: Apache-2.0
// `npsim evaluate --losses`: the losses of the refinement step by step, the grid of weights, and their pictures.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "lab/charts.hpp"
#include "tool_fixture.hpp"

using namespace tool_test;

namespace {

std::vector<std::vector<std::string>> rows_of(const std::string& csv) {
  std::vector<std::vector<std::string>> rows;
  std::istringstream lines(csv);
  for (std::string line; std::getline(lines, line);) {
    rows.emplace_back();
    std::istringstream cells(line + ",");
    for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(cell);
  }
  return rows;
}

std::size_t count_of(const std::string& text, const std::string& what) {
  std::size_t n = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++n;
  return n;
}

}  // namespace

TEST_CASE("lab: losses are written step by step, and never rise; the sum is that of the weighted terms") {
  const std::string folder = fixture().out("losses");
  const Run run = run_tool("evaluate '" + fixture().street + "' --size 96x54 --losses '" + folder + "' --quiet");
  REQUIRE_MESSAGE(run.status == 0, run.output);
  const auto rows = rows_of(bytes_of(folder + "/losses.csv"));
  REQUIRE(rows.size() > 3);
  CHECK(rows[0] == std::vector<std::string>{"step", "normal", "continuity", "depth", "sum"});
  double before = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < rows.size(); ++i) {
    REQUIRE(rows[i].size() == 5);
    CHECK(rows[i][0] == std::to_string(i - 1));
    const double sum = std::stod(rows[i][4]);
    CHECK(sum < before);
    CHECK(sum == doctest::Approx(std::stod(rows[i][1]) + std::stod(rows[i][2]) + 500 * std::stod(rows[i][3])));
    before = sum;
  }
  CHECK(std::stod(rows[1][3]) == 0.0);  // at first depth is where it was
  const std::string svg = bytes_of(folder + "/losses.svg");
  CHECK(svg.rfind("<svg", 0) == 0);
  CHECK(svg.find("500 x depth") != std::string::npos);
  CHECK(!fs::exists(folder + "/weights.csv"));
}

TEST_CASE("lab: the grid has appendix B's 49 weights, and depth moves less the more it weighs") {
  const std::string folder = fixture().out("grid");
  const Run run =
      run_tool("evaluate '" + fixture().street + "' --size 96x54 --losses '" + folder + "' --weights grid --quiet");
  REQUIRE_MESSAGE(run.status == 0, run.output);
  const auto rows = rows_of(bytes_of(folder + "/weights.csv"));
  REQUIRE(rows.size() == 50);
  REQUIRE(rows[0].size() == 14);
  CHECK(rows[0][8] == "moved");
  for (std::size_t r = 0; r < 7; ++r) {
    for (std::size_t c = 0; c < 7; ++c) {
      const auto& row = rows[1 + 7 * r + c];
      REQUIRE(row.size() == 14);
      CHECK(row[0] == "1");
      CHECK(std::stod(row[1]) == doctest::Approx(std::pow(10.0, static_cast<double>(r) - 3)));
      CHECK(std::stod(row[2]) == doctest::Approx(std::pow(10.0, static_cast<double>(c) - 3)));
      for (std::size_t k = 8; k < 14; ++k) CHECK(std::stod(row[k]) >= 0.0);
    }
    CHECK(std::stod(rows[7 + 7 * r][8]) < std::stod(rows[4 + 7 * r][8]));
  }
  CHECK(count_of(bytes_of(folder + "/weights.svg"), "<rect x=") == 6 * 49);
}

TEST_CASE("lab: measured depth has no losses to report, and weights belong to losses") {
  const std::string street = fixture().out("measured");
  REQUIRE(run_tool("street '" + street + "' --size 96x54 --depth lidar --quiet").status == 0);
  const std::string folder = fixture().out("no_losses");
  check_refused(run_tool("evaluate '" + street + "' --losses '" + folder + "' --quiet"), "--losses", folder);
  check_refused(run_tool("evaluate '" + fixture().street + "' --weights grid --quiet"), "--weights");
}

TEST_CASE("charts: what is not above 0 or not finite is left out; names are escaped; nothing draws nothing") {
  using namespace npsim::tool;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::string svg = svg_of_curves("a < b & c", "steps", {{"one", {1, 10, 0, nan, 100}}, {"none", {}}});
  CHECK(svg.find("a &lt; b &amp; c") != std::string::npos);
  CHECK(svg.find("nan") == std::string::npos);
  CHECK(svg.find("inf") == std::string::npos);
  CHECK(svg_of_curves("", "", {{"none", {0, nan}}}).empty());
  CHECK(svg_of_curves("", "", {}).empty());
  // The least value stands at the bottom of the frame, the greatest on top.
  const std::string line = svg_of_curves("", "", {{"", {1, 100}}});
  CHECK(line.find("M76.0 388.0L700.0 44.0") != std::string::npos);

  const std::string map = svg_of_maps("t", "x", {"1", "2"}, "y", {"1", "2"}, {{"m", {1, 2, nan, 4}, 0}});
  CHECK(count_of(map, "<rect x=") == 3);
  CHECK(map.find("nan") == std::string::npos);
  CHECK(map.find("#eef3fa") != std::string::npos);  // the least
  CHECK(map.find("#123e80") != std::string::npos);  // the greatest
}
