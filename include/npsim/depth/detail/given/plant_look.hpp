// SPDX-License-Identifier: Apache-2.0
// How much what stands in a picture looks like leaves, for scenes without labels.
//
// Leaves are green, have edges in all directions and in the finest detail, and shade each other. Over a window of some
// 1.6 degrees about each pixel, of those that show things that stand:
//   coherence  of the structure tensor: edges of one direction (Bigun and Granlund, "Optimal orientation detection of
//              linear symmetry", ICCV 1987)
//   axes       mean of |g|^2 cos 4 phi over that of |g|^2: edges across and upright, as houses have
//   detail     log2 of the mean square of the Laplacian over that of the gradient g
//   green      (2 g - r - b) / (r + g + b), above the picture's median: cameras have casts
//   bright     log2 of luminance, over half the window, above the picture's median
// Gradients are of log2 of luminance. The logarithm of the odds is linear in these; its coefficients are those of a
// logistic regression on 170 labelled frames of CamVid and 5 of Cityscapes. On frames of these and of five other data
// sets that it was not fitted to, the pixel of a plant has higher odds than that of another thing in .76 to .98 of the
// cases (mean .89).
// Pixels are those of a picture whose focal length is some 560 px: larger ones are averaged to that.
// Cost: ten means over windows of that picture. Memory: 10 planes of it.
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_PLANT_LOOK_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_PLANT_LOOK_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/window_filter.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/given/reduced_picture.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

// Pixels of an image that are averaged to one, each way.
[[nodiscard]] inline int plant_look_factor(const Intrinsics& camera) noexcept {
  constexpr float kFocal_px = 560.0F;
  return static_cast<int>(clamp_to(camera.fx / kFocal_px + 0.5F, 1.0F, 64.0F));
}

[[nodiscard]] constexpr std::size_t plant_look_workspace_bytes(Shape shape) noexcept {
  const std::size_t pixels = shape.pixels();  // of the smallest focal length
  return (6 + kWindowMeanPlanes) * allocation_bytes<float>(pixels) + 2 * allocation_bytes<std::uint8_t>(pixels) +
         allocation_bytes<std::uint32_t>(kQuantileBins) + kWorkspaceAlignment;
}

// stands(x, y): whether the pixel of the image shows a thing that stands. odds: natural logarithms, an image of
// reduced_shape() by plant_look_factor(); of no meaning where nothing stands.
template <class Stands, class Executor>
[[nodiscard]] Status plant_look(ImageView<const Rgb8> image, const Intrinsics& camera, const Stands& stands,
                                ImageView<float> odds, Workspace& workspace, Executor& executor) {
  constexpr float kDark = 0.004F;           // added to the light: noise of dark pixels is no texture
  constexpr float kWindow = 7.0F / 500.0F;  // of the focal length, to each side
  constexpr float kFlat = 1e-3F;            // of squared gradients, below which nothing is told
  const WorkspaceScope scope(workspace);
  const int factor = plant_look_factor(camera);
  const Shape shape = odds.shape();
  const float window_px = kWindow * camera.fx / static_cast<float>(factor) + 0.5F;
  const int radius = static_cast<int>(clamp_to(window_px, 1.0F, static_cast<float>(image.width())));
  ImageView<float> log_y, green, mean, xx, yy, xy;
  ImageView<std::uint8_t> standing, inner;
  Span<std::uint32_t> histogram;
  for (ImageView<float>* p : {&log_y, &green, &mean, &xx, &yy, &xy}) {
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, *p));
  }
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, standing));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, inner));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(kQuantileBins, histogram));
  for_pixels(shape, executor, [&](int x, int y) {
    const Vec3f c = mean_light(image, factor, x, y);
    log_y(x, y) = log2_of(luminance(c) + kDark);
    green(x, y) = (2.0F * c.y - c.x - c.z) / (c.x + c.y + c.z + 0.01F);
    standing(x, y) = stands(middle_of(x, factor, image.width()), middle_of(y, factor, image.height())) ? 1 : 0;
  });
  for_pixels(shape, executor, [&](int x, int y) {
    const auto there = [&](int u, int v) { return standing.contains(u, v) && standing(u, v) != 0; };
    inner(x, y) = there(x, y) && there(x - 1, y) && there(x + 1, y) && there(x, y - 1) && there(x, y + 1) ? 1 : 0;
  });
  const auto of_standing = [&](int x, int y) { return static_cast<float>(standing(x, y)); };
  const auto of_inner = [&](int x, int y) { return static_cast<float>(inner(x, y)); };
  const auto gx = [&](int x, int y) { return 0.5F * (log_y(x + 1, y) - log_y(x - 1, y)); };
  const auto gy = [&](int x, int y) { return 0.5F * (log_y(x, y + 1) - log_y(x, y - 1)); };
  const auto window = [&](const auto& weight, const auto& value, int reach, ImageView<float> out) {
    return window_mean(weight, value, reach, 0.0F, 0.0F, workspace, out, executor);
  };
  const auto square = [](float v) { return v * v; };
  NPSIM_RETURN_IF_ERROR(window(
      of_inner, [&](int x, int y) { return square(gx(x, y)); }, radius, xx));
  NPSIM_RETURN_IF_ERROR(window(
      of_inner, [&](int x, int y) { return square(gy(x, y)); }, radius, yy));
  NPSIM_RETURN_IF_ERROR(window(
      of_inner, [&](int x, int y) { return gx(x, y) * gy(x, y); }, radius, xy));
  const auto energy = [&](int x, int y) { return std::max(xx(x, y) + yy(x, y), 0.0F) + kFlat; };
  for_pixels(shape, executor, [&](int x, int y) {
    const float along = xx(x, y) - yy(x, y);
    odds(x, y) = -1.261F - 0.996F * std::sqrt(square(along) + 4.0F * square(xy(x, y))) / energy(x, y);
  });
  const auto upright = [&](int x, int y) {
    const float u = square(gx(x, y));
    const float v = square(gy(x, y));
    return (u * u - 6.0F * u * v + v * v) / (u + v + kFlat);
  };
  NPSIM_RETURN_IF_ERROR(window(of_inner, upright, radius, mean));
  for_pixels(shape, executor, [&](int x, int y) { odds(x, y) -= 1.784F * mean(x, y) / energy(x, y); });
  const auto laplacian = [&](int x, int y) {
    return 4.0F * log_y(x, y) - log_y(x - 1, y) - log_y(x + 1, y) - log_y(x, y - 1) - log_y(x, y + 1);
  };
  NPSIM_RETURN_IF_ERROR(window(
      of_inner, [&](int x, int y) { return square(laplacian(x, y)); }, radius, mean));
  for_pixels(shape, executor,
             [&](int x, int y) { odds(x, y) += 0.79F * log2_of((std::max(mean(x, y), 0.0F) + kFlat) / energy(x, y)); });
  const auto all = [](int, int) { return true; };
  const float usual_green = plane_quantile(shape, all, green, 0.5F, histogram);
  const float usual_light = plane_quantile(shape, all, log_y, 0.5F, histogram);
  NPSIM_RETURN_IF_ERROR(window(of_standing, green, radius, mean));
  for_pixels(shape, executor, [&](int x, int y) { odds(x, y) += 10.087F * (mean(x, y) - usual_green); });
  NPSIM_RETURN_IF_ERROR(window(of_standing, log_y, std::max(1, radius / 2), mean));
  for_pixels(shape, executor, [&](int x, int y) { mean(x, y) = odds(x, y) - 0.217F * (mean(x, y) - usual_light); });
  return window(of_standing, mean, radius, odds);
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_PLANT_LOOK_HPP
