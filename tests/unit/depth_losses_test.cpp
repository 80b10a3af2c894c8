// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/losses.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "npsim/core/random.hpp"

using namespace npsim;

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

struct BackwardExecutor {
  template <class F>
  void for_chunks(std::size_t count, std::size_t chunk, F&& f) const {
    for (std::size_t c = chunk_count(count, chunk); c-- > 0;) f(c * chunk, std::min(count, (c + 1) * chunk));
  }
};

template <class T>
struct Scene {
  explicit Scene(Shape s)
      : shape(s),
        estimate(s.pixels()),
        depth(s.pixels()),
        gradient(s.pixels()),
        normals(s.pixels()),
        uncertain(s.pixels()),
        labels(s.pixels()) {
    k = {300.0F, 280.0F, 0.4F * static_cast<float>(s.width), 0.6F * static_cast<float>(s.height)};
  }
  std::size_t at(int x, int y) const { return static_cast<std::size_t>(y * shape.width + x); }

  // Smooth surface with depth edges, holes, wrong and missing normals, some uncertain pixels.
  void randomise(std::uint32_t seed, double holes) {
    RandomStream random(seed, RandomPurpose::test, 0, 0, 0, 0);
    const auto uniform = [&](double low, double high) {
      return low + (high - low) * static_cast<double>(random.uniform());
    };
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const std::size_t i = at(x, y);
        const double z = (x > shape.width / 2 ? 6.0 : 20.0) * (1 + 0.004 * y) * uniform(0.99, 1.01);
        depth[i] = static_cast<T>(z);
        estimate[i] =
            static_cast<T>(uniform(0, 1) < holes ? (uniform(0, 1) < 0.5 ? kNaN : 0.0) : z * uniform(0.95, 1.05));
        normals[i] = {static_cast<T>(uniform(-1, 1)), static_cast<T>(uniform(-1, 1)),
                      static_cast<T>(uniform(-3, -0.1))};
        if (uniform(0, 1) < holes) normals[i] = uniform(0, 1) < 0.5 ? Vec3<T>{} : Vec3<T>{static_cast<T>(kNaN), 0, 0};
        uncertain[i] = uniform(0, 1) < 0.2 ? 1 : 0;
        labels[i] = uniform(0, 1) < 0.4 ? label::road : (uniform(0, 1) < 0.5 ? label::car : Label{200});
      }
    }
  }
  LossInput<T> input() const {
    return {{estimate.data(), shape}, {normals.data(), shape},          {uncertain.data(), shape},
            {labels.data(), shape},   {weights.data(), weights.size()}, k};
  }
  template <class Executor>
  Status run(const LossParams& p, Executor& executor) {
    std::vector<unsigned char> bytes(depth_losses_workspace_bytes<T>(p, shape));
    Workspace workspace(bytes.data(), bytes.size());
    const Status s =
        depth_losses<T>(p, input(), {depth.data(), shape}, {gradient.data(), shape}, values, workspace, executor);
    CHECK(workspace.used() == 0);
    return s;
  }
  Status run(const LossParams& p) {
    const SerialExecutor serial;
    return run(p, serial);
  }

  static bool usable(T z) { return std::isfinite(z) && z > 0; }
  Vec3d point(int x, int y) const {
    const double z = static_cast<double>(depth[at(x, y)]);
    return {(x + 0.5 - static_cast<double>(k.cx)) / static_cast<double>(k.fx) * z,
            (y + 0.5 - static_cast<double>(k.cy)) / static_cast<double>(k.fy) * z, z};
  }

  // From three-dimensional points and cross products, which the kernel does not use.
  LossValues naive(const LossParams& p) const {
    LossValues v;
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const std::size_t i = at(x, y);
        if (!usable(estimate[i])) continue;
        const LossWeights w = labels[i] < weights.size() ? weights[labels[i]] : LossWeights{};
        const double e = static_cast<double>(depth[i]) - static_cast<double>(estimate[i]);
        const double unit =
            p.depth_term == DepthTerm::metric ? static_cast<double>(p.depth_unit_m) : static_cast<double>(estimate[i]);
        v.depth += static_cast<double>(w.depth) * (e / unit) * (e / unit);
        ++v.depth_count;
        const Vec3d given = vec_cast<double>(normals[i]);
        if (x + 1 == shape.width || y + 1 == shape.height || !usable(estimate[at(x + 1, y)]) ||
            !usable(estimate[at(x, y + 1)]) || !is_finite(given) || length(given) == 0) {
          continue;
        }
        ++v.normal_count;
        const Vec3d n = normalized(given);
        Vec3d tx, ty;
        const double z = static_cast<double>(depth[i]);
        const double zr = static_cast<double>(depth[at(x + 1, y)]);
        const double zb = static_cast<double>(depth[at(x, y + 1)]);
        if (p.tangents == TangentForm::thesis) {
          tx = {1, 0, (zr - z) * static_cast<double>(k.fx) / z};
          ty = {0, 1, (zb - z) * static_cast<double>(k.fy) / z};
        } else {
          tx = (point(x + 1, y) - point(x, y)) * (static_cast<double>(k.fx) / zr);
          ty = (point(x, y + 1) - point(x, y)) * (static_cast<double>(k.fy) / zb);
        }
        const Vec3d m = normalized(cross(ty, tx));  // towards the camera
        const double u = uncertain[i] != 0 ? 0.0 : 1.0;
        v.normal += static_cast<double>(w.normal) * (p.normal_in_uncertain ? 1.0 : u) * dot(m - n, m - n);
        if (p.continuity == ContinuityForm::unit_tangents) {
          tx = normalized(tx);
          ty = normalized(ty);
        }
        v.continuity += static_cast<double>(w.continuity) * u * (dot(tx, n) * dot(tx, n) + dot(ty, n) * dot(ty, n));
      }
    }
    if (v.normal_count > 0) {
      v.normal /= static_cast<double>(v.normal_count);
      v.continuity /= static_cast<double>(v.normal_count);
    }
    v.depth /= static_cast<double>(v.depth_count);
    v.total = static_cast<double>(p.lambda.normal) * v.normal +
              static_cast<double>(p.lambda.continuity) * v.continuity + static_cast<double>(p.lambda.depth) * v.depth;
    return v;
  }

  Shape shape;
  Intrinsics k;
  std::vector<T> estimate, depth, gradient;
  std::vector<Vec3<T>> normals;
  std::vector<std::uint8_t> uncertain;
  std::vector<Label> labels;
  std::vector<LossWeights> weights;
  LossValues values;
};

std::vector<LossParams> all_forms() {
  std::vector<LossParams> forms;
  for (const TangentForm t : {TangentForm::perspective, TangentForm::thesis}) {
    for (const ContinuityForm c : {ContinuityForm::printed, ContinuityForm::unit_tangents}) {
      for (const DepthTerm d : {DepthTerm::metric, DepthTerm::relative}) {
        LossParams p;
        p.tangents = t;
        p.continuity = c;
        p.depth_term = d;
        p.depth_unit_m = d == DepthTerm::metric ? 3.0F : 80.0F;
        p.normal_in_uncertain = c == ContinuityForm::printed;
        p.lambda = t == TangentForm::thesis ? kLambdaSection343 : kLambdaThesis;
        forms.push_back(p);
      }
    }
  }
  return forms;
}

void check_close(double a, double b, double relative) { CHECK(std::abs(a - b) <= relative * std::abs(b)); }

}  // namespace

TEST_CASE("losses equal the definition by points and cross products, in every form, with holes and label weights") {
  for (const LossParams& p : all_forms()) {
    for (const Shape shape : {Shape{37, 35}, Shape{16, 3}, Shape{17, 40}, Shape{2, 2}, Shape{15, 18}}) {
      Scene<double> s(shape);
      s.randomise(static_cast<std::uint32_t>(shape.width), 0.15);
      s.estimate[0] = 5;
      s.weights.assign(kLabelCount, LossWeights{0.5F, 2.0F, 3.0F});
      s.weights[label::road] = solo_label_weights()[label::road];
      REQUIRE(s.run(p).ok());
      const LossValues expected = s.naive(p);
      CHECK(s.values.normal_count == expected.normal_count);
      CHECK(s.values.depth_count == expected.depth_count);
      check_close(s.values.normal, expected.normal, 1e-11);
      check_close(s.values.continuity, expected.continuity, 1e-11);
      check_close(s.values.depth, expected.depth, 1e-11);
      check_close(s.values.total, expected.total, 1e-11);
    }
  }
}

TEST_CASE("gradients agree with central differences in double") {
  for (const LossParams& p : all_forms()) {
    Scene<double> s({19, 37});  // three chunks of rows
    s.randomise(7, 0.1);
    s.weights.assign(kLabelCount, LossWeights{0.5F, 2.0F, 3.0F});
    REQUIRE(s.run(p).ok());
    const std::vector<double> gradient = s.gradient;
    double largest = 0;
    for (const double g : gradient) largest = std::max(largest, std::abs(g));
    REQUIRE(largest > 0);
    double worst = 0;
    for (std::size_t i = 0; i < gradient.size(); ++i) {
      const double z = s.depth[i];
      const double h = 1e-5 * z;
      // Fourth order, so that the curvature of the unit normal does not limit the comparison.
      const auto loss = [&](double offset) {
        s.depth[i] = z + offset;
        const double total = s.naive(p).total;
        s.depth[i] = z;
        return total;
      };
      const double numeric = (8 * (loss(h) - loss(-h)) - (loss(2 * h) - loss(-2 * h))) / (12 * h);
      worst = std::max(worst, std::abs(numeric - gradient[i]));
      if (!Scene<double>::usable(s.estimate[i])) CHECK(gradient[i] == 0);
    }
    CHECK(worst < 1e-8 * largest);
  }
}

TEST_CASE("single precision stays near double: losses 1e-7 relative, gradients 5e-7 of the largest") {
  for (const LossParams& p : all_forms()) {
    Scene<double> s({150, 70});
    s.randomise(9, 0.1);
    Scene<float> f(s.shape);
    for (std::size_t i = 0; i < s.depth.size(); ++i) {
      f.depth[i] = static_cast<float>(s.depth[i]);
      f.estimate[i] = static_cast<float>(s.estimate[i]);
      f.normals[i] = vec_cast<float>(s.normals[i]);
      s.depth[i] = static_cast<double>(f.depth[i]);
      s.estimate[i] = static_cast<double>(f.estimate[i]);
      s.normals[i] = vec_cast<double>(f.normals[i]);
    }
    f.uncertain = s.uncertain;
    f.labels = s.labels;
    REQUIRE(s.run(p).ok());
    REQUIRE(f.run(p).ok());
    check_close(f.values.normal, s.values.normal, 1e-7);
    check_close(f.values.continuity, s.values.continuity, 1e-7);
    check_close(f.values.depth, s.values.depth, 1e-7);
    double largest = 0;
    double worst = 0;
    for (std::size_t i = 0; i < s.gradient.size(); ++i) {
      largest = std::max(largest, std::abs(s.gradient[i]));
      worst = std::max(worst, std::abs(s.gradient[i] - static_cast<double>(f.gradient[i])));
    }
    CHECK(worst < 5e-7 * largest);
  }
}

TEST_CASE("on planes with true normals, grazing ones included, the perspective losses vanish; the thesis' do not") {
  const Shape shape{64, 48};
  const Vec3d planes[] = {{0, 0, 1}, {0, 1, 0.05}, {0.6, -0.1, 0.7}, {0.995, 0, 0.1}};
  for (const Vec3d& raw : planes) {
    const Vec3d n = normalized(raw);
    Scene<double> s(shape);
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const double a = (x + 0.5 - static_cast<double>(s.k.cx)) / static_cast<double>(s.k.fx);
        const double b = (y + 0.5 - static_cast<double>(s.k.cy)) / static_cast<double>(s.k.fy);
        const double z = 3.0 / (n.x * a + n.y * b + n.z);
        s.depth[s.at(x, y)] = s.estimate[s.at(x, y)] = z;
        s.normals[s.at(x, y)] = n * -2.0;  // any length will do
      }
    }
    LossParams p;
    REQUIRE(s.run(p).ok());
    CHECK(s.values.normal_count > 500);  // the second plane is a road: above the horizon there is no depth
    CHECK(s.values.normal < 1e-20);
    CHECK(s.values.continuity < 1e-20);
    CHECK(s.values.depth == 0);
    for (const double g : s.gradient) CHECK(std::abs(g) < 1e-9);
    p.tangents = TangentForm::thesis;
    REQUIRE(s.run(p).ok());
    if (std::abs(raw.x) > 0.5) CHECK(s.values.normal > 1e-4);
  }
}

TEST_CASE("losses do not depend on the order of chunks") {
  Scene<float> s({70, 90});
  s.randomise(12, 0.1);
  const LossParams p;
  REQUIRE(s.run(p).ok());
  const std::vector<float> gradient = s.gradient;
  const double total = s.values.total;
  const BackwardExecutor backward;
  REQUIRE(s.run(p, backward).ok());
  CHECK(s.gradient == gradient);
  CHECK(s.values.total == total);
}

TEST_CASE("the unit-tangent continuity of a depth edge does not grow with resolution, the printed one does") {
  double printed[2] = {};
  double unit[2] = {};
  for (int scale = 1; scale <= 2; ++scale) {
    Scene<double> s({80 * scale, 60 * scale});
    s.k = {80.0F * static_cast<float>(scale), 80.0F * static_cast<float>(scale), 40.0F * static_cast<float>(scale),
           30.0F * static_cast<float>(scale)};
    for (int y = 0; y < s.shape.height; ++y) {
      for (int x = 0; x < s.shape.width; ++x) {
        s.depth[s.at(x, y)] = s.estimate[s.at(x, y)] = x < s.shape.width / 3 ? 4 : 9;
        s.normals[s.at(x, y)] = {0, 0, -1};
      }
    }
    LossParams p;
    REQUIRE(s.run(p).ok());
    printed[scale - 1] = s.values.continuity;
    p.continuity = ContinuityForm::unit_tangents;
    REQUIRE(s.run(p).ok());
    unit[scale - 1] = s.values.continuity;
  }
  CHECK(printed[1] > 1.9 * printed[0]);
  CHECK(unit[1] < 1.05 * unit[0]);
}

TEST_CASE("losses: one pixel wide, one valid pixel, all invalid, depth near 0, sub-views") {
  for (const Shape shape : {Shape{1, 7}, Shape{7, 1}, Shape{1, 1}}) {
    Scene<float> s(shape);
    s.randomise(3, 0.0);
    REQUIRE(s.run({}).ok());
    CHECK(s.values.normal_count == 0);
    CHECK(s.values.normal == 0);
    CHECK(s.values.depth_count == shape.pixels());
  }
  Scene<float> s({20, 10});
  s.randomise(4, 1.1);
  CHECK(s.run({}).code() == StatusCode::no_valid_input);
  s.estimate[50] = 4.0F;
  REQUIRE(s.run({}).ok());
  CHECK(s.values.depth_count == 1);
  CHECK(s.values.normal_count == 0);
  s.randomise(4, 0.0);
  s.estimate[45] = s.depth[45] = 1e-38F;  // valid, but too near to have a slope
  REQUIRE(s.run({}).ok());
  CHECK(std::isfinite(s.values.total));
  CHECK(s.values.depth_count == 199);
  s.depth[46] = static_cast<float>(kNaN);
  CHECK(s.run({}).code() == StatusCode::not_finite);
  s.depth[46] = 5.0F;

  std::vector<float> wide(30 * 10, -4.0F);
  const ImageView<float> gradient(wide.data() + 5, s.shape, 30);
  REQUIRE(s.run({}).ok());
  std::vector<unsigned char> bytes(depth_losses_workspace_bytes<float>({}, s.shape));
  Workspace workspace(bytes.data(), bytes.size());
  const SerialExecutor serial;
  LossValues values;
  REQUIRE(depth_losses<float>({}, s.input(), {s.depth.data(), s.shape}, gradient, values, workspace, serial).ok());
  for (int y = 0; y < 10; ++y) {
    for (int x = 0; x < 20; ++x) CHECK(gradient(x, y) == s.gradient[s.at(x, y)]);
    CHECK(wide[static_cast<std::size_t>(y * 30 + 4)] == -4.0F);
    CHECK(wide[static_cast<std::size_t>(y * 30 + 25)] == -4.0F);
  }
}

TEST_CASE("losses refuse bad arguments") {
  Scene<float> s({8, 8});
  s.randomise(1, 0.0);
  LossParams p;
  p.lambda.depth = -1;
  CHECK(s.run(p).code() == StatusCode::invalid_argument);
  p = {};
  p.depth_unit_m = 0;
  CHECK(s.run(p).code() == StatusCode::invalid_argument);
  p = {};
  s.weights.assign(3, LossWeights{1, static_cast<float>(kNaN), 1});
  CHECK(s.run(p).code() == StatusCode::invalid_argument);
  s.weights.clear();
  s.k.fx = 0;
  CHECK(s.run(p).code() == StatusCode::invalid_argument);
  s.k.fx = 100;
  const SerialExecutor serial;
  Workspace none;
  LossValues values;
  CHECK(depth_losses<float>(p, s.input(), {s.depth.data(), s.shape}, {}, values, none, serial).code() ==
        StatusCode::workspace_exhausted);
  CHECK(depth_losses<float>(p, s.input(), {s.depth.data(), {8, 7}}, {}, values, none, serial).code() ==
        StatusCode::shape_mismatch);
}
