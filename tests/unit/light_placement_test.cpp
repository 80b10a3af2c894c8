// SPDX-License-Identifier: Apache-2.0
// Placement of emitters from annotated regions, on small painted scenes whose geometry is known.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "npsim/core/random.hpp"
#include "npsim/light/placement.hpp"
#include "unit/fixture.hpp"

namespace {

using namespace npsim;
using npsim_test::Image;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// A camera 1.5 m above a level ground; sky above the horizon until something is painted.
struct Scene {
  Shape shape{200, 100};
  Intrinsics k{180, 180, 100, 50};
  GroundPlane ground;
  Image<float> depth{shape};
  Image<Label> labels{shape, label::sky};
  Image<std::uint8_t> uncertain{shape};
  Image<Vec3f> normals{shape};
  Image<std::uint16_t> index{shape};
  Image<std::uint16_t> instances{shape};
  std::vector<LightMark> marks;
  std::vector<Emitter> out = std::vector<Emitter>(64);
  std::size_t count = 0;
  bool with_labels = true;
  bool with_normals = true;
  bool with_instances = false;
  Image<float> confidence{shape};  // of measured depth
  bool measured = false;
  PlacementParams params;

  Scene() {
    params.reveal_m = 0;  // outlines as they are seen
    for (int y = 51; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        depth(x, y) = 1.5F * k.fy / (static_cast<float>(y) + 0.5F - k.cy);
        labels(x, y) = label::road;
        normals(x, y) = {0, -1, 0};
      }
    }
  }
  void paint(int x0, int y0, int x1, int y1, Label l, float z, Vec3f n = {0, 0, -1}) {
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        labels(x, y) = l;
        depth(x, y) = z;
        normals(x, y) = n;
      }
    }
  }
  std::uint16_t mark(LightClass cls, int x0, int y0, int x1, int y1, std::uint16_t group = 0,
                     SignalState state = SignalState::unknown) {
    marks.push_back({static_cast<std::uint32_t>(100 + marks.size()), cls, state, group});
    const auto value = static_cast<std::uint16_t>(marks.size());
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) index(x, y) = value;
    }
    return value;
  }
  Status place() {
    npsim_test::Scratch scratch(placement_workspace_bytes(params, shape));
    return place_lights(params, known(), scratch.workspace(), Span<Emitter>(out.data(), out.size()), count);
  }
  PlacementScene known() {
    PlacementScene scene;
    scene.camera = k;
    scene.ground = ground;
    scene.marks = Span<const LightMark>(marks.data(), marks.size());
    scene.light_index = index.cview();
    scene.depth = depth.cview();
    if (with_labels) scene.labels = labels.cview();
    scene.uncertain = uncertain.cview();
    if (with_instances) scene.instances = instances.cview();
    if (with_normals) scene.normals = normals.cview();
    if (measured) scene.confidence = confidence.cview();
    return scene;
  }
  const Emitter& only() {
    REQUIRE(place().ok());
    REQUIRE(count == 1);
    return out[0];
  }
};

void check_frame(const Emitter& e) {
  CHECK(length(e.axis) == doctest::Approx(1.0).epsilon(1e-4));
  CHECK(length(e.up) == doctest::Approx(1.0).epsilon(1e-4));
  CHECK(std::fabs(dot(e.axis, e.up)) < 1e-4F);
  CHECK(e.area_m2 > 0.0F);
}

}  // namespace

TEST_CASE("a window in a wall that faces the camera: centre, size and 2 cm in front of it") {
  Scene s;
  s.paint(20, 5, 80, 49, label::building, 12);
  s.mark(LightClass::window_building, 30, 10, 41, 29);
  const Emitter& e = s.only();
  check_frame(e);
  CHECK(e.profile == EmissionProfile::lambert);
  CHECK(e.centre_m.x == doctest::Approx((36 - 100) * 12 / 180.0).epsilon(1e-4));
  CHECK(e.centre_m.y == doctest::Approx((20 - 50) * 12 / 180.0).epsilon(1e-4));
  CHECK(e.centre_m.z == doctest::Approx(12 - 0.02).epsilon(1e-5));
  CHECK(e.area_m2 == doctest::Approx(12 * 20 * 144 / 32400.0).epsilon(1e-4));
  CHECK(4 * length(cross(e.half_u_m, e.half_v_m)) == doctest::Approx(static_cast<double>(e.area_m2)).epsilon(1e-4));
}

TEST_CASE(
    "a large window near the pavement is a shop front; a flat's, one of the first floor and a glazed door are not") {
  struct Case {
    int x0, y0, x1, y1;  // 15 px are 1 m, the ground lies at row 72.5
    bool shop;
  };
  for (const Case& c : {Case{20, 25, 64, 64, true}, Case{20, 25, 64, 49, false}, Case{20, 5, 64, 44, false},
                        Case{20, 36, 39, 71, false}, Case{20, 27, 54, 60, true}}) {
    CAPTURE(c.y0);
    CAPTURE(c.y1);
    Scene s;
    s.paint(5, 0, 90, 72, label::building, 12);
    s.mark(LightClass::window_building, c.x0, c.y0, c.x1, c.y1);
    CHECK(is_shop_front(s.ground, s.only()) == c.shop);
    Emitter sign = s.only();
    sign.cls = LightClass::advertisement;
    CHECK(!is_shop_front(s.ground, sign));
  }
}

TEST_CASE("a window in a slanted facade lies in its plane, however many normals are missing") {
  Scene s;
  const Vec3f n = normalized(Vec3f{0.8F, 0, -0.6F});
  // The facade on the left: n . X = -6.
  for (int y = 0; y < 50; ++y) {
    for (int x = 0; x < 90; ++x) {
      const Vec3f ray = unproject_pixel(s.k, x, y, 1);
      s.paint(x, y, x, y, label::building, -6 / dot(n, ray), n);
    }
  }
  s.mark(LightClass::window_building, 30, 10, 49, 29);
  for (int y = 10; y < 30; ++y) s.normals(35, y) = {kNan, kNan, kNan};
  const Emitter& e = s.only();
  check_frame(e);
  CHECK(length(e.axis - n) < 1e-4F);
  CHECK(dot(n, e.centre_m) == doctest::Approx(-6 + 0.02).epsilon(0.01));
  CHECK(std::fabs(dot(n, e.half_u_m)) < 1e-3F);
  CHECK(std::fabs(dot(n, e.half_v_m)) < 1e-3F);
  // True area on the facade: seen area over the cosine between its normal and the ray, per pixel.
  double area = 0;
  for (int y = 10; y < 30; ++y) {
    for (int x = 30; x < 50; ++x) {
      const Vec3f ray = unproject_pixel(s.k, x, y, 1);
      const double z = static_cast<double>(-6 / dot(n, ray));
      area += z * z * z / (180.0 * 180.0) * 1.0 / 6.0;  // dA = z^3 / (fx fy |n . X|)
    }
  }
  CHECK(static_cast<double>(e.area_m2) == doctest::Approx(area).epsilon(0.03));
}

TEST_CASE("a normal that is grazing, missing or turned away is not believed") {
  for (const Vec3f n : {Vec3f{1, 0, 0.02F}, Vec3f{0, 0, 0}, Vec3f{kNan, 0, 0}, Vec3f{0, 0, 1}}) {
    Scene s;
    s.paint(90, 5, 110, 49, label::building, 12, n);
    s.mark(LightClass::advertisement, 95, 10, 105, 20);
    const Emitter& e = s.only();
    check_frame(e);
    CHECK(dot(e.axis, normalized(e.centre_m)) < -0.9F);
  }
  Scene s;
  s.with_normals = false;
  s.paint(90, 5, 110, 49, label::building, 12);
  s.mark(LightClass::clock, 95, 10, 105, 20);
  CHECK(dot(s.only().axis, normalized(s.only().centre_m)) < -0.9F);
}

TEST_CASE("depth of a region is not moved by wrong, uncertain and missing pixels that are fewer than half") {
  Scene s;
  s.paint(60, 50, 120, 80, label::car, 15);
  s.mark(LightClass::moving_rear, 70, 60, 79, 65);
  for (int y = 60; y <= 65; ++y) {
    s.depth(70, y) = kNan;
    s.depth(71, y) = 0;
    s.depth(72, y) = 300;
    s.depth(73, y) = -5;
    for (int x = 77; x < 80; ++x) {
      s.depth(x, y) = 40;
      s.uncertain(x, y) = 255;
    }
  }
  const Emitter& e = s.only();
  CHECK(e.centre_m.z == doctest::Approx(15 - 0.02).epsilon(1e-4));
}

TEST_CASE("a region without any depth takes that of its surroundings; with none at all it gives no emitter") {
  Scene s;
  s.paint(60, 52, 120, 80, label::car, 15);
  s.mark(LightClass::moving_rear, 70, 60, 79, 65);
  for (int y = 60; y <= 65; ++y) {
    for (int x = 70; x < 80; ++x) s.depth(x, y) = kNan;
  }
  CHECK(s.only().centre_m.z == doctest::Approx(15).epsilon(0.01));
  s.depth = Image<float>(s.shape, kNan);
  REQUIRE(s.place().ok());
  CHECK(s.count == 0);
}

TEST_CASE("lamps of cars ahead: rear lamps and low beams face us along the street, low beams 1 % down") {
  Scene s;
  const float sine = std::sin(0.05F);
  s.ground.up = normalized(Vec3f{0, -std::cos(0.05F), sine});
  s.paint(60, 52, 140, 80, label::car, 20);
  s.mark(LightClass::moving_front, 70, 60, 75, 64);
  s.mark(LightClass::moving_rear, 120, 60, 125, 64);
  s.mark(LightClass::parked_front, 90, 60, 95, 64);
  REQUIRE(s.place().ok());
  REQUIRE(s.count == 3);
  const Vec3f back = -forward_on_ground(s.ground);
  CHECK(s.out[0].profile == EmissionProfile::low_beam);
  CHECK(dot(s.out[0].axis, s.ground.up) == doctest::Approx(-0.01).epsilon(1e-3));
  CHECK(dot(s.out[0].axis, back) > 0.9999F - 1e-4F);
  CHECK(s.out[1].profile == EmissionProfile::signal);
  CHECK(dot(s.out[1].axis, back) > 0.9999F);
  CHECK(s.out[2].profile == EmissionProfile::signal);
  for (std::size_t i = 0; i < 3; ++i) check_frame(s.out[i]);
  // The oncoming low beam's right is our left.
  CHECK(cross(s.out[0].axis, s.out[0].up).x < -0.9F);
}

TEST_CASE("a car that crosses: its lamp follows the normal") {
  Scene s;
  s.paint(60, 52, 140, 80, label::car, 20, normalized(Vec3f{-1, 0, -0.1F}));
  s.mark(LightClass::moving_front, 130, 60, 135, 64);
  const Emitter& e = s.only();
  CHECK(e.axis.x < -0.9F);
  CHECK(dot(e.axis, e.centre_m) < 0.0F);
}

TEST_CASE("the lamp of a bicycle is no low beam") {
  Scene s;
  s.paint(60, 52, 140, 80, label::bicycle, 20);
  s.marks.push_back({1, LightClass::bicycle_group, SignalState::unknown, 0});
  s.mark(LightClass::moving_front, 70, 60, 73, 63, 1);
  const Emitter& e = s.only();
  CHECK(e.profile == EmissionProfile::signal);
  CHECK(e.group == 1);
  CHECK(e.group_cls == LightClass::bicycle_group);
}

TEST_CASE("inferred objects: discs of a traffic light are signals towards us, others are lit surfaces") {
  Scene s;
  s.paint(40, 10, 60, 40, label::traffic_light, 25);
  s.marks.push_back({1, LightClass::traffic_light_group, SignalState::unknown, 0});
  s.mark(LightClass::inferred_object, 45, 15, 48, 18, 1);
  s.mark(LightClass::inferred_object, 45, 25, 48, 28, 0, SignalState::green);
  s.mark(LightClass::inferred_object, 55, 25, 58, 28);
  REQUIRE(s.place().ok());
  REQUIRE(s.count == 3);
  CHECK(s.out[0].profile == EmissionProfile::signal);
  CHECK(s.out[1].profile == EmissionProfile::signal);
  CHECK(s.out[1].state == SignalState::green);
  CHECK(s.out[2].profile == EmissionProfile::lambert);
  CHECK(dot(s.out[0].axis, normalized(-s.out[0].centre_m)) > 0.95F);
  CHECK(std::fabs(dot(s.out[0].axis, s.ground.up)) < 1e-5F);
}

TEST_CASE("street lamp against the sky: never the depth of the sky, but that of its pole, or of the pole's foot") {
  for (const bool pole_depth : {true, false}) {
    Scene s;
    // A pole 30 m away at x = 6.67 m: columns 139..141, from row 10 (height 8.1 m) to its foot at row 59.
    s.paint(139, 10, 141, 58, label::pole, pole_depth ? 30.0F : 0.0F);
    // Head with an arm to the left, labelled sky, filled with nonsense.
    s.paint(120, 8, 128, 11, label::sky, 200);
    s.mark(LightClass::street_light_ht, 120, 8, 128, 11);
    const Emitter& e = s.only();
    check_frame(e);
    INFO("pole has depth: " << pole_depth);
    // The foot's row is known to half a pixel of nine under the horizon: 6 %.
    CHECK(e.centre_m.z == doctest::Approx(30).epsilon(pole_depth ? 0.001 : 0.06));
    CHECK(e.profile == EmissionProfile::street_luminaire);
    CHECK(length(e.axis - Vec3f{0, 1, 0}) < 1e-5F);
    CHECK(height_above_ground(s.ground, e.centre_m) > 6.0F);
    CHECK(height_above_ground(s.ground, e.centre_m) < 9.5F);
    CHECK(e.mounting_height_m ==
          doctest::Approx(static_cast<double>(height_above_ground(s.ground, e.centre_m))).epsilon(0.01));
    CHECK(e.area_m2 >= 0.02F);
  }
}

TEST_CASE("street lamp whose own pixels are an object with a credible depth: that depth") {
  Scene s;
  s.paint(100, 20, 105, 29, label::static_object, 24);
  s.paint(98, 20, 99, 29, label::building, 90);  // a facade behind, inside the region
  s.mark(LightClass::street_light_lt, 98, 20, 105, 29);
  CHECK(s.only().centre_m.z == doctest::Approx(24).epsilon(1e-3));
}

TEST_CASE("a lantern shines from the middle of its glass, a road luminaire from the lower edge of its head") {
  for (const float z : {12.0F, 36.0F}) {
    Scene s;
    s.measured = true;
    for (float& c : s.confidence.view().pixels()) c = 1.0F;
    // Rows 20..29, the lower edge 4/3 m above the camera at 12 m, 4 m at 36 m; the pole stands on the road.
    s.paint(98, 20, 103, 29, label::static_object, z);
    const auto foot = static_cast<int>(50.0F + 1.5F * 180.0F / z);
    s.paint(100, 30, 101, foot, label::pole, z);
    s.mark(LightClass::street_light_lt, 98, 20, 103, 29);
    const Emitter& e = s.only();
    const bool lantern = z < 20.0F;
    CHECK(e.profile == (lantern ? EmissionProfile::lantern : EmissionProfile::street_luminaire));
    CHECK(e.centre_m.z == doctest::Approx(static_cast<double>(z)).epsilon(0.01));
    const double row = lantern ? 25 : 30;
    CHECK(e.centre_m.y == doctest::Approx((row - 50) / 180 * static_cast<double>(z) + 0.02).epsilon(0.01));
    CHECK(e.mounting_height_m == doctest::Approx(1.52 - static_cast<double>(e.centre_m.y)).epsilon(0.01));
  }
}

TEST_CASE("street lamp on a wire, nothing but sky: hung at the default height") {
  Scene s;
  s.paint(98, 10, 104, 14, label::sky, 500);
  s.mark(LightClass::street_light_lt, 98, 10, 104, 14);
  const Emitter& e = s.only();
  CHECK(height_above_ground(s.ground, e.centre_m) == doctest::Approx(8.0).epsilon(0.1));
  CHECK(e.centre_m.z < 60.0F);
}

TEST_CASE("a far lamp whose pole is too thin to be seen stands on a mast where the nearer ones of its row do") {
  for (const bool masts : {true, false}) {
    Scene s;
    // At 20 m, 7.9 m up and 2 m to the right; at 60 m, as high, without a pole.
    if (masts) s.paint(118, 8, 120, 63, label::pole, 20.0F);
    s.mark(LightClass::street_light_ht, 115, 6, 121, 7);
    s.mark(LightClass::street_light_ht, 105, 34, 107, 35);
    REQUIRE(s.place().ok());
    REQUIRE(s.count == 2);
    INFO("masts: " << masts);
    CHECK(s.out[1].mounting_height_m == doctest::Approx(8).epsilon(0.2));
    for (std::size_t e = 0; e < 2; ++e) {
      CHECK(s.out[e].profile == (masts ? EmissionProfile::street_luminaire : EmissionProfile::hung_luminaire));
    }
    if (masts) CHECK(s.out[1].up == s.out[0].up);
  }
}

TEST_CASE("street lamp without labels: an incredible depth (80 m up) is not taken") {
  Scene s;
  s.with_labels = false;
  s.paint(98, 10, 104, 14, label::sky, 400);
  s.mark(LightClass::street_light_lt, 98, 10, 104, 14);
  CHECK(height_above_ground(s.ground, s.only().centre_m) < 16.5F);
}

TEST_CASE("street lamp whose depth is lost before a far building: the foot of its pole") {
  Scene s;
  s.paint(0, 0, 199, 50, label::building, 80);
  s.paint(139, 10, 141, 58, label::pole, 80);  // 30 m away
  s.mark(LightClass::street_light_ht, 120, 8, 128, 11);
  s.uncertain = Image<std::uint8_t>(s.shape, 255);
  CHECK(s.only().centre_m.z == doctest::Approx(30).epsilon(0.06));
}

TEST_CASE("a laser meets the pole in a few rows and nothing above: not the wall that a fill puts behind the head") {
  Scene s;
  s.paint(0, 0, 199, 48, label::building, 12);  // made up
  s.paint(139, 10, 141, 48, label::pole, 12);   // its foot is hidden
  s.paint(120, 49, 160, 58, label::car, 25);
  s.mark(LightClass::street_light_ht, 120, 8, 128, 11);
  s.measured = true;
  for (const int y : {34, 38, 42, 46}) {
    s.depth(140, y) = 30.0F;
    s.confidence(140, y) = 1.0F;
  }
  CHECK(s.only().centre_m.z == doctest::Approx(30).epsilon(0.01));
  // The same depth from a network: the head hangs on that wall.
  s.measured = false;
  CHECK(s.only().centre_m.z < 15.0F);
}

TEST_CASE("stereo that lost a thin pole before a wall measures the wall there, which says nothing of the pole") {
  Scene s;
  s.paint(0, 0, 199, 50, label::building, 80);
  s.paint(139, 10, 141, 58, label::pole, 80);  // 30 m away
  s.mark(LightClass::street_light_ht, 120, 8, 128, 11);
  s.measured = true;
  s.confidence = Image<float>(s.shape, 1.0F);
  CHECK(s.only().centre_m.z == doctest::Approx(30).epsilon(0.06));
}

TEST_CASE("a pole that carries another lamp further up is not taken for a lamp's own") {
  Scene s;
  s.paint(104, 8, 105, 58, label::pole, 30);
  s.paint(94, 27, 99, 32, label::static_object, 60);
  s.mark(LightClass::street_light_lt, 94, 27, 99, 32);
  CHECK(s.only().centre_m.z == doctest::Approx(60).epsilon(0.01));
}

TEST_CASE("lamps of a row support each other: one without depth hangs as high as those that have one") {
  Scene s;
  const auto lamp = [&](int x, float z, int size, bool known) {
    const int y = static_cast<int>(50 - 4.5F * s.k.fy / z);  // 6 m above the ground
    s.paint(x, y - size / 2, x + size - 1, y + size / 2, known ? label::static_object : label::sky, known ? z : 400.0F);
    s.mark(LightClass::street_light_ht, x, y - size / 2, x + size - 1, y + size / 2);
  };
  lamp(60, 20, 8, true);
  lamp(80, 25, 8, true);
  lamp(96, 45, 2, false);
  REQUIRE(s.place().ok());
  REQUIRE(s.count == 3);
  CHECK(s.out[0].centre_m.z == doctest::Approx(20).epsilon(0.05));
  CHECK(s.out[1].centre_m.z == doctest::Approx(25).epsilon(0.05));
  CHECK(s.out[2].centre_m.z == doctest::Approx(45).epsilon(0.1));
}

TEST_CASE("a lamp on a wall is not behind it, however high lamps hang elsewhere") {
  Scene s;
  s.paint(20, 5, 180, 60, label::building, 20);
  s.mark(LightClass::street_light_ht, 98, 28, 103, 31);  // 3.8 m above the ground
  const Emitter& e = s.only();
  CHECK(e.centre_m.z <= 20.0F);
  CHECK(e.centre_m.z > 15.0F);
}

TEST_CASE("a window seen at a slant has the area of its outline on the wall, whatever its own normals say") {
  Scene s;
  // The wall x = -5 on the left; a window from z = 10 to 12 and 0.5 to 2 m above the camera.
  for (int y = 0; y < 50; ++y) {
    for (int x = 0; x < 90; ++x) s.paint(x, y, x, y, label::building, -5 / unproject_pixel(s.k, x, y, 1).x);
  }
  s.marks.push_back({7, LightClass::window_building, SignalState::unknown, 0});
  for (int y = 0; y < 50; ++y) {
    for (int x = 0; x < 90; ++x) {
      const Vec3f p = unproject_pixel(s.k, x, y, s.depth(x, y));
      if (p.z > 10 && p.z < 12 && p.y < -0.5F && p.y > -2) s.index(x, y) = 1;
    }
  }
  const Emitter& e = s.only();
  check_frame(e);
  CHECK(e.axis.x > 0.999F);
  CHECK(e.area_m2 == doctest::Approx(3).epsilon(0.1));
  CHECK(e.centre_m.z == doctest::Approx(11).epsilon(0.01));
  const double seen = static_cast<double>(e.area_m2);
  s.params.reveal_m = 0.15F;  // hides 0.15 m * 11 / 5 of 2 m, and 0.15 m * 1.25 / 5 of 1.5 m
  CHECK(static_cast<double>(s.only().area_m2) == doctest::Approx(seen * 2.33 / 2 * 1.5375 / 1.5).epsilon(0.02));
}

TEST_CASE("a window behind a tree is as wide as those of its group") {
  Scene s;
  s.paint(20, 5, 180, 49, label::building, 12);
  s.marks.push_back({1, LightClass::windows_group, SignalState::unknown, 0});
  s.mark(LightClass::window_building, 30, 10, 49, 29, 1);
  s.mark(LightClass::window_building, 60, 10, 79, 29, 1);
  s.mark(LightClass::window_building, 90, 10, 109, 29, 1);
  s.paint(100, 5, 125, 49, label::vegetation, 6);
  for (int y = 0; y < 50; ++y) {
    for (int x = 100; x < 126; ++x) s.index(x, y) = 0;
  }
  REQUIRE(s.place().ok());
  REQUIRE(s.count == 3);
  CHECK(s.out[2].area_m2 == doctest::Approx(static_cast<double>(s.out[0].area_m2)).epsilon(0.01));
  CHECK(s.out[2].centre_m.x == doctest::Approx(0).epsilon(0.01));
}

TEST_CASE("a sign that sticks out of its wall faces along it") {
  Scene s;
  for (int y = 0; y < 50; ++y) {
    for (int x = 0; x < 70; ++x) {
      s.paint(x, y, x, y, label::building, -6 / unproject_pixel(s.k, x, y, 1).x, {1, 0, 0});
    }
  }
  s.paint(20, 20, 34, 34, label::building, 12);  // 0.4 to 1.3 m off the wall
  s.mark(LightClass::advertisement, 20, 20, 34, 34);
  const Emitter& e = s.only();
  CHECK(e.axis.z < -0.99F);
  CHECK(e.area_m2 == doctest::Approx(1).epsilon(0.15));
}

TEST_CASE("lamps point along their vehicle: one that stands askew, and the far end of one that is passed") {
  Scene s;
  s.with_instances = true;
  const auto face = [&](int x0, int x1, int y0, int y1, const Vec3f& n, const Vec3f& point, std::uint16_t instance) {
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        s.paint(x, y, x, y, label::car, dot(n, point) / dot(n, unproject_pixel(s.k, x, y, 1)), n);
        s.instances(x, y) = instance;
      }
    }
  };
  const Vec3f rear = normalized(Vec3f{0.5F, 0, -0.866F});
  const Vec3f corner{-2, 0, 14};
  const int column = static_cast<int>(s.k.cx + s.k.fx * corner.x / corner.z);
  face(column, column + 22, 55, 66, rear, corner, 3);
  face(column - 24, column - 1, 55, 66, {-0.866F, 0, -0.5F}, corner, 3);
  s.mark(LightClass::moving_rear, column + 18, 58, column + 20, 60);
  // One beside us, from 6 to 10 m: its rear lamp is at the far end.
  face(136, 160, 55, 70, {-1, 0, 0}, {2, 0, 0}, 4);
  s.mark(LightClass::parked_rear, 136, 58, 138, 60);
  REQUIRE(s.place().ok());
  REQUIRE(s.count == 2);
  CHECK(dot(s.out[0].axis, rear) > std::cos(0.18F));
  CHECK(s.out[1].axis.z > 0.98F);
}

TEST_CASE("a lamp of a car that depth has in the road is lifted along its ray") {
  Scene s;
  s.paint(60, 52, 140, 62, label::car, 18);
  s.mark(LightClass::parked_front, 70, 61, 75, 61);  // at 18 m it would be 0.35 m above the ground
  const Emitter& e = s.only();
  CHECK(height_above_ground(s.ground, e.centre_m) == doctest::Approx(0.4).epsilon(0.01));
}

TEST_CASE("groups, marks without pixels and class none give no emitter; order and references stay") {
  Scene s;
  s.paint(20, 5, 180, 49, label::building, 12);
  s.marks.push_back({1, LightClass::windows_group, SignalState::unknown, 0});
  s.marks.push_back({2, LightClass::window_building, SignalState::unknown, 1});  // no pixels
  s.mark(LightClass::window_building, 30, 10, 35, 15, 1);
  s.mark(LightClass::none, 50, 10, 55, 15);
  s.mark(LightClass::car_group, 70, 10, 75, 15);
  s.mark(LightClass::clock, 90, 10, 95, 15, 999);  // a group that does not exist
  REQUIRE(s.place().ok());
  REQUIRE(s.count == 2);
  CHECK(s.out[0].mark == 3);
  CHECK(s.out[0].group == 1);
  CHECK(s.out[1].mark == 6);
  CHECK(s.out[1].group == 0);
}

TEST_CASE("placement refuses what it cannot use and never writes past the end") {
  Scene s;
  s.paint(20, 5, 180, 49, label::building, 12);
  s.mark(LightClass::clock, 30, 10, 35, 15);
  s.mark(LightClass::clock, 50, 10, 55, 15);
  s.out.resize(1);
  CHECK(s.place().code() == StatusCode::capacity_exceeded);
  s.out.resize(2);
  s.index(0, 0) = 77;
  CHECK(s.place().code() == StatusCode::invalid_argument);
  s.index(0, 0) = 0;
  s.ground.up = {0, -2, 0};
  CHECK(s.place().code() == StatusCode::invalid_argument);
  s.ground.up = {0, -1, 0};
  s.params.min_area_m2 = 0;
  CHECK(s.place().code() == StatusCode::invalid_argument);
  s.params.min_area_m2 = 1e-3F;
  for (float* value : {&s.params.street.arm_m, &s.params.street.max_distance_m, &s.params.street.default_height_m,
                       &s.params.offset_m, &s.params.reveal_m, &s.params.min_street_area_m2}) {
    const float good = *value;
    for (const float wrong : {-1.0F, kNan, std::numeric_limits<float>::infinity()}) {
      *value = wrong;
      CHECK(s.place().code() == StatusCode::invalid_argument);
    }
    *value = good;
  }
  CHECK(s.place().ok());
  npsim_test::Scratch tiny(64);
  PlacementScene known = s.known();
  const Span<Emitter> out(s.out.data(), s.out.size());
  CHECK(place_lights(s.params, known, tiny.workspace(), out, s.count).code() == StatusCode::workspace_exhausted);
  known.depth = s.depth.cview().sub(0, 0, {10, 10});
  CHECK(place_lights(s.params, known, tiny.workspace(), out, s.count).code() == StatusCode::shape_mismatch);
}

TEST_CASE("single pixels, image corners and random planes of every class: finite emitters with unit frames") {
  for (std::uint32_t round = 0; round < 60; ++round) {
    Scene s;
    RandomStream r(11, RandomPurpose::test, round, 0, 0, 0);
    const float odd[] = {kNan, 0, -1, std::numeric_limits<float>::infinity(), 1e-30F, 1e30F, 5, 50};
    for (int i = 0; i < s.shape.width * s.shape.height; ++i) {
      RandomStream q(12, RandomPurpose::test, round, 0, static_cast<std::uint32_t>(i), 0);
      const int x = i % s.shape.width;
      const int y = i / s.shape.width;
      if (q.uniform() < 0.7F) s.depth(x, y) = odd[q.next_u32() % 8];
      s.labels(x, y) = static_cast<Label>(q.next_u32() % 40);
      s.normals(x, y) = {q.uniform(-1, 1), q.uniform() < 0.1F ? kNan : q.uniform(-1, 1), q.uniform(-1, 1)};
      s.uncertain(x, y) = q.uniform() < 0.3F ? 255 : 0;
    }
    for (int c = 0; c < kLightClassCount; ++c) {
      const int x = static_cast<int>(r.next_u32() % 200);
      const int y = static_cast<int>(r.next_u32() % 100);
      s.mark(static_cast<LightClass>(c), x, y, std::min(199, x + static_cast<int>(r.next_u32() % 4)),
             std::min(99, y + static_cast<int>(r.next_u32() % 4)));
    }
    REQUIRE(s.place().ok());
    for (std::size_t i = 0; i < s.count; ++i) {
      const Emitter& e = s.out[i];
      CHECK_UNARY(is_finite(e.centre_m) && is_finite(e.half_u_m) && is_finite(e.half_v_m));
      CHECK_UNARY(std::isfinite(e.area_m2) && e.area_m2 > 0.0F);
      CHECK_UNARY(std::fabs(length(e.axis) - 1.0F) < 1e-3F && std::fabs(length(e.up) - 1.0F) < 1e-3F);
      CHECK_UNARY(length(e.half_u_m) < 25.0F && length(e.half_v_m) < 25.0F);
    }
  }
}
