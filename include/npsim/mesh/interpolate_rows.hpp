// SPDX-License-Identifier: Apache-2.0
// Row-wise interpolation of an attribute over missing pixels, with the weights of Algorithm 1.
//
// A run of missing pixels l .. r in a row, between the known pixels l - 1 and r + 1, gets at column j
//   (known[l-1] (r - j + 1) + known[r+1] (j - l + 1)) / (r - l + 2).
// With one known end the run takes its value, with none it stays as it is. A blocked pixel (sky) is neither a source
// nor a target, and ends a run. This is how the albedo behind an object is guessed along with its geometry: pass the
// states that complete_background() wrote.
// Invariant: known and blocked pixels are not touched. Cost: one pass, rows in parallel. Memory: none.
// Error: 3 * 2^-24 of the larger of the two known values.
#ifndef NPSIM_MESH_INTERPOLATE_ROWS_HPP
#define NPSIM_MESH_INTERPOLATE_ROWS_HPP

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

template <class Executor>
[[nodiscard]] Status interpolate_rows(ImageView<const std::uint8_t> state, ImageView<Vec3f> attribute,
                                      Executor& executor) {
  if (attribute.empty()) return {StatusCode::invalid_argument, "the attribute needs at least one pixel"};
  if (state.data() == nullptr || state.shape() != attribute.shape()) {
    return {StatusCode::shape_mismatch, "states and attribute must have one shape"};
  }
  for_rows(executor, attribute.height(), [&](int y) {
    Vec3f* row = attribute.row(y);
    mesh_detail::for_missing_runs(state.row(y), attribute.width(), [row](int l, int r, bool left, bool right) {
      for (int j = l; j <= r && (left || right); ++j) {
        row[j] = left && right ? mesh_detail::between_anchors(row[l - 1], row[r + 1], l, r, j)
                               : (left ? row[l - 1] : row[r + 1]);
      }
    });
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_INTERPOLATE_ROWS_HPP
