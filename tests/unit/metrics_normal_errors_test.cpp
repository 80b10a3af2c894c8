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

using npsim::ImageView;
using npsim::NormalErrors;
using npsim::Shape;
using npsim::Status;
using npsim::StatusCode;
using npsim::Vec3f;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr double kPi = 3.14159265358979323846;

struct Measured {
  Status status;
  NormalErrors errors;
};

template <class Executor>
Measured measure(const std::vector<Vec3f>& estimate, const std::vector<Vec3f>& truth, Shape shape, Executor& executor,
                 const std::vector<std::uint8_t>& mask = {}) {
  npsim_test::Scratch scratch(npsim::normal_errors_workspace_bytes(shape));
  npsim::Workspace& workspace = scratch.workspace();
  Measured m;
  const ImageView<const std::uint8_t> selection =
      mask.empty() ? ImageView<const std::uint8_t>() : ImageView<const std::uint8_t>(mask.data(), shape);
  m.status =
      npsim::normal_errors(ImageView<const Vec3f>(estimate.data(), shape), ImageView<const Vec3f>(truth.data(), shape),
                           selection, m.errors, workspace, executor);
  return m;
}

Measured measure(const std::vector<Vec3f>& estimate, const std::vector<Vec3f>& truth,
                 const std::vector<std::uint8_t>& mask = {}) {
  npsim::SerialExecutor serial;
  return measure(estimate, truth, Shape{static_cast<int>(truth.size()), 1}, serial, mask);
}

// The normal towards the camera, turned by an angle about the vertical.
Vec3f turned(double degrees) {
  return {static_cast<float>(std::sin(degrees * kPi / 180)), 0, static_cast<float>(-std::cos(degrees * kPi / 180))};
}

long double long_angle_deg(const Vec3f& a, const Vec3f& b) {
  const auto wide = [](float v) { return static_cast<long double>(v); };
  const long double cx = wide(a.y) * wide(b.z) - wide(a.z) * wide(b.y);
  const long double cy = wide(a.z) * wide(b.x) - wide(a.x) * wide(b.z);
  const long double cz = wide(a.x) * wide(b.y) - wide(a.y) * wide(b.x);
  const long double c = wide(a.x) * wide(b.x) + wide(a.y) * wide(b.y) + wide(a.z) * wide(b.z);
  return std::atan2(std::sqrt(cx * cx + cy * cy + cz * cz), c) * 180 / 3.14159265358979323846264338L;
}

}  // namespace

TEST_CASE("normal errors: angles that are known") {
  const std::vector<double> angles = {0, 3, 8, 20, 25, 90};
  std::vector<Vec3f> estimate;
  for (const double a : angles) estimate.push_back(turned(a));
  const Measured m = measure(estimate, std::vector<Vec3f>(angles.size(), turned(0)));
  REQUIRE(m.status.ok());
  double sum = 0;
  double squared = 0;
  for (const double a : angles) {
    sum += a;
    squared += a * a;
  }
  CHECK(m.errors.pixels == 6);
  CHECK(m.errors.mean_deg == doctest::Approx(sum / 6).epsilon(1e-6));
  CHECK(m.errors.rms_deg == doctest::Approx(std::sqrt(squared / 6)).epsilon(1e-6));
  CHECK(m.errors.median_deg == doctest::Approx(14).epsilon(1e-6));
  CHECK(m.errors.share_below[0] == doctest::Approx(2.0 / 6));
  CHECK(m.errors.share_below[1] == doctest::Approx(3.0 / 6));
  CHECK(m.errors.share_below[2] == doctest::Approx(4.0 / 6));
  CHECK(m.errors.share_below[3] == doctest::Approx(5.0 / 6));
}

TEST_CASE("normal errors: the opposite normal is 180 degrees off") {
  const Measured m = measure({{0, 0, 1}, {-0.6F, 0, 0.8F}}, {{0, 0, -1}, {0.6F, 0, -0.8F}});
  REQUIRE(m.status.ok());
  CHECK(m.errors.rms_deg == doctest::Approx(180).epsilon(1e-12));
  CHECK(m.errors.median_deg == doctest::Approx(180).epsilon(1e-7));
  for (const double share : m.errors.share_below) CHECK(share == 0);
}

TEST_CASE("normal errors: a millionth of a degree is told from none, and equal normals are exactly 0 apart") {
  const float tiny = 1.7453293e-8F;
  const Measured m = measure({{tiny, 0, -1}}, {{0, 0, -1}});
  REQUIRE(m.status.ok());
  CHECK(std::fabs(m.errors.rms_deg / 1e-6 - 1) < 1e-6);
  const Vec3f n{0.3F, -0.5F, -0.81F};
  CHECK(measure({n, n}, {n, n}).errors.rms_deg == 0);
}

TEST_CASE("normal errors: lengths do not matter, zero and not finite do not count") {
  CHECK(measure({{0, -1e-30F, 0}}, {{0, -7, 0}}).errors.rms_deg == 0);
  const Measured m = measure({{0, 0, 0}, {kNaN, 0, -1}, turned(0), turned(0), turned(10)},
                             {turned(0), turned(0), {0, 0, 0}, {0, kNaN, 0}, turned(0)});
  REQUIRE(m.status.ok());
  CHECK(m.errors.truth_pixels == 3);
  CHECK(m.errors.pixels == 1);
  CHECK(m.errors.mean_deg == doctest::Approx(10).epsilon(1e-6));
}

TEST_CASE("normal errors: the mask selects; nothing to compare is a status") {
  const Measured m = measure({turned(10), turned(50)}, {turned(0), turned(0)}, {1, 0});
  REQUIRE(m.status.ok());
  CHECK(m.errors.mean_deg == doctest::Approx(10).epsilon(1e-6));
  CHECK(measure({turned(1)}, {turned(1)}, {0}).status.code() == StatusCode::no_valid_input);
  CHECK(measure({{0, 0, 0}}, {turned(1)}).status.code() == StatusCode::no_valid_input);
  CHECK(measure({turned(1)}, {{0, 0, 0}}).status.code() == StatusCode::no_valid_input);
  const std::vector<Vec3f> plane(6, turned(0));
  npsim_test::Scratch scratch(npsim::normal_errors_workspace_bytes({3, 2}));
  npsim::Workspace& workspace = scratch.workspace();
  npsim::SerialExecutor serial;
  NormalErrors out;
  CHECK(npsim::normal_errors({plane.data(), {2, 3}}, {plane.data(), {3, 2}}, {}, out, workspace, serial).code() ==
        StatusCode::shape_mismatch);
  npsim::Workspace none;
  CHECK(npsim::normal_errors({plane.data(), {3, 2}}, {plane.data(), {3, 2}}, {}, out, none, serial).code() ==
        StatusCode::workspace_exhausted);
  CHECK(out.pixels == 0);
}

TEST_CASE("normal errors: an angle of any size is within 1e-13 degrees of long double") {
  for (std::uint32_t i = 0; i < 300; ++i) {
    npsim::RandomStream random(8, npsim::RandomPurpose::generic, 0, 0, i, 0);
    const auto draw = [&] { return 2 * random.uniform() - 1; };
    const Vec3f a{draw(), draw(), draw()};
    const float off =
        std::ldexp(1.0F, -static_cast<int>(i % 24));  // from nearly equal, or nearly opposite, to anything
    const Vec3f b = (i % 2 == 0 ? a : -a) + Vec3f{draw(), draw(), draw()} * off;
    const Measured m = measure({a}, {b});
    REQUIRE(m.status.ok());
    CHECK(std::fabs(m.errors.mean_deg - static_cast<double>(long_angle_deg(a, b))) < 1e-13);
  }
}

TEST_CASE("normal errors: within the stated bound of long double, and the same bits in any order of the chunks") {
  const Shape shape{61, 130};
  std::vector<Vec3f> estimate;
  std::vector<Vec3f> truth;
  long double squared = 0;
  for (std::size_t i = 0; i < shape.pixels(); ++i) {
    npsim::RandomStream random(5, npsim::RandomPurpose::generic, 0, 0, static_cast<std::uint32_t>(i), 0);
    const auto draw = [&] { return 2 * random.uniform() - 1; };
    const Vec3f a{draw(), draw(), draw()};
    const Vec3f b{draw(), draw(), draw()};
    estimate.push_back(a);
    truth.push_back(b);
    const long double angle = long_angle_deg(a, b);
    squared += angle * angle;
  }
  npsim::SerialExecutor serial;
  const Measured one = measure(estimate, truth, shape, serial);
  REQUIRE(one.status.ok());
  const long double rms = std::sqrt(squared / static_cast<long double>(shape.pixels()));
  CHECK(one.errors.rms_deg == doctest::Approx(static_cast<double>(rms)).epsilon(1e-10).scale(0));
  npsim_test::BackwardExecutor backward;
  const Measured many = measure(estimate, truth, shape, backward);
  CHECK(std::memcmp(&many.errors, &one.errors, sizeof one.errors) == 0);
}
