// SPDX-License-Identifier: Apache-2.0
// The label half of the dual-reference variance filter: which windows hold two different labels, one of them in the
// foreground, and rows of bits, 64 columns a word, in which the filter keeps such answers. Part of uncertainty.hpp,
// which says what a window is.
//
// Labels become codes that differ exactly where the labels do and are at least kForegroundCode for the foreground set.
// By extremes: a window holds a foreground edge if and only if the least of its codes differs from the greatest and the
// greatest is a foreground code, and both are extremes over a square, which separate into rows and columns and into
// overlapping halves: log2(l) steps of bytes for any l. Pixels without depth take part as the neutral element of each
// extreme.
// By neighbours (EdgeWindows), for windows of 8 x 8 where no pixel is left out: a window holds two labels if and only
// if two of its pixels differ that are neighbours in a row or in a column. So three comparisons per pixel become bits,
// and what a window holds is an or of bits: over 8 rows of the foreground's, 8 rows by 7 columns of the differences
// along rows, 7 rows by 8 columns of those down columns. Each or is built from overlapping halves; the loops run over
// the rows of a band and are plain ones, which compilers turn into vector code.
//
// Exact. Cost: a tenth of an instruction per pixel where one label fills the columns of a register, half of one where
// no edge is near, three elsewhere (64 bytes a register); EdgeWindows takes half of what the extremes take. Memory: on
// the stack, 12 KiB up to l = 16, 100 KiB above.
#ifndef NPSIM_DEPTH_DETAIL_UNCERTAINTY_LABELS_HPP
#define NPSIM_DEPTH_DETAIL_UNCERTAINTY_LABELS_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/simd/bytes.hpp"
#include "npsim/simd/fixed.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

inline constexpr int kTileWindows = 128;   // columns of windows that are decided together
inline constexpr int kTileWords = 2;       // as bits
inline constexpr int kStripWindows = 512;  // columns of windows that are searched for edges together
inline constexpr int kStripWords = 8;
inline constexpr int kBytePadding = 64;  // what the last batch may read beyond the last column

// Rows of windows that are decided together. A tall band costs memory, a low one repeats l - 1 rows more often.
template <int kMaxWindow>
inline constexpr int kBandRows = kMaxWindow <= 16 ? 16 : 64;

inline constexpr std::uint8_t kForegroundCode = 64;

struct LabelCodes {
  explicit LabelCodes(LabelSet foreground) noexcept {
    for (int i = 0; i < 64; ++i) {
      const Label known = i < kLabelCount ? static_cast<Label>(i) : label::unlabeled;
      code[i] = foreground.contains(known) ? static_cast<std::uint8_t>(kForegroundCode + known) : known;
    }
  }
  alignas(64) std::uint8_t code[64];
};

// The codes of the pixels under a strip of windows of 8 x 8.
struct StripCodes {
  static constexpr int kWindow = 8;
  static constexpr std::size_t kRows = kBandRows<kWindow> + kWindow - 1;
  alignas(64) std::uint8_t row[kRows][kStripWindows + 2 * kBytePadding];
};

// A block of windows: their upper-left pixels are (x .. x + width - 1, y .. y + height - 1).
struct WindowBlock {
  int x;
  int y;
  int width;
  int height;
};

// out[i] = extremes of the l elements from i on, for 0 <= i < count. Destroys the input, whose count + l - 1 elements
// are followed by kBytePadding readable ones; `out` is written in whole batches.
template <class U>
void extremes_along_row(std::uint8_t* least, std::uint8_t* greatest, int count, int l, std::uint8_t* least_out,
                        std::uint8_t* greatest_out) noexcept {
  int held = 1;  // elements that an entry stands for
  for (; 2 * held < l; held *= 2) {
    for (int i = 0; i < count + l - 2 * held; i += U::lanes) {
      min(U::load(least + i), U::load(least + i + held)).store(least + i);
      max(U::load(greatest + i), U::load(greatest + i + held)).store(greatest + i);
    }
  }
  const int overlap = l - held;
  for (int i = 0; i < count; i += U::lanes) {
    min(U::load(least + i), U::load(least + i + overlap)).store(least_out + i);
    max(U::load(greatest + i), U::load(greatest + i + overlap)).store(greatest_out + i);
  }
}

// Bits of the entries that stand for a foreground edge, the first `count` (<= 64) of them.
template <class U>
[[nodiscard]] std::uint64_t edge_bits(const std::uint8_t* least, const std::uint8_t* greatest, int count) noexcept {
  std::uint64_t bits = 0;
  for (int i = 0; i < count; i += U::lanes) {
    const U low = U::load(least + i);
    const U high = U::load(greatest + i);
    bits |= (less_bits(low, high) & less_bits(U(kForegroundCode - 1), high)) << static_cast<unsigned>(i);
  }
  return count < 64 ? bits & ((std::uint64_t{1} << static_cast<unsigned>(count)) - 1) : bits;
}

template <class U>
[[nodiscard]] NPSIM_ALWAYS_INLINE U load_labels(const Label* p, int available) noexcept {
  return available >= U::lanes ? U::load(p) : U::load(p, available > 0 ? available : 0);
}
template <class U>
[[nodiscard]] U load_codes(const typename U::Table& table, const Label* p, int available) noexcept {
  return lookup(table, load_labels<U>(p, available));
}

// Columns in which some window of a band may fire, whatever the depth: bit i stands for x + i, i < kStripWindows. Keeps
// the codes if the window is that of StripCodes.
template <class F, int kMaxWindow>
void edge_columns(const LabelCodes& codes, ImageView<const Label> labels, const WindowBlock& block, int l,
                  std::uint64_t (&columns)[kStripWords], StripCodes& kept) noexcept {
  using U = simd::BytesOf<F>;
  constexpr std::size_t kSize = kStripWindows + kMaxWindow + 2 * kBytePadding;
  alignas(64) std::uint8_t least[kSize];
  alignas(64) std::uint8_t greatest[kSize];
  const typename U::Table table(codes.code);
  const int filled = block.width + l - 1;
  bool one_label[kSize / U::lanes];  // in each column of a batch: its codes are kept below, where they are needed
  int c = 0;
  for (; c < filled; c += U::lanes) {
    const Label* p = labels.row(block.y) + block.x + c;
    const int available = labels.width() - block.x - c;
    const std::ptrdiff_t ahead = available > 128 ? 128 : 0;  // two cache lines
    U low = load_labels<U>(p, available);
    U high = low;
    for (int y = 1; y < block.height + l - 1; ++y) {
      simd::prefetch(p + y * labels.stride() + ahead);
      const U own = load_labels<U>(p + y * labels.stride(), available);
      low = min(low, own);
      high = max(high, own);
    }
    one_label[c / U::lanes] = less_bits(low, high) == 0;
    if (less_bits(low, high) == 0) {
      low = lookup(table, low);
      high = low;
    } else {
      low = U(255);
      high = U(0);
      for (int y = 0; y < block.height + l - 1; ++y, p += labels.stride()) {
        const U code = lookup(table, load_labels<U>(p, available));
        low = min(low, code);
        high = max(high, code);
        if (l == StripCodes::kWindow) code.store(kept.row[y] + c);
      }
    }
    low.store(least + c);
    high.store(greatest + c);
  }
  for (const int end = c + kBytePadding; c < end; c += U::lanes) {  // is read, but reaches no window that counts
    U(0).store(least + c);
    U(0).store(greatest + c);
    if (l != StripCodes::kWindow) continue;
    for (int y = 0; y < block.height + l - 1; ++y) U(0).store(kept.row[y] + c);
  }
  alignas(64) std::uint8_t codes_of_columns[kSize];
  for (int i = 0; i < filled; i += U::lanes) U::load(least + i).store(codes_of_columns + i);
  extremes_along_row<U>(least, greatest, block.width, l, least, greatest);
  for (int w = 0; w < kStripWords; ++w) {
    const int left = block.width - 64 * w;
    columns[w] = left > 0 ? edge_bits<U>(least + 64 * w, greatest + 64 * w, left < 64 ? left : 64) : 0;
  }
  if (l != StripCodes::kWindow) return;
  for (int i = 0; i < filled; i += U::lanes) {
    if (!one_label[i / U::lanes]) continue;
    const int w = i / 64;
    const std::uint64_t own = w < kStripWords ? columns[w] : 0;
    if ((own | (w > 0 ? columns[w - 1] : 0)) == 0) continue;
    const U code = U::load(codes_of_columns + i);
    for (int y = 0; y < block.height + l - 1; ++y) code.store(kept.row[y] + i);
  }
}

template <class U>
struct Extremes {
  U low;
  U high;
};

template <class U>
[[nodiscard]] NPSIM_ALWAYS_INLINE Extremes<U> join(const Extremes<U>& a, const Extremes<U>& b) noexcept {
  return {min(a.low, b.low), max(a.high, b.high)};
}

// Windows of 8 x 8 that hold a foreground edge: `count` (at most 64) of them, `height` rows. least(y) and greatest(y)
// point to the codes of a row, or to the neutral element of each extreme. In registers: 8 pixels along a row are
// joined, then pairs, fours and eights of rows.
template <class F, class Least, class Greatest>
void edge_windows_8(const Least& least, const Greatest& greatest, int count, int height,
                    std::uint64_t* edges) noexcept {
  using U = simd::BytesOf<F>;
  using Pair = Extremes<U>;
  constexpr int kLead = StripCodes::kWindow - 1;
  for (int y = 0; y < height; ++y) edges[y] = 0;
  for (int c = 0; c < count; c += U::lanes) {
    const auto along_row = [&](int y) {
      const int row = y < height + kLead ? y : height + kLead - 1;
      const std::uint8_t* low = least(row) + c;
      const std::uint8_t* high = greatest(row) + c;
      Pair e{U::load(low), U::load(high)};
      for (int i = 1; i < StripCodes::kWindow; ++i) e = join(e, Pair{U::load(low + i), U::load(high + i)});
      return e;
    };
    Pair above = along_row(0);
    Pair pairs[2] = {above, above};
    Pair quads[4] = {above, above, above, above};
    const auto step = [&](int y, Pair& two, Pair& four) {
      const Pair row = along_row(y);
      const Pair new_two = join(above, row);
      above = row;
      const Pair new_four = join(two, new_two);
      two = new_two;
      const Pair eight = join(four, new_four);
      four = new_four;
      if (y < kLead || y >= height + kLead) return;
      const std::uint64_t bits = less_bits(eight.low, eight.high) & less_bits(U(kForegroundCode - 1), eight.high);
      edges[y - kLead] |= bits << static_cast<unsigned>(c);
    };
    for (int y = 1; y < height + kLead; y += 4) {
      step(y, pairs[0], quads[0]);
      step(y + 1, pairs[1], quads[1]);
      step(y + 2, pairs[0], quads[2]);
      step(y + 3, pairs[1], quads[3]);
    }
  }
  if (count == 64) return;
  for (int y = 0; y < height; ++y) edges[y] &= (std::uint64_t{1} << static_cast<unsigned>(count)) - 1;
}

// Codes as the extremes of valid pixels see them: bit i of `valid` stands for codes[i], i < count <= 128.
template <class F>
void mask_codes(const std::uint8_t* codes, const std::uint64_t (&valid)[2], int count, std::uint8_t* least,
                std::uint8_t* greatest) noexcept {
  using U = simd::BytesOf<F>;
  alignas(64) static constexpr std::uint8_t kLeast[64] = {255, 0};
  alignas(64) static constexpr std::uint8_t kGreatest[64] = {0, 255};
  const typename U::Table at_least(kLeast);
  const typename U::Table at_most(kGreatest);
  for (int c = 0; c < count; c += U::lanes) {
    const U is_valid = U::from_bits(valid[c / 64] >> static_cast<unsigned>(c % 64));
    const U code = U::load(codes + c);
    max(code, lookup(at_least, is_valid)).store(least + c);
    min(code, lookup(at_most, is_valid)).store(greatest + c);
  }
}

// Per row of windows in a block (at most kTileWindows by kBandRows), the windows that hold a foreground edge among all
// pixels or, where `depth` is given, among the pixels with valid depth.
template <class F, int kMaxWindow>
void edge_windows(const LabelCodes& codes, ImageView<const Label> labels, const ImageView<const float>* depth,
                  const WindowBlock& block, int l, std::uint64_t (*edges)[kTileWords]) noexcept {
  using U = simd::BytesOf<F>;
  constexpr std::size_t kRows = kBandRows<kMaxWindow> + kMaxWindow - 1;
  constexpr std::size_t kColumns = kTileWindows + kMaxWindow + 2 * kBytePadding;
  alignas(64) std::uint8_t least[kRows][kTileWindows];
  alignas(64) std::uint8_t greatest[kRows][kTileWindows];
  alignas(64) std::uint8_t low[kColumns];
  alignas(64) std::uint8_t high[kColumns];
  const typename U::Table table(codes.code);
  const int filled = block.width + l - 1;
  for (int y = 0; y < block.height + l - 1; ++y) {
    const Label* p = labels.row(block.y + y) + block.x;
    const int available = labels.width() - block.x;
    for (int c = 0; c < filled + kBytePadding; c += U::lanes) {
      const U code = c < filled ? load_codes<U>(table, p + c, available - c) : U(0);
      code.store(low + c);
      code.store(high + c);
    }
    if (depth != nullptr) {
      const float* z = depth->row(block.y + y) + block.x;
      for (int c = 0; c < filled; ++c) {
        const bool valid = is_valid_depth(z[c]);
        low[c] = valid ? low[c] : std::uint8_t{255};
        high[c] = valid ? high[c] : std::uint8_t{0};
      }
    }
    extremes_along_row<U>(low, high, block.width, l, least[y], greatest[y]);
  }
  const auto merge_rows = [&](int y, int other) {
    for (int c = 0; c < block.width; c += U::lanes) {
      min(U::load(least[y] + c), U::load(least[other] + c)).store(least[y] + c);
      max(U::load(greatest[y] + c), U::load(greatest[other] + c)).store(greatest[y] + c);
    }
  };
  int held = 1;
  for (; 2 * held < l; held *= 2) {
    for (int y = 0; y < block.height + l - 2 * held; ++y) merge_rows(y, y + held);
  }
  for (int y = 0; y < block.height; ++y) {
    merge_rows(y, y + l - held);
    for (int w = 0; w < kTileWords; ++w) {
      const int left = block.width - 64 * w;
      edges[y][w] = left > 0 ? edge_bits<U>(least[y] + 64 * w, greatest[y] + 64 * w, left < 64 ? left : 64) : 0;
    }
  }
}

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

// Of 128 bits that are not all 0.
[[nodiscard]] inline int lowest_set_bit(const std::uint64_t (&bits)[2]) noexcept {
  return bits[0] != 0 ? npsim::lowest_set_bit(bits[0]) : 64 + npsim::lowest_set_bit(bits[1]);
}
[[nodiscard]] inline int highest_set_bit(const std::uint64_t (&bits)[2]) noexcept {
  return bits[1] != 0 ? 64 + npsim::highest_set_bit(bits[1]) : npsim::highest_set_bit(bits[0]);
}
using npsim::highest_set_bit;
using npsim::lowest_set_bit;

// A row of bits as bytes 0 and 1.
template <class F>
void write_bits(const std::uint64_t* bits, std::uint8_t* out, int count) noexcept {
  using U = simd::BytesOf<F>;
  for (int x = 0; x < count; x += U::lanes) {
    const U bytes = U::from_bits(bits[x / 64] >> static_cast<unsigned>(x % 64));
    if (count - x >= U::lanes) {
      bytes.store(out + x);
    } else {
      bytes.store(out + x, count - x);
    }
  }
}

// Sets the l - 1 bits that follow each set bit. In place, in log2(l) steps; the highest words first, because a word
// depends on those below it.
inline void widen_bits(std::uint64_t* bits, int words, int l) noexcept {
  const int within = l < 64 ? l : 64;
  for (int i = words - 1; i >= 0; --i) {
    std::uint64_t own = bits[i];
    std::uint64_t below = i > 0 ? bits[i - 1] : 0;
    if ((own | below) == 0) continue;
    const auto drag = [&](int by) {
      own |= own << static_cast<unsigned>(by) | below >> static_cast<unsigned>(64 - by);
      below |= below << static_cast<unsigned>(by);
    };
    int held = 1;
    for (; 2 * held <= within; held *= 2) drag(held);
    if (held < within) drag(within - held);
    bits[i] = own;
  }
  for (int held = within; held < l;) {
    const int by = 2 * held <= l ? held : l - held;
    const int word = by / 64;
    const auto shift = static_cast<unsigned>(by % 64);
    for (int i = words - 1; i >= word; --i) {
      const std::uint64_t below = shift != 0 && i > word ? bits[i - word - 1] >> (64 - shift) : 0;
      bits[i] |= bits[i - word] << shift | below;
    }
    held += by;
  }
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_UNCERTAINTY_LABELS_HPP
