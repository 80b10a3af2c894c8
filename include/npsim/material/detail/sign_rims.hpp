// SPDX-License-Identifier: Apache-2.0
// Which pixels of a sign's label show what is behind it.
//
// Labels are drawn as polygons around signs, a little too wide or some pixels beside them. By day nobody sees it; at
// night a sign shines by its sheeting, and the wall within its outline would shine too. So the rim is walked from
// outside inwards for as long as the picture shows the colour of the pixel outside at which the walk began, at most
// kReach of the picture's width. A white border before a white wall is lost with it.
// Cost: some operations per pixel of signs. Memory: the caller's.
#ifndef NPSIM_MATERIAL_DETAIL_SIGN_RIMS_HPP
#define NPSIM_MATERIAL_DETAIL_SIGN_RIMS_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace retro_detail {

// rim: 1 where a pixel of a sign shows what is behind it, else 0. is_sign(x, y): also for pixels outside of the picture.
// walk: memory, one number a pixel. from: the same, as an image.
template <class IsSign>
void find_rims(ImageView<const Rgb8> picture, const IsSign& is_sign, Span<std::uint32_t> walk,
               ImageView<std::uint32_t> from, ImageView<std::uint8_t> rim) noexcept {
  constexpr float kReach = 1.0F / 160.0F;
  constexpr int kNoise = 12;  // of 8 bits: sensor, compression, the wall's own grain
  constexpr int kX[4] = {1, -1, 0, 0};
  constexpr int kY[4] = {0, 0, 1, -1};
  const Shape shape = rim.shape();
  const auto width = static_cast<std::uint32_t>(shape.width);
  const int reach_px = clamp_to(static_cast<int>(kReach * static_cast<float>(shape.width) + 0.5F), 1, 254);
  const auto colour = [&](std::uint32_t pixel) {
    return picture(static_cast<int>(pixel % width), static_cast<int>(pixel / width));
  };
  const auto near = [](std::uint8_t a, std::uint8_t b) { return (a > b ? a - b : b - a) <= kNoise; };
  const auto alike = [&](const Rgb8& a, const Rgb8& b) { return near(a.r, b.r) && near(a.g, b.g) && near(a.b, b.b); };
  // In rim: the steps that the walk has come, while it goes on.
  std::size_t count = 0;
  const auto reach = [&](int x, int y, std::uint32_t outside, int steps) {
    if (rim(x, y) != 0 || !alike(picture(x, y), colour(outside))) return;
    rim(x, y) = static_cast<std::uint8_t>(steps);
    from(x, y) = outside;
    walk[count++] = static_cast<std::uint32_t>(y) * width + static_cast<std::uint32_t>(x);
  };
  for (std::uint8_t& r : rim.pixels()) r = 0;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (!is_sign(x, y)) continue;
      for (int k = 0; k < 4; ++k) {
        const int u = x + kX[k];
        const int v = y + kY[k];
        if (!rim.contains(u, v) || is_sign(u, v)) continue;
        reach(x, y, static_cast<std::uint32_t>(v) * width + static_cast<std::uint32_t>(u), 1);
      }
    }
  }
  for (std::size_t next = 0; next < count; ++next) {
    const auto x = static_cast<int>(walk[next] % width);
    const auto y = static_cast<int>(walk[next] / width);
    if (rim(x, y) >= reach_px) continue;
    for (int k = 0; k < 4; ++k) {
      if (is_sign(x + kX[k], y + kY[k])) reach(x + kX[k], y + kY[k], from(x, y), rim(x, y) + 1);
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    rim(static_cast<int>(walk[i] % width), static_cast<int>(walk[i] / width)) = 1;
  }
}

}  // namespace retro_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_SIGN_RIMS_HPP
