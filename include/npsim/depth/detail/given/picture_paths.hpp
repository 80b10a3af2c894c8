// SPDX-License-Identifier: Apache-2.0
// Paths through a picture along which each step counts as a pixel, and colours that differ count more: things end
// where colours do. Up to a width of 960 a code of difference beyond the grain is as long as kPerCode pixels, in wider
// pictures as a longer way, since the edges of things are as strong there and everything is farther apart.
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_PICTURE_PATHS_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_PICTURE_PATHS_HPP

#include <algorithm>

#include "npsim/core/image_view.hpp"
#include "npsim/depth/detail/given/sky_map.hpp"
#include "npsim/depth/detail/grow.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

inline constexpr float kFarOff = 3e38F;  // no path yet

// way: 0 at the seeds, kFarOff elsewhere; gets the length of the shortest path to one, by at most 16 passes to and fro.
// may(x, y, from_x, from_y): whether a path leads there from its neighbour. take, the same: it is the shortest by now.
template <class May, class Take>
void follow_picture(ImageView<const Rgb8> image, ImageView<float> way, const May& may, const Take& take) noexcept {
  constexpr float kReferenceWidth = 960.0F;
  constexpr float kPerCode = 1.0F;
  constexpr int kGrain = 4;  // codes of 255: noise and texture, which would make every way in a surface longer
  const float per_code = kPerCode * std::max(static_cast<float>(image.width()) / kReferenceWidth, 1.0F);
  depth_detail::settle(way.shape(), [&](int x, int y, int from_x, int from_y) {
    if (!(way(from_x, from_y) + 1.0F < way(x, y)) || !may(x, y, from_x, from_y)) return false;
    const int codes = depth_detail::difference(image(x, y), image(from_x, from_y));
    const float by_here = way(from_x, from_y) + 1.0F + per_code * static_cast<float>(std::max(0, codes - kGrain));
    if (!(by_here < way(x, y))) return false;
    way(x, y) = by_here;
    take(x, y, from_x, from_y);
    return true;
  });
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_PICTURE_PATHS_HPP
