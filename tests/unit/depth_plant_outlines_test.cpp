// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/depth/detail/given/plant_outlines.hpp"
#include "npsim/exec/thread_pool.hpp"

namespace {

using namespace npsim;
using npsim_test::Image;
using npsim_test::Scratch;

constexpr Shape kShape{320, 240};

// 0 .. below - 1, of the pixel.
int draw_at(int x, int y, std::uint32_t below) {
  RandomStream stream(7, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * kShape.width + x), 0);
  return static_cast<int>(stream.next_u32() % below);
}

// A round bush of dark, rough leaves in the middle, before what is `behind`, with the square that was drawn round it.
struct Bush {
  static constexpr int kRadius = 62;
  static constexpr int kHalfSide = 66;
  Image<Rgb8> image{kShape};
  Image<Label> labels{kShape, label::building};
  Image<std::uint16_t> marks{kShape, std::uint16_t{0}};
  Image<std::uint8_t> is_leaf{kShape, std::uint8_t{0}};

  explicit Bush(Label behind = label::building, Rgb8 plain = {150, 110, 80}) {
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        const int dx = x - kShape.width / 2;
        const int dy = y - kShape.height / 2;
        const int draw = draw_at(x, y, 61);
        const bool leaf = dx * dx + dy * dy < kRadius * kRadius;
        is_leaf(x, y) = leaf ? 1 : 0;
        const auto near = [&](int v, int spread) {
          return static_cast<std::uint8_t>(v + draw % (2 * spread + 1) - spread);
        };
        image(x, y) = leaf ? Rgb8{near(45, 30), near(60, 30), near(32, 30)}
                           : Rgb8{near(plain.r, 3), near(plain.g, 3), near(plain.b, 3)};
        const bool drawn = std::abs(dx) <= kHalfSide && std::abs(dy) <= kHalfSide;
        labels(x, y) = drawn ? label::vegetation : behind;
      }
    }
  }
  template <class Executor>
  [[nodiscard]] Image<Label> cleared(Executor& executor, const PlantOutlinesParams& params) const {
    Image<Label> out(kShape);
    Scratch scratch(plant_outlines_workspace_bytes(params, kShape));
    REQUIRE(clear_plant_outlines(params, image.cview(), labels.cview(), marks.cview(), out.view(), scratch.workspace(),
                                 executor)
                .ok());
    return out;
  }
  [[nodiscard]] Image<Label> cleared(const PlantOutlinesParams& params = wide()) const {
    SerialExecutor serial;
    return cleared(serial, params);
  }
  // 28 px of 960 are 9 of 320; the corners of the square are up to 28 px from the circle.
  [[nodiscard]] static PlantOutlinesParams wide() {
    PlantOutlinesParams params;
    params.reach_px = 48.0F;
    return params;
  }
  // Pixels that were drawn as plant and are `now`, of the leaves or of what is behind them; a corner's pixels only
  // where they are within the reach of 16 px.
  [[nodiscard]] int count(const Image<Label>& out, bool leaves, Label now) const {
    int n = 0;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        const int aside = kHalfSide - std::abs(x - kShape.width / 2);
        const int above = kHalfSide - std::abs(y - kShape.height / 2);
        if (!leaves && std::min(aside, above) >= 16) continue;
        if (labels(x, y) == label::vegetation && (is_leaf(x, y) != 0) == leaves && out(x, y) == now) ++n;
      }
    }
    return n;
  }
};

}  // namespace

TEST_CASE("plant outlines: the wall in the corners of a square drawn round a bush is given back, leaves stay") {
  for (const Label behind : {label::building, label::wall, label::sky}) {
    const Bush bush(behind, behind == label::sky ? Rgb8{225, 230, 240} : Rgb8{150, 110, 80});
    const Image<Label> out = bush.cleared();
    const int wall = bush.count(bush.labels, false, label::vegetation);
    const int leaves = bush.count(bush.labels, true, label::vegetation);
    CAPTURE(static_cast<int>(behind));
    CHECK(wall > 3000);
    CHECK(bush.count(out, false, behind) > wall * 7 / 10);
    CHECK(bush.count(out, true, label::vegetation) > leaves * 99 / 100);
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        if (bush.labels(x, y) == behind) REQUIRE(out(x, y) == behind);
      }
    }
  }
}

TEST_CASE("plant outlines: a sky as dark as the leaves and a wall seen through a hole stay plant, as marked lamps do") {
  const Bush overcast(label::sky, Rgb8{44, 46, 42});
  CHECK(overcast.count(overcast.cleared(), false, label::sky) == 0);

  Bush bush;
  for (int y = 100; y < 106; ++y) {  // a hole in the middle, within the reach of a pixel of wall
    for (int x = 160; x < 166; ++x) bush.image(x, y) = Rgb8{150, 110, 80};
  }
  for (int y = 54; y < 60; ++y) {
    for (int x = 94; x < 100; ++x) bush.marks(x, y) = 1;
  }
  const Image<Label> out = bush.cleared();
  for (int y = 100; y < 106; ++y) {
    for (int x = 160; x < 166; ++x) REQUIRE(out(x, y) == label::vegetation);
  }
  for (int y = 54; y < 60; ++y) {
    for (int x = 94; x < 100; ++x) REQUIRE(out(x, y) == label::vegetation);
  }
}

TEST_CASE("plant outlines: labels outside the definition stay, beside a wall, beside a plant and far from both") {
  Bush bush;
  const int places[3][2] = {{20, 20}, {90, 120}, {160, 120}};
  for (const auto& at : places) {
    for (int y = at[1]; y < at[1] + 9; ++y) {
      for (int x = at[0]; x < at[0] + 9; ++x) bush.labels(x, y) = Label{255};
    }
  }
  const Image<Label> out = bush.cleared();
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) REQUIRE((out(x, y) == 255) == (bush.labels(x, y) == 255));
  }
}

TEST_CASE("plant outlines: labels that follow every leaf stay as they are") {
  Bush bush;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const bool leaf = bush.labels(x, y) == label::vegetation && draw_at(x / 2, y / 2, 2) == 0;
      bush.labels(x, y) = leaf ? label::vegetation : label::building;
    }
  }
  CHECK(bush.cleared() == bush.labels);
}

TEST_CASE(
    "plant outlines: the same labels for any number of threads; beyond the reach and switched off nothing changes") {
  const Bush bush;
  ThreadPool pool(3);
  CHECK(bush.cleared(pool, Bush::wide()) == bush.cleared());
  PlantOutlinesParams off;
  off.reach_px = 0.0F;
  CHECK(bush.cleared(off) == bush.labels);
  PlantOutlinesParams near;
  near.reach_px = 6.0F;  // 2 of 320
  const Image<Label> out = bush.cleared(near);
  for (int y = 60; y < 180; ++y) {
    for (int x = 100; x < 220; ++x) REQUIRE(out(x, y) == label::vegetation);
  }
}

TEST_CASE("plant outlines: no plants, one pixel, wrong shapes, a workspace that is too small") {
  SerialExecutor serial;
  const PlantOutlinesParams params;
  for (const Shape shape : {Shape{1, 1}, Shape{7, 3}, Shape{1, 40}}) {
    for (const Label l : {label::vegetation, label::sky}) {
      Image<Rgb8> image(shape);
      Image<Label> labels(shape, l);
      Image<Label> out(shape);
      Scratch scratch(plant_outlines_workspace_bytes(params, shape));
      REQUIRE(clear_plant_outlines(params, image.cview(), labels.cview(), ImageView<const std::uint16_t>(), out.view(),
                                   scratch.workspace(), serial)
                  .ok());
      CHECK(out == labels);
    }
  }
  const Bush bush;
  Image<Label> out(kShape);
  Image<Label> wrong(Shape{320, 239});
  Scratch scratch(plant_outlines_workspace_bytes(params, kShape));
  CHECK(clear_plant_outlines(params, bush.image.cview(), bush.labels.cview(), {}, wrong.view(), scratch.workspace(),
                             serial)
            .code() == StatusCode::shape_mismatch);
  Scratch small(1000);
  CHECK(clear_plant_outlines(params, bush.image.cview(), bush.labels.cview(), {}, out.view(), small.workspace(), serial)
            .code() == StatusCode::workspace_exhausted);
  PlantOutlinesParams bad;
  bad.reach_px = -1.0F;
  CHECK(validate(bad).code() == StatusCode::invalid_argument);
}

TEST_CASE("plant outlines: of what is given to a wall the leaves' depth is dropped, the wall's own is kept") {
  const Shape shape{60, 9};
  Image<Label> drawn(shape, label::building);
  Image<Label> now(shape, label::building);
  Image<float> depth(shape, 20.0F);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 20; x < 40; ++x) {
      drawn(x, y) = label::vegetation;
      now(x, y) = x < 24 ? label::building : label::vegetation;
      depth(x, y) = 12.0F;
    }
    depth(21, y) = 19.0F;  // measured on the wall, with noise
    now(30, y) = label::sky;
  }
  Image<float> kept = depth;
  SerialExecutor serial;
  drop_depth_of_outlines(Bush::wide(), drawn.cview(), now.cview(), depth.cview(), kept.view(), serial);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const bool dropped = x == 20 || x == 22 || x == 23 || x == 30;
      CAPTURE(x);
      REQUIRE(kept(x, y) == (dropped ? 0.0F : depth(x, y)));
    }
  }
}

TEST_CASE(
    "plant outlines: a trunk as dark as its wall and leaves before the sky stay plant where a laser met them, what no "
    "beam met does not") {
  const Shape shape{960, 60};
  Image<Label> drawn(shape, label::building);
  Image<float> depth(shape, 0.0F);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 400; x < 460; ++x) drawn(x, y) = label::vegetation;
    for (int x = 700; x < shape.width; ++x) drawn(x, y) = x < 760 ? label::vegetation : label::sky;
    for (int x = 0; x < 740; x += 3) {  // none comes back from the sky
      const bool trunk = (x >= 420 && x < 460) || x >= 700;
      if (y % 5 == 0) depth(x, y) = trunk ? 12.0F : 20.0F + 0.01F * static_cast<float>(x % 7);
    }
  }
  Image<Label> cleared = drawn;  // all but a strip on the right is taken for wall
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 400; x < 450; ++x) cleared(x, y) = label::building;
    for (int x = 720; x < 760; ++x) cleared(x, y) = label::sky;
  }
  Workspace none(nullptr, 0);
  npsim_test::Scratch memory(allocation_bytes<std::uint8_t>(shape.pixels()) + kWorkspaceAlignment);
  SerialExecutor serial;
  Image<Label> out = cleared;
  CHECK(keep_measured_plants({}, drawn.cview(), depth.cview(), out.view(), none, serial).code() ==
        StatusCode::workspace_exhausted);
  REQUIRE(keep_measured_plants({}, drawn.cview(), depth.cview(), out.view(), memory.workspace(), serial).ok());
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      CAPTURE(x);
      CAPTURE(y);
      const bool plant = (x >= 416 && x < 460) || (x >= 700 && x <= 742);  // four pixels beyond the last beam on it
      REQUIRE(out(x, y) == (plant ? label::vegetation : x >= 700 ? label::sky : label::building));
    }
  }
}
