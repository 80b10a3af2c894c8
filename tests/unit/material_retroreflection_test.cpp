// SPDX-License-Identifier: Apache-2.0
// Retroreflection against the standards' tables and values worked out by hand; who shines and who does not.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "fixture.hpp"
#include "lit_points.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/material/bsdf.hpp"
#include "npsim/material/retroreflection.hpp"
#include "npsim/render/direct.hpp"

namespace {

using namespace npsim;

constexpr double kPi = 3.14159265358979323846;

Vec3f at_angles(double polar, double azimuth) {
  return vec_cast<float>(
      Vec3d{std::sin(polar) * std::cos(azimuth), std::sin(polar) * std::sin(azimuth), std::cos(polar)});
}

// R_A of white sheeting at an observation and an entrance angle in degrees, the eye between lamp and normal.
double coefficient(double observation, double entrance) {
  constexpr double kDegree = kPi / 180;
  const Vec3f wi = at_angles(entrance * kDegree, 0);
  const Vec3f wo = at_angles((entrance - observation) * kDegree, 0);
  return 250.0 * static_cast<double>(eval_retroreflection(RetroKind::sheeting, {0, 0, 1}, wo, wi)) *
         std::cos((entrance - observation) * kDegree);
}

// What the camera at the origin sees of a point under two lamps at the height of headlamps; lamps are points.
double seen_luminance(const Vec3f& position, const Vec3f& normal, const Vec3f& albedo, Retroreflector retro, float cd) {
  const float alpha = 0.35F;
  const float lift = 0;
  const SurfacePoints points{{&position, 1}, {&normal, 1}, {&albedo, 1}, {&alpha, 1}, {&lift, 1}, {&retro, 1}};
  double seen = 0;
  for (const float side : {-0.6F, 0.6F}) {
    Emitter lamp;
    lamp.centre_m = {side, 0.6F, 1.7F};
    lamp.axis = normalized(position - lamp.centre_m);
    lamp.profile = EmissionProfile::lambert;
    seen += static_cast<double>(luminance(npsim_test::free_light(points, 0, lamp, 0.04F) * cd));
  }
  return seen;
}

// Directions from a marking straight ahead of the camera, 1.4 m over the ground, to it and to a lamp of its car.
struct CarAhead {
  Vec3d to_camera, to_lamp;
};

CarAhead car_at(double distance_m) {
  return {normalized(Vec3d{0, -distance_m, 1.4}), normalized(Vec3d{-0.6, 1.7 - distance_m, 0.65})};
}

// The light that a lamp casts through a glass bead of index 1.5 on the paint behind it, in cells of the bead's far side
// seen along the road, per light on its disc. The bead has the radius 1 and sticks out of the paint above `level`.
constexpr int kCells = 120;
using Spot = std::vector<double>;

Spot light_behind_bead(const Vec3d& to_lamp, double level) {
  constexpr int kRays = 1500;
  constexpr double kIndex = 1.5;
  Spot spot(kCells * kCells, 0.0);
  const Vec3d side = normalized(cross(to_lamp, Vec3d{0, 0, 1}));
  const Vec3d over = cross(side, to_lamp);
  for (int i = 0; i < kRays; ++i) {
    for (int j = 0; j < kRays; ++j) {
      const double u = 2 * (i + 0.5) / kRays - 1;
      const double v = 2 * (j + 0.5) / kRays - 1;
      if (u * u + v * v >= 1) continue;
      const double cosine = std::sqrt(1 - u * u - v * v);
      const Vec3d in = side * u + over * v + to_lamp * cosine;
      if (in.z <= level) continue;
      const double inner = std::sqrt(1 - (1 - cosine * cosine) / (kIndex * kIndex));
      const double s = (cosine - kIndex * inner) / (cosine + kIndex * inner);
      const double p = (inner - kIndex * cosine) / (inner + kIndex * cosine);
      const Vec3d ray = to_lamp * (-1 / kIndex) + in * (cosine / kIndex - inner);
      const Vec3d out = in - ray * (2 * dot(in, ray));
      if (out.z >= level || out.y <= 0) continue;
      const int x = static_cast<int>((out.x + 1) * 0.5 * kCells);
      const int z = static_cast<int>((out.z + 1) * 0.5 * kCells);
      spot[static_cast<std::size_t>(z * kCells + x)] += (1 - 0.5 * (s * s + p * p)) / (kRays * kRays);
    }
  }
  return spot;
}

// R_L of such beads, up to a factor: paint scatters what it gets, and sends through the bead to the eye as much as
// would come from there. `outlines`: area of the beads as seen along the ground, per area of paint. They hide each
// other; lamp and eye see about the same ones.
double returned_by_beads(const CarAhead& car, double level, double outlines) {
  const Spot lit = light_behind_bead(car.to_lamp, level);
  const Spot seen = light_behind_bead(car.to_camera, level);
  double sum = 0;
  for (int z = 0; z < kCells; ++z) {
    for (int x = 0; x < kCells; ++x) {
      const double px = 2 * (x + 0.5) / kCells - 1;
      const double pz = 2 * (z + 0.5) / kCells - 1;
      const auto cell = static_cast<std::size_t>(z * kCells + x);
      sum += lit[cell] * seen[cell] * std::sqrt(std::max(1 - px * px - pz * pz, 0.02));
    }
  }
  const auto open = [&](double sine) { return (1 - std::exp(-outlines / sine)) * sine / outlines; };
  return sum / car.to_camera.z * std::min(open(car.to_lamp.z), open(car.to_camera.z));
}

// A level road of one albedo, seen from 1.4 m above it; rows before kTop are left out.
struct LevelRoad {
  static constexpr float kHeight = 1.4F;
  static constexpr int kTop = 60;
  Shape shape;
  npsim_test::Image<Label> labels{shape, label::road};
  npsim_test::Image<Vec3f> albedo{shape, Vec3f{0.1F, 0.1F, 0.1F}};
  npsim_test::Image<float> depth{shape, 0.0F};
  npsim_test::Image<Retroreflector> out{shape};
  ReflectorScene scene;

  LevelRoad(Shape s, const Intrinsics& camera)
      : shape(s), scene{labels.cview(), {}, albedo.cview(), depth.cview(), camera, kHeight} {
    each([&](int x, int y, float, float z) { depth.view()(x, y) = z; });
  }
  // f(x, y, m to the right, m away).
  template <class F>
  void each(const F& f) const {
    const Intrinsics camera = scene.camera;
    for (int y = kTop; y < shape.height; ++y) {
      const float z = camera.fy * kHeight / (static_cast<float>(y) + 0.5F - camera.cy);
      for (int x = 0; x < shape.width; ++x) f(x, y, (static_cast<float>(x) + 0.5F - camera.cx) / camera.fx * z, z);
    }
  }
  [[nodiscard]] StatusCode find() {
    npsim_test::Scratch scratch(find_retroreflectors_workspace_bytes(shape));
    SerialExecutor serial;
    return find_retroreflectors({}, 0.0F, scene, out.view(), scratch.workspace(), serial).code();
  }
  [[nodiscard]] bool is_paint(int x, int y) { return out.view()(x, y).kind == RetroKind::beads; }
};

}  // namespace

TEST_CASE("retroreflection: painted beads return as rays traced through them do, 5 to 20 m ahead, within a fourth") {
  const auto angles = [](double degrees) { return degrees * kPi / 180; };
  const CarAhead standard{vec_cast<double>(at_angles(angles(87.71), angles(-90))),
                          vec_cast<double>(at_angles(angles(88.76), angles(-90)))};
  for (const double level : {0.16, 0.28}) {
    const double at_30_m = returned_by_beads(standard, level, 0.15);
    for (const double distance_m : {5.0, 6.0, 8.0, 10.0, 15.0, 20.0}) {
      const CarAhead car = car_at(distance_m);
      const double traced = returned_by_beads(car, level, 0.15) / at_30_m;
      const auto modelled = static_cast<double>(eval_retroreflection(
          RetroKind::beads, {0, 0, 1}, vec_cast<float>(car.to_camera), vec_cast<float>(car.to_lamp)));
      CAPTURE(distance_m);
      CHECK(modelled == doctest::Approx(traced).epsilon(0.25 * traced / (1 + traced)));
    }
  }
}

TEST_CASE("retroreflection: sheeting keeps to the table of EN 12899-1, class RA2, within a seventh at 5 degrees") {
  CHECK(coefficient(0.2, 5) == doctest::Approx(250).epsilon(0.02));
  CHECK(coefficient(1.0 / 3, 5) == doctest::Approx(180).epsilon(0.14));
  CHECK(coefficient(2, 5) == doctest::Approx(5).epsilon(0.14));
  CHECK(coefficient(0.2, 30) == doctest::Approx(150).epsilon(0.14));
  CHECK(coefficient(0.2, 40) == doctest::Approx(110).epsilon(0.14));
  for (double entrance = 6; entrance < 80; entrance += 1) {
    CHECK(coefficient(0.2, entrance) < coefficient(0.2, entrance - 1));
  }
}

TEST_CASE("retroreflection: markings and asphalt have their R_L at the geometry of 30 m") {
  constexpr double kDegree = kPi / 180;
  const Vec3f wi = at_angles(88.76 * kDegree, 0);
  const Vec3f wo = at_angles(87.71 * kDegree, 0);
  for (const RetroKind kind : {RetroKind::beads, RetroKind::grain}) {
    CHECK(static_cast<double>(eval_retroreflection(kind, {0, 0, 1}, wo, wi)) == doctest::Approx(1).epsilon(0.01));
  }
}

TEST_CASE("retroreflection: a white sign at 30 and at 100 m has the luminance worked out by hand") {
  // 100 cd a lamp, as above a cut-off. At 30 m the lamps are 28.3 m off, .6 m to the side and .6 below: observation
  // .0300 rad = 1.72 degrees (the camera is 30 m away, so that only the offset across the line counts), 1.1176 * 250 /
  // sqrt(1 + 6.08^4) = 7.56 cd/(lx m2); 2 * 100 / 801.6 = .2495 lx; 1.88 cd/m2.
  const Vec3f facing{0, 0, -1};
  const Vec3f white{0.4F, 0.4F, 0.4F};
  const Retroreflector sheet{250.0F / 0.4F, RetroKind::sheeting};
  const double bare = seen_luminance({0, 0, 30}, facing, white, {}, 100);
  CHECK(seen_luminance({0, 0, 30}, facing, white, sheet, 100) - bare == doctest::Approx(1.88).epsilon(0.03));
  // At 100 m: .00863 rad = .495 degrees, 1.1176 * 250 / sqrt(1 + 1.747^4) = 86.9; 2 * 100 / 9664 = .0207 lx; so 1.80
  // cd/m2.
  const double far = seen_luminance({0, 0, 100}, facing, white, {}, 100);
  CHECK(seen_luminance({0, 0, 100}, facing, white, sheet, 100) - far == doctest::Approx(1.80).epsilon(0.03));
  CHECK(far < 0.01);
}

TEST_CASE("retroreflection: a lamp over the street, seen from the side, makes no sign brighter") {
  const Vec3f wi = normalized(Vec3f{0, -3, -4});
  const Vec3f wo{0, 0, -1};
  // A tenth of what a white surface sends everywhere.
  CHECK(250.0F / 0.4F * eval_retroreflection(RetroKind::sheeting, {0, 0, -1}, wo, wi) < 0.1F / 3.14F);
}

TEST_CASE("retroreflection: no surface returns more light than arrives, bright paint included, at any entrance angle") {
  const RetroreflectionParams p;
  struct Surface {
    RetroKind kind;
    float strength, albedo, alpha;
  };
  std::vector<Surface> surfaces = {{RetroKind::sheeting, p.sign_cd_lx_m2 / 0.4F, 0.4F, 0.35F},
                                   {RetroKind::sheeting, p.vest_cd_lx_m2 / 0.4F, 0.4F, 0.85F}};
  // Ground as find_retroreflectors() has it: white and yellow paint on asphalt, stones of pavements.
  constexpr std::array<Vec3f, 8> kAlbedos = {{{0.3F, 0.3F, 0.3F},
                                              {0.5F, 0.5F, 0.5F},
                                              {0.6F, 0.6F, 0.6F},
                                              {0.65F, 0.65F, 0.65F},
                                              {0.9F, 0.9F, 0.9F},
                                              {0.85F, 0.6F, 0.08F},
                                              {0.1F, 0.1F, 0.1F},
                                              {0.45F, 0.45F, 0.45F}}};
  const Shape shape{10, 60};
  npsim_test::Image<Label> labels(shape, label::road);
  npsim_test::Image<Vec3f> albedo(shape, Vec3f{0.1F, 0.1F, 0.1F});
  npsim_test::Image<Retroreflector> found(shape);
  for (std::size_t i = 0; i < kAlbedos.size(); ++i) {
    for (int x = 0; x < 10; ++x) {
      const int y = static_cast<int>(i);
      if (i >= 6) labels.view()(x, y) = label::sidewalk;
      albedo.view()(x, y) = kAlbedos[i];
    }
  }
  npsim_test::Scratch scratch(find_retroreflectors_workspace_bytes(shape));
  SerialExecutor serial;
  REQUIRE(find_retroreflectors(p, 0.0F, {labels.cview(), {}, albedo.cview()}, found.view(), scratch.workspace(), serial)
              .ok());
  for (std::size_t i = 0; i < kAlbedos.size(); ++i) {
    const Retroreflector& r = found.view()(0, static_cast<int>(i));
    REQUIRE(r.kind == (i < 6 ? RetroKind::beads : RetroKind::grain));
    surfaces.push_back({r.kind, r.strength, kAlbedos[i].x, i < 6 ? 0.85F : 0.9F});  // red returns the most
  }
  const Vec3f n{0, 0, 1};
  for (const Surface& s : surfaces) {
    for (const double degrees : {0.0, 30.0, 60.0, 75.0, 85.0, 88.0, 89.0, 89.5}) {
      const double entrance = degrees * kPi / 180;
      const Vec3f wi = at_angles(entrance, 0);
      // Rings about the lamp's direction, finer towards it, for what is returned; L cos over the hemisphere.
      double returned = 0;
      constexpr int kRings = 400, kSectors = 64;
      const Vec3d axis = vec_cast<double>(wi);
      const Vec3d side = normalized(cross(axis, Vec3d{0, 1, 0}));
      const Vec3d other = cross(axis, side);
      for (int i = 0; i < kRings; ++i) {
        const double low = kPi * std::pow(static_cast<double>(i) / kRings, 4.0);
        const double high = kPi * std::pow(static_cast<double>(i + 1) / kRings, 4.0);
        const double o = 0.5 * (low + high);
        const double solid = 2 * kPi * (std::cos(low) - std::cos(high)) / kSectors;
        for (int j = 0; j < kSectors; ++j) {
          const double a = 2 * kPi * (j + 0.5) / kSectors;
          const Vec3d wo = axis * std::cos(o) + (side * std::cos(a) + other * std::sin(a)) * std::sin(o);
          if (!(wo.z > 0)) continue;
          returned += static_cast<double>(eval_retroreflection(s.kind, n, vec_cast<float>(wo), wi)) * wo.z * solid;
        }
      }
      // Per lux across the beam; cos arrives on the surface.
      const double arrives = std::max(std::cos(entrance), 1e-4);
      const double share = returned * static_cast<double>(s.strength * s.albedo) / arrives;
      CAPTURE(degrees);
      CAPTURE(s.albedo);
      // bsdf.hpp gives back the albedo and what the interface mirrors.
      const double mirrored = static_cast<double>(SpecularAlbedo(s.alpha, 0.04F)(static_cast<float>(arrives)));
      CHECK(share + static_cast<double>(s.albedo) * (1 - mirrored) + mirrored <= 1.0);
    }
  }
}

TEST_CASE("retroreflection: wide pale ground is no paint, while lines, stop lines and bars of crossings are") {
  // 1.4 m above a level road. Pale ground is a lane wide from 6 to 20 m, 2.4 times the asphalt; paint of 2.2 to 5
  // times: a line of .12 m, stop lines near and far, worn bars .55 m wide along the view with .45 m between them, bars
  // across it, and the line of a bay of which a strip of .3 m is seen between pavement and car.
  LevelRoad road({960, 480}, {800.0F, 800.0F, 480.0F, 40.0F});
  const auto within = [](float v, float low, float high) { return v >= low && v < high; };
  enum class Kind { asphalt, pale, line, near_stop, far_stop, along, across, bay, other };
  const auto kind_at = [&](float x, float z) {
    if (within(x, 0.5F, 5.0F) && within(z, 6.0F, 20.0F)) return Kind::pale;
    if (within(x, -0.6F, -0.48F) && z > 20.0F) return Kind::line;
    if (within(x, -4.0F, -0.7F) && within(z, 9.0F, 9.5F)) return Kind::near_stop;
    if (within(x, -4.0F, -0.7F) && within(z, 30.0F, 30.8F)) return Kind::far_stop;
    if (within(x, -4.0F, 0.0F) && within(z, 4.5F, 7.0F) && within(x - std::floor(x), 0.25F, 0.8F)) return Kind::along;
    if (within(x, -4.0F, 0.0F) && within(z, 12.0F, 16.0F) && within(z - std::floor(z), 0.2F, 0.7F)) return Kind::across;
    if (within(x, -7.2F, -7.0F)) return Kind::bay;
    return within(x, -7.25F, -6.95F) || x > -6.0F ? Kind::asphalt : Kind::other;
  };
  road.each([&](int x, int y, float side, float z) {
    constexpr float kAlbedo[] = {0.1F, 0.24F, 0.4F, 0.5F, 0.5F, 0.22F, 0.22F, 0.5F, 0.2F};
    const Kind kind = kind_at(side, z);
    const float a = kAlbedo[static_cast<int>(kind)];
    road.albedo.view()(x, y) = {a, a, a};
    if (kind == Kind::other) road.labels.view()(x, y) = side < -7.25F ? label::sidewalk : label::car;
  });
  const ReflectorScene scene = road.scene;
  const auto share_of_paint = [&](Kind kind, float border_m) {
    int all = 0, painted = 0;
    road.each([&](int x, int y, float side, float z) {
      if (kind_at(side, z) != kind) return;
      if (kind_at(side - border_m, z) != kind || kind_at(side + border_m, z) != kind) return;
      if (kind_at(side, z - border_m) != kind || kind_at(side, z + border_m) != kind) return;
      ++all;
      painted += road.is_paint(x, y) ? 1 : 0;
    });
    REQUIRE(all > 50);
    return static_cast<double>(painted) / all;
  };
  REQUIRE(road.find() == StatusCode::ok);
  CHECK(share_of_paint(Kind::asphalt, 0.0F) == 0.0);
  CHECK(share_of_paint(Kind::pale, 1.1F) == 0.0);
  CHECK(share_of_paint(Kind::pale, 0.0F) < 0.4);  // its borders
  for (const Kind kind : {Kind::line, Kind::near_stop, Kind::far_stop, Kind::along, Kind::across, Kind::bay}) {
    CAPTURE(static_cast<int>(kind));
    CHECK(share_of_paint(kind, 0.0F) > 0.98);
  }
  road.scene.camera_height_m = -1.0F;
  CHECK(road.find() == StatusCode::invalid_argument);
  road.scene.camera_height_m = LevelRoad::kHeight;
  road.scene.camera.fx = 0.0F;
  CHECK(road.find() == StatusCode::invalid_argument);
  road.scene.depth = road.depth.cview().sub(0, 0, {10, 10});
  CHECK(road.find() == StatusCode::shape_mismatch);
  road.scene.depth = {};  // the road's median alone
  REQUIRE(road.find() == StatusCode::ok);
  road.scene = scene;
  CHECK(share_of_paint(Kind::pale, 0.0F) == 1.0);
}

TEST_CASE("retroreflection: a stretch of road that gets twice as pale over 1.5 m and darker again is no paint") {
  LevelRoad road({480, 240}, {400.0F, 400.0F, 240.0F, 20.0F});
  road.each([&](int x, int y, float side, float) {
    const float a = 0.1F + 0.12F * std::fmax(0.0F, 1.0F - std::fabs(side) / 1.5F);
    road.albedo.view()(x, y) = {a, a, a};
  });
  REQUIRE(road.find() == StatusCode::ok);
  int painted = 0;
  road.each([&](int x, int y, float, float) { painted += y < 180 && road.is_paint(x, y) ? 1 : 0; });
  CHECK(painted < 100);  // far away, where less is seen around
}

TEST_CASE(
    "retroreflection: a worn line, half of it below the contrast of paint, is paint, stones and gutters are not, "
    "beside a line or not") {
  const Shape shape{160, 60};
  npsim_test::Image<Label> labels(shape, label::road);
  npsim_test::Image<Vec3f> albedo(shape, Vec3f{0.1F, 0.1F, 0.1F});
  npsim_test::Image<Retroreflector> out(shape);
  enum class Kind { asphalt, line, gutter, stone, edge, beside };
  const auto kind_at = [](int x, int y) {
    if (x < 12 || x >= 156) return Kind::edge;
    if (x < 18 || x >= 150) return Kind::beside;
    if (x >= 24 && x < 30) return Kind::line;
    if (x >= 60 && x < 66) return Kind::gutter;
    return x > 40 && x < 55 && x % 5 == 0 && y % 5 == 0 ? Kind::stone : Kind::asphalt;
  };
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      RandomStream r(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * shape.width + x), 0);
      const float u = r.uniform();
      // The line from .165 to .24, the gutter from .15 to .21, others between white lines and the picture's
      // borders, wider and narrower than these.
      constexpr float kLow[] = {0.09F, 0.165F, 0.15F, 0.17F, 0.155F, 0.4F};
      constexpr float kSpan[] = {0.02F, 0.075F, 0.06F, 0.0F, 0.02F, 0.05F};
      const auto kind = static_cast<std::size_t>(kind_at(x, y));
      const float a = kLow[kind] + kSpan[kind] * u;
      albedo.view()(x, y) = {a, a, a};
    }
  }
  npsim_test::Scratch scratch(find_retroreflectors_workspace_bytes(shape));
  SerialExecutor serial;
  REQUIRE(find_retroreflectors({}, 0.0F, {labels.cview(), {}, albedo.cview()}, out.view(), scratch.workspace(), serial)
              .ok());
  int painted[6] = {}, all[6] = {};
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const auto kind = static_cast<std::size_t>(kind_at(x, y));
      ++all[kind];
      painted[kind] += out.view()(x, y).kind == RetroKind::beads ? 1 : 0;
    }
  }
  const auto share = [&](Kind kind) {
    const auto k = static_cast<std::size_t>(kind);
    return static_cast<double>(painted[k]) / all[k];
  };
  CHECK(share(Kind::line) == 1.0);
  CHECK(share(Kind::gutter) < 0.3);  // grains that have the contrast by themselves
  for (const Kind kind : {Kind::stone, Kind::asphalt, Kind::edge}) CHECK(share(kind) == 0.0);
  CHECK(share(Kind::beside) == 1.0);
}

TEST_CASE(
    "retroreflection: faces of signs shine, grey backs with shadows on them do not, paint is told from its road") {
  const Shape shape{80, 40};
  npsim_test::Image<Label> labels(shape, label::road);
  npsim_test::Image<Vec3f> albedo(shape, Vec3f{0.1F, 0.1F, 0.1F});
  const auto sign = [&](int x0, auto&& colour) {
    for (int y = 4; y < 16; ++y) {
      for (int x = x0; x < x0 + 12; ++x) {
        labels.view()(x, y) = label::traffic_sign;
        albedo.view()(x, y) = colour(x - x0, y - 4);
      }
    }
  };
  // Red rim, white middle; white without a colour; a back, half of it in the shade; blue all over.
  sign(2, [](int x, int y) {
    return x < 3 || x > 8 || y < 3 || y > 8 ? Vec3f{0.4F, 0.03F, 0.04F} : Vec3f{0.7F, 0.7F, 0.7F};
  });
  sign(20, [](int x, int) { return x % 4 == 0 ? Vec3f{0.1F, 0.1F, 0.1F} : Vec3f{0.75F, 0.75F, 0.75F}; });
  sign(38, [](int x, int) { return x < 6 ? Vec3f{0.1F, 0.1F, 0.11F} : Vec3f{0.5F, 0.5F, 0.52F}; });
  sign(56, [](int, int) { return Vec3f{0.01F, 0.05F, 0.3F}; });
  for (int x = 0; x < 80; ++x) albedo.view()(x, 30) = {0.45F, 0.45F, 0.4F};
  for (int x = 0; x < 80; ++x) albedo.view()(x, 34) = {0.17F, 0.17F, 0.17F};
  npsim_test::Image<Retroreflector> out(shape, Retroreflector{1, RetroKind::beads});
  npsim_test::Scratch scratch(find_retroreflectors_workspace_bytes(shape));
  Workspace& workspace = scratch.workspace();
  SerialExecutor serial;
  const RetroreflectionParams p;
  REQUIRE(find_retroreflectors(p, 0.0F, {labels.cview(), {}, albedo.cview()}, out.view(), workspace, serial).ok());
  const auto at = [&](int x, int y) { return out.view()(x, y); };
  // White of the first sign: .7, so that its white has R_A 250 and its red a seventh of that or so.
  CHECK(at(8, 10).kind == RetroKind::sheeting);
  CHECK(at(8, 10).strength * 0.7F == doctest::Approx(250).epsilon(0.01));
  CHECK(at(2, 4).strength * luminance(Vec3f{0.4F, 0.03F, 0.04F}) < 0.2F * 250.0F);
  CHECK(at(21, 10).kind == RetroKind::sheeting);
  CHECK(at(40, 10).kind == RetroKind::none);
  CHECK(at(47, 10).kind == RetroKind::none);
  CHECK(at(60, 10).kind == RetroKind::sheeting);
  CHECK(at(60, 10).strength * luminance(Vec3f{0.01F, 0.05F, 0.3F}) < 60.0F);
  CHECK(at(5, 30).kind == RetroKind::beads);
  CHECK(at(5, 34).kind == RetroKind::grain);
  CHECK(at(5, 36).kind == RetroKind::grain);
  CHECK(at(5, 36).strength * 0.1F == doctest::Approx(p.road_cd_lx_m2));

  RetroreflectionParams off = p;
  off.on = false;
  REQUIRE(find_retroreflectors(off, 0.0F, {labels.cview(), {}, albedo.cview()}, out.view(), workspace, serial).ok());
  for (const Retroreflector& r : out.view().pixels()) CHECK(r.kind == RetroKind::none);
}

TEST_CASE(
    "retroreflection: a marked plate has its own R_A in the sun, in the shade, 3 px wide, with and without labels") {
  const Shape shape{60, 30};
  npsim_test::Image<Label> labels(shape, label::car);
  npsim_test::Image<Vec3f> albedo(shape, Vec3f{0.03F, 0.03F, 0.03F});
  npsim_test::Image<ReflectorClass> marked(shape, ReflectorClass::none);
  const auto mark = [&](int x0, int width, int height, ReflectorClass cls, float white) {
    for (int y = 10; y < 10 + height; ++y) {
      for (int x = x0; x < x0 + width; ++x) {
        marked.view()(x, y) = cls;
        const float a = (x + y) % 3 == 0 ? 0.1F * white : white;  // print
        albedo.view()(x, y) = {a, a, a};
      }
    }
  };
  mark(2, 16, 6, ReflectorClass::number_plate, 0.7F);
  mark(22, 16, 6, ReflectorClass::number_plate, 0.1F);  // guessed dark, as it lies in the shade: no back of a sign
  mark(42, 3, 1, ReflectorClass::number_plate, 0.6F);
  mark(48, 8, 12, ReflectorClass::sheeting, 0.5F);
  for (int x = 0; x < 20; ++x) {  // the first one lies in a white frame that the mark reaches into
    for (const int y : {10, 15}) albedo.view()(x, y) = {0.95F, 0.95F, 0.95F};
  }
  for (int y = 10; y < 16; ++y) {
    for (const int x : {2, 17}) albedo.view()(x, y) = {0.95F, 0.95F, 0.95F};
  }
  npsim_test::Image<Retroreflector> out(shape, Retroreflector{1, RetroKind::beads});
  npsim_test::Scratch scratch(find_retroreflectors_workspace_bytes(shape));
  SerialExecutor serial;
  const RetroreflectionParams p;
  for (const bool labelled : {true, false}) {
    REQUIRE(find_retroreflectors(p, 0.0F,
                                 {labelled ? labels.cview() : ImageView<const Label>(), marked.cview(), albedo.cview()},
                                 out.view(), scratch.workspace(), serial)
                .ok());
    const auto r_a = [&](int x, int y) { return out.view()(x, y).strength * albedo.view()(x, y).x; };
    CHECK(out.view()(3, 12).kind == RetroKind::sheeting);
    CHECK(r_a(4, 12) == doctest::Approx(45).epsilon(0.01));
    CHECK(r_a(3, 12) == doctest::Approx(4.5).epsilon(0.01));  // of the print
    CHECK(r_a(25, 12) == doctest::Approx(45).epsilon(0.01));
    CHECK(r_a(42, 10) == doctest::Approx(45).epsilon(0.01));
    CHECK(r_a(50, 15) == doctest::Approx(250).epsilon(0.01));
    CHECK(out.view()(20, 12).kind == RetroKind::none);
  }
  mark(48, 8, 4, ReflectorClass::vest, 0.4F);
  REQUIRE(find_retroreflectors(p, 0.0F, {labels.cview(), marked.cview(), albedo.cview()}, out.view(),
                               scratch.workspace(), serial)
              .ok());
  CHECK(out.view()(49, 12).strength * albedo.view()(49, 12).x == doctest::Approx(330).epsilon(0.01));
  RetroreflectionParams off = p;
  off.on = false;
  REQUIRE(find_retroreflectors(off, 0.0F, {labels.cview(), marked.cview(), albedo.cview()}, out.view(),
                               scratch.workspace(), serial)
              .ok());
  for (const Retroreflector& r : out.view().pixels()) CHECK(r.kind == RetroKind::none);
}
