// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/normals/fitted_normals.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

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

// The formulas of fitted_normals.hpp, one sample after the other.
[[nodiscard]] Vec3d reference_normal(const Tower& t, int x, int y) {
  const FittedNormalsParams p;
  const ObjectMap objects{t.labels.cview(), {}};
  const double w0 = 1.0 / static_cast<double>(t.depth(x, y));
  const double sigma = static_cast<double>(t.noise.amplitude);  // of stereo
  const double step = static_cast<double>(p.step) * w0;
  const auto spacing = static_cast<double>(
      depth_detail::footprint_px(p, t.noise, t.k, t.shape.width, p.max_size_m, static_cast<float>(w0)) / 8.0F);
  struct Sample {
    double u, v, w, weight;
  };
  std::vector<Sample> samples;
  std::vector<double> some;
  const double gaussian[9] = {0.135, 0.325, 0.607, 0.882, 1.0, 0.882, 0.607, 0.325, 0.135};
  for (int j = 0; j < 9; ++j) {
    for (int i = 0; i < 9; ++i) {
      const int dx = static_cast<int>(std::floor(spacing * (i - 4) + 0.5));
      const int dy = static_cast<int>(std::floor(spacing * (j - 4) + 0.5));
      if (!t.depth.cview().contains(x + dx, y + dy) || !is_valid_depth(t.depth(x + dx, y + dy))) continue;
      if (!objects.same(x, y, x + dx, y + dy)) continue;
      const double w = 1.0 / static_cast<double>(t.depth(x + dx, y + dy));
      samples.push_back({static_cast<double>(dx), static_cast<double>(dy), w, gaussian[i] * gaussian[j]});
      if (i % 2 == 0 && j % 2 == 0) some.push_back(w);
    }
  }
  double about = w0;
  if (some.size() >= 3) {
    std::sort(some.begin(), some.end());
    const double median = some[some.size() / 2];
    if (std::fabs(w0 - median) > step + 3.0 * sigma) about = median;
  }
  double a = 0, b = 0, c = about;
  for (const double tolerance : {step + 3.0 * sigma, 0.25 * step + 3.0 * sigma}) {
    double s = 0, su = 0, sv = 0, suu = 0, suv = 0, svv = 0, sw = 0, suw = 0, svw = 0;
    for (const Sample& at : samples) {
      const double off = (at.w - (c + a * at.u + b * at.v)) / tolerance;
      const double k = at.weight / (1.0 + off * off);
      s += k, su += k * at.u, sv += k * at.v, sw += k * at.w;
      suu += k * at.u * at.u, suv += k * at.u * at.v, svv += k * at.v * at.v;
      suw += k * at.u * at.w, svw += k * at.v * at.w;
    }
    const double cuu = suu - su * su / s, cuv = suv - su * sv / s, cvv = svv - sv * sv / s;
    const double cuw = suw - su * sw / s, cvw = svw - sv * sw / s;
    const double det = cuu * cvv - cuv * cuv;
    if (!(det > 1e-3 * cuu * cvv) || !(cuu > 0.1 * s) || !(cvv > 0.1 * s)) return {};
    a = (cuw * cvv - cvw * cuv) / det;
    b = (cvw * cuu - cuw * cuv) / det;
    c = (sw - a * su - b * sv) / s;
  }
  const double at_x = static_cast<double>(x) + 0.5 - static_cast<double>(t.k.cx);
  const double at_y = static_cast<double>(y) + 0.5 - static_cast<double>(t.k.cy);
  return normalized(Vec3d{-static_cast<double>(t.k.fx) * a, -static_cast<double>(t.k.fy) * b, at_x * a + at_y * b - c});
}

}  // namespace

TEST_CASE("fitted normals: as in double precision, near and far, beside outlines, patches and holes") {
  SerialExecutor serial;
  for (const float farther : {1.0F, 16.0F}) {
    Tower tower(farther > 1.0F ? 640 : 320);
    tower.add_noise();
    for (float& z : tower.depth.view().pixels()) z *= farther;
    RandomStream random(11, RandomPurpose::test, 0, 0, 0, 0);
    for (int i = 0; i < 300; ++i) {
      const auto x = static_cast<int>(random.uniform() * static_cast<float>(tower.shape.width));
      const auto y = static_cast<int>(random.uniform() * static_cast<float>(tower.shape.height));
      tower.depth(x, y) = i % 3 == 0 ? 0.0F : farther * (8.0F + 10.0F * random.uniform());
      if (i % 5 == 0) tower.labels(x, y) = label::person;
    }
    REQUIRE(tower.run(serial).ok());
    double worst = 0;
    int judged = 0;
    for (int y = 0; y<tower.shape.height; y += farther> 1.0F ? 7 : 1) {
      for (int x = 0; x < tower.shape.width; ++x) {
        if (!is_valid_depth(tower.depth(x, y))) continue;
        const Vec3d expected = reference_normal(tower, x, y);
        const Vec3f& n = tower.normals(x, y);
        const Vec3d got{static_cast<double>(n.x), static_cast<double>(n.y), static_cast<double>(n.z)};
        if (expected == Vec3d{} || got == Vec3d{}) continue;
        worst = std::max(worst, length(got - expected));
        ++judged;
      }
    }
    CHECK(judged > 10000);
    CHECK(worst < 1e-4);
  }
}

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
