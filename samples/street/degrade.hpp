// SPDX-License-Identifier: Apache-2.0
// Turns exact depth and normals into what a monocular network would give for the photograph.
//
// Depth: Gaussian blur of its logarithm (mixes across edges), a global factor, a smooth field of factors, correlated
// noise, and a sky at finite depth. Normals: blur, correlated noise, one tilted region of road, and a wrong sky.
// Invariant: a strength of 0 leaves its part out entirely, so that all zero returns the exact planes, bit by bit.
#ifndef NPSIM_SAMPLES_STREET_DEGRADE_HPP
#define NPSIM_SAMPLES_STREET_DEGRADE_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "dice.hpp"
#include "npsim/core/camera.hpp"
#include "params.hpp"

namespace npsim {
namespace street {

// Separable Gaussian over the pixels where weight is 1; others neither give nor take. Rows, then columns.
template <class T, class Executor>
void blur_weighted(io::Image<T>& image, const io::Image<float>& weight, float sigma, Executor& executor) {
  const int radius = static_cast<int>(std::ceil(2.5F * sigma));
  if (radius < 1) return;
  std::vector<float> kernel(static_cast<std::size_t>(radius) + 1U);
  for (std::size_t i = 0; i < kernel.size(); ++i) {
    const float q = static_cast<float>(i) / sigma;
    kernel[i] = std::exp(-0.5F * q * q);
  }
  for (const int axis : {0, 1}) {
    const io::Image<T> source = image;
    executor.for_chunks(static_cast<std::size_t>(image.height()), 8, [&](std::size_t begin, std::size_t end) {
      for (std::size_t row = begin; row < end; ++row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < image.width(); ++x) {
          if (!(weight(x, y) > 0)) continue;
          T sum{};
          float total = 0;
          for (int d = -radius; d <= radius; ++d) {
            const int u = axis == 0 ? x + d : x;
            const int v = axis == 0 ? y : y + d;
            if (!image.view().contains(u, v) || !(weight(u, v) > 0)) continue;
            const float w = kernel[static_cast<std::size_t>(d < 0 ? -d : d)];
            sum += source(u, v) * w;
            total += w;
          }
          image(x, y) = sum / total;
        }
      }
    });
  }
}

template <class Executor>
void degrade_depth(Street& street, Executor& executor) {
  const Degradation& g = street.params.degradation;
  const Shape shape = street.params.shape;
  street.est_depth = street.depth;
  const std::uint32_t seed = static_cast<std::uint32_t>(street.params.seed) * 2654435761U;
  Dice dice(street.params.seed, Topic::degrade, 0);
  const float scale_draw = dice.uniform(-1, 1);
  const float sky_draw = dice.uniform();
  const float per_px = 1.0F / static_cast<float>(shape.width);
  const auto each = [&](const auto& f) {
    executor.for_chunks(static_cast<std::size_t>(shape.height), 8, [&](std::size_t begin, std::size_t end) {
      for (std::size_t row = begin; row < end; ++row) {
        for (int x = 0; x < shape.width; ++x) f(x, static_cast<int>(row), street.est_depth(x, static_cast<int>(row)));
      }
    });
  };
  if (g.sky_error > 0) {
    each([&](int x, int y, float& z) {
      if (z > 0) return;
      const float u = static_cast<float>(x) * per_px;
      const float v = static_cast<float>(y) * per_px;
      const float ramp = clamp01(0.5F + (sky_draw - 0.5F) * 0.6F + 0.5F * (v * 2 - 0.3F) +
                                 0.35F * (noise(u * 4, v * 4, seed + 1) - 0.5F));
      z = 75.0F + g.sky_error * (30.0F * ramp - 15.0F);
    });
  }
  if (g.edge_smear > 0) {
    io::Image<float> weight(shape);
    each([&](int x, int y, float& z) {
      weight(x, y) = z > 0 ? 1.0F : 0.0F;
      if (z > 0) z = std::log(z);
    });
    blur_weighted(street.est_depth, weight, std::fmax(0.6F, g.edge_smear * 0.0025F * static_cast<float>(shape.width)),
                  executor);
    each([&](int x, int y, float& z) {
      if (weight(x, y) > 0) z = std::exp(z);
    });
  }
  if (g.scale_error > 0) {
    const float factor = std::exp(0.06F * g.scale_error * scale_draw);
    each([&](int, int, float& z) { z *= factor; });
  }
  if (g.field_error > 0) {
    each([&](int x, int y, float& z) {
      const float u = static_cast<float>(x) * per_px;
      const float v = static_cast<float>(y) * per_px;
      const float broad = noise(u * 3.1F, v * 3.1F, seed + 2) - 0.5F;
      const float middle = noise(u * 11.0F, v * 11.0F, seed + 3) - 0.5F;
      z *= std::exp(g.field_error * (0.13F * broad + 0.05F * middle));
    });
  }
  if (g.noise > 0) {
    each([&](int x, int y, float& z) {
      const float px = static_cast<float>(x);
      const float py = static_cast<float>(y);
      const float n = noise(px / 3.1F, py / 3.1F, seed + 4) + 0.6F * noise(px / 1.4F, py / 1.4F, seed + 5) - 0.8F;
      z *= std::exp(0.02F * g.noise * n);
    });
  }
}

template <class Executor>
void degrade_normals(Street& street, Executor& executor) {
  const Degradation& g = street.params.degradation;
  const Shape shape = street.params.shape;
  street.est_normals = street.normals;
  const std::uint32_t seed = static_cast<std::uint32_t>(street.params.seed) * 2654435761U + 77U;
  Dice dice(street.params.seed, Topic::degrade, 1);
  const float per_px = 1.0F / static_cast<float>(shape.width);
  // Where the road is misjudged: a patch in front of the car.
  const Vec2f patch{dice.uniform(-2.5F, 2.5F), dice.uniform(6, 12)};
  const float angle = dice.uniform(0, 2 * kPi);
  const Vec3f tilt{std::cos(angle), 0, std::sin(angle)};
  const auto each = [&](const auto& f) {
    executor.for_chunks(static_cast<std::size_t>(shape.height), 8, [&](std::size_t begin, std::size_t end) {
      for (std::size_t row = begin; row < end; ++row) {
        for (int x = 0; x < shape.width; ++x) f(x, static_cast<int>(row), street.est_normals(x, static_cast<int>(row)));
      }
    });
  };
  // Whatever was done to it, a normal has to face the camera and be of unit length.
  const auto finish = [&](int x, int y, const Vec3f& n) {
    const Vec3f ray = normalized(unproject_pixel(street.intrinsics, x, y, 1.0F));
    Vec3f m = normalized(n);
    const float towards = dot(m, ray);
    if (towards > -0.02F) m = normalized(m - ray * (towards + 0.03F));
    return m;
  };
  if (g.normal_sky > 0) {
    each([&](int x, int y, Vec3f& n) {
      if (street.labels(x, y) != label::sky) return;
      const float u = static_cast<float>(x) * per_px;
      const float v = static_cast<float>(y) * per_px;
      const Vec3f bias{noise(u * 3, v * 3, seed) - 0.5F, 0.55F + 0.5F * (noise(u * 3, v * 3, seed + 1) - 0.5F), 0};
      n = finish(x, y, n + bias * g.normal_sky);
    });
  }
  if (g.normal_road > 0) {
    each([&](int x, int y, Vec3f& n) {
      if (street.labels(x, y) != label::road) return;
      const Vec3f p = unproject_pixel(street.intrinsics, x, y, street.depth(x, y));
      const float q = (p.x - patch.x) * (p.x - patch.x) / 4.0F + (p.z - patch.y) * (p.z - patch.y) / 9.0F;
      if (q < 1) n = finish(x, y, n + tilt * (0.36F * g.normal_road * smoothstep(0, 0.5F, 1 - q)));
    });
  }
  if (g.normal_blur > 0) {
    io::Image<float> weight(shape, 1.0F);
    if (!(g.normal_sky > 0)) {
      for (int y = 0; y < shape.height; ++y) {
        for (int x = 0; x < shape.width; ++x) weight(x, y) = street.labels(x, y) == label::sky ? 0.0F : 1.0F;
      }
    }
    blur_weighted(street.est_normals, weight, std::fmax(0.6F, g.normal_blur * 0.002F * static_cast<float>(shape.width)),
                  executor);
    each([&](int x, int y, Vec3f& n) {
      if (weight(x, y) > 0) n = finish(x, y, n);
    });
  }
  if (g.normal_noise > 0) {
    each([&](int x, int y, Vec3f& n) {
      if (street.labels(x, y) == label::sky && !(g.normal_sky > 0)) return;
      const float px = static_cast<float>(x) / 5.0F;
      const float py = static_cast<float>(y) / 5.0F;
      const Vec3f e{noise(px, py, seed + 2) - 0.5F, noise(px, py, seed + 3) - 0.5F, noise(px, py, seed + 4) - 0.5F};
      n = finish(x, y, n + e * (0.28F * g.normal_noise));
    });
  }
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_DEGRADE_HPP
