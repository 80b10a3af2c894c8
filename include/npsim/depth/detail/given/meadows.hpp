// SPDX-License-Identifier: Apache-2.0
// Meadows are soil as a whole, for scenes without labels: tall grass is no plant that stands, dark or dry grass no road.
//
// Grass is rough: some of its points lie higher than ground may and as steep above each other as those of what stands,
// and its shaded and dry places are not green. Each becomes a patch of another kind within the meadow, which reflects
// and faces the lamps as that does. What has soil all around it in the picture, but for its border, and less width than
// kWidest of it, becomes soil unless it stands: more than a fifth of its points lie kTallGrass_m above the mean of the
// soil around; on soil that rises away from the camera by one in ten, .6 m. What was measured nowhere stays as it is.
// Cost: one pass, and for each such piece two over the box around it. Memory: tell_meadows_workspace_bytes().
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_MEADOWS_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_MEADOWS_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

[[nodiscard]] constexpr std::size_t tell_meadows_workspace_bytes(Shape shape) noexcept {
  return allocation_bytes<std::uint8_t>(shape.pixels()) + allocation_bytes<std::uint32_t>(shape.pixels());
}

// depth: as measured. labels: guessed; in place.
[[nodiscard]] inline Status tell_meadows(ImageView<const float> depth, const Intrinsics& camera,
                                         const GroundPlane& ground, ImageView<Label> labels, Workspace& workspace) {
  constexpr int kWidest = 6;  // pieces as wide as the picture is
  constexpr float kTallGrass_m = 0.4F;
  constexpr int kFew = 5;  // one point in so many may lie higher
  const int width = labels.width();
  const int height = labels.height();
  const WorkspaceScope scope(workspace);
  ImageView<std::uint8_t> open;
  Span<std::uint32_t> list;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(labels.shape(), open));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(labels.shape().pixels(), list));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) open(x, y) = labels(x, y) == label::terrain ? 0 : 1;
  }
  const auto above_m = [&](int x, int y) {
    return height_above_ground(ground, unproject_pixel(camera, x, y, depth(x, y)));
  };
  const int margin = std::max(1, width / 128);
  const auto is_grass = [&](Span<const std::uint32_t> piece) {
    int x0 = width, x1 = 0, y0 = height, y1 = 0;
    for (const std::uint32_t i : piece) {
      const auto [x, y] = place_of(i, width);
      x0 = std::min(x0, x);
      x1 = std::max(x1, x);
      y0 = std::min(y0, y);
      y1 = std::max(y1, y);
    }
    if (x1 - x0 + 1 >= width / kWidest) return false;
    float sum_m = 0.0F;
    int around = 0;
    for (int y = std::max(0, y0 - margin); y <= std::min(height - 1, y1 + margin); ++y) {
      for (int x = std::max(0, x0 - margin); x <= std::min(width - 1, x1 + margin); ++x) {
        if (labels(x, y) != label::terrain || !is_valid_depth(depth(x, y))) continue;
        sum_m += above_m(x, y);
        ++around;
      }
    }
    if (around == 0) return false;
    const float soil_m = sum_m / static_cast<float>(around);
    int count = 0;
    int high = 0;
    for (const std::uint32_t i : piece) {
      const auto [x, y] = place_of(i, width);
      if (!is_valid_depth(depth(x, y))) continue;
      ++count;
      high += above_m(x, y) - soil_m > kTallGrass_m ? 1 : 0;
    }
    return count > 0 && kFew * high <= count;
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (open(x, y) == 0) continue;
      const Span<const std::uint32_t> piece = list.sub(0, take_piece(open, x, y, list));
      if (!is_grass(piece)) continue;
      for (const std::uint32_t i : piece) {
        const auto [u, v] = place_of(i, width);
        labels(u, v) = label::terrain;
      }
    }
  }
  return {};
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_MEADOWS_HPP
