// SPDX-License-Identifier: Apache-2.0
// Relative differences |z / reference - 1| of depth over the pixels of a mask: mean, median, 95th percentile.
#ifndef NPSIM_SAMPLES_LAB_DEPTH_SHIFT_HPP
#define NPSIM_SAMPLES_LAB_DEPTH_SHIFT_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/image_view.hpp"
#include "tool/figures.hpp"

namespace npsim::tool {

struct DepthShift {
  std::size_t pixels = 0;
  std::size_t lost = 0;  // pixels of the mask that have no depth; they count nowhere else
  double mean = kNone;
  double median = kNone;
  double most = kNone;  // 95th percentile
};

// All of one shape; the reference is valid wherever the mask is not 0.
[[nodiscard]] DepthShift depth_shift(ImageView<const float> depth, ImageView<const float> reference,
                                     ImageView<const std::uint8_t> mask);

[[nodiscard]] OrderedJson to_json(const DepthShift& shift);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_DEPTH_SHIFT_HPP
