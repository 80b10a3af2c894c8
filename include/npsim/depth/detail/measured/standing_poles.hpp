// SPDX-License-Identifier: Apache-2.0
// Masts stand: what stereo or a laser measured of one, all along, and where its foot meets the ground give it one
// distance.
//
// Of a thing as thin as a mast much of what is measured belongs to what is behind it or to a sign on it, and changes
// every metre; but it is upright, and one of its ends is on the ground. A mast is followed from its lowest run of
// pixels upwards, as verticals lie in the picture; signs hide it, and so may something else for a quarter of what was
// seen of it. Its depth is
//   the foot's, z = how far the ground there lies below the camera / fall of the ray, or rather, if it is least_share of
//   the mast's pixels, the largest part of them that agrees within `tolerance` and, within the error of foot_error_px
//   and of a ground tilted by foot_error_rad, with the foot; but
//   what most agree on where that is nearer: a label that ends too high makes a foot too far away;
//   without a foot on the ground the largest part that agrees, if it is lone_share, else the mast stays as it is.
// All of its pixels are then on the upright plane through its foot that faces the camera.
// Invariant: only pixels of poles change, and none of what is wider than it stands high or than max_width_m, or lies.
// Deterministic. Cost: four passes over each mast. Memory: 4 KiB of the stack. Error: that of depth or foot; a rule.
#ifndef NPSIM_DEPTH_DETAIL_MEASURED_STANDING_POLES_HPP
#define NPSIM_DEPTH_DETAIL_MEASURED_STANDING_POLES_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/depth/detail/ground_level.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct StandingPolesParams {
  bool enabled = true;
  LabelSet poles = LabelSet::of(label::pole, label::polegroup);
  LabelSet signs = LabelSet::of(label::traffic_sign, label::traffic_light);  // that hang on them
  float max_width_m = 1.0F;
  float tolerance = 0.05F;  // relative, between depths of one mast
  float foot_error_px = 1.5F;
  float foot_error_rad = 0.003F;
  float contrast = 0.07F;    // relative; what is measured no nearer than this before what is beside it may be that
  float least_share = 0.1F;  // of the pixels
  float lone_share = 0.3F;
};

[[nodiscard]] inline Status validate(const StandingPolesParams& p) noexcept {
  const auto is_share = [](float s) { return s >= 0.0F && s <= 1.0F; };
  const bool good = p.max_width_m >= 0.0F && p.tolerance > 0.0F && p.tolerance <= 0.5F && p.foot_error_px >= 0.0F &&
                    std::isfinite(p.foot_error_px) && p.foot_error_rad >= 0.0F && std::isfinite(p.foot_error_rad) &&
                    is_share(p.least_share) && is_share(p.lone_share);
  return good ? Status() : Status(StatusCode::invalid_argument, "standing poles: a parameter lies outside its range");
}

namespace pole_detail {

inline constexpr float kFarthest_m = 500.0F;

// Depths of one mast, by their logarithm.
class Depths {
 public:
  void add(float z) noexcept {
    const int bin = bin_of(z);
    ++count_[at(bin)];
    w_[at(bin)] += 1.0F / z;
    ++total_;
  }
  [[nodiscard]] int total() const noexcept { return total_; }

  struct Cluster {
    int count = 0;
    float z = 0.0F;  // of the mean of 1/z
  };
  // The largest one within a relative `tolerance` about a depth of from_m to to_m; of several the nearest.
  [[nodiscard]] Cluster largest(float from_m, float to_m, float tolerance) const noexcept {
    Cluster best;
    for (int bin = bin_of(from_m); bin <= bin_of(to_m); ++bin) {
      const Cluster c = between(bin, tolerance);
      if (c.count > best.count) best = c;
    }
    return best;
  }

 private:
  static constexpr int kBins = 512;
  static constexpr float kPerBin = 0.015F;  // from 1/4 m to kFarthest_m

  [[nodiscard]] static constexpr std::size_t at(int bin) noexcept { return static_cast<std::size_t>(bin); }
  [[nodiscard]] static int bin_of(float z) noexcept {
    return static_cast<int>(clamp_to(std::log(4.0F * z) / kPerBin, 0.0F, static_cast<float>(kBins - 1)));
  }
  [[nodiscard]] Cluster between(int middle, float tolerance) const noexcept {
    const auto reach = static_cast<int>(tolerance / kPerBin + 0.5F);
    int count = 0;
    float w = 0.0F;
    for (int bin = std::max(0, middle - reach); bin <= std::min(kBins - 1, middle + reach); ++bin) {
      count += count_[at(bin)];
      w += w_[at(bin)];
    }
    return {count, count > 0 ? static_cast<float>(count) / w : 0.0F};
  }

  std::array<int, kBins> count_{};
  std::array<float, kBins> w_{};
  int total_ = 0;
};

struct Scene {
  const StandingPolesParams& params;
  ImageView<const Label> labels;
  const Intrinsics& camera;
  const GroundPlane& ground;

  [[nodiscard]] bool is_pole(int x, int y) const noexcept {
    return labels.contains(x, y) && params.poles.contains(labels(x, y));
  }
};

// Of a mast: columns x0 .. x1 of row y.
struct Run {
  int x0 = 0, x1 = 0, y = 0;

  [[nodiscard]] int length() const noexcept { return x1 - x0 + 1; }
};

// Calls visit(run) for the runs of the mast from its lowest one up, none of them much wider than `width`, which follows
// them; the number of rows that show it.
template <class Visit>
int climb(const Scene& scene, const Run& foot, float width, Visit&& visit) noexcept {
  float middle = 0.5F * static_cast<float>(foot.x0 + foot.x1 + 1);
  int rows = 0;
  int shown = foot.y;  // the last row that showed the mast or one of its signs
  for (int y = foot.y; y >= 0 && shown - y <= std::max(3, rows / 4); --y) {
    if (y < foot.y) {  // along the picture of the vertical
      const Vec3f ray = unproject(scene.camera, middle, static_cast<float>(y) + 1.0F, 1.0F);
      const Vec3f& up = scene.ground.up;
      const float fall = up.y - ray.y * up.z;
      if (std::fabs(fall) > 0.1F) middle -= (up.x - ray.x * up.z) * scene.camera.fx / (fall * scene.camera.fy);
    }
    const auto x = static_cast<int>(std::floor(middle));
    if (!scene.labels.contains(x, y)) break;
    int seen = x;
    for (const int at : {x, x - 1, x + 1}) {
      if (scene.is_pole(at, y)) {
        seen = at;
        break;
      }
    }
    if (!scene.is_pole(seen, y)) {
      if (scene.params.signs.contains(scene.labels(x, y))) shown = y;
      continue;
    }
    const auto half = static_cast<int>(0.65F * width + 2.0F);
    int x0 = seen;
    int x1 = seen;
    while (x0 > seen - half && scene.is_pole(x0 - 1, y)) --x0;
    while (x1 < seen + half && scene.is_pole(x1 + 1, y)) ++x1;
    middle += 0.25F * (0.5F * static_cast<float>(x0 + x1 + 1) - middle);
    width += 0.25F * (static_cast<float>(x1 - x0 + 1) - width);
    shown = y;
    ++rows;
    visit(Run{x0, x1, y});
  }
  return rows;
}

// Where the foot meets the ground below it; 0 where it does not.
struct GroundDepth {
  float z = 0.0F;
  float error = 0.0F;  // relative
};
[[nodiscard]] inline GroundDepth foot_depth(const Scene& scene, const Run& foot,
                                            ImageView<const float> surface) noexcept {
  const int x = (foot.x0 + foot.x1) / 2;
  int below = foot.y + 1;
  while (below <= foot.y + foot.length() && scene.is_pole(x, below)) ++below;
  if (!surface.contains(x, below) || !kGroundLabels.contains(scene.labels(x, below)) ||
      !is_valid_depth(surface(x, below))) {
    return {};
  }
  const float drop_m = depth_detail::below_camera_m(surface, scene.labels, scene.camera, scene.ground.up, x, below);
  const float fall = 0.5F * (depth_detail::fall_of_ray(scene.ground, scene.camera, x, foot.y) +
                             depth_detail::fall_of_ray(scene.ground, scene.camera, x, foot.y + 1));
  if (!(drop_m > 0.0F) || !(fall > 0.0F)) return {};
  const float z = drop_m / fall;
  if (!is_valid_depth(z)) return {};
  return {z, (scene.params.foot_error_px / scene.camera.fy + scene.params.foot_error_rad) * z / drop_m};
}

// 0: nothing is known.
[[nodiscard]] inline float depth_of_mast(const StandingPolesParams& p, const Depths& depths,
                                         const GroundDepth& foot) noexcept {
  const auto are = [&](int count, float share) {
    return count > 0 && static_cast<float>(count) >= share * static_cast<float>(depths.total());
  };
  const Depths::Cluster most = depths.largest(0.0F, kFarthest_m, p.tolerance);
  if (!(foot.z > 0.0F)) return are(most.count, p.lone_share) ? most.z : 0.0F;
  const float from_m = foot.z * std::fmax(1.0F - foot.error, 0.5F);
  if (are(most.count, 0.5F) && most.z < from_m) return most.z;
  const Depths::Cluster near = depths.largest(from_m, foot.z * (1.0F + foot.error), p.tolerance);
  return are(near.count, p.least_share) ? near.z : foot.z;
}

}  // namespace pole_detail

// depth: as measured and filled. surface: the depth that a mesh is made of, in place, and not the memory of `depth`.
// Without labels nothing changes.
[[nodiscard]] inline Status stand_poles(const StandingPolesParams& params, ImageView<const float> depth,
                                        ImageView<const Label> labels, const Intrinsics& camera,
                                        const GroundPlane& ground, ImageView<float> surface) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(camera));
  const Shape shape = depth.shape();
  if (surface.shape() != shape || !(labels.empty() || labels.shape() == shape)) {
    return {StatusCode::shape_mismatch, "standing poles: all planes must have one shape"};
  }
  if (!params.enabled || labels.empty()) return {};
  using namespace pole_detail;  // NOLINT(google-build-using-namespace)
  const Scene scene{params, labels, camera, ground};
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (!scene.is_pole(x, y)) continue;
      Run lowest{x, x, y};
      while (scene.is_pole(lowest.x1 + 1, y)) ++lowest.x1;
      x = lowest.x1;
      bool goes_on = false;
      for (int at = lowest.x0 - 1; at <= lowest.x1 + 1 && !goes_on; ++at) goes_on = scene.is_pole(at, y + 1);
      if (goes_on) continue;
      Depths depths;
      int pixels = 0;
      const int rows = climb(scene, lowest, static_cast<float>(lowest.length()), [&](const Run& run) {
        pixels += run.length();
        for (int at = run.x0; at <= run.x1; ++at) {
          if (is_valid_depth(depth(at, run.y))) depths.add(depth(at, run.y));
        }
      });
      const float width = static_cast<float>(pixels) / static_cast<float>(rows);
      Run foot;  // a label's tip is none
      (void)climb(scene, lowest, width, [&](const Run& run) {
        if (foot.y == 0 && static_cast<float>(run.length()) >= 0.5F * width) foot = run;
      });
      const float z = depth_of_mast(params, depths, foot_depth(scene, foot, ImageView<const float>(surface)));
      if (!(z > 0.0F)) continue;
      if (static_cast<float>(rows) < width || width * z > params.max_width_m * camera.fx) continue;
      const Vec3f p = unproject_pixel(camera, (foot.x0 + foot.x1) / 2, foot.y, z);
      const Vec3f level = p - ground.up * dot(p, ground.up);
      (void)climb(scene, lowest, width, [&](const Run& run) {
        for (int at = run.x0; at <= run.x1; ++at) {
          const float along = dot(level, unproject_pixel(camera, at, run.y, 1.0F));
          const float there = along > 0.0F ? dot(level, p) / along : 0.0F;
          if (is_valid_depth(depth(at, run.y)) && is_valid_depth(there)) surface(at, run.y) = there;
        }
      });
    }
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_MEASURED_STANDING_POLES_HPP
