// SPDX-License-Identifier: Apache-2.0
// FLIP per pixel, written out: two-dimensional filters as in the paper, in double.
#ifndef NPSIM_TESTS_REFERENCE_FLIP_HPP
#define NPSIM_TESTS_REFERENCE_FLIP_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <vector>

#include "npsim/color/chromaticity.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"

namespace npsim_test {

class ReferenceFlip {
 public:
  ReferenceFlip(npsim::ImageView<const npsim::Rgb8> a, npsim::ImageView<const npsim::Rgb8> b, double ppd)
      : a_(a), b_(b), ppd_(ppd) {}

  [[nodiscard]] double error(int x, int y) const {
    const double colour = colour_error(hyab(seen(a_, x, y), seen(b_, x, y)));
    const double edge = std::fabs(feature(a_, x, y, 1) - feature(b_, x, y, 1));
    const double point = std::fabs(feature(a_, x, y, 2) - feature(b_, x, y, 2));
    return std::pow(colour, 1 - std::sqrt(std::max(edge, point) / std::sqrt(2.0)));
  }

 private:
  using Vec3d = npsim::Vec3d;
  using Picture = npsim::ImageView<const npsim::Rgb8>;
  static constexpr double kPi = 3.14159265358979323846;

  static double decoded(int code) {
    const double v = code / 255.0;
    return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
  }
  // X, Y, Z over those of white.
  static Vec3d relative_xyz(const Vec3d& rgb) {
    const Vec3d xyz = npsim::kLinearSrgbToXyz * rgb;
    return {xyz.x / npsim::kWhiteD65Xyz.x, xyz.y / npsim::kWhiteD65Xyz.y, xyz.z / npsim::kWhiteD65Xyz.z};
  }
  static Vec3d opponent(const npsim::Rgb8& c) {
    const Vec3d t = relative_xyz({decoded(c.r), decoded(c.g), decoded(c.b)});
    return {116 * t.y - 16, 500 * (t.x - t.y), 200 * (t.y - t.z)};
  }
  static Vec3d hunt(const Vec3d& rgb) {
    const auto f = [](double t) { return t > 216.0 / 24389 ? std::cbrt(t) : (24389.0 / 27 * t + 16) / 116; };
    const Vec3d t = relative_xyz(rgb);
    const double light = 116 * f(t.y) - 16;
    return {light, 0.01 * light * 500 * (f(t.x) - f(t.y)), 0.01 * light * 200 * (f(t.y) - f(t.z))};
  }
  static double hyab(const Vec3d& a, const Vec3d& b) {
    return std::fabs(a.x - b.x) + std::hypot(a.y - b.y, a.z - b.z);
  }
  static double colour_error(double distance) {
    const double most = std::pow(hyab(hunt({0, 1, 0}), hunt({0, 0, 1})), 0.7);
    const double d = std::pow(distance, 0.7);
    return d < 0.4 * most ? d * 0.95 / (0.4 * most) : 0.95 + (d - 0.4 * most) / (0.6 * most) * 0.05;
  }
  static npsim::Rgb8 at(Picture p, int x, int y) {
    return p(std::clamp(x, 0, p.width() - 1), std::clamp(y, 0, p.height() - 1));
  }

  [[nodiscard]] Vec3d seen(Picture p, int x, int y) const {
    const int radius = static_cast<int>(std::ceil(3 * std::sqrt(0.04 / (2 * kPi * kPi)) * ppd_));
    const auto sensitivity = [&](double a, double b, double r2) {
      return a * std::sqrt(kPi / b) * std::exp(-kPi * kPi * r2 / b);
    };
    Vec3d sum;
    Vec3d weights;
    for (int dy = -radius; dy <= radius; ++dy) {
      for (int dx = -radius; dx <= radius; ++dx) {
        const double r2 = (dx * dx + dy * dy) / (ppd_ * ppd_);
        const Vec3d w{sensitivity(1, 0.0047, r2), sensitivity(1, 0.0053, r2),
                      sensitivity(34.1, 0.04, r2) + sensitivity(13.5, 0.025, r2)};
        sum += w * opponent(at(p, x + dx, y + dy));
        weights += w;
      }
    }
    const double light = (sum.x / weights.x + 16) / 116;
    const Vec3d xyz{(light + sum.y / weights.y / 500) * npsim::kWhiteD65Xyz.x, light,
                    (light - sum.z / weights.z / 200) * npsim::kWhiteD65Xyz.z};
    const Vec3d rgb = npsim::xyz_to_linear_srgb(xyz);
    return hunt({std::clamp(rgb.x, 0.0, 1.0), std::clamp(rgb.y, 0.0, 1.0), std::clamp(rgb.z, 0.0, 1.0)});
  }

  // Strength of edges (order 1) or points (order 2).
  [[nodiscard]] double feature(Picture p, int x, int y, int order) const {
    const double sigma = 0.5 * 0.082 * ppd_;
    const int radius = static_cast<int>(std::ceil(3 * sigma));
    const auto along = [&](bool vertical) {
      double positive = 0, negative = 0, sum_positive = 0, sum_negative = 0;
      for (int dy = -radius; dy <= radius; ++dy) {
        for (int dx = -radius; dx <= radius; ++dx) {
          const double g = std::exp(-(dx * dx + dy * dy) / (2 * sigma * sigma));
          const int d = vertical ? dy : dx;
          const double w = order == 1 ? -d * g : (d * d / (sigma * sigma) - 1) * g;
          const double light = (opponent(at(p, x + dx, y + dy)).x + 16) / 116;
          (w > 0 ? positive : negative) += std::fabs(w);
          (w > 0 ? sum_positive : sum_negative) += std::fabs(w) * light;
        }
      }
      return sum_positive / positive - sum_negative / negative;
    };
    return std::hypot(along(false), along(true));
  }

  Picture a_, b_;
  double ppd_;
};

}  // namespace npsim_test

#endif  // NPSIM_TESTS_REFERENCE_FLIP_HPP
