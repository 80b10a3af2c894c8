// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/cross_bilateral.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/random.hpp"
#include "npsim/exec/thread_pool.hpp"

using namespace npsim;

namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

template <class L>
struct Scene {
  explicit Scene(Shape s)
      : shape(s),
        depth(s.pixels(), 10.0F),
        labels(s.pixels(), L{1}),
        lab(s.pixels(), Vec3f{50, 0, 0}),
        out(s.pixels(), -5.0F) {}
  std::size_t at(int x, int y) const { return static_cast<std::size_t>(y * shape.width + x); }

  // Two surfaces with a ragged edge, colours that follow it loosely, holes.
  void randomise(std::uint32_t seed, float holes) {
    RandomStream random(seed, RandomPurpose::test, 0, 0, 0, 0);
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const bool near = x + (y * 7) % 5 < shape.width / 2;
        depth[at(x, y)] = near ? random.uniform(2.0F, 3.0F) : random.uniform(70.0F, 80.0F);
        labels[at(x, y)] = near ? L{26} : static_cast<L>(1000 * (sizeof(L) - 1) + static_cast<std::size_t>(y / 9));
        const float l = near ? 30.0F : 45.0F;
        lab[at(x, y)] = {l + random.uniform(-9, 9), random.uniform(-9, 9), random.uniform(-9, 9)};
        if (random.uniform() < holes) depth[at(x, y)] = random.uniform() < 0.5F ? kNaN : 0.0F;
      }
    }
  }
  template <class Executor>
  Status run(const CrossBilateralParams& p, Executor& executor, FilteredPixels pixels = FilteredPixels::all) {
    npsim_test::Scratch scratch(cross_bilateral_workspace_bytes(p, shape));
    Workspace& workspace = scratch.workspace();
    const Status s = cross_bilateral(p, {depth.data(), shape}, ImageView<const L>(labels.data(), shape),
                                     {lab.data(), shape}, {out.data(), shape}, result, workspace, executor, pixels);
    CHECK(workspace.used() == 0);
    return s;
  }
  Status run(const CrossBilateralParams& p, FilteredPixels pixels = FilteredPixels::all) {
    const SerialExecutor serial;
    return run(p, serial, pixels);
  }

  // One lane at a time.
  Status run_scalar(const CrossBilateralParams& p) {
    npsim_test::Scratch scratch(cross_bilateral_workspace_bytes(p, shape));
    Workspace& workspace = scratch.workspace();
    const SerialExecutor serial;
    using namespace cross_bilateral_detail;
    const FilterTerms terms = filter_terms(p, shape, FilteredPixels::all);
    return filter_with<simd::scalar::F32>(terms, filter_plan(terms, shape), ImageView<const float>(depth.data(), shape),
                                          ImageView<const L>(labels.data(), shape),
                                          ImageView<const Vec3f>(lab.data(), shape),
                                          ImageView<float>(out.data(), shape), workspace, serial);
  }

  // Equation (3.2) as it stands, in double. `weight` is the denominator.
  double naive(const CrossBilateralParams& p, int x, int y, double& weight) const {
    const int radius = p.radius_px >= 0 ? p.radius_px : static_cast<int>(std::ceil(3 * p.sigma_s_px));
    const double sigma_s = static_cast<double>(p.sigma_s_px);
    const double sigma_c = static_cast<double>(p.sigma_c);
    double numerator = 0;
    weight = 0;
    for (int qy = std::max(0, y - radius); qy <= std::min(shape.height - 1, y + radius); ++qy) {
      for (int qx = std::max(0, x - radius); qx <= std::min(shape.width - 1, x + radius); ++qx) {
        const float z = depth[at(qx, qy)];
        if (!(std::isfinite(z) && z > 0)) continue;
        const Vec3d step = vec_cast<double>(lab[at(qx, qy)]) - vec_cast<double>(lab[at(x, y)]);
        double bracket = p.use_labels && labels[at(qx, qy)] == labels[at(x, y)] ? 1.0 : 0.0;
        if (p.use_colour && is_finite(step)) {
          bracket += static_cast<double>(p.mu) * std::exp(-dot(step, step) / (2 * sigma_c * sigma_c));
        }
        const double r2 = (qx - x) * (qx - x) + (qy - y) * (qy - y);
        const double w = std::exp(-r2 / (2 * sigma_s * sigma_s)) * bracket;
        numerator += w * static_cast<double>(z);
        weight += w;
      }
    }
    return numerator / weight;
  }

  // Largest relative error; validity must agree, except within a factor 2 of the weight that counts as none.
  double worst(const CrossBilateralParams& p) {
    double worst = 0;
    double squares = 0;
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        double weight = 0;
        const double expected = naive(p, x, y, weight);
        const float got = out[at(x, y)];
        if (weight < 0.5e-12) CHECK(got == 0.0F);
        if (weight < 2e-12) continue;
        const double error = std::abs(static_cast<double>(got) - expected);
        worst = std::max(worst, error / expected);
        squares += error * error;
      }
    }
    rmse_m = std::sqrt(squares / static_cast<double>(shape.pixels()));
    return worst;
  }

  Shape shape;
  std::vector<float> depth;
  std::vector<L> labels;
  std::vector<Vec3f> lab;
  std::vector<float> out;
  CrossBilateralResult result;
  double rmse_m = 0;  // set by worst()
};

// How far from 0 scaled colours may be where depths differ by `ratio`.
float scaled_near_of(const CrossBilateralParams& p, Shape shape, double ratio) {
  using namespace cross_bilateral_detail;
  const FilterTerms terms = filter_terms(p, shape, FilteredPixels::all);
  return scaled_near(terms, colour_grid(shape, terms.radius_px), filter_plan(terms, shape), ratio);
}

}  // namespace

TEST_CASE("cross-bilateral at the thesis' settings is far nearer to double precision than the bound") {
  Scene<std::uint8_t> s({90, 66});
  s.randomise(1, 0.1F);
  const CrossBilateralParams p;
  REQUIRE(s.run(p).ok());
  CHECK(s.result.method == CrossBilateralMethod::quartic_weights);
  CHECK(s.result.relative_error_bound <= 2e-5F);
  CHECK(s.worst(p) < 3e-6);
  CHECK(s.rmse_m < 1e-4);
}

TEST_CASE("cross-bilateral keeps every bound it is given, and says which") {
  // Colours from uniform to unrelated, so that blocks are left out where it is allowed, next to depths that differ
  // by 40.
  for (const float contrast : {5.0F, 40.0F, 120.0F}) {
    Scene<std::uint8_t> s({100, 40});
    s.randomise(7, 0.05F);
    for (int y = 0; y < 40; ++y) {
      for (int x = 0; x < 100; ++x) {
        if ((x / 16 + y / 8) % 2 == 0) s.lab[s.at(x, y)].x += contrast;
        if (x % 37 == 5) s.labels[s.at(x, y)] = 200;  // thin: little weight of its own
      }
    }
    for (const float bound : {1.6e-5F, 2e-5F, 1e-4F, 1e-3F, 1e-2F, 0.1F, 1.0F}) {
      for (const bool labels : {true, false}) {
        CrossBilateralParams p;
        p.max_relative_error = bound;
        p.use_labels = labels;
        p.mu = contrast < 50 ? 5.0F : 0.1F;
        REQUIRE(s.run(p).ok());
        CHECK(s.result.relative_error_bound <= bound);
        CHECK(s.worst(p) <= static_cast<double>(s.result.relative_error_bound));
      }
    }
  }
  Scene<std::uint8_t> s({40, 40});
  CrossBilateralParams p;
  const auto method = [&](float bound) {
    p.max_relative_error = bound;
    REQUIRE(s.run(p).ok());
    return s.result.method;
  };
  CHECK(method(1.5e-5F) == CrossBilateralMethod::quintic_weights);
  CHECK(method(1e-3F) == CrossBilateralMethod::cubic_weights);
  CHECK(method(1e-2F) == CrossBilateralMethod::quadratic_weights);
  p.use_colour = false;
  CHECK(method(1e-5F) == CrossBilateralMethod::label_sums);
  CHECK(s.result.relative_error_bound < 1e-5F);
  p.use_colour = true;
  p.max_relative_error = 1e-7F;
  CHECK(s.run(p).code() == StatusCode::invalid_argument);
}

TEST_CASE("cross-bilateral: colours that hardly differ, far from 0, keep the bound, with holes and without") {
  // Scaled, they lie 4000 from 0 and 5 from each other: to scale them before their middle is taken off would cost 1e-3.
  for (const float holes : {0.0F, 0.3F}) {
    Scene<std::uint8_t> s({70, 40});
    s.randomise(41, holes);
    for (Vec3f& c : s.lab) c = {95.0F + 2e-3F * c.x, 100.0F + 2e-3F * c.y, -100.0F + 2e-3F * c.z};
    CrossBilateralParams p;
    p.sigma_c = 0.02F;
    p.radius_px = 12;
    CHECK(scaled_near_of(p, s.shape, 1000) > 1.0F);
    REQUIRE(s.run(p).ok());
    CHECK(s.worst(p) < 3e-6);
  }
}

TEST_CASE("cross-bilateral scales the more colours the nearer the depths lie to each other, and keeps the bound") {
  // Nearly all blocks lie between what depths that differ by 1000 allow, and depths that differ by 2.
  CrossBilateralParams p;
  p.radius_px = 30;
  const float at_2 = scaled_near_of(p, {100, 60}, 2);
  const float at_1000 = scaled_near_of(p, {100, 60}, 1000);
  CHECK(at_1000 > 2.0F);
  CHECK(at_2 > 3.0F * at_1000);
  CHECK(scaled_near_of(p, {100, 60}, 1) > at_2);
  CHECK(scaled_near_of(p, {100, 60}, 1e30) == at_1000);  // beyond the promise
  p.max_relative_error = 1.3e-5F;
  CHECK(scaled_near_of(p, {100, 60}, 1000) < at_1000);
  p = {};
  p.radius_px = 1000;  // long sums of labels beside those of colours
  const float beside_labels = scaled_near_of(p, {2048, 2048}, 1000);
  p.use_labels = false;
  CHECK(beside_labels < scaled_near_of(p, {2048, 2048}, 1000));
  p = {};
  for (const float outlier : {1.0F, 1000.0F}) {
    Scene<std::uint8_t> s({100, 60});
    RandomStream random(43, RandomPurpose::test, 0, 0, 0, 0);
    for (std::size_t i = 0; i < s.depth.size(); ++i) {
      s.depth[i] = random.uniform(20.0F, 40.0F);
      s.lab[i] = {random.uniform(20.0F, 80.0F), random.uniform(-20.0F, 20.0F), random.uniform(-20.0F, 20.0F)};
    }
    s.depth[s.at(50, 30)] *= outlier;
    p.use_labels = false;
    REQUIRE(s.run(p).ok());
    CHECK(s.worst(p) < 3e-6);
  }
}

TEST_CASE("cross-bilateral scales colours only where the plan leaves error for it, and only near ones") {
  using namespace cross_bilateral_detail;
  float data[kBlockPlanes] = {};
  data[kBlockAny] = 1;
  data[kBlockLow] = 40;
  data[kBlockHigh] = 60;
  ColourTerm term;
  term.blocks = {data, 1, 1, 0};
  term.root_scale = 0.25F;
  for (const float near : {-1.0F, -100.0F, 2.4F}) {
    term.near = near;
    CHECK(!scaled_colours(term, 0, 0, 1).near[0]);
  }
  term.near = 2.6F;
  CHECK(scaled_colours(term, 0, 0, 1).near[0]);
}

TEST_CASE("cross-bilateral: a 2 m to 80 m step followed by a flat stretch") {
  Scene<std::uint8_t> s({128, 32});
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 128; ++x) {
      s.depth[s.at(x, y)] = x < 50 ? 2.0F : 80.0F;
      s.labels[s.at(x, y)] = x < 52 ? 1 : 2;               // the label's edge lies elsewhere
      s.lab[s.at(x, y)] = {x < 49 ? 20.0F : 80.0F, 0, 0};  // and so does the colour's
    }
  }
  const CrossBilateralParams p;
  REQUIRE(s.run(p).ok());
  CHECK(s.worst(p) < 3e-6);
  for (int y = 0; y < 32; ++y) CHECK(std::abs(s.out[s.at(127, y)] - 80.0F) < 1e-4F);
}

TEST_CASE("cross-bilateral: depth near 0 and inverse depth keep the relative bound") {
  for (const float scale : {1e-20F, 1e-6F, 1e20F}) {
    Scene<std::uint8_t> s({40, 24});
    s.randomise(8, 0.1F);
    for (float& z : s.depth) z *= scale;
    CrossBilateralParams p;
    p.sigma_s_px = 4.0F;
    REQUIRE(s.run(p).ok());
    CHECK(s.worst(p) < 3e-6);
  }
  Scene<std::uint8_t> s({40, 24});
  s.randomise(9, 0.1F);
  for (float& z : s.depth) z = 1.0F / z;
  const CrossBilateralParams p;
  REQUIRE(s.run(p).ok());
  CHECK(s.worst(p) < 3e-6);
}

TEST_CASE("cross-bilateral: radii and sizes around blocks, chunks, tiles, strips and sweeps") {
  struct Size {
    Shape shape;
    int radius;
    float sigma;
  };
  const Size sizes[] = {{{63, 5}, 15, 6},    {{64, 15}, 16, 6},  {{65, 16}, 17, 6},   {{127, 3}, 31, 10},
                        {{128, 17}, 32, 10}, {{129, 4}, 33, 10}, {{16, 63}, 20, 8},   {{17, 64}, 40, 12},
                        {{15, 65}, 70, 30},  {{5, 150}, 66, 30}, {{300, 3}, 140, 60}, {{600, 2}, 599, 900},
                        {{1, 200}, 200, 50}, {{200, 1}, 3, 1},   {{66, 131}, 0, 1}};
  for (const Size& size : sizes) {
    Scene<std::uint16_t> s(size.shape);
    s.randomise(static_cast<std::uint32_t>(size.radius), 0.2F);
    CrossBilateralParams p;
    p.radius_px = size.radius;
    p.sigma_s_px = size.sigma;
    REQUIRE(s.run(p).ok());
    CHECK_MESSAGE(s.worst(p) < 4e-6, size.shape.width << 'x' << size.shape.height << " R " << size.radius);
    p.use_colour = false;
    REQUIRE(s.run(p).ok());
    CHECK_MESSAGE(s.worst(p) < 3e-6, size.shape.width << 'x' << size.shape.height << " R " << size.radius);
  }
}

TEST_CASE("cross-bilateral: few classes in pieces and many classes at random, as labels and as instances") {
  for (const int classes : {1, 2, 5, 60, 300, 60000}) {
    Scene<std::uint16_t> s({150, 70});
    s.randomise(3, 0.1F);
    RandomStream random(5, RandomPurpose::test, 0, 0, 0, 0);
    for (std::uint16_t& l : s.labels) l = static_cast<std::uint16_t>(random.uniform() * static_cast<float>(classes));
    CrossBilateralParams p;
    p.use_colour = false;
    p.sigma_s_px = 4.0F;
    REQUIRE(s.run(p).ok());
    CHECK(s.worst(p) < 1e-6);
    CHECK(s.result.relative_error_bound < 1e-5F);
  }
}

TEST_CASE("cross-bilateral: every combination of terms, instances, widths around the lane count, many settings") {
  const Shape shapes[] = {{1, 1}, {1, 30}, {30, 1}, {7, 5}, {8, 9}, {15, 4}, {16, 4}, {17, 6}, {33, 20}};
  for (const Shape shape : shapes) {
    for (int variant = 0; variant < 7; ++variant) {
      CrossBilateralParams p;
      p.sigma_s_px = 2.0F;
      if (variant == 1) p.use_labels = false;
      if (variant == 2) p.use_colour = false;
      if (variant == 3) p.mu = kCrossBilateralMuCitedCode;
      if (variant == 4) p.sigma_c = 0.5F;
      if (variant == 5) p.radius_px = 1;
      if (variant == 6) p.mu = 0.0F;
      Scene<std::uint8_t> s(shape);
      s.randomise(static_cast<std::uint32_t>(variant), 0.3F);
      REQUIRE(s.run(p).ok());
      CHECK(s.worst(p) < 2e-5);
      Scene<std::uint16_t> instances(shape);
      instances.randomise(static_cast<std::uint32_t>(variant), 0.3F);
      REQUIRE(instances.run(p).ok());
      CHECK(instances.worst(p) < 2e-5);
    }
  }
}

TEST_CASE("cross-bilateral: sigma tiny keeps the depth, sigma huge averages over the window") {
  Scene<std::uint8_t> s({40, 30});
  s.randomise(3, 0.0F);
  CrossBilateralParams p;
  p.sigma_s_px = 0.001F;
  REQUIRE(s.run(p).ok());
  for (std::size_t i = 0; i < s.out.size(); ++i) CHECK(std::abs(s.out[i] / s.depth[i] - 1.0F) < 1e-6F);
  p.sigma_s_px = 1e6F;  // the radius is clamped to the image
  p.sigma_c = 1e6F;
  REQUIRE(s.run(p).ok());
  CHECK(s.worst(p) < 2e-5);
  p = {};
  p.sigma_c = 0.001F;
  REQUIRE(s.run(p).ok());
  CHECK(s.worst(p) < 2e-5);
}

TEST_CASE("cross-bilateral: one class is a Gaussian blur, and where every pixel is its own class nothing mixes") {
  Scene<std::uint16_t> s({33, 21});
  s.randomise(4, 0.0F);
  CrossBilateralParams p;
  p.use_colour = false;
  p.sigma_s_px = 3.0F;
  for (std::size_t i = 0; i < s.labels.size(); ++i) s.labels[i] = static_cast<std::uint16_t>(i);
  REQUIRE(s.run(p).ok());
  for (std::size_t i = 0; i < s.out.size(); ++i) CHECK(std::abs(s.out[i] / s.depth[i] - 1.0F) < 1e-6F);
  s.labels.assign(s.labels.size(), 65535);
  REQUIRE(s.run(p).ok());
  CHECK(s.worst(p) < 2e-5);
}

TEST_CASE("cross-bilateral: classes that touch at one corner do not mix through it") {
  Scene<std::uint8_t> s({32, 32});
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 32; ++x) {
      const bool even = (x < 16) == (y < 16);
      s.labels[s.at(x, y)] = even ? 1 : 2;
      s.depth[s.at(x, y)] = even ? 2.0F : 80.0F;
    }
  }
  CrossBilateralParams p;
  p.use_colour = false;
  REQUIRE(s.run(p).ok());
  for (std::size_t i = 0; i < s.out.size(); ++i) CHECK(std::abs(s.out[i] / s.depth[i] - 1.0F) < 2e-5F);
}

TEST_CASE("cross-bilateral: one valid pixel, a column of NaN, all invalid, colours that are not finite") {
  Scene<std::uint8_t> s({50, 9});
  s.depth.assign(s.depth.size(), 0.0F);
  s.depth[s.at(10, 4)] = 7.0F;
  CrossBilateralParams p;
  p.radius_px = 5;
  REQUIRE(s.run(p).ok());
  for (int y = 0; y < 9; ++y) {
    for (int x = 0; x < 50; ++x) {
      const float expected = std::abs(x - 10) <= 5 ? 7.0F : 0.0F;
      CHECK(std::abs(s.out[s.at(x, y)] - expected) < 1e-5F);
    }
  }
  REQUIRE(s.run(p, FilteredPixels::with_depth).ok());
  for (std::size_t i = 0; i < s.out.size(); ++i) {
    CHECK(std::abs(s.out[i] - (i == s.at(10, 4) ? 7.0F : 0.0F)) < 1e-5F);
  }
  s.depth.assign(s.depth.size(), kNaN);
  p = {};
  REQUIRE(s.run(p).ok());
  for (const float z : s.out) CHECK(z == 0.0F);

  s.randomise(5, 0.0F);
  for (int y = 0; y < 9; ++y) {
    s.depth[s.at(25, y)] = kNaN;
    s.lab[s.at(20, y)] = {kNaN, 0, 0};
    s.lab[s.at(21, y)].y = std::numeric_limits<float>::infinity();
  }
  REQUIRE(s.run(p).ok());
  CHECK(s.worst(p) < 2e-5);
}

TEST_CASE("cross-bilateral: a class that fills a box in the tail of the Gaussian keeps the bound, on all four sides") {
  for (const float sigma : {2.0F, 4.0F}) {
    for (const bool along_rows : {true, false}) {
      for (const bool at_the_end : {true, false}) {
        Scene<std::uint8_t> s(along_rows ? Shape{40, 12} : Shape{12, 40});
        s.depth.assign(s.depth.size(), 0.0F);
        for (int across = 0; across < 12; ++across) {
          for (int i = 0; i < 3; ++i) {
            const int along = at_the_end ? 39 - i : i;
            s.depth[along_rows ? s.at(along, across) : s.at(across, along)] =
                i == 0 ? 120.0F : (i == 1 ? 80.0F : 40.0F);
          }
        }
        CrossBilateralParams p;
        p.use_colour = false;
        p.sigma_s_px = sigma;
        p.radius_px = 40;
        REQUIRE(s.run(p).ok());
        CHECK(s.worst(p) < 1e-6);
        int in_the_tail = 0;
        for (int y = 0; y < s.shape.height; ++y) {
          for (int x = 0; x < s.shape.width; ++x) {
            double weight = 0;
            (void)s.naive(p, x, y, weight);
            in_the_tail += weight > 2e-12 && weight < 1e-9 ? 1 : 0;
          }
        }
        CHECK(in_the_tail >= 12);
      }
    }
  }
}

TEST_CASE("cross-bilateral: 8-bit-quantised depth, and 80 % missing depth, keep the bound") {
  // Inverse depth in 255 steps makes plateaus and jumps; with the colour term and without.
  for (const float holes : {0.0F, 0.8F}) {
    for (const bool quantised : {true, false}) {
      if (!quantised && holes == 0.0F) continue;
      Scene<std::uint8_t> s({72, 40});
      s.randomise(21, holes);
      if (quantised) {
        for (float& z : s.depth) {
          if (z > 0) z = 2.0F * 255.0F / std::max(1.0F, std::round(2.0F / z * 255.0F));
        }
      }
      int missing = 0;
      for (const float z : s.depth) missing += z > 0 ? 0 : 1;
      if (holes > 0) CHECK(missing > 72 * 40 * 3 / 4);
      for (const bool colour : {true, false}) {
        CrossBilateralParams p;
        p.sigma_s_px = 4.0F;
        p.use_colour = colour;
        REQUIRE(s.run(p).ok());
        CHECK(s.worst(p) < (colour ? 3e-6 : 1e-6));
        REQUIRE(s.run(p, FilteredPixels::with_depth).ok());
        int filled = 0;
        for (std::size_t i = 0; i < s.out.size(); ++i) filled += !(s.depth[i] > 0) && s.out[i] != 0.0F ? 1 : 0;
        CHECK(filled == 0);
      }
    }
  }
}

TEST_CASE("cross-bilateral gives the same bits with one lane, with chunks backwards, in place and on strided views") {
  Scene<std::uint8_t> s({45, 23});
  s.randomise(6, 0.2F);
  CrossBilateralParams p;
  p.sigma_s_px = 3.0F;
  REQUIRE(s.run(p).ok());
  const std::vector<float> expected = s.out;
  const npsim_test::BackwardExecutor backward;
  REQUIRE(s.run(p, backward).ok());
  CHECK(s.out == expected);

  s.out.assign(s.out.size(), -1.0F);
  REQUIRE(s.run_scalar(p).ok());
  CHECK(s.out == expected);

  npsim_test::Scratch scratch(cross_bilateral_workspace_bytes(p, s.shape));
  Workspace& workspace = scratch.workspace();
  const SerialExecutor serial;
  std::vector<float> wide(60 * 23, -9.0F);
  std::vector<Vec3f> wide_lab(50 * 23);
  std::vector<std::uint8_t> wide_labels(70 * 23);
  const ImageView<float> z(wide.data() + 4, s.shape, 60);
  const ImageView<Vec3f> lab(wide_lab.data() + 1, s.shape, 50);
  const ImageView<std::uint8_t> labels(wide_labels.data() + 9, s.shape, 70);
  for (int y = 0; y < 23; ++y) {
    for (int x = 0; x < 45; ++x) {
      z(x, y) = s.depth[s.at(x, y)];
      lab(x, y) = s.lab[s.at(x, y)];
      labels(x, y) = s.labels[s.at(x, y)];
    }
  }
  REQUIRE(cross_bilateral(p, z, labels, lab, z, s.result, workspace, serial, FilteredPixels::all).ok());
  for (int y = 0; y < 23; ++y) {
    for (int x = 0; x < 45; ++x) CHECK(z(x, y) == expected[s.at(x, y)]);
    CHECK(wide[static_cast<std::size_t>(y * 60 + 3)] == -9.0F);
    CHECK(wide[static_cast<std::size_t>(y * 60 + 49)] == -9.0F);
  }
}

TEST_CASE("cross-bilateral: the bits depend on neither lanes, threads nor the order of strips, holes or not") {
  for (const float holes : {0.0F, 0.3F}) {
    Scene<std::uint16_t> s({150, 140});  // three strips of rows, three tiles of columns
    s.randomise(11, holes);
    for (std::size_t i = 0; i < s.lab.size(); i += 3) s.lab[i].x += 90.0F;
    for (int y = 40; y < 60; ++y) {
      for (int x = 30; x < 90; ++x) s.lab[s.at(x, y)] = {150, 100, 100};  // blocks far from all others
    }
    CrossBilateralParams p;
    p.radius_px = 9;
    p.max_relative_error = holes > 0 ? 1e-3F : 2e-5F;
    REQUIRE(s.run(p).ok());
    const std::vector<float> expected = s.out;
    CHECK(s.worst(p) <= static_cast<double>(p.max_relative_error));
    ThreadPool pool(4);
    REQUIRE(s.run(p, pool).ok());
    CHECK(s.out == expected);
    const npsim_test::BackwardExecutor backward;
    REQUIRE(s.run(p, backward).ok());
    CHECK(s.out == expected);

    s.out.assign(s.out.size(), -1.0F);
    REQUIRE(s.run_scalar(p).ok());
    CHECK(s.out == expected);
  }
}

TEST_CASE("cross-bilateral takes exactly the workspace it states, and leaves the output alone without it") {
  for (const int variant : {0, 1, 2}) {
    Scene<std::uint8_t> s({70, 20});
    s.randomise(12, 0.1F);
    CrossBilateralParams p;
    if (variant == 1) p.use_labels = false;
    if (variant == 2) p.use_colour = false;
    const std::size_t needed = cross_bilateral_workspace_bytes(p, s.shape);
    std::vector<unsigned char> bytes(needed + 2 * kWorkspaceAlignment, 0xA5);
    unsigned char* aligned = bytes.data();
    while (reinterpret_cast<std::uintptr_t>(aligned) % kWorkspaceAlignment != 0) ++aligned;
    SerialExecutor serial;
    const auto run = [&](std::size_t size) {
      Workspace workspace(aligned, size);
      return cross_bilateral(p, ImageView<const float>(s.depth.data(), s.shape),
                             ImageView<const std::uint8_t>(s.labels.data(), s.shape),
                             ImageView<const Vec3f>(s.lab.data(), s.shape), ImageView<float>(s.out.data(), s.shape),
                             s.result, workspace, serial);
    };
    const std::size_t used = needed - kWorkspaceAlignment;  // the rest is for a pointer that is not aligned
    CHECK(run(used - 1).code() == StatusCode::workspace_exhausted);
    for (const float z : s.out) CHECK(z == -5.0F);
    CHECK(run(used).ok());
    for (std::size_t i = used; i < used + kWorkspaceAlignment; ++i) CHECK(aligned[i] == 0xA5);
  }
}

TEST_CASE("cross-bilateral refuses bad arguments") {
  Scene<std::uint8_t> s({8, 8});
  const auto code = [&](CrossBilateralParams p) { return s.run(p).code(); };
  CrossBilateralParams p;
  p.mu = -1.0F;
  CHECK(code(p) == StatusCode::invalid_argument);
  p.mu = kNaN;
  CHECK(code(p) == StatusCode::invalid_argument);
  p = {};
  p.sigma_s_px = 0.0F;
  CHECK(code(p) == StatusCode::invalid_argument);
  p = {};
  p.sigma_c = kNaN;
  CHECK(code(p) == StatusCode::invalid_argument);
  p = {};
  p.use_labels = false;
  p.use_colour = false;
  CHECK(code(p) == StatusCode::invalid_argument);
  p = {};
  p.max_relative_error = 0.0F;
  CHECK(code(p) == StatusCode::invalid_argument);
  p.max_relative_error = kNaN;
  CHECK(code(p) == StatusCode::invalid_argument);
  for (const float z : s.out) CHECK(z == -5.0F);
  p = {};
  Workspace none;
  SerialExecutor serial;
  const ImageView<const float> z(s.depth.data(), s.shape);
  const ImageView<float> out(s.out.data(), s.shape);
  const ImageView<const std::uint8_t> labels(s.labels.data(), s.shape);
  const ImageView<const Vec3f> lab(s.lab.data(), s.shape);
  CHECK(cross_bilateral(p, z, labels, lab, out, s.result, none, serial).code() == StatusCode::workspace_exhausted);
  CHECK(cross_bilateral(p, z, labels, {}, out, s.result, none, serial).code() == StatusCode::shape_mismatch);
  CHECK(cross_bilateral(p, {}, labels, lab, out, s.result, none, serial).code() == StatusCode::no_valid_input);
}
