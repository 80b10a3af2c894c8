// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/estimated/anchor_ground.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/image.hpp"

using namespace npsim;

namespace {

constexpr Shape kShape{160, 90};
constexpr float kHeight = 1.4F;

// A road with a pavement, 12 cm higher, on its right, and a wall across at 20 m; level camera.
struct Scene {
  Intrinsics k{120, 120, 80, 45};
  io::Image<float> truth{kShape};
  io::Image<float> depth{kShape};
  io::Image<Label> labels{kShape, label::building};

  Scene() {
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        truth(x, y) = 20.0F;
        const float down = (static_cast<float>(y) + 0.5F - k.cy) / k.fy;
        if (!(down > 0.0F) || kHeight / down >= 20.0F) continue;
        labels(x, y) = x < 120 ? label::road : label::sidewalk;
        truth(x, y) = (x < 120 ? kHeight : kHeight - 0.12F) / down;
      }
    }
    depth = truth;
  }
  void scale(float factor) {
    for (float& z : depth.view().pixels()) z *= factor;
  }
  void add_noise(float strength) {
    RandomStream random(1, RandomPurpose::generic, 0, 0, 0, 0);
    for (std::size_t i = 0; i < kShape.pixels(); ++i) {
      if (i % 500 == 0) random = RandomStream(1, RandomPurpose::generic, 0, 0, 0, static_cast<std::uint32_t>(i));
      depth.data()[i] *= 1.0F + strength * (static_cast<float>(random.next_u32() % 2001U) / 1000.0F - 1.0F);
    }
  }
  template <class Executor>
  Status run(const AnchorGroundParams& params, float height_m, Executor& executor) {
    const ImageView<const Label> seen = static_cast<const io::Image<Label>&>(labels).view();
    npsim_test::Scratch scratch(std::max(ground_workspace_bytes({}, kShape), anchor_ground_workspace_bytes(kShape)));
    REQUIRE(estimate_ground({}, depth.view(), seen, k, scratch.workspace(), ground).ok());
    const Status status =
        anchor_ground(params, height_m, k, seen, normals, depth.view(), ground, scratch.workspace(), executor);
    CHECK(scratch.workspace().used() == 0);
    return status;
  }
  // Largest relative error of one label.
  [[nodiscard]] float worst(Label l) const {
    float worst = 0.0F;
    for (std::size_t i = 0; i < kShape.pixels(); ++i) {
      if (labels.data()[i] == l) worst = std::fmax(worst, std::fabs(depth.data()[i] / truth.data()[i] - 1.0F));
    }
    return worst;
  }
  GroundPlane ground;
  ImageView<const Vec3f> normals;  // none
};

SerialExecutor serial;

}  // namespace

TEST_CASE("anchoring puts everything to scale by the camera's height") {
  Scene s;
  s.scale(1.07F);
  AnchorGroundParams params;
  params.height_trust = 1.0F;
  REQUIRE(s.run(params, kHeight, serial).ok());
  for (const Label l : {label::road, label::sidewalk, label::building}) CHECK(s.worst(l) < 1e-3F);
  CHECK(s.ground.camera_height_m == doctest::Approx(static_cast<double>(kHeight)).epsilon(1e-4));
}

TEST_CASE("a height trusted by half takes back half of a false scale") {
  Scene s;
  s.scale(1.07F);
  AnchorGroundParams params;
  params.height_trust = 0.5F;
  REQUIRE(s.run(params, kHeight, serial).ok());
  const double left = std::sqrt(1.07) - 1.0;
  for (const Label l : {label::road, label::building}) {
    CHECK(static_cast<double>(s.worst(l)) == doctest::Approx(left).epsilon(0.02));
  }
}

TEST_CASE("anchoring without a height, or with the height switched off, leaves the scale") {
  for (const bool given : {false, true}) {
    Scene s;
    s.scale(1.07F);
    AnchorGroundParams params;
    params.use_camera_height = false;
    REQUIRE(s.run(given ? params : AnchorGroundParams{}, given ? kHeight : 0.0F, serial).ok());
    for (const Label l : {label::road, label::building}) CHECK(s.worst(l) == doctest::Approx(0.07).epsilon(0.02));
  }
}

TEST_CASE("a height that cannot be is ignored") {
  Scene s;
  REQUIRE(s.run({}, 3.0F, serial).ok());
  CHECK(s.worst(label::building) < 1e-3F);
}

TEST_CASE("anchoring flattens noise on the road and keeps the kerb") {
  Scene s;
  s.add_noise(0.02F);
  const float before = s.worst(label::road);
  REQUIRE(s.run({}, kHeight, serial).ok());
  CHECK(before > 0.018F);
  CHECK(s.worst(label::road) < 0.004F);
  CHECK(s.worst(label::sidewalk) < 0.02F);  // 9 % nearer than the road it is not drawn to
}

TEST_CASE(
    "the upright face of a kerb, by the given normals, is not drawn to the pavement's height: its foot stays on the "
    "road") {
  // Right of x = 120 the pavement; between, a face of 12 cm: one point of the road's edge and all points above it.
  Scene s;
  constexpr float kEdge = 1.0F;  // m to the right of the camera
  io::Image<Vec3f> given(kShape, Vec3f{0, -1, 0});
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const float down = (static_cast<float>(y) + 0.5F - s.k.cy) / s.k.fy;
      const float right = (static_cast<float>(x) + 0.5F - s.k.cx) / s.k.fx;
      s.labels(x, y) = label::building;
      s.truth(x, y) = 20.0F;
      if (!(down > 0.0F) || kHeight / down >= 20.0F) continue;
      const float at_face = right > 0.0F ? kEdge / right : 1e9F;
      const bool road = kHeight / down < at_face;
      const bool face = !road && (kHeight - 0.12F) / down < at_face;
      s.labels(x, y) = road ? label::road : label::sidewalk;
      s.truth(x, y) = road ? kHeight / down : (face ? at_face : (kHeight - 0.12F) / down);
      if (face) given(x, y) = {-1, 0, 0};
    }
  }
  s.depth = s.truth;
  const auto worst_face = [&] {
    float worst = 0.0F;
    for (std::size_t i = 0; i < kShape.pixels(); ++i) {
      if (given.data()[i].x < 0) worst = std::fmax(worst, std::fabs(s.depth.data()[i] / s.truth.data()[i] - 1.0F));
    }
    return worst;
  };
  REQUIRE(s.run({}, kHeight, serial).ok());
  CHECK(worst_face() > 0.02F);  // without normals nothing tells it from pavement
  s.depth = s.truth;
  s.normals = static_cast<const io::Image<Vec3f>&>(given).view();
  REQUIRE(s.run({}, kHeight, serial).ok());
  CHECK(worst_face() < 0.005F);
  const io::Image<Vec3f> small({8, 8});
  s.normals = small.view();
  CHECK(s.run({}, kHeight, serial).code() == StatusCode::shape_mismatch);
}

TEST_CASE("a ramp on the road is shape, and stays") {
  Scene s;
  for (int y = 70; y < 85; ++y) {
    for (int x = 20; x < 70; ++x) s.truth(x, y) *= 0.85F;
  }
  s.depth = s.truth;
  AnchorGroundParams params;
  params.surroundings_px = 1;
  REQUIRE(s.run(params, kHeight, serial).ok());
  CHECK(s.depth(45, 77) == doctest::Approx(static_cast<double>(s.truth(45, 77))).epsilon(0.01));
  CHECK(s.depth(100, 77) == doctest::Approx(static_cast<double>(s.truth(100, 77))).epsilon(0.01));
}

TEST_CASE("what stands on the road moves with it") {
  Scene s;
  for (int y = 55; y < 75; ++y) {
    for (int x = 40; x < 60; ++x) {
      s.labels(x, y) = label::car;
      s.truth(x, y) = s.truth(x, 74);
    }
  }
  s.depth = s.truth;
  // A drift of the estimate from left to right, which the road shows.
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) s.depth(x, y) *= 1.0F + 0.03F * std::sin(0.06F * static_cast<float>(x));
  }
  const float before = s.worst(label::car);
  AnchorGroundParams params;
  params.height_trust = 1.0F;  // the drift's mean counts as scale
  REQUIRE(s.run(params, kHeight, serial).ok());
  CHECK(s.worst(label::car) < 0.5F * before);
}

TEST_CASE("without ground, without labels and when switched off nothing changes") {
  for (int how = 0; how < 3; ++how) {
    Scene s;
    s.scale(1.05F);
    AnchorGroundParams params;
    if (how == 0) s.labels = io::Image<Label>(kShape, label::building);
    if (how == 1) s.labels = io::Image<Label>();
    if (how == 2) params.enabled = false;
    const io::Image<float> before = s.depth;
    REQUIRE(s.run(params, kHeight, serial).ok());
    CHECK(std::equal(before.data(), before.data() + kShape.pixels(), s.depth.data()));
  }
}

TEST_CASE("holes stay holes, threads change nothing, bad arguments are refused") {
  Scene s;
  s.add_noise(0.02F);
  for (int x = 0; x < 100; ++x) s.depth(x, 70) = x % 2 == 0 ? 0.0F : NAN;
  Scene other = s;
  ThreadPool pool(3);
  REQUIRE(s.run({}, kHeight, serial).ok());
  REQUIRE(other.run({}, kHeight, pool).ok());
  for (std::size_t i = 0; i < kShape.pixels(); ++i) {
    const bool hole = i / 160 == 70 && i % 160 < 100;
    CHECK(is_valid_depth(s.depth.data()[i]) == !hole);
    if (!hole) CHECK(s.depth.data()[i] == other.depth.data()[i]);
  }
  for (const float height : {-1.0F, NAN, INFINITY}) {
    CHECK(s.run({}, height, serial).code() == StatusCode::invalid_argument);
  }
  AnchorGroundParams params;
  params.min_tolerance = 0.0F;
  CHECK(s.run(params, kHeight, serial).code() == StatusCode::invalid_argument);
}
