// SPDX-License-Identifier: Apache-2.0
// npsim night in a moving car, raw pictures and JPEG of it, and npsim calibrate-noise.
#include <doctest/doctest.h>

#ifdef NPSIM_TOOL

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>

#include "npsim/core/executor.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/io/raw_picture.hpp"
#include "npsim/sensor/raw.hpp"
#include "tool_fixture.hpp"

using namespace tool_test;

namespace {

Run run_night(const std::string& name, const std::string& options) {
  return run_tool("night '" + fixture().street + "' -o '" + fixture().out(name) + "' --quiet " + options);
}

// A chart of eight patches as a sensor of 12 bits reads it, beta1 = .002 and beta2 = 4e-6.
void write_chart(const std::string& path, std::uint32_t number) {
  using namespace npsim;
  const Shape shape{512, 64};
  io::Image<Vec3f> light(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) light(x, y) = Vec3f{1, 1, 1} * (0.01F + 0.1F * static_cast<float>(x / 64));
  }
  SensorParams sensor;
  sensor.bits = 12;
  sensor.black = 256;
  sensor.blur_px = sensor.vignetting = 0;
  io::Image<float> plane(mosaic_shape(shape));
  io::Image<std::uint16_t> levels(shape);
  const SerialExecutor executor;
  REQUIRE(capture(sensor, 1, {{2e-3F, 4e-6F}, 1}, {100, 100, 256, 32}, 1, number, light.view(), plane.view(), executor)
              .ok());
  REQUIRE(raw_levels(sensor, plane.view(), levels.view(), executor).ok());
  REQUIRE(io::write_png16(path, levels.view()).ok());
}

void check_betas(const Run& run) {
  REQUIRE_MESSAGE(run.status == 0, run.output);
  double b1 = 0;
  double e1 = 0;
  double b2 = 0;
  double e2 = 0;
  CAPTURE(run.output);
  REQUIRE(std::sscanf(run.output.c_str(), "beta1 %lf +- %lf (95 %%)\nbeta2 %lf +- %lf", &b1, &e1, &b2, &e2) == 4);
  CHECK(std::fabs(b1 - 2e-3) < 2 * e1);
  CHECK(std::fabs(b2 - 4e-6) < 2 * e2);
  CHECK(e1 < 1e-4);
  CHECK(run.output.find("table  [400, ") != std::string::npos);
}

}  // namespace

TEST_CASE("tool: a moving car's night is another picture of the same light, and says how it moved") {
  REQUIRE(run_night("rest", "").status == 0);
  REQUIRE(run_night("moving", "--speed 14 --yaw-rate 0.2 --flicker").status == 0);
  const std::string rest = fixture().out("rest");
  const std::string moving = fixture().out("moving");
  CHECK(bytes_of(rest + "/night_000.pfm") == bytes_of(moving + "/night_000.pfm"));
  CHECK(bytes_of(rest + "/night_000.png") != bytes_of(moving + "/night_000.png"));
  const nlohmann::json motion = json_of(moving + "/night_000.json")["motion"];
  CHECK(motion["velocity_m_s"][2] == 14);
  CHECK(motion["rotation_rad_s"][1].get<double>() == doctest::Approx(0.2));
  CHECK(motion["flicker"] == true);
  CHECK(json_of(rest + "/night_000.json")["motion"]["velocity_m_s"][2] == 0);
  REQUIRE(run_night("threads", "--speed 14 --yaw-rate 0.2 --flicker --threads 3").status == 0);
  CHECK(bytes_of(moving + "/night_000.png") == bytes_of(fixture().out("threads") + "/night_000.png"));
}

TEST_CASE("tool: raw pictures and JPEG are written beside the night, and go where the next run has none") {
  const std::string out = fixture().out("raw");
  REQUIRE(run_night("raw", "--camera automotive-raw --raw --jpeg 80").status == 0);
  const auto raw = npsim::io::read_raw(out + "/night_000.raw");
  REQUIRE(raw.ok());
  CHECK(raw.value().levels.width() == kStreet.width);
  CHECK(raw.value().white == 4095);
  CHECK(npsim::io::read_rgb8(out + "/night_000.jpg").ok());
  CHECK(fs::file_size(out + "/night_000.dng") > 2 * kStreet.pixels());
  REQUIRE(run_night("raw", "").status == 0);
  for (const char* file : {"night_000.raw", "night_000_raw.json", "night_000.dng", "night_000.jpg"}) {
    CHECK_FALSE(fs::exists(fs::path(out) / file));
  }
  CHECK(fs::exists(out + "/night_000.png"));
  for (const char* camera : {"thesis", "automotive-hdr"}) {
    check_refused(run_night("none", std::string("--raw --camera ") + camera), "--raw", fixture().out("none"));
  }
}

TEST_CASE("tool: calibrate-noise finds beta1 and beta2 of flat patches and of two frames, within its bounds") {
  const std::string a = fixture().out("a.png");
  const std::string b = fixture().out("b.png");
  write_chart(a, 0);
  write_chart(b, 1);
  const std::string levels = " --black 256 --white 4095 --iso 400";
  std::string patches;
  for (int i = 0; i < 8; ++i)
    patches += " --patch " + std::to_string(64 * i) + ",0," + std::to_string(64 * i + 64) + ",64";
  check_betas(run_tool("calibrate-noise '" + a + "'" + levels + patches));
  check_betas(run_tool("calibrate-noise '" + a + "' '" + b + "'" + levels));
  check_betas(run_tool("calibrate-noise" + patches + levels + " '" + a + "' '" + b + "'"));
  // Rows of a table are in whites of the picture: of a sensor that takes five times white the noise is so much larger.
  const std::string once = run_tool("calibrate-noise '" + a + "'" + levels + patches).output;
  const std::string five = run_tool("calibrate-noise '" + a + "'" + levels + patches + " --headroom 5").output;
  const auto row = [](const std::string& text) {
    double iso = 0, beta1 = 0, beta2 = 0;
    const std::size_t at = text.find("table  [");
    REQUIRE(at != std::string::npos);
    REQUIRE(std::sscanf(text.c_str() + at, "table  [%lf, %lf, %lf]", &iso, &beta1, &beta2) == 3);
    return std::array<double, 3>{iso, beta1, beta2};
  };
  CHECK(row(five)[0] == 400);
  CHECK(row(five)[1] == doctest::Approx(5 * row(once)[1]).epsilon(1e-3));
  CHECK(row(five)[2] == doctest::Approx(25 * row(once)[2]).epsilon(1e-3));
  check_refused(run_tool("calibrate-noise '" + a + "'" + levels), "--patch: is missing");
  check_refused(run_tool("calibrate-noise '" + a + "' '" + b + "'"), "--black, --white");
  check_refused(run_tool("calibrate-noise '" + a + "'" + levels + " --patch 0,0,9999,9"), "--patch");
  check_refused(run_tool("calibrate-noise '" + a + "'" + levels + " --patch 0,0,6,6"), "three areas or more");
  check_refused(run_tool("calibrate-noise '" + fixture().out("absent.raw") + "'"), "absent_raw.json");
}

#endif
