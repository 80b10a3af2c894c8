// SPDX-License-Identifier: Apache-2.0
// The street completion against its definition in double precision, for all lane counts and orders.
#include <algorithm>
#include <cmath>

#include "mesh_fixture.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "reference/street_background.hpp"

using namespace mesh_test;

namespace {

// Floor with pavements below, house fronts, crowns and sky above; objects anywhere, up to the whole width.
Picture random_street(std::uint32_t trial, Shape shape) {
  RandomStream random(11, RandomPurpose::test, trial, 0, 0, 0);
  const auto below = [&random](int n) { return static_cast<int>(random.uniform(0.0F, static_cast<float>(n))); };
  Picture p(shape);
  const int w = shape.width;
  const int h = shape.height;
  const bool tilted = trial % 2 == 0;
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      const float under = static_cast<float>(y) - 10.3F + (tilted ? 0.002F * static_cast<float>(x) : 0.0F);
      const float beside = std::fabs(static_cast<float>(x) - 0.45F * static_cast<float>(w));
      if (under > 0.5F) {
        const bool raised = beside > 9.0F * under;
        p.rectangle(x, y, x, y, raised ? label::sidewalk : label::road,
                    (raised ? 136.0F : 150.0F) / under * random.uniform(0.99F, 1.01F));
      } else {
        p.depth(x, y) = 20.0F + 0.05F * static_cast<float>(x % 200);
      }
    }
  }
  const auto some = [&](int count, Label l, float z, int widest, int tallest) {
    for (int k = 0; k < count; ++k) {
      const int x = below(w);
      const int y = below(h);
      const int right = std::min(w - 1, x + below(widest));
      p.rectangle(x, y, right, std::min(h - 1, y + below(tallest)), l, z);
    }
  };
  some(w / 15, label::vegetation, 15.0F, 40, 8);
  some(w / 100, label::building, 9.0F, 90, 12);
  some(w / 60, label::sky, 900.0F, 60, 3);
  some(w / 50, label::car, 5.0F, 120, 14);
  some(2, label::bus, 4.0F, w, 6);
  some(w / 20, label::pole, 6.0F, 2, 30);
  some(w / 30, label::vegetation, 12.0F, 3, 12);
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      if (random.uniform() < 0.03F) p.uncertain(x, y) = 1;
      if (random.uniform() < 0.002F) p.depth(x, y) = kNaN;
    }
  }
  return p;
}

template <class F, class Executor>
Layer completed(Picture& p, const BackgroundParams& params, Executor& executor) {
  Layer layer(p.shape);
  Scratch scratch(complete_background_workspace_bytes(params, p.shape));
  REQUIRE(
      complete_background<F>(params, p.background_input(), layer.view(), p.state.view(), scratch.workspace(), executor)
          .ok());
  return layer;
}

}  // namespace

TEST_CASE("the street completion is its definition to 1e-5, and the same bits for all lanes, orders and threads") {
  int compared = 0;
  int ties = 0;
  int floors = 0;
  for (std::uint32_t trial = 0; trial < 12; ++trial) {
    CAPTURE(trial);
    Picture p = random_street(trial, trial % 3 == 0 ? Shape{1100, 70} : Shape{61 + static_cast<int>(trial) * 20, 50});
    BackgroundParams params;
    if (trial % 4 == 1) params.street.farthest_floor = 8.0F;
    p.run(params);
    Scratch scratch(complete_background_workspace_bytes(params, p.shape));
    SerialExecutor serial;
    StreetFloor floor;
    REQUIRE(mesh_detail::find_floor<simd::F32>(params.floor, p.sheet.vertices.cview(), p.labels.cview(),
                                               p.uncertain.cview(), p.state.cview(), p.intrinsics, scratch.workspace(),
                                               serial, floor)
                .ok());
    floors += floor.valid ? 1 : 0;
    const auto kept = p.background.vertices.cview();
    const reference::Street street{params, floor, p.labels.cview(), p.state.cview(), kept, p.intrinsics.fx};
    const auto slope = [&](int x, int y) {
      return mesh_detail::inverse_depth_slope<simd::scalar::F32>(params.fit_radius_px, params.fit_tolerance, kept,
                                                                 p.state.cview(), x, y);
    };
    for (int y = 0; y < p.shape.height; ++y) {
      for (int x = 0; x < p.shape.width; ++x) {
        if (p.state(x, y) == row_state::known) REQUIRE(kept(x, y) == p.sheet.vertices(x, y));
        if (p.state(x, y) != row_state::missing) continue;
        CAPTURE(x);
        CAPTURE(y);
        const std::vector<double> answers = street.answers(x, y, slope);
        const double z = static_cast<double>(kept(x, y).z);
        double off = 1e9;
        for (const double w : answers) off = std::min(off, w > 0 ? std::fabs(z * w - 1) : (z > 0 ? 1e9 : 0.0));
        REQUIRE(off <= 1e-5);
        ++compared;
        ties += answers.size() > 1 ? 1 : 0;
      }
    }
    const BackwardExecutor reverse;
    ThreadPool pool(2);
    for (const Layer& same : {completed<simd::scalar::F32>(p, params, serial), completed<simd::F32>(p, params, reverse),
                              completed<simd::F32>(p, params, pool)}) {
      CHECK(same.vertices == p.background.vertices);
      CHECK(same.quads == p.background.quads);
    }
  }
  CHECK(floors == 12);
  CHECK(compared > 50000);
  CHECK(ties < compared / 100);
}

TEST_CASE("the slope at an anchor is the least-squares one to 5e-8 of its inverse depth, whatever the lanes") {
  for (std::uint32_t trial = 0; trial < 60; ++trial) {
    CAPTURE(trial);
    RandomStream random(12, RandomPurpose::test, trial, 0, 0, 0);
    const int radius = trial % 3 == 0 ? 4 : 4 + static_cast<int>(random.uniform(0.0F, 60.0F));
    Image<Vec3f> vertices({200, 150}, {}, kPadding, {7, 7, 7});
    Image<std::uint8_t> state({200, 150}, row_state::known, kPadding, 3);
    const float px = random.uniform(-1e-4F, 1e-4F);
    const float py = random.uniform(-1e-4F, 1e-4F);
    for (int y = 0; y < 150; ++y) {
      for (int x = 0; x < 200; ++x) {
        const float w = 0.1F + px * static_cast<float>(x) + py * static_cast<float>(y);
        vertices(x, y) = {0, 0, 1.0F / (w * random.uniform(0.95F, 1.05F))};
        if (trial % 2 == 1 && random.uniform() < 0.1F) state(x, y) = row_state::missing;
      }
    }
    const int x = static_cast<int>(random.uniform(0.0F, 200.0F));
    const int y = static_cast<int>(random.uniform(0.0F, 150.0F));
    const bool inside = x >= radius && y >= radius && x + radius < 200 && y + radius < 150;
    state(x, y) = row_state::known;
    const double exact =
        reference::anchor_slope(radius, static_cast<double>(0.2F), vertices.cview(), state.cview(), x, y);
    const double found =
        mesh_detail::inverse_depth_slope<simd::F32>(radius, 0.2F, vertices.cview(), state.cview(), x, y);
    CHECK(std::fabs(found - exact) <= (inside ? 5e-8 : 5e-7) / static_cast<double>(vertices(x, y).z));
    CHECK(found ==
          mesh_detail::inverse_depth_slope<simd::scalar::F32>(radius, 0.2F, vertices.cview(), state.cview(), x, y));
  }
}
