// SPDX-License-Identifier: Apache-2.0
// The depth of a street as sensors on a car measure it, where degrade.hpp has what a network makes of the photograph.
//
// Stereo: a pair 22 cm apart, matched as semi-global matching does. Objects are a few pixels too wide; what the right
// camera does not see (shadows of occlusion, a strip on the left) is missing or, in patches, matched wrongly; so are
// panes, dark paint and single patches anywhere; the rest has noise of disparity, correlated over some pixels and
// larger on the ground, and whole sixteenths of a pixel. Pixels are those of an image 2048 wide, so that a smaller
// image is a smaller copy of what such a pair gives.
// Laser: 64 lines from +2 to -24.8 degrees, .17 degrees apart along a line, 8 cm above and 27 cm behind the camera
// (so that points shine through beside near objects), noise of 2 cm, drop-outs, none from panes and few from dark
// surfaces, 100 m at most; five sweeps of a nodding car together, which is how the public depth maps are made.
// The figures are those of the two sensors that public data sets were made with, Cityscapes and KITTI.
// Invariant: a function of the street's seed; 0 where nothing was measured.
#ifndef NPSIM_SAMPLES_STREET_SENSORS_HPP
#define NPSIM_SAMPLES_STREET_SENSORS_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "dice.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/trace/bvh.hpp"
#include "params.hpp"
#include "stage.hpp"

namespace npsim {
namespace street {

inline constexpr float kStereoBaseline_m = 0.22F;

// Lattice noise of mean 0 and standard deviation about 1; one lattice cell per unit.
inline float unit_noise(float x, float y, std::uint32_t seed) { return (noise(x, y, seed) - 0.5F) * 4.6F; }

namespace sensor_detail {

// Semi-global matching carries an edge to the nearest texture, which is the near object's own: disparities spread.
inline io::Image<float> fattened(const io::Image<float>& disparity, int radius, float per_px, std::uint32_t seed) {
  io::Image<float> out = disparity;
  for (int y = 0; y < out.height(); ++y) {
    for (int x = 0; x < out.width(); ++x) {
      // Wider here, narrower there.
      const float field = noise(static_cast<float>(x) * per_px / 24, static_cast<float>(y) * per_px / 24, seed);
      const int reach = static_cast<int>(std::lround(static_cast<float>(radius) * 1.5F * field));
      for (int j = std::max(0, y - reach); j <= std::min(out.height() - 1, y + reach); ++j) {
        for (int i = std::max(0, x - reach); i <= std::min(out.width() - 1, x + reach); ++i) {
          out(x, y) = std::max(out(x, y), disparity(i, j));
        }
      }
    }
  }
  return out;
}

}  // namespace sensor_detail

inline void measure_stereo(Street& street) {
  const Shape shape = street.params.shape;
  const float per_px = 2048.0F / static_cast<float>(shape.width);  // pixels of the wide image per pixel of this one
  const float bf = kStereoBaseline_m * street.intrinsics.fx * per_px;
  const std::uint32_t seed = hash(static_cast<std::uint32_t>(street.params.seed) + 0x57E2E0U);
  io::Image<float> exact(shape);  // pixels of the wide image
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) exact(x, y) = street.depth(x, y) > 0 ? bf / street.depth(x, y) : 0.0F;
  }
  const int radius = static_cast<int>(std::lround(3.0F / per_px));
  const io::Image<float> disparity = sensor_detail::fattened(exact, radius, per_px, seed);
  street.est_depth = io::Image<float>(shape);
  for (int y = 0; y < shape.height; ++y) {
    float nearest_right = std::numeric_limits<float>::infinity();  // leftmost column of the right image taken so far
    for (int x = shape.width - 1; x >= 0; --x) {
      const float u = static_cast<float>(x) * per_px;
      const float v = static_cast<float>(y) * per_px;
      float d = disparity(x, y);
      const float right = u - d;
      const bool hidden = d > 0 && right >= nearest_right - 0.5F * per_px;  // by something nearer
      nearest_right = std::min(nearest_right, right);
      const bool outside = right < 0;
      const float patch = noise(u / 30, v / 18, seed + 1);
      const bool pane = street.roughness(x, y) < 0.15F && d > 0;
      const bool dark = luminance(street.albedo(x, y)) < 0.04F && d > 0;
      const bool strange = noise(u / 14, v / 14, seed + 2) > 0.93F;  // about 1 %
      if (outside && patch > 0.35F) {
        d = 4.0F + 8.0F * noise(u / 60, v / 25, seed + 3);  // beyond what the right image shows: far away
      } else if (outside || hidden || d <= 0 || (dark && patch > 0.45F)) {
        if (d > 0 || patch < 0.93F) continue;
        d = 2.0F + 4.0F * patch;  // a cloud that matched
      } else if (pane && patch > 0.4F) {
        d *= 0.55F + 0.35F * noise(u / 20, v / 20, seed + 4);  // what the pane mirrors
      } else if (strange) {
        d += 12.0F * (noise(u / 40, v / 40, seed + 5) - 0.5F);
      }
      const Label l = street.labels(x, y);
      const bool ground = l == label::road || l == label::sidewalk || l == label::terrain;
      d += (ground ? 0.30F : 0.16F) * unit_noise(u / 5, v / 5, seed + 6);
      d = std::round(d * 16) / 16;
      if (d > 0) street.est_depth(x, y) = bf / d;
    }
  }
}

inline void measure_laser(const Stage& stage, Street& street) {
  constexpr int kLines = 64;
  constexpr int kSweeps = 5;
  constexpr float kStep_rad = 0.17F * kPi / 180;
  constexpr float kFarthest_m = 100;
  const Shape shape = street.params.shape;
  const Vec3f sensor{0, -0.08F, -0.27F};
  street.est_depth = io::Image<float>(shape);
  // Everything the camera sees, as seen from a step behind it.
  const float half = 0.5F * street.params.horizontal_fov_rad;
  const int count = static_cast<int>(half / kStep_rad);
  for (int sweep = 0; sweep < kSweeps * kLines; ++sweep) {
    Dice car(street.params.seed, Topic::degrade, 2, static_cast<std::uint32_t>(sweep / kLines));
    const float nod = car.uniform(-0.3F, 0.3F);
    const float phase = car.uniform();
    const float line = static_cast<float>(sweep % kLines) / (kLines - 1);
    const float elevation = (2.0F - 26.8F * line + nod) * kPi / 180 + street.camera_pitch_rad;
    for (int i = -count; i <= count; ++i) {
      Dice dice(street.params.seed, Topic::degrade, 3 + static_cast<std::uint32_t>(sweep),
                static_cast<std::uint32_t>(i + count));
      const float azimuth = (static_cast<float>(i) + phase) * kStep_rad;
      Ray ray;
      ray.origin = sensor;
      ray.direction = {std::cos(elevation) * std::sin(azimuth), -std::sin(elevation),
                       std::cos(elevation) * std::cos(azimuth)};
      ray.t_min = 0.3F;
      ray.t_max = kFarthest_m;
      Hit hit;
      const bool lost = dice.chance(0.05F);
      float error_m = -0.02F * 1.73F * 2;  // four uniform draws: standard deviation 2 cm
      for (int k = 0; k < 4; ++k) error_m += 0.02F * 1.73F * dice.uniform();
      const float echo = dice.uniform();
      if (lost || !closest_hit(stage.bvh, ray, hit)) continue;
      const Material& m = stage.scene->materials[stage.scene->info[hit.face].material];
      const bool pane = m.kind == Kind::pane || m.kind == Kind::shop_pane || m.kind == Kind::car_glass;
      // What comes back falls with the square of the distance; a dark surface far off answers no more.
      const float strength = luminance(m.base) * (60.0F / hit.t) * (60.0F / hit.t);
      if ((pane && echo < 0.9F) || strength < 0.1F * echo) continue;
      const Vec3f p = sensor + ray.direction * (hit.t + error_m);
      if (!(p.z > 0.3F)) continue;
      const int x = static_cast<int>(std::floor(p.x / p.z * street.intrinsics.fx + street.intrinsics.cx));
      const int y = static_cast<int>(std::floor(p.y / p.z * street.intrinsics.fy + street.intrinsics.cy));
      if (!street.est_depth.view().contains(x, y)) continue;
      float& z = street.est_depth(x, y);
      z = z > 0 ? std::min(z, p.z) : p.z;
    }
  }
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_SENSORS_HPP
