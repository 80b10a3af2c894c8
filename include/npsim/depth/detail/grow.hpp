// SPDX-License-Identifier: Apache-2.0
// Spreads what pixels have to their neighbours: passes until nothing changes, and a value through a map of bytes.
#ifndef NPSIM_DEPTH_DETAIL_GROW_HPP
#define NPSIM_DEPTH_DETAIL_GROW_HPP

#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

// Passes over the image to and fro, step(x, y, from_x, from_y) for each pixel and its neighbours behind it, until no
// step says that it changed anything; at most 16 times, which leaves only windings.
template <class Step>
void settle(Shape shape, Step&& step) noexcept {
  bool changed = true;
  for (int pass = 0; pass < 16 && changed; ++pass) {
    changed = false;
    sweep_to_and_fro(shape, [&](int x, int y, int from_x, int from_y) {
      if (step(x, y, from_x, from_y)) changed = true;
    });
  }
}

// Turns (x, y) into `to` where it may, may(x, y, from_x, from_y), become what its neighbour (from_x, from_y) is.
template <class May>
void grow_from(ImageView<std::uint8_t> map, std::uint8_t to, May&& may) noexcept {
  settle(map.shape(), [&](int x, int y, int from_x, int from_y) {
    if (map(x, y) == to || map(from_x, from_y) != to || !may(x, y, from_x, from_y)) return false;
    map(x, y) = to;
    return true;
  });
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
