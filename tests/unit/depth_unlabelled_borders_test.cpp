// SPDX-License-Identifier: Apache-2.0
// Borders of things in scenes without labels: what is measured of them, and where they are put.
#include "npsim/depth/detail/given/unlabelled_borders.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>

#include "fixture.hpp"
#include "npsim/depth/detail/measured/hanging_points.hpp"
#include "npsim/depth/detail/measured/hidden_points.hpp"
#include "npsim/depth/detail/measured/unlabelled_matches.hpp"

using namespace npsim;
using npsim_test::BackwardExecutor;
using npsim_test::Image;
using npsim_test::Scratch;

namespace {

constexpr Shape kShape{240, 160};
constexpr Intrinsics kCamera{200, 200, 120, 40};
constexpr GroundPlane kGround{{0, -1, 0}, 1.5F, 0.9F};
constexpr Rgb8 kWall{60, 60, 60};
constexpr Rgb8 kCar{200, 40, 40};

// What a laser or a stereo pair measured of a picture.
struct Frame {
  Image<Rgb8> image{kShape, kWall};
  Image<Label> labels{kShape, label::building};
  Image<float> measured{kShape, 0.0F};

  void pin() {
    Scratch scratch(refine_detail::unlabelled_borders_workspace_bytes(kShape));
    REQUIRE(refine_detail::pin_borders(image.cview(), labels.cview(), kGround, kCamera, measured.view(),
                                       scratch.workspace())
                .ok());
  }
  template <class Executor = SerialExecutor>
  [[nodiscard]] Image<float> visible(Executor executor = {}) const {
    Image<float> kept = measured;
    refine_detail::drop_hidden_points(measured.cview(), refine_detail::hidden_reach_px(measured.cview()), kept.view(),
                                      executor);
    return kept;
  }
  // Lines of a scanner, 10 rows apart, on the ground, down to a row.
  void scan_ground(int last = 158) {
    for (const int y : {46, 52, 60, 70, 80, 90, 100, 110, 120, 130, 140, 150, 158}) {
      for (int x = 0; x < kShape.width && y <= last; x += 3) {
        measured(x, y) = kGround.camera_height_m * kCamera.fy / (static_cast<float>(y) - kCamera.cy);
      }
    }
  }
  template <class Executor = SerialExecutor>
  [[nodiscard]] Image<float> before_ground(GroundPlane ground = kGround, Executor executor = {}) const {
    Image<float> kept = measured;
    refine_detail::drop_hanging_points(measured.cview(), kCamera, ground,
                                       refine_detail::hidden_reach_px(measured.cview()), kept.view(), executor);
    return kept;
  }
  template <class Executor = SerialExecutor>
  [[nodiscard]] Image<float> matched(int reach, Executor executor = {}) const {
    Image<float> kept = measured;
    Scratch scratch(refine_detail::unlabelled_matches_workspace_bytes(kShape));
    REQUIRE(refine_detail::drop_unlabelled_matches(image.cview(), measured.cview(), reach, kept.view(),
                                                   scratch.workspace(), executor)
                .ok());
    return kept;
  }
};

// A car 10 m away in columns 80 to 159, before a wall 20 m away.
[[nodiscard]] bool in_car(int x) { return x >= 80 && x < 160; }
[[nodiscard]] float true_m(int x) { return in_car(x) ? 10.0F : 20.0F; }

}  // namespace

TEST_CASE("unlabelled borders: between two measurements the step lies where the picture's edge is, not halfway") {
  Frame f;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (in_car(x)) f.image(x, y) = kCar;
      // The nearest samples of the car lie 3 px from its border, those of the wall 17 px.
      if (x == 83 || x == 156 || x == 62 || x == 177) f.measured(x, y) = true_m(x);
    }
  }
  const Image<float> before = f.measured;
  f.pin();
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const bool beside = x == 79 || x == 80 || x == 159 || x == 160;
      if (beside) {
        CHECK(f.measured(x, y) == doctest::Approx(static_cast<double>(true_m(x))));
      } else {
        CHECK(f.measured(x, y) == before(x, y));
      }
    }
  }
}

TEST_CASE("unlabelled borders: a coarse wall, 4 codes from column to column, is no longer way than a smooth car") {
  Frame f;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (in_car(x)) {
        f.image(x, y) = {90, 60, 60};
      } else if (x % 2 == 0) {
        f.image(x, y) = {64, 60, 60};
      }
      if (x == 100 || x == 139 || x == 50 || x == 189) f.measured(x, y) = true_m(x);
    }
  }
  f.pin();
  CHECK(f.measured(79, 80) == doctest::Approx(20.0));
  CHECK(f.measured(80, 80) == doctest::Approx(10.0));
}

TEST_CASE("unlabelled borders: paint on a wall, and a step without an edge in the picture, pin nothing") {
  Frame painted;
  Frame plain;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (in_car(x)) painted.image(x, y) = kCar;
      if (x % 40 != 20) continue;
      painted.measured(x, y) = 20.0F - 0.02F * static_cast<float>(x);  // 4 % of depth between neighbours
      plain.measured(x, y) = true_m(x);
    }
  }
  const Image<float> before = painted.measured;
  const Image<float> before_plain = plain.measured;
  painted.pin();
  plain.pin();
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      REQUIRE(painted.measured(x, y) == before(x, y));
      REQUIRE(plain.measured(x, y) == before_plain(x, y));
    }
  }
}

TEST_CASE("unlabelled borders: ground goes on as its plane up to a thing's foot, the sky stays without depth") {
  Frame f;
  const auto road_m = [](int y) { return 1.5F * 200.0F / (static_cast<float>(y) + 0.5F - kCamera.cy); };
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (y < 20) {
        f.labels(x, y) = label::sky;
        f.image(x, y) = {250, 250, 250};
      } else if (y < 90) {
        if (y == 25 || y == 60) f.measured(x, y) = 4.0F;  // a van that ends above the road
        f.image(x, y) = kCar;
      } else {
        f.labels(x, y) = label::road;
        if (y == 150) f.measured(x, y) = 0.9F * road_m(y);  // the street rises
      }
    }
  }
  f.pin();
  for (int x = 0; x < kShape.width; ++x) {
    CHECK(f.measured(x, 89) == doctest::Approx(4.0));
    CHECK(f.measured(x, 90) == doctest::Approx(0.9 * static_cast<double>(road_m(90))).epsilon(1e-4));
    for (int y = 0; y < 20; ++y) REQUIRE(f.measured(x, y) == 0.0F);
  }
}

TEST_CASE("unlabelled borders: samples of a patched road that disagree by a fifth make no step in it") {
  Frame f;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      f.labels(x, y) = label::road;
      if (in_car(x)) f.image(x, y) = kCar;
      if (y == 150) f.measured(x, y) = true_m(x) * (in_car(x) ? 0.4F : 0.16F);
    }
  }
  const Image<float> before = f.measured;
  f.pin();
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) REQUIRE(f.measured(x, y) == before(x, y));
  }
}

TEST_CASE("unlabelled borders: nothing measured, one pixel") {
  Frame f;
  f.pin();
  for (const float z : f.measured.view().pixels()) REQUIRE(z == 0.0F);
  Image<Rgb8> image({1, 1}, kWall);
  Image<Label> labels({1, 1}, label::building);
  Image<float> measured({1, 1}, 3.0F);
  Scratch scratch(refine_detail::unlabelled_borders_workspace_bytes({1, 1}));
  REQUIRE(
      refine_detail::pin_borders(image.cview(), labels.cview(), kGround, kCamera, measured.view(), scratch.workspace())
          .ok());
  CHECK(measured(0, 0) == 3.0F);
}

TEST_CASE(
    "hidden points: wall seen through a car by a higher laser goes; the car, its outline and beside a pole stay") {
  Frame f;
  for (int y = 50; y < 76; y += 2) {
    for (int x = 0; x < kShape.width; ++x) f.measured(x, y) = true_m(x);
  }
  for (int x = 100; x < 140; x += 3) f.measured(x, 61) = 20.0F;  // between two lines on the car
  for (int y = 50; y < 76; ++y) f.measured(30, y) = 8.0F;        // a pole before the wall
  const Image<float> kept = f.visible();
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const bool hidden = y == 61 && f.measured(x, y) == 20.0F;
      REQUIRE(kept(x, y) == (hidden ? 0.0F : f.measured(x, y)));
    }
  }
  BackwardExecutor backward;
  const Image<float> again = f.visible(backward);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) REQUIRE(again(x, y) == kept(x, y));
  }
}

TEST_CASE(
    "hidden points: of a scanner whose lines are 6 rows apart they go too, where a dense one has a gap they stay") {
  for (const int apart : {6, 1}) {
    Frame f;
    for (int y = 40; y < 121; y += apart) {
      for (int x = 0; x < kShape.width; x += 3) f.measured(x, y) = true_m(x);
    }
    for (int y = 73; y < 80; ++y) {  // a dark pane
      for (int x = 115; x < 126; ++x) f.measured(x, y) = 0.0F;
    }
    f.measured(120, 76) = 20.0F;
    CHECK(f.visible()(120, 76) == (apart == 6 ? 0.0F : 20.0F));
    CHECK(f.visible()(81, 40) == 10.0F);
    CHECK(f.visible()(78, 70) == 20.0F);
  }
}

TEST_CASE("hidden points: a wall 7 % behind stays, and so does what has surfaces of several depths around it") {
  for (const bool close : {true, false}) {
    Frame f;
    for (int y = 65; y < 95; ++y) {
      for (int x = 0; x < kShape.width; ++x) f.measured(x, y) = !close && x > 120 ? 11.0F : 10.0F;
    }
    f.measured(120, 80) = close ? 10.7F : 20.0F;
    CHECK(f.visible()(120, 80) == f.measured(120, 80));
    f.measured(60, 80) = 10.9F;
    CHECK(f.visible()(60, 80) == 0.0F);
  }
}

TEST_CASE("hidden points: what is seen through a gap wider than a 120th of the picture stays") {
  for (const int gap : {1, 3}) {
    Frame f;
    for (int y = 65; y < 95; ++y) {
      for (int x = 0; x < kShape.width; ++x) f.measured(x, y) = std::abs(x - 120) < gap ? 0.0F : 10.0F;
    }
    f.measured(120, 80) = 20.0F;
    f.measured(120, 79) = 10.0F;
    f.measured(120, 81) = 10.0F;
    CHECK(f.visible()(120, 80) == (gap == 1 ? 0.0F : 20.0F));
    for (int y = 0; y < 20; ++y) {  // a quarter of the picture is measured
      for (int x = 0; x < kShape.width; ++x) f.measured(x, y) = 30.0F;
    }
    CHECK(f.visible()(120, 80) == 20.0F);
  }
}

TEST_CASE("unlabelled matches: a near thing loses half a window beside what is behind it, a mast at most a quarter") {
  Frame f;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      f.measured(x, y) = true_m(x);
      if (x >= 20 && x < 28) f.measured(x, y) = 10.0F;  // a mast
      if (in_car(x) || (x >= 20 && x < 28)) f.image(x, y) = kCar;
    }
  }
  const Image<float> kept = f.matched(5);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const bool rim = (x >= 80 && x < 85) || (x >= 155 && x < 160) || (x >= 20 && x < 22) || (x >= 26 && x < 28);
      REQUIRE(kept(x, y) == (rim ? 0.0F : f.measured(x, y)));
    }
  }
  BackwardExecutor backward;
  const Image<float> again = f.matched(5, backward);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) REQUIRE(again(x, y) == kept(x, y));
  }
}

TEST_CASE("unlabelled matches: a step of 1.15 keeps its rim; holes are no far side, a slanted wall has none") {
  Frame f;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      f.measured(x, y) =
          x < 60 ? 11.5F : (x < 90 ? 10.0F : (x < 120 ? 0.0F : 10.0F + 0.2F * static_cast<float>(x - 120)));
    }
  }
  const Image<float> kept = f.matched(5);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) REQUIRE(kept(x, y) == f.measured(x, y));
  }
}

TEST_CASE(
    "unlabelled matches: the slanted side of a car, 2 % nearer from pixel to pixel, is one thing and loses its rim") {
  Frame f;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      f.measured(x, y) = x >= 100 && x < 140 ? 10.0F - 0.1F * static_cast<float>(x - 100) : 20.0F;
      if (x >= 100 && x < 140) f.image(x, y) = kCar;
    }
  }
  const Image<float> kept = f.matched(5);
  for (int x = 0; x < kShape.width; ++x) {
    const bool rim = (x >= 100 && x < 105) || (x >= 135 && x < 140);
    CHECK(kept(x, 80) == (rim ? 0.0F : f.measured(x, 80)));
  }
}

TEST_CASE("unlabelled matches: a blot in an even sky goes, one of another colour or as large as a thing stays") {
  Frame f;
  const auto blot = [&](int x0, int y0, int width, int height, float z, Rgb8 colour) {
    for (int y = y0; y < y0 + height; ++y) {
      for (int x = x0; x < x0 + width; ++x) {
        f.measured(x, y) = z;
        f.image(x, y) = colour;
      }
    }
  };
  blot(30, 30, 8, 8, 7.0F, kWall);         // 64 px of 38,400, of the colour around it
  blot(80, 30, 8, 8, 7.0F, {75, 60, 60});  // a lamp
  blot(130, 30, 9, 9, 7.0F, kWall);        // 81 px
  blot(239, 159, 1, 1, 7.0F, kWall);       // in the corner
  const Image<float> kept = f.matched(2);
  CHECK(kept(33, 33) == 0.0F);
  CHECK(kept(83, 33) == 7.0F);
  CHECK(kept(133, 33) == 7.0F);
  CHECK(kept(239, 159) == 0.0F);
}

TEST_CASE("hanging points: a rope in one line, and a tape in those of two sweeps, go; ground and the post stay") {
  Frame f;
  f.scan_ground();
  Image<std::uint8_t> hangs(kShape, 0);
  const auto hit = [&](int x, int y, float z, bool alone) {
    f.measured(x, y) = z;
    hangs(x, y) = alone ? 1 : 0;
  };
  for (int x = 21; x < 60; x += 3) {
    hit(x, 70, 7.6F, false);  // the ground rises by .36 m
    hit(x, 80, 2.9F, true);   // .9 m high
  }
  for (int x = 90; x < 129; x += 3) hit(x, 80, 2.9F, true);
  for (int x = 91; x < 129; x += 3) hit(x, 82, 2.9F, true);
  for (const int y : {60, 70, 80, 90, 100}) hit(198, y, 2.9F, false);
  hit(189, 80, 2.9F, true);                                      // a twig beside the post
  for (const int x : {210, 213, 216}) hit(x, 60, 10.5F, false);  // a box: the next line meets the ground before it
  for (const int x : {3, 6}) hit(x, 80, 3.1F, false);            // lines are .31 m apart: a guard rail
  const Image<float> kept = f.before_ground();
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      CAPTURE(x);
      CAPTURE(y);
      REQUIRE(kept(x, y) == (hangs(x, y) != 0 ? 0.0F : f.measured(x, y)));
    }
  }
  BackwardExecutor backward;
  const Image<float> again = f.before_ground(kGround, backward);
  GroundPlane unknown = kGround;
  unknown.inlier_share = 0.0F;
  const Image<float> all = f.before_ground(unknown);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      REQUIRE(again(x, y) == kept(x, y));
      REQUIRE(all(x, y) == f.measured(x, y));
    }
  }
}

TEST_CASE(
    "hanging points: a bollard whose points lie between the lines of the ground behind it stays, a near one too") {
  struct Bollard {
    int low, apart;
    float z, noise;
  };
  for (const Bollard b : {Bollard{78, 11, 2.7F, 0.05F}, Bollard{84, 7, 2.0F, 0.0F}}) {
    Frame f;
    f.scan_ground();
    const int middle = b.low - b.apart;
    f.measured(121, b.low) = f.measured(121, middle - b.apart) = b.z + b.noise;
    f.measured(121, middle) = b.z;
    CHECK(f.before_ground()(121, middle) == b.z);
    CHECK(f.before_ground()(121, middle - b.apart) == b.z + b.noise);
    f.measured(121, b.low) = f.measured(121, middle - b.apart) = 0.0F;
    CHECK(f.before_ground()(121, middle) == 0.0F);
    f.measured(121, middle - b.apart - 1) = 1.06F * b.z;  // another twig
    CHECK(f.before_ground()(121, middle) == 0.0F);
  }
}

TEST_CASE("hanging points: of a scanner above and behind the camera, what stands keeps its points, a near rope goes") {
  constexpr Shape kPicture{800, 450};
  constexpr Intrinsics kWide{633, 633, 408, 245};
  constexpr GroundPlane kRoad{{0, -1, 0}, 1.5F, 0.9F};
  constexpr float kHigher_m = 0.33F, kBehind_m = 0.76F;
  struct Thing {
    float width_m, low_m, high_m;
    double most_lost, least_lost;  // of its points
    float from_m, to_m;
  };
  // Of the rail lines graze edges.
  for (const Thing& t :
       {Thing{0.1F, 0.0F, 0.9F, 0.0, 0.0, 4.0F, 30.0F}, Thing{0.25F, 0.0F, 0.75F, 0.0, 0.0, 4.0F, 30.0F},
        Thing{0.3F, 0.0F, 1.1F, 0.0, 0.0, 4.0F, 30.0F}, Thing{1.8F, 0.2F, 1.4F, 0.0, 0.0, 4.0F, 30.0F},
        Thing{2.0F, 0.45F, 0.76F, 0.03, 0.0, 4.0F, 20.0F}, Thing{3.0F, 0.5F, 0.52F, 1.0, 0.7, 3.0F, 5.0F}}) {
    int hit = 0;
    int lost = 0;
    int ground = 0;
    for (float z = t.from_m; z < t.to_m; z += 0.37F) {
      Image<float> depth(kPicture, 0.0F);
      Image<std::uint8_t> of_thing(kPicture, 0);
      for (int line = 0; line < 32; ++line) {
        const float slope = std::tan(0.01745F * (10.67F - 1.3333F * static_cast<float>(line)));  // up
        for (int beam = -100; beam <= 100; ++beam) {
          const float aside = std::tan(0.01745F * 0.33F * static_cast<float>(beam));
          const float reach = std::sqrt(1.0F + aside * aside);
          const float to_thing = z + kBehind_m;
          const float high_m = kRoad.camera_height_m + kHigher_m + slope * reach * to_thing;
          const bool thing = std::fabs(aside * to_thing) < 0.5F * t.width_m && high_m >= t.low_m && high_m < t.high_m;
          const float to_ground = slope < 0.0F ? (kRoad.camera_height_m + kHigher_m) / (-slope * reach) : 1e9F;
          const float along = thing && to_thing < to_ground ? to_thing : to_ground;
          if (along > 80.0F || along < kBehind_m + 0.5F) continue;
          const float ahead = along - kBehind_m;
          const float height_m = kHigher_m + slope * reach * along;  // above the camera
          const auto x = static_cast<int>(std::floor(kWide.fx * aside * along / ahead + kWide.cx));
          const auto y = static_cast<int>(std::floor(kWide.cy - kWide.fy * height_m / ahead));
          if (!depth.view().contains(x, y) || (depth(x, y) > 0.0F && depth(x, y) < ahead)) continue;
          depth(x, y) = ahead;
          of_thing(x, y) = along == to_thing ? 1 : 0;
        }
      }
      Image<float> kept = depth;
      SerialExecutor serial;
      refine_detail::drop_hanging_points(depth.cview(), kWide, kRoad, refine_detail::hidden_reach_px(depth.cview()),
                                         kept.view(), serial);
      for (int y = 0; y < kPicture.height; ++y) {
        for (int x = 0; x < kPicture.width; ++x) {
          const bool gone = depth(x, y) > 0.0F && !(kept(x, y) > 0.0F);
          hit += of_thing(x, y);
          lost += of_thing(x, y) != 0 && gone ? 1 : 0;
          ground += of_thing(x, y) == 0 && gone ? 1 : 0;
        }
      }
    }
    CAPTURE(t.width_m);
    REQUIRE(hit > 50);
    CHECK(ground == 0);
    CHECK(lost <= t.most_lost * hit);
    CHECK(lost >= t.least_lost * hit);
  }
}

TEST_CASE(
    "hanging points: a branch before a wall or the sky stays, a post whose foot no line reaches, and what is hit in "
    "every row") {
  Frame f;
  f.scan_ground();
  for (int x = 0; x < kShape.width; x += 3) f.measured(x, 70) = x < 120 ? 5.0F : 0.0F;  // a wall, and nothing
  for (int x = 120; x < kShape.width; x += 3) f.measured(x, 60) = 0.0F;
  for (const int x : {60, 180}) f.measured(x, 80) = 2.9F;
  CHECK(f.before_ground()(60, 80) == 2.9F);
  CHECK(f.before_ground()(180, 80) == 2.9F);
  for (const int last : {90, 140, 150}) {  // its foot, if it has one, is at row 144
    Frame low;
    low.scan_ground(last);
    low.measured(120, 80) = 2.9F;
    CHECK(low.before_ground()(120, 80) == (last == 150 ? 0.0F : 2.9F));
  }
  Frame dense;
  for (int y = 46; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; x += 2) dense.measured(x, y) = 300.0F / (static_cast<float>(y) - 40.0F);
  }
  dense.measured(120, 80) = 4.0F;
  CHECK(dense.before_ground()(120, 80) == 4.0F);
}

TEST_CASE("unlabelled matches: a road in whole pixels of disparity, of one colour, keeps its bands") {
  Frame f;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < 10; ++x) f.measured(x, y) = 100.0F / std::floor(6.0F + static_cast<float>(y) / 5.0F);
  }
  const Image<float> kept = f.matched(5);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) REQUIRE(kept(x, y) == f.measured(x, y));
  }
}

TEST_CASE("unlabelled matches: no depth, NaN, infinite and negative depth, one pixel") {
  Frame f;
  f.measured(5, 5) = std::numeric_limits<float>::quiet_NaN();
  f.measured(6, 5) = std::numeric_limits<float>::infinity();
  f.measured(7, 5) = -1.0F;
  const Image<float> kept = f.matched(5);
  CHECK(std::isnan(kept(5, 5)));
  CHECK(kept(7, 5) == -1.0F);
  CHECK(std::isnan(f.visible()(5, 5)));
  CHECK(std::isnan(f.before_ground()(5, 5)));
  Frame near;
  near.scan_ground();
  near.measured(121, 60) = 1e-30F;  // infinitely many rows above its foot
  CHECK(near.before_ground()(121, 60) == 0.0F);
  Image<Rgb8> image({1, 1}, kWall);
  Image<float> one({1, 1}, 3.0F);
  Image<float> out = one;
  Scratch scratch(refine_detail::unlabelled_matches_workspace_bytes({1, 1}));
  SerialExecutor serial;
  REQUIRE(refine_detail::drop_unlabelled_matches(image.cview(), one.cview(), 7, out.view(), scratch.workspace(), serial)
              .ok());
  CHECK(out(0, 0) == 3.0F);
}
