// SPDX-License-Identifier: Apache-2.0
// The bonnet of the car that carries the camera, where labels do not tell it.
//
// Networks and simulators give it a depth. As a surface of the street it would take all light of the own headlamps,
// which are in it. Bonnet is what lies flat (rises by less than 45 degrees to what is measured next, a 32nd to an
// eighth of the picture further up, or has nothing there), lower than the camera by kOwnCarBelow, higher above the
// ground than kOwnCarAbove and nearer than kOwnCarNear, all in heights of the camera: depth may be of another scale. A
// picture shows one if that is so in nine tenths of the middle half of its lowest row, if it sees far (a hundredth of
// it kOwnCarFar away, or sky: in a room it may be a table), and if the camera is kOwnCarCamera_m high: what goes on the
// pavement sees kerbs so. The bonnet goes on from that row. A network draws its outline as a ramp over some pixels:
// what gets farther from it by more than kOwnCarRamp of its depth in a width of the picture, and stands above the
// ground, is none of the street either. Nor is what lies below all that in its column: holes, and what noise bends.
// What stands upright on it (a star) is not found. A camera outside a car may take what lies flat right before it, a
// platform or a table, for a bonnet.
// Cost: a pass over the lowest rows, where there is a bonnet up to 34 over the picture. Memory: none.
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_OWN_CAR_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_OWN_CAR_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/depth/detail/grow.hpp"
#include "npsim/depth/detail/neighbouring_points.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

inline constexpr float kOwnCarNear = 2.2F;
inline constexpr float kOwnCarAbove = 0.25F;
inline constexpr float kOwnCarBelow = 0.1F;
inline constexpr float kOwnCarFar = 10.0F;
inline constexpr float kOwnCarRamp = 20.0F;
inline constexpr float kOwnCarCamera_m = 0.8F;

// What labels may call a bonnet, and what their guess may.
inline constexpr LabelSet kBonnetLabels =
    LabelSet::of(label::unlabeled, label::static_object, label::dynamic_object, label::car, label::truck, label::bus);
inline constexpr LabelSet kGuessedBonnetLabels =
    kGroundLabels | LabelSet::of(label::unlabeled, label::building, label::vegetation);

// depth: as measured. may_be: what is labelled otherwise stays, and so does a marked light. light_index: or empty.
inline void mark_own_car(ImageView<const float> depth, const Intrinsics& camera, const GroundPlane& ground,
                         LabelSet may_be, ImageView<const std::uint16_t> light_index,
                         ImageView<Label> labels) noexcept {
  constexpr int kLowest = 16;  // of the height: what may be cut off below
  constexpr int kApart = 32;   // of the height: rows between which something rises
  constexpr float kFoot = 0.1F;
  constexpr std::size_t kInPicture = 100;
  const int width = depth.width();
  const int height = depth.height();
  const float camera_m = ground.camera_height_m;
  if (!(ground.inlier_share > 0.0F) || camera_m < kOwnCarCamera_m) return;
  const auto is_allowed = [&](int x, int y) {
    return may_be.contains(labels(x, y)) && (light_index.empty() || light_index(x, y) == 0);
  };
  // Above that many heights of the camera, and below it.
  const auto stands = [&](int x, int y, float above) {
    if (!is_valid_depth(depth(x, y)) || !is_allowed(x, y)) return false;
    const float height_m = height_above_ground(ground, unproject_pixel(camera, x, y, depth(x, y)));
    return height_m > above * camera_m && height_m < (1.0F - kOwnCarBelow) * camera_m;
  };
  const auto recedes = [&](int x, int y) {
    const int apart = std::max(1, height / kApart);
    for (int v = y - apart; v >= std::max(0, y - 4 * apart); --v) {
      if (!is_valid_depth(depth(x, v))) continue;
      const Slope slope = slope_to(depth, camera, ground, unproject_pixel(camera, x, y, depth(x, y)), x, v);
      return slope.rise_m < slope.along_m;
    }
    return true;
  };
  const auto is_bonnet = [&](int x, int y) {
    return stands(x, y, kOwnCarAbove) && depth(x, y) < kOwnCarNear * camera_m && recedes(x, y);
  };
  const auto lowest = [&](int x) {
    int y = height - 1;
    while (y > height - 1 - height / kLowest && !is_valid_depth(depth(x, y))) --y;
    return y;
  };
  int columns = 0;
  for (int x = width / 4; x < width - width / 4; ++x) columns += is_bonnet(x, lowest(x)) ? 1 : 0;
  if (columns == 0 || 10 * columns < 9 * (width - 2 * (width / 4))) return;
  std::size_t far = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      if (labels(x, y) == label::ego_vehicle) return;  // they do tell it
      const bool deep = is_valid_depth(depth(x, y)) && depth(x, y) > kOwnCarFar * camera_m;
      far += deep || labels(x, y) == label::sky ? 1U : 0U;
    }
  }
  if (kInPicture * far < depth.shape().pixels()) return;
  for (int x = 0; x < width; ++x) {
    if (is_bonnet(x, lowest(x))) labels(x, lowest(x)) = label::ego_vehicle;
  }
  const float ramp = kOwnCarRamp / static_cast<float>(width);
  depth_detail::grow_from(labels, label::ego_vehicle, [&](int x, int y, int from_x, int from_y) {
    return is_bonnet(x, y) || (stands(x, y, kFoot) && depth(x, y) > (1.0F + ramp) * depth(from_x, from_y));
  });
  for (int x = 0; x < width; ++x) {
    int top = 0;
    while (top < height && labels(x, top) != label::ego_vehicle) ++top;
    for (int y = top; y < height; ++y) {
      if (is_allowed(x, y)) labels(x, y) = label::ego_vehicle;
    }
  }
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_OWN_CAR_HPP
