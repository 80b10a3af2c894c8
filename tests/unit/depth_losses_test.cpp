// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/refine.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/random.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "reference/losses.hpp"

using namespace npsim;

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

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
  template <class V = depth_detail::LossBatch<T>, class Executor>
  Status run(const LossParams& p, Executor& executor) {
    npsim_test::Scratch scratch(depth_losses_workspace_bytes<T>(p, shape));
    Workspace& workspace = scratch.workspace();
    const Status s =
        depth_losses<T, V>(p, input(), {depth.data(), shape}, {gradient.data(), shape}, values, workspace, executor);
    CHECK(workspace.used() == 0);
    return s;
  }
  Status run(const LossParams& p) {
    const SerialExecutor serial;
    return run(p, serial);
  }
  reference::Losses expected(const LossParams& p) const {
    return reference::losses<T>(p, input(), {depth.data(), shape});
  }

  static bool usable(T z) { return z >= T(1e-3) && z <= T(1e5); }

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

void check_close(double a, double b, double relative) {
  CAPTURE(a);
  CAPTURE(b);
  CHECK(std::abs(a - b) <= relative * std::abs(b));
}

// Counts exactly, losses within loss_error of their own, gradients within gradient_error of the largest.
template <class T>
void check_against_reference(Scene<T>& s, const LossParams& p, double loss_error, double gradient_error) {
  CAPTURE(s.shape.width);
  CAPTURE(s.shape.height);
  CAPTURE(static_cast<int>(p.tangents));
  CAPTURE(static_cast<int>(p.continuity));
  CAPTURE(static_cast<int>(p.depth_term));
  REQUIRE(s.run(p).ok());
  const reference::Losses expected = s.expected(p);
  CHECK(s.values.normal_count == expected.values.normal_count);
  CHECK(s.values.depth_count == expected.values.depth_count);
  check_close(s.values.normal, expected.values.normal, loss_error);
  check_close(s.values.continuity, expected.values.continuity, loss_error);
  check_close(s.values.depth, expected.values.depth, loss_error);
  check_close(s.values.total, expected.values.total, loss_error);
  double largest = 0;
  double worst = 0;
  for (std::size_t i = 0; i < expected.gradient.size(); ++i) {
    const double difference = std::abs(static_cast<double>(s.gradient[i]) - expected.gradient[i]);
    largest = std::max(largest, std::abs(expected.gradient[i]));
    worst = std::isnan(difference) ? difference : std::max(worst, difference);
    if (!Scene<T>::usable(s.estimate[i])) CHECK(s.gradient[i] == 0);
  }
  CAPTURE(worst);
  CAPTURE(largest);
  CHECK(worst <= gradient_error * largest);
}

constexpr double kLossError = 1e-7;       // of float
constexpr double kFewPixelsError = 5e-7;  // where roundings do not average out: few pixels, or equal ones
constexpr double kGradientError = 5e-7;   // of float, of the largest
constexpr double kGrazingGradientError = 6e-7;
constexpr double kJumpGradientError = 1e-6;       // from 1e-3 to 1e5 m
constexpr double kFewPixelsGradientError = 5e-6;  // a handful of pixels in all: 99 % of images
constexpr double kFewPixelsWorstGradientError = 1.3e-4;

// The bits of every result.
template <class T>
bool same_results(const Scene<T>& a, const Scene<T>& b) {
  return std::memcmp(&a.values, &b.values, sizeof(a.values)) == 0 &&
         std::memcmp(a.gradient.data(), b.gradient.data(), a.gradient.size() * sizeof(T)) == 0;
}

}  // namespace

TEST_CASE("losses and gradients in double equal the definition, in every form, with holes and label weights") {
  for (const LossParams& p : all_forms()) {
    for (const Shape shape : {Shape{37, 35}, Shape{16, 3}, Shape{17, 40}, Shape{2, 2}, Shape{15, 18}}) {
      Scene<double> s(shape);
      s.randomise(static_cast<std::uint32_t>(shape.width), 0.15);
      s.estimate[0] = 5;
      s.weights.assign(kLabelCount, LossWeights{0.5F, 2.0F, 3.0F});
      s.weights[label::road] = solo_label_weights()[label::road];
      check_against_reference(s, p, 1e-12, 1e-12);
    }
  }
}

TEST_CASE("gradients agree with central differences of the kernel's own loss in double") {
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
      if (!Scene<double>::usable(s.estimate[i])) continue;
      const double z = s.depth[i];
      const double h = 1e-5 * z;
      // Fourth order, so that the curvature of the unit normal does not limit the comparison.
      const auto loss = [&](double offset) {
        s.depth[i] = z + offset;
        CHECK(s.run(p).ok());
        s.depth[i] = z;
        return s.values.total;
      };
      const double numeric = (8 * (loss(h) - loss(-h)) - (loss(2 * h) - loss(-2 * h))) / (12 * h);
      worst = std::max(worst, std::abs(numeric - gradient[i]));
    }
    CHECK(worst < 1e-8 * largest);
  }
}

TEST_CASE(
    "losses in single precision: 1e-7 relative, gradients 5e-7 of the largest; 80 % missing; half wrong normals") {
  for (const LossParams& p : all_forms()) {
    for (const double holes : {0.1, 0.8}) {
      Scene<float> s({150, 70});
      s.randomise(9, holes);
      for (std::size_t i = 0; i < s.normals.size() / 2; ++i) s.normals[i] = s.normals[i] * -2.0F;
      check_against_reference(s, p, kLossError, kGradientError);
      s.k.fx = s.k.fy = 0x1.FFFFFEp+8F;  // its reciprocal is as far from a float as one can be
      check_against_reference(s, p, kLossError, kGradientError);
    }
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

TEST_CASE("losses of grazing planes, and where depth jumps so far that the tangent is the ray, stay near double") {
  for (const LossParams& p : all_forms()) {
    for (const double tilt : {0.3, 0.03, 0.003}) {
      Scene<float> s({64, 48});
      s.randomise(21, 0.02);  // the normals
      const Vec3d n = normalized(Vec3d{1, -0.2, tilt});
      for (int y = 0; y < s.shape.height; ++y) {
        for (int x = 0; x < s.shape.width; ++x) {
          const double a = (x + 0.5 - static_cast<double>(s.k.cx)) / static_cast<double>(s.k.fx);
          const double b = (y + 0.5 - static_cast<double>(s.k.cy)) / static_cast<double>(s.k.fy);
          s.depth[s.at(x, y)] = s.estimate[s.at(x, y)] = static_cast<float>(3.0 / (n.x * a + n.y * b + n.z));
        }
      }
      for (float& z : s.estimate) z = Scene<float>::usable(z) ? z * 1.01F : z;
      check_against_reference(s, p, kLossError, kGrazingGradientError);
    }
    Scene<float> s({33, 18});
    s.randomise(22, 0.0);
    for (std::size_t i = 0; i < s.depth.size(); ++i) {
      s.estimate[i] = i % 3 == 0 ? 0.0011F : 0.9e5F;
      s.depth[i] = i % 3 == 0 ? 0.001F : 1e5F;
    }
    check_against_reference(s, p, kFewPixelsError, kJumpGradientError);
  }
}

TEST_CASE("losses of depth near 0, at the limits and beyond") {
  for (const LossParams& p : all_forms()) {
    Scene<float> s({20, 10});
    s.randomise(4, 0.0);
    for (float& z : s.depth) z *= 1e-4F;
    for (float& z : s.estimate) z *= 1e-4F;
    for (std::size_t i = 0; i < s.depth.size(); ++i) s.depth[i] = std::max(s.depth[i], 1e-3F);
    for (std::size_t i = 0; i < s.depth.size(); ++i) s.estimate[i] = std::max(s.estimate[i], 1e-3F);
    s.estimate[45] = s.depth[45] = 1e-38F;  // valid for others, but too near to have a slope
    s.estimate[46] = 1e-40F;
    s.estimate[47] = -0.0F;
    s.estimate[48] = -5.0F;
    s.estimate[49] = 1.00001e5F;
    s.estimate[50] = std::numeric_limits<float>::infinity();
    check_against_reference(s, p, kLossError, kGradientError);
    CHECK(s.values.depth_count == 194);
  }
}

TEST_CASE("gradients that a handful of pixels make up: 99 % within 5e-6 of the largest, all within 1.3e-4") {
  // At most 7x3 pixels, any focal length, depth that jumps by up to a half: slopes cancel with no larger one beside
  // them.
  std::vector<double> errors;
  RandomStream random(33, RandomPurpose::test, 0, 0, 0, 0);
  for (std::uint32_t trial = 0; trial < 400; ++trial) {
    const Shape shape{2 + static_cast<int>(random.uniform() * 6), 1 + static_cast<int>(random.uniform() * 3)};
    Scene<float> s(shape);
    s.randomise(100 + trial, 0.1);
    s.estimate[0] = s.depth[0];
    s.k.fx = random.uniform(5.0F, 500.0F);
    s.k.fy = random.uniform(5.0F, 500.0F);
    for (float& z : s.depth) z *= random.uniform(0.8F, 1.2F);
    for (const LossParams& p : all_forms()) {
      REQUIRE(s.run(p).ok());
      const reference::Losses expected = s.expected(p);
      double largest = 0;
      double off = 0;
      for (std::size_t i = 0; i < expected.gradient.size(); ++i) {
        largest = std::max(largest, std::abs(expected.gradient[i]));
        off = std::max(off, std::abs(static_cast<double>(s.gradient[i]) - expected.gradient[i]));
      }
      errors.push_back(largest > 0 ? off / largest : off);
    }
  }
  std::sort(errors.begin(), errors.end());
  CHECK(errors.back() > kFewPixelsGradientError);  // as hard as it is meant to be
  CHECK(errors[errors.size() * 99 / 100] <= kFewPixelsGradientError);
  CHECK(errors.back() <= kFewPixelsWorstGradientError);
}

TEST_CASE("losses of one valid pixel, of one in the corner, of none") {
  for (const LossParams& p : all_forms()) {
    Scene<float> s({20, 19});
    s.randomise(4, 1.1);
    CHECK(s.run(p).code() == StatusCode::no_valid_input);
    for (const std::size_t i : {std::size_t{50}, std::size_t{0}, s.shape.pixels() - 1}) {
      s.randomise(4, 1.1);
      s.estimate[i] = 4.0F;
      s.depth[i] = 4.5F;
      check_against_reference(s, p, kLossError, kGradientError);
      CHECK(s.values.depth_count == 1);
      CHECK(s.values.normal_count == 0);
    }
  }
}

TEST_CASE("a column of NaN in depth, or in the normals, takes its terms and no others") {
  for (const LossParams& p : all_forms()) {
    for (const int column : {0, 15, 16, 39}) {
      Scene<float> s({40, 33});
      s.randomise(5, 0.0);
      for (int y = 0; y < 33; ++y) s.estimate[s.at(column, y)] = s.depth[s.at(column, y)] = static_cast<float>(kNaN);
      check_against_reference(s, p, kLossError, kGradientError);
      CHECK(s.values.depth_count == 39U * 33U);
      s.randomise(5, 0.0);
      for (int y = 0; y < 33; ++y) s.normals[s.at(column, y)].y = static_cast<float>(kNaN);
      check_against_reference(s, p, kLossError, kGradientError);
      CHECK(s.values.normal_count == (column == 39 ? 39U : 38U) * 32U);
    }
  }
}

TEST_CASE("losses at widths of 1 and around the lane count, heights around the chunk") {
  const LossParams forms[] = {all_forms().front(), all_forms().back()};
  for (const LossParams& p : forms) {
    for (const int width : {1, 2, 3, 4, 5, 7, 8, 9, 15, 16, 17, 31, 32, 33}) {
      for (const int height : {1, 2, 15, 16, 17, 33}) {
        Scene<float> s({width, height});
        s.randomise(static_cast<std::uint32_t>(width * 100 + height), 0.1);
        s.estimate[0] = s.depth[0] * 1.01F;
        check_against_reference(s, p, kFewPixelsError, kGradientError);
      }
    }
  }
}

TEST_CASE("losses with every pixel its own class, weights for some of them, zero among the weights") {
  for (const LossParams& p : all_forms()) {
    Scene<float> s({37, 21});
    s.randomise(6, 0.05);
    for (std::size_t i = 0; i < s.labels.size(); ++i) s.labels[i] = static_cast<Label>(i * 37 % 256);
    s.weights.resize(200);
    for (std::size_t l = 0; l < s.weights.size(); ++l) {
      const float f = static_cast<float>(l);
      s.weights[l] = {0.01F * f, l % 5 == 0 ? 0.0F : 3.0F / (f + 1.0F), l % 3 == 0 ? 0.0F : 0.1F + f};
    }
    check_against_reference(s, p, kLossError, kGradientError);
    const double weighted = s.values.total;
    s.weights.assign(256, LossWeights{});
    check_against_reference(s, p, kLossError, kGradientError);
    CHECK(std::abs(weighted - s.values.total) > 1e-3 * weighted);
  }
}

TEST_CASE("losses have the same bits with one lane and with many, on any number of threads, in any order of chunks") {
  using One = simd::scalar::F32;
  for (const LossParams& p : all_forms()) {
    Scene<float> s({70, 90});
    s.randomise(12, 0.1);
    s.weights = {LossWeights{2, 3, 4}, LossWeights{0.1F, 0.2F, 0.3F}};
    REQUIRE(s.run(p).ok());
    const Scene<float> first = s;
    const SerialExecutor serial;
    const npsim_test::BackwardExecutor backward;
    const auto clear = [&s] {
      s.values = {};
      std::fill(s.gradient.begin(), s.gradient.end(), -1.0F);
    };
    clear();
    REQUIRE(s.run<One>(p, serial).ok());
    CHECK(same_results(s, first));
    clear();
    REQUIRE(s.run(p, backward).ok());
    CHECK(same_results(s, first));
    for (const unsigned threads : {2U, 3U}) {
      ThreadPool pool(threads);
      clear();
      REQUIRE(s.run(p, pool).ok());
      CHECK(same_results(s, first));
    }
  }
}

TEST_CASE("losses of sub-views with strides equal those of whole images, and touch nothing else") {
  const LossParams p;
  Scene<float> s({20, 35});
  s.randomise(8, 0.1);
  s.weights = {LossWeights{2, 3, 4}, LossWeights{0.1F, 0.2F, 0.3F}};
  REQUIRE(s.run(p).ok());
  const auto widen = [&s](const auto& from, auto fill, int stride) {
    std::vector<std::decay_t<decltype(fill)>> wide(static_cast<std::size_t>(stride * (s.shape.height + 2)), fill);
    for (int y = 0; y < s.shape.height; ++y) {
      for (int x = 0; x < s.shape.width; ++x)
        wide[static_cast<std::size_t>((y + 1) * stride + 5 + x)] = from[s.at(x, y)];
    }
    return wide;
  };
  const auto estimate = widen(s.estimate, 7.0F, 26);  // what stands around would count if it were read
  const auto depth = widen(s.depth, 9.0F, 27);
  const auto normals = widen(s.normals, Vec3f{0, 0, -1}, 29);
  const auto uncertain = widen(s.uncertain, std::uint8_t{0}, 31);
  const auto labels = widen(s.labels, Label{0}, 25);
  auto gradient = widen(std::vector<float>(s.shape.pixels()), -4.0F, 33);
  const auto view = [&s](auto& wide, int stride) {
    return ImageView<std::remove_reference_t<decltype(wide[0])>>(wide.data() + stride + 5, s.shape, stride);
  };
  const LossInput<float> input{view(estimate, 26),
                               view(normals, 29),
                               view(uncertain, 31),
                               view(labels, 25),
                               {s.weights.data(), s.weights.size()},
                               s.k};
  std::vector<unsigned char> bytes(depth_losses_workspace_bytes<float>(p, s.shape));
  Workspace workspace(bytes.data(), bytes.size());
  const SerialExecutor serial;
  LossValues values;
  REQUIRE(depth_losses<float>(p, input, view(depth, 27), view(gradient, 33), values, workspace, serial).ok());
  CHECK(std::memcmp(&values, &s.values, sizeof(values)) == 0);
  CHECK(gradient == widen(s.gradient, -4.0F, 33));
  // Without a gradient, and out of a workspace that held something else.
  std::fill(bytes.begin(), bytes.end(), static_cast<unsigned char>(0xFF));
  values = {};
  REQUIRE(depth_losses<float>(p, input, view(depth, 27), {}, values, workspace, serial).ok());
  CHECK(std::memcmp(&values, &s.values, sizeof(values)) == 0);
}

TEST_CASE(
    "the unit-tangent continuity is the same at two resolutions, on surfaces and at depth edges; the printed is not") {
  // A wavy wall seen with normals that are wrong everywhere, without and with a box before it.
  const auto continuity = [](ContinuityForm form, int scale, bool box) {
    Scene<double> s({160 * scale, 120 * scale});
    const auto f = static_cast<float>(160 * scale);
    s.k = {f, f, 0.5F * f, 0.375F * f};
    for (int y = 0; y < s.shape.height; ++y) {
      for (int x = 0; x < s.shape.width; ++x) {
        const double u = (x + 0.5) / (160.0 * scale);
        const double v = (y + 0.5) / (160.0 * scale);
        const bool on_box = box && u > 0.3 && u < 0.6 && v > 0.2 && v < 0.5;
        s.depth[s.at(x, y)] = s.estimate[s.at(x, y)] = on_box ? 4 : 9 + 0.2 * std::sin(20 * u) * std::cos(15 * v);
        s.normals[s.at(x, y)] = {0.5, 0.3 * std::sin(9 * v), -1};
      }
    }
    LossParams p;
    p.continuity = form;
    REQUIRE(s.run(p).ok());
    return s.values.continuity;
  };
  const auto growth = [&](ContinuityForm form, bool box) {
    return continuity(form, 2, box) / continuity(form, 1, box);
  };
  CHECK(std::abs(growth(ContinuityForm::unit_tangents, false) - 1) < 0.01);
  CHECK(std::abs(growth(ContinuityForm::unit_tangents, true) - 1) < 0.02);
  CHECK(growth(ContinuityForm::printed, true) > 1.8);
}

TEST_CASE("unit normals of the losses are within 2.5e-7 of their size, whatever the length they came with") {
  Scene<float> s({40, 20});
  s.randomise(15, 0.0);
  for (std::size_t i = 0; i < s.normals.size(); ++i) {
    s.normals[i] = s.normals[i] * std::pow(10.0F, static_cast<float>(static_cast<int>(i % 23) - 5));
  }
  s.normals[3] = {1e-7F, 0, 0};  // too short
  s.normals[4] = {3e38F, 3e38F, 0};
  npsim_test::Scratch scratch(depth_losses_workspace_bytes<float>({}, s.shape));
  Workspace& workspace = scratch.workspace();
  const SerialExecutor serial;
  depth_detail::LossProblem<float> problem;
  REQUIRE(depth_detail::prepare_losses({}, s.input(), workspace, serial, problem).ok());
  CHECK(problem.normal_count == 39U * 19U - 2U);
  double worst = 0;
  for (int y = 0; y + 1 < s.shape.height; ++y) {
    for (int x = 0; x + 1 < s.shape.width; ++x) {
      if (problem.normal_weight(x, y) == 0) continue;
      const Vec3d n = normalized(vec_cast<double>(s.normals[s.at(x, y)]));
      worst = std::max({worst, std::abs(static_cast<double>(problem.nx(x, y)) / n.x - 1),
                        std::abs(static_cast<double>(problem.ny(x, y)) / n.y - 1),
                        std::abs(static_cast<double>(problem.nz(x, y)) / n.z - 1)});
    }
  }
  CHECK(problem.normal_weight(3, 0) == 0);
  CHECK(problem.normal_weight(4, 0) == 0);
  CHECK(worst < 2.5e-7);
  CHECK(worst > 0);
}

TEST_CASE("losses: a depth to evaluate at that is missing where the estimate is not is an error, and no more") {
  Scene<float> s({20, 10});
  s.randomise(4, 0.0);
  std::fill(s.gradient.begin(), s.gradient.end(), -1.0F);
  const std::vector<float> before = s.gradient;
  for (const float bad : {static_cast<float>(kNaN), 0.0F, -1.0F, 2e5F}) {
    for (const std::size_t i : {std::size_t{0}, std::size_t{17}, std::size_t{199}}) {
      const float good = s.depth[i];
      s.depth[i] = bad;
      CHECK(s.run({}).code() == StatusCode::not_finite);
      CHECK(s.gradient == before);
      s.depth[i] = good;
    }
  }
  s.estimate[17] = 0.0F;
  s.depth[17] = static_cast<float>(kNaN);  // nobody asks
  CHECK(s.run({}).ok());
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
