// SPDX-License-Identifier: Apache-2.0
// Depth judged apart where the input has none and where it has some: `npsim evaluate` on a scene with truth.
#include <doctest/doctest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "fixture.hpp"
#include "lab/coverage_errors.hpp"
#include "tool_fixture.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

// A wall whose inverse depth is linear, a strip of cars below it and sky above; holes amid the samples, and wrong
// samples in the sky.
struct Wall {
  static constexpr int kSky = 20;
  static constexpr int kCars = 100;
  Shape shape{160, 120};
  Image<float> depth{shape, 0.0F};
  Image<Label> labels{shape, label::wall};
  Image<Rgb8> image{shape, Rgb8{90, 90, 90}};
  tool::Truth truth;
  SceneView scene;

  Wall() {
    truth.depth = io::Image<float>(shape);
    truth.normals = io::Image<Vec3f>(shape, Vec3f{0, 0, -1});
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        truth.depth(x, y) = static_cast<float>(1.0 / (0.05 + 0.0002 * x + 0.0004 * y));
        depth(x, y) = 1.02F * truth.depth(x, y);  // the input errs by 2 %
        const bool hole = x % 40 >= 20 && x % 40 < 30 && y > 30;
        if (hole) depth(x, y) = 0.0F;
        if (y < kSky) {
          labels(x, y) = label::sky;
          depth(x, y) = 500.0F;  // must not leak into the yardsticks
          truth.depth(x, y) = 0.0F;
        }
        if (y >= kCars) labels(x, y) = label::car;
      }
    }
    scene.camera = {150, 150, 80, 60};
    scene.image = image.cview();
    scene.depth = depth.cview();
    scene.labels = labels.cview();
  }
};

}  // namespace

TEST_CASE("coverage: missing pixels are judged beside interpolation, given ones beside the input, sky nowhere") {
  Wall wall;
  // One step that is exact, one that is 4 % off and lost a given and a missing pixel.
  std::vector<std::pair<Stage, io::Image<float>>> steps;
  steps.emplace_back(Stage::fill, wall.truth.depth);
  io::Image<float> off(wall.shape);
  for (int y = 0; y < wall.shape.height; ++y) {
    for (int x = 0; x < wall.shape.width; ++x) off(x, y) = 1.04F * wall.truth.depth(x, y);
  }
  off(0, 50) = 0.0F;
  off(25, 50) = 0.0F;
  steps.emplace_back(Stage::refine, std::move(off));
  RefinedDepth refined;
  io::Image<float> refined_depth = wall.truth.depth;
  io::Image<Vec3f> turned(wall.shape, Vec3f{0, 0, -1});
  for (int y = Wall::kCars; y < wall.shape.height; ++y) {
    for (int x = 0; x < wall.shape.width; ++x) turned(x, y) = {0, -1, -1};  // 45 degrees off on cars
  }
  refined.depth = refined_depth.view();
  refined.normals = turned.view();
  refined.source = DepthSource::stereo;
  ThreadPool pool(2);
  const tool::CoverageErrors e = tool::coverage_errors(wall.scene, wall.truth, refined, steps, pool);

  CHECK(e.missing_pixels == 4U * 10U * 89U);
  CHECK(e.missing_pixels + e.given_pixels == 160U * 100U);
  REQUIRE(e.rows.size() == 5);
  const tool::CoverageRow& given = e.rows[0];
  const tool::CoverageRow& linear = e.rows[2];
  const tool::CoverageRow& exact = e.rows[3];
  const tool::CoverageRow& last = e.rows[4];
  for (const tool::CoverageRow& row : e.rows) {  // all on the same pixels, those that one step lost left out
    CHECK(row.missing[0].pixels + row.missing[0].lost == e.missing_pixels - 1);
    CHECK(row.given[0].pixels == e.given_pixels - 1);
  }
  CHECK(given.missing[0].pixels == 0);
  CHECK(given.given[0].mean == doctest::Approx(0.02).epsilon(1e-3));
  // Between samples that are 2 % too far a plane stays 2 % too far; at the lower edge of the picture the triangles
  // reach beyond the samples.
  CHECK(linear.missing[0].median == doctest::Approx(0.02).epsilon(0.02));
  CHECK(linear.given[0].mean == given.given[0].mean);
  CHECK(e.rows[1].missing[0].mean > linear.missing[0].mean);
  CHECK(exact.missing[0].mean == 0.0);
  CHECK(tool::given_over_input(e, last, 0) == doctest::Approx(2.0).epsilon(1e-3));
  CHECK(tool::missing_over_linear(e, last, 0) == doctest::Approx(0.04 / linear.missing[0].mean).epsilon(1e-3));

  // By label: the groups of wall and cars share all pixels between them.
  std::size_t facades = 0, vehicles = 0;
  for (std::size_t g = 0; g < tool::kLabelGroups.size(); ++g) {
    if (std::string(tool::kLabelGroups[g].name) == "facades") facades = g;
    if (std::string(tool::kLabelGroups[g].name) == "vehicles") vehicles = g;
  }
  CHECK(last.given[facades].pixels + last.given[vehicles].pixels == last.given[0].pixels);
  CHECK(last.missing[vehicles].pixels == 4U * 10U * 20U);
  REQUIRE(e.normals.size() == 3);  // the scene gives none
  CHECK(e.normals[0].key == "guiding");
  REQUIRE(e.normals[0].all[vehicles]);
  CHECK(e.normals[0].all[vehicles]->mean_deg == doctest::Approx(45.0));
  CHECK(e.normals[0].all[facades]->mean_deg == doctest::Approx(0.0));
}

TEST_CASE("coverage: a depth without holes has no missing pixels, and a scene without labels is one class") {
  Wall wall;
  for (int y = 0; y < wall.shape.height; ++y) {
    for (int x = 0; x < wall.shape.width; ++x) wall.depth(x, y) = 1.02F * wall.truth.depth(x, y);
  }
  wall.scene.labels = {};
  wall.truth.normals = {};
  std::vector<std::pair<Stage, io::Image<float>>> steps;
  steps.emplace_back(Stage::fill, wall.truth.depth);
  RefinedDepth refined;
  refined.depth = steps[0].second.view();
  ThreadPool pool(1);
  const tool::CoverageErrors e = tool::coverage_errors(wall.scene, wall.truth, refined, steps, pool);
  CHECK(e.missing_pixels == 0);
  CHECK(e.normals.empty());
  CHECK(std::isnan(tool::missing_over_linear(e, e.rows.back(), 0)));
  CHECK(tool::given_over_input(e, e.rows.back(), 0) == 0.0);
  CHECK(tool::to_json(e).at("steps").at(1).at("missing").at("all").at("pixels") == 0);
  CHECK(tool::to_json(e).at("steps").at(1).at("given").at("all").at("pixels") > 0);
  CHECK(tool::to_json(e).at("steps").at(1).at("given").at("facades").at("pixels") == 0);  // nobody knows
}

TEST_CASE("coverage: relief that the picture does not resolve counts among all normals, not among smooth ones") {
  const Shape shape{64, 48};
  Wall wall;  // for its image
  tool::Truth truth;
  truth.depth = io::Image<float>(shape, 10.0F);
  truth.normals = io::Image<Vec3f>(shape, Vec3f{0, 0, -1});
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 32; x < shape.width; ++x) truth.normals(x, y) = {0.5F, 0, -0.8660254F};
  }
  SceneView scene;
  scene.camera = {60, 60, 32, 24};
  scene.image = ImageView<const Rgb8>(wall.image.cview().data(), shape);
  scene.depth = std::as_const(truth.depth).view();
  io::Image<float> depth = truth.depth;
  io::Image<Vec3f> normals(shape, Vec3f{0, 0, -1});
  RefinedDepth refined;
  refined.depth = depth.view();
  refined.normals = normals.view();
  std::vector<std::pair<Stage, io::Image<float>>> steps;
  steps.emplace_back(Stage::fill, truth.depth);
  ThreadPool pool(1);
  const tool::CoverageErrors e = tool::coverage_errors(scene, truth, refined, steps, pool);
  REQUIRE(e.normals.size() == 3);
  CHECK(e.normals[0].all[0]->mean_deg == doctest::Approx(15.0).epsilon(1e-5));
  CHECK(e.normals[0].smooth[0]->pixels <= 32U * 48U);
  CHECK(e.normals[0].smooth[0]->pixels > 30U * 46U);
  CHECK(e.normals[0].smooth[0]->mean_deg == doctest::Approx(0.0));
}

TEST_CASE("lab: evaluate judges what a laser did not hit, and with --depth-only nothing but the depth") {
  using namespace tool_test;
  const std::string street = fixture().out("lidar");
  REQUIRE(run_tool("street '" + street + "' --seed 2 --size 160x90 --depth lidar --quiet").status == 0);
  const std::string file = fixture().out("coverage.json");
  const Run run = run_tool("evaluate '" + street + "' --depth-only --quiet -o '" + file + "'");
  REQUIRE_MESSAGE(run.status == 0, run.output);
  CHECK(run.output.find("relative error where missing") != std::string::npos);
  const nlohmann::json json = json_of(file);
  CHECK(json.at("mesh").empty());
  CHECK(json.at("lamps").empty());
  const nlohmann::json& coverage = json.at("coverage");
  CHECK(coverage.at("source") == "lidar");
  CHECK(coverage.at("missing_pixels").get<int>() > coverage.at("given_pixels").get<int>() / 2);
  CHECK(coverage.at("steps").at(0).at("missing").at("all").at("mean").is_null());
  CHECK(coverage.at("steps").at(2).at("missing").at("all").at("ratio_to_linear") == 1.0);
  CHECK(coverage.at("steps").back().at("step") == "normal_guided_refinement");
  CHECK(coverage.at("steps").back().at("missing").at("all").at("ratio_to_linear").get<double>() > 0.0);
  CHECK(coverage.at("normals").at("guiding").at("facades").at("all").at("mean_deg").get<double>() > 0.0);
}
