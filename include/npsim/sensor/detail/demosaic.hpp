// SPDX-License-Identifier: Apache-2.0
// From the samples behind a mosaic of filters to three channels per pixel, batch by batch along a row.
//
//   bilinear   the mean of the neighbours that have the channel
//   gradient   the mean weighted by 1 / ((own - far)^2 + own^2 + 1.6e-5), far: the sample two pixels away in the
//              neighbour's direction, behind the pixel's own filter; of a diagonal neighbour by the inverse of the sum
//              of its own, its row's and its column's, since each alone misses an edge or a corner. To it comes 1/2
//              (diagonally 3/4) of what the pixel's own sample differs from the mean of the row's and the column's far
//              ones, weighted likewise: at most half of the mean, for either axis apart. Where all weights are alike
//              this is, at red and blue, the filter of Malvar, He and Cutler, "High-quality linear interpolation for
//              demosaicing of Bayer-patterned color images", ICASSP 2004. The weights follow Kimmel, "Demosaicing: image
//              reconstruction from color CCD samples", IEEE Trans. Image Processing 8(9), 1999: colours do not mix over
//              the outline of a lamp, where the linear filters leave a row of dots.
// Both keep the pixel's own sample, constants and slopes.
// `peak` tells of clipped neighbours, which the pixel's colour may be taken from: the mean of the largest samples of
// the four 2x2 quads that the pixel belongs to.
// Borders are mirrored about the outermost pixels, which keeps the order of the filters.
// Cost: about 2.2 ns per pixel (AVX2). Memory: none.
#ifndef NPSIM_SENSOR_DETAIL_DEMOSAIC_HPP
#define NPSIM_SENSOR_DETAIL_DEMOSAIC_HPP

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

// Where the samples of row y begin, and those of two rows above and below it.
struct MosaicRows {
  const float* row[5];
};

[[nodiscard]] inline MosaicRows mosaic_rows(ImageView<const float> plane, int y) noexcept {
  MosaicRows rows{};
  for (int j = 0; j < 5; ++j) rows.row[j] = plane.row(raw_detail::mirrored(y + j - 2, plane.height())) + kMosaicMargin;
  return rows;
}

// The pixels x .. x + n - 1 of row y.
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE DemosaicedPixels<F> demosaic(Demosaic method, Mosaic mosaic, const MosaicRows& rows,
                                                               int x, int y, int n) noexcept {
  const auto at = [&rows, x, n](int dx, int dy) { return load_first<F>(rows.row[dy + 2] + x + dx, n); };
  const F own = at(0, 0);
  const F west = at(-1, 0);
  const F east = at(1, 0);
  const F north = at(0, -1);
  const F south = at(0, 1);
  const F corner[4] = {at(-1, -1), at(1, -1), at(-1, 1), at(1, 1)};
  // Every quad has all filters, so that the mean has no stripes.
  const auto quad = [&](F a, F b, F c) { return max(max(own, a), max(b, c)); };
  const F peak = ((quad(west, north, corner[0]) + quad(east, north, corner[1])) +
                  (quad(west, south, corner[2]) + quad(east, south, corner[3]))) *
                 F(0.25F);
  const auto mix = [](F a, F b, F share_of_a) { return b + (a - b) * share_of_a; };
  const auto corrected = [](F mean, F gradient) {
    const F most = abs(mean) * F(0.5F);
    return mean + simd::clamp(gradient, -most, most);
  };
  F share_west(0.5F), share_north(0.5F);                      // of a pair of neighbours
  F share_x(0.5F);                                            // of the row's pair
  F share_upper(0.5F), share_lower(0.5F), share_above(0.5F);  // of the left corners, and of the upper ones
  F far_x = own;  // what lies beyond either pair, behind the pixel's own filter
  F far_y = own;
  if (method == Demosaic::gradient) {
    const F far[4] = {at(-2, 0), at(2, 0), at(0, -2), at(0, 2)};
    const F least = own * own + F(1.6e-5F);
    F unlike[4];  // of which the weights are the inverses
    for (int i = 0; i < 4; ++i) unlike[i] = (own - far[i]) * (own - far[i]) + least;
    share_west = unlike[1] / (unlike[0] + unlike[1]);
    share_north = unlike[3] / (unlike[2] + unlike[3]);
    // Two pairs of neighbours, each as one: the inverses of their sums of weights, which no range of exposures makes
    // overflow.
    const auto share_of_pairs = [](F a, F share_of_a, F b, F share_of_b) {
      return b * share_of_b / (a * share_of_a + b * share_of_b);
    };
    share_x = share_of_pairs(unlike[0], share_west, unlike[2], share_north);
    const F beyond[4] = {at(-2, -2), at(2, -2), at(-2, 2), at(2, 2)};
    F corners[4];
    for (int i = 0; i < 4; ++i) {
      corners[i] = (own - beyond[i]) * (own - beyond[i]) + unlike[i % 2] + unlike[2 + i / 2];
    }
    share_upper = corners[1] / (corners[0] + corners[1]);
    share_lower = corners[3] / (corners[2] + corners[3]);
    share_above = share_of_pairs(corners[0], share_upper, corners[2], share_lower);
    far_x = mix(far[0], far[1], share_west);
    far_y = mix(far[2], far[3], share_north);
  }
  const F along = corrected(mix(west, east, share_west), (own - far_x) * F(0.5F));      // at green: its row's colour
  const F across = corrected(mix(north, south, share_north), (own - far_y) * F(0.5F));  // and the other
  const F cross = mix(along, across, share_x);                                          // green at red and blue
  const F diagonal =                                                                    // blue at red, red at blue
      corrected(mix(mix(corner[0], corner[1], share_upper), mix(corner[2], corner[3], share_lower), share_above),
                (own - mix(far_x, far_y, share_x)) * F(0.75F));
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

#endif  // NPSIM_SENSOR_DETAIL_DEMOSAIC_HPP
