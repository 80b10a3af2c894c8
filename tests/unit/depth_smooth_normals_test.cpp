// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/depth/detail/normals/guiding_normals.hpp"

namespace {

using namespace npsim;
using npsim_test::Image;

struct Surface {
  Shape shape{40, 30};
  Image<float> depth{shape, 8.0F};
  Image<Label> labels{shape, label::road};
  Image<Vec3f> normals{shape, Vec3f{0, -1, 0}};

  Status smooth() {
    const SmoothNormalsParams params;
    npsim_test::Scratch scratch(smooth_normals_workspace_bytes(params, shape));
    Workspace& workspace = scratch.workspace();
    SerialExecutor serial;
    return smooth_normals(params, depth.view(), labels.view(), normals.view(), workspace, serial);
  }
};

}  // namespace

TEST_CASE("smooth_normals: noise of 20 degrees on one surface falls below 4, constant normals stay to the bit's edge") {
  Surface s;
  std::uint32_t i = 0;
  for (Vec3f& n : s.normals.view().pixels()) {
    RandomStream random(3, RandomPurpose::test, 0, 0, i++, 0);
    n = normalized(Vec3f{random.uniform(-0.5F, 0.5F), -1, random.uniform(-0.5F, 0.5F)});
  }
  REQUIRE(s.smooth().ok());
  float worst = 1;
  for (int y = 6; y < 24; ++y) {
    for (int x = 6; x < 34; ++x) worst = std::min(worst, -s.normals(x, y).y);
  }
  CHECK(worst > 0.9976F);  // cosine of 4 degrees
  Surface constant;
  REQUIRE(constant.smooth().ok());
  for (const Vec3f& n : constant.normals.view().pixels()) CHECK(n.y == doctest::Approx(-1).epsilon(1e-6));
}

TEST_CASE("smooth_normals: nothing crosses a label border, little a depth step, pixels without a normal stay so") {
  Surface crease;
  Surface step;
  for (int y = 0; y < 30; ++y) {
    for (int x = 20; x < 40; ++x) {
      crease.labels(x, y) = label::building;
      crease.normals(x, y) = {0, 0, -1};
      step.depth(x, y) = 16;
      step.normals(x, y) = {0, 0, -1};
    }
  }
  crease.normals(5, 5) = {};
  REQUIRE(crease.smooth().ok());
  REQUIRE(step.smooth().ok());
  CHECK(crease.normals(19, 15).z == 0.0F);
  CHECK(crease.normals(20, 15).y == 0.0F);
  CHECK(crease.normals(5, 5) == Vec3f{});
  CHECK(step.normals(19, 15).y < -0.999F);
  CHECK(step.normals(20, 15).z < -0.999F);
}
