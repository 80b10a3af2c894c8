// SPDX-License-Identifier: Apache-2.0
// Masks of the pixels that an evaluation counts: 1 or 0.
#ifndef NPSIM_SAMPLES_LAB_MASKS_HPP
#define NPSIM_SAMPLES_LAB_MASKS_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "npsim/core/image_view.hpp"
#include "npsim/io/image.hpp"

namespace npsim::tool {

using Mask = io::Image<std::uint8_t>;

// Pixels where the predicate holds.
template <class Holds>
[[nodiscard]] Mask mask_where(Shape shape, const Holds& holds) {
  Mask mask(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) mask(x, y) = holds(x, y) ? 1 : 0;
  }
  return mask;
}

[[nodiscard]] inline std::size_t marked(const Mask& mask) {
  return static_cast<std::size_t>(std::count(mask.view().pixels().begin(), mask.view().pixels().end(), 1));
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_MASKS_HPP
