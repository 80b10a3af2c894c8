// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/given/guessed_labels.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>

#include "day_picture.hpp"
#include "fixture.hpp"
#include "npsim/core/random.hpp"

using namespace npsim;
using npsim_test::encode;
using npsim_test::Image;

namespace {

constexpr Shape kShape{480, 270};
constexpr Intrinsics kCamera{400, 400, 240, 120};
constexpr GroundPlane kGround{{0, -1, 0}, 1.5F, 0.9F};

[[nodiscard]] float draw(int x, int y) {
  RandomStream r(9, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * kShape.width + x), 0);
  return r.uniform();
}
[[nodiscard]] Rgb8 photographed(const Vec3f& light) { return {encode(light.x), encode(light.y), encode(light.z)}; }
[[nodiscard]] float fall(int y) { return (static_cast<float>(y) + 0.5F - kCamera.cy) / kCamera.fy; }
[[nodiscard]] float road_m(int y) { return fall(y) > 0.0F ? 1.5F / fall(y) : 1e9F; }

constexpr DepthNoise kLaserNoise{0.02F, 2, 1.0F, 1.0F};

// A road before a wall 20 m away; neither has a look of its own.
struct Street {
  Image<Rgb8> image{kShape, Rgb8{120, 120, 120}};
  Image<float> depth{kShape, 0.0F};
  Image<std::uint8_t> surface{kShape, 1};
  Image<Label> labels{kShape, label::unlabeled};
  GroundPlane ground = kGround;
  DepthNoise noise;
  bool lines = false;

  Street() {
    paint([](int, int) { return Vec3f{0.2F, 0.2F, 0.2F}; });
    measure([](int, int y) { return std::fmin(20.0F, road_m(y)); });
  }
  template <class F>
  void paint(const F& f) {
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) image(x, y) = photographed(f(x, y));
    }
  }
  template <class F>
  void measure(const F& f) {
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) depth(x, y) = f(x, y);
    }
  }
  // As a laser does: every third pixel of every apart-th row from the first on.
  template <class F>
  void scan(int apart, int first, const F& f) {
    lines = true;
    noise = kLaserNoise;
    measure([&](int x, int y) { return y < first || (y - first) % apart != 0 || x % 3 != 0 ? 0.0F : f(x, y); });
  }
  template <class Executor = SerialExecutor>
  void guess(Executor executor = {}) {
    npsim_test::Scratch scratch(refine_detail::guess_labels_workspace_bytes(kShape));
    REQUIRE(refine_detail::guess_labels(image.cview(), depth.cview(), kCamera, ground, noise, lines, surface.cview(),
                                        labels.view(), scratch.workspace(), executor)
                .ok());
  }
  [[nodiscard]] double share(Label l, int x0, int x1, int y0, int y1) const {
    int n = 0;
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) n += labels(x, y) == l ? 1 : 0;
    }
    return static_cast<double>(n) / static_cast<double>((x1 - x0) * (y1 - y0));
  }
};

// A car 8 m away, in columns 200 to 279, as far down as h metres above the road.
[[nodiscard]] bool in_car(int x, int y, float h) {
  return x >= 200 && x < 280 && y > 100 && 1.5F - 8.0F * fall(y) >= h;
}
[[nodiscard]] float with_car_m(int x, int y) { return in_car(x, y, 0.1F) ? 8.0F : std::fmin(20.0F, road_m(y)); }

// Bright and dark in the finest detail, in no direction.
[[nodiscard]] Vec3f leaf(int x, int y) { return Vec3f{0.05F, 0.09F, 0.03F} * std::exp2(4.0F * (draw(x, y) - 0.6F)); }

}  // namespace

TEST_CASE("guessed labels: a wall without texture is a building down to its foot, the road before it a road") {
  Street s;
  s.guess();
  const int foot = static_cast<int>(kCamera.cy + 1.5F * kCamera.fy / 20.0F);
  CHECK(s.share(label::building, 0, 480, 0, foot - 4) == 1.0);
  CHECK(s.share(label::road, 0, 480, foot + 4, 270) == 1.0);
}

TEST_CASE("guessed labels: between a laser's lines things end where their colour does, a car's foot included") {
  Street s;
  const auto car = [](int x, int y) { return x >= 200 && x < 280 && y >= 110 && fall(y) * 10.0F < 1.5F; };
  s.paint([&](int x, int y) { return car(x, y) ? Vec3f{0.4F, 0.02F, 0.02F} : Vec3f{0.2F, 0.2F, 0.2F}; });
  s.scan(9, 0, [&](int x, int y) { return car(x, y) ? 10.0F : std::fmin(20.0F, road_m(y)); });
  s.guess();
  int wrong = 0;
  for (int y = 160; y < 230; ++y) {  // 9 rows hold its foot and the road before it
    for (int x = 190; x < 290; ++x) wrong += (s.labels(x, y) == label::building) != car(x, y) ? 1 : 0;
  }
  CHECK(wrong < 30);
}

TEST_CASE(
    "guessed labels: mismatches in the road and in a wall are neither, and rays that do not fall meet no ground") {
  Street s;
  s.measure([](int x, int y) {
    const bool speck = (x / 3) % 40 == 0 && (y / 3) % 10 == 0;
    if (speck && y > 200) return 0.5F * road_m(y);
    if (speck && y > 130 && y < 145) return road_m(y);
    return y < 100 ? 0.0F : std::fmin(20.0F, road_m(y));
  });
  s.guess();
  CHECK(s.share(label::road, 0, 480, 160, 270) > 0.999);
  CHECK(s.share(label::building, 0, 480, 0, 140) == 1.0);
}

TEST_CASE(
    "guessed labels: ground that a network draws 15 % too far is ground; a car over it and a wall of .5 m are not") {
  Street s;
  const auto wall_top = [](int x, int y) { return x >= 300 && x < 360 && 1.5F - fall(y) * 15.0F < 0.5F; };
  const auto car = [](int x, int y) {
    const float high_m = 1.5F - fall(y) * 10.0F;
    return x >= 380 && x < 440 && high_m > 0.0F && high_m < 1.4F;
  };
  s.measure([&](int x, int y) {
    const auto squared = static_cast<float>((x - 140) * (x - 140) + (y - 210) * (y - 210));
    const float road = std::fmin(80.0F, road_m(y) * (1.0F + 0.15F * std::exp(-0.001F * squared)));
    if (car(x, y)) return 10.0F;
    return wall_top(x, y) && road > 15.0F ? 15.0F : road;
  });
  s.guess();
  CHECK(s.labels(140, 210) == label::road);
  CHECK(s.share(label::building, 390, 430, 130, 170) > 0.95);
  CHECK(s.share(label::building, 310, 350, 148, 154) > 0.95);
}

TEST_CASE("guessed labels: far road that stereo measures half a metre too high and too low is ground, by its noise") {
  Street s;
  s.measure([](int x, int y) {
    const float off_m = road_m(y) < 10.0F || road_m(y) > 20.0F ? 0.0F : 1.1F * (draw(x, y) - 0.5F);
    return road_m(y) < 20.0F ? (1.5F - off_m) / fall(y) : 20.0F;
  });
  s.noise = {0.01F, 0, 1.0F, 1.0F};  // 1/m, which is .15 m of height at 10 m
  s.guess();
  CHECK(s.share(label::road, 0, 480, 153, 270) > 0.99);
  s.noise.amplitude = 0.0F;
  s.guess();
  CHECK(s.share(label::road, 0, 480, 153, 270) < 0.98);
}

TEST_CASE(
    "guessed labels: of noisy stereo a car and a pole stand down to the road, however grey; a kerb before a wall "
    "stays") {
  // Bottoms of .02 m, on the car a strip without matches, the pavement .12 m above the road from 11 m on, a wall 14 m
  // away; disparity is off by a uniform deviation of .0022 1/m in squares of 4 px, as matching smooths it.
  constexpr float kDeviation = 0.0022F;
  const auto pole = [](int x, int y) { return x >= 380 && x < 388 && 1.5F - 8.0F * fall(y) >= 0.02F; };
  const auto stands = [&](int x, int y) { return in_car(x, y, 0.02F) || pole(x, y); };
  const auto street_m = [](int y) {
    const float pavement_m = fall(y) > 0.0F ? 1.38F / fall(y) : 1e9F;
    return pavement_m > 11.0F ? std::fmin(14.0F, pavement_m) : std::fmin(11.0F, road_m(y));
  };
  Street s;
  s.noise = {kDeviation, 0, 4.0F, 1.0F};
  s.measure([&](int x, int y) {
    if (in_car(x, y, 0.4F) && !in_car(x, y, 0.55F)) return 0.0F;
    const float off = 3.46F * kDeviation * (draw(x / 4, y / 4) - 0.5F);
    return 1.0F / (1.0F / (stands(x, y) ? 8.0F : street_m(y)) + off);
  });
  s.guess();
  const auto row_at = [](float z, float height_m) {
    return static_cast<int>(kCamera.cy + kCamera.fy * (1.5F - height_m) / z);
  };
  CHECK(s.share(label::building, 203, 277, row_at(8.0F, 0.25F), row_at(8.0F, 0.05F)) > 0.98);
  CHECK(s.share(label::building, 381, 387, row_at(8.0F, 0.25F), row_at(8.0F, 0.05F)) > 0.9);
  CHECK(s.share(label::road, 190, 390, row_at(7.8F, 0.0F), 270) > 0.98);
  CHECK(s.share(label::road, 290, 370, row_at(12.9F, 0.12F), 270) > 0.98);
}

TEST_CASE("guessed labels: the foot of a post of 5 px stays in exact depth, specks that noise makes as wide do not") {
  constexpr Shape kWide{1920, 40};
  constexpr Intrinsics kLong{1600, 1600, 960, -170};  // row 30 meets the ground 12 m away
  const auto stands = [](int x, int y) { return x % 100 < 5 && y < 30; };
  Image<float> depth(kWide, 0.0F);
  for (int y = 0; y < kWide.height; ++y) {
    for (int x = 0; x < kWide.width; ++x) {
      depth(x, y) = stands(x, y) ? 12.0F : 1.5F * kLong.fy / (static_cast<float>(y) + 0.5F - kLong.cy);
    }
  }
  const auto left = [&](const DepthNoise& noise, int height) {
    Image<Label> labels(kWide, label::road);
    for (int y = 0; y < kWide.height; ++y) {
      for (int x = 0; x < kWide.width; ++x) {
        if (stands(x, y) && y >= 30 - height) labels(x, y) = label::building;
      }
    }
    npsim_test::Scratch scratch(refine_detail::guess_labels_workspace_bytes(kWide));
    SerialExecutor serial;
    REQUIRE(refine_detail::smooth_feet(depth.cview(), kLong, kGround, noise, labels.view(), scratch.workspace(), serial)
                .ok());
    int n = 0;
    for (const Label l : labels.view().pixels()) n += l == label::building ? 1 : 0;
    return n;
  };
  CHECK(left({1e-3F, 1, 1.0F, 1.0F}, 30) > 2800);  // of 20 posts of 150 pixels
  CHECK(left({3e-4F, 0, 4.0F, 1.0F}, 5) == 0);
}

TEST_CASE(
    "guessed labels: of exact depth a post on a traffic island ends where it stands, not on the stones before it") {
  const auto post = [](int x, int y) { return x >= 50 && x < 80 && 1.5F - 4.0F * fall(y) >= 0.12F; };
  Street s;
  s.noise = {1e-3F, 1, 1.0F, 1.0F};
  s.measure([&](int x, int y) {
    const float ground_m = x >= 20 && x < 110 ? road_m(y) * 1.38F / 1.5F : road_m(y);
    return post(x, y) ? 4.0F : std::fmin(20.0F, ground_m);
  });
  s.guess();
  const auto island_row = [](float z) { return static_cast<int>(kCamera.cy + kCamera.fy * 1.38F / z); };
  CHECK(s.share(label::building, 52, 78, island_row(4.5F), island_row(4.0F)) == 1.0);
  CHECK(s.share(label::road, 52, 78, island_row(3.93F), 269) > 0.97);
}

TEST_CASE("guessed labels: a ramp under a laser's lines is ground as far as it lies flat, a wall as high is none") {
  Street s;
  const auto wall = [](int x) { return x < 100; };
  // From 12 m on it rises by 5 cm/m, to .4 m above the plane at 20 m.
  const auto ramp_m = [](int y) { return (1.5F + 0.05F * 12.0F) / (fall(y) + 0.05F); };
  s.paint([&](int x, int) { return wall(x) ? Vec3f{0.4F, 0.1F, 0.05F} : Vec3f{0.2F, 0.2F, 0.2F}; });
  s.scan(5, 0, [&](int x, int y) {
    if (wall(x)) return std::fmin(12.0F, road_m(y));
    return std::fmin(20.0F, road_m(y) < 12.0F ? road_m(y) : ramp_m(y));
  });
  s.guess();
  const int top = 145;  // .4 m above the plane at 20 m lies in row 142
  CHECK(s.share(label::road, 110, 480, top, 270) > 0.98);
  CHECK(s.share(label::building, 0, 95, top, 160) > 0.98);
}

TEST_CASE("guessed labels: a bumper whose ribs a laser measures at every other line is no flat ground") {
  Street s;
  s.scan(5, 130,
         [](int x, int y) { return in_car(x, y, 0.2F) ? (y % 2 == 0 ? 8.0F : 8.5F) : std::fmin(20.0F, road_m(y)); });
  s.guess();
  CHECK(s.share(label::building, 205, 275, 130, 181) > 0.98);
  CHECK(s.share(label::road, 205, 275, 195, 270) > 0.98);
}

TEST_CASE("guessed labels: road goes on below a laser's lowest line, not over a car below it or a black one's front") {
  Street s;
  const auto is_grey = [](int x, int y) { return x < 100 && y >= 200; };    // as the road
  const auto is_black = [](int x, int y) { return x >= 380 && y >= 200; };  // seen from 430 on
  s.paint([&](int x, int y) { return is_black(x, y) ? Vec3f{0.01F, 0.01F, 0.01F} : Vec3f{0.2F, 0.2F, 0.2F}; });
  s.scan(9, 0, [&](int x, int y) {
    if (is_grey(x, y)) return y < 250 ? 4.0F : 0.0F;
    if (is_black(x, y)) return x >= 430 && y < 250 ? 4.0F : 0.0F;
    return y < 184 || x < 100 || x >= 380 ? std::fmin(20.0F, road_m(y)) : 0.0F;
  });
  s.guess();
  CHECK(s.share(label::road, 105, 375, 170, 270) == 1.0);
  CHECK(s.share(label::building, 0, 98, 205, 240) == 1.0);
  CHECK(s.share(label::building, 385, 480, 205, 240) == 1.0);
}

TEST_CASE("guessed labels: between a laser's lines a shade as dark as the car that casts it is road") {
  Street s;
  s.paint([](int x, int y) {
    const bool shade = x >= 280 && x < 340 && y > 175 && y < 225;
    return in_car(x, y, 0.1F) || shade ? Vec3f{0.01F, 0.01F, 0.01F} : Vec3f{0.2F, 0.2F, 0.2F};
  });
  s.scan(22, 0, with_car_m);
  s.guess();
  CHECK(s.share(label::road, 282, 292, 177, 223) > 0.98);
  CHECK(s.share(label::building, 203, 278, 105, 175) > 0.98);
}

TEST_CASE("guessed labels: a bumper as dark as the shade below it stands down to a quarter of a metre above the road") {
  Street s;
  s.paint([](int x, int y) {
    if (x < 200 || x >= 280 || y > 230) return Vec3f{0.2F, 0.2F, 0.2F};
    return y < 170 ? Vec3f{0.4F, 0.02F, 0.02F} : Vec3f{0.01F, 0.01F, 0.01F};
  });
  s.scan(30, 14, with_car_m);
  s.guess();
  CHECK(s.share(label::building, 205, 275, 165, 181) > 0.98);
  CHECK(s.share(label::road, 205, 275, 195, 270) > 0.98);
}

TEST_CASE("guessed labels: a pole that a laser's line misses stands all the same; nothing stands below a sign at 1 m") {
  Street s;
  const auto pole = [](int x, int y) { return x >= 302 && x < 307 && y < 162; };
  const auto sign = [](int x, int y) { return x >= 100 && x < 130 && y > 80 && 1.5F - 8.0F * fall(y) >= 1.0F; };
  s.paint([&](int x, int y) { return pole(x, y) ? Vec3f{0.02F, 0.02F, 0.02F} : Vec3f{0.2F, 0.2F, 0.2F}; });
  s.scan(22, 0, [&](int x, int y) {
    if (y == 154 && pole(x, y)) return 0.0F;
    return sign(x, y) ? 8.0F : (x > 296 && x < 312 && y < 140 ? 14.0F : std::fmin(20.0F, road_m(y)));
  });
  s.guess();
  CHECK(s.share(label::building, 302, 307, 135, 160) > 0.98);
  CHECK(s.share(label::road, 290, 296, 165, 270) > 0.98);
  CHECK(s.share(label::road, 102, 128, 147, 270) > 0.98);
}

TEST_CASE("guessed labels: dark grain that a laser finds smooth is paint, that which scatters its points is leaves") {
  for (const float scatter_m : {0.02F, 0.25F}) {
    Street s;
    s.paint([](int x, int y) {
      return y < 130 ? Vec3f{0.04F, 0.04F, 0.04F} * std::exp2(draw(x, y) - 0.5F) : Vec3f{0.2F, 0.2F, 0.2F};
    });
    s.scan(12, 0, [&](int x, int y) {
      return road_m(y) < 20.0F ? road_m(y) : 20.0F + 3.4F * scatter_m * (draw(x, y) - 0.5F);
    });
    s.guess();
    CAPTURE(scatter_m);
    CHECK(s.share(label::vegetation, 10, 470, 10, 120) == doctest::Approx(scatter_m > 0.1F ? 1.0 : 0.0).epsilon(0.03));
  }
}

TEST_CASE(
    "guessed labels: a point of a laser is off the line of its neighbours by its noise, or more; alone it is none") {
  const auto stands = [](int x, int) { return x < 400; };
  Image<float> depth(kShape, 0.0F);
  const auto scanned = [&](int x, int y) {
    return refine_detail::scanned_surface(depth.cview(), kCamera, kLaserNoise, stands, x, y);
  };
  using refine_detail::Scanned;
  // A wall along the street: 1/z is a line.
  for (int x = 0; x < kShape.width; x += 4) depth(x, 100 + (x / 4) % 2) = 1.0F / (0.1F + 2e-4F * static_cast<float>(x));
  CHECK(scanned(240, 100) == Scanned::smooth);
  depth(240, 100) += 0.05F;  // seen at 6.8 m
  CHECK(scanned(240, 100) == Scanned::smooth);
  depth(240, 100) += 0.05F;
  CHECK(scanned(240, 100) == Scanned::rough);
  CHECK(scanned(0, 100) == Scanned::alone);    // nothing to its left
  CHECK(scanned(396, 101) == Scanned::alone);  // what is to its right lies
  depth(200, 200) = 6.0F;
  CHECK(scanned(200, 200) == Scanned::alone);
}

TEST_CASE(
    "guessed labels: leaves are plants, and neither bricks, stripes, shingle of grey, nor what is flat and green") {
  Street s;
  s.paint([](int x, int y) {
    if (y >= 130) return Vec3f{0.2F, 0.2F, 0.2F};
    if (x < 120) return leaf(x, y);
    if (x < 240)
      return ((x / 8 + (y / 4) % 2 * 4) % 2 == 0 || y % 4 == 0 ? Vec3f{0.3F, 0.2F, 0.15F} : Vec3f{0.15F, 0.06F, 0.04F});
    if (x < 360) return x % 6 < 3 ? Vec3f{0.4F, 0.4F, 0.4F} : Vec3f{0.05F, 0.05F, 0.05F};
    return Vec3f{0.1F, 0.13F, 0.1F};
  });
  s.guess();
  CHECK(s.share(label::vegetation, 0, 110, 10, 120) > 0.97);
  CHECK(s.share(label::vegetation, 135, 480, 10, 120) == 0.0);
}

TEST_CASE("guessed labels: a crown at any focal length is one, and a pane in it is closed; a house beside it stays") {
  for (const int factor : {1, 3}) {
    const Shape shape{480 * factor, 270 * factor};
    const auto f = static_cast<float>(400 * factor);
    const Intrinsics camera{f, f, static_cast<float>(shape.width) / 2, static_cast<float>(120 * factor)};
    Image<Rgb8> image(shape, Rgb8{130, 125, 120});
    Image<Label> labels(shape, label::building);
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const int u = x / factor;
        const int v = y / factor;
        const bool pane = u > 120 && u < 128 && v > 100 && v < 108;
        if (u < 240) image(x, y) = pane ? Rgb8{250, 250, 250} : photographed(leaf(u, v));
      }
    }
    npsim_test::Scratch scratch(refine_detail::guess_labels_workspace_bytes(shape));
    SerialExecutor serial;
    REQUIRE(refine_detail::tell_plants(image.cview(), {}, camera, nullptr, labels.view(), scratch.workspace(), serial)
                .ok());
    CAPTURE(factor);
    CHECK(labels(60 * factor, 60 * factor) == label::vegetation);
    CHECK(labels(124 * factor, 104 * factor) == label::vegetation);
    CHECK(labels(300 * factor, 60 * factor) == label::building);
  }
}

TEST_CASE(
    "guessed labels: under a green cast asphalt is a road beside grass; yellow paint and a green corner are too") {
  const Vec3f cast{0.75F, 1.05F, 0.75F};
  Street s;
  s.paint([&](int x, int y) {
    const Vec3f light = cast * (0.9F + 0.2F * draw(x, y));
    if (y < 170) return light * 0.3F;
    if (x < 120) return Vec3f{0.08F * light.x, 0.16F * light.y, 0.06F * light.z};
    if (x > 300 && x < 330) return Vec3f{0.5F * light.x, 0.42F * light.y, 0.06F * light.z};
    const float corner = x > 420 ? 1.12F : 1.0F;
    return Vec3f{0.12F * light.x, 0.12F * corner * light.y, 0.12F * light.z};
  });
  s.guess();
  CHECK(s.share(label::terrain, 5, 110, 180, 265) > 0.99);
  CHECK(s.share(label::road, 130, 475, 180, 265) == 1.0);
}

TEST_CASE("guessed labels: a lawn on four fifths of the ground stays one, and the asphalt beside it a road") {
  Street s;
  s.paint([](int x, int y) {
    return (x < 384 ? Vec3f{0.08F, 0.15F, 0.06F} : Vec3f{0.12F, 0.12F, 0.12F}) * (0.8F + 0.4F * draw(x, y));
  });
  s.guess();
  CHECK(s.share(label::terrain, 5, 370, 180, 265) > 0.99);
  CHECK(s.share(label::road, 400, 475, 180, 265) == 1.0);
}

TEST_CASE("guessed labels: a lawn has no holes of asphalt and asphalt no tufts, a lawn of 60 px square is one") {
  const auto lawn = [](int x, int y) { return (x < 140 && y > 160) || (x >= 360 && x < 420 && y >= 190 && y < 250); };
  const auto hole = [](int x, int y) { return x >= 60 && x < 66 && y >= 200 && y < 206; };
  const auto tuft = [](int x, int y) { return x >= 240 && x < 246 && y >= 220 && y < 226; };
  Street s;
  s.paint([&](int x, int y) {
    const bool green = tuft(x, y) || (lawn(x, y) && !hole(x, y));
    return green ? Vec3f{0.08F, 0.16F, 0.05F} : Vec3f{0.12F, 0.12F, 0.12F};
  });
  s.guess();
  CHECK(s.share(label::terrain, 0, 130, 170, 270) == 1.0);
  CHECK(s.share(label::terrain, 370, 410, 200, 240) == 1.0);
  CHECK(s.share(label::road, 160, 340, 170, 270) == 1.0);
}

TEST_CASE("guessed labels: brown patches and tall grass within a lawn are of it, a crate that stands there is not") {
  const auto within = [](int x, int y, int x0) { return x >= x0 && x < x0 + 30 && y >= 195 && y < 225; };
  Street s;
  s.paint([&](int x, int y) {
    return x >= 384 || within(x, y, 40) ? Vec3f{0.12F, 0.12F, 0.12F} : Vec3f{0.08F, 0.15F, 0.06F};
  });
  s.measure([&](int x, int y) {
    const float above_m = within(x, y, 140) ? 0.35F : (within(x, y, 240) ? 0.9F : 0.0F);
    return std::fmin(20.0F, (1.0F - above_m / 1.5F) * road_m(y));
  });
  s.guess();
  CHECK(s.share(label::terrain, 5, 235, 180, 265) > 0.99);
  CHECK(s.share(label::terrain, 245, 265, 200, 220) == 0.0);
  CHECK(s.share(label::road, 400, 475, 180, 265) == 1.0);
}

TEST_CASE(
    "guessed labels: flecks of sun are no ballast, near, far or beside some, whose stones are told up to its border") {
  constexpr float kFleck_m = 0.4F;
  Street s;
  s.measure([](int, int y) { return y >= 126 ? road_m(y) : 0.0F; });
  const auto ballast = [](int x, int y) {
    return static_cast<float>(x - 240) > 2.0F * (static_cast<float>(y) - 119.5F);
  };
  s.paint([&](int x, int y) {
    const float z = road_m(y);
    const float aside = (static_cast<float>(x) - kCamera.cx) * z / kCamera.fx;
    const bool fleck = y >= 126 && draw(100 + static_cast<int>(std::floor(aside / kFleck_m)),
                                        static_cast<int>(std::floor(z / kFleck_m))) < 0.5F;
    if (ballast(x, y)) return Vec3f{0.22F, 0.2F, 0.18F} * std::exp2(3.0F * (draw(x, y) - 0.5F));
    return Vec3f{0.24F, 0.24F, 0.24F} * ((fleck ? 0.15F : 1.0F) * (0.9F + 0.2F * draw(x, y)));
  });
  s.guess();
  CHECK(s.share(label::road, 0, 225, 130, 270) == 1.0);
  CHECK(s.share(label::rail_track, 400, 470, 145, 160) > 0.97);
  int lost = 0, taken = 0;
  for (int y = 160; y < 190; ++y) {
    for (int x = 240; x < 480; ++x) {
      const bool told = s.labels(x, y) == label::rail_track;
      lost += ballast(x, y) && !told ? 1 : 0;
      taken += !ballast(x, y) && told ? 1 : 0;
    }
  }
  CHECK(lost == 0);
  CHECK(taken < 30 * 15);  // 15 px of each row: windows are 5 px wide, and the nearest flecks rough
}

TEST_CASE("guessed labels: a blue sky goes on down to what is not blue, was measured, or differs by a step") {
  Street s;
  s.paint([](int x, int y) {
    if (y >= 118) return Vec3f{0.2F, 0.2F, 0.2F};
    const float light = 0.2F + 0.002F * static_cast<float>(y);
    if (x < 120 || y < 40) return Vec3f{0.4F * light, 0.7F * light, 2.0F * light};
    if (x < 240) return Vec3f{light, light, light};
    if (x < 360) return Vec3f{0.1F * light, 0.2F * light, 0.5F * light};  // a blue wall in the shade
    return Vec3f{0.4F * light, 0.7F * light, 2.0F * light};
  });
  s.measure([](int x, int y) {
    if (y >= 118) return std::fmin(20.0F, road_m(y));
    return x >= 360 && y >= 40 ? 20.0F : 0.0F;
  });
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < kShape.width; ++x) s.surface(x, y) = 0;
  }
  s.guess();
  CHECK(s.share(label::sky, 0, 120, 0, 118) == 1.0);
  CHECK(s.share(label::sky, 120, 480, 0, 40) == 1.0);
  CHECK(s.share(label::sky, 122, 480, 42, 118) == 0.0);
}

TEST_CASE("guessed labels: under a blue cast the sky is what is bluer than that, and no wall that fades into it") {
  const Vec3f sky{0.35F, 0.7F, 0.8F}, wall{0.1F, 0.2F, 0.22F};
  Street s;
  s.paint([&](int x, int y) {
    const float t = y >= 118 ? 1.0F : clamp_to(static_cast<float>(x - 160) / 160.0F, 0.0F, 1.0F);
    return sky + (wall - sky) * t;
  });
  s.measure([](int, int y) { return y >= 118 ? std::fmin(20.0F, road_m(y)) : 0.0F; });
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 200; ++x) s.surface(x, y) = 0;
  }
  s.guess();
  CHECK(s.share(label::sky, 0, 160, 0, 118) == 1.0);
  CHECK(s.share(label::sky, 290, 480, 0, 118) == 0.0);
}

TEST_CASE("guessed labels: without a ground plane all that is no sky stands; the order of chunks changes no label") {
  Street s;
  s.ground.inlier_share = 0.0F;
  for (int x = 0; x < kShape.width; ++x) s.surface(x, 0) = 0;
  s.guess();
  CHECK(s.share(label::sky, 0, 480, 0, 1) == 1.0);
  CHECK(s.share(label::building, 0, 480, 1, 270) == 1.0);

  Street forth, back;
  for (Street* t : {&forth, &back}) t->paint(leaf);
  forth.guess();
  back.guess(npsim_test::BackwardExecutor{});
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) REQUIRE(forth.labels(x, y) == back.labels(x, y));
  }
}
