// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/uncertainty.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/random.hpp"
#include "reference/uncertainty.hpp"

using namespace npsim;

namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

struct Images {
  explicit Images(Shape s)
      : shape(s),
        depth(s.pixels(), 10.0F),
        labels(s.pixels(), label::road),
        mask(s.pixels(), 7),
        windows(s.pixels(), 7),
        variance(s.pixels(), -1.0F) {}
  float& z(int x, int y) { return depth[static_cast<std::size_t>(y * shape.width + x)]; }
  Label& h(int x, int y) { return labels[static_cast<std::size_t>(y * shape.width + x)]; }

  template <class F = simd::F32, class Executor>
  Status run(const UncertaintyParams& p, Executor& executor, bool with_variance = true) {
    npsim_test::Scratch scratch(uncertainty_workspace_bytes(p, shape));
    Workspace& workspace = scratch.workspace();
    UncertaintyOutput out{{mask.data(), shape}, {windows.data(), shape}, {variance.data(), shape}};
    if (!with_variance) out.variance_m2 = {};
    const Status status = uncertainty<F>(p, {depth.data(), shape}, {labels.data(), shape}, out, workspace, executor);
    CHECK(workspace.used() == 0);
    return status;
  }
  Status run(const UncertaintyParams& p) {
    SerialExecutor serial;
    return run(p, serial);
  }

  Shape shape;
  std::vector<float> depth;
  std::vector<Label> labels;
  std::vector<std::uint8_t> mask, windows;
  std::vector<float> variance;
};

// Straight from the definition: two passes per window, every pair of labels.
void check_against_naive(Images& im, const UncertaintyParams& p) {
  const int l = p.window_px;
  std::vector<std::uint8_t> mask(im.shape.pixels(), 0);
  for (int y = 0; y < im.shape.height; ++y) {
    for (int x = 0; x < im.shape.width; ++x) {
      long double variance = 0;
      bool edge = false;
      if (x + l <= im.shape.width && y + l <= im.shape.height) {
        std::vector<std::pair<long double, Label>> in;
        for (int j = 0; j < l; ++j) {
          for (int i = 0; i < l; ++i) {
            const float z = im.z(x + i, y + j);
            if (std::isfinite(z) && z > 0) in.emplace_back(static_cast<long double>(z), im.h(x + i, y + j));
          }
        }
        long double mean = 0;
        for (const auto& s : in) mean += s.first;
        if (in.size() > 1) {
          mean /= static_cast<long double>(in.size());
          for (const auto& s : in) variance += (s.first - mean) * (s.first - mean);
          variance /= static_cast<long double>(in.size());
        }
        for (const auto& s : in) {
          for (const auto& t : in) {
            if (s.second != t.second && p.foreground.contains(s.second)) edge = true;
          }
        }
      }
      const std::size_t at = static_cast<std::size_t>(y * im.shape.width + x);
      const auto got = static_cast<long double>(im.variance[at]);
      CHECK(got >= 0);
      CHECK(std::abs(got - variance) <= 1e-7L * variance);  // the output is rounded to float
      const bool fires = edge && variance > static_cast<long double>(p.variance_m2);
      CHECK(static_cast<bool>(im.windows[at]) == fires);
      if (!fires) continue;
      for (int j = 0; j < l; ++j) {
        for (int i = 0; i < l; ++i) mask[static_cast<std::size_t>((y + j) * im.shape.width + x + i)] = 1;
      }
    }
  }
  CHECK(mask == im.mask);
}

}  // namespace

TEST_CASE("uncertainty equals the definition on random images: holes, every window size, odd shapes") {
  for (const int l : {1, 2, 3, 8, 11}) {
    for (const Shape shape : {Shape{1, 40}, Shape{40, 1}, Shape{7, 9}, Shape{8, 8}, Shape{37, 41}, Shape{33, 18}}) {
      Images im(shape);
      RandomStream random(1, RandomPurpose::test, static_cast<std::uint32_t>(l), 0,
                          static_cast<std::uint32_t>(shape.width), static_cast<std::uint32_t>(shape.height));
      for (int y = 0; y < shape.height; ++y) {
        for (int x = 0; x < shape.width; ++x) {
          im.z(x, y) = 40.0F + random.uniform(-0.05F, 0.06F);
          if (random.uniform() < 0.3F) im.z(x, y) = random.uniform() < 0.5F ? kNaN : -1.0F;
          im.h(x, y) = x / 9 + y / 7 == 2 ? label::pole : (x > y ? label::road : label::building);
        }
      }
      UncertaintyParams p;
      p.window_px = l;
      REQUIRE(im.run(p).ok());
      check_against_naive(im, p);
      const auto mask = im.mask;
      const npsim_test::BackwardExecutor backward;
      REQUIRE(im.run(p, backward).ok());
      CHECK(mask == im.mask);
    }
  }
}

TEST_CASE("variance of 80 m +- 1 mm, and a step from 2 m to 80 m followed by a flat stretch") {
  Images im({64, 20});
  RandomStream random(2, RandomPurpose::test, 0, 0, 0, 0);
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 64; ++x) {
      im.z(x, y) = x < 20 ? 2.0F : 80.0F + random.uniform(-0.001F, 0.001F);
      im.h(x, y) = (x + y) % 2 == 0 ? label::car : label::road;  // every window passes on labels
    }
  }
  UncertaintyParams p;
  p.variance_m2 = 3.5e-7;
  REQUIRE(im.run(p).ok());
  check_against_naive(im, p);
  for (int x = 10; x <= 56; ++x) {  // the bound that the header states, before rounding to float
    long double mean = 0;
    long double variance = 0;
    for (int i = 0; i < 64; ++i) mean += static_cast<long double>(im.z(x + i % 8, i / 8)) / 64;
    for (int i = 0; i < 64; ++i) {
      const long double e = static_cast<long double>(im.z(x + i % 8, i / 8)) - mean;
      variance += e * e / 64;
    }
    const double got = depth_detail::window_variance(ImageView<const float>(im.depth.data() + x, {8, 8}, 64));
    CHECK(std::abs(static_cast<long double>(got) - variance) <= 1e-12L * variance);
  }
  CHECK(im.variance[static_cast<std::size_t>(5 * 64 + 40)] > 1e-7F);
  CHECK(im.variance[static_cast<std::size_t>(5 * 64 + 40)] < 1e-6F);
}

TEST_CASE("variance a millionth above or below the threshold is decided rightly; equality does not fire") {
  Images im({8, 8});
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 8; ++x) {
      im.z(x, y) = x < 4 ? 4.0F : 4.5F;  // variance exactly 1/16
      im.h(x, y) = x < 4 ? label::car : label::road;
    }
  }
  UncertaintyParams p;
  p.variance_m2 = 0.0625;
  REQUIRE(im.run(p).ok());
  CHECK(std::count(im.mask.begin(), im.mask.end(), 1) == 0);
  p.variance_m2 = 0.0625 * (1 - 1e-6);
  REQUIRE(im.run(p).ok());
  CHECK(std::count(im.mask.begin(), im.mask.end(), 1) == 64);
  p.variance_m2 = 0.0625 * (1 + 1e-6);
  REQUIRE(im.run(p).ok());
  CHECK(std::count(im.mask.begin(), im.mask.end(), 1) == 0);
}

TEST_CASE("labels: one class never fires, two background classes never, one foreground pixel does") {
  Images im({24, 16});
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 24; ++x) im.z(x, y) = x < 12 ? 5.0F : 50.0F;
  }
  const UncertaintyParams p;
  im.labels.assign(im.labels.size(), label::car);
  REQUIRE(im.run(p).ok());
  CHECK(std::count(im.mask.begin(), im.mask.end(), 0) == 24 * 16);
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 24; ++x) im.h(x, y) = x < 12 ? label::building : label::sky;
  }
  REQUIRE(im.run(p).ok());
  CHECK(std::count(im.mask.begin(), im.mask.end(), 0) == 24 * 16);
  im.h(12, 8) = label::pole;
  REQUIRE(im.run(p).ok());
  check_against_naive(im, p);
  CHECK(std::count(im.mask.begin(), im.mask.end(), 1) > 64);
  im.h(12, 8) = 200;  // an id outside Cityscapes counts as unlabeled, which is no foreground
  REQUIRE(im.run(p).ok());
  CHECK(std::count(im.mask.begin(), im.mask.end(), 1) == 0);
}

TEST_CASE("one valid pixel, all invalid and a column of NaN do not fire by themselves") {
  Images im({16, 16});
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) im.h(x, y) = x < 8 ? label::car : label::road;
  }
  const UncertaintyParams p;
  for (int y = 0; y < 16; ++y) im.z(7, y) = kNaN;
  REQUIRE(im.run(p).ok());
  CHECK(std::count(im.mask.begin(), im.mask.end(), 0) == 256);
  im.depth.assign(256, 0.0F);
  REQUIRE(im.run(p).ok());
  CHECK(std::count(im.mask.begin(), im.mask.end(), 0) == 256);
  im.z(9, 9) = 3;
  REQUIRE(im.run(p).ok());
  CHECK(std::count(im.mask.begin(), im.mask.end(), 0) == 256);
}

TEST_CASE("uncertainty on strided sub-views writes inside them only, and outputs may be left out") {
  Images im({40, 24});
  RandomStream random(4, RandomPurpose::test, 0, 0, 0, 0);
  for (float& z : im.depth) z = random.uniform(3, 4);
  for (Label& h : im.labels) h = random.uniform() < 0.1F ? label::person : label::road;
  const UncertaintyParams p;
  const Shape part{21, 13};
  npsim_test::Scratch scratch(uncertainty_workspace_bytes(p, part));
  Workspace& workspace = scratch.workspace();
  SerialExecutor executor;
  const ImageView<float> z(im.depth.data(), im.shape);
  const ImageView<Label> h(im.labels.data(), im.shape);
  const ImageView<std::uint8_t> mask(im.mask.data(), im.shape);
  REQUIRE(
      uncertainty(p, z.sub(5, 6, part), h.sub(5, 6, part), {mask.sub(5, 6, part), {}, {}}, workspace, executor).ok());
  Images copy(part);
  for (int y = 0; y < part.height; ++y) {
    for (int x = 0; x < part.width; ++x) {
      copy.z(x, y) = z(x + 5, y + 6);
      copy.h(x, y) = h(x + 5, y + 6);
    }
  }
  REQUIRE(copy.run(p).ok());
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 40; ++x) {
      const bool inside = x >= 5 && x < 26 && y >= 6 && y < 19;
      CHECK(mask(x, y) == (inside ? copy.mask[static_cast<std::size_t>((y - 6) * 21 + x - 5)] : 7));
    }
  }
}

namespace {

// Depth and labels that take every path: flat stretches, slopes, steps from 2 m to 80 m, noise, labels in patches.
Images varied(Shape shape, std::uint32_t seed, float holes) {
  Images im(shape);
  RandomStream random(7, RandomPurpose::test, seed, 0, 0, 0);
  const Label classes[] = {label::road, label::building, label::pole, label::car, label::sky, 77};
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const int patch = x / 37 + 5 * (y / 23);
      float z = patch % 4 == 0 ? 2.0F : (patch % 4 == 1 ? 80.0F : 10.0F + 0.01F * static_cast<float>(x + y));
      z += random.uniform(-1.0F, 1.0F) * (patch % 3 == 0 ? 0.001F : 0.06F);
      if (random.uniform() < holes) z = random.uniform() < 0.5F ? kNaN : 0.0F;
      im.z(x, y) = z;
      im.h(x, y) = classes[(x / 61 + y / 45 * 2) % 6];
    }
  }
  return im;
}

}  // namespace

TEST_CASE(
    "uncertainty over many tiles equals the reference; one lane, any order of chunks and no outputs but the mask") {
  for (const int l : {8, 3, 16, 17, 70}) {
    for (const float holes : {0.0F, 0.002F, 0.8F}) {
      const Shape shape = l == 8 ? Shape{1111, 67} : Shape{303, 100};
      Images im = varied(shape, static_cast<std::uint32_t>(l), holes);
      UncertaintyParams p;
      p.window_px = l;
      const reference::Uncertainty expected =
          reference::uncertainty({im.depth.data(), shape}, {im.labels.data(), shape}, l, p.variance_m2, p.foreground);
      REQUIRE(im.run(p).ok());
      CHECK(im.mask == expected.mask);
      CHECK(im.windows == expected.windows);
      double worst = 0;
      for (std::size_t i = 0; i < im.variance.size(); ++i) {
        const double off = std::abs(static_cast<double>(im.variance[i]) - expected.variance[i]);
        worst = std::max(worst, expected.variance[i] > 0 ? off / expected.variance[i] : (off > 0 ? 1.0 : 0.0));
      }
      CHECK(worst <= 5e-7);
      const auto variance = im.variance;
      npsim_test::BackwardExecutor backward;
      REQUIRE(im.run<simd::scalar::F32>(p, backward).ok());
      CHECK(im.mask == expected.mask);
      CHECK(im.variance == variance);
      im.windows.assign(im.windows.size(), 7);
      REQUIRE(im.run(p, backward, false).ok());  // the fast path, where l is 8
      CHECK(im.mask == expected.mask);
      CHECK(im.windows == expected.windows);
      REQUIRE(im.run<simd::scalar::F32>(p, backward, false).ok());
      CHECK(im.mask == expected.mask);
    }
  }
}

TEST_CASE("no wrong decision at 80 m +- 1 mm and none a millionth from the threshold, with the threshold anywhere") {
  const Shape shape{260, 40};
  Images im(shape);
  RandomStream random(12, RandomPurpose::test, 0, 0, 0, 0);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      im.z(x, y) = x < 30 ? 2.0F : 80.0F + random.uniform(-0.001F, 0.001F);
      im.h(x, y) = static_cast<Label>((7 * x + 13 * y) % kLabelCount);  // every pixel has its own class
    }
  }
  UncertaintyParams p;
  p.foreground = LabelSet::all();
  const reference::Uncertainty exact =
      reference::uncertainty({im.depth.data(), shape}, {im.labels.data(), shape}, 8, 0, p.foreground);
  SerialExecutor serial;
  int textbook_wrong = 0;
  int decided = 0;
  for (int k = 0; k < 12; ++k) {
    const std::size_t chosen = static_cast<std::size_t>((3 + 2 * k) * shape.width + 40 + 15 * k);
    for (const double factor : {1 - 1e-6, 1.0, 1 + 1e-6}) {
      p.variance_m2 = exact.variance[chosen] * factor;
      REQUIRE(im.run(p, serial, false).ok());
      int wrong = 0;
      for (std::size_t i = 0; i < im.windows.size(); ++i) {
        if (std::abs(exact.variance[i] - p.variance_m2) <= 1e-9 * p.variance_m2) continue;
        if (exact.edge[i] == 0) continue;
        ++decided;
        if (im.windows[i] != (exact.variance[i] > p.variance_m2 ? 1 : 0)) ++wrong;
      }
      CHECK(wrong == 0);
    }
    // What single precision makes of the mean square less the squared mean there.
    for (int x = 31; x + 8 < shape.width; ++x) {
      float sum = 0;
      float squares = 0;
      for (int i = 0; i < 64; ++i) {
        const float z = im.z(x + i % 8, 2 * k + i / 8);
        sum += z;
        squares += z * z;
      }
      const float variance = squares / 64 - (sum / 64) * (sum / 64);
      const double truth = exact.variance[static_cast<std::size_t>(2 * k * shape.width + x)];
      textbook_wrong += (static_cast<double>(variance) > p.variance_m2) != (truth > p.variance_m2) ? 1 : 0;
    }
  }
  CHECK(decided > 250000);
  CHECK(textbook_wrong > 500);  // of 2,650: the case is as hard as it is meant to be
}

TEST_CASE("merged moments know the standard deviation within the stated bound, and seldom doubt") {
  using F = simd::F32;
  const Shape shape{140, 24};
  for (const float spread : {0.0F, 1e-3F, 0.05F, 1.0F, 70.0F}) {
    Images im(shape);
    RandomStream random(13, RandomPurpose::test, 0, 0, 0, 0);
    for (float& z : im.depth) z = 80.0F + random.uniform(-spread, spread);
    const reference::Uncertainty exact =
        reference::uncertainty({im.depth.data(), shape}, {im.labels.data(), shape}, 8, 0, LabelSet::all());
    depth_detail::MergedMoments<F> moments;
    REQUIRE(moments.read({im.depth.data(), shape}, {2, 0, 128, 16}, {~std::uint64_t{0}, ~std::uint64_t{0}}, false));
    int doubts = 0;
    int wrong = 0;
    int thresholds = 0;
    for (int y = 0; y < 16; ++y) {
      for (int x = 0; x < 128; x += 9) {
        // Twice the bound of the header from a window's own standard deviation: it must be certain, and right.
        const double variance = exact.variance[static_cast<std::size_t>(y * shape.width + 2 + x)];
        const double sigma = std::sqrt(variance);
        const double bound = 2 * 16 * 0x1p-24 * (2.0 * static_cast<double>(spread) + 1.01 * sigma) + 1e-12;
        for (const double side : {-1.0, 1.0}) {
          const double limit = sigma + side * bound;
          if (limit < 0) continue;
          moments.set_threshold(limit * limit);
          depth_detail::VarianceBits bits;
          moments.decide(y, 0, 127, bits);
          const auto bit = [x](const std::uint64_t(&word)[2]) { return (word[x / 64] >> (x % 64) & 1U) != 0; };
          const bool is_sure = bit(bits.above) != bit(bits.below);
          doubts += is_sure ? 0 : 1;
          wrong += is_sure && bit(bits.above) != (side < 0) ? 1 : 0;
          ++thresholds;
        }
      }
    }
    CHECK(thresholds > 200);
    CHECK(doubts == 0);
    CHECK(wrong == 0);
  }
}

TEST_CASE("counted moments know the standard deviation among holes within the stated bound, and seldom doubt") {
  using F = simd::F32;
  const Shape shape{75, 24};
  for (const float holes : {0.0F, 0.02F, 0.5F, 0.97F}) {
    for (const float spread : {0.0F, 1e-3F, 0.05F, 1.0F, 79.0F}) {
      Images im(shape);
      RandomStream random(15, RandomPurpose::test, 0, 0, 0, 0);
      for (float& z : im.depth) {
        z = 80.0F + random.uniform(-spread, spread);
        if (random.uniform() < holes) z = random.uniform() < 0.3F ? kNaN : (random.uniform() < 0.5F ? -3.0F : 0.0F);
      }
      for (int x = 20; x < 25; ++x) im.z(x, 9) = std::numeric_limits<float>::infinity();
      const reference::Uncertainty exact =
          reference::uncertainty({im.depth.data(), shape}, {im.labels.data(), shape}, 8, 0, LabelSet::all());
      depth_detail::CountedMoments<F> moments;
      REQUIRE(moments.read({im.depth.data(), shape}, {3, 0, 64, 16}, 0, 63));
      int doubts = 0;
      int wrong = 0;
      int thresholds = 0;
      for (int y = 0; y < 16; ++y) {
        for (int x = 0; x < 64; x += 5) {
          const double sigma = std::sqrt(exact.variance[static_cast<std::size_t>(y * shape.width + 3 + x)]);
          const bool lonely = sigma == 0;  // perhaps no valid pixel: always in doubt
          const double bound = 2 * 24 * 0x1p-24 * (2.0 * static_cast<double>(spread) + 1.01 * sigma) + 1e-12;
          for (const double side : {-1.0, 1.0}) {
            const double limit = sigma + side * bound;
            if (limit < 0) continue;
            moments.set_threshold(limit * limit);
            std::uint64_t above = 0;
            std::uint64_t doubtful = 0;
            moments.decide(y, 0, 63, above, doubtful);
            const bool is_doubtful = (doubtful >> x & 1U) != 0;
            doubts += is_doubtful && !lonely ? 1 : 0;
            wrong += !is_doubtful && ((above >> x & 1U) != 0) != (side < 0) ? 1 : 0;
            ++thresholds;
          }
        }
      }
      CHECK(thresholds > 200);
      CHECK(doubts == 0);
      CHECK(wrong == 0);
      int misread = 0;
      for (int y = 0; y < 23; ++y) {
        for (int x = 0; x < 71; ++x) {
          const bool valid = (moments.valid(y)[x / 64] >> (x % 64) & 1U) != 0;
          misread += valid != is_valid_depth(im.z(x + 3, y)) ? 1 : 0;
        }
      }
      CHECK(misread == 0);
    }
  }
}

TEST_CASE("a sky without depth behind poles: only what is valid counts, in every position of the border") {
  for (const int width : {8, 9, 70, 71, 72, 135, 136, 137, 200}) {
    const Shape shape{width, 41};
    Images im(shape);
    RandomStream random(16, RandomPurpose::test, static_cast<std::uint32_t>(width), 0, 0, 0);
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < width; ++x) {
        const bool pole = x % 23 == 7;
        const bool sky = y < 20 + x % 7 && !pole;
        im.h(x, y) = pole ? label::pole : (sky ? label::sky : label::building);
        im.z(x, y) = sky ? 0.0F : (pole ? 8.0F + 0.03F * random.uniform() : 8.0F + 0.1F * random.uniform());
      }
    }
    const UncertaintyParams p;
    const reference::Uncertainty expected =
        reference::uncertainty({im.depth.data(), shape}, {im.labels.data(), shape}, 8, p.variance_m2, p.foreground);
    SerialExecutor serial;
    REQUIRE(im.run(p, serial, false).ok());
    CHECK(im.mask == expected.mask);
    CHECK(im.windows == expected.windows);
    REQUIRE(im.run<simd::scalar::F32>(p, serial, false).ok());
    CHECK(im.windows == expected.windows);
  }
}

TEST_CASE("classes that touch at one corner, depth near 0 and depth near the largest float") {
  Images im({24, 24});
  for (int y = 0; y < 24; ++y) {
    for (int x = 0; x < 24; ++x) im.h(x, y) = (x < 12) == (y < 12) ? label::car : label::road;
  }
  UncertaintyParams p;
  for (const float scale : {1e-44F, 1e-25F, 1e-12F, 1.0F, 1e14F, 1e16F, 3e38F}) {
    for (const int l : {2, 8}) {
      p.window_px = l;
      for (const double threshold : {0.0, 0.01, 1e30}) {
        p.variance_m2 = threshold;
        for (int y = 0; y < 24; ++y) {
          for (int x = 0; x < 24; ++x) im.z(x, y) = scale * (x + y < 24 ? 0.5F : 1.0F);
        }
        SerialExecutor serial;
        REQUIRE(im.run(p, serial, false).ok());
        const reference::Uncertainty expected = reference::uncertainty(
            {im.depth.data(), im.shape}, {im.labels.data(), im.shape}, l, threshold, p.foreground);
        CHECK(im.mask == expected.mask);
        if (threshold == 0.0 && l == 2) CHECK(im.windows[11 * 24 + 11] == 1);  // the corner itself
      }
    }
  }
}

TEST_CASE("bits are widened as pixel loops would, for every window") {
  RandomStream random(14, RandomPurpose::test, 0, 0, 0, 0);
  for (int l = 1; l <= 256; ++l) {
    std::vector<std::uint64_t> bits(7);
    std::vector<int> expected(7 * 64, 0);
    for (int k = 0; k < 2; ++k) {
      const int at = static_cast<int>(random.uniform(0, 447));
      bits[static_cast<std::size_t>(at / 64)] |= std::uint64_t{1} << (at % 64);
      for (int i = at; i < std::min(at + l, 448); ++i) expected[static_cast<std::size_t>(i)] = 1;
    }
    depth_detail::widen_bits(bits.data(), 7, l);
    int wrong = 0;
    for (std::size_t i = 0; i < expected.size(); ++i)
      wrong += static_cast<int>(bits[i / 64] >> (i % 64) & 1U) != expected[i];
    CHECK(wrong == 0);
  }
}

TEST_CASE("uncertainty refuses bad arguments") {
  Images im({16, 16});
  UncertaintyParams p;
  p.window_px = 0;
  CHECK(im.run(p).code() == StatusCode::invalid_argument);
  p = {};
  p.variance_m2 = std::numeric_limits<double>::quiet_NaN();
  CHECK(im.run(p).code() == StatusCode::invalid_argument);
  p = {};
  SerialExecutor executor;
  Workspace none;
  CHECK(uncertainty(p, {im.depth.data(), im.shape}, {im.labels.data(), im.shape}, {}, none, executor).code() ==
        StatusCode::workspace_exhausted);
  CHECK(uncertainty(p, {im.depth.data(), im.shape}, {im.labels.data(), {16, 15}}, {}, none, executor).code() ==
        StatusCode::shape_mismatch);
  CHECK(uncertainty(p, {}, {im.labels.data(), {16, 15}}, {}, none, executor).code() == StatusCode::no_valid_input);
}

// What bits of neighbours say against the least and the greatest code of each window, a few odd pixels in each tile.
TEST_CASE("uncertainty: edges by neighbours are those by extremes") {
  using F = simd::F32;
  RandomStream random(14, RandomPurpose::test, 0, 0, 0, 0);
  const auto below = [&](int n) { return static_cast<int>(random.uniform(0.0F, static_cast<float>(n) - 0.001F)); };
  static depth_detail::StripCodes codes;
  int found = 0;
  int missing = 0;
  int wrong = 0;
  for (int round = 0; round < 200; ++round) {
    for (auto& row : codes.row) std::fill(std::begin(row), std::end(row), std::uint8_t{7});
    for (int i = below(60); i >= 0; --i)
      codes.row[below(23)][below(640)] = static_cast<std::uint8_t>(below(2) == 0 ? 8 : depth_detail::kForegroundCode);
    const int column = 128 * below(4);
    const int height = 1 + below(16);
    const int count = below(3) == 0 ? 1 + below(64) : 64;
    const std::uint64_t columns[2] = {static_cast<std::uint64_t>(below(4)), 1};
    const depth_detail::EdgeWindows<F> windows(codes, column, height, columns);
    for (int w = 0; w < 2; ++w) {
      if (columns[w] == 0) continue;
      std::uint64_t edges[depth_detail::EdgeWindows<F>::kHeight];
      windows.word(w, count, edges);
      const auto row = [&](int y) { return codes.row[y] + column + 64 * w; };
      std::uint64_t expected[16];
      depth_detail::edge_windows_8<F>(row, row, count, height, expected);
      for (int y = 0; y < height; ++y) {
        wrong += edges[y] == expected[y] ? 0 : 1;
        (expected[y] != 0 ? found : missing) += 1;
      }
    }
  }
  CHECK(wrong == 0);
  CHECK(found > 500);
  CHECK(missing > 100);
}
