// SPDX-License-Identifier: Apache-2.0
// The bonnet of the car that carries the camera, where labels do not tell it.
//
// Networks and simulators give it a depth. As a surface of the street the own headlamps, which are in it, would light
// nothing else. In a picture that sees far, nothing but the own car reaches over half of the lowest row nearer than
// kOwnCarNear and higher above the ground than kOwnCarAbove, in heights of the camera: depth may be of another scale.
// Far is a hundredth of the picture, kOwnCarFar away or sky: in a room it may be a table. The bonnet goes on as far as
// something is as near and as high. A network draws its outline as a ramp over some pixels: what gets farther from it
// by more than kOwnCarRamp of its depth in a width of the picture, and stands above the ground, is none of the street
// either. Nor is what was not measured between it and the lowest row.
// Cost: a pass over the lowest rows, where there is a bonnet up to 34 over the picture. Memory: none.
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_OWN_CAR_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_OWN_CAR_HPP

#include <cstddef>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/depth/detail/grow.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

inline constexpr float kOwnCarNear = 2.2F;
inline constexpr float kOwnCarAbove = 0.25F;
inline constexpr float kOwnCarFar = 10.0F;
inline constexpr float kOwnCarRamp = 20.0F;

// depth: as measured. kept: labels that are right.
inline void mark_own_car(ImageView<const float> depth, const Intrinsics& camera, const GroundPlane& ground,
                         LabelSet kept, ImageView<Label> labels) noexcept {
  constexpr int kLowest = 16;  // of the height: what may be cut off below
  constexpr float kFoot = 0.1F;
  constexpr std::size_t kInPicture = 100;
  const int width = depth.width();
  const int height = depth.height();
  if (!(ground.inlier_share > 0.0F)) return;
  const auto stands = [&](int x, int y, float above) {
    if (!is_valid_depth(depth(x, y)) || kept.contains(labels(x, y))) return false;
    const Vec3f p = unproject_pixel(camera, x, y, depth(x, y));
    return height_above_ground(ground, p) > above * ground.camera_height_m;
  };
  const auto is_near = [&](int x, int y) {
    return stands(x, y, kOwnCarAbove) && depth(x, y) < kOwnCarNear * ground.camera_height_m;
  };
  const auto lowest = [&](int x) {
    int y = height - 1;
    while (y > height - 1 - height / kLowest && !is_valid_depth(depth(x, y))) --y;
    return y;
  };
  int columns = 0;
  for (int x = 0; x < width; ++x) columns += is_near(x, lowest(x)) ? 1 : 0;
  if (2 * columns < width) return;
  std::size_t far = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const bool deep = is_valid_depth(depth(x, y)) && depth(x, y) > kOwnCarFar * ground.camera_height_m;
      far += deep || labels(x, y) == label::sky ? 1U : 0U;
    }
  }
  if (kInPicture * far < depth.shape().pixels()) return;
  for (int x = 0; x < width; ++x) {
    if (is_near(x, lowest(x))) labels(x, lowest(x)) = label::ego_vehicle;
  }
  const float ramp = kOwnCarRamp / static_cast<float>(width);
  depth_detail::grow_from(labels, label::ego_vehicle, [&](int x, int y, int from_x, int from_y) {
    return is_near(x, y) || (stands(x, y, kFoot) && depth(x, y) > (1.0F + ramp) * depth(from_x, from_y));
  });
  for (int x = 0; x < width; ++x) {
    int top = height;
    for (int y = height - 1; y >= 0 && (!is_valid_depth(depth(x, y)) || labels(x, y) == label::ego_vehicle); --y) {
      if (labels(x, y) == label::ego_vehicle) top = y;
    }
    for (int y = top; y < height; ++y) labels(x, y) = label::ego_vehicle;
  }
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_OWN_CAR_HPP
