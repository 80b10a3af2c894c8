// SPDX-License-Identifier: Apache-2.0
// The dual-reference variance filter straight from its definition, in double: what uncertainty() is tested against.
#ifndef NPSIM_TESTS_REFERENCE_UNCERTAINTY_HPP
#define NPSIM_TESTS_REFERENCE_UNCERTAINTY_HPP

#include <cstdint>
#include <vector>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
namespace reference {

struct Uncertainty {
  std::vector<double> variance;  // of the window at its upper-left pixel; 0 where there is none
  std::vector<std::uint8_t> edge;
  std::vector<std::uint8_t> windows;
  std::vector<std::uint8_t> mask;
};

inline Uncertainty uncertainty(ImageView<const float> depth, ImageView<const Label> labels, int l, double threshold,
                               LabelSet foreground) {
  const Shape shape = depth.shape();
  Uncertainty out;
  out.variance.assign(shape.pixels(), 0.0);
  out.edge.assign(shape.pixels(), 0);
  out.windows.assign(shape.pixels(), 0);
  out.mask.assign(shape.pixels(), 0);
  for (int y = 0; y + l <= shape.height; ++y) {
    for (int x = 0; x + l <= shape.width; ++x) {
      double shift = 0;
      double sum = 0;
      std::uint64_t held = 0;
      int count = 0;
      for (int j = y; j < y + l; ++j) {
        for (int i = x; i < x + l; ++i) {
          if (!is_valid_depth(depth(i, j))) continue;
          if (count == 0) shift = static_cast<double>(depth(i, j));
          sum += static_cast<double>(depth(i, j)) - shift;
          held |= std::uint64_t{1} << (labels(i, j) < kLabelCount ? labels(i, j) : label::unlabeled);
          ++count;
        }
      }
      if (count < 2) continue;
      const double mean = sum / count;  // beyond the shift
      double squares = 0;
      for (int j = y; j < y + l; ++j) {
        for (int i = x; i < x + l; ++i) {
          if (!is_valid_depth(depth(i, j))) continue;
          const double from_mean = static_cast<double>(depth(i, j)) - shift - mean;
          squares += from_mean * from_mean;
        }
      }
      const std::size_t at =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(shape.width) + static_cast<std::size_t>(x);
      out.variance[at] = squares / count;
      out.edge[at] = (held & (held - 1)) != 0 && (held & foreground.bits()) != 0 ? 1 : 0;
      out.windows[at] = out.edge[at] != 0 && out.variance[at] > threshold ? 1 : 0;
      if (out.windows[at] == 0) continue;
      for (int j = 0; j < l; ++j) {
        for (int i = 0; i < l; ++i) {
          out.mask[at + static_cast<std::size_t>(j) * static_cast<std::size_t>(shape.width) +
                   static_cast<std::size_t>(i)] = 1;
        }
      }
    }
  }
  return out;
}

}  // namespace reference
}  // namespace npsim

#endif  // NPSIM_TESTS_REFERENCE_UNCERTAINTY_HPP
