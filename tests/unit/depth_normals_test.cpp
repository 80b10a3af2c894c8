// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/normals.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "npsim/core/random.hpp"

using namespace npsim;

namespace {

constexpr Intrinsics kCamera{500.0F, 450.0F, 31.3F, 20.7F};

// z-depth of the plane n . P = offset at the centre of a pixel.
double plane_depth(const Intrinsics& k, const Vec3d& n, double offset, int x, int y) {
  const double a = (x + 0.5 - static_cast<double>(k.cx)) / static_cast<double>(k.fx);
  const double b = (y + 0.5 - static_cast<double>(k.cy)) / static_cast<double>(k.fy);
  return offset / (n.x * a + n.y * b + n.z);
}

Vec3d point(const Intrinsics& k, ImageView<const float> depth, int x, int y) {
  const double z = static_cast<double>(depth(x, y));
  return {(x + 0.5 - static_cast<double>(k.cx)) / static_cast<double>(k.fx) * z,
          (y + 0.5 - static_cast<double>(k.cy)) / static_cast<double>(k.fy) * z, z};
}

bool valid(ImageView<const float> d, int x, int y) { return d.contains(x, y) && is_valid_depth(d(x, y)); }

// The cross product of the edges between three-dimensional points: an independent route to the same normal.
Vec3d naive_normal(const Intrinsics& k, ImageView<const float> d, int x, int y) {
  if (!valid(d, x, y)) return {};
  const int sx = valid(d, x + 1, y) ? 1 : (valid(d, x - 1, y) ? -1 : 0);
  const int sy = valid(d, x, y + 1) ? 1 : (valid(d, x, y - 1) ? -1 : 0);
  if (sx == 0 || sy == 0) return {};
  const Vec3d p = point(k, d, x, y);
  Vec3d n = normalized(cross(point(k, d, x + sx, y) - p, point(k, d, x, y + sy) - p));
  if (dot(n, p) > 0) n = -n;
  return n;
}

Status compute(TangentForm form, ImageView<const float> depth, ImageView<Vec3f> out, const Intrinsics& k = kCamera) {
  SerialExecutor executor;
  Workspace none;
  return normals_from_depth(NormalsParams{form}, depth, k, out, none, executor);
}

}  // namespace

TEST_CASE("normals are exact on planes, grazing ones and the last row and column included") {
  const Shape shape{64, 40};
  std::vector<float> z(shape.pixels());
  std::vector<Vec3f> n(shape.pixels());
  const Vec3d planes[] = {{0, 0, 1}, {0.0, 1.0, 0.2}, {0.3, -0.2, 0.9}, {0.999, 0.0, 0.1}};
  for (const Vec3d& raw : planes) {
    const Vec3d plane = normalized(raw);
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        z[static_cast<std::size_t>(y * shape.width + x)] = static_cast<float>(plane_depth(kCamera, plane, 5, x, y));
      }
    }
    REQUIRE(compute(TangentForm::perspective, {z.data(), shape}, {n.data(), shape}).ok());
    double worst = 0;
    for (std::size_t i = 0; i < n.size(); ++i) {
      REQUIRE(z[i] > 0);
      worst = std::max(worst, length(vec_cast<double>(n[i]) + plane));
    }
    // Rounding depth to single precision perturbs fx w_u / w by at most fx 2^-24.
    CHECK(worst < 2 * 500.0 * 0x1p-24 * 1.5);
  }
}

TEST_CASE("normals match the cross product of points: random depth with holes, strided views, odd widths") {
  for (const int width : {1, 2, 3, 7, 8, 9, 15, 16, 17, 33}) {
    const Shape shape{width, 13};
    const std::ptrdiff_t stride = width + 5;
    std::vector<float> z(static_cast<std::size_t>(stride) * 13, -7.0F);
    std::vector<Vec3f> n(z.size(), Vec3f{9, 9, 9});
    const ImageView<float> depth(z.data() + 2, shape, stride);
    const ImageView<Vec3f> normals(n.data() + 2, shape, stride);
    RandomStream random(11, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(width), 0);
    for (int y = 0; y < 13; ++y) {
      for (int x = 0; x < width; ++x) {
        const float u = random.uniform();
        depth(x, y) = u < 0.2F ? (u < 0.1F ? std::numeric_limits<float>::quiet_NaN() : 0.0F) : random.uniform(1, 90);
      }
    }
    REQUIRE(compute(TangentForm::perspective, depth, normals).ok());
    for (int y = 0; y < 13; ++y) {
      for (int x = 0; x < width; ++x) {
        const Vec3d expected = naive_normal(kCamera, depth, x, y);
        const Vec3d got = vec_cast<double>(normals(x, y));
        CHECK(std::abs(got.x - expected.x) < 2.5e-7);
        CHECK(std::abs(got.y - expected.y) < 2.5e-7);
        CHECK(std::abs(got.z - expected.z) < 2.5e-7);
      }
      CHECK(n[static_cast<std::size_t>(y * stride)].x == 9.0F);  // memory beside the sub-view is untouched
    }
  }
}

TEST_CASE("the angle to the normal in double stays within the stated bound: grazing, steep, near 0, far, wide angle") {
  const Intrinsics wide{40.0F, 55.0F, 61.7F, 33.2F};  // half angles beyond 55 degrees
  const Shape shape{131, 64};
  std::vector<float> z(shape.pixels());
  std::vector<Vec3f> n(shape.pixels());
  std::vector<Vec3f> one_lane(shape.pixels());
  for (int scene = 0; scene < 6; ++scene) {
    RandomStream random(8, RandomPurpose::test, 0, 0, 0, static_cast<std::uint32_t>(scene));
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        double depth = 0;
        switch (scene) {
          case 0: depth = 1.7 / std::abs((y + 0.5 - 33.2) / 55.0); break;  // road and ceiling, to the horizon
          case 1: depth = plane_depth(wide, normalized(Vec3d{0.3, 0.1, 1.0}), 30.0, x, y); break;
          case 2:
            depth = 80.0 + 1e-5 * static_cast<double>(random.uniform(-1, 1));
            break;  // a few units in the last place
          case 3: depth = x % 7 < 3 ? 2.0 : 80.0; break;
          case 4: depth = 1e-30 * static_cast<double>(random.uniform(1, 1.01F)); break;
          default: depth = static_cast<double>(random.uniform(0.01F, 500.0F)); break;
        }
        z[static_cast<std::size_t>(y * shape.width + x)] = depth > 0 && depth < 1e4 ? static_cast<float>(depth) : 0.0F;
      }
    }
    const ImageView<const float> depth(z.data(), shape);
    REQUIRE(compute(TangentForm::perspective, depth, {n.data(), shape}, wide).ok());
    double worst = 0;  // in units of the bound
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const Vec3d expected = naive_normal(wide, depth, x, y);
        const Vec3d got = vec_cast<double>(n[static_cast<std::size_t>(y * shape.width + x)]);
        if (length(expected) == 0) {
          REQUIRE(length(got) == 0);
          continue;
        }
        const double bound = 5e-7 * (1 + std::abs(x + 0.5 - 61.7) / 40.0 + std::abs(y + 0.5 - 33.2) / 55.0);
        worst = std::max(worst, length(cross(got, expected)) / bound);
        REQUIRE(dot(got, expected) > 0);
      }
    }
    CHECK(worst <= 1.0);
    SerialExecutor serial;
    Workspace none;
    for (const TangentForm form : {TangentForm::perspective, TangentForm::thesis}) {
      REQUIRE(compute(form, depth, {n.data(), shape}, wide).ok());
      REQUIRE(normals_from_depth<simd::scalar::F32>(NormalsParams{form}, depth, wide, {one_lane.data(), shape}, none,
                                                    serial)
                  .ok());
      CHECK(n == one_lane);
    }
  }
}

TEST_CASE("80 % missing depth: a normal exactly where there is a neighbour along each axis") {
  const Shape shape{97, 61};
  std::vector<float> z(shape.pixels());
  std::vector<Vec3f> n(shape.pixels());
  RandomStream random(9, RandomPurpose::test, 0, 0, 0, 0);
  for (float& v : z) v = random.uniform() < 0.8F ? 0.0F : random.uniform(3, 70);
  const ImageView<const float> depth(z.data(), shape);
  REQUIRE(compute(TangentForm::perspective, depth, {n.data(), shape}).ok());
  int found = 0;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const bool expected = valid(depth, x, y) && (valid(depth, x + 1, y) || valid(depth, x - 1, y)) &&
                            (valid(depth, x, y + 1) || valid(depth, x, y - 1));
      const float size = length(n[static_cast<std::size_t>(y * shape.width + x)]);
      CHECK(std::abs(size - (expected ? 1.0F : 0.0F)) < 1e-6F);
      found += expected ? 1 : 0;
    }
  }
  CHECK(found > 100);
}

TEST_CASE("normals face the camera along every ray, also between 1e-38 and 1e38 metres") {
  const Shape shape{48, 32};
  std::vector<float> z(shape.pixels());
  std::vector<Vec3f> n(shape.pixels());
  RandomStream random(3, RandomPurpose::test, 0, 0, 0, 0);
  for (float& v : z) v = std::pow(10.0F, random.uniform(-38, 38));
  REQUIRE(compute(TangentForm::perspective, {z.data(), shape}, {n.data(), shape}).ok());
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const Vec3f& v = n[static_cast<std::size_t>(y * shape.width + x)];
      REQUIRE(is_finite(v));
      REQUIRE(std::abs(length(v) - 1.0F) < 1e-6F);
      CHECK(dot(v, unproject_pixel(kCamera, x, y, 1.0F)) < 1e-6F);
    }
  }
}

TEST_CASE("the thesis' tangents agree with the printed formula, turned towards the camera") {
  const Shape shape{17, 9};
  std::vector<float> z(shape.pixels());
  std::vector<Vec3f> n(shape.pixels());
  RandomStream random(5, RandomPurpose::test, 0, 0, 0, 0);
  for (float& v : z) v = random.uniform(5, 6);
  REQUIRE(compute(TangentForm::thesis, {z.data(), shape}, {n.data(), shape}).ok());
  for (int y = 0; y + 1 < shape.height; ++y) {
    for (int x = 0; x + 1 < shape.width; ++x) {
      const auto at = [&](int i, int j) { return static_cast<double>(z[static_cast<std::size_t>(j * 17 + i)]); };
      const Vec3d printed = normalized(
          Vec3d{-500.0 * (at(x + 1, y) - at(x, y)) / at(x, y), -450.0 * (at(x, y + 1) - at(x, y)) / at(x, y), 1.0});
      CHECK(length(printed + vec_cast<double>(n[static_cast<std::size_t>(y * 17 + x)])) < 5e-7);
    }
  }
}

TEST_CASE("one valid pixel, a column of NaN and images one pixel wide have no normal rather than a wrong one") {
  const Shape shape{9, 5};
  std::vector<float> z(shape.pixels(), 0.0F);
  std::vector<Vec3f> n(shape.pixels());
  z[22] = 10;
  REQUIRE(compute(TangentForm::perspective, {z.data(), shape}, {n.data(), shape}).ok());
  for (const Vec3f& v : n) CHECK(v == Vec3f{});

  z.assign(z.size(), 10.0F);
  for (int y = 0; y < 5; ++y) z[static_cast<std::size_t>(y * 9 + 4)] = std::numeric_limits<float>::quiet_NaN();
  REQUIRE(compute(TangentForm::perspective, {z.data(), shape}, {n.data(), shape}).ok());
  for (std::size_t i = 0; i < n.size(); ++i) CHECK(n[i] == (i % 9 == 4 ? Vec3f{} : Vec3f{0, 0, -1}));

  REQUIRE(compute(TangentForm::perspective, {z.data(), {1, 5}, 9}, {n.data(), {1, 5}}).ok());
  for (std::size_t i = 0; i < 5; ++i) CHECK(n[i] == Vec3f{});
}

TEST_CASE("normals_from_depth refuses bad arguments") {
  std::vector<float> z(12, 1.0F);
  std::vector<Vec3f> n(12);
  CHECK(compute(TangentForm::perspective, {}, {n.data(), {4, 3}}).code() == StatusCode::no_valid_input);
  CHECK(compute(TangentForm::perspective, {z.data(), {4, 3}}, {n.data(), {3, 4}}).code() == StatusCode::shape_mismatch);
  CHECK(compute(TangentForm::perspective, {z.data(), {4, 3}}, {n.data(), {4, 3}}, Intrinsics{}).code() ==
        StatusCode::invalid_argument);
  CHECK(compute(static_cast<TangentForm>(7), {z.data(), {4, 3}}, {n.data(), {4, 3}}).code() ==
        StatusCode::invalid_argument);
}
