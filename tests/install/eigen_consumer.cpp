// SPDX-License-Identifier: Apache-2.0
// A user with images and poses in Eigen's types.
#include <Eigen/Geometry>

#include "npsim/interop/eigen.hpp"
#include "npsim/npsim.hpp"

int main() {
  Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> depth_m(3, 4);
  depth_m.setConstant(7.0F);
  depth_m(1, 2) = 0.0F;
  const npsim::ImageView<float> view = npsim::as_image_view(depth_m);
  view(2, 1) = view(1, 1);
  const npsim::ViewPose pose = npsim::to_view_pose(Eigen::Isometry3f::Identity());
  return depth_m(1, 2) == 7.0F && npsim::validate(pose).ok() ? 0 : 1;
}
