// SPDX-License-Identifier: Apache-2.0
// Roughness (GGX alpha) of every pixel by its class, dry, where no inverse-rendering network supplies it, and the alpha
// of such a network's roughness.
//
// Cost: one look-up per pixel.
#ifndef NPSIM_MATERIAL_ROUGHNESS_HPP
#define NPSIM_MATERIAL_ROUGHNESS_HPP

#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/material/detail/class_priors.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Roughness as renderers, glTF and networks give it, 0..1, looks even; GGX alpha is its square (Burley, SIGGRAPH 2012).
[[nodiscard]] constexpr float alpha_of_roughness(float roughness) noexcept { return roughness * roughness; }

// GGX alpha by class. `labels` may be empty: one class.
template <class Executor>
Status estimate_roughness(ImageView<const Label> labels, ImageView<float> alpha, Executor& executor) {
  if (alpha.empty()) return Status(StatusCode::invalid_argument, "roughness: the output is empty");
  if (!labels.empty() && labels.shape() != alpha.shape()) {
    return Status(StatusCode::shape_mismatch, "roughness: labels must have the shape of the output");
  }
  executor.for_chunks(static_cast<std::size_t>(alpha.height()), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      const int y = static_cast<int>(row);
      for (int x = 0; x < alpha.width(); ++x) {
        alpha(x, y) = surface_prior(labels.empty() ? label::unlabeled : labels(x, y)).alpha;
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_ROUGHNESS_HPP
