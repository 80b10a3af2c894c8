// SPDX-License-Identifier: Apache-2.0
// Estimated albedo against a given one: errors of groups, the day's shadow that is left, and where there is none.
#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "fixture.hpp"
#include "lab/albedo_evaluation.hpp"
#include "tool_fixture.hpp"

namespace {

using namespace npsim;
using namespace npsim::tool;

// Road of one albedo with paint on it, a wall above; the left part of the road in a light that is `drop` times weaker.
struct Street {
  Shape shape{480, 270};
  std::vector<Rgb8> day;
  std::vector<Label> labels;
  std::vector<Vec3f> albedo;
  std::vector<std::uint8_t> surface;
  std::vector<float> depth;
  std::vector<Vec3f> normals;
  SceneView scene;
  RefinedDepth refined;

  explicit Street(Vec3f shade)
      : day(shape.pixels()),
        labels(shape.pixels()),
        albedo(shape.pixels()),
        surface(shape.pixels(), 1),
        depth(shape.pixels(), 10.0F),
        normals(shape.pixels(), Vec3f{0, 0, -1}) {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const auto i = static_cast<std::size_t>(y * shape.width + x);
        RandomStream r(5, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(i), 0);
        const bool road = y >= 100;
        labels[i] = road ? label::road : label::building;
        const float grain = 0.85F + 0.3F * r.uniform();
        const float a = (road ? 0.1F : 0.3F) * grain;
        albedo[i] = {a, a, a};
        const Vec3f light = road && x < 200 ? shade : Vec3f{2, 2, 2};
        day[i] = {srgb_encode8(a * light.x), srgb_encode8(a * light.y), srgb_encode8(a * light.z)};
      }
    }
    scene.camera = {400, 400, 240, 135};
    scene.image = ImageView<const Rgb8>(day.data(), shape);
    scene.labels = ImageView<const Label>(labels.data(), shape);
    scene.depth = ImageView<const float>(depth.data(), shape);
    refined.labels = scene.labels;
    refined.surface = ImageView<std::uint8_t>(surface.data(), shape);
    refined.depth = ImageView<float>(depth.data(), shape);
    refined.normals = ImageView<Vec3f>(normals.data(), shape);
  }

  [[nodiscard]] AlbedoErrors errors() const {
    ThreadPool pool(1);
    AlbedoErrors out;
    REQUIRE(albedo_errors({}, scene, ImageView<const Vec3f>(albedo.data(), shape), refined, pool, out).ok());
    return out;
  }
};

double error_of(const AlbedoErrors& e, const std::string& group) {
  for (const AlbedoGroupErrors& g : e.groups) {
    if (g.name == group) return g.mean_log2;
  }
  return kNone;
}

}  // namespace

TEST_CASE("a shadow that is bluer is found by the estimate and by its judge, and is gone") {
  const AlbedoErrors e = Street({0.26F, 0.31F, 0.42F}).errors();
  CHECK(e.report.shadow);
  CHECK(e.light_ratio == doctest::Approx(2 / 0.31).epsilon(0.1));
  CHECK(e.sunlit_share == doctest::Approx(280.0 / 480).epsilon(0.02));
  CHECK(e.sunlit_over_shadowed == doctest::Approx(1.0).epsilon(0.1));
  CHECK(error_of(e, "road") < 0.2);
  CHECK(!std::isfinite(error_of(e, "vehicle")));
}

TEST_CASE("a shadow that the estimate cannot know counts as one that is left; even light has none") {
  const AlbedoErrors left = Street({0.3F, 0.3F, 0.3F}).errors();  // no bluer: might be another asphalt
  CHECK(!left.report.shadow);
  CHECK(left.sunlit_over_shadowed > 2.0);
  const AlbedoErrors even = Street({2, 2, 2}).errors();
  CHECK(!std::isfinite(even.sunlit_over_shadowed));
  CHECK(error_of(even, "all") < 0.15);
}

TEST_CASE("lab: a scene without materials is judged by its truth, and comes out as the same scene with them") {
  using namespace tool_test;
  const std::string street = fixture().out("without_materials");
  const std::string size = " --size " + size_of(kStreet);
  REQUIRE(run_tool("street '" + street + "' --seed 1 --albedo none --quiet" + size).status == 0);
  REQUIRE(!json_of(street + "/scene.json").contains("albedo"));
  const auto albedo_of = [](const std::string& scene, const std::string& name) {
    const std::string file = fixture().out(name);
    const Run run = run_tool("evaluate '" + scene + "' --size 96x54 --quiet -o '" + file + "'");
    REQUIRE_MESSAGE(run.status == 0, run.output);
    return json_of(file).at("albedo");
  };
  const nlohmann::json without = albedo_of(street, "without.json");
  REQUIRE(without.is_object());
  CHECK(without == albedo_of(fixture().street, "with.json"));
}
