// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/measured/smooth_surfaces.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/depth/detail/measured/ground_mismatches.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

constexpr Shape kShape{320, 200};
constexpr float kCameraHeight = 1.4F;
constexpr int kHorizon = 60;  // rows below it are road

// A road seen by a stereo pair, 1.4 m below the camera, its right part higher by a kerb; a wall 12 m away above it, with
// a window set back.
struct Street {
  Intrinsics k{330, 330, 160, 50};
  DepthNoise noise{5e-4F, 0, 2.0F};
  GroundPlane ground{{0, -1, 0}, kCameraHeight, 1.0F};
  Image<float> truth{kShape}, depth{kShape}, smooth{kShape};
  Image<Label> labels{kShape, label::road};
  Image<std::uint16_t> plane_of{kShape};
  PlanarSegment wall;

  explicit Street(float kerb_m = 0.12F) {
    wall.q = {0, 0, 1.0F / 12.0F};
    wall.normal = {0, 0, -1};
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        if (y >= kHorizon) {
          truth(x, y) =
              (x < 200 ? kCameraHeight : kCameraHeight - kerb_m) * k.fy / (static_cast<float>(y) + 0.5F - k.cy);
        } else {
          labels(x, y) = label::building;
          plane_of(x, y) = 1;
          truth(x, y) = in_window(x, y) ? 1.0F / (1.0F / 12.0F - 20.0F * noise.amplitude) : 12.0F;
        }
      }
    }
    depth = truth;
  }
  [[nodiscard]] static bool in_window(int x, int y) { return x >= 100 && x < 140 && y >= 10 && y < 40; }
  void add_noise() {
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        RandomStream random(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>((y / 2) * kShape.width + x / 2),
                            0);
        const float sum = random.uniform() + random.uniform() + random.uniform() + random.uniform() - 2.0F;
        depth(x, y) = 1.0F / (1.0F / truth(x, y) + 1.732F * sum * noise.amplitude);
      }
    }
  }
  template <class Executor>
  [[nodiscard]] Status run(Executor& executor, const SmoothSurfacesParams& params = {}) {
    PlanarMap planes;
    planes.segments = Span<PlanarSegment>(&wall, 1);
    planes.of = plane_of.view();
    npsim_test::Scratch memory(smooth_surfaces_workspace_bytes(kShape));
    return smooth_surfaces(params, depth.cview(), ObjectMap{labels.cview(), {}}, planes, noise, k, ground,
                           smooth.view(), memory.workspace(), executor);
  }
  // Root mean square of 1/z off the truth, in deviations of the noise.
  template <class Where>
  [[nodiscard]] double error(const Image<float>& of, const Where& where) const {
    double sum = 0;
    int count = 0;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        if (!where(x, y)) continue;
        const double off = 1.0 / static_cast<double>(of(x, y)) - 1.0 / static_cast<double>(truth(x, y));
        sum += off * off;
        ++count;
      }
    }
    return std::sqrt(sum / count) / static_cast<double>(noise.amplitude);
  }
};

bool on_road(int x, int y) { return y >= kHorizon + 20 && (x < 180 || x >= 220); }

}  // namespace

TEST_CASE("smooth surfaces: noise leaves road and wall, and what moved stays within the stated deviations") {
  Street street;
  street.add_noise();
  SerialExecutor serial;
  REQUIRE(street.run(serial).ok());
  const auto on_wall = [](int x, int y) { return y < kHorizon && !Street::in_window(x, y); };
  CHECK(street.error(street.smooth, on_road) < 0.5 * street.error(street.depth, on_road));
  CHECK(street.error(street.smooth, on_wall) < 0.02);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const float moved = std::fabs(1.0F / street.smooth(x, y) - 1.0F / street.depth(x, y));
      const float most =
          y >= kHorizon ? SmoothSurfacesParams{}.ground_deviations : SmoothSurfacesParams{}.plane_deviations;
      REQUIRE(moved <= 1.001F * most * street.noise.amplitude);
    }
  }
}

TEST_CASE(
    "smooth surfaces: where samples of a fit stand far apart, what noise is left does not change from pixel to pixel") {
  Street street(0.0F);
  street.add_noise();
  SmoothSurfacesParams params;
  params.fit.angle_rad = 0.003F;  // 26 px, of samples 3 px apart
  SerialExecutor serial;
  REQUIRE(street.run(serial, params).ok());
  double left = 0;
  double change = 0;
  int count = 0;
  for (int y = kHorizon + 40; y < kShape.height - 20; ++y) {
    for (int x = 20; x < kShape.width - 22; ++x) {
      const auto off = [&](int u) {
        return 1.0 / static_cast<double>(street.smooth(u, y)) - 1.0 / static_cast<double>(street.truth(u, y));
      };
      left += off(x) * off(x);
      change += (off(x + 2) - off(x)) * (off(x + 2) - off(x));
      ++count;
    }
  }
  CAPTURE(std::sqrt(left / count) / static_cast<double>(street.noise.amplitude));
  CAPTURE(std::sqrt(change / count) / static_cast<double>(street.noise.amplitude));
  CHECK(std::sqrt(change / count) < 0.08 * static_cast<double>(street.noise.amplitude));
}

TEST_CASE(
    "smooth surfaces: a kerb without a label of its own keeps most of its step, a window its depth but for the bound") {
  Street street;
  SerialExecutor serial;
  REQUIRE(street.run(serial).ok());
  for (int y = kHorizon + 40; y < kShape.height; y += 20) {
    CAPTURE(y);
    const auto height = [&](int x) {
      return -street.smooth(x, y) * (static_cast<float>(y) + 0.5F - street.k.cy) / street.k.fy + kCameraHeight;
    };
    CHECK(height(204) - height(196) > 0.07F);  // over 8 px; of .12 m
  }
  const float set_back = (1.0F / 12.0F - 1.0F / street.smooth(120, 25)) / street.noise.amplitude;
  CHECK(set_back == doctest::Approx(20.0F - SmoothSurfacesParams{}.plane_deviations).epsilon(0.01));
}

TEST_CASE(
    "smooth surfaces: what is on a wall's plane and 4 m before it becomes the wall, a bay of 2 m moves by the bound") {
  Street street;
  for (int y = 20; y < 30; ++y) {
    for (int x = 20; x < 30; ++x) street.depth(x, y) = 8.0F;
    for (int x = 60; x < 70; ++x) street.depth(x, y) = 10.0F;
  }
  SerialExecutor serial;
  REQUIRE(street.run(serial).ok());
  CHECK(street.smooth(25, 25) == doctest::Approx(12.0F).epsilon(1e-5));
  const float moved = (1.0F / 10.0F - 1.0F / street.smooth(65, 25)) / street.noise.amplitude;
  CHECK(moved == doctest::Approx(SmoothSurfacesParams{}.plane_deviations).epsilon(0.01));
}

TEST_CASE("smooth surfaces: a crown loses the noise and keeps a gap that is deeper than the noise") {
  Street street;
  const auto in_gap = [](int x, int y) { return x >= 160 && x < 172 && y >= 24 && y < 36; };
  const auto on_crown = [&](int x, int y) { return y < kHorizon && x >= 150 && x < 190 && !in_gap(x, y); };
  for (int y = 0; y < kHorizon; ++y) {
    for (int x = 142; x < 198; ++x) {
      street.labels(x, y) = label::vegetation;
      street.plane_of(x, y) = 0;
      street.truth(x, y) = in_gap(x, y) ? 1.0F / (1.0F / 12.0F - 20.0F * street.noise.amplitude) : 12.0F;
    }
  }
  street.add_noise();
  SerialExecutor serial;
  REQUIRE(street.run(serial).ok());
  const auto inside = [&](int x, int y) { return on_crown(x, y) && x >= 182 && y >= 8 && y < 52; };
  CHECK(street.error(street.smooth, inside) < 0.6 * street.error(street.depth, inside));
  const float deeper = (1.0F / 12.0F - 1.0F / street.smooth(166, 30)) / street.noise.amplitude;
  CHECK(deeper > 20.0F - SmoothSurfacesParams{}.deviations - 3.0F);  // three of its own noise
}

TEST_CASE("smooth surfaces: missing depth and depth without surroundings stay bit by bit") {
  Street street;
  street.add_noise();
  for (int y = 120; y < 140; ++y) {
    for (int x = 60; x < 100; ++x) street.depth(x, y) = 0.0F;
  }
  street.labels(300, 190) = label::person;  // one pixel of its kind
  SerialExecutor serial;
  REQUIRE(street.run(serial).ok());
  CHECK(street.smooth(80, 130) == 0.0F);
  CHECK(street.smooth(300, 190) == street.depth(300, 190));
}

TEST_CASE(
    "smooth surfaces: the same bits for any order of work; disabled, nothing changes; bad parameters are refused") {
  Street a;
  Street b;
  a.add_noise();
  b.add_noise();
  SerialExecutor serial;
  npsim_test::BackwardExecutor backward;
  REQUIRE(a.run(serial).ok());
  REQUIRE(b.run(backward).ok());
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) REQUIRE(a.smooth(x, y) == b.smooth(x, y));
  }
  SmoothSurfacesParams params;
  params.enabled = false;
  REQUIRE(b.run(backward, params).ok());
  CHECK(b.smooth(50, 150) == b.depth(50, 150));
  params.ground_deviations = std::numeric_limits<float>::quiet_NaN();
  CHECK(b.run(backward, params).code() == StatusCode::invalid_argument);
}

TEST_CASE("ground mismatches: a patch of wrong matches on asphalt is outvoted, the depth around it and the wall stay") {
  Street street(0.0F);
  street.add_noise();
  const Image<float> before = street.depth;
  const auto in_patch = [](int x, int y) { return x >= 60 && x < 68 && y >= 140 && y < 146; };
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (in_patch(x, y)) street.depth(x, y) *= 1.6F;
    }
  }
  Image<float> filled = street.depth;
  npsim_test::Scratch memory(ground_mismatches_workspace_bytes(kShape));
  SerialExecutor serial;
  GroundMismatchParams params;
  params.wide.angle_rad = 0.004F;  // some 30 px here
  REQUIRE(replace_ground_mismatches(params, ObjectMap{street.labels.cview(), {}}, street.noise, street.k, street.ground,
                                    filled.view(), street.depth.view(), memory.workspace(), serial)
              .ok());
  CHECK(street.error(street.depth, in_patch) < 6.0);
  std::size_t moved = 0;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (!in_patch(x, y)) moved += street.depth(x, y) != before(x, y) ? 1U : 0U;
      if (y < kHorizon) REQUIRE(street.depth(x, y) == before(x, y));
      REQUIRE(filled(x, y) == street.depth(x, y));
    }
  }
  CHECK(moved < 64);
}
