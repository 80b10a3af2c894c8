// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/things/car_bodies.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

constexpr Shape kShape{512, 200};
constexpr float kCameraHeight_m = 1.4F;
constexpr float kTop_m = 1.45F;
constexpr std::uint16_t kCar = 7;

// A box as large as a car on the ground, its corner that is next to the camera at (x, z), turned by an angle, before a
// wall 30 m away; seen by a stereo pair. The side's plane comes first.
struct Street {
  Intrinsics k{560, 560, 256, 60};
  DepthNoise noise{1e-3F, 0, 2.0F};
  GroundPlane ground{{0, -1, 0}, kCameraHeight_m, 1.0F};
  Vec3f normal[2];
  float distance_m[2];
  Image<float> truth{kShape}, depth{kShape}, surface{kShape};
  Image<Vec3f> normals{kShape};
  Image<Label> labels{kShape, label::road};
  Image<std::uint16_t> instances{kShape};
  Image<std::uint8_t> face{kShape, 2};  // 0 and 1: the box's

  explicit Street(float angle_rad, Vec2f corner = {-3.0F, 11.0F}) {
    const Vec3f at{corner.x, 0.0F, corner.y};
    normal[0] = {std::cos(angle_rad), 0, std::sin(angle_rad)};
    normal[1] = {std::sin(angle_rad), 0, -std::cos(angle_rad)};
    const float extent_m[2] = {4.4F, 1.8F};  // of each face
    for (int i = 0; i < 2; ++i) {
      if (dot(normal[i], at) > 0.0F) normal[i] = -normal[i];
      distance_m[i] = -dot(normal[i], at);
    }
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        const Vec3f ray = unproject_pixel(k, x, y, 1.0F);
        truth(x, y) = ray.y * 30.0F > kCameraHeight_m ? kCameraHeight_m / ray.y : 30.0F;
        normals(x, y) = ray.y * 30.0F > kCameraHeight_m ? ground.up : Vec3f{0, 0, -1};
        for (int i = 0; i < 2; ++i) {
          const float w = car_detail::plane_w(normal[i], distance_m[i], ray);
          const Vec3f p = ray * (1.0F / w);
          const Vec3f from{p.x - at.x, 0.0F, p.z - at.z};
          const float height = kCameraHeight_m - p.y;
          if (length(from) > extent_m[i] || dot(from, normal[1 - i]) > 0.0F || height < 0.0F || height > kTop_m)
            continue;
          truth(x, y) = 1.0F / w;
          normals(x, y) = normal[i];
          labels(x, y) = label::car;
          instances(x, y) = kCar;
          face(x, y) = static_cast<std::uint8_t>(i);
        }
      }
    }
    depth = truth;
  }
  [[nodiscard]] float height(int x, int y) const {
    return kCameraHeight_m - truth(x, y) * unproject_pixel(k, x, y, 1.0F).y;
  }
  // Of the car, within .35 m in the row.
  [[nodiscard]] bool near_outline(int x, int y) const {
    const int reach = static_cast<int>(std::ceil(0.35F * k.fx / truth(x, y)));
    for (const int u : {x - reach, x + reach}) {
      if (u < 0 || u >= kShape.width || instances(u, y) != instances(x, y)) return true;
    }
    return false;
  }
  [[nodiscard]] bool in_window(int x, int y) const {
    return face(x, y) == 0 && height(x, y) > 0.9F && height(x, y) < 1.35F;
  }
  // Of f(x, y) over the pixels of a face that lie at most below_m high, away from the outline.
  template <class F>
  [[nodiscard]] double mean_of(std::uint8_t of, float below_m, int fewest, const F& f) const {
    double sum = 0;
    int n = 0;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        if (face(x, y) != of || height(x, y) > below_m || near_outline(x, y)) continue;
        sum += static_cast<double>(f(x, y));
        ++n;
      }
    }
    REQUIRE(n > fewest);
    return sum / n;
  }
  // Noise, windows that show what is 2 m behind them, and normals as such depth gives them: of windows anything.
  void measure() {
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        RandomStream random(5, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * kShape.width + x), 0);
        const float sum = random.uniform() + random.uniform() + random.uniform() + random.uniform() - 2.0F;
        const float z = truth(x, y) + (in_window(x, y) ? 2.0F : 0.0F);
        depth(x, y) = 1.0F / (1.0F / z + 1.732F * sum * noise.amplitude);
        if (in_window(x, y)) normals(x, y) = normalized(Vec3f{-normal[0].x, -0.3F, -0.3F});
      }
    }
  }
  template <class Executor>
  [[nodiscard]] Status run(Executor& executor, const CarBodiesParams& params = {}) {
    surface = depth;
    npsim_test::Scratch memory(shape_cars_workspace_bytes(params, kShape));
    return shape_cars(params, depth.cview(), ObjectMap{labels.cview(), instances.cview()}, noise, k, ground,
                      normals.view(), surface.view(), memory.workspace(), executor);
  }
};

float degrees_between(const Vec3f& a, const Vec3f& b) {
  return std::acos(clamp_to(dot(a, b), -1.0F, 1.0F)) * 57.29578F;
}

}  // namespace

TEST_CASE("cars: the corner of a box from exact samples, within 1.6 degrees, at any angle and on either side") {
  for (const float x : {-3.0F, 0.5F, 3.0F}) {
    for (const float degrees : {-40.0F, -13.0F, 0.0F, 4.0F, 21.0F, 44.0F}) {
      CAPTURE(x);
      CAPTURE(degrees);
      const Street street(degrees / 57.29578F, {x, 11.0F});
      std::vector<car_detail::Sample> samples;
      Vec3f about;
      bool both[2] = {false, false};
      for (int y = 0; y < kShape.height; y += 3) {
        for (int u = 0; u < kShape.width; u += 3) {
          if (street.face(u, y) == 2) continue;
          both[street.face(u, y)] = true;
          samples.push_back({unproject_pixel(street.k, u, y, 1.0F), 1.0F / street.truth(u, y)});
          about += unproject_pixel(street.k, u, y, street.truth(u, y));
        }
      }
      about = about * (1.0F / static_cast<float>(samples.size()));
      std::vector<float> scratch(samples.size());
      const car_detail::Corner corner =
          car_detail::fit_corner(street.noise, 0.05F, street.ground, about, {samples.data(), samples.size()},
                                 {scratch.data(), scratch.size()});
      for (int i = 0; i < 2; ++i) {
        if (!both[i]) continue;
        const int own = dot(corner.normal[0], street.normal[i]) > dot(corner.normal[1], street.normal[i]) ? 0 : 1;
        CHECK(degrees_between(corner.normal[own], street.normal[i]) <= 1.6F);
        CHECK(std::fabs(corner.distance_m[own] - street.distance_m[i]) <= 0.028F * length(about));
      }
    }
  }
}

TEST_CASE("cars: windows that show what is behind them get the side's normals and depth, and nothing else moves") {
  Street street(-0.3F);
  street.measure();
  const Image<Vec3f> before = street.normals;
  SerialExecutor serial;
  REQUIRE(street.run(serial).ok());
  double off_before = 0;
  double off_after = 0;
  double turn_before = 0;
  double turn_after = 0;
  int panes = 0;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (street.face(x, y) == 2) {
        REQUIRE(street.normals(x, y) == before(x, y));
        REQUIRE(street.surface(x, y) == street.depth(x, y));
      } else if (street.in_window(x, y)) {
        ++panes;
        off_before += static_cast<double>(std::fabs(street.depth(x, y) - street.truth(x, y)));
        off_after += static_cast<double>(std::fabs(street.surface(x, y) - street.truth(x, y)));
        turn_before += static_cast<double>(degrees_between(before(x, y), street.normal[0]));
        turn_after += static_cast<double>(degrees_between(street.normals(x, y), street.normal[0]));
      }
    }
  }
  REQUIRE(panes > 500);
  CHECK(off_before / panes > 1.9);
  CHECK(off_after / panes < 1.0);
  // 20 degrees of what a normal may keep, and 25 by which windows lean.
  CHECK(turn_before / panes > 100.0);
  CHECK(turn_after / panes < 50.0);
}

TEST_CASE("cars: a side whose doors a bicycle hides but for their end is a side, and leans as windows do") {
  Street street(-0.3F);
  street.measure();
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (street.face(x, y) != 0 || street.height(x, y) > 1.05F) continue;
      const Vec3f at = unproject_pixel(street.k, x, y, street.truth(x, y));
      if (length(Vec3f{at.x + 3.0F, 0.0F, at.z - 11.0F}) < 0.9F) continue;
      street.labels(x, y) = label::bicycle;
      street.instances(x, y) = 0;
    }
  }
  SerialExecutor serial;
  REQUIRE(street.run(serial).ok());
  double turned = 0;
  int panes = 0;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (!street.in_window(x, y) || street.labels(x, y) != label::car || street.height(x, y) > 1.15F) continue;
      ++panes;
      turned += static_cast<double>(degrees_between(street.normals(x, y), street.normal[0]));
    }
  }
  REQUIRE(panes > 500);
  CHECK(turned / panes < 45.0);  // as where all doors are seen
}

TEST_CASE("cars: true normals at the waist stay bit by bit, for what is near the body is not turned") {
  Street street(0.0F);
  const Image<Vec3f> before = street.normals;
  SerialExecutor serial;
  REQUIRE(street.run(serial).ok());
  int doors = 0;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (street.face(x, y) == 2 || street.height(x, y) < 0.45F || street.height(x, y) > 0.7F) continue;
      // Within corner_m of the edge the body is round, and within rim_m of its outline.
      if (street.near_outline(x, y)) continue;
      const Vec3f ray = unproject_pixel(street.k, x, y, 1.0F);
      const float other =
          car_detail::plane_w(street.normal[1 - street.face(x, y)], street.distance_m[1 - street.face(x, y)], ray);
      const float own = 1.0F / street.truth(x, y);
      if ((other - own) / (own * own) < 0.4F) continue;
      REQUIRE(street.normals(x, y) == before(x, y));
      ++doors;
    }
  }
  CHECK(doors > 500);
}

TEST_CASE("cars: the body turns away at its own outline, not where another car or the frame cuts it off") {
  const auto outward = [](bool cut, Label by = label::car) {
    Street street(0.0F, {-0.05F, 11.0F});  // its end alone is seen
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x <= 180 && cut; ++x) {  // covers the left end, and reaches lower
        street.labels(x, y) = by;
        street.instances(x, y) = by == label::car ? kCar + 1 : 0;
        street.depth(x, y) = by == label::car ? 6.0F : 0.0F;
      }
    }
    SerialExecutor serial;
    REQUIRE(street.run(serial).ok());
    int first = 0;
    while (street.instances(first, 110) != kCar) ++first;
    return -street.normals(first, 110).x;
  };
  CHECK(outward(false) > 0.6F);
  CHECK(outward(true) < 0.2F);
  for (const Label frame : {label::ego_vehicle, label::rectification_border, label::out_of_roi}) {
    CHECK(outward(true, frame) < 0.2F);
  }
}

TEST_CASE("cars: the share of a normal that leads outward rises to 1 at the outline, and none becomes smaller") {
  const Vec3f up{0, -1, 0}, ray{0, 0, 1};
  const Vec3f back{0, 0, -1};
  for (const float t : {0.0F, 0.05F, 0.15F, 0.29F}) {
    const Vec3f right = car_detail::round_at_rim(back, ray, up, true, t, 0.3F);
    CHECK(right.x == doctest::Approx(1.0 - static_cast<double>(t) / 0.3).epsilon(1e-5));
    CHECK(length(right) == doctest::Approx(1.0).epsilon(1e-5));
    CHECK(car_detail::round_at_rim(back, ray, up, false, t, 0.3F).x == doctest::Approx(-static_cast<double>(right.x)));
  }
  CHECK(car_detail::round_at_rim(back, ray, up, true, 0.3F, 0.3F) == back);
  const Vec3f more = normalized(Vec3f{0.9F, 0, -0.3F});
  CHECK(car_detail::round_at_rim(more, ray, up, true, 0.15F, 0.3F) == more);
}

TEST_CASE("cars: one whose roof and windows alone look out over something nearer stands along the street") {
  // Mean share of the normals across the street, and whether anything changed.
  const auto across = [](bool covered) {
    Street street(0.0F, {-0.05F, 11.0F});
    street.noise.amplitude = 4.0F / 121.0F;  // normals are the body's
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        if (street.face(x, y) == 2) continue;
        street.normals(x, y) = {1, 0, 0};  // a stereo pair's guess
        if (street.height(x, y) >= 0.97F) continue;
        street.labels(x, y) = covered ? label::car : label::road;
        street.instances(x, y) = covered ? kCar + 1 : 0;
        street.face(x, y) = 2;
        if (covered) street.depth(x, y) *= 0.8F;
      }
    }
    SerialExecutor serial;
    REQUIRE(street.run(serial).ok());
    float sum = 0;
    int n = 0;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        if (street.face(x, y) == 2 || street.near_outline(x, y)) continue;
        sum += std::fabs(street.normals(x, y).x);
        ++n;
      }
    }
    REQUIRE(n > 200);
    return sum / static_cast<float>(n);
  };
  CHECK(across(true) < 0.1F);
  CHECK(across(false) == 1.0F);  // a car on a ramp, or a label without doors
}

TEST_CASE("cars: the noisier the depth, the less a normal may differ from the body's") {
  const auto off_body = [](float noise) {
    Street street(0.0F);
    street.noise.amplitude = noise;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        if (street.face(x, y) == 1) street.normals(x, y) = {1, 0, 0};
      }
    }
    SerialExecutor serial;
    REQUIRE(street.run(serial).ok());
    double sum = 0;
    int n = 0;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        const float h = street.height(x, y);
        if (street.face(x, y) != 1 || h < 0.6F || h > 0.7F || street.near_outline(x, y)) continue;
        sum += static_cast<double>(degrees_between(street.normals(x, y), street.normal[1]));
        ++n;
      }
    }
    REQUIRE(n > 50);
    return sum / n;
  };
  const double exact = off_body(1e-5F);
  CHECK(exact == doctest::Approx(57.29578 * 0.35).epsilon(0.1));
  // At 11 m this is known to .25 m.
  CHECK(off_body(0.25F / 121.0F) == doctest::Approx(0.5 * exact).epsilon(0.15));
}

TEST_CASE(
    "cars: the rear window of one so far away that depth does not show it leans as rear windows do, not as a roof") {
  Street street(0.0F, {0.9F, 14.0F});
  street.noise.amplitude = 4e-3F;  // .8 m at 14 m, as of a common pair at 50 m
  street.measure();
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (street.face(x, y) == 1 && street.height(x, y) > 0.9F) street.depth(x, y) += 3.0F;  // what is behind it
    }
  }
  SerialExecutor serial;
  REQUIRE(street.run(serial).ok());
  int seen = 0;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (street.face(x, y) != 1 || street.near_outline(x, y)) continue;
      if (street.height(x, y) < 1.0F || street.height(x, y) > 1.15F) continue;
      ++seen;
      const float lean = 90.0F - degrees_between(street.normals(x, y), street.ground.up);
      CHECK(lean > 30.0F);
      CHECK(lean < 55.0F);
    }
  }
  CHECK(seen > 100);
}

TEST_CASE(
    "cars: one that stereo sees too far off comes to stand where its wheels meet the road, not behind a pavement") {
  // Mean of surface over true depth on the lower doors.
  const auto stands_at = [](float too_far, bool pavement, float most_shift, float road_noise = 0.0F) {
    Street street(-0.3F);
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        RandomStream random(9, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * kShape.width + x), 0);
        if (street.face(x, y) == 2) street.depth(x, y) *= 1.0F + road_noise * (random.uniform() - 0.5F);
      }
    }
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        if (street.face(x, y) == 2) continue;
        street.depth(x, y) *= too_far;
        if (!pavement || street.height(x, y) > 0.06F) continue;
        street.face(x, y) = 2;  // .12 m high, before the wheels
        street.labels(x, y) = label::sidewalk;
        street.instances(x, y) = 0;
        street.depth(x, y) = (kCameraHeight_m - 0.12F) / unproject_pixel(street.k, x, y, 1.0F).y;
      }
    }
    CarBodiesParams params;
    params.most_shift = most_shift;
    SerialExecutor serial;
    REQUIRE(street.run(serial, params).ok());
    return street.mean_of(0, 0.6F, 300, [&](int x, int y) { return street.surface(x, y) / street.truth(x, y); });
  };
  CHECK(stands_at(1.06F, false, 0.0F) > 1.05);
  CHECK(stands_at(1.06F, false, 0.1F) == doctest::Approx(1.0).epsilon(0.01));
  CHECK(stands_at(1.06F, false, 0.03F) == doctest::Approx(1.03).epsilon(0.01));  // no farther than it may
  CHECK(stands_at(1.0F, false, 0.1F) == doctest::Approx(1.0).epsilon(0.01));
  CHECK(stands_at(0.95F, false, 0.1F) == doctest::Approx(0.95).epsilon(0.01));  // wheels behind it may be hidden
  CHECK(stands_at(1.0F, true, 0.1F) == doctest::Approx(1.0).epsilon(0.01));
  CHECK(stands_at(1.0F, false, 0.1F, 0.06F) == doctest::Approx(1.0).epsilon(0.02));  // the road's noise is no bias
}

TEST_CASE("cars: one that covers a farther car stands before it, though stereo has it behind") {
  const auto behind_m = [](bool covers) {
    Street street(0.0F, {0.9F, 12.0F});  // its end is on the right
    int right = 0;
    int low = 0;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        if (street.instances(x, y) != kCar) continue;
        right = std::max(right, x);
        low = std::max(low, y);
      }
    }
    for (int y = low - 60; y < low - 14; ++y) {
      for (int x = right + 1; x < right + 60; ++x) {
        street.labels(x, y) = label::car;
        street.instances(x, y) = kCar + 1;
        street.normals(x, y) = {0, 0, -1};
        street.depth(x, y) = 11.4F;
        if (!covers && x < right + 4) street.instances(x, y) = street.labels(x, y) = 0;
      }
    }
    SerialExecutor serial;
    REQUIRE(street.run(serial).ok());
    return street.surface(right, low - 30) - street.surface(right + 10, low - 30);
  };
  CHECK(behind_m(false) > 0.4F);
  CHECK(behind_m(true) < 0.1F);
}

TEST_CASE("cars: the profile of a side has ramps where medians have steps") {
  std::vector<car_detail::Row> rows(40);
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i].distance_m = i < 20 ? 10.0F : 11.0F;
  car_detail::average_rows({rows.data(), rows.size()}, 4);
  CHECK(rows.front().distance_m == 10.0F);
  CHECK(rows.back().distance_m == 11.0F);
  for (std::size_t i = 1; i < rows.size(); ++i) {
    CHECK(rows[i].distance_m - rows[i - 1].distance_m >= 0.0F);
    CHECK(rows[i].distance_m - rows[i - 1].distance_m <= 0.112F);
  }
}

TEST_CASE("cars: an end that stereo sees as far off as the wheels behind it comes before them") {
  const auto end_off_m = [](float overhang_m) {
    Street street(-0.3F);
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        if (street.face(x, y) == 2) continue;
        const Vec3f at = unproject_pixel(street.k, x, y, street.truth(x, y));
        const float behind_end_m = -dot(street.normal[1], at) - street.distance_m[1];
        if (street.height(x, y) < 0.2F && behind_end_m < 0.7F) {  // the road is seen under the bumper
          street.face(x, y) = 2;
          street.labels(x, y) = label::road;
          street.instances(x, y) = 0;
          street.depth(x, y) = kCameraHeight_m / unproject_pixel(street.k, x, y, 1.0F).y;
        } else if (street.face(x, y) == 1) {
          street.depth(x, y) *= 1.06F;
        }
      }
    }
    CarBodiesParams params;
    params.overhang_m = overhang_m;
    SerialExecutor serial;
    REQUIRE(street.run(serial, params).ok());
    return street.mean_of(1, 0.8F, 100, [&](int x, int y) { return street.surface(x, y) - street.truth(x, y); });
  };
  CHECK(end_off_m(0.0F) > 0.5);
  CHECK(end_off_m(0.7F) < 0.4);
  CHECK(end_off_m(0.7F) > -0.1);
}

TEST_CASE("cars: what is no box, too small, without a number or over unknown ground stays bit by bit") {
  const auto unchanged = [](Street& street, const CarBodiesParams& params = {}) {
    const Image<Vec3f> before = street.normals;
    SerialExecutor serial;
    REQUIRE(street.run(serial, params).ok());
    return street.normals == before && street.surface == street.depth;
  };
  Street scattered(-0.3F);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      scattered.depth(x, y) *= 1.0F + 0.2F * static_cast<float>((x / 9 * 3 + y / 7 * 5) % 6);
    }
  }
  scattered.noise.amplitude = 1e-4F;
  CHECK(unchanged(scattered));

  Street street(-0.3F);
  street.measure();
  CarBodiesParams params;
  params.min_px = 1e6F;
  CHECK(unchanged(street, params));
  params = CarBodiesParams{};
  params.enabled = false;
  CHECK(unchanged(street, params));
  const GroundPlane known = street.ground;
  street.ground.inlier_share = 0.0F;
  CHECK(unchanged(street));
  street.ground = known;
  street.instances = Image<std::uint16_t>(kShape);
  CHECK(unchanged(street));
}

TEST_CASE("cars: holes, a car cut by the picture's border and one seen from the front alone leave everything finite") {
  for (const Vec2f corner : {Vec2f{-6.0F, 9.0F}, Vec2f{0.9F, 12.0F}, Vec2f{-2.0F, 4.2F}}) {
    CAPTURE(corner.x);
    Street street(0.02F, corner);
    street.measure();
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        if ((x * 7 + y * 3) % 11 < 4) street.depth(x, y) = 0.0F;
      }
    }
    SerialExecutor serial;
    REQUIRE(street.run(serial).ok());
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        if (street.depth(x, y) == 0.0F) {
          REQUIRE(street.surface(x, y) == 0.0F);
          continue;
        }
        REQUIRE(is_valid_depth(street.surface(x, y)));
        REQUIRE(length(street.normals(x, y)) == doctest::Approx(1.0F).epsilon(1e-4));
      }
    }
  }
}

TEST_CASE("cars: the same bits for any order of work, and bad parameters and shapes are refused") {
  Street a(-0.3F);
  Street b(-0.3F);
  a.measure();
  b.measure();
  SerialExecutor serial;
  npsim_test::BackwardExecutor backward;
  REQUIRE(a.run(serial).ok());
  REQUIRE(b.run(backward).ok());
  CHECK(a.normals == b.normals);
  CHECK(a.surface == b.surface);
  CHECK(!(a.surface == a.depth));
  CarBodiesParams params;
  params.window_m = std::numeric_limits<float>::quiet_NaN();
  CHECK(a.run(serial, params).code() == StatusCode::invalid_argument);
  a.instances = Image<std::uint16_t>(Shape{8, 8});
  CHECK(a.run(serial).code() == StatusCode::shape_mismatch);
}
