// SPDX-License-Identifier: Apache-2.0
// The reflection of material/bsdf.hpp in double precision, and directions in proportion to it.
//
//   f(wi, wo) = (1 - E(n.wi)) (1 - E(n.wo)) / (1 - mean E) albedo / pi + D(h) V(wi, wo) F(wi.h)
// with GGX's D, height-correlated Smith masking V, Schlick's F, and the same table of E, which is part of the model.
// Directions: with probability p one of the visible microfacets' mirrors (Heitz, JCGT 2018), else one about the normal
// with density cosine / pi; the weight f cos / density is bounded by 1 / min(p, 1 - p) times the albedo of its part.
#ifndef NPSIM_TESTS_REFERENCE_ROUGH_DIELECTRIC_HPP
#define NPSIM_TESTS_REFERENCE_ROUGH_DIELECTRIC_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "npsim/core/vec.hpp"
#include "npsim/material/bsdf.hpp"
#include "npsim/material/detail/specular_albedo.hpp"

namespace npsim::reference {

inline constexpr double kPi = 3.14159265358979323846;

[[nodiscard]] constexpr double luminance_of(const Vec3d& rgb) {
  return 0.2126 * rgb.x + 0.7152 * rgb.y + 0.0722 * rgb.z;
}

// Two unit vectors that complete n to a frame (Duff et al., JCGT 2017).
inline void complete_frame(const Vec3d& n, Vec3d& t, Vec3d& b) {
  const double sign = std::copysign(1.0, n.z);
  const double a = -1 / (sign + n.z);
  const double c = n.x * n.y * a;
  t = {1 + sign * n.x * n.x * a, sign * c, -sign * n.x};
  b = {c, sign + n.y * n.y * a, -n.y};
}

// About n with density cosine / pi.
[[nodiscard]] inline Vec3d cosine_direction(const Vec3d& n, double u, double v) {
  const double r = std::sqrt(u);
  const double angle = 2 * kPi * v;
  Vec3d t, b;
  complete_frame(n, t, b);
  return normalized(t * (r * std::cos(angle)) + b * (r * std::sin(angle)) + n * std::sqrt(1 - u));
}

class RoughDielectric {
 public:
  // Without the interface: albedo / pi, for which there are closed forms.
  [[nodiscard]] static RoughDielectric matt(const Vec3d& albedo) {
    RoughDielectric m(albedo, 1, 0);
    m.matt_ = true;
    return m;
  }

  RoughDielectric(const Vec3d& albedo, double alpha, double f0) : albedo_(albedo), f0_(f0) {
    alpha_ = std::clamp(alpha, static_cast<double>(kMinAlpha), 1.0);
    constexpr auto first = static_cast<double>(kSpecularFirstRoot);
    constexpr auto last = static_cast<double>(kSpecularAlphas - 1);
    const double at = std::clamp((std::sqrt(alpha_) - first) * last / (1 - first), 0.0, last);
    row_ = std::min(static_cast<std::size_t>(at), kSpecularAlphas - 2);
    share_ = at - static_cast<double>(row_);
    through_mean_ = std::max(1 - combined(kSpecularScaleMean[row_], kSpecularScaleMean[row_ + 1],
                                          kSpecularBiasMean[row_], kSpecularBiasMean[row_ + 1]),
                             1e-3);
  }

  // 1/sr, without the cosine; unit vectors away from the surface.
  [[nodiscard]] Vec3d eval(const Vec3d& n, const Vec3d& wo, const Vec3d& wi) const {
    const double no = dot(n, wo);
    const double ni = dot(n, wi);
    if (!(no > 0 && ni > 0)) return {};
    if (matt_) return albedo_ / kPi;
    const double through = std::max((1 - reflected(no)) * (1 - reflected(ni)) / through_mean_, 0.0);
    const Vec3d sum = wo + wi;
    const Vec3d h = dot(sum, sum) > 1e-20 ? normalized(sum) : n;
    const double a2 = alpha_ * alpha_;
    const double masking = no * std::sqrt(a2 + (1 - a2) * ni * ni) + ni * std::sqrt(a2 + (1 - a2) * no * no);
    const double t = 1 - std::clamp(dot(wi, h), 0.0, 1.0);
    const double fresnel = f0_ + (1 - f0_) * t * t * t * t * t;
    const double specular = facets(n, h) * 0.5 / std::max(masking, 1e-7) * fresnel;
    return albedo_ * (through / kPi) + Vec3d{specular, specular, specular};
  }

  // A direction and f cos / density; false where it leads below the surface. `which`, u, v in [0, 1).
  [[nodiscard]] bool sample(const Vec3d& n, const Vec3d& wo, double which, double u, double v, Vec3d& wi,
                            Vec3d& weight) const {
    const double no = dot(n, wo);
    if (!(no > 0)) return false;
    if (matt_) {
      wi = cosine_direction(n, u, v);
      weight = albedo_;
      return dot(n, wi) > 0;
    }
    const double mirrored = reflected(no);
    const double scattered = (1 - mirrored) * luminance_of(albedo_);
    const double p = scattered > 0 ? std::clamp(mirrored / (mirrored + scattered), 0.05, 0.95) : 1.0;
    if (which < p) {
      const Vec3d h = visible_facet(n, wo, u, v);
      wi = normalized(h * (2 * dot(wo, h)) - wo);
    } else {
      wi = cosine_direction(n, u, v);
    }
    const double ni = dot(n, wi);
    if (!(ni > 0)) return false;
    const double a2 = alpha_ * alpha_;
    const double visible = 2 * no / (no + std::sqrt(a2 + (1 - a2) * no * no));
    const double density = p * visible * facets(n, normalized(wo + wi)) / (4 * no) + (1 - p) * ni / kPi;
    weight = eval(n, wo, wi) * (ni / density);
    return true;
  }

 private:
  // GGX's density of facets, as |n x h|^2 so that nothing cancels in a narrow lobe.
  [[nodiscard]] double facets(const Vec3d& n, const Vec3d& h) const {
    const double a2 = alpha_ * alpha_;
    const Vec3d off = cross(n, h);
    const double nh = dot(n, h);
    const double d = dot(off, off) + a2 * nh * nh;
    return a2 / (kPi * d * d);
  }

  [[nodiscard]] Vec3d visible_facet(const Vec3d& n, const Vec3d& wo, double u, double v) const {
    Vec3d t, b;
    complete_frame(n, t, b);
    const Vec3d stretched = normalized(Vec3d{alpha_ * dot(t, wo), alpha_ * dot(b, wo), dot(n, wo)});
    const double flat = stretched.x * stretched.x + stretched.y * stretched.y;
    const Vec3d t1 = flat > 0 ? Vec3d{-stretched.y, stretched.x, 0} / std::sqrt(flat) : Vec3d{1, 0, 0};
    const Vec3d t2 = cross(stretched, t1);
    const double r = std::sqrt(u);
    const double angle = 2 * kPi * v;
    const double p1 = r * std::cos(angle);
    const double s = 0.5 * (1 + stretched.z);
    const double p2 = (1 - s) * std::sqrt(std::max(1 - p1 * p1, 0.0)) + s * r * std::sin(angle);
    const Vec3d h = t1 * p1 + t2 * p2 + stretched * std::sqrt(std::max(1 - p1 * p1 - p2 * p2, 0.0));
    return normalized(t * (alpha_ * h.x) + b * (alpha_ * h.y) + n * std::max(h.z, 0.0));
  }

  // E of a cosine: the share of light that the interface itself reflects.
  [[nodiscard]] double reflected(double cosine) const {
    const double at = static_cast<double>(kSpecularCosines - 1) * std::sqrt(std::clamp(cosine, 0.0, 1.0));
    const std::size_t column = std::min(static_cast<std::size_t>(at), kSpecularCosines - 2);
    const double u = at - static_cast<double>(column);
    const auto of = [&](const SpecularTable& table, std::size_t row) {
      const auto low = static_cast<double>(table[row][column]);
      return low + (static_cast<double>(table[row][column + 1]) - low) * u;
    };
    return combined(of(kSpecularScale, row_), of(kSpecularScale, row_ + 1), of(kSpecularBias, row_),
                    of(kSpecularBias, row_ + 1));
  }
  [[nodiscard]] double combined(double scale0, double scale1, double bias0, double bias1) const {
    return f0_ * (scale0 + (scale1 - scale0) * share_) + bias0 + (bias1 - bias0) * share_;
  }

  Vec3d albedo_;
  double alpha_;
  double f0_;
  double share_;
  double through_mean_;
  std::size_t row_;
  bool matt_ = false;
};

}  // namespace npsim::reference

#endif  // NPSIM_TESTS_REFERENCE_ROUGH_DIELECTRIC_HPP
