// SPDX-License-Identifier: Apache-2.0
// Where the kerbs of a street are: each so many-th row with pavement and carriageway votes for the lines that pass
// between them (Hough), both sides for one vanishing column, then once more in finer steps. Part of street_floor.hpp,
// which has the geometry.
//
// Cost: labels and states of about 256 to 512 rows, 64 pixels at a time, and 70 votes for each. Memory: two ranges per
// row, and 35 KiB of stack. Error: a pixel at the bottom.
#ifndef NPSIM_MESH_DETAIL_STREET_KERBS_HPP
#define NPSIM_MESH_DETAIL_STREET_KERBS_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/span.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/detail/foreground/pixels.hpp"
#include "npsim/mesh/detail/street/floor.hpp"
#include "npsim/mesh/interpolate_rows.hpp"
#include "npsim/mesh/prune.hpp"
#include "npsim/simd/bytes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Columns of one row between which a kerb has to be: the last of pavement and the first of carriageway, or the other
// way round. Empty where end <= begin.
struct KerbRange {
  std::int32_t begin = 0;
  std::int32_t end = 0;
};

namespace mesh_detail {

// Of the rows, only each so many-th votes.
[[nodiscard]] inline int kerb_row_step(Shape shape) noexcept { return std::max(1, shape.height / 256); }

// left: outermost pavement to the carriageway; right likewise.
template <class F>
[[nodiscard]] std::array<KerbRange, 2> find_kerbs(const StreetFloorParams& params, const Label* labels,
                                                  const std::uint8_t* state, int width) noexcept {
  using U = simd::BytesOf<F>;
  const LabelTest<U> is_pavement(params.pavement);
  const LabelTest<U> is_carriageway(params.carriageway);
  std::array<KerbRange, 2> found{};
  for (int side = 0; side < 2; ++side) {
    int last = -1;  // pavement passed last
    for (int x = 0; x < width; x += kWordBits) {
      const int at = side == 0 ? x : (width - 1) / kWordBits * kWordBits - x;
      const int n = std::min(kWordBits, width - at);
      const std::uint64_t known = test_bytes<U>(state + at, n, [](U s) { return equal_bits(s, U(row_state::known)); });
      if (known == 0) continue;
      const std::uint64_t pavement = known & test_bytes<U>(labels + at, n, is_pavement);
      std::uint64_t carriageway = known & test_bytes<U>(labels + at, n, is_carriageway);
      if (last < 0) {  // only what comes after pavement
        if (pavement == 0) continue;
        carriageway &= side == 0 ? ~low_bits(lowest_set_bit(pavement)) : low_bits(highest_set_bit(pavement) + 1);
      }
      if (carriageway == 0) {
        if (pavement != 0) last = at + (side == 0 ? highest_set_bit(pavement) : lowest_set_bit(pavement));
        continue;
      }
      const int first = side == 0 ? lowest_set_bit(carriageway) : highest_set_bit(carriageway);
      const std::uint64_t before = pavement & (side == 0 ? low_bits(first + 1) : ~low_bits(first));
      if (before != 0) last = at + (side == 0 ? highest_set_bit(before) : lowest_set_bit(before));
      found[static_cast<std::size_t>(side)] = side == 0 ? KerbRange{last, at + first} : KerbRange{at + first, last};
      break;
    }
  }
  return found;
}

// One vote over vanishing columns and slopes. Slopes run in t = s / (1 + |s|), which has them all in -1 .. 1.
struct KerbVote {
  static constexpr int kColumns = 33;
  static constexpr int kSlopes = 128;
  static constexpr std::uint32_t kWeight =
      256;  // of a row that allows one slope only; fewer per slope if it allows more
  double first_x = 0, step_x = 0;
  std::array<double, 2> first_t{}, step_t{};  // left, right
  std::array<std::array<std::uint32_t, kSlopes + 1>, kColumns> votes[2]{};

  void cast(int side, const KerbRange& range, double row_below, int column) noexcept {
    const double x = first_x + step_x * column;
    const auto bin = [&](int at) {
      const double s = (at - x) / row_below;
      return (s / (1 + std::fabs(s)) - first_t[static_cast<std::size_t>(side)]) /
             step_t[static_cast<std::size_t>(side)];
    };
    const double a = bin(range.begin);
    const double b = bin(range.end);
    if (!(b >= 0 && a < kSlopes)) return;
    const int low = static_cast<int>(std::max(a, 0.0));
    const int high = static_cast<int>(std::min(b, kSlopes - 1.0));
    const std::uint32_t weight = kWeight / static_cast<std::uint32_t>(b - a + 1.0);
    auto& row = votes[side][static_cast<std::size_t>(column)];
    row[static_cast<std::size_t>(low)] += weight;
    row[static_cast<std::size_t>(high) + 1] -= weight;  // wraps; the running sum wraps back
  }

  struct Peak {
    std::uint32_t height = 0;
    double t = 0;  // middle of the slopes with that many
  };
  [[nodiscard]] Peak peak(int side, int column) const noexcept {
    std::uint32_t sum = 0;
    Peak best;
    int first = 0;
    int last = -2;
    for (int i = 0; i < kSlopes; ++i) {
      sum += votes[side][static_cast<std::size_t>(column)][static_cast<std::size_t>(i)];
      if (sum > best.height) {
        best.height = sum;
        first = i;
        last = i;
      } else if (sum == best.height && last == i - 1) {
        last = i;
      }
    }
    const auto s = static_cast<std::size_t>(side);
    best.t = first_t[s] + step_t[s] * (0.5 * (first + last) + 0.5);
    return best;
  }
};

inline void find_vanishing_column(const StreetFloor& floor, double x, StreetFloor& out) noexcept {
  out.vanishing_x = x;
  out.vanishing_y = -(floor.constant + floor.per_column * x) / floor.per_row;
}

inline void vote_kerbs(Span<const KerbRange> ranges, Shape shape, const Intrinsics& k, StreetFloor& floor) noexcept {
  constexpr double kSpread = 0.35;  // of the width: how far the street may turn from straight ahead
  constexpr double kAhead = 16;     // rows that have to speak for such a turn
  constexpr std::uint32_t kEnough = 5 * KerbVote::kWeight;
  const int row_step = kerb_row_step(shape);
  KerbVote vote;
  vote.step_x = 2 * kSpread * shape.width / (KerbVote::kColumns - 1);
  vote.first_x = static_cast<double>(k.cx) - kSpread * shape.width;
  vote.first_t = {-1.0, 0.0};
  vote.step_t = {1.0 / KerbVote::kSlopes, 1.0 / KerbVote::kSlopes};
  find_vanishing_column(floor, static_cast<double>(k.cx), floor);
  for (int round = 0; round < 2; ++round) {
    for (int column = 0; column < KerbVote::kColumns; ++column) {
      StreetFloor at;
      find_vanishing_column(floor, vote.first_x + vote.step_x * column, at);
      for (int y = 0; y < shape.height; y += row_step) {
        const double below = y - at.vanishing_y;
        if (!(below > 0.005 * shape.width)) continue;  // too near to the horizon to tell one line from another
        for (int side = 0; side < 2; ++side) {
          const KerbRange& range = ranges[static_cast<std::size_t>(2 * y + side)];
          if (range.end > range.begin) vote.cast(side, range, below, column);
        }
      }
    }
    double most = 0;
    int best = KerbVote::kColumns / 2;
    for (int column = 0; column < KerbVote::kColumns; ++column) {
      const double off =
          std::fabs(vote.first_x + vote.step_x * column - static_cast<double>(k.cx)) / (kSpread * shape.width);
      const double sum = static_cast<double>(vote.peak(0, column).height) +
                         static_cast<double>(vote.peak(1, column).height) - kAhead * KerbVote::kWeight * off;
      if (column > 0 && sum <= most) continue;
      most = sum;
      best = column;
    }
    find_vanishing_column(floor, vote.first_x + vote.step_x * best, floor);
    vote.first_x = floor.vanishing_x - vote.step_x;
    vote.step_x *= 2.0 / (KerbVote::kColumns - 1);
    for (int side = 0; side < 2; ++side) {
      const auto s = static_cast<std::size_t>(side);
      const KerbVote::Peak peak = vote.peak(side, best);
      const double slope = peak.t / (1 - std::fabs(peak.t));
      // The finer round has less weight per slope.
      const bool found = round == 0 ? peak.height >= kEnough : floor.kerb_slope[s] != 0.0 && peak.height > 0;
      if (found) floor.kerb_slope[s] = slope;
      vote.first_t[s] = peak.t - 4 * vote.step_t[s];
      vote.step_t[s] *= 8.0 / KerbVote::kSlopes;
    }
    vote.votes[0] = {};
    vote.votes[1] = {};
  }
}

}  // namespace mesh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_STREET_KERBS_HPP
