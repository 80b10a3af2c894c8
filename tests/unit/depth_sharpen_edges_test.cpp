// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/depth/detail/estimated/sharpen_edges.hpp"
#include "npsim/depth/detail/estimated/surface_jumps.hpp"
#include "npsim/depth/detail/extend_field.hpp"
#include "npsim/depth/detail/object_borders.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/image.hpp"

using namespace npsim;

namespace {

constexpr Shape kShape{96, 64};

// A house whose wall runs away from the camera, behind a pole and a car.
struct Scene {
  io::Image<float> truth{kShape};
  io::Image<float> depth{kShape};
  io::Image<Label> labels{kShape, label::building};
  io::Image<std::uint16_t> instances{kShape};

  Scene() {
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        truth(x, y) = 1.0F / (0.02F + 0.0002F * static_cast<float>(x));
        if (x >= 30 && x < 33) put(x, y, label::pole, 8.0F);
        if (x >= 60 && y >= 40) put(x, y, label::car, 12.0F);
      }
    }
    depth = truth;
  }
  void put(int x, int y, Label l, float z) {
    labels(x, y) = l;
    truth(x, y) = z;
  }
  // A Gaussian in the logarithm, as estimators mix.
  void smear(float sigma) {
    const int reach = static_cast<int>(3 * sigma);
    for (int axis = 0; axis < 2; ++axis) {
      const io::Image<float> source = depth;
      for (int y = 0; y < kShape.height; ++y) {
        for (int x = 0; x < kShape.width; ++x) {
          double sum = 0;
          double weights = 0;
          for (int d = -reach; d <= reach; ++d) {
            const int u = axis == 0 ? x + d : x;
            const int v = axis == 0 ? y : y + d;
            if (!source.view().contains(u, v)) continue;
            const double w = std::exp(-0.5 * d * d / static_cast<double>(sigma * sigma));
            sum += w * std::log(static_cast<double>(source(u, v)));
            weights += w;
          }
          depth(x, y) = static_cast<float>(std::exp(sum / weights));
        }
      }
    }
  }
  [[nodiscard]] ObjectMap objects() const { return {labels.view(), instances.view()}; }
  template <class Executor>
  Status run(const SharpenEdgesParams& params, io::Image<float>& out, Executor& executor) {
    out = io::Image<float>(kShape);
    npsim_test::Scratch scratch(sharpen_edges_workspace_bytes(params, kShape));
    Workspace& workspace = scratch.workspace();
    const io::Image<float>& in = depth;
    return sharpen_edges(params, in.view(), objects(), out.view(), workspace, executor);
  }
  [[nodiscard]] double error(const io::Image<float>& z, Label l) const {
    double sum = 0;
    for (std::size_t i = 0; i < kShape.pixels(); ++i) {
      if (labels.data()[i] != l) continue;
      sum += std::fabs(static_cast<double>(z.data()[i]) / static_cast<double>(truth.data()[i]) - 1.0);
    }
    return sum;
  }
};

}  // namespace

TEST_CASE("sharpening takes back most of what was mixed across borders, on slanted walls and thin poles") {
  Scene s;
  s.smear(2.0F);
  SerialExecutor serial;
  io::Image<float> out;
  REQUIRE(s.run({}, out, serial).ok());
  CHECK(s.error(out, label::building) < 0.2 * s.error(s.depth, label::building));
  CHECK(s.error(out, label::car) < 0.2 * s.error(s.depth, label::car));
  CHECK(s.error(out, label::pole) < s.error(s.depth, label::pole));  // narrower than the mixing: only mixtures are left
  CHECK(std::fabs(out(31, 20) - 8.0F) <
        std::fabs(s.depth(30, 20) - 8.0F));  // the middle of the pole speaks for its rim
  CHECK(out(29, 20) == doctest::Approx(static_cast<double>(s.truth(29, 20))).epsilon(0.03));
}

TEST_CASE("sharpening: a roof that was mixed with the sky and a road that was with the bonnet, which have no depth") {
  Scene s;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (y < 20) s.put(x, y, label::sky, 150.0F);
      if (y >= 30) s.put(x, y, label::road, 9.0F);
      if (y >= 50) s.put(x, y, label::ego_vehicle, 2.0F);
    }
  }
  s.depth = s.truth;
  s.smear(2.0F);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (y < 20 || y >= 50) s.depth(x, y) = 0.0F;
    }
  }
  SerialExecutor serial;
  io::Image<float> out;
  REQUIRE(s.run({}, out, serial).ok());
  const auto off = [&](const io::Image<float>& depth, int x, int y) { return depth(x, y) / s.truth(x, y) - 1.0F; };
  CHECK(off(s.depth, 80, 20) > 0.3F);
  CHECK(std::fabs(off(out, 80, 20)) < 0.1F);
  CHECK(off(s.depth, 80, 49) < -0.3F);
  CHECK(std::fabs(off(out, 80, 49)) < 0.05F);
}

TEST_CASE(
    "sharpening: a twig before the sky stays before a far hedge, a road above a high bonnet and a far gable too") {
  Scene s;
  const float vanishing = -20.0F;  // of the facade, px left of its end
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      s.put(x, y, label::sky, 0.0F);
      if (x < 40 && y >= 30) s.put(x, y, label::vegetation, 60.0F);
      if (x >= 20 && x < 22) s.put(x, y, label::vegetation, 6.0F);
      if (x >= 60) s.put(x, y, label::building, 1.0F / (0.0002F * (static_cast<float>(x - 60) - vanishing)));
      if (x >= 44 && x < 56 && y < 50) s.put(x, y, label::road, 150.0F / static_cast<float>(y + 1));
      if (x >= 44 && x < 56 && y >= 50) s.put(x, y, label::ego_vehicle, 0.0F);
    }
  }
  s.depth = s.truth;
  SerialExecutor serial;
  io::Image<float> out;
  REQUIRE(s.run({}, out, serial).ok());
  for (int y = 0; y < kShape.height; ++y) {
    CAPTURE(y);
    if (y < 24) CHECK(out(20, y) == 6.0F);
    for (int x = 60; x < 96; ++x) CHECK(out(x, y) == doctest::Approx(s.truth(x, y)).epsilon(0.15));
    for (int x = 46; y > 40 && y < 50 && x < 54; ++x) CHECK(out(x, y) == s.truth(x, y));
  }
}

TEST_CASE("sharpening: far twigs before the sky above a near hedge of the same label stay far") {
  Scene s;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      s.put(x, y, label::sky, 0.0F);
      if (y >= 36) s.put(x, y, label::vegetation, 6.0F);
      if (y < 36 && x % 12 < 2) s.put(x, y, label::vegetation, 40.0F);
    }
  }
  s.depth = s.truth;
  SerialExecutor serial;
  io::Image<float> out;
  REQUIRE(s.run({}, out, serial).ok());
  CHECK(std::equal(out.data(), out.data() + kShape.pixels(), s.depth.data()));
}

TEST_CASE("sharpening leaves sharp depth, deep inside and holes as they are") {
  Scene s;
  s.depth(50, 20) = 0.0F;
  s.depth(29, 30) = NAN;
  SerialExecutor serial;
  io::Image<float> out;
  REQUIRE(s.run({}, out, serial).ok());
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      if (std::isnan(s.depth(x, y))) {
        CHECK(std::isnan(out(x, y)));
      } else {
        CHECK(out(x, y) == s.depth(x, y));
      }
    }
  }
}

TEST_CASE("sharpening: without labels, with radius 0 and at borders without contrast nothing changes") {
  Scene s;
  s.smear(2.0F);
  SerialExecutor serial;
  io::Image<float> out;
  SharpenEdgesParams off;
  off.radius_px = 0;
  REQUIRE(s.run(off, out, serial).ok());
  CHECK(std::equal(out.data(), out.data() + kShape.pixels(), s.depth.data()));
  SharpenEdgesParams blind;
  blind.min_contrast = 1e6F;
  REQUIRE(s.run(blind, out, serial).ok());
  CHECK(std::equal(out.data(), out.data() + kShape.pixels(), s.depth.data()));
  s.labels = io::Image<Label>();
  s.instances = io::Image<std::uint16_t>();
  REQUIRE(s.run({}, out, serial).ok());
  CHECK(std::equal(out.data(), out.data() + kShape.pixels(), s.depth.data()));
}

TEST_CASE("sharpening: two cars of one label are told apart by their instances") {
  Scene s;
  for (int y = 40; y < kShape.height; ++y) {
    for (int x = 60; x < kShape.width; ++x) {
      s.instances(x, y) = x < 78 ? 1 : 2;
      if (x >= 78) s.put(x, y, label::car, 24.0F);
    }
  }
  s.depth = s.truth;
  s.smear(2.0F);
  SerialExecutor serial;
  io::Image<float> with;
  io::Image<float> without;
  REQUIRE(s.run({}, with, serial).ok());
  s.instances = io::Image<std::uint16_t>();
  REQUIRE(s.run({}, without, serial).ok());
  CHECK(std::fabs(with(77, 55) - 12.0F) < 1.0F);
  CHECK(std::fabs(with(78, 55) - 24.0F) < 2.0F);
  CHECK(std::fabs(without(77, 55) - 12.0F) > 2.0F);
}

TEST_CASE("sharpening gives the same bits on any number of threads, and refuses bad arguments") {
  Scene s;
  s.smear(2.0F);
  SerialExecutor serial;
  ThreadPool pool(3);
  io::Image<float> one;
  io::Image<float> three;
  REQUIRE(s.run({}, one, serial).ok());
  REQUIRE(s.run({}, three, pool).ok());
  CHECK(std::equal(one.data(), one.data() + kShape.pixels(), three.data()));
  for (const float bad : {-1.0F, 65.0F, NAN}) {
    SharpenEdgesParams params;
    params.radius_px = bad;
    CHECK(s.run(params, one, serial).code() == StatusCode::invalid_argument);
  }
  Workspace none;
  io::Image<float> out(kShape);
  const io::Image<float>& in = s.depth;
  CHECK(sharpen_edges({}, in.view(), s.objects(), out.view(), none, serial).code() == StatusCode::workspace_exhausted);
  CHECK(sharpen_edges({}, in.view(), s.objects(), out.view().sub(0, 0, {3, 3}), none, serial).code() ==
        StatusCode::shape_mismatch);
}

TEST_CASE("border distance is half a pixel at borders and within 8 % of Euclid elsewhere") {
  io::Image<Label> labels({61, 41}, label::road);
  labels(30, 20) = label::car;
  io::Image<float> distance(labels.shape());
  border_distance({static_cast<const io::Image<Label>&>(labels).view(), {}}, 99.0F, distance.view());
  for (int y = 0; y < 41; ++y) {
    for (int x = 0; x < 61; ++x) {
      if (x == 30 && y == 20) continue;
      const double euclid = std::hypot(x - 30, y - 20);
      CHECK(static_cast<double>(distance(x, y)) >= euclid - 1.0);
      CHECK(static_cast<double>(distance(x, y)) <= 1.083 * euclid);
    }
  }
  CHECK(distance(30, 20) == 0.5F);
  CHECK(distance(31, 20) == 0.5F);
}

TEST_CASE("depth borders are where another object is nearer or farther, not where a label meets another on a plane") {
  io::Image<float> depth({4, 2}, 10.0F);
  io::Image<Label> labels({4, 2}, label::road);
  labels(1, 0) = label::sidewalk;  // at the same depth
  labels(3, 0) = label::car;
  depth(3, 0) = 8.0F;
  depth(0, 1) = 0.0F;
  io::Image<std::uint8_t> mask({4, 2}, 7);
  SerialExecutor serial;
  const ObjectMap objects{static_cast<const io::Image<Label>&>(labels).view(), {}};
  const ImageView<const float> z = static_cast<const io::Image<float>&>(depth).view();
  REQUIRE(mark_depth_borders(0.02F, z, objects, mask.view(), serial).ok());
  const std::vector<int> expected = {0, 0, 1, 1, 0, 0, 0, 0};  // (3, 0) has another object below it
  for (std::size_t i = 0; i < 8; ++i) CHECK(mask.data()[i] == expected[i]);
  CHECK(mark_depth_borders(NAN, z, objects, mask.view(), serial).code() == StatusCode::invalid_argument);
}

TEST_CASE("surface jumps are where depth leaves its normal's plane within an object, not where another begins") {
  const Intrinsics camera{100, 100, 4, 1};
  io::Image<float> depth({8, 1}, 0.0F);
  io::Image<Label> labels({8, 1}, label::building);
  io::Image<Vec3f> normals({8, 1}, normalized(Vec3f{0.8F, 0.0F, -0.6F}));
  const ImageView<const float> z = static_cast<const io::Image<float>&>(depth).view();
  for (int x = 0; x < 8; ++x) {
    const Vec3f n = normals(x, 0);
    depth(x, 0) = -10.0F / dot(n, unproject_pixel(camera, x, 0, 1.0F)) * (x > 1 ? 1.02F : 1.0F);  // a step after 1
  }
  labels(4, 0) = label::wall;
  depth(4, 0) *= 0.5F;      // another object
  normals(6, 0) = Vec3f{};  // unknown, and the step that follows with it
  depth(7, 0) *= 1.02F;
  io::Image<std::uint8_t> mask({8, 1}, 0);
  mask(0, 0) = 1;  // stays
  SerialExecutor serial;
  const ObjectMap objects{static_cast<const io::Image<Label>&>(labels).view(), {}};
  const ImageView<const Vec3f> n = static_cast<const io::Image<Vec3f>&>(normals).view();
  REQUIRE(mark_surface_jumps(0.01F, z, n, objects, camera, mask.view(), serial).ok());
  const std::vector<int> expected = {1, 1, 0, 0, 0, 0, 0, 0};
  for (std::size_t i = 0; i < 8; ++i) CHECK(mask.data()[i] == expected[i]);
  CHECK(mark_surface_jumps(NAN, z, n, objects, camera, mask.view(), serial).code() == StatusCode::invalid_argument);
}

TEST_CASE("an extended field keeps what is known, stays within its range and is smooth beyond") {
  RandomStream random(3, RandomPurpose::generic, 0, 0, 0, 0);
  for (const Shape shape : {Shape{1, 1}, Shape{1, 7}, Shape{37, 23}, Shape{64, 64}}) {
    io::Image<float> field(shape);
    io::Image<std::uint8_t> known(shape);
    float low = 1e9F;
    float high = -1e9F;
    for (std::size_t i = 0; i < shape.pixels(); ++i) {
      known.data()[i] = i == 0 || random.next_u32() % 16 == 0 ? 1 : 0;
      field.data()[i] = known.data()[i] != 0 ? static_cast<float>(random.next_u32() % 1000) : 1e30F;
      if (known.data()[i] == 0) continue;
      low = std::fmin(low, field.data()[i]);
      high = std::fmax(high, field.data()[i]);
    }
    const io::Image<float> before = field;
    SerialExecutor serial;
    npsim_test::Scratch scratch(extend_field_workspace_bytes(shape));
    Workspace& workspace = scratch.workspace();
    REQUIRE(
        extend_field(static_cast<const io::Image<std::uint8_t>&>(known).view(), field.view(), workspace, serial).ok());
    for (std::size_t i = 0; i < shape.pixels(); ++i) {
      if (known.data()[i] != 0) CHECK(field.data()[i] == before.data()[i]);
      CHECK(field.data()[i] >= low - 0.01F);
      CHECK(field.data()[i] <= high + 0.01F);
    }
  }
  // One half known: the other half continues it without a step.
  io::Image<float> half({64, 32}, 0.0F);
  io::Image<std::uint8_t> known({64, 32}, 0);
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 32; ++x) {
      half(x, y) = 5.0F;
      known(x, y) = 1;
    }
  }
  SerialExecutor serial;
  npsim_test::Scratch scratch(extend_field_workspace_bytes({64, 32}));
  Workspace& workspace = scratch.workspace();
  REQUIRE(extend_field(static_cast<const io::Image<std::uint8_t>&>(known).view(), half.view(), workspace, serial).ok());
  CHECK(half(40, 10) == doctest::Approx(5.0));
  CHECK(half(63, 31) == doctest::Approx(5.0));
}
