// SPDX-License-Identifier: Apache-2.0
// The generated street: its estimates err as asked, and awkward sizes and parameters are taken or refused.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>

#include "street/degrade.hpp"
#include "street/street.hpp"
#include "npsim/core/executor.hpp"

namespace {

using npsim::Vec3f;
namespace street = npsim::street;
namespace label = npsim::label;

street::StreetParams small_params(int width, int height) {
  street::StreetParams p;
  p.seed = 3;
  p.shape = {width, height};
  p.samples = 1;
  p.sky_rays = 0;
  return p;
}

std::unique_ptr<street::Street> made(const street::StreetParams& p) {
  auto s = std::make_unique<street::Street>();
  npsim::SerialExecutor executor;
  const npsim::Status status = street::make_street(p, executor, *s);
  REQUIRE_MESSAGE(status.ok(), status.message());
  return s;
}

street::Degradation none() {
  street::Degradation g;
  g.edge_smear = g.scale_error = g.field_error = g.noise = g.sky_error = 0;
  g.normal_blur = g.normal_noise = g.normal_road = g.normal_sky = 0;
  return g;
}

// The planes of `s` degraded anew.
void degrade(street::Street& s, const street::Degradation& g) {
  npsim::SerialExecutor executor;
  s.params.degradation = g;
  street::degrade_depth(s, executor);
  street::degrade_normals(s, executor);
}

double mean_relative_error(const street::Street& s) {
  double sum = 0;
  int count = 0;
  for (std::size_t i = 0; i < s.params.shape.pixels(); ++i) {
    const double z = static_cast<double>(s.depth.data()[i]);
    if (!(z > 0)) continue;
    sum += std::fabs(static_cast<double>(s.est_depth.data()[i]) / z - 1);
    ++count;
  }
  return sum / count;
}

}  // namespace

TEST_CASE("street: strength 0 gives the truth bit by bit, strength 1 a plausible error") {
  const auto s = made(small_params(320, 180));
  const std::size_t n = s->params.shape.pixels();
  const double full = mean_relative_error(*s);
  CHECK(full > 0.02);
  CHECK(full < 0.25);
  degrade(*s, none());
  CHECK(std::memcmp(s->est_depth.data(), s->depth.data(), n * sizeof(float)) == 0);
  CHECK(std::memcmp(s->est_normals.data(), s->normals.data(), n * sizeof(Vec3f)) == 0);
}

TEST_CASE("street: each strength does what it names") {
  const auto s = made(small_params(320, 180));
  street::Degradation g = none();

  SUBCASE("the sky gets a finite depth, nothing else changes") {
    g.sky_error = 1;
    degrade(*s, g);
    int wrong = 0;
    for (std::size_t i = 0; i < s->params.shape.pixels(); ++i) {
      const float z = s->est_depth.data()[i];
      if (s->labels.data()[i] == label::sky) {
        if (!(z >= 60 && z <= 90)) ++wrong;
      } else if (z != s->depth.data()[i]) {
        ++wrong;
      }
    }
    CHECK(wrong == 0);
  }
  SUBCASE("smear mixes across edges and leaves the near road") {
    g.edge_smear = 1;
    degrade(*s, g);
    int mixed = 0, road = 0, road_off = 0;
    for (std::size_t i = 0; i < s->params.shape.pixels(); ++i) {
      const float z = s->depth.data()[i];
      if (!(z > 0)) continue;
      const float e = std::fabs(s->est_depth.data()[i] / z - 1);
      if (e > 0.2F) ++mixed;
      if (s->labels.data()[i] == label::road && z < 8) {
        ++road;
        if (e > 0.02F) ++road_off;
      }
    }
    CHECK(mixed > 200);
    REQUIRE(road > 1000);
    CHECK(road_off < road / 6);
  }
  SUBCASE("scale is one factor for the whole image") {
    g.scale_error = 1;
    degrade(*s, g);
    float first = 0;
    float spread = 0;
    for (std::size_t i = 0; i < s->params.shape.pixels(); ++i) {
      if (!(s->depth.data()[i] > 0)) continue;
      const float f = s->est_depth.data()[i] / s->depth.data()[i];
      if (first == 0) first = f;
      spread = std::fmax(spread, std::fabs(f / first - 1));
    }
    CHECK(first != 1.0F);
    CHECK(std::fabs(first - 1) < 0.065F);
    CHECK(spread < 1e-6F);
  }
  SUBCASE("the tilted road stays within the road") {
    g.normal_road = 1;
    degrade(*s, g);
    int tilted = 0, elsewhere = 0;
    for (std::size_t i = 0; i < s->params.shape.pixels(); ++i) {
      if (s->est_normals.data()[i] == s->normals.data()[i]) continue;
      (s->labels.data()[i] == label::road ? tilted : elsewhere)++;
    }
    CHECK(tilted > 50);
    CHECK(elsewhere == 0);
  }
}

TEST_CASE("street: tiny, narrow and flat images do not crash") {
  for (const npsim::Shape shape : {npsim::Shape{16, 9}, npsim::Shape{1, 1}, npsim::Shape{1, 40}, npsim::Shape{40, 1}}) {
    CAPTURE(shape.width);
    CAPTURE(shape.height);
    const auto s = made(small_params(shape.width, shape.height));
    CHECK(s->image.shape() == shape);
    for (std::size_t i = 0; i < shape.pixels(); ++i) CHECK(std::isfinite(s->est_depth.data()[i]));
  }
}

TEST_CASE("street: parameters out of range are refused") {
  const auto refused = [](const auto& change) {
    street::StreetParams p = small_params(16, 9);
    change(p);
    street::Street s;
    npsim::SerialExecutor executor;
    return street::make_street(p, executor, s).code() == npsim::StatusCode::invalid_argument;
  };
  CHECK(refused([](street::StreetParams& p) { p.shape = {0, 9}; }));
  CHECK(refused([](street::StreetParams& p) { p.shape = {16, 20000}; }));
  CHECK(refused([](street::StreetParams& p) { p.samples = 0; }));
  CHECK(refused([](street::StreetParams& p) { p.sky_rays = -1; }));
  CHECK(refused([](street::StreetParams& p) { p.horizontal_fov_rad = 3.2F; }));
  CHECK(refused([](street::StreetParams& p) { p.degradation.noise = std::numeric_limits<float>::quiet_NaN(); }));
  CHECK(refused([](street::StreetParams& p) { p.degradation.edge_smear = -1; }));
}
