// SPDX-License-Identifier: Apache-2.0
// The generated street as sensors measure it: what they get right, what they miss, and where they are wrong.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <vector>

#include "npsim/core/executor.hpp"
#include "street/sensors.hpp"
#include "street/street.hpp"

namespace {

using namespace npsim;

std::unique_ptr<street::Street> measured(DepthSource source) {
  street::StreetParams p;
  p.seed = 3;
  p.shape = {480, 270};
  p.samples = 1;
  p.sky_rays = 0;
  p.depth = source;
  auto s = std::make_unique<street::Street>();
  SerialExecutor executor;
  const Status status = street::make_street(p, executor, *s);
  REQUIRE_MESSAGE(status.ok(), status.message());
  return s;
}

// |f(estimate, truth)| at all measured pixels of the surface that `wanted` takes.
template <class Wanted, class Error>
std::vector<float> errors(const street::Street& s, Wanted&& wanted, Error&& error) {
  std::vector<float> out;
  for (int y = 0; y < s.depth.height(); ++y) {
    for (int x = 0; x < s.depth.width(); ++x) {
      if (!(s.depth(x, y) > 0) || !(s.est_depth(x, y) > 0) || !wanted(x, y)) continue;
      out.push_back(std::fabs(error(s.est_depth(x, y), s.depth(x, y))));
    }
  }
  std::sort(out.begin(), out.end());
  return out;
}

double missing_share(const street::Street& s, int x0, int x1) {
  std::size_t missing = 0;
  std::size_t all = 0;
  for (int y = 0; y < s.depth.height(); ++y) {
    for (int x = x0; x < x1; ++x) {
      if (!(s.depth(x, y) > 0)) continue;
      ++all;
      missing += s.est_depth(x, y) > 0 ? 0U : 1U;
    }
  }
  return static_cast<double>(missing) / static_cast<double>(all);
}

}  // namespace

TEST_CASE("street sensors: stereo errs by tenths of a pixel of disparity, and is lost beyond the right picture") {
  const auto s = measured(DepthSource::stereo);
  const float bf = street::kStereoBaseline_m * s->intrinsics.fx * 2048.0F / 480.0F;  // at the pair's own size
  const auto off = errors(
      *s, [&](int x, int y) { return x > 100 && s->labels(x, y) == label::building; },
      [&](float z, float truth) { return bf / z - bf / truth; });
  REQUIRE(off.size() > 5000);
  CHECK(off[off.size() / 2] > 0.05F);
  CHECK(off[off.size() / 2] < 0.25F);
  CHECK(off[off.size() * 9 / 10] > 0.2F);
  // On the left the right camera sees nothing: a tenth and more missing, and what is there is mostly wrong.
  CHECK(missing_share(*s, 0, 8) > 0.1);
  CHECK(missing_share(*s, 200, 400) < 0.12);
  const auto strip = errors(
      *s, [&](int x, int) { return x < 4; }, [&](float z, float truth) { return bf / z - bf / truth; });
  REQUIRE(!strip.empty());
  CHECK(strip[strip.size() / 2] > 5.0F);
}

TEST_CASE("street sensors: a laser is right to centimetres where it meets a surface squarely, and sparse") {
  const auto s = measured(DepthSource::lidar);
  const double missing = missing_share(*s, 0, 480);
  CHECK(missing > 0.4);
  CHECK(missing < 0.9);
  const auto off = errors(
      *s, [&](int x, int y) { return s->labels(x, y) == label::building && s->normals(x, y).z < -0.9F; },
      [](float z, float truth) { return z - truth; });
  REQUIRE(off.size() > 100);
  CHECK(off[off.size() / 2] < 0.03F);
  CHECK(off[off.size() / 2] > 0.005F);
}

TEST_CASE("street sensors: exact depth is exact, and an unknown sensor is refused") {
  const auto s = measured(DepthSource::exact);
  CHECK(errors(*s, [](int, int) { return true; }, [](float z, float t) { return z - t; }).back() == 0.0F);
  street::StreetParams p;
  p.depth = DepthSource::unknown;
  street::Street none;
  SerialExecutor executor;
  CHECK(street::make_street(p, executor, none).code() == StatusCode::invalid_argument);
}
