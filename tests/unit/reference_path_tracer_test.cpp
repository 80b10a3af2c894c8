// SPDX-License-Identifier: Apache-2.0
// The reference path tracer, by closed forms, by furnaces, and by what it promises about its random numbers.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "fixture.hpp"
#include "lit_points.hpp"
#include "npsim/core/random.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/light/activation.hpp"
#include "npsim/light/photometry.hpp"
#include "npsim/material/bsdf.hpp"
#include "npsim/render/direct.hpp"
#include "reference/path_tracer.hpp"
#include "reference/triangle_scan.hpp"

namespace {

using namespace npsim;
using namespace npsim::reference;

constexpr double kWhite = 1.0;

// A matt floor that a camera above looks at, with nothing else.
NightScene floor_scene(float albedo = 0.5F) {
  NightScene scene;
  scene.vertices = {{-50, 0, -50}, {50, 0, -50}, {50, 0, 50}, {-50, 0, 50}};
  scene.faces = {{0, 1, 2}, {0, 2, 3}};
  scene.face_material = {0, 0};
  scene.materials = {{{albedo, albedo, albedo}, 0.5F}};
  scene.matt = true;
  return scene;
}

// The floor's point (x, 0, z), seen from straight above. Up is -y.
ViewedPoint floor_point(double x, double z, double albedo = 0.5) {
  ViewedPoint point;
  point.surface = true;
  point.at = {{x, 0, z}, {0, -1, 0}, {0, -1, 0}, {albedo, albedo, albedo}, 0.5, 0};
  point.to_eye = {0, -1, 0};
  return point;
}

// Mean luminance of the point's light over so many samples.
double light_of(const NightScene& scene, const ViewedPoint& point, std::uint64_t samples, int bounces = 0,
                double* error = nullptr) {
  PathParams params;
  params.seed = 5;
  params.bounces = bounces;
  params.roulette_from = 8;
  const TriangleTree tree(scene.mesh());
  SerialExecutor executor;
  const std::vector<PixelSums> sums = trace_night(params, scene, tree, {point}, samples, executor);
  if (error != nullptr) *error = standard_error(sums[0], samples);
  return luminance_of(sums[0].light) / static_cast<double>(samples);
}

Vec3d direction_of(RandomStream& random) {
  const double z = 2 * static_cast<double>(random.uniform()) - 1;
  const double a = 2 * kPi * static_cast<double>(random.uniform());
  const double r = std::sqrt(1 - z * z);
  return {r * std::cos(a), r * std::sin(a), z};
}

// A sphere about the origin, cut from an icosahedron; its corners lie on the radius.
NightScene sphere_scene(int cuts, float radius, float albedo) {
  NightScene scene;
  const float g = 1.618034F;
  scene.vertices = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                    {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  scene.faces = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                 {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                 {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  for (int cut = 0; cut < cuts; ++cut) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
    const auto middle = [&](std::uint32_t a, std::uint32_t b) {
      const auto key = std::minmax(a, b);
      const auto found = middles.find(key);
      if (found != middles.end()) return found->second;
      scene.vertices.push_back(normalized(scene.vertices[a]) + normalized(scene.vertices[b]));
      return middles[key] = static_cast<std::uint32_t>(scene.vertices.size() - 1);
    };
    std::vector<Face> finer;
    for (const Face& f : scene.faces) {
      const std::uint32_t ab = middle(f.a, f.b);
      const std::uint32_t bc = middle(f.b, f.c);
      const std::uint32_t ca = middle(f.c, f.a);
      finer.insert(finer.end(), {{f.a, ab, ca}, {f.b, bc, ab}, {f.c, ca, bc}, {ab, bc, ca}});
    }
    scene.faces = finer;
  }
  for (Vec3f& v : scene.vertices) v = normalized(v) * radius;
  scene.face_material.assign(scene.faces.size(), 0);
  scene.materials = {{{albedo, albedo, albedo}, 0.5F}};
  scene.matt = true;
  return scene;
}

// Illuminance of the corner below which a rectangle w x l of luminance 1 hangs at height h, level.
double corner_lux(double w, double l, double h) {
  const double a = w / h;
  const double b = l / h;
  const auto part = [](double x, double y) { return x / std::sqrt(1 + x * x) * std::atan(y / std::sqrt(1 + x * x)); };
  return 0.5 * (part(a, b) + part(b, a));
}

}  // namespace

TEST_CASE("reference: the tree finds what a scan of all faces finds") {
  const ScanMesh mesh = soup(600, 0.3F, 1.0F, 11);
  const TriangleTree tree(mesh.view());
  int hits = 0;
  for (std::uint32_t i = 0; i < 3000; ++i) {
    RandomStream random = stream(9000 + i);
    const Vec3d origin = vec_cast<double>(in_cube(random, 1.5F));
    const RayD ray{origin, direction_of(random), i % 3 == 0 ? 1.0 : 1e9};
    // The scan: one tree per face would be no test of trees, so the plane and the three edges.
    double nearest = ray.t_max;
    std::uint32_t face = kNothing;
    for (std::uint32_t f = 0; f < mesh.faces.size(); ++f) {
      const auto corner = [&](std::uint32_t v) { return vec_cast<double>(mesh.vertices[v]) - origin; };
      const Vec3d a = corner(mesh.faces[f].a);
      const Vec3d b = corner(mesh.faces[f].b);
      const Vec3d c = corner(mesh.faces[f].c);
      const Vec3d n = cross(b - a, c - a);
      const double t = dot(n, a) / dot(n, ray.direction);
      const double sides[3] = {dot(ray.direction, cross(a, b)), dot(ray.direction, cross(b, c)),
                               dot(ray.direction, cross(c, a))};
      const bool inside =
          (sides[0] > 0 && sides[1] > 0 && sides[2] > 0) || (sides[0] < 0 && sides[1] < 0 && sides[2] < 0);
      if (inside && t > 0 && t < nearest) {
        nearest = t;
        face = f;
      }
    }
    HitD hit;
    CHECK(tree.closest(ray, hit) == (face != kNothing));
    CHECK(hit.face == face);
    CHECK(tree.occluded(ray, [](std::uint32_t) { return true; }) == (face != kNothing));
    if (face == kNothing) continue;
    ++hits;
    CHECK(std::fabs(hit.t - nearest) < 1e-9);
    const RayD before{ray.origin, ray.direction, hit.t * (1 - 1e-9)};
    CHECK(!tree.occluded(before, [](std::uint32_t) { return true; }));
    CHECK(!tree.occluded({ray.origin, ray.direction, hit.t * (1 + 1e-9)}, [&](std::uint32_t f) { return f != face; }));
  }
  CHECK(hits > 1000);
  HitD hit;
  CHECK(!TriangleTree(TriangleMeshView{}).closest({{}, {0, 0, 1}}, hit));
}

TEST_CASE("reference: profiles and reflection are those of the library") {
  for (const EmissionProfile profile : {EmissionProfile::lambert, EmissionProfile::signal,
                                        EmissionProfile::street_luminaire, EmissionProfile::low_beam}) {
    Emitter e;
    e.profile = profile;
    e.axis = normalized(Vec3f{0.2F, -0.3F, 0.9F});
    e.up = normalized(cross(e.axis, Vec3f{1, 0.5F, 0}));
    double worst = 0;
    for (std::uint32_t i = 0; i < 20000; ++i) {
      RandomStream random = stream(i);
      Vec3d d = direction_of(random);
      if (i % 2 == 0) d = normalized(vec_cast<double>(e.axis) + d * 0.05);  // in the beam
      const double ours = relative_intensity_of(profile, vec_cast<double>(e.axis), vec_cast<double>(e.up), d);
      worst = std::max(worst, std::fabs(ours - static_cast<double>(relative_intensity(e, vec_cast<float>(d)))));
    }
    CHECK(worst < 2e-5);
  }
  double worst = 0;
  for (std::uint32_t i = 0; i < 20000; ++i) {
    RandomStream random = stream(50000 + i);
    const Vec3d n = direction_of(random);
    const auto above = [&] {
      const Vec3d d = direction_of(random);
      return normalized(dot(d, n) > 0 ? d : -d);
    };
    const Vec3d wo = above();
    const Vec3d wi = above();
    const float alpha = random.uniform(0.05F, 1.0F);
    const Vec3f albedo{0.2F, 0.5F, 0.8F};
    const Vec3d ours = RoughDielectric(vec_cast<double>(albedo), static_cast<double>(alpha), 0.04).eval(n, wo, wi);
    const Vec3d theirs =
        vec_cast<double>(eval_bsdf(albedo, alpha, 0.04F, vec_cast<float>(n), vec_cast<float>(wo), vec_cast<float>(wi)));
    worst = std::max(worst, length(ours - theirs) / (0.01 + length(theirs)));
  }
  CHECK(worst < 1e-3);
}

TEST_CASE("reference: a point, a disc, a rectangle and a sphere light a plane as their closed forms say") {
  NightScene scene = floor_scene();
  Lamp lamp;
  const double share = 0.5 / kPi;  // luminance of the floor per lux
  SUBCASE("point") {
    lamp.profile = EmissionProfile::signal;
    lamp.axis = normalized(Vec3d{0.1, 1, 0.2});
    lamp.centre = {1, -3, 0.5};
    lamp.peak_cd = 100;
    scene.lamps = {lamp};
    const Vec3d to_lamp = lamp.centre;
    const double c = dot(-normalized(to_lamp), lamp.axis);
    const double lux = 100 * c * c * c * c * 3 / std::pow(length(to_lamp), 3);
    CHECK(light_of(scene, floor_point(0, 0), 16) == doctest::Approx(lux * share).epsilon(1e-9));
  }
  SUBCASE("disc above") {
    lamp.set_disc({0, -2, 0}, {0, 1, 0}, 1.5);
    lamp.luminance_cd_m2 = 40;
    scene.lamps = {lamp};
    const double lux = kPi * 40 * 1.5 * 1.5 / (1.5 * 1.5 + 4);
    CHECK(light_of(scene, floor_point(0, 0), 1 << 20) == doctest::Approx(lux * share).epsilon(1e-3));
  }
  SUBCASE("rectangle, seen from beside its middle") {
    lamp.set_parallelogram({0.5, -2, 0.25}, {1, 0, 0}, {0, 0, -0.75});
    lamp.luminance_cd_m2 = 40;
    scene.lamps = {lamp};
    // From x = -0.5 to 1.5 and z = -0.5 to 1 about the point.
    const double lux =
        40 * (corner_lux(0.5, 0.5, 2) + corner_lux(0.5, 1, 2) + corner_lux(1.5, 0.5, 2) + corner_lux(1.5, 1, 2));
    CHECK(light_of(scene, floor_point(0, 0), 1 << 20) == doctest::Approx(lux * share).epsilon(1e-3));
    // Its back is dark.
    scene.lamps[0].set_parallelogram({0.5, -2, 0.25}, {1, 0, 0}, {0, 0, 0.75});
    scene.lamps[0].triangles.erase(scene.lamps[0].triangles.begin(), scene.lamps[0].triangles.begin() + 2);
    scene.lamps[0].triangles[0].area_up_to -= 3;
    scene.lamps[0].triangles[1].area_up_to -= 3;
    scene.lamps[0].area_m2 = 3;
    CHECK(light_of(scene, floor_point(0, 0), 1 << 10) == 0);
  }
  SUBCASE("sphere to one side") {
    lamp.set_sphere({1, -2, -1}, 0.75);
    lamp.luminance_cd_m2 = 40;
    scene.lamps = {lamp};
    const double d2 = 6;
    const double lux = kPi * 40 * 0.75 * 0.75 / d2 * (2 / std::sqrt(d2));
    CHECK(light_of(scene, floor_point(0, 0), 1 << 23) == doctest::Approx(lux * share).epsilon(1e-3));
  }
}

TEST_CASE(
    "reference: a lamp whose intensity is given sends it, whatever its shape; others' faces block it, its own not") {
  NightScene scene = floor_scene();
  Emitter e;
  e.profile = EmissionProfile::street_luminaire;
  e.centre_m = {0, -8, 0};
  e.half_u_m = {0.05F, 0, 0};
  e.half_v_m = {0, 0, 0.05F};
  e.axis = {0, 1, 0};
  e.up = {0, 0, 1};
  e.mark = 7;
  // 10 klm send .693 of their peak straight down (road_luminaire.hpp, whose flux is a quadrature's): 38 lx at 8 m.
  scene.lamps = {lamp_of(e, Vec3f{1, 1, 1} * peak_intensity_cd(e.profile, 10000, 0))};
  const double down = 10000 / (0.998 * 4.034808 / 1.44336 + 4 * kPi * 0.002) * 0.69317;
  const double share = 0.5 / kPi;
  CHECK(light_of(scene, floor_point(0, 0), 1 << 14) == doctest::Approx(down / 64 * share).epsilon(2e-3));
  // A plate below it: part of the lamp, of another one, of none.
  scene.vertices.insert(scene.vertices.end(), {{-1, -7, -1}, {1, -7, -1}, {1, -7, 1}, {-1, -7, 1}});
  scene.faces.insert(scene.faces.end(), {{4, 5, 6}, {4, 6, 7}});
  scene.face_material.resize(4, 0);
  scene.face_lamp = {0, 0, 7, 7};
  CHECK(light_of(scene, floor_point(0, 0), 1 << 14) == doctest::Approx(down / 64 * share).epsilon(2e-3));
  scene.face_lamp = {0, 0, 8, 8};
  CHECK(light_of(scene, floor_point(0, 0), 1 << 10) == 0);
  scene.face_lamp.clear();
  CHECK(light_of(scene, floor_point(0, 0), 1 << 10) == 0);
  CHECK(light_of(floor_scene(), floor_point(0, 0), 16) == 0);  // no lamp at all
  // A plate over one half of a wide lamp's sight leaves the other.
  e.half_u_m = {0.5F, 0, 0};
  scene.lamps = {lamp_of(e, {100, 100, 100})};
  scene.vertices[4].x = scene.vertices[7].x = 0;
  const double half = light_of(scene, floor_point(0, 0), 1 << 16);
  scene.faces.resize(2);
  scene.face_material.resize(2);
  CHECK(half == doctest::Approx(0.5 * light_of(scene, floor_point(0, 0), 1 << 16)).epsilon(0.02));
}

TEST_CASE("reference: in a uniform sky a surface reflects what its model says") {
  NightScene scene = floor_scene();
  scene.matt = false;
  scene.faces.clear();
  scene.sky.zenith_cd_m2 = scene.sky.horizon_cd_m2 = scene.sky.below_cd_m2 = {kWhite, kWhite, kWhite};
  for (const double alpha : {0.1, 0.3, 0.8}) {
    for (const double cosine : {0.15, 0.5, 0.95}) {
      ViewedPoint point = floor_point(0, 0);
      point.at.alpha = alpha;
      point.to_eye = {std::sqrt(1 - cosine * cosine), -cosine, 0};
      // The hemisphere in fine steps, finer about the mirror of the sight where the lobe is.
      const RoughDielectric material = scene.material(point.at);
      constexpr int kSteps = 1200;
      double expected = 0;
      for (int i = 0; i < kSteps; ++i) {
        const double z = (i + 0.5) / kSteps;
        const double r = std::sqrt(1 - z * z);
        double ring = 0;
        for (int j = 0; j < kSteps; ++j) {
          const double a = 2 * kPi * (j + 0.5) / kSteps;
          ring += luminance_of(material.eval({0, -1, 0}, point.to_eye, {r * std::cos(a), -z, r * std::sin(a)}));
        }
        expected += ring * z * 2 * kPi / kSteps / kSteps;
      }
      CHECK(light_of(scene, point, 1 << 16, 1) == doctest::Approx(expected).epsilon(5e-3));
      CHECK(expected < 1);
    }
  }
}

TEST_CASE("reference: a white furnace stays white through many reflections") {
  // A sphere, open at one side, all white in a white sky: whatever is looked at shows the sky's luminance.
  NightScene scene = sphere_scene(2, 2, 1);
  for (std::size_t f = scene.faces.size(); f-- > 0;) {
    if (scene.vertices[scene.faces[f].a].z > 1) {
      scene.faces.erase(scene.faces.begin() + static_cast<std::ptrdiff_t>(f));
      scene.face_material.pop_back();
    }
  }
  scene.sky.zenith_cd_m2 = scene.sky.horizon_cd_m2 = scene.sky.below_cd_m2 = {kWhite, kWhite, kWhite};
  const TriangleTree tree(scene.mesh());
  HitD hit;
  const RayD ray{{0.1, 0.2, 0}, normalized(Vec3d{0.3, 0.1, -1})};
  REQUIRE(tree.closest(ray, hit));
  ViewedPoint point;
  point.surface = surface_at(scene, ray, hit, point.at);
  point.to_eye = -ray.direction;
  CHECK(light_of(scene, point, 1 << 16, 64) == doctest::Approx(kWhite).epsilon(5e-3));
}

TEST_CASE("reference: in a sphere all light that walls return is even and sums up as a geometric row") {
  // Integrating sphere: a lamp in the middle, E_direct = I / R^2, and with all reflections E_direct / (1 - albedo).
  NightScene scene = sphere_scene(4, 3, 0.6F);
  Lamp lamp;
  lamp.set_sphere({0, 0, 0}, 0.05);
  lamp.luminance_cd_m2 = 1000;
  scene.lamps = {lamp};
  const double intensity = 1000 * kPi * 0.05 * 0.05;
  const TriangleTree tree(scene.mesh());
  HitD hit;
  const RayD ray{{}, normalized(Vec3d{0.3, 0.1, -1})};
  REQUIRE(tree.closest(ray, hit));
  ViewedPoint point;
  point.surface = surface_at(scene, ray, hit, point.at);
  point.to_eye = -ray.direction;
  const double once = intensity / 9 * 0.6 / kPi;
  CHECK(light_of(scene, point, 1 << 17, 2) == doctest::Approx(once * (1 + 0.6 + 0.36)).epsilon(5e-3));
  CHECK(light_of(scene, point, 1 << 17, 40) == doctest::Approx(once / 0.4).epsilon(5e-3));
}

namespace {

// A floor under two lamps, one half hidden by a plate, with walls: noise of every kind.
NightScene mixed_scene() {
  NightScene scene = floor_scene();
  scene.matt = false;
  scene.vertices.insert(
      scene.vertices.end(),
      {{-1, -1, -1}, {1, -1, -1}, {1, -1, 1}, {-1, -1, 1}, {-3, 0, 3}, {3, 0, 3}, {3, -4, 3}, {-3, -4, 3}});
  scene.faces.insert(scene.faces.end(), {{4, 5, 6}, {4, 6, 7}, {8, 9, 10}, {8, 10, 11}});
  scene.face_material.resize(6, 0);
  Lamp window;
  window.set_parallelogram({0, -3, -2}, {1, 0, 0}, {0, 0.5, 0});
  window.luminance_cd_m2 = 30;
  Lamp head;
  head.profile = EmissionProfile::signal;
  head.axis = {0, 1, 0};
  head.centre = {0.3, -4, 0.4};
  head.peak_cd = 50;
  scene.lamps = {window, head};
  SkyParams sky;
  scene.sky = Sky(sky);
  return scene;
}

}  // namespace

TEST_CASE("reference: the same bits for any number of threads and any interruption") {
  const NightScene scene = mixed_scene();
  const TriangleTree tree(scene.mesh());
  std::vector<ViewedPoint> seen;
  for (int i = 0; i < 300; ++i) seen.push_back(floor_point(0.02 * i - 3, 0.3));
  PathParams params;
  const PathTracer<TriangleTree> tracer(params, scene, tree);
  const auto go_on = [] { return false; };
  SerialExecutor serial;
  std::vector<PixelSums> whole(seen.size());
  add_samples(tracer, seen, 0, 96, whole, serial, go_on);
  ThreadPool pool(3);
  std::vector<PixelSums> parts(seen.size());
  add_samples(tracer, seen, 0, 16, parts, pool, go_on);
  npsim_test::BackwardExecutor backward;
  add_samples(tracer, seen, 16, 64, parts, backward, go_on);
  add_samples(tracer, seen, 64, 96, parts, pool, go_on);
  std::size_t different = 0;
  double sum = 0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    different +=
        whole[i].light == parts[i].light && whole[i].direct == parts[i].direct && whole[i].squared == parts[i].squared
            ? 0U
            : 1U;
    sum += luminance_of(whole[i].light);
  }
  CHECK(different == 0);
  CHECK(sum > 0);
  params.seed = 1;
  const std::vector<PixelSums> other = trace_night(params, scene, tree, seen, 96, serial);
  CHECK(other[7].light != whole[7].light);
}

TEST_CASE("reference: the stated error is the error") {
  const NightScene scene = mixed_scene();
  const TriangleTree tree(scene.mesh());
  SerialExecutor serial;
  // One point, many times, each with random numbers of its own.
  const std::vector<ViewedPoint> seen(400, floor_point(0.9, 0.5));
  constexpr std::uint64_t kSamples = 512;
  const std::vector<PixelSums> sums = trace_night(PathParams{}, scene, tree, seen, kSamples, serial);
  double mean = 0;
  for (const PixelSums& s : sums) mean += luminance_of(s.light) / kSamples / static_cast<double>(seen.size());
  double scatter = 0;
  double stated = 0;
  for (const PixelSums& s : sums) {
    scatter += std::pow(luminance_of(s.light) / kSamples - mean, 2);
    stated += std::pow(standard_error(s, kSamples), 2);
  }
  CHECK(std::sqrt(scatter / stated) == doctest::Approx(1).epsilon(0.12));
  CHECK(std::isinf(standard_error(sums[0], kBlock)));
}

TEST_CASE("reference: materials and normals of vertices are interpolated, and the back of a sheet is black") {
  NightScene scene = floor_scene();
  scene.face_material.clear();
  scene.materials = {{{0, 0, 0}, 0.2F}, {{1, 1, 1}, 0.4F}, {{1, 1, 1}, 0.4F}, {{0, 0, 0}, 0.2F}};
  scene.vertex_normals.assign(4, Vec3f{0, -1, 0});
  const TriangleTree tree(scene.mesh());
  const auto seen = viewed_points(scene, tree, Intrinsics{10, 10, 5, -4}, Shape{10, 4});
  CHECK(!seen[0].surface);  // the camera lies in the floor
  const auto look = [&](const Vec3d& from, const Vec3d& to, SurfaceSample& at) {
    const RayD ray{from, normalized(to - from)};
    HitD hit;
    REQUIRE(tree.closest(ray, hit));
    return surface_at(scene, ray, hit, at);
  };
  SurfaceSample at;
  REQUIRE(look({0, -2, 0}, {25, 0, 3}, at));
  CHECK(at.albedo.x == doctest::Approx(0.75));
  CHECK(at.alpha == doctest::Approx(0.35));
  CHECK(at.normal == Vec3d{0, -1, 0});
  CHECK(!look({0, 2, 0}, {25, 0, 3}, at));
  scene.vertex_normals.clear();
  REQUIRE(look({0, 2, 0}, {25, 0, 3}, at));
  CHECK(at.normal == Vec3d{0, 1, 0});
}

TEST_CASE("reference: from the renderer's own points and small lamps comes the renderer's direct light") {
  // A rough floor whose vertices are the points, nothing in the way.
  std::vector<Vec3f> position, normal, albedo;
  std::vector<float> alpha;
  std::vector<Face> faces;
  constexpr std::uint32_t kSide = 8;
  for (std::uint32_t j = 0; j < kSide; ++j) {
    for (std::uint32_t i = 0; i < kSide; ++i) {
      const auto x = static_cast<float>(i);
      const auto z = static_cast<float>(j);
      position.push_back({x - 4, 1.4F, 3 + 2 * z});
      normal.push_back({0, -1, 0});
      albedo.push_back({0.1F + 0.05F * x, 0.3F, 0.5F});
      alpha.push_back(0.3F + 0.05F * z);
      if (i + 1 == kSide || j + 1 == kSide) continue;
      const std::uint32_t a = j * kSide + i;
      faces.insert(faces.end(), {{a, a + 1, a + kSide + 1}, {a, a + kSide + 1, a + kSide}});
    }
  }
  std::vector<Emitter> emitters;
  std::vector<Activation> lit;
  for (const EmissionProfile profile : {EmissionProfile::lambert, EmissionProfile::signal,
                                        EmissionProfile::street_luminaire, EmissionProfile::low_beam}) {
    Emitter e;
    e.profile = profile;
    e.centre_m = {1.5F * static_cast<float>(emitters.size()) - 2, -1, 20};
    e.half_u_m = {0.01F, 0, 0};
    e.half_v_m = {0, 0.01F, 0};
    e.axis = profile == EmissionProfile::street_luminaire ? Vec3f{0, 1, 0} : Vec3f{0, 0, -1};
    e.up = profile == EmissionProfile::street_luminaire ? Vec3f{0, 0, 1} : Vec3f{0, -1, 0};
    e.area_m2 = 4e-4F;
    emitters.push_back(e);
    lit.push_back(make_activation(e, profile != EmissionProfile::signal, 1, 500, {0.4F, 0.4F}));
  }
  // One beside the camera, whose light signs, paint and stones send back.
  Emitter beside = emitters[1];
  beside.centre_m = {0.3F, 0.4F, 0.5F};
  beside.axis = {0, 0, 1};
  emitters.push_back(beside);
  lit.push_back(make_activation(beside, true, 1, 500, {0.4F, 0.4F}));
  std::vector<Retroreflector> retro;
  for (std::size_t p = 0; p < position.size(); ++p) {
    constexpr RetroKind kKinds[] = {RetroKind::none, RetroKind::sheeting, RetroKind::beads, RetroKind::grain};
    retro.push_back({p % 2 == 0 ? 0.3F : 500.0F, kKinds[p % 4]});
  }
  const Span<const Emitter> lamps(emitters.data(), emitters.size());
  const Span<const Activation> activations(lit.data(), lit.size());
  const Span<const Vec3f> positions(position.data(), position.size());
  const std::vector<float> lift(position.size(), 0.0F);
  SurfacePoints points;
  points.position = positions;
  points.normal = {normal.data(), normal.size()};
  points.albedo = {albedo.data(), albedo.size()};
  points.alpha = {alpha.data(), alpha.size()};
  points.lift_m = {lift.data(), lift.size()};
  points.retro = {retro.data(), retro.size()};
  std::vector<Vec3f> luminance_out(points.size());
  SerialExecutor serial;
  for (std::size_t p = 0; p < points.size(); ++p) {
    for (std::size_t e = 0; e < lamps.size(); ++e) {
      luminance_out[p] += activations[e].intensity_cd * npsim_test::free_light(points, p, lamps[e], 0.04F);
    }
  }
  const TriangleMeshView mesh{positions, {faces.data(), faces.size()}};
  const NightScene scene =
      scene_of_points(mesh, points.normal, points.albedo, points.alpha, {}, lamps, activations, SkyParams{}, 0.04F);
  CHECK(scene.lamps.size() == 4);
  const TriangleTree tree(scene.mesh());
  std::vector<ViewedPoint> seen;
  for (const Vec3f& p : position) {
    const Vec3d inwards = Vec3d{0, 1.4, 10} - vec_cast<double>(p);  // points at the rim are not missed
    const Vec3d at = vec_cast<double>(p) + inwards * 1e-9;
    HitD hit;
    ViewedPoint point;
    const RayD ray{at - Vec3d{0, 1, 0}, {0, 1, 0}};
    REQUIRE(tree.closest(ray, hit));
    point.surface = surface_at(scene, ray, hit, point.at);
    point.to_eye = normalized(-at);
    point.at.retro = retro[seen.size()];
    seen.push_back(point);
  }
  PathParams params;
  params.bounces = 0;
  const std::vector<PixelSums> sums = trace_night(params, scene, tree, seen, 256, serial);
  for (std::size_t p = 0; p < seen.size(); ++p) {
    const Vec3d ours = sums[p].light / 256.0;
    const Vec3d theirs = vec_cast<double>(luminance_out[p]);
    CHECK(length(ours - theirs) < 0.01 * length(theirs) + 4 * standard_error(sums[p], 256));
  }
}
