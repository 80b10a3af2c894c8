// SPDX-License-Identifier: Apache-2.0
// Things that stand before the rest of a street, in scenes without labels: cars, people, barriers.
//
// Of what a guess of labels calls a building (depth/detail/given/guessed_labels.hpp), by the completed depth:
//   low       Seen from above, in cells of some columns by a 20th of the depth: hardly anything in a cell or in those
//             around it is higher than kThing_m over the ground plane. A wall that goes on above is not low.
//   apart     Low pixels that hang together are one thing if they are no specks, stand on the ground plane, neither
//             above nor below it, and end: above most of their upper outline something farther away or the sky is seen.
//             (Below a crown only the foot of a house is seen, and nothing says that it ends there.) Nor does the same
//             surface go on beside more than a fifth of its outline, in a cell that is not low: half a car would differ
//             from the other half by more than their paint.
// Only materials ask (albedo and gloss): a black car is no dark facade. The mesh does not, which would take what is
// missed of a thing's rim for what stands behind it.
// Error: what touches a wall, lorries, poles, and what stands where the street leaves the plane stay buildings. Low
// walls are things however long they are, and so is a ground floor before a storey that stands back.
// Cost: .1 to .3 s for 1920x1080 on one core of an AMD EPYC (Zen). Memory: tell_things_workspace_bytes().
#ifndef NPSIM_DEPTH_THINGS_HPP
#define NPSIM_DEPTH_THINGS_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/given/small_pieces.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace things_detail {

inline constexpr float kThing_m = 2.6F;  // vans are 2 to 2.6 m high
inline constexpr int kCellsAcross = 240;
inline constexpr int kCellsPerOctave = 14;
inline constexpr int kCellOctaves = 12;           // of depth, from half a metre
inline constexpr std::size_t kLeastThing = 4000;  // that many fill the picture
inline constexpr float kFarther = 1.1F;           // of depth: no longer the thing

[[nodiscard]] constexpr int cell_width_px(Shape picture) noexcept { return std::max(1, picture.width / kCellsAcross); }
[[nodiscard]] constexpr Shape cells_shape(Shape picture) noexcept {
  return {(picture.width - 1) / cell_width_px(picture) + 1, kCellsPerOctave * kCellOctaves};
}

// How many pixels stand where, seen from above.
struct StreetCells {
  ImageView<std::uint32_t> all, tall;
  ImageView<std::uint8_t> low;  // 1 where hardly anything is tall
  int column_px = 1;

  [[nodiscard]] Status allocate(Shape picture, Workspace& workspace) {
    column_px = cell_width_px(picture);
    for (ImageView<std::uint32_t>* cells : {&all, &tall}) {
      NPSIM_RETURN_IF_ERROR(workspace.allocate_image(cells_shape(picture), *cells));
      for (std::uint32_t& n : cells->pixels()) n = 0;
    }
    return workspace.allocate_image(cells_shape(picture), low);
  }
  [[nodiscard]] int row(float z) const noexcept {
    return clamp_to(static_cast<int>((log2_of(z) + 1.0F) * kCellsPerOctave), 0, all.height() - 1);
  }
  void add(int x, float z, bool is_tall) const noexcept {
    const int far = row(z);
    ++all(x / column_px, far);
    if (is_tall) ++tall(x / column_px, far);
  }
  // After all was added.
  void settle() const noexcept {
    constexpr std::uint32_t kHardly = 10;  // a tenth
    for (int y = 0; y < all.height(); ++y) {
      for (int x = 0; x < all.width(); ++x) {
        std::uint32_t seen = 0;
        std::uint32_t high = 0;
        for (int k = 0; k < 9; ++k) {
          const int u = x + k % 3 - 1;
          const int v = y + k / 3 - 1;
          if (!all.contains(u, v)) continue;
          seen += all(u, v);
          high += tall(u, v);
        }
        low(x, y) = high * kHardly <= seen ? 1 : 0;
      }
    }
  }
};

struct Standing {
  ImageView<const float> depth;
  Intrinsics camera;
  GroundPlane ground;
  ImageView<const Label> labels;
  StreetCells cells;
  int ramp_px = 1;  // between two surfaces depth may have been filled that far

  [[nodiscard]] bool stands(int x, int y) const noexcept {
    return labels(x, y) == label::building && is_valid_depth(depth(x, y));
  }
  [[nodiscard]] float height_m(int x, int y) const noexcept {
    return height_above_ground(ground, unproject_pixel(camera, x, y, depth(x, y)));
  }
  [[nodiscard]] bool is_low(int x, int y) const noexcept {
    return stands(x, y) && cells.low(x / cells.column_px, cells.row(depth(x, y))) != 0;
  }
  [[nodiscard]] bool joined(int x, int y, int u, int v) const noexcept {
    return depth(x, y) <= kFarther * depth(u, v) && depth(u, v) <= kFarther * depth(x, y);
  }
  // Whether what is seen above (x, y) is behind it.
  [[nodiscard]] bool ends(int x, int y) const noexcept {
    float nearest = depth(x, y);
    for (int v = y + 1; v <= std::min(y + ramp_px, depth.height() - 1) && stands(x, v); ++v) {
      nearest = std::min(nearest, depth(x, v));
    }
    for (int v = y - 1; v >= std::max(0, y - ramp_px); --v) {
      if (labels(x, v) == label::sky || depth(x, v) > kFarther * nearest) return true;
    }
    return false;
  }
  // Beside (x, y) in its row: whether the piece ends there, and whether its surface goes on all the same.
  struct Side {
    bool outline = false;
    bool goes_on = false;
  };
  [[nodiscard]] Side side(int x, int y, int u) const noexcept {
    constexpr float kSame = 0.01F;  // of depth, from pixel to pixel
    if (u < 0 || u >= depth.width() || !stands(u, y)) return {true, false};
    if (is_low(u, y)) return {!joined(x, y, u, y), false};
    return {true, std::fabs(depth(x, y) - depth(u, y)) < kSame * depth(x, y)};
  }
  // piece: y * width + x of low pixels.
  [[nodiscard]] bool is_thing(Span<const std::uint32_t> piece) const noexcept {
    constexpr float kFoot_m = 0.5F;   // as near does a thing come to the ground plane
    constexpr std::size_t kFew = 10;  // a tenth of it may be below that
    constexpr std::size_t kPart = 5;  // a fifth of its sides may go on
    if (piece.size() * kLeastThing < depth.shape().pixels()) return false;
    float lowest_m = kThing_m;
    std::size_t below = 0;
    std::size_t outline = 0;
    std::size_t ended = 0;
    std::size_t sides = 0;
    std::size_t cut = 0;
    for (const std::uint32_t pixel : piece) {
      const auto [x, y] = place_of(pixel, depth.width());
      const float high_m = height_m(x, y);
      lowest_m = std::min(lowest_m, high_m);
      if (high_m < -kFoot_m) ++below;
      for (const int u : {x - 1, x + 1}) {
        const Side beside = side(x, y, u);
        sides += beside.outline ? 1 : 0;
        cut += beside.goes_on ? 1 : 0;
      }
      if (y > 0 && is_low(x, y - 1) && joined(x, y, x, y - 1)) continue;
      ++outline;
      if (ends(x, y)) ++ended;
    }
    return lowest_m < kFoot_m && below * kFew < piece.size() && 2 * ended > outline && cut * kPart < sides;
  }
};

}  // namespace things_detail

[[nodiscard]] constexpr std::size_t tell_things_workspace_bytes(Shape shape) noexcept {
  return 2 * allocation_bytes<std::uint32_t>(things_detail::cells_shape(shape).pixels()) +
         allocation_bytes<std::uint8_t>(things_detail::cells_shape(shape).pixels()) +
         refine_detail::close_pieces_bytes(shape) +  // telling pieces apart takes as much
         kWorkspaceAlignment;
}

// labels: guessed, in place: things become label::dynamic_object, which is nowhere before. things: their numbers, from
// 1; 0 elsewhere. depth: 0 or less only in the sky.
[[nodiscard]] inline Status tell_things(ImageView<const float> depth, const Intrinsics& camera,
                                        const GroundPlane& ground, ImageView<Label> labels,
                                        ImageView<std::uint16_t> things, Workspace& workspace) {
  using namespace things_detail;
  const Shape shape = labels.shape();
  if (depth.shape() != shape || things.shape() != shape) {
    return {StatusCode::shape_mismatch, "things: all planes must have one shape"};
  }
  for (std::uint16_t& t : things.pixels()) t = 0;
  if (!(ground.inlier_share > 0.0F)) return {};
  constexpr float kRamp_px = 8.0F;  // at a width of 960
  const WorkspaceScope scope(workspace);
  Standing street{depth, camera, ground, labels, {}, 1};
  street.ramp_px = static_cast<int>(kRamp_px * std::max(1.0F, static_cast<float>(shape.width) / 960.0F));
  NPSIM_RETURN_IF_ERROR(street.cells.allocate(shape, workspace));
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (street.stands(x, y)) street.cells.add(x, depth(x, y), street.height_m(x, y) > kThing_m);
    }
  }
  street.cells.settle();
  {
    const WorkspaceScope pieces(workspace);
    ImageView<std::uint8_t> open;
    Span<std::uint32_t> list;
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, open));
    NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), list));
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) open(x, y) = street.is_low(x, y) ? 1 : 0;
    }
    std::uint16_t number = 0;  // fewer than kLeastThing
    const auto joined = [&](int x, int y, int u, int v) { return street.joined(x, y, u, v); };
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        if (open(x, y) == 0) continue;
        const Span<const std::uint32_t> piece = list.sub(0, take_piece(open, x, y, list, joined));
        if (!street.is_thing(piece)) continue;
        ++number;
        for (const std::uint32_t pixel : piece) things(place_of(pixel, shape.width)) = number;
      }
    }
  }
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (things(x, y) != 0) labels(x, y) = label::dynamic_object;
    }
  }
  // Panes and ramps between the parts of a thing.
  NPSIM_RETURN_IF_ERROR(refine_detail::close_pieces(
      labels, [](Label l) { return l == label::building; }, [](Label) { return true; }, label::dynamic_object,
      shape.pixels() / kLeastThing, workspace));
  sweep_to_and_fro(shape, [&](int x, int y, int i, int j) {
    if (labels(x, y) == label::dynamic_object && things(x, y) == 0) things(x, y) = things(i, j);
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_THINGS_HPP
