// SPDX-License-Identifier: Apache-2.0
// Spreads a value through a map of bytes to what may take it and touches it.
#ifndef NPSIM_DEPTH_DETAIL_GROW_HPP
#define NPSIM_DEPTH_DETAIL_GROW_HPP

#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

// Turns (x, y) into `to` where it may, may(x, y, from_x, from_y), become what its neighbour (from_x, from_y) is, by
// raster passes to and fro; at most 16, which leaves only windings.
template <class May>
void grow_from(ImageView<std::uint8_t> map, std::uint8_t to, May&& may) noexcept {
  bool changed = true;
  for (int pass = 0; pass < 16 && changed; ++pass) {
    changed = false;
    sweep_to_and_fro(map.shape(), [&](int x, int y, int from_x, int from_y) {
      if (map(x, y) == to || map(from_x, from_y) != to || !may(x, y, from_x, from_y)) return;
      map(x, y) = to;
      changed = true;
    });
  }
}

// The same by the value alone: may(value).
template <class May>
void grow(ImageView<std::uint8_t> map, std::uint8_t to, May&& may) noexcept {
  grow_from(map, to, [&](int x, int y, int, int) { return may(map(x, y)); });
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GROW_HPP
