// SPDX-License-Identifier: Apache-2.0
// Normals from depth, both forms of the tangents, beside a plain loop in double.
//
// Errors: the angle to a normal computed in double (the plain loop before it is rounded to float).
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "cases.hpp"
#include "npsim/depth/normals.hpp"
#include "scene.hpp"

namespace npsim::bench {
namespace {

// The normal of one pixel, plainly: forward difference, else backward, else none.
[[nodiscard]] Vec3d plain_normal(ImageView<const float> depth, const Intrinsics& k, TangentForm form, int x, int y) {
  const auto valid = [&](int i, int j) { return depth.contains(i, j) && is_valid_depth(depth(i, j)); };
  if (!valid(x, y)) return {};
  const auto z_at = [&](int i, int j) { return static_cast<double>(depth(i, j)); };
  const double z = z_at(x, y);
  // The derivative of z, or of 1/z, along one axis.
  const auto derivative = [&](int i, int j, double& out) {
    const int sign = valid(x + i, y + j) ? 1 : -1;
    if (!valid(x + sign * i, y + sign * j)) return false;
    const double there = z_at(x + sign * i, y + sign * j);
    out = sign * (form == TangentForm::thesis ? there - z : 1.0 / there - 1.0 / z);
    return true;
  };
  double du = 0;
  double dv = 0;
  if (!derivative(1, 0, du) || !derivative(0, 1, dv)) return {};
  const double fx = static_cast<double>(k.fx);
  const double fy = static_cast<double>(k.fy);
  if (form == TangentForm::thesis) return normalized(Vec3d{fx * du / z, fy * dv / z, -1.0});
  const double a = x + 0.5 - static_cast<double>(k.cx);
  const double b = y + 0.5 - static_cast<double>(k.cy);
  return normalized(Vec3d{-fx * du, -fy * dv, a * du + b * dv - 1.0 / z});
}

[[nodiscard]] double angle_degrees(const Vec3d& a, const Vec3d& b) {
  return std::atan2(length(cross(a, b)), dot(a, b)) * 57.29577951308232;
}

}  // namespace

Comparison normals_case(const Options& options) {
  const Scene& scene = street_scene(options.shape);
  const ImageView<const float> depth = scene.depth.view();
  Comparison comparison{"normals", "Normals from depth", options.shape, {}};
  const auto errors = [&](TangentForm form, const io::Image<Vec3f>& out) {
    ErrorSum sum;
    for (int y = 0; y < depth.height(); ++y) {
      for (int x = 0; x < depth.width(); ++x) {
        const Vec3d exact = plain_normal(depth, scene.intrinsics, form, x, y);
        const Vec3d given = vec_cast<double>(out(x, y));
        const bool both = dot(exact, exact) > 0.5 && dot(given, given) > 0.5;
        sum.add(both ? angle_degrees(exact, given) : (dot(exact, exact) > 0.5) == (dot(given, given) > 0.5) ? 0 : 180);
      }
    }
    return std::vector<Error>{sum.error("degrees")};
  };
  for (const TangentForm form : {TangentForm::perspective, TangentForm::thesis}) {
    const std::string name = form == TangentForm::perspective ? "perspective" : "thesis";
    NormalsParams params;
    params.tangents = form;
    const auto arena = make_arena(normals_workspace_bytes(params, options.shape));
    const auto add = [&](bool peer, const char* method, const auto& kernel) {
      const auto out = std::make_shared<io::Image<Vec3f>>(options.shape);
      Contender& c = comparison.add(method, name, [=] { kernel(out->view()); });
      c.peer = peer;
      c.group = name;
      c.judge = [=, &errors] { return errors(form, *out); };
    };
    add(false, "npsim", [=, &scene](ImageView<Vec3f> out) {
      SerialExecutor executor;
      must(normals_from_depth(params, depth, scene.intrinsics, out, arena->workspace(), executor));
    });
    add(true, "plain double loop", [=, &scene](ImageView<Vec3f> out) {
      for (int y = 0; y < depth.height(); ++y) {
        for (int x = 0; x < depth.width(); ++x) {
          out(x, y) = vec_cast<float>(plain_normal(depth, scene.intrinsics, form, x, y));
        }
      }
    });
  }
  measure(options, comparison);
  return comparison;
}

}  // namespace npsim::bench
