// SPDX-License-Identifier: Apache-2.0
// Cars and people told from buildings in scenes without labels.
#include "npsim/depth/things.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <limits>

#include "fixture.hpp"
#include "standing_blocks.hpp"

using namespace npsim;
using npsim_test::Image;
using npsim_test::Scratch;
using npsim_test::StandingBlocks;

namespace {

struct Street : StandingBlocks {
  Image<std::uint16_t> things{kShape, std::uint16_t{77}};

  void tell(const GroundPlane& ground = kGround) {
    Scratch scratch(tell_things_workspace_bytes(kShape));
    REQUIRE(tell_things(depth.cview(), kCamera, ground, labels.view(), things.view(), scratch.workspace()).ok());
  }
  [[nodiscard]] int count(Label l) const {
    int n = 0;
    for (const Label v : labels.view().pixels()) n += v == l ? 1 : 0;
    return n;
  }
};

}  // namespace

TEST_CASE("things: a car before a house, a wall of another depth right behind it, is told to its border") {
  Street street;
  street.stand(0, 240, 20.0F, 12.0F);
  street.stand(80, 140, 10.0F, 1.5F);
  street.tell();
  for (int y = 0; y < Street::kShape.height; ++y) {
    for (int x = 0; x < Street::kShape.width; ++x) {
      const bool car = x >= 80 && x < 140 && y >= Street::row(1.5F, 10.0F) && y < Street::row(0.0F, 10.0F);
      CHECK((street.things(x, y) != 0) == car);
      CHECK((street.labels(x, y) == label::dynamic_object) == car);
    }
  }
}

TEST_CASE("things: two cars at other distances have their own numbers, though one hides part of the other") {
  Street street;
  street.stand(80, 140, 14.0F, 1.5F);
  street.stand(120, 180, 10.0F, 1.5F);
  street.tell();
  const int y = Street::row(0.75F, 14.0F);
  CHECK(street.things(90, y) != 0);
  CHECK(street.things(170, y) != 0);
  CHECK(street.things(90, y) != street.things(170, y));
  CHECK(street.things(119, y) == street.things(90, y));
  CHECK(street.things(120, y) == street.things(170, y));
}

TEST_CASE("things: roof and bonnet at one car, 8 % of depth apart, are one") {
  Street street;
  street.stand(80, 140, 10.8F, 1.5F);
  street.stand(80, 140, 10.0F, 0.9F);
  street.tell();
  CHECK(street.things(100, Street::row(1.4F, 10.8F)) != 0);
  CHECK(street.things(100, Street::row(1.4F, 10.8F)) == street.things(100, Street::row(0.5F, 10.0F)));
}

TEST_CASE("things: a wall higher than a van, a lorry and a house are none") {
  for (const float height_m : {2.9F, 3.5F, 9.0F}) {
    CAPTURE(height_m);
    Street street;
    street.stand(80, 140, 10.0F, height_m);
    street.tell();
    CHECK(street.count(label::dynamic_object) == 0);
  }
  Street van;
  van.stand(80, 140, 10.0F, 2.5F);
  van.tell();
  CHECK(van.count(label::dynamic_object) > 0);
}

TEST_CASE("things: a car under a crown of its own depth, of which a tenth passes for a building, is told") {
  Street street;
  street.stand(80, 140, 10.0F, 4.0F, label::building, 3.88F);
  street.stand(80, 140, 10.0F, 1.5F);
  street.tell();
  CHECK(street.things(100, Street::row(0.7F, 10.0F)) != 0);
}

TEST_CASE("things: the foot of a house below a crown that hides the rest of it stays a building") {
  Street street;
  street.stand(40, 200, 18.0F, 2.2F);
  street.stand(40, 200, 16.0F, 6.0F, label::vegetation, 2.0F);
  street.tell();
  CHECK(street.count(label::dynamic_object) == 0);
}

TEST_CASE("things: the foot of a house that the upper border of the picture cuts off stays a building") {
  Street street;
  street.stand(40, 200, 3.0F, 2.4F);  // row 0
  REQUIRE(street.labels(100, 0) == label::building);
  street.tell();
  CHECK(street.count(label::dynamic_object) == 0);
}

TEST_CASE("things: houses down the slope, whose roofs are no higher over the plane than a car, stay buildings") {
  Street street;
  street.stand(40, 200, 30.0F, 2.0F, label::building, -4.0F);
  street.tell();
  CHECK(street.count(label::dynamic_object) == 0);
  Street noisy;  // a car of which a twentieth was measured below the ground
  noisy.stand(80, 140, 10.0F, 1.5F, label::building, -0.05F);
  for (int x = 80; x < 140; ++x) noisy.depth(x, Street::row(0.0F, 10.0F)) = 10.9F;
  for (int x = 80; x < 100; ++x) noisy.put(x, Street::row(-0.6F, 10.0F), 10.0F, label::building);
  for (int y = Street::row(0.0F, 10.0F); y < Street::row(-0.6F, 10.0F); ++y) noisy.put(90, y, 10.0F, label::building);
  noisy.tell();
  CHECK(noisy.things(100, Street::row(0.7F, 10.0F)) != 0);
}

TEST_CASE("things: of a car of which half stands in cells with a house, no half is taken for a thing") {
  const auto told = [](int left, int right) {  // columns in which a house goes on above the car
    Street street;
    street.stand(left, right, 10.0F, 4.0F);
    street.stand(80, 140, 10.0F, 1.5F);
    street.tell();
    return street.count(label::dynamic_object);
  };
  CHECK(told(110, 140) == 0);
  CHECK(told(0, 0) > 0);

  Street street;  // a fifth of the sides
  street.stand(110, 140, 10.0F, 4.0F);
  street.stand(80, 140, 10.0F, 1.0F);
  street.stand(80, 100, 10.0F, 2.4F);
  street.tell();
  CHECK(street.count(label::dynamic_object) == 0);
}

TEST_CASE("things: a car before which a pole of its depth stands is told, for its sides go on beside little of it") {
  Street street;
  street.stand(80, 140, 10.0F, 1.5F);
  street.stand(70, 80, 10.05F, 0.25F);
  street.stand(66, 72, 10.05F, 6.0F);
  street.tell();
  CHECK(street.things(100, Street::row(0.7F, 10.0F)) != 0);
}

TEST_CASE("things: a car in a gap between walls that stand back from its front by 9 % of its distance is told") {
  Street street;
  street.stand(40, 80, 10.9F, 5.0F);
  street.stand(140, 180, 10.9F, 5.0F);
  street.stand(80, 140, 10.0F, 1.5F);
  street.tell();
  CHECK(street.things(100, Street::row(0.7F, 10.0F)) != 0);
}

TEST_CASE("things: what hangs before a house, and does not come down to the ground, is part of it") {
  Street street;
  street.stand(0, 240, 20.0F, 12.0F);
  street.stand(100, 140, 17.0F, 2.4F, label::building, 1.4F);
  street.tell();
  CHECK(street.count(label::dynamic_object) == 0);
}

TEST_CASE("things: where fill put a ramp between a roof and the house behind, the car is told up to its roof") {
  Street street;
  street.stand(0, 240, 20.0F, 12.0F);
  street.stand(80, 140, 10.0F, 1.5F);
  const int roof = Street::row(1.5F, 10.0F);
  for (int i = 1; i <= 6; ++i) {
    const float w = 0.1F - 0.05F * static_cast<float>(i) / 7.0F;  // linear in 1/z
    for (int x = 80; x < 140; ++x) street.depth(x, roof - i) = 1.0F / w;
  }
  street.tell();
  for (int y = roof; y < Street::row(0.0F, 10.0F); ++y) CHECK(street.things(100, y) != 0);
  CHECK(street.things(100, roof - 8) == 0);
}

TEST_CASE("things: a pane of another depth within a car belongs to it, a speck on the road is none") {
  Street street;
  street.stand(80, 140, 10.0F, 1.5F);
  const int y = Street::row(1.2F, 10.0F);
  for (int x = 100; x < 103; ++x) street.put(x, y, 25.0F, label::building);
  street.put(20, 140, 3.0F, label::building);
  street.tell();
  CHECK(street.things(101, y) == street.things(90, y));
  CHECK(street.labels(101, y) == label::dynamic_object);
  CHECK(street.things(20, 140) == 0);
}

TEST_CASE("things: plants, ground and sky keep their labels, and without a ground plane nothing is told") {
  Street street;
  street.stand(80, 140, 10.0F, 1.5F, label::vegetation);
  street.tell();
  CHECK(street.count(label::dynamic_object) == 0);
  CHECK(street.things(100, 100) == 0);
  street.stand(80, 140, 10.0F, 1.5F);
  street.tell({{0, -1, 0}, 1.5F, 0.0F});
  CHECK(street.count(label::dynamic_object) == 0);
  CHECK(street.things(100, 75) == 0);
}

TEST_CASE("things: depths that are none, a picture of one pixel, all one depth") {
  Street street;
  street.stand(0, 240, 10.0F, 1.5F);
  street.depth(10, 80) = std::numeric_limits<float>::quiet_NaN();
  street.depth(11, 80) = std::numeric_limits<float>::infinity();
  street.depth(12, 80) = -1.0F;
  street.depth(13, 80) = 1e30F;
  street.depth(14, 80) = 1e-30F;
  street.tell();
  CHECK(street.things(100, 80) != 0);

  const Image<float> one(Shape{1, 1}, 2.0F);
  Image<Label> label_of_one(Shape{1, 1}, label::building);
  Image<std::uint16_t> thing(Shape{1, 1}, std::uint16_t{5});
  Scratch scratch(tell_things_workspace_bytes({1, 1}));
  CHECK(
      tell_things(one.cview(), Street::kCamera, Street::kGround, label_of_one.view(), thing.view(), scratch.workspace())
          .ok());
  CHECK(thing(0, 0) == 0);
  CHECK(tell_things(one.cview(), Street::kCamera, Street::kGround, street.labels.view(), thing.view(),
                    scratch.workspace())
            .code() == StatusCode::shape_mismatch);
}
