// SPDX-License-Identifier: Apache-2.0
#include "npsim/pipeline/detail/unsure_surfaces.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "fixture.hpp"
#include "known_depth.hpp"
#include "npsim/pipeline/night.hpp"

using namespace npsim;
using npsim_test::Image;
using npsim_test::KnownDepth;

TEST_CASE(
    "unsure surfaces: ground on its plane is sure, what is labelled so and stands or leans is not, walls are not") {
  constexpr Shape kShape{6, 1};
  enum { kRoad, kKerb, kBarrier, kLeaning, kWall, kNothing };
  KnownDepth known(kShape, 10);
  for (const int x : {kRoad, kBarrier, kLeaning}) known.labels(x, 0) = label::road;
  known.labels(kKerb, 0) = label::sidewalk;
  RefinedDepth refined = known.refined();
  refined.source = DepthSource::stereo;
  refined.noise.width_px = 2;
  refined.ground.up = {0, -1, 0};
  refined.ground.camera_height_m = 1.5F;
  std::vector<Vec3f> position(kShape.pixels(), Vec3f{0, 1.5F, 10});
  position[kKerb].y -= 0.15F;
  position[kBarrier].y -= 0.6F;
  std::vector<Vec3f> normal(kShape.pixels(), Vec3f{0, -1, 0});
  normal[kLeaning] = normalized(Vec3f{0, -1, -1});
  normal[kWall] = {0, 0, -1};
  std::vector<Vec3f> albedo(kShape.pixels(), Vec3f{0.1F, 0.2F, 0.0F});
  SurfacePoints points;
  points.position = {position.data(), position.size()};
  points.normal = {normal.data(), normal.size()};
  points.albedo = {albedo.data(), albedo.size()};
  Image<std::uint32_t> visible(kShape);
  for (int x = 0; x < kShape.width; ++x) visible(x, 0) = x == kNothing ? kNoPoint : static_cast<std::uint32_t>(x);
  npsim_test::Scratch scratch(allocation_bytes<float>(UnsureLightGuides::floats(kShape)) + kWorkspaceAlignment);
  UnsureLightGuides guides;
  REQUIRE(relight_detail::find_unsure_surfaces({}, refined, points, visible.cview(), scratch.workspace(), guides).ok());
  CHECK(guides.iterations == 4);
  const float* const labels = guides.planes.data() + 3 * kShape.pixels();
  for (const int x : {kRoad, kKerb, kNothing}) CHECK(labels[x] == -1.0F);
  for (const int x : {kBarrier, kLeaning}) CHECK(labels[x] == static_cast<float>(label::road));
  CHECK(labels[kWall] == static_cast<float>(label::building));
  CHECK(guides.planes[kShape.pixels() + kWall] == doctest::Approx(std::log(0.2)));
  CHECK(guides.planes[2 * kShape.pixels() + kWall] == doctest::Approx(std::log(1e-3)));

  // Estimated depth is smooth: of it the light on plants alone is spread.
  refined.source = DepthSource::network;
  known.labels(kBarrier, 0) = label::vegetation;
  npsim_test::Scratch more(allocation_bytes<float>(UnsureLightGuides::floats(kShape)) + kWorkspaceAlignment);
  REQUIRE(relight_detail::find_unsure_surfaces({}, refined, points, visible.cview(), more.workspace(), guides).ok());
  CHECK(guides.iterations == 3);
  const float* const of_estimate = guides.planes.data() + 3 * kShape.pixels();
  for (int x = 0; x < kShape.width; ++x) {
    CHECK(of_estimate[x] == (x == kBarrier ? static_cast<float>(label::vegetation) : -1.0F));
  }
}

TEST_CASE("unsure surfaces: measured depth has some, exact none, estimated where leaves' normals are drawn") {
  const UnsureLightParams params;
  UnsureLightParams off;
  off.reach = 0;
  for (const bool leaves : {false, true}) {
    CHECK(relight_detail::has_unsure_surfaces(params, DepthSource::lidar, leaves));
    CHECK(relight_detail::has_unsure_surfaces(params, DepthSource::network, leaves) == leaves);
    CHECK_FALSE(relight_detail::has_unsure_surfaces(off, DepthSource::stereo, leaves));
  }
  CHECK_FALSE(relight_detail::has_unsure_surfaces(params, DepthSource::exact, false));
}
