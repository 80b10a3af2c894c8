// SPDX-License-Identifier: Apache-2.0
// Albedo and roughness from the photograph: priors met, casts removed, shadows softened, bounds kept, bits repeated.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/material/albedo.hpp"
#include "npsim/material/roughness.hpp"

namespace {

using namespace npsim;

std::uint8_t encode(float linear) {
  const float v = std::min(1.0F, std::max(0.0F, linear));
  const double s = static_cast<double>(v);
  const double e = s <= 0.0031308 ? 12.92 * s : 1.055 * std::pow(s, 1 / 2.4) - 0.055;
  return static_cast<std::uint8_t>(std::lround(255 * e));
}

struct Picture {
  Shape shape;
  std::vector<Rgb8> day;
  std::vector<Label> labels;
  std::vector<Vec3f> albedo;
  explicit Picture(int w, int h) : shape{w, h}, day(shape.pixels()), labels(shape.pixels()), albedo(shape.pixels()) {}
  std::size_t i(int x, int y) const { return static_cast<std::size_t>(y * shape.width + x); }

  template <class Executor = SerialExecutor>
  Status run(const AlbedoParams& p = {}, bool with_labels = true, Executor executor = {}) {
    npsim_test::Scratch scratch(estimate_albedo_workspace_bytes(p, shape));
    return estimate_albedo(p, ImageView<const Rgb8>(day.data(), shape),
                           with_labels ? ImageView<const Label>(labels.data(), shape) : ImageView<const Label>(),
                           scratch.workspace(), ImageView<Vec3f>(albedo.data(), shape), executor);
  }
  double median(Label l) const {
    std::vector<float> v;
    for (std::size_t k = 0; k < labels.size(); ++k) {
      if (labels[k] == l) v.push_back(luminance(albedo[k]));
    }
    REQUIRE(!v.empty());
    std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
    return static_cast<double>(v[v.size() / 2]);
  }
};

// Road below, building above left, sky above right; a car on the road. `cast` multiplies the light.
Picture street(Vec3f cast, bool shadow) {
  Picture p(192, 128);
  for (int y = 0; y < 128; ++y) {
    for (int x = 0; x < 192; ++x) {
      RandomStream r(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * 192 + x), 0);
      Label l = y >= 64 ? label::road : (x < 120 ? label::building : label::sky);
      if (y > 70 && y < 90 && x > 150 && x < 180) l = label::car;
      float value = l == label::road ? 0.12F : l == label::building ? 0.3F : l == label::car ? 0.05F : 0.8F;
      value *= 0.85F + 0.3F * r.uniform();
      if (shadow && y >= 64 && x < 70) value *= 0.2F;
      p.labels[p.i(x, y)] = l;
      p.day[p.i(x, y)] = {encode(value * cast.x), encode(value * cast.y), encode(value * cast.z)};
    }
  }
  return p;
}

}  // namespace

TEST_CASE("the median of every class meets its prior to 1 %, and texture stays") {
  for (const bool soften : {true, false}) {
    Picture p = street({1, 1, 1}, false);
    AlbedoParams params;
    params.soften_shading = soften;
    REQUIRE(p.run(params).ok());
    for (const Label l : {label::road, label::building, label::car}) {
      INFO("label " << static_cast<int>(l));
      CHECK(p.median(l) == doctest::Approx(static_cast<double>(surface_prior(l).albedo)).epsilon(0.01));
    }
    // Grain of the road: the ratio of two neighbours is that of the photograph.
    const auto linear = [](std::uint8_t v) { return std::pow((v / 255.0 + 0.055) / 1.055, 2.4); };
    const double day = linear(p.day[p.i(100, 100)].g) / linear(p.day[p.i(101, 100)].g);
    const double out = static_cast<double>(luminance(p.albedo[p.i(100, 100)]) / luminance(p.albedo[p.i(101, 100)]));
    CHECK(out == doctest::Approx(day).epsilon(0.01));
    CHECK(p.albedo[p.i(150, 10)] == Vec3f{0.2F, 0.2F, 0.2F});  // sky: the neutral prior
  }
}

TEST_CASE("a colour cast of the light is removed by the stated share") {
  for (const float share : {0.0F, 0.7F, 1.0F}) {
    Picture p = street({1.2F, 1.0F, 0.6F}, false);
    AlbedoParams params;
    params.cast_removal = share;
    REQUIRE(p.run(params).ok());
    Vec3d mean;
    for (int y = 92; y < 128; ++y) {
      for (int x = 0; x < 192; ++x) mean += vec_cast<double>(p.albedo[p.i(x, y)]);
    }
    const double blue_over_red = mean.z / mean.x;
    if (share == 0.0F) CHECK(blue_over_red == doctest::Approx(0.5).epsilon(0.03));
    if (share == 1.0F) CHECK(blue_over_red == doctest::Approx(1.0).epsilon(0.03));
    if (share == 0.7F) CHECK(blue_over_red > 0.75);
  }
}

TEST_CASE("the contrast of a large cast shadow is about halved in log terms; without labels nothing is softened") {
  const auto contrast = [](const Picture& p) {
    double dark = 0;
    double light = 0;
    for (int y = 90; y < 126; ++y) {
      for (int x = 0; x < 30; ++x) {
        dark += static_cast<double>(luminance(p.albedo[p.i(x, y)]));
        light += static_cast<double>(luminance(p.albedo[p.i(x + 110, y)]));
      }
    }
    return light / dark;
  };
  Picture p = street({1, 1, 1}, true);
  AlbedoParams params;
  params.min_albedo = 0.0F;
  REQUIRE(p.run(params).ok());
  CHECK(contrast(p) < 3.0);
  CHECK(contrast(p) > 1.5);
  params.soften_shading = false;
  REQUIRE(p.run(params).ok());
  CHECK(contrast(p) == doctest::Approx(5.0).epsilon(0.05));
  REQUIRE(p.run({}, false).ok());
  CHECK(p.albedo[p.i(100, 100)].x > 0.0F);
}

TEST_CASE("saturated pixels become grey and bounded; black and white pictures stay within bounds") {
  Picture p = street({1, 1, 1}, false);
  for (int y = 100; y < 104; ++y) {
    for (int x = 20; x < 24; ++x) p.day[p.i(x, y)] = {255, 30, 30};
  }
  REQUIRE(p.run().ok());
  const Vec3f a = p.albedo[p.i(21, 101)];
  CHECK(a.x == a.y);
  CHECK(a.y == a.z);
  CHECK(a.x <= 4 * 0.11F + 1e-6F);
  for (const int v : {0, 255}) {
    const auto b = static_cast<std::uint8_t>(v);
    for (Rgb8& c : p.day) c = {b, b, b};
    REQUIRE(p.run().ok());
    for (const Vec3f& out : p.albedo) {
      CHECK_UNARY(is_finite(out) && out.x >= 0.02F && out.x <= 0.9F && out.y >= 0.02F && out.z <= 0.9F);
    }
  }
}

TEST_CASE("the order of chunks never changes a bit; one row and one column work; unknown labels are one class") {
  Picture a = street({1.1F, 1, 0.9F}, true);
  Picture b = a;
  REQUIRE(a.run().ok());
  REQUIRE(b.run({}, true, npsim_test::BackwardExecutor{}).ok());
  CHECK(std::memcmp(a.albedo.data(), b.albedo.data(), a.albedo.size() * sizeof(Vec3f)) == 0);
  for (const Shape s : {Shape{1, 37}, Shape{53, 1}, Shape{1, 1}}) {
    Picture p(s.width, s.height);
    for (std::size_t i = 0; i < p.day.size(); ++i) {
      p.day[i] = {static_cast<std::uint8_t>(i), 100, 90};
      p.labels[i] = static_cast<Label>(i % 2 == 0 ? 200 : 255);
    }
    REQUIRE(p.run().ok());
    for (const Vec3f& out : p.albedo) CHECK_UNARY(is_finite(out) && out.x >= 0.02F);
  }
}

TEST_CASE("albedo: strided views, and refusals") {
  Picture p = street({1, 1, 1}, false);
  REQUIRE(p.run().ok());
  npsim_test::Scratch scratch(estimate_albedo_workspace_bytes({}, p.shape));
  const Shape part{100, 60};
  std::vector<Vec3f> wide(200 * 60, Vec3f{-1, -1, -1});
  std::vector<Vec3f> dense(part.pixels());
  std::vector<Rgb8> day_copy(part.pixels());
  std::vector<Label> label_copy(part.pixels());
  const ImageView<const Rgb8> day = ImageView<const Rgb8>(p.day.data(), p.shape).sub(30, 40, part);
  const ImageView<const Label> labels = ImageView<const Label>(p.labels.data(), p.shape).sub(30, 40, part);
  for (int y = 0; y < part.height; ++y) {
    for (int x = 0; x < part.width; ++x) {
      day_copy[static_cast<std::size_t>(y * 100 + x)] = day(x, y);
      label_copy[static_cast<std::size_t>(y * 100 + x)] = labels(x, y);
    }
  }
  SerialExecutor serial;
  REQUIRE(estimate_albedo({}, day, labels, scratch.workspace(), ImageView<Vec3f>(wide.data(), part, 200), serial).ok());
  REQUIRE(estimate_albedo({}, ImageView<const Rgb8>(day_copy.data(), part),
                          ImageView<const Label>(label_copy.data(), part), scratch.workspace(),
                          ImageView<Vec3f>(dense.data(), part), serial)
              .ok());
  for (int y = 0; y < part.height; ++y) {
    for (int x = 0; x < part.width; ++x) {
      CHECK_UNARY(wide[static_cast<std::size_t>(y * 200 + x)] == dense[static_cast<std::size_t>(y * 100 + x)]);
    }
    CHECK_UNARY(wide[static_cast<std::size_t>(y * 200 + 100)].x == -1.0F);
  }
  AlbedoParams bad;
  bad.tile_px = 0;
  CHECK(estimate_albedo(bad, day, labels, scratch.workspace(), ImageView<Vec3f>(dense.data(), part), serial).code() ==
        StatusCode::invalid_argument);
  CHECK(
      estimate_albedo({}, day, labels, scratch.workspace(), ImageView<Vec3f>(dense.data(), {50, 60}), serial).code() ==
      StatusCode::shape_mismatch);
  npsim_test::Scratch tiny(1000);
  CHECK(estimate_albedo({}, day, labels, tiny.workspace(), ImageView<Vec3f>(dense.data(), part), serial).code() ==
        StatusCode::workspace_exhausted);
}

TEST_CASE("roughness follows the label and the weather; the priors are usable") {
  std::vector<Label> labels = {label::road, label::building, label::car, 99};
  std::vector<float> alpha(4);
  SerialExecutor serial;
  const Shape shape{2, 2};
  REQUIRE(estimate_roughness({}, ImageView<const Label>(labels.data(), shape), ImageView<float>(alpha.data(), shape),
                             serial)
              .ok());
  CHECK(alpha[0] == surface_prior(label::road).alpha);
  CHECK(alpha[2] < alpha[1]);
  CHECK(alpha[3] == surface_prior(label::unlabeled).alpha);
  RoughnessParams wet;
  wet.wetness = 1;
  REQUIRE(estimate_roughness(wet, ImageView<const Label>(labels.data(), shape), ImageView<float>(alpha.data(), shape),
                             serial)
              .ok());
  CHECK(alpha[0] == doctest::Approx(0.12));
  CHECK(alpha[1] == surface_prior(label::building).alpha);
  wet.wetness = 2;
  CHECK(estimate_roughness(wet, {}, ImageView<float>(alpha.data(), shape), serial).code() ==
        StatusCode::invalid_argument);
  for (const SurfacePrior& s : kSurfacePriors) {
    CHECK_UNARY(s.albedo > 0.02F && s.albedo < 0.9F && s.alpha > 0.0F && s.alpha <= 1.0F);
  }
}
