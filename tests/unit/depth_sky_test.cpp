// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/sky.hpp"

#include <doctest/doctest.h>

#include "fixture.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

// Measured below row 40; a dark tower from there up to row 10, and beside it the sky down to row 30.
struct View {
  Shape shape{100, 60};
  Image<Rgb8> image{shape, Rgb8{70, 70, 60}};
  Image<float> depth{shape, 0.0F};
  Image<std::uint8_t> surface{shape, 9};
  View() {
    for (int y = 0; y < 60; ++y) {
      for (int x = 0; x < 100; ++x) {
        const bool tower = x >= 30 && x < 60 && y >= 10;
        if (y < 30 && !tower) image(x, y) = Rgb8{190, 200, 220};
        if (y >= 40 && (x + y) % 3 == 0) depth(x, y) = 20.0F;
      }
    }
  }
  void run() { find_sky(image.cview(), depth.cview(), surface.view()); }
};

}  // namespace

TEST_CASE("without labels a tower keeps its outline above the sensor's last row, and the sky begins where it is seen") {
  View v;
  for (int y = 20; y < 24; ++y) {
    for (int x = 40; x < 44; ++x) v.image(x, y) = Rgb8{250, 250, 250};  // a bright window
  }
  v.image(80, 5) = Rgb8{20, 20, 20};  // a bird
  v.run();
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) CHECK(v.surface(x, y) == (y >= 30 || (x >= 30 && x < 60 && y >= 10) ? 1 : 0));
  }
}

TEST_CASE("where the picture does not tell the sky apart it begins above the topmost measurements") {
  View v;
  for (Rgb8& c : v.image.view().pixels()) c = Rgb8{120, 120, 120};
  v.run();
  for (int y = 0; y < 60; ++y) CHECK(v.surface(50, y) == (y >= 40 ? 1 : 0));
  View night;  // the road is brighter than all above it
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) {
      const auto grey = static_cast<std::uint8_t>(y >= 40 ? 200 : night.image(x, y).g / 4);
      night.image(x, y) = Rgb8{grey, grey, grey};
    }
  }
  night.run();
  for (int y = 0; y < 60; ++y) CHECK(night.surface(50, y) == (y >= 40 ? 1 : 0));
}

TEST_CASE("a dense depth map is all surface") {
  View v;
  for (float& z : v.depth.view().pixels()) z = 10.0F;
  v.run();
  for (const std::uint8_t s : v.surface.view().pixels()) CHECK(s == 1);
}
