// SPDX-License-Identifier: Apache-2.0
// The best anchor above each missing pixel of a row: of its own column, or of one near by in the same piece of a run,
// so that a pole or a sign does not hide what is above the car behind it. Part of street_background.hpp.
//
// An anchor of inverse depth w, dy pixels above a column dx pixels beside, counts w (dy / above_weight + dx *
// above_weight); the least counts, of equals the nearer column, then the left one.
// Cost: about six instructions for as many pixels as there are lanes and each column that is looked at. Memory: the
// caller's. Error: each score two roundings.
#ifndef NPSIM_MESH_DETAIL_STREET_CREST_HPP
#define NPSIM_MESH_DETAIL_STREET_CREST_HPP

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>

#include "npsim/mesh/detail/connect.hpp"
#include "npsim/mesh/detail/street/columns.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace mesh_detail {

// Columns from which an anchor above is borrowed: so many to either side, in the run and in the strip.
inline constexpr int kMaxColumnReach = 32;
[[nodiscard]] inline int column_reach(int width) noexcept { return std::min(kMaxColumnReach, width / 80); }

// What is carried down a strip of columns of one chunk of rows.
struct StreetCarried {
  std::array<float, kStripColumns + simd::kMaxLanes> upright{}, anchor_row{}, floor{}, floor_row{};
  void take(const ColumnGuess& g, int y, std::size_t column) noexcept {
    upright[column] = g.upright;
    floor[column] = g.floor;
    anchor_row[column] = static_cast<float>(y - g.above);
    floor_row[column] = static_cast<float>(y + g.below);
  }
};

// What is above a piece of a run, from its first column on: inverse depth, 0 for nothing, and how far it counts.
struct StreetCrest {
  static constexpr int kRoom = kStripColumns + 2 * kMaxColumnReach + simd::kMaxLanes;
  std::array<float, kRoom> own{}, own_score{};  // of the columns themselves, kMaxColumnReach on
  std::array<float, kStripColumns + simd::kMaxLanes> inverse_depth{}, score{};
};

// n columns from `first` of the strip on, in row y.
template <class F>
void find_crest(float above_weight, int reach, int y, std::size_t first, int n, const StreetCarried& carried,
                StreetCrest& crest) noexcept {
  const F zero(0.0F);
  const F none(std::numeric_limits<float>::infinity());
  const F per_above(1.0F / above_weight);
  reach = std::min(reach, n - 1);
  float* w = crest.own.data() + kMaxColumnReach;
  float* score = crest.own_score.data() + kMaxColumnReach;
  for (int i = 0; i < n; i += F::lanes) {
    const F of = F::load(carried.upright.data() + first + i);
    const F distance = F(static_cast<float>(y)) - F::load(carried.anchor_row.data() + first + i);
    of.store(w + i);
    select(of > zero, distance * per_above * of, none).store(score + i);
  }
  for (int i = 1; i <= reach; ++i) {
    w[-i] = w[n - 1 + i] = 0.0F;
    score[-i] = score[n - 1 + i] = std::numeric_limits<float>::infinity();
  }
  const F surely(1.0F + 0x1p-20F);  // a tie goes to the nearer column, then to the left one
  for (int i = 0; i < n; i += F::lanes) {
    F best = F::load(w + i);
    F least = F::load(score + i);
    for (int k = 1; k <= reach; ++k) {
      const F far(static_cast<float>(k) * above_weight);
      for (const int at : {i - k, i + k}) {
        const F of = F::load(w + at);
        const F counts = fma(far, of, F::load(score + at));
        const auto better = counts * surely < least;
        best = select(better, of, best);
        least = select(better, counts, least);
      }
    }
    best.store(crest.inverse_depth.data() + i);
    least.store(crest.score.data() + i);
  }
}

}  // namespace mesh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_STREET_CREST_HPP
