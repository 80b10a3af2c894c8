// SPDX-License-Identifier: Apache-2.0
// Pictures made smaller by an integral factor, for looks that are told at one scale. What is left over at the right and
// lower border does not count.
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_REDUCED_PICTURE_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_REDUCED_PICTURE_HPP

#include <algorithm>

#include "npsim/color/srgb.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

[[nodiscard]] constexpr Shape reduced_shape(Shape shape, int factor) noexcept {
  return {std::max(1, shape.width / factor), std::max(1, shape.height / factor)};
}

// What a plane of the reduced picture says of a pixel.
template <class T>
[[nodiscard]] const T& reduced_at(const ImageView<T>& reduced, int factor, int x, int y) noexcept {
  return reduced(std::min(x / factor, reduced.width() - 1), std::min(y / factor, reduced.height() - 1));
}

// The pixel in the middle of those that are averaged to one, and their mean light, in linear RGB.
[[nodiscard]] constexpr int middle_of(int reduced, int factor, int size) noexcept {
  return std::min(reduced * factor + factor / 2, size - 1);
}
[[nodiscard]] inline Vec3f mean_light(ImageView<const Rgb8> image, int factor, int x, int y) noexcept {
  Vec3f sum;
  float n = 0.0F;
  for (int v = y * factor; v < std::min((y + 1) * factor, image.height()); ++v) {
    for (int u = x * factor; u < std::min((x + 1) * factor, image.width()); ++u) {
      sum += srgb_decode8(image(u, v));
      n += 1.0F;
    }
  }
  return sum * (1.0F / n);
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_REDUCED_PICTURE_HPP
