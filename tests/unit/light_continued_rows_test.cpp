// SPDX-License-Identifier: Apache-2.0
// Street lamps that the photograph does not show.
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "fixture.hpp"
#include "npsim/light/activation.hpp"
#include "npsim/light/photometry.hpp"
#include "npsim/light/unmarked.hpp"
#include "npsim/render/direct.hpp"

namespace {

using namespace npsim;
using npsim_test::Image;

// A camera 1.5 m above a level ground under the sky, with placed lamps.
struct Street {
  Shape shape{200, 100};
  Intrinsics camera{180, 180, 100, 50};
  Vec3f up{0, -1, 0};
  Image<float> depth{shape};
  Image<Label> labels{shape, label::sky};
  std::vector<Emitter> lamps = std::vector<Emitter>(40);
  std::size_t count = 0;
  ContinuedRowParams params;

  void lamp(Vec3f at, EmissionProfile profile = EmissionProfile::street_luminaire, float road = 1.0F,
            LightClass cls = LightClass::street_light_ht) {
    Emitter e;
    e.centre_m = at;
    e.axis = {0, 1, 0};
    e.up = {0, 0, road};
    e.profile = profile;
    e.cls = cls;
    e.mounting_height_m = 1.5F - at.y;
    e.mark = static_cast<std::uint16_t>(count + 1);
    lamps[count++] = e;
  }
  void show(Label label, float z, int x0, int y0, int x1, int y1) {
    labels.fill_rectangle(x0, y0, x1, y1, label);
    depth.fill_rectangle(x0, y0, x1, y1, z);
  }
  [[nodiscard]] std::vector<Emitter> unseen() {
    PlacementScene scene;
    scene.camera = camera;
    scene.ground.up = up;
    scene.ground.camera_height_m = 1.5F;
    scene.depth = depth.view();
    scene.labels = labels.view();
    const std::size_t placed = count;
    REQUIRE(continue_rows(params, scene, Span<Emitter>(lamps.data(), lamps.size()), count).ok());
    std::vector<Emitter> out(lamps.begin() + static_cast<std::ptrdiff_t>(placed),
                             lamps.begin() + static_cast<std::ptrdiff_t>(count));
    count = placed;
    return out;
  }
};

}  // namespace

TEST_CASE("a row goes on at its own gap, past the camera, as high and on the same side as it is seen") {
  Street s;
  for (const float z : {80.0F, 25.0F, 52.0F}) s.lamp({4, -6.5F, z});
  const std::vector<Emitter> unseen = s.unseen();
  REQUIRE(unseen.size() == 3);  // gaps of 27 and 28: at -3, -31, -59
  for (std::size_t i = 0; i < unseen.size(); ++i) {
    CHECK(unseen[i].centre_m.z == doctest::Approx(-3.0 - 28.0 * static_cast<double>(i)).epsilon(1e-4));
    CHECK(unseen[i].centre_m.x == doctest::Approx(4));
    CHECK(unseen[i].centre_m.y == doctest::Approx(-6.5));
    CHECK(unseen[i].mark == 0);
    CHECK(unseen[i].unseen == i + 1);
    CHECK(!is_own_headlamp(unseen[i]));
    CHECK(unseen[i].profile == EmissionProfile::street_luminaire);
    CHECK(unseen[i].up.z == 1.0F);
  }
}

TEST_CASE(
    "a lamp alone, or two at one station, go on at 3.5 times their height; a missing lamp in a row does not widen it") {
  Street s;
  s.lamp({0, -6.5F, 10}, EmissionProfile::hung_luminaire);
  CHECK(s.unseen()[0].centre_m.z == doctest::Approx(10 - 28).epsilon(1e-4));
  s.lamp({0.5F, -6.5F, 13}, EmissionProfile::hung_luminaire);
  CHECK(s.unseen()[0].centre_m.z == doctest::Approx(10 - 28).epsilon(1e-4));
  for (const float z : {30.0F, 110.0F, 130.0F}) s.lamp({0, -6.5F, z}, EmissionProfile::hung_luminaire);
  CHECK(s.unseen()[0].centre_m.z == doctest::Approx(-10).epsilon(1e-4));
}

TEST_CASE(
    "a row ends at the first station that the picture would show and does not, or in a house, and passes what hides "
    "it") {
  Street s;
  s.lamp({1, -6.5F, 90});
  s.lamp({1, -6.5F, 60});
  CHECK(s.unseen().empty());  // z = 30 is before the sky
  s.show(label::vegetation, 9, 0, 0, 200, 50);
  CHECK(s.unseen().size() == 3);  // 30 behind leaves is passed over; 0, -30, -60
  for (Label& l : s.labels.view().pixels()) l = label::building;
  CHECK(s.unseen().empty());
}

TEST_CASE(
    "a lamp above the picture beside a tree that the border cuts is passed over; beside a house or farther off it is "
    "not") {
  Street s;
  s.lamp({3, -6.5F, 40});
  s.lamp({3, -6.5F, 68});
  // The next station, 12 m ahead and above the picture, is 3.3 m from what pixels about (135, 0) show at its depth.
  const auto first = [&] { return s.unseen()[0].centre_m.z; };
  CHECK(first() == doctest::Approx(12).epsilon(1e-4));
  s.show(label::vegetation, 12, 130, 0, 140, 1);
  CHECK(first() == doctest::Approx(12).epsilon(1e-4));  // too far below
  s.lamps[0].centre_m.y = s.lamps[1].centre_m.y = -4.2F;
  CHECK(first() == doctest::Approx(-16).epsilon(1e-4));
  s.show(label::vegetation, 8, 130, 0, 140, 1);
  CHECK(first() == doctest::Approx(12).epsilon(1e-4));
  s.show(label::building, 12, 130, 0, 140, 1);
  CHECK(first() == doctest::Approx(12).epsilon(1e-4));
}

TEST_CASE("rows of two classes and of both sides go on by themselves; signals and cars have none") {
  Street s;
  s.lamp({5, -6.5F, 20});
  s.lamp({-5, -6.5F, 12}, EmissionProfile::street_luminaire, -1.0F);
  s.lamp({-6, -2.5F, 9}, EmissionProfile::lantern, -1.0F, LightClass::street_light_lt);
  s.lamp({0, 0.8F, 9}, EmissionProfile::signal, 1.0F, LightClass::moving_rear);
  int right = 0;
  int left = 0;
  int low = 0;
  for (const Emitter& e : s.unseen()) {
    right += e.centre_m.x == 5.0F ? 1 : 0;
    left += e.centre_m.x == -5.0F ? 1 : 0;
    low += e.cls == LightClass::street_light_lt ? 1 : 0;
    CHECK(e.cls != LightClass::moving_rear);
  }
  CHECK(right == 2);  // -8, -36
  CHECK(left == 2);   // -16, -44
  CHECK(low == 4);    // every 14 m: -5, -19, -33, -47
  s.params.behind_m = 0;
  CHECK(s.unseen().empty());
}

TEST_CASE("no lamp marked: nothing, unless a road of some width is assumed; the number of lamps is bounded") {
  Street s;
  CHECK(s.unseen().empty());
  CHECK(most_unseen_lamps(s.params, 0) == 0);
  s.params.assumed_width_m = 8;
  const std::vector<Emitter> row = s.unseen();
  REQUIRE(row.size() == 3);
  for (const Emitter& e : row) {
    CHECK(e.mounting_height_m == 8.0F);
    CHECK(e.centre_m.x == doctest::Approx(2));
  }
  s.params.min_gap_m = 1;
  s.params.max_gap_m = 2;
  s.params.behind_m = 400;
  CHECK(s.unseen().size() == kMaxUnseenLamps);
  s.params.max_gap_m = 1;
  CHECK(!validate(s.params).ok());
}

TEST_CASE(
    "an assumed row begins as far ahead as the picture does not show it, and before a house that its border cuts") {
  Street s;
  s.params.assumed_width_m = 8;
  const auto first = [&] { return s.unseen()[0].centre_m.z; };
  CHECK(first() == doctest::Approx(21).epsilon(1e-4));  // seen from 23.4 m on; 28 m apart
  CHECK(s.unseen()[1].centre_m.z == doctest::Approx(-7).epsilon(1e-4));
  s.show(label::building, 40, 100, 0, 200, 50);
  CHECK(first() == doctest::Approx(21).epsilon(1e-4));
  s.show(label::building, 12, 100, 0, 200, 50);
  CHECK(first() == doctest::Approx(3.5).epsilon(1e-4));  // 7 m would be 5.9 m from the house
  s.show(label::building, 1, 100, 0, 200, 50);
  CHECK(first() == 0.0F);
  s.show(label::sky, 0, 0, 0, 200, 100);
  s.show(label::traffic_sign, 21, 110, 20, 120, 30);  // 3 m below the lamp at 21 m
  CHECK(first() == doctest::Approx(14).epsilon(1e-4));
  s.show(label::sky, 0, 110, 20, 120, 30);
  s.show(label::traffic_sign, 21, 110, 60, 120, 70);
  CHECK(first() == doctest::Approx(21).epsilon(1e-4));
  s.show(label::sky, 0, 0, 0, 200, 100);
  s.camera = {40, 40, 100, 50};  // wide, and so far up that it would see the lamp beside it
  s.up = normalized(Vec3f{0, -1, 1});
  CHECK(s.unseen().size() == 2);
  s.camera = Street().camera;
  s.up = Street().up;
  s.params.assumed_width_m = 5;  // 5 m high: out of the picture below 12.6 m, gaps of 17.5 m
  for (Label& l : s.labels.view().pixels()) l = label::sky;
  s.show(label::sky, 0, 0, 0, 200, 100);
  CHECK(first() == doctest::Approx(10.9375).epsilon(1e-4));
}

TEST_CASE("unseen lamps are of the technology of their class, each with its own age, whatever else is there") {
  Street s;
  s.lamp({4, -6.5F, 20});
  std::vector<Emitter> all = s.unseen();
  all.insert(all.begin(), s.lamps[0]);
  REQUIRE(all.size() == 3);
  std::vector<Activation> drawn(all.size());
  REQUIRE(activate_lights({}, 3, 0, {all.data(), all.size()}, {}, {drawn.data(), drawn.size()}).ok());
  for (const Activation& a : drawn) {
    CHECK(a.lit);
    CHECK(std::fabs(a.strength / drawn[0].strength - 1.0F) < 0.23F);
    CHECK(std::fabs(a.xy.x - drawn[0].xy.x) < 0.0061F);
  }
  CHECK(drawn[1].strength != drawn[2].strength);
  Activation alone;
  REQUIRE(activate_lights({}, 3, 0, {&all[2], 1}, {}, {&alone, 1}).ok());
  CHECK(alone.strength == drawn[2].strength);
}

TEST_CASE("the moon: one lamp more, .25 lx on what faces it all over the street, from where it was asked for") {
  Street s;
  CHECK(most_unseen_lamps(s.params, 0) == 0);
  s.params.moon = {1, 1, 0};  // to the right, 45 degrees up
  CHECK(most_unseen_lamps(s.params, 0) == 1);
  const std::vector<Emitter> lamps = s.unseen();
  REQUIRE(lamps.size() == 1);
  CHECK(is_moon(lamps[0]));
  CHECK(!is_own_headlamp(lamps[0]));
  Activation a;
  REQUIRE(activate_lights({}, 3, 0, {lamps.data(), 1}, {}, {&a, 1}).ok());
  CHECK(a.lit);
  CHECK(luminance(a.intensity_cd) ==
        doctest::Approx(static_cast<double>(strongest_intensity_cd({}, lamps[0]))).epsilon(1e-4));
  for (const Vec3f at : {Vec3f{0, 1.5F, 5}, Vec3f{-20, 1.5F, 100}}) {
    Vec3f to_light;
    const Vec3f facing = normalized(Vec3f{1, -1, 0});
    CHECK(luminance(a.intensity_cd) * illuminance_per_cd(lamps[0], at, facing, to_light) ==
          doctest::Approx(0.25).epsilon(0.01));
    CHECK(dot(to_light, facing) > 0.999F);
    CHECK(luminance(a.intensity_cd) * illuminance_per_cd(lamps[0], at, {0, -1, 0}, to_light) ==
          doctest::Approx(0.25 * std::sqrt(0.5)).epsilon(0.01));
    CHECK(illuminance_per_cd(lamps[0], at, {-1, 0, 0}, to_light) == 0.0F);
  }
}

TEST_CASE("a following car lights the road beside the own car and nothing that the own car hides from it") {
  GroundPlane ground;
  ground.up = {0, -1, 0};
  ground.camera_height_m = 1.2F;
  struct Case {
    bool left_hand;
    float aim, lateral_m, height_m;
  };
  for (const Case& c :
       {Case{false, 0.01F, 0.6F, 0.65F}, Case{true, 0.01F, 0.6F, 0.65F}, Case{false, 0.015F, 0.6F, 0.65F},
        Case{false, 0.05F, 0.6F, 0.9F}, Case{false, 0.01F, 2.1F, 1.8F}}) {
    EgoHeadlampParams own;
    own.left_hand_traffic = c.left_hand;
    own.aim = c.aim;
    own.lateral_m = c.lateral_m;  // as of a lorry beside
    own.height_m = c.height_m;
    std::vector<Emitter> lamps(2);
    const Span<Emitter> out(lamps.data(), 2);
    REQUIRE(place_following_car(own, 18.0F, ground, out) == 2);
    CHECK(lamps[0].centre_m.x == doctest::Approx(-c.lateral_m));
    CHECK(lamps[1].centre_m.x == doctest::Approx(c.lateral_m));
    CHECK(lamps[0].centre_m.z == doctest::Approx(-18.0));
    CHECK(lamps[0].centre_m.y == doctest::Approx(1.2 - static_cast<double>(c.height_m)));
    EgoHeadlampParams there = own;  // the same lamps with nothing before them
    there.ahead_m = -18.0F;
    std::vector<Emitter> bare(2);
    REQUIRE(place_ego_headlamps(there, ground, {bare.data(), 2}) == 2);
    for (std::size_t i = 0; i < 2; ++i) {
      const auto intensity = [&](const Emitter& lamp, const Vec3f& at) {
        return relative_intensity(lamp, normalized(at - lamp.centre_m));
      };
      // Every point ahead, against the own car as a box: 1.8 m wide, 1.5 m high, from 3 m behind the camera to 1.7 ahead.
      int hidden = 0;
      int seen = 0;
      for (float x = -12.0F; x <= 12.0F; x += 0.37F) {
        for (float height = 0.0F; height < 6.0F; height += 0.43F) {
          const Vec3f at{x, 1.2F - height, 25.0F};
          bool behind = false;
          for (int step = 0; step <= 200; ++step) {
            const float z = -3.0F + 4.7F * static_cast<float>(step) / 200.0F;
            const Vec3f p = lamps[i].centre_m + (at - lamps[i].centre_m) * ((z + 18.0F) / 43.0F);
            behind = behind || (std::fabs(p.x) < 0.9F && 1.2F - p.y < 1.5F);
          }
          CAPTURE(x);
          CAPTURE(height);
          CHECK(intensity(lamps[i], at) == (behind ? 0.0F : intensity(bare[i], at)));
          (behind ? hidden : seen) += 1;
        }
      }
      CHECK(hidden > 20);
      CHECK(seen > 400);
      CHECK(intensity(bare[i], {lamps[i].centre_m.x, 1.2F, 25.0F}) >
            0.0F);  // straight ahead nothing hides the own ones
    }
    CHECK(certain_intensity_cd({}, lamps[0]) == certain_intensity_cd({}, bare[0]));
    CHECK(certain_intensity_cd({}, lamps[0]) > 0.0F);
    CHECK(mean_intensity_cd({}, lamps[0]) == mean_intensity_cd({}, bare[0]));
    for (std::uint32_t variant = 0; variant < 40; ++variant) {
      Activation drawn[2];
      REQUIRE(activate_lights({}, 3, variant, {lamps.data(), 2}, {}, {drawn, 2}).ok());
      CHECK(drawn[0].lit);
      CHECK(drawn[1].lit);
      CHECK(drawn[0].strength == drawn[1].strength);
    }
    own.high_beam = true;  // they dip it
    REQUIRE(place_following_car(own, 18.0F, ground, out) == 2);
    CHECK(lamps[0].profile == (c.left_hand ? EmissionProfile::low_beam_left : EmissionProfile::low_beam));
    CHECK(place_following_car(own, 0.0F, ground, out) == 0);
    CHECK(place_following_car(own, 5.0F, ground, out) == 0);
    CHECK(place_following_car(own, 201.0F, ground, out) == 0);
    CHECK(place_following_car(own, std::numeric_limits<float>::quiet_NaN(), ground, out) == 0);
    CHECK(place_following_car(own, 18.0F, ground, out.sub(0, 1)) == 0);
  }
}

TEST_CASE("a row of lamps of 10 klm at 8 m every 30 m gives 0.5 to 3 cd/m2 on the road") {
  for (const EmissionProfile profile : {EmissionProfile::street_luminaire, EmissionProfile::hung_luminaire}) {
    const bool hung = profile == EmissionProfile::hung_luminaire;
    Emitter lamp;
    lamp.profile = profile;
    lamp.axis = {0, 1, 0};
    lamp.up = {0, 0, 1};  // the road is to its left
    const float peak = peak_intensity_cd(profile, 10000.0F, 0.1F);
    double sum = 0;
    int points = 0;
    for (double z = 0; z < 30; z += 0.5) {
      for (double x = -3.5; x <= 3.5; x += 0.5, ++points) {
        for (int k = -5; k <= 5; ++k) {
          const double dx = x - (hung ? 0.0 : 3.5);
          const double dz = z - 30.0 * k;
          const double d2 = dx * dx + dz * dz + 64;
          const double d = std::sqrt(d2);
          const Vec3f to{static_cast<float>(dx / d), static_cast<float>(8 / d), static_cast<float>(dz / d)};
          sum += static_cast<double>(peak * relative_intensity(lamp, to)) * (8 / d) / d2;
        }
      }
    }
    const double pi = 3.14159265358979;
    CHECK(sum / points * 0.1 / pi > 0.5);  // albedo 0.1
    CHECK(sum / points * 0.1 / pi < 3.0);
  }
}
