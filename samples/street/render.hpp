// SPDX-License-Identifier: Apache-2.0
// Takes the daytime photograph and the exact planes of a built street by ray casting.
//
// Sky light is smoothed across neighbours on the same surface, so that a few rays a pixel suffice; then exposure, lens
// falloff, sensor noise and tone curve. Every pixel is a function of its own coordinates (the smoothing: of a fixed
// neighbourhood of the finished first pass): rows may be done in any order.
#ifndef NPSIM_SAMPLES_STREET_RENDER_HPP
#define NPSIM_SAMPLES_STREET_RENDER_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "dice.hpp"
#include "layout.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/trace/bvh.hpp"
#include "params.hpp"
#include "scene.hpp"
#include "shading.hpp"
#include "sky.hpp"
#include "stage.hpp"
#include "surface.hpp"

namespace npsim {
namespace street {

inline constexpr std::size_t kRowsPerChunk = 4;

// Sky light smoothed over neighbours with like normal and depth.
inline Vec3f smoothed_sky(const std::vector<Vec3f>& sky, const Street& street, int x, int y, int radius) {
  const Vec3f n = street.normals(x, y);
  const float z = street.depth(x, y);
  Vec3f sum{};
  float weights = 0;
  for (int dy = -radius; dy <= radius; ++dy) {
    for (int dx = -radius; dx <= radius; ++dx) {
      const int u = x + dx;
      const int v = y + dy;
      if (!street.depth.view().contains(u, v)) continue;
      const float zq = street.depth(u, v);
      if (!(zq > 0)) continue;
      const float cosine = dot(n, street.normals(u, v));
      if (cosine < 0.85F) continue;
      // Distance from the plane of the middle pixel, relative to its depth.
      const Vec3f pq = unproject_pixel(street.intrinsics, u, v, zq) - unproject_pixel(street.intrinsics, x, y, z);
      const float off = dot(pq, n) / (0.015F * z + 0.03F);
      const float w = std::exp(-off * off - 0.06F * static_cast<float>(dx * dx + dy * dy));
      sum += sky[static_cast<std::size_t>(v) * static_cast<std::size_t>(street.depth.width()) +
                 static_cast<std::size_t>(u)] *
             w;
      weights += w;
    }
  }
  return weights > 0 ? sum / weights
                     : sky[static_cast<std::size_t>(y) * static_cast<std::size_t>(street.depth.width()) +
                           static_cast<std::size_t>(x)];
}

inline float srgb_encode(float v) { return v <= 0.0031308F ? 12.92F * v : 1.055F * std::pow(v, 1 / 2.4F) - 0.055F; }

// Toe and shoulder of a camera: 0.18 stays, 2 nearly reaches white.
inline float tone_curve(float v) {
  const float p = std::pow(std::fmax(v, 0.0F), 1.28F);
  return 1.18F * p / (p + 0.62F);
}

// Fills image, the exact planes and, per pixel, the face seen (kNoFace for the sky).
template <class Executor>
void render_street(const Stage& stage, Street& street, std::vector<std::uint32_t>& seen, Executor& executor) {
  const Shape shape = street.params.shape;
  const Layout& l = *stage.layout;
  const Scene& scene = *stage.scene;
  const Intrinsics& k = street.intrinsics;
  const std::size_t width = static_cast<std::size_t>(shape.width);
  seen.assign(shape.pixels(), kNoFace);
  std::vector<Vec3f> direct(shape.pixels());
  std::vector<Vec3f> albedo(shape.pixels());
  std::vector<Vec3f> sky(shape.pixels());
  const float pixel_rad = 1.0F / k.fx;
  const int samples = street.params.samples;
  // Under a closed cover the ceiling is little brighter than what it lights.
  const float sky_display = mix(kSkyDisplay, 0.60F, smoothstep(0.8F, 0.95F, l.cloudiness));
  executor.for_chunks(static_cast<std::size_t>(shape.height), kRowsPerChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      const int y = static_cast<int>(row);
      for (int x = 0; x < shape.width; ++x) {
        const std::size_t at = row * width + static_cast<std::size_t>(x);
        // The exact planes.
        Ray centre;
        centre.direction = unproject_pixel(k, x, y, 1.0F);
        Hit hit;
        if (closest_hit(stage.bvh, centre, hit)) {
          const Vec3f d = stage.camera.direction(centre.direction);
          const float norm = length(d);
          Hit scaled_hit = hit;
          scaled_hit.t *= norm;
          const ShadePoint p = shade_point(stage, stage.camera.o, d / norm, scaled_hit);
          const FaceInfo& info = scene.info[hit.face];
          const float view = std::fmax(0.02F, -dot(p.geometric, d / norm));
          const SurfaceSample s =
              surface_at(l, scene.materials[info.material], p.position, d / norm, p.t * pixel_rad / std::sqrt(view));
          const Face& f = stage.faces[hit.face];
          Vec3f n =
              normalized(cross(stage.vertices[f.b] - stage.vertices[f.a], stage.vertices[f.c] - stage.vertices[f.a]));
          if (dot(n, centre.direction) > 0) n = -n;
          seen[at] = hit.face;
          street.depth(x, y) = hit.t;
          street.normals(x, y) = n;
          street.labels(x, y) = info.label;
          street.instances(x, y) = info.instance;
          street.albedo(x, y) = s.albedo;
          street.roughness(x, y) = s.roughness;
        } else {
          street.depth(x, y) = 0;
          street.normals(x, y) = {0, 0, -1};
          street.labels(x, y) = label::sky;
          street.instances(x, y) = label::sky;
          street.albedo(x, y) = {};
          street.roughness(x, y) = 1;
        }
        // The photograph: samples on a rotated rank-one lattice.
        Dice dice(street.params.seed, Topic::render, static_cast<std::uint32_t>(at));
        const float ox = dice.uniform();
        const float oy = dice.uniform();
        Lattice lattice;
        lattice.sun = {dice.uniform(), dice.uniform()};
        lattice.sky = {dice.uniform(), dice.uniform()};
        Vec3f sum_direct{};
        Vec3f sum_albedo{};
        Vec3f sum_sky{};
        int on_surface = 0;
        for (int i = 0; i < samples; ++i) {
          lattice.index = i;
          Dice d(street.params.seed, Topic::render, static_cast<std::uint32_t>(at), static_cast<std::uint32_t>(i) + 1U);
          // A tent a little wider than the pixel, as a lens and a low-pass filter would give.
          const auto tent = [](float u) { return u < 0.5F ? std::sqrt(2 * u) - 1 : 1 - std::sqrt(2 - 2 * u); };
          const float jx = 0.5F + 0.75F * tent(fract(ox + static_cast<float>(i) * 0.7548777F));
          const float jy = 0.5F + 0.75F * tent(fract(oy + static_cast<float>(i) * 0.5698403F));
          Ray ray;
          const Vec3f cam = unproject(k, static_cast<float>(x) + jx, static_cast<float>(y) + jy, 1.0F);
          ray.direction = normalized(cam);
          const Vec3f world = stage.camera.direction(ray.direction);
          Hit h;
          if (closest_hit(stage.bvh, ray, h)) {
            const ShadePoint p = shade_point(stage, stage.camera.o, world, h);
            const SampleLight light =
                shade(stage, stage.camera.o, world, p, pixel_rad, street.params.sky_rays, lattice, d);
            sum_direct += light.direct;
            sum_albedo += light.albedo;
            sum_sky += light.sky;
            ++on_surface;
          } else {
            sum_direct += sky_radiance(l, world) * sky_display;
          }
        }
        direct[at] = sum_direct / static_cast<float>(samples);
        albedo[at] = sum_albedo / static_cast<float>(samples);
        sky[at] = on_surface > 0 ? sum_sky / static_cast<float>(on_surface) : Vec3f{};
      }
    }
  });

  std::vector<Vec3f> radiance(shape.pixels());
  executor.for_chunks(static_cast<std::size_t>(shape.height), kRowsPerChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      for (int x = 0; x < shape.width; ++x) {
        const std::size_t at = row * width + static_cast<std::size_t>(x);
        const bool surface = street.depth(x, static_cast<int>(row)) > 0;
        const Vec3f s = surface ? smoothed_sky(sky, street, x, static_cast<int>(row), 4) : sky[at];
        radiance[at] = direct[at] + albedo[at] * s;
      }
    }
  });

  // Exposure: the mean of the logarithm goes to a dark grey, as matrix metering with a bright sky does.
  double sum = 0;
  for (const Vec3f& v : radiance) sum += std::log(1e-3 + static_cast<double>(luminance(v)));
  const float mean = static_cast<float>(std::exp(sum / static_cast<double>(radiance.size())));
  const float exposure = 0.175F / mean;
  Dice balance(street.params.seed, Topic::sky, 1);
  const Vec3f white{balance.uniform(0.97F, 1.04F), 1.0F, balance.uniform(0.97F, 1.05F)};
  executor.for_chunks(static_cast<std::size_t>(shape.height), kRowsPerChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      for (int x = 0; x < shape.width; ++x) {
        const std::size_t at = row * width + static_cast<std::size_t>(x);
        const Vec3f d = unproject_pixel(k, x, static_cast<int>(row), 1.0F);
        const float falloff = mix(1.0F, 1.0F / ((d.x * d.x + d.y * d.y + 1) * (d.x * d.x + d.y * d.y + 1)), 0.35F);
        Vec3f v = radiance[at] * white * (exposure * falloff);
        const float grey = luminance(v);
        v = mix(Vec3f{grey, grey, grey}, v, 1.06F);
        if (street.params.sensor_noise > 0) {
          // var = beta1 x + beta2, about ISO 200, after a mild denoiser.
          Dice dice(street.params.seed, Topic::render, static_cast<std::uint32_t>(at), 0xFFFFU);
          const auto gauss = [&] {
            float sum_of_four = -2.0F;
            for (int i = 0; i < 4; ++i) sum_of_four += dice.uniform();
            return sum_of_four * 1.7320508F;
          };
          const auto noisy = [&](float c) {
            return c + street.params.sensor_noise * gauss() * std::sqrt(4.0e-5F * std::fmax(c, 0.0F) + 1.0e-6F);
          };
          v = {noisy(v.x), noisy(v.y), noisy(v.z)};
        }
        const auto code = [](float c) {
          return static_cast<std::uint8_t>(255.0F * clamp01(srgb_encode(clamp01(tone_curve(c)))) + 0.5F);
        };
        street.image(x, static_cast<int>(row)) = {code(v.x), code(v.y), code(v.z)};
      }
    }
  });
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_RENDER_HPP
