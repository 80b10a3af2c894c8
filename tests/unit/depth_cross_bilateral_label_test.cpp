// SPDX-License-Identifier: Apache-2.0
// The label term alone: its guaranteed bound, 1e-6 at R = 30, against sums in double, on windows that are hard for it.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/random.hpp"
#include "npsim/depth/cross_bilateral.hpp"
#include "npsim/exec/thread_pool.hpp"

using namespace npsim;

namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

struct Picture {
  explicit Picture(Shape s) : shape(s), depth(s.pixels()), labels(s.pixels()), out(s.pixels(), -5.0F) {}

  void fill(const std::function<float(int, int)>& z, const std::function<int(int, int)>& label) {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        depth[at(x, y)] = z(x, y);
        labels[at(x, y)] = static_cast<std::uint16_t>(label(x, y));
      }
    }
  }
  [[nodiscard]] std::size_t at(int x, int y) const { return static_cast<std::size_t>(y * shape.width + x); }

  template <class F = simd::F32, class Executor>
  [[nodiscard]] Status run(const CrossBilateralParams& p, Executor&& executor) {
    std::vector<unsigned char> bytes(cross_bilateral_workspace_bytes(p, shape), 0xFF);  // NaN wherever it is read
    Workspace workspace(bytes.data(), bytes.size());
    using namespace cross_bilateral_detail;
    const FilterTerms terms = filter_terms(p, shape, FilteredPixels::all);
    const FilterPlan plan = filter_plan(terms, shape);
    if (!plan.possible) return {StatusCode::invalid_argument, "not possible"};
    bound = static_cast<double>(plan.relative_error_bound);
    return filter_with<F>(terms, plan, ImageView<const float>(depth.data(), shape),
                          ImageView<const std::uint16_t>(labels.data(), shape), ImageView<const Vec3f>(),
                          ImageView<float>(out.data(), shape), workspace, executor);
  }

  // Largest relative error over every `step`-th pixel; a pixel must be valid exactly where its weights suffice.
  [[nodiscard]] double worst(const CrossBilateralParams& p, int step) const {
    const int r = cross_bilateral_radius(p, shape);
    const double sigma = static_cast<double>(p.sigma_s_px);
    double worst = 0;
    for (int i = 0; i < static_cast<int>(shape.pixels()); i += step) {
      const int x = i % shape.width;
      const int y = i / shape.width;
      double sum = 0;
      double weights = 0;
      for (int qy = std::max(0, y - r); qy <= std::min(shape.height - 1, y + r); ++qy) {
        for (int qx = std::max(0, x - r); qx <= std::min(shape.width - 1, x + r); ++qx) {
          const float z = depth[at(qx, qy)];
          if (labels[at(qx, qy)] != labels[at(x, y)] || !is_valid_depth(z)) continue;
          const double d2 = double((qx - x) * (qx - x)) + double((qy - y) * (qy - y));
          const double w = std::exp(-d2 / (2 * sigma * sigma));
          sum += w * static_cast<double>(z);
          weights += w;
        }
      }
      const float got = out[at(x, y)];
      if (weights < 0.5e-12) CHECK(got == 0.0F);
      if (weights < 2e-12) continue;
      worst = std::max(worst, std::abs(static_cast<double>(got) / (sum / weights) - 1));
    }
    return worst;
  }

  Shape shape;
  std::vector<float> depth;
  std::vector<std::uint16_t> labels;
  std::vector<float> out;
  double bound = 0;
};

CrossBilateralParams labels_alone() {
  CrossBilateralParams p;
  p.use_colour = false;
  p.max_relative_error = 1e-6F;
  return p;
}

}  // namespace

TEST_CASE("label term: 1e-6 is guaranteed at sigma 10 and R = 30, and kept on random hard windows") {
  const SerialExecutor serial;
  const CrossBilateralParams p = labels_alone();
  double largest = 0;
  for (std::uint32_t seed = 0; seed < 6; ++seed) {
    RandomStream random(seed, RandomPurpose::test, 0, 0, 0, 0);
    Picture s({70 + 13 * static_cast<int>(seed), 150});
    const float ratio = seed % 2 == 0 ? 1000.0F : 1.01F;
    const float holes = seed % 3 == 0 ? 0.0F : seed % 3 == 1 ? 0.2F : 0.9F;
    const int period = seed < 3 ? 7 : 40;
    s.fill(
        [&](int, int) {
          const float z = std::pow(ratio, random.uniform());
          return random.uniform() < holes ? (random.uniform() < 0.5F ? kNaN : -1.0F) : z;
        },
        [&](int x, int y) { return (x + y * (static_cast<int>(seed) - 2)) / period % 3 + (random.uniform() < 0.02F); });
    REQUIRE(s.run(p, serial).ok());
    CHECK(s.bound <= 1e-6);
    const double worst = s.worst(p, 7);
    CHECK_MESSAGE(worst <= s.bound, "seed " << seed);
    largest = std::max(largest, worst);
  }
  CHECK(largest > 5e-8);  // the test does measure something
  MESSAGE("largest error " << largest);
}

TEST_CASE("label term: a bound that floats cannot hold is refused, and what is held grows with R") {
  const SerialExecutor serial;
  CrossBilateralParams p = labels_alone();
  p.max_relative_error = 9e-7F;
  Picture s({80, 80});
  CHECK(s.run(p, serial).code() == StatusCode::invalid_argument);
  CHECK(s.out[0] == -5.0F);
  p.max_relative_error = 1.0F;
  const Shape shape{400, 400};
  float before = 0.0F;
  for (const int radius : {1, 30, 60, 200}) {
    p.radius_px = radius;
    const auto terms = cross_bilateral_detail::filter_terms(p, shape, FilteredPixels::all);
    const float bound = cross_bilateral_detail::filter_plan(terms, shape).relative_error_bound;
    CHECK(bound > before);
    before = bound;
  }
  CHECK(before < 3e-6F);
}

TEST_CASE("label term: windows that are full, empty, cut by the image, and far from all samples") {
  const SerialExecutor serial;
  struct Case {
    std::string name;
    Shape shape;
    float sigma;
    int radius;
    std::function<float(int, int)> z;
    std::function<int(int, int)> label;
  };
  const auto ramp = [](int x, int y) { return 2.0F + 0.37F * static_cast<float>((x * 31 + y * 17) % 211); };
  const auto one = [](int, int) { return 9; };
  const Case cases[] = {
      {"one class", {417, 133}, 10, 30, ramp, one},
      {"one class, wider window than the image", {40, 30}, 900, 80, ramp, one},
      {"width 1", {1, 300}, 10, 30, ramp, [](int, int y) { return y / 100; }},
      {"height 1", {900, 1}, 40, 300, ramp, [](int x, int) { return x / 100 % 2; }},
      {"radius 0", {33, 9}, 3, 0, ramp, one},
      {"sigma tiny", {40, 40}, 0.01F, 30, ramp, one},
      {"one valid pixel", {130, 60}, 10, 30, [](int x, int y) { return x == 70 && y == 31 ? 3.0F : kNaN; }, one},
      {"samples in the tail alone",
       {120, 60},
       4,
       40,
       [](int x, int y) { return x < 3 ? (x == 0 ? 700.0F : 1.0F + static_cast<float>(y)) : 0.0F; },
       one},
      {"classes that touch at one corner",
       {96, 96},
       10,
       30,
       [](int x, int y) { return (x < 48) == (y < 48) ? 2.0F : 80.0F; },
       [](int x, int y) { return (x < 48) == (y < 48) ? 1 : 2; }},
      {"stripes of one pixel", {150, 40}, 10, 30, ramp, [](int x, int) { return x % 2; }},
      {"chequers", {150, 40}, 10, 30, ramp, [](int x, int y) { return (x + y) % 2; }},
      {"label 0 and 65535", {200, 50}, 10, 30, ramp, [](int x, int y) { return x > y + 60 ? 0 : 65535; }},
      {"a class of one pixel among another",
       {200, 140},
       10,
       30,
       ramp,
       [](int x, int y) { return x == 133 && y == 129; }},
      {"every pixel its own class", {200, 40}, 10, 30, ramp, [](int x, int y) { return y * 200 + x; }},
      {"300 classes at random, taps",
       {120, 40},
       3,
       9,
       ramp,
       [](int x, int y) { return (x * 7919 + y * 104729) % 300; }},
      {"near 0", {64, 64}, 10, 30, [](int x, int) { return 1e-20F * static_cast<float>(1 + x); }, one},
  };
  for (const Case& c : cases) {
    CAPTURE(c.name);
    Picture s(c.shape);
    s.fill(c.z, c.label);
    CrossBilateralParams p = labels_alone();
    p.sigma_s_px = c.sigma;
    p.radius_px = c.radius;
    p.max_relative_error = 1.0F;
    REQUIRE(s.run(p, serial).ok());
    CHECK(s.worst(p, static_cast<int>(s.shape.pixels()) > 20000 ? 13 : 3) <= s.bound);
  }
}

TEST_CASE("label term: the same bits with one lane, on four threads, backwards and in place") {
  const SerialExecutor serial;
  for (const int classes : {3, 4000}) {  // by class, and tap by tap
    Picture s({410, 140});
    RandomStream random(3, RandomPurpose::test, 0, 0, 0, 0);
    s.fill([&](int, int) { return random.uniform() < 0.1F ? kNaN : random.uniform(2.0F, 90.0F); },
           [&](int x, int y) {
             return classes == 3 ? (x / 50 + y / 30) % 3 : static_cast<int>(random.uniform() * float(classes));
           });
    CrossBilateralParams p = labels_alone();
    p.radius_px = classes == 3 ? 30 : 3;
    REQUIRE(s.run(p, serial).ok());
    const std::vector<float> expected = s.out;
    for (int variant = 0; variant < 3; ++variant) {
      s.out.assign(s.out.size(), -1.0F);
      if (variant == 0) REQUIRE(s.run<simd::scalar::F32>(p, serial).ok());
      if (variant == 1) REQUIRE(s.run(p, npsim_test::BackwardExecutor()).ok());
      if (variant == 2) REQUIRE(s.run(p, ThreadPool(4)).ok());
      CHECK(s.out == expected);
    }
    const ImageView<float> in_place(s.depth.data(), s.shape);
    npsim_test::Scratch scratch(cross_bilateral_workspace_bytes(p, s.shape));
    Workspace& workspace = scratch.workspace();
    CrossBilateralResult result;
    REQUIRE(cross_bilateral(p, ImageView<const float>(in_place),
                            ImageView<const std::uint16_t>(s.labels.data(), s.shape), ImageView<const Vec3f>(),
                            in_place, result, workspace, serial, FilteredPixels::all)
                .ok());
    CHECK(s.depth == expected);
  }
}
