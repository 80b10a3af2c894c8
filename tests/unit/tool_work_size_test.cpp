// SPDX-License-Identifier: Apache-2.0
// npsim night --work-size: depth and light at one size, pictures and labels at another.
#include <doctest/doctest.h>

#ifdef NPSIM_TOOL

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "npsim/io/large_night.hpp"
#include "npsim/io/pfm.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/io/raw_picture.hpp"
#include "npsim/io/scene.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "tool_fixture.hpp"

using namespace tool_test;

namespace {

using namespace npsim;

constexpr Shape kHalf{kStreet.width / 2, kStreet.height / 2};

std::string folder_of_night(const std::string& name, const std::string& options) {
  const std::string out = fixture().out(name);
  const Run run = run_tool("night '" + fixture().street + "' -o '" + out + "' --quiet --camera automotive-raw --raw " +
                           "--labels --speed 10 --threads 2 " + options);
  REQUIRE_MESSAGE(run.status == 0, run.output);
  return out;
}

}  // namespace

TEST_CASE("work size: pictures, raw and labels have the photograph's size, depth the smaller; the same lamps burn") {
  const std::string whole = folder_of_night("work_size_whole", "");
  const std::string half = folder_of_night("work_size_half", "--work-size " + size_of(kHalf));
  const Shape full = kStreet;
  CHECK(value_of(io::read_rgb8(half + "/night_000.png")).shape() == full);
  CHECK(value_of(io::read_raw(half + "/night_000.raw")).levels.shape() == full);
  CHECK(value_of(io::read_pfm(half + "/depth.pfm")).shape() == kHalf);
  const auto near = value_of(io::read_pfm(half + "/night_000_depth.pfm"));
  const auto exact = value_of(io::read_pfm(whole + "/night_000_depth.pfm"));
  REQUIRE(near.shape() == full);
  int off = 0;  // by more than half a pixel and the borders of things explain
  for (std::size_t i = 0; i < full.pixels(); ++i) {
    const bool seen = near.data()[i] > 0.0F && exact.data()[i] > 0.0F;
    off += seen && std::fabs(std::log(near.data()[i] / exact.data()[i])) > 0.1F ? 1 : 0;
  }
  CHECK(10 * off < static_cast<int>(full.pixels()));
  CHECK(value_of(io::read_rgb8(half + "/night_000_normals.png")).shape() == full);
  // Rows of a rolling shutter come from where depth says that they come from; classes differ where depth does.
  const auto ours = value_of(io::read_u8(half + "/night_000_labelIds.png"));
  const auto theirs = value_of(io::read_u8(whole + "/night_000_labelIds.png"));
  REQUIRE(ours.shape() == full);
  int other = 0;
  for (std::size_t i = 0; i < full.pixels(); ++i) other += ours.data()[i] != theirs.data()[i] ? 1 : 0;
  CHECK(288 * other < static_cast<int>(full.pixels()));

  const auto a = json_of(whole + "/night_000.json");
  const auto b = json_of(half + "/night_000.json");
  CHECK(b["size"] == nlohmann::json({full.width, full.height}));
  CHECK(b["work_size"] == nlohmann::json({kHalf.width, kHalf.height}));
  REQUIRE(a["sources"].size() == b["sources"].size());
  for (std::size_t s = 0; s < a["sources"].size(); ++s) {
    CHECK(a["sources"][s]["lit"] == b["sources"][s]["lit"]);
    CHECK(a["sources"][s]["xy"] == b["sources"][s]["xy"]);
  }
}

TEST_CASE("work size: at half of it the road is lit as at the whole, pixel by pixel") {
  const io::Scene scene = value_of(io::read_scene(fixture().street));
  const auto whole = value_of(io::read_pfm_rgb(folder_of_night("work_size_whole", "") + "/night_000.pfm"));
  const auto half =
      value_of(io::read_pfm_rgb(folder_of_night("work_size_half", "--work-size " + size_of(kHalf)) + "/night_000.pfm"));
  std::vector<float> stops;
  for (std::size_t i = 0; i < scene.shape().pixels(); ++i) {
    if (scene.labels.data()[i] != label::road) continue;
    stops.push_back(std::fabs(std::log2(luminance(half.data()[i]) / luminance(whole.data()[i]))));
  }
  std::nth_element(stops.begin(), stops.begin() + static_cast<std::ptrdiff_t>(stops.size() / 2), stops.end());
  CHECK(stops[stops.size() / 2] < 0.1F);
}

TEST_CASE("work size: more than the pictures have, or no size, is refused") {
  const std::string none = fixture().out("work_size_none");
  const auto refused = [&](const std::string& options) {
    const Run run = run_tool("night '" + fixture().street + "' -o '" + none + "' --quiet " + options);
    check_refused(run, "--work-size", none);
  };
  refused("--work-size 640x360");
  refused("--work-size 10");
  refused("--size 80x45 --work-size 160x90");
}

TEST_CASE("work size: a phone's picture is reduced, one of two megapixels and a thin strip are what they can be") {
  CHECK(io::work_shape({2048, 1024}) == Shape{2048, 1024});
  const Shape phone = io::work_shape({4000, 3000});
  CHECK(phone == Shape{1672, 1254});
  CHECK(io::work_shape({1, 16000000}).width == 1);
}

#endif  // NPSIM_TOOL
