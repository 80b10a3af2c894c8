// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/fill.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/random.hpp"

using namespace npsim;

namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

struct Scene {
  explicit Scene(Shape s, Label l = label::building)
      : shape(s),
        depth(s.pixels(), kNaN),
        truth(s.pixels(), 0.0F),
        labels(s.pixels(), l),
        out(s.pixels(), -3.0F),
        filled(s.pixels(), 9) {}
  std::size_t at(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(shape.width) + static_cast<std::size_t>(x);
  }
  template <class Executor>
  Status run(Executor& executor, bool with_labels = true, const FillParams& p = {}) {
    npsim_test::Scratch scratch(fill_workspace_bytes(p, shape));
    Workspace& workspace = scratch.workspace();
    const ImageView<const Label> h =
        with_labels ? ImageView<const Label>(labels.data(), shape) : ImageView<const Label>();
    const Status s =
        fill_depth(p, {depth.data(), shape}, h, {out.data(), shape}, {filled.data(), shape}, workspace, executor);
    CHECK(workspace.used() == 0);
    return s;
  }
  Status run(bool with_labels = true) {
    const SerialExecutor serial;
    return run(serial, with_labels);
  }
  double worst_relative_error(Label only = 255) const {
    double worst = 0;
    for (std::size_t i = 0; i < out.size(); ++i) {
      if (only != 255 && labels[i] != only) continue;
      worst = std::max(worst, std::abs(static_cast<double>(out[i]) / static_cast<double>(truth[i]) - 1));
    }
    return worst;
  }
  // Truth: inverse depth a + b x + c y.
  void plane(double a, double b, double c, int left, int top, int right, int bottom, Label l) {
    for (int y = top; y < bottom; ++y) {
      for (int x = left; x < right; ++x) {
        truth[at(x, y)] = static_cast<float>(1.0 / (a + b * x + c * y));
        labels[at(x, y)] = l;
        depth[at(x, y)] = truth[at(x, y)];
      }
    }
  }

  Shape shape;
  std::vector<float> depth, truth;
  std::vector<Label> labels;
  std::vector<float> out;
  std::vector<std::uint8_t> filled;
};

}  // namespace

TEST_CASE("a plane stays a plane with 80 % missing, a 60 px hole, and whole columns missing") {
  Scene s({160, 120});
  s.plane(0.02, 0.0001, 0.001, 0, 0, 160, 120, label::wall);  // not a ground class: the membrane alone does it
  RandomStream random(1, RandomPurpose::test, 0, 0, 0, 0);
  for (float& z : s.depth) {
    if (random.uniform() < 0.8F) z = kNaN;
  }
  REQUIRE(s.run().ok());
  for (std::size_t i = 0; i < s.out.size(); ++i) {  // holes at the border lose the slope across it: about 2 px of it
    CHECK(std::abs(1 / static_cast<double>(s.out[i]) - 1 / static_cast<double>(s.truth[i])) < 3 * 0.001);
  }
  double inside = 0;
  for (int y = 12; y < 108; ++y) {
    for (int x = 12; x < 148; ++x) {
      const std::size_t i = s.at(x, y);
      inside = std::max(inside, std::abs(static_cast<double>(s.out[i]) / static_cast<double>(s.truth[i]) - 1));
    }
  }
  CHECK(inside < 5e-4);

  s.plane(0.02, 0.0001, 0.001, 0, 0, 160, 120, label::wall);
  for (int y = 30; y < 90; ++y) {
    for (int x = 50; x < 110; ++x) s.depth[s.at(x, y)] = x % 2 == 0 ? 0.0F : -1.0F;
  }
  REQUIRE(s.run().ok());
  CHECK(s.worst_relative_error() < 1e-3);
  for (int y = 0; y < 120; ++y) s.depth[s.at(20, y)] = s.depth[s.at(21, y)] = kNaN;
  REQUIRE(s.run().ok());
  for (int y = 8; y < 112; ++y) {  // away from the two ends of the column
    CHECK(std::abs(static_cast<double>(s.out[s.at(20, y)]) / static_cast<double>(s.truth[s.at(20, y)]) - 1) < 1e-3);
  }
  for (std::size_t i = 0; i < s.out.size(); ++i) {
    const bool valid = is_valid_depth(s.depth[i]);
    CHECK(s.filled[i] == (valid ? 0 : 1));
    if (valid) CHECK(s.out[i] == s.depth[i]);
  }
}

TEST_CASE("the road goes on as a plane beyond the last measurement: left strip, bottom rows, sparse scan lines") {
  Scene s({200, 100});
  s.plane(0.02, 0, 0, 0, 0, 200, 40, label::building);
  s.plane(-0.38, 0.0001, 0.01, 0, 40, 200, 100, label::road);
  RandomStream random(2, RandomPurpose::test, 0, 0, 0, 0);
  for (int y = 0; y < 100; ++y) {
    for (int x = 0; x < 200; ++x) {
      const bool measured = x >= 40 && y < 85 && y % 5 == 0 && random.uniform() < 0.5F;
      if (!measured) s.depth[s.at(x, y)] = 0;
    }
  }
  REQUIRE(s.run().ok());
  CHECK(s.worst_relative_error(label::road) < 1e-3);
  CHECK(s.worst_relative_error(label::building) < 1e-5);
}

TEST_CASE("grass beside the road, measured only ahead, goes on as ground in the strip that stereo does not see") {
  Scene s({200, 100});
  s.plane(0.02, 0, 0, 0, 0, 200, 40, label::building);
  s.plane(-0.38, 0.0001, 0.01, 80, 40, 200, 100, label::road);
  s.plane(-0.379, 0.0001, 0.01, 0, 40, 80, 100, label::terrain);
  for (int y = 0; y < 100; ++y) {
    for (int x = 0; x < 50; ++x) s.depth[s.at(x, y)] = 0;
  }
  for (int y = 60; y < 100; ++y) {
    for (int x = 0; x < 80; ++x) s.depth[s.at(x, y)] = 0;
  }
  REQUIRE(s.run().ok());
  CHECK(s.worst_relative_error(label::terrain) < 1e-3);
}

TEST_CASE("stereo mismatches far beneath the near road neither stay nor spread; a slope far ahead is kept") {
  Scene s({200, 100});
  s.plane(0.02, 0, 0, 0, 0, 200, 40, label::building);
  s.plane(-0.38, 0.0001, 0.01, 0, 40, 200, 100, label::road);
  for (int y = 40; y < 100; ++y) {
    for (int x = 0; x < 50; ++x) s.depth[s.at(x, y)] = kNaN;
    if (y > 60 && y % 4 == 0) s.depth[s.at(10, y)] = s.depth[s.at(11, y)] = 45.0F;  // specks in the blind strip
  }
  for (int x = 100; x < 120; ++x) s.depth[s.at(x, 42)] = 2.5F * s.truth[s.at(x, 42)];
  REQUIRE(s.run().ok());
  for (int y = 55; y < 100; ++y) {
    for (int x = 0; x < 200; ++x) {
      CHECK(std::abs(s.out[s.at(x, y)] / s.truth[s.at(x, y)] - 1) < 0.01F);
    }
  }
  CHECK(s.filled[s.at(10, 64)] == 1);
  CHECK(s.out[s.at(110, 42)] == s.depth[s.at(110, 42)]);
  FillParams p;
  p.ground_outlier = 0;
  const SerialExecutor serial;
  REQUIRE(s.run(serial, true, p).ok());
  CHECK(s.out[s.at(10, 64)] == 45.0F);
}

TEST_CASE("a hole across a label edge keeps the depth edge where the labels are") {
  Scene s({60, 40});
  s.plane(0.1, 0, 0, 0, 0, 30, 40, label::car);
  s.plane(0.02, 0, 0, 30, 0, 60, 40, label::building);
  for (int y = 0; y < 40; ++y) {
    for (int x = 22; x < 40; ++x) s.depth[s.at(x, y)] = kNaN;
  }
  REQUIRE(s.run().ok());
  CHECK(s.worst_relative_error() < 1e-6);
  REQUIRE(s.run(false).ok());  // without labels it is bridged, monotonically and within the range of the data
  for (int x = 22; x < 40; ++x) {
    CHECK(s.out[s.at(x, 20)] >= s.out[s.at(x - 1, 20)]);
    CHECK(s.out[s.at(x, 20)] <= 50.001F);
  }
}

TEST_CASE("sky stays without depth, is no source, and does not stop a pole before it from getting one") {
  Scene s({50, 40}, label::sky);
  s.plane(0.02, 0, 0, 0, 25, 50, 40, label::building);
  for (int x = 0; x < 50; ++x) s.depth[s.at(x, 3)] = 700.0F;                 // a network's idea of the sky
  for (int y = 10; y < 25; ++y) s.labels[s.at(20, y)] = label::pole;         // touches the building
  for (int y = 5; y < 9; ++y) s.labels[s.at(40, y)] = label::traffic_light;  // touches nothing but sky
  REQUIRE(s.run().ok());
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 50; ++x) {
      const std::size_t i = s.at(x, y);
      if (s.labels[i] == label::sky) {
        CHECK(s.out[i] == 0.0F);
        CHECK(s.filled[i] == 0);
      } else {
        CHECK(std::abs(s.out[i] - 50.0F) < 1e-3F);
      }
    }
  }
}

TEST_CASE("one valid pixel fills the image; none is a status and leaves the output alone") {
  Scene s({33, 17}, label::road);
  s.depth[s.at(30, 2)] = 12.5F;
  for (const bool labels : {true, false}) {
    REQUIRE(s.run(labels).ok());
    for (const float z : s.out) CHECK(std::abs(z - 12.5F) < 1e-5F);
  }
  s.out.assign(s.out.size(), -3.0F);
  s.depth[s.at(30, 2)] = std::numeric_limits<float>::infinity();
  CHECK(s.run().code() == StatusCode::no_valid_input);
  s.depth[s.at(30, 2)] = 12.5F;
  s.labels[s.at(30, 2)] = label::sky;
  CHECK(s.run().code() == StatusCode::no_valid_input);
  for (const float z : s.out) CHECK(z == -3.0F);
}

TEST_CASE("fill agrees with the membrane solved to convergence in double: random labels, holes and depths near 0") {
  Scene s({37, 29});
  RandomStream random(3, RandomPurpose::test, 0, 0, 0, 0);
  for (int y = 0; y < 29; ++y) {
    for (int x = 0; x < 37; ++x) {
      s.labels[s.at(x, y)] =
          (x / 8 + y / 6) % 3 == 0 ? label::car : ((x + y) / 20 == 1 ? label::wall : label::building);
      if (random.uniform() < 0.3F) s.depth[s.at(x, y)] = random.uniform(0.01F, 60.0F);
    }
  }
  REQUIRE(s.run().ok());
  std::vector<double> w(s.out.size(), 0.05);
  for (std::size_t i = 0; i < w.size(); ++i) {
    if (is_valid_depth(s.depth[i])) w[i] = 1.0 / static_cast<double>(s.depth[i]);
  }
  for (int sweep = 0; sweep < 20000; ++sweep) {
    for (int y = 0; y < 29; ++y) {
      for (int x = 0; x < 37; ++x) {
        if (is_valid_depth(s.depth[s.at(x, y)])) continue;
        double sum = 0;
        int count = 0;
        const int dx[4] = {1, -1, 0, 0};
        const int dy[4] = {0, 0, 1, -1};
        for (int k = 0; k < 4; ++k) {
          const int i = x + dx[k];
          const int j = y + dy[k];
          if (i < 0 || j < 0 || i >= 37 || j >= 29 || s.labels[s.at(i, j)] != s.labels[s.at(x, y)]) continue;
          sum += w[s.at(i, j)];
          ++count;
        }
        w[s.at(x, y)] = sum / count;
      }
    }
  }
  double worst = 0;
  for (std::size_t i = 0; i < w.size(); ++i) {
    worst = std::max(worst, std::abs(static_cast<double>(s.out[i]) * w[i] - 1));
  }
  CHECK(worst < 2e-4);
}

TEST_CASE("fill does not depend on the order of chunks, works in place and on strided views") {
  Scene s({70, 66});
  RandomStream random(4, RandomPurpose::test, 0, 0, 0, 0);
  for (int y = 0; y < 66; ++y) {
    for (int x = 0; x < 70; ++x) {
      s.labels[s.at(x, y)] = x * y > 1500 ? label::road : (x > 50 ? label::sky : label::vegetation);
      if (random.uniform() < 0.2F) s.depth[s.at(x, y)] = random.uniform(2.0F, 60.0F);
    }
  }
  REQUIRE(s.run().ok());
  const std::vector<float> expected = s.out;
  const npsim_test::BackwardExecutor backward;
  REQUIRE(s.run(backward).ok());
  CHECK(s.out == expected);

  std::vector<float> wide(90 * 66, 5.0F);
  const ImageView<float> view(wide.data() + 7, s.shape, 90);
  for (int y = 0; y < 66; ++y) {
    for (int x = 0; x < 70; ++x) view(x, y) = s.depth[s.at(x, y)];
  }
  npsim_test::Scratch scratch(fill_workspace_bytes({}, s.shape));
  Workspace& workspace = scratch.workspace();
  SerialExecutor serial;
  REQUIRE(fill_depth({}, view, {s.labels.data(), s.shape}, view, {}, workspace, serial).ok());
  for (int y = 0; y < 66; ++y) {
    for (int x = 0; x < 70; ++x) CHECK(view(x, y) == expected[s.at(x, y)]);
    CHECK(wide[static_cast<std::size_t>(y * 90 + 6)] == 5.0F);
    CHECK(wide[static_cast<std::size_t>(y * 90 + 77)] == 5.0F);
  }
}

TEST_CASE("images one pixel wide or high are filled, and bad arguments refused") {
  for (const Shape shape : {Shape{1, 9}, Shape{9, 1}, Shape{1, 1}}) {
    Scene s(shape);
    s.depth[0] = 4.0F;
    REQUIRE(s.run().ok());
    for (const float z : s.out) CHECK(std::abs(z - 4.0F) < 1e-6F);
  }
  Scene s({8, 8});
  s.depth[0] = 4.0F;
  const SerialExecutor serial;
  FillParams p;
  p.relaxation = 2.0F;
  CHECK(s.run(serial, true, p).code() == StatusCode::invalid_argument);
  p = {};
  p.ground_outlier = 0.5F;
  CHECK(s.run(serial, true, p).code() == StatusCode::invalid_argument);
  p = {};
  p.max_sweeps = -1;
  CHECK(s.run(serial, true, p).code() == StatusCode::invalid_argument);
  Workspace none;
  CHECK(fill_depth({}, {s.depth.data(), s.shape}, {}, {s.out.data(), {4, 4}}, {}, none, serial).code() ==
        StatusCode::shape_mismatch);
  CHECK(fill_depth({}, {s.depth.data(), s.shape}, {}, {s.out.data(), s.shape}, {}, none, serial).code() ==
        StatusCode::workspace_exhausted);
}
