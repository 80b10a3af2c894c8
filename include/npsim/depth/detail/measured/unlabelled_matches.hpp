// SPDX-License-Identifier: Apache-2.0
// Drops stereo matches that the picture contradicts, in scenes without labels.
//
// Rims: a window that straddles the border of a near thing finds the thing's disparity, so its depth reaches over its
// border by half a window (measured/border_spill.hpp, which knows the borders from labels). Along rows and columns
// what is nearer than its neighbours in the line by more than kMatchContrast of 1/z loses `reach` samples beside them,
// and at most a quarter of itself: the fill finds its border again by the picture (given/unlabelled_borders.hpp).
// Islands: what matching finds where nothing can be matched, in the sky, on smooth asphalt, is a blot of its own depth.
// A connected piece of less than a 500th of the picture, without such a border in it (disparities may be whole
// pixels), is no thing where its mean colour just inside its outline is within kIslandCodes of that just outside.
// Error: what is small and of the colour of its surroundings, far away on most pictures, comes to lie in them.
// Cost: some operations per pixel. Memory: unlabelled_matches_workspace_bytes().
#ifndef NPSIM_DEPTH_DETAIL_MEASURED_UNLABELLED_MATCHES_HPP
#define NPSIM_DEPTH_DETAIL_MEASURED_UNLABELLED_MATCHES_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

inline constexpr float kMatchContrast = 1.2F;  // of 1/z; more from pixel to pixel is a border
inline constexpr float kMatchStep = 1.05F;     // less is one surface
inline constexpr std::size_t kIslands = 500;
inline constexpr float kIslandCodes = 6.0F;

[[nodiscard]] constexpr std::size_t unlabelled_matches_workspace_bytes(Shape shape) noexcept {
  return allocation_bytes<std::uint8_t>(shape.pixels()) + allocation_bytes<std::uint32_t>(shape.pixels()) +
         kWorkspaceAlignment;
}

[[nodiscard]] inline bool within(float ratio, float z, float other) noexcept {
  return z <= ratio * other && other <= ratio * z;
}

// One row or column of `size` samples: depth(i), and drop(i).
template <class Depth, class Drop>
void drop_rims_of_line(int reach, int size, const Depth& depth, const Drop& drop) noexcept {
  int end = 0;
  float before_m = 0.0F;  // the surface that the line came from, at its end
  for (int first = 0; first < size; first = end) {
    end = first + 1;
    if (!is_valid_depth(depth(first))) continue;
    int last = first;
    int count = 1;
    for (; end < size; ++end) {
      const float z = depth(end);
      if (!is_valid_depth(z)) continue;
      if (!within(kMatchStep, z, depth(last))) break;
      last = end;
      ++count;
    }
    const float after_m = end < size ? depth(end) : 0.0F;
    const int rim = std::min(reach, count / 4);
    const auto drop_from = [&](int from, int step) {
      for (int i = from, left = rim; left > 0; i += step) {
        if (!is_valid_depth(depth(i))) continue;
        drop(i);
        --left;
      }
    };
    if (before_m > kMatchContrast * depth(first)) drop_from(first, 1);
    if (after_m > kMatchContrast * depth(last)) drop_from(last, -1);
    before_m = depth(last);
  }
}

// Sums over pairs of pixels just inside and just outside of a piece.
struct OutlineColours {
  Vec3f apart{};
  float count = 0.0F;

  void add(const Rgb8& inside, const Rgb8& outside) noexcept {
    apart = apart + Vec3f{static_cast<float>(inside.r - outside.r), static_cast<float>(inside.g - outside.g),
                          static_cast<float>(inside.b - outside.b)};
    count += 1.0F;
  }
  [[nodiscard]] bool differ() const noexcept {
    return count == 0.0F ||
           !(std::max({std::fabs(apart.x), std::fabs(apart.y), std::fabs(apart.z)}) <= kIslandCodes * count);
  }
};

// measured: in place. reach: of the outline, in pixels.
[[nodiscard]] inline Status drop_islands(ImageView<const Rgb8> image, int reach, ImageView<float> measured,
                                         Workspace& workspace) noexcept {
  const WorkspaceScope scope(workspace);
  constexpr std::uint8_t kOpen = 1, kPiece = 2;
  const std::size_t small = measured.shape().pixels() / kIslands;
  ImageView<std::uint8_t> open;
  Span<std::uint32_t> list;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(measured.shape(), open));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(measured.shape().pixels(), list));
  for (int y = 0; y < open.height(); ++y) {
    for (int x = 0; x < open.width(); ++x) open(x, y) = is_valid_depth(measured(x, y)) ? kOpen : std::uint8_t{0};
  }
  const auto joined = [&](int x, int y, int u, int v) {
    return within(kMatchContrast, measured(x, y), measured(u, v));
  };
  for (int y = 0; y < open.height(); ++y) {
    for (int x = 0; x < open.width(); ++x) {
      if (open(x, y) == 0) continue;
      const Span<const std::uint32_t> piece = list.sub(0, take_piece(open, x, y, list, joined));
      if (piece.size() >= small) continue;
      for (const std::uint32_t pixel : piece) open(place_of(pixel, open.width())) = kPiece;
      OutlineColours colours;
      for (const std::uint32_t pixel : piece) {
        const auto [px, py] = place_of(pixel, open.width());
        for (const auto& [u, v] : {std::array{px - reach, py}, std::array{px + reach, py}, std::array{px, py - reach},
                                   std::array{px, py + reach}}) {
          if (open.contains(u, v) && open(u, v) != kPiece) colours.add(image(px, py), image(u, v));
        }
      }
      for (const std::uint32_t pixel : piece) {
        const PixelPlace at = place_of(pixel, open.width());
        open(at) = 0;
        if (!colours.differ()) measured(at) = 0.0F;
      }
    }
  }
  return {};
}

// depth: as matched. measured: the same without what else cannot be, other memory. reach: half a window of the
// matching; 0: nothing happens.
template <class Executor>
[[nodiscard]] Status drop_unlabelled_matches(ImageView<const Rgb8> image, ImageView<const float> depth, int reach,
                                             ImageView<float> measured, Workspace& workspace, Executor& executor) {
  if (reach == 0) return {};
  NPSIM_RETURN_IF_ERROR(drop_islands(image, std::max(1, reach / 2), measured, workspace));
  for_rows(executor, depth.height(), [&](int y) {
    drop_rims_of_line(
        reach, depth.width(), [&](int x) { return depth(x, y); }, [&](int x) { measured(x, y) = 0.0F; });
  });
  executor.for_chunks(static_cast<std::size_t>(depth.width()), 16, [&](std::size_t begin, std::size_t end) {
    for (int x = static_cast<int>(begin); x < static_cast<int>(end); ++x) {
      drop_rims_of_line(
          reach, depth.height(), [&](int y) { return depth(x, y); }, [&](int y) { measured(x, y) = 0.0F; });
    }
  });
  return {};
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_MEASURED_UNLABELLED_MATCHES_HPP
