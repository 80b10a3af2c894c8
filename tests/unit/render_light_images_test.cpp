// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/render/light_images.hpp"
#include "unit/fixture.hpp"

namespace {

using namespace npsim;
using npsim_test::Image;

constexpr Shape kShape{75, 40};  // neither a multiple of a tile
constexpr float kThreshold = 1e-3F;

// Lights over eight decades, each within some tiles; the last one too weak for any.
Vec3f light_at(std::size_t light, int x, int y) {
  if (light == 3) return {4e-4F, 4e-4F, 4e-4F};
  if (light == 1 && x >= 32) return {};
  RandomStream random(3, RandomPurpose::test, 0, static_cast<std::uint32_t>(light), static_cast<std::uint32_t>(x),
                      static_cast<std::uint32_t>(y));
  const float scale = std::pow(10.0F, random.uniform(-4, 4));
  return Vec3f{random.uniform(), random.uniform(), random.uniform()} * scale;
}

struct Made {
  std::vector<std::uint32_t> block;
  std::vector<unsigned char> memory;
  LightImages images;

  explicit Made(float threshold) : block(4 * light_tiles(kShape).pixels()), memory(1U << 20U) {
    Workspace workspace(memory.data(), memory.size());
    LightImageBuilder builder;
    SerialExecutor serial;
    const Span<std::uint32_t> index(block.data(), block.size());
    REQUIRE(builder.start(kShape, threshold, index, workspace).ok());
    for (std::size_t i = 0; i < 4; ++i) {
      for_light_tiles(kShape, serial, [&](std::size_t tile, int left, int top, int right, int bottom) {
        builder.stage(i % 2, tile, true, [&](std::size_t p) {
          const int x = left + static_cast<int>(p) % kLightTile;
          const int y = top + static_cast<int>(p) / kLightTile;
          return x < right && y < bottom ? light_at(i, x, y) : Vec3f{};
        });
      });
      REQUIRE(builder.keep(i, i % 2, workspace).ok());
    }
    images = {kShape, index, builder.values(), 4, builder.left_out_cd_m2()};
  }
};

}  // namespace

TEST_CASE("light images: a weighted sum is that of double precision within 2^-11 of each, whatever the size") {
  const Made made(0.0F);
  const std::vector<Vec3f> weights{{1, 0.5F, 0.25F}, {0.1F, 0.2F, 3}, {}, {1, 1, 1}};
  Image<Vec3f> sum(kShape);
  ThreadPool pool(3);
  REQUIRE(sum_light_images(made.images, {weights.data(), 4}, sum.view(), pool).ok());
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      Vec3d expected;
      for (std::size_t i = 0; i < 4; ++i) {
        expected += vec_cast<double>(weights[i]) * vec_cast<double>(light_at(i, x, y));
      }
      const Vec3d got = vec_cast<double>(sum(x, y));
      CHECK(std::fabs(got.x - expected.x) <= (0x1p-11 + 1e-6) * expected.x + 0x1p-39);
      CHECK(std::fabs(got.z - expected.z) <= (0x1p-11 + 1e-6) * expected.z + 0x1p-39);
    }
  }
}

TEST_CASE("light images: tiles below the threshold are left out, and no pixel misses more than is said") {
  const Made whole(0.0F);
  const Made thinned(kThreshold);
  CHECK(thinned.images.bytes() < whole.images.bytes());
  CHECK(thinned.images.left_out_cd_m2 > 0.0F);
  CHECK(thinned.images.left_out_cd_m2 <= 4 * kThreshold);
  const std::vector<Vec3f> ones(4, Vec3f{1, 1, 1});
  Image<Vec3f> all(kShape);
  Image<Vec3f> kept(kShape);
  SerialExecutor serial;
  REQUIRE(sum_light_images(whole.images, {ones.data(), 4}, all.view(), serial).ok());
  REQUIRE(sum_light_images(thinned.images, {ones.data(), 4}, kept.view(), serial).ok());
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      CHECK(luminance(all(x, y) - kept(x, y)) <= thinned.images.left_out_cd_m2 * 1.001F + 1e-6F * luminance(all(x, y)));
    }
  }
}

TEST_CASE("light images: one lane and all lanes, one thread and three, give the same bits") {
  const Made made(kThreshold);
  const std::vector<Vec3f> weights(4, Vec3f{0.3F, 0.7F, 1.1F});
  Image<Vec3f> one(kShape);
  Image<Vec3f> all(kShape);
  SerialExecutor serial;
  ThreadPool pool(3);
  REQUIRE(sum_light_images<simd::scalar::F32>(made.images, {weights.data(), 4}, one.view(), serial).ok());
  REQUIRE(sum_light_images(made.images, {weights.data(), 4}, all.view(), pool).ok());
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) CHECK(one(x, y) == all(x, y));
  }
}

TEST_CASE("light images: NaN and negative light are stored as none, infinite light as the greatest number") {
  std::vector<std::uint32_t> block(1);
  std::vector<unsigned char> memory(1U << 17U);
  Workspace workspace(memory.data(), memory.size());
  LightImageBuilder builder;
  REQUIRE(builder.start({3, 1}, 0.0F, {block.data(), 1}, workspace).ok());
  const float inf = std::numeric_limits<float>::infinity();
  const Vec3f odd[3] = {{1, std::numeric_limits<float>::quiet_NaN(), -2}, {inf, 0, 1e-30F}, {3e7F, 5, 65504}};
  builder.stage(0, 0, true, [&](std::size_t p) { return p < 3 ? odd[p] : Vec3f{}; });
  REQUIRE(builder.keep(0, 0, workspace).ok());
  const LightImages images{{3, 1}, {block.data(), 1}, builder.values(), 1, 0};
  const Vec3f weight{1, 1, 1};
  Image<Vec3f> out(Shape{3, 1});
  SerialExecutor serial;
  REQUIRE(sum_light_images(images, Span<const Vec3f>(&weight, 1), out.view(), serial).ok());
  CHECK(out(0, 0) == Vec3f{1, 0, 0});
  CHECK(out(1, 0).x > 1e7F);
  CHECK(is_finite(out(1, 0)));
  CHECK(out(1, 0).z == 0.0F);
  CHECK(out(2, 0).z == doctest::Approx(65504).epsilon(1e-3));
}

TEST_CASE("light images: a weight too few, an image of another size and a workspace too small are refused") {
  const Made made(kThreshold);
  const std::vector<Vec3f> weights(3);
  Image<Vec3f> out(kShape);
  Image<Vec3f> small(Shape{10, 10});
  SerialExecutor serial;
  CHECK(sum_light_images(made.images, {weights.data(), 3}, out.view(), serial).code() == StatusCode::shape_mismatch);
  CHECK(sum_light_images(made.images, {weights.data(), 3}, small.view(), serial).code() == StatusCode::shape_mismatch);
  std::vector<std::uint32_t> block(light_tiles(kShape).pixels());
  std::vector<unsigned char> memory(LightImageBuilder::staging_bytes(kShape) + 64);
  Workspace workspace(memory.data(), memory.size());
  LightImageBuilder builder;
  REQUIRE(builder.start(kShape, 0.0F, {block.data(), block.size()}, workspace).ok());
  for_light_tiles(kShape, serial, [&](std::size_t tile, int, int, int, int) {
    builder.stage(0, tile, true, [](std::size_t) { return Vec3f{1, 1, 1}; });
  });
  CHECK(builder.keep(0, 0, workspace).code() == StatusCode::workspace_exhausted);
}
