// SPDX-License-Identifier: Apache-2.0
// The same night whether rays meet the layers as they are or the indexed mesh of the same faces.
#include <doctest/doctest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "lab/kept_night.hpp"
#include "made_street.hpp"
#include "night_of_street.hpp"
#include "npsim/pipeline/night.hpp"
#include "street/scene_view.hpp"
#include "street/street.hpp"

namespace {

using namespace npsim;

struct Sink {
  // Of every lamp and group: which pixels it lights, and how much.
  std::vector<std::uint16_t> values;
  std::vector<std::uint32_t> block;
  std::array<double, 3> mean{};

  Status reconstructed(const RefinedDepth&, const SceneMesh&, const Relighting& light) {
    values.assign(light.images.values.begin(), light.images.values.end());
    block.assign(light.images.block.begin(), light.images.block.end());
    return {};
  }
  Status night(const Night& night) {
    mean = tool::colour_sums(night.luminance);
    return {};
  }
};

// What both ways of tracing give for the same faces: rays pass none.
void check_same(const street::Street& street, NightParams params) {
  params.mesh.simplify_faces = false;
  params.mesh.open_steps.min_step = 1e9F;
  for (BackRule& rule : params.mesh.solidify.rules) {
    if (rule.shape == BackShape::soft) rule.shape = BackShape::round;
  }
  params.mesh.traced = TracedFaces::layers;
  const Sink layers = npsim::testing::night_of<Sink>(street, params);
  params.mesh.traced = TracedFaces::mesh;
  const Sink mesh = npsim::testing::night_of<Sink>(street, params);
  CHECK(layers.values.size() > 10 * kLightBlock);
  CHECK(layers.block == mesh.block);
  CHECK(layers.values == mesh.values);
  CHECK(layers.mean == mesh.mean);
}

}  // namespace

TEST_CASE("rays through the layers: the image of every light to the bit that of the full mesh") {
  // With vertices that are completed far off their rays.
  const street::Street street = testing::made_street(1, {112, 63});
  NightParams params = default_night_params();
  CHECK(params.mesh.traced == TracedFaces::layers);
  SUBCASE("solid objects") { params.mesh.backs = true; }
  SUBCASE("without backs") { params.mesh.backs = false; }
  SUBCASE("vertices completed in position, off their pixels' rays") {
    params.mesh = ReconstructParams::thesis();
    CHECK(params.mesh.traced == TracedFaces::mesh);
  }
  check_same(street, params);
}
