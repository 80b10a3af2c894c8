// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/normals.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "npsim/core/random.hpp"
#include "npsim/core/workspace.hpp"

using namespace npsim;

namespace {

constexpr Shape kShape{160, 90};
constexpr Intrinsics kCamera{120.0F, 120.0F, 80.0F, 40.0F};

// A street canyon: road 1.7 m below, walls 6 m left and 4 m right, an end wall at 60 m.
std::vector<float> canyon() {
  std::vector<float> z(kShape.pixels());
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const Vec3f ray = unproject_pixel(kCamera, x, y, 1.0F);
      float depth = 60.0F;
      if (ray.y > 0) depth = std::min(depth, 1.7F / ray.y);
      if (ray.x < 0) depth = std::min(depth, -6.0F / ray.x);
      if (ray.x > 0) depth = std::min(depth, 4.0F / ray.x);
      z[static_cast<std::size_t>(y * kShape.width + x)] = depth;
    }
  }
  return z;
}

std::vector<Vec3f> normals_of(const std::vector<float>& z) {
  std::vector<Vec3f> n(z.size());
  SerialExecutor executor;
  Workspace none;
  REQUIRE(normals_from_depth({}, {z.data(), kShape}, kCamera, {n.data(), kShape}, none, executor).ok());
  return n;
}

// What a file in the given convention holds: the inverse of apply_normal_convention.
Vec3f encode(const NormalConvention& c, const Vec3f& n) {
  const float canonical[3] = {n.x, n.y, n.z};
  float raw[3] = {};
  for (int i = 0; i < 3; ++i) raw[c.axis[i]] = static_cast<float>(c.sign[i]) * canonical[i];
  return {raw[0], raw[1], raw[2]};
}

}  // namespace

TEST_CASE("each of the 48 conventions is recognised in a street canyon, with noise and holes") {
  std::vector<float> z = canyon();
  const std::vector<Vec3f> truth = normals_of(z);
  RandomStream random(1, RandomPurpose::test, 0, 0, 0, 0);
  for (float& v : z) v = random.uniform() < 0.1F ? 0.0F : v * random.uniform(0.998F, 1.002F);
  std::vector<Vec3f> raw(z.size());
  const int permutations[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
  for (const auto& p : permutations) {
    for (int s = 0; s < 8; ++s) {
      NormalConvention c;
      for (int i = 0; i < 3; ++i) {
        c.axis[i] = static_cast<std::int8_t>(p[i]);
        c.sign[i] = static_cast<std::int8_t>((s >> i & 1) != 0 ? -1 : 1);
      }
      for (std::size_t i = 0; i < raw.size(); ++i) raw[i] = encode(c, truth[i]);
      float agreement = 0;
      const NormalConvention found =
          detect_normal_convention({raw.data(), kShape}, {z.data(), kShape}, kCamera, agreement);
      CHECK(found == c);
      CHECK(agreement > 0.8F);
      CHECK(agreement <= 1.0F);
      ImageView<Vec3f> view(raw.data(), kShape);
      apply_normal_convention(found, view);
      CHECK(raw[1000] == truth[1000]);
    }
  }
}

TEST_CASE("depth quantised in steps of 2 % still tells the convention") {
  std::vector<float> z = canyon();
  const std::vector<Vec3f> truth = normals_of(z);
  for (float& v : z) v = std::exp(std::round(std::log(v) / 0.022F) * 0.022F);
  NormalConvention c;
  c.sign[1] = -1;
  c.sign[2] = -1;
  std::vector<Vec3f> raw(z.size());
  for (std::size_t i = 0; i < raw.size(); ++i) raw[i] = encode(c, truth[i]);
  float agreement = 0;
  CHECK(detect_normal_convention({raw.data(), kShape}, {z.data(), kShape}, kCamera, agreement) == c);
  CHECK(agreement > 0.5F);
}

TEST_CASE("every convention is recognised with wrong normals on half the road, 8-bit depth or 80 % of it missing") {
  const std::vector<float> exact = canyon();
  const std::vector<Vec3f> truth = normals_of(exact);
  const int permutations[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
  for (int hard = 0; hard < 5; ++hard) {
    RandomStream random(2, RandomPurpose::test, 0, 0, 0, static_cast<std::uint32_t>(hard));
    std::vector<float> z = exact;
    std::vector<Vec3f> estimated = truth;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        const auto at = static_cast<std::size_t>(y * kShape.width + x);
        const bool road = truth[at].y < -0.9F;
        if (hard == 0 && road && x < 80) estimated[at] = {0, 0, -1};                     // taken for a wall
        if (hard == 1 && road && x < 50) estimated[at] = -truth[at];                     // turned over
        if (hard == 2) z[at] = std::round(z[at] * (255.0F / 60.0F)) * (60.0F / 255.0F);  // steps of 24 cm
        if (hard == 3) z[at] = std::round(z[at] * 256.0F * 0.011F) / (256.0F * 0.011F);  // steps of 36 cm
        if (hard == 4 && random.uniform() < 0.8F) z[at] = 0;
      }
    }
    int wrong = 0;
    float least = 1;
    for (const auto& p : permutations) {
      for (int s = 0; s < 8; ++s) {
        NormalConvention c;
        for (int i = 0; i < 3; ++i) {
          c.axis[i] = static_cast<std::int8_t>(p[i]);
          c.sign[i] = static_cast<std::int8_t>((s >> i & 1) != 0 ? -1 : 1);
        }
        std::vector<Vec3f> raw(z.size());
        for (std::size_t i = 0; i < raw.size(); ++i) raw[i] = encode(c, estimated[i]);
        float agreement = 0;
        wrong += detect_normal_convention({raw.data(), kShape}, {z.data(), kShape}, kCamera, agreement) != c ? 1 : 0;
        least = std::min(least, agreement);
      }
    }
    CHECK_MESSAGE(wrong == 0, "case " << hard);
    CHECK_MESSAGE(least > 0.5F, "case " << hard);
  }
}

TEST_CASE("a fronto-parallel wall says nothing about x and y and keeps them") {
  std::vector<float> z(kShape.pixels(), 20.0F);
  std::vector<Vec3f> raw(z.size(), Vec3f{0, 0, 1});
  float agreement = 0;
  const NormalConvention c = detect_normal_convention({raw.data(), kShape}, {z.data(), kShape}, kCamera, agreement);
  CHECK(c.axis[0] == 0);
  CHECK(c.axis[1] == 1);
  CHECK(c.sign[0] == 1);
  CHECK(c.sign[1] == 1);
  CHECK(c.sign[2] == -1);
  CHECK(std::abs(agreement - 1.0F) < 1e-6F);
}

TEST_CASE("nothing to compare with gives identity and agreement 0") {
  std::vector<float> z(kShape.pixels(), std::numeric_limits<float>::quiet_NaN());
  std::vector<Vec3f> raw(z.size(), Vec3f{1, 0, 0});
  float agreement = 5;
  CHECK(detect_normal_convention({raw.data(), kShape}, {z.data(), kShape}, kCamera, agreement) == NormalConvention{});
  CHECK(agreement == 0.0F);
  CHECK(detect_normal_convention({raw.data(), {1, 1}}, {z.data(), {1, 1}}, kCamera, agreement) == NormalConvention{});
  CHECK(detect_normal_convention({raw.data(), {3, 4}}, {z.data(), {4, 3}}, kCamera, agreement) == NormalConvention{});
  CHECK(detect_normal_convention({}, {}, kCamera, agreement) == NormalConvention{});
  z.assign(z.size(), 5.0F);
  raw.assign(raw.size(), Vec3f{});
  CHECK(detect_normal_convention({raw.data(), kShape}, {z.data(), kShape}, kCamera, agreement) == NormalConvention{});
  CHECK(agreement == 0.0F);
}
