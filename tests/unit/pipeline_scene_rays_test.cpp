// SPDX-License-Identifier: Apache-2.0
// The same night whether rays meet the layers as they are or the indexed mesh of the same faces.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "night_of_street.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/kept_night.hpp"
#include "npsim/pipeline/night.hpp"
#include "street/scene_view.hpp"
#include "street/street.hpp"

namespace {

using namespace npsim;

struct Sink {
  std::vector<std::uint8_t> visibility;  // from every emitter to every point that a pixel shows
  std::vector<std::uint32_t> hits;
  std::vector<std::uint32_t> pixels;  // of the vertices
  std::array<double, 3> mean{};

  Status reconstructed(const RefinedDepth&, const SceneMesh& mesh, const Relighting& light) {
    for (std::size_t e = 0; e < light.emitters.size(); ++e) {
      for (const std::uint32_t point : light.receivers) {
        visibility.push_back(light.visibility[e * light.points.size() + point]);
      }
    }
    hits.assign(light.hits.begin(), light.hits.end());
    pixels.assign(mesh.vertex_pixel.begin(), mesh.vertex_pixel.end());
    return {};
  }
  Status night(const Night& night) {
    mean = tool::colour_sums(night.luminance);
    return {};
  }
};

}  // namespace

TEST_CASE("rays through the layers: shadows to the bit those of the full mesh, bounces but for a pixel, with and without backs") {
  street::StreetParams street_params;
  street_params.seed = 3;
  street_params.shape = {112, 63};
  ThreadPool pool(2);
  street::Street street;
  REQUIRE(street::make_street(street_params, pool, street).ok());
  for (const bool backs : {true, false}) {
    NightParams params = default_night_params();
    params.mesh.backs = backs;
    params.mesh.simplify_faces = false;
    params.relight.visibility.cutoff_lx = 0;  // no point takes its neighbour's value, which one depends on the bounces
    REQUIRE(params.mesh.traced == TracedFaces::layers);
    const Sink layers = npsim::testing::night_of<Sink>(street, params);
    params.mesh.traced = TracedFaces::mesh;
    const Sink mesh = npsim::testing::night_of<Sink>(street, params);
    REQUIRE(layers.visibility.size() == mesh.visibility.size());
    std::size_t differ = 0;
    std::size_t lit = 0;
    for (std::size_t i = 0; i < mesh.visibility.size(); ++i) {
      differ += layers.visibility[i] != mesh.visibility[i] ? 1U : 0U;
      lit += mesh.visibility[i] != 0 ? 1U : 0U;
    }
    CHECK(lit > 10000);
    CHECK(differ == 0);
    REQUIRE(layers.hits.size() == mesh.hits.size());
    std::size_t elsewhere = 0;
    for (std::size_t i = 0; i < mesh.hits.size(); ++i) {
      const std::uint32_t a = layers.hits[i];
      const std::uint32_t b = mesh.hits[i];
      if (a == b) continue;
      // A back-facing point, by the normal of a neighbour, hands on nothing: either may be none.
      if (a == kNoPoint || b == kNoPoint) {
        ++elsewhere;
        continue;
      }
      const auto apart = [](std::uint32_t p, std::uint32_t q) { return p > q ? p - q : q - p; };
      const std::uint32_t p = layers.pixels[a];
      const std::uint32_t q = mesh.pixels[b];
      CHECK(apart(p % 112, q % 112) <= 1);
      CHECK(apart(p / 112, q / 112) <= 1);
    }
    CHECK(elsewhere < mesh.hits.size() / 200);
    for (std::size_t c = 0; c < 3; ++c) CHECK(std::fabs(layers.mean[c] / mesh.mean[c] - 1) < 3e-3);  // pixels are wide here
  }
}
