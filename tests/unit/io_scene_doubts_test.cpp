// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "npsim/io/scene_doubts.hpp"

namespace {

using namespace npsim;

// A street as plain as can be: sky, facade, road, and boxes of another brightness before them.
io::Scene street() {
  io::Scene scene;
  const Shape shape{192, 108};
  scene.image = io::Image<Rgb8>(shape);
  scene.depth = io::Image<float>(shape);
  scene.labels = io::Image<Label>(shape);
  scene.intrinsics = intrinsics_from_fov(shape, 1.17F);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const bool road = y > 62;
      const bool sky = y < 12;
      const bool box = x < 150 && y > 30 && y < 84 && x % 24 < 10;
      const int grey = box ? 50 : road ? 110 : sky ? 200 : 130;
      scene.image(x, y) =
          Rgb8{static_cast<std::uint8_t>(grey), static_cast<std::uint8_t>(grey), static_cast<std::uint8_t>(grey)};
      scene.depth(x, y) = sky   ? 0.0F
                          : box ? 8.0F - 0.02F * static_cast<float>(x)
                                : std::min(1.5F * 146.0F / static_cast<float>(std::max(y - 54, 1)), 27.0F);
      scene.labels(x, y) = box ? label::car : road ? label::road : sky ? label::sky : label::building;
    }
  }
  return scene;
}

bool doubted(const io::Scene& scene, const std::string& words) {
  const std::vector<std::string> doubts = io::scene_doubts(scene);
  return std::any_of(doubts.begin(), doubts.end(),
                     [&](const std::string& d) { return d.find(words) != std::string::npos; });
}

template <class T>
io::Image<T> mirrored(const io::Image<T>& in, bool x_too, bool y_too) {
  io::Image<T> out(in.shape());
  for (int y = 0; y < in.height(); ++y) {
    for (int x = 0; x < in.width(); ++x) {
      out(x, y) = in(x_too ? in.width() - 1 - x : x, y_too ? in.height() - 1 - y : y);
    }
  }
  return out;
}

}  // namespace

TEST_CASE("scene doubts: a street by day has none") {
  for (const std::string& doubt : io::scene_doubts(street())) FAIL_CHECK(doubt);
}

TEST_CASE("scene doubts: a photograph taken at night, and one that is merely dark below") {
  io::Scene scene = street();
  for (Rgb8& p : scene.image.view().pixels()) {
    p.r = p.g = p.b = static_cast<std::uint8_t>(p.r / 10);
  }
  CHECK(doubted(scene, "night"));
  for (int y = 0; y < 36; ++y) {
    for (int x = 0; x < 192; ++x) scene.image(x, y) = {200, 200, 200};
  }
  CHECK_FALSE(doubted(scene, "night"));
}

TEST_CASE("scene doubts: depth that is turned against the picture, each way, and how") {
  io::Scene scene = street();
  const io::Image<float> depth = scene.depth;
  scene.depth = mirrored(depth, true, false);
  CHECK(doubted(scene, "left to right"));
  scene.depth = mirrored(depth, false, true);
  CHECK(doubted(scene, "upside down"));
  scene.depth = mirrored(depth, true, true);
  CHECK(doubted(scene, "half a circle"));
}

TEST_CASE("scene doubts: hardly any depth, constant depth, a room, no labels") {
  io::Scene scene = street();
  for (float& z : scene.depth.view().pixels()) z = 7.0F;
  CHECK(doubted(scene, "nearly the same everywhere"));
  scene = street();
  for (int y = 0; y < 108; ++y) {
    for (int x = 0; x < 192; ++x) {
      if (x % 16 != 0 || y % 16 != 0) scene.depth(x, y) = 0.0F;
    }
  }
  CHECK(doubted(scene, "hardly any depth"));
  scene = street();
  scene.labels = {};
  CHECK(doubted(scene, "no labels"));
  CHECK_FALSE(doubted(scene, "room"));
  for (float& z : scene.depth.view().pixels()) z = std::min(z, 6.0F);
  CHECK(doubted(scene, "room"));
}
