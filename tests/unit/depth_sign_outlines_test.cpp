// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/given/sign_outlines.hpp"

#include <doctest/doctest.h>

#include <cstdint>

#include "fixture.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

constexpr Shape kShape{480, 60};  // a walk of three pixels
constexpr Rgb8 kBlue{20, 40, 130};

struct Wall {
  Image<Rgb8> picture{kShape, Rgb8{120, 115, 100}};
  Image<Label> labels{kShape, label::building};
  Image<std::uint16_t> instances{kShape};
  Image<std::uint16_t> marks{kShape};

  Wall() {
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) picture(x, y).g = static_cast<std::uint8_t>(111 + (7 * x + 3 * y) % 9);
    }
  }
  // A sign whose outline is drawn `rim` pixels too far to the left and below.
  void sign(int x0, int size, int rim, const Rgb8& colour) {
    for (int y = 10; y < 10 + size; ++y) {
      for (int x = x0; x < x0 + size; ++x) {
        labels(x, y) = label::traffic_sign;
        if (x >= x0 + rim && y < 10 + size - rim) picture(x, y) = colour;
      }
    }
  }
  [[nodiscard]] Status clear() {
    npsim_test::Scratch scratch(sign_outlines_workspace_bytes(kShape));
    return clear_sign_outlines(picture.cview(), instances.cview(), marks.cview(), labels.view(), scratch.workspace());
  }
  [[nodiscard]] bool is_sign(int x, int y) const { return labels(x, y) == label::traffic_sign; }
};

}  // namespace

TEST_CASE("sign outlines: what a loose outline takes of a grainy wall or of the sky is theirs again") {
  Wall s;
  for (int y = 0; y < 60; ++y) {
    for (int x = 300; x < kShape.width; ++x) {
      s.picture(x, y) = {230, 235, 240};
      s.labels(x, y) = label::sky;
    }
  }
  s.sign(20, 30, 3, kBlue);
  for (int y = 20; y < 30; ++y) {
    for (int x = 30; x < 40; ++x) s.picture(x, y) = {120, 115, 100};  // a symbol of the wall's colour within it
  }
  for (int y = 10; y < 40; ++y) {
    for (int x = 340; x < 370; ++x) {
      s.labels(x, y) = label::traffic_sign;
      if (x >= 343) s.picture(x, y) = kBlue;
    }
  }
  REQUIRE(s.clear().ok());
  for (int y = 10; y < 40; ++y) {
    for (int x = 20; x < 50; ++x) CHECK(s.is_sign(x, y) == (x >= 23 && y < 37));
    for (int x = 340; x < 370; ++x) CHECK(s.labels(x, y) == (x < 343 ? label::sky : label::traffic_sign));
  }
}

TEST_CASE(
    "sign outlines: poles and signals drawn too wide before the sky are slim again, an arm as grey as it is whole") {
  Wall s;
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      s.picture(x, y) = {200, 210, static_cast<std::uint8_t>(226 + (5 * x + y) % 7)};
      s.labels(x, y) = label::sky;
    }
  }
  const auto draw = [&](int x0, int x1, int y0, int y1, Label l, const Rgb8* colour) {
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) {
        s.labels(x, y) = l;
        if (colour != nullptr) s.picture(x, y) = *colour;
      }
    }
  };
  const Rgb8 steel{90, 90, 95};
  const Rgb8 pale{196, 205, 224};
  draw(100, 112, 0, 60, label::pole, nullptr);  // 12 px for 7
  draw(103, 110, 0, 60, label::pole, &steel);
  draw(200, 230, 10, 40, label::traffic_light, nullptr);
  draw(202, 228, 12, 38, label::traffic_light, &kBlue);
  draw(300, 306, 20, 60, label::pole, &steel);  // exact, with an arm that can hardly be seen
  draw(306, 340, 20, 23, label::pole, &pale);
  REQUIRE(s.clear().ok());
  for (int y = 1; y < 59; ++y) {
    for (int x = 98; x < 114; ++x) CHECK((s.labels(x, y) == label::pole) == (x >= 103 && x < 110));
  }
  for (int y = 8; y < 42; ++y) {
    for (int x = 198; x < 232; ++x) {
      CHECK((s.labels(x, y) == label::traffic_light) == (x >= 202 && x < 228 && y >= 12 && y < 38));
    }
  }
  for (int x = 300; x < 340; ++x) CHECK(s.labels(x, 21) == label::pole);
}

TEST_CASE(
    "sign outlines: signs like the wall, with numbers, with lamps, before a car, or drawn exactly keep their outline") {
  Wall s;
  s.sign(8, 8, 0, {120, 115, 100});
  s.sign(20, 30, 0, {120, 115, 100});
  s.sign(300, 30, 8, kBlue);  // more than an outline is ever off
  s.sign(60, 30, 3, kBlue);
  s.sign(120, 30, 3, kBlue);
  s.sign(180, 30, 3, kBlue);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (x < 100 && x >= 60) s.instances(x, y) = s.is_sign(x, y) ? 1 : 0;
      if (x < 160 && x >= 120) s.marks(x, y) = s.is_sign(x, y) ? 1 : 0;
      if (x >= 170 && x < 230 && !s.is_sign(x, y)) s.labels(x, y) = label::car;
    }
  }
  s.sign(240, 30, 0, kBlue);
  for (int y = 10; y < 40; ++y) {
    s.labels(239, y) = s.labels(270, y) = label::building;
    for (const int x : {236, 237, 238, 271, 272}) s.labels(x, y) = label::building;
    s.picture(239, y) = s.picture(270, y) = {26, 46, 124};  // a blend with the wall
  }
  const Image<Label> before = s.labels;
  REQUIRE(s.clear().ok());
  CHECK(s.labels == before);
  s.instances = Image<std::uint16_t>({4, 4});
  CHECK(s.clear().code() == StatusCode::shape_mismatch);
}
