// SPDX-License-Identifier: Apache-2.0
#include "npsim/core/vec.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "npsim/core/random.hpp"

using npsim::Vec3d;
using npsim::Vec3f;

static_assert(sizeof(Vec3f) == 12 && alignof(Vec3f) == 4, "an image of Vec3f is an interleaved float image");
static_assert(std::is_trivially_copyable_v<Vec3f> && std::is_standard_layout_v<Vec3f>);
static_assert(sizeof(npsim::Rgb8) == 3);

TEST_CASE("the cross product is right-handed and perpendicular") {
  CHECK(cross(Vec3f{1, 0, 0}, Vec3f{0, 1, 0}) == Vec3f{0, 0, 1});
  for (std::uint32_t i = 0; i < 1000; ++i) {
    npsim::RandomStream random(5, npsim::RandomPurpose::test, 0, 0, i, 0);
    const auto draw = [&] { return static_cast<double>(random.uniform(-1, 1)); };
    const Vec3d a{draw(), draw(), draw()};
    const Vec3d b{draw(), draw(), draw()};
    CHECK(std::abs(dot(cross(a, b), a)) < 1e-15);
    CHECK(std::abs(dot(cross(a, b), b)) < 1e-15);
  }
}

TEST_CASE("normalising the zero vector, and one too short to square, gives zero rather than NaN") {
  CHECK(normalized(Vec3f{}) == Vec3f{});
  CHECK(normalized(Vec3f{1e-30F, 0, 0}) == Vec3f{});
  CHECK(normalized(Vec3f{0, -3, 0}) == Vec3f{0, -1, 0});
}

TEST_CASE("is_finite sees each component") {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  CHECK(is_finite(Vec3f{1, 2, 3}));
  CHECK_FALSE(is_finite(Vec3f{kNan, 2, 3}));
  CHECK_FALSE(is_finite(Vec3f{1, -kInf, 3}));
  CHECK_FALSE(is_finite(Vec3f{1, 2, kNan}));
}

TEST_CASE("arithmetic is by component, the luminance of white is one") {
  const Vec3f a{1, 2, 3};
  const Vec3f b{4, 5, 6};
  CHECK(a + b == Vec3f{5, 7, 9});
  CHECK(b - a == Vec3f{3, 3, 3});
  CHECK(a * b == Vec3f{4, 10, 18});
  CHECK(2.0F * a == a * 2.0F);
  CHECK(b / 2.0F == Vec3f{2, 2.5F, 3});
  CHECK(-a == Vec3f{-1, -2, -3});
  CHECK(a != b);
  Vec3f c = a;
  c += b;
  c -= a;
  c *= 2.0F;
  CHECK(c == Vec3f{8, 10, 12});
  CHECK(static_cast<double>(npsim::luminance({1, 1, 1})) == doctest::Approx(1.0).epsilon(1e-6));
  CHECK(npsim::vec_cast<double>(a).z == 3.0);
}
