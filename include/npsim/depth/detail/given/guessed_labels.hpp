// SPDX-License-Identifier: Apache-2.0
// Labels of scenes that have none: ground, plants, sky, and what else stands.
//
// Every later step asks labels where a surface ends and what it is like. Four can be guessed: on fifteen street frames
// whose labels are known 85 to 97 % of the pixels get theirs, of the ground 85 to 100 (docs/evaluation.md).
//   sky      depth/detail/given/sky.hpp, and what is blue, or bluer than the camera's cast, and goes on from it.
//   ground   of what was measured, that within ground_within_m() of the ground plane, or twice that where depth noise
//            moves heights as far, and what lies flat beside it (a street rises and falls), in the lines of a scanner
//            without a neighbour. What stands is measured twice as far above the plane, or in rays that do not fall,
//            and where the surface goes on upright: is_foot(), of a scanner goes_on_upright(). A seed with less than a
//            fifth of its kind in a window of an 80th of the width around it is a mismatch. Between a scanner's lines
//            there are more seeds: mark_between_lines(). All else takes the label of the seed that is nearest along a
//            path through the picture (given/picture_paths.hpp): a laser's lines are far apart, and things end where
//            colours do. Its kind: given/ground_kinds.hpp.
//   plants   of what stands, where it looks like leaves (given/plant_look.hpp) and no scanner finds it smooth
//            (given/scan_roughness.hpp): what is likely to, what may and hangs together with it, and small pieces
//            within.
//            What is low and has soil all around it is grass, whatever it looks like: soil (given/meadows.hpp).
//   building all else. Cars, poles and people too: the planes that belong to that label are fitted to what is plane.
//            For materials alone those that stand apart are told from buildings later (depth/things.hpp).
// Cost: some 20 passes over the picture and those of the looks; of a scanner what is within half a metre of each low
// point as well. Memory: guess_labels_workspace_bytes().
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_GUESSED_LABELS_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_GUESSED_LABELS_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/window_filter.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/depth_source.hpp"
#include "npsim/depth/detail/given/ground_kinds.hpp"
#include "npsim/depth/detail/given/meadows.hpp"
#include "npsim/depth/detail/given/picture_paths.hpp"
#include "npsim/depth/detail/given/plant_look.hpp"
#include "npsim/depth/detail/given/reduced_picture.hpp"
#include "npsim/depth/detail/given/scan_roughness.hpp"
#include "npsim/depth/detail/given/sky.hpp"
#include "npsim/depth/detail/given/sky_map.hpp"
#include "npsim/depth/detail/given/small_pieces.hpp"
#include "npsim/depth/detail/ground_level.hpp"
#include "npsim/depth/detail/grow.hpp"
#include "npsim/depth/detail/neighbouring_points.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

// Whether the surface rises by less than 20 degrees along its column, both from what was measured some pixels below to
// (x, y) and from there to what was measured above.
[[nodiscard]] inline bool lies_flat(ImageView<const float> depth, const Intrinsics& camera, const GroundPlane& ground,
                                    int x, int y) noexcept {
  constexpr float kFlat = 0.36F;
  const int reach = std::max(1, depth.width() / 256);
  const int last = 8 * reach;  // lines of a scanner lie apart
  const Vec3f here = unproject_pixel(camera, x, y, depth(x, y));
  const auto flat = [&](int sign) {
    for (int way = reach; way <= last; ++way) {
      const int v = y + sign * way;
      if (v < 0 || v >= depth.height()) break;
      Slope slope{};
      const auto first = [&](int u) {
        slope = slope_to(depth, camera, ground, here, u, v);
        return true;
      };
      if (any_point_in_row(depth, x, v, 1, first)) return std::fabs(slope.rise_m) <= kFlat * slope.along_m;
    }
    return sign > 0;  // nothing below it
  };
  return flat(1) && flat(-1);
}

inline constexpr float kSteep = 2.0F;  // 63 degrees, of what is upright

// Whether something measured above (x, y), kLow_m to half a metre higher, is as far away: the surface is upright. The
// first 16 points above are asked.
[[nodiscard]] inline bool goes_on_upright(ImageView<const float> depth, const Intrinsics& camera,
                                          const GroundPlane& ground, int x, int y) noexcept {
  constexpr float kLow_m = 0.1F;  // noise of lower ones counts for more than what they rise
  constexpr float kHigh_m = 0.5F;
  constexpr int kPoints = 16;
  const float z = depth(x, y);
  const Vec3f here = unproject_pixel(camera, x, y, z);
  const int reach = std::max(1, depth.width() / 256);
  const auto rows = [&](float metres) {
    return static_cast<int>(clamp_to(metres * camera.fy / z, 1.0F, static_cast<float>(depth.height())));
  };
  int asked = 0;
  for (int v = y - rows(kLow_m); v >= std::max(0, y - rows(kHigh_m)) && asked < kPoints; --v) {
    const auto upright = [&](int u) {
      ++asked;
      const Slope slope = slope_to(depth, camera, ground, here, u, v);
      return slope.rise_m > kLow_m && slope.rise_m < kHigh_m && slope.rise_m > kSteep * slope.along_m;
    };
    if (any_point_in_row(depth, x, v, reach, upright)) return true;
  }
  return false;
}

// How far above the ground (x, y) was measured, two deviations of that, and from where on nothing is ground.
struct MeasuredHeight {
  float above_m, noise_m, stands_m;
};
[[nodiscard]] inline MeasuredHeight measured_height(float z, const Intrinsics& camera, const GroundPlane& ground,
                                                    const DepthNoise& noise, int x, int y) noexcept {
  const float noise_m = 2.0F * depth_detail::fall_of_ray(ground, camera, x, y) * z * z * noise.deviation(1.0F / z);
  return {height_above_ground(ground, unproject_pixel(camera, x, y, z)), noise_m,
          2.0F * depth_detail::ground_within_m(ground) + noise_m};
}

// Whether the surface at (x, y), too low to stand by its height alone, goes on upright as near as two deviations allow
// to where it does stand, and, as near as four do, over the next .1 m: a pavement before a wall does not. False where
// two deviations are over two metres, for streets climb, and below two deviations of height. For depth that is no
// scanner's: five places in the column are asked. The ray of (x, y) must fall.
[[nodiscard]] inline bool is_foot(ImageView<const float> depth, const Intrinsics& camera, const GroundPlane& ground,
                                  const MeasuredHeight& height, int x, int y) noexcept {
  constexpr float kStep_m = 0.1F;
  constexpr int kPlaces = 4;
  constexpr float kMostNoise_m = 2.0F;
  if (height.above_m <= height.noise_m || height.above_m > height.stands_m) return false;
  const float z = depth(x, y);
  const float noise_along_m = height.noise_m / depth_detail::fall_of_ray(ground, camera, x, y);  // two deviations
  if (noise_along_m > kMostNoise_m) return false;
  const Vec3f here = unproject_pixel(camera, x, y, z);
  const auto row_above = [&](float rise_m) {
    const float v = static_cast<float>(y) - std::ceil(rise_m * camera.fy / z);
    return v >= 0.0F && is_valid_depth(depth(x, static_cast<int>(v))) ? static_cast<int>(v) : -1;
  };
  const auto is_steep = [&](const Slope& s, float noise_m) { return s.along_m < s.rise_m / kSteep + noise_m; };
  const int next = row_above(kStep_m);
  if (next >= 0 && !is_steep(slope_to(depth, camera, ground, here, x, next), 2.0F * noise_along_m)) return false;
  for (int place = 1; place <= kPlaces; ++place) {
    const int row = row_above(height.stands_m - height.above_m + kStep_m * static_cast<float>(place));
    if (row < 0) continue;
    const Slope slope = slope_to(depth, camera, ground, here, x, row);
    if (height.above_m + slope.rise_m > height.stands_m && is_steep(slope, noise_along_m)) return true;
  }
  return false;
}

// Whether the ray of (x, y) falls to the ground within 300 m.
[[nodiscard]] inline bool may_meet_ground(const GroundPlane& ground, const Intrinsics& camera, int x, int y) noexcept {
  constexpr float kFarGround_m = 300.0F;
  return depth_detail::fall_of_ray(ground, camera, x, y) * kFarGround_m > ground.camera_height_m;
}

// labels: what is unlabelled, measured and known by its height becomes road or building.
// lines: of a scanner, whose points have no neighbours.
inline void mark_by_height(ImageView<const float> depth, const Intrinsics& camera, const GroundPlane& ground,
                           const DepthNoise& noise, bool lines, ImageView<Label> labels) noexcept {
  constexpr Label kPerhaps = 255;
  constexpr float kFlatWithin = 2.5F;  // of what ground may be off, that which lies flat may
  constexpr float kFlatSlope = 0.01F;  // and of its depth
  constexpr float kStep = 0.25F;       // of a neighbour, of what ground may be off
  const float within_m = depth_detail::ground_within_m(ground);
  const auto height_m = [&](int x, int y) {
    return height_above_ground(ground, unproject_pixel(camera, x, y, depth(x, y)));
  };
  for (int y = 0; y < labels.height(); ++y) {
    for (int x = 0; x < labels.width(); ++x) {
      if (labels(x, y) != label::unlabeled) continue;
      if (!may_meet_ground(ground, camera, x, y)) {
        labels(x, y) = label::building;
        continue;
      }
      const float z = depth(x, y);
      if (!is_valid_depth(z)) continue;
      const MeasuredHeight height = measured_height(z, camera, ground, noise, x, y);
      const float above_m = height.above_m;
      const float flat_m = kFlatWithin * within_m + kFlatSlope * z;
      const bool in_doubt = above_m <= std::max(flat_m, height.stands_m);
      if (!lines && is_foot(depth, camera, ground, height, x, y)) {
        labels(x, y) = label::building;
      } else if (std::fabs(above_m) < within_m + std::min(height.noise_m, within_m)) {
        labels(x, y) = label::road;
      } else if (lines && above_m > 0.0F && in_doubt && goes_on_upright(depth, camera, ground, x, y)) {
        labels(x, y) = label::building;
      } else if (std::fabs(above_m) < flat_m && lies_flat(depth, camera, ground, x, y)) {
        labels(x, y) = lines ? label::road : kPerhaps;
      } else if (above_m > height.stands_m) {
        labels(x, y) = label::building;
      }
    }
  }
  depth_detail::grow_from(labels, label::road, [&](int x, int y, int from_x, int from_y) {
    return labels(x, y) == kPerhaps && std::fabs(height_m(x, y) - height_m(from_x, from_y)) < kStep * within_m;
  });
  for (Label& l : labels.pixels()) l = l == kPerhaps ? label::unlabeled : l;
}

// Between the points of a scanner. labels, by its points: what lies in a column between two points of the ground is
// ground, as a thing would have hidden the farther one, and what stands low stands on the ground: it goes on down to
// where cars end, as far as nothing else was measured. A point may lie beside the column by reach pixels if the picture
// looks alike there: no pole stands between. Below all that was measured ground goes on where the picture looks alike.
inline void mark_between_lines(ImageView<const Rgb8> image, ImageView<const float> depth, const Intrinsics& camera,
                               const GroundPlane& ground, ImageView<Label> labels) noexcept {
  constexpr int kLines = 10;  // so many fill the picture
  constexpr int kAlike = 24;  // codes of 255
  constexpr float kLow_m = 0.8F;
  constexpr float kFoot_m = 0.25F;
  const int reach = std::max(1, depth.width() / 128);  // no farther apart are points in a line
  // Of the points in row y beside x: road if all are of the ground and look like x, building if one does not,
  // unlabeled if there is none.
  const auto points_beside = [&](int x, int y) {
    Label found = label::unlabeled;
    const auto no_ground = [&](int u) {
      found = label::road;
      return labels(u, y) != label::road || depth_detail::difference(image(u, y), image(x, y)) >= kAlike;
    };
    return any_point_in_row(depth, x, y, reach, no_ground) ? label::building : found;
  };
  const auto ground_above = [&](int x, int y) {  // the row of the next point; y if that is none of the ground or far
    for (int v = y - 1; v >= std::max(0, y - depth.height() / kLines); --v) {
      const Label points = points_beside(x, v);
      if (points != label::unlabeled) return points == label::road ? v : y;
    }
    return y;
  };
  for (int y = 0; y < labels.height(); ++y) {
    for (int x = 0; x < labels.width(); ++x) {
      const float z = depth(x, y);
      if (!is_valid_depth(z)) continue;
      if (labels(x, y) == label::road) {
        for (int v = ground_above(x, y) + 1; v < y; ++v) {
          if (labels(x, v) == label::unlabeled) labels(x, v) = label::road;
        }
        if (any_point_from_row(depth, x, y + 1, reach)) continue;
        for (int v = y + 1; v < labels.height(); ++v) {
          const bool alike = depth_detail::difference(image(x, v), image(x, y)) < kAlike;
          if (alike && labels(x, v) == label::unlabeled) labels(x, v) = label::road;
        }
      } else if (labels(x, y) == label::building) {
        const auto high_m = [&](int v) { return height_above_ground(ground, unproject_pixel(camera, x, v, z)); };
        if (high_m(y) > kLow_m) continue;
        for (int v = y + 1; v < labels.height() && high_m(v) > kFoot_m && points_beside(x, v) == label::unlabeled;
             ++v) {
          if (labels(x, v) == label::unlabeled) labels(x, v) = label::building;
        }
      }
    }
  }
}

// Blue that was not measured, in rays that do not fall, and that the sky leads to in small steps is sky: it gets
// lighter towards the horizon. Surfaces that were measured tell the camera's cast, or haze: the sky is at least half
// again as blue as their median.
inline void spread_blue_sky(ImageView<const Rgb8> image, ImageView<const float> depth, const Intrinsics& camera,
                            const GroundPlane& ground, ImageView<Label> labels) noexcept {
  depth_detail::ByteHistogram measured{};
  for (int y = 0; y < labels.height(); ++y) {
    for (int x = 0; x < labels.width(); ++x) {
      if (!is_valid_depth(depth(x, y)) || labels(x, y) == label::sky) continue;
      measured[static_cast<std::size_t>(max_of(depth_detail::blue_over_red(image(x, y)), 0))] += 1;
    }
  }
  const int least_blue = max_of(depth_detail::kBlue, 3 * depth_detail::quantile_of(measured, 0.5) / 2);
  depth_detail::grow_from(labels, label::sky, [&](int x, int y, int from_x, int from_y) {
    return labels(x, y) == label::unlabeled && !is_valid_depth(depth(x, y)) &&
           depth_detail::blue_over_red(image(x, y)) >= least_blue &&
           !(depth_detail::fall_of_ray(ground, camera, x, y) > 0.0F) &&
           2 * depth_detail::difference(image(x, y), image(from_x, from_y)) <= depth_detail::kEvenSky;
  });
}

// Of the seeds in a window of that radius, the share of buildings.
template <class Executor>
[[nodiscard]] Status share_of_buildings(ImageView<const Label> labels, int radius, ImageView<float> share,
                                        Workspace& workspace, Executor& executor) {
  const auto seeds = [&](int x, int y) {
    return labels(x, y) == label::road || labels(x, y) == label::building ? 1.0F : 0.0F;
  };
  const auto stands = [&](int x, int y) { return labels(x, y) == label::building ? 1.0F : 0.0F; };
  return window_mean(seeds, stands, std::max(1, radius), 0.0F, 0.0F, workspace, share, executor);
}

// Noise moves patches of a foot: of low seeds, those are of buildings that have more of them around, in a window three
// patches wide, or a 160th of the picture if that is less. Posts narrower than half of it lose their foot.
template <class Executor>
[[nodiscard]] Status smooth_feet(ImageView<const float> depth, const Intrinsics& camera, const GroundPlane& ground,
                                 const DepthNoise& noise, ImageView<Label> labels, Workspace& workspace,
                                 Executor& executor) {
  constexpr int kInWidth = 320;
  constexpr float kPatches = 1.5F;
  const int radius = std::min(labels.width() / kInWidth, static_cast<int>(kPatches * noise.width_px));
  const WorkspaceScope scope(workspace);
  ImageView<float> share;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(labels.shape(), share));
  NPSIM_RETURN_IF_ERROR(share_of_buildings(labels, radius, share, workspace, executor));
  for_pixels(labels.shape(), executor, [&](int x, int y) {
    Label& l = labels(x, y);
    if ((l != label::building && l != label::road) || !is_valid_depth(depth(x, y))) return;
    if (!may_meet_ground(ground, camera, x, y)) return;
    const MeasuredHeight height = measured_height(depth(x, y), camera, ground, noise, x, y);
    if (std::fabs(height.above_m) <= height.stands_m) l = share(x, y) > 0.5F ? label::building : label::road;
  });
  return {};
}

// Seeds with few of their kind around them are seeds no more.
template <class Executor>
[[nodiscard]] Status drop_lone_seeds(ImageView<Label> labels, Workspace& workspace, Executor& executor) {
  constexpr int kInWidth = 160;
  constexpr float kFew = 0.2F;
  const WorkspaceScope scope(workspace);
  ImageView<float> share;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(labels.shape(), share));
  NPSIM_RETURN_IF_ERROR(share_of_buildings(labels, labels.width() / kInWidth, share, workspace, executor));
  for_pixels(labels.shape(), executor, [&](int x, int y) {
    Label& l = labels(x, y);
    if ((l == label::building && share(x, y) < kFew) || (l == label::road && share(x, y) > 1.0F - kFew)) {
      l = label::unlabeled;
    }
  });
  return {};
}

// What is unlabelled takes the label of the seed that is nearest by path and colour, but for the sky.
[[nodiscard]] inline Status spread_seeds(ImageView<const Rgb8> image, ImageView<Label> labels, Workspace& workspace) {
  const WorkspaceScope scope(workspace);
  ImageView<float> way;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(labels.shape(), way));
  for (int y = 0; y < labels.height(); ++y) {
    for (int x = 0; x < labels.width(); ++x) way(x, y) = labels(x, y) == label::unlabeled ? kFarOff : 0.0F;
  }
  follow_picture(
      image, way, [&](int, int, int from_x, int from_y) { return labels(from_x, from_y) != label::sky; },
      [&](int x, int y, int from_x, int from_y) { labels(x, y) = labels(from_x, from_y); });
  for (Label& l : labels.pixels()) l = l == label::unlabeled ? label::building : l;
  return {};
}

// labels: of what is building, plants become vegetation. noise: of the points of a scanner; none: of any other depth.
template <class Executor>
[[nodiscard]] Status tell_plants(ImageView<const Rgb8> image, ImageView<const float> depth, const Intrinsics& camera,
                                 const DepthNoise* noise, ImageView<Label> labels, Workspace& workspace,
                                 Executor& executor) {
  constexpr float kLikely = 0.9F;  // logarithm of the odds
  constexpr float kSmooth = 0.3F;  // share of rough points below which nothing is a plant
  constexpr float kPerShare = 20.0F;
  constexpr std::uint8_t kSkyAbove = 0, kThing = 1, kMaybe = 2, kPlant = 3, kGroundBelow = 4;
  constexpr std::size_t kSmall = 400;  // that many pieces fill the picture
  const WorkspaceScope scope(workspace);
  const int factor = plant_look_factor(camera);
  const Shape shape = reduced_shape(labels.shape(), factor);
  ImageView<float> odds;
  ImageView<std::uint8_t> plants;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, odds));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, plants));
  const auto stands = [&](int x, int y) { return labels(x, y) == label::building; };
  NPSIM_RETURN_IF_ERROR(plant_look(image, camera, stands, odds, workspace, executor));
  if (noise != nullptr) {
    const WorkspaceScope smooth(workspace);
    ImageView<float> rough;
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, rough));
    NPSIM_RETURN_IF_ERROR(scan_roughness(depth, camera, *noise, stands, factor, rough, workspace, executor));
    for_pixels(shape, executor, [&](int x, int y) { odds(x, y) -= kPerShare * std::max(0.0F, kSmooth - rough(x, y)); });
  }
  for_pixels(shape, executor, [&](int x, int y) {
    const Label l = labels(middle_of(x, factor, labels.width()), middle_of(y, factor, labels.height()));
    if (l != label::building) {
      plants(x, y) = l == label::sky ? kSkyAbove : kGroundBelow;
    } else {
      plants(x, y) = odds(x, y) < 0.0F ? kThing : (odds(x, y) > kLikely ? kPlant : kMaybe);
    }
  });
  depth_detail::grow(plants, kPlant, [](std::uint8_t p) { return p == kMaybe; });
  // The sky does not count: rims of crowns before it are of crowns.
  const auto thing = [](std::uint8_t p) { return p == kThing || p == kMaybe; };
  const auto below_sky = [](std::uint8_t p) { return p != kSkyAbove; };
  NPSIM_RETURN_IF_ERROR(close_pieces(plants, thing, below_sky, kPlant, shape.pixels() / kSmall, workspace));
  for_pixels(labels.shape(), executor, [&](int x, int y) {
    if (stands(x, y) && reduced_at(plants, factor, x, y) == kPlant) labels(x, y) = label::vegetation;
  });
  return {};
}

[[nodiscard]] constexpr std::size_t guess_labels_workspace_bytes(Shape shape) noexcept {
  const std::size_t pixels = shape.pixels();
  return max_of((1 + kWindowMeanPlanes) * allocation_bytes<float>(pixels), ground_kinds_workspace_bytes(shape),
                tell_meadows_workspace_bytes(shape),
                allocation_bytes<float>(pixels) + allocation_bytes<std::uint8_t>(pixels) +
                    max_of(plant_look_workspace_bytes(shape), close_pieces_bytes(shape),
                           allocation_bytes<float>(pixels) + scan_roughness_workspace_bytes(shape))) +
         kWorkspaceAlignment;
}

// depth: as measured, without what cannot be. surface: 0 in the sky.
template <class Executor>
[[nodiscard]] Status guess_labels(ImageView<const Rgb8> image, ImageView<const float> depth, const Intrinsics& camera,
                                  const GroundPlane& ground, const DepthNoise& noise, bool lines,
                                  ImageView<const std::uint8_t> surface, ImageView<Label> labels, Workspace& workspace,
                                  Executor& executor) {
  const bool has_ground = ground.inlier_share > 0.0F;
  for_pixels(labels.shape(), executor, [&](int x, int y) {
    labels(x, y) = surface(x, y) == 0 ? label::sky : (has_ground ? label::unlabeled : label::building);
  });
  if (has_ground) {
    spread_blue_sky(image, depth, camera, ground, labels);
    mark_by_height(depth, camera, ground, noise, lines, labels);
    if (!lines) NPSIM_RETURN_IF_ERROR(smooth_feet(depth, camera, ground, noise, labels, workspace, executor));
    NPSIM_RETURN_IF_ERROR(drop_lone_seeds(labels, workspace, executor));
    if (lines) mark_between_lines(image, depth, camera, ground, labels);
    NPSIM_RETURN_IF_ERROR(spread_seeds(image, labels, workspace));
    NPSIM_RETURN_IF_ERROR(tell_ground_kinds(image, labels, workspace, executor));
  }
  NPSIM_RETURN_IF_ERROR(tell_plants(image, depth, camera, lines ? &noise : nullptr, labels, workspace, executor));
  return has_ground ? tell_meadows(depth, camera, ground, labels, workspace) : Status{};
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_GUESSED_LABELS_HPP
