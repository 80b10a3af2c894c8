// SPDX-License-Identifier: Apache-2.0
// is_valid_depth() (core/camera.hpp) in lanes: where depths are numbers above 0. Exact. Memory: none.
#ifndef NPSIM_DEPTH_DETAIL_VALID_DEPTHS_HPP
#define NPSIM_DEPTH_DETAIL_VALID_DEPTHS_HPP

#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE typename F::MaskType are_valid_depths(F z) noexcept {
  return (z > F(0.0F)) & simd::is_finite(z);
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_VALID_DEPTHS_HPP
