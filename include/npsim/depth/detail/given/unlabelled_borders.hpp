// SPDX-License-Identifier: Apache-2.0
// Where one surface ends and another begins, in scenes without labels: depth says that, the picture where.
//
// Between two measurements of unlike depth the field that fills the gap may fall anywhere, and falls along a ramp: a
// wall between a car and the road beside it, which headlamps light. Each pixel without a measurement is taken for a
// part of the measured one that is nearest along a path where colours count (given/picture_paths.hpp), of ground or of
// what stands as guessed: as far away as that, on the ground as its plane scaled to it. Where two neighbours then
// differ by more than kBorderJump of 1/z and in colour by kEdgeCodes, a surface ends: both get that depth, as virtual
// measurements for the fill alone. Where the picture shows no edge the ramp stays: either side may be wrong.
// Ground has no such steps within it, only measurements that disagree.
// Error: on four generated streets, within 4 px of edges of depth, mean relative error .17 where it was .28 (a laser of
// 64 lines), .070 where it was .081 (stereo, with measured/unlabelled_matches.hpp).
// Cost: at most 16 passes to and fro. Memory: unlabelled_borders_workspace_bytes().
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_UNLABELLED_BORDERS_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_UNLABELLED_BORDERS_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/given/picture_paths.hpp"
#include "npsim/depth/detail/ground_level.hpp"
#include "npsim/depth/detail/object_borders.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

[[nodiscard]] constexpr std::size_t unlabelled_borders_workspace_bytes(Shape shape) noexcept {
  return 2 * allocation_bytes<float>(shape.pixels()) + kWorkspaceAlignment;
}

// labels: guessed. measured: in place.
[[nodiscard]] inline Status pin_borders(ImageView<const Rgb8> image, ImageView<const Label> labels,
                                        const GroundPlane& ground, const Intrinsics& camera, ImageView<float> measured,
                                        Workspace& workspace) {
  constexpr float kBorderJump = 0.1F;  // more than between two lines of a scanner on a bonnet
  constexpr int kEdgeCodes = 12;       // of 255: three times the grain of paths
  const WorkspaceScope scope(workspace);
  ImageView<float> way;
  ImageView<float> w;  // 1/z of the measurement that a pixel belongs to; 0: of none
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(measured.shape(), way));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(measured.shape(), w));
  for (int y = 0; y < w.height(); ++y) {
    for (int x = 0; x < w.width(); ++x) {
      const bool given = is_valid_depth(measured(x, y)) && labels(x, y) != label::sky;
      w(x, y) = given ? 1.0F / measured(x, y) : 0.0F;
      way(x, y) = given ? 0.0F : kFarOff;
    }
  }
  const auto side = [&](int x, int y) {
    return labels(x, y) == label::sky ? 0 : (kGroundLabels.contains(labels(x, y)) ? 1 : 2);
  };
  follow_picture(
      image, way,
      [&](int x, int y, int from_x, int from_y) { return side(x, y) != 0 && side(x, y) == side(from_x, from_y); },
      [&](int x, int y, int from_x, int from_y) {
        w(x, y) = w(from_x, from_y);
        if (side(x, y) != 1) return;
        const float here = depth_detail::fall_of_ray(ground, camera, x, y);
        const float there = depth_detail::fall_of_ray(ground, camera, from_x, from_y);
        if (here > 0.0F && there > 0.0F) w(x, y) *= here / there;
      });
  const auto pin = [&](int x, int y) {
    const float z = 1.0F / w(x, y);
    if (!is_valid_depth(measured(x, y)) && is_valid_depth(z)) measured(x, y) = z;
  };
  for (int y = 0; y < w.height(); ++y) {
    for (int x = 0; x < w.width(); ++x) {
      const auto compare = [&](int u, int v) {
        if (!w.contains(u, v) || !(w(x, y) > 0.0F && w(u, v) > 0.0F)) return;
        if (side(x, y) == 1 && side(u, v) == 1) return;
        const float more = w(x, y) > w(u, v) ? w(x, y) : w(u, v);
        if (!(std::fabs(w(x, y) - w(u, v)) > kBorderJump * more)) return;
        if (depth_detail::difference(image(x, y), image(u, v)) < kEdgeCodes) return;
        pin(x, y);
        pin(u, v);
      };
      compare(x + 1, y);
      compare(x, y + 1);
    }
  }
  return {};
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_UNLABELLED_BORDERS_HPP
