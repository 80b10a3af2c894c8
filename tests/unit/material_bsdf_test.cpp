// SPDX-License-Identifier: Apache-2.0
// Reflection: reciprocity, energy by quadrature, grazing angles, the Lambert limit, and the cosine sampler.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "npsim/core/random.hpp"
#include "npsim/material/bsdf.hpp"

namespace {

using namespace npsim;

constexpr double kPi = 3.14159265358979323846;
constexpr Vec3f kWhite{1, 1, 1};

Vec3f polar(double cosine, double phi) {
  const double s = std::sqrt(std::max(0.0, 1 - cosine * cosine));
  return {static_cast<float>(s * std::cos(phi)), static_cast<float>(s * std::sin(phi)), static_cast<float>(cosine)};
}

// The specular part in double, in the form with Smith's Lambda.
double reference(double alpha, double f0, const Vec3d& n, const Vec3d& wo, const Vec3d& wi) {
  const auto fresnel = [&](double c) { return f0 + (1 - f0) * std::pow(1 - c, 5); };
  const double no = dot(n, wo), ni = dot(n, wi);
  const Vec3d h = normalized(wo + wi);
  const double nh = dot(n, h), a2 = alpha * alpha;
  const double d = a2 / (kPi * std::pow(nh * nh * (a2 - 1) + 1, 2));
  const auto lambda = [&](double c) { return 0.5 * (std::sqrt(1 + a2 * (1 - c * c) / (c * c)) - 1); };
  const double g = 1 / (1 + lambda(no) + lambda(ni));
  return d * g * fresnel(dot(wi, h)) / (4 * no * ni);
}

// Share of the light from wo that leaves, by quadrature that is even in the angle of the microfacet normal, so that
// narrow lobes are resolved too: integral of f cos over wi = integral over h of f (n.wi) 4 (wo.h).
double directional_albedo(const Vec3f& albedo, float alpha, float f0, double cosine_o) {
  const Vec3f n{0, 0, 1};
  const Vec3f wo = polar(cosine_o, 0.3);
  double specular = 0;
  double diffuse = 0;
  const int rings = 600;
  const int sectors = 180;
  for (int i = 0; i < rings; ++i) {
    // tan(theta_h) = alpha sqrt(u / (1 - u)): GGX importance sampling with u on midpoints.
    const double u = (i + 0.5) / rings;
    const double a = static_cast<double>(alpha);
    const double cosine_h = 1 / std::sqrt(1 + a * a * u / (1 - u));
    for (int j = 0; j < sectors; ++j) {
      const double phi = (j + 0.5) * 2 * kPi / sectors;
      // Cosine-distributed for the diffuse part.
      const Vec3f wd = polar(std::sqrt(u), phi);
      diffuse +=
          static_cast<double>(eval_bsdf(albedo, alpha, f0, n, wo, wd).x - eval_bsdf({}, alpha, f0, n, wo, wd).x) * kPi /
          (rings * sectors);
      const Vec3f h = polar(cosine_h, phi);
      const float oh = dot(wo, h);
      if (oh <= 0) continue;
      const Vec3f wi = h * (2 * oh) - wo;
      if (wi.z <= 0) continue;
      const double f = static_cast<double>(eval_bsdf({}, alpha, f0, n, wo, wi).x);
      const double a2 = a * a;
      const double t = cosine_h * cosine_h * (a2 - 1) + 1;
      const double density_h = a2 / (kPi * t * t) * cosine_h;
      specular += f * static_cast<double>(wi.z) * 4 * static_cast<double>(oh) / density_h / (rings * sectors);
    }
  }
  return specular + diffuse;
}

}  // namespace

TEST_CASE("bsdf is reciprocal, and its specular part agrees with the formula in double") {
  for (std::uint32_t i = 0; i < 4000; ++i) {
    RandomStream r(1, RandomPurpose::test, 0, 0, i, 0);
    const Vec3f n = normalized(Vec3f{r.uniform(-1, 1), r.uniform(-1, 1), r.uniform(-1, 1) + 0.01F});
    Vec3f wo = normalized(Vec3f{r.uniform(-1, 1), r.uniform(-1, 1), r.uniform(-1, 1) + 0.01F});
    Vec3f wi = normalized(Vec3f{r.uniform(-1, 1), r.uniform(-1, 1), r.uniform(-1, 1) + 0.01F});
    if (dot(n, wo) < 0) wo = -wo;
    if (dot(n, wi) < 0) wi = -wi;
    if (dot(n, wo) < 0.02F || dot(n, wi) < 0.02F) continue;
    const float alpha = r.uniform(0.05F, 1);
    const float f0 = r.uniform(0, 0.2F);
    const float value = eval_bsdf({0.5F, 0.5F, 0.5F}, alpha, f0, n, wo, wi).x;
    const float swapped = eval_bsdf({0.5F, 0.5F, 0.5F}, alpha, f0, n, wi, wo).x;
    CHECK(static_cast<double>(value) == doctest::Approx(static_cast<double>(swapped)).epsilon(1e-5));
    const float specular = eval_bsdf({}, alpha, f0, n, wo, wi).x;
    const double exact = reference(static_cast<double>(alpha), static_cast<double>(f0), normalized(vec_cast<double>(n)),
                                   normalized(vec_cast<double>(wo)), normalized(vec_cast<double>(wi)));
    CHECK(static_cast<double>(specular) == doctest::Approx(exact).epsilon(2e-4));
    CHECK(value >= specular);
  }
}

TEST_CASE("white furnace: a white dielectric reflects what it receives, at any angle and roughness") {
  for (const float alpha : {0.02F, 0.03F, 0.039F, 0.05F, 0.1F, 0.15F, 0.2F, 0.3F, 0.45F, 0.6F, 0.75F, 0.85F, 1.0F}) {
    for (const float f0 : {0.0F, 0.02F, 0.04F, 0.1F}) {
      for (const double c : {0.03, 0.04, 0.05, 0.08, 0.1, 0.14, 0.2, 0.35, 0.5, 0.65, 0.8, 1.0}) {
        const double share = directional_albedo(kWhite, alpha, f0, c);
        INFO("alpha " << alpha << " f0 " << f0 << " cosine " << c << " share " << share);
        CHECK(share <= 1.005);
        CHECK(share >= 0.995);
      }
    }
  }
}

TEST_CASE("the tables of the directional albedo agree with a new integration; a metal never reflects more than 1") {
  for (const float alpha : {0.02F, 0.07F, 0.15F, 0.4F, 0.75F, 1.0F}) {
    for (const float f0 : {0.0F, 0.04F, 0.1F, 1.0F}) {
      const SpecularAlbedo table(alpha, f0);
      for (const double c : {0.03, 0.1, 0.3, 0.7, 1.0}) {
        const double share = directional_albedo({}, alpha, f0, c);
        INFO("alpha " << alpha << " f0 " << f0 << " cosine " << c);
        CHECK(share <= 1.0 + 2e-3);
        CHECK(std::fabs(static_cast<double>(table(static_cast<float>(c))) - share) < (f0 < 1.0F ? 0.005 : 0.01));
      }
    }
  }
}

TEST_CASE("a dry road seen at three degrees is not darker than from above") {
  const Vec3f n{0, -1, 0};
  const Vec3f light = normalized(Vec3f{0.3F, -1, 0.2F});
  const Vec3f albedo{0.1F, 0.1F, 0.1F};
  const float above = eval_bsdf(albedo, 0.85F, 0.04F, n, n, light).x;
  const float grazing = eval_bsdf(albedo, 0.85F, 0.04F, n, normalized(Vec3f{0, -0.05F, -1}), light).x;
  CHECK(grazing > 0.85F * above);
}

TEST_CASE("without interface (f0 = 0, facing) it is nearly Lambert; a mirror-like lobe peaks at the mirror direction") {
  const Vec3f n{0, 0, -1};
  const Vec3f v = eval_bsdf({0.3F, 0.2F, 0.1F}, 1.0F, 0.0F, n, n, n);
  CHECK(v.x == doctest::Approx(0.3 / kPi).epsilon(5e-3));
  CHECK(v.z == doctest::Approx(0.1 / kPi).epsilon(5e-3));
  const Vec3f wo = normalized(Vec3f{0.6F, 0, -0.8F});
  const Vec3f mirror = normalized(Vec3f{-0.6F, 0, -0.8F});
  const Vec3f aside = normalized(Vec3f{-0.5F, 0, -0.85F});
  CHECK(eval_bsdf({}, 0.05F, 0.04F, n, wo, mirror).x > 5 * eval_bsdf({}, 0.05F, 0.04F, n, wo, aside).x);
}

TEST_CASE("leaves lit and seen at grazing angles keep their colour: without a skin over them nothing shines") {
  const Vec3f n{0, 0, 1};
  const Vec3f wo = normalized(Vec3f{1, 0, 0.1F});
  const Vec3f wi = normalized(Vec3f{-1, 0, 0.1F});
  const Vec3f leaves{0.03F, 0.06F, 0.01F};
  const Vec3f skin = eval_bsdf(leaves, 1.0F, 0.04F, n, wo, wi);
  REQUIRE(skin.x > 10.0F * leaves.x / static_cast<float>(kPi));  // what an interface would add, however rough
  const Vec3f matt = eval_bsdf(leaves, kMatt, 0.04F, n, wo, wi);
  CHECK(static_cast<double>(matt.x) == doctest::Approx(0.03 / kPi).epsilon(1e-6));
  CHECK(static_cast<double>(matt.y) == doctest::Approx(0.06 / kPi).epsilon(1e-6));
  CHECK(static_cast<double>(matt.z) == doctest::Approx(0.01 / kPi).epsilon(1e-6));
}

TEST_CASE("bsdf is finite and not negative at grazing, below the horizon and for NaN") {
  const Vec3f n{0, 0, 1};
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float angles[] = {0.0F, 1e-30F, 1e-8F, 1e-6F, 1e-4F, 1e-2F, 1.0F};
  for (const float a : angles) {
    for (const float b : angles) {
      for (const float alpha : {-1.0F, 0.0F, 0.02F, 0.5F, 1.0F, 7.0F, nan}) {
        for (const float side : {1.0F, -1.0F}) {
          const Vec3f wo = normalized(Vec3f{1, 0, a * 100});
          const Vec3f wi = normalized(Vec3f{side, 0, b * 100});
          const Vec3f f = eval_bsdf({0.5F, 0.5F, 0.5F}, alpha, 0.04F, n, wo, wi);
          CHECK_UNARY(is_finite(f) && f.x >= 0.0F);
        }
      }
    }
  }
  CHECK(eval_bsdf(kWhite, 0.5F, 0.04F, n, {0, 0, -1}, n) == Vec3f{});
  CHECK(eval_bsdf(kWhite, 0.5F, 0.04F, n, n, {0, 0, -1}) == Vec3f{});
  CHECK(eval_bsdf(kWhite, 0.5F, 0.04F, {nan, nan, nan}, n, n) == Vec3f{});
}

TEST_CASE(
    "sample_cosine: unit directions on the right side, density cosine / pi (chi-square over cells of equal mass)") {
  for (const Vec3f n : {Vec3f{0, 0, 1}, Vec3f{0, 0, -1}, normalized(Vec3f{0.3F, -0.9F, -1e-7F})}) {
    Vec3f t, b;
    tangent_frame(n, t, b);
    CHECK(std::fabs(dot(t, n)) < 1e-6F);
    CHECK(std::fabs(dot(t, b)) < 1e-6F);
    CHECK(length(cross(t, b) - n) < 1e-5F);
    const int side = 8;
    int cells[8][8] = {};
    const int samples = 64000;
    Vec3d mean;
    for (int i = 0; i < samples; ++i) {
      RandomStream r(2, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(i), 0);
      const float u = r.uniform();
      const Vec3f s = sample_cosine(n, u, r.uniform());
      const float c = dot(n, s);
      CHECK_UNARY(std::fabs(length(s) - 1.0F) < 1e-5F && c >= -1e-6F);
      const double phi = std::atan2(static_cast<double>(dot(s, b)), static_cast<double>(dot(s, t)));
      const double radius2 = 1 - static_cast<double>(c) * static_cast<double>(c);  // uniform on [0, 1]
      const int i0 = std::min(side - 1, static_cast<int>(radius2 * side));
      const int i1 = std::min(side - 1, static_cast<int>((phi / (2 * kPi) + 0.5) * side));
      ++cells[i0][i1];
      mean += vec_cast<double>(s);
    }
    double chi2 = 0;
    const double expected = samples / 64.0;
    for (const auto& row : cells) {
      for (const int n_cell : row) chi2 += (n_cell - expected) * (n_cell - expected) / expected;
    }
    CHECK(chi2 < 103.4);  // 63 degrees of freedom, 0.1 %
    CHECK(length(mean / static_cast<double>(samples) - vec_cast<double>(n) * (2.0 / 3.0)) < 0.01);
  }
  CHECK(sample_cosine({0, 0, 1}, 0.5F, 0.5F) == Vec3f{0, 0, 1});
}
