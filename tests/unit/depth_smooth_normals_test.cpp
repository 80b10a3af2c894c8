// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <vector>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/depth/guiding_normals.hpp"

namespace {

using namespace npsim;

struct Surface {
  Shape shape{40, 30};
  std::vector<float> depth = std::vector<float>(shape.pixels(), 8.0F);
  std::vector<Label> labels = std::vector<Label>(shape.pixels(), label::road);
  std::vector<Vec3f> normals = std::vector<Vec3f>(shape.pixels(), Vec3f{0, -1, 0});

  [[nodiscard]] std::size_t at(int x, int y) const { return static_cast<std::size_t>(y * shape.width + x); }
  Status smooth() {
    const SmoothNormalsParams params;
    npsim_test::Scratch scratch(smooth_normals_workspace_bytes(params, shape));
    Workspace& workspace = scratch.workspace();
    SerialExecutor serial;
    return smooth_normals(params, {depth.data(), shape}, {labels.data(), shape}, {normals.data(), shape}, workspace,
                          serial);
  }
};

}  // namespace

TEST_CASE("smooth_normals: noise of 20 degrees on one surface falls below 4, constant normals stay to the bit's edge") {
  Surface s;
  for (std::size_t i = 0; i < s.normals.size(); ++i) {
    RandomStream random(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(i), 0);
    s.normals[i] = normalized(Vec3f{random.uniform(-0.5F, 0.5F), -1, random.uniform(-0.5F, 0.5F)});
  }
  REQUIRE(s.smooth().ok());
  float worst = 1;
  for (int y = 6; y < 24; ++y) {
    for (int x = 6; x < 34; ++x) worst = std::min(worst, -s.normals[s.at(x, y)].y);
  }
  CHECK(worst > 0.9976F);  // cosine of 4 degrees
  Surface constant;
  REQUIRE(constant.smooth().ok());
  for (const Vec3f& n : constant.normals) CHECK(n.y == doctest::Approx(-1).epsilon(1e-6));
}

TEST_CASE("smooth_normals: nothing crosses a label border, little a depth step, pixels without a normal stay so") {
  Surface crease;
  Surface step;
  for (int y = 0; y < 30; ++y) {
    for (int x = 20; x < 40; ++x) {
      crease.labels[crease.at(x, y)] = label::building;
      crease.normals[crease.at(x, y)] = {0, 0, -1};
      step.depth[step.at(x, y)] = 16;
      step.normals[step.at(x, y)] = {0, 0, -1};
    }
  }
  crease.normals[crease.at(5, 5)] = {};
  REQUIRE(crease.smooth().ok());
  REQUIRE(step.smooth().ok());
  CHECK(crease.normals[crease.at(19, 15)].z == 0.0F);
  CHECK(crease.normals[crease.at(20, 15)].y == 0.0F);
  CHECK(crease.normals[crease.at(5, 5)] == Vec3f{});
  CHECK(step.normals[step.at(19, 15)].y < -0.999F);
  CHECK(step.normals[step.at(20, 15)].z < -0.999F);
}
