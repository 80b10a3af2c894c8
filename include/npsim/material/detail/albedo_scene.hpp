// SPDX-License-Identifier: Apache-2.0
// What is known of a photograph whose materials are wanted, as views over caller's memory.
//
// All but the photograph may be empty, and then tells nothing: without labels the ground is found by depth and ground
// plane, without instances objects of a label are not told apart. Planes have the photograph's shape.
#ifndef NPSIM_MATERIAL_DETAIL_ALBEDO_SCENE_HPP
#define NPSIM_MATERIAL_DETAIL_ALBEDO_SCENE_HPP

#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/ground.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct AlbedoScene {
  ImageView<const Rgb8> image;  // sRGB
  ImageView<const Label> labels;
  ImageView<const std::uint16_t> instances;  // equal id and label: one object; 0: not told apart
  ImageView<const float> depth;              // z-depth, m; 0 where there is no surface
  ImageView<const Vec3f> normals;            // unit, facing the camera; zero: not known
  Intrinsics camera;                         // read where there is depth or a ground plane
  GroundPlane ground;                        // inlier_share 0: not known
};

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_ALBEDO_SCENE_HPP
