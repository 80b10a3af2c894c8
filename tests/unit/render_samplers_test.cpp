// SPDX-License-Identifier: Apache-2.0
// Every sampler against its density, by Pearson's chi-square with fixed seeds: the sum of (found - expected)^2 /
// expected over k bins is about k with variance 2 k.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "npsim/core/random.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/material/bsdf.hpp"
#include "npsim/render/mirror.hpp"

namespace {

using namespace npsim;
constexpr double kPi = 3.14159265358979323846;
constexpr int kSide = 8;  // bins each way
constexpr int kDraws = 60000;

// `bin` takes u, v to two coordinates in [0, 1]; `share` is what falls into each of the bins, or 1 / bins.
template <class Bin>
void check_chi_square(const Bin& bin, const std::vector<double>& share = {}) {
  std::vector<double> found(kSide * kSide, 0.0);
  bool inside = true;
  for (std::uint32_t i = 0; i < kDraws; ++i) {
    RandomStream random(8, RandomPurpose::test, 0, 0, i, 0);
    const float u = random.uniform();
    const auto [x, y] = bin(u, random.uniform());
    inside = inside && x > -1e-4 && x < 1.0001 && y > -1e-4 && y < 1.0001;
    const auto index = [](double a) { return std::min(std::max(static_cast<int>(a * kSide), 0), kSide - 1); };
    found[static_cast<std::size_t>(index(x) * kSide + index(y))] += 1.0;
  }
  double sum = 0;
  int bins = 0;
  for (std::size_t b = 0; b < found.size(); ++b) {
    const double expected = kDraws * (share.empty() ? 1.0 / (kSide * kSide) : share[b]);
    if (expected < 5) continue;
    sum += (found[b] - expected) * (found[b] - expected) / expected;
    ++bins;
  }
  CHECK(inside);
  CHECK(bins > kSide * kSide / 2);
  CHECK(sum < bins + 4 * std::sqrt(2.0 * bins));
  CHECK(sum > bins - 4 * std::sqrt(2.0 * bins));
}

double turn(double y, double x) { return std::atan2(y, x) / (2 * kPi) + 0.5; }

}  // namespace

TEST_CASE("chi-square: points of patches, discs, spheres and tubes are uniform over what they show") {
  Emitter e;
  e.centre_m = {1, -2, 7};
  e.half_u_m = {0.5F, 0.1F, 0};
  e.half_v_m = {-0.05F, 0.25F, 0};
  const auto in_patch = [&](const Vec3f& p) {  // by the two half sides, -1 to 1
    const Vec3d d = vec_cast<double>(p - e.centre_m);
    const Vec3d u = vec_cast<double>(e.half_u_m);
    const Vec3d v = vec_cast<double>(e.half_v_m);
    return Vec2<double>{dot(d, u) / dot(u, u), dot(d, v) / dot(v, v)};
  };
  check_chi_square([&](float u, float v) {
    const Vec2<double> p = in_patch(sample_point(e, {}, u, v));
    return Vec2<double>{0.5 + 0.5 * p.x, 0.5 + 0.5 * p.y};
  });
  e.shape = EmitterShape::disc;
  check_chi_square([&](float u, float v) {
    const Vec2<double> p = in_patch(sample_point(e, {}, u, v));
    return Vec2<double>{p.x * p.x + p.y * p.y, turn(p.y, p.x)};
  });
  e.shape = EmitterShape::sphere;
  for (const Vec3f from : {Vec3f{0, 0, 0}, Vec3f{1, -2, 100}, Vec3f{1.6F, -2, 7}}) {
    const Vec3d axis = normalized(vec_cast<double>(from - e.centre_m));
    const Vec3d s = normalized(cross(axis, Vec3d{0.3, 0.5, 0.8}));
    const Vec3d t = cross(axis, s);
    const double radius = static_cast<double>(length(e.half_u_m));
    const double distance = static_cast<double>(length(from - e.centre_m));
    const double outline = radius * std::sqrt(1 - radius * radius / (distance * distance));
    check_chi_square([&](float u, float v) {
      const Vec3d d = vec_cast<double>(sample_point(e, from, u, v) - e.centre_m);
      const double x = dot(d, s) / outline;
      const double y = dot(d, t) / outline;
      return Vec2<double>{x * x + y * y, turn(y, x)};
    });
  }
  e.shape = EmitterShape::tube;
  check_chi_square([&](float u, float v) {
    const Vec3d d = vec_cast<double>(sample_point(e, {}, u, v) - e.centre_m);
    const Vec3d axis = vec_cast<double>(e.half_u_m);
    const Vec3d across = normalized(cross(axis, vec_cast<double>(-e.centre_m)));
    return Vec2<double>{0.5 + 0.5 * dot(d, axis) / dot(axis, axis),
                        0.5 + 0.5 * dot(d, across) / static_cast<double>(length(e.half_v_m))};
  });
}

TEST_CASE("chi-square: directions by cosine about any normal") {
  for (const Vec3f n : {Vec3f{0, 0, 1}, Vec3f{0, 0, -1}, normalized(Vec3f{1, -2, 0.5F})}) {
    Vec3f t, b;
    tangent_frame(n, t, b);
    check_chi_square([&](float u, float v) {
      const Vec3f d = sample_cosine(n, u, v);
      const auto z = static_cast<double>(dot(n, d));
      return Vec2<double>{z * z, turn(static_cast<double>(dot(b, d)), static_cast<double>(dot(t, d)))};
    });
  }
}

TEST_CASE("chi-square: visible normals of GGX, smooth and rough, from above and at a graze") {
  for (const double a : {0.03, 0.2, 1.0}) {
    for (const double degrees : {0.0, 45.0, 85.0}) {
      const double sine = std::sin(degrees * kPi / 180);
      const double cosine = std::cos(degrees * kPi / 180);
      // Rings that hold equal shares of D cos, tan^2 = a^2 x / (1 - x), in equal sectors.
      std::vector<double> share(kSide * kSide, 0.0);
      const int fine = 48;
      const double masking = 2 * cosine / (cosine + std::sqrt(a * a + (1 - a * a) * cosine * cosine));
      for (int i = 0; i < kSide * fine; ++i) {
        // In steps of sqrt(1 - x), at whose end the visible share grows without bound.
        const double ring_begin = std::sqrt(1 - static_cast<double>(i / fine) / kSide);
        const double ring = ring_begin - std::sqrt(1 - static_cast<double>(i / fine + 1) / kSide);
        const double root = ring_begin - ring * (i % fine + 0.5) / fine;
        const double weight = 2 * root * ring / fine;
        const double tan2 = a * a * (1 - root * root) / (root * root);
        const double z = 1 / std::sqrt(1 + tan2);
        for (int j = 0; j < kSide * fine; ++j) {
          const double angle = ((j + 0.5) / (kSide * fine) - 0.5) * 2 * kPi;
          const double seen = std::max(cosine * z + sine * std::sqrt(1 - z * z) * std::cos(angle), 0.0);
          // Of D cos, masking * seen / (view.z z) are visible.
          share[static_cast<std::size_t>((i / fine) * kSide + j / fine)] +=
              masking * seen / (cosine * z) * weight / (kSide * fine);
        }
      }
      INFO("alpha " << a << ", from " << degrees << " degrees");
      const Vec3f view{static_cast<float>(sine), 0, static_cast<float>(cosine)};
      check_chi_square(
          [&](float u, float v) {
            const Vec3d h = vec_cast<double>(sample_visible_normal(view, static_cast<float>(a), u, v));
            const double tan2 = (h.x * h.x + h.y * h.y) / (h.z * h.z);
            return Vec2<double>{tan2 / (tan2 + a * a), turn(h.y, h.x)};
          },
          share);
    }
  }
}
