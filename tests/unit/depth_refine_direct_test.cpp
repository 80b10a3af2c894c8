// SPDX-License-Identifier: Apache-2.0
// One Gauss-Newton step of the refinement against a direct solution: the normal equations of a small street in double,
// as a sparse matrix that Eigen factorises (LDL^T), beside the library's step in float, by multigrid and conjugate
// gradients.
#define EIGEN_DONT_VECTORIZE  // g++ 12 warns about AVX-512 intrinsics that Eigen inlines
#include <doctest/doctest.h>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <cmath>
#include <limits>
#include <vector>

#include "depth_refine_fixture.hpp"
#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/depth/detail/refine/linear_solver.hpp"
#include "npsim/depth/detail/refine/system.hpp"
#include "npsim/depth/refine.hpp"

using namespace npsim;
using namespace npsim::depth_detail;
using npsim::refine_test::Street;

namespace {

constexpr double kNoLimit = 1e300;

// 40x30 with uncertain pixels, missing depth of three kinds, and three labels whose weights differ by 10^4.
Street small_street() {
  Street s({40, 30}, 31, 0.01F, 0.05F);
  s.labels.assign(s.shape.pixels(), label::building);
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 40; ++x) {
      if (y > 15) s.labels[s.at(x, y)] = x > 25 ? label::sidewalk : label::road;
      if (x > 8 && x < 13 && y > 3 && y < 9) s.estimate[s.at(x, y)] = 0.0F;
      if ((7 * x + 11 * y) % 53 == 0) s.estimate[s.at(x, y)] = std::numeric_limits<float>::quiet_NaN();
    }
  }
  s.estimate[s.at(20, 20)] = 1e30F;
  const auto weights = solo_label_weights();
  s.label_weights.assign(weights.begin(), weights.end());
  return s;
}

// The losses of a street, linearised at its estimate in the number type T.
template <class T>
struct Linearised {
  Linearised(const LossParams& params, const Street& s)
      : scratch(16 * (loss_problem_bytes<T>(s.shape) + 4096)), estimate(s.estimate.begin(), s.estimate.end()) {
    for (const Vec3f& n : s.normals) normals.push_back(vec_cast<T>(n));
    const LossInput<T> input{{estimate.data(), s.shape},
                             {normals.data(), s.shape},
                             {s.uncertain.data(), s.shape},
                             {s.labels.data(), s.shape},
                             {s.label_weights.data(), s.label_weights.size()},
                             s.k};
    const SerialExecutor serial;
    REQUIRE(prepare_losses<T>(params, input, scratch.workspace(), serial, problem).ok());
    for (ImageView<T>* plane : {&gradient, &out.wxx, &out.wxy, &out.wyy, &out.diagonal, &out.rhs}) {
      REQUIRE(allocate_loss_plane(s.shape, scratch.workspace(), *plane).ok());
    }
  }
  void linearise_into(const SystemPlanes<T>& planes) {
    const SerialExecutor serial;
    LossValues values;
    evaluate_losses<T>(problem, problem.estimate, gradient, values, serial);
    linearise<T, LossBatch<T>>(problem, ImageView<const T>(problem.estimate), ImageView<const T>(gradient), T(0),
                               planes, serial);
  }
  npsim_test::Scratch scratch;
  std::vector<T> estimate;
  std::vector<Vec3<T>> normals;
  LossProblem<T> problem;
  ImageView<T> gradient;
  SystemPlanes<T> out;
};

// H and b of the normal equations H step = b, one row per pixel; pixels without depth keep a 1 on the diagonal.
struct NormalEquations {
  explicit NormalEquations(const SystemPlanes<double>& planes)
      : width(planes.rhs.width()), h(size(planes), size(planes)), b(size(planes)) {
    std::vector<Eigen::Triplet<double>> entries;
    const auto add = [&](int row, int column, double value) {
      if (value != 0) entries.emplace_back(row, column, value);
    };
    // e^T W e with e = (x_right - x, x_below - x).
    const auto add_block = [&](int x, int y) {
      const int pixel[3] = {at(x, y), at(x + 1, y), at(x, y + 1)};
      const double ex[3] = {-1, 1, 0};
      const double ey[3] = {-1, 0, 1};
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
          add(pixel[i], pixel[j],
              planes.wxx(x, y) * ex[i] * ex[j] + planes.wyy(x, y) * ey[i] * ey[j] +
                  planes.wxy(x, y) * (ex[i] * ey[j] + ey[i] * ex[j]));
        }
      }
    };
    for (int y = 0; y < planes.rhs.height(); ++y) {
      for (int x = 0; x < width; ++x) {
        const bool known = planes.diagonal(x, y) > 0;
        if (known) ++pixels;
        add(at(x, y), at(x, y), known ? planes.diagonal(x, y) : 1.0);
        b[at(x, y)] = planes.rhs(x, y);
        if (x + 1 < width && y + 1 < planes.rhs.height()) add_block(x, y);
      }
    }
    h.setFromTriplets(entries.begin(), entries.end());
  }
  [[nodiscard]] Eigen::VectorXd solve() const {
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> direct(h);
    REQUIRE(direct.info() == Eigen::Success);
    return direct.solve(b);
  }
  // What a step lowers the quadratic model by.
  [[nodiscard]] double decrease(const Eigen::VectorXd& step) const { return b.dot(step) - 0.5 * step.dot(h * step); }
  [[nodiscard]] int at(int x, int y) const { return y * width + x; }
  static Eigen::Index size(const SystemPlanes<double>& planes) {
    return static_cast<Eigen::Index>(planes.rhs.width()) * planes.rhs.height();
  }

  int width;
  int pixels = 0;  // with depth
  Eigen::SparseMatrix<double> h;
  Eigen::VectorXd b;
};

// The library's step: float throughout, ended as conjugate_gradients() is told.
Eigen::VectorXd library_step(const LossParams& params, const Street& s, int cap, double share) {
  const SerialExecutor serial;
  npsim_test::Scratch scratch(gauss_newton_bytes(s.shape) + 4096);
  Multigrid grid;
  NewtonVectors v;
  REQUIRE(allocate_multigrid(s.shape, scratch.workspace(), grid).ok());
  for (ImageView<float>* plane : {&v.rhs, &v.corrected, &v.direction, &v.image, &v.sum}) {
    REQUIRE(allocate_grid_plane(s.shape, scratch.workspace(), *plane).ok());
  }
  REQUIRE(scratch.workspace().allocate(static_cast<std::size_t>(s.shape.height), v.row_sums).ok());
  const GridLevel& level = grid.level[0];
  Linearised<float> system(params, s);
  system.linearise_into({level.wxx, level.wxy, level.wyy, level.diagonal, v.rhs});
  build_multigrid<simd::F32>(grid, GaussNewtonParams{}.grid_stiffness, serial);
  const NewtonStep found = conjugate_gradients<simd::F32>(grid, cap, share, kNoLimit, v, serial);
  REQUIRE(found.iterations > 0);
  Eigen::VectorXd step = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(s.shape.pixels()));
  for (int y = 0; y < s.shape.height; ++y) {
    for (int x = 0; x < s.shape.width; ++x) {
      const double sum = found.sum.empty() ? 0.0 : static_cast<double>(found.sum(x, y));
      if (level.diagonal(x, y) == 0.0F) continue;  // such pixels have no equation, and take no step
      step[y * s.shape.width + x] = sum + static_cast<double>(found.alpha) * static_cast<double>(found.direction(x, y));
    }
  }
  return step;
}

// The default, the pipeline's, and the thesis' own.
std::vector<LossParams> cases() {
  std::vector<LossParams> all(3, default_refine_losses());
  all[1].continuity = ContinuityForm::unit_tangents;
  all[1].lambda = {1, 1, 500};
  all[1].normal_in_uncertain = false;
  all[2] = thesis_refine_params().loss;
  return all;
}

}  // namespace

TEST_CASE("a Gauss-Newton step agrees with the direct solution of its normal equations") {
  const Street s = small_street();
  for (const LossParams& params : cases()) {
    CAPTURE(params.lambda.depth);
    Linearised<double> exact(params, s);
    exact.linearise_into(exact.out);
    const NormalEquations equations(exact.out);
    CHECK(equations.pixels > 1000);
    CHECK(equations.pixels < 1200);
    const Eigen::VectorXd direct = equations.solve();
    REQUIRE(direct.lpNorm<Eigen::Infinity>() > 0.01);  // one pixel at least moves by a percent

    const Eigen::VectorXd step = library_step(params, s, 200, 0.0);
    const double off = (step - direct).lpNorm<Eigen::Infinity>() / direct.lpNorm<Eigen::Infinity>();
    const double lost = 1 - equations.decrease(step) / equations.decrease(direct);
    MESSAGE("off by " << off << " of the largest move, " << lost << " of the decrease lost");
    CHECK(off < 1e-5);
    CHECK(lost < 1e-9);
    CHECK(lost > -1e-9);  // nothing lowers the model by more than its minimum does

    // As loosely as refine_with_normals() solves.
    const GaussNewtonParams loose;
    const Eigen::VectorXd taken = library_step(params, s, loose.inner_steps, static_cast<double>(loose.inner_decrease));
    const double left = 1 - equations.decrease(taken) / equations.decrease(direct);
    MESSAGE("taken: " << left << " of the decrease left");
    CHECK(left < 0.05);
  }
}
