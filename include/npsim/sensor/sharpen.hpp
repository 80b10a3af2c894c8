// SPDX-License-Identifier: Apache-2.0
// Sharpening of the shown picture, as cameras do it last: an unsharp mask on its luma.
//
//   c <- c + strength (Y - B * Y) for the three codes alike, Y = (54 r + 183 g + 19 b) / 256, B = (1 2 1) / 4 in either
//   axis, clipped to 0..255. Columns and rows of the border repeat.
// Beside luma of 192 to 240, the most of the 3 x 3, strength falls to 0: round what is clipped it would draw dark
// rings, and make more of the dots that the mosaic leaves there.
// A sinusoid of the highest frequency along a row or a column grows by 1 + strength, one of period 4 by
// 1 + strength / 2; flat areas stay. Noise grows with the edges: white noise of variance 1 to 1 + 1.5 s + .64 s^2.
// Error: rounding to a code. Cost: about 1.5 ns a pixel (AVX2). Memory: the caller's plane.
#ifndef NPSIM_SENSOR_SHARPEN_HPP
#define NPSIM_SENSOR_SHARPEN_HPP

#include <algorithm>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/sensor/detail/signal.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr int kSharpenBelow = 240 * 256;
inline constexpr int kSharpenFade = 48 * 256;

// luma: of the picture's width at least, and its height; what it holds is lost. strength in [0, 4]; 0 changes nothing.
template <class Executor>
[[nodiscard]] Status sharpen(float strength, ImageView<Rgb8> picture, ImageView<float> luma, Executor& executor) {
  if (!(strength >= 0.0F && strength <= 4.0F)) return {StatusCode::invalid_argument, "sharpen: strength in [0, 4]"};
  if (picture.empty() || luma.width() < picture.width() || luma.height() != picture.height()) {
    return {StatusCode::shape_mismatch, "sharpen: a plane of the picture's size is needed"};
  }
  if (strength == 0.0F) return {};
  const Shape shape = picture.shape();
  const auto code = [](int c) { return static_cast<std::uint8_t>(std::min(std::max(c, 0), 255)); };
  for_rows(executor, shape.height, [&](int y) {
    const Rgb8* from = picture.row(y);
    float* to = luma.row(y);
    for (int x = 0; x < shape.width; ++x) {
      to[x] = (54.0F / 256.0F) * static_cast<float>(from[x].r) + (183.0F / 256.0F) * static_cast<float>(from[x].g) +
              (19.0F / 256.0F) * static_cast<float>(from[x].b);
    }
  });
  for_rows(executor, shape.height, [&](int y) {
    const float* rows[3] = {luma.row(y > 0 ? y - 1 : 0), luma.row(y), luma.row(y + 1 < shape.height ? y + 1 : y)};
    Rgb8* to = picture.row(y);
    const auto column = [&](int x) { return rows[0][x] + 2.0F * rows[1][x] + rows[2][x]; };
    // In 256ths and as whole numbers, whose minima and maxima compilers vectorise where those of floats may trap.
    const auto whole = [&](int row, int x) { return static_cast<int>(256.0F * rows[row][x]); };
    const auto brightest = [&](int x) { return std::max(std::max(whole(0, x), whole(1, x)), whole(2, x)); };
    // What the codes of a pixel grow by: whole codes, for all of a stretch first, in loops that compilers vectorise.
    constexpr int kStretch = 128;
    int more[kStretch];
    const auto grow = [&](int x, int left, int right) {
      const float blurred = (column(left) + 2.0F * column(x) + column(right)) * (1.0F / 16.0F);
      const int most = std::max(std::max(brightest(left), brightest(x)), brightest(right));
      const int below = std::min(std::max(kSharpenBelow - most, 0), kSharpenFade);
      const float share = static_cast<float>(below) * (1.0F / static_cast<float>(kSharpenFade));
      return static_cast<int>(share * strength * (rows[1][x] - blurred) + 1024.5F) - 1024;  // rounded, also below 0
    };
    for (int first = 0; first < shape.width; first += kStretch) {
      const int count = std::min(kStretch, shape.width - first);
      const bool begins = first == 0;
      const bool ends = first + count == shape.width;
      for (int i = begins ? 1 : 0; i < count - (ends ? 1 : 0); ++i) {
        more[i] = grow(first + i, first + i - 1, first + i + 1);
      }
      if (begins) more[0] = grow(0, 0, std::min(1, shape.width - 1));
      if (ends) more[count - 1] = grow(shape.width - 1, std::max(shape.width - 2, 0), shape.width - 1);
      for (int i = 0; i < count; ++i) {
        Rgb8& c = to[first + i];
        c = {code(c.r + more[i]), code(c.g + more[i]), code(c.b + more[i])};
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_SHARPEN_HPP
