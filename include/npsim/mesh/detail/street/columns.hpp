// SPDX-License-Identifier: Apache-2.0
// What the columns of a street tell of its missing pixels: the nearest thing above that is not floor, and the kept
// floor below. Part of street_background.hpp.
//
// All missing pixels of one piece of a column have the same answer, so it is found where the piece begins and ends. It
// is left in the missing vertices themselves, at the top of each piece and in every row that begins a chunk of rows:
// from there on a chunk carries it down in arrays, and knows nothing of other chunks.
//
// What is above is upright: it goes on down at its inverse depth. Below a crown goes on what is above it, where that is
// farther (crowns seldom reach the ground): leaves are looked through for an eighth of the picture's height, unless
// they are so few side by side that they are a trunk.
// Invariant: kept vertices are only read; strips of columns are independent. Exact but for the roundings to float.
// Cost: states twice and labels once, 64 pixels at a time, some tens of instructions per piece. Memory: 8 KiB of stack.
#ifndef NPSIM_MESH_DETAIL_STREET_COLUMNS_HPP
#define NPSIM_MESH_DETAIL_STREET_COLUMNS_HPP

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "npsim/core/bits.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/detail/layer.hpp"
#include "npsim/mesh/detail/street/floor.hpp"
#include "npsim/mesh/interpolate_rows.hpp"
#include "npsim/mesh/prune.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/bytes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
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

}  // namespace mesh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_STREET_COLUMNS_HPP
