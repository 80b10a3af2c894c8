// SPDX-License-Identifier: Apache-2.0
// What is behind the objects of a street, guessed per pixel: its floor, or something that stands on it, whichever is
// nearer to the camera. The inverse depth is the greater of
//   - the floor's (street_floor.hpp), times what nearby kept floor (left, right, below) differs from it, and
//   - that of the best anchor that is not floor: left or right in the row, above in the column, or above one of the
//     columns near by (street_columns.hpp). Between a left and a right anchor of one surface inverse depth is linear.
//     The best anchor is the one with the least distance in pixels over depth: where two disagree, what was behind an
//     object is rather the farther of the two. A run's anchors of two surfaces go on along their planes.
// Distances up count less than those in the row, as walls are upright; those between columns more, and so a pole or a
// sign that stands in front of a car does not hide what is above the car. Where one floor is seen left and right of a
// run there is only floor between.
// Lanes are neighbouring pixels of a run.
// Invariant: reads kept vertices only, and of the missing those of its own chunk of rows, so chunks may be done in any
// order. Cost: two hundred instructions and more for as many missing pixels as there are lanes, some hundreds per run.
// Memory: 34 KiB of stack. Error: 1e-5 relative from the same formulas in double precision (3e-6 seen at 1920x1080),
// where these tell the candidates apart by more than that.
#ifndef NPSIM_MESH_DETAIL_STREET_BACKGROUND_HPP
#define NPSIM_MESH_DETAIL_STREET_BACKGROUND_HPP

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/bits.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/mesh/detail/connect.hpp"
#include "npsim/mesh/detail/layer.hpp"
#include "npsim/mesh/detail/street/columns.hpp"
#include "npsim/mesh/detail/street/crest.hpp"
#include "npsim/mesh/detail/street/floor.hpp"
#include "npsim/mesh/interpolate_rows.hpp"
#include "npsim/mesh/prune.hpp"
#include "npsim/mesh/sheet.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/bytes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct StreetBackgroundParams {
  float join_ratio = 1.3F;        // >= 1: anchors left and right whose depths differ by no more are one surface
  float same_ratio = 1.05F;       // >= 1: by no more than this, they surely are
  float above_weight = 5.0F;      // > 0: how much nearer an anchor above, and that of a sure surface, counts than one
                                  // beside; and how much farther a pixel to another column
  float trunk_width_m = 0.35F;    // >= 0: leaves side by side, no wider, are a trunk
  float floor_tolerance = 1.3F;   // >= 1: kept floor farther off the fitted one does not correct it
  float farthest_floor = 100.0F;  // > 0, in heights of the camera: beyond, floor and horizon cannot be told apart
};

namespace mesh_detail {

// First of the bits [from, n) that is set (flip 0) or not set (flip all ones); n if there is none.
[[nodiscard]] inline int next_bit(const std::uint64_t* words, int from, int n, std::uint64_t flip) noexcept {
  while (from < n) {
    const std::uint64_t word = (words[from / kWordBits] ^ flip) >> static_cast<unsigned>(from % kWordBits);
    if (word != 0) return std::min(n, from + lowest_set_bit(word));
    from = (from / kWordBits + 1) * kWordBits;
  }
  return n;
}

struct StreetBackground {
  StreetBackgroundParams params;
  float max_extension_ratio = 2;
  Intrinsics intrinsics;
  StreetColumns columns;

  [[nodiscard]] const StreetFloor& floor() const noexcept { return columns.floor.fitted; }
  [[nodiscard]] int width() const noexcept { return columns.state.width(); }

  // An end of a run.
  struct Anchor {
    bool kept = false;
    bool floor = false;
    bool pavement = false;
    bool blocked = false;
    double w = 0;       // inverse depth
    double factor = 0;  // floor: over the fitted one
    double raised = 0;  // floor: over the carriageway
    [[nodiscard]] bool upright() const noexcept { return kept && !floor; }
  };
  [[nodiscard]] Anchor anchor(int x, int y) const noexcept {
    Anchor a;
    if (x < 0 || x >= width()) return a;
    a.kept = columns.known(x, y);
    a.blocked = !a.kept;
    if (!a.kept) return a;
    a.w = 1.0 / static_cast<double>(columns.vertices(x, y).z);
    a.floor = columns.floor.contains(x, y);
    if (a.floor) {
      a.pavement = columns.floor.params.pavement.contains(columns.floor.labels(x, y));
      a.factor = columns.floor.factor(x, y, a.w);
      a.raised = a.w / floor().carriageway(x, y);
    }
    return a;
  }

  // Rows begin .. end - 1, a chunk. slope(x, y): d(inverse depth)/dx of what stands at the anchor (x, y).
  template <class F, class Slope>
  void fill(int begin, int end, const Slope& slope) const noexcept {
    using U = simd::BytesOf<F>;
    std::array<int, kRowsPerChunk> open{};  // per row: first column of the run that leaves the strip
    StreetCrest crest;
    for (int strip = 0; strip < width(); strip += kStripColumns) {
      const int n = std::min(kStripColumns, width() - strip);
      StreetCarried carried;
      std::array<std::uint64_t, kStripColumns / kWordBits> missing{};
      for (int y = begin; y < end; ++y) {
        const std::uint8_t* state = columns.state.row(y);
        for (int x = 0; x < n; x += kWordBits) {
          std::uint64_t& word = missing[static_cast<std::size_t>(x / kWordBits)];
          const std::uint64_t here = missing_bits<U>(state + strip + x, std::min(kWordBits, n - x));
          for_set_bits(y == begin ? here : here & ~word, [&](int i) {
            carried.take(load_guess(columns.vertices(strip + x + i, y)), y, static_cast<std::size_t>(x + i));
          });
          word = here;
        }
        int& first = open[static_cast<std::size_t>(y - begin)];
        for (int l = next_bit(missing.data(), 0, n, 0); l < n;) {
          const int r = next_bit(missing.data(), l, n, ~std::uint64_t{0});  // one past
          const bool continued = l == 0 && strip > 0 && state[strip - 1] == row_state::missing;
          if (!continued) first = strip + l;
          int last = strip + r - 1;
          if (r == n) last = end_of_run<U>(state, last);
          find_crest<F>(params.above_weight, column_reach(width()), y, static_cast<std::size_t>(l), r - l, carried,
                        crest);
          fill_run<F>(y, first, last, strip + l, strip + r, carried, crest, strip, slope);
          l = next_bit(missing.data(), r, n, 0);
        }
      }
    }
  }

 private:
  // Last column of the run of missing pixels that x is in.
  template <class U>
  [[nodiscard]] int end_of_run(const std::uint8_t* state, int x) const noexcept {
    while (++x < width()) {
      const int n = std::min(kWordBits, width() - x);
      const std::uint64_t other = nonzero_bits<U>(state + x, n);
      if (other != 0) return x + lowest_set_bit(other) - 1;
      x += n - 1;
    }
    return width() - 1;
  }

  // Pixels begin .. end - 1 of the run l .. r. A run with the sky at an end and no anchor at the other stays empty.
  template <class F, class Slope>
  void fill_run(int y, int l, int r, int begin, int end, const StreetCarried& carried, const StreetCrest& crest,
                int strip, const Slope& slope) const noexcept {
    Vec3f* row = columns.vertices.row(y);
    const Anchor left = anchor(l - 1, y);
    const Anchor right = anchor(r + 1, y);
    if (!left.kept && !right.kept && (left.blocked || right.blocked)) {
      std::fill(row + begin, row + end, Vec3f{});
      return;
    }
    const auto f32 = [](double v) { return static_cast<float>(v); };
    // Pavements on either side of the street are not one.
    const bool one_side = (l - 1 < floor().vanishing_x) == (r + 1 < floor().vanishing_x);
    const bool one_floor = left.floor && right.floor && left.pavement == right.pavement && (one_side || !left.pavement);
    const bool joined = left.upright() && right.upright() &&
                        std::max(left.w, right.w) <= static_cast<double>(params.join_ratio) * std::min(left.w, right.w);
    const F left_slope(left.upright() && !joined ? f32(slope(l - 1, y)) : 0.0F);
    const F right_slope(right.upright() && !joined ? f32(-slope(r + 1, y)) : 0.0F);
    const F left_w(f32(left.w));
    const F right_w(f32(right.w));
    const F left_raised(f32(left.raised));
    const F right_raised(f32(right.raised));
    const F left_factor(f32(left.factor));
    const F right_factor(f32(right.factor));
    const F limit(max_extension_ratio);
    const F shrink(1.0F / max_extension_ratio);
    const bool same =
        joined && std::max(left.w, right.w) <= static_cast<double>(params.same_ratio) * std::min(left.w, right.w);
    const F per_above(1.0F / params.above_weight);
    const F one(1.0F);
    const F zero(0.0F);
    const F surely(1.0F + 0x1p-20F);  // rounding decides nothing: a tie goes to the left, then to the right
    const F length(static_cast<float>(r - l + 2));
    const F per_length(1.0F / static_cast<float>(r - l + 2));
    const bool anchored = left.kept || right.kept;
    const auto extend = [&](F w, F change, F distance) {
      return simd::clamp(fma(change, distance, w), w * shrink, w * limit);
    };
    // The fitted floor in this row, from column l on.
    const double below = y - floor().vanishing_y;
    const auto kerb = [&](std::size_t side) {
      const double slope_of = floor().kerb_slope[side];
      return F(slope_of != 0.0 && below > 0 ? f32(1.0 / (slope_of * below)) : 0.0F);
    };
    const F kerb_left = kerb(0);
    const F kerb_right = kerb(1);
    const F beside_l(f32(l - floor().vanishing_x));
    const F plane_l(f32(floor().carriageway(l, y)));
    const F plane_change(f32(floor().per_column));
    const F raise(f32(floor().raise));
    const F horizon(floor().valid ? f32(1.0 / (static_cast<double>(params.farthest_floor) * floor().camera_height_m))
                                  : std::numeric_limits<float>::infinity());
    for (int x = begin; x < end; x += F::lanes) {
      const auto column = static_cast<std::size_t>(x - strip);
      const F i = to_float(typename F::Int(x - l) + F::Int::iota());
      const F dl = i + one;
      const F dr = length - dl;
      F w = zero;
      F least(std::numeric_limits<float>::infinity());
      typename F::MaskType beside(false);
      if (left.upright()) {
        w = extend(left_w, left_slope, dl);
        least = w * dl;
        beside = typename F::MaskType(true);
      }
      if (right.upright()) {
        const F of = extend(right_w, right_slope, dr);
        const auto better = of * dr * surely < least;
        w = select(better, of, w);
        least = select(better, of * dr, least);
        beside = beside | better;
      }
      if (same) least = least * per_above;
      if (!one_floor) {
        const auto at = static_cast<std::size_t>(x - begin);
        const F counts = F::load(crest.score.data() + at);
        const auto better = counts * surely < least;
        w = select(better, F::load(crest.inverse_depth.data() + at), w);
        beside = beside & ~better;
      }
      if (joined) w = select(beside, (left_w * dr + right_w * dl) * per_length, w);
      const F plane = fma(plane_change, i, plane_l);
      const auto near = plane > horizon;
      if (any(near)) {
        const F kept_below = F::load(carried.floor.data() + column);
        const auto has_below = kept_below > zero;
        F f;
        if (one_floor) {
          f = (left_raised * dr + right_raised * dl) * per_length;
        } else {
          // Mean with weights 1 / distance^2, over one denominator. Who has nothing to say is at distance 1.
          const F a = left.factor > 0 ? dl : one;
          const F b = right.factor > 0 ? dr : one;
          const F c = select(has_below, F::load(carried.floor_row.data() + column) - F(static_cast<float>(y)), one);
          const auto square = [](F v) { return v * v; };
          const F of_a = left.factor > 0 ? square(b * c) : zero;
          const F of_b = right.factor > 0 ? square(a * c) : zero;
          const F of_c = select(has_below, square(a * b), zero);
          const F weights = of_a + of_b + of_c;
          const F sum = left_factor * of_a + right_factor * of_b + kept_below * of_c;
          const F beside_px = beside_l + i;
          const F profile = simd::clamp(beside_px * select(beside_px < zero, kerb_left, kerb_right), one, raise);
          f = profile * select(weights > zero, sum / max(weights, F(1e-30F)), one);
        }
        const auto told = near & ((w > zero) | has_below | typename F::MaskType(anchored));
        w = select(told, max(w, plane * f), w);
      }
      if (anchored) {
        const F nearest = !right.kept ? left_w : (!left.kept ? right_w : select(dl <= dr, left_w, right_w));
        w = select(w > zero, w, nearest);
      }
      const auto found = w > zero;
      const simd::F32x3<F> v = unproject_pixels<F>(intrinsics, x, y, one / select(found, w, one));
      const simd::F32x3<F> out = {select(found, v.x, zero), select(found, v.y, zero), select(found, v.z, zero)};
      if (end - x >= F::lanes) {
        simd::store3(&row[x].x, out);
      } else {
        Vec3f part[F::lanes];
        simd::store3(&part[0].x, out);
        std::copy(part, part + (end - x), row + x);
      }
    }
  }
};

}  // namespace mesh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_STREET_BACKGROUND_HPP
