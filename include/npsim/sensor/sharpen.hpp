// SPDX-License-Identifier: Apache-2.0
// Sharpening of the shown picture, as cameras do it last: an unsharp mask on its luma.
//
//   c <- c + strength (Y - B * Y) for the three codes alike, Y = (54 r + 183 g + 19 b) / 256, B = (1 2 1) / 4 in either
//   axis, clipped to 0..255. Columns and rows of the border repeat.
// A sinusoid of the highest frequency along a row or a column grows by 1 + strength, one of period 4 by
// 1 + strength / 2; flat areas stay. Noise grows with the edges: white noise of variance 1 to 1 + 1.5 s + .64 s^2.
// Error: rounding to a code. Cost: about 3 ns a pixel. Memory: the caller's plane.
#ifndef NPSIM_SENSOR_SHARPEN_HPP
#define NPSIM_SENSOR_SHARPEN_HPP

#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/sensor/detail/signal.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// luma: of the picture's width at least, and its height; what it holds is lost. strength in [0, 4]; 0 changes nothing.
template <class Executor>
[[nodiscard]] Status sharpen(float strength, ImageView<Rgb8> picture, ImageView<float> luma, Executor& executor) {
  if (!(strength >= 0.0F && strength <= 4.0F)) return {StatusCode::invalid_argument, "sharpen: strength in [0, 4]"};
  if (picture.empty() || luma.width() < picture.width() || luma.height() != picture.height()) {
    return {StatusCode::shape_mismatch, "sharpen: a plane of the picture's size is needed"};
  }
  if (strength == 0.0F) return {};
  const Shape shape = picture.shape();
  for_rows(shape, executor, [&](int y) {
    const Rgb8* from = picture.row(y);
    float* to = luma.row(y);
    for (int x = 0; x < shape.width; ++x) {
      to[x] = (54.0F / 256.0F) * static_cast<float>(from[x].r) + (183.0F / 256.0F) * static_cast<float>(from[x].g) +
              (19.0F / 256.0F) * static_cast<float>(from[x].b);
    }
  });
  for_rows(shape, executor, [&](int y) {
    const float* rows[3] = {luma.row(y > 0 ? y - 1 : 0), luma.row(y), luma.row(y + 1 < shape.height ? y + 1 : y)};
    Rgb8* to = picture.row(y);
    const auto column = [&](int x) { return rows[0][x] + 2.0F * rows[1][x] + rows[2][x]; };
    for (int x = 0; x < shape.width; ++x) {
      const int left = x > 0 ? x - 1 : 0;
      const int right = x + 1 < shape.width ? x + 1 : x;
      const float blurred = (column(left) + 2.0F * column(x) + column(right)) * (1.0F / 16.0F);
      const float more = strength * (rows[1][x] - blurred) + 0.5F;
      const auto code = [more](std::uint8_t c) {
        return static_cast<std::uint8_t>(clamp_to(static_cast<float>(c) + more, 0.0F, 255.0F));
      };
      to[x] = {code(to[x].r), code(to[x].g), code(to[x].b)};
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_SHARPEN_HPP
