// SPDX-License-Identifier: Apache-2.0
// What real photographs come to, as figures with bounds: depth at measured pixels that were left out beside linear
// interpolation of 1/z, how far measured pixels are moved, and how much of the street is black at night.
#include <doctest/doctest.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "npsim/io/pfm.hpp"
#include "npsim/io/scene.hpp"
#include "npsim/io/scene_resize.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "real_scenes.hpp"
#include "tool_fixture.hpp"

namespace {

using namespace npsim;
namespace fs = std::filesystem;
using tool_test::json_of;
using tool_test::run_tool;

struct Folder {
  fs::path path = fs::temp_directory_path() / ("npsim_real_scenes_" + std::to_string(getpid()));
  Folder() { fs::create_directories(path); }
  ~Folder() { fs::remove_all(path); }
};

// A scene.json of its own for each.
std::string put_scene(const Folder& folder, const npsim_test::RealScene& scene) {
  fs::create_directories(folder.path / scene.name);
  std::ofstream(folder.path / scene.name / "scene.json") << scene.json;
  return (folder.path / scene.name).string();
}

struct HeldOut {
  double linear, ours, moved_median, moved_mean;
};

HeldOut held_out(const std::string& scene, const std::string& how) {
  const std::string out = scene + "/hold_out.json";
  const auto run = run_tool("evaluate '" + scene + "' --hold-out " + how + " --quiet -o '" + out + "'");
  REQUIRE_MESSAGE(run.status == 0, run.output);
  const auto steps = json_of(out).at("steps");
  HeldOut result{};
  for (const auto& step : steps) {
    if (step.at("step") == "linear") result.linear = step.at("left_out").at("all").at("mean");
    result.ours = step.at("left_out").at("all").at("mean");  // of the last
    result.moved_median = step.at("kept_moved").at("median");
    result.moved_mean = step.at("kept_moved").at("mean");
  }
  std::printf("%-12s %-12s left out %.4f, linear %.4f, ratio %.2f; measured pixels moved by %.5f (median %.5f)\n",
              fs::path(scene).filename().c_str(), how.c_str(), result.ours, result.linear, result.ours / result.linear,
              result.moved_mean, result.moved_median);
  return result;
}

// Share of the surface whose luminance is below a thousandth of the darkest that a camera shows (1e-6 cd/m2).
double black_share(const std::string& scene, const std::string& size) {
  const std::string out = scene + "/night";
  const auto run = run_tool("night '" + scene + "' -o '" + out + "' --seed 1 --quiet --size " + size);
  REQUIRE_MESSAGE(run.status == 0, run.output);
  const auto night = io::read_vec3_plane(out + "/night_000.pfm");
  auto whole = io::read_scene(scene);
  REQUIRE(night.ok());
  REQUIRE(whole.ok());
  REQUIRE(io::resize_scene(whole.value(), night.value().shape()).ok());
  std::size_t black = 0;
  std::size_t all = 0;
  for (int y = 0; y < night.value().height(); ++y) {
    for (int x = 0; x < night.value().width(); ++x) {
      if (!whole.value().labels.empty() && kNoSurfaceLabels.contains(whole.value().labels(x, y))) continue;
      ++all;
      black += luminance(night.value()(x, y)) < 1e-6F ? 1U : 0U;
    }
  }
  const double share = static_cast<double>(black) / static_cast<double>(all);
  std::printf("%-12s %-12s black at night: %.2f %% of the surface\n", fs::path(scene).filename().c_str(), size.c_str(),
              100 * share);
  return share;
}

}  // namespace

TEST_CASE("real scenes, where the environment names them: measured depth stays, what is missing is interpolated") {
  const Folder folder;
  for (const npsim_test::RealScene& scene : npsim_test::real_scenes()) {
    CAPTURE(scene.name);
    if (scene.name == "kitti") {
      const std::string path = put_scene(folder, scene);
      const HeldOut random = held_out(path, "0.2");
      CHECK(random.ours < random.linear);
      CHECK(random.moved_mean < 0.003);
      CHECK(random.moved_median < 0.0006);
      const HeldOut blocks = held_out(path, "0.2,blocks");
      CHECK(blocks.ours < blocks.linear);
    } else if (scene.name == "dusseldorf" || scene.name == "aachen") {
      // Linear interpolation shares the noise of what it starts from, and what is left out has it too.
      const HeldOut blocks = held_out(put_scene(folder, scene), "0.15,blocks");
      CHECK(blocks.ours < 1.15 * blocks.linear);
    }
  }
}

TEST_CASE("real scenes, where the environment names them: hardly any of the street is black at night") {
  const Folder folder;
  for (const npsim_test::RealScene& scene : npsim_test::real_scenes()) {
    if (scene.name == "rgbd") continue;  // a room
    CAPTURE(scene.name);
    CHECK(black_share(put_scene(folder, scene), scene.name == "kitti" ? "621x188" : "512x256") < 0.25);
  }
}
