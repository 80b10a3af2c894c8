// SPDX-License-Identifier: Apache-2.0
// The background behind the objects of generated streets, from their true depth, against what is truly there.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "fixture.hpp"
#include "npsim/depth/uncertainty.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/mesh/complete.hpp"
#include "npsim/mesh/sheet.hpp"
#include "street/street.hpp"

namespace {

using namespace npsim;  // NOLINT(google-build-using-namespace)

struct Count {
  int right = 0;  // within 3 %
  int all = 0;    // pixels of the foreground with a surface behind
  [[nodiscard]] double share() const { return static_cast<double>(right) / all; }
};

Count behind_objects(const street::Street& s, const BackgroundParams& params, ThreadPool& pool) {
  const Shape shape = s.params.shape;
  io::Image<std::uint8_t> uncertain(shape);
  io::Image<std::uint8_t> surface(shape);
  io::Image<std::uint8_t> state(shape);
  io::Image<std::uint8_t> quads(quad_shape(shape));
  io::Image<Vec3f> vertices(shape);
  for (std::size_t i = 0; i < shape.pixels(); ++i) {
    surface.data()[i] = kNoSurfaceLabels.contains(s.labels.data()[i]) ? 0 : 1;
  }
  npsim_test::Scratch scratch(uncertainty_workspace_bytes({}, shape) +
                              complete_background_workspace_bytes(params, shape));
  Workspace& workspace = scratch.workspace();
  UncertaintyOutput out;
  out.mask = uncertain.view();
  REQUIRE(uncertainty({}, s.depth.view(), s.labels.view(), out, workspace, pool).ok());
  const SheetLayer layer{vertices.view(), quads.view()};
  REQUIRE(build_sheet({}, s.depth.view(), surface.view(), s.intrinsics, layer, pool).ok());
  REQUIRE(complete_background(params, {layer.vertices, s.labels.view(), uncertain.view(), surface.view(), s.intrinsics},
                              layer, state.view(), workspace, pool)
              .ok());
  Count count;
  for (std::size_t i = 0; i < shape.pixels(); ++i) {
    const float truth = s.background_depth.data()[i];
    if (!kForegroundLabels.contains(s.labels.data()[i]) || !(truth > 0)) continue;
    ++count.all;
    count.right += std::fabs(vertices.data()[i].z / truth - 1.0F) <= 0.03F ? 1 : 0;
  }
  return count;
}

}  // namespace

TEST_CASE(
    "behind the objects of streets with kerbs unseen and much hidden, three of five pixels are within 3 % of what is "
    "truly there") {
  ThreadPool pool(2);
  for (const std::uint64_t seed : {3U, 5U}) {  // kerbs that are never seen, bins and bushes behind cars
    CAPTURE(seed);
    street::StreetParams params;
    params.seed = seed;
    params.shape = {480, 270};
    params.samples = 1;
    params.sky_rays = 0;
    const auto s = std::make_unique<street::Street>();
    REQUIRE(street::make_street(params, pool, *s).ok());
    CHECK(behind_objects(*s, {}, pool).share() > 0.6);
  }
}

TEST_CASE("behind the objects of some streets, four of five pixels are within 3 % of what is truly there") {
  ThreadPool pool(2);
  Count street_way;
  Count row_way;
  for (const std::uint64_t seed : {1U, 4U, 7U}) {
    CAPTURE(seed);
    street::StreetParams params;
    params.seed = seed;
    params.shape = {480, 270};
    params.samples = 1;
    params.sky_rays = 0;
    const auto s = std::make_unique<street::Street>();
    REQUIRE(street::make_street(params, pool, *s).ok());
    BackgroundParams rows;
    rows.interpolation = BackgroundInterpolation::linear_inverse_depth;
    const Count a = behind_objects(*s, {}, pool);
    const Count b = behind_objects(*s, rows, pool);
    CHECK(a.all > 5000);
    CHECK(a.share() > b.share() + 0.2);
    street_way.right += a.right, street_way.all += a.all;
    row_way.right += b.right, row_way.all += b.all;
  }
  CHECK(street_way.share() > 0.8);
  CHECK(row_way.share() < 0.6);
}
