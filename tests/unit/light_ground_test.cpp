// SPDX-License-Identifier: Apache-2.0
// Ground plane from depth, and the ego vehicle's headlamps that stand on it.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "npsim/core/random.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/light/activation.hpp"
#include "npsim/light/unmarked.hpp"
#include "unit/fixture.hpp"

namespace {

using namespace npsim;

struct Street {
  Shape shape;
  Intrinsics k;
  std::vector<float> depth;
  std::vector<Label> labels;

  Street(int width, int height, Vec3f up, float camera_height, float noise, float outliers)
      : shape{width, height},
        k{0.9F * static_cast<float>(width), 0.9F * static_cast<float>(width), 0.5F * static_cast<float>(width),
          0.45F * static_cast<float>(height)},
        depth(shape.pixels(), 0.0F),
        labels(shape.pixels(), label::sky) {
    up = normalized(up);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        RandomStream r(5, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * width + x), 0);
        const Vec3f ray = unproject_pixel(k, x, y, 1);
        const float fall = -dot(up, ray);
        const std::size_t i = static_cast<std::size_t>(y * width + x);
        if (fall < 0.02F) continue;
        labels[i] = label::road;
        depth[i] = camera_height / fall * (1 + noise * (r.uniform() + r.uniform() + r.uniform() - 1.5F) * 2);
        if (r.uniform() < outliers) depth[i] = r.uniform(1, 60);
        if (r.uniform() < 0.05F) depth[i] = std::numeric_limits<float>::quiet_NaN();
      }
    }
  }
  GroundPlane fit(const GroundParams& params = {}) {
    npsim_test::Scratch scratch(ground_workspace_bytes(params, shape));
    GroundPlane out;
    REQUIRE(estimate_ground(params, ImageView<const float>(depth.data(), shape),
                            ImageView<const Label>(labels.data(), shape), k, scratch.workspace(), out)
                .ok());
    return out;
  }
};

}  // namespace

TEST_CASE("ground: exact depth of a pitched and rolled plane comes back") {
  const Vec3f up = normalized(Vec3f{0.03F, -1, -0.06F});
  Street street(160, 96, up, 1.22F, 0, 0);
  const GroundPlane g = street.fit();
  CHECK(length(g.up - up) < 1e-4F);
  CHECK(g.camera_height_m == doctest::Approx(1.22).epsilon(1e-4));
  CHECK(g.inlier_share > 0.99F);
}

TEST_CASE("ground: 5 % depth noise and 30 % outliers move it by less than a degree and 3 %") {
  const Vec3f up = normalized(Vec3f{-0.02F, -1, 0.04F});
  Street street(200, 120, up, 1.6F, 0.05F, 0.3F);
  const GroundPlane g = street.fit();
  CHECK(dot(g.up, up) > std::cos(0.0175F));
  CHECK(g.camera_height_m == doctest::Approx(1.6).epsilon(0.03));
}

TEST_CASE("ground: without road, on a wall, or from too few pixels it falls back to a level plane") {
  Street wall(64, 48, {0, -1, 0}, 1.5F, 0, 0);
  for (std::size_t i = 0; i < wall.depth.size(); ++i) {
    wall.depth[i] = 10;
    wall.labels[i] = label::road;
  }
  GroundPlane g = wall.fit();
  CHECK(g.inlier_share == 0.0F);
  CHECK(g.up == Vec3f{0, -1, 0});
  CHECK(g.camera_height_m == 1.5F);
  for (Label& l : wall.labels) l = label::building;
  CHECK(wall.fit().inlier_share == 0.0F);
  Street small(3, 2, {0, -1, 0}, 1.5F, 0, 0);
  CHECK(small.fit().inlier_share == 0.0F);
}

TEST_CASE("ground: few road pixels are joined by the pavement; without labels the lower image serves") {
  const Vec3f up{0, -1, 0};
  Street street(120, 80, up, 1.4F, 0, 0);
  for (Label& l : street.labels) {
    if (l == label::road) l = label::sidewalk;
  }
  CHECK(street.fit().camera_height_m == doctest::Approx(1.4).epsilon(1e-3));
  npsim_test::Scratch scratch(ground_workspace_bytes({}, street.shape));
  GroundPlane out;
  REQUIRE(estimate_ground({}, ImageView<const float>(street.depth.data(), street.shape), {}, street.k,
                          scratch.workspace(), out)
              .ok());
  CHECK(out.camera_height_m == doctest::Approx(1.4).epsilon(1e-3));
}

TEST_CASE("ground: beside a car that fills most of the lower image the road is found, though fewer points lie on it") {
  const Vec3f up = normalized(Vec3f{0.02F, -1, 0.01F});
  const auto behind_car = [&](double share, float under, const GroundParams& params = {}) {
    Street street(200, 120, up, 1.6F, 0.01F, 0);
    street.labels.clear();
    for (int y = 72; y < 120; ++y) {
      for (int x = 0; x < 200; ++x) {
        float& z = street.depth[static_cast<std::size_t>(y * 200 + x)];
        if (x >= share * 200) z = 3.0F + 0.002F * static_cast<float>(x) + 0.001F * static_cast<float>(y);
        if ((x + y) % 10 == 0 && under > 0) z = under;  // matched wrongly, say
      }
    }
    GroundPlane out;
    npsim_test::Scratch scratch(ground_workspace_bytes(params, street.shape));
    REQUIRE(estimate_ground(params, ImageView<const float>(street.depth.data(), street.shape), {}, street.k,
                            scratch.workspace(), out)
                .ok());
    return out;
  };
  for (const double share : {0.17, 0.2, 0.25}) {
    const GroundPlane beside = behind_car(share, 0);
    CHECK(beside.inlier_share > 0.9F * static_cast<float>(share));
    CHECK(dot(beside.up, up) > std::cos(0.0175F));
    CHECK(beside.camera_height_m == doctest::Approx(1.6).epsilon(0.03));
  }
  CHECK(behind_car(0.25, 200.0F).inlier_share == 0.0F);  // the ground has nothing under it
  GroundParams strict;
  strict.min_lowest_share = 0.3F;
  CHECK(behind_car(0.25, 0, strict).inlier_share == 0.0F);
}

TEST_CASE("ground: refuses shapes that disagree, bad parameters and a small workspace; repeats itself") {
  Street street(40, 30, {0, -1, 0}, 1.5F, 0.02F, 0.1F);
  CHECK(street.fit().camera_height_m == street.fit().camera_height_m);
  npsim_test::Scratch scratch(ground_workspace_bytes({}, street.shape));
  GroundPlane out;
  const ImageView<const float> depth(street.depth.data(), street.shape);
  CHECK(estimate_ground({}, depth, ImageView<const Label>(street.labels.data(), {20, 30}), street.k,
                        scratch.workspace(), out)
            .code() == StatusCode::shape_mismatch);
  GroundParams bad;
  bad.iterations = 0;
  CHECK(estimate_ground(bad, depth, {}, street.k, scratch.workspace(), out).code() == StatusCode::invalid_argument);
  CHECK(estimate_ground({}, {}, {}, street.k, scratch.workspace(), out).code() == StatusCode::invalid_argument);
  npsim_test::Scratch tiny(100);
  CHECK(estimate_ground({}, depth, {}, street.k, tiny.workspace(), out).code() == StatusCode::workspace_exhausted);
}

TEST_CASE("ego headlamps: height, distance apart, ahead of the camera, kerb side to the right, over a pitched ground") {
  GroundPlane ground;
  ground.up = normalized(Vec3f{0.02F, -1, -0.05F});
  ground.camera_height_m = 1.3F;
  Emitter lamps[2];
  REQUIRE(place_ego_headlamps({}, ground, lamps) == 2);
  CHECK(lamps[0].centre_m.x < 0);
  CHECK(lamps[1].centre_m.x > 0);
  CHECK(length(lamps[0].centre_m - lamps[1].centre_m) == doctest::Approx(1.2).epsilon(1e-5));
  for (const Emitter& e : lamps) {
    CHECK(height_above_ground(ground, e.centre_m) == doctest::Approx(0.65).epsilon(1e-4));
    CHECK(length(e.axis) == doctest::Approx(1.0).epsilon(1e-5));
    CHECK(std::fabs(dot(e.axis, e.up)) < 1e-6F);
    CHECK(-dot(e.axis, ground.up) == doctest::Approx(0.01).epsilon(1e-3));
    CHECK(e.centre_m.z > 1.5F);
    CHECK(e.mark == 0);
    // The road 20 m ahead on the right gets much more than the left eye of an oncoming driver.
    const Vec3f forward = forward_on_ground(ground);
    const Vec3f right = cross(forward, ground.up);
    CHECK(right.x > 0.9F);
    const Vec3f road = e.centre_m + forward * 30.0F + right * 1.5F - ground.up * 0.65F;
    const Vec3f eye = e.centre_m + forward * 50.0F - right * 3.0F + ground.up * 0.5F;
    CHECK(relative_intensity(e, normalized(road - e.centre_m)) >
          20 * relative_intensity(e, normalized(eye - e.centre_m)));
  }
  CHECK(place_ego_headlamps({}, ground, Span<Emitter>(lamps, 1)) == 0);
  ground.camera_height_m = std::numeric_limits<float>::quiet_NaN();
  CHECK(place_ego_headlamps({}, ground, lamps) == 0);
}

TEST_CASE("both ego headlamps get the same technology and strength in a night") {
  Emitter lamps[2];
  REQUIRE(place_ego_headlamps({}, GroundPlane{}, lamps) == 2);
  int changed = 0;
  float last = 0;
  for (std::uint32_t v = 0; v < 20; ++v) {
    Activation a[2];
    REQUIRE(activate_lights({}, 4, v, lamps, {}, a).ok());
    CHECK(a[0].lit);
    CHECK(a[0].probability == 1.0F);
    CHECK(a[0].strength == a[1].strength);
    CHECK(a[0].xy.x == a[1].xy.x);
    CHECK(a[0].strength >= 0.65F * kLowBeamPeakCd);
    CHECK(a[0].strength <= 1.4F * kLowBeamPeakCd);
    changed += a[0].strength != last ? 1 : 0;
    last = a[0].strength;
  }
  CHECK(changed > 15);
}
