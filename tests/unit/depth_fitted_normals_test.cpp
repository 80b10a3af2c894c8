// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/normals/fitted_normals.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

// An upright cylinder of 4 m radius whose front is 12 m away, seen by a stereo pair; any size of the same picture.
struct Tower {
  Shape shape;
  Intrinsics k;
  Image<float> truth, depth;
  Image<Label> labels;
  Image<Vec3f> normals;
  DepthNoise noise;

  explicit Tower(int width)
      : shape{width, width / 2},
        k{1.1F * static_cast<float>(width), 1.1F * static_cast<float>(width), 0.5F * static_cast<float>(width),
          0.25F * static_cast<float>(width)},
        truth(shape),
        depth(shape),
        labels(shape, label::car),
        normals(shape) {
    noise = {0.17F / 2048.0F / (1.1F * 0.22F), 0, std::max(1.0F, 4.0F * static_cast<float>(width) / 2048.0F)};
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const float r = ray(x, y).x;
        const float a = r * r + 1.0F;
        const float root = 256.0F - a * (256.0F - 16.0F);
        if (root > 0.0F) truth(x, y) = (16.0F - std::sqrt(root)) / a;
        if (!(root > 0.0F)) labels(x, y) = label::sky;
      }
    }
    depth = truth;
  }
  [[nodiscard]] Vec3f ray(int x, int y) const {
    return {(static_cast<float>(x) + 0.5F - k.cx) / k.fx, (static_cast<float>(y) + 0.5F - k.cy) / k.fy, 1.0F};
  }
  [[nodiscard]] Vec3f normal(int x, int y) const {
    const Vec3f p = ray(x, y) * truth(x, y);
    return normalized(Vec3f{p.x, 0, p.z - 16.0F});
  }
  void add_noise() {
    const float cell = noise.width_px;
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        // One value for each square over which noise is correlated.
        const auto at = static_cast<std::uint32_t>(static_cast<float>(y) / cell) * 4096U +
                        static_cast<std::uint32_t>(static_cast<float>(x) / cell);
        RandomStream random(7, RandomPurpose::test, 0, 0, at, 0);
        const float sum = random.uniform() + random.uniform() + random.uniform() + random.uniform() - 2.0F;
        const float w = 1.0F / truth(x, y);
        if (truth(x, y) > 0.0F) depth(x, y) = 1.0F / (w + 1.732F * sum * noise.deviation(w));
      }
    }
  }
  template <class Executor>
  [[nodiscard]] Status run(Executor& executor) {
    return fitted_normals(
        {}, depth.cview(), ObjectMap{labels.cview(), {}}, noise, k, [](int, int) { return true; }, normals.view(),
        executor);
  }
  // Mean angle to the truth, degrees, where the surface is not seen from the side.
  [[nodiscard]] double error() const {
    double sum = 0;
    int count = 0;
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        if (!(truth(x, y) > 0.0F) || normal(x, y).z > -0.5F) continue;
        sum += std::acos(static_cast<double>(std::min(1.0F, dot(normals(x, y), normal(x, y)))));
        ++count;
      }
    }
    return sum / count * 57.29578;
  }
};

}  // namespace

TEST_CASE("fitted normals: exact on a plane, to the border of the image") {
  constexpr Shape kShape{160, 96};
  const Intrinsics k{180, 180, 80, 48};
  const Vec3f n = normalized(Vec3f{0.3F, -0.8F, -0.5F});
  Image<float> depth(kShape);
  Image<Vec3f> normals(kShape);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const Vec3f r{(static_cast<float>(x) + 0.5F - k.cx) / k.fx, (static_cast<float>(y) + 0.5F - k.cy) / k.fy, 1.0F};
      depth(x, y) = dot(n, r) < -0.05F ? -1.5F / dot(n, r) : 0.0F;
    }
  }
  SerialExecutor serial;
  REQUIRE(fitted_normals(
              {}, depth.cview(), ObjectMap{}, DepthNoise{0.002F, 1, 1.0F}, k, [](int, int) { return true; },
              normals.view(), serial)
              .ok());
  float worst = 1.0F;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (depth(x, y) > 0.0F) worst = std::min(worst, dot(normals(x, y), n));
      if (!(depth(x, y) > 0.0F)) CHECK(normals(x, y) == Vec3f{});
    }
  }
  CHECK(worst > std::cos(0.2F * 0.017453293F));
}

TEST_CASE("fitted normals: a curved surface under stereo noise stays curved, alike at every size") {
  SerialExecutor serial;
  double errors[2];
  for (int i = 0; i < 2; ++i) {
    Tower tower(i == 0 ? 512 : 1024);
    tower.add_noise();
    REQUIRE(tower.run(serial).ok());
    errors[i] = tower.error();
  }
  CHECK(errors[0] < 5.0);
  CHECK(errors[1] < 5.0);
  CHECK(errors[1] == doctest::Approx(errors[0]).epsilon(0.35));
}

TEST_CASE("fitted normals: neither another object nor a patch that is off tilts them") {
  SerialExecutor serial;
  Tower tower(512);
  for (int y = 100; y < 110; ++y) {
    for (int x = 250; x < 260; ++x) tower.depth(x, y) = 15.0F;  // a mismatch on it
  }
  for (int y = 0; y < 256; ++y) {
    for (int x = 0; x < 220; ++x) {
      tower.labels(x, y) = label::person;
      tower.depth(x, y) = tower.truth(x, y) = 11.5F;
    }
  }
  tower.depth(300, 60) = std::numeric_limits<float>::quiet_NaN();
  REQUIRE(tower.run(serial).ok());
  for (int y = 90; y < 120; ++y) {
    for (int x = 222; x < 290; ++x) CHECK(dot(tower.normals(x, y), tower.normal(x, y)) > std::cos(0.2F));
  }
  CHECK(tower.normals(300, 60) == Vec3f{});
}

TEST_CASE("fitted normals: the same bits in any order of work") {
  Tower a(256);
  a.add_noise();
  Tower b = a;
  SerialExecutor serial;
  npsim_test::BackwardExecutor backward;
  REQUIRE(a.run(serial).ok());
  REQUIRE(b.run(backward).ok());
  CHECK(a.normals == b.normals);
}
