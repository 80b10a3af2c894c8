// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/refine/system.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/depth/detail/refine/losses.hpp"

using namespace npsim;
using namespace npsim::depth_detail;

namespace {

std::vector<LossParams> all_forms() {
  std::vector<LossParams> forms;
  for (const TangentForm t : {TangentForm::perspective, TangentForm::thesis}) {
    for (const ContinuityForm c : {ContinuityForm::printed, ContinuityForm::unit_tangents}) {
      for (const DepthTerm d : {DepthTerm::metric, DepthTerm::relative}) {
        LossParams p;
        p.tangents = t;
        p.continuity = c;
        p.depth_term = d;
        forms.push_back(p);
      }
    }
  }
  return forms;
}

// A bumpy surface; normals that agree with it, or not.
struct Surface {
  explicit Surface(Shape s) : shape(s), z(s.pixels()), normals(s.pixels()), labels(s.pixels(), label::car) {
    k = {300.0F, 280.0F, 0.4F * static_cast<float>(s.width), 0.6F * static_cast<float>(s.height)};
    RandomStream random(5, RandomPurpose::test, 0, 0, 0, 0);
    for (int y = 0; y < s.height; ++y) {
      for (int x = 0; x < s.width; ++x) {
        const float step = x > s.width / 2 ? 0.3F : 1.0F;
        z[at(x, y)] =
            static_cast<double>(20.0F * step * (1 + 0.01F * static_cast<float>(y)) * random.uniform(0.995F, 1.005F));
        normals[at(x, y)] = {static_cast<double>(random.uniform(-1, 1)), static_cast<double>(random.uniform(-1, 1)),
                             -2};
        if (x % 3 == 0) labels[at(x, y)] = label::road;
      }
    }
    weights.resize(label::road + 1);
    weights[label::road] = {0.5F, 2.0F, 3.0F};
  }
  std::size_t at(int x, int y) const { return static_cast<std::size_t>(y * shape.width + x); }

  // Residuals of a pixel, from points in space: n - N, then X.N and Y.N.
  std::array<double, 5> residuals(const LossParams& p, int x, int y, double here, double right, double below,
                                  const Vec3d& given) const {
    const auto point = [&](int i, int j, double depth) {
      return Vec3d{(i + 0.5 - static_cast<double>(k.cx)) / static_cast<double>(k.fx) * depth,
                   (j + 0.5 - static_cast<double>(k.cy)) / static_cast<double>(k.fy) * depth, depth};
    };
    Vec3d tx, ty;
    if (p.tangents == TangentForm::thesis) {
      tx = {1, 0, (right - here) * static_cast<double>(k.fx) / here};
      ty = {0, 1, (below - here) * static_cast<double>(k.fy) / here};
    } else {
      tx = (point(x + 1, y, right) - point(x, y, here)) * (static_cast<double>(k.fx) / right);
      ty = (point(x, y + 1, below) - point(x, y, here)) * (static_cast<double>(k.fy) / below);
    }
    const Vec3d n = normalized(cross(ty, tx));
    if (p.continuity == ContinuityForm::unit_tangents) {
      tx = normalized(tx);
      ty = normalized(ty);
    }
    return {n.x - given.x, n.y - given.y, n.z - given.z, dot(tx, given), dot(ty, given)};
  }
  Vec3d true_normal(const LossParams& p, int x, int y) const {
    const std::array<double, 5> n = residuals(p, x, y, z[at(x, y)], z[at(x + 1, y)], z[at(x, y + 1)], Vec3d{0, 0, 0});
    return {n[0], n[1], n[2]};
  }
  void make_normals_true(const LossParams& p) {
    for (int y = 0; y + 1 < shape.height; ++y) {
      for (int x = 0; x + 1 < shape.width; ++x) normals[at(x, y)] = true_normal(p, x, y);
    }
  }

  Shape shape;
  Intrinsics k;
  std::vector<double> z;
  std::vector<Vec3d> normals;
  std::vector<Label> labels;
  std::vector<LossWeights> weights;
};

// The system of a surface in the number type T.
template <class T>
struct System {
  System(const LossParams& p, const Surface& s)
      : estimate(s.z.begin(), s.z.end()), scratch(16 * (loss_problem_bytes<T>(s.shape) + 4096)) {
    Workspace& workspace = scratch.workspace();
    for (const Vec3d& n : s.normals) normals.push_back(vec_cast<T>(n));
    const LossInput<T> input{{estimate.data(), s.shape},
                             {normals.data(), s.shape},
                             {},
                             {s.labels.data(), s.shape},
                             {s.weights.data(), s.weights.size()},
                             s.k};
    const SerialExecutor serial;
    REQUIRE(prepare_losses<T>(p, input, workspace, serial, problem).ok());
    for (ImageView<T>* plane : {&depth, &gradient, &out.wxx, &out.wxy, &out.wyy, &out.diagonal, &out.rhs}) {
      REQUIRE(allocate_loss_plane(s.shape, workspace, *plane).ok());
    }
    for (std::size_t i = 0; i < loss_plane_elements(s.shape); ++i) depth.data()[i] = problem.estimate.data()[i];
  }
  double evaluate() {
    const SerialExecutor serial;
    LossValues values;
    evaluate_losses<T>(problem, depth, gradient, values, serial);
    return values.total;
  }
  void linearise_here() {
    evaluate();
    const SerialExecutor serial;
    linearise<T, LossBatch<T>>(problem, ImageView<const T>(depth), ImageView<const T>(gradient), damping, out, serial);
  }
  std::vector<T> estimate;
  std::vector<Vec3<T>> normals;
  npsim_test::Scratch scratch;
  LossProblem<T> problem;
  ImageView<T> depth, gradient;
  SystemPlanes<T> out;
  T damping = 0;
};

}  // namespace

TEST_CASE("where the residuals vanish the system is J^T J by central differences, for every form of the losses") {
  for (const LossParams& p : all_forms()) {
    Surface s({14, 9});
    s.make_normals_true(p);
    System<double> system(p, s);
    system.linearise_here();
    const double count = static_cast<double>(system.problem.depth_count);
    const double terms = static_cast<double>(system.problem.normal_count);
    for (int y = 0; y + 1 < s.shape.height; ++y) {
      for (int x = 0; x + 1 < s.shape.width; ++x) {
        const double here = s.z[s.at(x, y)];
        const double right = s.z[s.at(x + 1, y)];
        const double below = s.z[s.at(x, y + 1)];
        const Vec3d n = s.normals[s.at(x, y)];
        constexpr double kStep = 1e-6;
        const auto up_x = s.residuals(p, x, y, here, right * std::exp(kStep), below, n);
        const auto down_x = s.residuals(p, x, y, here, right * std::exp(-kStep), below, n);
        const auto up_y = s.residuals(p, x, y, here, right, below * std::exp(kStep), n);
        const auto down_y = s.residuals(p, x, y, here, right, below * std::exp(-kStep), n);
        const LossWeights w = s.labels[s.at(x, y)] == label::road ? s.weights[label::road] : LossWeights{};
        double xx = 0, xy = 0, yy = 0;
        for (std::size_t i = 0; i < 5; ++i) {
          const double scale = 2 * count / terms *
                               (i < 3 ? static_cast<double>(p.lambda.normal) * static_cast<double>(w.normal)
                                      : static_cast<double>(p.lambda.continuity) * static_cast<double>(w.continuity));
          const double jx = (up_x[i] - down_x[i]) / (2 * kStep);
          const double jy = (up_y[i] - down_y[i]) / (2 * kStep);
          xx += scale * jx * jx;
          xy += scale * jx * jy;
          yy += scale * jy * jy;
        }
        const double trace = xx + yy;
        CHECK(std::abs(system.out.wxx(x, y) - xx) < 1e-6 * trace);
        CHECK(std::abs(system.out.wxy(x, y) - xy) < 1e-6 * trace);
        CHECK(std::abs(system.out.wyy(x, y) - yy) < 1e-6 * trace);
        const double unit = p.depth_term == DepthTerm::metric ? static_cast<double>(p.depth_unit_m) : here;
        const double diagonal =
            2 * static_cast<double>(p.lambda.depth) * static_cast<double>(w.depth) * (here / unit) * (here / unit);
        CHECK(std::abs(system.out.diagonal(x, y) - diagonal) < 1e-9 * diagonal);
      }
    }
  }
}

TEST_CASE("the right-hand side is minus the gradient in log depth, times the number of pixels") {
  for (const LossParams& p : all_forms()) {
    const Surface s({14, 9});
    System<double> system(p, s);
    for (int i = 0; i < 20; ++i) {
      const int x = (i * 5) % 14;
      const int y = (i * 3) % 9;
      const double z = system.depth(x, y);
      constexpr double kStep = 1e-6;
      system.depth(x, y) = z * std::exp(kStep);
      const double above = system.evaluate();
      system.depth(x, y) = z * std::exp(-kStep);
      const double below = system.evaluate();
      system.depth(x, y) = z;
      system.linearise_here();
      const double expected = -(above - below) / (2 * kStep) * static_cast<double>(system.problem.depth_count);
      CHECK(std::abs(system.out.rhs(x, y) - expected) < 1e-4 * (std::abs(expected) + 1e-2));
    }
  }
}

TEST_CASE("across a step in depth the model's minimum lies near the given surface, where J^T J would overshoot") {
  for (const LossParams& form : all_forms()) {
    for (const double jump : {0.2, 0.5, 2.0, 5.0}) {
      LossParams p = form;
      p.lambda.depth = 0;
      Surface s({2, 2});
      s.make_normals_true(p);
      s.z[1] *= jump;  // the right neighbour of the only pixel with a normal
      System<double> system(p, s);
      system.linearise_here();
      // The one block, applied to what is missing, gives the pull on the neighbour.
      const double missing = -std::log(jump);
      const double share = system.out.wxx(0, 0) * missing / system.out.rhs(1, 0);
      CHECK(share > 0.6);
      CHECK(share < 1.7);
    }
  }
}

TEST_CASE("float agrees with double; blocks are positive semidefinite, also where normals contradict depth") {
  for (const LossParams& p : all_forms()) {
    Surface s({37, 21});
    for (std::size_t i = 0; i < s.z.size(); i += 7) s.normals[i] = {1, 0, 0.001};
    System<double> exact(p, s);
    System<float> system(p, s);
    exact.linearise_here();
    system.linearise_here();
    for (int y = 0; y < s.shape.height; ++y) {
      for (int x = 0; x < s.shape.width; ++x) {
        const double xx = static_cast<double>(system.out.wxx(x, y));
        const double xy = static_cast<double>(system.out.wxy(x, y));
        const double yy = static_cast<double>(system.out.wyy(x, y));
        const double trace = exact.out.wxx(x, y) + exact.out.wyy(x, y);
        CHECK(std::abs(xx - exact.out.wxx(x, y)) <= 1e-5 * trace);
        CHECK(std::abs(xy - exact.out.wxy(x, y)) <= 1e-5 * trace);
        CHECK(std::abs(yy - exact.out.wyy(x, y)) <= 1e-5 * trace);
        CHECK(xx >= 0);
        CHECK(yy >= 0);
        CHECK(xy * xy <= xx * yy * 1.00001);
      }
    }
  }
}

TEST_CASE(
    "a pixel at the end of its range is held while the gradient points outward, and freed when it points inward") {
  for (const LossParams& form : all_forms()) {
    LossParams p = form;
    p.lambda.depth = 0;
    const Surface s({14, 9});
    for (const double end : {0.25, 4.0}) {
      System<double> inside(p, s);
      System<double> at_end(p, s);
      inside.linearise_here();
      for (std::size_t i = 0; i < loss_plane_elements(s.shape); ++i) at_end.problem.estimate.data()[i] /= end;
      at_end.linearise_here();
      int held = 0;
      for (int y = 0; y < 9; ++y) {
        for (int x = 0; x < 14; ++x) {
          const double pull = inside.out.rhs(x, y);
          const bool outward = end < 1 ? pull < 0 : pull > 0;
          held += outward ? 1 : 0;
          CHECK(at_end.out.rhs(x, y) == (outward ? 0.0 : pull));
          CHECK(at_end.out.diagonal(x, y) == (outward ? static_cast<double>(kHeldDiagonal) : 0.0));
          CHECK(at_end.out.wxx(x, y) == inside.out.wxx(x, y));
        }
      }
      CHECK(held > 20);
      CHECK(held < 106);
    }
  }
}

TEST_CASE("damping adds its share of the block's trace to the diagonal") {
  for (const LossParams& p : all_forms()) {
    const Surface s({14, 9});
    System<double> plain(p, s);
    System<double> damped(p, s);
    damped.damping = 0.5;
    plain.linearise_here();
    damped.linearise_here();
    for (int y = 0; y < 9; ++y) {
      for (int x = 0; x < 14; ++x) {
        const double expected = plain.out.diagonal(x, y) + 0.5 * (plain.out.wxx(x, y) + plain.out.wyy(x, y));
        CHECK(std::abs(damped.out.diagonal(x, y) - expected) <= 1e-12 * expected);
        CHECK(damped.out.rhs(x, y) == plain.out.rhs(x, y));
      }
    }
  }
}
