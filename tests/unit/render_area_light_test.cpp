// SPDX-License-Identifier: Apache-2.0
// Points, discs, spheres and tubes against closed forms and quadrature in double; lamps that touch a surface or lie far
// off; a receiver within its lamp.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "npsim/core/random.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/light/photometry.hpp"
#include "npsim/render/direct.hpp"

namespace {

using namespace npsim;
constexpr double kPi = 3.14159265358979323846;

Emitter emitter_of(EmitterShape shape, Vec3f half_u, Vec3f half_v) {
  Emitter e;
  e.shape = shape;
  e.half_u_m = half_u;
  e.half_v_m = half_v;
  e.axis = normalized(cross(half_u, half_v));
  e.up = normalized(half_u);
  switch (shape) {
    case EmitterShape::patch: e.area_m2 = 4 * length(cross(half_u, half_v)); break;
    case EmitterShape::disc: e.area_m2 = static_cast<float>(kPi) * length(cross(half_u, half_v)); break;
    case EmitterShape::sphere: e.area_m2 = static_cast<float>(kPi) * dot(half_u, half_u); break;
    case EmitterShape::tube: e.area_m2 = 4 * length(half_u) * length(half_v); break;
  }
  return e;
}

double got(const Emitter& e, const Vec3f& position, const Vec3f& normal) {
  Vec3f to_light{9, 9, 9};
  const float value = illuminance_per_cd(e, position, normal, to_light);
  if (value > 0) {
    CHECK(length(to_light) == doctest::Approx(1).epsilon(1e-5));
    CHECK(dot(to_light, normal) > -1e-6F);
  }
  return static_cast<double>(value);
}

Vec3f random_direction(RandomStream& r) {
  for (int i = 0; i < 100; ++i) {
    const Vec3f v{r.uniform(-1, 1), r.uniform(-1, 1), r.uniform(-1, 1)};
    const float l = length(v);
    if (l > 0.1F && l < 1) return v / l;
  }
  return {0, 0, 1};
}

// From a disc's points, each as bright as its profile says; rings of equal area.
double disc_by_quadrature(const Emitter& e, const Vec3f& position, const Vec3f& normal) {
  const int n = 120;
  double sum = 0;
  for (int i = 0; i < n; ++i) {
    const double r = std::sqrt((i + 0.5) / n);
    for (int j = 0; j < n; ++j) {
      const double a = (j + 0.5) * 2 * kPi / n;
      const Vec3d p = vec_cast<double>(e.centre_m) + vec_cast<double>(e.half_u_m) * (r * std::cos(a)) +
                      vec_cast<double>(e.half_v_m) * (r * std::sin(a));
      const Vec3d d = p - vec_cast<double>(position);
      const double r2 = dot(d, d);
      const Vec3d w = d / std::sqrt(r2);
      const double c = -dot(vec_cast<double>(e.axis), w);
      const double cosine = dot(vec_cast<double>(normal), w);
      if (c <= 0 || cosine <= 0) continue;
      sum += (e.profile == EmissionProfile::signal ? c * c * c * c : c) * cosine / r2 / (n * n);
    }
  }
  return sum;
}

// Luminance times cosine over the cone in which a sphere is seen.
double sphere_by_quadrature(double along, double distance, double radius) {
  const double sine = radius / distance;
  const double least = std::sqrt(1 - sine * sine);
  const double c = along / distance;
  const double s = std::sqrt(1 - c * c);
  const int n = 500;
  double sum = 0;
  for (int i = 0; i < n; ++i) {
    const double z = least + (1 - least) * (i + 0.5) / n;
    const double r = std::sqrt(1 - z * z);
    for (int j = 0; j < n; ++j) {
      sum += std::max(z * c + r * s * std::cos((j + 0.5) * kPi / n), 0.0);
    }
  }
  return sum * (1 - least) * 2 * kPi / (static_cast<double>(n) * n) / (kPi * radius * radius);
}

double tube_by_quadrature(const Emitter& e, const Vec3f& position, const Vec3f& normal) {
  const int n = 5000;
  const Vec3d along = normalized(vec_cast<double>(e.half_u_m));
  double sum = 0;
  for (int i = 0; i < n; ++i) {
    const Vec3d d = vec_cast<double>(e.centre_m) + vec_cast<double>(e.half_u_m) * (2 * (i + 0.5) / n - 1) -
                    vec_cast<double>(position);
    const double r2 = dot(d, d);
    const double across = std::sqrt(std::max(1 - dot(along, d) * dot(along, d) / r2, 0.0));
    sum += across * std::max(dot(vec_cast<double>(normal), d), 0.0) / (r2 * std::sqrt(r2)) / n;
  }
  return sum;
}

}  // namespace

TEST_CASE("area light: a point follows the inverse square and the cosine from 1 cm to 1 km within .1 %") {
  Emitter e = emitter_of(EmitterShape::patch, {1e-4F, 0, 0}, {0, 1e-4F, 0});
  e.profile = EmissionProfile::signal;
  for (const double d : {0.01, 0.1, 1.0, 10.0, 100.0, 1000.0}) {
    for (const double degrees : {0.0, 30.0, 60.0, 85.0, 89.0}) {
      const double a = degrees * kPi / 180;
      const Vec3f normal{static_cast<float>(std::sin(a)), 0, static_cast<float>(-std::cos(a))};
      CHECK(got(e, {0, 0, static_cast<float>(d)}, normal) == doctest::Approx(std::cos(a) / (d * d)).epsilon(1e-3));
    }
  }
}

TEST_CASE("area light: a disc before a receiver that is parallel to it, or upright to it, has Lambert's factors") {
  const double r = 0.7;
  const Emitter e = emitter_of(EmitterShape::disc, {0.7F, 0, 0}, {0, 0.7F, 0});
  for (const double h : {0.3, 0.7, 2.0, 5.0}) {
    for (const double a : {0.0, 0.2, 0.4, 1.5, 3.0}) {
      if (std::hypot(h, a - r) < 0.3 * r) continue;
      const Vec3f position{static_cast<float>(a), 0, static_cast<float>(h)};
      const double s = h * h + a * a + r * r;
      const double root = std::sqrt(s * s - 4 * r * r * a * a);
      const double parallel = 0.5 * (1 - (h * h + a * a - r * r) / root);
      CHECK(got(e, position, {0, 0, -1}) == doctest::Approx(parallel / (r * r)).epsilon(1e-3));
      if (a <= r) continue;  // else the horizon cuts the disc
      const double upright = 0.5 * h / a * (s / root - 1);
      CHECK(got(e, position, {-1, 0, 0}) == doctest::Approx(upright / (r * r)).epsilon(1e-3));
    }
  }
}

TEST_CASE("area light: as near to its rim as one may come, a disc is one of a radius at most 1.3 % off") {
  const Emitter e = emitter_of(EmitterShape::disc, {1, 0, 0}, {0, 1, 0});
  const auto parallel = [](double r, double h, double a) {
    const double s = h * h + a * a + r * r;
    return 0.5 * (1 - (h * h + a * a - r * r) / std::sqrt(s * s - 4 * r * r * a * a));
  };
  for (const double h : {1e-3, 1e-2, 0.1, 0.3}) {
    for (double a = 0.7; a < 1.3; a += 0.013) {
      for (double turn = 0; turn < kPi / 8; turn += kPi / 32) {
        const Vec3f position{static_cast<float>(a * std::cos(turn)), static_cast<float>(a * std::sin(turn)),
                             static_cast<float>(h)};
        const double value = got(e, position, {0, 0, -1});
        CHECK(value >= parallel(0.987, h, a) - 1e-4);
        CHECK(value <= parallel(1.0131, h, a) + 1e-4);
      }
    }
  }
}

TEST_CASE("area light: discs in any direction, cut by the horizon, within .1 %; of signals within .8 (r/d)^2") {
  RandomStream random(3, RandomPurpose::test, 0, 0, 0, 0);
  int cut = 0;
  double worst = 0;
  for (int trial = 0; trial < 250; ++trial) {
    random = RandomStream(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(trial), 0);
    const Vec3f u = random_direction(random);
    const float radius = random.uniform(0.05F, 1.0F);
    Emitter e = emitter_of(EmitterShape::disc, u * radius, normalized(cross(u, random_direction(random))) * radius);
    e.centre_m = {1, 2, 3};
    Vec3f away = random_direction(random);
    if (dot(away, e.axis) < 0) away = -away;
    if (dot(away, e.axis) < 0.15F) continue;
    const Vec3f position = e.centre_m + away * (radius * random.uniform(1.3F, trial % 2 == 0 ? 3.0F : 15.0F));
    const Vec3f normal = random_direction(random);
    const double most = disc_by_quadrature(e, position, -away);
    const double exact = disc_by_quadrature(e, position, normal);
    CHECK(std::fabs(got(e, position, normal) - exact) <= 1e-3 * exact + 5e-4 * most);
    cut += exact > 0 && dot(normal, away) > 0 ? 1 : 0;
    e.profile = EmissionProfile::signal;
    const auto distance = static_cast<double>(length(position - e.centre_m) / radius);
    if (distance < 2) continue;
    const Vec3f ahead = e.centre_m + e.axis * length(position - e.centre_m);
    const double off = got(e, position, -away) - disc_by_quadrature(e, position, -away);
    worst = std::max(worst, std::fabs(off) / disc_by_quadrature(e, ahead, -e.axis) * distance * distance);
  }
  CHECK(cut >= 2);
  CHECK(worst < 0.8);
}

TEST_CASE("area light: spheres within .1 %, whole, cut by the horizon and half below it; a point's where whole") {
  const Emitter e = emitter_of(EmitterShape::sphere, {0.4F, 0, 0}, {0, 0.4F, 0});
  for (const double distance : {0.41, 0.5, 0.8, 4.0, 400.0}) {
    for (double c = -1; c <= 1; c += 0.0625) {
      const Vec3f position{0, 0, static_cast<float>(distance)};
      const Vec3f normal{static_cast<float>(std::sqrt(1 - c * c)), 0, static_cast<float>(-c)};
      const double exact = sphere_by_quadrature(distance * c, distance, 0.4);
      CHECK(std::fabs(got(e, position, normal) - exact) <= 1e-3 * exact + 1e-4 / (distance * distance));
      if (c * distance > 0.4)
        CHECK(got(e, position, normal) == doctest::Approx(c / (distance * distance)).epsilon(1e-5));
    }
  }
}

TEST_CASE("area light: tubes within .1 % of the line integral, long before a wall as an endless one") {
  RandomStream random(4, RandomPurpose::test, 0, 0, 0, 0);
  int cut = 0;
  for (int trial = 0; trial < 300; ++trial) {
    random = RandomStream(4, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(trial), 0);
    const Vec3f u = random_direction(random);
    const float half = random.uniform(0.1F, 1.0F);
    Emitter e = emitter_of(EmitterShape::tube, u * half, normalized(cross(u, random_direction(random))) * 0.01F);
    e.centre_m = {1, 2, 3};
    const Vec3f away = random_direction(random);
    const Vec3f position = e.centre_m + away * (half * random.uniform(0.3F, 12.0F));
    if (length(cross(position - e.centre_m, u)) < 0.1F * half) continue;
    const Vec3f normal = random_direction(random);
    const double exact = tube_by_quadrature(e, position, normal);
    const double most = tube_by_quadrature(e, position, -away);
    CHECK(std::fabs(got(e, position, normal) - exact) <= 1e-3 * exact + 3e-4 * most);
    cut += exact > 0 && dot(normal, away) > 0 ? 1 : 0;
  }
  CHECK(cut > 10);
  // pi L R / h before an endless cylinder; per cd of 2 R l L.
  const Emitter e = emitter_of(EmitterShape::tube, {50, 0, 0}, {0, 0.02F, 0});
  CHECK(got(e, {0, 0, 0.5F}, {0, 0, -1}) * 4 * 50 * 0.02 == doctest::Approx(kPi * 0.02 / 0.5).epsilon(1e-3));
}

TEST_CASE("area light: what each shape gives off adds up: 4 pi of a sphere, pi^2 of a tube, pi of disc and patch") {
  const int n = 300;
  for (const EmitterShape shape : {EmitterShape::patch, EmitterShape::disc, EmitterShape::sphere, EmitterShape::tube}) {
    const Emitter e = emitter_of(shape, {0.3F, 0, 0}, {0, 0.3F, 0});
    double flux = 0;
    for (int i = 0; i < n; ++i) {
      const double z = -1 + (i + 0.5) * 2 / n;
      const double s = std::sqrt(1 - z * z);
      for (int j = 0; j < n; ++j) {
        const double a = (j + 0.5) * 2 * kPi / n;
        flux +=
            static_cast<double>(relative_intensity(
                e, {static_cast<float>(s * std::cos(a)), static_cast<float>(s * std::sin(a)), static_cast<float>(z)})) *
            4 * kPi / (static_cast<double>(n) * n);
      }
    }
    const double expected = shape == EmitterShape::sphere ? 4 * kPi : shape == EmitterShape::tube ? kPi * kPi : kPi;
    CHECK(flux == doctest::Approx(expected).epsilon(1e-3));
  }
}

TEST_CASE("area light: at 1 mm, at 1 km, touching and inside, of no size: finite, not negative, within pi L") {
  RandomStream random(6, RandomPurpose::test, 0, 0, 0, 0);
  std::uint32_t trial = 0;
  for (const EmitterShape shape : {EmitterShape::patch, EmitterShape::disc, EmitterShape::sphere, EmitterShape::tube}) {
    for (const EmissionProfile profile :
         {EmissionProfile::lambert, EmissionProfile::signal, EmissionProfile::lantern}) {
      for (const float size : {0.0F, 1e-4F, 0.3F, 20.0F}) {
        Emitter e = emitter_of(shape, {size, 0, 0}, {0, size, 0});
        e.axis = {0, 0, 1};
        e.profile = profile;
        for (const float distance : {0.0F, 1e-7F, 1e-3F, 0.3F, 1000.0F, 1e5F}) {
          for (int i = 0; i < 20; ++i) {
            random = RandomStream(6, RandomPurpose::test, 0, 0, ++trial, 0);
            const Vec3f away = i == 0 ? Vec3f{0, 0, 1} : (i == 1 ? Vec3f{1, 0, 0} : random_direction(random));
            const Vec3f normal = i < 2 ? -away : random_direction(random);
            Vec3f to_light{0, 0, 1};
            const float value = illuminance_per_cd(e, e.centre_m + away * distance, normal, to_light);
            REQUIRE(std::isfinite(value));
            REQUIRE(value >= 0.0F);
            REQUIRE(is_finite(to_light));
            // A surface of constant luminance L gives pi L at most, whatever part of the view it fills.
            const bool constant = profile == EmissionProfile::lambert && size > 0;
            if (constant) REQUIRE(static_cast<double>(value * e.area_m2) <= 1.02 * kPi);
            REQUIRE(is_finite(sample_point(e, e.centre_m + away * distance, random.uniform(), random.uniform())));
          }
        }
      }
    }
  }
}
