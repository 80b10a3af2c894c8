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

// Turns what may become `to` and touches it into it, by raster passes to and fro; at most 16, which leaves only
// windings.
template <class May>
void grow(ImageView<std::uint8_t> map, std::uint8_t to, May&& may) noexcept {
  const auto touch = [&](int x, int y, int i, int j) {
    if (!may(map(x, y)) || !map.contains(i, j) || map(i, j) != to) return false;
    map(x, y) = to;
    return true;
  };
  bool changed = true;
  for (int pass = 0; pass < 16 && changed; ++pass) {
    changed = false;
    for (int y = 0; y < map.height(); ++y) {
      for (int x = 0; x < map.width(); ++x) {
        if (touch(x, y, x - 1, y) || touch(x, y, x, y - 1)) changed = true;
      }
    }
    for (int y = map.height() - 1; y >= 0; --y) {
      for (int x = map.width() - 1; x >= 0; --x) {
        if (touch(x, y, x + 1, y) || touch(x, y, x, y + 1)) changed = true;
      }
    }
  }
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GROW_HPP
