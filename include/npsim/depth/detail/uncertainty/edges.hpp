// SPDX-License-Identifier: Apache-2.0
// Windows of 8 x 8 that hold a foreground edge, where no pixel is left out: 64 windows a word. Part of uncertainty.hpp.
//
// A window holds two labels if and only if two of its pixels differ that are neighbours in a row or in a column. So
// three comparisons per pixel become bits, and what a window holds is an or of bits: over 8 rows of the foreground's,
// 8 rows by 7 columns of the differences along rows, 7 rows by 8 columns of those down columns. Each or is built from
// overlapping halves; the loops run over the rows of a band and are plain ones, which compilers turn into vector code.
//
// Exact. Cost: half of that by extremes (uncertainty_labels.hpp), which serve where pixels are left out. Memory: 2.3
// KiB of stack.
#ifndef NPSIM_DEPTH_DETAIL_UNCERTAINTY_EDGES_HPP
#define NPSIM_DEPTH_DETAIL_UNCERTAINTY_EDGES_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/depth/detail/uncertainty/labels.hpp"
#include "npsim/simd/bytes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

// The 128 windows of a tile that begin under `column` of the strip.
template <class F>
class EdgeWindows {
 public:
  static constexpr std::size_t kHeight = kBandRows<StripCodes::kWindow>;

  // Of `height` rows, in the words whose columns are not all 0.
  EdgeWindows(const StripCodes& codes, int column, int height, const std::uint64_t* columns) noexcept {
    const bool wanted[kTileWords + 2] = {false, columns[0] != 0, columns[1] != 0, false};
    for (int w = 0; w <= kTileWords; ++w) {
      if (wanted[w] || wanted[w + 1]) read(codes, column + 64 * w, height, bits_[w]);
    }
    // Each step for all words before the next one: what was stored last cannot be loaded at once by other registers.
    for (Bits& b : bits_) join_rows<kHeight + 8>(b, 1, 1);
    for (Bits& b : bits_) join_rows<kHeight + 8>(b, 2, 2);
    for (Bits& b : bits_) join_rows<kHeight>(b, 4, 3);
  }

  // The first `count` windows of a word.
  void word(int w, int count, std::uint64_t (&edges)[kHeight]) const noexcept {
    const Bits& own = bits_[w];
    const Bits& next = bits_[w + 1];
    const std::uint64_t counted =
        count < 64 ? (std::uint64_t{1} << static_cast<unsigned>(count)) - 1 : ~std::uint64_t{0};
    for (std::size_t y = 0; y < kHeight; ++y) {
      const std::uint64_t differs = from_here<7>(own.across[y] | own.down[y], next.across[y] | next.down[y]) |
                                    ahead<7>(own.down[y], next.down[y]);
      edges[y] = differs & from_here<8>(own.foreground[y], next.foreground[y]) & counted;
    }
  }

 private:
  static constexpr std::size_t kRows = kHeight + 16;  // beyond the pixels' 0, for loops of whole registers
  // Of 64 columns. First of a row of pixels, then of the rows that the windows of a row hold.
  struct Bits {
    alignas(64) std::uint64_t across[kRows];
    alignas(64) std::uint64_t down[kRows];
    alignas(64) std::uint64_t foreground[kRows];
  };

  template <int kBy>
  static NPSIM_ALWAYS_INLINE std::uint64_t ahead(std::uint64_t low, std::uint64_t high) noexcept {
    return low >> kBy | high << (64 - kBy);
  }
  // An or of kCount bits, 5 to 8: the own one and those above it.
  template <int kCount>
  static NPSIM_ALWAYS_INLINE std::uint64_t from_here(std::uint64_t low, std::uint64_t high) noexcept {
    low |= ahead<1>(low, high);
    high |= high >> 1U;
    low |= ahead<2>(low, high);
    high |= high >> 2U;
    return low | ahead<kCount - 4>(low, high);
  }

  template <std::size_t kCount>
  static void join_rows(Bits& bits, std::size_t by, std::size_t by_down) noexcept {
    for (std::size_t y = 0; y < kCount; ++y) bits.across[y] |= bits.across[y + by];
    for (std::size_t y = 0; y < kCount; ++y) bits.foreground[y] |= bits.foreground[y + by];
    for (std::size_t y = 0; y < kCount; ++y) bits.down[y] |= bits.down[y + by_down];
  }

  static void read(const StripCodes& codes, int column, int height, Bits& bits) noexcept {
    using U = simd::BytesOf<F>;
    const auto rows = static_cast<std::size_t>(height + StripCodes::kWindow - 1);
    for (std::size_t y = 0; y < rows; ++y) {
      const std::uint8_t* code = codes.row[y] + column;
      const std::uint8_t* below = codes.row[y + 1 < rows ? y + 1 : y] + column;
      std::uint64_t across = 0;
      std::uint64_t down = 0;
      std::uint64_t foreground = 0;
      for (int c = 0; c < 64; c += U::lanes) {
        const auto at = static_cast<unsigned>(c);
        const U own = U::load(code + c);
        across |= equal_bits(own, U::load(code + c + 1)) << at;
        down |= equal_bits(own, U::load(below + c)) << at;
        foreground |= less_bits(U(kForegroundCode - 1), own) << at;
      }
      bits.across[y] = ~across;
      bits.down[y] = ~down;
      bits.foreground[y] = foreground;
    }
  }

  Bits bits_[kTileWords + 1] = {};
};

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_UNCERTAINTY_EDGES_HPP
