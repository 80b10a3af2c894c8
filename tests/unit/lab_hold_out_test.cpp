// SPDX-License-Identifier: Apache-2.0
// Depth judged by measured pixels that were left out: `npsim evaluate --hold-out`.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "fixture.hpp"
#include "lab/hold_out.hpp"
#include "lab/simple_fill.hpp"
#include "npsim/core/random.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

// Samples of inverse depth a + b x + c y, a share of the pixels.
struct Samples {
  Samples(Shape shape, float share, std::uint64_t seed) : depth(shape, 0.0F), truth(shape, 0.0F) {
    RandomStream random(seed, RandomPurpose::test, 0, 0, 0, 0);
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        truth(x, y) = static_cast<float>(1.0 / (0.02 + 0.0003 * x + 0.001 * y));
        if ((y * shape.width + x) % 512 == 0) {
          random = RandomStream(seed, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * shape.width + x), 0);
        }
        if (random.uniform() < share) depth(x, y) = truth(x, y);
      }
    }
  }
  Image<float> depth, truth;
};

}  // namespace

TEST_CASE("hold-out: nearest is the nearest of all samples, linear in 1/z is exact on planes within the samples") {
  for (const float share : {0.003F, 0.05F, 0.6F}) {
    CAPTURE(share);
    const Shape shape{90, 60};
    const Samples s(shape, share, 7);
    const io::Image<float> nearest = tool::filled_by_nearest(s.depth.cview());
    const io::Image<float> linear = tool::filled_linearly(s.depth.cview());
    int within = 0;
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        int best = std::numeric_limits<int>::max();
        bool found = false;
        bool quadrant[4] = {};  // samples on all sides: surely within their hull
        for (int j = 0; j < shape.height; ++j) {
          for (int i = 0; i < shape.width; ++i) {
            if (!(s.depth(i, j) > 0)) continue;
            const int d = (i - x) * (i - x) + (j - y) * (j - y);
            if (d < best) found = false;
            if (d <= best && nearest(x, y) == s.depth(i, j)) found = true;
            best = d < best ? d : best;
            if (i != x && j != y) quadrant[(i > x ? 1 : 0) + (j > y ? 2 : 0)] = true;
          }
        }
        CHECK(found);
        if (s.depth(x, y) > 0) CHECK(linear(x, y) == s.depth(x, y));
        if (!(quadrant[0] && quadrant[1] && quadrant[2] && quadrant[3])) continue;
        // Where a corner of the picture takes part the triangle reaches beyond the samples.
        if (x < 30 || x > 60 || y < 20 || y > 40 || share < 0.01F) continue;
        ++within;
        CHECK(std::fabs(linear(x, y) / s.truth(x, y) - 1) < 1e-5F);
      }
    }
    if (share > 0.01F) CHECK(within > 500);
  }
  const Image<float> none({5, 4}, 0.0F);
  CHECK(tool::filled_by_nearest(none.cview())(2, 2) == 0.0F);
  CHECK(tool::filled_linearly(none.cview())(2, 2) == 0.0F);
}

TEST_CASE("hold-out: leaves out the share asked for, at random or whole squares, and sees what the steps do") {
  const Shape shape{320, 160};
  Samples s(shape, 1.0F, 3);
  Image<Rgb8> image(shape, Rgb8{90, 90, 90});
  Image<Label> labels(shape, label::wall);
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 320; ++x) labels(x, y) = label::sky;
  }
  SceneView scene;
  scene.camera = {300, 300, 160, 80};
  scene.image = image.cview();
  scene.depth = s.depth.cview();
  scene.labels = labels.cview();
  ThreadPool pool(2);
  tool::Console console(true);
  for (const bool blocks : {false, true}) {
    CAPTURE(blocks);
    tool::HoldOut params;
    params.blocks = blocks;
    tool::HoldOutResult result;
    REQUIRE(tool::hold_out(params, scene, RefineDepthParams{}, pool, console, result).ok());
    CHECK(result.measured == 320U * 128U);  // the sky is not asked
    CHECK(std::fabs(static_cast<double>(result.left_out) / (320 * 128) - 0.2) <
          (blocks ? 0.1 : 0.01));  // of 160 squares
    if (blocks) CHECK(result.left_out % 256 == 0);
    REQUIRE(result.rows.size() >= 4);
    CHECK(result.rows.back().key == "normal_guided_refinement");
    for (const tool::HoldOutRow& row : result.rows) CHECK(row.errors[0].pixels + row.errors[0].lost == result.left_out);
    CHECK(result.rows[1].kept.most == 0.0);
    CHECK(result.rows[1].errors[0].mean < result.rows[0].errors[0].mean);
    CHECK(result.rows[2].key == "depth_fill");
    CHECK(result.rows[2].errors[0].median < 1e-4);  // a plane goes on in the holes
  }
}

TEST_CASE("hold-out: its option") {
  REQUIRE(tool::parse_hold_out("0.2"));
  CHECK(tool::parse_hold_out("0.2").value().share == 0.2);
  CHECK(!tool::parse_hold_out("0.2").value().blocks);
  CHECK(tool::parse_hold_out("0.15,blocks").value().blocks);
  for (const char* wrong : {"", "0", "1", "-0.2", "0.2,", "0.2,block", "0.2,blocks,", "a", "0.2x"}) {
    CHECK_MESSAGE(!tool::parse_hold_out(wrong), wrong);
  }
}
