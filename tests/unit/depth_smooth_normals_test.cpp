// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/depth/detail/normals/guiding_normals.hpp"

namespace {

using namespace npsim;
using npsim_test::Image;

struct Surface {
  Shape shape{40, 30};
  Image<float> depth{shape, 8.0F};
  Image<Label> labels{shape, label::road};
  Image<Vec3f> normals{shape, Vec3f{0, -1, 0}};

  Status smooth(const SmoothNormalsParams& params = {}) {
    npsim_test::Scratch scratch(smooth_normals_workspace_bytes(params, shape));
    Workspace& workspace = scratch.workspace();
    SerialExecutor serial;
    return smooth_normals(params, depth.view(), labels.view(), normals.view(), workspace, serial);
  }
};

// Of a predicted normal: some degrees, over some pixels.
void add_noise(ImageView<Vec3f> normals, std::uint32_t seed) {
  constexpr int kBlob = 4;
  for (int y = 0; y < normals.height(); ++y) {
    for (int x = 0; x < normals.width(); ++x) {
      const auto blob = static_cast<std::uint32_t>(x / kBlob + 1000 * (y / kBlob));
      RandomStream random(seed, RandomPurpose::test, 0, 0, blob, 0);
      const Vec3f off{random.uniform(-0.07F, 0.07F), random.uniform(-0.07F, 0.07F), random.uniform(-0.07F, 0.07F)};
      normals(x, y) = normalized(normals(x, y) + off);
    }
  }
}

[[nodiscard]] double mean_degrees(ImageView<const Vec3f> normals, ImageView<const Vec3f> truth, int left, int right) {
  double sum = 0;
  for (int y = 0; y < normals.height(); ++y) {
    for (int x = left; x < right; ++x) {
      sum += std::acos(std::min(1.0, static_cast<double>(dot(normals(x, y), truth(x, y)))));
    }
  }
  return sum / normals.height() / (right - left) * 57.29578;
}

// One iteration, of taps `step` apart.
[[nodiscard]] Image<Vec3f> smoothed_in_doubles(const Surface& s, const SmoothNormalsParams& params, int step) {
  const auto wide = [](const Vec3f& n) {
    return Vec3d{static_cast<double>(n.x), static_cast<double>(n.y), static_cast<double>(n.z)};
  };
  const double spline[5] = {1, 4, 6, 4, 1};
  const auto depth_sigma = static_cast<double>(params.depth_sigma);
  const auto normal_sigma = static_cast<double>(params.normal_sigma);
  Image<Vec3f> out = s.normals;
  for (int y = 0; y < s.shape.height; ++y) {
    for (int x = 0; x < s.shape.width; ++x) {
      if (!is_valid_depth(s.depth(x, y)) || s.normals(x, y) == Vec3f{}) continue;
      Vec3d sum;
      for (int j = -2; j <= 2; ++j) {
        for (int i = -2; i <= 2; ++i) {
          const int u = x + i * step;
          const int v = y + j * step;
          if (u < 0 || v < 0 || u >= s.shape.width || v >= s.shape.height) continue;
          if (!is_valid_depth(s.depth(u, v)) || s.labels(u, v) != s.labels(x, y)) continue;
          const auto z = static_cast<double>(s.depth(x, y));
          const double off = (static_cast<double>(s.depth(u, v)) - z) / (depth_sigma * z);
          const Vec3d apart = wide(s.normals(u, v)) - wide(s.normals(x, y));
          const double turn = 1 + dot(apart, apart) / (normal_sigma * normal_sigma);
          sum += wide(s.normals(u, v)) * (spline[i + 2] * spline[j + 2] / ((1 + off * off) * turn * turn));
        }
      }
      const Vec3d n = normalized(sum);
      out(x, y) = {static_cast<float>(n.x), static_cast<float>(n.y), static_cast<float>(n.z)};
    }
  }
  return out;
}

}  // namespace

TEST_CASE("smooth_normals: as in double precision, in pictures of any width, beside holes and other labels") {
  for (const int width : {3, 17, 40, 93}) {
    Surface s;
    s.shape = {width, 20};
    s.depth = Image<float>(s.shape, 8.0F);
    s.labels = Image<Label>(s.shape, label::road);
    s.normals = Image<Vec3f>(s.shape);
    RandomStream random(5, RandomPurpose::test, 0, 0, 0, 0);
    for (int y = 0; y < s.shape.height; ++y) {
      for (int x = 0; x < width; ++x) {
        s.normals(x, y) = normalized(Vec3f{random.uniform(-0.2F, 0.2F), -1, random.uniform(-0.2F, 0.2F)});
        s.depth(x, y) = random.uniform(7.0F, 9.0F);
        const float kind = random.uniform();
        if (kind < 0.05F) s.normals(x, y) = {};
        if (kind > 0.97F) s.depth(x, y) = std::numeric_limits<float>::quiet_NaN();
        if (kind > 0.5F && kind < 0.6F) s.labels(x, y) = label::sidewalk;
      }
    }
    SmoothNormalsParams params = GuidingNormalsParams{}.given_smoothing;
    params.iterations = 3;
    Surface expected = s;
    for (int i = 0; i < params.iterations; ++i) expected.normals = smoothed_in_doubles(expected, params, 1 << i);
    REQUIRE(s.smooth(params).ok());
    float worst = 0;
    for (int y = 0; y < s.shape.height; ++y) {
      for (int x = 0; x < width; ++x) worst = std::max(worst, length(s.normals(x, y) - expected.normals(x, y)));
    }
    CHECK(worst < 1e-5F);
  }
}

TEST_CASE(
    "smooth_normals: a tap whose normal is normal_sigma off counts a quarter; a sigma of no noise keeps unit length") {
  Surface pair;
  pair.shape = {2, 1};
  pair.depth = Image<float>(pair.shape, 8.0F);
  pair.labels = Image<Label>(pair.shape, label::road);
  pair.normals = Image<Vec3f>(pair.shape, Vec3f{0, -1, 0});
  pair.normals(1, 0) = {0.28F, -0.96F, 0};
  const Vec3f off = pair.normals(1, 0) - pair.normals(0, 0);
  REQUIRE(pair.smooth({1, 0.05F, std::sqrt(dot(off, off))}).ok());
  const Vec3f mean = normalized(Vec3f{0, -6, 0} + Vec3f{0.28F, -0.96F, 0});  // 6 : 4 / 4
  CHECK(pair.normals(0, 0).x == doctest::Approx(mean.x).epsilon(1e-5));
  Surface constant;
  for (Vec3f& n : constant.normals.view().pixels()) n = normalized(Vec3f{0.3F, -0.7F, -0.2F});
  const Vec3f given = constant.normals(0, 0);
  REQUIRE(constant.smooth({5, 0.05F, 1.0F / 2048.0F}).ok());
  for (const Vec3f& n : constant.normals.view().pixels()) CHECK(dot(n, given) == doctest::Approx(1).epsilon(1e-6));
}

TEST_CASE("smooth_normals: a crease within one surface keeps its sides, whose noise falls to less than half") {
  Surface crease;
  for (int y = 0; y < 30; ++y) {
    for (int x = 20; x < 40; ++x) crease.normals(x, y) = normalized(Vec3f{0.6F, -0.8F, 0});
  }
  const Image<Vec3f> truth = crease.normals;
  add_noise(crease.normals.view(), 5);
  const Image<Vec3f> noisy = crease.normals;
  const SmoothNormalsParams given = GuidingNormalsParams{}.given_smoothing;
  REQUIRE(crease.smooth(given).ok());
  const double before = mean_degrees(noisy.view(), truth.view(), 0, 40);
  REQUIRE(before > 2.5);
  CHECK(mean_degrees(crease.normals.view(), truth.view(), 0, 40) < 0.5 * before);
  CHECK(mean_degrees(crease.normals.view(), truth.view(), 18, 22) < 0.5 * before);
  Surface blunt;
  blunt.normals = noisy;
  REQUIRE(blunt.smooth({given.iterations}).ok());
  CHECK(mean_degrees(blunt.normals.view(), truth.view(), 18, 22) > 10);  // every tap counts, whatever its normal
}

TEST_CASE("smooth_normals: a rounding of 1 degree a pixel loses noise and none of its turn") {
  Surface rounding;
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 40; ++x) {
      const float angle = static_cast<float>(x - 20) / 57.29578F;
      rounding.normals(x, y) = {std::sin(angle), -std::cos(angle), 0};
    }
  }
  const Image<Vec3f> truth = rounding.normals;
  add_noise(rounding.normals.view(), 6);
  const double before = mean_degrees(rounding.normals.view(), truth.view(), 5, 35);
  REQUIRE(rounding.smooth(GuidingNormalsParams{}.given_smoothing).ok());
  CHECK(mean_degrees(rounding.normals.view(), truth.view(), 5, 35) < 0.75 * before);
  float left = 0;
  float right = 0;
  for (int y = 0; y < 30; ++y) {
    left += std::asin(rounding.normals(5, y).x) / 30;
    right += std::asin(rounding.normals(35, y).x) / 30;
  }
  CHECK((right - left) * 57.29578F == doctest::Approx(30).epsilon(0.15));
}

TEST_CASE("smooth_normals: noise of 20 degrees on one surface falls below 4, constant normals stay to the bit's edge") {
  Surface s;
  std::uint32_t i = 0;
  for (Vec3f& n : s.normals.view().pixels()) {
    RandomStream random(3, RandomPurpose::test, 0, 0, i++, 0);
    n = normalized(Vec3f{random.uniform(-0.5F, 0.5F), -1, random.uniform(-0.5F, 0.5F)});
  }
  REQUIRE(s.smooth().ok());
  float worst = 1;
  for (int y = 6; y < 24; ++y) {
    for (int x = 6; x < 34; ++x) worst = std::min(worst, -s.normals(x, y).y);
  }
  CHECK(worst > 0.9976F);  // cosine of 4 degrees
  Surface constant;
  REQUIRE(constant.smooth().ok());
  for (const Vec3f& n : constant.normals.view().pixels()) CHECK(n.y == doctest::Approx(-1).epsilon(1e-6));
}

TEST_CASE("smooth_normals: nothing crosses a label border, little a depth step, pixels without a normal stay so") {
  Surface crease;
  Surface step;
  for (int y = 0; y < 30; ++y) {
    for (int x = 20; x < 40; ++x) {
      crease.labels(x, y) = label::building;
      crease.normals(x, y) = {0, 0, -1};
      step.depth(x, y) = 16;
      step.normals(x, y) = {0, 0, -1};
    }
  }
  crease.normals(5, 5) = {};
  REQUIRE(crease.smooth().ok());
  REQUIRE(step.smooth().ok());
  CHECK(crease.normals(19, 15).z == 0.0F);
  CHECK(crease.normals(20, 15).y == 0.0F);
  CHECK(crease.normals(5, 5) == Vec3f{});
  CHECK(step.normals(19, 15).y < -0.999F);
  CHECK(step.normals(20, 15).z < -0.999F);
}

TEST_CASE(
    "guiding normals: where given ones are missing on a wall of noisy depth the wall's own stand in, not its noise") {
  constexpr Shape kShape{160, 120};
  constexpr Intrinsics kCamera{300, 300, 80, 60};
  Image<float> depth(kShape, 10.0F);
  Image<Label> labels(kShape, label::building);
  Image<Vec3f> given(kShape, Vec3f{0, 0, -1});
  Image<Vec3f> normals(kShape);
  std::uint32_t i = 0;
  for (float& z : depth.view().pixels()) {
    RandomStream random(7, RandomPurpose::test, 0, 0, i++, 0);
    z *= 1.0F + random.uniform(-1e-3F, 1e-3F);
  }
  for (int y = 30; y < 90; ++y) {
    for (int x = 50; x < 110; ++x) given(x, y) = {};
  }
  const GuidingNormalsParams params;
  npsim_test::Scratch scratch(guiding_normals_workspace_bytes(params, kShape));
  ObjectMap objects;
  objects.labels = labels.cview();
  DepthNoise noise;
  noise.amplitude = 1e-3F;
  SerialExecutor serial;
  REQUIRE(guiding_normals(params, given.cview(), depth.cview(), labels.cview(), objects, noise, PlanarMap{}, kCamera,
                          GroundPlane{}, normals.view(), scratch.workspace(), serial)
              .ok());
  const Image<Vec3f> truth(kShape, Vec3f{0, 0, -1});
  CHECK(mean_degrees(normals.view(), truth.view(), 50, 110) < 3);
}
