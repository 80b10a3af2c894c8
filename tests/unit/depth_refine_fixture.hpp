// SPDX-License-Identifier: Apache-2.0
// A seeded scene for the tests of refinement: depth, normals and what is known of their truth.
#ifndef NPSIM_TESTS_UNIT_DEPTH_REFINE_FIXTURE_HPP
#define NPSIM_TESTS_UNIT_DEPTH_REFINE_FIXTURE_HPP

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/random.hpp"
#include "npsim/depth/normals.hpp"
#include "npsim/depth/refine.hpp"

namespace npsim {
namespace refine_test {

// A road between two walls with boxes on it; depth with smeared edges, a low-frequency scale error and noise.
struct Street {
  Street(Shape s, std::uint32_t seed, float depth_noise, float normal_noise)
      : shape(s),
        k(intrinsics_from_fov(s, 1.3F)),
        truth(s.pixels()),
        estimate(s.pixels()),
        out(s.pixels(), -1.0F),
        true_normals(s.pixels()),
        normals(s.pixels()),
        uncertain(s.pixels(), 0) {
    k.cy = 0.45F * static_cast<float>(s.height);
    RandomStream random(seed, RandomPurpose::test, 0, 0, 0, 0);
    float box_x[5], box_z[5];
    for (int i = 0; i < 5; ++i) {
      box_x[i] = random.uniform(-6, 5);
      box_z[i] = random.uniform(8, 35);
    }
    for (int y = 0; y < s.height; ++y) {
      for (int x = 0; x < s.width; ++x) {
        const Vec3f ray = unproject_pixel(k, x, y, 1.0F);
        float z = 60.0F;
        Vec3f n{0, 0, -1};
        const auto hit = [&](float t, const Vec3f& normal) {
          if (t > 1 && t < z) {
            z = t;
            n = normal;
          }
        };
        if (ray.y > 0) hit(1.6F / ray.y, {0, -1, 0});
        if (ray.x < 0) hit(-8.0F / ray.x, {1, 0, 0});
        if (ray.x > 0) hit(8.0F / ray.x, {-1, 0, 0});
        for (int i = 0; i < 5; ++i) {
          const Vec3f p = ray * box_z[i];
          if (p.x > box_x[i] && p.x < box_x[i] + 2 && p.y > 0 && p.y < 1.6F) hit(box_z[i], {0, 0, -1});
        }
        truth[at(x, y)] = z;
        true_normals[at(x, y)] = n;
      }
    }
    const auto gauss = [&] {
      float sum = -6;
      for (int i = 0; i < 12; ++i) sum += random.uniform();
      return sum;
    };
    for (int y = 0; y < s.height; ++y) {
      for (int x = 0; x < s.width; ++x) {
        float sum = 0;
        float count = 0;
        float low = 1e9F;
        float high = 0;
        for (int j = std::max(0, y - 2); j <= std::min(s.height - 1, y + 2); ++j) {
          for (int i = std::max(0, x - 2); i <= std::min(s.width - 1, x + 2); ++i) {
            const float z = truth[at(i, j)];
            sum += z;
            count += 1;
            low = std::min(low, z);
            high = std::max(high, z);
          }
        }
        const float drift = 1 + 0.02F * std::sin(6.0F * static_cast<float>(x) / static_cast<float>(s.width));
        estimate[at(x, y)] = sum / count * drift * (1 + depth_noise * gauss());
        normals[at(x, y)] = true_normals[at(x, y)] + Vec3f{gauss(), gauss(), gauss()} * normal_noise;
        uncertain[at(x, y)] = high > 1.25F * low ? 1 : 0;
      }
    }
  }
  std::size_t at(int x, int y) const { return static_cast<std::size_t>(y * shape.width + x); }
  LossInput<float> input() const {
    LossInput<float> in{{estimate.data(), shape}, {normals.data(), shape}, {uncertain.data(), shape}, {}, {}, k};
    if (!labels.empty()) in.labels = {labels.data(), shape};
    in.label_weights = {label_weights.data(), label_weights.size()};
    return in;
  }
  template <class V = simd::F32, class Executor>
  Status run(const RefineParams& p, Executor& executor) {
    npsim_test::Scratch scratch(refine_workspace_bytes(p, shape));
    Workspace& workspace = scratch.workspace();
    losses.assign(static_cast<std::size_t>(refine_max_steps(p)) + 1, LossValues{-1, 0, 0, 0, 0, 0});
    const Status s = refine_with_normals<V>(p, input(), {out.data(), shape}, {losses.data(), losses.size()}, result,
                                            workspace, executor);
    curve.clear();
    for (const LossValues& l : losses) curve.push_back(static_cast<float>(l.total));
    CHECK(workspace.used() == 0);
    return s;
  }
  Status run(const RefineParams& p) {
    const SerialExecutor serial;
    return run(p, serial);
  }
  double abs_rel(const std::vector<float>& depth) const {
    double sum = 0;
    for (std::size_t i = 0; i < depth.size(); ++i) {
      sum += std::abs(static_cast<double>(depth[i]) / static_cast<double>(truth[i]) - 1);
    }
    return sum / static_cast<double>(depth.size());
  }
  double normal_error_deg(const std::vector<float>& depth) const {
    std::vector<Vec3f> n(depth.size());
    const SerialExecutor serial;
    Workspace none;
    REQUIRE(normals_from_depth({}, {depth.data(), shape}, k, {n.data(), shape}, none, serial).ok());
    double sum = 0;
    for (std::size_t i = 0; i < n.size(); ++i) {
      sum += std::acos(std::min(1.0, std::max(-1.0, static_cast<double>(dot(n[i], true_normals[i])))));
    }
    return sum / static_cast<double>(n.size()) * 57.29577951;
  }

  Shape shape;
  Intrinsics k;
  std::vector<float> truth, estimate, out;
  std::vector<Vec3f> true_normals, normals;
  std::vector<std::uint8_t> uncertain;
  std::vector<Label> labels;  // none by default
  std::vector<LossWeights> label_weights;
  std::vector<LossValues> losses;
  std::vector<float> curve;  // their sums
  RefineResult result;
};

}  // namespace refine_test
}  // namespace npsim

#endif  // NPSIM_TESTS_UNIT_DEPTH_REFINE_FIXTURE_HPP
