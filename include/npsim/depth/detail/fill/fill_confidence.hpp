// SPDX-License-Identifier: Apache-2.0
// How far filled depth can be trusted, by how far away the next measurement is.
#ifndef NPSIM_DEPTH_DETAIL_FILL_FILL_CONFIDENCE_HPP
#define NPSIM_DEPTH_DETAIL_FILL_FILL_CONFIDENCE_HPP

#include <cmath>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

// Confidence falls off as e^(-steps / reach), steps being those to the nearest measured pixel, along rows and columns.
inline constexpr float kConfidenceReach_px = 8.0F;
inline void rate_confidence(ImageView<const float> measured, float reach_px, ImageView<float> confidence) noexcept {
  const Shape shape = confidence.shape();
  const float step = std::exp(-1.0F / max_of(reach_px, 1.0F));
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) confidence(x, y) = is_valid_depth(measured(x, y)) ? 1.0F : 0.0F;
  }
  sweep_to_and_fro(shape, [&](int x, int y, int from_x, int from_y) {
    confidence(x, y) = max_of(confidence(x, y), step * confidence(from_x, from_y));
  });
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_FILL_FILL_CONFIDENCE_HPP
