// SPDX-License-Identifier: Apache-2.0
// IoU and uncertainty-aware IoU: the definitions by sets of pixels, cases counted by hand, several images as one.
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>

#include "npsim/metrics/segmentation_errors.hpp"
#include "unit/fixture.hpp"

using namespace npsim;

namespace {

using Plane = npsim_test::Image<std::uint8_t>;
using Confidence = npsim_test::Image<float>;
constexpr std::uint8_t kNone = 255;

struct Case {
  Plane truth;
  Plane prediction;
  Plane invalid;
  Confidence confidence;
};

Case random_case(Shape shape, int classes, unsigned seed) {
  std::mt19937 random(seed);
  const auto draw = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  Case c{Plane(shape, 0, 3), Plane(shape, 0, 1), Plane(shape, 0, 2), Confidence(shape, 0, 5)};
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const int t = draw(classes + 1);
      c.truth(x, y) = t == classes ? kNone : static_cast<std::uint8_t>(t);
      const int p = draw(3) == 0 ? draw(classes + 1) : t;
      c.prediction(x, y) = p == classes ? kNone : static_cast<std::uint8_t>(p);
      c.invalid(x, y) = draw(4) == 0 ? static_cast<std::uint8_t>(1 + draw(255)) : std::uint8_t{0};
      const float sure = static_cast<float>(draw(101)) / 100;
      c.confidence(x, y) = draw(20) == 0 ? std::numeric_limits<float>::quiet_NaN() : sure;
    }
  }
  return c;
}

struct Shares {
  double iou, uiou;
};

// By its sets, pixel by pixel and class by class.
Shares by_sets(const Case& c, int cls, float threshold) {
  int tp = 0, fp = 0, fn = 0, ti = 0, fi = 0;
  for (int y = 0; y < c.truth.shape().height; ++y) {
    for (int x = 0; x < c.truth.shape().width; ++x) {
      const int t = c.truth(x, y);
      if (t == kNone) continue;
      const bool given_up = c.prediction(x, y) == kNone || !(c.confidence(x, y) >= threshold);
      const int p = given_up ? -1 : c.prediction(x, y);
      tp += t == cls && p == cls;
      fp += t != cls && p == cls;
      fn += t == cls && p != cls && p >= 0;
      ti += t == cls && given_up && c.invalid(x, y) != 0;
      fi += t == cls && given_up && c.invalid(x, y) == 0;
    }
  }
  const double all = tp + fp + fn + ti + fi;
  return {tp / all, (tp + ti) / all};
}

}  // namespace

TEST_CASE("segmentation errors: equal to the definition by sets, with padding, void and NaN confidence") {
  constexpr int kClasses = 5;
  for (const float threshold : {0.0F, 0.3F, 1.0F}) {
    const Case c = random_case({61, 37}, kClasses, 7);
    SegmentationCounts counts(kClasses);
    REQUIRE(counts.add(c.prediction.view(), c.truth.view(), c.invalid.view(), c.confidence.view(), threshold).ok());
    double iou = 0;
    double uiou = 0;
    for (int cls = 0; cls < kClasses; ++cls) {
      const Shares expected = by_sets(c, cls, threshold);
      CHECK(counts.iou(static_cast<std::size_t>(cls)) == expected.iou);
      CHECK(counts.uiou(static_cast<std::size_t>(cls)) == expected.uiou);
      iou += expected.iou / kClasses;
      uiou += expected.uiou / kClasses;
    }
    CHECK(counts.mean_iou() == doctest::Approx(iou).epsilon(1e-14));
    CHECK(counts.mean_uiou() == doctest::Approx(uiou).epsilon(1e-14));
  }
}

TEST_CASE("segmentation errors: a case counted by hand") {
  // truth     0 0 0 0 1 1 1 void     invalid where marked *
  // predicted 0 1 - -* 1 0* -* 0
  const Plane truth({8, 1}, {0, 0, 0, 0, 1, 1, 1, kNone});
  const Plane prediction({8, 1}, {0, 1, kNone, kNone, 1, 0, kNone, 0});
  const Plane invalid({8, 1}, {0, 0, 0, 1, 0, 1, 1, 0});
  SegmentationCounts counts(2);
  REQUIRE(counts.add(prediction.view(), truth.view(), invalid.view()).ok());
  // Class 0: TP 1, FN 1, FI 1, TI 1, FP 1.  Class 1: TP 1, FP 1, FN 1, TI 1.
  CHECK(counts.iou(0) == 1.0 / 5);
  CHECK(counts.uiou(0) == 2.0 / 5);
  CHECK(counts.iou(1) == 1.0 / 4);
  CHECK(counts.uiou(1) == 2.0 / 4);
  CHECK(counts.true_invalid(0) == 1);
  CHECK(counts.false_invalid(0) == 1);
  CHECK(counts.predicted_as(1, 0) == 1);
}

TEST_CASE("segmentation errors: giving up on what is invalid and wrong raises UIoU, on what is valid it lowers it") {
  const Plane truth({4, 1}, {0, 0, 0, 0});
  const Plane invalid({4, 1}, {1, 1, 0, 0});
  const Plane wrong({4, 1}, {1, 1, 0, 0});
  const Plane gives_up_invalid({4, 1}, {kNone, kNone, 0, 0});
  const Plane gives_up_valid({4, 1}, {1, 1, kNone, kNone});
  const auto uiou = [&](const Plane& prediction) {
    SegmentationCounts counts(2);
    REQUIRE(counts.add(prediction.view(), truth.view(), invalid.view()).ok());
    return counts.uiou(0);
  };
  CHECK(uiou(wrong) == 0.5);
  CHECK(uiou(gives_up_invalid) == 1.0);
  CHECK(uiou(gives_up_valid) == 0.0);
}

TEST_CASE("segmentation errors: without invalid predictions UIoU is IoU, whatever the mask says") {
  Case c = random_case({40, 40}, 4, 3);
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 40; ++x) c.prediction(x, y) = static_cast<std::uint8_t>(c.prediction(x, y) % 4);
  }
  SegmentationCounts counts(4);
  REQUIRE(counts.add(c.prediction.view(), c.truth.view(), c.invalid.view()).ok());
  CHECK(counts.mean_uiou() == counts.mean_iou());
}

TEST_CASE("segmentation errors: images one after the other count as one, not as a mean of means") {
  const Plane truth_a({3, 1}, {0, 0, 1});
  const Plane truth_b({1, 1}, {1});
  const Plane prediction_a({3, 1}, {0, 1, 1});
  const Plane prediction_b({1, 1}, {0});
  SegmentationCounts counts(3);
  REQUIRE(counts.add(prediction_a.view(), truth_a.view()).ok());
  REQUIRE(counts.add(prediction_b.view(), truth_b.view()).ok());
  CHECK(counts.iou(0) == 1.0 / 3);
  CHECK(counts.iou(1) == 1.0 / 3);
  CHECK(std::isnan(counts.iou(2)));  // occurs nowhere and is not part of the mean
  CHECK(counts.mean_iou() == doctest::Approx(1.0 / 3));
}

TEST_CASE("segmentation errors: a truth without any class has no mean; shapes must agree") {
  const Plane none({2, 2}, kNone);
  const Plane other({2, 1}, std::uint8_t{0});
  SegmentationCounts counts(19);
  REQUIRE(counts.add(none.view(), none.view()).ok());
  CHECK(std::isnan(counts.mean_iou()));
  CHECK(std::isnan(counts.mean_uiou()));
  CHECK(counts.add(other.view(), none.view()).code() == StatusCode::shape_mismatch);
  CHECK(counts.add(none.view(), none.view(), other.view()).code() == StatusCode::shape_mismatch);
  CHECK(counts.add(none.view(), none.view(), {}, Confidence({1, 1}).view()).code() == StatusCode::shape_mismatch);
  CHECK(counts.add({}, {}).code() == StatusCode::no_valid_input);
}
