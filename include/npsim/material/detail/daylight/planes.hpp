// SPDX-License-Identifier: Apache-2.0
// What the steps of de-lighting share.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_PLANES_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_PLANES_HPP

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/window_filter.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

using Plane = ImageView<float>;

inline constexpr float kLog2E = 1.44269504F;
inline constexpr float kLn2 = 0.69314718F;

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_PLANES_HPP
