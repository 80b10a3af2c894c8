// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/sensor/motion.hpp"
#include "unit/sensor_fixture.hpp"

namespace {

using npsim::LampFlicker;
using npsim::MotionParams;
using npsim::ObjectMotion;
using npsim::PixelMotion;
using npsim::Shape;
using npsim::Span;
using npsim::Vec3f;
using sensor_test::Image;
using sensor_test::pixels;
using sensor_test::total;
using Depth = npsim_test::Image<float>;
using Ids = npsim_test::Image<std::uint16_t>;
using Field = npsim_test::Image<PixelMotion>;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

npsim::Intrinsics camera(Shape shape) {
  return {100, 100, 0.5F * static_cast<float>(shape.width), 0.5F * static_cast<float>(shape.height)};
}

Field field_of(const MotionParams& params, const Depth& depth, const Ids& ids = {}) {
  Field out(depth.shape());
  const npsim::SerialExecutor executor;
  REQUIRE(npsim::motion_field(params, camera(depth.shape()), depth.view(), ids.view(), out.view(), executor).ok());
  return out;
}

template <class Executor = npsim::SerialExecutor>
Image moved(const MotionParams& params, float time_s, const Field& field, const Image& in, const Ids& lamps = {},
            Span<const LampFlicker> flicker = {}, Executor executor = {}) {
  Image out(in.shape(), {7, 7, 7});
  npsim_test::Scratch scratch(npsim::motion_workspace_bytes(in.shape()));
  REQUIRE(npsim::add_motion(params, time_s, field.view(), lamps.view(), flicker, in.view(), out.view(),
                            scratch.workspace(), executor)
              .ok());
  CHECK(scratch.workspace().used() == 0);
  return out;
}

// A road below the horizon, a facade on the right, sky above; two lamps in a hundred pixels.
struct Street {
  Image light;
  Depth depth;
};
Street street(Shape shape) {
  Street s{Image(shape), Depth(shape)};
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      npsim::RandomStream random(4, npsim::RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * shape.width + x),
                                 0);
      const float below = (static_cast<float>(y) + 0.5F - 0.5F * static_cast<float>(shape.height)) / 100;
      s.depth(x, y) = below > 0.02F ? 1.5F / below : (x > 2 * shape.width / 3 ? 20.0F : 0.0F);
      s.light(x, y) = Vec3f{1.2F, 1, 0.6F} * random.uniform();
      if (random.uniform() < 0.02F) s.light(x, y) *= 5e3F;
    }
  }
  return s;
}

}  // namespace

TEST_CASE("sensor: motion of a pixel is that of its point, moved and projected in double precision") {
  const Shape shape{40, 30};
  Depth depth(shape, 12.0F);
  Ids ids(shape);
  ids(5, 6) = 3;
  depth(7, 8) = 0;
  depth(8, 8) = kNan;
  depth(9, 8) = std::numeric_limits<float>::infinity();
  const ObjectMotion objects[] = {{3, {-2, 0.1F, 9}}};
  MotionParams params;
  params.velocity_m_s = {0.3F, -0.1F, 14};
  params.rotation_rad_s = {0.05F, 0.4F, -0.2F};
  params.objects = Span<const ObjectMotion>(objects);
  const Field field = field_of(params, depth, ids);
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 40; ++x) {
      const bool sky = y == 8 && x >= 7 && x <= 9;
      const bool object = x == 5 && y == 6;
      const double z = sky ? 1e9 : 12;
      const double p[3] = {(x + 0.5 - 20) / 100 * z, (y + 0.5 - 15) / 100 * z, z};
      const double v[3] = {object ? -2.3 : -0.3, object ? 0.2 : 0.1, object ? -5.0 : -14.0};
      const double w[3] = {0.05, 0.4, -0.2};
      const double dt = 1e-6;
      const auto at = [&](double t) {
        const double q[3] = {p[0] + t * (v[0] - (w[1] * p[2] - w[2] * p[1])),
                             p[1] + t * (v[1] - (w[2] * p[0] - w[0] * p[2])),
                             p[2] + t * (v[2] - (w[0] * p[1] - w[1] * p[0]))};
        return std::pair<double, double>(100 * q[0] / q[2], 100 * q[1] / q[2]);
      };
      CAPTURE(x);
      CAPTURE(y);
      CHECK(field(x, y).x == doctest::Approx((at(dt).first - at(-dt).first) / (2 * dt)).epsilon(1e-4));
      CHECK(field(x, y).y == doctest::Approx((at(dt).second - at(-dt).second) / (2 * dt)).epsilon(1e-4));
      CHECK(field(x, y).z == doctest::Approx(sky ? 0 : 1 / 12.0));
    }
  }
}

TEST_CASE("sensor: blur is the integral along the path within its bound, whatever the direction and length") {
  const Shape shape{160, 120};
  // L = 1 + sin(2 pi (x + 2 y) / 40) / 2 changes by at most g a pixel.
  const double pi = std::acos(-1.0);
  const double g = 0.5 * 2 * pi / 40 * std::sqrt(5.0);
  const auto exact = [&](double x, double y) { return 1 + 0.5 * std::sin(2 * pi * (x + 2 * y) / 40); };
  Image light(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) light(x, y) = Vec3f{1, 1, 1} * static_cast<float>(exact(x, y));
  }
  for (const int samples : {2, 16, 64}) {
    for (const double length : {0.3, 1.0, 3.0, 11.0, 30.0}) {
      for (const double angle : {0.0, 0.7, 1.5708, 2.6}) {
        MotionParams params;
        params.samples = samples;
        const double dx = length * std::cos(angle);
        const double dy = length * std::sin(angle);
        const Field field(shape, {static_cast<float>(10 * dx), static_cast<float>(10 * dy), 0.1F});
        const Image out = moved(params, 0.1F, field, light);
        const double n = std::fmin(samples, std::fmax(2.0, length - 1));
        const double bound = g * (1 + length / (4 * n));
        double worst = 0;
        for (int y = 40; y < 80; y += 3) {
          for (int x = 40; x < 120; x += 3) {
            double mean = 0;
            for (int i = 0; i < 1000; ++i) {
              const double t = (i + 0.5) / 1000 - 0.5;
              mean += exact(x + t * dx, y + t * dy) / 1000;
            }
            worst = std::fmax(worst, std::fabs(static_cast<double>(out(x, y).y) - mean));
          }
        }
        CAPTURE(samples);
        CAPTURE(length);
        CAPTURE(angle);
        CHECK(worst < bound);
        if (samples == 16 && length < 12) CHECK(worst < 0.3 * bound + 0.02);  // rounding averages out
      }
    }
  }
}

TEST_CASE("sensor: motion keeps a constant, and the light: of one motion exactly, of a street within 1 %") {
  MotionParams params;
  params.velocity_m_s = {0, 0, 14};
  params.rotation_rad_s = {0, 0.3F, 0};
  params.readout_s = 0.02F;
  for (const Shape shape : {Shape{120, 90}, Shape{33, 57}}) {
    const Street s = street(shape);
    const Field field = field_of(params, s.depth);
    const Image constant = moved(params, 0.033F, field, Image(shape, {0.5F, 1, 2}));
    for (const Vec3f& p : pixels(constant)) {
      CHECK(p.x == doctest::Approx(0.5).epsilon(1e-6));
      CHECK(p.z == doctest::Approx(2.0).epsilon(1e-6));
    }
    MotionParams global = params;
    global.readout_s = 0;
    CHECK(total(moved(global, 0.033F, field, s.light)) == doctest::Approx(total(s.light)).epsilon(0.01));
    // Every pixel alike, the borders included; 37 px.
    for (const Vec3f& v : {Vec3f{1100, 0, 0.1F}, Vec3f{0, -1100, 0.1F}}) {
      CHECK(total(moved(global, 0.033F, Field(shape, v), s.light)) == doctest::Approx(total(s.light)).epsilon(1e-5));
    }
    const Field slanted(shape, {900, -650, 0.1F});
    CHECK(total(moved(global, 0.033F, slanted, s.light)) == doctest::Approx(total(s.light)).epsilon(1e-3));
  }
}

TEST_CASE("sensor: a lamp among pixels that do not move leaves a streak of its length and all its light") {
  const Shape shape{201, 101};
  Image light(shape);
  Field field(shape, {0, 0, 0});
  const float lamp = 1e6F;
  for (int y = 50; y < 52; ++y) {
    for (int x = 100; x < 102; ++x) {
      light(x, y) = {lamp, 0.5F * lamp, 0};
      field(x, y) = {1200, 300, 0.1F};
    }
  }
  const Image out = moved({}, 1.0F / 30.0F, field, light);
  CHECK(total(out) == doctest::Approx(total(light)).epsilon(1e-5 + 20 / 1e6));
  double first = 0;
  double second = 0;
  double sum = 0;
  for (int y = 0; y < 101; ++y) {
    for (int x = 0; x < 201; ++x) {
      const auto v = static_cast<double>(out(x, y).x);
      sum += v;
      first += v * x;
      second += v * x * x;
    }
  }
  const double mean = first / sum;
  // A box of 40 px that 2 px of lamp have run through: variance (40^2 + 2^2) / 12.
  CHECK(mean == doctest::Approx(100.5).epsilon(1e-3));
  CHECK(second / sum - mean * mean == doctest::Approx((1600 + 3) / 12.0).epsilon(0.01));
  // Even along the streak, without gaps.
  for (int x = 90; x < 112; ++x) {
    double column = 0;
    for (int y = 0; y < 101; ++y) column += static_cast<double>(out(x, y).x);
    CHECK(column == doctest::Approx(4e6 / 40).epsilon(0.03));
  }
}

TEST_CASE("sensor: what is nearer does not smear over what is behind, and takes the light behind it at its edge") {
  const Shape shape{90, 30};
  Image light(shape, {1, 1, 1});
  Field field(shape, {600, 0, 0.02F});  // a facade 50 m away
  for (int y = 0; y < 30; ++y) {
    for (int x = 40; x < 50; ++x) {
      light(x, y) = {9, 9, 9};
      field(x, y) = {0, 0, 0.1F};  // a car before us, 10 m away, at our speed
    }
  }
  const Image out = moved({}, 1.0F / 30.0F, field, light);
  for (int x = 0; x < 90; ++x) CHECK(out(x, 15).y == doctest::Approx(x >= 40 && x < 50 ? 9.0 : 1.0));
  for (int y = 0; y < 30; ++y) {
    for (int x = 40; x < 50; ++x) field(x, y) = {200, 0, 0.1F};
  }
  const Image passing = moved({}, 1.0F / 30.0F, field, light);
  CHECK(passing(45, 15).y == doctest::Approx(9.0));
  CHECK(passing(40, 15).y == doctest::Approx(1 + 8 * 0.5).epsilon(0.1));
}

TEST_CASE("sensor: rolling shutter while the car turns slants a mast by what it turns from row to row") {
  const Shape shape{200, 100};
  Image light(shape, {0.1F, 0.1F, 0.1F});
  for (int y = 0; y < 100; ++y) light(120, y) = {5, 5, 5};
  MotionParams params;
  params.rotation_rad_s = {0, 2.0F, 0};
  params.readout_s = 0.1F;
  const Field field = field_of(params, Depth(shape));
  const Image out = moved(params, 0.0F, field, light);
  for (const int y : {5, 30, 50, 70, 95}) {
    int at = 0;
    for (int x = 0; x < 200; ++x) at = out(x, y).x > out(at, y).x ? x : at;
    const double t = 0.1 * ((y + 0.5) / 100 - 0.5);
    const double x = (at + 0.5 - 100) / 100;
    // Turned to the right, it moves left, quicker off the axis.
    const double expected = 120 - 100 * 2.0 * (1 + 0.5 * (0.205 * 0.205 + x * x)) * t;
    CAPTURE(y);
    CHECK(std::fabs(at - expected) < 1.1);
    const npsim::Pixel source = npsim::shutter_source(params.readout_s, field.view(), at, y);
    CHECK(source.x == 120);  // a label moves as the picture does
  }
  params.readout_s = 0;
  const npsim::Pixel still = npsim::shutter_source(params.readout_s, field.view(), 3, 4);
  CHECK(still.x == 3);
  CHECK(still.y == 4);
}

TEST_CASE("sensor: a flickering lamp shines in the mean of its wave: dark, half, bright, even over many periods") {
  CHECK(npsim::flicker_mean({100, 0.25F, 0}, 0, 0.01) == doctest::Approx(1.0));
  CHECK(npsim::flicker_mean({100, 0.25F, 0}, 0, 0.0025) == doctest::Approx(4.0));
  CHECK(npsim::flicker_mean({100, 0.25F, 0}, 0.003, 0.009) == doctest::Approx(0.0));
  CHECK(npsim::flicker_mean({100, 0.25F, 0.5F}, 0.004, 0.006) == doctest::Approx(2.0));
  CHECK(npsim::flicker_mean({100, 0.25F, 0}, -0.0075, -0.0065) == doctest::Approx(0.0));
  CHECK(npsim::flicker_mean({100, 0.25F, 0}, 0.001, 0.001) == doctest::Approx(4.0));
  CHECK(npsim::flicker_mean({0, 0.25F, 0}, 0, 1) == 1.0);
  for (const double time : {1e-4, 0.0033, 0.0333, 1.0}) {
    for (int i = 0; i < 50; ++i) {
      const LampFlicker lamp{90.0F + static_cast<float>(i), 0.3F, 0.37F * static_cast<float>(i)};
      double mean = 0;
      for (int k = 0; k < 2000; ++k) {
        const double u =
            (0.2 + time * (k + 0.5) / 2000) * static_cast<double>(lamp.frequency_hz) + static_cast<double>(lamp.phase);
        mean += u - std::floor(u) < static_cast<double>(lamp.duty) ? 1 / 0.3 / 2000 : 0;
      }
      CHECK(npsim::flicker_mean(lamp, 0.2, 0.2 + time) == doctest::Approx(mean).epsilon(0.12).scale(1.0));
    }
  }
  // In the picture: three lamps at rest, one that does not flicker, one in its pause, one at its brightest.
  const Shape shape{30, 10};
  Image light(shape, {0.1F, 0.1F, 0.1F});
  Ids lamps(shape);
  for (int i = 0; i < 3; ++i) {
    light(5 + 10 * i, 5) = {1000, 1000, 1000};
    lamps(5 + 10 * i, 5) = static_cast<std::uint16_t>(i + 1);
  }
  const LampFlicker waves[] = {{0, 1, 0}, {100, 0.2F, 0.6F}, {100, 0.2F, 0.1F}};
  const Image out = moved({}, 1e-3F, Field(shape), light, lamps, Span<const LampFlicker>(waves));
  CHECK(out(5, 5).x == doctest::Approx(1000.0));
  CHECK(out(15, 5).x == 0.0F);
  CHECK(out(25, 5).x == doctest::Approx(5000.0));
  CHECK(out(0, 0).x == doctest::Approx(0.1));
}

TEST_CASE("sensor: rows of a rolling shutter see a flickering lamp at different times, a moving one leaves dashes") {
  const Shape shape{300, 100};
  Image light(shape);
  Ids lamps(shape);
  for (int y = 0; y < 100; ++y) {
    light(10, y) = {100, 100, 100};
    lamps(10, y) = 1;
  }
  const LampFlicker wave[] = {{200, 0.5F, 0}};
  MotionParams params;
  params.readout_s = 0.02F;  // four periods
  const Image rows = moved(params, 1e-4F, Field(shape), light, lamps, Span<const LampFlicker>(wave));
  int changes = 0;
  int lit = 0;
  for (int y = 0; y < 100; ++y) {
    lit += rows(10, y).x > 100;
    changes += y > 0 && (rows(10, y).x > 100) != (rows(10, y - 1).x > 100);
  }
  CHECK(changes >= 7);
  CHECK(changes <= 8);
  CHECK(std::abs(lit - 50) <= 3);

  Image one(shape);
  Ids id(shape);
  one(150, 50) = {1e4F, 1e4F, 1e4F};
  id(150, 50) = 1;
  const Field field(shape, {6000, 0, 0.1F});
  const Image streak = moved({}, 0.03F, field, one, id, Span<const LampFlicker>(wave));  // six periods, 180 px
  CHECK(total(streak) == doctest::Approx(total(one)).epsilon(1e-3));
  int dashes = 0;
  for (int x = 1; x < 300; ++x) dashes += streak(x, 50).x > 20 && !(streak(x - 1, 50).x > 20);
  CHECK(dashes >= 6);
  CHECK(dashes <= 7);
}

TEST_CASE("sensor: motion takes: no time, one pixel, blur longer than the image, no depth, NaN and negative light") {
  const Street s = street({60, 40});
  MotionParams params;
  params.velocity_m_s = {0, 0, 30};
  const Field field = field_of(params, s.depth);
  const Image none = moved(params, 0.0F, field, s.light);
  for (std::size_t i = 0; i < pixels(none).size(); ++i) {
    CHECK(pixels(none)[i].x == doctest::Approx(static_cast<double>(pixels(s.light)[i].x)));
  }
  const Image one = moved(params, 0.03F, Field({1, 1}, {1e6F, -1e6F, 1}), Image({1, 1}, {1, 300, 2}));
  CHECK(one(0, 0).x == doctest::Approx(1.0));
  CHECK(one(0, 0).y == doctest::Approx(300.0).epsilon(1e-4));
  // 5000 px over an image of 60: all rows become their means, and nothing is lost.
  params.samples = 256;
  const Image smear = moved(params, 1.0F, Field(s.light.shape(), {5000, 0, 0}), s.light);
  CHECK(total(smear) == doctest::Approx(total(s.light)).epsilon(1e-4));
  CHECK(moved(params, 3600.0F, Field(s.light.shape(), {1e6F, 1e6F, 0}), s.light).shape() == s.light.shape());

  Image broken({20, 20}, {0.5F, 0.5F, 0.5F});
  broken(3, 3) = {kNan, -1, std::numeric_limits<float>::infinity()};
  const Image out = moved({}, 0.01F, Field(broken.shape(), {300, 0, 0}), broken);
  for (const Vec3f& p : pixels(out)) {
    CHECK(std::isfinite(p.x + p.y + p.z));
    CHECK(p.x >= 0);
  }
  CHECK(out(10, 10).x == doctest::Approx(0.5));
}

TEST_CASE("sensor: motion has the same bits for any order of the chunks, strided or not") {
  const Street s = street({97, 71});
  MotionParams params;
  params.velocity_m_s = {0.2F, 0, 14};
  params.rotation_rad_s = {0.01F, 0.3F, 0.02F};
  params.readout_s = 0.02F;
  const Field field = field_of(params, s.depth);
  Ids lamps(s.light.shape());
  lamps(40, 40) = 1;
  const LampFlicker wave[] = {{123, 0.3F, 0.4F}};
  const Image a = moved(params, 0.033F, field, s.light, lamps, Span<const LampFlicker>(wave));
  const Image b =
      moved(params, 0.033F, field, s.light, lamps, Span<const LampFlicker>(wave), npsim_test::BackwardExecutor{});
  CHECK(a == b);
  Image wide({110, 80}, {9, 9, 9});
  npsim_test::Scratch scratch(npsim::motion_workspace_bytes(s.light.shape()));
  const npsim::SerialExecutor executor;
  REQUIRE(npsim::add_motion(params, 0.033F, field.view(), lamps.view(), Span<const LampFlicker>(wave), s.light.view(),
                            wide.view().sub(5, 3, s.light.shape()), scratch.workspace(), executor)
              .ok());
  CHECK(wide(4, 3).x == 9.0F);
  CHECK(wide(102, 3).x == 9.0F);
  CHECK(wide(5 + 20, 3 + 30) == a(20, 30));
}

TEST_CASE("sensor: motion refuses parameters out of range, planes of another size and a small workspace") {
  const npsim::SerialExecutor executor;
  const Image in({8, 6}, {1, 1, 1});
  Image out({8, 6});
  Field field({8, 6});
  const Field other({8, 5});
  npsim_test::Scratch scratch(npsim::motion_workspace_bytes({8, 6}));
  const auto code = [&](const MotionParams& p, float time, const Field& f, Span<const LampFlicker> flicker = {}) {
    return npsim::add_motion(p, time, f.view(), {}, flicker, in.view(), out.view(), scratch.workspace(), executor)
        .code();
  };
  CHECK(code({}, 0.03F, field) == npsim::StatusCode::ok);
  CHECK(code({}, -1.0F, field) == npsim::StatusCode::invalid_argument);
  CHECK(code({}, kNan, field) == npsim::StatusCode::invalid_argument);
  CHECK(code({}, 0.03F, other) == npsim::StatusCode::shape_mismatch);
  const LampFlicker dark[] = {{100, 0, 0}};
  CHECK(code({}, 0.03F, field, Span<const LampFlicker>(dark)) == npsim::StatusCode::invalid_argument);
  MotionParams bad;
  bad.velocity_m_s = {0, 0, kNan};
  CHECK(code(bad, 0.03F, field) == npsim::StatusCode::invalid_argument);
  bad = {};
  bad.samples = 0;
  CHECK(code(bad, 0.03F, field) == npsim::StatusCode::invalid_argument);
  bad = {};
  bad.readout_s = 2;
  CHECK(code(bad, 0.03F, field) == npsim::StatusCode::invalid_argument);
  const Depth depth({8, 5});
  CHECK(npsim::motion_field({}, camera({8, 6}), depth.view(), {}, field.view(), executor).code() ==
        npsim::StatusCode::shape_mismatch);
  npsim::Workspace none;
  CHECK(npsim::add_motion({}, 0.03F, field.view(), {}, {}, in.view(), out.view(), none, executor).code() ==
        npsim::StatusCode::workspace_exhausted);
}
