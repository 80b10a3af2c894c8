// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>

#include "npsim/core/vec.hpp"

namespace {
using namespace npsim;
constexpr double kPi = 3.14159265358979323846;
}  // namespace

TEST_CASE("circle: the angle of a vector is right to 4e-7 all round") {
  for (int i = -3600; i <= 3600; ++i) {
    const double a = i * kPi / 3600;
    const float y = static_cast<float>(3 * std::sin(a));
    const float x = static_cast<float>(3 * std::cos(a));
    const double got = static_cast<double>(angle_of(y, x));
    CHECK(std::fabs(std::remainder(got - std::atan2(static_cast<double>(y), static_cast<double>(x)), 2 * kPi)) < 4e-7);
  }
  CHECK(angle_of(0, 0) == 0.0F);
}

TEST_CASE("circle: the map of the square keeps areas, and its rim is the circle") {
  const auto at = [](double u, double v) {
    return vec_cast<double>(Vec3f{concentric_disc(static_cast<float>(u), static_cast<float>(v)).x,
                                  concentric_disc(static_cast<float>(u), static_cast<float>(v)).y, 0});
  };
  for (double u = 0.005; u < 1; u += 0.0371) {
    for (double v = 0.007; v < 1; v += 0.0413) {
      // Areas by differences, away from the diagonals where the map has its folds.
      if (std::fabs(std::fabs(2 * u - 1) - std::fabs(2 * v - 1)) < 0.02) continue;
      const double h = 2e-3;
      const Vec3d du = (at(u + h, v) - at(u - h, v)) / (2 * h);
      const Vec3d dv = (at(u, v + h) - at(u, v - h)) / (2 * h);
      CHECK(std::fabs(du.x * dv.y - du.y * dv.x) == doctest::Approx(kPi).epsilon(2e-3));
    }
    CHECK(length(at(u, 0)) == doctest::Approx(1).epsilon(1e-6));
    CHECK(length(at(1, u)) == doctest::Approx(1).epsilon(1e-6));
  }
  CHECK(length(at(0.5, 0.5)) == 0);
}
