// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/depth/detail/measured/border_spill.hpp"
#include "npsim/exec/thread_pool.hpp"

namespace {

using namespace npsim;
using npsim_test::Image;

// A wall that turns away, as deep at x as 1 / (a + b x) says, and a pole of 8 m before it; upright or lying.
struct Street {
  bool lying = false;
  Shape shape;
  Image<float> depth;
  Image<Label> labels;

  explicit Street(bool lies = false)
      : lying(lies), shape(lies ? Shape{48, 120} : Shape{120, 48}), depth(shape), labels(shape, label::building) {
    for (int j = 0; j < 48; ++j) {
      for (int i = 0; i < 120; ++i) at(depth, i, j) = wall(i);
      for (int i = 60; i < 64; ++i) {
        at(depth, i, j) = 8.0F;
        at(labels, i, j) = label::pole;
      }
    }
  }
  [[nodiscard]] static float wall(int i) { return 1.0F / (0.04F + 2e-4F * static_cast<float>(i)); }
  template <class T>
  T& at(Image<T>& image, int i, int j) const {
    return lying ? image(j, i) : image(i, j);
  }
  [[nodiscard]] Image<float> kept(const BorderSpillParams& params = {}, bool labelled = true) const {
    Image<float> out = depth;
    const SerialExecutor executor;
    const ObjectMap objects{labelled ? labels.cview() : ImageView<const Label>(), {}};
    REQUIRE(drop_border_spill(params, depth.view(), objects, view, out.view(), executor).ok());
    return out;
  }
  SpillView view;  // nothing is known of it
};

// What is near hides a band of the wall from the right camera: at i in [60 - band, 60), as wide as disparities differ.
constexpr float kFocalBaseline = 240.0F;  // px m
int hidden_band() { return static_cast<int>(kFocalBaseline * (1.0F / 8.0F - 1.0F / Street::wall(60))); }

// Over a level road, without a second camera.
SpillView road_view() {
  SpillView view;
  view.camera = {500, 500, 100, 10};
  view.ground.camera_height_m = 1.5F;
  view.ground.inlier_share = 0.9F;
  return view;
}

}  // namespace

TEST_CASE("border spill: a pole's depth is dropped from the wall beside it, nothing else, along rows and columns") {
  for (const bool lying : {false, true}) {
    Street street(lying);
    for (int j = 0; j < 48; ++j) {
      for (int i = 54; i < 70; ++i) {
        if (j % 3 == 0 && i == 56) {
          street.at(street.depth, i, j) = 0.0F;  // holes are no end
        } else {
          street.at(street.depth, i, j) = 8.0F + 0.1F * static_cast<float>(i % 3);
        }
      }
      for (int i = 40; i < 54; ++i) street.at(street.depth, i, j) = 0.0F;  // hidden from the other camera
    }
    Image<float> out = street.kept();
    for (int j = 0; j < 48; ++j) {
      for (int i = 0; i < 120; ++i) {
        const bool spilled = (i >= 54 && i < 60) || (i >= 64 && i < 70);
        CAPTURE(i);
        CHECK(street.at(out, i, j) == (spilled ? 0.0F : street.at(street.depth, i, j)));
      }
    }
  }
}

TEST_CASE("border spill: sparse beams that smear a pole over its sides are dropped, by what the rows around say") {
  BorderSpillParams laser = BorderSpillParams::laser();
  for (const bool lying : {false, true}) {
    Street street(lying);
    for (int j = 0; j < 48; ++j) {
      for (int i = 52; i < 72; ++i) street.at(street.depth, i, j) = 8.0F + 0.02F * static_cast<float>(i % 3);
      for (int i = 0; i < 120; ++i) {
        if ((i + 2 * j) % 5 != 0 || j % 3 == 1) street.at(street.depth, i, j) = 0.0F;
      }
    }
    Image<float> out = street.kept(laser);
    for (int j = 0; j < 48; ++j) {
      for (int i = 0; i < 120; ++i) {
        const bool smeared = (i >= 52 && i < 60) || (i >= 64 && i < 72);
        CAPTURE(i);
        CAPTURE(j);
        CHECK(street.at(out, i, j) == (smeared ? 0.0F : street.at(street.depth, i, j)));
      }
    }
    laser.lines = 0;  // of some rows no beam meets the pole
    CHECK_FALSE(street.kept(laser) == out);
    laser.lines = 3;
    ThreadPool pool(3);
    Image<float> threaded = street.depth;
    REQUIRE(
        drop_border_spill(laser, street.depth.view(), {street.labels.cview(), {}}, street.view, threaded.view(), pool)
            .ok());
    CHECK(threaded == out);
  }
}

TEST_CASE(
    "border spill: of a pavement behind its kerb, and of a street that rises, a laser's beams stay beside what stands "
    "there, and what they smear goes") {
  constexpr Shape kShape{400, 160};
  SpillView view;
  view.camera = {720, 720, 200, 40};
  view.ground.camera_height_m = 1.65F;
  view.ground.inlier_share = 0.9F;
  const SerialExecutor executor;
  for (const float kerb_m : {0.0F, 0.1F, 0.15F}) {
    for (const float rise : {0.0F, 0.02F}) {
      for (const Label thing : {label::person, label::fence, label::car}) {
        CAPTURE(kerb_m);
        CAPTURE(rise);
        CAPTURE(static_cast<int>(thing));
        Image<float> depth(kShape, 0.0F);
        Image<Label> labels(kShape, label::sidewalk);
        const float foot_m = 9.0F;
        int beams = 0;
        int smeared = 0;
        for (int y = 0; y < kShape.height; ++y) {
          for (int x = 0; x < kShape.width; ++x) {
            // On ground that lies kerb_m higher and, beyond 6 m, rises.
            const float fall = (static_cast<float>(y) + 0.5F - 40.0F) / 720.0F;
            float ground_m = (1.65F - kerb_m) / fall;
            if (ground_m > 6.0F) ground_m = (1.65F - kerb_m + 6.0F * rise) / (fall + rise);
            const bool narrow = thing == label::person;
            const bool in_width = narrow ? x >= 190 && x < 210 : x >= 120 && x < 280;
            const bool stands = fall > 0.0F && in_width && ground_m > foot_m;
            if (!(fall > 0.0F) || ground_m > 60.0F) labels(x, y) = label::building;
            if (stands || (in_width && y < 40)) labels(x, y) = thing;
            if (x % 3 != 0 || y % 5 != 0) continue;
            depth(x, y) = labels(x, y) == thing ? foot_m : labels(x, y) == label::building ? 60.0F : ground_m;
            if (labels(x, y) != label::sidewalk) continue;
            ++beams;
            // What a person's depth is smeared over, from an eighth beyond where he stands.
            if (!narrow || x < 184 || x >= 216 || !(ground_m > 1.125F * foot_m)) continue;
            depth(x, y) = foot_m;
            ++smeared;
          }
        }
        Image<float> out = depth;
        REQUIRE(drop_border_spill(BorderSpillParams::laser(), depth.view(), {labels.cview(), {}}, view, out.view(),
                                  executor)
                    .ok());
        int lost = 0;
        int found = 0;
        for (int y = 0; y < kShape.height; ++y) {
          for (int x = 0; x < kShape.width; ++x) {
            if (labels(x, y) != label::sidewalk || out(x, y) == depth(x, y)) continue;
            ++(depth(x, y) == foot_m ? found : lost);
          }
        }
        REQUIRE(beams > 1000);
        CHECK(lost == 0);
        CHECK(found == smeared);
      }
    }
  }
}

TEST_CASE("border spill: a bumper's beams below the outline that a loose label drew are no road, the road's own stay") {
  // A car of 10 m, its label drawn 12 rows too short, and the road below and beside it, which lies up to 10 cm higher
  // than the plane.
  constexpr Shape kShape{200, 160};
  SpillView view = road_view();
  view.camera = {500, 500, 100, 20};
  const SerialExecutor executor;
  for (const float raised_m : {0.0F, 0.1F}) {
    CAPTURE(raised_m);
    const float height_m = 1.5F - raised_m;
    Image<float> depth(kShape, 0.0F);
    Image<float> expected(kShape, 0.0F);
    Image<Label> labels(kShape, label::road);
    int bumper = 0;
    for (int y = 30; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        const float fall = (static_cast<float>(y) + 0.5F - 20.0F) / 500.0F;
        const float ground_m = height_m / fall;
        const bool of_car = x >= 60 && x < 140 && fall * 10.0F < height_m - 0.3F;  // it ends above the road
        if (of_car && (fall * 10.0F < height_m - 0.54F)) labels(x, y) = label::car;
        if (y % 4 != 0 || (x + y / 4) % 3 != 0) continue;
        const bool echo = y == 120 && x > 98 && x < 102;  // from below the road
        depth(x, y) = of_car ? 10.0F : (echo ? 1.5F : 1.0F) * ground_m;
        const bool loose = of_car && labels(x, y) == label::road;
        bumper += loose ? 1 : 0;
        expected(x, y) = loose ? 0.0F : depth(x, y);
      }
    }
    REQUIRE(bumper > 50);
    Image<float> out = depth;
    const BorderSpillParams laser = BorderSpillParams::laser();
    REQUIRE(drop_border_spill(laser, depth.view(), {labels.cview(), {}}, view, out.view(), executor).ok());
    int left = 0;
    int lost = 0;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        left += out(x, y) > 0.0F && expected(x, y) == 0.0F ? 1 : 0;
        lost += out(x, y) == 0.0F && expected(x, y) > 0.0F ? 1 : 0;
      }
    }
    CHECK(left == 0);
    CHECK(lost == 0);
  }
}

TEST_CASE("border spill: a clean wall, a wall that runs up to the post, the ground and scenes without labels stay") {
  const Street street;
  CHECK(street.kept() == street.depth);

  Street corner;  // steep enough to reach the post's depth
  for (int j = 0; j < 48; ++j) {
    for (int i = 0; i < 60; ++i) corner.depth(i, j) = 1.0F / (0.02F + 1.75e-3F * static_cast<float>(i));
  }
  CHECK(corner.kept() == corner.depth);

  Street spilled;
  for (int j = 0; j < 48; ++j) {
    for (int i = 54; i < 60; ++i) spilled.depth(i, j) = 8.0F;
  }
  CHECK_FALSE(spilled.kept() == spilled.depth);
  CHECK(spilled.kept({}, false) == spilled.depth);
  BorderSpillParams off;
  off.reach_px = 0;
  CHECK(spilled.kept(off) == spilled.depth);
  for (Label& l : spilled.labels.view().pixels()) l = l == label::building ? label::sidewalk : l;
  CHECK(spilled.kept() == spilled.depth);
}

TEST_CASE("border spill: what a pole's depth fills of the band that it hides from the right camera is dropped there") {
  Street street;
  REQUIRE(hidden_band() > 2 * BorderSpillParams{}.reach_px);
  for (int j = 0; j < 48; ++j) {
    for (int i = 62 - hidden_band(); i < 60; ++i) street.depth(i, j) = 8.2F;
    for (int i = 64; i < 85; ++i) street.depth(i, j) = 8.2F;  // the right camera sees this
  }
  const Image<float> without_band = street.kept();
  street.view.focal_baseline_px_m = kFocalBaseline;
  const Image<float> out = street.kept();
  for (int j = 0; j < 48; ++j) {
    for (int i = 0; i < 120; ++i) {
      CAPTURE(i);
      const bool band = i >= 62 - hidden_band() && i < 60;
      if (band) CHECK(out(i, j) == 0.0F);
      if (i < 60 && !band) CHECK(out(i, j) == street.depth(i, j));
      if (i >= 64) CHECK(out(i, j) == without_band(i, j));
    }
  }
  // A bush may stand there.
  for (Label& l : street.labels.view().pixels()) l = l == label::building ? label::vegetation : l;
  CHECK(street.kept()(30, 20) == street.depth(30, 20));
}

TEST_CASE("border spill: a wall that turns a corner in the hidden band stays, and a tiny camera height is no ground") {
  Street street;
  street.view.focal_baseline_px_m = 1000.0F;
  for (int j = 0; j < 48; ++j) {
    for (int i = 0; i < 60; ++i) {  // oblique up to 20, then facing the camera
      street.depth(i, j) = i < 20 ? 1.0F / (0.025F + 2.5e-3F * static_cast<float>(20 - i)) : 40.0F;
    }
  }
  Image<float> out = street.kept();
  for (int j = 0; j < 48; ++j) {
    for (int i = 0; i < 60; ++i) CHECK(out(i, j) == street.depth(i, j));
  }
  street.view.ground = {{0, -1, 0}, 1e-45F, 1.0F};
  for (Label& l : street.labels.view().pixels()) l = l == label::building ? label::road : l;
  out = street.kept();
  CHECK(out == street.depth);
}

TEST_CASE("border spill: what a wide thing hides on both sides of it is left, for another house may stand there") {
  Street street;
  for (int j = 0; j < 48; ++j) {
    for (int i = 15; i < 64; ++i) {
      street.depth(i, j) = 8.0F;
      street.labels(i, j) = label::car;
    }
    for (int i = 64; i < 68; ++i) street.depth(i, j) = 8.1F;
    for (int i = 68; i < 120; ++i) street.labels(i, j) = label::vegetation;
  }
  CHECK(street.kept()(65, 20) == street.depth(65, 20));
}

TEST_CASE("border spill: a sliver of wall between two poles is known by the wall beyond them, a sliver of a sign not") {
  for (const bool lying : {false, true}) {
    Street street(lying);
    for (int j = 0; j < 48; ++j) {
      for (int i = 68; i < 70; ++i) {
        street.at(street.depth, i, j) = 8.0F;
        street.at(street.labels, i, j) = label::pole;
      }
      for (int i = 64; i < 68; ++i) street.at(street.depth, i, j) = 8.1F;
    }
    Image<float> out = street.kept();
    CHECK(street.at(out, 65, 20) == 0.0F);
    CHECK(street.at(out, 66, 20) == 0.0F);
    CHECK(street.at(out, 80, 20) == street.at(street.depth, 80, 20));
    for (int j = 0; j < 48; ++j) {
      for (int i = 64; i < 68; ++i) street.at(street.labels, i, j) = label::traffic_sign;
    }
    out = street.kept();
    CHECK(street.at(out, 65, 20) == street.at(street.depth, 65, 20));
  }
}

TEST_CASE(
    "border spill: pavement at the depth of a car before it is dropped by the ground plane, not at the car's foot") {
  constexpr Shape kShape{120, 60};
  const Intrinsics camera{120, 120, 60, 10};
  const GroundPlane ground{{0, -1, 0}, 1.5F, 0.9F};
  const auto plane = [&](int y) { return 1.5F * 120.0F / (static_cast<float>(y) - 10.0F); };
  Image<float> depth(kShape), out(kShape);
  Image<Label> labels(kShape, label::sidewalk);
  constexpr int kFoot = 50;  // row
  for (int y = 12; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      depth(x, y) = plane(y);
      if (y < kFoot && y >= 20 && x >= 60 && x < 90) {
        labels(x, y) = label::car;
        depth(x, y) = plane(kFoot);
      } else if (y >= 20 && y < kFoot && x >= 56 && x < 60) {
        depth(x, y) = plane(kFoot) + 0.05F;  // spilled
      }
    }
  }
  const SerialExecutor executor;
  for (const bool known : {true, false}) {
    SpillView view{camera, ground, 0.0F};
    if (!known) view.ground.inlier_share = 0.0F;
    out = depth;
    REQUIRE(drop_border_spill({}, depth.cview(), {labels.cview(), {}}, view, out.view(), executor).ok());
    for (int y = 12; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        CAPTURE(x);
        CAPTURE(y);
        const bool spilled = known && x >= 56 && x < 60 && y >= 20 && plane(y) > 1.25F * plane(kFoot);
        const bool unsure = x >= 56 && x < 60 && y < kFoot && y >= 20;
        if (spilled || !unsure) CHECK(out(x, y) == (spilled ? 0.0F : depth(x, y)));
      }
    }
  }
  for (Label& l : labels.view().pixels()) l = l == label::sidewalk ? label::terrain : l;  // banks rise
  out = depth;
  REQUIRE(
      drop_border_spill({}, depth.cview(), {labels.cview(), {}}, {camera, ground, 0.0F}, out.view(), executor).ok());
  CHECK(out == depth);
}

TEST_CASE("border spill: the ground under a car takes not its depth, wherever it lies and however high it is") {
  constexpr Shape kShape{40, 160};
  constexpr int kFoot = 60;   // the car's lowest row is above
  constexpr int kUnder = 21;  // three reaches
  constexpr float kCar_m = 10.0F;
  for (const float raised_m : {0.0F, 0.12F}) {  // a road that lies over the plane of the whole
    SpillView view;
    view.camera = {500, 500, 20, 10};
    view.ground.camera_height_m = 1.2F;
    view.ground.inlier_share = 0.9F;
    view.focal_baseline_px_m = 470.0F;
    Image<float> depth(kShape);
    Image<Label> labels(kShape, label::road);
    const auto road_m = [&](int x, int y) {
      return (1.2F - raised_m) / -dot(view.ground.up, unproject_pixel(view.camera, x, y, 1.0F));
    };
    const auto spilled = [&](int x, int y) { return x >= 10 && x < 30 && y >= kFoot && y < kFoot + 15; };
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        if (y < kFoot) labels(x, y) = label::car;
        const float noise_px = 0.2F * static_cast<float>((x + y) % 3 - 1);
        const float disparity = 470.0F / (y < kFoot ? kCar_m : road_m(x, y)) + noise_px;
        depth(x, y) = 470.0F / (spilled(x, y) ? disparity + 1.5F : disparity);
      }
    }
    const auto kept = [&](const SpillView& seen, const BorderSpillParams& params = {}) {
      Image<float> out = depth;
      const SerialExecutor executor;
      REQUIRE(drop_border_spill(params, depth.view(), ObjectMap{labels.cview(), {}}, seen, out.view(), executor).ok());
      return out;
    };
    const Image<float> out = kept(view);
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        CAPTURE(x);
        CAPTURE(y);
        CHECK(out(x, y) == (spilled(x, y) ? 0.0F : depth(x, y)));
      }
    }
    BorderSpillParams off;
    off.under_reaches = 0;
    CHECK(kept(view, off) == depth);
    SpillView unknown = view;
    unknown.ground.inlier_share = 0.0F;
    CHECK(kept(unknown) == depth);
    // Of little road between a car and a kerb nothing is known.
    for (int y = kFoot + kUnder + 10; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) labels(x, y) = label::sidewalk;
    }
    CHECK(kept(view) == depth);
  }
}

TEST_CASE("border spill: pavement that rises from its kerb to the foot of a house stays, what is nearer not") {
  constexpr Shape kShape{200, 220};
  SpillView view = road_view();
  view.focal_baseline_px_m = 470.0F;
  const auto foot = [](int x) { return 40 + x / 2; };  // of a house along the street
  const auto is_nearer = [&](int x, int y) { return x >= 100 && x % 20 < 5 && y >= foot(x) && y < foot(x) + 12; };
  for (const float rise : {0.0F, 0.02F, 0.1F}) {  // per metre beyond the kerb, 8 m ahead
    const auto pavement_m = [&](int y) {
      return (1.5F + 8.0F * rise) / (unproject_pixel(view.camera, 0, y, 1.0F).y + rise);
    };
    Image<float> depth(kShape);
    Image<Label> labels(kShape, label::sidewalk);
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        depth(x, y) = pavement_m(std::max(y, foot(x)));
        if (y < foot(x)) {
          labels(x, y) = label::building;
          if (rise == 0.0F && x >= 150) depth(x, y) *= 1.3F;  // its foot is hidden
        }
        if (is_nearer(x, y)) depth(x, y) = 470.0F / (470.0F / depth(x, y) + 2.0F);
      }
    }
    Image<float> out = depth;
    const SerialExecutor executor;
    REQUIRE(drop_border_spill({}, depth.view(), ObjectMap{labels.cview(), {}}, view, out.view(), executor).ok());
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 60; x < kShape.width; ++x) {  // left of it a row has too little pavement to know it by
        CAPTURE(rise);
        CAPTURE(x);
        CAPTURE(y);
        CHECK(out(x, y) == (is_nearer(x, y) ? 0.0F : depth(x, y)));
      }
    }
  }
}

TEST_CASE("border spill: a corner of a house takes the pavement behind it no farther than it reaches") {
  constexpr Shape kShape{200, 160};
  SpillView view = road_view();
  const auto pavement_m = [&](int y) { return 1.66F / (unproject_pixel(view.camera, 0, y, 1.0F).y + 0.02F); };
  constexpr int kFoot = 140, kCorner = 120;
  Image<float> depth(kShape);
  Image<Label> labels(kShape, label::sidewalk);
  const auto is_spilled = [](int x, int y) { return y >= 50 && y < 80 && x >= kCorner - 5 && x < kCorner; };
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const bool house = x >= kCorner && y < kFoot;
      if (house || y < 40) labels(x, y) = label::building;
      depth(x, y) = house || is_spilled(x, y) ? pavement_m(kFoot) : pavement_m(std::max(y, 40));
    }
  }
  Image<float> out = depth;
  const SerialExecutor executor;
  REQUIRE(drop_border_spill({}, depth.view(), ObjectMap{labels.cview(), {}}, view, out.view(), executor).ok());
  for (int y = 41; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      CAPTURE(x);
      CAPTURE(y);
      CHECK(out(x, y) == (is_spilled(x, y) ? 0.0F : depth(x, y)));
    }
  }
}

TEST_CASE("border spill: the top of a mast that a car hides takes not the depth of its roof, a shorter piece is left") {
  for (const int rows : {9, 5}) {
    Image<float> depth({40, 60}, 50.0F);
    Image<Label> labels({40, 60}, label::building);
    for (int y = 0; y < 60; ++y) {
      for (int x = 0; x < 40; ++x) {
        if (y >= 28) depth(x, y) = 16.0F;  // the car, and two rows above it
        if (y >= 30) labels(x, y) = label::car;
        if (y < 30 && y >= 30 - rows && x >= 18 && x < 22) labels(x, y) = label::pole;
      }
    }
    Image<float> kept = depth;
    const SerialExecutor executor;
    REQUIRE(drop_border_spill({}, depth.view(), {labels.cview(), {}}, {}, kept.view(), executor).ok());
    for (int x = 18; x < 22; ++x) {
      CHECK(kept(x, 30 - rows) == 50.0F);
      CHECK(kept(x, 27) == 50.0F);
      CHECK(kept(x, 28) == (rows == 9 ? 0.0F : 16.0F));
      CHECK(kept(x, 29) == (rows == 9 ? 0.0F : 16.0F));
      CHECK(kept(x, 30) == 16.0F);
    }
  }
}

TEST_CASE("border spill: one pixel, nothing measured, parameters and sizes out of range") {
  const SerialExecutor executor;
  Image<float> one({1, 1}, 3.0F);
  Image<Label> labels({1, 1}, label::building);
  Image<float> out = one;
  const ObjectMap objects{labels.cview(), {}};
  REQUIRE(drop_border_spill({}, one.view(), objects, {}, out.view(), executor).ok());
  CHECK(out(0, 0) == 3.0F);
  Street empty;
  for (float& z : empty.depth.view().pixels()) z = 0.0F;
  CHECK(empty.kept() == empty.depth);
  BorderSpillParams params;
  params.reach_px = 129;
  CHECK(drop_border_spill(params, one.view(), objects, {}, out.view(), executor).code() ==
        StatusCode::invalid_argument);
  params = {};
  params.lines = 9;
  CHECK(drop_border_spill(params, one.view(), objects, {}, out.view(), executor).code() ==
        StatusCode::invalid_argument);
  params = {};
  params.contrast = 0.9F;
  CHECK(drop_border_spill(params, one.view(), objects, {}, out.view(), executor).code() ==
        StatusCode::invalid_argument);
  CHECK(drop_border_spill({}, empty.depth.view(), objects, {}, out.view(), executor).code() ==
        StatusCode::shape_mismatch);
}
