// SPDX-License-Identifier: Apache-2.0
// npsim stats: figures of several pictures as JSON and chart; what is refused.
#include <doctest/doctest.h>

#ifdef NPSIM_TOOL

#include <string>

#include "npsim/io/image.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "tool_fixture.hpp"

using namespace tool_test;

TEST_CASE("stats: figures of each picture, their mean, real nights beside them, and a chart") {
  using namespace npsim;
  const std::string folder = fixture().out("stats");
  fs::create_directories(folder);
  const io::Image<Rgb8> grey({64, 48}, Rgb8{51, 51, 51});
  const io::Image<Rgb8> black({64, 48});
  const io::Image<Rgb8> tiny({3, 3});
  REQUIRE(io::write_png(folder + "/grey.png", grey.view()).ok());
  REQUIRE(io::write_png(folder + "/black.png", black.view()).ok());
  REQUIRE(io::write_png(folder + "/tiny.png", tiny.view()).ok());
  const std::string pictures = folder + "/grey.png " + folder + "/black.png";
  const Run run = run_tool("stats " + pictures + " --json " + folder + "/deeper/s.json --svg " + folder + "/s.svg");
  REQUIRE_MESSAGE(run.status == 0, run.output);
  CHECK(run.output.find("real nights, mean") != std::string::npos);
  const nlohmann::json json = json_of(folder + "/deeper/s.json");
  REQUIRE(json["pictures"].size() == 2);
  CHECK(json["pictures"][0]["mean"] == doctest::Approx(0.02899).epsilon(1e-3));
  CHECK(json["pictures"][1]["r/g"].is_null());
  CHECK(json["mean"]["r/g"] == doctest::Approx(1));  // of those that have one
  CHECK(json["mean"]["black"] == 0.5);
  CHECK(json["real_nights"]["saturated"]["most"] == 0.0023);
  const std::string svg = bytes_of(folder + "/s.svg");
  CHECK(svg.rfind("<svg", 0) == 0);
  CHECK(svg.find("nan") == std::string::npos);
  CHECK(svg.find("</svg>") != std::string::npos);

  check_refused(run_tool("stats " + folder + "/none.png"), "none.png");
  check_refused(run_tool("stats " + folder + "/tiny.png"), "tiny.png: size: 3x3 pixels, expected at least 4x4");
  check_refused(run_tool("stats " + pictures + " --svg " + folder + "/grey.png"), "would be written over");
}

#endif
