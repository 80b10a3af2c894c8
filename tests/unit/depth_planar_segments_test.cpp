// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/planes/planar_segments.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

constexpr Shape kShape{480, 240};
constexpr float kDegree = 0.017453293F;

// Walls that stand on level ground, seen by a stereo pair 22 cm apart.
struct Street {
  Intrinsics k{530, 530, 240, 120};
  Image<float> truth{kShape};
  Image<float> measured{kShape};
  Image<float> depth{kShape};
  Image<Label> labels{kShape, label::building};
  Image<std::uint16_t> of{kShape};
  PlanarMap map;
  DepthNoise noise{0.17F * 480 / 2048 / (530 * 0.22F), 0, 1.0F};

  [[nodiscard]] Vec3f ray(int x, int y) const {
    return {(static_cast<float>(x) + 0.5F - k.cx) / k.fx, (static_cast<float>(y) + 0.5F - k.cy) / k.fy, 1.0F};
  }
  // The wall n . p = -h on columns [from, to).
  void wall(const Vec3f& n, float h, int from, int to) {
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = from; x < to; ++x) truth(x, y) = -h / dot(n, ray(x, y));
    }
  }
  // Noise of the deviation that is assumed.
  void measure(float times = 1.0F) {
    for (int y = 0; y < kShape.height; ++y) {
      RandomStream random(5, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y), 0);
      for (int x = 0; x < kShape.width; ++x) {
        if (x % 240 == 0)
          random =
              RandomStream(5, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y), static_cast<std::uint32_t>(x));
        const float sum = random.uniform() + random.uniform() + random.uniform() + random.uniform() - 2.0F;
        const float w = 1.0F / truth(x, y);
        measured(x, y) = truth(x, y) > 0.0F ? 1.0F / (w + times * 1.732F * sum * noise.deviation(w)) : 0.0F;
      }
    }
    depth = measured;
  }
  template <class Executor>
  Status run(Executor& executor, const PlanarSegmentsParams& params = {}) {
    npsim_test::Scratch kept(planar_map_bytes(params, kShape) + kWorkspaceAlignment);
    npsim_test::Scratch scratch(planar_segments_workspace_bytes(params, kShape));
    PlanarMap found;
    REQUIRE(allocate_planar_map(params, kShape, kept.workspace(), found).ok());
    const Status status = planar_segments(params, measured.cview(), ObjectMap{labels.cview(), {}}, noise,
                                          Vec3f{0, -1, 0}, k, depth.view(), found, scratch.workspace(), executor);
    if (!status.ok()) return status;
    copy_pixels(ImageView<const std::uint16_t>(found.of), of.view());
    segments.assign(found.segments.begin(), found.segments.end());
    return status;
  }
  Status run() {
    SerialExecutor serial;
    return run(serial);
  }
  [[nodiscard]] const PlanarSegment* at(int x, int y) const {
    return of(x, y) == 0 ? nullptr : &segments[of(x, y) - std::size_t{1}];
  }
  // Of pixels of a label the share whose plane's normal is within `degrees` of n.
  [[nodiscard]] double share_facing(const Vec3f& n, int from, int to, float degrees) const {
    std::size_t all = 0;
    std::size_t good = 0;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = from; x < to; ++x) {
        if (labels(x, y) != label::building) continue;
        ++all;
        const PlanarSegment* s = at(x, y);
        good += s != nullptr && dot(s->normal, n) > std::cos(degrees * kDegree) ? 1U : 0U;
      }
    }
    return static_cast<double>(good) / static_cast<double>(all);
  }
  std::vector<PlanarSegment> segments;
};

const Vec3f kFront{0, 0, -1};
const Vec3f kSide = normalized(Vec3f{-0.9F, 0, -0.436F});

// A front at 14 m and, right of the middle, a wall that recedes from it.
[[nodiscard]] Street corner() {
  Street s;
  s.wall(kFront, 14.0F, 0, 240);
  s.wall(kSide, 14.0F * 0.436F, 240, 480);
  return s;
}

// Leaves out all chunks but the first `left`.
struct Stopping {
  int left;
  template <class F>
  void for_chunks(std::size_t count, std::size_t chunk, F&& f) {
    for (std::size_t i = 0; i < count; i += chunk) {
      if (left-- > 0) f(i, std::min(count, i + chunk));
    }
  }
};

}  // namespace

TEST_CASE("planar segments: two noisy walls at a corner, parted by a pole, become two planes") {
  Street s = corner();
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 100; x < 112; ++x) {
      s.truth(x, y) = 8.0F;
      s.labels(x, y) = label::pole;
    }
  }
  s.measure();
  REQUIRE(s.run().ok());
  CHECK(s.share_facing(kFront, 0, 240, 1.5F) > 0.97);
  CHECK(s.share_facing(kSide, 240, 480, 1.5F) > 0.97);
  CHECK(s.at(105, 100) == nullptr);
  CHECK(s.of(50, 100) == s.of(200, 100));  // across the pole
  CHECK(s.depth == s.measured);            // planes give normals; measured depth stays
  REQUIRE(s.at(50, 100) != nullptr);
  CHECK(s.at(50, 100)->upright);
  CHECK(s.at(50, 100)->support_px > 0.9F * 228 * 240);
  CHECK(s.at(50, 100)->residual < 1.2F);
}

TEST_CASE(
    "planar segments: where noise is as large as the step between two walls they meet in one line, not in a mosaic") {
  Street s;
  s.wall(kFront, 14.0F, 0, 240);
  s.wall(kFront, 14.4F, 240, 480);  // 6 deviations
  s.measure(2.5F);
  REQUIRE(s.run().ok());
  REQUIRE(s.at(60, 120) != nullptr);
  REQUIRE(s.at(420, 120) != nullptr);
  REQUIRE(s.of(60, 120) != s.of(420, 120));
  int changes = 0;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 1; x < kShape.width; ++x) changes += s.of(x, y) != s.of(x - 1, y) ? 1 : 0;
  }
  CHECK(changes >= kShape.height);
  CHECK(changes < 300);
}

TEST_CASE("planar segments: noisy walls that meet, at a corner that stands out or recedes, part in a straight line") {
  for (const float outward : {1.0F, -1.0F}) {
    CAPTURE(outward);
    const Vec3f side = normalized(Vec3f{outward * 0.6F, 0, -0.8F});
    Street s;
    s.wall(kFront, 14.0F, 0, 240);
    s.wall(side, 14.0F * 0.8F, 240, 480);
    s.measure(1.5F);
    REQUIRE(s.run().ok());
    int first = kShape.width;
    int last = 0;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 1; x < kShape.width; ++x) {
        const PlanarSegment* plane = s.at(x, y);
        const PlanarSegment* before = s.at(x - 1, y);
        if (plane == nullptr || before == nullptr || plane == before) continue;
        first = std::min(first, x);
        last = std::max(last, x);
      }
    }
    CHECK(first > 230);
    CHECK(last < 250);
    CHECK(last - first <= 2);
    CHECK(s.share_facing(side, 250, 480, 3.0F) > 0.97);
  }
}

TEST_CASE("planar segments: a wall before or behind another ends where it ends, not where their planes meet") {
  struct Case {
    float degrees;  // that the second wall is turned by
    float behind_m;
  };
  for (const Case& c : {Case{60, 0.3F}, Case{60, 0.45F}, Case{45, 0.2F}, Case{-37, -0.2F}, Case{37, 0.4F}}) {
    CAPTURE(c.degrees);
    CAPTURE(c.behind_m);
    const Vec3f side{std::sin(c.degrees * kDegree), 0, -std::cos(c.degrees * kDegree)};
    Street s;
    s.wall(kFront, 14.0F, 0, 240);
    s.wall(side, -(14.0F + c.behind_m) * side.z, 240, 480);
    s.measure();
    REQUIRE(s.run().ok());
    CHECK(s.share_facing(kFront, 0, 239, 5.0F) > 0.99);
    CHECK(s.share_facing(side, 241, 480, 5.0F) > 0.99);
  }
}

TEST_CASE("planar segments: an executor that leaves work out, as when a run is cancelled, harms nothing") {
  for (int chunks = 0; chunks < 200; chunks += 19) {
    CAPTURE(chunks);
    Street s = corner();
    s.measure();
    Stopping executor{chunks};
    CHECK(s.run(executor).ok());
  }
}

TEST_CASE("planar segments: relief stays, and what is curved is not drawn to planes") {
  Street s = corner();
  for (int y = 60; y < 140; ++y) {
    for (int x = 60; x < 120; ++x) s.truth(x, y) = 12.8F;  // a bay
  }
  s.measure();
  REQUIRE(s.run().ok());
  for (int y = 64; y < 136; y += 6) {
    for (int x = 64; x < 116; x += 6) CHECK(s.depth(x, y) == doctest::Approx(12.8F).epsilon(0.03));
  }
  Street tower;  // of 4 m radius, its axis 14 m away
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const Vec3f r = tower.ray(x, y);
      const float a = r.x * r.x + 1.0F;
      const float root = 14.0F * 14.0F - a * (14.0F * 14.0F - 16.0F);
      if (root > 0.0F) tower.truth(x, y) = (14.0F - std::sqrt(root)) / a;
      if (!(root > 0.0F)) tower.labels(x, y) = label::sky;
    }
  }
  tower.measure(0.2F);
  REQUIRE(tower.run().ok());
  CHECK(tower.depth == tower.measured);
  // No single plane takes it: the segments turn with the surface.
  REQUIRE(tower.at(150, 120) != nullptr);
  REQUIRE(tower.at(330, 120) != nullptr);
  CHECK(dot(tower.at(150, 120)->normal, tower.at(330, 120)->normal) < 0.8F);
}

TEST_CASE("planar segments: what matching draws forward beside a sign is the wall, flat or as a ramp") {
  for (const bool ramp : {false, true}) {
    CAPTURE(ramp);
    Street s;
    s.wall(kFront, 60.0F, 0, 480);
    for (int y = 96; y < 120; ++y) {
      for (int x = 204; x < 216; ++x) {  // the sign
        s.truth(x, y) = 30.0F;
        s.labels(x, y) = label::pole;
      }
      for (int x = 216; x < 222; ++x) {
        const float forward = ramp ? 5.5F - 0.7F * static_cast<float>(x - 216) : 3.2F;  // deviations; .54 px
        s.truth(x, y) = 1.0F / (1.0F / 60.0F + forward * s.noise.amplitude);
      }
    }
    s.measure(0.3F);
    REQUIRE(s.run().ok());
    const PlanarSegment* const wall = s.at(300, 109);
    REQUIRE(wall != nullptr);
    for (int y = 96; y < 120; ++y) {
      for (int x = 216; x < 222; ++x) CHECK(s.at(x, y) == wall);
    }
  }
}

TEST_CASE(
    "planar segments: a plain wall in waves of a part of a pixel, as matching leaves them, is one and not a mosaic") {
  Street s;
  const Vec3f oblique = normalized(Vec3f{0.62F, 0, -0.78F});
  const Vec3f along{1, 0, 0};
  s.wall(oblique, -dot(oblique, s.ray(199, 100)) * 38.0F, 0, 200);
  s.wall(along, -dot(along, s.ray(200, 100)) * 38.0F, 200, 236);
  s.wall(kFront, 60.0F, 236, 480);
  s.measure();
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < 200; ++x) {
      const float wave = std::sin(0.13F * float(x) + 0.02F * float(y)) * std::sin(0.04F * float(y));
      s.measured(x, y) = 1.0F / (1.0F / s.measured(x, y) + 3.0F * wave * s.noise.deviation(0.03F));
    }
  }
  s.depth = s.measured;
  REQUIRE(s.run().ok());
  CHECK(s.share_facing(oblique, 0, 200, 12.0F) > 0.9);
  CHECK(s.share_facing(along, 200, 236, 5.0F) > 0.9);
}

TEST_CASE(
    "planar segments: a wall turned by 35 degrees, 1.4 deviations out of its neighbour's plane, is no wave of it") {
  struct Case {
    float z, degrees, nearer;
    int width;
    float noise;
  };
  for (const Case c : {Case{60, 35, 2.7F, 72, 1}, Case{40, 35, 2.7F, 48, 1}, Case{30, -35, 1.0F, 24, 2}}) {
    CAPTURE(c.z);
    Street s;
    s.wall(kFront, c.z, 0, 480);
    const Vec3f n{std::sin(c.degrees * kDegree), 0, -std::cos(c.degrees * kDegree)};
    const float at = c.z - c.nearer * c.z * c.z * s.noise.deviation(1 / c.z);
    s.wall(n, -dot(n, s.ray(200, 120)) * at, 200, 200 + c.width);
    s.measure(c.noise);
    REQUIRE(s.run().ok());
    CHECK(s.share_facing(n, 200, 200 + c.width, 12.0F) > 0.8);
  }
}

TEST_CASE("planar segments: a house as large as its neighbour, or farther from its plane, keeps its own plane") {
  Street s;
  s.wall(kFront, 60.0F, 0, 240);
  s.wall(kFront, 55.0F, 240, 480);  // 4.4 deviations
  for (int y = 100; y < 118; ++y) {
    for (int x = 100; x < 114; ++x) s.truth(x, y) = 1.0F / (1.0F / 60.0F + 12.0F * s.noise.amplitude);
  }
  s.measure(0.3F);
  REQUIRE(s.run().ok());
  REQUIRE(s.at(60, 60) != nullptr);
  REQUIRE(s.at(400, 60) != nullptr);
  const auto depth_at = [&](int x) { return 1.0F / dot(s.at(x, 60)->q, s.ray(x, 60)); };
  CHECK(depth_at(60) == doctest::Approx(60.0F).epsilon(0.01));
  CHECK(depth_at(400) == doctest::Approx(55.0F).epsilon(0.01));
  for (int y = 103; y < 115; ++y) CHECK(s.at(107, y) != s.at(60, 60));
}

TEST_CASE("planar segments: a dent of 5 m that a wall surrounds is closed, of a laser too deep a point is its own") {
  Street s = corner();
  s.measure();
  for (int y = 90; y < 120; ++y) {
    for (int x = 55; x < 75; ++x) {
      const float off = std::hypot(static_cast<float>(x - 65) / 10.0F, static_cast<float>(y - 105) / 15.0F);
      if (off < 1.0F) s.measured(x, y) = s.depth(x, y) = 14.0F + 5.0F * (1.0F - off * off);
    }
  }
  Street laser = s;
  REQUIRE(s.run().ok());
  CHECK(s.depth(65, 105) == doctest::Approx(14.0F).epsilon(0.01));
  CHECK(s.of(65, 105) == s.of(30, 105));
  laser.noise = {0.02F, 2, 1.0F};
  REQUIRE(laser.run().ok());
  CHECK(laser.depth(65, 105) == 19.0F);
}

TEST_CASE(
    "planar segments: beside a pole, what matching left 4 m before the wall is on its plane, not a bay of 2 m; both "
    "keep their depth") {
  Street s = corner();
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 100; x < 104; ++x) {
      s.truth(x, y) = 8.0F;
      s.labels(x, y) = label::pole;
    }
  }
  s.measure();
  for (int y = 90; y < 110; ++y) {
    const float bent = 10.0F - 3.0F * std::sin(0.31F * static_cast<float>(y - 90));
    for (int x = 104; x < 110; ++x) s.measured(x, y) = s.depth(x, y) = bent - 0.1F * static_cast<float>((x * x) % 7);
    for (int x = 40; x < 46; ++x) s.measured(x, y) = s.depth(x, y) = 12.0F;
  }
  REQUIRE(s.run().ok());
  CHECK(s.of(106, 100) == s.of(20, 100));
  CHECK(s.of(43, 100) != s.of(20, 100));
  CHECK(s.depth(106, 100) == s.measured(106, 100));
  CHECK(s.depth(102, 100) == s.measured(102, 100));
  CHECK(s.depth(43, 100) == 12.0F);
}

TEST_CASE(
    "planar segments: facades that a network bends by 3 % in waves of a storey are planes, not islands of planes") {
  Street s = corner();
  s.noise = depth_noise(DepthSource::network, 0.0F, s.truth.cview(), ObjectMap{s.labels.cview(), {}}, s.k);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const float wave = std::sin(static_cast<float>(x) / 12.0F) * std::cos(static_cast<float>(y) / 11.0F);
      s.measured(x, y) = s.truth(x, y) * std::exp(0.03F * wave);
    }
  }
  s.depth = s.measured;
  REQUIRE(s.run().ok());
  CHECK(s.share_facing(kFront, 0, 240, 3.0F) > 0.95);
  CHECK(s.share_facing(kSide, 240, 480, 3.0F) > 0.95);
}

TEST_CASE("planar segments: of a network two fronts 12 % apart and a corner of 25 degrees stay two planes") {
  for (const bool corner : {false, true}) {
    CAPTURE(corner);
    Street s;
    const Vec3f turned = normalized(Vec3f{-0.423F, 0, -0.906F});
    s.wall(kFront, 14.0F, 0, 240);
    s.wall(corner ? turned : kFront, 14.0F * (corner ? 0.906F : 1.12F), 240, 480);
    s.noise = depth_noise(DepthSource::network, 0.0F, s.truth.cview(), ObjectMap{s.labels.cview(), {}}, s.k);
    s.measured = s.truth;
    s.depth = s.truth;
    REQUIRE(s.run().ok());
    CHECK(s.share_facing(kFront, 0, 240, 2.0F) > 0.95);
    CHECK(s.share_facing(corner ? turned : kFront, 240, 480, 2.0F) > 0.95);
    CHECK(s.of(60, 120) != s.of(420, 120));
  }
}

TEST_CASE(
    "planar segments: a front that leans by 30 degrees stands upright where a network drew it, above the eye, not "
    "where stereo measured it or a fence leans") {
  const Vec3f leaning{0, -0.5F, -0.866F};
  struct Case {
    DepthNoise noise;
    Label label;
    bool upright;
  };
  const Street seen;
  const DepthNoise network = depth_noise(DepthSource::network, 0.0F, seen.truth.cview(), ObjectMap{}, seen.k);
  for (const Case& c : {Case{network, label::building, true}, Case{network, label::fence, false},
                        Case{seen.noise, label::building, false}}) {
    Street s;
    s.wall(leaning, 12.0F, 0, kShape.width);
    s.noise = c.noise;
    s.measure(0.1F);
    for (Label& l : s.labels.view().pixels()) l = c.label;
    REQUIRE(s.run().ok());
    for (int y = 10; y < kShape.height; y += 20) {
      if (std::abs(y - 120) < 30) continue;  // squares that the horizon crosses are of either kind
      for (int x = 10; x < kShape.width; x += 20) {
        CAPTURE(x);
        CAPTURE(y);
        const PlanarSegment* plane = s.at(x, y);
        REQUIRE(plane != nullptr);
        const bool upright = c.upright && y < 120;
        CHECK(std::fabs(plane->normal.y - (upright ? 0.0F : leaning.y)) < 0.06F);
      }
    }
  }
}

TEST_CASE("planar segments: above the topmost line of a laser a wall goes on as it was measured") {
  Street s = corner();
  s.noise = {0.02F, 2, 1.0F};
  s.measure();
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (y >= 110 && (y % 4 == 0) && x % 2 == 0) continue;
      s.measured(x, y) = 0.0F;
      if (y < 110) s.depth(x, y) = x < 60 ? 8.0F : 30.0F;  // as a fill may guess
    }
  }
  REQUIRE(s.run().ok());
  CHECK(s.share_facing(kFront, 0, 230, 1.5F) > 0.97);
  CHECK(s.share_facing(kSide, 260, 480, 1.5F) > 0.97);
  CHECK(s.depth(30, 60) == doctest::Approx(14.0F).epsilon(0.01));
  CHECK(s.depth(100, 10) == doctest::Approx(14.0F).epsilon(0.01));
  CHECK(s.depth(400, 10) == doctest::Approx(s.truth(400, 10)).epsilon(0.02));
}

TEST_CASE("planar segments: where labels are guessed, what a laser has no rows on does not come to the car below it") {
  // One label: the rear of a car 7 m away below, a house 30 m away beside it, and above the laser's rows what was made
  // up 45 m away over the car, 33 m over the house.
  for (const bool guessed : {true, false}) {
    Street s;
    s.wall(kFront, 30.0F, 0, kShape.width);
    s.noise = {0.02F, 2, 1.0F};
    s.measure();
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        const bool car = x < 240;
        if (y >= 110 && car) s.measured(x, y) = s.depth(x, y) = 7.0F;
        if (y >= 110 && y % 4 == 0 && x % 2 == 0) continue;
        s.measured(x, y) = 0.0F;
        if (y < 110) s.depth(x, y) = car ? 45.0F : 33.0F;
      }
    }
    PlanarSegmentsParams params;
    params.guessed = guessed;
    SerialExecutor serial;
    REQUIRE(s.run(serial, params).ok());
    CHECK(s.depth(100, 20) == doctest::Approx(guessed ? 45.0F : 7.0F).epsilon(0.01));
    CHECK(s.depth(400, 20) == doctest::Approx(30.0F).epsilon(0.01));
  }
}

TEST_CASE("planar segments: a gap in a small oriel keeps its fill, not the far wall that the rows above it show") {
  Street s;
  s.wall(kFront, 80.0F, 0, 480);
  for (int y = 90; y < 150; ++y) {
    for (int x = 100; x < 140; ++x) s.truth(x, y) = 34.0F;
  }
  s.measure();
  for (int y = 96; y < 144; ++y) {
    for (int x = 102; x < 138; ++x) {
      s.measured(x, y) = 0.0F;
      s.depth(x, y) = 34.0F;
    }
  }
  REQUIRE(s.run().ok());
  CHECK(s.depth(120, 100) == doctest::Approx(34.0F).epsilon(0.02));
  CHECK(s.depth(120, 120) == doctest::Approx(34.0F).epsilon(0.02));
  CHECK(s.of(120, 100) != s.of(120, 60));
}

TEST_CASE(
    "planar segments: above what was measured a wall goes on, but not where the fill knows something much nearer") {
  Street s;
  s.wall(kFront, 25.0F, 0, 480);
  s.measure();
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      s.measured(x, y) = 0.0F;
      s.depth(x, y) = x >= 210 && x < 222 ? 8.0F : (x < 100 ? 17.5F : 33.0F);
    }
  }
  REQUIRE(s.run().ok());
  for (int x = 210; x < 222; ++x) {
    CHECK(s.depth(x, 30) == 8.0F);
    CHECK(s.at(x, 30) == nullptr);
  }
  CHECK(s.depth(50, 30) == doctest::Approx(25.0F).epsilon(0.01));
  CHECK(s.depth(300, 30) == doctest::Approx(25.0F).epsilon(0.01));
}

TEST_CASE("planar segments: the same bits in any order of work, and twice") {
  Street a = corner();
  a.measure();
  Street b = a;
  npsim_test::BackwardExecutor backward;
  REQUIRE(a.run().ok());
  REQUIRE(b.run(backward).ok());
  CHECK(a.depth == b.depth);
  CHECK(a.of == b.of);
}

TEST_CASE("planar segments: nothing to fit, depth that is not finite, parameters out of range") {
  Street none;
  REQUIRE(none.run().ok());
  CHECK(none.segments.empty());
  Street odd = corner();
  odd.measure();
  odd.depth(3, 3) = odd.measured(3, 3) = std::numeric_limits<float>::quiet_NaN();
  odd.depth(4, 3) = odd.measured(4, 3) = std::numeric_limits<float>::infinity();
  odd.depth(5, 3) = odd.measured(5, 3) = 1e-42F;  // its inverse is infinite
  REQUIRE(odd.run().ok());
  CHECK(odd.share_facing(kFront, 0, 240, 1.5F) > 0.95);
  PlanarSegmentsParams params;
  params.cell_px = 0.0F;
  SerialExecutor serial;
  CHECK(validate(params).code() == StatusCode::invalid_argument);
  CHECK(odd.run(serial, params).code() == StatusCode::invalid_argument);
}

TEST_CASE("depth noise: of a pair in disparity, of a laser in metres, of anything else as measured") {
  Street s = corner();
  s.measure();
  const ObjectMap objects{s.labels.cview(), {}};
  const DepthNoise pair = depth_noise(DepthSource::stereo, 0.22F, s.depth.cview(), objects, s.k);
  CHECK(pair.deviation(0.1F) == pair.deviation(0.02F));
  CHECK(pair.deviation(0.1F) == doctest::Approx(s.noise.amplitude).epsilon(1e-4));
  const DepthNoise laser = depth_noise(DepthSource::lidar, 0.0F, s.depth.cview(), {}, s.k);
  CHECK(laser.deviation(0.1F) / (0.1F * 0.1F) == doctest::Approx(0.02F));
  const DepthNoise rough = depth_noise(DepthSource::lidar, 0.0F, s.depth.cview(), objects, s.k);  // on its walls
  CHECK(rough.deviation(0.1F) / (0.1F * 0.1F) == doctest::Approx(rough.deviation(0.02F) / (0.02F * 0.02F)));
  CHECK(rough.deviation(0.1F) > 1.5F * laser.deviation(0.1F));
  const DepthNoise found = depth_noise(DepthSource::unknown, 0.0F, s.depth.cview(), objects, s.k);
  CHECK(found.deviation(1.0F / 14.0F) == doctest::Approx(s.noise.amplitude).epsilon(0.4));
}
