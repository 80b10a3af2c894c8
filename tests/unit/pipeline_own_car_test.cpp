// SPDX-License-Identifier: Apache-2.0
// The bonnet of the camera's own car: joins what it mirrors at its edge, darkens below, and a star on it is seen through.
#include <doctest/doctest.h>

#include <cmath>

#include "fixture.hpp"
#include "npsim/io/image.hpp"
#include "npsim/pipeline/detail/own_car.hpp"

namespace {

using namespace npsim;

constexpr Shape kShape{120, 80};
constexpr int kEdge = 60;

struct Street {
  io::Image<Rgb8> image{kShape, Rgb8{100, 100, 100}};
  io::Image<Label> labels{kShape, label::road};
  io::Image<Vec3f> night{kShape};
  SceneView view;

  Street() {
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        if (y >= kEdge) labels(x, y) = label::ego_vehicle;
        night(x, y) = y < kEdge ? Vec3f{1, 0.5F, 0.01F * static_cast<float>(y)} : Vec3f{};
      }
    }
  }
  void show() {
    view.camera = intrinsics_from_fov(kShape, 1.2F);
    view.image = image.view();
    view.labels = labels.view();
    npsim_test::Scratch scratch(show_own_car_workspace_bytes(kShape));
    REQUIRE(show_own_car(view, 0.04F, night.view(), scratch.workspace()).ok());
  }
};

}  // namespace

TEST_CASE("own car: at its edge the bonnet shows what stands above it, below ever less and from farther up") {
  Street street;
  street.show();
  const Vec3f first = street.night(60, kEdge);
  CHECK(first.x > 0.75F);  // at grazing incidence nearly everything is reflected
  CHECK(first.x < 1.0F);
  CHECK(first.z / first.x > 0.45F);  // the first rows above the edge, not the sky
  for (int y = kEdge + 1; y < kShape.height; ++y) {
    CHECK(street.night(60, y).x < street.night(60, y - 1).x);
    CHECK(street.night(60, y).z / street.night(60, y).x <
          street.night(60, y - 1).z / street.night(60, y - 1).x + 1e-6F);
    CHECK(street.night(60, y).x > 0.03F);
  }
  CHECK(street.night(60, 10).x == 1.0F);
}

TEST_CASE("own car: a bonnet presses the street together under its edge, four times as far down twice as far up") {
  Street street;
  // One lit row: the bonnet shows it in one place, as dim as the rows it is pressed together with.
  const auto lit_row_below = [&](int above) {
    for (Vec3f& v : street.night.view().pixels()) v = {};
    for (int x = 0; x < kShape.width; ++x) street.night(x, kEdge - above) = {1, 1, 1};
    street.show();
    int at = -1;
    for (int y = kEdge; y < kShape.height; ++y) {
      if (street.night(60, y).x > 0.0F) at = at < 0 ? y - kEdge : at;
    }
    return at;
  };
  const float near_row = 1.5F * std::sqrt(2.0F * intrinsics_from_fov(kShape, 1.2F).fy);
  const int above = static_cast<int>(near_row) + 2;
  CHECK(lit_row_below(above) == 2);
  CHECK(lit_row_below(2 * above) >= 8);
  CHECK(lit_row_below(2 * above) <= 10);
}

TEST_CASE("own car: a star above the bonnet is the road beside it, darker where the photograph is") {
  Street street;
  for (int y = 45; y < kEdge; ++y) {
    for (int x = 56; x < 62; ++x) {
      street.labels(x, y) = label::ego_vehicle;
      street.night(x, y) = {};
    }
    street.image(58, y) = {50, 50, 50};
  }
  street.show();
  CHECK(street.night(57, 50).x == doctest::Approx(1.0));
  CHECK(street.night(58, 50).x < 0.4F);
  CHECK(street.night(58, 50).x > 0.15F);
  CHECK(street.night(58, kEdge + 1).x < street.night(57, kEdge + 1).x);  // and is mirrored
}

TEST_CASE("own car: a mask that ends a 64th above the lower border is a bonnet down to it") {
  Street whole;
  Street cut;
  for (int x = 0; x < kShape.width; ++x) cut.labels(x, kShape.height - 1) = label::road;
  whole.show();
  cut.show();
  for (int x = 0; x < kShape.width; ++x) {
    for (int y = kEdge; y < kShape.height; ++y) CHECK(cut.night(x, y) == whole.night(x, y));
  }
}

TEST_CASE("own car: a scene without one, without labels, and one that is nothing but car stay finite and unchanged") {
  Street street;
  for (Label& l : street.labels.view().pixels()) l = label::road;
  street.show();
  CHECK(street.night(3, 70) == Vec3f{});
  for (Label& l : street.labels.view().pixels()) l = label::ego_vehicle;
  street.show();
  for (const Vec3f& v : street.night.view().pixels()) CHECK(is_finite(v));
}
