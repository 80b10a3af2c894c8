// SPDX-License-Identifier: Apache-2.0
// The reference path tracer with its own tree and with Embree 3 in its place: the same night.
//
// The two share everything but the intersections. With the same random numbers their paths are the same but where a
// float decides otherwise than a double, at edges; with others, their pictures differ by their noise, and by no more than it:
// within four standard errors of the difference on every pixel but one in a thousand.
#define DOCTEST_CONFIG_IMPLEMENT_WITH_MAIN
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "npsim/exec/thread_pool.hpp"
#include "npsim/light/photometry.hpp"
#include "npsim/material/roughness.hpp"
#include "rays/embree.hpp"
#include "reference/path_tracer.hpp"
#include "street/street.hpp"

namespace {

using namespace npsim;
using namespace npsim::reference;

// Embree as the path tracer's rays.
class EmbreeRays {
 public:
  explicit EmbreeRays(const TriangleMeshView& mesh) : embree_(mesh, true) { embree_.build(); }

  [[nodiscard]] bool closest(const RayD& ray, HitD& hit) const {
    const Hit found = embree_.closest(in_floats(ray, 0));
    hit = HitD{};
    if (found.face == kNoFace) return false;
    hit = {static_cast<double>(found.t), found.face, static_cast<double>(found.u), static_cast<double>(found.v)};
    return true;
  }
  // One hit after the other: the few that do not block are the lamp's own faces.
  template <class Blocks>
  [[nodiscard]] bool occluded(const RayD& ray, Blocks&& blocks) const {
    for (float from = 0;;) {
      const Hit hit = embree_.closest(in_floats(ray, from));
      if (hit.face == kNoFace) return false;
      if (blocks(hit.face)) return true;
      from = std::nextafter(hit.t, 1e30F);
    }
  }

 private:
  static Ray in_floats(const RayD& ray, float from) {
    Ray out;
    out.origin = vec_cast<float>(ray.origin);
    out.direction = vec_cast<float>(ray.direction);
    out.t_min = from;
    out.t_max = static_cast<float>(ray.t_max);
    return out;
  }

  bench::Embree embree_;
};

// A night of the street: its street lamps, every second window and sign, and the lamps of its vehicles.
NightScene night_of(const street::Street& street) {
  NightScene scene;
  scene.vertices = street.vertices;
  scene.faces = street.faces;
  for (const std::uint16_t m : street.face_material) scene.face_material.push_back(m);
  for (const street::MeshMaterial& m : street.materials) {
    scene.materials.push_back({m.albedo, alpha_of_roughness(m.roughness)});
  }
  scene.face_lamp = street.face_emitter;
  SkyParams sky;
  sky.up = street.ground_up;
  scene.sky = Sky(sky);
  std::vector<std::size_t> lamp_of(street.emitters.size() + 1, SIZE_MAX);
  for (std::size_t i = 0; i < street.emitters.size(); ++i) {
    const street::Emitter& e = street.emitters[i];
    if (e.mark == 0) continue;
    Lamp lamp;
    lamp.axis = normalized(vec_cast<double>(e.axis));
    lamp.up = normalized(vec_cast<double>(e.up));
    lamp.faces = static_cast<std::uint32_t>(i + 1);
    switch (e.cls) {
      case LightClass::street_light_ht:
      case LightClass::street_light_lt:
        lamp.profile = EmissionProfile::street_luminaire;
        lamp.peak_cd = 3000;
        break;
      case LightClass::moving_front:
        lamp.profile = EmissionProfile::low_beam;
        lamp.peak_cd = 20000;
        break;
      case LightClass::moving_rear:
      case LightClass::parked_rear:
      case LightClass::parked_front:
        lamp.profile = EmissionProfile::signal;
        lamp.peak_cd = 10;
        break;
      default:
        if (e.mark % 2 == 0) continue;
        lamp.luminance_cd_m2 = 30;
        break;
    }
    lamp_of[i + 1] = scene.lamps.size();
    scene.lamps.push_back(lamp);
  }
  for (std::size_t f = 0; f < scene.faces.size(); ++f) {
    const std::size_t lamp = lamp_of[scene.face_lamp[f]];
    if (lamp == SIZE_MAX) continue;
    const auto corner = [&](std::uint32_t v) { return vec_cast<double>(scene.vertices[v]); };
    scene.lamps[lamp].add_triangle(corner(scene.faces[f].a), corner(scene.faces[f].b), corner(scene.faces[f].c));
  }
  return scene;
}

}  // namespace

TEST_CASE("the reference's night is that of Embree's rays") {
  ThreadPool pool;
  street::StreetParams street_params;
  street_params.seed = 1;
  street_params.shape = {64, 36};
  street_params.samples = 1;
  street_params.sky_rays = 0;
  street::Street street;
  REQUIRE(street::make_street(street_params, pool, street).ok());
  const NightScene scene = night_of(street);
  REQUIRE(scene.lamps.size() > 5);
  const TriangleTree tree(scene.mesh());
  const EmbreeRays embree(scene.mesh());
  constexpr std::uint64_t kSamples = 512;
  const auto night = [&](const auto& rays, std::uint64_t seed, std::uint64_t samples) {
    PathParams params;
    params.seed = seed;
    const std::vector<ViewedPoint> seen = viewed_points(scene, rays, street.intrinsics, street_params.shape);
    return trace_night(params, scene, rays, seen, samples, pool);
  };
  const std::vector<PixelSums> ours = night(tree, 1, kSamples);
  const std::vector<PixelSums> theirs = night(embree, 2, kSamples);
  std::size_t lit = 0;
  std::size_t apart = 0;
  double sums[2] = {};
  double error = 0;
  for (std::size_t p = 0; p < ours.size(); ++p) {
    const double a = luminance_of(ours[p].light) / kSamples;
    const double b = luminance_of(theirs[p].light) / kSamples;
    const double both = std::hypot(standard_error(ours[p], kSamples), standard_error(theirs[p], kSamples));
    lit += a > 0 ? 1U : 0U;
    apart += std::fabs(a - b) > 4 * both ? 1U : 0U;
    if (std::fabs(a - b) > 4 * both) MESSAGE("pixel " << p << ": " << a << ", Embree " << b << ", error " << both);
    sums[0] += a;
    sums[1] += b;
    error += both * both;
  }
  CHECK(lit > ours.size() / 2);
  CHECK(apart <= ours.size() / 1000);
  CHECK(std::fabs(sums[0] - sums[1]) < 4 * std::sqrt(error));
  // The same random numbers.
  const std::vector<PixelSums> first = night(tree, 3, 32);
  const std::vector<PixelSums> second = night(embree, 3, 32);
  std::size_t same = 0;
  for (std::size_t p = 0; p < first.size(); ++p) {
    const double a = luminance_of(first[p].light);
    same += std::fabs(a - luminance_of(second[p].light)) <= 1e-3 * a ? 1U : 0U;
  }
  MESSAGE(same << " of " << first.size() << " pixels alike with the same random numbers, " << apart
               << " apart with others");
  CHECK(same > first.size() * 9 / 10);
}
