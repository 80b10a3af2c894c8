// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/refine.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "depth_refine_fixture.hpp"
#include "npsim/core/random.hpp"
#include "npsim/depth/normals.hpp"

using namespace npsim;
using namespace npsim::refine_test;

namespace {

RefineParams adam_params() {
  RefineParams p;
  p.solver = RefineSolver::adam;
  return p;
}

}  // namespace

TEST_CASE("the default refinement improves depth and normals on noisy streets, and makes none worse") {
  for (std::uint32_t seed = 1; seed <= 3; ++seed) {
    Street s({200, 120}, seed, 0.01F, 0.05F);
    const RefineParams p;
    REQUIRE(s.run(p).ok());
    CHECK(s.result.last.total < 0.1 * s.result.first.total);
    CHECK(s.abs_rel(s.out) < 0.97 * s.abs_rel(s.estimate));
    CHECK(s.normal_error_deg(s.out) < 0.35 * s.normal_error_deg(s.estimate));
  }
}

TEST_CASE("the thesis' biased tangents lower their loss and still make depth worse; this is why they are no default") {
  Street s({200, 120}, 1, 0.01F, 0.05F);
  REQUIRE(s.run(thesis_refine_params()).ok());
  CHECK(s.result.steps == 1000);
  CHECK(s.result.reason == StopReason::all_steps);
  CHECK(s.result.last.total < s.result.first.total);
  CHECK(s.abs_rel(s.out) > s.abs_rel(s.estimate));
  RefineParams metres = thesis_refine_params();
  metres.loss.depth_unit_m = 1;
  REQUIRE(s.run(metres).ok());
  for (std::size_t i = 0; i < s.out.size(); ++i) CHECK(std::abs(s.out[i] - s.estimate[i]) < 0.2F);
}

TEST_CASE("Adam follows the textbook in double") {
  Street s({40, 36}, 2, 0.01F, 0.05F);
  RefineParams p = adam_params();
  p.adam.steps = 60;
  p.stop_relative_decrease = 0;
  REQUIRE(s.run(p).ok());
  REQUIRE(s.result.steps == 60);

  std::vector<double> estimate(s.estimate.begin(), s.estimate.end());
  std::vector<double> depth = estimate;
  std::vector<double> gradient(depth.size());
  std::vector<Vec3d> normals;
  for (const Vec3f& n : s.normals) normals.push_back(vec_cast<double>(n));
  std::vector<double> m(depth.size(), 0.0);
  std::vector<double> v(depth.size(), 0.0);
  npsim_test::Scratch scratch(depth_losses_workspace_bytes<double>(p.loss, s.shape));
  const SerialExecutor serial;
  LossParams loss = p.loss;
  for (int t = 0; t <= 60; ++t) {
    LossValues values;
    const LossInput<double> input{
        {estimate.data(), s.shape}, {normals.data(), s.shape}, {s.uncertain.data(), s.shape}, {}, {}, s.k};
    REQUIRE(depth_losses<double>(loss, input, {depth.data(), s.shape}, {gradient.data(), s.shape}, values,
                                 scratch.workspace(), serial)
                .ok());
    CHECK(std::abs(values.total - static_cast<double>(s.curve[static_cast<std::size_t>(t)])) < 1e-4 * values.total);
    if (t == 60) break;
    for (std::size_t i = 0; i < depth.size(); ++i) {
      const double g = gradient[i] * 80;
      m[i] = 0.9 * m[i] + 0.1 * g;
      v[i] = 0.999 * v[i] + 0.001 * g * g;
      depth[i] -=
          80 * 1e-4 * (m[i] / (1 - std::pow(0.9, t + 1))) / (std::sqrt(v[i] / (1 - std::pow(0.999, t + 1))) + 1e-8);
    }
  }
  double worst = 0;
  for (std::size_t i = 0; i < depth.size(); ++i)
    worst = std::max(worst, std::abs(depth[i] - static_cast<double>(s.out[i])));
  CHECK(worst < 0.008 * 0.1);  // a tenth of one step, after 60 of them
}

TEST_CASE("refinement does not depend on the order of chunks, works in place and on strided views") {
  Street s({70, 50}, 3, 0.01F, 0.05F);
  RefineParams p = adam_params();
  p.adam.steps = 40;
  REQUIRE(s.run(p).ok());
  const std::vector<float> expected = s.out;
  const double loss = s.result.last.total;
  const npsim_test::BackwardExecutor backward;
  REQUIRE(s.run(p, backward).ok());
  CHECK(s.out == expected);
  CHECK(s.result.last.total == loss);

  std::vector<float> wide(80 * 50, -2.0F);
  const ImageView<float> view(wide.data() + 6, s.shape, 80);
  for (int y = 0; y < 50; ++y) {
    for (int x = 0; x < 70; ++x) view(x, y) = s.estimate[s.at(x, y)];
  }
  LossInput<float> input = s.input();
  input.depth_est = view;
  npsim_test::Scratch scratch(refine_workspace_bytes(p, s.shape));
  Workspace& workspace = scratch.workspace();
  const SerialExecutor serial;
  REQUIRE(refine_with_normals(p, input, view, {}, s.result, workspace, serial).ok());
  for (int y = 0; y < 50; ++y) {
    for (int x = 0; x < 70; ++x) CHECK(view(x, y) == expected[s.at(x, y)]);
    CHECK(wide[static_cast<std::size_t>(y * 80 + 5)] == -2.0F);
    CHECK(wide[static_cast<std::size_t>(y * 80 + 76)] == -2.0F);
  }
}

TEST_CASE("holes, columns of NaN and depth near 0 come out as they went in, the rest stays within a factor of 4") {
  Street s({64, 40}, 4, 0.01F, 0.05F);
  for (int y = 0; y < 40; ++y) {
    s.estimate[s.at(20, y)] = std::numeric_limits<float>::quiet_NaN();
    s.estimate[s.at(40, y)] = 0;
  }
  s.estimate[s.at(5, 5)] = 1e-38F;
  for (Vec3f& n : s.normals) n = {0.7F, 0.7F, -0.1F};  // normals that contradict the depth
  RefineParams p = adam_params();
  p.loss.lambda.depth = 0;  // nothing holds the depth
  p.adam.rate = 0.01F;
  p.adam.steps = 300;
  REQUIRE(s.run(p).ok());
  int at_the_end = 0;
  for (std::size_t i = 0; i < s.out.size(); ++i) {
    const float before = s.estimate[i];
    if (!(before >= 1e-3F)) {
      CHECK((s.out[i] == before || (std::isnan(before) && std::isnan(s.out[i]))));
    } else {
      CHECK(s.out[i] >= 0.25F * before);
      CHECK(s.out[i] <= 4.0F * before);
      at_the_end += s.out[i] == 0.25F * before || s.out[i] == 4.0F * before ? 1 : 0;
    }
  }
  CHECK(at_the_end > 0);
}

TEST_CASE("a run of Adam that ends above the loss of its input leaves the depth as it was, in place") {
  for (const float stop : {0.0F, 1e-3F}) {
    Street s({32, 24}, 5, 0.0F, 0.0F);
    s.estimate.assign(s.estimate.size(), 10.0F);
    s.normals.assign(s.normals.size(), Vec3f{0, 0, -1});
    s.estimate[300] = 10.1F;
    const std::vector<float> before = s.estimate;
    RefineParams p = adam_params();
    p.stop_relative_decrease = stop;
    p.adam.steps = 100;
    const LossInput<float> input = s.input();
    npsim_test::Scratch scratch(refine_workspace_bytes(p, s.shape));
    Workspace& workspace = scratch.workspace();
    const SerialExecutor serial;
    const ImageView<float> in_place(s.estimate.data(), s.shape);
    p.adam.rate = 0.1F;
    REQUIRE(refine_with_normals(p, input, in_place, {}, s.result, workspace, serial).ok());
    CHECK(s.result.reason == StopReason::no_descent);
    CHECK(s.result.last.total == s.result.first.total);
    CHECK(s.estimate == before);
    p.adam.rate = 1e-5F;
    REQUIRE(refine_with_normals(p, input, in_place, {}, s.result, workspace, serial).ok());
    CHECK(s.result.reason != StopReason::no_descent);
    CHECK(s.estimate != before);
  }
}

TEST_CASE("Adam's early stop waits while the loss rises: its first steps are as long where little is to be gained") {
  Street s({64, 48}, 5, 0.0F, 0.0F);
  RandomStream random(6, RandomPurpose::test, 0, 0, 0, 0);
  for (float& z : s.estimate) z = 10.0F * (1.0F + 1e-4F * (random.uniform() - 0.5F));
  s.normals.assign(s.normals.size(), Vec3f{0, 0, -1});
  RefineParams p = adam_params();
  p.stop_relative_decrease = 1e-3F;
  p.adam.steps = 1000;
  p.adam.rate = 1e-4F;
  REQUIRE(s.run(p).ok());
  CHECK(s.result.last.total < 0.1 * s.result.first.total);
}

TEST_CASE("early stop: a converged problem ends after one window; the curve is what was computed") {
  Street s({64, 40}, 5, 0.0F, 0.0F);
  s.estimate.assign(s.estimate.size(), 10.0F);
  s.normals.assign(s.normals.size(), Vec3f{0, 0, -1});
  s.estimate[700] = 10.001F;
  RefineParams p = adam_params();
  p.stop_relative_decrease = 0.5F;
  p.stop_window = 20;
  p.adam.rate = 0;
  REQUIRE(s.run(p).ok());
  CHECK(s.result.steps == 20);
  CHECK(s.result.reason == StopReason::small_decrease);
  CHECK(s.curve[20] == static_cast<float>(s.result.last.total));
  CHECK(s.losses[20].depth == s.result.last.depth);
  CHECK(s.losses[0].normal == s.result.first.normal);
  CHECK(s.curve[21] == -1.0F);
  p.stop_relative_decrease = 0;
  p.adam.steps = 30;
  REQUIRE(s.run(p).ok());
  CHECK(s.result.steps == 30);
  p.adam.steps = 0;
  REQUIRE(s.run(p).ok());
  CHECK(s.out == s.estimate);
}

TEST_CASE("a loss that is not finite, nothing valid and bad arguments are a status, and the output survives") {
  Street s({40, 20}, 6, 0.0F, 0.0F);
  RefineParams p = adam_params();
  p.adam.steps = 5;
  const std::vector<float> good = s.estimate;
  const Intrinsics k = s.k;
  for (std::size_t i = 0; i < s.estimate.size(); ++i) s.estimate[i] = i % 2 == 0 ? 1e-3F : 1e5F;
  s.k.fx = s.k.fy = 1e13F;
  s.out = good;
  CHECK(s.run(p).code() == StatusCode::not_finite);
  CHECK(s.out == good);
  s.k = k;
  s.estimate.assign(s.estimate.size(), -1.0F);
  CHECK(s.run(p).code() == StatusCode::no_valid_input);
  CHECK(s.out == good);
  s.estimate = good;
  p.adam.beta2 = 1.0F;
  CHECK(s.run(p).code() == StatusCode::invalid_argument);
  p = adam_params();
  p.adam.steps = -1;
  const SerialExecutor serial;
  Workspace none;
  CHECK(refine_with_normals(p, s.input(), {s.out.data(), s.shape}, {}, s.result, none, serial).code() ==
        StatusCode::invalid_argument);
  p = adam_params();
  p.stop_window = 0;
  CHECK(s.run(p).code() == StatusCode::invalid_argument);
  p = adam_params();
  CHECK(refine_with_normals(p, s.input(), {s.out.data(), s.shape}, {}, s.result, none, serial).code() ==
        StatusCode::workspace_exhausted);
  CHECK(refine_with_normals(p, s.input(), {s.out.data(), {20, 20}}, {}, s.result, none, serial).code() ==
        StatusCode::shape_mismatch);
  CHECK(s.out == good);
}
