// SPDX-License-Identifier: Apache-2.0
// How a depth map came about, found from its statistics, and by how much it may therefore be changed.
//
// Found in this order:
//   lidar: of the right and lower neighbours of measured pixels fewer than `dense` are measured. Scanners leave gaps
//     between rows and beams; everything else gives whole areas.
//   exact: of triples of pixels in line, a hundredth of the width apart and over which 1/z changes, at least
//     `collinear` lie on a line to 2e-4 of 1/z, as they do on planes. Noise or the slow errors of a network leave
//     chance: below .02. The distance is such that a small map enlarged bilinearly does not look like planes.
//   stereo: of the pixels of surfaces between measured ones of their row and column, at least `enclosed` are missing.
//     Stereo has no depth where only one camera looks and where nothing distinguishes one place from the next. Depth
//     cameras with a pattern of light count as stereo: they triangulate too.
//   network: what is left.
//
// What may be changed (DepthTrust): nothing of exact depth; laser points by centimetres, and where near by a share;
// stereo by three deviations of its noise, which is uniform in 1/z; the depth of networks freely. What was made up
// between measurements may move further the less certain it is.
// Cost: two passes. Memory: none.
#ifndef NPSIM_DEPTH_DEPTH_SOURCE_HPP
#define NPSIM_DEPTH_DEPTH_SOURCE_HPP

#include <cmath>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/depth/source_noise.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct DepthSourceParams {
  float dense = 0.7F;
  float collinear = 0.12F;
  float enclosed = 0.01F;
  float lidar_noise_m = 0.02F;      // of scanners on cars; a pixel is also as wide as this at 15 m
  float lidar_noise = 0.0005F;      // at most this share of the depth
  float deviations = 3.0F;          // of the noise of stereo (depth/source_noise.hpp)
  float unknown_baseline_m = 0.2F;  // of a stereo pair on a car's windscreen
  float made_up = 0.005F;           // relative; for what is made up without any support
};

// By how much 1/z may be changed: relative to itself, and where bounded by a depth in metres or a step of 1/z.
struct DepthTrust {
  bool bounded = false;   // false: everything may move
  float relative = 0.0F;  // of the depth
  float depth_m = 0.0F;   // the smaller one of both; 0: of no account
  DepthNoise noise;       // of stereo, on top
  float deviations = 0.0F;
  float made_up = 0.0F;              // relative, on top where confidence is 0
  float focal_baseline_px_m = 0.0F;  // disparity times depth; 0: not stereo

  // How far 1/z may move for a depth of z.
  [[nodiscard]] float reach(float z, float confidence) const noexcept {
    const float share = depth_m > 0.0F && depth_m < relative * z ? depth_m / z : relative;
    return deviations * noise.deviation(1.0F / z) + (share + made_up * (1.0F - confidence)) / z;
  }
  // The depth nearest to `proposed` that may replace z.
  [[nodiscard]] float held(float z, float proposed, float confidence) const noexcept {
    if (!bounded || !is_valid_depth(z) || !is_valid_depth(proposed) || proposed == z) return proposed;
    const float w = 1.0F / z;
    const float away = reach(z, confidence);
    const float moved = 1.0F / proposed - w;
    if (moved >= -away && moved <= away) return proposed;
    if (!(away > 0.0F)) return z;
    const float low = w - away;
    return moved > 0.0F ? 1.0F / (w + away) : (low > 0.0F ? 1.0F / low : proposed);
  }
};

// Focal length times baseline of the scene's stereo pair, of a usual one where it is not known: disparity times depth.
[[nodiscard]] inline float stereo_focal_baseline_px_m(const DepthSourceParams& params,
                                                      const SceneView& scene) noexcept {
  const bool known = scene.stereo_baseline_m > 0.0F;
  return scene.camera.fx * (known ? scene.stereo_baseline_m : params.unknown_baseline_m);
}

// focal_baseline_px_m: as above; used for stereo alone.
[[nodiscard]] inline DepthTrust depth_trust(const DepthSourceParams& params, DepthSource source,
                                            const DepthNoise& noise, float focal_baseline_px_m) noexcept {
  DepthTrust trust;
  if (source == DepthSource::network || source == DepthSource::unknown) return trust;
  trust.bounded = true;
  trust.made_up = source == DepthSource::exact ? 0.0F : params.made_up;
  if (source == DepthSource::lidar) {
    trust.relative = params.lidar_noise;
    trust.depth_m = params.lidar_noise_m;
  }
  if (source == DepthSource::stereo) {
    trust.noise = noise;
    trust.deviations = params.deviations;
    trust.focal_baseline_px_m = focal_baseline_px_m;
  }
  return trust;
}

namespace depth_detail {

struct DepthStatistics {
  std::size_t measured = 0;
  std::size_t pairs = 0;      // measured pixels and a measured right or lower neighbour
  std::size_t slopes = 0;     // triples over which 1/z changes
  std::size_t collinear = 0;  // of those
  std::size_t within = 0;     // pixels of surfaces, measured or between measured ones
  std::size_t enclosed = 0;   // of those, missing
};

inline void count_triple(float za, float zb, float zc, DepthStatistics& s) noexcept {
  if (!is_valid_depth(za) || !is_valid_depth(zb) || !is_valid_depth(zc)) return;
  const float a = zb / za;  // of 1/z in the middle
  const float c = zb / zc;
  if (std::fabs(a - c) < 1e-3F) return;
  ++s.slopes;
  s.collinear += std::fabs(a + c - 2.0F) < 2e-4F ? 1U : 0U;
}

// Pixels of surfaces between the outermost measured ones of their row and between two of their column, the latter
// within an eighth of the height: an open sky between towers is no hole.
inline void count_enclosed(ImageView<const float> depth, ImageView<const Label> labels, DepthStatistics& s) noexcept {
  const Shape shape = depth.shape();
  for (int y = 0; y < shape.height; ++y) {
    int left = 0;
    int right = shape.width - 1;
    while (left < shape.width && !is_valid_depth(depth(left, y))) ++left;
    while (right > left && !is_valid_depth(depth(right, y))) --right;
    if (left >= right) continue;
    const int reach = shape.height / 8 + 1;
    for (int x = left; x <= right; ++x) {
      if (!labels.empty() && kNoSurfaceLabels.contains(labels(x, y))) continue;
      if (is_valid_depth(depth(x, y))) {
        ++s.within;
        continue;
      }
      bool above = false;
      bool below = false;
      for (int d = 1; d <= reach && !above; ++d) above = y - d >= 0 && is_valid_depth(depth(x, y - d));
      for (int d = 1; d <= reach && above && !below; ++d) {
        below = y + d < shape.height && is_valid_depth(depth(x, y + d));
      }
      if (!above || !below) continue;
      ++s.within;
      ++s.enclosed;
    }
  }
}

}  // namespace depth_detail

// labels may be empty. Without a valid depth: network.
[[nodiscard]] inline DepthSource find_depth_source(const DepthSourceParams& params, ImageView<const float> depth,
                                                   ImageView<const Label> labels) noexcept {
  const Shape shape = depth.shape();
  depth_detail::DepthStatistics s;
  const int apart = max_of(2, shape.width / 100);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (!is_valid_depth(depth(x, y))) continue;
      ++s.measured;
      s.pairs += x + 1 < shape.width && is_valid_depth(depth(x + 1, y)) ? 1U : 0U;
      s.pairs += y + 1 < shape.height && is_valid_depth(depth(x, y + 1)) ? 1U : 0U;
      if (x + 2 * apart < shape.width) {
        depth_detail::count_triple(depth(x, y), depth(x + apart, y), depth(x + 2 * apart, y), s);
      }
      if (y + 2 * apart < shape.height) {
        depth_detail::count_triple(depth(x, y), depth(x, y + apart), depth(x, y + 2 * apart), s);
      }
    }
  }
  const auto at_least = [](std::size_t part, float share, std::size_t whole) {
    return whole > 0 && static_cast<double>(part) >= static_cast<double>(share) * static_cast<double>(whole);
  };
  if (s.measured == 0) return DepthSource::network;
  if (!at_least(s.pairs, params.dense, 2 * s.measured)) return DepthSource::lidar;
  if (at_least(s.collinear, params.collinear, s.slopes)) return DepthSource::exact;
  depth_detail::count_enclosed(depth, labels, s);
  return at_least(s.enclosed, params.enclosed, s.within) ? DepthSource::stereo : DepthSource::network;
}

[[nodiscard]] inline Status validate(const DepthSourceParams& p) noexcept {
  const bool good = p.dense >= 0.0F && p.collinear >= 0.0F && p.enclosed >= 0.0F && p.lidar_noise_m >= 0.0F &&
                    p.lidar_noise >= 0.0F && p.deviations >= 0.0F && p.unknown_baseline_m > 0.0F && p.made_up >= 0.0F &&
                    p.made_up < 1.0F;  // false for NaN
  return good ? Status() : Status(StatusCode::invalid_argument, "depth_source: shares and noise must not be negative");
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DEPTH_SOURCE_HPP
