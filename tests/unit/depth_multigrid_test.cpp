// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/refine/linear_solver.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/depth/refine.hpp"

using namespace npsim;
using namespace npsim::depth_detail;

namespace {

constexpr double kNoLimit = 1e300;
constexpr float kStiffness = GaussNewtonParams{}.grid_stiffness;

// A grid with its own memory; the planes of the finest level are zero at first.
struct Grid {
  explicit Grid(Shape s) : shape(s), scratch(gauss_newton_bytes(s) + 4096) {
    Workspace& workspace = scratch.workspace();
    REQUIRE(allocate_multigrid(s, workspace, grid).ok());
    for (ImageView<float>* plane : {&v.rhs, &v.corrected, &v.direction, &v.image, &v.sum}) {
      REQUIRE(allocate_grid_plane(s, workspace, *plane).ok());
      clear(*plane);
    }
    REQUIRE(workspace.allocate(static_cast<std::size_t>(s.height), v.row_sums).ok());
    const GridLevel& level = grid.level[0];
    for (const ImageView<float>& plane : {level.wxx, level.wxy, level.wyy, level.diagonal}) clear(plane);
  }
  static void clear(const ImageView<float>& plane) {
    for (std::ptrdiff_t i = 0; i < plane.stride() * plane.height(); ++i) plane.data()[i] = 0.0F;
  }
  // Random blocks of rank 2 whose size varies by `spread` powers of ten; `holes` of the pixels have no equation.
  void randomise(std::uint32_t seed, float spread, float diagonal, float holes) {
    RandomStream random(seed, RandomPurpose::test, 0, 0, 0, 0);
    std::vector<bool> present(shape.pixels());
    for (std::size_t i = 0; i < present.size(); ++i) present[i] = random.uniform() >= holes;
    const GridLevel& level = grid.level[0];
    const auto at = [&](int x, int y) { return present[static_cast<std::size_t>(y * shape.width + x)]; };
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const float size = std::pow(10.0F, random.uniform(-spread, 0.0F));
        const float angle = random.uniform(0.0F, 3.1F);
        if (!at(x, y)) continue;
        level.diagonal(x, y) = diagonal;
        v.rhs(x, y) = random.uniform(-1, 1);
        if (x + 1 == shape.width || y + 1 == shape.height || !at(x + 1, y) || !at(x, y + 1)) continue;
        const float c = std::cos(angle);
        const float s = std::sin(angle);
        level.wxx(x, y) = size * (c * c + 0.3F);
        level.wxy(x, y) = size * c * s;
        level.wyy(x, y) = size * (s * s + 0.3F);
      }
    }
  }
  void build() {
    const SerialExecutor serial;
    build_multigrid<simd::F32>(grid, kStiffness, serial);
  }
  std::vector<double> cycle(const std::vector<double>& b) {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x)
        v.rhs(x, y) = static_cast<float>(b[static_cast<std::size_t>(y * shape.width + x)]);
    }
    const SerialExecutor serial;
    multigrid_cycle<simd::F32>(grid, ImageView<const float>(v.rhs), StoreRow<simd::F32>{v.corrected, nullptr}, serial);
    return plane(v.corrected);
  }
  static std::vector<double> plane(const ImageView<const float>& p) {
    std::vector<double> values;
    for (int y = 0; y < p.height(); ++y) {
      for (int x = 0; x < p.width(); ++x) values.push_back(static_cast<double>(p(x, y)));
    }
    return values;
  }
  // H u in double, straight from the definition.
  std::vector<double> apply(const std::vector<double>& u) const {
    const GridLevel& level = grid.level[0];
    const auto at = [&](int x, int y) { return static_cast<std::size_t>(y * shape.width + x); };
    std::vector<double> out(u.size());
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        out[at(x, y)] += static_cast<double>(level.diagonal(x, y)) * u[at(x, y)];
        if (x + 1 == shape.width || y + 1 == shape.height) continue;
        const double ex = u[at(x + 1, y)] - u[at(x, y)];
        const double ey = u[at(x, y + 1)] - u[at(x, y)];
        const double along_x = static_cast<double>(level.wxx(x, y)) * ex + static_cast<double>(level.wxy(x, y)) * ey;
        const double along_y = static_cast<double>(level.wxy(x, y)) * ex + static_cast<double>(level.wyy(x, y)) * ey;
        out[at(x, y)] -= along_x + along_y;
        out[at(x + 1, y)] += along_x;
        out[at(x, y + 1)] += along_y;
      }
    }
    return out;
  }

  Shape shape;
  npsim_test::Scratch scratch;
  Multigrid grid;
  NewtonVectors v;
};

double inner(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

// The solution by Gaussian elimination without pivoting (H is symmetric positive definite).
std::vector<double> dense_solution(const Grid& g, std::vector<double> b) {
  const std::size_t n = b.size();
  std::vector<double> m(n * n);
  for (std::size_t j = 0; j < n; ++j) {
    std::vector<double> unit(n);
    unit[j] = 1;
    const std::vector<double> column = g.apply(unit);
    for (std::size_t i = 0; i < n; ++i) m[i * n + j] = column[i];
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t r = i + 1; r < n; ++r) {
      const double f = m[r * n + i] / m[i * n + i];
      if (f == 0) continue;
      for (std::size_t c = i; c < n; ++c) m[r * n + c] -= f * m[i * n + c];
      b[r] -= f * b[i];
    }
  }
  for (std::size_t i = n; i-- > 0;) {
    for (std::size_t c = i + 1; c < n; ++c) b[i] -= m[i * n + c] * b[c];
    b[i] /= m[i * n + i];
  }
  return b;
}

std::vector<double> random_values(std::size_t n, std::uint32_t seed) {
  RandomStream random(seed, RandomPurpose::test, 0, 0, 0, 0);
  std::vector<double> u(n);
  for (double& x : u) x = static_cast<double>(random.uniform(-1, 1));
  return u;
}

std::vector<double> solution_of(const NewtonStep& step) {
  std::vector<double> u = Grid::plane(step.direction);
  for (double& x : u) x *= static_cast<double>(step.alpha);
  if (!step.sum.empty()) {
    const std::vector<double> sum = Grid::plane(step.sum);
    for (std::size_t i = 0; i < u.size(); ++i) u[i] += sum[i];
  }
  return u;
}

}  // namespace

TEST_CASE("conjugate gradients agree with a dense solution in double, at widths around the batch and with holes") {
  const SerialExecutor serial;
  for (const Shape shape : {Shape{1, 1}, Shape{1, 9}, Shape{2, 2}, Shape{9, 1}, Shape{15, 5}, Shape{16, 6},
                            Shape{17, 7}, Shape{33, 9}, Shape{20, 33}}) {
    for (const float holes : {0.0F, 0.2F}) {
      Grid g(shape);
      g.randomise(3, 2.0F, 0.05F, 0.0F);
      if (holes > 0) g.randomise(3, 2.0F, 0.05F, holes);
      const GridLevel& level = g.grid.level[0];
      std::vector<double> b = Grid::plane(g.v.rhs);
      g.build();
      const NewtonStep step = conjugate_gradients<simd::F32>(g.grid, 200, 0.0, kNoLimit, g.v, serial);
      REQUIRE(step.iterations > 0);
      const std::vector<double> found = solution_of(step);
      const std::vector<double> exact = dense_solution(g, b);
      for (std::size_t i = 0; i < exact.size(); ++i) {
        const auto x = static_cast<int>(i) % shape.width;
        const auto y = static_cast<int>(i) / shape.width;
        if (level.diagonal(x, y) == 0.0F) continue;  // a hole
        CHECK(std::abs(found[i] - exact[i]) < 1e-3 * (1 + std::abs(exact[i])));
      }
    }
  }
}

TEST_CASE("the cycle is a symmetric positive map, also where blocks vary by four orders of magnitude") {
  for (const float spread : {0.0F, 4.0F}) {
    Grid g({61, 38});
    g.randomise(4, spread, 1e-3F, 0.1F);
    g.build();
    const std::vector<double> a = random_values(g.shape.pixels(), 1);
    const std::vector<double> b = random_values(g.shape.pixels(), 2);
    const std::vector<double> ca = g.cycle(a);
    const std::vector<double> cb = g.cycle(b);
    CHECK(inner(a, ca) > 0);
    CHECK(inner(b, cb) > 0);
    CHECK(std::abs(inner(a, cb) - inner(b, ca)) < 1e-4 * std::sqrt(inner(a, ca) * inner(b, cb)));
  }
}

TEST_CASE("the number of iterations grows by at most two with each doubling of the image") {
  const SerialExecutor serial;
  int before = 8;
  for (const int size : {64, 128, 256, 512, 1024}) {
    Grid g({size, size});
    g.randomise(6, 0.5F, 1e-4F, 0.0F);
    g.build();
    const NewtonStep step = conjugate_gradients<simd::F32>(g.grid, 60, 1e-4, kNoLimit, g.v, serial);
    CHECK(step.iterations <= before + 2);
    CHECK(step.iterations <= 14);
    before = step.iterations;
  }
}

TEST_CASE("a system without a diagonal, or without anything, gives finite numbers") {
  const SerialExecutor serial;
  Grid singular({40, 30});
  singular.randomise(7, 1.0F, 0.0F, 0.3F);
  singular.build();
  const NewtonStep step = conjugate_gradients<simd::F32>(singular.grid, 20, 0.0, kNoLimit, singular.v, serial);
  if (step.iterations > 0) {
    for (const double u : solution_of(step)) CHECK(std::isfinite(u));
  }
  Grid empty({40, 30});
  empty.build();
  CHECK(conjugate_gradients<simd::F32>(empty.grid, 20, 0.0, kNoLimit, empty.v, serial).iterations == 0);
}
