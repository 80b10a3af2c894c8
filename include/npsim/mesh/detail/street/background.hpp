// SPDX-License-Identifier: Apache-2.0
// What is behind the objects of a street, guessed per pixel: its floor, or something that stands on it, whichever is
// nearer to the camera. The inverse depth is the greater of
//   - the floor's (floor.hpp), times what nearby kept floor (left, right, below) differs from it, and
//   - that of the best anchor that is not floor: left or right in the row, above in the column, or above one of the
//     columns near by. Between a left and a right anchor of one surface inverse depth is linear. The best anchor is the
//     one with the least distance in pixels over depth: where two disagree, what was behind an object is rather the
//     farther of the two. A run's anchors of two surfaces go on along their planes.
// Distances up count less than those in the row, as walls are upright; those between columns more, and so a pole or a
// sign that stands in front of a car does not hide what is above the car. Where one floor is seen left and right of a
// run there is only floor between.
//
// What is above is upright: it goes on down at its inverse depth. Below a crown goes on what is above it, where that is
// farther (crowns seldom reach the ground): leaves are looked through for an eighth of the picture's height, unless
// they are so few side by side that they are a trunk.
//
// All missing pixels of one piece of a column have the same anchors above and below, so these are found where the piece
// begins and ends (StreetColumns). They are left in the missing vertices themselves, at the top of each piece and in
// every row that begins a chunk of rows: from there on a chunk carries them down in arrays, and knows nothing of other
// chunks. find_crest() then compares neighbouring columns, StreetBackground fills the rows. Lanes are neighbouring
// pixels of a run.
//
// Invariant: kept vertices are only read; strips of columns are independent, then chunks of rows are. Cost: states
// twice and labels once, 64 pixels at a time, some tens of instructions per piece of a column, some hundreds per run of
// a row, and two hundred and more for as many missing pixels as there are lanes. Memory: 34 KiB of stack. Error: 1e-5
// relative from the same formulas in double precision (3e-6 seen at 1920x1080), where these tell the candidates apart
// by more than that.
#ifndef NPSIM_MESH_DETAIL_STREET_BACKGROUND_HPP
#define NPSIM_MESH_DETAIL_STREET_BACKGROUND_HPP

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

#include "npsim/core/bits.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/detail/layer.hpp"
#include "npsim/mesh/detail/rows.hpp"
#include "npsim/mesh/detail/street/floor.hpp"
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

// The kept floor of a picture, and how far it is off the fitted one.
struct KeptFloor {
  StreetFloorParams params;
  StreetFloor fitted;
  double tolerance = 1.3;  // floor farther off the fitted one does not correct it
  ImageView<const Label> labels;

  [[nodiscard]] bool contains(int x, int y) const noexcept {
    return fitted.valid && params.is_floor(labels(x, y)) && fitted.carriageway(x, y) > 0;
  }
  // Of one of its pixels: its inverse depth w over the fitted one; 0 where too far off.
  [[nodiscard]] double factor(int x, int y, double w) const noexcept {
    const double factor = w / (fitted.carriageway(x, y) * fitted.profile(x, y));
    return factor <= tolerance && factor * tolerance >= 1.0 ? factor : 0.0;
  }
};

// Fits the vertex that is missing.
struct ColumnGuess {
  float upright = 0;        // inverse depth of the anchor above; 0: none
  float floor = 0;          // kept floor below over the fitted one; 0: none
  std::uint16_t above = 0;  // px to the anchor above, at most 65535
  std::uint16_t below = 0;  // px to the floor below
};
static_assert(sizeof(ColumnGuess) == sizeof(Vec3f));

[[nodiscard]] inline ColumnGuess load_guess(const Vec3f& v) noexcept {
  ColumnGuess g;
  std::memcpy(static_cast<void*>(&g), &v, sizeof g);
  return g;
}
inline void store_guess(const ColumnGuess& g, Vec3f& v) noexcept { std::memcpy(static_cast<void*>(&v), &g, sizeof g); }

// Rows in which every missing pixel has its guess.
[[nodiscard]] inline bool begins_chunk(int y) noexcept { return y % static_cast<int>(kRowsPerChunk) == 0; }

// The first n <= 64 pixels of a row that are missing.
template <class U>
[[nodiscard]] std::uint64_t missing_bits(const std::uint8_t* state, int n) noexcept {
  return ~nonzero_bits<U>(state, n) & low_bits(n);
}

// Columns that are walked down together: wide, as each row is another page of memory.
inline constexpr int kStreetColumns = 512;

struct StreetColumns {
  static constexpr int kWords = kStreetColumns / kWordBits;

  KeptFloor floor;
  ImageView<const std::uint8_t> state;
  ImageView<Vec3f> vertices;
  float trunk_px_m = 0;  // width of the thickest trunk in pixels, times its depth in metres

  [[nodiscard]] bool known(int x, int y) const noexcept { return state(x, y) == row_state::known; }
  [[nodiscard]] float inverse(int x, int y) const noexcept { return 1.0F / vertices(x, y).z; }

  // Columns begin .. end - 1, kStreetColumns at most.
  template <class F>
  void guess(int begin, int end) const noexcept {
    guess_from_above<F>(begin, end);
    if (floor.fitted.valid) guess_from_below<F>(begin, end);
  }

 private:
  // What stands above the pixel (x, y); 0: none. seen_row: last row that was kept and no leaves, since the last sky.
  [[nodiscard]] float upright(int x, int y, int seen_row) const noexcept {
    if (y == 0 || !known(x, y - 1) || floor.contains(x, y - 1)) return 0.0F;
    const float w = inverse(x, y - 1);
    const bool through = floor.labels(x, y - 1) == label::vegetation &&
                         seen_row >= std::max(0, y - state.height() / 8) && !floor.contains(x, seen_row) &&
                         !is_trunk(x, y - 1, trunk_px_m * w);
    return through ? std::min(w, inverse(x, seen_row)) : w;
  }

  // Whether the leaves at (x, y) are at most so many pixels wide.
  [[nodiscard]] bool is_trunk(int x, int y, float widest) const noexcept {
    const Label* row = floor.labels.row(y);
    int l = x;
    int r = x;
    while (l > 0 && row[l - 1] == label::vegetation && static_cast<float>(x - l) < widest) --l;
    while (r + 1 < state.width() && row[r + 1] == label::vegetation && static_cast<float>(r - l) < widest) ++r;
    return static_cast<float>(r - l + 1) <= widest;
  }

  template <class F>
  void guess_from_above(int begin, int end) const noexcept {
    using U = simd::BytesOf<F>;
    using I = typename F::Int;
    using M = typename F::MaskType;
    std::array<std::uint64_t, kWords> above{};  // missing in the row above
    std::array<float, kStreetColumns> w{};
    std::array<std::int32_t, kStreetColumns> anchor_row{};
    std::array<std::int32_t, kStreetColumns> seen_row;
    seen_row.fill(-1);
    for (int y = 0; y < state.height(); ++y) {
      for (int x = begin; x < end; x += kWordBits) {
        const int n = std::min(kWordBits, end - x);
        const auto first = static_cast<std::size_t>(x - begin);
        const std::uint8_t* row = state.row(y) + x;
        const std::uint64_t missing = missing_bits<U>(row, n);
        std::uint64_t& before = above[first / kWordBits];
        const std::uint64_t tops = missing & ~before;
        before = missing;
        for_set_bits(tops, [&](int i) {
          const std::size_t c = first + static_cast<std::size_t>(i);
          w[c] = upright(x + i, y, seen_row[c]);
          anchor_row[c] = y - 1;
        });
        for_set_bits(begins_chunk(y) ? missing : tops, [&](int i) {
          const std::size_t c = first + static_cast<std::size_t>(i);
          store_guess({w[c], 0, static_cast<std::uint16_t>(std::min(65535, y - anchor_row[c])), 0}, vertices(x + i, y));
        });
        if (missing == low_bits(n)) continue;
        const std::uint64_t kept = test_bytes<U>(row, n, [](U s) { return equal_bits(s, U(row_state::known)); });
        const std::uint64_t sky = low_bits(n) & ~missing & ~kept;
        const std::uint64_t leaves =
            test_bytes<U>(floor.labels.row(y) + x, n, [](U l) { return equal_bits(l, U(label::vegetation)); });
        const std::uint64_t seen = kept & ~leaves;
        if ((seen | sky) == 0) continue;
        for (int i = 0; i < n; i += F::lanes) {
          std::int32_t* at = seen_row.data() + first + i;
          const auto bits_of = [i](std::uint64_t b) {
            return M::from_bits(static_cast<std::uint32_t>(b >> static_cast<unsigned>(i)));
          };
          select(bits_of(seen), I(y), select(bits_of(sky), I(-1), I::load(at))).store(at);
        }
      }
    }
  }

  template <class F>
  void guess_from_below(int begin, int end) const noexcept {
    using U = simd::BytesOf<F>;
    std::array<std::uint64_t, kWords> below{};  // missing in the row below
    std::array<std::uint64_t, kWords> here{};
    std::array<float, kStreetColumns> factor{};
    std::array<std::int32_t, kStreetColumns> floor_row{};
    const auto words = [&](int y, std::array<std::uint64_t, kWords>& to) {
      for (int x = begin; x < end; x += kWordBits) {
        to[static_cast<std::size_t>(x - begin) / kWordBits] =
            y >= 0 ? missing_bits<U>(state.row(y) + x, std::min(kWordBits, end - x)) : 0;
      }
    };
    words(state.height() - 1, here);
    for (int y = state.height() - 1; y >= 0; --y) {
      std::array<std::uint64_t, kWords> above{};
      words(y - 1, above);
      for (int x = begin; x < end; x += kWordBits) {
        const auto first = static_cast<std::size_t>(x - begin);
        const std::size_t word = first / kWordBits;
        for_set_bits(here[word] & ~below[word], [&](int i) {
          const std::size_t c = first + static_cast<std::size_t>(i);
          const bool on_floor = y + 1 < state.height() && known(x + i, y + 1) && floor.contains(x + i, y + 1);
          factor[c] =
              on_floor
                  ? static_cast<float>(floor.factor(x + i, y + 1, 1.0 / static_cast<double>(vertices(x + i, y + 1).z)))
                  : 0.0F;
          floor_row[c] = y + 1;
        });
        for_set_bits(begins_chunk(y) ? here[word] : here[word] & ~above[word], [&](int i) {
          const std::size_t c = first + static_cast<std::size_t>(i);
          ColumnGuess g = load_guess(vertices(x + i, y));
          g.floor = factor[c];
          g.below = static_cast<std::uint16_t>(std::min(65535, floor_row[c] - y));
          store_guess(g, vertices(x + i, y));
        });
      }
      below = here;
      here = above;
    }
  }
};

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

  // A run of a row, and what its batches share: floats in every lane.
  template <class F>
  struct Run {
    Anchor left, right;
    bool anchored = false;   // by either
    bool joined = false;     // both anchors are upright and of one surface,
    bool same = false;       // surely
    bool one_floor = false;  // both are of one floor
    F left_w, right_w;
    F left_slope, right_slope;  // d(inverse depth) per pixel into the run
    F left_raised, right_raised, left_factor, right_factor;
    F length, per_length;  // px from anchor to anchor
    // The fitted floor in this row, from the run's first column on.
    F kerb_left, kerb_right;  // 1 / px from the vanishing column to the kerb
    F beside;                 // px from the vanishing column
    F plane, plane_change;
    F raise;
    F horizon;  // inverse depth from which on there is floor

    [[nodiscard]] bool between_sky() const noexcept { return !anchored && (left.blocked || right.blocked); }
  };

  template <class F, class Slope>
  [[nodiscard]] Run<F> run_between(int y, int l, int r, const Slope& slope) const noexcept {
    const auto f32 = [](double v) { return F(static_cast<float>(v)); };
    Run<F> run;
    run.left = anchor(l - 1, y);
    run.right = anchor(r + 1, y);
    const Anchor& left = run.left;
    const Anchor& right = run.right;
    run.anchored = left.kept || right.kept;
    // Pavements on either side of the street are not one.
    const bool one_side = (l - 1 < floor().vanishing_x) == (r + 1 < floor().vanishing_x);
    run.one_floor = left.floor && right.floor && left.pavement == right.pavement && (one_side || !left.pavement);
    const auto within = [&](float ratio) {
      return std::max(left.w, right.w) <= static_cast<double>(ratio) * std::min(left.w, right.w);
    };
    run.joined = left.upright() && right.upright() && within(params.join_ratio);
    run.same = run.joined && within(params.same_ratio);
    run.left_slope = f32(left.upright() && !run.joined ? slope(l - 1, y) : 0.0);
    run.right_slope = f32(right.upright() && !run.joined ? -slope(r + 1, y) : 0.0);
    run.left_w = f32(left.w);
    run.right_w = f32(right.w);
    run.left_raised = f32(left.raised);
    run.right_raised = f32(right.raised);
    run.left_factor = f32(left.factor);
    run.right_factor = f32(right.factor);
    run.length = F(static_cast<float>(r - l + 2));
    run.per_length = F(1.0F / static_cast<float>(r - l + 2));
    const double below = y - floor().vanishing_y;
    const auto kerb = [&](std::size_t side) {
      const double slope_of = floor().kerb_slope[side];
      return f32(slope_of != 0.0 && below > 0 ? 1.0 / (slope_of * below) : 0.0);
    };
    run.kerb_left = kerb(0);
    run.kerb_right = kerb(1);
    run.beside = f32(l - floor().vanishing_x);
    run.plane = f32(floor().carriageway(l, y));
    run.plane_change = f32(floor().per_column);
    run.raise = f32(floor().raise);
    run.horizon = floor().valid ? f32(1.0 / (static_cast<double>(params.farthest_floor) * floor().camera_height_m))
                                : F(std::numeric_limits<float>::infinity());
    return run;
  }

  // Inverse depth of what stands upright, dl and dr pixels from the anchors; 0: nothing. at: in the crest.
  template <class F>
  [[nodiscard]] F upright_at(const Run<F>& run, F dl, F dr, const StreetCrest& crest, std::size_t at) const noexcept {
    const F limit(max_extension_ratio);
    const F shrink(1.0F / max_extension_ratio);
    const F surely(1.0F + 0x1p-20F);  // rounding decides nothing: a tie goes to the left, then to the right
    const auto extend = [&](F w, F change, F distance) {
      return simd::clamp(fma(change, distance, w), w * shrink, w * limit);
    };
    F w(0.0F);
    F least(std::numeric_limits<float>::infinity());
    typename F::MaskType beside(false);
    if (run.left.upright()) {
      w = extend(run.left_w, run.left_slope, dl);
      least = w * dl;
      beside = typename F::MaskType(true);
    }
    if (run.right.upright()) {
      const F of = extend(run.right_w, run.right_slope, dr);
      const auto better = of * dr * surely < least;
      w = select(better, of, w);
      least = select(better, of * dr, least);
      beside = beside | better;
    }
    if (run.same) least = least * F(1.0F / params.above_weight);
    if (!run.one_floor) {
      const F counts = F::load(crest.score.data() + at);
      const auto better = counts * surely < least;
      w = select(better, F::load(crest.inverse_depth.data() + at), w);
      beside = beside & ~better;
    }
    return run.joined ? select(beside, (run.left_w * dr + run.right_w * dl) * run.per_length, w) : w;
  }

  // The kept floor around over the fitted carriageway, i pixels from the run's first. kept_below: 0 where there is
  // none.
  template <class F>
  [[nodiscard]] F floor_factor(const Run<F>& run, F i, F dl, F dr, F kept_below, F below_px) const noexcept {
    if (run.one_floor) return (run.left_raised * dr + run.right_raised * dl) * run.per_length;
    const F one(1.0F);
    const F zero(0.0F);
    // Mean with weights 1 / distance^2, over one denominator. Who has nothing to say is at distance 1.
    const auto has_below = kept_below > zero;
    const F a = run.left.factor > 0 ? dl : one;
    const F b = run.right.factor > 0 ? dr : one;
    const F c = select(has_below, below_px, one);
    const auto square = [](F v) { return v * v; };
    const F of_a = run.left.factor > 0 ? square(b * c) : zero;
    const F of_b = run.right.factor > 0 ? square(a * c) : zero;
    const F of_c = select(has_below, square(a * b), zero);
    const F weights = of_a + of_b + of_c;
    const F sum = run.left_factor * of_a + run.right_factor * of_b + kept_below * of_c;
    const F beside_px = run.beside + i;
    const F profile = simd::clamp(beside_px * select(beside_px < zero, run.kerb_left, run.kerb_right), one, run.raise);
    return profile * select(weights > zero, sum / max(weights, F(1e-30F)), one);
  }

  // Pixels begin .. end - 1 of the run l .. r. A run with the sky at an end and no anchor at the other stays empty.
  template <class F, class Slope>
  void fill_run(int y, int l, int r, int begin, int end, const StreetCarried& carried, const StreetCrest& crest,
                int strip, const Slope& slope) const noexcept {
    Vec3f* row = columns.vertices.row(y);
    const Run<F> run = run_between<F>(y, l, r, slope);
    if (run.between_sky()) {
      std::fill(row + begin, row + end, Vec3f{});
      return;
    }
    const F one(1.0F);
    const F zero(0.0F);
    for (int x = begin; x < end; x += F::lanes) {
      const auto column = static_cast<std::size_t>(x - strip);
      const F i = to_float(typename F::Int(x - l) + F::Int::iota());
      const F dl = i + one;
      const F dr = run.length - dl;
      F w = upright_at(run, dl, dr, crest, static_cast<std::size_t>(x - begin));
      const F plane = fma(run.plane_change, i, run.plane);
      const auto near = plane > run.horizon;
      if (any(near)) {
        const F kept_below = F::load(carried.floor.data() + column);
        const F below_px = F::load(carried.floor_row.data() + column) - F(static_cast<float>(y));
        const F f = floor_factor(run, i, dl, dr, kept_below, below_px);
        const auto told = near & ((w > zero) | (kept_below > zero) | typename F::MaskType(run.anchored));
        w = select(told, max(w, plane * f), w);
      }
      if (run.anchored) {
        const F nearest =
            !run.right.kept ? run.left_w : (!run.left.kept ? run.right_w : select(dl <= dr, run.left_w, run.right_w));
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
