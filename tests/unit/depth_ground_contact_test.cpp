// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/ground_contact.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

constexpr Shape kShape{150, 100};
constexpr float kHeight_m = 1.5F;

// A road 1.5 m below the camera, level or rolled, and a wall of `wall_m` from column 20 to 130 whose label reaches down
// to row `foot`: rows below where the wall meets the road show road.
struct Street {
  Intrinsics k{200, 200, 75, 40};
  GroundPlane ground;
  Image<float> surface{kShape};
  Image<Vec3f> normals{kShape};
  Image<Label> labels{kShape, label::road};

  explicit Street(float wall_m, int foot = 80, const Vec3f& up = {0, -1, 0}) {
    ground.up = normalized(up);
    ground.camera_height_m = kHeight_m;
    ground.inlier_share = 1;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        normals(x, y) = ground.up;
        const bool wall = x >= 20 && x < 130 && y < foot;
        const float fall = this->fall(x, y);
        surface(x, y) = fall > 0 ? kHeight_m / fall : 0.0F;
        if (!wall) continue;
        labels(x, y) = label::building;
        surface(x, y) = wall_m;
        normals(x, y) = {0, 0, -1};
      }
    }
  }
  [[nodiscard]] float fall(int x, int y) const { return -dot(ground.up, unproject_pixel(k, x, y, 1.0F)); }
  [[nodiscard]] float height_m(int x, int y) const { return kHeight_m - fall(x, y) * surface(x, y); }
  template <class Executor>
  [[nodiscard]] Status run(Executor& executor, const GroundContactParams& params = {}) {
    return keep_above_ground(params, labels.cview(), k, ground, normals.view(), surface.view(), executor);
  }
};

}  // namespace

TEST_CASE("ground contact: the foot of a wall that is placed behind its road comes up to it, the rest stays") {
  for (const Vec3f& up : {Vec3f{0, -1, 0}, Vec3f{0.05F, -1, 0.02F}}) {
    Street s(9.0F, 80, up);
    const Street before = s;
    SerialExecutor serial;
    REQUIRE(s.run(serial).ok());
    int drawn = 0;
    int bare = 0;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        const float was_m = before.height_m(x, y);
        if (s.labels(x, y) == label::road || was_m > 0.05F || 0.9F * (kHeight_m - was_m) > kHeight_m - 0.05F) {
          CHECK_UNARY(s.surface(x, y) == before.surface(x, y));
          CHECK_UNARY(s.normals(x, y) == before.normals(x, y));
          continue;
        }
        ++drawn;
        CHECK(s.height_m(x, y) == doctest::Approx(0.05).epsilon(1e-3));
        const bool shows_ground = was_m < -0.05F;
        bare += shows_ground ? 1 : 0;
        CHECK_UNARY(s.normals(x, y) == (shows_ground ? s.ground.up : Vec3f{0, 0, -1}));
      }
    }
    CHECK(drawn > 100);
    CHECK(bare > 30);
    CHECK(bare < drawn);
  }
}

TEST_CASE("ground contact: a valley beyond a parapet, a wall in front of its foot and things without ground stay") {
  SerialExecutor serial;
  for (const float wall_m : {60.0F, 4.0F}) {
    Street s(wall_m, 70);
    const Street before = s;
    REQUIRE(s.run(serial).ok());
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        // At 60 m the rows just below the horizon are as near to the ground's level as a foot is.
        if (before.height_m(x, y) < 0.05F && before.height_m(x, y) > -0.2F) continue;
        CHECK_UNARY(s.surface(x, y) == before.surface(x, y));
      }
    }
  }
  Street floating(9.0F, kShape.height);  // the label reaches the border: no ground below
  const Street before = floating;
  REQUIRE(floating.run(serial).ok());
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 20; x < 130; ++x) CHECK_UNARY(floating.surface(x, y) == before.surface(x, y));
  }
  Street unlabelled(9.0F);
  unlabelled.labels = Image<Label>();
  REQUIRE(unlabelled.run(serial).ok());
  CHECK(unlabelled.surface(60, 75) == 9.0F);
}

TEST_CASE("ground contact: a car that is seen over a raised edge is not drawn to the edge") {
  Street s(12.0F, 70);
  for (int y = 70; y < kShape.height; ++y) {  // ground .25 m higher, from 7 m on
    for (int x = 20; x < 130; ++x) s.surface(x, y) = (kHeight_m - 0.25F) / s.fall(x, y);
  }
  SerialExecutor serial;
  REQUIRE(s.run(serial).ok());
  for (int y = 0; y < 70; ++y) {
    for (int x = 20; x < 130; ++x) CHECK(s.surface(x, y) >= 0.9F * 12.0F);
  }
}

TEST_CASE("ground contact: of depth without noise a foot stays that is low above the ground, one below it comes up") {
  Street s(9.0F);
  const Street before = s;
  SerialExecutor serial;
  GroundContactParams params;
  params.unsure_m = 0;
  REQUIRE(s.run(serial, params).ok());
  int low = 0;
  int drawn = 0;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 20; x < 130; ++x) {
      const float was_m = before.height_m(x, y);
      if (was_m >= 0.0F) {
        low += was_m < 0.05F && s.labels(x, y) == label::building ? 1 : 0;
        CHECK_UNARY(s.surface(x, y) == before.surface(x, y));
      } else if (s.surface(x, y) != before.surface(x, y)) {
        ++drawn;
        CHECK(s.height_m(x, y) == doctest::Approx(0.05).epsilon(1e-3));
      }
    }
  }
  CHECK(low > 50);
  CHECK(drawn > 100);
  params.unsure_m = 0.1F;
  CHECK(s.run(serial, params).code() == StatusCode::invalid_argument);
}

TEST_CASE("ground contact: of a thing that ends deeper below the ground than feet do no row comes up") {
  // At 7.7 m it ends 2 cm below the road, at 9 m .28 m.
  for (const float wall_m : {7.7F, 9.0F}) {
    Street s(wall_m);
    const Street before = s;
    SerialExecutor serial;
    GroundContactParams params;
    params.unsure_m = -0.005F;
    params.deepest_m = 0.06F;
    REQUIRE(s.run(serial, params).ok());
    const float lowest_m = before.height_m(60, 79);
    CAPTURE(lowest_m);
    int drawn = 0;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 20; x < 130; ++x) drawn += s.surface(x, y) != before.surface(x, y) ? 1 : 0;
    }
    if (wall_m < 8.0F) {
      CHECK(lowest_m > -0.06F);
      CHECK(drawn > 50);
    } else {
      CHECK(lowest_m < -0.06F);
      CHECK(drawn == 0);
    }
  }
}

TEST_CASE(
    "ground contact: noise, a hole and a far mismatch in the road below leave no steps between a foot's columns") {
  // Root mean square of the steps, m.
  const auto steps_m = [](const Street& s, int y) {
    double sum = 0;
    int n = 0;
    for (int x = 25; x < 125; ++x) {
      const double step = static_cast<double>(s.surface(x, y) - s.surface(x - 1, y));
      sum += step * step;
      ++n;
    }
    return std::sqrt(sum / n);
  };
  SerialExecutor serial;
  for (const bool holes : {false, true}) {
    CAPTURE(holes);
    Street s(8.0F);
    for (int y = 80; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        RandomStream random(7, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * kShape.width + x), 0);
        s.surface(x, y) *= 1.0F + 0.02F * (random.uniform() - 0.5F);
      }
    }
    if (holes) {
      for (int x = 0; x < kShape.width; ++x) s.surface(x, 80) = 0.0F;
    }
    s.surface(60, 81) = s.surface(60, holes ? 81 : 80) = 1000.0F;
    const double of_road = steps_m(s, 85);
    REQUIRE(s.run(serial).ok());
    CHECK(of_road > 0.04);
    CHECK(steps_m(s, 79) < 0.02);
  }
}

TEST_CASE("ground contact: on either side of a kerb a foot stands on its own ground") {
  Street s(7.6F);
  for (int y = 80; y < kShape.height; ++y) {
    for (int x = 75; x < kShape.width; ++x) {
      s.labels(x, y) = label::sidewalk;
      s.surface(x, y) = (kHeight_m - 0.08F) / s.fall(x, y);
    }
  }
  SerialExecutor serial;
  REQUIRE(s.run(serial).ok());
  for (const int x : {73, 74}) CHECK(s.height_m(x, 79) == doctest::Approx(0.05).epsilon(1e-2));
  for (const int x : {75, 76}) CHECK(s.height_m(x, 79) == doctest::Approx(0.13).epsilon(1e-2));
}

TEST_CASE("ground contact: holes stay, bad arguments are refused, and the bits are those of any number of threads") {
  SerialExecutor serial;
  npsim_test::BackwardExecutor backward;
  Street a(9.0F), b(9.0F);
  for (Street* s : {&a, &b}) {
    s->surface(60, 76) = 0.0F;
    s->surface(61, 85) = std::numeric_limits<float>::quiet_NaN();  // of the road: the ground below counts
  }
  REQUIRE(a.run(serial).ok());
  REQUIRE(b.run(backward).ok());
  CHECK(a.surface(60, 76) == 0.0F);
  CHECK(a.height_m(61, 74) == doctest::Approx(0.05).epsilon(1e-3));
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      CHECK_UNARY(x == 61 || a.surface(x, y) == b.surface(x, y));
      CHECK_UNARY(a.normals(x, y) == b.normals(x, y));
    }
  }
  GroundContactParams params;
  params.clear_m = -1;
  CHECK(a.run(serial, params).code() == StatusCode::invalid_argument);
  params = {};
  params.bare_m = std::numeric_limits<float>::infinity();
  CHECK(a.run(serial, params).code() == StatusCode::invalid_argument);
  Image<Vec3f> small({3, 3});
  CHECK(keep_above_ground({}, a.labels.cview(), a.k, a.ground, small.view(), a.surface.view(), serial).code() ==
        StatusCode::shape_mismatch);
}
