// SPDX-License-Identifier: Apache-2.0
// How a depth map came about, how uncertain it therefore is, and by how much it may be changed.
#ifndef NPSIM_DEPTH_DEPTH_SOURCE_HPP
#define NPSIM_DEPTH_DEPTH_SOURCE_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/depth/detail/fill/scan_lines.hpp"
#include "npsim/depth/detail/object_borders.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// How uncertain a measured depth is, by how it came about: the standard deviation of inverse depth w = 1 / z, in which
// planes are linear in the image.
//
//   stereo   disparity is measured, so the deviation of w is the same everywhere: .17 px of an image 2048 wide, over
//            focal length and baseline. On facades of real frames .15 to .17 px, .13 to .21 on cars; correlated over
//            some 4 px, the width over which matching smooths.
//   lidar    2 cm in z or more, measured: estimate_laser_noise(). Each point by itself, shared by what is filled
//            between it and the next.
//   network  a share of the depth, hence proportional to w, and smooth: neighbours share it. That deviation is what
//            normals see, over some pixels; over a whole facade errors drift by twice as much.
//   exact    rounding.
//   unknown  a share of the depth, measured: estimate_relative_noise().

// Deviation of w: amplitude w^power.
struct DepthNoise {
  float amplitude = 0.0F;
  int power = 1;
  float width_px = 1.0F;  // over which it is correlated
  float drift = 1.0F;     // deviation over a whole surface, in deviations; planes alone are that large

  [[nodiscard]] float deviation(float w) const noexcept {
    return power == 0 ? amplitude : (power == 1 ? amplitude * w : amplitude * w * w);
  }
};

// Median of |w - (w- + w+) / 2| / w over samples `reach_px` to the left and right within one object, which is 0 on
// planes, as a standard deviation. At most some 30,000 places are looked at. 0 where there are none.
[[nodiscard]] inline float estimate_relative_noise(ImageView<const float> depth, const ObjectMap& objects,
                                                   int reach_px) noexcept {
  constexpr int kBins = 256;  // of log2, 16 to the octave from 2^-16 up
  std::array<int, kBins> bins{};
  const int step = std::max(1, depth.width() / 200);
  int count = 0;
  for (int y = step / 2; y < depth.height(); y += step) {
    for (int x = reach_px + step / 2; x + reach_px < depth.width(); x += step) {
      const float before = depth(x - reach_px, y);
      const float here = depth(x, y);
      const float after = depth(x + reach_px, y);
      if (!is_valid_depth(before) || !is_valid_depth(here) || !is_valid_depth(after)) continue;
      if (!objects.same(x, y, x - reach_px, y) || !objects.same(x, y, x + reach_px, y)) continue;
      const float off = std::fabs(1.0F - 0.5F * here * (1.0F / before + 1.0F / after));
      const float bin = off > 0.0F ? 16.0F * (std::log2(off) + 16.0F) : 0.0F;
      ++bins[static_cast<std::size_t>(clamp_to(bin, 0.0F, static_cast<float>(kBins - 1)))];
      ++count;
    }
  }
  if (count == 0) return 0.0F;
  int below = 0;
  std::size_t at = 0;
  while (2 * (below + bins[at]) < count) below += bins[at++];
  const float median = std::exp2((static_cast<float>(at) + 0.5F) / 16.0F - 16.0F);
  return median / (0.6745F * 1.2247449F);  // of a Gaussian; of one sample less the mean of two
}

// Of a laser: how far a sample on a vehicle or a house is off the line in 1/z through the nearest above and below it,
// where that passes it within half a pixel of 960 across, as a standard deviation between that of a good scanner and
// .1 m: beams of a scanner, or several scanners, differ by more than one beam's readings do. Some 2,000 samples are
// looked at; where there are less than 50, or no labels, it is a good scanner's. 8 KiB of stack.
[[nodiscard]] inline DepthNoise estimate_laser_noise(ImageView<const float> depth, const ObjectMap& objects) noexcept {
  constexpr float kGood_m = 0.02F;
  constexpr float kMost_m = 0.1F;
  constexpr float kAlike = 0.4F;  // of the distance of samples: filled between them, pixels share their noise
  constexpr float kWidest_px = 8.0F;
  constexpr float kSame = 0.1F;  // of depth, that neighbours on one surface differ by at most
  constexpr std::size_t kFewest = 50;
  constexpr std::size_t kMost = 2048;
  constexpr LabelSet kSolid = kVehicleLabels | kHouseLabels;
  const auto is_sample = [&](int x, int y) { return depth.contains(x, y) && is_valid_depth(depth(x, y)); };
  const auto is_solid = [&](int x, int y) { return !objects.labels.empty() && kSolid.contains(objects.labels(x, y)); };
  std::size_t samples = 0;
  std::size_t solid = 0;
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      if (!is_valid_depth(depth(x, y))) continue;
      ++samples;
      if (is_solid(x, y)) ++solid;
    }
  }
  DepthNoise noise{kGood_m, 2, 1.0F};
  if (samples == 0) return noise;
  const float apart = std::sqrt(static_cast<float>(depth.shape().pixels()) / static_cast<float>(samples));
  noise.width_px = clamp_to(kAlike * apart, 1.0F, kWidest_px);

  const float scale = std::max(1.0F, static_cast<float>(depth.width()) / 960.0F);
  const auto reach = static_cast<int>(16.0F * scale);
  const auto aside = static_cast<int>(2.0F * scale);
  const std::size_t step = 1 + solid / kMost;
  std::array<float, kMost> off;
  std::size_t count = 0;
  std::size_t seen = 0;
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      const float z = depth(x, y);
      if (!is_valid_depth(z) || !is_solid(x, y) || seen++ % step != 0) continue;
      const auto next = [&](int dy) { return depth_detail::next_point(is_sample, x, y, 0, dy, reach, aside); };
      const auto alike = [&](const depth_detail::ScanPoint& at) {
        return at.x >= 0 && objects.same(x, y, at.x, at.y) && std::fabs(depth(at.x, at.y) - z) < kSame * z;
      };
      const depth_detail::ScanPoint above = next(-1);
      const depth_detail::ScanPoint below = next(1);
      if (!alike(above) || !alike(below)) continue;
      const float t = static_cast<float>(y - above.y) / static_cast<float>(below.y - above.y);
      const float passes = static_cast<float>(above.x) + t * static_cast<float>(below.x - above.x);
      if (std::fabs(passes - static_cast<float>(x)) > 0.5F * scale) continue;
      const float between = 1.0F / ((1.0F - t) / depth(above.x, above.y) + t / depth(below.x, below.y));
      off[count++] = std::fabs(z - between) / std::sqrt(1.0F + t * t + (1.0F - t) * (1.0F - t));
    }
  }
  if (count < kFewest) return noise;
  select_nth(off.data(), off.data() + count / 2, off.data() + count);
  noise.amplitude = clamp_to(off[count / 2] / 0.6745F, kGood_m, kMost_m);
  return noise;
}

// source: unknown is measured. baseline_m: 0 where it is not known, which makes stereo unknown too.
[[nodiscard]] inline DepthNoise depth_noise(DepthSource source, float baseline_m, ImageView<const float> depth,
                                            const ObjectMap& objects, const Intrinsics& camera) noexcept {
  const float scale = static_cast<float>(depth.width()) / 2048.0F;
  const float correlated = std::max(1.0F, 4.0F * scale);
  if (source == DepthSource::stereo && baseline_m > 0.0F) {
    return {0.17F * scale / (camera.fx * baseline_m), 0, correlated};
  }
  if (source == DepthSource::lidar) return estimate_laser_noise(depth, objects);
  if (source == DepthSource::exact) return {1e-3F, 1, 1.0F};
  if (source == DepthSource::network) return {0.01F, 1, 8.0F * correlated, 2.0F};
  const int reach = std::max(1, static_cast<int>(16.0F * scale));
  return {clamp_to(estimate_relative_noise(depth, objects, reach), 1e-4F, 0.05F), 1, correlated};
}

// How a depth map came about, found from its statistics, and by how much it may therefore be changed.
//
// Found in this order:
//   lidar: of the right and lower neighbours of measured pixels fewer than `dense` are measured. Scanners leave gaps
//     between rows and beams; everything else gives whole areas.
//   exact: of triples of pixels in line, a hundredth of the width apart and over which 1/z changes, at least
//     `collinear` lie on a line to 2e-4 of 1/z, as they do on planes. Noise or the slow errors of a network leave
//     chance: of real frames below .03. The distance is such that a small map enlarged bilinearly does not look like
//     planes. Rendered depth that is stored in steps, as of 1/256 m or 1 cm, lies off, so half a step over z is
//     tolerated, to 5e-4: generated streets then have .19 to .21 and .12 to .16 (in 1 cm one of four is not told).
//   stereo: of the pixels of surfaces between measured ones of their row and column, at least `enclosed` are missing.
//     Stereo has no depth where only one camera looks and where nothing distinguishes one place from the next. Depth
//     cameras with a pattern of light count as stereo: they triangulate too.
//   network: what is left.
//
// What may be changed (DepthTrust): nothing of exact depth; laser points by centimetres, and where near by a share;
// stereo by three deviations of its noise, which is uniform in 1/z; the depth of networks freely. What was made up
// between measurements may move further the less certain it is.
// Cost: three passes. Memory: none.

struct DepthSourceParams {
  float dense = 0.7F;
  float collinear = 0.12F;
  float enclosed = 0.01F;
  float lidar_noise_m = 0.02F;      // of scanners on cars; a pixel is also as wide as this at 15 m
  float lidar_noise = 0.0005F;      // at most this share of the depth
  float deviations = 3.0F;          // of the noise of stereo
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

// step_m: of stored depth.
inline void count_triple(float za, float zb, float zc, float step_m, DepthStatistics& s) noexcept {
  constexpr float kOnLine = 2e-4F, kMostOnLine = 5e-4F;
  if (!is_valid_depth(za) || !is_valid_depth(zb) || !is_valid_depth(zc)) return;
  const float a = zb / za;  // of 1/z in the middle
  const float c = zb / zc;
  if (std::fabs(a - c) < 1e-3F) return;
  ++s.slopes;
  s.collinear += std::fabs(a + c - 2.0F) < clamp_to(0.5F * step_m / zb, kOnLine, kMostOnLine) ? 1U : 0U;
}

// The steps in which depth is stored: the least by which it differs from a pixel to the next in its row. 0 where that
// is less than 2 mm, which moves no line at the distances of a street.
[[nodiscard]] inline float stored_step_m(ImageView<const float> depth) noexcept {
  constexpr float kFine_m = 0.002F;
  float least = 1e30F;
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x + 1 < depth.width(); ++x) {
      if (!is_valid_depth(depth(x, y)) || !is_valid_depth(depth(x + 1, y))) continue;
      const float step = std::fabs(depth(x + 1, y) - depth(x, y));
      if (step > 0.0F) least = std::min(least, step);
    }
  }
  return least < 1e30F && least > kFine_m ? least : 0.0F;
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
  const float step_m = depth_detail::stored_step_m(depth);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (!is_valid_depth(depth(x, y))) continue;
      ++s.measured;
      s.pairs += x + 1 < shape.width && is_valid_depth(depth(x + 1, y)) ? 1U : 0U;
      s.pairs += y + 1 < shape.height && is_valid_depth(depth(x, y + 1)) ? 1U : 0U;
      if (x + 2 * apart < shape.width) {
        depth_detail::count_triple(depth(x, y), depth(x + apart, y), depth(x + 2 * apart, y), step_m, s);
      }
      if (y + 2 * apart < shape.height) {
        depth_detail::count_triple(depth(x, y), depth(x, y + apart), depth(x, y + 2 * apart), step_m, s);
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
