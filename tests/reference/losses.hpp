// SPDX-License-Identifier: Apache-2.0
// The losses of depth/losses.hpp and their gradient in double, for tests: pixel by pixel from three-dimensional
// points and cross products, which the kernel does not use, and derivatives by dual numbers, so that none is derived by
// hand.
#ifndef NPSIM_TESTS_REFERENCE_LOSSES_HPP
#define NPSIM_TESTS_REFERENCE_LOSSES_HPP

#include <cmath>
#include <cstddef>
#include <vector>

#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/depth/losses.hpp"

namespace npsim {
namespace reference {

// A value and its derivatives by the depth of the pixel, of its right and of its lower neighbour.
struct Dual {
  double value = 0;
  double by[3] = {};

  Dual() = default;
  Dual(double v) : value(v) {}  // NOLINT(google-explicit-constructor)
  static Dual variable(double v, std::size_t index) {
    Dual x(v);
    x.by[index] = 1;
    return x;
  }
  friend Dual combine(double result, const Dual& a, double by_a, const Dual& b, double by_b) {
    Dual r(result);
    for (int i = 0; i < 3; ++i) r.by[i] = by_a * a.by[i] + by_b * b.by[i];
    return r;
  }
  friend Dual operator+(const Dual& a, const Dual& b) { return combine(a.value + b.value, a, 1, b, 1); }
  friend Dual operator-(const Dual& a, const Dual& b) { return combine(a.value - b.value, a, 1, b, -1); }
  friend Dual operator*(const Dual& a, const Dual& b) { return combine(a.value * b.value, a, b.value, b, a.value); }
  friend Dual operator/(const Dual& a, const Dual& b) {
    return combine(a.value / b.value, a, 1 / b.value, b, -a.value / (b.value * b.value));
  }
  friend Dual sqrt(const Dual& a) {
    const double root = std::sqrt(a.value);
    return combine(root, a, 0.5 / root, a, 0);
  }
};

using DualVec = Vec3<Dual>;
inline DualVec unit(const DualVec& v) {
  const Dual length = sqrt(dot(v, v));
  return {v.x / length, v.y / length, v.z / length};
}

struct Losses {
  LossValues values;
  std::vector<double> gradient;  // row by row
};

template <class T>
Losses losses(const LossParams& p, const LossInput<T>& in, ImageView<const T> depth) {
  const Shape shape = depth.shape();
  const auto number = [](auto v) { return static_cast<double>(v); };
  const double fx = number(in.intrinsics.fx);
  const double fy = number(in.intrinsics.fy);
  const auto ray = [&](int x, int y) {
    return DualVec{(x + 0.5 - number(in.intrinsics.cx)) / fx, (y + 0.5 - number(in.intrinsics.cy)) / fy, 1.0};
  };
  const auto usable = [&](int x, int y) {
    return x < shape.width && y < shape.height && in.depth_est(x, y) >= T(1e-3) && in.depth_est(x, y) <= T(1e5);
  };
  const auto normal_of = [&](int x, int y) { return vec_cast<double>(in.normals(x, y)); };
  const auto has_normal = [&](int x, int y) {
    return usable(x, y) && usable(x + 1, y) && usable(x, y + 1) && is_finite(normal_of(x, y)) &&
           length(normal_of(x, y)) > 1e-6;
  };

  Losses r;
  r.gradient.assign(shape.pixels(), 0.0);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      r.values.depth_count += usable(x, y) ? std::size_t{1} : std::size_t{0};
      r.values.normal_count += has_normal(x, y) ? std::size_t{1} : std::size_t{0};
    }
  }
  const auto add = [&](int x, int y, double amount) {
    r.gradient[static_cast<std::size_t>(y) * static_cast<std::size_t>(shape.width) + static_cast<std::size_t>(x)] +=
        amount;
  };
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (!usable(x, y)) continue;
      LossWeights w;
      if (!in.labels.empty() && in.labels(x, y) < in.label_weights.size()) w = in.label_weights[in.labels(x, y)];
      const double estimate = number(in.depth_est(x, y));
      const double depth_unit = p.depth_term == DepthTerm::metric ? number(p.depth_unit_m) : estimate;
      const double offset = (number(depth(x, y)) - estimate) / depth_unit;
      const double depth_factor = number(w.depth) / number(r.values.depth_count);
      r.values.depth += depth_factor * offset * offset;
      add(x, y, number(p.lambda.depth) * depth_factor * 2 * offset / depth_unit);
      if (!has_normal(x, y)) continue;

      const Vec3d n = normalized(normal_of(x, y));
      const DualVec given{n.x, n.y, n.z};
      const Dual z = Dual::variable(number(depth(x, y)), 0);
      const Dual right = Dual::variable(number(depth(x + 1, y)), 1);
      const Dual below = Dual::variable(number(depth(x, y + 1)), 2);
      DualVec tx, ty;
      if (p.tangents == TangentForm::thesis) {
        tx = {1.0, 0.0, (right - z) * fx / z};
        ty = {0.0, 1.0, (below - z) * fy / z};
      } else {
        tx = (ray(x + 1, y) * right - ray(x, y) * z) * (fx / right);
        ty = (ray(x, y + 1) * below - ray(x, y) * z) * (fy / below);
      }
      const DualVec error = unit(cross(ty, tx)) - given;  // ty x tx looks towards the camera
      if (p.continuity == ContinuityForm::unit_tangents) {
        tx = unit(tx);
        ty = unit(ty);
      }
      const bool sure = in.uncertain.empty() || in.uncertain(x, y) == 0;
      const double count = number(r.values.normal_count);
      const double normal_factor = (sure || p.normal_in_uncertain ? number(w.normal) : 0) / count;
      const double continuity_factor = (sure ? number(w.continuity) : 0) / count;
      const Dual normal = dot(error, error) * normal_factor;
      const Dual continuity = (dot(tx, given) * dot(tx, given) + dot(ty, given) * dot(ty, given)) * continuity_factor;
      r.values.normal += normal.value;
      r.values.continuity += continuity.value;
      const Dual sum = normal * number(p.lambda.normal) + continuity * number(p.lambda.continuity);
      add(x, y, sum.by[0]);
      add(x + 1, y, sum.by[1]);
      add(x, y + 1, sum.by[2]);
    }
  }
  r.values.total = number(p.lambda.normal) * r.values.normal + number(p.lambda.continuity) * r.values.continuity +
                   number(p.lambda.depth) * r.values.depth;
  return r;
}

}  // namespace reference
}  // namespace npsim

#endif  // NPSIM_TESTS_REFERENCE_LOSSES_HPP
