// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/depth/border_spill.hpp"

namespace {

using namespace npsim;
using npsim_test::Image;

// A wall that turns away, as deep at x as 1 / (a + b x) says, and a pole of 8 m before it; upright or lying.
struct Street {
  bool lying = false;
  Shape shape;
  Image<float> depth;
  Image<Label> labels;

  explicit Street(bool lies = false)
      : lying(lies), shape(lies ? Shape{48, 120} : Shape{120, 48}), depth(shape), labels(shape, label::building) {
    for (int j = 0; j < 48; ++j) {
      for (int i = 0; i < 120; ++i) at(depth, i, j) = wall(i);
      for (int i = 60; i < 64; ++i) {
        at(depth, i, j) = 8.0F;
        at(labels, i, j) = label::pole;
      }
    }
  }
  [[nodiscard]] static float wall(int i) { return 1.0F / (0.04F + 2e-4F * static_cast<float>(i)); }
  template <class T>
  T& at(Image<T>& image, int i, int j) const {
    return lying ? image(j, i) : image(i, j);
  }
  [[nodiscard]] Image<float> kept(const BorderSpillParams& params = {}, bool labelled = true) const {
    Image<float> out = depth;
    const SerialExecutor executor;
    const ObjectMap objects{labelled ? labels.cview() : ImageView<const Label>(), {}};
    REQUIRE(drop_border_spill(params, depth.view(), objects, out.view(), executor).ok());
    return out;
  }
};

}  // namespace

TEST_CASE("border spill: a pole's depth is dropped from the wall beside it, nothing else, along rows and columns") {
  for (const bool lying : {false, true}) {
    Street street(lying);
    for (int j = 0; j < 48; ++j) {
      for (int i = 54; i < 70; ++i) {
        if (j % 3 == 0 && i == 56) {
          street.at(street.depth, i, j) = 0.0F;  // holes are no end
        } else {
          street.at(street.depth, i, j) = 8.0F + 0.1F * static_cast<float>(i % 3);
        }
      }
      for (int i = 40; i < 54; ++i) street.at(street.depth, i, j) = 0.0F;  // hidden from the other camera
    }
    Image<float> out = street.kept();
    for (int j = 0; j < 48; ++j) {
      for (int i = 0; i < 120; ++i) {
        const bool spilled = (i >= 54 && i < 60) || (i >= 64 && i < 70);
        CAPTURE(i);
        CHECK(street.at(out, i, j) == (spilled ? 0.0F : street.at(street.depth, i, j)));
      }
    }
  }
}

TEST_CASE("border spill: a clean wall, a wall that runs up to the post, the ground and scenes without labels stay") {
  const Street street;
  CHECK(street.kept() == street.depth);

  Street corner;  // steep enough to reach the post's depth
  for (int j = 0; j < 48; ++j) {
    for (int i = 0; i < 60; ++i) corner.depth(i, j) = 1.0F / (0.02F + 1.75e-3F * static_cast<float>(i));
  }
  CHECK(corner.kept() == corner.depth);

  Street spilled;
  for (int j = 0; j < 48; ++j) {
    for (int i = 54; i < 60; ++i) spilled.depth(i, j) = 8.0F;
  }
  CHECK_FALSE(spilled.kept() == spilled.depth);
  CHECK(spilled.kept({}, false) == spilled.depth);
  BorderSpillParams off;
  off.reach_px = 0;
  CHECK(spilled.kept(off) == spilled.depth);
  for (Label& l : spilled.labels.view().pixels()) l = l == label::building ? label::sidewalk : l;
  CHECK(spilled.kept() == spilled.depth);
}

TEST_CASE("border spill: one pixel, nothing measured, parameters and sizes out of range") {
  const SerialExecutor executor;
  Image<float> one({1, 1}, 3.0F);
  Image<Label> labels({1, 1}, label::building);
  Image<float> out = one;
  const ObjectMap objects{labels.cview(), {}};
  REQUIRE(drop_border_spill({}, one.view(), objects, out.view(), executor).ok());
  CHECK(out(0, 0) == 3.0F);
  Street empty;
  for (float& z : empty.depth.view().pixels()) z = 0.0F;
  CHECK(empty.kept() == empty.depth);
  BorderSpillParams params;
  params.reach_px = 129;
  CHECK(drop_border_spill(params, one.view(), objects, out.view(), executor).code() == StatusCode::invalid_argument);
  params = {};
  params.contrast = 0.9F;
  CHECK(drop_border_spill(params, one.view(), objects, out.view(), executor).code() == StatusCode::invalid_argument);
  CHECK(drop_border_spill({}, empty.depth.view(), objects, out.view(), executor).code() == StatusCode::shape_mismatch);
}
