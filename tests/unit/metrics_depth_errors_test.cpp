// SPDX-License-Identifier: Apache-2.0
#include "npsim/metrics/geometry_errors.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"

namespace {

using npsim::DepthErrors;
using npsim::ImageView;
using npsim::Shape;
using npsim::Status;
using npsim::StatusCode;

struct Measured {
  Status status;
  DepthErrors errors;
};

template <class Executor>
Measured measure(const std::vector<float>& estimate, const std::vector<float>& truth, Shape shape, Executor& executor,
                 const std::vector<std::uint8_t>& mask = {}) {
  npsim_test::Scratch scratch(npsim::depth_errors_workspace_bytes(shape));
  npsim::Workspace& workspace = scratch.workspace();
  Measured m;
  const ImageView<const std::uint8_t> selection =
      mask.empty() ? ImageView<const std::uint8_t>() : ImageView<const std::uint8_t>(mask.data(), shape);
  m.status = npsim::depth_errors(ImageView<const float>(estimate.data(), shape),
                                 ImageView<const float>(truth.data(), shape), selection, m.errors, workspace, executor);
  return m;
}

Measured measure(const std::vector<float>& estimate, const std::vector<float>& truth,
                 const std::vector<std::uint8_t>& mask = {}) {
  npsim::SerialExecutor serial;
  return measure(estimate, truth, Shape{static_cast<int>(truth.size()), 1}, serial, mask);
}

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Depths from 2 m to 80 m, some missing, and an estimate of them.
void random_depths(Shape shape, std::uint64_t seed, std::vector<float>& estimate, std::vector<float>& truth) {
  for (std::size_t i = 0; i < shape.pixels(); ++i) {
    npsim::RandomStream random(seed, npsim::RandomPurpose::generic, 0, 0, static_cast<std::uint32_t>(i), 0);
    const float z = 2.0F + 78.0F * random.uniform();
    truth.push_back(random.uniform() < 0.1F ? 0.0F : z);
    estimate.push_back(random.uniform() < 0.1F ? kNaN : z * (0.5F + random.uniform()));
  }
}

}  // namespace

TEST_CASE("depth errors: values worked out by hand") {
  // e / t = 2, 1, 1/2, 5/4; |e - t| / t = 1, 0, 1/2, 1/4; e - t = 2, 0, -2, 2
  const Measured m = measure({4, 5, 2, 10}, {2, 5, 4, 8});
  REQUIRE(m.status.ok());
  const double log2 = std::log(2.0);
  const double log54 = std::log(1.25);
  CHECK(m.errors.truth_pixels == 4);
  CHECK(m.errors.pixels == 4);
  CHECK(m.errors.abs_rel == doctest::Approx(0.4375).epsilon(1e-12));
  CHECK(m.errors.median_abs_rel == doctest::Approx(0.375).epsilon(1e-7));
  CHECK(m.errors.rmse_m == doctest::Approx(std::sqrt(3.0)).epsilon(1e-12));
  const double mean_squared = (2 * log2 * log2 + log54 * log54) / 4;
  CHECK(m.errors.rmse_log == doctest::Approx(std::sqrt(mean_squared)).epsilon(1e-12));
  CHECK(m.errors.mean_log == doctest::Approx(log54 / 4).epsilon(1e-12));
  CHECK(m.errors.si_log == doctest::Approx(std::sqrt(mean_squared - log54 * log54 / 16)).epsilon(1e-12));
  CHECK(m.errors.delta[0] == 0.25);  // 1.25 itself is not below 1.25
  CHECK(m.errors.delta[1] == 0.5);
  CHECK(m.errors.delta[2] == 0.5);
}

TEST_CASE("depth errors: none on the exact depth") {
  const std::vector<float> depth = {1e-3F, 1, 12.5F, 80, 1e5F};
  const Measured m = measure(depth, depth);
  REQUIRE(m.status.ok());
  for (const double e :
       {m.errors.abs_rel, m.errors.median_abs_rel, m.errors.rmse_m, m.errors.rmse_log, m.errors.si_log}) {
    CHECK(e == 0);
  }
  for (const double share : m.errors.delta) CHECK(share == 1);
}

TEST_CASE("depth errors: a wrong scale of the whole map is no SI-log, and mean_log names it") {
  std::vector<float> estimate;
  std::vector<float> truth;
  for (int i = 1; i < 400; ++i) {
    truth.push_back(static_cast<float>(i) * 0.25F);
    estimate.push_back(truth.back() * 8);  // a power of two: no rounding
  }
  Measured m = measure(estimate, truth);
  REQUIRE(m.status.ok());
  CHECK(m.errors.si_log < 1e-7);
  CHECK(m.errors.mean_log == doctest::Approx(std::log(8.0)).epsilon(1e-12));
  CHECK(m.errors.abs_rel == doctest::Approx(7).epsilon(1e-12));
  // Rescaling an estimate that is otherwise wrong leaves SI-log as it is.
  for (std::size_t i = 0; i < estimate.size(); i += 3) estimate[i] *= 1.1F;
  const double before = measure(estimate, truth).errors.si_log;
  CHECK(before > 0.04);
  for (float& z : estimate) z *= 0.125F;
  CHECK(measure(estimate, truth).errors.si_log == doctest::Approx(before).epsilon(1e-9));
}

TEST_CASE("depth errors: the median is of the middle one or two, and one wild pixel does not move it") {
  CHECK(measure({11, 12, 1000}, {10, 10, 10}).errors.median_abs_rel == doctest::Approx(0.2).epsilon(1e-6));
  CHECK(measure({11, 12, 14, 1000}, {10, 10, 10, 10}).errors.median_abs_rel == doctest::Approx(0.3).epsilon(1e-6));
  CHECK(measure({11}, {10}).errors.median_abs_rel == doctest::Approx(0.1).epsilon(1e-6));
}

TEST_CASE("depth errors: NaN, infinity, zero and negative depths do not count on either side") {
  const Measured m = measure({kNaN, kInfinity, 0, -3, 7, 7, 7, 7, 11}, {5, 5, 5, 5, kNaN, kInfinity, 0, -3, 10});
  REQUIRE(m.status.ok());
  CHECK(m.errors.truth_pixels == 5);
  CHECK(m.errors.pixels == 1);
  CHECK(m.errors.abs_rel == doctest::Approx(0.1).epsilon(1e-6));
  CHECK(m.errors.rmse_m == doctest::Approx(1).epsilon(1e-6));
}

TEST_CASE("depth errors: the mask selects") {
  const Measured m = measure({11, 20, 12}, {10, 10, 10}, {7, 0, 1});
  REQUIRE(m.status.ok());
  CHECK(m.errors.pixels == 2);
  CHECK(m.errors.abs_rel == doctest::Approx(0.15).epsilon(1e-6));
}

TEST_CASE("depth errors: nothing to compare, and shapes that differ, are a status and leave the output alone") {
  const auto untouched = [](const Measured& m, StatusCode code) {
    CHECK(m.status.code() == code);
    CHECK(m.errors.pixels == 0);
    CHECK(m.errors.abs_rel == 0);
  };
  untouched(measure({kNaN, 0}, {1, 2}), StatusCode::no_valid_input);
  untouched(measure({1, 2}, {kNaN, 0}), StatusCode::no_valid_input);
  untouched(measure({1, 2}, {2, 2}, {0, 0}), StatusCode::no_valid_input);
  const std::vector<float> plane(6, 1.0F);
  const std::vector<std::uint8_t> mask(6, 1);
  npsim::SerialExecutor serial;
  npsim_test::Scratch scratch(npsim::depth_errors_workspace_bytes({3, 2}));
  npsim::Workspace& workspace = scratch.workspace();
  DepthErrors out;
  const ImageView<const float> a(plane.data(), {3, 2});
  const ImageView<const float> b(plane.data(), {2, 3});
  CHECK(npsim::depth_errors(b, a, {}, out, workspace, serial).code() == StatusCode::shape_mismatch);
  CHECK(npsim::depth_errors(a, a, {mask.data(), {2, 3}}, out, workspace, serial).code() == StatusCode::shape_mismatch);
  CHECK(npsim::depth_errors({}, {}, {}, out, workspace, serial).code() == StatusCode::no_valid_input);
  npsim_test::Scratch small(70);
  CHECK(npsim::depth_errors(a, a, {}, out, small.workspace(), serial).code() == StatusCode::workspace_exhausted);
  CHECK(out.pixels == 0);
}

TEST_CASE("depth errors: within the stated bounds of long double, and the same bits in any order of the chunks") {
  const Shape shape{97, 203};
  std::vector<float> estimate;
  std::vector<float> truth;
  random_depths(shape, 11, estimate, truth);
  long double relative = 0;
  long double squared = 0;
  long double log_sum = 0;
  long double log_squared = 0;
  std::vector<double> all;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (!npsim::is_valid_depth(truth[i]) || !npsim::is_valid_depth(estimate[i])) continue;
    const auto e = static_cast<long double>(estimate[i]);
    const auto t = static_cast<long double>(truth[i]);
    relative += std::fabs(e - t) / t;
    squared += (e - t) * (e - t);
    const long double d = std::log(e / t);
    log_sum += d;
    log_squared += d * d;
    all.push_back(static_cast<double>(std::fabs(e - t) / t));
  }
  const auto n = static_cast<long double>(all.size());
  std::sort(all.begin(), all.end());
  npsim::SerialExecutor serial;
  const Measured one = measure(estimate, truth, shape, serial);
  REQUIRE(one.status.ok());
  CHECK(one.errors.pixels == all.size());
  CHECK(one.errors.abs_rel == doctest::Approx(static_cast<double>(relative / n)).epsilon(1e-10).scale(0));
  CHECK(one.errors.rmse_m == doctest::Approx(static_cast<double>(std::sqrt(squared / n))).epsilon(1e-10).scale(0));
  CHECK(one.errors.rmse_log ==
        doctest::Approx(static_cast<double>(std::sqrt(log_squared / n))).epsilon(1e-10).scale(0));
  const auto spread = static_cast<double>(std::sqrt(log_squared / n - (log_sum / n) * (log_sum / n)));
  CHECK(std::fabs(one.errors.si_log - spread) < 1e-7);
  const double middle = 0.5 * (all[(all.size() - 1) / 2] + all[all.size() / 2]);
  CHECK(one.errors.median_abs_rel == doctest::Approx(middle).epsilon(1e-7).scale(0));
  npsim_test::BackwardExecutor backward;
  const Measured many = measure(estimate, truth, shape, backward);
  CHECK(std::memcmp(&many.errors, &one.errors, sizeof one.errors) == 0);
}

TEST_CASE("depth errors: a part of a larger image by its stride") {
  std::vector<float> estimate(12, 1000.0F);
  std::vector<float> truth(12, 1.0F);
  for (const std::size_t i : {std::size_t{5}, std::size_t{6}}) {
    truth[i] = 10;
    estimate[i] = 11;
  }
  npsim_test::Scratch scratch(npsim::depth_errors_workspace_bytes({2, 1}));
  npsim::Workspace& workspace = scratch.workspace();
  npsim::SerialExecutor serial;
  DepthErrors out;
  REQUIRE(npsim::depth_errors(ImageView<const float>(estimate.data(), {4, 3}).sub(1, 1, {2, 1}),
                              ImageView<const float>(truth.data(), {4, 3}).sub(1, 1, {2, 1}), {}, out, workspace,
                              serial)
              .ok());
  CHECK(out.pixels == 2);
  CHECK(out.abs_rel == doctest::Approx(0.1).epsilon(1e-6));
}
