// SPDX-License-Identifier: Apache-2.0
// Planes in inverse depth, and what has to be kept of samples to fit one to them and to any union of such sets.
//
// On the plane n . p = h the inverse depth of the ray (x, y, 1) is w = q . (x, y, 1), q = n / h. An upright plane, one
// that stands on the ground, has q . up = 0: two unknowns instead of three.
// The sums are of rows divided by the noise of their sample, so costs are in squares of that noise.
#ifndef NPSIM_DEPTH_DETAIL_PLANES_MOMENTS_HPP
#define NPSIM_DEPTH_DETAIL_PLANES_MOMENTS_HPP

#include <cmath>

#include "npsim/core/config.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace planes_detail {

// Two directions across `up`, which span the q of all upright planes.
struct UprightBasis {
  Vec3d right, ahead;

  [[nodiscard]] static UprightBasis across(const Vec3f& up) noexcept {
    const Vec3d u = normalized(vec_cast<double>(up));
    const Vec3d right = normalized(cross(std::fabs(u.z) < 0.9 ? Vec3d{0, 0, 1} : Vec3d{0, 1, 0}, u));
    return {right, cross(u, right)};
  }
  [[nodiscard]] double angle(const Vec3d& q) const noexcept { return std::atan2(dot(ahead, q), dot(right, q)); }
  [[nodiscard]] Vec3d at(double angle_rad) const noexcept {
    return right * std::cos(angle_rad) + ahead * std::sin(angle_rad);
  }
};

struct PlaneFit {
  Vec3d q;
  double cost = 0.0;  // weighted sum of squared residuals
  bool found = false;
};

struct PlaneMoments {
  Vec3d row_x, row_y, row_z;  // of the symmetric sum of ray ray^T
  Vec3d right;                // sum of w ray
  double square = 0.0;        // sum of w^2
  double weight = 0.0;

  // precision: the sample's weight over its variance.
  void add(double x, double y, double w, double precision, double share) noexcept {
    const Vec3d ray{x, y, 1.0};
    const Vec3d scaled = ray * precision;
    row_x += scaled * x;
    row_y += scaled * y;
    row_z += scaled;
    right += scaled * w;
    square += precision * w * w;
    weight += share;
  }

  PlaneMoments& operator+=(const PlaneMoments& other) noexcept {
    row_x += other.row_x;
    row_y += other.row_y;
    row_z += other.row_z;
    right += other.right;
    square += other.square;
    weight += other.weight;
    return *this;
  }

  [[nodiscard]] Vec3d times(const Vec3d& q) const noexcept { return {dot(row_x, q), dot(row_y, q), dot(row_z, q)}; }

  [[nodiscard]] double cost(const Vec3d& q) const noexcept {
    const double c = dot(q, times(q)) - 2.0 * dot(q, right) + square;
    return c > 0.0 ? c : 0.0;  // rounding of exact samples
  }

  [[nodiscard]] PlaneFit free_plane() const noexcept {
    PlaneFit fit;
    const Vec3d c12 = cross(row_y, row_z);
    const double det = dot(row_x, c12);
    const double scale = length(row_x) * length(row_y) * length(row_z);
    if (!(std::fabs(det) > 1e-14 * scale)) return fit;
    fit.q = (c12 * right.x + cross(row_z, row_x) * right.y + cross(row_x, row_y) * right.z) / det;
    fit.cost = cost(fit.q);
    fit.found = is_finite(fit.q);
    return fit;
  }

  // Variance of the angle about the vertical at which an upright plane stands, rad^2, for independent samples.
  [[nodiscard]] double turn_variance(const UprightBasis& basis, const Vec3d& q) const noexcept {
    const Vec3d m_right = times(basis.right);
    const Vec3d m_ahead = times(basis.ahead);
    const double a = dot(basis.right, m_right);
    const double b = dot(basis.right, m_ahead);
    const double c = dot(basis.ahead, m_ahead);
    const double det = a * c - b * b;
    const double qr = dot(basis.right, q);
    const double qa = dot(basis.ahead, q);
    const double length2 = qr * qr + qa * qa;
    if (!(det > 1e-12 * a * c) || !(length2 > 0.0)) return 1e6;
    // Across (qr, qa): (-qa, qr) over the length, through the inverse of the sums.
    return (qa * qa * c + 2.0 * qa * qr * b + qr * qr * a) / (det * length2 * length2);
  }

  // Of all planes with this normal.
  [[nodiscard]] PlaneFit facing_plane(const Vec3d& normal) const noexcept {
    PlaneFit fit;
    const double share = dot(normal, times(normal));
    if (!(share > 0.0)) return fit;
    fit.q = normal * (dot(normal, right) / share);
    fit.cost = cost(fit.q);
    fit.found = is_finite(fit.q) && dot(normal, right) != 0.0;
    return fit;
  }

  [[nodiscard]] PlaneFit upright_plane(const UprightBasis& basis) const noexcept {
    PlaneFit fit;
    const Vec3d m_right = times(basis.right);
    const Vec3d m_ahead = times(basis.ahead);
    const double a = dot(basis.right, m_right);
    const double b = dot(basis.right, m_ahead);
    const double c = dot(basis.ahead, m_ahead);
    const double det = a * c - b * b;
    if (!(det > 1e-12 * a * c)) return fit;
    const double s = dot(basis.right, right);
    const double t = dot(basis.ahead, right);
    fit.q = basis.right * ((c * s - b * t) / det) + basis.ahead * ((a * t - b * s) / det);
    fit.cost = cost(fit.q);
    fit.found = is_finite(fit.q);
    return fit;
  }
};

}  // namespace planes_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_PLANES_MOMENTS_HPP
