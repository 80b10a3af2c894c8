// SPDX-License-Identifier: Apache-2.0
// From the samples behind a mosaic of filters to three channels per pixel, batch by batch along a row.
//
//   bilinear   the mean of the neighbours that have the channel
//   gradient   corrected by the Laplacian of the channel that the pixel has: the 5x5 filters of Malvar, He and Cutler,
//              "High-quality linear interpolation for demosaicing of Bayer-patterned color images", ICASSP 2004
// Both keep the pixel's own sample, and both are linear but for one limit: the gradient filters overshoot at edges,
// about a lamp by far, so they change the mean of the neighbours by half of it at most.
// `peak` tells of clipped neighbours, which the pixel's colour may be taken from: the mean of the largest samples of
// the four 2x2 quads that the pixel belongs to.
// Borders are mirrored about the outermost pixels, which keeps the order of the filters.
// Cost: about 1 ns per pixel (AVX2). Memory: none.
#ifndef NPSIM_SENSOR_DEMOSAIC_HPP
#define NPSIM_SENSOR_DEMOSAIC_HPP

#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/sensor/raw.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

enum class Demosaic : std::uint8_t { bilinear, gradient };

template <class F>
struct DemosaicedPixels {
  simd::F32x3<F> rgb;
  F peak;
};

// The pixels x .. x + n - 1 of row y. plane: as capture() makes it.
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE DemosaicedPixels<F> demosaic(Demosaic method, Mosaic mosaic,
                                                               ImageView<const float> plane, int x, int y,
                                                               int n) noexcept {
  const float* rows[5];
  for (int j = 0; j < 5; ++j) rows[j] = plane.row(raw_detail::mirrored(y + j - 2, plane.height())) + kMosaicMargin + x;
  const auto at = [&rows, n](int dx, int dy) { return load_first<F>(rows[dy + 2] + dx, n); };
  const F own = at(0, 0);
  const F west = at(-1, 0);
  const F east = at(1, 0);
  const F north = at(0, -1);
  const F south = at(0, 1);
  const F corner[4] = {at(-1, -1), at(1, -1), at(-1, 1), at(1, 1)};
  const F beside = west + east;
  const F above = north + south;
  const F corners = (corner[0] + corner[1]) + (corner[2] + corner[3]);
  // Every quad has all filters, so that the mean has no stripes.
  const auto quad = [&](F a, F b, F c) { return max(max(own, a), max(b, c)); };
  const F peak = ((quad(west, north, corner[0]) + quad(east, north, corner[1])) +
                  (quad(west, south, corner[2]) + quad(east, south, corner[3]))) *
                 F(0.25F);
  F cross = (beside + above) * F(0.25F);  // green at red and blue
  F diagonal = corners * F(0.25F);        // blue at red, red at blue
  F along = beside * F(0.5F);             // at green: the colour of its row
  F across = above * F(0.5F);             // at green: the other
  if (method == Demosaic::gradient) {
    const F far_beside = at(-2, 0) + at(2, 0);
    const F far_above = at(0, -2) + at(0, 2);
    const F far = far_beside + far_above;
    const F ring = own * F(5.0F) - corners;
    const auto corrected = [](F mean, F gradient) {
      const F most = abs(mean) * F(0.5F);
      return mean + simd::clamp(gradient * F(0.125F), -most, most);
    };
    cross = corrected(cross, own * F(4.0F) - far);
    diagonal = corrected(diagonal, own * F(6.0F) - far * F(1.5F));
    along = corrected(along, ring - far_beside + far_above * F(0.5F));
    across = corrected(across, ring - far_above + far_beside * F(0.5F));
  }
  const bool red_row = filter_at(mosaic, 0, y) == 0 || filter_at(mosaic, 1, y) == 0;
  const bool green_first = filter_at(mosaic, x, y) == 1;
  using I = typename F::Int;
  const auto green = (I::iota() & I(1)) == I(green_first ? 0 : 1);
  const F of_row = select(green, along, own);
  const F of_others = select(green, across, diagonal);
  return {{red_row ? of_row : of_others, select(green, own, cross), red_row ? of_others : of_row}, peak};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_DEMOSAIC_HPP
