// SPDX-License-Identifier: Apache-2.0
// A night at its photograph's size: each pixel is lit as the small pixels are that it belongs to, and keeps its own
// texture.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/pipeline/enlarge_night.hpp"

namespace {

using namespace npsim;
using npsim_test::Image;

struct Day {
  Image<Rgb8> image;
  Image<Label> labels;
  Image<std::uint16_t> lamps;

  explicit Day(Shape shape) : image(shape, Rgb8{120, 120, 120}), labels(shape, label::road), lamps(shape) {}
  [[nodiscard]] DayView view() const { return {image.view(), labels.view(), lamps.view()}; }
};

// Both sizes, the small one a third.
struct Pair {
  Day small, full;
  Image<Vec3f> night, out;

  Pair(Shape from, Shape to) : small(from), full(to), night(from, Vec3f{1, 1, 1}), out(to) {}
  Pair() : Pair({20, 12}, {60, 36}) {}
  void enlarge(const EnlargeNightParams& params = {}) {
    SerialExecutor serial;
    REQUIRE(enlarge_night(params, small.view(), night.cview(), full.view(), out.view(), serial).ok());
  }
};

double decoded(int code) {
  const double v = code / 255.0;
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

double day_luminance(const Rgb8& c) {
  return 0.2126 * decoded(c.r) + 0.7152 * decoded(c.g) + 0.0722 * decoded(c.b);
}

double spline(double t) {
  t = std::fabs(t);
  return t < 0.5 ? 0.75 - t * t : (t < 1.5 ? 0.5 * (1.5 - t) * (1.5 - t) : 0.0);
}

// The formula, over every small pixel, for pixels whose neighbours lie within the picture.
double reference(const Pair& p, const EnlargeNightParams& params, int x, int y) {
  const auto scale = [](int i, int from, int to) { return (i + 0.5) * from / to - 0.5; };
  const double px = scale(x, p.night.shape().width, p.out.shape().width);
  const double py = scale(y, p.night.shape().height, p.out.shape().height);
  const Rgb8 c = p.full.image(x, y);
  double sum = 0;
  double weights = 0;
  for (int pass = 0; pass < (p.full.lamps(x, y) != 0 ? 1 : 2) && !(weights > 0); ++pass) {
    for (int qy = 0; qy < p.night.shape().height; ++qy) {
      for (int qx = 0; qx < p.night.shape().width; ++qx) {
        const int lamp = p.full.lamps(x, y);
        const bool same = lamp == p.small.lamps(qx, qy) && (lamp != 0 || p.full.labels(x, y) == p.small.labels(qx, qy));
        const double near = spline(px - qx) * spline(py - qy);
        if (!(near > 0) || (pass == 0 && !same)) continue;
        const Rgb8 q = p.small.image(qx, qy);
        double unlike = 0;
        for (const int d : {c.r - q.r, c.g - q.g, c.b - q.b}) unlike += d * d / (255.0 * 255.0);
        const double k = static_cast<double>(params.likeness);
        const double w = near / std::pow(1 + unlike / (k * k), 2);
        const double dark = static_cast<double>(params.dark);
        const double most = static_cast<double>(params.most_detail);
        double r = std::clamp((day_luminance(c) + dark) / (day_luminance(q) + dark), 1 / most, most);
        if (p.small.labels(qx, qy) == label::sky || lamp != 0) r = 1;
        sum += w * r * static_cast<double>(p.night(qx, qy).y);
        weights += w;
      }
    }
  }
  return weights > 0 ? sum / weights : -1.0;  // of a lamp that is nowhere near
}

}  // namespace

TEST_CASE("enlarged night: agrees with the formula in double precision, sides in no whole ratio, four classes, lamps") {
  std::mt19937 random(7);
  const auto below = [&](unsigned n) { return static_cast<int>(random() % n); };
  Pair p({23, 17}, {61, 40});
  const Label classes[] = {label::road, label::building, label::sky, label::car};
  for (Day* day : {&p.small, &p.full}) {
    for (int y = 0; y < day->image.shape().height; ++y) {
      for (int x = 0; x < day->image.shape().width; ++x) {
        const auto code = [&] { return static_cast<std::uint8_t>(below(256)); };
        day->image(x, y) = {code(), code(), code()};
        day->labels(x, y) = classes[below(4)];
        day->lamps(x, y) = static_cast<std::uint16_t>(below(8) == 0 ? 1 + below(2) : 0);
      }
    }
  }
  for (int y = 0; y < 17; ++y) {
    for (int x = 0; x < 23; ++x) p.night(x, y) = Vec3f{0, std::exp(static_cast<float>(below(12)) - 6.0F), 0};
  }
  const EnlargeNightParams params{0.2F, 3.0F, 0.01F};
  p.enlarge(params);
  double worst = 0;
  for (int y = 4; y < 36; ++y) {
    for (int x = 4; x < 57; ++x) {
      const double right = reference(p, params, x, y);
      if (right < 0) continue;
      worst = std::max(worst, std::fabs(static_cast<double>(p.out(x, y).y) - right) / right);
    }
  }
  CHECK(worst < 2e-6);
}

TEST_CASE("enlarged night: even light under an even photograph stays as it is, up to the borders") {
  Pair p;
  p.enlarge();
  for (const Vec3f& v : p.out.view().pixels()) CHECK(std::fabs(v.x - 1.0F) < 1e-6F);
}

TEST_CASE("enlarged night: a wall in the dark takes nothing from the lit road that it shares small pixels with") {
  Pair p;
  for (int y = 0; y < 36; ++y) {
    for (int x = 0; x < 60; ++x) p.full.labels(x, y) = x < 31 ? label::road : label::building;  // within a small pixel
  }
  for (int y = 0; y < 12; ++y) {
    for (int x = 0; x < 20; ++x) {
      p.small.labels(x, y) = x < 11 ? label::road : label::building;
      p.night(x, y) = x < 11 ? Vec3f{10, 10, 10} : Vec3f{0.01F, 0.01F, 0.01F};
    }
  }
  p.enlarge();
  for (int y = 0; y < 36; ++y) {
    CHECK(p.out(30, y).x == doctest::Approx(10.0));
    CHECK(p.out(31, y).x == doctest::Approx(0.01));
  }
}

TEST_CASE("enlarged night: a lamp of one small pixel shines from its own pixels alone, and from all of them") {
  Pair p;
  p.small.lamps(10, 5) = 2;
  p.night(10, 5) = Vec3f{5000, 5000, 5000};
  for (int y = 14; y < 19; ++y) {
    for (int x = 29; x < 34; ++x) p.full.lamps(x, y) = 2;
  }
  p.enlarge();
  for (int y = 0; y < 36; ++y) {
    for (int x = 0; x < 60; ++x) CHECK(p.out(x, y).x == doctest::Approx(p.full.lamps(x, y) == 2 ? 5000.0 : 1.0));
  }
}

TEST_CASE("enlarged night: a thin tube that kept one small pixel, of another class, shines along all of its length") {
  Pair p({60, 36}, {180, 108});
  p.small.lamps(30, 18) = 1;
  p.small.labels(30, 18) = label::building;
  p.night(30, 18) = Vec3f{700, 700, 700};
  for (int x = 20; x < 160; ++x) p.full.lamps(x, 55) = 1;
  p.enlarge();
  for (int x = 20; x < 160; ++x) CHECK(p.out(x, 55).x == doctest::Approx(700.0));
  CHECK(p.out(60, 57).x == doctest::Approx(1.0));
}

TEST_CASE("enlarged night: texture that the small photograph has lost is in the night, clouds of the day are not") {
  Pair p;
  for (int y = 0; y < 36; ++y) {
    for (int x = 0; x < 60; ++x) {
      p.full.image(x, y) = (x + y) % 2 == 0 ? Rgb8{135, 135, 135} : Rgb8{104, 104, 104};
      if (y < 18) p.full.labels(x, y) = label::sky;
    }
  }
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 20; ++x) p.small.labels(x, y) = label::sky;
  }
  p.enlarge();
  const double contrast = decoded(135) / decoded(104);
  CHECK(p.out(30, 30).x / p.out(31, 30).x == doctest::Approx(contrast).epsilon(0.02));
  CHECK(p.out(30, 8).x == doctest::Approx(1.0));
  CHECK(p.out(31, 8).x == doctest::Approx(1.0));
}

TEST_CASE("enlarged night: a glint of the day, and a black crack, change the night by most_detail at most") {
  Pair p;
  p.full.image(30, 18) = {255, 255, 255};
  p.full.image(40, 18) = {0, 0, 0};
  p.enlarge();
  CHECK(p.out(30, 18).x == doctest::Approx(2.0));
  CHECK(p.out(40, 18).x == doctest::Approx(0.5));
}

TEST_CASE("enlarged night: a photograph of one pixel, the same size, another order of rows, planes that do not fit") {
  Pair one({1, 1}, {7, 5});
  one.night(0, 0) = {3, 2, 1};
  one.enlarge();
  for (const Vec3f& v : one.out.view().pixels()) CHECK(v.x == doctest::Approx(3.0));

  Pair same({20, 12}, {20, 12});
  same.full.image(3, 3) = {255, 255, 255};
  same.night(3, 3) = {9, 8, 7};
  same.enlarge();
  CHECK(same.out == same.night);

  Pair p;
  std::mt19937 random(3);
  for (int y = 0; y < 12; ++y) {
    for (int x = 0; x < 20; ++x) p.night(x, y).x = static_cast<float>(random() % 100);
  }
  p.enlarge();
  Image<Vec3f> backward({60, 36});
  npsim_test::BackwardExecutor executor;
  REQUIRE(enlarge_night({}, p.small.view(), p.night.cview(), p.full.view(), backward.view(), executor).ok());
  CHECK(backward == p.out);

  const auto refused = [&](const DayView& small, const DayView& full) {
    return enlarge_night({}, small, p.night.cview(), full, backward.view(), executor).code() ==
           StatusCode::shape_mismatch;
  };
  CHECK(refused(p.full.view(), p.full.view()));
  CHECK(refused(p.small.view(), p.small.view()));
  CHECK(refused({p.small.image.view(), {}, {}}, p.full.view()));
  CHECK(refused({p.small.image.view(), p.small.labels.view(), {}}, p.full.view()));
  CHECK_FALSE(validate(EnlargeNightParams{0.0F, 2.0F, 0.004F}).ok());
}
