// SPDX-License-Identifier: Apache-2.0
// Where the objects of a plane of ids lie: the smallest upright rectangle about the pixels of each, and their number.
//
// Error: none. Cost: one pass, and one over the boxes. Memory: the caller's boxes.
#ifndef NPSIM_LABELS_BOXES_HPP
#define NPSIM_LABELS_BOXES_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// In pixels; the last ones are inside. Without pixels: left > right.
struct LabelBox {
  int left = 0;
  int top = 0;
  int right = -1;
  int bottom = -1;
  std::size_t pixels = 0;
};

// boxes[id] of every id; ids beyond the boxes are passed over.
inline void label_boxes(ImageView<const std::uint16_t> ids, Span<LabelBox> boxes) noexcept {
  for (LabelBox& box : boxes) box = {};
  for (int y = 0; y < ids.height(); ++y) {
    for (int x = 0; x < ids.width(); ++x) {
      if (ids(x, y) >= boxes.size()) continue;
      LabelBox& box = boxes[ids(x, y)];
      if (box.pixels++ == 0) {
        box.left = box.right = x;
        box.top = y;
      }
      if (x < box.left) box.left = x;
      if (x > box.right) box.right = x;
      box.bottom = y;
    }
  }
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LABELS_BOXES_HPP
