// SPDX-License-Identifier: Apache-2.0
// Hard cases of the variance filter, each against the reference: with the variance, without it, and with one lane.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/random.hpp"
#include "npsim/depth/uncertainty.hpp"
#include "reference/uncertainty.hpp"

using namespace npsim;

namespace {

struct Case {
  explicit Case(Shape s) : shape(s), z(s, 10.0F), h(s, label::road) {}

  template <class F>
  void check_with(const UncertaintyParams& p, const reference::Uncertainty& expected, bool with_variance) {
    std::vector<std::uint8_t> mask(shape.pixels(), 7);
    std::vector<std::uint8_t> windows(shape.pixels(), 7);
    std::vector<float> variance(shape.pixels(), -1.0F);
    npsim_test::Scratch scratch(uncertainty_workspace_bytes(p, shape));
    Workspace& workspace = scratch.workspace();
    SerialExecutor serial;
    UncertaintyOutput out{{mask.data(), shape}, {windows.data(), shape}, {variance.data(), shape}};
    if (!with_variance) out.variance_m2 = {};
    REQUIRE(uncertainty<F>(p, z.cview(), h.cview(), out, workspace, serial).ok());
    CHECK(mask == expected.mask);
    CHECK(windows == expected.windows);
    if (!with_variance) return;
    int off = 0;
    for (std::size_t i = 0; i < variance.size(); ++i) {
      const double error = std::abs(static_cast<double>(variance[i]) - expected.variance[i]);
      off += error <= 5e-7 * expected.variance[i] ? 0 : 1;
    }
    CHECK(off == 0);
  }

  // The number of windows that fire.
  int check(const UncertaintyParams& p) {
    CAPTURE(shape.width);
    CAPTURE(shape.height);
    CAPTURE(p.window_px);
    const reference::Uncertainty expected =
        reference::uncertainty(z.view(), h.view(), p.window_px, p.variance_m2, p.foreground);
    for (const bool with_variance : {true, false}) {
      check_with<simd::F32>(p, expected, with_variance);
      check_with<simd::scalar::F32>(p, expected, with_variance);
    }
    int fired = 0;
    for (const std::uint8_t w : expected.windows) fired += w;
    return fired;
  }

  // A slope that no window of 8 takes for an edge, with a thin object and a nearer half.
  void street() {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const bool pole = x % 29 == 11;
        const bool near = x * 3 + y < shape.width;
        z(x, y) = pole ? 4.0F : (near ? 9.0F : 30.0F) + 0.001F * static_cast<float>(y);
        h(x, y) = pole ? label::pole : (near ? label::car : label::building);
      }
    }
  }

  Shape shape;
  npsim_test::Image<float> z;  // depth
  npsim_test::Image<Label> h;  // labels
};

}  // namespace

TEST_CASE("uncertainty: every pixel its own class") {
  Case c({150, 40});
  RandomStream random(31, RandomPurpose::test, 0, 0, 0, 0);
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 150; ++x) {
      c.z(x, y) = 20.0F + random.uniform(-0.055F, 0.055F);  // variance on both sides of the threshold
      c.h(x, y) = static_cast<Label>((x + 8 * y) % kLabelCount);
    }
  }
  UncertaintyParams p;
  const int fired = c.check(p);
  CHECK(fired > 500);
  CHECK(fired < 143 * 33 - 500);
  p.foreground = LabelSet::all();
  c.check(p);
  p.window_px = 3;
  c.check(p);
}

TEST_CASE("uncertainty: widths around the lane count, and around the words and chunks of a strip") {
  for (const int width : {1, 3, 4, 5, 7, 8, 9, 15, 16, 17, 31, 32, 33, 63, 64, 65, 511, 512, 513, 519, 520}) {
    for (const int l : {8, 3}) {
      Case c({width, 19});
      c.street();
      UncertaintyParams p;
      p.window_px = l;
      const int fired = c.check(p);
      CHECK((fired > 0) == (width >= 8 || (l == 3 && width >= 3)));
    }
  }
}

TEST_CASE("uncertainty: 80 % missing depth") {
  for (const int l : {8, 5}) {
    Case c({200, 60});
    c.street();
    RandomStream random(32, RandomPurpose::test, static_cast<std::uint32_t>(l), 0, 0, 0);
    int missing = 0;
    for (float& z : c.z.view().pixels()) {
      if (!(random.uniform() < 0.8F)) continue;
      z = random.uniform() < 0.5F ? 0.0F : std::numeric_limits<float>::quiet_NaN();
      ++missing;
    }
    CHECK(missing > 200 * 60 * 3 / 4);
    UncertaintyParams p;
    p.window_px = l;
    CHECK(c.check(p) > 1000);
  }
}

TEST_CASE("uncertainty: 8-bit-quantised depth, linear and inverse, with the threshold at 0 and between the steps") {
  for (const bool inverse : {false, true}) {
    Case c({160, 50});
    c.street();
    for (int y = 0; y < 50; ++y) {
      for (int x = 0; x < 160; ++x) {
        const float z = c.z(x, y) + 0.02F * static_cast<float>(x);  // the steps run through the surfaces
        c.z(x, y) = inverse ? 2.0F * 255.0F / std::round(2.0F / z * 255.0F) : std::round(z / 80.0F * 255.0F) * 80 / 255;
      }
    }
    for (const double threshold : {0.0, 0.001, 0.02, 0.05}) {
      UncertaintyParams p;
      p.variance_m2 = threshold;
      p.foreground = LabelSet::all();
      const int fired = c.check(p);
      CHECK(fired > 1000);
      CHECK(fired < 153 * 43);
    }
  }
}
