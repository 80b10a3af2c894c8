// SPDX-License-Identifier: Apache-2.0
// The bonnet of the own car in depth: what is taken for it, and what is not.
#include "npsim/depth/detail/given/own_car.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>

#include "fixture.hpp"
#include "npsim/core/random.hpp"

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
  void mark(LabelSet may_be = refine_detail::kGuessedBonnetLabels, ImageView<const std::uint16_t> lights = {},
            const Intrinsics& camera = kCamera) {
    refine_detail::mark_own_car(depth.cview(), camera, ground, may_be, lights, labels.view());
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

TEST_CASE("own car: a bonnet is of the own car, in metres and in scales near it; the road and a car ahead are not") {
  for (const float scale : {1.0F, 0.7F, 7.0F}) {
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

TEST_CASE("own car: people that stand at the bumper, and a wall close beside, keep all but the pixels at the outline") {
  View v;
  v.depth.fill_rectangle(100, 20, 130, 100, 2.5F);  // hides a part of the bonnet
  v.depth.fill_rectangle(0, 20, 20, kShape.height, 1.4F);
  const auto is_person = [](int x, int y) { return x >= 100 && x < 130 && y >= 20 && y < 100; };
  v.mark();
  int taken = 0;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const bool own = v.labels(x, y) == label::ego_vehicle;
      if (is_person(x, y) || x == 19) {
        taken += own ? 1 : 0;
      } else if (View::is_bonnet(x, y)) {
        REQUIRE(own);
      } else {
        REQUIRE_FALSE(own);
      }
    }
  }
  CHECK(taken <= 2 * (100 - 85) + 30 + (kShape.height - 85));  // one pixel wide
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
  v.check([](int x, int y) { return View::is_bonnet(x, y) || (x == 19 && View::is_bonnet(20, y)); });
}

TEST_CASE("own car: noise of a hundredth bends a bonnet here and there, it is of the own car whole") {
  View v;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      RandomStream random(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * kShape.width + x), 0);
      if (View::is_bonnet(x, y)) v.depth(x, y) *= 1.0F + 0.01F * (2.0F * random.uniform() - 1.0F);
    }
  }
  v.mark();
  v.check(View::is_bonnet);
}

TEST_CASE("own car: what was not measured of a bonnet, and below it, is of it") {
  View v;
  v.depth.fill_rectangle(100, 100, 140, 120, 0.0F);
  v.depth.fill_rectangle(0, 155, kShape.width, kShape.height, std::numeric_limits<float>::quiet_NaN());
  v.depth.fill_rectangle(30, 70, 40, 80, 0.0F);  // of the road
  v.mark();
  v.check(View::is_bonnet);
}

TEST_CASE(
    "own car: half of the lowest row, a table in a room, what stands ahead or to both sides, and what is far is none") {
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

  // Lorries and people ahead are upright, walls to both sides leave the middle free.
  View lorry;
  lorry.depth.fill_rectangle(0, 30, kShape.width, kShape.height, 1.5F);
  lorry.mark();
  lorry.check_none();
  View lane;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (std::abs(x - 120) < 50 && y > 62) lane.depth(x, y) = 1.2F / View::fall(y);
    }
  }
  lane.mark();
  lane.check_none();

  // The same bonnet seen by a lens of twice the length lies nearer than 2.2 heights of the camera, or farther.
  constexpr Intrinsics kTele{400, 400, 120, 60};
  for (const float z : {2.5F, 2.8F}) {
    View far;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        const float fall = 0.5F * View::fall(y);
        far.depth(x, y) = fall > 0.125F ? z * 0.2475F / fall : (fall > 0.006F ? 1.2F / fall : 200.0F);
      }
    }
    far.mark(refine_detail::kGuessedBonnetLabels, {}, kTele);
    CHECK(far.labels(120, 159) == (z < 2.64F ? label::ego_vehicle : kThing));
  }
}

TEST_CASE("own car: what is low or high, labels that tell otherwise, marked lights, robots, and no ground") {
  View low;  // .28 m above the ground
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (View::is_bonnet(x, y)) low.depth(x, y) = 0.92F / View::fall(y);
    }
  }
  low.mark();
  low.check_none();

  View high;  // above .9 of the camera's height
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (View::is_bonnet(x, y)) high.depth(x, y) = 0.1F / View::fall(y);
    }
  }
  high.mark();
  high.check_none();

  View labelled;
  labelled.labels.fill_rectangle(0, 0, kShape.width, kShape.height, label::car);
  labelled.labels.fill_rectangle(40, 0, 55, kShape.height, label::road);
  labelled.labels.fill_rectangle(190, 90, 200, 110, label::person);
  labelled.labels.fill_rectangle(60, 120, 65, 125, label::road);
  labelled.depth.fill_rectangle(45, 120, 65, 125, 0.0F);
  Image<std::uint16_t> lights(kShape, 0);
  lights.fill_rectangle(100, 100, 110, 105, 1);
  labelled.mark(refine_detail::kBonnetLabels, lights.cview());
  labelled.check([](int x, int y) {
    const bool person = x >= 190 && x < 200 && y >= 90 && y < 110;
    const bool hole = x >= 60 && x < 65 && y >= 120 && y < 125;
    const bool light = x >= 100 && x < 110 && y >= 100 && y < 105;
    return View::is_bonnet(x, y) && (x < 40 || x >= 55) && !hole && !person && !light;
  });

  View told;
  told.labels(3, 3) = label::ego_vehicle;
  told.mark();
  told.check([](int x, int y) { return x == 3 && y == 3; });

  View robot;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) robot.depth(x, y) *= 0.6F;
  }
  robot.ground.camera_height_m *= 0.6F;
  robot.mark();
  robot.check_none();

  View unknown;
  unknown.ground.inlier_share = 0.0F;
  unknown.mark();
  unknown.check_none();

  Image<float> one({1, 1}, 1.0F);
  Image<Label> of_one({1, 1}, kThing);
  refine_detail::mark_own_car(one.cview(), kCamera, GroundPlane{{0, -1, 0}, 1.2F, 0.9F},
                              refine_detail::kGuessedBonnetLabels, {}, of_one.view());
  CHECK(of_one(0, 0) == kThing);
}
