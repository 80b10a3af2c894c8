// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <vector>

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
  template <class F = simd::F32>
  void run(int iterations = DenoiseParams{}.iterations) {
    DenoiseParams params;
    params.iterations = iterations;
    std::vector<float> guide(DenoiseGuides::floats(shape)), planes(3 * shape.pixels()), other(3 * shape.pixels());
    const DenoiseGuides guides{shape, {guide.data(), guide.size()}};
    std::size_t i = 0;
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x, ++i) {
        guides.set(x, y, position(x, y), normal(x, y));
        planes[i] = irradiance(x, y).x;
        planes[shape.pixels() + i] = irradiance(x, y).y;
        planes[2 * shape.pixels() + i] = irradiance(x, y).z;
      }
    }
    Span<float> in(planes.data(), planes.size()), out(other.data(), other.size());
    SerialExecutor serial;
    REQUIRE(denoise_planes<F>(params, guides, 3, in, out, serial).ok());
    for (i = 0; i < shape.pixels(); ++i) {
      irradiance.view().data()[i] = {in[i], in[shape.pixels() + i], in[2 * shape.pixels() + i]};
    }
  }
  void add_noise() {
    for (std::size_t i = 0; i < shape.pixels(); ++i) {
      RandomStream pixel(5, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(i), 0);
      irradiance.view().data()[i].x += pixel.uniform(-1, 1);
    }
  }
};

// One iteration, as the header says it, in double.
std::vector<Vec3d> by_definition(const Grid& grid, const std::vector<Vec3d>& in, int step) {
  const DenoiseParams params;
  const auto index = [&](int x, int y) { return static_cast<std::size_t>(y * grid.shape.width + x); };
  std::vector<Vec3d> out(in.size());
  for (int y = 0; y < grid.shape.height; ++y) {
    for (int x = 0; x < grid.shape.width; ++x) {
      const Vec3d p = vec_cast<double>(grid.position.cview()(x, y));
      const Vec3d n = vec_cast<double>(grid.normal.cview()(x, y));
      Vec3d sum;
      double weights = 0;
      for (int j = -1; j <= 1; ++j) {
        for (int i = -1; i <= 1; ++i) {
          const int qx = x + i * step, qy = y + j * step;
          if (qx < 0 || qy < 0 || qx >= grid.shape.width || qy >= grid.shape.height || !(p.z > 0)) continue;
          const Vec3d q = vec_cast<double>(grid.position.cview()(qx, qy));
          const double cosine = dot(n, vec_cast<double>(grid.normal.cview()(qx, qy)));
          if (!(q.z > 0) || !(cosine > 0)) continue;
          const double off = dot(n, q - p) / (static_cast<double>(params.plane_sigma) * p.z);
          const double spline = (i == 0 ? 0.5 : 0.25) * (j == 0 ? 0.5 : 0.25);
          const double w = spline * std::pow(cosine, 1 << params.normal_power_doublings) / (1 + off * off);
          sum += in[index(qx, qy)] * w;
          weights += w;
        }
      }
      out[index(x, y)] = weights > 0 ? sum / weights : in[index(x, y)];
    }
  }
  return out;
}

// A bumpy, creased surface with holes and a step in depth, and noise on it.
Grid hard_grid() {
  Grid grid;
  for (int y = 0; y < grid.shape.height; ++y) {
    for (int x = 0; x < grid.shape.width; ++x) {
      RandomStream pixel(9, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y));
      grid.position(x, y).z = (x > 30 ? 9.0F : 5.0F) + 0.05F * pixel.uniform(-1, 1);
      grid.normal(x, y) = normalized(Vec3f{0.3F * pixel.uniform(-1, 1), y > 20 ? -1.0F : 0.0F, -1.0F});
      if (pixel.uniform() < 0.1F) grid.position(x, y) = grid.normal(x, y) = {};
    }
  }
  grid.add_noise();
  return grid;
}

}  // namespace

TEST_CASE("denoise keeps a constant and takes noise on one plane down by at least ten in standard deviation") {
  Grid grid;
  grid.add_noise();
  double before = 0;
  for (std::size_t i = 0; i < grid.shape.pixels(); ++i) {
    const double noise = static_cast<double>(grid.irradiance.view().data()[i].x) - 3;
    before += noise * noise;
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

TEST_CASE("denoise: the double-precision definition within 1e-5, among creases, steps and holes, at every border") {
  Grid grid = hard_grid();
  std::vector<Vec3d> expected;
  for (const Vec3f& e : Span<const Vec3f>(grid.irradiance.view().data(), grid.shape.pixels())) {
    expected.push_back(vec_cast<double>(e));
  }
  for (const int step : {1, 2, 4, 8}) expected = by_definition(grid, expected, step);
  grid.run();
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const Vec3d got = vec_cast<double>(grid.irradiance.view().data()[i]);
    CHECK(length(got - expected[i]) <= 1e-5 * length(expected[i]));
  }
}

TEST_CASE("denoise: one lane and all lanes give the same bits") {
  Grid one = hard_grid();
  Grid all = hard_grid();
  one.run<simd::scalar::F32>();
  all.run();
  CHECK(std::memcmp(one.irradiance.view().data(), all.irradiance.view().data(), sizeof(Vec3f) * one.shape.pixels()) ==
        0);
}

TEST_CASE("denoise: filtering two lights and adding is filtering their sum") {
  Grid a = hard_grid();
  Grid b = hard_grid();
  Grid both = hard_grid();
  for (std::size_t i = 0; i < a.shape.pixels(); ++i) {
    b.irradiance.view().data()[i] = {static_cast<float>(i % 7), 0, 1};
    both.irradiance.view().data()[i] += b.irradiance.view().data()[i];
  }
  a.run();
  b.run();
  both.run();
  for (std::size_t i = 0; i < a.shape.pixels(); ++i) {
    const Vec3f sum = a.irradiance.view().data()[i] + b.irradiance.view().data()[i];
    CHECK(length(sum - both.irradiance.view().data()[i]) <= 1e-5F * length(sum));
  }
}
