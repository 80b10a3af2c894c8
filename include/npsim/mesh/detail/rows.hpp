// SPDX-License-Identifier: Apache-2.0
// States of the pixels of a layer, runs of missing ones in a row, and the weights of Algorithm 1 between their ends.
#ifndef NPSIM_MESH_DETAIL_ROWS_HPP
#define NPSIM_MESH_DETAIL_ROWS_HPP

#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/mesh/detail/layer.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Values of a state plane. Plain constants, so that a mask with 1 = known and 0 = missing is a state plane too.
namespace row_state {
inline constexpr std::uint8_t missing = 0;  // to be completed
inline constexpr std::uint8_t known = 1;    // kept as it is; an anchor for its neighbours
inline constexpr std::uint8_t blocked = 2;  // no surface; nothing is continued across it
}  // namespace row_state

namespace mesh_detail {

// Calls f(l, r, left, right) for each maximal run l .. r of missing pixels of one row; left and right tell whether the
// pixel before and after it is known.
template <class F>
void for_missing_runs(const std::uint8_t* state, int width, F&& f) {
  for (int x = 0; x < width; ++x) {
    if (state[x] != row_state::missing) continue;
    const int l = x;
    while (x + 1 < width && state[x + 1] == row_state::missing) ++x;
    f(l, x, l > 0 && state[l - 1] == row_state::known, x + 1 < width && state[x + 1] == row_state::known);
  }
}

// Algorithm 1, line 10.
[[nodiscard]] inline Vec3f between_anchors(const Vec3f& left, const Vec3f& right, int l, int r, int j) noexcept {
  const auto n = static_cast<float>(r - l + 2);
  return left * (static_cast<float>(r - j + 1) / n) + right * (static_cast<float>(j - l + 1) / n);
}

}  // namespace mesh_detail

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_ROWS_HPP
