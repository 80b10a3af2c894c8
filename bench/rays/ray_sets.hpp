// SPDX-License-Identifier: Apache-2.0
// The rays that tracers are timed on: their camera, lamps and bounces, the same for every program.
#ifndef NPSIM_BENCH_RAYS_RAY_SETS_HPP
#define NPSIM_BENCH_RAYS_RAY_SETS_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "npsim/core/camera.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim::bench {

struct RaySet {
  const char* name;
  bool any;  // any hit, else the closest
  std::vector<Ray> rays;
};

inline constexpr std::uint32_t kLampCount = 30;

// Lamp `l` of a street, on alternate sides, 3 m apart.
[[nodiscard]] inline Vec3f street_lamp(std::uint32_t l) {
  RandomStream r(2, RandomPurpose::test, 0, l, 0, 0);
  const float z = 4.0F + 3.0F * static_cast<float>(l);
  return {(l % 2 == 0 ? 1.0F : -1.0F) * r.uniform(3.0F, 7.0F), -r.uniform(3.5F, 5.0F), z};
}

// About `count` rays from `eye` through a random point of each pixel: whole rows, so that neighbours follow each other,
// evenly spread over the picture.
[[nodiscard]] inline std::vector<Ray> camera_rays(const Intrinsics& intrinsics, Shape picture, const Vec3f& eye,
                                                  std::size_t count) {
  std::vector<Ray> rays;
  const auto width = static_cast<std::size_t>(picture.width);
  const std::size_t step = std::max<std::size_t>(1, picture.pixels() / std::max<std::size_t>(count, 1));
  for (std::size_t i = 0; i / width * step < static_cast<std::size_t>(picture.height); ++i) {
    const auto pixel = static_cast<std::uint32_t>(i / width * step * width + i % width);
    RandomStream r(1, RandomPurpose::test, 0, 0, pixel, 0);
    const float u = static_cast<float>(pixel % static_cast<std::uint32_t>(width)) + r.uniform();
    const float v = static_cast<float>(pixel / static_cast<std::uint32_t>(width)) + r.uniform();
    rays.push_back({eye, normalized(unproject(intrinsics, u, v, 1.0F))});
  }
  return rays;
}

// Of bounce `i`, distributed as the cosine to the normal.
[[nodiscard]] inline Vec3f bounce_direction(std::size_t i, const Vec3f& normal) {
  RandomStream r(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(i), 0);
  Vec3f d;
  do {
    const float x = r.uniform(-1.0F, 1.0F);
    const float y = r.uniform(-1.0F, 1.0F);
    d = {x, y, r.uniform(-1.0F, 1.0F)};
  } while (dot(d, d) > 1.0F || dot(d, d) < 1e-3F);
  return normalized(normalized(d) + normal * 1.0001F);
}

[[nodiscard]] inline std::vector<Ray> shuffled(std::vector<Ray> rays) {
  for (std::size_t i = rays.size(); i > 1; --i) {
    RandomStream r(4, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(i), 0);
    std::swap(rays[i - 1], rays[r.next_u32() % i]);
  }
  return rays;
}

}  // namespace npsim::bench

#endif  // NPSIM_BENCH_RAYS_RAY_SETS_HPP
