// SPDX-License-Identifier: Apache-2.0
// The bonnet of the own car in depth: what is taken for it, and what is not.
#include "npsim/depth/detail/given/own_car.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "fixture.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

constexpr Shape kShape{240, 160};
constexpr Intrinsics kCamera{200, 200, 120, 60};
constexpr Label kThing = label::building;

// A camera over a road, of which a bonnet hides the lowest rows; the sky is 200 m away.
struct View {
  GroundPlane ground{{0, -1, 0}, 1.2F, 0.9F};
  Image<float> depth{kShape, 200.0F};
  Image<Label> labels{kShape, kThing};

  View() {
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        if (fall(y) > 0.006F) depth(x, y) = 1.2F / fall(y);
        if (is_bonnet(x, y)) depth(x, y) = 0.25F / fall(y);
      }
    }
  }
  [[nodiscard]] static float fall(int y) { return (static_cast<float>(y) + 0.5F - kCamera.cy) / kCamera.fy; }
  [[nodiscard]] static bool is_bonnet(int x, int y) { return x >= 20 && x < 220 && fall(y) > 0.125F; }  // 2 m
  void mark(LabelSet kept = kNoSurfaceLabels) {
    refine_detail::mark_own_car(depth.cview(), kCamera, ground, kept, labels.view());
  }
  // Own: what is to be of the own car; all else keeps what it is labelled.
  template <class Own>
  void check(const Own& own) const {
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        CAPTURE(x);
        CAPTURE(y);
        REQUIRE((labels(x, y) == label::ego_vehicle) == own(x, y));
      }
    }
  }
  void check_none() const {
    check([](int, int) { return false; });
  }
};

}  // namespace

TEST_CASE("own car: a bonnet is of the own car, in metres and in any other scale; the road and a car ahead are not") {
  for (const float scale : {1.0F, 0.2F, 7.0F}) {
    View v;
    v.depth.fill_rectangle(90, 40, 150, 84, 4.0F);           // its foot is hidden by the bonnet
    v.depth.fill_rectangle(0, 20, 12, kShape.height, 2.3F);  // beside the bonnet
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) v.depth(x, y) *= scale;
    }
    v.ground.camera_height_m *= scale;
    v.mark();
    v.check(View::is_bonnet);
  }
}

TEST_CASE("own car: the ramp that a network draws between bonnet and road goes, the road behind it stays") {
  View v;
  const Image<float> sharp = v.depth;
  const auto is_ramp = [](int x, int y) { return x >= 20 && x < 220 && y >= 80 && y < 85; };
  for (int y = 80; y < 85; ++y) {
    for (int x = 20; x < 220; ++x) {
      const float t = (static_cast<float>(y) - 79.55F) / 6.0F;
      v.depth(x, y) = sharp(x, 79) * std::pow(sharp(x, 85) / sharp(x, 79), t);
    }
  }
  v.mark();
  // Of its rows the farthest is not a tenth of the camera's height above the ground.
  v.check([&](int x, int y) { return View::is_bonnet(x, y) || (is_ramp(x, y) && y > 80); });
}

TEST_CASE("own car: a wall that leads away beside a bonnet loses its first column, no more") {
  View v;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < 20; ++x) v.depth(x, y) = std::min(v.depth(x, y), 2.7F + 0.01F * static_cast<float>(20 - x));
  }
  v.mark();
  v.check([](int x, int y) {
    const float above_m = 1.2F - 2.71F * View::fall(y);
    return View::is_bonnet(x, y) || (x == 19 && View::is_bonnet(20, y) && above_m > 0.12F);
  });
}

TEST_CASE("own car: what was not measured of a bonnet, and below it, is of it") {
  View v;
  v.depth.fill_rectangle(100, 100, 140, 120, 0.0F);
  v.depth.fill_rectangle(0, 155, kShape.width, kShape.height, std::numeric_limits<float>::quiet_NaN());
  v.depth.fill_rectangle(30, 70, 40, 80, 0.0F);  // of the road
  v.mark();
  v.check(View::is_bonnet);
}

TEST_CASE("own car: less than half of the lowest row, a table in a room, or the far end of a bonnet too far is none") {
  View beside;
  beside.depth.fill_rectangle(0, 80, 20, kShape.height, 2.0F);
  for (int y = 80; y < kShape.height; ++y) {
    for (int x = 110; x < kShape.width; ++x) beside.depth(x, y) = 1.2F / View::fall(y);
  }
  beside.mark();
  beside.check_none();

  View room;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) room.depth(x, y) = std::min(room.depth(x, y), 11.5F);
  }
  room.mark();
  room.check_none();
  room.labels.fill_rectangle(0, 0, 100, 10, label::sky);  // through a window
  room.mark();
  room.check(View::is_bonnet);

  constexpr Intrinsics kTele{400, 400, 120, 60};
  for (const float z : {2.6F, 2.7F}) {
    View lorry;  // that stands ahead
    lorry.depth.fill_rectangle(20, 30, 220, kShape.height, z);
    lorry.depth.fill_rectangle(0, 0, 20, kShape.height, 200.0F);
    lorry.depth.fill_rectangle(220, 0, kShape.width, kShape.height, 200.0F);
    refine_detail::mark_own_car(lorry.depth.cview(), kTele, lorry.ground, kNoSurfaceLabels, lorry.labels.view());
    CHECK(lorry.labels(120, 159) == (z < 2.65F ? label::ego_vehicle : kThing));
  }
}

TEST_CASE("own car: a kerb, the road, kept labels, and no ground") {
  View low;  // .28 m above the ground
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (View::is_bonnet(x, y)) low.depth(x, y) = 0.92F / View::fall(y);
    }
  }
  low.mark();
  low.check_none();

  View labelled;
  labelled.labels.fill_rectangle(60, 0, 100, kShape.height, label::road);
  labelled.labels.fill_rectangle(150, 90, 160, 95, label::sky);
  labelled.mark(kGroundLabels | kNoSurfaceLabels);
  labelled.check([](int x, int y) {
    return View::is_bonnet(x, y) && (x < 60 || x >= 100) && (x < 150 || x >= 160 || y < 90 || y >= 95);
  });

  View unknown;
  unknown.ground.inlier_share = 0.0F;
  unknown.mark();
  unknown.check_none();

  Image<float> one({1, 1}, 1.0F);
  Image<Label> of_one({1, 1}, kThing);
  refine_detail::mark_own_car(one.cview(), kCamera, GroundPlane{{0, -1, 0}, 1.2F, 0.9F}, kNoSurfaceLabels,
                              of_one.view());
  CHECK(of_one(0, 0) == kThing);
}
