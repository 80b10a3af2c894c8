// SPDX-License-Identifier: Apache-2.0
// Where one object ends and another begins: distance to the border, and the borders that are depth edges.
//
// Two pixels show one object if their labels are equal and, where there are instances, those too. Without labels all is
// one object and there is no border.
// Distance: from the pixel's centre to the nearest border between pixels, by two chamfer passes with steps of 1 and
// sqrt(2): at most 8 % too long, capped. Cost: O(pixels). Memory: none.
#ifndef NPSIM_DEPTH_DETAIL_OBJECT_BORDERS_HPP
#define NPSIM_DEPTH_DETAIL_OBJECT_BORDERS_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Both views may be empty; otherwise they have one shape.
struct ObjectMap {
  ImageView<const Label> labels;
  ImageView<const std::uint16_t> instances;

  [[nodiscard]] bool same(int x, int y, int other_x, int other_y) const noexcept {
    return (labels.empty() || labels(x, y) == labels(other_x, other_y)) &&
           (instances.empty() || instances(x, y) == instances(other_x, other_y));
  }
  [[nodiscard]] bool fits(Shape shape) const noexcept {
    return (labels.empty() || labels.shape() == shape) && (instances.empty() || instances.shape() == shape);
  }
};

// distance_px: 0.5 beside a border, at most `cap`.
inline void border_distance(const ObjectMap& objects, float cap, ImageView<float> distance_px) noexcept {
  const int width = distance_px.width();
  const int height = distance_px.height();
  constexpr float kDiagonal = 1.41421356F;
  const auto border = [&](int x, int y) {
    return (x > 0 && !objects.same(x, y, x - 1, y)) || (x + 1 < width && !objects.same(x, y, x + 1, y)) ||
           (y > 0 && !objects.same(x, y, x, y - 1)) || (y + 1 < height && !objects.same(x, y, x, y + 1));
  };
  const auto shorten = [&](int x, int y, int from_x, int from_y, float step) {
    if (!distance_px.contains(from_x, from_y)) return;
    const float through = distance_px(from_x, from_y) + step;
    if (through < distance_px(x, y)) distance_px(x, y) = through;
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      distance_px(x, y) = border(x, y) ? 0.5F : cap;
      shorten(x, y, x - 1, y, 1.0F);
      shorten(x, y, x, y - 1, 1.0F);
      shorten(x, y, x - 1, y - 1, kDiagonal);
      shorten(x, y, x + 1, y - 1, kDiagonal);
    }
  }
  for (int y = height - 1; y >= 0; --y) {
    for (int x = width - 1; x >= 0; --x) {
      shorten(x, y, x + 1, y, 1.0F);
      shorten(x, y, x, y + 1, 1.0F);
      shorten(x, y, x + 1, y + 1, kDiagonal);
      shorten(x, y, x - 1, y + 1, kDiagonal);
    }
  }
}

// mask: 1 where the right or the lower neighbour shows another object whose depth differs by more than `jump` of it.
// Those are the pixels whose forward differences lead from one surface to another.
template <class Executor>
[[nodiscard]] Status mark_depth_borders(float jump, ImageView<const float> depth, const ObjectMap& objects,
                                        ImageView<std::uint8_t> mask, Executor& executor) noexcept {
  const Shape shape = depth.shape();
  if (mask.shape() != shape || !objects.fits(shape)) {
    return {StatusCode::shape_mismatch, "depth borders: depth, labels, instances and mask must have one shape"};
  }
  if (!(jump >= 0.0F)) return {StatusCode::invalid_argument, "depth borders: jump must not be negative"};
  executor.for_chunks(static_cast<std::size_t>(shape.height), 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const float z = depth(x, y);
        const auto cut = [&](int i, int j) {
          return depth.contains(i, j) && is_valid_depth(depth(i, j)) && !objects.same(x, y, i, j) &&
                 std::fabs(depth(i, j) - z) > jump * z;
        };
        mask(x, y) = is_valid_depth(z) && (cut(x + 1, y) || cut(x, y + 1)) ? 1 : 0;
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_OBJECT_BORDERS_HPP
