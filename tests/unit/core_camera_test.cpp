// SPDX-License-Identifier: Apache-2.0
#include "npsim/core/camera.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>

#include "npsim/core/random.hpp"

using npsim::Intrinsics;
using npsim::RandomPurpose;
using npsim::RandomStream;
using npsim::StatusCode;
using npsim::Vec2f;
using npsim::Vec3f;

namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

}  // namespace

TEST_CASE("project undoes unproject, for cameras and depths of very different scale") {
  // Each direction rounds four or five times; the offset from the principal point carries a relative error of at most
  // six half-ulps, and adding cx another half ulp of the sum.
  const auto bound = [](float offset, float sum) {
    constexpr double kHalfUlp = 0x1p-24;
    return kHalfUlp * (6.0 * std::abs(static_cast<double>(offset)) + std::abs(static_cast<double>(sum)) * 2.0);
  };
  for (std::uint32_t i = 0; i < 20000; ++i) {
    RandomStream random(11, RandomPurpose::test, 0, 0, i, 0);
    const Intrinsics k{random.uniform(50, 5000), random.uniform(50, 5000), random.uniform(-100, 3000),
                       random.uniform(-100, 3000)};
    const float u = random.uniform(0, 4096);
    const float v = random.uniform(0, 2160);
    const float z = std::exp2(random.uniform(-10, 14));
    const Vec3f p = unproject(k, u, v, z);
    const Vec2f back = project(k, p);
    REQUIRE(p.z == z);
    REQUIRE(std::abs(static_cast<double>(back.x) - static_cast<double>(u)) <=
            bound(u - k.cx, std::abs(u) + std::abs(k.cx)));
    REQUIRE(std::abs(static_cast<double>(back.y) - static_cast<double>(v)) <=
            bound(v - k.cy, std::abs(v) + std::abs(k.cy)));
  }
}

TEST_CASE("axes: right is +x, down is +y, depth is z and not the length of the ray") {
  const Intrinsics k{100, 100, 50, 50};
  const Vec3f p = unproject(k, 150, 50, 2);
  CHECK(p == Vec3f{2, 0, 2});
  CHECK(unproject(k, 50, 0, 4).y == -2.0F);
  CHECK(unproject(k, 50, 50, 3) == Vec3f{0, 0, 3});
}

TEST_CASE("pixel centres lie half a pixel inside") {
  const Intrinsics k{10, 10, 2, 2};
  CHECK(unproject_pixel(k, 0, 0, 1) == unproject(k, 0.5F, 0.5F, 1));
  CHECK(unproject_pixel(k, 1, 1, 10).x == -0.5F);
  CHECK(unproject_pixel(k, 2, 2, 10).y == 0.5F);
}

TEST_CASE("a field of view puts the image's edges on its rays") {
  const Intrinsics k = npsim::intrinsics_from_fov({800, 600}, 1.5707964F);
  CHECK(static_cast<double>(k.fx) == doctest::Approx(400.0).epsilon(1e-6));
  CHECK(k.fy == k.fx);
  CHECK(k.cx == 400.0F);
  CHECK(k.cy == 300.0F);
  const Vec3f edge = unproject(k, 800, 300, 1);
  CHECK(static_cast<double>(std::atan2(edge.x, edge.z)) == doctest::Approx(0.785398).epsilon(1e-6));
}

TEST_CASE("a resampled camera sees the same directions, also at unequal scales") {
  const Intrinsics k{900, 870, 511.5F, 250.25F};
  const Intrinsics s = npsim::scaled(k, {1024, 512}, {512, 128});
  const Vec3f a = unproject(k, 700, 100, 5);
  const Vec3f b = unproject(s, 350, 25, 5);
  CHECK(static_cast<double>(b.x) == doctest::Approx(static_cast<double>(a.x)).epsilon(1e-6));
  CHECK(static_cast<double>(b.y) == doctest::Approx(static_cast<double>(a.y)).epsilon(1e-6));
}

TEST_CASE("intrinsics that cannot be a camera are refused") {
  CHECK(validate(Intrinsics{1, 1, 0, 0}).ok());
  CHECK(validate(Intrinsics{1, 1, -5, 1e6F}).ok());
  for (const float bad : {0.0F, -1.0F, kNan, kInf, -kInf}) {
    CAPTURE(bad);
    CHECK(validate(Intrinsics{bad, 1, 0, 0}).code() == StatusCode::invalid_argument);
    CHECK(validate(Intrinsics{1, bad, 0, 0}).code() == StatusCode::invalid_argument);
  }
  for (const float bad : {kNan, kInf}) {
    CHECK_FALSE(validate(Intrinsics{1, 1, bad, 0}).ok());
    CHECK_FALSE(validate(Intrinsics{1, 1, 0, bad}).ok());
  }
  CHECK_FALSE(validate(Intrinsics{}).ok());
}

TEST_CASE("missing depth: NaN, infinity, zero of both signs and behind the camera") {
  for (const float missing : {kNan, kInf, -kInf, 0.0F, -0.0F, -1.0F}) CHECK_FALSE(npsim::is_valid_depth(missing));
  for (const float good : {1e-6F, 1.0F, 1e30F, std::numeric_limits<float>::denorm_min()}) {
    CHECK(npsim::is_valid_depth(good));
  }
}
