// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/depth_source.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "fixture.hpp"
#include "npsim/core/random.hpp"
#include "npsim/depth/refine_depth.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

constexpr Shape kShape{320, 180};

[[nodiscard]] float draw(int x, int y, std::uint32_t what) {
  RandomStream random(5, RandomPurpose::test, what, 0, static_cast<std::uint32_t>(y * kShape.width + x), 0);
  return random.uniform();
}

// A road and a wall over it; 1/z of either is linear in the image. noise: of 1/z, 1/m, half its range.
[[nodiscard]] Image<float> street(float noise = 0.0F) {
  Image<float> depth(kShape, 0.0F);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const float w = y < 100 ? 0.05F + 0.0001F * static_cast<float>(x)
                              : 0.05F + 0.0001F * static_cast<float>(x) + 0.004F * static_cast<float>(y - 100);
      depth(x, y) = 1.0F / (w + noise * (2.0F * draw(x, y, 0) - 1.0F));
    }
  }
  return depth;
}

// Keeps a pixel where the predicate holds.
template <class Keep>
void thin_out(Image<float>& depth, const Keep& keep) {
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (!keep(x, y)) depth(x, y) = 0.0F;
    }
  }
}

[[nodiscard]] DepthSource source_of(const Image<float>& depth) { return find_depth_source({}, depth.cview(), {}); }

constexpr Intrinsics kCamera{300, 300, 160, 90};

// By how much the middle of a row's pixels looks down, per metre ahead.
[[nodiscard]] float fall(int y) { return (static_cast<float>(y) + 0.5F - kCamera.cy) / kCamera.fy; }

// The chain on a depth of a known source. labels: empty where the scene has none.
struct Chain {
  Image<Rgb8> image{kShape, Rgb8{90, 100, 110}};  // below `foot`; above it another colour
  npsim_test::Scratch scratch;
  RefinedDepth out;

  Chain(const Image<float>& depth, DepthSource source, ImageView<const Label> labels,
        const RefineDepthParams& params = {}, int foot = 0)
      : scratch(refine_depth_workspace_bytes(params, kShape)) {
    image.fill_rectangle(0, 0, kShape.width, foot, Rgb8{140, 80, 60});
    SceneView scene;
    scene.camera = kCamera;
    scene.image = image.cview();
    scene.depth = depth.cview();
    scene.labels = labels;
    scene.depth_source = source;
    scene.stereo_baseline_m = 0.3F;
    SerialExecutor serial;
    NullObserver observer;
    REQUIRE(refine_depth(params, scene, scratch.workspace(), serial, observer, out).ok());
  }
};

// On a laser's, without labels.
struct Unlabelled : Chain {
  explicit Unlabelled(const Image<float>& depth, const RefineDepthParams& params = {}, int foot = 0)
      : Chain(depth, DepthSource::lidar, {}, params, foot) {}
};

}  // namespace

TEST_CASE("a depth map's source is found from what is measured and how it scatters") {
  CHECK(source_of(street()) == DepthSource::exact);
  CHECK(source_of(street(0.002F)) == DepthSource::network);
  Image<float> holes = street(0.002F);
  thin_out(holes, [](int x, int y) { return x % 40 >= 6 || y % 30 >= 10; });
  CHECK(source_of(holes) == DepthSource::stereo);
  for (const float share : {0.03F, 0.2F, 0.5F}) {
    Image<float> sparse = street();
    thin_out(sparse, [&](int x, int y) { return draw(x, y, 1) < share; });
    CHECK(source_of(sparse) == DepthSource::lidar);
  }
  Image<float> rows = street(0.0001F);  // of a scanner
  thin_out(rows, [](int, int y) { return y > 60 && y % 4 == 0; });
  CHECK(source_of(rows) == DepthSource::lidar);
  CHECK(source_of(Image<float>(kShape, 0.0F)) == DepthSource::network);
}

TEST_CASE(
    "rendered depth is exact in steps of 1/256 m and 1 cm, a network's is not, nor a camera's of a room in "
    "millimetres") {
  const auto stored = [](float noise, float scale, float step_m) {
    Image<float> depth = street(noise);
    for (float& z : depth.view().pixels()) z = std::round(scale * z / step_m) * step_m;
    return depth;
  };
  for (const float step_m : {1.0F / 256.0F, 0.01F}) {
    CHECK(source_of(stored(0.0F, 0.3F, step_m)) == DepthSource::exact);
    CHECK(source_of(stored(0.0005F, 0.3F, step_m)) == DepthSource::network);
  }
  DepthSourceParams asked;
  asked.collinear = 0.37F;  // .34 are where the steps are not looked at
  CHECK(find_depth_source(asked, stored(0.0F, 0.5F, 1.0F / 256.0F).cview(), {}) == DepthSource::exact);
  asked.collinear = 0.06F;  // .08 of a network's are where ten times the steps are tolerated
  CHECK(find_depth_source(asked, stored(0.0005F, 1.0F, 1.0F / 256.0F).cview(), {}) == DepthSource::network);
  CHECK(source_of(stored(0.00015F, 0.1F, 0.001F)) == DepthSource::network);  // .3 to 2 m away
}

TEST_CASE("missing sky is no hole, and a small map enlarged is not exact") {
  Image<float> depth = street(0.002F);
  thin_out(depth, [](int x, int y) { return y > 40 || (x > 90 && x < 150); });
  CHECK(source_of(depth) == DepthSource::network);
  Image<float> enlarged(kShape, 0.0F);  // twice, linearly in 1/z
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const auto at = [](int i, int j) { return 0.1F + 0.02F * draw(i, j, 2); };
      const float u = static_cast<float>(x % 2) / 2.0F;
      const float v = static_cast<float>(y % 2) / 2.0F;
      const int i = x / 2;
      const int j = y / 2;
      const float w =
          (1 - v) * ((1 - u) * at(i, j) + u * at(i + 1, j)) + v * ((1 - u) * at(i, j + 1) + u * at(i + 1, j + 1));
      enlarged(x, y) = 1.0F / w;
    }
  }
  CHECK(source_of(enlarged) == DepthSource::network);
}

TEST_CASE("a laser's noise is measured on houses and cars, of any density, and not on plants, edges or tilted walls") {
  const auto measured = [](float sigma_m, int rows_apart, Label of, float share = 1.0F) {
    Image<float> depth(kShape, 0.0F);
    Image<Label> labels(kShape, of);
    RandomStream random(5, RandomPurpose::test, 0, 0, 0, 0);
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        const float gauss = random.uniform() + random.uniform() + random.uniform() - 1.5F;  // of variance 1/4
        if (y % rows_apart != 0 || random.uniform() >= share) continue;
        // Walls that lean, and turn away as the side of a street does.
        const float w = 0.05F + 3e-4F * static_cast<float>(y) + 2e-4F * static_cast<float>(x % 40);
        const float wall_m = (x / 40 % 2 == 0 ? 1.0F : 2.0F) / w;
        depth(x, y) = wall_m + 2.0F * sigma_m * gauss;
        if (x / 40 % 2 == 1) labels(x, y) = of == label::building ? label::car : of;
      }
    }
    return estimate_laser_noise(depth.cview(), ObjectMap{labels.cview(), {}});
  };
  for (const float sigma_m : {0.03F, 0.06F}) {
    for (const int rows_apart : {1, 3}) {
      CAPTURE(sigma_m);
      CAPTURE(rows_apart);
      CHECK(measured(sigma_m, rows_apart, label::building).amplitude == doctest::Approx(sigma_m).epsilon(0.1));
      CHECK(measured(sigma_m, rows_apart, label::building, 0.3F).amplitude == doctest::Approx(sigma_m).epsilon(0.1));
    }
  }
  CHECK(measured(0.002F, 1, label::building).amplitude == 0.02F);
  CHECK(measured(1.0F, 1, label::building).amplitude == 0.1F);
  CHECK(measured(0.06F, 1, label::vegetation).amplitude == 0.02F);
  CHECK(measured(0.06F, 3, label::building, 0.3F).width_px == doctest::Approx(0.4 * std::sqrt(10.0)).epsilon(0.03));
  Image<float> few(kShape, 0.0F);
  few(5, 5) = 10.0F;
  CHECK(estimate_laser_noise(few.cview(), {}).width_px == 8.0F);
  const DepthNoise none = estimate_laser_noise(Image<float>(kShape, 0.0F).cview(), {});
  CHECK(none.amplitude == 0.02F);
  CHECK(none.width_px == 1.0F);
}

TEST_CASE("what is proposed for a measured depth is held within its source's noise") {
  const DepthSourceParams params;
  const DepthNoise noise{0.001F, 0, 4.0F};  // of 1/z, the same everywhere
  const DepthTrust stereo = depth_trust(params, DepthSource::stereo, noise, 100.0F);
  const float step = 0.003F;
  for (const float z : {2.0F, 20.0F, 200.0F}) {
    CAPTURE(z);
    CHECK(1.0F / stereo.held(z, 0.5F * z, 1.0F) == doctest::Approx(1.0F / z + step));
    CHECK(stereo.held(z, 1.0F / (1.0F / z + 0.5F * step), 1.0F) == doctest::Approx(1.0F / (1.0F / z + 0.5F * step)));
    const DepthTrust lidar = depth_trust(params, DepthSource::lidar, noise, 100.0F);
    CHECK(std::fabs(lidar.held(z, 2 * z, 1.0F) - z) <= 1.01F * std::fmin(params.lidar_noise_m, params.lidar_noise * z));
    CHECK(std::fabs(lidar.held(z, 2 * z, 0.0F) / z - 1) > 0.9F * params.made_up);  // made up: freer
    const DepthTrust exact = depth_trust(params, DepthSource::exact, noise, 100.0F);
    CHECK(exact.held(z, 1.1F * z, 1.0F) == z);
    CHECK(exact.held(z, 1.1F * z, 0.0F) == z);
    CHECK(depth_trust(params, DepthSource::network, noise, 100.0F).held(z, 2 * z, 1.0F) == 2 * z);
  }
  CHECK(stereo.held(0.0F, 3.0F, 1.0F) == 3.0F);
  DepthSourceParams wrong;
  CHECK(validate(wrong).ok());
  wrong.deviations = -1;
  CHECK(!validate(wrong).ok());
}

TEST_CASE(
    "sky between leaves that has no depth is no hole of stereo: the source is found with outlines cut to leaves") {
  constexpr Shape kPark{480, 270};
  constexpr Intrinsics k{450, 450, 240, 120};
  Image<Rgb8> image(kPark, Rgb8{90, 90, 95});
  Image<float> depth(kPark, 0.0F);
  Image<Label> labels(kPark, label::road);
  int gaps = 0;
  for (int y = 0; y < kPark.height; ++y) {
    const float down = (static_cast<float>(y) + 0.5F - k.cy) / k.fy;
    for (int x = 0; x < kPark.width; ++x) {
      depth(x, y) = std::fmin(40.0F, down > 0.0F ? 1.5F / down : 40.0F) * (1.0F + 0.01F * draw(x, y, 6));
      if (y < 60) {
        const bool crown = x >= 100 && x < 380;
        const bool gap = crown && y > 0 && (x / 6) % 2 == 0 && (y / 6) % 2 == 0;
        labels(x, y) = crown ? label::vegetation : label::sky;
        image(x, y) = crown && !gap ? Rgb8{30, 60, 20} : Rgb8{230, 235, 240};
        depth(x, y) = crown && !(gap && gaps++ < 1250) ? 15.0F * (1.0F + 0.01F * draw(x, y, 6)) : 0.0F;
      } else if (down * 40.0F < 1.5F) {
        labels(x, y) = label::building;
        image(x, y) = {150, 120, 100};
      }
    }
  }
  CHECK(find_depth_source({}, depth.cview(), labels.cview()) == DepthSource::stereo);
  SceneView scene;
  scene.camera = k;
  scene.image = image.cview();
  scene.depth = depth.cview();
  scene.labels = labels.cview();
  npsim_test::Scratch scratch(refine_depth_workspace_bytes({}, kPark));
  SerialExecutor serial;
  NullObserver observer;
  RefinedDepth out;
  REQUIRE(refine_depth({}, scene, scratch.workspace(), serial, observer, out).ok());
  CHECK(out.source == DepthSource::network);
}

TEST_CASE("a guess of labels moves nothing that a laser measured, and parts nothing that is filled") {
  Image<float> depth = street(0.0001F);
  thin_out(depth, [](int, int y) { return y > 60 && y % 4 == 0; });
  RefineDepthParams one_class;
  one_class.guess_labels = false;
  one_class.planes.enabled = false;
  RefineDepthParams guessed = one_class;
  guessed.guess_labels = true;
  const Unlabelled a(depth, one_class, 101);
  const Unlabelled b(depth, guessed, 101);
  CHECK(b.out.labels(160, 170) != a.out.labels(160, 170));
  int compared = 0;
  for (int y = 70; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (!is_valid_depth(a.out.depth(x, y)) || !is_valid_depth(b.out.depth(x, y))) continue;
      ++compared;
      REQUIRE(b.out.depth(x, y) == a.out.depth(x, y));
    }
  }
  CHECK(compared > 30000);
}

TEST_CASE("a network's crown is as rough in the mesh as it was given, its wall as smooth as the depth") {
  Image<Label> labels(kShape, label::building);
  Image<float> depth(kShape);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (x >= 200) labels(x, y) = label::vegetation;
      depth(x, y) = (x < 200 ? 20.0F : 12.0F) * (1.0F + 0.01F * (draw(x, y, 5) - 0.5F));
    }
  }
  const auto roughness = [&](ImageView<const float> z, int from, int to) {
    double sum = 0;
    for (int y = 20; y < kShape.height - 20; ++y) {
      for (int x = from; x < to; ++x) sum += std::fabs(static_cast<double>(z(x + 1, y) / z(x, y)) - 1.0);
    }
    return sum / ((to - from) * (kShape.height - 40));
  };
  for (const bool labelled : {true, false}) {
    const Chain chain(depth, DepthSource::network, labelled ? labels.cview() : ImageView<const Label>());
    const RefinedDepth& out = chain.out;
    const double given = roughness(depth.cview(), 220, 300);
    CHECK(roughness(out.depth, 220, 300) < 0.5 * given);
    CHECK(roughness(out.surface_depth(), 20, 180) == roughness(out.depth, 20, 180));
    if (labelled) CHECK(roughness(out.surface_depth(), 220, 300) > 0.9 * given);
  }
}

TEST_CASE(
    "a network's drift over a facade leaves no stairs where no normals are given, a house behind a house its edge") {
  constexpr int kEdge = 240;  // beyond it a house that stands farther off, of the same label
  Image<Label> labels(kShape, label::building);
  Image<float> depth(kShape);
  const auto wall = [](int x) { return 1.0F / (0.05F + 0.0003F * static_cast<float>(x)); };
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      // Two terraces, a tenth apart, with a ramp of ten rows between them; the far house begins within four columns.
      const auto row = static_cast<float>(y);
      const auto column = static_cast<float>(x);
      const float ramp = 1.0F / (1.0F + std::exp(-0.5F * (row - 90.0F)));
      const float beyond = 1.0F / (1.0F + std::exp(-1.5F * (column - kEdge)));
      depth(x, y) = wall(x) * (1.0F + 0.1F * ramp) * (1.0F + 0.6F * beyond);
    }
  }
  const auto largest_riser = [&](ImageView<const float> z) {
    float most = 0;
    for (int y = 20; y < kShape.height - 20; ++y) {
      for (int x = 20; x < kEdge - 30; ++x) most = std::max(most, std::fabs(z(x, y + 1) / z(x, y) - 1.0F));
    }
    return most;
  };
  const Chain chain(depth, DepthSource::network, labels.cview());
  CHECK(largest_riser(chain.out.surface_depth()) < 1.5F * largest_riser(depth.cview()));
  RefineDepthParams saturating;
  saturating.own_normals_loss = saturating.refine.loss;
  const Chain stairs(depth, DepthSource::network, labels.cview(), saturating);
  CHECK(largest_riser(stairs.out.surface_depth()) > 3.0F * largest_riser(depth.cview()));
  for (int y = 20; y < kShape.height - 20; ++y) {
    const ImageView<const float> z = chain.out.surface_depth();
    CHECK(z(kEdge + 8, y) / z(kEdge - 8, y) > 0.9F * depth(kEdge + 8, y) / depth(kEdge - 8, y));
    CHECK(std::fabs(z(kEdge + 30, y) / depth(kEdge + 30, y) - 1.0F) < 0.05F);
    CHECK(std::fabs(z(kEdge - 30, y) / depth(kEdge - 30, y) - 1.0F) < 0.05F);
  }
}

TEST_CASE("the chain leaves good measurements as they are and smooths the surfaces that a mesh is made of") {
  Image<Label> labels(kShape, label::building);
  for (int y = 100; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) labels(x, y) = label::road;
  }
  for (const DepthSource source : {DepthSource::stereo, DepthSource::lidar, DepthSource::exact}) {
    CAPTURE(static_cast<int>(source));
    Image<float> depth = street(source == DepthSource::exact ? 0.0F : 0.0005F);
    thin_out(depth, [&](int x, int y) { return source != DepthSource::lidar || draw(x, y, 1) < 0.3F; });
    const Chain chain(depth, source, labels.cview());
    const RefinedDepth& out = chain.out;
    CHECK(out.source == source);
    REQUIRE_FALSE(out.mesh_depth.empty());
    CHECK(out.filled.empty());
    int smoothed = 0;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        REQUIRE(is_valid_depth(out.depth(x, y)));
        if (!is_valid_depth(depth(x, y))) continue;
        CHECK(out.confidence(x, y) == 1.0F);
        CHECK(std::fabs(1.0F / out.depth(x, y) - 1.0F / depth(x, y)) <= 1e-6F);
        smoothed += std::fabs(1.0F / out.surface_depth()(x, y) - 1.0F / depth(x, y)) > 1e-6F ? 1 : 0;
      }
    }
    CHECK((smoothed > 0) == (source != DepthSource::exact));
  }
}

TEST_CASE("exact depth: a foot just below the road comes up to it in the mesh, a car seen over an edge stays") {
  Image<Label> labels(kShape, label::building);
  Image<float> depth(kShape, 40.0F);
  const auto road_m = [](int y, float under_m) {
    return under_m * kCamera.fy / (static_cast<float>(y) + 0.5F - kCamera.cy);
  };
  for (int y = 105; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const bool island = x >= 200 && y >= 145;  // 12 cm high
      labels(x, y) = label::road;
      depth(x, y) = road_m(y, island ? 1.38F : 1.5F);
    }
  }
  // The pole's label goes down to row 139, where it is 1 cm below the road; the car stands .3 m behind the island.
  for (int y = 60; y <= 139; ++y) {
    for (int x = 100; x < 108; ++x) {
      labels(x, y) = label::pole;
      depth(x, y) = road_m(139, 1.51F);
    }
  }
  const float car_m = road_m(144, 1.38F) + 0.3F;
  for (int y = 100; y < 145; ++y) {
    for (int x = 220; x < 300; ++x) {
      labels(x, y) = label::car;
      depth(x, y) = car_m;
    }
  }
  const Chain chain(depth, DepthSource::exact, labels.cview());
  const RefinedDepth& out = chain.out;
  REQUIRE(out.source == DepthSource::exact);
  CHECK(out.depth(104, 139) == doctest::Approx(static_cast<double>(depth(104, 139))).epsilon(1e-5));
  CHECK(out.mesh_depth(104, 139) < road_m(139, 1.5F));
  CHECK(out.mesh_depth(104, 100) == doctest::Approx(static_cast<double>(depth(104, 100))).epsilon(1e-5));
  for (int x = 225; x < 295; ++x) {
    for (int y = 110; y < 145; ++y) {
      CHECK(out.mesh_depth(x, y) == doctest::Approx(static_cast<double>(car_m)).epsilon(1e-5));
    }
  }
}

TEST_CASE("exact depth without labels: a car's sill low over the road is no kerb, and the road before it stays") {
  constexpr float kCar_m = 6.0F;
  const auto road_m = [](int y) { return fall(y) > 0.0F ? 1.5F / fall(y) : 1e9F; };
  Image<float> depth(kShape, 0.0F);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const bool car = x >= 120 && x < 220 && y >= 100 && 1.5F - kCar_m * fall(y) > 0.08F;
      depth(x, y) = car ? kCar_m : std::fmin(30.0F, road_m(y));
    }
  }
  const Chain chain(depth, DepthSource::exact, {}, {}, 90);
  const RefinedDepth& out = chain.out;
  REQUIRE(out.labels_guessed);
  REQUIRE(out.ground.inlier_share > 0.0F);
  for (int y = 100; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (depth(x, y) < 0.99F * road_m(y)) continue;
      CHECK(out.mesh_depth(x, y) == doctest::Approx(static_cast<double>(depth(x, y))).epsilon(1e-3));
    }
  }
}

TEST_CASE("the bonnet of the own car is no surface: without labels, and where these call it a car, but no road") {
  constexpr float kCamera_m = 1.2F;
  const auto is_bonnet = [](int y) { return 0.2F / fall(y) < 1.5F && fall(y) > 0.0F; };
  Image<float> depth(kShape, 150.0F);
  Image<Label> labels(kShape, label::building);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (fall(y) > 0.01F) depth(x, y) = (is_bonnet(y) ? 0.2F : kCamera_m) / fall(y);
      if (fall(y) > 0.01F) labels(x, y) = is_bonnet(y) ? label::car : label::road;
    }
  }
  REQUIRE(is_bonnet(kShape.height - 1));
  Image<Label> road = labels;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) road(x, y) = is_bonnet(y) ? label::road : labels(x, y);
  }
  for (const DepthSource source : {DepthSource::network, DepthSource::exact}) {
    const Chain guessed(depth, source, {}, {}, 90);
    const Chain given(depth, source, labels.cview(), {}, 90);
    const Chain none(depth, source, road.cview(), {}, 90);
    REQUIRE(guessed.out.ground.inlier_share > 0.0F);
    for (int y = 100; y < kShape.height; ++y) {
      CAPTURE(y);
      CHECK((guessed.out.surface(160, y) == 0) == is_bonnet(y));
      CHECK((given.out.surface(160, y) == 0) == is_bonnet(y));
      CHECK(none.out.surface(160, y) == 1);
    }
  }
}

TEST_CASE("without labels the road goes on as a plane below the lowest row of a laser, a car's side does not") {
  const auto side = [](int x) { return x < 60; };  // of a car, upright from 10 rows above the lowest measured one
  Image<float> depth = street();
  for (int y = 130; y < kShape.height; ++y) {
    for (int x = 0; x < 60; ++x) depth(x, y) = depth(x, 130);
  }
  const Image<float> whole = depth;
  thin_out(depth, [&](int, int y) { return y % 3 == 0 && y <= 141; });
  const Unlabelled scene(depth);
  const RefinedDepth& out = scene.out;
  REQUIRE(out.ground.inlier_share > 0.0F);
  for (int y = 142; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (x > 40 && x < 80) continue;  // where one goes over into the other
      CAPTURE(x);
      CAPTURE(y);
      const float off = out.depth(x, y) / whole(x, y) - 1.0F;
      CHECK(std::fabs(off) < (side(x) ? 0.25F : 0.01F));  // the road there is up to half as far as the car
    }
  }
}

TEST_CASE("without labels a kerb that the rows of a laser cross far apart leaves no steep patches on the ground") {
  constexpr float kHeight_m = 1.5F;
  constexpr float kKerb_m = 0.2F;
  Image<float> depth(kShape, 0.0F);
  for (int y = 0; y < kShape.height; y += 6) {
    for (int x = 0; x < kShape.width; x += 2) {
      const float aside = (static_cast<float>(x) + 0.5F - kCamera.cx) / kCamera.fx;
      // The upright plane of the kerb's face, seen below its upper edge and above its foot.
      const float face_m = 5.0F / (1.0F + 0.5F * aside);
      const float road_m = fall(y) > 0.0F ? kHeight_m / fall(y) : 1e9F;
      const float pavement_m = fall(y) > 0.0F ? (kHeight_m - kKerb_m) / fall(y) : 1e9F;
      depth(x, y) = std::fmin(30.0F, road_m < face_m ? road_m : std::fmax(face_m, pavement_m));
    }
  }
  const Unlabelled scene(depth);
  const RefinedDepth& out = scene.out;
  REQUIRE(out.ground.inlier_share > 0.0F);
  int ground = 0;
  for (int y = 125; y < kShape.height - 8; ++y) {
    for (int x = 8; x < kShape.width - 8; ++x) {
      if (out.labels(x, y) != label::road) continue;
      ++ground;
      CAPTURE(x);
      CAPTURE(y);
      CHECK(dot(out.normals(x, y), out.ground.up) > 0.98F);
    }
  }
  CHECK(ground > 10000);
}

TEST_CASE("without labels the road beyond a laser's answers leads to the foot of the house, and is known as ground") {
  constexpr float kHeight_m = 1.5F;
  constexpr float kWall_m = 40.0F;
  const auto truth = [&](int y) { return fall(y) * kWall_m > kHeight_m ? kHeight_m / fall(y) : kWall_m; };
  Image<float> depth(kShape, 0.0F);
  for (int y = 0; y < kShape.height; ++y) {
    const bool answers = truth(y) < 12.0F || (truth(y) == kWall_m && y < 80);  // the wall from 1.3 m up
    for (int x = 0; x < kShape.width; ++x) depth(x, y) = answers && y % 4 == 0 ? truth(y) : 0.0F;
  }
  const int foot = 101;  // 1.5 m below the camera, 40 m away
  const Unlabelled scene(depth, {}, foot);
  const RefinedDepth& out = scene.out;
  REQUIRE(out.ground.inlier_share > 0.0F);
  for (int y = 60; y < kShape.height; ++y) {
    for (int x = 8; x < kShape.width - 8; x += 7) {
      CAPTURE(y);
      CHECK(out.depth(x, y) == doctest::Approx(truth(y)).epsilon(0.04));
      CHECK(out.labels(x, y) == (y < foot ? label::building : label::road));
    }
  }
  RefineDepthParams one_class;
  one_class.guess_labels = false;
  CHECK(Unlabelled(depth, one_class).out.labels(160, 150) == label::unlabeled);
}

TEST_CASE(
    "without labels a hedge between the lines of a laser, whose points lie apart, stands: no ground shows in it") {
  constexpr float kHeight_m = 1.5F;
  constexpr float kHedge_m = 8.0F;
  constexpr float kWall_m = 40.0F;
  const auto hedge = [&](int x, int y) {
    return x >= 160 && fall(y) * kHedge_m < kHeight_m && fall(y) * kHedge_m > -0.5F;  // 2 m high
  };
  const auto truth = [&](int x, int y) {
    if (hedge(x, y)) return kHedge_m;
    return fall(y) * kWall_m > kHeight_m ? kHeight_m / fall(y) : kWall_m;
  };
  Image<float> depth(kShape, 0.0F);
  for (int y = 0; y < kShape.height; y += 10) {
    for (int x = 0; x < kShape.width; ++x) {
      if (!hedge(x, y) || x % 5 == 0) depth(x, y) = truth(x, y);
    }
  }
  const Unlabelled scene(depth);
  const RefinedDepth& out = scene.out;
  REQUIRE(out.ground.inlier_share > 0.0F);
  int seen = 0;
  for (int y = 10; y < kShape.height - 10; ++y) {
    for (int x = 175; x < kShape.width - 10; ++x) {
      if (!hedge(x, y - 10) || !hedge(x, y + 10)) continue;  // its edges lie somewhere between two lines
      ++seen;
      CAPTURE(x);
      CAPTURE(y);
      CHECK(out.depth(x, y) == doctest::Approx(kHedge_m).epsilon(0.03));
    }
  }
  CHECK(seen > 1000);
}

TEST_CASE("depth source: names and sources belong together, other names are none") {
  for (std::size_t i = 0; i < kDepthSourceNames.size(); ++i) {
    CHECK(depth_source_named(kDepthSourceNames[i]) == static_cast<DepthSource>(i));
  }
  static_assert(depth_source_named("stereo") == DepthSource::stereo);
  for (const char* name : {"", "Stereo", "stereo ", "lida", "radar"}) {
    CHECK(depth_source_named(name) == DepthSource::unknown);
  }
}
