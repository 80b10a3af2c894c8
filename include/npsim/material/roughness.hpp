// SPDX-License-Identifier: Apache-2.0
// Roughness (GGX alpha) of every pixel by its class, dry or wet, where no inverse-rendering network supplies it.
//
// Wetness blends road, parking, pavement and ground towards the alpha of a water film. Cost: one look-up per pixel.
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

struct RoughnessParams {
  float wetness = 0.0F;     // 0 dry .. 1 wet: blends road, parking and pavement towards wet_alpha
  float wet_alpha = 0.12F;  // .05-.2 under a film of water
};

[[nodiscard]] inline Status validate(const RoughnessParams& p) noexcept {
  const bool good = p.wetness >= 0.0F && p.wetness <= 1.0F && p.wet_alpha > 0.0F && p.wet_alpha <= 1.0F;
  return good ? Status() : Status(StatusCode::invalid_argument, "roughness: wetness in 0..1, wet_alpha in (0, 1]");
}

// GGX alpha by class. `labels` may be empty: one class.
template <class Executor>
Status estimate_roughness(const RoughnessParams& p, ImageView<const Label> labels, ImageView<float> alpha,
                          Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(p));
  if (alpha.empty()) return Status(StatusCode::invalid_argument, "roughness: the output is empty");
  if (!labels.empty() && labels.shape() != alpha.shape()) {
    return Status(StatusCode::shape_mismatch, "roughness: labels must have the shape of the output");
  }
  constexpr LabelSet kWet = LabelSet::of(label::road, label::parking, label::sidewalk, label::ground);
  executor.for_chunks(static_cast<std::size_t>(alpha.height()), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      const int y = static_cast<int>(row);
      for (int x = 0; x < alpha.width(); ++x) {
        const Label l = labels.empty() ? label::unlabeled : labels(x, y);
        const float dry = surface_prior(l).alpha;
        alpha(x, y) = kWet.contains(l) ? dry + (p.wet_alpha - dry) * p.wetness : dry;
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_ROUGHNESS_HPP
