// SPDX-License-Identifier: Apache-2.0
// The true night: a path tracer in double precision, written to be right and read, not to be fast.
//
// The light that a point sends to the eye is the integral of f L cos over what it sees. Each sample of a pixel is a
// path from the point that the pixel's centre shows: at each point of it one lamp is asked, one point on its true
// shape, one shadow ray (next-event estimation; Kajiya 1986); then the path goes on in a direction drawn in proportion
// to the reflection. A path ends after `bounces` reflections beyond the first surface, or in the sky, whose light it
// brings.
// Lamps are met by shadow rays alone and the sky by paths alone, so nothing counts twice.
//   L = lamps, reflected once (direct) + lamps and sky by way of up to `bounces` further points (sky: that many rays)
// A number of bounces leaves out the light of longer paths and adds nothing; all else is exact in the mean.
// Samples come in blocks of kBlock, over which the first lamp and the first direction are spread evenly. Blocks are
// independent of each other, so the scatter of their means gives the standard error of a pixel's luminance.
// Random numbers are a function of seed, pixel and sample, and a pixel's samples are added up one after the other: the
// same bits for any number of threads, and for any interruption.
// Rays: anything with closest(RayD, HitD&) and occluded(RayD, blocks), such as TriangleTree.
#ifndef NPSIM_TESTS_REFERENCE_PATH_TRACER_HPP
#define NPSIM_TESTS_REFERENCE_PATH_TRACER_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "lamp_choice.hpp"
#include "night_scene.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/random.hpp"
#include "rough_dielectric.hpp"
#include "triangle_tree.hpp"

namespace npsim::reference {

inline constexpr std::uint64_t kBlock = 16;  // a square

struct PathParams {
  std::uint64_t seed = 0;
  int bounces = 2;
  // From this bounce on a path goes on with the probability of its greatest weight, and weighs more if it does.
  int roulette_from = 4;
};

// What a pixel shows: a surface, looked at from `to_eye`; or none.
struct ViewedPoint {
  bool surface = false;
  std::uint32_t face = kNothing;
  SurfaceSample at;
  Vec3d to_eye;  // unit
};

// What the centres of the pixels show, row by row, to a camera at the origin. A caller who knows better (whose planes
// say what each pixel's material is, whose rays start elsewhere) changes the points, or makes his own.
template <class Rays>
[[nodiscard]] std::vector<ViewedPoint> viewed_points(const NightScene& scene, const Rays& rays,
                                                     const Intrinsics& camera, Shape shape) {
  std::vector<ViewedPoint> points(shape.pixels());
  auto point = points.begin();
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x, ++point) {
      const RayD ray{{}, normalized(vec_cast<double>(unproject_pixel(camera, x, y, 1.0F)))};
      HitD hit;
      point->to_eye = -ray.direction;
      if (!rays.closest(ray, hit)) continue;
      point->face = hit.face;
      point->surface = surface_at(scene, ray, hit, point->at);
    }
  }
  return points;
}

// Sums over the samples of a pixel, in cd/m2.
struct PixelSums {
  Vec3d light;
  Vec3d direct;        // of the lamps, reflected once
  double squared = 0;  // of the blocks' mean luminances
};

// Of the mean luminance of a pixel after so many samples; infinite before the second block.
[[nodiscard]] inline double standard_error(const PixelSums& sums, std::uint64_t samples) {
  if (samples < 2 * kBlock) return std::numeric_limits<double>::infinity();
  const auto blocks = static_cast<double>(samples / kBlock);
  const double mean = luminance_of(sums.light) / static_cast<double>(samples);
  return std::sqrt(std::max(sums.squared / blocks - mean * mean, 0.0) / (blocks - 1));
}

template <class Rays>
class PathTracer {
 public:
  // Both have to outlive it.
  PathTracer(const PathParams& params, const NightScene& scene, const Rays& rays)
      : params_(params), scene_(scene), rays_(rays), grid_(scene) {}

  // Adds samples [first, last) of a pixel: whole blocks, at most 2^24 samples in all.
  void add_samples(const ViewedPoint& seen, std::uint32_t pixel, std::uint64_t first, std::uint64_t last,
                   LampsOfPoint& lamps, PixelSums& sums) const {
    if (!seen.surface) return;
    const RoughDielectric material = scene_.material(seen.at);
    lamps.estimate(scene_.lamps, seen.at, material, seen.to_eye);
    for (std::uint64_t block = first; block < last; block += kBlock) {
      Vec3d light;
      for (std::uint64_t i = 0; i < kBlock; ++i) {
        Random random(params_.seed, pixel, block + i);
        const double which = (static_cast<double>(i) + random.next()) / static_cast<double>(kBlock);
        const Vec3d direct = lit_by(lamps.choose(which), seen.at, material, seen.to_eye, random);
        light += direct + indirect(seen, material, i, random);
        sums.direct += direct;
      }
      const double luminance = luminance_of(light) / static_cast<double>(kBlock);
      sums.light += light;
      sums.squared += luminance * luminance;
    }
  }

 private:
  // Numbers in (0, 1), 2^-32 apart.
  class Random {
   public:
    Random(std::uint64_t seed, std::uint32_t pixel, std::uint64_t sample)
        : stream_(seed, RandomPurpose::test, 0, 0, pixel, static_cast<std::uint32_t>(sample)) {}
    double next() { return (static_cast<double>(stream_.next_u32()) + 0.5) * 0x1p-32; }

   private:
    RandomStream stream_;
  };

  // A point just off the surface, on the side that the direction leads to.
  [[nodiscard]] Vec3d start(const SurfaceSample& at, const Vec3d& direction) const {
    return at.position + at.geometric * std::copysign(scene_.clearance_m, dot(at.geometric, direction));
  }

  // Light of the chosen lamp that the point sends towards wo, divided by the choice's probability.
  [[nodiscard]] Vec3d lit_by(const LampChoice& choice, const SurfaceSample& at, const RoughDielectric& material,
                             const Vec3d& wo, Random& random) const {
    const double pick = random.next();
    const double u = random.next();
    const double v = random.next();
    if (!(choice.probability > 0)) return {};
    const Lamp& lamp = scene_.lamps[choice.lamp];
    if (lamp.faces != 0 && lamp.faces == at.lamp) return {};
    const Lamp::Point from = lamp.sample(pick, u, v);
    const Vec3d delta = from.position - at.position;
    const double squared = dot(delta, delta);
    const double distance = std::sqrt(squared);
    if (!(distance > 2 * scene_.clearance_m)) return {};
    const Vec3d wi = delta / distance;
    const double cosine = dot(at.normal, wi);
    if (!(cosine > 0)) return {};
    const double intensity = lamp.intensity_cd(from, -wi);
    if (!(intensity > 0)) return {};
    const Vec3d origin = start(at, wi);
    const Vec3d to_lamp = from.position - origin;
    const double length_m = length(to_lamp);
    const RayD ray{origin, to_lamp / length_m, length_m - scene_.clearance_m};
    const auto blocks = [&](std::uint32_t face) { return lamp.faces == 0 || scene_.lamp_of_face(face) != lamp.faces; };
    if (rays_.occluded(ray, blocks)) return {};
    const double lux = intensity * cosine / (squared * choice.probability);
    return (material.eval(at.normal, wo, wi) + at.retroreflected(wo, wi) / cosine) * lamp.colour * lux;
  }

  // What comes by way of other surfaces, and from the sky; `of_block`: which sample of its block this is.
  [[nodiscard]] Vec3d indirect(const ViewedPoint& seen, RoughDielectric material, std::uint64_t of_block,
                               Random& random) const {
    constexpr double kSide = 4;
    static_assert(kBlock == 16, "the square of the side");
    Vec3d sum;
    Vec3d weight{1, 1, 1};
    SurfaceSample at = seen.at;
    Vec3d wo = seen.to_eye;
    for (int bounce = 1; bounce <= params_.bounces; ++bounce) {
      const double which = random.next();
      double u = random.next();
      double v = random.next();
      if (bounce == 1) {
        u = (static_cast<double>(of_block / 4) + u) / kSide;
        v = (static_cast<double>(of_block % 4) + v) / kSide;
      }
      RayD ray;
      Vec3d share;
      if (!material.sample(at.normal, wo, which, u, v, ray.direction, share)) break;
      weight = weight * share;
      ray.origin = start(at, ray.direction);
      HitD hit;
      if (!rays_.closest(ray, hit)) {
        sum += weight * scene_.sky.luminance(ray.direction);
        break;
      }
      if (!surface_at(scene_, ray, hit, at)) break;
      material = scene_.material(at);
      wo = -ray.direction;
      sum += weight * lit_by(grid_.choose(at.position, random.next()), at, material, wo, random);
      if (bounce >= params_.roulette_from) {
        const double survive = std::min(std::max({weight.x, weight.y, weight.z}), 0.95);
        if (!(random.next() < survive)) break;
        weight = weight / survive;
      }
    }
    return sum;
  }

  PathParams params_;
  const NightScene& scene_;
  const Rays& rays_;
  LampGrid grid_;
};

// Adds samples [first, last), whole blocks, of every pixel. `cancelled` is asked before each chunk, which is then left
// out: sums that a cancelled call has touched are of no use.
template <class Rays, class Executor, class Cancelled>
void add_samples(const PathTracer<Rays>& tracer, const std::vector<ViewedPoint>& seen, std::uint64_t first,
                 std::uint64_t last, std::vector<PixelSums>& sums, Executor& executor, Cancelled&& cancelled) {
  executor.for_chunks(seen.size(), 64, [&](std::size_t begin, std::size_t end) {
    if (cancelled()) return;
    LampsOfPoint lamps;
    for (std::size_t p = begin; p < end; ++p) {
      tracer.add_samples(seen[p], static_cast<std::uint32_t>(p), first, last, lamps, sums[p]);
    }
  });
}

// The sums of a whole night. A pixel's light is sums.light / samples, without what lamps and sky show themselves;
// samples: a multiple of kBlock.
template <class Rays, class Executor>
[[nodiscard]] std::vector<PixelSums> trace_night(const PathParams& params, const NightScene& scene, const Rays& rays,
                                                 const std::vector<ViewedPoint>& seen, std::uint64_t samples,
                                                 Executor& executor) {
  const PathTracer<Rays> tracer(params, scene, rays);
  std::vector<PixelSums> sums(seen.size());
  add_samples(tracer, seen, 0, samples, sums, executor, [] { return false; });
  return sums;
}

}  // namespace npsim::reference

#endif  // NPSIM_TESTS_REFERENCE_PATH_TRACER_HPP
