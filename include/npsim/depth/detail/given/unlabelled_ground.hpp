// SPDX-License-Identifier: Apache-2.0
// Where the ground goes on that a laser does not see, in scenes without labels.
//
// It goes by the ground plane of the depth. Virtual measurements are for the fill alone, and only where nothing was
// measured.
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_UNLABELLED_GROUND_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_UNLABELLED_GROUND_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/fill/scan_lines.hpp"
#include "npsim/depth/detail/ground_level.hpp"
#include "npsim/depth/detail/object_borders.hpp"
#include "npsim/geometry/ground.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

// Joins neighbouring points along a laser's lines (detail/fill/scan_lines.hpp), which lie farther apart than pixels do:
// in the columns between them nothing would bar what is asked for. Gaps of a fence narrower than that are closed too.
// along: how much of 1/z neighbours may differ by. depth: gets what was measured and what lies between.
[[nodiscard]] inline Status join_lines(float along, ImageView<const float> measured, ImageView<float> depth,
                                       Workspace& workspace) {
  const WorkspaceScope scope(workspace);
  ImageView<std::int32_t> steps;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(depth.shape(), steps));
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      const bool given = is_valid_depth(measured(x, y));
      steps(x, y) = given ? 0 : 1;
      depth(x, y) = given ? 1.0F / measured(x, y) : 0.0F;
    }
  }
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      if (steps(x, y) == 0) depth_detail::join_along_line(along, ObjectMap{}, x, y, depth, steps);
    }
  }
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      float& z = depth(x, y);
      z = is_valid_depth(measured(x, y)) ? measured(x, y) : (z > 0.0F ? 1.0F / z : 0.0F);
    }
  }
  return {};
}

// Between ground and what a laser sees above it in the same column, rays meet the ground as long as the plane, scaled
// to the ground measured last, is nearer: the rows up to the foot of a house are road, not a ramp that ends at its
// first storey. Up to kFarGround_m, for what lies farther no lamp shows; and not where measurements within a 64th of
// the width to either side, in rows within a 128th of the height, show that the sensor would have answered. given: the
// depth as it was measured. Cost: two passes, and the rows of the window for each pixel in between.
inline constexpr int kGroundSeam_px = 2;
inline constexpr float kFarGround_m = 100.0F;
[[nodiscard]] inline Status continue_ground_upwards(const GroundPlane& ground, const Intrinsics& camera,
                                                    ImageView<const float> given, ImageView<const float> lines,
                                                    ImageView<float> measured, Workspace& workspace) {
  const int reach = std::max(given.width() / 64, 1);
  const int rows = std::max(given.height() / 128, 1);
  const WorkspaceScope scope(workspace);
  ImageView<std::uint8_t> answered;  // in the pixel's row, within reach
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(given.shape(), answered));
  for (int y = 0; y < given.height(); ++y) {
    int around = 0;
    const auto valid = [&](int x) { return x >= 0 && x < given.width() && is_valid_depth(given(x, y)) ? 1 : 0; };
    for (int x = 0; x < reach; ++x) around += valid(x);
    for (int x = 0; x < given.width(); ++x) {
      around += valid(x + reach) - valid(x - reach - 1);
      answered(x, y) = around > 0 ? 1 : 0;
    }
  }
  const auto answers = [&](int x, int y) {
    for (int v = std::max(0, y - rows); v <= std::min(given.height() - 1, y + rows); ++v) {
      if (answered(x, v) != 0) return true;
    }
    return false;
  };
  for (int x = 0; x < measured.width(); ++x) {
    int seen = -1;         // the row measured last, from below
    float under_m = 0.0F;  // how far its ground lies below the camera; 0: no ground
    for (int y = measured.height() - 1; y >= -1; --y) {
      if (y >= 0 && !is_valid_depth(lines(x, y))) continue;
      const float fall = y < 0 ? 0.0F : depth_detail::fall_of_ray(ground, camera, x, y);
      const float next_m = y < 0 ? 0.0F : fall * lines(x, y);
      const bool is_ground = std::fabs(ground.camera_height_m - next_m) < depth_detail::kGroundHeight_m;
      const float nearest = y < 0 ? kFarGround_m : std::min(kFarGround_m, lines(x, y));
      for (int v = seen - kGroundSeam_px; under_m > 0.0F && !is_ground && v > y + kGroundSeam_px; --v) {
        const float fall_v = depth_detail::fall_of_ray(ground, camera, x, v);
        if (!(under_m < nearest * fall_v)) break;
        if (!answers(x, v)) measured(x, v) = under_m / fall_v;
      }
      seen = y;
      under_m = is_ground ? next_m : 0.0F;
    }
  }
  return {};
}

// Without labels nothing says that the ground goes on below the lowest row that a laser sees. Where that row shows
// ground, within kGroundHeight_m of the plane, what lies more than kGroundSeam_px below it takes the plane's depth,
// scaled as the ground in the columns nearby is: virtual measurements, for the fill alone. Above its topmost ground the
// same.
[[nodiscard]] inline Status continue_ground(const GroundPlane& ground, const Intrinsics& camera,
                                            ImageView<const float> given, float along, ImageView<float> measured,
                                            Workspace& workspace) {
  const int width = measured.width();
  const int height = measured.height();
  const WorkspaceScope scope(workspace);
  ImageView<float> lines;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(measured.shape(), lines));
  if (along > 0.0F) {
    NPSIM_RETURN_IF_ERROR(join_lines(along, measured, lines, workspace));
  } else {
    copy_pixels(ImageView<const float>(measured), lines);
  }
  Span<float> scale;  // measured depth over the plane's, per column; 0: no ground there
  NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(width), scale));
  const auto down = [&](int x, int y) { return depth_detail::fall_of_ray(ground, camera, x, y); };
  const auto lowest = [&](int x) {
    int y = height - 1;
    while (y >= 0 && !is_valid_depth(lines(x, y))) --y;
    return y;
  };
  for (int x = 0; x < width; ++x) {
    const int y = lowest(x);
    const float below_m = y < 0 ? 0.0F : lines(x, y) * down(x, y);
    const bool seen = std::fabs(ground.camera_height_m - below_m) < depth_detail::kGroundHeight_m;
    scale[static_cast<std::size_t>(x)] = seen ? below_m / ground.camera_height_m : 0.0F;
  }
  const int reach = width / 64;
  for (int x = 0; x < width; ++x) {
    if (!(scale[static_cast<std::size_t>(x)] > 0.0F)) continue;
    float sum = 0.0F;
    int count = 0;
    for (int i = std::max(0, x - reach); i <= std::min(width - 1, x + reach); ++i) {
      sum += scale[static_cast<std::size_t>(i)];
      count += scale[static_cast<std::size_t>(i)] > 0.0F ? 1 : 0;
    }
    for (int y = lowest(x) + 1 + kGroundSeam_px; y < height; ++y) {
      if (down(x, y) > 0.0F) measured(x, y) = ground.camera_height_m / down(x, y) * sum / static_cast<float>(count);
    }
  }
  return continue_ground_upwards(ground, camera, given, lines, measured, workspace);
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_UNLABELLED_GROUND_HPP
