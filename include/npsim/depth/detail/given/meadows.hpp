// SPDX-License-Identifier: Apache-2.0
// Meadows are soil as a whole, for scenes without labels: tall grass is no plant that stands, dark or dry grass no road.
//
// Grass is rough: some of its points lie higher than ground may and as steep above each other as those of what stands,
// and its shaded and dry places are not green. Each becomes a patch of another kind within the meadow, which reflects
// and faces the lamps as that does. Patches have soil all around them in the picture, but for its border, and less
// than 1 / kNarrow of its width. Within them what hangs together and has one label becomes soil unless it stands, with
// more than a fifth of its points kTallGrass_m above the soil around at their own distance (a line through that soil's
// heights), or is ground and longer than kLongest_m, as roads are. So a person on dry grass stays, and an upright
// thing of less than .38 m passes for grass. What may be higher than its points tell, as its top would be that far
// above all of them were it upright, stays. Points half as far again as a piece's median, or that much nearer, tell
// nothing of soil, and count as high; lengths leave out a twentieth of the points at either end.
// Cost: four passes, and for each label of a patch one over the box around it. Memory: tell_meadows_workspace_bytes().
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_MEADOWS_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_MEADOWS_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/boxes.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

[[nodiscard]] constexpr std::size_t tell_meadows_workspace_bytes(Shape shape) noexcept {
  return 2 * allocation_bytes<std::uint8_t>(shape.pixels()) + allocation_bytes<std::uint32_t>(shape.pixels()) +
         allocation_bytes<float>(shape.pixels());
}

// Heights of soil above the ground plane by distance: the line of least squares, or the mean of soil at one distance.
class SoilLine {
 public:
  void add(float z, float height_m) noexcept {
    const auto x = static_cast<double>(z);
    const auto y = static_cast<double>(height_m);
    count_ += 1.0;
    x_ += x;
    y_ += y;
    xx_ += x * x;
    xy_ += x * y;
  }
  // No number where there is no soil.
  [[nodiscard]] float at(float z) const noexcept {
    constexpr double kOneDistance = 1e-4;  // relative variance
    if (!(count_ > 0.0)) return std::numeric_limits<float>::quiet_NaN();
    const double x = x_ / count_;
    const double spread = xx_ / count_ - x * x;
    const double slope = spread > kOneDistance * x * x ? (xy_ - x * y_) / (count_ * spread) : 0.0;
    return static_cast<float>(y_ / count_ + slope * (static_cast<double>(z) - x));
  }

 private:
  double count_ = 0.0, x_ = 0.0, y_ = 0.0, xx_ = 0.0, xy_ = 0.0;
};

// depth: as measured. labels: guessed; in place.
[[nodiscard]] inline Status tell_meadows(ImageView<const float> depth, const Intrinsics& camera,
                                         const GroundPlane& ground, ImageView<Label> labels, Workspace& workspace) {
  constexpr int kNarrow = 6;
  constexpr float kTallGrass_m = 0.3F;
  constexpr std::size_t kFew = 5;  // one point in so many may lie higher
  constexpr float kNear = 1.5F;    // farther from the median distance of a piece, or nearer, points may be wrong
  constexpr float kLongest_m = 4.0F;
  constexpr std::size_t kWrong = 20;  // one point in so many at either end may be wrong where a length is told
  const Shape shape = labels.shape();
  const WorkspaceScope scope(workspace);
  ImageView<std::uint8_t> open, patch;
  Span<std::uint32_t> list;
  Span<float> distances;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, open));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, patch));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), list));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), distances));
  const auto box_of = [&](Span<const std::uint32_t> piece) {
    LabelBox box{shape.width, shape.height, -1, -1, piece.size()};
    for (const std::uint32_t i : piece) {
      const auto [x, y] = place_of(i, shape.width);
      box.left = std::min(box.left, x);
      box.right = std::max(box.right, x);
      box.top = std::min(box.top, y);
      box.bottom = std::max(box.bottom, y);
    }
    return box;
  };
  const auto above_m = [&](int x, int y) {
    return height_above_ground(ground, unproject_pixel(camera, x, y, depth(x, y)));
  };
  const int margin = std::max(1, shape.width / 128);
  struct Reach {
    float median = 0.0F;  // 0: no point is valid
    float length = 0.0F;  // along the depth, between the twentieths of all points
  };
  const auto reach_of = [&](Span<const std::uint32_t> piece) -> Reach {
    std::size_t count = 0;
    for (const std::uint32_t i : piece) {
      const float z = depth(place_of(i, shape.width));
      if (is_valid_depth(z)) distances[count++] = z;
    }
    if (count == 0) return {};
    const auto nth = [&](std::size_t n) {
      select_nth(distances.data(), distances.data() + n, distances.data() + count);
      return distances[n];
    };
    const std::size_t few = count / kWrong;
    return {nth(count / 2), nth(count - 1 - few) - nth(few)};
  };
  const auto soil_around = [&](const LabelBox& box, const auto& is_near) {
    SoilLine soil;
    for (int y = std::max(0, box.top - margin); y <= std::min(shape.height - 1, box.bottom + margin); ++y) {
      for (int x = std::max(0, box.left - margin); x <= std::min(shape.width - 1, box.right + margin); ++x) {
        if (labels(x, y) == label::terrain && is_near(depth(x, y))) soil.add(depth(x, y), above_m(x, y));
      }
    }
    return soil;
  };
  const auto is_grass = [&](Span<const std::uint32_t> piece) {
    const LabelBox box = box_of(piece);
    const Reach reach = reach_of(piece);
    const bool is_ground = kGroundLabels.contains(labels(place_of(piece[0], shape.width)));
    if (is_ground && reach.length > kLongest_m) return false;
    const float median = reach.median;
    const auto is_near = [&](float z) { return is_valid_depth(z) && z <= kNear * median && median <= kNear * z; };
    const SoilLine soil = soil_around(box, is_near);
    bool is_told = false;  // its height: at the foot of all that stands is a low point
    std::size_t count = 0;
    std::size_t high = 0;
    for (const std::uint32_t i : piece) {
      const auto [x, y] = place_of(i, shape.width);
      const float z = depth(x, y);
      if (!is_valid_depth(z)) continue;
      ++count;
      if (!is_near(z) || !(above_m(x, y) - soil.at(z) <= kTallGrass_m)) ++high;  // so is what has no height
      is_told = is_told || (is_near(z) && static_cast<float>(y - box.top) * z <= kTallGrass_m * camera.fy);
    }
    return is_told && kFew * high <= count;
  };
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      open(x, y) = labels(x, y) == label::terrain ? 0 : 1;
      patch(x, y) = 0;
    }
  }
  for_pieces(open, list, [&](Span<const std::uint32_t> piece) {
    const LabelBox box = box_of(piece);
    if (box.right - box.left + 1 >= shape.width / kNarrow) return;
    for (const std::uint32_t i : piece) {
      const PixelPlace at = place_of(i, shape.width);
      patch(at) = static_cast<std::uint8_t>(labels(at) + 1);
    }
  });
  const ImageView<std::uint8_t> grass = open;  // all 0
  for_pieces(patch, list, [&](Span<const std::uint32_t> piece) {
    if (!is_grass(piece)) return;
    for (const std::uint32_t i : piece) grass(place_of(i, shape.width)) = 1;
  });
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (grass(x, y) != 0) labels(x, y) = label::terrain;
    }
  }
  return {};
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_MEADOWS_HPP
