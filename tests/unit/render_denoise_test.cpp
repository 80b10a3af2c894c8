// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>

#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/render/denoise.hpp"
#include "unit/fixture.hpp"

namespace {

using namespace npsim;
using npsim_test::Image;

struct Grid {
  Shape shape{48, 32};
  Image<Vec3f> position{shape};
  Image<Vec3f> normal{shape, Vec3f{0, 0, -1}};
  Image<Vec3f> irradiance{shape, Vec3f{3, 2, 1}};

  Grid() {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x)
        position(x, y) = {0.01F * static_cast<float>(x), 0.01F * static_cast<float>(y), 5};
    }
  }
  void run() {
    const DenoiseParams params;
    npsim_test::Scratch scratch(denoise_workspace_bytes(params, shape));
    SerialExecutor serial;
    REQUIRE(denoise_irradiance(params, position.cview(), normal.cview(), irradiance.view(), scratch.workspace(), serial)
                .ok());
  }
};

}  // namespace

TEST_CASE("denoise keeps a constant and takes noise on one plane down by at least ten in standard deviation") {
  Grid grid;
  double before = 0;
  for (std::size_t i = 0; i < grid.shape.pixels(); ++i) {
    RandomStream pixel(5, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(i), 0);
    const float noise = pixel.uniform(-1, 1);
    grid.irradiance.view().data()[i].x += noise;
    before += static_cast<double>(noise) * static_cast<double>(noise);
  }
  grid.run();
  double after = 0;
  for (const Vec3f& e : Span<const Vec3f>(grid.irradiance.view().data(), grid.shape.pixels())) {
    after += (static_cast<double>(e.x) - 3) * (static_cast<double>(e.x) - 3);
    CHECK(e.y == doctest::Approx(2).epsilon(1e-5));
  }
  CHECK(std::sqrt(after) < 0.1 * std::sqrt(before));
}

TEST_CASE("denoise lets nothing cross a right-angled crease and little cross a depth step of half the depth") {
  Grid crease;
  Grid step;
  for (int y = 0; y < 32; ++y) {
    for (int x = 24; x < 48; ++x) {
      crease.normal(x, y) = {0, -1, 0};
      crease.irradiance(x, y) = {};
      step.position(x, y).z = 10;
      step.irradiance(x, y) = {};
    }
  }
  crease.run();
  step.run();
  CHECK(crease.irradiance(23, 16).x == doctest::Approx(3).epsilon(1e-6));
  CHECK(crease.irradiance(24, 16).x == 0.0F);
  CHECK(step.irradiance(23, 16).x > 2.97F);
  CHECK(step.irradiance(24, 16).x < 0.03F);
}

TEST_CASE("denoise: pixels without a point neither give nor take") {
  Grid grid;
  grid.position(10, 10) = {};
  grid.irradiance(10, 10) = {1e6F, 0, 0};
  grid.run();
  CHECK(grid.irradiance(10, 10).x == 1e6F);
  CHECK(grid.irradiance(11, 10).x == doctest::Approx(3).epsilon(1e-5));
}
