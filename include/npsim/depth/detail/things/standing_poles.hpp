// SPDX-License-Identifier: Apache-2.0
// Masts stand: what is known of one's depth, all along, and where its foot meets the ground give it one distance.
//
// Of a thing as thin as a mast much of what is measured belongs to what is behind it or to a sign on it, and changes
// every metre; but it is upright, and one of its ends is on the ground. A mast is followed from its lowest run of
// pixels upwards, as verticals lie in the picture, up to one that has been followed already; signs hide it, and so may
// something else for a quarter of what was seen of it; what is much wider, a beam or a panel, is none of it, and what is
// of another width behind a gap is another mast. Its depth:
//   what sure_share of its pixels agree on within `tolerance`, if that is not what is seen beside it; else
//   the foot's, z = how far the ground there lies below the camera / fall of the ray, or rather, if it is least_share of
//   the pixels, the largest part of them that agrees and, within the error of foot_error_px and of a ground tilted by
//   foot_error_rad, agrees with the foot; but
//   what half of them agree on where that is nearer: a label that ends too high makes a foot too far away;
//   without a foot over ground the largest part that agrees and is not what is seen beside it, if it is lone_share, else
//   the mast stays as it is.
// All of its pixels are then on the upright plane through its foot that faces the camera.
// Invariant: only pixels of poles change, and none of what is wider than it stands high or than max_width_m.
// Deterministic. Cost: three passes over each mast. Memory: a byte a pixel, and 8 KiB of the stack. Error: that of depth
// or foot; a rule.
#ifndef NPSIM_DEPTH_DETAIL_THINGS_STANDING_POLES_HPP
#define NPSIM_DEPTH_DETAIL_THINGS_STANDING_POLES_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/ground_level.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct StandingPolesParams {
  bool enabled = true;
  LabelSet poles = kPoleLabels;
  LabelSet signs = kSignLabels;  // that hang on them
  float max_width_m = 1.0F;
  float tolerance = 0.05F;  // relative, between depths of one mast
  float contrast = 0.07F;   // relative, by which a mast is nearer than what is seen beside it
  float foot_error_px = 1.5F;
  float foot_error_rad = 0.003F;
  float sure_share = 0.7F;  // of the pixels
  float least_share = 0.1F;
  float lone_share = 0.3F;
};

[[nodiscard]] inline Status validate(const StandingPolesParams& p) noexcept {
  const auto is_share = [](float s) { return s >= 0.0F && s <= 1.0F; };
  const bool good = p.max_width_m >= 0.0F && std::isfinite(p.max_width_m) && p.tolerance > 0.0F &&
                    p.tolerance <= 0.5F && p.foot_error_px >= 0.0F && std::isfinite(p.foot_error_px) &&
                    p.foot_error_rad >= 0.0F && std::isfinite(p.foot_error_rad) && is_share(p.contrast) &&
                    is_share(p.sure_share) && is_share(p.least_share) && is_share(p.lone_share);
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
  ImageView<std::uint8_t> followed;  // 1: of a mast that is done with

  [[nodiscard]] bool is_pole(int x, int y) const noexcept {
    return labels.contains(x, y) && params.poles.contains(labels(x, y));
  }
};

// Of a mast: columns x0 .. x1 of row y.
struct Run {
  int x0 = 0, x1 = -1, y = 0;

  [[nodiscard]] int length() const noexcept { return x1 - x0 + 1; }
};

// Calls visit(run) for the runs of the mast from its lowest one up; the number of rows that show it.
template <class Visit>
int climb(const Scene& scene, const Run& lowest, Visit&& visit) noexcept {
  float middle = 0.5F * static_cast<float>(lowest.x0 + lowest.x1 + 1);
  auto width = static_cast<float>(lowest.length());
  int rows = 0;
  int shown = lowest.y;  // the last row that showed the mast or one of its signs
  int last = lowest.y;   // that showed the mast
  for (int y = lowest.y; y >= 0 && shown - y <= std::max(3, rows / 4); --y) {
    if (y < lowest.y) middle -= vertical_slope(scene.ground, scene.camera, middle, static_cast<float>(y) + 1.0F);
    if (!(middle >= 0.0F) || !(middle < static_cast<float>(scene.labels.width()))) break;
    const auto x = static_cast<int>(middle);
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
    if (scene.followed(seen, y) != 0) break;
    const auto most = static_cast<int>(2.0F * width) + 8;
    Run run{seen, seen, y};
    while (run.length() <= most && scene.is_pole(run.x0 - 1, y)) --run.x0;
    while (run.length() <= most && scene.is_pole(run.x1 + 1, y)) ++run.x1;
    const float change = std::fabs(static_cast<float>(run.length()) - width);
    const bool parted = rows > 0 && y + 1 < last && change > std::fmax(2.0F, 0.4F * width);
    if (run.length() <= most && parted) break;  // another one beyond this one's end
    shown = y;
    if (run.length() > most) continue;
    last = y;
    middle += 0.25F * (0.5F * static_cast<float>(run.x0 + run.x1 + 1) - middle);
    width += 0.25F * (static_cast<float>(run.length()) - width);
    ++rows;
    visit(run);
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

// all: of its pixels. apart: of those that are nearer than what is seen beside them. 0: nothing is known.
[[nodiscard]] inline float depth_of_mast(const StandingPolesParams& p, const Depths& all, const Depths& apart,
                                         const GroundDepth& foot) noexcept {
  const auto are = [&](const Depths::Cluster& some, float share) {
    return some.count > 0 && static_cast<float>(some.count) >= share * static_cast<float>(all.total());
  };
  const Depths::Cluster own = apart.largest(0.0F, kFarthest_m, p.tolerance);
  if (are(own, foot.z > 0.0F ? p.sure_share : p.lone_share)) return own.z;
  if (!(foot.z > 0.0F)) return 0.0F;
  const float from_m = foot.z * std::fmax(1.0F - foot.error, 0.5F);
  const Depths::Cluster most = all.largest(0.0F, kFarthest_m, p.tolerance);
  if (are(most, 0.5F) && most.z < from_m) return most.z;
  const Depths::Cluster near = all.largest(from_m, foot.z * (1.0F + foot.error), p.tolerance);
  return are(near, p.least_share) ? near.z : foot.z;
}

// What was measured of a run.
inline void add_run(const Scene& scene, ImageView<const float> depth, const Run& run, Depths& all,
                    Depths& apart) noexcept {
  // Matching smears a mast over its surroundings: beside it is further off than that.
  const int beside_px = 3 + depth.width() / 256;
  float beside = 0.0F;  // the nearer side
  for (const int x : {run.x0 - beside_px, run.x1 + beside_px}) {
    if (!depth.contains(x, run.y) || scene.is_pole(x, run.y) || !is_valid_depth(depth(x, run.y))) continue;
    beside = beside > 0.0F ? std::fmin(beside, depth(x, run.y)) : depth(x, run.y);
  }
  for (int x = run.x0; x <= run.x1; ++x) {
    const float z = depth(x, run.y);
    if (!is_valid_depth(z)) continue;
    all.add(z);
    if (!(beside > 0.0F) || z < beside * (1.0F - scene.params.contrast)) apart.add(z);
  }
}

// One mast, from its lowest run.
inline void stand_mast(const Scene& scene, ImageView<const float> depth, const Run& lowest,
                       ImageView<float> surface) noexcept {
  const StandingPolesParams& p = scene.params;
  Depths all;
  Depths apart;
  int pixels = 0;
  const int rows = climb(scene, lowest, [&](const Run& run) {
    pixels += run.length();
    add_run(scene, depth, run, all, apart);
  });
  const float width = static_cast<float>(pixels) / static_cast<float>(std::max(rows, 1));
  Run foot;  // a label's tip is none
  (void)climb(scene, lowest, [&](const Run& run) {
    if (foot.length() == 0 && static_cast<float>(run.length()) >= 0.5F * width) foot = run;
  });
  float z = 0.0F;
  if (static_cast<float>(rows) >= width && foot.length() > 0) {
    z = depth_of_mast(p, all, apart, foot_depth(scene, foot, ImageView<const float>(surface)));
  }
  const bool moves = z > 0.0F && width * z <= p.max_width_m * scene.camera.fx;
  const Vec3f at = unproject_pixel(scene.camera, (foot.x0 + foot.x1) / 2, foot.y, z);
  const Vec3f level = at - scene.ground.up * dot(at, scene.ground.up);
  (void)climb(scene, lowest, [&](const Run& run) {
    const bool narrow = static_cast<float>(run.length()) * z <= p.max_width_m * scene.camera.fx;
    for (int x = run.x0; x <= run.x1; ++x) {
      scene.followed(x, run.y) = 1;
      if (!moves || !narrow || !is_valid_depth(depth(x, run.y))) continue;
      const float along = dot(level, unproject_pixel(scene.camera, x, run.y, 1.0F));
      const float there = along > 0.0F ? dot(level, at) / along : 0.0F;
      if (is_valid_depth(there)) surface(x, run.y) = there;
    }
  });
}

}  // namespace pole_detail

[[nodiscard]] constexpr std::size_t stand_poles_workspace_bytes(Shape shape) noexcept {
  return allocation_bytes<std::uint8_t>(shape.pixels()) + kWorkspaceAlignment;
}

// depth: as measured and filled. surface: the depth that a mesh is made of, in place, and not the memory of `depth`.
// Without labels nothing changes.
[[nodiscard]] inline Status stand_poles(const StandingPolesParams& params, ImageView<const float> depth,
                                        ImageView<const Label> labels, const Intrinsics& camera,
                                        const GroundPlane& ground, ImageView<float> surface,
                                        Workspace& workspace) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(camera));
  const Shape shape = depth.shape();
  if (surface.shape() != shape || !(labels.empty() || labels.shape() == shape)) {
    return {StatusCode::shape_mismatch, "standing poles: all planes must have one shape"};
  }
  if (!params.enabled || labels.empty()) return {};
  using namespace pole_detail;  // NOLINT(google-build-using-namespace)
  const WorkspaceScope scope(workspace);
  Scene scene{params, labels, camera, ground, {}};
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, scene.followed));
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) scene.followed(x, y) = 0;
  }
  // Those that stand on ground first, the farther ones before the nearer: a post before a mast ends below it.
  for (const bool on_ground : {true, false}) {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        if (!scene.is_pole(x, y)) continue;
        Run lowest{x, x, y};
        while (scene.is_pole(lowest.x1 + 1, y)) ++lowest.x1;
        x = lowest.x1;
        const int middle = (lowest.x0 + lowest.x1) / 2;
        if (scene.followed(middle, y) != 0) continue;
        const bool over_ground = y + 1 < shape.height && kGroundLabels.contains(labels(middle, y + 1));
        bool goes_on = false;
        for (int at = lowest.x0 - 1; at <= lowest.x1 + 1 && !goes_on; ++at) goes_on = scene.is_pole(at, y + 1);
        if (!goes_on && over_ground == on_ground) stand_mast(scene, depth, lowest, surface);
      }
    }
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_THINGS_STANDING_POLES_HPP
