// SPDX-License-Identifier: Apache-2.0
// Light transport against closed forms: patch integrals, blockers, furnaces.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "lit_points.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/observe.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/light/activation.hpp"
#include "npsim/render/direct.hpp"
#include "npsim/render/gather.hpp"
#include "npsim/render/visibility.hpp"

namespace {

using namespace npsim;

// The corner of the face that a hit lies nearest to.
auto nearest_corner(const std::vector<Face>& faces) {
  return [&faces](const Hit& hit) {
    const Face face = faces[hit.face];
    const float w = 1.0F - hit.u - hit.v;
    return w >= hit.u && w >= hit.v ? face.a : (hit.u >= hit.v ? face.b : face.c);
  };
}

constexpr double kPi = 3.14159265358979323846;

constexpr float kLift_m = 0.03F;

struct World {
  std::vector<Vec3f> vertices;
  std::vector<Vec3f> normals;
  std::vector<Vec3f> albedo;
  std::vector<float> alpha;
  std::vector<Face> faces;
  std::vector<unsigned char> memory;
  std::vector<float> lift_m;
  Bvh bvh;

  void add_point(Vec3f position, Vec3f normal) {
    vertices.push_back(position);
    normals.push_back(normal);
    albedo.push_back({0.5F, 0.5F, 0.5F});
    alpha.push_back(1.0F);
    lift_m.push_back(kLift_m);
  }
  // A quad whose vertices carry `normal`.
  void add_quad(Vec3f a, Vec3f b, Vec3f c, Vec3f d, Vec3f normal) {
    const auto first = static_cast<std::uint32_t>(vertices.size());
    for (const Vec3f& v : {a, b, c, d}) add_point(v, normal);
    faces.push_back({first, first + 1, first + 2});
    faces.push_back({first, first + 2, first + 3});
  }
  void build() {
    memory.resize(bvh_workspace_bytes(faces.size()));
    Workspace workspace(memory.data(), memory.size());
    REQUIRE(build_bvh({{vertices.data(), vertices.size()}, {faces.data(), faces.size()}}, workspace, bvh).ok());
  }
  [[nodiscard]] SurfacePoints points() const {
    return {{vertices.data(), vertices.size()},
            {normals.data(), normals.size()},
            {albedo.data(), albedo.size()},
            {alpha.data(), alpha.size()},
            {lift_m.data(), lift_m.size()}};
  }
};

// A square lamp of side `side`, 4 m above the origin of a y-down frame, shining down.
Emitter lamp_above(float side) {
  Emitter e;
  e.centre_m = {0, -4, 10};
  e.half_u_m = {side / 2, 0, 0};
  e.half_v_m = {0, 0, side / 2};
  e.axis = {0, 1, 0};
  e.up = {0, 0, 1};
  e.area_m2 = side * side;
  e.profile = EmissionProfile::lambert;
  e.mark = 7;
  return e;
}

// The share of the lamp that each point sees; 0 too where it is not asked about.
std::vector<float> visibility_of(const World& world, const Emitter& emitter, float peak_cd,
                                 const std::vector<std::uint16_t>& face_mark, float cutoff_lx = 1e-3F,
                                 float certain_lx = 0, int lattice = 1,
                                 ImageView<const std::uint32_t> visible_point = {}) {
  npsim_test::LampQuestion question;
  question.params.samples_per_side = 16;
  question.params.cutoff_lx = cutoff_lx;
  question.params.lattice = lattice;
  question.peak_cd = peak_cd;
  question.certain_lx = certain_lx;
  question.face_mark = face_mark;
  question.visible_point = visible_point;
  const npsim_test::LitPoints lit = npsim_test::lit_points(world.bvh, world.points(), emitter, question);
  std::vector<float> out(world.vertices.size());
  for (std::size_t p = 0; p < out.size(); ++p) {
    Vec3f to_light;
    const float lx = peak_cd * illuminance_per_cd(emitter, world.vertices[p], world.normals[p], to_light);
    if (lx > 0.0F) out[p] = lit.lx[p] / lx;
  }
  if (cutoff_lx == 0.0F) CHECK(lit.untraced_lx == 0.0F);
  return out;
}

}  // namespace

TEST_CASE("illuminance of a square lamp is within 5 % of its patch integral from two extents on") {
  RandomStream random(11, RandomPurpose::test, 0, 0, 0, 0);
  for (int trial = 0; trial < 200; ++trial) {
    const Emitter lamp = lamp_above(random.uniform(0.05F, 1.0F));
    const Vec3f position{random.uniform(-6, 6), random.uniform(-1.8F, 2), 10 + random.uniform(-6, 6)};
    const double distance = static_cast<double>(length(lamp.centre_m - position));
    if (distance < 2 * 2 * static_cast<double>(length(lamp.half_u_m))) continue;
    const Vec3f normal{0, -1, 0};
    double exact = 0;
    constexpr int n = 64;
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        const Vec3d q = vec_cast<double>(
            sample_point(lamp, position, (static_cast<float>(i) + 0.5F) / n, (static_cast<float>(j) + 0.5F) / n));
        const Vec3d d = q - vec_cast<double>(position);
        const double r2 = dot(d, d);
        const double cos_both = (-d.y / std::sqrt(r2)) * (-d.y / std::sqrt(r2));
        exact += cos_both / r2 / (n * n);
      }
    }
    Vec3f to_light;
    const auto got = static_cast<double>(illuminance_per_cd(lamp, position, normal, to_light));
    CHECK(got == doctest::Approx(exact).epsilon(0.05));
  }
}

namespace {

// Illuminance per candela of a lit rectangle, by quadrature in double.
double by_quadrature(const Emitter& e, const Vec3f& position, const Vec3f& normal) {
  constexpr int n = 400;
  const Vec3d u = vec_cast<double>(e.half_u_m);
  const Vec3d v = vec_cast<double>(e.half_v_m);
  const Vec3d middle = vec_cast<double>(e.centre_m) - vec_cast<double>(position);
  double sum = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const Vec3d q = middle + u * (2 * (i + 0.5) / n - 1) + v * (2 * (j + 0.5) / n - 1);
      const double r2 = dot(q, q);
      const double received = dot(vec_cast<double>(normal), q);
      const double sent = -dot(vec_cast<double>(e.axis), q);
      if (received > 0 && sent > 0) sum += received * sent / (r2 * r2);
    }
  }
  return sum / (n * n);
}

}  // namespace

TEST_CASE("illuminance of lit surfaces nearby is that of their rectangle within .1 %, cut by the horizon too") {
  RandomStream random(12, RandomPurpose::test, 0, 0, 0, 0);
  int compared = 0, cut = 0, beyond = 0;
  for (int trial = 0; trial < 600; ++trial) {
    Emitter e = lamp_above(1.0F);
    const auto any = [&] { return Vec3f{random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)}; };
    const Vec3f u = normalized(any());
    e.half_u_m = u * random.uniform(0.1F, 1.0F);
    e.half_v_m = normalized(cross(u, any())) * random.uniform(0.1F, 1.0F);
    e.axis = normalized(cross(e.half_u_m, e.half_v_m));
    const float side = 2 * std::max(length(e.half_u_m), length(e.half_v_m));
    Vec3f away = normalized(any());
    if (dot(away, e.axis) < 0) away = -away;
    const float sides = random.uniform(0.6F, 12.0F);
    if (dot(away, e.axis) < 0.1F) continue;
    const Vec3f position = e.centre_m + away * (side * sides);
    const Vec3f normal = normalized(any());
    const double exact = by_quadrature(e, position, normal);
    Vec3f to_light;
    const auto got = static_cast<double>(illuminance_per_cd(e, position, normal, to_light));
    // What a receiver that faces the middle would get.
    const double most = by_quadrature(e, position, -away);
    if (sides < 7.99F) {
      CHECK(std::fabs(got - exact) <= 1e-3 * exact + 1e-5 * most);
      ++compared;
      if (got > 0) CHECK(dot(to_light, normal) > 0);
    } else {
      CHECK(std::fabs(got - exact) <= 0.01 * most);
      ++beyond;
    }
    if (exact > 0 && dot(normal, away) > 0) ++cut;  // the middle lies below the horizon, and it is lit
  }
  CHECK(compared > 200);
  CHECK(beyond > 50);
  CHECK(cut > 2);
}

TEST_CASE("illuminance before a window: at its foot and at its middle, by hand; nothing behind it") {
  // Two by two metres and 1 cd/m2. One metre before the middle, facing it: four corners of Lambert's rectangle,
  // E = 4 * (1/2) * 2 * (1/sqrt 2) atan(1/sqrt 2) = sqrt 2 * 2 * .61548 = 1.7408 lx.
  Emitter window;
  window.centre_m = {0, 0, 10};
  window.half_u_m = {1, 0, 0};
  window.half_v_m = {0, 1, 0};
  window.axis = {0, 0, -1};
  window.area_m2 = 4;
  Vec3f to_light;
  CHECK(4.0F * illuminance_per_cd(window, {0, 0, 9}, {0, 0, 1}, to_light) == doctest::Approx(1.7408).epsilon(1e-3));
  CHECK(to_light.z == doctest::Approx(1).epsilon(1e-4));
  // On a pavement at the lower edge, one metre before it: (1/2) (atan(1) - (1/sqrt 5) atan(1/sqrt 5)) to either side.
  CHECK(4.0F * illuminance_per_cd(window, {0, 1, 9}, {0, -1, 0}, to_light) ==
        doctest::Approx(std::atan(1.0) - std::atan(1 / std::sqrt(5.0)) / std::sqrt(5.0)).epsilon(1e-3));
  CHECK(illuminance_per_cd(window, {0, 0, 11}, {0, 0, -1}, to_light) == 0.0F);
  CHECK(illuminance_per_cd(window, {0, 0, 10}, {0, 0, -1}, to_light) == 0.0F);
}

TEST_CASE("visibility: of a surface that the receiver's horizon cuts, what lies above it is seen whole") {
  World world;
  world.add_point({0, 0, 10}, {-1, 0, 0});
  // A wall in the receiver's own plane, as any flat surface is.
  world.add_quad({0.001F, -5, 5}, {0.001F, 5, 5}, {0.001F, 5, 15}, {0.001F, -5, 15}, {-1, 0, 0});
  world.build();
  const std::vector<std::uint16_t> no_marks(world.faces.size(), 0);
  CHECK(visibility_of(world, lamp_above(3.0F), 1000, no_marks)[0] == 1);
}

TEST_CASE("visibility: free points see all, points under a half blocker half, behind it nothing, facing away nothing") {
  World world;
  world.add_point({0, 0, 10}, {0, -1, 0});   // directly below, blocker covers x > 0 half of the lamp
  world.add_point({-5, 0, 10}, {0, -1, 0});  // looks past the blocker
  world.add_point({2, 0, 10}, {0, -1, 0});   // in the umbra
  world.add_point({0, 0, 10}, {0, 1, 0});    // turned away
  // Blocker at y = -2: a lamp half-plane x > 0 seen from the origin crosses y = -2 at x > 0.
  world.add_quad({0, -2, 5}, {8, -2, 5}, {8, -2, 15}, {0, -2, 15}, {0, -1, 0});
  world.build();
  const std::vector<std::uint16_t> no_marks(world.faces.size(), 0);
  const auto seen = visibility_of(world, lamp_above(1.0F), 1000, no_marks);
  CHECK(seen[0] == doctest::Approx(0.5).epsilon(0.06));
  CHECK(seen[1] == 1);
  CHECK(seen[2] == 0);
  CHECK(seen[3] == 0);
}

TEST_CASE("visibility: faces with the emitter's own mark do not hide it, faces with another mark do") {
  World world;
  world.add_point({0, 0, 10}, {0, -1, 0});
  world.add_quad({-3, -3.9F, 7}, {3, -3.9F, 7}, {3, -3.9F, 13}, {-3, -3.9F, 13}, {0, -1, 0});
  world.build();
  CHECK(visibility_of(world, lamp_above(0.3F), 1000, std::vector<std::uint16_t>(2, 7))[0] == 1);
  CHECK(visibility_of(world, lamp_above(0.3F), 1000, std::vector<std::uint16_t>(2, 6))[0] == 0);
}

TEST_CASE("visibility: pairs below the cut-off and emitters that no variant lights are skipped") {
  World world;
  world.add_point({0, 0, 10}, {0, -1, 0});
  world.add_quad({50, 50, 50}, {51, 50, 50}, {51, 51, 50}, {50, 51, 50}, {0, 0, -1});
  world.build();
  const std::vector<std::uint16_t> no_marks(2, 0);
  // 1 cd at 4 m is 1/16 lx.
  CHECK(visibility_of(world, lamp_above(0.1F), 1.0F, no_marks, 0.0624F)[0] == 1);
  CHECK(visibility_of(world, lamp_above(0.1F), 1.0F, no_marks, 0.0626F)[0] == 0);
  CHECK(visibility_of(world, lamp_above(0.1F), 0.0F, no_marks)[0] == 0);
}

TEST_CASE("visibility: beside light that is certain, lamps that bring less than .2 % of it are skipped") {
  World world;
  world.add_point({0, 0, 10}, {0, -1, 0});
  world.add_quad({50, 50, 50}, {51, 50, 50}, {51, 51, 50}, {50, 51, 50}, {0, 0, -1});
  world.build();
  const std::vector<std::uint16_t> no_marks(2, 0);
  CHECK(visibility_of(world, lamp_above(0.1F), 1.0F, no_marks, 1e-3F, 31.2F)[0] == 1);
  CHECK(visibility_of(world, lamp_above(0.1F), 1.0F, no_marks, 1e-3F, 31.3F)[0] == 0);
}

TEST_CASE("gather: inside a closed white-lit box every ray lands and the furnace gives albedo times irradiance") {
  World world;
  const float s = 2.0F;
  const Vec3f c{0, 0, 10};
  const auto corner = [&](float x, float y, float z) { return c + Vec3f{x * s, y * s, z * s}; };
  world.add_quad(corner(-1, -1, -1), corner(1, -1, -1), corner(1, 1, -1), corner(-1, 1, -1), {0, 0, 1});
  world.add_quad(corner(-1, -1, 1), corner(1, -1, 1), corner(1, 1, 1), corner(-1, 1, 1), {0, 0, -1});
  world.add_quad(corner(-1, -1, -1), corner(-1, 1, -1), corner(-1, 1, 1), corner(-1, -1, 1), {1, 0, 0});
  world.add_quad(corner(1, -1, -1), corner(1, 1, -1), corner(1, 1, 1), corner(1, -1, 1), {-1, 0, 0});
  world.add_quad(corner(-1, -1, -1), corner(1, -1, -1), corner(1, -1, 1), corner(-1, -1, 1), {0, 1, 0});
  world.add_quad(corner(-1, 1, -1), corner(1, 1, -1), corner(1, 1, 1), corner(-1, 1, 1), {0, -1, 0});
  // A receiver that no face uses, on the middle of the floor.
  world.add_point(c + Vec3f{0.1F, s, 0.2F}, {0, -1, 0});
  world.build();

  GatherParams params;
  params.rays = 64;
  const std::uint32_t receiver = static_cast<std::uint32_t>(world.vertices.size() - 1);
  std::vector<std::uint32_t> hits(64);
  std::vector<Vec3f> sky(1);
  Vec2f unseen;
  SerialExecutor serial;
  NullObserver observer;
  REQUIRE(trace_gather_rays(params, 0, world.bvh, nearest_corner(world.faces), world.points(),
                            Span<const std::uint32_t>(&receiver, 1), SkyParams{}, UnseenStreetParams{},
                            {hits.data(), hits.size()}, {sky.data(), 1}, Span<Vec2f>(&unseen, 1), serial, observer)
              .ok());
  for (const std::uint32_t h : hits) CHECK(h != kNoPoint);
  CHECK(sky[0] == Vec3f{});
  CHECK(unseen.x == 0.0F);
  CHECK(unseen.y == 0.0F);
  // Albedo 1/2 under 10, 20 and 30 lx, in the lanes of the second light.
  std::vector<float> exitance(world.vertices.size() * kLightLanes, 0.0F);
  for (std::size_t p = 0; p < world.vertices.size(); ++p) {
    for (std::size_t i = 0; i < 3; ++i) exitance[p * kLightLanes + 3 + i] = 5.0F * static_cast<float>(i + 1);
  }
  float even[kLightLanes], odd[kLightLanes];
  gather_exitance({exitance.data(), exitance.size()}, hits.data(), 64, even, odd);
  CHECK(even[3] / 32 == doctest::Approx(5).epsilon(1e-5));
  CHECK(odd[3] / 32 == doctest::Approx(5).epsilon(1e-5));
  CHECK((even[5] + odd[5]) / 64 == doctest::Approx(15).epsilon(1e-5));
  CHECK(even[2] == 0.0F);
  CHECK(odd[0] == 0.0F);
}

TEST_CASE(
    "gather: an open road sees sky and unseen street, whose shares add up to one, and no sky behind a wall's back") {
  World world;
  world.add_point({0, 1.5F, 10}, {0, -1, 0});
  // A wall beside the point that faces away from it.
  world.add_quad({1, -50, -40}, {1, 1.5F, -40}, {1, 1.5F, 60}, {1, -50, 60}, {1, 0, 0});
  world.build();
  GatherParams params;
  params.rays = 1024;
  const std::uint32_t receiver = 0;
  std::vector<std::uint32_t> hits(1024);
  std::vector<Vec3f> sky(1);
  Vec2f unseen;
  SerialExecutor serial;
  NullObserver observer;
  REQUIRE(trace_gather_rays(params, 0, world.bvh, nearest_corner(world.faces), world.points(),
                            Span<const std::uint32_t>(&receiver, 1), SkyParams{}, UnseenStreetParams{},
                            {hits.data(), hits.size()}, {sky.data(), 1}, Span<Vec2f>(&unseen, 1), serial, observer)
              .ok());
  for (const std::uint32_t h : hits) CHECK(h == kNoPoint);
  // Numeric integral over the free half of the hemisphere (x < 0 side and what passes above the wall is small).
  double half = 0;
  double whole = 0;
  double street = 0;
  constexpr int n = 400;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const double theta = (i + 0.5) / n * kPi / 2;
      const double phi = (j + 0.5) / n * 2 * kPi;
      const Vec3d d{std::sin(theta) * std::cos(phi), -std::cos(theta), std::sin(theta) * std::sin(phi)};
      const double weight = std::cos(theta) * std::sin(theta) * (kPi / 2 / n) * (2 * kPi / n);
      const Vec2f seen = unseen_weights(UnseenStreetParams{}, static_cast<float>(-d.y));
      // The wall's back is as bright as what stands, at any height.
      street += static_cast<double>(d.x < 0 ? seen.y : UnseenStreetParams{}.share) * weight / kPi;
      const double l =
          static_cast<double>(luminance(sky_luminance(SkyParams{}, vec_cast<float>(d))) * (1 - seen.y)) * weight;
      whole += l;
      if (d.x < 0) half += l;
    }
  }
  CHECK(static_cast<double>(luminance(sky[0])) > 0.95 * half);
  CHECK(static_cast<double>(luminance(sky[0])) < 0.60 * whole);
  CHECK(unseen.x == 0.0F);  // nothing lies below the horizon of a road
  CHECK(static_cast<double>(unseen.y) == doctest::Approx(street).epsilon(0.01));
}

TEST_CASE("unseen street: as bright as the picture's surfaces, above and below the camera apart, light by light") {
  World world;
  for (int i = 0; i < 170; ++i) world.add_point({0.01F * static_cast<float>(i), 2, 10}, {0, -1, 0});
  for (int i = 0; i < 170; ++i) world.add_point({0.01F * static_cast<float>(i), -2, 10}, {0, 0, -1});
  std::vector<std::uint32_t> receivers(world.vertices.size());
  for (std::size_t i = 0; i < receivers.size(); ++i) receivers[i] = static_cast<std::uint32_t>(i);
  std::vector<float> exitance(world.vertices.size() * kLightLanes, 0.0F);
  for (std::size_t p = 0; p < receivers.size(); ++p) {
    exitance[p * kLightLanes] = p < 170 ? 3.0F : 1.0F;
    exitance[p * kLightLanes + 4] = p < 170 ? 0.5F : 0.25F;
  }
  UnseenStreetLight light[kLightsAtOnce];
  unseen_street_light(world.points(), {receivers.data(), receivers.size()}, {0, -1, 0},
                      {exitance.data(), exitance.size()}, light);
  const auto pi = static_cast<float>(kPi);
  CHECK(light[0].below.x == doctest::Approx(3 / pi));
  CHECK(light[0].above.x == doctest::Approx(1 / pi));
  CHECK(light[1].below.y == doctest::Approx(0.5F / pi));
  CHECK(light[1].above.y == doctest::Approx(0.25F / pi));
  CHECK(light[1].below.x == 0.0F);
  CHECK(light[1].above.z == 0.0F);
}

TEST_CASE("unseen street: weights fall with height, end at the roofs, and never exceed the share") {
  UnseenStreetParams p;
  p.share = 0.8F;
  p.top = 0.5F;
  CHECK(unseen_weights(p, -0.3F).x == 0.8F);
  CHECK(unseen_weights(p, -0.3F).y == 0.0F);
  CHECK(unseen_weights(p, 0.0F).y == 0.8F);
  CHECK(unseen_weights(p, 0.25F).y == doctest::Approx(0.2));
  CHECK(unseen_weights(p, 0.5F).y == 0.0F);
  p.share = 0.0F;
  CHECK(unseen_weights(p, -0.3F).x == 0.0F);
  p.share = 1.1F;
  CHECK(!validate(p).ok());
  p = {};
  p.top = 0.0F;
  CHECK(!validate(p).ok());
}

TEST_CASE("direct light: a lamp on a Lambertian road gives E = I cos / d^2 and L = albedo E / pi; hidden gives none") {
  World world;
  world.add_point({0, 6, 10}, {0, -1, 0});
  Emitter lamp = lamp_above(0.2F);
  lamp.centre_m.y = 2;
  npsim_test::LampQuestion question;
  question.peak_cd = 1600;
  const npsim_test::LitPoints lit = npsim_test::lit_points(world.bvh, world.points(), lamp, question);
  CHECK(lit.lx[0] == doctest::Approx(100).epsilon(1e-5));
  // The interface of a rough dielectric takes a few per cent.
  CHECK(direct_light(world.points(), 0, lit.lx[0], lit.to_light[0], 0.0F).x ==
        doctest::Approx(0.5 * 100 / kPi).epsilon(0.05));
  CHECK(direct_light(world.points(), 0, 0.0F, lit.to_light[0], 0.04F) == Vec3f{});
}

namespace {

// Whether the segment from a to b crosses a triangle strictly inside, in double (Moeller and Trumbore 1997); `margin`
// is how far the crossing lies from the triangle's border and from both ends, in barycentric and segment parameters.
bool crosses(const Vec3d& a, const Vec3d& b, const Vec3d& p, const Vec3d& q, const Vec3d& r, double& margin) {
  const Vec3d d = b - a;
  const Vec3d e1 = q - p;
  const Vec3d e2 = r - p;
  const Vec3d h = cross(d, e2);
  const double det = dot(e1, h);
  if (det == 0) return false;
  const Vec3d s = a - p;
  const double u = dot(s, h) / det;
  const Vec3d k = cross(s, e1);
  const double v = dot(d, k) / det;
  const double t = dot(e2, k) / det;
  const double inside = std::min({u, v, 1 - u - v, t, 0.999 - t});
  margin = std::min(margin, std::fabs(inside));
  return inside > 0;
}

}  // namespace

TEST_CASE("visibility and direct light agree with brute force in double among random triangles and lamps") {
  World world;
  RandomStream random(17, RandomPurpose::test, 0, 0, 0, 0);
  constexpr std::size_t kPoints = 300;
  for (std::size_t i = 0; i < kPoints; ++i) {
    world.add_point({random.uniform(-5, 5), random.uniform(-2, 2), random.uniform(4, 16)},
                    normalized(Vec3f{random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)}));
  }
  for (int i = 0; i < 40; ++i) {
    const auto first = static_cast<std::uint32_t>(world.vertices.size());
    const Vec3f centre{random.uniform(-5, 5), random.uniform(-3, 2), random.uniform(4, 16)};
    for (int c = 0; c < 3; ++c) {
      world.add_point(centre + Vec3f{random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)}, {0, -1, 0});
    }
    world.faces.push_back({first, first + 1, first + 2});
  }
  world.build();
  std::vector<Emitter> lamps;
  std::vector<Activation> lit;
  for (int i = 0; i < 6; ++i) {
    Emitter lamp = lamp_above(1e-3F);  // a point: one ray each
    lamp.centre_m = {random.uniform(-5, 5), random.uniform(-5, -3), random.uniform(4, 16)};
    lamps.push_back(lamp);
    Activation a;
    a.lit = i != 3;
    a.intensity_cd = {random.uniform(100, 1000), random.uniform(100, 1000), random.uniform(100, 1000)};
    lit.push_back(a);
  }
  npsim_test::LampQuestion question;
  question.params.cutoff_lx = 0;
  question.params.lattice = 1;
  question.face_mark.assign(world.faces.size(), 0);
  std::vector<Vec3f> illuminance(world.vertices.size());
  for (std::size_t e = 0; e < lamps.size(); ++e) {
    question.number = static_cast<std::uint32_t>(e);
    const npsim_test::LitPoints at = npsim_test::lit_points(world.bvh, world.points(), lamps[e], question);
    for (std::size_t p = 0; p < illuminance.size(); ++p) {
      if (lit[e].lit) illuminance[p] += lit[e].intensity_cd * at.lx[p];
    }
  }
  int compared = 0;
  int shadowed = 0;
  for (std::size_t p = 0; p < kPoints; ++p) {
    Vec3d expected;
    double margin = 1;
    for (std::size_t e = 0; e < lamps.size(); ++e) {
      const Vec3d origin = vec_cast<double>(world.vertices[p] + world.normals[p] * kLift_m);
      const Vec3d centre = vec_cast<double>(lamps[e].centre_m);
      const Vec3d delta = centre - vec_cast<double>(world.vertices[p]);
      const double r = length(delta);
      const double cosine = dot(vec_cast<double>(world.normals[p]), delta) / r;
      const double down = -delta.y / r;  // lambert about (0, 1, 0)
      if (cosine <= 0 || down <= 0) continue;
      bool blocked = false;
      for (const Face& f : world.faces) {
        blocked = crosses(origin, centre, vec_cast<double>(world.vertices[f.a]), vec_cast<double>(world.vertices[f.b]),
                          vec_cast<double>(world.vertices[f.c]), margin) ||
                  blocked;
      }
      if (blocked) ++shadowed;
      if (blocked || !lit[e].lit) continue;
      expected += vec_cast<double>(lit[e].intensity_cd) * (down * cosine / (r * r));
    }
    if (margin < 1e-4) continue;  // the middle of so small a patch may fall on either side of an edge
    ++compared;
    CHECK(static_cast<double>(illuminance[p].x) == doctest::Approx(expected.x).epsilon(1e-4));
    CHECK(static_cast<double>(illuminance[p].z) == doctest::Approx(expected.z).epsilon(1e-4));
  }
  CHECK(compared > 200);
  CHECK(shadowed > 50);
}

namespace {

// A level floor in rows of 200 points, seen as a picture, and a wall, high or of `width`, that throws its shadow on it.
struct Floor {
  World world;
  std::vector<std::uint32_t> pixels;
  static constexpr int kWidth = 200, kHeight = 40;

  explicit Floor(float width) {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        pixels.push_back(static_cast<std::uint32_t>(world.vertices.size()));
        world.add_point({-10 + 0.1F * static_cast<float>(x), 1.5F, 14 - 0.25F * static_cast<float>(y)}, {0, -1, 0});
      }
    }
    world.add_quad({0, -1, 2}, {width, -1, 2}, {width, 1.4F, 25}, {0, 1.4F, 25}, {0, -1, 0});
    world.build();
  }
  [[nodiscard]] ImageView<const std::uint32_t> picture() const { return {pixels.data(), {kWidth, kHeight}, kWidth}; }
};

}  // namespace

TEST_CASE("visibility: what is taken from the lattice stays within the stated 50 cut-offs per emitter") {
  const Floor floor(30.0F);
  Emitter lamp = lamp_above(0.01F);
  lamp.centre_m = {-3, -2, 9};
  const std::vector<std::uint16_t> no_marks(floor.world.faces.size(), 0);
  constexpr float kCutoff = 1e-3F;
  bool any_taken_wrong = false;
  for (const int lattice : {1, 2, 4, 8}) {
    for (const float cd : {0.05F, 0.5F, 3.0F, 50.0F}) {
      const auto exact = visibility_of(floor.world, lamp, cd, no_marks, 0.0F);
      const auto quick = visibility_of(floor.world, lamp, cd, no_marks, kCutoff, 0, lattice, floor.picture());
      for (std::size_t p = 0; p < floor.pixels.size(); ++p) {
        Vec3f to_light;
        const Vec3f& normal = floor.world.normals[p];
        const float unshadowed = cd * illuminance_per_cd(lamp, floor.world.vertices[p], normal, to_light);
        CHECK(unshadowed * std::fabs(exact[p] - quick[p]) <= 50 * kCutoff);
        // The edge of a shadow as wide as this is found whatever the lattice.
        if (unshadowed >= 50 * kCutoff) CHECK(exact[p] == quick[p]);
        any_taken_wrong = any_taken_wrong || (unshadowed > kCutoff && exact[p] != quick[p]);
      }
    }
  }
  CHECK(any_taken_wrong);  // else the bound was not put to the test
}

TEST_CASE("visibility: a shadow narrower than the lattice is followed between its points") {
  const Floor floor(0.1F);
  Emitter lamp = lamp_above(0.01F);
  lamp.centre_m = {-3, -2, 9};
  const std::vector<std::uint16_t> no_marks(floor.world.faces.size(), 0);
  const auto exact = visibility_of(floor.world, lamp, 1000, no_marks, 0.0F);
  const auto quick = visibility_of(floor.world, lamp, 1000, no_marks, 1e-3F, 0, 4, floor.picture());
  int dark = 0;
  int missed = 0;
  for (std::size_t p = 0; p < floor.pixels.size(); ++p) {
    dark += exact[p] == 0.0F ? 1 : 0;
    missed += exact[p] != quick[p] ? 1 : 0;
  }
  CHECK(dark > 60);
  CHECK(dark < 4 * Floor::kHeight);
  CHECK(missed * 10 < dark);
}

TEST_CASE("visibility: blocks beyond a lamp's reach are left out whole, and what they miss is no more than is said") {
  Floor floor(0.1F);
  Emitter lamp = lamp_above(0.01F);
  lamp.centre_m = {-3, -2, 9};
  npsim_test::LampQuestion question;
  question.params.cutoff_lx = 0.02F;
  question.face_mark.assign(floor.world.faces.size(), 0);
  question.visible_point = floor.picture();
  for (const float cd : {0.3F, 1.0F, 3.0F}) {
    question.peak_cd = cd;
    const npsim_test::LitPoints lit = npsim_test::lit_points(floor.world.bvh, floor.world.points(), lamp, question);
    double left_out = 0;
    for (const std::uint32_t p : floor.pixels) {
      Vec3f to_light;
      const float lx = cd * illuminance_per_cd(lamp, floor.world.vertices[p], floor.world.normals[p], to_light);
      if (lit.lx[p] > 0.0F) CHECK(lx > 0.02F);
      if (lx <= 0.02F) left_out += static_cast<double>(lx);
    }
    CHECK(left_out > 0);
    CHECK(static_cast<double>(lit.untraced_lx) >= 0.999 * left_out);
  }
}

TEST_CASE("visibility: no point of a cell gets more than its bound, before, behind and inside lamps of every kind") {
  int none = 0;
  for (std::uint32_t round = 0; round < 4000; ++round) {
    CAPTURE(round);
    RandomStream random(3, RandomPurpose::test, 0, 0, round, 0);
    const auto draw = [&](float low, float high) { return random.uniform(low, high); };
    const auto direction = [&] {
      Vec3f d;
      while (!(dot(d, d) > 0.01F && dot(d, d) < 1.0F)) d = {draw(-1, 1), draw(-1, 1), draw(-1, 1)};
      return normalized(d);
    };
    Emitter lamp;
    lamp.shape = static_cast<EmitterShape>(round % 4);
    lamp.profile = lamp.shape == EmitterShape::patch                   ? static_cast<EmissionProfile>(round / 4 % 8)
                   : lamp.shape == EmitterShape::disc && round % 8 < 4 ? EmissionProfile::signal
                                                                       : EmissionProfile::lambert;
    lamp.axis = direction();
    lamp.up = normalized(cross(lamp.axis, direction()));
    lamp.half_u_m = lamp.up * draw(0.01F, 1.0F);
    lamp.half_v_m = cross(lamp.axis, lamp.up) * draw(0.01F, 1.0F);
    lamp.area_m2 = draw(0.0F, 1.0F);
    World world;
    const Vec3f middle = direction() * draw(0.1F, 20.0F);
    const Vec3f facing = direction();
    const float size = draw(0.01F, 3.0F);
    const float bend = round % 3 == 0 ? 2.0F : 0.3F;
    for (std::uint32_t i = 0; i < 64; ++i) {
      random = RandomStream(3, RandomPurpose::test, 0, 1, round, i);
      world.add_point(middle + direction() * size, normalized(facing + direction() * bend));
    }
    std::vector<std::uint32_t> slots(kBlockPoints, kNoPoint);
    std::uint32_t next = 0;
    for_cell(5, [&](std::size_t slot) { slots[slot] = next++; });
    const CellBounds bounds = bounds_of(world.points(), {slots.data(), slots.size()}, 5);
    const float most = visibility_detail::most_illuminance_lx(lamp, 7.0F, bounds);
    none += most == 0.0F ? 1 : 0;
    for (std::size_t p = 0; p < 64; ++p) {
      Vec3f to_light;
      CHECK(7.0F * illuminance_per_cd(lamp, world.vertices[p], world.normals[p], to_light) <= 1.02F * most);
    }
  }
  CHECK(none > 400);  // it does say so where nothing arrives
}

namespace {

// Points on the ground under a small lamp, and veils between them: sheet s lies s + 1 m above the ground and covers
// everything, as veil number of_sheet[s] - 1; 0: solid.
std::vector<float> seen_through(const std::vector<std::uint8_t>& of_sheet, const std::vector<float>& cover,
                                float lamp_m = 0.01F, int lattice = 1) {
  World world;
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 8; ++x) {
      world.add_point({0.1F * static_cast<float>(x), 0, 10 + 0.1F * static_cast<float>(y)}, {0, -1, 0});
    }
  }
  npsim_test::LampQuestion question;
  question.params.cutoff_lx = 0.0F;
  question.params.lattice = lattice;
  std::vector<std::uint8_t> of_face;
  for (const float c : cover)
    question.veils.veil[question.veils.count++] = {c, {1e9F, 1e9F, 1e9F}, {-1e9F, -1e9F, -1e9F}};
  for (std::size_t s = 0; s < of_sheet.size(); ++s) {
    const float y = -1.0F - static_cast<float>(s);
    world.add_quad({-9, y, 1}, {9, y, 1}, {9, y, 19}, {-9, y, 19}, {0, -1, 0});
    of_face.insert(of_face.end(), 2, of_sheet[s]);
    if (of_sheet[s] == 0) continue;
    Veil& veil = question.veils.veil[of_sheet[s] - 1U];
    veil.low = {-9, std::min(veil.low.y, y), 1};
    veil.high = {9, std::max(veil.high.y, y), 19};
  }
  question.veils.of_face = {of_face.data(), of_face.size()};
  world.build();
  const Emitter lamp = lamp_above(lamp_m);
  const npsim_test::LitPoints lit = npsim_test::lit_points(world.bvh, world.points(), lamp, question);
  std::vector<float> share;
  for (std::size_t p = 0; p < 64; ++p) {
    Vec3f to_light;
    share.push_back(lit.lx[p] / illuminance_per_cd(lamp, world.vertices[p], world.normals[p], to_light));
  }
  return share;
}

bool all_near(const std::vector<float>& values, float value) {
  return std::all_of(values.begin(), values.end(), [&](float v) { return std::fabs(v - value) < 1e-5F; });
}

}  // namespace

TEST_CASE("veils take their share of a ray once, however many of their faces it crosses, and each veil its own") {
  for (const float lamp_m : {0.01F, 1.0F}) {
    CAPTURE(lamp_m);
    CHECK(all_near(seen_through({}, {}, lamp_m), 1.0F));
    CHECK(all_near(seen_through({1}, {0.35F}, lamp_m), 0.65F));
    CHECK(all_near(seen_through({1, 1, 1}, {0.35F}, lamp_m), 0.65F));  // front, back, another behind it
    CHECK(all_near(seen_through({1, 2, 1}, {0.35F, 0.5F}, lamp_m), 0.325F));
    CHECK(all_near(seen_through({1}, {0.0F}, lamp_m), 1.0F));
  }
}

TEST_CASE("veils: what is solid behind or before them hides the lamp, and what they cover in full does too") {
  CHECK(all_near(seen_through({0, 1}, {0.35F}), 0.0F));
  CHECK(all_near(seen_through({1, 0}, {0.35F}), 0.0F));
  CHECK(all_near(seen_through({1}, {1.0F}), 0.0F));
}

TEST_CASE("veils: points between those of the lattice lose the same share") {
  CHECK(all_near(seen_through({1}, {0.35F}, 0.01F, 4), 0.65F));
}

TEST_CASE(
    "veils: a ray meets the box around a veil from inside, along its sides and where the box is flat, or misses") {
  using visibility_detail::meets_box;
  const auto ray = [](Vec3f from, Vec3f to) {
    Ray r;
    r.origin = from;
    r.direction = to - from;
    r.t_max = 0.999F;
    return r;
  };
  const Vec3f low{-1, -2, 5}, high{1, 0, 7};
  CHECK(meets_box(ray({0, -1, 0}, {0, -1, 10}), low, high));
  CHECK(meets_box(ray({0, -1, 6}, {0, -9, 6}), low, high));     // from inside
  CHECK(meets_box(ray({0, -1, 6}, {0.1F, -1, 6}), low, high));  // within
  CHECK(meets_box(ray({1, -1, 0}, {1, -1, 10}), low, high));    // in the plane of a side
  CHECK(meets_box(ray({-3, -1, 4}, {3, -1, 8}), low, high));
  CHECK(!meets_box(ray({0, -1, 0}, {0, -1, 4}), low, high));   // ends before it
  CHECK(!meets_box(ray({0, -1, 8}, {0, -1, 10}), low, high));  // begins behind it
  CHECK(!meets_box(ray({2, -1, 0}, {2, -1, 10}), low, high));
  CHECK(meets_box(ray({0, -1, 0}, {0.5F, -1, 10}), {-1, -2, 6}, {1, 0, 6}));  // flat
}

namespace {

// Points of a body on the ground under a lamp that is part of `of_lamp`, and over them a sheet of body `of_sheet` and,
// where it is asked for, one of no body.
bool is_lit_under(std::uint16_t of_points, std::uint16_t of_sheet, std::uint16_t of_lamp, bool roof) {
  World world;
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 8; ++x) {
      world.add_point({0.1F * static_cast<float>(x), 0, 10 + 0.1F * static_cast<float>(y)}, {0, -1, 0});
    }
  }
  std::vector<std::uint16_t> of_face;
  for (const float y : {-1.0F, -2.0F}) {
    if (y < -1.0F && !roof) continue;
    world.add_quad({-9, y, 1}, {9, y, 1}, {9, y, 19}, {-9, y, 19}, {0, -1, 0});
    of_face.insert(of_face.end(), 2, y < -1.0F ? std::uint16_t{0} : of_sheet);
  }
  world.build();
  std::vector<std::uint16_t> of_point(world.vertices.size(), of_sheet);
  std::fill(of_point.begin(), of_point.begin() + 64, of_points);
  const std::vector<std::uint16_t> of_lamps = {0, of_lamp};
  npsim_test::LampQuestion question;
  question.params.cutoff_lx = 0.0F;
  question.number = 1;
  question.bodies = {{of_face.data(), of_face.size()}, {of_point.data(), of_point.size()}, {of_lamps.data(), 2}};
  const npsim_test::LitPoints lit = npsim_test::lit_points(world.bvh, world.points(), lamp_above(0.01F), question);
  const auto is_lit = [](float lx) { return lx > 0.0F; };
  const bool all = std::all_of(lit.lx.begin(), lit.lx.begin() + 64, is_lit);
  CHECK(all == std::any_of(lit.lx.begin(), lit.lx.begin() + 64, is_lit));
  return all;
}

}  // namespace

TEST_CASE(
    "bodies: their own faces do not shade them, those of others and of none do, and so does what holds the lamp") {
  CHECK(is_lit_under(7, 7, 0, false));
  CHECK_FALSE(is_lit_under(7, 8, 0, false));
  CHECK_FALSE(is_lit_under(7, 0, 0, false));
  CHECK_FALSE(is_lit_under(0, 7, 0, false));
  CHECK_FALSE(is_lit_under(0, 0, 0, false));
  CHECK_FALSE(is_lit_under(7, 7, 0, true));
  CHECK_FALSE(is_lit_under(7, 7, 7, false));
  CHECK(is_lit_under(7, 7, 9, false));
}

TEST_CASE("bodies: of the points of one block each is asked for its own") {
  World world;
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 8; ++x) {
      world.add_point({0.1F * static_cast<float>(x), 0, 10 + 0.1F * static_cast<float>(y)}, {0, -1, 0});
    }
  }
  world.add_quad({-9, -1, 1}, {9, -1, 1}, {9, -1, 19}, {-9, -1, 19}, {0, -1, 0});
  world.build();
  const std::vector<std::uint16_t> of_face(2, 3);
  std::vector<std::uint16_t> of_point(world.vertices.size(), 0);
  for (std::size_t p = 0; p < 64; ++p) of_point[p] = static_cast<std::uint16_t>((p * 7) % 5);
  const std::vector<std::uint16_t> of_lamps(1, 0);
  npsim_test::LampQuestion question;
  question.params.cutoff_lx = 0.0F;
  question.params.lattice = 1;
  question.bodies = {{of_face.data(), 2}, {of_point.data(), of_point.size()}, {of_lamps.data(), 1}};
  const npsim_test::LitPoints lit = npsim_test::lit_points(world.bvh, world.points(), lamp_above(0.01F), question);
  for (std::size_t p = 0; p < 64; ++p) CHECK((lit.lx[p] > 0.0F) == (of_point[p] == 3));
}
