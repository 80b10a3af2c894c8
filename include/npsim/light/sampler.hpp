// SPDX-License-Identifier: Apache-2.0
// Picks one of a few candidates in proportion to its weight, by inverting the cumulative sum with one uniform number.
//
// P(i) = w_i / sum w. Weights that are zero, negative, infinite or NaN are never picked. The picked index is
// non-decreasing in u, so stratified u give stratified picks. Sums run in double, in index order: the same bits
// everywhere.
// Cost: two passes over the weights; right for short lists, where an alias table would not pay.
#ifndef NPSIM_LIGHT_SAMPLER_HPP
#define NPSIM_LIGHT_SAMPLER_HPP

#include <cmath>
#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct LightPick {
  std::size_t index = 0;     // meaningful only where probability > 0
  float probability = 0.0F;  // of this index; 0: no candidate has a weight
};


// `u` in [0, 1).
[[nodiscard]] inline LightPick pick_by_weight(Span<const float> weights, float u) noexcept {
  const auto usable = [](float w) { return w > 0.0F && std::isfinite(w); };
  double total = 0.0;
  for (const float w : weights) {
    if (usable(w)) total += static_cast<double>(w);
  }
  LightPick pick;
  if (!(total > 0.0)) return pick;
  const double target = static_cast<double>(u) * total;
  double sum = 0.0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    if (!usable(weights[i])) continue;
    sum += static_cast<double>(weights[i]);
    pick.index = i;  // the last usable one stays where rounding leaves the target at the total
    if (target < sum) break;
  }
  pick.probability = static_cast<float>(static_cast<double>(weights[pick.index]) / total);
  return pick;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LIGHT_SAMPLER_HPP
