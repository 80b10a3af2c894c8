// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/refine.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "depth_refine_fixture.hpp"
#include "npsim/core/random.hpp"
#include "npsim/depth/refine.hpp"
#include "npsim/exec/thread_pool.hpp"

using namespace npsim;
using namespace npsim::refine_test;

namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// The unit of the thesis' network, perspective tangents, lambda (1, 5, 1).
RefineParams printed_params() {
  RefineParams p;
  p.loss = LossParams{};
  return p;
}
RefineParams unit_params() {
  RefineParams p = printed_params();
  p.loss.continuity = ContinuityForm::unit_tangents;
  return p;
}

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

// Runs the solver and checks what holds for every input: pixels without depth come out as they went in, the others
// stay within a factor of 4, and each accepted step lowers the loss.
void check_safe(Street& s, const RefineParams& p) {
  REQUIRE(s.run(p).ok());
  for (std::size_t i = 0; i < s.out.size(); ++i) {
    const float before = s.estimate[i];
    if (!(before >= 1e-3F && before <= 1e5F)) {
      CHECK((s.out[i] == before || (std::isnan(before) && std::isnan(s.out[i]))));
    } else {
      CHECK(s.out[i] >= 0.2499F * before);
      CHECK(s.out[i] <= 4.001F * before);
    }
  }
  CHECK(s.result.reason != StopReason::none);
  CHECK(s.result.last.total <= s.result.first.total);
  CHECK(s.curve[0] == static_cast<float>(s.result.first.total));
  for (int i = 0; i < s.result.steps; ++i) {
    CHECK(s.curve[static_cast<std::size_t>(i) + 1] <= s.curve[static_cast<std::size_t>(i)]);
  }
  const LossWeights& lambda = p.loss.lambda;
  for (int i = 0; i <= s.result.steps; ++i) {  // the sum is that of its terms
    const LossValues& l = s.losses[static_cast<std::size_t>(i)];
    CHECK(l.total == doctest::Approx(static_cast<double>(lambda.normal) * l.normal +
                                     static_cast<double>(lambda.continuity) * l.continuity +
                                     static_cast<double>(lambda.depth) * l.depth));
  }
  CHECK(s.curve[static_cast<std::size_t>(s.result.steps)] == static_cast<float>(s.result.last.total));
}
void check_safe_all_forms(Street& s) {
  for (const RefineParams& base : {printed_params(), unit_params()}) {
    for (const TangentForm tangents : {TangentForm::perspective, TangentForm::thesis}) {
      for (const DepthTerm term : {DepthTerm::metric, DepthTerm::relative}) {
        RefineParams p = base;
        p.loss.tangents = tangents;
        p.loss.depth_term = term;
        p.gauss_newton.steps = 4;
        check_safe(s, p);
      }
    }
  }
}

}  // namespace

TEST_CASE("Gauss-Newton reaches the loss of Adam's step 1000 in a few steps, for both forms of continuity") {
  for (const bool printed : {true, false}) {
    Street s({160, 96}, 11, 0.01F, 0.05F);
    RefineParams p = printed ? printed_params() : unit_params();
    p.solver = RefineSolver::adam;
    p.stop_relative_decrease = 0;
    REQUIRE(s.run(p).ok());
    REQUIRE(s.result.steps == 1000);
    const double adam = s.result.last.total;
    p.solver = RefineSolver::gauss_newton;
    p.gauss_newton.target_loss = static_cast<float>(adam);
    p.gauss_newton.relative_decrease = 0;
    check_safe(s, p);
    CHECK(s.result.reason == StopReason::target_reached);
    CHECK(s.result.last.total <= adam * 1.000001);
    CHECK(s.result.steps <= (printed ? 4 : 12));
  }
}

TEST_CASE("by its own stop, with unit tangents and strong depth, it ends near or below Adam's 1000 steps") {
  // Both end in a local minimum, and with noise of 13 degrees in the normals not in the same.
  for (const float noise : {0.05F, 0.1F}) {
    for (std::uint32_t seed = 21; seed <= 22; ++seed) {
      Street s({240, 136}, seed, 0.01F, noise);
      RefineParams p;
      p.loss.continuity = ContinuityForm::unit_tangents;
      p.loss.lambda = {1, 1, 500};
      p.loss.normal_in_uncertain = false;
      check_safe(s, p);
      const double newton = s.result.last.total;
      CHECK(s.result.reason == StopReason::small_decrease);
      p.solver = RefineSolver::adam;
      p.stop_relative_decrease = 0;
      REQUIRE(s.run(p).ok());
      CAPTURE(noise);
      CAPTURE(newton);
      CHECK(newton <= (noise < 0.1F ? 1.0 : 1.06) * s.result.last.total);
    }
  }
}

TEST_CASE("depth that is pulled to the end of its range does not end the solver early") {
  // The upper part stands eight times too far, and continuity across the step pulls it by more than a factor of 4.
  // Steps that are merely clamped end after 4, at a loss of 109.
  Street s({160, 96}, 16, 0.01F, 0.05F);
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 160; ++x) s.estimate[s.at(x, y)] *= 8.0F;
  }
  s.uncertain.assign(s.uncertain.size(), 0);
  RefineParams p = printed_params();
  check_safe(s, p);
  CHECK(s.result.reason != StopReason::no_descent);
  CHECK(s.result.last.total < 10);
  int at_end = 0;
  for (std::size_t i = 0; i < s.out.size(); ++i) at_end += s.out[i] <= 0.2501F * s.estimate[i] ? 1 : 0;
  CHECK(at_end > 10);  // else the case is not what its name says
}

TEST_CASE("the result has the same bits for one lane and for all, any order of chunks and any number of threads") {
  for (const Shape shape : {Shape{1, 40}, Shape{40, 1}, Shape{15, 33}, Shape{16, 34}, Shape{17, 70}, Shape{97, 65}}) {
    Street s(shape, 12, 0.02F, 0.1F);
    RefineParams p = unit_params();
    p.gauss_newton.steps = 3;
    REQUIRE(s.run(p).ok());
    const std::vector<float> expected = s.out;
    const std::vector<float> curve = s.curve;
    const SerialExecutor serial;
    REQUIRE(s.run<simd::scalar::F32>(p, serial).ok());
    CHECK(same_bits(s.out, expected));
    CHECK(s.curve == curve);
    const npsim_test::BackwardExecutor backward;
    REQUIRE(s.run(p, backward).ok());
    CHECK(same_bits(s.out, expected));
    for (const unsigned threads : {2U, 3U}) {
      ThreadPool pool(threads);
      REQUIRE(s.run(p, pool).ok());
      CHECK(same_bits(s.out, expected));
      CHECK(s.curve == curve);
    }
  }
}

TEST_CASE("a column of NaN, depth near 0, missing normals: what has no depth comes out as it went in") {
  Street s({64, 40}, 4, 0.01F, 0.05F);
  for (int y = 0; y < 40; ++y) {
    s.estimate[s.at(20, y)] = kNaN;
    s.estimate[s.at(40, y)] = 0;
    s.normals[s.at(50, y)] = {kNaN, 0, 0};
  }
  s.estimate[s.at(5, 5)] = 1e-38F;
  s.estimate[s.at(7, 5)] = 1.01e-3F;
  s.estimate[s.at(8, 5)] = 9.9e4F;
  s.estimate[s.at(9, 5)] = -std::numeric_limits<float>::infinity();
  check_safe_all_forms(s);
}

TEST_CASE("wrong normals on half the road") {
  Street s({96, 64}, 5, 0.01F, 0.05F);
  for (int y = 32; y < 64; ++y) {
    for (int x = 0; x < 48; ++x) s.normals[s.at(x, y)] = normalized(Vec3f{0.3F, -0.9F, 0.2F});
  }
  check_safe_all_forms(s);
}

TEST_CASE("normals that contradict the depth, and normals that face away") {
  Street s({64, 40}, 6, 0.01F, 0.05F);
  for (Vec3f& n : s.normals) n = {0.7F, 0.7F, -0.1F};
  check_safe_all_forms(s);
  for (Vec3f& n : s.normals) n = {0, 0, 1};
  check_safe_all_forms(s);
}

TEST_CASE("grazing planes, where the inferred normal degenerates") {
  Street s({64, 48}, 7, 0, 0);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      s.estimate[s.at(x, y)] = 2.0F * std::pow(1.15F, static_cast<float>(x));
      s.normals[s.at(x, y)] = normalized(Vec3f{1.0F, 0.0F, x % 2 == 0 ? -1e-4F : 1e-4F});
    }
  }
  check_safe_all_forms(s);
}

TEST_CASE("8-bit depth: quantised steps become smooth") {
  Street s({160, 96}, 8, 0, 0);
  for (std::size_t i = 0; i < s.estimate.size(); ++i) {
    s.estimate[i] = std::max(1.0F, std::round(s.truth[i] * (255.0F / 80.0F))) * (80.0F / 255.0F);
  }
  check_safe_all_forms(s);
  REQUIRE(s.run(RefineParams{}).ok());
  CHECK(s.normal_error_deg(s.out) < 0.5 * s.normal_error_deg(s.estimate));
}

TEST_CASE("80 % missing depth, one valid pixel") {
  Street s({96, 64}, 9, 0.01F, 0.05F);
  RandomStream random(9, RandomPurpose::test, 1, 0, 0, 0);
  for (float& z : s.estimate) {
    if (random.uniform() < 0.8F) z = random.uniform() < 0.5F ? 0.0F : kNaN;
  }
  check_safe_all_forms(s);
  s.estimate.assign(s.estimate.size(), 0.0F);
  s.estimate[777] = 12.5F;
  check_safe_all_forms(s);
  CHECK(s.out[777] == 12.5F);
}

TEST_CASE("a step from 2 m to 80 m with a flat stretch behind stays a step where it is marked uncertain") {
  Street s({80, 48}, 10, 0, 0);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 80; ++x) {
      s.estimate[s.at(x, y)] = x < 30 ? 2.0F : 80.0F;
      s.normals[s.at(x, y)] = {0, 0, -1};
      s.uncertain[s.at(x, y)] = x > 24 && x < 36 ? 1 : 0;
    }
  }
  check_safe_all_forms(s);
  RefineParams p;
  p.loss.normal_in_uncertain = false;
  REQUIRE(s.run(p).ok());
  for (int y = 0; y < 48; ++y) {
    CHECK(std::abs(s.out[s.at(10, y)] - 2.0F) < 0.02F);
    CHECK(std::abs(s.out[s.at(70, y)] - 80.0F) < 0.8F);
  }
}

TEST_CASE("every pixel its own class, with weights from 0 to a million") {
  Street s({48, 32}, 11, 0.01F, 0.05F);
  s.labels.resize(s.shape.pixels());
  for (std::size_t i = 0; i < s.labels.size(); ++i) s.labels[i] = static_cast<Label>(i % 40);
  for (int i = 0; i < 40; ++i) {
    const float w = i % 5 == 0 ? 0.0F : std::pow(10.0F, static_cast<float>(i % 13) - 6.0F);
    s.label_weights.push_back({w, i % 3 == 0 ? 0.0F : w, i % 7 == 0 ? 0.0F : 1.0F / (w + 1e-3F)});
  }
  check_safe_all_forms(s);
}

TEST_CASE("lambdas of 0 leave a singular system, which is no accident") {
  for (const LossWeights lambda :
       {LossWeights{1, 5, 0}, LossWeights{0, 0, 1}, LossWeights{0, 1, 0}, LossWeights{1, 0, 0}, LossWeights{0, 0, 0}}) {
    Street s({50, 34}, 12, 0.01F, 0.05F);
    RefineParams p = printed_params();
    p.loss.lambda = lambda;
    check_safe(s, p);
    if (lambda.normal == 0 && lambda.continuity == 0) CHECK(same_bits(s.out, s.estimate));
  }
}

TEST_CASE("a step that cannot lower the loss is a safe stop, and the input survives") {
  // Far outside what float can resolve: the loss is finite, its gradient is not.
  Street s({24, 16}, 13, 0.3F, 0.5F);
  s.k.fx = s.k.fy = 1e9F;
  RefineParams p = printed_params();
  REQUIRE(s.run(p).ok());
  CHECK(s.result.last.total <= s.result.first.total);
  for (const float z : s.out) CHECK(std::isfinite(z));
  // A minimum: no step at all.
  Street flat({24, 16}, 13, 0, 0);
  flat.estimate.assign(flat.estimate.size(), 10.0F);
  flat.normals.assign(flat.normals.size(), Vec3f{0, 0, -1});
  REQUIRE(flat.run(p).ok());
  CHECK(same_bits(flat.out, flat.estimate));
}

TEST_CASE("caps and targets end the solver, and say so") {
  Street s({64, 40}, 14, 0.01F, 0.05F);
  RefineParams p = printed_params();
  p.gauss_newton.relative_decrease = 0;
  p.gauss_newton.steps = 2;
  p.gauss_newton.inner_steps = 3;
  REQUIRE(s.run(p).ok());
  CHECK(s.result.reason == StopReason::all_steps);
  CHECK(s.result.steps == 2);
  CHECK(s.result.inner_steps <= 6);
  p.gauss_newton.steps = 0;
  REQUIRE(s.run(p).ok());
  CHECK(same_bits(s.out, s.estimate));
  p.gauss_newton.steps = 50;
  p.gauss_newton.relative_decrease = 0.5F;
  REQUIRE(s.run(p).ok());
  CHECK(s.result.reason == StopReason::small_decrease);
  p.gauss_newton.target_loss = 1e20F;
  REQUIRE(s.run(p).ok());
  CHECK(s.result.reason == StopReason::target_reached);
  CHECK(s.result.steps == 0);
}

TEST_CASE("nothing valid, a loss that is not finite, bad arguments and a small workspace are a status") {
  Street s({40, 20}, 15, 0, 0);
  RefineParams p = printed_params();
  const std::vector<float> good = s.estimate;
  const Intrinsics k = s.k;
  s.out = good;
  for (std::size_t i = 0; i < s.estimate.size(); ++i) s.estimate[i] = i % 2 == 0 ? 1e-3F : 1e5F;
  s.k.fx = s.k.fy = 1e18F;
  CHECK(s.run(p).code() == StatusCode::not_finite);
  CHECK(s.out == good);
  s.k = k;
  s.estimate.assign(s.estimate.size(), kNaN);
  CHECK(s.run(p).code() == StatusCode::no_valid_input);
  CHECK(s.out == good);
  s.estimate = good;
  for (const GaussNewtonParams bad :
       {GaussNewtonParams{-1}, GaussNewtonParams{20, kNaN}, GaussNewtonParams{20, 0, -1.0F},
        GaussNewtonParams{20, 0, 0, 0}, GaussNewtonParams{20, 0, 0, 5, 2.0F}, GaussNewtonParams{20, 0, 0, 5, 0, -1},
        GaussNewtonParams{20, 0, 0, 5, 0, 8, 0}}) {
    p = printed_params();
    p.gauss_newton = bad;
    CHECK(s.run(p).code() == StatusCode::invalid_argument);
    CHECK(s.out == good);
  }
  p = printed_params();
  npsim_test::Scratch small(refine_workspace_bytes(p, s.shape) / 2);
  const SerialExecutor serial;
  CHECK(refine_with_normals(p, s.input(), {s.out.data(), s.shape}, {}, s.result, small.workspace(), serial).code() ==
        StatusCode::workspace_exhausted);
  CHECK(s.out == good);
}
